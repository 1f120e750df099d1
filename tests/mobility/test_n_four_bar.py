"""The N-four-bar mechanism (IFToMM A02): a chain of loops through its change points; work grows linearly.

Source: tests/reference/iftomm_A02_n_four_bar.json (N = 2); for any N the parallelogram's own equation of one variable,
[(N+1)/3 + N] theta'' = -g [(N+1)/2 + N] cos(theta).  The library's specification (lim.ii.udc.es/mbsbenchmark, A02)
allows errors of 1e-3 of the position of the first tip, with N = 40 and 20 s.
"""

from __future__ import annotations

import models
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import eomgen as eg
from benchmarks.linkages import n_four_bar
from eomgen import pipeline
from eomgen.errors import PartitionError

HIGH_PRECISION = 1e-3


def tip(n: int, times: np.ndarray) -> np.ndarray:
    """x and y of the first crank's tip, and the mechanism's theta rate, by the closed equation."""
    slope = 9.81 * ((n + 1) / 2 + n) / ((n + 1) / 3 + n)
    found = solve_ivp(
        lambda t, y: [y[1], -slope * np.cos(y[0])],
        (0, times[-1]),
        [np.pi / 2, -1.0],
        method="DOP853",
        t_eval=times,
        rtol=3e-14,
        atol=1e-15,
    )
    return np.array([np.cos(found.y[0]), np.sin(found.y[0]), found.y[1]])


def test_the_published_motion_of_two_loops() -> None:
    published = models.reference("iftomm_A02_n_four_bar")["reference_B0_xy"]["N2"]
    times = np.array(sorted(float(t) for t in published if t != "period"))
    expected = np.array([[float(x) for x in published[f"{t:g}"]] for t in times]).T
    np.testing.assert_allclose(tip(2, times)[:2], expected, atol=1e-10)  # the equation of one variable is the same
    run = n_four_bar(2).compile(independent=["theta0"]).simulate((0, 10), t_eval=times, rtol=1e-10, atol=1e-12)
    assert np.abs(run["x"] - expected[0]).max() <= 1e-5
    assert np.abs(run["y"] - expected[1]).max() <= 1e-5


@pytest.mark.parametrize("n", [1, 5, pytest.param(40, marks=pytest.mark.slow)])
def test_a_chain_of_any_length_goes_through_its_flat_position(n: int) -> None:
    mod = n_four_bar(n).compile(independent=["theta0"])
    run = mod.simulate((0, 10))
    x, y, rate = tip(n, run.t)
    assert np.abs(run["x"] - x).max() <= HIGH_PRECISION
    assert np.abs(run["y"] - y).max() <= HIGH_PRECISION
    assert np.count_nonzero(np.diff(np.sign(y))) == 10  # flat ten times
    energy = np.sum(mod.energy(run.x), axis=0)
    assert np.ptp(energy) <= 1e-4 * np.max(mod.energy(run.x)[0])
    assert run.residuals.position <= 1e-12
    assert run.residuals.velocity <= 1e-10 * np.abs(rate).max()
    cranks = np.array([run[f"theta{k}"] for k in range(n + 1)])
    assert np.abs(cranks - cranks[0]).max() <= 1e-5  # it stays a row of parallelograms


@pytest.mark.parametrize("n", [10, pytest.param(40, marks=pytest.mark.slow)])
def test_tight_tolerances_do_not_make_steps_crawl_at_the_flat_position(n: int) -> None:
    """Steps start on the constraints, and a state that is on them to rounding is not moved by that rounding."""
    run = n_four_bar(n).compile(independent=["theta0"]).simulate((0, 10), rtol=1e-10, atol=1e-12)
    assert len(run.t) <= 400  # 142 are taken; of 10 loops 2,129 were
    x, y, _ = tip(n, run.t)
    assert max(np.abs(run["x"] - x).max(), np.abs(run["y"] - y).max()) <= 1e-4
    assert np.ptp(run["energy"]) <= 1e-6 * run["T"].max()
    assert max(run.residuals.position, run.residuals.velocity) <= 1e-10


def operations(n: int) -> dict[str, int]:
    """Multiplications, additions and divisions of what a call of the right-hand side runs."""
    program = pipeline.build(n_four_bar(n).derive(independent=["theta0"]), "c", ["rhs"])
    counted = program.counts
    return {
        name: counted[name].multiplications + counted[name].additions + counted[name].divisions
        for name in ("closing", "dynamics")
    }


def test_the_work_of_a_loop_does_not_grow_with_the_number_of_loops() -> None:
    found = {n: operations(n) for n in (5, 10, 20, 40)}
    for part in ("closing", "dynamics"):
        per_loop = [(found[2 * n][part] - found[n][part]) / n for n in (5, 10, 20)]
        assert max(per_loop) <= 1.02 * min(per_loop), part
    assert sum(found[40].values()) <= 40 * 705


def test_a_state_with_more_freedoms_at_once_is_named() -> None:
    """Exactly flat, n + 1 freedoms are free at once: no accelerations of one freedom are made up."""
    mod = n_four_bar(3).compile(independent=["theta0"])
    with pytest.raises(PartitionError, match="theta0"):
        mod.rhs(0.0, np.zeros(mod.n_x))


def test_loops_stay_short_in_the_spanning_tree() -> None:
    """Three coordinates a loop, each shared with the neighbours at most, also where no coordinate has a name."""
    from eomgen.kinematics.kinematics import analyse

    def pattern(named: bool) -> list[int]:
        m = eg.Model("row", gravity=(0, -9.81, 0))
        cranks = [m.body(f"crank{k}", mass=1, inertia={"zz": 1}) for k in range(6)]
        for k in range(1, 6):  # couplers first: in order of declaration the tree would be one long chain
            coupler = m.body(f"coupler{k}", mass=1, inertia={"zz": 1})
            m.revolute(f"B{k}", cranks[k - 1].at(1, 0, 0), coupler)
            m.revolute(f"C{k}", coupler.at(1, 0, 0), cranks[k].at(1, 0, 0))
        for k, crank in enumerate(cranks):
            m.revolute(f"A{k}", m.ground.at(k, 0, 0), crank, **({"coordinate": f"theta{k}"} if named else {}))
        rows = analyse(m.mechanism()).constraints.jacobian
        return [sum(not x.is_zero for x in row) for row in rows]

    assert pattern(named=True) == [3] * 10
    assert pattern(named=False) == [3] * 10
