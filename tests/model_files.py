"""Model files as a user has them: a text -> a model, its faults, and what a model looks like once it is written."""

from pathlib import Path
from typing import Any

import command
from jsonschema import Draft202012Validator
from ruamel.yaml import YAML

import eomgen as eg

EXAMPLES = Path(__file__).parents[1] / "examples"
#: The slider-crank of the documentation.
SLIDER_CRANK = """\
name: slider_crank
gravity: [0, -g, 0]
parameters:
  r: {value: 0.1, unit: m, doc: crank radius}
  l: {value: 0.35, unit: m}
  m_c: {value: 1.0, unit: kg}
  m_r: {value: 0.8, unit: kg}
  m_s: {value: 0.5, unit: kg}
  g: 9.81
inputs: {tau: {value: 0.0, unit: N*m}}
bodies:
  crank: {mass: m_c, com: [r/2, 0, 0], inertia: {zz: m_c*r**2/12}, markers: {pin: [r, 0, 0]}}
  rod: {mass: m_r, com: [l/2, 0, 0], inertia: {zz: m_r*l**2/12}, markers: {tip: {at: [l, 0, 0], rpy: [0, 0, 0]}}}
  slider: {mass: m_s}
joints:
  A: {type: revolute, between: [ground, crank], coordinate: theta}
  B: {type: revolute, between: [crank.pin, rod]}
  C: {type: revolute, between: [rod.tip, slider]}
  D: {type: prismatic, between: [ground, slider], axis: x, coordinate: s}
forces:
  motor: {type: torque, joint: A, value: tau}
  k1: {type: spring, between: [{body: ground, at: [0.5, 0, 0]}, slider], stiffness: 200, length: 0.1}
outputs: {pin_x: x(rod.tip), speed: vx(slider)}
independent: [theta]
initial: {theta: 0.3, theta_dot: 10}
simulation: {end: 5, method: DOP853, rtol: 1e-9, atol: 1e-11}
"""


def slider_crank() -> eg.Model:
    """The same mechanism in Python, in SymPy, texts and numbers."""
    m = eg.Model("slider_crank", gravity=(0, "-g", 0))
    _, r, l = m.parameter("g", 9.81), m.parameter("r", 0.1, unit="m"), m.parameter("l", 0.35, unit="m")
    m_c, m_r, m_s = (m.parameter(f"m_{k}", x, unit="kg") for k, x in (("c", 1.0), ("r", 0.8), ("s", 0.5)))
    crank = m.body("crank", mass=m_c, com=(r / 2, 0, 0), inertia={"zz": m_c * r**2 / 12})
    rod = m.body("rod", mass=m_r, com=("l/2", 0, 0), inertia={"zz": "m_r*l**2/12"})
    slider = m.body("slider", mass=m_s)
    tip = rod.marker("tip", at=(l, 0, 0))
    m.revolute("A", m.ground, crank, coordinate="theta")
    m.revolute("B", crank.at(r, 0, 0), rod)
    m.revolute("C", tip, slider)
    m.prismatic("D", m.ground, slider, axis="x", coordinate="s")
    tau = m.input("tau")
    m.torque("motor", "A", tau)
    m.spring("k1", m.ground.at(0.5, 0, 0), slider, stiffness=200, length=0.1)
    m.output("pin_x", tip.position[0])
    m.output("speed", slider.velocity[0])
    m.independent("theta")
    m.initial(theta=0.3, theta_dot=10)
    m.simulation(end=5, method="DOP853", rtol=1e-9, atol=1e-11)
    return m


def load(folder: Path, text: str, name: str = "model.yaml", **options: Any) -> eg.Model:
    """The model of a file with this text."""
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return eg.load(path, **options)


def faults(folder: Path, text: str, **options: Any) -> list[Any]:
    """What is wrong with a file of this text, all of it; nothing if it is a mechanism."""
    try:
        load(folder, text, **options).check()
    except eg.ModelError as error:
        return list(error.problems)
    return []


def described(model: eg.Model | str) -> Any:
    """The model as its own file has it, or the text of a file."""
    return YAML(typ="safe", pure=True).load(model if isinstance(model, str) else model.to_yaml())


def schema() -> Any:
    """The JSON Schema of model files, as the command line prints it."""
    return command.run("check", "--schema").json


def schema_faults(model: eg.Model | str) -> list[str]:
    """Places in a model file that the JSON Schema refuses."""
    found = Draft202012Validator(schema()).iter_errors(described(model))
    return [".".join(map(str, error.absolute_path)) for error in found]
