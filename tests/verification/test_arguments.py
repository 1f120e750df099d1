"""What is no number of states, no seed or no time is a named error, before anything is compared."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eomgen as eg
from eomgen.limits.runs import MOST_STATES


@pytest.fixture(scope="module")
def model() -> Any:
    return eg.load(Path(__file__).parents[2] / "examples" / "pendulum.yaml")


@pytest.mark.parametrize(
    ("given", "said"),
    [
        *(
            ({"states": value}, "states, .* whole number from 1 to")
            for value in (0, -1, 1.5, True, None, "3", MOST_STATES + 1, 10**30)
        ),
        *(({"seed": value}, "seed, .* whole number of at least 0") for value in (-1, 1.5, None, "x", [1], True)),
        *(
            ({"seconds": value}, "seconds must be")
            for value in (-1.0, float("nan"), None, "1", 1j, np.complex128(1), True)
        ),
    ],
)
def test_odd_arguments_are_named(model: Any, given: dict[str, Any], said: str) -> None:
    from eomgen.verification.verify import verify_model

    module = model.compile(target="numpy")
    with pytest.raises(eg.UsageError, match=said):
        module.verify(**given)
    with pytest.raises(eg.UsageError, match=said):
        verify_model(model, module, **given)


def test_numbers_of_numpy_are_taken(model: Any) -> None:
    module = model.compile(target="numpy")
    assert module.verify(states=np.int64(1), seed=np.uint8(3), seconds=np.float32(0.0)).ok
