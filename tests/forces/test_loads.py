"""Each force element between two flying bodies against its formula in NumPy: loads, power, Jacobian, file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import force_bench as bench
import judges
import numpy as np
import pytest
from force_bench import P, Q, Seen, Wrench
from scipy.spatial.transform import Rotation

K, C, U, T = 30.0, 1.5, 0.4, 0.3


def along(P: Seen, Q: Seen, push: float) -> list[Wrench]:
    """A force along the line from P to Q, pushing them apart."""
    d = Q.r - P.r
    force = push * d / np.linalg.norm(d)
    return [Wrench(1, Q.r, force), Wrench(0, P.r, -force)]


def line(P: Seen, Q: Seen) -> tuple[float, float]:
    d = Q.r - P.r
    length = float(np.linalg.norm(d))
    return length, float(d @ (Q.v - P.v) / length)


def test_a_law_by_expression_along_a_line(tmp_path: Path) -> None:
    """A cylinder of gas with a valve: pressure by the length, throttled by the rate, an input beside."""

    def add(m: Any, p: Any, q: Any) -> None:
        m.element("gas", p, q, law="u*cos(t) + k/length**1.3 - c*rate*abs(rate)")

    def loads(p: Seen, q: Seen, *_: Any) -> list[Wrench]:
        length, rate = line(p, q)
        return along(p, q, U * np.cos(T) + K / length**1.3 - C * rate * abs(rate))

    bench.judge(add, loads, None, bench.states(1, 3), tmp_path)


def test_a_law_with_a_potential(tmp_path: Path) -> None:
    def add(m: Any, p: Any, q: Any) -> None:
        m.element("hard", p, q, potential="k*(length - 0.3)**4/4", law="-c*rate**3")

    def loads(p: Seen, q: Seen, *_: Any) -> list[Wrench]:
        length, rate = line(p, q)
        return along(p, q, -K * (length - 0.3) ** 3 - C * rate**3)

    def lost(p: Seen, q: Seen, *_: Any) -> list[Wrench]:
        return along(p, q, -C * line(p, q)[1] ** 3)

    bench.judge(add, loads, lost, bench.states(2, 3), tmp_path)


def small(p: Seen, q: Seen) -> tuple[np.ndarray, np.ndarray, float]:
    """Axis-angle of the rotation from P to Q in P axes: unit axis n, and the angle."""
    turn = Rotation.from_matrix(p.R.T @ q.R).as_rotvec()
    angle = float(np.linalg.norm(turn))
    return turn, turn / angle, angle


def stiffness6() -> np.ndarray:
    random = np.random.default_rng(4)
    A = random.uniform(-1, 1, (6, 6))
    return np.round(A @ A.T + 3 * np.eye(6), 3)


def bushing_wrenches(p: Seen, q: Seen, along: np.ndarray) -> list[Wrench]:
    """Wrenches of six generalized forces on d and theta = 2 sin(phi / 2) n, with theta differentiated numerically."""
    R = p.R.T @ q.R

    def theta(columns: np.ndarray) -> np.ndarray:
        turned = [Rotation.from_rotvec(c).as_matrix() @ R for c in columns.T]
        vectors = [Rotation.from_matrix(x).as_rotvec() for x in turned]
        return np.stack([2 * np.sin(np.linalg.norm(x) / 2) * x / np.linalg.norm(x) for x in vectors], axis=1)

    slope = np.stack([judges.first(theta, np.zeros(3), e, h=1e-2) for e in np.eye(3)], axis=1)
    force, torque = p.R @ along[:3], p.R @ slope.T @ along[3:]
    return [Wrench(1, q.r, force, torque), Wrench(0, q.r, -force, -torque)]


def bushing_rates(p: Seen, q: Seen) -> np.ndarray:
    d = p.R.T @ (q.v - p.v - np.cross(p.w, q.r - p.r))
    w = p.R.T @ (q.w - p.w)
    R = p.R.T @ q.R

    def theta(times: np.ndarray) -> np.ndarray:
        vectors = [Rotation.from_matrix(Rotation.from_rotvec(w * s).as_matrix() @ R).as_rotvec() for s in times[0]]
        return np.stack([2 * np.sin(np.linalg.norm(x) / 2) * x / np.linalg.norm(x) for x in vectors], axis=1)

    return np.concatenate([d, judges.first(theta, np.zeros(1), np.ones(1), h=1e-2)])


@pytest.mark.parametrize("full", [True, False])
def test_a_bushing(full: bool, tmp_path: Path) -> None:
    S = stiffness6() if full else np.diag([1.0, 2, 3, 4, 5, 6])
    D = 0.1 * S + (np.triu(np.full((6, 6), 0.02), 1) if full else 0)

    def add(m: Any, p: Any, q: Any) -> None:
        if full:
            m.bushing("mount", p, q, stiffness=S.tolist(), damping=D.tolist())
        else:
            m.bushing("mount", p, q, [1, 2, 3, 4, "k/6", 6], damping=np.diag(D))

    def parts(p: Seen, q: Seen) -> tuple[np.ndarray, np.ndarray]:
        _, n, angle = small(p, q)
        return np.concatenate([p.R.T @ (q.r - p.r), 2 * np.sin(angle / 2) * n]), bushing_rates(p, q)

    def loads(p: Seen, q: Seen, *_: Any) -> list[Wrench]:
        y, rate = parts(p, q)
        return bushing_wrenches(p, q, -S @ y - D @ rate)

    def lost(p: Seen, q: Seen, *_: Any) -> list[Wrench]:
        return bushing_wrenches(p, q, -D @ parts(p, q)[1])

    bench.judge(add, loads, lost, bench.states(3, 3), tmp_path)


@pytest.mark.parametrize("extent", ["point", "maccullagh"])
def test_gravity_of_a_point_of_one_body_on_another(extent: str, tmp_path: Path) -> None:
    def add(m: Any, p: Any, q: Any) -> None:
        m.point_gravity("pull", p, "b", mu="k/10", extent=extent)

    def loads(p: Seen, q: Seen, bodies: judges.Bodies, t: float) -> list[Wrench]:
        """The force by differences of the sum over six point masses with the body's mass, centre and inertia."""
        center = bodies.point(1, bench.CENTERS[1])[0]
        mu, mass = K / 10, bench.MASSES[1]
        d = center - p.r
        if extent == "point":
            force = -mu * mass * d / np.linalg.norm(d) ** 3
            return [Wrench(1, center, force), Wrench(0, p.r, -force)]
        J = bodies.R[1] @ np.diag(bench.INERTIAS[1]) @ bodies.R[1].T

        def energy(columns: np.ndarray) -> np.ndarray:  # of displacements and turns of the body
            found = []
            for c in columns.T:
                turn = Rotation.from_rotvec(c[3:]).as_matrix()
                r = d + c[:3]
                s = np.linalg.norm(r)
                along = r @ turn @ J @ turn.T @ r / s**2
                found.append(-mu * mass / s - mu / (2 * s**3) * (np.trace(J) - 3 * along))
            return np.array([found])

        slope = np.array([judges.first(energy, np.zeros(6), e, h=5e-3)[0] for e in np.eye(6)])
        return [
            Wrench(1, center, -slope[:3], -slope[3:]),
            Wrench(0, center, slope[:3], slope[3:]),  # the opposite, carried to the centre that attracts
        ]

    bench.judge(add, loads, lambda *_: [], bench.states(5, 3, reach=1.5), tmp_path, digits=1e-8)


