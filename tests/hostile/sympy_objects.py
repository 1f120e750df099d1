"""Odd SymPy objects in every place where Python code may give an expression."""

from __future__ import annotations

import contextlib
import random
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import sympy
from sympy.utilities.exceptions import SymPyDeprecationWarning

import eomgen
from eomgen.errors import EomgenError

from .kind import pruned

Q, T, A, B = sympy.Symbol("q"), sympy.Symbol("t"), sympy.Symbol("a"), sympy.Symbol("b")
QT = sympy.Function("q")(T)
#: Word -> an object without parts.
LEAVES: dict[str, Callable[[], Any]] = {
    "q": lambda: Q,
    "t": lambda: T,
    "a": lambda: A,
    "b": lambda: B,
    "q_dot": lambda: sympy.Symbol("q_dot"),
    "q(t)": lambda: QT,
    "diff q": lambda: QT.diff(T),
    "diff2 q": lambda: QT.diff(T, 2),
    "diff3 q": lambda: QT.diff(T, 3),
    "unknown": lambda: sympy.Symbol("unknown"),
    "dummy": lambda: sympy.Dummy("q"),
    "wild": lambda: sympy.Wild("w"),
    "positive q": lambda: sympy.Symbol("q", positive=True),
    "integer a": lambda: sympy.Symbol("a", integer=True),
    "imaginary a": lambda: sympy.Symbol("a", imaginary=True),
    "commuting not": lambda: sympy.Symbol("a", commutative=False),
    "empty name": lambda: sympy.Symbol(""),
    "odd name": lambda: sympy.Symbol("*/ x; \n"),
    "long name": lambda: sympy.Symbol("a" * 5000),
    "code name": lambda: sympy.Symbol("__import__('os').system('touch CANARY')"),
    "marker": lambda: sympy.Symbol("x(bob)"),
    "marker of none": lambda: sympy.Symbol("vx(nobody)"),
    "boolean name": lambda: sympy.Symbol("True"),
    "0": lambda: sympy.S.Zero,
    "1": lambda: sympy.S.One,
    "-1": lambda: sympy.S.NegativeOne,
    "1/2": lambda: sympy.S.Half,
    "2": lambda: sympy.Integer(2),
    "pi": lambda: sympy.pi,
    "E": lambda: sympy.E,
    "I": lambda: sympy.I,
    "oo": lambda: sympy.oo,
    "-oo": lambda: -sympy.oo,
    "zoo": lambda: sympy.zoo,
    "nan": lambda: sympy.nan,
    "gamma": lambda: sympy.EulerGamma,
    "golden": lambda: sympy.GoldenRatio,
    "tribonacci": lambda: sympy.TribonacciConstant,
    "true": lambda: sympy.true,
    "false": lambda: sympy.false,
    "huge": lambda: sympy.Integer(10) ** 400,
    "huger": lambda: sympy.Integer(7) ** 20000,
    "tiny": lambda: sympy.Rational(1, 10**400),
    "ratio": lambda: sympy.Rational(10**400 + 1, 10**400),
    "digits": lambda: sympy.Float("0.1", 50),
    "float": lambda: sympy.Float(1.5),
    "float huge": lambda: sympy.Float("1e400"),
    "float tiny": lambda: sympy.Float("1e-400"),
    "float hugest": lambda: sympy.Float("1e9999"),
    "float inf": lambda: sympy.Float("inf"),
    "float nan": lambda: sympy.Float("nan"),
    "denormal": lambda: sympy.Float(5e-324),
    "matrix symbol": lambda: sympy.MatrixSymbol("M", 2, 2),
    "matrix": lambda: sympy.Matrix([[1, 2], [3, 4]]),
    "matrix 1": lambda: sympy.Matrix([[1]]),
    "immutable": lambda: sympy.ImmutableMatrix([[1]]),
    "identity": lambda: sympy.Identity(2),
    "array": lambda: sympy.Array([1, 2]),
    "set": lambda: sympy.FiniteSet(1, 2),
    "empty set": lambda: sympy.S.EmptySet,
    "reals": lambda: sympy.S.Reals,
    "interval": lambda: sympy.Interval(0, 1),
    "tuple": lambda: sympy.Tuple(Q, A),
    "dict": lambda: sympy.Dict({Q: A}),
    "string": lambda: sympy.core.symbol.Str("q"),
    "poly": lambda: sympy.Poly(Q**2 + 1, Q),
    "class": lambda: sympy.sin,
    "undefined class": lambda: sympy.Function("f"),
    "lambda": lambda: sympy.Lambda(Q, Q**2),
    "identity function": lambda: sympy.S.IdentityFunction,
    "order": lambda: sympy.O(Q),
    "root": lambda: sympy.CRootOf(Q**5 - Q - 1, 0),
    "root sum": lambda: sympy.RootSum(Q**3 + Q + 3, sympy.Lambda(Q, Q**2)),
    "vector": lambda: sympy.vector.CoordSys3D("N").i,
    "frame": lambda: sympy.physics.mechanics.ReferenceFrame("N").x,
    "unit": lambda: sympy.physics.units.meter,
    "quaternion": lambda: sympy.Quaternion(1, 0, 0, 0),
    "dynamic": lambda: sympy.physics.mechanics.dynamicsymbols("q"),
    "dynamic other": lambda: sympy.physics.mechanics.dynamicsymbols("z"),
    "indexed": lambda: sympy.IndexedBase("a")[0],
    "f(q)": lambda: sympy.Function("f")(Q),
    "f(t)": lambda: sympy.Function("f")(T),
    "f()": lambda: sympy.Function("f")(),
    "f(f)": lambda: sympy.Function("f")(sympy.Function("f")(Q)),
    "f(q, t)": lambda: sympy.Function("f")(Q, T),
    "df": lambda: sympy.Function("f")(Q).diff(Q),
    "subs": lambda: sympy.Subs(sympy.Function("f")(Q).diff(Q), Q, A),
    "subs 2": lambda: sympy.Subs(Q**2, Q, sympy.zoo),
    "integral": lambda: sympy.Integral(Q, (Q, 0, 1)),
    "integral open": lambda: sympy.Integral(sympy.exp(Q**Q), Q),
    "sum": lambda: sympy.Sum(Q, (Q, 1, 3)),
    "sum endless": lambda: sympy.Sum(1 / Q, (Q, 1, sympy.oo)),
    "sum long": lambda: sympy.Sum(sympy.sin(B), (B, 1, 10**9)),
    "product": lambda: sympy.Product(Q, (Q, 1, 3)),
    "limit": lambda: sympy.Limit(sympy.sin(Q) / Q, Q, 0),
    "derivative": lambda: sympy.Derivative(Q**2, Q),
    "derivative high": lambda: sympy.Derivative(sympy.sin(Q) ** 9, (Q, 40)),
    "derivative n": lambda: sympy.Derivative(QT, (T, A)),
    "zeta": lambda: sympy.zeta(3),
    "gamma(1/3)": lambda: sympy.gamma(sympy.Rational(1, 3)),
    "factorial": lambda: sympy.factorial(10**5, evaluate=False),
    "gamma huge": lambda: sympy.gamma(10**9, evaluate=False),
    "besselj": lambda: sympy.besselj(0, Q),
    "erf": lambda: sympy.erf(1),
    "dirac": lambda: sympy.DiracDelta(Q),
    "pow 0 -1": lambda: sympy.Pow(0, -1, evaluate=False),
    "pow 0 -a": lambda: sympy.Pow(0, -A, evaluate=False),
    "pow huge": lambda: sympy.Pow(9, sympy.Pow(9, 9, evaluate=False), evaluate=False),
    "pow 0 0": lambda: sympy.Pow(0, 0, evaluate=False),
    "log 0": lambda: sympy.log(0, evaluate=False),
    "log -1": lambda: sympy.log(-1, evaluate=False),
    "sqrt -1": lambda: sympy.sqrt(-2),
    "asin 2": lambda: sympy.asin(2),
    "acos huge": lambda: sympy.acos(10**30),
    "atan2 0": lambda: sympy.atan2(0, 0, evaluate=False),
    "mod": lambda: sympy.Mod(Q, 2),
    "floor": lambda: sympy.floor(Q),
    "lower": lambda: sympy.LambertW(Q),
    "and": lambda: sympy.And(Q < 1, A > 2),
    "relation": lambda: Q < A,
    "equal": lambda: sympy.Eq(Q, A),
    "equal chain": lambda: sympy.Eq(Q < 1, A < 2),
    "contains": lambda: sympy.Contains(Q, sympy.Interval(0, 1)),
    "ite": lambda: sympy.ITE(Q < 1, A > 1, B > 1),
    "xor": lambda: sympy.Xor(Q < 1, A < 1),
    "nand": lambda: sympy.Nand(Q < 1, A < 1),
    "piecewise open": lambda: sympy.Piecewise((A, Q < 1)),
    "piecewise": lambda: sympy.Piecewise((A, Q < 1), (B, True)),
    "piecewise nan": lambda: sympy.Piecewise((sympy.nan, Q < 1), (B, True)),
    "max": lambda: sympy.Max(Q, A),
    "min": lambda: sympy.Min(Q, 2),
    "heaviside": lambda: sympy.Heaviside(Q, 0),
    "sign": lambda: sympy.sign(Q),
    "abs": lambda: abs(Q),
    "str": lambda: "a*q",
    "str odd": lambda: "9**9**9",
    "none": lambda: None,
    "python int": lambda: 10**400,
    "python nan": lambda: float("nan"),
    "python complex": lambda: 1j,
    "list": lambda: [Q],
    "numpy": lambda: __import__("numpy").float64(2.0),
    "numpy array": lambda: __import__("numpy").ones(3),
    "object": lambda: object(),
    "deep": lambda: nested(900),
    "wide": lambda: sympy.Add(*(sympy.sin(k * Q) for k in range(300))),
    "expand": lambda: (Q + A + B + T + 1) ** 60,
    "sqrt nest": lambda: roots(40),
    "re": lambda: sympy.re(Q + sympy.I * A),
    "im": lambda: sympy.im(QT),
    "arg": lambda: sympy.arg(Q),
    "conjugate": lambda: sympy.conjugate(Q),
}
#: Word -> operation on one or two objects, unevaluated where it can be.
ONE: dict[str, Callable[[Any], Any]] = {
    "neg": lambda x: -x,
    "inverse": lambda x: 1 / x,
    "sin": sympy.sin,
    "sin raw": lambda x: sympy.sin(x, evaluate=False),
    "sqrt": sympy.sqrt,
    "exp": sympy.exp,
    "log": sympy.log,
    "tan": sympy.tan,
    "acos": sympy.acos,
    "abs": sympy.Abs,
    "sign": sympy.sign,
    "not": sympy.Not,
    "raw": lambda x: sympy.UnevaluatedExpr(x),
    "f": lambda x: sympy.Function("f")(x),
    "diff": lambda x: sympy.Derivative(x, Q),
    "integral": lambda x: sympy.Integral(x, (Q, 0, A)),
    "sum": lambda x: sympy.Sum(x, (B, 1, 2)),
    "piecewise": lambda x: sympy.Piecewise((x, Q < 1), (1, True)),
    "subs": lambda x: sympy.Subs(x, Q, A),
    "lambda": lambda x: sympy.Lambda(Q, x),
    "heaviside": sympy.Heaviside,
    "re": sympy.re,
    "floor": sympy.floor,
    "cot": sympy.cot,
    "sech": sympy.sech,
    "gamma": sympy.gamma,
}
TWO: dict[str, Callable[[Any, Any], Any]] = {
    "add": lambda x, y: x + y,
    "mul": lambda x, y: x * y,
    "div": lambda x, y: x / y,
    "add raw": lambda x, y: sympy.Add(x, y, evaluate=False),
    "mul raw": lambda x, y: sympy.Mul(x, y, evaluate=False),
    "pow raw": lambda x, y: sympy.Pow(x, y, evaluate=False),
    "max": sympy.Max,
    "min": lambda x, y: sympy.Min(x, y, evaluate=False),
    "less": lambda x, y: sympy.StrictLessThan(x, y, evaluate=False),
    "equal": lambda x, y: sympy.Eq(x, y, evaluate=False),
    "and": lambda x, y: sympy.And(x, y, evaluate=False),
    "atan2": sympy.atan2,
    "piecewise": lambda x, y: sympy.Piecewise((x, sympy.Symbol("q") > 0), (y, True)),
    "mod": sympy.Mod,
}


