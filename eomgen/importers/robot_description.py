"""Importers, robots: links and joints sorted into bodies, checked as a whole -> the Description of a model file."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..base.limits.numbers import SINGULAR
from ..base.value_rules import EXCESS, fault_of_inertia, inertia_scales, longest_within
from ..elements.frames import TURNS, axis_word
from ..elements.joints import JOINTS
from ..elements.rotations import euler_angles_from_matrix, euler_parameters_from_matrix
from ..errors import ModelError, Problem
from ..model.description import GROUND_NAME, Description, Values
from ..model.names import LONGEST, RATES, clean_name, fault_of_model_name, listing, nearest, unique
from .limits import FREEDOMS, LARGEST, LAWS, TIES
from .robot import (
    IDENTITY,
    Drive,
    Inertia,
    Loop,
    Placement,
    Range,
    Robot,
    RobotJoint,
    RobotLink,
    RobotOptions,
    Sum,
    Tie,
    moved,
    numbers,
    sum_inertias,
    turned,
)

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

    def loads(self) -> dict[str, tuple[float, float]]:
        """The mass (kg) on the joint of each body, and how far from it its farthest centre of mass lies (m)."""
        result = dict.fromkeys(self.bodies, (0.0, 0.0))
        for body in reversed(self.bodies.values()):  # children come after their parents
            inertia, (mass, reach) = body.inertia(), result[body.name]
            mass, arm = mass + inertia.mass, float(np.linalg.norm(inertia.com)) if inertia.mass else 0.0
            reach = max(reach, arm)
            result[body.name] = mass, reach
            if body.joint is not None and body.joint.parent:
                home, frame = self.home[body.joint.parent]
                distance = float(np.linalg.norm((frame @ body.joint.outer).position))
                result[home] = result[home][0] + mass, max(result[home][1], reach + distance)
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
    """Sort the links into bodies; raises ModelError with all faults of the robot, those of its elements included."""
    _lock(robot, options)
    _check_ends(robot)
    root = _root(robot)
    _check_ties(robot)
    if robot.problems:
        if options.check == "error":
            _check_inertias(robot, options.check_inertia is None)
        raise ModelError(sorted(robot.problems, key=lambda p: p.line))
    link = robot.links[root]
    result = Bodies({GROUND: RobotBody(GROUND, None)}, {})
    base = GROUND
    if options.floating:
        base = root
        result.bodies[root] = RobotBody(root, RobotJoint("base", "free", GROUND, root, link.place))
    result.bodies[base].members.append((link, IDENTITY))
    result.home[root] = base, IDENTITY
    for joint in _from_root(robot, root):
        link = robot.links[joint.child]
        if joint.type == "weld" and options.merge:
            body, frame = result.home[joint.parent]
            frame = frame @ joint.outer @ joint.inner.inverse()
        else:
            body, frame = link.name, IDENTITY
            result.bodies[body] = RobotBody(body, joint)
        result.bodies[body].members.append((link, frame))
        result.home[link.name] = body, frame
    if len(result.bodies) == 1:
        remedy = "give the robot joints; the base of a URDF robot moves with floating=True, or --floating"
        robot.problem("robot", "no link can move", remedy, (robot.file, 1), "EG-TOPOLOGY")
    _check_masses(robot, result, options.check)
    if robot.problems:
        raise ModelError(sorted(robot.problems, key=lambda p: p.line))
    return result


def _from_root(robot: Robot, root: str) -> list[RobotJoint]:
    """The joints that can be reached from a link, parents first, each branch to its end."""
    children: dict[str, list[RobotJoint]] = {}
    for joint in robot.joints.values():
        children.setdefault(joint.parent, []).append(joint)
    result, waiting = [], list(reversed(children.get(root, ())))
    while waiting:
        joint = waiting.pop()
        result.append(joint)
        waiting.extend(reversed(children.get(joint.child, ())))
    return result


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
            motion = moved(value * axis) if joint.type == "prismatic" else turned(axis, value)
            robot.joints[name] = replace(joint, type="weld", outer=joint.outer @ motion)  # what it mimics is held too


# -- faults ------------------------------------------------------------------------------------------------------------
def _check_ends(robot: Robot) -> None:
    """Note joints whose links do not exist, and links that two joints carry."""
    carrier: dict[str, RobotJoint] = {}
    if "world" not in robot.links and (fixed := [j for j in robot.joints.values() if j.parent == "world"]):
        robot.links["world"] = RobotLink("world", fixed[0].place)
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
    longest = longest_within(place for name, place in points.items() if name in robot.links)
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
    J, axis = inertia.seen(joint.inner.inverse()), _unit(joint.axis)
    moment, arm = float(axis @ J.tensor @ axis), np.cross(axis, J.com)
    return moment + J.mass * float(arm @ arm) <= SINGULAR * float(J.tensor.trace() + J.mass * (J.com @ J.com))


def _check_masses(robot: Robot, result: Bodies, check: str) -> None:
    """Note joints that move nothing, which no force could accelerate by a finite amount; with ``check`` as a fault.

    A robot without any mass is no slip of the pen: it is one for kinematics, and a note says so.
    """
    heavy: set[str] = set()
    fixed_by_none: list[RobotJoint] = []
    tied = result.tied(robot)
    carrying = {result.parent(joint) for _, joint in result.moving if joint.parent}
    for body, joint in reversed(result.moving):  # children come after their parents
        inertia = body.inertia()
        if not inertia.is_nothing:
            heavy.add(body.name)
        if body.name in heavy:
            heavy.add(result.parent(joint))
        elif joint.type != "weld" and not joint.armature:
            fixed_by_none.append(joint)
        if body.name not in carrying and joint.name not in tied and _has_no_lever(joint, inertia):
            fixed_by_none.append(joint)
    result.massless = bool(result.moving) and all(
        body.inertia().is_nothing and not joint.armature for body, joint in result.moving
    )
    if result.massless and check == "error":
        robot.notes.append("for kinematics only: no moving link has mass or inertia")
    elif check == "note" and fixed_by_none:
        names = ", ".join(joint.name for joint in reversed(fixed_by_none))
        robot.notes.append(f"for kinematics only, because these joints move no mass and no inertia: {names}")
    for joint in fixed_by_none if check == "error" and not result.massless else ():
        message = f"the joint moves no mass: link {joint.child!r} and all links on it have none"
        if result.home[joint.child][0] in heavy:
            message = f"the joint moves no inertia: link {joint.child!r} has none about its axis (or no mass to slide)"
        remedy = (
            f"give that link an <inertial>, make the joint fixed, or lock it: lock={{{joint.name!r}: 0}}; for "
            "kinematics alone, check_inertia='note' (--check-inertia note)"
        )
        robot.problem(f"joint.{joint.name}", message, remedy, joint.place, "EG-NO-INERTIA")


LISTED = 8  #: joints that a note names
#: Stops of joints: part of the range that one gives way under the drive's effort; what is left of the speed after it.
GIVE, REBOUND = 0.01, 0.3
GRAVITY = 9.81  #: m/s^2, of the weight that stands for an effort that is not told
_PARAMETERS = ("_e0", "_e1", "_e2", "_e3")
_INERTIA = (("xx", 0, 0), ("yy", 1, 1), ("zz", 2, 2), ("xy", 0, 1), ("xz", 0, 2), ("yz", 1, 2))


class _Names:
    """Names a model may use, of whatever a robot file calls its links and joints, and what became of each.

    Characters other than letters, digits and underscores become underscores; a name that does not start with a letter
    gets the prefix of its kind; words of Python, C and of expressions get an underscore after them; what is then not
    unique gets a number.  Bodies and joints have a list each; coordinates, parameters and inputs share one.
    """

    def __init__(self) -> None:
        self.taken = {"ground link"}  # names of bodies and of joints with their kind behind, and symbols
        self.renamed: dict[str, dict[str, str]] = {}  # section of the model -> old name -> new

    def link(self, name: str) -> str:
        """The name of a body or marker."""
        return self._note("bodies", name, self.made(name))

    def joint(self, name: str, suffixes: Sequence[str], made: bool = False) -> str:
        """The name of a joint whose coordinates are that name with these suffixes; ``made`` for one not in the file."""
        symbols = (suffix + rate for suffix in suffixes for rate in RATES)
        result = unique(name, "joint", self.taken, (" joint", *symbols))
        return result if made else self._note("joints", name, result)

    def symbol(self, name: str) -> str:
        """The name of a parameter or an input."""
        return self._note("inputs", name, unique(name, "symbol", self.taken))

    def made(self, name: str) -> str:
        """The name of an element that the file does not name, of which no note tells."""
        return unique(name, "link", self.taken, (" link",))

    def _note(self, section: str, name: str, result: str) -> str:
        if result != name:
            self.renamed.setdefault(section, {})[name] = result
        return result


class RobotWriter:
    """Fills the Description of a robot; raises ModelError if it has faults."""

    def __init__(self, robot: Robot, options: RobotOptions) -> None:
        result = build_bodies(robot, options)
        self.robot, self.options, self.tree = robot, options, result
        gravity = robot.gravity if options.gravity is None else options.gravity
        name = clean_name(robot.name, "robot")[:LONGEST]
        name = f"{name[: LONGEST - 6]}_model" if fault_of_model_name(name) else name
        self.out = Description(values={"name": name, "gravity": gravity}, lines={"": (robot.file, 1)})
        self.out.notes = list(robot.notes)
        check = "note" if result.massless and options.check == "error" else options.check
        if check != "error":
            self.out.values["check_inertia"] = check
        if options.limits != "note":
            self.out.values["limits"] = "off"
        self.names = _Names()
        self.joints: dict[str, str] = {}  # the robot's name -> ours
        self.bodies: dict[str, str] = {}  # body -> ours
        self.markers: dict[str, str] = {}  # link -> how to refer to its frame
        self.tied = result.tied(robot)
        self.loads = result.loads()

    def describe(self) -> Description:
        moving = self.tree.moving
        self._bound(sum(len(self._suffixes(joint.type)) for _, joint in moving))
        for _, joint in moving:
            suffixes = [*self._suffixes(joint.type), *self._rates(joint.type)]
            self.joints[joint.name] = self.names.joint(joint.name, suffixes)
        for body in self.tree.bodies.values():
            self._body(body)
        for body, joint in moving:
            self._joint(body, joint)
        self._loops()
        self._ties()
        self._drives()
        self._note_data()
        self.out.note_renamed(self.names.renamed)
        return self.out

    def _bound(self, freedoms: int) -> None:
        """Refuse robots that no derivation comes to an end of."""
        robot, remedy = self.robot, "lock joints (lock=[...]), or leave parts out"
        for count, most, what in (
            (freedoms, FREEDOMS, "coordinates of joints"),
            (len(robot.loops), TIES, "joints that close loops"),
            (len(robot.ties), TIES, "couplings"),
            (len(robot.drives), TIES, "drives"),
        ):
            if count > most:
                message, place = f"has {count:,} {what}", (robot.file, 1)
                robot.problem("robot", message, f"at most {most:,}; {remedy}", place, "EG-TOO-LARGE")
        if robot.problems:
            raise ModelError(robot.problems)

    def _add(self, section: str, name: str, values: Values, place: tuple[str, int]) -> None:
        entry = self.out.add(section, name, values)
        self.out.lines[entry.path] = place

    # -- bodies ---------------------------------------------------------------------------------------------------
    def _body(self, body: RobotBody) -> None:
        name = GROUND_NAME if body.name == GROUND else self.names.link(body.name)
        self.bodies[body.name] = name
        values: Values = {} if body.name == GROUND else self._inertia(name, body.inertia())
        markers: dict[str, Any] = {}
        display: list[Values] = []
        for link, frame in body.members:
            if link.name == body.name:
                self.markers[link.name] = name
            else:
                marker = self.names.link(link.name)
                markers[marker] = {"at": [0, 0, 0], **frame.placed()}
                self.markers[link.name] = f"{name}.{marker}"
            display += [{**shape, **(frame @ at).placed()} for at, shape in link.shapes]
        values |= {key: x for key, x in (("markers", markers), ("display", display)) if x}
        if values:
            place = body.members[0][0].place if body.members else (self.robot.file, 1)
            self._add("bodies", name, values, place)

    def _inertia(self, name: str, inertia: Inertia) -> Values:
        """mass, com and inertia: numbers, or parameters where they are not zero."""
        values: Values = {}
        if self.options.check_inertia is None and (fault_of_inertia(inertia.tensor) or ("", ""))[1] == EXCESS:
            values["check_inertia"] = "note"
        values |= {"mass": self._value(f"m_{name}", inertia.mass, "kg")}
        if inertia.com.any():
            com = zip("xyz", numbers(inertia.com), strict=True)
            values["com"] = [self._value(f"c_{name}_{axis}", x, "m") for axis, x in com]
        if inertia.tensor.any():
            entries = {key: float(inertia.tensor[i, j]) for key, i, j in _INERTIA if inertia.tensor[i, j] != 0.0}
            values["inertia"] = {k: self._value(f"I_{name}_{k}", x, "kg*m**2") for k, x in entries.items()}
        return values

    def _value(self, name: str, value: float, unit: str) -> Any:
        if not self.options.symbolic or value == 0.0:
            return float(value)
        raw = self.names.symbol(name)
        self.out.add("parameters", raw, {"value": float(value), "unit": unit})
        return raw

    # -- joints ---------------------------------------------------------------------------------------------------
    def _turning(self, joint_type: str) -> Values:
        """The key ``rotation`` of a joint that turns in Euler parameters."""
        turns = self.options.rotation == "euler_parameters" and joint_type in ("free", "spherical")
        return {"rotation": "euler_parameters"} if turns else {}

    def _rates(self, joint_type: str) -> tuple[str, ...]:
        """Suffixes of the velocities of such a joint."""
        return ("_wx", "_wy", "_wz") if self._turning(joint_type) else ()

    def _suffixes(self, joint_type: str) -> list[str]:
        """Of the coordinates of a joint of the tree, as the options have them turn."""
        return [c.suffix for c in JOINTS[joint_type].kind(**self._turning(joint_type)).coordinates]

    def _joint(self, body: RobotBody, joint: RobotJoint) -> None:
        name = self.joints[joint.name]
        home, frame = self.tree.home[joint.parent] if joint.parent else (GROUND, IDENTITY)
        parent, child = self.bodies[home], self.bodies[body.name]
        between = [(frame @ joint.outer).reference(parent), joint.inner.reference(child)]
        names = [name + suffix for suffix in self._suffixes(joint.type)]
        single = len(names) == 1
        values: Values = {"type": joint.type, "between": between}
        if JOINTS[joint.type].kind.has_axis:
            values["axis"] = _axis(joint.axis)
        values |= self._turning(joint.type)
        if self.robot.loops and names:  # named coordinates stay in the tree, so that the loop's own joint is cut
            values |= {"coordinate": names[0]} if single else {"coordinates": names}
        data = {"limits": dict(joint.limits), "dry_friction": joint.dry_friction}
        data |= {"armature": joint.armature} if single else {}
        values |= {key: x for key, x in data.items() if x}
        self._add("joints", name, values, joint.place)
        if joint.armature and not single:
            self._rotor(joint)
        if not single and (joint.damping or joint.stiffness):
            self._resist(joint, between, parent, child)
        rubbing = {"viscous": joint.damping} if joint.damping and single else {}
        if self.options.smoothing and joint.dry_friction:
            rubbing |= {"coulomb": joint.dry_friction, "smoothing": self.options.smoothing}
        if rubbing:
            self._force("friction", joint, "friction" if "coulomb" in rubbing else "damping", rubbing)
        if joint.stiffness and single:
            kind, key = ("torsional_spring", "angle") if joint.type == "revolute" else ("joint_spring", "rest")
            rest = {key: joint.rest} if joint.rest else {}
            self._force(kind, joint, "spring", {"stiffness": joint.stiffness, **rest})
        if self.options.limits == "stop" and single:
            self._stop(body, joint)
        if joint.initial or joint.start:
            start = [joint.initial] if joint.start is None else self._start(joint.start)
            reference = [float(n.endswith("_e0") and bool(self._turning(joint.type))) for n in names]
            # what an equality moves only starts its assembly: the file's pose may not satisfy it
            known = self.out.values.setdefault("guess" if joint.name in self.tied else "initial", {})
            known.update({n: x for n, x, rest in zip(names, start, reference, strict=True) if x != rest})
        chosen = self.options.actuate
        if single and (chosen is True or (chosen and joint.name in chosen)):
            force = self.names.symbol(f"tau_{name}")
            unit = "N" if joint.type == "prismatic" else "N*m"
            self._add("inputs", force, {"value": 0.0, "unit": unit}, joint.place)
            self._force("actuator", joint, "drive", {"value": force})

    def _stop(self, body: RobotBody, joint: RobotJoint) -> None:
        """Stops at the limits of a joint, which give way by a hundredth of its range under the drive's greatest effort.

        Where the file tells no effort, it is the weight that the joint carries, with the lever of what lies farthest.
        """
        limits = joint.limits
        # a finite limit beyond LARGEST gets no stop, as powers of its range overflow
        bounds = {key: x for key, x in limits.items() if key in ("lower", "upper") and abs(x) <= LARGEST}
        span = bounds.get("upper", math.inf) - bounds.get("lower", -math.inf)
        if not bounds:
            return
        if span <= 0.0:
            self.out.notes.append(f"{self.joints[joint.name]} gets no stops, because its limits leave it no range")
            return
        span = span if math.isfinite(span) else 1.0
        effort, speed = limits.get("effort", 0.0), limits.get("velocity", 0.0)
        if not 0.0 < effort < math.inf:
            mass, reach = self.loads[body.name]
            effort = GRAVITY * ((mass if joint.type == "prismatic" else mass * reach) or 1.0)
        law = {
            "stiffness": effort / (GIVE * span) ** 1.5,
            "restitution": REBOUND,
            "velocity": speed if 0.0 < speed < math.inf else span,
            "formula": "flores",
        }
        self._force("stop", joint, "stop", {**bounds, "law": law})

    def _rotor(self, joint: RobotJoint) -> None:
        """The armature of a ball joint: inertia without mass that turns in space as the child does on its parent."""
        name, suffixes, rates = self.joints[joint.name], self._suffixes(joint.type), self._rates(joint.type)
        body = self.names.made(f"{name}_rotor")
        rotor = self.names.joint(f"{name}_rotor", [*suffixes, *rates], made=True)
        turns = {"type": joint.type, "between": [GROUND_NAME, body], **self._turning(joint.type)}
        self._add("bodies", body, {"mass": 0, "inertia": [joint.armature] * 3}, joint.place)
        self._add("joints", rotor, turns, joint.place)
        for suffix in rates or suffixes:  # Euler parameters may take any value: their rates alone are tied
            law = {"type": "coupling", "equation": f"{rotor}{suffix} - {name}{suffix}"}
            self._add("constraints", self.names.made(f"{rotor}{suffix}"), law, joint.place)

    def _resist(self, joint: RobotJoint, between: list[Any], parent: str, child: str) -> None:
        """Damping and stiffness of a ball or a free joint, on its child and on a parent that moves."""
        name, d, k = self.joints[joint.name], joint.damping, joint.stiffness
        rest = joint.start or IDENTITY
        turn = _turn_texts(name, bool(self._turning(joint.type)), rest.rotation)
        for axis, place in zip("xyz" if joint.start else "", numbers(rest.position), strict=False):
            on = f"{name}_{axis}"
            for kind, factor, law in (("damper", d, {"damping": d}), ("spring", k, {"stiffness": k, "rest": place})):
                if factor:
                    values = {"type": f"joint_{kind}", "joint": on, **law}
                    self._add("forces", self.names.made(f"{on}_{kind}"), values, joint.place)
        for body, frame, sign in ((child, between[1], -1.0), (parent, between[0], 1.0)):
            # turned by the rotation about it, the rotation vector is itself: the same in the axes of both
            spring = [f"({sign * k!r})*{x}" for x in turn]
            damper = [f"({sign * d!r})*w{axis}({child}, from={parent}, in={body})" for axis in "xyz"]
            for factor, end, torque in ((k, frame, spring), (d, body, damper)):
                if factor and body != GROUND_NAME:
                    values = {"type": "torque", "body": end, "value": torque, "axes": "body"}
                    self._add("forces", self.names.made(f"{name}_resistance"), values, joint.place)

    def _start(self, pose: Placement) -> list[float]:
        """Coordinates of a free joint."""
        if self.options.rotation == "euler_parameters":
            turn = euler_parameters_from_matrix(pose.rotation)
        else:
            turn = euler_angles_from_matrix("xyz", pose.rotation)
        return [*numbers(pose.position), *numbers(turn)]

    def _force(self, kind: str, joint: RobotJoint, what: str, values: Values) -> None:
        name = self.joints[joint.name]
        self._add("forces", self.names.made(f"{name}_{what}"), {"type": kind, "joint": name, **values}, joint.place)

    # -- what ties joints together --------------------------------------------------------------------------------
    def _loops(self) -> None:
        for loop in self.robot.loops:
            if not self.tree.around(loop):
                self.out.notes.append(f"left out: {loop.name}, because no joint moves its two links against each other")
                continue
            pair = []
            for link, frame in (loop.first, loop.second):
                body, at = self.tree.home[link]
                pair.append((at @ frame).reference(self.bodies[body]))
            kind = JOINTS[loop.type].kind
            name = self.names.joint(loop.name, [c.suffix for c in kind.coordinates])
            axis = {"axis": _axis(loop.axis)} if kind.has_axis else {}
            self._add("joints", name, {"type": loop.type, "between": pair, **axis}, loop.place)

    def _ties(self) -> None:
        for tie in self.robot.ties:
            values = _describe_tie(tie, self.joints, self.options.lock)
            if values is None:
                self.out.notes.append(f"left out: the coupling {tie.name}, all of whose joints are locked")
            else:
                self._add("constraints", self.names.link(tie.name), values, tie.place)

    def _drives(self) -> None:
        laws = [self._law(k, drive) for k, drive in enumerate(self.robot.drives)]
        totals: dict[str, str] = {}  # of the drives along a tendon
        for drive, (_, law) in zip(self.robot.drives, laws, strict=True):
            if drive.total and law:
                totals[drive.tendon] = f"{totals[drive.tendon]} + {law}" if drive.tendon in totals else law
        size = 0  # of all laws
        cut: dict[str, list[str]] = {}  # pushes along joints whose sum is cut
        for drive, (name, law) in zip(self.robot.drives, laws, strict=True):
            if drive.total and law:
                law = _scaled(law, totals[drive.tendon], drive.total)
            if drive.force and law:
                law = _cut(law, drive.force)
            size += len(law) * len(drive.parts)
            if size > LAWS:
                message, remedy = "the laws of the drives are too long", f"at most {LAWS:,} characters in all"
                raise ModelError([Problem(f"actuator.{name}", message, remedy, *drive.place, "EG-TOO-LARGE")])
            for joint, c in drive.parts if law else ():
                q = self.joints.get(joint)
                if q is None or not c:
                    continue
                if drive.name and self.robot.joints[joint].clamp:
                    cut.setdefault(joint, []).append(f"({c!r})*({law})")
                    continue
                force = self.names.made(f"{name}_drive")
                self._add("forces", force, {"type": "actuator", "joint": q, "value": f"({c!r})*({law})"}, drive.place)
        for joint, pushes in cut.items():
            q, raw = self.joints[joint], self.robot.joints[joint]
            assert raw.clamp is not None
            law = _cut(" + ".join(pushes), raw.clamp)
            force = self.names.made(f"{q}_drives")
            self._add("forces", force, {"type": "actuator", "joint": q, "value": law}, raw.place)

    def _law(self, k: int, drive: Drive) -> tuple[str, str]:
        """Name of a drive and its force, empty if there is none."""
        length, fixed = _collect(Sum(drive.parts), self.joints, self.options.lock)
        b0, b1, b2 = drive.bias
        name, terms = f"tendon_{k}", [(b1 * c, q) for q, c in length.items()]
        terms += [(b2 * c, f"{q}_dot") for q, c in length.items()]
        if drive.name:
            name = self.names.symbol(drive.name)
            self._add("inputs", name, {"value": 0.0}, drive.place)
            terms.insert(0, (drive.gain, _cut(name, drive.control) if drive.control else name))
        constant = b0 + b1 * fixed
        return name, " + ".join([f"({x!r})*{what}" for x, what in terms if x] + [repr(constant)] * bool(constant))

    def _note_data(self) -> None:
        """Say of which joints limits and dry friction are data that do not act."""
        moving = [joint for _, joint in self.tree.moving]
        limited = [self.joints[j.name] for j in moving if any(k != "effort" or j.clamp is None for k in j.limits)]
        if limited and self.options.limits == "note":
            remedy = "a run that passes a limit warns; limits='stop' adds elastic stops, limits='off' does not warn"
            self.out.notes.append(f"joint limits are not enforced ({listing(limited, LISTED)}); {remedy}")
        rubbing = [self.joints[j.name] for j in moving if j.dry_friction]
        if rubbing and not self.options.smoothing:
            remedy = "load with friction=0.01 to let it act"
            self.out.notes.append(f"the dry friction of joints does not act ({listing(rubbing, LISTED)}); {remedy}")


def _cut(law: str, bounds: Range) -> str:
    """A force or control cut to a range."""
    low, high = bounds
    law = f"max({law}, {low!r})" if low > -math.inf else law
    return f"min({law}, {high!r})" if high < math.inf else law


def _scaled(law: str, total: str, bounds: Range) -> str:
    """One of several forces, scaled as all are so that their total stays in a range."""
    low, high = bounds
    if law == total:
        return _cut(law, bounds)
    return f"({law})*where(({total}) > {high!r}, {high!r}/({total}), where(({total}) < {low!r}, {low!r}/({total}), 1))"


def _axis(axis: tuple[float, float, float]) -> Any:
    """A word for an axis along a coordinate axis, else its three numbers."""
    word = axis_word(axis)
    return word if word in TURNS else [float(x) for x in axis]


def _turn_texts(name: str, in_parameters: bool, rest: np.ndarray) -> list[str]:
    """The rotation vector from the pose at rest, in the axes of the child, of at most half a turn.

    MuJoCo resists turns of balls and free joints by -d w - k theta, with this vector theta and the angular velocity w.
    ``name`` begins its coordinates, Euler parameters or angles x-y'-z''; ``rest`` is the rotation (3, 3) at rest.
    """
    if in_parameters:
        raw = [name + suffix for suffix in _PARAMETERS]
        size = f"sqrt({' + '.join(f'{x}**2' for x in raw)})"  # 1, but for what an integrator makes of it
        e = [f"({x}/{size})" for x in raw]
    else:
        a, b, c = (f"{name}_{k}" for k in (1, 2, 3))
        (ca, cb, cc), (sa, sb, sc) = ([f"{f}({q}/2)" for q in (a, b, c)] for f in ("cos", "sin"))
        e = [
            f"({ca}*{cb}*{cc} - {sa}*{sb}*{sc})",
            f"({sa}*{cb}*{cc} + {ca}*{sb}*{sc})",
            f"({ca}*{sb}*{cc} - {sa}*{cb}*{sc})",
            f"({ca}*{cb}*{sc} + {sa}*{sb}*{cc})",
        ]
    r0, r1, r2, r3 = (float(x) for x in euler_parameters_from_matrix(rest))
    # the conjugate of the rest times e
    rows = ((r0, r1, r2, r3), (-r1, r0, r3, -r2), (-r2, -r3, r0, r1), (-r3, r2, -r1, r0))
    p = [_text(dict(zip(e, row, strict=True))) for row in rows]
    square = f"(1 - ({p[0]})**2)"  # sin(phi/2)^2; near 0 the series of phi / sin(phi/2)
    series = f"2 + {square}/3 + 3*{square}**2/20 + 5*{square}**3/56"
    exact = f"2*atan2(sqrt({square}), abs({p[0]}))/sqrt({square})"
    factor = f"where({p[0]} < 0, -1, 1)*where({square} < 1e-3, {series}, {exact})"
    return [f"({x})*{factor}" for x in p[1:]]


def _describe_tie(tie: Tie, coordinates: Mapping[str, str], locked: Mapping[str, float]) -> dict[str, Any] | None:
    """The keys of a coupling, a linear one by its factors; None where no joint is left to tie.

    ``coordinates`` has those of joints that move, ``locked`` the values of the others.
    """
    (left, y), (right, x) = (_collect(s, coordinates, locked) for s in (tie.left, tie.right))
    _, slope, *higher = (*tie.law, 0.0, 0.0)
    if not any(higher) or not right:
        value = 0.0
        for a in reversed(tie.law):
            value = a + x * value
        factors = dict(left)
        for q, c in right.items():
            factors[q] = factors.get(q, 0.0) - slope * c
        factors = {q: c for q, c in factors.items() if c}
        if not factors:
            return None
        offset = value - y
        return {"type": "coupling", "coordinates": factors} | ({"offset": offset} if offset else {})
    inner, text = _text(right, x), ""
    for a in reversed(tie.law):
        text = f"({a!r})" + (f" + ({inner})*({text})" if text else "")
    return {"type": "coupling", "equation": f"{_text(left, y)} - ({text})"}


def _collect(side: Sum, coordinates: Mapping[str, str], locked: Mapping[str, float]) -> tuple[dict[str, float], float]:
    """Coordinate -> factor, and the constant with what locked joints add."""
    factors: dict[str, float] = {}
    constant = side.constant
    for joint, factor in side.parts:
        q = coordinates.get(joint)
        if q is None:
            constant += factor * locked.get(joint, 0.0)
        elif factor:
            factors[q] = factors.get(q, 0.0) + factor
    return factors, constant


def _text(factors: Mapping[str, float], constant: float = 0.0) -> str:
    """The sum of factors times terms, those of factor 0 left out, and a constant."""
    terms = [x if f == 1.0 else f"({f!r})*{x}" for x, f in factors.items() if f]
    return " + ".join(terms + [f"({constant!r})"] * bool(constant or not terms))
