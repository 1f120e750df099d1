"""Pictures in space: what lies in front covers what lies behind, from wherever it is seen."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib.pyplot as pyplot
import numpy as np
import pytest
from mpl_toolkits.mplot3d.proj3d import proj_transform

import eomgen as eg
from eomgen.show.build_scene import build_scene
from eomgen.show.scene_pieces import ScenePieces, eye_of

EXAMPLES = Path(__file__).parents[2] / "examples"
VIEWS = [(22.0, -58.0), (-35.0, 20.0), (80.0, 130.0), (5.0, 200.0)]


def nearest_hit(eye: np.ndarray, ways: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Index of the triangle that each ray from the eye meets first, -1 of none (Moeller and Trumbore 1997)."""
    a, e1, e2 = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    found = np.full(len(ways), -1)
    for k, way in enumerate(ways):
        p = np.cross(way, e2)
        det = np.einsum("ij,ij->i", e1, p)
        with np.errstate(divide="ignore", invalid="ignore"):
            s = eye - a
            u = np.einsum("ij,ij->i", s, p) / det
            q = np.cross(s, e1)
            v, t = (q @ way) / det, np.einsum("ij,ij->i", e2, q) / det
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
        if hit.any():
            found[k] = np.flatnonzero(hit)[np.argmin(t[hit])]
    return found


def blocks() -> Any:
    """Boxes, cylinders and balls that stand on, beside and before each other, of very different sizes."""
    m = eg.Model("blocks", gravity=(0, 0, -9.81))
    shapes = [
        {"shape": "box", "size": (2.0, 1.2, 0.1), "at": (0, 0, -0.05)},
        {"shape": "box", "size": (0.3, 0.3, 0.8), "at": (-0.6, 0.2, 0.42)},
        {"shape": "cylinder", "radius": 0.2, "length": 0.5, "at": (0.1, -0.2, 0.27)},
        {"shape": "sphere", "radius": 0.25, "at": (0.7, 0.1, 0.27)},
        {"shape": "box", "size": (1.6, 0.1, 0.1), "at": (0.0, 0.5, 0.3), "rpy": (0, 0.3, 0.1)},
    ]
    for k, shape in enumerate(shapes):
        m.free(f"fly{k}", m.ground, m.body(f"b{k}", mass=1, inertia=(1, 1, 1), display=[shape]))
    return m.compile(target="numpy")


@pytest.mark.parametrize(("elevation", "azimuth"), VIEWS)
def test_what_a_ray_meets_first_is_drawn_last(elevation: float, azimuth: float) -> None:
    module = blocks()
    ax = module.draw()
    ax.view_init(elevation, azimuth)
    ax.figure.canvas.draw()
    scene = build_scene(module, module.x0()[: module.n_q, None])
    scene = scene._replace(items=[item for item in scene.items if item.role == "shape"])
    assert len(scene.items) == 5
    eye = eye_of(ax.M)
    assert (ax.M @ [*eye[:3], 1.0])[2] != 0.0  # no place on the page (divided by 0, up to rounding), but a depth
    pieces = ScenePieces(scene)
    shown = pieces.seen(pieces.at(0), eye)
    flat = np.column_stack(proj_transform(*shown.corners.reshape(-1, 3).T, ax.M)[:2]).reshape(-1, 3, 2)
    meshes = [(k, item.at(scene.frames[0])[item.faces]) for k, item in enumerate(scene.items)]
    triangles, owners = (
        np.concatenate([mesh for _, mesh in meshes]),
        np.concatenate([np.full(len(mesh), k) for k, mesh in meshes]),
    )
    colors = np.array([pieces._colors[sum(len(of) for of, _ in pieces._parts[:k])] for k in range(5)])
    random = np.random.default_rng(3)
    chosen = triangles[random.integers(len(triangles), size=400)]
    points = np.einsum("ij,ijk->ik", random.dirichlet([1, 1, 1], 400), chosen)
    first = nearest_hit(eye[:3], points - eye[:3], triangles)
    seen = np.column_stack(proj_transform(*points.T, ax.M)[:2])
    a, b, c = flat[:, 0], flat[:, 1], flat[:, 2]

    def side(p: np.ndarray, q: np.ndarray, at: np.ndarray) -> np.ndarray:
        return (q[:, 0] - p[:, 0]) * (at[1] - p[:, 1]) - (q[:, 1] - p[:, 1]) * (at[0] - p[:, 0])

    wrong = 0
    for here, hit in zip(seen, first, strict=True):
        assert hit >= 0
        turns = np.array([side(a, b, here), side(b, c, here), side(c, a, here)])
        covered = np.flatnonzero((turns >= 0).all(axis=0) | (turns <= 0).all(axis=0))
        color = shown.colors[covered[-1]]
        hue = [float(np.linalg.norm(color / color.max() - other / other.max())) for other in colors]
        wrong += int(np.argmin(hue)) != owners[hit]
    assert wrong <= 4  # of 400: points on the very edge of a piece
    pyplot.close("all")


