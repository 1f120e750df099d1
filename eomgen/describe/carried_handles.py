"""Stage describe, handles of what joints and constraints carry: their parts as SymPy symbols for laws and outputs."""

from __future__ import annotations

from typing import Any, NamedTuple

from .described import Described
from .description import DescribedEntry
from .marker_quantities import ElementQuantity
from .names import MULTIPLIER, REACTION
from .sympy_face import symbol


class JointReaction(NamedTuple):
    """What the predecessor of a joint exerts on the successor, at the successor's marker, as SymPy symbols.

    ``axes`` is the label of the marker along whose axes the components are, empty for ground.
    """

    joint: str
    axes: str = ""

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
        return symbol(str(ElementQuantity(REACTION, self.joint, "size")))

    @property
    def normal(self) -> Any:
        """Size of the force across the axis of the joint (N)."""
        return symbol(str(ElementQuantity(REACTION, self.joint, "normal")))

    def _part(self, part: str) -> Any:
        return symbol(str(ElementQuantity(REACTION, self.joint, part, self.axes)))


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
