"""Rarer kernels, made when first called: the same numbers as in a module that has them from the beginning."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import eomgen as eg
from eomgen.errors import UsageError

EXAMPLE = Path(__file__).parents[2] / "examples" / "slider_crank.yaml"


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_a_rare_kernel_is_made_when_first_called(target: str) -> None:
    equations = eg.load(EXAMPLE).derive()
    module = equations.compile(target=target)
    core = module.core
    assert "centroidal" in core.names
    assert "centroidal" not in core.core.names
    x = module.x0()
    module.rhs(0.0, x)
    assert core.further == {}
    longer = module.bind({"r": 0.2})
    q = x[: module.n_q]
    centre, other = module.center_of_mass(q), longer.center_of_mass(q)
    (made,) = core.further.values()
    assert "centroidal" in made.names
    assert "inverse_dynamics_derivatives" in core.names  # made apart, when it is called
    assert "inverse_dynamics_derivatives" not in made.names
    assert made is not core.core
    assert longer.core is core
    everything = equations.compile(target=target, kernels=["centroidal", "rhs"])
    assert "centroidal" in everything.core.names
    np.testing.assert_array_equal(centre, everything.center_of_mass(q))
    np.testing.assert_array_equal(other, everything.bind({"r": 0.2}).center_of_mass(q))
    assert np.abs(other - centre).max() > 1e-3
    with pytest.raises(UsageError, match="q must have shape"):
        module.center_of_mass(q[:1])


def test_plain_solve_ivp_takes_the_compiled_stepper() -> None:
    module = eg.load(EXAMPLE).compile()
    x = module.x0()
    solver = module.DOP853(module.rhs, 0.0, x, 1.0)
    assert type(solver) is module.DOP853
    assert type(solver) is module.bind({"r": 0.2}).DOP853
    ours = solve_ivp(module.rhs, (0.0, 0.5), x, method=module.DOP853, rtol=1e-9)
    theirs = solve_ivp(module.rhs, (0.0, 0.5), x, method="DOP853", rtol=1e-9)
    np.testing.assert_allclose(ours.t, theirs.t, rtol=1e-6)
