"""The measured models, described through the public interface; those of files stand beside this one."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

import eomgen as eg

from ..harness import ROOT

HERE = Path(__file__).parent
REFERENCE = ROOT / "tests" / "reference"

#: Arms of which every parameter is a symbol, as papers on the dynamics of robots count their operations.
ARMS = ("puma560", "stanford", "rx90", "panda", "iiwa")


def chain_values(n: int) -> dict[str, float]:
    """Numbers for the parameters of a chain: links that differ in mass and length, uniform rods."""
    values = {"g": 9.81}
    for k in range(1, n + 1):
        mass, length = 1.0 + 0.1 * (k % 7), 1.0 - 0.03 * (k % 5)
        values |= {f"m{k}": mass, f"l{k}": length, f"d{k}": length / 2, f"I{k}": mass * length**2 / 12}
    return values


def chain(n: int) -> eg.Model:
    """A planar chain of n links that hangs from the ground, in the angles between neighbours.

    Mass, length, distance of the centre of mass and inertia of each link, and gravity, are parameters.
    """
    m = eg.Model(f"chain_{n}", gravity=(0, "-g", 0))
    symbols = {name: m.parameter(name, value) for name, value in chain_values(n).items()}
    previous = m.ground
    for k in range(1, n + 1):
        mass, length, distance, inertia = (symbols[f"{letter}{k}"] for letter in "mldI")
        link = m.body(f"link{k}", mass=mass, com=(0, -distance, 0), inertia={"zz": inertia})
        m.revolute(f"q{k}", previous, link)
        previous = link.at(0, -length, 0)
    return m


def chain_with_joints(n: int, stiffness: float = 1e4, damping: float = 1e2) -> tuple[eg.Model, np.ndarray]:
    """Rods on hinges with stiff springs and dampers in all but the first, and where it starts."""
    m = eg.Model(f"stiff_chain_{n}", gravity=(0, -9.81, 0))
    previous = m.ground
    for k in range(n):
        mass, length = 1.0 + 0.1 * k, 1.0 - 0.02 * k
        rod = m.body(f"rod{k}", mass=mass, com=(0, -length / 2, 0), inertia={"zz": mass * length**2 / 12})
        m.revolute(f"q{k}", previous, rod)
        if k:
            m.torque(f"joint{k}", f"q{k}", f"-{stiffness}*q{k} - {damping}*q{k}_dot")
        previous = rod.at(0, -length, 0)
    return m, np.array([1.0] + (n - 1) * [0.3] + n * [0.0])


def arm_joints(name: str) -> list[dict[str, Any]]:
    """The joints of an arm as in its reference file, entries of rotations next to 0 and +-1 made exact.

    URDF files write quarter turns with few digits: entries are off by up to 5e-12.
    """
    path = REFERENCE / f"{name}_arm.json"
    joints: list[dict[str, Any]] = json.loads(path.read_text(encoding="utf-8"))["joints"]
    for joint in joints:
        rotation = np.array(joint["rotation"])
        nearest = np.round(rotation)
        joint["rotation"] = np.where(np.abs(rotation - nearest) < 1e-11, nearest, rotation)
    return joints


def spatial_chain(n: int) -> eg.Model:
    """A chain of n rods on hinges that are across each other in turn, about z and about y; every parameter a symbol."""
    m = eg.Model(f"spatial_chain_{n}", gravity=(0, 0, "-g"))
    m.parameter("g", 9.81)
    previous = m.ground
    for k in range(1, n + 1):
        length = 1.0 - 0.03 * (k % 5)
        values = {"m": 1.0 + 0.1 * (k % 7), "l": length, "d": length / 2, "a": 0.01, "b": 0.02, "c": 0.025}
        for letter, value in values.items():
            m.parameter(f"{letter}{k}", value)
        inertia = {"xx": f"a{k}", "yy": f"b{k}", "zz": f"c{k}"}
        link = m.body(f"link{k}", mass=f"m{k}", com=(f"d{k}", 0, 0), inertia=inertia)
        m.revolute(f"q{k}", previous, link, axis="zy"[k % 2])
        previous = link.at(f"l{k}", 0, 0)
    return m


def rpy(rotation: np.ndarray) -> tuple[float, float, float]:
    """Roll, pitch and yaw of a rotation; roll 0 where the pitch is a quarter turn."""
    across = float(np.hypot(rotation[0, 0], rotation[1, 0]))
    pitch = float(np.arctan2(-rotation[2, 0], across))
    if across < 1e-12:
        return 0.0, pitch, float(np.arctan2(-rotation[0, 1], rotation[1, 1]))
    return (
        float(np.arctan2(rotation[2, 1], rotation[2, 2])),
        pitch,
        float(np.arctan2(rotation[1, 0], rotation[0, 0])),
    )


def numeric_arm(name: str, driven: bool = False) -> eg.Model:
    """An arm of revolute joints, all parameters numbers; ``driven`` by a torque for an input at every joint."""
    m = eg.Model(name, gravity=(0, 0, -9.81))
    bodies = [m.ground]
    for joint in arm_joints(name):
        marker = bodies[joint["parent"] + 1].at(*joint["position"], rpy=rpy(joint["rotation"]))
        body = m.body(f"{joint['name']}_body", mass=joint["mass"], com=joint["com"], inertia=joint["inertia_com"])
        pin = m.revolute(joint["name"], marker, body, axis=joint["axis"])
        if driven:
            m.torque(f"drive_{joint['name']}", pin, m.input(f"tau_{joint['name']}"))
        bodies.append(body)
    return m


def symbolic_arm(name: str) -> eg.Model:
    """One of :data:`ARMS`."""
    return eg.load(HERE / f"{name}.yaml")


def panda() -> eg.Model:
    """The arm of Franka's Panda, seven revolute joints, all parameters numbers."""
    return numeric_arm("panda")


def humanoid() -> eg.Model:
    """A floating trunk with arms, legs, waist and neck, 30 joints in all, every parameter a number."""
    return eg.load(HERE / "humanoid.yaml")
