"""Stage graph: the operations of expressions -> what each does to numbers, and the symmetries used to simplify."""

from __future__ import annotations

import math
from collections.abc import Callable

from . import elementary
from .elementary import ELEMENTARY

COMMUTATIVE = frozenset({"add", "mul", "min", "max", "eq", "and", "or"})
ODD = frozenset(name for name, f in ELEMENTARY.items() if f.parity == elementary.ODD)
EVEN = frozenset({"abs", *(name for name, f in ELEMENTARY.items() if f.parity == elementary.EVEN)})


def _sign(x: float) -> float:
    return float((x > 0) - (x < 0))


#: What each operation does to numbers; the meaning every target must reproduce.
FOLD: dict[str, Callable[..., float]] = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "div": lambda a, b: a / b,
    "neg": lambda a: -a,
    "pow": lambda a, b: a**b,
    "sqrt": math.sqrt,
    **{name: f.value for name, f in ELEMENTARY.items()},
    "atan2": math.atan2,
    "abs": abs,
    "sign": _sign,
    "min": min,
    "max": max,
    "lt": lambda a, b: float(a < b),
    "le": lambda a, b: float(a <= b),
    "eq": lambda a, b: float(a == b),
    "not": lambda a: float(not a),
    "and": lambda a, b: float(bool(a) and bool(b)),
    "or": lambda a, b: float(bool(a) or bool(b)),
    "select": lambda c, a, b: a if c else b,
}