def hunt_crossley(depth: float, rate: float, k: float, n: float, factor: float) -> tuple[float, float]:
    """Force, and its elastic part."""
    elastic = k * max(depth, 0.0) ** n
    return elastic * max(0.0, 1 + factor * rate), elastic


def rub(sliding: np.ndarray, mu: float, static: float, stribeck: float, viscous: float, smoothing: float) -> np.ndarray:
    """Friction per normal force."""
    s = np.linalg.norm(sliding)
    level = mu + (static - mu) * np.exp(-((s / stribeck) ** 2))
    return -(level / np.hypot(s, smoothing) + viscous) * sliding


CONTACTS = {
    "point_plane": {},
    "sphere_plane": {"radius": 0.25},
    "sphere_sphere": {"radii": (0.4, "k/90")},
}
LAW = {"stiffness": 400, "exponent": 1.5, "restitution": 0.6, "velocity": 2, "formula": "flores"}
RUB = {"friction": 0.3, "static_friction": 0.5, "stribeck": 0.2, "viscous_friction": 0.1, "smoothing": 0.05}


@pytest.mark.parametrize("kind", CONTACTS)
def test_contact_of_two_bodies(kind: str, tmp_path: Path) -> None:
    factor = 8 * 0.4 / (5 * 0.6 * 2)

    def add(m: Any, p: Any, q: Any) -> None:
        getattr(m, kind)("touch", p, q, **CONTACTS[kind], **LAW, **RUB)

    def geometry(p: Seen, q: Seen) -> tuple[np.ndarray, float, np.ndarray]:
        if kind == "sphere_sphere":
            d = q.r - p.r
            n = d / np.linalg.norm(d)
            return n, 0.4 + K / 90 - np.linalg.norm(d), p.r + n * (0.4 + np.linalg.norm(d) - K / 90) / 2
        radius = CONTACTS[kind].get("radius", 0.0)
        n = p.R[:, 2]
        gap = n @ (q.r - p.r) - radius
        return n, -gap, q.r - n * (radius + gap / 2)

    def pieces(p: Seen, q: Seen, bodies: judges.Bodies) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        n, depth, point = geometry(p, q)
        relative = (q.v + np.cross(q.w, point - q.r)) - (p.v + np.cross(p.w, point - p.r))
        sliding = relative - n * (n @ relative)
        full, elastic = hunt_crossley(depth, -n @ relative, 400, 1.5, factor)
        drag = full * rub(sliding, 0.3, 0.5, 0.2, 0.1, 0.05)
        return point, full * n + drag, (full - elastic) * n + drag

    def loads(p: Seen, q: Seen, bodies: judges.Bodies, t: float) -> list[Wrench]:
        point, force, _ = pieces(p, q, bodies)
        return [Wrench(1, point, force), Wrench(0, point, -force)]

    def lost(p: Seen, q: Seen, bodies: judges.Bodies, t: float) -> list[Wrench]:
        point, _, force = pieces(p, q, bodies)
        return [Wrench(1, point, force), Wrench(0, point, -force)]

    bare = bench.flyers().compile(target="numpy")
    touching, apart = [], []
    heights = np.random.default_rng(6).uniform(-0.4, 0.9, 60)
    for x, height in zip(bench.states(6, 60, reach=0.35), heights, strict=True):
        x[8] += height
        bodies = judges.Bodies(bare, x[:12], x[12:])
        p, q = bench.see(bodies, 0, P), bench.see(bodies, 1, Q)
        depth = geometry(p, q)[1]
        if depth > 0.02 and np.linalg.norm(pieces(p, q, bodies)[1]) > 1:
            touching.append(x)
        elif depth < -0.02:
            apart.append(x)
    assert len(touching) > 3
    assert apart
    bench.judge(add, loads, lost, [*touching[:4], apart[0]], tmp_path)


