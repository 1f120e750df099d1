"""Texts of expressions: the meaning is Python's, slips of typing are told, and nothing but arithmetic is let in."""

import ast
import math
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pint
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st
from model_files import load
from refusals import refused, refuses

import eomgen as eg

NAMES = {"a": 1.25, "b": -0.75, "c": 2.5, "theta_dot": 0.3, "t": 0.625}


def model(texts: Sequence[Any]) -> eg.Model:
    """A wheel whose outputs are expressions of these names."""
    m = eg.Model("m")
    for name in "abc":
        m.parameter(name, NAMES[name])
    m.revolute("theta", m.ground, m.body("wheel", mass=1, inertia={"zz": 1}))
    for k, text in enumerate(texts):
        m.output(f"out{k}", text)
    return m


def values(texts: Sequence[Any]) -> list[float]:
    module = model(texts).compile(target="numpy", kernels=["outputs"])
    return [float(x) for x in module.outputs(NAMES["t"], [0.0, NAMES["theta_dot"]])]


def faults(texts: Sequence[str]) -> list[Any]:
    """What is wrong with each text; None if it is an expression."""
    try:
        model(texts).check()
    except eg.ModelError as error:
        told = {p.path: p for p in error.problems}
        return [told.get(f"outputs.out{k}.expression") for k in range(len(texts))]
    return [None] * len(texts)


def column(problem: Any) -> int:
    return int(problem.message.rpartition(" in column ")[2].split()[0])


MEANING = {
    "-a**2": -(1.25**2),
    "2**3**2": 512.0,
    "a - b - c": 1.25 + 0.75 - 2.5,
    "a / c * b": 1.25 / 2.5 * -0.75,
    "1 if a < b else 3": 3.0,
    "b < a < c": 1.0,
    "b < c < a": 0.0,  # not "or"
    "not a < b and c != 0": 1.0,
    "a == 1.25 or 1 / (a - a + 1) > 5": 1.0,
    "where(a >= 1.25, c, b)": 2.5,
    "min(a, b, c) + max(a, b, c)": 1.75,
    "heaviside(a) + heaviside(b) + heaviside(0)": 1.5,
    "sign(b) * abs(b)": -0.75,
    "atan2(1, -1)": math.atan2(1, -1),
    "sqrt(c) + exp(b) + log(a)": math.sqrt(2.5) + math.exp(-0.75) + math.log(1.25),
    "cos(pi) + theta_dot": -0.7,
    "  a\n  + 1_000e-3": 2.25,
    "0x10 + 1e2": 116.0,
    "deg(30)": math.pi / 6,
    "+".join(["a"] * 500): 625.0,
    "(" * 55 + "a" + ")" * 55: 1.25,
}


@pytest.mark.quick
def test_meaning() -> None:
    assert values(list(MEANING)) == pytest.approx(list(MEANING.values()), rel=1e-14)


a, b = sympy.symbols("a b")
OF_SYMPY = {
    a**2 / 3 - sympy.sqrt(a) * sympy.pi: 1.25**2 / 3 - math.sqrt(1.25) * math.pi,
    sympy.Max(a, b, 1) + sympy.Min(a, -b): 2.0,
    sympy.Abs(b) * sympy.sign(b) + sympy.Heaviside(a - b): 0.25,
    sympy.Piecewise((a, sympy.And(a > 2, b < 1)), (b, sympy.Or(sympy.Eq(a, 1), ~(b >= 2))), (3, True)): -0.75,
    sympy.E + sympy.log(a) + sympy.atan2(b, a) + sympy.tanh(a) ** -2: (
        math.e + math.log(1.25) + math.atan2(-0.75, 1.25) + math.tanh(1.25) ** -2
    ),
    sympy.Float(0.1) + sympy.Float(1e-30) * a: 0.1,
}


def test_expressions_of_sympy_are_written_as_texts(tmp_path: Path) -> None:
    assert values(list(OF_SYMPY)) == pytest.approx(list(OF_SYMPY.values()), rel=1e-14)
    again = load(tmp_path, model(list(OF_SYMPY)).to_yaml()).compile(target="numpy", kernels=["outputs"])
    assert again.outputs(0.0, [0.0, 0.0]) == pytest.approx(list(OF_SYMPY.values()), rel=1e-14)
    for wrong in (sympy.gamma(a), sympy.Integral(a, a), sympy.Piecewise((a, a > 0)), sympy.I * a, sympy.oo):
        with pytest.raises((eg.UsageError, eg.ModelError)):
            model([wrong]).to_yaml()
    long = sympy.expand((a + b) ** 60) + sympy.gamma(a)
    with refused("EG-UNSUPPORTED gamma") as caught:
        model([long]).to_yaml()
    assert len(str(caught.value)) < 400


