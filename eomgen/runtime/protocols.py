"""The interfaces of cores and kernels, and the keywords that calls pass on, for readers, editors and type checkers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol, TypeAlias, TypedDict, Unpack

from numpy.typing import ArrayLike

from ..base.algebra import Array

#: Parameters or inputs of a call: an array of all, or values by name, where the others are as bound.
Values: TypeAlias = ArrayLike | Mapping[str, Any] | None


class Call(Protocol):
    """A kernel of any arguments."""

    failure: tuple[int, float, Array] | None  #: with NaN for failures: (status, t, x) of the last one

    def __call__(self, *args: Any, **raw: Any) -> Array: ...


class Bound(TypedDict, total=False):
    """The other names of ``p`` and ``u``."""

    parameters: Values
    inputs: Values


class Timed(Protocol):
    """A kernel of time and state; ``jacobian`` by the state, ``wrt="u"`` or ``wrt="p"``."""

    def __call__(
        self, t: ArrayLike, x: ArrayLike, p: Values = None, u: Values = None, out: Array | None = None,
        wrt: str | None = None, **raw: Unpack[Bound],
    ) -> Array: ...  # fmt: skip


class State(Protocol):
    """A kernel of the state, or of the coordinates, alone."""

    def __call__(
        self, x: ArrayLike, p: Values = None, u: Values = None, out: Array | None = None, t: ArrayLike = 0.0,
        **raw: Unpack[Bound],
    ) -> Array: ...  # fmt: skip


class Projection(Protocol):
    """The projection, whose second argument is the time: the constraints of drivers move with it."""

    def __call__(
        self, x: ArrayLike, t: ArrayLike = 0.0, p: Values = None, u: Values = None, out: Array | None = None,
        **raw: Unpack[Bound],
    ) -> Array: ...  # fmt: skip


class Rows(Protocol):
    """Constraints, their Jacobian or rates: of the independent rows, or of all with ``rows="all"``."""

    def __call__(
        self, q: ArrayLike, p: Values = None, u: Values = None, out: Array | None = None, t: ArrayLike = 0.0,
        rows: str = "independent", **raw: Unpack[Bound],
    ) -> Array: ...  # fmt: skip


class Motion(Protocol):
    """A kernel of coordinates, velocities and accelerations."""

    def __call__(
        self, q: ArrayLike, v: ArrayLike, a: ArrayLike, p: Values = None, u: Values = None, out: Array | None = None,
        t: ArrayLike = 0.0, **raw: Unpack[Bound],
    ) -> Array: ...  # fmt: skip


class Core(Protocol):
    """What both targets give Python: a Model of ``eomgen._native``, or of a package's own."""

    metadata: str
    names: tuple[str, ...]
    methods: tuple[str, ...]
    run: Any

    def context(self, p: Any = None, u: Any = None, error: Callable[[str], Exception] = ValueError) -> Any: ...
    def kernel(self, name: str, context: Any, shape: tuple[int, ...], fail: Any, *options: Any, **more: Any) -> Any: ...
    def __hash__(self) -> int: ...


class Source(Protocol):
    """Named columns (n_t,)."""

    names: tuple[str, ...]

    @property
    def energies(self) -> Array: ...
    @property
    def has_energies(self) -> bool: ...

    def __getitem__(self, name: str) -> Array: ...


# -- keywords that calls pass on ---------------------------------------------------------------------------------------

#: A number, or a text that is an expression of numbers: ``"1e-6"``, ``"deg(30)"``.
Number: TypeAlias = float | str


class BoundValues(TypedDict, total=False):
    """The other names of ``parameters`` and ``inputs``."""

    p: Any
    u: Any


class StepOptions(BoundValues, total=False):
    """Tolerances and steps of a solver."""

    rtol: Number | ArrayLike | None
    atol: Number | ArrayLike | None
    max_step: Number | None
    first_step: Number | None


class SolverOptions(BoundValues, total=False):
    """What SciPy's solvers take besides tolerances and steps."""

    jac: Any
    jac_sparsity: Any
    vectorized: bool
    lband: int | None
    uband: int | None
    min_step: float
    contact_tolerance: Number
    contact_iterations: int
    contact_forces: bool
