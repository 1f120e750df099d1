"""Angles that must not wrap: springs on joints that close a loop or between markers; springs whose ends meet."""

from __future__ import annotations

import numpy as np
import pytest

import eomgen as eg
from eomgen import Model
from eomgen.errors import ModelError


def crank_rocker(named: str, element: str = "joint") -> Model:
    """A four-bar whose crank carries a torsional spring; ``named`` decides which joints stay in the tree."""
    m = eg.Model("bars", gravity=(0, 0, 0))
    lengths = {"crank": 0.04, "coupler": 0.12, "rocker": 0.08}
    bars = [m.body(n, mass=1, com=(x / 2, 0, 0), inertia={"zz": 1e-3}) for n, x in lengths.items()]
    c = {j: f"q_{j}" if j in named else None for j in "ABCD"}
    m.revolute("A", m.ground, bars[0], coordinate=c["A"])
    m.revolute("B", bars[0].at(0.04, 0, 0), bars[1], coordinate=c["B"])
    m.revolute("C", bars[1].at(0.12, 0, 0), bars[2].at(0.08, 0, 0), coordinate=c["C"])
    m.revolute("D", m.ground.at(0.10, 0, 0), bars[2], coordinate=c["D"])
    if element == "joint":
        m.torsional_spring("s", joint="A", stiffness=0.02)
    else:
        m.torsional_spring("s", m.ground, bars[0], stiffness=0.02)
    m.output("crank_angle", m.coordinate(c["A"] or "A"))
    return m


@pytest.mark.parametrize(
    ("named", "element"), [("ABD", "joint"), ("BCD", "joint"), ("ABD", "markers"), ("BCD", "markers")]
)
def test_torsional_spring_winds_up_whichever_joint_is_cut(named: str, element: str) -> None:
    """The crank starts fast enough for more than one turn; energy is kept only if the angle does not wrap."""
    m = crank_rocker(named, element)
    crank = "q_A" if "A" in named else "A"
    equations = m.derive()
    assert equations.report.loop_joints == ["C" if "A" in named else "A"]
    module = equations.compile(target="numpy")
    rates = {f"{crank}_dot": 25.0}
    trajectory = module.simulate((0, 1), initial={crank: 0.9} | rates, rtol=1e-9, atol=1e-11)
    angle = trajectory[crank]
    assert np.ptp(angle) > 7.0
    assert np.abs(trajectory["crank_angle"] - angle).max() < 1e-9
    assert np.abs(np.diff(angle)).max() < 1.5
    assert trajectory.energy_drift < 1e-6
    assert np.abs(trajectory["V"] - 0.01 * angle**2).max() < 1e-9


def test_spring_on_an_angle_that_wraps_is_refused() -> None:
    m = eg.Model("rssr", gravity=(0, 0, -9.81))
    crank = m.body("crank", mass=1, inertia=(1, 1, 1))
    rod = m.body("rod", mass=1, inertia=(1, 1, 1))
    rocker = m.body("rocker", mass=1, inertia=(1, 1, 1))
    m.revolute("A", m.ground, crank, coordinate="theta")
    m.spherical("B", crank.at(0.3, 0, 0), rod)
    m.spherical("C", rod.at(1, 0, 0), rocker.at(0, 0.5, 0))
    m.revolute("D", m.ground.at(0.8, 0.2, 0.1), rocker, axis="x", coordinate="phi")
    m.torsional_spring("s", joint="C_1", stiffness=1.0)
    with pytest.raises(ModelError, match=r"forces\.s: the angle 'C_1' closes a loop in space.*name the coordinate"):
        m.derive()


def test_torsional_spring_between_markers_of_a_tree_has_a_potential_and_winds_up() -> None:
    m = eg.Model("shaft")
    disc = m.body("disc", mass=1, inertia=(1, 1, 0.5))
    m.revolute("A", m.ground, disc, coordinate="q")
    m.torsional_spring("k", m.ground.at(0, 0, 0, rpy=(0, 0, 0.3)), disc, stiffness=2.0, angle=0.1)
    for method in ("embedding", "lagrange"):
        module = m.derive(method).compile(target="numpy")
        for q in (3.1, 3.2, 9.0):
            assert module.rhs(0.0, [q, 0.0])[1] == pytest.approx(-2.0 * (q - 0.3 - 0.1) / 0.5, rel=1e-12)
            assert module.energy([q, 0.0])[1] == pytest.approx((q - 0.4) ** 2, rel=1e-12)


def test_spring_without_free_length_between_markers_that_meet() -> None:
    m = eg.Model("meet")
    ball = m.body("ball", mass=2, inertia=(1, 1, 1))
    m.prismatic("A", m.ground, ball, axis="x", coordinate="s")
    m.spring("k", m.ground, ball, stiffness=8.0)
    for method in ("embedding", "lagrange"):
        module = m.derive(method).compile(target="numpy")
        assert module.rhs(0.0, [0.0, 1.0]) == pytest.approx([1.0, 0.0])
        assert module.rhs(0.0, [0.5, 0.0]) == pytest.approx([0.0, -2.0])
        assert module.energy([0.5, 0.0])[1] == pytest.approx(1.0)


def test_euler_angles_singular_at_the_initial_configuration_only_are_no_fault_of_the_model() -> None:
    m = eg.Model("top")
    top = m.body("top", mass=1, inertia=(1, 1, 0.5))
    m.spherical("J", m.ground, top, sequence="zxz")
    assert m.check().degrees_of_freedom == 3


def test_angle_of_a_marker_is_the_sum_of_the_joint_angles() -> None:
    m = eg.Model("arm", gravity=(0, -9.81, 0))
    upper, lower = (m.body(n, mass=1, com=(1, 0, 0)) for n in ("upper", "lower"))
    m.revolute("shoulder", m.ground, upper)
    m.revolute("elbow", upper.at(1, 0, 0), lower)
    m.output("forearm", lower.angle)
    m.output("grip", lower.at(1, 0, 0, rpy=(0, 0, 0.5)).angle)
    module = m.compile(target="numpy")
    assert module.outputs(0.0, [3.0, 2.0, 0.1, 0.2]) == pytest.approx([5.0, 5.5], abs=1e-14)
