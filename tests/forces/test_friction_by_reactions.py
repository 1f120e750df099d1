"""Friction by the reaction of a joint, against Newton's and Euler's equations of single bodies, solved by SciPy."""

from functools import cache

import models
import numpy as np
import pytest
from refusals import refuses
from scipy.optimize import brentq, fsolve
from sweeps import METHODS, part_of

import eomgen as eg

G, SMOOTH = 9.81, 1e-2


def pendulum(mu: float | str = 0.3, **friction) -> eg.Model:
    m = eg.Model("pin", gravity=(0, -G, 0))
    m.parameter("mu", 0.3)
    m.output("rub", "force(pin)")
    rod = m.body("rod", mass=2.0, inertia={"zz": 0.3}, com=(0.4, 0, 0))
    m.revolute("A", m.ground, rod)
    m.friction("pin", joint="A", coefficient=mu, radius=0.05, smoothing=SMOOTH, **friction)
    return m


@cache
def pin() -> eg.Module:
    return pendulum("mu").compile(target="numpy")


def pendulum_truth(mu: float, angle: float, rate: float) -> float:
    """The pin's force follows from the acceleration of the centre of mass, which the pin's friction changes."""

    def balance(acceleration: float) -> float:
        along = -0.4 * (acceleration * np.sin(angle) + rate**2 * np.cos(angle))
        up = 0.4 * (acceleration * np.cos(angle) - rate**2 * np.sin(angle))
        pin = 2.0 * np.hypot(along, up + G)
        turn = (0.3 + 2.0 * 0.4**2) * acceleration + 2.0 * G * 0.4 * np.cos(angle)
        return turn + mu * 0.05 * pin * np.tanh(rate / SMOOTH)

    return brentq(balance, -1e3, 1e3, xtol=1e-13, rtol=1e-14)


@pytest.mark.parametrize(("angle", "rate"), [(0.7, 1.3), (-2.1, -4.0), (0.2, 0.004), (1.0, 0.0)])
def test_pendulum_on_a_pin(angle, rate):
    mod, x, h = pin(), [angle, rate], 1e-6
    assert mod.rhs(0.0, x)[1] == pytest.approx(pendulum_truth(0.3, angle, rate), rel=1e-12)
    slope = (pendulum_truth(0.3 + h, *x) - pendulum_truth(0.3 - h, *x)) / (2 * h)
    assert mod.jacobian(0.0, x, wrt="p")[1] == pytest.approx([slope], rel=1e-7, abs=1e-12)
    load = np.linalg.norm(mod.reactions(0.0, x)[0, :3])
    assert mod.outputs(0.0, x)[0] == pytest.approx(-0.3 * 0.05 * load * np.tanh(rate / SMOOTH), rel=1e-12)


def planar_system(bodies, joints, forces, guides=()):
    """Accelerations and reactions of bodies in a plane, each set free: unknown are (ax, ay, alpha) and joint forces.

    ``bodies``: (mass, inertia).  ``joints``: (first, second, arms from the centres of mass, their spins, friction),
    where friction(F) is the torque on the second.  ``forces``: (fx, fy, torque) on each body.  ``guides``: (body,
    normal, friction), where friction(N) is the force along the guide; the guided body does not turn.
    """
    n, k = len(bodies), len(joints)

    def residual(z):
        a, F, N = z[: 3 * n].reshape(n, 3), z[3 * n : 3 * n + 2 * k].reshape(k, 2), z[3 * n + 2 * k :].reshape(-1, 2)
        left = [np.array([m * a[i, 0], m * a[i, 1], J * a[i, 2]]) - forces[i] for i, (m, J) in enumerate(bodies)]
        held = []
        for j, (first, second, arms, spins, friction) in enumerate(joints):
            points = []
            for body, arm, spin, sign in zip((first, second), arms, spins, (-1.0, 1.0), strict=True):
                if body is None:
                    points.append(np.zeros(2))
                    continue
                push, turn = sign * F[j], sign * friction(F[j])
                left[body] = left[body] - [*push, arm[0] * push[1] - arm[1] * push[0] + turn]
                points.append(a[body, :2] + a[body, 2] * np.array([-arm[1], arm[0]]) - spin**2 * np.asarray(arm))
            held.append(points[1] - points[0])
        for (body, normal, friction), (force, moment) in zip(guides, N, strict=True):
            along = np.array([normal[1], -normal[0]])
            left[body] = left[body] - [*(force * np.asarray(normal) + friction(force) * along), moment]
            held.append(np.array([a[body, :2] @ normal, a[body, 2]]))
        return np.concatenate([*left, *held])

    z, _, _, message = fsolve(residual, np.zeros(3 * n + 2 * k + 2 * len(guides)), xtol=1e-14, full_output=True)
    assert np.abs(residual(z)).max() < 1e-8, message
    return z[: 3 * n].reshape(n, 3), z[3 * n : 3 * n + 2 * k].reshape(k, 2), z[3 * n + 2 * k :].reshape(-1, 2)


