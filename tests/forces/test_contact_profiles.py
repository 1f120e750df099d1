"""Contact with height profiles: flat ones as half-planes, distances by brute force, closed forms of rolling."""

from __future__ import annotations

import itertools
from typing import Any

import contact_scenes as scenes
import numpy as np
import pytest
from contact_scenes import ELASTIC, LAW, PLANAR, on
from scipy.integrate import quad

import eomgen as eg
from eomgen.errors import ModelError

G = 9.81
HILLS = [(-0.5, 0.05), (-0.3, 0.1), (-0.1, 0.02), (0.0, 0.0), (0.1, 0.08), (0.3, 0.03), (0.55, 0.1)]


def ground(m: eg.Model, points: Any, kind: str = "profile", **keys: Any) -> dict[str, Any]:
    return {"shape": kind, "on": m.ground, "points": points, **keys}


@pytest.mark.parametrize("kind", ["profile", "smooth_profile"])
@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_a_flat_profile_is_a_half_plane(kind: str, target: str) -> None:
    """In turned axes, with points in line, for every shape, over points and beyond the ends."""
    points = [(-0.3, 0), (0, 0), (0.2, 0), (0.7, 0)]
    mods = []
    for shape in ({"shape": "half_plane"}, {"shape": kind, "points": points, "depth": 0.5}):
        m, bodies = scenes.planar("flat", 4)
        base = m.ground.at(0.1, 0.2, 0, rpy=(0, 0, 0.3))
        m.contacts("floor", [on(PLANAR[k], b) for k, b in zip(PLANAR, bodies, strict=True)], on(shape, base), LAW)
        mods.append(m.compile(target=target))
    rng, pushed = np.random.default_rng(0), 0
    for case in range(60):
        x = np.concatenate([rng.uniform(-1, 1, 12), rng.standard_normal(12)])
        x[0:12:3] = [-0.3, 0.0, 0.2, 0.7] if case == 0 else x[0:12:3]
        height = rng.uniform(0, 0.1, 4)
        along, up = x[0:12:3].copy(), height
        x[0:12:3] = 0.1 + along * np.cos(0.3) - up * np.sin(0.3)
        x[1:12:3] = 0.2 + along * np.sin(0.3) + up * np.cos(0.3)
        for call in ("rhs", "jacobian"):
            a, b = (getattr(mod, call)(0.0, x) for mod in mods)
            limit = 1e-8 if case == 0 and call == "jacobian" else 1e-12  # exactly over points two pieces share a shape
            assert np.abs(a - b).max() <= limit * max(1.0, np.abs(a).max())
        pushed += np.abs(a).max() > 100
    assert pushed > 30


def outline() -> np.ndarray:
    """Fine points of the profile HILLS, drawn on at its ends."""
    given = np.array(HILLS)
    ends = [given[0] + 2 * (given[0] - given[1]), given[-1] + 2 * (given[-1] - given[-2])]
    return np.concatenate([np.linspace(a, b, 20001) for a, b in itertools.pairwise([ends[0], *given, ends[1]])])


def signed_distance(p: np.ndarray, line: np.ndarray) -> float:
    away = np.hypot(*(line - p).T)
    k = np.argmin(away)
    return float(away[k] * np.sign(p[1] - np.interp(p[0], line[:, 0], line[:, 1])))


def energy_of_parts(p: np.ndarray, line: np.ndarray, radius: float) -> tuple[float, int]:
    """Energy and number of the parts of the line that a circle holds: one begins at each of its nearest places.

    Two grow together at each place that is farthest between them.
    """
    away = np.hypot(*(line - p).T)
    low = (away[1:-1] < away[:-2]) & (away[1:-1] < away[2:])
    high = (away[1:-1] > away[:-2]) & (away[1:-1] > away[2:])
    energies = 2e4 * np.maximum(radius - away[1:-1], 0) ** 2.5 / 2.5
    return float(energies[low].sum() - energies[high].sum()), int((energies[low] > 0).sum())


