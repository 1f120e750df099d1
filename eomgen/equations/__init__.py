"""Stage equations: Kinematics -> TreeEquations; :data:`METHODS` is the literal table of derivations."""

from . import embedding, lagrange
from .equations import Method, TreeEquations

METHODS: dict[str, Method] = {
    "embedding": embedding.derive,
    "lagrange": lagrange.derive,
}

__all__ = ["METHODS", "Method", "TreeEquations"]