# -- Python's arithmetic ----------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Tree:
    """Python's own syntax tree, and its value worked out beside it."""

    node: ast.expr
    compute: Callable[[dict[str, float]], float]


def _number(x: float) -> Tree:
    return Tree(ast.Constant(x), lambda names: float(x))


def _name(n: str) -> Tree:
    return Tree(ast.Name(n), lambda names: names[n])


BINARY: dict[type[ast.operator], Callable[[float, float], float]] = {
    ast.Add: lambda x, y: x + y,
    ast.Sub: lambda x, y: x - y,
    ast.Mult: lambda x, y: x * y,
    ast.Div: lambda x, y: x / y,
}
COMPARE: dict[type[ast.cmpop], Callable[[float, float], bool]] = {
    ast.Lt: lambda x, y: x < y,
    ast.LtE: lambda x, y: x <= y,
    ast.Gt: lambda x, y: x > y,
    ast.GtE: lambda x, y: x >= y,
    ast.Eq: lambda x, y: x == y,
    ast.NotEq: lambda x, y: x != y,
}
CALLS: dict[str, Callable[[float], float]] = {
    f.__name__: f
    for f in (
        *(math.sin, math.cos, math.tan, math.asin, math.acos, math.atan, math.sinh, math.cosh, math.tanh),
        *(math.asinh, math.acosh, math.atanh),
    )
} | {"exp": math.exp, "log": math.log, "sqrt": math.sqrt, "abs": abs}


def _binary(parts: tuple[type[ast.operator], Tree, Tree]) -> Tree:
    kind, x, y = parts
    return Tree(ast.BinOp(x.node, kind(), y.node), lambda n: BINARY[kind](x.compute(n), y.compute(n)))


def _power(parts: tuple[Tree, int]) -> Tree:
    x, k = parts
    return Tree(ast.BinOp(x.node, ast.Pow(), ast.Constant(k)), lambda n: x.compute(n) ** k)


def _negative(x: Tree) -> Tree:
    return Tree(ast.UnaryOp(ast.USub(), x.node), lambda n: -x.compute(n))


def _call(parts: tuple[str, Tree]) -> Tree:
    f, x = parts
    return Tree(ast.Call(ast.Name(f), [x.node], []), lambda n: CALLS[f](x.compute(n)))


def _compare(parts: tuple[type[ast.cmpop], Tree, Tree]) -> Tree:
    kind, x, y = parts
    return Tree(ast.Compare(x.node, [kind()], [y.node]), lambda n: float(COMPARE[kind](x.compute(n), y.compute(n))))


def _either(parts: tuple[Tree, Tree, Tree]) -> Tree:
    c, x, y = parts
    return Tree(ast.IfExp(c.node, x.node, y.node), lambda n: x.compute(n) if c.compute(n) else y.compute(n))


leaves = st.sampled_from(sorted(NAMES)).map(_name) | st.sampled_from([0.5, 1, 2, 3, 0.125, 7, 10.0]).map(_number)
trees = st.recursive(
    leaves,
    lambda inner: (
        st.tuples(st.sampled_from(list(BINARY)), inner, inner).map(_binary)
        | st.tuples(inner, st.integers(0, 4)).map(_power)
        | inner.map(_negative)
        | st.tuples(st.sampled_from(list(CALLS)), inner).map(_call)
        | st.tuples(st.sampled_from(list(COMPARE)), inner, inner).map(_compare)
        | st.tuples(inner, inner, inner).map(_either)
    ),
    max_leaves=12,
)


def expected(tree: Tree) -> float | None:
    """Its value by Python; None where there is none, or where roundings decide it."""
    try:
        found = tree.compute(NAMES)
        nearby = [tree.compute({k: x * (1 + s) for k, x in NAMES.items()}) for s in (1e-9, -1e-9)]
    except (ArithmeticError, ValueError):
        return None
    sure = math.isfinite(found) and abs(found) < 1e9
    return found if sure and all(abs(x - found) <= 1e-6 * (1 + abs(found)) for x in nearby) else None


