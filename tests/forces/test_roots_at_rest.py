"""Drag as v |v| and its kin from rest: derivatives that exist where a root vanishes, and those that do not."""

from __future__ import annotations

import numpy as np
import pytest

import eomgen as eg

SQUARES = "(vx(b)**2 + vy(b)**2 + vz(b)**2)"
SPEED = f"sqrt({SQUARES})"
G = 9.81


def falling(*force: str, c: float = 1.0) -> eg.Model:
    m = eg.Model("drag", gravity=(0, 0, "-g"))
    m.parameter("g", G)
    m.parameter("c", c)
    b = m.body("b", mass=1)
    m.translational("t", m.ground, b)
    m.force("d", b, list(force) if len(force) == 3 else [f"-c*v{k}(b)*{force[0]}" for k in "xyz"])
    return m


DIFFERENTIABLE = {
    "sqrt": SPEED,
    "hypot": "hypot(hypot(vx(b), vy(b)), vz(b))",
    "three halves": f"{SQUARES}**0.25",
    "a power of squares": f"{SQUARES}**0.3",
    "a root of a root": f"sqrt({SPEED})",
    "abs": "abs(vz(b))**0.7",
    "a sum": f"(0.2*{SPEED} + 0.3*{SPEED}**1.5)",
    "saturated": f"tanh({SPEED})/(1 + {SPEED})",
    "squared": "hypot(vx(b), vz(b))**2",
}


@pytest.mark.parametrize("law", DIFFERENTIABLE)
def test_the_derivative_of_drag_at_rest_is_zero(law: str) -> None:
    mod = falling(DIFFERENTIABLE[law]).compile(target="numpy")
    J = mod.jacobian(0.0, np.zeros(6))
    assert (J[3:] == 0.0).all()
    assert (np.asarray(mod.linearize(np.zeros(6)).A) == J).all()
    x = np.array([0.0, 0.0, 0.0, 0.3, -0.4, 0.8])
    steps = [(mod.rhs(0.0, x + d) - mod.rhs(0.0, x - d)) / 2e-6 for d in 1e-6 * np.eye(6)]
    np.testing.assert_allclose(mod.jacobian(0.0, x), np.transpose(steps), atol=1e-8)


@pytest.mark.parametrize(
    "force",
    [
        ("0", "0", f"-{SPEED}"),
        ("0", "0", "-hypot(vx(b), vz(b))"),
        ("0", "0", "-sign(vz(b))*sqrt(abs(vz(b)))"),
        ("0", "0", "-sqrt(vz(b) + x(b))*sqrt(2*vz(b) + 2*x(b))*(1 + x(b))"),
        ("0", "0", f"-(1 + vx(b))*{SPEED}"),
        ("0", "0", f"-{SQUARES}**0.3"),
        ("0", "0", "cos(sqrt(vz(b)))"),
    ],
)
def test_what_has_no_derivative_is_refused_by_the_call_that_takes_it(force: tuple[str, str, str]) -> None:
    mod = falling(*force).compile(target="numpy")
    with pytest.raises(eg.NonFiniteError, match="jacobian at t = 0.*a root of 0, which has no derivative"):
        mod.jacobian(0.0, np.zeros(6))
    if "vz(b) +" not in force[2] and "cos" not in force[2]:
        for method in ("Radau", "BDF"):
            with pytest.raises(eg.SimulationError, match="Last failure: jacobian at t = 0"):
                mod.simulate(1.0, method=method)
        assert np.isfinite(mod.simulate(0.5).x).all()


@pytest.mark.parametrize("speed", ["hypot(vx(b), vy(b))", "hypot(0, vx(b))", "hypot(hypot(vx(b), vy(b)), vz(b))"])
@pytest.mark.parametrize("target", ["cython", "numpy"])
def test_a_hypotenuse_of_one_side_has_the_derivative_of_its_length(speed: str, target: str) -> None:
    m = eg.Model("slide")
    b = m.body("b", mass=1)
    m.prismatic("j", m.ground, b, axis=(1, 0, 0), coordinate="x")
    m.force("F", b, (f"1 - {speed}*vx(b)", 0, 0))
    mod = m.compile(target=target)
    assert (mod.jacobian(0.0, np.zeros(2)) == [[0.0, 1.0], [0.0, 0.0]]).all()
    assert mod.simulate(5.0, method="Radau")["x_dot"][-1] == pytest.approx(np.tanh(5.0), abs=1e-5)


