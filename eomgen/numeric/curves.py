"""Stage numeric: positions that depend on one parameter -> points on them, predictions and interpolations."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np

from ..base.algebra import Array
from .scales import Scales

OFF = 0.1  #: largest part of a step by which a position may miss its prediction
TURNED = 0.3  #: the same of a direction
ASTRAY = 0.02  #: scaled distance of a position from its interpolation that may mean another branch


class Tangent(NamedTuple):
    """The direction of the motion at one point, and how well it is determined."""

    rate: Array  #: (n_v,) dq/ds as velocities
    quality: float = 1.0  #: smallest over largest singular value of K: 0 at a singular position
    sign: float = 1.0  #: of the determinant of as many independent rows of K as there are columns
    free: Array = np.empty(0)  #: (n_v,) scaled motion that K restrains least
    rows: Array = np.empty(0)  #: (n_c + k,) rows of K that hold that motion least


class Point(NamedTuple):
    """One point of a continuation; s is the curve's parameter."""

    s: float
    q: Array
    tangent: Tangent  #: along s


class PositionCurve(Protocol):
    """Positions that depend on one parameter s."""

    @property
    def scales(self) -> Scales:
        """The scales of positions."""

    def tangent(self, s: float, q: Array) -> Tangent:
        """The direction at a position."""

    def solve(self, s: float, guess: Array) -> Point | None:
        """The point next to a guess; None if Newton's iteration finds none."""


def predict(scales: Scales, here: Point, bend: Array, h: float) -> Array:
    """The position a step h ahead, from the direction and its change ``bend`` along s."""
    return scales.move(here.q, (here.tangent.rate + 0.5 * h * bend) * h / scales.q)


def interpolate(points: Sequence[Point], scales: Scales, s: Array) -> Array:
    """Positions (n_q, k) at parameters s (k,) between points of a curve, cubics through them and their directions."""
    if len(points) == 1:
        return np.repeat(points[0].q[:, None], len(s), axis=1)
    nodes = np.array([p.s for p in points])
    values = np.array([p.q for p in points]).T
    slopes = np.array([scales.rates(p.q, p.tangent.rate) for p in points]).T
    k = np.clip(np.searchsorted(nodes, s), 1, len(points) - 1)
    width = nodes[k] - nodes[k - 1]
    x = np.clip((s - nodes[k - 1]) / width, 0.0, 1.0)
    q0, q1 = values[:, k - 1], values[:, k]
    d0, d1 = slopes[:, k - 1] * width, slopes[:, k] * width
    result: Array = q0 + x * (d0 + x * (3 * (q1 - q0) - 2 * d0 - d1 + x * (2 * (q0 - q1) + d0 + d1)))
    for i, _ in scales.space.quaternion_slots if scales.space is not None else ():
        result[i : i + 4] /= np.sqrt((result[i : i + 4] ** 2).sum(axis=0))
    return result
