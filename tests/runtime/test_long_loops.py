"""Closed chains of many links: what rounding leaves of long sums is no reason to move a state."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import eomgen as eg


def closed_chain(n: int, *, shift: float = 0.0) -> eg.Model:
    """n alike links on hinges about z, bent into a ring that begins at x = shift."""
    m = eg.Model("ring", gravity=(0, -9.81, 0))
    last = m.ground.at(shift, 0, 0)
    for i in range(n):
        link = m.body(f"b{i}", mass=1.0, com=(0.05, 0, 0), inertia=(1e-3, 1.2e-3, 1.5e-3))
        m.revolute(f"j{i}", last, link)
        m.guess(**{f"j{i}": 2 * np.pi / (n + 1)})
        last = link.at(0.1, 0, 0)
    m.revolute("end", last, m.ground.at(shift + 0.02, 0.02, 0))
    return m


@cache
def derived(n: int, shift: float) -> Any:
    return closed_chain(n, shift=shift).derive()


@cache
def compiled(n: int, shift: float, target: str) -> Any:
    needed = ["project", "constraints", "constraint_jacobian", "velocity_constraints"]
    return derived(n, shift).compile(target=target, kernels=needed)


@pytest.mark.parametrize("target", ["cython", "numpy"])
@pytest.mark.parametrize(("n", "shift"), [(12, 0.0), (90, 0.0), (90, 50.0)])
def test_a_projected_state_stays_as_it_is(n: int, shift: float, target: str) -> None:
    mod = compiled(n, shift, target)
    rng = np.random.default_rng(n)
    start = mod.x0()
    for _ in range(20 if target == "cython" else 5):
        x = start + np.concatenate([1e-4 * rng.standard_normal(n), rng.standard_normal(n)])[: len(start)]
        once = mod.project(x)
        assert np.abs(once - x).max() > 1e-6  # it did move
        np.testing.assert_array_equal(mod.project(once), once)


@pytest.mark.parametrize("target", ["cython", "numpy"])
def test_what_is_more_than_rounding_is_corrected(target: str) -> None:
    mod = compiled(90, 0.0, target)
    x = mod.project(mod.x0())
    q = x[: mod.n_q]
    C_q = mod.constraint_jacobian(q)
    moved = x.copy()
    moved[: mod.n_q] += 1e-11 * C_q[0] / np.linalg.norm(C_q[0])  # across the constraints
    found = mod.project(moved)
    assert np.abs(mod.constraints(moved[: mod.n_q])).max() > 3e-12
    assert np.abs(mod.constraints(found[: mod.n_q])).max() < 3e-14
