"""``a.q`` and ``a.rod.end`` of an instance are taken by every door where ``a_q`` and ``a_rod.end`` are."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import command
import numpy as np
import pytest

import eomgen as eg

TEXT = """
name: pair
gravity: [0, -9.81, 0]
components:
  arm:
    attachments: [top]
    parameters: {l: {value: 0.5, unit: m}}
    inputs: {tau: 0}
    bodies: {rod: {mass: 1, com: [0, -l/2, 0], inertia: {zz: l**2/12}, markers: {end: [0, -l, 0]}}}
    joints: {hinge: {type: revolute, between: [top, rod], coordinate: q}}
    forces: {motor: {type: torque, joint: hinge, value: tau}}
    outputs: {height: y(rod.end)}
add:
  a: {component: arm, prefix: PREFIXa, at: ground, initial: {q: 0.3}}
  b: {component: arm, prefix: PREFIXb, at: a.rod.end}
"""
# with an underscore, as is usual, and without
PREFIXES = {
    "a_": TEXT.replace("PREFIXa", "a_").replace("PREFIXb", "b_"),
    "a": TEXT.replace("PREFIXa", "a").replace("PREFIXb", "b"),
}
RANGE = np.linspace(0.0, 0.5, 4)


@pytest.fixture(scope="module", params=PREFIXES)
def module(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Any:
    file = tmp_path_factory.mktemp("pair") / "pair.yaml"
    file.write_text(PREFIXES[request.param], encoding="utf-8")
    return eg.load(file).compile(target="numpy")


def dotless(module: Any, text: str) -> str:
    """What the model calls ``a.q``: the prefix of the instance, and the rest."""
    underscore = "_" if "a_q" in module.q_names else ""
    return text.replace("a.", f"a{underscore}").replace("b.", f"b{underscore}")


Door = Callable[[Any, Callable[[str], str]], Any]
DOORS: dict[str, Door] = {
    "x0": lambda m, n: m.x0({n("a.q"): 0.2, n("b.q_dot"): 1.0}),
    "x0 of a place": lambda m, n: m.x0({n("a.q"): 0.2, f"x({n('b.rod.end')})": 0.3}),
    "x0 of a velocity": lambda m, n: m.x0({n("a.q"): 0.2, f"vx({n('a.rod.end')})": 0.3}),
    "x0 of an output": lambda m, n: m.x0({n("a.height"): -0.3}),
    "assemble": lambda m, n: m.assemble({n("a.q"): 0.2}),
    "branches": lambda m, n: m.branches({n("a.q"): 0.2}),
    "bind": lambda m, n: m.bind(p={n("a.l"): 0.4}, u={n("b.tau"): 1.0}).rhs(0.0, m.x0()),
    "simulate": lambda m, n: m.simulate(0.1, initial={n("a.q"): 0.2}, parameters={n("a.l"): 0.4},
                                        inputs={n("b.tau"): 0.1}).x,
    "column": lambda m, n: m.simulate(0.1)[n("b.height")],
    "position of a run": lambda m, n: m.simulate(0.1).position(n("b.rod.end")),
    "simulate_many": lambda m, n: m.simulate_many(0.1, {n("a.q"): [0.1, 0.2]}, {n("b.l"): [0.4, 0.5]},
                                                  inputs={n("a.tau"): [0.0, 0.1]})[n("b.q")],
    "simulate_many of a place": lambda m, n: m.simulate_many(0.1, initial={f"x({n('a.rod.end')})": [0.1, 0.2]}).x,
    "grid": lambda m, n: m.simulate_many(0.1, grid={n("a.q"): [0.1, 0.2], n("b.l"): (0.4, 0.5, 2)}).x,
    "kinematic_analysis": lambda m, n: m.kinematic_analysis(**{n("a.q"): RANGE, n("b.q"): 0.1}).x,
    "equilibrium": lambda m, n: m.equilibrium({n("a.q"): 0.3}, hold={n("a.q"): 0.2}, unknowns=[n("a.tau")]).x,
    "linearize": lambda m, n: m.linearize({n("a.q"): 0.1}).A,
    "modes": lambda m, n: m.modes({n("a.q"): 0.0, n("b.q"): 0.0}).frequencies,
    "sensitivities": lambda m, n: m.sensitivities([n("a.l"), n("a.q")], 0.1).dx,
    "motion_range": lambda m, n: m.motion_range(n("a.q"), within=(-0.5, 0.5)).upper,
    "workspace": lambda m, n: m.workspace({n("a.q"): (0, 1, 4), n("b.q"): (0, 1, 3)}, n("b.height")).values,
    "consistent": lambda m, n: m.consistent(m.x0() + 1e-3, weights={n("a.q"): 3.0}, hold=[n("b.q")]),
    "actuator_forces": lambda m, n: m.actuator_forces(0.0, m.x0(), {n("a.q"): 1.0}, actuated=[n("a.q"), n("b.q")])
    .forces,
    "fit": lambda m, n: m.fit(m.simulate(0.1, t_eval=[0.0, 0.05, 0.1]), parameters=[n("a.l")]).values,
}  # fmt: skip


@pytest.mark.parametrize("door", DOORS)
def test_calls_of_a_module(module: Any, door: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        dotted = DOORS[door](module, str)
        plain = DOORS[door](module, lambda name: dotless(module, name))
    np.testing.assert_array_equal(np.asarray(dotted), np.asarray(plain))


VERBS = [  # words of the command line
    ("run", "--set", "a.q=0.2", "--set", "b.l=0.4", "--set", "b.tau=0.1", "--end", "0.1", "--target", "numpy"),
    ("run", "--set", "vx(a.rod.end)=0.2", "--set", "x(b.rod.end)=0.3", "--end", "0.1", "--target", "numpy"),
    ("kinematics", "--range", "a.q=0:0.5:4", "--range", "b.q=0:0.2:4", "--target", "numpy"),
    ("kinematics", "--limits", "a.q", "--target", "numpy"),
    ("kinematics", "--over", "a.q=0:1:4", "--over", "b.q=0:1:3", "--of", "b.height", "--target", "numpy"),
    ("ensemble", "--vary", "a.q=0:0.5", "--count", "3", "--end", "0.1", "--target", "numpy"),
    ("ensemble", "--grid", "a.q=0:0.5:2", "--grid", "b.l=0.4:0.5:2", "--end", "0.1", "--target", "numpy"),
    ("equilibrium", "--hold", "a.q=0.2", "--unknown", "a.tau", "--target", "numpy"),
    ("sensitivity", "--by", "a.l", "--by", "b.q", "--end", "0.1", "--target", "numpy"),
    ("inverse", "--actuated", "a.q", "--actuated", "b.q", "--accelerate", "a.q=1", "--target", "numpy"),
    ("linearize", "--set", "a.q=0.1", "--target", "numpy"),
    ("consistent", "--set", "a.q=0.1", "--hold", "a.q", "--weight", "b.q=3", "--target", "numpy"),
    ("impact", "--stop", "a.q", "--set", "a.q_dot=1", "--target", "numpy"),
    ("derive", "--independent", "a.q"),
    pytest.param(
        (
            "view",
            "--range",
            "a.q=0:0.5:4",
            "--trace",
            "b.rod.end",
            "--plot",
            "a.q",
            "--fps",
            "2",
            "--out",
            "motion.gif",
        ),
        marks=pytest.mark.thorough,
    ),
]


@pytest.mark.parametrize("words", VERBS, ids=lambda words: " ".join(words[:3]))
def test_verbs_of_the_command_line(words: tuple[str, ...], tmp_path: Path) -> None:
    prefix = list(PREFIXES)[len(words) % 2]
    (tmp_path / "pair.yaml").write_text(PREFIXES[prefix], encoding="utf-8")

    def plain(text: str) -> str:
        return text.replace("a.", prefix).replace("b.", prefix.replace("a", "b"))

    told = []
    for change in (str, plain):
        found = command.run(words[0], "pair.yaml", *map(change, words[1:]), "--json", cwd=tmp_path)
        assert found.code == 0, found.out + found.err
        told.append(plain(json.dumps(timeless(found.json))))
    assert told[0] == told[1]


def timeless(value: Any) -> Any:
    """A result without the times that it took."""
    if isinstance(value, dict):
        return {key: timeless(x) for key, x in value.items() if key not in ("seconds", "wall_seconds", "module")}
    return value
