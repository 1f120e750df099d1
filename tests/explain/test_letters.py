"""Letters of matrices, energies and bodies are no names of the model, in the display and in the worked solution."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp
from shown_numbers import evaluate, number, random_state, state_values
from tex_formulas import require_tex

import eomgen as eg
from eomgen.equations import METHODS
from eomgen.explain.document import Folded, FormulaLine
from eomgen.reading.printed_equations import PrintedEquations

LETTERS = ("M", "f", "C", "B", "Q", "T", "V", "L", "S", "H", "v", "z0", "p_theta", "lambda1", "rod_F_x", "pin_M_z")


@cache
def model(links: int) -> eg.Model:
    """A chain of rods whose parameters bear the letters of a textbook's matrices; the mass of a rod is twice m_rod."""
    m = eg.Model("letters", gravity=(0, "-g", 0))
    m.parameter("g", 9.81)
    for k, name in enumerate((*LETTERS, "m_rod", "m_12")):
        m.parameter(name, 1 + 0.1 * k)
    m.input("A_12", 0.3)
    place = m.ground
    for k in range(links):
        rod = m.body("rod" if k == 0 else f"rod{k}", mass="2*m_rod + M*f", com=(0, "-L", 0), inertia={"zz": "S*L**2"})
        m.revolute("pin" if k == 0 else f"pin{k}", place, rod, coordinate="theta" if k == 0 else f"q{k}")
        place = rod.at(0, "-2*L", 0)
    m.spring("coil", m.ground.at("C", "B", 0), place, stiffness="p_theta*lambda1", length="V")
    m.actuator("motor", "pin", "Q*T*v + z0*rod_F_x - pin_M_z*H + A_12*m_12*theta_dot")
    return m


@cache
def loop() -> eg.Model:
    """A loop whose multipliers would be named as parameters are."""
    m = eg.Model("loop", gravity=(0, -9.81, 0))
    for name, value in {"lambda_1": 2.0, "A_F_x": 0.5, "M": 0.3, "c12": 1.0}.items():
        m.parameter(name, value)
    crank, rod = m.body("crank", mass="lambda_1", com=(0.1, 0, 0)), m.body("rod", mass="M*c12", com=(0.2, 0, 0))
    slider = m.body("slider", mass=1)
    m.revolute("A", m.ground, crank, coordinate="theta")
    m.revolute("B", crank.at(0.1, 0, 0), rod, coordinate="beta")
    m.revolute("C", rod.at(0.4, 0, 0), slider)
    m.prismatic("D", m.ground, slider, axis="x", coordinate="s")
    m.actuator("pull", "D", "-A_F_x*s_dot")
    m.independent("theta")
    m.initial(theta=0.3)
    m.guess(s=0.45)
    return m


def left_sides(pieces: Any) -> list[str]:
    found: list[str] = []
    for piece in pieces:
        if isinstance(piece, Folded):
            found += left_sides(piece.pieces)
        elif isinstance(piece, FormulaLine) and isinstance(piece.sides[0], str):
            found.append(piece.sides[0])
    return found


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("links", [1, 2])
def test_no_left_side_is_a_name(links: int, method: str) -> None:
    equations = model(links).derive(method)
    names = equations.notation
    document = equations.explain()
    assert document.difference < 1e-10
    printed = {names.latex(name) for name in (*equations.kinematics.parameter_names, "A_12")}
    before_numbers = [s for s in document.sections if not s.title.startswith("Numbers")]
    wrong = [side for section in before_numbers for side in left_sides(section.pieces) if side in printed]
    assert wrong == []
    assert r"E_{\mathrm{kin}}" in document.latex
    assert r"m^{\mathrm{rod}}" in document.latex


def test_usual_letters_stay_where_they_are_free() -> None:
    m = eg.Model("pendulum", gravity=(0, "-g", 0))
    for name in ("m", "l", "g"):
        m.parameter(name, 1.0)
    m.revolute("pin", m.ground, m.body("bob", mass="m", com=(0, "-l", 0)), coordinate="theta")
    equations = m.derive("lagrange")
    assert PrintedEquations(equations).letters == ("M", r"\dot{v}", "f")
    assert PrintedEquations(equations).letters_told == []
    document = equations.explain()
    assert r"E_{\mathrm{kin}}" not in document.latex
    assert r"m_{\mathrm{bob}}" in document.latex


def test_matrices_of_the_display_have_letters_of_their_own() -> None:
    equations = model(3).derive()
    text = str(equations)
    assert max(map(len, text.splitlines())) <= 80
    assert "K a = b with a = (θ'', q₁'', q₂'')" in text  # A_12 is an input
    assert "K is the mass matrix, b is the right side; the usual letters are names" in text
    assert re.search(r"^  K₁₁ = ", text, re.M)
    assert re.search(r"^  b₁ = ", text, re.M)
    assert not re.search(r"^ *[Mf][_₁₂₃\d]* = ", text, re.M)
    page = equations._equations_html
    assert "<mi>K</mi></math> is the mass matrix" in page
    assert "<msub><mi>M</mi><mn>" not in page
    latex = equations._repr_latex_()
    assert r"K \begin{bmatrix}" in latex
    assert "b_{1} & =" in latex or "\nb_{1} =" in latex
    assert not re.search(r"^(\\begin\{aligned\})?[Mf](_\{\d+\})? (&)?=", latex, re.M)


