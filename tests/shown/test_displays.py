"""What notebooks, terminals and files show of equations: read back by a reader of its own it has the right values."""

import ctypes
import math
import re
import shutil
import subprocess
from functools import cache
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import command
import numpy as np
import pytest
import sympy
from browser import Browser
from models import EXAMPLES
from shown_numbers import random_state, state_values
from sweeps import part_of

import eomgen as eg

NAMES = sorted(file.stem for file in EXAMPLES.glob("*.yaml"))
#: Trees and loops, with roots, choices, signs, rotations and named parts.
SOME = ("double_pendulum", "slider_crank", "four_bar", "flyball_governor", "two_link_manipulator")
SOME += ("kapitza_pendulum", "hydraulic_boom", "cart_pendulum", "gear_train")
MORE = ("satellite", "spherical_pendulum", "quadrotor_load", "rimless_wheel", "wheelset", "rolling_disc")


@cache
def derived(name: str) -> Any:
    return eg.load_example(name).derive()


def written(name: str, form: str) -> str:
    """What ``eomgen derive --format`` writes."""
    done = command.run("derive", EXAMPLES / f"{name}.yaml", "--format", form)
    assert done.code == 0, done.err
    return done.out


# -- texts are read back ----------------------------------------------------------------------------------------------

HIGH = "⁰¹²³⁴⁵⁶⁷⁸⁹"
FUNCTIONS: dict[str, Any] = {
    name: getattr(math, name) for name in ("sin", "cos", "tan", "atan2", "hypot", "sqrt", "exp", "tanh", "atan")
}
FUNCTIONS |= {"ln": math.log, "sign": np.sign, "sgn": np.sign, "min": min, "max": max}


class Reader:
    """Values of the lines of a display; a name that a line tells is read there.

    ``together`` says that factors side by side come before a bar: a b/c d is (a b)/(c d).  Otherwise signs are taken
    from left to right: ((a b)/c) d.
    """

    def __init__(self, lines: dict[str, str], known: dict[str, float], together: bool) -> None:
        self.lines, self.known, self.together = lines, dict(known), together
        names = "|".join(map(re.escape, sorted({*known, *lines}, key=len, reverse=True)))
        self.token = re.compile(rf" |\d+\.?\d*(?:e[+-]?\d+)?|(?:{'|'.join(FUNCTIONS)})(?=[{HIGH}]*\()|{names}|.")

    def __call__(self, name: str) -> float:
        if name not in self.known:
            outer, self.left = getattr(self, "left", []), self.token.findall(self.lines[name])[::-1]
            self.known[name] = self.sum("")
            assert not self.left, (name, self.left)
            self.left = outer
        return self.known[name]

    def peek(self) -> str:
        return self.left[-1] if self.left else ""

    def sum(self, end: str) -> float:
        sign = -1.0 if self.peek() == "-" else 1.0
        if sign < 0:
            self.left.pop()
        total = sign * self.product()
        while self.left[-3:] and self.left[-1] == " " and self.left[-2] in "+-" and self.left[-3] == " ":
            sign = 1.0 if self.left[-2] == "+" else -1.0
            del self.left[-3:]
            total += sign * self.product()
        if end:
            assert self.left.pop() == end
        return total

    def product(self) -> float:
        groups = [self.factor()]
        value = groups[0]
        while self.peek() == "/" or (self.peek() == " " and self.left[-2:-1] not in (["+"], ["-"])):
            mark, factor = self.left.pop(), self.factor()
            value = value / factor if mark == "/" else value * factor
            if mark == "/":
                groups.append(factor)
            else:
                groups[-1] *= factor
        return groups[0] / math.prod(groups[1:]) if self.together else value

    def factor(self) -> float:
        token = self.left.pop()
        if token in FUNCTIONS:
            power = self.power()
            assert self.left.pop() == "("
            arguments = [self.sum("")]
            while self.peek() == ",":
                del self.left[-2:]
                arguments.append(self.sum(""))
            assert self.left.pop() == ")"
            return float(FUNCTIONS[token](*arguments) ** power)
        if token in "(|√":
            value = self.factor() ** 0.5 if token == "√" else self.sum(")" if token == "(" else "|")
            value = abs(value) if token == "|" else value
        else:
            value = self(token) if token in self.known or token in self.lines else float(token)
        return float(value ** self.power())

    def power(self) -> float:
        if self.peek() == "^":
            self.left.pop()
            return self.factor()
        digits = ""
        while self.peek() and self.peek() in HIGH:
            digits += str(HIGH.index(self.left.pop()))
        return float(digits or 1)


