"""Nasty texts where no text belongs: names, keys, expressions, words, files; each is refused by name and place."""

import json
import re
from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path
from typing import Any
from xml.sax import saxutils

import command
import pytest
from attack.nasty_texts import NASTY
from attack.yaml_files import at, paths
from model_files import load
from ruamel.yaml import YAML

import eomgen as eg

#: Models that together have every section of a file.
TEXTS = """
name: held
gravity: [0, "-9.81", 0]
parameters: {l: {value: 0.5, unit: m}}
inputs: {tau: {value: 0.0, unit: N*m}}
bodies:
  rod: {mass: 1.0, com: [l/2, 0, 0], inertia: {zz: 0.1}, markers: {tip: {at: [l, 0, 0]}},
    display: [{shape: box, size: [1, 1, 1]}]}
joints: {A: {type: revolute, between: [ground, rod], coordinate: theta, axis: z}}
forces: {motor: {type: torque, joint: A, value: tau}}
states: {z: {rate: -z}}
outputs: {y: {expression: y(rod.tip), unit: m}}
events: {low: {expression: y(rod.tip)}}
initial: {theta: 0.3}
simulation: {end: 1, method: DOP853}
---
name: mechanism
parameters: {m: 1.0}
functions: {f: {type: table, x: [0, 1, 2], y: [0, 1, 4], kind: cubic}}
bodies:
  a: {mass: m, inertia: [1, 1, 1]}
  b: {mass: m, points: [{mass: 1, at: [1, 0, 0]}]}
joints:
  A: {type: revolute, between: [ground, a], limits: {lower: -1}}
  B: {type: cylindrical, between: [{body: a, at: [1, 0, 0]}, b], coordinates: [s, w]}
forces: {k: {type: spring, between: [ground, b], stiffness: f(m)}}
constraints: {c: {type: coupling, coordinates: {A: 1, w: 2}}}
events: {e: {expression: A, reset: {A_dot: -A_dot}, terminal: 2}}
guess: {A: 0.1}
independent: [A, s]
---
name: bare
parameters: {k: 1.0}
lagrangian: {coordinates: [a, b], expression: a_dot**2 + b_dot**2 - k*a, forces: {a: k}}
---
name: given
equations: {coordinates: [q], velocities: [v], rates: {q: v}, intermediates: {z: q**2}, mass_matrix: [[1]], forcing: [-z]}
"""
MODELS: dict[str, Any] = {data["name"]: data for data in YAML(typ="safe", pure=True).load_all(TEXTS)}


def places(data: Any) -> Iterator[tuple[tuple[Any, ...], bool]]:
    """Places of all values, and of all keys, of a model file's data."""
    for place in [*paths(data)][1:]:
        if isinstance(at(data, place[:-1]), dict):
            yield place, True
        if not isinstance(at(data, place), dict | list):
            yield place, False


def changed(data: Any, place: tuple[Any, ...], text: str, is_key: bool) -> Any:
    """The data with a text in place of one value or key."""
    data, last = deepcopy(data), place[-1]
    holder = at(data, place[:-1])
    if is_key:
        items = [(text if key == last else key, value) for key, value in holder.items()]
        holder.clear()
        holder.update(items)
    else:
        holder[last] = text
    return data


@pytest.mark.parametrize("every", [44, pytest.param(6, marks=pytest.mark.thorough)])
@pytest.mark.parametrize("name", [pytest.param("bare", marks=pytest.mark.quick), "given", "held", "mechanism"])
def test_a_nasty_text_is_refused_by_name(name: str, every: int, tmp_path: Path) -> None:
    """A few of the texts in each place, the next in the next."""
    assert load(tmp_path, json.dumps(MODELS[name])).mechanism().name == name
    for number, (place, is_key) in enumerate(places(MODELS[name])):
        for text in [*NASTY.values()][number % every :: every]:
            with pytest.raises(eg.ModelError) as caught:
                load(tmp_path, json.dumps(changed(MODELS[name], place, text, is_key))).mechanism()
            for problem in caught.value.problems:
                assert str(problem).isprintable(), (place, text)
                assert len(str(problem)) < 10_000


