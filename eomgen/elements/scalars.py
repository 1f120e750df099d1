"""Rotations, scalars: functions of numbers, graph expressions or SymPy expressions -> results of the same kind.

SymPy is never imported here: where one of its expressions comes in, it is loaded already.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Sequence
from functools import partial, reduce
from typing import Any

import numpy as np

from ..base.limits.numbers import QUARTER, UNIT
from ..expr.core import Expr

Scalar = Any  #: a number, an :class:`~eomgen.expr.core.Expr` or a SymPy expression
Rows = Sequence[Sequence[Scalar]]


def _sympy(values: Iterable[Scalar]) -> Any:
    """SymPy, if one of the values is of it."""
    sympy = sys.modules.get("sympy")
    return sympy if sympy is not None and any(isinstance(x, sympy.Basic) for x in values) else None


def apply(name: str, *x: Scalar) -> Scalar:
    """A function of :mod:`math` by name: sin, cos, tan, sqrt, atan2."""
    graph = next((value.graph for value in x if isinstance(value, Expr)), None)
    if graph is not None:
        return graph.apply(name, *x)
    sympy = _sympy(x)
    return getattr(math if sympy is None else sympy, name)(*x)


def where_less(a: Scalar, b: Scalar, yes: Scalar, no: Scalar) -> Scalar:
    """``yes`` where a < b, else ``no``; in SymPy always ``no``, which every caller makes the general form.

    Symbols then read as in textbooks; they say nothing of the exceptions: no rotation, half turns, further full turns.
    """
    graph = next((value.graph for value in (a, b, yes, no) if isinstance(value, Expr)), None)
    if graph is not None:
        return graph.apply("select", graph.apply("lt", a, b), yes, no)
    if _sympy((a, b)) is not None:
        return no
    return yes if a < b else no


sin, cos, sqrt, atan2 = (partial(apply, name) for name in ("sin", "cos", "sqrt", "atan2"))


def cosine_and_sine(angle: Scalar, snap: float = 0.0) -> tuple[Scalar, Scalar]:
    """cos and sin; exact 0 and +-1 for numbers within ``snap``, or rounding, of multiples of pi/2."""
    value = angle.value if isinstance(angle, Expr) else angle
    if isinstance(value, int | float):
        quarter = round(value / (math.pi / 2))
        if abs(value - quarter * (math.pi / 2)) <= max(snap, QUARTER * max(1, abs(quarter))):
            return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[quarter % 4]
    return cos(angle), sin(angle)


def about(axis: int, c: Scalar, s: Scalar) -> list[list[Scalar]]:
    """Rotation about axis 0, 1 or 2 by the angle of this cosine and sine; takes turned axes to the original ones."""
    if axis == 0:
        return [[1, 0, 0], [0, c, -s], [0, s, c]]
    if axis == 1:
        return [[c, 0, s], [0, 1, 0], [-s, 0, c]]
    return [[c, -s, 0], [s, c, 0], [0, 0, 1]]


def matrix_from_roll_pitch_yaw(angles: Iterable[Scalar], snap: float = 0.0) -> list[list[Scalar]]:
    """R = Rz(yaw) Ry(pitch) Rx(roll): turned about fixed axes, roll first, as in URDF."""
    x, y, z = (about(axis, *cosine_and_sine(angle, snap)) for axis, angle in enumerate(angles))
    return times(z, times(y, x))


def dot(a: Sequence[Scalar], b: Sequence[Scalar]) -> Scalar:
    """Scalar product of two vectors of any length."""
    total = a[0] * b[0]
    for x, y in zip(a[1:], b[1:], strict=True):
        total = total + x * y
    return total


def times(a: Rows, b: Rows) -> list[list[Scalar]]:
    """Product of two matrices."""
    columns = list(zip(*b, strict=True))
    return [[dot(row, column) for column in columns] for row in a]


def transpose(a: Rows) -> list[list[Scalar]]:
    """Transpose of a matrix."""
    return [list(column) for column in zip(*a, strict=True)]


def skew(a: Sequence[Scalar]) -> list[list[Scalar]]:
    """The matrix of the cross product: skew(a) b = a x b."""
    x, y, z = a
    return [[0, -z, y], [z, 0, -x], [-y, x, 0]]


def combine(one: Scalar, first: Scalar, second: Scalar, a: Sequence[Scalar]) -> list[list[Scalar]]:
    """one * I + first * skew(a) + second * a a^T."""
    tilde = skew(a)
    return [[one * int(i == j) + first * tilde[i][j] + second * (a[i] * a[j]) for j in range(3)] for i in range(3)]


AXES = {"x": 0, "y": 1, "z": 2}


def axes_of(sequence: str) -> tuple[int, int, int]:
    """Indices of the three axes; raises ValueError for anything but one of the 12 sequences."""
    if len(sequence) != 3 or not set(sequence) <= set("xyz") or sequence[1] in (sequence[0], sequence[2]):
        raise ValueError(
            f"{sequence!r} is not a sequence of Euler angles; give three axes like 'xyz' or 'zxz', neighbours different"
        )
    i, j, k = (AXES[letter] for letter in sequence)
    return i, j, k


def elementary(axis: int, angle: Scalar) -> list[list[Scalar]]:
    """Rotation about axis 0, 1 or 2."""
    return about(axis, cos(angle), sin(angle))


def turned(axes: Sequence[int], angles: Iterable[Scalar]) -> list[list[Scalar]]:
    """R = R_a(q1) R_b(q2) ..., intrinsic: each turn is about an axis of the frame that those before it made."""
    return reduce(times, map(elementary, axes, angles), [[1, 0, 0], [0, 1, 0], [0, 0, 1]])


def axes_of_turns(axes: Sequence[int], angles: Sequence[Scalar], sign: int) -> list[list[Scalar]]:
    """The axis of each turn, taken through the later turns (body axes, -1) or the earlier ones (ground axes, 1)."""
    turns = [*map(elementary, axes, angles)]
    result = []
    for n, axis in enumerate(axes):
        column = [[int(k == axis)] for k in range(3)]
        for turn in turns[n + 1 :] if sign < 0 else reversed(turns[:n]):
            column = times(transpose(turn) if sign < 0 else turn, column)
        result.append([x for (x,) in column])
    return result


# -- what comes in and goes out ---------------------------------------------------------------------------------------
def entries(raw: Any, size: int, what: str) -> list[Scalar]:
    """A vector as a list of scalars; raises ValueError if it has another length."""
    listed = list(np.ravel(raw).tolist() if isinstance(raw, np.ndarray) else raw)  # a SymPy matrix gives its own
    if len(listed) != size:
        raise ValueError(f"{what} has {len(listed)} entries; {size} are expected")
    return listed


def rows(raw: Any) -> list[list[Scalar]]:
    """A 3 x 3 matrix as rows; raises ValueError if it has another shape."""
    listed = raw.tolist() if hasattr(raw, "tolist") else [list(row) for row in raw]
    if len(listed) != 3 or any(len(row) != 3 for row in listed):
        raise ValueError(f"a 3 x 3 matrix is expected, not one of shape {np.shape(raw)}")
    return listed


def require_rotation(R: list[list[Scalar]]) -> None:
    """Raise ValueError for numbers that are no rotation, to 1e-6; symbols and expressions are taken as they are."""
    if not all(isinstance(x, int | float) for row in R for x in row):
        return
    numbers = np.array(R, dtype=float)
    determinant = float(np.linalg.det(numbers))
    if not (np.abs(numbers @ numbers.T - np.eye(3)).max() < UNIT and determinant > 0.0):
        raise ValueError(
            f"the matrix is not a rotation: its rows must be orthonormal and its determinant "
            f"1, which is {determinant:.6g}"
        )


def shaped(result: Any) -> Any:
    """A vector or matrix: a NumPy array, a SymPy matrix, or tuples of graph expressions."""
    matrix = isinstance(result[0], list | tuple)
    flat = [x for row in result for x in row] if matrix else list(result)
    graph = next((x.graph for x in flat if isinstance(x, Expr)), None)
    if graph is not None:
        lifted = tuple(graph.lift(x) for x in flat)
        width = len(result[0]) if matrix else 0
        return tuple(lifted[k : k + width] for k in range(0, len(flat), width)) if matrix else lifted
    sympy = _sympy(flat)
    if sympy is not None:
        return sympy.Matrix(result)
    return np.array(result, dtype=float)
