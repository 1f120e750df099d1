"""A loop of micrometres on a mechanism of kilometres moves as it does alone, in metres or millimetres."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import eomgen as eg


def four_bar(m: eg.Model, base: Any, size: float, mass: float, tag: str) -> None:
    """A crank-rocker with bars of 0.04, 0.12, 0.08 and 0.1 times the size."""
    lengths = [part * size for part in (0.04, 0.12, 0.08)]
    bars = [
        m.body(f"{name}_{tag}", mass=mass, com=(l / 2, 0, 0), inertia={"zz": mass * l**2 / 12})
        for name, l in zip(("crank", "coupler", "rocker"), lengths, strict=True)
    ]
    m.revolute(f"A_{tag}", base, bars[0], coordinate=f"theta_{tag}")
    m.revolute(f"B_{tag}", bars[0].at(lengths[0], 0, 0), bars[1], coordinate=f"bend_{tag}")
    m.revolute(f"C_{tag}", bars[1].at(lengths[1], 0, 0), bars[2].at(lengths[2], 0, 0))
    m.revolute(f"D_{tag}", base.at(0.1 * size, 0, 0), bars[2], coordinate=f"psi_{tag}")
    m.guess(**{f"bend_{tag}": -0.7, f"psi_{tag}": 1.1})
    m.initial(**{f"theta_{tag}": 1.0, f"theta_{tag}_dot": 3.0})


def rocker(unit: float, target: str, beside: bool) -> tuple[np.ndarray, float]:
    """The rocker of a four-bar of a micrometre on a free car, and its gap, with or without one of a kilometre."""
    m = eg.Model("beside" if beside else "alone")
    car = m.body("car", mass=10)
    m.prismatic("P", m.ground, car, axis="x", coordinate="s")
    four_bar(m, car, 1e-5 * unit, 1.0, "small")
    if beside:
        four_bar(m, m.ground, 1e4 * unit, 1e-6, "large")
    mod = m.compile(target=target)
    run = mod.simulate((0, 2), rtol=1e-10, atol=1e-13, t_eval=np.linspace(0, 2, 5))
    gaps = mod.constraints.every(run.x[: mod.n_q])
    small = [k for k, label in enumerate(mod.constraint_labels) if "_small" in label]
    assert len(small) == 2
    return run["psi_small"], float(np.abs(gaps[small]).max())


@pytest.mark.parametrize("target", ["cython", "numpy"])
@pytest.mark.parametrize("unit", [1.0, 1000.0])
def test_a_micrometre_loop_beside_a_kilometre_one_moves_as_alone(unit: float, target: str) -> None:
    alone, _ = rocker(unit, target, beside=False)
    together, gap = rocker(unit, target, beside=True)
    assert np.ptp(alone) > 1.0
    np.testing.assert_allclose(together, alone, atol=1e-8)
    assert gap <= 1e-10 * 1e-6 * unit  # by the loop's own size
