"""Model files: what is refused before a model is looked at, limits, and a run without SymPy."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from eomgen import load
from eomgen.describe import yaml_nodes
from eomgen.describe.yaml_file import describe_yaml
from eomgen.describe.yaml_nodes import DEPTH, SIZE, scalar
from eomgen.errors import ModelError, UsageError

REFUSED = {
    "alias": ("name: a\ngravity: &g [0, 0, 0]\nindependent: *g\n", 2, "the anchor &g"),
    "undefined alias": ("name: *nothing\n", 1, "the alias *nothing"),
    "tag": ("name: a\ndoc: !!python/object/apply:os.system [ls]\n", 2, "the tag"),
    "own tag": ("name: !x a\n", 1, "the tag"),
    "duplicate key": ("name: a\nname: b\n", 2, "given twice, first in line 1"),
    "deep brackets": ("gravity: " + "[" * 5000, 1, "nested too deeply"),
    "deep braces": ("gravity: " + "{a: " * 5000, 1, "nested too deeply"),
    "deep blocks": ("".join(" " * k + "a:\n" for k in range(DEPTH + 5)), DEPTH + 2, "nested too deeply"),
    "key that is a list": ("? [a, b]\n: 1\n", 1, "a key is not a name"),
    "merge key": ("name: a\n<<: {doc: b}\n", 2, "unknown key"),
    "two documents": ("name: a\n---\nname: b\n", 3, "a second YAML document"),
    "empty": ("# nothing\n", 1, "the file is empty"),
    "list": ("- a\n", 1, "is not a mapping"),
    "scalar": ("hello\n", 1, "is not a mapping"),
    "tab": ("name: a\n\tdoc: b\n", 2, "not YAML"),
    "open quote": ('name: a\ndoc: "b\n', 3, "not YAML"),
    "open bracket": ("name: a\ngravity: [0, 0\n", 3, "not YAML"),
    "control character": ("name: a\ndoc: \x01\n", 2, "not YAML"),
    "colon": ("name: a\ndoc: a: b\n", 2, "not YAML"),
    "section of the wrong kind": ("name: a\nbodies: [b, c]\n", 2, "is not a mapping"),
    "text that a comma cut": ("name: a\nparameters: {r: {doc: length (m, in x)}}\n", 2, "needs quotes"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused(case: str, problems_of) -> None:
    text, line, message = REFUSED[case]
    problems = problems_of(text)
    found = [p for p in problems if message in str(p)]
    assert found, [str(p) for p in problems]
    assert found[0].line == line
    assert found[0].file.endswith("model.yaml")


def test_faults_of_the_file_and_of_the_model_come_together(problems_of) -> None:
    problems = problems_of("name: 1a\nbodies: &b {c: {mass: -1}}\nforses: {}\n")
    assert [p.path for p in problems] == ["name", "bodies", "bodies.c.mass", "bodies.c", "forses"]


def test_too_large(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "large.yaml"
    path.write_text("# " + "x" * SIZE)
    with pytest.raises(ModelError, match="too large"):
        load(path)
    monkeypatch.setattr(yaml_nodes, "NODES", 1000)
    many = "name: a\nindependent: [" + "a, " * 1000 + "a]\n"
    with pytest.raises(ModelError, match="too many values"):
        describe_yaml(many)


def test_not_text(tmp_path: Path) -> None:
    path = tmp_path / "binary.yaml"
    path.write_bytes(b"name: a\ndoc: \xff\xfe\n")
    with pytest.raises(ModelError, match=r"binary.yaml:2: file: is not UTF-8 text"):
        load(path)


def test_load_goes_by_the_suffix(tmp_path: Path, slider_crank_text: str) -> None:
    path = tmp_path / "model.yml"
    path.write_text(slider_crank_text)
    assert load(path).name == load(str(path)).name == "slider_crank"
    with pytest.raises(FileNotFoundError):
        load(tmp_path / "absent.yaml")
    for name, remedy in (("panda.sdf", "convert it to MJCF"), ("model", r"supported are \.yaml")):
        with pytest.raises(UsageError, match=remedy):
            load(tmp_path / name)


def test_scalars_of_yaml_1_2() -> None:
    assert [scalar(x) for x in ("1", "-3", "0x1f", "0o17", "1e3", "1e-9", ".5", "2.", "+1.5E+2")] == [
        1, -3, 31, 15, 1000.0, 1e-9, 0.5, 2.0, 150.0,
    ]  # fmt: skip
    assert [scalar(x) for x in ("yes", "on", "1_000", "12:30", "2001-01-01", "-g", "08x")] == [
        "yes", "on", "1_000", "12:30", "2001-01-01", "-g", "08x",
    ]  # fmt: skip
    assert [scalar(x) for x in ("true", "null", "~", "")] == [True, None, None, None]


def test_ground_may_have_markers(change, write) -> None:
    text = change("  slider: {mass: m_s}", "  slider: {mass: m_s}\n  ground: {markers: {wall: [0.5, 0, 0]}}")
    text = text.replace("{body: ground, at: [0.5, 0, 0]}", "ground.wall")
    m = load(write(text)).mechanism()
    assert m.forces[0].name == "motor"
    assert m.forces[1].path.start.label == "ground.wall"  # type: ignore[attr-defined]
    assert len(m.bodies) == 3


def test_a_bare_lagrangian_in_a_file(write, problems_of) -> None:
    text = """\
name: pendulum
parameters: {m: 1, l: 0.5, g: 9.81, c: 0.1}
inputs: {tau: 0}
lagrangian:
  coordinates: [theta]
  expression: m*l**2*theta_dot**2/2 + m*g*l*cos(theta)
  forces: {theta: tau}
  dissipation: c*theta_dot**2/2
outputs: {height: -l*cos(theta), theta: theta}
initial: {theta: pi/3}
"""
    m = load(write(text)).mechanism()
    assert m.lagrangian is not None
    assert m.lagrangian.coordinates == ("theta",)
    assert m.lagrangian.forces == (m.graph.symbol("tau"),)
    assert m.lagrangian.constraints == ()
    assert not m.bodies
    bad = text.replace("forces: {theta: tau}", "forces: [tau, tau]\n  constraints: theta").replace("+ m*g", "+ mm*g")
    assert [(p.line, p.path) for p in problems_of(bad)] == [
        (6, "lagrangian.expression"),
        (7, "lagrangian.forces"),
        (8, "lagrangian.constraints"),
    ]


WITHOUT_SYMPY = """
import sys
class Refuse:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in ("sympy", "scipy", "matplotlib", "pandas", "jinja2"):
            raise ImportError(name + " is refused here")
sys.meta_path.insert(0, Refuse())
from eomgen import load
from eomgen.errors import ModelError
m = load(sys.argv[1])
print(m.mechanism().name, m.joints["A"].coordinate_names, len(m.to_yaml()) > 100)
m.description.values["initial"]["oops"] = 1
try:
    m.mechanism()
except ModelError as error:
    print(error)
print("sympy" in sys.modules)
"""


def test_a_file_needs_no_sympy(slider_crank_text: str, write) -> None:
    path = write(slider_crank_text)
    result = subprocess.run(
        [sys.executable, "-c", WITHOUT_SYMPY, str(path)], capture_output=True, text=True, check=True, timeout=600
    )
    first, second, third = result.stdout.splitlines()
    assert first == "slider_crank ('theta',) True"
    assert second.startswith(f"{path}:25: initial.oops: no coordinate, velocity or output 'oops'")
    assert third == "False"
