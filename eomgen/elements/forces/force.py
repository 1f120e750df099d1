"""Force elements: each a frozen class of expressions and markers, asked for loads or a potential."""

from __future__ import annotations

import re
from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from typing import Any, ClassVar, NamedTuple, Protocol

from ...expr import vectors as vec
from ...expr.core import Expr, Graph
from ...expr.vectors import Vec3
from ..element_type import Element
from ..frames import Marker, MotionView
from ..glyphs import Glyph

# -- one-sided laws ----------------------------------------------------------------------------------------------------


def where(condition: Expr, yes: Expr | float, no: Expr | float) -> Expr:
    """``yes`` where the condition holds, else ``no``."""
    return condition.graph.apply("select", condition, yes, no)


def beyond_zero(x: Expr, law: Callable[[Expr], Expr]) -> Expr:
    """law(x) for x > 0, else 0.

    Where x <= 0 the law sees 1, so that neither it nor its derivative has to exist there (a root of a negative number).
    """
    inside = x.graph.apply("lt", 0.0, x)
    return where(inside, law(where(inside, x, 1.0)), 0.0)


def map_law(law: Any, change: Callable[[Expr], Expr]) -> Any:
    """A law with other expressions: its own, and those of the laws in it."""
    parts = {field.name: getattr(law, field.name) for field in fields(law)}
    laws = {name: x.mapped(change) for name, x in parts.items() if hasattr(x, "mapped")}
    return replace(law, **laws, **{name: change(x) for name, x in parts.items() if isinstance(x, Expr)})


# -- the class ---------------------------------------------------------------------------------------------------------

# A force element sees the mechanism's motion through a :class:`View`, which the kinematics stage provides.


class View(MotionView, Protocol):
    """Motion of markers, and of joint coordinates."""

    def coordinate(self, name: str) -> tuple[Expr, Expr]:
        """Value and rate of a coordinate of any joint, tree or cut."""
        ...


class MovingView(View, Protocol):
    """Motion of markers up to accelerations."""

    def accelerations(self, markers: Sequence[Marker]) -> list[Expr]:
        """Acceleration and angular acceleration of each marker, ground axes."""
        ...


class MarkerLoad(NamedTuple):
    """A wrench on the marker's body: force at the marker's origin and torque, in ground axes (N, N m)."""

    marker: Marker
    force: Vec3
    torque: Vec3


class CoordinateLoad(NamedTuple):
    """A generalized force along a joint coordinate (N m or N)."""

    coordinate: str
    value: Expr


Load = MarkerLoad | CoordinateLoad


def with_reaction(view: View, marker: Marker, base: Marker, force: Vec3, torque: Vec3) -> list[Load]:
    """A wrench at a marker, and the opposite wrench on the body of another one."""
    reach = vec.sub(view.position(marker), view.position(base))
    back = vec.neg(vec.add(torque, vec.cross(reach, force)))
    return [MarkerLoad(marker, force, torque), MarkerLoad(base, vec.neg(force), back)]


def power_of(view: View, loads: Sequence[Load]) -> Expr:
    """Power of loads (W)."""
    total = view.graph.zero
    for load in loads:
        if isinstance(load, MarkerLoad):
            total = total + vec.dot(load.force, view.velocity(load.marker))
            total = total + vec.dot(load.torque, view.angular_velocity(load.marker))
        else:
            total = total + load.value * view.coordinate(load.coordinate)[1]
    return total


class Measured(NamedTuple):
    """An element along its path: length or angle, its rate, and the generalized force that increases it.

    Of a contact: penetration, its rate, and the normal force.
    """

    value: Expr
    rate: Expr
    force: Expr


class Force(Element):
    """A force element.  ``name`` is the user's; a subclass adds its markers and laws.

    ``sentence`` and ``formula`` (LaTeX) say its law, for readers.
    """

    sentence: ClassVar[str] = "A force element of the model."
    formula: ClassVar[str] = ""
    uses_value: ClassVar[bool] = False  #: whether its law looks at the value of its path, not at the rate alone
    by_reaction: ClassVar[bool] = False  #: whether its law speaks of the reactions of joints
    by_power: ClassVar[bool] = False  #: whether its forces enter by virtual power, though it has a potential
    acts_along = False  #: whether it acts along a path, so that :meth:`measured` is something
    is_rigid = False  #: whether it is a contact without a law of force, which only a time-stepping method solves
    not_finite_where: ClassVar[str] = ""  #: where its loads are not finite, and what to do, for messages
    name: str

    @abstractmethod
    def loads(self, view: View) -> list[Load]:
        """Everything this element exerts, its conservative part included."""

    def potential(self, view: View) -> Expr | None:
        """Potential energy (J) of the element's conservative part, None if it has none."""
        return None

    def glyphs(self) -> list[Glyph]:
        """What is to be seen of it in a picture; nothing unless a type says so."""
        return []

    def push(self, value: Expr, rate: Expr) -> Expr | None:
        """The force along its path at a value and a rate of it, for pictures; None of a type that has no such law."""
        return None

    @property
    def laws(self) -> tuple[Any, ...]:
        """Laws that it is made of, each with a ``formula`` and numbers of its own, instead of the type's formula."""
        return ()

    @property
    def formulas(self) -> list[str]:
        """Its law in LaTeX: that of its laws, or of its type."""
        return [law.formula for law in self.laws] or [self.formula] * bool(self.formula)

    def measured(self, view: View) -> Measured | None:
        """What it does along its path, for outputs and laws; None of an element that has no path."""
        return None

    def power(self, view: View) -> Expr:
        """Power of its loads (W): positive where it drives the mechanism."""
        return power_of(view, self.loads(view))

    def state_rates(self, view: View) -> tuple[Expr, ...]:
        """Rates of its states, in the order in which its type names them."""
        return ()

    def met_shapes(self) -> list[tuple[str, int]]:
        """What may meet, of a force that acts between many shapes, and the body of each."""
        return []

    def meeting(self, view: MovingView) -> list[Expr]:
        """Of a force that acts between shapes: when they may meet, and which two are deepest in each other."""
        return []

    def near(self, view: View) -> list[Expr]:
        """Of a force that acts between shapes: which are near each other, and where."""
        return []

    def remainder(self, view: View) -> list[Load]:
        """What the loads are beyond the slope of the potential, where there is one: friction, damping."""
        return []


# -- symbols of reactions ----------------------------------------------------------------------------------------------


_MULTIPLIER = re.compile(r"multiplier\((.+)\)\Z")
_SYMBOL = re.compile(r"reaction\((.+)\)\[([0-5])\]\Z")


def reaction_symbol(graph: Graph, joint: str, k: int) -> Expr:
    """Force (k = 0, 1, 2) or moment (3, 4, 5) that P exerts on S at S, along the axes of S (N, N m)."""
    return graph.symbol(f"reaction({joint})[{k}]")


def reaction_of(symbol: str) -> tuple[str, int] | None:
    """Joint and component of such a symbol's name; None for other names."""
    result = _SYMBOL.match(symbol)
    return (result[1], int(result[2])) if result else None


def multiplier_of(symbol: str) -> str | None:
    """Equation, or element of one equation, of the symbol of a multiplier, ``multiplier(mesh.ratio)``; else None."""
    result = _MULTIPLIER.match(symbol)
    return result[1] if result else None


def is_reaction(symbol: str) -> bool:
    """Whether a symbol stands for a reaction or a multiplier."""
    return symbol.endswith((")", "]")) and (reaction_of(symbol) is not None or multiplier_of(symbol) is not None)
