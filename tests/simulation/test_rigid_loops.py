"""Steps with rigid contact of mechanisms with closed loops, beside the bodies one by one by SciPy."""

from __future__ import annotations

import warnings
from functools import cache
from typing import Any

import numpy as np
import pytest
from rigid_scenes import G, rigid
from scipy.integrate import solve_ivp

import eomgen as eg
from eomgen.simulation.moreau import ContactWarning

LENGTHS = (0.2, 0.5, 0.4, 0.45)  #: of crank, coupler, rocker and frame (m)
MASSES = np.repeat([1.0, 2.0, 1.5], 3)
SPINS = (0.01, 0.05, 0.03)
CENTRES = np.array([[0.1, 0.0], [0.25, 0.05], [0.2, 0.0]])
CIRCLE, RADIUS = np.array([0.25, -0.1]), 0.05
FAR = -50.0  #: height of a floor that nothing reaches


@cache
def four_bar(
    floor: float, restitution: float = 0.0, cut: str = "C", turn: float = 0.0, target: str = "cython", mu: float = 0.0
) -> Any:
    """A four-bar whose coupler carries a circle, beside a floor; turned about z with its gravity."""
    a, b, c, d = LENGTHS
    s, co = np.sin(turn), np.cos(turn)
    m = eg.Model("four_bar", gravity=(G * s, -G * co, 0))
    base = m.ground.at(0, 0, 0, rpy=(0, 0, turn))
    crank = m.body("crank", mass=1.0, com=(*CENTRES[0], 0), inertia={"zz": SPINS[0]})
    coupler = m.body("coupler", mass=2.0, com=(*CENTRES[1], 0), inertia={"zz": SPINS[1]})
    rocker = m.body("rocker", mass=1.5, com=(*CENTRES[2], 0), inertia={"zz": SPINS[2]})
    names = {key: ({} if key == cut else {"coordinate": key.lower()}) for key in "ABCD"}
    m.revolute("A", base, crank, **names["A"])
    m.revolute("B", crank.at(a, 0, 0), coupler, **names["B"])
    m.revolute("C", coupler.at(b, 0, 0), rocker.at(c, 0, 0), **names["C"])
    m.revolute("D", m.ground.at(d * co, d * s, 0, rpy=(0, 0, turn)), rocker, **names["D"])
    held = Bodies().start(*START)
    m.guess(d=held[8], **({"b": held[5] - held[2]} if cut != "B" else {}))
    ball = {"shape": "circle", "on": coupler.at(*CIRCLE, 0), "radius": RADIUS}
    plane = {"shape": "half_plane", "on": m.ground.at(-floor * s, floor * co, 0, rpy=(0, 0, turn))}
    m.contacts("floor", ball, plane, rigid(restitution=restitution, friction=mu))
    return m.compile(target=target)


def turned(angle: float) -> np.ndarray:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


