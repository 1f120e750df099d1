"""Runs with contacts step over none and tell deep starts; states of pairs: names, laws, derivatives, several sides."""

import itertools
import warnings
from functools import cache
from typing import Any

import contact_scenes as scenes
import numpy as np
import pytest
from contact_scenes import ELASTIC, LAW, PLANAR, flying, on
from judges import differences
from models import IN_C
from refusals import refuses
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


@pytest.mark.parametrize("target", part_of(["numpy", "cython"], ("numpy",).__contains__))
def test_the_deepest_pair_is_reported(target: str) -> None:
    """Of a box and two circles, all in one group, on a floor."""
    m, bodies = scenes.planar("deep", 3)
    shapes = [on(PLANAR[kind], body) for kind, body in zip(("box", "circle", "circle"), bodies, strict=True)]
    m.contacts("heap", shapes, law=ELASTIC)
    m.contacts("floor", shapes, {"shape": "half_plane", "on": m.ground.at(0, -1, 0)}, LAW)
    module = m.compile(target=target)
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


LUGRE = {
    "stiffness": 1e5, "exponent": 1.0, "friction": 0.3, "friction_law": "lugre",
    "bristle_stiffness": 1e3, "bristle_damping": 30.0,
}  # fmt: skip


def pair(first: dict[str, Any], second: dict[str, Any], swapped: bool = False, **law: Any) -> eg.Model:
    m, (a, b) = scenes.planar("pair", 2, (0, 0, 0))
    groups = [on(first, a), on(second, b)]
    m.contacts("touch", *(groups[::-1] if swapped else groups), {**LUGRE, **law})
    return m


@pytest.mark.parametrize(("kind", "corners"), [("circle", 1), ("box", 2), ("polygon", 2), ("segment", 4)])
def test_one_pair_has_one_set_of_states(kind: str, corners: int) -> None:
    """Of circles one; of polygons both ends of the edges that face each other; of segments each end with the other."""
    names = pair(PLANAR[kind], PLANAR[kind]).compile(target="numpy").x_names[12:]
    wanted = [f"touch_bristle_{axis}_{k + 1}" for k in range(corners) for axis in "xz"]
    assert list(names) == wanted


def test_bristles_take_nothing_from_the_energy_of_the_contact() -> None:
    """k d^(n+1) / (n+1) of a circle in a half-plane."""
    m, (body,) = scenes.planar("one", 1, (0, 0, 0))
    law = {**LUGRE, "exponent": 1.5}
    m.contacts("touch", {"shape": "circle", "on": body, "radius": 0.1}, {"shape": "half_plane", "on": m.ground}, law)
    mod = m.compile(target="numpy")
    assert mod.energy(mod.x0(j0_y=0.09))[1] == pytest.approx(1e5 * 0.01**2.5 / 2.5, rel=1e-12)
    assert mod.energy(mod.x0(j0_y=0.11))[1] == 0.0


@pytest.mark.parametrize(
    ("kinds", "target"),
    [(("box", "box"), "numpy"), pytest.param(("segment", "polygon"), "cython", marks=pytest.mark.thorough)],
    ids=["boxes", "compiled"],
)
def test_derivatives_by_states_and_of_their_rates(kinds: tuple[str, str], target: str) -> None:
    mod = pair(PLANAR[kinds[0]], PLANAR[kinds[1]]).compile(target=target)
    rng, met = np.random.default_rng(4), 0
    for _ in range(60):
        x = np.concatenate(
            [rng.uniform(-0.15, 0.15, 6), rng.standard_normal(6), 1e-4 * rng.standard_normal(mod.n_x - 12)]
        )
        rates = mod.rhs(0.0, x)
        if not np.abs(rates[6:12]).max():
            continue
        found, wanted = mod.jacobian(0.0, x), differences(mod, x)
        if np.abs(wanted - differences(mod, x, 2e-7)).max() > 1e-5 * np.abs(wanted).max():
            continue  # at a kink
        met += 1
        np.testing.assert_allclose(found, wanted, rtol=1e-5, atol=1e-6 * np.abs(wanted).max())
        assert np.abs(found[6:12, 12:]).max() > 0
        if met == 5:
            return
    raise AssertionError("too few met")


def test_bristles_act_as_one_law_says() -> None:
    """A circle that slides on a box: z' and the force in closed form; an untouched bristle springs back."""
    mod = pair(PLANAR["box"], PLANAR["circle"]).compile(target="numpy")
    names = list(mod.x_names)
    R, size = PLANAR["circle"]["radius"], PLANAR["box"]["size"]
    depth, v, z = 1e-3, 0.02, 1e-4
    x = mod.x0(j1_y=size[1] / 2 + R - depth, j1_x_dot=v)
    place = names.index("touch_bristle_x_1")
    root = np.sqrt(1e3 * 1e5 * depth)  # of the stiffness of the bristles
    x[place] = root * z
    rates = mod.rhs(0.0, x)
    change = v - 1e3 * v / 0.3 * z
    assert rates[place] == pytest.approx(root * change, rel=1e-12)
    mass_force = -mod.bias(0.0, x)[:12]
    assert abs(mass_force[3]) == pytest.approx(1e5 * depth * (1e3 * z + 30.0 * change), rel=1e-12)
    x = mod.x0(j1_y=1.0, j1_x_dot=v)
    x[place] = z
    assert mod.rhs(0.0, x)[place] == pytest.approx(-1e3 / 30.0 * z, rel=1e-12)


