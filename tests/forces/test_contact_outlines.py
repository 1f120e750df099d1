"""Contact with closed outlines: boxes and circles as outlines, distances by brute force, what is wrong with them."""

from __future__ import annotations

import itertools
import math
from typing import Any

import contact_scenes as scenes
import numpy as np
import pytest
import sympy
from contact_scenes import ELASTIC, LAW, PLANAR, on

import eomgen as eg
from eomgen.errors import ModelError

ANGLE = [(0.3, 0.0), (0.3, 0.3), (0.1, 0.3), (0.1, 0.1), (-0.2, 0.1), (-0.2, 0.0)]  # a concave outline
BLOB = [(0.3, 0.02), (0.2, 0.2), (0.0, 0.12), (-0.2, 0.2), (-0.3, 0.0), (-0.1, -0.15), (0.15, -0.17)]
SPROCKET: dict[str, Any] = {"teeth": 9, "pitch": 0.1, "seat": 0.022, "tip_radius": 0.165}


def sprocket_line(count: int = 400) -> np.ndarray:
    """Its outline, by ISO 606: arcs of 130 degrees about the pins, tangents to the tip circle."""
    n, p, r, tip = SPROCKET["teeth"], SPROCKET["pitch"], SPROCKET["seat"], SPROCKET["tip_radius"]
    reach, half = p / (2 * math.sin(math.pi / n)), math.radians(65)
    found = []
    for k in range(n):
        b = np.linspace(-half, half, count)
        seat = np.transpose([reach - r * np.cos(b), r * np.sin(b)])
        ends = []
        for end, way in ((seat[0], (math.sin(half), -math.cos(half))), (seat[-1], (math.sin(half), math.cos(half)))):
            runs = np.linspace(0, 1, 200001)[:, None] * np.array(way) * 0.2 + end
            ends.append(runs[np.hypot(*runs.T) <= tip])
        turn = 2 * math.pi * k / n
        R = np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
        found.append(np.vstack([ends[0][::-50], seat, ends[1][::50], ends[1][-1:]]) @ R)
    return dense(np.vstack(found))


def dense(points: np.ndarray, count: int = 60) -> np.ndarray:
    """Points of a closed line, which are filled up where they are far apart."""
    closed = np.vstack([points, points[:1]])
    return np.vstack([
        np.linspace(a, b, max(2, int(count * 200 * np.hypot(*(b - a))))) for a, b in itertools.pairwise(closed)
    ])  # fmt: skip


def signed_distance(p: np.ndarray, line: np.ndarray) -> float:
    """Negative inside, by the winding of the line about the point."""
    reach = line - p
    turns = np.unwrap(np.arctan2(reach[:, 1], reach[:, 0]))
    inside = abs(turns[-1] - turns[0]) > math.pi
    return float(np.hypot(*reach.T).min()) * (-1 if inside else 1)


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize(
    ("shape", "line"),
    [
        ({"shape": "outline", "points": ANGLE}, dense(np.array(ANGLE))),
        ({"shape": "sprocket", **SPROCKET}, sprocket_line()),
    ],
)
def test_depth_of_a_circle_against_brute_force(shape: dict[str, Any], line: np.ndarray, order: int) -> None:
    """In turned axes; the energy is that of the depth, the force its slope, with the moment on the wheel."""
    if "points" in shape:
        shape = {**shape, "points": shape["points"][::order]}
    m, (ball, wheel) = scenes.planar("teeth", 2, (0, 0, 0))
    marker = wheel.at(0.02, -0.01, 0, rpy=(0, 0, 0.4))
    m.contacts("mesh", {"shape": "circle", "on": ball, "radius": 0.02}, on(shape, marker), ELASTIC)
    mod = m.compile(target="numpy")
    R = np.array([[math.cos(0.4), math.sin(0.4)], [-math.sin(0.4), math.cos(0.4)]])
    turned = line @ R + (0.02, -0.01)
    rng, met, inside = np.random.default_rng(5), 0, 0
    for _ in range(150):
        p = turned[rng.integers(len(turned))] + rng.uniform(-0.018, 0.03, 2)
        distance = signed_distance(p, turned)
        if distance < -0.004 or abs(distance - 0.02) < 1e-4:
            continue  # deeper than half of a tip
        depth = 0.02 - distance
        turn = rng.uniform(-3, 3)
        S = np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
        x = np.array([*(p @ S + (0.5, 0.7)), 0.3, 0.5, 0.7, turn, *np.zeros(6)])
        energy = mod.energy(x)[1]
        one = 2e4 * max(depth, 0) ** 2.5 / 2.5
        two = energy > 1.01 * one + 1e-7  # it bridges a gap that is narrower than itself
        assert two or energy == pytest.approx(one, rel=2e-3, abs=1e-6)
        if depth > 1e-3 and not two:
            met, inside = met + 1, inside + (distance < 0)
            h = 1e-6 * np.eye(12)[:, :6]
            slope = (mod.energy(x[:, None] + h)[1] - mod.energy(x[:, None] - h)[1]) / 2e-6
            force = -mod.bias(0.0, x)
            np.testing.assert_allclose(force, np.negative(slope), rtol=2e-3, atol=2e-3 * np.abs(force).max())
    assert met > 40
    assert inside > 2


