"""Values of parameters that elements do not allow, given to a module by every way in; allowed ones pass."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from models import EXAMPLES

import eomgen as eg
from eomgen.errors import ModelError, ParameterError, UsageError
from eomgen.generation import generate
from eomgen.program.kept_rules import keep_rules
from eomgen.runtime.allowed_parameters import require_allowed

ALLOWED = {"k": 2e4, "r": 0.15, "mu": 0.5, "m_b": 2.0}
BAD = {"k": -1.0, "r": 0.0, "mu": -0.2, "m_b": -3.0}
#: What is said of each of them, and nothing else.
SAID = {
    "k": ["forces.floor.stiffness: is -1 with k = -1; must be greater than 0"],
    "r": ["forces.floor.first[0].radius: is 0 with r = 0; must be greater than 0"],
    "mu": ["forces.floor.friction: is -0.2 with mu = -0.2; must be 0 or greater"],
    "m_b": [
        "bodies.ball.mass: is -3 with m_b = -3; give a mass of 0 or more",
        "bodies.ball.inertia: the moment about the centre of mass is -0.015 with r = 0.1, m_b = -3; give",
    ],
}
MODEL = """
name: dropped
gravity: [0, -9.81, 0]
parameters: {k: 1.0e+4, r: 0.1, mu: 0.3, m_b: 1.0, e: 0.5}
bodies: {ball: {mass: m_b, inertia: {zz: m_b*r**2/2}}}
joints: {J: {type: planar, between: [ground, ball], coordinates: [x, y, phi]}}
forces:
  floor:
    {type: contacts, first: [{shape: circle, on: ball, radius: r}], second: [{shape: half_plane, on: ground}],
     stiffness: k, restitution: 1 - e**2, velocity: 1, friction: mu, smoothing: 0.01}
initial: {y: 0.3}
simulation: {end: 0.02}
"""


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    found = tmp_path_factory.mktemp("late") / "dropped.yaml"
    found.write_text(MODEL)
    return found


@pytest.fixture(scope="module")
def module(file: Path) -> Any:
    return eg.load(file).derive().compile(target="numpy")


def said(error: ModelError) -> list[str]:
    return [str(problem) for problem in error.problems]


@pytest.mark.parametrize("name", BAD)
def test_every_call_refuses_a_value_that_an_element_does_not_allow(module: Any, name: str) -> None:
    p = {name: BAD[name]}
    array = module.p
    array[module.p_names.index(name)] = BAD[name]
    x = module.x0()
    calls: list[Any] = [
        lambda: module.bind(p=p),
        lambda: module.bind(p=array),
        lambda: module.simulate(0.01, parameters=p),
        lambda: module.simulate_many(0.01, parameters=p, count=2),
        lambda: module.x0(p=p),
        lambda: module.rhs(0.0, x, p=p),
        lambda: module.sensitivities(["e"], 0.01, parameters=p),
        lambda: module.linearize(x=x, p=p),
    ]
    for call in calls:
        with pytest.raises(ParameterError) as caught:
            call()
        assert len(said(caught.value)) == len(SAID[name])
        assert all(text.startswith(start) for text, start in zip(said(caught.value), SAID[name], strict=True))
        assert isinstance(caught.value, UsageError)


def test_all_of_it_is_told_at_once(module: Any) -> None:
    with pytest.raises(ParameterError) as caught:
        module.bind(p={**BAD, "e": 1.0})
    found = said(caught.value)
    assert len(found) == len(set(found)) == 5  # four numbers, and the restitution that follows from e
    for lines in SAID.values():
        assert sum(line.startswith(lines[0]) for line in found) == 1
    assert "forces.floor.restitution: is 0 with e = 1; must be greater than 0 and at most 1" in found


def test_runs_of_an_ensemble_are_named(module: Any) -> None:
    with pytest.raises(ParameterError) as caught:
        module.simulate_many(0.01, parameters={"r": [0.1, -0.2, 0.1, -0.4], "e": [0.1, 0.1, 1.5, 0.1]})
    assert said(caught.value)[0] == (
        "forces.floor.first[0].radius: is -0.2 with r = -0.2 in run 1 and 1 more; must be greater than 0"
    )
    assert "forces.floor.restitution: is -1.25 with e = 1.5 in run 2; must be greater than 0 and at most 1" in said(
        caught.value
    )


def test_allowed_values_pass(module: Any) -> None:
    bound = module.bind(p=ALLOWED)
    run = module.simulate(0.01, parameters=ALLOWED)
    assert np.array_equal(run.x, bound.simulate(0.01).x)
    many = module.simulate_many(0.01, parameters={name: [value] * 3 for name, value in ALLOWED.items()})
    assert len(many) == 3


@pytest.mark.parametrize("name", sorted(file.stem for file in EXAMPLES.glob("*.yaml")))
def test_the_values_that_examples_declare_pass(name: str) -> None:
    mechanism = eg.load_example(name).mechanism()
    names = [p.name for p in mechanism.parameters]
    p = np.array([np.nan if one.value is None else one.value for one in mechanism.parameters])
    require_allowed({"p_names": names, **keep_rules(mechanism.requirements, names)}, p)


ALONE = """
import json, sys
sys.modules["eomgen"] = sys.modules["sympy"] = None
import dropped
try:
    dropped.simulate(0.01, parameters={"r": -0.1, "e": 1.0})
except dropped.errors.ParameterError as error:
    print(json.dumps([str(p) for p in error.problems]))
print(dropped.simulate(0.01, parameters={"r": 0.12}).status)
"""


def test_an_exported_package_refuses_by_itself(file: Path, tmp_path: Path) -> None:
    generate(eg.load(file), tmp_path, target="numpy")
    done = subprocess.run([sys.executable, "-c", ALONE], cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr[-2000:]
    found = json.loads(done.stdout.splitlines()[0])
    assert found[0] == "forces.floor.first[0].radius: is -0.1 with r = -0.1; must be greater than 0"
    assert any(line.startswith("forces.floor.restitution") for line in found)
