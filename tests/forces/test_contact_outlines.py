"""Contact with closed outlines: distances and overlaps by brute force, loops, frames, sprockets, what is wrong."""

import math
from functools import cache
from typing import Any

import contact_scenes as scenes
import numpy as np
import pytest
from contact_scenes import LAW, PLANAR, on
from force_judges import read_back
from judges import differences
from refusals import refuses
from sweeps import part_of

import eomgen as eg

STIFFNESS = 1e4
LINEAR = {"stiffness": STIFFNESS, "normal_law": "linear"}
COMB = [
    *((-0.3, -0.15), (0.3, -0.15), (0.3, 0.1), (0.16, 0.12), (0.13, -0.05), (0.04, -0.06), (0.02, 0.11), (-0.1, 0.1)),
    *((-0.1, -0.02), (-0.2, 0.0), (-0.2, 0.08), (-0.28, 0.1)),
]
WAVE = [(0.2, 0.0), (0.1, 0.09), (0.14, 0.22), (-0.02, 0.13), (-0.2, 0.16), (-0.13, 0.0), (-0.18, -0.15), (0.02, -0.1)]
WHEEL: dict[str, Any] = {"teeth": 7, "pitch": 0.1, "seat": 0.02, "tip_radius": 0.14}
OUTLINES: dict[str, dict[str, Any]] = {
    "outline": {"shape": "outline", "points": COMB},
    "smooth_outline": {"shape": "smooth_outline", "points": WAVE},
    "sprocket": {"shape": "sprocket", **WHEEL},
}


def curve_of(kind: str) -> list[scenes.Piece]:
    """The pieces of an outline, clockwise, made from its description."""
    if kind == "outline":
        return scenes.straight([*COMB[::-1], COMB[-1]])
    if kind == "smooth_outline":
        return scenes.smooth(WAVE[::-1], closed=True)
    n, r, tip = WHEEL["teeth"], WHEEL["seat"], WHEEL["tip_radius"]
    reach, half = WHEEL["pitch"] / (2 * math.sin(math.pi / n)), math.radians(65)
    seat, flank = np.array([reach - r * math.cos(half), r * math.sin(half)]), np.array([math.sin(half), math.cos(half)])
    end = seat + (math.sqrt((seat @ flank) ** 2 + tip**2 - seat @ seat) - seat @ flank) * flank
    found: list[scenes.Piece] = []
    for k in reversed(range(n)):
        turns = [2 * math.pi * at / n for at in (k, k - 1)]
        high, low, low_end = (scenes.turned_by(p, turns[0]) for p in (seat, seat * (1, -1), end * (1, -1)))
        tip_end, next_end = (scenes.turned_by(end, turn) for turn in turns)
        found += scenes.straight([tip_end, high])
        found += [scenes.Piece(high, low - high, scenes.turned_by(-flank, turns[0]))]
        found += scenes.straight([low, low_end, next_end])
    return found


def circle_on(shape: dict[str, Any], radius: Any, turn: float = 0.0, **parameters: float) -> eg.Module:
    m, (ball, solid) = scenes.planar("deep", 2, (0, 0, 0))
    for name, value in parameters.items():
        m.parameter(name, value)
    place = solid.at(0.03, -0.02, 0, rpy=(0, 0, turn))
    m.contacts("mesh", {"shape": "circle", "on": ball, "radius": radius}, on(shape, place), LINEAR)
    return m.compile(target="numpy")


def places(points: np.ndarray) -> np.ndarray:
    """With circles at some points in axes of the marker of the solid, whose body stands and is turned somehow."""
    x, turn = np.zeros((12, len(points))), 0.7
    c, s = math.cos(turn), math.sin(turn)
    x[:2] = np.add(points, (0.03, -0.02)).T
    x[0], x[1] = c * x[0] - s * x[1] + 0.4, s * x[0] + c * x[1] - 0.3
    x[2], x[3:6] = 0.2, np.array([0.4, -0.3, turn])[:, None]
    return x


