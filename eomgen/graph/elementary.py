"""Stage graph: elementary functions of one argument -> all that eomgen knows of each, one row a function.

From here come their values, derivatives, rounding, SymPy's and NumPy's names for them and the words of model files; in
C they have the name of the row.  The tape that plays texts in a run (runtime/tapes.py, steppers/tape.c) has its own
list, as it runs without the graph; series (program/series.py) know those that have a recurrence.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

ODD, EVEN = -1, 1


class Elementary(NamedTuple):
    """One function.

    Attributes
    ----------
    value : callable
        On a float; outside of its domain it raises ValueError or OverflowError.
    slope : callable
        (graph, id of y, id of a) -> id of dy/da.
    rate : callable
        (a, y) -> the size of dy/da, on floats and arrays.
    array : str
        NumPy's name.
    parity : {ODD, EVEN, 0}
        f(-a) = -f(a), f(-a) = f(a), or neither.
    entire : bool
        Analytic on the whole axis but for poles: what vanishes around a point vanishes everywhere.
    """

    value: Callable[[float], float]
    slope: Callable[[Any, int, int], int]
    rate: Callable[[Any, Any], Any]
    array: str
    parity: int = 0
    entire: bool = False


def over(g: Any, a: int) -> int:
    """1 / a."""
    return int(g.div(g.one.id, a))


def _one_and(g: Any, way: str, a: int) -> int:
    """1 + a^2, or with "sub" 1 - a^2."""
    return int(getattr(g, way)(g.one.id, g.mul(a, a)))


def _under_root(g: Any, a: int) -> int:
    return over(g, g.make("sqrt", a))


ELEMENTARY: dict[str, Elementary] = {
    "exp": Elementary(math.exp, lambda g, y, a: y, lambda a, y: y, "exp", entire=True),
    "log": Elementary(math.log, lambda g, y, a: over(g, a), lambda a, y: 1.0 / abs(a), "log"),
    "sin": Elementary(math.sin, lambda g, y, a: g.make("cos", a), lambda a, y: abs(np.cos(a)), "sin", ODD, True),
    "cos": Elementary(
        math.cos, lambda g, y, a: g.neg(g.make("sin", a)), lambda a, y: abs(np.sin(a)), "cos", EVEN, True
    ),
    "tan": Elementary(math.tan, lambda g, y, a: _one_and(g, "add", y), lambda a, y: 1.0 + y * y, "tan", ODD, True),
    "asin": Elementary(
        math.asin,
        lambda g, y, a: _under_root(g, _one_and(g, "sub", a)),
        lambda a, y: 1.0 / np.sqrt(1.0 - a * a),
        "arcsin",
        ODD,
    ),
    "acos": Elementary(
        math.acos,
        lambda g, y, a: g.neg(_under_root(g, _one_and(g, "sub", a))),
        lambda a, y: 1.0 / np.sqrt(1.0 - a * a),
        "arccos",
    ),
    "atan": Elementary(
        math.atan, lambda g, y, a: over(g, _one_and(g, "add", a)), lambda a, y: 1.0 / (1.0 + a * a), "arctan", ODD
    ),
    "sinh": Elementary(math.sinh, lambda g, y, a: g.make("cosh", a), lambda a, y: np.cosh(a), "sinh", ODD, True),
    "cosh": Elementary(math.cosh, lambda g, y, a: g.make("sinh", a), lambda a, y: abs(np.sinh(a)), "cosh", EVEN, True),
    "tanh": Elementary(math.tanh, lambda g, y, a: _one_and(g, "sub", y), lambda a, y: 1.0 - y * y, "tanh", ODD, True),
    "asinh": Elementary(
        math.asinh,
        lambda g, y, a: _under_root(g, _one_and(g, "add", a)),
        lambda a, y: 1.0 / np.sqrt(1.0 + a * a),
        "arcsinh",
        ODD,
    ),
    "acosh": Elementary(
        math.acosh,
        lambda g, y, a: g.div(_under_root(g, g.sub(a, g.one.id)), g.make("sqrt", g.add(a, g.one.id))),
        lambda a, y: 1.0 / np.sqrt((a - 1.0) * (a + 1.0)),
        "arccosh",
    ),
    "atanh": Elementary(
        math.atanh, lambda g, y, a: over(g, _one_and(g, "sub", a)), lambda a, y: 1.0 / (1.0 - a * a), "arctanh", ODD
    ),
}
