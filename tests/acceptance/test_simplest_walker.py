"""Floquet multipliers of the simplest walker by sensitivities through its heel strike (Garcia et al. 1998)."""

from __future__ import annotations

from typing import Any

import models
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import eomgen as eg

PUBLISHED = models.reference("simplest_walker")
GAMMA = PUBLISHED["parameters_SI"]["gamma"]
TIGHT = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-15}
MIDDLE = 1.0  #: runs start in the swing: right after heel strike the event's value is 0, which would count

#: The paper's equations, solved for the accelerations.  At midstance both feet pass the ground: the value falls, which
#: is ignored; at heel strike it rises.
MODEL = """
name: walker
parameters: {gamma: 0.009}
equations:
  coordinates: [theta, phi]
  mass_matrix: [[1, 0], [0, 1]]
  forcing:
    - sin(theta - gamma)
    - sin(theta - gamma) + (theta_dot**2 - cos(theta - gamma))*sin(phi)
events:
  heel_strike:
    expression: phi - 2*theta
    direction: 1
    reset:
      theta: -theta
      phi: -2*theta
      theta_dot: cos(2*theta)*theta_dot
      phi_dot: cos(2*theta)*(1 - cos(2*theta))*theta_dot
"""


@pytest.fixture(scope="module")
def walker(tmp_path_factory: pytest.TempPathFactory) -> Any:
    file = tmp_path_factory.mktemp("walker") / "walker.yaml"
    file.write_text(MODEL, encoding="utf-8")
    return eg.load(file).compile(target="numpy")


# -- the same without eomgen -------------------------------------------------------------------------------------------
def rates(t: float, x: np.ndarray, gamma: float) -> list[float]:
    theta, phi, w, s = x
    return [w, s, np.sin(theta - gamma), np.sin(theta - gamma) + (w * w - np.cos(theta - gamma)) * np.sin(phi)]


def touches(t: float, x: np.ndarray, gamma: float) -> float:
    return float(x[1] - 2 * x[0])


touches.terminal, touches.direction = True, 1  # type: ignore[attr-defined]


def after_strike(z: np.ndarray) -> np.ndarray:
    """The state right after heel strike, from theta and theta_dot then."""
    theta, w = z
    return np.array([theta, 2 * theta, w, w * (1 - np.cos(2 * theta))])


def middle(z: np.ndarray, gamma: float = GAMMA) -> np.ndarray:
    return np.asarray(solve_ivp(rates, (0, MIDDLE), after_strike(z), args=(gamma,), **TIGHT).y[:, -1])


def stride(z: np.ndarray, gamma: float = GAMMA) -> tuple[np.ndarray, float]:
    """theta and theta_dot one step later, and the time it takes."""
    run = solve_ivp(rates, (MIDDLE, 10), middle(z, gamma), args=(gamma,), events=touches, **TIGHT)
    theta, _, w, _ = run.y[:, -1]
    return np.array([-theta, np.cos(2 * theta) * w]), float(run.t[-1])


def slope(of: Any, z: np.ndarray, h: float = 1e-5) -> np.ndarray:
    """Central differences of fourth order."""
    columns = [(8 * (of(z + d) - of(z - d)) - of(z + 2 * d) + of(z - 2 * d)) / (12 * h) for d in h * np.eye(len(z))]
    return np.column_stack(columns)


def steady(z: np.ndarray, gamma: float = GAMMA) -> np.ndarray:
    """The gait near z, by Newton's iteration."""
    for _ in range(4):
        z = z - np.linalg.solve(slope(lambda y: stride(y, gamma)[0], z) - np.eye(2), stride(z, gamma)[0] - z)
    return z


def eigenvalues(A: np.ndarray) -> np.ndarray:
    return np.array(sorted(np.linalg.eigvals(A), key=lambda x: (-abs(x), -x.imag)))


