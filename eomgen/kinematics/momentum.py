"""Stage kinematics: links, poses, twists -> mass, centre of mass, momentum and inertia of the whole mechanism.

All vectors are in ground axes.  Sums over the bodies of m r x v + I w and its like (Goldstein, *Classical Mechanics*,
sec. 1.2; Orin, Goswami, Lee, *Autonomous Robots* 35, 2013, for the centroidal quantities).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

from ..frames import GROUND
from ..graph import vectors as vec
from ..graph.core import Expr
from ..graph.spatial import Twist
from ..graph.tensors import add_matrices, rotate_symmetric, shift_tensor
from ..graph.vectors import Mat3, Vec3
from .tree import Link, Poses


class Momentum:
    """The sums over all bodies of a tree, each made once when asked for."""

    def __init__(self, poses: Poses, twists: Sequence[Twist]) -> None:
        self.graph, self.poses, self.links, self.twists = poses.graph, poses, poses.links, twists

    @cached_property
    def mass(self) -> Expr:
        """Total mass (kg)."""
        total = self.graph.zero
        for link in self.links:
            total = total + link.mass
        return total

    @cached_property
    def _share(self) -> Expr:
        """One over the total mass, which depends on parameters only."""
        return 1.0 / self.mass

    def _centre(self, k: int) -> Vec3:
        """Centre of mass of a link."""
        pose = self.poses.link(k)
        return vec.add(pose.position, vec.times(pose.rotation, self.links[k].com))

    @cached_property
    def centre(self) -> Vec3:
        """Centre of mass (m)."""
        total = vec.zero(self.graph)
        for k, link in enumerate(self.links):
            total = vec.add(total, vec.scale(link.mass, self._centre(k)))
        return vec.scale(self._share, total)

    def _momentum_of(self, k: int) -> Vec3:
        """Linear momentum of a link."""
        link, (angular, linear) = self.links[k], self.twists[k]
        velocity = vec.add(linear, vec.cross(angular, link.com))
        return vec.times(self.poses.link(k).rotation, vec.scale(link.mass, velocity))

    @cached_property
    def linear(self) -> Vec3:
        """Linear momentum (kg m/s)."""
        total = vec.zero(self.graph)
        for k in range(len(self.links)):
            total = vec.add(total, self._momentum_of(k))
        return total

    @cached_property
    def velocity(self) -> Vec3:
        """Velocity of the centre of mass (m/s)."""
        return vec.scale(self._share, self.linear)

    @cached_property
    def angular(self) -> Vec3:
        """Angular momentum about the centre of mass (kg m^2/s)."""
        total = vec.zero(self.graph)
        for k, link in enumerate(self.links):
            spin = vec.times(self.poses.link(k).rotation, vec.times(link.inertia, self.twists[k][0]))
            arm = vec.sub(self._centre(k), self.centre)
            total = vec.add(total, vec.add(spin, vec.cross(arm, self._momentum_of(k))))
        return total

    def angular_about(self, point: Vec3) -> Vec3:
        """Angular momentum about a point of ground (kg m^2/s)."""
        return vec.add(self.angular, vec.cross(vec.sub(self.centre, point), self.linear))

    @cached_property
    def inertia(self) -> Mat3:
        """Inertia about the centre of mass (kg m^2)."""
        o = vec.zero(self.graph)
        total: Mat3 = (o, o, o)
        for k, link in enumerate(self.links):
            own = rotate_symmetric(self.poses.link(k).rotation, link.inertia)
            arm = vec.sub(self._centre(k), self.centre)
            total = add_matrices(total, add_matrices(own, shift_tensor(link.mass, arm)))
        return total

    def inertia_about(self, point: Vec3) -> Mat3:
        """Inertia about a point (kg m^2)."""
        return add_matrices(self.inertia, shift_tensor(self.mass, vec.sub(self.centre, point)))

    def jacobian(self, n: int) -> tuple[tuple[Expr, ...], ...]:
        """Velocity of the centre of mass for each generalized velocity, (3, n).

        What moves with a joint is the part of the tree beyond it: its mass and first moment are summed inwards.
        """
        masses = [link.mass for link in self.links]
        moments = [vec.scale(link.mass, link.com) for link in self.links]  # about the link's origin, link axes
        columns = [vec.zero(self.graph)] * n
        for k in reversed(range(len(self.links))):
            link: Link = self.links[k]
            rotation = self.poses.link(k).rotation
            for c, (angular, linear) in enumerate(link.columns):
                push = vec.add(vec.scale(masses[k], linear), vec.cross(angular, moments[k]))
                columns[link.first + c] = vec.scale(self._share, vec.times(rotation, push))
            if link.parent != GROUND:
                masses[link.parent] = masses[link.parent] + masses[k]
                carried = vec.add(link.up(moments[k]), vec.scale(masses[k], link.position))
                moments[link.parent] = vec.add(moments[link.parent], carried)
        return tuple(tuple(column[i] for column in columns) for i in range(3))
