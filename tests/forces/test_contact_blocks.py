"""Ellipsoids on cuboids: known normals, the greatest gap found otherwise, spheres, half-spaces, MuJoCo, runs, rest."""

from __future__ import annotations

import itertools
from typing import Any

import mujoco
import numpy as np
import pytest
from flying_bodies import ELASTIC, check_hit, check_slopes, depth_of, flying, state
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

import eomgen as eg

AXES = np.array((0.2, 0.1, 0.08))
HALVES = np.array((0.15, 0.1, 0.25))
EGG: dict[str, Any] = {"shape": "ellipsoid", "semi_axes": tuple(AXES)}
BLOCK: dict[str, Any] = {"shape": "cuboid", "size": tuple(2 * HALVES)}
AT, OWN = np.array((0.03, 0.01, 0)), Rotation.from_euler("xyz", (0.2, 0.5, -0.3))


def on(body: Any) -> Any:
    return body.at(*AT, rpy=(0.2, 0.5, -0.3))


def deepest(turn: Rotation, n: np.ndarray) -> np.ndarray:
    """The point of the ellipsoid that is farthest against a direction, from its centre."""
    local = turn.inv().apply(-n)
    return turn.apply(AXES**2 * local / np.linalg.norm(AXES * local))


@pytest.mark.parametrize("swapped", [False, True])
def test_faces_edges_and_corners_of_known_normal(swapped: bool) -> None:
    """A point of a face, an edge or a corner, and a normal there: the ellipsoid is put so that it overlaps there."""
    m, (a, b) = flying(2)
    groups = [{**BLOCK, "on": on(a)}, {**EGG, "on": b}]
    m.contacts("touch", *(groups[::-1] if swapped else groups), ELASTIC)
    mods = [m.compile(target=target) for target in ("numpy", "cython")]
    rng = np.random.default_rng(1)
    for k in range(48):
        turns = [Rotation.random(random_state=rng.integers(1 << 30)) for _ in "ab"]
        free = rng.permutation(3)[: k % 3 + 1]
        n = np.zeros(3)
        n[free] = rng.standard_normal(k % 3 + 1)
        n /= np.linalg.norm(n)
        spot = np.where(n != 0, np.sign(n), rng.uniform(-1, 1, 3)) * HALVES
        depth = rng.uniform(1e-4, 3e-3)
        frame = turns[0] * OWN
        out = frame.apply(n)
        place = turns[0].apply(AT) + frame.apply(spot) - deepest(turns[1], out) - depth * out
        x = state(mods[0], [(0, 0, 0), place], turns)
        for mod in mods:
            assert depth_of(mod, x) == pytest.approx(depth, abs=1e-12)
            force, push = -mod.bias(0.0, x), 2e4 * depth**1.5
            np.testing.assert_allclose(force[6:9], push * out, atol=1e-7 * push)
            assert np.abs(force[:3] + force[6:9]).max() <= 1e-12 * push
        if k < 3:
            check_slopes(mods[1], x)
            one, other = (mod.jacobian(0.0, x) for mod in mods)
            assert np.abs(one - other).max() <= 1e-9 * np.abs(other).max()
            steps = 1e-7 * np.eye(mods[1].n_x)[: mods[1].n_q]
            slopes = np.array([(mods[1].rhs(0.0, x + e) - mods[1].rhs(0.0, x - e)) / 2e-7 for e in steps]).T
            assert np.abs(slopes - other[:, : mods[1].n_q]).max() <= 1e-5 * np.abs(slopes).max()
        apart = state(mods[0], [(0, 0, 0), place + 1.001 * depth * out], turns)
        assert all(mod.energy(apart)[1] == 0.0 for mod in mods)


def strata() -> list[np.ndarray]:
    """Directions by the signs of their parts: of faces, of edges and of corners of a cuboid."""
    arc = np.pi / 2 * (np.arange(16) + 0.5) / 16
    flat, up = (x.ravel() for x in np.meshgrid(arc, arc))
    nets = {1: np.ones((1, 1)), 2: np.column_stack([np.cos(arc), np.sin(arc)])}
    nets[3] = np.column_stack([np.cos(flat) * np.cos(up), np.sin(flat) * np.cos(up), np.sin(up)])
    found = []
    for signs in itertools.product((-1, 0, 1), repeat=3):
        s = np.array(signs)
        if s.any():
            net = nets[np.abs(s).sum()]
            found.append(np.zeros((len(net), 3)))
            found[-1][:, s != 0] = s[s != 0] * net
    return found


