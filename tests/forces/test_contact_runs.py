"""Runs with contacts: none is stepped over at default tolerances, deep starts are reported; judged by geometry."""

import itertools
import warnings
from functools import cache
from typing import Any

import contact_scenes as scenes
import numpy as np
import pytest
from contact_scenes import ELASTIC, LAW, PLANAR, on
from flying_bodies import flying
from models import IN_C
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from sweeps import part_of

import eomgen as eg

COMPILED = ("DOP853", "RK45", "Radau")
SPEED = 20.0


@cache
def wall(target: str) -> Any:
    """A ball at 20 m/s before a wall without thickness, from which it comes back."""
    m = eg.Model("thin", gravity=(0, 0, 0))
    ball = m.body("ball", mass=1.0, inertia={"zz": 0.004})
    m.planar("j", m.ground, ball)
    thin = {"shape": "segment", "on": m.ground.at(2, 0, 0, rpy=(0, 0, np.pi / 2)), "length": 3.0}
    m.contacts("wall", {"shape": "circle", "on": ball, "radius": 0.05}, thin, {"stiffness": 1e6})
    return m.compile(target=target, **(IN_C if target == "cython" else {}))


@pytest.mark.parametrize(
    ("target", "method", "way"),
    [
        *(("cython", name, 1.0) for name in (*COMPILED, "RK23", "BDF", "LSODA")),
        ("cython", "DOP853", -1.0),
        ("numpy", "RK45", 1.0),
    ],
)
def test_no_method_steps_over_a_wall(target: str, method: str, way: float) -> None:
    """Forwards and backwards in time."""
    run = wall(target).simulate((0, 0.3 * way), initial={"j_x_dot": SPEED * way}, method=method)
    assert run["j_x_dot"][-1] == pytest.approx(-SPEED * way, rel=1e-5)
    assert run["j_x"].max() < 2.0


@pytest.mark.parametrize("thin", ["segment", "cuboid"])
def test_corners_of_a_thick_box_step_over_nothing_thin(thin: str) -> None:
    """Of 0.4 m at 3 m/s, a corner ahead, against 1 mm that is stiff enough: it comes back."""
    law = {"stiffness": 1e12, "exponent": 2}
    if thin == "segment":
        m, (body,) = scenes.planar("thin", 1, (0, 0, 0))
        wall: dict[str, Any] = {"shape": thin, "length": 3.0, "radius": 5e-4}
        box: dict[str, Any] = {"shape": "box", "size": (0.4, 0.4)}
        m.contacts("c", on(box, body), on(wall, m.ground.at(2, 0, 0, rpy=(0, 0, np.pi / 2))), law)
        turn = {"j0_3": 0.8}
    else:
        m, (body,) = flying(1)
        wall, box = ({"shape": thin, "size": size, "edge_radius": 4e-4} for size in ((1e-3, 3.0, 3.0), (0.4, 0.4, 0.4)))
        m.contacts("c", on(box, body), on(wall, m.ground.at(2, 0, 0)), law)
        x, y, z, w = Rotation.align_vectors([(1.0, 0.02, 0.01)], [(1, 1, 1)])[0].as_quat()
        turn = {"j0_e0": w, "j0_e1": x, "j0_e2": y, "j0_e3": z}
    mod = m.compile(target="numpy")
    for method in ("DOP853", "RK45"):
        assert mod.simulate(0.5, {"j0_x": 1.2, "j0_x_dot": 3.0, **turn}, method=method)["j0_x"][-1] < 2.0


@pytest.mark.thorough
def test_ensembles_step_over_no_wall() -> None:
    module = wall("cython")
    speeds = np.concatenate([np.linspace(5.0, SPEED, 11), [-SPEED]])
    many = module.simulate_many((0, 0.6), initial={"j_x_dot": speeds})
    wanted = np.where(speeds > 0.0, -speeds, speeds)
    assert np.allclose(np.asarray(many.x)[3], wanted, rtol=1e-4)


def test_integrators_and_solvers_of_scipy_step_over_no_wall() -> None:
    module = wall("cython")
    x = module.x0(j_x_dot=SPEED)
    assert module.integrator()(0.0, x, 0.3)[3] == pytest.approx(-SPEED, rel=1e-5)
    found = solve_ivp(module.rhs, (0, 0.3), x, method=module.DOP853, rtol=1e-8, atol=1e-10)
    assert found.y[3, -1] == pytest.approx(-SPEED, rel=1e-5)


def test_derivatives_of_a_run_pass_over_no_contact() -> None:
    """The ball comes back with the speed that it had: d(end)/d(start) = -1."""
    found = wall("cython").sensitivities("j_x_dot", (0, 0.3), initial={"j_x_dot": SPEED})
    assert found.trajectory["j_x_dot"][-1] == pytest.approx(-SPEED, rel=1e-5)
    assert found.dx[3, 0, -1] == pytest.approx(-1.0, rel=1e-4)


