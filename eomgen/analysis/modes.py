"""A linearization at rest -> natural frequencies, mode shapes, damping ratios.

Undamped modes solve ``K s = omega^2 M s`` (L. Meirovitch, Fundamentals of Vibrations, 2001, sections 4.6 and 7.5),
damped ones are the eigenvalues of A.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Unpack, overload

import numpy as np
from numpy.typing import ArrayLike

from ..base import algebra
from ..base.algebra import Array, definite_factor
from ..base.limits.numbers import SHOWN_COMPLEX
from ..base.results import Result, ResultTable, image_html, plain, same_keys
from ..base.texts import html_table, html_text, number
from ..errors import EomgenError, cannot, off_range
from ..runtime.argument_checks import read_numbers
from ..runtime.drawing import load_show
from ..runtime.initial import Initial
from ..runtime.plotting import printed_names
from .equilibrium import equilibrium
from .limits import SYMMETRIC
from .linear import linearize
from .linearization import Linearization, symmetric_modes, uncertainty

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel
    from ..runtime.trajectory import FilmOptions
    from ..show.page import InlinePage
    from ..show.writers import InlineFilm


COLUMNS = 12  #: of mode shapes in the table of a notebook
SHAPES = 3  #: modes that a notebook shows


class Damped(NamedTuple):
    """One damped mode: a pair of complex eigenvalues, or one real one."""

    eigenvalue: complex  #: 1/s, with the positive imaginary part
    frequency: float  #: natural frequency abs(eigenvalue), rad/s
    damped: float  #: frequency of the oscillation, its imaginary part, rad/s
    ratio: float  #: damping ratio, 1 or -1 for real eigenvalues, 0 for a zero


class Modes(Result):
    """Natural frequencies, mode shapes and damping of small motions about an equilibrium.

    First-order states stand still in the undamped modes; the damped ones are those of the whole model.

    Attributes
    ----------
    squares : (n_dof,) array
        omega^2 of ``K s = omega^2 M s``, ascending (1/s^2); negative for modes that diverge.
    frequencies : (n_dof,) array
        omega (rad/s), 0 where the square is negative or belongs to a rigid-body mode.
    hertz : (n_dof,) array
    shapes : (n_dof, n_dof) array
        Columns: amplitudes of the independent velocities' displacements, with s^T M s = 1 and the largest positive.
    motions : (n_v, n_dof) array
        The same for all velocities of the tree, ``v_names``.
    names : tuple of str
        Rows of shapes.
    rigid, diverging : int
        Numbers of rigid-body modes and of modes with negative squares.
    damped : list of Damped
        The modes with damping and gyroscopic terms, slow ones first.
    linear : Linearization
    """

    KEYS = same_keys("names", "squares", "frequencies", "hertz", "shapes", "rigid", "diverging")

    def __init__(self, linear: Linearization, module: BoundModel) -> None:
        assert linear.mass is not None
        assert linear.tangent is not None
        self.linear, self.name, self._module = linear, linear.name, module
        states = {*linear.layout.states}
        n = sum(name not in states for name in linear.velocity_names)  # those of first-order states are the last
        self.names, self.v_names = linear.velocity_names[:n], linear.layout.v
        self.squares, self.shapes = _undamped(linear.mass[:n, :n], stiffness(linear)[:n, :n])
        turned = np.abs(linear.A[: len(linear.position_names), len(linear.position_names) :])
        K_error = (linear.stiffness_error @ turned)[:n, :n]
        still = np.abs(self.squares) <= uncertainty(self.squares, self.shapes, K_error)
        self._still = still
        self.rigid, self.diverging = int(still.sum()), int((self.squares[~still] < 0.0).sum())
        self.frequencies = np.sqrt(np.where(still, 0.0, np.maximum(self.squares, 0.0)))
        self.hertz = self.frequencies / (2.0 * np.pi)
        self.motions = linear.tangent.B[:, :n] @ self.shapes

    @cached_property
    def damped(self) -> list[Damped]:
        """The modes with damping and gyroscopic terms, slow ones first."""
        values = self.linear.eigenvalues
        tiny = SYMMETRIC * max(1.0, float(np.abs(values).max(initial=0.0)))
        result = []
        for value in values:
            if value.imag < -tiny:
                continue
            size = float(abs(value))
            ratio = 0.0 if size <= tiny else float(-value.real / size)
            imaginary = float(value.imag) if value.imag > tiny else 0.0
            result.append(Damped(complex(value), size, imaginary, ratio))
        return sorted(result, key=lambda mode: mode.frequency)

    def to_dict(self) -> dict[str, Any]:
        keys = ("eigenvalue", "frequency", "damped_frequency", "ratio")
        return super().to_dict() | {"damped": [dict(zip(keys, map(plain, mode), strict=True)) for mode in self.damped]}

    @property
    def title(self) -> str:
        return f"Modes of {self.name}"

    def _frequency(self, k: int) -> tuple[str, str]:
        """The frequency of a mode in rad/s and Hz, or what kind of motion it is instead."""
        if self.frequencies[k] == 0.0:
            return "rigid body" if self._still[k] else f"diverges, {np.sqrt(-self.squares[k]):.6g} 1/s", ""
        return f"{self.frequencies[k]:.6g}", f"{self.hertz[k]:.6g}"

    @property
    def facts(self) -> list[tuple[str, str]]:
        names = [name.removesuffix("_dot") for name in self.names]
        lines = []
        for k in range(len(self.squares)):
            shape = ", ".join(f"{name} {x:.4g}" for name, x in zip(names, self.shapes[:, k], strict=True))
            rate, hertz = self._frequency(k)
            lines.append((f"mode {k + 1}", f"{rate} rad/s, {hertz} Hz: {shape}" if hertz else f"{rate}: {shape}"))
        return lines + self._with_damping

    @property
    def _with_damping(self) -> list[tuple[str, str]]:
        rounded = ((mode.eigenvalue, mode.ratio if abs(mode.ratio) > SHOWN_COMPLEX else 0.0) for mode in self.damped)
        return [("with damping", f"{number(value)}, ratio {ratio:.4g}") for value, ratio in rounded]

    def _table(self) -> str:
        """Frequencies and shapes, a row for each mode, and the eigenvalues with damping, for notebooks."""
        names = [name.removesuffix("_dot") for name in self.names[:COLUMNS]]
        heads = [*map(printed_names(self._module.metadata, "html"), names), *["..."] * (len(self.names) > COLUMNS)]
        rows = [
            [str(k + 1), *self._frequency(k), *(f"{x:.4g}" for x in self.shapes[: len(names), k])]
            for k in range(len(self.squares))
        ]
        table = ResultTable(["mode", "rad/s", "Hz", *heads], rows).to_html(printed=True)
        damped = html_table("", self._with_damping) if self.damped else ""
        return f"<b>{html_text(self.title)}</b>{table}{damped}"

    @overload
    def animate(self, mode: int, file: str | Path, **options: Unpack[FilmOptions]) -> Path: ...
    @overload
    def animate(
        self, mode: int = 1, *, format: Literal["gif", "mp4"], **options: Unpack[FilmOptions]
    ) -> InlineFilm: ...
    @overload
    def animate(
        self, mode: int = 1, file: None = None, *, format: Literal["html"] | None = None, **options: Unpack[FilmOptions]
    ) -> InlinePage: ...
    def animate(self, mode: int = 1, file: str | Path | None = None, **options: Any) -> Any:
        """Show an animation of a mode shape, enlarged so that it is visible; loops stay closed.

        Parameters
        ----------
        mode : int
            From 1, the slowest, as they are listed.
        file : str or Path, optional
            ``.gif``, ``.mp4``, ``.html`` or a folder for frames, as of a trajectory; a page by default.
        **options
            ``format``, ``names``, ``axes``, ``trace``, ``fps``, ``dpi`` as of
            :meth:`~..runtime.trajectory.Trajectory.animate`.

        Raises
        ------
        UsageError
            There is no such mode, or the model has no bodies.
        MissingDependencyError
        """
        if isinstance(mode, bool) or not isinstance(mode, int) or not 1 <= mode <= len(self.squares):
            raise off_range(f"mode is one of 1 to {len(self.squares)}, not {mode!r}")
        return self._show().animate_mode(self._module, self.linear.x, self._shape(mode - 1), file, **options)

    def _show(self) -> Any:
        return load_show("mode_shapes")

    def _shape(self, k: int) -> tuple[Array, str]:
        """The displacements q' of a mode, and what is written above it."""
        v, space = self.motions[:, k], self.linear.layout.space
        result = v if space is None else space.rates(self.linear.x[: self.linear.layout.n_q], v)
        return result, f"mode {k + 1}" + (f": {self.hertz[k]:.4g} Hz" if self.hertz[k] else "")

    def _repr_html_(self) -> str:
        table = self._table()
        if self._module.info.picture is None or not len(self.squares):
            return table
        swinging = [k for k in range(len(self.squares)) if self.hertz[k]] or list(range(len(self.squares)))
        pictures = [self._shape(k) for k in swinging[:SHAPES]]
        try:
            data = self._show().swinging_gif(self._module, self.linear.x, pictures)
        except EomgenError as error:
            return f"{table}<p><i>no picture: {html_text(str(error).partition(chr(10))[0])}</i></p>"
        return table + image_html(data, "gif")