def told(text: str) -> dict[str, str]:
    """Name -> its formula, lines that go on joined."""
    found: dict[str, str] = {}
    name = ""
    for line in text.splitlines():
        if start := re.match(r"  (\S+) = ([^⎡⎢⎣]*)$", line):
            name = start[1]
            found[name] = start[2]
        elif name and line.startswith("     ") and not re.search("[⎡⎢⎣]", line):
            found[name] += " " + line.strip()
        else:
            name = ""
    return found


@pytest.mark.parametrize("name", part_of((*SOME, *MORE), SOME.__contains__))
def test_what_is_printed_has_one_value_which_is_compiled(name: str) -> None:
    equations = derived(name)
    module: Any = equations.compile("numpy")
    x = random_state(module, 3)
    values = state_values(module, x)
    lines = told(written(name, "text"))
    known = {equations.notation.text(key): value for key, value in values.items()} | {"π": math.pi}
    assert len(known) == len(values) + 1
    M = module.embedded_mass_matrix(x[: module.n_q])
    f = M @ module.rhs(0.0, x)[module.n_q :][[k for k in module.metadata["independent"] if k < module.n_v]]
    wanted = {"M": M[0, 0], "f": f[0]} if len(M) == 1 else {}
    wanted |= {f"M_{i + 1}{j + 1}": a for (i, j), a in np.ndenumerate(M)} | {f"f_{i + 1}": a for i, a in enumerate(f)}
    for together in (True, False):
        read = Reader(lines, known, together)
        for key in (key for key in lines if key in wanted and "{" not in lines[key]):
            assert read(key) == pytest.approx(wanted[key], rel=1e-9, abs=1e-10 * np.abs(M).max())
    if name in SOME[:5]:  # others have one equation or a matrix form
        assert set(lines) & set(wanted)


@pytest.mark.parametrize("name", part_of(NAMES, lambda name: name in (*SOME, "bicycle", "satellite")))
def test_every_display_is_well_formed_and_fits(name: str) -> None:
    equations = derived(name)
    shown = str(equations)
    assert max(map(len, shown.splitlines())) <= 80
    assert len(shown.splitlines()) < 100
    for line in shown.splitlines():  # lines end outside of the arguments of sines
        assert not re.search(r"(?:sin|cos)\([^()]*$", line)
    free = equations.report.degrees_of_freedom > 0
    assert free == bool(re.search("^ .* = ", shown, re.M)) or not free
    page = equations._repr_html_()
    assert "<math" in page or not free
    ElementTree.fromstring(f"<div>{page}</div>")
    latex = equations._repr_latex_()
    assert latex.startswith("$")
    assert latex.count("{") == latex.count("}")


@pytest.mark.quick
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


def hinge(torque: str, inertia: Any = 1.0) -> tuple[str, str]:
    """The one equation of a hinge about the direction of gravity, in text and in LaTeX."""
    m = eg.Model("hinge", gravity=(0, 0, "-g"))
    for name in ("g", "l", "m1", "m2"):
        m.parameter(name)
    m.input("F")
    bob = m.body("bob", mass="m1", inertia={"zz": inertia})
    m.revolute("pin", m.ground, bob, coordinate="theta")
    m.weld("glue", bob, m.body("more", mass="m2"))
    m.torque("law", "pin", torque)
    equations = m.derive()
    (line,) = (line for line in str(equations).splitlines() if re.match("  .*θ''[^ ]* = ", line))
    return line.strip(), equations._repr_latex_().removeprefix(r"$\displaystyle ").removesuffix("$")


