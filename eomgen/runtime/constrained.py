"""A state -> the constraint rows that hold there, the motions that they leave, multipliers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.constraints import STATE as RANK
from ..base.scales import Scales
from ..base.texts import quote
from ..errors import ill_shaped, no_number
from .argument_checks import as_real, read_number, read_numbers, with_numbers
from .kernels import into

if TYPE_CHECKING:
    from .bound_model import BoundModel


# -- rows of gaps that are closed --------------------------------------------------------------------------------------


def closed_rows(module: BoundModel, x: Array) -> list[int]:
    """Places among the equations of constraints that close and open of those that are closed at a state (n_x,)."""
    rows = module.info.rows_to_hold
    return [k for k, (_, state, _) in enumerate(rows) if x[module.layout.x.index(state)] > 0.5]


def with_closed_rows(module: BoundModel, t: float, x: Array, C_q: Array) -> tuple[Array, Scales]:
    """The Jacobian (n_c, n_v) of the constraints with a row (by v) for each equation that is closed, and its scales."""
    layout, rows, closed = module.layout, module.info.rows_to_hold, closed_rows(module, x)
    if not closed:
        return C_q, layout.scales
    moving = layout.n_v - len(layout.states)
    places = layout.n_q + np.arange(moving)
    at = np.repeat(x[:, None], 1 + moving, axis=1)  # rates of equations are linear in the velocities
    at[places] = 0.0
    at[places, 1 + np.arange(moving)] = 1.0
    rates = module.kernels.held_errors(t, at)[1::2][closed]
    more = np.zeros((len(closed), layout.n_v))
    more[:, :moving] = rates[:, 1:] - rates[:, :1]
    sizes = [layout.length if rows[k][2] == "length" else 1.0 for k in closed]
    return np.vstack([C_q, more]), layout.scales._replace(c=np.concatenate([layout.scales.c, sizes]), groups=None)


# -- motions and multipliers -------------------------------------------------------------------------------------------


class ProjectedStates(NamedTuple):
    """Projected states and times, k of them, and what they are evaluated with."""

    module: BoundModel
    t: Array  #: (k,)
    x: Array  #: (n_x, k)
    options: dict[str, Any]  #: p and u
    single: bool  #: whether one state (n_x,) was given

    @property
    def q(self) -> Array:
        """Coordinates (n_q, k)."""
        return self.x[: self.module.n_q]

    @property
    def v(self) -> Array:
        """Velocities (n_v, k)."""
        return self.x[self.module.n_q :]

    def evaluate(self, kernel: Any, *arrays: Array) -> Array:
        """A kernel of positions or of motions at these times."""
        return np.asarray(kernel(*arrays, t=self.t, **self.options))

    def jacobian(self) -> Array:
        """C_q of all rows, (k, n_c, n_v)."""
        C_q = self.evaluate(self.module.kernels.constraint_jacobian, self.q)
        return np.ascontiguousarray(np.moveaxis(C_q, -1, 0))

    def accelerations(self) -> Array:
        """v' of the model itself, (n_v, k)."""
        return np.asarray(self.module.rhs(self.t, self.x, **self.options))[self.module.n_q :]

    def residual(self, a: Array) -> Array:
        """M a + h, (n_v, k)."""
        return self.evaluate(self.module.kernels.inverse_dynamics, self.q, self.v, a)

    def shaped(self, result: Array, out: Array | None = None) -> Array:
        """A result (..., k) as it was requested."""
        return into(out, np.ascontiguousarray(result[..., 0] if self.single else result))


def read_states(module: BoundModel, t: ArrayLike, x: ArrayLike) -> tuple[Array, Array, bool]:
    """Times (k,), states (n_x, k) and whether one state (n_x,) was given."""
    layout = module.layout
    state = read_numbers("x", x)
    if state.shape[:1] != (layout.n_x,) or state.ndim > 2:
        raise ill_shaped(
            f"x must have shape ({layout.n_x},) or ({layout.n_x}, k) [{', '.join(layout.x)}], not {state.shape}"
        )
    if not state.size and layout.n_x:
        raise ill_shaped(f"x of shape {state.shape} contains no state")
    single = state.ndim == 1
    columns = state[:, None] if single else state
    time = as_real(read_number("t", t) if isinstance(t, str) else with_numbers("t", t))
    if time is None:
        raise no_number(f"t must be a number or an array of them, not {quote(t)}")
    if time.ndim > 1 or (time.ndim == 1 and len(time) != columns.shape[1]):
        raise ill_shaped(f"t must be a number or have shape ({columns.shape[1]},), one a state, not {time.shape}")
    return np.ascontiguousarray(np.broadcast_to(time, columns.shape[1:])), np.ascontiguousarray(columns), single


