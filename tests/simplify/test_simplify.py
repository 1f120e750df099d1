"""Forms of expressions: what hand calculation would join and factor, equal values, bounded effort."""

from __future__ import annotations

import math
import random
from typing import Any

import pytest
import sympy
from sympy.abc import a, b, c, d, k, l, m, x, y

from eomgen.graph.core import Graph
from eomgen.graph.evaluate import evaluate
from eomgen.graph.sympy_lower import lower as lower_by
from eomgen.simplify import WHOLE, simplify
from eomgen.simplify.atoms import Atoms, Work, freeze, join
from eomgen.simplify.factoring import Factoring
from eomgen.simplify.form import WORK

A, B, C = sympy.symbols("A B C")
sin, cos, sqrt = sympy.sin, sympy.cos, sympy.sqrt


def lower(graph: Graph, expression: Any) -> Any:
    return lower_by(graph, expression, lambda x: graph.symbol(x.name) if x.is_Symbol else None)


def short(expression: Any, **more: Any) -> Any:
    """The form of one expression, written out."""
    form = simplify([lower(Graph(), expression)], sizes=WHOLE, **more)
    assert form is not None
    named, (found,) = form.sympy()
    assert named == []
    return found


@pytest.mark.parametrize(
    ("given", "wanted"),
    [
        (cos(A) * cos(B) - sin(A) * sin(B), "cos(A + B)"),
        (x * cos(A) * cos(B) + x * sin(A) * sin(B), "x*cos(A - B)"),
        (sin(A) * cos(B) + cos(A) * sin(B), "sin(A + B)"),
        (a * sin(A) ** 2 + a * cos(A) ** 2, "a"),
        (a - a * sin(A) ** 2, "a*cos(A)**2"),
        (cos(A) * cos(A + B) + sin(A) * sin(A + B), "cos(B)"),
        (sin(A + B) * cos(B) - cos(A + B) * sin(B), "sin(A)"),
        (sin(A + B) - sin(A) * cos(B), "sin(B)*cos(A)"),
        (sin(A) ** 4 + sin(A) ** 2 * cos(A) ** 2, "sin(A)**2"),
        (cos(A) * (cos(B) * cos(C) - sin(B) * sin(C)) - sin(A) * (sin(B) * cos(C) + cos(B) * sin(C)), "cos(A + B + C)"),
        (cos(A) + sin(A) ** 2 / cos(A), "1/cos(A)"),
        (sin(A + sympy.pi / 2) * x, "x*cos(A)"),
        (cos(A - sympy.pi / 2), "sin(A)"),
        (sin(-A) + sin(A), "0"),
        (m * a * x + m * b * x, "m*x*(a + b)"),
        (a * c + a * d + b * c + b * d, "(a + b)*(c + d)"),
        (k * (x - y) ** 2 / 2, "k*(x - y)**2/2"),
        (x**2 + 2 * x * y + y**2, "(x + y)**2"),
        ((a**2 - b**2) / (a + b), "a - b"),
        (sqrt(a + b) * sqrt(a + b) - b, "a"),
        (a / (2 * x + 2 * y) - a / (x + y) / 2, "0"),
        (m * l**2 / 12 + m * (l / 2) ** 2, "l**2*m/3"),
    ],
)
def test_as_by_hand(given: Any, wanted: str) -> None:
    assert sympy.sstr(short(given)) == wanted


def test_quarter_turns() -> None:
    for quarters in range(-4, 5):
        for turn in (sin, cos):
            graph = Graph()
            form = simplify([graph.apply(turn.__name__, graph.symbol("A") + quarters * math.pi / 2)], sizes=WHOLE)
            assert form is not None
            assert form.sympy()[1] == [turn(A + quarters * sympy.pi / 2)]


def test_roots_of_squares_have_no_sign() -> None:
    """sqrt(x^2 + 2 x y + y^2) is never shown as x + y; sqrt(cos^2) is abs(cos)."""
    graph = Graph()
    value = lower(graph, sin(A) ** 2)
    root = graph.apply("sqrt", graph.one - value)
    form = simplify([root], sizes=WHOLE)
    assert form is not None
    assert form.sympy()[1] == [sympy.Abs(cos(A))]