def chain(links: int, mu: float) -> eg.Model:
    m = eg.Model("chain", gravity=(0, -G, 0))
    before = m.ground
    for k in range(links):
        body = m.body(f"rod{k}", mass=1.0 + 0.3 * k, inertia={"zz": 0.02 + 0.01 * k}, com=(0.2, 0, 0))
        m.revolute(f"A{k}", before if k == 0 else before.at(0.5, 0, 0), body)
        m.friction(f"pin{k}", joint=f"A{k}", coefficient=mu, radius=0.04 + 0.01 * k, smoothing=SMOOTH)
        before = body
    return m


@pytest.mark.parametrize(
    ("method", "target"),
    part_of(
        [
            *((m, "numpy") for m in METHODS if m not in ("augmented", "amalgamated", "hamilton")),
            ("embedding", "cython"),
        ],
        [("embedding", "numpy"), ("recursive", "numpy")].__contains__,
    ),
)
def test_chain_of_four(method, target):
    mu, n = 0.35, 4
    mod = chain(n, mu).derive(method).compile(target=target, **({} if target == "numpy" else {"optimize": 0}))
    random = np.random.default_rng(3)
    for _ in range(4):
        q, v = random.uniform(-2, 2, n), random.uniform(-3, 3, n)
        angle, spin = np.cumsum(q), np.cumsum(v)
        axis = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        bodies = [(1.0 + 0.3 * k, 0.02 + 0.01 * k) for k in range(n)]
        joints = []
        for k in range(n):
            arms = (0.3 * axis[k - 1], -0.2 * axis[k])
            spins = (spin[k - 1] if k else 0.0, spin[k])

            def rubs(F, k=k, rate=v[k]):
                return -mu * (0.04 + 0.01 * k) * np.hypot(*F) * np.tanh(rate / SMOOTH)

            joints.append((k - 1 if k else None, k, arms, spins, rubs))
        a, F, _ = planar_system(bodies, joints, [np.array([0.0, -G * m, 0.0]) for m, _ in bodies])
        x = np.concatenate([q, v])
        assert np.cumsum(mod.rhs(0.0, x)[n:]) == pytest.approx(a[:, 2], rel=1e-8, abs=1e-8)
        assert mod.reactions(0.0, x)[:, :2] == pytest.approx(F, rel=1e-8, abs=1e-8)


def slider_crank(mu: float, pins: float) -> eg.Model:
    m = eg.Model("engine", gravity=(0, -G, 0))
    crank = m.body("crank", mass=1.0, inertia={"zz": 0.01}, com=(0.05, 0, 0))
    rod = m.body("rod", mass=0.8, inertia={"zz": 0.02}, com=(0.15, 0, 0))
    piston = m.body("piston", mass=0.5, inertia={"zz": 0.001})
    models.join_slider_crank(m, (crank, rod, piston), 0.1, 0.3, "theta - s", guide="S")
    m.initial(theta=0.8, theta_dot=20.0)
    m.guess(s=0.35)
    m.friction("guide", joint="S", coefficient=mu, smoothing=SMOOTH)
    for name in "ABC":
        m.friction(f"pin{name}", joint=name, coefficient=pins, radius=0.02, smoothing=SMOOTH)
    return m


