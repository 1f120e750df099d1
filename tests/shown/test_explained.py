"""Worked solutions: nothing is empty, shown is compiled, every name is defined, numbers are those of books."""

import re
import subprocess
from collections.abc import Iterator
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import models
import pytest
import sympy as sp
from browser import Browser
from matplotlib.mathtext import MathTextParser
from models import EXAMPLES
from refusals import refuses
from shown_numbers import METHODS
from sweeps import part_of

import eomgen as eg

NAMES = sorted(path.stem for path in EXAMPLES.glob("*.yaml"))
VOID = {"meta", "img", "mspace", "br", "hr"}


@cache
def explained(name: str, method: str = "auto", level: str = "full") -> Any:
    return eg.load_example(name).derive(method).explain(level)


def section(document: Any, begins: str) -> str:
    """The Markdown of the section whose title begins so."""
    parts = re.split(r"^## ", document.markdown, flags=re.M)
    (found,) = (part for part in parts if part.startswith(begins))
    return found


def lines(text: str) -> dict[str, str]:
    """Left side of each formula -> its last side."""
    found = {}
    for shown in re.findall(r"\$\$\n(.*?)\n\$\$", text, re.S):
        sides = re.split(
            r"(?<!\\) & = |^ & = | = ", shown.replace(r"\begin{aligned}", "").replace(r"\end{aligned}", "")
        )
        found[sides[0].strip()] = re.sub(r"\s*\\\\.*$", "", sides[-1].strip(), flags=re.S)
    return found


def compared(document: Any) -> dict[str, float]:
    """Formula -> its difference, as the table at the end says."""
    rows = re.findall(r"^\| `(.+?)` \| ([-+.e\d]+) \|$", section(document, "Formulas and compiled code"), re.M)
    return {name: float(value) for name, value in rows}