@pytest.mark.parametrize(
    ("given", "wanted"),
    [
        ((2 * a + a * b + 4 * x + 2 * b * x) / (2 + b), "a + 2*x"),  # together
        (x * a / (a + b) + x * b / (a + b), "x"),  # in two terms
        (cos(A) * a**2 / (a + b) - cos(A) * b**2 / (a + b) + x, "x + (a - b)*cos(A)"),  # beside others
        ((5 + d) * ((5 + d / 2) / (5 + d)) ** 2 - d**2 / 4 / (5 + d), "5"),  # Steiner's term of a point on a rod
        (-(a**2) + 2 * a * x - x**2, "-(a - x)**2"),
    ],
)
def test_exact_quotients_and_squares(given: Any, wanted: str) -> None:
    assert sympy.sstr(short(given)) == wanted


def test_products_of_lengths_stay_products() -> None:
    """The potential of a spring of numbers, and a product of lengths beside terms that are collected."""
    extension = sympy.Abs(x - sympy.Rational(1, 2)) - sympy.Rational(1, 10)
    V = short(100 * extension**2 + a * c + a * d)
    assert sympy.sstr(V) == "a*(c + d) + 100*(Abs(x - 0.5) - 0.1)**2"
    grip = -c * (sympy.Abs(x) - b) * (k * sympy.Abs(x) + a * y - b)
    found = short(grip + l * x * y + l * x * d)
    assert found.count_ops() <= (grip + l * x * (y + d)).count_ops()
    assert (found - grip - l * x * (y + d)).expand() == 0


def test_springs_keep_their_extension() -> None:
    r, l0, g, theta_dot = sympy.symbols("r l0 g theta_dot")
    assert sympy.sstr(short(m * g * cos(A) + m * r * theta_dot**2 - k * (r - l0), rates=["theta_dot"])) == (
        "g*m*cos(A) + k*(l0 - r) + m*r*theta_dot**2"
    )


def random_expression(choice: random.Random, depth: int) -> Any:
    """Sums, products, quotients, powers, roots and turns of five symbols."""
    if depth == 0:
        return choice.choice([a, b, x, A, B, sympy.Rational(choice.randint(-7, 7), choice.randint(1, 4)), sympy.pi / 6])
    one, other = (random_expression(choice, depth - 1) for _ in range(2))
    return choice.choice(
        [
            lambda: one + other,
            lambda: one - other,
            lambda: one * other,
            lambda: one * other,
            lambda: sin(one) * cos(other),
            lambda: cos(one),
            lambda: one / (other**2 + 1),
            lambda: one / (2 + cos(other)),
            lambda: sqrt(one**2 + other**2 + 1),
            lambda: one**2,
            lambda: sympy.Abs(one),
            lambda: sympy.atan2(one, 2 + other**2),
            lambda: sympy.Piecewise((one, other < a), (other, True)),
        ]
    )()


@pytest.mark.parametrize("seed", range(60))
def test_values_stay(seed: int) -> None:
    """Of random expressions, whole and with names, at random numbers."""
    choice = random.Random(seed)
    given = [random_expression(choice, choice.randint(2, 5)) for _ in range(3)]
    graph = Graph()
    lowered = [lower(graph, expression) for expression in given]
    values = {name: choice.uniform(0.3, 1.7) for name in ("a", "b", "x", "A", "B")}
    wanted = [float(v) for v in evaluate(lowered, values)]
    numbers = {sympy.Symbol(name): sympy.Float(value, 30) for name, value in values.items()}
    for more in ({}, {"sizes": (1,)}, {"sizes": WHOLE}):
        form = simplify(lowered, **more)
        assert form is not None
        named, expressions = form.sympy()
        known = dict(numbers)
        for symbol, expression in named:
            known[symbol] = expression.xreplace(known)
        for expression, value in zip(expressions, wanted, strict=True):
            found = float(sympy.N(expression.xreplace(known), 30))
            assert math.isclose(found, value, rel_tol=1e-9, abs_tol=1e-9)


def test_names_are_used_before_they_are_explained_nowhere() -> None:
    graph = Graph()
    u = graph.symbol("u")
    long = lower(graph, sum((sympy.Symbol(f"p{i}") + x) ** 3 * sin(i * A) for i in range(1, 9)))
    form = simplify([long * u, long * long, graph.apply("sqrt", long * long + u)], [], sizes=(1,))
    assert form is not None
    named, expressions = form.sympy()
    known: set[Any] = set()
    mine = {symbol for symbol, _ in named}
    for symbol, expression in named:
        assert expression.free_symbols & mine <= known
        known.add(symbol)
    assert all(expression.free_symbols & mine <= known for expression in expressions)


