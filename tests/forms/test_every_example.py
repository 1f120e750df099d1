"""All forms agree on the examples that tests/acceptance/test_methods.py leaves out, drivers included."""

from __future__ import annotations

from pathlib import Path

import judges
import models
import numpy as np
import pytest
from sweeps import OF_ALL_KINDS, part_of

import eomgen as eg
from eomgen.equations import METHODS

EXAMPLES = Path(__file__).parents[2] / "examples"
NAMES = sorted({path.stem for path in EXAMPLES.glob("*.yaml")} - set(models.EXAMPLE_NAMES))
FORMS = [method for method in METHODS if method != "embedding"]
KERNELS = ["rhs", "mass_matrix", "bias"]
DIGITS = 1e-10


def test_no_example_is_left_out() -> None:
    assert set(models.DRIVEN_NAMES) <= set(NAMES)
    assert len(NAMES) + len(models.EXAMPLE_NAMES) >= len(list(EXAMPLES.glob("*.yaml")))


@pytest.mark.parametrize("name", part_of(NAMES, {*OF_ALL_KINDS, *models.DRIVEN_NAMES}.__contains__))
def test_forms_agree(name: str) -> None:
    model = eg.load(EXAMPLES / f"{name}.yaml")
    reference = model.compile("embedding", target="numpy")
    states, n = judges.random_states(reference, 7, 2, position=0.02, speed=1.0), reference.n_q
    for method in FORMS:
        other = model.compile(method, target="numpy", kernels=KERNELS)
        assert other.x_names == reference.x_names
        for x in states:
            expected = reference.rhs(0.0, x)
            here = float(np.linalg.cond(reference.embedded_mass_matrix(x[:n]))) if reference.n_dof else 1.0
            judges.agree(other.rhs(0.0, x)[n:], expected[n:], DIGITS, here)
            for one, two in (
                (other.mass_matrix(x[:n]), reference.mass_matrix(x[:n])),
                (other.bias(0.0, x), reference.bias(0.0, x)),
            ):
                assert np.abs(one - two).max() <= 1e-11 * max(1e-3, np.abs(two).max()), method
