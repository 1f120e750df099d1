"""The slider-crank of the documentation, in both of its forms."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from eomgen import Model, load
from eomgen.errors import ModelError, Problem

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


@pytest.fixture
def slider_crank_text() -> str:
    return SLIDER_CRANK


@pytest.fixture
def slider_crank() -> Model:
    """The same mechanism in Python, in SymPy, texts and numbers."""
    m = Model("slider_crank", gravity=(0, "-g", 0))
    _, r, l = m.parameter("g", 9.81), m.parameter("r", 0.1, unit="m"), m.parameter("l", 0.35, unit="m")
    m_c, m_r, m_s = m.parameter("m_c", 1.0), m.parameter("m_r", 0.8), m.parameter("m_s", 0.5)
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


Write = Callable[[str], Path]
Find = Callable[[str], list[Problem]]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def write(text: str) -> Path:
        path = tmp_path / "model.yaml"
        path.write_text(text, encoding="utf-8")
        return path

    return write


@pytest.fixture
def problems_of(write: Write) -> Find:
    """All problems of a model file's text; none if it is a mechanism."""

    def problems_of(text: str) -> list[Problem]:
        try:
            load(write(text)).mechanism()
        except ModelError as error:
            return list(error.problems)
        return []

    return problems_of


@pytest.fixture
def change(slider_crank_text: str) -> Callable[[str, str], str]:
    """The slider-crank's text with one piece replaced, which must be there exactly once."""

    def change(old: str, new: str) -> str:
        assert len(re.findall(re.escape(old), slider_crank_text)) == 1
        return slider_crank_text.replace(old, new)

    return change
