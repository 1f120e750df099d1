"""Equations of motion given in Python are those of the section ``equations``, and their own physics."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import sympy

import eomgen as eg

BALL = """
name: ball
parameters: {r: 0.3, m: 2, k: 5}
equations:
  coordinates: [x, y, phi]
  velocities: [w, v_y, spin]
  rates: {x: r*w, y: v_y, phi: spin}
  mass_matrix: [[m*r**2*7/5, 0, 0], [0, m, 0], [0, 0, 0.4*m*r**2]]
  forcing: [-k*r*x, -0.1*v_y, 0]
  constraints: [v_y - r*spin]
  multipliers: [grip]
  kinetic_energy: m*r**2*w**2*7/10 + m*v_y**2/2 + 0.2*m*r**2*spin**2
  potential_energy: k*x**2/2
outputs: {friction: grip}
initial: {x: 0.2, w: 1.0, spin: 2.0}
"""


def ball(texts: bool) -> eg.Model:
    value = (lambda text: text) if texts else sympy.sympify
    if texts:
        M = [["m*r**2*7/5", 0, 0], [0, "m", 0], [0, 0, "0.4*m*r**2"]]
    else:
        M = sympy.diag(*map(sympy.sympify, ("m*r**2*7/5", "m", "0.4*m*r**2")))
    m = eg.Model.from_equations(
        "ball",
        ["x", "y", "phi"],
        M,
        [value("-k*r*x"), value("-0.1*v_y"), 0],
        velocities=["w", "v_y", "spin"],
        rates={"x": value("r*w"), "y": value("v_y"), "phi": value("spin")},
        constraints=[value("v_y - r*spin")],
        multipliers=["grip"],
        kinetic_energy=value("m*r**2*w**2*7/10 + m*v_y**2/2 + 0.2*m*r**2*spin**2"),
        potential_energy=value("k*x**2/2"),
        parameters={"r": 0.3, "m": 2, "k": 5},
    )
    m.output("friction", "grip")
    m.initial(x=0.2, w=1.0, spin=2.0)
    return m


@pytest.mark.parametrize("texts", [True, False])
def test_python_and_yaml_agree(texts: bool, tmp_path: Path) -> None:
    (tmp_path / "ball.yaml").write_text(BALL)
    file, own = eg.load(tmp_path / "ball.yaml").compile(target="numpy"), ball(texts).compile(target="numpy")
    assert own.x_names == file.x_names
    x = file.x0()
    np.testing.assert_allclose(own.x0(), x, rtol=0, atol=1e-15)
    np.testing.assert_allclose(own.rhs(0, x), file.rhs(0, x), rtol=1e-13)
    np.testing.assert_allclose(own.outputs(0, x), file.outputs(0, x), rtol=1e-12)
    ball(texts).save(tmp_path / "again.yaml")
    again = eg.load(tmp_path / "again.yaml").compile(target="numpy")
    np.testing.assert_allclose(again.rhs(0, x), file.rhs(0, x), rtol=1e-13)


def test_functions_of_time() -> None:
    """A pendulum in SymPy's dynamicsymbols: theta'' = (tau - m g l sin theta) / (m l^2)."""
    m, l, g, tau, t = sympy.symbols("m l g tau t")
    theta = sympy.Function("theta")(t)
    model = eg.Model.from_equations(
        "p",
        [theta],
        sympy.Matrix([[m * l**2]]),
        [tau - m * g * l * sympy.sin(theta) - theta.diff(t) / 10],
        parameters={m: 2.0, l: 0.5},
        inputs={tau: 0.3},
    )
    assert [entry.name for entry in model.description.sections["parameters"]] == ["m", "l", "g"]
    model.description.sections["parameters"][2].values["value"] = 9.81
    mod = model.compile(target="numpy")
    wanted = (0.3 - 2 * 9.81 * 0.5 * np.sin(0.7) - 0.2 / 10) / (2 * 0.25)
    np.testing.assert_allclose(mod.rhs(0, [0.7, 0.2]), [0.2, wanted], rtol=1e-13)


def test_faults() -> None:
    with pytest.raises(eg.UsageError, match="from_equations has no argument 'masses'"):
        eg.Model.from_equations("p", ["q"], [[1]], [0], masses=1)
    with pytest.raises(eg.ModelError, match=r"equations.mass_matrix: is 1 x 2 for 1 velocities"):
        eg.Model.from_equations("p", ["q"], [[1, 0]], [0]).mechanism()
    with pytest.raises(eg.ModelError, match=r"equations.forcing: 2 expressions for 1 velocities"):
        eg.Model.from_equations("p", ["q"], [[1]], [0, "q"]).mechanism()
