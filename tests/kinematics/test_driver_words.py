"""What is said of drivers that cannot act, of agreeing ones, and of mechanisms that nothing drives."""

from __future__ import annotations

import pytest

import eomgen as eg
from eomgen.errors import ModelError, UsageError


def lever() -> tuple[eg.Model, eg.Body]:
    m = eg.Model("lever")
    a = m.body("a", mass=1, inertia=(1, 1, 1))
    m.revolute("A", m.ground, a, coordinate="th")
    return m, a


def test_a_driver_of_a_distance_that_no_motion_changes() -> None:
    m, a = lever()
    m.driver("d", between=[m.ground.at(0, 0, 0), a.at(1, 0, 0)], value="1 + 0.1*t")
    with pytest.raises(
        ModelError, match="has no effect: no motion of the mechanism changes the quantity that it prescribes"
    ):
        m.check()


def test_a_second_driver_that_disagrees_is_counted() -> None:
    m, _ = lever()
    m.driver("d", "th", "2*pi*t")
    m.driver("e", "th", "3*pi*t")
    with pytest.raises(ModelError, match="it has 1 degree of freedom and 2 drivers; d moves it already"):
        m.check()


def test_a_second_driver_that_agrees_is_to_be_left_out() -> None:
    m, _ = lever()
    m.driver("d", "th", "2*pi*t")
    m.driver("e", "th", "2*pi*t")
    (note,) = m.check().notes
    assert "overconstrained: e.motion follows" in str(note)
    assert "if you need them, leave e out" in str(note)
    assert "spherical" not in str(note)


def test_a_locked_triangle_is_not_said_to_be_driven() -> None:
    m = eg.Model("locked")
    a, c = m.body("a", mass=1), m.body("c", mass=1)
    m.revolute("A", m.ground, a, coordinate="th")
    m.revolute("B", a.at(1, 0, 0), c, coordinate="be")
    m.revolute("C", c.at(1, 0, 0), m.ground.at(1, 0, 0))
    m.guess(th=1.0, be=-2.0)
    mod = m.compile(target="numpy")
    for call in (lambda: mod.kinematic_analysis(th=[0.0, 1.0]), lambda: mod.motion_range("th")):
        with pytest.raises(UsageError, match="the mechanism is locked, and no driver moves it"):
            call()
    m, _ = lever()
    m.driver("d", "th", "2*pi*t")
    with pytest.raises(UsageError, match="the drivers determine the whole motion; give t"):
        m.compile(target="numpy").kinematic_analysis(th=[0.0, 1.0])
