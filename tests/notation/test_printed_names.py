"""How names are printed: a table of names, names that would look alike, and what other programs make of the forms."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from typing import Any

import pytest
from matplotlib.mathtext import MathTextParser

from eomgen.notation import Notation
from eomgen.notation.latex_of_names import rate_of, split_rate

#: Name -> LaTeX, text.
NAMES = {
    # letters, digits
    "m": ("m", "m"),
    "L0": ("L_0", "L₀"),
    "q12": ("q_{12}", "q₁₂"),
    "I1": ("I_1", "I₁"),
    "m_c": ("m_c", "m_c"),
    "l_12": ("l_{12}", "l₁₂"),
    "l_1_2": ("l_{1,2}", "l_1_2"),
    "x_c1": ("x_{c1}", "x_c1"),
    "m2a": ("m_{2a}", "m_2a"),
    "r_AB": ("r_{AB}", "r_AB"),
    # Greek letters
    "theta": (r"\theta", "θ"),
    "theta1": (r"\theta_1", "θ₁"),
    "th": (r"\theta", "θ"),
    "th1": (r"\theta_1", "θ₁"),
    "th_dot": (r"\dot{\theta}", "θ'"),
    "theta_2": (r"\theta_2", "θ₂"),
    "thetaA": (r"\theta_A", "θ_A"),
    "Omega": (r"\Omega", "Ω"),
    "omega_0": (r"\omega_0", "ω₀"),
    "phi12": (r"\phi_{12}", "φ₁₂"),
    "varphi": (r"\varphi", "ϕ"),
    "mu_k": (r"\mu_k", "μ_k"),
    "lambda_": (r"\lambda", "λ"),
    "lamda_1": (r"\lambda_1", "λ₁"),
    "x_theta": (r"x_{\theta}", "x_θ"),
    "Delta_x": (r"\Delta_x", "Δ_x"),
    "ell": (r"\ell", "\u2113"),
    # words
    "bend": (r"\mathrm{bend}", "bend"),
    "crank2": (r"\mathrm{crank}_2", "crank₂"),
    "pin_x": (r"\mathrm{pin}_x", "pin_x"),
    "leg1_x": (r"\mathrm{leg1}_x", "leg1_x"),
    "k_max": (r"k_{\mathrm{max}}", "k_max"),
    "x_hub_left": (r"x_{\mathrm{hub,left}}", "x_hub_left"),
    "left_knee_angle": (r"\mathrm{left}_{\mathrm{knee,angle}}", "left_knee_angle"),
    "COM_x": (r"\mathrm{COM}_x", "COM_x"),
    "up": (r"\mathrm{up}", "up"),
    "theory": (r"\mathrm{theory}", "theory"),
    # letters with their axes
    "J_yy": ("J_{yy}", "J_yy"),
    "Ixx": ("I_{xx}", "I_xx"),
    "Fx": ("F_x", "F_x"),
    "Fn": ("F_n", "F_n"),
    "mc": ("m_c", "m_c"),
    "xC": ("x_C", "x_C"),
    "vx": ("v_x", "v_x"),
    "wz": (r"\omega_z", "ω_z"),
    "rod_wx": (r"\omega_{\mathrm{rod},x}", "ω_rod_x"),
    "tip_vy": (r"v_{\mathrm{tip},y}", "v_tip_y"),
    # rates
    "theta1_dot": (r"\dot{\theta}_1", "θ₁'"),
    "theta1_ddot": (r"\ddot{\theta}_1", "θ₁''"),
    "theta1_dddot": (r"\dddot{\theta}_1", "θ₁'''"),
    "s_dot": (r"\dot{s}", "s'"),
    "s_ddot": (r"\ddot{s}", "s''"),
    "x_ddot": (r"\ddot{x}", "x''"),
    "bend_dot": (r"\dot{\mathrm{bend}}", "bend'"),
    "bend_ddot": (r"\ddot{\mathrm{bend}}", "bend''"),
    "pin_x_dot": (r"\dot{\mathrm{pin}}_x", "pin_x'"),
    "x_hub_left_dot": (r"\dot{x}_{\mathrm{hub,left}}", "x_hub_left'"),
    "rod_wx_dot": (r"\dot{\omega}_{\mathrm{rod},x}", "ω_rod_x'"),
    "theta_dot_max": (r"\dot{\theta}_{\mathrm{max}}", "θ_max'"),
    # coordinates of joints of several degrees
    "ball_1": (r"\mathrm{ball}_1", "ball₁"),
    "ball_1_dot": (r"\dot{\mathrm{ball}}_1", "ball₁'"),
    "ball_e0": (r"\mathrm{ball}_{e0}", "ball_e0"),
    "ball_wz": (r"\omega_{\mathrm{ball},z}", "ω_ball_z"),
    # instances, motion of markers, multipliers
    "leg.hip": (r"\mathrm{hip}_{\mathrm{leg}}", "hip_leg"),
    "leg.theta1": (r"\theta_{1,\mathrm{leg}}", "θ₁_leg"),
    "leg.theta1_dot": (r"\dot{\theta}_{1,\mathrm{leg}}", "θ₁_leg'"),
    "front.left.z": (r"z_{\mathrm{front.left}}", "z_front.left"),
    "vx(rod.tip)": (r"v_{x,\mathrm{rod.tip}}", "v_x_rod.tip"),
    "z(tip)": (r"z_{\mathrm{tip}}", "z_tip"),
    "lambda[0]": (r"\lambda_0", "λ₀"),
    "force(k1)": (r"\mathrm{force}(\mathrm{k1})", "force(k1)"),
    "t": ("t", "t"),
}


@pytest.mark.parametrize("name", NAMES)
def test_a_name_is_printed_as_in_a_textbook(name: str) -> None:
    notation = Notation()
    assert (notation.latex(name), notation.text(name)) == NAMES[name]
    assert notation.latex(name, of_time=True) == f"{NAMES[name][0]}(t)"


def test_the_table_is_long_enough() -> None:
    assert len(NAMES) >= 60


@pytest.mark.parametrize("name", [*NAMES, "a_ddddot", "strange name", "µ", "a<b", "x&y%#", "_", "a__b_", ""])
def test_every_form_is_well_formed(name: str) -> None:
    """Judged by Matplotlib's reader of LaTeX and by a reader of XML."""
    notation = Notation([name])
    read: Any = MathTextParser("path").parse
    read(f"${notation.latex(name)}$") if name else None
    read(notation.mathtext(name))
    for form in (notation.html(name), notation.mathml(name)):
        ET.fromstring(f"<p>{form}</p>")


