"""Force elements against closed forms and wrenches made in NumPy: loads, energy, power, derivatives, faults."""

from pathlib import Path
from typing import Any

import force_judges as bench
import judges
import models
import numpy as np
import pytest
import sympy
from force_judges import TREE_METHODS, P, Q, Seen, Wrench, problems, read_back
from refusals import refused, refuses
from scipy.spatial.transform import Rotation
from sweeps import TARGETS
from sympy.physics import biomechanics

import eomgen as eg


@pytest.mark.quick
@pytest.mark.parametrize("method", TREE_METHODS)
@pytest.mark.parametrize("length", [0.0, 0.4])
def test_a_mass_on_a_spring(method: str, length: float) -> None:
    """V = k (s - s0)^2 / 2 with the distance s = sqrt(x^2 + h^2); m x'' = -k (s - s0) x / s."""
    k, h, mass = 30.0, 0.5, 2.0
    m = eg.Model("spring", gravity=(0, 0, 0))
    body = m.body("body", mass=mass)
    m.prismatic("J", m.ground, body, axis="x", coordinate="x")
    m.spring("S", m.ground.at(0, h, 0), body, stiffness=k, length=length)
    mod = m.compile(method=method, target="numpy")
    for x, v in ((0.8, 1.5), (-0.3, 0.2)):
        s = np.hypot(x, h)
        assert mod.energy(np.array([x, v])) == pytest.approx([mass * v**2 / 2, k * (s - length) ** 2 / 2], rel=1e-13)
        assert mod.rhs(0.0, np.array([x, v])) == pytest.approx([v, -k * (s - length) * x / s / mass], rel=1e-12)


@pytest.mark.parametrize("method", TREE_METHODS)
def test_a_torsion_spring_and_a_stop(method: str) -> None:
    """V = c (a - a0)^2 / 2 below the stop, with K d^(n+1) / (n + 1) of the penetration d beyond it."""
    c, rest, K, n, limit, inertia = 7.0, 0.2, 400.0, 1.5, 0.9, 0.3
    m = eg.Model("turn", gravity=(0, 0, 0))
    wheel = m.body("wheel", mass=1.0, inertia={"zz": inertia})
    m.revolute("J", m.ground, wheel, coordinate="a")
    m.torsional_spring("S", "J", stiffness=c, angle=rest)
    m.stop("end", joint="J", upper=limit, stiffness=K, exponent=n, dissipation=0.0)
    mod = m.compile(method=method, target="numpy")
    for a in (0.5, 1.1):
        d = max(a - limit, 0.0)
        V = c * (a - rest) ** 2 / 2 + K * d ** (n + 1) / (n + 1)
        assert mod.energy(np.array([a, 0.4]))[1] == pytest.approx(V, rel=1e-13)
        assert mod.rhs(0.0, np.array([a, 0.4]))[1] == pytest.approx(-(c * (a - rest) + K * d**n) / inertia, rel=1e-12)


@pytest.mark.quick
@pytest.mark.parametrize("side", ["lower", "upper"])
@pytest.mark.parametrize("rate", [-0.8, 0.5])
def test_a_lower_stop_brakes(side: str, rate: float) -> None:
    """Hunt and Crossley: K d^n (1 + f d') of the penetration d and its rate, at either end."""
    K, n, f, inertia = 400.0, 1.5, 0.6, 0.3
    m = eg.Model("ends", gravity=(0, 0, 0))
    m.revolute("J", m.ground, m.body("wheel", mass=1.0, inertia={"zz": inertia}), coordinate="a")
    m.stop("end", joint="J", **{side: 0.0}, stiffness=K, exponent=n, dissipation=f)
    mod = m.compile(target="numpy")
    inward, d = (-1.0 if side == "lower" else 1.0), 0.2
    push = K * d**n * (1.0 + f * inward * rate)
    assert mod.rhs(0.0, np.array([inward * d, rate]))[1] == pytest.approx(-inward * push / inertia, rel=1e-12)