@pytest.mark.parametrize(("radius", "bridges"), [(0.03, 1), (0.12, 5)])
def test_depth_of_a_circle_against_brute_force(radius: float, bridges: int) -> None:
    """It feels each wall of a valley that it bridges; the force is the slope of the energy."""
    m, (ball,) = scenes.planar("hills", 1, (0, 0, 0))
    m.contacts("floor", {"shape": "circle", "on": ball, "radius": radius}, ground(m, HILLS), ELASTIC)
    mod = m.compile(target="numpy")
    line, rng, met, several = outline(), np.random.default_rng(4), 0, 0
    line = line[np.append(True, np.diff(line[:, 0]) > 0)]
    for _ in range(150):
        px = rng.uniform(-0.7, 0.75)
        p = np.array([px, np.interp(px, line[:, 0], line[:, 1]) + rng.uniform(-0.02, radius + 0.01)])
        depth = radius - signed_distance(p, line)
        x = np.array([*p, 0.3, 0, 0, 0])
        energy = mod.energy(x)[1]
        one, (all_of_them, parts) = 2e4 * max(depth, 0) ** 2.5 / 2.5, energy_of_parts(p, line, radius)
        several += depth < radius and parts > 1
        assert energy == pytest.approx(one if depth > radius else all_of_them, rel=1e-4, abs=1e-7)
        if depth > 1e-3:
            met += 1
            h = 1e-6
            slope = [
                (mod.energy(x + d)[1] - mod.energy(x - d)[1]) / (2 * h) for d in (h * np.eye(6)[0], h * np.eye(6)[1])
            ]
            force = -mod.bias(0.0, x)
            np.testing.assert_allclose(force[:2], np.negative(slope), rtol=1e-3, atol=1e-3 * np.abs(force).max())
            assert abs(force[2]) <= 1e-9 * np.abs(force).max()
    assert met > 60
    assert several >= bridges


@pytest.mark.parametrize("points", [5, 9, 40])
def test_a_smooth_profile_through_points_of_a_circle_is_the_circle(points: int) -> None:
    R, r = 0.5, 0.1
    angle = np.linspace(-1.0, 1.0, points)
    m, (ball,) = scenes.planar("bowl", 1, (0, 0, 0))
    arc = [(R * np.sin(a), R - R * np.cos(a)) for a in angle]
    m.contacts("floor", {"shape": "circle", "on": ball, "radius": r}, ground(m, arc, "smooth_profile"), ELASTIC)
    mod = m.compile(target="numpy")
    rng = np.random.default_rng(1)
    for way, depth in zip(rng.uniform(-0.99, 0.99, 40), rng.uniform(1e-4, 0.01, 40), strict=True):
        s = R - r + depth
        x = np.array([s * np.sin(way), R - s * np.cos(way), 0, 0, 0, 0])
        push = 2e4 * depth**1.5
        np.testing.assert_allclose(
            -mod.bias(0.0, x)[:2], [-push * np.sin(way), push * np.cos(way)], rtol=1e-9, atol=1e-9
        )


@pytest.mark.parametrize("rolls", [False, True])
def test_period_in_a_round_valley(rolls: bool) -> None:
    """A disc of radius r in a valley of R swings as a pendulum of length R - r, and of 3/2 (R - r) if it rolls."""
    R, r, mass = 0.5, 0.05, 1.0
    m = eg.Model("valley", gravity=(0, -G, 0))
    disc = m.body("disc", mass=mass, inertia={"zz": 0.5 * mass * r * r})
    m.planar("j", m.ground, disc)
    arc = [(R * np.sin(a), R - R * np.cos(a)) for a in np.linspace(-1.2, 1.2, 25)]
    law: dict[str, Any] = {"stiffness": 1e7, "exponent": 1, "dissipation": 0.05}
    if rolls:
        law |= {"friction": 2.0, "smoothing": 2e-4}
    m.contacts("floor", {"shape": "circle", "on": disc, "radius": r}, ground(m, arc, "smooth_profile"), law)
    m.event("turns", "j_x_dot", direction=1)
    mod = m.compile()
    start = 0.3
    s = R - r + mass * G * np.cos(start) / 1e7
    found = mod.simulate(
        4.0, initial={"j_x": s * np.sin(start), "j_y": R - s * np.cos(start)}, method="Radau", rtol=1e-8, atol=1e-10
    )
    turns = found.t_events["turns"] if isinstance(found.t_events, dict) else found.t_events[0]
    turns = [t for t in turns if t > 0.1]
    period = np.diff(turns).mean()
    length = (R - r) * (1.5 if rolls else 1.0)
    swing = quad(lambda a: 1 / np.sqrt(1 - np.sin(start / 2) ** 2 * np.sin(a) ** 2), 0, np.pi / 2)[0]
    assert period == pytest.approx(4 * np.sqrt(length / G) * swing, rel=3e-3 if rolls else 1e-3)


