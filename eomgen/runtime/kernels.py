"""A core (compiled or NumPy), parameters and inputs -> the calls of one model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike

from ..base.algebra import Array
from ..errors import UsageError, cannot, ill_shaped, no_choice, not_finite
from ..numeric.assembly import ConstraintSystem, CutJoints
from .argument_checks import fitting, read_numbers
from .argument_names import both_names
from .failure import Fail
from .layout import Layout
from .refusals import Refusal

if TYPE_CHECKING:
    from .protocols import Core, Motion, State, Timed

# -- calls -------------------------------------------------------------------------------------------------------------

# A core is the part that differs between targets.  It offers ``metadata``, ``names``, ``context(p, u, error)`` and the
# makers ``timed``, ``state`` and ``motion``; see :class:`~.protocols.Core`.


ENERGY = (
    "the energy of the model {!r} is not known: its equations of motion are given without kinetic_energy; "
    "give equations.kinetic_energy, and equations.potential_energy if forces have a potential"
)


class Kernels:
    """The calls of one model, sharing one set of parameters and inputs.

    Here the velocities are [v; s], first-order states among them; :mod:`.kernels` leaves these out for users.
    Kernels that are properties are made anew when asked for: what is kept lives as long as Fail, which refers back.

    Parameters
    ----------
    core : Core
    layout : Layout
    p, u : arrays, optional
        Parameters (n_p,) and inputs (n_u,); the declared values by default.
    """

    def __init__(self, core: Core, layout: Layout, p: Array | None = None, u: Array | None = None) -> None:
        self.core = core
        self.layout = layout
        self.context = core.context(p, u, ill_shaped)
        if p is not None and "scales" in core.names:
            scales = core.state("scales", self.context, layout.shape("scales"), self._unscaled, False, ill_shaped)
            self.layout = layout = layout.sized(scales(np.empty(0)))
        if p is not None and not layout.metadata.keys().isdisjoint(("start_terms", "start_fixed")):
            from .late_start import started

            self.layout = layout = started(layout, self.context.p)
        self.fail = Fail(layout, self._culprit, self._poses if "poses" in core.names else None)
        self.constraints = Rows(self.state("constraints"), layout.rows[layout.rows < layout.n_h])
        self.constraint_jacobian = Rows(self.state("constraint_jacobian"), layout.rows)
        self.velocity_constraints = Rows(self.state("velocity_constraints"), layout.rows)
        self._derivatives: dict[str, Timed] = {}

    mass_matrix: State = cast("State", property(lambda self: self.state("mass_matrix")))
    embedded_mass_matrix: State = cast("State", property(lambda self: self.state("embedded_mass_matrix")))
    bias: Timed = cast("Timed", property(lambda self: self.timed("bias")))
    inverse_dynamics: Motion = cast("Motion", property(lambda self: self.motion("inverse_dynamics")))

    def derivative(self, name: str) -> Timed:
        """The kernel ``input_jacobian`` or ``parameter_jacobian``, made once."""
        if name not in self._derivatives:
            refused = self.layout.given_rates or not self.layout.projects
            self._derivatives[name] = cast("Timed", Refusal(self.layout)) if refused else self.timed(name)
        return self._derivatives[name]

    def _unscaled(self, *_: Any) -> None:
        """Refuse parameters whose lengths and masses scale nothing."""
        given = zip(self.layout.p, self.context.p, strict=True)
        bad = [f"{name} = {value:.6g}" for name, value in given if not np.isfinite(value)]
        raise not_finite(f"the sizes computed from the parameters are not finite{': ' * bool(bad)}{', '.join(bad)}")

    def timed(self, name: str, nan: bool = False) -> Timed:
        """A kernel called as ``f(t, x, p=None, u=None, out=None)``; NaN for recoverable failures if `nan`."""
        shape = self.layout.shape(name)
        if name not in self.core.names and 0 in shape:
            return cast("Timed", Nothing(np.zeros(shape), self.layout.inputs(name)))
        return cast("Timed", self._make(self.core.timed, name, nan))

    def rows(self, name: str, chosen: Any, t: float, x: Array, u: Array | None = None) -> Array:
        """Rows of a timed kernel at one state; the others need not be numbers there."""
        found = np.asarray(self.timed(name, nan=True)(t, x, u=u)[chosen])
        if not np.isfinite(found).all():
            self.timed(name)(t, x, u=u)  # tells what is wrong
        return found

    def state(self, name: str, nan: bool = False) -> State:
        """A kernel called as ``f(x, p=None, u=None, out=None, t=0.0)``."""
        layout = self.layout
        kernel: object = None
        if name not in self.core.names:
            if layout.shape(name)[0] == 0:
                kernel = Constant(np.zeros(layout.shape(name)), layout.inputs(name))
            elif layout.n_c == 0 and name == "project":
                kernel = Identity(layout.n_x, [i for i, _ in layout.quaternion_slots])
            elif layout.rank == 0 and name == "embedded_mass_matrix":
                kernel = Selected(self.state("mass_matrix", nan), layout.independent)
        return cast("State", self._make(self.core.state, name, nan) if kernel is None else kernel)

    def motion(self, name: str) -> Motion:
        """A kernel called as ``f(q, v, a, p=None, u=None, out=None, t=0.0)``."""
        shape = self.layout.shape(name)
        if name not in self.core.names and 0 in shape:
            return cast("Motion", lambda q, *_, **__: np.zeros((*shape, *np.shape(q)[1:])))
        return cast("Motion", self._make(self.core.motion, name, False))

    def _make(self, maker: Callable[..., Any], name: str, nan: bool) -> Any:
        if name not in self.core.names:
            if name == "energy" and not self.layout.energy_known:
                return Missing(name, ENERGY.format(self.layout.name))
            message = f"model {self.layout.name!r} was generated without the kernel {name!r}"
            return Missing(name, f"{message}; compile again with kernels=None for all, or name it in kernels")
        return maker(name, self.context, self.layout.shape(name), self.fail, nan, ill_shaped)

    def _poses(self, q: Array, t: float, p: Array | None = None) -> Array:
        return self.state("poses", nan=True)(q, t=t, p=p)

    def _culprit(self, status: int, t: float, x: Array, p: Array | None = None, u: Array | None = None) -> str:
        """Names what a failure at a state is due to, as far as it can be told."""
        from .failure import find_culprit

        try:
            return find_culprit(self, status, t, x, p, u)
        except UsageError:  # a kernel that would tell was not generated
            return ""


class Missing:
    """A kernel that was not generated: the module can be used without it."""

    failure: tuple[int, float, Array] | None = None

    def __init__(self, name: str, message: str) -> None:
        self.name = name
        self.message = message

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Refuse.

        Raises
        ------
        UsageError
        """
        raise cannot(self.message)


