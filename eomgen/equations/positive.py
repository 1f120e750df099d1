"""Stage equations: mass matrix at configurations tried -> an error naming coordinates with no inertia behind them."""

from __future__ import annotations

import numpy as np

from ..base import algebra
from ..base.algebra import correlated, safely_positive
from ..base.limits.numbers import LEAST, TINY
from ..describe.mechanism import Mechanism
from ..errors import EvaluationError, ModelError, PartitionError, Problem
from ..graph.evaluate import compile_evaluator
from ..kinematics import Kinematics
from ..kinematics.constraint_functions import ConstraintFunctions
from ..kinematics.mobility import Mobility
from ..numeric.partitions import partition
from .idle import IdleMotion
from .tree_equations import TreeEquations

REMEDY = "give the body that it moves a mass or an inertia; for kinematics alone, check_inertia: note"
SHOWN = 8  #: bodies that a message names


def require_inertia(kinematics: Kinematics, mobility: Mobility, tree: TreeEquations) -> str:
    """Refuse a degree of freedom that moves no mass at any configuration tried, unless the model is one without mass.

    Kinematics needs no masses: a mechanism without any mass, inertia and force element is taken for what it is, and so
    is any model whose ``check_inertia`` is ``note`` or ``off``.

    Returns
    -------
    str
        What has no inertia, for the calls that need it; empty where all motions have.

    Raises
    ------
    ModelError
        Names the coordinates that move nothing.
    """
    problems = find_idle(kinematics, mobility, tree)
    if not problems:
        return ""
    mechanism = kinematics.mechanism
    if mechanism.check_inertia == "error" and not is_kinematic(mechanism):
        raise ModelError(problems)
    return f"{problems[0].path}: {problems[0].message}{_massless(kinematics)}"


def is_kinematic(mechanism: Mechanism) -> bool:
    """Whether bodies are there, and nothing has a mass or an inertia and nothing pushes: motion is all it can tell."""
    heavy = [x for b in mechanism.bodies for x in (b.mass, *(entry for row in b.inertia for entry in row))]
    heavy += [spec.armature for spec in mechanism.joints if spec.armature is not None]
    return bool(mechanism.bodies) and not mechanism.forces and all(x.is_zero for x in heavy)


def _massless(kinematics: Kinematics) -> str:
    """The bodies that have neither mass nor inertia, in words."""
    mechanism = kinematics.mechanism
    names = [
        body.name
        for body in mechanism.bodies
        if body.mass.is_zero and all(entry.is_zero for row in body.inertia for entry in row)
    ]
    if not names:
        return ""
    shown = ", ".join(names[:SHOWN]) + (f", ... ({len(names)} in all)" if len(names) > SHOWN else "")
    return f"; bodies without mass and inertia: {shown}"


def find_idle(kinematics: Kinematics, mobility: Mobility, tree: TreeEquations) -> list[Problem]:
    """The motions that move no mass at any configuration tried, as faults of the model.

    The embedded mass matrix must be positive definite somewhere; where it is singular at single configurations only,
    as Euler angles make it, a run that gets there says so.  Each coordinate is measured by its own inertia, so that a
    small mechanism beside a large one is as sound as alone.
    """
    m, names = kinematics.mechanism, kinematics.velocity_labels
    numbers = {p.name: float(p.value or 0.0) for p in m.parameters} | {u.name: u.value for u in m.inputs}
    functions = ConstraintFunctions(kinematics, numbers)
    n, r = len(names), mobility.rank
    if n == r:
        return []
    found = tree.pivots or (tree.constrained().pivots if tree.constrained is not None and functions.m else ())
    if found:
        moved = compile_evaluator(list(found), (*kinematics.names, *numbers, "t"))
        for sample in mobility.samples:
            pivots = np.array(moved([*sample, *numbers.values(), 0.0]), dtype=float) * functions.scales.q**2
            sizes = np.array(pivots)
            for k in reversed(range(n)):  # what an articulated inertia is left over from
                if (j := kinematics.parent[k]) >= 0:
                    sizes[j] = max(sizes[j], sizes[k])
            if safely_positive(pivots, sizes):
                return []
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
        sizes, modes = algebra.eigh(correlated(embedded))
        if sizes[0] > LEAST or (m.negative and np.abs(sizes).min() > LEAST):
            return []
        if m.negative:  # what is near 0 counts, not what is negative
            order = np.argsort(np.abs(sizes), kind="stable")
            sizes, modes = np.abs(sizes[order]), modes[:, order]
        if worst is None:  # the reference is what the message speaks of
            unit = 1.0 / np.sqrt(np.maximum(np.abs(embedded.diagonal()), TINY))
            alone = np.flatnonzero(np.abs(embedded.diagonal()) <= LEAST * np.abs(embedded).max(initial=TINY))
            motion = B @ (modes[:, 0] * unit / unit.max())
            idle = None
            if not alone.size:
                what = "negative inertia" if sizes[0] < -LEAST else "no inertia"
                idle = IdleMotion(q, motion * scales, what, numbers)
            worst = float(sizes[0]), np.abs(motion), idle
    if worst is None:
        raise EvaluationError(
            "the mass matrix is not finite at the initial configuration",
            0.0,
            mobility.q_reference,
            code="EG-NOT-FINITE",
        )
    size, motion, idle = worst
    if idle is not None:
        return [idle.problem(kinematics)]
    problems = []
    for j in np.argsort(-motion):
        if motion[j] > 0.3 * motion.max():
            spec = next((s for s in m.joints if names[j] in (*s.coordinates, *s.velocities)), None)
            section = "lagrangian" if m.given is None else "equations"
            path = f"joints.{spec.name}" if spec else f"{section}.{names[j]}"
            what = "negative inertia" if size < -LEAST else "no inertia"
            message = f"coordinate {names[j]!r} has {what} behind it: a motion along this coordinate moves no mass"
            problems.append(m.problem(path, message, REMEDY, "EG-NO-INERTIA"))
    return problems
