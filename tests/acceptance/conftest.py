"""Each model is derived and compiled once for all acceptance tests, in a cache of their own."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import models
import pytest


@pytest.fixture(scope="session")
def acceptance_cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("acceptance_cache")


@pytest.fixture(autouse=True)
def own_cache(acceptance_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What a test itself compiles goes there too."""
    monkeypatch.setenv("EOMGEN_CACHE_DIR", str(acceptance_cache))


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
def module(equations: Callable[..., Any], acceptance_cache: Path) -> Callable[..., Any]:
    """``module(name, method, target, independent)`` -> the compiled module."""
    made: dict[Any, Any] = {}

    def compiled(
        name: str, method: str = "embedding", target: str = "cython", independent: tuple[str, ...] | None = None
    ) -> Any:
        key = name, method, target, independent
        if key not in made:
            with pytest.MonkeyPatch.context() as patch:
                patch.setenv("EOMGEN_CACHE_DIR", str(acceptance_cache))
                made[key] = equations(name, method, independent).compile(target=target)
        return made[key]

    return compiled
