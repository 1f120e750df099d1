"""Stage kinematics: joints that slide along the parent's axes -> the same system along the link's own axes.

The velocity of a free joint is along the axes of its marker on the parent, so that its columns of the motion subspace
are full of sines and cosines.  Along the link's own axes they are unit vectors, and whatever is projected on them or
eliminated with them is shorter: with w = R v for these three velocities the system M v' + h = 0 becomes
(R M R^T) w' + R h = 0, where v' = R^T w' (w' taken at rest, as h holds the velocity terms).  What hangs on ground by
such a joint falls freely: gravity is left out of h and added to v'.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property

from ..frames import GROUND
from ..graph import vectors as vec
from ..graph.core import Expr
from ..graph.vectors import Mat3, Vec3
from ..records import dataclass
from .kinematics import Kinematics
from .tree import Link

Rows = tuple[tuple[Expr, ...], ...]


@dataclass(frozen=True)
class SlidingTriple:
    """Three velocities of a link: the first, link axes to the axes they are along, gravity in these if it falls."""

    link: int
    first: int
    rotation: Mat3
    gravity: Vec3 | None


@dataclass(frozen=True)
class Turned:
    """M w' + h = 0 in turned velocities; ``form`` derives (M, h) when they are first asked for."""

    form: Callable[[], tuple[Rows, tuple[Expr, ...]]]
    blocks: tuple[SlidingTriple, ...]

    @cached_property
    def system(self) -> tuple[Rows, tuple[Expr, ...]]:
        """M and h."""
        return self.form()

    def accelerations(self, solution: Sequence[Expr]) -> list[Expr]:
        """v' from w'."""
        return turn_back(self.blocks, solution)


def turn_links(kinematics: Kinematics) -> tuple[Kinematics, tuple[SlidingTriple, ...]]:
    """The kinematics with unit vectors for the columns of such joints, and where these are."""
    links: list[Link] = []
    blocks: list[SlidingTriple] = []
    graph = kinematics.graph
    for k, link in enumerate(kinematics.links):
        if _slides_along_parent(link):
            unit = [(vec.zero(graph), axis) for axis in vec.identity(graph)]
            falls = link.parent == GROUND
            gravity = vec.transpose_times(link.turn, kinematics.mechanism.gravity) if falls else None
            blocks.append(SlidingTriple(k, link.first, link.joint_rotation, gravity))
            link = replace(link, columns=(*unit, *link.columns[3:]))
        links.append(link)
    return (replace(kinematics, links=tuple(links)) if blocks else kinematics), tuple(blocks)


def turn_forces(blocks: Sequence[SlidingTriple], forces: Sequence[Expr]) -> list[Expr]:
    """Forces along the velocities v -> along w."""
    result = list(forces)
    for b in blocks:
        x, y, z = forces[b.first : b.first + 3]
        result[b.first : b.first + 3] = vec.transpose_times(b.rotation, (x, y, z))
    return result


def turn_back(blocks: Sequence[SlidingTriple], accelerations: Sequence[Expr]) -> list[Expr]:
    """w' -> v'."""
    result = list(accelerations)
    for b in blocks:
        x, y, z = accelerations[b.first : b.first + 3]
        along = vec.times(b.rotation, (x, y, z))
        result[b.first : b.first + 3] = along if b.gravity is None else vec.add(along, b.gravity)
    return result


def falling(blocks: Sequence[SlidingTriple]) -> frozenset[int]:
    """Links from which outwards gravity is left out."""
    return frozenset(b.link for b in blocks if b.gravity is not None)


def _slides_along_parent(link: Link) -> bool:
    """Whether the first three columns are the axes of the joint's marker on the parent, and not link axes already."""
    axes = link.joint_rotation
    if len(link.columns) < 3 or axes == vec.identity(axes[0][0].graph):
        return False
    return all(
        linear == axes[c] and all(x.is_zero for x in angular) for c, (angular, linear) in enumerate(link.columns[:3])
    )