@settings(max_examples=10, deadline=None)
@given(st.lists(trees, min_size=30, max_size=30))
def test_arithmetic_is_pythons(drawn: list[Tree]) -> None:
    """Python prints the trees with its own precedence, and computes them with its own floats."""
    wanted = {ast.unparse(ast.Expression(tree.node)): x for tree in drawn if (x := expected(tree)) is not None}
    for text, fault in zip(wanted, faults(list(wanted)), strict=True):
        if fault:  # both branches of a conditional are read, Python takes one
            assert "division by zero" in fault.message or "not a finite" in fault.message
            wanted = {other: x for other, x in wanted.items() if other != text}
    assert values(list(wanted)) == pytest.approx(list(wanted.values()), rel=1e-6, abs=1e-6)


# -- what is refused --------------------------------------------------------------------------------------------------
HOSTILE = [
    "__import__('os').system('touch {canary}')", "open('{canary}', 'w')",
    "().__class__.__bases__[0].__subclasses__()", "a.__class__", "a[0]", "[a for a in (1, 2)]", "(a for a in b)",
    "{a: b}", "lambda: a", "(a := 3)", "f'{a}'", "'a' * 9", "*a", "a, b", "await a", "yield a", "print(a)", "exec(a)",
    "getattr(a, b)", "sin(x=a)", "sin(**a)", "sin(a)(b)", "sin", "9**9**9", "2**1001", "1e400", "1" * 3000, "1j",
    "True", "None", "...", "a % b", "a ^ b", "a & b", "~a", "a << b", "a is b", "a in b", "a if b", "a = b", "a; b",
    "import os", "a # b", "a \\ b", "\u03b8 + 1", "a + \u200b1", "", "1/0", "a/(b - b)", "log(0)", "sqrt(-1)",
    "(-8)**(1/3)", "1e308*10", "sin()", "min(a)", "where(a, b)", "(" * 300 + "a" + ")" * 300, "-" * 3000 + "a",
    "not " * 900 + "a", "sin(" * 100 + "a" + ")" * 100, "a**" * 500 + "a", "a+" * 1990 + "a", "a" * 4001,
]  # fmt: skip

_watching: list[str] | None = None


def _watch(event: str, _arguments: object) -> None:
    if _watching is not None and event in ("exec", "open", "os.system", "subprocess.Popen", "import", "os.exec"):
        _watching.append(event)


@contextmanager
def watched() -> Iterator[list[str]]:
    """What the interpreter executes, opens or imports meanwhile."""
    global _watching
    _watching = seen = []
    try:
        yield seen
    finally:
        _watching = None


def test_hostile_text_is_refused_and_nothing_runs(tmp_path: Path) -> None:
    sys.addaudithook(_watch)
    canary = tmp_path / "canary"
    texts = [text.replace("{canary}", str(canary)) for text in HOSTILE]
    wrong = model(texts)
    faults(["a +"])  # whatever the first refusal imports is loaded by now
    with watched() as seen, pytest.raises(eg.ModelError) as caught:
        wrong.check()
    assert seen == []
    assert not canary.exists()
    told = {p.path: p for p in caught.value.problems}
    missed = [text[:40] for k, text in enumerate(texts) if f"outputs.out{k}.expression" not in told]
    assert missed == []
    assert all(p.message for p in told.values())


#: What is typed -> the column that the message points at, and what it says to write.
SLIPS = {
    "2pi*A": (1, "* / ** between"), "2(a + b)": (1, "* / ** between"), "(a + b)(2)": (1, "* / ** between"),
    "3 mm": (3, "no units"), "5 N*m": (3, "no units"), "0.5m": (3, "no units"), "9.81 m/s^2": (9, "** for powers"),
    "10 %": (4, "remainder"), "30°": (3, "deg(30)"), "sin(30°)": (7, "deg(30)"), "deg 30": (5, "functions"),
    "1,5": (1, "such as 1.5"), "2,5*a": (1, "such as 1.5"), "2e3.5": (4, "numbers"), "1 000": (3, "numbers"),
    "1.5.2": (4, "numbers"), "a^2": (2, "**"), "a²": (2, "**"), "\u22123": (1, "+ -"), "√2": (1, "sqrt"),
    "µ*a": (1, "names"), "|a|": (1, "abs(a)"), "a b": (3, "between"), "a**": (4, "**"), "a = 2": (1, "comparisons"),
    "a//b": (1, "/ for"), "arctan(a)": (1, "'atan'"), "2*(a": (3, "bracket"),
}  # fmt: skip


