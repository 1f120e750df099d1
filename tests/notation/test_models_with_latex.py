"""LaTeX given in a model: in Python and in model files, told to modules, to plots and to exported packages."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator

import eomgen as eg
from eomgen.describe.digest import model_digest
from eomgen.describe.schema import model_schema
from eomgen.describe.yaml_file import describe_yaml
from eomgen.generation import generate
from eomgen.notation import Notation

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


def model(text: str = TEXT) -> eg.Model:
    return eg.Model.from_description(describe_yaml(text))


def text_without_latex() -> str:
    """The same model, nothing said of how it is printed."""
    found = TEXT.replace(r", latex: 'm_{\rm c}'", "").replace(", latex: F_p", "").replace(", latex: 'x_{w}'", "")
    found = found.replace(r", latex: {turn_2: \psi}", "").replace(r", latex: '\mathcal{E}'", "")
    assert "latex" not in found
    return found


GIVEN = {"m_c": r"m_{\rm c}", "push": "F_p", "s": "x_{w}", "turn_2": r"\psi", "E": r"\mathcal{E}"}


def test_a_model_file_says_how_names_are_printed() -> None:
    mechanism = model().mechanism()
    assert dict(mechanism.latex) == GIVEN


def test_python_says_the_same_as_the_file() -> None:
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
    assert dict(m.mechanism().latex) == GIVEN
    assert model_digest(m.mechanism()) == model_digest(model().mechanism())


def test_it_is_written_and_read_back() -> None:
    written = model().to_yaml()
    assert dict(model(written).mechanism().latex) == GIVEN
    assert model(written).to_yaml() == written


def test_the_schema_knows_it() -> None:
    from ruamel.yaml import YAML

    data = YAML(typ="safe", pure=True).load(TEXT)
    validator = Draft202012Validator(model_schema())
    validator.validate(data)
    data["parameters"]["m_c"]["latex"] = 3
    assert list(validator.iter_errors(data))


def test_nothing_that_is_computed_depends_on_it() -> None:
    """Caches and stored runs compare this digest."""
    assert model_digest(model().mechanism()) == model_digest(model(text_without_latex()).mechanism())


def test_generated_c_code_is_the_same(tmp_path: Path) -> None:
    for name, text in (("with", TEXT), ("without", text_without_latex())):
        generate(model(text), tmp_path / name, target="c")
    codes = [
        {path.name: path.read_text() for path in (tmp_path / name).rglob("*.[ch]")} for name in ("with", "without")
    ]
    assert codes[0].keys() == codes[1].keys()
    assert len("".join(codes[0].values())) > 20_000
    told = re.compile(r"metadata_texts\[.*?\n\};", re.DOTALL)  # what the module says of itself
    assert codes[0] != codes[1]
    with_latex, without = ({name: told.sub("", text) for name, text in code.items()} for code in codes)
    assert with_latex == without


def test_a_module_and_its_runs_know_it() -> None:
    module = model().compile(target="numpy")
    assert module.metadata["latex"] == GIVEN
    run = module.simulate((0, 0.1))
    notation = Notation.of(run.metadata)
    assert notation.latex("s_dot") == r"\dot{x}_{w}"
    assert notation.latex("turn_2_ddot") == r"\ddot{\psi}"
    assert "<i>x</i><sub><i>w</i></sub>" in module._repr_html_()
    assert "latex" not in model(text_without_latex()).compile(target="numpy").metadata


def test_plots_print_it() -> None:
    import matplotlib

    matplotlib.use("Agg")
    run = model().compile(target="numpy").simulate((0, 0.1))
    ax = run.plot("s_dot")
    assert ax.get_ylabel() == r"$\dot{x}_{w}$ (m/s)"
    panel = run.plot("theta1", "turn_2")
    panel.figure.canvas.draw()
    assert [text.get_text() for text in panel.get_legend().get_texts()] == [r"$\theta_{1}$", r"$\psi$"]


def test_a_stored_run_prints_it(tmp_path: Path) -> None:
    model().compile(target="numpy").simulate((0, 0.1)).save(tmp_path / "run.npz")
    loaded = eg.load_trajectory(tmp_path / "run.npz")
    assert Notation.of(loaded.metadata).text("m_c") == "m_c"
    assert Notation.of(loaded.metadata).latex("m_c") == r"m_{\rm c}"
    assert loaded.plot("s").get_ylabel() == "$x_{w}$ (m)"


ALONE = """
import sys
sys.modules["eomgen"] = sys.modules["sympy"] = None
import matplotlib
matplotlib.use("Agg")
import cart
run = cart.simulate((0, 0.1))
print(run.plot("s").get_ylabel(), run.plot("theta1_dot").get_ylabel())
"""


def test_an_exported_package_prints_it_without_eomgen_and_sympy(tmp_path: Path) -> None:
    generate(model(), tmp_path, target="numpy")
    done = subprocess.run(
        [sys.executable, "-c", ALONE], cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split("\n")[0] == r"$x_{w}$ (m) $\dot{\theta}_{1}$ (rad/s)"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("'m_{\\rm c}'", "'m_{c'"), "parameters.m_c.latex: 'm_{c' has a '{' without its '}'"),
        (("F_p", "$F$"), "inputs.push.latex: '$F$' has '$'"),
        (("'x_{w}'", "'\\input{x}'"), r"joints.slide.latex: '\input{x}' has \input"),
        (("{turn_2: \\psi}", "{turn_4: \\psi}"), "joints.turn.latex.turn_4: no coordinate 'turn_4'"),
        (("{turn_2: \\psi}", "[a, b]"), "joints.turn.latex: 2 texts for 3 coordinates"),
        (("{turn_2: \\psi}", "3"), "joints.turn.latex: 3 is not the LaTeX of a symbol"),
        (("'\\mathcal{E}'", "'<script>'"), "outputs.E.latex: '<script>' has '<'"),
    ],
)
def test_what_is_wrong_is_told_with_its_place(change: tuple[str, str], message: str) -> None:
    assert change[0] in TEXT
    with pytest.raises(eg.ModelError) as raised:
        model(TEXT.replace(*change)).mechanism()
    assert message in str(raised.value)


def test_an_output_that_repeats_a_coordinate_may_not_be_printed_otherwise() -> None:
    m = model()
    m.output("s", "s", latex="z")
    with pytest.raises(eg.ModelError, match="printed as 'x_{w}' already"):
        m.mechanism()


def test_instances_of_components_tell_their_names_apart() -> None:
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
    metadata: Any = model(text).compile(target="numpy").metadata
    notation = Notation.of(json.loads(json.dumps(metadata)))
    assert notation.latex("leg1_k") == r"k_{s,\mathrm{leg1}}"
    assert notation.latex("leg2_theta_dot") == r"\dot{\vartheta}_{\mathrm{leg2}}"
    assert notation.latex("leg2_l") == r"l_{\mathrm{leg2}}"  # from its name and the instance's


def test_bare_lagrangians_and_equations_take_a_mapping() -> None:
    text = r"""