STRATA = strata()


def greatest_gap(place: np.ndarray, turn: Rotation) -> float:
    """The maximum of n r - sum |n| h - |diag(a) R^T n| over directions, searched in strata of signs from nets there."""
    scaled = turn.as_matrix() * AXES

    def gaps(n: np.ndarray) -> np.ndarray:
        size = np.sqrt((n * n).sum(axis=-1))
        found: np.ndarray = (n @ place - np.abs(n) @ HALVES - np.sqrt(((n @ scaled) ** 2).sum(axis=-1))) / size
        return found

    starts = [max(zip(gaps(net), net.tolist(), strict=True)) for net in STRATA]
    best = -np.inf
    for gap, at in sorted(starts)[-4:]:
        n = np.array(at)
        met, signs = n != 0, np.sign(n)

        def lost(w: np.ndarray, signs: np.ndarray = signs, met: np.ndarray = met) -> float:
            n = np.zeros(3)
            n[met] = signs[met] * np.abs(w)
            return float(-gaps(n))

        if met.sum() > 1:
            gap = -minimize(lost, np.abs(n[met]), method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-13}).fun
        best = max(best, float(gap))
    return best


def test_the_greatest_gap_that_a_search_finds() -> None:
    """At random places; and forces are slopes of the energy on faces, edges and corners, and between them."""
    m, (a, b) = flying(2)
    m.contacts("touch", {**BLOCK, "on": a}, {**EGG, "on": b}, ELASTIC)
    mod = m.compile()
    rng, met = np.random.default_rng(2), 0
    while met < 24:
        turn = Rotation.random(random_state=rng.integers(1 << 30))
        place = rng.uniform(-1, 1, 3) * (HALVES + 0.2)
        x = state(mod, [(0, 0, 0), place], [Rotation.identity(), turn])
        depth = depth_of(mod, x)
        if not 0.0 < depth < 0.03:  # of the least radius of curvature, 0.032
            continue
        met += 1
        assert depth == pytest.approx(-greatest_gap(place, turn), abs=1e-9)
        if met < 10:
            check_slopes(mod, x)


def test_depth_and_force_are_continuous_around_a_corner() -> None:
    """Along a way over a face, an edge and a corner each step changes depth and force as its length says."""
    m, (a, b) = flying(2)
    m.contacts("touch", {**BLOCK, "on": a}, {**EGG, "on": b}, ELASTIC)
    mod = m.compile()
    turn = Rotation.from_euler("xyz", (0.4, 0.3, 0.2))
    way = [(0.0, 0.0, 0.335), (0.235, 0.0, 0.315), (0.275, 0.155, 0.285), (0.115, 0.21, 0.22), (-0.2, 0.205, 0.1)]
    lines = itertools.pairwise(np.array(way))
    places = np.concatenate([np.linspace(p, q, 500, endpoint=False) for p, q in lines])
    found = []
    for place in places:
        x = state(mod, [(0, 0, 0), place], [Rotation.identity(), turn])
        found.append([depth_of(mod, x), *-mod.bias(0.0, x)[6:9]])
    depths = np.array(found)
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    met = (depths[:-1, 0] > 0) & (depths[1:, 0] > 0)
    assert met.sum() > 700
    assert (np.abs(np.diff(depths[:, 0]))[met] <= 1.001 * steps[met]).all()
    push = np.linalg.norm(depths[:, 1:], axis=1)
    turned = depths[:, 1:] / np.maximum(push, 1e-300)[:, None]
    change = np.linalg.norm(np.diff(turned, axis=0), axis=1)[met] / steps[met]
    assert change.max() < 1.01 / (0.08**2 / 0.2 - depths[:, 0].max())  # of the least radius of curvature
    zeros = (np.abs(turned) < 1e-9).sum(axis=1)[depths[:, 0] > 0]
    assert {*zeros} >= {0, 1, 2}  # corner, edge, face