def engine_truth(mu: float, pins: float, theta: float, spin: float):
    """Accelerations of the crank and the piston, the forces in A, B, C and the side force of the piston."""
    lean = -np.arcsin(0.1 * np.sin(theta) / 0.3)
    lean_rate = -0.1 * np.cos(theta) * spin / (0.3 * np.cos(lean))
    crank, rod = (np.array([np.cos(x), np.sin(x)]) for x in (theta, lean))
    slide = -0.1 * np.sin(theta) * spin - 0.3 * np.sin(lean) * lean_rate
    rates = (spin, lean_rate - spin, -lean_rate)

    def pin(k):
        return lambda F: -pins * 0.02 * np.hypot(*F) * np.tanh(rates[k] / SMOOTH)

    joints = [
        (None, 0, ((0, 0), -0.05 * crank), (0.0, spin), pin(0)),
        (0, 1, (0.05 * crank, -0.15 * rod), (spin, lean_rate), pin(1)),
        (1, 2, (0.15 * rod, (0.0, 0.0)), (lean_rate, 0.0), pin(2)),
    ]
    masses = (1.0, 0.8, 0.5)
    bodies = list(zip(masses, (0.01, 0.02, 0.001), strict=True))
    # the guide's direction is (normal_y, -normal_x), which is x
    guide = (2, (0.0, 1.0), lambda N: -mu * abs(N) * np.tanh(slide / SMOOTH))
    a, F, N = planar_system(bodies, joints, [np.array([0.0, -G * m, 0.0]) for m in masses], [guide])
    return a[0, 2], a[2, 0], F, N[0, 0], slide


@pytest.mark.parametrize(
    ("method", "target"),
    part_of(
        [("embedding", "numpy"), ("recursive", "numpy"), ("augmented", "numpy"), ("embedding", "cython")],
        lambda case: case[1] == "numpy",
    ),
)
def test_slider_crank_with_friction_in_all_joints(method, target):
    """The piston's side force presses on the wall, the pins rub by the forces they carry."""
    options = {} if target == "numpy" else {"optimize": 0}
    mod = slider_crank(0.15, 0.3).derive(method).compile(target=target, **options)
    for theta, spin in ((0.8, 20.0), (2.6, -12.0), (4.0, 3.0)):
        x = mod.x0(theta=theta, theta_dot=spin)
        turn, push, F, side, slide = engine_truth(0.15, 0.3, theta, spin)
        rate = dict(zip((*mod.q_names, *mod.v_names), mod.rhs(0.0, x), strict=True))
        assert rate["s"] == pytest.approx(slide, rel=1e-10)
        assert rate["theta_dot"] == pytest.approx(turn, rel=1e-8)
        assert rate["s_dot"] == pytest.approx(push, rel=1e-8)
        forces = dict(zip(mod.joint_names, mod.reactions(0.0, x), strict=True))
        assert np.array([forces[name][:2] for name in "ABC"]) == pytest.approx(F, rel=1e-7, abs=1e-8)
        assert forces["S"][1] == pytest.approx(side, rel=1e-7)


def test_it_does_not_matter_where_a_loop_is_cut():
    found = []
    for independent in ("theta", "s", "B"):
        mod = slider_crank(0.15, 0.3).derive(independent=[independent]).compile(target="numpy")
        x = mod.x0(theta=0.9, theta_dot=7.0)
        found.append(dict(zip(mod.x_names, mod.rhs(0.0, x), strict=True))["theta_dot"])
    assert found == pytest.approx([found[0]] * 3, rel=1e-10)


def sliding_rod(mu: float | str) -> eg.Model:
    """A uniform rod of length 2 whose lower end slides on rough ground."""
    m = eg.Model("painleve", gravity=(0, -G, 0))
    foot = m.body("foot", mass=0.0)
    rod = m.body("rod", mass=1.5, inertia={"zz": 0.5}, com=(1.0, 0, 0))
    m.prismatic("ground", m.ground, foot, axis="x", coordinate="s")
    m.revolute("end", foot, rod, coordinate="lean")
    m.friction("rub", joint="ground", coefficient=mu, smoothing=1e-4)
    return m


