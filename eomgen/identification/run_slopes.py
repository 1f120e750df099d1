"""Identification: a tree's run -> its derivatives by parameters, inputs and initial values, along the steps of the run.

S' = J S + df/dp is linear, so it needs no steps of its own: along those of the compiled run, on each the four nodes of
Gauss's formula of order 8 (E. Hairer, S. Norsett, G. Wanner, Solving Ordinary Differential Equations I, 1993, section
II.7), all Jacobians come from one call and all steps from one set of linear systems.  The same formula applied to the
run itself tells whether the steps are short enough; where they are not, and for loops, events and laws of inputs that
depend on the state, :mod:`..simulation.sensitivities` integrates the derivatives beside the motion.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.analyses import QUADRATURE
from ..runtime.derivative_calls import output_derivatives
from ..runtime.input_kinds import Expressed, Tabulated
from ..runtime.late_start import start_slopes
from ..runtime.signals import Forcing
from ..simulation.simulate import simulate

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel

#: Nodes and weights of Gauss's formula with four nodes on [0, 1], its matrix by the conditions C(4):
#: sum_j a_ij c_j^(k-1) = c_i^k / k.
NODES, WEIGHTS = (0.5 * (np.polynomial.legendre.leggauss(4)[0] + 1.0), 0.5 * np.polynomial.legendre.leggauss(4)[1])
POWERS = np.arange(1, 5)
#: Of the tolerances of the run whose steps are taken: a law that bends within a step, such as smoothed friction, weighs
#: more in the derivatives than in the run.
TIGHTER = 0.1
MATRIX = algebra.solve(NODES[None, :] ** (POWERS[:, None] - 1), (NODES[None, :] ** POWERS[:, None]) / POWERS[:, None]).T


def run_slopes(
    module: BoundModel, names: Sequence[str], columns: Sequence[str], arguments: Mapping[str, Any]
) -> dict[str, Array] | None:
    """The derivatives of the run that ``simulate(module, **arguments)`` makes; None where this way does not serve.

    Parameters
    ----------
    module : BoundModel
    names : sequence of str
        Parameters, inputs (a constant added) and initial values.
    columns : sequence of str
        States and outputs whose derivatives are wanted.
    arguments : mapping
        Of ``simulate``, ``span`` and ``t_eval`` among them.

    Returns
    -------
    dict of str to (n_t, names) array, or None
    """
    layout, initial = module.layout, arguments["initial"]
    if layout.n_c or layout.quaternion_slots or layout.n_events or layout.given_rates or layout.initial_outputs:
        return None
    if not (isinstance(initial, Mapping) and initial.keys() <= set(layout.x)):
        return None
    forcing = Forcing(layout, arguments["inputs"])
    if not _of_time_alone(forcing):
        return None
    bound = module.bind(arguments["parameters"], forcing.constants)
    forcing.attach(bound)
    start, stop = arguments["span"]
    measured = np.asarray(arguments["t_eval"], dtype=float)
    plain = {key: value for key, value in arguments.items() if key != "t_eval"}
    plain |= {name: TIGHTER * np.asarray(arguments[name]) for name in ("rtol", "atol")}
    steps = simulate(module, **plain).t
    grid = np.unique(np.concatenate([steps, measured, forcing.corners(start, stop)]))
    h = np.diff(grid)
    t = (grid[:-1, None] + h[:, None] * NODES).ravel()
    run = simulate(module, **plain, t_eval=np.unique(np.concatenate([t, grid])))
    at, ends = np.searchsorted(run.t, t), np.searchsorted(run.t, grid)
    x, u = run.x[:, at], _inputs(forcing, bound, t)
    rate = np.asarray(bound.rhs(t, x, u=u)).reshape(layout.n_x, len(h), -1)
    missed = run.x[:, ends[:-1]] + h * (rate @ WEIGHTS) - run.x[:, ends[1:]]
    if not np.abs(missed).max() <= QUADRATURE * np.abs(run.x).max():
        return None
    S = _linear(h, *_slopes(bound, names, t, x, u), _start(bound, names, initial))
    wanted = np.searchsorted(grid, measured)
    found = {name: S[wanted, k] for k, name in enumerate(layout.x)}
    if not set(columns) <= found.keys():
        outputs = _outputs(bound, names, forcing, measured, run.x[:, ends[wanted]], S[wanted])
        found |= {name: outputs[:, k] for k, name in enumerate(layout.y) if name not in found}
    return {name: found[name] for name in columns}


def _of_time_alone(forcing: Forcing) -> bool:
    """Whether no input is a Python function, has conditions, or depends on state or parameters."""
    for index, signal in forcing.varying.items():
        if index not in forcing.formulas and not isinstance(signal, Tabulated):
            return False
    return not any(_depends(formula) for formula in forcing.formulas.values())


def _depends(formula: Expressed) -> bool:
    return formula.branches or any(operation in ("x", "p") for operation, *_ in formula.tape[0])


def _inputs(forcing: Forcing, module: BoundModel, t: Array) -> Array:
    """u (n_u, k) at times."""
    return forcing.sample(t, np.zeros((module.n_x, len(t))))


def _start(module: BoundModel, names: Sequence[str], given: Mapping[str, float]) -> Array:
    """S (n_x, k) of the initial state: one for a state that is to be found; declared values follow from parameters."""
    S = np.array([[float(name == state) for name in names] for state in module.x_names])
    for state, by_p in start_slopes(module.layout, module.kernels.context.p).items():
        if state not in given:
            S[module.x_names.index(state)] += [
                by_p[module.p_names.index(name)] if name in module.p_names else 0.0 for name in names
            ]
    return S


def _slopes(module: BoundModel, names: Sequence[str], t: Array, x: Array, u: Array) -> tuple[Array, Array]:
    """J (k, n_x, n_x) and df/d(names) (k, n_x, names) at nodes."""
    kernels = module.kernels
    J = np.moveaxis(np.asarray(kernels.timed("jacobian")(t, x, u=u)), -1, 0)
    by = np.zeros((len(t), module.n_x, len(names)))
    for kernel, known in (("parameter_jacobian", module.p_names), ("input_jacobian", module.u_names)):
        there = [(column, known.index(name)) for column, name in enumerate(names) if name in known]
        if there:
            values = np.moveaxis(np.asarray(kernels.timed(kernel)(t, x, u=u)), -1, 0)
            for column, index in there:
                by[:, :, column] = values[:, :, index]
    return J, by


def _linear(h: Array, J: Array, by: Array, start: Array) -> Array:
    """S (steps + 1, n, k) of S' = J S + by, J and by at the nodes of all steps.

    Slopes K_i = J_i (S + h sum_j a_ij K_j) + by_i: of each step one system in all K_i, with S and by on its right side.
    """
    count, n, s = len(h), start.shape[0], len(NODES)
    J, by = J.reshape(count, s, n, n), by.reshape(count, s, n, -1)
    system = -np.einsum("m,ij,mipq->mipjq", h, MATRIX, J).reshape(count, s * n, s * n)
    system[:, range(s * n), range(s * n)] += 1.0
    right = np.concatenate([J, by], axis=-1).reshape(count, s * n, -1)
    K = algebra.solve(system, right).reshape(count, s, n, -1)
    gain = h[:, None, None] * np.einsum("i,mipq->mpq", WEIGHTS, K)
    found = np.empty((count + 1, *start.shape))
    found[0] = start
    for m in range(count):
        found[m + 1] = found[m] + gain[m, :, :n] @ found[m] + gain[m, :, n:]
    return found


def _outputs(module: BoundModel, names: Sequence[str], forcing: Forcing, t: Array, x: Array, S: Array) -> Array:
    """Derivatives (n_t, n_y, k) of the outputs."""
    layout = module.layout
    result = np.empty((len(t), layout.n_y, len(names)))
    u = _inputs(forcing, module, t)
    J, by = _slopes(module, names, t, x, u)
    rates = np.asarray(module.rhs(t, x, u=u))
    n_q, n_x, n_v = layout.n_q, layout.n_x, layout.n_v
    of = [layout.n_u + module.p_names.index(name) if name in module.p_names else
          module.u_names.index(name) if name in module.u_names else -1 for name in names]  # fmt: skip
    for j, time in enumerate(t):
        Y = output_derivatives(module.bind(u=u[:, j]), float(time), x[:, j], rates[n_q:, j])
        here = S[j]
        result[j] = Y[:, :n_x] @ here + Y[:, n_x : n_x + n_v] @ (J[j] @ here + by[j])[n_q:]
        for column, place in enumerate(of):
            if place >= 0:
                result[j, :, column] += Y[:, n_x + n_v + place]
    return result