@pytest.mark.parametrize("law", ["sqrt", "hypot", "a power of squares"])
def test_compiled_runs_from_rest(law: str) -> None:
    """v' = -g + v^2 has v = -sqrt(g) tanh(sqrt(g) t); other powers against DOP853."""
    mod = falling(DIFFERENTIABLE[law]).compile()
    assert (mod.jacobian(0.0, np.zeros(6))[3:] == 0.0).all()
    exact = -np.sqrt(G) * np.tanh(5 * np.sqrt(G))
    expected = mod.simulate(5.0, rtol=1e-12, atol=1e-14)["t_z_dot"][-1] if law == "a power of squares" else exact
    for method in ("Radau", "BDF", "Taylor"):
        assert mod.simulate(5.0, method=method)["t_z_dot"][-1] == pytest.approx(expected, abs=1e-7)
    starts = {"t_x_dot": [0.0, 0.0, 1.0, 0.0], "t_z_dot": [0.0, -1.0, 0.0, 0.5]}
    runs = [mod.simulate_many(2.0, starts, method=method) for method in ("Taylor", "DOP853")]
    np.testing.assert_allclose(runs[0].x, runs[1].x, atol=1e-6)


def test_what_stays_at_rest_stays_exact_in_series() -> None:
    """Beside a pendulum a block at rest with drag: its root is 0 all the time, and takes nothing from the order."""
    m = eg.Model("pair", gravity=(0, "-g", 0))
    m.parameter("g", G)
    bob, block = m.body("bob", mass=1, com=(0.5, 0, 0)), m.body("block", mass=1)
    m.revolute("hinge", m.ground, bob, coordinate="th")
    m.translational("table", m.ground, block)
    m.force("held", block, (0, "g", 0))
    m.force("drag", block, [f"-v{x}(block)*hypot(vx(block), vy(block))" for x in "xyz"])
    mod = m.compile()
    run = mod.simulate(3.0, initial={"th": 0.3}, method="Taylor", rtol=1e-12, atol=1e-14)
    expected = mod.simulate(3.0, initial={"th": 0.3}, rtol=1e-12, atol=1e-14)
    assert run["th"][-1] == pytest.approx(expected["th"][-1], abs=1e-9)
    assert len(run.t) < len(expected.t)


def test_second_derivatives_and_sensitivities_at_rest() -> None:
    cubic = falling(SQUARES).compile(target="numpy")
    power = falling("hypot(vx(b), vz(b))**1.5").compile(target="numpy")
    for mod in (cubic, power):
        assert (mod.rhs_hessian_product(0.0, np.zeros(6), np.ones(6), np.ones(6)) == 0.0).all()
    mod = falling(SPEED).compile(target="numpy")
    with pytest.raises(eg.NonFiniteError):  # of v |v| jumps
        mod.rhs_hessian_product(0.0, np.zeros(6), np.ones(6), np.ones(6))
    found = mod.sensitivities(["g", "c"], 2.0, method="DOP853")
    r, t = np.sqrt(G), 2.0  # v = -sqrt(g / c) tanh(sqrt(g c) t)
    slope = 1 - np.tanh(r * t) ** 2
    assert found["t_z_dot", "g"][-1] == pytest.approx(-np.tanh(r * t) / (2 * r) - t * slope / 2, abs=1e-7)
    assert found["t_z_dot", "c"][-1] == pytest.approx(r * np.tanh(r * t) / 2 - G * t * slope / 2, abs=1e-7)


def test_every_method_and_an_exponent_that_is_a_parameter() -> None:
    m = falling(f"{SQUARES}**(e/2)")
    m.parameter("e", 1.0)
    for method in ("embedding", "recursive", "lagrange", "hamilton", "augmented"):
        mod = m.compile(method=method, target="numpy")
        for e in (0.4, 1.0, 2.0):
            assert (mod.jacobian(0.0, np.zeros(6), p={"e": e})[3:] == 0.0).all()
    found = m.compile(target="numpy").sensitivities(["e"], 1.0)
    assert np.isfinite(found["t_z_dot", "e"]).all()


@pytest.mark.parametrize("library", ["casadi", "jax"])
def test_functions_of_other_libraries_have_the_derivative_at_rest(library: str) -> None:
    pytest.importorskip(library)
    for law in ("sqrt", "hypot", "a power of squares"):
        m = falling(DIFFERENTIABLE[law])
        eqs, mod = m.derive(), m.compile(target="numpy")
        for x in (np.zeros(6), np.array([0.1, 0.2, 0.3, 0.4, -0.5, 0.6])):
            if library == "casadi":
                import casadi as ca

                f, z = eqs.to_casadi(), ca.MX.sym("x", 6)
                value = f.rhs(0, z, f.u_values, f.p_values)
                found = [np.array(ca.Function("J", [z], [ca.jacobian(value, z)])(x))]
            else:
                import jax

                f = eqs.to_jax()
                found = [np.array(way(lambda z, f=f: f.rhs(0.0, z))(x)) for way in (jax.jacfwd, jax.jacrev)]
            for J in found:
                np.testing.assert_allclose(J, mod.jacobian(0.0, x), atol=1e-13)
