"""What these tests compile goes to a cache of their own."""

from __future__ import annotations

from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def forms_cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("forms_cache")


@pytest.fixture(autouse=True)
def own_cache(forms_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("EOMGEN_CACHE_DIR", str(forms_cache))
