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

FORMS = [method for method in METHODS if method != "embedding"]
DIGITS = 1e-11


def embedded_condition(module: Any, q: np.ndarray) -> float:
    return float(np.linalg.cond(module.embedded_mass_matrix(q))) if module.n_dof else 1.0


def results(module: Any, x: np.ndarray, t: float, a: np.ndarray | None = None, **u: Any) -> list[np.ndarray]:
    """M and h, with accelerations M a + h and energies too."""
    q, v = x[: module.n_q], x[module.n_q :]
    found = [module.mass_matrix(q), module.bias(t, x, **u)]
    return found if a is None else [*found, module.inverse_dynamics(q, v, a, **u, t=t), np.array(module.energy(x))]


def compare(one: Any, other: Any, states: list[np.ndarray], t: float, digits: float, whole: bool = True) -> None:
    """M, h and accelerations; where the whole is wanted M a + h, energies and outputs too, at random inputs."""
    assert one.x_names == other.x_names
    n, random = one.n_q, np.random.default_rng(6)
    u = {"u": random.uniform(-1, 1, one.n_u)} if whole else {}
    for x in states:
        a = random.uniform(-5, 5, n) if whole else None
        for ours, theirs in zip(results(one, x, t, a, **u), results(other, x, t, a, **u), strict=True):
            assert np.abs(ours - theirs).max(initial=0.0) <= DIGITS * np.abs(theirs).max(initial=0.0 if whole else 1e-3)
        judges.agree(one.rhs(t, x, **u)[n:], other.rhs(t, x, **u)[n:], digits, embedded_condition(other, x[:n]))
        if whole:
            y, size = other.outputs(t, x), np.abs(other.rhs(t, x)).max()
            assert np.abs(one.outputs(t, x) - y).max(initial=0.0) <= 1e-10 * max(1.0, size)


def judge(
    mod: Any, rigid: judges.RigidBodies, x: np.ndarray, forces: Callable[..., Any] | None = None, others: Any = ()
) -> judges.Bodies:
    """Compare the accelerations of a module, and of others of the same model, with those of the judge."""
    n = mod.n_q
    q, v, N = x[:n], x[n:], basis(mod, x[:n])
    bodies = judges.Bodies(mod, q, N @ v)
    M, h = bodies.newton_euler(rigid)
    if forces is not None:
        h = h - forces(mod, bodies, q, v)
    M, h = in_velocities(mod, N @ v, N, v, M, h)
    C_q = mod.constraint_jacobian(q, rows="all")
    a = judges.augmented(M, h, C_q, gamma(mod, x, N @ v)) if mod.n_c else np.linalg.solve(M, -h)
    cond = max(embedded_condition(mod, q), np.linalg.cond(M))
    judges.agree(mod.rhs(0.0, x)[n:], a, DIGITS, cond)
    for other in others:
        judges.agree(other.rhs(0.0, x)[n:], a, 10 * DIGITS, cond)
    return bodies


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


#: Models of which the judge knows all forces, and others: with inputs and outputs, or by builders that stand here.
JUDGED = [*models.EXAMPLE_NAMES, "offset_slider_crank", "spatial_loop", "skewed_four_bar", "three_cranks",
          sleigh, turning_wheel]  # fmt: skip
POWERED = ["tilted_four_bar", "powered_arm", "powered_slider_crank", steered]
KERNELS = ["rhs", "mass_matrix", "bias", "inverse_dynamics", "energy", "outputs"]


@pytest.mark.parametrize("case", [*JUDGED, *POWERED], ids=lambda case: case if isinstance(case, str) else case.__name__)
def test_every_form(module: Callable[..., Any], case: Any) -> None:
    """Beside embedding and Newton and Euler with multipliers, redundant and nonholonomic rows included."""

    def build() -> eg.Model:
        return models.build(case) if isinstance(case, str) else case()

    reference = module(case) if isinstance(case, str) else build().compile(target="numpy")
    forms = [build().compile(method, target="numpy", kernels=KERNELS) for method in FORMS]
    states = judges.random_states(reference, 5, 3)
    for form in forms:
        compare(form, reference, states, 0.3, DIGITS)
    if case in JUDGED:
        rigid = judges.described(build())
        for x in states:
            judge(reference, rigid, x, FORCES.get(case), forms)


#: Further examples.
FURTHER = sorted({path.stem for path in models.EXAMPLES.glob("*.yaml")} - set(models.EXAMPLE_NAMES))


@pytest.mark.parametrize("name", part_of(FURTHER, {*COVERING, *models.DRIVEN_NAMES}.__contains__))
def test_forms_agree(name: str) -> None:
    model = models.build(name)
    reference = model.compile("embedding", target="numpy")
    states = judges.random_states(reference, 7, 2, position=0.02, speed=1.0)
    for method in FORMS:
        other = model.compile(method, target="numpy", kernels=["rhs", "mass_matrix", "bias"])
        compare(other, reference, states, 0.0, 1e-10, whole=False)