def nested(depth: int) -> Any:
    x: Any = Q
    for _ in range(depth):
        x = sympy.Add(sympy.Mul(x, A, evaluate=False), 1, evaluate=False)
    return x


def roots(depth: int) -> Any:
    x: Any = Q
    for _ in range(depth):
        x = sympy.sqrt(1 + x)
    return x


def _model(**bodies: Any) -> Any:
    m = eomgen.Model("made", gravity=bodies.get("gravity", (0, -9.81, 0)))
    m.parameter("a", 2.0)
    m.parameter("b", 3.0)
    return m


def _body(e: Any, **given: Any) -> Any:
    m = _model()
    values = {"mass": 1, "com": (0, -1, 0), **given}
    bob = m.body("bob", **values)
    m.revolute("hinge", m.ground, bob, coordinate="q")
    return m


def _with(add: Callable[[Any], Any]) -> Any:
    m = _body(None)
    add(m)
    return m


#: Place of an expression -> the model with the object there.
MODELS: dict[str, Callable[[Any], Any]] = {
    "parameter": lambda e: _with(lambda m: m.parameter("c", e)),
    "input": lambda e: _with(lambda m: m.input("u", e)),
    "signal": lambda e: _with(lambda m: m.input("u", 0.0, signal=e)),
    "gravity": lambda e: _model(gravity=(0, e, 0)),
    "mass": lambda e: _body(e, mass=e),
    "com": lambda e: _body(e, com=(e, 0, 0)),
    "coms": lambda e: _body(e, com=e),
    "inertia": lambda e: _body(e, inertia={"zz": e}),
    "tensor": lambda e: _body(e, inertia=e),
    "marker": lambda e: _with(lambda m: m.bodies["bob"].marker("tip", at=(e, 0, 0), rpy=(0, 0, e))),
    "axis": lambda e: _with(lambda m: m.prismatic("slide", m.bodies["bob"], m.body("other", mass=1), axis=e)),
    "torque": lambda e: _with(lambda m: m.torque("motor", "hinge", e)),
    "force": lambda e: _with(lambda m: m.force("push", m.bodies["bob"], (e, 0, 0))),
    "spring": lambda e: _with(
        lambda m: m.spring("k", m.ground.at(1, 0, 0), m.bodies["bob"].at(e, 1, 0), stiffness=e, length=e)
    ),
    "output": lambda e: _with(lambda m: m.output("y", e)),
    "event": lambda e: _with(lambda m: m.event("hit", e, reset={"q_dot": e})),
    "initial": lambda e: _with(lambda m: m.initial(q=e)),
    "independent": lambda e: _with(lambda m: m.independent(e)),
    "between": lambda e: _with(lambda m: m.revolute("other", e, m.body("two", mass=1))),
    "gear": lambda e: _with(lambda m: m.coupling("held", {"q": e}, offset=e)),
    "driver": lambda e: _with(lambda m: m.driver("held", "hinge", e)),
    "simulation": lambda e: _with(lambda m: m.simulation(end=e)),
    "lagrangian": lambda e: eomgen.Model.from_lagrangian("made", e, [Q], parameters={A: 2, B: 3}),
    "lagrangian alone": lambda e: eomgen.Model.from_lagrangian("made", e, [Q, "q"][:1]),
    "lagrangian of time": lambda e: eomgen.Model.from_lagrangian("made", e, [QT], parameters={"a": 2, "b": 3}),
    "coordinate": lambda e: eomgen.Model.from_lagrangian("made", sympy.Symbol("q_dot") ** 2, [e]),
    "forces": lambda e: eomgen.Model.from_lagrangian(
        "made", sympy.Symbol("q_dot") ** 2 / 2, [Q], forces=[e], dissipation=e, parameters={A: e}
    ),
    "constraints": lambda e: eomgen.Model.from_lagrangian("made", sympy.Symbol("q_dot") ** 2 / 2, [Q], constraints=[e]),
    "name": lambda e: eomgen.Model(e),
    "from_sympy": lambda e: eomgen.from_sympy(e),
}


