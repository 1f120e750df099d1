"""Initial values given as outputs and as places of markers, beside closed forms of the mechanisms."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy import cos, pi, sin, sqrt

import eomgen as eg
from eomgen.errors import AssemblyError, UsageError

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(scope="module", params=["numpy", "cython"])
def crank(request: pytest.FixtureRequest) -> Any:
    return eg.load(EXAMPLES / "slider_crank.yaml").compile(target=request.param)


def crank_angle(r: float, length: float, s: float) -> float:
    """The crank's angle at a place of the slider, by the law of cosines."""
    return float(np.arccos((r * r + s * s - length * length) / (2.0 * r * s)))


@pytest.mark.parametrize(("r", "s"), [(0.1, 0.42), (0.1, 0.31), (0.15, 0.25), (0.15, 0.48)])
@pytest.mark.parametrize("name", ["pin_x", "x(rod.tip)", "x( rod.tip )"])
def test_the_place_of_the_slider_sets_the_angle_of_the_crank(crank: Any, name: str, r: float, s: float) -> None:
    x = crank.bind(p={"r": r}).x0({name: s})
    assert x[0] == pytest.approx(crank_angle(r, 0.35, s), abs=1e-9)
    assert x[2] == pytest.approx(s, abs=1e-11)
    assert x[3] == 10.0  # the declared rate of the crank is kept


def test_an_output_of_velocities_sets_the_speed(crank: Any) -> None:
    x = crank.x0(pin_x=0.42, speed=1.0)
    theta = crank_angle(0.1, 0.35, 0.42)
    slope = -0.1 * sin(theta) - 0.1**2 * sin(theta) * cos(theta) / sqrt(0.35**2 - (0.1 * sin(theta)) ** 2)
    np.testing.assert_allclose(x[[0, 3, 5]], [theta, 1.0 / slope, 1.0], rtol=1e-9)


def test_runs_and_ensembles_start_there(crank: Any) -> None:
    run = crank.simulate(0.05, initial={"pin_x": 0.40})
    assert run["pin_x"][0] == pytest.approx(0.40, abs=1e-12)
    many = crank.simulate_many(0.05, initial={"pin_x": np.array([0.40, 0.42])})
    near = 1e-9 if hasattr(crank.core, "take_lanes") else 0.0  # lanes have the tolerance and not the bits of one run
    np.testing.assert_allclose(many.x[:, 0], run.x[:, -1], rtol=near)
    np.testing.assert_allclose(many.x[:, 1], crank.simulate(0.05, initial={"pin_x": 0.42}).x[:, -1], rtol=near)


def test_what_cannot_be_held_is_refused(crank: Any) -> None:
    with pytest.raises(AssemblyError, match=r"pin_x = 0\.9.* nearby has pin_x = 0\.45"):
        crank.x0(pin_x=0.9)
    with pytest.raises(AssemblyError, match="2 values for 1 degree of freedom"):
        crank.x0(pin_x=0.42, theta=0.1)
    with pytest.raises(UsageError, match=r"no marker or body 'rod\.tp'; did you mean rod\.tip"):
        crank.x0({"x(rod.tp)": 0.4})
    with pytest.raises(UsageError, match="did you mean pin_x"):
        crank.x0(pinx=0.4)
    with pytest.raises(UsageError, match="held coordinates and rates, not pin_x; give the coordinates"):
        crank.sensitivities(["l"], (0, 0.01), initial={"pin_x": 0.42})


