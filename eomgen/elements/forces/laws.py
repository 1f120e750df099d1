"""Force elements, any law: an expression of a path's value and rate -> the force along it."""

from __future__ import annotations

from collections.abc import Callable

from ...base.records import dataclass
from ...expr.core import Expr, substitute
from ...expr.differentiate import gradient
from ..dimensions import ENERGY, LENGTH, NONE, PUSH, RATE, SPIN, Dimension
from ..element_type import ElementType, Entry, table
from ..kinds import LAW, Fields, Scalar
from ..looks import LAW_BOX, LAW_RING, Seen
from .force import Load, View
from .paths import BETWEEN, ON_JOINT, VIA, Path, PathForce, read_angle, read_joint_or_path


@dataclass(frozen=True)
class GeneralElement(PathForce):
    """A generalized force law(value, rate) - dV/dvalue along the path (N or N m).

    Positive pushes the ends apart or drives the coordinate.  ``value`` and ``rate`` are the symbols that stand in the
    law for the path's.  Only the potential V(value) counts as energy; the law is taken as it is, conservative or not.
    """

    sentence = "A law of the model gives the force along the path from its length or angle $s$ and the rate."
    formula = r"F = f(s,\dot{s})"
    uses_value = True
    value: Expr
    rate: Expr
    law: Expr
    energy: Expr

    def _here(self, view: View, expression: Expr) -> Expr:
        return self._at(*self.path.measure(view), expression)

    def _at(self, value: Expr, rate: Expr, expression: Expr) -> Expr:
        return substitute([expression], {self.value: value, self.rate: rate})[0]

    def along(self, value: Expr, rate: Expr) -> Expr:
        return self._at(value, rate, self.law - gradient(self.energy, [self.value])[0])

    def drawn(self) -> list[Seen]:
        seen = self.path.drawn(LAW_BOX, LAW_RING)
        return [seen._replace(along=()) if seen.coordinate else seen]  # a slide's own symbol says that it moves

    def potential(self, view: View) -> Expr | None:
        if self.energy.is_zero or not self.path.is_exact(view):
            return None
        return self._here(view, self.energy)

    def remainder(self, view: View) -> list[Load]:
        return [] if self.law.is_zero else self.path.loads(view, self._here(view, self.law))


def _element(path: Callable[[Entry], Path | None], angle: bool) -> Callable[[Entry], GeneralElement | None]:
    """The law knows ``length`` or ``angle``, and ``rate``."""

    def read(e: Entry) -> GeneralElement | None:
        where = path(e)
        if "law" not in e.values and "potential" not in e.values:
            e.fault("", "has no force law", "give law, potential or both", "EG-MISSING")
        on = e["joint"] if "joint" in e.values and where is not None else None
        word = "angle" if angle or (on is not None and on.kind == "angle") else "length"
        value, rate = (e.graph.symbol(f"{name}[{e.name}]") for name in (word, "rate"))
        law = e.law("law", {word: value, "rate": rate}) if "law" in e.values else e.graph.zero
        energy = e.law("potential", {word: value}) if "potential" in e.values else e.graph.zero
        return None if where is None else GeneralElement(e.name, where, value, rate, law, energy)

    return read


def _law(of: str, unit: str, push: Dimension, rate: Dimension) -> Fields:
    """Keys of a law of ``of``, its dimension and that of ``rate``."""
    local = {"length": LENGTH, "angle": NONE, "rate": rate}
    names = {name: Scalar("", dimension=own) for name, own in local.items()}
    return {
        "law": Scalar(
            f"{unit}: a positive value increases the coordinate or pushes the markers apart; an expression of {of}, "
            "``rate``, t, parameters, inputs, coordinates, velocities, the motion of markers and outputs",
            level=LAW,
            dimension=push,
            local=names,
        ),
        "potential": Scalar(
            f"potential energy (J), an expression of {of} and parameters; the force is minus its derivative",
            dimension=ENERGY,
            local=names,
        ),
    }


TYPES = table(
    ElementType(
        "element",
        "a force with a law of your own: along a joint's coordinate, the line between two markers, or a path.",
        {
            "joint": ON_JOINT,
            "between": BETWEEN,
            **_law("``length`` (``angle``, where the coordinate is one)", "force (N, or N m)", PUSH, RATE),
            "via": VIA,
        },
        _element(read_joint_or_path, False),
        one_of=("joint", "between"),
    ),
    ElementType(
        "torsional_element",
        "a torque with a law of your own on an angle: of a joint, or of the second marker about z of the first.",
        {"joint": ON_JOINT, "between": BETWEEN, **_law("``angle``", "torque (N m)", ENERGY, SPIN)},
        _element(read_angle, True),
        one_of=("joint", "between"),
    ),
)
