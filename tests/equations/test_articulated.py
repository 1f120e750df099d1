"""Constraints on articulated bodies against the dense system of M and the multipliers, solved by NumPy."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pytest
from mechanisms import random_mechanism
from sweeps import part_of, seeds

import eomgen as eg
from eomgen.equations import METHODS
from eomgen.equations.articulated import ConstraintRow, TreeMotion
from eomgen.graph import evaluate
from eomgen.graph.count import count
from eomgen.kinematics import Kinematics, analyse


def state(kinematics: Kinematics, seed: int) -> dict[str, float]:
    random = np.random.default_rng(seed)
    names = [*kinematics.names, *kinematics.velocity_names]
    found = {"t": 0.4} | dict(zip(names, random.uniform(-1, 1, len(names)).tolist(), strict=True))
    for i, _ in kinematics.quaternion_slots:
        e = random.normal(size=4)
        found |= dict(zip(kinematics.names[i : i + 4], (e / np.linalg.norm(e)).tolist(), strict=True))
    return found


def dense(kinematics: Kinematics, values: dict[str, float], A: np.ndarray, r: np.ndarray) -> np.ndarray:
    """a and multipliers of M a + h + A^T l = 0 and A a + r = 0, with M and h of another method."""
    n, m = len(kinematics.v), len(A)
    tree = METHODS["embedding"](kinematics)
    M = np.array(evaluate([x for row in tree.mass_matrix for x in row], values), dtype=float).reshape(n, n)
    h = np.array(evaluate(list(tree.bias), values), dtype=float)
    K = np.block([[M, A.T], [A, np.zeros((m, m))]])
    return np.linalg.solve(K, -np.concatenate([h, r]))


def random_rows(kinematics: Kinematics, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows on one, two or many velocities, on any branches."""
    random = np.random.default_rng(seed)
    n = len(kinematics.v)
    A = np.zeros((count, n))
    while np.linalg.svd(A)[1][-1] < 0.1:
        A[:] = 0.0
        for row in A:
            places = random.choice(n, size=min(n, int(random.choice([1, 2, 3, n]))), replace=False)
            row[places] = random.uniform(-1, 1, len(places))
    return A, random.uniform(-1, 1, count)


def solve(kinematics: Kinematics, A: np.ndarray, r: np.ndarray, term: float = 0.0) -> TreeMotion:
    graph, constrained = kinematics.graph, METHODS["recursive"](kinematics).constrained
    assert constrained is not None
    rows = [ConstraintRow({k: graph.constant(x) for k, x in enumerate(row) if x}, graph.constant(y))
            for row, y in zip(A.tolist(), r.tolist(), strict=True)]  # fmt: skip
    return constrained(rows, term)


def numbers(expressions: Any, values: dict[str, float]) -> np.ndarray:
    return np.array(evaluate(list(expressions), values), dtype=float)


@pytest.mark.parametrize("reverse", [False, True])
@pytest.mark.parametrize("seed", seeds(25, 12))
def test_any_rows_on_any_tree(seed: int, reverse: bool) -> None:
    """Free, spherical and simple joints; rows that begin and end anywhere, on ground and on what falls."""
    kinematics = analyse(random_mechanism(seed, bodies=2 + seed % 6, reverse=reverse).mechanism)
    values = state(kinematics, seed + 3)
    n = len(kinematics.v)
    A, r = random_rows(kinematics, 1 + seed % min(4, n), seed)
    expected = dense(kinematics, values, A, r)
    found = solve(kinematics, A, r)
    size = np.abs(expected[:n]).max()
    assert np.abs(numbers(found.accelerations, values) - expected[:n]).max() <= 1e-10 * size
    assert np.abs(numbers(found.multipliers, values) - expected[n:]).max() <= 1e-9 * np.abs(expected[n:]).max()


@pytest.mark.parametrize("seed", seeds(10, 6))
def test_rows_that_repeat_others(seed: int) -> None:
    """The term added to redundant rows leaves nothing of itself in the accelerations."""
    kinematics = analyse(random_mechanism(seed, bodies=4, reverse=False).mechanism)
    values = state(kinematics, seed)
    A, r = random_rows(kinematics, 2, seed + 50)
    n = len(kinematics.v)
    expected = dense(kinematics, values, A, r)[:n]
    twice = np.vstack([A, 2.0 * A[0] - 0.5 * A[1], A[1]])
    found = solve(kinematics, twice, np.array([*r, 2.0 * r[0] - 0.5 * r[1], r[1]]), 1e-12)
    assert np.abs(numbers(found.accelerations, values) - expected).max() <= 1e-9 * np.abs(expected).max()


def test_a_row_without_entries_has_no_force() -> None:
    kinematics = analyse(random_mechanism(1, bodies=3, reverse=False).mechanism)
    values = state(kinematics, 1)
    A, r = random_rows(kinematics, 1, 1)
    expected = dense(kinematics, values, A, r)
    found = solve(kinematics, np.vstack([A, 0.0 * A]), np.array([*r, 0.0]))
    assert numbers(found.multipliers, values)[1] == 0.0
    assert np.abs(numbers(found.accelerations, values) - expected[:-1]).max() <= 1e-10 * np.abs(expected).max()


