"""Events and impacts while constraints are closed for a time: as if these held always; contradictions are refused."""

from functools import cache
from typing import Any

import numpy as np
import pytest
from models import IN_C
from refusals import refused, refuses
from sweeps import TARGETS

import eomgen as eg


def sliders(reset: dict[str, Any], for_good: bool, masses: tuple[float, float] = (1.0, 3.0), ratio: float = 1.0) -> Any:
    """Two sliders with s = ratio * r, which an event kicks at 0.5 s."""
    m = eg.Model("sliders", gravity=(0, 0, 0))
    a, b = (m.body(name, mass=mass) for name, mass in zip("ab", masses, strict=True))
    m.prismatic("A", m.ground, a, axis="x", coordinate="s")
    m.prismatic("B", m.ground, b, axis="x", coordinate="r")
    m.coupling("c", {"s": 1, "r": -ratio}, **({} if for_good else {"opens": "100 - t"}))
    m.event("kick", "t - 0.5", direction=1, reset=reset)
    return m


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize(("masses", "ratio"), [((1.0, 1.0), 1.0), ((1.0, 3.0), -2.5)])
def test_new_velocities_are_brought_onto_a_closed_constraint_as_onto_one_for_good(
    target: str, masses: tuple[float, float], ratio: float
) -> None:
    reset = {"s_dot": "2 + s"}
    mine, judge = (sliders(reset, g, masses, ratio).compile(target=target).simulate(1.0) for g in (False, True))
    assert mine.x[:4, -1] == pytest.approx(judge.x[:, -1], abs=1e-9)
    assert mine["s_dot"][-1] == pytest.approx(2.0 * ratio**2 / (1.0 + ratio**2), abs=1e-9)


@cache
def kicked() -> Any:
    """Two sliders that an event brings to the speed k, in C."""
    m = sliders({"s_dot": "k"}, False)
    m.parameter("k", 2.0)
    return m.compile(**IN_C)


@pytest.mark.parametrize("method", ["DOP853", "Radau", "RK4", "LSODA"])
def test_every_integrator_does_so(method: str) -> None:
    more = {"step": 1e-2} if method == "RK4" else {}
    run = kicked().simulate(1.0, method=method, **more)
    assert run.x[:4, -1] == pytest.approx([0.5, 0.5, 1.0, 1.0], abs=1e-6)


def test_many_runs_and_their_slopes_do_so() -> None:
    module = kicked()
    ends = module.simulate_many(1.0, parameters={"k": [1.0, 2.0, 4.0]}).x
    assert ends[:4] == pytest.approx(np.outer([0.25, 0.25, 0.5, 0.5], [1.0, 2.0, 4.0]), abs=1e-9)
    slopes = module.sensitivities(["k"], 1.0).dx[:4, 0, -1]
    assert slopes == pytest.approx([0.25, 0.25, 0.5, 0.5], abs=1e-6)


@pytest.mark.parametrize("target", TARGETS)
def test_positions_that_a_closed_equation_does_not_have_are_refused(target: str) -> None:
    """Those onto which the mechanism would be moved are not told from those that the user wants."""
    refuses("EG-STALLED kick 0.5 c", lambda: sliders({"s": 0.3}, False).compile(target=target).simulate(1.0))
    run = sliders({"s": 0.3, "r": 0.3, "s_dot": 1}, False).compile(target=target).simulate(1.0)
    assert run.x[:4, -1] == pytest.approx([0.55, 0.55, 0.5, 0.5], abs=1e-9)


@pytest.mark.parametrize("against", ["driver", "coupling", "closed"])
def test_a_constraint_that_closes_against_another_is_refused(against: str) -> None:
    m = eg.Model("against", gravity=(0, 0, 0))
    for name in "ab":
        m.prismatic(name.upper(), m.ground, m.body(name, mass=1.0), axis="x", coordinate=name + "_s")
    if against == "driver":
        m.driver("d", "a_s", "t")
    else:
        m.coupling("d", equation="a_s_dot - 1", **({"closes": "0.2 - t"} if against == "closed" else {}))
    m.lock("brake", "A", closes="0.5 - t")
    module = m.compile(target="numpy")
    refuses("EG-STALLED 0.5", module.simulate, 1.0)
    assert module.simulate(0.4)["a_s_dot"][-1] == pytest.approx(1.0, abs=1e-9)


