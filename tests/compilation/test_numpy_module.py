"""Loading the numpy target where nothing can be kept."""

from __future__ import annotations

from pathlib import Path

import pytest

from eomgen.compilation.numpy_module import load_numpy


def test_a_cache_that_cannot_be_written_is_not_needed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("EOMGEN_CACHE_DIR", str(tmp_path / "file" / "cache"))
    module = load_numpy({"_core.py": "answer = 42\n"}, "uncached")
    assert module.answer == 42
    assert load_numpy({"_core.py": "answer = 42\n"}, "uncached") is module
