"""Reactions balance bodies by Newton and Euler, as ADAMS and Pinocchio; inverse dynamics, and consistent states."""

from typing import Any

import judges
import models
import numpy as np
import pinocchio as pin
import pytest
import scipy.linalg
import sympy
import yaml
from analysed import compiled
from random_models import Made, Placement, random_recipe
from refusals import refuses
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

import eomgen as eg

G = 9.81


def joints_of(model: eg.Model) -> dict[str, Any]:
    """Joints of a model without parameters: type, predecessor, its marker, successor, its marker."""
    text = yaml.safe_load(model.to_yaml())
    names = ["ground", *text["bodies"]]

    def marker(place: Any) -> tuple[int, Placement]:
        given = {"body": place} if isinstance(place, str) else place
        R = models.rotation(given.get("rpy", (0.0, 0.0, 0.0)))
        return names.index(given["body"]) - 1, Placement(R, np.array(given.get("at", np.zeros(3)), dtype=float))

    return {name: (e["type"], *(x for place in e["between"] for x in marker(place)))
            for name, e in text["joints"].items()}  # fmt: skip


class Balance:
    """What must act on each body at a state, ``needed`` (k, 6): force and moment about its origin, from poses alone."""

    def __init__(self, model: eg.Model, module: Any, x: np.ndarray) -> None:
        rigid, joints = judges.described(model), joints_of(model)
        self.joints = [joints[name] for name in module.joint_names]
        a = module.rhs(0.0, x)[module.n_q :]
        self.bodies = b = judges.Bodies(module, x[: module.n_q], x[module.n_q :])
        w_dot, r_ddot = b.w_dot + b.J_w @ a, b.r_ddot + b.J_r @ a
        self.needed = np.zeros((len(rigid.masses), 6))
        for k, mass in enumerate(rigid.masses):
            arm, w = b.R[k] @ rigid.centers[k], b.w[k]
            tensor = b.R[k] @ rigid.inertias[k] @ b.R[k].T
            force = mass * (r_ddot[k] + np.cross(w_dot[k], arm) + np.cross(w, np.cross(w, arm)) - rigid.gravity)
            self.needed[k] = [*force, *(tensor @ w_dot[k] + np.cross(w, tensor @ w) + np.cross(arm, force))]

    def place(self, body: int, marker: Placement) -> tuple[np.ndarray, np.ndarray]:
        """Axes and origin of a marker in ground axes."""
        if body < 0:
            return marker.rotation, marker.position
        R = self.bodies.R[body]
        return R @ marker.rotation, self.bodies.r[body] + R @ marker.position

    def add(self, total: np.ndarray, joint: Any, wrench: np.ndarray) -> None:
        """A wrench on the successor at its marker, and its opposite on the predecessor."""
        _, i, _, j, S = joint
        _, point = self.place(j, S)
        for body, sign in ((j, 1.0), (i, -1.0)):
            if body >= 0:
                arm = point - self.bodies.r[body]
                total[body] += sign * np.concatenate([wrench[:3], wrench[3:] + np.cross(arm, wrench[:3])])


