"""Cuboids on each other and on capsules: slopes of the energy, stacks that rest, crossed edges, MuJoCo's verdicts."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pytest
from flying_bodies import ELASTIC, check_hit, check_slopes, depth_of, flying, state
from scipy.spatial.transform import Rotation

import eomgen as eg
from eomgen.errors import ModelError

ROD = {"shape": "capsule", "length": 0.4, "radius": 0.03}
BLOCKS = [{"shape": "cuboid", "size": (0.4, 0.2, 0.1)}, {"shape": "cuboid", "size": (0.15, 0.3, 0.2)}]
STIFF = 1e5
SOFT = {"stiffness": STIFF, "exponent": 1, "dissipation": 20.0, "friction": 0.5, "smoothing": 1e-3}


def pile(sizes: Any, law: Any, **more: Any) -> eg.Model:
    """Cuboids of 1000 kg/m^3 above ground."""
    m = eg.Model("pile", gravity=(0, 0, -9.81))
    bodies = []
    for k, size in enumerate(sizes):
        mass = 1000 * np.prod(size)
        x, y, z = (mass / 12 * side**2 for side in size)
        bodies.append(m.body(f"b{k}", mass=mass, inertia=(y + z, x + z, x + y)))
        m.free(f"j{k}", m.ground, bodies[-1], rotation="euler_parameters")
    shapes = [{"shape": "cuboid", "size": size, "on": b, **more} for size, b in zip(sizes, bodies, strict=True)]
    m.contacts("floor", shapes, {"shape": "half_space", "on": m.ground}, law)
    m.contacts("heap", shapes, law=law)
    return m


@pytest.mark.parametrize("other", [BLOCKS[1], ROD])
def test_forces_are_slopes_of_the_energy(other: dict[str, Any]) -> None:
    """In turned frames, at corners on faces and crossed edges; momentum; both targets."""
    m, (a, b) = flying(2)
    m.contacts("touch", {**BLOCKS[0], "on": a.at(0.03, 0.01, 0, rpy=(0.2, 0.5, -0.3))}, {**other, "on": b}, ELASTIC)
    mods = [m.compile(target=target) for target in ("numpy", "cython")]
    rng, met = np.random.default_rng(5), 0
    for _ in range(400):
        turns = [Rotation.random(random_state=rng.integers(1 << 30)) for _ in "ab"]
        way = rng.standard_normal(3)
        x = state(mods[0], [(0, 0, 0), rng.uniform(0.1, 0.3) * way / np.linalg.norm(way)], turns)
        if not 0.0 < mods[1].energy(x)[1] < 1.0:
            continue
        met += 1
        assert mods[0].energy(x)[1] == pytest.approx(mods[1].energy(x)[1], rel=1e-10)
        force = -mods[1].bias(0.0, x)
        assert np.abs(force[:3] + force[6:9]).max() <= 1e-12 * np.abs(force).max()
        check_slopes(mods[1], x)
        if met < 4:
            one, other_one = (mod.jacobian(0.0, x) for mod in mods)
            assert np.abs(one - other_one).max() <= 1e-9 * np.abs(other_one).max()
        if met == 12:
            break
    assert met == 12


@pytest.mark.parametrize(("sizes", "places"), [
    ([(0.2, 0.2, 0.2)] * 2, 8), ([(0.3, 0.3, 0.2), (0.2, 0.2, 0.2)], 4), ([(0.2, 0.3, 0.1), (0.3, 0.1, 0.2)], 4),
])  # fmt: skip
def test_flush_cuboids_rest_on_corners(sizes: Any, places: int) -> None:
    """The upper one sinks m g / (n k): its four corners and, where they lie on corners, those of the lower one.

    Of two that cross like planks each of four crossed edges carries a part.
    """
    m = pile(sizes, SOFT)
    mod = m.compile()
    height = sizes[0][2] + 0.5 * sizes[1][2]
    start = {"j0_z": 0.5 * sizes[0][2], "j1_z": height}
    traj = mod.simulate(1.0, initial=start, method="Radau", rtol=1e-9, atol=1e-11)
    both, upper = (1000 * 9.81 * sum(np.prod(size) for size in sizes[k:]) for k in (0, 1))
    sunk = 0.5 * sizes[0][2] - both / (4 * STIFF)
    assert traj["j0_z"][-1] == pytest.approx(sunk, abs=2e-6)
    gap = traj["j1_z"][-1] - traj["j0_z"][-1] - 0.5 * (sizes[0][2] + sizes[1][2])
    assert gap == pytest.approx(-upper / (places * STIFF), rel=1e-2)
    still = [traj[name][-1] for name in ("j0_x", "j0_y", "j1_x", "j1_y", "j1_wx", "j1_wy", "j1_wz")]
    assert np.abs(still).max() < 1e-9


def test_crossed_edges_carry_a_cuboid() -> None:
    """Two cubes turned by 45 degrees about x and about y: edge on edge, at the distance of rounded edges."""
    m, (a, b) = flying(2)
    cube = {"shape": "cuboid", "size": (0.2, 0.2, 0.2), "edge_radius": 0.01}
    m.contacts("touch", {**cube, "on": a}, {**cube, "on": b}, ELASTIC)
    mod = m.compile(target="numpy")
    inner = 0.09 * np.sqrt(2)  # to the centre line of a rounded edge
    turns = [Rotation.from_euler("x", np.pi / 4), Rotation.from_euler("y", np.pi / 4)]
    for depth in (1e-3, 4e-3):
        x = state(mod, [(0, 0, 0), (0.01, -0.02, 2 * inner + 0.02 - depth)], turns)
        assert depth_of(mod, x) == pytest.approx(depth, rel=1e-9)
        force = -mod.bias(0.0, x)
        assert force[8] == pytest.approx(2e4 * depth**1.5, rel=1e-9)


def test_a_capsule_lies_flush_on_a_cuboid() -> None:
    """On its two ends within a face, and on two edges where it reaches beyond."""
    for length in (0.2, 0.6):
        m, (b,) = flying(1, (0, 0, -9.81))
        rod = {**ROD, "length": length, "on": b.at(0, 0, 0, rpy=(0, np.pi / 2, 0))}
        m.contacts("table", {**BLOCKS[0], "on": m.ground}, rod, SOFT)
        mod = m.compile()
        traj = mod.simulate(1.0, initial={"j0_z": 0.08}, method="Radau", rtol=1e-9, atol=1e-11)
        assert traj["j0_z"][-1] == pytest.approx(0.08 - 9.81 / (2 * STIFF), abs=2e-6)
        assert np.abs(traj.x[mod.n_q :, -1]).max() < 1e-4


@pytest.mark.parametrize("other", [BLOCKS[1], ROD])
def test_lossless_hits_keep_energy_and_momentum(other: dict[str, Any]) -> None:
    m, (a, b) = flying(2)
    m.contacts("touch", {**BLOCKS[0], "on": a}, {**other, "on": b}, ELASTIC)
    check_hit(m.compile(), 0.45)


@pytest.mark.parametrize("shift", [0.0, 0.08, 0.12])
def test_rigid_stacks_stand_or_fall_as_in_mujoco(shift: float) -> None:
    """The upper of two cubes of 0.2 m beyond the edge by less or more than half."""
    world = "".join(
        f'<body pos="{k * shift} 0 {0.1 + 0.2 * k}"><freejoint/><geom type="box" size="0.1 0.1 0.1" mass="8"/></body>'
        for k in range(2)
    )
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="1e-3"/><worldbody><geom type="plane" size="5 5 1"/>{world}</worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    for _ in range(600):
        mujoco.mj_step(model, data)
    m = pile([(0.2, 0.2, 0.2)] * 2, {"normal_law": "rigid", "friction": 1.0})
    mod = m.compile()
    start = {"j0_z": 0.1, "j1_z": 0.3, "j1_x": shift}
    traj = mod.simulate(0.6, initial=start, method="moreau", step=2e-3)
    falls = data.qpos[9] < 0.29
    assert falls == (shift > 0.1)
    assert (traj["j1_z"][-1] < 0.29) == falls
    if not falls:
        np.testing.assert_allclose([traj["j0_z"][-1], traj["j1_z"][-1]], [0.1, 0.3], atol=1e-9)
        np.testing.assert_allclose(data.qpos[[2, 9]], [0.1, 0.3], atol=2e-3)


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"edge_radius": 0}, "edge_radius: is 0; must be greater than 0"),
        ({"edge_radius": 0.06}, "edge_radius: is 0.06; must be less than half of its least length, 0.05"),
        ({"size": (1, 2)}, "three numbers"),
    ],
)
def test_what_is_wrong_is_told(given: dict[str, Any], told: str) -> None:
    m, (a, b) = flying(2)
    m.contacts("touch", {**BLOCKS[0], **given, "on": a}, {**BLOCKS[1], "on": b}, ELASTIC)
    with pytest.raises(ModelError, match=told):
        m.mechanism()


def test_bristles_between_edges_are_refused() -> None:
    m, (a, b) = flying(2)
    law = {"stiffness": 1e4, "friction": 0.5, "friction_law": "lugre", "bristle_stiffness": 1e3, "bristle_damping": 1.0}
    m.contacts("touch", {**BLOCKS[0], "on": a}, {**BLOCKS[1], "on": b}, law)
    with pytest.raises(ModelError, match="cuboid and cuboid have no states where their edges meet"):
        m.mechanism()
