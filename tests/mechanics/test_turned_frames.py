"""Faults that were reported of turned frames, as they were reported."""

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import eomgen as eg
from eomgen.expr import identity
from eomgen.expr.core import Expr, Graph, substitute


@pytest.mark.parametrize("seed", range(6))
def test_an_equation_that_holds_identically(seed: int) -> None:
    """Out-of-plane coordinate of a planar mechanism: no freedom goes, however frames are turned."""
    rpy = tuple(np.random.default_rng(seed).uniform(-3, 3, 3).tolist()) if seed else (0.0, 0.0, 0.0)
    turn = Rotation.from_euler("xyz", rpy).as_matrix()
    m = eg.Model("planar", gravity=(0, -9.81, 0))
    a, b = (m.body(n, mass=1, inertia=(0.1, 0.1, 0.1)) for n in "ab")
    m.revolute("A", m.ground, a.at(0, 0, 0, rpy=rpy))
    m.revolute("B", a.at(*(turn @ [0.5, 0, 0]).tolist(), rpy=rpy), b)
    b.marker("tip", at=(0.4, 0, 0))
    m.coupling("level", equation="z(b.tip)")
    report = m.check()
    assert (report.degrees_of_freedom, report.rank) == (2, 0)


@pytest.mark.quick
@pytest.mark.parametrize(
    ("factor", "rows"), [("sqrt(p)*sqrt(r)*sqrt(p) - p*sqrt(r)", 0), ("sqrt(p)*sqrt(r) - p", 1), ("sqrt(p) - p", 1)]
)
def test_an_equation_whose_roots_cancel(factor: str, rows: int) -> None:
    """It holds identically only where it does so with either sign of each root."""
    m = eg.Model("arms", gravity=(0, -9.81, 0))
    m.parameter("p", 2.0)
    m.parameter("r", 3.0)
    a, b = (m.body(n, mass=1, inertia=(0.1, 0.1, 0.1)) for n in "ab")
    m.revolute("A", m.ground, a)
    m.revolute("B", a.at(0.5, 0, 0), b)
    b.marker("tip", at=(0.4, 0, 0))
    m.coupling("level", equation=f"({factor})*(x(b.tip) - 0.3)")
    report = m.check()
    assert (report.constraints, report.rank, report.degrees_of_freedom) == (rows, rows, 2 - rows)


def test_signs_of_roots_are_put_in_for_all_expressions_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Chained expressions with the same four roots take one pass a root; those that do not vanish as written, none."""
    graph = Graph()
    x, *squares = (graph.symbol(name) for name in "xabcd")
    first, *others = roots = [graph.apply("sqrt", 1.0 + y) for y in squares]
    total = sum(others, first)
    for zero, passes in (((x + 1.0) * (x - 1.0) - x * x + 1.0, len(roots)), (x, 0)):
        chain = [zero * total]
        for _ in range(20):
            chain.append(chain[-1] * x + zero * total)
        calls: list[int] = []

        def counted(*given: Any, calls: list[int] = calls) -> list[Expr]:
            calls.append(1)
            return substitute(*given)

        monkeypatch.setattr(identity, "substitute", counted)
        assert identity.vanishes(chain) == [passes > 0] * len(chain)
        assert len(calls) == passes


@pytest.mark.quick
def test_angular_velocity_of_bodies_without_mass() -> None:
    """It needs no mass: w = theta' e_z, alpha = theta'' e_z."""
    m = eg.Model("massless")
    arm = m.body("arm", mass=0)
    m.revolute("A", m.ground, arm, coordinate="theta")
    m.driver("drive", coordinate="theta", value="0.3 + 2*t + t**2")
    m.output("w", "wz(arm)")
    m.output("alpha", "wz_dot(arm)")
    mod = m.compile(target="numpy")
    np.testing.assert_allclose(mod.outputs(0.0, mod.x0()), [2.0, 2.0], rtol=1e-14)


def test_a_turn_may_have_no_value_at_some_parameters() -> None:
    """asin(10 h/l) is a number at the declared values, not at all values that a random point may have."""
    m = eg.Model("links", gravity=(0, -9.81, 0))
    m.parameter("h", 0.01)
    l = m.parameter("l", 0.5)
    links = [m.body(f"b{k}", mass=1.0, com=(l / 2, 0, 0), inertia={"zz": 0.02}) for k in range(3)]
    turn = (0, 0, "asin(10*h/l)")
    m.revolute("A", m.ground, links[0])
    m.revolute("B", links[0].at(l, 0, 0, rpy=turn), links[1])
    m.revolute("C", links[1].at(l, 0, 0, rpy=turn), links[2])
    m.revolute("D", links[2].at(l, 0, 0), m.ground.at(0.6, 0, 0))
    assert m.derive().report.degrees_of_freedom == 1