@pytest.mark.parametrize(
    ("torque", "text", "latex"),
    [
        ("g*l*(m1 + m2)*sin(theta)", "(m₁ + m₂) g l sin(θ)", r"(m_1 + m_2) g l \sin \theta"),
        ("l*m1*theta_dot**2 - g*m1 + F", "F + m₁ l θ'² - m₁ g", r"F + m_1 l \dot{\theta}^2 - m_1 g"),
        ("l**2*m1/3", "m₁ l²/3", r"\frac{1}{3} m_1 l^2"),
        ("-2*l/(3*m1*(l + g))", "-2 l/(3 m₁ (g + l))", r"-\frac{2 l}{3 m_1 (g + l)}"),
        ("cos(theta)**2*sin(theta + l)", "cos²(θ) sin(l + θ)", r"\cos^2 \theta \sin(l + \theta)"),
        ("sqrt(m1 + m2)", "sqrt(m₁ + m₂)", r"\sqrt{m_1 + m_2}"),
        ("m1*abs(l - g)", "m₁ |g - l|", r"m_1 \left|g - l\right|"),
        ("1e-7*l", "1e-7 l", r"1 \cdot 10^{-7} l"),
    ],
)
def test_factors_and_terms_stand_in_the_order_of_textbooks(torque: str, text: str, latex: str) -> None:
    assert hinge(torque) == (f"θ'' = {text}", rf"\ddot{{\theta}} = {latex}")


@pytest.mark.parametrize(
    ("inertia", "left"),
    [("m1", "m₁ θ''"), ("3*m1/2", "3 m₁ θ''/2"), ("m1/12", "m₁ θ''/12"), (1.5, "3 θ''/2"), ("m1/l", "m₁ θ''/l")],
)
def test_a_factor_stands_within_the_fraction(inertia: Any, left: str) -> None:
    assert hinge("F", inertia)[0] == f"{left} = F"


def test_long_numbers_are_rounded_where_they_are_shown_alone() -> None:
    """M_33 of the governor: 5 kg m^2 of the ball, and rho (0.01^2/3 + 0.01^4/12) of the arm."""
    equations = derived("flyball_governor")
    assert equations.mass_matrix[2, 2].coeff(sympy.Symbol("rho")) == pytest.approx(1e-4 / 3 + 1e-8 / 12, rel=1e-14)
    assert "M_33 = 5 + 3.33342e-5 " in str(equations)
    assert "Long numbers are rounded to 6 digits" in str(equations)
    assert r"3.33342 \cdot 10^{-5}" in equations._repr_latex_()
    for form in ("text", "latex"):
        assert "3.33341666666667" in written("flyball_governor", form)
    assert "rounded" not in str(derived("double_pendulum"))


def test_large_equations_are_shown_by_their_parts() -> None:
    """A first screen, groups of one meaning that say how much they hold, all of it by the command."""
    equations = derived("bicycle")
    shown = str(equations)
    assert "eqs.tree_system" in shown
    assert shown.index("In groups:") < shown.index("velocity terms of the constraints") < shown.index("c_tilt = ")
    page = equations._repr_html_()
    assert page.index("<table>") < page.index("<math displaystyle")
    assert page.count("<details><summary>") > 5  # groups of one meaning
    assert "sym." in page  # symmetric halves once
    whole = written("bicycle", "text")
    lines = told(whole)
    named = {equations.notation.text(str(symbol)) for symbol, _ in equations.written("tree_system")[0]}
    assert len(named & set(lines)) > 0.9 * len(named)
    groups = re.findall(r"^(?!  ).*\((\d+) formulas?, (\d+) operations?\)$", whole, re.M)
    assert len(groups) > 5
    assert sum(int(formulas) for formulas, _ in groups) == pytest.approx(len(named), rel=0.1)
    matrix = re.findall(r"^ +(?:M_t = )?[⎡⎢⎣](.*)[⎤⎥⎦]", shown, re.M)
    assert len(matrix) >= 8


