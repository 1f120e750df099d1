"""All methods agree, and each alone with rigid bodies from differences of poses and multipliers, in NumPy."""

from collections.abc import Callable
from itertools import product
from typing import Any

import judges
import models
import numpy as np
import pytest
import sympy as sp
from random_models import basis, energy_rate, gamma, in_velocities
from refusals import refuses
from scipy.integrate import solve_ivp
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
          sleigh, models.rounded_wheel]  # fmt: skip
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


# -- Baumgarte ---------------------------------------------------------------------------------------------------------
ALPHA, BETA = 4.0, 4.0
MODELS = [
    pytest.param("slider_crank", "cython", marks=pytest.mark.thorough),
    ("slider_crank", "numpy"),
    ("rolling_disc", "numpy"),
]


def stabilised(name: str, target: str = "numpy") -> Any:
    return models.build(name).compile("augmented", target=target, baumgarte=(ALPHA, BETA))


def perturbed(mod: Any, seed: int) -> np.ndarray:
    x = judges.random_states(mod, seed, 1, speed=1.0)[0]
    return np.asarray(x + 1e-3 * np.random.default_rng(seed).uniform(-1, 1, mod.n_x))


@pytest.mark.parametrize(("name", "target"), MODELS)
def test_accelerations_off_the_constraints_are_those_of_the_formula(name: str, target: str) -> None:
    """[M C_q^T; C_q 0] [a; l] = [-h; -gamma - 2 alpha C' - beta^2 C], put together here; x itself is not projected."""
    mod = stabilised(name, target)
    x, n = perturbed(mod, 1), mod.n_q
    C_q, gamma = judges.loop_terms(mod, x[:n], x[n:])
    gamma = gamma + 2 * ALPHA * mod.velocity_constraints(x, rows="all")
    C = mod.constraints(x[:n], rows="all")
    gamma[: len(C)] += BETA**2 * C
    expected = judges.augmented(mod.mass_matrix(x[:n]), mod.bias(0.0, x), C_q, gamma)
    found = mod.rhs(0.0, x)
    judges.agree(found[n:], expected, 1e-10)
    np.testing.assert_array_equal(found[:n], x[n:])
    closed = mod.project(x)
    plain = models.build(name).compile("embedding", target="numpy")
    judges.agree(mod.rhs(0.0, closed), plain.rhs(0.0, closed), 1e-9)  # on the constraints nothing is left of it
    np.testing.assert_allclose(mod.outputs(0.0, x), plain.outputs(0.0, x), rtol=1e-9, atol=1e-9)  # of the closed state


def test_residuals_decay_as_their_closed_form_says() -> None:
    mod = stabilised("four_bar")
    x = perturbed(mod, 2)
    n, times = mod.n_q, np.linspace(0.0, 1.5, 7)
    run = solve_ivp(mod.rhs, (0.0, 1.5), x, t_eval=times, rtol=1e-11, atol=1e-13)
    C, rate = mod.constraints(x[:n]), mod.velocity_constraints(x)
    assert np.abs(C).max() > 1e-4
    decayed = (C[:, None] + (rate + ALPHA * C)[:, None] * times) * np.exp(-ALPHA * times)
    np.testing.assert_allclose(mod.constraints(run.y[:n]), decayed, atol=1e-10)


@pytest.mark.parametrize(("name", "target"), MODELS)
def test_the_jacobian_is_that_of_the_stabilised_right_hand_side(name: str, target: str) -> None:
    mod = stabilised(name, target)
    x = perturbed(mod, 4)
    J = mod.jacobian(0.0, x)
    numeric = np.stack([judges.first(lambda s: mod.rhs(0.0, s), x, e, h=1e-3) for e in np.eye(mod.n_x)], axis=1)
    assert np.abs(J - numeric).max() <= 1e-8 * np.abs(J).max()


# -- Hamilton ----------------------------------------------------------------------------------------------------------
def spherical_pendulum() -> Any:
    t = sp.Symbol("t")
    theta, phi = sp.Function("theta")(t), sp.Function("phi")(t)
    m, l, g = sp.symbols("m l g")
    T = m * l**2 * (theta.diff(t) ** 2 + sp.sin(theta) ** 2 * phi.diff(t) ** 2) / 2
    model = eg.Model.from_lagrangian(
        "bob", T + m * g * l * sp.cos(theta), [theta, phi], parameters={m: 0.7, l: 1.3, g: 9.81}
    )
    return model.compile("hamilton", target="numpy")


