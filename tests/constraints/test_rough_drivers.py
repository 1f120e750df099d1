"""Drivers whose motion has corners or ends: what the report and the errors say of them."""

from __future__ import annotations

import pytest

import eomgen as eg
from eomgen.errors import AssemblyError, SimulationError


def driven(value: str) -> eg.Model:
    m = eg.Model("driven")
    arm = m.body("arm", mass=1.0, com=(0.1, 0, 0), inertia={"zz": 0.1})
    m.revolute("A", m.ground, arm, coordinate="theta")
    m.driver("motor", "A", value)
    return m


@pytest.mark.parametrize(
    ("value", "word"), [("max(0, t - 0.5)", "max"), ("abs(t - 0.5)", "abs"), ("where(t < 1, 0, t - 1)", "where")]
)
def test_corners_are_noted(value: str, word: str) -> None:
    (note,) = driven(value).check().notes
    assert f"motor: {word} in a driver's value can make a corner" in str(note)


def test_smooth_motions_are_not_noted() -> None:
    assert list(driven("0.3*sin(2*t)").check().notes) == []


def test_a_motion_that_ends_is_told_as_such() -> None:
    mod = driven("sqrt(1 - t)").compile(target="numpy")
    with pytest.raises(
        SimulationError, match=r"at t = 1 s .*motor has no finite value: look for a division by zero, or a root"
    ):
        mod.simulate((0, 2))


def test_a_motion_that_does_not_begin_is_told_as_such() -> None:
    with pytest.raises(AssemblyError, match="motor has no finite value at t = 0: look for a division by zero"):
        driven("log(t)").compile(target="numpy")
