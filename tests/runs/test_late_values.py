"""Parameters given late: starts that are expressions of them follow; values that elements do not allow are refused."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from refusals import refuses
from sweeps import TARGETS

import eomgen as eg


def thrown(h: float = 2.0, w: float = 0.5) -> eg.Model:
    """A ball that starts at h/2 + w with the speed h w, and a state that begins at w squared."""
    m = eg.Model("thrown", gravity=(0.0, -10.0, 0.0))
    ball = m.body("ball", mass=1.0)
    m.prismatic("J", m.ground, ball, axis="y", coordinate="y")
    m.parameter("h", h)
    m.parameter("w", w)
    m.state("a", "-a", initial="w**2")
    m.initial(y="h/2 + w", y_dot="h*w")
    return m


def crank(start: float = 0.4, speed: float = 2.0) -> eg.Model:
    """A slider-crank whose start is declared by parameters: crank angle and slider speed."""
    m = eg.Model("crank", gravity=(0.0, -9.81, 0.0))
    m.parameter("start", start)
    m.parameter("speed", speed)
    m.parameter("r", 0.2)
    arm = m.body("arm", mass=1.0, inertia={"zz": 0.01}, com=("r/2", 0, 0))
    rod = m.body("rod", mass=1.0, inertia={"zz": 0.02}, com=(0.25, 0, 0))
    block = m.body("block", mass=1.0)
    m.revolute("A", m.ground, arm, axis="z", coordinate="theta")
    m.revolute("B", arm.at("r", 0, 0), rod, axis="z", coordinate="phi")
    m.prismatic("C", m.ground, block, axis="x", coordinate="s")
    m.revolute("D", rod.at(0.5, 0, 0), block, axis="z", coordinate="psi")
    m.guess(phi=-0.2, s=0.65)
    m.initial(theta="start", theta_dot="speed")
    m.independent = ["theta"]
    return m


@pytest.fixture(scope="module", params=TARGETS)
def ball(request: pytest.FixtureRequest) -> Any:
    return thrown().compile(target=request.param)


@pytest.fixture(scope="module")
def mechanism() -> Any:
    return crank().compile(target="numpy")


def start(h: float, w: float) -> list[float]:
    return [h / 2 + w, h * w, w * w]


def test_bound_parameters_start_where_their_expressions_say(ball: Any) -> None:
    p = {"h": 3.0, "w": 0.25}
    assert ball.x0() == pytest.approx(start(2.0, 0.5), rel=1e-15)
    assert ball.bind(p).x0() == pytest.approx(start(3.0, 0.25), rel=1e-15)
    assert ball.bind(p).bind({"h": 2.0, "w": 0.5}).x0() == pytest.approx(start(2.0, 0.5), rel=1e-15)
    assert ball.x0(p=[3.0, 0.25]) == pytest.approx(start(3.0, 0.25), rel=1e-15)
    assert ball.x0({"y": 7.0}, p=[3.0, 0.25]) == pytest.approx([7.0, 0.75, 0.0625], rel=1e-15)


@pytest.mark.parametrize("initial", [None, {"y_dot": 1.0}, {"a": [0.1, 0.2, 0.3]}])
def test_each_of_many_runs_begins_at_its_own(ball: Any, initial: Any) -> None:
    h = [1.0, 2.0, 3.0]
    found = ball.simulate_many(0.5, initial, {"h": h})
    for k, one in enumerate(h):
        given = {name: np.broadcast_to(x, 3)[k] for name, x in (initial or {}).items()}
        alone = thrown(one).compile(target="numpy").simulate(0.5, given)
        assert found.x[:, k] == pytest.approx(alone.x[:, -1], abs=1e-8)


def test_slopes_by_parameters_are_those_of_the_closed_form(ball: Any) -> None:
    t, h, w = 0.5, 2.0, 0.5
    found = ball.sensitivities(["h", "w"], t, t_eval=[0.0, t])
    assert found.dx[:, :, 0] == pytest.approx(np.array([[0.5, 1.0], [w, h], [0.0, 2.0 * w]]), abs=1e-14)
    assert found["y", "h"][-1] == pytest.approx(0.5 + w * t, abs=1e-8)
    assert found["a", "w"][-1] == pytest.approx(2.0 * w * np.exp(-t), abs=1e-7)


@pytest.mark.parametrize("angle", [-2.5, 0.9, 3.0])
def test_a_closed_loop_starts_as_if_declared_so(mechanism: Any, angle: float) -> None:
    late = mechanism.bind({"start": angle, "speed": -1.0, "r": 0.15})
    x = late.x0()
    s = 0.15 * np.cos(angle) + np.sqrt(0.25 - (0.15 * np.sin(angle)) ** 2)
    assert x[late.x_names.index("theta")] == pytest.approx(angle, abs=1e-12)
    assert float(late.poses(x[: late.n_q])[list(late.body_names).index("block")][0, 3]) == pytest.approx(s, abs=1e-12)
    assert late.minimal.x0() == pytest.approx([angle, -1.0], abs=1e-12)


def root() -> eg.Model:
    """A free slider that starts at sqrt(a) with the speed 1/a."""
    m = eg.Model("root", gravity=(0, 0, 0))
    m.parameter("a", 0.25)
    m.prismatic("J", m.ground, m.body("b", mass=1.0), axis="x", coordinate="q")
    m.initial(q="sqrt(a)", q_dot="1/a")
    return m


def test_a_start_that_is_given_needs_no_declared_one() -> None:
    module = root().compile(target="numpy")
    late = module.bind({"a": -1.0})
    assert late.rhs(0.0, [1.0, 2.0]) == pytest.approx([2.0, 0.0])
    assert late.x0({"q": 1.0}) == pytest.approx([1.0, -1.0])
    assert module.simulate(0.5, {"q": 1.0}, parameters={"a": -1.0}).x[:, -1] == pytest.approx([0.5, -1.0])
    assert module.simulate(0.5, [1.0, 2.0], parameters={"a": -1.0}).x[:, -1] == pytest.approx([2.0, 2.0])
    assert late.simulate_many(0.5, parameters={"a": [1.0, 4.0]}).x == pytest.approx(
        np.array([[1.5, 2.125], [1.0, 0.25]])
    )
    assert module.sensitivities(["q"], 0.5, {"q": 1.0}, parameters={"a": -1.0})["q", "q"][-1] == pytest.approx(1.0)
    for given in ({}, {"q_dot": 3.0}):
        refuses("EG-NOT-FINITE initial.q -1", late.x0, given)
    refuses("EG-NOT-FINITE initial.q_dot 0", module.simulate, 0.5, {"q": 1.0}, parameters={"a": 0.0})


@pytest.mark.parametrize("target", TARGETS)
def test_one_bad_set_of_parameters_fails_its_own_run(target: str) -> None:
    runs = root().compile(target=target).simulate_many(0.1, parameters={"a": [-1.0, 4.0]})
    assert np.isnan(runs.x[:, 0]).all()
    assert runs.x[0, 1] == pytest.approx(2.0 + 0.025, abs=1e-12)
    assert (runs.status != 0).tolist() == [True, False]


ALLOWED = {"k": 2e4, "r": 0.15, "mu": 0.5, "m_b": 2.0}


BAD = {"k": -1.0, "r": 0.0, "mu": -0.2, "m_b": -3.0}


#: What is said of each of them, and nothing else.
SAID = {
    "k": ["forces.floor.stiffness: is -1 with k = -1; must be greater than 0"],
    "r": ["forces.floor.first[0].radius: is 0 with r = 0; must be greater than 0"],
    "mu": ["forces.floor.friction: is -0.2 with mu = -0.2; must be 0 or greater"],
    "m_b": [
        "bodies.ball.mass: is -3 with m_b = -3; give a mass of 0 or more",
        "bodies.ball.inertia: the moment about the centre of mass is -0.015 with r = 0.1, m_b = -3; give",
    ],
}


MODEL = """
name: dropped
gravity: [0, -9.81, 0]
parameters: {k: 1.0e+4, r: 0.1, mu: 0.3, m_b: 1.0, e: 0.5}
bodies: {ball: {mass: m_b, inertia: {zz: m_b*r**2/2}}}
joints: {J: {type: planar, between: [ground, ball], coordinates: [x, y, phi]}}
forces:
  floor:
    {type: contacts, first: [{shape: circle, on: ball, radius: r}], second: [{shape: half_plane, on: ground}],
     stiffness: k, restitution: 1 - e**2, velocity: 1, friction: mu, smoothing: 0.01}
