"""Trees of every joint type against Pinocchio: mass matrix, bias, inverse dynamics, energies, body poses."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from mechanisms import random_mechanism
from pinocchio_trees import STEPS, pinocchio_model
from sweeps import seeds

from eomgen.equations import METHODS
from eomgen.frames import Frame, Marker
from eomgen.graph import evaluate, vectors
from eomgen.kinematics import analyse


@pytest.mark.parametrize("method", sorted(METHODS))
@pytest.mark.parametrize("planar", [False, True])
@pytest.mark.parametrize("seed", seeds(12, 6))
def test_tree_equals_pinocchio(seed: int, planar: bool, method: str) -> None:
    made = random_mechanism(seed, bodies=1 + seed % 6, planar=planar, forces=False, types=tuple(STEPS))
    kinematics = analyse(made.mechanism)
    tree = METHODS[method](kinematics)
    model, frames = pinocchio_model(made, [b.body for b in kinematics.topology.branches])
    data = model.createData()
    n = model.nv
    assert n == len(kinematics.q)
    random = np.random.default_rng(seed + 1000)
    offsets: list[float] = []
    for _ in range(3):
        q, v, a = random.uniform(-1, 1, (3, n))
        values = {"t": 0.0}
        for names, x in (("", q), ("_dot", v), ("_ddot", a)):
            values |= {name + names: float(x[i]) for i, name in enumerate(kinematics.names)}

        def number(expressions: object, values: dict[str, float] = values) -> np.ndarray:
            return np.array(evaluate(list(expressions), values), dtype=float)  # type: ignore[call-overload]

        mass = number(x for row in tree.mass_matrix for x in row).reshape(n, n)
        expected = pin.crba(model, data, q)
        expected = np.triu(expected) + np.triu(expected, 1).T
        assert np.abs(mass - expected).max() <= 1e-13 * np.abs(expected).max()
        for ours, theirs in (
            (tree.bias, pin.nonLinearEffects(model, data, q, v)),
            (tree.inverse_dynamics, pin.rnea(model, data, q, v, a)),
        ):
            assert np.abs(number(ours) - theirs).max() <= 1e-12 * max(1.0, np.abs(theirs).max())
        kinetic, potential = number([tree.kinetic_energy, tree.potential_energy])
        assert kinetic == pytest.approx(pin.computeKineticEnergy(model, data, q, v), rel=1e-12, abs=1e-12)
        # Pinocchio leaves out bodies welded to ground, a constant
        offsets.append(potential - pin.computePotentialEnergy(model, data, q))
        assert offsets[-1] == pytest.approx(offsets[0], abs=1e-11)
        pin.framesForwardKinematics(model, data, q)
        graph = made.mechanism.graph
        for k, index in frames.items():
            pose = kinematics.poses.marker(Marker(k, Frame(vectors.identity(graph), vectors.zero(graph)), ""))
            assert np.abs(number(pose.position) - data.oMf[index].translation).max() <= 1e-13 * 10
            rotation = number(x for row in pose.rotation for x in row).reshape(3, 3)
            assert np.abs(rotation - data.oMf[index].rotation).max() <= 1e-14 * 10


@pytest.mark.parametrize("planar", [False, True])
@pytest.mark.parametrize("seed", seeds(30, 16))
def test_articulated_bodies_equal_pinocchio(seed: int, planar: bool) -> None:
    made = random_mechanism(seed, bodies=1 + seed % 8, planar=planar, forces=False, types=tuple(STEPS))
    kinematics = analyse(made.mechanism)
    tree = METHODS["recursive"](kinematics)
    assert tree.accelerations is not None
    model, _ = pinocchio_model(made, [b.body for b in kinematics.topology.branches])
    data, n = model.createData(), model.nv
    q, v = np.random.default_rng(seed).uniform(-1, 1, (2, n))
    values = {"t": 0.0} | dict(zip(kinematics.names, q.tolist(), strict=True))
    values |= dict(zip([name + "_dot" for name in kinematics.names], v.tolist(), strict=True))
    expected = pin.aba(model, data, q, v, np.zeros(n))
    mass = pin.crba(model, data, q)
    condition = np.linalg.cond(np.triu(mass) + np.triu(mass, 1).T)
    accelerations = np.array(evaluate(list(tree.accelerations), values), dtype=float)
    assert np.abs(accelerations - expected).max() <= 1e-12 * max(1.0, condition / 1e3) * np.abs(expected).max()
    assert np.array(evaluate(list(tree.pivots), values), dtype=float).min() > 0.0
