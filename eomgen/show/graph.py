"""A report of a mechanism -> the mechanism as a graph: bodies above those that carry them, joints between them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from ..base.algebra import Array
from .axes import NAME_STYLE, TALL, WIDE, dots, places
from .draw import matplotlib

TREE, CUT, ELEMENT, BODY = "#1f4e79", "#c0392b", "#7d5ba6", "#eaf1f8"
COLUMN, LAYER = 1.5, 1.35  #: inches for a body beside and above another
SMALLEST, LARGEST = 5.0, 10.0  #: font size
NAME = 0.8  #: size of the names of joints, in that of bodies
BENDS = (0.12, -0.12, 0.25, -0.25, 0.4, -0.4)  #: of a joint that closes a loop, in parts of its length
ASIDE = 0.45  #: columns from a body to where such a joint meets the ground below it
NEAR = 14.0  #: points of type between lines that can be told apart, with room for names


class Layout(NamedTuple):
    """Where bodies are drawn: name -> (column, layer); ground spans all columns in layer 0."""

    bodies: dict[str, tuple[float, float]]
    columns: int
    layers: int


def layout(report: Any) -> Layout:
    """Bodies in the layer of their distance to ground in the tree, each above the middle of what it carries."""
    children: dict[str, list[str]] = {"ground": []}
    for branch in report.tree:
        children.setdefault(branch["parent"], []).append(branch["body"])
        children.setdefault(branch["body"], [])
    result: dict[str, tuple[float, float]] = {}
    columns = layers = 0
    waiting = [(body, 1, False) for body in reversed(children["ground"])]
    while waiting:
        body, layer, seen = waiting.pop()
        above = children[body]
        if above and not seen:
            waiting += [(body, layer, True), *((child, layer + 1, False) for child in reversed(above))]
            continue
        if above:
            result[body] = ((result[above[0]][0] + result[above[-1]][0]) / 2, float(layer))
        else:
            result[body] = (float(columns), float(layer))
            columns += 1
        layers = max(layers, layer)
    return Layout(result, max(columns, 1), layers)


class Graph:
    """The graph of a report on ``ax``, of a new figure by default, which a notebook or a window shows if asked to.

    Joints of the tree are straight, those that close loops bent away from what is drawn, elements are diamonds.
    """

    def __init__(self, report: Any, ax: Any = None, window: bool = False) -> None:
        self.report = report
        self.bodies, columns, layers = layout(report)
        if ax is None:
            make = matplotlib("pyplot", "the picture").figure if window else matplotlib("figure", "the picture").Figure
            size = min(1.0 + COLUMN * max(columns, 3), 40.0), min(1.3 + LAYER * (layers + 1), 40.0)
            ax = make(figsize=size, layout="constrained").add_subplot()
        self.ax = ax
        self.font = max(SMALLEST, min(LARGEST, 10.0 * 40.0 / COLUMN / max(columns, 27)))
        middle, half = (columns - 1) / 2, max((columns - 1) / 2 + 0.45, 0.9)
        self.ends = [(middle - half, 0.0), (middle + half, 0.0)]  #: of the ground
        self.corners = [(middle - half - 0.35, -0.35), (middle + half + 0.35, layers + 0.45)]
        ax.set(xlim=(self.corners[0][0], self.corners[1][0]), ylim=(self.corners[0][1], self.corners[1][1]))
        ax.set_axis_off()
        self._write_title()
        ax.figure.canvas.figure.draw_without_rendering()  # after this the places of names on the page are known
        self.drawn = [dots(self.typed(self.ends))]
        self.named: list[tuple[Array, str, str]] = []  #: point, name and colour
        self._draw_bodies()
        self._draw_joints()
        self._draw_elements()
        self._write_names()

    def typed(self, points: Any) -> Array:
        """Points (n, 2) in columns and layers -> in points of type on the page."""
        result: Array = self.ax.transData.transform(np.atleast_2d(points)) * 72.0 / self.ax.figure.dpi
        return result

    def _write_title(self) -> None:
        """Title and legend."""
        report, ax = self.report, self.ax
        freedoms = report.degrees_of_freedom
        caption = f"{freedoms} degree{'' if freedoms == 1 else 's'} of freedom"
        if report.independent and len(report.independent) <= 4:
            caption += f" ({', '.join(report.independent)})"
        ax.set_title(f"{report.name}: {caption}")
        kinds = (("joint of the tree", TREE, "-", True), ("joint that closes a loop", CUT, "--", report.loop_joints),
                 ("constraint element", ELEMENT, ":", report.elements))  # fmt: skip
        lines = [ax.plot([], [], color=color, linestyle=style, label=kind)[0] for kind, color, style, on in kinds if on]
        place = {"loc": "upper center", "bbox_to_anchor": (0.5, 0.0)}
        ax.legend(**place, ncols=len(lines), frameon=False, fontsize="small")

    def _draw_bodies(self) -> None:
        """Ground, and bodies in boxes."""
        self.ax.plot(*zip(*self.ends, strict=True), color="#555555", linewidth=6, solid_capstyle="butt", zorder=3)
        self.ax.annotate("ground", self.ends[0], (0, -6), textcoords="offset points", va="top", fontsize=self.font)
        box = {"boxstyle": "round,pad=0.35", "facecolor": BODY, "edgecolor": TREE}
        for body, at in self.bodies.items():
            self.ax.annotate(body, at, ha="center", va="center", fontsize=self.font, bbox=box, zorder=4)
            x, y = 0.5 * self.font * np.array([WIDE * len(body) + 0.7, TALL + 0.7])
            self.drawn.append(dots(self.typed(at) + [(a * x, b * y) for b in (-1, 0, 1) for a in (-1, 1)]))

    def _draw_joints(self) -> None:
        tree = {branch["joint"] for branch in self.report.tree}
        for joint in sorted(self.report.joints, key=lambda joint: joint["name"] not in tree):
            in_tree, there = joint["name"] in tree, np.vstack(self.drawn)
            ways = list(self._ways(joint["bodies"], (0.0,) if in_tree else BENDS))
            line = min(ways, key=partial(self._covered, there)) if ways[1:] else ways[0]
            color = TREE if in_tree else CUT
            self.ax.plot(*line.T, color=color, linewidth=1.6, linestyle="-" if in_tree else (0, (4, 3)), zorder=1)
            self.drawn.append(dots(self.typed(line)))
            self.named.append((line[len(line) // 2], f"{joint['name']}\n{joint['type']}", color))

    def _ways(self, ends: Sequence[str], bends: Sequence[float]) -> Iterator[Array]:
        """Lines (n, 2) between two bodies, each a parabola that is bent by a part of its length."""
        s = np.linspace(0.0, 1.0, 21)[:, None]
        for bend in bends:
            pairs = (ends, ends[::-1])
            one, other = (np.array(self.bodies.get(body, self._below(beside, bend))) for body, beside in pairs)
            run = other - one
            control = (one + other) / 2 + bend * np.array([run[1], -run[0]])
            yield (1 - s) ** 2 * one + 2 * s * (1 - s) * control + s**2 * other

    def _below(self, body: str, bend: float) -> tuple[float, float]:
        """Where a line from a body meets the ground: below it, or beside that if the line is bent."""
        return (self.bodies.get(body, (0.0, 0.0))[0] + ASIDE * np.sign(bend), 0.0)

    def _covered(self, drawn: Array, way: Array) -> int:
        """Points of a line that are near what is drawn already, or outside."""
        line, (low, high) = self.typed(way), self.typed(self.corners)
        near = np.abs(line[:, None] - drawn).max(axis=2).min(axis=1) < NEAR
        return int((near | (line < low).any(axis=1) | (line > high).any(axis=1)).sum())

    def _draw_elements(self) -> None:
        """Diamonds near the bodies that elements hold, with dotted lines to them."""
        for element in self.report.elements:
            ends = np.array([self.bodies[body] for body in element["bodies"] if body in self.bodies] or self.ends)
            middle = self.typed(ends.mean(axis=0))
            (offset,) = places([*middle], ["  "], self.font, np.vstack(self.drawn), *self.typed(self.corners))
            at = self.ax.transData.inverted().transform((middle[0] + offset) * self.ax.figure.dpi / 72.0)
            for end in ends:
                self.ax.plot(*zip(at, end, strict=True), color=ELEMENT, linestyle=":", linewidth=1.3, zorder=1)
                self.drawn.append(dots(self.typed([at, end])))
            self.ax.plot(*at, marker="D", color=ELEMENT, markersize=NAME * self.font, zorder=3)
            self.named.append((at, f"{element['name']}\n{element['type']}", ELEMENT))

    def _write_names(self) -> None:
        """Names of joints and elements where they cover the least."""
        points, texts, colors = zip(*self.named, strict=True) if self.named else ((), (), ())
        middles, size = [self.typed(point)[0] for point in points], NAME * self.font
        offsets = places(middles, texts, size, np.vstack(self.drawn), *self.typed(self.corners))
        style = {**NAME_STYLE, "fontsize": size, "textcoords": "offset points", "zorder": 5}
        for point, text, color, offset in zip(points, texts, colors, offsets, strict=True):
            self.ax.annotate(text, point, tuple(offset), color=color, **style)
