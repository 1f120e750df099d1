"""States at which there are no equations to write are refused by name; those beside them are not."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp

import eomgen as eg
from eomgen.equations import METHODS
from eomgen.errors import NonFiniteError, PartitionError, SingularMassMatrixError

EXAMPLES = Path(__file__).parents[2] / "examples"


def spherical_pendulum(inertia: float | str = 0) -> eg.Model:
    """Azimuth, then the angle from the downward vertical; ``inertia`` of what turns with the azimuth."""
    m = eg.Model("spherical", gravity=(0, 0, "-g"))
    for name, value in {"g": 9.81, "l": 0.5, "m": 2.0, "J": 0.0}.items():
        m.parameter(name, value)
    fork, bob = m.body("fork", mass=0, inertia={"zz": inertia}), m.body("bob", mass="m", com=(0, 0, "-l"))
    m.revolute("azimuth", m.ground, fork, axis="z", coordinate="phi")
    m.revolute("tilt", fork, bob, axis="y", coordinate="theta")
    return m


@pytest.mark.parametrize("method", METHODS)
def test_a_singular_mass_matrix_is_named(method: str) -> None:
    equations = spherical_pendulum().derive(method)
    for at in ({"theta": 0}, {"theta": "0*g"}, {"theta": sp.pi}, {"theta": 0, "phi": 1, "l": 0.5}):
        for equilibrium in (True, False):
            with pytest.raises(SingularMassMatrixError) as raised:
                equations.linearize(at=at, equilibrium=equilibrium)
            said = str(raised.value)
            assert f"mass_matrix (2, 2) has no inverse at theta = {at['theta']}" in said
            assert "moving phi meets no inertia" in said
            assert "linearize at another state" in said
    near = equations.linearize(at={"theta": sp.pi / 6}, equilibrium=True)
    assert not any(x.has(sp.zoo, sp.nan) for x in near.A)


def test_a_parameter_that_is_zero_but_stays_a_symbol_is_no_fault() -> None:
    """J = 0 is declared: in symbols J stays, and the linearization holds wherever it is not 0."""
    A = spherical_pendulum("J").derive().linearize(at={"theta": 0}).A
    g, l = sp.symbols("g l")
    assert sp.simplify(A - sp.Matrix([[0, 0, 1, 0], [0, 0, 0, 1], [0, 0, 0, 0], [0, -g / l, 0, 0]])) == sp.zeros(4, 4)
    with pytest.raises(SingularMassMatrixError, match="theta = 0, J = 0"):
        spherical_pendulum("J").derive().linearize(at={"theta": 0, "J": 0})


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("at", [{"B": "pi/2 - theta"}, {"theta": 0, "B": "pi/2"}])
def test_a_dead_centre_is_named(method: str, at: dict[str, Any]) -> None:
    """The rod stands across the rail; B is its angle against the crank."""
    equations = eg.load(EXAMPLES / "slider_crank.yaml").derive(method)
    with pytest.raises(PartitionError, match="the velocities of theta do not tell the others") as raised:
        equations.linearize(at=at)
    assert "dead centre" in str(raised.value)
    assert "independent=[...]" in str(raised.value)


def test_a_view_at_a_dead_centre_is_refused_where_it_divides_by_zero() -> None:
    view = eg.load(EXAMPLES / "slider_crank.yaml").derive().subs({"theta": 0}).subs({"B": "pi/2"})
    for name in ("mass_matrix", "velocity_transformation"):
        with pytest.raises(NonFiniteError, match=f"{name} has no finite value with theta = 0, then B = pi/2"):
            getattr(view, name)
    assert list(view.constraints) != []  # it needs no division


def test_an_entry_without_a_value_is_named() -> None:
    m = eg.Model("taut")
    block = m.body("block", mass=2)
    m.prismatic("rail", m.ground, block, axis="x", coordinate="s")
    m.spring("k", m.ground, block, stiffness=3, length=0.5)
    equations = m.derive()
    with pytest.raises(NonFiniteError, match="linearize.* no finite value at s = 0"):
        equations.linearize(at={"s": 0})
    near = equations.linearize(at={"s": 1}, equilibrium=True)
    assert list(near.A) == [0, 1, -sp.Rational(3, 2), 0]


def test_states_of_examples_have_a_linearization() -> None:
    """None of these is refused, and all is finite there."""
    for name in ("double_pendulum", "cart_pendulum", "four_bar", "rolling_disc", "governor"):
        if not (file := EXAMPLES / f"{name}.yaml").exists():
            continue
        equations = eg.load(file).derive()
        module: Any = equations.compile("numpy")
        at = dict(zip(module.x_names, map(float, module.x0()), strict=True))
        near = equations.linearize(at=at | dict(zip(module.p_names, map(float, module.p), strict=True)))
        wanted = module.linearize(module.x0())
        known = [*near.A, *near.B]
        for symbol, value in reversed(near.intermediates):
            known = [x.xreplace({symbol: value}) for x in known]
        inputs = {sp.Symbol(n): u for n, u in zip(module.u_names, module.u, strict=True)} | {sp.Symbol("t"): 0}
        found = np.array([float(sp.N(x.xreplace(inputs))) for x in known])
        expected = np.concatenate([wanted.A.ravel(), wanted.B.ravel()])
        np.testing.assert_allclose(found, expected, atol=1e-8 * np.abs(expected).max())