def test_the_spherical_pendulum_of_the_textbooks() -> None:
    """H = p_theta^2 / 2 m l^2 + p_phi^2 / 2 m l^2 sin^2 - m g l cos (Goldstein, 3rd ed., ch. 8)."""
    form = spherical_pendulum().canonical
    assert form.z_names == ("theta", "phi", "p_theta", "p_phi")
    theta, phi, p_theta, p_phi = z = np.array([0.9, 0.2, 1.1, -0.4])
    m, l, g = 0.7, 1.3, 9.81
    J = m * l**2
    H = p_theta**2 / (2 * J) + p_phi**2 / (2 * J * np.sin(theta) ** 2) - m * g * l * np.cos(theta)
    assert form.hamiltonian(z) == pytest.approx(H, rel=1e-13)
    turning = p_phi**2 * np.cos(theta) / (J * np.sin(theta) ** 3)
    expected = [p_theta / J, p_phi / (J * np.sin(theta) ** 2), turning - m * g * l * np.sin(theta), 0.0]
    np.testing.assert_allclose(form.rhs(0.0, z), expected, rtol=1e-12, atol=1e-13)
    assert phi == z[1]


@pytest.mark.parametrize("name", ["double_pendulum", "slider_crank", "rolling_disc", "three_cranks", "car_axis"])
def test_the_motion_is_that_of_the_state_form(name: str) -> None:
    """Trees, loops, redundant, nonholonomic and driven rows: q(t) of [q; p] equals q(t) of [q; v] of another method."""
    mod, other = (models.build(name).compile(method, target="numpy") for method in ("hamilton", "embedding"))
    form, n = mod.canonical, mod.n_q
    z0 = form.z0()
    np.testing.assert_allclose(form.expand(z0), mod.x0(), rtol=1e-12, atol=1e-12)
    options = {"rtol": 1e-10, "atol": 1e-12, "method": "DOP853"}
    end = 0.2
    z = solve_ivp(form.rhs, (0.0, end), z0, **options).y[:, -1]
    x = other.project(solve_ivp(other.rhs, (0.0, end), other.x0(), **options).y[:, -1], t=end)
    found = form.expand(z, end)
    assert np.abs(found - x).max() <= 1e-8 * np.abs(x).max()
    assert np.abs(x[:n] - mod.x0()[:n]).max() > 0.02


@pytest.mark.parametrize("name", ["four_bar", "spherical_pendulum"])
def test_momenta_change_as_their_derivative_says(name: str) -> None:
    """p' = -dH/dq + Q equals the derivative of p = M v along the motion of another method."""
    mod, other = (models.build(name).compile(method, target="numpy") for method in ("hamilton", "embedding"))
    form, n = mod.canonical, mod.n_q
    for x in judges.random_states(mod, 2, 3):
        flow = other.rhs(0.0, x)

        def momenta(states: np.ndarray) -> np.ndarray:
            return np.stack([other.mass_matrix(s[:n]) @ s[n:] for s in states.T], axis=1)

        expected = judges.first(momenta, x, flow, h=1e-2)
        found = form.rhs(0.0, form.of(x))[n:]
        assert np.abs(found - expected).max() <= 1e-9 * max(1.0, np.abs(expected).max())
        assert form.hamiltonian(form.of(x)) == pytest.approx(float(np.sum(other.energy(x))), rel=1e-12, abs=1e-12)


