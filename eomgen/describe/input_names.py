"""Stage describe, inputs that move: how the rates of an input are called, as those of coordinates are."""

from __future__ import annotations

from collections.abc import Iterable

from ..base.notation import rate_of as rate_of
from ..base.notation import split_rate as split_rate


def chains(names: Iterable[str]) -> dict[str, list[str]]:
    """The rates that are inputs too, by the name of each input that has some, in order: first, second, ..."""
    known = list(names)
    orders: dict[str, dict[int, str]] = {}
    for name in known:
        stem, order = split_rate(name)
        orders.setdefault(stem, {})[order] = name
    return {
        by_order[k]: [by_order[j] for j in sorted(by_order) if j > k]
        for by_order in orders.values()
        for k in sorted(by_order)[:-1]
    }
