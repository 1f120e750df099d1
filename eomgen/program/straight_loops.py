"""Stage program: SystemTerms with loops -> the straight-line form of their right-hand side, by bodies or embedded."""

from __future__ import annotations

from ..limits.constraints import DIFFERENTIATED, TIKHONOV
from .body_loops import BodyLoops
from .embedded_loops import EmbeddedLoops
from .loop_blocks import LoopBlocks, estimate
from .terms import SystemTerms

SOLUTIONS = 4  #: that leave no trace of DIFFERENTIATED


def curved_loops(terms: SystemTerms, longest: int, usual: LoopBlocks | None) -> LoopBlocks | None:
    """The form that is differentiated twice: the usual one, but for a larger term in redundant rows."""
    if usual is not None and not usual.redundant:
        return usual
    return straight_loops(terms, longest, DIFFERENTIATED, SOLUTIONS)


def straight_loops(terms: SystemTerms, longest: int, term: float = TIKHONOV, solutions: int = 2) -> LoopBlocks | None:
    """The form that takes no pivots, if there is one whose factors take at most so many multiplications.

    Redundant rows take a term in so many solutions.
    """
    if not terms.n_c or not terms.n_dof or not (terms.mass_matrix or terms.by_columns):
        return None
    if terms.given_rates or terms.system is not None or not terms.projects:
        return None
    bodies = BodyLoops(terms, term, solutions)
    if bodies.motion is not None or terms.by_columns:
        return bodies if bodies.motion is not None else None
    if estimate(terms.constraint_jacobian, terms.n_dof) > longest:
        return None
    loops = EmbeddedLoops(terms, term, solutions)
    return loops if loops.determined else None
