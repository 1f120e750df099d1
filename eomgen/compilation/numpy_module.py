"""Loading: the text of the ``numpy`` target -> its core module, kept in the cache like a compiled one."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

from ..base.files import find_module, load_source
from ..errors import ToolchainError
from .cache import Cache, cache_directory, compute_key

SOURCE = "_core.py"


def load_numpy(sources: Mapping[str, str], name: str, twins: Mapping[str, Any] | None = None) -> ModuleType:
    """Import the emitted NumPy functions of a model; no compiler is needed.

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
    text = sources[SOURCE]
    key = compute_key({"numpy": text})
    # a name inside the package, so that the module's relative imports find the runtime
    module_name = f"eomgen._{name}_{key[:16]}"
    loaded: ModuleType | None = None if twins else find_module(module_name)
    if loaded is not None:
        return loaded
    try:
        path = str(_cached(key, name, text))
    except ToolchainError:  # the cache cannot be used, and nothing here needs it
        path = f"<{module_name}>"
    return load_source(module_name, path, text.encode(), twins)


def _cached(key: str, name: str, text: str) -> Path:
    """The file in the cache; raises ToolchainError where there can be none."""
    cache = Cache(cache_directory())
    entry = cache.find(key)
    if entry is None:
        with cache.attempt(key) as attempt:
            (attempt / SOURCE).write_text(text, encoding="utf-8")
            entry = cache.publish(attempt, key, "numpy", name, SOURCE, {})
    return entry.product
