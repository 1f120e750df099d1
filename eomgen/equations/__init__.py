"""Stage equations: Kinematics -> TreeEquations; :data:`METHODS` is the literal table of derivations."""

from . import embedding, lagrange, recursive
from .equations import Method, TreeEquations

METHODS: dict[str, Method] = {
    "embedding": embedding.derive,
    "lagrange": lagrange.derive,
    "recursive": recursive.derive,
}

__all__ = ["METHODS", "Method", "TreeEquations"]
