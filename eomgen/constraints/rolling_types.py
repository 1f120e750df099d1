"""Constraint elements, rolling: what the entries of files and calls mean."""

from __future__ import annotations

from ..base.value_rules import POSITIVE
from ..elements.dimensions import LENGTH, NONE
from ..elements.element_type import ElementType, table
from ..elements.entry import Entry
from ..elements.kinds import Axis, Choice, Flag, MarkerReference, Scalar, Vector
from .constraint import Constraint, on_two_bodies
from .convex_rolling import NORMAL, RollingConvex, ellipsoid_support
from .convex_support import require_convex
from .rolling import KnifeEdge, RollingDisc, RollingSphere

#: Key -> the shapes that have it.
_OWN = {
    "radius": ("disc", "sphere"),
    "tube": ("disc",),
    "no_spin": ("sphere",),
    "semi_axes": ("ellipsoid",),
    "support": ("convex",),
}
_NAMES = {"disc": "discs", "sphere": "spheres", "ellipsoid": "ellipsoids", "convex": "convex shapes"}
_NEEDED = {"disc": "radius", "sphere": "radius", "ellipsoid": "semi_axes", "convex": "support"}


def _rolling(e: Entry) -> Constraint | None:
    shape, wheel, plane = e["shape"], e["wheel"], e["plane"]
    for key, shapes in _OWN.items():
        if shape in _NEEDED and shape not in shapes:
            e.refuse(key, f"only {' and '.join(_NAMES[one] for one in shapes)} have it")
    needed = _NEEDED.get(shape)
    if needed is not None and needed not in e.values:
        e.missing(needed, f"needed where shape is {shape}")
    if wheel is None or plane is None or e.at_fault() or not on_two_bodies(e, "plane", wheel, plane):
        return None
    if shape == "sphere":
        return RollingSphere(e.name, wheel, plane, e.positive("radius"), e["no_spin"])
    if shape == "disc":
        return RollingDisc(e.name, wheel, plane, e.positive("radius"), e["tube"])
    symbols = {name: e.graph.symbol(f"{name} of {e.name}") for name in NORMAL}
    local = (symbols["nx"], symbols["ny"], symbols["nz"])
    if shape == "convex":
        support = e.law("support", symbols)
        if not e.at_fault():
            require_convex(e, support, local)
        return RollingConvex(e.name, wheel, plane, support, local)
    a, b, c = e["semi_axes"]
    for k, x in enumerate((a, b, c)):
        e.require(f"semi_axes[{k}]", x, POSITIVE, "must be greater than 0")
    return RollingConvex(e.name, wheel, plane, ellipsoid_support(local, (a, b, c)), local)


def _knife_edge(e: Entry) -> Constraint | None:
    marker, on, axis = e["marker"], e["on"], e["axis"]
    if marker is None or on is None or not on_two_bodies(e, "on", marker, on):
        return None
    return KnifeEdge(e.name, marker, axis, on)


TYPES = table(
    ElementType(
        "rolling",
        "a wheel, ball or smooth convex body that rolls on a plane without slip.",
        {
            "wheel": MarkerReference("marker at the centre of the wheel; z is the axle of a disc", required=True),
            "plane": MarkerReference(
                "marker in the plane; z is its normal and points to the wheel's side", default="ground"
            ),
            "radius": Scalar("radius of a disc or a sphere (m)", dimension=LENGTH),
            "shape": Choice("shape of the wheel", default="disc", choices=tuple(_NEEDED)),
            "tube": Scalar(
                "radius of the rounded edge of a disc (m), 0 for a sharp edge",
                default=0,
                dimension=LENGTH,
            ),
            "no_spin": Flag("whether the sphere is kept from spinning about the plane's normal", default=False),
            "semi_axes": Vector("semi-axes of an ellipsoid along x, y and z (m)", dimension=LENGTH),
            "support": Scalar(
                "of a smooth convex body: the distance (m), from the marker, of the plane that touches it with the "
                "outward normal [nx, ny, nz] in the marker's axes",
                dimension=LENGTH,
                local={name: Scalar("", dimension=NONE) for name in NORMAL},
            ),
        },
        _rolling,
    ),
    ElementType(
        "knife_edge",
        "a blade: a marker that cannot move sideways, along one of its own axes.",
        {
            "marker": MarkerReference("marker at the point where the blade touches", required=True),
            "axis": Axis("direction in which the marker cannot move, in its own axes", default="y"),
            "on": MarkerReference("the body on which the blade moves", default="ground"),
        },
        _knife_edge,
    ),
)
