"""Equilibria of models with nonholonomic rows A(q) v + b(q) = 0, which rest where b vanishes too."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import eomgen as eg


def maxwell(
    method: str = "auto",
    force: str = "F",
    flow: str = "s_dot - 15*(x1 - s)",
    unit: float = 1.0,
    target: str = "cython",
) -> Any:
    """A mass on a spring beside a spring and a damper in series, whose inner length s follows s' = 15 (x1 - s)."""
    m = eg.Model("maxwell")
    m.parameter("F", 0.0)
    m.prismatic("X", m.ground, m.body("b", mass=1), axis="x", coordinate="x1")
    m.prismatic("S", m.ground, m.body("dummy", mass=1), axis="x", coordinate="s")
    m.actuator("springs", "X", f"{force}*{unit} - 10*x1 - 30*(x1 - s)")
    m.coupling("flow", equation=flow)
    m.initial(x1=0.3 * unit, s=0.1 * unit)
    return m.compile(method=method, target=target, **({"optimize": 0} if target == "cython" else {}))


@pytest.mark.parametrize("method", ["embedding", "lagrange", "augmented"])
def test_the_inner_length_of_a_maxwell_element_comes_to_rest_too(method: str) -> None:
    """10 x1 = F and s = x1; d'Alembert: the multiplier of the row acts on s alone."""
    mod = maxwell(method, target="numpy")
    for F in (0.0, 7.0):
        found = mod.equilibrium(p={"F": F})
        np.testing.assert_allclose(found.x, [F / 10, F / 10, 0, 0], atol=1e-13)
        linear = found.linear
        assert linear.is_equilibrium
        np.testing.assert_allclose(linear.drift, 0, atol=1e-13)
        # s' = 15 (x1 - s), x1'' = -40 x1 + 30 s: l^3 + 15 l^2 + 40 l + 150 = 0
        np.testing.assert_allclose(
            np.sort_complex(found.eigenvalues), np.sort_complex(np.roots([1, 15, 40, 150])), rtol=1e-12
        )
        assert found.stability == "asymptotically stable"
        run = found.module.simulate(5, initial=found.x)
        np.testing.assert_allclose(run["x1"], F / 10, atol=1e-9)
        np.testing.assert_allclose(run["s"], F / 10, atol=1e-9)


def test_millimetres_and_names_do_not_matter() -> None:
    found = maxwell(force="7", unit=1000.0).equilibrium()
    np.testing.assert_allclose(found.x, [700, 700, 0, 0], atol=1e-9)
    assert found.stability == "asymptotically stable"


def test_held_and_solved_for() -> None:
    mod = maxwell(target="numpy")
    held = mod.equilibrium(hold={"x1": 0.4})
    assert held["s"] == pytest.approx(0.4, abs=1e-10)
    assert held.supports == {"x1": pytest.approx(4.0, rel=1e-9)}
    solved = mod.equilibrium(hold={"x1": 0.4}, unknowns=["F"])
    assert solved["F"] == pytest.approx(4.0, rel=1e-10)
    assert solved["s"] == pytest.approx(0.4, abs=1e-10)
    inner = mod.equilibrium(hold={"s": 0.4}, unknowns=["F"])
    assert (inner["x1"], inner["F"]) == (pytest.approx(0.4), pytest.approx(4.0))


def test_an_unstable_rest_is_told_from_the_right_eigenvalues() -> None:
    """s' = 3 s + x1 grows; x1 rests at 0 only with s."""
    found = maxwell(flow="s_dot - 3*s - x1").equilibrium()
    np.testing.assert_allclose(found.x, 0, atol=1e-13)
    assert found.stability == "unstable"
    expected = np.roots([1, -3, 40, -120 - 30])
    np.testing.assert_allclose(np.sort_complex(found.eigenvalues), np.sort_complex(expected), rtol=1e-10)


def test_a_row_that_never_rests_is_refused() -> None:
    mod = maxwell(flow="s_dot - 3 - x1**2")
    with pytest.raises(eg.EquilibriumError, match="nonholonomic constraints move s at a rate of 3"):
        mod.equilibrium()


def test_a_row_of_time_rests_when_its_time_has_come() -> None:
    """s' = x1 - s - t: at t = 2 the rest is x1 = F/10 + 0.1 (30 (s - x1)) with s = x1 - 2."""
    found = maxwell(flow="s_dot - (x1 - s - t)").equilibrium(t=2.0)
    assert found["x1"] == pytest.approx(-6.0, rel=1e-12)
    assert found["s"] == pytest.approx(-8.0, rel=1e-12)
