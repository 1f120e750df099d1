"""Impacts: closed forms, balance of momentum with constraints, energy (Carnot), runs with impacts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import judges
import numpy as np
import pytest

import eomgen as eg

G = 9.81


def ball() -> Any:
    m = eg.Model("ball", gravity=(0, 0, -G))
    m.prismatic("P", m.ground, m.body("b", mass=2.0), axis="z", coordinate="z")
    m.output("gap", "z - 0.1")
    return m.compile(target="numpy")


def test_a_bouncing_ball() -> None:
    """Impact times t0 + 2 t0 (e + e^2 + ...), to rest after t0 (1 + e) / (1 - e)."""
    e, start = 0.7, np.sqrt(2.0 / G)
    run = ball().simulate_impacts(4.0, {"gap": e}, {"z": 1.1}, rtol=1e-10)
    times = np.array([t for t, _ in run.impacts])
    k = np.arange(len(times))
    np.testing.assert_allclose(times, start + 2 * start * e * (1 - e**k) / (1 - e), rtol=0, atol=1e-9)
    assert run.ended == "rest"
    assert len(times) > 30
    assert abs(times[-1] - start * (1 + e) / (1 - e)) < 1e-4
    first = run.impacts[0][1]
    np.testing.assert_allclose(first["gap"], 2.0 * (1 + e) * G * start, rtol=1e-9)
    np.testing.assert_allclose(first.energy_lost, (1 - e**2) * G * 2.0, rtol=1e-9)
    assert run["z"].min() > 0.1 - 1e-9
    assert len(run["z"]) == len(run.t)
    assert ball().simulate_impacts(4.0, {"gap": e}, {"z": 1.1}, most=3).ended == "impacts"


def test_equal_balls_exchange_their_velocities_and_pass_them_on() -> None:
    m = eg.Model("cradle")
    for k in range(2):
        m.prismatic(f"P{k}", m.ground, m.body(f"b{k}", mass=0.3), axis="x", coordinate=f"x{k}")
    m.output("gap", "x1 - x0 - 0.1")
    mod = m.compile(target="numpy")
    x = mod.x0(x0=0.0, x1=0.1, x0_dot=2.0, x1_dot=-0.5)
    hit = mod.impact(0.0, x, {"gap": 1.0})
    np.testing.assert_allclose(hit.x[2:], [-0.5, 2.0], atol=1e-14)
    np.testing.assert_allclose([hit["gap"], hit.energy_lost], [0.3 * 2.5, 0.0], atol=1e-14)
    parting = mod.impact(0.0, mod.x0(x0=0.0, x1=0.1, x1_dot=1.0), {"gap": 0.5})
    np.testing.assert_allclose(parting.impulses, 0.0)  # they part already


def test_centre_of_percussion() -> None:
    """A uniform rod struck at 2 l / 3 from its pivot exerts no impulse on it: J = i_p (1 + e) w / a."""
    m = eg.Model("bat")
    rod = m.body("rod", mass=3.0, com=(0.5, 0, 0), inertia={"zz": 3.0 / 12})
    m.planar("hold", m.ground, rod, coordinates=["x", "y", "th"])
    m.distance("pivot_x", m.ground.at(-1, 0, 0), rod.at(0, 0, 0), length=1.0)
    m.distance("pivot_y", m.ground.at(0, -1, 0), rod.at(0, 0, 0), length=1.0)
    m.output("end", rod.at(2 / 3, 0, 0).position[1])
    m.output("tip", rod.at(1.0, 0, 0).position[1])
    mod = m.compile(target="numpy")
    x = mod.x0(x=0.0, y=0.0, th=0.0, th_dot=-4.0)
    e = 0.3
    hit = mod.impact(0.0, x, {"end": e})
    np.testing.assert_allclose(hit["end"], 1.0 * (1 + e) * 4.0 / (2 / 3), rtol=1e-10)
    np.testing.assert_allclose(hit.constraint_impulses, 0.0, atol=1e-10)
    hit = mod.impact(0.0, x, {"tip": e})
    np.testing.assert_allclose(hit["tip"], (1 + e) * 4.0, rtol=1e-10)
    # the pivot: m v_c changes by both impulses
    pivot = 3.0 * 0.5 * (1 + e) * 4.0 - (1 + e) * 4.0
    np.testing.assert_allclose(np.abs(hit.constraint_impulses).max(), abs(pivot), rtol=1e-9)


@pytest.mark.parametrize("name", ["slider_crank", "three_cranks", "rssr", "rolling_disc"])
def test_momentum_and_energy_with_constraints(name: str, compiled: Callable[..., Any]) -> None:
    """M dv + C_q^T i = n g with the gap's rate turned round; a plastic impact loses T(dv) (Carnot)."""
    mod = compiled(name)
    gap = {"slider_crank": "s", "three_cranks": "theta1", "rssr": "ph", "rolling_disc": "yaw"}[name]
    for x in judges.random_states(mod, 8, 2):
        q, v = x[: mod.n_q], x[mod.n_q :]
        n = np.eye(mod.n_v)[mod.layout.velocity_labels.index(gap)]
        M, C_q = mod.mass_matrix(q), mod.constraint_jacobian(q, rows="all")
        for e in (0.0, 0.6, 1.0):
            hit = mod.impact(0.0, x, {gap: e}, closed=True)  # a stop where it is
            dv = hit.x[mod.n_q :] - v
            size = np.abs(M @ v).max()
            np.testing.assert_allclose(M @ dv + C_q.T @ hit.constraint_impulses, n * hit[gap], atol=1e-9 * size)
            np.testing.assert_allclose(C_q @ dv, 0.0, atol=1e-9 * np.abs(v).max())
            assert hit[gap] >= 0.0
            closing = n @ v < 0
            np.testing.assert_allclose(n @ (v + dv), -e * (n @ v) if closing else n @ v, atol=1e-9 * np.abs(v).max())
            lost = 0.5 * (v @ M @ v - (v + dv) @ M @ (v + dv))
            np.testing.assert_allclose(hit.energy_lost, lost, atol=1e-10 * (v @ M @ v))
            if e == 0.0:
                np.testing.assert_allclose(lost, 0.5 * dv @ M @ dv, atol=1e-10 * (v @ M @ v))
        locked = mod.impact(0.0, x, lock=[gap])
        dv = locked.x[mod.n_q :] - v
        np.testing.assert_allclose(n @ (v + dv), 0.0, atol=1e-10 * np.abs(v).max())
        np.testing.assert_allclose(M @ dv + C_q.T @ locked.constraint_impulses, n * locked[gap], atol=1e-9 * size)


