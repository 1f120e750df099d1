"""Soil that remembers by place: ruts, the second pass, shear and energy against closed forms, drives."""

import math
from typing import Any

import numpy as np
import pytest
from force_judges import wong
from judges import differences
from refusals import refuses
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq
from sweeps import seeds

import eomgen as eg

G = 9.81
#: Of dry_sand in Wong's table: n, kc, kphi, c, phi, K.
N, COHESIVE, FRICTIONAL, COHESION, ANGLE, SHEAR = 1.1, 0.99e3, 1528.43e3, 1.04e3, math.radians(28.0), 0.025
REBOUND = 0.1
SLIPPERY = {"cohesion": 0.0, "friction_angle": 0.0}
RADIUS, WIDTH = 0.5, 0.3


def modulus(width: float) -> float:
    return COHESIVE / width + FRICTIONAL


def bed_model(shape: Any, length: float, cells: int) -> eg.Model:
    """Two bodies of 1 kg that move freely in the plane, without gravity."""
    m = eg.Model("bed", gravity=(0, 0, 0))
    for k in range(2):
        m.planar(f"j{k}", m.ground, m.body(f"b{k}", mass=1.0, inertia={"zz": 1.0}))
    bed = {"shape": "bed", "on": m.ground, "length": length, "cells": cells}
    law = {
        "soil": "dry_sand", "rebound": m.parameter("rebound", REBOUND),
        "cohesion": m.parameter("cohesion", COHESION),
        "friction_angle": m.parameter("friction_angle", ANGLE),
        "shear_modulus": m.parameter("K", 0.025),
    }  # fmt: skip
    m.contacts("soil", [{**shape, "on": f"b{k}"} for k in range(2)], bed, law)
    return m


WHEEL = {"shape": "circle", "radius": RADIUS, "width": WIDTH}
LENGTH, CELLS = 1.2, 48


@pytest.fixture(scope="module")
def wheels() -> eg.Module:
    """Two wheels and 48 cells, of which 9 lie under a wheel at 5 cm that rolls."""
    return bed_model(WHEEL, LENGTH, CELLS).compile(optimize=0)


@pytest.fixture(scope="module")
def plates() -> eg.Module:
    """Two plates and 40 cells."""
    return bed_model({"shape": "plate", "length": 0.3, "width": 0.2}, 0.6, 40).compile(target="numpy")


def state(mod: eg.Module, soil: float = 0.0, **values: float) -> Any:
    """The second body is far above, unless it is said where; all cells have been pressed as deep as ``soil``."""
    x = np.zeros(mod.n_x)
    for name, value in {"j1_y": 5.0, **values}.items():
        if name in mod.x_names:
            x[mod.x_names.index(name)] = value
    x[["sinkage" in name for name in mod.x_names]] = soil
    return x


# -- forces at given sinkages -----------------------------------------------------------------------------------------
@pytest.mark.parametrize(("z", "deepest"), [(0.05, 0.0), (0.05, 0.05), (0.05, 0.052), (0.05, 0.06), (0.03, 0.02)])
def test_a_wheel_in_a_rut_of_one_depth(wheels: eg.Module, z: float, deepest: float) -> None:
    """The sum over cells of p a is the integral of p dx over the arc; it pushes up alone, as the arc is symmetric."""
    rates = wheels.rhs(0.0, state(wheels, deepest, j0_x=0.6, j0_y=RADIUS - z), p=SLIPPERY)
    edge, marks = math.sqrt(RADIUS**2 - (RADIUS - z) ** 2), [0.0]
    for depth in (deepest, (1 - REBOUND) * deepest):
        if 0 < depth < z:
            marks += [sign * math.sqrt(RADIUS**2 - (RADIUS - z + depth) ** 2) for sign in (-1, 1)]
    wanted = WIDTH * quad(
        lambda x: float(wong(math.sqrt(RADIUS**2 - x * x) - RADIUS + z, deepest, modulus(WIDTH), N)),
        -edge, edge, points=sorted(marks), limit=200,
    )[0]  # fmt: skip
    assert rates[7] == pytest.approx(wanted, rel=0.03, abs=1e-9)
    assert abs(rates[6]) < 1e-9 * max(wanted, 1)
    assert abs(rates[8]) < 1e-9 * max(wanted, 1)


