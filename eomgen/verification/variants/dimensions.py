"""Stage verification, dimensions: what every field of a description is measured in, as powers of length, mass, time.

Parameters and inputs keep their SI numbers; a field that uses them is converted as a whole, so that no parameter's
dimension has to be guessed.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from ...describe.visit import Slot
from .variant import NotApplicable, UnitScales


class Dimension(NamedTuple):
    """Powers of length, mass and time; or None in ``length`` where the field keeps its SI value."""

    length: float = 0
    mass: float = 0
    time: float = 0

    def of(self, scales: UnitScales) -> float:
        """Units of a variant in one SI unit."""
        return float(scales.length**self.length * scales.mass**self.mass * scales.time**self.time)


NONE, LENGTH, MASS, TIME = Dimension(), Dimension(1), Dimension(0, 1), Dimension(0, 0, 1)
SPEED, INERTIA, FORCE, TORQUE = Dimension(1, 0, -1), Dimension(2, 1), Dimension(1, 1, -2), Dimension(2, 1, -2)
SPIN = Dimension(0, 0, -1)

_BODY = {
    "mass": MASS,
    "com": LENGTH,
    "inertia": INERTIA,
    "principal": INERTIA,
    "first_moment": Dimension(1, 1),
    "about": LENGTH,
    "axes": NONE,
    "at": LENGTH,
    "rpy": NONE,
    "density": Dimension(-3, 1),
    "line_density": Dimension(-1, 1),
    "scale": LENGTH,
}
#: Dimensions of forces along a length; along an angle a length stands for a radian.
_FORCE = {
    ("spring", "stiffness"): Dimension(0, 1, -2),
    ("spring", "length"): LENGTH,
    ("damper", "damping"): Dimension(0, 1, -1),
    ("torsional_spring", "stiffness"): TORQUE,
    ("torsional_spring", "angle"): NONE,
    ("torsional_damper", "damping"): Dimension(2, 1, -1),
    ("torsional_element", "law"): TORQUE,
    ("torsional_element", "potential"): TORQUE,
    ("element", "potential"): TORQUE,
    ("force", "value"): FORCE,
    ("point_gravity", "mu"): Dimension(3, 0, -2),
    ("muscle", "force_max"): FORCE,
    ("muscle", "fiber_length"): LENGTH,
    ("muscle", "slack_length"): LENGTH,
    ("muscle", "velocity_max"): SPEED,
}
_FRICTION = ("friction", "static_friction", "restitution", "exponent", "activation", "pennation")
_CONTACTS = ("point_plane", "sphere_plane", "sphere_sphere")
_CONSTRAINT = {
    ("rack", "radius"): LENGTH,
    ("rack", "offset"): LENGTH,
    ("cam_contact", "contour"): LENGTH,
    ("cam_contact", "support"): LENGTH,
    ("cam_contact", "radius"): LENGTH,
    ("rolling", "radius"): LENGTH,
    ("rolling", "tube"): LENGTH,
}


def dimension_of(slot: Slot, length: bool) -> Dimension:
    """The dimension of a scalar; ``length`` says whether the coordinate that its entry acts on is a length.

    Raises
    ------
    NotApplicable
        The dimension is not known, as of a bare Lagrangian.
    """
    kind, key = slot.type, slot.key
    if key in ("at", "rpy"):
        return LENGTH if key == "at" else NONE
    if slot.section == "" and key == "gravity":
        return Dimension(1, 0, -2)
    if slot.section == "bodies":
        return _solid(slot)
    if slot.section == "joints":
        if key == "armature":
            return MASS if length else INERTIA
        return LENGTH  # pitch, length, curve, surface
    if slot.section == "forces":
        return _force(kind, key, slot, length)
    if slot.section == "constraints":
        if (kind, key) in (("driver", "value"), ("cam", "lift"), ("cam", "phase")):
            return LENGTH if length else NONE
        if key == "radii":
            return LENGTH
        return _CONSTRAINT.get((kind, key), NONE)
    raise NotApplicable(f"the dimension of {slot.section}.{key} is not known")


def _solid(slot: Slot) -> Dimension:
    known = _BODY.get(slot.key)
    return LENGTH if known is None else known  # the rest are sizes of solids


def _force(kind: str, key: str, slot: Slot, length: bool) -> Dimension:
    found = _FORCE.get((kind, key))
    if found is not None:
        return found
    if key in _FRICTION:
        return NONE
    reach = 1 if length else 0  # an angle has no dimension
    push = FORCE if length else TORQUE
    if kind in ("torque", "actuator", "element") and key in ("value", "law"):
        return push
    if kind in ("joint_spring", "joint_damper"):
        if key == "rest":
            return Dimension(reach)
        per = {"stiffness": (reach, 0, 0), "damping": (reach, 0, -1)}
        return Dimension(*(a - b for a, b in zip(push, per[key], strict=True)))
    if kind == "friction":
        rate = Dimension(reach, 0, -1)
        return {"viscous": Dimension(*(a - b for a, b in zip(push, rate, strict=True)))}.get(
            key, rate if key in ("stribeck", "smoothing") else push
        )
    if kind == "stop" or kind in _CONTACTS:
        along = {"lower": reach, "upper": reach, "radius": 1, "radii": 1}
        if key in along:
            return Dimension(along[key])
        if key == "stiffness":
            return push  # per unit of penetration to the power of the exponent, which the change adds
        if key in ("velocity", "stribeck", "smoothing"):
            return Dimension(reach, 0, -1)
        if key in ("dissipation", "viscous_friction"):
            return Dimension(-reach, 0, 1)
    if kind == "bushing":
        return _bushing(key, slot.place)
    raise NotApplicable(f"the dimension of {key} of a {kind} is not known")


def _bushing(key: str, index: tuple[Any, ...]) -> Dimension:
    """Rows are forces, then torques; columns lengths, then angles."""
    row, column = index[0], index[-1]
    base = FORCE if row < 3 else TORQUE
    rate = 1 if key == "damping" else 0
    return Dimension(base.length - (1 if column < 3 else 0), base.mass, base.time + rate)
