"""Robots, MJCF: what MuJoCo's compiler made, with the names and places of its elements."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import ModelError
from ..limits.files import LARGEST
from .mjcf_fields import FINITE
from .mjcf_files import Lines
from .robot import Place, Robot
from .xml_text import XmlElement


class Compiled:
    """A compiled model, and the robot that it becomes."""

    def __init__(self, m: Any, root: XmlElement, lines: Lines) -> None:
        self.m, self.root, self.lines = m, root, lines
        self.robot = Robot(root.attributes.get("model") or "robot", root.file)
        self.names = {kind: [self.name(kind, k) for k in range(len(m.names[kind]))] for kind in ("body", "joint")}

    def name(self, kind: str, k: int) -> str:
        """The name of an element; one made from its kind and number if it has none."""
        return self.m.names[kind][k] or f"{'equality' if kind == 'eq' else kind}{k}"

    def off(self, *flags: str) -> bool:
        """Whether the file disables one of these parts of the physics, by the words of mjtDisableBit."""
        passive = ("PASSIVE",) if "SPRING" in flags or "DAMPER" in flags else ()  # both in one, before MuJoCo 3.4
        return any(self.m.opt.disableflags & self.m.flags.get(flag, 0) for flag in (*flags, *passive))

    def _check(self) -> None:
        """Refuse numbers that are not finite or far too large, which MuJoCo takes."""
        for key, what in FINITE.items():
            values = getattr(self.m.opt if key == "gravity" else self.m, key, 0.0)
            if not (np.abs(values) <= LARGEST).all():
                remedy = f"at most {LARGEST:g}, so that products stay finite"
                problem = self.root.problem("mujoco", f"{what} ({key}) come out too large or not finite", remedy)
                self.robot.problems.append(problem)
        if self.robot.problems:
            raise ModelError(self.robot.problems)

    def place(self, name: str, *tags: str) -> Place:
        """Where an element of a name is; the model's first line if it has none."""
        for tag in tags:
            if (tag, name) in self.lines:
                return self.lines[tag, name]
        return self.root.file, self.root.line
