"""Bodies with hollow outlines are filled within their outline, not within its hull."""

from __future__ import annotations

from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.path import Path

import eomgen as eg
from eomgen.show.hollow_plates import hollow_plate

mpl.use("Agg")
STAR = [
    ((0.2 if k % 2 else 0.5) * np.cos(-np.pi * k / 5), (0.2 if k % 2 else 0.5) * np.sin(-np.pi * k / 5))
    for k in range(10)
]
BRACKET = [(0, 0), (0, 1), (1, 1), (1, 0.8), (0.2, 0.8), (0.2, 0.2), (1, 0.2), (1, 0)]


def area(points: Any) -> float:
    x, y = np.array(points).T
    return abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1))) / 2


@pytest.mark.parametrize("points", [STAR, BRACKET, STAR[::-1]])
def test_triangles_fill_the_outline(points: Any) -> None:
    """By areas: those of the caps are the outline's (shoelace), and the volume is that of the plate (divergence)."""
    turn = np.linalg.qr(np.random.default_rng(2).standard_normal((3, 3)))[0]
    vertices, faces = hollow_plate(np.column_stack([points, np.zeros(len(points))]) @ turn.T + [1, 2, 3], 0.05)
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    n = len(points) - 2
    caps = np.linalg.norm(np.cross(b - a, c - a), axis=1)[: 2 * n] / 2
    assert caps.sum() == pytest.approx(2 * area(points), rel=1e-12)
    assert np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6 == pytest.approx(0.1 * area(points), rel=1e-9)


@pytest.mark.parametrize("shape", [STAR, BRACKET])
def test_a_picture_shows_the_hollows(shape: Any) -> None:
    m = eg.Model("hollow", gravity=(0, -9.81, 0))
    body = m.body("star", mass=1.0, inertia={"zz": 0.1})
    m.planar("j", m.ground, body)
    outline = {"shape": "outline", "on": body, "points": shape}
    m.contacts("floor", outline, {"shape": "half_plane", "on": m.ground.at(0, -1, 0)}, {"stiffness": 1e5})
    ax = m.compile(target="numpy").draw()
    ax = getattr(ax, "axes", ax)
    ax = ax[0] if isinstance(ax, list) else ax
    filled = [verts for one in ax.collections for verts in one.get_paths()]
    filled += [patch.get_path() for patch in ax.patches]
    inside = Path(np.array(shape))
    hull_area = np.array(shape).mean(axis=0)
    grid = hull_area + np.random.default_rng(1).uniform(-0.6, 0.6, (4000, 2))
    seen = np.any([path.contains_points(grid) for path in filled], axis=0)
    assert (seen == inside.contains_points(grid)).mean() > 0.985
