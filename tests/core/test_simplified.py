"""Equations are shown as a hand would write them: equal, joined, factored, and no longer than in a textbook."""

import statistics
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
import sympy
from models import TESTS
from ruamel.yaml import YAML
from sweeps import part_of

import eomgen as eg


def shown(given: Any) -> Any:
    """A force as its equation shows it."""
    equations = eg.Model.from_equations("shown", ["A", "B", "x"], np.eye(3), [given, 0, 0]).derive()
    assert equations.intermediates == []
    return equations.force[0]


@pytest.mark.parametrize(
    ("given", "wanted"),
    [
        # sines and cosines
        ("cos(A)*cos(B) - sin(A)*sin(B)", "cos(A + B)"),
        ("x*cos(A)*cos(B) + x*sin(A)*sin(B)", "x*cos(A - B)"),
        ("sin(A)*cos(B) + cos(A)*sin(B)", "sin(A + B)"),
        ("sin(A + B)*cos(B) - cos(A + B)*sin(B)", "sin(A)"),
        ("sin(A + B) - sin(A)*cos(B)", "sin(B)*cos(A)"),
        ("a*sin(A)**2 + a*cos(A)**2", "a"),
        ("a - a*sin(A)**2", "a*cos(A)**2"),
        ("sin(A)**4 + sin(A)**2*cos(A)**2", "sin(A)**2"),
        ("cos(A) + sin(A)**2/cos(A)", "1/cos(A)"),
        ("sin(A + pi/2)*x", "x*cos(A)"),
        ("cos(A + pi/2)", "-sin(A)"),
        ("cos(A - pi/2)", "sin(A)"),
        ("sin(A - pi)", "-sin(A)"),
        ("cos(A + 3*pi/2)", "sin(A)"),
        ("sin(-A) + sin(A)", "0"),
        # factors, quotients, squares
        ("m*a*x + m*b*x", "m*x*(a + b)"),
        ("a*c + a*d + b*c + b*d", "(a + b)*(c + d)"),
        ("k*x*x/2 - k*x*y + k*y*y/2", "k*(x - y)**2/2"),
        ("m*l**2/12 + m*(l/2)**2", "l**2*m/3"),
        ("a/(2*x + 2*y) - a/(x + y)/2", "0"),
        ("(2*a + a*b + 4*x + 2*b*x)/(2 + b)", "a + 2*x"),
        ("cos(A)*a**2/(a + b) - cos(A)*b**2/(a + b) + x", "x + (a - b)*cos(A)"),
        ("(5 + d)*((5 + d/2)/(5 + d))**2 - d**2/4/(5 + d)", "5"),  # Steiner's term of a point on a rod
        ("-(a**2) + 2*a*x - x**2", "-(a - x)**2"),
        # roots and magnitudes, which have no sign
        ("sqrt(a + b)*sqrt(a + b) - b", "a"),
        ("sqrt((x - y)**2)*abs(x - y)", "(x - y)**2"),
        ("100*(abs(x - 0.5) - 0.1)**2 + a*c + a*d", "a*(c + d) + 100*(sqrt((x - 0.5)**2) - 0.1)**2"),
        # numbers
        ("0.1*87*x", "8.7*x"),
        ("8.534699999999999*x", "8.5347*x"),
        ("x/2 + 2*y/5", "x/2 + 2*y/5"),
        ("x/2 + 0.431*y + 87*a/5", "17.4*a + 0.5*x + 0.431*y"),
        ("x/3 + 0.431*y", "x/3 + 0.431*y"),
    ],
)
def test_as_by_hand(given: str, wanted: str) -> None:
    names = {name: sympy.Symbol(name) for name in "ABxyabcdkml"}
    found, form = shown(given), sympy.parse_expr(wanted, names)
    assert sympy.expand(found - form) == 0
    assert found.count_ops() <= form.count_ops()
    if "." in wanted:
        assert sympy.sstr(found) == wanted


