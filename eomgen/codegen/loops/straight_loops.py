"""SystemTerms with loops -> the straight-line form of their right-hand side, by bodies or embedded."""

from __future__ import annotations

from ...graph.count import count
from ..terms import SystemTerms
from .body_loops import BodyLoops
from .embedded_loops import EmbeddedLoops
from .loop_blocks import LoopBlocks, estimate
from .regular_loops import RegularLoops

SAVED = 0.7  #: part of the operations of the usual blocks that others take at most which are tried before them
LONGER = 4  #: times as many multiplications as usual blocks these may take: 320 four-bars in a row take 0.6 of the time


def regular_loops(loops: LoopBlocks | None, longest: int) -> RegularLoops | None:
    """The form of right-hand sides away from change points, where the usual one takes many more operations.

    Mechanisms of few velocities have no use for it: their usual form is left for pivots near change points.
    """
    if loops is None or not loops.gentle:
        return None
    regular = RegularLoops(loops)
    if not regular.possible or regular.estimate > LONGER * longest:
        return None
    return regular if _operations(regular) < SAVED * _operations(loops) else None


def _operations(blocks: LoopBlocks | RegularLoops) -> int:
    outputs, checks = blocks.dynamics()
    return count(blocks.closing()).total + count([*outputs, *checks]).total


def straight_loops(terms: SystemTerms, longest: int) -> LoopBlocks | None:
    """The form that takes no pivots, if there is one whose factors take at most so many multiplications."""
    if not terms.n_c or not terms.n_dof or not (terms.mass_matrix or terms.by_columns):
        return None
    if terms.given_rates or terms.system is not None or not terms.projects:
        return None
    bodies = BodyLoops(terms)
    if bodies.motion is not None or terms.by_columns:
        return bodies if bodies.motion is not None else None
    if estimate(terms.constraint_jacobian, terms.n_dof) > longest:
        return None
    loops = EmbeddedLoops(terms)
    return loops if loops.determined else None
