"""Robots with closed loops as MJCF texts that eomgen, Pinocchio and MuJoCo read: trees of hinges and slides, whose ends
are connected in points.

All frames are parallel to the world's in the position in which the robots are described, where the loops are closed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import cos, pi, sin

import numpy as np

Point = Sequence[float] | np.ndarray


@dataclass
class Part:
    """A body at a place of the world, with its joints there and what hangs on it."""

    name: str
    at: Point
    joints: Sequence[tuple[str, str]] = ()  #: 'hinge' or 'slide', and axis
    mass: float = 1.0
    com: Point = (0.0, 0.0, 0.0)  #: from its place
    inertia: Point = (1e-2, 1e-2, 1e-2)
    parts: list[Part] = field(default_factory=list)

    def text(self, origin: Point = (0.0, 0.0, 0.0)) -> str:
        """As MJCF, on a body whose place is the origin."""
        joints = "".join(
            f'<joint name="{self.name}_{k}" type="{kind}" axis="{axis}"/>' for k, (kind, axis) in enumerate(self.joints)
        )
        return (
            f'<body name="{self.name}" pos="{_numbers(np.subtract(self.at, origin))}">{joints}'
            f'<inertial pos="{_numbers(self.com)}" mass="{self.mass!r}" diaginertia="{_numbers(self.inertia)}"/>'
            + "".join(part.text(self.at) for part in self.parts)
            + "</body>"
        )


@dataclass
class Robot:
    """A tree, and points of the world in which two of its bodies are connected."""

    name: str
    parts: list[Part]
    connections: list[tuple[Part, str, Point]]  #: body, the other's name, and the point
    gravity: float = 9.81

    def text(self) -> str:
        """As MJCF; MuJoCo's constraints as stiff as it allows."""
        equalities = "".join(
            f'<connect name="loop{k}" body1="{part.name}" body2="{other}" '
            f'anchor="{_numbers(np.subtract(point, part.at))}" solref="0.002 1" solimp="0.9999 0.9999 0.001"/>'
            for k, (part, other, point) in enumerate(self.connections)
        )
        return (
            '<mujoco><compiler autolimits="true"/>'
            f'<option gravity="0 0 {-self.gravity}" timestep="0.001"><flag contact="disable"/></option>'
            f'<worldbody><body name="base">{"".join(part.text() for part in self.parts)}</body></worldbody>'
            f"<equality>{equalities}</equality></mujoco>"
        )


def _numbers(values: Point) -> str:
    return " ".join(repr(float(x)) for x in values)


def rod(name: str, a: Point, b: Point, mass: float, joints: Sequence[tuple[str, str]]) -> Part:
    """A slender rod from a, where its joints are, to b; its transverse inertia about all axes."""
    across = np.subtract(b, a)
    square = mass * float(across @ across) / 12
    return Part(name, a, joints, mass, across / 2, (square, square, square))


UNIVERSAL = (("hinge", "1 0 0"), ("hinge", "0 1 0"))


def ankles(legs: int) -> Robot:
    """Shins on hips, each foot on a cross and moved by two cranks and rods, as in humanoids."""
    parts, loops = [], []
    for leg in range(legs):
        y = 0.1 - 0.2 * leg
        foot = Part(
            f"foot{leg}", (0.0, y, 0.0), (UNIVERSAL[1], UNIVERSAL[0]), 0.8, (0.03, 0, -0.04), (1e-3, 3e-3, 3e-3)
        )
        shin = Part(f"shin{leg}", (0.0, y, 0.4), (UNIVERSAL[1],), 2.5, (0, 0, -0.18), (0.03, 0.03, 3e-3), [foot])
        hip = Part(
            f"thigh{leg}", (0.0, y, 0.8), (*UNIVERSAL, ("hinge", "0 0 1")), 6.0, (0, 0, -0.2), (0.1, 0.1, 0.02), [shin]
        )
        for side, height in ((1, 0.25), (-1, 0.15)):
            across = y + 0.035 * side
            pivot, pin, heel = (0.0, across, height), (-0.05, across, height), (-0.05, across, 0.01)
            bar = rod(f"rod{leg}{side + 1}", pin, heel, 0.1, UNIVERSAL)
            crank = Part(
                f"crank{leg}{side + 1}", pivot, (UNIVERSAL[1],), 0.15, (-0.025, 0, 0), (4e-5, 4e-5, 4e-5), [bar]
            )
            shin.parts.append(crank)
            loops.append((bar, foot.name, heel))
        parts.append(hip)
    return Robot(f"ankles{legs}", parts, loops)


