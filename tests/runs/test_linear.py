"""Linear equations and modes: published eigenvalues, closed forms, differences; constraints add no eigenvalues."""

from functools import partial
from typing import Any

import judges
import models
import numpy as np
import pytest
import scipy.linalg
import scipy.signal
from analysed import compiled
from refusals import refuses

import eomgen as eg


def numbers(pairs: Any) -> np.ndarray:
    return np.sort_complex(np.array([float(re) + 1j * float(im) for re, im in pairs]))


def test_the_iftomm_four_bar() -> None:
    """Equilibrium, M, C, K and eigenvalues of the IFToMM linearization benchmark."""
    given = models.reference("iftomm_fourbar_diagonal_spring")["reference"]
    mod = compiled("spring_four_bar")
    found = mod.linearize(mod.x0(phi=float(given["phi_eq"])))
    assert found.states == ("phi", "phi_dot")
    expected = np.sort_complex([complex(text.replace(" ", "")) for text in given["eig"]])
    np.testing.assert_allclose(np.sort_complex(found.eigenvalues), expected, rtol=1e-12)
    M, C, K = found.second_order()
    np.testing.assert_allclose([M[0, 0], C[0, 0], K[0, 0]], [5 / 3, float(given["C"]), float(given["K"])], rtol=1e-12)
    assert found.is_equilibrium
    assert found.stability == "asymptotically stable"


@pytest.mark.parametrize("name", ["powered_slider_crank", "slider_crank", "double_pendulum", "three_cranks"])
def test_the_minimal_form_is_that_of_the_minimal_right_hand_side(name: str) -> None:
    """At states with any velocity: A and B are the differences of ``minimal.rhs``."""
    mod = compiled(name)
    for x in judges.random_states(mod, 5, 2):
        found = mod.linearize(x, 0.3)
        rows = [mod.x_names.index(name) for name in found.states]
        small = mod.minimal
        small.reset(x[: mod.n_q])

        def rhs(columns: np.ndarray, small: Any = small) -> np.ndarray:
            return np.stack([small.rhs(0.3, column) for column in columns.T], axis=1)

        k = mod.n_dof
        expected = np.stack([judges.first(rhs, x[rows], e, h=1e-4) for e in np.eye(2 * k)], axis=1)
        np.testing.assert_allclose(found.A, expected, rtol=0, atol=1e-7 * np.abs(expected).max())
        np.testing.assert_allclose(found.drift, small.rhs(0.3, x[rows]), rtol=0, atol=1e-9 * np.abs(expected).max())


def test_outputs_and_inputs() -> None:
    """C and D are differences of ``outputs`` along the constraints, accelerations among the outputs included."""
    mod = compiled("rssr")
    x = mod.x0()
    found = mod.linearize(x, 0.2)
    assert (found.inputs, found.outputs) == (("tau",), ("height", "push"))
    h = 1e-5
    for column in range(len(found.states)):
        step = found.tangent.T[:, column]
        sides = [mod.outputs(0.2, mod.project(x + sign * h * step, t=0.2)) for sign in (1, -1)]
        expected = (sides[0] - sides[1]) / (2 * h)
        np.testing.assert_allclose(found.C[:, column], expected, rtol=0, atol=1e-6 * np.abs(found.C).max())
    push = [mod.outputs(0.2, x, u=np.array([value])) for value in (1.2, -0.8)]
    np.testing.assert_allclose(found.D[:, 0], (push[0] - push[1]) / 2, rtol=0, atol=1e-10)
    assert abs(found.D[1, 0]) > 1e-3


def test_the_full_form() -> None:
    """All of x as states: A, B and the outputs' derivatives in every direction, transverse ones too."""
    for name in ("rssr", "slider_crank"):
        mod = compiled(name)
        x = mod.x0()
        full = mod.linearize(x, form="full")
        np.testing.assert_allclose(full.A, mod.jacobian(0.0, x), rtol=0, atol=1e-12 * np.abs(full.A).max())
        np.testing.assert_array_equal(full.B, mod.input_jacobian(0.0, full.x))
        expected = np.stack([judges.first(partial(mod.outputs, 0.0), x, e, h=1e-4) for e in np.eye(mod.n_x)], 1)
        np.testing.assert_allclose(full.C, expected, rtol=0, atol=1e-7 * np.abs(expected).max())
        assert full.states == mod.x_names
        refuses("EG-UNSUPPORTED full", full.second_order)