def test_an_open_arm_reaches_a_point(tmp_path: Path) -> None:
    """The two-link arm's inverse kinematics in closed form."""
    m = eg.Model("arm")
    upper = m.body("upper", mass=1, inertia={"zz": 0.1})
    lower = m.body("lower", mass=1, inertia={"zz": 0.1})
    tip = lower.marker("tip", at=(0.3, 0, 0))
    m.revolute("A", m.ground, upper, coordinate="a")
    m.revolute("B", upper.at(0.5, 0, 0), lower, coordinate="b")
    m.output("height", tip.position[1])
    m.output("energy_like", "a_dot**2")
    m.output("pull", tip.acceleration[0])
    m.initial(a=0.2, b=0.4)
    mod = m.compile(target="numpy")
    px, py = 0.4, 0.35
    bend = np.arccos((px**2 + py**2 - 0.25 - 0.09) / (2 * 0.5 * 0.3))
    shoulder = np.arctan2(py, px) - np.arctan2(0.3 * sin(bend), 0.5 + 0.3 * cos(bend))
    np.testing.assert_allclose(mod.x0({"x(lower.tip)": px, "height": py})[:2], [shoulder, bend], atol=1e-10)
    x = mod.x0(height=0.3)  # the first declared value has room beside it
    np.testing.assert_allclose(x[:2], [0.2, np.arcsin((0.3 - 0.5 * sin(0.2)) / 0.3) - 0.2], atol=1e-10)
    for name in ("energy_like", "pull"):
        with pytest.raises(UsageError, match=f"the output '{name}' depends on .*cannot be given as an initial value"):
            mod.x0({name: 1.0})


@pytest.mark.parametrize("rotation", ["euler_angles", "euler_parameters"])
@pytest.mark.parametrize("turned", [False, True])
def test_a_ball_joint_holds_the_height_of_a_marker(rotation: str, turned: bool) -> None:
    """However its rotation is written, and in turned axes of the joint; the nearest such position turns about y."""
    m = eg.Model("pendulum", gravity=(0, 0, -9.81))
    rod = m.body("rod", mass=1, com=(0.5, 0, 0), inertia=(0.01, 0.1, 0.1))
    end = rod.marker("end", at=(1, 0, 0))
    frame = {"rpy": (0.3, -0.2, 0.5)} if turned else {}
    m.spherical("ball", m.ground.at(0, 0, 0, **frame), rod.at(0, 0, 0, **frame), rotation=rotation)
    m.output("height", end.position[2])
    m.output("rise", end.velocity[2])
    mod = m.compile(target="numpy")
    for name in ("height", "z(rod.end)"):
        x = mod.x0({name: -0.3, "rise": 0.7})
        place = mod.poses(x[: mod.n_q])[0] @ [1, 0, 0, 1]
        np.testing.assert_allclose(place[2], -0.3, atol=1e-12)
        np.testing.assert_allclose(mod.outputs(0.0, x), [-0.3, 0.7], atol=1e-12)


def test_a_moving_support_counts(tmp_path: Path) -> None:
    """At another time the driven support is elsewhere, and its velocity is part of the output's."""
    m = eg.Model("lift")
    cage = m.body("cage", mass=1)
    bob = m.body("bob", mass=1, inertia={"zz": 0.1})
    tip = bob.marker("tip", at=(0, -1, 0))
    m.prismatic("up", m.ground, cage, axis="y", coordinate="s")
    m.revolute("hinge", cage, bob, coordinate="theta")
    m.driver("drive", "up", "0.5*t")
    m.output("speed", tip.velocity[1])
    m.initial(theta=0.3)
    mod = m.compile(target="numpy")
    x = mod.x0({"y(bob.tip)": -0.3, "theta_dot": 0.0}, t=1.0)
    names = list(mod.x_names)
    assert x[names.index("s")] == pytest.approx(0.5)
    assert 0.5 - cos(x[names.index("theta")]) == pytest.approx(-0.3, abs=1e-10)
    y = mod.x0({"theta": pi / 3, "speed": 0.5 + 2.0 * sin(pi / 3)}, t=1.0)
    assert y[names.index("theta_dot")] == pytest.approx(2.0, rel=1e-10)


