"""All forms give the same accelerations to 1e-10: random mechanisms, Euler parameters, drives, cut joints, skates.

Every example is in tests/acceptance/test_methods.py, where each form is also checked alone against judges that share
nothing with it (rigid bodies from differences of their poses, with multipliers); M and h of all are against Pinocchio
in tests/equations/test_against_pinocchio.py.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import judges
import models
import numpy as np
import pytest
from mechanisms import Random, random_mechanism

import eomgen as eg
from eomgen.api.equations import derive
from eomgen.equations import METHODS
from eomgen.errors import EvaluationError

OLDER = ("embedding", "lagrange", "recursive")  # which tests/acceptance and tests/equations compare
FORMS = [method for method in METHODS if method not in OLDER]
DIGITS = 1e-10
KERNELS = ["rhs", "mass_matrix", "bias", "inverse_dynamics", "energy", "outputs"]
MORE = [
    "two_link_manipulator",
    "slider_crank",
    "tilted_four_bar",
    "powered_arm",
    "powered_slider_crank",
]  # outputs, inputs


def compare(reference: Any, other: Any, states: list[np.ndarray], t: float) -> None:
    n_q, n = reference.n_q, reference.n_v
    assert other.x_names == reference.x_names
    random = np.random.default_rng(1)
    u = random.uniform(-1, 1, reference.n_u)
    for x in states:
        q, v, a = x[:n_q], x[n_q:], random.uniform(-5, 5, n)
        here = float(np.linalg.cond(reference.embedded_mass_matrix(q))) if reference.n_dof else 1.0
        expected = reference.rhs(t, x, u=u)
        judges.agree(other.rhs(t, x, u=u), expected, DIGITS, here)
        for one, two in (
            (other.mass_matrix(q), reference.mass_matrix(q)),
            (other.bias(t, x, u=u), reference.bias(t, x, u=u)),
            (other.inverse_dynamics(q, v, a, u=u, t=t), reference.inverse_dynamics(q, v, a, u=u, t=t)),
            (other.energy(x), reference.energy(x)),
        ):
            assert np.abs(one - two).max(initial=0.0) <= 1e-11 * max(1e-3, np.abs(two).max(initial=0.0))
        y = reference.outputs(t, x, u=u)
        assert np.abs(other.outputs(t, x, u=u) - y).max(initial=0.0) <= DIGITS * max(1.0, np.abs(expected).max())


@pytest.mark.parametrize("name", MORE)
def test_every_form_on_further_models(name: str) -> None:
    reference = models.build(name).compile("embedding", target="numpy")
    states = judges.random_states(reference, 11, 4)
    for method in FORMS:
        compare(reference, models.build(name).compile(method, target="numpy", kernels=KERNELS), states, t=0.3)


def derived(made: Random, method: str) -> Any:
    return derive(SimpleNamespace(mechanism=lambda: made.mechanism), method)  # type: ignore[arg-type]


@pytest.mark.parametrize("seed", range(6))
def test_every_form_on_random_mechanisms(seed: int) -> None:
    """Mixed joints of all types, either way round, planar and spatial, with and without a loop, with forces."""
    made = random_mechanism(
        100 + seed, bodies=2 + seed % 3, planar=seed % 4 == 3, reverse=True, loop=seed % 2 == 1,
        rotation="euler_parameters" if seed % 4 == 0 else "euler_angles",
    )  # fmt: skip
    reference = derived(made, "embedding").compile(target="numpy")
    if reference.n_c:
        states = judges.random_states(reference, seed, 2, position=0.05, speed=1.0)
    else:
        states = list(np.random.default_rng(seed).uniform(-1, 1, (2, reference.n_x)))
    for method in FORMS:
        compare(reference, derived(made, method).compile(target="numpy", kernels=KERNELS), states, t=0.3)


@pytest.mark.parametrize(
    "kind", ["revolute", "universal", "cylindrical", "spherical", "planar", "prismatic", "screw", "distance", "weld"]
)
def test_cut_joints_of_every_kind(kind: str) -> None:
    """A loop closed by each kind, a drive and a spring on its coordinate where it has one."""
    m = eg.Model("loop", gravity=(0.3, -9.81, 0.2))
    one, two = (m.body(f"b{k}", mass=1.0 + k, com=(0.1, 0.05 * k, 0.02), inertia=(0.02, 0.03, 0.04)) for k in (0, 1))
    m.spherical("S", m.ground, one, coordinates=["a1", "a2", "a3"])
    m.free("F", m.ground, two, coordinates=["x", "y", "z", "b1", "b2", "b3"])
    options = {"screw": {"pitch": 0.4, "armature": 0.07}, "distance": {"length": 0.9}, "prismatic": {"armature": 0.07}}
    near, far = one.at(0.6, 0, 0, rpy=(0.1, 0.2, 0.3)), two.at(0.05, 0, 0.1, rpy=(0, 0.2, 0.1))
    getattr(m, kind)("Z", near, far, **options.get(kind, {}))
    if kind in ("prismatic", "screw"):
        m.torque("k", "Z", "0.4 - 3*Z")
    m.spring("s", m.ground.at(1, 1, 0), far, stiffness=5.0)
    m.initial(a1=0.1, a2=0.2)
    reference = m.compile("embedding", target="numpy")
    assert reference.n_c
    assert "Z" in reference.metadata["loop_joint_names"]
    states = judges.random_states(reference, 4, 2, position=0.05, speed=1.0)
    for method in ("newton_euler", "amalgamated", "gibbs_appell"):
        compare(reference, m.compile(method, target="numpy", kernels=KERNELS), states, t=0.0)


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
    rigid = judges.rigid_bodies(model.mechanism())
    states = judges.random_states(reference, 3, 3)
    n = reference.n_q
    for method in FORMS:
        mod = model.compile(method, target="numpy", kernels=KERNELS)
        compare(reference, mod, states, t=0.0)
        if make is steered:  # its forces the judge does not know
            continue
        for x in states:
            M, h = judges.Bodies(reference, x[:n], x[n:]).newton_euler(rigid)
            expected = judges.augmented(M, h, *judges.loop_terms(reference, x[:n], x[n:]))
            judges.agree(mod.rhs(0.0, x)[n:], expected, 1e-9)


@pytest.mark.parametrize("method", ["augmented", "newton_euler", "amalgamated"])
@pytest.mark.parametrize("name", ["pendulum", "skewed_four_bar", "rolling_disc"])
def test_compiled_systems_equal_those_in_numpy(method: str, name: str) -> None:
    """The C target against NumPy, redundant rows included; status and message where no inertia is behind a motion."""
    mod, twin = (models.build(name).compile(method, target=target, kernels=["rhs"]) for target in ("cython", "numpy"))
    states = judges.random_states(models.build(name).compile(target="numpy"), 3, 4)
    for x in states:
        judges.agree(mod.rhs(0.2, x), twin.rhs(0.2, x), 1e-11)
    batch = np.array(states).T
    np.testing.assert_allclose(mod.rhs(0.2, batch)[:, 1], mod.rhs(0.2, states[1]), rtol=1e-13)


@pytest.mark.parametrize("target", ["cython", "numpy"])
@pytest.mark.parametrize("method", ["newton_euler", "amalgamated"])
def test_a_motion_without_inertia_is_named(method: str, target: str) -> None:
    m = eg.Model("empty", gravity=(0, -9.81, 0))
    rod = m.body("rod", mass=m.parameter("m", 1.0), com=(0.5, 0, 0))
    m.revolute("A", m.ground, rod, coordinate="theta")
    mod = m.compile(method, target=target, kernels=["rhs", "mass_matrix"])
    with pytest.raises(EvaluationError, match="moving theta meets no inertia"):
        mod.bind(p={"m": 0.0}).rhs(0.0, np.zeros(2))
