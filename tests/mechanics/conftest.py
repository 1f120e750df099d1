"""Each model is derived and compiled once for all tests of mechanics."""

from collections.abc import Callable
from functools import cache
from typing import Any

import analysed
import models
import pytest


@pytest.fixture(scope="session")
def equations() -> Callable[..., Any]:
    """``equations(name, method, independent)`` -> the derived equations."""

    @cache
    def derive(name: str, method: str = "embedding", independent: tuple[str, ...] | None = None) -> Any:
        return models.build(name).derive(method, independent=independent)

    return derive


@pytest.fixture(scope="session")
def module(equations: Callable[..., Any]) -> Callable[..., Any]:
    """``module(name, method, target, independent)`` -> the compiled module; how fast its C is, is not the subject."""

    @cache
    def compiled(
        name: str, method: str = "embedding", target: str = "numpy", independent: tuple[str, ...] | None = None
    ) -> Any:
        if (target, method, independent) == ("cython", "embedding", None):
            return analysed.compiled(name, target)
        options = {"optimize": 0} if target == "cython" else {}
        return equations(name, method, independent).compile(target=target, **options)

    return compiled
