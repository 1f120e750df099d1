"""Constrained inverse dynamics: fed back it gives the motion; virtual work; more drives than freedoms, too few."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import judges
import numpy as np
import pytest
from wrenches import tangent

import eomgen as eg

START, RATE, SWING = 0.4, 2.0, 0.8


def motion(t: Any) -> tuple[Any, Any, Any]:
    """A crank angle over time with its rates."""
    w = 3.0
    return (
        START + RATE * t + SWING * (1 - np.cos(w * t)),
        RATE + SWING * w * np.sin(w * t),
        SWING * w**2 * np.cos(w * t),
    )


def history(mod: Any, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """States and accelerations of the prescribed motion of the slider-crank."""
    q, v, a = mod.kinematics(*(np.atleast_2d(y) for y in motion(times)))
    return np.vstack([q, v]), a


def test_fed_back_it_gives_the_motion(compiled: Callable[..., Any]) -> None:
    """A whole history at once, as an input of a run: the crank follows the prescribed angle."""
    mod = compiled("slider_crank", "cython")
    assert mod.minimal.q_names == ("theta",)
    times = np.linspace(0.0, 0.3, 601)
    x, a = history(mod, times)
    forces = mod.actuator_forces(times, x, a, actuated=["tau"])
    by_name = mod.actuator_forces(times, x, {"theta": motion(times)[2]}, actuated=["tau"])
    np.testing.assert_allclose(by_name.forces, forces.forces, atol=1e-9 * np.abs(forces.forces).max())
    np.testing.assert_allclose(by_name.a, a, atol=1e-9 * np.abs(a).max())
    run = mod.simulate(0.3, x[:, 0], inputs={"tau": lambda t, state: np.interp(t, times, forces["tau"])}, rtol=1e-9,
                       t_eval=times[::50])  # fmt: skip
    np.testing.assert_allclose(run["theta"], motion(run.t)[0], atol=2e-5)  # tau is linear between 601 points

    def exact(t: float, state: np.ndarray) -> float:
        here, rates = history(mod, np.array([t]))
        return float(mod.actuator_forces(t, here[:, 0], rates[:, 0], actuated=["tau"])["tau"])

    run = mod.simulate(0.1, x[:, 0], inputs={"tau": exact}, rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(run["theta"], motion(run.t)[0], atol=1e-8)
    np.testing.assert_allclose(run["theta_dot"], motion(run.t)[1], atol=1e-7)


def test_accelerations_of_the_model_need_the_inputs_it_has(compiled: Callable[..., Any]) -> None:
    mod = compiled("slider_crank").bind(u={"tau": 0.37})
    for x in judges.random_states(mod, 1, 2):
        a = mod.rhs(0.0, x)[mod.n_q :]
        found = mod.actuator_forces(0.0, x, a, actuated=["tau"])
        np.testing.assert_allclose(found["tau"], 0.37, atol=1e-10)
        np.testing.assert_allclose(found.multipliers, mod.multipliers(0.0, x), atol=1e-8)
        np.testing.assert_allclose(found.reactions, mod.reactions(0.0, x), atol=1e-8)
        np.testing.assert_allclose(mod.actuator_forces(0.0, x, a).forces, 0.0, atol=1e-10)  # nothing to add


@pytest.mark.parametrize("drives", [("theta",), ("s",), ("B",), ("C",), ("theta", "s"), ("theta", "C", "s")])
def test_virtual_work(drives: tuple[str, ...], compiled: Callable[..., Any]) -> None:
    """In every motion the loop allows drives do the work of M a + h; of all such forces theirs are the smallest."""
    mod = compiled("slider_crank")
    x = mod.x0()
    found = mod.actuator_forces(0.0, x, {"theta": -4.0}, actuated=drives)
    q, v = x[: mod.n_q], x[mod.n_q :]
    free = tangent(mod, q)
    J = [
        mod.kernels.state("loop_coordinate_jacobian")(q)[mod.loop_names.index(name)]
        if name in mod.loop_names
        else np.eye(mod.n_v)[mod.q_names.index(name)]
        for name in drives
    ]
    work = free.T @ np.array(J).T
    needed = free.T @ mod.inverse_dynamics(q, v, found.a)
    size = np.array([mod.metadata["length_scale"] if name == "s" else 1.0 for name in drives])
    expected = np.linalg.pinv(work / size) @ needed / size
    np.testing.assert_allclose(found.forces, expected, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(mod.constraint_jacobian(q) @ found.a,
                               mod.constraint_jacobian(q) @ mod.rhs(0.0, x)[mod.n_q :], atol=1e-9)  # fmt: skip


def test_drive_on_a_cut_joint_equals_a_torque_there(compiled: Callable[..., Any]) -> None:
    """Reactions with a drive on a cut joint are those of the model that has the torque as a force element."""

    def build(torque: float | None) -> Any:
        m = eg.Model("driven_bar", gravity=(0, -9.81, 0))
        bar = [m.body(n, mass=1.0 + i, com=(0.2, 0, 0), inertia={"zz": 0.02}) for i, n in enumerate("abc")]
        m.revolute("A", m.ground, bar[0], coordinate="qA")
        m.revolute("B", bar[0].at(0.3, 0, 0), bar[1], coordinate="qB")
        m.revolute("C", bar[1].at(0.6, 0, 0), bar[2].at(0.5, 0, 0))
        m.revolute("D", m.ground.at(0.7, 0, 0), bar[2], coordinate="qD")
        if torque is not None:
            m.torque("motor", "C", torque)
        m.initial(qA=1.0, qA_dot=2.0)
        m.guess(qB=-0.7, qD=1.5)
        m.independent("qA")
        return m.compile(target="numpy")

    plain = build(None)
    x = plain.x0()
    assert plain.loop_names == ("C",)
    found = plain.actuator_forces(0.0, x, {"qA": 12.0}, actuated=["C"])
    driven = build(float(found["C"]))
    np.testing.assert_allclose(driven.rhs(0.0, x)[3:], found.a, atol=1e-9)
    np.testing.assert_allclose(driven.reactions(0.0, x), found.reactions, atol=1e-9)


def test_what_is_refused(compiled: Callable[..., Any]) -> None:
    mod = compiled("double_pendulum")
    x = mod.x0()
    with pytest.raises(eg.EomgenError, match=r"no drive moves .*2 degrees of freedom need as many drives"):
        mod.actuator_forces(0.0, x, actuated=[mod.q_names[0]])
    crank = compiled("slider_crank")
    x = crank.x0()
    with pytest.raises(eg.EomgenError, match=r"no coordinate or input 'thet'; did you mean 'theta'\?"):
        crank.actuator_forces(0.0, x, actuated=["thet"])
    with pytest.raises(eg.EomgenError, match=r"a violates the constraint C\.r_"):
        crank.actuator_forces(0.0, x, np.array([1.0, 2.0, 3.0]))
    with pytest.raises(eg.EomgenError, match=r"a must have shape \(3,\)"):
        crank.actuator_forces(0.0, x, np.zeros(2))
    with pytest.raises(eg.EomgenError, match="is not an independent coordinate"):
        crank.actuator_forces(0.0, x, {"s": 1.0})
    with pytest.raises(eg.EomgenError, match="each only once"):
        crank.actuator_forces(0.0, x, actuated=["theta", "theta"])
