"""Elements, one field: what a key of an entry holds and what its expressions may depend on."""

from __future__ import annotations

from typing import Any, NamedTuple

# What the expressions of a field may depend on; each level includes those before it.
NUMBER = -1  #: numbers, pi
CONSTANT = 0  #: parameters
MOTION = 1  #: t, inputs, coordinates and their velocities
OUTPUT = 2  #: accelerations, and the motion of markers


class Field(NamedTuple):
    """What one key holds.

    ``kind`` is one of :data:`~eomgen.describe.fields.KINDS`; ``level`` says what its expressions may depend on;
    ``choices`` lists the words of a choice; ``own`` is how many of the first coordinates of its own joint an expression
    depends on; ``not_zero`` says what to take instead where 0 has no meaning; ``local`` are names that only this
    expression knows, such as ``length``.
    """

    kind: str
    doc: str
    required: bool = False
    default: Any = None
    level: int = CONSTANT
    choices: tuple[str, ...] = ()
    own: int = 0
    not_zero: str = ""
    local: tuple[str, ...] = ()


Fields = dict[str, Field]
