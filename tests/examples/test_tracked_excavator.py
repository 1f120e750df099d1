"""The tracked excavator: its file, its start, momentum by the forces of the ground, its speed."""

from __future__ import annotations

import math
import warnings
from functools import cache
from typing import Any

import numpy as np
import pytest

import eomgen as eg
from eomgen.shipped import example_files
from examples.tracked_excavator import GROUND, Track, build, undercarriage

SHORT = Track(links=27, rollers=3, carriers=1, raised=0.015)


@cache
def short() -> Any:
    """A short track under a frame."""
    m = eg.Model("short_track", gravity=(0, -9.81, 0))
    undercarriage(m, SHORT, 6000, {"zz": 3000})
    return m.compile()


def test_the_file_is_what_the_script_writes() -> None:
    assert example_files()["tracked_excavator"].read_text() == build().to_yaml()


@pytest.mark.parametrize("track", [SHORT, Track(), *(Track(links=n, rollers=n // 6) for n in (40, 80, 160))])
def test_the_chain_lies_closed_around_the_wheels(track: Track) -> None:
    idler, pins = track.laid()
    np.testing.assert_allclose(pins[-1], pins[0], atol=1e-8)
    np.testing.assert_allclose(np.hypot(*np.diff(pins, axis=0).T), track.pitch, atol=1e-12)
    middles, along = 0.5 * (pins[1:] + pins[:-1]), np.diff(pins, axis=0) / track.pitch
    inward = np.array([-along[:, 1], along[:, 0]]).T
    wheels = [(idler, 0.0, track.idler), *track.wheels().values()]
    for x, y, radius in wheels:  # no rail is deep in a wheel
        away = np.array([x, y]) - middles
        beside = np.abs(np.sum(away * along, axis=1)) < 0.5 * track.pitch
        depth = radius - (np.sum(away * inward, axis=1) - track.rail)[beside]
        assert depth.max(initial=-1.0) < 5e-3


def test_a_run_starts_without_deep_contacts() -> None:
    mod = short()
    assert np.abs(mod.constraints(mod.x0()[: mod.n_q])).max() < 1e-12
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        mod.simulate(1e-3, rtol=1e-4, atol=1e-5)


def ground_force(mod: Any, x: np.ndarray) -> np.ndarray:
    """What the ground exerts (2,), from the places and speeds of the ends of shoes alone."""
    q, v, h = x[: mod.n_q], x[mod.n_q :], 1e-6
    names = [n for n in mod.body_names if n.startswith("link")]
    rows = [mod.body_names.index(n) for n in names]
    total = np.zeros(2)
    half = 0.5 * (SHORT.pitch - 0.04)
    for end in (-half, half):
        local = np.array([SHORT.pitch / 2 + end, 0.015 - SHORT.shoe, 0.0, 1.0])
        before, here, after = (mod.poses(q + k * h * v)[rows] @ local for k in (-1, 0, 1))
        depth = 0.015 - here[:, 1]
        speed = (after - before)[:, :2] / (2 * h)
        turning = (mod.poses(q + h * v)[rows][:, 1, 0] - mod.poses(q - h * v)[rows][:, 1, 0]) / (2 * h)
        cosine = mod.poses(q)[rows][:, 0, 0]
        middle = speed[:, 0] + turning / cosine * (0.015 - 0.5 * depth)  # below the end, in the middle of the overlap
        push = 1e8 * np.maximum(depth, 0) ** 1.5 * np.maximum(0, 1 - GROUND["dissipation"] * speed[:, 1])
        total += push.sum(), -(0.7 * push * middle / np.sqrt(middle**2 + 0.02**2)).sum()
    return total[::-1]


def test_the_ground_alone_changes_momentum() -> None:
    mod = short()
    run = mod.simulate(0.1, inputs={"speed": 2.0}, rtol=1e-6, atol=1e-7, method="RK45")
    x, h = run.x[:, -1], 1e-5
    rate = mod.rhs(0.0, x, u={"speed": 2.0})

    def speed(state: np.ndarray) -> np.ndarray:
        q, v = state[: mod.n_q], state[mod.n_q :]
        return (mod.center_of_mass(q + h * v) - mod.center_of_mass(q - h * v))[:2] / (2 * h)

    acceleration = (speed(x + h * rate) - speed(x - h * rate)) / (2 * h)
    mass = 6000 + SHORT.links * 58 + 3 * 60 + 40 + 1.2 * 200 + 200
    pushed = mass * (acceleration + np.array([0, 9.81]))
    np.testing.assert_allclose(ground_force(mod, x), pushed, atol=1e-4 * mass * 9.81)
    assert pushed[0] > 0.05 * mass * 9.81  # it speeds up


def test_it_drives_as_fast_as_teeth_pass() -> None:
    mod = short()
    drive, hard = {"speed": ([0, 0.5], [0, 3])}, {"k_ground": 1e9}
    run = mod.simulate(3.0, inputs=drive, parameters=hard, rtol=1e-4, atol=1e-5, method="RK45")
    passed = run["sprocket"] * 0.5 * SHORT.teeth / (2 * math.pi)  # links
    start = np.interp(1.0, run.t, passed)
    count = int(passed[-1] - start)
    way = np.interp(start + count, passed, run["x"]) - np.interp(start, passed, run["x"])
    assert count > 8
    assert way == pytest.approx(count * SHORT.pitch, rel=0.01)


@pytest.mark.slow
def test_soil_in_loops_of_c_equals_numpy() -> None:
    m = eg.Model("track_on_sand", gravity=(0, -9.81, 0))
    undercarriage(m, SHORT, 6000, {"zz": 3000}, soil="dry_sand")
    compiled, plain = m.compile(kernels=["rhs"]), m.compile(target="numpy")
    x = plain.x0()
    x[plain.x_names.index("y")] -= 0.03  # a part of the shoes in the sand
    x[plain.x_names.index("chain_y")] -= 0.03
    moving = slice(plain.n_q, plain.n_q + 12)
    x[moving] = 0.1 * np.sin(np.arange(12))
    x = plain.project(x)
    expected = plain.rhs(0.0, x)
    assert np.abs(expected).max() > 100
    np.testing.assert_allclose(compiled.rhs(0.0, x), expected, rtol=0, atol=1e-8 * np.abs(expected).max())
