"""The stored pictures of the documentation are those that ``python docs/make_pictures`` makes, and pages show them."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

DOCS = Path(__file__).parents[2] / "docs"
SOURCES = [DOCS / "make_pictures" / name for name in ("drawn.py", "plotted.py")]


def names() -> list[str]:
    return [name for path in SOURCES for name in re.findall(r"^@picture\ndef (\w+)", path.read_text("utf-8"), re.M)]


def shown(page: Path) -> list[str]:
    return re.findall(r"!\[[^\]]{20,}\]\(pictures/(\w+)\.png\)", page.read_text("utf-8"))


def grey(path: Path, size: tuple[int, int]) -> np.ndarray:
    with Image.open(path) as picture:
        return np.asarray(picture.convert("L").resize(size), dtype=float)


@pytest.mark.parametrize("name", names())
def test_a_page_shows_the_picture_with_a_text_and_it_is_small(name: str) -> None:
    page = next(p for n in (name, name.rpartition("_")[0]) if (p := DOCS / f"{n}.md").exists())
    assert name in shown(page)
    assert 1000 < (DOCS / "pictures" / f"{name}.png").stat().st_size <= 60_000


@pytest.mark.slow
def test_the_stored_pictures_are_what_the_command_makes_now(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    subprocess.run([sys.executable, DOCS / "make_pictures", "--out", tmp_path], check=True, capture_output=True)
    for name in names():
        stored, made = DOCS / "pictures" / f"{name}.png", tmp_path / f"{name}.png"
        with Image.open(stored) as one, Image.open(made) as two:
            assert np.abs(np.subtract(one.size, two.size)).max() <= 8, name
            size = (one.width // 4, one.height // 4)
        assert np.abs(grey(stored, size) - grey(made, size)).mean() < 5, f"run: python docs/make_pictures {name}"
