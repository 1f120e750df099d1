"""Articulated bodies against the other methods, regrouped inertia, and large trees on every target."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mechanisms import Random, random_mechanism
from sweeps import seeds

import eomgen as eg
from eomgen.describe.mechanism import Body
from eomgen.equations import METHODS, recursive
from eomgen.graph import evaluate, vectors
from eomgen.kinematics import Kinematics, analyse


def numbers(expressions: Any, values: dict[str, float]) -> np.ndarray:
    return np.array(evaluate(list(expressions), values), dtype=float)


def state(kinematics: Kinematics, seed: int) -> dict[str, float]:
    random = np.random.default_rng(seed)
    names = [n + s for s in ("", "_dot", "_ddot") for n in kinematics.names]
    return {"t": 0.4} | dict(zip(names, random.uniform(-1, 1, len(names)).tolist(), strict=True))


def close(a: np.ndarray, b: np.ndarray, digits: float) -> None:
    assert np.abs(a - b).max(initial=0.0) <= digits * max(1.0, np.abs(b).max(initial=0.0))


@pytest.mark.parametrize("reverse", [False, True])
@pytest.mark.parametrize("seed", seeds(20, 10))
def test_accelerations_solve_the_equations_of_the_other_methods(seed: int, reverse: bool) -> None:
    """With springs, dampers, a motor and a force in play."""
    kinematics = analyse(random_mechanism(seed, bodies=1 + seed % 6, reverse=reverse).mechanism)
    values = state(kinematics, seed + 7)
    n = len(kinematics.q)
    a = numbers(recursive.derive(kinematics).accelerations, values)
    for method in ("embedding", "lagrange"):
        tree = METHODS[method](kinematics)
        mass = numbers((x for row in tree.mass_matrix for x in row), values).reshape(n, n)
        h = numbers(tree.bias, values)
        assert np.abs(mass @ a + h).max() <= 1e-11 * (np.abs(mass) @ np.abs(a) + np.abs(h)).max()


@pytest.mark.parametrize("seed", seeds(20, 10))
def test_regrouping_changes_nothing(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    made = random_mechanism(seed, bodies=2 + seed % 5, reverse=seed % 2 == 1)
    kinematics = analyse(made.mechanism)
    values = state(kinematics, seed)
    for method in ("embedding", "recursive"):
        with monkeypatch.context() as patch:
            patch.setattr(f"eomgen.equations.{method}.regroup", lambda _, links: [link.spatial for link in links])
            plain = METHODS[method](kinematics)
        grouped = METHODS[method](kinematics)
        held = [kind for kind, parent in zip(made.kinds, made.parents, strict=True) if parent >= 0]
        if {"revolute", "prismatic", "spherical"} & set(held):
            assert plain.inverse_dynamics != grouped.inverse_dynamics
        for part in ("bias", "inverse_dynamics"):
            close(numbers(getattr(grouped, part), values), numbers(getattr(plain, part), values), 1e-13)
        ours, theirs = (numbers((x for row in e.mass_matrix for x in row), values) for e in (grouped, plain))
        assert np.abs(ours - theirs).max() <= 1e-13 * np.abs(theirs).max()


@pytest.mark.parametrize("seed", seeds(10, 6))
def test_first_moments_and_inertia_about_the_origin_are_the_same_body(seed: int) -> None:
    made = random_mechanism(seed, bodies=3, reverse=seed % 2 == 1)
    m = made.mechanism
    bodies = tuple(_by_first_moment(made, k, body) for k, body in enumerate(m.bodies))
    one, other = analyse(m), analyse(replace(m, bodies=bodies))
    values = state(one, seed)
    for method in METHODS:
        a, b = (METHODS[method](kinematics) for kinematics in (one, other))
        close(numbers(a.inverse_dynamics, values), numbers(b.inverse_dynamics, values), 1e-12)
        x, y = (numbers([e.kinetic_energy, e.potential_energy], values) for e in (a, b))
        close(x, y, 1e-12)


def _by_first_moment(made: Random, k: int, body: Body) -> Body:
    mass, c = made.masses[k], made.centers[k]
    origin = made.inertias[k] + mass * (np.eye(3) * (c @ c) - np.outer(c, c))
    graph = made.mechanism.graph
    rows = tuple(vectors.vector(graph, row) for row in origin.tolist())
    return replace(body, moment=vectors.vector(graph, (mass * c).tolist()), inertia_origin=rows)


def branched(n: int) -> eg.Model:
    """A tree too large to be unrolled: a free trunk, chains of hinges, slides and spherical joints on it."""
    m = eg.Model("branched", gravity=(0.2, -0.4, "-g"))
    m.parameter("g", 9.81)
    push = m.input("push", 0.7)
    trunk = m.body("trunk", mass=4.0, com=(0.1, 0, 0.2), inertia=(0.3, 0.5, 0.4))
    m.free("base", m.ground, trunk)
    bodies = [trunk]
    for k in range(n):
        body = m.body(f"b{k}", mass=1 + 0.1 * (k % 5), com=(0.2, 0.01 * k, 0.03), inertia=(0.1, 0.2, 0.25))
        outer = bodies[max(0, k - (3 if k % 4 == 0 else 1)) + (0 if k == 0 else 1) - 1].at(0.4, 0, 0.1 * (k % 3))
        kind = (m.revolute, m.revolute, m.prismatic, m.revolute, m.spherical)[k % 5]
        kind(f"j{k}", outer, body, **({} if k % 5 == 4 else {"axis": "zyx"[k % 3]}))
        bodies.append(body)
    m.torque("motor", "j0", push)
    m.output("tip", f"az(b{n - 1})")
    return m


@pytest.fixture(scope="module")
def modules() -> dict[str, Any]:
    return {
        "embedding": branched(16).derive("embedding").compile(target="numpy"),
        "numpy": branched(16).derive("recursive").compile(target="numpy"),
        "cython": branched(16).derive("recursive").compile(optimize=0),
    }


@pytest.mark.slow
@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_large_trees_answer_every_call_as_embedding_does(modules: dict[str, Any], target: str) -> None:
    one, other = modules[target], modules["embedding"]
    n, random = one.n_v, np.random.default_rng(3)
    assert n > 24
    assert one.metadata["method"] == "recursive"
    for _ in range(3):
        q, v, a = random.uniform(-1, 1, (3, n))
        x, t = np.concatenate([q, v]), 0.3
        for ours, theirs in (
            (one.rhs(t, x), other.rhs(t, x)),
            (one.jacobian(t, x), other.jacobian(t, x)),
            (one.mass_matrix(q), other.mass_matrix(q)),
            (one.embedded_mass_matrix(q), other.embedded_mass_matrix(q)),
            (one.bias(t, x), other.bias(t, x)),
            (one.inverse_dynamics(q, v, a), other.inverse_dynamics(q, v, a)),
            (one.outputs(t, x), other.outputs(t, x)),
            (one.energy(x), other.energy(x)),
        ):
            close(ours, theirs, 1e-10)
        assert np.array_equal(one.mass_matrix(q), one.mass_matrix(q).T)
    states = random.uniform(-1, 1, (2 * n, 4))
    for k, column in enumerate(one.rhs(0.3, states).T):
        close(column, one.rhs(0.3, states[:, k]), 1e-14)


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_motion_without_inertia_is_named(target: str) -> None:
    """Where gimbals align, Euler angles make the mass matrix singular: an error, not a number."""
    m = eg.Model("ball")
    m.spherical("q", m.ground, m.body("b", mass=1.0, com=(0, 0, 1), inertia=(0.1, 0.2, 0.3)))
    module = m.derive("recursive").compile(target=target)
    x = np.array([0.3, np.pi / 2, 0.2, 1.0, 2.0, 3.0])
    with pytest.raises(eg.SingularMassMatrixError):
        module.rhs(0.0, x)
    empty = eg.Model("empty")
    empty.revolute("q", empty.ground, empty.body("b", mass=0))
    kinematic = empty.derive("recursive").compile(target=target)  # nothing has mass: a model of motion alone
    with pytest.raises(eg.SingularMassMatrixError, match=r"kinematics only: .*bodies without mass and inertia: b;"):
        kinematic.rhs(0.0, [0.0, 0.0])
    empty.torque("push", "q", 1)
    with pytest.raises(eg.ModelError, match="no inertia behind it"):
        empty.derive("recursive").compile(target=target)


def test_loops_are_closed_from_mass_matrix_and_bias() -> None:
    model = eg.load(Path(__file__).parents[2] / "examples" / "slider_crank.yaml")
    one, other = (model.derive(method).compile(target="numpy") for method in ("recursive", "embedding"))
    x = other.x0()
    close(one.rhs(0.1, x), other.rhs(0.1, x), 1e-12)
    assert model.derive("recursive").tree.accelerations is None
    assert model.derive().choice.method == "embedding"