def test_a_wheel_rolls_down_a_step() -> None:
    """It pivots about the edge of a steep step and loses no energy; bridging a valley it touches both walls."""
    m, (ball,) = scenes.planar("step", 1)
    step = [(-1, 0.2), (0, 0.2), (0.001, 0), (1, 0)]
    m.contacts(
        "floor", {"shape": "circle", "on": ball, "radius": 0.1}, ground(m, step), {"stiffness": 1e6, "exponent": 1}
    )
    mod = m.compile()
    start = {"j0_x": -0.3, "j0_y": 0.3 - 1.0 * G / 1e6, "j0_x_dot": 0.3}
    traj = mod.simulate(2.0, initial=start, rtol=1e-9, atol=1e-11, max_step=2e-3)
    energy = np.sum(mod.energy(traj.x), axis=0)
    assert np.ptp(energy) < 1e-5 * np.abs(energy).max()
    assert traj["j0_x"][-1] > 0.3
    assert traj["j0_y"].min() == pytest.approx(0.1, abs=0.01)

    m, (ball,) = scenes.planar("notch", 1)
    notch = [(-0.5, 0.45), (-0.05, 0.0), (0.05, 0.0), (0.5, 0.45)]  # walls of 45 degrees
    m.contacts(
        "floor", {"shape": "circle", "on": ball, "radius": 0.3}, ground(m, notch), {"stiffness": 1e6, "exponent": 1}
    )
    mod = m.compile(target="numpy")
    rise = (0.3 - 1e-4) * np.sqrt(2) - 0.05  # of the centre whose distance from both walls is 0.3 - 1e-4
    force = -mod.bias(0.0, np.array([0, rise, 0, 0, 0, 0])) + [0, 1.0 * G, 0]
    np.testing.assert_allclose(force, [0, np.sqrt(2) * 1e6 * 1e-4, 0], atol=1e-6)


@pytest.mark.parametrize("kind", ["profile", "smooth_profile"])
def test_targets_parameters_and_derivatives(kind: str) -> None:
    mods = []
    for target in ("numpy", "cython"):
        m, bodies = scenes.planar("hills", 3)
        m.parameter("h", 0.08)
        points = [(x, "h" if y == 0.08 else y) for x, y in HILLS]
        m.contacts(
            "floor", [on(PLANAR[k], b) for k, b in zip(("circle", "box", "segment"), bodies, strict=True)],
            ground(m, points, kind), LAW,
        )  # fmt: skip
        mods.append(m.compile(target=target))
    x = mods[0].x0(j0_x=0.12, j0_y=0.15, j1_x=-0.1, j1_y=0.11, j1_3=0.2, j2_x=0.31, j2_y=0.09, j2_3=0.1, j0_x_dot=0.5)
    x[9:] = x[9:] + 0.1 * np.arange(9)
    for call in ("rhs", "jacobian", "parameter_jacobian"):
        a, b = (getattr(mod, call)(0.0, x) for mod in mods)
        assert np.abs(a - b).max() <= 1e-11 * np.abs(a).max()
    assert np.count_nonzero(np.abs(mods[0].rhs(0.0, x)[9:18]) > 20) >= 3
    found = mods[1].jacobian(0.0, x)
    h = 1e-7
    sides = np.transpose([(mods[1].rhs(0.0, x + d) - mods[1].rhs(0.0, x - d)) / (2 * h) for d in h * np.eye(len(x))])
    np.testing.assert_allclose(found, sides, rtol=1e-4, atol=1e-5 * np.abs(found).max())
    late = [(mods[1].rhs(0.0, x, p={"h": 0.08 + d})) for d in (-h, h)]
    slope = (late[1] - late[0]) / (2 * h)
    np.testing.assert_allclose(
        mods[1].parameter_jacobian(0.0, x)[:, 0], slope, rtol=1e-4, atol=1e-5 * np.abs(slope).max()
    )


