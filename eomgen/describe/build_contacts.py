"""Stage describe, stops, contacts and friction: entries of the forces section -> force elements with one-sided laws."""

from __future__ import annotations

from ..forces import (
    Damper,
    Force,
    Friction,
    HuntCrossley,
    JointFriction,
    JointStop,
    PointPlane,
    SpherePlane,
    SphereSphere,
)
from ..forces.normal_laws import dissipation_of
from ..graph.core import Expr
from .description import items
from .force_entry import ForceEntry


def build_friction(e: ForceEntry) -> Force | None:
    """Friction of a joint: viscous alone, or dry as well."""
    path, viscous = e.coordinate(), e.law("viscous")
    dry = _friction(e, "coulomb", "static", "viscous")
    if dry is None and "viscous" not in e.values and not e.reader.faults.under(e.entry.path):
        e.reader.faults.add(e.entry.path, "has no law", "give viscous, or coulomb and smoothing, or both")
    if path is None:
        return None
    return Damper(e.name, path, viscous) if dry is None else JointFriction(e.name, path, dry)


def build_stop(e: ForceEntry) -> Force | None:
    """Stops of a joint."""
    path, law = e.coordinate(), _normal_law(e)
    lower, upper = e.given("lower"), e.given("upper")
    if lower is None and upper is None:
        e.reader.faults.add(e.entry.path, "has no limit", "give lower, upper or both")
    if lower is not None and upper is not None:
        e.judge("upper", upper - lower, lambda x: x > 0, "is upper - lower; lower must be less than upper")
    return None if path is None else JointStop(e.name, path, lower, upper, law)


def build_point_plane(e: ForceEntry) -> Force | None:
    """A point on a plane."""
    pair, law, friction = e.pair(), _normal_law(e), _contact_friction(e)
    return None if pair is None else PointPlane(e.name, *pair, law, friction, e.reader.graph.zero)


def build_sphere_plane(e: ForceEntry) -> Force | None:
    """A sphere on a plane."""
    pair, law, friction, radius = e.pair(), _normal_law(e), _contact_friction(e), e.positive("radius")
    return None if pair is None else SpherePlane(e.name, *pair, law, friction, radius)


def build_sphere_sphere(e: ForceEntry) -> Force | None:
    """Two spheres."""
    pair, law, friction = e.pair(), _normal_law(e), _contact_friction(e)
    if "radii" not in e.values:
        return None
    listed = items(e.values["radii"])
    if listed is None or len(listed) != 2:
        e.reader.wrong(f"{e.entry.path}.radii", e.values["radii"], "radii")
        return None
    first, second = (e.reader.expression(f"{e.entry.path}.radii[{k}]", x) for k, x in enumerate(listed))
    for k, radius in enumerate((first, second)):
        e.judge(f"radii[{k}]", radius, lambda x: x >= 0, "a radius is 0 or greater")
    return None if pair is None else SphereSphere(e.name, *pair, law, friction, (first, second))


def _normal_law(e: ForceEntry) -> HuntCrossley:
    stiffness, exponent = e.positive("stiffness"), e.law("exponent")
    e.judge("exponent", exponent, lambda n: n >= 1, "must be at least 1, and more than 1 for a slope without a jump")
    return HuntCrossley(stiffness, exponent, _dissipation(e))


def _dissipation(e: ForceEntry) -> Expr:
    """Given as such, or through a coefficient of restitution; none of them means none."""
    restitution, velocity = e.given("restitution"), e.given("velocity")
    formula = e.choice("formula")
    if "dissipation" in e.values:
        for key in ("restitution", "velocity", "formula"):
            if key in e.values:
                e.fault(key, "the dissipation is given already", "leave out one of the two")
        value = e.law("dissipation")
        e.judge("dissipation", value, lambda x: x >= 0, "must be 0 or greater")
        return value
    if restitution is None and velocity is None:
        if "formula" in e.values:
            e.fault("formula", "there is no restitution", "give restitution and velocity, or leave it out")
        return e.reader.graph.zero
    if restitution is None or velocity is None:
        e.fault("velocity" if velocity is None else "restitution", "is missing", "restitution and velocity go together")
        return e.reader.stand_in
    e.judge("restitution", restitution, lambda x: 0 < x <= 1, "must be greater than 0 and at most 1")
    e.judge("velocity", velocity, lambda x: x > 0, "must be greater than 0")
    return dissipation_of(restitution, velocity, formula)


def _contact_friction(e: ForceEntry) -> Friction | None:
    return _friction(e, "friction", "static_friction", "viscous_friction")


def _friction(e: ForceEntry, dynamic: str, static: str, viscous: str) -> Friction | None:
    """Dry friction from the keys of its parts; None without Coulomb's part."""
    if dynamic not in e.values:
        for key in (static, "stribeck", "smoothing", *((viscous,) if viscous == "viscous_friction" else ())):
            if key in e.values:
                e.fault(key, f"there is no {dynamic}", f"give {dynamic}, or leave it out")
        return None
    level = e.law(dynamic)
    e.judge(dynamic, level, lambda x: x >= 0, "must be 0 or greater")
    if "smoothing" not in e.values:
        e.fault("smoothing", "is missing", "give the velocity below which friction is smoothed")
        return None
    if (static in e.values) != ("stribeck" in e.values):
        missing = "stribeck" if static in e.values else static
        e.fault(missing, "is missing", f"{static} and stribeck go together")
        return None
    onset = e.given(static)
    if onset is not None:
        e.judge(static, onset, lambda x: x >= 0, "must be 0 or greater")
    stribeck = e.positive("stribeck") if "stribeck" in e.values else None
    return Friction(level, e.positive("smoothing"), e.law(viscous), onset, stribeck)
