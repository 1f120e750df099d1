"""Every operation that an expression can have: values, first and second derivatives, domains, and what they cost.

The judge is SymPy with 30 digits.  An operation is reached as a user reaches it: in texts and SymPy expressions of
potentials (whose slopes are forces and whose second slopes are in Jacobians), of given equations and of outputs.
"""

import math
import random
import re
from functools import cache
from typing import Any

import numpy as np
import pytest
import sympy as sp
from models import EXAMPLES
from refusals import refuses

import eomgen as eg

X, Y, Z = sp.symbols("x y z", real=True)
T = sp.Symbol("t")
HALF = sp.Rational(1, 2)
#: Text of an operation -> the same in SymPy, and a place inside its domain and away from its corners.
SMOOTH: dict[str, tuple[Any, tuple[float, float]]] = {
    "x + y": (X + Y, (0.7, 1.3)),
    "x - y": (X - Y, (0.7, 1.3)),
    "y - x": (Y - X, (0.7, 1.3)),
    "-x": (-X, (0.7, 1.3)),
    "x*y": (X * Y, (0.7, 1.3)),
    "x/y": (X / Y, (0.7, 1.3)),
    "x/(x*y + 2)": (X / (X * Y + 2), (-0.7, 0.4)),
    "3/(x + y)": (3 / (X + Y), (0.7, 1.3)),
    "x**3": (X**3, (-0.7, 1.3)),
    "x**-2": (X**-2, (-0.7, 1.3)),
    "x**1.5": (X ** sp.Rational(3, 2), (0.7, 1.3)),
    "x**2.5*y": (X ** sp.Rational(5, 2) * Y, (0.7, 1.3)),
    "x**-0.5": (X**-HALF, (0.7, 1.3)),
    "x**1.3": (X ** sp.Float(1.3), (0.7, 1.3)),
    "x**y": (X**Y, (0.7, 1.3)),
    "2**x": (2**X, (-0.7, 1.3)),
    "sqrt(x)": (sp.sqrt(X), (0.7, 1.3)),
    "hypot(x, y)": (sp.sqrt(X**2 + Y**2), (0.7, -1.3)),
    "exp(x)": (sp.exp(X), (-0.7, 1.3)),
    "log(x)": (sp.log(X), (0.7, 1.3)),
    "sin(x)": (sp.sin(X), (0.7, 1.3)),
    "cos(x)": (sp.cos(X), (0.7, 1.3)),
    "tan(x)": (sp.tan(X), (0.7, 1.3)),
    "asin(x)": (sp.asin(X), (0.4, 1.3)),
    "acos(x)": (sp.acos(X), (0.4, 1.3)),
    "atan(x)": (sp.atan(X), (-2.7, 0.3)),
    "atan2(x, y)": (sp.atan2(X, Y), (0.7, -1.3)),
    "sinh(x)": (sp.sinh(X), (0.7, 1.3)),
    "cosh(x)": (sp.cosh(X), (-0.7, 1.3)),
    "tanh(x)": (sp.tanh(X), (0.7, 1.3)),
    "asinh(x)": (sp.asinh(X), (-1.3, 0.3)),
    "acosh(x)": (sp.acosh(X), (1.4, 1.3)),
    "atanh(x)": (sp.atanh(X), (0.4, 1.3)),
    "deg(x)": (X * sp.pi / 180, (0.7, 1.3)),
    "abs(x)*y": (sp.Abs(X) * Y, (-0.7, 1.3)),
    "min(x, y)*x": (sp.Min(X, Y) * X, (0.7, 1.3)),
    "min(y, x)*x": (sp.Min(X, Y) * X, (1.3, 0.7)),
    "max(x, y, 0.1)*y": (sp.Max(X, Y, sp.Rational(1, 10)) * Y, (1.3, 0.7)),
    "sign(x)*x*y": (sp.sign(X) * X * Y, (-0.7, 1.3)),
    "heaviside(x)*y**2": (sp.Heaviside(X) * Y**2, (0.7, 1.3)),
    "where(x < y, x**2*y, y)": (sp.Piecewise((X**2 * Y, X < Y), (Y, True)), (0.7, 1.3)),
    "where(x < y, x**2*y, y**3)": (sp.Piecewise((X**2 * Y, X < Y), (Y**3, True)), (1.3, 0.7)),
    "sin(x) if x >= y or y <= 0 else cos(x*y)": (sp.Piecewise((sp.sin(X), X >= Y), (sp.cos(X * Y), True)), (0.7, 1.3)),
}
NAMES = list(SMOOTH)


