"""Initial values given as outputs, as places and as velocities of markers, beside closed forms of the mechanisms."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy import cos, pi, sin
from refusals import refuses
from scipy.spatial.transform import Rotation
from sweeps import TARGETS

import eomgen as eg

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(scope="module", params=TARGETS)
def crank(request: pytest.FixtureRequest) -> Any:
    return eg.load(EXAMPLES / "slider_crank.yaml").compile(target=request.param)


def crank_angle(r: float, length: float, s: float) -> float:
    """The crank's angle at a place of the slider, by the law of cosines."""
    return float(np.arccos((r * r + s * s - length * length) / (2.0 * r * s)))


@pytest.mark.parametrize(("r", "s"), [(0.1, 0.31), (0.15, 0.48)])
@pytest.mark.parametrize("name", ["pin_x", "x( rod.tip )"])
def test_the_place_of_the_slider_sets_the_angle_of_the_crank(crank: Any, name: str, r: float, s: float) -> None:
    x = crank.bind(p={"r": r}).x0({name: s})
    assert x[0] == pytest.approx(crank_angle(r, 0.35, s), abs=1e-9)
    assert x[2] == pytest.approx(s, abs=1e-11)
    assert x[3] == 10.0  # the declared rate of the crank is kept


def test_runs_and_ensembles_start_there(crank: Any) -> None:
    run = crank.simulate(0.05, initial={"pin_x": 0.40})
    assert run["pin_x"][0] == pytest.approx(0.40, abs=1e-12)
    many = crank.simulate_many(0.05, initial={"pin_x": np.array([0.40, 0.42])})
    near = 1e-9  # lanes have the tolerance and not the bits of one run
    np.testing.assert_allclose(many.x[:, 0], run.x[:, -1], rtol=near)
    np.testing.assert_allclose(many.x[:, 1], crank.simulate(0.05, initial={"pin_x": 0.42}).x[:, -1], rtol=near)


def test_what_cannot_be_held_is_refused(crank: Any) -> None:
    refuses("EG-LOOP-OPEN pin_x 0.9 0.45", crank.x0, pin_x=0.9)
    refuses("EG-LOOP-OPEN 2 1", crank.x0, pin_x=0.42, theta=0.1)
    refuses("EG-NAME-UNKNOWN rod.tp rod.tip", crank.x0, {"x(rod.tp)": 0.4})
    refuses("EG-NAME-UNKNOWN pin_x?", crank.x0, pinx=0.4)
    refuses("EG-MISSING pin_x", crank.sensitivities, ["l"], (0, 0.01), initial={"pin_x": 0.42})


@pytest.mark.parametrize(("rotation", "turned"), [("euler_angles", True), ("euler_parameters", False)])
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
    refuses("EG-UNSUPPORTED velocities", mod.x0, work=0.1)
    if not start:
        with pytest.raises(eg.AssemblyError):
            mod.x0(theta=0.0, rise=0.3)


def test_a_model_declares_outputs_among_its_initial_values() -> None:
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
    mod = m.compile(target="numpy")
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
    refuses("EG-MISSING tip_x tip_y", mod.sensitivities, ["m"], 0.1)


ARM = """
name: arm
parameters: {l: {value: 800, unit: mm}}
bodies:
  rod: {mass: 1, com: [l/2, 0, 0], inertia: {zz: 0.1}, markers: {tip: [l, 0, 0]}}
joints:
  A: {type: revolute, between: [ground, rod], coordinate: q}
initial: {q: 0.6, INITIAL}
"""


def double_pendulum(turn: float = 0.0) -> eg.Model:
    m = eg.Model("two_links", gravity=(0, -9.81, 0))
    one, two = (m.body(name, mass=1, inertia={"zz": 0.1}) for name in ("one", "two"))
    m.revolute("A", m.ground.at(0, 0, 0, rpy=(0, 0, turn)), one, coordinate="a")
    m.revolute("B", one.at(0.7, 0, 0), two, coordinate="b")
    one.marker("end", at=(0.7, 0, 0))
    two.marker("end", at=(0.4, 0.1, 0))
    return m