@pytest.mark.parametrize(
    "names",
    [
        ("theta1", "theta_1"),
        ("theta_1", "theta1"),
        ("m_c", "mc"),
        ("mc", "m_c"),
        ("l_12", "l12", "l_1_2", "l__12"),
        ("lambda_", "lamda", "lambda1", "lamda_1"),
        ("wx", "omega_x", "omegax"),
        ("x_hub_left", "x__hub_left", "x_hub__left"),
        ("theta1", "theta_1", "theta1_dot", "theta_1_dot", "theta1_ddot", "theta_1_ddot"),
        ("v_pin_x", "pin_vx", "x_pin"),
        ("varepsilon", "epsilon", "phi", "varphi"),
    ],
)
def test_names_that_would_look_alike_are_kept_apart(names: tuple[str, ...]) -> None:
    notation = Notation(names)
    for form in (notation.latex, notation.text, notation.html, notation.mathml, notation.mathtext):
        assert len({form(name) for name in names}) == len(names)


def test_the_first_of_two_alike_keeps_its_form() -> None:
    notation = Notation(["theta1", "theta_1"])
    assert notation.latex("theta1") == r"\theta_1"
    assert notation.latex("theta_1") == r"\mathrm{theta\_1}"
    assert notation.latex("theta_1_dot") == r"\dot{\mathrm{theta\_1}}"
    assert notation.text("theta_1") == "theta_1"
    assert Notation(["theta_1", "theta1"]).latex("theta1") == r"\mathrm{theta1}"


