"""The table of fields -> the JSON Schema of the model file (draft 2020-12)."""

from __future__ import annotations

from typing import Any

from ..constraints import CONSTRAINTS
from ..elements.element_type import Types
from ..elements.kinds import Fields, Schema, Table, definitions, object_schema, ref, table_schema, typed_schema
from ..forces import FORCES
from ..joints import JOINTS
from .fields import (
    ADDED,
    BODY,
    COMPONENT,
    EQUATIONS,
    EVENT,
    FUNCTION,
    GROUND,
    INPUT,
    LAGRANGIAN,
    MODEL,
    OUTPUT_FIELDS,
    PARAMETER,
    SHORT,
    SIMULATION,
    STATE,
    function_fields,
    joint_fields,
)


def _contacts() -> Schema:
    """An entry of the section contacts: keys of the type, its law one by one or as a mapping."""
    schema = _element("force", FORCES, "contacts")
    del schema["properties"]["type"]
    schema["required"] = ["first"]
    return schema


def _body() -> Schema:
    given = [{"required": [key]} for key in ("mass", "solids", "points")]
    return {**table_schema(BODY), "anyOf": given}


def _element(what: str, types: Types, type_name: str) -> Schema:
    schema = typed_schema(types[type_name].fields(what, types), type_name)
    if types[type_name].one_of:
        schema["oneOf"] = [{"required": [key]} for key in types[type_name].one_of]
    return schema


def _section(entry: Schema, doc: str) -> Schema:
    return {
        "type": ["object", "null"],
        "propertyNames": ref("name"),
        "additionalProperties": entry,
        "description": doc,
    }


def _short(section: str, fields: Fields) -> Schema:
    """An entry that may be written as the value of its main key alone."""
    alone: list[Schema] = [fields[SHORT[section]].json()]
    if not fields[SHORT[section]].required:
        alone.append({"type": "null"})
    return {"anyOf": [*alone, table_schema(fields)]}


def model_schema() -> dict[str, Any]:
    """The JSON Schema of model files.

    Returns
    -------
    dict
        Plain data, ready for ``json.dumps``.  It describes the layout; names and expressions are judged by the check.
    """
    values = {**_section(ref("expression"), ""), "propertyNames": ref("reference")}
    sections: Schema = {
        "parameters": _section(_short("parameters", PARAMETER), MODEL["parameters"].doc),
        "inputs": _section(_short("inputs", INPUT), MODEL["inputs"].doc),
        "functions": _section(
            {"oneOf": [typed_schema(function_fields(name), name) for name in FUNCTION]}, MODEL["functions"].doc
        ),
        "bodies": _section(_body(), MODEL["bodies"].doc),
        "joints": _section({"oneOf": [typed_schema(joint_fields(name), name) for name in JOINTS]}, MODEL["joints"].doc),
        "forces": _section({"oneOf": [_element("force", FORCES, name) for name in FORCES]}, MODEL["forces"].doc),
        "contacts": _section(_contacts(), MODEL["contacts"].doc),
        "constraints": _section(
            {"oneOf": [_element("constraint", CONSTRAINTS, name) for name in CONSTRAINTS]}, MODEL["constraints"].doc
        ),
        "states": _section(_short("states", STATE), MODEL["states"].doc),
        "outputs": _section(_short("outputs", OUTPUT_FIELDS), MODEL["outputs"].doc),
        "events": _section(_short("events", EVENT), MODEL["events"].doc),
        "lagrangian": {**table_schema(LAGRANGIAN), "description": MODEL["lagrangian"].doc},
        "equations": {**table_schema(EQUATIONS), "description": MODEL["equations"].doc},
        "simulation": {**table_schema(SIMULATION), "description": MODEL["simulation"].doc},
        "initial": {**values, "description": MODEL["initial"].doc},
        "guess": {**values, "description": MODEL["guess"].doc},
    }
    sections["bodies"]["properties"] = {"ground": table_schema(GROUND)}
    sections["add"] = _section(table_schema(ADDED), MODEL["add"].doc)
    own = {key: sections[key] if isinstance(field, Table) else field.json() for key, field in COMPONENT.items()}
    sections["components"] = _section(object_schema(own), MODEL["components"].doc)
    properties = {key: sections[key] if isinstance(field, Table) else field.json() for key, field in MODEL.items()}
    properties["independent"]["items"] = ref("reference")
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "eomgen model file",
        **object_schema(properties, [key for key, field in MODEL.items() if field.required]),
        "$defs": definitions(),
    }
