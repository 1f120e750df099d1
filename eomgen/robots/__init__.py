"""Robots: files that describe robots for others (URDF, MJCF) -> the Description that a model file would give."""

from .load_robot import describe_file
from .robot import RobotOptions

__all__ = ["RobotOptions", "describe_file"]