@pytest.mark.parametrize("kind", OUTLINES)
def test_gaps_are_those_of_scipy(kind: str) -> None:
    """Apart, at and beside corners, deep inside: gap, normal and point; the energy is by that gap alone, or more."""
    pieces, mod, rng = curve_of(kind), circle_on(OUTLINES[kind], 0.04), np.random.default_rng(7)
    corners = np.array([one.start for one in pieces])
    low, high = corners.min(axis=0) - 0.03, corners.max(axis=0) + 0.03
    beside = corners[rng.integers(len(corners), size=80)] + 10 ** rng.uniform(-13, -2, (80, 1)) * rng.normal(
        size=(80, 2)
    )
    points = np.vstack([rng.uniform(low, high, (160, 2)), beside])
    x = places(points)
    energies = mod.energy(x)[1]
    alone = deep = 0
    for k, p in enumerate(points):
        if scenes.nearest_on(pieces, p, closed=True)[0] > 0.0399:
            continue
        gap = scenes.check_nearest(mod, x[:6, k], 0.04, pieces, p, closed=True, turn=0.7)
        expected = 0.5 * STIFFNESS * (0.04 - gap) ** 2
        assert energies[k] >= expected * (1 - 1e-7)
        alone += energies[k] <= expected * (1 + 1e-7)
        deep += gap < -0.01
    assert alone > 60
    assert deep > 20


@pytest.mark.parametrize("kind", OUTLINES)
def test_no_work_around_closed_paths(kind: str) -> None:
    """Of the circle and the turned solid, through walls, seats and the inside; the energy nowhere jumps."""
    mod = circle_on(OUTLINES[kind], 0.08, turn=0.3)
    rng, count = np.random.default_rng(11), 8000
    for _ in range(2):
        phase, wave = 2 * math.pi * np.arange(count + 1) / count, rng.uniform(-0.11, 0.11, (2, 6, 3))
        q = sum(
            wave[0, :, k, None] * np.cos((k + 1) * phase) + wave[1, :, k, None] * np.sin((k + 1) * phase)
            for k in range(3)
        )
        q[5] *= 10.0
        x = np.vstack([q, np.zeros_like(q)])
        energy = mod.energy(x)[1]
        force = -mod.bias(0.0, x)
        steps = np.diff(q, axis=1)
        work = (0.5 * (force[:, 1:] + force[:, :-1]) * steps).sum(axis=0)
        assert np.ptp(energy) > 1.0
        # each step changes the energy by the work; the few over places where the force changes at once, by at most it
        off = np.abs(np.diff(energy) + work)
        most = np.abs(force[:, 1:] * steps).sum(axis=0) + np.abs(force[:, :-1] * steps).sum(axis=0)
        assert (off <= most + 1e-9).all()
        assert np.sort(off)[:-60].sum() < 1e-4 * np.abs(work).sum()
        assert abs(work.sum()) < 5e-3 * np.abs(work).sum()


def meshed(kind: str) -> eg.Model:
    """A shape, a circle, a box and a segment that fly freely."""
    others = [{"shape": "circle", "radius": 0.08}, {"shape": "box", "size": (0.1, 0.3)}]
    others.append({"shape": "segment", "length": 0.3, "radius": 0.04})
    law = {"stiffness": STIFFNESS, "dissipation": 0.3, "friction": 0.3, "smoothing": 0.1}
    m, (solid, *bodies) = scenes.planar("deep", 4, (0, 0, 0))
    m.contacts("mesh", [on(x, b) for x, b in zip(others, bodies, strict=True)], on(OUTLINES[kind], solid), law)
    return m