@pytest.mark.parametrize("start", [0.0, 0.4])
def test_an_output_is_one_of_velocities_wherever_it_begins(start: float) -> None:
    """A hanging pendulum's end has no vertical velocity at its lowest place, whatever its rate."""
    m = eg.Model("pendulum", gravity=(0, -9.81, 0))
    rod = m.body("rod", mass=1, com=(0, -0.5, 0), inertia={"zz": 0.1})
    m.revolute("hinge", m.ground, rod, coordinate="theta")
    m.output("rise", rod.at(0, -1, 0).velocity[1])
    m.output("work", "sin(theta)*theta_dot**2")
    m.initial(theta=start)
    mod = m.compile(target="numpy")
    np.testing.assert_allclose(mod.x0(theta=0.5, rise=0.3), [0.5, 0.3 / sin(0.5)], rtol=1e-10)
    with pytest.raises(UsageError, match="velocities, and not linearly"):
        mod.x0(work=0.1)
    if not start:
        with pytest.raises(AssemblyError):
            mod.x0(theta=0.0, rise=0.3)


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_a_model_declares_outputs_among_its_initial_values(target: str) -> None:
    """Two links that reach a point: the elbow's angle is that of the triangle, on the side that the guess says."""
    m = eg.Model("arm", gravity=(0, -9.81, 0))
    upper, fore = (
        m.body(name, mass=1, com=(0.2, 0, 0), inertia={"zz": 0.02}, markers={"end": (0.5, 0, 0)})
        for name in ("upper", "fore")
    )
    m.revolute("A", m.ground, upper, coordinate="a")
    m.revolute("B", upper.at(0.5, 0, 0), fore, coordinate="b")
    m.output("tip_x", "x(fore.end)", unit="cm")
    m.output("tip_y", "y(fore.end)")
    m.output("speed", "vx(fore.end)")
    m.guess(b=-0.5)
    m.initial(tip_x=60, tip_y="0.6/2", speed=0.1)
    mod = m.compile(target=target)
    x = mod.x0()
    assert mod.outputs(0.0, x) == pytest.approx([60.0, 0.3, 0.1], abs=1e-9)
    assert x[1] == pytest.approx(-np.arccos((0.6**2 + 0.3**2 - 2 * 0.25) / (2 * 0.25)))
    other = mod.x0(tip_x=50.0)  # the others stay
    assert mod.outputs(0.0, other)[:2] == pytest.approx([50.0, 0.3], abs=1e-9)
    turned = mod.x0(a=0.1)  # leaves room for the first alone
    assert mod.outputs(0.0, turned)[0] == pytest.approx(60.0)
    assert turned[0] == 0.1
    assert mod.simulate(0.01)["tip_y"][0] == pytest.approx(0.3)
    runs = mod.simulate_many((0, 0.01), inputs=None, parameters=None, initial={"speed": [0.0, 0.2]}, t_eval=[0.0])
    assert runs["tip_x"][0] == pytest.approx([60.0, 60.0])
    assert runs["speed"][0] == pytest.approx([0.0, 0.2])
    with pytest.raises(UsageError, match="not tip_x, tip_y, speed; give the coordinates"):
        mod.sensitivities(["m"], 0.1)


