"""Lagrange and embedding share nothing after the kinematics, and agree on random mechanisms of every kind."""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mechanisms import random_mechanism

import eomgen.equations
from eomgen.equations import METHODS, embedding, lagrange
from eomgen.graph import evaluate
from eomgen.kinematics import analyse
from eomgen.kinematics.mobility import find_mobility


def test_methods_import_only_what_they_may_share() -> None:
    folder = Path(eomgen.equations.__file__).parent
    common = {"frames", "graph", "kinematics", "records", "tree_equations"}  # the type they all return
    families = {  # related by what they are: the same energies, the same free bodies, the same M and h
        "lagrange": {"analytical"},
        "hamilton": {"analytical"},
        "newton_euler": {"free_bodies", "free_body_system"},
        "amalgamated": {"free_bodies", "free_body_system"},
        "augmented": {"", "armature"},
        "embedding": {"composite_bodies"},
        "recursive": {"articulated", "composite_bodies"},
    }
    for name in METHODS:
        allowed = common | families.get(name, set())
        for node in ast.walk(ast.parse((folder / f"{name}.py").read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.level:
                module = (node.module or "").split(".")[0]
                assert module in allowed, f"{name}.py imports {node.module}"


mechanisms = st.builds(
    random_mechanism,
    seed=st.integers(0, 2**20),
    bodies=st.integers(1, 5),
    planar=st.booleans(),
    reverse=st.booleans(),
    loop=st.booleans(),
)


@settings(max_examples=40, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(made=mechanisms, seed=st.integers(0, 2**20))
def test_methods_agree(made: object, seed: int) -> None:
    mechanism = made.mechanism  # type: ignore[attr-defined]
    kinematics = analyse(mechanism)
    one, other = lagrange.derive(kinematics), embedding.derive(kinematics)
    n = len(kinematics.q)
    random = np.random.default_rng(seed)
    values = {"t": 0.4}
    for suffix in ("", "_dot", "_ddot"):
        values |= {name + suffix: float(random.uniform(-1, 1)) for name in kinematics.names}

    def number(expressions: object) -> np.ndarray:
        return np.array(evaluate(list(expressions), values), dtype=float)  # type: ignore[call-overload]

    def same(a: np.ndarray, b: np.ndarray) -> None:
        assert np.abs(a - b).max(initial=0.0) <= 1e-11 * max(1.0, np.abs(b).max(initial=0.0))

    mass = number(x for row in other.mass_matrix for x in row).reshape(n, n)
    same(number(x for row in one.mass_matrix for x in row).reshape(n, n), mass)
    same(number(one.bias), number(other.bias))
    same(number(one.inverse_dynamics), number(other.inverse_dynamics))
    energies = number([one.kinetic_energy, one.potential_energy])
    same(energies, number([other.kinetic_energy, other.potential_energy]))
    # identities of the mechanics: M symmetric, positive semidefinite, T = v M v / 2, inverse dynamics = M a + h
    v, a = (np.array([values[name + s] for name in kinematics.names]) for s in ("_dot", "_ddot"))
    assert np.linalg.eigvalsh(mass).min() >= -1e-12 * np.abs(mass).max()
    assert abs(0.5 * v @ mass @ v - energies[0]) <= 1e-12 * max(1.0, energies[0])
    same(mass @ a + number(other.bias), number(other.inverse_dynamics))


@settings(max_examples=25, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(seed=st.integers(0, 2**20), bodies=st.integers(2, 5), planar=st.booleans(), reverse=st.booleans())
def test_loop_derivatives_equal_differences_along_a_motion(seed: int, bodies: int, planar: bool, reverse: bool) -> None:
    """C_q, C' and gamma against complex-free central differences of C itself along q(t) = q + v t + a t^2 / 2."""
    made = random_mechanism(seed, bodies, planar=planar, reverse=reverse, loop=True)
    kinematics = analyse(made.mechanism)
    c = kinematics.constraints
    random = np.random.default_rng(seed)
    q, v, a = random.uniform(-1, 1, (3, len(kinematics.q)))

    def at(tau: float, expressions: object) -> np.ndarray:
        x = q + v * tau + a * tau**2 / 2
        values = {"t": tau} | dict(zip(kinematics.names, x.tolist(), strict=True))
        values |= dict(zip([n + "_dot" for n in kinematics.names], (v + a * tau).tolist(), strict=True))
        return np.array(evaluate(list(expressions), values), dtype=float)  # type: ignore[call-overload]

    h = 1e-4
    size = 1.0 + np.abs(v).max() ** 2 + np.abs(a).max()
    first = (at(h, c.values) - at(-h, c.values)) / (2 * h)
    second = (at(h, c.values) - 2 * at(0, c.values) + at(-h, c.values)) / h**2
    jacobian = at(0, (x for row in c.jacobian for x in row)).reshape(len(c.values), len(q))
    assert np.abs(at(0, c.velocity) - first).max(initial=0.0) <= 1e-5 * size
    assert np.abs(jacobian @ v - first).max(initial=0.0) <= 1e-5 * size
    assert np.abs(jacobian @ a + at(0, c.gamma) - second).max(initial=0.0) <= 1e-4 * size * len(q)


def test_mobility_of_closed_random_mechanisms() -> None:
    for seed in range(6):
        made = random_mechanism(seed, 4, planar=True, loop=True)
        kinematics = analyse(made.mechanism)
        mobility = find_mobility(kinematics)
        assert mobility.residual <= 1e-10
        assert mobility.n_dof == len(kinematics.q) - mobility.rank
        assert len(mobility.independent) == mobility.n_dof
