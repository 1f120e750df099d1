"""Robots, URDF: the table of what becomes of each element and attribute, and the walk that meets them."""

from __future__ import annotations

from collections.abc import Iterator

from .constructs import (
    DATA,
    HARMLESS,
    INSIDE,
    LEFT,
    TAKEN,
    ConstructRow,
    count_all,
    find_row,
    is_whole,
    notes_of,
    table_of,
)
from .xml_text import XmlElement

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
    "looks": (HARMLESS, "what it looks like; shapes become `display`"),
    "measure": (HARMLESS, "sensors"),
    "label": (HARMLESS, "labels"),
}

#: Elements of joints that close loops: Drake's and Isaac Sim's, and those of others.
LOOPS = ("loop_joint", "loop_constraint", "loop")
_ENDS = "link1 link2 parent child predecessor successor"

URDF = table_of(
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
    {", ".join(f"{loop}/{end}" for loop in LOOPS for end in _ENDS.split())}: taken link xyz rpy
    {", ".join(f"{loop}/{end}_origin" for loop in LOOPS for end in _ENDS.split()[2:])}: taken xyz rpy
    {", ".join(f"{loop}/{tag}" for loop in LOOPS for tag in ("limit", "dynamics", "mimic"))}: loop **
    joint/safety_controller, joint/calibration: control **
    link/collision, link/contact, link/surface, link/self_filter, link/collision_checking: contact **
    transmission, ros2_control: drives **
    gazebo, mujoco, drake:collision_filter_group: dialect **
    joint/joint_properties, link/gravity, link/kinematic, link/origin: dialect **
    deformable: soft **
    link/visual, material: looks **
    sensor: measure **
    """,
    _REASONS,
)


def find_urdf(path: str, attribute: str = "") -> ConstructRow | None:
    """What becomes of an attribute of an element, or of the element itself; None if it is not known."""
    if path.rpartition("/")[2].startswith("xacro:"):
        return ConstructRow(path, *_REASONS["xacro"][:1], (INSIDE,), _REASONS["xacro"][1])
    return find_row(URDF, path, attribute)


def walk_urdf(root: XmlElement) -> Iterator[tuple[str, XmlElement]]:
    """Elements with their paths in the table; not into those whose inside shares their fate, or is not known."""
    waiting = [("robot", root)]
    while waiting:
        path, element = waiting.pop()
        yield path, element
        row = find_row(URDF, path)
        if row is None or is_whole(row):
            continue
        inside = "" if path == "robot" else f"{path}/"
        waiting += [(f"{inside}{child.tag}", child) for child in reversed(element.children)]


def note_urdf(root: XmlElement) -> list[str]:
    """Notes on what a file has that the model has not."""
    notes = notes_of(find_urdf, count_all((path, element.attributes) for path, element in walk_urdf(root)))
    for child in root.children:
        for element in child.walk() if child.tag not in ("link", "joint", *LOOPS) else ():
            pairs = (("parent", "child"), ("predecessor", "successor"))
            if element.tag.endswith(("constraint", "equality")) or any(
                element.find(a) is not None and element.find(b) is not None for a, b in pairs
            ):
                what = " ".join([f"<{element.tag}>", element.attributes.get("name", "")]).strip()
                notes.append(
                    f"left out: {what} in line {element.line}, which ties links or joints: the model may move more "
                    "freely than the robot; <loop_joint> and <mimic> are read"
                )
    for path, element in walk_urdf(root):
        if path not in ("robot", "link", "joint"):
            continue
        for tag in dict.fromkeys(child.tag for child in element.children):
            inside = tag if path == "robot" else f"{path}/{tag}"
            row = find_row(URDF, inside)
            if path != "robot" and row is not None and row.fate in (TAKEN, DATA) and len(element.all(tag)) > 1:
                name = element.attributes.get("name", "")
                notes.append(f"{path}.{name}: {len(element.all(tag))} <{tag}>; only the first is used")
    return notes