@pytest.mark.parametrize("angle", [0.0, math.pi])
@pytest.mark.parametrize(("z", "deepest"), [(0.0525, 0.0), (0.0525, 0.05), (0.05, 0.052), (0.02, 0.04)])
def test_a_plate_and_its_edges(plates: eg.Module, z: float, deepest: float, angle: float) -> None:
    """p L on the plate, and the columns that the wedges of its ends reach; also upside down."""
    up = plates.rhs(0.0, state(plates, deepest, j0_x=0.3, j0_y=-z, j0_3=angle), p=SLIPPERY)[7]
    k = modulus(0.2)

    def wedge(s: Any) -> Any:
        """A hyperbola of the slope 3, whose radius is a quarter of a cell."""
        half = 3 * 0.015 / 4
        return 3 * (np.sqrt(half**2 + s**2) - half)

    beside = wedge(np.maximum(np.abs((np.arange(40) + 0.5) * 0.015 - 0.3) - 0.15, 0.0))
    assert up == pytest.approx(0.2 * 0.015 * wong(z - beside, deepest, k, N).sum(), rel=1e-9)
    edge = quad(lambda s: float(wong(z - wedge(s), deepest, k, N)), 0, z, limit=200)[0]
    wanted = 0.2 * (0.3 * float(wong(z, deepest, k, N)) + 2 * edge)
    assert up == pytest.approx(wanted, rel=0.05, abs=1e-9)


# -- steady rolling ---------------------------------------------------------------------------------------------------
def rolled(mod: eg.Module, z: float, slip: float, p: Any = None, V: float = 0.5) -> Any:
    """Mean force along x, up and the torque of a wheel that is led along fresh soil at a depth."""
    spin, seconds = V / (RADIUS * (1 - slip)), 1.2
    x, start = state(mod), 12

    def at(t: float, soil: Any) -> Any:
        x[[0, 1, 2, 6, 7, 8]] = 0.3 + V * t, RADIUS - z, -spin * t, V, 0.0, -spin
        x[start:] = soil
        return x

    sol = solve_ivp(
        lambda t, s: np.array(mod.rhs(t, at(t, s), p=p))[start:], (0, seconds), np.zeros(mod.n_x - start), rtol=1e-5,
        atol=1e-8, max_step=0.01,
    )  # fmt: skip
    late = np.flatnonzero(sol.t > 0.7 * seconds)
    found = np.array([np.array(mod.rhs(sol.t[k], at(sol.t[k], sol.y[:, k]), p=p))[6:9] for k in late])
    return np.trapezoid(found, sol.t[late], axis=0) / np.ptp(sol.t[late])


@pytest.mark.parametrize("slip", [0.02, 0.3, 0.6])
def test_forces_of_steady_rolling(wheels: eg.Module, slip: float) -> None:
    """By SciPy's quadrature over the arc, with dj = (R Omega - V cos a) R cos a / V, the way of soil under the rim."""
    z, k = 0.05, modulus(WIDTH)
    slope, entry = math.tan(ANGLE), math.acos(1 - z / RADIUS)
    leave = -math.acos(1 - REBOUND * z / RADIUS)

    def pressure(a: float) -> float:
        depth = RADIUS * (math.cos(a) - math.cos(entry))
        return float(wong(depth, 0.0 if a > 0 else z, k, N))

    def stress(a: float) -> float:
        way = RADIUS / (1 - slip) * (math.sin(entry) - math.sin(a))
        way -= RADIUS * ((entry - a) / 2 + (math.sin(2 * entry) - math.sin(2 * a)) / 4)
        return (COHESION + pressure(a) * slope) * (1 - math.exp(-way / SHEAR))

    def over(f: Any) -> float:
        return WIDTH * RADIUS * float(quad(f, leave, 0)[0] + quad(f, 0, entry)[0])

    pull = over(lambda a: stress(a) * math.cos(a) - pressure(a) * math.sin(a))
    lift = over(lambda a: pressure(a) * math.cos(a) + stress(a) * math.sin(a))
    torque = RADIUS * over(stress)
    found = rolled(wheels, z, slip)
    size = max(abs(torque) / RADIUS, abs(pull))
    np.testing.assert_allclose(found[1], lift, rtol=0.01)
    assert abs(found[0] - pull) < 0.02 * size
    assert abs(found[2] - torque) < 0.02 * size * RADIUS


# -- the second pass --------------------------------------------------------------------------------------------------
TRAIN = 110  #: cells, of 3 cm


