"""Scalar operations -> one hash-consed expression graph, with derivatives, values, counts and schedules.

SymPy enters and leaves through :mod:`eomgen.expr.sympy_bridge` and :mod:`eomgen.expr.sympy_bridge`, which are not
imported here, so that work without SymPy does not load it.
"""

from . import vectors
from .core import Expr, Graph, atan2, cos, sin, sqrt, substitute, symbols_of
from .differentiate import gradient, jacobian, jvp, vjp
from .evaluate import Evaluator, compile_evaluator, evaluate
from .schedule import Chunk, Operations, chunk, count, critical_path, order

__all__ = [
    "Chunk",
    "Evaluator",
    "Expr",
    "Graph",
    "Operations",
    "atan2",
    "chunk",
    "compile_evaluator",
    "cos",
    "count",
    "critical_path",
    "evaluate",
    "gradient",
    "jacobian",
    "jvp",
    "order",
    "sin",
    "sqrt",
    "substitute",
    "symbols_of",
    "vectors",
    "vjp",
]
