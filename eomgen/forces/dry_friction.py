"""Force elements, what all laws of dry friction share: how surfaces slide -> what opposes it, and rates of states."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import ClassVar, NamedTuple

from ..graph import vectors as vec
from ..graph.core import Expr
from ..graph.vectors import Mat3, Vec3


class DryFriction(ABC):
    """What opposes sliding in a contact, as a part of the normal force; ``formula`` says it in LaTeX."""

    formula: ClassVar[str]

    @abstractmethod
    def in_plane(self, slip: Slip) -> Vec3:
        """Friction at a sliding velocity, with the direction of the velocity."""

    @abstractmethod
    def mapped(self, own: Callable[[Expr], Expr]) -> DryFriction:
        """The law with other expressions, in the graph of a pair; without its states."""

    def on_pad(self, area: Expr) -> DryFriction:
        """The law of a point that stands for an area of a plate."""
        return self

    def holding(self, states: tuple[Expr, ...], lateral: Vec3 | None) -> DryFriction:
        """The law with its states; in contacts of the plane ``lateral`` is the direction across the plane."""
        return self

    def drag(self, push: Expr, slip: Slip) -> Vec3:
        """The force on the second surface (N), across the normal, beside a normal force."""
        return vec.scale(-push, self.in_plane(slip))

    def rates_apart(self) -> tuple[Expr, ...]:
        """Rates of its states where surfaces are apart."""
        return ()

    def rates_in_plane(self, slip: Slip) -> tuple[Expr, ...]:
        """Rates of its states at a sliding velocity."""
        return ()


class LineFriction(DryFriction):
    """Friction that acts in joints too, where it is a force; ``joint_formula`` says it there, in LaTeX."""

    joint_formula: ClassVar[str]

    @abstractmethod
    def along(self, rate: Expr) -> Expr:
        """Friction at a velocity along a line, with the sign of the velocity."""

    def rates_along(self, rate: Expr) -> tuple[Expr, ...]:
        """Rates of its states at a velocity along a line."""
        return ()


class Slip(NamedTuple):
    """How surfaces slide: velocity and normal (ground axes), penetration, normal force, and axes of the first one."""

    velocity: Vec3
    normal: Vec3
    depth: Expr
    push: Expr
    axes: Mat3

    def axes_of_states(self, lateral: Vec3 | None) -> Mat3:
        """In whose axes states are written: of the first surface, or along the surface, across the plane, normal."""
        if lateral is None:
            return self.axes
        return vec.transpose((vec.cross(self.normal, lateral), lateral, self.normal))

    def across(self, states: Sequence[Expr], lateral: Vec3 | None) -> Vec3:
        """A vector of states in ground axes, less its part along the normal."""
        zero = self.depth.graph.zero
        x, y, z = (*states, zero, zero)[:3]
        found = vec.times(self.axes_of_states(lateral), (x, y, z))
        return vec.sub(found, vec.scale(vec.dot(found, self.normal), self.normal))


def stribeck_level(squared: Expr, dynamic: Expr, static: Expr | None, stribeck: Expr | None) -> Expr:
    """dynamic + (static - dynamic) exp(-(v / stribeck)^2) of the squared velocity."""
    if static is None or stribeck is None:
        return dynamic
    fall = squared.graph.apply("exp", -squared / (stribeck * stribeck))
    return dynamic + (static - dynamic) * fall