def test_an_ellipsoid_of_equal_axes_is_a_sphere() -> None:
    """Outside and with its centre inside; with friction, in turned frames."""
    mods = []
    for shape in ({"shape": "sphere", "radius": 0.1}, {"shape": "ellipsoid", "semi_axes": (0.1, 0.1, 0.1)}):
        m, (a, b) = flying(2)
        law = {**ELASTIC, "friction": 0.3, "smoothing": 0.01, "dissipation": 0.4}
        m.contacts("touch", {**BLOCK, "on": on(a)}, {**shape, "on": b}, law)
        mods.append(m.compile(target="numpy"))
    rng, met = np.random.default_rng(7), 0
    for _ in range(300):
        turns = [Rotation.random(random_state=rng.integers(1 << 30)) for _ in "ab"]
        x = state(mods[0], [(0, 0, 0), rng.uniform(-0.3, 0.3, 3)], turns)
        x[mods[0].n_q :] = rng.standard_normal(12)
        one, other = (mod.rhs(0.0, x) for mod in mods)
        met += np.abs(one[14:17]).max() > 0
        np.testing.assert_allclose(other, one, rtol=1e-9, atol=1e-9 * np.abs(one).max())
    assert met > 100


def test_a_huge_cuboid_is_a_half_space() -> None:
    mods = []
    for ground, at in (({"shape": "half_space"}, 0.0), ({"shape": "cuboid", "size": (40, 30, 10)}, -5.0)):
        m, (a,) = flying(1)
        law = {**ELASTIC, "friction": 0.3, "smoothing": 0.01}
        m.contacts("touch", {**ground, "on": m.ground.at(0, 0, at)}, {**EGG, "on": on(a)}, law)
        mods.append(m.compile(target="numpy"))
    rng = np.random.default_rng(9)
    for _ in range(100):
        turn = Rotation.random(random_state=rng.integers(1 << 30))
        x = state(mods[0], [(rng.uniform(-3, 3), rng.uniform(-3, 3), rng.uniform(0.0, 0.1))], [turn])
        x[7:] = rng.standard_normal(6)
        one, other = (mod.rhs(0.0, x) for mod in mods)
        np.testing.assert_allclose(other, one, rtol=1e-9, atol=1e-9 * np.abs(one).max())


def test_a_mirrored_scene_has_the_mirrored_force() -> None:
    m, (a, b) = flying(2)
    m.contacts("touch", {**BLOCK, "on": a}, {**EGG, "on": b}, ELASTIC)
    mod = m.compile()
    rng, met, mirror = np.random.default_rng(4), 0, np.array((-1.0, 1.0, 1.0))
    while met < 20:
        turn = Rotation.random(random_state=rng.integers(1 << 30))
        place = rng.uniform(-0.35, 0.35, 3)
        R = turn.as_matrix()
        other = Rotation.from_matrix(np.diag(mirror) @ R @ np.diag(mirror))
        forces = [
            -mod.bias(0.0, state(mod, [(0, 0, 0), p], [Rotation.identity(), t]))[6:9]
            for p, t in ((place, turn), (mirror * place, other))
        ]
        if not 0.0 < depth_of(mod, state(mod, [(0, 0, 0), place], [Rotation.identity(), turn])) < 0.03:
            continue
        met += 1
        np.testing.assert_allclose(forces[1], mirror * forces[0], rtol=1e-7, atol=1e-7 * np.abs(forces[0]).max())


