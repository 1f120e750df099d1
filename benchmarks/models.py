"""The measured models, described through the public interface."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import eomgen as eg

from .measure import ROOT

EXAMPLES = ROOT / "examples"
PANDA = ROOT / "tests" / "reference" / "panda_arm.json"


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


def panda_joints() -> list[dict[str, Any]]:
    """The joints of the Panda arm as in its reference file, entries of rotations next to 0 and +-1 made exact."""
    joints: list[dict[str, Any]] = json.loads(PANDA.read_text(encoding="utf-8"))["joints"]
    for joint in joints:
        rotation = np.array(joint["rotation"])
        nearest = np.round(rotation)
        joint["rotation"] = np.where(np.abs(rotation - nearest) < 1e-12, nearest, rotation)
    return joints


def panda() -> eg.Model:
    """The arm of Franka's Panda, seven revolute joints, all parameters numbers."""
    m = eg.Model("panda", gravity=(0, 0, -9.81))
    bodies = [m.ground]
    for joint in panda_joints():
        rpy = Rotation.from_matrix(joint["rotation"]).as_euler("xyz")
        quarters = rpy / (np.pi / 2)
        rpy = np.where(np.abs(quarters - np.round(quarters)) < 1e-12, np.round(quarters) * (np.pi / 2), rpy)
        marker = bodies[joint["parent"] + 1].at(*joint["position"], rpy=tuple(rpy.tolist()))
        body = m.body(f"{joint['name']}_body", mass=joint["mass"], com=joint["com"], inertia=joint["inertia_com"])
        m.revolute(joint["name"], marker, body, axis=joint["axis"])
        bodies.append(body)
    return m