@cache
def rod_of_any_friction() -> eg.Module:
    m = sliding_rod("mu")
    m.parameter("mu", 0.9)
    return m.compile(target="numpy")


@pytest.mark.parametrize("lean", [np.arctan(2.0), 0.6, 1.4, 1.8])
def test_limit_of_painleve(lean):
    """1 + 3 cos (cos - mu sin) = 0: the least such mu is 4/3, where the tangent of the angle is 2."""
    limit = abs((1 + 3 * np.cos(lean) ** 2) / (3 * np.sin(lean) * np.cos(lean)))
    assert limit >= 4 / 3 - 1e-12
    x = [0.0, lean, 2.0, 0.3]
    mod = rod_of_any_friction()
    assert np.isfinite(mod.rhs(0.0, x, p={"mu": limit * (1 - 1e-6)})).all()
    refuses("EG-NOT-FINITE lean rub Painleve's", mod.rhs, 0.0, x, p={"mu": limit * (1 + 1e-6)})


def test_revolute_in_space():
    """An arm of three dimensions on a pin with a collar, forces from the motion of its points by differences."""
    mu, radius, collar, mass = 0.25, 0.04, 0.06, 2.0
    tensor = np.array([[0.3, 0.02, -0.01], [0.02, 0.25, 0.03], [-0.01, 0.03, 0.4]])
    com, gravity = np.array([0.3, -0.1, 0.2]), np.array([1.0, -9.0, -3.0])
    m = eg.Model("arm", gravity=tuple(gravity))
    keys = {"xx": tensor[0, 0], "yy": tensor[1, 1], "zz": tensor[2, 2]}
    keys |= {"xy": tensor[0, 1], "xz": tensor[0, 2], "yz": tensor[1, 2]}
    arm = m.body("arm", mass=mass, inertia=keys, com=tuple(com))
    axis = np.array([1.0, 2.0, 2.0]) / 3
    m.revolute("A", m.ground, arm, axis=tuple(axis))
    m.friction("pin", joint="A", coefficient=mu, radius=radius, thrust_radius=collar, smoothing=SMOOTH)
    mod = m.compile(target="numpy")
    angle, rate = 0.6, 1.7
    K = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    R = np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K
    arm_now, w = R @ com, rate * axis

    def balance(acceleration):
        alpha = acceleration * axis
        F = mass * (np.cross(alpha, arm_now) + np.cross(w, np.cross(w, arm_now)) - gravity)
        J = R @ tensor @ R.T
        moment = J @ alpha + np.cross(w, J @ w) + np.cross(arm_now, F)
        thrust = F @ axis
        radial = np.linalg.norm(F - thrust * axis)
        return moment @ axis + mu * (radius * radial + collar * abs(thrust)) * np.tanh(rate / SMOOTH)

    assert mod.rhs(0.0, [angle, rate])[1] == pytest.approx(brentq(balance, -1e3, 1e3, xtol=1e-13), rel=1e-11)