def slider_crank(cut: str = "C", drives: dict[str, float] | None = None) -> eg.Model:
    """In a plane of space, its bodies' frames turned; all coordinates have names but that of the joint to cut."""
    m = eg.Model("turned", gravity=(1.0, -9.0, 2.0))
    centers = {"crank": (0.1, 0.02, 0.01), "rod": (0.2, 0.0, 0.03), "block": (0.0, 0.1, 0.0)}
    crank, rod, block = (m.body(n, mass=1.0, com=com, inertia=(0.01, 0.02, 0.025)) for n, com in centers.items())
    tilt, level = (0.3, -0.2, 0.5), (np.pi / 2, 0, np.pi / 2)  # z along x
    rail = tuple((Rotation.from_euler("xyz", tilt) * Rotation.from_euler("xyz", level)).as_euler("xyz").tolist())
    ends = {
        "A": ("revolute", m.ground.at(0.1, 0.2, 0.3, rpy=tilt), crank),
        "B": ("revolute", crank.at(0.2, 0, 0), rod),
        "C": ("revolute", rod.at(0.5, 0, 0), block.at(0, 0, 0, rpy=(0, 0, 0.4))),
        "D": ("prismatic", m.ground.at(0.1, 0.2, 0.3, rpy=rail), block.at(0, 0, 0, rpy=level)),
    }
    for name, (kind, a, b) in ends.items():
        m.joint(kind, name, a, b, **({} if name == cut else {"coordinate": f"q{name}"}))
    for name, value in (drives or {}).items():
        m.torque(f"drive_{name}", name, value)
    m.initial(qA=0.7, qA_dot=3.0)
    m.guess(**{f"q{name}": value for name, value in (("B", -0.96), ("C", 0.66), ("D", 0.64)) if name != cut})
    return m


def test_a_drive_on_a_cut_slider_reacts_on_both_bodies() -> None:
    """Reactions with a drive found by inverse dynamics are those of the model that has its force as an element."""
    for cut in "DC":
        plain = slider_crank(cut).compile(target="numpy")
        x = plain.x0()
        assert plain.loop_names == (cut,)
        found = plain.actuator_forces(0.0, x, {plain.minimal.q_names[0]: 5.0}, actuated=[cut])
        driven = slider_crank(cut, {cut: float(found[cut])}).compile(target="numpy")
        np.testing.assert_allclose(driven.rhs(0.0, x)[plain.n_q :], found.a, atol=1e-9)
        np.testing.assert_allclose(driven.reactions(0.0, x), found.reactions, atol=1e-9)


def test_a_chain_against_pinocchio() -> None:
    """``data.f`` of the recursive Newton-Euler algorithm is the force that the parent exerts, in joint axes."""
    kinds = ("revolute", "prismatic", "revolute", "prismatic", "revolute")
    made = Made(random_recipe(5, kinds, turned=(False,) * 5))
    module, model, numbers = made.compile(), pin.Model(), made.numbers
    for k, (kind, parent) in enumerate(zip(made.recipe.kinds, made.recipe.parents, strict=True)):
        outer, inner, below = (
            pin.SE3(p.rotation, p.position) for p in (numbers.outer[k], numbers.inner[k], numbers.inner[parent])
        )
        held = pin.SE3.Identity() if parent < 0 else below
        axis = pin.JointModelRZ() if kind == "revolute" else pin.JointModelPZ()
        joint = model.addJoint(parent + 1, axis, held.actInv(outer), f"q{k}")
        body = pin.Inertia(numbers.masses[k], numbers.centers[k], numbers.inertias[k])
        model.appendBodyToJoint(joint, body, inner.inverse())
    model.gravity.linear = numbers.gravity
    data = model.createData()
    x = judges.random_states(module, 3, 1)[0]
    order = [module.q_names.index(f"q{k}") for k in range(5)]
    a = module.rhs(0.0, x)[5:]
    pin.forwardKinematics(model, data, x[:5][order])
    pin.rnea(model, data, x[:5][order], x[5:][order], a[order])
    found = module.reactions(0.0, x)
    for k in range(5):
        f = data.f[k + 1]
        expected = [*(data.oMi[k + 1].rotation @ f.linear), *(data.oMi[k + 1].rotation @ f.angular)]
        np.testing.assert_allclose(found[module.joint_names.index(f"q{k}")], expected, atol=1e-11)