def test_a_box_is_an_outline_too() -> None:
    """For circles, segments and half-planes, which meet both in one way; in C as in NumPy for every shape."""
    corners = [(0.15, 0.1), (0.15, -0.1), (-0.15, -0.1), (-0.15, 0.1)]
    box, outline = {"shape": "box", "size": (0.3, 0.2)}, {"shape": "outline", "points": corners}
    mods = []
    for shape, target, kinds in (
        (box, "numpy", ("circle", "segment")),
        (outline, "numpy", ("circle", "segment")),
        (outline, "numpy", PLANAR),
        (outline, "cython", PLANAR),
    ):
        m, bodies = scenes.planar("block", 5)
        others = [on(PLANAR[k], b) for k, b in zip(PLANAR, bodies[1:], strict=True) if k in kinds]
        m.contacts("block", on(shape, bodies[0]), [*others, on({"shape": "half_plane"}, m.ground)], LAW)
        mods.append(m.compile(target=target))
    rng, pushed = np.random.default_rng(2), 0
    for _ in range(15):
        x = np.concatenate([rng.uniform(-0.2, 0.2, 15), rng.standard_normal(15)])
        x[1] = rng.uniform(0.02, 0.15)
        for k in range(1, 5):
            x[3 * k : 3 * k + 2] = x[:2] + rng.uniform(0.1, 0.3) * np.array([math.cos(k), math.sin(k)])
        for call in ("rhs", "jacobian"):
            a, b, c, d = (getattr(mod, call)(0.0, x) for mod in mods)
            assert np.abs(a - b).max() <= 1e-9 * max(1.0, np.abs(a).max())
            assert np.abs(c - d).max() <= 1e-11 * max(1.0, np.abs(c).max())
        pushed += np.abs(a).max() > 100
    assert pushed > 8


@pytest.mark.parametrize("points", [5, 12])
def test_a_smooth_outline_through_points_of_a_circle_is_the_circle(points: int) -> None:
    angles = np.linspace(0, 2 * np.pi, points, endpoint=False)
    ring = [(0.2 * math.cos(a), 0.2 * math.sin(a)) for a in angles]
    mods = []
    for shape in ({"shape": "circle", "radius": 0.2}, {"shape": "smooth_outline", "points": ring, "depth": 0.1}):
        m, (ball, wheel) = scenes.planar("ring", 2)
        m.contacts("mesh", on(PLANAR["circle"], ball), on(shape, wheel), LAW)
        mods.append(m.compile(target="numpy"))
    for angle in np.linspace(0.01, 6.2, 37):  # not over the ends of arcs
        x = np.array([0.29 * math.cos(angle), 0.29 * math.sin(angle), 0.2, 0, 0, 0, 0.1, 0.2, 2.0, 0.3, -0.1, 0.5])
        a, b = (mod.rhs(0.0, x) for mod in mods)
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9)
        a, b = (mod.jacobian(0.0, x) for mod in mods)
        np.testing.assert_allclose(a, b, rtol=1e-5, atol=1e-5 * np.abs(a).max())


