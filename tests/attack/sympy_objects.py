"""Odd SymPy objects in every place where Python code may give an expression."""

import contextlib
import random
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import sympy as sp
from attack.runner import Kind
from sympy.physics import mechanics, units
from sympy.utilities.exceptions import SymPyDeprecationWarning
from sympy.vector import CoordSys3D

import eomgen as eg

Q, T, A, B = sp.symbols("q t a b")
QT = sp.Function("q")(T)
F = sp.Function("f")
#: Word -> an object without parts; made when it is asked for, because some take long or are refused by SymPy.
LEAVES: dict[str, Callable[[], Any]] = {
    **{str(one): lambda one=one: one for one in (Q, T, A, B, QT, sp.pi, sp.E, sp.I, sp.oo, sp.zoo, sp.nan)},
    **{str(k): lambda k=k: sp.Integer(k) for k in (0, 1, -1, 2)}, "true": lambda: sp.true, "denormal": lambda: sp.Float(5e-324),
    "q_dot": lambda: sp.Symbol("q_dot"), "unknown": lambda: sp.Symbol("unknown"), "boolean name": lambda: sp.Symbol("True"),
    "marker": lambda: sp.Symbol("x(bob)"), "marker of none": lambda: sp.Symbol("vx(nobody)"),
    "diff q": lambda: QT.diff(T), "diff2 q": lambda: QT.diff(T, 2), "diff3 q": lambda: QT.diff(T, 3),
    "code name": lambda: sp.Symbol("__import__('os').system('touch CANARY')"), "odd name": lambda: sp.Symbol("*/ x; \n"),
    "long name": lambda: sp.Symbol("a" * 5000), "empty name": lambda: sp.Symbol(""), "deep": lambda: nested(900),
    "dummy": lambda: sp.Dummy("q"), "wild": lambda: sp.Wild("w"), "positive q": lambda: sp.Symbol("q", positive=True),
    "integer a": lambda: sp.Symbol("a", integer=True), "imaginary a": lambda: sp.Symbol("a", imaginary=True),
    "commuting not": lambda: sp.Symbol("a", commutative=False), "gamma": lambda: sp.EulerGamma, "-oo": lambda: -sp.oo,
    "golden": lambda: sp.GoldenRatio, "tribonacci": lambda: sp.TribonacciConstant, "false": lambda: sp.false,
    "huge": lambda: sp.Integer(10) ** 400, "huger": lambda: sp.Integer(7) ** 20000, "tiny": lambda: sp.Rational(1, 10**400),
    "ratio": lambda: sp.Rational(10**400 + 1, 10**400), "digits": lambda: sp.Float("0.1", 50), "float": lambda: sp.Float(1.5),
    "float huge": lambda: sp.Float("1e400"), "float tiny": lambda: sp.Float("1e-400"), "float inf": lambda: sp.Float("inf"),
    "float hugest": lambda: sp.Float("1e9999"), "float nan": lambda: sp.Float("nan"), "1/2": lambda: sp.S.Half,
    "matrix symbol": lambda: sp.MatrixSymbol("M", 2, 2), "matrix": lambda: sp.Matrix([[1, 2], [3, 4]]),
    "matrix 1": lambda: sp.Matrix([[1]]), "immutable": lambda: sp.ImmutableMatrix([[1]]), "identity": lambda: sp.Identity(2),
    "array": lambda: sp.Array([1, 2]), "set": lambda: sp.FiniteSet(1, 2), "empty set": lambda: sp.S.EmptySet,
    "reals": lambda: sp.S.Reals, "interval": lambda: sp.Interval(0, 1), "tuple": lambda: sp.Tuple(Q, A),
    "dict": lambda: sp.Dict({Q: A}), "string": lambda: sp.core.symbol.Str("q"), "poly": lambda: sp.Poly(Q**2 + 1, Q),
    "class": lambda: sp.sin, "undefined class": lambda: F, "lambda": lambda: sp.Lambda(Q, Q**2), "order": lambda: sp.O(Q),
    "identity function": lambda: sp.S.IdentityFunction, "root": lambda: sp.CRootOf(Q**5 - Q - 1, 0),
    "root sum": lambda: sp.RootSum(Q**3 + Q + 3, sp.Lambda(Q, Q**2)), "vector": lambda: CoordSys3D("N").i,
    "frame": lambda: mechanics.ReferenceFrame("N").x, "unit": lambda: units.meter, "quaternion": lambda: sp.Quaternion(1, 0, 0, 0),
    "dynamic": lambda: mechanics.dynamicsymbols("q"), "dynamic other": lambda: mechanics.dynamicsymbols("z"),
    "indexed": lambda: sp.IndexedBase("a")[0], "f(q)": lambda: F(Q), "f(t)": lambda: F(T), "f()": lambda: F(),
    "f(f)": lambda: F(F(Q)), "f(q, t)": lambda: F(Q, T), "df": lambda: F(Q).diff(Q), "subs": lambda: sp.Subs(F(Q).diff(Q), Q, A),
    "subs 2": lambda: sp.Subs(Q**2, Q, sp.zoo), "integral": lambda: sp.Integral(Q, (Q, 0, 1)),
    "integral open": lambda: sp.Integral(sp.exp(Q**Q), Q), "sum": lambda: sp.Sum(Q, (Q, 1, 3)),
    "sum endless": lambda: sp.Sum(1 / Q, (Q, 1, sp.oo)), "sum long": lambda: sp.Sum(sp.sin(B), (B, 1, 10**9)),
    "product": lambda: sp.Product(Q, (Q, 1, 3)), "limit": lambda: sp.Limit(sp.sin(Q) / Q, Q, 0),
    "derivative": lambda: sp.Derivative(Q**2, Q), "derivative high": lambda: sp.Derivative(sp.sin(Q) ** 9, (Q, 40)),
    "derivative n": lambda: sp.Derivative(QT, (T, A)), "zeta": lambda: sp.zeta(3), "gamma(1/3)": lambda: sp.gamma(sp.Rational(1, 3)),
    "factorial": lambda: sp.factorial(10**5, evaluate=False), "gamma huge": lambda: sp.gamma(10**9, evaluate=False),
    "besselj": lambda: sp.besselj(0, Q), "erf": lambda: sp.erf(1), "dirac": lambda: sp.DiracDelta(Q),
    "pow 0 -1": lambda: sp.Pow(0, -1, evaluate=False), "pow 0 -a": lambda: sp.Pow(0, -A, evaluate=False),
    "pow huge": lambda: sp.Pow(9, sp.Pow(9, 9, evaluate=False), evaluate=False), "pow 0 0": lambda: sp.Pow(0, 0, evaluate=False),
    "log 0": lambda: sp.log(0, evaluate=False), "log -1": lambda: sp.log(-1, evaluate=False), "sqrt -1": lambda: sp.sqrt(-2),
    "asin 2": lambda: sp.asin(2), "acos huge": lambda: sp.acos(10**30), "atan2 0": lambda: sp.atan2(0, 0, evaluate=False),
    "mod": lambda: sp.Mod(Q, 2), "floor": lambda: sp.floor(Q), "lower": lambda: sp.LambertW(Q), "and": lambda: sp.And(Q < 1, A > 2),
    "relation": lambda: Q < A, "equal": lambda: sp.Eq(Q, A), "equal chain": lambda: sp.Eq(Q < 1, A < 2),
    "contains": lambda: sp.Contains(Q, sp.Interval(0, 1)), "ite": lambda: sp.ITE(Q < 1, A > 1, B > 1),
    "xor": lambda: sp.Xor(Q < 1, A < 1), "nand": lambda: sp.Nand(Q < 1, A < 1), "piecewise open": lambda: sp.Piecewise((A, Q < 1)),
    "piecewise": lambda: sp.Piecewise((A, Q < 1), (B, True)), "piecewise nan": lambda: sp.Piecewise((sp.nan, Q < 1), (B, True)),
    "max": lambda: sp.Max(Q, A), "min": lambda: sp.Min(Q, 2), "heaviside": lambda: sp.Heaviside(Q, 0), "sign": lambda: sp.sign(Q),
    "abs": lambda: abs(Q), "str": lambda: "a*q", "str odd": lambda: "9**9**9", "none": lambda: None, "list": lambda: [Q],
    "python int": lambda: 10**400, "python nan": lambda: float("nan"), "python complex": lambda: 1j, "object": object,
    "numpy": lambda: np.float64(2.0), "numpy array": lambda: np.ones(3), "sqrt nest": lambda: roots(40),
    "wide": lambda: sp.Add(*(sp.sin(k * Q) for k in range(300))), "expand": lambda: (Q + A + B + T + 1) ** 60,
    "re": lambda: sp.re(Q + sp.I * A), "im": lambda: sp.im(QT), "arg": lambda: sp.arg(Q), "conjugate": lambda: sp.conjugate(Q),
}  # fmt: skip
#: Word -> operation on one or two objects, unevaluated where it can be.
ONE: dict[str, Callable[[Any], Any]] = {
    "neg": lambda x: -x, "inverse": lambda x: 1 / x, "sin": sp.sin, "sin raw": lambda x: sp.sin(x, evaluate=False),
    "sqrt": sp.sqrt, "exp": sp.exp, "log": sp.log, "tan": sp.tan, "acos": sp.acos, "abs": sp.Abs, "sign": sp.sign, "not": sp.Not,
    "raw": sp.UnevaluatedExpr, "f": lambda x: F(x), "diff": lambda x: sp.Derivative(x, Q), "lambda": lambda x: sp.Lambda(Q, x),
    "integral": lambda x: sp.Integral(x, (Q, 0, A)), "sum": lambda x: sp.Sum(x, (B, 1, 2)), "subs": lambda x: sp.Subs(x, Q, A),
    "piecewise": lambda x: sp.Piecewise((x, Q < 1), (1, True)), "heaviside": sp.Heaviside, "re": sp.re, "floor": sp.floor,
    "cot": sp.cot, "sech": sp.sech, "gamma": sp.gamma,
}  # fmt: skip
TWO: dict[str, Callable[[Any, Any], Any]] = {
    "add": lambda x, y: x + y, "mul": lambda x, y: x * y, "div": lambda x, y: x / y, "max": sp.Max, "atan2": sp.atan2, "mod": sp.Mod,
    "add raw": lambda x, y: sp.Add(x, y, evaluate=False), "mul raw": lambda x, y: sp.Mul(x, y, evaluate=False),
    "pow raw": lambda x, y: sp.Pow(x, y, evaluate=False), "min": lambda x, y: sp.Min(x, y, evaluate=False),
    "less": lambda x, y: sp.StrictLessThan(x, y, evaluate=False), "equal": lambda x, y: sp.Eq(x, y, evaluate=False),
    "and": lambda x, y: sp.And(x, y, evaluate=False), "piecewise": lambda x, y: sp.Piecewise((x, Q > 0), (y, True)),
}  # fmt: skip


