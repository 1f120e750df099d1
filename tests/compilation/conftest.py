"""A hand-written model (a pendulum) and caches that last as long as the tests."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import pytest

from eomgen.compilation import Cache, compile_sources, load_core
from eomgen.emit.sources import read_template

MODEL = Path(__file__).with_name("model")


@pytest.fixture(scope="session")
def shared_cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One cache for most tests, so that the layer is built once."""
    return tmp_path_factory.mktemp("cache") / "eomgen"


@pytest.fixture(autouse=True)
def cache(shared_cache: Path, monkeypatch: pytest.MonkeyPatch) -> Cache:
    monkeypatch.setenv("EOMGEN_CACHE_DIR", str(shared_cache))
    monkeypatch.delenv("CC", raising=False)
    return Cache(shared_cache)


@pytest.fixture
def fresh_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Cache:
    monkeypatch.setenv("EOMGEN_CACHE_DIR", str(tmp_path / "fresh"))
    return Cache(tmp_path / "fresh")


@pytest.fixture
def sources() -> dict[str, str]:
    """The pendulum's C sources."""
    texts = {name: (MODEL / name).read_text() for name in ("pendulum.c", "pendulum.h")}
    return {**texts, "eomgen.h": read_template("c/eomgen.h")}


@pytest.fixture
def core(sources: dict[str, str]) -> ModuleType:
    return load_core(compile_sources(sources, "pendulum"))
