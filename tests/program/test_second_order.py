"""Hessians times directions: against SymPy to 25 digits, differences in 50 digits, and both ways against each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy
from many_digits import drawn, in_digits
from mechanisms import random_mechanism
from sympy import cos, sin, symbols

import eomgen as eg
from eomgen import pipeline
from eomgen.equations import METHODS
from eomgen.graph import evaluate
from eomgen.graph.core import Expr
from eomgen.graph.differentiate import jacobian
from eomgen.kinematics import analyse
from eomgen.kinematics.mobility import find_mobility
from eomgen.program.collect import collect_terms
from eomgen.program.factor import factorize, solve
from eomgen.program.second_order import TreeHessian, hessian_product
from eomgen.program.terms import SystemTerms

KERNELS = ["inverse_dynamics_hessian_product", "rhs_hessian_product"]


def double_pendulum() -> eg.Model:
    m = eg.Model("double_pendulum", gravity=(0, "-g", 0))
    m.parameter("g", 9.81)
    m1, m2, l1, l2, j = (m.parameter(*one) for one in (("m1", 1.5), ("m2", 0.7), ("l1", 0.6), ("l2", 0.4), ("J", 0.05)))
    m.input("tau")
    upper = m.body("upper", mass=m1, com=(0, -l1, 0))
    lower = m.body("lower", mass=m2, com=(0, -l2, 0), inertia={"zz": j})
    hinge = m.revolute("shoulder", m.ground, upper, coordinate="a")
    m.revolute("elbow", upper.at(0, -l1, 0), lower, coordinate="b")
    m.actuator("motor", joint=hinge, value="tau*cos(b)")
    return m


class Textbook:
    """The double pendulum by Lagrange's equations of SymPy, b relative to the upper rod."""

    def __init__(self) -> None:
        t = sympy.Symbol("t")
        self.q = symbols("a b")
        self.v = symbols("a_dot b_dot")
        self.acc = symbols("a_ddot b_ddot")
        self.u = symbols("tau")
        g, m1, m2, l1, l2, J = symbols("g m1 m2 l1 l2 J")
        (a, b), (va, vb) = self.q, self.v
        x = sympy.Matrix([l1 * sin(a) + l2 * sin(a + b), -l1 * cos(a) - l2 * cos(a + b)])
        speed = x.jacobian(self.q) * sympy.Matrix(self.v)
        T = m1 * l1**2 * va**2 / 2 + m2 * speed.dot(speed) / 2 + J * (va + vb) ** 2 / 2
        V = -m1 * g * l1 * cos(a) + m2 * g * x[1]
        L, forces = T - V, (self.u * cos(b), 0)
        self.tau = []
        for q, v, force in zip(self.q, self.v, forces, strict=True):
            p = sympy.diff(L, v)
            rate = sum(sympy.diff(p, s) * w for s, w in zip((*self.q, *self.v), (*self.v, *self.acc), strict=True))
            self.tau.append(rate - sympy.diff(L, q) - force)
        M = sympy.Matrix(self.tau).jacobian(self.acc)
        rest = sympy.Matrix(self.tau).subs(dict.fromkeys(self.acc, 0))
        self.rates = [*self.v, *(-(M.adjugate() * rest) / M.det())]
        assert t not in M.free_symbols

    def product(
        self, rows: Sequence[Any], z: Sequence[Any], w: Sequence[Any], d: Sequence[Any], at: Mapping[str, Any]
    ) -> list[Any]:
        """At numbers of mpmath, at its current precision."""
        scalar = sum(a * b for a, b in zip(symbols(f"w:{len(w)}"), rows, strict=True))
        gradient = [sympy.diff(scalar, x) for x in z]
        every = [sum(sympy.diff(g, x) * s for x, s in zip(z, symbols(f"d:{len(d)}"), strict=True)) for g in gradient]
        known = sorted(sympy.Matrix(every).free_symbols, key=str)
        given = at | {f"w{k}": x for k, x in enumerate(w)} | {f"d{k}": x for k, x in enumerate(d)}
        return sympy.lambdify(known, every, "mpmath", cse=True)(*(given[x.name] for x in known))


