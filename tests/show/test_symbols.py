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


def pushed() -> eg.Model:
    m = eg.Model("pushed", gravity=(0, -9.81, 0))
    arm, wheel = (
        m.body("arm", mass=1, com=(0.25, 0, 0), inertia={"zz": 0.02}),
        m.body("wheel", mass=2, inertia={"zz": 0.01}),
    )
    m.revolute("A", m.ground, arm, coordinate="a")
    m.revolute("B", arm.at(0.5, 0, 0), wheel)
    slider = m.body("slider", mass=1)
    m.prismatic("D", m.ground.at(0, -0.3, 0), slider, axis="x", coordinate="s")
    m.force("down", arm.at(0.4, 0, 0), (0, -3, 0))
    m.force("along", arm.at(0.4, 0, 0), ("sin(t)", 0, 0), axes="body")
    m.torque("twist", wheel, (0, 0, -0.5))
    m.stop("end", "s", lower=-0.1, upper=0.3, stiffness=100)
    m.stop("bump", "a", upper=1, stiffness=100)
    return m


def test_given_forces_torques_and_stops_are_to_be_seen() -> None:
    """Arrows end where forces act, in their direction; walls stand at the limits of a slide."""
    mod = pushed().compile(target="numpy")
    (down,) = lines(mod, "pull", "down", a=0.3)
    place = 0.4 * np.array([np.cos(0.3), np.sin(0.3), 0])
    assert down[[1, 4]] == pytest.approx(np.array([place, place]), abs=1e-12)
    assert (down[1] - down[0]) / np.linalg.norm(down[1] - down[0]) == pytest.approx([0, -1, 0])
    (along,) = lines(mod, "pull", "along", a=0.3)
    assert (along[1] - along[0]) / np.linalg.norm(along[1] - along[0]) == pytest.approx(place / 0.4)
    (twist,) = lines(mod, "pull", "twist", a=0.3)
    around = twist - np.array([0.5 * np.cos(0.3), 0.5 * np.sin(0.3), 0])
    first, second, *_ = around
    assert np.cross(first, second)[2] < 0.0  # it turns as the torque does
    (walls,) = lines(mod, "force", "end", a=0.3, s=0.1)
    assert sorted(set(walls[np.isfinite(walls[:, 0]), 0].round(9))) == [-0.1, 0.3]
    assert len(lines(mod, "force", "bump")) == 1


@pytest.mark.parametrize("moments", [(0.1, 0.2, 0.15), (0.02, 0.02, 0.04)], ids=["any", "disc"])
def test_a_body_with_inertia_only_hides_nothing_and_shows_its_turning(moments: tuple[float, ...]) -> None:
    """Sections of the ellipsoid of a uniform body: I_x = m (b^2 + c^2) / 5; a disc with a line to its rim."""
    m = eg.Model("top")
    m.spherical("Q", m.ground, m.body("top", mass=2, inertia=moments))
    m.revolute("A", m.ground, m.body("arm", mass=1, com=(0.5, 0, 0), inertia=(0.1, 0.1, 0.1)))
    mod = m.compile(target="numpy")
    scene = build_scene(mod, mod.x0()[: mod.n_q, None])
    own = [item for item in scene.items if item.name == "top" and item.role != "joint"]
    if moments[0] != moments[1]:
        (rings,) = own
        assert rings.faces is None
        x, y, z = np.nanmax(rings.points, axis=0) ** 2
        assert 2 * np.array([y + z, z + x, x + y]) / 5 == pytest.approx(moments, rel=1e-12)
        return
    disc, mark = own
    assert disc.faces is not None
    assert mark.faces is None
    assert np.nanmax(np.hypot(*mark.points[:, :2].T)) == pytest.approx(np.sqrt(2 * 0.04 / 2))


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


def cam_by_lift(turns: bool, swings: bool) -> eg.Model:
    """A cam that turns or slides, with a follower that swings or slides; what is led is the follower's marker tip."""
    m = eg.Model("lift", gravity=(0, -9.81, 0))
    cam = m.body("cam", mass=1, inertia={"zz": 0.01})
    follower = m.body("follower", mass=0.2, com=(0.05, 0, 0) if swings else None, inertia={"zz": 1e-3})
    follower.marker("tip", at=(0.1, 0, 0) if swings else (0, 0, 0))
    add = m.revolute if turns else m.prismatic
    add("C", m.ground, cam, coordinate="c", **({} if turns else {"axis": "x"}))
    if swings:
        m.revolute("F", m.ground.at(-0.09, 0.05, 0), follower, coordinate="f")
    else:
        m.prismatic("F", m.ground, follower, axis="y", coordinate="f")
    rise = "0.01*(1 - cos(theta)) + 0.004*sin(3*theta)" if turns else "0.01*sin(30*theta)"
    m.cam(
        "law", cam="C", follower="F", lift=f"{'-0.1 + 4*' if swings else '0.05 + '}({rise})", phase=0.3 if turns else 0
    )
    return m


