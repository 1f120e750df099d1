"""Stiff equilibria by closed forms, and a contest with plain Newton and SciPy's solvers on random mechanisms.

The whole contest is ``python -m benchmarks.run equilibria``.
"""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
import pytest

import eomgen as eg
from benchmarks.equilibria import PEERS, Balance, judge
from benchmarks.rest_models import FAMILIES
from eomgen.analysis import balance_search
from eomgen.shipped import example_files


def elastic_pendulum() -> Any:
    m = eg.Model("p", gravity=(0, -9.81, 0))
    slide, bob = m.body("c", mass=0), m.body("b", mass=1)
    m.parameter("k", 1e5)
    m.prismatic("X", m.ground, slide, axis="x", coordinate="x")
    m.prismatic("Y", slide, bob, axis="y", coordinate="y")
    m.spring("s", m.ground, bob, stiffness="k", length=1)
    return m.compile(target="numpy")


def test_an_elastic_pendulum_of_any_stiffness_from_any_angle() -> None:
    """Hanging: y = -(1 + m g/k), frequencies sqrt(k/m) and sqrt(g/l); standing: 1 - m g/k, unstable."""
    mod = elastic_pendulum()
    for k in 10.0 ** np.arange(2, 11):
        for angle in (0.05, 0.3, 1.0, 1.5, 2.5, 3.1):
            found = mod.equilibrium({"x": np.sin(angle), "y": -np.cos(angle)}, p={"k": k})
            below = found["y"] < 0.0
            assert found["x"] == pytest.approx(0.0, abs=1e-11)
            assert found["y"] == pytest.approx(-1 - 9.81 / k if below else 1 - 9.81 / k, abs=1e-12)
            assert found.stability == ("stable (undamped)" if below else "unstable")
            assert below or angle > 1.5
            assert found.linear.is_equilibrium
            assert np.abs(list(found.forces.values())).max() < 4e-16 * k + 1e-12


def test_a_run_from_a_stiff_equilibrium_stays_there() -> None:
    mod = elastic_pendulum()
    found = mod.equilibrium({"x": np.sin(0.05), "y": -np.cos(0.05)})
    run = mod.simulate(0.5, initial=found.x)
    np.testing.assert_allclose(run["y"], found["y"], atol=1e-10)
    np.testing.assert_allclose(run["x"], 0.0, atol=1e-10)


def test_the_governor_from_its_default_guess() -> None:
    """At rest the arms hang down and the two springs carry the slider of 3 kg: s = -m g / (2 k)."""
    found = eg.load(example_files()["flyball_governor"]).compile(target="numpy").equilibrium()
    assert found["alpha_1"] == pytest.approx(np.pi / 2, abs=1e-11)
    assert found["alpha_2"] == pytest.approx(np.pi / 2, abs=1e-11)
    assert found["s"] == pytest.approx(-3.0 * 9.81 / 1.6e6, rel=1e-9)
    assert found.stability == "marginal"  # it may turn about its axis


def test_a_hanging_body_with_a_free_rotor_is_never_called_unstable() -> None:
    """Two neutral motions are double zeros with one eigenvector each, which rounding splits by its root, 5e-8."""
    m = eg.Model("hang", gravity=(0, -9.80665, 0))
    b = m.body("b", mass=3.8, com=(0.125, 0, 0), inertia=(0.0012, 0.02, 0.02))
    m.spherical("S", m.ground, b, rotation="euler_parameters")
    rotor = m.body("r", mass=12.1, inertia=(0.015, 0.048, 0.048))
    m.revolute("R", b.at(0.25, 0, 0, rpy=(0, np.pi / 4, 0)), rotor, axis="x")
    mod, rng, seen = m.compile(target="numpy"), np.random.default_rng(0), Counter[tuple[bool, str]]()
    for _ in range(60):
        q = rng.normal(size=4)
        q /= np.linalg.norm(q)
        found = mod.equilibrium({f"S_e{i}": q[i] for i in range(4)})
        seen[bool(mod.poses(found.q)[0, 1, 0] > 0.0), found.stability] += 1  # its x axis, with the masses, upwards
        spun = np.array(found.x)
        spun[mod.x_names.index("R_dot")] = 1e-3  # slowly, so that it decides nothing
        assert mod.linearize(spun).stability == found.stability
    assert set(seen) == {(False, "marginal"), (True, "unstable")}
    assert min(seen.values()) > 10


