"""Expressions and random numbers in as many digits as mpmath is set to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import mpmath
import numpy as np

from eomgen.graph.core import Expr
from eomgen.graph.traverse import LEAVES, reachable


def in_digits(exprs: Sequence[Expr], values: Mapping[str, Any]) -> list[Any]:
    """Values by mpmath, at its current precision."""
    graph = exprs[0].graph
    found: dict[int, Any] = {}
    by_hand = {
        "add": lambda x, y: x + y,
        "sub": lambda x, y: x - y,
        "mul": lambda x, y: x * y,
        "absorb": lambda x, y: x * y if x != 0 else mpmath.mpf(0),
        "div": lambda x, y: x / y,
        "neg": lambda x: -x,
        "abs": abs,
        "max": max,
        "min": min,
        "lt": lambda x, y: int(x < y),
        "and": lambda x, y: int(x != 0 and y != 0),
        "select": lambda c, x, y: x if c != 0 else y,
    }
    for i in reachable(graph, (x.id for x in exprs)):
        kind, *args = graph.nodes[i]
        if kind in LEAVES:
            found[i] = mpmath.mpf(args[0]) if kind == "const" else values[args[0]]
        else:
            function = by_hand.get(kind) or getattr(mpmath, kind)
            found[i] = function(*(found[k] for k in args))
    return [found[x.id] for x in exprs]


def drawn(names: Sequence[str], seed: int) -> dict[str, Any]:
    random = np.random.default_rng(seed)
    return {name: mpmath.mpf(round(random.uniform(-1, 1), 6)) for name in names}
