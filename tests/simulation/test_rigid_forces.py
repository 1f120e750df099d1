"""Mean forces of rigid contacts over steps: closed forms at rest and in sliding, momentum to rounding, MuJoCo."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from rigid_scenes import SHAPES, G, on_floor, rigid

import eomgen as eg
from eomgen.errors import UsageError


@pytest.mark.parametrize("target", ["numpy", "cython"])
@pytest.mark.parametrize("slope", [0.3, 0.6])
def test_block_on_a_slope(slope: float, target: str) -> None:
    """m g cos, and m g sin where it holds, mu m g cos where it slides."""
    block = on_floor({"shape": "box", "size": (0.6, 0.2)}, {"friction": 0.5}, slope, 0.03, target=target)
    run = block.simulate(0.2, {"j_y": 0.1}, method="moreau", step=1e-3, contact_forces=True)
    weight = 1.0 * G
    held = min(np.sin(slope), 0.5 * np.cos(slope))
    np.testing.assert_allclose(run["normal(c)"], weight * np.cos(slope), rtol=1e-8)  # contact_tolerance is 1e-9
    np.testing.assert_allclose(run["friction(c)"][1:], weight * held, rtol=1e-8)
    assert run.units["normal(c)"] == run.units["friction(c)"] == "N"
    force = run.contact_forces.on("b")
    np.testing.assert_allclose(force[:2, 5], [-weight * held, weight * np.cos(slope)], rtol=1e-8)
    np.testing.assert_allclose(force, -run.contact_forces.on("ground"), atol=1e-12 * weight)


@pytest.fixture(scope="module")
def heap() -> Any:
    """Discs and a box that fall into a heap, in a trough."""
    m = eg.Model("heap", gravity=(0.3, -G, 0))
    shapes = []
    for k in range(6):
        body = m.body(f"b{k}", mass=0.5 + 0.2 * k, inertia={"zz": 0.01 + 0.003 * k})
        m.planar(f"j{k}", m.ground, body)
        m.initial(**{f"j{k}_x": 0.21 * (k % 3) - 0.2, f"j{k}_y": 0.35 + 0.3 * (k // 3), f"j{k}_x_dot": 0.5 - 0.2 * k})
        m.initial(**{f"j{k}_3_dot": 1.0 - k})
        shapes.append(
            {"shape": "circle", "radius": 0.1, "on": body}
            if k % 2
            else {"shape": "box", "size": (0.2, 0.1), "on": body}
        )
    m.contacts("heap", shapes, law=rigid(friction=0.4, restitution=0.3))
    m.contacts("floor", shapes, {"shape": "half_plane", "on": m.ground}, rigid(friction=0.6))
    return m.compile()


@pytest.mark.parametrize("h", [1e-3, 4e-3])
def test_forces_change_momentum_as_the_run_does(heap: Any, h: float) -> None:
    """Of each body m (v+ - v)/h = m g + F, and the same of turning, to rounding: impacts and friction among them."""
    run = heap.simulate(0.6, method="moreau", step=h, contact_forces=True)
    assert run.metadata["contacts"] >= 8
    q = run.x[: heap.n_q]
    steps = np.diff(run.t)
    for k in range(6):
        mass, spin = 0.5 + 0.2 * k, 0.01 + 0.003 * k
        wrench = run.contact_forces.on(f"b{k}")[:, 1:]
        sides = run.contact_forces.on(f"b{k}", "heap") + run.contact_forces.on(f"b{k}", "floor")
        np.testing.assert_allclose(wrench, sides[:, 1:], atol=1e-9)
        names = [heap.q_names.index(f"j{k}_{axis}") for axis in ("x", "y")]
        rate = np.array([np.diff(run[f"j{k}_{axis}_dot"]) / steps for axis in ("x", "y", "3")])
        middle = q[names, :-1] + 0.5 * steps * np.array([run[f"j{k}_x_dot"], run[f"j{k}_y_dot"]])[:, :-1]
        about = wrench[5] - (middle[0] * wrench[1] - middle[1] * wrench[0])
        size = max(float(np.abs(wrench[:2]).max()), mass * G)
        np.testing.assert_allclose(mass * rate[0], 0.3 * mass + wrench[0], atol=1e-10 * size)
        np.testing.assert_allclose(mass * rate[1], -G * mass + wrench[1], atol=1e-10 * size)
        if run.metadata["steps"] == len(steps):  # each with one middle
            np.testing.assert_allclose(spin * rate[2], about, atol=1e-10 * size)
    total = sum(run.contact_forces.on(f"b{k}", "heap") for k in range(6))
    np.testing.assert_allclose(total, 0.0, atol=1e-9)  # action and reaction


def test_divided_steps_give_their_mean() -> None:
    """A ball that a thin wall stops within a step of many parts: the force times the step is its momentum."""
    m = eg.Model("wall", gravity=(0, 0, 0))
    ball = m.body("ball", mass=2.0)
    m.prismatic("j", m.ground, ball, axis="x", coordinate="s")
    wall = {"shape": "box", "size": (0.01, 1.0), "on": m.ground.at(0.5, 0, 0)}
    m.contacts("c", {"shape": "circle", "radius": 0.01, "on": ball}, wall, rigid())
    mod = m.compile()
    run = mod.simulate(0.02, {"s_dot": 60.0}, method="moreau", step=4e-3)
    assert run.metadata["steps"] > 5
    np.testing.assert_allclose((run["normal(c)"][1:] * np.diff(run.t)).sum(), 120.0, rtol=1e-12)
    assert run["s_dot"][-1] == pytest.approx(0.0, abs=1e-12)


PLANK = """<mujoco><option timestep="0.001" gravity="0 0 -9.81" cone="elliptic" tolerance="1e-12" iterations="200"/>
<worldbody><geom name="floor" type="plane" size="5 5 1" friction="0.6" solref="0.004 1"/>
<body pos="0 0 0.1"><freejoint/><inertial pos="0.1 0.03 0" mass="3" diaginertia="0.05 0.1 0.12"/>
<geom name="a" type="sphere" size="0.1" pos="-0.4 -0.2 0" friction="0.6"/>
<geom name="b" type="sphere" size="0.1" pos="0.4 -0.2 0" friction="0.6"/>
<geom name="c" type="sphere" size="0.1" pos="0 0.3 0" friction="0.6"/></body></worldbody></mujoco>"""


def test_three_feet_beside_mujoco() -> None:
    """Forces of three feet under a load that is off their middle."""
    world = mujoco.MjModel.from_xml_string(PLANK)
    data = mujoco.MjData(world)
    for _ in range(3000):
        mujoco.mj_step(world, data)
    theirs = {}
    for k in range(data.ncon):
        found = np.zeros(6)
        mujoco.mj_contactForce(world, data, k, found)
        theirs[max(data.contact[k].geom1, data.contact[k].geom2)] = found[0]
    m = eg.Model("plank", gravity=(0, 0, -9.81))
    plank = m.body("plank", mass=3.0, com=(0.1, 0.03, 0.0), inertia=(0.05, 0.1, 0.12))
    m.free("j", m.ground, plank, rotation="euler_parameters")
    places = [(-0.4, -0.2, 0.0), (0.4, -0.2, 0.0), (0.0, 0.3, 0.0)]
    feet = [{"shape": "sphere", "radius": 0.1, "on": plank.at(*place)} for place in places]
    m.contacts("feet", feet, {"shape": "half_space", "on": m.ground}, rigid(friction=0.6))
    run = m.compile().simulate(0.1, {"j_z": 0.1}, method="moreau", step=1e-3, contact_forces=True)
    ours = sorted(run.contact_forces.at(0.1), key=lambda one: (one.point[1] > 0, one.point[0]))
    np.testing.assert_allclose([one.pressing for one in ours], [theirs[k] for k in (1, 2, 3)], rtol=2e-3)
    np.testing.assert_allclose(sum(one.pressing for one in ours), 3.0 * 9.81, rtol=1e-9)
    # moments about the ground's axes, by statics
    matrix = np.array([[1.0, 1.0, 1.0], [-0.4, 0.4, 0.0], [-0.2, -0.2, 0.3]])
    by_statics = 3.0 * 9.81 * np.linalg.solve(matrix, [1.0, 0.1, 0.03])
    np.testing.assert_allclose([one.pressing for one in ours], by_statics, rtol=1e-6)
    assert {one.contacts for one in ours} == {"feet"}
    assert {frozenset((one.first_body, one.second_body)) for one in ours} == {frozenset(("plank", "ground"))}


def test_stored_copied_and_asked_for_wrongly(tmp_path: Path) -> None:
    ball = on_floor(SHAPES["circle"], {"friction": 0.3})
    options: dict[str, Any] = {"method": "moreau", "step": 1e-3}
    whole = ball.simulate(0.5, {"j_y": 0.4}, **options)
    some = ball.simulate(0.5, {"j_y": 0.4}, t_eval=np.linspace(0.0, 0.5, 11), **options)
    np.testing.assert_array_equal(some["normal(c)"], whole["normal(c)"][::50])
    hit = int(np.argmax(whole["normal(c)"]))
    inside = ball.simulate(0.5, {"j_y": 0.4}, t_eval=[whole.t[hit] - 4e-4, whole.t[hit] + 4e-4], **options)
    np.testing.assert_array_equal(inside["normal(c)"], whole["normal(c)"][[hit, hit + 1]])
    assert whole.contact_forces.count("c")[hit] == 1.0
    assert whole.change_points == []
    again = pickle.loads(pickle.dumps(whole))
    np.testing.assert_array_equal(again["normal(c)"], whole["normal(c)"])
    np.testing.assert_array_equal(again.contact_forces.friction("c"), whole["friction(c)"])
    whole.save(tmp_path / "run.csv")
    head = (tmp_path / "run.csv").read_text().splitlines()[0]
    assert "normal(c),friction(c)" in head
    whole.save(tmp_path / "run.npz")
    np.testing.assert_array_equal(eg.load_trajectory(tmp_path / "run.npz")["normal(c)"], whole["normal(c)"])
    with pytest.raises(UsageError, match="not kept: simulate with contact_forces=True"):
        whole.contact_forces.on("b")
    with pytest.raises(UsageError, match="contact_forces must be True or False, not 'yes'"):
        ball.simulate(0.5, contact_forces="yes", **options)
    kept = ball.simulate(0.5, {"j_y": 0.4}, contact_forces=True, **options).contact_forces
    with pytest.raises(UsageError, match="a time of the run, from 0 to 0.5 s, not 0.6"):
        kept.at(0.6)
    with pytest.raises(UsageError, match="wheel"):
        kept.on("wheel")
    with pytest.raises(UsageError, match="road"):
        kept.normal("road")
