"""Joints that mimic others, tied by couplings, against Pinocchio with the mimicking joints eliminated.

With v = G v_independent of the file's own factors, G^T M G and G^T h are what Pinocchio's M and h leave.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from robots.pinocchio_judge import Judge
from robots.shipped import urdf_robots
from robots.state import difference

import eomgen as eg

ROBOTS = urdf_robots()
LIMIT = 1e-9
KERNELS = ["mass_matrix", "rhs", "embedded_mass_matrix", "constraints", "centroidal"]
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


def eliminate(velocities: tuple[str, ...], laws: dict[str, tuple[str, float, float]]) -> tuple[np.ndarray, list[str]]:
    """G (n_v, n_v - joints that mimic) with v = G v_moving, and the names of v_moving."""
    tied = {f"{joint}_dot": (f"{other}_dot", factor) for joint, (other, factor, _) in laws.items()}
    moving = [name for name in velocities if name not in tied]
    G = np.zeros((len(velocities), len(moving)))
    for k, name in enumerate(velocities):
        other, factor = tied.get(name, (name, 1.0))
        G[k, moving.index(other)] = factor
    return G, moving


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_coupled_mimics_equal_pinocchio_without_them(case: str) -> None:
    name, (count, floating) = case.removesuffix(" flying"), CASES[case]
    path = ROBOTS[name][0]
    laws = laws_of(path)
    assert len(laws) == count
    model = eg.load(path, floating=floating, actuate=True, mimic="coupling", rotation="euler_parameters")
    assert not any("mimic" in note for note in model.notes)
    equations = model.derive()
    kinematics = equations.kinematics
    module = equations.compile(optimize=0, kernels=KERNELS)
    assert module.n_dof == module.n_v - count
    G, moving = eliminate(module.v_names, laws)
    order = [moving.index(f"{name}_dot" if f"{name}_dot" in moving else name) for name in equations.independent]
    judge = Judge(path, floating, model)
    for drawn in judge.states(kinematics, 20, seed=3):
        q, v = drawn.q.copy(), G @ drawn.v[[module.v_names.index(name) for name in moving]]
        for joint, (other, factor, offset) in laws.items():
            q[module.q_names.index(joint)] = factor * q[module.q_names.index(other)] + offset
        s = judge.at(module.q_names, module.v_names, q, v, drawn.a, drawn.tau)
        assert np.abs(module.constraints(q)).max() < 1e-14
        assert difference(module.mass_matrix(q), s.mass_matrix) < LIMIT
        assert np.abs(module.center_of_mass(q) - s.com).max() < LIMIT
        reduced = G.T @ s.mass_matrix @ G
        assert difference(module.embedded_mass_matrix(q), reduced[np.ix_(order, order)]) < LIMIT
        expected = G @ np.linalg.solve(reduced, G.T @ (s.tau - s.bias))
        u = np.array([s.u[name] for name in module.u_names])
        found = module.rhs(0.0, np.concatenate([q, v]), u=u)[module.n_q :]
        assert difference(found, expected) < LIMIT * max(1.0, np.linalg.cond(reduced) / 1e3)