@pytest.mark.parametrize("free", [False, True])
def test_damping_makes_a_rest_asymptotically_stable_unless_something_is_free(free: bool) -> None:
    m = eg.Model("damped", gravity=(0, -9.81, 0))
    bob = m.body("bob", mass=1, com=(0, -1, 0), inertia={"zz": 0.1})
    m.revolute("A", m.ground, bob, coordinate="a")
    m.revolute("B", bob, m.body("wheel", mass=1, inertia={"zz": 0.2}), coordinate="b")
    m.actuator("drag", "A", "-0.3*a_dot")
    if not free:
        m.actuator("hold", "B", "-2*b - 0.1*b_dot")
    mod = m.compile(target="numpy")
    assert mod.equilibrium({"a": 0.4}).stability == ("marginal" if free else "asymptotically stable")
    assert mod.linearize(mod.x0(a=np.pi)).stability == "unstable"


def test_follower_forces_are_judged_by_eigenvalues() -> None:
    """A stiffness that is not symmetric flutters: w^2 (complex) of [[3, p], [-p, 2]] if 2 p > 1."""
    m = eg.Model("flutter")
    for name, value in (("a", "-3*a - p*b"), ("b", "p*a - 2*b")):
        m.prismatic(name.upper(), m.ground, m.body(f"m{name}", mass=1), axis="x", coordinate=name)
        m.actuator(f"f{name}", name.upper(), value)
    m.parameter("p", 0.4)
    mod = m.compile(target="numpy")
    assert mod.equilibrium({"a": 0.1}).stability == "marginal"
    assert mod.equilibrium({"a": 0.1}, p={"p": 0.6}).stability == "unstable"


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES)
def test_every_equilibrium_that_others_find_is_found(family: str) -> None:
    cases = [judge(family, number) for number in range(7000, 7003)]
    assert [case for case in cases if not case.ours and any(case.peers.values())] == []
    assert [case for case in cases if not case.agrees] == []
    assert any(any(case.peers[name] for name in PEERS) for case in cases)


def test_the_contest_knows_what_is_no_equilibrium() -> None:
    mod = elastic_pendulum()
    balance = Balance(mod)
    assert balance.holds(np.array([0.0, -1 - 9.81e-5]))
    assert not balance.holds(np.array([0.0, -1.0]))
    assert not balance.holds(np.array([1e-3, -1 - 9.81e-5]))


@pytest.mark.parametrize("way", ["creep", "plain", "marquardt"])
def test_each_way_finds_what_is_near_by_itself(way: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The other ways are blocked; the one left must lead where Newton's iteration has the last word."""
    newton, blocked = balance_search.newton, {"creep", "plain", "marquardt"} - {way}

    def last_word(problem: Any, point: Any, plain: bool = False, reach: float = np.inf) -> Any:
        near = np.linalg.norm(problem.residual(point.here, point.here)) < 1e-3 or (plain and way == "plain")
        return newton(problem, point, plain, reach) if near else (point, 0, False)

    monkeypatch.setattr(balance_search, "newton", last_word)
    for name in blocked - {"plain"}:
        monkeypatch.setattr(balance_search, name, lambda problem, point: (point, 0, False))
    found = elastic_pendulum().equilibrium({"x": np.sin(0.05), "y": -np.cos(0.05)})
    assert found["y"] == pytest.approx(-1 - 9.81e-5, abs=1e-12)
