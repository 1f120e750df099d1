"""Functional mock-up units before they run: start values, what follows from them, and its derivatives."""

from __future__ import annotations

import ctypes
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
import sympy as sp
from fmpy import read_model_description, simulate_fmu
from fmu_instances import initialized, opened

import eomgen as eg
from eomgen.fmu import write_fmu
from eomgen.pipeline import derive


@pytest.fixture(scope="module")
def crank(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Any]:
    folder = tmp_path_factory.mktemp("fmu")
    path = write_fmu(derive(models.build("slider_crank"), "auto"), folder / "slider_crank.fmu")
    return path, models.build("slider_crank").compile(target="numpy")


def test_derivatives_of_start_states_follow_the_loops(crank: tuple[Path, Any]) -> None:
    """In initialization mode dependent states are unknowns: by theta, its rate and the crank, of the closed form.

    s = r cos(theta) + sqrt(l^2 - r^2 sin(theta)^2).
    """
    path, module = crank
    instance, at = opened(path)
    instance.setupExperiment(startTime=0.0)
    instance.enterInitializationMode()
    value = dict(zip((*module.p_names, *module.x_names), [*module.p, *module.x0()], strict=True))
    theta, r, l, w = sp.symbols("theta r l w", real=True)
    s = r * sp.cos(theta) + sp.sqrt(l**2 - r**2 * sp.sin(theta) ** 2)
    s_dot = sp.diff(s, theta) * w
    s_ddot = sp.diff(s_dot, theta) * w  # and the crank's acceleration is another unknown
    numbers = {theta: value["theta"], r: value["r"], l: value["l"], w: value["theta_dot"]}
    for known, symbol in (("theta", theta), ("theta_dot", w), ("r", r), ("l", l)):
        unknowns = [at[name] for name in ("s", "s_dot", "der(s)", "speed", "der(s_dot)", "der(theta_dot)")]
        found = instance.getDirectionalDerivative(unknowns, [at[known]], [1.0])
        of_s, of_v = (float(sp.diff(x, symbol).subs(numbers)) for x in (s, s_dot))
        np.testing.assert_allclose(found[:4], [of_s, of_v, of_v, of_v], rtol=1e-8, atol=1e-9)
        alpha = sp.Symbol("alpha")
        whole = s_ddot + sp.diff(s, theta) * alpha
        numbers[alpha] = instance.getReal([at["der(theta_dot)"]])[0]
        expected = float((sp.diff(whole, symbol) + sp.diff(s, theta) * found[5]).subs(numbers))
        assert found[4] == pytest.approx(expected, rel=1e-7, abs=1e-8)
    instance.freeInstance()


def test_rolling_keeps_the_start_values_that_hold(tmp_path: Path) -> None:
    """A disc on a plane: lean and rates as they are set, height and velocity of the centre in closed form."""
    path = write_fmu(derive(models.build("rolling_disc"), "auto"), tmp_path / "rolling_disc.fmu")
    instance, at = opened(path)
    r = float(next(v for v in read_model_description(str(path)).modelVariables if v.name == "r").start)
    given = {"lean": 0.6, "x": 3.0, "yaw_dot": 2.0, "lean_dot": 0.4, "spin_dot": 5.0}
    instance.setReal([at[name] for name in given], list(given.values()))
    initialized(instance)
    found = dict(zip(at, instance.getReal(list(at.values())), strict=True))
    assert {name: found[name] for name in given} == given
    assert found["z"] == pytest.approx(r * np.cos(0.6), abs=1e-12)
    assert found["z_dot"] == pytest.approx(-r * np.sin(0.6) * 0.4, abs=1e-12)
    assert found["x_dot"] == pytest.approx(r * (5.0 + 2.0 * np.sin(0.6)), abs=1e-12)
    instance.freeInstance()


def test_loops_follow_start_values_and_parameters(crank: tuple[Path, Any]) -> None:
    """The others stay on the branch of the model's own start; what cannot be assembled is an error."""
    path, module = crank
    instance, at = opened(path)
    instance.setReal([at["theta"], at["r"], at["theta_dot"]], [2.6, 0.15, 3.0])
    initialized(instance)
    found = instance.getReal([at[name] for name in module.x_names])
    expected = module.bind(p={"r": 0.15}).x0({"theta": 2.6, "theta_dot": 3.0})
    np.testing.assert_allclose(found, expected, atol=1e-12)
    instance.reset()
    instance.setReal([at["l"]], [0.01])
    with pytest.raises(Exception, match="status 3|failed"):
        initialized(instance)
    instance.reset()
    initialized(instance)
    np.testing.assert_allclose(instance.getReal([at[name] for name in module.x_names]), module.x0(), atol=0.0)
    instance.freeInstance()


def test_all_ways_to_read_tell_the_same_during_initialization(crank: tuple[Path, Any]) -> None:
    """States and their derivatives by reference and as a whole, right after a start value was set."""
    path, module = crank
    instance, of = opened(path)
    instance.setupExperiment(startTime=0.0)
    instance.enterInitializationMode()
    instance.setReal([of["theta"]], [0.9])
    read = {name: (ctypes.c_double * module.n_x)() for name in ("rates", "x")}
    instance.fmi2GetDerivatives(instance.component, read["rates"], module.n_x)
    instance.setReal([of["theta"]], [0.8])
    instance.fmi2GetContinuousStates(instance.component, read["x"], module.n_x)
    assert list(read["x"]) == instance.getReal([of[name] for name in module.x_names])
    instance.setReal([of["theta"]], [0.9])
    assert list(read["rates"]) == instance.getReal([of[f"der({name})"] for name in module.x_names])
    instance.exitInitializationMode()
    instance.terminate()
    instance.freeInstance()


def test_an_input_with_a_signal_starts_with_it(tmp_path: Path) -> None:
    """3 + 2 cos(w t) is 5 at the start; the unit's text says that others give it; given, the motion is the model's."""
    m = eg.Model("driven")
    m.parameter("w", 4.0)
    m.prismatic("J", m.ground, m.body("b", mass=2.0), axis="x", coordinate="s")
    m.torque("push", "J", m.input("F", signal="3 + 2*cos(w*t)"))
    path = write_fmu(derive(m, "auto"), tmp_path / "driven.fmu", "3.0")
    force = next(v for v in read_model_description(str(path)).modelVariables if v.name == "F")
    assert float(force.start) == 5.0
    assert force.description == "its signal over time comes from outside"
    unconnected = simulate_fmu(str(path), fmi_type="CoSimulation", stop_time=1.0, output=["s"])
    assert unconnected["s"][-1] == pytest.approx(0.5 * 5.0 / 2.0, rel=1e-8)
    t = np.linspace(0.0, 1.0, 2001)
    signal = np.array(list(zip(t, 3.0 + 2.0 * np.cos(4.0 * t), strict=True)), dtype=[("time", float), ("F", float)])
    rows = simulate_fmu(str(path), fmi_type="ModelExchange", stop_time=1.0, input=signal, output=["s"])
    expected = m.compile(target="numpy").simulate(1.0)["s"][-1]
    assert expected == pytest.approx((1.5 + 2.0 / 16.0 * (1.0 - np.cos(4.0))) / 2.0, rel=1e-8)
    assert rows["s"][-1] == pytest.approx(expected, rel=2e-3)  # FMPy holds inputs for a while