@pytest.mark.parametrize(
    "text", ["sqrt(1 - sin(A)**2)", "sqrt(x**2 + 2*x*B + B**2)", "x*abs(x - B)/(x - B)", "abs(x)**3"]
)
def test_roots_of_squares_and_magnitudes_have_no_sign(text: str) -> None:
    """The root of 1 - sin^2 is never shown as a cosine, that of (x + B)^2 never as x + B."""
    scope = {"sqrt": np.sqrt, "sin": np.sin, "abs": abs}
    for A, B, x in ((2.0, 0.7, -1.3), (0.4, -2.0, 0.3)):
        value = float(shown(text).subs({"A": A, "B": B, "x": x}))
        assert value == pytest.approx(eval(text, scope, {"A": A, "B": B, "x": x}), rel=1e-13)  # noqa: S307


def test_effort_is_bounded() -> None:
    """A product of thirty sums, which multiplied out has 2^30 terms, stays a product; choices in choices go deep."""
    product = sympy.Mul(*(sympy.Symbol(f"p{i}") + sympy.Symbol(f"q{i}") for i in range(30)))
    assert shown(product) == product
    nested: Any = sympy.Symbol("x")
    for i in range(60):
        nested = sympy.Piecewise((sympy.Symbol(f"p{i}"), sympy.Symbol("x") < i), (nested, True))
    found = shown(nested)
    for i in (-0.5, 30.5, 70.0):
        assert found.subs("x", i) == nested.subs("x", i)


def rods(joints: int) -> Any:
    """Equations of a chain of rods on a cart, large enough for named parts."""
    m = eg.Model("rods", gravity=(0, "-g", 0))
    for name in ("g", "l", "m"):
        m.parameter(name, 1.0)
    last: Any = m.body("cart", mass="m")
    m.prismatic("s", m.ground, last, axis="x")
    for k in range(joints):
        rod = m.body(f"rod{k}", mass="m", com=(0, "-l/2", 0), inertia={"zz": "m*l**2/12"})
        m.revolute(f"q{k}", last, rod)
        last = rod.at(0, "-l", 0)
    return m.derive()


def test_names_stand_after_what_they_are_made_of_and_are_needed() -> None:
    equations = rods(7)
    named, force = equations.written("force")
    mine, known = {symbol for symbol, _ in named}, set()
    assert len(named) > 2
    for symbol, part in named:
        assert part.free_symbols & mine <= known
        known.add(symbol)
    used = set().union(*(x.free_symbols for x in [*force, *equations.mass_matrix, *(part for _, part in named)]))
    assert mine <= used
    angles = {f"q{k}" for k in range(7)}
    for _, part in named:  # sums of angles stand in their sines, without names of their own
        assert not (part.is_Add and {str(x) for x in part.args} <= angles)
    shown_size = sum(int(x.count_ops()) for x in (*force, *(part for _, part in named)))
    assert shown_size < 8 * equations.operations["bias"].total


# -- beside textbooks -------------------------------------------------------------------------------------------------

FORMS: dict[str, Any] = YAML(typ="safe").load(
    (TESTS / "reference" / "textbook_equations.yaml").read_text(encoding="utf-8")
)
OF_BODIES = ("embedding", "lagrange", "gibbs_appell", "newton_euler")
OF_LAGRANGIANS = ("lagrange",)
NAMES = {name: sympy.Symbol(name) for name in ("I1", "I2", "I3", "I", "E", "S", "N", "Q", "O", "beta", "gamma", "zeta")}
PAIRS = [(name, m) for name, form in FORMS.items() for m in (OF_BODIES if "model" in form else OF_LAGRANGIANS)]
LONGEST, USUAL = 1.15, 1.0


def read(text: object) -> Any:
    return sympy.sympify(str(text), locals=NAMES)


def equations(name: str, method: str) -> Any:
    form = FORMS[name]
    if "model" in form:
        with TemporaryDirectory() as folder, Path(folder, f"{name}.yaml").open("w+", encoding="utf-8") as file:
            YAML().dump({"name": name, **form["model"]}, file)
            file.flush()
            return eg.load(file.name).derive(method)
    given = form["lagrangian"]
    coordinates = [sympy.Symbol(q) for q in given["coordinates"]]
    parameters = {sympy.Symbol(k): v for k, v in given["parameters"].items()}
    return eg.Model.from_lagrangian(name, read(given["L"]), coordinates, parameters=parameters).derive(method)