def test_the_force_on_a_smooth_outline_has_an_energy() -> None:
    m, (ball, blob) = scenes.planar("blob", 2, (0, 0, 0))
    m.contacts("mesh", on(PLANAR["circle"], ball), {"shape": "smooth_outline", "on": blob, "points": BLOB}, ELASTIC)
    mod = m.compile(target="numpy")
    rng, met = np.random.default_rng(3), 0
    h = 1e-6 * np.eye(12)[:, :6]
    for _ in range(200):
        p = np.array(BLOB)[rng.integers(len(BLOB))] * rng.uniform(0.9, 1.4) + rng.uniform(-0.05, 0.05, 2)
        x = np.array([*p, 0.0, 0, 0, 0, *np.zeros(6)])
        force = -mod.bias(0.0, x)
        if np.abs(force).max() > 1:
            slope = (mod.energy(x[:, None] + h)[1] - mod.energy(x[:, None] - h)[1]) / 2e-6
            np.testing.assert_allclose(force, np.negative(slope), rtol=1e-3, atol=1e-3 * np.abs(force).max())
            met += 1
    assert met > 80


def test_pins_of_a_chain_sit_in_the_seats() -> None:
    """Pins of the seats' radius on the pitch circle touch without force, wherever they are in the arc."""
    m, (ball,) = scenes.planar("seats", 1, (0, 0, 0))
    wheel = {"shape": "sprocket", "on": m.ground, **SPROCKET}
    m.contacts("mesh", {"shape": "circle", "on": ball, "radius": 0.021}, wheel, ELASTIC)
    mod = m.compile(target="numpy")
    reach = 0.1 / (2 * math.sin(math.pi / 9))
    for k in range(9):
        turn = 2 * math.pi * k / 9
        at = reach * np.array([math.cos(turn), math.sin(turn)])
        for way in np.radians([-60, -30, 0, 30, 60]):  # from the bottom of the seat
            out = -np.array([math.cos(turn + way), math.sin(turn + way)])
            for push, told in ((0.0009, False), (0.002, True)):
                force = -mod.bias(0.0, np.array([*(at + push * out), *np.zeros(4)]))[:2]
                if told:
                    np.testing.assert_allclose(force, -2e4 * 0.001**1.5 * out, atol=1e-8)
                else:
                    assert not force.any()


@pytest.mark.parametrize("seat_angle", [math.radians(130), "a"])
def test_a_tooth_is_felt_on_one_side_where_it_is_narrowest(seat_angle: Any) -> None:
    """Between seats that reach the line of their pins; the energy of a path across the tooth has no jump."""
    m, (ball,) = scenes.planar("waist", 1, (0, 0, 0))
    m.parameter("a", math.radians(130))
    wheel = {"teeth": 7, "pitch": 0.1, "seat": 0.02, "tip_radius": 0.14, "seat_angle": seat_angle}
    law = {"stiffness": 1e4, "normal_law": "linear"}
    m.contacts(
        "mesh", {"shape": "circle", "on": ball, "radius": 0.015}, on({"shape": "sprocket", **wheel}, m.ground), law
    )
    mod = m.compile(target="numpy")
    half = math.pi / 7
    reach = 0.1 / (2 * math.sin(half))
    first, second = reach * np.array([1.0, 0.0]), reach * np.array([math.cos(2 * half), math.sin(2 * half)])
    part = np.linspace(0.01, 0.99, 20001)
    x = np.zeros((6, len(part)))
    x[:2] = first[:, None] + (second - first)[:, None] * part
    deep = 0.015 + 0.1 * np.minimum(part, 1.0 - part) - 0.02  # by the distance of the nearest seat
    found = mod.energy(x)[1]
    expected = 0.5e4 * np.maximum(0.0, deep) ** 2
    inside = np.abs(part - 0.5) > 1e-4  # where both sides are as near, each counts half
    np.testing.assert_allclose(found[inside], expected[inside], rtol=1e-6, atol=1e-9)
    assert found[10000 - 10] == pytest.approx(0.5e4 * 0.045**2, rel=1e-2)


