"""Chains, trees and closed linkages of any length, described through the public interface."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.special import ellipj, ellipkm1

import eomgen as eg

from . import humanoid

#: Times at which motions of the four-bars are compared (s).
TIMES = np.linspace(0.0, 10.0, 201)


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


class Motion:
    """The closed equation of one variable, [(n + 1)/3 + n] theta'' = -g [(n + 1)/2 + n] cos theta, upright at 1 rad/s.

    Its solution is Jacobi's amplitude: with w^2 = 1 + 4 s and modulus^2 = 4 s / w^2, s being the slope,
    theta = 3 pi/2 - 2 am(w t/2 + K).
    """

    def __init__(self, n: int) -> None:
        self.slope = 9.81 * ((n + 1) / 2 + n) / ((n + 1) / 3 + n)
        self.exact = self.at(TIMES)

    def at(self, times: np.ndarray) -> np.ndarray:
        """theta (n_t,)."""
        square = 1.0 + 4.0 * self.slope
        place = 0.5 * np.sqrt(square) * times + ellipkm1(1.0 / square)
        return np.asarray(1.5 * np.pi - 2.0 * ellipj(place, 4.0 * self.slope / square)[3])

    def solve(self, method: str, rtol: float, atol: float) -> np.ndarray:
        """theta at TIMES by SciPy."""
        pair = {"jac": lambda t, y: [[0.0, 1.0], [self.slope * np.sin(y[0]), 0.0]]} if method == "Radau" else {}
        found = solve_ivp(
            lambda t, y: [y[1], -self.slope * np.cos(y[0])], (0.0, TIMES[-1]), [np.pi / 2, -1.0], method, TIMES,
            rtol=rtol, atol=atol, **pair,
        )  # fmt: skip
        return np.asarray(found.y[0])

    def error(self, theta: np.ndarray) -> float:
        """The largest difference of angles at TIMES."""
        return float(np.abs(theta - self.exact).max())


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


def closed_chain(n: int, closed: bool, spatial: bool) -> eg.Model:
    """n alike links on hinges, their ends on ground if it is closed; hinges across each other in turn if spatial."""
    m = eg.Model("chain", gravity=(0, -9.81, 0))
    last: Any = m.ground
    for i in range(n):
        link = m.body(f"b{i}", mass=1.0, com=(0.05, 0, 0), inertia=(1e-3, 1.2e-3, 1.5e-3))
        m.revolute(f"j{i}", last, link, axis="y" if spatial and i % 3 == 1 else "z")
        last = link.at(0.1, 0, 0)
        turning = sum(1 for k in range(n) if not (spatial and k % 3 == 1))
        angle = 0.0 if spatial and i % 3 == 1 else 2 * np.pi / (turning + 1)
        (m.guess if closed else m.initial)(**{f"j{i}": angle if closed else 0.1})
    if closed:
        (m.spherical if spatial else m.revolute)("end", last, m.ground.at(0.02, 0.02, 0))
    return m


def four_bars(n: int) -> eg.Model:
    """n parallelograms in a row."""
    m = eg.Model("bars", gravity=(0, -9.81, 0))
    rod: dict[str, Any] = {"mass": 1.0, "inertia": (0.01, 0.08, 0.08)}
    cranks = [m.body(f"crank{k}", com=(0, 0.5, 0), **rod) for k in range(n + 1)]
    for k, crank in enumerate(cranks):
        m.revolute(f"A{k}", m.ground.at(k, 0, 0), crank)
        m.guess(**{f"A{k}": 0.3})
    for k in range(n):
        coupler = m.body(f"coupler{k}", com=(0.5, 0, 0), **rod)
        m.revolute(f"B{k}", cranks[k].at(0, 1, 0), coupler)
        m.guess(**{f"B{k}": -0.3})
        m.revolute(f"C{k}", coupler.at(1, 0, 0), cranks[k + 1].at(0, 1, 0))
    return m


def sliders(n: int, geared: bool) -> eg.Model:
    """n masses on springs, two of them geared."""
    m = eg.Model("sliders")
    for k in range(n):
        m.prismatic(f"s{k}", m.ground, m.body(f"b{k}", mass=1.0), axis="x")
        m.element(f"spring{k}", joint=f"s{k}", potential="length**2/2")
        m.initial(**{f"s{k}": 0.1})
    if geared:
        m.coupling("gear", {"s0": 1, "s1": -1})
    return m


def coupled_humanoid(coupled: bool) -> eg.Model:
    """The humanoid of the benchmarks, one elbow coupled with the other if so."""
    m = humanoid()
    if coupled:
        left, right = sorted(j for j in m.derive("recursive").kinematics.names if "elbow" in j)[:2]
        m.coupling("elbows", {left: 1, right: -1})
    return m


def tree(n: int) -> eg.Model:
    """A tree of n alike links in which each but the last carries three."""
    m = eg.Model("tree", gravity=(0, -9.81, 0))
    links: list[Any] = []
    for i in range(n):
        link = m.body(f"b{i}", mass=1.0, com=(0.05, 0, 0), inertia=(1e-3, 1.2e-3, 1.5e-3))
        holder = links[(i - 1) // 3].at(0.1, 0, 0) if links else m.ground
        m.revolute(f"j{i}", holder, link, axis="y" if i % 3 == 1 else "z")
        m.initial(**{f"j{i}": 0.1})
        links.append(link)
    return m
