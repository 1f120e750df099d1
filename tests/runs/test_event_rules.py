"""The same events through every loop of steps find the same times, states and ends; none ends early in silence."""

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from analysed import compiled
from models import IN_C
from refusals import refused, refuses
from scipy.integrate import DOP853
from sweeps import TARGETS, part_of

import eomgen as eg

G, E, END = 9.81, 0.9, 2.0
TIGHT = {"rtol": 1e-10, "atol": 1e-12}
COMPILED = ["RK45", "DOP853", "Radau", "Taylor", "RK4"]
STEPPED = ["RK23", "RK45", "DOP853", "Radau", "BDF", "LSODA"]

#: Error of the times of events: methods of low order keep fewer digits.
ERROR = {"BDF": 2e-6, "LSODA": 1e-6, "RK23": 1e-7, "IDA": 1e-6, "sensitivities": 1e-6}


def ball(name: str = "ball", **floor: Any) -> eg.Model:
    m = eg.Model(name, gravity=(0, -G, 0))
    e = m.parameter("e", E)
    m.prismatic("J", m.ground, m.body("ball", mass=1.0), axis="y", coordinate="h")
    m.initial(h=1.0)
    m.event("floor", "h", **({"direction": -1, "reset": {"h_dot": -e * m.coordinate("h_dot")}} | floor))
    return m


@pytest.fixture(scope="module")
def modules() -> dict[str, Any]:
    return {target: compiled("hopper", target) for target in ("cython", "numpy")}


def levels(n: int) -> dict[str, Any]:
    """So many events, of every direction; two of them at one instant."""
    found: dict[str, Any] = {"same": "h - 0.05", "again": "2*h - 0.1"}
    for i in range(n):
        found[f"level{i}"] = {"expression": f"h - {0.04 * (i + 1):.2f}", "direction": (0, 1, -1)[i % 3]}
    return found


def floors(e: float = E, end: float = END) -> np.ndarray:
    times, gap = [np.sqrt(2 / G)], 2 * e * np.sqrt(2 / G)
    while times[-1] + gap < end:
        times.append(times[-1] + gap)
        gap *= e
    return np.array(times)


def passages(height: float, direction: int) -> np.ndarray:
    """Times at which the ball passes a height, by the closed form."""
    hits, found = [0.0, *floors(), np.inf], []
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
        options = {"step": 1e-3} if method == "RK4" else TIGHT
        return lambda events, **more: modules[target].simulate((0, END), method=method, events=events, **options | more)

    found = {f"cython {method}": run("cython", method) for method in COMPILED}
    found |= {f"numpy {method}": run("numpy", method) for method in STEPPED}
    found["own solver"] = run("cython", type("Own", (DOP853,), {}))
    found["numpy IDA"] = lambda events: modules["numpy"].dae.solve((0, END), events=events, max_step=0.02, **TIGHT)
    slopes = modules["cython"].sensitivities
    found["cython sensitivities"] = lambda events, **more: (
        slopes(["e"], (0, END), events=events, **TIGHT | more).trajectory
    )
    return found


@pytest.mark.parametrize("n", part_of([0, 6, 7, 18], lambda n: n in (0, 7)))
def test_any_number_of_events_in_every_loop(modules: dict[str, Any], n: int) -> None:
    events = levels(n)
    for name, run in loops(modules).items():
        found, error = run(events), ERROR.get(name.split()[1], 1e-8)
        assert (found.status, found.t[-1]) == (0, END), name
        np.testing.assert_allclose(found.t_events["floor"], floors(), atol=error, err_msg=name)
        np.testing.assert_allclose(found.t_events["same"], passages(0.05, 0), atol=error, err_msg=name)
        np.testing.assert_allclose(found.t_events["again"], found.t_events["same"], atol=1e-13, err_msg=name)
        for i in range(n):
            expected = passages(0.04 * (i + 1), (0, 1, -1)[i % 3])
            np.testing.assert_allclose(found.t_events[f"level{i}"], expected, atol=10 * error, err_msg=name)
        np.testing.assert_allclose(found["h_dot"][-1], last_rate(), atol=30 * error, err_msg=name)


def last_rate() -> float:
    k, start = len(floors()), float(floors()[-1])
    return float(np.sqrt(2 * G) * E**k - G * (END - start))


def test_an_event_that_is_no_number_leaves_the_others_alone(modules: dict[str, Any]) -> None:
    """A logarithm or root outside its domain, or a pole, is no event there; it once switched all of the model's off."""
    m = ball("beside")
    m.event("never", "log(h - 5)")
    m.event("above", "sqrt(h - 0.5) - sqrt(0.1)")  # no number below 0.5, a zero at 0.6
    m.event("pole", "(h - 0.2)/max(h - 0.1, 0)")  # infinite or no number below 0.1, a zero at 0.2
    m.event("other", "h - 50", reset={"h_dot": "sqrt(h - 50)"})  # its new value is one there only
    own = modules | {"cython": m.compile(**IN_C), "numpy": m.compile(target="numpy")}
    for name, run in loops(own).items():
        error = ERROR.get(name.split()[1], 1e-8)
        with pytest.warns(UserWarning, match="never"):
            found = run(None, **({} if "IDA" in name else {"max_step": 0.1}))
        np.testing.assert_allclose(found.t_events["floor"], floors(), atol=error, err_msg=name)
        np.testing.assert_allclose(found.t_events["above"], passages(0.6, 0), atol=10 * error, err_msg=name)
        np.testing.assert_allclose(found.t_events["pole"], passages(0.2, 0), atol=10 * error, err_msg=name)
        assert len(found.t_events["never"]) == 0, name
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        many = own["cython"].simulate_many((0, END), {"h": np.ones(3)}, keep_events=200, **TIGHT)
    np.testing.assert_allclose(many.events("floor")[0][: len(floors()), 0], floors(), atol=1e-8)


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


@pytest.mark.parametrize("target", ["cython", "numpy"])
def test_ensembles_meet_them_as_well(modules: dict[str, Any], target: str) -> None:
    options = {"method": "RK45", "events": levels(12), "keep_events": 200, **TIGHT}
    many = modules[target].simulate_many((0, END), {"h": np.array([1.0, 0.9, 1.0])}, **options)
    assert (many.status == 0).all()
    assert (many.t_end == END).all()
    for name, expected in {"floor": floors(), "same": passages(0.05, 0), "level4": passages(0.2, 1)}.items():
        np.testing.assert_allclose(many.events(name)[0][: len(expected), 0], expected, atol=1e-8, err_msg=name)


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
    m = eg.Model("kicked")
    m.prismatic("s", m.ground, m.body("a", mass=1.0), axis="x")
    m.event("kick", "(t - 1)**2", reset={"s_dot": "s_dot + 2"})
    run = m.compile(target=target).simulate(2.0, method="RK45")
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
    model = ball()
    model.event("passes", text)
    refuses("EG-EVENT comparison", model.check)
    run = ball().compile(target="numpy").simulate
    refuses("EG-EVENT comparison", run, 0.1, events=[text])
    refuses("EG-EVENT comparison", run, 0.1, events={"low": {"expression": text, "terminal": True}})
