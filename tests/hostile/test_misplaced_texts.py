"""Nasty texts where no text belongs: names, keys, expressions, words, files; each is refused by name and place."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.sax import saxutils

import pytest
from hostile.held_texts import PLACES, assert_held, described, model_of
from hostile.nasty_texts import LONE, NASTY, PAIR
from sweeps import part_of

import eomgen as eg
from eomgen import texts
from eomgen.describe.yaml_file import describe_yaml
from eomgen.errors import EomgenError, ModelError


def paths(value: Any, at: tuple[Any, ...] = ()) -> Iterator[tuple[tuple[Any, ...], bool]]:
    """Places of all values, and of all keys, of a model file's data."""
    if isinstance(value, dict | list):
        for key, part in value.items() if isinstance(value, dict) else enumerate(value):
            if isinstance(value, dict):
                yield (*at, key), True
            yield from paths(part, (*at, key))
    else:
        yield at, False


def changed(value: Any, at: tuple[Any, ...], text: str, is_key: bool) -> Any:
    """The data with a text in place of one value or key."""
    head, rest = at[0], at[1:]
    if isinstance(value, list):
        return [
            changed(part, rest, text, is_key) if k == head and rest else text if k == head else part
            for k, part in enumerate(value)
        ]
    if rest:
        return {k: changed(part, rest, text, is_key) if k == head else part for k, part in value.items()}
    return {
        text if is_key and k == head else k: text if k == head and not is_key else part for k, part in value.items()
    }


#: Models that have the other sections; their doc is no text field of the table, so that every position is tried.
OTHERS: dict[str, Any] = {
    "held": described(""),
    "mechanism": {
        "name": "mechanism",
        "parameters": {"m": 1.0},
        "functions": {"f": {"type": "table", "x": [0, 1, 2], "y": [0, 1, 4], "kind": "cubic"}},
        "bodies": {
            "a": {"mass": "m", "inertia": [1, 1, 1]},
            "b": {"mass": "m", "points": [{"mass": 1, "at": [1, 0, 0]}]},
        },
        "joints": {
            "A": {"type": "revolute", "between": ["ground", "a"], "limits": {"lower": -1}},
            "B": {"type": "cylindrical", "between": [{"body": "a", "at": [1, 0, 0]}, "b"], "coordinates": ["s", "w"]},
        },
        "forces": {"k": {"type": "spring", "between": ["ground", "b"], "stiffness": "f(m)"}},
        "constraints": {"c": {"type": "coupling", "coordinates": {"A": 1, "w": 2}}},
        "events": {"e": {"expression": "A", "reset": {"A_dot": "-A_dot"}, "terminal": 2}},
        "guess": {"A": 0.1},
        "independent": ["A", "s"],
    },
    "bare": {
        "name": "bare",
        "parameters": {"k": 1.0},
        "lagrangian": {"coordinates": ["a", "b"], "expression": "a_dot**2 + b_dot**2 - k*a", "forces": {"a": "k"}},
    },
    "given": {
        "name": "given",
        "equations": {
            "coordinates": ["q"],
            "velocities": ["v"],
            "rates": {"q": "v"},
            "intermediates": {"z": "q**2"},
            "mass_matrix": [[1]],
            "forcing": ["-z"],
        },
    },
}
POSITIONS = [(model, *found) for model, data in OTHERS.items() for found in paths(data)]


def is_text_field(at: tuple[Any, ...]) -> bool:
    dotted = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in at)[1:]
    return dotted in PLACES.values()


@pytest.mark.parametrize("model", OTHERS)
def test_the_models_are_right_without_nasty_texts(model: str) -> None:
    assert model_of(OTHERS[model]).mechanism().name == model