class Rows:
    """A constraint kernel that gives the independent rows, or all of them."""

    def __init__(self, every: State, independent: Sequence[int] | np.ndarray[Any, Any]) -> None:
        self.every, self.independent = every, independent

    @both_names
    def __call__(
        self,
        q: ArrayLike,
        p: Any = None,
        u: Any = None,
        out: Array | None = None,
        t: Any = 0.0,
        rows: str = "independent",
    ) -> Array:
        """Evaluate.

        Parameters
        ----------
        q : (n_q,) or (n_q, k) array; x, (n_x,) or (n_x, k), for velocity_constraints
        p, u : arrays, optional
        out : array, optional
        t : float
        rows : {"independent", "all"}
        """
        if isinstance(rows, str) and rows == "all":
            return self.every(q, p=p, u=u, out=out, t=t)
        if not isinstance(rows, str) or rows != "independent":
            raise no_choice(f"rows must be 'independent' or 'all', not {rows!r}")
        result = self.every(q, p=p, u=u, t=t)[self.independent]
        return into(out, result)


class Projection:
    """The projection, whose second argument is the time: the constraints of drivers move with it."""

    def __init__(self, kernel: State) -> None:
        self.kernel = kernel

    @both_names
    def __call__(
        self,
        x: ArrayLike,
        t: ArrayLike = 0.0,
        p: ArrayLike | None = None,
        u: ArrayLike | None = None,
        out: Array | None = None,
    ) -> Array:
        """The nearest state on the constraints.

        Parameters
        ----------
        x : (n_x,) or (n_x, k) array
        t : float or (k,) array
            Time (s).
        p, u : arrays, optional
            Parameters (n_p,) and inputs, (n_u,) or (n_u, k); those bound by default.
        out : array, optional
            Where the result goes.

        Returns
        -------
        (n_x,) or (n_x, k) array
        """
        return self.kernel(x, p=p, u=u, out=out, t=t)


