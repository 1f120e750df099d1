"""Which laws of reactions are taken to have one solution: beside eigenvalues, and roots counted on a grid."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest

import eomgen as eg
from eomgen.errors import ModelError, NonFiniteError


def sliders(order: tuple[int, ...], turned: bool = False) -> eg.Module:
    """Bodies in guides along x, pressed along y by sums of their reactions: N = 1 + K N, in any order of laws."""
    m = eg.Model("sliders", gravity=(0, -1, 0))
    n = len(order)
    for i in range(n):
        for j in range(n):
            m.parameter(f"k{i}{j}", 0.0)
    bodies = [m.body(f"b{i}", mass=1.0, inertia={"zz": 0.1}) for i in range(n)]
    for i, body in enumerate(bodies):
        m.prismatic(f"P{i}", m.ground, body, axis="x")
        m.output(f"N{i}", f"reaction(P{i}).y")
    for i in order:
        terms = [f"k{i}{j}*reaction(P{j}).y" for j in (order[::-1] if turned else order)]
        m.force(f"f{i}", bodies[i], (0, f"-({' + '.join(terms)})", 0))
    return m.compile(target="numpy")


def found(mod: eg.Module, K: np.ndarray) -> np.ndarray | None:
    """The reactions, None where they are refused."""
    try:
        return mod.outputs(0.0, np.zeros(mod.n_x), p=K.ravel())
    except NonFiniteError as error:
        assert "f0" in str(error)
        assert "depend on reactions" in str(error)
        return None


def has_solution_on_the_way(K: np.ndarray) -> bool:
    values = np.linalg.eigvals(K)
    return not any(abs(z.imag) < 1e-12 and z.real >= 1.0 for z in values)


def test_the_order_of_laws_and_terms_does_not_matter() -> None:
    """The eigenvalues 1.22 and 3.28: forces that grow from 0 become infinite on the way, whatever the pivots are."""
    K = np.array([[0.5, 2.0], [-1.0, 4.0]])
    assert not has_solution_on_the_way(K)
    for order in permutations(range(2)):
        for turned in (False, True):
            assert found(sliders(order, turned), K) is None


@pytest.mark.parametrize("n", [2, 3])
def test_linear_laws_beside_their_eigenvalues(n: int) -> None:
    orders = list(permutations(range(n)))
    modules = [sliders(order) for order in (orders if n == 2 else [orders[0], orders[3], orders[5]])]
    random, seen = np.random.default_rng(11), {True: 0, False: 0, "turning": 0}
    for _ in range(150):
        K = random.normal(size=(n, n)) * random.choice([0.5, 1.0, 3.0])
        answers = [found(mod, K) for mod in modules]
        accepted = answers[0] is not None
        assert all((a is not None) == accepted for a in answers)
        values = np.linalg.eigvals(K)
        seen[accepted] += 1
        if accepted:
            assert has_solution_on_the_way(K)
            N = np.linalg.solve(np.eye(n) - K, np.ones(n))
            for a in answers:
                assert a == pytest.approx(N, rel=1e-9, abs=1e-9 * np.abs(N).max())
        if np.abs(values).max() < 0.9:
            assert accepted
        if n == 2 and (np.abs(values.imag) > np.abs(values) / 8).all():
            assert accepted
            seen["turning"] += int(np.trace(K) > 2.0)
    assert min(seen[True], seen[False]) > 20
    assert n == 3 or seen["turning"]  # found by cutting the way


def test_a_leading_entry_of_nought_is_no_trouble() -> None:
    K = np.array([[1.0, -2.0], [1.0, -1.0]])
    for order in permutations(range(2)):
        N = found(sliders(order), K)
        assert N is not None
        assert pytest.approx(np.linalg.solve(np.eye(2) - K, np.ones(2)), rel=1e-14) == N


#: Law of N -> the same in Python.
LAWS = {
    "{c}*max(0, {N})": lambda N, c: c * np.maximum(0, N),
    "{c}*{N}*({N} > 0)": lambda N, c: c * N * (N > 0),
    "({N} > 0)*{c}*{N}**2/{N}": lambda N, c: c * N * (N > 0),
    "{c}*({N} if {N} > 0 else 0)": lambda N, c: c * N * (N > 0),
    "{c}*({N} + abs({N}))/2*(2 - exp(-{N}**2))/2": lambda N, c: c * np.maximum(0, N) * (2 - np.exp(-(N**2))) / 2,
    "{c}*max(0, {N})*1.0000001**{N}": lambda N, c: c * np.maximum(0, N) * 1.0000001**N,
    "{c}*max(0, min({N}, 3))*(1 if {N} < 3 else {N}/3)": lambda N, c: c * np.maximum(0, N),
    "{c}*sqrt(max(0, {N})**2)": lambda N, c: c * np.maximum(0, N),
}


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("late", [False, True])
def test_pieces_count_however_they_are_written(law: str, late: bool) -> None:
    """N = law - w: where a grid finds several solutions or none the call is refused, elsewhere it finds the one."""
    grid = np.linspace(-20.0, 20.0, 400_002)
    accepted = 0
    for c in (0.4, 0.9, 2.0):
        for w in (1.0, -0.7):
            m = eg.Model("law", gravity=(0, w, 0))
            m.parameter("c", 0.1 if late else c)
            m.prismatic("A", m.ground, m.body("b", mass=1.0, inertia={"zz": 0.1}), axis="x")
            m.force("f", "b", (0, f"-({law.format(N='reaction(A).y', c='c' if late else c)})", 0))
            m.output("N", "reaction(A).y")
            mod = m.compile(target="numpy")
            gap = grid + w - LAWS[law](grid, c)
            roots = grid[np.flatnonzero(np.diff(np.sign(gap)))]
            try:
                N = mod.outputs(0.0, np.zeros(2), p=[c] if late else None)[0]
            except NonFiniteError as error:
                assert "the forces of f depend on reactions" in str(error)
                assert c > 0.8
                continue
            accepted += 1
            assert len(roots) == 1
            assert pytest.approx(roots[0], abs=1e-3) == N
    assert accepted >= 2


def test_a_law_of_too_many_pieces_is_named() -> None:
    m = eg.Model("many", gravity=(0, 1, 0))
    m.prismatic("A", m.ground, m.body("b", mass=1.0, inertia={"zz": 0.1}), axis="x")
    product = "*".join(f"max({k}, reaction(A).y)" for k in range(1, 8))
    m.force("f", "b", (0, f"0.001*{product}", 0))
    with pytest.raises(ModelError, match=r"forces.f: its law of a reaction has more than 64 pieces.*sum of terms"):
        m.compile(target="numpy")
