"""Stage emit, example: a Program -> a state that moves, for the example of a C library's README."""

from __future__ import annotations

import numpy as np

from ..base import algebra
from ..base.algebra import Array
from ..errors import EomgenError
from ..graph.evaluate import compile_evaluator
from ..program.program import Program

RATE = 1.0  #: of an independent coordinate whose initial rate is not declared (m/s or rad/s)


def example_state(program: Program) -> list[float]:
    """x where the model starts, if the program knows it; else the declared position, and velocities as loops ask.

    Independent velocities are those declared, or RATE.
    """
    metadata, sizes = program.metadata, program.sizes
    if "start" in metadata:
        return list(metadata["start"])
    q = [float(x) for x in metadata.get("q_reference") or [0.0] * sizes.n_q]
    declared = metadata.get("initial", {})
    independent = list(metadata.get("independent", range(sizes.n_v)))
    v = np.zeros(sizes.n_v)
    v[independent] = [declared.get(program.velocities[k]) or RATE for k in independent]
    dependent = [k for k in range(sizes.n_v) if k not in independent]
    if dependent:
        v[dependent] = _followed(program, q, v, dependent)
    return [*q, *v.tolist()]


def _followed(program: Program, q: list[float], v: Array, dependent: list[int]) -> Array:
    """The dependent velocities with which J v + C_t = 0; 0 where the values of parameters do not let them be found."""
    none = np.zeros(len(dependent))
    rows = [y for block in program.blocks if block.name == "velocity_constraints" for y in block.outputs]
    values = [program.metadata[key] for key in ("p_values", "u_values")]
    if not rows or any(x is None for given in values for x in given):
        return none
    names = [*program.coordinates, *program.velocities, *program.parameters, *program.inputs, program.time]
    try:
        evaluate = compile_evaluator(rows, names)

        def residual(change: Array) -> Array:
            return np.array(evaluate([*q, *(v + change), *values[0], *values[1], 0.0]), dtype=float)

        units = np.eye(len(v))[dependent]
        start = residual(np.zeros(len(v)))
        slopes = np.array([residual(unit) - start for unit in units]).T
        found = algebra.lstsq(slopes, -start)
    except (EomgenError, ArithmeticError, np.linalg.LinAlgError):
        return none
    return found if np.isfinite(found).all() else none
