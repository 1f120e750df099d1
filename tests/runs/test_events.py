"""Events: found where closed forms put them, with resets and impacts, by every method and both targets."""

import pickle
import warnings
from collections.abc import Callable
from functools import partial
from time import process_time
from typing import Any

import models
import numpy as np
import pytest
from analysed import compiled, hopper
from models import IN_C
from refusals import refused, refuses
from scipy.integrate import DOP853, solve_ivp
from sweeps import TARGETS, part_of

import eomgen as eg

G, E, END = 9.81, 0.9, 2.0
METHODS = ("DOP853", "RK45", "RK23", "LSODA", "Radau")
TIGHT, CLOSE = {"rtol": 1e-9, "atol": 1e-12}, {"rtol": 1e-10, "atol": 1e-12}


def bounces(e: float = E, end: float = END) -> np.ndarray:
    """Times at which a ball dropped from 1 m hits the floor."""
    times, gap = [np.sqrt(2 / G)], 2 * e * np.sqrt(2 / G)
    while times[-1] + gap < end:
        times.append(times[-1] + gap)
        gap *= e
    return np.array(times)


@pytest.fixture(scope="module")
def bouncing() -> Any:
    return compiled("hopper_with_apex")


@pytest.mark.parametrize("method", [*METHODS, "IDA"])
def test_a_ball_bounces_as_in_closed_form(bouncing: Any, method: str) -> None:
    end, solve = 4.0, partial(bouncing.simulate, method=method, dense_output=True, **TIGHT)
    error, fine, finest = 1e-8, 1e-10, 1e-12
    if method == "IDA":
        pytest.importorskip("sksundae")
        end, error, fine, finest = 2.8, 1e-9, 1e-9, 1e-9
        solve = partial(bouncing.dae.solve, rtol=1e-9, atol=1e-11)
    run, expected = solve((0, end)), bounces(end=end)
    np.testing.assert_allclose(run.t_events["floor"], expected, rtol=0, atol=fine)
    assert run.t_events["apex"][0] == 0.0  # SciPy's rule: a value that leaves zero, in its direction
    np.testing.assert_allclose(run.t_events["apex"][1:], (expected[:-1] + expected[1:]) / 2, rtol=0, atol=error)
    np.testing.assert_allclose(run.x_events["floor"][0], 0.0, atol=10 * finest)
    speeds = np.sqrt(2 * G) * 0.9 ** np.arange(len(expected))
    np.testing.assert_allclose(run.x_events["floor"][1], -speeds, rtol=1e-8)  # before each reset
    assert run["h"].min() > -finest
    twice = np.flatnonzero(np.diff(run.t) == 0.0)
    np.testing.assert_allclose(run["h_dot"][twice + 1], -0.9 * run["h_dot"][twice], rtol=1e-12)
    times = np.linspace(0, end, 201)
    asked = solve((0, end), t_eval=times)
    np.testing.assert_array_equal(asked.t, times)
    last = np.searchsorted(expected, times) - 1
    after = times - np.where(last < 0, 0.0, expected[last])
    up = np.where(last < 0, 0.0, np.sqrt(2 * G) * 0.9 ** (last + 1.0))
    height = np.where(last < 0, 1.0, 0.0) + up * after - G * after**2 / 2
    np.testing.assert_allclose(asked["h"], height, atol=1e-8)
    if method != "IDA":
        np.testing.assert_allclose(run.at(times)["h"], height, atol=1e-8)


def test_events_are_a_mapping_by_name_and_a_list_by_number(bouncing: Any) -> None:
    run = bouncing.simulate((0, 1.0))
    for found in (run.t_events, run.x_events):
        assert "floor" in found
        assert "ceiling" not in found
        assert tuple(found.keys()) == ("floor", "apex")
        for k, (name, values) in enumerate(found.items()):
            assert values is found[name] is found[k] is found.values()[k]
            assert values in found
        assert found.get("ceiling") is None
    assert "floor" in pickle.loads(pickle.dumps(run.t_events))
    refuses("EG-NAME-UNKNOWN floor?", lambda: run.t_events["flor"])


def two_bars() -> eg.Model:
    """A double pendulum whose lower end hits a wall: the impulse reaches both joints."""
    m = eg.Model("wall", gravity=(0, -G, 0))
    upper = m.body("upper", mass=1.0, com=(0, -0.5, 0), inertia={"zz": 0.08})
    lower = m.body("lower", mass=0.7, com=(0, -0.4, 0), inertia={"zz": 0.05})
    m.revolute("A", m.ground, upper, coordinate="a")
    m.revolute("B", upper.at(0, -1, 0), lower, coordinate="b")
    tip = lower.marker("tip", at=(0, -0.8, 0))
    m.event("wall", tip.position[0] + 0.3, restitution=0.6)
    m.output("gap", tip.position[0] + 0.3)
    m.output("rate", tip.velocity[0])
    m.initial(a=0.9, b=0.2)
    return m


