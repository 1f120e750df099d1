"""Initial values that are expressions of parameters: parameters given late start runs where the same model would whose
parameters are declared so, and the slopes of the start are those of the expressions."""

from __future__ import annotations

import importlib
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eomgen as eg
from eomgen.errors import ModelError, UsageError
from eomgen.generation import generate

TARGETS = ("cython", "numpy")


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
    return crank().compile(target="cython")


def start(h: float, w: float) -> list[float]:
    return [h / 2 + w, h * w, w * w]


def test_bound_parameters_start_where_their_expressions_say(ball: Any) -> None:
    p = {"h": 3.0, "w": 0.25}
    assert ball.x0() == pytest.approx(start(2.0, 0.5), rel=1e-15)
    assert ball.bind(p).x0() == pytest.approx(start(3.0, 0.25), rel=1e-15)
    assert ball.bind(p).bind({"h": 2.0, "w": 0.5}).x0() == pytest.approx(start(2.0, 0.5), rel=1e-15)
    assert ball.x0(p=[3.0, 0.25]) == pytest.approx(start(3.0, 0.25), rel=1e-15)
    assert ball.x0({"y": 7.0}, p=[3.0, 0.25]) == pytest.approx([7.0, 0.75, 0.0625], rel=1e-15)


def test_a_run_begins_there_and_follows_the_parabola(ball: Any) -> None:
    run = ball.simulate(0.5, parameters={"h": 3.0, "w": 0.25})
    assert run["y"][-1] == pytest.approx(1.75 + 0.75 * 0.5 - 5.0 * 0.25, abs=1e-8)
    assert run["a"][-1] == pytest.approx(0.0625 * np.exp(-0.5), rel=1e-7)


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


def test_values_that_are_given_or_held_do_not_follow(ball: Any) -> None:
    given = ball.sensitivities(["h"], 0.1, {"y": 1.0}).dx[:, 0, 0]
    assert given == pytest.approx([0.0, 0.5, 0.0], abs=1e-14)
    assert not ball.sensitivities(["h"], 0.1, [1.0, 2.0, 3.0]).dx[:, 0, 0].any()
    assert not ball.sensitivities(["h"], 0.1, hold=["y", "y_dot", "a"]).dx[:, 0, 0].any()


def test_a_fit_finds_the_parameter_by_which_runs_start(ball: Any) -> None:
    t = np.linspace(0.0, 0.5, 11)
    data = {"t": t, "y": 1.6 + 0.5 + 1.6 * t - 5.0 * t**2}  # h = 3.2, w = 0.5
    for initial in (None, {"a": 1.0}):
        assert ball.fit(data, {"h": 2.0}, initial=initial).parameters["h"] == pytest.approx(3.2, rel=1e-6)


@pytest.mark.parametrize("angle", [-2.5, -0.4, 0.9, 2.0, 3.0])
def test_a_closed_loop_starts_as_if_declared_so(mechanism: Any, angle: float) -> None:
    late = mechanism.bind({"start": angle, "speed": -1.0, "r": 0.15})
    x = late.x0()
    s = 0.15 * np.cos(angle) + np.sqrt(0.25 - (0.15 * np.sin(angle)) ** 2)
    assert x[late.x_names.index("theta")] == pytest.approx(angle, abs=1e-12)
    assert float(late.poses(x[: late.n_q])[list(late.body_names).index("block")][0, 3]) == pytest.approx(s, abs=1e-12)
    assert late.minimal.x0() == pytest.approx([angle, -1.0], abs=1e-12)


def test_slopes_of_the_start_of_a_closed_loop(mechanism: Any) -> None:
    names, h = ["start", "speed", "r"], 1e-6
    p = dict(zip(mechanism.p_names, mechanism.p, strict=True))
    found = mechanism.sensitivities(names, 0.2)
    for k, name in enumerate(names):
        for at in (0, -1):
            ends = [mechanism.simulate(0.2, parameters={name: p[name] + side}, rtol=1e-11, atol=1e-13).x[:, at]
                    for side in (h, -h)]  # fmt: skip
            assert found.dx[:, k, at] == pytest.approx((ends[0] - ends[1]) / (2.0 * h), abs=2e-7)