def train(masses: tuple[float, ...]) -> eg.Model:
    """Wheels in line, 0.7 m apart, that roll at 1 m/s and are free up and down."""
    m = eg.Model("train", gravity=(0, -G, 0))
    for k, mass in enumerate(masses):
        m.body(f"cart{k}", mass=0)
        m.body(f"wheel{k}", mass=mass)
        m.prismatic(f"x{k}", m.ground, f"cart{k}", axis="x")
        m.prismatic(f"y{k}", f"cart{k}", f"wheel{k}", axis="y")
        m.driver(f"roll{k}", coordinate=f"x{k}", value=f"{1.9 - 0.7 * k} + t")
        m.initial(**{f"y{k}": RADIUS - 0.02})
    shapes = [{**WHEEL, "on": f"wheel{k}"} for k in range(len(masses))]
    bed = {"shape": "bed", "on": m.ground, "length": 3.3, "cells": TRAIN}
    m.contacts("soil", shapes, bed, {"soil": "dry_sand", **SLIPPERY})
    return m


def depth_in_rut(load: float, rut: float) -> float:
    """Where the quadrature over the arc of a wheel carries a load, in soil pressed to a depth; behind it unloads."""
    k = modulus(WIDTH)

    def lift(z: float) -> float:
        reach = math.sqrt(RADIUS**2 - (RADIUS - z) ** 2)

        def pressure(x: float) -> float:
            return float(wong(math.sqrt(RADIUS**2 - x * x) - RADIUS + z, rut if x > 0 else max(rut, z), k, N))

        bends = [
            math.sqrt(max(RADIUS**2 - (RADIUS - z + d) ** 2, 0.0)) for d in (rut, 0.9 * rut, 0.9 * max(rut, z)) if d < z
        ]
        marks = sorted({0.0, *bends, *(-b for b in bends)})
        return WIDTH * float(quad(pressure, -reach, reach, points=marks, limit=200)[0])

    return float(brentq(lambda z: lift(z) - load, 1e-3, 0.2))


@pytest.fixture(scope="module")
def convoy() -> eg.Module:
    """Two wheels of one load, and a heavier third."""
    return train((100.0, 100.0, 160.0)).compile(optimize=0)


def late_depths(traj: Any) -> list[float]:
    late = traj.t > 0.8
    t = traj.t[late]
    return [float(np.trapezoid(RADIUS - traj[f"y{k}"][late], t) / np.ptp(t)) for k in range(3)]


def test_each_wheel_deepens_the_rut_of_those_before_it(convoy: eg.Module) -> None:
    """By the closed form of Wong's reloading, from the rut that the wheels before have left."""
    traj = convoy.simulate((0, 1.1), rtol=1e-6, atol=1e-8)
    first, second, heavy = late_depths(traj)
    rut = depth_in_rut(100 * G, 0.0)
    deeper = depth_in_rut(100 * G, rut)
    assert first == pytest.approx(rut, rel=2e-3)
    assert second == pytest.approx(deeper, rel=2e-3)
    assert heavy == pytest.approx(depth_in_rut(160 * G, rut), rel=2e-3)  # which the first has not run in
    assert second - rut < 0.25 * first
    cells = np.array([traj[f"soil_sinkage_{k + 1}"] for k in range(TRAIN)])
    assert (np.diff(cells, axis=1) >= -1e-8).all()
    place = (np.arange(TRAIN) + 0.5) * 0.03
    for below, above, depth in ((2.55, 2.7, rut), (2.05, 2.2, deeper), (1.3, 1.45, heavy)):
        np.testing.assert_allclose(cells[(place > below) & (place < above), -1], depth, rtol=0.01)


# -- energy -----------------------------------------------------------------------------------------------------------
def work_done(mod: eg.Module, motion: Any, seconds: float, p: Any = None) -> Any:
    """Work that led bodies have put into the bed so far, from fresh soil on."""
    n = 6

    def at(t: float, soil: Any) -> Any:
        q, v = motion(t)
        return np.concatenate([q, v, soil])

    def f(t: float, y: Any) -> Any:
        rates = np.array(mod.rhs(t, at(t, y[:-1]), p=p))
        return np.append(rates[2 * n :], -rates[n : 2 * n] @ motion(t)[1])

    sol = solve_ivp(f, (0, seconds), np.zeros(mod.n_x - 2 * n + 1), rtol=1e-5, atol=1e-7, max_step=0.005)
    return sol.t, sol.y[-1]