@pytest.mark.parametrize("kind", ["profile", "smooth_profile"])
def test_what_is_deeper_than_the_solid_feels_nothing(kind: str) -> None:
    """Also in a batch in which other states are near."""
    m, (ball,) = scenes.planar("deep", 1, (0, 0, 0))
    m.contacts("floor", on(PLANAR["circle"], ball), ground(m, HILLS, kind, depth=0.05), ELASTIC)
    for target in ("numpy", "cython"):
        mod = m.compile(target=target)
        heights = np.linspace(-0.6, 0.2, 161)
        x = np.zeros((6, 161))
        x[0], x[1] = 0.05, heights
        together = mod.rhs(0.0, x)
        apart = np.transpose([mod.rhs(0.0, column) for column in x.T.copy()])
        np.testing.assert_allclose(together, apart, rtol=1e-12, atol=1e-9)
        assert not together[3:, heights < -0.1].any()
        assert np.abs(together[3:, heights > -0.01]).max() > 100


@pytest.mark.parametrize(
    ("given", "place", "told"),
    [
        ({"points": [(0, 0), (1, 0), (0.5, 1)]}, "points[2]", "the profile turns back or crosses itself"),
        ({"points": [(0, 0), (1, 0), (1, 1)]}, "points[2]", "give the points from left to right, each x once"),
        ({"points": [(0, 0)]}, "points", "is no profile; give 2 or more points"),
        ({"points": [(0, 0), (1, 0)], "shape": "smooth_profile"}, "points", "give 3 or more points"),
        ({"points": [(0, 0), (1, 2, 3)]}, "points[1]", "two numbers"),
        ({"points": [(0, 0), (1, 2)], "depth": -1}, "depth", "is -1; must be greater than 0"),
    ],
)
def test_what_is_wrong_with_a_profile_is_told(given: dict[str, Any], place: str, told: str) -> None:
    m, (ball,) = scenes.planar("wrong", 1)
    profile = {"shape": "profile", "on": m.ground, **given}
    m.contacts("floor", on(PLANAR["circle"], ball), profile, LAW)
    with pytest.raises(ModelError) as error:
        m.mechanism()
    found = {p.path: f"{p.message}; {p.remedy}" for p in error.value.problems}
    assert told in found.get(f"forces.floor.second[0].{place}", f"nothing there: {found}"), found


def test_profiles_do_not_meet_each_other() -> None:
    m, (ball,) = scenes.planar("wrong", 1)
    m.contacts("floor", ground(m, HILLS), on({"shape": "half_plane"}, ball), LAW)
    with pytest.raises(ModelError, match="profile and half_plane do not meet; circle, segment, box, polygon, outline"):
        m.mechanism()


def test_a_profile_is_verified_and_written_again(tmp_path: Any) -> None:
    m, (ball,) = scenes.planar("written", 1)
    m.contacts("floor", on(PLANAR["circle"], ball), ground(m, HILLS, "smooth_profile", depth=0.2), LAW)
    m.initial(j0_x=0.12, j0_y=0.15)
    file = tmp_path / "written.yaml"
    file.write_text(m.to_yaml())
    mod, again = m.compile(target="numpy"), eg.load(file).compile(target="numpy")
    x = mod.x0()
    assert np.abs(mod.rhs(0.0, x)).max() > 20
    assert np.array_equal(mod.rhs(0.0, x), again.rhs(0.0, x))
    report = mod.verify()
    assert report.ok, report


