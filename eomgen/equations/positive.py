"""Stage equations: mass matrix at configurations tried -> an error naming coordinates with no inertia behind them."""

from __future__ import annotations

import numpy as np

from ..errors import EvaluationError, ModelError, PartitionError
from ..graph.evaluate import compile_evaluator
from ..kinematics import Kinematics
from ..kinematics.mobility import ConstraintFunctions, Mobility
from ..numeric.definite import correlated, safely_positive
from ..numeric.partitions import partition
from .equations import TreeEquations
from .idle import IdleMotion

LEAST = 1e-12  #: smallest eigenvalue of the mass matrix with its diagonal scaled to 1


def require_inertia(kinematics: Kinematics, mobility: Mobility, tree: TreeEquations) -> None:
    """Refuse a degree of freedom that moves no mass at any configuration tried.

    The embedded mass matrix must be positive definite somewhere; where it is singular at single configurations only,
    as Euler angles make it, a run that gets there says so.  Each coordinate is measured by its own inertia, so that a
    small mechanism beside a large one is as sound as alone.

    Raises
    ------
    ModelError
        Names the coordinates that move nothing.
    """
    m, names = kinematics.mechanism, kinematics.freedoms
    numbers = {p.name: float(p.value or 0.0) for p in m.parameters} | {u.name: u.value for u in m.inputs}
    functions = ConstraintFunctions(kinematics, numbers)
    n, r = len(names), mobility.rank
    if n == r:
        return
    if tree.pivots:
        moved = compile_evaluator(list(tree.pivots), (*kinematics.names, *numbers, "t"))
        for sample in mobility.samples:
            pivots = np.array(moved([*sample, *numbers.values(), 0.0]), dtype=float) * functions.scales.q**2
            sizes = np.array(pivots)
            for k in reversed(range(n)):  # what an articulated inertia is left over from
                if (j := kinematics.parent[k]) >= 0:
                    sizes[j] = max(sizes[j], sizes[k])
            if safely_positive(pivots, sizes):
                return
    mass = compile_evaluator([x for row in tree.mass_matrix for x in row], (*kinematics.names, *numbers, "t"))
    scales = functions.scales.q
    independent = [names.index(name) for name in mobility.independent]
    worst: tuple[float, np.ndarray, IdleMotion | None] | None = None
    for sample in mobility.samples:
        q = np.array(sample)
        M = np.array(mass([*sample, *numbers.values(), 0.0]), dtype=float).reshape(n, n) * np.outer(scales, scales)
        if not np.isfinite(M).all():
            continue
        try:
            B = partition(functions.scaled_jacobian(q), r, independent).B if functions.m else np.eye(n)
        except PartitionError:
            continue  # rank is lost here, and another configuration will do
        embedded = B.T @ M @ B
        sizes, modes = np.linalg.eigh(correlated(embedded))
        if sizes[0] > LEAST:
            return
        if worst is None:  # the reference is what the message speaks of
            unit = 1.0 / np.sqrt(np.maximum(np.abs(embedded.diagonal()), 1e-300))
            alone = np.flatnonzero(np.abs(embedded.diagonal()) <= LEAST * np.abs(embedded).max(initial=1e-300))
            motion = B @ (modes[:, 0] * unit / unit.max())
            idle = None
            if not alone.size:
                what = "negative inertia" if sizes[0] < -LEAST else "no inertia"
                idle = IdleMotion(q, motion * scales, what, numbers)
            worst = float(sizes[0]), np.abs(motion), idle
    if worst is None:
        raise EvaluationError("the mass matrix is not finite at the initial configuration", 0.0, mobility.q_reference)
    size, motion, idle = worst
    if idle is not None:
        raise ModelError([idle.problem(kinematics)])
    problems = []
    for j in np.argsort(-motion):
        if motion[j] > 0.3 * motion.max():
            spec = next((s for s in m.joints if names[j] in (*s.coordinates, *s.velocities)), None)
            section = "lagrangian" if m.given is None else "equations"
            path = f"joints.{spec.name}" if spec else f"{section}.{names[j]}"
            what = "negative inertia" if size < -LEAST else "no inertia"
            message = f"coordinate {names[j]!r} has {what} behind it: a motion along it moves no mass"
            problems.append(m.problem(path, message, "give the body it moves a mass or an inertia"))
    raise ModelError(problems)
