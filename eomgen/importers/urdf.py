"""Importers, URDF: the elements of a file -> a Robot.

The format is that of ROS (wiki.ros.org/urdf/XML): the frame of a link is the frame of the joint that carries it, axes
are given in that frame (default x), angles are fixed-axis roll, pitch, yaw.  Meshes are named, never read.
"""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np

from ..base.value_rules import SWITCH
from ..elements.kinds import limits_nothing
from ..errors import ModelError
from .limits import LARGEST
from .robot import (
    CONVERTED,
    IDENTITY,
    NOTHING,
    Inertia,
    Loop,
    Placement,
    Robot,
    RobotJoint,
    RobotLink,
    RobotOptions,
    Sum,
    Tie,
    placed,
)
from .xml_file import DATA, HARMLESS, LEFT, TAKEN, Constructs, XmlElement

#: Type of a joint in URDF -> eomgen's.
TYPES = {
    "revolute": "revolute",
    "continuous": "revolute",
    "prismatic": "prismatic",
    "fixed": "weld",
    "floating": "free",
    "planar": "planar",
}
#: Those of joints that close loops: also balls, and none that leaves all six directions free.
LOOP_TYPES = {**TYPES, "spherical": "spherical", "ball": "spherical"}
del LOOP_TYPES["floating"]
#: Elements of joints that close loops: Drake's and Isaac Sim's, and those of others.
LOOPS = ("loop_joint", "loop_constraint", "loop")
#: Elements of the two links of such a joint, first and second, in Drake's dialect and others; each may have its frame
#: as its own attributes, or as those of an element named so with ``_origin``.
ENDS = (("link1", "parent", "predecessor"), ("link2", "child", "successor"))
LINKS = 5000  #: links of a robot

#: Elements of xacro that stand for others; what else is left of it (a sensor, an argument) is noted.
UNEXPANDED = {f"xacro:{word}" for word in ("include", "macro", "if", "unless", "insert_block", "element")}
_NUMBER = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?\Z", re.ASCII)
_SPECIAL = {"inf", "-inf", "+inf", "infinity", "-infinity", "nan", "-nan"}

_REASONS = {
    "taken": (TAKEN, "becomes part of the model"),
    "limits": (DATA, "limits; a note names the joints (option `limits`)"),
    "friction": (DATA, "dry friction; it acts with the option `friction`, else a note names the joints"),
    "contact": (LEFT, "shapes that touch, and contact"),
    "drives": (LEFT, "drives and their reductions (`actuate` gives inputs, `armature` the inertia of a rotor)"),
    "control": (LEFT, "limits and reference positions of controllers"),
    "loop": (LEFT, "limits, friction and couplings of joints that close loops"),
    "xacro": (LEFT, "elements of xacro that it did not expand"),
    "dialect": (LEFT, "words of other formats and simulators"),
    "soft": (LEFT, "soft bodies"),
    "looks": (HARMLESS, "appearance; shapes become `display`"),
    "measure": (HARMLESS, "sensors"),
    "label": (HARMLESS, "labels"),
}


def _path_of(parent: str, tag: str) -> str:
    if not parent or tag.startswith("xacro:"):
        return "xacro" if parent else "robot"
    return tag if parent == "robot" else f"{parent}/{tag}"


_ENDS = [f"{loop}/{end}" for loop in LOOPS for end in (*ENDS[0], *ENDS[1])]
URDF = Constructs(
    f"""
    robot: taken name
    robot: label version
    link: taken name
    link: label type
    link: contact concave
    link/inertial: taken
    link/inertial/origin, joint/origin: taken xyz rpy
    link/inertial/mass: taken value
    link/inertial/inertia: taken ixx ixy ixz iyy iyz izz
    joint: taken name type
    joint: label dont_collapse
    joint/parent, joint/child: taken link
    joint/axis: taken xyz
    joint/axis: dialect rpy
    joint/mimic: taken joint multiplier offset
    joint/dynamics: taken damping
    joint/dynamics: friction friction
    joint/dynamics: dialect D K mu_coulomb mu_viscous spring_reference spring_stiffness
    joint/limit: limits lower upper velocity effort
    joint/limit: control command_effort current gear_velocity twist
    {", ".join(LOOPS)}: taken name type
    {", ".join(f"{loop}/axis" for loop in LOOPS)}: taken xyz
    {", ".join(_ENDS)}: taken link xyz rpy
    {", ".join(f"{end}_origin" for end in _ENDS if "link" not in end)}: taken xyz rpy
    {", ".join(f"{loop}/{tag}" for loop in LOOPS for tag in ("limit", "dynamics", "mimic"))}: loop **
    joint/safety_controller, joint/calibration: control **
    link/collision, link/contact, link/surface, link/self_filter, link/collision_checking: contact **
    transmission, ros2_control: drives **
    gazebo, mujoco, drake:collision_filter_group: dialect **
    joint/joint_properties, link/gravity, link/kinematic, link/origin: dialect **
    deformable: soft **
    link/visual, material: looks **
    sensor: measure **
    xacro: xacro **
    """,
    _REASONS,
    _path_of,
    {},
)


