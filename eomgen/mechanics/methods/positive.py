"""The mass matrix at configurations tried -> coordinates without inertia, digits that rounding leaves."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from ...base import algebra
from ...base.algebra import Array, correlated, partition
from ...base.limits.constraints import UNMOVED
from ...base.limits.numbers import EPS, LEAST, NOTHING, SINGULAR, TINY, WORTH_A_WORD
from ...errors import EvaluationError, ModelError, PartitionError, Problem
from ...expr.evaluate import Evaluator, evaluate
from ...expr.records import Record
from ...model.mechanism import Mechanism
from .. import Kinematics
from ..constraint_functions import ConstraintFunctions
from ..mobility import Mobility
from .tree_equations import TreeEquations

# -- motions that move no mass -----------------------------------------------------------------------------------------


FAINT = 0.01  #: part of a motion, relative to its largest, that is left out of a message


class MasslessMotion(Record):
    """Velocities v (n,), in the order of the freedoms, that move no mass at a configuration q (n_q,)."""

    q: np.ndarray
    v: np.ndarray
    what: str
    numbers: Mapping[str, float]

    def problem(self, kinematics: Kinematics) -> Problem:
        """The fault, at the joint that moves the most."""
        names, mechanism = kinematics.velocity_labels, kinematics.mechanism
        v = self.v / np.abs(self.v).max()
        involved = [j for j in np.argsort(-np.abs(v), kind="stable") if abs(v[j]) > FAINT]
        largest = names[involved[0]]
        path = _place_of_velocity(mechanism, largest)
        places = sorted(involved)
        ratio = " : ".join(f"{v[j]:.3g}" for j in places)
        together = f"{', '.join(names[j] for j in places)} at the rates {ratio}"
        turning = self._turning(kinematics)
        if not turning:
            message = f"the motion of {together} has {self.what} behind it"
            return mechanism.problem(path, message, "give the bodies it moves a mass or an inertia", "EG-NO-INERTIA")
        bodies = "; ".join(f"{name!r} about ({', '.join(f'{x:.3g}' for x in axis)})" for name, axis in turning)
        message = f"the motion of {together} has {self.what} behind it: it turns {bodies} in body axes"
        name = turning[0][0]
        remedy = f"give {name!r} an inertia about that axis, or a joint that does not turn it about that axis"
        return mechanism.problem(path, message, remedy, "EG-NO-INERTIA")

    def _turning(self, kinematics: Kinematics) -> list[tuple[str, Sequence[float]]]:
        """Bodies that turn, and their axes in body axes."""
        motion = kinematics.motion
        zero = dict.fromkeys(kinematics.velocity_names, 0.0)
        values = {**self.numbers, "t": 0.0, **dict(zip(kinematics.names, map(float, self.q), strict=True)), **zero}
        rates = dict(zip(kinematics.velocity_names, map(float, self.v), strict=True))
        result: list[tuple[str, np.ndarray]] = []
        for k, body in enumerate(kinematics.mechanism.bodies):
            marker = motion.body(k)
            rotation = [x for row in motion.rotation(marker) for x in row]
            expressions = kinematics.resolve([*motion.angular_velocity(marker), *rotation])
            moving, still = (np.array(evaluate(expressions, values | part), dtype=float) for part in (rates, {}))
            result.append((body.name, moving[3:].reshape(3, 3).T @ (moving[:3] - still[:3])))  # drivers turn bodies too
        largest = max((float(np.linalg.norm(w)) for _, w in result), default=0.0)
        return [(name, clean(w)) for name, w in result if np.linalg.norm(w) > max(FAINT * largest, UNMOVED)]


def _place_of_velocity(mechanism: Mechanism, label: str) -> str:
    """The path of the joint of a velocity, or of the velocity itself where there are no joints."""
    spec = next((s for s in mechanism.joints if label in (*s.coordinates, *s.velocities)), None)
    return f"joints.{spec.name}" if spec else f"{mechanism.bare_section}.{label}"


def clean(axis: np.ndarray) -> list[float]:
    """A direction of length 1 whose first component that counts is positive; rounding is left out."""
    unit = np.round(axis / np.linalg.norm(axis), 9) + 0.0
    first = unit[np.flatnonzero(unit)[0]]
    return [float(x) + 0.0 for x in (unit if first > 0.0 else -unit)]


# -- coordinates without inertia ---------------------------------------------------------------------------------------


REMEDY = "give the body that it moves a mass or an inertia; for kinematics alone, check_inertia: note"
LISTED = 8  #: bodies that a message names


def require_inertia(kinematics: Kinematics, mobility: Mobility, tree: TreeEquations) -> str:
    """Refuse a degree of freedom that moves no mass at any configuration tried, unless the model is one without mass.

    Kinematics needs no masses: a mechanism without any mass, inertia and force element is taken for what it is, and so
    is any model whose ``check_inertia`` is ``note`` or ``off``.  Returned is what has no inertia, for the calls that
    need it; empty where all motions have.
    """
    problems = find_massless(kinematics, mobility, tree)
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
    """The bodies that have neither mass nor inertia, as text."""
    mechanism = kinematics.mechanism
    names = [
        body.name
        for body in mechanism.bodies
        if body.mass.is_zero and all(entry.is_zero for row in body.inertia for entry in row)
    ]
    if not names:
        return ""
    listed = ", ".join(names[:LISTED]) + (f", ... ({len(names)} in all)" if len(names) > LISTED else "")
    return f"; bodies without mass and inertia: {listed}"


def find_massless(kinematics: Kinematics, mobility: Mobility, tree: TreeEquations) -> list[Problem]:
    """The motions that move no mass at any configuration tried, as faults of the model.

    The embedded mass matrix must be positive definite somewhere; where it is singular at single configurations only,
    as Euler angles make it, a run that gets there says so.  Each coordinate is measured by its own inertia, so that a
    small mechanism beside a large one is as sound as alone.
    """
    m, names = kinematics.mechanism, kinematics.velocity_labels
    functions = ConstraintFunctions.at_declared(kinematics)
    numbers, n, r = functions.values, len(names), mobility.rank
    if n == r:
        return []
    result = tree.pivots or (tree.constrained().pivots if tree.constrained is not None and functions.m else ())
    if result:
        moved = Evaluator(list(result), (*kinematics.names, *numbers, "t"))
        for sample in mobility.samples:
            pivots = np.array(moved([*sample, *numbers.values(), 0.0]), dtype=float) * functions.scales.q**2
            sizes = np.array(pivots)
            for k in reversed(range(n)):  # what an articulated inertia is left over from
                if (j := kinematics.parent[k]) >= 0:
                    sizes[j] = max(sizes[j], sizes[k])
            if safely_positive(pivots, sizes):
                return []
    worst: tuple[float, np.ndarray, MasslessMotion | None] | None = None
    for q, M, B in _inertia_at_samples(functions, mobility, tree):
        embedded = B.T @ M @ B
        sizes, modes = algebra.eigh(correlated(embedded))
        if sizes[0] > LEAST or (m.negative and np.abs(sizes).min() > LEAST):
            return []
        if m.negative:  # what is near 0 counts, not what is negative
            order = np.argsort(np.abs(sizes), kind="stable")
            sizes, modes = np.abs(sizes[order]), modes[:, order]
        if worst is None:  # the reference is what the message speaks of
            unit = 1.0 / np.sqrt(np.maximum(np.abs(embedded.diagonal()), TINY))
            vanishing = np.flatnonzero(np.abs(embedded.diagonal()) <= LEAST * np.abs(embedded).max(initial=TINY))
            motion = B @ (modes[:, 0] * unit / unit.max())
            massless = None
            if not vanishing.size:
                what = "negative inertia" if sizes[0] < -LEAST else "no inertia"
                massless = MasslessMotion(q, motion * functions.scales.q, what, numbers)
            worst = float(sizes[0]), np.abs(motion), massless
    if worst is None:
        raise EvaluationError(
            "the mass matrix is not finite at the initial configuration",
            0.0,
            mobility.q_reference,
            code="EG-NOT-FINITE",
        )
    size, motion, massless = worst
    if massless is not None:
        return [massless.problem(kinematics)]
    problems = []
    for j in np.argsort(-motion):
        if motion[j] > 0.3 * motion.max():
            path = _place_of_velocity(m, names[j])
            what = "negative inertia" if size < -LEAST else "no inertia"
            message = f"coordinate {names[j]!r} has {what} behind it: a motion along this coordinate moves no mass"
            problems.append(m.problem(path, message, REMEDY, "EG-NO-INERTIA"))
    return problems


def _inertia_at_samples(
    functions: ConstraintFunctions, mobility: Mobility, tree: TreeEquations
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """q, M in the scales of the coordinates, and the motions B that the constraints allow, where these are known."""
    kinematics, n, scales = functions.kinematics, functions.n, functions.scales.q
    entries = [x for row in tree.mass_matrix for x in row]
    mass = Evaluator(entries, (*kinematics.names, *functions.values, "t"))
    independent = [kinematics.velocity_labels.index(name) for name in mobility.independent]
    for sample in mobility.samples:
        q, flat = np.array(sample), mass([*sample, *functions.values.values(), 0.0])
        M = np.array(flat, dtype=float).reshape(n, n) * np.outer(scales, scales)
        if not np.isfinite(M).all():
            continue
        try:
            B = partition(functions.scaled_jacobian(q), mobility.rank, independent).B if functions.m else np.eye(n)
        except PartitionError:
            continue  # rank is lost here, and another configuration will do
        yield q, M, B


# -- digits that rounding leaves ---------------------------------------------------------------------------------------

# With B the motions of the degrees of freedom, B^T M B is a sum of terms of the size of D, the sums of B_ik^2 M_ii.
# What rounding leaves undetermined along a motion is eps over the smallest eigenvalue of D^-1/2 B^T M B D^-1/2 (A. van
# der Sluis, Numerische Mathematik 14, 1969; J. W. Demmel, K. Veselic, SIAM J. Matrix Anal. Appl. 13, 1992). Masses or
# lengths that are far apart make it small: in some motion a heavy body moves little beside a light one, whose inertia
# is lost in the sum. Methods that solve for the motion of every free body never form that sum.


FREE = ("newton_euler", "amalgamated")  #: methods that never form the embedded mass matrix


def note_lost_digits(kinematics: Kinematics, mobility: Mobility, tree: TreeEquations) -> str:
    """A note where rounding takes more than half of the digits at every configuration tried; else empty."""
    least = smallest_share(kinematics, mobility, tree)
    if not least < WORTH_A_WORD:
        return ""
    kept = max(0, int(-np.log10(EPS / max(least, EPS))))
    bodies = "" if kinematics.mechanism.lagrangian else f"; the methods {' and '.join(FREE)} keep all digits"
    return (
        f"masses or lengths differ so much in size that rounding leaves about {kept} of 16 digits of the accelerations "
        f"(smallest share of inertia {least:.1g}){bodies}"
    )


def smallest_share(kinematics: Kinematics, mobility: Mobility, tree: TreeEquations) -> float:
    """The smallest eigenvalue of the scaled embedded mass matrix, at the configuration where it is largest.

    1 where there is no degree of freedom.
    """
    m, names = kinematics.mechanism, kinematics.velocity_labels
    n, r = len(names), mobility.rank
    if n == r or m.negative:
        return 1.0
    best = 0.0
    for _, M, B in _inertia_at_samples(ConstraintFunctions.at_declared(kinematics), mobility, tree):
        root = np.sqrt(np.maximum((B**2 * np.abs(M.diagonal())[:, None]).sum(axis=0), TINY))
        best = max(best, float(algebra.eigvalsh((B.T @ M @ B) / np.outer(root, root))[0]))
        if best >= WORTH_A_WORD:
            break
    return best


def safely_positive(pivots: Array, sizes: Array) -> bool:
    """Whether each pivot (n,) of L D L^T exceeds 1e-13 of its size (n,) and 1e-22 of the largest; NaN does not."""
    return bool((pivots > np.maximum(SINGULAR * sizes, NOTHING * sizes.max(initial=0.0))).all())