class Page(HTMLParser):
    """Reads a page: every element is closed, and what it refers to is in it."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[str] = []
        self.places: list[str] = []
        self.text: list[str] = []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        self.tags.append(tag)
        self.places += [value for key, value in attrs if key in ("src", "href", "data", "action")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: Any) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text.append(data)


#: A matrix or cases with none in it, which Matplotlib does not know, and what ends a cell or a line.
INNERMOST = re.compile(r"\\begin\{([a-z]+)\}((?:(?!\\begin\{|\\end\{).)*)\\end\{\1\}", re.S)
ENDS = re.compile(r"&|\\\\")


def require_tex(markdown: str) -> None:
    """Every formula between dollars is one that a TeX reader takes."""
    displays = re.findall(r"\$\$(.+?)\$\$", markdown, re.S)
    inline = re.findall(r"(?<![\\$])\$(?!\$)(.+?)(?<!\\)\$", re.sub(r"\$\$.+?\$\$", "", markdown, flags=re.S), re.S)
    for formula in (*displays, *inline):
        assert not re.search(r"\\text\{[^}]*(?<!\\)[_^&%#]", formula), formula
        for cell in _cells(formula):
            _require(re.sub(r"\\(left|right|displaystyle)\b", "", cell).replace(r"\text{", r"\mathrm{").strip())


def _cells(formula: str) -> Iterator[str]:
    """The cells of all matrices and cases, and the formula with a letter in their places."""
    while found := INNERMOST.search(formula):
        yield from ENDS.split(found[2])
        formula = f"{formula[: found.start()]} x {formula[found.end() :]}"
    yield from ENDS.split(formula)


@cache
def _require(cell: str) -> None:
    read: Any = MathTextParser("path").parse
    read(f"${cell}$") if cell else None


def check(document: Any) -> None:
    assert document.difference <= 1e-10
    titles = re.findall(r"^## (.*)$", document.markdown, re.M)
    assert len(set(titles)) == len(titles) > 5
    for title in titles:
        assert len(section(document, title).splitlines()) > 2, f"{title} is empty"
    page = Page(document.html)
    assert {"script", "link", "iframe", "object"}.isdisjoint(page.tags)
    assert all(place.startswith(("#", "data:image/png;base64,")) for place in page.places)
    assert "http" not in re.sub(r"base64,[A-Za-z0-9+/=]*", "", document.html)
    assert not re.search(r"\\[a-zA-Z]", "".join(page.text)), "LaTeX that was not turned into MathML"
    assert document.markdown.count("$$") % 2 == 0
    require_tex(document.markdown)
    latex = document.latex
    assert latex.count(r"\begin{") == latex.count(r"\end{")
    assert latex.isascii()
    assert len(re.findall(r"(?<!\\)\{", latex)) == len(re.findall(r"(?<!\\)\}", latex))


# -- whole documents --------------------------------------------------------------------------------------------------

EVERY = {"T", "V", "mass_matrix", "force", "velocities[rod]", "accelerations[rod]", "poses[rod]", "generalized_forces"}
EVERY |= {"constraints", "gamma", "velocity_transformation", "masses and inertias"}
OF_METHODS = {
    "embedding": ("Equations of motion", {"body_velocity_transformation", "body_mass_matrix", "quadratic_velocity"}),
    "lagrange": ("Lagrange", {"derivatives of energies"}),
    "recursive": ("Equations of motion", {"velocities of links"}),
    "augmented": ("Equations of motion", {"block_system"}),
    "newton_euler": ("Newton", {"free_bodies[rod]", "joint_forces[A]", "block_system"}),
    "amalgamated": ("Equations of motion", {"free_bodies[rod]", "joint_forces[A]", "block_system"}),
    "gibbs_appell": ("Gibbs", {"gibbs_function"}),
    "hamilton": ("Hamilton", {"momenta", "hamiltonian", "momentum_rates"}),
}


@pytest.mark.parametrize("method", part_of(METHODS, lambda method: method not in ("amalgamated", "recursive")))
def test_of_every_method_each_formula_is_compared(method: str) -> None:
    document = explained("slider_crank", method)
    check(document)
    titles = " ".join(re.findall(r"^## (.*)$", document.markdown, re.M))
    title, own = OF_METHODS[method]
    for word in ("Mechanism", "Coordinates", "Position", "Velocity", "Constraints", "Forces", "Energies", title):
        assert word in titles
    found = compared(document)
    assert EVERY | own <= set(found)
    assert max(found.values()) <= 1e-10


OTHERS = [(name, method, "full") for name in ("double_pendulum", "car_axis", "rolling_disc") for method in METHODS]
OTHERS += [(name, METHODS[(k + step) % 8], "short") for k, name in enumerate(NAMES) for step in (0, 3)]
OTHERS += [(name, "auto", "short") for name in NAMES]
SOME = {("double_pendulum", "hamilton", "full")}
SOME |= {(name, "auto", "short") for name in ("hydraulic_boom", "gear_train")}


@pytest.mark.parametrize(("name", "method", "level"), part_of(dict.fromkeys(OTHERS), SOME.__contains__))
def test_every_example(name: str, method: str, level: str) -> None:
    check(explained.__wrapped__(name, method, level))


def test_a_wrong_formula_is_seen_in_the_difference() -> None:
    """The difference is measured: a kinetic energy that is off by a part in a million is told."""
    equations = eg.load_example("double_pendulum").derive()
    vars(equations)["T"] = equations.T * (1 + 1e-6)
    assert 1e-7 < equations.explain().difference < 1e-5


@pytest.mark.parametrize("name", part_of(("driven_slider_crank", "v_twin", "jansen_leg", "chebyshev"), "v_twin".__eq__))
@pytest.mark.parametrize("method", ["embedding", "newton_euler"])
def test_where_nothing_is_free_constraints_are_compared(name: str, method: str) -> None:
    found = compared(eg.load_example(name).derive(method).explain())
    assert set(found) >= {"constraints", "velocity_constraints", "constraint_jacobian", "gamma"}
    assert max(found.values()) <= 1e-10


def test_the_torque_of_a_driver_is_that_of_the_closed_form() -> None:
    """m l^2/3 alpha + m g l/2 cos(theta), from the M and f that are shown."""
    m = eg.Model("arm", gravity=(0, "-g", 0))
    for name, value in {"g": 9.81, "m": 2.0, "l": 0.6, "omega": 1.5, "alpha": 0.8}.items():
        m.parameter(name, value)
    rod = m.body("rod", mass="m", com=("l/2", 0, 0), inertia={"zz": "m*l**2/12"})
    m.revolute("A", m.ground, rod, coordinate="theta")
    m.driver("drive", "theta", "omega*t + alpha*t**2/2")
    document = m.derive().explain()
    shown = section(document, "Equations of motion")
    assert r"$-\mathbf{C}_q^T \boldsymbol{\lambda} = \mathbf{M} \ddot{\mathbf{q}} - \mathbf{f}$" in shown
    arm = m.compile(target="numpy")
    torque = 2.0 * 0.6**2 / 3 * 0.8 + 2.0 * 9.81 * 0.3  # at theta = 0: -lambda, with the sign of that sentence
    assert arm.multipliers(0.0, arm.x0()) == pytest.approx([-torque])
    assert r"\frac{1}{3} m l^2" in shown
    assert r"-\frac{1}{2} m g l \cos \theta" in shown
    assert {"tree_system", "poses[rod]"} <= set(compared(document))
    assert document.difference <= 1e-10


def test_parameters_without_values_leave_out_numbers_alone() -> None:
    m = eg.Model("pendulum", gravity=(0, "-g", 0))
    for name in ("g", "l", "m"):
        m.parameter(name)
    m.revolute("hinge", m.ground, m.body("bob", mass="m", com=(0, "-l", 0)), coordinate="theta")
    document = m.derive().explain()
    assert document.difference is None
    assert r"\theta" in document.latex
    assert "has no value" in document.html


def test_saved_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    document = explained("pendulum")
    for ending, start in ((".html", "<!DOCTYPE html>"), (".md", "# Equations"), (".tex", "\\documentclass")):
        assert document.save(tmp_path / f"x{ending}").read_text(encoding="utf-8").startswith(start)
    assert (tmp_path / "x.png").read_bytes().startswith(b"\x89PNG")
    refuses("EG-FILE .html", document.save, tmp_path / "x.docx")
    refuses("EG-NAME-UNKNOWN long", lambda: eg.load_example("pendulum").derive().explain("long"))
    monkeypatch.setenv("PATH", str(tmp_path))
    refuses("EG-PACKAGE-MISSING pdflatex", document.save, tmp_path / "x.pdf")


@pytest.mark.needs("pdflatex")
def test_tex_compiles(tmp_path: Path) -> None:
    document = explained("slider_crank", "embedding")
    assert document.save(tmp_path / "x.pdf").read_bytes().startswith(b"%PDF")
    document.save(tmp_path / "x.tex")
    words = ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "x.tex"]
    assert subprocess.run(words, cwd=tmp_path, capture_output=True, check=False).returncode == 0


def test_a_plane_mechanism_is_explained_in_its_plane() -> None:
    """Of each body three velocities, a mass matrix (3, 3) and one moment of inertia; steps are folded up."""
    document = explained("four_bar", "embedding")
    steps, masses = section(document, "Embedding"), section(document, "Bodies")
    for body in ("crank", "coupler", "rocker"):
        assert rf"\mathbf{{M}}_{{\mathrm{{{body}}}}} = \begin{{bmatrix}}" in steps
        assert rf"J_{{\mathrm{{{body}}}}} = " in masses
    assert "other" not in steps
    assert r"\omega_{\mathrm{crank}} = \dot{\theta}" in section(document, "Velocity")
    assert document.html.count("<details class='section'>") == document.html.count("<h2 id") - 4


@pytest.mark.needs("chromium")
@pytest.mark.thorough
def test_a_four_bar_takes_three_screens(tmp_path: Path) -> None:
    explained("four_bar", "embedding").save(tmp_path / "solution.html")
    with Browser(tmp_path / "profile", (1280, 800)) as browser:
        browser.open((tmp_path / "solution.html").as_uri())
        browser.wait_for("document.readyState === 'complete' && document.querySelector('h2') !== null")
        assert browser.evaluate("document.documentElement.scrollHeight") <= 3 * 800


@pytest.mark.needs("chromium")
@pytest.mark.thorough
def test_worked_solutions_open_offline(tmp_path: Path) -> None:
    explained("slider_crank", "newton_euler").save(tmp_path / "solution.html")
    with Browser(tmp_path / "profile") as browser:
        browser.open((tmp_path / "solution.html").as_uri())
        browser.wait_for("document.readyState === 'complete' && document.querySelector('h2') !== null")
        assert browser.evaluate("document.querySelector('img').naturalWidth") > 100
        browser.evaluate("document.querySelectorAll('details').forEach(d => { d.open = true })")
        assert browser.evaluate(
            "[...document.querySelectorAll('math')].every(m => m.getBoundingClientRect().width > 0)"
        )
        assert (browser.complaints, browser.requests) == ([], [])


# -- numbers line by line ---------------------------------------------------------------------------------------------


def test_accelerations_of_a_published_slider_crank() -> None:
    """Flores, Leine and Glocker (2010), at the outer dead centre: x'' = -r omega^2 (1 + r/l)."""
    known = models.reference("planar_slider_crank_dynamics")
    p, m = known["parameters_SI"], models.build("free_slider_crank")
    m.initial(theta=0.0, theta_dot=150.0)
    found = lines(section(m.derive(independent=["theta"]).explain(), "Numbers"))
    crank_turn, rod_turn, along = map(float, known["reference"]["omega150"]["initial_acc"])
    assert along == pytest.approx(-p["l1"] * 150.0**2 * (1 + p["l1"] / p["l2"]))
    assert float(found[r"\ddot{\theta}"]) == pytest.approx(crank_turn, rel=1e-5)
    assert float(found[r"\ddot{x}"]) == pytest.approx(along, rel=1e-5)
    assert float(found[r"\ddot{\mathrm{bend}}"]) == pytest.approx(rod_turn - crank_turn, rel=1e-5)
    assert float(found[r"(\mathbf{a}_{\mathrm{slider}})_{1}"]) == pytest.approx(along, rel=1e-5)


def test_a_model_at_rest_is_reported_in_motion_and_rounding_as_zero() -> None:
    """Two point masses at the ends of rods of 1 m, horizontal: the second moves at 1 + (1 + 1) m/s."""
    numbers = section(explained("double_pendulum"), "Numbers")
    found = lines(numbers)
    assert "velocities are 1" in numbers
    assert float(found["T"]) == pytest.approx(0.5 * 1.0**2 + 0.5 * 3.0**2)
    assert found["V"] == "0"  # both at the height of the pivot
    assert found[r"(\mathbf{R}_{\mathrm{upper}})_{1,1}"] == "0"  # cos(pi / 2)
    assert float(found[r"\ddot{\theta}_1"]) == pytest.approx(-9.81)
    assert float(found[r"\ddot{\mathrm{bend}}"]) == pytest.approx(9.81)
    declared = section(explained("slider_crank", "embedding"), "Numbers")
    assert "The declared initial state" in declared


# -- names and letters ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "method"), [("four_bar", "lagrange"), ("double_pendulum", "embedding")])
def test_no_name_of_the_equations_of_motion_is_left_open(name: str, method: str) -> None:
    """Each is the model's own, or has a line that says what it is."""
    equations = eg.load_example(name).derive(method)
    shown = section(explained(name, method, "short"), "Equations of motion")
    own = {*map(str, (*equations.q, *equations.v, *equations.parameters)), *equations.acceleration_names}
    own |= {str(s) for s in equations.force.free_symbols if str(s) in ("tau", "t")}
    for symbol, part in equations.intermediates:
        latex = equations.notation.latex(str(symbol))
        assert latex in lines(shown) or latex in shown
        assert {str(s) for s in part.free_symbols} <= own | {str(s) for s, _ in equations.intermediates}


