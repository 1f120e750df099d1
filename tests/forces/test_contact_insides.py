"""Contact deep inside closed outlines and where they hold a circle on two sides: its energy by grids, loops, frames."""

from __future__ import annotations

import math
from typing import Any

import contact_scenes as scenes
import numpy as np
import pytest
from contact_scenes import on

import eomgen as eg
from eomgen.simulation.meetings import PenetrationWarning

STIFFNESS = 1e4
LINEAR = {"stiffness": STIFFNESS, "normal_law": "linear"}
COMB = [(-0.3, -0.15), (0.3, -0.15), (0.3, 0.1), (0.16, 0.12), (0.13, -0.05), (0.04, -0.06), (0.02, 0.11), (-0.1, 0.1)]
COMB += [(-0.1, -0.02), (-0.2, 0.0), (-0.2, 0.08), (-0.28, 0.1)]
WAVE = [(0.2, 0.0), (0.1, 0.09), (0.14, 0.22), (-0.02, 0.13), (-0.2, 0.16), (-0.13, 0.0), (-0.18, -0.15), (0.02, -0.1)]
WHEEL: dict[str, Any] = {"teeth": 7, "pitch": 0.1, "seat": 0.02, "tip_radius": 0.14}
SHAPES: dict[str, dict[str, Any]] = {
    "outline": {"shape": "outline", "points": COMB},
    "smooth_outline": {"shape": "smooth_outline", "points": WAVE},
    "sprocket": {"shape": "sprocket", **WHEEL},
}


