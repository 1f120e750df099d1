"""LaTeX that a model gives: what is taken, what is refused, and the forms that follow from it."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from typing import Any

import pytest
from hostile.nasty_texts import NASTY
from matplotlib.mathtext import MathTextParser

from eomgen.notation import Notation, NotationError, dotted, read_latex, with_instance

#: LaTeX -> text, LaTeX of the rate.
GIVEN = {
    "m_{c}": ("m_c", r"\dot{m}_{c}"),
    r"q_{\rm f}": ("q_f", r"\dot{q}_{\rm f}"),
    r"q_{\mathrm{f}}": ("q_f", r"\dot{q}_{\mathrm{f}}"),
    r"\varphi": ("ϕ", r"\dot{\varphi}"),
    r"\theta_1": ("θ₁", r"\dot{\theta}_1"),
    r"\theta_{12}^{2}": ("θ₁₂²", r"\dot{\theta}_{12}^{2}"),
    r"x^2_1": ("x₁²", r"\dot{x}^2_1"),
    r"\vec{v}_{\mathrm{tip}}": ("v_tip", r"\dot{\vec{v}}_{\mathrm{tip}}"),
    r"\mathbf{r}": ("r", r"\dot{\mathbf{r}}"),
    r"\mathrm{bend}": ("bend", r"\dot{\mathrm{bend}}"),
    r"\text{knee angle}": ("knee angle", r"\dot{\text{knee angle}}"),
    r"\Delta x": ("Δx", r"\Delta \dot{x}"),
    r"\Delta": ("Δ", r"\dot{\Delta}"),
    r"x'": ("x'", r"\dot{x}'"),
    r"x''_{\mathrm{A}}": ("x_A''", r"\dot{x}''_{\mathrm{A}}"),
    r"x^\ast": ("x\u2217", r"\dot{x}^\ast"),
    r"\hat{a}": ("â", r"\dot{\hat{a}}"),
    r"\dot{x}": ("x'", r"\ddot{x}"),
    r"{m}_c": ("m_c", r"{\dot{m}}_c"),
    r"{\bf r}_1": ("r₁", r"{\dot{\bf r}}_1"),
    r"\ell_0": ("ℓ₀", r"\dot{\ell}_0"),
    r"\mathcal{E}": ("E", r"\dot{\mathcal{E}}"),
    r"\frac{E}{E_0}": ("E/E₀", r"\dot{\frac{E}{E_0}}"),
    r"2x": ("2x", r"2\dot{x}"),
    r"x_{\parallel}": ("x_∥", r"\dot{x}_{\parallel}"),
    r"k_{\text{a b}}": ("k_ab", r"\dot{k}_{\text{a b}}"),
    r"\operatorname{sag}": ("sag", r"\dot{\operatorname{sag}}"),
    "  m _ { c }  ": ("m_c", r"\dot{m} _ { c }"),
}


@pytest.mark.parametrize("latex", GIVEN)
def test_other_forms_follow_from_given_latex(latex: str) -> None:
    notation = Notation(["q", "q_dot"], latex={"q": latex})
    assert (notation.text("q"), notation.latex("q_dot")) == GIVEN[latex]
    assert notation.latex("q") == " ".join(latex.split())
    read: Any = MathTextParser("path").parse
    for name in ("q", "q_dot", "q_ddot"):
        read(notation.mathtext(name))
        for form in (notation.html(name), notation.mathml(name)):
            ET.fromstring(f"<p>{form}</p>")


#: What no symbol has -> a word of the message.
REFUSED = {
    "": "empty",
    " ": "empty",
    "{}": "nothing",
    "$m$": "'$'",
    "m$": "'$'",
    "m}": "'}'",
    "}m{": "'}'",
    "{m": "'{'",
    "m_{c": "'{'",
    "m_": "_",
    "m^": "^",
    "_c": "'_'",
    "a_b_c": "twice",
    "a^b^c": "twice",
    "a^b'": "twice",
    r"\dot": "nothing after",
    r"\dot{}": "nothing",
    r"\dot}": "nothing after",
    "m\\": "backslash",
    r"m\\n": r"\\",
    r"\input{/etc/passwd}": r"\input",
    r"\write18{ls}": r"\write",
    r"\immediate\write18{ls}": r"\immediate",
    r"\href{javascript:alert(1)}{x}": r"\href",
    r"\def\x{y}": r"\def",
    r"\csname input\endcsname": r"\csname",
    r"\catcode`\$=12": r"\catcode",
    r"\begin{matrix}": r"\begin",
    r"\color{red}x": r"\color",
    r"\(": r"\(",
    r"\]": r"\]",
    "m%": "'%'",
    "m&n": "'&'",
    "m#1": "'#'",
    "m~n": "'~'",
    '"': "'\"'",
    "`": "'`'",
    "@": "'@'",
    "<script>alert(1)</script>": "'<'",
    "a<b": "'<'",
    "θ": r"θ",
    "é": "'é'",
    "x\x00": "U+0000",
    "x\u202e": "U+202E",
    r"\text{a_b}": "'_'",
    r"\text{\theta}": r"\theta",
    r"\thet": r"\thet",
    "x" * 121: "121",
    "{" * 9 + "x" + "}" * 9: "groups",
}


@pytest.mark.parametrize("latex", REFUSED)
def test_what_could_leave_the_formula_is_refused(latex: str) -> None:
    with pytest.raises(NotationError) as raised:
        read_latex(latex)
    assert REFUSED[latex] in str(raised.value)
    assert raised.value.remedy
    assert str(raised.value).isprintable()


@pytest.mark.parametrize("key", NASTY)
def test_no_nasty_text_comes_through(key: str) -> None:
    """It is refused, or made of letters, digits and listed commands alone."""
    try:
        read_latex(NASTY[key])
    except NotationError:
        return
    assert not set(NASTY[key]) & set('$%#&~<>"`@\x00')
    assert NASTY[key].isascii()


def test_a_greek_letter_gets_its_command_as_remedy() -> None:
    with pytest.raises(NotationError) as raised:
        read_latex("θ_1")
    assert raised.value.remedy == r"write \theta"


@pytest.mark.parametrize(
    ("latex", "found"),
    [
        ("m_{c}", r"m_{c,\mathrm{leg1}}"),
        ("m_c", r"m_{c,\mathrm{leg1}}"),
        ("m", r"m_{\mathrm{leg1}}"),
        (r"\theta", r"\theta_{\mathrm{leg1}}"),
        (r"x^2", r"x_{\mathrm{leg1}}^2"),
        (r"q_{\rm f}", r"q_{\rm f,\mathrm{leg1}}"),
        (r"\Delta x", r"\Delta x_{\mathrm{leg1}}"),
        (r"\vec{r}", r"\vec{r}_{\mathrm{leg1}}"),
        ("not$latex", "not$latex"),
    ],
)
def test_an_instance_is_a_further_subscript(latex: str, found: str) -> None:
    assert with_instance(latex, "leg1") == found


def test_dots_by_their_order() -> None:
    assert [dotted(r"\theta_1", k) for k in (1, 2, 3)] == [
        r"\dot{\theta}_1",
        r"\ddot{\theta}_1",
        r"\dddot{\theta}_1",
    ]