def test_every_place_of_initial_values_takes_them(tmp_path: Path) -> None:
    """x0, runs, ensembles, the file and the model in Python."""
    file = tmp_path / "arm.yaml"
    file.write_text(ARM.replace(", INITIAL", ""))
    m, wanted, given = eg.load(file), 0.3 / (0.8 * sin(0.6)), {"q": 0.6, "vx(rod.tip)": "-0.3"}
    mod = m.compile(target="numpy")
    assert mod.x0(given)[1] == pytest.approx(wanted, rel=1e-12)
    assert mod.simulate(0.01, initial=given)["q_dot"][0] == pytest.approx(wanted, rel=1e-12)
    many = mod.simulate_many(0.01, initial=given | {"vx(rod.tip)": [-0.3, -0.6]}, t_eval=[0.0])
    assert many["q_dot"][0] == pytest.approx([wanted, 2 * wanted], rel=1e-12)
    m.initial = given
    assert m.compile(target="numpy").x0()[1] == pytest.approx(wanted, rel=1e-12)
    file.write_text(ARM.replace("INITIAL", "vx(rod.tip): -0.3"))
    assert eg.load(file).compile(target="numpy").x0()[1] == pytest.approx(wanted, rel=1e-12)


def test_two_velocities_of_a_tip_are_met_exactly() -> None:
    """r = 0.7 e(a) + 0.4 e(a + b) + 0.1 n(a + b); its velocity is linear in the rates."""
    random = np.random.default_rng(0)
    for turn in (0.0, 1.1, -2.6):
        mod = double_pendulum(turn).compile(target="numpy")
        for _ in range(10):
            a, b, vx, vy = random.uniform(0.3, 1.2, 4)
            x = mod.x0({"a": a, "b": b, "vx(two.end)": vx, "vy(two.end)": vy})
            assert x[:2].tolist() == [a, b]
            first, both = a + turn, a + b + turn
            n = np.array([-sin(first), cos(first)]) * 0.7
            m = np.array([-0.4 * sin(both) - 0.1 * cos(both), 0.4 * cos(both) - 0.1 * sin(both)])
            assert (n + m) * x[2] + m * x[3] == pytest.approx([vx, vy], abs=1e-12)


def test_a_body_that_turns_freely_by_euler_parameters() -> None:
    """v = R (w x r) of a ball joint, w in body axes; the part along r cannot be wanted."""
    m = eg.Model("top")
    body = m.body("body", mass=1, inertia=(0.1, 0.2, 0.3))
    m.spherical("S", m.ground, body, rotation="euler_parameters")
    at = np.array([0.3, -0.2, 0.5])
    body.marker("tip", at=tuple(at))
    mod = m.compile(target="numpy")
    turn = Rotation.from_rotvec([0.3, -0.8, 0.5])
    x, y, z, w = turn.as_quat()
    start = dict(zip(mod.q_names, (w, x, y, z), strict=True))
    state = mod.x0({**start, "vx(body.tip)": 0.4, "vy(body.tip)": -0.7})
    found = turn.apply(np.cross(state[4:], at))
    assert found[:2] == pytest.approx([0.4, -0.7], abs=1e-12)


@pytest.mark.parametrize(
    ("initial", "demand"),
    [
        ("vx(rod.top): 1", "EG-NAME-UNKNOWN initial.vx(rod.top): 'rod.tip'?"),
        ("vx(ground.o): 1", "EG-NAME-UNKNOWN initial.vx(ground.o): 'ground.o'"),
        ("vx(rod.tip): 1, q_dot: 2", "EG-CONTRADICTION initial.vx(rod.tip):"),
        ("vz(rod.tip): 1", "EG-CONTRADICTION initial.vz(rod.tip):"),
    ],
)
def test_velocities_that_cannot_be(initial: str, demand: str, tmp_path: Path) -> None:
    path = tmp_path / "arm.yaml"
    path.write_text(ARM.replace("INITIAL", initial), encoding="utf-8")
    refuses(demand, lambda: eg.load(path).check())
