"""Robots, URDF: the table of what becomes of each element and attribute, and the walk that meets them."""

from __future__ import annotations

from collections.abc import Iterator

from .constructs import DATA, HARMLESS, LEFT, TAKEN, ConstructRow, count_all, find_row, is_whole, notes_of, table_of
from .xml_text import XmlElement

_REASONS = {
    "taken": (TAKEN, "becomes part of the model"),
    "limits": (DATA, "limits; a note names the joints (option `limits`)"),
    "friction": (DATA, "dry friction; it acts with the option `friction`, else a note names the joints"),
    "contact": (LEFT, "shapes that touch, and contact"),
    "drives": (LEFT, "drives and their reductions (`actuate` gives inputs, `armature` the inertia of a rotor)"),
    "control": (LEFT, "limits and reference positions of controllers"),
    "dialect": (LEFT, "words of other formats and simulators"),
    "soft": (LEFT, "soft bodies"),
    "looks": (HARMLESS, "what it looks like; shapes become `display`"),
    "measure": (HARMLESS, "sensors"),
    "label": (HARMLESS, "labels"),
}

URDF = table_of(
    """
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
