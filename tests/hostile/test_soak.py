"""A short soak, and that its judge sees a leak."""

from __future__ import annotations

import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from hostile.soak import LEAST, LIMITS, Sample, judge, leaks, soak

FLAT = Sample(0.0, 2e8, 4e7, 580_000, 100_000, 1500, 6, 1, 300, 3 * 10**7, 0)


def rows(**growth: float) -> list[Sample]:
    """Samples a minute apart, in which some quantities grow, with noise that a slope must see through."""
    random = np.random.default_rng(1)
    noisy = [replace(FLAT, minutes=float(k), memory=2e8 + 1e6 * random.normal()) for k in range(40)]
    return [replace(s, **{name: getattr(s, name) + rate * s.minutes for name, rate in growth.items()}) for s in noisy]


def test_the_judge_sees_what_grows() -> None:
    assert leaks(rows()) == []
    for name, limit in LIMITS.items():
        assert [word.split()[0] for word in leaks(rows(**{name: 3 * limit}))] == [name]
    jump = rows()
    jump[30] = replace(jump[30], memory=9e8)  # one large model
    assert leaks(jump) == []


@pytest.mark.slow
@pytest.mark.thorough
def test_nothing_grows_over_some_models() -> None:
    """Of the numpy target, without verification: that and compiled models belong to ``python -m hostile.soak``.

    Ninety models, however long they take, in a process of its own: here caches are full of other tests' models, which
    larger ones would replace.
    """
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as process:
        samples, wrong = process.submit(
            soak, 20.0, 300, print, every=0.0, verified=10**9, batch=10**9, most=90
        ).result()
    told = [str(sample) for sample in samples]
    assert wrong == []
    assert len(samples) >= LEAST, told
    late = samples[70:]  # a sample a model; caches keep 64 of them
    assert judge(samples)["modules"] == 0.0
    for name in ("descriptors", "threads", "temporary"):
        assert len({getattr(s, name) for s in late}) == 1, told
    assert late[-1].memory - late[0].memory < 25e6, told
    assert late[-1].objects - late[0].objects < 150 * 20, told