def test_a_rolling_disc_is_stable_above_the_critical_spin() -> None:
    """Upright disc, nonholonomic: critical spin sqrt(g/(3 r)), and lambda^2 = 12/5 (g/(3 r) - w^2) at the spin w.

    From the linear equations of a thin uniform disc, 5 lean'' + 12 (w^2 - g/(3 r)) lean = 0 (Neimark and Fufaev).
    """
    critical = models.reference("rolling_disc")["critical_upright_spin_rad_s"]
    mod = compiled("rolling_disc")

    def at(spin: float) -> Any:
        zero = dict.fromkeys(("x", "y", "yaw", "lean", "spin", "yaw_dot", "lean_dot"), 0.0)
        return mod.linearize(mod.x0(zero, spin_dot=spin))

    below, above = at(critical * (1 - 1e-6)), at(critical * (1 + 1e-6))
    assert below.is_steady
    assert not below.is_equilibrium
    assert (below.stability, above.stability) == ("unstable", "marginal")
    # 3 velocities, 5 displacements (the height alone is held); lean moves, the other seven eigenvalues vanish
    assert below.states == ("yaw", "lean", "spin", "x", "y", "yaw_dot", "lean_dot", "spin_dot")
    g, r = 9.81, 0.5
    for spin in (0.0, 1.0, 4.0):
        expected = np.sqrt(complex(12 / 5 * (g / (3 * r) - spin**2)))  # lambda at the lean of a thin uniform disc
        values = at(spin).eigenvalues
        assert np.abs(values).max() == pytest.approx(abs(expected), rel=1e-9)
        assert np.sort(np.abs(values))[-3] < 1e-6


def test_a_single_track_car_driving_on() -> None:
    """A steady motion: side-slip and yaw as published, five zeros of position, heading and speed."""
    given = models.reference("vehicle_linear_models")["single_track"]
    mod = compiled("single_track")
    found = mod.linearize()
    assert found.is_steady
    assert not found.is_equilibrium
    values = found.eigenvalues
    moving = np.sort_complex(values[np.abs(values) > 1e-3])
    np.testing.assert_allclose(moving, numbers(given["eig"]), rtol=1e-9)
    assert np.abs(values).size - moving.size == 4


@pytest.mark.parametrize("factor", [0.95, 1.05])
def test_a_sleeping_top_in_either_rotation(factor: float) -> None:
    """I th'' - i C n th' - m g l th = 0 for th = thx + i thy (E. J. Routh); turning axes shift it by -i n."""
    I, C, mgl = 0.02 + 0.04, 0.01, 9.81 * 0.2
    n = factor * np.sqrt(4 * mgl * I) / C
    fixed = np.roots([I, -1j * C * n, -mgl])
    angles = compiled("top_angles").linearize(compiled("top_angles").x0(S_1=0, S_2=0, S_3=0, S_3_dot=n))
    mod = compiled("top_parameters")
    turning = mod.linearize(mod.x0(S_e0=1, S_wz=n))
    for found, expected in ((angles, fixed), (turning, fixed - 1j * n)):
        both = np.sort_complex([0, 0, *expected, *expected.conj()])
        values = np.sort_complex(found.eigenvalues)
        np.testing.assert_allclose(np.sort(values.imag), np.sort(both.imag), rtol=0, atol=1e-6)
        np.testing.assert_allclose(np.sort(values.real), np.sort(both.real), rtol=0, atol=1e-6)
        assert found.stability == ("unstable" if factor < 1 else "marginal")
    assert turning.states == ("S_rx", "S_ry", "S_rz", "S_wx", "S_wy", "S_wz")


