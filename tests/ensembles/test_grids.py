"""A grid of runs is every combination, each the run that simulate makes."""

from __future__ import annotations

import numpy as np
import pytest

import eomgen as eg


@pytest.fixture(scope="module")
def pendulum() -> object:
    m = eg.Model("pendulum", gravity=(0, "-g", 0))
    m.parameter("g", 9.81)
    l = m.parameter("l", 0.5)
    m.revolute("theta", m.ground, m.body("bob", mass=1, com=(0, -l, 0)))
    m.torque("motor", "theta", m.input("tau"))
    return m.compile(target="numpy")


def test_every_combination(pendulum: object) -> None:
    grid = {"theta": (-0.5, 0.5, 3), "l": [0.4, 0.9], "tau": [0.0, 1.0]}
    runs = pendulum.simulate_many(0.3, {"theta_dot": 0.2}, grid=grid, rtol=1e-9)
    assert runs.count == 12
    shaped = runs["theta"].reshape(3, 2, 2)
    for i, theta in enumerate((-0.5, 0.0, 0.5)):
        for j, length in enumerate((0.4, 0.9)):
            for k, tau in enumerate((0.0, 1.0)):
                alone = pendulum.simulate(
                    0.3, {"theta": theta, "theta_dot": 0.2}, {"l": length}, {"tau": tau}, rtol=1e-10, atol=1e-12
                )
                assert shaped[i, j, k] == pytest.approx(alone["theta"][-1], abs=1e-7)


@pytest.mark.parametrize(
    ("grid", "told"),
    [
        ({"thta": [1]}, "no parameter, input, coordinate or rate 'thta'; did you mean theta"),
        ({}, "grid has no names"),
        ([1, 2], "grid must be a mapping of names to values"),
        ({"theta_dot": [1]}, "theta_dot is given in initial too"),
    ],
)
def test_faults(pendulum: object, grid: object, told: str) -> None:
    with pytest.raises(eg.UsageError, match=told):
        pendulum.simulate_many(0.1, {"theta_dot": 0.2}, grid=grid)


def test_an_array_of_states_and_a_grid_do_not_go_together(pendulum: object) -> None:
    with pytest.raises(eg.UsageError, match="initial must be given by name beside a grid"):
        pendulum.simulate_many(0.1, np.zeros((2, 3)), grid={"l": [1.0]})
