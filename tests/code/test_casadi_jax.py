"""CasADi and JAX: what the libraries make of the functions; starts, reduced forms, packages, refusals.

That the functions are the module's is in test_targets.
"""

import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

import casadi as ca
import jax
import models
import numpy as np
import pytest
from command import run
from refusals import refuses

import eomgen as eg


@cache
def example(name: str) -> Any:
    return models.build(name).derive()


def state_of(module: Any, seed: int = 3) -> np.ndarray:
    """A state near the start, a little off the constraints too."""
    x = module.x0()
    random = np.random.default_rng(seed)
    return module.project(x + 0.01 * random.normal(size=x.size)) + 1e-7 * random.normal(size=x.size)


@pytest.mark.parametrize(
    "name", ["slider_crank", "four_bar", pytest.param("stewart_platform", marks=pytest.mark.thorough)]
)
def test_a_state_off_the_loops_comes_to_the_modules_state(name: str) -> None:
    """The steps of the projection are the module's own, so that both come to the same one of all closed states."""
    equations = example(name)
    module, functions = equations.compile(target="numpy"), equations.to_casadi()
    random = np.random.default_rng(5)
    for size in (0.003, 0.03):
        x = module.x0() + size * random.normal(size=module.n_x)
        expected = module.project(x), module.rhs(0.0, x)
        for name_of, wanted in zip(("project", "rhs"), expected, strict=True):
            found = np.asarray(getattr(functions, name_of)(0.0, x, module.u, module.p)).ravel()
            np.testing.assert_allclose(found, wanted, rtol=0.0, atol=1e-11 * max(1.0, np.abs(wanted).max()))


@pytest.mark.parametrize("name", ["double_pendulum", pytest.param("slider_crank", marks=pytest.mark.thorough)])
def test_jax_differentiates_closed_loops_too(name: str) -> None:
    equations = example(name)
    module, functions = equations.compile(target="numpy"), equations.to_jax()
    x = module.project(state_of(module))
    found = jax.jit(jax.jacfwd(functions.rhs, argnums=1))(0.0, x, module.u, module.p)
    expected = module.jacobian(0.0, x)
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-9 * np.abs(expected).max())
    back = jax.jit(jax.grad(lambda x: functions.rhs(0.0, x, module.u, module.p)[-1]))(x)
    np.testing.assert_allclose(back, expected[-1], rtol=0.0, atol=1e-9 * np.abs(expected).max())


def test_ten_thousand_pendulums_at_once() -> None:
    equations = example("double_pendulum")
    module, functions = equations.compile(target="numpy"), equations.to_jax()
    states = np.random.default_rng(1).normal(size=(10_000, module.n_x))
    found = jax.jit(jax.vmap(functions.rhs, in_axes=(None, 0)))(0.0, states)
    expected = np.array([module.rhs(0.0, x) for x in states[:50]])
    np.testing.assert_allclose(found[:50], expected, rtol=1e-12, atol=1e-12 * np.abs(expected).max())
    assert np.isfinite(found).all()


@pytest.mark.parametrize(
    "name", ["slider_crank", "four_bar", pytest.param("stewart_platform", marks=pytest.mark.thorough)]
)
def test_minimal_form_of_loops(name: str) -> None:
    """z of the degrees of freedom gives the whole state and its rates."""
    equations = example(name)
    module, functions = equations.compile(target="numpy"), equations.to_casadi()
    x = module.project(state_of(module))
    q, v = x[: module.n_q], x[module.n_q :]
    places = list(module.metadata["independent"])
    z = np.concatenate([q[places], v[places]])
    guess = q + 0.01 * np.random.default_rng(2).normal(size=q.size)
    found = np.asarray(functions.full_state(0.0, z, guess, module.u, module.p)).ravel()
    np.testing.assert_allclose(found, x, atol=1e-10 * max(1.0, np.abs(x).max()))
    rates = np.asarray(functions.minimal_rhs(0.0, z, guess, module.u, module.p)).ravel()
    expected = np.concatenate([v[places], module.rhs(0.0, x)[module.n_q :][places]])
    np.testing.assert_allclose(rates, expected, atol=1e-9 * max(1.0, np.abs(expected).max()))


@pytest.mark.parametrize("library", ["casadi", "jax"])
@pytest.mark.parametrize("blades", [1, 2])
def test_rows_of_velocities_alone(blades: int, library: str) -> None:
    """No row holds a position; the states of a sleigh and of one that pulls another."""
    m = eg.Model("sleigh")
    body = m.body("b", mass=2.0, com=(0.25, 0, 0), inertia={"zz": 0.3})
    m.planar("J", m.ground, body)
    m.knife_edge("k", body)
    if blades == 2:
        pulled = m.body("c", mass=1.0, inertia={"zz": 0.1})
        m.revolute("R", body.at(0.5, 0, 0), pulled)
        m.knife_edge("l", pulled)
    m.output("a", "ax(b)")
    module, functions = m.compile(target="numpy"), getattr(m.derive(), f"to_{library}")()
    x = module.project(0.1 * np.arange(module.n_x)) + 0.01
    for name in ("rhs", "project", "outputs"):
        with jax.disable_jit():
            found = np.asarray(getattr(functions, name)(0.0, x, module.u, module.p)).ravel()
        expected = module.project(x) if name == "project" else getattr(module, name)(0.0, x)
        np.testing.assert_allclose(found, expected, atol=1e-12)