#: Besides a, b, c, J and B, which the six-bar has.
TAKEN = ("M_t", "A_t", "f_t", "b_t", "P", "C", "v_t", "w_t", "gamma", "T", "V", "L", "H")


@pytest.mark.parametrize("latex", ["", r"q^{\ast}", "q'"])
def test_no_symbol_gets_a_second_superscript(latex: str) -> None:
    """All letters of a loop's display are names, or names have superscripts and primes of their own."""
    m = eg.load(Path(__file__).parents[2] / "examples" / "watt_six_bar.yaml")
    for k, name in enumerate(TAKEN):
        m.parameter(name, 1.0, latex=f"{latex}{k}" if latex else None)
    m.torque("more", "O", "-" + " - ".join(f"{name}**2" for name in TAKEN))
    equations = m.derive("embedding")
    require_tex(equations._repr_latex_())
    if latex == "q'":
        require_tex(equations.explain("short").markdown)


def test_a_model_without_freedoms_says_so() -> None:
    m = eg.Model("shelf")
    m.weld("screws", m.ground, m.body("board", mass=1.0))
    equations = m.derive()
    for text in (str(equations), equations._repr_latex_(), equations._equations_html):
        assert "othing is free to move: the position follows from constraints and time" in text
        assert "n = 0" not in text


def test_intermediates_are_not_printed_as_names_of_the_model() -> None:
    """z0 is a parameter; an intermediate that would be printed z_0 is printed as it is written."""
    equations = model(3).derive()
    printed = PrintedEquations(equations)
    intermediates = [str(symbol) for symbol, _ in equations.intermediates]
    every = [*equations.notation.names, *intermediates]
    for form in (printed.names.latex, printed.names.text, printed.names.html):
        shown = [form(name) for name in every]
        assert len(set(shown)) == len(set(every))
    extended = equations.notation.with_names(["z_0", "m12", "free"])
    assert [extended.text(name) for name in ("z0", "z_0", "m_12", "m12", "free")] == ["z₀", "z_0", "m₁₂", "m12", "free"]
    assert equations.notation.latex("z_0") == "z_0"  # as it was


@pytest.mark.parametrize("method", METHODS)
def test_names_of_unknowns_are_not_names_of_the_model(method: str) -> None:
    """Energies and momenta with a parameter p_theta are those of the module; H holds both."""
    equations = model(2).derive(method)
    module: Any = equations.compile("numpy")
    values = state_values(module, random_state(module, 2), 0.0)
    if method == "hamilton":
        symbols = tuple(map(str, equations.momentum_symbols))
        assert symbols == ("momentum_theta", "momentum_q1")
        momenta = number(equations, "momenta", values)[:, 0]
        x = random_state(module, 2)
        T, V = module.energy(x)
        found = number(equations, "hamiltonian", values | dict(zip(symbols, map(float, momenta), strict=True)))
        assert found == pytest.approx(T + V, rel=1e-12)
        assert equations.hamiltonian.has(sp.Symbol("p_theta"))
        assert equations.subs({"p_theta": 0}).V != equations.V
    if method in ("newton_euler", "amalgamated"):
        unknowns = [str(x) for x in equations.block_system.unknowns]
        assert set(unknowns).isdisjoint(equations.kinematics.parameter_names)
        assert "pin_moment_z" in unknowns
        assert equations.joint_forces["pin"][0].lhs == sp.Symbol("pin_moment_z")


@pytest.mark.parametrize("method", ["augmented", "newton_euler", "amalgamated"])
def test_multipliers_are_not_parameters(method: str) -> None:
    equations = loop().derive(method)
    module: Any = equations.compile("numpy")
    x = random_state(module, 3)
    values = state_values(module, x, 0.0)
    block = equations.block_system
    unknowns = [str(u) for u in block.unknowns]
    assert unknowns[-1].startswith("multiplier_")
    assert set(unknowns).isdisjoint(equations.kinematics.parameter_names)
    if method != "augmented":  # where the equations of a plane loop are redundant in space
        assert "A_force_x" in unknowns
        return
    n = len(unknowns)
    flat = evaluate(equations.written("block_system")[0], [*block.matrix, *block.right], values)
    found = dict(zip(unknowns, np.linalg.solve(flat[: n * n].reshape(n, n), flat[n * n :]), strict=True))
    a = module.rhs(0.0, x)[module.n_q :]
    np.testing.assert_allclose([found[n] for n in ("theta_ddot", "beta_ddot", "s_ddot")], a, rtol=1e-9)
