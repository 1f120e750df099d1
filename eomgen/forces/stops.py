"""Force elements, limit stops of a joint."""

from __future__ import annotations

from typing import ClassVar

from ..graph.core import Expr
from ..records import dataclass
from .base import Force, Load, View
from .normal_laws import HuntCrossley
from .paths import Path


@dataclass(frozen=True)
class JointStop(Force):
    """Stops of a joint's coordinate q: beyond ``lower`` or ``upper`` a Hunt-Crossley force pushes it back (N or N m).

    Penetrations are q - upper and lower - q.  A stop never pulls.
    """

    type_name: ClassVar[str] = "stop"
    uses_value: ClassVar[bool] = True
    path: Path
    lower: Expr | None
    upper: Expr | None
    law: HuntCrossley

    def _depths(self, view: View) -> list[tuple[Expr, Expr, float]]:
        """Penetration, its rate and the sense of the force, of each stop."""
        value, rate = self.path.measure(view)
        found = []
        if self.lower is not None:
            found.append((self.lower - value, -rate, 1.0))
        if self.upper is not None:
            found.append((value - self.upper, rate, -1.0))
        return found

    def loads(self, view: View) -> list[Load]:
        total = view.graph.zero
        for depth, rate, sense in self._depths(view):
            total = total + sense * self.law.force(depth, rate)
        return self.path.loads(view, total)

    def potential(self, view: View) -> Expr | None:
        total = view.graph.zero
        for depth, _, _ in self._depths(view):
            total = total + self.law.energy(depth)
        return total

    def remainder(self, view: View) -> list[Load]:
        total = view.graph.zero
        for depth, rate, sense in self._depths(view):
            total = total + sense * (self.law.force(depth, rate) - self.law.elastic(depth))
        return self.path.loads(view, total)
