"""Rank, degrees of freedom, redundant rows and the partition, on mechanisms whose answers are in every textbook."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import eomgen as eg
from eomgen import Model
from eomgen.errors import AssemblyError, ModelError


def four_bar(tilt: tuple[float, float, float] = (0, 0, 0), **sizes: float) -> Model:
    """A crank-rocker of spatial revolute joints in a plane turned by ``tilt``."""
    a, b, c, d = (sizes.get(k, x) for k, x in zip("abcd", (0.04, 0.12, 0.08, 0.10), strict=True))
    m = eg.Model("four_bar", gravity=(0, -9.81, 0))
    crank = m.body("crank", mass=1, com=(a / 2, 0, 0), inertia=(1e-4, 1e-4, 1e-4))
    coupler = m.body("coupler", mass=1, com=(b / 2, 0, 0), inertia=(1e-4, 1e-4, 1e-4))
    rocker = m.body("rocker", mass=1, com=(c / 2, 0, 0), inertia=(1e-4, 1e-4, 1e-4))
    m.revolute("A", m.ground.at(0, 0, 0, rpy=tilt), crank, coordinate="theta")
    m.revolute("B", crank.at(a, 0, 0), coupler)
    m.revolute("C", coupler.at(b, 0, 0), rocker.at(c, 0, 0))
    x, y, z = eg_rotate(tilt, (d, 0.0, 0.0))
    m.revolute("D", m.ground.at(x, y, z, rpy=tilt), rocker, coordinate="phi")
    m.initial(theta=0.9)
    m.guess(phi=2.0, B=0.0)
    return m


def eg_rotate(rpy: tuple[float, float, float], x: tuple[float, float, float]) -> tuple[float, float, float]:
    """Fixed-axis roll, pitch, yaw applied to a vector."""
    from scipy.spatial.transform import Rotation

    return tuple(Rotation.from_euler("xyz", rpy).apply(x).tolist())


def test_planar_four_bar_of_spatial_joints_loses_the_rows_that_vanish() -> None:
    report = four_bar().derive().report
    assert report.degrees_of_freedom == 1
    assert report.gruebler_kutzbach == -2
    assert report.gruebler_kutzbach_planar == 1
    assert (report.constraints_declared, report.constraints, report.rank) == (5, 2, 2)
    assert report.redundant == []


def test_tilted_four_bar_loses_the_same_rows() -> None:
    report = four_bar(tilt=(0.3, -0.5, 0.7)).derive().report
    assert report.degrees_of_freedom == 1
    assert report.gruebler_kutzbach == -2
    assert (report.constraints_declared, report.constraints, report.rank) == (5, 2, 2)
    assert report.redundant == []


def test_spatial_tree_has_all_its_freedoms() -> None:
    m = eg.Model("arm", gravity=(0, 0, -9.81))
    base = m.body("base", mass=1, inertia=(1, 1, 1))
    hand = m.body("hand", mass=1, inertia=(1, 1, 1))
    m.free("root", m.ground, base)
    m.spherical("wrist", base.at(0, 0, 1), hand)
    report = m.derive().report
    assert report.degrees_of_freedom == report.gruebler_kutzbach == 9
    assert report.coordinates[:3] == ["root_x", "root_y", "root_z"]
    assert report.coordinates[6:] == ["wrist_1", "wrist_2", "wrist_3"]


def test_reference_is_the_assembled_closed_form() -> None:
    """Four-bar at theta = 0.9: the rocker angle from the cosine rule."""
    a, b, c, d, theta = 0.04, 0.12, 0.08, 0.10, 0.9
    x, y = d - a * math.cos(theta), -a * math.sin(theta)  # crank pin to rocker pivot
    reach = math.hypot(x, y)
    inner = math.acos((c**2 + reach**2 - b**2) / (2 * c * reach))
    expected = math.pi + math.atan2(y, x) - inner
    reference = four_bar().derive().report.reference
    assert reference["theta"] == 0.9
    assert reference["phi"] == pytest.approx(expected, abs=1e-12)


def test_open_loop_is_an_assembly_error_that_names_the_joint() -> None:
    with pytest.raises(AssemblyError, match=r"[ABCD]\.r_"):
        four_bar(d=0.5).derive()


def test_bad_independent_coordinates_are_refused() -> None:
    with pytest.raises(ModelError, match=r"independent.*'thet'.*did you mean 'theta'"):
        four_bar().derive(independent=["thet"])
    with pytest.raises(ModelError, match="1 degree of freedom;"):
        four_bar().derive(independent=["theta", "phi"])


def four_bar_and_wheel() -> eg.Model:
    m = eg.Model("two", gravity=(0, -9.81, 0))
    crank = m.body("a", mass=1, com=(0.2, 0, 0), inertia={"zz": 0.1})
    coupler = m.body("b", mass=1, com=(0.55, 0, 0), inertia={"zz": 0.1})
    rocker = m.body("c", mass=1, com=(0.4, 0, 0), inertia={"zz": 0.1})
    m.revolute("A", m.ground, crank, coordinate="q")
    m.revolute("B", crank.at(0.4, 0, 0), coupler, coordinate="s")
    m.revolute("C", coupler.at(1.1, 0, 0), rocker.at(0.8, 0, 0))
    m.revolute("D", m.ground.at(1.2, 0, 0), rocker, coordinate="r")
    m.revolute("E", m.ground, m.body("w", mass=1, inertia={"zz": 0.3}), coordinate="e")
    m.guess(q=0.6, s=-0.2, r=1.5)
    m.initial(q=0.6)
    return m


@pytest.mark.parametrize("name", ["q", "s", "r", "e", "C"])
def test_named_coordinates_are_kept_where_there_are_more_freedoms(name: str, tmp_path: Path) -> None:
    model = four_bar_and_wheel()
    called = model.compile(target="numpy", independent=[name]).minimal
    model.independent(name)
    (file := tmp_path / "two.yaml").write_text(model.to_yaml())
    for minimal in (called, model.compile(target="numpy").minimal, eg.load(file).compile(target="numpy").minimal):
        assert name in minimal.x_names[:2]
        assert len(set(minimal.x_names)) == 4
        z = minimal.x0()
        assert np.isfinite(minimal.rhs(0.0, z)).all()


def test_coordinates_that_cannot_be_independent_together_are_refused() -> None:
    model = four_bar_and_wheel()
    model.revolute("F", model.ground, model.body("x", mass=1, inertia={"zz": 0.3}), coordinate="f")
    with pytest.raises(ModelError, match="q, s cannot vary independently of each other"):
        model.derive(independent=["q", "s"])
    with pytest.raises(ModelError, match="e: named twice"):
        model.derive(independent=["e", "e_dot"])
    model.independent("C_dot", "f")  # as linearize takes them
    assert model.derive().independent == ("C", "e", "f")


def test_rank_needs_no_parameter_values() -> None:
    m = eg.Model("slider_crank", gravity=(0, -9.81, 0))
    r, length = m.parameter("r"), m.parameter("l")
    crank, rod, slider = (m.body(n, mass=1, inertia={"zz": 0.1}) for n in ("crank", "rod", "slider"))
    m.revolute("A", m.ground, crank, coordinate="theta")
    m.revolute("B", crank.at(r, 0, 0), rod)
    m.revolute("C", rod.at(length, 0, 0), slider)
    m.prismatic("D", m.ground, slider, axis="x", coordinate="s")
    equations = m.derive()
    assert equations.report.assumed
    assert equations.report.degrees_of_freedom == 1
    assert equations.mass_matrix.shape == (1, 1)
    with pytest.raises(ModelError, match=r"parameters\.l: has no value") as caught:
        equations.compile()
    assert [p.path for p in caught.value.problems] == ["parameters.r", "parameters.l"]


def test_coordinate_without_inertia_is_named() -> None:
    m = eg.Model("ghost", gravity=(0, -9.81, 0))
    arm = m.body("arm", mass=1, com=(1, 0, 0))
    ghost = m.body("ghost", mass=0)
    m.revolute("A", m.ground, arm)
    m.revolute("B", arm.at(1, 0, 0), ghost)
    with pytest.raises(ModelError, match=r"joints\.B.*no inertia"):
        m.check()


def test_massless_link_inside_a_loop_is_fine() -> None:
    """Positive definiteness is judged on the degrees of freedom: a massless connecting rod is allowed."""
    m = eg.Model("light_rod", gravity=(0, -9.81, 0))
    crank = m.body("crank", mass=1, inertia={"zz": 0.1})
    rod, slider = m.body("rod", mass=0), m.body("slider", mass=1)
    m.revolute("A", m.ground, crank, coordinate="theta")
    m.revolute("B", crank.at(0.1, 0, 0), rod)
    m.revolute("C", rod.at(0.3, 0, 0), slider)
    m.prismatic("D", m.ground, slider, axis="x", coordinate="s")
    m.initial(theta=0.4)
    m.guess(s=0.4)
    report = m.check()
    assert report.degrees_of_freedom == 1
    assert np.isclose(report.reference["s"], 0.1 * math.cos(0.4) + math.sqrt(0.09 - (0.1 * math.sin(0.4)) ** 2))