@cache  # most methods end in the same expressions
def is_zero(difference: Any) -> bool:
    return bool(sympy.simplify(sympy.expand(sympy.expand_trig(difference))) == 0)


@cache
def ours_and_theirs(name: str, method: str) -> tuple[list[Any], list[Any]]:
    eqs, form = equations(name, method), FORMS[name]
    book = [read(x) for row in form["mass_matrix"] for x in row] + [read(x) for x in form["force"]]
    assert eqs.intermediates == []
    return [*eqs.mass_matrix, *eqs.force], book


def lengths(expressions: list[Any]) -> tuple[int, int]:
    """Operations and characters."""
    return sum(int(sympy.count_ops(x)) for x in expressions), sum(len(str(x)) for x in expressions)


@pytest.mark.parametrize(("name", "method"), part_of(PAIRS, lambda pair: pair[1] in ("embedding", "lagrange")))
def test_equal_to_the_book_and_no_longer(name: str, method: str) -> None:
    ours, book = ours_and_theirs(name, method)
    driven = {sympy.Symbol("phi_dot"): sympy.Symbol("Omega")} if "hoop" in name else {}
    for mine, printed in zip(ours, book, strict=True):
        assert is_zero(mine.subs(driven) - printed)
    for mine, printed in zip(lengths(ours), lengths(book), strict=True):
        assert mine <= LONGEST * printed


def test_usually_shorter() -> None:
    both = [tuple(map(lengths, ours_and_theirs(name, OF_LAGRANGIANS[0]))) for name in FORMS]
    for k in range(2):
        assert statistics.median(ours[k] / book[k] for ours, book in both) <= USUAL


def test_a_free_body_in_euler_parameters_obeys_newton_and_euler() -> None:
    """By every method its mass matrix is diag(m, m, m, A, B, C) and its force the gyroscopic moments."""
    model = eg.Model("free", gravity=(0, 0, "-g"))
    for name, value in {"g": 9.81, "m": 2.0, "A": 0.1, "B": 0.2, "C": 0.25}.items():
        model.parameter(name, value)
    body = model.body("rigid", mass="m", inertia=("A", "B", "C"))
    model.free("j", model.ground, body, rotation="euler_parameters")
    m, g, A, B, C, u, v, w = sympy.symbols("m g A B C j_wx j_wy j_wz")
    for method in (*OF_BODIES, "recursive", "augmented", "amalgamated", "hamilton"):
        eqs = model.derive(method)
        assert eqs.intermediates == []
        assert eqs.mass_matrix == sympy.diag(m, m, m, A, B, C)
        gyroscopic = [(B - C) * v * w, (C - A) * w * u, (A - B) * u * v]
        assert (eqs.force - sympy.Matrix([0, 0, -m * g, *gyroscopic])).expand() == sympy.zeros(6, 1)
        assert list(eqs.momenta)[3:] == [A * u, B * v, C * w]


def test_the_rolling_disc_has_three_equations() -> None:
    """J. I. Neimark, N. A. Fufaev, Dynamics of Nonholonomic Systems: in lean, its sine and the rates alone."""
    eqs = eg.load_example("rolling_disc").derive()
    assert eqs.intermediates == []
    m, r, lean = sympy.symbols("m r lean")
    s = sympy.sin(lean)
    wanted = [[1 + 5 * s**2, 0, 6 * s], [0, 5, 0], [6 * s, 0, 6]]
    assert (eqs.mass_matrix - m * r**2 / 4 * sympy.Matrix(wanted)).expand() == sympy.zeros(3, 3)
    assert {x.name for x in eqs.force.free_symbols} == {"m", "r", "g", "lean", "yaw_dot", "lean_dot", "spin_dot"}
    assert sum(sympy.count_ops(x) for x in eqs.force) <= 52


@pytest.mark.thorough
def test_choices_within_choices_are_named() -> None:
    """Six feet that are held or free: each depends on those before, so that choices written out double with each."""
    eqs = eg.load_example("rimless_wheel").derive()
    compiled = eqs.operations["inverse_dynamics"]
    every = [x for _, x in eqs.intermediates] + list(eqs.force)
    assert sum(x.count_ops() for x in every) < 2 * (compiled.multiplications + compiled.additions)
    assert max(x.count_ops() for x in every) < 100
