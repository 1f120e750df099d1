"""LaTeX given for each kind of name: in LaTeX, text, HTML, labels of plots and the worked solution."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import sympy

import eomgen as eg
from eomgen.describe.yaml_file import describe_yaml
from eomgen.errors import ModelError
from eomgen.notation import Notation

EXAMPLES = Path(__file__).parents[2] / "examples"
BEAD = r"""
name: bead
parameters: {m: 1, g: 9.81}
equations:
  coordinates: [x, y]
  velocities: [w1, w2]
  rates: {x: w1, y: w2}
  mass_matrix: [[m, 0], [0, m]]
  forcing: [0, -m*g]
  constraints: [x**2 + y**2 - 1]
  multipliers: [S]
  latex: {x: '\xi', w1: '\nu_1', S: '\Lambda'}
outputs: {tension: {expression: S, latex: 'F_{\rm t}'}}
initial: {x: 1}
"""
PENDULUM = r"""
name: pendulum
parameters: {m: 1, g: 9.81, l: 1}
lagrangian:
  coordinates: [a]
  expression: m*l**2*a_dot**2/2 + m*g*l*cos(a)
  forces: {a: -a_dot}
  latex: {a: '\alpha', a_dot: '\Omega'}
"""


def servo() -> eg.Model:
    """A mass pulled by a force that follows its set value, every kind of name printed as said."""
    m = eg.Model("servo")
    m.parameter("lag", 0.1, latex=r"\tau_{\rm m}")
    m.input("u", 1.0, latex="u_c")
    m.state("z", "(u - z)/lag", initial=0.2, latex=r"\sigma_{\rm f}")
    m.prismatic("p", m.ground, m.body("b", mass=1), axis="x", coordinate="x", latex={"x": r"\xi", "x_dot": "w"})
    m.actuator("f", "p", "z - 3*x_dot")
    m.output("o", "2*z", latex="y_o")
    return m


def labels(trajectory: Any, *names: str) -> list[str]:
    """Texts of the legend of a plot."""
    drawn = trajectory.plot(*names)
    figure = drawn.figure if hasattr(drawn, "figure") else drawn[0].figure
    return [text.get_text() for axes in figure.axes if axes.get_legend() for text in axes.get_legend().get_texts()]


def model(text: str) -> eg.Model:
    return eg.Model.from_description(describe_yaml(text))


CASES = {
    ("bead", "w1"): (r"\nu_1", "ν₁", "<i>ν</i><sub>1</sub>", r"$\nu_{1}$"),  # noqa: RUF001
    ("bead", "S"): (r"\Lambda", "Λ", "<i>Λ</i>", r"$\Lambda$"),
    ("bead", "tension"): (r"F_{\rm t}", "F_t", "<i>F</i><sub>t</sub>", r"$F_{\mathrm{t}}$"),
    ("pendulum", "a_dot"): (r"\Omega", "Ω", "<i>Ω</i>", r"$\Omega$"),
    ("servo", "lag"): (r"\tau_{\rm m}", "τ_m", "<i>τ</i><sub>m</sub>", r"$\tau_{\mathrm{m}}$"),
    ("servo", "u"): ("u_c", "u_c", "<i>u</i><sub><i>c</i></sub>", "$u_{c}$"),
    ("servo", "z"): (r"\sigma_{\rm f}", "σ_f", "<i>σ</i><sub>f</sub>", r"$\sigma_{\mathrm{f}}$"),  # noqa: RUF001
    ("servo", "x"): (r"\xi", "ξ", "<i>ξ</i>", r"$\xi$"),
    ("servo", "x_dot"): ("w", "w", "<i>w</i>", "$w$"),
    ("servo", "o"): ("y_o", "y_o", "<i>y</i><sub><i>o</i></sub>", "$y_{o}$"),
}
MODELS = {"bead": lambda: model(BEAD), "pendulum": lambda: model(PENDULUM), "servo": servo}


@pytest.mark.parametrize(("name", "of"), CASES)
def test_all_forms_of_a_name_follow_its_latex(name: str, of: str) -> None:
    equations = MODELS[name]().derive()
    notation, module = equations.notation, equations.compile("numpy")
    printed = Notation.of(module.metadata)
    found = notation.latex(of), notation.text(of), notation.html(of), printed.mathtext(of)
    assert found == CASES[name, of]


def test_labels_and_documents_follow_too() -> None:
    bead, pendulum, machine = (make().derive() for make in MODELS.values())
    run = bead.compile("numpy").simulate((0, 0.1))
    assert labels(run, "w1", "tension") == [r"$\nu_{1}$", r"$F_{\mathrm{t}}$"]
    assert labels(machine.compile("numpy").simulate((0, 0.1)), "z", "o") == [r"$\sigma_{\mathrm{f}}$", "$y_{o}$"]
    assert r"\nu_1^2" in bead._repr_latex_()
    assert r"m l^2 \dot{\Omega} = -m g l \sin \alpha - \Omega" in pendulum._repr_latex_()  # a'' is the rate of Omega
    assert "m l² Ω' = -m g l sin(α) - Ω" in str(pendulum)  # noqa: RUF001
    document = machine.explain()
    assert r"\dot{\sigma}_{\rm f} = \frac{u_c - \sigma_{\rm f}}{\tau_{\rm m}}" in document.markdown
    assert "<mi>σ</mi>" in document.html  # noqa: RUF001
    assert document.difference < 1e-10


def test_the_angle_of_a_contact_point_takes_latex() -> None:
    text = (EXAMPLES / "cam_follower.yaml").read_text(encoding="utf-8")
    equations = model(text.replace("radius: R}", r"radius: R, latex: '\beta_{\rm c}'}")).derive()
    assert r"\beta_{\rm c}" in equations._repr_latex_()
    assert equations.notation.latex("track_contact_ddot") == r"\ddot{\beta}_{\rm c}"
    knife = text.replace("shape: roller", "shape: knife_edge").replace("radius: R}", r"latex: '\beta'}")
    with pytest.raises(ModelError, match="needs no coordinate of its own"):
        model(knife).derive()


def test_multipliers_of_a_lagrangian_take_latex() -> None:
    """A bead on a circle: the multiplier is the tension over twice the radius."""
    text = r"""
