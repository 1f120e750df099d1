"""Stage runtime: Module <-> a pickle, which names the file of the compiled code and holds the values bound.

So a pickle is small, is read in milliseconds, and serves processes of one machine (or of machines that share the cache
and the architecture), not for keeping: generate a package for that.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib import import_module, machinery, util
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from ..errors import ToolchainError
from ..numeric.scales import Array

if TYPE_CHECKING:
    from .module import Module


def reduce(module: Module) -> tuple[Callable[..., Module], tuple[Any, ...]]:
    """What pickle stores: how to make the module again.

    Raises
    ------
    TypeError
        The code has no file of its own: a hand-made core, or one that calls Python twins of native functions.
    """
    core: Any = module.core
    name, file = getattr(core, "__name__", ""), getattr(core, "__file__", None)
    if not file or sys.modules.get(name) is not core:
        raise TypeError(
            f"the module of {module.name!r} cannot be pickled: its code is not in a file of its own (a core made by "
            "hand, or the numpy target with native functions); target cython can be pickled"
        )
    return restore, (type(module), name, str(file), module.p, module.u)


def restore(kind: type[Module], name: str, file: str, p: Array, u: Array) -> Module:
    """The module of a pickle.

    Raises
    ------
    ToolchainError
        The file of its code is gone.
    """
    return kind(_find_core(name, file), p, u)


def _find_core(name: str, file: str) -> ModuleType:
    if name in sys.modules:
        return sys.modules[name]
    try:
        return import_module(name)  # of a generated package
    except ModuleNotFoundError:
        pass
    path = Path(file)
    compiled = path.name.endswith(tuple(machinery.EXTENSION_SUFFIXES))
    loader = machinery.ExtensionFileLoader(name, file) if compiled else machinery.SourceFileLoader(name, file)
    spec = util.spec_from_file_location(name, file, loader=loader)
    assert spec is not None
    core = util.module_from_spec(spec) if path.is_file() else None
    if core is None:
        raise ToolchainError(f"the compiled code of the pickled module is gone: {file}; compile the model again")
    loader.exec_module(core)
    sys.modules[name] = core
    return core
