"""Contacts beside MuJoCo, Exudyn and published waves of dominoes, and in closed chains."""

import json
import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from judges import differences
from scipy.integrate import quad
from sweeps import part_of

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
    m.parameter("mu", 0.1)
    m.contacts("floor", {"shape": "cuboid", "on": block, "size": size}, floor, LAW, friction="mu")
    m.initial(fly_z=0.03 - mass * G * c / 4e6)
    end = m.compile(optimize=0).simulate(0.5, parameters={"mu": mu}, method="Radau", rtol=1e-8, atol=1e-10)
    way = 0.5 * G * (s - mu * c) * 0.25 if slides else 0.0
    assert end["fly_x"][-1] == pytest.approx(way, rel=5e-3, abs=1e-4)
    gone = found[0] * c - found[2] * s
    assert gone == pytest.approx(end["fly_x"][-1], rel=5e-3, abs=1e-4)


SCENES = json.loads((Path(__file__).parents[1] / "reference" / "exudyn_contacts.json").read_text(encoding="utf-8"))
HERTZ = {"stiffness": SCENES["stiffness"], "exponent": SCENES["exponent"], "dissipation": 0}


def test_balls_strike_roll_and_slide() -> None:
    """Friction between sticking and sliding is smoothed in another way there; the scene slides nearly all the time."""
    scene, names = SCENES["balls"], ("cue", "red", "big")
    m, shapes = eg.Model("balls", gravity=(0, 0, -SCENES["gravity"])), []
    for k, name in enumerate(names):
        mass, radius = scene["masses"][k], scene["radii"][k]
        body = m.body(name, mass=mass, inertia=[0.4 * mass * radius**2] * 3)
        shapes.append({"shape": "sphere", "on": body, "radius": radius})
        m.free(f"{name}_fly", m.ground, body, rotation="euler_parameters")
        for i, axis in enumerate("xyz"):
            m.initial({f"{name}_fly_{axis}": scene["places"][k][i], f"{name}_fly_w{axis}": scene["spins"][k][i]})
            m.initial({f"{name}_fly_{axis}_dot": scene["velocities"][k][i]})
    law = {**HERTZ, "friction": scene["friction"], "smoothing": scene["friction_zone"]}
    m.contacts("over_the_dome", shapes, {"shape": "sphere", "on": m.ground, "radius": scene["dome"]}, law)
    m.contacts("among", shapes, law=law)
    run = m.compile(optimize=0).simulate(scene["end"], rtol=1e-10, atol=1e-12)
    for name, place, speed in zip(names, scene["answer"]["places"], scene["answer"]["velocities"], strict=True):
        assert [run[f"{name}_fly_{axis}"][-1] for axis in "xyz"] == pytest.approx(place, abs=2e-5)
        assert [run[f"{name}_fly_{axis}_dot"][-1] for axis in "xyz"] == pytest.approx(speed, abs=2e-4)


G, MASS = 9.81, 0.01
HIGH, THICK = 0.048, 0.0075
COUNT = 14
BEGUN = 2e-3  #: (rad) tilt at which a domino counts as hit


def times_of_hits(gap: float, push: float, pieces: int) -> np.ndarray:
    """Times between hits (van Leeuwen, The domino effect, Am. J. Phys. 78 (2010), 721-727, without friction).

    All that have been hit lean on the next one: the upper front corner on its back, h sin(a - b) = (s + d) cos b - d.
    Between hits the energy is kept; a hit keeps the momentum along the motion that all make together.
    """
    step = gap + THICK
    inertia = MASS * (HIGH**2 + THICK**2) / 3
    hit = np.arcsin(gap / HIGH)

    def leaning(b: float) -> float:
        return float(b + np.arcsin((step * np.cos(b) - THICK) / HIGH))

    def rates(a: float, b: float) -> float:
        return 1.0 - step * np.sin(b) / (HIGH * np.cos(a - b))

    def sums(b: float, count: int) -> tuple[float, float]:
        """Squared rates by that of the first, and the potential energy."""
        squares, height, rate = 0.0, 0.0, 1.0
        for k in range(count):
            squares += rate * rate
            height += 0.5 * MASS * G * (HIGH * np.cos(b) + THICK * np.sin(b))
            if k < count - 1:
                a = leaning(b)
                rate, b = rate * rates(a, b), a
        return squares, height

    found, omega = [], push
    for count in range(1, pieces):
        squares, height = sums(0.0, count)
        energy = 0.5 * inertia * squares * omega**2 + height

        def speed(b: float, energy: float = energy, count: int = count) -> float:
            squares, height = sums(b, count)
            return float(np.sqrt(2 * (energy - height) / (inertia * squares)))

        found.append(quad(lambda b, speed=speed: 1 / speed(b), 0.0, hit, limit=200)[0])
        squares = sums(hit, count)[0]
        rate = rates(hit, 0.0)
        omega = rate * squares * speed(hit) / (1.0 + rate * rate * squares)
    return np.array(found)


