"""Stage show, labels: a Scene on axes -> places of the names beside what they name, where they can be read."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from ..base.algebra import Array
from .scene import Scene
from .solids import outline

NAMES = "0.25"  #: colour of names of joints
SIZE = 8.0  #: of the font
NAME_STYLE: dict[str, Any] = {
    "ha": "center",
    "va": "center",
    "fontsize": SIZE,
    "bbox": {"boxstyle": "round,pad=0.1", "facecolor": "white", "edgecolor": "none", "alpha": 0.7},
}

WIDE, TALL = 0.62, 1.2  #: of a letter and a line, in sizes of the font
EDGE = 0.3  #: of the ground of a name, left and right, or above and below, together
DIRECTIONS = 16
DISTANCES = (5.0, 9.0, 14.0, 20.0, 28.0, 38.0)  #: from the point to the edge of the name (points of type)
EVERY = 2.0  #: distance of the dots that stand for a line (points of type)
FAR = 0.1  #: what a point of type away costs, in dots that are covered
ON_A_NAME = 40.0  #: what it costs to cover another name
OUTSIDE = 40.0  #: and to stand outside of the axes


def name_offsets(scene: Scene, ax: Any, page: Callable[[Array], Array]) -> list[Array]:
    """Offsets (2,) in points of type from what is named in the first frame to the middles of the names.

    Parameters
    ----------
    scene : Scene
    ax : matplotlib Axes
        With its limits.
    page : callable
        Points (n, 3) in ground axes -> (n, 2) in data of the axes.
    """
    scale = 72.0 / ax.figure.dpi

    def typed(points: Array) -> Array:
        there: Array = ax.transData.transform(page(points)) * scale
        return there

    low, high = ax.transAxes.transform([(0.0, 0.0), (1.0, 1.0)]) * scale
    return offsets_within(scene, typed, low, high)


def offsets_within(scene: Scene, typed: Callable[[Array], Array], low: Array, high: Array) -> list[Array]:
    """The same where points (n, 3) in ground axes are at ``typed`` (n, 2), between low and high (points of type)."""
    if not scene.labels:
        return []
    poses, drawn = scene.frames[0], []
    for item in scene.items:
        if item.role != "trace":
            points = typed(item.at(poses))
            drawn.append(dots(points if item.faces is None else _closed(outline(points))))
    named = [typed(label.at(poses)[None])[0] for label in scene.labels]
    return places(named, [label.text for label in scene.labels], SIZE, np.vstack(drawn), low, high)


def _closed(corners: Array) -> Array:
    return np.vstack([corners, corners[:1]])


def dots(line: Array) -> Array:
    """Dots (m, 2) along a line (n, 2), broken at NaN, at most EVERY apart."""
    found = [np.empty((0, 2))]
    for a, b in pairwise(line):
        if np.isfinite(a).all() and np.isfinite(b).all():
            count = int(np.ceil(float(np.hypot(*(b - a))) / EVERY)) + 1
            found.append(a + np.linspace(0.0, 1.0, count)[:, None] * (b - a))
    return np.vstack(found)


def places(
    points: Sequence[Array], texts: Sequence[str], size: float, drawn: Array, low: Array, high: Array
) -> list[Array]:
    """Offsets (2,) from each point to the middle of its name, where it covers the least of the drawing.

    All lengths are in points of type on the page.

    Parameters
    ----------
    points : sequence of (2,) arrays
        What is named.
    texts : sequence of str
    size : float
        Of the font.
    drawn : (m, 2) array
        Dots of the drawing.
    low, high : (2,) arrays
        Corners of the axes.
    """
    turns = 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    ways = np.column_stack([np.cos(turns), np.sin(turns)])
    taken: list[tuple[Array, Array]] = []
    found = []
    for point, text in zip(points, texts, strict=True):
        half = 0.5 * size * np.array([WIDE * len(text) + EDGE, TALL + EDGE])
        best, least = np.zeros(2), np.inf
        for distance in DISTANCES:
            for way in ways:
                offset = way * distance + way * half
                middle = point + offset
                cost = FAR * distance + float((np.abs(drawn - middle) < half + 1.0).all(axis=1).sum())
                cost += ON_A_NAME * sum(bool((np.abs(other - middle) < half + h).all()) for other, h in taken)
                cost += OUTSIDE * bool((middle - half < low).any() or (middle + half > high).any())
                if cost < least:
                    best, least = offset, cost
        taken.append((point + best, half))
        found.append(best)
    return found
