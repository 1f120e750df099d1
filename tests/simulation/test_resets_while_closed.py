"""Events that give new values while constraints are closed: as if these held always; contradictions are refused.

The judges are the same models with the constraint for good, and closed forms of plastic impacts.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import eomgen as eg
from eomgen.errors import EvaluationError, ModelError, NoDerivativeError, SimulationError, UsageError

TARGETS = ("numpy", "cython")


def sliders(reset: dict[str, Any], for_good: bool, masses: tuple[float, float] = (1.0, 3.0), ratio: float = 1.0) -> Any:
    """Two sliders with s = ratio * r, which an event kicks at 0.5 s."""
    m = eg.Model("sliders", gravity=(0, 0, 0))
    a, b = (m.body(name, mass=mass) for name, mass in zip("ab", masses, strict=True))
    m.prismatic("A", m.ground, a, axis="x", coordinate="s")
    m.prismatic("B", m.ground, b, axis="x", coordinate="r")
    m.coupling("c", {"s": 1, "r": -ratio}, **({} if for_good else {"opens": "100 - t"}))
    m.event("kick", "t - 0.5", direction=1, reset=reset)
    return m


def arm(for_good: bool, kick: dict[str, Any]) -> eg.Model:
    """A body in the plane whose pin sits on a slide that is closed for a time, or for good."""
    m = eg.Model("arm", gravity=(0, -9.81, 0))
    body = m.body("body", mass=2.0, inertia={"zz": 0.3}, com=(0.4, 0, 0))
    m.planar("P", m.ground, body)
    own = {} if for_good else {"opens": "100 - t"}
    m.coupling("rail", equation="y(body.pin) - 0.5*x(body.pin)", **own)
    body.marker("pin", at=(-0.2, 0.1, 0))
    m.event("kick", "t - 0.3", direction=1, reset=kick)
    m.initial(P_x=0.2, P_y=-0.1 + 0.5 * 0.0, P_3=0.0)
    return m


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("masses", [(1.0, 1.0), (1.0, 3.0)])
@pytest.mark.parametrize("ratio", [1.0, -2.5])
def test_new_velocities_are_brought_onto_a_closed_constraint_as_onto_one_for_good(
    target: str, masses: tuple[float, float], ratio: float
) -> None:
    reset = {"s_dot": "2 + s"}
    mine, judge = (sliders(reset, g, masses, ratio).compile(target=target).simulate(1.0) for g in (False, True))
    assert mine.x[:4, -1] == pytest.approx(judge.x[:, -1], abs=1e-9)
    assert mine["s_dot"][-1] == pytest.approx(2.0 * ratio**2 / (1.0 + ratio**2), abs=1e-9)


@pytest.mark.parametrize("method", ["DOP853", "Radau", "RK4", "LSODA"])
def test_every_integrator_does_so(method: str) -> None:
    more = {"step": 1e-2} if method == "RK4" else {}
    run = sliders({"s_dot": 2}, False).compile().simulate(1.0, method=method, **more)
    assert run.x[:4, -1] == pytest.approx([0.5, 0.5, 1.0, 1.0], abs=1e-6)


def test_many_runs_and_their_slopes_do_so() -> None:
    m = sliders({"s_dot": "k"}, False)
    m.parameter("k", 2.0)
    module = m.compile()
    ends = module.simulate_many(1.0, parameters={"k": [1.0, 2.0, 4.0]}).x
    assert ends[:4] == pytest.approx(np.outer([0.25, 0.25, 0.5, 0.5], [1.0, 2.0, 4.0]), abs=1e-9)
    slopes = module.sensitivities(["k"], 1.0).dx[:4, 0, -1]
    assert slopes == pytest.approx([0.25, 0.25, 0.5, 0.5], abs=1e-6)


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("kick", [{"P_3_dot": 4}, {"P_x_dot": 1, "P_y_dot": -1}, {"P_y_dot": "-P_y_dot"}])
def test_a_slide_of_a_body_in_the_plane(target: str, kick: dict[str, Any]) -> None:
    module, judge = arm(False, kick).compile(target=target), arm(True, kick).compile(target=target)
    x = judge.x0(P_3_dot=0.7)
    start = dict(zip(judge.x_names, x.tolist(), strict=True))
    after = [one.simulate(0.3000001, start, rtol=1e-11, atol=1e-13).x[3:6, -1] for one in (module, judge)]
    assert after[0] == pytest.approx(after[1], abs=2e-6)
    assert np.abs(after[0] - module.simulate(0.29, start).x[3:6, -1]).max() > 0.1  # the kick is felt


def test_other_values_are_not_touched() -> None:
    """A reset of what no closed constraint speaks of stays as it is written, errors that die away too."""
    m = eg.Model("free", gravity=(0, 0, 0))
    for name in "abc":
        m.prismatic(name.upper(), m.ground, m.body(name, mass=1.0), axis="x", coordinate=name + "_s")
    m.coupling("pair", {"a_s": 1, "b_s": -1}, closes="0.2 - t")
    m.event("kick", "t - 0.5", direction=1, reset={"c_s": 7, "c_s_dot": -1})
    run = m.compile(target="numpy").simulate(1.0, {"a_s_dot": 1.0})  # closes 0.2 m apart
    assert run["c_s"][-1] == pytest.approx(6.5, abs=1e-9)
    assert run["a_s_dot"][-1] + run["b_s_dot"][-1] == pytest.approx(1.0, abs=1e-9)


def test_a_lock_keeps_its_coordinate_where_a_reset_puts_it() -> None:
    m = eg.Model("locked", gravity=(0, -9.81, 0))
    body = m.body("body", mass=1.0, inertia={"zz": 0.1}, com=(0.5, 0, 0))
    m.revolute("A", m.ground, body, axis="z", coordinate="theta")
    m.lock("brake", "A", opens="100 - t")
    m.event("kick", "t - 0.5", direction=1, reset={"theta": 1, "theta_dot": 3})
    run = m.compile(target="numpy").simulate(2.0)
    assert run["theta"][-1] == pytest.approx(1.0, abs=1e-12)
    assert run["theta_dot"][-1] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("target", TARGETS)
def test_positions_that_a_closed_equation_does_not_have_are_refused(target: str) -> None:
    """Those onto which the mechanism would be moved are not told from those that the user wants."""
    with pytest.raises(SimulationError, match=r"at event kick: resets at t = 0\.5.*contradict what is closed \(c\)"):
        sliders({"s": 0.3}, False).compile(target=target).simulate(1.0)
    run = sliders({"s": 0.3, "r": 0.3, "s_dot": 1}, False).compile(target=target).simulate(1.0)
    assert run.x[:4, -1] == pytest.approx([0.55, 0.55, 0.5, 0.5], abs=1e-9)


@pytest.mark.parametrize("target", TARGETS)
def test_velocities_obey_loops_and_what_is_closed(target: str) -> None:
    """A slider-crank whose block drags another by a clutch: as if the clutch were there for good."""

    def make(for_good: bool) -> eg.Model:
        m = eg.Model("dragged", gravity=(0, -9.81, 0))
        crank = m.body("crank", mass=1.0, inertia={"zz": 0.01}, com=(0.1, 0, 0))
        rod = m.body("rod", mass=1.0, inertia={"zz": 0.02}, com=(0.25, 0, 0))
        block, other = m.body("block", mass=1.0), m.body("other", mass=2.0)
        m.revolute("A", m.ground, crank, axis="z", coordinate="theta")
        m.revolute("B", crank.at(0.2, 0, 0), rod, axis="z", coordinate="phi")
        m.prismatic("C", m.ground, block, axis="x", coordinate="s")
        m.revolute("D", rod.at(0.5, 0, 0), block, axis="z", coordinate="psi")
        m.prismatic("E", m.ground, other, axis="x", coordinate="r")
        m.coupling("clutch", equation="vx(block) - r_dot", **({} if for_good else {"opens": "100 - t"}))
        m.event("kick", "t - 0.2", direction=1, reset={"theta_dot": "theta_dot + 3"})
        m.guess(phi=-0.2, s=0.65)
        m.initial(theta=0.4, theta_dot=1.0)
        return m

    mine, judge = make(False).compile(target=target), make(True).compile(target=target)
    x = judge.x0()
    start = dict(zip(judge.x_names, x.tolist(), strict=True))
    found = [one.simulate(0.4, start, rtol=1e-10, atol=1e-12) for one in (mine, judge)]
    assert found[0].x[: len(x), -1] == pytest.approx(found[1].x[:, -1], abs=1e-6)


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("against", ["driver", "coupling", "closed"])
def test_a_constraint_that_closes_against_another_is_refused(target: str, against: str) -> None:
    m = eg.Model("against", gravity=(0, 0, 0))
    for name in "ab":
        m.prismatic(name.upper(), m.ground, m.body(name, mass=1.0), axis="x", coordinate=name + "_s")
    if against == "driver":
        m.driver("d", "a_s", "t")
    else:
        m.coupling("d", equation="a_s_dot - 1", **({"closes": "0.2 - t"} if against == "closed" else {}))
    m.lock("brake", "A", closes="0.5 - t")
    module = m.compile(target=target)
    with pytest.raises(SimulationError, match=r"t = 0\.5.*contradict what is closed \(.*\), closes or holds always"):
        module.simulate(1.0)
    assert module.simulate(0.4)["a_s_dot"][-1] == pytest.approx(1.0, abs=1e-9)


def test_one_that_demands_the_same_closes() -> None:
    m = eg.Model("same", gravity=(0, 0, 0))
    for name, mass in (("a", 1.0), ("b", 2.0)):
        m.prismatic(name.upper(), m.ground, m.body(name, mass=mass), axis="x", coordinate=name + "_s")
    m.coupling("first", equation="a_s_dot - b_s_dot", closes="0.2 - t")
    m.coupling("again", equation="2*b_s_dot - 2*a_s_dot", closes="0.5 - t")
    run = m.compile(target="numpy").simulate(1.0, {"a_s_dot": 3.0})
    assert run.x[2:4, -1] == pytest.approx([1.0, 1.0], abs=1e-9)


def test_states_of_constraints_are_0_or_1() -> None:
    m = eg.Model("half", gravity=(0, 0, 0))
    m.prismatic("A", m.ground, m.body("a", mass=1.0), axis="x", coordinate="s")
    m.lock("brake", "A", opens="0.2 - t")
    with pytest.raises(UsageError, match="brake_closed is 1 while brake is closed and 0 while it is open, not 0.5"):
        m.compile(target="numpy").simulate(0.1, {"brake_closed": 0.5})
    module = m.compile(target="numpy")
    for start in (module.minimal.x0, module.equilibrium):
        with pytest.raises(UsageError, match="brake_closed is 1 while brake is closed and 0 while it is open, not 0.3"):
            start({"brake_closed": 0.3})
        start({"brake_closed": 0})
    for initial in ({"s_dot": 1.0, "brake_closed": [0.5, 1.0, 0.0]}, [[0.0] * 3, [1.0] * 3, [0.5, 1.0, 0.0]]):
        runs = module.simulate_many(0.1, initial)
        assert (runs.status != 0).tolist() == [True, False, False]
        assert np.isnan(runs.x[:, 0]).all()
        assert "brake_closed is 1 while brake is closed" in runs.failures()[0].message
    m.event("kick", "t - 0.1", reset={"brake_closed": 0.5})
    with pytest.raises(ModelError, match=r"events.kick.reset.brake_closed.*give 1 to close the constraint, 0 to open"):
        m.compile(target="numpy")


def test_a_counter_of_samples_is_not_reset() -> None:
    m = eg.Model("sampled", gravity=(0, 0, 0))
    m.prismatic("A", m.ground, m.body("a", mass=1.0), axis="x", coordinate="s")
    m.sampled("k", "s", period=0.1)
    counter = m.compile(target="numpy").x_names[-1]
    m.event("kick", "t - 0.35", reset={counter: 10})
    with pytest.raises(ModelError, match=rf"events.kick.reset.{counter}.*counts samples"):
        m.compile(target="numpy")


@pytest.mark.parametrize("target", TARGETS)
def test_positions_are_refused_at_rest_too(target: str) -> None:
    """Where new velocities are 0, whatever they are divided by."""
    module = sliders({"s": "s + 1", "s_dot": 0, "r_dot": 0}, False).compile(target=target)
    with pytest.raises(SimulationError, match="contradict what is closed"):
        module.simulate(1.0, {"s_dot": 1.0, "r_dot": 1.0})


def dragged(count: int, kick: dict[str, Any], **clutch: str) -> eg.Model:
    """Slider-cranks, of which the first drags a sledge by a clutch."""
    m = eg.Model("dragged", gravity=(0, -9.81, 0))
    for k in range(count):
        crank = m.body(f"crank{k}", mass=1.0, inertia={"zz": 0.01}, com=(0.1, 0, 0))
        rod = m.body(f"rod{k}", mass=1.0, inertia={"zz": 0.02}, com=(0.25, 0, 0))
        block = m.body(f"block{k}", mass=1.0)
        m.revolute(f"A{k}", m.ground.at(0, 2 * k, 0), crank, axis="z", coordinate=f"theta{k}")
        m.revolute(f"B{k}", crank.at(0.2, 0, 0), rod, axis="z", coordinate=f"phi{k}")
        m.prismatic(f"C{k}", m.ground.at(0, 2 * k, 0), block, axis="x", coordinate=f"s{k}")
        m.revolute(f"D{k}", rod.at(0.5, 0, 0), block, axis="z", coordinate=f"psi{k}")
        m.guess({f"phi{k}": -0.2, f"s{k}": 0.65})
        m.initial({f"theta{k}": 0.4, f"theta{k}_dot": 1.0})
    m.prismatic("E", m.ground, m.body("other", mass=2.0), axis="x", coordinate="r")
    m.coupling("clutch", equation="vx(block0) - r_dot", **clutch)
    m.event("kick", "t - 0.2", direction=1, reset=kick)
    return m


def test_a_kick_and_a_clutch_that_closes_at_once() -> None:
    """As the kick by one event and the impact of the clutch by another, right after it."""
    kick, close = {"theta0_dot": "theta0_dot + 3"}, {"clutch_closed": 1}
    at_once = dragged(1, kick | close, closes="100 - t").compile(target="numpy").simulate(0.3)
    m = dragged(1, kick, closes="100 - t")
    m.event("later", "t - 0.2 - 1e-9", direction=1, reset=close)
    one_by_one = m.compile(target="numpy").simulate(0.3)
    assert at_once.x[:, -1] == pytest.approx(one_by_one.x[:, -1], abs=1e-6)
    assert abs(at_once["r_dot"][-1]) > 1e-2


@pytest.mark.parametrize("count", [1, 21])
def test_loops_apart_from_what_is_closed_are_left_to_themselves(count: int) -> None:
    kick = {f"theta{count - 1}_dot": f"0.5*theta{count - 1}_dot"}
    keys: tuple[dict[str, str], ...] = ({"opens": "100 - t"}, {})
    mine, judge = (dragged(count, kick, **one).compile(target="numpy") for one in keys)
    x = judge.x0()
    start = dict(zip(judge.x_names, x.tolist(), strict=True))
    found = [one.simulate(0.3, start).x[: len(x), -1] for one in (mine, judge)]
    assert found[0] == pytest.approx(found[1], abs=1e-5)


def test_slopes_by_what_a_closed_constraint_forbids_are_refused() -> None:
    """s = r is closed, and the event moves s by k: fine for k = 0, and for no k beside it."""

    def moved(reset: dict[str, Any]) -> Any:
        m = sliders(reset, False)
        m.parameter("k", 0.0)
        return m.compile(target="numpy")

    with pytest.raises(NoDerivativeError, match=r"event kick gives positions.*contradict what is closed.*k changes"):
        moved({"s": "s + k"}).sensitivities(["k"], 1.0, {"s_dot": 1.0, "r_dot": 1.0})
    both = moved({"s": "s + k", "r": "r + k"}).sensitivities(["k"], 1.0, {"s_dot": 1.0, "r_dot": 1.0})
    assert both.dx[:2, 0, -1] == pytest.approx([1.0, 1.0], abs=1e-6)


def row_of_cranks(count: int, **clutch: str) -> eg.Model:
    """Slider-cranks whose cranks turn alike, and a slider that the first one drags along."""
    m = dragged(count, {"theta0_dot": "theta0_dot + 3"}, **clutch)
    for k in range(1, count):
        m.coupling(f"alike{k}", equation=f"theta{k}_dot - theta{k - 1}_dot")
    return m


def test_a_kick_is_brought_onto_a_long_row_of_loops() -> None:
    """Of 14 cranks, 55 equations: as with the clutch for good."""
    mine, judge = (row_of_cranks(14, **one).compile(target="numpy") for one in ({"opens": "100 - t"}, {}))
    x = judge.x0()
    start = dict(zip(judge.x_names, x.tolist(), strict=True))
    found, right = (one.simulate(0.3, start) for one in (mine, judge))
    for name in ("r", "r_dot", "theta0_dot", "theta13_dot"):
        assert found[name][-1] == pytest.approx(right[name][-1], abs=1e-6)


def test_a_failed_reset_names_the_event_and_what_is_closed_then() -> None:
    m = sliders({"s_dot": "sqrt(0.1 - t)"}, False)
    m.coupling("other", {"s": 1, "r": -1}, closes="t - 100")
    with pytest.raises(SimulationError, match=r"at event kick: .*contradict what is closed \(c\), closes"):
        m.compile(target="numpy").simulate(1.0)


def test_a_failure_after_a_reset_is_not_put_down_to_it() -> None:
    def late(t: float, x: np.ndarray) -> float:
        if t > 0.7:
            raise EvaluationError("this function fails")
        return 1.0

    module = sliders({"s_dot": 0.5, "r_dot": 0.5}, False).compile(target="numpy")
    with pytest.raises((SimulationError, EvaluationError), match="this function fails") as told:
        module.simulate(1.0, events=late)
    assert "kick" not in str(told.value)