LEGS = """
name: legs
components:
  leg:
    attachments: [hip]
    bodies:
      thigh: {mass: 1, markers: {knee: {at: [0, -0.4, 0]}}}
      shank: {mass: 0.5, com: [0, -0.2, 0], inertia: {zz: 0.01}, markers: {foot: {at: [0, -0.4, 0]}}}
    joints:
      hip: {type: revolute, between: [hip, thigh]}
      knee: {type: revolute, between: [thigh.knee, shank]}
    initial: {x(shank.foot): 0.3}
add:
  left: {component: leg, at: {hip: ground}}
  right: {component: leg, at: {hip: ground}, initial: {x(shank.foot): 0.1 + 0.1, y(shank.foot): -0.6}}
"""


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_a_file_declares_places_of_markers_among_its_initial_values(target: str, tmp_path: Path) -> None:
    (tmp_path / "legs.yaml").write_text(LEGS)
    eg.load(tmp_path / "legs.yaml").save(tmp_path / "plain.yaml")
    for file in ("legs.yaml", "plain.yaml"):
        module = eg.load(tmp_path / file).compile(target=target)
        start = module.simulate(0.01, t_eval=[0.0, 0.01]).x[:, 0]
        hip, knee = start[0:4:2], start[1:4:2]  # angles about z from hanging straight down, links of 0.4 m
        foot = 0.4 * np.array([sin(hip) + sin(hip + knee), -cos(hip) - cos(hip + knee)])
        assert foot[:, 1] == pytest.approx([0.2, -0.6], abs=1e-9)
        assert foot[0, 0] == pytest.approx(0.3, abs=1e-9)
        elsewhere = module.x0({"x(left_shank.foot)": -0.1})[:2]
        assert 0.4 * (sin(elsewhere[0]) + sin(elsewhere.sum())) == pytest.approx(-0.1, abs=1e-9)


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("x(shank.toe)", r"initial.x\(shank.toe\): no marker 'shank.toe'; did you mean 'shank.foot'"),
        ("x(shin)", "no marker 'shin'"),
        ("y(ground.wall)", "is a position on the ground, which does not move; name a marker of another body"),
        ("w(shank.foot)", "no coordinate, velocity or output"),
    ],
)
def test_places_that_cannot_be_initial_are_told(name: str, told: str) -> None:
    m = eg.Model("one")
    m.ground.marker("wall", at=(1, 0, 0))
    shank = m.body("shank", mass=1, inertia={"zz": 0.1})
    shank.marker("foot", at=(0, -0.4, 0))
    m.revolute("knee", m.ground, shank)
    m.initial[name] = 0.1
    with pytest.raises(eg.ModelError, match=told):
        m.check()


def test_outputs_among_initial_values_are_read_and_verified(tmp_path: Path) -> None:
    file = tmp_path / "pendulum.yaml"
    file.write_text(PENDULUM.replace("INITIAL", "height: -0.6"))
    m = eg.load(file)
    assert m.compile(target="numpy").x0()[0] == pytest.approx(np.arccos(0.6))
    again = tmp_path / "again.yaml"
    m.save(again)
    assert eg.load(again).compile(target="numpy").x0()[0] == pytest.approx(np.arccos(0.6))
    file.write_text(PENDULUM.replace("INITIAL", "heigth: -0.6"))
    with pytest.raises(eg.ModelError, match="no coordinate, velocity or output 'heigth'; did you mean 'height'"):
        eg.load(file).check()


PENDULUM = """
name: pendulum
bodies: {rod: {mass: 1, com: [0, -1, 0], inertia: {zz: 1}}}
joints: {A: {type: revolute, between: [ground, rod], coordinate: phi}}
outputs: {height: -cos(phi)}
guess: {phi: 0.5}
initial: {INITIAL}
"""


def test_a_body_stands_for_its_origin() -> None:
    """The place and velocity of a body's origin as initial values, against the angles in closed form."""
    m = eg.Model("arm")
    first, second = (m.body(name, mass=1.0, inertia={"zz": 0.1}) for name in ("first", "second"))
    m.revolute("A", m.ground, first, coordinate="a")
    m.revolute("B", first.at(1.0, 0, 0), second.at(-0.5, 0, 0), coordinate="b")
    m.initial(**{"x(second)": 0.9, "y(second)": 0.7, "vx(second)": 0.3, "vy(second)": -0.2})
    x = m.compile(target="numpy").x0()
    s, c, both = np.sin(x[0]), np.cos(x[0]), x[0] + x[1]
    place = [c + 0.5 * np.cos(both), s + 0.5 * np.sin(both)]
    rate = x[2] + x[3]
    speed = [-s * x[2] - 0.5 * np.sin(both) * rate, c * x[2] + 0.5 * np.cos(both) * rate]
    np.testing.assert_allclose([*place, *speed], [0.9, 0.7, 0.3, -0.2], atol=1e-10)
