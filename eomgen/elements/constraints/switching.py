"""Constraint elements that close and open: the keys by which a constraint holds for a time only."""

from __future__ import annotations

from ..dimensions import SPIN
from ..element_type import ElementType, Types
from ..kinds import LAW, Fields, Flag, Scalar, SomeNames

#: Of any constraint that may close and open in a run.
SWITCHING: Fields = {
    "closes": Scalar(
        "where it falls to 0 the constraint closes: a plastic impact, after which it holds",
        level=LAW,
    ),
    "opens": Scalar("where it falls to 0 while the constraint holds, it lets go", level=LAW),
    "closed": Flag("whether it holds at the start of a run; false if closes is given, else true"),
    "releases": SomeNames("one or several other constraints that let go as it closes, before the impact"),
    "stabilisation": Scalar(
        "rate (1/s), greater than 0, at which an error of the equation dies away while it holds",
        default=10,
        dimension=SPIN,
    ),
}

#: How a condition of a joint without coordinates is written that holds for a time.
IN_PLACE_OF_JOINTS = (
    "joints without coordinates hold for good, save for welds; for a time use a constraint of type hold: axes: xyz, "
    "turning: xyz holds as a weld, axes: xyz alone as a ball joint, axes: xy, turning: z in the plane"
)


def switchable(types: Types) -> Types:
    """The types with these keys too."""
    return {name: _with_keys(found) for name, found in types.items()}


def _with_keys(found: ElementType) -> ElementType:
    return found._replace(keys=found.keys | SWITCHING)