def test_state_space_names_and_display() -> None:
    mod = compiled("quarter_car")
    found = mod.linearize(p={"g": 0.0})
    system = found.state_space()
    assert isinstance(system, scipy.signal.StateSpace)
    np.testing.assert_array_equal(system.A, found.A)
    given = models.reference("vehicle_linear_models")["quarter_car"]
    np.testing.assert_allclose(np.sort_complex(np.linalg.eigvals(system.A)), numbers(given["eig"]), rtol=1e-12)
    assert "asymptotically stable" in repr(found)
    # static gain: the body follows the road
    gain = found.D - found.C @ np.linalg.solve(found.A, found.B)
    np.testing.assert_allclose(gain[0, 0], 1.0, rtol=1e-12)
    vectors = found.eigenvectors
    np.testing.assert_allclose(found.A @ vectors, vectors * found.eigenvalues, rtol=0, atol=1e-9)
    refuses("EG-UNSUPPORTED inputs", lambda: compiled("spring_four_bar").linearize().state_space())


def test_choices_and_mistakes() -> None:
    mod = compiled("slider_crank")
    by_slider = mod.linearize(independent=["s"])
    by_crank = mod.linearize()
    assert by_slider.states == ("s", "s_dot")
    assert by_crank.states == ("theta", "theta_dot")
    for wrong, message in (
        ({"independent": ["s", "theta"]}, "EG-PARTITION 1"),
        ({"independent": ["thetta"]}, "EG-NAME-UNKNOWN theta"),
        ({"form": "big"}, "EG-CHOICE full"),
        ({"x": [1.0]}, "EG-SHAPE shape"),
    ):
        refuses(message, mod.linearize, **wrong)


def changes(mod: object, x: np.ndarray) -> None:
    """At an equilibrium J T = T A; and x + h T s stays on the constraints to second order."""
    lin = mod.linearize(x)
    T = lin.to_x
    assert T.shape == (mod.n_x, len(lin.states))
    J = mod.jacobian(0.0, lin.x)
    np.testing.assert_allclose(J @ T, T @ lin.A, rtol=0, atol=1e-8 * max(1.0, np.abs(lin.A).max()))
    s = np.random.default_rng(2).normal(size=T.shape[1])
    away = []
    for h in (1e-3, 5e-4):
        moved = lin.x + h * T @ s
        away.append(np.abs(mod.project(moved) - moved).max())
    assert away[0] < 1e-4
    assert away[1] < 0.3 * away[0] + 1e-13  # a quarter: second order


def test_changes_of_states_of_a_loop() -> None:
    mod = compiled("four_bar")
    found = mod.equilibrium()
    changes(mod, found.x)


def test_modes_of_a_double_pendulum() -> None:
    """Equal point masses on equal rods: omega^2 = g/l (2 -+ sqrt 2), amplitudes 1 : +-sqrt 2 (Landau and Lifshitz)."""
    mod = compiled("double_pendulum")
    p = dict(zip(mod.p_names, mod.p, strict=True))
    same = dict.fromkeys(("m1", "m2"), 0.7) | dict.fromkeys(("l1", "l2"), 0.6)
    assert same.keys() <= p.keys()
    found = mod.modes(p=same)
    expected = np.sqrt(p["g"] / 0.6 * (2 + np.array([-1, 1]) * np.sqrt(2)))
    np.testing.assert_allclose(found.frequencies, expected, rtol=1e-10)
    np.testing.assert_allclose(found.hertz, expected / (2 * np.pi), rtol=1e-10)
    first, second = found.shapes.T  # relative angles: the second absolute one is their sum
    np.testing.assert_allclose([first.sum() / first[0], second.sum() / second[0]], [np.sqrt(2), -np.sqrt(2)], rtol=1e-8)
    M, K = found.linear.mass, found.linear.stiffness
    np.testing.assert_allclose(found.shapes.T @ M @ found.shapes, np.eye(2), atol=1e-12)
    np.testing.assert_allclose(found.squares, scipy.linalg.eigh(K, M, eigvals_only=True), rtol=1e-10)
    assert (found.rigid, found.diverging) == (0, 0)
    assert all(abs(mode.ratio) < 1e-12 for mode in found.damped)


