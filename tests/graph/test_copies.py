"""Copies of what holds expressions: as copy.deepcopy makes them, in a graph that grows by itself."""

from __future__ import annotations

from copy import deepcopy
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import pytest
from models import EXAMPLES

import eomgen as eg
from eomgen.graph.copies import copied
from eomgen.graph.core import Expr, Graph


class Pair(NamedTuple):
    first: Any
    second: Any


class Record:
    def __init__(self, **held: Any) -> None:
        vars(self).update(held)


class Slotted:
    __slots__ = ("x",)

    def __init__(self, x: Any) -> None:
        self.x = x


def same(a: Any, b: Any, seen: dict[int, int]) -> None:
    """Two structures of other graphs are alike, and what is shared in one is shared in the other."""
    assert type(a) is type(b)
    if isinstance(a, Expr):
        assert a.id == b.id
        return
    if isinstance(a, str | int | float | bool | type(None)) or callable(a):
        assert a == b or isinstance(a, partial)
        return
    if id(a) in seen:
        assert seen[id(a)] == id(b)
        return
    seen[id(a)] = id(b)
    if isinstance(a, tuple | list):
        assert len(a) == len(b)
        for x, y in zip(a, b, strict=True):
            same(x, y, seen)
    elif isinstance(a, dict):
        for x, y in zip(a.items(), b.items(), strict=True):
            same(x[0], y[0], seen)
            same(x[1], y[1], seen)
    elif isinstance(a, Graph):
        assert a.nodes == b.nodes
        assert a is not b
    elif isinstance(a, np.ndarray):
        np.testing.assert_array_equal(a, b)
    elif hasattr(a, "__dict__"):
        same(vars(a), vars(b), seen)


@pytest.mark.parametrize("example", ["four_bar", "quadrotor_load", "rimless_wheel", "hydraulic_boom"])
def test_derivations(example: str) -> None:
    derived = eg.load(EXAMPLES / f"{example}.yaml").derive()
    held = (derived.kinematics, derived.mobility, derived.tree)
    same(held, copied(held), {})
    same(deepcopy(held), copied(held), {})


def test_what_is_held() -> None:
    graph = Graph()
    x, y = graph.symbol("x"), graph.symbol("y")
    twice = [x * y]
    held = Record(
        pair=Pair(x, twice), table={"a": twice, 2: (x, 0.5)}, array=np.arange(3.0), slot=Slotted(x), none=None
    )
    twin = copied(held)
    assert twin.pair.second is twin.table["a"] is not twice
    assert type(twin.pair) is Pair
    assert twin.array is not held.array
    assert twin.slot.x.graph is twin.pair.first.graph is not graph
    assert held.pair.first.graph is graph
    before = len(graph.nodes)
    assert (twin.pair.first + twin.table[2][0] * 3.0).id >= before
    assert len(graph.nodes) == before


def test_circles_stay_circles() -> None:
    held = Record(name="a")
    held.itself = held
    held.parts = [held]
    held.pair = (held, 1.0)
    twin = copied(held)
    assert twin.itself is twin.parts[0] is twin.pair[0] is twin is not held
    pair = copied(held.pair)
    assert pair[0].pair is pair