def wave(random: np.random.Generator, means: Any, sizes: Any) -> Any:
    """A smooth random motion."""
    count, terms = len(means), 4
    a = random.standard_normal((count, terms)) * np.asarray(sizes)[:, None] / 2
    w, phase = random.uniform(2, 25, (count, terms)), random.uniform(0, 2 * np.pi, (count, terms))

    def motion(t: float) -> Any:
        angle = w * t + phase
        return np.asarray(means) + (a * np.sin(angle)).sum(axis=1), (a * w * np.cos(angle)).sum(axis=1)

    return motion


@pytest.mark.parametrize("seed", seeds(4, 1))
@pytest.mark.parametrize("kind", ["wheels", "plates"])
def test_no_motion_takes_more_out_than_it_has_put_in(request: Any, kind: str, seed: int) -> None:
    """Two led bodies over the same cells: sinkage, load and sliding change at random, in phase or not."""
    random = np.random.default_rng([seed, 31])
    mod = request.getfixturevalue(kind)
    middle, height, turn = (0.6, RADIUS - 0.02, 0.5) if kind == "wheels" else (0.3, -0.01, 0.15)
    waves = wave(random, [middle, height, 0] * 2, [0.08, 0.02, turn] * 2)

    def motion(t: float) -> Any:
        """From above the ground, as soil that begins pressed has been given energy."""
        q, v = waves(t)
        lifted = max(0.0, 1.0 - t / 0.1)
        q[[1, 4]] += 0.15 * lifted**2
        v[[1, 4]] -= 3.0 * lifted
        return q, v

    _, work = work_done(mod, motion, 0.6, {"rebound": [0.1, 0.5, 1.0, 1.0][seed], "K": [0.025, 0.01][seed % 2]})
    assert work[-1] > 0
    assert work.min() > -1e-5 * work.max()


def free_pair() -> eg.Model:
    """A wheel over a bed on a free body."""
    m = eg.Model("both", gravity=(0, 0, 0))
    for name, mass in (("ground_body", 5.0), ("wheel", 2.0)):
        m.planar(f"j_{name}", m.ground, m.body(name, mass=mass, inertia={"zz": 0.4}))
    bed = {"shape": "bed", "on": "ground_body", "length": m.parameter("L", 1.6), "cells": 16}
    m.contacts("soil", {**WHEEL, "on": "wheel"}, bed, {"soil": "dry_sand", "dissipation": 0.3})
    return m


def test_momentum_targets_jacobian_and_rebound_parameters() -> None:
    numpy, cython = free_pair().compile(target="numpy"), free_pair().compile(optimize=0)
    x = np.random.default_rng(4).uniform(0, 4e-3, numpy.n_x)
    x[:12] = [-0.7, 0.05, 0.1, 0.05, 0.48, 0.4, 0.1, -0.2, 0.3, 0.5, -0.3, -2.0]
    rates = np.array(numpy.rhs(0, x))
    np.testing.assert_allclose(np.array(cython.rhs(0, x)), rates, rtol=1e-9, atol=1e-11)
    masses = np.array([5.0, 5.0, 2.0, 2.0])
    force = masses * rates[[6, 7, 9, 10]]
    assert np.abs(force).max() > 50
    np.testing.assert_allclose(force[:2], -force[2:], rtol=1e-10)
    moments = 0.4 * (rates[8] + rates[11]) + x[0] * force[1] - x[1] * force[0] + x[3] * force[3] - x[4] * force[2]
    assert abs(moments) < 1e-9 * np.abs(force).max()
    J = cython.jacobian(0, x)
    wrong = np.abs(J - differences(cython, x)).max(axis=0)
    assert (wrong < 2e-5 * np.maximum(1.0, np.abs(J).max(axis=0)) + 4e-9 * np.abs(rates).max()).all()
    longer = {"L": 1.8}
    assert np.abs(np.array(cython.rhs(0, x, p=longer)) - rates).max() > 1.0
    np.testing.assert_allclose(
        np.array(cython.rhs(0, x, p=longer)), np.array(numpy.rhs(0, x, p=longer)), rtol=1e-9, atol=1e-11
    )