def test_an_output_that_is_declared_holds_for_each_run() -> None:
    m = eg.Model("arm", gravity=(0.0, -9.81, 0.0))
    m.parameter("l", 1.0)
    m.parameter("reach", 0.5)
    arm = m.body("arm", mass=1.0, inertia={"zz": 0.1}, com=("l", 0, 0))
    m.revolute("A", m.ground, arm, axis="z", coordinate="theta")
    m.output("tip", "l*sin(theta)")
    m.initial(tip="reach/2")
    module = m.compile(target="numpy")
    for parameters in ({"l": [1.0, 2.0]}, {"reach": [0.5, 1.0]}):
        found = [module.bind({n: x[k] for n, x in parameters.items()}).x0()[0] for k in range(2)]
        ends = module.simulate_many(1e-9, parameters=parameters).x[0]
        assert ends == pytest.approx(found, abs=1e-12)
    assert module.bind({"l": 2.0}).x0()[0] == pytest.approx(np.arcsin(0.125), abs=1e-12)
    assert module.bind({"reach": 1.0}).x0()[0] == pytest.approx(np.arcsin(0.5), abs=1e-12)


def test_an_exported_package_follows_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = generate(thrown(), tmp_path / "thrown", target="numpy")
    monkeypatch.syspath_prepend(folder.parent)
    package = importlib.import_module("thrown")
    try:
        assert package.bind(p={"h": 3.0, "w": 0.25}).x0() == pytest.approx(start(3.0, 0.25), rel=1e-15)
        assert package.simulate(0.1, parameters={"h": 3.0}).x[:, 0] == pytest.approx(start(3.0, 0.5), rel=1e-15)
    finally:
        for name in [name for name in sys.modules if name.partition(".")[0] == "thrown"]:
            del sys.modules[name]


@pytest.mark.parametrize("names", [("e0", "e3"), ("e0", "e1", "e2", "e3")])
@pytest.mark.parametrize("joint", ["spherical", "free"])
def test_slopes_of_euler_parameters(names: tuple[str, ...], joint: str) -> None:
    """d(cos(a/2), n sin(a/2))/da, and the fit that they lead."""
    m = eg.Model("turned", gravity=(0, 0, 0))
    m.parameter("a", 0.5)
    body = m.body("body", mass=1.0, inertia={"xx": 1.0, "yy": 2.0, "zz": 3.0})
    getattr(m, joint)("S", m.ground, body, rotation="euler_parameters")
    n = {"e3": 1.0} if len(names) == 2 else {"e1": 0.6, "e2": 0.0, "e3": 0.8}
    m.initial({"S_e0": "cos(a/2)"} | {f"S_{k}": f"{n[k]}*sin(a/2)" for k in names[1:]})
    module = m.compile(target="numpy")
    slopes = module.sensitivities(["a"], 0.5)
    expected = {"e0": -0.5 * np.sin(0.25)} | {k: 0.5 * x * np.cos(0.25) for k, x in n.items()}
    for k, value in expected.items():
        assert slopes[f"S_{k}", "a"][0] == pytest.approx(value, abs=1e-12)
    run = module.simulate(0.5, parameters={"a": 0.7}, t_eval=np.linspace(0.0, 0.5, 4))
    data = {"t": run.t} | {f"S_{k}": run[f"S_{k}"] for k in ("e0", "e3")}
    assert module.fit(data, ["a"]).parameters["a"] == pytest.approx(0.7, rel=1e-6)


def test_values_that_are_no_numbers_are_named() -> None:
    m = eg.Model("root", gravity=(0, 0, 0))
    m.parameter("a", 0.5)
    m.prismatic("J", m.ground, m.body("b", mass=1.0), axis="x", coordinate="q")
    m.initial(q="sqrt(a)")
    module = m.compile(target="numpy")
    with pytest.raises(UsageError, match=r"initial\.q is no number with a = -1"):
        module.bind({"a": -1.0}).x0()
    with pytest.raises(UsageError, match=r"initial\.q is no number with a = -1"):
        module.simulate(1.0, parameters={"a": -1.0})
    m.initial(q="sqrt(-a)")
    with pytest.raises(ModelError, match=r"initial\.q: is no number at the declared parameters"):
        m.compile(target="numpy")


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
        with pytest.raises(UsageError, match=r"initial\.q is no number with a = -1: look for"):
            late.x0(given)
    with pytest.raises(UsageError, match=r"initial\.q_dot is no number with a = 0"):
        module.simulate(0.5, {"q": 1.0}, parameters={"a": 0.0})


