"""Rows of constraints are told from nothing by what they can be, and gaps of long loops have the size of the loop."""

from __future__ import annotations

import numpy as np
import pytest
from sweeps import part_of

import eomgen as eg
from benchmarks.large_loops import closed_chain
from eomgen import pipeline
from eomgen.graph.evaluate import compile_evaluator
from eomgen.kinematics import analyse, find_topology
from eomgen.kinematics.constraint_functions import ConstraintFunctions
from eomgen.kinematics.row_groups import ALL, UNIT, row_groups
from eomgen.limits.crossings import NEAR, SMALL
from eomgen.numeric.partitions import partition
from eomgen.numeric.projection import correct_position
from eomgen.numeric.scales import Scales


def groups_of(model: eg.Model) -> dict[str, int]:
    kinematics = analyse(model.mechanism())
    return dict(zip(kinematics.constraints.labels, row_groups(kinematics), strict=True))


def hinged_ring() -> eg.Model:
    """Five links in space, closed by a hinge; a rod and a gear besides."""
    m = eg.Model("ring", gravity=(0, 0, -9.81))
    last = m.ground
    for i, axis in enumerate("zxyzx"):
        link = m.body(f"b{i}", mass=1.0, com=(0.5, 0, 0), inertia=(0.01, 0.1, 0.1))
        m.revolute(f"j{i}", last, link, axis=axis, coordinate=f"angle{i}")
        m.guess(**{f"angle{i}": 0.3 + 0.2 * i})
        last = link.at(1, 0, 0)
    m.spherical("end", last, m.ground.at(2, 0.5, 0.2))
    m.coupling("gear", {"angle0": 1.0, "angle1": 40.0})
    return m


def test_gaps_are_groups_and_written_rows_are_not() -> None:
    found = groups_of(hinged_ring())
    assert {found[f"end.r_{axis}"] for axis in "xyz"} == {1}
    assert found["gear.relation"] == ALL


def test_directions_are_compared_with_one() -> None:
    m = closed_chain(7, True, True)  # a hinge in the middle is cut
    found = groups_of(m)
    assert sorted(found.values()) == [UNIT, UNIT, 1, 1, 1]


def test_sizes_of_rows() -> None:
    J = np.array([[30.0, -4.0], [0.2, 0.1], [0.0, 1e-9], [0.3, 0.4], [5.0, 0.0]])
    scales = Scales(np.ones(2), np.ones(5), groups=np.array([1, 1, 2, UNIT, ALL]))
    np.testing.assert_array_equal(scales.row_sizes(J), [30.0, 30.0, SMALL, 1.0, 30.0])
    np.testing.assert_array_equal(scales.row_sizes(J[:2]), [30.0, 30.0])
    np.testing.assert_array_equal(scales._replace(groups=None).row_sizes(J), np.full(5, 30.0))


def test_pivots_are_parts_of_what_their_rows_can_be() -> None:
    J = np.array([[30.0, 1.0, 2.0], [0.1, 0.9, 0.3]])
    alone = partition(J, 2, [2])
    compared = partition(J, 2, [2], sizes=np.array([30.0, 1.0]))
    assert alone.weakest < NEAR < compared.weakest
    np.testing.assert_allclose(compared.B, alone.B, atol=1e-15)
    short = np.array([[30.0, 1.0, 2.0], [0.3, 0.02, 0.01]])  # the same row of a gap as the first: nearly nothing
    assert partition(short, 2, [2], sizes=np.array([30.0, 30.0])).weakest < NEAR


class Judged:
    """The flag of straight-line code that no change point is near, beside singular values."""

    def __init__(self, model: eg.Model) -> None:
        self.equations = model.derive()
        assert self.equations.method == "recursive"
        self.kinematics = self.equations.kinematics
        program = pipeline.build(self.equations, "c", ["rhs"])
        block = next(b for b in program.blocks if b.name == "dynamics")
        names = (*self.kinematics.names, *self.kinematics.velocity_names)
        self.evaluate = compile_evaluator([block.outputs[-1]], (*names, "t"))
        self.functions = ConstraintFunctions(self.kinematics, {})
        self.start = np.array(self.equations.mobility.q_reference)
        self.groups = np.array(row_groups(self.kinematics))
        self.still = [0.0] * len(self.kinematics.v)

    def is_far(self, q: np.ndarray) -> bool:
        return bool(self.evaluate([*q, *self.still, 0.0])[0] == 1.0)

    def closed(self, q: np.ndarray) -> np.ndarray:
        system = self.functions.system
        return correct_position(system.position, q, system.scales)[0]

    def weakest(self, q: np.ndarray) -> float:
        """The least singular value of rows of one length each, gaps of one length together."""
        J = self.functions.scaled_jacobian(q)
        sizes = np.sqrt((J**2).sum(axis=1))
        for g in set(self.groups[self.groups > 0].tolist()):
            sizes[self.groups == g] = sizes[self.groups == g].max()
        return float(np.linalg.svd(J / sizes[:, None], compute_uv=False)[-1])


