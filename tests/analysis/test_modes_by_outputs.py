"""Modes at a state that outputs name; analyses that first-order states rule out say so."""

from __future__ import annotations

import numpy as np
import pytest

import eomgen as eg
from eomgen.cli.verb_run import sort_settings
from eomgen.errors import UnavailableError, UsageError


def test_modes_take_outputs_as_x0_does() -> None:
    module = eg.load_example("double_pendulum").compile(target="numpy")
    by_output = module.modes({"theta1": 0, "theta2": 0}).frequencies  # theta2 = theta1 + bend
    np.testing.assert_allclose(by_output, module.modes({"theta1": 0, "bend": 0}).frequencies, rtol=1e-9)


def test_settings_take_the_names_of_instances() -> None:
    leg = eg.Model("leg")
    leg.revolute("hip", leg.ground, leg.body("thigh", mass=1.0, inertia={"zz": 0.1}), coordinate="hip")
    leg.parameter("l", 1.0)
    m = eg.Model("walker")
    m.add(leg, "leg1_")
    module = m.compile(target="numpy")
    initial, parameters, inputs = sort_settings(module, {"leg1.hip": 0.2, "leg1.l": 3.0})
    assert (initial, parameters, inputs) == ({"leg1_hip": 0.2}, {"leg1_l": 3.0}, {})
    with pytest.raises(UsageError, match="no parameter, input or initial value 'leg1.hop'"):
        sort_settings(module, {"leg1.hop": 0.2})


def test_inertial_parameters_refuse_first_order_states_by_name() -> None:
    m = eg.Model("driven")
    m.revolute("A", m.ground, m.body("arm", mass=1.0, com=(0, -0.2, 0), inertia={"zz": 0.1}), coordinate="turn")
    m.state("pressure", "-pressure")
    module = m.compile(target="numpy")
    with pytest.raises(UnavailableError, match="regressor is not available for models with first-order states"):
        module.regressor([0.1], [0.0], [0.0])
    with pytest.raises(UnavailableError, match="base_parameters is not available for models with first-order states"):
        module.base_parameters()
    with pytest.raises(UsageError, match="least must be 0 or positive and less than 1, not -1"):
        eg.load_example("pendulum").compile(target="numpy").base_parameters(least=-1)
