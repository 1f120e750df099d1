"""Targets casadi and jax: the values and derivatives of the module, and what the libraries make of them."""

from __future__ import annotations

import re
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
from jaxprs import evaluate
from sweeps import OF_ALL_KINDS, part_of

import eomgen as eg
from eomgen.errors import MissingDependencyError, UsageError
from eomgen.generation import generate

EXAMPLES = sorted(path.stem for path in models.EXAMPLES.glob("*.yaml"))
#: What JAX's own compiler evaluates: tables, Euler parameters, rolling, mass matrices by columns, first-order states.
BY_XLA = ["cam_follower", "hydraulic_boom", "quadrotor_load", "rolling_disc", "stewart_platform"]
#: Functions with a module's function of the same name; rates of degrees of freedom and residuals have their own tests.
COMPARED = {
    "rhs", "mass_matrix", "bias", "inverse_dynamics", "energy", "constraints", "constraint_jacobian",
    "velocity_constraints", "project", "poses", "outputs", "events",
}  # fmt: skip
TIMED = ("rhs", "bias", "outputs", "events")
ROWS = ("constraints", "constraint_jacobian", "velocity_constraints")  #: all of them, redundant ones too


@cache
def example(name: str) -> Any:
    return eg.load(models.EXAMPLES / f"{name}.yaml").derive()


@cache
def in_c(name: str) -> Any:
    """The same by the target that is C, compiled once for both libraries."""
    return example(name).compile()


def state_of(module: Any, seed: int = 3) -> np.ndarray:
    """A state near the start, a little off the constraints too."""
    x = module.x0()
    random = np.random.default_rng(seed)
    return module.project(x + 0.01 * random.normal(size=x.size)) + 1e-7 * random.normal(size=x.size)


def offered(functions: Any) -> list[str]:
    return sorted(COMPARED & functions.EQUATIONS.keys())


def compare(functions: Any, module: Any, found: dict[str, Any], x: np.ndarray, a: np.ndarray) -> None:
    """Results by name with those of the module at state x, accelerations a."""
    q, v = x[: module.n_q], x[module.n_q :]
    for name, result in found.items():
        arguments, shape, _ = functions.EQUATIONS[name]
        call = getattr(module.kernels, name, None)  # v is [v; s] with first-order states
        if name == "events":
            call = module.kernels.timed(name)
        call = call or getattr(module, name)
        call = call.every if name in ROWS else call
        given = [{"x": x, "q": q, "v": v, "a": a}[label] for label in arguments]
        given = [x] if name == "events" else given
        expected = np.ravel(call(0.0, *given) if name in TIMED else call(*given))
        np.testing.assert_allclose(
            np.asarray(result).reshape(shape).ravel(),
            expected,
            rtol=0.0,
            atol=1e-12 * max(1.0, np.abs(expected).max(initial=0.0)),
            err_msg=name,
        )


def values(functions: Any, names: list[str], x: Any, a: Any, u: Any, p: Any) -> list[Any]:
    """What functions of these names give."""
    n_q = functions.N_Q
    given = {"x": x, "q": x[:n_q], "v": x[n_q:], "a": a}
    return [
        getattr(functions, name)(0.0, *(given[label] for label in functions.EQUATIONS[name][0]), u, p) for name in names
    ]


def slopes_of(module: Any, x: np.ndarray) -> list[np.ndarray]:
    """The module's derivatives of rhs by x, u and p."""
    by_u = module.input_jacobian(0.0, x) if module.n_u else np.zeros((module.n_x, 0))
    by_p = module.parameter_jacobian(0.0, x) if module.n_p else np.zeros((module.n_x, 0))
    return [module.jacobian(0.0, x), by_u, by_p]


def near(found: Any, expected: np.ndarray) -> None:
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-9 * max(1.0, np.abs(expected).max(initial=0.0)))


