"""The equations of motion near a state -> x' = A x + B u, y = C x + D u, and M z'' + C z' + K z = 0."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.algebra import Array, Indices, rank
from ..base.scales import minimum_norm
from ..errors import cannot, ill_chosen, no_choice
from ..runtime.argument_checks import check_names, read_names, read_number, read_state
from ..runtime.refusals import refuse_closed, require_support
from .balance import (
    TangentSpace,
    displacement_names,
    displacement_rates,
    find_tangent,
    null_basis,
    projected_directions,
)
from .linearization import Linearization, residual_accelerations

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel
    from ..runtime.layout import Layout

# -- rates that are functions of velocities ----------------------------------------------------------------------------

# Coordinates and velocities are chosen apart: coordinates are held by the holonomic rows dC/dq, velocities by all rows
# at velocity level (D. L. Peterson, G. Gede, M. Hubbard, Symbolic linearization of equations of motion of constrained
# multibody systems, Multibody System Dynamics 33 (2015), 143-161, section 3).


def find_directions(module: BoundModel, t: float, x: Array, independent: Sequence[str] | None) -> TangentSpace:
    """The independent directions at a state on the constraints.

    Parameters
    ----------
    module : BoundModel
        With given rates.
    x : (n_x,) array
    independent : sequence of str, optional
        All independent coordinates, all independent velocities, or both.

    Returns
    -------
    TangentSpace
        ``positions`` are indices of coordinates; Z is (n_q, n_z).
    """
    layout = module.layout
    n_q, n_h, n_c = layout.n_q, layout.n_h, layout.n_c
    names = () if independent is None else read_names("independent", independent)
    check_names("coordinate or velocity", names, layout.x)
    rows = module.kernels.assembly_jacobian(x, t=t)
    slopes, at_rest, C_q = rows[:n_h, :n_q], rows[n_h : n_h + n_c, :n_q], rows[n_h : n_h + n_c, n_q : layout.n_x]
    J = layout.place_scales.jacobian(slopes)
    count = rank(J).rank
    declared = [layout.q.index(name) for name in layout.info.independent_places] or range(n_q)
    places = _chosen(layout.q, names, n_q - count) or (np.array(declared, dtype=np.intp), False)
    Z, positions = null_basis(J, count, *places, layout.place_scales.q)
    velocities = _chosen(layout.v, names, layout.n_dof) or (layout.independent, False)
    B, moving = null_basis(layout.scales.jacobian(C_q), layout.rank, *velocities, layout.scales.q)
    dv = -minimum_norm(C_q, at_rest @ Z, layout.scales) if n_c else np.zeros((layout.n_v, Z.shape[1]))
    dv = dv - B @ dv[moving]  # the independent velocities stay
    return TangentSpace(positions, moving, Z, B, np.block([[Z, np.zeros((n_q, B.shape[1]))], [dv, B]]))


def _chosen(among: Sequence[str], names: Sequence[str], count: int) -> tuple[Indices, bool] | None:
    """Indices of those named, which are taken strictly; None if none is."""
    result = [among.index(name) for name in names if name in among]
    if not result:
        return None
    if len(set(result)) != count or len(result) != count:
        named = ", ".join(among[k] for k in result)
        raise ill_chosen(f"independent must name {count} different ones of {', '.join(among)}, not {named}")
    return np.array(result, dtype=np.intp), True


def refuse_inputs(layout: Layout) -> None:
    """Refuse inputs beside given rates."""
    if layout.n_u:
        raise cannot(
            f"model {layout.name!r} gives the rates of its coordinates as functions of its velocities; derivatives "
            f"by the inputs ({', '.join(layout.u)}) of such a model are not available; use jacobian(t, x), which is A "
            "of the full form"
        )


# -- linearization -----------------------------------------------------------------------------------------------------


FORMS = ("minimal", "full")


@np.errstate(all="ignore")
def linearize(
    module: BoundModel,
    /,
    x: Mapping[str, float] | ArrayLike | None = None,
    t: float = 0.0,
    *,
    p: Any = None,
    u: Any = None,
    form: str = "minimal",
    independent: Sequence[str] | None = None,
) -> Linearization:
    """Linearize the equations of motion about any state.

    Parameters
    ----------
    x : mapping of str to float, or (n_x,) array, optional
        A state: initial values by name, as :meth:`x0` takes them, or all of it, projected onto the constraints; by
        default the declared initial values, assembled.
    t : float
        Time (s), held fixed.
    p, u : optional
        As for ``bind``.
    form : {'minimal', 'full'}
        ``minimal``: states are the independent displacements and velocities along the constraints, nonholonomic
        ones included, so that constraints add no eigenvalues.  ``full``: A is ``jacobian(t, x)``.
    independent : sequence of str, optional
        Coordinates of the tree to take as the n_dof independent ones; where rates of coordinates are given, all
        independent coordinates, all independent velocities or both.

    Returns
    -------
    Linearization
        A, B, C, D, names, eigenvalues, ``mass``, ``damping``, ``stiffness``, ``drift``, ``state_space()``.

    Raises
    ------
    UsageError
        Unknown names or a wrong shape.
    PartitionError
        The rank of the constraints drops here, or the chosen coordinates are not independent.

    Notes
    -----
    All matrices are exact derivatives of the complete right-hand side (implicit differentiation; no differences).
    """
    if module.layout.general_rates:
        refuse_inputs(module.layout)
    if not isinstance(form, str) or form not in FORMS:
        raise no_choice(f"form must be one of {', '.join(FORMS)}, not {form!r}")
    require_support(module.layout, "linearize")
    module = module.bind(p, u)
    layout, time = module.layout, read_number("t", t)
    state = module.x0(x, t=time) if x is None or isinstance(x, Mapping) else read_state("x", x, layout.x)
    state = module.project(state, t=time)
    rates, J = module.rhs(time, state), module.jacobian(time, state)
    U = module.input_jacobian(time, state) if layout.n_u else np.zeros((layout.n_x, 0))
    if form == "full":
        if independent is not None:
            raise cannot("independent= chooses the states of the minimal form; the full form has all of x")
        if layout.general_rates:
            raise cannot(
                "the rates of this model's coordinates are given, and the full form of such models is not derived; use "
                "jacobian(t, x), which is its A"
            )
        P = projected_directions(module, time, state, J)
        A, B, drift, states = J, U, rates, layout.x
        C, D = _outputs(module, time, state, rates, P, J, U)
        return Linearization(layout, time, state, module.u, (A, B, C, D), states, drift)
    if layout.general_rates:
        tangent = find_directions(module, time, state, independent)
        moved = J @ tangent.T
        chosen = np.concatenate([tangent.positions, layout.n_q + tangent.velocities])
        C, D = _outputs(module, time, state, rates, tangent.T, moved, U)
        names = tuple(layout.x[k] for k in chosen)
        return Linearization(
            layout, time, state, module.u, (moved[chosen], U[chosen], C, D), names, rates[chosen], None, tangent
        )
    refuse_closed(layout, state[layout.n_x - len(layout.states) :], "linearize in minimal form")
    tangent = _without_switches(layout, find_tangent(module, time, state, J, independent))
    n_q, n_z = layout.n_q, len(tangent.positions)
    moved = J @ tangent.T
    turned = np.hstack([tangent.Z, np.zeros_like(tangent.B)])
    z = displacement_rates(layout, state, moved[:n_q], turned)[tangent.positions]
    A = np.vstack([z, moved[n_q:][tangent.velocities]])
    pushed = displacement_rates(layout, state, U[:n_q], np.zeros((layout.n_v, layout.n_u)))
    B = np.vstack([pushed[tangent.positions], U[n_q:][tangent.velocities]])
    C, D = _outputs(module, time, state, rates, tangent.T, moved, U)
    v = state[n_q:]
    drift = np.concatenate([v[tangent.positions], rates[n_q:][tangent.velocities]])
    names = displacement_names(layout)
    states = (*(names[k] for k in tangent.positions), *(layout.v[k] for k in tangent.velocities))
    mass = tangent.B.T @ module.kernels.mass_matrix(state[:n_q], t=time) @ tangent.B
    damping, stiffness = -mass @ A[n_z:, n_z:], -mass @ A[n_z:, :n_z]
    residual = residual_accelerations(module, time, state, tangent.B, tangent.velocities, mass)
    return Linearization(
        layout, time, state, module.u, (A, B, C, D), states, drift, (mass, damping, stiffness), tangent, residual
    )


def _without_switches(layout: Layout, tangent: TangentSpace) -> TangentSpace:
    """The same without the states that are 0 while a constraint is open, which no motion changes."""
    switched = [layout.v.index(state) for state in layout.switches.values()]
    kept = ~np.isin(tangent.velocities, switched)
    n_z = len(tangent.positions)
    T = np.hstack([tangent.T[:, :n_z], tangent.T[:, n_z:][:, kept]])
    return tangent._replace(velocities=tangent.velocities[kept], B=tangent.B[:, kept], T=T)


def _outputs(
    module: BoundModel, t: float, x: Array, rates: Array, directions: Array, moved: Array, U: Array
) -> tuple[Array, Array]:
    """C and D: changes of the outputs for changes of x along directions, with the accelerations that follow."""
    layout = module.layout
    n_q, n_v, n_x = layout.n_q, layout.n_v, layout.n_x
    if not layout.n_y:
        return np.zeros((0, directions.shape[1])), np.zeros((0, layout.n_u))
    Y = module.kernels.output_derivatives(x[:n_q], x[n_q:], rates[n_q:], t=t)
    by_a = Y[:, n_x : n_x + n_v]
    return Y[:, :n_x] @ directions + by_a @ moved[n_q:], Y[:, n_x + n_v : n_x + n_v + layout.n_u] + by_a @ U[n_q:]
