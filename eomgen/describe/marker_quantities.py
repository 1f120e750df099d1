"""``vx(hub, in=road)`` -> quantity, markers, axes; ``force(k1)``."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import NamedTuple

from ..errors import ExpressionError
from .names import (
    MULTIPLIER,
    OF_ELEMENTS,
    PAIRS,
    QUANTITIES,
    REACTION,
    REACTION_PARTS,
    RESOLVED,
    WRENCH,
    WRENCH_PARTS,
)

_KEYWORD = re.compile(r"(from|in)\s*=\s*", re.ASCII)
_OF_ELEMENT = re.compile(rf"({'|'.join(OF_ELEMENTS)})\((\w+)\)\Z", re.ASCII)
_MULTIPLIER = re.compile(rf"{MULTIPLIER}\((\w+(?:\.\w+)?)\)\Z", re.ASCII)
_REACTION = re.compile(rf"{REACTION}\((\w+)(?:, in=(.+))?\)\.({'|'.join(REACTION_PARTS)})\Z", re.ASCII)
_WRENCH = re.compile(rf"{WRENCH}\((\w+), on=(.+?)(?:, in=(.+))?\)\.({'|'.join(WRENCH_PARTS)})\Z", re.ASCII)
_CALL = re.compile(rf"({'|'.join(QUANTITIES)})\((.+)\)\Z", re.DOTALL)


class MarkerQuantity(NamedTuple):
    """A quantity of a marker as a text has it.

    ``marker`` is what moves, ``origin`` the marker it is seen from (none: the ground), ``axes`` the marker whose axes
    count (none: those of ground).  ``distance(a, b)`` has the marker b and the origin a.
    """

    name: str
    marker: str
    origin: str = ""
    axes: str = ""

    @classmethod
    def of(cls, name: str, arguments: str) -> MarkerQuantity:
        """Read what stands between the brackets.

        Raises
        ------
        ExpressionError
            The quantity takes other arguments.
        """
        markers, given = list[str](), dict[str, str]()
        for part in _split(arguments):
            key = _KEYWORD.match(part)
            if key is None:
                markers.append(part)
            elif key[1] in given:
                raise ExpressionError(f"{name}() is given {key[1]}= twice", 0, "leave one out")
            else:
                given[key[1]] = part[key.end() :]
        pair = name in PAIRS and (name not in ONE_OR_TWO or len(markers) == 2)
        if given and (pair or name not in RESOLVED):
            remedy = f"write {name}(a, b)" if name in PAIRS else f"it is known of {', '.join(RESOLVED)}"
            raise ExpressionError(f"{name}() takes no {next(iter(given))}=", 0, remedy)
        if len(markers) != (2 if pair else 1) or not all(markers):
            if name in ONE_OR_TWO:
                raise ExpressionError(f"{name}() takes one or two markers", 0, f"write {name}(b) or {name}(a, b)")
            if pair:
                raise ExpressionError(f"{name}() takes two markers", 0, f"write {name}(a, b)")
            raise ExpressionError(f"{name}() takes one marker", 0, f"write {name}(body) or {name}(body.marker)")
        return cls(name, markers[-1], markers[0] if pair else given.get("from", ""), given.get("in", ""))

    @property
    def arguments(self) -> str:
        """What stands between the brackets, always written in one way."""
        if self.name in PAIRS:
            return f"{self.origin}, {self.marker}" if self.origin else self.marker
        origin = f", from={self.origin}" if self.origin else ""
        return f"{self.marker}{origin}{f', in={self.axes}' if self.axes else ''}"

    def __str__(self) -> str:
        return f"{self.name}({self.arguments})"

    @property
    def markers(self) -> tuple[str, ...]:
        """All markers that it speaks of."""
        return tuple(label for label in self[1:] if label)

    def renamed(self, rename: Callable[[str], str]) -> MarkerQuantity:
        """The same of other markers."""
        return MarkerQuantity(self.name, *(rename(label) if label else "" for label in self[1:]))


class ElementQuantity(NamedTuple):
    """What a force element does, as ``force(k1)``; see :class:`~eomgen.forces.force.Measured`.

    Also a part of what a joint carries, ``reaction(A, in=rod).x``, along the axes of a marker (none: ground), the
    multiplier of an equation, ``multiplier(mesh.ratio)``, and a part of what an element exerts on the body of a marker,
    ``force(track, on=wheel, in=car).x``.
    """

    name: str
    element: str
    part: str = ""
    axes: str = ""
    on: str = ""

    def __str__(self) -> str:
        axes, on = (f", {word}={label}" if label else "" for word, label in (("in", self.axes), ("on", self.on)))
        return f"{self.name}({self.element}{on}{axes}){f'.{self.part}' if self.part else ''}"

    @property
    def carried(self) -> bool:
        """Whether it is the reaction of a joint or the multiplier of an equation."""
        return self.name in (REACTION, MULTIPLIER)

    @property
    def owner(self) -> str:
        """The element, the joint, or the element or joint of an equation."""
        return self.element.partition(".")[0] if self.name == MULTIPLIER else self.element

    def renamed(self, rename: Callable[[str], str], marker: Callable[[str], str] | None = None) -> ElementQuantity:
        """The same of another element, and of axes that ``marker`` renames."""
        axes, on = ((marker or rename)(label) if label else "" for label in (self.axes, self.on))
        return ElementQuantity(self.name, rename(self.element), self.part, axes, on)


#: Quantities of two markers, of which the first may be left out: it is the ground then.
ONE_OR_TWO = ("angle", "angle_rate")


def marker_quantity(symbol: str) -> MarkerQuantity | None:
    """The quantity that a symbol's name, such as ``vx(rod.tip)``, speaks of; None for other names."""
    found = _CALL.match(symbol)
    return MarkerQuantity.of(found[1], found[2]) if found else None


def element_quantity(symbol: str) -> ElementQuantity | None:
    """What a symbol's name such as ``force(k1)`` speaks of; None for other names."""
    if found := _OF_ELEMENT.match(symbol):
        return ElementQuantity(found[1], found[2])
    if found := _MULTIPLIER.match(symbol):
        return ElementQuantity(MULTIPLIER, found[1])
    if found := _WRENCH.match(symbol):
        return ElementQuantity(WRENCH, found[1], found[4], found[3] or "", found[2])
    found = _REACTION.match(symbol)
    return ElementQuantity(REACTION, found[1], found[3], found[2] or "") if found else None


def _split(arguments: str) -> list[str]:
    """Arguments between commas; labels of unnamed markers have commas and brackets of their own."""
    parts, depth = [""], 0
    for character in arguments:
        depth += (character in "([{") - (character in ")]}")
        if character == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += character
    return [part.strip() for part in parts]