def test_depth_and_normal_as_in_mujoco() -> None:
    """Random overlaps of up to 3 mm: the depth to 1e-5 m and the normal to 0.01."""
    xml = f"""<mujoco><option ccd_tolerance="1e-10" ccd_iterations="500"/><worldbody>
    <body><freejoint/><geom type="box" size="{HALVES[0]} {HALVES[1]} {HALVES[2]}" mass="1"/></body>
    <body><freejoint/><geom type="ellipsoid" size="{AXES[0]} {AXES[1]} {AXES[2]}" mass="1"/></body>
    </worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    m, (a, b) = flying(2)
    m.contacts("touch", {**BLOCK, "on": a}, {**EGG, "on": b}, ELASTIC)
    mod = m.compile()
    rng, met = np.random.default_rng(6), 0
    while met < 60:
        turns = [Rotation.random(random_state=rng.integers(1 << 30)) for _ in "ab"]
        place = turns[0].apply(rng.uniform(-1, 1, 3) * (HALVES + 0.2))
        x = state(mod, [(0, 0, 0), place], turns)
        depth = depth_of(mod, x)
        if not 1e-4 < depth < 3e-3:
            continue
        met += 1
        for k, (at, turn) in enumerate(zip(((0, 0, 0), place), turns, strict=True)):
            q = turn.as_quat()
            data.qpos[7 * k : 7 * k + 7] = [*at, q[3], *q[:3]]
        mujoco.mj_forward(model, data)
        assert data.ncon == 1
        assert -data.contact[0].dist == pytest.approx(depth, abs=1e-5)
        force = -mod.bias(0.0, x)[6:9]
        found = data.contact[0].frame[:3] * (1 if data.contact[0].geom[0] == 0 else -1)
        assert np.abs(found - force / np.linalg.norm(force)).max() < 1e-2


@pytest.mark.parametrize("order", [1, -1])
def test_lossless_hits_keep_energy_and_momentum(order: int) -> None:
    m, bodies = flying(2)
    first, second = bodies[::order]
    m.contacts("touch", {**BLOCK, "on": first}, {**EGG, "on": second}, ELASTIC)
    check_hit(m.compile(), 0.45)


def test_an_ellipsoid_rolls_to_rest_on_a_cuboid_and_falls_over_its_edge() -> None:
    """At rest its least axis is upright and it sinks in by m g / k; pushed over the edge it falls."""
    m = eg.Model("table", gravity=(0, 0, -9.81))
    body = m.body("b", mass=2.0, inertia=(0.0066, 0.0186, 0.02))
    m.free("j", m.ground, body, rotation="euler_parameters")
    law = {"stiffness": 1e5, "exponent": 1, "dissipation": 2.0, "friction": 0.5, "smoothing": 1e-3}
    m.contacts("touch", {**BLOCK, "on": m.ground}, {**EGG, "on": body}, law)
    mod = m.compile()
    traj = mod.simulate(6.0, initial={"j_z": 0.35, "j_wx": 2.0}, method="Radau", rtol=1e-6)
    assert traj["j_z"][-1] == pytest.approx(0.25 + 0.08 - 2 * 9.81 / 1e5, abs=1e-3)
    traj = mod.simulate(1.0, initial={"j_z": 0.33, "j_x_dot": 1.5})
    assert traj["j_z"][-1] < 0.0


def test_a_rigid_ellipsoid_comes_to_rest_on_a_cuboid() -> None:
    m = eg.Model("table", gravity=(0, 0, -9.81))
    body = m.body("b", mass=2.0, inertia=(0.0066, 0.0186, 0.02))
    m.free("j", m.ground, body, rotation="euler_parameters")
    m.contacts("touch", {**BLOCK, "on": m.ground}, {**EGG, "on": body}, {"normal_law": "rigid", "friction": 0.5})
    traj = m.compile().simulate(0.5, initial={"j_z": 0.34}, method="moreau", step=1e-3)
    assert traj["j_z"][-1] == pytest.approx(0.33, abs=1e-6)
    assert np.abs(traj.x[7:, -1]).max() < 1e-6


def test_bristles_of_an_ellipsoid_on_a_cuboid() -> None:
    """They hold it on a slope on which it stands upright in a guide."""
    m = eg.Model("slope", gravity=(9.81 * np.sin(0.2), 0, -9.81 * np.cos(0.2)))
    body = m.body("b", mass=2.0, inertia=(0.01, 0.01, 0.01))
    m.translational("j", m.ground, body)
    law = {
        "stiffness": 1e5, "exponent": 1, "dissipation": 2.0, "friction": 0.4,
        "friction_law": "lugre", "bristle_stiffness": 1e4, "bristle_damping": 50.0,
    }  # fmt: skip
    m.contacts("touch", {**EGG, "on": body}, {**BLOCK, "on": m.ground}, law)
    mod = m.compile()
    assert [name for name in mod.x_names if "bristle" in name] == [f"touch_bristle_{k}_1" for k in "xyz"]
    traj = mod.simulate(11.0, initial={"j_z": 0.33}, method="Radau", t_eval=[0, 1, 11])
    assert abs(traj["j_x"][2] - traj["j_x"][1]) < 1e-8
    bent = np.tan(0.2) / 1e4 * np.sqrt(1e4 * 2 * 9.81 * np.cos(0.2))
    assert abs(traj["touch_bristle_x_1"][2]) == pytest.approx(bent, rel=1e-6)
