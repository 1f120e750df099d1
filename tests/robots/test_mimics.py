"""Joints that mimic others, tied by couplings, against Pinocchio with the mimicking joints eliminated.

With v = G v_independent of the file's own factors, G^T M G and G^T h are what Pinocchio's M and h leave.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from robots.pinocchio_judge import Judge
from robots.shipped import urdf_robots
from robots.state import difference

import eomgen as eg

ROBOTS = urdf_robots()
ARM = Path(__file__).parents[2] / "examples" / "arm.urdf"
CASES = {"panda": (1, False), "baxter": (2, False), "pr2": (10, False), "panda flying": (1, True)}


def laws_of(path: Path) -> dict[str, tuple[str, float, float]]:
    """Mimicking joint -> joint, multiplier and offset, as the file has them."""
    found = {}
    for joint in ElementTree.parse(path).getroot().iter("joint"):
        mimic = joint.find("mimic")
        if mimic is not None and joint.get("type") != "fixed":
            numbers = (float(mimic.get(key, default)) for key, default in (("multiplier", "1"), ("offset", "0")))
            found[str(joint.get("name"))] = (str(mimic.get("joint")), *numbers)
    return found


def random_states(model: Any, judge: Judge, module: Any, laws: dict[str, Any], count: int) -> list[tuple[Any, ...]]:
    """Consistent positions, velocities, G, and Pinocchio's M and h there; in our order."""
    random, names = np.random.default_rng(11), module.q_names
    made = []
    for _ in range(count):
        q, v = random.uniform(-1, 1, module.n_q), random.uniform(-2, 2, module.n_v)
        moving = [n for n in module.v_names if n.removesuffix("_dot") not in laws]
        G = np.zeros((module.n_v, len(moving)))
        for k, name in enumerate(module.v_names):
            other, factor, offset = laws.get(name.removesuffix("_dot"), (name.removesuffix("_dot"), 1.0, 0.0))
            G[k, moving.index(name if name in moving else f"{other}_dot")] = factor
            if name not in moving:
                q[names.index(name.removesuffix("_dot"))] = factor * q[names.index(other)] + offset
        made.append((q, G @ v[[module.v_names.index(n) for n in moving]], G, moving))
    return made


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_coupled_mimics_equal_pinocchio_without_them(case: str) -> None:
    name, (count, floating) = case.removesuffix(" flying"), CASES[case]
    path = ROBOTS[name][0]
    laws = laws_of(path)
    assert len(laws) == count
    model = eg.load(path, floating=floating, actuate=True, mimic="coupling", rotation="euler_parameters")
    assert not any("mimic" in note for note in model.notes)
    kernels = ["mass_matrix", "bias", "rhs", "embedded_mass_matrix", "project", "constraints", "inverse_dynamics"]
    module = model.compile(optimize=0, kernels=kernels)
    assert module.n_dof == module.n_v - count
    judge = Judge(path, floating, model)
    for s in judge.states(model.derive().kinematics, 20, seed=3):
        q, v = s.q.copy(), s.v
        G, moving = reduction(module, laws)
        for joint, (other, factor, offset) in laws.items():
            q[module.q_names.index(joint)] = factor * q[module.q_names.index(other)] + offset
        v = G @ v[moving]
        assert np.abs(module.constraints(q)).max() < 1e-14
        M, h, tau, com = judge.at(module.q_names, module.v_names, q, v, s.tau)
        assert difference(module.mass_matrix(q), M) < 1e-9
        reduced = G.T @ M @ G
        order = [moving.index(k) for k in module.metadata["independent"]]
        assert difference(module.embedded_mass_matrix(q), reduced[np.ix_(order, order)]) < 1e-9
        expected = G @ np.linalg.solve(reduced, G.T @ (tau - h))
        u = np.array([s.u[name] for name in module.u_names])
        found = module.rhs(0.0, np.concatenate([q, v]), u=u)[module.n_q :]
        assert difference(found, expected) < 1e-9 * max(1.0, np.linalg.cond(reduced) / 1e3)
