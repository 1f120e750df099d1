"""Loading: what was compiled, or the text of the ``numpy`` target, -> the core of a model."""

from __future__ import annotations

import ctypes
import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import partial, reduce, wraps
from pathlib import Path
from typing import Any

import numpy as np

from ..base.algebra import Array
from ..base.files import find_module, keep_module, load_source, require_trusted
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


def load_numpy(sources: Mapping[str, str], name: str, twins: Mapping[str, Any] | None = None) -> Any:
    """Open the NumPy functions of a model, kept in the cache like a library: a ``Model`` of ``eomgen._native``.

    The sources come from :func:`eomgen.codegen.targets.numpy.emit_numpy`; ``twins`` are what the text calls and does
    not define, the Python twins of native functions.  No compiler is needed.
    """
    text = sources[NUMPY]
    key = compute_key({"numpy": text})
    # a name inside the package, so that the module's relative imports find the runtime
    module_name = f"eomgen._{name}_{key[:16]}"
    if not twins and (found := find_module(module_name)) is not None:
        return found
    try:
        cache = Cache(cache_directory())
        if (entry := cache.find(key)) is None:
            with cache.attempt(key) as attempt:
                (attempt / NUMPY).write_text(text, encoding="utf-8")
                entry = cache.publish(attempt, key, "numpy", name, NUMPY, {})
        path = str(entry.product)
    except ToolchainError:  # the cache cannot be used, and nothing here needs it
        path = f"<{module_name}>"
    return load_source(module_name, path, text.encode(), twins).model


def open_functions(
    name: str, file: str, metadata: str, table: Mapping[str, Any], blocks: Mapping[str, tuple[Any, int, int]],
    precompute: Callable[[Array], Array],
) -> Any:  # fmt: skip
    """The core of functions of NumPy arrays, of the module of this name and file; metadata is the text of model.json.

    The table holds name, sizes, kernels and equations, as ``eomgen._native.Functions`` takes them; blocks are
    ``f(t, x, u, c) -> out`` with the lengths of x and out, and precompute is ``p -> c``.
    """

    @wraps(precompute)
    def constants(p: Array) -> Array:
        try:
            return quiet(precompute)(p)
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

    Raises
    ------
    SingularMassMatrixError
        Of one state; in a batch it has NaN.
    """
    failed = reduce(np.logical_or, lost)
    if out.ndim > 1:
        return np.where(failed, np.nan, out)
    if failed:
        raise SingularMassMatrixError("the mass matrix is singular")
    return out