initial: {y: 0.3}
simulation: {end: 0.02}
"""


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    found = tmp_path_factory.mktemp("late") / "dropped.yaml"
    found.write_text(MODEL)
    return found


@pytest.fixture(scope="module")
def dropped(file: Path) -> Any:
    return eg.load(file).derive().compile(target="numpy")


def said(error: eg.ModelError) -> list[str]:
    return [str(problem) for problem in error.problems]


@pytest.mark.parametrize("name", BAD)
def test_every_call_refuses_a_value_that_an_element_does_not_allow(dropped: Any, name: str) -> None:
    p = {name: BAD[name]}
    array = dropped.p
    array[dropped.p_names.index(name)] = BAD[name]
    x = dropped.x0()
    calls: list[Any] = [
        lambda: dropped.bind(p=p),
        lambda: dropped.bind(p=array),
        lambda: dropped.simulate(0.01, parameters=p),
        lambda: dropped.simulate_many(0.01, parameters=p, count=2),
        lambda: dropped.x0(p=p),
        lambda: dropped.rhs(0.0, x, p=p),
        lambda: dropped.sensitivities(["e"], 0.01, parameters=p),
        lambda: dropped.linearize(x=x, p=p),
    ]
    for call in calls:
        with pytest.raises(eg.ParameterError) as caught:
            call()
        assert len(said(caught.value)) == len(SAID[name])
        assert all(text.startswith(start) for text, start in zip(said(caught.value), SAID[name], strict=True))
        assert isinstance(caught.value, eg.UsageError)


def test_allowed_values_pass(dropped: Any) -> None:
    bound = dropped.bind(p=ALLOWED)
    run = dropped.simulate(0.01, parameters=ALLOWED)
    assert np.array_equal(run.x, bound.simulate(0.01).x)
    many = dropped.simulate_many(0.01, parameters={name: [value] * 3 for name, value in ALLOWED.items()})
    assert len(many) == 3
