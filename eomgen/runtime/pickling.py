"""Module <-> a pickle, which names the file of the compiled code and holds the values bound.

So a pickle is small, is read in milliseconds, and serves processes of one machine (or of machines that share the cache
and the kind of processor), not for keeping: generate a package for that.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

from ..base.algebra import Array
from ..base.files import find_module
from ..base.kernel_table import NAMED
from ..errors import cannot
from .kernels import LazyCore, eager

#: Names of all kernels of a module that makes some of them late, and of those made the name and file of the code.
Late = tuple[tuple[str, ...], dict[str, tuple[str, str]]]


def reduce(module: Any) -> tuple[Callable[..., Any], tuple[Any, ...]]:
    """What pickle stores: how to make the module again."""
    core: Any = eager(module.core)
    name, file = getattr(core, "__name__", ""), getattr(core, "__file__", None)
    if not file or _find_loaded(name) is not core:
        raise TypeError(
            f"the module of {module.name!r} cannot be pickled, because its code is not in a file of its own (a core "
            "made by hand, or target numpy with native functions); use target cython"
        )
    late: Late | None = None
    if isinstance(module.core, LazyCore):
        further: dict[str, Any] = module.core.further
        late = module.core.names, {group: (made.__name__, str(made.__file__)) for group, made in further.items()}
    return restore, (type(module), name, str(file), module.p, module.constant_inputs, late)


def restore(kind: type[Any], name: str, file: str, p: Array, u: dict[str, float], late: Late | None = None) -> Any:
    """The module of a pickle, with the rarer kernels where they had been made."""
    core: Any = _find_core(name, file)
    if late is None:
        return kind(core, p, u)
    names, made = late

    def load(group: str) -> Any:
        if group not in made:
            rare = ", ".join(name for name in names if name not in core.names and str(NAMED[name].late) == group)
            raise cannot(f"the module was pickled without {rare}; call one of them before you pickle it")
        return _find_core(*made[group])

    return kind(LazyCore(core, names, load), p, u)


def _find_loaded(name: str) -> Any:
    """The core of a name, if it is loaded: the module itself, or the model that is linked with a package's module."""
    found = find_module(name)
    return getattr(found, "model", found)


def _find_core(name: str, file: str) -> Any:
    if (loaded := _find_loaded(name)) is not None:
        return loaded
    try:
        import_module(name)  # of a generated package
        return _find_loaded(name)
    except ModuleNotFoundError:
        pass
    return import_module("eomgen.toolchain.load").find_core(name, Path(file))
