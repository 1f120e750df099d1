"""Stage reading, blocks: where a large matrix vanishes -> groups of its rows and columns, most blocks being zero.

Coordinates of one branch of the tree belong together, as those of one leg of a platform do; rows of the constraints
that are of one joint do too.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

MOST = 10  #: blocks in a row that are shown

Places = tuple[int, ...]


class MatrixBlocks(NamedTuple):
    """Groups of coordinates, and groups of constraint equations."""

    coordinates: tuple[Places, ...]
    equations: tuple[Places, ...]


def find_blocks(
    inertia: Sequence[Sequence[bool]],
    constraints: Sequence[Sequence[bool]],
    labels: Sequence[str],
    branches: Sequence[int],
) -> MatrixBlocks | None:
    """Groups, None where there is one group of coordinates or where there are too many groups.

    Parameters
    ----------
    inertia : sequence of sequence of bool
        Where the mass matrix (n, n) does not vanish.
    constraints : sequence of sequence of bool
        Where the Jacobian (m, n) does not vanish.
    labels : sequence of str
        Of the rows of the Jacobian, the joint before the first dot.
    branches : sequence of int
        Of each coordinate the branch of the tree, counted at ground; those of one branch stay together.
    """
    n = len(inertia)
    group = [branches.index(branch) for branch in branches]
    for i in range(n):
        for j in range(i):
            if inertia[i][j] and group[i] != group[j]:
                old, new = max(group[i], group[j]), min(group[i], group[j])
                group = [new if k == old else k for k in group]
    coordinates = tuple(tuple(j for j in range(n) if group[j] == k) for k in dict.fromkeys(group))
    joints = [label.partition(".")[0] for label in labels]
    equations = tuple(tuple(i for i, x in enumerate(joints) if x == joint) for joint in dict.fromkeys(joints))
    if not 1 < len(coordinates) <= MOST or not 1 < len(equations) <= MOST or len(coordinates) == n:
        return None
    held = sum(any(constraints[i][j] for i in rows for j in columns) for rows in equations for columns in coordinates)
    return MatrixBlocks(coordinates, equations) if held < len(equations) * len(coordinates) else None
