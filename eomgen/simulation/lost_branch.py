"""Simulation, sensitivities: a run past a change point -> whether what it is differentiated by leaves the branch there.

At a change point two branches cross.  Let l be the direction in which the constraints lose rank there, l^T C_q = 0.  A
change of p with l^T C_p not zero opens the crossing, and the mechanism turns back or changes over: the motion is no
smooth function of p.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..base import algebra
from ..base.limits.constraints import PASSED
from ..base.limits.impacts import OPENS
from ..errors import NoDerivativeError
from ..runtime.change_points import scaled_jacobians
from ..runtime.derivative_calls import assembly_jacobian
from .sensitivity_start import Differentiated

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel
    from ..runtime.signals import Forcing
    from ..runtime.trajectory import Trajectory


def refuse_lost_branches(module: BoundModel, forcing: Forcing, run: Trajectory, columns: Differentiated) -> None:
    """Refuse parameters and inputs whose change opens a crossing that the run passes.

    Raises
    ------
    NoDerivativeError
        Names the parameter or input, and the time.
    """
    layout = module.layout
    by = [(name, layout.n_x + layout.n_u + i) for name, i in _named(columns, columns.parameters)]
    by += [(name, layout.n_x + i) for name, i in _named(columns, columns.inputs)]
    if not by or not layout.n_h or not layout.rank:
        return
    for point in run.change_points:
        x = np.concatenate([[point.coordinates[name] for name in layout.q], np.zeros(layout.n_v)])
        u = forcing(point.time, x)
        J = scaled_jacobians(module, np.array([point.time]), x[:, None], u[:, None] if len(u) else None)[0]
        U, sizes, _ = algebra.svd(J[: layout.n_h])
        lost = U[:, np.count_nonzero(sizes > 10.0 * PASSED * sizes.max(initial=0.0)) :]
        C = assembly_jacobian(module.bind(u=u), point.time, x)[: layout.n_h] / layout.scales.c[: layout.n_h, None]
        for name, k in by:
            length = float(np.linalg.norm(C[:, k]))
            if length > 0.0 and float(np.linalg.norm(lost.T @ C[:, k])) > OPENS * length:
                raise NoDerivativeError(
                    f"the run passes a change point at t = {point.time:.6g} s, and a change of {name} separates the "
                    f"branches that meet there, so there is no derivative by {name}; end the run before it"
                )


def _named(columns: Differentiated, pairs: tuple[tuple[int, int], ...]) -> list[tuple[str, int]]:
    return [(columns.names[column], index) for column, index in pairs]
