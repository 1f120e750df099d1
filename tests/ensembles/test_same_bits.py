"""The bits of every run, however runs are shared out and whatever stands in the lanes beside it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import eomgen as eg

from .conftest import compiled

TIGHT = {"rtol": 1e-9, "atol": 1e-11}


def shares(module: Any, span: Any, columns: dict[str, Any], k: int, **options: Any) -> list[Any]:
    """The same runs on one thread, on several, in blocks, backwards and some of them alone."""

    def some(chosen: Any) -> dict[str, Any]:
        return {name: x[chosen] if np.ndim(x) else x for name, x in columns.items()}

    few = slice(k // 3, k // 3 + 3)
    return [
        (module.simulate_many(span, some(slice(None)), threads=1, **options), slice(None)),
        (module.simulate_many(span, some(slice(None)), threads=3, **options), slice(None)),
        (module.simulate_many(span, some(slice(None)), threads=2, block=5, **options), slice(None)),
        (module.simulate_many(span, some(slice(None, None, -1)), threads=2, **options), slice(None, None, -1)),
        (module.simulate_many(span, some(few), **options), few),
    ]


def compare(found: list[Any]) -> None:
    """Compare states, samples and numbers of steps to the last bit."""
    whole = found[0][0]
    assert whole.ok.all()
    for other, chosen in found[1:]:
        np.testing.assert_array_equal(other.x, whole.x[:, chosen])
        np.testing.assert_array_equal(other.steps, whole.steps[chosen])
        np.testing.assert_array_equal(other.rejected, whole.rejected[chosen])
        np.testing.assert_array_equal(other.evaluations, whole.evaluations[chosen])
        if whole.samples is not None:
            np.testing.assert_array_equal(other.samples, whole.samples[..., chosen])


@pytest.mark.parametrize("method", ["DOP853", "RK45", "RK23", "Radau"])
def test_a_tree(pendulum: Any, method: str) -> None:
    options = {"rtol": 1e-5, "atol": 1e-7} if method == "RK23" else TIGHT
    columns = {"theta1": np.linspace(-2.5, 2.5, 37), "bend": 0.3, "bend_dot": np.linspace(2, -2, 37)}
    compare(shares(pendulum, 2, columns, 37, method=method, t_eval=[0.3, 1.1, 2.0], **options))


def test_a_loop(crank: Any) -> None:
    columns = {"theta": np.linspace(0.1, 1.2, 14), "theta_dot": np.linspace(5, 12, 14)}
    compare(shares(crank, 0.5, columns, 14, t_eval=[0.1, 0.5], **TIGHT))


def test_a_loop_that_is_driven() -> None:
    m = eg.Model("driven_crank")
    m.parameter("rate", 6.0)
    crank, rod, slider, load = (
        m.body(name, mass=1.0, inertia={"zz": 0.01}) for name in ("crank", "rod", "slider", "load")
    )
    m.revolute("A", m.ground, crank, coordinate="theta")
    m.revolute("B", crank.at(0.1, 0, 0), rod)
    m.revolute("C", rod.at(0.35, 0, 0), slider)
    m.prismatic("D", m.ground, slider, axis="x", coordinate="s")
    m.prismatic("E", slider, load, axis="x", coordinate="e")
    m.driver("speed", "theta", "rate*t")
    m.spring("k", slider, load, stiffness=300, length=0.0)
    module = m.compile()
    columns = {"e": np.linspace(0.01, 0.05, 9)}
    compare(shares(module, 0.4, columns, 9, **TIGHT))


def bouncing() -> eg.Model:
    """Two balls on a swinging floor that they are thrown back from, of which the second pulls the first."""
    m = eg.Model("bouncing", gravity=(0, -10.0, 0))
    push = m.input("push")
    one, two = m.body("one", mass=1.0), m.body("two", mass=0.7)
    m.prismatic("y", m.ground, one, axis="y", coordinate="y")
    m.prismatic("z", m.ground, two, axis="y", coordinate="z")
    m.torque("pull", "z", push)
    m.parameter("e", 0.8)
    m.event("floor", "y", direction=-1, reset={"y_dot": "-e*y_dot"})
    m.event("below", "z", direction=-1, reset={"z_dot": "-0.9*z_dot", "z": "z"})
    return m


@pytest.mark.parametrize("method", ["DOP853", "RK45"])
def test_resets_and_events_that_end(method: str) -> None:
    """Lanes meet the floor at other times and end at others; each does what it does alone."""
    module, singly = bouncing().compile(), bouncing().compile(lanes=0)
    columns = {"y": np.linspace(0.5, 2.0, 23), "z": np.linspace(1.5, 0.3, 23), "z_dot": 1.0}
    watched = {"fast": {"expression": "z_dot + 4", "terminal": 2}, "turns": {"expression": "y_dot", "direction": -1}}
    options = {
        "t_eval": [0.0, 0.31, 0.9, 1.7],
        "inputs": {"push": "0.3*sin(4*t)*y"},
        "events": watched,
        "method": method,
    }
    found = shares(module, 1.7, columns, 23, **options, **TIGHT)
    compare(found)
    whole, single = found[0][0], singly.simulate_many(1.7, columns, **options, **TIGHT)
    assert set(whole.status) == {0, 1}
    for name in whole.event_names:
        t, x = whole.events(name)
        for other, chosen in found[1:]:
            there = other.events(name)
            most = len(there[0])  # of the runs that were asked for
            np.testing.assert_array_equal(there[0], t[:most, chosen])
            np.testing.assert_array_equal(there[1], x[:, :most, chosen])
            assert np.isnan(t[most:, chosen]).all()
        alone = single.events(name)
        np.testing.assert_allclose(t, alone[0], rtol=0, atol=1e-7)
        np.testing.assert_allclose(x, alone[1], rtol=0, atol=1e-6)
    np.testing.assert_array_equal(whole.event_counts, single.event_counts)
    np.testing.assert_array_equal(whole.status, single.status)
    np.testing.assert_allclose(whole.samples, single.samples, rtol=0, atol=1e-6)
    np.testing.assert_allclose(whole.t_end, single.t_end, rtol=0, atol=1e-7)
    assert not np.array_equal(whole.samples, single.samples)  # they were taken side by side


def test_a_loop_with_events_and_an_expression(crank: Any) -> None:
    columns = {"theta": np.linspace(0.1, 1.2, 14), "theta_dot": np.linspace(5, 12, 14)}
    watched = {"half": "s - 0.3", "past": {"expression": "theta - 4", "terminal": 1}}
    options = {"t_eval": [0.1, 0.5], "inputs": {"tau": "-0.05*theta_dot + 0.1*sin(9*t)"}, "events": watched}
    found = shares(crank, 0.5, columns, 14, **options, **TIGHT)
    compare(found)
    single = compiled("slider_crank", "cython", 0).simulate_many(0.5, columns, **options, **TIGHT)
    for name in single.event_names:
        np.testing.assert_allclose(found[0][0].events(name)[0], single.events(name)[0], rtol=0, atol=1e-8)
    np.testing.assert_array_equal(found[0][0].status, single.status)
    np.testing.assert_allclose(found[0][0].x, single.x, rtol=0, atol=1e-6)


@pytest.mark.parametrize("interpolation", ["zero-order", "linear", "cubic"])
def test_a_tree_with_tables(interpolation: str) -> None:
    m = eg.Model("pushed_arm", gravity=(0, -9.81, 0))
    push = m.input("push")
    arm = m.body("arm", mass=2.0, com=(0.4, 0, 0), inertia={"zz": 0.1})
    m.revolute("hinge", m.ground, arm, coordinate="a")
    m.torque("drive", "hinge", push)
    module = m.compile()
    signal = eg.Signal(np.array([0.0, 0.4, 1.0, 1.3, 2.0]), np.array([1.0, -2.0, 3.0, 0.5, 0.0]), interpolation)
    found = shares(
        module, 2, {"a": np.linspace(-1, 1, 21)}, 21, inputs={"push": signal}, t_eval=[0.5, 1.3, 2.0], **TIGHT
    )
    compare(found)


def test_what_stands_in_other_lanes_does_not_matter() -> None:
    """Lanes that are not finite, that have failed, with denormal numbers and with angles that go to libm."""
    m = eg.Model("lanes_apart")
    m.parameter("k", 1.0)
    arm = m.body("arm", mass=1.0, com=(1, 0, 0), inertia={"zz": 0.1})
    m.revolute("hinge", m.ground, arm, coordinate="a")
    m.torque("pull", "hinge", "k*sin(a) + k*a**3*1e-3")
    module = m.compile()
    k = np.where(np.arange(32) % 4 == 0, -1.0, 0.0)
    start, rate = np.full(32, 0.5), np.linspace(0.1, 1.0, 32)
    alone = module.simulate_many(3, {"a": start, "a_dot": rate}, {"k": k}, **TIGHT)
    assert alone.ok.all()
    wild, speed, pull = start.copy(), rate.copy(), k.copy()
    wild[1::4], speed[1::4] = 5e-324, 5e-320  # denormal
    wild[2::4] = 3e6  # by libm
    pull[3::4], wild[3::4] = 1e9, 1e8  # soon infinite
    mixed = module.simulate_many(3, {"a": wild, "a_dot": speed}, {"k": pull}, max_steps=3000, **TIGHT)
    assert (mixed.status[3::4] < 0).all()
    assert mixed.ok.reshape(8, 4)[:, :3].all()
    np.testing.assert_array_equal(mixed.x[:, ::4], alone.x[:, ::4])
    np.testing.assert_array_equal(mixed.steps[::4], alone.steps[::4])
    np.testing.assert_allclose(mixed.x[0, 2::4], 3e6 + 3 * rate[2::4], rtol=1e-12)
    np.testing.assert_allclose(mixed.x[0, 1::4], 5e-324 + 3 * 5e-320, rtol=1e-3)


def test_no_lanes_and_two_lanes(pendulum: Any) -> None:
    columns = {"theta1": np.linspace(-1, 1, 19), "bend": 0.3}
    for lanes in (0, 2):
        compare(shares(compiled("double_pendulum", "cython", lanes), 1, columns, 19, **TIGHT))
