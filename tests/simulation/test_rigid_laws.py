"""Rigid contact: laws that hold in every scene, another way of solving, loops, descriptions that mean the same."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
from rigid_scenes import SHAPES, G, pile, rigid, thrown

import eomgen as eg
from eomgen.numeric.contact_impulses import solve_contacts
from eomgen.numeric.contact_problem import ContactProblem

KINDS = ("circle", "box", "triangle", "segment")


def test_energy_never_grows_in_random_scenes() -> None:
    """50 piles, with friction and restitution of any size: no more energy than before, and no shape in another."""
    mod = pile(KINDS).compile()
    rng = np.random.default_rng(7)
    missed = 0
    for k in range(50):
        law = {"mu": rng.uniform(0, 1), "e": (0.0, rng.uniform(0, 1), 1.0)[k % 3]}
        run = mod.simulate(0.2, thrown(rng, 4), law, method="moreau", step=1e-3)
        energy = run["energy"]
        assert np.all(energy <= energy[0] * (1 + 1e-12))
        assert np.max(np.diff(energy)) < 1e-5 * energy[0]  # where a part of a penetration is removed
        assert run.metadata["penetration"] < 1e-3
        missed += run.metadata["missed_steps"]
    assert missed == 0


def test_momentum_is_kept_exactly() -> None:
    """Free bodies that hit each other with friction: the momentum and the moment of momentum stay."""
    mod = pile(KINDS, gravity=0.0, walls=False).compile()
    rng = np.random.default_rng(3)
    m = 1.0 + 0.2 * np.arange(4)
    hits = 0
    for _ in range(5):
        start = thrown(rng, 4) | {f"j{k}_x_dot": -4.0 * (k - 1.5) for k in range(4)}
        run = mod.simulate(0.3, start, {"mu": 0.5, "e": 0.4}, method="moreau", step=1e-3)
        x, y, vx, vy, w = (
            np.array([run[f"j{k}_{n}"] for k in range(4)]) for n in ("x", "y", "x_dot", "y_dot", "3_dot")
        )
        momentum = np.array([m @ vx, m @ vy, m @ (x * vy - y * vx) + 0.01 * w.sum(axis=0)])
        hits += np.abs(np.diff(vx)).max() > 0.1
        np.testing.assert_allclose(momentum[:2], momentum[:2, :1] * np.ones(len(run)), atol=1e-12)
        # the moment is kept about where shapes are in the middle of a step
        np.testing.assert_allclose(momentum[2], momentum[2, 0], atol=1e-11)
    assert hits == 5


def enumerated(W: np.ndarray, c: np.ndarray, mu: np.ndarray) -> list[np.ndarray]:
    """All impulses that obey the laws of contacts in the plane, by trying every combination of states."""
    m, found = len(mu), []
    for states in itertools.product(("open", "stick", "left", "right"), repeat=m):
        A, b = np.zeros((2 * m, 2 * m)), np.zeros(2 * m)
        for i, state in enumerate(states):
            n, t = 2 * i, 2 * i + 1
            A[n], b[n] = (np.eye(2 * m)[n], 0.0) if state == "open" else (W[n], -c[i, 0])
            if state == "stick":
                A[t], b[t] = W[t], -c[i, 1]
            else:
                A[t, t] = 1.0
                A[t, n] = {"open": 0.0, "left": -mu[i], "right": mu[i]}[state]
        P = np.linalg.solve(A, b).reshape(m, 2)
        y = c + (W @ P.ravel()).reshape(m, 2)
        good = [
            {
                "open": y[i, 0] >= 0,
                "stick": P[i, 0] >= 0 and abs(P[i, 1]) <= mu[i] * P[i, 0],
                "left": P[i, 0] >= 0 and y[i, 1] <= 0,
                "right": P[i, 0] >= 0 and y[i, 1] >= 0,
            }[state]
            for i, state in enumerate(states)
        ]
        if all(good):
            found.append(P)
    return found


def test_impulses_as_by_enumeration() -> None:
    """Three contacts in the plane, with all 64 combinations of open, sticking and sliding tried."""
    rng = np.random.default_rng(11)
    for _ in range(100):
        J = rng.standard_normal((6, 9))
        W, c, mu = J @ J.T, rng.standard_normal((3, 2)), rng.uniform(0, 0.6, 3)
        found = solve_contacts(ContactProblem(W, c, mu), np.zeros((3, 2)), 1e-11, 200)
        assert found.residual <= 1e-11
        every = enumerated(W, c, mu)
        assert min(np.abs(P - found.impulses).max() for P in every) < 1e-9


def test_friction_in_space_opposes_sliding() -> None:
    """Random contacts in space obey Signorini's and Coulomb's laws, more contacts than freedoms too."""
    rng = np.random.default_rng(5)
    for columns in (20, 7):
        for _ in range(50):
            J = rng.standard_normal((12, columns))
            v = rng.standard_normal(columns)
            W, c, mu = J @ J.T, (J @ v).reshape(4, 3), rng.uniform(0, 0.5, 4)
            found = solve_contacts(ContactProblem(W, c, mu), np.zeros((4, 3)), 1e-10, 200)
            assert found.residual <= 1e-10
            P, y = found.impulses, c + (W @ found.impulses.ravel()).reshape(4, 3)
            assert P[:, 0].min() >= -1e-9
            assert y[:, 0].min() >= -1e-9
            assert np.abs(P[:, 0] * y[:, 0]).max() < 1e-8
            size = np.linalg.norm(P[:, 1:], axis=1)
            assert np.all(size <= mu * P[:, 0] + 1e-9)
            slip = np.linalg.norm(y[:, 1:], axis=1)
            for i in np.flatnonzero(slip > 1e-6):
                np.testing.assert_allclose(P[i, 1:] * slip[i], -mu[i] * P[i, 0] * y[i, 1:], atol=1e-7)


def linkage(cut: str, target: str = "cython") -> Any:
    """A parallelogram on a floor of its own: its coupler falls and drags on a half-plane."""
    m = eg.Model("linkage", gravity=(0, -G, 0))
    left, coupler, right = (
        m.body(n, mass=1.0, com=(0.2, 0, 0), inertia={"zz": 0.01}) for n in ("left", "coupler", "right")
    )
    m.revolute("A", m.ground, left, coordinate="a")
    m.revolute("B", left.at(0.4, 0, 0), coupler, **({"coordinate": "b"} if cut != "B" else {}))
    m.revolute("C", coupler.at(0.6, 0, 0), right.at(0.4, 0, 0), **({"coordinate": "c"} if cut != "C" else {}))
    m.revolute("D", m.ground.at(0.6, 0, 0), right, coordinate="d")
    m.contacts(
        "drag",
        {"shape": "circle", "radius": 0.05, "on": coupler.at(0.3, 0, 0)},
        {"shape": "half_plane", "on": m.ground.at(0, -0.3, 0)},
        rigid(friction=0.4),
    )
    return m.compile(target=target)


def test_closed_loop_on_the_floor() -> None:
    """A parallelogram falls on its coupler: as the pendulum that it is, with any cut and target."""
    start = {"a": -0.2, "d": -0.2}
    runs = [linkage(cut, target).simulate(1.0, start, method="moreau", step=1e-3)
            for cut, target in (("B", "cython"), ("C", "cython"), ("C", "numpy"))]  # fmt: skip
    for run in runs[1:]:
        np.testing.assert_allclose(run["a"], runs[0]["a"], atol=1e-9)
        np.testing.assert_allclose(run["a_dot"], runs[0]["a_dot"], atol=1e-7)
    first = runs[0]
    # coupler at 0.4 sin(a), in translation: it rests where its circle touches, 0.4 sin(a) = -0.25
    np.testing.assert_allclose(0.4 * np.sin(first["a"][-1]), -0.25, atol=1e-6)
    assert np.min(0.4 * np.sin(first["a"])) > -0.2501
    assert first.residuals.raw_position < 1e-6
    assert first.metadata["missed_steps"] == 0
    # until it lands it is a pendulum: 2 J a'' + m l^2 a'' = -g cos(a) (2 m l/2 + m l)
    inertia, moment = 2 * (0.01 + 0.2**2) + 0.4**2, G * (0.4 + 0.4)
    from scipy.integrate import solve_ivp

    fall = solve_ivp(
        lambda t, x: [x[1], -moment * np.cos(x[0]) / inertia], (0, 0.15), [-0.2, 0.0], rtol=1e-10, atol=1e-12
    )
    k = int(np.searchsorted(first.t, 0.15))
    assert first["a"][k] > np.arcsin(-0.25 / 0.4)
    np.testing.assert_allclose(first["a"][k], fall.y[0, -1], atol=1e-5)


@pytest.mark.parametrize("turn", [0.7, -2.1])
def test_turned_scene(turn: float) -> None:
    """The same pile in axes turned about z, and in reverse order of its shapes, moves alike."""
    rng = np.random.default_rng(2)
    start = thrown(rng, 3)
    law = {"mu": 0.4, "e": 0.2}

    def scene(angle: float, order: int) -> Any:
        c, s = np.cos(angle), np.sin(angle)
        m = eg.Model("turned", gravity=(G * s, -G * c, 0))
        m.parameter("mu", 0.3), m.parameter("e", 0.0)
        base = m.ground.at(0, 0, 0, rpy=(0, 0, angle))
        shapes = []
        for k, kind in enumerate(("circle", "box", "triangle")):
            body = m.body(f"b{k}", mass=1.0 + 0.2 * k, inertia={"zz": 0.01})
            m.planar(f"j{k}", base, body)
            shapes.append({**SHAPES[kind], "on": body})
        both = rigid(friction="mu", restitution="e")
        m.contacts("among", shapes[::order], law=both)
        m.contacts("floor", shapes[::order], {"shape": "half_plane", "on": base}, both)
        return m.compile().simulate(0.3, start, law, method="moreau", step=1e-3)

    plain, other = scene(0.0, 1), scene(turn, -1)
    for name in plain.x_names:
        np.testing.assert_allclose(other[name], plain[name], atol=1e-6)


def test_units() -> None:
    """In millimetres and grams the same motion."""
    runs = []
    for length, mass in ((1.0, 1.0), (1e3, 1e3)):
        m = eg.Model("scaled", gravity=(0, -G * length, 0))
        body = m.body("b", mass=1.0 * mass, inertia={"zz": 0.01 * mass * length**2})
        m.planar("j", m.ground, body)
        box = {"shape": "box", "size": (0.2 * length, 0.14 * length), "on": body}
        m.contacts("c", box, {"shape": "half_plane", "on": m.ground}, rigid(friction=0.4, restitution=0.3))
        start = {"j_y": 0.4 * length, "j_3": 0.3, "j_x_dot": 1.0 * length}
        runs.append(m.compile().simulate(0.6, start, method="moreau", step=1e-3))
    np.testing.assert_allclose(runs[1]["j_x"] / 1e3, runs[0]["j_x"], atol=1e-9)
    np.testing.assert_allclose(runs[1]["j_3"], runs[0]["j_3"], atol=1e-9)
