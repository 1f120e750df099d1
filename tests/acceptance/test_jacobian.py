"""``jacobian`` is the derivative of the complete ``rhs``, its projection included, in every direction of x.

Judge: central differences (tenth order) of ``rhs`` itself at random states on the manifold, transverse directions too.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from types import SimpleNamespace
from typing import Any

import judges
import models
import numpy as np
import pytest
from mechanisms import random_mechanism
from sweeps import part_of

from eomgen.api.equations import derive

LOOPS = ["offset_slider_crank", "powered_slider_crank", "spatial_loop"]
REDUNDANT = ["tilted_four_bar", "skewed_four_bar", "three_cranks"]


def compare(mod: Any, x: np.ndarray, t: float, h: float = 1e-5) -> None:
    n = mod.n_q
    kinds = mod.metadata["coordinate_kinds"]
    sizes = np.tile([mod.metadata["length_scale"] if kind == "length" else 1.0 for kind in kinds], 2)

    def rhs(columns: np.ndarray) -> np.ndarray:
        return mod.rhs(t, columns)

    expected = np.stack([judges.first(rhs, x, d * s, h=h) / s for d, s in zip(np.eye(2 * n), sizes, strict=True)], 1)
    found = mod.jacobian(t, x)
    assert found.shape == (2 * n, 2 * n)
    # each of the four blocks by its own largest entry, in units that do not favour metres or radians
    weigh = sizes[None, :] / sizes[:, None]
    for rows in (slice(0, n), slice(n, 2 * n)):
        for columns in (slice(0, n), slice(n, 2 * n)):
            ours, theirs = (part[rows, columns] * weigh[rows, columns] for part in (found, expected))
            floor = 1e-8 * np.abs(expected * weigh).max()  # a block that vanishes has the noise of the others
            assert np.abs(ours - theirs).max() <= max(1e-6 * np.abs(theirs).max(), floor)


NAMES = [*models.EXAMPLE_NAMES, *models.DRIVEN_NAMES, *LOOPS, "powered_arm", *REDUNDANT]


@pytest.mark.parametrize(("name", "method"), part_of(product(NAMES, ["embedding", "lagrange"]), models.runs_always))
def test_jacobian_of_models(module: Callable[..., Any], name: str, method: str) -> None:
    mod = module(name, method)
    for x in judges.random_states(mod, 31, 3):
        # off the manifold the regularisation of redundant rows follows the residual: a kink that is of second order
        compare(mod, x, 0.3, h=1e-6 if name == "bricard" else 1e-5)


def test_some_directions_are_transverse(module: Callable[..., Any]) -> None:
    """The projection is in the Jacobian: moving off the manifold changes nothing, to first order."""
    for name in ("slider_crank", "skewed_four_bar"):
        mod = module(name)
        x = judges.random_states(mod, 32, 1)[0]
        n = mod.n_q
        J = mod.jacobian(0.0, x)
        C_q = mod.constraint_jacobian(x[:n], rows="all")
        lengths = [mod.metadata["length_scale"] if k == "length" else 1.0 for k in mod.metadata["coordinate_kinds"]]
        across = np.diag(np.square(lengths)) @ C_q.T  # the minimum-norm directions, in scaled coordinates
        assert np.abs(across).max() > 1e-3
        assert np.abs(J[:, n:] @ across).max() <= 1e-9 * np.abs(J).max() * np.abs(across).max()


@pytest.mark.parametrize(("planar", "loop"), [(False, False), (True, True), (False, True)])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_jacobian_of_random_mechanisms(seed: int, planar: bool, loop: bool) -> None:
    made = random_mechanism(seed, bodies=3, planar=planar, reverse=True, loop=loop)
    model: Any = SimpleNamespace(mechanism=lambda: made.mechanism)
    mod = derive(model, "embedding").compile(target="numpy")
    if not mod.n_c:
        states = list(np.random.default_rng(seed).uniform(-1, 1, (2, mod.n_x)))
    else:
        states = judges.random_states(mod, seed, 2, position=0.05, speed=1.0)
    for x in states:
        compare(mod, x, 0.2)
