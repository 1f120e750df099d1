"""Random chains closed by every joint that can be cut, against multipliers.

M, h, power and twists are those of differences of body poses, loops are closed by the augmented form (Shabana,
Computational Dynamics, sec. 5.6) in NumPy, redundant rows and Euler parameters included.
"""

import judges
import numpy as np
import pytest
from random_models import (
    LENGTH,
    SUFFIXES,
    Judge,
    Random,
    basis,
    energy_rate,
    gamma,
    options_of,
    random_model,
    seed_with,
    states_of,
)
from scipy.spatial.transform import Rotation
from sweeps import METHODS, part_of

import eomgen as eg

KERNELS = ["rhs", "mass_matrix", "energy", "poses", "constraints", "constraint_jacobian", "velocity_constraints",
           "project", "embedded_mass_matrix", "scales", "alignment"]  # fmt: skip
ROTATIONS = ("euler_angles", "euler_parameters")
ANY = Rotation.from_rotvec([0.4, -0.7, 0.5]).as_matrix()
TURN = Rotation.from_rotvec([0, 0, 0.6]).as_matrix()
QUARTER = Rotation.from_euler("xz", [np.pi / 2, 0.7]).as_matrix()
#: Relative poses that obey the joints without coordinates: their definitions in numbers.
POSES = {
    "distance": (ANY, LENGTH * np.array([0.6, 0.48, 0.64])),
    "revolute_spherical": (ANY, LENGTH * np.array([0.6, -0.8, 0.0])),
    "inline": (ANY, np.array([0, 0, 0.7])),
    "inplane": (ANY, np.array([0.3, -0.5, 0.0])),
    "parallel": (TURN, np.array([0.3, -0.5, 0.2])),
    "perpendicular": (QUARTER, np.array([0.3, -0.5, 0.2])),
    "orientation": (np.eye(3), np.array([0.3, -0.5, 0.2])),
}
#: Degrees of freedom a joint allows: Shabana, Computational Dynamics, sec. 3.2 and 7.7; ADAMS for the primitives.
ALLOWED = {
    "revolute": 1, "continuous": 1, "prismatic": 1, "screw": 1, "cylindrical": 2, "universal": 2,
    "constant_velocity": 2, "spherical": 3, "planar": 3, "translational": 3, "weld": 0, "distance": 5,
    "revolute_spherical": 4, "inline": 4, "inplane": 5, "parallel": 4, "perpendicular": 5, "orientation": 3,
}  # fmt: skip
CASES = [(kind, ROTATIONS[k % 2]) for k, kind in enumerate(ALLOWED)]
CASES += [(kind, ROTATIONS[1 - k % 2]) for k, kind in enumerate(ALLOWED)]


def pose_of(kind: str) -> tuple[np.ndarray, np.ndarray]:
    """A relative pose that a joint allows."""
    if kind in POSES:
        return POSES[kind]
    m = eg.Model("one")
    m.joint(kind, "j", m.ground, m.body("b", mass=1, inertia=(1, 1, 1)), **options_of(kind, "j"))
    pose = m.compile(target="numpy", kernels=["rhs", "poses"]).poses(
        np.random.default_rng(3).uniform(0.2, 0.6, len(SUFFIXES[kind]))
    )[0]
    return pose[:3, :3], pose[:3, 3]


def closed_chain(kind: str, rotation: str) -> Random:
    """A chain of ball, universal, cylindrical joint and hinge; its last body is held to ground by a joint to be cut."""
    types = ("spherical", "universal", "cylindrical", "revolute")
    seed = seed_with(types, 4, chain=True)
    return random_model(seed, 4, reverse=True, forces="judged", loop=True, types=types, rotation=rotation,
                        closing=(kind, *pose_of(kind)))  # fmt: skip


@pytest.mark.parametrize(("kind", "rotation"), part_of(CASES, lambda case: CASES.index(case) < len(ALLOWED)))
def test_closed_chains_move_as_multipliers_make_them(kind: str, rotation: str) -> None:
    made = closed_chain(kind, rotation)
    which = CASES.index((kind, rotation))
    methods = {"embedding", METHODS[which % len(METHODS)]}
    modules = {method: made.model.compile(method, target="numpy", kernels=KERNELS) for method in sorted(methods)}
    if which % 4 == 0 and which >= len(ALLOWED):
        modules["in C"] = made.model.compile(kernels=KERNELS, optimize=0)
    module = modules["embedding"]
    if kind not in ("weld", "screw"):  # which would rather stay
        assert made.model.check().loop_joints == ["close"]
    assert module.n_dof == 8 - (6 - ALLOWED[kind])
    n = module.n_q
    for x in states_of(module, 9, 2):
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
        for one in modules.values():
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
