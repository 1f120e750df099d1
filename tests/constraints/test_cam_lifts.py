"""Cams by their lift: what turns and what slides, against Lagrange's equation; coordinates that do not fit are told."""

from __future__ import annotations

import numpy as np
import pytest

import eomgen as eg


def test_cams_of_coordinates_that_do_not_fit_are_told() -> None:
    m = eg.Model("cams")
    wheel, ball, sledge = (m.body(n, mass=1, inertia=(1, 1, 1)) for n in ("wheel", "ball", "sledge"))
    m.revolute("C", m.ground, wheel)
    m.spherical("B", m.ground, ball, rotation="euler_parameters")
    m.prismatic("S", m.ground, sledge, axis="x")
    m.cam("a", "B_e1", "S", lift="0.1*theta")
    m.cam("b", "C", "B_e2", lift="0.1*cos(theta)")
    m.cam("c", "S", "C", lift="0.1*theta", periodic=True)
    with pytest.raises(eg.ModelError) as caught:
        m.check()
    assert [p.path for p in caught.value.problems] == [
        f"constraints.{x}" for x in ("a.cam", "b.follower", "c.periodic")
    ]
    words = str(caught.value)
    assert "'B_e1' is neither an angle nor a length; name an angle or a length" in words
    assert "the cam slides ('S' is a length), so its profile has no turn to repeat after; leave it out" in words


@pytest.mark.parametrize("follower", ["prismatic", "revolute"])
@pytest.mark.parametrize("cam", ["prismatic", "revolute"])
def test_cams_slide_or_turn_and_so_do_their_followers(cam: str, follower: str) -> None:
    """One degree of freedom with s = f(a): s' = f' a' and (m_a + m_s f'^2) a'' + m_s f' f'' a'^2 = 0 (Lagrange)."""
    m = eg.Model("cams")
    bodies = [m.body(n, mass=mass, inertia=(3, 3, mass)) for n, mass in (("a", 2.0), ("s", 3.0))]
    getattr(m, cam)("A", m.ground, bodies[0])
    getattr(m, follower)("S", m.ground.at(1, 0, 0), bodies[1])
    m.cam("law", "A", "S", lift="0.3*sin(theta) + 0.1*cos(2*theta)")
    module = m.compile(target="numpy")
    x = module.x0(A=0.7, A_dot=1.3)
    f, df = 0.3 * np.sin(0.7) + 0.1 * np.cos(1.4), 0.3 * np.cos(0.7) - 0.2 * np.sin(1.4)
    ddf = -0.3 * np.sin(0.7) - 0.4 * np.cos(1.4)
    a_ddot = -3.0 * df * ddf * 1.3**2 / (2.0 + 3.0 * df**2)
    found = dict(zip(module.x_names, module.rhs(0.0, x), strict=True))
    state = dict(zip(module.x_names, x, strict=True))
    assert state["S"] == pytest.approx(f, abs=1e-13)
    assert state["S_dot"] == pytest.approx(df * 1.3, abs=1e-13)
    assert found["A_dot"] == pytest.approx(a_ddot, rel=1e-12)
    assert found["S_dot"] == pytest.approx(df * a_ddot + ddf * 1.3**2, rel=1e-12)


def test_the_phase_turns_the_cam_back() -> None:
    """s = f(a - phase): where the cam stands at its phase the follower is where f(0) says."""
    m = eg.Model("cams")
    wheel, follower = m.body("wheel", mass=1.0, inertia=(1, 1, 1)), m.body("follower", mass=1.0)
    m.revolute("A", m.ground, wheel)
    m.prismatic("S", m.ground, follower)
    m.cam("law", "A", "S", lift="0.3*sin(theta) + 0.1*cos(2*theta)", phase=0.4)
    module = m.compile(target="numpy")
    for angle in (0.4, 1.5):
        state = dict(zip(module.x_names, module.x0(A=angle), strict=True))
        assert state["S"] == pytest.approx(0.3 * np.sin(angle - 0.4) + 0.1 * np.cos(2 * angle - 0.8), abs=1e-13)
