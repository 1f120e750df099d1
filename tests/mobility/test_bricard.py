"""Bricard's mechanism (IFToMM A04): overconstrained for good, which row is redundant changes with the configuration.

Source: tests/reference/iftomm_A04_bricard.json.
"""

from __future__ import annotations

import models
import numpy as np
import pytest

import eomgen as eg

NAMES = ("x3", "y3", "z3", "x4", "y4", "z4", "angle1", "angle2", "angle3", "angle4", "angle5")


@pytest.fixture(scope="module")
def equations() -> eg.Equations:
    return eg.load(models.EXAMPLES / "bricard.yaml").derive()


def test_the_count_says_it_cannot_move_and_the_rank_says_it_can(equations: eg.Equations) -> None:
    report = equations.report
    assert report.gruebler_kutzbach == 0
    assert (report.constraints, report.rank, report.degrees_of_freedom) == (5, 4, 1)
    assert len(report.redundant) == 1
    assert report.redundant[0].startswith("J6.")


@pytest.mark.parametrize("target", ["cython", "numpy"])
def test_ten_seconds_of_published_motion(equations: eg.Equations, target: str) -> None:
    values = models.reference("iftomm_A04_bricard")["values"]
    end = 10.0 if target == "cython" else 1.0
    times = np.array(sorted(float(t) for t in values if float(t) <= end))
    rows = {float(t): value for t, value in values.items()}
    expected = np.array(
        [[*rows[t]["corner3_(1,-1,0)"], *rows[t]["corner4_(1,-1,1)"], *rows[t]["angles"]] for t in times]
    ).T
    mod = equations.compile(target=target)
    run = mod.simulate((0, end), t_eval=times)
    found = np.array([run[name] for name in NAMES])
    assert np.abs(found - expected).max() <= 1e-8
    energy = np.sum(mod.energy(run.x), axis=0)
    assert np.ptp(energy) <= 1e-8 * np.max(mod.energy(run.x)[0])
    assert np.abs(mod.constraints(run.x[: mod.n_q], rows="all")).max() <= 1e-12


def test_every_hinge_can_lead(equations: eg.Equations) -> None:
    """The motion is the same whichever coordinate is preferred, though each goes through its dead centre."""
    runs = []
    for name in ("angle1", "angle2", "angle5"):
        mod = eg.load(models.EXAMPLES / "bricard.yaml").compile(independent=[name])
        x0 = mod.x0(angle1=0.3)
        runs.append(mod.simulate((0, 3), initial=dict(zip(mod.x_names, x0, strict=True)), t_eval=np.linspace(0, 3, 31)))
    for run in runs[1:]:
        for name in ("angle1", "angle3", "x3", "angle1_dot"):
            np.testing.assert_allclose(run[name], runs[0][name], atol=1e-7)
