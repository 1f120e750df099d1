"""Hessians of right-hand sides with loops: against a projection and multipliers written here, in 50 digits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
from many_digits import drawn, in_digits
from models import build

import eomgen as eg
from eomgen import pipeline
from eomgen.program.collect import collect_terms
from eomgen.program.terms import SystemTerms

KERNEL = "rhs_hessian_product"
Vector = Any  #: a column of mpmath


def ball_loop() -> eg.Model:
    """Two bars on ball joints with Euler parameters, held by a rod of given length, a spring and an input."""
    m = eg.Model("ball_loop", gravity=(0.5, -1.0, -9.81))
    force, length = m.input("pull", 0.4), m.parameter("length", 0.9)
    one = m.body("one", mass=1.2, com=(0.1, 0, 0.02), inertia=[[0.01, 0.001, 0], [0.001, 0.02, 0], [0, 0, 0.022]])
    two = m.body("two", mass=0.7, com=(0.3, 0.01, 0), inertia=(0.002, 0.03, 0.031))
    m.spherical("A", m.ground.at(0, 0, 0, rpy=(0.3, -0.2, 0.5)), one, rotation="euler_parameters")
    m.revolute("B", one.at(0.3, 0, 0), two, axis=(0, "0.6", "0.8"), coordinate="b")
    m.distance("held", m.ground.at(0.2, 0.7, 0.1), two.at(0.5, 0, 0), length=length)
    m.force("pull", two.at(0.2, 0.1, 0), (0, force, 0))
    return m


def moved_bar() -> eg.Model:
    """A bar whose end a driver leads along, with a spring: constraints of t."""
    m = eg.Model("moved_bar", gravity=(0, -9.81, 0))
    cart, bar = m.body("cart", mass=1.0), m.body("bar", mass=0.5, com=(0.2, 0, 0), inertia={"zz": 0.01})
    m.prismatic("x", m.ground, cart, axis="x", coordinate="x")
    m.revolute("hinge", cart, bar, coordinate="a")
    m.driver("lead", "x", "0.2*sin(3*t)")
    return m


MODELS: dict[str, Any] = {
    "four_bar": lambda: build("four_bar"),
    "spatial_four_bar": lambda: build("spatial_four_bar"),
    "spatial_slider_crank": lambda: build("spatial_slider_crank"),
    "rolling_disc": lambda: build("rolling_disc"),
    "ball_loop": ball_loop,
    "moved_bar": moved_bar,
}


class Judge:
    """The right-hand side with its projection, in many digits: Newton's steps of least norm, then multipliers."""

    def __init__(self, terms: SystemTerms, given: Mapping[str, Any]) -> None:
        self.terms, self.given = terms, dict(given)
        self.s = in_digits(terms.coordinate_scales, self.given)

    def at(self, exprs: Sequence[Any], **symbols: Any) -> list[Any]:
        known = dict(self.given)
        for what, values in symbols.items():
            known |= zip(getattr(self.terms, what), values, strict=True)
        return in_digits(list(exprs), known) if exprs else []

    def rows(self, q: Sequence[Any], count: int) -> Any:
        n = self.terms.n_v
        flat = self.at([x for row in self.terms.constraint_jacobian[:count] for x in row], q=q)
        return mpmath.matrix(count, n) if not flat else mpmath.matrix([flat[i * n : i * n + n] for i in range(count)])

    def step(self, J: Any, e: Any) -> list[Any]:
        """The x of least scaled norm with J x = e."""
        scaled = J * mpmath.diag(self.s)
        return list(mpmath.diag(self.s) * (scaled.T * mpmath.lu_solve(scaled * scaled.T, e)))

    def move(self, q: Sequence[Any], d: Sequence[Any]) -> list[Any]:
        """q moved by d; Euler parameters are turned by w as quaternions, ground axes or body axes as q' = N w says."""
        turned = {k for i, _ in self.terms.quaternion_slots for k in range(i, i + 4)}
        rates = self.at(self.terms.rates or [self.terms.graph.symbol(v) for v in self.terms.v], q=q, v=d)[: len(q)]
        moved = [x if k in turned else x + y for k, (x, y) in enumerate(zip(q, rates, strict=True))]
        for i, j in self.terms.quaternion_slots:
            half = mpmath.sqrt(sum(x * x for x in d[j : j + 3])) / 2
            for k in range(i, i + 4):
                moved[k] = mpmath.cos(half) * q[k] + (mpmath.sin(half) / half if half else 1) * rates[k]
        return moved

    def project(self, q: Sequence[Any]) -> list[Any]:
        n_h = len(self.terms.constraints)
        for _ in range(12 if n_h else 0):
            e = mpmath.matrix(self.at(self.terms.constraints, q=q))
            q = self.move(q, [-x for x in self.step(self.rows(q, n_h), e)])
        return list(q)

    def velocities(self, q: Sequence[Any], v: Sequence[Any]) -> list[Any]:
        left = mpmath.matrix(self.at(self.terms.velocity_constraints, q=q, v=v))
        return [x - y for x, y in zip(v, self.step(self.rows(q, self.terms.n_c), left), strict=True)]

    def rates(self, x: Sequence[Any], u: Sequence[Any]) -> list[Any]:
        """[q'; v'] at a state that need not be on the constraints."""
        terms, n, m = self.terms, self.terms.n_v, self.terms.n_c
        q = self.project(x[: len(terms.q)])
        v = self.velocities(q, x[len(terms.q) :])
        still = dict.fromkeys(terms.a, mpmath.mpf(0))
        self.given |= still
        h = self.at(terms.inverse_dynamics, q=q, v=v, u=u)
        system, C_q = mpmath.matrix(n + m, n + m), self.rows(q, m)
        for k in range(n):
            self.given |= still | {terms.a[k]: mpmath.mpf(1)}
            column = self.at(terms.inverse_dynamics, q=q, v=v, u=u)
            for i, (with_one, without) in enumerate(zip(column, h, strict=True)):
                system[i, k] = with_one - without
        for i in range(m):
            for k in range(n):
                system[n + i, k] = system[k, n + i] = C_q[i, k]
        gamma = self.at(terms.gamma, q=q, v=v)
        found = list(mpmath.lu_solve(system, mpmath.matrix([-x for x in (*h, *gamma)])))[:n]
        return [*self.at(terms.rates or [terms.graph.symbol(y) for y in terms.v], q=q, v=v)[: len(q)], *found]


