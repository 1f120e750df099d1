"""Contact with profiles and height fields: flat and round ones, distances by brute force, runs, what is wrong."""

import itertools
from typing import Any

import contact_scenes as scenes
import numpy as np
import pytest
from contact_scenes import ELASTIC, LAW, PLANAR, check_slopes, depth_of, flying, near, on, state
from force_judges import read_back
from judges import differences
from refusals import refuses
from scipy.integrate import quad
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation
from sweeps import part_of

import eomgen as eg

G = 9.81
HILLS = [(-0.5, 0.05), (-0.3, 0.1), (-0.1, 0.02), (0.0, 0.0), (0.1, 0.08), (0.3, 0.03), (0.55, 0.1)]


def profile(m: eg.Model, points: Any, kind: str = "profile", **keys: Any) -> dict[str, Any]:
    return {"shape": kind, "on": m.ground, "points": points, **keys}


@pytest.mark.parametrize("kind", ["profile", "smooth_profile"])
def test_a_flat_profile_is_a_half_plane(kind: str) -> None:
    """In turned axes, with points in line, for every shape, over points and beyond the ends."""
    points = [(-0.3, 0), (0, 0), (0.2, 0), (0.7, 0)]
    mods = []
    for shape in ({"shape": "half_plane"}, {"shape": kind, "points": points, "depth": 0.5}):
        m, bodies = scenes.planar("flat", 4)
        base = m.ground.at(0.1, 0.2, 0, rpy=(0, 0, 0.3))
        m.contacts("floor", [on(PLANAR[k], b) for k, b in zip(PLANAR, bodies, strict=True)], on(shape, base), LAW)
        mods.append(m.compile(target="numpy"))
    rng, pushed = np.random.default_rng(0), 0
    for case in range(20):
        x = np.concatenate([rng.uniform(-1, 1, 12), rng.standard_normal(12)])
        x[0:12:3] = [-0.3, 0.0, 0.2, 0.7] if case == 0 else x[0:12:3]
        height = rng.uniform(0, 0.1, 4)
        along, up = x[0:12:3].copy(), height
        x[0:12:3] = 0.1 + along * np.cos(0.3) - up * np.sin(0.3)
        x[1:12:3] = 0.2 + along * np.sin(0.3) + up * np.cos(0.3)
        for call in ("rhs", "jacobian") if case < 4 else ("rhs",):
            a, b = (getattr(mod, call)(0.0, x) for mod in mods)
            limit = 1e-8 if case == 0 and call == "jacobian" else 1e-12  # exactly over points two pieces share a shape
            assert np.abs(a - b).max() <= limit * max(1.0, np.abs(a).max())
        pushed += np.abs(a).max() > 100
    assert pushed > 10


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


@pytest.mark.parametrize(("radius", "bridges"), [(0.03, 1), (0.12, 3)])
def test_depth_of_a_circle_against_brute_force(radius: float, bridges: int) -> None:
    """It feels each wall of a valley that it bridges; the force is the slope of the energy."""
    m, (ball,) = scenes.planar("hills", 1, (0, 0, 0))
    m.contacts("floor", {"shape": "circle", "on": ball, "radius": radius}, profile(m, HILLS), ELASTIC)
    mod = m.compile(target="numpy")
    line, rng, met, several = outline(), np.random.default_rng(4), 0, 0
    line = line[np.append(True, np.diff(line[:, 0]) > 0)]
    for _ in range(100):
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
    assert met > 35
    assert several >= bridges
    for px in (-0.4, 0.0, 0.5):  # below the solid
        assert mod.energy(np.array([px, -1.0, 0, 0, 0, 0]))[1] == 0.0


