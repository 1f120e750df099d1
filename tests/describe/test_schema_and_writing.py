"""The JSON Schema follows from the table of fields, and a written model reads back as itself."""

from __future__ import annotations

import json
import math
from importlib.resources import files
from pathlib import Path

import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st
from jsonschema import Draft202012Validator

from eomgen import Model, load
from eomgen.describe import model_schema
from eomgen.describe.fields import MODEL
from eomgen.describe.sympy_text import sympy_text
from eomgen.describe.write_yaml import _text
from eomgen.describe.yaml_file import describe_yaml
from eomgen.describe.yaml_nodes import Document, scalar
from eomgen.errors import UsageError
from eomgen.forces import FORCES
from eomgen.graph import Graph, evaluate
from eomgen.joints import JOINTS

VALIDATOR = Draft202012Validator(model_schema())


def faults(text: str) -> list[str]:
    return [".".join(map(str, e.absolute_path)) for e in VALIDATOR.iter_errors(Document(text, "m.yaml").value)]


def test_the_schema_is_a_schema_and_plain_data() -> None:
    Draft202012Validator.check_schema(model_schema())
    assert json.loads(json.dumps(model_schema())) == model_schema()
    assert model_schema() == model_schema()


def test_the_schema_accepts_the_documented_model(slider_crank_text: str) -> None:
    assert faults(slider_crank_text) == []


def test_the_schema_knows_every_joint_and_force() -> None:
    properties = model_schema()["properties"]
    assert list(properties) == list(MODEL)
    for section, table in (("joints", JOINTS), ("forces", FORCES)):
        types = [s["properties"]["type"]["const"] for s in properties[section]["additionalProperties"]["oneOf"]]
        assert types == list(table)


@pytest.mark.parametrize(
    ("old", "new", "where"),
    [
        ("type: prismatic", "type: prismatik", "joints.D"),
        ("axis: x", "axes: x", "joints.D"),
        ("stiffness: 200, ", "", "forces.k1"),
        ("joint: A, value", "joint: A, body: rod, value", "forces.motor"),
        ("mass: m_s", "com: [0, 0, 0]", "bodies.slider"),
        ("name: slider_crank", "nam: slider_crank", ""),
        ("end: 5", "end: -5", "simulation.end"),
        ("method: DOP853", "method: DOP", "simulation.method"),
        ("[0, -g, 0]", "[0, -g]", "gravity"),
    ],
)
def test_the_schema_refuses(old: str, new: str, where: str, change) -> None:
    assert where in faults(change(old, new))


def examples() -> list[Path]:
    return sorted(Path(str(files("eomgen.examples"))).glob("*.yaml"))


@pytest.mark.parametrize("path", examples(), ids=lambda path: path.stem)
def test_the_shipped_examples(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert faults(text) == []
    m = load(path)
    mechanism = m.mechanism()
    mechanism.require_values()
    assert mechanism.name == path.stem


def test_a_written_model_reads_back(slider_crank: Model, write) -> None:
    slider_crank.output("even", sympy.Piecewise((1, sympy.Symbol("theta") > 0), (sympy.Abs(sympy.Symbol("s")), True)))
    slider_crank.parameter("odd", 0.1 + 0.2, unit="N*m", doc="a text: with # signs, and 'quotes'")
    slider_crank.parameter("third")
    text = slider_crank.to_yaml()
    assert faults(text) == []
    again = load(write(text))
    assert again.to_yaml() == text
    a, b = slider_crank.mechanism(), again.mechanism()
    assert [(p.name, p.value, p.unit, p.doc) for p in a.parameters] == [
        (p.name, p.value, p.unit, p.doc) for p in b.parameters
    ]
    values = {"s": -2.0, "theta": -0.5}
    assert evaluate([b.outputs[2].expression], values) == evaluate([a.outputs[2].expression], values) == [2.0]
    assert "B: {type: revolute, between: [{body: crank, at: [r, 0, 0]}, rod]}" in text


def test_save(slider_crank: Model, tmp_path: Path) -> None:
    slider_crank.save(tmp_path / "m.yaml")
    assert load(tmp_path / "m.yaml").mechanism().name == "slider_crank"


def test_a_lagrangian_can_be_written(write) -> None:
    q = sympy.Function("q")(sympy.Symbol("t"))
    m = Model.from_lagrangian(
        "p", q.diff() ** 2 / 2 - sympy.cos(q), [q], forces={q: sympy.exp(-q)}, constraints=[q - 1]
    )
    again = load(write(m.to_yaml())).mechanism().lagrangian
    assert again is not None
    assert evaluate([again.expression, *again.forces], {"q": 0.0, "q_dot": 2.0}) == [1.0, 1.0]


x, y = sympy.symbols("x y")


@pytest.mark.parametrize(
    "expression",
    [
        x**2 / 3 - sympy.sqrt(y) * sympy.pi,
        sympy.Max(x, y, 1) + sympy.Min(x, -y),
        sympy.Abs(x) * sympy.sign(y) + sympy.Heaviside(x - y),
        sympy.Piecewise((x, sympy.And(x > 0, y < 1)), (y, sympy.Or(sympy.Eq(x, 1), ~(y >= 2))), (3, True)),
        sympy.exp(x) + sympy.E + sympy.log(x) + sympy.atan2(y, x) + sympy.tanh(x) ** -2,
        sympy.Float(0.1) + sympy.Float(1e-30) * x,
    ],
)
def test_texts_of_sympy(expression: sympy.Expr) -> None:
    from eomgen.describe.expressions import parse
    from eomgen.describe.sympy_face import lower_sympy

    graph = Graph()
    read = parse(sympy_text(expression), graph, graph.symbol)
    meant = lower_sympy(graph, expression, graph.symbol)
    for values in ({"x": 0.7, "y": 0.4}, {"x": 1.0, "y": 2.5}):
        assert evaluate([read], values) == pytest.approx(evaluate([meant], values), rel=1e-14)


def test_what_has_no_text() -> None:
    for expression in (sympy.gamma(x), sympy.Integral(x, x), sympy.Piecewise((x, x > 0)), sympy.I * x, sympy.oo):
        with pytest.raises(UsageError):
            sympy_text(expression)


@given(st.text(st.characters(codec="utf-8", exclude_categories=["Cc", "Cs"]), min_size=1, max_size=20))
def test_texts_survive_yaml(text: str) -> None:
    written = describe_yaml(f"name: a\ndoc: {_text(text)}\nparameters: {{r: {{doc: {_text(text)}}}}}\n")
    assert written.values["doc"] == text
    assert written.sections["parameters"][0].values["doc"] == text


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_numbers_survive_yaml(number: float) -> None:
    value = scalar(repr(number))
    assert isinstance(value, int | float)
    assert math.copysign(1, value) == math.copysign(1, number)
    assert value == number


@pytest.mark.parametrize("given", ["b", "[b]", "[b, c]"])
def test_one_name_or_several_are_released_and_slide(given: str) -> None:
    text = f"""
name: m
bodies: {{a: {{mass: 1}}}}
joints: {{x: {{type: prismatic, between: [ground, a]}}}}
outputs: {{b: vx(a)}}
constraints: {{k: {{type: coupling, equation: x_dot, closes: x, releases: {given}}}}}
events: {{e: {{expression: x, restitution: 0.5, friction: 0.3, slip: {given}}}}}
"""
    assert not faults(text)
    for key in ("releases", "slip"):
        assert faults(text.replace(f"{key}: {given}", f"{key}: {{b: 1}}"))
