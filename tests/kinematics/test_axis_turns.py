"""A mechanism that lies obliquely in ground moves as the straight one does, and takes hardly more operations."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import eomgen as eg
from benchmarks.linkages import turn, v_engine

LINKS = {"crank": 0.3, "coupler": 0.8, "rocker": 0.6}


def four_bar(seed: int) -> eg.Model:
    """A four-bar whose links and axes are all given in axes turned by a seed."""
    T = turn(seed)
    m = eg.Model("bars", gravity=tuple((T @ (0, -9.81, 0)).tolist()))
    z = tuple((T @ (0, 0, 1)).tolist())

    def at(x: float) -> tuple[float, ...]:
        return tuple((T @ (x, 0, 0)).tolist())

    inertia = (T @ np.diag((0.011, 0.02, 0.03)) @ T.T).tolist()
    crank, coupler, rocker = (m.body(n, mass=1.0, com=at(0.4 * x), inertia=inertia) for n, x in LINKS.items())
    m.revolute("a", m.ground, crank, axis=z)
    m.revolute("b", crank.at(*at(0.3)), coupler, axis=z)
    m.revolute("c", coupler.at(*at(0.8)), rocker.at(*at(0.6)), axis=z)
    m.revolute("d", m.ground.at(*at(0.7)), rocker, axis=z)
    m.guess(b=0.6, d=1.9)
    m.initial(a=0.4, a_dot=3.0)
    return m


def slider_crank(seed: int) -> eg.Model:
    """A slider-crank with an offset, turned by a seed."""
    T = turn(seed)
    m = eg.Model("slider", gravity=tuple((T @ (0, -9.81, 0)).tolist()))
    z = tuple((T @ (0, 0, 1)).tolist())
    inertia = (T @ np.diag((0.011, 0.02, 0.03)) @ T.T).tolist()

    def at(x: float, y: float) -> tuple[float, ...]:
        return tuple((T @ (x, y, 0)).tolist())

    crank, rod = (m.body(n, mass=1.0, com=at(0.1, 0.02), inertia=inertia) for n in ("crank", "rod"))
    slider = m.body("slider", mass=2.0)
    m.revolute("a", m.ground, crank, axis=z)
    m.revolute("b", crank.at(*at(0.2, 0)), rod, axis=z)
    m.revolute("c", rod.at(*at(0.7, 0)), slider, axis=z)
    m.prismatic("s", m.ground.at(*at(0, 0.05)), slider, axis=at(1, 0))
    m.guess(b=-0.4, s=0.85)
    m.initial(a=0.4, a_dot=3.0)
    return m


MAKERS: dict[str, Callable[[int], eg.Model]] = {"v6": v_engine, "bars": four_bar, "slider": slider_crank}


def work(model: eg.Model) -> int:
    """Multiplications and additions of the forces of inertia and of all that is asked of the loops."""
    counts = model.derive("recursive").operations
    return sum(counts[k].multiplications + counts[k].additions for k in ("inverse_dynamics", "constraints"))


@pytest.mark.parametrize("name", MAKERS)
def test_a_turned_mechanism_takes_hardly_more_operations(name: str) -> None:
    straight = work(MAKERS[name](0))
    for seed in (1, 3, 8):
        assert work(MAKERS[name](seed)) <= 1.2 * straight, seed


@pytest.mark.parametrize("name", MAKERS)
def test_a_turned_mechanism_moves_as_the_straight_one(name: str) -> None:
    straight = MAKERS[name](0).derive().compile(target="numpy")
    turned = MAKERS[name](3).derive().compile(target="numpy")
    T = turn(3)
    x = straight.x0()
    assert np.abs(turned.x0() - x).max() < 1e-11
    a, b = straight.rhs(0.0, x), turned.rhs(0.0, x)
    assert np.abs(a - b).max() <= 1e-11 * np.abs(a).max()
    wrenches = np.asarray(straight.reactions(0.0, x)).reshape(-1, 3)
    found = np.asarray(turned.reactions(0.0, x)).reshape(-1, 3)
    assert np.abs(found - wrenches @ T.T).max() <= 1e-9 * np.abs(wrenches).max()