@pytest.mark.parametrize("library", ["casadi", "jax"])
@pytest.mark.parametrize("n", [29, 30])
def test_given_rates_of_large_equations(n: int, library: str) -> None:
    """q' is what was given, not the velocities, also where the mass matrix is solved by the library."""
    q, v = [f"q{i}" for i in range(n)], [f"u{i}" for i in range(30)]
    mass = [[3.0 if i == j else "0.3*cos(q0)" if abs(i - j) == 1 else 0 for j in range(30)] for i in range(30)]
    rates = {a: f"(1.5 + sin({a}))*u{i}" for i, a in enumerate(q)}
    model = eg.Model.from_equations(
        "large", q, velocities=v, rates=rates, mass_matrix=mass, forcing=[f"-u{i}" for i in range(30)]
    )
    functions = getattr(model.derive(), f"to_{library}")()
    x = np.random.default_rng(1).uniform(-1.0, 1.0, n + 30)
    with jax.disable_jit():
        found = np.asarray(functions.rhs(0.0, x, np.zeros(0), np.zeros(0))).ravel()
    M = 3.0 * np.eye(30) + 0.3 * np.cos(x[0]) * (np.eye(30, k=1) + np.eye(30, k=-1))
    expected = np.r_[(1.5 + np.sin(x[:n])) * x[n : 2 * n], np.linalg.solve(M, -x[n:])]
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_a_state_far_from_the_loops_is_no_number() -> None:
    equations = example("slider_crank")
    functions = equations.to_casadi()
    x = np.array(functions.x0)
    x[0] += 1.5
    x[2] += 5.0
    assert np.isnan(np.asarray(functions.rhs(0.0, x, functions.u_values, functions.p_values))).all()


def test_casadi_integrates_a_closed_loop() -> None:
    equations = example("slider_crank")
    functions = equations.to_casadi()
    x = ca.SX.sym("x", 6)
    slopes = functions.rhs(0.0, x, functions.u_values, functions.p_values)
    options = {"abstol": 1e-12, "reltol": 1e-10}
    step = ca.integrator("step", "cvodes", {"x": x, "ode": slopes}, 0.0, 0.1, options)
    module = equations.compile(target="numpy")
    end = np.asarray(step(x0=module.x0())["xf"]).ravel()
    expected = module.simulate(0.1, rtol=1e-11, atol=1e-12).x[:, -1]
    np.testing.assert_allclose(end, expected, atol=1e-6)


PROGRAM = """
import sys
sys.modules["eomgen"] = sys.modules["sympy"] = None
import {name} as model
x_dot = model.rhs(0.0, model.x0, model.u_values, model.p_values)
print(float(x_dot[3]))
"""


@pytest.mark.parametrize("target", ["casadi", "jax"])
def test_a_package_needs_the_library_alone(target: str, tmp_path: Path) -> None:
    words = ("generate", models.EXAMPLES / "double_pendulum.yaml", "--out", tmp_path, "--target", target)
    assert run(*words).code == 0
    folder = tmp_path / "double_pendulum"
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM.format(name=folder.name)],
        cwd=tmp_path,
        check=True,
        capture_output=True,
        text=True,
    )
    functions = example("double_pendulum").to_casadi()
    expected = functions.rhs(0.0, functions.x0, functions.u_values, functions.p_values)[3]
    assert float(done.stdout) == pytest.approx(float(expected), rel=1e-12)
    assert "model.rhs" in (folder / "README.md").read_text()


def test_what_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "casadi", None)
    m = models.build("pendulum")
    m.parameter("unused", 1.0)
    refuses("EG-PACKAGE-MISSING casadi>=3.6.5", lambda: m.derive().to_casadi())


def crane() -> eg.Model:
    """A tree whose rates are declared in part, with a first-order state."""
    m = eg.Model("crane", gravity=(0, -9.81, 0))
    trolley = m.body("trolley", mass=10.0)
    m.prismatic("rail", m.ground, trolley, axis="x", coordinate="s")
    m.revolute("hook", trolley, m.body("load", mass=2.0, com=(0, -1, 0), inertia={"zz": 0.1}), coordinate="swing")
    m.state("pressure", "-pressure", initial=7e4)
    m.initial(s=0.2, s_dot=0.1)
    return m


@pytest.mark.parametrize("library", ["casadi", "jax"])
def test_x0_is_the_start_of_the_model(library: str, tmp_path: Path) -> None:
    equations = crane().derive()
    start = equations.compile(target="numpy").x0()
    functions = getattr(equations, f"to_{library}")()
    np.testing.assert_allclose(np.asarray(functions.x0, dtype=float).ravel(), start, rtol=1e-12, atol=1e-12)
    crane().save(tmp_path / "model.yaml")
    assert run("generate", tmp_path / "model.yaml", "--out", tmp_path, "--target", library).code == 0
    package = tmp_path / "crane"
    line = next(text for text in (package / "__init__.py").read_text().splitlines() if text.startswith("x0 ="))
    assert repr(float(start[0])) in line
