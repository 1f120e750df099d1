"""Loading: what was compiled, or the text of the ``numpy`` target, -> the core of a model."""

from __future__ import annotations

import ctypes
import warnings
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any

from ..base.files import find_module, keep_module, load_source, require_trusted
from ..errors import ToolchainError, bad_cache
from .cache import Cache, CacheEntry, cache_directory, compute_key
from .native import find_native


def load_core(entry: CacheEntry) -> Any:
    """Open a built model: a ``Model`` of ``eomgen._native``.

    It is named after the model and the key of the build, so different models, and different builds of one model, live
    side by side; loading one build again returns the same core.

    Raises
    ------
    ToolchainError
        If the file cannot be loaded.
    """
    return open_core(f"eomgen_models.{entry.name}_{entry.key[:16]}", entry.product)


def open_core(name: str, file: Path) -> Any:
    """Open the library of a model in the cache, under a name of its own."""
    if (found := find_module(name)) is not None:
        return found
    native: Any = find_native()
    try:
        require_trusted(file)
        core = native.Model(_table(file, "eomgen_model_table"), name, str(file), partial(_find_lanes, file))
    except ToolchainError:
        raise
    except Exception as error:  # of the loader, or a table of another layout
        Cache(file.parents[2]).discard(file.parent.name)
        raise bad_cache(
            f"the compiled model {file} cannot be loaded: {error}. It was removed from the cache; compile the model "
            "again, and use another compiler (CC) if this happens again"
        ) from error
    return keep_module(name, core)


def _table(file: Path, name: str) -> int:
    """Address of a table in a library, which stays loaded."""
    table = getattr(ctypes.CDLL(str(file)), name)
    table.restype = ctypes.c_void_p
    return table() or 0


def _find_lanes(file: Path) -> int:
    """Address of the table (``eomgen_lanes``) of a model's lanes, compiled now if need be; 0 where there are none.

    Where that fails a warning says why, and batches go on one column after the other.
    """
    from .build import compile_lanes  # rarely needed

    try:
        if (entry := compile_lanes(file)) is None:
            return 0
        try:
            return _table(entry.product, "eomgen_late_lanes")
        except (OSError, AttributeError):
            Cache(entry.directory.parents[1]).discard(entry.key)
            raise
    except (ToolchainError, OSError, ValueError, AttributeError) as error:
        warnings.warn(
            f"batches of the model in {file} are computed one state at a time, because their vector code cannot be "
            f"compiled: {error}",
            RuntimeWarning,
            stacklevel=2,
        )
        return 0


NUMPY = "_core.py"  #: the file of the ``numpy`` target


def load_numpy(sources: Mapping[str, str], name: str, twins: Mapping[str, Any] | None = None) -> ModuleType:
    """Import the emitted NumPy functions of a model, kept in the cache like a library; no compiler is needed.

    Parameters
    ----------
    sources : mapping of str to str
        From :func:`eomgen.codegen.targets.numpy.emit_numpy`.
    name : str
        Name of the model.
    twins : mapping of str to callable, optional
        What the text calls but does not define: the Python twins of native functions.

    Returns
    -------
    module
        The core, with ``metadata``, ``names``, ``context``, ``timed``, ``state`` and ``motion``.
    """
    text = sources[NUMPY]
    key = compute_key({"numpy": text})
    # a name inside the package, so that the module's relative imports find the runtime
    module_name = f"eomgen._{name}_{key[:16]}"
    loaded: ModuleType | None = None if twins else find_module(module_name)
    if loaded is not None:
        return loaded
    try:
        cache = Cache(cache_directory())
        if (entry := cache.find(key)) is None:
            with cache.attempt(key) as attempt:
                (attempt / NUMPY).write_text(text, encoding="utf-8")
                entry = cache.publish(attempt, key, "numpy", name, NUMPY, {})
        path = str(entry.product)
    except ToolchainError:  # the cache cannot be used, and nothing here needs it
        path = f"<{module_name}>"
    return load_source(module_name, path, text.encode(), twins)