def test_the_energy_of_an_outline_has_no_jump() -> None:
    """As deep as its depth; and in a seat that is narrower than the circle, where both of its flanks take over."""
    m, (ball,) = scenes.planar("walls", 1, (0, 0, 0))
    corners = [(-0.1, -0.1), (0.1, -0.1), (0.02, 0.01), (0, 0.1)]
    law = {"stiffness": 1e4, "normal_law": "linear"}
    m.contacts(
        "wall",
        {"shape": "circle", "on": ball, "radius": 0.1},
        {"shape": "outline", "points": corners, "depth": 0.03, "on": m.ground},
        law,
    )
    mod = m.compile(target="numpy")
    heights = np.array([-0.1 + 0.03 - 1e-6, -0.1 + 0.03 + 1e-6])
    x = np.zeros((6, 2))
    x[1] = heights
    np.testing.assert_allclose(mod.energy(x)[1], 0.5e4 * (0.2 + heights) ** 2, rtol=1e-9)
    reach = SPROCKET["pitch"] / (2 * math.sin(math.pi / SPROCKET["teeth"]))
    for radius in (0.021, 0.024, 0.03):
        m, (ball,) = scenes.planar("seats", 1, (0, 0, 0))
        m.contacts(
            "mesh",
            {"shape": "circle", "on": ball, "radius": radius},
            {"shape": "sprocket", "on": m.ground, **SPROCKET},
            law,
        )
        x = np.zeros((6, 2))
        x[0] = reach - 1e-7, reach + 1e-7
        once = 0.5e4 * max(0.0, radius - SPROCKET["seat"]) ** 2
        np.testing.assert_allclose(m.compile(target="numpy").energy(x)[1], [once, once], rtol=1e-3, atol=1e-12)


def test_a_wheel_of_teeth_drives_a_pinned_bar() -> None:
    """The sprocket turns slowly; a flank pushes the pin, which a spring holds back."""
    m = eg.Model("drive", gravity=(0, 0, 0))
    m.parameter("speed", 0.05)
    wheel = m.body("wheel", mass=1, inertia={"zz": 0.01})
    bar = m.body("bar", mass=0.5, inertia={"zz": 0.001})
    m.revolute("axle", m.ground, wheel)
    m.driver("drive", "axle", "speed*t")
    m.prismatic("guide", m.ground, bar, axis="y")
    reach = 0.1 / (2 * math.sin(math.pi / 9))
    m.joint_spring("pull", "guide", stiffness=100.0)
    m.joint_damper("drag", "guide", damping=20.0)
    pin = {"shape": "circle", "on": bar.at(reach, 0, 0), "radius": 0.02}
    m.contacts("mesh", pin, {"shape": "sprocket", "on": wheel, **SPROCKET}, {"stiffness": 1e6, "dissipation": 0.5})
    mod = m.compile()
    traj = mod.simulate(1.0, rtol=1e-8, atol=1e-10)
    y, turn = traj["guide"][-1], 0.05
    to_flank = turn + math.pi + math.radians(65)  # the direction from the middle of the seat to the flank below the pin
    d = np.array([math.cos(to_flank), math.sin(to_flank)])
    pushed = (np.array([reach, y]) - reach * np.array([math.cos(turn), math.sin(turn)])) @ d - 0.002
    force = 100.0 * y + 20.0 * traj["guide_dot"][-1]
    assert force / -d[1] == pytest.approx(1e6 * pushed**1.5, rel=1e-2)  # 2 mm between pin and seat