@pytest.mark.parametrize("kind", part_of(["circle", "segment", "polygon"], ("segment",).__contains__))
def test_random_shots_are_turned_where_they_touch(kind: str) -> None:
    module, rng, touched = scenes.shot_model(kind).compile(optimize=0), np.random.default_rng(11), 0
    for k in range(35):
        one = scenes.shot(rng, kind)
        turned = scenes.turned(module, one, COMPILED[k % 3])
        touched += one.depth > scenes.GRAZING
        assert turned > 1e-6 if one.depth > scenes.GRAZING else one.depth > 0 or turned < 1e-6, (k, one)
    assert touched > 25


@cache
def thrown(name: str, target: str) -> Any:
    """A body in space without gravity before a half-space or another body."""
    shape, other = SOLIDS[name]
    m = eg.Model("thrown", gravity=(0, 0, 0))
    a = m.body("a", mass=1.0, inertia={"xx": 0.02, "yy": 0.03, "zz": 0.025})
    m.free("j", m.ground, a)
    m.contacts("c", {**shape, "on": a}, {**other, "on": m.ground}, {"stiffness": 1e7})
    m.output("energy", "total_energy")
    return m.compile(target=target, **(IN_C if target == "cython" else {}))


SOLIDS = {
    "ellipsoid": ({"shape": "ellipsoid", "semi_axes": [0.02, 0.3, 0.02]}, {"shape": "half_space"}),
    "capsules": (
        {"shape": "capsule", "length": 0.8, "radius": 0.01},
        {"shape": "capsule", "length": 0.6, "radius": 0.01},
    ),
    "cuboid": ({"shape": "cuboid", "size": [0.01, 0.5, 0.01]}, {"shape": "half_space"}),
    "capsule": ({"shape": "capsule", "length": 0.8, "radius": 0.01}, {"shape": "half_space"}),
}


@pytest.mark.parametrize(
    ("name", "target"), part_of(itertools.product(SOLIDS, ["numpy", "cython"]), ("cuboid", "cython").__eq__)
)
def test_turning_bodies_do_not_pass(name: str, target: str) -> None:
    """A long thin body that spins fast and flies slowly: its tip sweeps many times a flight."""
    module, judge = thrown(name, target), thrown(name, "cython")
    rng = np.random.default_rng(3)
    met = 0
    for _ in range(6 if target == "cython" else 2):
        start = {"j_z": 0.9, "j_x": 0.005, "j_z_dot": -1.5, "j_1_dot": rng.uniform(30.0, 90.0), "j_3_dot": rng.normal()}
        free = module.simulate((0, 0.8), initial=start)
        small = judge.simulate((0, 0.8), initial=start, max_step=2e-5)
        pushed = [run["j_z_dot"] != start["j_z_dot"] for run in (free, small)]
        assert pushed[0].any() == pushed[1].any()
        if not pushed[1].any():
            continue
        met += 1
        first = [run.t[hit][0] for run, hit in zip((free, small), pushed, strict=True)]
        assert first[0] == pytest.approx(first[1], abs=2e-3)
        assert np.ptp(free["energy"]) < 1e-3 * free["energy"][0]
    assert met > 0


def pair(target: str) -> Any:
    """A box and two circles, all in one group, on a floor."""
    m, bodies = scenes.planar("deep", 3)
    shapes = [on(PLANAR[kind], body) for kind, body in zip(("box", "circle", "circle"), bodies, strict=True)]
    m.contacts("heap", shapes, law=ELASTIC)
    m.contacts("floor", shapes, {"shape": "half_plane", "on": m.ground.at(0, -1, 0)}, LAW)
    return m.compile(target=target)


@pytest.mark.parametrize("target", part_of(["numpy", "cython"], ("numpy",).__contains__))
def test_the_deepest_pair_is_reported(target: str) -> None:
    module = pair(target)
    apart = {"j1_x": 0.5, "j2_x": 1.0}
    for start, told in (
        ({"j1_x": 0.5, "j2_x": 0.65}, r"contacts 'heap': circle on b1 and circle on b2 are 0.05 m deep in each other"),
        ({"j1_x": 0.1, "j2_x": 1.0}, r"contacts 'heap': box on b0 and circle on b1 are 0.1 m deep in each other"),
        (
            {**apart, "j2_y": -0.93},
            r"contacts 'floor': half_plane on ground.* and circle on b2 are 0.03 m deep in each other",
        ),
    ):
        with pytest.warns(UserWarning, match=told):
            module.simulate(1e-3, initial=start)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        module.simulate(1e-3, initial=apart)
        module.simulate(1e-3, initial={**apart, "j2_y": -0.9003})  # at rest on the floor
