"""Contacts of groups beside MuJoCo on the same scenes: what its soft contacts and ours must agree on."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest

import eomgen as eg

G = 9.81
LAW = {"stiffness": 1e6, "exponent": 1, "dissipation": 0.5, "smoothing": 1e-4}


def run(world: str, seconds: float, start: dict[str, float]) -> np.ndarray:
    """The state of the first body in MuJoCo, small steps, an elliptic cone, stiff contact."""
    xml = f"""<mujoco><option timestep="2e-5" cone="elliptic" impratio="100" iterations="100" tolerance="1e-12"/>
    <default><geom solref="0.001 1" solimp="0.99 0.999 0.0001" condim="3"/></default>
    <worldbody>{world}</worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    for name, value in start.items():
        array, _, index = name.partition("_")
        getattr(data, array)[int(index)] = value
    mujoco.mj_forward(model, data)
    for _ in range(round(seconds / 2e-5)):
        mujoco.mj_step(model, data)
    return np.concatenate([data.qpos, data.qvel])


def test_a_ball_slides_and_then_rolls() -> None:
    """Both roll with 5/7 of the first speed after 2 v / (7 mu g)."""
    radius, mu, speed, mass = 0.1, 0.2, 1.0, 0.5
    found = run(
        f'<geom type="plane" size="5 5 1" friction="{mu} 0 0"/><body pos="0 0 {radius}"><freejoint/>'
        f'<geom type="sphere" size="{radius}" mass="{mass}" friction="{mu} 0 0"/></body>',
        0.3, {"qvel_0": speed},
    )  # fmt: skip
    m = eg.Model("bowl", gravity=(0, 0, -G))
    ball = m.body("ball", mass=mass, inertia=[0.4 * mass * radius**2] * 3)
    m.free("fly", m.ground, ball, rotation="euler_parameters")
    floor = {"shape": "half_space", "on": m.ground}
    m.contacts("floor", {"shape": "sphere", "on": ball, "radius": radius}, floor, LAW, friction=mu)
    m.initial(fly_z=radius - mass * G / 1e6, fly_x_dot=speed)
    mod = m.compile()
    end = mod.simulate(0.3, method="Radau", rtol=1e-8, atol=1e-10)
    place = end["fly_x"][-1]
    slides = 2 * speed / (7 * mu * G)
    way = speed * slides - 0.5 * mu * G * slides**2 + 5 / 7 * speed * (0.3 - slides)
    assert place == pytest.approx(way, rel=1e-3)
    assert found[0] == pytest.approx(place, rel=5e-3)
    assert end["fly_x_dot"][-1] == pytest.approx(5 / 7 * speed, rel=1e-3)
    assert found[7] == pytest.approx(end["fly_x_dot"][-1], rel=5e-3)


@pytest.mark.parametrize(("mu", "slides"), [(0.3, True), (0.7, False)])
def test_a_block_on_an_incline(mu: float, slides: bool) -> None:
    tilt, mass, size = math.radians(25), 1.2, (0.2, 0.1, 0.06)
    c, s = math.cos(tilt), math.sin(tilt)
    half = " ".join(str(x / 2) for x in size)
    found = run(
        f'<geom type="plane" size="5 5 1" friction="{mu} 0 0" euler="0 {math.degrees(tilt)} 0"/>'
        f'<body pos="{0.03 * s} 0 {0.03 * c}" euler="0 {math.degrees(tilt)} 0"><freejoint/>'
        f'<geom type="box" size="{half}" mass="{mass}" friction="{mu} 0 0"/></body>',
        0.5, {},
    )  # fmt: skip
    m = eg.Model("slope", gravity=(0, 0, -G))
    x, y, z = (k**2 * mass / 12 for k in size)
    block = m.body("block", mass=mass, inertia=(y + z, x + z, x + y))
    base = m.ground.at(0, 0, 0, rpy=(0, tilt, 0))
    m.free("fly", base, block, rotation="euler_parameters")
    floor = {"shape": "half_space", "on": base}
    m.contacts("floor", {"shape": "cuboid", "on": block, "size": size}, floor, LAW, friction=mu)
    m.initial(fly_z=0.03 - mass * G * c / 4e6)
    end = m.compile().simulate(0.5, method="Radau", rtol=1e-8, atol=1e-10)
    way = 0.5 * G * (s - mu * c) * 0.25 if slides else 0.0
    assert end["fly_x"][-1] == pytest.approx(way, rel=5e-3, abs=1e-4)
    gone = found[0] * c - found[2] * s
    assert gone == pytest.approx(end["fly_x"][-1], rel=5e-3, abs=1e-4)


def test_a_tower_of_balls_in_a_box_comes_to_the_same_rest() -> None:
    """Three balls dropped between two walls: the heights at rest are those of the geometry, in both."""
    radius, mass = 0.1, 0.4
    balls = [(0.0, 0.1), (0.05, 0.28), (-0.02, 0.47)]
    geoms = "".join(
        f'<body pos="{x} 0 {z}"><joint type="slide" axis="1 0 0" damping="0.5"/><joint type="slide" axis="0 0 1" '
        f'damping="0.5"/><geom type="sphere" size="{radius}" mass="{mass}" friction="0 0 0" condim="1"/></body>'
        for x, z in balls
    )
    walls = '<geom type="plane" size="5 5 1" condim="1"/>' + "".join(
        f'<geom type="plane" pos="{x} 0 0" size="5 5 1" zaxis="{-np.sign(x)} 0 0" condim="1"/>' for x in (-0.14, 0.14)
    )
    found = run(walls + geoms, 2.5, {})
    m = eg.Model("tower", gravity=(0, 0, -G))
    bodies = []
    for k, (x, z) in enumerate(balls):
        body = m.body(f"b{k}", mass=mass, inertia=[0.001] * 3)
        slider = m.body(f"s{k}", mass=0)
        m.prismatic(f"x{k}", m.ground, slider, axis="x")
        m.prismatic(f"z{k}", slider, body, axis="z")
        m.joint_damper(f"cx{k}", f"x{k}", damping=0.5)
        m.joint_damper(f"cz{k}", f"z{k}", damping=0.5)
        m.initial({f"x{k}": x, f"z{k}": z})
        bodies.append(body)
    law = {"stiffness": 1e5, "exponent": 1, "dissipation": 0.5}
    sides = [m.ground, *(m.ground.at(x, 0, 0, rpy=(0, -math.copysign(math.pi / 2, x), 0)) for x in (-0.14, 0.14))]
    spheres = {"shape": "sphere", "on": bodies, "radius": radius}
    m.contacts("walls", spheres, {"shape": "half_space", "on": sides}, law)
    m.contacts("among", spheres, law=law)
    end = m.compile().simulate(2.5, method="Radau", rtol=1e-7, atol=1e-9)
    ours = np.array([[end[f"x{k}"][-1], end[f"z{k}"][-1]] for k in range(3)])
    np.testing.assert_allclose(ours, found[:6].reshape(3, 2) + balls, atol=1e-3)
    rise = math.sqrt(0.2**2 - 0.08**2)  # of a ball on the next, across the box
    assert ours[:, 1] == pytest.approx([0.1, 0.1 + rise, 0.1 + 2 * rise], abs=1e-3)
