"""Closed linkages of any length, described through the public interface."""

from __future__ import annotations

import numpy as np

import eomgen as eg


def n_four_bar(n: int) -> eg.Model:
    """The N-four-bar mechanism, problem A02 of the IFToMM library of benchmarks: n parallelograms in a row.

    Uniform rods of 1 m and 1 kg: cranks 0 .. n stand 1 m apart on the ground, coupler k joins the tips of cranks k - 1
    and k.  They start upright, the tips at 1 m/s along x.  Wherever all rods lie flat the mechanism has n + 1 freedoms.
    """
    m = eg.Model(f"n_four_bar_{n}", gravity=(0, "-g", 0))
    m.parameter("g", 9.81, unit="m/s**2")
    m.parameter("l", 1.0, unit="m")
    m.parameter("m", 1.0, unit="kg")
    rod = {"mass": "m", "com": ("l/2", 0, 0), "inertia": {"zz": "m*l**2/12"}}
    cranks = [m.body(f"crank{k}", **rod) for k in range(n + 1)]
    couplers = [m.body(f"coupler{k}", **rod) for k in range(1, n + 1)]
    for k, crank in enumerate(cranks):
        m.revolute(f"A{k}", m.ground.at(f"{k}*l", 0, 0), crank, coordinate=f"theta{k}")
        m.initial(**{f"theta{k}": "pi/2"})
    for k, coupler in enumerate(couplers, 1):
        m.revolute(f"B{k}", cranks[k - 1].at("l", 0, 0), coupler, coordinate=f"bend{k}")
        m.revolute(f"C{k}", coupler.at("l", 0, 0), cranks[k].at("l", 0, 0))
        m.initial(**{f"bend{k}": "-pi/2"})
    m.initial(theta0_dot=-1.0)
    tip = cranks[0].marker("tip", at=("l", 0, 0))
    m.output("x", tip.position[0])
    m.output("y", tip.position[1])
    return m


def turn(seed: int) -> np.ndarray:
    """A rotation by chance; none for 0."""
    if not seed:
        return np.eye(3)
    Q, R = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    Q *= np.sign(np.diag(R))
    return Q if np.linalg.det(Q) > 0 else Q[:, [1, 0, 2]]


def v_engine(seed: int) -> eg.Model:
    """A V6 engine at 60 degrees, two rods on each of three pins; all of it turned in space by a seed other than 0."""
    T = turn(seed)

    def vector(*x: float) -> tuple[float, ...]:
        return tuple((T @ np.array(x)).tolist())

    def inertia(*x: float) -> list[list[float]]:
        return (T @ np.diag(x) @ T.T).tolist()

    m = eg.Model("v6", gravity=vector(0, -9.81, 0))
    crank = m.body("crank", mass=10, com=(0, 0, 0), inertia=inertia(0.01, 0.01, 0.02))
    m.revolute("main", m.ground, crank, axis=vector(0, 0, 1), coordinate="theta")
    for k in range(6):
        phase, bank = k // 2 * 2 * np.pi / 3, (np.pi / 6 if k % 2 else -np.pi / 6)
        depth = 0.1 * (k // 2) + 0.02 * (k % 2)
        pin = np.array([0.04 * np.cos(phase), 0.04 * np.sin(phase)])
        along = np.array([np.sin(bank), np.cos(bank)])
        s = along @ pin + np.sqrt(0.15**2 - (pin @ pin - (along @ pin) ** 2))
        rod = m.body(f"rod{k}", mass=0.5, com=vector(0.05, 0, 0), inertia=inertia(1e-4, 1e-3, 1e-3))
        piston = m.body(f"piston{k}", mass=0.4)
        m.revolute(f"big{k}", crank.at(*vector(*pin, depth)), rod, axis=vector(0, 0, 1))
        m.revolute(f"small{k}", rod.at(*vector(0.15, 0, 0)), piston, axis=vector(0, 0, 1))
        m.prismatic(f"bore{k}", m.ground.at(*vector(0, 0, depth)), piston, axis=vector(*along, 0), coordinate=f"s{k}")
        reach = s * along - pin
        m.guess(**{f"big{k}": float(np.arctan2(reach[1], reach[0])), f"s{k}": float(s)})
    m.initial(theta=0.0, theta_dot=10.0)
    return m
