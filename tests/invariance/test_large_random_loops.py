"""Closed chains of 9 to 29 velocities against a reference with multipliers, in NumPy and in C."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from invariance.random_loops import Loops, _spatial, n_bar
from invariance.run_random_loops import error_of, verdict_of

from eomgen.verification.variants.findings import original_of

FAMILIES: dict[str, Callable[[int], Loops]] = {
    "10-bar": lambda seed: n_bar(seed, 1.0, 10),
    "16-bar, second bearings": lambda seed: n_bar(seed, 1.0, 16, 3),
    "30-bar of a kilometre": lambda seed: n_bar(seed, 1e3, 30),
    "spatial, 15 velocities": lambda seed: _spatial("RURCRSRRRRRR", 10)(seed, 1.0),
}


@pytest.mark.parametrize("family", FAMILIES)
def test_a_large_loop_moves_as_the_reference(family: str) -> None:
    loops = FAMILIES[family](1)
    original = original_of(loops.model, 1, motion_only=True)
    assert original.module.n_v >= 9
    module = loops.model.compile(kernels=["rhs"])
    for k in range(original.states.shape[1]):
        verdict = verdict_of(loops, original, k)
        assert original.module.n_dof == verdict.dof
        assert error_of(loops, original, original.values[:, k], verdict, k) <= 1e-12
        x = original.states[:, k]
        assert module.x_names == original.module.x_names
        expected = original.module.rhs(0.0, x)
        np.testing.assert_allclose(module.rhs(0.0, x), expected, rtol=0, atol=1e-12 * np.abs(expected).max())