class Constant:
    """A kernel whose result has no entries, such as the constraints of a tree."""

    failure: tuple[int, float, Array] | None = None

    def __init__(self, value: Array, n_in: int) -> None:
        self.value, self.n_in = value, n_in

    @both_names
    def __call__(self, x: ArrayLike, p: Any = None, u: Any = None, out: Array | None = None, t: Any = 0.0) -> Array:
        """An empty array, with a last axis for a batch."""
        shape = read_numbers("x", x).shape
        if shape[:1] != (self.n_in,) or len(shape) > 2:
            raise ill_shaped(f"x must have shape ({self.n_in},) or ({self.n_in}, k), not {shape}")
        expected = self.value.shape + shape[1:]
        return np.zeros(expected) if out is None else fitting(out, expected)


class Nothing(Constant):
    """A kernel of time and state whose result has no entries."""

    @both_names
    def __call__(  # type: ignore[override]
        self, t: ArrayLike, x: ArrayLike, p: Any = None, u: Any = None, out: Array | None = None
    ) -> Array:
        """An empty array, with a last axis for a batch."""
        return super().__call__(x, out=out)


class Identity(Constant):
    """The projection of a tree: nothing to do but for the length of Euler parameters."""

    def __init__(self, n_in: int, quaternion_slots: Sequence[int] = ()) -> None:
        super().__init__(np.zeros(n_in), n_in)
        self.quaternion_slots = quaternion_slots

    @both_names
    def __call__(self, x: ArrayLike, p: Any = None, u: Any = None, out: Array | None = None, t: Any = 0.0) -> Array:
        """A copy of x."""
        result = into(super().__call__(x, out=out), read_numbers("x", x))
        for i in self.quaternion_slots:
            result[i : i + 4] /= np.sqrt((result[i : i + 4] ** 2).sum(axis=0))
        return result


class Selected:
    """Rows and columns of a matrix kernel in another order."""

    failure: tuple[int, float, Array] | None = None

    def __init__(self, every: State, order: np.ndarray[Any, Any]) -> None:
        self.every, self.order = every, order

    @both_names
    def __call__(self, x: ArrayLike, p: Any = None, u: Any = None, out: Array | None = None, t: Any = 0.0) -> Array:
        """The matrix of the chosen coordinates."""
        result = self.every(x, p=p, u=u, t=t)[np.ix_(self.order, self.order)]
        return into(out, result)


def into(out: Array | None, result: Array) -> Array:
    """A result, in the array that was given for it."""
    if out is not None:
        fitting(out, result.shape)[...] = result
    return result if out is None else out


# -- velocities without first-order states -----------------------------------------------------------------------------

# A state is a velocity of unit inertia that no constraint touches, so that its rows and columns are left out.


