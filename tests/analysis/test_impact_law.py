"""The law of impacts of several gaps at once, against complementarity solved by enumeration, and closed forms."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
import pytest

import eomgen as eg


def enumerated(M: Any, N: Any, v: Any, e: Any) -> Any:
    """Velocities after: of all sets of pushing gaps the one that fits, again until no gap closes."""
    v = np.array(v, dtype=float)
    for _ in range(5000):
        rates = N @ v
        involved = np.flatnonzero(rates <= 1e-13)
        if not (rates < -1e-11).any():
            return v
        need = np.where(rates < -1e-13, -(1 + e) * rates, 0.0)
        A = N @ np.linalg.solve(M, N.T)
        v = v + np.linalg.solve(M, N.T @ one_of_the_sets(A, need, involved))
    raise AssertionError("no end")


def one_of_the_sets(A: Any, need: Any, involved: Any) -> Any:
    for count in range(len(involved) + 1):
        for chosen in map(list, combinations(involved, count)):
            g = np.zeros(len(need))
            g[chosen] = np.linalg.lstsq(A[np.ix_(chosen, chosen)], need[chosen], rcond=1e-12)[0] if chosen else 0.0
            slack = (A @ g - need)[involved]
            if (
                (g >= -1e-12).all()
                and (slack >= -1e-10).all()
                and np.abs((A @ g - need)[chosen]).max(initial=0) < 1e-10
            ):
                return g
    raise AssertionError("no set fits")


def linear(masses: Any, normals: Any) -> Any:
    """Masses on lines of their own, gaps that are linear in their places."""
    m = eg.Model("linear")
    for i, mass in enumerate(masses):
        m.prismatic(f"x{i}", m.ground, m.body(f"b{i}", mass=float(mass)), axis="x")
    for k, row in enumerate(normals):
        m.output(f"g{k}", " + ".join(f"({float(a)!r})*x{i}" for i, a in enumerate(row)))
    return m.compile(target="numpy")


def strike(mod: Any, v: Any, e: Any) -> Any:
    gaps = {f"g{k}": float(e_k) for k, e_k in enumerate(e)}
    return mod.impact(0.0, np.concatenate([np.zeros(mod.n_q), v]), gaps)


CHAIN = np.array([[-1.0, 1, 0, 0], [0, -1, 1, 0], [0, 0, -1, 1]])


def test_balls_on_a_line() -> None:
    """Any four velocities and restitutions; no energy is gained, whatever the restitutions."""
    rng = np.random.default_rng(3)
    masses = [1.0, 2.5, 0.7, 1.3]
    mod, M = linear(masses, CHAIN), np.diag(masses)
    for k in range(60):
        v = rng.normal(size=4)
        e = rng.random(3) if k % 2 else np.full(3, rng.random())
        hit = strike(mod, v, e)
        np.testing.assert_allclose(hit.x[4:], enumerated(M, CHAIN, v, e), atol=1e-8)
        assert (hit.rates_after > -1e-10).all()
        assert (hit.impulses >= 0.0).all()
        np.testing.assert_allclose(M @ (hit.x[4:] - v), CHAIN.T @ hit.impulses, atol=1e-12)
        np.testing.assert_allclose(hit.energy_lost, 0.5 * (v @ M @ v - hit.x[4:] @ M @ hit.x[4:]), atol=1e-12)
        assert hit.energy_lost > -1e-12


def test_more_gaps_than_freedoms() -> None:
    """A corner of six walls in three dimensions: the law is kept, impulses or not unique, velocities are."""
    rng = np.random.default_rng(5)
    for e in (np.zeros(6), np.full(6, 0.4), np.ones(6), rng.random(6)):
        masses = rng.uniform(0.5, 2.0, 3)
        N = rng.normal(size=(6, 3)) + 2.0
        mod, M = linear(masses, N), np.diag(masses)
        for _ in range(5):
            v = rng.normal(size=3) - 1.0
            hit = strike(mod, v, e)
            np.testing.assert_allclose(hit.x[3:], enumerated(M, N, v, e), atol=1e-8)
            assert hit.energy_lost > -1e-12


def test_a_gap_that_opens_is_not_closed_by_the_impact_beside_it() -> None:
    mod = linear(np.ones(4), CHAIN)
    hit = strike(mod, [1.0, 0.0, 0.1, 0.0], np.ones(3))  # passed on from one to the next, at one instant
    np.testing.assert_allclose(hit.x[4:], [0.0, 0.0, 0.1, 1.0], atol=1e-14)
    hit = strike(mod, [1.0, 0.0, 0.0, 0.0], np.ones(3))  # balls that touch at rest take part together: Moreau's answer
    np.testing.assert_allclose(hit.x[4:], [-0.5, 0.5, 0.5, 0.5], atol=1e-14)
    np.testing.assert_allclose(hit.impulses, [1.5, 1.0, 0.5], atol=1e-14)
    np.testing.assert_allclose(strike(mod, [1.0, 0.0, 0.0, 0.0], np.zeros(3)).x[4:], 0.25, atol=1e-14)
    assert strike(mod, [0.0, 1.0, 2.0, 3.0], np.ones(3)).energy_lost == 0.0


def test_jammed_between_two_walls() -> None:
    mod = linear([2.0], [[1.0], [-1.0]])
    with pytest.raises(eg.UsageError, match=r"the gaps g\d.* cannot open together.*give them restitution 0"):
        strike(mod, [3.0], [1.0, 1.0])
    hit = strike(mod, [3.0], [0.0, 0.0])
    np.testing.assert_allclose([hit.x[1], hit["g0"], hit["g1"], hit.energy_lost], [0.0, 0.0, 6.0, 9.0], atol=1e-12)
    np.testing.assert_allclose(strike(mod, [3.0], [0.5, 0.5]).x[1], 0.0, atol=1e-10)  # to and fro until it stands
    wedge = linear([1.0, 1.0], [[1.0, 0.0], [-1.0, 1e-7]])
    with pytest.raises(eg.UsageError, match="g0, g1 cannot open together"):
        strike(wedge, [-1.0, -1e8], [1.0, 1.0])


def test_what_geometry_holds_takes_no_impulse() -> None:
    """A crank that two parallel guides keep from turning: its rate is rounding, whatever its sign."""
    m = eg.Model("guide")
    a, b = (m.body(name, mass=1.0, inertia={"zz": 0.1}) for name in "ab")
    m.revolute("R", m.ground, a, coordinate="r")
    m.prismatic("P", a.marker("m", at=(0.3, 0.1, 0), rpy=(0, 0, 0.7)), b, axis="x", coordinate="p")
    m.prismatic("Q", m.ground.marker("n", at=(0.3, 0.1, 0), rpy=(0, 0, 0.7)), b, axis="x", coordinate="s")
    mod = m.compile(target="numpy")
    rng = np.random.default_rng(0)
    signs = set()
    for _ in range(12):
        x = mod.project(np.concatenate([np.zeros(mod.n_q), rng.normal(size=mod.n_v)]))
        x[mod.x_names.index("r_dot")] = rng.choice([-1.0, 1.0]) * 1e-16
        for hit in (mod.impact(0.0, x, {"r": 0.5}), mod.impact(0.0, x, lock=["r"])):
            signs.add(float(np.sign(hit.rates_before[0])))
            np.testing.assert_allclose(hit.x, x, atol=1e-13)
            assert hit["r"] == hit.energy_lost == 0.0
        both = mod.impact(0.0, x, {"r": 0.5, "s": 0.5})
        s_dot = x[mod.n_q :] @ [0.0, 1.0] if mod.v_names[1] == "p_dot" else x[mod.x_names.index("s_dot")]
        assert both["r"] == 0.0
        np.testing.assert_allclose(both.rates_after[1], max(s_dot, -0.5 * s_dot), atol=1e-12)
    assert -1.0 in signs  # some come towards it by rounding


def test_what_drivers_impose() -> None:
    m = eg.Model("driven")
    m.revolute("A", m.ground, m.body("b", mass=1.0), coordinate="a")
    m.driver("d", "A", value="-2*t")
    mod = m.compile(target="numpy")
    with pytest.raises(eg.UsageError, match="gap a closes at the rate -2, which drivers or constraints prescribe"):
        mod.impact(0.0, mod.x0(), {"a": 0.5})
    with pytest.raises(eg.UsageError, match="has no degree of freedom"):
        mod.simulate_impacts(1.0, {"a": 0.5})


@pytest.mark.parametrize("e", [0.0, 0.6, 1.0])
def test_a_racket_that_moves(e: float) -> None:
    """A gap to something that moves in time: v+ = w - e (v - w), and the racket does work."""
    m = eg.Model("racket")
    m.prismatic("y", m.ground, m.body("ball", mass=2.0), axis="y")
    m.output("gap", "y - 0.1*sin(5*t)")
    mod = m.compile(target="numpy")
    t = 0.3
    x = np.array([0.1 * np.sin(5 * t), -1.0])
    w = 0.5 * np.cos(5 * t)
    hit = mod.impact(t, x, {"gap": e})
    np.testing.assert_allclose(hit.x[1], w - e * (-1.0 - w), rtol=1e-9)
    np.testing.assert_allclose(hit.energy_lost, 1.0 - hit.x[1] ** 2, rtol=1e-9)