@pytest.mark.needs("chromium")
@pytest.mark.thorough
def test_displays_fit_a_page(tmp_path: Path) -> None:
    sizes = (
        "[...document.querySelectorAll('math')].filter(m => !m.closest('details:not([open])'))"
        ".map(m => m.getBoundingClientRect().right)"
    )
    with Browser(tmp_path / "profile", size=(960, 800)) as browser:
        for name in ("double_pendulum", "cart_pendulum", "slider_crank", "four_bar", "rolling_disc", "bicycle"):
            page = tmp_path / f"{name}.html"
            head = "<!doctype html><meta charset='utf-8'><body style='width:900px;font:14px sans-serif'>"
            page.write_text(head + derived(name)._repr_html_(), encoding="utf-8")
            browser.open(page.as_uri())
            browser.wait_for(f"document.readyState === 'complete' && document.body.textContent.includes('{name}')")
            assert max(browser.evaluate(sizes)) <= browser.evaluate("document.body.getBoundingClientRect().right"), name
    assert (browser.complaints, browser.requests) == ([], [])


# -- formats of other programs ----------------------------------------------------------------------------------------


@cache
def pendulum() -> tuple[dict[str, float], np.ndarray, np.ndarray]:
    """Numbers of all names, and M and f of the compiled module there."""
    module = derived("double_pendulum").compile("numpy")
    x = np.array([0.3, -0.7, 1.1, 0.4])
    numbers = dict(zip((*module.x_names, *module.p_names), (*x, *module.p), strict=True))
    return numbers, module.mass_matrix(x[:2]), -module.bias(0.0, x)


def test_sympy_and_c_give_the_compiled_equations(tmp_path: Path) -> None:
    numbers, M, f = pendulum()
    space: dict[str, Any] = {}
    exec(written("double_pendulum", "sympy"), space)  # noqa: S102 - what a user does with the file
    assert np.array(space["M"].subs(numbers), dtype=float) == pytest.approx(M, rel=1e-12)
    assert np.array(space["f"].subs(numbers), dtype=float)[:, 0] == pytest.approx(f, rel=1e-12)
    for name in ("double_pendulum", "wheelset"):  # whose pieces have infinite values
        module: Any = derived(name).compile("numpy")
        x, text, n = module.x0(), written(name, "c"), module.n_dof
        (tmp_path / "e.c").write_text(text)
        words = [
            "gcc",
            "-Wall",
            "-Wno-unused-variable",
            "-Werror",
            "-shared",
            "-fPIC",
            "-o",
            f"{name}.so",
            "e.c",
            "-lm",
        ]
        subprocess.run(words, cwd=tmp_path, check=True)
        call = getattr(ctypes.CDLL(str(tmp_path / f"{name}.so")), f"{name}_equations")
        values, found, right = state_values(module, x), (ctypes.c_double * n**2)(), (ctypes.c_double * n)()
        call(*(ctypes.c_double(values[one]) for one in re.findall(r"double (\w+),", text)), found, right)
        M = module.embedded_mass_matrix(x[: module.n_q])
        assert list(found) == pytest.approx(M.ravel(), rel=1e-12)
        wanted = M @ module.rhs(0.0, x)[module.n_q :][list(module.metadata["independent"])]
        assert list(right) == pytest.approx(wanted, rel=1e-9)
    assert "infinite values" in command.run("derive", EXAMPLES / "wheelset.yaml", "--format", "octave").err


