"""Stage equations: the mass matrix at configurations tried -> how many digits of the accelerations rounding leaves.

With B the motions of the degrees of freedom, B^T M B is a sum of terms of the size of D, the sums of B_ik^2 M_ii.
What rounding leaves undetermined along a motion is eps over the smallest eigenvalue of D^-1/2 B^T M B D^-1/2 (A. van
der Sluis, Numerische Mathematik 14, 1969; J. W. Demmel, K. Veselic, SIAM J. Matrix Anal. Appl. 13, 1992).  Masses or
lengths that are far apart make it small: in some motion a heavy body moves little beside a light one, whose inertia is
lost in the sum.  Methods that solve for the motion of every free body never form that sum.
"""

from __future__ import annotations

import numpy as np

from ..base import algebra
from ..base.limits.numbers import EPS, TINY, WORTH_A_WORD
from ..errors import EvaluationError
from ..graph.evaluate import compile_evaluator
from ..kinematics import Kinematics
from ..kinematics.constraint_functions import ConstraintFunctions
from ..kinematics.mobility import Mobility
from ..numeric.partitions import partition
from .tree_equations import TreeEquations

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
    numbers = {p.name: float(p.value or 0.0) for p in m.parameters} | {u.name: u.value for u in m.inputs}
    functions = ConstraintFunctions(kinematics, numbers)
    mass = compile_evaluator([x for row in tree.mass_matrix for x in row], (*kinematics.names, *numbers, "t"))
    scales = functions.scales.q
    independent = [names.index(name) for name in mobility.independent]
    best = 0.0
    for sample in mobility.samples:
        q = np.array(sample)
        M = np.array(mass([*sample, *numbers.values(), 0.0]), dtype=float).reshape(n, n) * np.outer(scales, scales)
        try:
            B = partition(functions.scaled_jacobian(q), r, independent).B if functions.m else np.eye(n)
            root = np.sqrt(np.maximum((B**2 * np.abs(M.diagonal())[:, None]).sum(axis=0), TINY))
            best = max(best, float(algebra.eigvalsh((B.T @ M @ B) / np.outer(root, root))[0]))
        except EvaluationError:
            continue  # rank is lost here, or nothing is finite
        if best >= WORTH_A_WORD:
            break
    return best
