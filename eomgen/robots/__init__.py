"""Robots: files that describe robots for others (URDF, MJCF) -> the Description that a model file would give."""

from .load_robot import describe_file
from .robot import Options

__all__ = ["Options", "describe_file"]