@pytest.mark.parametrize(
    ("gap", "pieces"), part_of([(0.024, 3), (0.012, COUNT), (0.024, COUNT)], lambda case: case[1] == 3)
)
def test_speed_of_the_wave(gap: float, pieces: int) -> None:
    """From a hit to the next the same time to 0.5 %, and to 0.05 % where the wave is nearly steady."""
    m = eg.Model("dominoes", gravity=(0, -G, 0))
    bodies = []
    for k in range(pieces):
        body = m.body(f"d{k}", mass=MASS, inertia={"zz": MASS * (HIGH**2 + THICK**2) / 12})
        m.revolute(f"j{k}", m.ground.at(k * (gap + THICK), 0, 0), body.at(THICK / 2, -HIGH / 2, 0), axis="z")
        bodies.append(body)
    boxes = {"shape": "box", "on": bodies, "size": (THICK, HIGH)}
    law = {"normal_law": "linear", "stiffness": 1e5, "damping": 60.0}  # of a hit of 10 g: damped to a plastic one
    m.contacts("hits", boxes, law=law)
    m.contacts("floor", boxes, {"shape": "half_plane", "on": m.ground}, {**law, "stiffness": 1e4, "damping": 20.0})
    push = 3.0
    wanted = times_of_hits(gap, push, pieces)
    run = m.compile(optimize=0).simulate(1.05 * wanted.sum(), initial={"j0_dot": -push}, rtol=1e-7)
    begun = []
    for k in range(1, pieces):
        x = -run[f"j{k}"]
        at = int(np.argmax(x > BEGUN))
        begun.append(np.interp(BEGUN, x[at - 1 : at + 1], run.t[at - 1 : at + 1]))
    np.testing.assert_allclose(np.diff(begun), wanted[1:], rtol=5e-3)
    if pieces < COUNT:
        return
    last = [abs(a / b - 1) for a, b in ((wanted[-1], wanted[-2]), (np.diff(begun)[-1], wanted[-1]))]
    assert last[1] < 5e-4
    assert last[0] < 0.03  # nearly the steady wave


def ring(n: int, name: str, **friction: Any) -> eg.Model:
    """A closed chain of n discs that lies on the floor, pressed together by springs."""
    m = eg.Model(name, gravity=(0, -9.81, 0))
    length, radius = 0.1, 0.1 / (2 * np.sin(np.pi / n))
    links = [m.body(f"b{k}", mass=1.0 + 0.1 * k, com=(0.05, 0, 0), inertia={"zz": 2e-3}) for k in range(n)]
    m.planar("root", m.ground, links[0], coordinates=["x", "y", "turn0"])
    for k, (a, b) in enumerate(pairwise(links), 1):
        m.revolute(f"turn{k}", a.at(length, 0, 0), b)
        m.initial(**{f"turn{k}": 2 * np.pi / n}) if k < n - 2 else m.guess(**{f"turn{k}": 2 * np.pi / n})
    m.revolute("closure", links[-1].at(length, 0, 0), links[0])
    m.initial(x=0, y=radius * (np.cos(np.pi / n) - 1) + radius, turn0=0.1)
    discs = {"shape": "circle", "on": [link.at(0.05, 0, 0) for link in links], "radius": 0.06}
    law = {"stiffness": 1e4, "dissipation": 0.5, "friction": 0.4, **(friction or {"smoothing": 0.05})}
    m.contacts("floor", discs, {"shape": "half_plane", "on": m.ground}, law)
    m.contacts("among", discs, law=law)
    return m


BRISTLES = {"friction_law": "lugre", "bristle_stiffness": 2e3, "bristle_damping": 5.0}


@pytest.mark.parametrize(("states", "count"), part_of([(False, 7), (True, 7), (False, 24)], (False, 7).__eq__))
def test_jacobian_of_a_closed_chain_in_contact(states: bool, count: int) -> None:
    """It is that of differences, whether its text is written out or has loops."""
    mod = ring(count, "ring", **(BRISTLES if states else {})).compile(target="numpy")
    x = mod.x0()
    x[mod.n_q :] = 0.3 * np.sin(np.arange(mod.n_x - mod.n_q))
    x[["bristle" in name for name in mod.x_names]] *= 1e-3
    x = mod.project(x)
    expected = differences(mod, x, 1e-6)
    assert np.abs(expected[mod.n_q :, : mod.n_q]).max() > 500  # discs touch
    np.testing.assert_allclose(mod.jacobian(0.0, x), expected, rtol=0, atol=1e-5 * np.abs(expected).max())
