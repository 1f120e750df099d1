"""Stage describe, the table of fields: section or type -> the keys it knows, what each holds, and its default.

This one table drives the check of Python calls, the keys of model files and the exported JSON Schema.
"""

from __future__ import annotations

from itertools import product
from typing import Any, NamedTuple

from ..joints import JOINTS
from .mechanism import Simulation

# What the expressions of a field may depend on; each level includes those before it.
NUMBER = -1  #: numbers, pi
CONSTANT = 0  #: parameters
MOTION = 1  #: t, inputs, coordinates and their velocities
OUTPUT = 2  #: accelerations, and the motion of markers


class Field(NamedTuple):
    """What one key holds.

    ``kind`` is one of :data:`KINDS`; ``level`` says what its expressions may depend on; ``choices`` lists the words of
    a choice.
    """

    kind: str
    doc: str
    required: bool = False
    default: Any = None
    level: int = CONSTANT
    choices: tuple[str, ...] = ()


Fields = dict[str, Field]

#: kind -> how a message describes it
KINDS = {
    "text": "a text",
    "name": "a name",
    "names": "a list of names",
    "number": "a number",
    "positive": "a number greater than 0",
    "expression": "a number or an expression",
    "expressions": "a list of expressions",
    "vector": "three numbers or expressions [x, y, z]",
    "value": "a number or an expression for a joint, three of them [x, y, z] for a body",
    "inertia": "[xx, yy, zz], a 3 x 3 tensor, or a mapping of xx yy zz xy xz yz",
    "markers": "a mapping of marker names to [x, y, z] or {at, rpy}",
    "marker": "a body, body.marker, ground or {body, at, rpy}",
    "pair": "a list of two markers, each a body, body.marker, ground or {body, at, rpy}",
    "joint": "the name of a joint, or of one coordinate of a joint",
    "axis": "x, y, z, -x, -y, -z or three numbers",
    "choice": "one of the listed words",
    "limits": "a mapping of lower, upper, velocity and effort to numbers",
    "display": "a list of shapes {shape, ...}",
    "forces": "a mapping of coordinates to expressions, or a list of one expression for each coordinate",
    "table": "a mapping",
}

INERTIA = ("xx", "yy", "zz", "xy", "xz", "yz")
AXES = ("x", "y", "z", "-x", "-y", "-z")
SEQUENCES = tuple("".join(s) for s in product("xyz", repeat=3) if s[0] != s[1] and s[1] != s[2])
SOLVERS = ("DOP853", "RK45", "RK23", "Radau", "BDF", "LSODA")

_UNIT = Field("text", "unit, for display", default="")
_DOC = Field("text", "one sentence, for display", default="")
_NAME = Field("name", "name of the model and of the generated module", required=True)

PARAMETER: Fields = {
    "value": Field("number", "value; may be left out until the model is compiled"),
    "unit": _UNIT,
    "doc": _DOC,
}
INPUT: Fields = {"value": Field("number", "value while none is given", default=0.0), "unit": _UNIT, "doc": _DOC}
OUTPUT_FIELDS: Fields = {
    "expression": Field(
        "expression", "t, parameters, inputs, coordinates, their rates, motion of markers", required=True, level=OUTPUT
    ),
    "unit": _UNIT,
    "doc": _DOC,
}
MARKER: Fields = {
    "at": Field("vector", "position in body axes (m)", default=(0, 0, 0)),
    "rpy": Field("vector", "fixed-axis roll, pitch, yaw (rad)", default=(0, 0, 0)),
}
PLACED: Fields = {"body": Field("name", "a body or ground", required=True), **MARKER}
SHAPES = ("mesh", "box", "cylinder", "sphere", "capsule")
DISPLAY: Fields = {
    "shape": Field("choice", "kind of shape", required=True, choices=SHAPES),
    "file": Field("text", "file of a mesh, as the robot's file names it; it is not read"),
    "scale": Field("vector", "scale of a mesh"),
    "size": Field("vector", "edges of a box (m)"),
    "radius": Field("number", "radius (m)"),
    "length": Field("number", "length along z (m)"),
    **MARKER,
}
LIMITS: Fields = {
    "lower": Field("number", "least value (rad or m)"),
    "upper": Field("number", "greatest value (rad or m)"),
    "velocity": Field("number", "greatest speed (rad/s or m/s)"),
    "effort": Field("number", "greatest torque or force of the drive (N m or N)"),
}
BODY: Fields = {
    "mass": Field("expression", "mass (kg); 0 for a body without mass", required=True),
    "com": Field("vector", "centre of mass in body axes (m)", default=(0, 0, 0)),
    "inertia": Field("inertia", "inertia about the centre of mass in body axes (kg m^2)", default=(0, 0, 0)),
    "markers": Field("markers", "named frames fixed in the body", default=()),
    "display": Field("display", "shapes to draw, in body axes; data only", default=()),
}
GROUND: Fields = {key: BODY[key] for key in ("markers", "display")}

