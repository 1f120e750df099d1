"""The keywords that a call passes on -> their types, which type checkers and editors read."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, TypeAlias, TypedDict

from numpy.typing import ArrayLike

if TYPE_CHECKING:
    from .bound_model import BoundModel

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


class ReducedOptions(BoundValues, total=False):
    """Steps of a run with sensitivities."""

    max_step: Number | None
    first_step: Number | None
    min_step: float


class FilmOptions(TypedDict, total=False):
    """How an animation looks."""

    fps: float
    names: bool | None
    axes: bool
    trace: str | Sequence[str]
    dpi: float


class AnimationOptions(FilmOptions, total=False):
    """And what of a run it shows."""

    model: BoundModel | None
    speed: float | None
    plot: str | Sequence[str]
    forces: bool | str | Sequence[str]


class BuildOptions(TypedDict, total=False):
    """Fields of :class:`eomgen.toolchain.compiler.Options`."""

    optimize: int | None
    native: bool
    warnings: bool
    extra: Sequence[str]
    compiler: str | None
    lanes: int | None
    jobs: int | None


class RobotKeywords(TypedDict, total=False):
    """Fields of :class:`eomgen.importers.RobotOptions`, besides ``check_inertia``."""

    floating: bool
    rotation: str
    gravity: Any
    mimic: str
    lock: Any
    merge: bool
    symbolic: bool
    actuate: Any
    friction: Any
    snap: float
    assets: str | None
    limits: str


class LoadOptions(RobotKeywords, total=False):
    """What :func:`eomgen.load` takes."""

    allow_native: bool
    check_inertia: bool | str | None
