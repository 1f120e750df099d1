"""Stage equations: Kinematics -> TreeEquations; :data:`METHODS` is the literal table of derivations."""

from . import embedding, lagrange, recursive
from .armature import with_armature
from .equations import Method, TreeEquations
from .given import GIVEN, take_given

METHODS: dict[str, Method] = {
    "embedding": with_armature(embedding.derive),
    "lagrange": with_armature(lagrange.derive),
    "recursive": with_armature(recursive.derive),
}

__all__ = ["GIVEN", "METHODS", "Method", "TreeEquations", "take_given"]
