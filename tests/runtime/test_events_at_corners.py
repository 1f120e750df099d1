"""A reset within rounding of a corner of an input: a step as short as rounding is no accumulation of resets."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import eomgen as eg

G, E, END = 9.81, 0.9, 1.8
FLOOR = 1000.0 + 1.0 / 3.0  #: (m) so high that heights beside it are many roundings of time apart
TIGHT = {"rtol": 1e-10, "atol": 1e-12}


@pytest.fixture(scope="module", params=["cython", "numpy"])
def pushed(request: pytest.FixtureRequest) -> Any:
    """A ball on a rail; an input pushes a cart beside it, whose corners split the run and leave the ball alone."""
    m = eg.Model("pushed", gravity=(0, -G, 0))
    push = m.input("push")
    m.prismatic("J", m.ground, m.body("ball", mass=1.0), axis="y", coordinate="h")
    m.prismatic("K", m.ground, m.body("cart", mass=1.0), axis="x", coordinate="s")
    m.torque("pushing", "K", push)
    m.event("floor", "3*(h - 1000) - 1", direction=-1, reset={"h_dot": -E * m.coordinate("h_dot")})
    return m.compile(target=request.param)


@pytest.mark.parametrize("bounce", [0, 1])
@pytest.mark.parametrize("method", ["DOP853", "RK45", "Radau"])
def test_a_reset_beside_a_corner_of_an_input_is_one_reset(pushed: Any, method: str, bounce: int) -> None:
    """Truth: the closed form; the corner is units in the last place away from where a bounce is found."""
    for height in np.linspace(0.8, 1.2, 3):
        first = np.sqrt(2.0 * height / G)
        bounces = first * np.array([1.0, 1.0 + 2.0 * E])
        corner = float(bounces[bounce])
        for ulps in (0, 0, -2, -1, 1, 2, 8):  # the first run tells where a bounce is found
            at = corner + ulps * np.spacing(corner)
            inputs = {"push": ([0.0, at, END], [0.0, 1.0, 1.0])}
            run = pushed.simulate((0, END), {"h": FLOOR + height}, inputs=inputs, method=method, **TIGHT)
            found, error = run.t_events["floor"][:2], f"{height} m, {ulps} units"
            np.testing.assert_allclose(found, bounces, rtol=0, atol=1e-9, err_msg=error)
            assert run.t[-1] == END
            corner = float(found[bounce]) if ulps == 0 else corner