def three_cranks() -> eg.Model:
    """A bar on three parallel cranks: a row is redundant in the plane too."""
    m = eg.Model("three_cranks", gravity=(0.0, -9.81, 0.3))
    bar = m.body("bar", mass=1.3, com=(0.3, 0.05, 0.02), inertia=(0.01, 0.04, 0.04))
    for k, x in ((1, 0.0), (2, 0.35), (3, 0.6)):
        crank = m.body(f"crank{k}", mass=0.7, com=(0.1, 0, 0.01), inertia=(0.001, 0.003, 0.003))
        m.revolute(f"A{k}", m.ground.at(x, 0, 0), crank, coordinate=f"theta{k}")
        m.revolute(f"B{k}", crank.at(0.2, 0, 0), bar.at(x, 0, 0))
    m.initial(theta1=-0.5, theta1_dot=2.0)
    m.guess(theta2=-0.5, theta3=-0.5)
    m.independent("theta1")
    return m


@pytest.mark.parametrize("build", [three_cranks, slider_crank])
def test_smallest_reactions_of_redundant_constraints(build: Any) -> None:
    """Least norm of all reactions, moments over the model's length, by one pseudo-inverse; and what is undetermined."""
    model = build()
    module = model.compile(target="numpy")
    x = module.x0()
    judge, length = Balance(model, module, x), module.metadata["length_scale"]
    columns, places = [], []
    for k, joint in enumerate(judge.joints):
        if joint[0] == "revolute":
            axes = judge.place(joint[3], joint[4])[0]
            blocks = [*np.hstack([np.eye(3), np.zeros((3, 3))]), *np.hstack([np.zeros((2, 3)), axes.T[:2]])]
        else:
            axes = judge.place(joint[1], joint[2])[0]
            blocks = [*np.hstack([axes.T[:2], np.zeros((2, 3))]), *np.hstack([np.zeros((3, 3)), np.eye(3)])]
        for wrench in np.array(blocks) * [1, 1, 1, length, length, length]:
            total = np.zeros_like(judge.needed)
            judge.add(total, joint, wrench)
            columns.append(total.ravel())
            places.append((k, wrench))
    K = np.array(columns).T
    null = scipy.linalg.null_space(K, rcond=1e-9)
    expected, stress = np.zeros((len(judge.joints), 6)), np.zeros((len(judge.joints), 6, null.shape[1]))
    for (k, wrench), value, row in zip(places, np.linalg.pinv(K, rcond=1e-9) @ judge.needed.ravel(), null, strict=True):
        expected[k] += value * wrench
        stress[k] += np.outer(wrench, row)
    np.testing.assert_allclose(module.reactions(0.0, x), expected, atol=1e-8 * np.abs(expected).max())
    undetermined = np.abs(stress).max(axis=2, initial=0.0) > 1e-7
    np.testing.assert_array_equal(module.undetermined_reactions(0.0, x), undetermined)
    assert undetermined.any()


def test_contact_force_of_a_rolling_disc() -> None:
    """The free joint exerts nothing; ground pushes with m (a - g) at the contact."""
    mod = compiled("rolling_disc")
    for x in judges.random_states(mod, 3, 2):
        np.testing.assert_allclose(mod.reactions(0.0, x), 0.0, atol=1e-9)
        a = mod.rhs(0.0, x)[mod.n_q :]
        acc = a[[mod.v_names.index(f"{axis}_dot") for axis in "xyz"]]
        force = mod.driving_forces(0.0, x)
        found = [force[f"roll.{row}"] for row in ("slip_x", "slip_y", "height")]
        np.testing.assert_allclose(found, 2.0 * (acc + np.array([0, 0, G])), atol=1e-9)


