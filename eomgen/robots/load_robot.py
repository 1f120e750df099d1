"""Robots, loading: a path and options -> Description, by the root element of the file."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping
from dataclasses import fields
from typing import Any

import numpy as np

from ..base.files import as_name
from ..base.limits.numbers import LARGEST
from ..base.value_rules import CHECKS, word_of_check
from ..describe.constant_texts import constant
from ..describe.description import Description
from ..describe.names import nearest
from ..errors import ModelError, ill_typed, no_choice, no_such
from .describe_robot import describe_robot
from .robot import CONVERTED, RobotOptions
from .urdf import read_urdf
from .xml_text import read_xml

MIMIC = ("coupling", "independent")
LIMITS = ("note", "stop", "off")
ROTATIONS = ("euler_angles", "euler_parameters")


def describe_file(path: str | os.PathLike[str], **given: Any) -> Description:
    """The raw data of a URDF or MJCF file.

    Parameters
    ----------
    path : str or path
    **given
        Fields of :class:`~eomgen.robots.robot.RobotOptions`.

    Returns
    -------
    Description

    Raises
    ------
    FileNotFoundError
        There is no such file.
    UsageError
        An option that is not there, or not a value it takes.
    ModelError
        The file is no robot: every fault found, with its line.
    MissingDependencyError
        A package is needed.
    """
    options = make_options(given)
    root = read_xml(path)
    if root.tag == "robot":
        robot = read_urdf(root, options)
    elif root.tag in ("mujoco", "mujocoinclude"):
        from .mjcf import read_mjcf

        robot = read_mjcf(root, options)
    else:
        remedy = "a URDF file begins with <robot>, an MJCF file with <mujoco>"
        if root.tag == "sdf":
            remedy += f"; {CONVERTED['.sdf']}"
        raise ModelError([root.problem(root.tag, "is not a robot", remedy, "EG-FILE-DAMAGED")])
    return describe_robot(robot, options)


def make_options(given: dict[str, Any]) -> RobotOptions:
    """Checked options.

    Raises
    ------
    UsageError
    """
    known = [field.name for field in fields(RobotOptions)]
    for key in given:
        if key not in known:
            raise no_such(f"no option {key!r} for a robot file; {nearest(key, known, 'options')}")
    for key, allowed in (("mimic", MIMIC), ("rotation", ROTATIONS), ("limits", LIMITS)):
        if key in given and not (isinstance(given[key], str) and given[key] in allowed):
            raise no_choice(f"{key} must be one of {', '.join(allowed)}, not {given[key]!r}")
    if given.get("check_inertia") is not None:
        word = word_of_check(given["check_inertia"])
        if word is None:
            raise no_choice(
                f"check_inertia must be one of {', '.join(CHECKS)}, True, False, not {given['check_inertia']!r}"
            )
        given = {**given, "check_inertia": word}
    friction = given.get("friction", False)
    if not isinstance(friction, bool | int | float) or not 0 <= friction < float("inf"):
        raise ill_typed(
            f"friction must be True, or the velocity (rad/s or m/s) below which it is smoothed, not {friction!r}"
        )
    for key in ("floating", "merge", "symbolic"):
        if not isinstance(given.get(key, False), bool | np.bool_):
            raise ill_typed(f"{key} must be True or False, not {given[key]!r}")
    given = {key: _names(key, value) if key in ("actuate", "lock") else value for key, value in given.items()}
    if not _is_number(given.get("snap", 0.0)) or given.get("snap", 0.0) < 0.0:
        raise ill_typed(f"snap must be an angle (rad), 0 or positive, not {given['snap']!r}")
    if given.get("assets") is not None:
        as_name("assets", given["assets"])
    return RobotOptions(**given)


def _is_number(value: Any) -> bool:
    """Whether a value is a finite number that the reader's products stay finite with."""
    size: Any = abs(value) if isinstance(value, int | float | np.integer | np.floating) else math.inf
    return bool(size <= LARGEST)


def _names(key: str, given: Any) -> Any:
    """Names of joints as a tuple; what else an option takes as it is."""
    if isinstance(given, str):
        return (given,)
    if key == "actuate" and isinstance(given, bool | np.bool_):
        return bool(given)
    if key == "lock" and isinstance(given, Mapping):
        given = {name: constant(x, f"lock of {name}") if isinstance(x, str) else x for name, x in given.items()}
        for name, value in given.items():
            if not _is_number(value):
                message = f"the value must be a finite number (rad or m), at most {LARGEST:g}"
                raise ill_typed(f"lock={{{name!r}: {value!r}}}: {message}")
        return given
    names = tuple(given) if isinstance(given, Iterable) and not isinstance(given, Mapping) else (None,)
    if not all(isinstance(name, str) for name in names):
        also = "True" if key == "actuate" else "a mapping of names to values"
        raise ill_typed(f"{key} must be names of joints, or {also}, not {given!r}")
    return names
