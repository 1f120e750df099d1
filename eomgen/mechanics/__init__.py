"""Mechanism -> Kinematics (spanning tree, poses, twists, loop constraints) and its mobility."""

from .kinematics import Kinematics, analyse

__all__ = ["Kinematics", "analyse"]
