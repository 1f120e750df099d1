"""Stage describe, the table of fields: section or type -> the keys it knows, what each holds, and its default.

This one table drives the check of Python calls, the keys of model files and the exported JSON Schema.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

from ..constraints import CONSTRAINTS
from ..constraints.switching import SWITCHING
from ..elements.dimensions import ACCELERATION, ENERGY, LENGTH, MASS, NONE, REACH, TIME, Dimension
from ..elements.dimensions import INERTIA as MOMENT_OF_INERTIA
from ..elements.element_type import ElementType
from ..elements.field import CONSTANT as CONSTANT
from ..elements.field import LAW as LAW
from ..elements.field import MOTION as MOTION
from ..elements.field import NUMBER as NUMBER
from ..elements.field import OUTPUT as OUTPUT
from ..elements.field import Field as Field
from ..elements.field import Fields as Fields
from ..forces import FORCES
from ..forces.contact_shape_fields import SHAPE_FIELDS
from ..joints import JOINTS
from ..numeric.splines import KINDS as TABLES
from ..solids import SOLIDS
from .kinds import KINDS as KINDS
from .mechanism import Simulation

INERTIA = ("xx", "yy", "zz", "xy", "xz", "yz")
AXES = ("x", "y", "z", "-x", "-y", "-z")
SOLVERS = ("DOP853", "RK45", "RK23", "Radau", "Taylor", "BDF", "LSODA", "RK4", "moreau")
FIXED_STEP = ("RK4", "moreau")  #: methods whose steps are of one size

_UNIT = Field("unit", "unit of the value, such as mm or N*m/rad; the value is converted to SI", default="")
_DOC = Field("text", "one sentence, shown in reports", default="")
_LATEX = Field("latex", "how formulas and plots print it, in LaTeX (from its name unless given)", default="")
_LATEXES = Field(
    "latexes", "how formulas and plots print its coordinates, in LaTeX: a text, a list or a mapping", default=()
)
_NAME = Field("name", "name of the model and of the generated module", required=True)

PARAMETER: Fields = {
    "value": Field("number", "value; needed when the model is compiled"),
    "unit": _UNIT,
    "doc": _DOC,
    "latex": _LATEX,
}
INPUT: Fields = {
    "value": Field("number", "value as long as a call gives none", default=0.0),
    "signal": Field(
        "expression", "value over time, in runs that give none: of t, coordinates, velocities, parameters", level=MOTION
    ),
    "unit": _UNIT,
    "doc": _DOC,
    "latex": _LATEX,
}
OUTPUT_FIELDS: Fields = {
    "expression": Field(
        "expression", "the result: of t, parameters, inputs, coordinates, rates, markers", required=True, level=OUTPUT
    ),
    "unit": _UNIT,
    "doc": _DOC,
    "latex": _LATEX,
}
STATE: Fields = {
    "rate": Field(
        "expression",
        "its derivative: of t, parameters, inputs, coordinates, rates, states, positions and velocities of markers",
        level=LAW,
    ),
    "sampled": Field(
        "expression",
        "instead of rate: its new value at each sampling time, held in between; without it a run's controllers give it",
        level=LAW,
    ),
    "period": Field("expression", "time from one sampling time to the next (s)", dimension=TIME),
    "offset": Field("expression", "a sampling time (s)", default=0, dimension=TIME),
    "initial": Field("expression", "its value where a run begins", default=0),
    "unit": Field("unit", "unit of the state; an initial value that is a number is converted to SI", default=""),
    "doc": _DOC,
    "latex": _LATEX,
}
EVENT: Fields = {
    "expression": Field(
        "expression",
        "the event is where it is 0: of t, parameters, inputs, coordinates, rates, positions, velocities of markers",
        required=True,
        level=OUTPUT,
    ),
    "terminal": Field("times", "whether the event ends the run, or how many do", default=False),
    "direction": Field("sign", "1: only where it rises, -1: only where it falls, 0: both", default=0),
    "reset": Field("rates", "new coordinates and velocities, from those before the event", default=(), level=OUTPUT),
    "restitution": Field("number", "for an impact where the gap (the expression) closes: Newton's coefficient, 0 to 1"),
    "friction": Field("number", "beside a restitution: Coulomb's coefficient of friction in the impact"),
    "slip": Field("some_names", "beside friction: the output that is the sliding velocity; in space two of them"),
    "doc": _DOC,
}
FUNCTION: dict[str, Fields] = {
    "table": {
        "x": Field("numbers", "points, strictly increasing", required=True),
        "y": Field("numbers", "values at the points; with z, points along the second argument", required=True),
        "z": Field("grid", "values on the grid of x and y, for a function of two arguments"),
        "kind": Field("choice", "interpolation between the points", default="cubic", choices=tuple(TABLES)),
        "extrapolation": Field(
            "choice", "beyond the points: keep the slope or the value", default="linear", choices=("linear", "constant")
        ),
    },
    "native": {
        "source": Field("text", "C source file, relative to the model file; needs --allow-native", required=True),
        "function": Field("name", "C function double f(double, ...) (the name of the entry unless given)"),
        "arguments": Field("count", "number of arguments (that of derivatives unless given, or 1)"),
        "derivatives": Field("functions", "C functions of the derivative along each argument"),
        "second_derivatives": Field("functions", "C functions of the second derivatives, along 11, 12, .., 22, .."),
        "python": Field("text", "Python file with functions of the same names, for evaluation without C"),
    },
}
MARKER: Fields = {
    "at": Field("vector", "position in body axes (m)", default=(0, 0, 0), dimension=LENGTH),
    "rpy": Field("vector", "fixed-axis roll, pitch, yaw (rad)", default=(0, 0, 0), dimension=NONE),
    "axes": Field(
        "frame_axes", "two of its axes in body axes, such as {x: [1, 1, 0], z: z}, instead of rpy", dimension=NONE
    ),
    "matrix": Field("matrix", "3 x 3, its axes as columns in body axes, instead of rpy", dimension=NONE),
}
CYLINDER: Fields = {
    "around": Field("marker", "marker whose z axis is the axis of the cylinder", required=True),
    "radius": Field("expression", "radius (m)", required=True, dimension=LENGTH),
    "sense": Field("choice", "sense of the path about the axis", default="positive", choices=("positive", "negative")),
    "friction": Field(
        "expression", "coefficient of friction of a rope or belt on it; give smoothing too", dimension=NONE
    ),
    "smoothing": Field(
        "expression", "slip velocity (m/s) below which this friction is smoothed", dimension=LENGTH.times(TIME, -1)
    ),
}
PLACED: Fields = {"body": Field("name", "a body or ground", required=True), **MARKER}
SHAPES = ("mesh", "box", "cylinder", "sphere", "capsule")
DISPLAY: Fields = {
    "shape": Field("choice", "kind of shape", required=True, choices=SHAPES),
    "file": Field("text", "file of a mesh (STL, OBJ or DAE), read when the model is drawn"),
    "scale": Field("vector", "scale of a mesh"),
    "size": Field("vector", "edges of a box (m)", dimension=LENGTH),
    "radius": Field("expression", "radius (m)", dimension=LENGTH),
    "length": Field("expression", "length along z (m)", dimension=LENGTH),
    "color": Field("text", 'color "#rrggbb" in pictures; that of the body unless given'),
    **MARKER,
}
LIMITS: Fields = {
    "lower": Field("number", "least value (rad or m)"),
    "upper": Field("number", "greatest value (rad or m)"),
    "velocity": Field("number", "greatest speed (rad/s or m/s)"),
    "effort": Field("number", "greatest torque or force of the drive (N m or N)"),
}
BODY: Fields = {
    "mass": Field("expression", "mass (kg); 0 for a body without mass", dimension=MASS),
    "com": Field("vector", "centre of mass in body axes (m)", default=(0, 0, 0), dimension=LENGTH),
    "inertia": Field(
        "inertia",
        "inertia (kg m^2) about the centre of mass in body axes, or as about and axes say",
        default=(0, 0, 0),
        dimension=MOMENT_OF_INERTIA,
    ),
    "markers": Field("markers", "named frames fixed in the body", default=()),
    "principal": Field("vector", "principal moments (kg m^2), instead of inertia", dimension=MOMENT_OF_INERTIA),
    "first_moment": Field(
        "vector", "first moment m c about the body's origin (kg m), instead of com", dimension=Dimension(1, 1)
    ),
    "about": Field("about", "point of the inertia; a marker gives its axes too", default="com", dimension=LENGTH),
    "axes": Field("vector", "roll, pitch, yaw (rad) of the axes of inertia or principal in the body", dimension=NONE),
    "solids": Field("solids", "solids of uniform density, which give mass, com, inertia", default=()),
    "points": Field("points", "point masses that are added", default=()),
    "check_inertia": Field("check", "a mass and inertia that no body can have: as in the model, unless given"),
    "display": Field("display", "shapes for pictures, in body axes", default=()),
}
POINT: Fields = {
    "mass": Field("expression", "mass (kg)", required=True, dimension=MASS),
    "at": Field("vector", "position in body axes (m)", default=(0, 0, 0), dimension=LENGTH),
}
_MASS = Field("expression", "mass (kg), instead of a density", dimension=MASS)
_DENSITY = Field("expression", "density (kg/m^3)", dimension=Dimension(-3, 1))
_SUBTRACT = Field("flag", "whether the solid is a hole", default=False)
#: Type of solid -> its own keys; ``mesh`` is read from a file, the others are formulas.
SOLID: dict[str, Fields] = {
    name: {key: Field(d.kind, d.doc, required=True, dimension=LENGTH) for key, d in solid.dimensions.items()}
    | ({"axis": Field("axis", "direction of its z axis in the body", default="z")} if solid.has_axis else {})
    | {
        solid.content_key: _DENSITY
        if solid.content_key == "density"
        else Field("expression", "mass per length (kg/m)", dimension=Dimension(-1, 1))
    }
    for name, solid in SOLIDS.items()
} | {
    "mesh": {
        "file": Field("file", "STL file; its path from the folder of the model file", required=True),
        "scale": Field("expression", "metres in one unit of the file", default=1, dimension=LENGTH),
        "density": _DENSITY,
    }
}
GROUND: Fields = {key: BODY[key] for key in ("markers", "display")}

JOINT: Fields = {
    "type": Field("choice", "type of the joint", required=True, choices=tuple(JOINTS)),
    "between": Field(
        "pair",
        "predecessor P and successor S, bodies or markers; coordinates are the motion of S relative to P",
        required=True,
    ),
}
AXIS = Field("axis", "axis of the joint, in both markers", default="z")
AXIS_PAIR = Field("axes", "axes of the cross in the markers: the first stays with P, the second with S")
COORDINATE = Field("name", "name of the coordinate (the joint's name unless given)")
COORDINATES = Field("names", "names of the coordinates, in order")
#: Data of a joint that has coordinates; the last only where it has one.
JOINT_DATA: Fields = {
    "limits": Field("limits", "limits of the coordinate; a run that passes one warns, but nothing stops there"),
    "dry_friction": Field("number", "Coulomb friction (N m or N); stored, but it does not act"),
    "armature": Field(
        "expression",
        "inertia of the drive, referred to the coordinate (kg m^2 or kg)",
        dimension=ENERGY.times(TIME, 2).times(REACH, -2),
    ),
}
LAGRANGIAN: Fields = {
    "coordinates": Field("names", "generalized coordinates, in order", required=True),
    "expression": Field("expression", "L(q, q_dot, t) = T - V", required=True, level=MOTION, dimension=ENERGY),
    "forces": Field("forces", "generalized forces", default=(), level=MOTION),
    "dissipation": Field(
        "expression", "Rayleigh's dissipation function", default=0, level=MOTION, dimension=ENERGY.times(TIME, -1)
    ),
    "constraints": Field(
        "expressions", "constraints, each = 0: of coordinates, or linear in velocities", default=(), level=MOTION
    ),
    "latex": _LATEXES,
}
EQUATIONS: Fields = {
    "coordinates": Field("names", "generalized coordinates q, in order", required=True),
    "velocities": Field("names", "generalized velocities v, in order (<coordinate>_dot unless given)"),
    "rates": Field("rates", "q' of q, v, t, linear in v (q' = v unless given)", level=MOTION),
    "intermediates": Field("rates", "named parts of the expressions; each may use those before", level=MOTION),
    "mass_matrix": Field("matrix", "M in M v' = f, of q and t, symmetric", required=True, level=MOTION),
    "forcing": Field("expressions", "f, of q, v, t and inputs", required=True, level=MOTION),
    "constraints": Field(
        "expressions", "constraints, each = 0: of coordinates, or linear in velocities", default=(), level=MOTION
    ),
    "multipliers": Field("names", "names of the multipliers l of the constraints, for outputs: M v' + C_q^T l = f"),
    "kinetic_energy": Field("expression", "kinetic energy (J)", default=0, level=MOTION, dimension=ENERGY),
    "potential_energy": Field("expression", "potential energy (J)", default=0, level=MOTION, dimension=ENERGY),
    "latex": _LATEXES,
}
SIMULATION: Fields = {
    "end": Field("positive", "end time (s)", default=Simulation.end),
    "method": Field("choice", "integrator", default=Simulation.method, choices=SOLVERS),
    "rtol": Field("positive", "relative tolerance", default=Simulation.rtol),
    "atol": Field("positive", "absolute tolerance", default=Simulation.atol),
    "step": Field("positive", "step size (s), for RK4 and moreau only"),
}
MODEL: Fields = {
    "name": _NAME,
    "doc": _DOC,
    "gravity": Field(
        "vector", "acceleration of gravity in ground axes (m/s^2)", default=(0, 0, 0), dimension=ACCELERATION
    ),
    "parameters": Field("table", "constants that can change between runs"),
    "inputs": Field("table", "quantities given from outside over time"),
    "functions": Field("table", "functions for use in expressions: tables, and C code"),
    "bodies": Field("table", "rigid bodies"),
    "joints": Field("table", "joints between bodies"),
    "forces": Field("table", "force elements"),
    "contacts": Field("table", "contact between groups of shapes: forces of type contacts"),
    "constraints": Field("table", "equations between coordinates or markers"),
    "states": Field("table", "first-order states: names of quantities with their rates"),
    "outputs": Field("table", "named results"),
    "events": Field("table", "events to find during a run, and what they do"),
    "components": Field("table", "parts of mechanisms that can be added several times"),
    "add": Field("table", "instances of components"),
    "attachments": Field("names", "names for markers of the model to which this one is added"),
    "lagrangian": Field("table", "a bare Lagrangian, instead of bodies and joints"),
    "equations": Field("table", "equations of motion M v' = f, instead of bodies and joints"),
    "independent": Field("names", "independent coordinates of a mechanism with loops", default=()),
    "initial": Field("table", "initial values by coordinate, <coordinate>_dot, output or place of a marker"),
    "guess": Field("table", "rough values of coordinates, from which loops are closed"),
    "simulation": Field("table", "defaults of a simulation"),
    "limits": Field(
        "choice", "whether a run that passes a limit of a joint warns", default="note", choices=("note", "off")
    ),
    "check_inertia": Field("check", "masses and inertias that no body can have: refused or noted", default=True),
}

#: Keys of a model file that hold parts of mechanisms and their use; what they bring stands in the sections then.
PARTS = ("components", "add")
COMPONENT: Fields = {
    "doc": _DOC,
    "file": Field("file", "model file of the component (path from this file's folder), instead of all other keys"),
    "attachments": MODEL["attachments"],
    **{key: MODEL[key] for key in ("parameters", "inputs", "functions", "bodies", "joints", "forces")},
    **{key: MODEL[key] for key in ("constraints", "states", "outputs", "events", "initial", "guess", "add")},
}
ADDED: Fields = {
    "component": Field("name", "name of a component", required=True),
    "prefix": Field("prefix", "text before each name of the component (the entry's name and _ unless given)"),
    "for": Field("loops", "variables and their lists of values; one instance for each value, numbered 1, 2, ..."),
    "at": Field("attached", "a marker for each attachment, or one for the only attachment or for its ground"),
    "parameters": Field("measured", "its parameters: numbers, {value, unit}, or expressions that replace them"),
    "inputs": Field("measured", "its inputs: numbers, {value, unit}, or expressions that replace them"),
    "initial": Field("values", "initial values, by names within the component"),
    "guess": Field("values", "rough coordinates, by names within the component"),
}

#: Sections whose entries may be written as one value: section -> the key it stands for.
SHORT = {"parameters": "value", "inputs": "value", "states": "rate", "outputs": "expression", "events": "expression"}


def joint_type(type_name: str) -> ElementType:
    """One joint type as the type of an element."""
    text = " ".join((inspect.getdoc(JOINTS[type_name]) or "").partition("\n\n")[0].split())
    keys = {key: field for key, field in joint_fields(type_name).items() if key != "type"}
    doc = f"a joint of type {type_name}: {text}".replace(", removes", " of 6 degrees of freedom, removes")
    doc = doc.replace(". Allows", ".  Allows")
    return ElementType(type_name, doc, keys, ends=("predecessor", "successor"))


def joint_fields(type_name: str) -> Fields:
    """The keys of one joint type."""
    joint = JOINTS[type_name]
    fields = JOINT | {key: field for key, field in joint.options.items() if field.required}
    if joint.has_axis:
        fields["axis"] = AXIS
    if joint.has_axes:
        fields["axes"] = AXIS_PAIR
    if len(joint.coordinates) == 1:
        fields["coordinate"] = COORDINATE
    fields |= {key: field for key, field in joint.options.items() if key != "rotation"}
    if joint.coordinates:
        fields["coordinates"] = COORDINATES
        fields |= joint.options  # in the order of the arguments
        fields["limits"] = JOINT_DATA["limits"]
    if len(joint.coordinates) == 1:
        fields |= JOINT_DATA
    if joint.coordinates:
        fields["latex"] = _LATEXES
    return fields | SWITCHING if joint.coordinates or type_name == "weld" else fields


def fields_of(section: str, values: Mapping[str, Any]) -> Fields:
    """The keys of an entry of a section; empty for a type that is not known."""
    kind = values.get("type")
    types: Any = {"joints": JOINTS, "forces": FORCES, "constraints": CONSTRAINTS}.get(section)
    if types is not None and isinstance(kind, str) and kind in types:
        return joint_fields(kind) if section == "joints" else types[kind].fields(section[:-1], types)
    own: dict[str, Fields] = {"bodies": BODY, "parameters": PARAMETER, "inputs": INPUT, "states": STATE}
    own |= {"outputs": OUTPUT_FIELDS, "events": EVENT}
    return own.get(section, {})


@cache
def part_fields() -> Fields:
    """Keys of the parts of an entry: placements, cylinders of paths, point masses and solids."""
    return {
        key: field
        for own in (*SHAPE_FIELDS.values(), *SOLID.values(), POINT, CYLINDER, MARKER)
        for key, field in own.items()
    }


def acts_on_length(section: str, values: Mapping[str, Any], field: Field, is_length: Callable[[str], bool]) -> bool:
    """Whether an entry acts on a length rather than an angle, where the dimension of a field depends on it.

    Parameters
    ----------
    is_length : callable
        Name of a coordinate, or of a joint of one, -> whether it is a length.
    """
    for key in (field.along, "coordinate"):
        if values.get(key) is not None and section in ("forces", "constraints"):
            return is_length(str(values[key]))
    return "between" in values or "marker" in values or "first" in values


def solid_fields(type_name: str) -> Fields:
    """The keys of one type of solid."""
    kind = Field("choice", "type of the solid", required=True, choices=tuple(SOLID))
    return {"type": kind, **SOLID[type_name], "mass": _MASS, **MARKER, "subtract": _SUBTRACT}


SOLID_KEYS = frozenset(key for name in SOLID for key in solid_fields(name))


def function_fields(type_name: str) -> Fields:
    """The keys of one type of function, ``type`` among them."""
    choices = tuple(FUNCTION)
    return {"type": Field("choice", "type of the function", required=True, choices=choices), **FUNCTION[type_name]}