def test_an_impact_obeys_newtons_law_and_momentum() -> None:
    mod = two_bars().compile(target="numpy")
    run = mod.simulate((0, 2.0), rtol=1e-10, atol=1e-12)
    hits = run.t_events["wall"]
    assert len(hits) >= 2
    assert run["gap"].min() > -1e-9
    for t, before in zip(hits, run.x_events["wall"].T, strict=True):
        after = run.x[:, np.flatnonzero(run.t == t)[-1]]
        h, q = 1e-6, before[:2]
        slope = np.array([(gap(mod, q + h * e) - gap(mod, q - h * e)) / (2 * h) for e in np.eye(2)])
        jump, M = (after - before)[2:], mod.mass_matrix(q)
        assert slope @ after[2:] == pytest.approx(-0.6 * (slope @ before[2:]), rel=1e-6)
        impulse = M @ jump
        assert abs(impulse @ np.array([-slope[1], slope[0]])) < 1e-7 * np.linalg.norm(impulse)  # along the gap alone
    again = mod.simulate((0, 2.0), rtol=1e-10, atol=1e-12, method="LSODA")
    np.testing.assert_allclose(again.t_events["wall"][:2], hits[:2], atol=1e-7)
    other = mod.simulate_impacts((0, hits[1] + 0.01), {"gap": 0.6}, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose([t for t, _ in other.impacts], hits[:2], atol=1e-8)


def gap(mod: Any, q: np.ndarray) -> float:
    return float(mod.outputs(0.0, np.concatenate([q, np.zeros(2)]))[0])


@pytest.mark.parametrize("target", TARGETS)
def test_a_reset_in_a_loop_is_brought_back_onto_it(target: str) -> None:
    m = models.build("slider_crank")
    m.event("kick", "sin(theta)", direction=1, reset={"theta_dot": "1.1*theta_dot"})
    mod = m.compile(target=target)
    run = mod.simulate((0, 2), {"theta": 0.3, "theta_dot": 10.0}, rtol=1e-9, atol=1e-11)
    assert len(run.t_events["kick"]) >= 2
    assert run.residuals.raw_velocity < 1e-6
    k = int(np.flatnonzero(np.diff(run.t) == 0.0)[0])
    assert run["theta_dot"][k + 1] == pytest.approx(1.1 * run["theta_dot"][k], rel=0.1)
    theta = run.x_events["kick"][mod.q_names.index("theta")]
    np.testing.assert_allclose(theta, 2 * np.pi * np.round(theta / (2 * np.pi)), atol=1e-9)
    assert np.abs(mod.velocity_constraints(run.x[:, k + 1])).max() < 1e-9


@pytest.fixture(scope="module")
def swing() -> Any:
    return compiled("pendulum", "cython")


@pytest.mark.parametrize(("method", "target"), [("DOP853", "numpy"), ("RK45", "cython"), ("LSODA", "cython")])
def test_texts_functions_and_mappings(method: str, target: str) -> None:
    swing = compiled("pendulum", target)
    name = swing.q_names[0]

    def through(t: float, x: np.ndarray) -> float:
        return float(x[0])

    options = {"method": method, **TIGHT}
    texts = swing.simulate((0, 10), events=[name, f"{name}_dot", through], **options)
    theirs = solve_ivp(
        swing.rhs, (0, 10), swing.x0(), method="DOP853", events=[through, lambda t, x: x[1]], rtol=1e-11, atol=1e-13
    )
    np.testing.assert_allclose(texts.t_events[name], theirs.t_events[0], atol=1e-7)
    np.testing.assert_allclose(texts.t_events["through"], texts.t_events[name], atol=1e-10)
    first = texts.t_events[1]
    np.testing.assert_allclose(first[first > 1e-6], theirs.t_events[1][theirs.t_events[1] > 1e-6], atol=1e-6)
    rising = {"up": {"expression": f"{name} - 0*t", "direction": 1, "terminal": 2}}
    run = swing.simulate((0, 10), events=rising, **options)
    up = [t for t in theirs.t_events[0] if theirs.y_events[0][list(theirs.t_events[0]).index(t)][1] > 0]
    assert run.status == 1
    assert run.t[-1] == run.t_events["up"][-1] == pytest.approx(up[1], abs=1e-7)


@pytest.mark.parametrize(("times", "count"), [(True, 1), (2, 2), (2.0, 2), (np.int64(3), 3), (False, 4), (None, 4)])
def test_a_run_ends_at_the_times_requested(swing: Any, times: Any, count: int) -> None:
    """As often as that, in compiled code and with a function of Python."""

    def height(t: float, x: np.ndarray) -> float:
        return float(x[0])

    height.terminal = times  # type: ignore[attr-defined]
    for events in (height, {"low": {"expression": swing.q_names[0], "terminal": 0 if times is None else times}}):
        run = swing.simulate((0, 4.2), {swing.q_names[0]: 0.5}, events=events)
        assert (len(run.t_events[0]), run.status) == (count, int(count < 4))


@pytest.mark.parametrize("method", ["DOP853", "BDF"])
def test_an_event_without_a_value_is_reported(swing: Any, method: str) -> None:
    q = swing.q_names[0]
    with pytest.warns(UserWarning, match="event gap") as told:
        run = swing.simulate((0, 1.5), {q: 0.5}, events={"gap": f"log(-1 - {q}**2)", "low": q}, method=method)
    assert told[0].filename == __file__
    assert [len(run.t_events[k]) for k in ("gap", "low")] == [0, 1]


@pytest.mark.parametrize(
    ("events", "words"),
    [
        ("thteta", "EG-NAME-UNKNOWN 'thteta'"),
        ("__import__('os')", "EG-EXPRESSION expression"),
        (3.0, "EG-TYPE expression"),
        ({"a": {"expression": "t - 1", "direction": 2}}, "EG-CHOICE direction 1 -1 0"),
        ({"a": {"expresion": "t - 1"}}, "EG-NAME-UNKNOWN expression?"),
    ],
)
def test_wrong_events(swing: Any, events: Any, words: str) -> None:
    refuses(words, swing.simulate, (0, 1), events=events)


def test_a_zero_at_the_start_is_as_in_scipy(swing: Any) -> None:
    x0 = swing.x0()
    for sign in (1.0, -1.0):
        for direction in (-1, 0, 1):

            def leaves(t: float, x: np.ndarray, sign: float = sign) -> float:
                return sign * t

            leaves.direction = direction  # type: ignore[attr-defined]
            theirs = solve_ivp(swing.rhs, (0, 1), x0, method="DOP853", events=leaves)
            ours = swing.simulate((0, 1), x0, events=leaves)
            np.testing.assert_allclose(ours.t_events[0], theirs.t_events[0], atol=1e-14)


def test_what_a_function_raises_comes_out(swing: Any) -> None:
    def broken(t: float, x: np.ndarray) -> float:
        raise LookupError("no table here")

    with pytest.raises(LookupError, match="no table here"):
        swing.simulate((0, 1), events=broken)


def kicked(when: str) -> eg.Model:
    m = eg.Model("kicked")
    m.prismatic("s", m.ground, m.body("a", mass=1.0), axis="x")
    m.torque("f", "s", m.input("u"))
    m.event("kick", when, reset={"s_dot": "s_dot + 2"})
    return m


def test_a_reset_at_the_very_end_and_at_a_corner() -> None:
    mod = kicked("t - 1").compile(target="numpy")
    assert mod.simulate(1.0)["s_dot"][-1] == 2.0
    table = ([0.0, 1.0, 2.0], [0.0, 0.0, 1.0])
    np.testing.assert_allclose(mod.simulate(2.0, inputs={"u": table})["s_dot"][-1], 2.5, rtol=1e-9)


def test_a_single_step_passes_over_no_reset(bouncing: Any) -> None:
    refuses("EG-UNSUPPORTED events", lambda: bouncing.step(0.0, bouncing.x0(), 0.5))


@pytest.mark.parametrize("method", ["DOP853", "LSODA"])
@pytest.mark.parametrize("law", ["reset", "impact"])
def test_scipys_methods_find_all_events_of_one_instant(law: str, method: str) -> None:
    """solve_ivp tells of the first alone; the other bodies fell through the floor."""
    m = eg.Model("three", gravity=(0, -G, 0))
    for name in "abc":
        m.prismatic(f"J{name}", m.ground, m.body(name, mass=1.0), axis="y", coordinate=name)
        reset = {"direction": -1, "reset": {f"{name}_dot": f"-0.5*{name}_dot"}}
        m.event(f"floor_{name}", name, **(reset if law == "reset" else {"restitution": 0.5}))
    run = m.compile(target="numpy").simulate(0.8, dict.fromkeys("abc", 1.0), method=method, **TIGHT)
    fall = np.sqrt(2 / G)
    after = 0.8 - fall
    np.testing.assert_allclose(run.x[:3, -1], 0.5 * G * fall * after - 0.5 * G * after**2, atol=1e-7)
    assert [len(times) for times in run.t_events] == [1, 1, 1]


@pytest.mark.parametrize("speed", [-0.1, 0.0, 0.1])
@pytest.mark.parametrize("target", TARGETS)
def test_an_input_that_jumps_over_an_event_against_the_motion_is_no_zeno(speed: float, target: str) -> None:
    """A push of 0.25 m/s when the lever goes from 0 to 1, whichever way the motion changes the value; closed form."""
    m = models.switched_by_lever(speed)
    lever = eg.Signal([0.0, 0.5], [0.0, 1.0], "zero-order")
    run = m.compile(target=target).simulate(2.0, inputs={"lever": lever}, t_eval=[0.5, 1.0, 2.0], **TIGHT)
    np.testing.assert_allclose(run["s"], np.array([0.0, 0.125, 0.375]) + speed * run.t, atol=1e-9)


def spring() -> eg.Model:
    m = eg.Model("spring")
    m.prismatic("slide", m.ground, m.body("bob", mass=2.0), axis="x", coordinate="q")
    u = m.input("u")
    m.torque("pull", "slide", u - 0.1 * m.coordinate("q_dot") - 3 * m.coordinate("q"))
    m.initial(q=1)
    m.sampled("given", period=0.25)
    m.output("gap", "q + 5")
    return m


@pytest.mark.parametrize("target", TARGETS)
def test_functions_that_change_what_they_are_given_change_no_run(target: str) -> None:
    mod = spring().compile(target=target, **(IN_C if target == "cython" else {}))
    truth = mod.simulate((0, 1), **TIGHT).x

    def changing(t: float, x: Any) -> float:
        x *= 0.9
        return 1.0 + 0.0 * float(x[0])

    def untouched(t: float, x: Any) -> float:
        assert x[0] != 5.0  # by the one before
        x[0] = 5.0
        return 1.0

    plain = {"u": lambda t, x: 1.0}
    pushed = mod.simulate((0, 1), inputs=plain, **TIGHT).x[:, -1]
    slopes = mod.simulate_impacts((0, 1), {"gap": 1.0}, inputs=plain).x[:, -1]
    for method in ("DOP853", "RK45", "RK23", "Radau", "BDF", "LSODA", type("Own", (DOP853,), {})):
        loose = 1e-5 if method in ("BDF", "LSODA") else 1e-7
        run = mod.simulate((0, 1), events=[untouched, untouched], method=method, **TIGHT)
        np.testing.assert_allclose(run.x[:2, -1], truth[:2, -1], atol=loose, err_msg=str(method))
        run = mod.simulate((0, 1), inputs={"u": changing}, method=method, **TIGHT)
        np.testing.assert_allclose(run.x[:2, -1], pushed[:2], atol=loose, err_msg=str(method))
    run = mod.simulate((0, 1), controllers={"given": changing}, **TIGHT)
    np.testing.assert_allclose(run.x[:2, -1], truth[:2, -1], atol=1e-7)
    assert run["given"][-1] == 1.0
    run = mod.simulate_impacts((0, 1), {"gap": 1.0}, inputs={"u": changing})
    np.testing.assert_allclose(run.x[:2, -1], slopes[:2], atol=1e-7)


@pytest.mark.parametrize("target", TARGETS)
def test_a_function_that_gives_no_number_is_refused_by_name(target: str) -> None:
    """As an input is; one that is no number only beyond the end of the run, where rates are taken, is not."""
    mod = spring().compile(target=target, **(IN_C if target == "cython" else {}))

    def broken(t: float, x: Any) -> float:
        return np.nan if x[0] < 0.5 else x[0] - 0.4

    methods = ("DOP853", "RK45", "RK23", "Radau", "LSODA")
    for method in methods:
        refuses("EG-NUMBER broken nan", mod.simulate, (0, 1), events=[broken], method=method)
        run = mod.simulate((0, 1), events=[lambda t, x: t - 0.75 if t <= 1 else np.nan], method=method)
        assert run.t_events[-1] == pytest.approx([0.75], abs=1e-9)
    refuses("EG-NUMBER broken nan", mod.dae.solve, (0, 1), events=[broken])
    for value, text in ((None, "None"), (1j, "1j"), (np.ones(2), "array([1."), ("a", "'a'")):
        for method in ("DOP853", "LSODA"):
            with refused(f"EG-NUMBER odd {text}"):
                mod.simulate((0, 1), events={"odd": lambda t, x, value=value: value}, method=method)
        refuses(f"EG-NUMBER odd {text}", mod.dae.solve, (0, 1), events={"odd": lambda t, x, value=value: value})


# -- the same events through every loop of steps find the same times, states and ends ----------------------------------
COMPILED = ["RK45", "DOP853", "Radau", "Taylor", "RK4"]
STEPPED = ["RK23", "RK45", "DOP853", "Radau", "BDF", "LSODA"]

#: Error of the times of events: methods of low order keep fewer digits.
ERROR = {"BDF": 2e-6, "LSODA": 1e-6, "RK23": 1e-7, "IDA": 1e-6, "sensitivities": 1e-6}


@pytest.fixture(scope="module")
def modules() -> dict[str, Any]:
    return {target: compiled("hopper", target) for target in ("cython", "numpy")}


def levels(n: int) -> dict[str, Any]:
    """So many events, of every direction; two of them at one instant."""
    found: dict[str, Any] = {"same": "h - 0.05", "again": "2*h - 0.1"}
    for i in range(n):
        found[f"level{i}"] = {"expression": f"h - {0.04 * (i + 1):.2f}", "direction": (0, 1, -1)[i % 3]}
    return found


def passages(height: float, direction: int) -> np.ndarray:
    """Times at which the ball passes a height, by the closed form."""
    hits, found = [0.0, *bounces(), np.inf], []
    for k, start in enumerate(hits[:-1]):
        v, h0 = (0.0, 1.0) if k == 0 else (np.sqrt(2 * G) * E**k, 0.0)
        if (square := v * v + 2 * G * (h0 - height)) < 0.0:
            continue
        for sign, way in ((-1.0, 1), (1.0, -1)):
            t = (v + sign * np.sqrt(square)) / G
            if 1e-9 < t < min(hits[k + 1], END) - start and direction in (0, way):
                found.append(start + t)
    return np.array(found)


def loops(modules: dict[str, Any]) -> dict[str, Callable[..., Any]]:
    """Name of a loop -> events -> Trajectory."""

    def run(target: str, method: Any) -> Callable[..., Any]:
        options = {"step": 1e-3} if method == "RK4" else CLOSE
        return lambda events, **more: modules[target].simulate((0, END), method=method, events=events, **options | more)

    found = {f"cython {method}": run("cython", method) for method in COMPILED}
    found |= {f"numpy {method}": run("numpy", method) for method in STEPPED}
    found["own solver"] = run("cython", type("Own", (DOP853,), {}))
    found["numpy IDA"] = lambda events: modules["numpy"].dae.solve((0, END), events=events, max_step=0.02, **CLOSE)
    slopes = modules["cython"].sensitivities
    found["cython sensitivities"] = lambda events, **more: (
        slopes(["e"], (0, END), events=events, **CLOSE | more).trajectory
    )
    return found


@pytest.mark.parametrize("n", part_of([0, 6, 7, 18], lambda n: n in (0, 7)))
def test_any_number_of_events_in_every_loop(modules: dict[str, Any], n: int) -> None:
    events, hits = levels(n), bounces()
    last_rate = np.sqrt(2 * G) * E ** len(hits) - G * (END - hits[-1])
    for name, run in loops(modules).items():
        found, error = run(events), ERROR.get(name.split()[1], 1e-8)
        assert (found.status, found.t[-1]) == (0, END), name
        np.testing.assert_allclose(found.t_events["floor"], bounces(), atol=error, err_msg=name)
        np.testing.assert_allclose(found.t_events["same"], passages(0.05, 0), atol=error, err_msg=name)
        np.testing.assert_allclose(found.t_events["again"], found.t_events["same"], atol=1e-13, err_msg=name)
        for i in range(n):
            expected = passages(0.04 * (i + 1), (0, 1, -1)[i % 3])
            np.testing.assert_allclose(found.t_events[f"level{i}"], expected, atol=10 * error, err_msg=name)
        np.testing.assert_allclose(found["h_dot"][-1], last_rate, atol=30 * error, err_msg=name)


def test_an_event_that_is_no_number_leaves_the_others_alone(modules: dict[str, Any]) -> None:
    """A logarithm or root outside its domain, or a pole, is no event there; it once switched all of the model's off."""
    m = hopper()
    m.event("never", "log(h - 5)")
    m.event("above", "sqrt(h - 0.5) - sqrt(0.1)")  # no number below 0.5, a zero at 0.6
    m.event("pole", "(h - 0.2)/max(h - 0.1, 0)")  # infinite or no number below 0.1, a zero at 0.2
    m.event("other", "h - 50", reset={"h_dot": "sqrt(h - 50)"})  # its new value is one there only
    own = modules | {"cython": m.compile(**IN_C), "numpy": m.compile(target="numpy")}
    for name, run in loops(own).items():
        error = ERROR.get(name.split()[1], 1e-8)
        with pytest.warns(UserWarning, match="never"):
            found = run(None, **({} if "IDA" in name else {"max_step": 0.1}))
        np.testing.assert_allclose(found.t_events["floor"], bounces(), atol=error, err_msg=name)
        np.testing.assert_allclose(found.t_events["above"], passages(0.6, 0), atol=10 * error, err_msg=name)
        np.testing.assert_allclose(found.t_events["pole"], passages(0.2, 0), atol=10 * error, err_msg=name)
        assert len(found.t_events["never"]) == 0, name
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        many = own["cython"].simulate_many((0, END), {"h": np.ones(3)}, keep_events=200, **CLOSE)
    np.testing.assert_allclose(many.events("floor")[0][: len(bounces()), 0], bounces(), atol=1e-8)


GAPS = {  # of t: expression -> its zeros; none may be found where the expression is no number
    "sqrt((t - 0.3)*(t - 0.6)) - 0.05": [0.45 - np.sqrt(0.025), 0.45 + np.sqrt(0.025)],
    "(t - 0.45)/sqrt((t - 0.4)*(t - 0.46))": [],
    "log((t - 0.3)*(t - 0.6)) + 4": [0.45 - np.sqrt(0.0225 + np.exp(-4)), 0.45 + np.sqrt(0.0225 + np.exp(-4))],
    "sqrt(0.5 - t)": [0.5],
    "sqrt(t - 0.5)": [0.5],
    "sqrt(t - 0.4375)": [0.4375],
    "-sqrt(t - 0.5)": [0.5],
}


@pytest.mark.parametrize("text", GAPS)
def test_no_zero_is_found_in_a_gap_and_those_beside_it_are(modules: dict[str, Any], text: str) -> None:
    for target, methods in {"cython": COMPILED, "numpy": STEPPED}.items():
        for method in methods:
            options = {"step": 1 / 16} if method == "RK4" else {"max_step": 0.1}
            found = modules[target].simulate(0.9, {"h": 9.0}, method=method, events={"own": text}, **options)
            np.testing.assert_allclose(found.t_events["own"], GAPS[text], atol=1e-9, err_msg=f"{target} {method}")


@pytest.mark.parametrize("n", part_of([0, 6, 7, 18], lambda n: n == 7))
def test_resets_that_die_away_are_named_by_every_loop(modules: dict[str, Any], n: int) -> None:
    """Never status 0 before the end, and never through the floor: with 7 events a run once ended so at 1.35 s of 10."""
    events = levels(n)
    for target, methods in {"cython": ["RK45", "DOP853", "Radau", "Taylor"], "numpy": STEPPED}.items():
        for method in methods:
            with refused("EG-ZENO floor"):
                modules[target].simulate((0, 10), parameters={"e": 0.5}, events=events, method=method)
    refuses("EG-ZENO floor", lambda: modules["numpy"].dae.solve((0, 10), parameters={"e": 0.5}, events=events))
    many = modules["cython"].simulate_many((0, 10), {"h": np.ones(2)}, {"e": 0.5}, events=events, method="RK45")
    assert not many.ok.any()


@pytest.mark.parametrize("n", [1, 7])
def test_a_terminal_event_among_many(modules: dict[str, Any], n: int) -> None:
    events = levels(n) | {"stop": {"expression": "h - 0.3", "direction": 1, "terminal": 2}}
    expected = passages(0.3, 1)[1]
    for name, run in loops(modules).items():
        found = run(events)
        assert found.status == 1, name
        assert found.t[-1] == pytest.approx(expected, abs=ERROR.get(name.split()[1], 1e-8)), name


TOUCHES = {
    "square": "(t - 1)**2",
    "above": "sin(4*t) - 1",
    "below": {"expression": "1 + sin(4*t)", "direction": -1},
    "dip": "(t - 1.3)**2 - 1e-10",
    "misses": "(t - 0.7)**2 + 1e-9",
    "kink": "abs(h) + 1",
}


def test_a_value_that_only_touches_zero_is_found_by_every_loop(modules: dict[str, Any]) -> None:
    """As the docs promise; IDA, whose own root finding is used, sees changes of sign between its steps."""
    for name, run in loops(modules).items():
        if "IDA" in name:
            continue
        found = run(TOUCHES, **({} if name == "cython RK4" else {"max_step": 0.3}))
        np.testing.assert_allclose(found.t_events["square"], [1.0], atol=1e-6, err_msg=name)
        np.testing.assert_allclose(found.t_events["above"], [np.pi / 8, 5 * np.pi / 8], atol=1e-6, err_msg=name)
        np.testing.assert_allclose(found.t_events["below"], [3 * np.pi / 8], atol=1e-6, err_msg=name)
        np.testing.assert_allclose(found.t_events["dip"], [1.3 - 1e-5, 1.3 + 1e-5], atol=1e-9, err_msg=name)
        assert [len(found.t_events[k]) for k in ("misses", "kink")] == [0, 0], name


COARSE = {"rtol": 1e-4, "atol": 1e-4, "max_step": 0.3}
FLAT = ("(t - {a!r})**4", "(t - {a!r})**6", "abs(t - {a!r})**3", "sin(t - {a!r})**4", "-1e3*(t - {a!r})**4")


@pytest.mark.parametrize("target", ["cython", "numpy"])
def test_flat_touches_are_found_wherever_they_are(target: str) -> None:
    """In steps at one of whose ends the value is above 1e-10 of its size, as the docs say; corners are not found."""
    module = compiled("oscillator", target).bind({"k": 2.0})
    places = np.random.default_rng(4).uniform(0.05, 1.95, 12).tolist()
    for method in ("DOP853", "RK45"):
        for text in FLAT:
            run = module.simulate(2.0, [0.1, 0.0], events=[text.format(a=a) for a in places], method=method, **COARSE)
            assert len(run.t) < 20  # steps of 0.1 and more: (t - a)**6 is 1e-10 of its size 0.02 from its touch
            for a, found in zip(places, run.t_events, strict=True):
                np.testing.assert_allclose(found, [a], atol=1e-6, err_msg=f"{text} {a} {method}")
    corners = [text.format(a=a) for a in places for text in ("abs(t - {a!r})", "sqrt(abs(t - {a!r}))")]
    assert [len(found) for found in module.simulate(2.0, [0.1, 0.0], events=corners).t_events] == [0] * len(corners)


@pytest.mark.parametrize("offset", [0.0, 1e-12, -1e-9, 1e-7, -1e-6, 1e-5])
def test_a_touch_beside_the_end_of_a_step_is_found_once(offset: float) -> None:
    table = {"F": ([0.0, 1.0, 2.0], [0.0, 1.0, 0.0])}  # a corner at 1, where a step ends
    for target, methods in {"cython": ["RK45", "Radau"], "numpy": ["RK45", "LSODA"]}.items():
        mod = compiled("oscillator", target)
        for method in methods:
            run = mod.simulate(2.0, inputs=table, events={"touch": f"(t - 1 - {offset})**2"}, method=method)
            np.testing.assert_allclose(run.t_events["touch"], [1.0 + offset], atol=1e-6)


@pytest.mark.parametrize("target", TARGETS)
def test_a_reset_where_a_value_touches_zero_happens_once(target: str) -> None:
    run = kicked("(t - 1)**2").compile(target=target).simulate(2.0, method="RK45")
    assert (run.status, len(run.t_events["kick"])) == (0, 1)
    assert run["s_dot"][-1] == pytest.approx(2.0)
    assert run["s"][-1] == pytest.approx(2.0, abs=1e-5)


def test_a_solver_that_ends_early_in_silence_is_named(modules: dict[str, Any]) -> None:
    class Lazy(DOP853):
        def step(self) -> Any:
            message = super().step()
            if self.t > 1.35:
                self.status = "finished"
            return message

    refuses("EG-STALLED 2", lambda: modules["numpy"].simulate((0, END), method=Lazy))


@pytest.mark.quick
@pytest.mark.parametrize("text", ["h > 0.2", "h < 0.2 and h > 0.1"])
def test_a_comparison_has_no_zero(text: str) -> None:
    model = hopper()
    model.event("passes", text)
    refuses("EG-EVENT comparison", model.check)
    run = hopper().compile(target="numpy").simulate
    refuses("EG-EVENT comparison", run, 0.1, events=[text])
    refuses("EG-EVENT comparison", run, 0.1, events={"low": {"expression": text, "terminal": True}})


# -- events beside corners of inputs, jumps, values that start at zero, floors that move, events by the hundre ---------
STOP_AT = 1.8  #: s
FLOOR = 1000.0 + 1.0 / 3.0  #: (m) so high that heights beside it are many roundings of time apart


@pytest.fixture(scope="module", params=TARGETS)
def pushed(request: pytest.FixtureRequest) -> Any:
    """A ball on a rail; an input pushes a cart beside it, whose corners split the run and leave the ball alone."""
    m = eg.Model("pushed", gravity=(0, -G, 0))
    push = m.input("push")
    m.prismatic("J", m.ground, m.body("ball", mass=1.0), axis="y", coordinate="h")
    m.prismatic("K", m.ground, m.body("cart", mass=1.0), axis="x", coordinate="s")
    m.torque("pushing", "K", push)
    m.event("floor", "3*(h - 1000) - 1", direction=-1, reset={"h_dot": -E * m.coordinate("h_dot")})
    return m.compile(target=request.param)


@pytest.mark.parametrize("bounce", [0, 1])
@pytest.mark.parametrize("method", ["DOP853", "RK45", "Radau"])
def test_a_reset_beside_a_corner_of_an_input_is_one_reset(pushed: Any, method: str, bounce: int) -> None:
    """Truth: the closed form; the corner is units in the last place away from where a bounce is found."""
    for height in (0.8, 1.2):
        first = np.sqrt(2.0 * height / G)
        bounces = first * np.array([1.0, 1.0 + 2.0 * E])
        corner = float(bounces[bounce])
        for ulps in (0, 0, -2, -1, 1, 2, 8):  # the first run tells where a bounce is found
            at = corner + ulps * np.spacing(corner)
            inputs = {"push": ([0.0, at, STOP_AT], [0.0, 1.0, 1.0])}
            run = pushed.simulate((0, STOP_AT), {"h": FLOOR + height}, inputs=inputs, method=method, **CLOSE)
            found, error = run.t_events["floor"][:2], f"{height} m, {ulps} units"
            np.testing.assert_allclose(found, bounces, rtol=0, atol=1e-9, err_msg=error)
            assert run.t[-1] == STOP_AT
            corner = float(found[bounce]) if ulps == 0 else corner


LOOPS = [*(("cython", method) for method in (*STEPPED, "RK4", "Taylor")), *(("numpy", method) for method in STEPPED)]
JUMPS = 9


@pytest.fixture(scope="module")
def jumps() -> dict[str, Any]:
    """A ball that falls, with kicks at nine times."""
    m = eg.Model("thrown", gravity=(0, -9.81, 0))
    m.prismatic("J", m.ground, m.body("ball", mass=1.0), axis="y", coordinate="h")
    m.initial(h=1.0)
    for k in range(JUMPS):
        m.event(f"e{k}", f"1 if t > {0.1 * (k + 1)!r} else -1", reset={"h_dot": "h_dot + 1"})
    return {target: m.compile(target=target) for target in ("cython", "numpy")}


@pytest.mark.parametrize(("target", "method"), LOOPS)
def test_a_ball_thrown_up_from_the_floor_lands(target: str, method: str) -> None:
    """Also where one step holds the whole flight, as Taylor takes it."""
    lands = 2 * 5.0 / 9.81
    given = {"step": 1.2 * lands} if method == "RK4" else {"first_step": 1.2 * lands}
    given = {} if method == "Taylor" else given
    run = compiled("hopper", target).simulate(
        1.25 * lands, {"h": 0.0, "h_dot": 5.0}, method=method, rtol=1e-9, atol=1e-11, **given
    )
    assert np.asarray(run.t_events["floor"]) == pytest.approx([lands], rel=1e-6)
    rest = 0.25 * lands
    assert run["h"][-1] == pytest.approx(4.5 * rest - 9.81 / 2 * rest**2, abs=1e-5)


@pytest.mark.parametrize(("target", "method"), LOOPS)
def test_a_value_that_jumps_resets_once(jumps: dict[str, Any], target: str, method: str) -> None:
    given = {"step": 0.013} if method == "RK4" else {}
    run = jumps[target].simulate(1.5, method=method, **given)
    for k in range(JUMPS):
        assert np.asarray(run.t_events[f"e{k}"]) == pytest.approx([0.1 * (k + 1)], abs=1e-12)
    true = 1.0 - 9.81 / 2 * 1.5**2 + sum(1.5 - 0.1 * (k + 1) for k in range(JUMPS))
    assert run["h"][-1] == pytest.approx(true, abs=1e-6)


REST, SPEED = 0.6, 0.8


def ball_on_floor(floor: str, **inputs: float) -> eg.Model:
    m = eg.Model("ball", gravity=(0, 0, -9.81))
    m.prismatic("J", m.ground, m.body("ball", mass=1.0), axis="z", coordinate="z")
    for name, value in inputs.items():
        m.input(name, value)
    m.event("bounce", f"z - {floor}", direction=-1, restitution=REST)
    return m


@pytest.mark.quick
@pytest.mark.parametrize("method", ["DOP853", "LSODA"])
@pytest.mark.parametrize("way", ["in time", "by an input"])
def test_a_floor_that_rises(way: str, method: str) -> None:
    """Seen from the floor, z - V t falls from 1 m at the speed V and rises at e times the speed of the impact."""
    moving, given = (f"{SPEED}*t", {}) if way == "in time" else ("h", {"h": f"{SPEED}*t"})
    mod = ball_on_floor(moving, **({"h": 0.0} if given else {})).compile(target="numpy")
    run = mod.simulate(0.9, {"z": 1.0, "z_dot": 0.0}, inputs=given, method=method, rtol=1e-10, atol=1e-12)
    fall = (-SPEED + np.sqrt(SPEED**2 + 2 * 9.81)) / 9.81
    hit = -(SPEED + 9.81 * fall)
    assert run.t_events["bounce"][0] == pytest.approx(fall, abs=1e-7)
    after = 0.9 - fall
    assert after < 2 * REST * abs(hit) / 9.81
    assert run["z_dot"][-1] == pytest.approx(SPEED - REST * hit - 9.81 * after, abs=1e-6)
    assert run["z"][-1] == pytest.approx(SPEED * 0.9 - REST * hit * after - 9.81 * after**2 / 2, abs=1e-6)


MANY = 120
LEVELS = (np.linspace(0.0, 0.09, MANY) + 1e-3).tolist()


@pytest.fixture(scope="module")
def crowded() -> Any:
    m = eg.Model("many", gravity=(0.0, 0.0, 0.0))
    m.prismatic("s", m.ground, m.body("a", mass=1.0), axis="x")
    m.torque("f", "s", "-k*s + 0*u")
    m.parameter("k", 25.0)
    m.input("u")
    m.initial(s_dot=0.5)  # s = 0.1 sin 5 t
    for k, level in enumerate(LEVELS):
        m.event(f"e{k}", f"s - {level!r}")
    return m.compile(target="numpy")


def test_events_by_the_hundred(crowded: Any) -> None:
    """120 events, each found up and down; one by one they would take minutes."""
    begun = process_time()
    run = crowded.simulate(1.0, inputs={"u": lambda t, x: 3.0 * t}, rtol=1e-10, atol=1e-12)
    for k, level in enumerate(LEVELS):  # up and down within the first half period
        up = np.arcsin(level / 0.1) / 5.0
        np.testing.assert_allclose(run.t_events[k][:2], [up, np.pi / 5.0 - up], atol=1e-7)
        np.testing.assert_allclose(run.x_events[k][0], level, atol=1e-12)
    found = crowded.sensitivities("k", 0.2)
    assert sum(len(times) for times in found.trajectory.t_events) > 80
    assert process_time() - begun < 30.0


def test_events_by_the_hundred_by_ida(crowded: Any) -> None:
    pytest.importorskip("sksundae")
    run = crowded.dae.solve(0.3, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose([times[0] for times in run.t_events], np.arcsin(np.array(LEVELS) / 0.1) / 5.0, atol=1e-6)
