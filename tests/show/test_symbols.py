"""Racks, laws of lift and tables in pictures: the drawn curves are where the parts touch."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import eomgen as eg
from eomgen.show.build_scene import build_scene


def lines(module: Any, role: str, name: str, **values: float) -> list[np.ndarray]:
    """Lines of a role and a name in ground axes, assembled at values."""
    scene = build_scene(module, module.x0(values)[: module.n_q, None])
    return [item.at(scene.frames[0]) for item in scene.items if (item.role, item.name) == (role, name)]


@pytest.mark.parametrize(("radius", "angle"), [(0.06, 0.0), (-0.06, 0.5)])
def test_a_rack_touches_its_pinion_where_both_move_alike(radius: float, angle: float) -> None:
    m = eg.Model("rack")
    pinion, rack = m.body("pinion", mass=1, inertia={"zz": 0.01}), m.body("rack", mass=1)
    m.revolute("A", m.ground.at(0.02, 0.1, 0), pinion, coordinate="a")
    m.prismatic("B", m.ground, rack, axis="x", coordinate="s")
    m.rack("mesh", pinion="A", rack="B", radius=radius)
    mod = m.compile(target="numpy")
    x0 = mod.x0(a=angle, a_dot=1.0)
    _, _, rack_line = lines(mod, "wheel", "mesh", a=angle)  # after the pinion and its spokes
    # a point of the pinion at height y moves with the speed -(y - 0.1) * 1; that of the rack is s_dot
    pitch = 0.1 - x0[mod.x_names.index("s_dot")]
    heights = rack_line[:-3, 1]
    assert heights.mean() == pytest.approx(pitch, abs=0.02 * abs(radius))
    assert heights.min() < pitch < heights.max()


def test_the_curve_of_a_lift_goes_through_the_follower_at_every_angle() -> None:
    m = eg.Model("lift", gravity=(0, -9.81, 0))
    cam, follower = m.body("cam", mass=1, inertia={"zz": 0.01}), m.body("follower", mass=0.2)
    m.revolute("C", m.ground, cam, coordinate="phi")
    m.prismatic("F", m.ground, follower, axis="y", coordinate="y")
    m.cam("law", cam="C", follower="F", lift="0.05 + 0.01*(1 - cos(theta)) + 0.004*sin(3*theta)", phase=0.3)
    mod = m.compile(target="numpy")
    for phi in (0.0, 0.8, 2.5, 5.0):
        (curve,) = lines(mod, "wheel", "law", phi=phi)
        tip = mod.poses(mod.x0(phi=phi)[: mod.n_q])[mod.body_names.index("follower"), :3, 3]
        starts, ways = curve[:-1], np.diff(curve, axis=0)
        part = np.clip(((tip - starts) * ways).sum(axis=1) / (ways**2).sum(axis=1), 0.0, 1.0)
        gaps = np.linalg.norm(starts + part[:, None] * ways - tip, axis=1)
        assert gaps.min() < 1e-3 * 0.05  # the sag of a chord of one degree


def test_a_contour_from_a_table_is_that_of_the_expression() -> None:
    t = np.linspace(0.0, 2.0 * np.pi, 241)

    def drawn(tabled: bool) -> np.ndarray:
        m = eg.Model("cam", gravity=(0, -9.81, 0))
        if tabled:
            m.table("law", t, 0.04 + 0.008 * np.cos(t), kind="periodic")
        cam, follower = m.body("cam", mass=1, inertia={"zz": 0.01}), m.body("follower", mass=0.2)
        m.revolute("C", m.ground, cam, coordinate="phi")
        m.prismatic("F", m.ground, follower, axis="y", coordinate="y")
        contour = "law(theta)" if tabled else "0.04 + 0.008*cos(theta)"
        m.cam_contact("touch", cam=cam, follower=follower, shape="roller", contour=contour, radius=0.008)
        scene = build_scene(mod := m.compile(target="numpy"), mod.assemble(phi=0.8, y=0.05)[:, None])
        (found,) = [i.points for i in scene.items if (i.role, i.name) == ("wheel", "touch") and len(i.points) > 100]
        return found

    assert drawn(True) == pytest.approx(drawn(False), abs=1e-4 * 0.04)


def test_a_wire_from_a_table_is_drawn() -> None:
    s = np.linspace(-1.0, 1.0, 41)
    m = eg.Model("wire", gravity=(0, -9.81, 0))
    m.table("path", s, s**2)
    m.curve_slider("w", m.ground, m.body("bead", mass=1), curve=["w", "path(w)", "0"])
    (wire,) = lines(m.compile(target="numpy"), "rail", "w", w=0.5)
    wire = wire[np.isfinite(wire).all(axis=1)]
    assert wire[:, 1] == pytest.approx(wire[:, 0] ** 2, abs=1e-3)
    assert np.ptp(wire[:, 0]) > 1.0


@pytest.mark.parametrize("crossed", [False, True])
@pytest.mark.parametrize("given", ["radii", "radii by a parameter"])
def test_pulleys_are_drawn_with_the_radii_that_are_given(crossed: bool, given: str) -> None:
    m = eg.Model("belt")
    first, second = (m.body(name, mass=1, inertia={"zz": 0.01}) for name in ("first", "second"))
    m.revolute("A", m.ground, first, coordinate="a")
    m.revolute("B", m.ground.at(0.4, 0, 0), second, coordinate="b")
    if given == "radii":
        m.belt("belt", "A", "B", radii=[0.06, 0.1], crossed=crossed)
    else:
        r = m.parameter("r", 0.06)
        m.belt("belt", "A", "B", radii=[r, "r + 0.04"], crossed=crossed)
    mod = m.compile(target="numpy")
    discs = [points[:, :2] for points in lines(mod, "wheel", "belt", a=0.3) if np.isfinite(points).all()]
    for disc, centre, radius in zip(discs, ([0, 0], [0.4, 0]), (0.06, 0.1), strict=True):
        assert np.linalg.norm(disc - centre, axis=1).max() == pytest.approx(radius, rel=1e-9)
