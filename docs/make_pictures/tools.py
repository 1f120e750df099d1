"""What the pictures share: their table, and models to make them from."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("agg")
import matplotlib.pyplot as plt

import eomgen as eg

DOCS = Path(__file__).parents[1]
EXAMPLES = DOCS.parent / "examples"
PICTURES: dict[str, Callable[[], Any]] = {}


def picture(make: Callable[[], Any]) -> Callable[[], Any]:
    """Register a function that returns a figure or axes; the picture has its name."""
    PICTURES[make.__name__] = make
    return make


def example(name: str, **options: Any) -> Any:
    """A shipped model, compiled."""
    return eg.load(EXAMPLES / name, **options).compile()


def of_page(page: str, number: int) -> Any:
    """The model of a page's YAML block, compiled."""
    text = re.findall(r"```yaml\n(.*?)```", (DOCS / f"{page}.md").read_text(encoding="utf-8"), re.DOTALL)[number]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "model.yaml")
        file.write_text(text, encoding="utf-8")
        return eg.load(file).compile(target="numpy")


def panels(*shape: int, size: tuple[float, float] = (7.2, 2.8)) -> tuple[Any, Any]:
    """An empty figure and its axes."""
    return plt.subplots(*shape, figsize=size, layout="constrained")
