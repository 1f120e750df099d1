"""Importers: what others describe mechanisms in (URDF, MJCF, SymPy's mechanics) -> the Description of a model file."""

from __future__ import annotations

import os
from typing import Any

from ..errors import ModelError
from ..model.description import Description
from .robot import CONVERTED, RobotOptions, make_options
from .robot_description import RobotWriter
from .urdf import UrdfReader
from .xml_file import read_xml

__all__ = ["RobotOptions", "describe_file"]


def describe_file(path: str | os.PathLike[str], **options: Any) -> Description:
    """The raw data of a URDF or MJCF file, by its root element; options are those of :class:`RobotOptions`.

    Raises FileNotFoundError; UsageError for an option that is not there, or a value that it does not take; ModelError
    with every fault and its line; MissingDependencyError.
    """
    chosen = make_options(options)
    root = read_xml(path)
    if root.tag == "robot":
        return RobotWriter(UrdfReader(root, chosen).read(), chosen).describe()
    if root.tag in ("mujoco", "mujocoinclude"):
        from .mjcf import read_mjcf

        return RobotWriter(read_mjcf(root, chosen), chosen).describe()
    remedy = "a URDF file begins with <robot>, an MJCF file with <mujoco>"
    if root.tag == "sdf":
        remedy += f"; {CONVERTED['.sdf']}"
    raise ModelError([root.problem(root.tag, "is not a robot", remedy, "EG-FILE-DAMAGED")])
