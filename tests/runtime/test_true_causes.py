"""Errors of kernels name what is wrong: no singular matrix or rounding where a law, a mass or an input is the cause."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import eomgen as eg
from eomgen.errors import NonFiniteError


def four_bar() -> eg.Model:
    m = eg.Model("four_bar")
    for name, value in (("w", 4.0), ("k", 1.0)):
        m.parameter(name, value)
    m.input("tau")
    a, b, c = (m.body(name, mass="sqrt(w)", inertia={"zz": "0.001*sqrt(w)"}) for name in ("crank", "coupler", "rocker"))
    m.revolute("A", m.ground, a, coordinate="theta")
    m.revolute("B", a.at(0.04, 0, 0), b, coordinate="bend")
    m.revolute("C", b.at(0.12, 0, 0), c.at(0.08, 0, 0))
    m.revolute("D", m.ground.at(0.1, 0, 0), c, coordinate="psi")
    m.torque("motor", "A", "tau")
    m.torque("law", "D", "-sqrt(k + psi)")
    m.guess(theta=1.0, bend=-0.7, psi=1.1)
    m.initial(theta=1.0)
    return m


@pytest.fixture(scope="module", params=[("auto", "numpy"), ("augmented", "numpy"), ("augmented", "cython")], ids=str)
def module(request: Any) -> Any:
    method, target = request.param
    return four_bar().compile(method=method, target=target)


CASES = [
    # parameters, added to x, inputs, error, words
    ({"k": -9.0}, 0.0, [0.0], eg.NonFiniteError, "the loads of law are not"),
    ({"w": 0.0}, 0.0, [0.0], eg.SingularMassMatrixError, "moving theta meets no inertia"),
    ({}, 1e200, [0.0], eg.NonFiniteError, "squares of theta, bend, psi, theta_dot, bend_dot, psi_dot overflow"),
    ({}, 0.0, [np.nan], eg.NonFiniteError, "look for an input that is not a number"),
    ({}, np.nan, [0.0], eg.NonFiniteError, "already are not; check the state"),
]


@pytest.mark.parametrize(("p", "added", "u", "error", "words"), CASES, ids=str)
def test_the_cause_is_named(module: Any, p: Any, added: float, u: Any, error: type[Exception], words: str) -> None:
    x = module.x0() + np.array([added] * module.n_x)
    if added == 1e200:
        x = np.where(np.arange(module.n_x) < 3, module.x0(), x)
        words = "squares of theta_dot, bend_dot, psi_dot overflow"
    with pytest.raises(error, match=words):
        module.bind(p=p).rhs(0.0, x, u=u)


def test_a_mass_that_is_no_number_is_named(module: Any) -> None:
    """NumPy's text is refused when it is bound, with the parameter; C when it is called."""
    with pytest.raises(eg.EomgenError, match=r"with w = -1 .*look for a mass|the mass matrix is not \(a mass"):
        module.bind(p={"w": -1.0}).rhs(0.0, module.x0())


def test_a_tree_without_mass_is_told_by_its_parameter() -> None:
    m = eg.Model("tree")
    m.parameter("m_b", 1.0)
    m.revolute("A", m.ground, m.body("b", mass="m_b", com=(1, 0, 0)))
    for target in ("numpy", "cython"):
        module = m.compile(target=target)
        with pytest.raises(eg.EomgenError, match="m_b is the mass of body 'b'|moving A meets no inertia"):
            module.bind(p={"m_b": 0.0}).rhs(0.0, [0.0, 0.0])


def test_momenta_at_a_singularity_of_angles_name_the_angles() -> None:
    m = eg.Model("ball", gravity=(0, 0, -9.81))
    m.spherical("s", m.ground, m.body("b", mass=1, com=(0, 0, 1), inertia=(0.1, 0.1, 0.1)))
    canonical = m.compile(method="hamilton", target="numpy").canonical
    z = np.array([0.1, np.pi / 2, 0.2, 0, 0, 0])
    with pytest.raises(eg.EvaluationError, match="the Euler angles of joint 's' are singular here"):
        canonical.expand(z)


def test_an_equation_that_closes_and_is_no_number_is_no_rope() -> None:
    m = eg.Model("roots")
    for name in "ab":
        m.revolute(f"q{name}", m.ground, m.body(name, mass=1, inertia={"zz": 0.2}))
    m.coupling("c", equation="qa_dot*sqrt(qa) - qb_dot", closes="t - 9", closed=True)
    m.initial(qa=0.3)
    with pytest.raises(NonFiniteError, match=r"the equations of c are not \(outside their domain") as error:
        m.compile(target="numpy").rhs(0.0, [-1.0, 0.2, 1.0, 1.0, 1.0])
    assert "cylinder" not in str(error.value)
