"""A motion -> the forces of drives that make it, with loops closed: constrained inverse dynamics.

With C_q a + gamma = 0 and B spanning the velocities that the constraints allow, B^T (M a + h) = B^T S tau, where a unit
of tau_i does work on coordinate i alone (Shabana, Computational Dynamics, sec. 5.7; Y. Nakamura, M. Ghodoussi, Dynamics
computation of closed-link robot mechanisms with nonredundant and redundant actuators, IEEE Trans. Robotics and
Automation 5 (1989), 294-302).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..base import algebra
from ..base.algebra import Array, partition
from ..base.limits.constraints import STATE as RANK
from ..base.limits.numbers import TINY
from ..base.results import Result, plain, same_keys
from ..errors import UsageError, cannot, ill_placed, ill_shaped, incomplete, no_such, untrue
from ..runtime.argument_checks import check_names, read_names, read_numbers
from ..runtime.constrained import ProjectedStates, free_motions, prepare, solve_multipliers
from ..runtime.layout import Layout
from ..runtime.refusals import require_support
from .limits import AFFINE, REACHED, REMAINDER, WELL_ABOVE

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel


@dataclass(frozen=True, repr=False)
class ActuatorForces(Result):
    """Forces of drives that produce a given motion.

    Attributes
    ----------
    names : tuple of str
        Driven coordinates (forces to add to those of the model) and inputs (their whole values).
    forces : (n,) or (n, k) array
        N, N m, or the unit of the input.
    q, v, a : arrays
        The motion, on the constraints.
    multipliers : (n_rows,) or (n_rows, k) array
        Of all constraint rows, with these forces acting.
    reactions : (n_joints, 6) or (n_joints, 6, k) array or None
        Of all joints, with these forces acting; None for a model without bodies.
    """

    names: tuple[str, ...]
    forces: Array
    q: Array
    v: Array
    a: Array
    multipliers: Array
    reactions: Array | None

    def __getitem__(self, name: str) -> Any:
        if name not in self.names:
            raise no_such(f"no drive {name!r}; there are {', '.join(self.names)}")
        return self.forces[self.names.index(name)]

    def as_dict(self) -> dict[str, Any]:
        """Name -> force, as ``inputs=`` of ``simulate`` and ``u=`` take them where all drives are inputs."""
        return dict(zip(self.names, self.forces, strict=True))

    KEYS = same_keys("multipliers", "reactions")
    title = "Forces of the drives"

    @property
    def facts(self) -> list[tuple[str, str]]:
        return [(name, f"{np.min(row):.6g} .. {np.max(row):.6g}" if np.ndim(row) else f"{row:.6g}")
                for name, row in self.as_dict().items()]  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        return {"forces": plain(self.as_dict())} | super().to_dict()

    def __repr__(self) -> str:
        if self.forces.ndim > 1:
            return f"<ActuatorForces of {', '.join(self.names)} at {self.forces.shape[1]} states>"
        return super().__repr__()


@np.errstate(all="ignore")
def actuator_forces(
    module: BoundModel,
    /,
    t: ArrayLike,
    x: ArrayLike,
    a: Mapping[str, ArrayLike] | ArrayLike | None = None,
    *,
    actuated: Sequence[str] | None = None,
    p: Any = None,
    u: Any = None,
) -> ActuatorForces:
    """Find the forces of chosen drives that make a motion (inverse dynamics of a constrained mechanism).

    Parameters
    ----------
    t : float or (k,) array
    x : (n_x,) or (n_x, k) array
        States; projected onto the constraints first.
    a : mapping of str to float or (k,) array, or (n_v,) or (n_v, k) array, optional
        Accelerations: those of the independent coordinates by name (0 for others), which determine the rest, or all
        of them, which must obey the constraints.  By default the independent accelerations are 0.
    actuated : sequence of str, optional
        The drives: coordinates of the tree or of cut joints, whose forces are added to the model's own, or inputs in
        which forces are linear, whose whole values are found.  By default the independent coordinates.
    p, u : optional
        As for ``bind``.

    Returns
    -------
    ActuatorForces
        ``forces["theta"]``, ``forces.forces`` (n,) or (n, k), ``multipliers``, ``reactions``.  With more drives
        than degrees of freedom: the smallest sum of squares (torques, and forces times the model's length).

    Raises
    ------
    UsageError
        A name is unknown, the accelerations violate the constraints, or the drives cannot make the motion.
    """
    module = module.bind(p, u)
    layout = module.layout
    require_support(layout, "actuator_forces")
    states = prepare(module, t, x)
    count = len(states.t)
    names = _drives(layout, actuated)
    C_q, free = states.jacobian(), states.accelerations()
    bases = [_basis(J, layout) for J in C_q]
    accelerations = _complete(states, bases, free, a)
    needed = states.residual(accelerations)
    S, base = _effects(states, names)
    weights = np.array([_size(layout, name) for name in names])
    forces = np.zeros((len(names), count))
    for k, B in enumerate(bases):
        A = B.T @ S[:, :, k]
        want = B.T @ (needed[:, k] + S[:, :, k] @ base)
        result = _solve(A, want, weights)
        left = want - A @ result
        if np.abs(left).max(initial=0.0) > REACHED * max(np.abs(want).max(initial=0.0), TINY):
            raise UsageError(
                _out_of_reach(layout, names, B, A, states.t[k], k if count > 1 else None), code="EG-UNDETERMINED"
            )
        forces[:, k] = result
    _check_inputs(states, names, accelerations, forces, bases, S)
    rest = needed - np.einsum("jik,ik->jk", S, forces - base[:, None])
    multipliers = solve_multipliers(C_q, rest, layout.scales)
    reactions = None
    if module.info.wrenches:
        reactions = _with_drives(states, names, accelerations, multipliers, forces)
    shaped = states.shaped
    return ActuatorForces(
        names,
        shaped(forces),
        shaped(states.q),
        shaped(states.v),
        shaped(accelerations),
        shaped(multipliers),
        None if reactions is None else shaped(reactions),
    )


def _solve(A: Array, want: Array, weights: Array) -> Array:
    """Forces with A f = want, the smallest where there are several.

    As many drives as freedoms are eliminated one by one, so that forces of mechanisms that have nothing to do with each
    other stay apart, whatever their sizes.
    """
    m, n = A.shape
    if m == n and m:
        rows = np.abs(A * (1.0 / weights)).max(axis=1, keepdims=True)
        if rows.all() and algebra.cond(A / weights / rows) < WELL_ABOVE / RANK:
            return np.asarray(algebra.solve(A / rows, want / rows[:, 0]))
    return np.asarray(algebra.lstsq(A / weights, want, rcond=RANK) / weights)


def _check_inputs(
    states: ProjectedStates, names: Sequence[str], a: Array, forces: Array, bases: Sequence[Array], S: Array
) -> None:
    """The forces found, applied all at once, must make the motion: inputs may multiply each other."""
    module, layout = states.module, states.module.layout
    inputs = [(i, layout.u.index(name)) for i, name in enumerate(names) if name in layout.u]
    if len(inputs) < 2:
        return
    others = [i for i in range(len(names)) if i not in [driven for driven, _ in inputs]]
    for k, B in enumerate(bases):
        u = module.u
        for i, j in inputs:
            u[j] = forces[i, k]
        left = B.T @ (
            module.kernels.inverse_dynamics(states.q[:, k], states.v[:, k], a[:, k], u=u, t=float(states.t[k]))
            - S[:, others, k] @ forces[others, k]
        )
        size = np.abs(B).T @ (np.abs(S[:, :, k]) @ np.abs(forces[:, k]))
        if (np.abs(left) > REACHED * np.maximum(size, TINY)).any():
            raise cannot(
                f"the forces are not linear in the inputs {', '.join(module.u_names[j] for _, j in inputs)} together, "
                "because these multiply each other; name one of them, or the coordinates that they drive"
            )


def _size(layout: Layout, name: str) -> float:
    """What a force is multiplied by before forces of different kinds are compared: a length of the model for N."""
    if name in layout.velocity_labels:
        return float(layout.scales.q[layout.velocity_labels.index(name)])
    return float(layout.loop_scales[layout.loops.index(name)]) if name in layout.loops else 1.0


def _drives(layout: Layout, actuated: Sequence[str] | None) -> tuple[str, ...]:
    """Coordinates or inputs by name."""
    if actuated is None:
        return tuple(layout.velocity_labels[i] for i in layout.independent)
    names = read_names("actuated", actuated)
    allowed = [*layout.velocity_labels, *layout.loops, *layout.u]
    check_names("coordinate or input", names, allowed, place="actuated")
    if not names or len(set(names)) < len(names):
        raise incomplete("actuated must name at least one coordinate or input, and each only once")
    return names


def _basis(J: Array, layout: Layout) -> Array:
    """Velocities that the constraints allow (n_v, n_dof), in scaled coordinates."""
    s = layout.scales
    if len(J):
        scaled = s.jacobian(J)
        sizes = algebra.singular_values(scaled)
        rank = int((sizes > RANK * max(sizes.max(initial=0.0), np.finfo(float).tiny)).sum())
        if rank == layout.rank:  # by elimination, which keeps mechanisms apart that have nothing to do with each other
            return np.asarray(s.q[:, None] * partition(scaled, rank, layout.independent).B)
    return free_motions(J, s)


def _complete(states: ProjectedStates, bases: Sequence[Array], free: Array, a: Any) -> Array:
    """Accelerations that the constraints allow, (n_v, k)."""
    layout = states.module.layout
    count = free.shape[1]
    if a is None or isinstance(a, Mapping):
        raw: Mapping[str, Any] = {} if a is None else a
        rows = {layout.velocity_labels[i]: int(i) for i in layout.independent}
        keys = rows | {layout.a[i]: i for i in rows.values()}
        for name in raw:
            if name not in keys:
                raise ill_placed(
                    f"a: {name!r} is not an independent coordinate or its acceleration; there are {', '.join(keys)}"
                )
        values = np.zeros((layout.n_v, count))
        for name, value in raw.items():
            row = read_numbers(f"a: {name}", value)
            if row.shape not in ((), (count,)):
                raise ill_shaped(f"a: {name} must be a number or have shape ({count},), one a state, not {row.shape}")
            values[keys[name]] = row
        chosen = list(layout.independent)
        result = np.array(free)
        for k, B in enumerate(bases):
            if not B.shape[1]:
                continue
            part = B[chosen]
            if algebra.cond(part) > 1 / RANK:
                raise UsageError(
                    f"a: at t = {states.t[k]:g} the accelerations of {', '.join(rows)} do not determine the others (a "
                    "dead centre); give the accelerations of all velocities as an array",
                    code="EG-UNDETERMINED",
                )
            result[:, k] += B @ algebra.solve(part, values[chosen, k] - free[chosen, k])
        return result
    array = read_numbers("a", a)
    wanted = (layout.n_v,) if states.single else (layout.n_v, count)
    if array.shape != wanted:
        raise ill_shaped(f"a must have shape {wanted} [{', '.join(layout.a)}], not {array.shape}")
    result = np.array(array.reshape(layout.n_v, count))
    if layout.n_c:
        J = states.jacobian()
        off = np.einsum("kij,jk->ik", J, result - free) / layout.scales.c[:, None]
        size = np.einsum("kij,jk->ik", np.abs(J), np.abs(result) + np.abs(free)) / layout.scales.c[:, None]
        worst = np.unravel_index(int((np.abs(off) / (size + 1.0)).argmax()), off.shape)
        if np.abs(off[worst]) > REMAINDER * (size[worst] + 1.0):
            raise untrue(
                f"a violates the constraint {layout.constraint_labels[int(worst[0])]} by {off[worst]:.3g} at "
                f"t = {states.t[int(worst[1])]:g}; name the independent accelerations (a={{...}}) instead"
            )
    return result


def _effects(states: ProjectedStates, names: Sequence[str]) -> tuple[Array, Array]:
    """Generalized forces (n_v, n, k) of a unit of each drive, and what each drive has already (n,)."""
    module, layout = states.module, states.module.layout
    count = len(states.t)
    S, base = np.zeros((layout.n_v, len(names), count)), np.zeros(len(names))
    for i, name in enumerate(names):
        if name in layout.velocity_labels + layout.loops:
            S[:, i] = coordinate_slopes(states, name)
        else:
            j = layout.u.index(name)
            base[i] = module.u[j]
            S[:, i] = _input_effect(states, j)
    return S, base


def coordinate_slopes(states: ProjectedStates, name: str) -> Array:
    """The rate (n_v, k) of a coordinate of the tree or of a cut joint in a unit of each velocity."""
    layout = states.module.layout
    if name in layout.loops:
        every = states.evaluate(states.module.kernels.loop_coordinate_jacobian, states.q)
        return np.asarray(every[layout.loops.index(name)])
    result = np.zeros((layout.n_v, len(states.t)))
    result[layout.velocity_labels.index(name)] = 1.0
    return result


def _input_effect(states: ProjectedStates, j: int) -> Array:
    """Generalized forces (n_v, k) of a unit of an input, in which forces must be linear."""
    module = states.module
    h = []
    for step in (-1.0, 0.0, 1.0):
        u = module.u
        u[j] += step
        h.append(np.asarray(module.kernels.bias(states.t, states.x, u=u)))
    slope, bend = 0.5 * (h[0] - h[2]), h[0] - 2.0 * h[1] + h[2]
    if np.abs(bend).max(initial=0.0) > AFFINE * max(*(np.abs(y).max(initial=0.0) for y in h), TINY):
        raise cannot(
            f"the forces are not linear in the input {module.u_names[j]!r}; name the coordinate that it drives instead"
        )
    return np.asarray(slope)


def _out_of_reach(layout: Layout, names: Sequence[str], B: Array, A: Array, t: float, k: int | None) -> str:
    """Why drives cannot make a motion, by the freedom they do not move."""
    U, sizes, _ = algebra.svd(A)
    rank = int((sizes > RANK * max(sizes.max(initial=0.0), TINY)).sum())
    motion = np.abs((B @ U[:, rank:]) / layout.scales.q[:, None]).max(axis=1, initial=0.0)
    moved = [layout.velocity_labels[i] for i in np.argsort(-motion) if motion[i] > 0.3 * motion.max(initial=0.0)]
    need = "1 degree of freedom needs" if layout.n_dof == 1 else f"{layout.n_dof} degrees of freedom need"
    where = f"t = {t:g}" + (f" (state {k})" if k is not None else "")
    return (
        f"drives on {', '.join(names)} cannot make this motion at {where}: no drive moves "
        f"{', '.join(moved[:4])}; {need} as many drives, "
        f"such as {', '.join(layout.velocity_labels[i] for i in layout.independent)}"
    )


def _with_drives(states: ProjectedStates, names: Sequence[str], a: Array, multipliers: Array, forces: Array) -> Array:
    """Reactions of all joints while the drives act."""
    from .reactions import find_reactions

    module, layout = states.module, states.module.layout
    inputs = [i for i, name in enumerate(names) if name in layout.u and name not in layout.velocity_labels]
    loops = [i for i, name in enumerate(names) if name in layout.loops]
    cut = {layout.loops.index(names[i]): forces[i] for i in loops}
    if not inputs:
        return find_reactions(states, a, multipliers, cut)[0]
    parts = []
    for k in range(len(states.t)):
        u = module.u
        for i in inputs:
            u[layout.u.index(names[i])] = forces[i, k]
        some = slice(k, k + 1)
        one = states._replace(module=module.bind(u=u), t=states.t[some], x=np.ascontiguousarray(states.x[:, some]))
        drives = {j: force[some] for j, force in cut.items()}
        now, reactions = (np.ascontiguousarray(y[:, some]) for y in (a, multipliers))
        parts.append(find_reactions(one, now, reactions, drives)[0])
    return np.concatenate(parts, axis=-1)