@pytest.mark.parametrize(
    "name", part_of(EXAMPLES, lambda name: name in OF_ALL_KINDS and name not in ("stewart_platform", "wheelset"))
)
def test_casadi_equals_c(name: str) -> None:
    """Every function, and the derivatives of rhs by x, u and p."""
    functions, module = example(name).to_casadi(), in_c(name)
    x, a = state_of(module), np.random.default_rng(4).normal(size=functions.N_V)
    names = offered(functions)
    results = values(functions, names, x, a, module.u, module.p)
    compare(functions, module, dict(zip(names, results, strict=True)), x, a)
    x = module.project(x)
    symbols = [ca.SX.sym(label, n) for label, n in (("x", module.n_x), ("u", module.n_u), ("p", module.n_p))]
    slopes = ca.Function("f", symbols, [ca.jacobian(functions.rhs(0.0, *symbols), s) for s in symbols])
    for found, expected in zip(slopes(x, module.u, module.p), slopes_of(module, x), strict=True):
        near(np.asarray(found), expected)


@pytest.mark.parametrize("name", part_of(EXAMPLES, OF_ALL_KINDS.__contains__))
def test_jax_equals_c(name: str) -> None:
    """Every function, and the derivative of rhs along a random direction of x, u and p at once."""
    functions, module = example(name).to_jax(), in_c(name)
    random = np.random.default_rng(4)
    x, a, u, p = state_of(module), random.normal(size=functions.N_V), np.array(module.u), np.array(module.p)
    names = offered(functions)
    results = evaluate(lambda *given: values(functions, names, *given), x, a, u, p)
    compare(functions, module, dict(zip(names, results, strict=True)), x, a)
    x = module.project(x)
    ways = tuple(random.normal(size=part.size) for part in (x, u, p))
    _, found = evaluate(lambda *at: list(jax.jvp(lambda *at: functions.rhs(0.0, *at), at, ways)), x, u, p)
    near(found, sum(slope @ way for slope, way in zip(slopes_of(module, x), ways, strict=True)))


def test_the_part_of_the_examples_has_every_kind() -> None:
    """What stands in the files: types, shapes, descriptions of rotations, functions in expressions, sections."""

    def kinds(names: Any) -> set[str]:
        text = "".join((models.EXAMPLES / f"{name}.yaml").read_text() for name in names)
        found = re.findall(r"\b(?:type|shape|rotation):\s*(\w+)", text)
        found += re.findall(r"\b([a-z]+[0-9]?)\(", text)
        return {*found, *re.findall(r"^(\w+):", text, re.MULTILINE)}

    assert len(kinds(EXAMPLES)) > 50
    assert kinds(EXAMPLES) - kinds(OF_ALL_KINDS) == set()


@pytest.mark.parametrize("name", part_of(BY_XLA, lambda name: name != "stewart_platform"))
def test_jax_itself_equals_c(name: str) -> None:
    """What XLA makes of the operations that the test above evaluates one by one."""
    functions, module = example(name).to_jax(), in_c(name)
    x, a = state_of(module), np.zeros(functions.N_V)
    compare(functions, module, {"rhs": functions.rhs(0.0, x, module.u, module.p)}, x, a)


@pytest.mark.parametrize("name", ["slider_crank", "four_bar", "stewart_platform"])
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


@pytest.mark.parametrize("name", ["double_pendulum", "slider_crank"])
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


@pytest.mark.parametrize("name", ["slider_crank", "four_bar", "stewart_platform"])
def test_minimal_form_of_loops(name: str) -> None:
    """z of the degrees of freedom gives the whole state and its rates."""
    equations = example(name)
    module, functions = equations.compile(target="numpy"), equations.to_casadi()
    x = module.project(state_of(module))
    q, v = x[: module.n_q], x[module.n_q :]
    places = functions.INDEPENDENT
    z = np.concatenate([q[functions.INDEPENDENT_Q], v[places]])
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
    folder = generate(models.build("double_pendulum"), tmp_path, target=target)
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
    with pytest.raises(MissingDependencyError, match=r"CasADi is not installed; pip install 'casadi>=3\.6\.5'"):
        m.derive().to_casadi()


def test_methods_that_pivot_are_refused() -> None:
    equations = eg.load(models.EXAMPLES / "slider_crank.yaml").derive("augmented")
    with pytest.raises(UsageError, match="target 'casadi': method 'augmented' solves a linear system by pivoting"):
        equations.to_casadi()