def test_a_loop_or_a_rotation_that_is_given_needs_no_declared_start() -> None:
    m = crank()
    m.parameter("a", 0.16)
    m.initial(theta="sqrt(a)", theta_dot="speed")
    late = m.compile(target="numpy").bind({"a": -1.0})
    x = late.x0({"theta": 2.0})
    assert x[:1] == pytest.approx([2.0])
    assert late.x0({"s": 0.6})[list(late.q_names).index("s")] == pytest.approx(0.6)  # which leaves theta no room
    assert late.branch(x) == 1
    for call in (late.x0, late.assemble, late.branches):
        with pytest.raises(UsageError, match=r"initial\.theta is no number with start = "):
            call()
    turned = eg.Model("turned", gravity=(0, 0, 0))
    turned.parameter("a", 0.5)
    body = turned.body("body", mass=1.0, inertia={"xx": 1.0, "yy": 2.0, "zz": 3.0})
    turned.spherical("S", turned.ground, body, rotation="euler_parameters")
    turned.initial(S_e0="sqrt(1 - a**2)", S_e3="a")
    late = turned.compile(target="numpy").bind({"a": 2.0})
    assert late.x0({"S_e0": 0.6, "S_e1": 0.8})[:4] == pytest.approx([0.6, 0.8, 0.0, 0.0])
    with pytest.raises(UsageError, match=r"initial\.S_e0 is no number with a = 2"):
        late.x0()


def test_a_guess_is_refused_where_it_is_used() -> None:
    m = crank()
    m.parameter("a", 0.4225)
    m.guess(phi=-0.2, s="sqrt(a)")
    late = m.compile(target="numpy").bind({"a": -1.0})
    assert late.x0({"theta": 0.5})[0] == pytest.approx(0.5)
    with pytest.raises(UsageError, match=r"guess\.s is no number with .*a = -1"):
        late.assemble({"phi": -0.3})


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("method", ["DOP853", "LSODA"])
@pytest.mark.parametrize("q", [1.0, [1.0, 2.0]])
def test_runs_that_are_given_a_start_run(target: str, method: str, q: Any) -> None:
    given = {"q": q, "q_dot": 0.5}
    runs = root().compile(target=target).simulate_many(0.1, given, {"a": [-1.0, 4.0]}, method=method)
    assert runs.status.tolist() == [0, 0]
    assert runs.x[0] == pytest.approx(np.broadcast_to(q, 2) + 0.05, abs=1e-9)
    alike = (
        root().compile(target=target).simulate_many(0.1, {"q": [1.0, 2.0], "q_dot": 0.5}, {"a": -1.0}, method=method)
    )
    assert alike.x[0] == pytest.approx([1.05, 2.05], abs=1e-9)


@pytest.mark.parametrize("target", TARGETS)
def test_parameters_that_cannot_be_bound_fail_their_own_run(target: str) -> None:
    m = eg.Model("weight", gravity=(0, -10, 0))
    m.parameter("m", 1.0)
    m.prismatic("J", m.ground, m.body("b", mass="1/(2.5 - m)"), axis="y", coordinate="q")
    runs = m.compile(target=target).simulate_many(0.1, {"q": 1.0}, {"m": [2.5, 2.0]})
    assert (runs.status != 0).tolist() == [True, False]
    assert runs.x[:, 1] == pytest.approx([0.95, -1.0])


def rocker(start: float = 1.2) -> eg.Model:
    """A crank-rocker that starts at an angle of the rocker: those above and those below 0 are on two circuits."""
    m = eg.Model("rocker", gravity=(0, 0, 0))
    m.parameter("start", start)
    a, b, c = (m.body(name, mass=1.0, inertia={"zz": 0.1}) for name in "abc")
    m.revolute("A", m.ground, a, coordinate="rock")
    m.revolute("B", a.at(0.8, 0, 0), b, coordinate="be")
    m.revolute("D", m.ground.at(1.0, 0, 0), c, coordinate="cr")
    m.revolute("C", b.at(1.0, 0, 0), c.at(0.3, 0, 0))
    m.guess(be=-1.2, cr=1.0)
    m.initial(rock="start")
    m.independent = ["rock"]
    return m


def heard(call: Any) -> tuple[Any, list[tuple[str, str]]]:
    """What a call gives, and the warnings with their files."""
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        value = call()
    return value, [(str(one.message), one.filename) for one in found]


