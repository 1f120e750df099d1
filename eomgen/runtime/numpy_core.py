"""Stage runtime: emitted NumPy blocks and metadata -> a core with the interface of the compiled one.

A block is a function ``f(t, x, u, c) -> out`` of plain arrays: x (n_in,) or (n_in, k), out (n_out,) or (n_out, k).  It
may raise one of :data:`~..errors.STATUS`.  Straight-line kernels are blocks themselves; those of closed loops are put
together in :mod:`.numpy_drivers`.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from ..base.algebra import Array
from ..base.kernel_table import NAMED, argument
from ..base.texts import shown
from ..errors import STATUS, TO_BE_FINITE, EvaluationError, NonFiniteError, not_finite
from .argument_names import both_names
from .layout import Layout
from .numpy_drivers import Drivers
from .room import as_real, fitting, read_vector

#: f(t, x, u, c) -> out
Block: TypeAlias = Callable[[Any, Array, Array, Array], Array]

CODES = {error: status for status, error in STATUS.items()}
NON_FINITE = CODES[NonFiniteError]


class Context:
    """Parameters and inputs bound to a model, with the constants that follow from the parameters."""

    def __init__(self, p: Array, u: Array, c: Array) -> None:
        self.p, self.u, self.c = p, u, c


class NumpyCore:
    """A model whose kernels are NumPy functions.

    Parameters
    ----------
    metadata : str or mapping
        The JSON text of model.json, or what it holds.
    blocks : mapping of str to callable
        ``f(t, x, u, c) -> (n_out, ...)``: kernels of :data:`~..base.kernel_table.KERNELS`, and the inner blocks
        ``terms``, ``position``, ``rate``, ``residual_jacobian`` or ``residual_tangent``, ``accelerated_outputs``.
    precompute : callable, optional
        ``p -> c``, constants that follow from the parameters, c[:n_p] = p; without it c = p.

    Attributes
    ----------
    metadata : str
    names : tuple of str
        Kernels that can be made.
    """

    def __init__(
        self,
        metadata: str | Mapping[str, Any],
        blocks: Mapping[str, Block],
        precompute: Callable[[Array], Array] | None = None,
    ) -> None:
        self.layout = Layout(metadata)
        self.metadata = metadata if isinstance(metadata, str) else json.dumps(dict(metadata))
        self.blocks = dict(blocks)
        self.precompute = precompute
        self.drivers = Drivers(self.layout, self.blocks)
        self.names = tuple(name for name in NAMED if name in self.blocks or name in self.drivers.names)

    def context(self, p: Any = None, u: Any = None, error: Callable[[str], Exception] = ValueError) -> Context:
        """Bind parameters (n_p,) and inputs (n_u,), the declared values by default.

        Raises
        ------
        error
            For a wrong shape.
        """
        data = self.layout.metadata
        p = _declared(data["p_values"]) if p is None else p
        p = _vector(p, self.layout.n_p, "p", error)
        u = _vector(_declared(data["u_values"]) if u is None else u, self.layout.n_u, "u", error)
        return Context(p, u, self.constants(p))

    def constants(self, p: Array) -> Array:
        """The constants handed to the blocks; what uses one that is not finite tells the cause."""
        if self.precompute is None:
            return p
        try:
            with np.errstate(all="ignore"):
                return np.asarray(self.precompute(p), dtype=float)
        except ArithmeticError:  # Python's own numbers raise where NumPy's become infinite: 1.0 / 0.0
            raise not_finite(f"the constants of the model cannot be computed; {TO_BE_FINITE}") from None

    def timed(
        self, name: str, context: Context, shape: Any, fail: Any, nan: bool = False, error: Any = ValueError
    ) -> NumpyTimed:
        """Bind a kernel called as ``f(t, x, p=None, u=None, out=None)``.

        Parameters
        ----------
        name : str
        context : Context
        shape : tuple of int
            Shape of the result for one state.
        fail : callable
            Called as ``fail(name, status, t, x)`` when the kernel fails, then p and u if any was given; it must raise.
        nan : bool
            At a recoverable failure record it in ``failure`` instead, and put NaN where an entry is no finite number,
            or everywhere if it is another failure.
        error : type
            Exception raised for arguments that do not fit.
        """
        return NumpyTimed(self, name, context, shape, fail, nan, error)

    def state(
        self, name: str, context: Context, shape: Any, fail: Any, nan: bool = False, error: Any = ValueError
    ) -> NumpyState:
        """Bind a kernel called as ``f(x, p=None, u=None, out=None, t=0.0)``; arguments as for :meth:`timed`."""
        return NumpyState(self, name, context, shape, fail, nan, error)

    def motion(
        self, name: str, context: Context, shape: Any, fail: Any, nan: bool = False, error: Any = ValueError
    ) -> NumpyMotion:
        """Bind a kernel called as ``f(q, v, a, p=None, u=None, out=None, t=0.0)``; arguments as for :meth:`timed`."""
        return NumpyMotion(self, name, context, shape, fail, nan, error)


class NumpyKernel:
    """A kernel bound to a context.

    Attributes
    ----------
    name : str
    shape : tuple of int
        Shape of the result for one state.
    nan : bool
        Whether a recoverable failure fills the result with NaN instead of raising.
    failure : tuple or None
        With ``nan``: (status, t, x) of the last failure.
    """

    def __init__(
        self, core: NumpyCore, name: str, context: Context, shape: Any, fail: Any, nan: bool, error: Any
    ) -> None:
        if name not in core.names:
            raise error(f"model {core.layout.name!r} has no kernel {name!r}; it has {', '.join(core.names)}")
        self.core, self.name, self.context, self.shape = core, name, context, tuple(shape)
        self.fail, self.nan, self.error = fail, nan, error
        self.failure: tuple[int, float, Array] | None = None
        self.n_in = core.layout.inputs(name)
        block = core.blocks.get(name)
        self.vectorised = block is not None
        self.call: Block = block if block is not None else core.drivers.make(name)

    def read(self, value: object, label: str, n: int) -> Array:
        """An argument with n rows, or the time, as an array of floats."""
        found = as_real(value)
        if found is not None:
            return found
        wanted = "be a real number, or (k,)" if label == "t" else f"hold real numbers, ({n},) or ({n}, k)"
        raise self.error(f"{argument(self.name, label)} of {self.name} must {wanted}, not {shown(value)}")

    def misfit(self, label: str, n: int, given: Array) -> Exception:
        """The error for a wrong shape."""
        error: Exception = self.error(
            f"{argument(self.name, label)} of {self.name} must have shape ({n},) or ({n}, k), not {given.shape}"
        )
        return error

    def by_name(self, label: str, given: Any, bound: Array) -> Any:
        """Values by name as an array, the others as bound, where who asked for the kernel knows names."""
        return self.fail.vector(label, given, bound) if hasattr(self.fail, "vector") else given

    def evaluate(self, t: Any, x: Array, p: Any, u: Any, out: Array | None) -> Array:
        """One state or a batch."""
        layout = self.core.layout
        if x.shape[:1] != (self.n_in,) or x.ndim > 2:
            raise self.misfit("x", self.n_in, x)
        p, u = self.by_name("p", p, self.context.p), self.by_name("u", u, self.context.u)
        c = self.context.c
        if p is not None:
            c = self.core.constants(_vector(p, layout.n_p, "p", self.error))
        given = () if p is None and u is None else (p,)
        force = self.context.u if u is None else self.read(u, "u", layout.n_u)
        if force.shape not in ((layout.n_u,), (layout.n_u, *x.shape[1:])):
            raise self.misfit("u", layout.n_u, force)
        t = self.read(t, "t", 0)
        if t.shape not in ((), x.shape[1:]):
            raise self.error(f"t of {self.name} must be a number or have shape (k,), not {t.shape}")
        expected = (*self.shape, *x.shape[1:])
        if out is not None:
            fitting(out, expected, f"out of {self.name}", self.error)
        with np.errstate(all="ignore"):
            if x.ndim == 1 or self.vectorised:
                result = self._batch(t, x, force, c, expected, given)
            else:
                result = np.empty(expected)
                for j in range(x.shape[1]):
                    column = force if force.ndim == 1 else force[:, j]
                    result[..., j] = self._single(t[j] if t.ndim else t, x[:, j], column, c, given)
        if out is None:
            return result
        out[...] = result
        return out

    def _batch(
        self, t: Array, x: Array, u: Array, c: Array, expected: tuple[int, ...], given: tuple[Any, ...]
    ) -> Array:
        if x.ndim == 1:
            return self._single(t, x, u, c, given)
        try:
            result = np.asarray(self.call(t, x, u, c), dtype=float).reshape(expected)
        except EvaluationError:
            result = np.full(expected, np.nan)
        if not np.isfinite(result).all():
            for j in range(x.shape[1]):  # one by one, to find out which and why
                if not np.isfinite(result[..., j]).all():
                    column = u if u.ndim == 1 else u[:, j]
                    result[..., j] = self._single(t[j] if t.ndim else t, x[:, j], column, c, given)
        return result

    def _single(self, t: Any, x: Array, u: Array, c: Array, given: tuple[Any, ...]) -> Array:
        time, result = float(t), np.full(self.shape, np.nan)
        try:
            result = np.array(self.call(time, x, u, c), dtype=float).reshape(self.shape)
            status = 0 if np.isfinite(result).all() else self.core.drivers.singular(self.name, time, x, u, c)
        except EvaluationError as error:
            status = CODES.get(type(error), 1)
        if status:
            if not self.nan:
                self.fail(self.name, status, time, np.array(x), *given, *([np.array(u)] if given else []))
            self.failure = (status, time, np.array(x))
            result[~np.isfinite(result) | (status != NON_FINITE)] = np.nan
        return result


class NumpyTimed(NumpyKernel):
    """A kernel of time and state; of a jacobian ``others(name)`` is the kernel by something else."""

    others: Any = None

    @both_names
    def __call__(
        self, t: Any, x: ArrayLike, p: Any = None, u: Any = None, out: Array | None = None, wrt: str | None = None
    ) -> Array:
        """Evaluate at time t, or one time for each state (k,), and state x (n,) or k states as columns (n, k)."""
        if wrt is not None and self.others is None:
            raise TypeError(f"{self.name} has no argument wrt")
        if wrt not in (None, "x", "u", "p"):
            raise self.error(f"wrt must be 'x' (the state), 'u' (the inputs) or 'p' (the parameters), not {wrt!r}")
        if wrt in ("u", "p"):
            return np.asarray(self.others(f"{'input' if wrt == 'u' else 'parameter'}_jacobian")(t, x, p, u, out))
        return self.evaluate(t, self.read(x, "x", self.n_in), p, u, out)


class NumpyState(NumpyKernel):
    """A kernel of the state alone."""

    @both_names
    def __call__(self, x: ArrayLike, p: Any = None, u: Any = None, out: Array | None = None, t: Any = 0.0) -> Array:
        """Evaluate at state x; arguments as for :class:`NumpyTimed`."""
        return self.evaluate(t, self.read(x, "x", self.n_in), p, u, out)


class NumpyMotion(NumpyKernel):
    """A kernel of coordinates, velocities and accelerations."""

    @both_names
    def __call__(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a: ArrayLike,
        p: Any = None,
        u: Any = None,
        out: Array | None = None,
        t: Any = 0.0,
    ) -> Array:
        """Evaluate at q, v, a of shapes (n_q,), (n_v,), (n_v,) or with a last axis k."""
        layout = self.core.layout
        sizes = (layout.n_q, layout.n_v, layout.n_v)
        parts = [self.read(part, label, n) for part, label, n in zip((q, v, a), "qva", sizes, strict=True)]
        columns = max((part.shape[1:] for part in parts), key=len)
        for part, label, n in zip(parts, "qva", sizes, strict=True):
            if part.shape not in ((n,), (n, *columns)) or part.ndim > 2:
                raise self.misfit(label, n, part)
        x = [part if part.shape[1:] == columns else np.repeat(part[:, None], columns[0], axis=1) for part in parts]
        return self.evaluate(t, np.concatenate(x), p, u, out)


def _declared(values: Any) -> list[float]:
    """Values as the metadata hold them, where what is not given is null."""
    return [np.nan if value is None else value for value in values]


def _vector(value: object, n: int, label: str, error: Any) -> Array:
    return np.array(read_vector(label, value, n, error))
