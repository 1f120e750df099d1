"""LaTeX that a model gives for its names: in documents, plots and packages; what could leave a formula is refused."""

from pathlib import Path

import matplotlib
import pytest
import sympy
from model_files import load, schema_faults
from refusals import refused, refuses

import eomgen as eg

matplotlib.use("Agg")
TEXT = r"""
name: cart
gravity: [0, -g, 0]
parameters:
  g: 9.81
  m_c: {value: 2, unit: kg, latex: 'm_{\rm c}'}
  l_12: {value: 0.5, unit: m}
inputs: {push: {value: 0, unit: N, latex: F_p}}
bodies:
  cart: {mass: m_c}
  rod: {mass: 1, com: [0, -l_12, 0], inertia: {zz: 0.1}}
  ball: {mass: 1, inertia: {xx: 0.1, yy: 0.1, zz: 0.1}}
joints:
  slide: {type: prismatic, between: [ground, cart], axis: x, coordinate: s, latex: 'x_{w}'}
  swing: {type: revolute, between: [cart, rod], coordinate: theta1}
  turn: {type: spherical, between: [rod, ball], latex: {turn_2: \psi}}
forces:
  motor: {type: actuator, joint: slide, value: push}
outputs:
  E: {expression: total_energy, latex: '\mathcal{E}'}
  pin_x: x(rod)
initial: {theta1: 0.3, s_dot: 0.2}
"""


GIVEN = {"m_c": r"m_{\rm c}", "push": "F_p", "s": "x_{w}", "turn_2": r"\psi", "E": r"\mathcal{E}"}
PLAIN = TEXT
for said in (
    r", latex: 'm_{\rm c}'",
    ", latex: F_p",
    ", latex: 'x_{w}'",
    r", latex: {turn_2: \psi}",
    r", latex: '\mathcal{E}'",
):
    assert said in PLAIN
    PLAIN = PLAIN.replace(said, "")


def test_python_says_the_same_as_the_file(tmp_path: Path) -> None:
    m = eg.Model("cart", gravity=(0, "-g", 0))
    m.parameter("g", 9.81)
    m.parameter("m_c", 2, unit="kg", latex=r"m_{\rm c}")
    m.parameter("l_12", 0.5, unit="m")
    m.input("push", 0, unit="N", latex="F_p")
    cart = m.body("cart", mass="m_c")
    rod = m.body("rod", mass=1, com=(0, "-l_12", 0), inertia={"zz": 0.1})
    ball = m.body("ball", mass=1, inertia=(0.1, 0.1, 0.1))
    m.prismatic("slide", m.ground, cart, axis="x", coordinate="s", latex="x_{w}")
    m.revolute("swing", cart, rod, coordinate="theta1")
    m.spherical("turn", rod, ball, latex=[None, r"\psi", None])
    m.actuator("motor", "slide", value="push")
    m.output("E", m.total_energy, latex=r"\mathcal{E}")
    m.output("pin_x", rod.position[0])
    m.initial(theta1=0.3, s_dot=0.2)
    file = load(tmp_path, TEXT)
    own, read, plain = (each.compile(target="numpy") for each in (m, file, load(tmp_path, PLAIN, "plain.yaml")))
    assert own.metadata["latex"] == read.metadata["latex"] == GIVEN
    assert "latex" not in plain.metadata
    digests = {each.metadata["model_digest"] for each in (own, read, plain)}
    assert len(digests) == 1  # nothing that is computed depends on it
    assert load(tmp_path, file.to_yaml()).to_yaml() == file.to_yaml()
    assert schema_faults(TEXT) == []
    assert schema_faults(TEXT.replace(r"'m_{\rm c}'", "3")) == ["parameters.m_c"]


def test_documents_plots_and_stored_runs_print_it(tmp_path: Path) -> None:
    equations = load(tmp_path, TEXT).derive()
    document = equations.explain(level="short")
    for words in (r"m_{\rm c}", "x_{w}", r"\psi"):
        assert words in document.latex
    run = equations.compile("numpy").simulate((0, 0.1))
    for one in (run, eg.load_trajectory(run.save(tmp_path / "run.npz"))):
        assert one.plot("s_dot").get_ylabel() == r"$\dot{x}_{w}$ (m/s)"
        panel = one.plot("theta1", "turn_2")
        panel.figure.canvas.draw()
        assert [text.get_text() for text in panel.get_legend().get_texts()] == [r"$\theta_{1}$", r"$\psi$"]


def test_names_of_multipliers_and_velocities_take_it(tmp_path: Path) -> None:
    """A bead on a circle: the multiplier is the tension over twice the radius."""
    text = r"""
name: bead
parameters: {m: 2, g: 9.81}
lagrangian:
  coordinates: [x, y]
  expression: m*(x_dot**2 + y_dot**2)/2 - m*g*y
  constraints: [x**2 + y**2 - 1]
  latex: {x: '\xi', x_dot: '\Omega', lambda_1: '\mu_{\rm s}'}
initial: {y: -1, x_dot: 1}
"""
    document = load(tmp_path, text).derive("augmented").explain()
    for words in (r"\mu_{\rm s}", r"\Omega"):
        assert words in document.markdown
    assert r"\lambda_1" not in document.markdown
    assert "<mi>μ</mi>" in document.html
    with refused("EG-NAME-UNKNOWN lagrangian.latex.lambda_2"):
        load(tmp_path, text.replace("lambda_1", "lambda_2")).check()


