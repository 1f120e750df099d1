"""Lagrange and embedding agree with each other to 1e-11, and each alone with judges that share neither.

Judges: rigid-body dynamics by Newton and Euler from differences of the body poses alone (tests/judges.py), loops closed
by the augmented form with multipliers (Shabana, Computational Dynamics, sec. 5.6), both in NumPy; and MuJoCo.  Trees of
every joint against Pinocchio are in tests/equations.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from types import SimpleNamespace
from typing import Any

import judges
import models
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mechanisms import Random, random_mechanism
from scipy.spatial.transform import Rotation
from sweeps import part_of

from eomgen.api.equations import derive
from eomgen.errors import ModelError

METHODS = ["embedding", "lagrange"]
FORMS = ["recursive", "augmented", "newton_euler", "amalgamated", "gibbs_appell", "hamilton"]
MORE = ["offset_slider_crank", "spatial_loop", "powered_slider_crank", "powered_arm", "skewed_four_bar", "three_cranks"]
DIGITS = 1e-11
SEED = 2  # a branched tree


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


@pytest.mark.parametrize("name", [*models.EXAMPLE_NAMES, *models.DRIVEN_NAMES, *MORE])
def test_methods_agree_on_models(module: Callable[..., Any], name: str) -> None:
    one = module(name, "embedding")
    other = module(name, "lagrange", "cython" if name in models.BY_LAGRANGE else "numpy")
    compare(one, other, judges.random_states(one, 11, 6), np.random.default_rng(12), t=0.3)


# random mechanisms


def derived(made: Random, method: str) -> Any:
    """Equations of a random mechanism, through the pipeline that models take."""
    return derive(SimpleNamespace(mechanism=lambda: made.mechanism), method)  # type: ignore[arg-type]


def states_of(module: Any, seed: int, count: int) -> list[np.ndarray]:
    if not module.n_c:  # a tree is free to go anywhere
        return list(np.random.default_rng(seed).uniform(-1, 1, (count, module.n_x)))
    return judges.random_states(module, seed, count, position=0.05, speed=1.0)


random_mechanisms = st.builds(
    random_mechanism,
    seed=st.integers(0, 2**20),
    bodies=st.integers(2, 4),
    planar=st.booleans(),
    reverse=st.booleans(),
    loop=st.booleans(),
)


@settings(max_examples=15, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(made=random_mechanisms, seed=st.integers(0, 2**20))
def test_methods_agree_on_random_mechanisms(made: Random, seed: int) -> None:
    one, other = (derived(made, method).compile(target="numpy") for method in METHODS)
    if one.n_dof:
        compare(one, other, states_of(one, seed, 2), np.random.default_rng(seed), t=0.3)


@pytest.mark.parametrize(("planar", "loop"), [(False, False), (False, True), (True, True)])
def test_methods_agree_on_compiled_random_mechanisms(planar: bool, loop: bool) -> None:
    made = random_mechanism(7, bodies=3, planar=planar, reverse=True, loop=loop)
    one, other = (derived(made, method).compile() for method in METHODS)
    compare(one, other, states_of(one, 3, 4), np.random.default_rng(4), t=0.3)


# against the judges


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


@pytest.mark.parametrize("method", METHODS)
@settings(max_examples=8, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(
    seed=st.integers(0, 2**20),
    bodies=st.integers(2, 4),
    planar=st.booleans(),
    reverse=st.booleans(),
    loop=st.booleans(),
)
def test_random_mechanisms_against_newton_euler_with_multipliers(
    seed: int, bodies: int, planar: bool, reverse: bool, loop: bool, method: str
) -> None:
    made = random_mechanism(seed, bodies, planar=planar, reverse=reverse, forces=False, loop=loop)
    mod = derived(made, method).compile(target="numpy")
    if not mod.n_dof:
        return
    rigid = judges.RigidBodies(made.masses, made.centers, made.inertias, made.gravity)
    for x in states_of(mod, seed, 2):
        judge(mod, rigid, x)


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


@pytest.mark.parametrize(("name", "method"), part_of(product(JUDGED, METHODS), models.runs_always))
def test_models_against_newton_euler_with_multipliers(module: Callable[..., Any], name: str, method: str) -> None:
    mod = module(name, method)
    rigid = judges.rigid_bodies(models.build(name).mechanism())
    for x in judges.random_states(mod, 5, 4):
        judge(mod, rigid, x, FORCES.get(name))


@pytest.mark.parametrize("name", JUDGED)
def test_forms_against_newton_euler_with_multipliers(module: Callable[..., Any], name: str) -> None:
    """Every other form, redundant and nonholonomic rows included; M, h and M a + h are those of embedding too."""
    kernels = ["rhs", "mass_matrix", "bias", "inverse_dynamics"]
    forms = [models.build(name).compile(method, target="numpy", kernels=kernels) for method in FORMS]
    rigid = judges.rigid_bodies(models.build(name).mechanism())
    states = judges.random_states(module(name), 5, 3)
    for form in forms:
        compare(form, module(name), states, np.random.default_rng(6), t=0.3)
    for x in states:
        judge(module(name), rigid, x, FORCES.get(name), forms)


@pytest.mark.parametrize("seed", [3, 8, 21, 34, 55])
def test_forms_on_random_mechanisms_against_newton_euler_with_multipliers(seed: int) -> None:
    """Trees and loops, planar and spatial, of mixed joints either way round; redundant rows where a loop is planar."""
    made = random_mechanism(
        seed, 2 + seed % 3, planar=seed % 5 == 3, reverse=True, forces=False, loop=seed % 2 == 0 or seed == 3
    )
    mod = derived(made, "embedding").compile(target="numpy")
    forms = [derived(made, method).compile(target="numpy", kernels=["rhs"]) for method in FORMS]
    rigid = judges.RigidBodies(made.masses, made.centers, made.inertias, made.gravity)
    assert mod.n_dof
    for x in states_of(mod, seed, 2):
        judge(mod, rigid, x, others=forms)


# MuJoCo


def mujoco_text(made: Random) -> str:
    """A random tree of hinges and slides, in MuJoCo's format: body frames stand at the outer markers."""

    def numbers(*values: Any) -> str:
        return " ".join(repr(float(x)) for x in np.concatenate([np.atleast_1d(v) for v in values]))

    def quaternion(R: np.ndarray) -> str:
        return numbers(np.roll(Rotation.from_matrix(R).as_quat(), 1))

    def body(k: int, base_R: np.ndarray, base_r: np.ndarray) -> str:
        R, r = base_R @ made.outer[k].rotation, base_r + base_R @ made.outer[k].position
        inner = made.inner[k]  # body frame seen from the joint frame
        R_b, r_b = inner.rotation.T, -inner.rotation.T @ inner.position
        I = R_b @ made.inertias[k] @ R_b.T
        full = numbers(np.diag(I), I[0, 1], I[0, 2], I[1, 2])
        center = numbers(r_b + R_b @ made.centers[k])
        kind = {"revolute": "hinge", "prismatic": "slide"}[made.kinds[k]]
        children = "".join(body(j, R_b, r_b) for j, parent in enumerate(made.parents) if parent == k)
        return (
            f'<body pos="{numbers(r)}" quat="{quaternion(R)}"><joint name="q{k}" type="{kind}" axis="0 0 1"/>'
            f'<inertial pos="{center}" mass="{numbers(made.masses[k])}" fullinertia="{full}"/>{children}</body>'
        )

    roots = "".join(body(k, np.eye(3), np.zeros(3)) for k, parent in enumerate(made.parents) if parent < 0)
    gravity = numbers(made.gravity)
    return f'<mujoco><option gravity="{gravity}"/><compiler angle="radian"/><worldbody>{roots}</worldbody></mujoco>'


