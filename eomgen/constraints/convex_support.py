"""Constraint elements, supports: a formula of a support -> whether it is that of a convex body, at sampled normals.

Continued by H(k n) = k H(n), a support is that of a convex body where H is convex.  On unit normals its radii of
curvature are the eigenvalues of f_nn + (f - f_n . n) I across n, with the derivatives of any formula f that agrees with
H there (Schneider, Convex Bodies, 2014, section 2.5).  Where both vanish the body has a corner, about which it would
turn; where one does it has an edge, on which it rolls as a thin disc does.
"""

from __future__ import annotations

import math

import numpy as np

from ..elements.entry import Entry
from ..graph.core import Expr
from ..graph.differentiate import jvp
from ..graph.vectors import Vec3
from ..limits.descriptions import SHARP
from ..numeric.space import Array

#: Normals at which a support is looked at: 7 degrees apart.
SAMPLES = 800


def require_convex(e: Entry, support: Expr, local: Vec3) -> None:
    """Note a fault of a support that is not convex, as far as the declared values of parameters tell."""
    normals = spread_normals(SAMPLES)
    slopes = [_along(support, local, k) for k in range(3)]
    bends = [_along(slope, local, k) for slope in slopes for k in range(3)]
    points = {str(x.node[1]): normals[i] for i, x in enumerate(local)}
    found = e.at([support, *slopes, *bends], points)
    if found is None:
        return
    usable = np.isfinite(found).all(axis=0)  # a formula such as that of a disc has no curvature at its poles
    normals, found = normals[:, usable], found[:, usable]
    if not usable.any():
        e.fault("support", "is not a number, or has no slopes, whatever the normal is", "give the distance in metres")
        return
    radii = radii_of_curvature(normals, found)
    size = np.abs(found[:4]).sum(axis=0).max()
    least, most = radii[0].argmin(), radii[1].argmin()
    hollow = radii[0, least] < -SHARP * size
    if not hollow and radii[1, most] > SHARP * size:
        return
    if hollow:
        what = f"is not of a convex body: its radius of curvature is {radii[0, least]:.3g}"
    else:
        what = "is of a body with a corner: both radii of curvature are 0"
    at = ", ".join(f"{x:.3g}" for x in normals[:, least if hollow else most])
    remedy = (
        "give how far from the marker the plane lies that touches a smooth convex body with the normal [nx, ny, nz]"
    )
    e.fault("support", f"{what} where the outward normal is [{at}]", remedy)


def spread_normals(count: int) -> Array:
    """Unit vectors (3, count) spread over the sphere on a spiral, none of them along an axis."""
    k = np.arange(count) + 0.5
    z, turn = 1.0 - 2.0 * k / count, math.pi * (1.0 + math.sqrt(5.0)) * k
    across = np.sqrt(1.0 - z * z)
    return np.array([across * np.cos(turn), across * np.sin(turn), z])


def radii_of_curvature(normals: Array, found: Array) -> Array:
    """The smaller and the larger radius (2, count), of values, slopes and second derivatives (13, count)."""
    n, (f, slopes, bends) = normals.T, (found[0], found[1:4].T, found[4:].T.reshape(-1, 3, 3))
    flat = np.eye(3) - n[:, :, None] * n[:, None, :]
    bent = flat @ bends @ flat + (f - (slopes * n).sum(axis=1))[:, None, None] * flat
    twice, trace = (bent * bent).sum(axis=(1, 2)), np.trace(bent, axis1=1, axis2=2)
    apart = np.sqrt(np.maximum(0.0, 2.0 * twice - trace * trace))  # the third eigenvalue, along n, is 0
    return np.array([trace - apart, trace + apart]) / 2.0


def _along(x: Expr, local: Vec3, k: int) -> Expr:
    graph = x.graph
    return jvp([x], {symbol: graph.one if i == k else graph.zero for i, symbol in enumerate(local)})[0]
