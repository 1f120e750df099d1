"""Force elements, contact in bulk: an entry with groups of shapes and a law -> the element, and the states it has."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..base.value_rules import NOT_NEGATIVE, POSITIVE, Allowed
from ..elements.dimensions import LENGTH
from ..elements.element_type import ElementType, table
from ..elements.entry import Entry
from ..elements.kinds import Law
from .bristles import UNIT
from .contact import CURVED
from .contact_groups import ContactGroups
from .contact_shape_fields import FIELD_SHAPE, GROUNDS, PLANAR, SHAPE_FIELDS, ContactShapes
from .contact_shapes import ContactShape, by_edges
from .contact_states import BED, MOST_PAIRS, ShapeParts, cells_of, given_groups, pair_states
from .dry_friction import DryFriction
from .friction_laws import has_bristles, read_friction
from .normal_laws import NORMAL_LAWS, RIGID, HertzBodies, NormalLaw, RigidLaw, read_normal_law
from .soil_beds import STATES
from .soil_laws import LATERAL, SOIL, read_soil, states_of_soil


def _contact_groups(e: Entry) -> ContactGroups | None:
    first = e["first"]
    second = e["second"] if "second" in e.values else ()
    soil = "soil" in e.values
    laws = _laws(e)
    lateral = e["lateral"]
    if first is None or second is None or laws is None or e.at_fault():
        return None
    law, friction = laws
    _refuse_pairs(e, first, second)
    if not soil and not has_bristles(e.values):  # whose states are counted before shapes are known
        first, second = by_edges(first, second)
    if has_bristles(e.values):
        _refuse_edges(e, first, second)
    if soil:
        _refuse_on_soil(e, first, second)
    bed = _is_bed(e, first, second, soil)
    if bed:
        first, second = (tuple(shape.on_bed() for shape in shapes) for shapes in (first, second))
    for key, shapes in (("first", first), ("second", second)):
        if not soil and any(shape.is_wheel for shape in shapes):
            e.fault(key, "has a circle with a width, which belongs to wheels on soil", "leave width out, or give soil")
    if isinstance(law, HertzBodies):
        for key, shapes in (("first", first), ("second", second)):
            if flat := [shape.kind for shape in shapes if shape.kind not in ("sphere", "half_space")]:
                e.fault(key, f"a {flat[0]} has no radius for Hertz's law from moduli", "give stiffness, not moduli")
    rigidly = e["friction"] if isinstance(law, RigidLaw) else getattr(friction, "dynamic", None)
    axes = 0
    if soil or has_bristles(e.values):
        groups = given_groups(e.values)
        pairs = pair_states(groups)[1]
        axes = len(_axes(e.values, groups, lateral)) if pairs else 0
        axes = len(STATES) - 1 if bed else axes
        if pairs > MOST_PAIRS:
            told = f"has {pairs} pairs with states; at most {MOST_PAIRS} may have them"
            remedy = "put only shapes that stick to each other into the groups, or use friction_law: brown_mcphee"
            e.fault("", told, remedy, "EG-TOO-LARGE")
    return ContactGroups(e.name, first, second, law, friction, e.states(), axes, rigidly, e["restitution"])


def _is_bed(e: Entry, first: Sequence[ContactShape], second: Sequence[ContactShape], soil: bool) -> bool:
    """Whether the ground is a bed, of which there is one, with soil; what is wrong is noted."""
    beds = [
        (key, shapes) for key, shapes in (("first", first), ("second", second)) if any(x.kind == BED for x in shapes)
    ]
    for key, shapes in beds:
        if len(shapes) > 1:
            e.fault(key, "has a bed and more", "give one bed as all of a group, and contacts of their own to others")
        if not soil:
            e.fault(key, "has a bed, which belongs to soil", "give soil, or half_plane or a profile as the ground")
    if beds:
        for word in ("lateral", "peak_angle", "reversal"):
            e.refuse(word, "has no meaning for a bed, whose cells are sheared along x")
    return bool(beds)


def _laws(e: Entry) -> tuple[NormalLaw, DryFriction | None] | None:
    """The law of the normal force and that of friction."""
    if "soil" in e.values:
        return read_soil(e)
    for key in SOIL:
        e.refuse(key, "belongs to contacts that have soil")
    if e["normal_law"] == RIGID:
        return _rigid_law(e), None
    if not has_bristles(e.values):
        e.refuse("lateral", "belongs to contacts that have soil, or friction_law: lugre")
    return read_normal_law(e), read_friction(e, "friction", "static_friction", "viscous_friction")


def _rigid_law(e: Entry) -> RigidLaw:
    """The law without a stiffness, whose friction and restitution are numbers."""
    for key in (*CURVED, *LATERAL):
        if key not in ("normal_law", "friction", "restitution"):
            e.refuse(key, f"has no meaning in normal_law: {RIGID}, which has friction (a coefficient) and restitution")
    for key in ("friction", "restitution"):
        value = e[key]
        if value is not None:
            e.require(key, value, NOT_NEGATIVE, "must be 0 or greater")
    restitution = e["restitution"]
    if restitution is not None:
        e.require("restitution", restitution, Allowed(high=1.0), "must be at most 1")
    return RigidLaw()


def _refuse_on_soil(e: Entry, first: Sequence[ContactShape], second: Sequence[ContactShape]) -> None:
    """Note groups that are not plates on ground."""
    for shapes, others, key in ((first, second, "second"), (second, first, "first")):
        if any(shape.kind in GROUNDS for shape in shapes):
            wrong = sorted({shape.kind for shape in others if shape.kind != "plate" and not shape.is_wheel})
            wheels = [shape for shape in others if shape.is_wheel]
            if wrong:
                remedy = "give plates: the undersides of links, soles, feet; or wheels: circles that have a width"
                e.fault(key, f"a {wrong[0]} does not lie on soil", remedy)
            elif 0 < len(wheels) < len(others) and not any(shape.kind == BED for shape in shapes):
                e.fault(key, "has wheels and plates, which remember differently", "give each contacts of their own")
            on_bed = any(shape.kind == BED for shape in shapes)  # whose cells remember
            if not on_bed:
                for word in ("recovery", "lateral") if wheels else ("peak_angle", "reversal"):
                    e.refuse(word, f"has no meaning for {'wheels' if wheels else 'plates'}")
                e.refuse("settling", "belongs to the cells of a bed")
            return
    message = "has soil, but no ground"
    e.fault("", message, "give half_plane or a profile as one group, plates or wheels as the other", "EG-MISSING")


def _axes(values: Mapping[str, Any], groups: Sequence[Sequence[ShapeParts]], lateral: bool) -> tuple[str, ...]:
    """How states of friction are called, by their axes.

    In the plane along the surface, and across the plane; in space along x and y of half-spaces, or x, y, z of others.
    """
    kinds = {shape.kind for group in groups for shape in group}
    if kinds & set(PLANAR):
        return ("_x", "_z") if lateral else ("",)
    round_pairs = FIELD_SHAPE in kinds or any(first != "surface" for _, _, first, _ in pair_states(groups)[0])
    return ("_x", "_y", "_z") if round_pairs else ("_x", "_y")


def _states(values: Mapping[str, Any]) -> dict[str, str]:
    """States of all pairs and their units, pair after pair."""
    soil = "soil" in values
    if not soil and not has_bristles(values):
        return {}
    groups = given_groups(values)
    if cells := cells_of(groups):
        return {f"{name}_{k + 1}": "m" for k in range(cells) for name in STATES}
    axes = _axes(values, groups, values.get("lateral", True) is not False)
    names = states_of_soil(axes) if soil else tuple(f"bristle{axis}" for axis in axes)
    unit = "m" if soil else UNIT
    pairs = pair_states(groups)[1]
    return {f"{name}_{k + 1}": unit for k in range(pairs) for name in names} if pairs <= MOST_PAIRS else {}


def _refuse_pairs(e: Entry, first: Sequence[ContactShape], second: Sequence[ContactShape]) -> None:
    """Note shapes that cannot meet, and a shape that is in both groups."""
    kinds = sorted({shape.kind for shape in first}), sorted({shape.kind for shape in second or first})
    for a in kinds[0]:
        for b in kinds[1]:
            if (a in PLANAR) != (b in PLANAR):
                e.fault("second", f"{a} and {b} do not meet", _ALLOWED)
            elif a in GROUNDS and b in GROUNDS and (second or a != b or _differ(first, a)):
                told = f"two shapes {a} do not meet" if a == b else f"{a} and {b} do not meet"
                e.fault("second" if second else "first", told, _ALLOWED)
    for key, own, met in (("second", kinds[0], kinds[1]), ("first", kinds[1], kinds[0])):
        if "plate" in own and (wrong := [kind for kind in met if kind not in _UNDER_PLATES]):
            e.fault(key, f"{wrong[0]} and plate do not meet", f"plates meet {', '.join(_UNDER_PLATES)}")
            break
    for key, group, others in (("first", first, second or first), ("second", second, first)):
        cornered = sorted({shape.kind for shape in others if shape.kind in _CORNERED or _is_thin(shape)})
        if cornered and (second or _differ_in_body(first)):
            told = f"corners of {cornered[0]} pass through a segment of radius 0, which has no inside"
            for shape in group:
                if shape.kind == "segment":
                    e.require(key, shape.sizes[1], POSITIVE, "give the segment a radius greater than 0", told)
        if e.at_fault(key):
            break
    for key, shapes in (("first", first), ("second", second)):
        if twice := [shape for k, shape in enumerate(shapes) if shape in shapes[:k]]:
            e.fault(key, f"has the {twice[0].kind} on {twice[0].marker.label} twice", "give each shape once")
    both = {shape.marker.label for shape in first if shape in second}
    if both:
        e.fault(
            "second",
            f"the shape on {sorted(both)[0]} is in both groups",
            "give second only what is not in first; without second the shapes of first meet among themselves",
        )
    bodies = {shape.marker.body for shape in (*first, *second)}
    if len(bodies) == 1:
        e.fault("", "has shapes on one body only", "shapes of one body do not meet; give shapes on other bodies")


def _refuse_edges(e: Entry, first: Sequence[ContactShape], second: Sequence[ContactShape]) -> None:
    """Note cuboids that meet cuboids or capsules, where every pair of their edges would have states."""
    for one in first:
        for other in second or first:
            kinds = {one.kind, other.kind}
            if one.marker.body != other.marker.body and kinds in ({"cuboid"}, {"cuboid", "capsule"}):
                told = f"{one.kind} and {other.kind} have no states where their edges meet"
                e.fault("friction_law", told, "use friction_law: coulomb or brown_mcphee for cuboids among themselves")
                return


def _is_thin(shape: ContactShape) -> bool:
    return shape.kind == "segment" and shape.sizes[1].is_zero


def _differ_in_body(shapes: Sequence[ContactShape]) -> bool:
    return len({shape.marker.body for shape in shapes}) > 1


def _differ(shapes: Sequence[ContactShape], kind: str) -> bool:
    """Whether shapes of a kind are on different bodies."""
    return len({shape.marker.body for shape in shapes if shape.kind == kind}) > 1


_UNDER_PLATES = ("bed", "half_plane", "profile", "smooth_profile", "outline", "smooth_outline", "sprocket")
_CORNERED = (
    "box",
    "polygon",
    "profile",
    "smooth_profile",
    "outline",
    "smooth_outline",
    "sprocket",
)  #: shapes whose corners meet segments
_ALLOWED = (
    "circle, segment, box, polygon, outline, smooth_outline and sprocket meet each other, half_plane, profile and "
    "smooth_profile, which plates meet too; wheels and plates meet a bed; sphere, capsule, ellipsoid and cuboid meet "
    "half_space, height_field and each other"
)

_NORMAL_LAW = CURVED["normal_law"].replace(
    choices=(*NORMAL_LAWS, RIGID),
    doc=CURVED["normal_law"].doc + f"; {RIGID}, no penetration, for runs by the method moreau only",
)
_RESTITUTION = CURVED["restitution"].replace(
    doc="coefficient of restitution, from which the dissipation is computed; in runs by the method moreau Newton's"
)
_SHAPES = "shapes {shape, on, ...} of the "

TYPES = table(
    ElementType(
        "contacts",
        "contact of every shape of a group with every shape of another, by one law.  Shapes are mappings of shape "
        f"({', '.join(PLANAR)}; {', '.join(kind for kind in SHAPE_FIELDS if kind not in PLANAR)}), "
        "on (a marker or a list of markers) and sizes.  Shapes of one body do not meet.",
        {
            "first": ContactShapes(_SHAPES + "first group", required=True, dimension=LENGTH),
            "second": ContactShapes(
                _SHAPES + "second group; without it those of the first meet among themselves",
                dimension=LENGTH,
            ),
            "law": Law("the keys that follow as a mapping, instead of one by one"),
            **CURVED,
            "normal_law": _NORMAL_LAW,
            "restitution": _RESTITUTION,
            **SOIL,
            **LATERAL,
        },
        _contact_groups,
        states=_states,
    )
)
