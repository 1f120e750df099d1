"""What counts as closed and as a direction of its own, on both sides of the limits."""

from __future__ import annotations

import numpy as np
import pytest

from eomgen.errors import PartitionError, ProjectionError
from eomgen.numeric import Scales, correct_position, independent_rows, partition, rank, redundant_rows
from eomgen.numeric.definite import safely_positive

PLAIN = Scales(np.ones(2), np.ones(2))


def contradiction(gap: float):
    """x = 0 and x = gap."""

    def position(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.array([q[0], q[0] - gap]), np.array([[1.0, 0.0], [1.0, 0.0]])

    return position


@pytest.mark.parametrize("gap", [1e-10, 1e-11])
def test_rows_that_agree_to_ten_digits_are_met_halfway(gap: float) -> None:
    """Lengths written with ten digits need not agree better."""
    q, _ = correct_position(contradiction(gap), np.array([0.3, 0.7]), PLAIN)
    assert q == pytest.approx([gap / 2, 0.7], abs=1e-15)


@pytest.mark.parametrize("gap", [1e-9, 1e-6, 0.1])
def test_a_gap_that_is_left_is_never_passed_over(gap: float) -> None:
    with pytest.raises(ProjectionError):
        correct_position(contradiction(gap), np.array([0.3, 0.7]), PLAIN)


@pytest.mark.parametrize(("weak", "count"), [(1e-7, 2), (3e-8, 2), (3e-9, 1), (1e-10, 1)])
def test_the_rank_of_a_mechanism(weak: float, count: int) -> None:
    """Loops are closed to 1e-10 where rank is judged, so that rows which depend on each other may look so different."""
    turn = np.array([[0.8, -0.6], [0.6, 0.8]])
    assert rank(turn @ np.diag([1.0, weak]) @ turn).rank == count


@pytest.mark.parametrize("ratio", [1e-7, 3e-8])
def test_chosen_coordinates_may_move_others_fast(ratio: float) -> None:
    """Half of the digits are left where the dependent one moves 1e8 times as fast."""
    split = partition(np.array([[1.0, ratio]]), 1, [0], strict=True)
    np.testing.assert_allclose(split.B, [[1.0], [-1.0 / ratio]])
    with pytest.raises(PartitionError, match="dead centre"):
        partition(np.array([[1.0, ratio / 10]]), 1, [0], strict=True)


@pytest.mark.parametrize("weak", [3e-9, 3e-10])
def test_weak_rows_of_a_closed_state_are_held(weak: float) -> None:
    """A state is closed to 1e-15: rows down to 1e-10 of the largest are told from its rounding."""
    split = partition(np.array([[1.0, 0.0, 0.0], [0.0, weak, 0.0]]), 2, [2])
    assert split.independent.tolist() == [2]
    with pytest.raises(PartitionError, match="rank 1 here"):
        partition(np.array([[1.0, 0.0, 0.0], [0.0, 3e-11, 0.0]]), 2, [2])


def test_rows_that_repeat_earlier_ones_are_redundant() -> None:
    a, b = np.array([1.0, 0.0, 2.0]), np.array([0.3, 0.2, 0.6])
    J = np.array([a, 3.0 * a, b, a - 2.0 * b])
    assert independent_rows(J, 2).tolist() == [0, 2]
    assert redundant_rows(J, 2, ["first", "again", "second", "both"]) == ["again", "both"]


@pytest.mark.parametrize(("left", "sound"), [(1e-11, True), (1e-12, True), (1e-14, False), (-1e-12, False)])
def test_inertia_that_is_left_of_a_large_one(left: float, sound: bool) -> None:
    """A pivot is a difference of terms as large as its diagonal entry, known to some hundred roundings of that."""
    assert safely_positive(np.array([3.0, left]), np.array([3.0, 1.0])) == sound
