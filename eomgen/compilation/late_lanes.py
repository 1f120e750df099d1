"""Late lanes: a built module without lanes -> the library with its lanes and series, compiled when first needed.

It is kept in the module's cache under a key that follows from the module's, and compiled from the sources kept there by
the same compiler and flags.
"""

from __future__ import annotations

import ctypes
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..base.files import read_manifest
from ..errors import ToolchainError, bad_cache
from .build import compile_and_link
from .cache import Cache, CacheEntry, compute_key
from .compiler import CompilerInfo, find_compiler
from .processor import lane_files, late_files

_loaded: list[ctypes.CDLL] = []  # stay loaded: their functions are called
#: Files of modules of which a warning has said that something cannot be compiled: it is said once.
told: set[Path] = set()


def find_lanes(file: Path) -> int:
    """Address of the table (``eomgen_lanes``) of a module's lanes, compiled now if need be.

    Where that fails a warning says why, and batches go on one column after the other.

    Parameters
    ----------
    file : Path
        The module's, in the cache.

    Returns
    -------
    int
        0 where there are none.
    """
    try:
        entry = _find_or_build(file)
        if entry is None:
            return 0
        library, table = _load(entry, file)
    except (ToolchainError, OSError, ValueError, AttributeError) as error:
        if file in told:
            return 0
        told.add(file)
        warnings.warn(
            f"batches of the model in {file} are computed one state at a time, because their vector code cannot be "
            f"compiled: {error}",
            RuntimeWarning,
            stacklevel=2,
        )
        return 0
    table.restype = ctypes.c_void_p
    _loaded.append(library)
    return table() or 0


def _load(entry: CacheEntry, file: Path) -> tuple[ctypes.CDLL, Any]:
    """The library and its table; one that has none, or cannot be loaded, is not kept."""
    try:
        library = ctypes.CDLL(str(entry.product))
        return library, library.eomgen_late_lanes
    except (OSError, AttributeError):
        Cache(file.parents[2]).discard(entry.key)
        raise


def _find_or_build(file: Path) -> CacheEntry | None:
    """The library's entry; None if the module has no lanes that this processor takes."""
    cache = Cache(file.parents[2])
    built = cache.find(file.parent.name)
    if built is None:
        raise bad_cache("its cache entry is gone or was changed; compile the model again")
    manifest = read_manifest(file.parent)
    recipe = manifest["recipe"]
    listed = [file.parent / name for name in sorted(manifest["files"]) if name.startswith("sources/")]
    sources = {path.name: path for path in listed}
    width = next(iter(lane_files(sources).values()), 0)
    if width == 0:
        return None
    if (entry := cache.find(_key(built.key, recipe["compiler"]))) is not None:
        return entry  # needs no compiler
    compiler = find_compiler(recipe["options"]["compiler"])
    key = _key(built.key, [*compiler.command, compiler.version])
    return cache.find(key) or _build(cache, key, built, sources, recipe, width, compiler)


def _key(of: str, compiler: list[str]) -> str:
    return compute_key({"kind": "lanes", "of": of, "compiler": compiler})


def _build(
    cache: Cache, key: str, built: CacheEntry, sources: Mapping[str, Path], recipe: Mapping[str, Any],
    width: int, compiler: CompilerInfo,
) -> CacheEntry:  # fmt: skip
    """Compile the lanes, and the functions that they call, with the module's flags."""
    words = recipe["flags"][f"{built.name}.c"]
    words = ["-DEOMGEN_LATE", *(w for w in words if not w.startswith("-DEOMGEN_LANES=")), f"-DEOMGEN_LANES={width}"]
    beside = tuple(f"{built.name}_{part}" for part in ("tables.", "native_", "pairs_"))
    called = [file for file in sources if file.startswith(beside)]
    files = [*late_files(sources, built.name), *(file for file in called if file.endswith(".c"))]
    flags = {**dict.fromkeys(files, words), "": recipe["flags"][""]}
    with cache.attempt(key) as directory:
        product = f"{built.name}_lanes.so"
        compile_and_link(directory, key, built.name, {file: sources[file] for file in files}, flags, product, compiler)
        return cache.publish(directory, key, "lanes", built.name, product, {"flags": flags})
