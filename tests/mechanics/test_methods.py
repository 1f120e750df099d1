"""All methods agree, and each alone with rigid bodies from differences of poses and multipliers, in NumPy."""

from collections.abc import Callable
from itertools import product
from typing import Any

import judges
import models
import numpy as np
import pytest
from random_models import basis, energy_rate, gamma, in_velocities
from refusals import refuses
from sweeps import COVERING, METHODS, TARGETS, part_of

import eomgen as eg

# -- Models against judges ---------------------------------------------------------------------------------------------
FORMS = [method for method in METHODS if method != "embedding"]
DIGITS = 1e-11


def embedded_condition(module: Any, q: np.ndarray) -> float:
    return float(np.linalg.cond(module.embedded_mass_matrix(q))) if module.n_dof else 1.0


def same(a: np.ndarray, b: np.ndarray) -> None:
    """M, bias, inverse dynamics: to 1e-11 of the largest entry."""
    assert np.abs(a - b).max(initial=0.0) <= DIGITS * np.abs(b).max(initial=0.0)


def compare(one: Any, other: Any, states: list[np.ndarray], random: np.random.Generator, t: float = 0.0) -> None:
    assert one.x_names == other.x_names
    n = one.n_q
    u = random.uniform(-1, 1, one.n_u)
    for x in states:
        q, v = x[:n], x[n:]
        a = random.uniform(-5, 5, n)
        same(one.mass_matrix(q), other.mass_matrix(q))
        same(one.bias(t, x, u=u), other.bias(t, x, u=u))
        same(one.inverse_dynamics(q, v, a, u=u, t=t), other.inverse_dynamics(q, v, a, u=u, t=t))
        judges.agree(one.rhs(t, x, u=u)[n:], other.rhs(t, x, u=u)[n:], DIGITS, embedded_condition(other, q))


def judge(
    mod: Any, rigid: judges.RigidBodies, x: np.ndarray, forces: Callable[..., Any] | None = None, others: Any = ()
) -> None:
    """Compare the accelerations of a module, and of others of the same model, with those of the judge."""
    n = mod.n_q
    q, v = x[:n], x[n:]
    bodies = judges.Bodies(mod, q, v)
    M, h = bodies.newton_euler(rigid)
    if forces is not None:
        h = h - forces(mod, bodies, q, v)
    a = judges.augmented(M, h, *judges.loop_terms(mod, q, v)) if mod.n_c else np.linalg.solve(M, -h)
    cond = max(embedded_condition(mod, q), np.linalg.cond(M))
    judges.agree(mod.rhs(0.0, x)[n:], a, DIGITS, cond)
    for other in others:
        judges.agree(other.rhs(0.0, x)[n:], a, 10 * DIGITS, cond)


def spring_on(mod: Any, bodies: judges.Bodies, anchor: Any, body: str, at: Any, k: float, l0: float) -> np.ndarray:
    """Generalized force of a spring from a ground point to a point of a body."""
    r, _, J = bodies.point(mod.body_names.index(body), at)
    reach = r - np.asarray(anchor)
    length = np.linalg.norm(reach)
    return J.T @ (-k * (length - l0) * reach / length)


