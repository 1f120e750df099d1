"""What a notebook and a terminal show of equations of motion."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

import pytest
import sympy
from shown_numbers import LONG
from sweeps import part_of

import eomgen as eg
from eomgen.api.equations import Equations
from eomgen.notation import Notation
from eomgen.printing import Formulas, Order, latex, mathml, text
from eomgen.printing.factor_order import COORDINATE, GRAVITY, INPUT, MASS, PARAMETER, RATE
from eomgen.reading.equations_html import equations_html, facts_html
from eomgen.reading.formats import write_format

EXAMPLES = Path(__file__).parents[2] / "examples"
NAMES = sorted(file.stem for file in EXAMPLES.glob("*.yaml"))


@cache
def derived(name: str) -> Equations:
    return eg.load(EXAMPLES / f"{name}.yaml").derive()


@pytest.mark.parametrize("name", part_of(NAMES, lambda name: name not in LONG))
def test_every_example_shows_its_equations(name: str) -> None:
    equations = derived(name)
    shown = str(equations)
    assert max(map(len, shown.splitlines())) <= 80
    assert re.search("^ .* = ", shown, re.M) or equations.mobility.n_dof == 0
    page = equations_html(equations)
    assert "<math" in page or equations.mobility.n_dof == 0
    ElementTree.fromstring(f"<div>{facts_html(equations)}{page}</div>")  # well formed
    assert equations._repr_latex_().startswith("$")
    assert equations._repr_latex_().count("{") == equations._repr_latex_().count("}")


def test_small_equations_stand_in_matrix_form() -> None:
    lines = str(derived("double_pendulum")).splitlines()
    assert lines[:5] == [
        "equations of motion of double_pendulum",
        "  method embedding, 2 degrees of freedom",
        "coordinates",
        "  θ₁    theta1  of joint shoulder  rad",
        "  bend  bend    of joint elbow     rad",
    ]
    assert lines[6:14] == [
        "M v' = f with v' = (θ₁'', bend'')",
        "",
        "M = ⎡(m₁ + m₂) l₁² + m₂ l₂ (l₂ + 2 l₁ cos(bend))  m₂ l₂ (l₂ + l₁ cos(bend))⎤",
        "    ⎣         m₂ l₂ (l₂ + l₁ cos(bend))                     m₂ l₂²         ⎦",
        "",
        "  f_1 = m₂ l₁ l₂ bend' (2 θ₁' + bend') sin(bend) - m₂ g l₂ sin(θ₁ + bend)",
        "        - (m₁ + m₂) g l₁ sin(θ₁)",
        "  f_2 = -m₂ l₂ (l₁ θ₁'² sin(bend) + g sin(θ₁ + bend))",
    ]


def test_one_degree_of_freedom_is_one_equation() -> None:
    m = eg.Model("pendulum", gravity=(0, "-g", 0))
    for name in ("m", "l", "g"):
        m.parameter(name)
    m.revolute("pin", m.ground, m.body("bob", mass="m", com=(0, "-l", 0)), coordinate="theta")
    equations = m.derive()
    assert "  m l² θ'' = -m g l sin(θ)" in str(equations).splitlines()
    assert equations._repr_latex_() == r"$\displaystyle m l^2 \ddot{\theta} = -m g l \sin \theta$"


def test_long_equations_end_with_how_to_get_the_others() -> None:
    shown = str(derived("bicycle"))
    assert len(shown.splitlines()) < 90
    assert "eqs.tree_system" in shown


def test_page_has_picture_coordinates_and_folded_intermediates() -> None:
    page = derived("bicycle")._repr_html_()
    assert page.index("<img") < page.index("<table>") < page.index("<math displaystyle")
    assert page.count("<details><summary>") > 5  # groups of one meaning
    assert "<summary>sines and cosines" in page
    assert "sym." in page  # symmetric halves once


ORDER = Order(
    {"l": PARAMETER, "g": GRAVITY, "m1": MASS, "m2": MASS, "F": INPUT, "theta": COORDINATE, "theta_dot": RATE}
)
CASES = {
    "g*l*(m1 + m2)*sin(theta)": ("(m₁ + m₂) g l sin(θ)", r"(m_1 + m_2) g l \sin \theta"),
    "-g*m1 + l*m1*theta_dot**2 + F": ("F + m₁ l θ'² - m₁ g", r"F + m_1 l \dot{\theta}^2 - m_1 g"),
    "l**2*m1/3": ("m₁ l²/3", r"\frac{1}{3} m_1 l^2"),
    "-2*l/(3*m1*(l + g))": ("-2 l/(3 m₁ (g + l))", r"-\frac{2 l}{3 m_1 (g + l)}"),
    "cos(theta)**2*sin(theta + l)": ("cos²(θ) sin(l + θ)", r"\cos^2 \theta \sin(l + \theta)"),
    "sqrt(m1 + m2)": ("sqrt(m₁ + m₂)", r"\sqrt{m_1 + m_2}"),
    "m1*sqrt((l - g)**2)": ("m₁ |l - g|", r"m_1 \left|l - g\right|"),
    "F/((l - g)**2)**(3/2)": ("F/|l - g|³", r"\frac{F}{\left|l - g\right|^3}"),
    "sqrt(l**2*g**4)": ("|g² l|", r"\left|g^2 l\right|"),
    "Abs(l - g)**3": ("|g - l|³", r"\left|g - l\right|^3"),
    "1e-7*l": ("1e-7 l", r"1 \cdot 10^{-7} l"),
}


@pytest.mark.parametrize("given", CASES)
def test_factors_and_terms_stand_in_the_order_of_textbooks(given: str) -> None:
    names = {name: sympy.Symbol(name) for name in ORDER.kinds}
    formula = Formulas(ORDER)(sympy.parse_expr(given, names))
    notation = Notation(ORDER.kinds)
    assert (text(formula, notation).replace("\u00a0", " "), latex(formula, notation)) == CASES[given]
    ElementTree.fromstring(f"<math>{mathml(formula, notation)}</math>")


def test_long_numbers_are_rounded_where_they_are_shown_alone() -> None:
    """M_33 of the governor: 5 kg m^2 of the ball, and rho (0.01^2/3 + 0.01^4/12) of the arm."""
    equations = derived("flyball_governor")
    rho = sympy.Symbol("rho")
    assert equations.mass_matrix[2, 2].coeff(rho) == pytest.approx(1e-4 / 3 + 1e-8 / 12, rel=1e-14)
    assert "M_33 = 5 + 3.33342e-5 " in str(equations)
    assert "Long numbers are rounded to 6 digits" in str(equations)
    assert "rounded to 6 digits" in equations._repr_html_()
    assert r"3.33342 \cdot 10^{-5}" in equations._repr_latex_()
    for form in ("text", "latex"):
        written = write_format(equations, form)
        assert "3.33341666666667" in written
        assert "rounded" not in written
    assert "rounded" not in str(derived("double_pendulum"))
