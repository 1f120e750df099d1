"""Stage describe, the table of fields: section or type -> the keys it knows, what each holds, and its default.

This one table drives the check of Python calls, the keys of model files and the exported JSON Schema.
"""

from __future__ import annotations

from itertools import product

from ..joints import JOINTS
from .field import CONSTANT as CONSTANT
from .field import MOTION as MOTION
from .field import NUMBER as NUMBER
from .field import OUTPUT as OUTPUT
from .field import Field as Field
from .field import Fields as Fields
from .force_fields import FORCE as FORCE
from .force_fields import ONE_OF as ONE_OF
from .force_fields import force_fields as force_fields
from .mechanism import Simulation

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
    "forces": "a mapping of coordinates to expressions, or a list of one expression for each coordinate",
    "table": "a mapping",
    "via": "a list of markers and cylinders {around, radius, sense}",
    "matrix6": "six numbers or expressions for the diagonal, or 6 x 6 of them",
    "radii": "two numbers or expressions",
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
CYLINDER: Fields = {
    "around": Field("marker", "its z axis is the axis of the cylinder", required=True),
    "radius": Field("expression", "radius (m)", required=True),
    "sense": Field("choice", "turn of the path about the axis", default="positive", choices=("positive", "negative")),
}
PLACED: Fields = {"body": Field("name", "a body or ground", required=True), **MARKER}
BODY: Fields = {
    "mass": Field("expression", "mass (kg); 0 for a body without mass", required=True),
    "com": Field("vector", "centre of mass in body axes (m)", default=(0, 0, 0)),
    "inertia": Field("inertia", "inertia about the centre of mass in body axes (kg m^2)", default=(0, 0, 0)),
    "markers": Field("markers", "named frames fixed in the body", default=()),
}
GROUND: Fields = {"markers": BODY["markers"]}

JOINT: Fields = {
    "type": Field("choice", "type of the joint", required=True, choices=tuple(JOINTS)),
    "between": Field("pair", "predecessor and successor", required=True),
}
AXIS = Field("axis", "axis of the joint in the markers", default="z")
COORDINATE = Field("name", "name of the coordinate (the joint's name unless given)")
COORDINATES = Field("names", "names of the coordinates, in order")
JOINT_OPTIONS: Fields = {
    "sequence": Field("choice", "axes of the intrinsic Euler angles", default="xyz", choices=SEQUENCES),
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
    for option in joint.options:
        fields[option] = JOINT_OPTIONS.get(option, Field("text", option))
    return fields
