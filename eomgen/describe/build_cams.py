"""Stage describe, cams: entries of cams -> a law of lift, or contact with a contour."""

from __future__ import annotations

from ..constraints import CamLift, Constraint, FlatContact, FlatSupport, KnifeContact, RollerContact
from ..constraints.profiles import Profile
from .constraint_element import Element
from .fields_constraints import CAM_ANGLE


def _profile(e: Element, key: str, turns: bool = True) -> Profile:
    local = e.reader.graph.symbol(f"{CAM_ANGLE} of {e.name}")
    return Profile(e.law(key, {CAM_ANGLE: local}), local, e.flag("periodic") and turns)


def cam(e: Element) -> CamLift | None:
    """The follower's coordinate as a function of the cam's."""
    turning, follower = e.coordinate("cam"), e.coordinate("follower")
    if turning is None or follower is None:
        return None
    if turning.name == follower.name:
        e.faults.add(f"{e.path}.follower", f"{follower.name!r} is the cam's own coordinate", "name another")
        return None
    for key, found in (("cam", turning), ("follower", follower)):
        if found.kind not in ("angle", "length"):
            what = f"the coordinate {found.name!r} is neither an angle nor a length"
            e.faults.add(f"{e.path}.{key}", what, "name one that is; rotation: euler_angles has angles")
    if e.values.get("periodic") is True and turning.kind == "length":
        what = f"the cam slides: {turning.name!r} is a length, and its law repeats no turn"
        e.faults.add(
            f"{e.path}.periodic", what, "leave it out, or write the repetition into lift, as with sin(2*pi*theta/l)"
        )
    if e.faults.under(e.path):
        return None
    lift = _profile(e, "lift", turning.kind == "angle")
    return CamLift(e.name, e.symbol(turning), e.symbol(follower), lift, e.law("phase"), follower.kind)


def cam_contact(e: Element) -> Constraint | None:
    """A follower that touches the contour."""
    shape, axis, follower = e.choice("shape"), e.marker("cam"), e.marker("follower")
    if axis is not None and follower is not None and axis.body == follower.body:
        e.faults.add(f"{e.path}.follower", f"{axis.label} and {follower.label} are on the same body", "name another")
    if e.faults.under(f"{e.path}.shape"):
        return None
    if shape == "roller":
        if "radius" not in e.values:
            e.faults.add(f"{e.path}.radius", "is missing", "give the radius of the roller")
    else:
        e.refuse("radius", f"a follower of shape {shape} has no radius")
    if "support" in e.values and shape != "flat_face":
        message = "a support function is the law of a flat face"
        e.faults.add(f"{e.path}.support", message, "give the contour r(theta) instead")
    if shape == "knife_edge" or "support" in e.values:
        e.refuse("coordinate", "its contact point is known without a coordinate of its own")
    if axis is None or follower is None or e.faults.under(e.path):
        return None
    profile = _profile(e, "support" if "support" in e.values else "contour")
    if "support" in e.values:
        return FlatSupport(e.name, axis, follower, profile)
    if shape == "knife_edge":
        return KnifeContact(e.name, axis, follower, profile)
    contacts = e.around.contacts
    point = contacts.place(e.reader, e.entry, axis, e.around.bodies + len(contacts.bodies))
    if point is None:
        return None
    angle = e.reader.graph.symbol(contacts.coordinates[e.path])
    if shape == "roller":
        return RollerContact(e.name, axis, follower, profile, point, angle, e.positive("radius"))
    return FlatContact(e.name, axis, follower, profile, point, angle)