@pytest.mark.parametrize("method", ["embedding", "recursive", "lagrange"])
def test_the_double_pendulum_is_that_of_sympy_to_25_digits(method: str) -> None:
    book = Textbook()
    blocks = {b.name: b for b in pipeline.build(double_pendulum().derive(method), "c", KERNELS).blocks}
    with mpmath.workdps(40):
        for name, rows, z in (
            (KERNELS[0], book.tau, (*book.q, *book.v, *book.acc)),
            (KERNELS[1], book.rates, (*book.q, *book.v, book.u)),
        ):
            block = blocks[name]
            given = drawn([*block.inputs, "g", "m1", "m2", "l1", "l2", "J", "tau"], seed=4)
            given |= {"m1": mpmath.mpf("1.5"), "m2": mpmath.mpf("0.7"), "J": mpmath.mpf("0.3")}
            found = in_digits(block.outputs, given)
            w, d = ([given[s] for port in block.ports if port.name in kinds for s in port.symbols]
                    for kinds in (("weights", "rate_weights"), ("dq", "dv", "da", "du")))  # fmt: skip
            expected = book.product(rows, z, w, d, given)
            for mine, theirs in zip(found, expected, strict=True):
                assert abs(mine - theirs) <= mpmath.mpf(10) ** -25 * max(1, abs(theirs))


def random_terms(seed: int, method: str) -> SystemTerms:
    made = random_mechanism(seed, bodies=1 + seed % 4, forces=seed % 2 == 0)
    kinematics = analyse(made.mechanism)
    return collect_terms(kinematics, find_mobility(kinematics), METHODS[method](kinematics))


@pytest.mark.parametrize("method", ["embedding", "recursive"])
@pytest.mark.parametrize("seed", range(8))
def test_products_are_differences_in_fifty_digits(seed: int, method: str) -> None:
    """J(z + e d)^T w, differenced at e = 1e-18 with 50 digits; the product is read in double precision."""
    terms = random_terms(seed, method)
    graph = terms.graph
    names = (*terms.q, *terms.v, *terms.a)
    z = [graph.symbol(name) for name in names]
    w, d = ([graph.symbol(f"{what}{k}") for k in range(n)] for what, n in (("w", terms.n_v), ("d", len(z))))
    product = hessian_product(terms.inverse_dynamics, w, z, d)
    slopes = jacobian(list(terms.inverse_dynamics), z)
    step = mpmath.mpf(10) ** -18
    with mpmath.workdps(50):
        given = drawn([*names, *(x.node[1] for x in (*w, *d)), *terms.u, *terms.p, "t"], seed)
        found = evaluate(product, {name: float(value) for name, value in given.items()})

        def gradient(sign: int) -> list[Any]:
            at = given | {name: given[name] + sign * step * given[x.node[1]] for name, x in zip(names, d, strict=True)}
            values = dict(zip(slopes, in_digits(list(slopes.values()), at), strict=True))
            weights = [given[x.node[1]] for x in w]
            return [sum(values.get((i, k), 0) * weights[i] for i in range(terms.n_v)) for k in range(len(z))]

        expected = [float((a - b) / (2 * step)) for a, b in zip(gradient(1), gradient(-1), strict=True)]
    size = np.abs(expected).max(initial=1.0)
    assert np.abs(np.array(found, dtype=float) - expected).max() <= 1e-12 * size


@pytest.mark.parametrize("seed", range(8))
def test_both_ways_to_differentiate_accelerations_twice_agree(seed: int) -> None:
    terms = random_terms(seed, "embedding")
    graph, n_x = terms.graph, len(terms.q) + terms.n_v
    factor = factorize(terms.mass_matrix, terms.parent)
    accelerations = solve(factor, [-h for h in terms.bias])
    z = (*terms.q, *terms.v, *terms.u)
    w, d, e = ([graph.symbol(f"{what}{k}") for k in range(n)] for what, n in (("w", n_x), ("d", len(z)), ("e", len(z))))
    random = np.random.default_rng(seed)
    values = {x.node[1]: random.uniform(-1, 1) for x in (*w, *d, *e)}
    values |= {name: random.uniform(-1, 1) for name in (*z, *terms.p, terms.t)}

    def both(direction: Sequence[Expr]) -> list[np.ndarray]:
        tree = TreeHessian(terms, accelerations, w, direction)
        return [
            np.array(evaluate(tree.by_accelerations(), values), dtype=float),
            np.array(evaluate(tree.by_inverse_dynamics(), values), dtype=float),
        ]

    one, other = both(d)
    size = np.abs(one).max(initial=1.0)
    assert np.abs(one - other).max() <= 1e-10 * size
    crosswise, along = both(e)[0], [np.array([values[x.node[1]] for x in each]) for each in (d, e)]
    assert abs(along[1] @ one - along[0] @ crosswise) <= 1e-10 * size  # a Hessian is symmetric
