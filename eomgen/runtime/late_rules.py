"""Stage runtime: rules of a model's numbers, values of parameters -> the rules that these break, and in which runs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from ..base.algebra import Array
from ..base.value_rules import POINTS, RULES, Flaw, surely_right
from .tapes import play_arrays


def broken_rules(rules: Sequence[Any], p: Array) -> Iterator[tuple[str, list[Flaw], list[int], list[int]]]:
    """Place, flaws of the first run, parameters and runs of every rule that parameters (n_p, k) of k runs break.

    Sets of parameters of which a rule has no finite numbers are not judged by it.
    """
    for path, rule, data, used, tape in rules:
        first: list[Flaw] = []
        runs: list[int] = []
        for k, values in _to_look_at(rule, data, tape, p):
            flaws = RULES[rule](values, *data)
            if flaws:
                runs.append(k)
                first = first or flaws
        if runs:
            yield path, first, used, runs


def _to_look_at(rule: str, data: Sequence[Any], tape: Any, p: Array) -> Iterator[tuple[int, Array]]:
    """The numbers of each run that may break a rule."""
    if rule in POINTS:
        points = POINTS[rule]()
        for k in range(p.shape[1]):
            yield k, _rows(play_arrays(tape, p[:, k], points), points.shape[1])
        return
    values = _rows(play_arrays(tape, p, np.empty((0, 1))), p.shape[1])
    open_ = np.isfinite(values).all(axis=0)
    if not open_.all():
        values = np.where(open_, values, 0.0)
    for k in np.flatnonzero(open_ & ~surely_right(rule, values, data)).tolist():
        yield k, values[:, k]


def _rows(found: Sequence[Any], count: int) -> Array:
    return np.array([np.broadcast_to(np.asarray(x, dtype=float), (count,)) for x in found])
