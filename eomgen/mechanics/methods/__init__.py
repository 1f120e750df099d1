"""Kinematics -> TreeEquations; :data:`METHODS` is the literal table of derivations."""

from . import amalgamated, augmented, embedding, gibbs_appell, hamilton, lagrange, newton_euler, recursive
from .tree_equations import GIVEN, Method, TreeEquations, direct_equations, with_armature

METHODS: dict[str, Method] = {
    "embedding": with_armature(embedding.derive),
    "lagrange": with_armature(lagrange.derive),
    "recursive": with_armature(recursive.derive),
    "augmented": augmented.derive,
    "newton_euler": with_armature(newton_euler.derive),
    "amalgamated": with_armature(amalgamated.derive),
    "gibbs_appell": with_armature(gibbs_appell.derive),
    "hamilton": hamilton.derive,
}

__all__ = ["GIVEN", "METHODS", "Method", "TreeEquations", "direct_equations"]