class Bodies:
    """The same linkage as three free bodies (x, y, angle) of their centres held by four pins: an index-1 DAE."""

    def __init__(self) -> None:
        a, b, c, d = LENGTHS
        base, frame = np.zeros(2), np.array([d, 0.0])
        self.pins = [(0, base, None, base), (0, np.array([a, 0.0]), 1, base),
                     (1, np.array([b, 0.0]), 2, np.array([c, 0.0])), (2, base, None, frame)]  # fmt: skip
        self.inertia = MASSES.copy()
        self.inertia[2::3] = SPINS
        self.force = np.array([0.0, -G, 0.0] * 3) * MASSES

    def row(self, q: np.ndarray, v: np.ndarray, body: int, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Velocities (2, 9) of a point of a body, and what its acceleration has of velocities alone."""
        k = 3 * body
        arm = turned(q[k + 2]) @ (at - CENTRES[body])
        J = np.zeros((2, 9))
        J[:, k : k + 2], J[:, k + 2] = np.eye(2), (-arm[1], arm[0])
        return J, -arm * v[k + 2] ** 2

    def constraints(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        rows, extra = [], []
        for body, at, other, there in self.pins:
            J, own = self.row(q, v, body, at)
            K, far = (np.zeros((2, 9)), np.zeros(2)) if other is None else self.row(q, v, other, there)
            rows.append(J - K), extra.append(own - far)
        return np.concatenate(rows), np.concatenate(extra)

    def rhs(self, _: float, x: np.ndarray) -> np.ndarray:
        q, v = x[:9], x[9:]
        C, extra = self.constraints(q, v)
        free = self.force / self.inertia
        push = np.linalg.solve((C / self.inertia) @ C.T, -extra - C @ free)
        return np.concatenate([v, free + C.T @ push / self.inertia])

    def start(self, crank: float, speed: float) -> np.ndarray:
        """State for an angle and speed of the crank: circles of coupler and rocker meet above the frame."""
        a, b, c, d = LENGTHS
        pin = a * np.array([np.cos(crank), np.sin(crank)])
        across = np.array([d, 0.0]) - pin
        far = float(np.linalg.norm(across))
        way = (far**2 + b**2 - c**2) / (2 * far)
        e = across / far
        tip = pin + way * e + np.sqrt(b**2 - way**2) * np.array([-e[1], e[0]])
        angles = [crank, np.arctan2(*(tip - pin)[::-1]), np.arctan2(*(tip - [d, 0.0])[::-1])]
        places = [np.zeros(2), pin, np.array([d, 0.0])]
        q = np.concatenate([[*(p + turned(t) @ r), t] for p, t, r in zip(places, angles, CENTRES, strict=True)])
        C, _ = self.constraints(q, np.zeros(9))
        C = np.vstack([C, np.eye(9)[2]])
        return np.concatenate([q, np.linalg.solve(C, np.append(np.zeros(8), speed))])

    def gap(self, x: np.ndarray, floor: float) -> float:
        return float(x[4] + (turned(x[5]) @ (CIRCLE - CENTRES[1]))[1] - RADIUS - floor)

    def run(self, end: float, x: np.ndarray, floor: float, restitution: float) -> tuple[Any, list[float]]:
        """The state over time, and the instants of impacts; without restitution it stays where it strikes."""
        parts, hits, t = [], [], 0.0
        strike = lambda t, x: self.gap(x, floor)  # noqa: E731
        strike.terminal, strike.direction = True, -1
        while t < end:
            part = solve_ivp(
                self.rhs, (t, end), x, rtol=1e-12, atol=1e-13, method="DOP853", events=strike, dense_output=True
            )
            parts.append(part), hits.extend(part.t_events[0])
            t, x = part.t[-1], part.y[:, -1].copy()
            if t < end:
                C, _ = self.constraints(x[:9], x[9:])
                J = self.row(x[:9], x[9:], 1, CIRCLE)[0][1:]
                A = np.vstack([C, J])
                wanted = np.append(np.zeros(8), -(1 + restitution) * float(J[0] @ x[9:]))
                x[9:] += (A.T / self.inertia[:, None]) @ np.linalg.solve((A / self.inertia) @ A.T, wanted)
                if restitution == 0.0:
                    return (lambda s: parts[-1].sol(min(s, hits[-1]))), hits
        return (lambda s: next(p for p in parts if s <= p.t[-1]).sol(s)), hits


START = (0.3, 15.0)


def fast(mod: Any, end: float, h: float, start: tuple[float, float] = START, **guess: float) -> Any:
    given = {"a": start[0], "a_dot": start[1], **guess}
    return mod.simulate(end, given, method="moreau", step=h)


@pytest.mark.parametrize("options", [{}, {"cut": "B"}, {"target": "numpy"}, {"turn": 0.7}], ids=str)
def test_free_flight_is_of_second_order(options: dict[str, Any]) -> None:
    """Errors fall to a quarter with half the step, from h of 0.06 of a radian on; loops are closed to rounding."""
    mod = four_bar(FAR, **options)
    bodies = Bodies()
    end = bodies.rhs  # the crank turns 1.2 times
    exact = solve_ivp(end, (0, 0.5), bodies.start(*START), rtol=1e-12, atol=1e-13, method="DOP853").y[:, -1]
    errors = []
    for h in (2e-3, 1e-3, 5e-4):
        run = fast(mod, 0.5, h)
        assert run.residuals.raw_position < 1e-13
        assert run.residuals.raw_velocity < 1e-11
        errors.append([run["a"][-1] - exact[2], run["a_dot"][-1] - exact[11]])
    ratios = np.abs(errors[:-1]) / np.abs(errors[1:])
    assert ratios.min() > 3.7
    assert ratios.max() < 4.4
    assert abs(errors[1][0]) < 1e-3


@pytest.mark.parametrize("restitution", [0.0, 0.5])
@pytest.mark.parametrize("target", ["cython", "numpy"])
def test_a_bouncing_coupler(restitution: float, target: str) -> None:
    """Impacts lie within a step of their time, and the motion between is off by what such a delay makes of it."""
    floor, start, h = 0.02, (2.5, 0.0), 5e-4
    mod = four_bar(floor, restitution, target=target)
    bodies = Bodies()
    exact, hits = bodies.run(0.48, bodies.start(*start), floor, restitution)
    run = fast(mod, 0.48, h, start)
    assert len(hits) >= (3 if restitution else 1)
    for step in (4e-3, 2e-3, 1e-3, h) if target == "cython" else (2e-3,):
        assert fast(mod, 0.48, step, start).metadata["missed_steps"] == 0
    assert run.residuals.raw_position < 1e-13
    assert run.residuals.raw_velocity < 1e-11
    wanted = np.array([exact(t)[2] for t in run.t])
    np.testing.assert_allclose(run["a"], wanted, atol=12 * h)
    before = run.t < hits[0] - h
    np.testing.assert_allclose(run["a"][before], wanted[before], atol=2e-6)
    angle = run["a"] + run["b"]
    height = LENGTHS[0] * np.sin(run["a"]) + CIRCLE[0] * np.sin(angle) + CIRCLE[1] * np.cos(angle)
    assert np.min(height) - RADIUS - floor > -1e-5


@pytest.mark.parametrize("target", ["numpy", "cython"])
@pytest.mark.parametrize("restitution", [0.0, 0.5, 0.8])
def test_a_coupler_that_friction_jams(restitution: float, target: str) -> None:
    """One freedom: the circle moves along one line, within the cone of friction, so that no impulse brings it back."""
    mod = four_bar(-0.05, restitution, target=target, mu=0.3)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ContactWarning)  # the first solution of the step that jams may be none
        run = mod.simulate(0.55, {"a": 0.3, "a_dot": 4.0}, method="moreau", step=1e-3)
    angle = run["a"] + run["b"]
    centre = np.array([LENGTHS[0] * turned(a)[:, 0] + turned(c) @ CIRCLE for a, c in zip(run["a"], angle, strict=True)])
    last = int(np.flatnonzero(np.abs(run["a_dot"]) > 1e-6)[-1])
    (x, y), turn = centre[last] - centre[last - 1], angle[last] - angle[last - 1]
    assert abs(y) < 0.3 * abs(x + RADIUS * turn)  # how the place that touches moves
    y = centre[:, 1]
    assert y[-1] == pytest.approx(RADIUS - 0.05, abs=1e-3)
    assert np.abs(run.x[mod.n_q :, -1]).max() < 1e-9
    assert np.diff(run["energy"]).max() < 1e-3  # in flight, of second order
    assert run.metadata["missed_steps"] <= 1
    assert run.metadata["contact_residual"] < 1e-9  # contact_tolerance, of speeds below 1 m/s
