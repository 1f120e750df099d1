"""Pairs that are near: found along an axis as among all, to the bit, with work that grows with the near ones."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from contact_scenes import LAW

import eomgen as eg
from eomgen.emit import c_pairs
from eomgen.graph.pair_calls import PairCall
from eomgen.numeric import pair_sums


def spread(circles: int, segments: int, tilt: float = 0.0) -> eg.Model:
    """Circles along a line on segments on the ground, all of them on one body that moves."""
    m = eg.Model("spread", gravity=(0, -9.81, 0))
    body = m.body("b", mass=1.0, inertia=(1.0, 1.0, 1.0))
    m.free("j", m.ground, body) if tilt else m.planar("j", m.ground, body)
    group = {"shape": "circle", "on": [body.at(0.25 * k, 0.02 * (k % 3), 0) for k in range(circles)], "radius": 0.1}
    steps = [m.ground.at(0.25 * circles / segments * k, -0.09, 0, rpy=(0, 0, 0.3 * (k % 2))) for k in range(segments)]
    m.contacts("touch", group, {"shape": "segment", "on": steps, "length": 0.2, "radius": 0.01}, LAW)
    return m


def sum_of(m: eg.Model) -> Any:
    """The sum over pairs of a model, and the operands at a state as the evaluator of the graph has them."""
    graph = m.derive().kinematics.graph
    return next(c.function for c, _ in graph.calls.values() if isinstance(c, PairCall) and c.part == "sum")


def given_at(function: Any, x: float, y: float) -> list[float]:
    """Poses of ground and of a body at (x, y) that moves, and the data."""
    still = [0.0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0]
    moving = [x, y, *still[2:12], 0.3, -0.2, 0, 0, 0, 0.5]
    return [float(v) for v in (*still, *moving, *(0.0 if d is None else d for d in function.data))]


def test_work_grows_with_near_pairs() -> None:
    """Exact counts: each of n circles is tested against the few segments about it, not against all."""
    tested = []
    for n in (40, 80, 160, 320):
        function = sum_of(spread(n, n))
        loops, given = function.in_floats, given_at(function, 0.03, 0.0)
        counts = loops.counts(given)
        tested.append(sum(tests for tests, _ in counts))
        assert sum(near for _, near in counts) <= tested[-1] < 12 * n
    growth = np.diff(np.log(tested)) / np.log(2.0)
    assert np.all(growth < 1.05)


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_as_all_pairs_to_the_bit(target: str, monkeypatch: pytest.MonkeyPatch) -> None:
    sorted_out = spread(40, 40).compile(target=target)
    rng, states = np.random.default_rng(4), []
    for _ in range(60):
        states.append(np.concatenate([rng.uniform(-1, 1, 2) * [3.0, 0.04], rng.uniform(-3, 3, 4) * [1e-2, 1, 1, 1]]))
    found = [(sorted_out.rhs(0.0, x), sorted_out.jacobian(0.0, x)) for x in states]
    for module in (c_pairs, pair_sums):
        monkeypatch.setattr(module, "SORTED", 10**9)
    m = spread(40, 40)
    m.parameter("unused", 1.0)  # another model for the cache
    every = m.compile(target=target)
    touched = 0
    for x, (rates, slopes) in zip(states, found, strict=True):
        touched += abs(rates[4] + 9.81) > 1e-9
        assert np.array_equal(every.rhs(0.0, x), rates)
        assert np.array_equal(every.jacobian(0.0, x), slopes)
    assert touched > 20


def test_times_of_meeting_as_of_all_pairs() -> None:
    """Shapes that are too far to meet before others are left out in C; NumPy looks at all."""
    mods = [spread(40, 40).compile(target=target) for target in ("numpy", "cython")]
    rng, ended = np.random.default_rng(5), 0
    for k in range(60):
        q, v, a = rng.uniform(-1, 1, 3) * [3.0, 0.2, 1e-2], rng.uniform(-3, 3, 3), rng.uniform(-9, 9, 3)
        v, a = v * (k % 4 > 0), a * (k % 8 > 3)
        found = [mod.kernels.motion("meeting_time")(q, v, a) for mod in mods]
        ended += found[0][0] < 1e200
        assert np.allclose(*found, rtol=1e-11)
    assert 30 < ended < 60


def test_bodies_that_tilt_and_states_that_are_no_numbers() -> None:
    """Axes that are not across z of the first shapes are left out; what is not a number is not lost."""
    mods = [spread(20, 20, tilt=1.0).compile(target=target) for target in ("numpy", "cython")]
    rng = np.random.default_rng(7)
    for _ in range(20):
        x = mods[0].x0() + 0.02 * rng.standard_normal(mods[0].n_x)
        rates = [mod.rhs(0.0, x) for mod in mods]
        assert np.allclose(*rates, rtol=1e-11, atol=1e-9)
    function = sum_of(spread(20, 20))
    given = given_at(function, np.nan, 0.0)
    assert np.isnan(function.in_floats(given)).any()
