"""Slow motions beside very stiff ones, and very weak forces: judged by closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import eomgen as eg
from eomgen.errors import EquilibriumError, UsageError


def pendulum_beside(stiffness: float, mass: float) -> Any:
    """A pendulum of length 1 and a tiny mass on a stiff spring, which have nothing to do with each other."""
    m = eg.Model("beside", gravity=(0, -9.81, 0))
    bob, tiny = m.body("bob", mass=1.0, com=(0, -1, 0)), m.body("tiny", mass=mass)
    m.prismatic("s", m.ground, tiny, axis="x")
    m.spring("k", m.ground.at(-1, 0, 0), tiny, stiffness=stiffness, length=1.0)
    m.revolute("R", m.ground, bob, coordinate="th")
    return m.compile(target="numpy")


@pytest.mark.parametrize(("stiffness", "mass"), [(1e8, 1e-6), (1e8, 1e-8), (1e10, 1e-8)])
def test_slow_motions_beside_stiff_ones_are_seen(stiffness: float, mass: float) -> None:
    mod = pendulum_beside(stiffness, mass)
    slow, fast = np.sqrt(9.81), np.sqrt(stiffness / mass)
    hanging, upright = mod.x0(th=0.0, s=0.0), mod.x0(th=np.pi, s=0.0)
    modes = mod.modes(hanging)
    np.testing.assert_allclose(modes.frequencies, [slow, fast], rtol=1e-9, atol=0)
    assert (modes.rigid, modes.diverging) == (0, 0)
    assert mod.linearize(hanging).stability == "stable (undamped)"
    lost = mod.modes(upright)
    assert (lost.rigid, lost.diverging) == (0, 1)
    assert mod.linearize(upright).stability == "unstable"


def test_rigid_motions_beside_unstable_ones_hide_nothing() -> None:
    """A free mass, a stiff one and an inverted pendulum."""
    m = eg.Model("three", gravity=(0, -9.81, 0))
    bob, tiny, free = m.body("bob", mass=1.0, com=(0, 1, 0)), m.body("tiny", mass=1e-6), m.body("free", mass=2.0)
    m.prismatic("s", m.ground, tiny, axis="x")
    m.spring("k", m.ground.at(-1, 0, 0), tiny, stiffness=1e8, length=1.0)
    m.prismatic("f", m.ground, free, axis="x")
    m.revolute("R", m.ground, bob, coordinate="th")
    mod = m.compile(target="numpy")
    assert mod.linearize(mod.x0()).stability == "unstable"
    modes = mod.modes(mod.x0())
    assert (modes.rigid, modes.diverging) == (1, 1)


@pytest.mark.parametrize("g", [1e-5, 1e-8, 1e-11])
def test_weak_gravity_is_gravity(g: float) -> None:
    fall = eg.Model("fall", gravity=(0, -g, 0))
    fall.prismatic("y", fall.ground, fall.body("b", mass=2.0), axis="y")
    with pytest.raises(EquilibriumError, match="no equilibrium"):
        fall.compile(target="numpy").equilibrium()
    m = eg.Model("pendulum", gravity=(0, -g, 0))
    m.revolute("R", m.ground, m.body("b", mass=2.0, com=(0, -1, 0)), coordinate="th")
    mod = m.compile(target="numpy")
    rest = mod.equilibrium({"th": 0.7})
    assert rest["th"] == pytest.approx(0.0, abs=1e-9)
    assert rest.linear.is_equilibrium
    np.testing.assert_allclose(np.abs(rest.eigenvalues), np.sqrt(g), rtol=1e-9)
    assert (rest.stability, mod.linearize(mod.x0(th=np.pi)).stability) == ("stable (undamped)", "unstable")
    assert not mod.linearize(mod.x0(th=0.3)).is_equilibrium
    with pytest.raises(UsageError, match="needs an equilibrium"):
        mod.modes(mod.x0(th=0.3))