@pytest.mark.parametrize("kind", ["profile", "smooth_profile"])
def test_gaps_are_those_of_scipy(kind: str) -> None:
    """Apart, over and beside points, beyond the ends, and down to the depth of the solid; deeper a run stops."""
    m, (ball,) = scenes.planar("hills", 1, (0, 0, 0))
    m.contacts("floor", {"shape": "circle", "on": ball, "radius": 0.08}, profile(m, HILLS, kind, depth=0.05), ELASTIC)
    mod = m.compile(target="numpy")
    ends = [np.array(HILLS[i]) + 9 * np.subtract(HILLS[i], HILLS[j]) for i, j in ((0, 1), (-1, -2))]
    pieces = scenes.straight([ends[0], *HILLS, ends[1]]) if kind == "profile" else scenes.smooth(HILLS, closed=False)
    rng, met, deep = np.random.default_rng(8), 0, 0
    starts = np.array([one.start for one in pieces[1:]])
    points = np.column_stack([rng.uniform(-0.8, 0.9, 160), rng.uniform(-0.1, 0.18, 160)])
    beside = starts[rng.integers(len(starts), size=60)] + 10 ** rng.uniform(-13, -2, (60, 1)) * rng.normal(size=(60, 2))
    for c in [*points, *beside]:
        gap, q = scenes.nearest_on(pieces, c, closed=False)[0], np.array([*c, 0.3])
        if -0.0499 < gap < 0.0799:
            scenes.check_nearest(mod, q, 0.08, pieces, c, closed=False)
            met, deep = met + 1, deep + (gap < -0.01)
        elif -0.16 < gap < -0.0501:
            with pytest.raises(eg.NonFiniteError, match="floor .* deeper below the profile than its depth: .* belongs"):
                mod.energy(np.array([*q, 0, 0, 0]))
    assert mod.energy(np.array([0, -0.5, 0.3, 0, 0, 0]))[1] == 0.0  # of a floor of 0.05 as of a bridge
    assert (met > 60) & (deep > 15)


@pytest.mark.parametrize("shape", ["box", "circle"])
@pytest.mark.parametrize("kind", ["profile", "smooth_profile"])
def test_nothing_falls_through_unnoticed(shape: str, kind: str) -> None:
    """A depth of 1 mm and laws that are too soft: a body stays above, or the run ends and names the contact."""
    m, (body,) = scenes.planar("fall", 1)
    m.parameter("k", 1e3)
    points = [(x, 0.05 * np.sin(3 * x)) for x in np.linspace(-2, 2, 9)]
    floor = profile(m, [(-2, 0), (2, 0)] if kind == "profile" else points, kind, depth=1e-3)
    m.contacts("floor", on(PLANAR[shape], body), floor, {"stiffness": "k", "exponent": 1.5})
    mod, rng, ended = m.compile(target="numpy"), np.random.default_rng(1), 0
    for method in ("DOP853", "RK45") * 3:
        start = {"j0_y": rng.uniform(0.3, 1.0), "j0_y_dot": -(10 ** rng.uniform(-1, 1.5)), "j0_3": rng.uniform(-3, 3)}
        try:
            run = mod.simulate(0.5, start, {"k": 10 ** rng.uniform(0, 5)}, method=method)
            assert run["j0_y"].min() > -0.2
        except eg.SimulationError as error:
            assert "loads of floor are not (a shape is deeper below the profile" in str(error)
            ended += 1
    assert ended >= 4


@pytest.mark.parametrize("rolls", part_of([False, True], (True,).__contains__))
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
    m.contacts("floor", {"shape": "circle", "on": disc, "radius": r}, profile(m, arc, "smooth_profile"), law)
    m.event("turns", "j_x_dot", direction=1)
    mod = m.compile(optimize=0)
    start = 0.3
    s = R - r + mass * G * np.cos(start) / 1e7
    found = mod.simulate(
        4.0, initial={"j_x": s * np.sin(start), "j_y": R - s * np.cos(start)}, method="Radau", rtol=1e-8, atol=1e-10
    )
    turns = [t for t in found.t_events["turns"] if t > 0.1]
    period = np.diff(turns).mean()
    length = (R - r) * (1.5 if rolls else 1.0)
    swing = quad(lambda a: 1 / np.sqrt(1 - np.sin(start / 2) ** 2 * np.sin(a) ** 2), 0, np.pi / 2)[0]
    assert period == pytest.approx(4 * np.sqrt(length / G) * swing, rel=3e-3 if rolls else 1e-3)


