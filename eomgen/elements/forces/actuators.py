"""Force elements, given forces: along a path, at a point of a body, and torques on a body."""

from __future__ import annotations

from ...base.records import dataclass
from ...expr import vectors as vec
from ...expr.core import Expr
from ...expr.vectors import Vec3
from ..dimensions import FORCE, PUSH
from ..element_type import ElementType, Entry, element, key, table
from ..frames import Marker
from ..kinds import LAW, Choice, MarkerReference, Scalar, Value, Vector
from ..looks import CYLINDER, ROUND_ARROW, Pull, Seen
from .force import Force, Load, MarkerLoad, View
from .paths import ANYWHERE, ON_JOINT, PathForce, read_coordinate


@dataclass(frozen=True)
class Actuator(PathForce):
    """A given generalized force along the path: positive pushes markers apart or drives the coordinate (N or N m)."""

    sentence = "A given force or torque $F$ (`value`) along its path of length or angle $s$."
    formula = r"\delta W = F \delta s"
    value: Expr = key(
        Scalar(
            "force (N or N m); a positive value increases the coordinate, or pushes the markers apart",
            required=True,
            level=LAW,
            dimension=PUSH,
        )
    )

    def along(self, value: Expr, rate: Expr) -> Expr:
        return self.value

    def drawn(self) -> list[Seen]:
        seen = self.path.drawn(CYLINDER, ROUND_ARROW)
        return [seen._replace(along=()) if seen.coordinate else seen]  # a slide's own symbol says that it moves


def _in_ground_axes(view: View, marker: Marker, value: Vec3, axes: str) -> Vec3:
    return vec.times(view.rotation(marker), value) if axes == "body" else value


_AXES = Choice("axes of the vector: ground, or the marker's own", default="ground", choices=("ground", "body"))


@dataclass(frozen=True)
class PointForce(Force):
    """A force at a marker's origin, given in ground axes or in the marker's own (``axes="body"``) (N)."""

    sentence = r"A given force $\mathbf{F}$ at the origin of a marker."
    formula = r"\delta W = \mathbf{F}^T \delta \mathbf{r}"
    marker: Marker = key(MarkerReference("marker at whose origin the force acts", required=True))
    value: Vec3 = key(Vector("force (N)", required=True, level=LAW, dimension=FORCE))
    axes: str = key(_AXES)

    def loads(self, view: View) -> list[Load]:
        force = _in_ground_axes(view, self.marker, self.value, self.axes)
        return [MarkerLoad(self.marker, force, vec.zero(view.graph))]

    def drawn(self) -> list[Seen]:
        return [Pull(self.marker, self.value, self.axes == "body", turns=False)]


@dataclass(frozen=True)
class BodyTorque(Force):
    """A torque on a body, given in ground axes or in the marker's own (``axes="body"``) (N m)."""

    sentence = r"A given torque $\mathbf{M}$ on a body."
    formula = r"\delta W = \mathbf{M}^T \delta \mathbf{\varphi}"
    marker: Marker
    value: Vec3
    axes: str = "ground"

    def loads(self, view: View) -> list[Load]:
        torque = _in_ground_axes(view, self.marker, self.value, self.axes)
        return [MarkerLoad(self.marker, vec.zero(view.graph), torque)]

    def drawn(self) -> list[Seen]:
        return [Pull(self.marker, self.value, self.axes == "body", turns=True)]


def _torque(e: Entry) -> Force | None:
    if "joint" in e.values:
        e.refuse("axes", "a torque on a joint's coordinate has no axes")
        path, value = read_coordinate(e), e.read("value", Scalar)
        return None if path is None else Actuator(e.name, path, value)
    marker = e["body"]
    vector, axes = e.read("value", Vector), e["axes"]
    return None if marker is None else BodyTorque(e.name, marker, vector, axes)


TYPES = table(
    element(
        PointForce,
        "force",
        "a force on a body, at the origin of a marker.",
        remedies={
            "marker": "for a force along a joint's coordinate use torque or actuator (N on a length, N m on an angle)"
        },
    ),
    ElementType(
        "torque",
        "a torque on a joint's coordinate (one value) or on a body (three values).",
        {
            "joint": ON_JOINT,
            "body": MarkerReference("a body"),
            "value": Value(
                "torque (N m): one value on a joint (a force in N if its coordinate is a length), three on a body",
                required=True,
                level=LAW,
                dimension=PUSH,
            ),
            "axes": _AXES,
        },
        _torque,
        one_of=("joint", "body"),
    ),
    element(
        Actuator,
        "actuator",
        "an actuator with a given force: on a joint's coordinate, or along the line or a path between two markers.",
        ANYWHERE,
    ),
)