@pytest.mark.parametrize(("radius", "offset"), [(0.1, 0.201), (0.29, 0.02), (0.3, 0.002)])
def test_friction_and_damping_in_a_bowl_do_not_grow_with_its_points(radius: float, offset: float) -> None:
    """Of a spinning disc that many short edges hold; a smooth bowl is the limit."""
    found = {}
    for kind, count in (("profile", 41), ("profile", 321), ("smooth_profile", 41)):
        bowl = [(0.3 * np.sin(a), 0.3 - 0.3 * np.cos(a)) for a in np.linspace(-1.3, 1.3, count)]
        mods = []
        for keys in ({}, {"friction": 0.5, "smoothing": 1e-3}, {"dissipation": 1.0}):
            m, (ball,) = scenes.planar("bowl", 1, (0, 0, 0))
            law = {"stiffness": 1e4, "exponent": 1.5, **keys}
            m.contacts("c", {"shape": "circle", "on": ball, "radius": radius}, ground(m, bowl, kind), law)
            mods.append(m.compile(target="numpy"))
        x = np.array([offset * np.sin(0.1), 0.3 - offset * np.cos(0.1), 0, 0, 0, 3.0])
        y = np.array([*x[:3], 0.1 * np.sin(0.1), -0.1 * np.cos(0.1), 0])
        push, rough, damped = (mod.bias(0.0, of) for mod, of in zip(mods, (x, x, y), strict=True))
        elastic = np.hypot(*push[:2])
        found[kind, count] = rough[2] / (0.5 * elastic * radius), np.hypot(*damped[:2]) / elastic - 1
    assert found["smooth_profile", 41] == pytest.approx((1.0, 0.1), rel=0.03)
    for count in (41, 321):
        friction, damping = found["profile", count]
        assert 0.75 < friction < 1.1
        assert 0.05 < damping < 0.11


@pytest.mark.parametrize("bend", [0.0, 3e-9, 1e-8, 1e-7, 1e-5])
def test_over_a_bend_that_is_hardly_one_the_force_is_that_of_a_line(bend: float) -> None:
    m, (ball,) = scenes.planar("bend", 1, (0, 0, 0))
    m.parameter("h", bend)
    law = {"stiffness": 1e4, "exponent": 1}
    m.contacts("c", {"shape": "circle", "on": ball, "radius": 0.1}, ground(m, [(-1, "h"), (0, 0), (1, "h")]), law)
    mod = m.compile(target="numpy")
    for x in (0.0, 1e-7, 1e-3):
        force = -mod.bias(0.0, np.array([x, 0.1 - 1e-3 + bend * abs(x), 0, 0, 0, 0]))
        assert force[1] == pytest.approx(10.0, rel=1e-3)


@pytest.mark.parametrize("keys", [{}, {"friction": 0.5, "smoothing": 1e-3}, {"dissipation": 1.0}])
def test_a_valley_is_one_however_its_endless_sides_are_drawn(keys: dict[str, float]) -> None:
    """With short or long sides and with points in line; the circle holds the corner and both walls."""
    found = []
    lines: list[Any] = [[(-1, 1), (0, 0), (1, 1)], [(-0.02, 0.02), (0, 0), (1, 1)], [(-1, 1), (0, 0), (0.02, 0.02)]]
    for points in (*lines, [(-2, 2), (-0.3, 0.3), (0, 0), (0.4, 0.4), (1, 1)]):
        m, (ball,) = scenes.planar("valley", 1, (0, 0, 0))
        law = {"stiffness": 1e4, "exponent": 1, **keys}
        floor = ground(m, points, depth=0.5)
        m.contacts("c", {"shape": "circle", "on": ball, "radius": 0.15}, floor, law)
        found.append(m.compile(target="numpy").bias(0.0, np.array([0.003, 0.13, 0.2, 0.1, -0.2, 2.0])))
    assert np.abs(found[0][:2]).min() > 10
    for one in found[1:]:
        assert one == pytest.approx(found[0], rel=1e-9, abs=1e-9)