@pytest.mark.parametrize("swings", [False, True])
@pytest.mark.parametrize("turns", [True, False])
def test_the_curve_of_a_lift_goes_through_the_follower_at_every_position_of_the_cam(turns: bool, swings: bool) -> None:
    mod = cam_by_lift(turns, swings).compile(target="numpy")
    reach = 0.1 if swings else 0.0
    for c in (0.0, 0.8, 2.5, 5.0) if turns else (-0.02, 0.0, 0.03):
        (curve,) = lines(mod, "wheel", "law", c=c)
        pose = mod.poses(mod.x0(c=c)[: mod.n_q])[mod.body_names.index("follower")]
        tip = pose[:3, :3] @ [reach, 0, 0] + pose[:3, 3]
        starts, ways = curve[:-1], np.diff(curve, axis=0)
        part = np.clip(((tip - starts) * ways).sum(axis=1) / (ways**2).sum(axis=1), 0.0, 1.0)
        gaps = np.linalg.norm(starts + part[:, None] * ways - tip, axis=1)
        assert gaps.min() < 1e-3 * 0.05  # the sag of a chord of one degree


@pytest.mark.parametrize("law", [{"support": "0.04 + 0.008*cos(theta)"}, {"contour": "0.04 + 0.006*cos(theta)"}])
def test_a_flat_face_lies_on_the_highest_point_of_its_cam(law: dict[str, str]) -> None:
    m = eg.Model("tappet", gravity=(0, -9.81, 0))
    cam, follower = m.body("cam", mass=1, inertia={"zz": 0.01}), m.body("follower", mass=0.2)
    m.revolute("C", m.ground, cam, coordinate="phi")
    m.prismatic("F", m.ground, follower, axis="y", coordinate="y")
    m.cam_contact("touch", cam=cam, follower=follower.at(rpy=("-pi/2", 0, 0)), shape="flat_face", **law)
    mod = m.compile(target="numpy")
    for phi in (0.0, 0.8, 2.5):
        scene = build_scene(mod, mod.assemble(phi=phi, y=0.05)[:, None])
        found = [i.at(scene.frames[0]) for i in scene.items if (i.role, i.name) == ("wheel", "touch")]
        contour, face = max(found, key=len), min(found, key=len)
        top = contour[np.argmax(contour[:, 1])]
        assert face[:, 1] == pytest.approx(top[1], abs=1e-3 * 0.04)
        assert face[:, 0].min() < top[0] < face[:, 0].max()


def test_a_swinging_follower_reaches_to_its_cam() -> None:
    m = eg.Model("knife", gravity=(0, -9.81, 0))
    cam = m.body("cam", mass=1, inertia={"zz": 0.01})
    follower = m.body("follower", mass=0.2, com=(0.05, 0, 0), inertia={"zz": 0.001})
    m.revolute("C", m.ground, cam, coordinate="phi")
    m.revolute("F", m.ground.at(-0.1, 0.05, 0), follower, coordinate="psi")
    m.cam_contact("touch", cam=cam, follower=follower.at(0.1), shape="knife_edge", contour="0.04 + 0.008*cos(theta)")
    mod = m.compile(target="numpy")
    scene = build_scene(mod, mod.assemble(phi=0.8)[:, None])
    (bar,) = [i for i in scene.items if (i.role, i.name) == ("link", "follower")]
    assert bar.points[:, 0].max() == pytest.approx(0.1, abs=scene.symbol)


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


def test_the_plane_of_a_contact_is_seen() -> None:
    m = eg.Model("ball", gravity=(0, -9.81, 0))
    ball = m.body("ball", mass=1, inertia={"zz": 0.01})
    m.planar("fall", m.ground, ball, coordinates=["x", "y", "turn"])
    m.sphere_plane("touch", m.ground.at(0.2, -0.1, 0, rpy=(-np.pi / 2, 0, 0)), ball, radius=0.1, stiffness=1e5)
    plane, *_ = lines(m.compile(target="numpy"), "force", "touch", y=0.3)
    np.testing.assert_allclose(plane[:, 1], -0.1, atol=1e-12)
    assert np.ptp(plane[:, 0]) > 0.1
    assert np.ptp(plane[:, 2]) > 0.1
    assert (plane[:, 0].max() + plane[:, 0].min()) / 2 == pytest.approx(0.2)
