"""``project(x, t)``: the second argument is the time, as the documents write it, in every target and bound module."""

from __future__ import annotations

import numpy as np
import pytest

import eomgen as eg


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_the_second_argument_is_the_time(target: str) -> None:
    """A slider-crank led at 3 rad/s from 0.2: at t its angles are known in closed form."""
    m = eg.Model("led")
    r, l = m.parameter("r", 0.1), m.parameter("l", 0.35)
    crank, rod, slider = (m.body(name, mass=1, inertia={"zz": 0.1}) for name in ("crank", "rod", "slider"))
    m.revolute("A", m.ground, crank, coordinate="theta")
    m.revolute("B", crank.at(r, 0, 0), rod, coordinate="phi")
    m.revolute("C", rod.at(l, 0, 0), slider)
    m.prismatic("D", m.ground, slider, axis="x")
    m.driver("motor", "theta", 0.2 + 3 * m.t)
    m.initial(theta=0.2)
    m.guess(D=0.45, phi=-0.3)
    mod = m.compile(target=target)

    def closed(t: float, r: float = 0.1) -> list[float]:
        theta = 0.2 + 3 * t
        beta = -np.arcsin(r * np.sin(theta) / 0.35)
        beta_dot = -r * np.cos(theta) * 3 / (0.35 * np.cos(beta))
        s = r * np.cos(theta) + 0.35 * np.cos(beta)
        s_dot = -3 * r * np.sin(theta) - 0.35 * beta_dot * np.sin(beta)
        return [theta, beta - theta, s, 3.0, beta_dot - 3.0, s_dot]

    assert mod.q_names == ("theta", "phi", "D")
    for t in (0.0, 0.1, 0.15):
        near = np.array(closed(t)) + 1e-5
        np.testing.assert_allclose(mod.project(near, t), closed(t), atol=1e-9)
        np.testing.assert_array_equal(mod.project(near, t=t), mod.project(near, t))
        bound = mod.bind(p={"r": 0.12})
        np.testing.assert_allclose(bound.project(near, t), closed(t, 0.12), atol=1e-9)
        np.testing.assert_array_equal(mod.project(near, t, bound.p), bound.project(near, t))
    times = np.array([0.0, 0.1, 0.15])
    many = np.array([closed(t) for t in times]).T
    np.testing.assert_allclose(mod.project(many + 1e-5, times), many, atol=1e-9)


def test_of_a_tree_too() -> None:
    m = eg.Model("tree")
    m.revolute("A", m.ground, m.body("b", mass=1, com=(1, 0, 0)), coordinate="theta")
    mod = m.compile(target="numpy")
    np.testing.assert_array_equal(mod.project([0.3, 0.4], 2.0), [0.3, 0.4])
