"""Stage describe, inputs that move: how the rates of an input are called, as those of coordinates are."""

from __future__ import annotations

import re
from collections.abc import Iterable

_RATE = re.compile(r"(.+)_(d+)ot\Z")


def rate_of(name: str, times: int = 1) -> str:
    """``u`` -> ``u_dot``, ``u_dot`` -> ``u_ddot``: what the rate of an input is called."""
    stem, order = split_rate(name)
    return f"{stem}_{'d' * (order + times)}ot"


def split_rate(name: str) -> tuple[str, int]:
    """``u_ddot`` -> (``u``, 2)."""
    found = _RATE.match(name)
    return (found[1], len(found[2])) if found else (name, 0)


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