@pytest.mark.quick
def test_a_slip_is_reported_with_what_to_write() -> None:
    for text, fault in zip(SLIPS, faults(list(SLIPS)), strict=True):
        place, remedy = SLIPS[text]
        assert (fault.code, column(fault)) == ("EG-EXPRESSION", place), text
        assert remedy in fault.remedy, text
    assert "did you mean 'pi'?" in faults(["PI"])[0].remedy


def test_markers_only_where_they_can_be_located() -> None:
    assert values(["x(wheel) + vx(wheel) + ax(wheel)"]) == [0.0]
    for text in ("x(wheel.rim.end)", "x(1)", "x()", "x(a, b)", "x(sin(a))", "wheel.rim", "x(a, at=b)", "sin(a, in=b)"):
        assert faults([text])[0] is not None, text
    m = model([])
    m.body("other", mass="x(wheel)")
    refuses("EG-EXPRESSION bodies.other.mass", m.check)


# -- units -------------------------------------------------------------------------------------------------------------
#: parameters, inputs: name -> unit; c has none
GIVEN = {"l": "mm", "m": "g", "F": "kN", "tau": "N*m", "k": "N/mm", "kt": "N*m/rad", "d": "N*s/m", "w": "rpm"}
GIVEN |= {"g": "m/s^2", "T": "ms", "a": "deg", "rho": "g/cm^3", "n": "1", "p": "MPa"}


def probe(field: str, expression: str) -> eg.Model:
    """A pendulum (angle th) on a slide (length x), with one expression under test."""
    m = eg.Model("probe", gravity=(0, -9.81, 0))
    for name, unit in GIVEN.items():
        m.parameter(name, 1.0, unit=unit)
    m.parameter("c", 1.0)
    own = {field: expression}
    cart = m.body("cart", mass=own.get("mass", 1))
    rod = m.body("rod", mass=1, inertia=(0, 0, own.get("inertia", 1)), com=(own.get("com", 0.5), 0, 0))
    m.prismatic("x", m.ground, cart, axis="x")
    m.revolute("th", cart, rod)
    if field == "torque":
        m.torque("motor", on="th", value=expression)
    elif field == "push":
        m.torque("motor", on="x", value=expression)
    elif field == "law":
        m.element("coil", joint="x", law=expression)
    elif field == "turning_law":
        m.torsional_element("coil", joint="th", law=expression)
    elif field == "stiffness":
        m.spring("coil", m.ground, cart.marker("end", at=(1, 0, 0)), stiffness=expression)
    elif field == "stop":
        m.stop("end", joint="x", lower=0, stiffness=expression, exponent=1)
    elif field == "stop2":
        m.stop("end", joint="x", lower=0, stiffness=expression, exponent=2)
    elif field == "bushing":
        m.bushing("rubber", m.ground, cart, stiffness=[1, 1, 1, expression, 1, 1])
    elif field == "bushing_force":
        m.bushing("rubber", m.ground, cart, stiffness=[expression, 1, 1, 1, 1, 1])
    elif field == "driver":
        m.driver("lead", coordinate="th", value=expression)
    elif field == "output":
        m.output("y", expression)
    elif field == "output_N":
        m.output("y", expression, unit="N")
    elif field == "initial":
        m.initial(x=expression)
    return m