def test_given_latex_comes_first_and_others_give_way() -> None:
    notation = Notation(["b", "a", "m_c"], latex={"a": "b", "m_c": r"\theta"})
    assert notation.latex("a") == "b"
    assert notation.latex("b") == r"\mathrm{b}"
    assert (notation.text("a"), notation.text("b")) == ("a", "b")  # in text b is b
    assert notation.text("m_c") == "θ"
    both = Notation(["a", "b"], latex={"a": "q", "b": "q"})
    assert both.latex("a") != both.latex("b")


def test_instances_of_components_become_subscripts() -> None:
    names = ["leg1_theta", "leg2_theta", "leg1_m_c", "leg1_foot_s", "legs"]
    notation = Notation(names, instances={"leg1": "leg1_", "leg2": "leg2_"})
    assert notation.latex("leg1_theta") == r"\theta_{\mathrm{leg1}}"
    assert notation.latex("leg1_theta_dot") == r"\dot{\theta}_{\mathrm{leg1}}"
    assert notation.latex("leg1_m_c") == r"m_{c,\mathrm{leg1}}"
    assert notation.latex("legs") == r"\mathrm{legs}"


def test_html_is_for_people() -> None:
    notation = Notation()
    assert notation.html("theta1") == "<i>θ</i><sub>1</sub>"
    assert notation.html("m_c") == "<i>m</i><sub><i>c</i></sub>"
    assert notation.html("s_dot") == "<i>ṡ</i>"
    assert "bend" in notation.html("bend_dot")
    assert "˙" in notation.html("bend_dot")
    assert notation.mathml("theta1_dot") == (
        "<msub><mover><mi>θ</mi><mo style='padding-bottom:.1em;font-weight:bold'>˙</mo></mover><mn>1</mn></msub>"
    )


def test_sympy_prints_with_it() -> None:
    import sympy

    theta, m_c, rate = sympy.symbols("theta1 m_c theta1_dot")
    names = Notation(["theta1", "m_c", "theta1_dot"], latex={"m_c": r"m_{\rm c}"}).symbol_names((theta, m_c, rate))
    assert sympy.latex(m_c * rate**2 * sympy.cos(theta), symbol_names=names) == (
        r"m_{\rm c} \dot{\theta}_1^{2} \cos{\left(\theta_1 \right)}"
    )


@pytest.mark.parametrize("name", ["u", "u_dot", "theta_1", "theta_ddot"])
def test_rates_of_rates(name: str) -> None:
    stem, order = split_rate(name)
    assert split_rate(rate_of(name)) == (stem, order + 1)
    assert split_rate(rate_of(name, 2)) == (stem, order + 2)


@pytest.mark.parametrize(
    ("names", "wanted"),
    [
        ((), "M"),
        (("m", "M_c", "Mass", "mu"), "M"),
        (("M",), "A"),
        (("M12",), "A"),  # printed as an entry of M is
        (("M_1_2",), "A"),
        (("M", "A_3"), "K"),
        (("M", "A", "K"), r"{K}^{\ast}"),
    ],
)
def test_a_letter_of_a_display_is_no_name(names: tuple[str, ...], wanted: str) -> None:
    notation = Notation(names)
    letter = notation.letter("M", "A", "K", with_numbers=True)
    assert letter == wanted
    assert letter not in map(notation.latex, names)
    ET.fromstring(f"<p>{Notation(latex={'it': letter}).mathml('it')}</p>")  # a symbol in every form


def test_given_latex_counts_for_letters() -> None:
    notation = Notation(["mass"], latex={"mass": "M"})
    assert notation.letter("M", "A") == "A"
    assert notation.is_free("m")
    assert not notation.is_free("M")


def test_further_names_keep_apart_from_those_that_there_are() -> None:
    first = Notation(["z_0", "theta1"])
    more = first.with_names(["z0", "theta_1", "c_1", "z_0"])
    assert [more.text(name) for name in ("z_0", "z0", "theta1", "theta_1", "c_1")] == [
        "z₀",
        "z0",
        "θ₁",
        "theta_1",
        "c₁",
    ]
    assert first.text("z0") == "z₀"  # unknown there, as it was
    assert first.names == ("z_0", "theta1")
    assert more.with_names(["c_1"]) is more
    assert more.latex("z0_dot") == r"\dot{\mathrm{z0}}"
