"""A core (compiled or NumPy), parameters and inputs -> the calls of one model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike

from ..base.algebra import Array, Indices
from ..base.numeric.assembly import ConstraintSystem, CutJoints
from ..errors import cannot, ill_shaped, no_choice, not_finite
from .argument_checks import fitting, read_numbers
from .argument_names import both_names
from .failure import Fail
from .layout import Layout
from .refusals import require_support
from .start_values import at_parameters

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
            self.layout = layout = at_parameters(layout, self.context.p)
        self.fail = Fail(self)
        self._derivatives: dict[str, Timed] = {}

    def _rows(self, name: str, independent: Indices) -> Rows:
        return Rows(self.state(name), independent)

    constraints = cached_property["Rows"](
        lambda self: self._rows("constraints", self.layout.rows[self.layout.rows < self.layout.n_h])
    )
    constraint_jacobian = cached_property["Rows"](lambda self: self._rows("constraint_jacobian", self.layout.rows))
    velocity_constraints = cached_property["Rows"](lambda self: self._rows("velocity_constraints", self.layout.rows))
    mass_matrix: State = cast("State", property(lambda self: self.state("mass_matrix")))
    embedded_mass_matrix: State = cast("State", property(lambda self: self.state("embedded_mass_matrix")))
    bias: Timed = cast("Timed", property(lambda self: self.timed("bias")))
    inverse_dynamics: Motion = cast("Motion", property(lambda self: self.motion("inverse_dynamics")))

    def derivative(self, name: str) -> Timed:
        """The kernel ``input_jacobian`` or ``parameter_jacobian``, made once."""
        if name not in self._derivatives:
            refused = self.layout.given_rates or not self.layout.projects
            self._derivatives[name] = (
                cast("Timed", Refused(lambda: require_support(self.layout, name))) if refused else self.timed(name)
            )
        return self._derivatives[name]

    def _unscaled(self, *_: Any) -> None:
        """Refuse parameters whose lengths and masses scale nothing."""
        given = zip(self.layout.p, self.context.p, strict=True)
        bad = [f"{name} = {value:.6g}" for name, value in given if not np.isfinite(value)]
        raise not_finite(f"the sizes computed from the parameters are not finite{': ' * bool(bad)}{', '.join(bad)}")

    def timed(self, name: str, nan: bool = False) -> Timed:
        """A kernel called as ``f(t, x, p=None, u=None, out=None)``; NaN for recoverable failures if `nan`."""
        return cast("Timed", self._make("timed", name, nan))

    def state(self, name: str, nan: bool = False) -> State:
        """A kernel called as ``f(x, p=None, u=None, out=None, t=0.0)``."""
        return cast("State", self._make("state", name, nan))

    def motion(self, name: str) -> Motion:
        """A kernel called as ``f(q, v, a, p=None, u=None, out=None, t=0.0)``."""
        return cast("Motion", self._make("motion", name, False))

    def assembly_jacobian(self, t: float, x: Array) -> Array:
        """[C, C_q v + C_t, loop coordinates, their rates] by [q, v, u, p]."""
        return self.state("assembly_jacobian")(x, t=t)

    def output_derivatives(self, t: float, x: Array, a: Array) -> Array:
        """Outputs by [q, v, a, u, p], each at fixed others; (n_y, n_x + n_v + n_u + n_p)."""
        return self.motion("output_derivatives")(x[: self.layout.n_q], x[self.layout.n_q :], a, t=t)

    def rows(self, name: str, chosen: Any, t: float, x: Array, u: Array | None = None) -> Array:
        """Rows of a timed kernel at one state; the others need not be numbers there."""
        found = np.asarray(self.timed(name, nan=True)(t, x, u=u)[chosen])
        if not np.isfinite(found).all():
            self.timed(name)(t, x, u=u)  # tells what is wrong
        return found

    def _make(self, kind: str, name: str, nan: bool) -> Any:
        layout = self.layout
        shape = layout.shape(name)
        if name in self.core.names:
            return getattr(self.core, kind)(name, self.context, shape, self.fail, nan, ill_shaped)
        if 0 in shape:
            return DERIVED[kind](name, lambda *x, **_: np.zeros((*shape, *batch_of(x, layout.inputs(name)))))
        if not layout.n_c and name == "project":
            return DERIVED[kind](name, self._normalised)
        if not layout.rank and name == "embedded_mass_matrix":
            every, order = self.state("mass_matrix", nan), np.ix_(layout.independent, layout.independent)
            return DERIVED[kind](name, lambda x, **given: np.array(every(x, **given)[order]))
        if name == "energy" and not layout.energy_known:
            return Refused(lambda: cannot(ENERGY.format(layout.name)))
        message = f"model {layout.name!r} was generated without the kernel {name!r}"
        return Refused(lambda: cannot(f"{message}; compile again with kernels=None for all, or name it in kernels"))

    def _normalised(self, x: ArrayLike, **given: Any) -> Array:
        """The projection of a tree: nothing to do but for the length of Euler parameters."""
        result = np.array(read_numbers("x", x))
        batch_of((result,), self.layout.n_x)
        for i, _ in self.layout.quaternion_slots:
            result[i : i + 4] /= np.sqrt((result[i : i + 4] ** 2).sum(axis=0))
        return result


class Derived:
    """A call that is made of kernels, and has the arguments of one.

    Parameters
    ----------
    name : str
        Of that kernel, for messages.
    find : callable
        ``find(*arrays, p=, u=, t=)`` -> its result.
    """

    failure: tuple[int, float, Array] | None = None

    def __init__(self, name: str, find: Callable[..., Array]) -> None:
        self.name, self.find = name, find


class DerivedTimed(Derived):
    """Of time and state."""

    @both_names
    def __call__(self, t: Any, x: Any, p: Any = None, u: Any = None, out: Array | None = None) -> Array:
        """Evaluate."""
        return into(out, self.find(x, p=p, u=u, t=t))


class DerivedState(Derived):
    """Of the state, or the coordinates, alone."""

    @both_names
    def __call__(self, x: Any, p: Any = None, u: Any = None, out: Array | None = None, t: Any = 0.0) -> Array:
        """Evaluate."""
        return into(out, self.find(x, p=p, u=u, t=t))


class DerivedMotion(Derived):
    """Of coordinates, velocities and accelerations."""

    @both_names
    def __call__(
        self, q: Any, v: Any, a: Any, p: Any = None, u: Any = None, out: Array | None = None, t: Any = 0.0
    ) -> Array:
        """Evaluate."""
        return into(out, self.find(q, v, a, p=p, u=u, t=t))


DERIVED: dict[str, Any] = {"timed": DerivedTimed, "state": DerivedState, "motion": DerivedMotion}


def batch_of(arrays: Sequence[Any], n: int) -> tuple[int, ...]:
    """The last axis (k,) of n numbers for each of k states, or none of one state; of several arrays n are all theirs.

    Raises
    ------
    UsageError
        The first has another shape.
    """
    shape = read_numbers("x", arrays[0]).shape
    if len(arrays) == 1 and (shape[:1] != (n,) or len(shape) > 2):
        raise ill_shaped(f"x must have shape ({n},) or ({n}, k), not {shape}")
    return shape[1:]


class Refused:
    """In place of a call that a model cannot have: says why when it is called.

    Parameters
    ----------
    refuse : callable
        Raises the error, or returns it.
    """

    failure: tuple[int, float, Array] | None = None

    def __init__(self, refuse: Callable[[], Any]) -> None:
        self.refuse = refuse

    def __call__(self, *args: Any, **options: Any) -> Any:
        """Refuse.

        Raises
        ------
        UsageError
        """
        raise self.refuse()


class Rows:
    """A constraint kernel that gives the independent rows, or all of them; of those of C_q the first columns."""

    def __init__(self, every: State, independent: Sequence[int] | Indices, width: int | None = None) -> None:
        self.every, self.independent, self.width = every, independent, width

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
        if not isinstance(rows, str) or rows not in ("independent", "all"):
            raise no_choice(f"rows must be 'independent' or 'all', not {rows!r}")
        if rows == "all" and self.width is None:
            return self.every(q, p=p, u=u, out=out, t=t)
        result = self.every(q, p=p, u=u, t=t)
        result = result if rows == "all" else result[self.independent]
        return into(out, result if self.width is None else np.ascontiguousarray(result[:, : self.width]))


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


def into(out: Array | None, result: Array) -> Array:
    """A result, in the array that was given for it."""
    if out is not None:
        fitting(out, result.shape)[...] = result
    return result if out is None else out


# -- velocities without first-order states -----------------------------------------------------------------------------

# A state is a velocity of unit inertia that no constraint touches, so that its rows and columns are left out.


def mechanical(kernels: Kernels) -> dict[str, Any]:
    """The functions of M, h and the constraints of a model that has first-order states, by name."""
    layout = kernels.layout
    count = len(layout.states)
    n, free = layout.n_v - count, layout.n_dof - count
    M, embedded, bias = kernels.mass_matrix, kernels.embedded_mass_matrix, kernels.bias
    every, inverse = kernels.constraint_jacobian.every, kernels.inverse_dynamics

    def find_inverse(q: Any, v: Any, a: Any, **given: Any) -> Array:
        states, rates = read_numbers("v", v), read_numbers("a", a)
        if states.shape[:1] != (layout.n_v,):
            raise ill_shaped(
                f"inverse_dynamics of a model with first-order states takes v = [v; s], ({layout.n_v},) or "
                f"({layout.n_v}, k), not {states.shape}: forces depend on the states {', '.join(layout.states)}, which "
                "come after the velocities"
            )
        if rates.shape[:1] == (n,):
            rates = np.concatenate([rates, np.zeros((count, *rates.shape[1:]))])
        return np.array(inverse(q, states, rates, **given)[:n])

    return {
        "mass_matrix": DerivedState("mass_matrix", lambda q, **given: np.array(M(q, **given)[:n, :n])),
        "embedded_mass_matrix": DerivedState(
            "embedded_mass_matrix", lambda q, **given: np.array(embedded(q, **given)[:free, :free])
        ),
        "bias": DerivedTimed("bias", lambda x, t, **given: np.array(bias(t, x, **given)[:n])),
        "constraint_jacobian": Rows(every, layout.rows, n),
        "inverse_dynamics": DerivedMotion("inverse_dynamics", find_inverse),
    }


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
