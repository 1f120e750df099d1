"""Folders that come with the package: templates and examples, inside it where installed, beside it in a clone."""

from __future__ import annotations

from pathlib import Path

_PACKAGE = Path(__file__).parent


def shipped(name: str) -> Path:
    """A folder: ``templates`` or ``examples``."""
    clone = _PACKAGE.parent
    beside = not (_PACKAGE / name).is_dir() and (clone / "pyproject.toml").is_file()
    return (clone if beside else _PACKAGE) / name