def biarc(a: np.ndarray, b: np.ndarray, s: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Points of two arcs of one tangent and equal tangent lengths, as bisections of turned chords."""
    v = b - a
    along, square = v @ (s + t), v @ v
    d = square / (along + math.sqrt(along**2 + 2 * (1 - s @ t) * square))
    joint = 0.5 * (a + b + d * (s - t))

    def arc(p: np.ndarray, q: np.ndarray, at_p: np.ndarray) -> np.ndarray:
        chord = q - p
        half = math.atan2(at_p[0] * chord[1] - at_p[1] * chord[0], at_p @ chord)
        if abs(half) < 1e-9:
            return np.linspace(p, q, 200)
        radius = 0.5 * math.hypot(*chord) / math.sin(half)
        centre = p + radius * np.array([-at_p[1], at_p[0]])
        turn = np.linspace(0, 2 * half, 200)
        start = p - centre
        return centre + np.column_stack([
            np.cos(turn) * start[0] - np.sin(turn) * start[1], np.sin(turn) * start[0] + np.cos(turn) * start[1]
        ])  # fmt: skip

    to_end = 2 * (joint - a) @ s / ((joint - a) @ (joint - a)) * (joint - a) - s  # the tangent at the joint
    return np.vstack([arc(a, joint, s), arc(joint, b, to_end)])


def line_of(kind: str) -> np.ndarray:
    """A dense polygon of an outline, made from its description."""
    if kind == "outline":
        return np.array(COMB)
    if kind == "smooth_outline":
        p, n = np.array(WAVE), len(WAVE)
        ways = []
        for k in range(n):
            before, after = p[k] - p[k - 1], p[(k + 1) % n] - p[k]
            way = before * (after @ after) + after * (before @ before)
            ways.append(way / math.hypot(*way))
        found = np.vstack([biarc(p[k], p[(k + 1) % n], ways[k], ways[(k + 1) % n]) for k in range(n)])
        return found[np.hypot(*(found - np.roll(found, 1, axis=0)).T) > 1e-12]
    n, r, tip = WHEEL["teeth"], WHEEL["seat"], WHEEL["tip_radius"]
    reach, half = WHEEL["pitch"] / (2 * math.sin(math.pi / n)), math.radians(65)
    found = []
    for k in range(n):
        b = np.linspace(-half, half, 200)
        seat = np.transpose([reach - r * np.cos(b), r * np.sin(b)])
        way = np.array([math.sin(half), math.cos(half)])
        along = seat[-1] @ way
        end = seat[-1] + (math.sqrt(along**2 + tip**2 - seat[-1] @ seat[-1]) - along) * way
        turn = 2 * math.pi * k / n
        R = np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
        found.append(np.vstack([end * (1, -1), seat, end]) @ R)
    return np.vstack(found)


def inside(points: np.ndarray, line: np.ndarray) -> np.ndarray:
    """By the number of edges that a ray along x crosses."""
    crossed = np.zeros(len(points), dtype=bool)
    for (x0, y0), (x1, y1) in zip(line, np.roll(line, -1, axis=0), strict=True):
        if y0 == y1:
            continue
        between = (y0 > points[:, 1]) != (y1 > points[:, 1])
        crossed ^= between & (points[:, 0] < x0 + (points[:, 1] - y0) * (x1 - x0) / (y1 - y0))
    return crossed


def distance(p: np.ndarray, line: np.ndarray) -> float:
    ends = np.roll(line, -1, axis=0)
    edge = ends - line
    run = np.clip(((p - line) * edge).sum(1) / (edge * edge).sum(1), 0, 1)[:, None]
    return float(np.hypot(*(p - line - run * edge).T).min())


class Grid:
    """A solid as points of a grid: the overlap with a circle grows from its centre, point by point, and joins."""

    def __init__(self, line: np.ndarray, count: int) -> None:
        low, high = line.min(axis=0), line.max(axis=0)
        self.line, self.step = line, float((high - low).max()) / count
        axes = [np.arange(low[k] - self.step, high[k] + self.step, self.step) for k in range(2)]
        self.x = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        self.solid = inside(self.x.reshape(-1, 2), line).reshape(self.x.shape[:2])

    def energy(self, c: np.ndarray, radius: float) -> float:
        """Of a linear law: of each separate part of the overlap, less what it had where it joins an older one."""
        away = np.hypot(*np.moveaxis(self.x - c, -1, 0))
        within = np.argwhere(self.solid & (away < radius))
        order = within[np.argsort(away[tuple(within.T)])]
        parent: dict[tuple[int, int], tuple[int, int]] = {}
        born: dict[tuple[int, int], float] = {}

        def root(k: tuple[int, int]) -> tuple[int, int]:
            while parent[k] != k:
                parent[k] = parent[parent[k]]
                k = parent[k]
            return k

        found = 0.0
        for i, j in order.tolist():
            r = away[i, j]
            beside = [(i + a, j + b) for a in (-1, 0, 1) for b in (-1, 0, 1)]
            roots = sorted({root(k) for k in beside if k in parent}, key=lambda k: born[k])
            parent[i, j] = roots[0] if roots else (i, j)
            if not roots:
                born[i, j] = r
            for younger in roots[1:]:
                parent[younger] = roots[0]
                start = born.pop(younger)
                if r - start > 2 * self.step:  # less is of the steps of the grid
                    found += 0.5 * STIFFNESS * ((radius - start) ** 2 - (radius - r) ** 2)
        found += sum(0.5 * STIFFNESS * (radius - start) ** 2 for start in born.values())
        if inside(c[None], self.line)[0]:
            d = distance(c, self.line)
            found += 0.5 * STIFFNESS * ((radius + d) ** 2 - radius**2)
        return found


def model(
    shape: dict[str, Any], radius: Any, law: dict[str, Any] = LINEAR, target: str = "numpy", turn: float = 0.0
) -> eg.Module:
    m, (ball, solid) = scenes.planar("deep", 2, (0, 0, 0))
    place = solid.at(0.03, -0.02, 0, rpy=(0, 0, turn))
    m.contacts("mesh", {"shape": "circle", "on": ball, "radius": radius}, on(shape, place), law)
    return m.compile(target=target)


def states(points: np.ndarray) -> np.ndarray:
    """With circles at some points in axes of the marker of the solid, whose body stands and is turned somehow."""
    x, turn = np.zeros((12, len(points))), 0.7
    c, s = math.cos(turn), math.sin(turn)
    x[:2] = np.add(points, (0.03, -0.02)).T
    x[0], x[1] = c * x[0] - s * x[1] + 0.4, s * x[0] + c * x[1] - 0.3
    x[2], x[3:6] = 0.2, np.array([0.4, -0.3, turn])[:, None]
    return x


@pytest.mark.parametrize("kind", SHAPES)
@pytest.mark.parametrize("radius", [0.03, 0.12])
def test_energy_by_the_parts_of_the_overlap(kind: str, radius: float) -> None:
    """On grids, whose error is of the order of their steps."""
    line = line_of(kind)
    low, high = line.min(axis=0) - 0.8 * radius, line.max(axis=0) + 0.8 * radius
    points = np.random.default_rng(7).uniform(low, high, (24, 2))
    found = model(SHAPES[kind], radius).energy(states(points))[1]
    for count in (60, 120):
        grid = Grid(line, count)
        wrong = np.abs([grid.energy(p, radius) - e for p, e in zip(points, found, strict=True)])
        assert (wrong < STIFFNESS * (radius + 0.1) * grid.step).all(), points[wrong.argmax()]
    assert (found > 0).sum() > 10


@pytest.mark.parametrize("kind", SHAPES)
@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_no_work_around_closed_paths(kind: str, target: str) -> None:
    """Of the circle and the turned solid, through walls, seats and the inside; the energy nowhere jumps."""
    mod = model(SHAPES[kind], 0.08, target=target, turn=0.3)
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


def test_forces_and_jacobians_in_both_targets() -> None:
    """With corners of boxes and ends of segments deep in every shape; Jacobians are those of differences."""
    others = [{"shape": "circle", "radius": 0.08}, {"shape": "box", "size": (0.1, 0.3)}]
    others.append({"shape": "segment", "length": 0.3, "radius": 0.04})
    law = {"stiffness": STIFFNESS, "dissipation": 0.3, "friction": 0.3, "smoothing": 0.1}
    for shape in SHAPES.values():
        m, (solid, *bodies) = scenes.planar("deep", 4, (0, 0, 0))
        m.contacts("mesh", [on(x, b) for x, b in zip(others, bodies, strict=True)], on(shape, solid), law)
        plain, quick = m.compile(target="numpy"), m.compile(target="cython")
        rng, met = np.random.default_rng(3), 0
        for k in range(12):
            x = np.concatenate([rng.uniform(-0.2, 0.2, 12), rng.standard_normal(12)])
            a, b = plain.rhs(0.0, x), quick.rhs(0.0, x)
            np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9 * np.abs(a).max())
            meeting = [
                mod.kernels.motion("meeting_time")(x[:12], x[12:], np.ones(12), u=np.zeros(0), t=0.0)
                for mod in (plain, quick)
            ]
            np.testing.assert_allclose(*meeting, rtol=1e-9, atol=1e-12)
            J = quick.jacobian(0.0, x)
            if k < 4:
                np.testing.assert_allclose(plain.jacobian(0.0, x), J, rtol=1e-7, atol=1e-9 * np.abs(J).max())
            h = 1e-7 * np.eye(24)
            apart = [np.abs(quick.rhs(0.0, x + d) - 2 * b + quick.rhs(0.0, x - d)).max() for d in h]
            if max(apart) > 1e-7 * np.abs(b).max():
                continue  # a corner of the law between the differences
            slopes = np.transpose([(quick.rhs(0.0, x + d) - quick.rhs(0.0, x - d)) / 2e-7 for d in h])
            np.testing.assert_allclose(slopes, J, rtol=1e-5, atol=1e-6 * np.abs(J).max())
            met += 1
        assert met > 6


def test_descriptions_of_one_outline() -> None:
    """From another corner on, the other way round, and mirrored with the circle."""
    points = np.random.default_rng(9).uniform(-0.35, 0.3, (200, 2))
    found = model(SHAPES["outline"], 0.06).energy(states(points))[1]
    for corners in (COMB[4:] + COMB[:4], COMB[::-1]):
        mod = model({"shape": "outline", "points": corners}, 0.06)
        np.testing.assert_allclose(mod.energy(states(points))[1], found, rtol=1e-9, atol=1e-9)
    mirrored = model({"shape": "outline", "points": [(-x, y) for x, y in COMB]}, 0.06)
    np.testing.assert_allclose(mirrored.energy(states(points * (-1, 1)))[1], found, rtol=1e-9, atol=1e-9)
    # the depth up to which pieces tell by themselves changes nothing
    for depth in (0.004, 0.3):
        mod = model({"shape": "outline", "points": COMB, "depth": depth}, 0.06)
        np.testing.assert_allclose(mod.energy(states(points))[1], found, rtol=1e-9, atol=1e-9)


def test_points_and_radius_that_come_late() -> None:
    """A corner that is an outer one at the declared values becomes an inner one; a circle gets larger than a seat."""
    points = np.random.default_rng(4).uniform(-0.3, 0.3, (200, 2))
    corners = [(-0.3, -0.2), (0.3, -0.2), (0.3, 0.2), (0.0, 0.05), (-0.3, 0.2)]
    for declared in (0.3, 0.05):
        m, (ball, solid) = scenes.planar("late", 2, (0, 0, 0))
        m.parameter("h", declared)
        shape = {"shape": "outline", "points": [*corners[:3], (0.0, "h"), corners[4]], "depth": 0.02}
        place = solid.at(0.03, -0.02, 0)
        m.contacts("mesh", {"shape": "circle", "on": ball, "radius": 0.1}, on(shape, place), LINEAR)
        late = m.compile(target="numpy")
        fixed = model({"shape": "outline", "points": corners}, 0.1)
        x = states(points)
        np.testing.assert_allclose(late.energy(x, p=[0.05])[1], fixed.energy(x)[1], rtol=1e-9, atol=1e-9)
    m, (ball, solid) = scenes.planar("late", 2, (0, 0, 0))
    m.parameter("r", 0.01)
    shape = on(SHAPES["sprocket"], solid.at(0.03, -0.02, 0))
    m.contacts("mesh", {"shape": "circle", "on": ball, "radius": "r"}, shape, LINEAR)
    x = states(points)
    expected = model(SHAPES["sprocket"], 0.07).energy(x)[1]
    np.testing.assert_allclose(m.compile(target="numpy").energy(x, p=[0.07])[1], expected, rtol=1e-9, atol=1e-9)


def test_corners_deep_inside_by_brute_force() -> None:
    """Each corner of a box has the energy of its distance from the outline."""
    line, rng = np.array(COMB), np.random.default_rng(2)
    m, (box, solid) = scenes.planar("box", 2, (0, 0, 0))
    m.contacts("mesh", {"shape": "box", "on": box, "size": (0.02, 0.9)}, on(SHAPES["outline"], solid), LINEAR)
    mod, deepest = m.compile(target="numpy"), 0.0
    for _ in range(60):
        x = np.zeros(12)
        x[:3] = *rng.uniform(-0.3, 0.3, 2), rng.uniform(-3, 3)
        corners = scenes.placed(x[:3], scenes.rectangle(0.02, 0.9))
        deep = [distance(p, line) if inside(p[None], line)[0] else 0.0 for p in corners]
        turn, own = x[2], line - x[:2]
        c, s = math.cos(turn), math.sin(turn)
        local = np.abs(own @ np.array([[c, -s], [s, c]]))
        tops = [k for k in range(len(line)) if is_outer(line, k)]
        deep += [max(0.0, min(0.01 - local[k, 0], 0.45 - local[k, 1])) for k in tops]
        assert mod.energy(x)[1] == pytest.approx(0.5 * STIFFNESS * sum(d * d for d in deep), rel=1e-9, abs=1e-12)
        deepest = max(deepest, *deep)
    assert deepest > 0.05


def is_outer(line: np.ndarray, k: int) -> bool:
    a, b = line[k] - line[k - 1], line[(k + 1) % len(line)] - line[k]
    return bool(a[0] * b[1] - a[1] * b[0] > 0)  # counterclockwise


@pytest.mark.parametrize("height", [-0.07, -0.02])
def test_a_start_deep_inside_is_told(height: float) -> None:
    """And the circle comes out with the energy that it had."""
    m, (ball,) = scenes.planar("out", 1, (0, 0, 0))
    corners = [(-0.1, -0.1), (0.1, -0.1), (0.1, 0.1), (-0.1, 0.1)]
    shape = {"shape": "outline", "points": corners, "depth": 0.01, "on": m.ground}
    m.contacts("wall", {"shape": "circle", "on": ball, "radius": 0.05}, shape, LINEAR)
    mod = m.compile()
    with pytest.warns(PenetrationWarning, match="deep"):
        traj = mod.simulate(1.0, initial={"j0_x": 0.001, "j0_y": height}, rtol=1e-10, atol=1e-12)
    energy = 0.5 * STIFFNESS * (0.05 + 0.1 + height) ** 2
    total = np.sum(mod.energy(traj.x), axis=0)
    np.testing.assert_allclose(total, energy, rtol=1e-6)
    assert mod.energy(traj.x[:, -1])[0] == pytest.approx(energy, rel=1e-6)
