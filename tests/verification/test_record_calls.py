"""Figures for the tests of packages: true, within their bounds in C, and none where nothing can be evaluated."""

from __future__ import annotations

import json
from typing import Any

import models
import numpy as np
import pytest

import eomgen as eg
from eomgen.verification.record_calls import CALLS, record_calls


def recorded(model: eg.Model) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = json.loads(record_calls(model.compile(target="numpy")))["cases"]
    return found


def test_figures_are_those_of_the_pendulum() -> None:
    cases = {case["id"]: case for case in recorded(models.build("pendulum"))}
    assert {name.partition("-")[0] for name in cases} == {"x0", *CALLS} - {"constraints"}
    moved = 0
    for case in cases.values():
        if case["call"] not in ("rhs", "energy", "mass_matrix"):
            continue
        m, l, g = case["given"]["p"]
        theta, omega = (*case["arguments"][-1], 0.0)[:2]
        expected = {
            "rhs": [omega, -g / l * np.sin(theta)],
            "energy": [m * (l * omega) ** 2 / 2, -m * g * l * np.cos(theta)],
            "mass_matrix": [[m * l**2]],
        }[case["call"]]
        np.testing.assert_allclose(case["value"], expected, rtol=1e-14, atol=1e-14)
        assert case["bound"] < 1e-8
        moved += (m, l, g) != (1.0, 1.0, 9.81)
    assert moved >= 3  # other parameters too


@pytest.mark.parametrize("name", ["slider_crank", "bicycle", "driven_slider_crank", "stewart_platform", "bricard"])
def test_c_is_within_the_bounds(name: str) -> None:
    model = models.build(name)
    cases, mod = recorded(model), model.compile()
    assert len(cases) >= 15
    for case in cases:
        found = getattr(mod, case["call"])(*case["arguments"], **case["given"])
        np.testing.assert_allclose(found, case["value"], rtol=0.0, atol=case["bound"], err_msg=case["id"])


def test_without_an_evaluator_there_are_none() -> None:
    assert json.loads(record_calls(None)) == {"cases": []}


def test_what_has_no_finite_value_is_left_out() -> None:
    m = eg.Model("root")
    m.prismatic("J", m.ground, m.body("b", mass=1.0), axis="x", coordinate="s")
    m.output("root", "sqrt(s - 100)")
    cases = recorded(m)
    assert {"rhs", "energy"} <= {case["call"] for case in cases}
    assert "outputs" not in {case["call"] for case in cases}