def test_what_is_wrong_with_an_outline_is_told() -> None:
    cases = [
        ({"shape": "outline", "points": [(0, 0), (1, 1), (1, 0), (0, 1)]}, "points", "cross each other"),
        ({"shape": "outline", "points": [(0, 0), (1, 0)]}, "points", "give 3 to 64 corners"),
        ({"shape": "outline", "points": [(0, 0), ("w", 0), (0, 1)]}, "depth", "is missing"),
        ({"shape": "sprocket", **SPROCKET, "teeth": 2}, "teeth", "3 or more"),
        ({"shape": "sprocket", **SPROCKET, "teeth": 9.5}, "teeth", "whole number"),
        (
            {"shape": "sprocket", **SPROCKET, "seat": 0.06},
            "seat",
            "seats overlap; give less than half of the pitch, 0.05",
        ),
        ({"shape": "sprocket", **SPROCKET, "tip_radius": 0.13}, "tip_radius", "inside the ends of the seats"),
        ({"shape": "sprocket", **SPROCKET, "tip_radius": 0.5}, "tip_radius", "beyond the points of the teeth"),
        ({"shape": "sprocket", **SPROCKET, "seat_angle": 130}, "seat_angle", "is 130 rad; give more than 0"),
        ({"shape": "sprocket", **SPROCKET, "depth": 0}, "depth", "must be greater than 0"),
    ]
    for shape, place, told in cases:
        m, (ball,) = scenes.planar("wrong", 1)
        m.parameter("w", 1.0)
        m.contacts("mesh", on(PLANAR["circle"], ball), on(shape, m.ground), LAW)
        with pytest.raises(ModelError) as error:
            m.mechanism()
        found = {p.path: f"{p.message}; {p.remedy}" for p in error.value.problems}
        assert told in found.get(f"forces.mesh.second[0].{place}", f"nothing there: {found}"), found


@pytest.mark.parametrize("kind", [float, np.int64, np.float32, sympy.Integer])
def test_whole_numbers_of_shapes_in_any_form(kind: Any) -> None:
    """Teeth of a sprocket and points of a plate, with as many states."""
    bristles = {"friction": 0.3, "friction_law": "lugre", "bristle_stiffness": 1e3, "bristle_damping": 30.0}
    found = []
    for make in (int, kind):
        m, (wheel, sole) = scenes.planar("whole", 2)
        teeth = {"shape": "sprocket", "on": wheel, **SPROCKET, "teeth": make(9)}
        plate = {"shape": "plate", "on": sole, "length": 0.3, "width": 0.1, "points": make(3)}
        ground = {"shape": "half_plane", "on": m.ground}
        m.contacts("mesh", [teeth, plate], ground, {**ELASTIC, **bristles, "lateral": False})
        found.append(m.compile(target="numpy"))
    assert found[1].n_x == found[0].n_x == 12 + 18 + 3
    x = found[0].x0(j0_y=0.15, j1_y=-0.01, j0_x_dot=0.1)
    np.testing.assert_array_equal(found[1].rhs(0.0, x), found[0].rhs(0.0, x))


@pytest.mark.parametrize(
    "shape",
    [
        pytest.param({"shape": "sprocket", **SPROCKET}, marks=pytest.mark.thorough),
        {"shape": "smooth_outline", "points": BLOB},
    ],
)
def test_an_outline_is_verified_and_written_again(shape: dict[str, Any], tmp_path: Any) -> None:
    m, (ball, wheel) = scenes.planar("written", 2)
    m.contacts("mesh", on(PLANAR["circle"], ball), on(shape, wheel), LAW)
    m.initial(j0_x=0.24, j0_y=0.03, j1_x=0.0, j1_y=0.0)
    file = tmp_path / "written.yaml"
    file.write_text(m.to_yaml())
    mod, again = m.compile(target="numpy"), eg.load(file).compile(target="numpy")
    x = mod.x0()
    assert np.abs(mod.rhs(0.0, x)).max() > 20
    assert np.array_equal(mod.rhs(0.0, x), again.rhs(0.0, x))
    report = mod.verify()
    assert report.ok, report