def test_the_eye_is_where_matplotlib_looks_from() -> None:
    """Points on one line through the eye fall on one point of the page, with and without perspective."""
    for kind in ("persp", "ortho"):
        ax = pyplot.figure().add_subplot(projection="3d", proj_type=kind)
        ax.set(xlim=(-1, 2), ylim=(0, 3), zlim=(1, 4))
        ax.figure.canvas.draw()
        eye = eye_of(ax.M)
        assert eye[3] == (1.0 if kind == "persp" else 0.0)
        point = np.array([0.3, 0.5, 2.0])
        toward = eye[:3] - eye[3] * point
        near = point + 0.2 * toward / np.linalg.norm(toward)
        here, there = (proj_transform(*p, ax.M) for p in (point, near))
        assert there[:2] == pytest.approx(here[:2], abs=1e-12)
        assert there[2] < here[2]  # nearer to the eye
        pyplot.close("all")


@pytest.mark.parametrize("name", ["stewart_platform", "bicycle", "double_wishbone", "puma560", "quadrotor_load"])
def test_faces_of_solids_look_outwards(name: str) -> None:
    """Else backs would be seen and fronts left out: the volume by the divergence theorem is positive."""
    module = eg.load(EXAMPLES / f"{name}.yaml").compile(target="numpy")
    scene = build_scene(module, module.x0()[: module.n_q, None])
    for item in scene.items:
        if item.faces is not None and item.convex:
            corners = item.at(scene.frames[0])
            a, b, c = (corners[item.faces[:, k]] - corners.mean(axis=0) for k in range(3))
            assert (np.einsum("ij,ij->i", a, np.cross(b, c)) >= -1e-12 * np.ptp(corners) ** 3).all(), item.name


def test_pieces_of_a_run_follow_its_bodies() -> None:
    """Corners of the pieces lie on the solids at every frame, and a trace grows."""
    module = eg.load(EXAMPLES / "furuta_pendulum.yaml").compile(target="numpy")
    run = module.simulate(0.5, t_eval=np.linspace(0, 0.5, 6))
    scene = build_scene(module, run.q, run.t, trace=[module.body_names[-1]])
    pieces = ScenePieces(scene)
    counts = []
    for k in range(6):
        corners = pieces.at(k)
        start = 0
        for item, (of, _) in zip(scene.items, pieces._parts, strict=True):
            points, mine = item.at(scene.frames[k], k), corners[start : start + len(of)]
            start += len(of)
            if item.role == "trace":
                counts.append(int(np.isfinite(mine).all(axis=(1, 2)).sum()))
            elif np.isfinite(points).all():
                assert mine.min(axis=(0, 1)) == pytest.approx(points.min(axis=0), abs=1e-9)
                assert mine.max(axis=(0, 1)) == pytest.approx(points.max(axis=0), abs=1e-9)
    assert counts[0] == counts[-1] > counts[3] > counts[1] > 0


def test_scenes_of_more_triangles_than_pieces_are_drawn_undivided(monkeypatch: pytest.MonkeyPatch) -> None:
    module = blocks()
    scene = build_scene(module, module.x0()[: module.n_q, None])
    raw = sum(len(item.points) - 1 if item.faces is None else len(item.faces) for item in scene.items)
    monkeypatch.setattr("eomgen.show.scene_pieces.MOST", 10)
    assert len(ScenePieces(scene).at(0)) == raw
