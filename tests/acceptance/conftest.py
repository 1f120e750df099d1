"""Each model is derived and compiled once for all acceptance tests."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import models
import pytest


@pytest.fixture(scope="session")
def equations() -> Callable[..., Any]:
    """``equations(name, method, independent)`` -> the derived equations."""
    made: dict[Any, Any] = {}

    def derive(name: str, method: str = "embedding", independent: tuple[str, ...] | None = None) -> Any:
        key = name, method, independent
        if key not in made:
            made[key] = models.build(name).derive(method, independent=independent)
        return made[key]

    return derive


@pytest.fixture(scope="session")
def module(equations: Callable[..., Any]) -> Callable[..., Any]:
    """``module(name, method, target, independent)`` -> the compiled module."""
    made: dict[Any, Any] = {}

    def compiled(
        name: str, method: str = "embedding", target: str = "cython", independent: tuple[str, ...] | None = None
    ) -> Any:
        key = name, method, target, independent
        if key not in made:
            # as users compile by one method; what another one changes in the text needs no optimizing
            options = {"optimize": 0} if target == "cython" and method != "embedding" else {}
            made[key] = equations(name, method, independent).compile(target=target, **options)
        return made[key]

    return compiled
