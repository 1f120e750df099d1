"""Impulses obey constraints that close and open while they are closed: by joints that hold for good."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import eomgen as eg


def rod(kind: str, opens: str = "100-t") -> Any:
    """A rod that swings about a pin at its end, down onto a stop: the pin as a joint, or held for a time."""
    m = eg.Model("rod", gravity=(0, -9.81, 0))
    b = m.body("b", mass=1.0, inertia={"zz": 0.1}, markers={"p": (0.5, 0, 0)})
    if kind == "joint":
        m.revolute("r", m.ground.at(0.5, 0, 0), b.at(0.5, 0, 0))
    else:
        m.planar("j", m.ground, b)
    if kind == "hold":
        m.hold("l", m.ground, "b.p", axes="xy", opens=opens)
    if kind == "couplings":
        m.coupling("lx", equation="x(b.p)-0.5", opens=opens)
        m.coupling("ly", equation="y(b.p)", opens=opens)
    m.event("stop", "y(b)+0.3", restitution=0.5)
    for name, text in {"h": "y(b)+0.3", "x": "x(b)", "y": "y(b)", "w": "wz(b)", "pin": "vy(b.p)"}.items():
        m.output(name, text)
    return m.compile(target="numpy")


@pytest.mark.parametrize("kind", ["hold", "couplings"])
def test_a_held_pin_is_a_joint_in_impacts(kind: str) -> None:
    joint, held = rod("joint"), rod(kind)
    runs = [module.simulate(0.45) for module in (joint, held)]
    assert (np.diff(runs[0].t) == 0.0).sum() == 1
    for name in ("x", "y", "w"):
        assert runs[1][name][-1] == pytest.approx(runs[0][name][-1], abs=1e-7), name
    assert np.abs(runs[1]["pin"]).max() < 1e-6
    runs = [module.simulate_impacts((0, 0.45), gaps={"h": 0.5}) for module in (joint, held)]
    assert runs[1]["w"][-1] == pytest.approx(runs[0]["w"][-1], abs=1e-7)


def test_one_impact_by_its_closed_form() -> None:
    """About the pin: (0.1 + 0.25) w+ = (0.1 + 0.25) w- + 0.5 impulse, and the centre leaves at half its speed."""
    held = rod("hold")
    x = held.x0(j_y_dot=-1.0, j_3_dot=2.0)
    found = held.impact(0.0, x, {"h": 0.5}, closed=True)
    speeds = found.x[held.n_q : held.n_q + held.n_v]
    np.testing.assert_allclose(speeds, [0.0, 0.5, -1.0], atol=1e-12)
    assert found["h"] == pytest.approx(0.35 * 3.0 / 0.5, rel=1e-12)


def test_an_open_constraint_has_no_part() -> None:
    free, opened = rod("free"), rod("hold", "0.1-t")
    one = opened.simulate(0.45)
    x = free.x0(**dict(zip(free.x_names, opened.simulate(0.2).x[:6, -1], strict=True)))
    two = free.simulate((0.2, 0.45), x)
    assert (np.diff(two.t) == 0.0).sum() == 1
    np.testing.assert_allclose(one.x[:6, -1], two.x[:, -1], atol=1e-7)


@pytest.mark.parametrize("friction", [False, True])
def test_a_locked_joint_is_a_weld_in_impacts(friction: bool) -> None:
    def arm(kind: str) -> Any:
        m = eg.Model("arm", gravity=(0, -9.81, 0))
        a = m.body("a", mass=1.0, com=(0.5, 0, 0), inertia={"zz": 0.1})
        b = m.body("b", mass=2.0, com=(0.3, 0, 0), inertia={"zz": 0.2}, markers={"tip": (0.6, 0, 0)})
        m.revolute("th", m.ground, a)
        if kind == "weld":
            m.weld("q", a.at(1, 0, 0), b)
        else:
            m.revolute("q", a.at(1, 0, 0), b)
            m.lock("l", "q", opens="100-t")
        m.output("slip", "vx(b.tip)")
        more = {"friction": 0.3, "slip": "slip"} if friction else {}
        m.event("floor", "y(b.tip)+1", restitution=0.4, **more)
        m.initial(th=0.1)
        return m.compile(target="numpy")

    weld, lock = (arm(kind).simulate(0.75) for kind in ("weld", "lock"))
    assert (np.diff(weld.t) == 0.0).any()
    assert lock["th"][-1] == pytest.approx(weld["th"][-1], abs=1e-6)
    assert lock["th_dot"][-1] == pytest.approx(weld["th_dot"][-1], abs=1e-5)
    assert np.abs(lock["q_dot"]).max() < 1e-6
