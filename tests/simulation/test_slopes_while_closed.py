"""Sensitivities through impacts while constraints are closed for a time, and how exactly these hold between steps."""

from __future__ import annotations

import numpy as np
import pytest

import eomgen as eg

TIGHT = {"rtol": 1e-11, "atol": 1e-13}


def arm(kind: str) -> eg.Model:
    """An arm of two links, the second held by a constraint for a time, whose tip hits a floor."""
    m = eg.Model("arm", gravity=(0, -9.81, 0))
    m.parameter("h", 1.0)
    m.parameter("k", 0.5)
    a = m.body("a", mass="1 + k/5", com=(0.5, 0, 0), inertia={"zz": 0.1})
    b = m.body("b", mass=2.0, com=(0.3, 0, 0), inertia={"zz": 0.2}, markers={"tip": (0.6, 0, 0)})
    m.revolute("th", m.ground, a)
    m.revolute("q", a.at(1, 0, 0), b)
    m.initial(th=0.1)
    if kind == "lock":
        m.lock("l", "q", opens="100 - t")
    elif kind == "curve":
        m.coupling("l", equation="q - k*sin(th)/(1 + t)", opens="100 - t")
        m.initial({"q": "k*sin(0.1)", "q_dot": "-k*sin(0.1)"})
    else:
        m.coupling("l", equation="q_dot - k*sin(th)*th_dot - t", opens="100 - t")
    m.event("floor", "y(b.tip) + h", restitution=0.4)
    return m


@pytest.mark.parametrize("kind", ["lock", "curve", "rate"])
def test_slopes_through_an_impact_are_those_of_runs(kind: str) -> None:
    module = arm(kind).compile(target="numpy")
    found = module.sensitivities(["h", "k"], 0.75, **TIGHT)
    assert len(module.simulate(0.75).t_events["floor"]) == 1
    for k, (name, value) in enumerate((("h", 1.0), ("k", 0.5))):
        ends = [module.simulate(0.75, parameters={name: value + d}, **TIGHT).x[:4, -1] for d in (1e-5, -1e-5)]
        assert found.dx[:4, k, -1] == pytest.approx((ends[0] - ends[1]) / 2e-5, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("target", ["numpy", "cython"])
@pytest.mark.parametrize("rate", [10, 100])
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