@pytest.mark.parametrize("gait", ["long", "short"])
def test_floquet_multipliers(walker: Any, gait: str) -> None:
    """Those of one period of the motion: 1 along it, 0 because the strike sets phi by theta, and two of the stride."""
    published = PUBLISHED[gait]
    z = np.array([published["theta"], published["theta_dot"]])
    z = steady(z)
    np.testing.assert_allclose(z, [published["theta"], published["theta_dot"]], atol=1e-9)
    period, start = stride(z)[1], middle(z)
    s = walker.sensitivities(
        walker.x_names, period, dict(zip(walker.x_names, start, strict=True)), rtol=1e-12, atol=1e-14
    )
    np.testing.assert_allclose(s.trajectory.x[:, -1], start, atol=1e-9)
    assert [event.name for event in s.events] == ["heel_strike"]
    found = eigenvalues(s.dx[:, :, -1])
    exact = eigenvalues(slope(lambda z: stride(z)[0], z))
    expected = np.array(sorted([1.0, *exact, 0.0], key=lambda x: (-abs(x), -x.imag)))
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-7)
    if gait == "short":
        np.testing.assert_allclose(exact, published["eigenvalues"], atol=5e-3)


def test_the_published_multiplier_is_a_one_sided_difference(walker: Any) -> None:
    """With a step of 1e-5 runs through the model's own reset give it to all digits that rounding leaves."""
    z, h = np.array([PUBLISHED["long"]["theta"], PUBLISHED["long"]["theta_dot"]]), 1e-5

    def walk(z: np.ndarray) -> np.ndarray:
        run = walker.simulate(4.0, middle(z), rtol=1e-13, atol=1e-15)
        x = run.x[:, int(np.flatnonzero(np.diff(run.t) == 0.0)[0]) + 1]
        np.testing.assert_allclose(x, after_strike(x[[0, 2]]), atol=1e-13)
        return x[[0, 2]]

    A = np.column_stack([(walk(z + d) - walk(z)) / h for d in h * np.eye(2)])
    real, imaginary = PUBLISHED["long"]["eigenvalue"]
    np.testing.assert_allclose(eigenvalues(A), [real + 1j * imaginary, real - 1j * imaginary], atol=5e-8)


def test_a_stride_and_how_the_gait_follows_the_slope(walker: Any) -> None:
    """The Jacobian of the stride from event to event, and dz/dgamma = (I - P_z)^-1 P_gamma of the fixed point."""
    z = steady(np.array([PUBLISHED["long"]["theta"], PUBLISHED["long"]["theta_dot"]]))
    held = dict(zip(walker.x_names, middle(z), strict=True))
    s = walker.sensitivities([*walker.x_names, "gamma"], 4.0, held, rtol=1e-12, atol=1e-14)
    event = s.events[0]
    assert event.t == pytest.approx(stride(z)[1] - MIDDLE, abs=1e-10)
    np.testing.assert_allclose(event.after, after_strike(z), atol=1e-9)
    M = slope(middle, z)  # (4, 2), of the swing up to the start of the run
    np.testing.assert_allclose(event.d_after[[0, 2], :4] @ M, slope(lambda z: stride(z)[0], z), atol=1e-7)
    np.testing.assert_allclose(event.d_before[1] - 2 * event.d_before[0], 0.0, atol=1e-9)  # it stays on the surface
    by_time = slope(lambda z: np.array([stride(z)[1]]), z)[0]
    np.testing.assert_allclose(s.event_times["heel_strike"][0, :4] @ M, by_time, atol=1e-6)
    h = 1e-5
    moved = (middle(z, GAMMA + h) - middle(z, GAMMA - h)) / (2 * h)
    P_gamma = event.d_after[[0, 2]] @ np.append(moved, 1.0)
    gait = np.linalg.solve(np.eye(2) - event.d_after[[0, 2], :4] @ M, P_gamma)
    np.testing.assert_allclose(gait, (steady(z, GAMMA + h) - steady(z, GAMMA - h)) / (2 * h), rtol=1e-5)
    # theta = 0.970956 gamma^(1/3) - 0.270837 gamma + O(gamma^(5/3)), the paper's expansion for small slopes
    assert gait[0] == pytest.approx(0.970956 / 3 * GAMMA ** (-2 / 3) - 0.270837, rel=0.03)
