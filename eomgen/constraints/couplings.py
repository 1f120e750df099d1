"""Constraint elements: relations between coordinates that the user writes out."""

from __future__ import annotations

from typing import ClassVar

from ..graph.core import Expr
from ..records import dataclass
from .base import Condition, Constraint, View


@dataclass(frozen=True)
class Linear(Constraint):
    """A linear relation: sum of factor times coordinate = offset (Shabana, Computational Dynamics, sec. 3.2)."""

    type_name: ClassVar[str] = "linear"
    written: ClassVar[bool] = True
    terms: tuple[tuple[Expr, Expr], ...]  #: (coordinate, factor)
    offset: Expr
    kind: str

    def conditions(self, view: View) -> list[Condition]:
        total = -self.offset
        for coordinate, factor in self.terms:
            total = total + factor * coordinate
        return [Condition("relation", total, self.kind)]


@dataclass(frozen=True)
class Equation(Constraint):
    """Any expression held at zero; nonholonomic (``level`` 'velocity') if it is linear in velocities."""

    type_name: ClassVar[str] = "equation"
    written: ClassVar[bool] = True
    expression: Expr
    kind: str
    level: str

    def conditions(self, view: View) -> list[Condition]:
        return [Condition("equation", self.expression, self.kind, self.level)]
