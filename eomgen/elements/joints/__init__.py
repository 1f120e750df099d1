"""Joints: one short class a type; :data:`JOINTS` is the literal table of all of them."""

from .guides import CurveSlider, PointOnCurve, PointOnSurface, SurfaceSlider
from .joint import Closure, Coordinate, Joint, QuaternionSlot, Shape, Velocity
from .joint_types import (
    ConstantVelocity,
    Continuous,
    Cylindrical,
    Free,
    Planar,
    Prismatic,
    Revolute,
    Screw,
    Spherical,
    Translational,
    Universal,
    Weld,
)
from .rods import Distance, Inline, Inplane, Orientation, Parallel, Perpendicular, RevoluteSpherical

JOINTS: dict[str, type[Joint]] = {
    joint.type_name: joint
    for joint in (
        Revolute,
        Continuous,
        Prismatic,
        Screw,
        Cylindrical,
        Universal,
        ConstantVelocity,
        Spherical,
        Planar,
        Translational,
        CurveSlider,
        SurfaceSlider,
        PointOnCurve,
        PointOnSurface,
        Free,
        Weld,
        Distance,
        RevoluteSpherical,
        Inline,
        Inplane,
        Parallel,
        Perpendicular,
        Orientation,
    )
}

__all__ = [
    "JOINTS",
    "Closure",
    "Continuous",
    "Coordinate",
    "Distance",
    "Free",
    "Joint",
    "Prismatic",
    "QuaternionSlot",
    "Revolute",
    "Shape",
    "Spherical",
    "Velocity",
    "Weld",
]
