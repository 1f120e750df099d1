"""Inverse dynamics of constrained machines, and consistent states: virtual work, SciPy's minimiser, closed forms."""

from typing import Any

import judges
import numpy as np
import pytest
import scipy.linalg
from analysed import compiled
from refusals import refuses
from scipy.optimize import minimize

import eomgen as eg

START, RATE, SWING = 0.4, 2.0, 0.8


def motion(t: Any) -> tuple[Any, Any, Any]:
    """A crank angle over time with its rates."""
    w = 3.0
    s, c = SWING * np.sin(w * t), SWING * np.cos(w * t)
    return START + RATE * t + SWING - c, RATE + w * s, w**2 * c


def history(mod: Any, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """States and accelerations of the prescribed motion of the slider-crank."""
    q, v, a = mod.kinematics(*(np.atleast_2d(y) for y in motion(times)))
    return np.vstack([q, v]), a


def test_fed_back_it_gives_the_motion() -> None:
    """A whole history at once, as an input of a run: the crank follows the prescribed angle."""
    mod = compiled("slider_crank")
    assert mod.minimal.q_names == ("theta",)
    times = np.linspace(0.0, 0.1, 201)
    x, a = history(mod, times)
    forces = mod.actuator_forces(times, x, a, actuated=["tau"])
    by_name = mod.actuator_forces(times, x, {"theta": motion(times)[2]}, actuated=["tau"])
    np.testing.assert_allclose(by_name.forces, forces.forces, atol=1e-9 * np.abs(forces.forces).max())
    np.testing.assert_allclose(by_name.a, a, atol=1e-9 * np.abs(a).max())
    run = mod.simulate(0.1, x[:, 0], inputs={"tau": lambda t, state: np.interp(t, times, forces["tau"])}, rtol=1e-9,
                       t_eval=times[::20])  # fmt: skip
    np.testing.assert_allclose(run["theta"], motion(run.t)[0], atol=2e-5)  # tau is linear between 201 points

    def exact(t: float, state: np.ndarray) -> float:
        here, rates = history(mod, np.array([t]))
        return float(mod.actuator_forces(t, here[:, 0], rates[:, 0], actuated=["tau"])["tau"])

    run = mod.simulate(0.02, x[:, 0], inputs={"tau": exact}, rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(run["theta"], motion(run.t)[0], atol=1e-8)
    np.testing.assert_allclose(run["theta_dot"], motion(run.t)[1], atol=1e-7)


def test_accelerations_of_the_model_need_the_inputs_it_has() -> None:
    mod = compiled("slider_crank").bind(u={"tau": 0.37})
    for x in judges.random_states(mod, 1, 2):
        a = mod.rhs(0.0, x)[mod.n_q :]
        found = mod.actuator_forces(0.0, x, a, actuated=["tau"])
        np.testing.assert_allclose(found["tau"], 0.37, atol=1e-10)
        np.testing.assert_allclose(found.multipliers, mod.multipliers(0.0, x), atol=1e-8)
        np.testing.assert_allclose(found.reactions, mod.reactions(0.0, x), atol=1e-8)
        np.testing.assert_allclose(mod.actuator_forces(0.0, x, a).forces, 0.0, atol=1e-10)  # nothing to add


def rates(mod: Any, name: str, q: np.ndarray) -> np.ndarray:
    """How a coordinate changes with the velocities, that of the cut joint by its geometry: the rod's angle closes."""
    if name in mod.q_names:
        return np.eye(mod.n_v)[mod.q_names.index(name)]
    return np.array([-1.0 * (n in ("theta", "B")) for n in mod.q_names])  # C = -(theta + B), the slider is level


@pytest.mark.parametrize("drives", [("theta",), ("s",), ("B",), ("C",), ("theta", "s"), ("theta", "C", "s")])
def test_virtual_work(drives: tuple[str, ...]) -> None:
    """In every motion the loop allows drives do the work of M a + h; of all such forces theirs are the smallest."""
    mod = compiled("slider_crank")
    x = mod.x0()
    found = mod.actuator_forces(0.0, x, {"theta": -4.0}, actuated=drives)
    q, v = x[: mod.n_q], x[mod.n_q :]
    free = scipy.linalg.null_space(mod.constraint_jacobian(q))
    work = np.array([rates(mod, name, q) for name in drives]) @ free
    needed = free.T @ mod.inverse_dynamics(q, v, found.a)
    size = np.array([mod.metadata["length_scale"] if name == "s" else 1.0 for name in drives])
    expected = np.linalg.pinv(work.T / size) @ needed / size
    np.testing.assert_allclose(found.forces, expected, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(mod.constraint_jacobian(q) @ found.a,
                               mod.constraint_jacobian(q) @ mod.rhs(0.0, x)[mod.n_q :], atol=1e-9)  # fmt: skip


def test_what_inverse_dynamics_refuses() -> None:
    mod = compiled("double_pendulum")
    x = mod.x0()
    refuses("EG-UNDETERMINED 2", mod.actuator_forces, 0.0, x, actuated=[mod.q_names[0]])
    crank = compiled("slider_crank")
    x = crank.x0()
    refuses("EG-NAME-UNKNOWN thet theta?", crank.actuator_forces, 0.0, x, actuated=["thet"])
    refuses("EG-CONTRADICTION C.r_", crank.actuator_forces, 0.0, x, np.array([1.0, 2.0, 3.0]))
    refuses("EG-SHAPE a (3,)", crank.actuator_forces, 0.0, x, np.zeros(2))
    refuses("EG-REFERENCE independent", crank.actuator_forces, 0.0, x, {"s": 1.0})
    refuses("EG-MISSING once", crank.actuator_forces, 0.0, x, actuated=["theta", "theta"])


@pytest.mark.parametrize("law", ["u1*u2", "u1 + sin(u2)"])
def test_inputs_that_forces_are_not_linear_in_are_refused(law: str) -> None:
    m = eg.Model("two", gravity=(0, -9.81, 0))
    m.input("u1", 0.5)
    m.input("u2", 2.0)
    m.revolute("R", m.ground, m.body("b", mass=1.0, com=(0, -1, 0)), coordinate="th")
    m.torque("T", "R", law)
    mod = m.compile(target="numpy")
    x = mod.x0(th=0.2)
    refuses("EG-UNSUPPORTED linear", mod.actuator_forces, 0.0, x, {"th": 1.0}, actuated=["u1", "u2"])
    alone = mod.actuator_forces(0.0, x, {"th": 1.0}, actuated=["u1"])
    assert mod.rhs(0.0, x, u=[alone["u1"], 2.0])[1] == pytest.approx(1.0, abs=1e-12)


def disturbed(mod: Any, seed: int, size: float = 0.1) -> np.ndarray:
    x = mod.x0()
    length = mod.metadata["length_scale"]
    kinds = [*mod.metadata["coordinate_kinds"], *mod.metadata["velocity_kinds"]]
    sizes = np.array([length if kind == "length" else 1.0 for kind in kinds])
    return x + size * np.random.default_rng(seed).normal(size=x.size) * sizes


@pytest.mark.parametrize("name", ["slider_crank", "tilted_four_bar", "three_cranks"])
@pytest.mark.parametrize("metric", ["plain", "weights", "mass"])
def test_least_change(name: str, metric: str) -> None:
    mod = compiled(name)
    n = mod.n_q
    length, kinds = mod.metadata["length_scale"], mod.metadata["coordinate_kinds"]
    s = np.array([length if kind == "length" else 1.0 for kind in kinds])
    x = disturbed(mod, 3)
    first, second = mod.q_names[0], mod.v_names[-1]
    weights: Any = {"plain": None, "weights": {first: 30.0, second: 0.1}, "mass": "mass"}[metric]
    found = mod.consistent(x, weights=weights)
    q, v = found[:n], found[n:]
    np.testing.assert_allclose(mod.constraints(q, rows="all"), 0.0, atol=1e-12)
    np.testing.assert_allclose(mod.velocity_constraints(found, rows="all"), 0.0, atol=1e-11)
    W_q, W_v = np.diag(1 / s**2), np.diag(1 / s**2)
    if metric == "weights":
        W_q[0, 0] *= 30.0
        W_v[0, 0] *= 30.0
        W_v[-1, -1] *= 0.1
    if metric == "mass":
        W_q, W_v = mod.mass_matrix(x[:n]), mod.mass_matrix(q)

    def cost(z: np.ndarray) -> float:
        d = z - x[:n]
        return float(d @ W_q @ d) / np.abs(W_q).max()

    rows = {"type": "eq", "fun": lambda z: mod.constraints(z)}
    best = minimize(cost, mod.project(x)[:n], constraints=rows, method="SLSQP", options={"ftol": 1e-16, "maxiter": 900})
    assert cost(q) <= best.fun * (1 + 1e-6)
    np.testing.assert_allclose(q, best.x, atol=1e-4)
    C_q = mod.constraint_jacobian(q)
    n_c = len(C_q)
    K = np.block([[W_v, C_q.T], [C_q, np.zeros((n_c, n_c))]])
    expected = np.linalg.lstsq(K, np.concatenate([W_v @ x[n:], np.zeros(n_c)]), rcond=None)[0][: mod.n_v]
    np.testing.assert_allclose(v, expected, atol=1e-8 * np.abs(expected).max())


@pytest.mark.quick
def test_held_values_stay() -> None:
    mod = compiled("slider_crank")
    x = disturbed(mod, 5, 0.05)
    found = mod.consistent(x, hold=["theta", "s_dot"])
    assert found[mod.x_names.index("theta")] == x[mod.x_names.index("theta")]
    assert found[mod.x_names.index("s_dot")] == x[mod.x_names.index("s_dot")]
    np.testing.assert_allclose(mod.constraints(found[: mod.n_q]), 0.0, atol=1e-12)
    np.testing.assert_allclose(mod.velocity_constraints(found), 0.0, atol=1e-11)
    refuses("EG-PROJECTION theta B s", mod.consistent, x, hold=list(mod.q_names))


def test_rotations_and_nonholonomic_rows() -> None:
    mod = compiled("rssr")
    found = mod.consistent(disturbed(mod, 1, 0.05))
    np.testing.assert_allclose(mod.constraints(found[: mod.n_q]), 0.0, atol=1e-12)
    np.testing.assert_allclose(mod.velocity_constraints(found), 0.0, atol=1e-11)
    disc = compiled("rolling_disc")
    found = disc.consistent(disturbed(disc, 1), hold=["x", "yaw_dot"])
    np.testing.assert_allclose(disc.velocity_constraints(found), 0.0, atol=1e-11)


def test_least_change_in_the_mass_metric_is_a_plastic_impact() -> None:
    """Velocities that constraints stop at once lose the least kinetic energy (Gauss, Robin)."""
    mod = compiled("three_cranks")
    x = mod.x0()
    x[mod.n_q :] = [1.0, -2.0, 0.5, 3.0][: mod.n_v]
    v = mod.consistent(x, weights="mass")[mod.n_q :]
    M = mod.mass_matrix(x[: mod.n_q])
    impulse = M @ (v - x[mod.n_q :])
    C_q = mod.constraint_jacobian(x[: mod.n_q])
    left = impulse - C_q.T @ np.linalg.lstsq(C_q.T, impulse, rcond=None)[0]
    np.testing.assert_allclose(left, 0.0, atol=1e-10)


def test_what_consistent_refuses() -> None:
    mod = compiled("slider_crank")
    x = mod.x0()
    for words, message in (
        ({"weights": {"thet": 1.0}}, "EG-NAME-UNKNOWN thet theta"),
        ({"weights": {"theta": -1.0}}, "EG-RANGE theta -1.0"),
        ({"weights": "inertia"}, "EG-TYPE mass"),
        ({"hold": ["q"]}, "EG-NAME-UNKNOWN q"),
    ):
        refuses(message, mod.consistent, x, **words)
    refuses("EG-SHAPE x (6,)", mod.consistent, np.zeros(3))
