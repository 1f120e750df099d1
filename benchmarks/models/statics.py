"""Random mechanisms for statics: springs of 1 to 1e7 N/m side by side, in trees, nets, loops and turned bodies."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import sympy

import eomgen as eg

Random = np.random.Generator
GRAVITY = 9.81


def stiffness(rng: Random) -> float:
    """Between 1e0 and 1e7, all magnitudes alike."""
    return float(10.0 ** rng.uniform(0.0, 7.0))


def elastic_pendulum(rng: Random) -> eg.Model:
    """One to three point masses in a row on springs, in Cartesian coordinates."""
    m = eg.Model("elastic_pendulum", gravity=(0, -GRAVITY, 0))
    before: Any = m.ground
    height = 0.0
    for k in range(int(rng.integers(1, 4))):
        slide, bob = m.body(f"slide{k}", mass=0), m.body(f"bob{k}", mass=rng.uniform(0.1, 3.0))
        m.prismatic(f"X{k}", m.ground, slide, axis="x", coordinate=f"x{k}")
        m.prismatic(f"Y{k}", slide, bob, axis="y", coordinate=f"y{k}")
        length = rng.uniform(0.3, 1.5)
        m.spring(f"s{k}", before, bob, stiffness=stiffness(rng), length=length)
        before, height = bob, height - length
        angle = rng.uniform(-1.5, 1.5)
        m.initial(**{f"x{k}": -height * np.sin(angle), f"y{k}": height * np.cos(angle)})
    return m


def net(rng: Random) -> eg.Model:
    """Point masses in space between anchors, each on springs to anchors and to some others."""
    m = eg.Model("net", gravity=(0, 0, -GRAVITY))
    count = int(rng.integers(1, 5))
    knots = []
    for k in range(count):
        a, b, knot = m.body(f"a{k}", mass=0), m.body(f"b{k}", mass=0), m.body(f"n{k}", mass=rng.uniform(0.05, 5.0))
        m.prismatic(f"X{k}", m.ground, a, axis="x", coordinate=f"x{k}")
        m.prismatic(f"Y{k}", a, b, axis="y", coordinate=f"y{k}")
        m.prismatic(f"Z{k}", b, knot, axis="z", coordinate=f"z{k}")
        m.initial(**{f"{c}{k}": float(rng.normal()) for c in "xyz"})
        knots.append(knot)
    for k, knot in enumerate(knots):
        for i in range(3):
            m.spring(f"g{k}{i}", m.ground.at(*rng.normal(size=3) * 2.0), knot, stiffness=stiffness(rng),
                     length=rng.uniform(0.1, 2.0))  # fmt: skip
        for j in range(k):
            m.spring(f"s{j}{k}", knots[j], knot, stiffness=stiffness(rng), length=rng.uniform(0.1, 2.0))
    return m


def chain(rng: Random) -> eg.Model:
    """Links on hinges with torsional springs, the last one tied to ground by a spring."""
    m = eg.Model("chain", gravity=(0, -GRAVITY, 0))
    before: Any = m.ground
    count = int(rng.integers(2, 7))
    for k in range(count):
        length = rng.uniform(0.2, 1.0)
        inertia = {"zz": rng.uniform(1e-3, 0.1)}
        link = m.body(f"l{k}", mass=rng.uniform(0.1, 2.0), com=(length / 2, 0, 0), inertia=inertia)
        m.revolute(f"R{k}", before, link, coordinate=f"q{k}")
        if rng.random() < 0.6:
            m.torsional_spring(f"t{k}", joint=f"R{k}", stiffness=stiffness(rng), angle=rng.uniform(-1.0, 1.0))
        m.initial(**{f"q{k}": rng.uniform(-2.0, 2.0)})
        before = link.at(length, 0, 0)
    anchor = m.ground.at(*rng.normal(size=2) * 0.5 * count, 0)
    m.spring("tie", before, anchor, stiffness=stiffness(rng), length=rng.uniform(0.1, 1.0))
    return m


def four_bar(rng: Random) -> eg.Model:
    """A four-bar with springs at a hinge and across."""
    m = eg.Model("four_bar", gravity=(0, -GRAVITY, 0))
    points = [
        np.zeros(2),
        rng.normal(size=2),
        np.array([1.5, 0.5]) + rng.normal(size=2),
        np.array([2.0, rng.uniform(-0.5, 0.5)]),
    ]
    angles, lengths = [], []
    for a, b in pairwise(points):
        angles.append(np.arctan2(*(b - a)[::-1]))
        lengths.append(float(np.linalg.norm(b - a)))
    bars = [
        m.body(f"b{k}", mass=rng.uniform(0.2, 2.0), com=(x / 2, rng.normal() * 0.1, 0), inertia={"zz": 0.05})
        for k, x in enumerate(lengths)
    ]
    m.revolute("A", m.ground, bars[0], coordinate="qA")
    m.revolute("B", bars[0].at(lengths[0], 0, 0), bars[1], coordinate="qB")
    m.revolute("C", bars[1].at(lengths[1], 0, 0), bars[2], coordinate="qC")
    m.revolute("D", bars[2].at(lengths[2], 0, 0), m.ground.at(*points[3], 0))
    m.guess(qA=angles[0], qB=angles[1] - angles[0], qC=angles[2] - angles[1])
    m.torsional_spring("t", joint="A", stiffness=stiffness(rng), angle=float(angles[0] + rng.normal() * 0.3))
    m.spring("s", m.ground.at(*rng.normal(size=2), 0), bars[1].at(lengths[1] / 2, 0, 0), stiffness=stiffness(rng),
             length=rng.uniform(0.1, 1.5))  # fmt: skip
    return m


def closed_chain(rng: Random) -> eg.Model:
    """Five to seven links hung at both ends, with torsional springs between some."""
    m = eg.Model("closed_chain", gravity=(0, -GRAVITY, 0))
    count = int(rng.integers(4, 7))
    angles = np.cumsum(rng.uniform(-0.9, 0.9, size=count))
    lengths = rng.uniform(0.3, 0.8, size=count)
    end = [float((lengths * np.cos(angles)).sum()), float((lengths * np.sin(angles)).sum())]
    before: Any = m.ground
    for k in range(count):
        link = m.body(f"l{k}", mass=rng.uniform(0.1, 2.0), com=(lengths[k] / 2, 0, 0), inertia={"zz": 0.01})
        m.revolute(f"R{k}", before, link, coordinate=f"q{k}")
        if rng.random() < 0.5:
            m.torsional_spring(f"t{k}", joint=f"R{k}", stiffness=stiffness(rng), angle=rng.uniform(-0.5, 0.5))
        before = link.at(lengths[k], 0, 0)
    m.guess(**{f"q{k}": float(angles[k] - (angles[k - 1] if k else 0.0)) for k in range(count)})
    m.revolute("end", before, m.ground.at(*end, 0))
    m.spring("s", m.ground.at(*rng.normal(size=2), 0), "l1", stiffness=stiffness(rng), length=rng.uniform(0.1, 1.0))
    return m


def hung_body(rng: Random) -> eg.Model:
    """A rigid body on three to six springs in space, in Euler parameters, with a rotor now and then."""
    m = eg.Model("hung_body", gravity=(0, 0, -GRAVITY))
    body = m.body("body", mass=rng.uniform(0.5, 5.0), com=rng.normal(size=3) * 0.1, inertia=(0.3, 0.4, 0.5))
    m.free("F", m.ground, body, rotation="euler_parameters")
    for k in range(int(rng.integers(3, 7))):
        m.spring(f"s{k}", m.ground.at(*rng.normal(size=3) * 2.0), body.at(*rng.normal(size=3) * 0.5),
                 stiffness=stiffness(rng), length=rng.uniform(0.1, 2.0))  # fmt: skip
    if rng.random() < 0.4:
        m.revolute("R", body.at(0.2, 0, 0), m.body("rotor", mass=0.5, inertia=(0.02, 0.03, 0.03)), axis="x")
    e = rng.normal(size=4)
    e /= np.linalg.norm(e)
    m.initial(**{f"F_e{i}": float(e[i]) for i in range(4)}, **{f"F_{c}": float(rng.normal()) for c in "xyz"})
    return m


def ball_joint(rng: Random) -> eg.Model:
    """A body on a ball joint with springs of two kinds, in Euler parameters."""
    m = eg.Model("ball_joint", gravity=(0, 0, -GRAVITY))
    body = m.body("body", mass=rng.uniform(0.5, 5.0), com=rng.normal(size=3) * 0.3, inertia=(0.3, 0.4, 0.5))
    m.spherical("S", m.ground, body, rotation="euler_parameters")
    for k in range(int(rng.integers(0, 4))):
        m.spring(f"s{k}", m.ground.at(*rng.normal(size=3)), body.at(*rng.normal(size=3) * 0.5),
                 stiffness=stiffness(rng), length=rng.uniform(0.1, 1.0))  # fmt: skip
    e = rng.normal(size=4)
    e /= np.linalg.norm(e)
    m.initial(**{f"S_e{i}": float(e[i]) for i in range(4)})
    return m


def laws(rng: Random) -> eg.Model:
    """Forces that have no potential or are strongly nonlinear, on sliders coupled by springs."""
    m = eg.Model("laws", gravity=(0, -GRAVITY, 0))
    before: Any = m.ground
    for k in range(int(rng.integers(1, 5))):
        body = m.body(f"b{k}", mass=rng.uniform(0.2, 3.0))
        m.prismatic(f"P{k}", before, body, axis="y" if k % 2 else "x", coordinate=f"s{k}")
        soft, hard = stiffness(rng), stiffness(rng)
        wave = f"{rng.normal() * 5.0}*cos({rng.uniform(0.5, 3)}*s{k})"
        m.actuator(f"f{k}", f"P{k}", f"-{soft}*s{k} - {hard}*s{k}**3 + {wave}")
        m.initial(**{f"s{k}": float(rng.normal())})
        before = body
    return m


def bushings(rng: Random) -> eg.Model:
    """Plates in a plane and bodies in space on bushings, described in Euler angles."""
    m = eg.Model("bushings", gravity=(0, -GRAVITY, 0))
    before: Any = m.ground
    for k in range(int(rng.integers(1, 4))):
        body = m.body(f"b{k}", mass=rng.uniform(0.2, 3.0), com=rng.normal(size=3) * 0.05, inertia=(0.05, 0.06, 0.07))
        where = f"J{k}", m.ground, body
        if rng.random() < 0.5:
            names = [f"J{k}_{c}" for c in "xy"] + [f"J{k}_a"]
            m.planar(*where, coordinates=names)
        else:
            names = [f"J{k}_{c}" for c in "xyz123"]
            m.free(*where)
        m.bushing(f"u{k}", before, body, stiffness=[stiffness(rng) for _ in range(6)])
        m.initial(**{name: float(rng.normal() * 0.4) for name in names})
        before = body.at(*rng.normal(size=2) * 0.3, 0)
    return m


def contacts(rng: Random) -> eg.Model:
    """A ball between planes that push only while they touch it, on soft springs."""
    m = eg.Model("contacts", gravity=(0, -GRAVITY, 0))
    slide, ball = m.body("slide", mass=0), m.body("ball", mass=rng.uniform(0.1, 10.0))
    m.prismatic("X", m.ground, slide, axis="x", coordinate="x")
    m.prismatic("Y", slide, ball, axis="y", coordinate="y")
    for k, turn in enumerate((-0.4, 0.7)):
        tilt = m.ground.at(*rng.normal(size=2) * 0.2, 0, rpy=(-np.pi / 2, 0, 0))
        m.sphere_plane(f"p{k}", m.ground.at(0, 0, 0, rpy=(-np.pi / 2, turn, 0)), ball, radius=0.1,
                       stiffness=10.0 ** rng.uniform(3, 8))  # fmt: skip
        m.spring(f"s{k}", tilt, ball, stiffness=10.0 ** rng.uniform(-1, 2), length=rng.uniform(0.1, 1.0))
    m.initial(x=float(rng.normal()), y=float(rng.uniform(0.0, 2.0)))
    return m


def lagrangian(rng: Random) -> eg.Model:
    """A bare Lagrangian: a curved valley of a potential with walls of all heights."""
    t = sympy.Symbol("t")
    x, y, z = (sympy.Function(name)(t) for name in ("x", "y", "z"))
    a, b, c = (rng.normal() for _ in range(3))
    V = stiffness(rng) * (y - a * x**2) ** 2 + stiffness(rng) * (z - b * sympy.sin(x + y)) ** 2 + (x - c) ** 4 + x**2
    T = sum(rng.uniform(0.1, 10.0) * q.diff(t) ** 2 for q in (x, y, z)) / 2
    m = eg.Model.from_lagrangian("valley", T - V, [x, y, z])
    m.initial(**{name: float(rng.normal() * 2.0) for name in "xyz"})
    return m


FAMILIES: dict[str, Callable[[Random], eg.Model]] = {
    "elastic pendula": elastic_pendulum,
    "spring nets": net,
    "chains": chain,
    "four-bars": four_bar,
    "closed chains": closed_chain,
    "hung bodies, Euler parameters": hung_body,
    "ball joints, Euler parameters": ball_joint,
    "nonlinear laws": laws,
    "bushings, Euler angles": bushings,
    "contacts": contacts,
    "curved valleys": lagrangian,
}