@pytest.mark.parametrize("form", ["matlab", "octave", "julia"])
def test_array_languages_give_the_compiled_equations(form: str) -> None:
    """Their arithmetic is read here: no such program need be installed."""
    numbers, M, f = pendulum()
    text = written("double_pendulum", form)
    assert text.count("function") == 1
    assert text.rstrip().endswith("end")
    known: dict[str, Any] = dict(numbers)
    for a, place, x in re.findall(r"^ +([Mf])[\[(]([\d, ]+)[\])] = (.*?);?$", text, re.M):
        plain = x.replace(".*", "*").replace("./", "/").replace(".^", "**").replace("^", "**")
        known[f"{a}_{place.replace(', ', '_')}"] = float(sympy.parse_expr(plain, local_dict=known))
    assert [known[f"M_{i}_{j}"] for i in (1, 2) for j in (1, 2)] == pytest.approx(M.ravel(), rel=1e-12)
    assert [known["f_1"], known["f_2"]] == pytest.approx(f, rel=1e-12)


@pytest.mark.needs("octave")
@pytest.mark.parametrize("name", part_of(("four_bar", "flyball_governor"), "four_bar".__eq__))
def test_octave_gives_the_compiled_equations(name: str, tmp_path: Path) -> None:
    """A function with named parts, and one with long numbers, run by Octave itself."""
    module: Any = derived(name).compile("numpy")
    x = random_state(module, 4)
    values, free = state_values(module, x), list(module.metadata["independent"])
    text = written(name, "octave")
    (tmp_path / f"{name}_equations.m").write_text(text)
    arguments = re.findall(r"\w+", re.findall(rf"{name}_equations\((.*)\)", text)[0])
    given = ", ".join(f"{values[argument]:.17g}" for argument in arguments)
    program = f'[M, f] = {name}_equations({given}); printf("%.17g\\n", M\', f);'
    words = [shutil.which("octave-cli") or "octave", "--no-gui", "--norc", "--quiet", "--eval", program]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=True)
    M = module.embedded_mass_matrix(x[: module.n_q])
    wanted = [*M.ravel(), *(M @ module.rhs(0.0, x)[module.n_q :][free])]
    assert [float(line) for line in done.stdout.split()] == pytest.approx(wanted, rel=1e-10, abs=1e-10 * abs(M).max())


def test_what_a_language_cannot_hold_is_changed_or_refused(tmp_path: Path) -> None:
    m = eg.Model("wheel")
    end, M = m.parameter("end"), m.parameter("M")
    m.revolute("A", m.ground, m.body("rim", mass=1, inertia={"zz": end * M}), coordinate="theta")
    m.save(tmp_path / "wheel.yaml")
    assert "% end_ is end of the model" in command.run("derive", tmp_path / "wheel.yaml", "--format", "matlab").out
    assert "// M_ is M of the model" in command.run("derive", tmp_path / "wheel.yaml", "--format", "c").out
    m = eg.Model("tabular")
    m.prismatic("rail", m.ground, m.body("block", mass=1.0), axis="x", coordinate="s")
    m.table("push", [0, 1, 2, 3], [1, 2, 4, 3])
    m.actuator("motor", "rail", "push(s)")
    m.actuator("wall", "rail", sympy.Piecewise((-100 * sympy.Symbol("s"), sympy.Symbol("s") > 0), (0, True)))
    m.save(tmp_path / "tabular.yaml")
    refused = command.run("derive", tmp_path / "tabular.yaml", "--format", "c")
    assert refused.code in (1, 2)
    assert "format 'c' cannot hold the tables or functions of this model: push" in refused.err
    assert "push" in command.run("derive", tmp_path / "tabular.yaml", "--format", "text").out
    m.stop("end", "rail", upper=2, stiffness=7)
    assert "{7 (s - 2)^(3/2) if s > 2; 0 otherwise}" in " ".join(str(m.derive()).split())
    solution = m.derive().explain("short")
    assert solution.difference is None
    assert "push" in solution.markdown
