"""Assembly of positions and velocities, kinematics over a full turn, rank and redundancy."""

import json
from pathlib import Path

import numpy as np
import pytest

from eomgen.errors import AssemblyError, PartitionError, ProjectionError
from eomgen.numeric import (
    ConstraintSystem,
    CutJoints,
    Scales,
    VelocityEquations,
    assemble_velocity,
    choose_independent,
    conditioning,
    follow,
    independent_rows,
    kinematics,
    rank,
    redundant_rows,
)
from eomgen.numeric.closure import WantedValues
from eomgen.numeric.row_chains import SparseRows

NAMES, LABELS = ["theta", "beta", "s"], ["C.x", "C.y", "C.x again"]
REFERENCE = Path(__file__).parents[1] / "reference" / "slider_crank_kinematics.json"


def system_of(c, cut=None, alignment=None):
    none = CutJoints((), (), np.empty(0), lambda q, t: (np.empty(0), np.empty((0, 3))))
    kinds = ("angle", "angle", "length")
    return ConstraintSystem(lambda q, t: c.position(q), c.scales, tuple(NAMES), kinds, LABELS, cut or none, alignment)


def put_together(c, guess, held=(), alignment=None):
    guess = np.array(guess, dtype=float)
    return system_of(c, alignment=alignment).close(guess, {NAMES[i]: guess[i] for i in held})


def test_a_rough_guess_closes_and_held_values_stay(crank):
    c = crank(copies=2)
    rng = np.random.default_rng(3)
    for theta in rng.uniform(-3, 3, 30):
        guess = [theta, rng.uniform(-1.2, 1.2), rng.uniform(0, 0.6)]
        found = put_together(c, guess, held=[0])
        assert found.q[0] == theta
        assert np.abs(c.position(found.q)[0]).max() < 1e-12


def test_a_symmetric_guess_needs_another_start(crank):
    found = put_together(crank(), [0.0, 0.0, 0.3], held=[2])
    assert found.restarts > 0
    assert np.abs(crank().position(found.q)[0]).max() < 1e-10
    assert put_together(crank(), [0.0, 0.0, 0.3], held=[2]).q.tolist() == found.q.tolist()


def test_the_guess_is_moved_as_little_as_possible(crank):
    c = crank()
    q = c.closed(0.7)
    found = put_together(c, q + np.array([1e-4, -1e-4, 1e-4]))
    assert found.distance < 5e-4
    assert found.restarts == 0


def test_the_dead_centre_can_be_held_exactly(crank):
    c = crank()
    found = put_together(c, [0.3, -0.1, c.p.l1 + c.p.l2], held=[2])
    assert found.q[2] == c.p.l1 + c.p.l2
    assert abs(found.q[0]) < 1e-4


def test_messages_tell_the_three_ways_to_fail_apart(crank):
    c = crank()
    with pytest.raises(
        AssemblyError, match=r"theta = 0\.3, s = 0\.2 are inconsistent: 2 values for 1 degree of freedom"
    ):
        put_together(c, [0.3, 0.0, 0.2], held=[0, 2])
    with pytest.raises(AssemblyError, match=r"cannot close with s = 2: .*C\.x.*nearby has s = 0\.4"):
        put_together(c, [0.3, 0.0, 2.0], held=[2])
    with pytest.raises(AssemblyError, match=r"do not close from the given guess \(25 starts tried\): .*C\.y"):
        put_together(crank(e=1.0), [0.3, 0.0, 0.4])


def test_consistent_values_may_be_more_than_needed(crank):
    c = crank()
    q = c.closed(0.7)
    assert put_together(c, q, held=[0, 1, 2]).q.tolist() == q.tolist()


