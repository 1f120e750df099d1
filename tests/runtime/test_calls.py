"""Calls of kernels by position and by name: the same results, and errors that say what is wrong with the arguments."""

from __future__ import annotations

import functools
import sys
import threading
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eomgen as eg

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(scope="module")
def arm() -> Any:
    return eg.load(EXAMPLES / "two_link_manipulator.yaml").compile()


def plainly(call: Any, *given: Any, **named: Any) -> Any:
    """Through ``__call__``, as Python itself sorts the arguments."""
    return type(call).__call__(call, *given, **named)


def test_every_way_to_name_the_arguments_gives_the_same(arm: Any) -> None:
    x, p, u = np.array([0.3, -0.4, 1.0, 2.0]), arm.p * 1.1, np.array([0.5, -0.2])
    timed = {"t": 0.5, "x": x, "p": p, "u": u, "out": None}
    state = {"x": x[:2], "p": p, "u": u, "out": None, "t": 0.5}
    for call, every in ((arm.rhs, timed), (arm.bias, timed), (arm.mass_matrix, state), (arm.poses, state)):
        expected = plainly(call, *every.values())
        for positional in range(len(every) + 1):
            first = list(every.values())[:positional]
            rest = list(every.items())[positional:]
            np.testing.assert_array_equal(call(*first, **dict(rest)), expected)
            np.testing.assert_array_equal(call(*first, **dict(reversed(rest))), expected)
        out = np.empty_like(expected)
        assert call(**{**every, "out": out}) is out
        np.testing.assert_array_equal(out, expected)
        np.testing.assert_array_equal(functools.partial(call, **every)(), expected)
        made = {"".join(list(name)): value for name, value in every.items()}  # names that are not interned
        np.testing.assert_array_equal(call(**made), expected)
    np.testing.assert_array_equal(arm.rhs(0, x), arm.rhs(0.0, x, None, None, None))
    np.testing.assert_array_equal(arm.mass_matrix(x[:2]), arm.mass_matrix(x[:2], t=0.0))
    np.testing.assert_array_equal(
        arm.inverse_dynamics(x[:2], a=x[2:], v=x[:2]), plainly(arm.inverse_dynamics, x[:2], x[:2], x[2:])
    )


def test_results_may_overwrite_what_they_are_made_from(arm: Any) -> None:
    """x, u or p in the memory of ``out``: read whole before it is written; lists and strided arrays mean the same."""
    x, p, u = np.array([0.3, -0.4, 1.0, 2.0]), arm.p * 1.1, np.array([0.5, -0.2])
    expected = arm.bind(p=p, u=u).rhs(0.5, x)
    for start in range(5):
        room = np.zeros(12)
        inner = room[start : start + 2]
        inner[:] = u
        out = room[2:6]
        np.testing.assert_array_equal(arm.rhs(0.5, x, p=p, u=inner, out=out), expected)
        np.testing.assert_array_equal(out, expected)
    room = np.concatenate([p, np.zeros(8)])
    np.testing.assert_array_equal(arm.rhs(0.5, x, p=room[: len(p)], u=u, out=room[1:5]), expected)
    strided = np.zeros((2, 3))
    strided[:, 1] = u
    for given in (u.tolist(), strided[:, 1], u.astype(np.float64)[::1], u.astype(">f8")):
        np.testing.assert_array_equal(arm.rhs(0.5, x, p=p.tolist(), u=given), expected)
        np.testing.assert_array_equal(arm.rhs(0.5, x, p=p, u=given), expected)


