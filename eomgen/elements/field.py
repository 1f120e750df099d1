"""Elements, one field: what a key of an entry holds and what its expressions may depend on."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from .dimensions import LENGTH, Dimension

# What the expressions of a field may depend on; each level includes those before it.
NUMBER = -1  #: numbers, pi
CONSTANT = 0  #: parameters
MOTION = 1  #: t, inputs, coordinates and their velocities
LAW = 2  #: positions and velocities of markers, and outputs that need no accelerations
OUTPUT = 3  #: accelerations and energies

EXPONENT = 1.5  #: of the penetration in the law of a contact (Hertz), unless given
LINEAR = "linear"  #: the choice of normal_law whose exponent is 1


class Field(NamedTuple):
    """What one key holds.

    ``kind`` is one of :data:`~eomgen.describe.fields.KINDS`; ``level`` says what its expressions may depend on;
    ``choices`` lists the words of a choice; ``own`` is how many of the first coordinates of its own joint an expression
    depends on; ``not_zero`` says what to take instead where 0 has no meaning.

    ``dimension`` is that of its expressions, None where it depends on what the user means; of a matrix of six rows it
    is that of the entries for two angles.  ``along`` is the key of the coordinate that ``reach`` in it means.
    ``exponent`` is a key: the dimension is divided by reach to the power of its number.  ``local`` are names that only
    its expressions know, and what they are.
    """

    kind: str
    doc: str
    required: bool = False
    default: Any = None
    level: int = CONSTANT
    choices: tuple[str, ...] = ()
    own: int = 0
    not_zero: str = ""
    dimension: Dimension | None = None
    along: str = "joint"
    exponent: str = ""
    local: Mapping[str, Field] = {}

    def measured_in(self, values: Mapping[str, Any], place: tuple[Any, ...], length: bool) -> Dimension | None:
        """The dimension of a scalar in an entry, None if it is not known.

        Parameters
        ----------
        values : mapping
            The entry.
        place : tuple
            Indices of the scalar in the field.
        length : bool
            Whether the coordinate that the entry acts on is a length.
        """
        if self.dimension is None:
            return None
        found = self.dimension.along(length)
        if self.kind == "matrix6":  # three forces, then three torques; three lengths, then three angles
            return found.times(LENGTH, -sum(index < 3 for index in (place[0], place[-1])))
        if self.exponent and length:
            power = 1.0 if values.get("normal_law") == LINEAR else values.get(self.exponent, EXPONENT)
            return None if isinstance(power, str) or not hasattr(power, "__float__") else found.times(LENGTH, -power)
        return found


Fields = dict[str, Field]