@pytest.mark.parametrize("angle", [1.0, -1.2])
def test_a_start_that_the_branch_does_not_reach_is_told_as_if_given(angle: float) -> None:
    """The rocker of length 0.8 about (0, 0), the crank of length 0.3 about (1, 0): each circuit lies on one side."""
    module = rocker().compile(target="numpy")
    expected, words = heard(lambda: module.x0({"rock": angle}))
    assert len(words) == (angle < 0.0)
    for call in (
        lambda: module.bind({"start": angle}).x0(),
        lambda: module.x0(p={"start": angle}),
        lambda: module.simulate(1e-9, parameters={"start": angle}).x[:, 0],
        lambda: module.simulate_many(1e-9, parameters={"start": [angle]}).x[:, 0],
    ):
        found, told = heard(call)
        assert found == pytest.approx(expected, abs=1e-7)
        assert told == words
    for text, file in words:
        assert text.startswith("rock = -1.2 cannot be reached from the reference position on the same branch: ")
        assert file == __file__
    assert heard(lambda: module.bind({"start": angle}).x0({"rock": 1.1}))[1] == []  # from the declared branch
    assert module.bind({"start": angle}).x0({"rock": 1.1}) == pytest.approx(module.x0({"rock": 1.1}), abs=1e-9)


@pytest.mark.parametrize("target", TARGETS)
def test_one_bad_set_of_parameters_fails_its_own_run(target: str) -> None:
    m = eg.Model("root", gravity=(0, 0, 0))
    m.parameter("a", 0.5)
    m.prismatic("J", m.ground, m.body("b", mass=1.0), axis="x", coordinate="q")
    m.initial(q="sqrt(a)")
    runs = m.compile(target=target).simulate_many(0.1, parameters={"a": [-1.0, 4.0]})
    assert np.isnan(runs.x[:, 0]).all()
    assert runs.x[0, 1] == pytest.approx(2.0, abs=1e-12)
    assert (runs.status != 0).tolist() == [True, False]


def test_tables_stay_and_it_is_said() -> None:
    m = eg.Model("looked_up", gravity=(0, 0, 0))
    m.parameter("a", 1.0)
    m.parameter("b", 1.0)
    m.prismatic("J", m.ground, m.body("b1", mass=1.0), axis="x", coordinate="q")
    m.table("f", [0.0, 1.0, 2.0, 3.0], [0.0, 1.0, 4.0, 9.0])
    m.initial(q="f(a)", q_dot="2*b")
    module = m.compile(target="numpy")
    assert module.x0() == pytest.approx([1.0, 2.0])
    assert module.bind({"b": 3.0}).x0() == pytest.approx([1.0, 6.0])
    with pytest.warns(UserWarning, match="initial value of q calls a table or a function of the model.*follow a"):
        assert module.bind({"a": 2.0}).x0() == pytest.approx([1.0, 2.0])
    late = module.bind({"a": 2.0})
    once = [
        late.x0,
        lambda: module.simulate(0.1, parameters={"a": 2.0}),
        lambda: module.simulate(0.1, {"q_dot": 1.0}, parameters={"a": 2.0}),
        lambda: module.simulate_many(0.1, None, {"a": [2.0, 3.0]}),
        lambda: module.simulate_many(0.1, {"q_dot": [1.0, 2.0]}, {"a": [2.0, 3.0]}),
        lambda: module.sensitivities(["b"], 0.1, parameters={"a": 2.0}),
        lambda: module.fit({"t": [0.0, 0.1, 0.2], "q": [1.0, 1.2, 1.4]}, ["a", "b"]),
    ]
    for call in once:
        _, told = heard(call)
        assert [(text.split(" calls ")[0], file) for text, file in told] == [("the initial value of q", __file__)]
    silent = [
        lambda: module.bind({"a": 2.0}).bind(u={}),
        lambda: late.x0({"q": 3.0}),
        lambda: late.simulate(0.1, [1.0, 2.0]),
        lambda: module.simulate(0.1, {"q": 3.0}, parameters={"a": 2.0}),
        lambda: module.simulate_many(0.1, {"q": 3.0}, {"a": [2.0, 3.0]}),
        lambda: module.simulate_many(0.1, None, {"b": [2.0, 3.0]}),
        lambda: module.fit({"t": [0.0, 0.1, 0.2], "q": [1.0, 1.2, 1.4]}, ["b"]),
    ]
    for call in silent:
        assert heard(call)[1] == []
