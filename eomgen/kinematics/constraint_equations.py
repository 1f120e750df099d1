"""Stage kinematics: constraint elements -> equations in the tree's own symbols."""

from __future__ import annotations

from typing import NamedTuple

from ..constraints import Equation
from ..constraints.constraint import VELOCITY, Condition
from ..describe.mechanism import Mechanism
from ..graph.core import Expr
from ..graph.substitute import substitute, symbols_of
from .loops import Row
from .motion import MarkerMotion


class Coupled(NamedTuple):
    """What all constraint elements say, in terms of the tree.

    Equations; expressions that must be positive, each with the element's name; and (coordinate, value) pairs from
    which assembly starts where nothing is said about the coordinate.
    """

    rows: list[Row]
    aligned: list[tuple[str, Expr]]
    hints: list[tuple[str, Expr]]


def couple(mechanism: Mechanism, motion: MarkerMotion) -> Coupled:
    """Ask every constraint element for its equations; coordinates of cut joints become functions of the tree's."""
    rows: list[Row] = []
    aligned: list[tuple[str, Expr]] = []
    hints: list[tuple[str, Expr]] = []
    for constraint in mechanism.constraints:
        conditions = constraint.conditions(motion)
        positive = constraint.aligned(motion)
        near = constraint.hints(motion)
        flat = [*(c.expression for c in conditions), *positive, *(value for _, value in near)]
        mapping = motion.derived_symbols(mechanism, symbols_of(flat))
        values = iter(substitute(flat, mapping) if mapping else flat)
        for c in conditions:
            value = next(values)
            level = _level(c, value, motion) if isinstance(constraint, Equation) else c.level
            rows.append(Row(f"{constraint.name}.{c.label}", value, c.kind, level, constraint.written))
        aligned += [(constraint.name, next(values)) for _ in positive]
        hints += [(str(symbol.node[1]), next(values)) for symbol, _ in near]
    return Coupled(rows, aligned, hints)


def _level(condition: Condition, value: Expr, motion: MarkerMotion) -> str:
    """The level of an equation: forces of elements tell only in terms of the tree whether they move with velocities."""
    used = symbols_of([value])
    return VELOCITY if any(v.node[1] in used for v in motion.state.v) else condition.level