def test_torque_of_a_driver() -> None:
    """A driven pendulum: torque m l^2 theta'' + m g l cos theta, and the pin force of the prescribed motion."""
    m = eg.Model("driven", gravity=(0, -G, 0))
    rod = m.body("rod", mass=2.0, com=(0.5, 0, 0))
    m.revolute("A", m.ground, rod, coordinate="theta")
    m.coupling("drive", equation="theta - 0.3 - 2*t - 0.5*t**2")
    mod = m.compile(target="numpy")
    t = 0.7
    theta, rate = 0.3 + 2 * t + 0.5 * t**2, 2 + t
    x = np.array([theta, rate])
    torque = mod.driving_forces(t, x)["drive"]
    np.testing.assert_allclose(torque, 2.0 * 0.25 * 1.0 + 2.0 * G * 0.5 * np.cos(theta), rtol=1e-12)
    e, n = np.array([np.cos(theta), np.sin(theta)]), np.array([-np.sin(theta), np.cos(theta)])
    pin = 2.0 * (0.5 * (1.0 * n - rate**2 * e) + [0, G])
    np.testing.assert_allclose(mod.reactions(t, x)[0], [*pin, 0, 0, 0, 0], atol=1e-12)


@pytest.mark.parametrize("name", ["slider_crank", "rssr"])
def test_targets_batches_and_shapes(name: str) -> None:
    one, other = compiled(name), compiled(name, "cython")
    x = np.array(judges.random_states(one, 1, 4)).T
    for call in ("multipliers", "reactions"):
        many = getattr(one, call)(0.0, x)
        np.testing.assert_allclose(
            many, getattr(other, call)(0.0, x), atol=1e-10 * max(1.0, np.abs(many).max(initial=0))
        )
        single = np.stack([getattr(one, call)(0.0, column) for column in x.T], axis=-1)
        np.testing.assert_allclose(single, many, atol=1e-11 * max(1.0, np.abs(many).max(initial=0)))
        out = np.empty_like(many)
        assert getattr(one, call)(0.0, x, out=out) is out
        np.testing.assert_array_equal(out, many)
    assert one.undetermined_reactions(0.0, x).dtype == bool


def test_inputs_that_change_from_state_to_state() -> None:
    module = compiled("slider_crank")
    x = np.array(judges.random_states(module, 1, 3)).T
    u = np.array([[0.0, 2.0, -5.0]])
    found = module.reactions(0.0, x, u=u)
    for k in range(3):
        np.testing.assert_allclose(found[..., k], module.reactions(0.0, x[:, k], u=u[:, k]), atol=1e-10)
    assert np.abs(found[..., 2] - module.reactions(0.0, x[:, 2])).max() > 1.0
    refuses("EG-SHAPE u (1,)", module.multipliers, 0.0, x, u=np.zeros((1, 2)))


def test_what_reactions_refuse() -> None:
    module = compiled("slider_crank")
    refuses("EG-SHAPE x (6,)", module.reactions, 0.0, np.zeros(4))
    refuses("EG-SHAPE t (2,)", lambda: module.reactions(np.zeros(3), np.repeat(module.x0()[:, None], 2, axis=1)))
    refuses("EG-SHAPE out", lambda: module.reactions(0.0, module.x0(), out=np.zeros(3)))
    s, s_dot = sympy.symbols("s s_dot")
    bare = eg.Model.from_lagrangian("bare", s_dot**2 / 2 - s**2, [s]).compile(target="numpy")
    refuses("EG-UNSUPPORTED between", lambda: bare.reactions(0.0, bare.x0()))


def test_parameters_by_name_serve_multipliers_and_reactions() -> None:
    mod = compiled("slider_crank")
    x, bound = mod.x0(), mod.bind(p={"m_s": 2.0})
    np.testing.assert_array_equal(mod.reactions(0.0, x, p={"m_s": 2.0}), bound.reactions(0.0, x))
    np.testing.assert_array_equal(mod.multipliers(0.0, x, p={"m_s": 2.0}), bound.multipliers(0.0, x))
    assert np.abs(mod.reactions(0.0, x) - bound.reactions(0.0, x)).max() > 1e-3
    refuses("EG-NAME-UNKNOWN kk", mod.reactions, 0.0, x, p={"kk": 1.0})
    for call in (mod.reactions, mod.actuator_forces):
        refuses("EG-NUMBER t", call, "a", x)


START, RATE, SWING = 0.4, 2.0, 0.8