def nested(depth: int) -> Any:
    x: Any = Q
    for _ in range(depth):
        x = sp.Add(sp.Mul(x, A, evaluate=False), 1, evaluate=False)
    return x


def roots(depth: int) -> Any:
    x: Any = Q
    for _ in range(depth):
        x = sp.sqrt(1 + x)
    return x


def with_bob(add: Callable[[eg.Model], Any] = lambda m: None, gravity: Any = (0, -9.81, 0), **given: Any) -> eg.Model:
    """A pendulum whose body has these values, with something added."""
    m = eg.Model("made", gravity=gravity)
    m.parameter("a", 2.0)
    m.parameter("b", 3.0)
    bob = m.body("bob", **{"mass": 1, "com": (0, -1, 0), **given})
    m.revolute("hinge", m.ground, bob, coordinate="q")
    add(m)
    return m


def lagrangian(e: Any, q: Any = Q, **given: Any) -> eg.Model:
    return eg.Model.from_lagrangian("made", e, [q], **given)


def kinetic() -> Any:
    return sp.Symbol("q_dot") ** 2 / 2


#: Place of an expression -> the model with the object there.
PLACES: dict[str, Callable[[Any], Any]] = {
    "parameter": lambda e: with_bob(lambda m: m.parameter("c", e)),
    "input": lambda e: with_bob(lambda m: m.input("u", e)),
    "signal": lambda e: with_bob(lambda m: m.input("u", 0.0, signal=e)),
    "gravity": lambda e: with_bob(gravity=(0, e, 0)),
    "mass": lambda e: with_bob(mass=e),
    "com": lambda e: with_bob(com=(e, 0, 0)),
    "coms": lambda e: with_bob(com=e),
    "inertia": lambda e: with_bob(inertia={"zz": e}),
    "tensor": lambda e: with_bob(inertia=e),
    "marker": lambda e: with_bob(lambda m: m.bodies["bob"].marker("tip", at=(e, 0, 0), rpy=(0, 0, e))),
    "axis": lambda e: with_bob(lambda m: m.prismatic("slide", m.bodies["bob"], m.body("other", mass=1), axis=e)),
    "torque": lambda e: with_bob(lambda m: m.torque("motor", "hinge", e)),
    "force": lambda e: with_bob(lambda m: m.force("push", m.bodies["bob"], (e, 0, 0))),
    "spring": lambda e: with_bob(
        lambda m: m.spring("k", m.ground.at(1, 0, 0), m.bodies["bob"].at(e, 1, 0), stiffness=e, length=e)
    ),
    "output": lambda e: with_bob(lambda m: m.output("y", e)),
    "event": lambda e: with_bob(lambda m: m.event("hit", e, reset={"q_dot": e})),
    "initial": lambda e: with_bob(lambda m: m.initial(q=e)),
    "independent": lambda e: with_bob(lambda m: m.independent(e)),
    "between": lambda e: with_bob(lambda m: m.revolute("other", e, m.body("two", mass=1))),
    "gear": lambda e: with_bob(lambda m: m.coupling("held", {"q": e}, offset=e)),
    "driver": lambda e: with_bob(lambda m: m.driver("held", "hinge", e)),
    "simulation": lambda e: with_bob(lambda m: m.simulation(end=e)),
    "lagrangian": lambda e: lagrangian(e, parameters={A: 2, B: 3}),
    "lagrangian alone": lambda e: lagrangian(e),
    "lagrangian of time": lambda e: lagrangian(e, QT, parameters={"a": 2, "b": 3}),
    "coordinate": lambda e: lagrangian(kinetic(), e),
    "forces": lambda e: lagrangian(kinetic(), forces=[e], dissipation=e, parameters={A: e}),
    "constraints": lambda e: lagrangian(kinetic(), constraints=[e]),
    "name": lambda e: eg.Model(e),
    "from_sympy": lambda e: eg.from_sympy(e),
}
#: Place -> what SymPy makes of the object before it is given.
BEFORE: dict[str, Callable[[Any], Any]] = {
    "lagrangian": lambda e: kinetic() + e,
    "lagrangian of time": lambda e: QT.diff(T) ** 2 / 2 - QT**2 + e,
}


