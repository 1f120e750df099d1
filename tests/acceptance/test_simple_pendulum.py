"""IFToMM benchmark A01: a planar pendulum released horizontally, against its closed form with Jacobi's cd.

Source: tests/reference/iftomm_A01_simple_pendulum.json (benchmark library of IFToMM, http://193.144.52.16/mbsbenchmark).
"""

from __future__ import annotations

from typing import Any

import models
import numpy as np
import pytest

import eomgen as eg

REFERENCE = models.reference("iftomm_A01_simple_pendulum")


def make() -> Any:
    """A point mass of 1 kg on a bar of 1 m without mass; at angle 0 it hangs."""
    given = REFERENCE["parameters_SI"]
    m = eg.Model("simple_pendulum", gravity=(0, -given["g"], 0))
    bob = m.body("bob", mass=given["m"], com=(0, -given["L"], 0))
    m.revolute("A", m.ground, bob, coordinate="theta")
    m.output("px", bob.at(0, -given["L"], 0).position[0])
    m.output("py", bob.at(0, -given["L"], 0).position[1])
    m.initial(theta=-np.pi / 2)
    return m.compile(target="numpy")


def test_the_pendulum_follows_its_closed_form() -> None:
    mod = make()
    places = REFERENCE["reference_xy"]
    times = sorted(map(float, places))
    run = mod.simulate(10.0, t_eval=times, rtol=1e-12, atol=1e-13)
    expected = np.array([[float(z) for z in places[f"{t:g}"]] for t in times])
    np.testing.assert_allclose(np.column_stack([run["px"], run["py"]]), expected, rtol=0, atol=1e-9)
    assert run.energy_drift < 1e-11


def test_the_energy_drift_at_default_tolerances() -> None:
    """Within 1e-5 J of 9.81 J, as reported too."""
    run = make().simulate(10.0)
    assert run.energy_drift < 1e-6
    assert np.abs(run["energy"] - run["energy"][0]).max() < 1e-5


def test_the_period() -> None:
    mod = make()

    def stops(t: float, x: np.ndarray) -> float:
        return float(x[1])

    run = mod.simulate(5.0, rtol=1e-12, atol=1e-13, events=[stops])
    moments = [t for t in run.t_events[0] if t > 1e-6]
    assert moments[1] - moments[0] == pytest.approx(float(REFERENCE["period_s"]) / 2, abs=1e-9)
