"""Stage describe, schema: the table of fields -> the JSON Schema of the model file (draft 2020-12)."""

from __future__ import annotations

from typing import Any

from ..base.value_rules import CHECKS
from ..constraints import CONSTRAINTS
from ..constraints.planetary import WHEELS
from ..elements.element_type import Types
from ..forces import FORCES
from ..forces.contact_shape_fields import CORNERS, FIELD_SHAPE, SHAPE_FIELDS
from ..joints import JOINTS
from .fields import (
    ADDED,
    AXES,
    BODY,
    COMPONENT,
    CYLINDER,
    DISPLAY,
    EQUATIONS,
    EVENT,
    FUNCTION,
    GROUND,
    INERTIA,
    INPUT,
    LAGRANGIAN,
    LIMITS,
    MARKER,
    MODEL,
    OUTPUT_FIELDS,
    PARAMETER,
    PLACED,
    POINT,
    SHORT,
    SIMULATION,
    SOLID,
    STATE,
    Field,
    Fields,
    function_fields,
    joint_fields,
    solid_fields,
)
from .names import LONGEST
from .repetition import ROUNDS

Schema = dict[str, Any]

_NAME: Schema = {"type": "string", "pattern": "^[A-Za-z][A-Za-z0-9_]*$", "maxLength": LONGEST}
_EXPRESSION: Schema = {"type": ["number", "string"]}
_VECTOR: Schema = {"type": "array", "items": {"$ref": "#/$defs/expression"}, "minItems": 3, "maxItems": 3}
_SIX: Schema = {"type": "array", "minItems": 6, "maxItems": 6}
#: A name, with those of instances and of bodies before it: ``leg1.foot.tip``.
_REFERENCE: Schema = {"type": "string", "pattern": r"^[A-Za-z][A-Za-z0-9_]*(\.[A-Za-z][A-Za-z0-9_]*)*$"}


def _ref(name: str) -> Schema:
    return {"$ref": f"#/$defs/{name}"}


def _object(properties: Schema, required: list[str] | None = None) -> Schema:
    schema: Schema = {"type": "object", "properties": properties, "additionalProperties": False}
    return {**schema, "required": required} if required else schema


def _definitions() -> Schema:
    expression = _ref("expression")
    return {
        "name": _NAME,
        "reference": _REFERENCE,
        "expression": _EXPRESSION,
        "vector": _VECTOR,
        "inertia": {
            "anyOf": [
                _ref("vector"),
                {"type": "array", "items": _ref("vector"), "minItems": 3, "maxItems": 3},
                _object(dict.fromkeys(INERTIA, expression)),
            ]
        },
        "placement": {"anyOf": [_ref("vector"), _table(MARKER)]},
        "markers": {"type": "object", "propertyNames": _ref("name"), "additionalProperties": _ref("placement")},
        "marker": {"anyOf": [_ref("reference"), _table(PLACED)]},
        "stop": {"anyOf": [_ref("marker"), _table(CYLINDER)]},
        "pair": {"type": "array", "items": _ref("marker"), "minItems": 2, "maxItems": 2},
        "axis": {
            "anyOf": [
                {"enum": list(AXES)},
                {"type": "array", "items": _ref("expression"), "minItems": 3, "maxItems": 3},
            ]
        },
        "solids": {"type": "array", "items": {"oneOf": [_solid(name) for name in SOLID]}},
        "points": {"type": "array", "items": _table(POINT)},
        "limits": _object({key: _each(field) for key, field in LIMITS.items()}),
        "display": {"type": "array", "items": _table(DISPLAY)},
        "contact_shape": {"oneOf": [_contact_shape(name) for name in SHAPE_FIELDS]},
    }


_NUMBERS: Schema = {"type": "array", "items": {"type": ["number", "string"]}, "minItems": 1, "maxItems": ROUNDS}
_COUNT: Schema = {"type": "integer", "minimum": 1, "maximum": ROUNDS}
_RANGE = {key: {"type": "number"} for key in ("from", "to", "step")}

