"""A chain of 40 links over a turning wheel: belt friction by Euler and Eytelwein, T2 = T1 exp(mu alpha)."""

from __future__ import annotations

import itertools
import math

import pytest

import eomgen as eg

LINKS, PITCH, R, PIN = 40, 0.045, 0.5, 0.004


def belt(mu: float) -> eg.Model:
    """The chain hangs over the upper half of the wheel; springs below hold its ends."""
    m = eg.Model("belt", gravity=(0, 0, 0))
    wheel = m.body("wheel", mass=1, inertia={"zz": 0.1})
    m.revolute("axle", m.ground, wheel)
    m.driver("turn", "axle", "0.2*t")
    reach = R + PIN
    step = 2 * math.asin(PITCH / 2 / reach)
    around = int(math.pi / step)
    arc = [math.pi / 2 + (around / 2 - k) * step for k in range(around + 1)]
    over = [(reach * math.cos(a), reach * math.sin(a)) for a in arc]
    side = (LINKS - around) // 2
    left = [(over[0][0], over[0][1] - PITCH * k) for k in range(side, 0, -1)]
    right = [(over[-1][0], over[-1][1] - PITCH * k) for k in range(1, LINKS + 1 - side - around)]
    pins = [*left, *over, *right]
    links, before = [], 0.0
    for k, ((x, y), (x2, y2)) in enumerate(itertools.pairwise(pins)):
        link = m.body(f"link{k}", mass=0.02, com=(PITCH / 2, 0, 0), inertia={"zz": 1e-5})
        turn = math.atan2(y2 - y, x2 - x)
        if not links:
            m.planar("start", m.ground, link, coordinates=("x", "y", "a"))
            m.initial(x=x, y=y, a=turn)
        else:
            m.revolute(f"pin{k}", links[-1].at(PITCH, 0, 0), link)
            m.joint_damper(f"drag{k}", f"pin{k}", damping=2e-3)
            m.initial({f"pin{k}": turn - before})
        links.append(link)
        before = turn
    circles = {"shape": "circle", "on": [*links, links[-1].at(PITCH, 0, 0)], "radius": PIN}
    law = {"stiffness": 1e5, "exponent": 1, "dissipation": 1.0, "friction": mu, "smoothing": 1e-3}
    m.contacts("grip", circles, {"shape": "circle", "on": wheel, "radius": R}, law)
    for name, (x, y), end in (("one", pins[0], links[0]), ("two", pins[-1], links[-1].at(PITCH, 0, 0))):
        m.spring(f"{name}_spring", m.ground.at(x, y - 0.5, 0), end, stiffness=200, length=0.4)
        m.damper(f"{name}_damper", m.ground.at(x, y - 0.5, 0), end, damping=2.0)
        m.output(f"T_{name}", f"-force({name}_spring)")
    return m


def test_tensions_of_a_sliding_chain() -> None:
    """Friction acts at the rim, the tension at the pins' centres: mu alpha R / (R + PIN) to 1 %, mu alpha to 2 %."""
    mu = 0.3
    end = belt(mu).compile().simulate(1.5, method="BDF", rtol=1e-4, atol=1e-6)
    ratio = end["T_one"][-1] / end["T_two"][-1]
    ratio = max(ratio, 1 / ratio)
    assert ratio == pytest.approx(math.exp(mu * math.pi * R / (R + PIN)), rel=1e-2)
    assert ratio == pytest.approx(math.exp(mu * math.pi), rel=2e-2)
    assert end["T_one"][-1] < end["T_two"][-1]  # the wheel turns against the clock: it pulls the right end up