class SympyObjects(Kind):
    """Objects built of words, put into one place of a small model."""

    name = "sympy"
    unjudged = (SymPyDeprecationWarning,)

    def prepare(self, folder: Path) -> None:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            for word in LEAVES:  # SymPy loads much at first use
                with contextlib.suppress(Exception):
                    LEAVES[word]()
        model = PLACES["output"](Q)
        model.derive()
        model.to_yaml()
        with contextlib.suppress(eg.EomgenError):
            eg.from_sympy(Q)

    def make(self, r: random.Random) -> dict[str, Any]:
        place, depth = r.choice(list(PLACES)), r.choice((0, 0, 1, 1, 2, 3))
        return {"place": place, "object": words(r, depth), "derive": r.random() < 0.1}

    def build(self, case: Any) -> Any:
        value = built(case["object"])
        return BEFORE.get(case["place"], lambda e: e)(value), PLACES[case["place"]], case["derive"]

    def run(self, given: Any, folder: Path) -> str:
        value, place, derive = given
        model = place(value)
        repr(model), model._repr_html_()
        model.mechanism()
        if derive:
            model.derive()
            model.to_yaml()
        return "taken"


def words(r: random.Random, depth: int) -> list[Any]:
    """A tree of words: [leaf], [operation, tree] or [operation, tree, tree]."""
    if depth <= 0:
        return [r.choice(list(LEAVES))]
    if r.random() < 0.5:
        return [r.choice(list(ONE)), words(r, depth - 1)]
    return [r.choice(list(TWO)), words(r, depth - 1), words(r, r.randrange(depth))]


def built(tree: list[Any]) -> Any:
    """The object of a tree, where SymPy makes it."""
    word, *parts = tree
    table: dict[str, Callable[..., Any]] = (LEAVES, ONE, TWO)[len(parts)]
    return table[word](*map(built, parts))


KINDS = {"sympy": SympyObjects()}