#: kind of field -> its schema; kinds not listed are handled by :func:`_field`.
_KINDS: dict[str, Schema] = {
    "text": {"type": "string"},
    "unit": {"type": "string"},
    "latex": {"type": "string"},
    "latexes": {
        "anyOf": [
            {"type": "string"},
            {"type": "array", "items": {"type": ["string", "null"]}},
            {"type": "object", "propertyNames": _ref("name"), "additionalProperties": {"type": "string"}},
        ]
    },
    "name": _ref("name"),
    "body": _ref("reference"),
    "joint": _ref("reference"),
    "names": {"type": "array", "items": _ref("name")},
    "some_names": {"anyOf": [_ref("name"), {"type": "array", "items": _ref("name")}]},
    "number": {"type": ["number", "string"]},
    "numbers": {"type": "array", "items": {"type": ["number", "string"]}, "minItems": 2},
    "grid": {"type": "array", "items": {"type": "array", "items": {"type": ["number", "string"]}}, "minItems": 2},
    "count": {"type": "integer", "minimum": 1},
    "functions": {"type": "array", "items": {"anyOf": [_ref("name"), {"type": "null"}]}},
    "positive": {"anyOf": [{"type": "number", "exclusiveMinimum": 0}, {"type": "string"}]},
    "expression": _ref("expression"),
    "expressions": {"type": "array", "items": _ref("expression")},
    "vector": _ref("vector"),
    "value": {"anyOf": [_ref("expression"), _ref("vector")]},
    "inertia": _ref("inertia"),
    "markers": _ref("markers"),
    "marker": _ref("marker"),
    "flag": {"type": "boolean"},
    "check": {"enum": [True, False, *CHECKS]},
    "times": {"anyOf": [{"type": "boolean"}, {"type": "integer", "minimum": 1}]},
    "sign": {"enum": [1, -1, 0]},
    "file": {"type": "string"},
    "about": {"anyOf": [_ref("reference"), _ref("vector")]},
    "solids": _ref("solids"),
    "points": _ref("points"),
    "limits": _ref("limits"),
    "display": _ref("display"),
    "pair": _ref("pair"),
    "axis": _ref("axis"),
    "frame_axes": {
        "type": "object",
        "properties": dict.fromkeys("xyz", _ref("axis")),
        "additionalProperties": False,
        "minProperties": 2,
        "maxProperties": 2,
    },
    "axes": {"type": "array", "items": _ref("axis"), "minItems": 2, "maxItems": 2},
    "shape": _ref("vector"),
    "joints": {"type": "array", "items": _ref("reference"), "minItems": 2, "maxItems": 2},
    "two": {"type": "array", "items": _ref("expression"), "minItems": 2, "maxItems": 2},
    "factors": {"type": "object", "additionalProperties": _ref("expression"), "minProperties": 1},
    "wheels": {
        "type": "object",
        "properties": dict.fromkeys(WHEELS, _ref("expression")),
        "additionalProperties": False,
    },
    "via": {"type": "array", "items": _ref("stop")},
    "matrix6": {
        "anyOf": [
            {**_SIX, "items": _ref("expression")},
            {**_SIX, "items": {**_SIX, "items": _ref("expression")}},
        ]
    },
    "matrix": {"type": "array", "items": {"type": "array", "items": _ref("expression")}},
    "prefix": {"type": "string", "pattern": "^([A-Za-z][A-Za-z0-9_]*)?$"},
    "values": {"type": "object", "additionalProperties": _ref("expression")},
    "measured": {
        "type": "object",
        "additionalProperties": {
            "anyOf": [
                _ref("expression"),
                _object({"value": _ref("expression"), "unit": {"type": "string"}}, ["value"]),
            ]
        },
    },
    "loops": {
        "type": "object",
        "propertyNames": _ref("name"),
        "additionalProperties": {
            "anyOf": [_NUMBERS, _COUNT, _object(_RANGE, ["to"])],
        },
        "minProperties": 1,
    },
    "attached": {
        "anyOf": [
            _ref("marker"),
            {"type": "object", "propertyNames": _ref("name"), "additionalProperties": _ref("marker")},
        ]
    },
    "rates": {"type": "object", "additionalProperties": _ref("expression")},
    "shapes": {"anyOf": [_ref("contact_shape"), {"type": "array", "items": _ref("contact_shape"), "minItems": 1}]},
    "on": {"anyOf": [_ref("marker"), {"type": "array", "items": _ref("marker"), "minItems": 1}]},
    "corners": {
        "type": "array",
        "items": {"type": "array", "items": _ref("expression"), "minItems": 2, "maxItems": 2},
        "minItems": 3,
        "maxItems": CORNERS,
    },
    "places": {
        "type": "array",
        "items": {"type": "array", "items": _ref("expression"), "minItems": 2, "maxItems": 2},
        "minItems": 2,
    },
    "law": {"type": "object"},
    "radii": {"type": "array", "items": _ref("expression"), "minItems": 2, "maxItems": 2},
    "forces": {
        "anyOf": [
            {"type": "array", "items": _ref("expression")},
            {"type": "object", "additionalProperties": _ref("expression")},
        ]
    },
}


def _field(field: Field) -> Schema:
    schema = {"enum": list(field.choices)} if field.kind == "choice" else dict(_KINDS[field.kind])
    if field.default not in (None, ()):
        default = field.default
        schema["default"] = list(default) if isinstance(default, tuple) else default
    return {**schema, "description": field.doc}


def _each(field: Field) -> Schema:
    """A number for the coordinate, or a list of one for each of several coordinates."""
    number = {"type": ["number", "string", "null"]}
    return {"anyOf": [number, {"type": "array", "items": number}], "description": field.doc}


