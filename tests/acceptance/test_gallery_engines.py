"""Engines with gas forces beside the motion of one angle, by hand with SymPy, and the work of the Otto cycle."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.integrate
import sympy as sp

import eomgen as eg

EXAMPLES = Path(__file__).parents[2] / "examples"


def gas(p: dict[str, float], after: sp.Expr) -> sp.Expr:
    """Force on a piston at the crank's angle after the dead centre at which it fires."""
    r, l, e = p["r"], p["l"], p["ratio"]
    volume = 2 * r / (e - 1) + r + l - r * sp.cos(after) - sp.sqrt(l**2 - (r * sp.sin(after)) ** 2)
    largest = 2 * r / (e - 1) + 2 * r
    shut = (1 + sp.tanh(p["sharp"] * sp.cos(after / 2))) / 2
    burnt = (1 + sp.tanh(p["sharp"] * sp.sin((after - p["delay"]) / 2))) / 2
    pressure = p["p_0"] * (largest / volume) ** p["kappa"] * (1 + (p["rise"] - 1) * burnt)
    return shut * (pressure - p["p_0"]) * sp.pi * p["bore"] ** 2 / 4


def acceleration(mod: Any, cylinders: list[tuple[float, float]]) -> Any:
    """theta'' = (Q - V' - I' omega^2 / 2) / I of an engine with cylinders (angle of the axis, angle when it fires)."""
    p = dict(zip(mod.p_names, mod.p, strict=True))
    theta, omega = sp.symbols("theta omega")
    r, l, g, mass = p["r"], p["l"], p["g"], 0.4
    pin = sp.Matrix([r * sp.cos(theta), r * sp.sin(theta)])
    inertia, potential = p["J"] + 6 * (r / 10) ** 2, -6 * g * pin[1] / 10
    force = -p["c"] * omega**2
    for axis, fires in cylinders:
        way = r * sp.cos(theta - axis) + sp.sqrt(l**2 - (r * sp.sin(theta - axis)) ** 2)
        piston = way * sp.Matrix([sp.cos(axis), sp.sin(axis)])
        rod = pin + 0.3 * (piston - pin)
        swing = sp.asin(r / l * sp.sin(theta - axis))
        inertia += mass * (rod.diff(theta).dot(rod.diff(theta)) + way.diff(theta) ** 2)
        inertia += mass * l**2 / 12 * swing.diff(theta) ** 2
        potential += mass * g * (rod[1] + piston[1])
        force -= gas(p, theta - fires) * way.diff(theta)
    found = (force - potential.diff(theta) - inertia.diff(theta) * omega**2 / 2) / inertia
    return sp.lambdify((theta, omega), found, cse=True)


def cycle_work(mod: Any, pistons: int) -> float:
    """What the gas of a cylinder gives in a cycle without friction or load and with sudden burning (J)."""
    sudden = {"sharp": 300.0, "delay": 0.0, "c": 0.0}
    traj = mod.simulate(0.12, parameters=sudden, t_eval=np.linspace(0.0, 0.12, 20001))
    energy = np.sum(mod.bind(p=sudden).energy(traj.x[:, ::4]), axis=0)
    theta = traj["theta"][::4]
    start, end = np.interp([theta[0], theta[0] + 4 * np.pi], theta, energy)
    return float(end - start) / pistons


def otto(mod: Any) -> float:
    """p_0 V (rise - 1) (ratio^(kappa - 1) - 1) / (kappa - 1): the textbook's constant-volume cycle."""
    p = dict(zip(mod.p_names, mod.p, strict=True))
    volume = np.pi / 4 * p["bore"] ** 2 * 2 * p["r"] * p["ratio"] / (p["ratio"] - 1)
    gain = (p["ratio"] ** (p["kappa"] - 1) - 1) / (p["kappa"] - 1)
    return float(p["p_0"] * volume * (p["rise"] - 1) * gain)


ENGINES = {
    "engine": [(np.pi / 2, np.pi / 2)],
    "v_engine": [(np.pi / 4, np.pi / 4), (3 * np.pi / 4, 3 * np.pi / 4 + 2 * np.pi)],
}


@cache
def compiled(name: str) -> Any:
    return eg.load(EXAMPLES / f"{name}.yaml").compile(target="numpy")


@pytest.mark.parametrize("name", ENGINES)
def test_an_engine_runs_as_its_one_angle_does(name: str) -> None:
    mod = compiled(name)
    traj = mod.simulate(0.1, rtol=1e-11, atol=1e-13)
    law = acceleration(mod, ENGINES[name])
    start = [traj["theta"][0], traj["theta_dot"][0]]
    by_hand = scipy.integrate.solve_ivp(
        lambda t, y: [y[1], law(*y)], (0, 0.1), start, "DOP853", rtol=1e-11, atol=1e-12, dense_output=True
    )
    expected = by_hand.sol(traj.t)
    assert traj["theta"] == pytest.approx(expected[0], abs=1e-8)
    assert traj["theta_dot"] == pytest.approx(expected[1], abs=1e-6)
    assert traj["theta"][-1] > 2.0 * np.pi


@pytest.mark.parametrize("name", ENGINES)
def test_sudden_burning_gives_the_work_of_the_otto_cycle(name: str) -> None:
    mod = compiled(name)
    assert cycle_work(mod, len(ENGINES[name])) == pytest.approx(otto(mod), rel=1e-3)