#: Place -> what SymPy makes of the object before it is given; the model with that.
BEFORE: dict[str, Callable[[Any], Any]] = {
    "lagrangian": lambda e: sympy.Symbol("q_dot") ** 2 / 2 + e,
    "lagrangian of time": lambda e: QT.diff(T) ** 2 / 2 - QT**2 + e,
}
PLACES = {word: (BEFORE.get(word, lambda e: e), model) for word, model in MODELS.items()}


class SympyObjects:
    """Objects built of words, put into one place of a small model."""

    name = "sympy"
    programs: frozenset[str] = frozenset()
    unjudged: tuple[type[Warning], ...] = (SymPyDeprecationWarning,)

    def prepare(self, folder: Path) -> None:

        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            for word in LEAVES:  # SymPy loads much at first use
                built([word])
        model = MODELS["output"](Q)
        model.derive()
        model.to_yaml()
        with contextlib.suppress(EomgenError):
            eomgen.from_sympy(Q)

    def make(self, r: random.Random) -> dict[str, Any]:
        return {
            "place": r.choice(list(PLACES)),
            "object": words(r, r.choice((0, 0, 1, 1, 2, 3))),
            "derive": r.random() < 0.1,
        }

    def build(self, case: Any) -> Any:
        value = built(case["object"])
        if value is NOTHING:
            raise ValueError("SymPy refuses it")
        before, place = PLACES[case["place"]]
        return before(value), place, case["derive"]

    def run(self, given: Any, folder: Path) -> str:
        value, place, derive = given
        model = place(value)
        repr(model), model._repr_html_()
        model.mechanism()
        if derive:
            model.derive()
            model.to_yaml()
        return "taken"

    def smaller(self, case: Any) -> Iterator[Any]:
        if case["derive"]:
            yield {**case, "derive": False}
        for part in case["object"][1:]:
            yield {**case, "object": part}
        yield from ({**case, "object": other} for other in pruned(case["object"]) if other)


NOTHING = object()


def words(r: random.Random, depth: int) -> list[Any]:
    """A tree of words: [leaf], [operation, tree] or [operation, tree, tree]."""
    if depth <= 0:
        return [r.choice(list(LEAVES))]
    if r.random() < 0.5:
        return [r.choice(list(ONE)), words(r, depth - 1)]
    return [r.choice(list(TWO)), words(r, depth - 1), words(r, r.randrange(depth))]


def built(tree: list[Any]) -> Any:
    """The object of a tree; NOTHING where SymPy itself refuses to make it."""
    try:
        word, *parts = tree
        if not parts:
            return LEAVES[word]()
        values = [built(part) for part in parts]
        if any(value is NOTHING for value in values):
            return NOTHING
        return (ONE if len(parts) == 1 else TWO)[word](*values)
    except Exception:
        return NOTHING


KIND = SympyObjects()
