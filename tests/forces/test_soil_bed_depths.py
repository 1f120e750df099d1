"""Beds of soil at any depth: how deep bodies are in them is told, and forces go on continuously, from one energy."""

from __future__ import annotations

import itertools
import warnings
from typing import Any

import numpy as np
import pytest

import eomgen as eg
from eomgen.simulation.meetings import PenetrationWarning

RADIUS, LENGTH, CELLS = 0.5, 2.0, 40
SHAPES = {
    "wheel": {"shape": "circle", "radius": RADIUS, "width": 0.3},
    "plate": {"shape": "plate", "length": 0.4, "width": 0.3},
}


def on_bed(kind: str, target: str, tilt: float = 0.0) -> eg.Module:
    """A body that moves freely in the plane, of 1 kg, over soil that gives back all work."""
    m = eg.Model("deep", gravity=(0, 0, 0))
    body = m.body("b", mass=1.0, inertia={"zz": 1.0})
    m.planar("j", m.ground, body)
    on = m.ground.at(0, 0, 0, rpy=(0, 0, tilt))
    bed = {"shape": "bed", "on": on, "length": LENGTH, "cells": CELLS}
    law = {
        "soil": "own", "frictional_modulus": 1e5, "cohesive_modulus": 0, "sinkage_exponent": 1, "shear_modulus": 0.01,
        "cohesion": 0, "friction_angle": 0, "recovery": 0.05, "rebound": 1.0,
    }  # fmt: skip
    m.contacts("soil", {**SHAPES[kind], "on": body}, bed, law)
    return m.compile(target=target)


@pytest.fixture(scope="module")
def modules() -> dict[str, eg.Module]:
    return {kind: on_bed(kind, "cython") for kind in SHAPES}


def pressed(mod: eg.Module, place: Any) -> Any:
    """A state in soil that has been pressed to 5 m, so that its pressure depends on the depth alone."""
    x = np.zeros(mod.n_x)
    x[:3] = place
    x[["sinkage" in name for name in mod.x_names]] = 5.0
    return x


def loads(mod: eg.Module, place: Any) -> Any:
    return np.array(mod.rhs(0.0, pressed(mod, place)))[3:6]


@pytest.mark.parametrize("kind", SHAPES)
@pytest.mark.parametrize("height", [0.6, 0.3, 0.1, 0.0, -0.2, -0.7, -4.0])
def test_the_depth_is_true(modules: dict[str, eg.Module], kind: str, height: float) -> None:
    """R - y of a wheel over a half-space, -y of a plate that lies level."""
    mod = modules[kind]
    place, still = np.array([1.0, height, 0.0]), np.zeros(mod.n_v + mod.n_x - 2 * mod.n_v)
    found = mod.kernels.motion("meeting_time")(place, still, np.zeros_like(still))
    wanted = max(0.0, (RADIUS if kind == "wheel" else 0.0) - height)
    assert float(found[1]) == pytest.approx(wanted, abs=0.01)


@pytest.mark.parametrize(("kind", "height"), [("wheel", 0.3), ("wheel", -0.1), ("wheel", -2.0), ("plate", -1.0)])
def test_a_deep_start_is_told(modules: dict[str, eg.Module], kind: str, height: float) -> None:
    with pytest.warns(PenetrationWarning, match="deep in each other"):
        modules[kind].simulate(1e-4, initial={"j_x": 1.0, "j_y": height})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        modules[kind].simulate(1e-4, initial={"j_x": 1.0, "j_y": RADIUS - 0.01})


@pytest.mark.parametrize("kind", SHAPES)
def test_forces_push_out_and_do_no_work_around_paths(modules: dict[str, eg.Module], kind: str) -> None:
    """Through the level of the axle, beside the ends of the bed and, of plates, through all angles, by quadrature."""
    mod, random = modules[kind], np.random.default_rng(3)
    for middle, size in itertools.product(([1.0, 0.1], [0.1, -0.2], [1.95, -0.6]), (0.1, 0.4)):
        turn = random.uniform(1.0, 4.0)
        angle = 2 * np.pi * (np.arange(4000) + 0.5) / 4000
        path = np.array([middle[0] + size * np.cos(angle), middle[1] + size * np.sin(angle), turn * np.sin(angle + 1)])
        way = np.array([-size * np.sin(angle), size * np.cos(angle), turn * np.cos(angle + 1)])
        force = np.array([loads(mod, place) for place in path.T]).T
        power = (force * way).sum(axis=0)
        assert np.abs(power).mean() > 1
        assert abs(power.mean()) < 1e-4 * np.abs(power).mean()
        assert (force[1] >= -1e-9).all()
        steps = np.linalg.norm(np.diff(force[:2], axis=1), axis=0)
        if kind == "wheel":
            assert steps.max() < 0.02 * np.linalg.norm(force[:2], axis=0).max()


def energy(place: Any) -> float:
    """Of the cells below a plate, the lowest of the wedges of its points sought by subdivision."""
    size = LENGTH / CELLS
    cells, s = (np.arange(CELLS)[:, None] + 0.5) * size - place[0], np.zeros((CELLS, 1))
    bend = 9 * 0.25 * size
    for width in 0.2 * 0.1 ** np.arange(8.0):  # each time a tenth of the last width
        points = np.clip(s + width * np.linspace(-1, 1, 41), -0.2, 0.2)
        w = (cells - points * np.cos(place[2])) / bend * 3
        level = place[1] + points * np.sin(place[2]) + bend * (np.sqrt(1 + w * w) - 1)
        s = np.take_along_axis(points, level.argmin(axis=1)[:, None], axis=1)
    return float((1e5 * 0.3 * size * np.minimum(level.min(axis=1), 0.0) ** 2 / 2).sum())