def hand(fingers: int) -> Robot:
    """Parallel fingers around a palm: in each a crank, a follower and the tip between them."""
    parts, loops = [], []
    for k in range(fingers):
        axis = _numbers((0.0, 1.0, 0.0))
        y = 0.05 * k
        crank = rod(f"crank{k}", (0.0, y, 0.0), (0.01, y, 0.06), 0.05, (("hinge", axis),))
        tip = Part(f"tip{k}", (0.01, y, 0.06), (("hinge", axis),), 0.04, (0.015, 0, 0.02), (2e-5, 2e-5, 1e-5))
        crank.parts.append(tip)
        other = rod(f"follower{k}", (0.03, y, 0.0), (0.04, y, 0.06), 0.05, (("hinge", axis),))
        parts += [crank, other]
        loops.append((other, tip.name, (0.04, y, 0.06)))
    return Robot(f"hand{fingers}", parts, loops)


def delta() -> Robot:
    """Clavel's delta robot with all six rods."""
    slides = [("slide", axis) for axis in ("1 0 0", "0 1 0", "0 0 1")]
    hinges = [("hinge", axis) for axis in ("1 0 0", "0 1 0", "0 0 1")]
    platform = Part("platform", (0.0, 0.0, -0.7), [*slides, *hinges], 0.6, inertia=(8e-4, 8e-4, 1.5e-3))
    parts, loops = [platform], []
    for k in range(3):
        angle = 2 * pi * k / 3
        out, along = np.array([cos(angle), sin(angle), 0.0]), np.array([-sin(angle), cos(angle), 0.0])
        elbow = 0.2 * out + 0.3 * (0.9 * out - sin(0.45) * np.array([0, 0, 1.0]))
        arm = rod(f"arm{k}", 0.2 * out, elbow, 0.5, (("hinge", _numbers(along)),))
        for side in (-1, 1):
            start = elbow + 0.04 * side * along
            end = np.array(platform.at) + 0.05 * out + 0.04 * side * along
            bar = rod(f"rod{k}{side + 1}", start, end, 0.1, UNIVERSAL)
            arm.parts.append(bar)
            loops.append((bar, platform.name, end))
        parts.append(arm)
    return Robot("delta", parts, loops)


def stewart() -> Robot:
    """Gough's and Stewart's platform on six sliding legs."""
    slides = [("slide", axis) for axis in ("1 0 0", "0 1 0", "0 0 1")]
    hinges = [("hinge", axis) for axis in ("1 0 0", "0 1 0", "0 0 1")]
    platform = Part("platform", (0.0, 0.0, 2.0), [*slides, *hinges], 1200.0, inertia=(300.0, 300.0, 600.0))
    parts, loops = [platform], []
    for k, (low, high) in enumerate(
        zip((-2.5, 2.5, 117.5, 122.5, -122.5, -117.5), (-50, 50, 70, 170, -170, -70), strict=True)
    ):
        foot = np.array([3 * cos(low * pi / 180), 3 * sin(low * pi / 180), 0.0])
        top = np.array([cos(high * pi / 180), sin(high * pi / 180), 2.0])
        axis = _numbers((top - foot) / np.linalg.norm(top - foot))
        upper = Part(f"upper{k}", (foot + top) / 2, (("slide", axis),), 140.0, (top - foot) / 4, (67.0, 67.0, 67.0))
        lower = Part(f"lower{k}", foot, UNIVERSAL, 90.0, (top - foot) / 4, (43.0, 43.0, 43.0), [upper])
        parts.append(lower)
        loops.append((upper, platform.name, top))
    return Robot("stewart", parts, loops)


ROBOTS = {
    "ankle with two rods": lambda: ankles(1),
    "two legs with such ankles": lambda: ankles(2),
    "hand of three parallel fingers": lambda: hand(3),
    "delta robot": delta,
    "Stewart platform": stewart,
}