@cache
def in_c(kind: str) -> eg.Module:
    return meshed(kind).compile(optimize=0)


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(5))
def test_random_scenes_keep_momenta_and_gain_no_energy(seed: int) -> None:
    """40 scenes of bodies that are thrown at an outline."""
    mod, rng, met = in_c("outline"), np.random.default_rng(seed), 0
    masses, inertias = 1.0 + 0.2 * np.arange(4), 0.01 + 0.001 * np.arange(4)
    for _ in range(40):
        x = np.zeros(24)
        x[2:12:3], x[14:24:3] = rng.uniform(-3, 3, 4), 5.0 * rng.standard_normal(4)
        for k in range(1, 4):
            way = 2.1 * k + rng.uniform(-0.3, 0.3)
            out = np.array([np.cos(way), np.sin(way)])
            x[3 * k : 3 * k + 2], x[12 + 3 * k : 14 + 3 * k] = 0.65 * out, -rng.uniform(1, 3) * out
        run = mod.simulate(0.6, dict(zip(mod.x_names, x, strict=True)), rtol=1e-9, atol=1e-11)
        energy = np.sum(mod.energy(run.x), axis=0)
        assert np.diff(energy).max() < 1e-6 * energy[0]
        met += energy[-1] < 0.99 * energy[0]
        found, size = scenes.momenta(masses, inertias, run.x)
        assert np.abs(found - found[:, :1]).max() < 1e-8 * size
    assert met > 30


@pytest.mark.parametrize("kind", part_of(OUTLINES, ("outline",).__contains__))
def test_forces_and_jacobians_in_both_targets(kind: str) -> None:
    """With corners of boxes and ends of segments deep in every shape; Jacobians are those of differences."""
    plain, quick = meshed(kind).compile(target="numpy"), in_c(kind)
    rng, met = np.random.default_rng(3), 0
    for k in range(8):
        x = np.concatenate([rng.uniform(-0.2, 0.2, 12), rng.standard_normal(12)])
        a, b = plain.rhs(0.0, x), quick.rhs(0.0, x)
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9 * np.abs(a).max())
        J = quick.jacobian(0.0, x)
        if k < 2:
            np.testing.assert_allclose(plain.jacobian(0.0, x), J, rtol=1e-7, atol=1e-9 * np.abs(J).max())
        h = 1e-7 * np.eye(24)
        apart = [np.abs(quick.rhs(0.0, x + d) - 2 * b + quick.rhs(0.0, x - d)).max() for d in h]
        if max(apart) > 1e-7 * np.abs(b).max():
            continue  # a corner of the law between the differences
        np.testing.assert_allclose(differences(quick, x), J, rtol=1e-5, atol=1e-6 * np.abs(J).max())
        met += 1
    assert met > 3


def test_points_and_radius_that_are_rebound() -> None:
    """A corner that is an outer one at the declared values becomes an inner one; a circle gets larger than a seat."""
    points = np.random.default_rng(4).uniform(-0.3, 0.3, (200, 2))
    corners = [(-0.3, -0.2), (0.3, -0.2), (0.3, 0.2), (0.0, 0.05), (-0.3, 0.2)]
    x = places(points)
    shape = {"shape": "outline", "points": [*corners[:3], (0.0, "h"), corners[4]], "depth": 0.02}
    late, fixed = circle_on(shape, 0.1, h=0.3), circle_on({"shape": "outline", "points": corners}, 0.1)
    np.testing.assert_allclose(late.energy(x, p=[0.05])[1], fixed.energy(x)[1], rtol=1e-9, atol=1e-9)
    late, fixed = circle_on(OUTLINES["sprocket"], "r", r=0.01), circle_on(OUTLINES["sprocket"], 0.07)
    np.testing.assert_allclose(late.energy(x, p=[0.07])[1], fixed.energy(x)[1], rtol=1e-9, atol=1e-9)


BLOB = [(0.3, 0.02), (0.2, 0.2), (0.0, 0.12), (-0.2, 0.2), (-0.3, 0.0), (-0.1, -0.15), (0.15, -0.17)]
SPROCKET: dict[str, Any] = {"teeth": 9, "pitch": 0.1, "seat": 0.022, "tip_radius": 0.165}


