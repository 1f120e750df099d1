"""Loading: what was compiled, or the text of the ``numpy`` target, -> the core of a model."""

from __future__ import annotations

import ctypes
import json
import platform
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import cache, partial, reduce, wraps
from pathlib import Path
from typing import Any

import numpy as np

from ..base.algebra import Array
from ..base.files import MANIFEST, find_module, keep_module
from ..errors import (  # fmt: skip
    STATUS,
    TO_BE_FINITE,
    EvaluationError,
    SingularMassMatrixError,
    ToolchainError,
    bad_cache,
    not_finite,
)
from .cache import Cache, CacheEntry, cache_directory, compute_key
from .compiler import numpy_features
from .native import find_native
from .trusted_files import load_source, read_entry, read_trusted, require_trusted


def load_core(entry: CacheEntry) -> Any:
    """Open a built model: a ``Model`` of ``eomgen._native``.

    It is named after the model and the key of the build, so different models, and different builds of one model, live
    side by side; loading one build again returns the same core.
    Raises ToolchainError (the file cannot be loaded).
    """
    return open_core(f"eomgen_models.{entry.name}_{entry.key[:16]}", entry.product)


def open_core(name: str, file: Path) -> Any:
    """Open the library of a model in the cache, under a name of its own."""
    if (result := find_module(name)) is not None:
        return result
    native: Any = find_native()
    try:
        require_trusted(file)
        library = ctypes.CDLL(str(file))
        if hasattr(library, "eomgen_take_solvers") and not library.eomgen_take_solvers(ctypes.c_void_p(native.solvers)):
            raise ImportError("it was compiled for the solvers of another version of eomgen")
        core = native.Model(_table(library, "eomgen_model_table"), name, str(file), partial(_find_lanes, file))
    except ToolchainError:
        raise
    except Exception as error:  # of the loader, or a table of another layout
        Cache(file.parents[2]).discard(file.parent.name)
        raise bad_cache(
            f"the compiled model {file} cannot be loaded: {error}. It was removed from the cache; compile the model "
            "again, and use another compiler (CC) if this happens again"
        ) from error
    return keep_module(name, core)


def find_core(name: str, path: Path) -> Any:
    """The core of a pickled module, which is not loaded, from the file of its code.

    Raises ToolchainError (the file is gone or damaged, another user could have written it, or it needs another
    processor).
    """
    try:
        if (path.parent / MANIFEST).exists():
            _require_features(read_entry(path.parent)[0], path)
        require_trusted(path)
        if path.suffix == ".py":
            return load_source(name, str(path), read_trusted(path)).model
    except (OSError, ValueError) as error:
        what = "gone" if isinstance(error, FileNotFoundError) else f"damaged ({error})"
        raise ToolchainError(
            f"the compiled code of the pickled module is {what}: {path}; compile the model again",
            code="EG-FILE-DAMAGED",
        ) from error
    return open_core(name, path)


def _require_features(manifest: Mapping[str, Any], file: Path) -> None:
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
    result = {platform.machine(), *numpy_features()}
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith(("flags", "Features")):
                result |= set(line.partition(":")[2].split())
                break
    return frozenset(result)


def recipe_of(file: Path) -> str:
    """What the build is made from that the file of a library or core belongs to, as JSON; empty without its sources.

    Raises ToolchainError (the build is damaged).
    """
    try:
        facts, files = read_entry(file.parent)
    except (OSError, ValueError) as error:
        raise ToolchainError(
            f"the compiled code of the module is damaged: {error}; compile the model again", code="EG-FILE-DAMAGED"
        ) from None
    folder, recipe = "sources/", facts["recipe"]
    sources = {n.removeprefix(folder): text.decode() for n, text in sorted(files.items()) if n.startswith(folder)}
    if not sources:
        return ""
    options = recipe.get("options", {})
    needs = sorted(processor_features()) if options.get("native", False) else recipe.get("needs", [])
    return json.dumps({"name": facts["name"], "sources": sources, "options": options, "needs": needs})


