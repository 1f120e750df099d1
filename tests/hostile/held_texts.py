"""A model with a text in every text field, and all that is generated from it; made once for each nasty text."""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import cache
from typing import Any

from hostile.nasty_texts import NASTY

import eomgen as eg
from eomgen import pipeline
from eomgen.api.equations import Equations
from eomgen.describe import fields
from eomgen.describe.yaml_file import describe_yaml
from eomgen.elements.field import Field
from eomgen.emit import emit_package
from eomgen.program import Program

#: Table and key of every text -> where the model below holds it; None: a file that is read, see the last tests.
PLACES: dict[tuple[str, str], str | None] = {
    ("MODEL", "doc"): "doc",
    ("PARAMETER", "doc"): "parameters.l.doc",
    ("INPUT", "doc"): "inputs.tau.doc",
    ("OUTPUT_FIELDS", "doc"): "outputs.y.doc",
    ("STATE", "doc"): "states.z.doc",
    ("EVENT", "doc"): "events.low.doc",
    ("DISPLAY", "file"): "bodies.rod.display[0].file",
    ("DISPLAY", "color"): None,  # only "#rrggbb" is taken
    ("COMPONENT", "doc"): None,  # nothing of it stands in the model that a component becomes
    ("COMPONENT", "file"): None,
    ("FUNCTION", "source"): None,
    ("FUNCTION", "python"): None,
    ("SOLID", "file"): None,
}


def described(text: str, name: str = "held") -> dict[str, Any]:
    """A model file's data with a text in every text field that is not the name of a file to read."""
    return {
        "name": name,
        "doc": text,
        "gravity": [0, "-9.81", 0],
        "parameters": {"l": {"value": 0.5, "unit": "m", "doc": text}},
        "inputs": {"tau": {"value": 0.0, "unit": "N*m", "doc": text}},
        "bodies": {
            "rod": {
                "mass": 1.0,
                "com": ["l/2", 0, 0],
                "inertia": {"zz": 0.1},
                "markers": {"tip": {"at": ["l", 0, 0]}},
                "display": [{"shape": "mesh", "file": text}],
            }
        },
        "joints": {"A": {"type": "revolute", "between": ["ground", "rod"], "coordinate": "theta", "axis": "z"}},
        "forces": {"motor": {"type": "torque", "joint": "A", "value": "tau"}},
        "states": {"z": {"rate": "-z", "doc": text}},
        "outputs": {"y": {"expression": "y(rod.tip)", "unit": "m", "doc": text}},
        "events": {"low": {"expression": "y(rod.tip)", "doc": text}},
        "initial": {"theta": 0.3},
        "simulation": {"end": 1, "method": "DOP853"},
    }


def model_of(data: Any) -> eg.Model:
    """The model of a file that holds the data as JSON, which is YAML; surrogates are escaped."""
    return eg.Model.from_description(describe_yaml(json.dumps(data), "model.yaml"))


@cache
def equations_of(key: str) -> Equations:
    return model_of(described(NASTY[key], f"m{list(NASTY).index(key)}")).derive()


@cache
def program_of(key: str, target: str) -> Program:
    return pipeline.build(equations_of(key), target)


@cache
def files_of(key: str, target: str) -> dict[str, str]:
    return dict(emit_package(program_of(key, target), target))


def text_fields() -> Iterator[tuple[str, str]]:
    """Table and key of every field that holds a text or the name of a file, in all tables there are."""
    for module in (fields,):
        for table, value in vars(module).items():
            if table.isupper() and isinstance(value, dict):
                inner = [value, *(part for part in value.values() if isinstance(part, dict))]
                for keys in inner:
                    yield from (
                        (table, k) for k, f in keys.items() if isinstance(f, Field) and f.kind in ("text", "file")
                    )


def assert_held(metadata: dict[str, Any], text: str) -> None:
    """Metadata has the text where the model has it, unchanged."""
    assert metadata["doc"] == text
    assert {name: metadata["docs"].get(name, "") for name in ("l", "tau", "y")} == dict.fromkeys(
        ("l", "tau", "y"), text
    )
    assert metadata["events"][0]["doc"] == text
