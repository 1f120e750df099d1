"""Trees with spherical and free joints in Euler parameters, judged from outside: Pinocchio, MuJoCo, poses alone."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
import pytest
import rotations
from judges import Bodies, RigidBodies
from mechanisms import Random, random_mechanism
from sweeps import part_of

import eomgen as eg
from eomgen.api.equations import Equations
from eomgen.equations import METHODS
from eomgen.kinematics import analyse
from eomgen.kinematics.mobility import find_mobility

STEPS = {
    "revolute": "RZ",
    "prismatic": "PZ",
    "cylindrical": "PZ RZ",
    "planar": "PX PY RZ",
    "spherical": "Spherical",
    "free": "PX PY PZ Spherical",
    "weld": "",
}


def module_of(made: Random, method: str = "embedding", target: str = "numpy") -> Any:
    kinematics = analyse(made.mechanism)
    return Equations(kinematics, find_mobility(kinematics), METHODS[method](kinematics)).compile(target)


def random_state(module: Any, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    return (random.uniform(-1, 1, module.n_q), *random.uniform(-2, 2, (2, module.n_v)))


def seeds_with_balls(count: int, **options: Any) -> list[int]:
    found = []
    for seed in range(200):
        made = random_mechanism(
            seed, bodies=1 + seed % 5, forces=False, types=tuple(STEPS), rotation="euler_parameters", **options
        )
        if any(spec.joint.quaternion_slots for spec in made.mechanism.joints):
            found.append(seed)
        if len(found) == count:
            return found
    raise AssertionError


def with_methods(seeds: list[int]) -> list[Any]:
    """Two trees by every method, the others always by two methods each."""
    pairs = [(seed, k, method) for k, seed in enumerate(seeds) for method in sorted(METHODS)]
    kept = {(seed, m) for seed, k, m in pairs if k < 2 or sorted(METHODS).index(m) % 4 == k % 4}
    return part_of([(seed, method) for seed, _, method in pairs], lambda pair: pair in kept)


@pytest.mark.parametrize(("seed", "method"), with_methods(seeds_with_balls(8)))
def test_tree_equals_pinocchio(seed: int, method: str) -> None:
    made = random_mechanism(seed, bodies=1 + seed % 5, forces=False, types=tuple(STEPS), rotation="euler_parameters")
    module = module_of(made, method)
    model = pin.Model()
    model.gravity.linear = made.gravity
    holders: dict[int, tuple[int, pin.SE3]] = {}
    q_order: list[int] = []
    first = 0
    for k in (b.body for b in analyse(made.mechanism).topology.branches):
        joint, base = holders[made.parents[k]] if made.parents[k] >= 0 else (0, pin.SE3.Identity())
        at = base * pin.SE3(made.outer[k].rotation, made.outer[k].position)
        for s, step in enumerate(STEPS[made.kinds[k]].split()):
            joint = model.addJoint(joint, getattr(pin, f"JointModel{step}")(), at, f"j{k}_{s}")
            at = pin.SE3.Identity()
            q_order += [first + i for i in ((1, 2, 3, 0) if step == "Spherical" else (0,))]  # x y z w there
            first += 4 if step == "Spherical" else 1
        body = at * pin.SE3(made.inner[k].rotation, made.inner[k].position).inverse()
        model.appendBodyToJoint(joint, pin.Inertia(made.masses[k], made.centers[k], made.inertias[k]), body)
        holders[k] = joint, body
    data = model.createData()
    offsets: list[float] = []
    assert (model.nq, model.nv) == (module.n_q, module.n_v)
    for trial in range(3):
        q, v, a = random_state(module, 10 * seed + trial)
        theirs = module.project(np.concatenate([q, v]))[: module.n_q][q_order]
        M = pin.crba(model, data, theirs)
        M = np.triu(M) + np.triu(M, 1).T
        h = pin.nonLinearEffects(model, data, theirs, v)
        np.testing.assert_allclose(module.mass_matrix(q), M, atol=1e-11 * np.abs(M).max())
        np.testing.assert_allclose(module.bias(0.0, np.concatenate([q, v])), h, atol=1e-11 * np.abs(h).max())
        tau = pin.rnea(model, data, theirs, v, a)
        np.testing.assert_allclose(module.inverse_dynamics(q, v, a), tau, atol=1e-11 * np.abs(tau).max())
        T, V = module.energy(np.concatenate([q, v]))
        assert pytest.approx(pin.computeKineticEnergy(model, data, theirs, v), rel=1e-11) == T
        offsets.append(V - pin.computePotentialEnergy(model, data, theirs))  # welded to ground: a constant of ours
    assert np.ptp(offsets) < 1e-11 * max(1.0, np.abs(offsets).max())


@pytest.mark.parametrize(("seed", "method"), with_methods(seeds_with_balls(8, reverse=True)))
def test_reversed_joints_equal_newton_and_euler_from_poses_alone(seed: int, method: str) -> None:
    made = random_mechanism(
        seed, bodies=1 + seed % 5, forces=False, reverse=True, types=tuple(STEPS), rotation="euler_parameters"
    )
    module = module_of(made, method)
    q, v, _ = random_state(module, seed)
    q = module.project(np.concatenate([q, v]))[: module.n_q]
    N = np.array([rotations.coordinate_rates(module.metadata, q, e) for e in np.eye(module.n_v)]).T
    q_dot = N @ v
    rigid = RigidBodies(made.masses, made.centers, made.inertias, made.gravity)
    M_q, h_q = Bodies(module, q, q_dot).newton_euler(rigid)
    M = N.T @ M_q @ N
    bent = rotations.coordinate_rates(module.metadata, q_dot, v)  # N' v, linear in the Euler parameters ...
    bent[[name[-3:-1] != "_e" for name in module.q_names]] = 0.0  # ... and zero elsewhere
    h = N.T @ (h_q + M_q @ bent)
    np.testing.assert_allclose(module.mass_matrix(q), M, atol=1e-9 * np.abs(M).max())
    np.testing.assert_allclose(module.bias(0.0, np.concatenate([q, v])), h, atol=1e-8 * max(1.0, np.abs(h).max()))


def test_motion_of_a_free_body_and_a_ball_joint_equals_mujoco() -> None:
    text = """
    <mujoco><option gravity="0.2 -0.3 -9.81"/><worldbody>
      <body pos="0.1 0.2 0.3"><freejoint/>
        <inertial pos="0.05 0.02 -0.03" mass="2" fullinertia="0.1 0.2 0.25 0.01 -0.02 0.03"/>
        <body pos="0.3 0.1 0.2"><joint type="ball"/>
          <inertial pos="0.2 0.1 0" mass="1.5" fullinertia="0.05 0.06 0.07 0 0.01 0"/></body>
      </body></worldbody></mujoco>"""
    theirs = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(theirs)
    m = eg.Model("pair", gravity=(0.2, -0.3, -9.81))
    tensors = ({"xx": 0.1, "yy": 0.2, "zz": 0.25, "xy": 0.01, "xz": -0.02, "yz": 0.03},
               {"xx": 0.05, "yy": 0.06, "zz": 0.07, "xz": 0.01})  # fmt: skip
    one = m.body("one", mass=2, com=(0.05, 0.02, -0.03), inertia=tensors[0])
    two = m.body("two", mass=1.5, com=(0.2, 0.1, 0), inertia=tensors[1])
    m.free("f", m.ground, one, rotation="euler_parameters")
    m.spherical("s", one.at(0.3, 0.1, 0.2), two, rotation="euler_parameters")
    module = m.compile(target="numpy")
    for seed in range(5):
        q, v, _ = random_state(module, seed)
        x = module.project(np.concatenate([q, v]))
        data.qpos[:], data.qvel[:] = x[: module.n_q], v
        mujoco.mj_forward(theirs, data)
        a = module.rhs(0.0, x)[module.n_q :]
        np.testing.assert_allclose(a, data.qacc, atol=1e-10 * np.abs(a).max())


@pytest.mark.parametrize("target", ["cython", "numpy"])
def test_targets_methods_jacobian_and_identities(target: str) -> None:
    seed = seeds_with_balls(5)[-1]
    made = random_mechanism(seed, bodies=1 + seed % 5, forces=True, types=tuple(STEPS), rotation="euler_parameters")
    module, other = module_of(made, "embedding", target), module_of(made, "lagrange", "numpy")
    for trial in range(3):
        q, v, _ = random_state(module, trial)
        x = np.concatenate([q, v])
        x_dot = module.rhs(0.3, x)
        np.testing.assert_allclose(x_dot, other.rhs(0.3, x), atol=1e-11 * np.abs(x_dot).max())
        np.testing.assert_allclose(x_dot[: module.n_q], rotations.coordinate_rates(module.metadata, q, v), atol=1e-14)
        unit = module.project(x)
        e_free = np.array([n[-3:-1] != "_e" for n in module.q_names] + [True] * module.n_v)
        np.testing.assert_allclose(unit[e_free], x[e_free], atol=0)
        np.testing.assert_allclose(module.rhs(0.3, unit)[module.n_q :], x_dot[module.n_q :], rtol=1e-10, atol=1e-10)
        np.testing.assert_allclose(0.5 * v @ module.mass_matrix(q) @ v, module.energy(x)[0], rtol=1e-12)
        J, h = module.jacobian(0.3, x), 1e-5
        slopes = [(module.rhs(0.3, x + h * e) - module.rhs(0.3, x - h * e)) / (2 * h) for e in np.eye(module.n_x)]
        np.testing.assert_allclose(J, np.array(slopes).T, atol=1e-7 * np.abs(J).max())