def test_joints_tell_their_axes() -> None:
    m = eg.Model("arm", gravity=(0, 0, -9.81))
    last: Any = m.ground
    for name, kind, axis in (
        ("yaw", "revolute", "z"),
        ("pitch", "revolute", "-y"),
        ("reach", "prismatic", "x"),
        ("skew", "revolute", (0.6, 0, 0.8)),
    ):
        body = m.body(f"{name}_body", mass=1.0, inertia=(1, 1, 1))
        getattr(m, kind)(name, last, body, axis=axis)
        last = body
    text = section(m.derive().explain("short"), "Mechanism")
    assert text.count("A revolute joint: S turns about the axis z ") == 1
    assert text.count("A revolute joint: S turns about the axis -y ") == 1
    assert "S slides along the axis x" in text
    assert r"the axis $\mathbf{n}_z$ = (0.6, 0, 0.8)" in text
    assert [row.split(" | ")[4] for row in re.findall(r"^\| (`\w+` \| .*) \|$", text, re.M)] == [
        *("z", "-y", "x", "(0.6, 0, 0.8)")
    ]


LETTERS = ("M", "f", "C", "B", "Q", "T", "V", "L", "S", "H", "v", "z0", "p_theta", "lambda1", "rod_F_x", "pin_M_z")


