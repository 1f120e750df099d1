"""How many operations derived equations take: exact counts, so a change for the worse fails here."""

from __future__ import annotations

import pytest

from benchmarks.growth import operations
from benchmarks.models import panda
from eomgen.equations import METHODS


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_energies_and_inverse_dynamics_grow_linearly(method: str) -> None:
    single, double = operations(100, method), operations(200, method)
    for part, number in single.items():
        assert number > 100, part
        assert double[part] <= 2.1 * number, part


def test_panda_takes_few_operations() -> None:
    lagrange = panda().derive("lagrange").operations
    embedding = panda().derive("embedding").operations
    assert 0 < lagrange["inverse_dynamics"].total <= 2000
    assert 0 < embedding["mass_matrix"].total <= 2000
    assert 0 < embedding["bias"].total <= 2000