def stiffness(linear: Linearization) -> Array:
    """K (n_dof, n_dof) by the displacements that the independent velocities make."""
    assert linear.stiffness is not None
    n_z = len(linear.position_names)
    return np.asarray(linear.stiffness @ linear.A[:n_z, n_z:])


def _undamped(M: Array, K: Array) -> tuple[Array, Array]:
    if not M.size:
        return np.zeros(0), np.zeros((0, 0))
    factor = definite_factor(M, "modes")
    inverse = algebra.inv(factor)
    reduced = inverse @ K @ inverse.T
    if np.abs(reduced - reduced.T).max() <= SYMMETRIC * max(1.0, np.abs(reduced).max()):
        squares, shapes = symmetric_modes(M, K)
        vectors = factor.T @ shapes
    else:
        values, complexes = algebra.eig(reduced)
        if np.abs(values.imag).max() > SYMMETRIC * max(1.0, np.abs(values).max()):
            raise cannot(
                "the undamped modes are not real, because the stiffness matrix is not symmetric (a force follows the "
                "motion of a body); use the eigenvalues of linearize()"
            )
        order = np.argsort(values.real)
        squares, vectors = values.real[order], complexes.real[:, order]
    shapes = inverse.T @ vectors
    shapes /= np.sqrt(np.einsum("ik,ij,jk->k", shapes, M, shapes))
    largest = np.abs(shapes).argmax(axis=0)
    shapes *= np.where(shapes[largest, np.arange(len(squares))] < 0.0, -1.0, 1.0)
    return np.asarray(squares), np.asarray(shapes)


