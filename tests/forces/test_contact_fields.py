"""Height fields: planes and spheres of known distance, bowls of known periods, tables, runs, what is wrong."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pytest
from flying_bodies import ELASTIC, check_slopes, depth_of, flying, state
from scipy.spatial.transform import Rotation
from sweeps import part_of

import eomgen as eg
from eomgen.errors import ModelError

TURNED = Rotation.from_euler("xyz", (0.4, -0.8, 1.1))
FELT = {"stiffness": 2e4, "dissipation": 0.2, "friction": 0.3, "smoothing": 1e-2}
SHAPES: dict[str, dict[str, Any]] = {
    "sphere": {"shape": "sphere", "radius": 0.1},
    "ellipsoid": {"shape": "ellipsoid", "semi_axes": (0.2, 0.1, 0.05)},
    "cuboid": {"shape": "cuboid", "size": (0.4, 0.2, 0.1)},
    "capsule": {"shape": "capsule", "length": 0.4, "radius": 0.05},
}
GRID = np.linspace(-2.0, 2.0, 17)
WAVES = 0.1 * np.sin(2.0 * GRID)[:, None] * np.cos(1.5 * GRID)[None, :]


def ground(height: str, **on: Any) -> dict[str, Any]:
    return {"shape": "height_field", "height": height, **on}


@pytest.mark.parametrize("kind", SHAPES)
def test_a_plane_turned_any_way(kind: str) -> None:
    """A field that rises as a plane does is a half-space, also where shapes sink in deeply."""
    base = {"rpy": tuple(TURNED.as_euler("xyz"))}
    slope = np.array([0.3, -0.2])
    normal = np.array([*-slope, 1.0]) / np.sqrt(1 + slope @ slope)
    along = np.cross((0, 1.0, 0), normal)
    along /= np.linalg.norm(along)
    tilt = Rotation.from_matrix(np.column_stack([along, np.cross(normal, along), normal]))
    found = []
    for flat in (False, True):
        m, (body,) = flying(1)
        m.parameter("rise", 0.3)
        if flat:
            frame = {"rpy": tuple((TURNED * tilt).as_euler("xyz"))}
            floor = {"shape": "half_space", "on": m.ground.at(*TURNED.apply((0, 0, 0.05)), **frame)}
        else:
            floor = ground("0.05 + rise*x - 0.2*y", on=m.ground.at(0, 0, 0, **base))
        m.contacts("touch", {**SHAPES[kind], "on": body.at(0.02, 0, 0.01)}, floor, FELT)
        mod = m.compile(target="numpy")
        rng, rows = np.random.default_rng(4), []
        for _ in range(12):
            place = TURNED.apply([*rng.uniform(-1, 1, 2), 0]) + rng.uniform(-0.1, 0.25) * TURNED.apply(normal)
            x = state(mod, [place], [Rotation.random(random_state=rng.integers(1 << 30))])
            x[mod.n_q :] = rng.uniform(-1, 1, 6)
            rows.append([*mod.rhs(0.0, x), *mod.jacobian(0.0, x).ravel()])
        found.append(np.array(rows))
    assert np.abs(found[1]).max() > 100.0
    np.testing.assert_allclose(found[0], found[1], rtol=1e-9, atol=1e-9 * np.abs(found[1]).max())


@pytest.mark.parametrize("hollow", [False, True])
def test_a_dome_and_a_bowl(hollow: bool) -> None:
    """The depth of a sphere on and in a sphere, in turned frames, and forces as slopes of the energy."""
    sign = -1.0 if hollow else 1.0
    m, (a, b) = flying(2)
    height = f"{-sign}*big + {sign}*sqrt(big**2 - x**2 - y**2)"
    m.parameter("big", 1.0)
    m.contacts("touch", {**SHAPES["sphere"], "on": b}, ground(height, on=a.at(0.1, 0, 0)), ELASTIC)
    mods = [m.compile(target=target) for target in ("numpy", "cython")]
    rng = np.random.default_rng(7)
    for k in range(20):
        way = np.array([*rng.uniform(-0.4, 0.4, 2), sign])
        way /= np.linalg.norm(way)
        centre = np.array([0.1, 0, -sign]) + (1.0 + sign * rng.uniform(0.02, 0.095)) * way
        x = state(mods[0], [(0.3, 0.1, 0), TURNED.apply(centre) + np.array([0.3, 0.1, 0])], [TURNED, TURNED])
        depth = 0.1 - sign * (np.linalg.norm(centre - [0.1, 0, -sign]) - 1.0)
        for mod in mods:
            assert depth_of(mod, x) == pytest.approx(depth, rel=1e-10)
        force = -mods[0].bias(0.0, x)
        assert np.abs(force[:3] + force[6:9]).max() <= 1e-12 * np.abs(force).max()
        if k < 3:
            check_slopes(mods[0], x)
            one, other = (mod.jacobian(0.0, x) for mod in mods)
            assert np.abs(one - other).max() <= 1e-9 * np.abs(other).max()


def test_an_ellipsoid_on_a_dome_is_one_on_a_sphere() -> None:
    found = []
    for other in ({"shape": "sphere", "radius": 1.0}, ground("-1 + sqrt(1 - x**2 - y**2)")):
        m, (a, b) = flying(2)
        at = {} if other["shape"] == "sphere" else {"on": a.at(0, 0, 1.0)}
        m.contacts("touch", {**SHAPES["ellipsoid"], "on": b}, {"on": a, **other, **at}, FELT)
        mod = m.compile(target="numpy")
        rng, rows = np.random.default_rng(5), []
        for _ in range(15):
            way = np.array([*rng.uniform(-0.3, 0.3, 2), 1.0])
            place = way / np.linalg.norm(way) * rng.uniform(1.02, 1.1)
            x = state(mod, [(0, 0, 0), place], [Rotation.identity(), Rotation.random(random_state=rng.integers(99))])
            x[mod.n_q :] = rng.uniform(-1, 1, 12)
            rows.append([*mod.rhs(0.0, x), *mod.jacobian(0.0, x).ravel()])
        found.append(np.array(rows))
    assert np.abs(found[0]).max() > 100.0
    np.testing.assert_allclose(found[1], found[0], rtol=1e-7, atol=1e-9 * np.abs(found[0]).max())


@pytest.mark.parametrize("rolls", [False, True])
def test_small_oscillations_in_a_bowl(rolls: bool) -> None:
    """A table of a paraboloid of radius R at its lowest point: (g / (R - r))^(1/2), of a ball that rolls (5/7) of g."""
    big, r, m = 1.0, 0.2, eg.Model("bowl", gravity=(0, 0, -9.81))
    ball = m.body("ball", mass=1.0, inertia=(0.4 * r * r,) * 3)
    m.free("j", m.ground, ball, rotation="euler_parameters")
    x = np.linspace(-0.5, 0.5, 9)
    bowl = {"shape": "height_field", "on": m.ground, "x": x, "y": x, "z": (x[:, None] ** 2 + x**2) / (2 * big)}
    law = {"stiffness": 1e7, "exponent": 1, "dissipation": 1.0}
    law |= {"friction": 0.9, "smoothing": 1e-5} if rolls else {}
    m.contacts("bowl", {"shape": "sphere", "on": ball, "radius": r}, bowl, law)
    mod = m.compile()
    start = 2e-3
    rate = np.sqrt(9.81 / (big - r) * (5 / 7 if rolls else 1.0))
    half = np.pi / rate
    fall = -9.81 / 1e7
    lifted = start**2 / (2 * (big - r)) + r + fall
    traj = mod.simulate((0, half), initial={"j_x": start, "j_z": lifted}, method="Radau", rtol=1e-9, atol=1e-12)
    assert traj["j_x"][-1] == pytest.approx(-start, rel=2e-3)
    mid = mod.simulate((0, half / 2), initial={"j_x": start, "j_z": lifted}, method="Radau", rtol=1e-9, atol=1e-12)
    assert abs(mid["j_x"][-1]) < 2e-3 * start
    assert abs(mid["j_x_dot"][-1]) == pytest.approx(start * rate, rel=2e-3)


def waves(shape: dict[str, Any], law: Any = FELT, gravity: Any = (0, 0, -9.81), height: str = "amp*land(x, y)") -> Any:
    m, (body,) = flying(1, gravity)
    m.parameter("amp", 1.0)
    m.table("land", GRID, GRID, WAVES)
    m.contacts("floor", {**shape, "on": body}, ground(height, on=m.ground.at(0, 0, 0.1)), law)
    return m


@pytest.mark.parametrize("kind", part_of(SHAPES, ("sphere", "cuboid").__contains__))
def test_derivatives_parameters_and_targets(kind: str) -> None:
    """The Jacobian beside differences, a parameter given late beside one given at once, both targets, a file."""
    m = waves(SHAPES[kind])
    mods = [m.compile(), m.compile(target="numpy")]
    other = waves(SHAPES[kind], height="1.3*land(x, y)").compile(target="numpy")
    rng, felt = np.random.default_rng(9), 0
    for _ in range(8):
        turn = Rotation.random(random_state=rng.integers(1 << 30))
        x = state(mods[0], [(*rng.uniform(-1.5, 1.5, 2), rng.uniform(0.1, 0.2))], [turn])
        x[mods[0].n_q :] = rng.uniform(-1, 1, 6)
        value, jacobian = (np.array(mods[0].rhs(0.0, x)), mods[0].jacobian(0.0, x))
        np.testing.assert_allclose(mods[1].rhs(0.0, x), value, rtol=1e-9, atol=1e-9 * np.abs(value).max())
        np.testing.assert_allclose(mods[1].jacobian(0.0, x), jacobian, atol=1e-9 * np.abs(jacobian).max())
        h = 1e-6
        steps = h * np.eye(len(x))
        slopes = np.array([(mods[0].rhs(0.0, x + e) - mods[0].rhs(0.0, x - e)) / (2 * h) for e in steps]).T
        felt += np.abs(slopes).max() > 1e3
        np.testing.assert_allclose(jacobian, slopes, atol=1e-6 * np.abs(slopes).max())
        late = mods[0].rhs(0.0, x, p={"amp": 1.3})
        np.testing.assert_allclose(late, other.rhs(0.0, x), rtol=1e-9, atol=1e-9 * np.abs(value).max())
    assert felt >= 2


def test_grids_lists_and_files_are_one(tmp_path: Any) -> None:
    m, (body,) = flying(1, (0, 0, -9.81))
    grid = {"x": GRID.tolist(), "y": GRID.tolist(), "z": WAVES.tolist()}
    ball = {**SHAPES["sphere"], "on": body}
    m.contacts("floor", ball, {"shape": "height_field", "on": m.ground.at(0, 0, 0.1), **grid}, FELT)
    file = tmp_path / "grid.yaml"
    file.write_text(m.to_yaml())
    again = eg.load(file)
    mods = [one.compile(target="numpy") for one in (waves(SHAPES["sphere"]), m, again)]
    x = state(mods[0], [(0.3, 0.4, 0.2)], [TURNED])
    values = [mod.rhs(0.0, x) for mod in mods]
    assert np.abs(values[0]).max() > 10.0
    assert np.array_equal(values[0], values[1])
    assert np.array_equal(values[1], values[2])
    assert len(m.mechanism().forces[0].drawn()) > 20  # lines over the grid


def test_beyond_the_grid_the_slope_goes_on() -> None:
    """A table of a plane, 10 m beyond its end."""
    x = np.array([-1.0, 0.0, 1.0])
    m, (body,) = flying(1)
    field = {"shape": "height_field", "on": m.ground, "x": x, "y": x, "z": 0.3 * x[:, None] + 0 * x}
    m.contacts("floor", {**SHAPES["sphere"], "on": body}, field, ELASTIC)
    mod = m.compile(target="numpy")
    n = np.array([-0.3, 0, 1]) / np.hypot(0.3, 1)
    for way, ends in ((11.0, "linear"), (-9.0, "linear")):
        at = np.array([way, 0.5, 0.3 * way]) + 0.08 * n
        assert depth_of(mod, state(mod, [at], [TURNED])) == pytest.approx(0.02, rel=1e-9), ends


@pytest.mark.parametrize("kind", ["sphere", "ellipsoid", "cuboid"])
def test_energy_over_waves(kind: str) -> None:
    """Without losses it stays; with friction and damping it never grows; closed cycles of pushing gain nothing."""
    speeds = {"j0_x_dot": 1.0, "j0_wx": 3.0, "j0_wy": -2.0}
    mod = waves(SHAPES[kind], ELASTIC).compile()
    traj = mod.simulate(1.0, initial={"j0_z": 0.5, **speeds}, rtol=1e-10, atol=1e-12)
    energy = np.sum(mod.energy(traj.x), axis=0)
    assert (mod.energy(traj.x)[1] - 9.81 * traj.x[2]).max() > 0.1
    assert np.ptp(energy) < 1e-6 * np.abs(energy).max()
    mod = waves(SHAPES[kind]).compile()
    traj = mod.simulate(2.0, initial={"j0_z": 0.4, **speeds}, rtol=1e-8, atol=1e-10)
    energy = np.sum(mod.energy(traj.x), axis=0)
    assert np.diff(energy).max() < 1e-6 * np.abs(energy).max()
    assert energy[-1] < energy[0] - 0.1


def test_a_run_in_air_ends_before_a_hill() -> None:
    """A ball that flies level towards a ridge is turned back, though the ground beneath it stays as far."""
    m, (body,) = flying(1)
    m.contacts("hill", {**SHAPES["sphere"], "on": body}, ground("2*exp(-(x - 6)**2)", on=m.ground), {"stiffness": 1e6})
    for target in ("numpy", "cython"):
        mod = m.compile(target=target)
        traj = mod.simulate(6.0, initial={"j0_z": 1.0, "j0_x_dot": 3.0})
        assert traj["j0_x"].max() < 6.0
        assert traj["j0_x_dot"][-1] < 2.9


def test_rigid_and_bristle_contacts_rest_on_slopes() -> None:
    """On a slope of 0.2 below friction 0.5 a block stays, by moreau and with bristles; a ball ends in the pit."""
    turn = Rotation.from_euler("y", -np.arctan(0.2)).as_quat()
    start = {"j0_1": turn[3], "j0_2": turn[0], "j0_3": turn[1], "j0_4": turn[2]}
    n = np.array([-0.2, 0, 1]) / np.hypot(0.2, 1)
    for law in ({"normal_law": "rigid", "friction": 0.5}, {
        "stiffness": 1e5, "exponent": 1, "dissipation": 1.0, "friction": 0.5, "friction_law": "lugre",
        "bristle_stiffness": 1e4, "bristle_damping": 100.0,
    }):  # fmt: skip
        m, (body,) = flying(1, (0, 0, -9.81))
        m.contacts("floor", {**SHAPES["cuboid"], "on": body}, ground("0.2*x", on=m.ground), law)
        mod = m.compile()
        names = [name for name in mod.q_names if name.startswith("j0_")][3:7]
        at = dict(zip(["j0_x", "j0_y", "j0_z"], 0.05 * n, strict=True)) | dict(zip(names, start.values(), strict=True))
        rigid = "normal_law" in law
        options: dict[str, Any] = {"method": "moreau", "step": 2e-3} if rigid else {"method": "Radau"}
        traj = mod.simulate(1.0, initial=at, **options)
        assert abs(traj["j0_x"][-1] - at["j0_x"]) < (1e-9 if rigid else 2e-3)
        assert np.abs(traj.x[mod.n_q : mod.n_q + 6, -1]).max() < 1e-3


def test_a_ball_comes_to_rest_where_mujoco_puts_it() -> None:
    """In a pit beside the middle of a table, whose lowest point lies on the grid."""
    x = np.linspace(-1, 1, 41)
    z = 0.3 - 0.3 * np.exp(-((x[:, None] - 0.3) ** 2 + (x - 0.2) ** 2) / 0.3)
    rows = " ".join(f"{value:.9f}" for value in (z.T[::-1] / 0.3).ravel())  # from above, as pictures
    world = mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="1e-3"/><asset><hfield name="pit" nrow="41" ncol="41" size="1 1 0.3 0.1" '
        f'elevation="{rows}"/></asset><worldbody><geom type="hfield" hfield="pit"/>'
        '<body pos="0.1 0 0.5"><freejoint/><geom type="sphere" size="0.1" mass="1" friction="0.5 0.05 0.05" '
        'condim="6"/></body></worldbody></mujoco>'
    )
    data = mujoco.MjData(world)
    for _ in range(15000):
        mujoco.mj_step(world, data)
    low = z.min()
    m, (body,) = flying(1, (0, 0, -9.81))
    pit = {"shape": "height_field", "on": m.ground, "x": x, "y": x, "z": z - low}
    m.contacts("pit", {**SHAPES["sphere"], "on": body}, pit, {"stiffness": 1e5, "exponent": 1, "dissipation": 1.0})
    for axis in "xyz":
        m.actuator(f"drag_{axis}", f"j0_{axis}", f"-2*j0_{axis}_dot")
    mod = m.compile()
    traj = mod.simulate(12.0, initial={"j0_x": 0.1, "j0_z": 0.5}, method="Radau")
    ends = traj.x[:3, -1]
    np.testing.assert_allclose(ends, [0.3, 0.2, 0.1], atol=2e-3)
    np.testing.assert_allclose(data.qpos[:2], ends[:2], atol=2e-3)
    assert data.qpos[2] == pytest.approx(ends[2], abs=2e-3)


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({}, "x: is missing, and there is no height; give height, an expression of x and y"),
        ({"height": "x", "x": [0, 1]}, "x: stands beside height"),
        ({"height": "u"}, "height: unknown name 'u'; known here: x, y"),
        ({"height": "x*j0_x"}, "coordinate 'j0_x' cannot be used"),
        (
            {"x": [0, 1], "y": [1, 0], "z": [[0, 0], [0, 0]]},
            r"y\[1\]: 0 follows 1; the points of a table must increase",
        ),
        ({"x": [0, 1], "y": [0, 1], "z": [[0, 0]]}, "z: has 1 rows for 2 points x"),
        ({"x": [0, 1], "y": [0, 1], "z": [[0, 0], [0, 0]], "kind": "periodic"}, "kind: 'periodic' is not"),
    ],
)
def test_what_is_wrong_is_told(given: dict[str, Any], told: str) -> None:
    m, (body,) = flying(1)
    m.contacts("floor", {**SHAPES["sphere"], "on": body}, {"shape": "height_field", "on": m.ground, **given}, ELASTIC)
    with pytest.raises(ModelError, match=told):
        m.mechanism()


def test_shapes_of_the_plane_and_grounds_do_not_meet_it() -> None:
    for other in ({"shape": "circle", "radius": 0.1}, {"shape": "half_space"}, ground("y")):
        m, (body,) = flying(1)
        m.contacts("floor", {**other, "on": body}, ground("x", on=m.ground), ELASTIC)
        with pytest.raises(ModelError, match="do not meet"):
            m.mechanism()
