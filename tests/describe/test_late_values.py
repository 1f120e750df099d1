"""Numbers that elements do not allow: as a number, as a text, as a declared parameter and given late, one refusal."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from late_cases import CASES, Judged

import eomgen as eg
from eomgen.errors import ModelError, ParameterError, Problem
from eomgen.program.kept_rules import keep_rules
from eomgen.runtime.allowed_parameters import require_allowed

ROOT = Path(eg.__file__).parent
BODY = {"mass": 1.0, "inertia": {"zz": 0.1}}
GIVEN = " with p = "
READ: dict[str, Any] = {}


def scene(case: Judged, value: Any, parameter: float | None = None, declared: bool = False) -> dict[str, Any]:
    """Two links on the ground and a free body, with the element of a case."""
    text = json.dumps(case.entry)
    number = json.dumps(value)
    inner = value if isinstance(value, str) else f"({value!r})"
    text = text.replace('"@"', number).replace("@", inner)
    found: dict[str, Any] = {
        "name": "scene",
        "bodies": {"a": BODY, "b": BODY, "c": {"mass": 1.0, "inertia": [0.1, 0.1, 0.1]}},
        "joints": {
            "ja": {"type": "revolute", "between": ["ground", "a"], "coordinate": "alpha"},
            "jb": {"type": "revolute", "between": ["ground", "b"], "coordinate": "beta"},
            "jc": {"type": "free", "between": ["ground", "c"]},
        },
    }
    if declared:
        found["parameters"] = {"p": {} if parameter is None else parameter}
    entry = json.loads(text)
    if case.section == "joints" and "d" in entry["between"]:
        found["bodies"] = found["bodies"] | {"d": BODY}
    if case.section == "bodies":
        found["joints"]["jx"] = {"type": "free", "between": ["ground", "x"]}
    if case.section == "states":
        entry["sampled"] = "alpha"
    found[case.section] = {**found.get(case.section, {}), "x": entry}
    return found


def mechanism_of(tmp_path: Path, description: dict[str, Any]) -> Any:
    """The mechanism of a file with this description, or what is wrong with it; each is read once."""
    text = json.dumps(description)
    if text not in READ:
        READ.clear() if len(READ) > 20 else None
        file = tmp_path / "scene.yaml"
        file.write_text(text)
        try:
            READ[text] = eg.load(file).mechanism()
        except ModelError as error:
            READ[text] = list(error.problems)
    return READ[text]


def problems_of(tmp_path: Path, description: dict[str, Any]) -> list[Problem]:
    found = mechanism_of(tmp_path, description)
    return found if isinstance(found, list) else []


def late(tmp_path: Path, description: dict[str, Any], value: float) -> list[Problem]:
    """What is said of a value of p that a module of the model is given later."""
    mechanism = mechanism_of(tmp_path, description)
    names = [p.name for p in mechanism.parameters]
    metadata = json.loads(json.dumps({"p_names": names, **keep_rules(mechanism.requirements, names)}))
    try:
        require_allowed(metadata, np.array([value]))
    except ParameterError as error:
        return list(error.problems)
    return []


def told(problems: list[Problem]) -> set[tuple[str, str, str]]:
    """Where, what and the remedy, without what is said of values of parameters."""
    plain = []
    for path, message, remedy, *_ in problems:
        what = message.partition(GIVEN)[0].removesuffix(" at the declared values")
        plain.append((path, what, remedy))
    return set(plain)


@pytest.mark.parametrize("case", CASES, ids=str)
def test_one_refusal_however_a_number_is_given(case: Judged, tmp_path: Path) -> None:
    place = f"{case.section}.x.{case.place}"
    assert problems_of(tmp_path, scene(case, case.good)) == []
    assert problems_of(tmp_path, scene(case, "p", case.good, declared=True)) == []
    assert late(tmp_path, scene(case, "p", case.good, declared=True), case.good) == []
    assert late(tmp_path, scene(case, "p", declared=True), case.good) == []
    for bad in case.bad:
        number = problems_of(tmp_path, scene(case, bad))
        assert any(path == place or path.startswith(place) for path, *_ in number), number
        assert told(problems_of(tmp_path, scene(case, f"({bad!r} + 0)"))) == told(number) or "negative" in str(number)
        declared = problems_of(tmp_path, scene(case, "p", bad, declared=True))
        assert {p for p, *_ in told(declared)} == {p for p, *_ in told(number)}
        for start in (case.good, None):
            given = late(tmp_path, scene(case, "p", start, declared=True), bad)
            assert told(given) >= told(declared), (given, declared)
            assert {path for path, *_ in given} >= {path for path, *_ in number}
            assert all(f"{GIVEN}{bad:.6g}" in problem.message for problem in given)
    expression = f"2*p - {case.good}"  # through an expression, so that no range of a parameter tells
    for bad in case.bad:
        through = late(tmp_path, scene(case, f"({expression})", case.good, declared=True), (bad + case.good) / 2)
        assert any(path.startswith(place) for path, *_ in through)


def test_every_number_that_an_element_judges_has_a_case() -> None:
    """Keys that sources name where they judge: each must stand in the table."""
    named = {key for case in CASES for key in re.findall(r"\w+", case.place)} - {"first"}
    found: dict[str, str] = {}
    for folder in ("forces", "constraints", "joints"):
        for file in sorted((ROOT / folder).glob("*.py")):
            for key in re.findall(r'e\.(?:positive|require|judge|sizes)\(\s*f?"([a-z_]+)', file.read_text()):
                found[key] = file.name
    assert len(found) > 35
    assert {key: file for key, file in found.items() if key not in named} == {}
