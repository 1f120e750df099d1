"""Robots shipped in PyPI packages against Pinocchio, fixed and floating, by every method, in C and in the evaluator."""

from __future__ import annotations

from typing import Any

import pytest
from robots.comparison import Compiled, Evaluated, largest_differences
from robots.pinocchio_judge import Judge
from robots.shipped import urdf_robots

import eomgen as eg
from eomgen.equations import METHODS

ROBOTS = urdf_robots()
STATES = 20
LIMIT = 1e-9


def test_there_are_enough_robots() -> None:
    assert len(ROBOTS) >= 25
    assert sum(floating for _, floating in ROBOTS.values()) >= 10
    assert sum(not floating for _, floating in ROBOTS.values()) >= 10


@pytest.fixture(scope="module")
def judged() -> Any:
    """Each robot is read and judged once, for all methods."""
    known: dict[str, Any] = {}

    def judge(name: str) -> Any:
        if name not in known:
            path, floating = ROBOTS[name]
            model = eg.load(path, floating=floating, actuate=True)
            names = model.derive().kinematics.names
            known.clear()
            known[name] = model, Judge(path, floating, model).states(names, STATES, seed=len(name))
        return known[name]

    return judge


@pytest.mark.slow
@pytest.mark.parametrize("method", sorted(METHODS))
@pytest.mark.parametrize("name", ROBOTS)
def test_robot_equals_pinocchio(name: str, method: str, judged: Any) -> None:
    model, states = judged(name)
    equations = model.derive(method)
    for run in (Evaluated(equations), Compiled(equations, optimize=0)):
        worst = largest_differences(model, run, states)
        assert max(worst.values()) <= LIMIT, (type(run).__name__, worst)


@pytest.mark.parametrize("name", ["panda", "solo12"])
def test_the_written_model_file_is_the_same_robot(name: str, judged: Any, tmp_path: Any) -> None:
    model, states = judged(name)
    model.save(tmp_path / "robot.yaml")
    again = eg.load(tmp_path / "robot.yaml")
    first, second = Evaluated(model.derive())(states[0]), Evaluated(again.derive())(states[0])
    for key, value in first.items():
        assert (second[key] == value).all()


@pytest.mark.parametrize("name", ["panda", "solo12"])
def test_links_kept_apart_are_the_same_robot(name: str, judged: Any) -> None:
    path, floating = ROBOTS[name]
    _, states = judged(name)
    apart = eg.load(path, floating=floating, actuate=True, merge=False)
    equations = apart.derive()
    merged = eg.load(path, floating=floating, actuate=True).derive()
    assert len(equations.kinematics.links) > len(merged.kinematics.links)
    assert equations.operations["bias"].total >= merged.operations["bias"].total
    assert max(largest_differences(apart, Evaluated(equations), states).values()) <= LIMIT


def test_symbolic_inertias_are_the_same_robot() -> None:
    path, _ = ROBOTS["panda"]
    model = eg.load(path, actuate=True, symbolic=True)
    plain = eg.load(path, actuate=True)
    assert "m_panda_link1" in model.parameters
    names = plain.derive().kinematics.names
    states = Judge(path, False, plain).states(names, 3, seed=5)
    module = model.derive().compile(target="numpy", kernels=["mass_matrix", "bias"])
    for s in states:
        assert module.mass_matrix(s.q) == pytest.approx(s.mass_matrix, rel=1e-9, abs=1e-10)
    heavier = module.mass_matrix(states[0].q, p=module.p * 2)
    assert abs(heavier - module.mass_matrix(states[0].q)).max() > 0.1
