"""Stage runtime: the interfaces of cores and kernels, for readers and type checkers; nothing imports it to run."""

from __future__ import annotations

from typing import Any, Protocol

from numpy.typing import ArrayLike

from ..numeric.scales import Array


class Timed(Protocol):
    """A kernel of time and state."""

    failure: tuple[int, float, Array] | None  #: with NaN for failures: (status, t, x) of the last one

    def __call__(
        self,
        t: ArrayLike,
        x: ArrayLike,
        p: ArrayLike | None = None,
        u: ArrayLike | None = None,
        out: Array | None = None,
    ) -> Array: ...


class State(Protocol):
    """A kernel of the state, or of the coordinates, alone."""

    failure: tuple[int, float, Array] | None

    def __call__(
        self,
        x: ArrayLike,
        p: ArrayLike | None = None,
        u: ArrayLike | None = None,
        out: Array | None = None,
        t: ArrayLike = 0.0,
    ) -> Array: ...


class Motion(Protocol):
    """A kernel of coordinates, velocities and accelerations."""

    def __call__(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a: ArrayLike,
        p: ArrayLike | None = None,
        u: ArrayLike | None = None,
        out: Array | None = None,
        t: ArrayLike = 0.0,
    ) -> Array: ...


class Core(Protocol):
    """What both targets give Python: the Cython extension module ``_core``, or a :class:`~.numpy_core.NumpyCore`."""

    metadata: str
    names: tuple[str, ...]

    def context(self, p: Any = None, u: Any = None, error: type[Exception] = ValueError) -> Any: ...
    def timed(
        self, name: str, context: Any, shape: tuple[int, ...], fail: Any, nan: bool = False, error: Any = ...
    ) -> Any: ...
    def state(
        self, name: str, context: Any, shape: tuple[int, ...], fail: Any, nan: bool = False, error: Any = ...
    ) -> Any: ...
    def motion(
        self, name: str, context: Any, shape: tuple[int, ...], fail: Any, nan: bool = False, error: Any = ...
    ) -> Any: ...
    def __hash__(self) -> int: ...
