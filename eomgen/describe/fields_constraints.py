"""Stage describe, the table of fields of the constraints section: type -> the keys it knows.

Part of the table of :mod:`~eomgen.describe.fields`; it drives the same checks, and the JSON Schema.
"""

from __future__ import annotations

from .fields import MOTION, OUTPUT, Field, Fields

#: The name that stands for the angle in profiles of cams.
CAM_ANGLE = "theta"
#: The gears of a planetary set.
WHEELS = ("sun", "planet", "ring")

_JOINT = Field("joint", "a joint of one degree, or a coordinate", required=True)
_JOINTS = Field("joints", "two joints of one degree, or coordinates", required=True)
_RADII = Field("two", "base or pitch circle radii (m)")
_TEETH = Field("two", "numbers of teeth")
_PHASE = Field("expression", "first angle where the second is 0 (rad)", default=0)
_PERIODIC = Field("flag", "whether the profile repeats every turn", default=True)

CONSTRAINT: dict[str, Fields] = {
    "coupling": {
        "coordinates": Field("factors", "sum of factor times coordinate = offset"),
        "offset": Field("expression", "offset of the sum", default=0),
        "equation": Field(
            "expression",
            "held at 0: t, parameters, coordinates, velocities (linearly), places of markers",
            level=OUTPUT,
        ),
    },
    "gear": {
        "joints": _JOINTS,
        "radii": _RADII,
        "teeth": _TEETH,
        "cones": Field("two", "pitch cone angles of a bevel pair (rad)"),
        "internal": Field("flag", "whether both turn the same way", default=False),
        "phase": _PHASE,
    },
    "planetary": {
        "sun": _JOINT._replace(required=False, doc="joint of the sun; fixed if left out"),
        "ring": _JOINT._replace(required=False, doc="joint of the ring; fixed if left out"),
        "carrier": _JOINT._replace(required=False, doc="joint of the carrier; fixed if left out"),
        "planet": _JOINT._replace(required=False, doc="joint of a planet, on the carrier or on the frame"),
        "radii": Field("wheels", "radii of the wheels that are there (m)"),
        "teeth": Field("wheels", "numbers of teeth of the wheels that are there"),
        "phase": _PHASE._replace(doc="what the equation of the sun gives in the reference position (rad)"),
    },
    "rack": {
        "pinion": _JOINT._replace(doc="joint of the pinion"),
        "rack": _JOINT._replace(doc="joint of the rack"),
        "radius": Field("expression", "radius (m); negative if the rack moves the other way", required=True),
        "offset": Field("expression", "travel where the pinion's angle is 0 (m)", default=0),
    },
    "belt": {
        "joints": _JOINTS,
        "radii": _RADII,
        "teeth": _TEETH,
        "crossed": Field("flag", "whether the belt crosses, so that the pulleys turn opposite ways", default=False),
        "phase": _PHASE,
    },
    "cam": {
        "cam": _JOINT._replace(doc="joint of the cam"),
        "follower": _JOINT._replace(doc="joint of the follower"),
        "lift": Field("expression", "the follower's coordinate over theta, the cam's angle", required=True),
        "phase": Field("expression", "the cam's angle where theta is 0 (rad)", default=0),
        "periodic": _PERIODIC,
    },
    "cam_contact": {
        "cam": Field("marker", "the cam's axis (z) and where polar angles start (x)", required=True),
        "follower": Field("marker", "tip, centre of the roller, or face with z away from the cam", required=True),
        "shape": Field("choice", "shape of the follower", required=True, choices=("knife_edge", "roller", "flat_face")),
        "contour": Field("expression", "r(theta) of the cam, polar coordinates (m)"),
        "support": Field("expression", "h(theta), distance of the tangent whose normal points to theta (m)"),
        "radius": Field("expression", "radius of the roller (m)"),
        "coordinate": Field("name", "name of the polar angle of the contact point (<name>_contact)"),
        "periodic": _PERIODIC,
    },
    "rolling": {
        "shape": Field("choice", "shape of the wheel", default="disc", choices=("disc", "sphere")),
        "wheel": Field("marker", "centre; a disc's axis is z", required=True),
        "plane": Field("marker", "a point of the plane; its normal is z", default="ground"),
        "radius": Field("expression", "radius (m)", required=True),
        "tube": Field("expression", "radius of a rounded edge, 0 for a sharp one (m)", default=0),
        "no_spin": Field("flag", "whether a sphere cannot turn about the normal", default=False),
    },
    "knife_edge": {
        "marker": Field("marker", "where the blade touches", required=True),
        "axis": Field("axis", "direction without motion, in the marker's axes", default="y"),
        "on": Field("marker", "the body on which it moves", default="ground"),
    },
    "driver": {
        "coordinate": _JOINT._replace(required=False, doc="a joint of one degree, or a coordinate, that is driven"),
        "between": Field("pair", "two markers whose distance is driven"),
        "angle": Field("pair", "two markers with z axes in line; the turn of the second from the first is driven"),
        "marker": Field("marker", "a marker of which one coordinate is driven"),
        "axis": Field("axis", "along which the marker's place counts, in the axes of on", default="x"),
        "on": Field("marker", "from where the marker's place counts", default="ground"),
        "value": Field("expression", "motion over time: t, parameters, inputs, functions", required=True, level=MOTION),
    },
}
#: Types of which exactly one of these keys must be given.
ONE_OF_CONSTRAINT: dict[str, tuple[str, ...]] = {
    "coupling": ("coordinates", "equation"),
    "gear": ("radii", "teeth", "cones"),
    "planetary": ("radii", "teeth"),
    "belt": ("radii", "teeth"),
    "cam_contact": ("contour", "support"),
    "driver": ("coordinate", "between", "angle", "marker"),
}


def constraint_fields(type_name: str) -> Fields:
    """The keys of one type of constraint, ``type`` among them."""
    first = Field("choice", "type of the constraint", required=True, choices=tuple(CONSTRAINT))
    return {"type": first, **CONSTRAINT[type_name]}
