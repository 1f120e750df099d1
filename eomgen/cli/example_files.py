"""Stage cli: the examples that come with eomgen, by name."""

from __future__ import annotations

from pathlib import Path

from ..shipped import shipped


def example_files() -> dict[str, Path]:
    """Every example by what to call it: a model file by its name alone, a Python script with its suffix."""
    found = {}
    for file in sorted(shipped("examples").iterdir(), key=lambda f: f.name):
        if file.name.endswith(".yaml"):
            found[file.name.removesuffix(".yaml")] = file
        elif file.name.endswith(".urdf") or (file.name.endswith(".py") and not file.name.startswith("_")):
            found[file.name] = file
    return found


def example_names() -> list[str]:
    """What the examples are called."""
    return list(example_files())
