"""Processor: the lane files of a model -> those worth compiling for the processor that runs this."""

from __future__ import annotations

import functools
import platform
import re
from collections.abc import Iterable, Mapping
from importlib import import_module

from ..errors import no_choice

#: Width -> features, by NumPy's names, without which the file of that width is of no use; the widest first.
NEEDS: dict[int, tuple[str, ...]] = {8: ("AVX512F", "AVX512VL", "AVX512DQ", "FMA3"), 4: ("AVX2", "FMA3"), 2: ()}


@functools.cache
def lane_width() -> int:
    """States side by side in the kernels that are compiled here: what this processor takes at a time."""
    if not is_x86():
        return 2
    try:  # NumPy has asked the processor already; its dispatch relies on this table
        features = import_module("numpy._core._multiarray_umath").__cpu_features__
    except (ImportError, AttributeError):
        return 2
    return next(width for width, needs in NEEDS.items() if all(features.get(name) for name in needs))


def is_x86() -> bool:
    """Whether this processor runs x86-64 code."""
    return platform.machine().lower() in ("x86_64", "amd64")


def lane_files(files: Iterable[str]) -> dict[str, int]:
    """The lane files among these, with their widths."""
    return {file: int(found[1]) for file in files if (found := re.search(r"_lanes(\d+)\.c$", file))}


def late_files(files: Iterable[str], name: str) -> list[str]:
    """A model's files that are compiled when first needed: its lanes and its series; none without lanes."""
    files = list(files)
    lanes = list(lane_files(files))
    return [*lanes, *(file for file in files if file == f"{name}_series.c")] if lanes else []


def choose_lanes(sources: Mapping[str, str], wanted: int | None = None) -> tuple[dict[str, str], int]:
    """Leave out the lane files of other widths than the one wanted, by default that of this processor.

    Returns
    -------
    sources : dict of str to str
    width : int
        Of the lanes that are left, 0 if there are none.

    Raises
    ------
    UsageError
        A width that only other processors have.
    """
    if wanted in (4, 8) and not is_x86():
        raise no_choice(f"lanes must be None, 0 or 2 on {platform.machine()}, not {wanted}")
    width = lane_width() if wanted is None else wanted
    widths = lane_files(sources)
    kept = {file: text for file, text in sources.items() if widths.get(file, width) == width}
    return kept, width if width in widths.values() else 0
