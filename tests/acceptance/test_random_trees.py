"""Identities of DESIGN 11 on random trees of every joint type, by every method, target and description of rotations.

Judged from outside by differences of the body poses (tests/powered.py): M and h by Newton and Euler, twists, the power
of each wrench.  What is computed is the same as the graph's own evaluator computes to a few ulp of the largest term.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import judges
import numpy as np
import pytest
from circular import circular_functions
from magnitudes import largest_terms
from mechanisms import SPATIAL, Random
from powered import Judge, derived, energy_rate, tree

from eomgen import pipeline
from eomgen.equations import METHODS
from eomgen.frames import Frame, Marker
from eomgen.graph import evaluate, vectors
from eomgen.program.program import Limits

EPS, FEW = np.finfo(float).eps, 8
KERNELS = ["rhs", "mass_matrix", "bias", "energy", "poses"]
GROUPS = [
    ("revolute", "screw", "spherical"),
    ("continuous", "universal", "free"),
    ("prismatic", "constant_velocity", "point_on_curve"),
    ("cylindrical", "planar", "weld", "curve_slider"),
    ("surface_slider", "point_on_surface", "spherical"),
    ("revolute", "translational", "spherical"),
]
LARGE = ("revolute", "spherical", "universal", "free", "cylindrical")
CASES = [(group, len(group), rotation) for group in GROUPS for rotation in ("euler_angles", "euler_parameters")
         if rotation == "euler_angles" or {"spherical", "free"} & set(group)]  # fmt: skip
CASES += [(LARGE, 9, "euler_parameters")]

#: Of so many methods one is compiled for a case.
IN_C = 3


def test_every_joint_type_is_there() -> None:
    assert {kind for group in GROUPS for kind in group} == set(SPATIAL)


class Trees:
    """One tree by every method with NumPy, and by some in C: by every method over the cases."""

    def __init__(self, made: Random, number: int) -> None:
        self.made = made
        self.equations = {method: derived(made, method) for method in METHODS}
        self.modules = {}
        large = len(made.masses) >= 9
        for k, (method, equations) in enumerate(self.equations.items()):
            self.modules[method, "numpy"] = equations.compile(kernels=KERNELS, target="numpy")
            if method == "embedding" if large else k % IN_C == number % IN_C:
                self.modules[method, "cython"] = equations.compile(kernels=KERNELS, optimize=0)

    def states(self, count: int) -> list[np.ndarray]:
        random, module = np.random.default_rng(8), self.modules["embedding", "numpy"]
        return [module.project(random.uniform(-1, 1, module.n_x)) for _ in range(count)]


@pytest.fixture(scope="module", params=CASES, ids=lambda c: f"{'-'.join(c[0])}-{c[2]}")
def trees(request: pytest.FixtureRequest) -> Trees:
    group, bodies, rotation = request.param
    return Trees(tree(group, bodies, rotation), CASES.index(request.param))


def test_the_large_tree_is_factored_in_loops() -> None:
    equations = derived(tree(LARGE, 9, "euler_parameters"), "embedding")
    assert len(equations.kinematics.v) > Limits().unrolled
    assert "rhs" not in {b.name for b in pipeline.build(equations, kernels=KERNELS).blocks}


def test_methods_equal_newton_and_euler_and_balance_power(trees: Trees) -> None:
    one = trees.modules["embedding", "numpy"]
    n = one.n_q
    for x in trees.states(2):
        judge = Judge(one, trees.made, x)
        q, v = x[:n], x[n:]
        cond, size = float(np.linalg.cond(judge.M)), np.abs(judge.M).max()
        expected = np.linalg.solve(judge.M, -judge.h)
        first = one.rhs(0.0, x)
        for module in trees.modules.values():
            M = module.mass_matrix(q)
            np.testing.assert_allclose(M, M.T, rtol=0, atol=1e-15 * size)
            assert np.linalg.eigvalsh(M)[0] > 0.0
            np.testing.assert_allclose(M, judge.M, rtol=0, atol=1e-10 * size)
            assert module.energy(x)[0] == pytest.approx(0.5 * v @ M @ v, rel=1e-12)
            np.testing.assert_allclose(module.bias(0.0, x), judge.h, rtol=0, atol=1e-9 * np.abs(judge.h).max())
            x_dot = module.rhs(0.0, x)
            np.testing.assert_allclose(x_dot[:n], judge.q_dot, rtol=0, atol=1e-13)
            judges.agree(x_dot[n:], expected, 1e-9, cond)
            judges.agree(x_dot[n:], first[n:], 1e-11, cond)
            change, parts = energy_rate(module, judge.q_dot, x, x_dot[n:])
            assert abs(change - judge.power) <= 1e-9 * max(abs(judge.power), parts)


@pytest.mark.parametrize("method", sorted(METHODS))
def test_drives_add_their_inertia(method: str) -> None:
    """A rotor that turns with a coordinate (gear included in J) adds J v^2 / 2, J on the diagonal of M and no more."""
    made = tree(("revolute", "prismatic", "screw", "free"), 5, "euler_parameters")
    m = made.mechanism
    drives = {s.coordinates[0]: 0.2 + 0.3 * k for k, s in enumerate(m.joints) if len(s.coordinates) == 1}
    joints = [replace(s, armature=m.graph.constant(drives[s.coordinates[0]])) if s.coordinates[0] in drives else s
              for s in m.joints]  # fmt: skip
    equations = derived(replace(made, mechanism=replace(m, joints=tuple(joints))), method)
    modules = [equations.compile(target="numpy", kernels=KERNELS)]
    if method == "recursive":
        modules.append(equations.compile(kernels=KERNELS, optimize=0))
    for module in modules:
        x = module.project(np.random.default_rng(8).uniform(-1, 1, module.n_x))
        judge, q, v = Judge(module, made, x), x[: module.n_q], x[module.n_q :]
        J = np.array([drives.get(name.removesuffix("_dot"), 0.0) for name in module.v_names])
        assert (J > 0.0).sum() == len(drives) >= 3
        M = judge.M + np.diag(J)
        np.testing.assert_allclose(module.mass_matrix(q), M, rtol=0, atol=1e-10 * np.abs(M).max())
        judges.agree(module.rhs(0.0, x)[module.n_q :], np.linalg.solve(M, -judge.h), 1e-9, float(np.linalg.cond(M)))
        assert module.energy(x)[0] == pytest.approx(0.5 * v @ M @ v, rel=1e-9)


def test_velocities_are_the_rates_of_poses(trees: Trees) -> None:
    """J v: velocity and angular velocity of every body, as outputs and force elements see them."""
    module, kinematics = trees.modules["embedding", "numpy"], trees.equations["embedding"].kinematics
    graph = kinematics.graph
    origin = Frame(vectors.identity(graph), vectors.zero(graph))
    for x in trees.states(2):
        bodies = Judge(module, trees.made, x).bodies
        values = {"t": 0.0} | dict(zip(module.x_names, x.tolist(), strict=True))
        for k in range(len(trees.made.masses)):
            marker = Marker(k, origin, "")
            twist = [*kinematics.motion.angular_velocity(marker), *kinematics.motion.velocity(marker)]
            found = np.array(evaluate(twist, values), dtype=float)
            np.testing.assert_allclose(found, [*bodies.w[k], *bodies.v[k]], rtol=0, atol=1e-10)


def test_targets_equal_the_evaluator(trees: Trees) -> None:
    for method, equations in trees.equations.items():
        program = pipeline.build(equations, "numpy", kernels=KERNELS)
        blocks = {b.name: b for b in program.blocks if b.public}
        assert {*blocks} >= {*KERNELS} - {"rhs", "mass_matrix"}
        for x in trees.states(2):
            values = {"t": 0.3} | dict(zip(blocks["bias"].inputs, x.tolist(), strict=True))
            for name, block in blocks.items():
                if name not in KERNELS:
                    continue
                allowed = np.maximum(largest_terms(block.outputs, values), np.finfo(float).tiny)
                for (made, target), module in trees.modules.items():
                    if made == method:
                        with circular_functions(target):
                            expected = np.array(evaluate(list(block.outputs), values), dtype=float)
                        ulps = np.abs(call(module, name, x) - expected) / (EPS * allowed)
                        assert ulps.max() <= FEW, (method, target, name)


def call(module: Any, kernel: str, x: np.ndarray) -> np.ndarray:
    """A kernel at a state and t = 0.3, flat."""
    if kernel in ("rhs", "bias"):
        return np.ravel(getattr(module, kernel)(0.3, x))
    given = x if kernel == "energy" else x[: module.n_q]
    return np.ravel(getattr(module, kernel)(given, t=0.3))
