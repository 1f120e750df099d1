"""Centres of mass, joints and axes off by a hair, as files of robots have them, move as those in place do."""

from __future__ import annotations

import numpy as np
import pytest

import eomgen as eg
from eomgen.equations import METHODS

HAIRS = (1e-12, 1e-9, 1e-8, 1e-7, 3e-7, 1e-5)


@pytest.mark.parametrize("method", [name for name in METHODS if name != "auto"])
@pytest.mark.parametrize("rotation", ["euler_parameters", "euler_angles"])
def test_a_free_body_falls_freely(method: str, rotation: str) -> None:
    for hair in HAIRS:
        m = eg.Model("body", gravity=(0, 0, -9.81))
        body = m.body("b", mass=4, com=(hair, hair, hair), inertia=(0.3, 0.25, 0.1))
        m.free("f", m.ground, body, rotation=rotation)
        mod = m.compile(method=method, target="numpy")
        rates = mod.rhs(0.0, mod.x0())[mod.n_q :]
        np.testing.assert_allclose(rates, [0, 0, -9.81, 0, 0, 0], atol=1e-9)


@pytest.mark.parametrize("method", ["embedding", "recursive", "amalgamated"])
def test_a_parameter_may_come_to_a_hair(method: str) -> None:
    """The offset of a hinge on a free body, bound to values from 1 m to nothing: against a solution with no offset."""
    m = eg.Model("pair", gravity=(0, 0, -9.81))
    d = m.parameter("d", 1.0)
    body = m.body("b", mass=4, com=(0, 0, 0), inertia=(0.3, 0.25, 0.1))
    wheel = m.body("w", mass=1, com=(0, 0, 0), inertia=(0.02, 0.02, 0.04))
    m.free("f", m.ground, body)
    m.revolute("r", body.at(d, 0, 0), wheel, coordinate="th")
    m.torque("drive", "r", 0.5)
    mod = m.compile(method=method, target="numpy")
    for hair in (0.0, *HAIRS):
        rates = mod.rhs(0.0, mod.x0(), p={"d": hair})[mod.n_q :]
        expected = [0, 0, -9.81, 0, 0, -0.5 / 0.1, 0.5 / 0.1 + 0.5 / 0.04]
        np.testing.assert_allclose(rates, expected, atol=20 * hair + 1e-9)
