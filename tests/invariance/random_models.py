"""Random models of every kind of part: trees and loops of all joints, all force elements, constraints, drivers, events.

They are described in Python, with parameters, inputs, texts and markers in every place that takes them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

import eomgen as eg

#: Joints that can carry a body, and the options each needs.
JOINTS: dict[str, dict[str, Any]] = {
    "revolute": {},
    "continuous": {},
    "prismatic": {},
    "screw": {"pitch": "2*lead"},
    "cylindrical": {},
    "universal": {},
    "constant_velocity": {},
    "spherical": {},
    "planar": {},
    "free": {},
    "weld": {},
}


def numbers(random: np.random.Generator, size: float, count: int = 3) -> list[float]:
    """Random numbers of a size."""
    return [float(x) for x in random.uniform(-size, size, count)]


def describe_bodies(m: eg.Model, random: np.random.Generator, count: int) -> list[Any]:
    """Bodies whose mass properties are given in the ways there are."""
    made = []
    for k in range(count):
        markers = {"a": tuple(numbers(random, 0.4)), "b": {"at": numbers(random, 0.4), "rpy": numbers(random, 1.0)}}
        box = {
            "type": "box",
            "size": ["l", 0.2, 0.1],
            "density": 90,
            "rpy": numbers(random, 1),
            "at": numbers(random, 0.1),
        }
        pin = {"type": "cylinder", "radius": 0.1, "length": 0.4, "mass": 0.6, "axis": "y", "at": [0.1, 0, 0]}
        tensor = {"xx": 0.3, "yy": 0.25, "zz": 0.2, "xy": 0.03, "yz": -0.02}
        moment, axes = numbers(random, 0.1), numbers(random, 1.0)
        ways: Sequence[dict[str, Any]] = (
            {"mass": "0.9*density", "com": ["l/3", 0.1, "-0.2*l"], "inertia": (0.3, "0.2*l", 0.25)},
            {"mass": 1.3, "com": numbers(random, 0.2), "inertia": tensor},
            {"mass": 0.8, "first_moment": moment, "principal": (0.2, 0.15, 0.12), "axes": axes},
            {"mass": 0.7, "com": numbers(random, 0.05), "inertia": (0.4, 0.35, 0.3), "about": "origin"},
            {"solids": [box, pin]},
            {"points": [{"mass": 0.3, "at": numbers(random, 0.3)} for _ in range(4)]},
        )
        handle = m.body(f"body{k}", **ways[int(random.integers(len(ways)))])
        for name, placed in markers.items():
            handle.marker(name, **(placed if isinstance(placed, dict) else {"at": placed}))
        made.append(handle)
    return made


def describe_tree(m: eg.Model, random: np.random.Generator, bodies: list[Any]) -> dict[str, str]:
    """Joints of random types; returns the coordinates of those of one degree, with their types."""
    single = {}
    kinds = [str(random.choice(list(JOINTS))) for _ in bodies]
    if all(kind == "weld" for kind in kinds):
        kinds[0] = "revolute"
    for k, body in enumerate(bodies):
        parent = m.ground if k == 0 or random.random() < 0.2 else bodies[int(random.integers(k))]
        outer = parent.at(*numbers(random, 0.5), rpy=tuple(numbers(random, 1.5)))
        inner = (body, f"body{k}.a", f"body{k}.b")[int(random.integers(3))]
        kind, options = kinds[k], dict(JOINTS[kinds[k]])
        if kind in ("revolute", "prismatic", "cylindrical", "screw") and random.random() < 0.6:
            options["axis"] = ("x", "-y", tuple(numbers(random, 1.0)))[int(random.integers(3))]
        if kind in ("spherical", "free"):
            if random.random() < 0.5:
                options["rotation"] = "euler_parameters"
            else:
                options["sequence"] = str(random.choice(["xyz", "zxy", "zxz", "yxz"]))
        if kind in ("revolute", "prismatic", "screw") and random.random() < 0.5:
            options["coordinate"] = f"c{k}"
        ends = (outer, inner) if random.random() < 0.7 else (inner, outer)
        joint = getattr(m, kind)(f"joint{k}", *ends, **options)
        if kind in ("revolute", "continuous", "prismatic", "screw"):
            single[str(joint.coordinate)] = kind
            if kind != "screw" and random.random() < 0.3:
                m.description.sections["joints"][-1].values["armature"] = 0.05
        elif kind != "weld" and options.get("rotation") != "euler_parameters":
            m.initial |= {str(name): float(random.uniform(0.2, 0.5)) for name in joint.coordinates}
    for name in single:
        m.initial[name] = float(random.uniform(-0.4, 0.4))
    return single


def _forces(
    m: eg.Model, random: np.random.Generator, bodies: list[Any], single: dict[str, str]
) -> list[Callable[[], Any]]:
    last, first = bodies[-1], bodies[0]
    wall = m.ground.at(0.8, -0.7, 0.4, rpy=(0.3, 0.2, 0.1))
    angles = [name for name, kind in single.items() if kind != "prismatic"]
    made: list[Callable[[], Any]] = [
        lambda: m.spring("f_spring", wall, last, stiffness="30*k", length=0.4),
        lambda: m.damper("f_damper", wall, f"{last.name}.a", damping="0.5 + 0.1*t"),
        lambda: m.force("f_force", last.at(0.1, 0.2, 0), (1, "2*u", "sin(t)")),
        lambda: m.force("f_body", f"{first.name}.b", ("u", 0.3, -1), axes="body"),
        lambda: m.torque("f_torque", last, (0.3, "-u", 0.1), axes="body"),
        lambda: m.torque("f_ground", last, (0.1, 0.2, "0.3*cos(t)")),
        lambda: m.bushing(
            "f_bushing", wall, f"{last.name}.b", stiffness=(20, 25, 30, 3, 4, 5), damping=(1, 1, 1, 0.1, 0.2, 0.1)
        ),
        lambda: m.sphere_plane(
            "f_floor", m.ground.at(0, 0, 0.2), last,
            radius=0.3, stiffness=900, dissipation=0.2, friction=0.4, smoothing=0.05,
        ),
        lambda: m.element("f_law", wall, last.at(0, 0, 0.1), law="-3*rate*length", potential="4*(length - 0.2)**2"),
    ]  # fmt: skip
    for n, name in enumerate(list(single)[:3]):
        made += [
            lambda name=name, n=n: m.torque(f"f_drive{n}", name, f"u - 0.2*{name}_dot"),
            lambda name=name, n=n: m.friction(f"f_friction{n}", name, viscous=0.1, coulomb=0.2, smoothing=0.1),
            lambda name=name, n=n: m.stop(f"f_stop{n}", name, lower=-0.1, upper=0.1, stiffness=200, dissipation=0.1),
        ]
    for n, name in enumerate(angles[:1]):
        made.append(lambda name=name, n=n: m.torsional_spring(f"f_turn{n}", name, stiffness=3, angle="0.2*k"))
    return made


def random_tree(seed: int) -> eg.Model:
    """A tree of one to four bodies with forces, an input, an event and outputs."""
    random = np.random.default_rng(seed)
    m = eg.Model(f"tree_{seed}", gravity=(0.3, "-g", 0.5))
    for name, value in (("g", 9.81), ("k", 1.2), ("l", 0.6), ("density", 1.1), ("lead", 0.2)):
        m.parameter(name, value)
    m.input("u", 0.4)
    bodies = describe_bodies(m, random, int(random.integers(1, 5)))
    single = describe_tree(m, random, bodies)
    forces = _forces(m, random, bodies, single)
    for k in random.permutation(len(forces))[:4]:
        forces[int(k)]()
    if len(single) > 1 and random.random() < 0.4:
        _constrain(m, random, single)
    last = bodies[-1]
    m.output("tip_x", f"x({last.name}.a) + 2*vy({last.name}.b)")
    m.output("spin", f"wz_body({last.name}.b)*az({last.name}) + u")
    m.output("E", "kinetic_energy + potential_energy")
    if random.random() < 0.4:
        m.event("passes", f"x({last.name}) - 0.05")
    return m


def _constrain(m: eg.Model, random: np.random.Generator, single: dict[str, str]) -> None:
    """A coupling, linear or written, or a driver; initial values obey it."""
    a, b = list(single)[:2]
    start = dict(m.initial)
    kind = str(random.choice(["linear", "written", "driver", "velocity"]))
    if kind == "linear":
        m.coupling("tie", {a: 2, b: "-k"}, offset=2 * start[a] - 1.2 * start[b])
    elif kind == "written":
        m.coupling("tie", equation=f"{a} - {b}**2 - {start[a] - start[b] ** 2!r}")
    elif kind == "driver":
        m.driver("tie", coordinate=a, value=f"{start[a]!r} + 0.3*sin(2*t)")
        del m.initial[a]
    else:
        m.coupling("tie", equation=f"{a}_dot - (1 + {b}**2)*{b}_dot")