@pytest.mark.parametrize("method", TREE_METHODS)
def test_springs_and_dampers_on_coordinates(method: str) -> None:
    """On both coordinates of a cylindrical joint: m z'' = -k (z - z0) - c z', I a'' = -K a, V the sum of both."""
    k, rest, c, K, mass, inertia = 30.0, 0.2, 1.5, 4.0, 2.0, 0.3
    m = eg.Model("piston", gravity=(0, 0, 0))
    piston = m.body("piston", mass=mass, inertia=(1, 1, inertia))
    m.cylindrical("C", m.ground, piston, coordinates=["z", "a"])
    m.joint_spring("S", "z", stiffness=k, rest=rest)
    m.joint_spring("T", "a", stiffness=K)
    m.joint_damper("D", "z", c)
    mod = m.compile(method=method, target="numpy")
    z, a, v, w = 0.5, 0.7, 0.3, -0.4
    x = np.array([z, a, v, w])
    V = k * (z - rest) ** 2 / 2 + K * a**2 / 2
    assert mod.energy(x) == pytest.approx([mass * v**2 / 2 + inertia * w**2 / 2, V], rel=1e-13)
    assert mod.rhs(0.0, x) == pytest.approx([v, w, (-k * (z - rest) - c * v) / mass, -K * a / inertia], rel=1e-12)


@pytest.mark.quick
@pytest.mark.parametrize("method", TREE_METHODS)
@pytest.mark.parametrize("axes", ["ground", "body"])
def test_a_force_on_a_lever(axes: str, method: str) -> None:
    """In body axes its moment l F_y does not depend on the angle; in ground axes it is l (F_y cos - F_x sin)."""
    l, inertia, force = 0.7, 0.4, (3.0, 2.0)
    m = eg.Model("lever", gravity=(0, 0, 0))
    lever = m.body("lever", mass=1.0, inertia={"zz": inertia})
    m.revolute("J", m.ground, lever, coordinate="a")
    m.force("F", lever.at(l, 0, 0), (*force, 0), axes=axes)
    mod = m.compile(method=method, target="numpy")
    for a in (0.4, 2.1):
        moment = l * (force[1] if axes == "body" else force[1] * np.cos(a) - force[0] * np.sin(a))
        assert mod.rhs(0.0, np.array([a, 0.0]))[1] == pytest.approx(moment / inertia, rel=1e-13)


@pytest.mark.parametrize("axes", ["ground", "body"])
def test_a_torque_in_the_axes_of_a_turned_marker(axes: str) -> None:
    """Euler: J w' = R_m T in the axes of the marker, R^T T in those of ground, at rest and in body axes."""
    inertia, torque, rpy = np.array([0.5, 0.8, 1.1]), np.array([1.0, -0.6, 0.3]), (0.4, -0.7, 1.2)
    m = eg.Model("spinner", gravity=(0, 0, 0))
    body = m.body("body", mass=1.0, inertia=tuple(inertia))
    m.spherical("J", m.ground, body, rotation="euler_parameters")
    m.torque("T", body.marker("tool", at=(0.1, 0, 0), rpy=rpy), tuple(torque), axes=axes)
    mod = m.compile(target="numpy")
    turn = Rotation.from_euler("xyz", [0.9, 0.2, -0.5])
    x = np.concatenate([turn.as_quat(scalar_first=True), np.zeros(3)])
    own = Rotation.from_euler("xyz", rpy).apply(torque) if axes == "body" else turn.inv().apply(torque)
    assert mod.rhs(0.0, x)[4:] == pytest.approx(own / inertia, rel=1e-12)


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


def curves(module: str) -> list[Any]:
    """SymPy's own curves of a muscle: active and passive force by length, force by velocity."""
    x = sympy.Symbol("x")
    names = (f"Fiber{name}DeGroote2016" for name in ("ForceLengthActive", "ForceLengthPassive", "ForceVelocity"))
    return [sympy.lambdify(x, getattr(biomechanics, name).with_defaults(x).doit(), module) for name in names]


def test_the_curves_of_the_muscle() -> None:
    """Against published values and SymPy's classes over their whole range, at a pull of 1 N and fibres of 1 m."""
    m = eg.Model("muscle", gravity=(0, 0, 0))
    b = m.body("b", mass=1)
    m.prismatic("s", m.ground, b, axis="x")
    m.parameter("a", 1.0)
    sizes = {"force_max": 1, "fiber_length": 1, "slack_length": 1, "velocity_max": 1, "damping": 0}
    m.muscle("pull", m.ground.at(-1, 0, 0), b, activation="a", **sizes)
    mod = m.compile(target="numpy")

    def pull(length: Any, rate: Any, a: float) -> np.ndarray:
        return -mod.rhs(0.0, np.array(np.broadcast_arrays(length, rate), dtype=float), p={"a": a})[1]

    active, passive, speed = curves("numpy")
    values = models.reference("muscle_lever_sympy")["curve_values"]
    for key, found in (
        ("fl_act", lambda x: (pull(x, 0.0, 1.0) - pull(x, 0.0, 0.0)) / speed(0.0)),
        ("fl_pas", lambda x: pull(x, 0.0, 0.0)),
        ("fv", lambda x: (pull(1.0, x, 1.0) - pull(1.0, x, 0.0)) / active(1.0)),
    ):
        for at, value in values[key].items():
            assert found(np.array([float(at)]))[0] == pytest.approx(value, abs=6e-10)
    lengths, rates = np.linspace(0.3, 1.7, 60), np.linspace(-1.2, 1.7, 60)
    expected = active(lengths) * speed(rates) + passive(lengths)
    np.testing.assert_allclose(pull(lengths, rates, 1.0), expected, rtol=1e-12, atol=1e-14)