@pytest.mark.parametrize(
    ("shape", "bed", "law", "told"),
    [
        (WHEEL, {"cells": 0}, {"soil": "dry_sand"}, "EG-RANGE contacts.soil.second[0].cells: 0"),
        (WHEEL, {}, {"soil": "dry_sand", "lateral": False}, "EG-CONFLICT contacts.soil.law.lateral:"),
        (WHEEL, {}, {"soil": "dry_sand", "peak_angle": [0.4, 0.3]}, "EG-CONFLICT contacts.soil.law.peak_angle:"),
        ({"shape": "circle", "radius": 0.5}, {}, {"stiffness": 1e5}, "EG-CONFLICT contacts.soil.second:"),
        ({"shape": "box", "size": (1, 1)}, {}, {"soil": "dry_sand"}, "EG-CONFLICT contacts.soil.first: box"),
        (WHEEL, {}, {"soil": "own", "sinkage_exponent": 1, "cohesive_modulus": 1e3, "frictional_modulus": 1e6,
                     "cohesion": 0, "friction_angle": 0.5, "shear_modulus": 0.01},
         "EG-MISSING contacts.soil.law.recovery:"),
    ],
)  # fmt: skip
def test_what_is_refused(shape: Any, bed: Any, law: Any, told: str) -> None:
    m = eg.Model("bed")
    m.planar("j", m.ground, m.body("b", mass=1.0, inertia={"zz": 1.0}))
    m.contacts("soil", {**shape, "on": "b"}, {"shape": "bed", "on": m.ground, "length": 2.0, "cells": 5, **bed}, law)
    refuses(told, m.derive)


# -- drives -----------------------------------------------------------------------------------------------------------
SMALL, NARROW, TRACK, PARTS, END = 0.15, 0.1, 1.0, 32, 1.0


@pytest.fixture(scope="module")
def driven() -> tuple[eg.Module, Any]:
    """A cart of 24 kg with two driven wheels, and its run at tight tolerances."""
    m = eg.Model("cart", gravity=(0, -G, 0))
    m.planar("c", m.ground, m.body("chassis", mass=20.0, inertia={"zz": 0.4}))
    for k, ahead in enumerate((0.15, -0.15)):
        wheel = m.body(f"w{k}", mass=2.0, inertia={"zz": SMALL**2})
        m.revolute(f"h{k}", {"body": "chassis", "at": [ahead, 0, 0]}, wheel)
        m.torque(f"drive{k}", wheel, (0, 0, -3.5))
    wheels = [{"shape": "circle", "on": f"w{k}", "radius": SMALL, "width": NARROW} for k in (0, 1)]
    m.contacts("soil", wheels, {"shape": "bed", "on": m.ground, "length": TRACK, "cells": PARTS}, {"soil": "dry_sand"})
    m.initial(c_x=0.35, c_y=SMALL - 0.005)
    mod = m.compile(optimize=0)
    return mod, mod.simulate((0, END), method="DOP853", rtol=1e-8, atol=1e-10)


def rut(traj: Any) -> Any:
    return np.array([traj[f"soil_sinkage_{k + 1}"] for k in range(PARTS)])


@pytest.mark.parametrize("method", ["RK45", "Radau", "BDF"])
def test_every_method_drives_alike(driven: Any, method: str) -> None:
    mod, wanted = driven
    traj = mod.simulate((0, END), method=method, rtol=1e-5, atol=1e-7)
    travel = wanted["c_x"][-1] - 0.35
    assert travel > 0.3
    assert traj["c_x"][-1] - wanted["c_x"][-1] == pytest.approx(0.0, abs=2e-3 * travel)
    np.testing.assert_allclose(rut(traj)[:, -1], rut(wanted)[:, -1], atol=1e-4)


@pytest.mark.parametrize("kind", ["tight", "steps"])
def test_sinkage_is_the_deepest_that_a_wheel_has_been(driven: Any, kind: str) -> None:
    """By the geometry of the run alone: the running maximum over both wheels at each place."""
    mod, traj = driven
    if kind == "steps":
        traj = mod.simulate((0, END), method="RK4", step=1e-3)
    places = (np.arange(PARTS) + 0.5) * TRACK / PARTS
    deepest = np.zeros((PARTS, len(traj.t)))
    for ahead in (0.15, -0.15):
        x = traj["c_x"] + ahead * np.cos(traj["c_3"])
        y = traj["c_y"] + ahead * np.sin(traj["c_3"])
        beside = places[:, None] - x
        under = np.abs(beside) < 0.95 * SMALL
        depth = np.where(under, np.sqrt(np.where(under, SMALL**2 - beside**2, 0.0)) - y, 0.0)
        deepest = np.maximum(deepest, np.maximum.accumulate(np.maximum(depth, 0.0), axis=1))
    late = traj.t > 0.02  # the wheels begin 5 mm in the ground
    np.testing.assert_allclose(rut(traj)[:, late], deepest[:, late], atol=4e-4)  # while it sinks, by z' settling
    np.testing.assert_allclose(rut(traj)[:, -1], deepest[:, -1], atol=TRACK / PARTS / 200)