@pytest.mark.parametrize("method", METHODS)
def test_an_arm_of_hinges_and_slides_equals_mujoco(method: str) -> None:
    import mujoco

    made = random_mechanism(SEED, bodies=5, forces=False, types=("revolute", "prismatic"))
    assert set(made.kinds) == {"revolute", "prismatic"}
    assert len(set(made.parents)) > 3
    mod = derived(made, method).compile(target="numpy")
    model = mujoco.MjModel.from_xml_string(mujoco_text(made))
    data = mujoco.MjData(model)
    n = mod.n_q
    order = [model.joint(name).dofadr[0] for name in mod.q_names]
    random = np.random.default_rng(2)
    for _ in range(4):
        x = random.uniform(-1, 1, 2 * n)
        data.qpos[order], data.qvel[order] = x[:n], x[n:]
        mujoco.mj_forward(model, data)
        full = np.zeros((n, n))
        for row, unit in zip(full, np.eye(n), strict=True):  # M is symmetric; mj_mulM is there in every version
            mujoco.mj_mulM(model, data, row, unit)
        M, h = full[np.ix_(order, order)], data.qfrc_bias[order]
        same(mod.mass_matrix(x[:n]), M)
        same(mod.bias(0.0, x), h)
        judges.agree(mod.rhs(0.0, x)[n:], data.qacc[order], DIGITS, np.linalg.cond(M))


def test_a_model_without_inertia_is_refused_by_both_methods() -> None:
    """A massless last link: the embedded mass matrix is singular, which both methods say alike."""
    for method in METHODS:
        model = models.point_chain()
        empty = model.body("empty", mass=0)
        model.revolute("q4", model.bodies["link3"].at(0, -1, 0), empty)
        with pytest.raises(ModelError, match="q4"):
            model.compile(method=method, target="numpy")