def test_forces_of_plates_are_the_slope_of_an_energy(modules: dict[str, eg.Module]) -> None:
    """Of the lowest wedge, found without its formula, at all angles."""
    random, step = np.random.default_rng(4), 1e-5
    for _ in range(40):
        place = np.array([random.uniform(-0.2, 2.2), random.uniform(-0.5, 0.1), random.uniform(-4, 4)])
        slopes = [(energy(place - d) - energy(place + d)) / (2 * step) for d in step * np.eye(3)]
        found = loads(modules["plate"], place)
        np.testing.assert_allclose(found, slopes, rtol=1e-4, atol=1e-5 * max(1.0, np.abs(found).max()))


@pytest.mark.parametrize("kind", SHAPES)
def test_forces_do_not_jump(modules: dict[str, eg.Module], kind: str) -> None:
    """Across upright, level and slanting places, where the lower end or the side of a plate changes, and into soil."""
    mod, random = modules[kind], np.random.default_rng(6)
    angles = [*np.pi / 4 * np.arange(8), *np.arctan([3, -3]), np.pi + np.arctan(3)]
    cells = [0.975, 0.975 + 0.2, 0.975 - 0.98 * RADIUS, 0.975 + 0.98 * RADIUS, 1.0, 2.0]  # above a place of a cell, ...
    for x, y, angle in itertools.product(cells, [-0.9, -0.2, -0.01, 0.0, 0.05, 0.15], angles):
        place, way = np.array([x, y, angle]), random.uniform(-1, 1, 3)
        most = 100.0 + np.abs(loads(mod, place)).max()  # N
        jump = [np.abs(loads(mod, place + h * way) - loads(mod, place - h * way)).max() / most for h in (1e-4, 1e-8)]
        assert jump[0] < 0.2
        assert jump[1] < 1e-4


@pytest.mark.parametrize("kind", SHAPES)
def test_targets_and_turned_beds_agree(modules: dict[str, eg.Module], kind: str) -> None:
    tilt = 0.6
    numpy, turned, random = on_bed(kind, "numpy"), on_bed(kind, "numpy", tilt), np.random.default_rng(5)
    turn = np.array([[np.cos(tilt), -np.sin(tilt)], [np.sin(tilt), np.cos(tilt)]])
    for _ in range(20):
        place = np.array([random.uniform(-0.7, 2.7), random.uniform(-1.5, 0.6), random.uniform(-3, 3)])
        x = pressed(numpy, place)
        x[3:6] = random.uniform(-1, 1, 3)
        other = x.copy()
        other[:2], other[2], other[3:5] = turn @ x[:2], x[2] + tilt, turn @ x[3:5]
        rates = np.array(numpy.rhs(0, x))
        np.testing.assert_allclose(np.array(modules[kind].rhs(0, x)), rates, rtol=1e-9, atol=1e-8)
        mirrored, image = np.array([-1, 1, -1, -1, 1, -1]), x.copy()
        image[:6] = mirrored * x[:6] + [LENGTH, 0, 0, 0, 0, 0]
        found = np.array(numpy.rhs(0, image))
        np.testing.assert_allclose(found[:6], mirrored * rates[:6], rtol=1e-8, atol=1e-6)
        there = np.array(turned.rhs(0, other))
        np.testing.assert_allclose(there[3:5], turn @ rates[3:5], rtol=1e-8, atol=1e-6)
        np.testing.assert_allclose(there[5:], rates[5:], rtol=1e-8, atol=1e-6)
        calls = [
            mod.kernels.motion("meeting_time")(x[:3].copy(), x[3:].copy(), np.zeros(mod.n_x - 3))
            for mod in (numpy, modules[kind])
        ]
        np.testing.assert_allclose(calls[1][1], calls[0][1], rtol=1e-9)  # the depth
        assert calls[1][0] >= calls[0][0] * (1 - 1e-9)  # by the nearest cells alone


@pytest.mark.parametrize("speed", [(0.0, -200.0), (150.0, -150.0), (-200.0, -40.0)])
def test_no_step_passes_over_a_bed(modules: dict[str, eg.Module], speed: tuple[float, float]) -> None:
    """A fast wheel comes into the soil, which slows it down and throws it out again: all its work comes back."""
    start = {"j_x": 1.0 - 0.004 * speed[0], "j_y": 0.6, "j_x_dot": speed[0], "j_y_dot": speed[1]}
    traj = modules["wheel"].simulate((0, 0.012), initial=start, method="RK45", rtol=1e-3, atol=1e-6)
    cells = np.array([traj[f"soil_sinkage_{k + 1}"] for k in range(CELLS)])
    deepest = (RADIUS - traj["j_y"]).max()
    assert deepest > 0.05
    assert 0.6 * deepest < cells.max() < 1.01 * deepest  # which cells take in 1 ms
    assert traj["j_y_dot"][-1] > speed[1] + 1
