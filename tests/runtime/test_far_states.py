"""States far from the constraints: straight-line code comes where the code with pivots does, without its cost."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eomgen as eg

EXAMPLES = Path(__file__).parents[2] / "examples"


MODELS: dict[str, Any] = {
    name: lambda name=name: eg.load(EXAMPLES / f"{name}.yaml")
    for name in ("stewart_platform", "delta_robot", "andrews_squeezer", "bricard")
}


@pytest.mark.parametrize("name", MODELS)
def test_far_states_come_to_the_same_place(name: str) -> None:
    model = MODELS[name]()
    module, dense = model.compile(), model.compile(target="numpy")
    x, random = module.x0(), np.random.default_rng(1)
    for size in (0.01, 0.1, 0.2):
        far = np.tile(x[:, None], 5)
        far[: module.n_q] += size * random.uniform(-1, 1, (module.n_q, 5))
        far[module.n_q :] += random.uniform(-1, 1, (module.n_x - module.n_q, 5))
        expected = dense.rhs(0.0, far)
        np.testing.assert_allclose(module.rhs(0.0, far), expected, rtol=0, atol=1e-12 * np.abs(expected).max())


def microseconds(call: Any, x: np.ndarray) -> float:
    best = np.inf
    for _ in range(30):
        start = time.perf_counter()
        for _ in range(20):
            call(0.0, x)
        best = min(best, (time.perf_counter() - start) / 20)
    return 1e6 * best


def test_far_states_cost_a_few_steps() -> None:
    """A Stewart platform: 24 coordinates; with pivots a far state took ten times as long as one nearby."""
    module = MODELS["stewart_platform"]().compile()
    x = module.x0()
    far = x.copy()
    far[: module.n_q] += 0.1 * np.random.default_rng(0).uniform(-1, 1, module.n_q)
    assert microseconds(module.rhs, far) < 5.0 * microseconds(module.rhs, x)
