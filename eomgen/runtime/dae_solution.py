"""Stage runtime: the differential-algebraic form of a model -> a trajectory, by IDA of SUNDIALS (scikit-sundae)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import SimulationError
from ..numeric.scales import Array
from .integrate import Solution
from .names import require
from .recording import record
from .signals import Forcing
from .simulate import find_span, find_state, ordered_times

if TYPE_CHECKING:
    from .module import Module
    from .trajectory import Trajectory

UNCONTROLLED = 1e30  #: absolute tolerance of unknowns that the error test leaves out
STEPS = 1_000_000  #: at most, between two times wanted


def integrate_dae(
    module: Module,
    span: float | tuple[float, float] | None,
    initial: Mapping[str, float] | ArrayLike | None,
    parameters: Any,
    inputs: Mapping[str, Any] | None,
    t_eval: Any,
    tolerances: Mapping[str, float],
    options: Mapping[str, Any],
) -> Trajectory:
    """One run; see :meth:`~.dae.Dae.solve`."""
    ida = require("sksundae.ida", "scikit-sundae", "dae.solve")
    forcing = Forcing(module.layout, inputs)
    start, end = find_span(span, float(module.metadata["simulation"]["end"]))
    bound = module.bind(parameters, forcing.constants) if parameters is not None or forcing.constants else module
    forcing.attach(bound)
    form, n_x = bound.dae, bound.n_x
    forcing.begin(start, end)
    x0 = find_state(bound, initial, start, forcing)
    y, yp = form.initial(x0, start, forcing(start, x0))

    def residual(t: float, y: Array, yp: Array, res: Array) -> None:
        form.residual(t, y, yp, res, forcing(t, y[:n_x]))

    def jacobian(t: float, y: Array, yp: Array, res: Array, cj: float, JJ: Array) -> None:
        form.jacobian(t, y, yp, cj, JJ, forcing(t, y[:n_x]))

    atol = np.full(form.n_y, tolerances["atol"])
    atol[form.algebraic] = UNCONTROLLED
    algebraic = {"algebraic_idx": form.algebraic.tolist()} if len(form.algebraic) else {}
    chosen = {"max_num_steps": STEPS, "jacfn": jacobian, **algebraic, **options}
    solver = ida.IDA(residual, rtol=tolerances["rtol"], atol=atol, **chosen)
    times = None if t_eval is None else ordered_times(t_eval, start, end)
    nodes = np.array([start, end])
    if times is not None:
        nodes = np.unique(np.concatenate([nodes, times]))
        nodes = nodes if end >= start else nodes[::-1]
        if len(nodes) == 2:  # IDA takes two times for the ends of its own steps
            nodes = np.insert(nodes, 1, 0.5 * (start + end))
    found = solver.solve(nodes, y, yp)
    if not found.success:
        reached = float(found.t[-1]) if len(found.t) else start
        raise SimulationError(f"IDA stopped at t = {reached:.6g} s of {end:.6g} s: {found.message}")
    t, x = np.array(found.t, dtype=float), np.array(found.y, dtype=float)[:, :n_x].T.copy()
    if times is not None:
        kept = np.isin(t, times)
        t, x = t[kept], x[:, kept]
    counts = {"nfev": int(found.nfev), "njev": int(found.njev)}
    solution = Solution(t, x, [], [], None, 0, str(found.message), counts, (start, end))
    return record(bound, forcing, solution, "IDA", dict(tolerances))
