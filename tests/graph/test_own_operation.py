"""An operation is one row: one that eomgen does not know is added here and driven through all that looks rows up."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy
from sympy.codegen.cfunctions import expm1, fma

import eomgen as eg
from eomgen.describe.expressions import parse
from eomgen.graph import Graph, count, evaluate, gradient
from eomgen.graph.rounding_bounds import with_bounds
from eomgen.graph.sympy_lower import lower
from eomgen.graph.sympy_raise import raise_inline
from eomgen.operations import OPERATIONS, Operation, function
from eomgen.verification.digits import Digits, context
from eomgen.verification.rounding_sizes import bounded

X, Y, Z = sympy.symbols("x y z", real=True)
AT = {"x": 0.7, "y": 1.3, "z": -0.4}
ROWS: dict[str, tuple[Operation, Any]] = {  # and its form in SymPy
    "expm1": (
        function(
            "expm1",
            math.expm1,
            np.expm1,
            slopes=(lambda g, y, a: g.add(y, g.one.id),),
            rates=(lambda y, a: y + 1.0,),
            sympy=lambda s, a: s.exp(a) - 1,
            sympy_class="expm1",
        ),
        lambda a, b, c: sympy.exp(a) - 1,
    ),
    "fma": (
        function(
            "fma",
            lambda a, b, c: a * b + c,
            lambda a, b, c: a * b + c,
            slopes=(lambda g, y, a, b, c: b, lambda g, y, a, b, c: a, lambda g, y, a, b, c: g.one.id),
            rates=(lambda y, a, b, c: abs(b), lambda y, a, b, c: abs(a), lambda y, a, b, c: 1.0),
            numpy="({} * {} + {})",
            sympy=lambda s, a, b, c: a * b + c,
            sympy_class="fma",
            digits="",
        ),
        lambda a, b, c: a * b + c,
    ),
}
CLASSES = {"expm1": expm1, "fma": fma, "hypot": sympy.codegen.cfunctions.hypot}
FORMS = {name: form for name, (_, form) in ROWS.items()} | {"hypot": lambda a, b, c: sympy.sqrt(a**2 + b**2)}
#: Text of a call of each operation.
CALLS = {"expm1": "expm1(x)", "fma": "fma(x, y, z)", "hypot": "hypot(x, y)"}


@pytest.fixture(autouse=True)
def rows(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, (row, _) in ROWS.items():
        assert name not in OPERATIONS
        monkeypatch.setitem(OPERATIONS, name, row)


def known(name: str, order: int = 0) -> list[float]:
    """Value of the operation, or derivatives by x, y, z, by SymPy with 30 digits."""
    form = FORMS[name](X, Y, Z)
    point = {s: sympy.Rational(AT[s.name]) for s in (X, Y, Z)}
    return [float(e.subs(point).evalf(30)) for e in ([form.diff(s) for s in (X, Y, Z)] if order else [form])]


def read(name: str) -> tuple[Graph, Any]:
    g = Graph()
    return g, parse(CALLS[name], g, g.symbol)


@pytest.mark.parametrize("name", CALLS)
def test_values_and_derivatives_of_a_text(name: str) -> None:
    g, f = read(name)
    assert f.node[0] == name
    assert count([f]).functions == {name: 1}
    assert evaluate([f], AT) == pytest.approx(known(name), rel=1e-15)
    arrays = evaluate([f], {k: np.array([v, v]) for k, v in AT.items()})[0]
    assert arrays.tolist() == pytest.approx(known(name) * 2, rel=1e-15)
    slopes = gradient(f, [g.symbol(s) for s in "xyz"])
    assert evaluate(slopes, AT) == pytest.approx(known(name, 1), rel=1e-14)
    with pytest.raises(eg.ExpressionError, match=rf"{name}\(\) takes {OPERATIONS[name].arity} argument"):
        parse(f"{name}(x, y, x, y)", g, g.symbol)


@pytest.mark.parametrize("name", CALLS)
def test_sympy_in_and_out(name: str) -> None:
    g, f = read(name)
    out = raise_inline([f], lambda s: sympy.Symbol(s, real=True))[0]
    assert sympy.simplify(out - FORMS[name](X, Y, Z)) == 0
    back = lower(g, CLASSES[name](*(X, Y, Z)[: OPERATIONS[name].arity]), lambda s: g.symbol(s.name))
    assert back == f


@pytest.mark.parametrize("name", CALLS)
def test_fifty_digits_and_bounds_of_rounding(name: str) -> None:
    g, f = read(name)
    mp = context()
    exact = Digits(mp, [f])({k: mp.mpf(v) for k, v in AT.items()})[0]
    form = FORMS[name](X, Y, Z).subs({s: sympy.Rational(AT[s.name]) for s in (X, Y, Z)})
    with mpmath.workdps(60):
        assert abs(mpmath.mpf(str(exact)) - mpmath.mpf(str(form.evalf(60)))) < mpmath.mpf("1e-50")
    value, bound = bounded([f], {k: np.array([v]) for k, v in AT.items()}, 1)
    assert abs(value[0, 0] - float(exact)) <= bound[0, 0] < 1e-14
    third = parse(CALLS[name].replace("(x", "(x/3"), g, g.symbol)  # of what is rounded before
    slope = 3.0 * evaluate(gradient(third, [g.symbol("x")]), AT)[0]
    (own, carried), (once, twice) = with_bounds([f, third], AT)
    assert own == pytest.approx(known(name)[0])
    assert once == pytest.approx(abs(own))
    assert twice == pytest.approx(abs(carried) + 2.0 * abs(slope * AT["x"] / 3.0))  # of 3 and of x/3


@pytest.mark.parametrize("target", ["cython", "numpy"])
def test_compiled_with_its_derivatives_from_yaml(target: str, tmp_path: Path) -> None:
    m = eg.Model(f"own_{target}")
    for s in "xyz":
        m.prismatic(f"J{s}", m.ground, m.body(f"body_{s}", mass=1.0), axis="x", coordinate=s)
    for name, call in CALLS.items():
        m.torque(f"F_{name}", "Jx", call)
        m.output(f"y_{name}", call)
    text = m.to_yaml()
    assert all(call in text for call in CALLS.values())
    (tmp_path / "own.yaml").write_text(text)
    again = eg.load(tmp_path / "own.yaml")
    assert again.to_yaml() == text
    mod = again.compile(target=target)
    state = np.array([*AT.values(), 0.0, 0.0, 0.0])
    expected = [known(name)[0] for name in CALLS]
    assert mod.outputs(0.0, state) == pytest.approx(expected, rel=1e-15)
    assert mod.rhs(0.0, state)[3] == pytest.approx(sum(expected), rel=1e-14)
    jacobian = mod.jacobian(0.0, state)[3, :3]
    assert jacobian == pytest.approx(np.sum([known(name, 1) for name in CALLS], axis=0), rel=1e-13)
    several = np.repeat(state[:, None], 5, axis=1)
    assert mod.outputs(0.0, several).T.tolist() == [pytest.approx(expected, rel=1e-15)] * 5
    if target == "cython":  # all of them have Taylor series
        taylor, judge = (mod.simulate((0, 0.5), state, method=k, rtol=1e-12, atol=1e-12) for k in ("Taylor", "DOP853"))
        np.testing.assert_allclose(taylor.x[:, -1], judge.x[:, -1], rtol=1e-10)
    verified = mod.verify()
    assert verified.ok, str(verified)


def test_a_text_given_to_a_run_plays_it() -> None:
    m = eg.Model("played")
    m.prismatic("J", m.ground, m.body("mass", mass=1.0), axis="x", coordinate="s")
    m.torque("F", "J", m.input("u", signal="expm1(t) + hypot(t, 1)"))
    run = m.compile(target="numpy").simulate((0, 1))
    expected = [sympy.exp(1) - 2, sympy.integrate(sympy.sqrt(1 + X**2), (X, 0, 1))]
    assert run["s_dot"][-1] == pytest.approx(float(sum(expected)), rel=1e-6)