def _table(library: ctypes.CDLL, name: str) -> int:
    """Address of a table in a library, which stays loaded."""
    table = getattr(library, name)
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
            return _table(ctypes.CDLL(str(entry.product)), "eomgen_lazy_lanes")
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
#: Statuses of what its functions raise.
CODES = {**{error: status for status, error in STATUS.items()}, EvaluationError: 1}


def load_numpy(sources: Mapping[str, str], name: str, fallbacks: Mapping[str, Any] | None = None) -> Any:
    """Open the NumPy functions of a model, kept in the cache like a library: a ``Model`` of ``eomgen._native``.

    The sources come from :func:`eomgen.codegen.targets.numpy.emit_numpy`; ``fallbacks`` are those of native functions,
    which the text calls and does not define.  No compiler is needed.
    """
    text = sources[NUMPY]
    key = compute_key({"numpy": text})
    # a name inside the package, so that the module's relative imports find the runtime
    module_name = f"eomgen._{name}_{key[:16]}"
    if not fallbacks and (result := find_module(module_name)) is not None:
        return result

    def written(directory: Path) -> tuple[str, Mapping[str, Any]]:
        (directory / NUMPY).write_text(text, encoding="utf-8")
        return NUMPY, {}

    try:
        path = str(Cache(cache_directory()).make(key, "numpy", name, written).product)
    except ToolchainError:  # the cache cannot be used, and nothing here needs it
        path = f"<{module_name}>"
    return load_source(module_name, path, text.encode(), fallbacks).model


def open_functions(
    name: str, file: str, metadata: str, table: Mapping[str, Any], blocks: Mapping[str, tuple[Any, int, int]],
    precompute: Callable[..., Array],
) -> Any:  # fmt: skip
    """The core of functions of NumPy arrays, of the module of this name and file; metadata is the text of model.json.

    The table holds name, sizes, kernels and equations, as ``eomgen._native.Functions`` takes them; blocks are
    ``f(t, x, u, c) -> out`` with the lengths of x and out, and precompute makes of the parameters what c has besides.
    """

    @wraps(precompute)
    def constants(p: Array) -> Array:
        try:
            x = np.array(p, dtype=float)
            return np.concatenate([x, quiet(precompute)(0.0, x, None, None)])
        except ArithmeticError:  # Python's own numbers raise where NumPy's become infinite: 1.0 / 0.0
            raise not_finite(f"the constants of the model cannot be computed; {TO_BE_FINITE}") from None

    quiet = np.errstate(all="ignore")
    native: Any = find_native()
    silent = {of: (quiet(block), *lengths) for of, (block, *lengths) in blocks.items()}
    functions = native.Functions(metadata=metadata, blocks=silent, precompute=constants, codes=CODES, **table)
    return native.Model(functions.address, name, file, functions=functions)


class Linear:
    """A block that is linear in its last entries, the directions of derivatives.

    Solvers want one direction after the other at the same place; one call for all of them takes little longer than one.
    ``block`` is ``f(t, x, u, c) -> out``, and ``along`` says how many entries the directions are.
    """

    def __init__(self, block: Callable[..., Array], along: int) -> None:
        self.block, self.along = block, along
        self.last: tuple[Any, Any] = None, None

    def __call__(self, t: Any, x: Array, u: Array, c: Array) -> Array:
        """Evaluate, for one direction or a batch."""
        if x.ndim > 1:
            return self.block(t, x, u, c)
        place, direction = x[: -self.along], x[-self.along :]
        key = t, place.tobytes(), u.tobytes(), c.tobytes()
        known, slopes = self.last
        if known != key:
            every = np.vstack([np.repeat(place[:, None], self.along, axis=1), np.eye(self.along)])
            slopes = np.asarray(self.block(t, every, u, c))
            self.last = key, slopes
        used = np.flatnonzero(direction)
        return np.asarray(slopes[:, used] @ direction[used])


def checked(out: Array, lost: Sequence[Any]) -> Array:
    """What a block gives, but of a state that fails a check.

    Raises SingularMassMatrixError (of one state; in a batch it has NaN).
    """
    failed = reduce(np.logical_or, lost)
    if out.ndim > 1:
        return np.where(failed, np.nan, out)
    if failed:
        raise SingularMassMatrixError("the mass matrix is singular")
    return out
