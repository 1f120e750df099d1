"""Euler angles measured of a rotation, as cut joints do, also near the middle angles where they are singular."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from eomgen.graph.core import Graph
from eomgen.graph.differentiate import jvp
from eomgen.graph.evaluate import evaluate
from eomgen.joints.rotation_coordinates import euler, euler_angles

SEQUENCES = ["".join(s) for s in product("xyz", repeat=3) if s[1] not in (s[0], s[2])]


@pytest.mark.parametrize("away", [1.0, 1e-3, 1e-7, 1e-9, 1e-11])
@pytest.mark.parametrize("sequence", SEQUENCES)
def test_angles_and_their_rates_near_the_singular_middle_angle(sequence: str, away: float) -> None:
    """The matrix is SciPy's; the rates of angles of R(angles) are the angles' own."""
    graph = Graph()
    R = [[graph.symbol(f"r{i}{j}") for j in range(3)] for i in range(3)]
    for middle in (away, np.pi - away) if sequence[0] == sequence[2] else (np.pi / 2 - away, away - np.pi / 2):
        given = [0.3, middle, 0.4]
        matrix = Rotation.from_euler(sequence.upper(), given).as_matrix()
        found = evaluate(euler_angles(graph, sequence, R), {f"r{i}{j}": matrix[i, j] for i, j in np.ndindex(3, 3)})
        back = Rotation.from_euler(sequence.upper(), np.array(found, dtype=float)).as_matrix()
        assert np.abs(back - matrix).max() < 1e-15 + 3e-16 / away
        assert found[1] == pytest.approx(middle, abs=4e-16)
        q = [graph.symbol(name) for name in "abc"]
        again = euler_angles(graph, sequence, euler(graph, sequence, q))
        rates = evaluate(jvp(again, {q[1]: graph.one}), dict(zip("abc", given, strict=True)))
        assert rates[1] == pytest.approx(1.0, abs=1e-15 / away + 1e-14)
