"""A hand-written model (a pendulum) and caches of a test's own."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from eomgen.compilation import Cache, compile_sources, load_core
from eomgen.emit.sources import read_template

MODEL = Path(__file__).with_name("model")
EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(autouse=True)
def no_compiler_by_name(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever the user's CC is."""
    monkeypatch.delenv("CC", raising=False)


@pytest.fixture
def fresh_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Cache:
    monkeypatch.setenv("EOMGEN_CACHE_DIR", str(tmp_path / "fresh"))
    return Cache(tmp_path / "fresh")


@pytest.fixture
def cache(warm_cache: Path, monkeypatch: pytest.MonkeyPatch) -> Cache:
    """One of the test's own that has the layer already."""
    monkeypatch.setenv("EOMGEN_CACHE_DIR", str(warm_cache))
    return Cache(warm_cache)


@pytest.fixture
def sources() -> dict[str, str]:
    """The pendulum's C sources."""
    texts = {name: (MODEL / name).read_text() for name in ("pendulum.c", "pendulum.h")}
    return {**texts, "eomgen.h": read_template("c/eomgen.h")}


@pytest.fixture
def core(sources: dict[str, str]) -> ModuleType:
    return load_core(compile_sources(sources, "pendulum"))


@pytest.fixture
def write(request: pytest.FixtureRequest, tmp_path: Path) -> Any:
    """Writes a model whose code no other test has, and gives its file."""
    module = request.module.__name__.rpartition("test_")[2]

    def write(name: str, example: str = "two_link_manipulator") -> Path:
        file = tmp_path / f"{name}.yaml"
        file.write_text((EXAMPLES / f"{example}.yaml").read_text().replace(example, f"{module}_{name}"))
        return file

    return write