@pytest.mark.parametrize("kind", part_of(["profile", "smooth_profile"], ("smooth_profile",).__contains__))
def test_targets_parameters_and_derivatives(kind: str) -> None:
    mods = []
    for target in ("numpy", "cython"):
        m, bodies = scenes.planar("hills", 3)
        m.parameter("h", 0.08)
        points = [(x, "h" if y == 0.08 else y) for x, y in HILLS]
        m.contacts(
            "floor", [on(PLANAR[k], b) for k, b in zip(("circle", "box", "segment"), bodies, strict=True)],
            profile(m, points, kind), LAW,
        )  # fmt: skip
        kernels = ("rhs", "jacobian", "parameter_jacobian")
        mods.append(m.compile(target=target, **({} if target == "numpy" else {"optimize": 0, "kernels": kernels})))
    x = mods[0].x0(j0_x=0.12, j0_y=0.15, j1_x=-0.1, j1_y=0.11, j1_3=0.2, j2_x=0.31, j2_y=0.09, j2_3=0.1, j0_x_dot=0.5)
    x[9:] = x[9:] + 0.1 * np.arange(9)
    for call in ("rhs", "jacobian", "parameter_jacobian"):
        a, b = (getattr(mod, call)(0.0, x) for mod in mods)
        assert np.abs(a - b).max() <= 1e-11 * np.abs(a).max()
    assert np.count_nonzero(np.abs(mods[0].rhs(0.0, x)[9:18]) > 20) >= 3
    found = mods[1].jacobian(0.0, x)
    np.testing.assert_allclose(found, differences(mods[1], x), rtol=1e-4, atol=1e-5 * np.abs(found).max())
    h = 1e-7
    late = [(mods[1].rhs(0.0, x, p={"h": 0.08 + d})) for d in (-h, h)]
    slope = (late[1] - late[0]) / (2 * h)
    np.testing.assert_allclose(
        mods[1].parameter_jacobian(0.0, x)[:, 0], slope, rtol=1e-4, atol=1e-5 * np.abs(slope).max()
    )


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"points": [(0, 0), (1, 0), (0.5, 1)]}, "EG-RANGE points[2]:"),
        ({"points": [(0, 0)]}, "EG-TYPE points: 2"),
        ({"points": [(0, 0), (1, 0)], "shape": "smooth_profile"}, "EG-TYPE points: 3"),
        ({"points": [(0, 0), (1, 2, 3)]}, "EG-TYPE points[1]:"),
    ],
)
def test_what_is_wrong_with_a_profile_is_reported(given: dict[str, Any], told: str) -> None:
    m, (ball,) = scenes.planar("wrong", 1)
    profile = {"shape": "profile", "on": m.ground, **given}
    m.contacts("floor", on(PLANAR["circle"], ball), profile, LAW)
    refuses(told, m.derive)


TURNED = Rotation.from_euler("xyz", (0.4, -0.8, 1.1))
FELT = {"stiffness": 2e4, "dissipation": 0.2, "friction": 0.3, "smoothing": 1e-2}
SHAPES: dict[str, dict[str, Any]] = {
    "sphere": {"shape": "sphere", "radius": 0.1},
    "ellipsoid": {"shape": "ellipsoid", "semi_axes": (0.2, 0.1, 0.05)},
    "cuboid": {"shape": "cuboid", "size": (0.4, 0.2, 0.1)},
    "capsule": {"shape": "capsule", "length": 0.4, "radius": 0.05},
}
GRID = np.linspace(-2.0, 2.0, 17)
WAVES = 0.1 * np.sin(2.0 * GRID)[:, None] * np.cos(1.5 * GRID)[None, :]


def ground(height: str, **on: Any) -> dict[str, Any]:
    return {"shape": "height_field", "height": height, **on}


