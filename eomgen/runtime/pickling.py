"""Module <-> a pickle, which names the file of the compiled code and holds the values bound.

So a pickle is small, is read in milliseconds, and serves processes of one machine (or of machines that share the cache
and the kind of processor), not for keeping: generate a package for that.
"""

from __future__ import annotations

import platform
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from ..base.algebra import Array
from ..base.files import MANIFEST, find_module, load_source, read_entry, read_trusted, require_trusted
from ..base.kernel_table import NAMED
from ..errors import ToolchainError, cannot
from .kernels import LateCore, eager

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
    if isinstance(module.core, LateCore):
        further: dict[str, Any] = module.core.further
        late = module.core.names, {group: (made.__name__, str(made.__file__)) for group, made in further.items()}
    return restore, (type(module), name, str(file), module.p, module.u, late)


def restore(kind: type[Any], name: str, file: str, p: Array, u: Array, late: Late | None = None) -> Any:
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

    return kind(LateCore(core, names, load), p, u)


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
    path = Path(file)
    try:
        if (path.parent / MANIFEST).exists():
            _require_features(read_entry(path.parent)[0], file)
        require_trusted(path)
        if path.suffix == ".py":
            return load_source(name, file, read_trusted(path)).model
    except (OSError, ValueError) as error:
        what = "gone" if isinstance(error, FileNotFoundError) else f"damaged ({error})"
        raise ToolchainError(
            f"the compiled code of the pickled module is {what}: {file}; compile the model again",
            code="EG-FILE-DAMAGED",
        ) from error
    return import_module("eomgen.toolchain.load").open_core(name, path)


def _require_features(manifest: Mapping[str, Any], file: str) -> None:
    """Refuse code with instructions that this processor does not know, which would end the process without a word."""
    lacking = set(manifest.get("recipe", {}).get("needs", ())) - processor_features()
    if lacking:
        raise ToolchainError(
            f"the compiled code of the pickled module needs a processor with {', '.join(sorted(lacking))}, which "
            f"this one lacks: {file}; compile the model again here"
        )


@cache
def processor_features() -> frozenset[str]:
    """What this processor can do: its kind, NumPy's names of features, and on Linux those of the kernel."""
    found = {platform.machine()}
    with suppress(ImportError, AttributeError):
        features = import_module("numpy._core._multiarray_umath").__cpu_features__
        found |= {name for name, there in features.items() if there}
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith(("flags", "Features")):
                found |= set(line.partition(":")[2].split())
                break
    return frozenset(found)
