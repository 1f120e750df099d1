"""Random chains closed by every joint that can be cut: accelerations against multipliers, power, closure, targets.

M, h, power and twists are those of differences of body poses (tests/powered.py), loops are closed by the augmented form
(Shabana, Computational Dynamics, sec. 5.6) in NumPy, redundant rows and Euler parameters included.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import judges
import numpy as np
import pytest
from joint_numbers import Numbers
from mechanisms import LENGTH, Placement, Random, frame, make_joint, random_mechanism
from powered import Judge, basis, derived, energy_rate, gamma, powered
from scipy.spatial.transform import Rotation

from eomgen.describe.mechanism import JointSpec
from eomgen.equations import METHODS
from eomgen.frames import GROUND, Marker
from eomgen.graph import evaluate
from eomgen.joints import JOINTS
from eomgen.kinematics import analyse

CLOSING = [name for name, joint in JOINTS.items() if joint.role != "tree" and name != "free"]
KERNELS = ["rhs", "mass_matrix", "energy", "poses", "constraints", "constraint_jacobian", "velocity_constraints",
           "project", "embedded_mass_matrix", "scales", "alignment"]  # fmt: skip
ROTATIONS = ("euler_angles", "euler_parameters")
CASES = [(kind, ROTATIONS[k % 2]) for k, kind in enumerate(CLOSING)]
CASES += [("spherical", rotation) for rotation in ROTATIONS if ("spherical", rotation) not in CASES]
ANY = Rotation.from_rotvec([0.4, -0.7, 0.5]).as_matrix()
TURN = Rotation.from_rotvec([0, 0, 0.6]).as_matrix()
QUARTER = Rotation.from_euler("xz", [np.pi / 2, 0.7]).as_matrix()
#: Relative poses that obey the joints without coordinates: the definitions in words of docs, in numbers.
POSES = {
    "distance": (ANY, LENGTH * np.array([0.6, 0.48, 0.64])),
    "revolute_spherical": (ANY, LENGTH * np.array([0.6, -0.8, 0.0])),
    "inline": (ANY, np.array([0, 0, 0.7])),
    "inplane": (ANY, np.array([0.3, -0.5, 0.0])),
    "parallel": (TURN, np.array([0.3, -0.5, 0.2])),
    "perpendicular": (QUARTER, np.array([0.3, -0.5, 0.2])),
    "orientation": (np.eye(3), np.array([0.3, -0.5, 0.2])),
}


@cache
def chain_seed(types: tuple[str, ...], rotation: str) -> int:
    """The first random mechanism that is a chain of one joint of each type."""
    for seed in range(1000):
        made = random_mechanism(seed, 4, reverse=True, forces=False, types=types, rotation=rotation)
        if set(made.kinds) == set(types) and made.parents == [-1, 0, 1, 2]:
            return seed
    raise AssertionError("none found")


def closed_chain(kind: str, rotation: str) -> Random:
    """A chain of ball, universal, cylindrical joint and hinge; its last body is held to ground by a joint to be cut."""
    types = ("spherical", "universal", "cylindrical", "revolute")
    seed = chain_seed(types, rotation)
    made = powered(random_mechanism(seed, 4, reverse=True, forces=False, types=types, rotation=rotation))
    m, graph, random = made.mechanism, made.mechanism.graph, np.random.default_rng(3)
    kinematics = analyse(m)
    values = random.uniform(0.2, 0.7, len(kinematics.names))
    for ball in kinematics.quaternion_slots:
        e = values[ball.coordinate : ball.coordinate + 4]
        e /= np.linalg.norm(e)
    start = dict(zip(kinematics.names, values.tolist(), strict=True))
    tip = Placement(Rotation.random(random_state=4).as_matrix(), random.uniform(-0.5, 0.5, 3))
    pose = kinematics.poses.marker(Marker(3, frame(graph, tip), "tip"))
    flat = evaluate([*(x for row in pose.rotation for x in row), *pose.position], start | {"t": 0.0})
    R, r = np.array(flat[:9], dtype=float).reshape(3, 3), np.array(flat[9:], dtype=float)
    joint = make_joint(graph, kind, [f"close{c.suffix}" for c in JOINTS[kind].coordinates], rotation)
    if kind in POSES:
        turned, moved = POSES[kind]
    else:
        turned, moved = Numbers(kind).pose(random.uniform(0.2, 0.6, len(JOINTS[kind].coordinates)))
    hold = Placement(R @ turned.T, r - R @ turned.T @ moved)
    spec = JointSpec(
        "close",
        joint,
        Marker(GROUND, frame(graph, hold), "hold"),
        Marker(3, frame(graph, tip), "tip"),
        tuple(f"close{c.suffix}" for c in joint.coordinates),
        False,
    )
    joints = (*(replace(s, named=True) for s in m.joints), spec)
    return replace(made, mechanism=replace(m, joints=joints, guess={n: graph.constant(x) for n, x in start.items()}))


def states(module: Any, count: int) -> list[np.ndarray]:
    """Closed states near the declared position."""
    random, start = np.random.default_rng(9), module.x0()
    sizes = np.repeat([0.1, 1.0], [module.n_q, module.n_v])
    found = [np.where(sizes < 1.0, start, 0.0) + sizes * random.uniform(-1, 1, module.n_x) for _ in range(count)]
    return [module.project(x) for x in found]


@pytest.mark.parametrize(("kind", "rotation"), CASES)
def test_closed_chains_move_as_multipliers_make_them(kind: str, rotation: str) -> None:
    made = closed_chain(kind, rotation)
    which = CLOSING.index(kind)
    method = sorted(METHODS)[which % 3]
    equations = derived(made, method)
    if kind not in ("weld", "screw"):  # which would rather stay
        topology = equations.kinematics.topology
        assert [made.mechanism.joints[k].name for k in topology.cut] == ["close"]
    module = equations.compile(target="numpy", kernels=KERNELS)
    assert module.n_dof == 8 - (6 - made.mechanism.joints[-1].joint.allows)
    modules = [module]
    if which % 4 == 0:
        modules.append(equations.compile(kernels=KERNELS, optimize=0))
    n = module.n_q
    for x in states(module, 2):
        judge = Judge(module, made, x)
        N, q, v = basis(module, x[:n]), x[:n], x[n:]
        C_q = module.constraint_jacobian(q, rows="all")
        slopes = np.stack(
            [judges.first(lambda y: module.constraints(y, rows="all"), q, N[:, j]) for j in range(len(v))], 1
        )
        np.testing.assert_allclose(C_q, slopes, rtol=0, atol=1e-9 * np.abs(C_q).max())
        a = judges.augmented(judge.M, judge.h, C_q, gamma(module, x, judge.q_dot))
        cond = max(np.linalg.cond(judge.M), np.linalg.cond(module.embedded_mass_matrix(q)))
        assert np.abs(module.constraints(q, rows="all")).max() <= 1e-12
        assert np.abs(module.velocity_constraints(x, rows="all")).max() <= 1e-11
        for one in modules:
            np.testing.assert_allclose(one.project(x), x, rtol=0, atol=1e-11)
            M = one.mass_matrix(q)
            np.testing.assert_allclose(M, judge.M, rtol=0, atol=1e-10 * np.abs(M).max())
            assert np.linalg.eigvalsh(one.embedded_mass_matrix(q))[0] > 0.0
            assert one.energy(x)[0] == pytest.approx(0.5 * v @ M @ v, rel=1e-12)
            x_dot = one.rhs(0.0, x)
            np.testing.assert_allclose(x_dot[:n], judge.q_dot, rtol=0, atol=1e-11)
            judges.agree(x_dot[n:], a, 1e-8, cond)
            judges.agree(x_dot[n:], module.rhs(0.0, x)[n:], 1e-11, cond)
            change, parts = energy_rate(one, judge.q_dot, x, x_dot[n:])
            assert abs(change - judge.power) <= 1e-8 * max(abs(judge.power), parts)
