"""Equilibria, linear equations, modes, the minimal form and other calls of models with first-order states."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import eomgen as eg
from eomgen.errors import UnavailableError, UsageError

KP, KI, C, M, TAU = 8.0, 5.0, 3.0, 2.0, 0.05


@cache
def servo(target: str = "numpy") -> Any:
    """A mass under a proportional-integral controller that sees its speed through a low-pass filter."""
    m = eg.Model("servo")
    m.prismatic("slide", m.ground, m.body("sledge", mass=M), axis="x", coordinate="s")
    m.input("r", 0.7)
    m.input("F", 1.5)
    m.state("z", "r - s")
    m.state("w", f"(vx(sledge) - w)/{TAU}")
    motor = m.actuator("motor", "s", value=f"{KP}*(r - s) + {KI}*z - {C}*w + F")
    m.output("push", motor.force)
    m.output("place", "s")
    return m.compile(target=target)


A = np.array([[0, 1, 0, 0], [-KP / M, 0, KI / M, -C / M], [-1, 0, 0, 0], [0, 1 / TAU, 0, -1 / TAU]])
B = np.array([[0, 0], [KP / M, 1 / M], [1, 0], [0, 0]])


def test_an_integrator_finds_its_equilibrium() -> None:
    rest = servo().equilibrium()
    assert rest["s"] == pytest.approx(0.7, abs=1e-12)
    assert rest.states == pytest.approx({"z": -1.5 / KI, "w": 0.0}, abs=1e-12)
    assert np.abs(servo().rhs(0.0, rest.x)).max() < 1e-12
    np.testing.assert_allclose(np.sort_complex(rest.eigenvalues), np.sort_complex(np.linalg.eigvals(A)), rtol=1e-9)
    assert rest.stability == "asymptotically stable"


def test_linear_equations_contain_states() -> None:
    linear = servo().linearize(servo().equilibrium().x)
    assert linear.states == ("s", "s_dot", "z", "w")
    np.testing.assert_allclose(linear.A, A, atol=1e-12)
    np.testing.assert_allclose(linear.B, B, atol=1e-12)
    np.testing.assert_allclose(linear.C, [[-KP, 0, KI, -C], [1, 0, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(linear.D, [[KP, 1], [0, 0]], atol=1e-12)
    full = servo().linearize(form="full")
    np.testing.assert_allclose(full.A, A, atol=1e-12)
    np.testing.assert_allclose(full.C, linear.C, atol=1e-12)


def test_the_transfer_function_is_that_of_a_block_diagram() -> None:
    control = pytest.importorskip("control")
    s = control.tf("s")
    plant = 1 / (M * s**2)
    inner = plant / (1 + plant * C * s / (1 + TAU * s))
    loop = inner * (KP + KI / s)
    expected = loop / (1 + loop)
    found = servo().linearize().ss()[1, 0]
    for w in (0.1, 1.0, 3.0, 20.0):
        assert complex(found(1j * w)) == pytest.approx(complex(expected(1j * w)), rel=1e-9)


def test_undamped_modes_have_states_at_rest() -> None:
    found = servo().modes()
    np.testing.assert_allclose(found.frequencies, [np.sqrt(KP / M)], rtol=1e-12)
    assert found.names == ("s_dot",)
    values = np.array([mode.eigenvalue for mode in found.damped])
    wanted = [x for x in np.linalg.eigvals(A) if x.imag >= 0]
    np.testing.assert_allclose(np.sort_complex(values), np.sort_complex(np.array(wanted)), rtol=1e-9)
    with pytest.raises(UsageError, match="acts on s"):
        servo().linearize().second_order()


def test_large_states_do_not_spoil_an_equilibrium() -> None:
    """Oil at some MPa carries a weight: p = m g / area."""
    m = eg.Model("lift", gravity=(0, 0, -9.81))
    m.prismatic("z", m.ground, m.body("table", mass=800.0), axis="z")
    m.state("p", "2e12*(0 - 0.002*z_dot - 1e-12*(p - 5e6) - 4e-5*(z - 0.3))", initial=1e5)
    m.actuator("oil", "z", value="0.002*p")
    mod = m.compile(target="numpy")
    rest = mod.equilibrium()
    p = 800 * 9.81 / 0.002
    assert rest["p"] == pytest.approx(p, rel=1e-11)
    assert rest["z"] == pytest.approx(0.3 - 1e-12 * (p - 5e6) / 4e-5, rel=1e-9)
    held = mod.equilibrium(hold={"z": 0.25})
    assert held["p"] == pytest.approx(5e6 + 4e-5 * 0.05 / 1e-12, rel=1e-9)
    assert held.supports["z"] == pytest.approx(800 * 9.81 - 0.002 * held["p"], rel=1e-9)


def test_a_guess_names_states_and_hold_does_not() -> None:
    m = eg.Model("two")
    m.prismatic("s", m.ground, m.body("b", mass=1.0))
    m.state("a", "a*(1 - a)*(a - 2)")
    m.actuator("f", "s", value="a - s")
    mod = m.compile(target="numpy")
    for start, end in ((0.1, 0.0), (0.9, 1.0), (1.9, 2.0)):
        assert mod.equilibrium({"a": start, "s": end})["a"] == pytest.approx(end, abs=1e-9)
    with pytest.raises(UsageError, match="hold takes coordinates, not rates or states: a"):
        mod.equilibrium(hold={"a": 0.5})


def test_calls_of_the_mechanism_leave_states_out() -> None:
    mod = servo()
    x = np.array([0.2, 0.3, 0.4, 0.5])
    push = KP * 0.5 + KI * 0.4 - C * 0.5 + 1.5
    np.testing.assert_allclose(mod.mass_matrix(x[:1]), [[M]])
    np.testing.assert_allclose(mod.embedded_mass_matrix(x[:1]), [[M]])
    assert mod.bias(0.0, x) == pytest.approx([-push])
    assert mod.inverse_dynamics(x[:1], x[1:], [0.0]) == pytest.approx([-push])
    assert mod.energy(x) == pytest.approx([M * 0.3**2 / 2, 0.0])
    many = np.repeat(x[:, None], 3, axis=1)
    assert mod.bias(0.0, many).shape == (1, 3)
    assert mod.mass_matrix(many[:1]).shape == (1, 1, 3)
    assert mod.inverse_dynamics(many[:1], many[1:], np.zeros((1, 3))).shape == (1, 3)
    out = np.zeros(1)
    assert mod.bias(0.0, x, out=out) is out
    assert out == pytest.approx([-push])
    with pytest.raises(UsageError, match=r"takes v = \[v; s\]"):
        mod.inverse_dynamics(x[:1], x[1:2], [0.0])


def test_the_minimal_form_keeps_states() -> None:
    mod = servo()
    minimal = mod.minimal
    assert minimal.x_names == ("s", "s_dot", "z", "w")
    x = minimal.x0(s=0.1, z=0.2)
    np.testing.assert_array_equal(minimal.rhs(0.0, x), mod.rhs(0.0, mod.x0(s=0.1, z=0.2)))


@pytest.mark.parametrize(
    "call",
    [
        lambda mod: mod.kinematic_analysis(s=[0.0, 1.0]),
        lambda mod: mod.motion_range("s"),
        lambda mod: mod.workspace(over={"s": (0, 1)}, of=["place"]),
        lambda mod: mod.actuator_forces(0.0, mod.x0()),
        lambda mod: mod.canonical,
        lambda mod: mod.equations.linearize(),
    ],
)
def test_what_knows_no_states_says_so(call: Any) -> None:
    with pytest.raises(UnavailableError, match="first-order states"):
        call(servo())


def test_verification_holds() -> None:
    found = servo("cython").verify(seconds=20)
    assert found.ok, str(found)


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_second_derivatives_contain_states_and_those_of_inverse_dynamics_are_refused(target: str) -> None:
    """x'' = -k a^2 x / m, a' = x^2 - a: the Hessians by hand."""
    m = eg.Model("pumped")
    m.prismatic("x", m.ground, m.body("b", mass=M), axis="x")
    m.state("a", "x**2 - a")
    m.torque("f", "x", "-3*a**2*x")
    module = m.compile(target=target)
    x, a = 0.4, 0.7
    weights, direction = np.array([0.3, 1.1, -0.6]), np.array([0.2, 0.9, -0.5])
    force = np.array([[0, 0, -6 * a], [0, 0, 0], [-6 * a, 0, -6 * x]]) / M
    rate = np.array([[2.0, 0, 0], [0, 0, 0], [0, 0, 0]])
    expected = weights[1] * force @ direction + weights[2] * rate @ direction
    found = module.rhs_hessian_product(0.0, [x, 0.1, a], weights, direction)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14)
    for call, arguments in (("inverse_dynamics_derivatives", ()), ("inverse_dynamics_hessian_product", ([1.0], [1.0]))):
        with pytest.raises(UnavailableError, match=f"{call} is not available for models with first-order states"):
            getattr(module, call)([x], [0.1], [0.0], *arguments)