@cache
def letters(links: int) -> eg.Model:
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


@pytest.mark.parametrize("method", METHODS)
def test_no_left_side_is_a_name_of_the_model(method: str) -> None:
    equations = letters(1).derive(method)
    document = equations.explain()
    assert document.difference < 1e-10
    names = {equations.notation.latex(name) for name in (*map(str, equations.parameters), "A_12")}
    for part in re.split(r"^## ", document.markdown, flags=re.M):
        if not part.startswith("Numbers"):
            assert set(lines(part)).isdisjoint(names)
    assert r"E_{\mathrm{kin}}" in document.latex
    if method in ("newton_euler", "amalgamated"):
        unknowns = [str(x) for x in equations.block_system.unknowns]
        assert set(unknowns).isdisjoint(map(str, equations.parameters))
        assert equations.joint_forces["pin"][0].lhs == sp.Symbol("pin_moment_z")
    if method == "hamilton":
        assert tuple(map(str, equations.momentum_symbols)) == ("momentum_theta",)
        assert equations.hamiltonian.has(sp.Symbol("p_theta"))


def test_matrices_of_the_display_have_letters_of_their_own() -> None:
    text = str(letters(3).derive())
    assert max(map(len, text.splitlines())) <= 80
    assert "K a = b with a = (θ'', q₁'', q₂'')" in text  # A_12 is an input
    assert "K is the mass matrix, b is the right side; the usual letters are names" in text
    assert re.search(r"^  K₁₁ = ", text, re.M)
    assert re.search(r"^  b₁ = ", text, re.M)
    assert not re.search(r"^ *[Mf][_₁₂₃\d]* = ", text, re.M)
    assert r"K \begin{bmatrix}" in letters(3).derive()._repr_latex_()