def test_given_names_stay_or_are_put_in() -> None:
    """A name whose value is long stays; one whose value is short does not."""
    graph = Graph()
    ratio, tiny = graph.symbol("ratio"), graph.symbol("tiny")
    value = lower(graph, (a * sin(A) + b * cos(B) + x) / (a * cos(A) + b * sin(B) + y))
    uses = [ratio * graph.symbol(f"u{i}") + 1 / tiny for i in range(5)]
    form = simplify(uses, [("ratio", value), ("tiny", lower(graph, 2 * a))])
    assert form is not None
    named, expressions = form.sympy()
    assert [str(symbol) for symbol, _ in named] == ["ratio"]
    for i, expression in enumerate(expressions):
        assert expression - sympy.Symbol(f"u{i}") * sympy.Symbol("ratio") == 1 / (2 * a)


def test_effort_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """A product of thirty sums, which multiplied out has 2^30 terms, stays a product."""
    spent: list[Work] = []
    original = Work.__init__

    def kept(self: Work, allowed: float) -> None:
        original(self, allowed)
        self.first = allowed  # type: ignore[attr-defined]
        spent.append(self)

    left: list[float] = []
    monkeypatch.setattr(Work, "__init__", kept)
    spend = Work.spend
    monkeypatch.setattr(Work, "spend", lambda self, n: (left.append(self.left), spend(self, n))[1])
    product = sympy.Mul(*(sympy.Symbol(f"p{i}") + sympy.Symbol(f"q{i}") for i in range(30)))
    found = short(product)
    assert found == product
    assert len(spent) == 1
    assert WORK - min(left) < WORK


def test_deep_nesting_needs_no_recursion() -> None:
    """Of calls in calls, as of a table with many intervals."""
    graph = Graph()
    found = graph.symbol("x")
    for i in range(150):
        found = graph.apply("select", graph.apply("lt", graph.symbol("x"), float(i)), graph.symbol(f"p{i}"), found)
    form = simplify([found], sizes=WHOLE)
    assert form is not None
    (expression,) = form.sympy()[1]
    for i in reversed(range(150)):
        (value, condition), (expression, _) = expression.args
        assert (value, condition) == (sympy.Symbol(f"p{i}"), x < i)


def test_nothing_of_nothing() -> None:
    assert simplify([]) is None


@pytest.mark.parametrize(
    ("given", "wanted"),
    [
        (sympy.Abs(x - y) ** 2, (x - y) ** 2),
        (a * sympy.Abs(x - y) ** 2 - a * x**2, a * y * (y - 2 * x)),
        (sympy.Abs(x - y) ** -2, (x - y) ** -2),
        (sqrt((x - y) ** 2) * sympy.Abs(x - y), (x - y) ** 2),
        (sympy.Abs(x * y) ** 2, x**2 * y**2),
    ],
)
def test_squares_of_magnitudes_are_squares(given: Any, wanted: Any) -> None:
    found = short(given)
    assert not found.has(sympy.Abs)
    assert sympy.expand(found / wanted) == 1 or sympy.expand(found - wanted) == 0


def test_numbers_are_what_was_written() -> None:
    """0.1 * 87 is 8.700000000000001 to a computer."""
    graph = Graph()
    s = graph.symbol("s")
    for value, wanted in (
        (0.1 * 87.0, sympy.Float(8.7)),
        (8.534699999999999, sympy.Float(8.5347)),
        (0.1 + 0.2, sympy.Float(0.3)),
        (1 / 3 - 1e-16, sympy.Rational(1, 3)),
        (3 * math.pi / 4 + 4e-16, 3 * sympy.pi / 4),
        (math.e, sympy.Float(math.e)),
    ):
        form = simplify([graph.constant(value) * s], sizes=WHOLE)
        assert form is not None
        (found,) = form.sympy()[1]
        assert str(found) == str(wanted * sympy.Symbol("s"))
        assert float(found.subs("s", 1)) == pytest.approx(value, rel=1e-15)