def exact(expression: Any, point: dict[Any, float]) -> float:
    return float(expression.subs({name: sp.Rational(value) for name, value in point.items()}).evalf(30))


def renamed(text: str, k: int) -> str:
    """The text with x, y of its own: x0, y0, x1, ..."""
    return re.sub(r"\b([xy])\b", rf"\g<1>{k}", text)


@cache
def every_operation(target: str) -> Any:
    """Unit masses in the potential of the sum of all of them, each in a plane of its own, with its value as output."""
    m = eg.Model.from_lagrangian(
        f"operations_{target}",
        " + ".join(f"(x{k}_dot**2 + y{k}_dot**2)/2 - ({renamed(name, k)})" for k, name in enumerate(NAMES)),
        [f"{axis}{k}" for k in range(len(NAMES)) for axis in "xy"],
    )
    for k, name in enumerate(NAMES):
        m.output(f"out{k}", renamed(name, k))
    return m.compile(target=target, **({"optimize": 0} if target == "cython" else {}))


@cache
def found(target: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Values, slopes and second slopes at the places of the table."""
    mod, n = every_operation(target), len(NAMES)
    q = np.ravel([place for _, place in SMOOTH.values()])
    x = np.concatenate([q, np.zeros(2 * n)])
    jacobian = mod.jacobian(0.0, x)[2 * n :, : 2 * n]
    second = np.array([jacobian[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] for k in range(n)])
    assert np.count_nonzero(jacobian) == np.count_nonzero(second)  # no operation touches the plane of another
    np.testing.assert_array_equal(mod.outputs(0.0, np.repeat(x[:, None], 3, axis=1)).T, [mod.outputs(0.0, x)] * 3)
    return mod.outputs(0.0, x), -mod.rhs(0.0, x)[2 * n :].reshape(n, 2), -second


@pytest.mark.parametrize("target", ["numpy", "cython"])
@pytest.mark.parametrize("name", NAMES)
def test_values_and_derivatives_are_those_of_sympy(name: str, target: str) -> None:
    form, place = SMOOTH[name]
    point, k = dict(zip((X, Y), place, strict=True)), NAMES.index(name)
    value, slope, second = (part[k] for part in found(target))
    assert value == pytest.approx(exact(form, point), rel=1e-14)
    assert slope == pytest.approx([exact(form.diff(v), point) for v in (X, Y)], rel=1e-13)
    wanted = [[exact(form.diff(v).diff(w), point) for w in (X, Y)] for v in (X, Y)]
    np.testing.assert_allclose(second, wanted, rtol=1e-12, atol=1e-14)


def test_no_documented_function_is_missing_above() -> None:
    text = (EXAMPLES.parent / "docs" / "model_file.md").read_text(encoding="utf-8")
    words = re.search(r"and the functions `([a-z0-9\s]+)`", text)
    assert words is not None
    assert len(words[1].split()) > 20
    assert {word for word in words[1].split() if not any(f"{word}(" in name for name in NAMES)} == set()


def outputs(*texts: Any, **values: float) -> np.ndarray:
    """Values of expressions of coordinates by name."""
    m = eg.Model.from_lagrangian("asked", " + ".join(f"{name}_dot**2/2" for name in values), list(values))
    for k, text in enumerate(texts):
        m.output(f"asked{k}", text)
    return np.array(m.compile(target="numpy").outputs(0.0, [*values.values(), *(0.0 for _ in values)]))


def forces_and_slopes(*laws: Any, **values: float) -> tuple[np.ndarray, np.ndarray]:
    """Laws of forces on unit masses at values of their coordinates, and their slopes."""
    names = [*values, *(f"more{k}" for k in range(len(laws) - len(values)))]
    m = eg.Model.from_equations("laws", names, np.eye(len(names)), [*laws, *[0] * (len(names) - len(laws))])
    mod = m.compile(target="numpy")
    x = np.zeros(2 * len(names))
    x[: len(values)] = list(values.values())
    n, k = len(names), len(laws)
    return mod.rhs(0.0, x)[n : n + k], mod.jacobian(0.0, x)[n : n + k, : len(values)]


TRUTHS = ["x < y", "x <= y", "x > y", "x >= y", "x == y", "x != y", "not x", "x and y", "x or y", "not (x < y and y)"]
TRUTHS += ["x < y < 0.5", "-1 <= x <= y", "x and not y or y > 1", "where(x, 3, 4)", "2*(x < y) - y", "1 if x else 2"]


@pytest.mark.parametrize("place", [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (-1.0, 2.0), (0.3, 0.3), (-0.5, 0.2)])
@pytest.mark.quick
def test_comparisons_are_those_of_python(place: tuple[float, float]) -> None:
    """A chain a < b < c is true where both are; any number but 0 is true."""
    x, y = place
    scope: dict[str, Any] = {"x": x, "y": y, "where": lambda c, a, b: a if c else b}
    truth = ("and", "or", "not ", "<", ">", "=")
    wanted = [eval(text, scope) for text in TRUTHS]  # noqa: S307 - texts of this file
    wanted = [
        bool(w) if any(t in text for t in truth) and "2*" not in text else w
        for text, w in zip(TRUTHS, wanted, strict=True)
    ]
    np.testing.assert_array_equal(outputs(*TRUTHS, x=x, y=y), np.array(wanted, dtype=float))


def test_values_at_the_edges_of_domains() -> None:
    edges = {
        "sqrt(x)": 0.0,
        "hypot(x, x)": 0.0,
        "atan2(x, x)": 0.0,
        "atan2(x, -1)": math.pi,
        "atan2(-1, x)": -math.pi / 2,
    }
    edges |= {"asin(1 - x)": math.pi / 2, "acos(x - 1)": math.pi, "acosh(1 + x)": 0.0, "sign(x)": 0.0, "x**0": 1.0}
    edges |= {"heaviside(x)": 0.5, "abs(x)": 0.0, "0*x + exp(-800 + x)": 0.0, "tanh(x + 800)": 1.0}
    np.testing.assert_allclose(outputs(*edges, x=0.0), list(edges.values()), rtol=1e-15)


@pytest.mark.parametrize("target", ["numpy", "cython"])
@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("sqrt(x)", (-1e-9, 1.0)),
        ("log(x)", (0.0, 1.0)),
        ("log(x)", (-1.0, 1.0)),
        ("asin(x)", (1.0001, 1.0)),
        ("acos(x)", (-1.0001, 1.0)),
        ("acosh(x)", (0.99, 1.0)),
        ("atanh(x)", (1.0, 1.0)),
        ("x/y", (1.0, 0.0)),
        ("x**1.3", (-8.0, 1.0)),
        ("x**y", (-8.0, 0.5)),
        ("x**-2", (0.0, 1.0)),
        ("exp(x)", (800.0, 1.0)),
    ],
)
def test_outside_of_a_domain_a_call_is_refused(text: str, place: tuple[float, float], target: str) -> None:
    mod, n = every_operation(target), len(NAMES)
    q = np.array([place for _, place in SMOOTH.values()])
    q[NAMES.index(text)] = place
    x = np.concatenate([q.ravel(), np.zeros(2 * n)])
    refuses("EG-NOT-FINITE finite", mod.outputs, 0.0, x)


def test_a_branch_that_is_not_taken_does_not_leak() -> None:
    """Roots and logarithms have infinite or no slopes beside the branch that holds."""
    laws = ("where(0 < x, log(x), 5*x)", "3*where(0 < x, sqrt(x), 2*x)*(x + 1)", "3*max(-sqrt(x), 2*x + 1)*(x - 1)/2")
    values, slopes = forces_and_slopes(*laws, "2*where(0 < x, min(sqrt(x), log(x)), x*x*5 + x)", x=0.0)
    np.testing.assert_allclose(values, [0, 0, -1.5, 0])
    np.testing.assert_allclose(slopes[:, 0], [5, 6, -1.5, 2])
    values, slopes = forces_and_slopes(laws[0], x=-2.0)
    assert (values[0], slopes[0, 0]) == (-10.0, 5.0)


@pytest.mark.parametrize("exponent", [1.5, 2.5, 4.5, 1.3])
def test_powers_of_a_depth_are_flat_where_it_is_zero(exponent: float) -> None:
    """Contact laws k max(d, 0)^n: their slope is 0 at and before contact, not 0 times infinity."""
    law = f"3*max(x, 0)**{exponent}"
    for place in (-1.0, 0.0):
        assert forces_and_slopes(law, x=place) == (0.0, 0.0)
    value, slope = forces_and_slopes(law, x=0.7)
    assert (value[0], slope[0, 0]) == pytest.approx(
        (3 * 0.7**exponent, 3 * exponent * 0.7 ** (exponent - 1)), rel=1e-14
    )


# -- random expressions -----------------------------------------------------------------------------------------------

PARTS = {  # operations that keep their domains whatever their operands are
    "({0} + {1})": lambda a, b: a + b,
    "({0} - {1})": lambda a, b: a - b,
    "({0}*{1})": lambda a, b: a * b,
    "({0}/({1}**2 + 0.5))": lambda a, b: a / (b**2 + HALF),
    "(-{0}/3)": lambda a, b: -a / 3,
    "({0}**2 + 1.25)**-1.5": lambda a, b: (a**2 + 5 * HALF**2) ** (-3 * HALF),
    "sqrt({0}**2 + 0.25)": lambda a, b: sp.sqrt(a**2 + HALF**2),
    "exp(sin({0}))": lambda a, b: sp.exp(sp.sin(a)),
    "log({0}**2 + 1)": lambda a, b: sp.log(a**2 + 1),
    "cos({0} + {1})": lambda a, b: sp.cos(a + b),
    "asin(tanh({0})/2)": lambda a, b: sp.asin(sp.tanh(a) / 2),
    "acos(cos({0})/2)": lambda a, b: sp.acos(sp.cos(a) / 2),
    "atan2({0}, {1}**2 + 0.5)": lambda a, b: sp.atan2(a, b**2 + HALF),
    "(sin({0}) + 2)**cos({1})": lambda a, b: (sp.sin(a) + 2) ** sp.cos(b),
    "hypot({0}, {1}**2 + 1)": lambda a, b: sp.sqrt(a**2 + (b**2 + 1) ** 2),
    "abs({0})": lambda a, b: sp.Abs(a),
    "max({0}, {1})": sp.Max,
    "min({0}, {1} + x)": lambda a, b: sp.Min(a, b + X),
    "where({0} < {1}, {0}*y, {1})": lambda a, b: sp.Piecewise((a * Y, a < b), (b, True)),
}


def random_expression(choice: random.Random, size: int) -> tuple[str, Any]:
    pool: list[tuple[str, Any]] = [("x", X), ("y", Y), ("z", Z)]
    for _ in range(size):
        text = choice.choice(list(PARTS))
        one, other = choice.choice(pool), choice.choice(pool)
        pool.append((f"({text.format(one[0], other[0])})", PARTS[text](one[1], other[1])))
    return pool[-1]


@pytest.mark.parametrize("seed", [*range(4), *(pytest.param(k, marks=pytest.mark.thorough) for k in range(4, 40))])
def test_random_expressions_and_their_slopes_agree_with_sympy(seed: int) -> None:
    """As text and as SymPy expression, alone and in what reads and shows the equations."""
    choice = random.Random(seed)
    pairs = [random_expression(choice, 7) for _ in range(3)]
    place = {name: choice.randint(-6, 6) * 0.3173 + 0.0711 * k + 0.0137 for k, name in enumerate((X, Y, Z))}
    values = {str(name): value for name, value in place.items()}
    plain = {name: sp.Symbol(str(name)) for name in place}
    wanted = np.array([exact(form, place) for _, form in pairs])
    for laws in ([text for text, _ in pairs], [form.subs(plain) for _, form in pairs]):
        forces, slopes = forces_and_slopes(*laws, **values)
        np.testing.assert_allclose(forces, wanted, rtol=1e-9, atol=1e-9)
        rows = [[exact(form.diff(name), place) for name in place] for _, form in pairs]
        np.testing.assert_allclose(slopes, rows, rtol=1e-8, atol=1e-8)
    equations = eg.Model.from_equations("read", list(values), np.eye(3), [text for text, _ in pairs]).derive()
    known = {plain[name]: value for name, value in place.items()}
    named, shown = equations.written("force")
    for symbol, part in named:
        known[symbol] = float(part.subs(known))
    np.testing.assert_allclose([float(x.subs(known)) for x in shown], wanted, rtol=1e-9, atol=1e-9)


# -- expressions of SymPy ---------------------------------------------------------------------------------------------

x, y, z = sp.symbols("x y z")
GIVEN = [
    *(sp.Float("0.1", 50), sp.pi + sp.E, sp.GoldenRatio - sp.EulerGamma, sp.Rational(-1, 12)),
    *(2 * x * y**2 / (3 * z), x**-3, x**7, x ** sp.Rational(1, 3), sp.sqrt(2) * x, sp.exp(-x) / (1 + y)),
    *(sp.sec(x) + sp.csc(y) + sp.cot(z), sp.sech(x) + sp.csch(y) + sp.coth(z)),
    *(sp.Heaviside(x - y) + sp.Heaviside(z), sp.Max(x, y, z) - sp.Min(x, y, z)),
    sp.Piecewise((1, (x < y) & ((x > 0) | ~(y < z))), (2, sp.Eq(x, y)), (3, sp.Ne(x, y)), (0, True)),
    sp.Piecewise((1, sp.Xor(x < y, y < z)), (2, True)),
    sp.Piecewise((1, sp.ITE(x < y, x > z, y < z)), (2, True)),
    sp.Piecewise((1, sp.Implies(x < y, y < z, evaluate=False)), (2, True)),
    sp.besselj(0, 1) * x,
    sp.re(x) + sp.im(x) + sp.conjugate(y),
    sp.Derivative(x**3 * y, x),
]


@pytest.mark.parametrize("place", [(0.7, 1.3, 0.4), (2.5, 2.0, 3.5)])
def test_classes_of_sympy_have_their_values(place: tuple[float, float, float]) -> None:
    values = dict(zip("xyz", place, strict=True))
    point = {sp.Symbol(name): sp.Rational(value) for name, value in values.items()}
    wanted = [float(sp.sympify(form).doit().subs(point).evalf(30)) for form in GIVEN]
    np.testing.assert_allclose(outputs(*GIVEN, **values), wanted, rtol=1e-14)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (sp.I * x, "EG-EXPRESSION complex"),
        (sp.sqrt(-2) * x, "EG-EXPRESSION complex"),
        (x + sp.oo, "EG-EXPRESSION infinities"),
        (sp.zoo, "EG-EXPRESSION complex"),
        (sp.gamma(x), "EG-EXPRESSION gamma"),
        (sp.floor(x), "EG-EXPRESSION floor"),
        (sp.Integer(10) ** 400, "EG-EXPRESSION large"),
        (sp.Piecewise((x, x < 1), (2 * x, x < 3)), "EG-EXPRESSION cases"),
        (sp.Matrix([x]), "EG-TYPE Matrix([[x]])"),
        ("foo(x)", "EG-EXPRESSION 'foo'"),
        ("sin(x, x)", "EG-EXPRESSION sin() 1 2"),
        ("x +", "EG-EXPRESSION 4 'x +'"),
        ("x.real", "EG-EXPRESSION dot"),
        ("__import__('os')", "EG-EXPRESSION 12"),
    ],
    ids=str,
)
def test_what_has_no_meaning_is_refused_where_it_stands(given: Any, said: str) -> None:
    refuses(f"{said} equations.forcing[0]:", lambda: eg.Model.from_equations("refused", ["x"], [[1]], [given]).derive())


# -- what operations cost ---------------------------------------------------------------------------------------------


def cost(*laws: Any) -> tuple[int, int, int, dict[str, int]]:
    """Multiplications, additions, divisions and functions of laws of forces."""
    m = eg.Model.from_equations("cost", ["x", "y", *(f"q{k}" for k in range(len(laws) - 2))], np.eye(max(2, len(laws))),
                                [*laws, *[0] * (2 - len(laws))])  # fmt: skip
    found = m.derive().operations["bias"]
    return found.multiplications, found.additions, found.divisions, found.functions


@pytest.mark.parametrize(
    ("laws", "wanted"),
    [
        (["sin(x + y)**2 - 3*x", "-(sin(x + y)**2 - 3*x)/y"], (2, 2, 1, {"sin": 1})),
        (["x - x", "x/x - 1"], (0, 0, 0, {})),
        (["0*sin(x)", "x**0 - 1"], (0, 0, 0, {})),
        (["(x + y) - y"], (0, 0, 0, {})),
        (["sin(-x) + sin(x)", "cos(-x) - cos(x)"], (0, 0, 0, {})),
        (["sqrt(x)*sqrt(x)"], (0, 0, 0, {})),
        (["2*(3*x)", "x/4"], (2, 0, 0, {})),
        (["x/3"], (0, 0, 1, {})),  # 1/3 is no number of a computer
        (["x**3", "x**64"], (7, 0, 0, {})),  # x**2 is in both
        (["x**0.3"], (0, 0, 0, {"pow": 1})),
        (["sqrt(x) + 1/sqrt(x)"], (0, 1, 1, {"sqrt": 1})),
        (["2*x/(y*(x + 1))"], (2, 1, 1, {})),
        (["(x + y)*(y + x)", "(x + y)**2"], (1, 1, 0, {})),  # the same is formed once
    ],
)
@pytest.mark.quick
def test_nothing_is_computed_twice_or_for_nothing(laws: list[str], wanted: Any) -> None:
    assert cost(*laws) == wanted


def test_shared_parts_and_deep_chains_take_no_longer_than_they_are() -> None:
    shared = x
    for _ in range(200):  # 2^200 terms written out
        shared = sp.Add(sp.Mul(shared, shared, evaluate=False), shared, evaluate=False)
    assert cost(shared)[:2] == (200, 200)
    deep = x
    for _ in range(20_000):
        deep = sp.Pow(sp.Add(deep, y, evaluate=False), 1, evaluate=False)
        hash(deep)
    assert cost(deep)[:2] == (0, 20_000)


def test_the_slopes_of_a_potential_cost_a_few_times_the_potential() -> None:
    """Of a chain through 60 coordinates: reverse accumulation, whose work does not grow with their number."""
    names, chain = [f"q{k}" for k in range(60)], "1"
    for name in names:
        chain = f"(({chain})*sin({name}) + 1/(2 + {name}))"
    kinetic = " + ".join(f"{name}_dot**2/2" for name in names)
    done = eg.Model.from_lagrangian("chain", f"{kinetic} - ({chain})", names).derive().operations
    value = eg.Model.from_equations("value", ["a"], [[1]], [re.sub(r"q\d+", "(a + \\g<0>)", chain)]).derive()
    assert done["bias"].total < 5 * value.operations["bias"].total


# -- numbers ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "number"),
    [
        (sp.Float("0.1", 50), 0.1),
        (sp.Float("1.00000000000000011102230246251565404236316680908203126", 60), 1.0000000000000002),  # upwards
        (sp.Float("-2.5e-300", 20), -2.5e-300),
        (sp.Rational(1, 3), 1 / 3),
        (sp.Integer(10) ** 22 + 1, 1e22),
        (sp.pi, math.pi),
    ],
)
def test_numbers_become_the_nearest_double(given: Any, number: float) -> None:
    assert outputs(given, x=0.0).tolist() == [number]


@pytest.mark.parametrize(
    ("number", "shown"),
    [
        (0.5, HALF),
        (1 / 12, sp.Rational(1, 12)),
        (9.81, sp.Rational(981, 100)),
        (210e9, sp.Integer(210000000000)),
        (-math.pi / 2, -sp.pi / 2),
        (math.radians(30), sp.pi / 6),
        (0.1234567, sp.Float(0.1234567)),
        (0.1 + 0.2, sp.Float("0.3")),
    ],
)
def test_numbers_are_shown_as_they_were_meant(number: float, shown: Any) -> None:
    force = eg.Model.from_equations("number", ["x"], [[1]], [number]).derive().force[0]
    assert float(force) == pytest.approx(number, rel=1e-15)
    assert sp.nsimplify(force - shown, rational=True, tolerance=1e-14) == 0
    assert sp.sympify(force).has(sp.pi) == sp.sympify(shown).has(sp.pi)


# -- what rounding leaves ---------------------------------------------------------------------------------------------


def turned(rpy: tuple[float, float, float]) -> np.ndarray:
    """The pose of a body that is welded to a marker turned so."""
    m = eg.Model("turned")
    m.weld("w", m.ground.at(0, 0, 0, rpy=rpy), m.body("b", mass=1))
    m.prismatic("s", m.ground, m.body("other", mass=1))
    mod = m.compile(target="numpy")
    return np.array(mod.poses(mod.x0()[: mod.n_q])[mod.body_names.index("b"), :3, :3])


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("quarters", [1, 2, 3, -2])
def test_quarter_and_half_turns_are_exact(axis: int, quarters: int) -> None:
    """cos(pi/2) is 6e-17 in double precision: such entries of a constant turn are exactly 0, 1 and -1."""
    rpy = [0.0, 0.0, 0.0]
    rpy[axis] = quarters * math.pi / 2
    c, s = (round(f(rpy[axis])) for f in (math.cos, math.sin))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    wanted = np.eye(3)
    wanted[i, i], wanted[j, j], wanted[i, j], wanted[j, i] = c, c, -s, s
    np.testing.assert_array_equal(turned(tuple(rpy)), wanted)


def test_a_small_turn_is_not_taken_for_rounding() -> None:
    assert turned((0.0, 0.0, 1e-7))[1, 0] == pytest.approx(1e-7, rel=1e-9)


def held(equation: str, **parameters: float) -> Any:
    """The report of two constraints on free angles a, b, c: b = 0.1 and an equation."""
    m = eg.Model("held")
    for name, value in parameters.items():
        m.parameter(name, value)
    for name in "abc":
        m.revolute(name, m.ground, m.body(f"body_{name}", mass=1, inertia={"zz": 1}))
    m.coupling("first", equation="b - 0.1")
    m.coupling("second", equation=equation)
    m.initial(a=0.0, b=0.1)
    return m.check()


@pytest.mark.quick
def test_identities_hold_nothing_and_what_is_small_does() -> None:
    for identity in (
        "sin(a)**2 + cos(a)**2 - 1",
        "sin(a + c) - sin(a)*cos(c) - cos(a)*sin(c)",
        "0.1*a + 0.2*a - 0.3*a",
    ):
        for factor in ("", "1e-6*", "3.7*", "c*"):  # whose rounding is that of the product
            assert held(f"{factor}({identity})").constraints == 1
    for small in ("1e-9*sin(a) + sin(c)**2 + cos(c)**2 - 1", "(a + 1e8)**2 - 1e16 - 2e8*a - c"):
        assert held(small).constraints == 2


def test_a_coefficient_that_cancels_holds_nothing() -> None:
    """0.1 + 0.2 - 0.3 is 5.6e-17 to a computer: beside its terms that is nothing, and no row of its own size."""
    assert held("(p + r - s)*c", p=0.1, r=0.2, s=0.3).degrees_of_freedom == 2
    assert held("(p + r - s)*c", p=0.1, r=0.2, s=0.5).degrees_of_freedom == 1
