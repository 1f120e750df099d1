"""Lanes: a built model -> the library with its lanes and series, compiled when batches or ensembles first need it.

It is kept in the model's cache under a key that follows from the model's, and compiled from the sources kept there by
the same compiler and flags.
"""

from __future__ import annotations

import ctypes
import warnings
from pathlib import Path
from threading import Timer

from ..base.files import read_manifest
from ..errors import ToolchainError, bad_cache
from .build import compile_and_link
from .cache import Cache, CacheEntry, compute_key
from .compiler import CompilerInfo, find_compiler
from .native import tell
from .processor import lane_files, late_files

QUIET = 1.0  #: seconds that a compilation may take before somebody is told


def find_lanes(file: Path) -> int:
    """Address of the table (``eomgen_lanes``) of a model's lanes, compiled now if need be.

    Where that fails a warning says why, and batches go on one column after the other.

    Parameters
    ----------
    file : Path
        The model's, in the cache.

    Returns
    -------
    int
        0 where there are none.
    """
    try:
        entry = _find_or_build(file)
        return 0 if entry is None else _open(entry)
    except (ToolchainError, OSError, ValueError, AttributeError) as error:
        warnings.warn(
            f"batches of the model in {file} are computed one state at a time, because their vector code cannot be "
            f"compiled: {error}",
            RuntimeWarning,
            stacklevel=2,
        )
        return 0


def _open(entry: CacheEntry) -> int:
    """Load a library, which stays loaded; one without a table, or that cannot be loaded, is not kept."""
    try:
        table = ctypes.CDLL(str(entry.product)).eomgen_late_lanes
    except (OSError, AttributeError):
        Cache(entry.directory.parents[1]).discard(entry.key)
        raise
    table.restype = ctypes.c_void_p
    return table() or 0


def _find_or_build(file: Path) -> CacheEntry | None:
    """The library's entry; None if the model has no lanes that this processor takes."""
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
    if (entry := cache.find(key)) is not None:
        return entry
    words = recipe["flags"][f"{built.name}.c"]
    words = ["-DEOMGEN_LATE", *(w for w in words if not w.startswith("-DEOMGEN_LANES=")), f"-DEOMGEN_LANES={width}"]
    beside = tuple(f"{built.name}_{part}" for part in ("tables.", "native_", "pairs_"))
    called = [name for name in sources if name.startswith(beside) and name.endswith(".c")]
    files = {name: sources[name] for name in (*late_files(sources, built.name), *called)}
    return _build(cache, key, built.name, files, words, recipe["flags"][""], compiler)


def _key(of: str, compiler: list[str]) -> str:
    return compute_key({"kind": "lanes", "of": of, "compiler": compiler})


def _build(
    cache: Cache, key: str, name: str, files: dict[str, Path], words: list[str], link: list[str], compiler: CompilerInfo
) -> CacheEntry:
    """Compile the lanes, and the functions that they call, with the model's flags."""
    flags, product = {**dict.fromkeys(files, words), "": link}, f"{name}_lanes.so"
    timer = Timer(QUIET, tell, [f"compiling the vector code of {name} (once)"])
    timer.daemon = True
    timer.start()
    try:
        with cache.attempt(key) as directory:
            compile_and_link(directory, key, name, files, flags, product, compiler)
            return cache.publish(directory, key, "lanes", name, product, {"flags": flags})
    finally:
        timer.cancel()
