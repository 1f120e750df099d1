"""Robots shipped in PyPI packages against Pinocchio, fixed and floating, by every method, in C and in the evaluator.

All methods are judged in the evaluator on both bases, and some robots in Euler angles too.  Compiled are ``embedding``
and ``recursive`` on a robot's own base (one that walks, flies or rolls floats by Euler parameters), ``recursive``
also on the other one where there are not too many velocities, and ``lagrange``, whose C takes longest, where there are
few.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from robots.comparison import Compiled, Evaluated, largest_differences
from robots.pinocchio_judge import Judge
from robots.shipped import urdf_robots
from sweeps import part_of

import eomgen as eg

ROBOTS = urdf_robots()
STATES = 20
#: What robots are simulated by; tests/forms and tests/acceptance hold the other forms against these.
FORMS = ("embedding", "lagrange", "recursive")
LIMIT = 1e-9
FEW, MANY = 8, 24
FIXED, FLOATING, ANGLES = "fixed", "euler_parameters", "euler_angles"
OWN = [(name, FLOATING if floating else FIXED) for name, (_, floating) in ROBOTS.items()]
MASSLESS = [name for name in ("cart-pole", "pendulum of five") if name in ROBOTS]  #: their roots
OTHER = [
    (name, FIXED if floating else FLOATING)
    for name, (_, floating) in ROBOTS.items()
    if name not in MASSLESS and name != "iris"  # a drone: nothing moves once it is fixed
]
TURNED = [(name, ANGLES) for name in ("panda", "bolt", "solo12", "anymal", "borinot", "talos")]
#: By all methods and on all bases; the others always by the method that is chosen for them on their own base.
ALWAYS = ("finger", "panda", "bolt", "racecar")
CASES = [(name, base, method) for name, base in [*OWN, *OTHER, *TURNED] for method in FORMS]


def is_kept(case: tuple[str, str, str]) -> bool:
    name, base, method = case
    return name in ALWAYS or (method == "recursive" and (name, base) in OWN)


def load(name: str, base: str, **options: Any) -> Any:
    rotation = ANGLES if base == FIXED else base
    options = {"mimic": "independent", **options}  # as in Pinocchio
    return eg.load(ROBOTS[name][0], floating=base != FIXED, rotation=rotation, actuate=True, **options)


def test_there_are_enough_robots() -> None:
    assert len(ROBOTS) >= 25
    for pairs in (OWN, OTHER):
        assert sum(base == FIXED for _, base in pairs) >= 10
        assert sum(base == FLOATING for _, base in pairs) >= 10


@pytest.fixture(scope="module")
def judged() -> Any:
    """Each robot is read and judged once, for all methods."""
    known: dict[tuple[str, str], Any] = {}

    def judge(name: str, base: str) -> Any:
        if (name, base) not in known:
            model = load(name, base)
            kinematics = model.derive("recursive").kinematics
            known.clear()
            judge = Judge(ROBOTS[name][0], base != FIXED, model, base)
            known[name, base] = model, judge.states(kinematics, STATES, seed=len(name))
        return known[name, base]

    return judge


@pytest.mark.slow
@pytest.mark.parametrize(("name", "base", "method"), part_of(CASES, is_kept))
def test_robot_equals_pinocchio(name: str, base: str, method: str, judged: Any) -> None:
    model, states = judged(name, base)
    equations = model.derive(method)
    runs: list[Any] = [Evaluated(equations)]
    own, n = (name, base) in OWN, len(states[0].v)
    if n <= FEW or (own and method == "embedding") or (method == "recursive" and (own or n <= MANY)):
        runs.append(Compiled(equations, optimize=0, lanes=0))  # called state by state
    for run in runs:
        worst = largest_differences(model, run, states)
        assert max(worst.values()) <= LIMIT, (type(run).__name__, worst)


@pytest.mark.parametrize("name", MASSLESS)
def test_a_base_without_mass_cannot_float(name: str, judged: Any) -> None:
    model, states = judged(name, FLOATING)
    for s in states:
        sizes = np.linalg.eigvalsh(s.mass_matrix)
        assert sizes[0] < 1e-12 * sizes[-1]
    with pytest.raises(eg.ModelError, match="no inertia behind it"):
        model.compile(target="numpy", kernels=["rhs"])


@pytest.mark.parametrize(("name", "base"), [("panda", FIXED), ("solo12", FLOATING)])
def test_the_written_model_file_is_the_same_robot(name: str, base: str, judged: Any, tmp_path: Any) -> None:
    model, states = judged(name, base)
    model.save(tmp_path / "robot.yaml")
    again = eg.load(tmp_path / "robot.yaml")
    (first,), (second,) = (Evaluated(m.derive())(states[:1]) for m in (model, again))
    for key, value in first.items():
        assert (second[key] == value).all()


@pytest.mark.parametrize(("name", "base"), [("panda", FIXED), ("solo12", FLOATING)])
def test_links_kept_apart_are_the_same_robot(name: str, base: str, judged: Any) -> None:
    _, states = judged(name, base)
    apart, merged = (load(name, base, merge=merge).derive("embedding") for merge in (False, True))
    model = load(name, base, merge=False)
    assert len(apart.kinematics.links) > len(merged.kinematics.links)
    more, fewer = (e.operations["mass_matrix and bias"].total for e in (apart, merged))
    assert fewer <= 1.02 * more  # frames without turns fold to nothing, so that little is lost
    assert max(largest_differences(model, Evaluated(apart), states).values()) <= LIMIT


def test_symbolic_inertias_are_the_same_robot(judged: Any) -> None:
    model = load("panda", FIXED, symbolic=True)
    assert "m_panda_link1" in model.parameters
    _, states = judged("panda", FIXED)
    module = model.derive().compile(target="numpy", kernels=["mass_matrix", "bias"])
    for s in states[:3]:
        assert module.mass_matrix(s.q) == pytest.approx(s.mass_matrix, rel=1e-9, abs=1e-10)
    heavier = module.mass_matrix(states[0].q, p=module.p * 2)
    assert abs(heavier - module.mass_matrix(states[0].q)).max() > 0.1