name: pendulum
parameters: {g: 9.81, l: 1}
lagrangian: {coordinates: [q], expression: l**2*q_dot**2/2 + g*l*cos(q), latex: {q: \varphi}}
"""
    assert dict(model(text).mechanism().latex) == {"q": r"\varphi"}
    text = r"""
name: spring
parameters: {k: 4}
equations: {coordinates: [q], mass_matrix: [[1]], forcing: [-k*q], latex: \xi}
"""
    assert dict(model(text).mechanism().latex) == {"q": r"\xi"}


def test_lagrangians_and_equations_of_python_take_a_mapping_of_any_name() -> None:
    import sympy

    q, q_dot, k = sympy.symbols("q q_dot k")
    given = {q: r"\varphi", k: "k_s", "u": r"\mu"}
    names = {"q": r"\varphi", "k": "k_s", "u": r"\mu"}
    swing = eg.Model.from_lagrangian(
        "swing", q_dot**2 / 2 - k * q**2 / 2, [q], forces=["u"], inputs={"u": 0}, latex=given
    )
    assert dict(swing.mechanism().latex) == names
    spring = eg.Model.from_equations("spring", [q], [[1]], ["u - k*q"], inputs={"u": 0}, latex=given)
    assert dict(spring.mechanism().latex) == names
    assert swing.derive().notation.latex("q_ddot") == r"\ddot{\varphi}"
    with pytest.raises(eg.ModelError, match="no coordinate 'z'"):
        eg.Model.from_equations("spring", [q], [[1]], ["-q"], latex={"z": "z"}).mechanism()
