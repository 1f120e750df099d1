"""A run is not resumed with another input: functions of time are told apart by all that they hold, wherever it lies."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicSpline, PchipInterpolator

import eomgen as eg

TIMES = np.linspace(0.0, 1.0, 6)


def push(t: float, x: Any, size: float) -> float:
    return size * t


class Slotted:
    __slots__ = ("__size",)

    def __init__(self, size: float) -> None:
        self.__size = size

    def __call__(self, t: float, x: Any) -> float:
        return self.__size * t


class Below(Slotted):
    """Whose own attributes are none."""


def begun(size: float) -> Callable[[float, Any], float]:
    """A function that holds a name without a value."""

    def force(t: float, x: Any) -> float:
        return size * t if t >= 0.0 else later

    if size < 0.0:
        later = 0.0
    return force


SIGNALS: dict[str, Callable[[float], Any]] = {
    "spline": lambda size: CubicSpline(TIMES, size * TIMES),
    "pchip": lambda size: PchipInterpolator(TIMES, size * TIMES),
    "partial": lambda size: partial(push, size=size),
    "slots": Slotted,
    "slots of a base": Below,
    "a name without a value": begun,
}


@pytest.fixture(scope="module")
def cart() -> Any:
    m = eg.Model("cart")
    cart = m.body("cart", mass=1.0)
    m.prismatic("J", m.ground, cart, axis="x", coordinate="s")
    m.actuator("push", joint="J", value=m.input("F"))
    return m.compile(target="numpy")


@pytest.mark.parametrize("kind", SIGNALS)
def test_a_checkpoint_is_not_taken_for_another_signal(cart: Any, tmp_path: Path, kind: str) -> None:
    file = tmp_path / "run.ck"
    first = cart.simulate((0, 1), inputs={"F": SIGNALS[kind](1.0)}, checkpoint=file)
    again = cart.simulate((0, 1), inputs={"F": SIGNALS[kind](1.0)}, checkpoint=file)
    assert again.x.tobytes() == first.x.tobytes()
    with pytest.raises(eg.UsageError, match=r"another run: inputs\.F differ"):
        cart.simulate((0, 1), inputs={"F": SIGNALS[kind](2.0)}, checkpoint=file)


@pytest.mark.parametrize("kind", SIGNALS)
def test_results_tell_which_signal_drove_them(cart: Any, kind: str) -> None:
    one, same, other = (cart.simulate((0, 1), inputs={"F": SIGNALS[kind](k)}).metadata for k in (1.0, 1.0, 2.0))
    assert one["inputs"] == same["inputs"] if "inputs" in one else one == same
    assert str(one) != str(other)