@pytest.mark.parametrize("kind", SHAPES)
def test_a_plane_turned_any_way(kind: str) -> None:
    """A field that rises as a plane does is a half-space, also where shapes sink in deeply."""
    base = {"rpy": tuple(TURNED.as_euler("xyz"))}
    slope = np.array([0.3, -0.2])
    normal = np.array([*-slope, 1.0]) / np.sqrt(1 + slope @ slope)
    along = np.cross((0, 1.0, 0), normal)
    along /= np.linalg.norm(along)
    tilt = Rotation.from_matrix(np.column_stack([along, np.cross(normal, along), normal]))
    found = []
    for flat in (False, True):
        m, (body,) = flying(1)
        m.parameter("rise", 0.3)
        if flat:
            frame = {"rpy": tuple((TURNED * tilt).as_euler("xyz"))}
            floor = {"shape": "half_space", "on": m.ground.at(*TURNED.apply((0, 0, 0.05)), **frame)}
        else:
            floor = ground("0.05 + rise*x - 0.2*y", on=m.ground.at(0, 0, 0, **base))
        m.contacts("touch", {**SHAPES[kind], "on": body.at(0.02, 0, 0.01)}, floor, FELT)
        mod = m.compile(target="numpy")
        rng, rows = np.random.default_rng(4), []
        for k in range(12):
            place = TURNED.apply([*rng.uniform(-1, 1, 2), 0]) + rng.uniform(-0.1, 0.25) * TURNED.apply(normal)
            x = state(mod, [place], [Rotation.random(random_state=rng.integers(1 << 30))])
            x[mod.n_q :] = rng.uniform(-1, 1, 6)
            rows += [*mod.rhs(0.0, x), *(mod.jacobian(0.0, x).ravel() if k < 3 else ())]
        found.append(np.array(rows))
    assert np.abs(found[1]).max() > 100.0
    np.testing.assert_allclose(found[0], found[1], rtol=1e-9, atol=1e-9 * np.abs(found[1]).max())


@pytest.mark.parametrize("hollow", [False, True])
def test_a_dome_and_a_bowl(hollow: bool) -> None:
    """The depth of a sphere on and in a sphere, in turned frames, and forces as slopes of the energy."""
    sign = -1.0 if hollow else 1.0
    m, (a, b) = flying(2)
    height = f"{-sign}*big + {sign}*sqrt(big**2 - x**2 - y**2)"
    m.parameter("big", 1.0)
    m.contacts("touch", {**SHAPES["sphere"], "on": b}, ground(height, on=a.at(0.1, 0, 0)), ELASTIC)
    mod = m.compile(target="numpy")
    rng = np.random.default_rng(7)
    for k in range(20):
        way = np.array([*rng.uniform(-0.4, 0.4, 2), sign])
        way /= np.linalg.norm(way)
        centre = np.array([0.1, 0, -sign]) + (1.0 + sign * rng.uniform(0.02, 0.095)) * way
        x = state(mod, [(0.3, 0.1, 0), TURNED.apply(centre) + np.array([0.3, 0.1, 0])], [TURNED, TURNED])
        depth = 0.1 - sign * (np.linalg.norm(centre - [0.1, 0, -sign]) - 1.0)
        assert depth_of(mod, x) == pytest.approx(depth, rel=1e-10)
        force = -mod.bias(0.0, x)
        assert np.abs(force[:3] + force[6:9]).max() <= 1e-12 * np.abs(force).max()
        if k < 3:
            check_slopes(mod, x)