def test_order_of_groups_and_one_state_along_the_surface() -> None:
    values = []
    for swapped in (False, True):
        for lateral in (True, False):
            m = pair(PLANAR["box"], PLANAR["circle"], swapped, lateral=lateral)
            mod = m.compile(target="numpy")
            x = mod.x0(j1_x=0.03, j1_y=0.14, j1_x_dot=0.3, j1_3_dot=1.0)
            along = 12
            assert mod.x_names[along] == ("touch_bristle_x_1" if lateral else "touch_bristle_1")
            x[along] = 2e-4
            values.append(mod.rhs(0.0, x)[:12])
    assert np.abs(values[0]).max() > 1.0
    for other in values[1:]:
        np.testing.assert_allclose(other, values[0], rtol=1e-12, atol=1e-12)


TROUGH = np.array([[-1.0, 1.0], [-0.05, 0.0], [0.05, 0.0], [1.0, 0.7]])
WHEEL = 0.2


def in_trough() -> eg.Model:
    m, (a,) = scenes.planar("trough", 1, (0, 0, 0))
    valley = {"shape": "profile", "points": TROUGH.tolist(), "on": m.ground}
    m.contacts("touch", valley, {"shape": "circle", "on": a, "radius": WHEEL}, {**LUGRE, "lateral": False})
    return m


def flanks(place: np.ndarray) -> list[tuple[np.ndarray, np.ndarray, float]]:
    """Direction, normal and penetration of a circle at both sides of the trough."""
    found = []
    for a, b in ((TROUGH[0], TROUGH[1]), (TROUGH[2], TROUGH[3])):
        t = (b - a) / np.linalg.norm(b - a)
        n = np.array([-t[1], t[0]])
        found.append((t, n, WHEEL - n @ (place - a)))
    return found


def test_a_wheel_between_two_sides_bends_one_state_by_both() -> None:
    """A wheel that bridges the floor: e' has the power of both sides, and their mean decay by normal forces.

    It decays faster where the damping of one side gives more than that.
    """
    mod = in_trough().compile(target="numpy")
    rng, both, faster = np.random.default_rng(2), 0, 0
    mass = np.linalg.inv(mod.mass_matrix(np.array([0.0, 2.0, 0.0])))
    for _ in range(200):
        place = np.array([rng.uniform(-0.01, 0.03), rng.uniform(0.2, 0.22)])
        sides = flanks(place)
        if min(depth for *_, depth in sides) <= 0 or place[1] < WHEEL:
            continue
        both += 1
        v, turn, e = rng.standard_normal(2), rng.standard_normal(), 0.1 * rng.standard_normal()
        x = mod.x0(j0_x=place[0], j0_y=place[1], j0_x_dot=v[0], j0_y_dot=v[1], j0_3_dot=turn)
        x[6] = e
        force, drive, decay, load, needed = np.zeros(3), 0.0, 0.0, 0.0, 0.0
        for t, n, depth in sides:
            arm = -(WHEEL - 0.5 * depth)
            slip = t @ v - arm * turn
            push = 1e5 * depth
            m = min(np.sqrt(1e3 * push), 0.3 * push / abs(e))
            own = 1e3 * abs(slip) / 0.3
            damped = 30.0 / 1e3 * (m * slip - own * e)
            gain = -m * damped * slip / e**2
            drag = -m * (e + damped * min(1.0, own / gain if gain > 0 else 1.0))
            drive, decay, load = drive + m * slip, decay + push * own, load + push
            needed += max(0.0, min(gain, own))
            force += [*(1e5 * depth * n + drag * t), -arm * drag]
        found = mod.rhs(0.0, x)
        faster += needed > decay / load
        assert found[6] == pytest.approx(drive - max(decay / load, needed) * e, rel=1e-9, abs=1e-12)
        np.testing.assert_allclose(found[3:6], mass @ force, rtol=1e-9, atol=1e-8 * np.abs(force).max())
    assert both > 20
    assert 0 < faster < both


def test_lateral_belongs_to_states() -> None:
    m, (a,) = scenes.planar("road", 1)
    ground = {"shape": "half_plane", "on": m.ground}
    law = {"stiffness": 1e5, "lateral": False}
    m.contacts("touch", {"shape": "circle", "on": a, "radius": 0.1}, ground, law)
    refuses("EG-CONFLICT contacts.touch.law.lateral: lugre", m.derive)


def test_too_many_pairs_with_states_are_refused() -> None:
    m, (a, b) = scenes.planar("crowd", 2)
    groups = [{"shape": "circle", "on": [body.at(k, 0, 0) for k in range(45)], "radius": 0.1} for body in (a, b)]
    m.contacts("touch", *groups, LUGRE)
    refuses("EG-TOO-LARGE contacts.touch 2025 2000", m.derive)
