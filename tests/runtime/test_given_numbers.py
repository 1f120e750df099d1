"""Numbers as texts, runs as initial states, and either name of an argument: each gives what the plain number gives."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest

import eomgen as eg


@pytest.fixture(scope="module")
def mod() -> Any:
    return models.build("double_pendulum").compile(target="numpy")


def same(a: Any, b: Any) -> None:
    np.testing.assert_array_equal(a.t, b.t)
    np.testing.assert_array_equal(a.x, b.x)


def test_texts_are_numbers(mod: Any) -> None:
    plain = mod.simulate((0, math.pi / 4), {"theta1": math.pi / 6, "bend_dot": -0.5}, {"l1": 0.75})
    same(plain, mod.simulate((0, "pi/4"), {"theta1": "deg(30)", "bend_dot": "-1/2"}, {"l1": "3/4"}))
    same(plain, mod.simulate("pi/4", {"theta1": "30*pi/180", "bend_dot": "-sqrt(0.25)"}, {"l1": "0.5 + 0.25"}))
    np.testing.assert_array_equal(mod.x0(theta1="deg(30)"), mod.x0(theta1=math.pi / 6))
    np.testing.assert_array_equal(mod.bind({"l1": "3/4"}).p, mod.bind({"l1": 0.75}).p)
    held = [mod.equilibrium(hold={"theta1": value}).q for value in ("pi/3", math.pi / 3)]
    np.testing.assert_array_equal(*held)


@pytest.mark.parametrize("text", ["l1", "t", "1/0", "deg(", "__import__('os')", "", "1e999", "2 metres"])
def test_other_texts_are_refused(mod: Any, text: str) -> None:
    for call in (
        lambda: mod.simulate(1.0, {"theta1": text}),
        lambda: mod.simulate((0, text)),
        lambda: mod.bind({"l1": text}),
    ):
        with pytest.raises(eg.UsageError, match="must be a number|must be finite"):
            call()


def test_a_run_goes_on_from_the_last_state_of_another(mod: Any) -> None:
    first = mod.simulate((0.0, 1.0), rtol=1e-10)
    same(mod.simulate((1.0, 2.0), first, rtol=1e-10), mod.simulate((1.0, 2.0), first.x[:, -1], rtol=1e-10))
    many = mod.simulate_many(1.0, initial=first, parameters={"g": [9.81, 1.62]})
    np.testing.assert_array_equal(many.x[:, 0], mod.simulate((0, 1.0), first).x[:, -1])
    other = models.build("slider_crank").compile(target="numpy")
    with pytest.raises(eg.UsageError, match="the run has states theta1.*the model has theta, B"):
        other.simulate(1.0, first)
    loop = other.simulate((0.0, 0.5))
    np.testing.assert_allclose(other.simulate((0.5, 0.6), loop).x[:, 0], loop.x[:, -1], rtol=0, atol=1e-12)


def test_either_name_of_an_argument(mod: Any) -> None:
    heavy = {"m2": 3.0}
    same(mod.simulate(0.5, p=heavy), mod.simulate(0.5, parameters=heavy))
    np.testing.assert_array_equal(mod.linearize(parameters=heavy).A, mod.linearize(p=heavy).A)
    np.testing.assert_array_equal(mod.bind(parameters=heavy).p, mod.bind(p=heavy).p)
    np.testing.assert_array_equal(mod.x0(theta1=0.1, parameters=heavy), mod.x0(theta1=0.1, p=heavy))
    runs = [mod.simulate_many(0.5, {"theta1": [0.1, 0.2]}, **{name: heavy}).x for name in ("p", "parameters")]
    np.testing.assert_array_equal(*runs)
    for both in (mod.simulate, mod.bind, mod.linearize):
        with pytest.raises(eg.UsageError, match="are the same argument"):
            both(p=heavy, parameters=heavy)
    with pytest.raises(eg.UsageError, match="no option .*'q'"):
        mod.simulate(0.5, q=heavy)


@pytest.mark.parametrize("call", [lambda m: m.x0(theta=90), lambda m: m.simulate(0.01, initial={"theta": 90.0})])
def test_an_initial_angle_of_many_turns_is_noted(call: Callable[[Any], Any]) -> None:
    module = eg.load_example("pendulum").compile(target="numpy")
    with pytest.warns(UserWarning, match=r"theta = 90 is an angle of 14.3 turns.*write deg\(90\)") as noted:
        call(module)
    assert [Path(str(one.filename)).name for one in noted] == [Path(__file__).name]
    module.x0(theta=12.0)
    module.simulate(0.01, initial={"theta": "deg(90)"})


def test_degrees_in_expressions() -> None:
    m = eg.Model("tilted")
    m.parameter("slope", "deg(30)")
    m.parameter("angle", 30.0)
    m.output("one", "sin(slope)")
    m.output("other", "sin(deg(angle))")
    body = m.body("block", mass=2)
    m.prismatic("slide", m.ground, body, axis="x", coordinate="s")
    mod = m.compile(target="numpy")
    np.testing.assert_allclose(mod.outputs(0.0, mod.x0()), [0.5, 0.5], rtol=1e-15)
    with pytest.raises(eg.ModelError, match="'deg' is a built-in function"):
        wrong = eg.Model("m")
        wrong.parameter("deg", 1.0)
        wrong.mechanism()
