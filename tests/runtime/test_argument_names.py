"""p and parameters, u and inputs are the same arguments of every call, as arrays, by name, as numbers or as text."""

from __future__ import annotations

from typing import Any

import models
import numpy as np
import pytest

import eomgen as eg
from eomgen.errors import UsageError

TIMED = ("rhs", "jacobian", "bias", "outputs", "input_jacobian", "parameter_jacobian", "reactions", "multipliers")
OF_STATE = ("energy", "project", "velocity_constraints", "momentum")
OF_POSITION = (
    "mass_matrix", "embedded_mass_matrix", "poses", "constraints", "constraint_jacobian", "center_of_mass",
    "com_jacobian", "centroidal_inertia",
)  # fmt: skip
OF_MOTION = ("inverse_dynamics", "inverse_dynamics_derivatives")
CALLS = (*TIMED, *OF_STATE, *OF_POSITION, *OF_MOTION)


@pytest.fixture(scope="module", params=["cython", "numpy"])
def module(request: pytest.FixtureRequest) -> eg.Module:
    return models.build("slider_crank").compile(target=request.param)


def arguments(module: eg.Module, name: str, x: Any) -> tuple[Any, ...]:
    q, v = x[: module.n_q], x[module.n_q :]
    return (0.3, x) if name in TIMED else (x,) if name in OF_STATE else (q,) if name in OF_POSITION else (q, v, 0.5 * v)


@pytest.mark.parametrize("name", CALLS)
def test_a_call_takes_values_by_name_under_either_name(module: eg.Module, name: str) -> None:
    p, u = {"m_r": 1.7, "g": "9.81 - 0.2"}, {"tau": "2*0.3"}
    bound = module.bind(p={"m_r": 1.7, "g": 9.61}, u=[0.6])
    given = arguments(module, name, bound.x0({"theta": 0.4, "theta_dot": 1.0}))
    call, wanted = getattr(module, name), getattr(bound, name)(*given)
    for words in ({"p": p, "u": u}, {"parameters": p, "inputs": u}, {"parameters": bound.p, "inputs": bound.u}):
        for found, one in zip(call(*given, **words), wanted, strict=True):
            np.testing.assert_allclose(found, one, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("name", CALLS)
def test_what_is_given_twice_or_not_known_is_refused(module: eg.Module, name: str) -> None:
    given, call = arguments(module, name, module.x0()), getattr(module, name)
    with pytest.raises(UsageError, match="p and parameters are the same argument; give one of them"):
        call(*given, p={"m_r": 1.0}, parameters={"m_r": 1.0})
    with pytest.raises(UsageError, match="p and parameters are the same argument; give one of them"):
        call(*given, *([0.0] if name == "project" else []), module.p, parameters={"m_r": 1.0})  # its second is t
    with pytest.raises(UsageError, match="u and inputs are the same argument; give one of them"):
        call(*given, u=[0.0], inputs={"tau": 0.0})
    with pytest.raises(UsageError, match=r"m_x.*(m_r|parameter)"):
        call(*given, p={"m_x": 1.0})
    with pytest.raises(UsageError, match="tau"):
        call(*given, inputs={"tau": "fast"})


def test_what_is_not_named_stays_as_bound(module: eg.Module) -> None:
    bound = module.bind(p={"m_r": 1.7})
    x = bound.x0({"theta": 0.4, "theta_dot": 1.0})
    both = module.bind(p={"m_r": 1.7, "g": 3.0})
    np.testing.assert_array_equal(bound.rhs(0.0, x, p={"g": 3.0}), both.rhs(0.0, x))


def test_steps_take_inputs_by_name() -> None:
    module = models.build("slider_crank").compile()
    x = module.x0({"theta": 0.4})
    step = module.bind(u=[0.6]).step(0.0, x, 1e-3)
    np.testing.assert_array_equal(module.step(0.0, x, 1e-3, u={"tau": "2*0.3"}), step)
    np.testing.assert_array_equal(module.step(0.0, x, 1e-3, inputs={"tau": 0.6}), step)
    advance = module.integrator()
    there = advance(0.0, x, 0.1, p=module.p, u=[0.6]).copy()
    np.testing.assert_array_equal(advance(0.0, x, 0.1, parameters={}, inputs={"tau": 0.6}), there)


def test_tolerances_and_steps_may_be_text(module: eg.Module) -> None:
    given = {"rtol": "1e-6", "atol": "2e-8/2", "max_step": "1/50", "first_step": "1e-4"}
    text = module.simulate("0.2", initial={"theta": "pi/6"}, **given)  # type: ignore[arg-type]
    numbers = module.simulate(0.2, initial={"theta": np.pi / 6}, rtol=1e-6, atol=1e-8, max_step=0.02, first_step=1e-4)
    np.testing.assert_array_equal(text.x, numbers.x)
    with pytest.raises(UsageError, match="rtol must be a number, not 'small'"):
        module.simulate(0.1, rtol="small")  # type: ignore[arg-type]