@np.errstate(all="ignore")
def modes(
    module: BoundModel,
    /,
    x: Mapping[str, float] | ArrayLike | None = None,
    t: float = 0.0,
    *,
    p: Any = None,
    u: Any = None,
    independent: Sequence[str] | None = None,
) -> Modes:
    """Natural frequencies, mode shapes and damping ratios of small motions about an equilibrium.

    Parameters
    ----------
    x : mapping of str to float, or (n_x,) or (n_q,) array, optional
        The equilibrium, at rest where only coordinates are given; by default the one that :meth:`equilibrium` finds
        from the declared initial position.
    t : float
    p, u : optional
        As for ``bind``.
    independent : sequence of str, optional
        Coordinates to give the shapes in.

    Returns
    -------
    Modes
        ``frequencies`` (rad/s), ``hertz``, ``shapes``, ``motions``, ``rigid``, ``damped``.

    Raises
    ------
    UsageError
        The state is no equilibrium.
    EquilibriumError
        None was found.
    """
    module = module.bind(p, u)
    if x is None:
        x = equilibrium(module, t=t).x
    if isinstance(x, Mapping):
        at_rest = not Initial(module.kernels, t, x).sort(x).rates
        x = module.x0(x, t=t)[: module.n_q if at_rest else module.n_x]
    state = np.array(read_numbers("x", x))
    if state.shape == (module.n_q,):
        state = np.concatenate([state, np.zeros(module.layout.n_v)])
    linear = linearize(module, state, t, independent=independent)
    if not linear.is_equilibrium:
        k = int(np.abs(linear.drift).argmax())
        raise cannot(
            f"modes() needs an equilibrium, and at this state {linear.states[k]} changes at a rate of "
            f"{linear.drift[k]:.6g}; find one with equilibrium(), or use the eigenvalues of linearize()"
        )
    return Modes(linear, module)
