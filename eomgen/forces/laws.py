"""Force elements, any law: an expression of a path's value and rate -> the force along it."""

from __future__ import annotations

from typing import ClassVar

from ..graph.core import Expr
from ..graph.differentiate import gradient
from ..graph.substitute import substitute
from ..records import dataclass
from .base import Force, Load, View
from .paths import Path


@dataclass(frozen=True)
class Element(Force):
    """A generalized force law(value, rate) - dV/dvalue along the path (N or N m).

    Positive pushes the ends apart or drives the coordinate.  ``value`` and ``rate`` are the symbols that stand in the
    law for the path's.  Only the potential V(value) counts as energy; the law is taken as it is, conservative or not.
    """

    type_name: ClassVar[str] = "element"
    uses_value: ClassVar[bool] = True
    path: Path
    value: Expr
    rate: Expr
    law: Expr
    energy: Expr

    def _here(self, view: View, expression: Expr) -> Expr:
        value, rate = self.path.measure(view)
        return substitute([expression], {self.value: value, self.rate: rate})[0]

    def loads(self, view: View) -> list[Load]:
        pull = gradient(self.energy, [self.value])[0]
        return self.path.loads(view, self._here(view, self.law - pull))

    def potential(self, view: View) -> Expr | None:
        if self.energy.is_zero or not self.path.is_exact(view):
            return None
        return self._here(view, self.energy)

    def remainder(self, view: View) -> list[Load]:
        return [] if self.law.is_zero else self.path.loads(view, self._here(view, self.law))


@dataclass(frozen=True)
class TorsionalElement(Element):
    """The same of an angle (N m)."""

    type_name: ClassVar[str] = "torsional_element"
