"""Stage describe, handles of elements: what they do, exert and carry, as SymPy symbols for laws and outputs."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

from ..base.texts import shown
from ..errors import ill_typed
from .described import Described
from .description import DescribedEntry
from .marker_quantities import ElementQuantity
from .names import MULTIPLIER, WRENCH
from .sympy_face import symbol


class Wrench(NamedTuple):
    """Force and moment of an element, as SymPy symbols.

    Of a joint they are what its predecessor exerts on its successor, at the successor's marker; of a force element what
    it exerts on the body of the marker ``on``, about that marker's origin. ``axes`` is the label of the marker along
    whose axes the components are, empty for ground.
    """

    function: str
    element: str
    axes: str = ""
    on: str = ""

    @property
    def force(self) -> tuple[Any, Any, Any]:
        """Components of the force (N)."""
        return (self._part("x"), self._part("y"), self._part("z"))

    @property
    def moment(self) -> tuple[Any, Any, Any]:
        """Components of the moment (N m)."""
        return (self._part("mx"), self._part("my"), self._part("mz"))

    @property
    def size(self) -> Any:
        """Size of the force (N)."""
        return self._replace(axes="")._part("size")

    def _part(self, part: str) -> Any:
        return symbol(str(ElementQuantity(self.function, self.element, part, self.axes, self.on)))


class JointReaction(Wrench):
    """What the predecessor of a joint exerts on the successor, at the successor's marker, as SymPy symbols."""

    __slots__ = ()

    @property
    def normal(self) -> Any:
        """Size of the force across the axis of the joint (N)."""
        return self._replace(axes="")._part("normal")


class Labelled(Protocol):
    """A marker as texts call it."""

    label: str

    def note(self) -> None: ...


def noted(marker: Labelled) -> str:
    """The label of a marker whose motion an expression uses; UsageError if it is none."""
    if not hasattr(marker, "note"):
        raise ill_typed(f"give a body or a marker, such as m.ground or rod.at(1, 0, 0), not {shown(marker)}")
    marker.note()
    return marker.label


class ForceHandle:
    """A force element of the model; what it does can stand in outputs, events and other laws.

    Attributes
    ----------
    model : Model
        The model it belongs to.
    name : str
        Name of the element.
    """

    def __init__(self, model: Described, entry: DescribedEntry) -> None:
        self.model, self.name, self._entry = model, entry.name, entry

    def __repr__(self) -> str:
        return f"<ForceHandle {self.name}: {self._entry.values.get('type')}>"

    @property
    def force(self) -> Any:
        """Force along its path (N or N m), positive where it increases it; of a contact the normal force."""
        return symbol(f"force({self.name})")

    @property
    def length(self) -> Any:
        """Length or angle of its path (m or rad), or penetration of a contact (m)."""
        return symbol(f"length({self.name})")

    @property
    def rate(self) -> Any:
        """Rate of :attr:`length` (m/s or rad/s)."""
        return symbol(f"rate({self.name})")

    @property
    def power(self) -> Any:
        """Power of everything that it exerts (W): positive where it drives the mechanism."""
        return symbol(f"power({self.name})")

    def on(self, marker: Labelled, axes: Labelled | None = None) -> Wrench:
        """Force and moment that it exerts on the body of a marker, in ground axes or along those of another marker.

        Parameters
        ----------
        marker : BodyHandle or MarkerHandle
            On whose body it acts; moments are about its origin.
        axes : BodyHandle or MarkerHandle, optional
            Along whose axes the components are; ground unless given.
        """
        return Wrench(WRENCH, self.name, "" if axes is None else noted(axes), noted(marker))


class ConstraintHandle:
    """A constraint element of the model; its multipliers can stand in outputs, events and laws.

    Attributes
    ----------
    model : Model
        The model it belongs to.
    name : str
        Name of the element.
    """

    def __init__(self, model: Described, entry: DescribedEntry) -> None:
        self.model, self.name, self._entry = model, entry.name, entry

    def __repr__(self) -> str:
        return f"<ConstraintHandle {self.name}: {self._entry.values.get('type')}>"

    def multiplier(self, row: str = "") -> Any:
        """The Lagrange multiplier of an equation, as a SymPy symbol.

        Parameters
        ----------
        row : str, optional
            Which equation, such as ``height`` of a rolling wheel; not needed where there is one.
        """
        return symbol(str(ElementQuantity(MULTIPLIER, f"{self.name}.{row}" if row else self.name)))