def test_modes_of_a_quarter_car() -> None:
    """Undamped frequencies and damped eigenvalues of the published quarter-car, about its own equilibrium."""
    given = models.reference("vehicle_linear_models")["quarter_car"]
    found = compiled("quarter_car").modes()
    np.testing.assert_allclose(found.frequencies, [float(x) for x in given["undamped_rad_s"]], rtol=1e-12)
    np.testing.assert_allclose(found.hertz, [float(x) for x in given["undamped_Hz"]], rtol=1e-12)
    pairs = [complex(float(re), float(im)) for re, im in given["eig"] if float(im) > 0]
    assert len(found.damped) == 2
    for mode, value in zip(found.damped, pairs, strict=True):
        assert mode.eigenvalue == pytest.approx(value, rel=1e-12)
        assert mode.frequency == pytest.approx(abs(value), rel=1e-12)
        assert mode.damped == pytest.approx(value.imag, rel=1e-12)
        assert mode.ratio == pytest.approx(-value.real / abs(value), rel=1e-12)
    sag = 9.81 * 550 / 180000
    assert found.linear.x[0] == pytest.approx(-sag, rel=1e-12)


def test_rigid_body_modes_and_modes_that_diverge() -> None:
    """Two masses on a rail joined by a spring: one rigid-body mode, omega^2 = k (1/m1 + 1/m2)."""
    m = eg.Model("train")
    first, second = m.body("first", mass=2.0), m.body("second", mass=3.0)
    m.prismatic("a", m.ground, first, axis="x")
    m.prismatic("b", m.ground, second, axis="x")
    m.spring("k", first, second.at(0, 0.1, 0), stiffness=50.0, length=0.5)
    m.initial(a=0.0, b=0.5)
    found = m.compile(target="numpy").modes()
    assert (found.rigid, found.diverging) == (1, 0)
    length = 0.5
    b = found.linear.x[1] - found.linear.x[0]
    assert np.hypot(b, 0.1) == pytest.approx(length, rel=1e-10)
    omega = np.sqrt(50.0 * (b / length) ** 2 * (1 / 2 + 1 / 3))  # the spring is not along the rail
    np.testing.assert_allclose(found.frequencies, [0.0, omega], rtol=1e-9, atol=0)
    assert "rigid body" in repr(found)
    mod = compiled("cart_pendulum")
    upright = mod.modes(mod.x0(phi=0.0))
    assert (upright.rigid, upright.diverging) == (1, 1)
    p = dict(zip(mod.p_names, mod.p, strict=True))
    total, h = p["m_cart"] + p["m_pole"], p["h"]
    rate = np.sqrt(p["g"] / (h * (4 / 3 - p["m_pole"] / total)))  # Barto, Sutton and Anderson (1983)
    assert np.sqrt(-upright.squares[0]) == pytest.approx(rate, rel=1e-10)


def test_no_equilibrium_no_modes() -> None:
    mod = compiled("slider_crank")
    refuses("EG-UNSUPPORTED equilibrium", lambda: mod.modes(mod.x0()))
    assert mod.modes().frequencies.shape == (1,)


def test_a_position_by_names() -> None:
    m = eg.Model("pendulum", gravity=(0, -9.81, 0))
    m.revolute("A", m.ground, m.body("a", mass=1, com=(0, -0.5, 0)))
    m.initial(A=0.3, A_dot=1.0)
    mod = m.compile(target="numpy")
    np.testing.assert_allclose(mod.modes({"A": 0.0}).frequencies, np.sqrt(9.81 / 0.5), rtol=1e-12)
    turned = mod.linearize({"A": 0.1, "A_dot": 0.0})
    np.testing.assert_allclose(turned.A, [[0.0, 1.0], [-9.81 / 0.5 * np.cos(0.1), 0.0]], rtol=1e-12)
    refuses("EG-NAME-UNKNOWN B", mod.modes, {"B": 0.1})
    double = compiled("double_pendulum")
    by_output = double.modes({"theta1": 0, "theta2": 0}).frequencies  # theta2 = theta1 + bend, an output
    np.testing.assert_allclose(by_output, double.modes({"theta1": 0, "bend": 0}).frequencies, rtol=1e-9)