def hill(length: float, rate: float, a: float, alpha: float, v_max: float) -> float:
    """Pull of the muscle by SymPy's curves."""
    active, passive, speed = curves("math")
    opt, slack = 0.25, 0.3
    fiber = np.hypot(length - slack, opt * np.sin(alpha))
    tilt = (length - slack) / fiber
    l, v = fiber / opt, rate * tilt / v_max
    return float(50.0 * (a * active(l) * speed(v) + passive(l) + 0.05 * v) * tilt)


@pytest.mark.parametrize(("alpha", "speed"), [(0.4, 2.0), (0.4, None)])
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


def slider() -> tuple[eg.Model, Any]:
    m = eg.Model("slider")
    b = m.body("b", mass=1)
    m.prismatic("s", m.ground, b, axis="x")
    return m, b


@pytest.mark.parametrize("target", TARGETS)
def test_a_force_that_is_undefined_is_named(target: str) -> None:
    m, b = slider()
    m.damper("oil", m.ground, b, damping=1)
    m.spring("strut", m.ground.at(1, 0, 0), b, stiffness=2, length=1)
    m.sphere_sphere("balls", m.ground.at(2, 0, 0), b, radii=(0.1, 0.1), stiffness=10)
    m.element("root", "s", law="sqrt(length + 5)")
    m.spring("soft", m.ground.at(3, 0, 0), b, stiffness=2)  # without a free length its ends may meet
    m.friction("rub", "s", viscous=1)
    mod = m.compile(target=target, **({} if target == "numpy" else {"optimize": 0}))
    for s, name in ((0.0, "oil"), (1.0, "strut"), (2.0, "balls"), (-6.0, "root")):
        for call in (mod.rhs, mod.jacobian):
            refuses(f"EG-NOT-FINITE {name}", call, 0.0, np.array([s, 0.5]))
    assert np.isfinite(mod.rhs(0.0, np.array([3.0, 0.5]))).all()
    refuses("EG-NOT-FINITE oil", mod.simulate, (0, 1), initial={"s": 0.0, "s_dot": 1.0})


@pytest.mark.quick
def test_faults_of_laws_are_reported_together() -> None:
    m, b = slider()
    m.parameter("small", -0.1)
    m.friction("f2", "s", coulomb=1)
    m.friction("f3", "s", coulomb=1, smoothing="small")
    m.friction("f4", "s", coulomb=1, smoothing=0.1, static=2)
    m.friction("f5", "s", friction_law="brown_mcphee", transition=1)
    m.stop("s1", "s", stiffness=1)
    m.stop("s2", "s", stiffness=-1, lower=1, upper=0, exponent=0.5)
    m.point_plane("c1", m.ground, b, stiffness=1, restitution=0.5)
    m.point_plane("c2", m.ground, b, stiffness=1, restitution=1.5, velocity=1)
    m.point_plane("c3", m.ground, b, stiffness=1, dissipation=1, formula="flores")
    m.point_plane("c4", m.ground, b, stiffness=1, smoothing=0.1)
    m.sphere_plane("c5", m.ground, b, radius=0, stiffness=1)
    m.sphere_sphere("c6", m.ground, b, radii=(1, 2, 3), stiffness=1)
    m.bushing("b1", m.ground, b, stiffness=[1, 2, 3])
    m.bushing("b2", m.ground, b, stiffness=np.triu(np.ones((6, 6))).tolist())
    m.point_gravity("g1", b, "b", mu=1)
    m.point_gravity("g2", m.ground, "c", mu=1)
    m.muscle("m1", m.ground, b, activation=2, force_max=1, fiber_length=0, slack_length=1)
    told = {path.removeprefix("forces."): text for path, text in problems(m).items()}
    expected = {
        "f2.smoothing": "is missing", "f3.smoothing": "is -0.1", "f4.stribeck": "is missing",
        "f5.friction_law": "give coulomb, or leave friction_law out", "f5.transition": "is given without coulomb",
        "s1": "has no limit", "s2.stiffness": "is -1", "s2.upper": "this is upper - lower", "s2.exponent": "is 0.5",
        "c1.velocity": "give restitution and velocity together", "c2.restitution": "is 1.5",
        "c3.formula": "dissipation is given too", "c4.friction": "is missing",
        "c5.radius": "is 0", "c6.radii": "two numbers", "b1.stiffness": "six numbers",
        "b2.stiffness[1][0]": "not symmetric", "g1.center": "lies on 'b' itself", "g2.body": "no body 'c'",
        "m1.activation": "is 2", "m1.fiber_length": "is 0",
    }  # fmt: skip
    for path, words in expected.items():
        assert words in told.get(path, f"nothing at {path}: {told}") or "is " + words in told[path]
    assert {path for path in told if not path.startswith("b2")} == set(expected) - {"b2.stiffness[1][0]"}