@pytest.mark.parametrize("turn", part_of(range(4), lambda turn: turn == 0))
@pytest.mark.parametrize(
    ("model", "at", "is_key"),
    [pytest.param(*where, id=f"{where[0]}-{'.'.join(map(str, where[1]))}-{where[2]}") for where in POSITIONS],
)
def test_everywhere_else_a_nasty_text_is_refused_by_name(
    model: str, at: tuple[Any, ...], is_key: bool, turn: int
) -> None:
    """A few of the texts in each place, the next in the next: each text in about nine places in a turn."""
    start = (POSITIONS.index((model, at, is_key)) + 6 * turn) % 24
    for text in [*NASTY.values()][start::24]:
        hostile = changed(OTHERS[model], at, text, is_key)
        if is_text_field(at) and not is_key:
            model_of(hostile).mechanism()
            continue
        with pytest.raises(ModelError) as caught:
            model_of(hostile).mechanism()
        for problem in caught.value.problems:
            assert texts.visible(str(problem), lines=False) == str(problem)
            assert len(str(problem)) < 10_000


@pytest.mark.parametrize("key", NASTY)
def test_names_in_a_robot_become_identifiers(key: str, tmp_path: Path) -> None:
    text = re.sub(r"[^\t\n\r -\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]", "", NASTY[key])  # what XML can hold
    shown = saxutils.quoteattr(text, {"\n": "&#10;", "\r": "&#13;", "\t": "&#9;"})
    inertial = "<inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/></inertial>"
    path = tmp_path / "robot.urdf"
    path.write_text(
        f"<robot name={shown}><link name='base'/><link name={shown}>{inertial}</link>"
        f"<joint name={shown} type='continuous'><parent link='base'/><child link={shown}/><axis xyz='0 1 0'/></joint>"
        "</robot>",
        encoding="utf-8",
    )
    try:
        model = eg.load(path)
        mechanism = model.mechanism()
    except EomgenError as error:
        assert texts.visible(str(error)) == str(error)
        return
    for name in (mechanism.name, *(b.name for b in mechanism.bodies), *(j.name for j in mechanism.joints)):
        assert re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,63}", name)
    written = model.to_yaml()
    assert texts.visible(written) == written
    assert eg.Model.from_description(describe_yaml(written)).mechanism().name == mechanism.name


def test_half_of_a_pair_is_refused_where_it_stands_and_a_pair_is_a_character() -> None:
    for place in filter(None, PLACES.values()):
        at = tuple(int(part) if part.isdigit() else part for part in re.findall(r"\w+", place))
        for text in LONE.values():
            with pytest.raises(ModelError, match=r"contains U\+D[0-9A-F]{3}, which is half of a") as caught:
                model_of(changed(described(""), at, text, False)).mechanism()
            assert caught.value.problems[0].path == place
    model = model_of(described(PAIR))
    assert model.mechanism().doc == "\N{GRINNING FACE}"
    assert_held(model.compile(target="numpy", kernels=["rhs"]).metadata, "\N{GRINNING FACE}")


def test_in_python_texts_are_judged_as_in_a_file() -> None:
    for text in (*LONE.values(), PAIR):
        model = eg.Model("held", doc=text)
        unit = "m" if text == PAIR else text  # a pair is a character, but no unit
        model.parameter("l", 1.0, unit=unit, doc=text)
        body = model.body("rod", mass=1.0, inertia={"zz": 1.0})
        model.revolute("A", model.ground, body)
        model.output("y", "l", unit=unit, doc=text)
        if text == PAIR:
            assert model.mechanism().outputs[0].doc == "\N{GRINNING FACE}"
            assert "\N{GRINNING FACE}" in model.to_yaml() or "\\ud83d" in model.to_yaml()
            continue
        with pytest.raises(ModelError) as caught:
            model.mechanism()
        assert {p.path for p in caught.value.problems} == {
            "doc", "parameters.l.unit", "parameters.l.doc", "outputs.y.unit", "outputs.y.doc"
        }  # fmt: skip


@pytest.mark.parametrize("key", NASTY)
def test_a_nasty_file_name_is_an_error_with_a_name(key: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    model = eg.Model("held")
    model.body("rod", solids=[{"type": "mesh", "file": NASTY[key], "density": 1.0}])
    model.native("f", NASTY[key], python=NASTY[key])
    with pytest.raises(ModelError) as caught:
        model.mechanism()
    assert {"bodies.rod.solids[0].file", "functions.f.source"} <= {p.path for p in caught.value.problems}
    assert texts.visible(str(caught.value)) == str(caught.value)
    with pytest.raises((EomgenError, OSError)):
        eg.load(NASTY[key])
