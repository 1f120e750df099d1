"""Kinematics -> TreeEquations; :data:`METHODS` is the literal table of derivations."""

from importlib import import_module

from ..kinematics import Kinematics
from .tree_equations import GIVEN, Method, TreeEquations, direct_equations, with_armature


def _derive_in(name: str) -> Method:
    """The derivation in a file of its name, which is read when it is first used."""

    def derive(kinematics: Kinematics) -> TreeEquations:
        result: TreeEquations = import_module(f".{name}", __package__).derive(kinematics)
        return result

    return derive


METHODS: dict[str, Method] = {
    "embedding": with_armature(_derive_in("embedding")),
    "lagrange": with_armature(_derive_in("lagrange")),
    "recursive": with_armature(_derive_in("recursive")),
    "augmented": _derive_in("augmented"),
    "newton_euler": with_armature(_derive_in("newton_euler")),
    "amalgamated": with_armature(_derive_in("amalgamated")),
    "gibbs_appell": with_armature(_derive_in("gibbs_appell")),
    "hamilton": _derive_in("hamilton"),
}

__all__ = ["GIVEN", "METHODS", "Method", "TreeEquations", "direct_equations"]
