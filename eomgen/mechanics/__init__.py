"""Mechanism -> Kinematics (spanning tree, poses, twists, loop constraints) and its mobility."""

from .kinematics import ForceTerms, Kinematics, LoopCoordinates, analyse
from .loops import Constraints
from .topology import Branch, Topology, find_topology
from .tree import Link, Poses

__all__ = [
    "Branch",
    "Constraints",
    "ForceTerms",
    "Kinematics",
    "Link",
    "LoopCoordinates",
    "Poses",
    "Topology",
    "analyse",
    "find_topology",
]
