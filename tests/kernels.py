"""Notebooks in kernels of their own, in a process of their own: what it leaves open there disturbs no other test."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import nbformat
from children import child

SCRIPT = Path(__file__).parents[1] / "notebooks" / "execute.py"


def executed(path: Path, folder: Path, raw: bool = False, timeout: float = 400.0) -> Any:
    """The notebook with the outputs of a fresh kernel, as the project's own script stores it in a folder, or raw."""
    words = [sys.executable, str(SCRIPT), *(["--raw"] if raw else []), "--out", str(folder), str(path)]
    setting = {name: value for name, value in os.environ.items() if name not in ("COLUMNS", "LINES")}  # of readline
    with child(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=setting) as process:
        said = process.communicate(timeout=timeout)[0]
    assert process.returncode == 0, said
    return nbformat.read(folder / path.name, as_version=4)