RIGHT = [
    ("mass", "m"), ("mass", "2"), ("mass", "c"), ("mass", "rho*l**3"), ("mass", "0.3*l"), ("mass", "4/3*pi*rho*l**3"),
    ("inertia", "m*l**2/12"), ("inertia", "0.2*l*l/12"), ("com", "l/2"), ("com", "sqrt(l*l)"), ("com", "hypot(l, l)"),
    ("torque", "tau"), ("torque", "F*l*sin(th)"), ("torque", "-m*g*l*cos(th)"), ("torque", "m*9.81*l"),
    ("torque", "-kt*th"), ("torque", "-kt*(th - a)"), ("torque", "tau*sin(w*t)"), ("torque", "tau*sin(3*t)"),
    ("torque", "tau + c"), ("torque", "c*l"), ("torque", "tau*(x/l)**2"), ("torque", "tau*exp(-t/T)"),
    ("torque", "tau*sin(t)*exp(-t)"),
    ("push", "F"), ("push", "-k*x"), ("push", "-40*x"), ("push", "p*l**2"), ("push", "F - d*x_dot"),
    ("law", "-k*(length - l) - d*rate"), ("turning_law", "-kt*angle - kt*T*rate"), ("stiffness", "k"),
    ("stop", "k"), ("stop2", "k/l"), ("bushing", "kt"), ("bushing_force", "k"), ("driver", "w*t"),
    ("driver", "atan2(l, c)"), ("output", "min(l, x)"), ("output", "where(x > l, F, -F)"),
    ("output_N", "m*ax(rod)"), ("output_N", "total_energy/l"), ("output", "n + th"), ("initial", "2*l"),
]  # fmt: skip
WRONG = [  # the field, the expression, and the units that the fault tells
    ("mass", "l", "(m) (kg)"), ("mass", "rho*l**2", "(kg)"), ("inertia", "m*l/12", "(kg*m^2)"),
    ("com", "m", "(kg) (m)"), ("com", "l**2", "(m)"), ("torque", "F", "(N) (N*m)"),
    ("torque", "tau + F", "(N*m) (N)"), ("torque", "F*l + l", "(m) (N*m)"), ("torque", "-k*th", "(N/m) (N*m)"),
    ("torque", "tau*sin(l)", "(l) (m)"), ("torque", "tau*sin(w)", "(w) (1/s)"),
    ("torque", "tau*exp(t*x/l/t*T)", "(t*x/l/t*T) (s)"), ("torque", "tau*exp(T)", "(T) (s)"),
    ("torque", "tau*2**l", "(m)"), ("push", "tau", "(N*m) (N)"), ("push", "l", "(m) (N)"),
    ("push", "-2*k*x**2", "(N*m) (N)"), ("push", "F - k", "(N) (N/m)"), ("push", "p", "(N)"),
    ("law", "-k*(length - F)", "(m) (N)"), ("law", "-k*rate", "(N)"), ("turning_law", "-k*angle", "(N/m) (N*m)"),
    ("stiffness", "kt", "(N*m) (N/m)"), ("stop", "F", "(N) (N/m)"), ("stop2", "k", "(N/m)"),
    ("bushing", "k", "(N/m) (N*m)"), ("bushing_force", "kt", "(N*m) (N/m)"), ("driver", "l", "(m)"),
    ("driver", "w", "(1/s)"), ("output", "min(l, T)", "(m) (s)"), ("output", "where(x > th, l, 2*l)", "(m)"),
    ("output", "l + T", "(m) (s)"), ("output", "atan2(x, T)", "(m) (s)"), ("output", "hypot(l, th)", "(m)"),
    ("output", "sqrt(l) + l", "(l) (m)"), ("output", "x + x_dot", "(m) (m/s)"),
    ("output", "kinetic_energy + F", "(N*m) (N)"), ("output", "vx(rod) - ax(rod)", "(rod) (m/s)"),
    ("output_N", "m", "(kg) (N)"), ("output_N", "m*vx(rod)", "(rod) (N)"), ("output", "log(p)", "(p)"),
    ("initial", "a", "(m)"),
]  # fmt: skip


@pytest.mark.parametrize(("field", "expression"), RIGHT)
def test_right_expressions_pass(field: str, expression: str) -> None:
    probe(field, expression).check()


@pytest.mark.parametrize(("field", "expression", "units"), WRONG)
def test_wrong_expressions_are_reported_with_their_place(field: str, expression: str, units: str) -> None:
    with refused(f"EG-DIMENSION {units}") as caught:
        probe(field, expression).check()
    (problem,) = caught.value.problems
    assert problem.remedy
    assert problem.path.split(".")[0] in ("bodies", "forces", "constraints", "outputs", "initial")


def test_all_are_reported_at_once_with_their_lines(tmp_path: Path) -> None:
    text = """name: two
parameters:
  l: {value: 500, unit: mm}
  F: {value: 1, unit: kN}
  k: {value: 1, unit: parsek}
bodies:
  b: {mass: l, inertia: {zz: 1}}
joints:
  th: {type: revolute, between: [ground, b]}
forces:
  t:
    type: torque
    joint: th
    value: F*l + F
"""
    with pytest.raises(eg.ModelError) as caught:
        load(tmp_path, text).check()
    told = [("parameters.k.unit", 5), ("bodies.b.mass", 7), ("forces.t.value", 14)]
    assert [(p.path, p.line) for p in caught.value.problems] == told


