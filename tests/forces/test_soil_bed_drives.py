"""Drives over soil that remembers by place: every method, fixed steps, and sinkage as a running maximum."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import eomgen as eg
from eomgen.errors import ModelError
from eomgen.forces.soils import SOILS
from eomgen.generation import generate

RADIUS, WIDTH, SAND = 0.15, 0.1, SOILS["dry_sand"]
LENGTH, CELLS = 1.0, 32
END = 1.0
STEP = 1e-3
SLIPPERY = {"soil": "dry_sand", "cohesion": 0.0, "friction_angle": 0.0}


def cart(bed: int = 0, cells: int = CELLS) -> eg.Model:
    """A cart of 24 kg with two driven wheels, or a plate of 1 kg that is led over ``bed`` cells, without gravity."""
    m = eg.Model("plate" if bed else "cart", gravity=(0, 0 if bed else -9.81, 0))
    if bed:
        m.planar("c", m.ground, m.body("sole", mass=1.0, inertia={"zz": 1.0}))
        plate = {"shape": "plate", "on": "sole", "length": 0.2, "width": 0.2}
        law = {**SLIPPERY, "settling": m.parameter("settling", 1e-3)}
        m.contacts("soil", plate, {"shape": "bed", "on": m.ground, "length": 0.4, "cells": bed}, law)
        return m
    m.planar("c", m.ground, m.body("chassis", mass=20.0, inertia={"zz": 0.4}))
    for k, ahead in enumerate((0.15, -0.15)):
        wheel = m.body(f"w{k}", mass=2.0, inertia={"zz": RADIUS**2})
        m.revolute(f"h{k}", {"body": "chassis", "at": [ahead, 0, 0]}, wheel)
        m.torque(f"drive{k}", wheel, (0, 0, -3.5))
    wheels = [{"shape": "circle", "on": f"w{k}", "radius": RADIUS, "width": WIDTH} for k in (0, 1)]
    m.contacts("soil", wheels, {"shape": "bed", "on": m.ground, "length": LENGTH, "cells": cells}, {"soil": "dry_sand"})
    m.initial(c_x=0.35, c_y=RADIUS - 0.005)
    return m


@pytest.fixture(scope="module")
def driven() -> tuple[eg.Module, Any]:
    """The cart and its run at tight tolerances."""
    mod = cart().compile()
    return mod, mod.simulate((0, END), method="DOP853", rtol=1e-8, atol=1e-10)


@pytest.fixture(scope="module")
def plate() -> eg.Module:
    return cart(20).compile()


def rut(traj: Any) -> Any:
    return np.array([traj[f"soil_sinkage_{k + 1}"] for k in range(CELLS)])


METHODS = ("DOP853", "RK45", "RK23", "Radau", "BDF", "LSODA")


@pytest.mark.parametrize("method", METHODS)
def test_every_method_drives_alike(driven: Any, method: str) -> None:
    mod, wanted = driven
    traj = mod.simulate((0, END), method=method, rtol=1e-5, atol=1e-7)
    travel = wanted["c_x"][-1] - 0.35
    assert travel > 0.3
    assert traj["c_x"][-1] - wanted["c_x"][-1] == pytest.approx(0.0, abs=2e-3 * travel)
    np.testing.assert_allclose(rut(traj)[:, -1], rut(wanted)[:, -1], atol=1e-4)


def test_steps_of_a_millisecond(driven: Any) -> None:
    """A twentieth of a millimetre of a rut of 25 mm, in any cell."""
    mod, wanted = driven
    traj = mod.simulate((0, END), method="RK4", step=STEP)
    assert traj["c_x"][-1] == pytest.approx(wanted["c_x"][-1], abs=1e-4)
    assert rut(wanted).max() > 0.02
    np.testing.assert_allclose(rut(traj)[:, -1], rut(wanted)[:, -1], atol=5e-5)


@pytest.mark.parametrize("kind", ["tight", "steps"])
def test_sinkage_is_the_deepest_that_a_wheel_has_been(driven: Any, kind: str) -> None:
    """By the geometry of the run alone: the running maximum over both wheels at each place."""
    mod, traj = driven
    if kind == "steps":
        traj = mod.simulate((0, END), method="RK4", step=STEP)
    places = (np.arange(CELLS) + 0.5) * LENGTH / CELLS
    deepest = np.zeros((CELLS, len(traj.t)))
    for ahead in (0.15, -0.15):
        x = traj["c_x"] + ahead * np.cos(traj["c_3"])
        y = traj["c_y"] + ahead * np.sin(traj["c_3"])
        beside = places[:, None] - x
        under = np.abs(beside) < 0.95 * RADIUS
        depth = np.where(under, np.sqrt(np.where(under, RADIUS**2 - beside**2, 0.0)) - y, 0.0)
        deepest = np.maximum(deepest, np.maximum.accumulate(np.maximum(depth, 0.0), axis=1))
    late = traj.t > 0.02  # the wheels begin 5 mm in the ground
    np.testing.assert_allclose(rut(traj)[:, late], deepest[:, late], atol=4e-4)  # while it sinks, by z' settling
    np.testing.assert_allclose(rut(traj)[:, -1], deepest[:, -1], atol=LENGTH / CELLS / 200)


def led(mod: eg.Module, height: Any, seconds: float, deepest: float = 0.0, p: Any = None) -> tuple[Any, Any]:
    """Times, and for each the depth of a plate that is led up and down, its lift, and the sinkage below it."""
    x = np.zeros(mod.n_x)
    middle = mod.x_names.index("soil_sinkage_10")

    def at(t: float, soil: Any) -> Any:
        x[:6] = 0.2, *height(t)[:1], 0.0, 0.0, *height(t)[1:], 0.0
        x[6:] = soil
        return x

    start = np.array([deepest if "sinkage" in name else 0.0 for name in mod.x_names[6:]])
    sol = solve_ivp(
        lambda t, s: np.array(mod.rhs(t, at(t, s), p=p))[6:], (0, seconds), start, rtol=1e-8, atol=1e-10, max_step=2e-3,
    )  # fmt: skip
    lift = [float(mod.rhs(t, at(t, s), p=p)[4]) for t, s in zip(sol.t, sol.y.T, strict=True)]
    found = [(-height(t)[0], up, s[middle - 6]) for t, up, s in zip(sol.t, lift, sol.y.T, strict=True)]
    return sol.t, np.array(found).T


def test_what_begins_deep_rebounds_as_if_it_had_been_pressed_there(plate: eg.Module) -> None:
    """Put in by 20 mm for 10 ms, then raised: Wong's unloading gives back a tenth."""
    _, (z, lift, held) = led(plate, lambda t: (-0.02 + 0.05 * max(0.0, t - 0.01), 0.05 * (t > 0.01)), 0.06)
    assert held[-1] == pytest.approx(0.02, rel=1e-4)
    assert held[0] == 0.0
    k = SAND.cohesive / 0.2 + SAND.frictional
    area = 10 * 0.2 * 0.02  # cells below the plate
    higher = 0.045 * (math.hypot(1, 0.01 / 0.015) - 1)  # of each end one cell presses, 10 mm beside it, 9 mm higher
    sides = 2 * 0.2 * 0.02 * k * (0.02 - higher) ** SAND.exponent
    assert lift[0] == pytest.approx(area * k * 0.02**SAND.exponent + sides, rel=1e-9)
    assert np.all(lift[z < 0.0179] < 1e-9)
    half = np.argmin(np.abs(z - 0.0195))
    top = k * 0.02**SAND.exponent
    below = np.maximum(0.0, 1 - (0.02 - z[half]) / (0.1 * (0.02 - higher)))
    wanted = area * top * (1 - (0.02 - z[half]) / 0.002) + sides * below
    assert lift[half] == pytest.approx(wanted, rel=2e-3)