def test_files_know_every_element(tmp_path: Path) -> None:
    m, b = slider()
    drum = {"around": m.ground.at(0.5, 1, 0), "radius": 0.1, "sense": "negative"}
    m.parameter("k", 3.0)
    m.input("a", 0.5)
    far = m.ground.at(0, 2, 0)
    m.spring("e1", far, b, stiffness="k", length=1, via=[drum, m.ground.at(1, 1, 0), b.at(0, 0.1, 0)])
    m.damper("e2", far, b, damping=1, via=[drum])
    m.actuator("e3", far, b, "a*t", via=[drum])
    m.element("e4", "s", law="-k*length", potential="k*length**4")
    m.bushing("e5", far, b, stiffness=[1, 1, 1, 1, 1, "k"], damping=(0.1 * np.eye(6)).tolist())
    m.point_gravity("e6", far, b, mu="k", extent="maccullagh")
    m.stop("e7", "s", lower=-1, stiffness=10, restitution=0.5, velocity="k", formula="lankarani")
    m.friction("e8", "s", coulomb=1, static="k", stribeck=1, smoothing=0.1)
    m.point_plane("e9", m.ground, b, stiffness=1, friction="a", smoothing=0.1)
    m.sphere_plane("e10", m.ground, b, radius="k/100", stiffness=1, exponent=1)
    m.sphere_sphere("e11", far, b, radii=("k", 0.1), stiffness=1)
    m.muscle("e12", far, b, activation="a", force_max=1, fiber_length=1, slack_length=1, via=[drum])
    again = read_back(m, tmp_path)
    assert again.to_yaml() == m.to_yaml()
    x = np.array([0.3, 0.7])
    np.testing.assert_array_equal(again.compile(target="numpy").rhs(0.2, x), m.compile(target="numpy").rhs(0.2, x))


def test_an_angle_between_axes_that_do_not_stay_in_line_is_refused() -> None:
    m = eg.Model("skew")
    b = m.body("b", mass=1, inertia=(1, 1, 1))
    m.spherical("ball", m.ground, b)
    m.torsional_element("motor", m.ground, b, law="-rate")
    refuses("EG-UNDEFINED forces.motor", m.compile, target="numpy")


def test_a_torque_on_a_length_is_a_force_in_newton() -> None:
    """6 N on a coordinate s along (0, 3, 4) / 5 do what the force of 6 N along that line does: 3 m/s^2 of 2 kg."""
    rates = []
    for kind in ("torque", "actuator", "force"):
        m = eg.Model("pushed")
        m.prismatic("s", m.ground, b := m.body("b", mass=2), axis=(0, 3, 4))
        where = b if kind == "force" else "s"
        getattr(m, kind)("push", where, value=(0, 3.6, 4.8) if kind == "force" else 6)
        rates.append(m.compile(target="numpy").rhs(0.0, [0.0, 0.0])[1])
    np.testing.assert_allclose(rates, 3.0, rtol=1e-14)


def test_a_force_on_a_joint_is_refused_with_the_remedy(tmp_path: Path) -> None:
    m, _ = slider()
    m.force("push", "s", (1, 0, 0))
    refuses("EG-TYPE forces.push.marker s", m.check)
    m, b = slider()
    handle = m.revolute("r", b, m.body("c", mass=1))
    refuses("EG-TYPE push", m.force, "push", handle, (1, 0, 0))
    file = tmp_path / "slider.yaml"
    file.write_text(slider()[0].to_yaml() + "forces: {push: {type: force, joint: s, value: 3}}\n")
    with refused("EG-TYPE forces.push.joint") as caught:
        eg.load(file).check()
    assert len(caught.value.problems) == 1
