"""Section or type -> the keys it knows, what each holds, and its default; from these the JSON Schema (draft 2020-12).

This one table drives the check of Python calls, the keys of model files and the exported JSON Schema.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ..contact import CONTACTS
from ..elements import kinds as k
from ..elements.constraints import CONSTRAINTS
from ..elements.dimensions import ACCELERATION, ENERGY, LENGTH, MASS, NONE, TIME, Dimension
from ..elements.dimensions import INERTIA as MOMENT_OF_INERTIA
from ..elements.element_type import Types
from ..elements.forces import FORCES
from ..elements.joints import JOINTS, LATEX
from ..elements.kinds import MARKER, Fields, Schema, Table, definitions, object_schema, ref, table_schema, typed_schema
from ..elements.kinds import PLACED as PLACED
from ..elements.solids import SOLIDS
from .mechanism import Simulation

#: Kind of a table -> what it is, for messages and documents.
TABLES = {
    "cubic": "a spline with continuous curvature, the ends not-a-knot",
    "natural": "a spline with continuous curvature, none at the ends",
    "periodic": "a spline with continuous curvature that repeats",
    "monotone": "a cubic with continuous slope that never overshoots (PCHIP)",
}

# Contact stands before muscles, creep and tyres in lists of types.
FORCES.data |= CONTACTS.data | {name: FORCES.data.pop(name) for name in ("muscle", "creep", "tyre")}

#: Section of elements -> its types.
ELEMENTS: dict[str, Types] = {"joints": JOINTS, "forces": FORCES, "constraints": CONSTRAINTS}

SOLVERS = ("DOP853", "RK45", "RK23", "Radau", "Taylor", "BDF", "LSODA", "RK4", "moreau")
FIXED_STEP = ("RK4", "moreau")  #: methods whose steps are of one size

_UNIT = k.Unit("unit of the value, such as mm or N*m/rad; the value is converted to SI", default="")
_DOC = k.Text("one sentence, shown in reports", default="")
_LATEX = k.Latex("how formulas and plots print it, in LaTeX (from its name unless given)", default="")
_NAME = k.Name("name of the model and of the generated module", required=True)

PARAMETER: Fields = {
    "value": k.Number("value; needed when the model is compiled"),
    "unit": _UNIT,
    "doc": _DOC,
    "latex": _LATEX,
}
INPUT: Fields = {
    "value": k.Number("value as long as a call gives none", default=0.0),
    "unit": _UNIT,
    "doc": _DOC,
    "signal": k.Scalar(
        "value over time, in runs that give none: of t, coordinates, velocities, parameters", level=k.MOTION
    ),
    "latex": _LATEX,
}
OUTPUT_FIELDS: Fields = {
    "expression": k.Scalar(
        "the result: of t, parameters, inputs, coordinates, rates, the motion of markers, other outputs",
        required=True,
        level=k.OUTPUT,
    ),
    "unit": _UNIT.replace(doc="unit in which the result is given; without one it is in SI units"),
    "doc": _DOC,
    "latex": _LATEX,
}
STATE: Fields = {
    "rate": k.Scalar(
        "its derivative: of t, parameters, inputs, coordinates, rates, states, positions and velocities of markers, "
        "outputs of these, what force elements do",
        level=k.LAW,
    ),
    "sampled": k.Scalar(
        "instead of rate: its new value at each sampling time, constant in between; else a run's controller sets it",
        level=k.LAW,
    ),
    "period": k.Scalar("time from one sampling time to the next (s)", dimension=TIME),
    "offset": k.Scalar("a sampling time (s)", default=0.0, dimension=TIME),
    "initial": k.Scalar("its value where a run begins, of parameters", default=0),
    "unit": k.Unit("unit of the state; an initial value that is a number is converted to SI", default=""),
    "doc": _DOC,
    "latex": _LATEX,
}
EVENT: Fields = {
    "expression": k.Scalar(
        "the event is where it is 0: of t, parameters, inputs, coordinates, rates, positions, velocities of markers",
        required=True,
        level=k.OUTPUT,
    ),
    "terminal": k.Times("whether the event ends the run, or how many do", default=False),
    "direction": k.Sign("1: only where it rises, -1: only where it falls, 0: both", default=0),
    "reset": k.Rates(
        "new coordinates and velocities, all from those before the event; they are brought back onto the constraints",
        default=(),
        level=k.OUTPUT,
    ),
    "restitution": k.Number("for an impact where the gap (the expression) closes: Newton's coefficient, 0 to 1"),
    "doc": _DOC,
    "friction": k.Number("beside a restitution: Coulomb's coefficient of friction in the impact"),
    "slip": k.SomeNames(
        "beside friction: the output that is the sliding velocity; in space two, along directions at right angles"
    ),
}
FUNCTION: dict[str, Fields] = {
    "table": {
        "x": k.Numbers("points, strictly increasing", required=True),
        "y": k.Numbers("values at the points; with z, points along the second argument", required=True),
        "z": k.Grid("values on the grid of x and y, for a function of two arguments"),
        "kind": k.Choice(
            "cubic and natural are splines with continuous curvature, with not-a-knot ends and with ends without "
            "curvature; periodic likewise, repeating from the last point on, whose value is the first; monotone "
            "(PCHIP) has a continuous slope and never overshoots; a grid takes cubic or natural",
            default="cubic",
            choices=tuple(TABLES),
        ),
        "extrapolation": k.Choice(
            "beyond the points: keep the slope or the value (the slope then jumps)",
            default="linear",
            choices=("linear", "constant"),
        ),
    },
    "native": {
        "source": k.Text("C source file, relative to the model file; needs --allow-native", required=True),
        "function": k.Name("C function double f(double, ...) (the name of the entry unless given)"),
        "arguments": k.Count("number of arguments (that of derivatives unless given, or 1)"),
        "derivatives": k.Functions("C functions of the derivative along each argument"),
        "second_derivatives": k.Functions("C functions of the second derivatives, along 11, 12, .., 22, .."),
        "python": k.Text("Python file with functions of the same names, for evaluation without C"),
    },
}
_SLOPES = "``{}derivatives`` in Python, if ``python`` is a callable; None for a missing one"
#: Keys of native functions that only calls in Python have.
PYTHON_SLOPES: Fields = {f"python_{order}derivatives": k.Functions(_SLOPES.format(order)) for order in ("", "second_")}
_MASS = k.Scalar("mass (kg), instead of a density", dimension=MASS)
_DENSITIES = {
    "density": k.Scalar("density (kg/m^3)", dimension=Dimension(-3, 1)),
    "line_density": k.Scalar("mass per length (kg/m)", dimension=Dimension(-1, 1)),
}
_SUBTRACT = k.Flag("whether the solid is a hole", default=False)
#: Type of solid -> its own keys; ``mesh`` is read from a file, the others are formulas.
SOLID: dict[str, Fields] = {
    name: solid.dimensions
    | ({"axis": k.Axis("direction of its z axis in the body", default="z")} if solid.has_axis else {})
    | {solid.content_key: _DENSITIES[solid.content_key]}
    for name, solid in SOLIDS.items()
} | {
    "mesh": {
        "file": k.File("STL file; its path from the folder of the model file", required=True),
        "scale": k.Scalar("metres in one unit of the file", default=1, dimension=LENGTH),
        "density": _DENSITIES["density"],
    }
}


def solid_fields(type_name: str) -> Fields:
    """The keys of one type of solid."""
    kind = k.Choice("type of the solid", required=True, choices=tuple(SOLID))
    return {"type": kind, **SOLID[type_name], "mass": _MASS, **MARKER, "subtract": _SUBTRACT}


SOLID_KEYS = frozenset(key for name in SOLID for key in solid_fields(name))


class Solids(k.BodyParts):
    """A list of solids {type, ...}."""

    schema, defines = k.define("solids", lambda: k.array({"oneOf": [_solid_schema(name) for name in SOLID]}))
    parts = {key: field for fields in SOLID.values() for key, field in fields.items()} | MARKER | {"mass": _MASS}


def _solid_schema(name: str) -> k.Schema:
    density = "line_density" if "line_density" in SOLID[name] else "density"
    schema = k.typed_schema(solid_fields(name), name)
    return {**schema, "oneOf": [{"required": ["mass"]}, {"required": [density]}]}


BODY: Fields = {
    "mass": k.Scalar("mass (kg); 0 for a body without mass", dimension=MASS),
    "com": k.Vector("centre of mass in body axes (m)", default=(0, 0, 0), dimension=LENGTH),
    "inertia": k.Inertia(
        "inertia (kg m^2) about the centre of mass in body axes, or as set by about and axes; in a mapping "
        "missing entries are 0, and products have the sign of the tensor; a single moment suffices in plane motion",
        default=(0, 0, 0),
        dimension=MOMENT_OF_INERTIA,
    ),
    "markers": k.Markers("named frames fixed in the body, known as body.name", default=()),
    "principal": k.Vector("principal moments (kg m^2) along axes, instead of inertia", dimension=MOMENT_OF_INERTIA),
    "first_moment": k.Vector(
        "first moment m c about the body's origin (kg m), instead of com", dimension=Dimension(1, 1)
    ),
    "about": k.About(
        "point that inertia or principal is about; a marker gives its axes too", default="com", dimension=LENGTH
    ),
    "axes": k.Vector("roll, pitch, yaw (rad) of the axes of inertia or principal in the body", dimension=NONE),
    "solids": Solids("solids of uniform density, which give mass, com, inertia", default=()),
    "points": k.Points("point masses that are added", default=()),
    "check_inertia": k.Check(
        "a mass and inertia that no body can have: refused (error, true), noted (note) or taken in silence (off, "
        "false); as in the model unless given"
    ),
    "display": k.Display("shapes for pictures, in body axes", default=()),
}
GROUND: Fields = {key: BODY[key] for key in ("markers", "display")}

LAGRANGIAN: Fields = {
    "coordinates": k.Names("generalized coordinates, in order", required=True, holds="coordinate"),
    "expression": k.Scalar("L(q, q_dot, t) = T - V", required=True, level=k.MOTION, dimension=ENERGY),
    "forces": k.CoordinateForces("generalized forces", default=(), level=k.MOTION),
    "dissipation": k.Scalar(
        "Rayleigh's dissipation function", default=0, level=k.MOTION, dimension=ENERGY.times(TIME, -1)
    ),
    "constraints": k.Scalars(
        "constraints, each = 0: of coordinates, or linear in velocities", default=(), level=k.MOTION
    ),
    "latex": LATEX,
}
EQUATIONS: Fields = {
    "coordinates": k.Names("generalized coordinates q, in order", required=True, holds="coordinate"),
    "velocities": k.Names("generalized velocities v, in order (<coordinate>_dot unless given)", holds="coordinate"),
    "rates": k.Rates("q' of q, v, t, linear in v (q' = v unless given)", level=k.MOTION),
    "intermediates": k.Rates("named parts of the expressions; each may use those before", level=k.MOTION),
    "mass_matrix": k.Matrix("M in M v' = f, of q and t, symmetric", required=True, level=k.MOTION),
    "forcing": k.Scalars("f, of q, v, t and inputs", required=True, level=k.MOTION),
    "constraints": k.Scalars(
        "constraints, each = 0: of coordinates, or linear in velocities", default=(), level=k.MOTION
    ),
    "multipliers": k.Names("names of the multipliers l of the constraints, for outputs: M v' + C_q^T l = f"),
    "kinetic_energy": k.Scalar("kinetic energy (J)", default=0, level=k.MOTION, dimension=ENERGY),
    "potential_energy": k.Scalar("potential energy (J)", default=0, level=k.MOTION, dimension=ENERGY),
    "latex": LATEX,
}
SIMULATION: Fields = {
    "end": k.PositiveNumber("end time (s)", default=Simulation.end),
    "method": k.Choice("integrator", default=Simulation.method, choices=SOLVERS),
    "rtol": k.PositiveNumber("relative tolerance", default=Simulation.rtol),
    "atol": k.PositiveNumber("absolute tolerance", default=Simulation.atol),
    "step": k.PositiveNumber("step size (s), for RK4 and moreau only"),
}
MODEL: Fields = {
    "name": _NAME,
    "doc": _DOC,
    "gravity": k.Vector("acceleration of gravity in ground axes (m/s^2)", default=(0, 0, 0), dimension=ACCELERATION),
    "parameters": k.Table("constants that can change between runs"),
    "inputs": k.Table("quantities given from outside over time"),
    "functions": k.Table("functions for use in expressions: tables, and C code"),
    "bodies": k.Table("rigid bodies"),
    "joints": k.Table("joints between bodies"),
    "forces": k.Table("force elements"),
    "contacts": k.Table("contact between groups of shapes: forces of type contacts"),
    "constraints": k.Table("equations between coordinates or markers"),
    "states": k.Table("first-order states: names of quantities with their rates"),
    "outputs": k.Table("named results"),
    "events": k.Table("events to find during a run, and what they do"),
    "components": k.Table("parts of mechanisms that can be added several times"),
    "add": k.Table("instances of components"),
    "attachments": k.Names("names for markers of the model to which this one is added"),
    "lagrangian": k.Table("a bare Lagrangian, instead of bodies and joints"),
    "equations": k.Table("equations of motion M v' = f, instead of bodies and joints"),
    "independent": k.Names("independent coordinates of a mechanism with loops", default=()),
    "initial": k.Table("initial values by coordinate, <coordinate>_dot, output or place of a marker"),
    "guess": k.Table("rough values of coordinates, from which loops are closed"),
    "simulation": k.Table("defaults of a simulation"),
    "limits": k.Choice("whether a run that passes a limit of a joint warns", default="note", choices=("note", "off")),
    "check_inertia": k.Check("masses and inertias that no body can have: refused or noted", default=True),
}

#: Keys of a model file that hold parts of mechanisms and their use; what they bring stands in the sections then.
PARTS = ("components", "add")
COMPONENT: Fields = {
    "doc": _DOC,
    "file": k.File("model file of the component (path from this file's folder), instead of all other keys"),
    "attachments": MODEL["attachments"],
    **{key: MODEL[key] for key in ("parameters", "inputs", "functions", "bodies", "joints", "forces")},
    **{key: MODEL[key] for key in ("constraints", "states", "outputs", "events", "initial", "guess", "add")},
}
ADDED: Fields = {
    "component": k.Name("name of a component", required=True),
    "prefix": k.Prefix("text before each name of the component (the entry's name and _ unless given)"),
    "for": k.Loops("variables and their lists of values; one instance for each value, numbered 1, 2, ..."),
    "at": k.AttachedTo("a marker for each attachment, or one for the only attachment or for its ground"),
    "parameters": k.Measured("its parameters: numbers, {value, unit}, or expressions that replace them"),
    "inputs": k.Measured("its inputs: numbers, {value, unit}, or expressions that replace them"),
    "initial": k.Values("initial values, by names within the component"),
    "guess": k.Values("rough coordinates, by names within the component"),
}

#: Section of single entries -> their keys.
SINGLE = {"bodies": BODY, "parameters": PARAMETER, "inputs": INPUT, "states": STATE}
SINGLE |= {"outputs": OUTPUT_FIELDS, "events": EVENT}
#: Sections whose entries may be written as one value: section -> the key it stands for.
SHORT = {"parameters": "value", "inputs": "value", "states": "rate", "outputs": "expression", "events": "expression"}


def fields_of(section: str, values: Mapping[str, Any]) -> Fields:
    """The keys of an entry of a section; empty for a type that is not known."""
    types, kind = ELEMENTS.get(section), values.get("type")
    if types is not None:
        return types[kind].fields(section[:-1], types) if isinstance(kind, str) and kind in types else {}
    return SINGLE.get(section, {})


def acts_on_length(section: str, values: Mapping[str, Any], field: k.Field, is_length: Callable[[str], bool]) -> bool:
    """Whether an entry acts on a length rather than an angle, where the dimension of a field depends on it.

    ``is_length`` says it of a coordinate, or of a joint of one, by name.
    """
    for key in (field.along, "coordinate"):
        if values.get(key) is not None and section in ("forces", "constraints"):
            return is_length(str(values[key]))
    return "between" in values or "marker" in values or "first" in values


def function_fields(type_name: str) -> Fields:
    """The keys of one type of function, ``type`` among them."""
    choices = tuple(FUNCTION)
    return {"type": k.Choice("type of the function", required=True, choices=choices), **FUNCTION[type_name]}


def _contacts() -> Schema:
    """An entry of the section contacts: keys of the type, its law one by one or as a mapping."""
    schema = _element("force", FORCES, "contacts")
    del schema["properties"]["type"]
    schema["required"] = ["first"]
    return schema


def _body() -> Schema:
    raw = [{"required": [key]} for key in ("mass", "solids", "points")]
    return {**table_schema(BODY), "anyOf": raw}


def _element(what: str, types: Types, type_name: str) -> Schema:
    schema = typed_schema(types[type_name].fields(what, types), type_name)
    if types[type_name].one_of:
        schema["oneOf"] = [{"required": [key]} for key in types[type_name].one_of]
    if type_name == "contacts":  # whose friction is a coefficient where bodies are rigid
        rigid = {"properties": {"type": {"const": "rigid"}}, "required": ["type"]}
        schema["if"] = {"properties": {"law": rigid}, "required": ["law"]}
        schema["then"] = {"properties": {"friction": {"maxProperties": 1}}}
        schema["else"] = {"properties": {"friction": {"minProperties": 2}}}
    return schema


def _section(entry: Schema, doc: str) -> Schema:
    return {"type": ["object", "null"], "propertyNames": ref("name"), "additionalProperties": entry, "description": doc}


def _short(section: str, fields: Fields) -> Schema:
    """An entry that may be written as the value of its main key alone."""
    forms: list[Schema] = [fields[SHORT[section]].json()]
    if not fields[SHORT[section]].required:
        forms.append({"type": "null"})
    return {"anyOf": [*forms, table_schema(fields)]}


def model_schema() -> dict[str, Any]:
    """The JSON Schema of model files.

    Returns
    -------
    dict
        Plain data, ready for ``json.dumps``.  It describes the layout; names and expressions are judged by the check.
    """
    entries: Schema = {
        "functions": {"oneOf": [typed_schema(function_fields(name), name) for name in FUNCTION]},
        "bodies": _body(),
        **{key: {"oneOf": [_element(key[:-1], types, name) for name in types]} for key, types in ELEMENTS.items()},
        "contacts": _contacts(),
        "add": table_schema(ADDED),
        **{section: _short(section, fields_of(section, {})) for section in SHORT},
    }
    sections: Schema = {section: _section(entry, MODEL[section].doc) for section, entry in entries.items()}
    values = {**_section(ref("expression"), ""), "propertyNames": ref("reference")}
    tables = {"lagrangian": LAGRANGIAN, "equations": EQUATIONS, "simulation": SIMULATION}
    plain = {"initial": values, "guess": values, **{key: table_schema(fields) for key, fields in tables.items()}}
    sections |= {key: {**schema, "description": MODEL[key].doc} for key, schema in plain.items()}
    sections["bodies"]["properties"] = {"ground": table_schema(GROUND)}
    keys = {key: sections[key] if isinstance(field, Table) else field.json() for key, field in COMPONENT.items()}
    sections["components"] = _section(object_schema(keys), MODEL["components"].doc)
    properties = {key: sections[key] if isinstance(field, Table) else field.json() for key, field in MODEL.items()}
    properties["independent"]["items"] = ref("reference")
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "eomgen model file",
        **object_schema(properties, [key for key, field in MODEL.items() if field.required]),
        "$defs": definitions(),
    }