JOINT: Fields = {
    "type": Field("choice", "type of the joint", required=True, choices=tuple(JOINTS)),
    "between": Field("pair", "predecessor and successor", required=True),
}
AXIS = Field("axis", "axis of the joint in the markers", default="z")
COORDINATE = Field("name", "name of the coordinate (the joint's name unless given)")
COORDINATES = Field("names", "names of the coordinates, in order")
#: Data of a joint that has coordinates; the last only where it has one.
JOINT_DATA: Fields = {
    "limits": Field("limits", "limits of the coordinate; data only"),
    "dry_friction": Field("number", "Coulomb friction (N m or N); data only"),
    "armature": Field("expression", "inertia of the drive as the coordinate feels it (kg m^2 or kg)"),
}
JOINT_OPTIONS: Fields = {
    "sequence": Field("choice", "axes of the intrinsic Euler angles", default="xyz", choices=SEQUENCES),
}

_ON_JOINT = Field("joint", "a joint of one degree, or a coordinate")
_BETWEEN = Field("pair", "two markers")
_AXES = Field("choice", "axes of the vector: ground, or the marker's own", default="ground", choices=("ground", "body"))
_STIFFNESS = Field("expression", "stiffness (N/m or N m/rad)", required=True)
_DAMPING = Field("expression", "damping (N s/m or N m s/rad)", required=True, level=MOTION)

FORCE: dict[str, Fields] = {
    "force": {
        "marker": Field("marker", "where it acts", required=True),
        "value": Field("vector", "force (N)", required=True, level=MOTION),
        "axes": _AXES,
    },
    "torque": {
        "joint": _ON_JOINT,
        "body": Field("marker", "a body"),
        "value": Field("value", "torque (N m): one on a joint, three on a body", required=True, level=MOTION),
        "axes": _AXES,
    },
    "spring": {
        "between": _BETWEEN._replace(required=True),
        "stiffness": _STIFFNESS,
        "length": Field("expression", "length without force (m)", default=0),
    },
    "damper": {"between": _BETWEEN._replace(required=True), "damping": _DAMPING},
    "torsional_spring": {
        "joint": _ON_JOINT,
        "between": _BETWEEN,
        "stiffness": _STIFFNESS,
        "angle": Field("expression", "angle without torque (rad)", default=0),
    },
    "torsional_damper": {"joint": _ON_JOINT, "between": _BETWEEN, "damping": _DAMPING},
    "friction": {
        "joint": _ON_JOINT._replace(required=True),
        "viscous": Field("expression", "viscous coefficient (N m s/rad or N s/m)", required=True, level=MOTION),
    },
    "actuator": {
        "joint": _ON_JOINT,
        "between": _BETWEEN,
        "value": Field("expression", "force that pushes apart or drives (N or N m)", required=True, level=MOTION),
    },
}
#: Types of force of which exactly one of these keys says what they act on.
ONE_OF: dict[str, tuple[str, str]] = {
    "torque": ("joint", "body"),
    "torsional_spring": ("joint", "between"),
    "torsional_damper": ("joint", "between"),
    "actuator": ("joint", "between"),
}

LAGRANGIAN: Fields = {
    "coordinates": Field("names", "generalized coordinates, in order", required=True),
    "expression": Field("expression", "L(q, q_dot, t) = T - V", required=True, level=MOTION),
    "forces": Field("forces", "generalized forces", default=(), level=MOTION),
    "dissipation": Field("expression", "Rayleigh's dissipation function", default=0, level=MOTION),
    "constraints": Field("expressions", "holonomic constraints, each = 0", default=(), level=MOTION),
}
SIMULATION: Fields = {
    "end": Field("positive", "end time (s)", default=Simulation.end),
    "method": Field("choice", "integrator", default=Simulation.method, choices=SOLVERS),
    "rtol": Field("positive", "relative tolerance", default=Simulation.rtol),
    "atol": Field("positive", "absolute tolerance", default=Simulation.atol),
}
MODEL: Fields = {
    "name": _NAME,
    "doc": _DOC,
    "gravity": Field("vector", "acceleration of gravity in ground axes (m/s^2)", default=(0, 0, 0)),
    "parameters": Field("table", "constants that can change between runs"),
    "inputs": Field("table", "quantities given from outside over time"),
    "bodies": Field("table", "rigid bodies"),
    "joints": Field("table", "joints between bodies"),
    "forces": Field("table", "force elements"),
    "outputs": Field("table", "named results"),
    "lagrangian": Field("table", "a bare Lagrangian, instead of bodies and joints"),
    "independent": Field("names", "coordinates to integrate, when loops leave a choice", default=()),
    "initial": Field("table", "initial values by coordinate or <coordinate>_dot"),
    "guess": Field("table", "rough values of coordinates, where the assembly of loops starts"),
    "simulation": Field("table", "defaults of a simulation"),
}

#: Sections whose entries may be written as one value: section -> the key it stands for.
SHORT = {"parameters": "value", "inputs": "value", "outputs": "expression"}


def joint_fields(type_name: str) -> Fields:
    """The keys of one joint type."""
    joint = JOINTS[type_name]
    fields = dict(JOINT)
    if joint.has_axis:
        fields["axis"] = AXIS
    if len(joint.coordinates) == 1:
        fields["coordinate"] = COORDINATE
    if joint.coordinates:
        fields["coordinates"] = COORDINATES
        fields["limits"] = JOINT_DATA["limits"]
    if len(joint.coordinates) == 1:
        fields |= JOINT_DATA
    for option in joint.options:
        fields[option] = JOINT_OPTIONS.get(option, Field("text", option))
    return fields


def force_fields(type_name: str) -> Fields:
    """The keys of one type of force, ``type`` among them."""
    return {"type": Field("choice", "type of the force", required=True, choices=tuple(FORCE)), **FORCE[type_name]}