# -- Differential-algebraic --------------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", ["double_pendulum", "slider_crank", "skewed_four_bar", "rolling_disc"])
def test_consistent_values_leave_no_residual_and_the_jacobian_is_exact(name: str) -> None:
    mod = models.build(name).compile(target="numpy")
    form = mod.dae
    x = judges.random_states(mod, 3, 1)[0]
    y, yp = form.initial(x)
    assert len(form.y_names) == form.n_y == mod.n_x + mod.n_c + len(mod.constraints(x[: mod.n_q]))
    assert np.abs(form.residual(0.0, y, yp)).max() <= 1e-11 * np.abs(yp).max()
    q, v, a = x[: mod.n_q], x[mod.n_q :], yp[mod.n_q : mod.n_x]
    l = y[mod.n_x : mod.n_x + mod.n_c]
    C_q = mod.constraint_jacobian(q)
    assert np.abs(mod.mass_matrix(q) @ a + mod.bias(0.0, x) + C_q.T @ l).max() <= 1e-10 * max(
        1.0, np.abs(l).max(initial=0)
    )
    random = np.random.default_rng(1)
    y, yp, cj = y + 0.02 * random.normal(size=form.n_y), random.normal(size=form.n_y), 3.7
    J = form.jacobian(0.2, y, yp, cj)

    def moved(columns: np.ndarray) -> np.ndarray:
        return np.stack([form.residual(0.2, c[: form.n_y], c[form.n_y :]) for c in columns.T], axis=1)

    both = np.concatenate([y, yp])
    numeric = np.stack(
        [judges.first(moved, both, np.concatenate([e, cj * e]), h=1e-3, size=1.0) for e in np.eye(form.n_y)], axis=1
    )
    assert np.abs(J - numeric).max() <= 1e-8 * np.abs(J).max()
    assert v.shape == a.shape


@pytest.mark.parametrize(
    ("name", "end", "first", "last"), [("slider_crank", 0.5, 1e-5, 1e-7), ("four_bar", 1.0, 1e-4, 1e-6)]
)
def test_ida_finds_the_trajectories_of_embedding(name: str, end: float, first: float, last: float) -> None:
    """A real solver of differential-algebraic equations on F alone: the difference falls with its tolerance."""
    pytest.importorskip("sksundae")
    mod = models.build(name).compile(target="numpy")
    times = np.linspace(0.0, end, 13)
    ours = mod.simulate((0.0, end), t_eval=times, rtol=1e-10, atol=1e-12)
    assert np.ptp(ours.x, axis=1).max() > 1.0
    errors = []
    for rtol in (1e-7, 1e-9):
        theirs = mod.dae.solve((0.0, end), t_eval=times, rtol=rtol, atol=1e-2 * rtol)
        assert theirs.metadata["method"] == "IDA"
        assert not theirs.has_dense_output
        refuses("EG-UNSUPPORTED t_eval=", theirs.at, 0.1)
        np.testing.assert_array_equal(theirs.t, times)
        errors.append(np.abs(theirs.x - ours.x).max() / np.abs(ours.x).max())
    assert errors[0] <= first
    assert errors[1] <= min(last, 0.3 * errors[0])


# -- Reactions as unknowns ---------------------------------------------------------------------------------------------
@pytest.mark.parametrize("method", ["newton_euler", "amalgamated", "embedding"])
def test_the_ground_carries_the_change_of_momentum(method: str) -> None:
    """A slider-crank, a joint between two moving bodies cut: reactions at the ground give the sum of m (a_c - g)."""
    mod = models.build("offset_slider_crank").compile(method, target="numpy")
    held = [mod.joint_names.index(name) for name in "AD"]
    for x in judges.random_states(mod, 3, 2):

        def momentum(states: np.ndarray) -> np.ndarray:
            return np.stack([mod.momentum(s)[:3] for s in states.T], axis=1)

        rate = judges.first(momentum, x, mod.rhs(0.0, x), h=1e-2)
        weight = np.array([0.0, 9.81 * 2.3, 0.0])
        np.testing.assert_allclose(mod.reactions(0.0, x)[held, :3].sum(axis=0), rate + weight, rtol=1e-8, atol=1e-8)


def test_sizes_are_those_of_the_table() -> None:
    """Bodies b, freedoms of the tree d, equations of cut joints and couplings k, velocities n, rows m."""
    methods = ("augmented", "newton_euler", "amalgamated")
    for name, b, d, k, n, m in (
        ("slider_crank", 3, 3, 5, 3, 2),
        ("rolling_disc", 1, 6, 3, 6, 3),
        ("chain", 3, 3, 0, 3, 0),
    ):
        augmented, newton_euler, amalgamated = (models.build(name).derive(method).system_size for method in methods)
        assert (newton_euler[0], amalgamated[0]) == (12 * b + k, 12 * b + d + k)
        assert augmented is None if m == 0 else augmented[0] == n + m