def test_preload_stribeck_and_viscous_parts():
    """At a sliding speed the coefficient is the curve's, and the parts add."""
    keys = {"coulomb": 0.7, "static": 0.9, "viscous": 0.2, "static_coefficient": 0.5, "stribeck": 0.8}
    mod = pendulum(0.3, **keys).compile(target="numpy")
    rate, angle = 1.1, 0.4
    fall = np.exp(-((rate / 0.8) ** 2))
    mu, level = 0.3 + 0.2 * fall, 0.7 + 0.2 * fall
    pin = np.linalg.norm(mod.reactions(0.0, [angle, rate])[0, :3])
    torque = -((level + mu * 0.05 * pin) * np.tanh(rate / SMOOTH) + 0.2 * rate)
    turn = (torque - 2.0 * G * 0.4 * np.cos(angle)) / (0.3 + 2.0 * 0.4**2)
    assert mod.rhs(0.0, [angle, rate])[1] == pytest.approx(turn, rel=1e-12)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"coefficient": 0.1, "radius": 0.1}, "EG-MISSING forces.pin.smoothing"),
        ({"coefficient": 0.1, "smoothing": 1e-3}, "EG-MISSING forces.pin.radius A"),
        ({"radius": 0.1, "viscous": 1.0}, "EG-MISSING forces.pin.radius"),
        ({"coefficient": 0.1, "radius": 0.1, "smoothing": 1e-3, "static_coefficient": 0.2}, "EG-MISSING pin.stribeck"),
        (
            {"coefficient": 0.1, "radius": 0.1, "smoothing": 1e-3, "static": 0.2, "stribeck": 0.1},
            "EG-MISSING forces.pin.static",
        ),
    ],
)
def test_faults_of_keys(keys, message):
    m = eg.Model("pin", gravity=(0, -G, 0))
    m.revolute("A", m.ground, m.body("rod", mass=2.0, inertia={"zz": 0.3}))
    m.friction("pin", joint="A", **keys)
    refuses(message, m.check)


def test_joints_without_a_force_across_one_axis_are_refused():
    m = eg.Model("plane")
    m.planar("A", m.ground, m.body("disc", mass=2.0, inertia={"zz": 0.3}))
    m.friction("pin", joint="A_3", coefficient=0.1, radius=0.1, smoothing=1e-3)
    refuses("EG-UNSUPPORTED forces.pin A", m.check)


def sleeve(**keys) -> eg.Model:
    m = eg.Model("sleeve", gravity=(0, -G, 0))
    body = m.body("sleeve", mass=2.0, inertia={"xx": 0.3, "yy": 0.3, "zz": 0.25}, com=(0.1, 0, 0))
    m.cylindrical("A", m.ground, body, coordinates=("slide", "turn"))
    m.friction("along", joint="slide", coefficient=0.2, smoothing=SMOOTH)
    m.friction("around", joint="turn", coefficient=0.2, radius=0.05, smoothing=SMOOTH, **keys)
    return m


def test_cylindrical_joint_rubs_both_ways():
    """The force across the axis follows from the rate of turning and its derivative, which friction changes."""
    turn, rates = 0.3, np.array([0.4, 0.9])
    c, s = np.cos(turn), np.sin(turn)

    def across(alpha):
        return 2.0 * np.hypot(0.1 * (-s * alpha - c * rates[1] ** 2), 0.1 * (c * alpha - s * rates[1] ** 2) + G)

    def balance(alpha):
        rub = 0.2 * 0.05 * across(alpha) * np.tanh(rates[1] / SMOOTH)
        return (0.25 + 2.0 * 0.01) * alpha + 2.0 * G * 0.1 * c + rub

    alpha = brentq(balance, -1e3, 1e3, xtol=1e-14)
    along = -0.2 * across(alpha) * np.tanh(rates[0] / SMOOTH) / 2.0
    found = sleeve().compile(target="numpy").rhs(0.0, [0.1, turn, *rates])
    assert found[2:] == pytest.approx([along, alpha], rel=1e-11)


def test_thrust_of_a_sliding_joint_is_refused():
    refuses("EG-UNSUPPORTED forces.around", lambda: sleeve(thrust_radius=0.1).check())


def table() -> eg.Model:
    """A bar on three parallel cranks, which share its weight in no way that rigid bodies determine."""
    m = eg.Model("table", gravity=(0, -G, 0))
    cranks = [m.body(f"crank{k}", mass=1.0, inertia={"zz": 0.1}, com=(0.5, 0, 0)) for k in range(3)]
    bar = m.body("bar", mass=1.0, inertia={"zz": 0.1})
    for k, crank in enumerate(cranks):
        m.revolute(f"A{k}", m.ground.at(k, 0, 0), crank)
        m.revolute(f"B{k}", crank.at(1, 0, 0), bar.at(k, 0, 0))
    m.initial(A0=0.5)
    return m


