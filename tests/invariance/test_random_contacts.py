"""Random scenes of contacts keep momentum and gain no energy; run_random_contacts judges the thousand."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from invariance.random_contacts import FAMILIES, Scene, random_contacts
from invariance.run_random_contacts import BALANCED, POWER, Result, judge_states, try_one
from sweeps import part_of

RUN = (4, 10, 11)  #: scenes of laws with memories, which only a run can judge
#: Each family once, and the scenes that are run.
ALWAYS = {*range(len(FAMILIES)), *RUN}


@pytest.mark.parametrize("number", part_of(range(20), lambda number: number in ALWAYS))
def test_a_scene_keeps_momentum_and_gains_no_energy(number: int) -> None:
    result = try_one(number, number in RUN)
    assert result.faults == []
    if number in RUN:
        assert result.lost > 1e-3
    else:
        assert result.touched > 0 or "soil" in result.family


def judged(scene: Scene, mod: object) -> Result:
    result = Result("", "")
    judge_states(scene, mod, np.random.default_rng(3), result)  # type: ignore[arg-type]
    return result


def test_the_judge_sees_a_force_without_its_opposite_and_a_gain() -> None:
    scene = random_contacts(FAMILIES.index(("plane", "coulomb")))
    mod = scene.model.compile(target="numpy", kernels=["rhs", "energy"])
    n = 3 * len(scene.masses)

    def pushed(t: float, x: np.ndarray) -> np.ndarray:
        rates = np.array(mod.rhs(t, x))
        rates[n] += 1e-6 * np.abs(rates[n:]).max()
        return rates

    def helped(t: float, x: np.ndarray) -> np.ndarray:
        """Friction that drives: the dissipated power with the other sign."""
        still = x.copy()
        still[n:] = 0.0
        rates, elastic = np.array(mod.rhs(t, x)), np.array(mod.rhs(t, still))
        rates[n:] = 2.0 * elastic[n:] - rates[n:]
        return rates

    def fake(rhs: object) -> SimpleNamespace:
        return SimpleNamespace(rhs=rhs, energy=mod.energy, n_x=mod.n_x, n_q=mod.n_q)

    right = judged(scene, mod)
    assert right.balance <= BALANCED
    assert right.power <= POWER
    assert judged(scene, fake(pushed)).balance > 100 * BALANCED
    assert judged(scene, fake(helped)).power > 10 * POWER
