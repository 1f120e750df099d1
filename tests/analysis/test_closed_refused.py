"""Equilibria, linearizations and modes do not count what is closed for a time as a constraint: they refuse it."""

from __future__ import annotations

import numpy as np
import pytest

import eomgen as eg
from eomgen.errors import UnavailableError


def pair(**keys: str) -> eg.Model:
    """Two sliders on springs of 10 N/m, coupled, and 1 N on the first."""
    m = eg.Model("pair", gravity=(0, 0, 0))
    for name, mass in (("a", 1.0), ("b", 2.0)):
        m.prismatic(name.upper(), m.ground, m.body(name, mass=mass), axis="x", coordinate=name + "_s")
        m.joint_spring(f"k_{name}", joint=name.upper(), stiffness=10)
    m.torque("push", "A", "1")
    m.coupling("c", {"a_s": 1, "b_s": -1}, **keys)
    return m


@pytest.mark.parametrize("call", ["equilibrium", "modes", "linearize"])
def test_what_is_closed_is_refused(call: str) -> None:
    module = pair(opens="100 - t").compile(target="numpy")
    with pytest.raises(UnavailableError, match=r"while constraints that close and open are closed, and c of 'pair' is"):
        getattr(module, call)()


def test_the_whole_jacobian_stays() -> None:
    module = pair(opens="100 - t").compile(target="numpy")
    assert pytest.approx(module.jacobian(0.0, module.x0())) == module.linearize(form="full").A


def test_the_remedies_of_the_message() -> None:
    open_, for_good = pair(opens="100 - t").compile(target="numpy"), pair().compile(target="numpy")
    assert open_.equilibrium({"c_closed": 0}).x[:2] == pytest.approx([0.1, 0.0], abs=1e-10)
    assert pair(closes="1 - t").compile(target="numpy").equilibrium().x[:2] == pytest.approx([0.1, 0.0], abs=1e-10)
    assert for_good.equilibrium().x[:2] == pytest.approx([0.05, 0.05], abs=1e-10)
    assert for_good.modes().frequencies == pytest.approx([np.sqrt(20 / 3)], rel=1e-9)


def test_a_constraint_that_is_open_adds_no_eigenvalue() -> None:
    """Its state is 0 and stays so: the stability, the linearization and the modes are those without it."""

    def pendulum(latch: bool) -> eg.Model:
        m = eg.Model("pendulum", gravity=(0, -9.81, 0))
        bob = m.body("bob", mass=1.0, com=(0, -0.5, 0), inertia={"zz": 0.1})
        m.revolute("J", m.ground, bob, coordinate="p")
        m.joint_damper("d", "J", damping=0.3)
        m.state("w", "p - w")
        m.torque("drive", "J", m.input("u"))
        m.output("y", "p + w")
        if latch:
            m.coupling("latch", equation="p - 1", closes="1 - p")
        return m

    one, other = (pendulum(latch).compile(target="numpy") for latch in (True, False))
    assert one.equilibrium().stability == other.equilibrium().stability == "asymptotically stable"
    mine, judge = one.linearize(), other.linearize()
    assert mine.states == judge.states
    for key in "ABCD":
        assert getattr(mine, key) == pytest.approx(getattr(judge, key), abs=1e-12)
    assert one.modes().frequencies == pytest.approx(other.modes().frequencies)
    assert len(one.modes().damped) == len(other.modes().damped)