def chain(n: int, closed: bool) -> eg.Model:
    """Links of a planar chain; the last one is held to ground."""
    m = eg.Model("chain", gravity=(0, -9.81, 0))
    last: Any = m.ground
    for i in range(n):
        link = m.body(f"b{i}", mass=1.0, com=(0.05, 0, 0), inertia=(1e-4, 1e-3, 1e-3))
        m.revolute(f"j{i}", last, link)
        last = link.at(0.1, 0, 0)
        (m.guess if closed else m.initial)(**{f"j{i}": 2 * np.pi / (n + 1) if closed else 0.1})
    if closed:
        m.revolute("end", last, m.ground.at(0.02, 0.02, 0))
    return m


def carried_loops(n: int) -> eg.Model:
    """A chain of links, each with a four-bar on it: loops that begin and end on a link."""
    m = eg.Model("carried", gravity=(0, -9.81, 0))
    last: Any = m.ground
    for i in range(n):
        link = m.body(f"b{i}", mass=1.0, com=(0.1, 0, 0), inertia=(1e-3, 1e-2, 1e-2))
        m.revolute(f"j{i}", last, link)
        bars = [m.body(f"{name}{i}", mass=0.1, com=(0, 0.05, 0), inertia=(1e-4, 1e-4, 1e-4)) for name in "rcs"]
        m.revolute(f"r{i}", link, bars[0])
        m.revolute(f"c{i}", bars[0].at(0, 0.1, 0), bars[1])
        m.revolute(f"s{i}", link.at(0.1, 0, 0), bars[2])
        m.revolute(f"e{i}", bars[1].at(0.1, 0.02, 0), bars[2].at(0, 0.11, 0))
        m.initial(**{f"j{i}": 0.1})
        m.guess(**{f"r{i}": 0.1, f"s{i}": 0.1})
        last = link.at(0.2, 0, 0)
    return m


@pytest.mark.parametrize("make", [partial(chain, closed=True), carried_loops])
def test_work_grows_as_the_mechanism_does(make: Any) -> None:
    """Further bodies take as many operations as those before them: a loop costs what is in it."""

    def work(n: int) -> int:
        kinematics = make(n).derive("recursive").kinematics
        constrained, c = METHODS["recursive"](kinematics).constrained, kinematics.constraints
        rows = [ConstraintRow({k: x for k, x in enumerate(row) if not x.is_zero}, rest)
                for row, rest in zip(c.jacobian, c.gamma, strict=True)]  # fmt: skip
        assert constrained is not None
        return count(list(constrained(rows, 0.0).accelerations)).total

    assert work(60) - work(40) < 1.05 * (work(40) - work(20))


@pytest.mark.parametrize(
    "name",
    part_of(
        ["slider_crank", "delta_robot", "excavator", "stewart_platform", "bicycle"],
        {"slider_crank", "excavator"}.__contains__,
    ),
)
def test_modules_agree_with_the_embedded_system(name: str) -> None:
    """Right-hand side, its Jacobian, mass matrices and outputs, at states that are brought onto the constraints."""
    model = eg.load_example(name)
    bodies, embedded = model.compile("recursive"), model.compile("embedding")
    random, x0 = np.random.default_rng(5), embedded.x0()
    for _ in range(5):
        x = embedded.project(x0 + 0.03 * random.normal(size=len(x0)))
        one, other = bodies.rhs(0.3, x), embedded.rhs(0.3, x)
        assert np.abs(one - other).max() <= 1e-9 * np.abs(other).max()
    one, other = bodies.jacobian(0.3, x), embedded.jacobian(0.3, x)
    assert np.abs(one - other).max() <= 1e-7 * np.abs(other).max()


def test_what_moves_no_mass_is_left_to_the_embedded_system() -> None:
    """A coupler without mass: its joint alone has no inertia, the loop has."""
    m = eg.Model("light", gravity=(0, -9.81, 0))
    crank, slider = m.body("crank", mass=1.0, com=(0.1, 0, 0), inertia={"zz": 0.004}), m.body("slider", mass=0.5)
    rod = m.body("rod", mass=0.0)
    m.revolute("A", m.ground, crank, coordinate="theta")
    m.revolute("B", crank.at(0.2, 0, 0), rod)
    m.revolute("C", rod.at(0.5, 0, 0), slider)
    m.prismatic("D", m.ground, slider, axis="x", coordinate="s")
    m.initial(theta=0.3, theta_dot=10)
    assert m.derive().method == "embedding"
    one, other = m.compile("recursive"), m.compile("lagrange")
    assert np.allclose(one.rhs(0.0, one.x0()), other.rhs(0.0, other.x0()), rtol=1e-10)


def test_large_loops_are_left_to_articulated_bodies() -> None:
    """``auto`` counts both; what is not even written out in the embedded form is not derived in it."""
    equations = chain(30, True).derive()
    assert equations.method == "recursive"
    assert equations.choice is not None
    assert set(equations.choice.operations) == {"recursive"}
    assert eg.load_example("slider_crank").derive().method == "embedding"


@pytest.mark.slow
def test_flat_positions_are_passed() -> None:
    """Ten parallelograms in a row lie flat about every half second, and have ten more freedoms there (IFToMM, A02)."""
    from benchmarks.linkages import n_four_bar
    from benchmarks.loops import tip

    equations = n_four_bar(10).derive(independent=["theta0"])
    assert equations.method == "recursive"
    run = equations.compile().simulate((0, 4))
    assert np.abs(np.array([run["x"], run["y"]]) - tip(10, run.t)).max() < 1e-3
    assert np.ptp(run["y"]) > 1.9  # from one side to the other