def test_wrong_arguments_are_told_as_ever(arm: Any) -> None:
    x = np.zeros(4)
    positional: list[tuple[Any, ...]] = [
        (), (0.0,), (0.0, x), (0.0, x, None, None, None), (0.0, x, None, None, None, None), ("a", x), (0.0, "a"),
        (None, x), (0.0, x[:3]), (0.0, x, [1.0]), (0.0, x, None, [1.0]),
    ]  # fmt: skip
    named: list[dict[Any, Any]] = [
        {}, {"x": x}, {"t": 0.0}, {"y": x}, {"out": np.zeros(3)}, {"out": 1}, {"p": {"l2": 1.0}}, {"T": 0.0, "x": x},
    ]  # fmt: skip
    told = 0
    for call, given, words in product((arm.rhs, arm.mass_matrix, arm.inverse_dynamics), positional, named):
        try:
            expected = plainly(call, *given, **words)
        except Exception as error:
            with pytest.raises(type(error)) as raised:
                call(*given, **words)
            plain, said = str(error), str(raised.value)
            if plain.startswith("__call__()"):  # the call has the name that users know
                plain, said = plain.partition(")")[2], said.partition(")")[2]
            assert said == plain
            told += 1
        else:
            np.testing.assert_array_equal(call(*given, **words), expected)
    assert told > 200
    with pytest.raises(TypeError, match="unexpected keyword argument 'y'"):
        arm.rhs(0.0, x, y=1)
    with pytest.raises(TypeError, match="keywords must be strings"):
        arm.rhs(0.0, x, **{1: 2})


def test_a_call_keeps_nothing_and_can_be_made_by_many_threads(arm: Any) -> None:
    x, out, t = np.array([0.3, -0.4, 1.0, 2.0]), np.empty(4), 0.123
    arguments = (x, out, t)
    before = [sys.getrefcount(value) for value in arguments]
    for _ in range(100):
        arm.rhs(t, x, out=out)
        arm.energy(x, t=t)
        with pytest.raises(eg.UsageError):
            arm.rhs(t, x, out=out[:1])
        with pytest.raises(TypeError):
            arm.rhs(t, x, out=out, wrong=x)
    assert [sys.getrefcount(value) for value in arguments] == before
    expected, wrong = arm.rhs(t, x), []

    def run() -> None:
        mine = np.empty(4)
        for _ in range(2000):
            if arm.rhs(t, x, out=mine) is not mine or not np.array_equal(mine, expected):
                wrong.append(mine.copy())

    threads = [threading.Thread(target=run) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong


def test_kernels_stay_what_they_were(arm: Any) -> None:
    assert arm.rhs.name == "rhs"
    assert arm.rhs.shape == (4,)
    assert "kernel rhs of two_link_manipulator" in repr(arm.rhs)
    assert "Evaluate at time t" in type(arm.rhs).__call__.__doc__
    kind = type(arm.rhs)

    class Doubled(kind):  # type: ignore[valid-type,misc]
        def __call__(self, *given: Any, **named: Any) -> Any:
            return 2.0 * super().__call__(*given, **named)

    kernels, x = arm.kernels, np.array([0.3, -0.4, 1.0, 2.0])
    doubled = Doubled("rhs", kernels.context, (4,), kernels.fail, False, eg.UsageError)
    np.testing.assert_array_equal(doubled(0.0, x, u=[1.0, 0.0]), 2.0 * arm.rhs(0.0, x, u=[1.0, 0.0]))


@pytest.mark.parametrize("target", ["cython", "numpy"])
def test_a_state_that_cannot_be_projected_names_the_gap_with_the_values_of_the_call(target: str) -> None:
    import sympy as sp

    x, y, x_dot, y_dot, l, r = sp.symbols("x y x_dot y_dot l r")
    row = x**2 + y**2 + r - l**2
    mod = eg.Model.from_lagrangian(
        "ring", (x_dot**2 + y_dot**2) / 2, [x, y], constraints=[row], inputs={l: 1.0}, parameters={r: 0.0}
    ).compile(target=target)
    state = np.array([0.6, 0.8, 0.0, 0.0])
    for given in ({"p": [5.0]}, {"p": [5.0 + 1.0], "u": [np.sqrt(2.0), 0.0, 0.0]}, {"u": [0.0, 0.0, 0.0], "p": [4.0]}):
        size = given["p"][0] + 1.0 - given.get("u", [1.0])[0] ** 2
        for states in (state, np.array([state, state]).T):
            with pytest.raises(eg.EvaluationError, match=rf"largest residual at constraint_1, {size:.3g};"):
                mod.project(states, **given)
            with pytest.raises(eg.EvaluationError, match=rf"largest residual at constraint_1, {size:.3g};"):
                mod.rhs(0.0, states, **given)