def test_decimals_and_fractions_do_not_mix() -> None:
    assert str(short(x / 2 + sympy.Float(0.431) * y + 87 * a / 5)) == "17.4*a + 0.5*x + 0.431*y"
    assert str(short(x / 2 + 2 * y / 5)) == "x/2 + 2*y/5"
    assert str(short(x / 3 + sympy.Float(0.431) * y)) == "x/3 + 0.431*y"
    assert str(short(sqrt(x) / 2 + sympy.Float(0.431) * y)) == "0.5*sqrt(x) + 0.431*y"
    assert str(short(sympy.Float(0.023751) * a + sympy.Float(0.1462528) * b)) == "0.023751*a + 0.1462528*b"
    assert str(short(sympy.Float(0.023751) * a * x + sympy.Float(0.023751) * b * x)) == "0.023751*x*(a + b)"


def test_long_roots_that_repeat_have_names() -> None:
    graph = Graph()
    inside = a**2 + 2 * l * (l - l * cos(A) + a * sin(A))
    given = [x / sqrt(inside) + a * sqrt(inside), y / inside, sqrt(a + b) / x]
    form = simplify([lower(graph, e) for e in given], sizes=WHOLE)
    assert form is not None
    assert form.sympy()[0] == []
    named, found = form.sympy(roots=True)
    ((name, root),) = named
    assert str(name) == "r0"
    assert found == [x / name + a * name, y / name**2, sqrt(a + b) / x]
    values = {a: 0.7, l: 1.3, A: 0.4, x: 2.0, y: -1.1, b: 0.2}
    for shown, wanted in zip(found, given, strict=True):
        assert float(shown.subs(name, root).subs(values)) == pytest.approx(float(wanted.subs(values)), rel=1e-14)


def test_names_of_roots_come_before_the_choices_that_hold_them() -> None:
    graph = Graph()
    inside = a**2 + 2 * l * (l - l * cos(A) + a * sin(A))
    first, second = sympy.symbols("first second")
    choices = [sympy.Piecewise((sqrt(inside), x > a), (b, True)), sympy.Piecewise((x * first, y > b), (c, True))]
    given = [x / sqrt(inside), y / inside, y + sin(A) * second, second**2]
    meant = [lower(graph, e) for e in choices]
    form = simplify([lower(graph, e) for e in given], [("first", meant[0]), ("second", meant[1])], sizes=WHOLE)
    assert form is not None
    named, found = form.sympy(roots=True)
    assert "r0" in [str(name) for name, _ in named]
    values = {a: 0.7, l: 1.3, A: 0.4, x: 2.0, y: 1.1, b: 0.2, c: 0.1}
    known = dict(values)
    for name, expression in named:
        assert expression.free_symbols <= set(known)
        known[name] = float(expression.subs(known))
    for symbol, choice in zip((first, second), choices, strict=True):
        values[symbol] = float(choice.subs(values))
    for shown, wanted in zip(found, given, strict=True):
        assert float(shown.subs(known)) == pytest.approx(float(wanted.subs(values)), rel=1e-14)


def test_terms_above_and_below_one_sum_are_not_taken_together() -> None:
    """a F + b / F share no factor; c F + a F do."""
    atoms = Atoms()
    one, other, third = (((atoms.id("sym", name), 1),) for name in "abc")
    sum_ = atoms.id("factor", freeze({((atoms.id("sym", "x"), 1),): 1, ((atoms.id("sym", "y"), 1),): 1}))
    above, below = ((sum_, 1),), ((sum_, -1),)
    poly = {join(one, above): 1, join(other, below): 1, join(third, above): 1}
    found = Factoring(atoms, Work(WORK)).factored(poly)
    assert len(found) == 2
    assert join(other, below) in found


@pytest.mark.parametrize(
    ("masses", "wanted"),
    [
        (("m1", "m2", "m3"), "m_123"),
        (("m_B", "m_F", "m_R"), "m_BFR"),
        (("m_B", "k_F", "m_R"), "k0"),
        (("m_B", "m2", "m_R"), "k0"),
    ],
)
def test_sums_of_parameters_of_one_letter_are_called_by_it(masses: tuple[str, ...], wanted: str) -> None:
    graph = Graph()
    total = graph.zero
    for name in masses:
        total = total + graph.symbol(name)
    uses = [total * graph.symbol(f"u{i}") + total / graph.symbol(f"w{i}") for i in range(8)]
    form = simplify(uses, sizes=(1,))
    assert form is not None
    named, _ = form.sympy(parameters=masses)
    assert [str(symbol) for symbol, _ in named] == [wanted]
