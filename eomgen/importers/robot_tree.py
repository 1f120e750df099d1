"""Importers, the tree: a Robot -> its links in order from the root, each in the body it is part of; faults of the tree.

Links welded to each other make one body, in the frame of the link nearest to the root.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from ..base.algebra import about
from ..base.limits.numbers import SINGULAR
from ..base.value_rules import EXCESS, fault_of_inertia, inertia_scales, longest_within
from ..describe.names import nearest
from ..errors import ModelError
from .robot import IDENTITY, Inertia, Loop, Placement, Robot, RobotJoint, RobotLink, RobotOptions, moved, sum_inertias

GROUND = ""  #: the body that stands still


@dataclass
class RobotBody:
    """Links that move as one: frames of the links in the body, and the joint that carries it."""

    name: str
    joint: RobotJoint | None
    members: list[tuple[RobotLink, Placement]] = field(default_factory=list)

    def inertia(self) -> Inertia:
        """Of all links together, in body axes."""
        return sum_inertias([link.inertia.seen(frame) for link, frame in self.members])


class Load(NamedTuple):
    """What a joint moves: its mass (kg), and how far from the joint its farthest centre of mass lies (m)."""

    mass: float
    reach: float

    def size(self, joint_type: str) -> float:
        """Mass along a slide (kg), mass times reach about an axis (kg m); 1 where there is none."""
        return (self.mass if joint_type == "prismatic" else self.mass * self.reach) or 1.0


@dataclass
class Bodies:
    """The bodies of a robot in order from the root (ground first), and where each link is."""

    bodies: dict[str, RobotBody]
    home: dict[str, tuple[str, Placement]]  #: link -> body and frame in it
    massless: bool = False  #: nothing that moves has a mass: a robot for kinematics

    @property
    def moving(self) -> list[tuple[RobotBody, RobotJoint]]:
        """Bodies with the joints that carry them."""
        return [(body, body.joint) for body in self.bodies.values() if body.joint is not None]

    def parent(self, joint: RobotJoint) -> str:
        """The body that carries a joint."""
        return self.home[joint.parent][0] if joint.parent else GROUND

    def loads(self) -> dict[str, Load]:
        """What the joint of each body moves, all that it carries included."""
        result: dict[str, Load] = {}
        for body in reversed(self.bodies.values()):  # children come after their parents
            inertia, before = body.inertia(), result.get(body.name, Load(0.0, 0.0))
            own = float(np.linalg.norm(inertia.com)) if inertia.mass else 0.0
            mine = result[body.name] = Load(before.mass + inertia.mass, max(before.reach, own))
            if body.joint is None or not body.joint.parent:
                continue
            home, frame = self.home[body.joint.parent]
            place = frame @ body.joint.outer
            other = result.get(home, Load(0.0, 0.0))
            reach = mine.reach + float(np.linalg.norm(place.position))
            result[home] = Load(other.mass + mine.mass, max(other.reach, reach))
        return result

    def tied(self, robot: Robot) -> set[str]:
        """Joints that a loop or an equality of coordinates ties to others."""
        tied = {joint for tie in robot.ties for joint, _ in (*tie.left.parts, *tie.right.parts)}
        return tied.union(*(self.around(loop) for loop in robot.loops))

    def around(self, loop: Loop) -> set[str]:
        """Joints that move the two links of a loop against each other."""
        ends = []
        for link, _ in (loop.first, loop.second):
            chain: set[str] = set()
            joint = self.bodies[self.home[link][0]].joint
            while joint is not None:
                if joint.type != "weld":
                    chain.add(joint.name)
                joint = self.bodies[self.parent(joint)].joint
            ends.append(chain)
        return ends[0] ^ ends[1]  # those towards ground of both turn them alike


def build_bodies(robot: Robot, options: RobotOptions) -> Bodies:
    """Sort the links into bodies.

    Raises
    ------
    ModelError
        The robot has faults: all of them, those of its elements included.
    """
    _lock(robot, options)
    _check_ends(robot)
    root = _root(robot)
    _check_ties(robot)
    if robot.problems:
        if options.check == "error":
            _check_inertias(robot, options.check_inertia is None)
        raise ModelError(sorted(robot.problems, key=lambda p: p.line))
    link = robot.links[root]
    found = Bodies({GROUND: RobotBody(GROUND, None)}, {})
    base = GROUND
    if options.floating:
        base = root
        found.bodies[root] = RobotBody(root, RobotJoint("base", "free", GROUND, root, link.place))
    found.bodies[base].members.append((link, IDENTITY))
    found.home[root] = base, IDENTITY
    for joint in _from_root(robot, root):
        link = robot.links[joint.child]
        if joint.type == "weld" and options.merge:
            body, frame = found.home[joint.parent]
            frame = frame @ joint.outer @ joint.inner.inverse()
        else:
            body, frame = link.name, IDENTITY
            found.bodies[body] = RobotBody(body, joint)
        found.bodies[body].members.append((link, frame))
        found.home[link.name] = body, frame
    if len(found.bodies) == 1:
        remedy = "give the robot joints; the base of a URDF robot moves with floating=True, or --floating"
        robot.problem("robot", "no link can move", remedy, (robot.file, 1), "EG-TOPOLOGY")
    _check_masses(robot, found, options.check)
    if robot.problems:
        raise ModelError(sorted(robot.problems, key=lambda p: p.line))
    return found


def _from_root(robot: Robot, root: str) -> list[RobotJoint]:
    """The joints that can be reached from a link, parents first, each branch to its end."""
    carried: dict[str, list[RobotJoint]] = {}
    for joint in robot.joints.values():
        carried.setdefault(joint.parent, []).append(joint)
    found, waiting = [], list(reversed(carried.get(root, ())))
    while waiting:
        joint = waiting.pop()
        found.append(joint)
        waiting.extend(reversed(carried.get(joint.child, ())))
    return found


def _unit(axis: Sequence[float]) -> np.ndarray:
    direction = np.array(axis) / max(map(abs, axis))  # first, as squares of small numbers vanish
    return np.asarray(direction / np.linalg.norm(direction))


def _lock(robot: Robot, options: RobotOptions) -> None:
    """Turn locked joints into welds at their values; note joints that options name and the robot has not."""
    actuated = options.actuate if isinstance(options.actuate, tuple) else ()
    for path, name in [*(("lock", name) for name in options.lock), *(("actuate", name) for name in actuated)]:
        if name not in robot.joints:
            remedy = nearest(name, robot.joints, "joints")
            robot.problem(f"{path}.{name}", "no such joint", remedy, (robot.file, 1), "EG-NAME-UNKNOWN")
    for name, value in options.lock.items():
        joint, path = robot.joints.get(name), f"lock.{name}"
        if joint is None:
            continue
        if joint.type not in ("revolute", "prismatic", "weld"):
            remedy = "only joints of one degree of freedom can be locked"
            robot.problem(path, f"is a {joint.type} joint", remedy, joint.place, "EG-REFERENCE")
        elif joint.type != "weld":
            axis = _unit(joint.axis)
            turn = Placement(about(axis.tolist(), value), np.zeros(3))
            motion = moved(value * axis) if joint.type == "prismatic" else turn
            robot.joints[name] = replace(joint, type="weld", outer=joint.outer @ motion)  # what it mimics is held too


# -- faults ------------------------------------------------------------------------------------------------------------
def _check_ends(robot: Robot) -> None:
    """Note joints whose links do not exist, and links that two joints carry."""
    carrier: dict[str, RobotJoint] = {}
    if "world" not in robot.links and (held := [j for j in robot.joints.values() if j.parent == "world"]):
        robot.links["world"] = RobotLink("world", held[0].place)
        robot.notes.append("the link 'world' is not in the file; it stands for the ground")

    def check(path: str, link: str, place: tuple[str, int]) -> None:
        if link not in robot.links:
            robot.problem(path, f"no link {link!r}", nearest(link, robot.links, "links"), place, "EG-NAME-UNKNOWN")

    for loop in robot.loops:
        for link, _ in (loop.first, loop.second):
            check(f"loop.{loop.name}", link, loop.place)
    for joint in robot.joints.values():
        for end, link in (("parent", joint.parent), ("child", joint.child)):
            if link:
                check(f"joint.{joint.name}.{end}", link, joint.place)
        if joint.child and joint.child in carrier:
            message = f"the link {joint.child!r} is also the child of the joint {carrier[joint.child].name!r}"
            remedy = (
                "the joints of a URDF file form a tree; write one that closes a loop as <loop_joint name= type=> with "
                "<axis xyz=/>, <link1 link= xyz= rpy=/> and <link2 link= xyz= rpy=/>"
            )
            robot.problem(f"joint.{joint.name}.child", message, remedy, joint.place, "EG-TOPOLOGY")
        carrier.setdefault(joint.child, joint)


def _root(robot: Robot) -> str:
    """The link that no joint carries; other than one are a fault."""
    children, tree = {joint.child for joint in robot.joints.values()}, "connect the links as a tree"
    roots = [link for link in robot.links.values() if link.name not in children]
    if robot.links and not roots and all(joint.parent in robot.links for joint in robot.joints.values()):
        message = "the joints form a ring: no link is the root"
        robot.problem("robot", message, tree, (robot.file, 1), "EG-TOPOLOGY")
    for link in roots[1:]:
        message = f"has no parent, and neither has {roots[0].name!r}; a robot must have one root"
        robot.problem(f"link.{link.name}", message, "connect it by a joint, or remove it", link.place, "EG-TOPOLOGY")
    if len(roots) == 1 and not robot.problems:
        reached = {roots[0].name, *(joint.child for joint in _from_root(robot, roots[0].name))}
        for link in robot.links.values():
            if link.name not in reached:
                message = f"the joints do not connect it to the root {roots[0].name!r}: they form a ring"
                robot.problem(f"link.{link.name}", message, tree, link.place, "EG-TOPOLOGY")
    return roots[0].name if roots else ""


def _check_ties(robot: Robot) -> None:
    for tie in robot.ties:
        for other, _ in tie.right.parts if tie.path else ():
            if other not in robot.joints:
                remedy = nearest(other, robot.joints, "joints")
                robot.problem(tie.path, f"no joint {other!r}", remedy, tie.place, "EG-NAME-UNKNOWN")
            elif (other, 1.0) in tie.left.parts:
                robot.problem(tie.path, "the joint mimics itself", "name another joint", tie.place, "EG-CIRCLE")


def _check_inertias(robot: Robot, lenient: bool) -> None:
    """Note inertias that no link can have, of a robot with other faults, whose bodies are not known.

    Links welded to others are left out: the body they make may be sound; so are excess moments, if ``lenient``.
    """
    faulty = {problem.line for problem in robot.problems}
    sound = [joint for joint in robot.joints.values() if joint.place[1] not in faulty]
    welded = {end for joint in sound if joint.type == "weld" for end in (joint.parent, joint.child)}
    moved_links = {joint.child for joint in robot.joints.values()}
    points = {x.name: [x.inertia.com] if x.inertia.mass else [] for x in robot.links.values()}
    for joint in robot.joints.values():
        points.setdefault(joint.parent, []).append(joint.outer.position)
        points.setdefault(joint.child, []).append(joint.inner.position)
    inertias = [link.inertia for link in robot.links.values()]
    longest = longest_within(own for name, own in points.items() if name in robot.links)
    scales = inertia_scales([i.mass for i in inertias], [i.tensor for i in inertias], longest)
    for link, scale in zip(robot.links.values(), scales, strict=True):
        fault = fault_of_inertia(link.inertia.tensor, scale=scale)
        if fault and lenient and fault[1] == EXCESS:
            continue
        if fault and link.name in moved_links - welded and link.place[1] not in faulty:
            robot.problem(f"link.{link.name}.inertial.inertia", *fault, link.place, "EG-INERTIA")


def _has_no_lever(joint: RobotJoint, inertia: Inertia) -> bool:
    """Whether the last body of a chain has mass or inertia, but none along the coordinate of its joint."""
    if joint.type not in ("revolute", "prismatic") or joint.armature or inertia.is_nothing:
        return False
    if joint.type == "prismatic":
        return inertia.mass == 0.0
    own, axis = inertia.seen(joint.inner.inverse()), _unit(joint.axis)
    across, arm = float(axis @ own.tensor @ axis), np.cross(axis, own.com)
    return across + own.mass * float(arm @ arm) <= SINGULAR * float(own.tensor.trace() + own.mass * (own.com @ own.com))


def _check_masses(robot: Robot, found: Bodies, check: str) -> None:
    """Note joints that move nothing, which no force could accelerate by a finite amount; with ``check`` as a fault.

    A robot without any mass is no slip of the pen: it is one for kinematics, and a note says so.
    """
    heavy: set[str] = set()
    idle: list[RobotJoint] = []
    tied = found.tied(robot)
    carrying = {found.parent(joint) for _, joint in found.moving if joint.parent}
    for body, joint in reversed(found.moving):  # children come after their parents
        inertia = body.inertia()
        if not inertia.is_nothing:
            heavy.add(body.name)
        if body.name in heavy:
            heavy.add(found.parent(joint))
        elif joint.type != "weld" and not joint.armature:
            idle.append(joint)
        if body.name not in carrying and joint.name not in tied and _has_no_lever(joint, inertia):
            idle.append(joint)
    found.massless = bool(found.moving) and all(
        body.inertia().is_nothing and not joint.armature for body, joint in found.moving
    )
    if found.massless and check == "error":
        robot.notes.append("for kinematics only: no moving link has mass or inertia")
    elif check == "note" and idle:
        names = ", ".join(joint.name for joint in reversed(idle))
        robot.notes.append(f"for kinematics only, because these joints move no mass and no inertia: {names}")
    for joint in idle if check == "error" and not found.massless else ():
        message = f"the joint moves no mass: link {joint.child!r} and all links on it have none"
        if found.home[joint.child][0] in heavy:
            message = f"the joint moves no inertia: link {joint.child!r} has none about its axis (or no mass to slide)"
        remedy = (
            f"give that link an <inertial>, make the joint fixed, or lock it: lock={{{joint.name!r}: 0}}; for "
            "kinematics alone, check_inertia='note' (--check-inertia note)"
        )
        robot.problem(f"joint.{joint.name}", message, remedy, joint.place, "EG-NO-INERTIA")