def test_names_in_a_robot_become_identifiers(tmp_path: Path) -> None:
    inertial = "<inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/></inertial>"
    path, taken = tmp_path / "robot.urdf", 0
    for text in NASTY.values():
        text = re.sub(r"[^\t\n\r -\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]", "", text)  # what XML can hold
        shown = saxutils.quoteattr(text, {"\n": "&#10;", "\r": "&#13;", "\t": "&#9;"})
        path.write_text(
            f"<robot name={shown}><link name='base'/><link name={shown}>{inertial}</link>"
            f"<joint name={shown} type='continuous'><parent link='base'/><child link={shown}/><axis xyz='0 1 0'/></joint>"
            "</robot>",
            encoding="utf-8",
        )
        try:
            model = eg.load(path)
            mechanism = model.mechanism()
        except eg.EomgenError as error:
            assert all(c.isprintable() or c == "\n" for c in str(error))
            continue
        taken += 1
        for name in (mechanism.name, *(b.name for b in mechanism.bodies), *(j.name for j in mechanism.joints)):
            assert re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,63}", name)
        model.save(tmp_path / "again.yaml")
        assert eg.load(tmp_path / "again.yaml").mechanism().name == mechanism.name
    assert taken > len(NASTY) / 2


def test_a_nasty_file_name_is_an_error_with_a_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for text in NASTY.values():
        model = eg.Model("held")
        model.body("rod", solids=[{"type": "mesh", "file": text, "density": 1.0}])
        model.native("f", text, python=text)
        with pytest.raises(eg.ModelError) as caught:
            model.mechanism()
        assert {"bodies.rod.solids[0].file", "functions.f.source"} <= {p.path for p in caught.value.problems}
        assert all(c.isprintable() or c == "\n" for c in str(caught.value))
        with pytest.raises((eg.EomgenError, OSError)):
            eg.load(text)


# -- names of models, which become names of functions and files --------------------------------------------------------
WORD = "zzname"


@pytest.mark.parametrize("target", ["c", "cython"])
def test_no_name_of_a_model_makes_a_name_that_is_there(target: str, tmp_path: Path) -> None:
    """Nor a file: where the name would have to be one that generated code has, the model is refused."""
    example = (Path(__file__).parents[2] / "examples" / "cam_follower.yaml").read_text()
    (tmp_path / "model.yaml").write_text(re.sub(r"^name: .*$", f"name: {WORD}", example, flags=re.MULTILINE))
    assert command.run("generate", "model.yaml", "--out", ".", "--target", target, cwd=tmp_path).code == 0
    files = [file for file in (tmp_path / WORD).rglob("*") if file.is_file()]
    there = {file.name.lower() for file in files if file.parent.name == WORD}
    for file in files:
        # in a module what lies in several files is not linked by name, nor are static functions of the solvers
        if target == "c" and file.suffix in (".c", ".h") and file.name != "eomgen_solvers.c":
            bare = re.sub(r'/\*.*?\*/|"(\\.|[^"\\\n])*"', " ", file.read_text(), flags=re.DOTALL)
            # members are no names, nor what the list of the solvers joins with "eom_"
            bare = re.sub(r"typedef struct \{.*?\}|->\w+|\bX\(\w+\)", " ", bare, flags=re.DOTALL)
            there |= set(re.findall(r"[A-Za-z_]\w*", bare))
    own = {word for word in there if WORD in word.lower()}
    assert len(own) > 2
    names = set()
    for word in own - {WORD}:
        start, _, end = re.split(f"({WORD})", word, maxsplit=1, flags=re.IGNORECASE)
        for other in there - own:
            if len(other) > len(start + end) and other.startswith(start) and other.endswith(end):
                names.add(other[len(start) : len(other) - len(end)].lower())
    names |= {"eomgen", "eomgen_real", "eom", "eom_x", "EOMGEN_x", "Python", "python", "structmember", "errors"}
    for name in sorted(names):
        with pytest.raises(eg.ModelError) as caught:
            eg.Model(name).mechanism()
        assert "name" in {problem.path for problem in caught.value.problems}, name