def test_sizes_of_a_sprocket_are_parameters() -> None:
    values = {"p": 0.1, "s": 0.022, "r": 0.165, "a": math.radians(130)}
    mods = []
    for given in ({"teeth": 9, "pitch": "p", "seat": "s", "tip_radius": "r", "seat_angle": "a"}, SPROCKET):
        for target in ("numpy", "cython"):
            m, (ball, wheel) = scenes.planar("late", 2)
            for name, value in values.items():
                m.parameter(name, value)
            m.contacts("mesh", on(PLANAR["circle"], ball), {"shape": "sprocket", "on": wheel, **given}, LAW)
            mods.append(m.compile(target=target))
    rng, h = np.random.default_rng(6), 1e-7
    pushed = 0
    for _ in range(20):
        angle = rng.uniform(-3, 3)
        x = np.array([0.2 * math.cos(angle), 0.2 * math.sin(angle), *np.zeros(4), *rng.standard_normal(6)])
        all_rates = [mod.rhs(0.0, x) for mod in mods]
        for rates in all_rates[1:]:
            np.testing.assert_allclose(rates, all_rates[0], rtol=1e-9, atol=1e-9)
        slopes = mods[1].parameter_jacobian(0.0, x)
        for name, value in values.items():
            late = [mods[1].rhs(0.0, x, p={name: value + d}) for d in (-h, h)]
            found = slopes[:, list(mods[1].p_names).index(name)]
            atol = 1e-5 * max(1.0, np.abs(found).max())
            np.testing.assert_allclose(found, (late[1] - late[0]) / (2 * h), rtol=1e-3, atol=atol)
        pushed += np.abs(all_rates[0]).max() > 100
    assert pushed > 5


@pytest.mark.parametrize("other", ["box", "outline"])
def test_a_convex_outline_lies_flush_as_a_polygon_does(other: str) -> None:
    """Of exactly one width, with a point on the middle of an edge; forces are those of the polygon."""
    corners = scenes.rectangle(0.2, 0.1)
    found = []
    for kind in ("outline", "polygon"):
        m, (body,) = scenes.planar("flush", 1)
        points = [*corners, (-0.1, 0.0)] if kind == "outline" else corners
        base = {"shape": kind, "points": points, "on": m.ground}
        upper = {"shape": "box", "size": (0.2, 0.1)} if other == "box" else {"shape": "outline", "points": corners}
        m.contacts("touch", {**upper, "on": body}, base, {**LAW, "dissipation": 20.0})
        m.initial(j0_y=0.1)
        mod = m.compile(target="numpy")
        found.append([*mod.rhs(0.0, [0.003, 0.0995, 0.001, 0.1, -0.2, 0.3]), *mod.rhs(0.0, [0, 0.09, 0, 0, 0, 0])])
    np.testing.assert_allclose(found[0], found[1], rtol=1e-9, atol=1e-9)
    assert found[0][10] > 0.0  # pushed up
    drawn = m.mechanism().forces[0].drawn()
    assert len(drawn) == 2


def test_smooth_outlines_are_drawn_as_arcs() -> None:
    """Points of a circle: all points of the line lie on it."""
    m, (body,) = scenes.planar("round", 1)
    around = [(0.3 * np.cos(t), 0.3 * np.sin(t)) for t in 2 * np.pi * np.arange(7) / 7]
    ring = {"shape": "smooth_outline", "points": around, "on": body}
    m.contacts("touch", ring, {"shape": "half_plane", "on": m.ground}, ELASTIC)
    line = m.mechanism().forces[0].drawn()[0].stops
    radii = [np.hypot(*(marker.frame.position[k].value for k in (0, 1))) for marker in line]
    assert len(radii) > 50
    np.testing.assert_allclose(radii, 0.3, rtol=1e-12)
