"""Analysis: equations whose q' are functions of other velocities, near a state -> A, C of the independent ones.

Coordinates and velocities are chosen apart: coordinates are held by the holonomic rows dC/dq, velocities by all rows at
velocity level (D. L. Peterson, G. Gede, M. Hubbard, Symbolic linearization of equations of motion of constrained
multibody systems, Multibody System Dynamics 33 (2015), 143-161, section 3).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..base.algebra import Array, Indices
from ..errors import cannot, ill_chosen
from ..numeric.partitions import partition
from ..numeric.projection import minimum_norm
from ..numeric.ranks import rank
from ..runtime.derivative_calls import assembly_jacobian
from ..runtime.near_names import read_names, unknown
from .tangent import TangentSpace

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel
    from ..runtime.layout import Layout


def find_given_tangent(module: BoundModel, t: float, x: Array, independent: Sequence[str] | None) -> TangentSpace:
    """The independent directions at a state on the constraints.

    Parameters
    ----------
    module : BoundModel
        With given rates.
    t : float
    x : (n_x,) array
    independent : sequence of str, optional
        All independent coordinates, all independent velocities, or both.

    Returns
    -------
    TangentSpace
        ``positions`` are indices of coordinates; Z is (n_q, n_z).

    Raises
    ------
    PartitionError
        The chosen ones cannot move the mechanism.
    UsageError
        An unknown name, or a wrong number of them.
    """
    layout = module.layout
    n_q, n_h, n_c = layout.n_q, layout.n_h, layout.n_c
    names = () if independent is None else read_names("independent", independent)
    for name in names:
        if name not in layout.x:
            raise unknown("coordinate or velocity", name, layout.x)
    rows = assembly_jacobian(module, t, x)
    slopes, at_rest, C_q = rows[:n_h, :n_q], rows[n_h : n_h + n_c, :n_q], rows[n_h : n_h + n_c, n_q : layout.n_x]
    J = layout.place_scales.jacobian(slopes)
    count = rank(J).rank
    places = _chosen(layout.q, names, n_q - count)
    if places is None and "independent_places" in layout.metadata:
        places = (
            np.array([layout.q.index(name) for name in layout.metadata["independent_places"]], dtype=np.intp),
            False,
        )
    Z, positions = _basis(J, count, places, layout.place_scales.q)
    velocities = _chosen(layout.v, names, layout.n_dof)
    preferred = (layout.independent, False) if velocities is None else velocities
    B, moving = _basis(layout.scales.jacobian(C_q), layout.rank, preferred, layout.scales.q)
    dv = -minimum_norm(C_q, at_rest @ Z, layout.scales) if n_c else np.zeros((layout.n_v, Z.shape[1]))
    dv = dv - B @ dv[moving]  # the independent velocities stay
    return TangentSpace(positions, moving, Z, B, np.block([[Z, np.zeros((n_q, B.shape[1]))], [dv, B]]))


def _chosen(among: Sequence[str], names: Sequence[str], count: int) -> tuple[Indices, bool] | None:
    """Indices of those named, which are taken strictly; None if none is."""
    found = [among.index(name) for name in names if name in among]
    if not found:
        return None
    if len(set(found)) != count or len(found) != count:
        named = ", ".join(among[k] for k in found)
        raise ill_chosen(f"independent must name {count} different ones of {', '.join(among)}, not {named}")
    return np.array(found, dtype=np.intp), True


def _basis(J: Array, count: int, preferred: tuple[Indices, bool] | None, s: Array) -> tuple[Array, Indices]:
    """Basis of the null space of scaled rows, in units, and the columns that are independent in it."""
    columns, strict = (np.arange(J.shape[1]), False) if preferred is None else preferred
    split = partition(J, count, columns, strict)
    return s[:, None] * split.B / s[split.independent], split.independent


def refuse_inputs(layout: Layout) -> None:
    """Refuse inputs beside given rates.

    Raises
    ------
    UsageError
    """
    if layout.n_u:
        raise cannot(
            f"model {layout.name!r} gives the rates of its coordinates as functions of its velocities; derivatives "
            f"by the inputs ({', '.join(layout.u)}) of such a model are not derived; use jacobian(t, x), which is A of "
            "the full form"
        )