def test_functions_of_the_coordinates_reach_their_values(crank):
    c = crank()
    cut = CutJoints(("psi",), ("angle",), np.ones(1), lambda q, t: (-q[1:2], np.array([[0.0, -1.0, 0.0]])))
    found = system_of(c, cut).close(c.closed(0.1), {"psi": 0.2 + 2 * np.pi})
    assert found.q[1] == pytest.approx(-0.2, abs=1e-12)
    with pytest.raises(AssemblyError, match="psi = "):
        system_of(c, cut).close(c.closed(0.1), {"psi": 1.5})


def test_flipped_positions_are_refused(crank):
    c = crank()
    upright = put_together(c, [0.5, 3.0, 0.0], held=[0])
    assert np.cos(upright.q[1]) < 0
    found = put_together(c, [0.5, 3.0, 0.0], held=[0], alignment=lambda q, t: np.cos(q[1:2]))
    assert np.cos(found.q[1]) > 0
    with pytest.raises(AssemblyError, match="axes of a joint flipped"):
        put_together(c, [0.5, 3.0, 0.0], held=[0], alignment=lambda q, t: np.array([-1.0]))


def test_following_a_held_value_stays_on_the_branch(crank):
    c = crank()
    start = c.closed(0.1)
    q = follow(system_of(c), start, {"theta": 9.0})
    np.testing.assert_allclose(q, c.closed(9.0), atol=1e-12)
    with pytest.raises(AssemblyError, match="blocked"):
        follow(system_of(c), start, {"s": 0.6})


def test_a_way_of_too_many_steps_is_given_up(crank, monkeypatch):
    c = crank()
    monkeypatch.setattr("eomgen.numeric.held_path.TRIALS", 20)
    with pytest.raises(AssemblyError, match=r"too many bends: 20 steps cover 73 % of it"):
        follow(system_of(c), c.closed(0.1), {"theta": 9.0})


def test_velocities_given_are_exact_and_contradictions_are_told(crank):
    c = crank(t=0.1, a=0.02, w=5.0)
    q = c.closed(0.7)
    C_q, C_t = c.position(q)[1], c.rate(q)
    names = ["theta_dot", "beta_dot", "s_dot"]
    rates = assemble_velocity(C_q, C_t, c.scales, guess=np.array([3.0, 0, 0]), held=[0], names=names, labels=LABELS)
    assert rates[0] == 3.0
    np.testing.assert_allclose(C_q @ rates + C_t, 0, atol=1e-13)
    with pytest.raises(AssemblyError, match=r"theta_dot = 3, s_dot = 1 are inconsistent with 1 degree of freedom"):
        assemble_velocity(C_q, C_t, c.scales, guess=np.array([3.0, 0, 1.0]), held=[0, 2], names=names, labels=LABELS)
    equations = VelocityEquations(np.array([[0.0, -1.0, 0.0]]), np.zeros(1), np.array([0.5]), np.ones(1), ["psi_dot"])
    assert assemble_velocity(C_q, C_t, c.scales, equations=equations)[1] == pytest.approx(-0.5, abs=1e-13)


def test_nothing_given_means_the_smallest_velocities(crank):
    c = crank()
    q = c.closed(0.7)
    C_q, C_t = c.position(q)[1], c.rate(q)
    assert assemble_velocity(C_q, C_t, c.scales).tolist() == [0, 0, 0]


@pytest.mark.parametrize("case", ["inline", "offset"])
def test_kinematics_equal_the_closed_form(crank, case):
    """Reference: slider_crank_kinematics.json (closed form, 17 digits)."""
    data = json.loads(REFERENCE.read_text())["reference"][case]
    c = crank(l1=float(data["r"]), l2=float(data["l"]), e=float(data["e"]))
    for degrees, row in data["rows"].items():
        theta = np.deg2rad(float(degrees))
        expected = {key: float(value) for key, value in row.items()}
        q, v, a = kinematics(
            c.position,
            c.rate,
            c.gamma,
            np.array([theta]),
            np.array([10.0]),
            np.array([3.0]),
            np.array([0.0, 0.1, 0.3]),
            c.scales,
            2,
            [0],
        )
        np.testing.assert_allclose(q, [theta, expected["rod_angle"], expected["x"]], atol=1e-14)
        np.testing.assert_allclose(v, [10.0, expected["rod_omega"], expected["v"]], atol=1e-12)
        np.testing.assert_allclose(a, [3.0, expected["rod_alpha"], expected["a"]], atol=1e-11)