def test_states_of_constraints_are_0_or_1() -> None:
    m = eg.Model("half", gravity=(0, 0, 0))
    m.prismatic("A", m.ground, m.body("a", mass=1.0), axis="x", coordinate="s")
    m.lock("brake", "A", opens="0.2 - t")
    refuses("EG-CHOICE brake_closed 1 0 0.5", lambda: m.compile(target="numpy").simulate(0.1, {"brake_closed": 0.5}))
    module = m.compile(target="numpy")
    for start in (module.minimal.x0, module.equilibrium):
        refuses("EG-CHOICE brake_closed 1 0 0.3", start, {"brake_closed": 0.3})
        start({"brake_closed": 0})
    for initial in ({"s_dot": 1.0, "brake_closed": [0.5, 1.0, 0.0]}, [[0.0] * 3, [1.0] * 3, [0.5, 1.0, 0.0]]):
        runs = module.simulate_many(0.1, initial)
        assert (runs.status != 0).tolist() == [True, False, False]
        assert np.isnan(runs.x[:, 0]).all()
        assert "brake_closed is 1 while brake is closed" in runs.failures()[0].message
    m.event("kick", "t - 0.1", reset={"brake_closed": 0.5})
    refuses("EG-EVENT events.kick.reset.brake_closed 1 0", m.compile, target="numpy")


def test_slopes_by_what_a_closed_constraint_forbids_are_refused() -> None:
    """s = r is closed, and the event moves s by k: fine for k = 0, and for no k beside it."""

    def moved(reset: dict[str, Any]) -> Any:
        m = sliders(reset, False)
        m.parameter("k", 0.0)
        return m.compile(target="numpy")

    with refused("EG-NO-DERIVATIVE kick k"):
        moved({"s": "s + k"}).sensitivities(["k"], 1.0, {"s_dot": 1.0, "r_dot": 1.0})
    both = moved({"s": "s + k", "r": "r + k"}).sensitivities(["k"], 1.0, {"s_dot": 1.0, "r_dot": 1.0})
    assert both.dx[:2, 0, -1] == pytest.approx([1.0, 1.0], abs=1e-6)


@pytest.mark.parametrize(("target", "rate"), [("numpy", 10), pytest.param("cython", 100, marks=pytest.mark.thorough)])
def test_what_is_closed_holds_between_steps(target: str, rate: float) -> None:
    """A clutch with one degree of freedom left, w' = -c (w - w1): long steps once let rounding grow within them."""
    m = eg.Model("clutch")
    a, b = m.body("a", mass=1, inertia={"zz": 0.3}), m.body("b", mass=1, inertia={"zz": 0.5})
    m.revolute("ja", m.ground, a)
    m.revolute("jb", m.ground, b)
    m.coupling("cl", equation="ja_dot - 1.3*jb_dot", opens="100 - t", stabilisation=rate)
    m.joint_damper("d", "jb", damping=0.2)
    m.parameter("T", 0.5)
    m.torque("mot", "ja", "T")
    module, times = m.compile(target=target), np.linspace(0, 20, 301)
    start = {"ja_dot": 2.6, "jb_dot": 2.0}
    final, c = 1.3 * 0.5 / 0.2, 0.2 / (0.3 * 1.69 + 0.5)
    run = module.simulate(20.0, start, t_eval=times, rtol=1e-6, atol=1e-8)
    assert run["jb_dot"] == pytest.approx(final + (2 - final) * np.exp(-c * times), abs=1e-8)
    many = module.simulate_many(20.0, {name: [x, x] for name, x in start.items()}, t_eval=times, rtol=1e-6, atol=1e-8)
    assert many["jb_dot"][:, 0] == pytest.approx(run["jb_dot"], abs=1e-8)
    slopes = module.sensitivities(["T"], 20.0, start, t_eval=times)
    assert slopes["jb_dot", "T"] == pytest.approx(1.3 / 0.2 * (1 - np.exp(-c * times)), abs=1e-6)
    steps, free = (np.diff(module.simulate(20.0, start, rtol=1e-6, **one).t) for one in ({}, {"max_step": 5.0}))
    assert steps.max() <= 2.5 / rate * (1 + 1e-9) < free.max()
    implicit = module.simulate(20.0, start, method="LSODA", rtol=1e-6)
    assert np.diff(implicit.t).max() > 2.5 / rate
    own = (module.sensitivities(["T"], 20.0, start, **one).t for one in ({}, {"max_step": None}))
    assert np.array_equal(*own)