@pytest.mark.parametrize("method", ["embedding", "recursive"])
@pytest.mark.parametrize("name", MODELS)
def test_products_are_second_differences_in_fifty_digits(name: str, method: str) -> None:
    """Also in directions that leave the constraints, and of inputs."""
    equations = MODELS[name]().derive(method)
    module = equations.compile(target="numpy", kernels=["rhs", "project"])
    block = next(b for b in pipeline.build(equations, "c", [KERNEL]).blocks if b.name == KERNEL)
    terms = collect_terms(*equations.fresh())
    n_q, n_x = len(terms.q), len(terms.q) + terms.n_v
    t = 0.3
    x0 = module.project(module.x0() + 0.02 * np.random.default_rng(1).uniform(-1, 1, n_x), t)
    step = mpmath.mpf(10) ** -10
    with mpmath.workdps(50):
        given = {p: mpmath.mpf(float(value)) for p, value in zip(terms.p, module.p, strict=True)}
        given[terms.t] = mpmath.mpf(t)
        judge = Judge(terms, given)
        w, d, e = (list(drawn([f"x{k}" for k in range(n)], seed).values())
                   for seed, n in ((2, n_x), (3, n_x + len(terms.u)), (4, n_x + len(terms.u))))  # fmt: skip
        x, u = [mpmath.mpf(float(value)) for value in x0], [mpmath.mpf("0.4") for _ in terms.u]
        q = judge.project(x[:n_q])
        z = [*q, *judge.velocities(q, x[n_q:]), *u]

        def weighed(a: int, b: int) -> Any:
            at = [x + step * (a * y + b * s) for x, y, s in zip(z, d, e, strict=True)]
            return sum(x * y for x, y in zip(w, judge.rates(at[:n_x], at[n_x:]), strict=True))

        expected = (weighed(1, 1) - weighed(1, -1) - weighed(-1, 1) + weighed(-1, -1)) / (4 * step * step)
        inputs = dict(zip(block.inputs, [*z[:n_x], *w, *d], strict=True)) | dict(zip(terms.u, u, strict=True))
        product = in_digits(block.outputs, given | inputs)
        found = sum(x * y for x, y in zip(product, e, strict=True))
        size = max(abs(x) for x in product)
        assert size > 0.1
        assert abs(found - expected) <= mpmath.mpf(10) ** -10 * size


@pytest.mark.parametrize(("name", "most"), [("slider_crank", 1885), ("four_bar", 2273), ("andrews_squeezer", 7740)])
def test_products_take_the_operations_that_the_documents_say(name: str, most: int) -> None:
    program = pipeline.build(build(name).derive(), "c", [KERNEL])
    assert program.counts[KERNEL].total <= most
    page = (Path(__file__).parents[2] / "docs/operations.md").read_text(encoding="utf-8")
    assert f"| {program.counts[KERNEL].total:,} |" in page