def test_a_box_is_an_outline_too() -> None:
    """For circles, segments and half-planes, which meet both in one way."""
    corners = [(0.15, 0.1), (0.15, -0.1), (-0.15, -0.1), (-0.15, 0.1)]
    box, outline = {"shape": "box", "size": (0.3, 0.2)}, {"shape": "outline", "points": corners}
    mods = []
    for shape in (box, outline):
        m, bodies = scenes.planar("block", 5)
        others = [on(PLANAR[k], b) for k, b in zip(PLANAR, bodies[1:], strict=True) if k in ("circle", "segment")]
        m.contacts("block", on(shape, bodies[0]), [*others, on({"shape": "half_plane"}, m.ground)], LAW)
        mods.append(m.compile(target="numpy"))
    rng, pushed = np.random.default_rng(2), 0
    for _ in range(6):
        x = np.concatenate([rng.uniform(-0.2, 0.2, 15), rng.standard_normal(15)])
        x[1] = rng.uniform(0.02, 0.15)
        for k in range(1, 5):
            x[3 * k : 3 * k + 2] = x[:2] + rng.uniform(0.1, 0.3) * np.array([math.cos(k), math.sin(k)])
        for call in ("rhs", "jacobian"):
            a, b = (getattr(mod, call)(0.0, x) for mod in mods)
            assert np.abs(a - b).max() <= 1e-9 * max(1.0, np.abs(a).max())
        pushed += np.abs(a).max() > 100
    assert pushed > 3


def test_a_tooth_is_felt_on_one_side_where_it_is_narrowest() -> None:
    """Between seats that reach the line of their pins; the energy of a path across the tooth has no jump."""
    m, (ball,) = scenes.planar("waist", 1, (0, 0, 0))
    m.parameter("a", math.radians(130))
    wheel = {"teeth": 7, "pitch": 0.1, "seat": 0.02, "tip_radius": 0.14, "seat_angle": "a"}
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


def test_what_is_wrong_with_an_outline_is_reported() -> None:
    cases = [
        ({"shape": "outline", "points": [(0, 0), (1, 1), (1, 0), (0, 1)]}, "EG-RANGE points:"),
        ({"shape": "outline", "points": [(0, 0), (1, 0)]}, "EG-TYPE points: 3 64"),
        ({"shape": "outline", "points": [(0, 0), ("w", 0), (0, 1)]}, "EG-MISSING depth:"),
        ({"shape": "sprocket", **SPROCKET, "teeth": 2}, "EG-RANGE teeth: 3"),
        ({"shape": "sprocket", **SPROCKET, "seat": 0.06}, "EG-RANGE seat: 0.05"),
        ({"shape": "sprocket", **SPROCKET, "tip_radius": 0.13}, "EG-RANGE tip_radius:"),
        ({"shape": "sprocket", **SPROCKET, "seat_angle": 130}, "EG-RANGE seat_angle: 130"),
    ]
    for shape, told in cases:
        m, (ball,) = scenes.planar("wrong", 1)
        m.parameter("w", 1.0)
        m.contacts("mesh", on(PLANAR["circle"], ball), on(shape, m.ground), LAW)
        refuses(told, m.derive)


@pytest.mark.thorough
def test_an_outline_is_verified_and_written_again(tmp_path: Any) -> None:
    m, (ball, wheel) = scenes.planar("written", 2)
    m.contacts("mesh", on(PLANAR["circle"], ball), {"shape": "smooth_outline", "on": wheel, "points": BLOB}, LAW)
    m.initial(j0_x=0.24, j0_y=0.03, j1_x=0.0, j1_y=0.0)
    mod, again = m.compile(target="numpy"), read_back(m, tmp_path).compile(target="numpy")
    x = mod.x0()
    assert np.abs(mod.rhs(0.0, x)).max() > 20
    assert np.array_equal(mod.rhs(0.0, x), again.rhs(0.0, x))
    assert mod.verify().ok
