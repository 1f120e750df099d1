"""Calls that once gave wrong numbers or bare errors, judged by closed forms and by the calls themselves."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eomgen as eg
from eomgen.errors import EomgenError, UsageError


def pendulum(law: str = "-k*th") -> Any:
    m = eg.Model("pendulum", gravity=(0, -9.81, 0))
    m.parameter("k", 2.0)
    m.revolute("R", m.ground, m.body("b", mass=1.0, com=(0, -1, 0)), coordinate="th")
    m.torque("T", "R", law)
    return m.compile(target="numpy")


def driven() -> Any:
    m = eg.Model("driven")
    m.revolute("A", m.ground, m.body("a", mass=1, inertia=(1, 1, 1)), coordinate="th")
    m.driver("d", "th", "2*pi*t")
    return m.compile(target="numpy")


@pytest.mark.parametrize("law", ["u1*u2", "u1 + sin(u2)"])
def test_inputs_that_forces_are_not_linear_in_are_refused(law: str) -> None:
    m = eg.Model("two", gravity=(0, -9.81, 0))
    m.input("u1", 0.5)
    m.input("u2", 2.0)
    m.revolute("R", m.ground, m.body("b", mass=1.0, com=(0, -1, 0)), coordinate="th")
    m.torque("T", "R", law)
    mod = m.compile(target="numpy")
    x = mod.x0(th=0.2)
    with pytest.raises(UsageError, match="not linear in the input"):
        mod.actuator_forces(0.0, x, {"th": 1.0}, actuated=["u1", "u2"])
    alone = mod.actuator_forces(0.0, x, {"th": 1.0}, actuated=["u1"])
    assert mod.rhs(0.0, x, u=[alone["u1"], 2.0])[1] == pytest.approx(1.0, abs=1e-12)


def test_drives_of_a_small_loop_do_not_feel_a_large_one() -> None:
    """Two four-bars of sizes 1 and 1e-3 in one model: torques are those of each alone."""

    def add(m: Any, tag: str, L: float) -> None:
        mass = 10.0 * L**3
        a, b, c = (m.body(n + tag, mass=mass, com=(0.3 * L, 0, 0), inertia={"zz": mass * L * L / 10}) for n in "abc")
        m.revolute("A" + tag, m.ground, a, coordinate="th" + tag)
        m.revolute("B" + tag, a.at(0.4 * L, 0, 0), b, coordinate="be" + tag)
        m.revolute("D" + tag, m.ground.at(L, 0, 0), c, coordinate="ps" + tag)
        m.revolute("C" + tag, b.at(0.9 * L, 0, 0), c.at(0.8 * L, 0, 0))
        m.guess(**{"th" + tag: 1.0, "be" + tag: -0.8, "ps" + tag: 1.8})

    def make(*loops: tuple[str, float]) -> Any:
        m = eg.Model("loops", gravity=(0, -9.81, 0))
        for tag, size in loops:
            add(m, tag, size)
        return m.compile(target="numpy", independent=["th" + tag for tag, _ in loops])

    L = 1e-3
    both, small, large = make(("1", 1.0), ("2", L)), make(("2", L)), make(("1", 1.0))
    start = {"th1": 1.0, "th2": 0.8, "th1_dot": 2.0, "th2_dot": 3.0}
    one = both.actuator_forces(0.0, both.x0(start), {"th1": 1.0, "th2": 2.0})
    two = small.actuator_forces(0.0, small.x0(th2=0.8, th2_dot=3.0), {"th2": 2.0})
    three = large.actuator_forces(0.0, large.x0(th1=1.0, th1_dot=2.0), {"th1": 1.0})
    assert one["th2"] == pytest.approx(two["th2"], rel=1e-7)
    assert one["th1"] == pytest.approx(three["th1"], rel=1e-9)


def test_an_event_at_a_stored_time_is_one_event() -> None:
    mod = driven()
    middle: Any = lambda t, x: t - 0.5  # noqa: E731
    assert mod.simulate(1.0, events=[middle]).t_events[0].tolist() == pytest.approx([0.5])
    middle.terminal = 2
    assert mod.simulate(1.0, events=[middle]).t[-1] == 1.0
    half = mod.simulate(1.75, events=[lambda t, x: np.sin(x[0])])  # th = 2 pi t: a zero each half second, the start too
    assert half.t_events[0] == pytest.approx(np.arange(4) / 2.0, abs=1e-9)


@pytest.mark.parametrize("t", [[0.0], [0.5], [0.0, 0.0, 0.0]])
def test_a_driven_mechanism_at_a_single_time(t: list[float]) -> None:
    found = driven().kinematic_analysis(t=t)
    np.testing.assert_allclose(found["th"], 2 * np.pi * np.array(t), atol=1e-12)
    np.testing.assert_allclose(found["th_dot"], 2 * np.pi, rtol=1e-12)


def test_parameters_by_name_serve_multipliers_and_reactions() -> None:
    mod = pendulum()
    x = mod.x0(th=0.3, th_dot=0.2)
    bound = mod.bind(p={"k": 1.0})
    np.testing.assert_array_equal(mod.reactions(0.0, x, p={"k": 1.0}), bound.reactions(0.0, x))
    assert np.abs(mod.reactions(0.0, x) - bound.reactions(0.0, x)).max() > 1e-3
    assert mod.multipliers(0.0, x, p={"k": 1.0}).shape == (0,)
    with pytest.raises(UsageError, match="kk"):
        mod.reactions(0.0, x, p={"kk": 1.0})


def test_times_and_rates_that_are_no_numbers_are_named() -> None:
    mod = pendulum()
    x = mod.x0(th=0.3)
    calls = [
        lambda: mod.reactions("a", x),
        lambda: mod.linearize(x, "a"),
        lambda: mod.modes(x, "a"),
        lambda: mod.equilibrium(t="a"),
        lambda: mod.consistent(x, "a"),
        lambda: mod.actuator_forces("a", x),
    ]
    for call in calls:
        with pytest.raises(UsageError, match="^t must be a number"):
            call()
    with pytest.raises(UsageError, match="^th_dot must hold real numbers, not"):
        mod.kinematic_analysis(th=[0.0, 1.0], th_dot="a")


def test_ranges_of_a_thousand_turns_are_walked_and_of_a_million_refused() -> None:
    with pytest.raises(UsageError, match=r"159155 turns"):
        pendulum().kinematic_analysis(th=[0.0, 1e6])


def test_a_file_stays_where_saving_fails(tmp_path: Path) -> None:
    file = tmp_path / "model.yaml"
    m = eg.Model("saved")
    b = m.body("b", mass=1)
    m.prismatic("x", m.ground, b, axis="x")
    m.save(file)
    before = file.read_text()
    m.output("a", b.at(1, 0, 0).acceleration[0])  # an unnamed marker has no name to write
    try:
        m.save(file)
    except EomgenError:
        assert file.read_text() == before
    else:
        assert "a" in eg.load(file).compile(target="numpy").y_names


def test_the_mass_metric_copes_with_masses_of_all_sizes() -> None:
    """Masses of 1e-4 to 1e3: the position found is on the loop, and nearest: the change is M-orthogonal to motions."""
    m = eg.Model("uneven")
    sizes = {"a": 1e3, "b": 1e-4, "c": 1.0}
    a, b, c = (m.body(n, mass=w, com=(0.3, 0, 0), inertia={"zz": 0.01 * w}) for n, w in sizes.items())
    m.revolute("A", m.ground, a, coordinate="th")
    m.revolute("B", a.at(0.4, 0, 0), b, coordinate="be")
    m.revolute("D", m.ground.at(1, 0, 0), c, coordinate="ps")
    m.revolute("C", b.at(0.9, 0, 0), c.at(0.8, 0, 0))
    m.guess(th=1.0, be=-0.8, ps=1.8)
    mod = m.compile(target="numpy")
    n, start = mod.n_q, mod.x0(th=1.0, th_dot=2.0)
    for seed in range(4):
        x = start + 0.05 * np.random.default_rng(seed).normal(size=mod.n_x)
        y = mod.consistent(x, weights="mass")
        assert np.abs(mod.constraints(y[:n], rows="all")).max() < 1e-10
        J = mod.constraint_jacobian(y[:n], rows="all")
        assert np.abs(J @ y[n:]).max() < 1e-10
        free = np.linalg.svd(J)[2][len(J) :].T
        M = mod.mass_matrix(y[:n])
        work = free.T @ M @ (y[n:] - x[n:])
        assert np.abs(work).max() < 1e-8 * np.abs(M).max() * np.abs(y[n:] - x[n:]).max()


def test_sensitivities_of_a_stabilised_model_are_refused_as_other_analyses() -> None:
    m = eg.Model("stabilised", gravity=(0, -9.81, 0))
    a, b = m.body("a", mass=1.0, com=(0.5, 0, 0)), m.body("b", mass=m.parameter("w", 1.0))
    m.revolute("A", m.ground, a, coordinate="th")
    m.revolute("B", a.at(1, 0, 0), b)
    c = m.body("c", mass=1.0)
    m.revolute("C", b.at(2, 0, 0), c)
    m.prismatic("D", m.ground, c, axis="x", coordinate="s")
    m.guess(s=2.5)
    m.initial(th=0.3)
    mod = m.compile("augmented", target="numpy", baumgarte=(5.0, 5.0))
    with pytest.raises(UsageError, match="derive without baumgarte for analyses"):
        mod.sensitivities(["w"], 0.1)
