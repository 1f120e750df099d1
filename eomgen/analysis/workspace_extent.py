"""Analysis: points of outputs over a grid -> the area or volume they cover, however often.

Every cell of the grid, and every face of it where the grid has more coordinates than there are outputs, is cut into
simplices along its diagonals (H. Freudenthal, Simplizialzerlegungen von beschraenkter Flachheit, 1942), whose images
are drawn onto a raster.  A raster cell counts where its centre is covered.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations, permutations
from typing import Any

import numpy as np

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.analyses import FLAT_CELL, SLACK

CHUNK = 2_000_000  #: raster cells looked at in one go


def covered(points: Array, resolution: int) -> tuple[Array, Array, np.ndarray[Any, Any]]:
    """The raster over the images of the cells of a grid.

    Parameters
    ----------
    points : (d, *shape) array
        NaN where not reached; a cell counts as far as its corners are reached.
    resolution : int
        Raster cells along the longest side.

    Returns
    -------
    corner : (d,) array
        Of the raster.
    width : (d,) array
        Of its cells.
    raster : (n_1, .., n_d) bool array
    """
    d = len(points)
    fine = np.isfinite(points).all(axis=0)
    if not fine.any():
        return np.zeros(d), np.ones(d), np.zeros((1,) * d, dtype=bool)
    low, high = points[:, fine].min(axis=1), points[:, fine].max(axis=1)
    width = np.where(high > low, (high - low) / resolution, 1.0)
    raster = np.zeros((resolution,) * d, dtype=bool)
    for corners in _simplices(points):
        _draw(raster, (corners - low) / width)
    return low, width, raster


def _simplices(points: Array) -> Iterator[Array]:
    """Arrays (n, d + 1, d) of the corners of the simplices of all cells that are reached."""
    d, shape = len(points), points.shape[1:]
    for axes in combinations(range(len(shape)), d):
        for flip in (False, True):  # both diagonals, for cells some corners of which are not reached
            for order in permutations(axes):
                at = np.zeros(len(shape), dtype=int)
                if flip:
                    at[axes[0]] = 1
                path = [at.copy()]
                for axis in order:
                    at[axis] = 1 - at[axis]
                    path.append(at.copy())
                parts = []
                for offset in path:
                    cut = tuple(
                        slice(k, n - 1 + k) if axis in axes else slice(None)
                        for axis, (k, n) in enumerate(zip(offset, shape, strict=True))
                    )
                    parts.append(points[(slice(None), *cut)].reshape(d, -1).T)
                corners = np.stack(parts, axis=1)
                yield corners[np.isfinite(corners).all(axis=(1, 2))]


def _draw(raster: np.ndarray[Any, Any], corners: Array) -> None:
    """Mark raster cells whose centres lie in simplices (n, d + 1, d), in units of cells."""
    d = raster.ndim
    edges = corners[:, 1:] - corners[:, :1]
    solid = np.abs(np.linalg.det(edges)) > FLAT_CELL
    corners, edges = corners[solid], edges[solid]
    low = np.clip(np.ceil(corners.min(axis=1) - 0.5), 0, None).astype(int)
    high = np.minimum(np.floor(corners.max(axis=1) - 0.5).astype(int), np.array(raster.shape) - 1)
    sizes = np.maximum(high - low + 1, 0)
    counts = sizes.prod(axis=1)
    inverse = algebra.inv(edges) if len(edges) else edges
    ends = np.cumsum(counts)
    first = 0
    while first < len(counts):
        before = ends[first - 1] if first else 0
        last = max(first + 1, int(np.searchsorted(ends, before + CHUNK)))
        chosen = np.repeat(np.arange(first, last), counts[first:last])
        place = np.arange(len(chosen)) - np.repeat(ends[first:last] - counts[first:last] - before, counts[first:last])
        cell = np.empty((len(chosen), d), dtype=int)
        for k in reversed(range(d)):
            place, cell[:, k] = np.divmod(place, sizes[chosen, k])
        cell += low[chosen]
        part = np.einsum("ni,nij->nj", cell + 0.5 - corners[chosen, 0], inverse[chosen])
        inside = (part >= -SLACK).all(axis=1) & (part.sum(axis=1) <= 1.0 + SLACK)
        raster[tuple(cell[inside].T)] = True
        first = last