def motion(t: Any) -> tuple[Any, Any, Any]:
    """A crank angle over time with its rates."""
    w = 3.0
    s, c = SWING * np.sin(w * t), SWING * np.cos(w * t)
    return START + RATE * t + SWING - c, RATE + w * s, w**2 * c


def history(mod: Any, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """States and accelerations of the prescribed motion of the slider-crank."""
    q, v, a = mod.kinematics(*(np.atleast_2d(y) for y in motion(times)))
    return np.vstack([q, v]), a


def test_fed_back_it_gives_the_motion() -> None:
    """A whole history at once, as an input of a run: the crank follows the prescribed angle."""
    mod = compiled("slider_crank")
    assert mod.minimal.q_names == ("theta",)
    times = np.linspace(0.0, 0.1, 201)
    x, a = history(mod, times)
    forces = mod.actuator_forces(times, x, a, actuated=["tau"])
    by_name = mod.actuator_forces(times, x, {"theta": motion(times)[2]}, actuated=["tau"])
    np.testing.assert_allclose(by_name.forces, forces.forces, atol=1e-9 * np.abs(forces.forces).max())
    np.testing.assert_allclose(by_name.a, a, atol=1e-9 * np.abs(a).max())
    run = mod.simulate(0.1, x[:, 0], inputs={"tau": lambda t, state: np.interp(t, times, forces["tau"])}, rtol=1e-9,
                       t_eval=times[::20])  # fmt: skip
    np.testing.assert_allclose(run["theta"], motion(run.t)[0], atol=2e-5)  # tau is linear between 201 points

    def exact(t: float, state: np.ndarray) -> float:
        here, rates = history(mod, np.array([t]))
        return float(mod.actuator_forces(t, here[:, 0], rates[:, 0], actuated=["tau"])["tau"])

    run = mod.simulate(0.02, x[:, 0], inputs={"tau": exact}, rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(run["theta"], motion(run.t)[0], atol=1e-8)
    np.testing.assert_allclose(run["theta_dot"], motion(run.t)[1], atol=1e-7)


def test_accelerations_of_the_model_need_the_inputs_it_has() -> None:
    mod = compiled("slider_crank").bind(u={"tau": 0.37})
    for x in judges.random_states(mod, 1, 2):
        a = mod.rhs(0.0, x)[mod.n_q :]
        found = mod.actuator_forces(0.0, x, a, actuated=["tau"])
        np.testing.assert_allclose(found["tau"], 0.37, atol=1e-10)
        np.testing.assert_allclose(found.multipliers, mod.multipliers(0.0, x), atol=1e-8)
        np.testing.assert_allclose(found.reactions, mod.reactions(0.0, x), atol=1e-8)
        np.testing.assert_allclose(mod.actuator_forces(0.0, x, a).forces, 0.0, atol=1e-10)  # nothing to add


def rates(mod: Any, name: str, q: np.ndarray) -> np.ndarray:
    """How a coordinate changes with the velocities, that of the cut joint by its geometry: the rod's angle closes."""
    if name in mod.q_names:
        return np.eye(mod.n_v)[mod.q_names.index(name)]
    return np.array([-1.0 * (n in ("theta", "B")) for n in mod.q_names])  # C = -(theta + B), the slider is level


@pytest.mark.parametrize("drives", [("theta",), ("s",), ("B",), ("C",), ("theta", "s"), ("theta", "C", "s")])
def test_virtual_work(drives: tuple[str, ...]) -> None:
    """In every motion the loop allows drives do the work of M a + h; of all such forces theirs are the smallest."""
    mod = compiled("slider_crank")
    x = mod.x0()
    found = mod.actuator_forces(0.0, x, {"theta": -4.0}, actuated=drives)
    q, v = x[: mod.n_q], x[mod.n_q :]
    free = scipy.linalg.null_space(mod.constraint_jacobian(q))
    work = np.array([rates(mod, name, q) for name in drives]) @ free
    needed = free.T @ mod.inverse_dynamics(q, v, found.a)
    size = np.array([mod.metadata["length_scale"] if name == "s" else 1.0 for name in drives])
    expected = np.linalg.pinv(work.T / size) @ needed / size
    np.testing.assert_allclose(found.forces, expected, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(mod.constraint_jacobian(q) @ found.a,
                               mod.constraint_jacobian(q) @ mod.rhs(0.0, x)[mod.n_q :], atol=1e-9)  # fmt: skip


def test_what_inverse_dynamics_refuses() -> None:
    mod = compiled("double_pendulum")
    x = mod.x0()
    refuses("EG-UNDETERMINED 2", mod.actuator_forces, 0.0, x, actuated=[mod.q_names[0]])
    crank = compiled("slider_crank")
    x = crank.x0()
    refuses("EG-NAME-UNKNOWN thet theta?", crank.actuator_forces, 0.0, x, actuated=["thet"])
    refuses("EG-CONTRADICTION C.r_", crank.actuator_forces, 0.0, x, np.array([1.0, 2.0, 3.0]))
    refuses("EG-SHAPE a (3,)", crank.actuator_forces, 0.0, x, np.zeros(2))
    refuses("EG-REFERENCE independent", crank.actuator_forces, 0.0, x, {"s": 1.0})
    refuses("EG-MISSING once", crank.actuator_forces, 0.0, x, actuated=["theta", "theta"])


@pytest.mark.parametrize("law", ["u1*u2", "u1 + sin(u2)"])
def test_inputs_that_forces_are_not_linear_in_are_refused(law: str) -> None:
    m = eg.Model("two", gravity=(0, -9.81, 0))
    m.input("u1", 0.5)
    m.input("u2", 2.0)
    m.revolute("R", m.ground, m.body("b", mass=1.0, com=(0, -1, 0)), coordinate="th")
    m.torque("T", "R", law)
    mod = m.compile(target="numpy")
    x = mod.x0(th=0.2)
    refuses("EG-UNSUPPORTED linear", mod.actuator_forces, 0.0, x, {"th": 1.0}, actuated=["u1", "u2"])
    alone = mod.actuator_forces(0.0, x, {"th": 1.0}, actuated=["u1"])
    assert mod.rhs(0.0, x, u=[alone["u1"], 2.0])[1] == pytest.approx(1.0, abs=1e-12)


def disturbed(mod: Any, seed: int, size: float = 0.1) -> np.ndarray:
    x = mod.x0()
    length = mod.metadata["length_scale"]
    kinds = [*mod.metadata["coordinate_kinds"], *mod.metadata["velocity_kinds"]]
    sizes = np.array([length if kind == "length" else 1.0 for kind in kinds])
    return x + size * np.random.default_rng(seed).normal(size=x.size) * sizes


@pytest.mark.parametrize("name", ["slider_crank", "tilted_four_bar", "three_cranks"])
@pytest.mark.parametrize("metric", ["plain", "weights", "mass"])
def test_least_change(name: str, metric: str) -> None:
    mod = compiled(name)
    n = mod.n_q
    length, kinds = mod.metadata["length_scale"], mod.metadata["coordinate_kinds"]
    s = np.array([length if kind == "length" else 1.0 for kind in kinds])
    x = disturbed(mod, 3)
    first, second = mod.q_names[0], mod.v_names[-1]
    weights: Any = {"plain": None, "weights": {first: 30.0, second: 0.1}, "mass": "mass"}[metric]
    found = mod.consistent(x, weights=weights)
    q, v = found[:n], found[n:]
    np.testing.assert_allclose(mod.constraints(q, rows="all"), 0.0, atol=1e-12)
    np.testing.assert_allclose(mod.velocity_constraints(found, rows="all"), 0.0, atol=1e-11)
    W_q, W_v = np.diag(1 / s**2), np.diag(1 / s**2)
    if metric == "weights":
        W_q[0, 0] *= 30.0
        W_v[0, 0] *= 30.0
        W_v[-1, -1] *= 0.1
    if metric == "mass":
        W_q, W_v = mod.mass_matrix(x[:n]), mod.mass_matrix(q)

    def cost(z: np.ndarray) -> float:
        d = z - x[:n]
        return float(d @ W_q @ d) / np.abs(W_q).max()

    rows = {"type": "eq", "fun": lambda z: mod.constraints(z)}
    best = minimize(cost, mod.project(x)[:n], constraints=rows, method="SLSQP", options={"ftol": 1e-16, "maxiter": 900})
    assert cost(q) <= best.fun * (1 + 1e-6)
    np.testing.assert_allclose(q, best.x, atol=1e-4)
    C_q = mod.constraint_jacobian(q)
    n_c = len(C_q)
    K = np.block([[W_v, C_q.T], [C_q, np.zeros((n_c, n_c))]])
    expected = np.linalg.lstsq(K, np.concatenate([W_v @ x[n:], np.zeros(n_c)]), rcond=None)[0][: mod.n_v]
    np.testing.assert_allclose(v, expected, atol=1e-8 * np.abs(expected).max())


@pytest.mark.quick
def test_held_values_stay() -> None:
    mod = compiled("slider_crank")
    x = disturbed(mod, 5, 0.05)
    found = mod.consistent(x, hold=["theta", "s_dot"])
    assert found[mod.x_names.index("theta")] == x[mod.x_names.index("theta")]
    assert found[mod.x_names.index("s_dot")] == x[mod.x_names.index("s_dot")]
    np.testing.assert_allclose(mod.constraints(found[: mod.n_q]), 0.0, atol=1e-12)
    np.testing.assert_allclose(mod.velocity_constraints(found), 0.0, atol=1e-11)
    refuses("EG-PROJECTION theta B s", mod.consistent, x, hold=list(mod.q_names))


def test_rotations_and_nonholonomic_rows() -> None:
    mod = compiled("rssr")
    found = mod.consistent(disturbed(mod, 1, 0.05))
    np.testing.assert_allclose(mod.constraints(found[: mod.n_q]), 0.0, atol=1e-12)
    np.testing.assert_allclose(mod.velocity_constraints(found), 0.0, atol=1e-11)
    disc = compiled("rolling_disc")
    found = disc.consistent(disturbed(disc, 1), hold=["x", "yaw_dot"])
    np.testing.assert_allclose(disc.velocity_constraints(found), 0.0, atol=1e-11)


def test_least_change_in_the_mass_metric_is_a_plastic_impact() -> None:
    """Velocities that constraints stop at once lose the least kinetic energy (Gauss, Robin)."""
    mod = compiled("three_cranks")
    x = mod.x0()
    x[mod.n_q :] = [1.0, -2.0, 0.5, 3.0][: mod.n_v]
    v = mod.consistent(x, weights="mass")[mod.n_q :]
    M = mod.mass_matrix(x[: mod.n_q])
    impulse = M @ (v - x[mod.n_q :])
    C_q = mod.constraint_jacobian(x[: mod.n_q])
    left = impulse - C_q.T @ np.linalg.lstsq(C_q.T, impulse, rcond=None)[0]
    np.testing.assert_allclose(left, 0.0, atol=1e-10)


def test_what_consistent_refuses() -> None:
    mod = compiled("slider_crank")
    x = mod.x0()
    for words, message in (
        ({"weights": {"thet": 1.0}}, "EG-NAME-UNKNOWN thet theta"),
        ({"weights": {"theta": -1.0}}, "EG-RANGE theta -1.0"),
        ({"weights": "inertia"}, "EG-TYPE mass"),
        ({"hold": ["q"]}, "EG-NAME-UNKNOWN q"),
    ):
        refuses(message, mod.consistent, x, **words)
    refuses("EG-SHAPE x (6,)", mod.consistent, np.zeros(3))
