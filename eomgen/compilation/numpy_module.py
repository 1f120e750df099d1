"""Loading: the text of the ``numpy`` target -> its core module, kept in the cache like a compiled one."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Mapping
from types import ModuleType

from .cache import Cache, cache_directory, compute_key

SOURCE = "_core.py"


def load_numpy(sources: Mapping[str, str], name: str) -> ModuleType:
    """Import the emitted NumPy functions of a model; no compiler is needed.

    Parameters
    ----------
    sources : mapping of str to str
        From :func:`eomgen.emit.emit_numpy`.
    name : str
        Name of the model.

    Returns
    -------
    module
        The core, with ``metadata``, ``names``, ``context``, ``timed``, ``state`` and ``motion``.
    """
    text = sources[SOURCE]
    key = compute_key({"numpy": text})
    # a name inside the package, so that the module's relative imports find the runtime
    module_name = f"eomgen._{name}_{key[:16]}"
    if module_name in sys.modules:
        return sys.modules[module_name]
    cache = Cache(cache_directory())
    entry = cache.find(key)
    if entry is None:
        with cache.attempt(key) as attempt:
            (attempt / SOURCE).write_text(text, encoding="utf-8")
            entry = cache.publish(attempt, key, "numpy", name, SOURCE, {})
    spec = importlib.util.spec_from_file_location(module_name, entry.product)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    sys.modules[module_name] = module
    return module