def hill(length: float, rate: float, a: float, alpha: float, v_max: float) -> float:
    """Pull of the muscle by SymPy's own curves."""
    import sympy
    from sympy.physics import biomechanics

    x = sympy.Symbol("x")
    active, passive, speed = (
        sympy.lambdify(x, getattr(biomechanics, f"Fiber{name}DeGroote2016").with_defaults(x).doit(), "math")
        for name in ("ForceLengthActive", "ForceLengthPassive", "ForceVelocity")
    )
    opt, slack = 0.25, 0.3
    fiber = np.hypot(length - slack, opt * np.sin(alpha))
    tilt = (length - slack) / fiber
    l, v = fiber / opt, rate * tilt / v_max
    return float(50.0 * (a * active(l) * speed(v) + passive(l) + 0.05 * v) * tilt)


@pytest.mark.parametrize(("alpha", "speed"), [(0.0, 2.0), (0.4, 2.0), (0.4, None)])
def test_a_muscle(alpha: float, speed: float | None, tmp_path: Path) -> None:
    """Fibres of 0.25 m shorten at most 10 times that a second if nothing is said (De Groote and others, 2016)."""
    keys = {} if speed is None else {"velocity_max": speed}

    def add(m: Any, p: Any, q: Any) -> None:
        m.muscle(
            "flexor", p, q, activation="u*exp(-t)", force_max=50, fiber_length=0.25, slack_length=0.3,
            pennation=alpha, damping=0.05, **keys,
        )  # fmt: skip

    def loads(p: Seen, q: Seen, *_: Any) -> list[Wrench]:
        return along(p, q, -hill(*line(p, q), U * np.exp(-T), alpha, speed or 2.5))

    bench.judge(add, loads, None, bench.states(7, 2), tmp_path)
