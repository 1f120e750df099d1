"""Reactions balance every body by Newton and Euler, do no work, and equal closed forms where there are some."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace
from typing import Any

import judges
import mechanisms
import models
import numpy as np
import pytest
from wrenches import Balance, tangent

from eomgen import pipeline


def check_balance(module: Any, mechanism: Any, x: np.ndarray, applied: Any = None, digits: float = 1e-8) -> Balance:
    """Every body is in balance, and reactions do no work in any motion the machine can make."""
    found = module.reactions(0.0, x)
    judge = Balance(module, mechanism, x)
    exerted = judge.exerted(found)
    if applied is not None:
        exerted += applied(judge)
    size = np.abs(judge.needed).max()
    np.testing.assert_allclose(exerted, judge.needed, atol=digits * size, rtol=0)
    free = tangent(module, x[: module.n_q])
    for spec, wrench in zip(mechanism.joints, found, strict=True):
        np.testing.assert_allclose(wrench @ judge.relative(spec) @ free, 0.0, atol=digits * size, rtol=0)
    return judge


def moduled(made: Any, target: str = "numpy", method: str = "embedding") -> Any:
    return pipeline.derive(SimpleNamespace(mechanism=lambda: made.mechanism), method).compile(target=target)  # type: ignore[arg-type]


@pytest.mark.parametrize("rotation", ["euler_angles", "euler_parameters"])
@pytest.mark.parametrize("seed", range(6))
def test_every_body_of_random_trees(seed: int, rotation: str) -> None:
    made = mechanisms.random_mechanism(seed, 5, reverse=True, forces=False, rotation=rotation)
    module = moduled(made, method="recursive" if seed % 2 else "embedding")
    for x in judges.random_states(module, seed, 2):
        check_balance(module, made.mechanism, x)
        assert not module.undetermined_reactions(0.0, x).any()


@pytest.mark.parametrize("planar", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_every_body_of_random_loops(seed: int, planar: bool) -> None:
    made = mechanisms.random_mechanism(seed + 20, 5, planar=planar, reverse=True, forces=False, loop=True)
    module = moduled(made)
    for x in judges.random_states(module, seed, 2):
        check_balance(module, made.mechanism, x)


LOOPS = [
    "slider_crank",
    "four_bar",
    "tilted_four_bar",
    "skewed_four_bar",
    "three_cranks",
    "spatial_loop",
    "peaucellier",
]


@pytest.mark.parametrize("name", LOOPS)
def test_every_body_of_loops(name: str) -> None:
    bare = dataclasses.replace(models.build(name).mechanism(), forces=())
    module = moduled(SimpleNamespace(mechanism=bare))
    x = module.x0()
    x[module.n_q :] += 0.5
    check_balance(module, bare, module.project(x))
