"""Force elements, limit stops of a joint."""

from __future__ import annotations

from ...base.records import dataclass
from ...base.value_rules import POSITIVE
from ...expr.core import Expr
from ..dimensions import REACH
from ..element_type import ElementType, Entry, table
from ..kinds import Scalar
from ..looks import STOP, Seen
from .force import Load, View
from .normal_laws import NORMAL, NORMAL_CHOICE, NormalLaw, read_normal_law
from .paths import ON_JOINT, PathForce, read_coordinate


@dataclass(frozen=True)
class JointStop(PathForce):
    """Stops of a joint's coordinate q: beyond ``lower`` or ``upper`` a one-sided force pushes it back (N or N m).

    Penetrations are q - upper and lower - q.  A stop never pulls.
    """

    sentence = "Stops of a joint: beyond its limits a force from the penetration $d$ pushes the coordinate back."
    uses_value = True
    lower: Expr | None
    upper: Expr | None
    law: NormalLaw

    @property
    def laws(self) -> tuple[NormalLaw, ...]:
        return (self.law,)

    def _depths(self, value: Expr, rate: Expr) -> list[tuple[Expr, Expr, float]]:
        """Penetration, its rate and the sense of the force, of each stop."""
        found = []
        if self.lower is not None:
            found.append((self.lower - value, -rate, 1.0))
        if self.upper is not None:
            found.append((value - self.upper, rate, -1.0))
        return found

    def along(self, value: Expr, rate: Expr) -> Expr:
        total = value.graph.zero
        for depth, change, sense in self._depths(value, rate):
            total = total + sense * self.law.force(depth, change)
        return total

    def drawn(self) -> list[Seen]:
        ends = tuple(x for x in (self.lower, self.upper) if x is not None)
        return [self.path.drawn((), STOP)._replace(walls=ends)]

    def potential(self, view: View) -> Expr | None:
        total = view.graph.zero
        for depth, _, _ in self._depths(*self.path.measure(view)):
            total = total + self.law.energy(depth)
        return total

    def remainder(self, view: View) -> list[Load]:
        total = view.graph.zero
        for depth, rate, sense in self._depths(*self.path.measure(view)):
            total = total + sense * (self.law.force(depth, rate) - self.law.elastic(depth))
        return self.path.loads(view, total)


def _stop(e: Entry) -> JointStop | None:
    path, law = read_coordinate(e), read_normal_law(e)
    lower, upper = e["lower"], e["upper"]
    if lower is None and upper is None:
        e.fault("", "has no limit", "give lower, upper or both", "EG-MISSING")
    if lower is not None and upper is not None:
        e.require("upper", upper - lower, POSITIVE, "this is upper - lower; lower must be less than upper")
    return None if path is None else JointStop(e.name, path, lower, upper, law)


TYPES = table(
    ElementType(
        "stop",
        "elastic stops of a joint's coordinate: below ``lower``, above ``upper`` or both.",
        {
            "joint": ON_JOINT.replace(required=True),
            "stiffness": NORMAL["stiffness"],
            "lower": Scalar("lower limit (rad or m)", dimension=REACH),
            "upper": Scalar("upper limit (rad or m)", dimension=REACH),
            **{key: field for key, field in (NORMAL | NORMAL_CHOICE).items() if key != "stiffness"},
        },
        _stop,
    )
)