def _color(material: XmlElement) -> str:
    """``#rrggbb`` of the color that a material has itself; empty if it has none that can be read."""
    color = material.find("color")
    parts = color.attributes.get("rgba", "").split()[:3] if color is not None else []
    if len(parts) != 3 or not all(map(_NUMBER.match, parts)):
        return ""
    return "#" + "".join(f"{round(255.0 * min(max(float(part), 0.0), 1.0)):02x}" for part in parts)


class UrdfReader:
    """Reads elements of a URDF file into a Robot, whose ``problems`` are its faults."""

    def __init__(self, root: XmlElement, options: RobotOptions) -> None:
        self.root, self.options = root, options
        self.robot = Robot(root.attributes.get("name") or "robot", root.file)
        self.loose: list[str] = []  # joints that mimic others and are not tied to them
        materials = [element for element in root.walk() if element.tag == "material"]  # a name counts everywhere
        self.colors = {m.attributes.get("name", ""): c for m in reversed(materials) if (c := _color(m))}

    def read(self) -> Robot:
        robot, root = self.robot, self.root
        for part in root.children:
            read = part.tag in ("link", "joint", *LOOPS)  # elsewhere, "${" may be of ROS or Gazebo
            for element in part.walk():
                if element.tag in UNEXPANDED or (read and any("${" in x for x in element.attributes.values())):
                    raise ModelError([element.problem("robot", "is a xacro file", CONVERTED[".xacro"], code="EG-FILE")])
        if len(root.children) > 20 * LINKS:
            message, most = "has too many elements", f"at most {20 * LINKS:,}"
            raise ModelError([root.problem("robot", message, most, "EG-TOO-LARGE")])
        for element in root.children:
            if element.tag == "link":
                self._link(element)
            elif element.tag == "joint":
                self._joint(element)
            elif element.tag in LOOPS:
                self._loop(element)
        self._note_the_rest()
        if not robot.links:
            self.fault(root, "robot", "has no links", "a URDF file has <link> elements", "EG-MISSING")
        if len(robot.links) > LINKS:
            message = f"has {len(robot.links)} links"
            raise ModelError([root.problem("robot", message, f"at most {LINKS}", "EG-TOO-LARGE")])
        return robot

    def _note_the_rest(self) -> None:
        """Notes on what a file has that the model has not."""
        notes = self.robot.notes
        notes += URDF.notes(self.root)
        pairs = (("parent", "child"), ("predecessor", "successor"))
        for child in self.root.children:
            for element in child.walk() if child.tag not in ("link", "joint", *LOOPS) else ():
                if element.tag.endswith(("constraint", "equality")) or any(
                    element.find(a) is not None and element.find(b) is not None for a, b in pairs
                ):
                    what = " ".join([f"<{element.tag}>", element.attributes.get("name", "")]).strip()
                    notes.append(
                        f"left out: {what} in line {element.line}, which ties links or joints: the model may move more "
                        "freely than the robot; <loop_joint> and <mimic> are read"
                    )
            for tag in dict.fromkeys(x.tag for x in child.children) if child.tag in ("link", "joint") else ():
                row, count = URDF.find(f"{child.tag}/{tag}"), len(child.all(tag))
                if count > 1 and row is not None and row.fate in (TAKEN, DATA):
                    name = child.attributes.get("name", "")
                    notes.append(f"{child.tag}.{name}: {count} <{tag}>; only the first is used")
        if self.loose:
            note = f"joints that mimic others keep coordinates of their own ({', '.join(self.loose)})"
            notes.append(f"{note}; mimic='coupling' ties them")

    # -- values ---------------------------------------------------------------------------------------------------
    def fault(self, element: XmlElement, path: str, message: str, remedy: str, code: str) -> None:
        self.robot.problems.append(element.problem(path, message, remedy, code))

    def number(
        self, element: XmlElement, key: str, path: str, default: float | None = None, most: float = LARGEST
    ) -> float:
        """A finite number in an attribute, at most so large."""
        text = element.attributes.get(key)
        where = f"{path}.{key}"
        if text is None:
            if default is None:
                self.fault(element, where, "is missing", f'give {key}="..." in <{element.tag}>', "EG-MISSING")
            return default or 0.0
        return self._finite(element, where, text, most)

    def _finite(self, element: XmlElement, path: str, text: str, most: float = LARGEST) -> float:
        value = float(text) if _NUMBER.match(text.strip()) else math.nan
        if most < abs(value) < math.inf:
            remedy = f"at most {most:g}, so that products stay finite"
            self.fault(element, path, f"{value:g} is too large", remedy, "EG-RANGE")
            return 0.0
        if not math.isfinite(value):
            beginning = text if len(text) <= 40 else text[:37] + "..."
            what = "not finite" if text.strip().lower() in _SPECIAL else "not a number"
            self.fault(element, path, f"{beginning!r} is {what}", "give a finite number", "EG-NUMBER")
            return 0.0
        return value

    def triple(
        self, element: XmlElement, key: str, path: str, default: tuple[float, ...]
    ) -> tuple[float, float, float]:
        """Three numbers in an attribute."""
        text = element.attributes.get(key)
        if text is None:
            return default  # type: ignore[return-value]
        parts = text.split()
        if len(parts) != 3:
            self.fault(element, f"{path}.{key}", f"{text[:40]!r} is not three numbers", 'write "x y z"', "EG-NUMBER")
            return default  # type: ignore[return-value]
        x, y, z = (self._finite(element, f"{path}.{key}", part) for part in parts)
        return (x, y, z)

    def placement(self, element: XmlElement | None, path: str) -> Placement:
        """The placement that ``xyz`` and ``rpy`` of an element give."""
        if element is None:
            return IDENTITY
        position, rpy = (self.triple(element, key, path, (0.0, 0.0, 0.0)) for key in ("xyz", "rpy"))
        return placed(position, rpy, self.options.snap)

    def name(self, element: XmlElement) -> str | None:
        """The name of a link or joint, if it is given and new."""
        name = element.attributes.get("name")
        known = self.robot.links if element.tag == "link" else self.robot.joints
        if not name:
            self.fault(element, element.tag, "has no name", f'give <{element.tag} name="...">', "EG-MISSING")
            return None
        if name in known:
            first = known[name].place[1]
            message = f"the name is given twice, first in line {first}"
            self.fault(element, f"{element.tag}.{name}", message, "rename one", "EG-NAME-TAKEN")
            return None
        return name

    # -- elements -------------------------------------------------------------------------------------------------
    def _link(self, element: XmlElement) -> None:
        name = self.name(element)
        if name is None:
            return
        path = f"link.{name}"
        inertial = element.find("inertial")
        inertia = NOTHING if inertial is None else self._inertial(inertial, f"{path}.inertial")
        shapes = [self._shape(visual, f"{path}.visual") for visual in element.all("visual")]
        self.robot.links[name] = RobotLink(
            name, (element.file, element.line), inertia, tuple(shape for shape in shapes if shape is not None)
        )

    def _inertial(self, element: XmlElement, path: str) -> Inertia:
        frame = self.placement(element.find("origin"), f"{path}.origin")
        weight, tensor = element.find("mass"), element.find("inertia")
        mass = 0.0
        if weight is None:
            self.fault(element, f"{path}.mass", "is missing", 'give <mass value="..."/>', "EG-MISSING")
        else:
            mass = self.number(weight, "value", f"{path}.mass")
            if mass < 0.0 and self.options.check == "error":
                self.fault(weight, f"{path}.mass", f"is {mass:g}", f"give a mass of 0 or more, {SWITCH}", "EG-RANGE")
        if tensor is None:
            return Inertia(mass, np.zeros(3), np.zeros((3, 3))).seen(frame)
        xx, xy, xz, yy, yz, zz = (
            self.number(tensor, key, f"{path}.inertia", 0.0) for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        )
        matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        return Inertia(mass, np.zeros(3), matrix).seen(frame)

    def _shape(self, element: XmlElement, path: str) -> tuple[Placement, dict[str, Any]] | None:
        """A visual: what it looks like, as data that is never read."""
        material, geometry = element.find("material"), element.find("geometry")
        raw = geometry.children[0] if geometry is not None and geometry.children else None
        if raw is None:
            return None
        shape: dict[str, Any] = {"shape": raw.tag}
        where = f"{path}.{raw.tag}"
        if raw.tag == "mesh":
            shape["file"] = raw.attributes.get("filename", "")
            scale = raw.attributes.get("scale", "").split()
            if len(scale) == 3:  # some files give four, which no reader of theirs minds
                shape["scale"] = factors = [self._finite(raw, f"{where}.scale", part) for part in scale]
                self._check_scale(raw, f"{where}.scale", factors)
        elif raw.tag == "box":
            shape["size"] = list(self.triple(raw, "size", where, (0.0, 0.0, 0.0)))
        elif raw.tag in ("cylinder", "capsule"):
            shape |= {key: self.number(raw, key, where) for key in ("radius", "length")}
        elif raw.tag == "sphere":
            shape["radius"] = self.number(raw, "radius", where)
        else:
            return None
        color = "" if material is None else _color(material) or self.colors.get(material.attributes.get("name", ""), "")
        return self.placement(element.find("origin"), f"{path}.origin"), shape | ({"color": color} if color else {})

    def _check_scale(self, element: XmlElement, path: str, factors: list[float]) -> None:
        if not all(factors) and not any(problem.path == path for problem in self.robot.problems):
            remedy = "give three factors other than 0; negative ones mirror the mesh"
            self.fault(element, path, "a scale of 0 leaves nothing of the mesh", remedy, "EG-RANGE")
        elif min(factors) < 0.0:
            self.robot.notes.append(f"{path}: negative factors mirror the mesh")

    def _joint(self, element: XmlElement) -> None:
        name = self.name(element)
        if name is None:
            return
        path = f"joint.{name}"
        raw = element.attributes.get("type", "")
        kind = TYPES.get(raw)
        if kind is None:
            message = f"no joint of type {raw!r}" if raw else "is missing"
            self.fault(element, f"{path}.type", message, f"types: {', '.join(TYPES)}", "EG-CHOICE")
        ends = {}
        for end in ("parent", "child"):
            result = element.find(end)
            link = result.attributes.get("link") if result is not None else None
            if not link:
                self.fault(result or element, f"{path}.{end}", "is missing", f'give <{end} link="..."/>', "EG-MISSING")
            ends[end] = link or ""
        direction = self._axis(element, path, kind)
        if kind == "planar" and (direction[:2] != (0.0, 0.0) or direction[2] < 0.0):
            self.robot.notes.append(
                f"{path}.axis: the joint moves in the plane across its axis, as URDF says, its coordinates along the x "
                "and y axes of a frame whose z axis that is; Pinocchio moves it along x and y of the joint's own frame"
            )
        one_degree = kind in ("revolute", "prismatic")
        if kind in ("planar", "free"):
            left = [tag for tag in ("dynamics", "mimic") if element.find(tag) is not None]
            self.robot.notes += [f"left out: <{tag}> of the {raw} joint {name}" for tag in left]
        dynamics = element.find("dynamics") if one_degree else None
        self.robot.joints[name] = RobotJoint(
            name=name,
            type=kind or "weld",
            parent=ends["parent"],
            child=ends["child"],
            place=(element.file, element.line),
            outer=self.placement(element.find("origin"), f"{path}.origin"),
            axis=direction,
            limits=self._limits(element, path, raw) if one_degree else {},
            damping=0.0 if dynamics is None else self.number(dynamics, "damping", f"{path}.dynamics", 0.0),
            dry_friction=0.0 if dynamics is None else self.number(dynamics, "friction", f"{path}.dynamics", 0.0),
        )
        if one_degree:
            self._mimic(element, name)

    def _axis(self, element: XmlElement, path: str, kind: str | None) -> tuple[float, float, float]:
        axis, default = element.find("axis"), (1.0, 0.0, 0.0)
        direction = default if axis is None else self.triple(axis, "xyz", f"{path}.axis", default)
        if kind in ("revolute", "prismatic", "planar") and not any(direction):
            remedy = "give three numbers, not all zero"
            self.fault(axis or element, f"{path}.axis", "the axis has no length", remedy, "EG-RANGE")
            return default
        return direction

    def _loop(self, element: XmlElement) -> None:
        """A joint beside the tree; without a type it is a hinge, or, without an axis too, a ball."""
        name = element.attributes.get("name") or f"loop_{len(self.robot.loops)}"
        path = f"{element.tag}.{name}"
        raw = element.attributes.get("type")
        plain = "spherical" if element.find("axis") is None else "revolute"
        if raw is None:
            self.robot.notes.append(f"{path}: names no type; taken as {plain}")
        kind = LOOP_TYPES.get(raw or plain)
        if kind is None:
            remedy = f"types: {', '.join(LOOP_TYPES)}"
            self.fault(element, f"{path}.type", f"no loop is closed by {raw!r}", remedy, "EG-CHOICE")
        ends = []
        for pair in ENDS:
            end = next((result for word in pair if (result := element.find(word)) is not None), None)
            link = end.attributes.get("link", "") if end is not None else ""
            if end is None or not link:
                remedy = f'give <{pair[0]} link="..." xyz= rpy=/>'
                self.fault(element, f"{path}.{pair[0]}", "is missing", remedy, "EG-MISSING")
                return
            at = element.find(f"{end.tag}_origin") or end
            ends.append((link, self.placement(at, f"{path}.{at.tag}")))
        axis = self._axis(element, path, kind)
        self.robot.loops.append(Loop(name, kind or "weld", ends[0], ends[1], (element.file, element.line), axis))

    def _limits(self, element: XmlElement, path: str, kind: str) -> dict[str, float]:
        limit = element.find("limit")
        if limit is None:
            return {}
        raw = limit.attributes
        sides = () if kind == "continuous" else ("lower", "upper")  # they mean nothing there
        result = dict.fromkeys(sides, 0.0) if any(key in raw for key in sides) else {}  # the format's default
        for key in (*sides, "velocity", "effort"):
            text = raw.get(key, "").strip().lower()
            if text.lstrip("+-") in ("inf", "infinity"):
                result[key] = float(text)
            elif key in raw:
                result[key] = self.number(limit, key, f"{path}.limit", most=math.inf)
        lower, upper = result.get("lower", -math.inf), result.get("upper", math.inf)
        if lower > upper or math.inf in (lower, -upper):
            self.robot.notes.append(f"{path}.limit: no value lies between lower {lower:g} and upper {upper:g}; ignored")
            result = {key: value for key, value in result.items() if key not in sides}
        return {key: value for key, value in result.items() if not limits_nothing(key, value)}

    def _mimic(self, element: XmlElement, name: str) -> None:
        """Tie a joint to another, q = factor q_other + offset, or note that it is not."""
        mimic, path = element.find("mimic"), f"joint.{name}.mimic"
        if mimic is None:
            return
        other = mimic.attributes.get("joint")
        if not other:
            self.fault(mimic, path, "names no joint", 'give <mimic joint="..."/>', "EG-MISSING")
            return
        factor, offset = self.number(mimic, "multiplier", path, 1.0), self.number(mimic, "offset", path, 0.0)
        follower, followed = Sum(((name, 1.0),)), Sum(((other, 1.0),))
        if self.options.mimic == "coupling":
            place = element.file, element.line
            self.robot.ties.append(Tie(f"{name}_mimic", follower, followed, (offset, factor), place, path))
        elif name not in self.options.lock:
            self.loose.append(f"{name} = {factor:g} {other} + {offset:g}")
