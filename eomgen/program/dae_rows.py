"""Stage program: SystemTerms -> the kinematic rows of the differential-algebraic form."""

from __future__ import annotations

from collections.abc import Sequence

from ..graph.core import Expr
from ..graph.substitute import substitute
from .terms import SystemTerms


def dae_kinematics(terms: SystemTerms, rates: Sequence[str], corrections: Sequence[str]) -> list[Expr]:
    """q' - N (v - S^2 C_q^T mu): kinematics with corrections (C. W. Gear, B. Leimkuhler, G. K. Gupta, 1985).

    Parameters
    ----------
    terms : SystemTerms
    rates, corrections : sequences of str
        Symbols of q' and of mu, one for each holonomic row.
    """
    graph = terms.graph
    v = [graph.symbol(name) for name in terms.v]
    moved = list(v)
    for row, name in zip(terms.constraint_jacobian, corrections, strict=False):
        mu = graph.symbol(name)
        moved = [x - s * s * c * mu for x, s, c in zip(moved, terms.coordinate_scales, row, strict=True)]
    flow = substitute(terms.q_dot, dict(zip(v, moved, strict=True)))
    return [graph.symbol(name) - f for name, f in zip(rates, flow, strict=True)]