class Mechanical:
    """The functions of M, h and the constraints of a model that has first-order states.

    Parameters
    ----------
    kernels : Kernels
    """

    def __init__(self, kernels: Kernels) -> None:
        layout = kernels.layout
        count = len(layout.states)
        n, free = layout.n_v - count, layout.n_dof - count
        self.mass_matrix: Any = MechanicalPart(kernels.mass_matrix, n, n)
        self.embedded_mass_matrix: Any = MechanicalPart(kernels.embedded_mass_matrix, free, free)
        self.bias: Any = MechanicalPart(kernels.bias, n)
        self.constraint_jacobian: Any = MechanicalPart(kernels.constraint_jacobian, None, n)
        self.inverse_dynamics: Any = MechanicalInverse(kernels, n)


class MechanicalPart:
    """The first rows and columns of a function's result; None: all."""

    def __init__(self, function: Any, *kept: int | None) -> None:
        self.function, self.kept = function, tuple(slice(None, k) for k in kept)

    def __call__(self, *args: Any, out: Array | None = None, **options: Any) -> Array:
        """Evaluate; arguments are those of the function."""
        return into(out, np.array(self.function(*args, **options)[self.kept]))

    def __repr__(self) -> str:
        return repr(self.function)


class MechanicalInverse:
    """Generalized forces to add, (n_v,), for accelerations a at q and [v; s]."""

    def __init__(self, kernels: Kernels, n: int) -> None:
        self.layout, self.function, self.n = kernels.layout, kernels.inverse_dynamics, n

    @both_names
    def __call__(self, q: Any, v: Any, a: Any, p: Any = None, u: Any = None, out: Any = None, t: Any = 0.0) -> Array:
        """Evaluate at q (n_q,), [v; s] (n_v + n_s,) and a (n_v,), or with a last axis k.

        Raises
        ------
        UsageError
            The states are missing, on which forces depend.
        """
        given, rates = read_numbers("v", v), read_numbers("a", a)
        whole = self.layout.n_v
        if given.shape[:1] != (whole,):
            names = ", ".join(self.layout.states)
            raise ill_shaped(
                f"inverse_dynamics of a model with first-order states takes v = [v; s], ({whole},) or ({whole}, k), "
                f"not {given.shape}: forces depend on the states {names}, which come after the velocities"
            )
        if rates.shape[:1] == (self.n,):
            rates = np.concatenate([rates, np.zeros((whole - self.n, *rates.shape[1:]))])
        return into(out, np.array(self.function(q, given, rates, p=p, u=u, t=t)[: self.n]))

    def __repr__(self) -> str:
        return repr(self.function)


# -- constraints -------------------------------------------------------------------------------------------------------


@lru_cache(maxsize=64)
def constraint_system(kernels: Kernels) -> ConstraintSystem:
    """The constraints of positions with the parameters of the kernels; dC/dq for C_q where q' is given."""
    layout = kernels.layout
    C = kernels.state("constraints", nan=True)
    slopes = "coordinate_slopes" if layout.n_coordinate_slopes else "constraint_jacobian"
    C_q, none = kernels.state(slopes, nan=True), np.zeros((0, layout.n_q))
    places = layout.n_h or not layout.given_rates  # rows of given velocities alone say nothing of q
    y, y_q = kernels.motion("loop_coordinates"), kernels.state("loop_coordinate_jacobian", nan=True)
    alignment, zero = kernels.state("alignment", nan=True), np.zeros(layout.n_v)

    def cut(q: Array, t: float) -> tuple[Array, Array]:
        return np.asarray(y(q, zero, zero, t=t), dtype=float)[0], y_q(q, t=t)

    joints = CutJoints(layout.loops, layout.loop_kinds, layout.loop_scales, cut)
    aligned = (lambda q, t: alignment(q, t=t)) if layout.n_alignments else None
    named = layout.place_scales, layout.q, layout.coordinate_kinds, layout.constraint_labels
    evaluate = (lambda q, t: (C(q, t=t), C_q(q, t=t))) if places else lambda q, t: (np.zeros(0), none)
    return ConstraintSystem(evaluate, *named, joints, aligned)