def prepare(module: BoundModel, t: ArrayLike, x: ArrayLike, p: Any = None, u: Any = None) -> ProjectedStates:
    """Check and project states, which have the same p and u."""
    read, (times, columns, single) = module.kernels.fail.vector, read_states(module, t, x)
    options = {"p": read("p", p, module.p), "u": read("u", u, module.u)}
    return ProjectedStates(module, times, np.asarray(module.project(columns, times, **options)), options, single)


def solve_multipliers(C_q: Array, force: Array, scales: Scales) -> Array:
    """l (n_c, k) with C_q^T l = -(M a + h), the smallest in scaled rows where rows depend on each other; C_q (k, n_c,
    n_v).
    """
    if not C_q.shape[1]:
        return np.zeros((0, force.shape[1]))
    J = C_q * (scales.q / scales.c[:, None])
    U, sizes, Vt = algebra.svd(J, full_matrices=False)
    kept = sizes > RANK * np.maximum(sizes[:, :1], np.finfo(float).tiny)
    inverse = np.where(kept, 1.0 / np.where(kept, sizes, 1.0), 0.0)
    right = -(scales.q[:, None] * force).T[:, :, None]
    scaled = U @ (inverse[:, :, None] * (Vt @ right))
    return np.asarray(scaled[:, :, 0].T / scales.c[:, None])


@np.errstate(all="ignore")
def multipliers(
    module: BoundModel, /, t: ArrayLike, x: ArrayLike, p: Any = None, u: Any = None, out: Array | None = None
) -> Array:
    """Compute the Lagrange multipliers l of all constraint rows, in ``M v' + h + C_q^T l = 0``.

    Parameters
    ----------
    t : float or (k,) array
    x : (n_x,) or (n_x, k) array
        States; projected onto the constraints first.
    p, u, out : optional
        As for every kernel.

    Returns
    -------
    (n_rows,) or (n_rows, k) array
        In the order of ``constraint_labels``; N where a row is in m, N m where it is in rad.  Where rows depend on
        each other, the smallest multipliers, each times the scale of its row.
    """

    def find(states: ProjectedStates) -> Array:
        force = states.residual(states.accelerations())
        return solve_multipliers(states.jacobian(), force, module.layout.scales)

    return evaluate(find, module, t, x, p, u, out)


def evaluate(
    find: Callable[[ProjectedStates], Array],
    module: BoundModel,
    t: ArrayLike,
    x: ArrayLike,
    p: Any = None,
    u: Any = None,
    out: Array | None = None,
) -> Array:
    """``find`` of all states; where p or u are given state by state, (n, k), of each with its own."""
    results: dict[str, Array] = {}
    for name, raw in (("p", p), ("u", u)):
        values = None if raw is None or isinstance(raw, Mapping) else read_numbers(name, raw)
        if values is not None and values.ndim > 1:
            results[name] = values
    if not results:
        states = prepare(module, t, x, p, u)
        return states.shaped(find(states), out)
    times, columns, single = read_states(module, t, x)
    for name, values in results.items():
        n = module.n_p if name == "p" else module.n_u
        if single or values.shape != (n, len(times)):
            raise ill_shaped(f"{name} must have shape ({n},), or ({n}, k) for k states, not {values.shape}")
    parts = []
    for k in range(len(times)):
        options = {"p": p, "u": u} | {name: np.ascontiguousarray(values[:, k]) for name, values in results.items()}
        parts.append(find(prepare(module, times[k : k + 1], columns[:, k : k + 1], **options)))
    return into(out, np.concatenate(parts, axis=-1))


def free_motions(J: Array, scales: Scales) -> Array:
    """Velocities that the constraints C_q = J (m, n_v) allow, (n_v, n_dof), orthonormal in scaled coordinates."""
    return conditioned_motions(J, scales)[0]


def conditioned_motions(J: Array, scales: Scales) -> tuple[Array, float]:
    """The same, and the condition of the constraints that leave them; 0 without any."""
    if not len(J):
        return np.diag(scales.q), 0.0
    _, sizes, Vt = algebra.svd(scales.jacobian(J))
    rank = int((sizes > RANK * max(sizes.max(initial=0.0), np.finfo(float).tiny)).sum())
    return np.asarray(scales.q[:, None] * Vt[rank:].T), float(sizes[0] / sizes[rank - 1]) if rank else 0.0
