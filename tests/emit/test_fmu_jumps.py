"""Model exchange: an input that jumps as soon as the unit may run changes which events are still to come."""

from __future__ import annotations

import ctypes
from pathlib import Path

import numpy as np
import pytest
from fmu_instances import initialized, opened

import eomgen as eg

H = 0.05  #: step of Euler's method (s)


@pytest.mark.parametrize("when", [0.0, 0.1])
def test_a_crossing_after_a_jump_is_not_missed(when: float, tmp_path: Path) -> None:
    """s' is -0.1 at first and 0.1 lower at each event; s comes to -0.5 once, after the lever jumped from 0 to 1."""
    m = eg.Model("switched")
    m.prismatic("J", m.ground, m.body("b", mass=1.0), axis="x", coordinate="s")
    m.torque("nothing", "J", 0 * m.input("lever"))
    m.initial(s=0.0, s_dot=-0.1)
    m.event("on", "lever - 0.5 + s", reset={"s_dot": "s_dot - 0.1"})
    unit, at = opened(m.derive().write_fmu(tmp_path / "switched.fmu"))
    initialized(unit)
    values, indicator = (ctypes.c_double * 2)(), (ctypes.c_double * 1)()

    def rates() -> list[float]:
        unit.fmi2GetContinuousStates(unit.component, values, 2)
        return list(values)

    def meet_events(jumps: bool) -> None:
        if jumps:
            unit.setReal([at["lever"]], [1.0])
        while unit.newDiscreteStates()[0]:
            pass
        unit.enterContinuousTimeMode()

    meet_events(when == 0.0)
    found = []
    for k in range(1, 101):
        unit.fmi2GetEventIndicators(unit.component, indicator, 1)
        before = indicator[0]
        s, speed = rates()
        unit.setTime(k * H)
        unit.fmi2SetContinuousStates(unit.component, (ctypes.c_double * 2)(s + H * speed, speed), 2)
        asked = unit.completedIntegratorStep()[0]
        unit.fmi2GetEventIndicators(unit.component, indicator, 1)
        jumps = when > 0.0 and k * H == pytest.approx(when)
        if asked or before * indicator[0] <= 0.0 or jumps:
            unit.enterEventMode()
            meet_events(jumps)
            if rates()[1] != speed:
                found.append(k * H)
    unit.terminate()
    unit.freeInstance()
    hit = when + (0.5 - 0.1 * when) / 0.2  # -0.1 to the jump, then -0.2
    assert rates_after(found, when) == pytest.approx([hit], abs=1.5 * H)


def rates_after(found: list[float], when: float) -> list[float]:
    """Times of resets after the one of the jump itself."""
    return [t for t in found if t > when + 0.5 * H and not np.isclose(t, when)]