def test_a_load_that_vibrates_in_a_rut_deepens_it_by_a_part_of_a_cell(plate: eg.Module) -> None:
    """By a two-hundredth of its length at most, 0.1 mm, where it stays as far below the deepest."""
    deepest, size = 0.02, 0.4 / 20
    w = 2 * np.pi * 20.0
    for below, bound in ((2.5e-5, size / 200), (2e-4, 1e-12)):
        _, (z, _, held) = led(
            plate,
            lambda t, below=below: (-deepest + below + 2e-5 * np.cos(w * t), -2e-5 * w * np.sin(w * t)),
            0.5, deepest,
        )  # fmt: skip
        assert z.max() < deepest
        assert held[0] == deepest
        assert 0.0 <= held[-1] - deepest <= bound


def test_settling_is_a_time_that_hardly_counts(driven: Any, plate: eg.Module) -> None:
    """What is pressed steadily holds the same; what begins deep comes to hold it in that time."""
    finals = []
    for settling in (1e-4, 1e-3, 5e-3):
        _, (_, lift, held) = led(plate, lambda t: (-0.1 * t, -0.1), 0.2, p={"settling": settling})
        finals.append((lift[-1], held[-1]))
    np.testing.assert_allclose(finals, [(finals[0][0], 0.02)] * 3, rtol=1e-3)
    for settling in (1e-3, 5e-3):
        _, (_, _, held) = led(plate, lambda t: (-0.02, 0.0), settling, p={"settling": settling})
        assert held[-1] == pytest.approx(0.02 * (1 - np.exp(-1.0)), rel=1e-6)


@pytest.mark.parametrize("ground", [{"shape": "half_plane"}, {"shape": "bed", "length": 1.0, "cells": 4}])
def test_settling_belongs_to_beds(ground: Any) -> None:
    m = eg.Model("ground")
    m.planar("j", m.ground, m.body("b", mass=1.0, inertia={"zz": 1.0}))
    wheel = {"shape": "circle", "on": "b", "radius": 0.5, "width": 0.3}
    law = {"soil": "dry_sand", "settling": 2e-3 if ground["shape"] == "half_plane" else 0.0}
    m.contacts("soil", wheel, {**ground, "on": m.ground}, law)
    with pytest.raises(ModelError, match=r"(?s)settling.*(belongs to the cells of a bed|greater than 0)"):
        m.compile(target="numpy")


def test_many_cells_go_through_loops(driven: Any) -> None:
    """The loops of the compiled module against the NumPy target, along a drive: rates and Jacobian."""
    mod, traj = driven
    numpy = cart().compile(target="numpy")
    for k in range(len(traj.t) // 3, len(traj.t), len(traj.t) // 3):
        x = traj.x[:, k]
        rates, J = np.array(mod.rhs(0, x)), np.array(mod.jacobian(0, x))
        np.testing.assert_allclose(rates, np.array(numpy.rhs(0, x)), rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(J, np.array(numpy.jacobian(0, x)), rtol=1e-7, atol=1e-9 * np.abs(J).max())
        assert np.count_nonzero(J[10:, :10]) > 20


def test_text_of_a_cell(tmp_path: Path) -> None:
    """At most 4.5 kB a cell in all files of a library together; written one by one it is 14 kB."""
    sizes = []
    for cells in (24, 48):
        folder = generate(cart(cells=cells), tmp_path / str(cells), target="c")
        sizes.append(sum(file.stat().st_size for file in folder.rglob("*") if file.is_file()))
    assert 1000 < (sizes[1] - sizes[0]) / 24 < 4500