def test_reactions_that_are_not_unique_are_refused():
    m = table()
    m.friction("pin", joint="A0", coefficient=0.1, radius=0.1, smoothing=1e-2)
    refuses("EG-UNDETERMINED forces.pin", m.check)


def test_what_rows_leave_unique_beside_redundant_ones():
    """The torque that holds a crank of the table, and a hinge on its bar: J and the moment of all weights by hand."""
    m = table()
    m.revolute("hinge", m.bodies["bar"].at(0.5, 0, 0), m.body("weight", mass=2.0, com=(0, -0.1, 0)))
    m.coupling("lock", equation="A0_dot", closes="1 - t", opens="2 - t", closed=True)
    m.output("torque", "multiplier(lock)")
    m.output("load", "reaction(hinge).y")
    mod = m.compile(target="numpy")
    assert mod.outputs(0.0, mod.x0()) == pytest.approx([-4.5 * G * np.cos(0.5), 2.0 * G], rel=1e-12)


def test_reactions_beside_a_massless_rod():
    """A rod without mass pulls along itself; the guide carries the weight of the piston and its pull."""
    m = eg.Model("engine", gravity=(0, -G, 0))
    crank = m.body("crank", mass=1.0, inertia={"zz": 0.01})
    rod, piston = m.body("rod", mass=0.0), m.body("piston", mass=0.5)
    models.join_slider_crank(m, (crank, rod, piston), 0.1, 0.3, "theta - s", guide="S")
    m.initial(theta=0.8, theta_dot=3.0)
    for name, text in (("pin", "reaction(B).x"), ("guide", "reaction(S).y"), ("push", "s_ddot")):
        m.output(name, text)
    mod = m.compile(target="numpy")
    x = mod.x0()
    pin, guide, push = mod.outputs(0.0, x)
    slope = np.arcsin(0.1 * np.sin(0.8) / 0.3)  # of the rod, downwards
    assert abs(pin) == pytest.approx(abs(0.5 * push), abs=1e-12)
    assert guide == pytest.approx(0.5 * G + np.tan(slope) * 0.5 * push, abs=1e-12)
    # turning of the crank by the pull at its pin
    moment = 0.5 * push * 0.1 * (np.sin(0.8) + np.cos(0.8) * np.tan(slope))
    turn = dict(zip(mod.x_names, mod.rhs(0.0, x), strict=True))["theta_dot"]
    assert 0.01 * turn == pytest.approx(moment, abs=1e-12)


def test_a_motor_overcomes_friction():
    """Torque times rate is the rate of energy and what friction takes, in a mechanism that its motor moves."""
    m = slider_crank(0.15, 0.3)
    m.driver("motor", "theta", "0.8+20*t")
    m.output("loss", "power(guide) + power(pinA) + power(pinB) + power(pinC)")
    mod = m.compile(target="numpy")
    x, h = mod.x0(), 1e-4
    energies = [mod.energy(mod.project(x, t=k * h), t=k * h).sum() for k in (-2, -1, 1, 2)]
    rate = np.dot(energies, [1.0, -8.0, 8.0, -1.0]) / (12 * h)
    loss = mod.outputs(0.0, x)[0]
    assert loss < 0.0
    assert 20.0 * mod.driving_forces(0.0, x)["motor"] == pytest.approx(rate - loss, rel=1e-9)


def test_what_asks_for_forces_alone_is_refused():
    """They depend on reactions, and these on what is asked."""
    mod = pin()
    for call in (
        lambda: mod.inverse_dynamics([0.0], [1.0], [0.0]),
        lambda: mod.inverse_dynamics_derivatives([0.0], [1.0], [0.0]),
        lambda: mod.actuator_forces(0.0, [0.0, 1.0]),
    ):
        refuses("EG-UNAVAILABLE pin", call)


@pytest.mark.thorough
def test_verification_holds_laws_against_reactions():
    assert pendulum().compile(target="numpy").verify().ok


def test_explained_formulas_agree_with_the_module():
    found = pendulum().derive().explain()
    assert found.difference < 1e-12
    assert "grows with the reaction" in found.markdown