name: bead
parameters: {m: 2, g: 9.81}
lagrangian:
  coordinates: [x, y]
  expression: m*(x_dot**2 + y_dot**2)/2 - m*g*y
  constraints: [x**2 + y**2 - 1]
  latex: {x: '\xi', lambda_1: '\mu_{\rm s}'}
initial: {y: -1, x_dot: 1}
"""
    equations = model(text).derive("augmented")
    document = equations.explain()
    assert r"\mu_{\rm s}" in document.markdown
    assert r"\mu_{\rm s}" in document.latex
    assert "<mi>μ</mi>" in document.html
    assert r"\lambda_1" not in document.markdown
    assert document.difference < 1e-10
    given = {"m": 2, "g": 9.81, "x": 0, "y": -1, "x_dot": 1, "y_dot": 0}
    rows = sympy.Matrix(equations.block_system.matrix).subs(given).LUsolve(equations.block_system.right.subs(given))
    assert abs(float(rows[2])) == pytest.approx(2 * (9.81 + 1) / 2)  # m (g + v^2) / (2 r)

    x, y = sympy.symbols("x y")
    rates = sympy.symbols("x_dot y_dot")
    L = (rates[0] ** 2 + rates[1] ** 2) / 2 - 10 * y
    latex = {x: r"\xi", "lambda_1": r"\nu"}
    same = eg.Model.from_lagrangian("bead", L, [x, y], constraints=[x**2 + y**2 - 1], latex=latex)
    assert r"\nu" in same.derive("augmented").explain().markdown
    for wrong in ("lambda_2", "lambda_0"):
        with pytest.raises(ModelError, match=f"no coordinate '{wrong}'"):
            model(text.replace("lambda_1", wrong)).derive()


def test_other_names_are_refused() -> None:
    with pytest.raises(ModelError, match="no coordinate 'w3'"):
        model(BEAD.replace("w1: '", "w3: '")).derive()
