"""Stage program: SystemTerms -> the residuals of the equations of motion with multipliers, of (q, v, a, l)."""

from __future__ import annotations

from ..graph.core import Expr
from .terms import SystemTerms


def constraint_forces(terms: SystemTerms) -> list[Expr]:
    """C_q^T l (n,)."""
    forces = [terms.graph.zero] * terms.n_v
    for row, name in zip(terms.constraint_jacobian, terms.multipliers, strict=True):
        l = terms.graph.symbol(name)
        forces = [r + c * l for r, c in zip(forces, row, strict=True)]
    return forces


def force_residual(terms: SystemTerms) -> list[Expr]:
    """r1 = M a + h + C_q^T l (n,)"""
    r1 = list(terms.inverse_dynamics)
    for row, name in zip(terms.constraint_jacobian, terms.multipliers, strict=True):
        l = terms.graph.symbol(name)
        r1 = [r + c * l for r, c in zip(r1, row, strict=True)]
    return r1


def acceleration_residual(terms: SystemTerms) -> list[Expr]:
    """r2 = C_q a + gamma (m,)"""
    a = [terms.graph.symbol(name) for name in terms.a]
    r2 = []
    for row, r in zip(terms.constraint_jacobian, terms.gamma, strict=True):
        for c, x in zip(row, a, strict=True):
            r = r + c * x
        r2.append(r)
    return r2
