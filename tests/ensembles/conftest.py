"""Models compiled once for the tests of ensembles."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import pytest

import eomgen as eg

EXAMPLES = Path(__file__).parents[2] / "examples"


@cache
def compiled(name: str, target: str, lanes: int | None = None) -> Any:
    options = {} if lanes is None else {"lanes": lanes}
    return eg.load(EXAMPLES / f"{name}.yaml").compile(target=target, **options)


@pytest.fixture
def pendulum() -> Any:
    """A double pendulum: a tree, run in lanes."""
    return compiled("double_pendulum", "cython")


@pytest.fixture
def crank() -> Any:
    """A slider-crank: a loop."""
    return compiled("slider_crank", "cython")


@pytest.fixture
def pendulum_in_numpy() -> Any:
    return compiled("double_pendulum", "numpy")