def test_multipliers_are_not_parameters() -> None:
    """A loop whose multipliers would be named as parameters are."""
    m = eg.Model("loop", gravity=(0, -9.81, 0))
    for name, value in {"lambda_1": 2.0, "A_F_x": 0.5, "M": 0.3, "c12": 1.0}.items():
        m.parameter(name, value)
    crank, rod = m.body("crank", mass="lambda_1", com=(0.1, 0, 0)), m.body("rod", mass="M*c12", com=(0.2, 0, 0))
    slider = m.body("slider", mass=1)
    models.join_slider_crank(m, (crank, rod, slider), 0.1, 0.4, "theta beta s")
    m.actuator("pull", "D", "-A_F_x*s_dot")
    m.independent("theta")
    m.initial(theta=0.3)
    m.guess(s=0.45)
    unknowns = [str(u) for u in m.derive("augmented").block_system.unknowns]
    assert unknowns[-1].startswith("multiplier_")
    assert set(unknowns).isdisjoint(map(str, m.derive("augmented").parameters))


@pytest.mark.parametrize("latex", part_of(["q'", r"q^{\ast}", ""], "q'".__eq__))
def test_no_symbol_gets_a_second_superscript(latex: str) -> None:
    """All letters of a loop's display are names, or names have superscripts and primes of their own."""
    taken = ("M_t", "A_t", "f_t", "b_t", "P", "C", "v_t", "w_t", "gamma", "T", "V", "L", "H")
    m = eg.load_example("watt_six_bar")
    for k, name in enumerate(taken):
        m.parameter(name, 1.0, latex=f"{latex}{k}" if latex else None)
    m.torque("more", "O", "-" + " - ".join(f"{name}**2" for name in taken))
    require_tex(m.derive("embedding")._repr_latex_())


def test_a_model_without_freedoms_says_so() -> None:
    m = eg.Model("shelf")
    m.weld("screws", m.ground, m.body("board", mass=1.0))
    equations = m.derive()
    for text in (str(equations), equations._repr_latex_(), equations._repr_html_()):
        assert "othing is free to move: the position follows from constraints and time" in text
        assert "n = 0" not in text
