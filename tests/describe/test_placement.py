"""Turns and axes: exact zeros and ones, right-handed, and roll-pitch-yaw as in URDF."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from eomgen.describe.placement import TURNS, axis_columns, rpy_rotation
from eomgen.graph import Graph, evaluate
from eomgen.rotations.scalars import cosine_and_sine

Axis = tuple[float, float, float]
UNITS = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1), "-x": (-1, 0, 0), "-y": (0, -1, 0), "-z": (0, 0, -1)}


@pytest.mark.parametrize("word", TURNS)
def test_words_for_axes(word: str) -> None:
    turn = np.array(TURNS[word]).T
    assert set(np.unique(turn)) <= {-1.0, 0.0, 1.0}
    assert np.linalg.det(turn) == pytest.approx(1.0)
    np.testing.assert_array_equal(turn[:, 2], UNITS[word])
    assert axis_columns(tuple(3.0 * x for x in UNITS[word])) == TURNS[word]  # type: ignore[arg-type]


def test_positive_axes_permute() -> None:
    assert TURNS["x"] == (UNITS["y"], UNITS["z"], UNITS["x"])
    assert TURNS["y"] == (UNITS["z"], UNITS["x"], UNITS["y"])


component = st.floats(-10, 10).map(lambda x: 0.0 if abs(x) < 1e-3 else x)


@given(st.tuples(component, component, component))
def test_numeric_axes(axis: Axis) -> None:
    columns = axis_columns(axis)
    if axis == (0.0, 0.0, 0.0):
        assert columns is None
        return
    turn = np.array(columns).T
    np.testing.assert_allclose(turn.T @ turn, np.eye(3), atol=1e-14)
    assert np.linalg.det(turn) == pytest.approx(1.0)
    np.testing.assert_allclose(turn[:, 2], np.array(axis) / np.linalg.norm(axis), atol=1e-15)
    for k in range(3):  # exact zeros of the axis stay, and there is one more in every turn
        if axis[k] == 0.0:
            assert turn[k, 2] == 0.0
    assert np.count_nonzero(turn == 0.0) >= 1


def test_an_axis_in_a_plane_keeps_the_normal() -> None:
    columns = axis_columns((0.0, 3.0, 4.0))
    assert columns is not None
    assert columns[0] == (1.0, 0.0, 0.0)
    assert columns[2] == pytest.approx((0.0, 0.6, 0.8))


@given(st.tuples(*[st.floats(-7, 7)] * 3))
def test_rpy_is_fixed_axis(rpy: Axis) -> None:
    graph = Graph()
    rotation = rpy_rotation(graph, [graph.constant(x) for x in rpy])
    values = np.array(evaluate([x for row in rotation for x in row], {})).reshape(3, 3)
    np.testing.assert_allclose(values, Rotation.from_euler("xyz", rpy).as_matrix(), atol=2e-15)


def test_rpy_of_quarter_turns_is_exact() -> None:
    graph = Graph()
    for k in range(-8, 9):
        for j in range(-2, 3):
            angles = [graph.constant(x) for x in (k * math.pi / 2, j * math.pi / 2, (k - j) * math.pi / 2)]
            entries = [x.value for row in rpy_rotation(graph, angles) for x in row]
            assert set(entries) <= {-1.0, 0.0, 1.0}
    almost = graph.constant(1.5708)  # how some URDF files round pi/2: not a quarter turn
    assert cosine_and_sine(almost)[0].value == pytest.approx(-3.673e-6, rel=1e-3)


def test_rpy_of_symbols() -> None:
    graph = Graph()
    a, zero = graph.symbol("a"), graph.zero
    rotation = rpy_rotation(graph, [zero, zero, a])
    assert rotation[0][0] == graph.apply("cos", a)
    assert [x.value for x in rotation[2]] == [0.0, 0.0, 1.0]
