"""Centre of mass, momentum and centroidal inertia against Pinocchio on random trees of every joint type."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from mechanisms import Random, random_mechanism

from eomgen.describe.mechanism import Quantity
from eomgen.graph import evaluate
from eomgen.kinematics import analyse

from ..equations.test_against_pinocchio import STEPS, pinocchio_model


def random_tree(seed: int) -> Random:
    """A tree of joints that Pinocchio has too."""
    return random_mechanism(seed, bodies=1 + seed % 6, forces=False, types=tuple(STEPS))


def held_by_ground(made: Random) -> bool:
    """Whether a body is welded to ground; Pinocchio leaves such bodies out of its sums."""
    fixed = {-1}
    for k, (parent, kind) in enumerate(zip(made.parents, made.kinds, strict=True)):
        if kind == "weld" and parent in fixed:
            fixed.add(k)
    return len(fixed) > 1


SEEDS = [seed for seed in range(24) if not held_by_ground(random_tree(seed))]


def test_enough_trees_are_compared() -> None:
    assert len(SEEDS) >= 15


@pytest.mark.parametrize("seed", SEEDS)
def test_sums_over_bodies_equal_pinocchio(seed: int) -> None:
    made = random_tree(seed)
    kinematics = analyse(made.mechanism)
    model, _ = pinocchio_model(made, [b.body for b in kinematics.topology.branches])
    data, total = model.createData(), kinematics.motion.momentum
    n = model.nv
    names = [f"a{axis}(com)" for axis in "xyz"]
    asked = replace(made.mechanism, quantities={x: Quantity(None, 2, k) for k, x in enumerate(names)})
    mapping = kinematics.motion.derived_symbols(asked, set(names))
    acceleration = [mapping[made.mechanism.graph.symbol(x)] for x in names]
    random = np.random.default_rng(seed + 2000)
    for _ in range(3):
        q, v, a = random.uniform(-1, 1, (3, n))
        values = {"t": 0.0}
        for suffix, x in (("", q), ("_dot", v), ("_ddot", a)):
            values |= {name + suffix: float(x[i]) for i, name in enumerate(kinematics.names)}

        def equal(ours, theirs: np.ndarray, values: dict[str, float] = values) -> None:
            numbers = np.array(evaluate(list(ours), values), dtype=float).reshape(theirs.shape)
            assert np.abs(numbers - theirs).max() <= 1e-12 * max(1.0, np.abs(theirs).max())

        pin.centerOfMass(model, data, q, v, a)
        equal([total.mass], np.array([data.mass[0]]))
        equal(total.centre, data.com[0])
        equal(total.velocity, data.vcom[0])
        equal(acceleration, data.acom[0])
        equal((x for row in total.jacobian(n) for x in row), pin.jacobianCenterOfMass(model, data, q))
        h = pin.computeCentroidalMomentum(model, data, q, v)
        equal((*total.linear, *total.angular), np.concatenate([h.linear, h.angular]))
        pin.ccrba(model, data, q, v)
        equal((x for row in total.inertia for x in row), np.array(data.Ig.inertia))
        point = random.uniform(-1, 1, 3)  # about a point: pin's spatial momentum and inertia moved there
        moved = pin.SE3(np.eye(3), data.com[0] - point)
        at = tuple(made.mechanism.graph.constant(x) for x in point.tolist())
        equal(total.angular_about(at), moved.act(h).angular)
        d = data.com[0] - point
        shifted = np.array(data.Ig.inertia) + data.mass[0] * (d @ d * np.eye(3) - np.outer(d, d))
        equal((x for row in total.inertia_about(at) for x in row), shifted)