@pytest.mark.parametrize("targets", [("numpy",), pytest.param(("cython",), marks=pytest.mark.thorough)])
@pytest.mark.parametrize("rotation", ["euler_angles", "euler_parameters"])
def test_a_loop_a_gear_and_rolling_together(rotation: str, targets: tuple[str, ...]) -> None:
    model = shell(rotation)
    assert model.check().degrees_of_freedom == 4  # three of the rolling ball, one of the four-bar with its flywheel
    kernels = ["rhs", "mass_matrix", "energy", "project"]
    modules = [model.compile(method, target=target, kernels=kernels, **({"optimize": 0} if target == "cython" else {}))
               for method, target in product(METHODS, targets)]  # fmt: skip
    one, rigid = model.compile(target="numpy"), judges.described(model)
    n = one.n_q
    assert one.n_dof == 4
    for x in judges.random_states(one, 6, 2, position=0.1, speed=2.0):
        assert np.abs(one.constraints(x[:n], rows="all")).max() < 1e-12
        assert np.abs(one.velocity_constraints(x, rows="all")).max() < 1e-11
        bodies, ball = judge(one, rigid, x, None, modules), one.body_names.index("ball")
        low = bodies.v[ball] + np.cross(bodies.w[ball], [0, 0, -0.5])  # what rolls does not slip
        np.testing.assert_allclose(low, 0.0, atol=1e-10)
        q, v, q_dot = x[:n], x[n:], basis(one, x[:n]) @ x[n:]
        for module in modules:
            np.testing.assert_allclose(module.project(x), x, rtol=0, atol=1e-11)
            x_dot = module.rhs(0.0, x)
            judges.agree(x_dot[n:], one.rhs(0.0, x)[n:], 1e-11, embedded_condition(one, q))
            assert module.energy(x)[0] == pytest.approx(0.5 * v @ module.mass_matrix(q) @ v, rel=1e-12)
            change, parts = energy_rate(module, q_dot, x, x_dot[n:])
            assert abs(change) <= 1e-9 * parts  # constraints do no work


def test_a_model_without_inertia_is_refused_by_both_methods() -> None:
    """A massless last link: the embedded mass matrix is singular, which both methods say alike."""
    for method in ("embedding", "lagrange"):
        model = models.point_chain()
        empty = model.body("empty", mass=0)
        model.revolute("q4", model.bodies["link3"].at(0, -1, 0), empty)
        refuses("EG-NO-INERTIA joints.q4", model.compile, method=method, target="numpy")


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("method", ["newton_euler", "amalgamated"])
def test_a_motion_without_inertia_is_named(method: str, target: str) -> None:
    m = eg.Model("empty", gravity=(0, -9.81, 0))
    rod = m.body("rod", mass=m.parameter("m", 1.0), com=(0.5, 0, 0))
    m.revolute("A", m.ground, rod, coordinate="theta")
    mod = m.compile(method, target=target, kernels=["rhs", "mass_matrix"])
    refuses("EG-SINGULAR theta", lambda: mod.bind(p={"m": 0.0}).rhs(0.0, np.zeros(2)))


# -- Energy ------------------------------------------------------------------------------------------------------------
#: Which are compiled for a run of ten seconds always, the rest by ``make thorough``.
RUNS = [(name, "embedding") for name in ("slider_crank", "rolling_disc", "spatial_loop")]
CONSERVATIVE: dict[str, Any] = dict.fromkeys((
    "pendulum", "double_pendulum", "two_link_manipulator", "slider_crank", "four_bar", "peaucellier", "chain",
    "cart_pendulum", "spherical_pendulum", "cam_follower", "rolling_disc", "bicycle", "skewed_four_bar",
)) | {"free_slider_crank": {"theta_dot": 30.0}, "spatial_loop": {"theta_dot": 4.0}}  # fmt: skip


@pytest.mark.parametrize(
    ("name", "method"), part_of(product(CONSERVATIVE, ("embedding", "lagrange")), RUNS.__contains__)
)
def test_energy_is_kept_over_ten_seconds(module: Callable[..., Any], name: str, method: str) -> None:
    mod = module(name, method, "cython")
    run = mod.simulate((0, 10), CONSERVATIVE[name], method="DOP853", rtol=1e-10, atol=1e-12)
    angles = [k for k, kind in enumerate(mod.metadata["coordinate_kinds"]) if kind == "angle"]
    assert np.ptp(run.x[angles], axis=1).max() > 1.0  # it moved: at least one radian
    T, V = mod.energy(run.x)
    energy = T + V
    assert np.abs(energy - energy[0]).max() <= 1e-9 * T.max()
    if mod.n_c:
        assert run.residuals.position < 1e-11