def test_kinematics_out_of_reach_or_at_a_dead_centre(crank):
    c = crank()
    still = np.zeros(1)
    with pytest.raises((ProjectionError, PartitionError)):
        kinematics(c.position, c.rate, c.gamma, np.array([0.6]), still, still, c.closed(0.4), c.scales, 2, [2])
    with pytest.raises(PartitionError):
        kinematics(
            c.position, c.rate, c.gamma, np.array([c.p.l1 + c.p.l2]), still, still, c.closed(0.0), c.scales, 2, [2]
        )


def test_rank_and_redundancy(crank):
    c = crank(copies=2)
    J = c.scales.jacobian(c.position(c.closed(0.7))[1])
    found = rank(J)
    assert found.rank == 2
    assert found.clear
    assert independent_rows(J, 2).tolist() == [0, 1]
    assert redundant_rows(J, 2, LABELS) == ["C.x again"]
    assert rank(np.zeros((2, 3))).rank == 0


def test_the_crank_is_chosen_as_independent(crank):
    c = crank()
    jacobians = [c.scales.jacobian(c.position(c.closed(theta))[1]) for theta in (0.0, 0.5, np.pi / 2, 3.0)]
    rows = [SparseRows(J) for J in jacobians]
    assert choose_independent(rows, 2).tolist() == [0]
    assert choose_independent(rows, 2, prefer=[1]).tolist() == [0]  # the rod stops turning at theta = pi/2
    assert choose_independent(rows[1:2], 2, prefer=[2]).tolist() == [2]
    assert conditioning(jacobians[0], [2]) < 1e-12
    assert conditioning(jacobians[0], [0]) > 0.1


def test_drivers_move_what_depends_on_them():
    """a + b = sin t: with a given, b' = cos t - a' and b'' = -sin t - a''."""
    t, scales = 0.7, Scales(np.ones(2), np.ones(1))
    q, v, a = kinematics(
        lambda q: (np.array([q.sum() - np.sin(t)]), np.ones((1, 2))),
        lambda q: np.array([-np.cos(t)]),
        lambda q, v: np.array([np.sin(t)]),
        np.array([0.2]), np.array([0.5]), np.array([-0.3]), np.zeros(2), scales, 1, [0],
    )  # fmt: skip
    np.testing.assert_allclose(q, [0.2, np.sin(t) - 0.2], atol=1e-14)
    np.testing.assert_allclose(v, [0.5, np.cos(t) - 0.5], atol=1e-14)
    np.testing.assert_allclose(a, [-0.3, -np.sin(t) + 0.3], atol=1e-14)


def test_rates_of_functions_that_change_by_themselves():
    """y = 2 q + 3 t with y' = 5 wanted: q' = 1, whatever else moves."""
    wanted = VelocityEquations(np.array([[2.0, 0.0]]), np.array([3.0]), np.array([5.0]), np.ones(1), ["y"])
    found = assemble_velocity(
        np.zeros((0, 2)), np.zeros(0), Scales(np.ones(2), np.zeros(0)), guess=np.array([0.0, 0.7]), equations=wanted
    )
    np.testing.assert_allclose(found, [1.0, 0.7], atol=1e-14)


def test_angles_to_be_reached_count_modulo_full_turns():
    wanted = WantedValues(lambda q: (q, np.eye(2)), np.array([0.1, 0.1]), np.ones(2), [True, False], ["turn", "way"])
    assert wanted.difference(np.array([0.3 + 4 * np.pi, 6.4])) == pytest.approx([0.2, 6.3])
    assert wanted.difference(np.array([-3.2, -3.2])) == pytest.approx([2 * np.pi - 3.3, -3.3])