@pytest.mark.parametrize("kind", ["sphere", "ellipsoid"])
def test_gaps_over_waves_are_those_of_scipy(kind: str) -> None:
    """Above, grazing and deep: the way between two points of one normal; of spheres SciPy looks for the nearest too.

    Deep up to 0.7 of the least radius of curvature of the ground, 1 / 0.8 (amplitude 0.2, wave number 2).
    """
    m, (body,) = flying(1)
    axes = np.array(SHAPES[kind].get("semi_axes", [0.1] * 3))
    height = "0.2*sin(2*x)*cos(1.5*y)"
    m.contacts("touch", {**SHAPES[kind], "on": body}, ground(height, on=m.ground), ELASTIC)
    mod, rng, met = m.compile(target="numpy"), np.random.default_rng(12), 0

    def surface(s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        (sx, sy), (cx, cy) = np.sin([2 * s[0], 1.5 * s[1]]), np.cos([2 * s[0], 1.5 * s[1]])
        n = np.array([-0.4 * cx * cy, 0.3 * sx * sy, 1.0])
        return np.array([*s, 0.2 * sx * cy]), n / np.linalg.norm(n)

    for gap in (0.03, 0.01, 1e-3, 1e-6, -1e-9, -1e-6, -1e-3, *(-np.array([0.01, 0.05, 0.12, 0.3, 0.6]))) * 4:
        turn, place = Rotation.random(random_state=rng.integers(1 << 30)), rng.uniform(-1.5, 1.5, 2)
        point, n = surface(place)
        own = turn.apply(axes**2 * turn.inv().apply(n) / np.linalg.norm(axes * turn.inv().apply(n)))
        if kind == "ellipsoid" and gap < -0.12:
            continue  # deeper than its own radii of curvature
        x = state(mod, [point + gap * n + own], [turn])

        if kind == "sphere":
            centre = x[:3]
            found = minimize(lambda s, c=centre: float(np.sum((surface(s)[0] - c) ** 2)), centre[:2], tol=1e-15)
            assert np.sqrt(found.fun) == pytest.approx(0.1 + gap if gap > -0.1 else -0.1 - gap, abs=1e-9)
        (one,) = near(mod, x[: mod.n_q])
        assert abs(one.depth + gap) < 1e-9
        met += 1
        sign = -1.0 if one.kinds[0] != "height_field" else 1.0
        np.testing.assert_allclose(sign * one.normal, n, atol=1e-8)
        np.testing.assert_allclose(one.middle, point + 0.5 * gap * n, atol=1e-8)
    assert met > 30


def waves(shape: dict[str, Any], height: str = "amp*land(x, y)") -> Any:
    """A body over waves whose height, friction and loss are parameters, at first those of FELT."""
    m, (body,) = flying(1, (0, 0, -9.81))
    m.parameter("amp", 1.0)
    m.table("land", GRID, GRID, WAVES)
    law = {**FELT, **{name: m.parameter(name, FELT[name]) for name in ("dissipation", "friction")}}
    m.contacts("floor", {**shape, "on": body}, ground(height, on=m.ground.at(0, 0, 0.1)), law)
    return m


@pytest.mark.parametrize("kind", part_of(SHAPES, ("cuboid",).__contains__))
def test_derivatives_parameters_and_targets(kind: str) -> None:
    """The Jacobian beside differences, a parameter given late beside one given at once, both targets, a file."""
    m = waves(SHAPES[kind])
    mods = [m.compile(optimize=0), m.compile(target="numpy")]
    other = waves(SHAPES[kind], height="1.3*land(x, y)").compile(target="numpy")
    rng, felt = np.random.default_rng(9), 0
    for _ in range(5):
        turn = Rotation.random(random_state=rng.integers(1 << 30))
        x = state(mods[0], [(*rng.uniform(-1.5, 1.5, 2), rng.uniform(0.1, 0.2))], [turn])
        x[mods[0].n_q :] = rng.uniform(-1, 1, 6)
        value, jacobian = (np.array(mods[0].rhs(0.0, x)), mods[0].jacobian(0.0, x))
        np.testing.assert_allclose(mods[1].rhs(0.0, x), value, rtol=1e-9, atol=1e-9 * np.abs(value).max())
        np.testing.assert_allclose(mods[1].jacobian(0.0, x), jacobian, atol=1e-9 * np.abs(jacobian).max())
        slopes = differences(mods[0], x, 1e-6)
        felt += np.abs(slopes).max() > 1e3
        np.testing.assert_allclose(jacobian, slopes, atol=1e-6 * np.abs(slopes).max())
        late = mods[0].rhs(0.0, x, p={"amp": 1.3})
        np.testing.assert_allclose(late, other.rhs(0.0, x), rtol=1e-9, atol=1e-9 * np.abs(value).max())
    assert felt >= 1


def test_grids_lists_and_files_are_one(tmp_path: Any) -> None:
    m, (body,) = flying(1, (0, 0, -9.81))
    grid = {"x": GRID.tolist(), "y": GRID.tolist(), "z": WAVES.tolist()}
    ball = {**SHAPES["sphere"], "on": body}
    m.contacts("floor", ball, {"shape": "height_field", "on": m.ground.at(0, 0, 0.1), **grid}, FELT)
    mods = [one.compile(target="numpy") for one in (waves(SHAPES["sphere"]), m, read_back(m, tmp_path))]
    x = state(mods[0], [(0.3, 0.4, 0.2)], [TURNED])
    values = [mod.rhs(0.0, x) for mod in mods]
    assert np.abs(values[0]).max() > 10.0
    assert np.array_equal(values[0], values[1])
    assert np.array_equal(values[1], values[2])


def test_beyond_the_grid_the_slope_goes_on() -> None:
    """A table of a plane, 10 m beyond its end."""
    x = np.array([-1.0, 0.0, 1.0])
    m, (body,) = flying(1)
    field = {"shape": "height_field", "on": m.ground, "x": x, "y": x, "z": 0.3 * x[:, None] + 0 * x}
    m.contacts("floor", {**SHAPES["sphere"], "on": body}, field, ELASTIC)
    mod = m.compile(target="numpy")
    n = np.array([-0.3, 0, 1]) / np.hypot(0.3, 1)
    for way in (11.0, -9.0):
        at = np.array([way, 0.5, 0.3 * way]) + 0.08 * n
        assert depth_of(mod, state(mod, [at], [TURNED])) == pytest.approx(0.02, rel=1e-9)


@pytest.mark.parametrize("kind", part_of(["sphere", "ellipsoid", "cuboid"], ("cuboid",).__contains__))
def test_energy_over_waves(kind: str) -> None:
    """Without losses it stays; with friction and damping it never grows."""
    speeds = {"j0_x_dot": 1.0, "j0_wx": 3.0, "j0_wy": -2.0}
    mod = waves(SHAPES[kind]).compile(optimize=0)
    lossless = {"dissipation": 0.0, "friction": 0.0}
    traj = mod.simulate(1.0, {"j0_z": 0.5, **speeds}, lossless, rtol=1e-10, atol=1e-12)
    energy = np.sum(mod.energy(traj.x), axis=0)
    assert (mod.energy(traj.x)[1] - 9.81 * traj.x[2]).max() > 0.1
    assert np.ptp(energy) < 1e-6 * np.abs(energy).max()
    traj = mod.simulate(2.0, initial={"j0_z": 0.4, **speeds}, rtol=1e-8, atol=1e-10)
    energy = np.sum(mod.energy(traj.x), axis=0)
    assert np.diff(energy).max() < 1e-6 * np.abs(energy).max()
    assert energy[-1] < energy[0] - 0.1


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({}, "EG-MISSING contacts.floor.second[0].x"),
        ({"height": "u"}, "EG-NAME-UNKNOWN contacts.floor.second[0].height u"),
        ({"height": "x*j0_x"}, "EG-REFERENCE contacts.floor.second[0].height j0_x"),
        ({"x": [0, 1], "y": [1, 0], "z": [[0, 0], [0, 0]]}, "EG-RANGE contacts.floor.second[0].y[1]"),
        ({"x": [0, 1], "y": [0, 1], "z": [[0, 0]]}, "EG-SHAPE contacts.floor.second[0].z 1 2"),
    ],
)
def test_what_is_wrong_with_a_field_is_reported(given: dict[str, Any], told: str) -> None:
    m, (body,) = flying(1)
    m.contacts("floor", {**SHAPES["sphere"], "on": body}, {"shape": "height_field", "on": m.ground, **given}, ELASTIC)
    refuses(told, m.derive)
