"""Stage describe, the table of forces: type of force -> the keys it knows, what each holds, and its default."""

from __future__ import annotations

from ..forces.normal_laws import RESTITUTIONS
from .field import MOTION, Field, Fields

_ON_JOINT = Field("joint", "a joint of one degree, or a coordinate")
_BETWEEN = Field("pair", "two markers")
_AXES = Field("choice", "axes of the vector: ground, or the marker's own", default="ground", choices=("ground", "body"))
_STIFFNESS = Field("expression", "stiffness (N/m or N m/rad)", required=True)
_DAMPING = Field("expression", "damping (N s/m or N m s/rad)", required=True, level=MOTION)

_VIA = Field("via", "what the path runs over between its ends, in order", default=())
_PATH: Fields = {"between": _BETWEEN._replace(required=True), "via": _VIA}
_LAW: Fields = {
    "law": Field(
        "expression", "force that pushes apart or drives, of the path's value and rate", default=0, level=MOTION
    ),
    "potential": Field("expression", "potential energy (J) of the path's value; adds its force", default=0),
}
_POSITIVE_PART = "force k d**n max(0, 1 + dissipation d_dot) of the penetration d"
_NORMAL: Fields = {
    "stiffness": Field("expression", f"k in the {_POSITIVE_PART} (N/m**n)", required=True),
    "exponent": Field("expression", "n", default=1.5),
    "dissipation": Field("expression", "dissipation (s/m); or give restitution and velocity"),
    "restitution": Field("expression", "coefficient of restitution, from which the dissipation follows"),
    "velocity": Field("expression", "velocity of impact (m/s) to which the restitution belongs"),
    "formula": Field("choice", "how it follows", default=RESTITUTIONS[0], choices=RESTITUTIONS),
}
_FRICTION: Fields = {
    "friction": Field("expression", "coefficient of sliding friction", level=MOTION),
    "static_friction": Field("expression", "coefficient at the onset of sliding; needs stribeck", level=MOTION),
    "stribeck": Field("expression", "sliding velocity (m/s) over which static friction falls to sliding friction"),
    "viscous_friction": Field("expression", "friction per normal force and velocity (s/m)", default=0, level=MOTION),
    "smoothing": Field("expression", "sliding velocity (m/s) below which friction is smoothed"),
}
_CONTACT: Fields = {**_NORMAL, **_FRICTION}

FORCE: dict[str, Fields] = {
    "force": {
        "marker": Field("marker", "where it acts", required=True),
        "value": Field("vector", "force (N)", required=True, level=MOTION),
        "axes": _AXES,
    },
    "torque": {
        "joint": _ON_JOINT,
        "body": Field("marker", "a body"),
        "value": Field(
            "value",
            "torque (N m): one on a joint (N where its coordinate is a length), three on a body",
            required=True,
            level=MOTION,
        ),
        "axes": _AXES,
    },
    "spring": {
        **_PATH,
        "stiffness": _STIFFNESS,
        "length": Field("expression", "length without force (m)", default=0),
    },
    "damper": {**_PATH, "damping": _DAMPING},
    "torsional_spring": {
        "joint": _ON_JOINT,
        "between": _BETWEEN,
        "stiffness": _STIFFNESS,
        "angle": Field("expression", "angle without torque (rad)", default=0),
    },
    "torsional_damper": {"joint": _ON_JOINT, "between": _BETWEEN, "damping": _DAMPING},
    "friction": {
        "joint": _ON_JOINT._replace(required=True),
        "viscous": Field("expression", "viscous coefficient (N m s/rad or N s/m)", default=0, level=MOTION),
        "coulomb": Field("expression", "Coulomb friction (N m or N); needs smoothing", level=MOTION),
        "static": Field("expression", "friction at the onset of sliding (N m or N); needs stribeck", level=MOTION),
        "stribeck": Field("expression", "velocity over which static friction falls to Coulomb's (rad/s or m/s)"),
        "smoothing": Field("expression", "velocity below which Coulomb friction is smoothed (rad/s or m/s)"),
    },
    "actuator": {
        "joint": _ON_JOINT,
        "between": _BETWEEN,
        "via": _VIA,
        "value": Field("expression", "force that pushes apart or drives (N or N m)", required=True, level=MOTION),
    },
    "element": {"joint": _ON_JOINT, "between": _BETWEEN, "via": _VIA, **_LAW},
    "torsional_element": {"joint": _ON_JOINT, "between": _BETWEEN, **_LAW},
    "bushing": {
        "between": _BETWEEN._replace(required=True),
        "stiffness": Field("matrix6", "stiffness: three of forces, three of torques (N/m, N m/rad)", required=True),
        "damping": Field("matrix6", "damping (N s/m, N m s/rad)", default=(0,) * 6, level=MOTION),
    },
    "point_gravity": {
        "center": Field("marker", "what attracts", required=True),
        "body": Field("name", "the body that is attracted, at its centre of mass", required=True),
        "mu": Field("expression", "gravitational parameter G M of the centre (m^3/s^2)", required=True),
        "extent": Field(
            "choice", "the body as a point, or with its inertia", default="point", choices=("point", "maccullagh")
        ),
    },
    "stop": {
        "joint": _ON_JOINT._replace(required=True),
        "lower": Field("expression", "lower limit (rad or m)"),
        "upper": Field("expression", "upper limit (rad or m)"),
        **_NORMAL,
    },
    "point_plane": {
        "between": Field("pair", "the plane (z points out of the solid) and the point", required=True),
        **_CONTACT,
    },
    "sphere_plane": {
        "between": Field("pair", "the plane (z points out of the solid) and the sphere's centre", required=True),
        "radius": Field("expression", "radius of the sphere (m)", required=True),
        **_CONTACT,
    },
    "sphere_sphere": {
        "between": Field("pair", "the centres", required=True),
        "radii": Field("radii", "radii of the spheres (m)", required=True),
        **_CONTACT,
    },
    "muscle": {
        **_PATH,
        "activation": Field("expression", "activation, 0 to 1", required=True, level=MOTION),
        "force_max": Field("expression", "largest active force (N)", required=True),
        "fiber_length": Field("expression", "optimal length of the fibres (m)", required=True),
        "slack_length": Field("expression", "length of the tendon (m)", required=True),
        "velocity_max": Field("expression", "fastest shortening of fibres (m/s), 10 lengths a second by default"),
        "pennation": Field("expression", "angle of the fibres to the tendon at their optimal length (rad)", default=0),
        "damping": Field("expression", "force at velocity_max over force_max", default=0.1),
    },
}
#: Types of force of which exactly one of these keys says what they act on.
ONE_OF: dict[str, tuple[str, str]] = {
    "torque": ("joint", "body"),
    "torsional_spring": ("joint", "between"),
    "torsional_damper": ("joint", "between"),
    "actuator": ("joint", "between"),
    "element": ("joint", "between"),
    "torsional_element": ("joint", "between"),
}


def force_fields(type_name: str) -> Fields:
    """The keys of one type of force, ``type`` among them."""
    return {"type": Field("choice", "type of the force", required=True, choices=tuple(FORCE)), **FORCE[type_name]}