def test_two_gaps_at_once() -> None:
    """A rod that falls level on two supports: each end obeys the law of restitution; on one of them it turns."""
    m = eg.Model("plank", gravity=(0, -G, 0))
    rod = m.body("rod", mass=2.0, inertia={"zz": 0.4})
    m.planar("P", m.ground, rod, coordinates=["x", "y", "th"])
    for name, at in (("left", -0.4), ("right", 0.7)):
        m.output(name, rod.at(at, 0, 0).position[1])
    mod = m.compile(target="numpy")
    x = mod.x0(y_dot=-3.0)
    hit = mod.impact(0.0, x, {"left": 0.5, "right": 0.5})
    np.testing.assert_allclose(hit.rates_after, [1.5, 1.5], atol=1e-12)
    np.testing.assert_allclose(hit.impulses.sum(), 2.0 * 4.5, rtol=1e-12)
    np.testing.assert_allclose(hit.impulses[0] * 0.4, hit.impulses[1] * 0.7, rtol=1e-12)
    # only the left end comes down fast enough to need a push at both: else the other opens by itself
    turning = mod.impact(0.0, mod.x0(y_dot=-1.0, th_dot=5.0), {"left": 0.0, "right": 0.0})
    assert turning.impulses[1] == 0.0
    assert turning.rates_after[1] > 0.0
    np.testing.assert_allclose(turning.rates_after[0], 0.0, atol=1e-12)


def test_a_pendulum_between_walls_keeps_its_energy() -> None:
    """With e = 1 the energy stays; each impact turns the velocity round."""
    m = eg.Model("clapper", gravity=(0, -G, 0))
    rod = m.body("rod", mass=1.0, com=(0, -0.5, 0), inertia={"zz": 0.02})
    m.revolute("A", m.ground, rod, coordinate="th")
    m.output("wall", "0.3 - th")
    m.output("other", "th + 0.2")
    mod = m.compile(target="numpy")
    run = mod.simulate_impacts(5.0, {"wall": 1.0, "other": 1.0}, {"th_dot": 2.0}, rtol=1e-10, atol=1e-12)
    assert run.ended == "end"
    assert len(run.impacts) > 10
    energies = np.array([sum(mod.energy(x)) for x in run.x.T])
    np.testing.assert_allclose(energies, energies[0], atol=1e-8)
    assert run["th"].max() < 0.3 + 1e-9
    assert run["th"].min() > -0.2 - 1e-9


def test_what_is_refused(compiled: Callable[..., Any]) -> None:
    mod = compiled("slider_crank")
    x = mod.x0()
    for words, message in (
        ({}, "an impact needs gaps"),
        ({"gaps": {"ss": 0.5}}, r"gaps: no coordinate or output 'ss'"),
        ({"gaps": {"s": 1.5}}, "restitution of s must be between 0 and 1"),
        ({"gaps": {"s": None}}, "restitution of s must be a number"),
        ({"gaps": {"s": "a"}}, "restitution of s must be a number"),
        ({"gaps": {"s": [0.5]}}, "restitution of s must be a number"),
        ({"gaps": ["s"]}, "gaps must be a mapping"),
        ({"lock": None}, "lock must be a list"),
        ({"lock": [0]}, "lock must be a list"),
        ({"lock": ["tau"]}, "lock: no coordinate or output 'tau'"),
        ({"gaps": {"speed": 0.5}}, "depends on velocities"),
        ({"gaps": {"s": 0.5}}, r"gap s is 0\.\d+ m \(open\); an impact needs a gap of 0"),
    ):
        with pytest.raises(eg.UsageError, match=message):
            mod.impact(0.0, x, **words)
    with pytest.raises(eg.UsageError, match="t must be a number"):
        mod.impact("a", x, lock=["s"])
    with pytest.raises(eg.UsageError, match=r"gap z is -0\.1 m \(closed too far\)"):
        ball().impact(0.0, [-0.1, -1.0], {"z": 0.5})
    for words, message in (
        ({"initial": {"z": 0.0}}, "gap is -0.1 at the start; a gap must be 0 or positive"),
        ({"span": -1.0}, "forward in time"),
        ({"gaps": {}}, "needs gaps"),
        ({"most": 0}, "most, the number of impacts, must be a whole number of at least 1, not 0"),
        ({"t_eval": [0.0]}, r"no t_eval=; use t_events of the run that it returns, and at\(t\)"),
    ):
        with pytest.raises(eg.UsageError, match=message):
            ball().simulate_impacts(**{"span": 1.0, "gaps": {"gap": 0.5}, "initial": {"z": 1.0}, **words})