def _table(fields: Fields, without: tuple[str, ...] = ()) -> Schema:
    """An object with the keys of a table."""
    kept = {key: field for key, field in fields.items() if key not in without}
    return _object({k: _field(f) for k, f in kept.items()}, [k for k, f in kept.items() if f.required])


def _typed(fields: Fields, type_name: str) -> Schema:
    schema = _table(fields)
    schema["properties"]["type"] = {"const": type_name}
    return schema


def _contact_shape(kind: str) -> Schema:
    schema = _table(SHAPE_FIELDS[kind])
    schema["properties"]["shape"] = {"const": kind}
    if kind == FIELD_SHAPE:
        schema["oneOf"] = [{"required": ["height"]}, {"required": ["x", "y", "z"]}]
    return schema


def _contacts() -> Schema:
    """An entry of the section contacts: keys of the type, its law one by one or as a mapping."""
    schema = _element("force", FORCES, "contacts")
    del schema["properties"]["type"]
    schema["required"] = ["first"]
    return schema


def _solid(type_name: str) -> Schema:
    schema = _typed(solid_fields(type_name), type_name)
    density = "line_density" if "line_density" in SOLID[type_name] else "density"
    return {**schema, "oneOf": [{"required": ["mass"]}, {"required": [density]}]}


def _body() -> Schema:
    given = [{"required": [key]} for key in ("mass", "solids", "points")]
    return {**_table(BODY), "anyOf": given}


def _element(what: str, types: Types, type_name: str) -> Schema:
    schema = _typed(types[type_name].fields(what, types), type_name)
    if types[type_name].one_of:
        schema["oneOf"] = [{"required": [key]} for key in types[type_name].one_of]
    return schema


def _section(entry: Schema, doc: str) -> Schema:
    return {
        "type": ["object", "null"],
        "propertyNames": _ref("name"),
        "additionalProperties": entry,
        "description": doc,
    }


def _short(section: str, fields: Fields) -> Schema:
    """An entry that may be written as the value of its main key alone."""
    alone: list[Schema] = [_field(fields[SHORT[section]])]
    if not fields[SHORT[section]].required:
        alone.append({"type": "null"})
    return {"anyOf": [*alone, _table(fields)]}


def model_schema() -> dict[str, Any]:
    """The JSON Schema of model files.

    Returns
    -------
    dict
        Plain data, ready for ``json.dumps``.  It describes the layout; names and expressions are judged by the check.
    """
    values = {**_section(_ref("expression"), ""), "propertyNames": _ref("reference")}
    sections: Schema = {
        "parameters": _section(_short("parameters", PARAMETER), MODEL["parameters"].doc),
        "inputs": _section(_short("inputs", INPUT), MODEL["inputs"].doc),
        "functions": _section(
            {"oneOf": [_typed(function_fields(name), name) for name in FUNCTION]}, MODEL["functions"].doc
        ),
        "bodies": _section(_body(), MODEL["bodies"].doc),
        "joints": _section({"oneOf": [_typed(joint_fields(name), name) for name in JOINTS]}, MODEL["joints"].doc),
        "forces": _section({"oneOf": [_element("force", FORCES, name) for name in FORCES]}, MODEL["forces"].doc),
        "contacts": _section(_contacts(), MODEL["contacts"].doc),
        "constraints": _section(
            {"oneOf": [_element("constraint", CONSTRAINTS, name) for name in CONSTRAINTS]}, MODEL["constraints"].doc
        ),
        "states": _section(_short("states", STATE), MODEL["states"].doc),
        "outputs": _section(_short("outputs", OUTPUT_FIELDS), MODEL["outputs"].doc),
        "events": _section(_short("events", EVENT), MODEL["events"].doc),
        "lagrangian": {**_table(LAGRANGIAN), "description": MODEL["lagrangian"].doc},
        "equations": {**_table(EQUATIONS), "description": MODEL["equations"].doc},
        "simulation": {**_table(SIMULATION), "description": MODEL["simulation"].doc},
        "initial": {**values, "description": MODEL["initial"].doc},
        "guess": {**values, "description": MODEL["guess"].doc},
    }
    sections["bodies"]["properties"] = {"ground": _table(GROUND)}
    sections["add"] = _section(_table(ADDED), MODEL["add"].doc)
    own = {key: sections[key] if field.kind == "table" else _field(field) for key, field in COMPONENT.items()}
    sections["components"] = _section(_object(own), MODEL["components"].doc)
    properties = {key: sections[key] if field.kind == "table" else _field(field) for key, field in MODEL.items()}
    properties["independent"]["items"] = _ref("reference")
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "eomgen model file",
        **_object(properties, [key for key, field in MODEL.items() if field.required]),
        "$defs": _definitions(),
    }
