"""Embedding in chosen axes: hinges about parallel axes resolved in common axes, free joints solved in their own."""

from __future__ import annotations

import numpy as np
import pytest

import eomgen as eg
from eomgen.equations import METHODS, embedding
from eomgen.graph import evaluate
from eomgen.graph.core import Expr
from eomgen.kinematics import Kinematics, analyse
from eomgen.kinematics.link_axes import turn_links
from eomgen.program.factor import factorize, solve


def leg(free: bool) -> eg.Model:
    """A base, two rows of parallel hinges on it with turned markers, a slide and a ball at their ends, and forces."""
    m = eg.Model("leg", gravity=(0.3, "-g", 0.2))
    m.parameter("g", 9.81)
    m.parameter("k", 30.0)
    inertia = {"xx": 0.2, "yy": 0.3, "zz": 0.25, "xy": 0.02, "yz": -0.01}
    base = m.body("base", mass=4.0, com=(0.1, 0.2, -0.1), inertia=inertia)
    if free:
        m.free("base", m.ground, base, rotation="euler_parameters")
    else:
        m.revolute("turn", m.ground, base, axis="x")
    for side in (1, -1):
        at = base.at(0.2 * side, 0.1, 0, rpy=(0.4 * side, 0.2, 0.1))
        for k in range(4):
            link = m.body(f"link_{k}_{side + 1}", mass=1.0 + k, com=(0.1, 0.03 * k, 0.05), inertia=inertia)
            m.revolute(f"q_{k}_{side + 1}", at, link)
            m.damper(f"damper_{k}_{side + 1}", m.ground, link, damping=0.3)
            m.spring(f"spring_{k}_{side + 1}", m.ground.at(1, 2, 3), link.at(0.1, 0, 0.2), stiffness="k", length=0.5)
            at = link.at(0.5, 0.02, 0.1, rpy=(0, 0, 0.3 * k))  # turned about the axis: still parallel
        slider = m.body(f"slider_{side + 1}", mass=0.4, com=(0.01, 0.02, 0.03), inertia=inertia)
        m.prismatic(f"s_{side + 1}", at, slider, axis="y")
        ball = m.body(f"ball_{side + 1}", mass=0.3, com=(0.1, 0, 0), inertia=inertia)
        m.spherical(f"b_{side + 1}", slider.at(0.1, 0.2, 0.3), ball, rotation="euler_parameters")
    return m


def values(kinematics: Kinematics) -> dict[str, float]:
    random = np.random.default_rng(11)
    names = [*kinematics.names, *kinematics.velocity_names, *(str(a.node[1]) for a in kinematics.a)]
    drawn = {name: float(random.uniform(-1, 1)) for name in names}
    for first, _ in kinematics.quaternion_slots:
        e = random.normal(size=4)
        drawn |= dict(zip(kinematics.names[first : first + 4], (e / np.linalg.norm(e)).tolist(), strict=True))
    return drawn | {"g": 9.81, "k": 30.0, "t": 0.0}


@pytest.mark.parametrize("free", [True, False])
@pytest.mark.parametrize("common", [True, False])
def test_axes_do_not_change_the_equations(free: bool, common: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """M, h, M a + h in common axes and in own ones against articulated bodies and Lagrange; and the turned system."""
    costs = iter([0, 1] if common else [1, 0])  # the first asked for is that of common axes
    monkeypatch.setattr(embedding, "_cost", lambda *_: next(costs))
    kinematics = analyse(leg(free).mechanism())
    at = values(kinematics)
    tree = embedding.derive(kinematics)
    assert next(costs, None) is None
    other, recursive = METHODS["lagrange"](kinematics), METHODS["recursive"](kinematics)
    n = len(kinematics.v)

    def numbers(expressions: list[Expr]) -> np.ndarray:
        return np.array(evaluate(expressions, at), dtype=float)

    M, M_other = (numbers([x for row in e.mass_matrix for x in row]).reshape(n, n) for e in (tree, other))
    assert np.abs(M - M_other).max() <= 1e-11 * np.abs(M).max()
    for what in ("bias", "inverse_dynamics"):
        one, two, three = (numbers(list(getattr(e, what))) for e in (tree, other, recursive))
        assert np.abs(one - two).max() <= 1e-11 * np.abs(one).max()
        assert np.abs(one - three).max() <= 1e-11 * np.abs(one).max()
    expected = np.linalg.solve(M, -numbers(list(tree.bias)))
    assert (tree.turned is not None) == free == bool(turn_links(kinematics)[1])
    assert recursive.accelerations is not None
    assert np.abs(numbers(list(recursive.accelerations)) - expected).max() <= 1e-10 * np.abs(expected).max()
    if tree.turned is not None:
        mass, bias = tree.turned.system
        found = tree.turned.accelerations(solve(factorize(mass, kinematics.parent), [-h for h in bias]))
        assert np.abs(numbers(found) - expected).max() <= 1e-10 * np.abs(expected).max()