@pytest.mark.parametrize(
    ("mass", "inertia", "size"),  # of l = 0.6, in parts of l^2
    [
        (4, "4*l**2/12", 1 / 3), (4, "l**2*4/12", 1 / 3), ("4", "l**2/3", 1 / 3), (1, "l**2/12", 1 / 12),
        (4, "4*(l**2 + 0.1*l**2)/12", 1.1 / 3), (4, "4*l**2/12 + 4*l**2/4", 4 / 3), (4, "m*l**2/12", 1 / 3),
        (4, "l**2/12", None), (2.5, "l**2/12", None), (4, "4*l/12", None), ("m", "4*l**2/12", None),
    ],
)  # fmt: skip
def test_a_number_in_an_inertia_may_be_the_mass_of_the_body(mass: object, inertia: str, size: float | None) -> None:
    m = eg.Model("rod")
    m.parameter("l", 0.6, unit="m")
    m.parameter("m", 4.0, unit="kg")
    m.revolute("A", m.ground, m.body("rod", mass=mass, com=("l/2", 0, 0), inertia={"zz": inertia}))
    if size is not None:  # about the pin: Steiner's theorem
        about = m.compile(target="numpy").mass_matrix([0.0])[0, 0]
        assert about == pytest.approx(size * 0.36 + float(str(mass)) * 0.09, rel=1e-14)
    else:
        refuses("EG-DIMENSION bodies.rod.inertia.zz", m.compile, target="numpy")


#: As people write them; a bracket divides as a whole.
UNITS = [
    *("mm", "km/h", "g*mm^2", "deg", "rpm", "kN/mm", "lbf*ft", "N*mm/deg", "bar", "inch", "t", "ms", "deg/s", "mN m"),
    *("1/min", "g/cm**3", "kg m^2/s^2", "hp", "kWh", "um", "turn", "%", "N/(mm/s)", "kg/(m*s)", "N*m/(rad^2/s^2)"),
]


def test_sizes_are_those_of_pint() -> None:
    registry: pint.UnitRegistry[float] = pint.UnitRegistry()
    m = eg.Model("units")
    for k, text in enumerate(UNITS):
        m.parameter(f"p{k}", 1, unit=text)
    m.prismatic("x", m.ground, m.body("b", mass=1))
    mod = m.compile(target="numpy", kernels=["poses"])
    for text, size, name in zip(UNITS, mod.p, mod.p_names, strict=True):
        judge = registry.Quantity(1.0, text).to_base_units()
        assert size == pytest.approx(judge.magnitude, rel=2e-15), text
        si = mod.metadata["units"].get(name, "1")
        assert registry.Quantity(1.0, si).to_base_units().magnitude == pytest.approx(1.0), (text, si)
        assert registry.Quantity(1.0, si).check(judge.dimensionality), (text, si)


@pytest.mark.parametrize(
    ("text", "remedy"),
    [("degC", "in K"), ("furlongg", "products"), ("Nm", "N*m"), ("m**", "products"), ("(m", "products"),
     ("m//s", "products"), ("__import__('os')", "products"), ("m^99999", "products"), ("1e3 m", "products")],
)  # fmt: skip
def test_what_is_no_unit_is_refused(text: str, remedy: str) -> None:
    m = probe("mass", "1")
    m.parameter("bad", 1, unit=text)
    with pytest.raises(eg.ModelError) as told:
        m.check()
    assert [p.path for p in told.value.problems] == ["parameters.bad.unit"]
    assert remedy in told.value.problems[0].remedy


def _pendulum(units: bool) -> eg.Model:
    m = eg.Model("pendulum", gravity=(0, "-g", 0))
    given = {"g": (9.81e-3, "mm/ms^2"), "l": (500, "mm"), "m": (250, "g"), "k": (5.0, "N*mm/deg"), "a": (20, "deg")}
    plain = {"g": 9.81, "l": 0.5, "m": 0.25, "k": 5.0e-3 * 180 / math.pi, "a": math.radians(20)}
    for name in given:
        value, unit = given[name] if units else (plain[name], "")
        m.parameter(name, value, unit=unit)
    bob = m.body("bob", mass="m", com=("l", 0, 0), inertia=(0, 0, "m*l**2/12"))
    m.revolute("th", m.ground, bob)
    m.torsional_spring("coil", "th", stiffness="k", angle="a")
    m.output("reach", "l*cos(th)", unit="mm" if units else "")
    m.output("turn", "th", unit="deg" if units else "")
    m.initial(th="a")
    return m