def slider_crank_forces(mod: Any, bodies: judges.Bodies, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    return spring_on(mod, bodies, [0.5, 0, 0], "slider", [0, 0, 0], 200.0, 0.1)


def squeezer_forces(mod: Any, bodies: judges.Bodies, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    p = models.reference("andrews_squeezer")["parameters_SI"]
    K1 = mod.body_names.index("K1")
    drive = p["mom"] * bodies.J_w[K1][2]
    anchor, at = [p["xc"], p["yc"], 0], [p["sd"], -p["sc"], 0]
    return drive + spring_on(mod, bodies, anchor, "K3", at, p["c0"], p["l0"])


def peaucellier_forces(mod: Any, bodies: judges.Bodies, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    crank = mod.body_names.index("crank")
    return -5.0 * np.arctan2(bodies.R[crank][1, 0], bodies.R[crank][0, 0]) * bodies.J_w[crank][2]


def planetary_forces(mod: Any, bodies: judges.Bodies, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    sun = mod.body_names.index("sun")
    return (0.3 - 0.001 * bodies.w[sun][2]) * bodies.J_w[sun][2]


def cam_forces(mod: Any, bodies: judges.Bodies, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    lever = mod.body_names.index("lever")
    return -4.0 * (np.arctan2(bodies.R[lever][1, 0], bodies.R[lever][0, 0]) + 0.5) * bodies.J_w[lever][2]


FORCES = {
    "planetary_gear": planetary_forces,
    "cam_follower": cam_forces,
    "slider_crank": slider_crank_forces,
    "andrews_squeezer": squeezer_forces,
    "peaucellier": peaucellier_forces,
}
JUDGED = [*models.EXAMPLE_NAMES, "offset_slider_crank", "spatial_loop", "skewed_four_bar", "three_cranks"]


@pytest.mark.parametrize("name", JUDGED)
def test_forms_against_newton_euler_with_multipliers(module: Callable[..., Any], name: str) -> None:
    """Every other form, redundant and nonholonomic rows included; M, h and M a + h are those of embedding too."""
    kernels = ["rhs", "mass_matrix", "bias", "inverse_dynamics"]
    forms = [models.build(name).compile(method, target="numpy", kernels=kernels) for method in FORMS]
    rigid = judges.described(models.build(name))
    states = judges.random_states(module(name), 5, 3)
    for form in forms:
        compare(form, module(name), states, np.random.default_rng(6), t=0.3)
    for x in states:
        judge(module(name), rigid, x, FORCES.get(name), forms)


def test_a_model_without_inertia_is_refused_by_both_methods() -> None:
    """A massless last link: the embedded mass matrix is singular, which both methods say alike."""
    for method in ("embedding", "lagrange"):
        model = models.point_chain()
        empty = model.body("empty", mass=0)
        model.revolute("q4", model.bodies["link3"].at(0, -1, 0), empty)
        refuses("EG-NO-INERTIA joints.q4", model.compile, method=method, target="numpy")


# -- Models with outputs and inputs, cut joints, skates ----------------------------------------------------------------
OLDER = ("embedding", "lagrange", "recursive")
OTHER_FORMS = [method for method in METHODS if method not in OLDER]
AGREED = 1e-10
KERNELS = ["rhs", "mass_matrix", "bias", "inverse_dynamics", "energy", "outputs"]
POWERED = [
    "two_link_manipulator",
    "slider_crank",
    "tilted_four_bar",
    "powered_arm",
    "powered_slider_crank",
]  # outputs, inputs


def compare_all(reference: Any, other: Any, states: list[np.ndarray], t: float) -> None:
    compare(other, reference, states, np.random.default_rng(1), t)
    for x in states:
        same(other.energy(x), reference.energy(x))
        y, size = reference.outputs(t, x), np.abs(reference.rhs(t, x)).max()
        assert np.abs(other.outputs(t, x) - y).max(initial=0.0) <= AGREED * max(1.0, size)


@pytest.mark.parametrize("name", POWERED)
def test_every_form_on_further_models(name: str) -> None:
    reference = models.build(name).compile("embedding", target="numpy")
    states = judges.random_states(reference, 11, 4)
    for method in OTHER_FORMS:
        compare_all(reference, models.build(name).compile(method, target="numpy", kernels=KERNELS), states, t=0.3)


def sleigh() -> eg.Model:
    m = eg.Model("sleigh")
    runner = m.body("runner", mass=1.3, com=(0.25, 0, 0), inertia={"zz": 0.2})
    m.planar("f", m.ground, runner, coordinates=["x", "y", "phi"])
    m.knife_edge("blade", runner)
    return m


def steered() -> eg.Model:
    """A trailer and the steered front of a cart, each on a knife edge; the steering angle is driven by a moment."""
    m = eg.Model("cart")
    cart = m.body("cart", mass=3.0, com=(0.4, 0, 0), inertia={"zz": 0.6})
    front = m.body("front", mass=0.4, inertia={"zz": 0.05})
    m.planar("f", m.ground, cart, coordinates=["x", "y", "phi"])
    m.revolute("steer", cart.at(1.0, 0, 0), front, coordinate="delta", armature=0.3)
    m.knife_edge("rear", cart)
    m.knife_edge("nose", front)
    m.torque("hand", "steer", m.input("moment"))
    m.force("pull", cart.at(0.2, 0, 0), (2.0, 0.5, 0), axes="body")
    m.initial(x_dot=1.0, delta=0.3)
    return m


def turning_wheel() -> eg.Model:
    m = eg.Model("ring", gravity=(0, 0, -9.81))
    wheel = m.body("wheel", mass=1, inertia=(0.05, 0.05, 0.09))
    m.free("f", m.ground, wheel, sequence="zxz", coordinates=["x", "y", "z", "yaw", "lean", "spin"])
    m.rolling("roll", wheel, m.ground, radius=0.3, tube=0.05)
    m.initial(lean=1.2, yaw_dot=0.3, spin_dot=6.0)
    return m


@pytest.mark.parametrize("make", [sleigh, steered, turning_wheel])
def test_nonholonomic_constraints_in_every_form(make: Any) -> None:
    model = make()
    reference = model.compile("embedding", target="numpy")
    rigid = judges.described(model)
    states = judges.random_states(reference, 3, 3)
    n = reference.n_q
    for method in OTHER_FORMS:
        mod = model.compile(method, target="numpy", kernels=KERNELS)
        compare_all(reference, mod, states, t=0.0)
        if make is steered:  # its forces the judge does not know
            continue
        for x in states:
            M, h = judges.Bodies(reference, x[:n], x[n:]).newton_euler(rigid)
            expected = judges.augmented(M, h, *judges.loop_terms(reference, x[:n], x[n:]))
            judges.agree(mod.rhs(0.0, x)[n:], expected, 1e-9)


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("method", ["newton_euler", "amalgamated"])
def test_a_motion_without_inertia_is_named(method: str, target: str) -> None:
    m = eg.Model("empty", gravity=(0, -9.81, 0))
    rod = m.body("rod", mass=m.parameter("m", 1.0), com=(0.5, 0, 0))
    m.revolute("A", m.ground, rod, coordinate="theta")
    mod = m.compile(method, target=target, kernels=["rhs", "mass_matrix"])
    refuses("EG-SINGULAR theta", lambda: mod.bind(p={"m": 0.0}).rhs(0.0, np.zeros(2)))


# -- Further examples --------------------------------------------------------------------------------------------------
EXAMPLES = models.EXAMPLES
FURTHER = sorted({path.stem for path in EXAMPLES.glob("*.yaml")} - set(models.EXAMPLE_NAMES))
EVERY = [method for method in METHODS if method != "embedding"]
FEW = ["rhs", "mass_matrix", "bias"]
TEN = 1e-10


@pytest.mark.parametrize("name", part_of(FURTHER, {*COVERING, *models.DRIVEN_NAMES}.__contains__))
def test_forms_agree(name: str) -> None:
    model = eg.load(EXAMPLES / f"{name}.yaml")
    reference = model.compile("embedding", target="numpy")
    states, n = judges.random_states(reference, 7, 2, position=0.02, speed=1.0), reference.n_q
    for method in EVERY:
        other = model.compile(method, target="numpy", kernels=FEW)
        assert other.x_names == reference.x_names
        for x in states:
            expected = reference.rhs(0.0, x)
            here = float(np.linalg.cond(reference.embedded_mass_matrix(x[:n]))) if reference.n_dof else 1.0
            judges.agree(other.rhs(0.0, x)[n:], expected[n:], TEN, here)
            for one, two in (
                (other.mass_matrix(x[:n]), reference.mass_matrix(x[:n])),
                (other.bias(0.0, x), reference.bias(0.0, x)),
            ):
                assert np.abs(one - two).max() <= 1e-11 * max(1e-3, np.abs(two).max()), method


# -- Energy ------------------------------------------------------------------------------------------------------------
BOTH = ["embedding", "lagrange"]
#: Which are compiled for a run of ten seconds always, the rest by ``make thorough``.
RUNS = [(name, "embedding") for name in ("slider_crank", "rolling_disc", "spatial_loop")]
CONSERVATIVE = {
    "pendulum": {},
    "double_pendulum": {},
    "two_link_manipulator": {},
    "slider_crank": {},
    "four_bar": {},
    "peaucellier": {},
    "chain": {},
    "cart_pendulum": {},
    "spherical_pendulum": {},
    "cam_follower": {},
    "rolling_disc": {},
    "bicycle": {},
    "free_slider_crank": {"theta_dot": 30.0},
    "skewed_four_bar": {},
    "spatial_loop": {"theta_dot": 4.0},
}


@pytest.mark.parametrize(("name", "method"), part_of(product(CONSERVATIVE, BOTH), RUNS.__contains__))
def test_energy_is_kept_over_ten_seconds(module: Callable[..., Any], name: str, method: str) -> None:
    mod = module(name, method, "cython")
    run = mod.simulate((0, 10), CONSERVATIVE[name] or None, method="DOP853", rtol=1e-10, atol=1e-12)
    angles = [k for k, kind in enumerate(mod.metadata["coordinate_kinds"]) if kind == "angle"]
    assert np.ptp(run.x[angles], axis=1).max() > 1.0  # it moved: at least one radian
    T, V = mod.energy(run.x)
    energy = T + V
    assert np.abs(energy - energy[0]).max() <= 1e-9 * T.max()
    if mod.n_c:
        assert run.residuals.position < 1e-11


# -- A loop, a gear and rolling in one machine -------------------------------------------------------------------------
OF_LOOPS = ["rhs", "mass_matrix", "energy", "poses", "constraints", "constraint_jacobian", "velocity_constraints",
           "project", "embedded_mass_matrix", "scales", "alignment"]  # fmt: skip


def shell(rotation: str) -> eg.Model:
    """A ball that rolls on a plane; in it a four-bar whose crank drives a flywheel by a gear."""
    m = eg.Model("shell", gravity=(0.4, -0.3, -9.81))
    ball = m.body("ball", mass=3.0, com=(0.02, 0.01, -0.03), inertia=(0.05, 0.06, 0.07))
    crank = m.body("crank", mass=0.4, com=(0.05, 0, 0), inertia=(1e-4, 4e-4, 5e-4))
    rod = m.body("rod", mass=0.6, com=(0.15, 0.01, 0), inertia=(1e-4, 4e-3, 4e-3))
    rocker = m.body("rocker", mass=0.5, com=(0.12, 0, 0.01), inertia=(1e-4, 3e-3, 3e-3))
    flywheel = m.body("flywheel", mass=0.8, com=(0.01, 0, 0), inertia=(2e-3, 2e-3, 4e-3))
    m.free("f", m.ground, ball, rotation=rotation)
    m.revolute("A", ball.at(-0.1, 0, 0), crank, coordinate="a")
    m.revolute("B", crank.at(0.1, 0, 0), rod)
    m.revolute("D", ball.at(0.2, 0, 0), rocker, coordinate="d")
    m.revolute("C", rod.at(0.3, 0, 0), rocker.at(0.24, 0, 0))
    m.revolute("F", ball.at(0, 0.2, 0.1), flywheel, coordinate="w")
    m.gear("mesh", "a", "w", radii=(0.06, 0.02))
    m.rolling("roll", ball, m.ground, radius=0.5, shape="sphere")
    m.initial(a=0.7, f_z=0.5)
    m.guess(d=1.6, B=-0.2)
    return m


@pytest.mark.parametrize("targets", [("numpy",), pytest.param(("cython",), marks=pytest.mark.thorough)])
@pytest.mark.parametrize("rotation", ["euler_angles", "euler_parameters"])
def test_a_loop_a_gear_and_rolling_together(rotation: str, targets: tuple[str, ...]) -> None:
    model = shell(rotation)
    report = model.check()
    assert report.degrees_of_freedom == 4  # three of the rolling ball, one of the four-bar with its flywheel
    modules: dict[Any, Any] = {}
    for method, target in [("embedding", "numpy"), *product(METHODS, targets)]:
        options = {"optimize": 0} if target == "cython" else {}
        modules[method, target] = model.derive(method).compile(target=target, kernels=OF_LOOPS, **options)
    one = modules["embedding", "numpy"]
    n = one.n_q
    assert one.n_dof == 4
    rigid = judges.described(model)
    random, start = np.random.default_rng(6), one.x0()
    for _ in range(2):
        rough = start + 0.1 * random.uniform(-1, 1, one.n_x)
        rough[n:] = random.uniform(-2, 2, one.n_v)
        x = one.project(rough)
        assert np.abs(one.constraints(x[:n], rows="all")).max() < 1e-12
        assert np.abs(one.velocity_constraints(x, rows="all")).max() < 1e-11
        q, v = x[:n], x[n:]
        N = basis(one, q)
        q_dot = N @ v
        bodies = judges.Bodies(one, q, q_dot)
        # what rolls does not slip: the ball's lowest point is at rest
        ball = one.body_names.index("ball")
        low = bodies.v[ball] + np.cross(bodies.w[ball], [0, 0, -0.5])
        np.testing.assert_allclose(low, 0.0, atol=1e-10)
        M, h = in_velocities(one, q_dot, N, v, *bodies.newton_euler(rigid))
        C_q = one.constraint_jacobian(q, rows="all")
        a = judges.augmented(M, h, C_q, gamma(one, x, q_dot))
        cond = max(np.linalg.cond(M), np.linalg.cond(one.embedded_mass_matrix(q)))
        for module in modules.values():
            np.testing.assert_allclose(module.project(x), x, rtol=0, atol=1e-11)
            x_dot = module.rhs(0.0, x)
            judges.agree(x_dot[n:], a, 1e-8, cond)
            judges.agree(x_dot[n:], one.rhs(0.0, x)[n:], 1e-11, cond)
            assert module.energy(x)[0] == pytest.approx(0.5 * v @ module.mass_matrix(q) @ v, rel=1e-12)
            change, parts = energy_rate(module, q_dot, x, x_dot[n:])
            assert abs(change) <= 1e-9 * parts  # constraints do no work