CHAINS = [(n, spatial) for n in (10, 31, 60) for spatial in (False, True)]


@pytest.mark.parametrize(("n", "spatial"), part_of(CHAINS, lambda case: case in {(10, True), (31, False), (60, True)}))
def test_random_states_of_closed_chains_are_far_from_change_points(n: int, spatial: bool) -> None:
    """Spatial chains of 60 and more counted as near one at every state, and were interpolated each time."""
    judged = Judged(closed_chain(n, True, spatial))
    rng, start = np.random.default_rng(n), judged.start
    far = 0
    for _ in range(12):
        q = judged.closed(start + 0.15 * rng.standard_normal(len(start)))
        assert np.abs(judged.functions.system.evaluate(q, 0.0)[0]).max() < 1e-10
        far += judged.is_far(q)
        if judged.is_far(q):
            assert judged.weakest(q) > NEAR * NEAR
    assert far == 12


@pytest.mark.parametrize("n", part_of([26, 40], lambda n: n == 26))
def test_a_chain_that_lies_flat_is_near(n: int) -> None:
    """All columns of a folded chain are across it; every other one is rounding, which has any angle."""
    m = eg.Model("flat", gravity=(0, -9.81, 0))
    last = m.ground
    for i in range(n):
        link = m.body(f"b{i}", mass=1.0, com=(0.05, 0, 0), inertia=(1e-3, 1.2e-3, 1.5e-3))
        m.revolute(f"j{i}", last, link)
        m.guess(**{f"j{i}": (0.0 if i == 0 else np.pi * (1 - 1e-3 * (i == 7)) * (-1.0) ** i)})
        last = link.at(0.1, 0, 0)
    m.revolute("end", last, m.ground.at(0.0, 0, 0))
    judged = Judged(m)
    flat = np.array([0.0 if i == 0 else np.pi for i in range(len(judged.kinematics.q))])
    assert judged.weakest(flat) < 1e-6
    assert not judged.is_far(flat)
    assert not judged.is_far(flat + 1e-3 * np.random.default_rng(1).standard_normal(len(flat)))


@pytest.mark.parametrize("spatial", [False, True])
def test_far_states_of_long_chains_are_brought_back(spatial: bool) -> None:
    """By Newton's steps, from gaps of a tenth of the loop; measured by the length of one link they went astray."""
    mod = closed_chain(60, True, spatial).derive().compile(target="numpy", kernels=KERNELS)
    rng, start = np.random.default_rng(3), mod.x0()
    for _ in range(5):
        x = start.copy()
        x[: mod.n_q] += 0.1 * rng.standard_normal(mod.n_q)
        assert np.abs(mod.constraints(x[: mod.n_q])).max() > 0.1
        assert np.abs(mod.constraints(mod.project(x)[: mod.n_q])).max() < 1e-11


KERNELS = ("project", "constraints", "constraint_jacobian", "velocity_constraints")


def test_long_loops_are_cut_where_fewest_equations_are_carried() -> None:
    for n, joint in ((20, "j10"), (40, "end")):
        mechanism = closed_chain(n, True, True).mechanism()
        assert [mechanism.joints[k].name for k in find_topology(mechanism).cut] == [joint]


MOST = {(20, False): 4.0, (40, False): 4.0, (80, False): 4.0, (20, True): 2.8, (40, True): 2.1, (80, True): 2.1}


@pytest.mark.parametrize(("n", "spatial"), part_of(MOST, lambda case: case != (80, True)))
def test_operations_of_closed_chains_are_within_four_times_those_of_open_ones(n: int, spatial: bool) -> None:
    closed, free = (
        pipeline.build(closed_chain(n, closed, spatial).derive(), "c", ["rhs"]).counts for closed in (True, False)
    )
    total = closed["closing"].total + closed["dynamics"].total
    assert total < MOST[n, spatial] * free["rhs"].total