def test_other_units_are_the_same_physics() -> None:
    one, other = (_pendulum(units).compile(target="numpy") for units in (True, False))
    np.testing.assert_allclose(one.p, other.p, rtol=1e-15)
    a, b = one.simulate((0, 1), rtol=1e-10, atol=1e-12), other.simulate((0, 1), rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(a.x[:, -1], b.x[:, -1], rtol=1e-8, atol=1e-10)
    x = [0.3, -0.2]
    np.testing.assert_allclose(one.rhs(0.0, x), other.rhs(0.0, x), rtol=1e-14)
    np.testing.assert_allclose(a["reach"], 1e3 * 0.5 * np.cos(a["th"]), rtol=1e-12)
    np.testing.assert_allclose(a["turn"], np.degrees(a["th"]), rtol=1e-12)
    assert (a.units["reach"], a.units["turn"]) == ("mm", "deg")
    assert [one.metadata["units"][name] for name in "lk"] == ["m", "N*m"]


def test_outputs_that_cannot_be_converted_are_refused() -> None:
    m = probe("mass", "1")
    m.output("th", "th", unit="deg")
    m.output("number", 3, unit="mm")
    with pytest.raises(eg.ModelError) as caught:
        m.check()
    assert [p.path for p in caught.value.problems] == ["outputs.th.unit", "outputs.number.unit"]


def swing() -> eg.Model:
    m = eg.Model("swing")
    length = m.parameter("l", 2, unit="m")
    m.parameter("k", 3)
    rod, bead = m.body("rod", mass=1, inertia={"zz": 1}), m.body("bead", mass=1, inertia={"zz": 1})
    rod.marker("tip", at=(length, 0, 0))
    m.revolute("hinge", m.ground, rod, coordinate="th")
    m.prismatic("slide", rod, bead, axis="x", coordinate="s")
    return m


@pytest.mark.parametrize(
    ("expression", "unit"),
    [
        ("x(rod.tip)", "m"), ("-vy(bead) + s_dot", "m/s"), ("ax(bead)", "m/s^2"), ("hypot(x(bead), y(bead))", "m"),
        ("sqrt(x(bead)**2 + y(bead)**2)", "m"), ("s*l", "m^2"), ("x(rod.tip) - 0.15", "m"), ("-th", "rad"),
        ("th_dot", "rad/s"), ("wz(bead)", "rad/s"), ("total_energy", "J"), ("2*s", ""), ("k*s", ""), ("s/l", ""),
        ("s_dot/l", ""), ("1000*x(bead)", ""), ("sin(th)", ""),
    ],
)  # fmt: skip
def test_an_output_has_the_unit_that_is_certain(expression: str, unit: str) -> None:
    m = swing()
    m.output("y1", expression)
    assert m.derive().compile(target="numpy").metadata["units"].get("y1", "") == unit


# -- values of instances of components --------------------------------------------------------------------------------
PAIR = """
name: pair
parameters: {s: 0.3}
components:
  arm:
    attachments: [top]
    parameters: {l: {value: 0.5, unit: m}, w: {value: 10, unit: mm}, c: 1}
    inputs: {tau: {value: 1, unit: N*m}}
    bodies: {rod: {mass: 1, com: [0, -l/2, 0], inertia: {zz: 0.1}, markers: {end: [c*w, -l, 0]}}}
    joints: {hinge: {type: revolute, between: [top, rod], coordinate: q}}
    forces: {motor: {type: torque, joint: hinge, value: tau}}
add:
  a: {component: arm, at: ground, parameters: {GIVEN}, inputs: {INPUTS}}
"""
GIVEN_RIGHT: list[tuple[str, str, float]] = [  # what is given, the parameter and its value in SI units
    ("l: {value: 500, unit: mm}", "a_l", 0.5),
    ("l: {value: 2, unit: ft}", "a_l", 0.6096),
    ("l: {value: 100*pi, unit: cm}", "a_l", math.pi),
    ("l: {value: 0.25}", "a_l", 0.25),
    ("w: {value: 0.02, unit: m}", "a_w", 0.02),
    ("w: {value: 5}", "a_w", 0.005),
    ("w: 5", "a_w", 0.005),
    ("c: {value: 90, unit: deg}", "a_c", math.pi / 2),
]
GIVEN_WRONG = [  # what is given, the code, the place and what it names
    ("l: {value: 500, unit: kg}", "EG-UNIT add.a.parameters.l.unit: l m"),
    ("l: {value: 500, unit: mmm}", "EG-UNIT add.a.parameters.l.unit mmm"),
    ("l: {value: 500, unit: 3}", "EG-UNIT add.a.parameters.l.unit"),
    ("l: {value: 500, units: mm}", "EG-NAME-UNKNOWN add.a.parameters.l.units"),
    ("l: {unit: mm}", "EG-MISSING add.a.parameters.l"),
    ("l: {value: 2*s, unit: mm}", "EG-UNIT add.a.parameters.l.unit"),
]


def loaded(folder: Path, given: str, inputs: str = "") -> eg.Model:
    return load(folder, PAIR.replace("GIVEN", given).replace("INPUTS", inputs))


def arm() -> eg.Model:
    m = eg.Model("arm")
    length = m.parameter("l", 0.5, unit="m")
    m.parameter("w", 10, unit="mm")
    m.parameter("c", 1)
    tau = m.input("tau", 1, unit="N*m")
    rod = m.body("rod", mass=1, com=(0, -length / 2, 0), inertia={"zz": 0.1})
    rod.marker("end", at=("c*w", "-l", 0))
    m.torque("motor", m.revolute("hinge", m.attachment("top"), rod, coordinate="q"), tau)
    return m


@pytest.mark.parametrize(("given", "name", "value"), GIVEN_RIGHT)
def test_values_are_converted(given: str, name: str, value: float, tmp_path: Path) -> None:
    mod = loaded(tmp_path, given).compile(target="numpy")
    assert dict(zip(mod.p_names, mod.p, strict=True))[name] == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(("given", "demand"), GIVEN_WRONG)
def test_what_is_wrong_is_reported_at_its_place(given: str, demand: str, tmp_path: Path) -> None:
    refuses(demand, lambda: loaded(tmp_path, given).check())


def test_expressions_of_the_model_and_inputs(tmp_path: Path) -> None:
    mod = loaded(tmp_path, "l: {value: 2*s, unit: m}", "tau: {value: 300, unit: N*mm}").compile(target="numpy")
    assert mod.p_names == ("s", "a_w", "a_c")
    assert mod.u_names == ("a_tau",)
    assert mod.u.tolist() == [pytest.approx(0.3, rel=1e-15)]
    end = mod.bind(p={"s": 0.4}).simulate(0.01).position("a.rod.end")[:, 0]
    assert end[1] == pytest.approx(-0.8)


def test_the_same_in_python() -> None:
    for values in (
        {"l": {"value": 500, "unit": "mm"}, "tau": {"value": 0.2, "unit": "kN*m"}},
        {"parameters": {"l": {"value": 500, "unit": "mm"}}, "inputs": {"tau": {"value": 0.2, "unit": "kN*m"}}},
    ):
        m = eg.Model("pair")
        m.add(arm(), prefix="a_", at=m.ground, **values)
        mod = m.compile(target="numpy")
        assert mod.p.tolist() == [0.5, 0.01, 1.0]
        assert mod.u.tolist() == [200.0]


def test_slips_in_python() -> None:
    m = eg.Model("pair")
    refuses("EG-CONFLICT l", lambda: m.add(arm(), "a_", m.ground, parameters={"l": 0.3}, l=0.4))
    refuses("EG-TYPE parameters", lambda: m.add(arm(), "a_", m.ground, parameters=[0.3]))
    refuses("EG-UNIT l", lambda: m.add(arm(), "a_", m.ground, l={"value": 1, "unit": "s"}))


def test_a_weld_that_closes_is_judged_beside_units(tmp_path: Path) -> None:
    text = """
        name: latch
        parameters: {k: {value: 2, unit: 1/s}, l: {value: 0.4, unit: m}}
        bodies: {a: {mass: 1}, b: {mass: 1}}
        joints:
          r: {type: prismatic, between: [ground, a]}
          s: {type: prismatic, between: [ground, b]}
          w: {type: weld, between: [a, b], closes: s - r - l, stabilisation: RATE}
    """
    assert load(tmp_path, text.replace("RATE", "k")).check()
    refuses("EG-DIMENSION joints.w.stabilisation", lambda: load(tmp_path, text.replace("RATE", "l")).check())