def test_instances_of_components_tell_their_names_apart(tmp_path: Path) -> None:
    text = r"""
name: pair
components:
  leg:
    attachments: [top]
    parameters: {k: {value: 3, latex: 'k_{s}'}, l: 1}
    bodies: {rod: {mass: 1, com: [l, 0, 0], inertia: {zz: 0.1}}}
    joints: {hip: {type: revolute, between: [top, rod], coordinate: theta, latex: \vartheta}}
bodies: {cart: {mass: 1}}
joints: {slide: {type: prismatic, between: [ground, cart], coordinate: s}}
add:
  leg1: {component: leg, at: cart}
  leg2: {component: leg, at: cart}
"""
    document = load(tmp_path, text).derive().explain()
    for words in (r"k_{s,\mathrm{leg1}}", r"\dot{\vartheta}_{\mathrm{leg2}}", r"l_{\mathrm{leg2}}"):
        assert words in document.latex, words


def test_lagrangians_and_equations_of_python_take_a_mapping_of_any_name() -> None:
    q, q_dot, k = sympy.symbols("q q_dot k")
    given = {q: r"\varphi", k: "k_s", "u": r"\mu"}
    L = q_dot**2 / 2 - k * q**2 / 2
    swing = eg.Model.from_lagrangian("swing", L, [q], forces=["u"], inputs={"u": 0}, parameters={k: 1}, latex=given)
    spring = eg.Model.from_equations("s", [q], [[1]], ["u - k*q"], inputs={"u": 0}, parameters={"k": 1}, latex=given)
    for model in (swing, spring):
        found = model.compile(target="numpy").metadata["latex"]
        assert found == {"q": r"\varphi", "k": "k_s", "u": r"\mu"}
    with refused("EG-NAME-UNKNOWN equations.latex.z"):
        eg.Model.from_equations("spring", [q], [[1]], ["-q"], latex={"z": "z"}).check()


#: Name -> as Matplotlib prints it.
PRINTED = {
    "q12": "q_{12}", "m_c": "m_{c}", "l_1_2": "l_{1,2}", "theta1": r"\theta_{1}", "Omega": r"\Omega",
    "theta_1": r"\mathrm{theta\_1}", "k_max": r"k_{\mathrm{max}}", "J_yy": "J_{yy}", "vx": "v_{x}",
}  # fmt: skip


def test_names_without_latex_are_printed_as_in_a_textbook_and_kept_apart() -> None:
    m = eg.Model("names")
    m.prismatic("p", m.ground, m.body("b", mass=1), coordinate="w")
    for name in PRINTED:
        m.output(name, 1)
    run = m.compile(target="numpy").simulate(0.01)
    labels = [text.get_text() for text in run.plot(*PRINTED).get_legend().get_texts()]
    assert labels == [f"${latex}$" for latex in PRINTED.values()]
    assert run.plot("w_dot").get_ylabel().startswith(r"$\dot{w}$")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("'m_{\\rm c}'", "'m_{c'"), "EG-NOTATION parameters.m_c.latex m_{c"),
        (("F_p", "$F$"), "EG-NOTATION inputs.push.latex: $F$"),
        (("'x_{w}'", "'\\input{x}'"), "EG-NOTATION joints.slide.latex \\input{x}"),
        (("{turn_2: \\psi}", "{turn_4: \\psi}"), "EG-NAME-UNKNOWN joints.turn.latex.turn_4"),
        (("{turn_2: \\psi}", "[a, b]"), "EG-SHAPE joints.turn.latex 2 3"),
        (("{turn_2: \\psi}", "3"), "EG-TYPE joints.turn.latex 3"),
        (("'\\mathcal{E}'", "'<script>'"), "EG-NOTATION outputs.E.latex <script>"),
    ],
)
def test_what_is_wrong_is_reported_with_its_place(change: tuple[str, str], message: str, tmp_path: Path) -> None:
    assert change[0] in TEXT
    refuses(message, lambda: load(tmp_path, TEXT.replace(*change)).check())


#: What no symbol has -> a word of the message.
REFUSED = {
    "{}": "nothing",
    "$m$": "'$'",
    "m}": "'}'",
    "m_{c": "'{'",
    "m_": "_",
    "_c": "'_'",
    "a_b_c": "twice",
    r"\dot": "nothing after",
    r"\dot{}": "nothing",
    "m\\": "backslash",
    r"m\\n": r"\\",
    r"\input{/etc/passwd}": r"\input",
    r"\write18{ls}": r"\write",
    r"\href{javascript:alert(1)}{x}": r"\href",
    r"\def\x{y}": r"\def",
    r"\csname input\endcsname": r"\csname",
    r"\catcode`\$=12": r"\catcode",
    r"\begin{matrix}": r"\begin",
    r"\color{red}x": r"\color",
    r"\(": r"\(",
    "m%": "'%'",
    "m&n": "'&'",
    "m#1": "'#'",
    "m~n": "'~'",
    '"': "'\"'",
    "<script>alert(1)</script>": "'<'",
    "θ": r"θ",
    "x\x00": "U+0000",
    "x\u202e": "U+202E",
    r"\text{a_b}": "'_'",
    r"\thet": r"\thet",
    "x" * 121: "121",
    "{" * 9 + "x" + "}" * 9: "groups",
}


def test_what_could_leave_the_formula_is_refused() -> None:
    m = eg.Model("names")
    m.prismatic("p", m.ground, m.body("b", mass=1), coordinate="w")
    for k, latex in enumerate(REFUSED):
        m.parameter(f"p{k}", 1, latex=latex)
    with pytest.raises(eg.ModelError) as raised:
        m.check()
    told = {p.path: p for p in raised.value.problems}
    for k, (latex, word) in enumerate(REFUSED.items()):
        problem = told[f"parameters.p{k}.latex"]
        assert word in f"{problem.message}; {problem.remedy}", latex
        assert str(problem).isprintable()
