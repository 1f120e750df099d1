"""Sampled states: digital controllers against their difference equations, written out by hand."""

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from models import IN_C
from refusals import refused, refuses
from sweeps import TARGETS

import eomgen as eg

MASS, TARGET = 2.0, 0.1
GAINS = {"kp": 8.0, "ki": 5.0, "kd": 4.0}
LAW = {"z": "z + T*(target - s)", "u": "kp*(target - s) + ki*z - kd*s_dot"}
TEXT = """
name: servo
parameters: {T: {value: 100, unit: ms}, first: 0, kp: 8, ki: 5, kd: 4}
inputs: {target: 0.1}
bodies: {sledge: {mass: 2}}
joints: {slide: {type: prismatic, between: [ground, sledge], axis: x, coordinate: s}}
forces: {motor: {type: actuator, joint: s, value: u}}
states:
  z: {sampled: z + T*(target - s), period: T, offset: first}
  u: {sampled: kp*(target - s) + ki*z - kd*s_dot, period: T, offset: first, doc: force of the drive}
outputs: {push: force(motor)}
"""


def servo(order: str = "zu") -> eg.Model:
    """A mass that a controller holds in place."""
    m = eg.Model("servo")
    for name, value in ({"T": 0.1, "first": 0.0} | GAINS).items():
        m.parameter(name, value)
    sledge = m.body("sledge", mass=MASS)
    m.prismatic("slide", m.ground, sledge, axis="x", coordinate="s")
    m.input("target", TARGET)
    for name in order:
        m.sampled(name, LAW[name], "T", offset="first")
    m.actuator("motor", "s", value="u")
    return m


def by_hand(
    end: float, instants: Any, T: float = 0.1, order: str = "zu", kp: float = 8.0, start: float = 0.0
) -> np.ndarray[Any, Any]:
    """s, s_dot, z, u: the exact motion under a force that is constant between the instants."""
    s, v, z, u, t = 0.0, 0.0, 0.0, 0.0, start
    for k, now in enumerate((*instants, end)):
        h = now - t
        s, v, t = s + h * v + 0.5 * h * h * u / MASS, v + h * u / MASS, now
        if k < len(instants):
            for name in order:
                if name == "z":
                    z += T * (TARGET - s)
                else:
                    u = kp * (TARGET - s) + GAINS["ki"] * z - GAINS["kd"] * v
    return np.array([s, v, z, u])


@pytest.fixture(scope="module")
def module() -> Any:
    """The servo in C."""
    return servo().compile(**IN_C)


@pytest.mark.parametrize("method", ["DOP853", "Radau", "LSODA"])
def test_runs_are_those_of_the_difference_equations(module: Any, method: str) -> None:
    run = module.simulate(1.05, method=method)
    exact = by_hand(1.05, 0.1 * np.arange(11))
    loose = 1e-6 if method in ("BDF", "LSODA") else 1e-12  # the others follow a parabola exactly
    assert np.abs(run.x[:4, -1] - exact).max() < loose
    assert np.abs(run.t_events["z_sampled"] - 0.1 * np.arange(11)).max() < 1e-15
    assert run["z_samples"][-1] == 11


@pytest.mark.parametrize("order", ["zu", "uz"])
def test_values_are_renewed_in_the_order_of_their_declaration(order: str) -> None:
    run = servo(order).compile(target="numpy").simulate(1.05)
    exact = by_hand(1.05, 0.1 * np.arange(11), order=order)
    names = ("s", "s_dot", "z", "u")
    assert np.abs([run[name][-1] for name in names] - exact).max() < 1e-12
    other = by_hand(1.05, 0.1 * np.arange(11), order=order[::-1])
    assert np.abs(other - exact).max() > 1e-3


@pytest.mark.parametrize(
    ("start", "first", "instants"),
    [
        (0.3, 0.0, 0.1 * np.arange(3, 11)),
        (0.1 + 0.2, 0.0, 0.1 * np.arange(3, 11)),  # 0.30000000000000004
        (0.35, 0.0, 0.1 * np.arange(4, 11)),
        (0.0, 0.037, 0.037 + 0.1 * np.arange(11)),
        (0.337, 0.037, 0.337 + 0.1 * np.arange(8)),
        (-0.5, 0.0, 0.1 * np.arange(11)),  # no samples before the offset
    ],
)
def test_a_run_that_begins_later_takes_the_samples_from_there(
    module: Any, start: float, first: float, instants: Any
) -> None:
    run = module.simulate((start, 1.05), parameters={"first": first})
    assert np.abs(run.t_events["z_sampled"] - instants).max() < 1e-13
    assert np.abs(run.x[:4, -1] - by_hand(1.05, instants, start=start)).max() < 1e-12


def test_every_start_at_a_sampling_time_samples_there(module: Any) -> None:
    for start in (x for k in range(1, 400, 37) for x in (0.1 * k, k / 10, np.nextafter(0.1 * k, 0.0))):
        found = module.simulate((start, start + 0.15)).t_events["z_sampled"]
        assert np.abs(found - [start, start + 0.1]).max() < 1e-12


@pytest.mark.parametrize("cut", [0.55, 0.30000000000000004])
def test_a_run_in_parts_is_the_run_in_one(module: Any, cut: float) -> None:
    whole = module.simulate(1.05)
    second = module.simulate((cut, 1.05), initial=module.simulate(cut))
    assert np.abs(second.x[:, -1] - whole.x[:, -1]).max() < 1e-13


def test_many_runs(module: Any) -> None:
    many = module.simulate_many((0.0, 1.02), parameters={"T": [0.1, 0.05, 0.13], "kp": [8.0, 7.0, 9.0]})
    for k, (T, kp) in enumerate(((0.1, 8.0), (0.05, 7.0), (0.13, 9.0))):
        instants = T * np.arange(int(1.02 / T) + 1)
        assert np.abs(many.x[:4, k] - by_hand(1.02, instants, T=T, kp=kp)).max() < 1e-12
    late = module.simulate_many((0.35, 1.02), initial={"s": [0.0, 0.0]})
    assert np.abs(late.x[:4, 1] - by_hand(1.02, 0.1 * np.arange(4, 11), start=0.35)).max() < 1e-12


@pytest.mark.parametrize("start", [0.0, 0.35])
def test_sensitivities_by_gains_and_period(module: Any, start: float) -> None:
    found = module.sensitivities(["kp", "T"], (start, 1.05))
    count = np.arange(0 if start == 0.0 else 4, 11)
    h = 1e-6
    for name, middle in (("kp", 8.0), ("T", 0.1)):
        ends = []
        for change in (h, -h):
            given = {"T": 0.1, "kp": 8.0} | {name: middle + change}
            ends.append(by_hand(1.05, given["T"] * count, start=start, **given))
        slope = (ends[0] - ends[1]) / (2 * h)
        assert [found[state, name][-1] for state in ("s", "s_dot", "z", "u")] == pytest.approx(slope, rel=2e-7)


def loads(text: str, folder: Path) -> eg.Model:
    """The model of a file's text."""
    file = folder / "model.yaml"
    file.write_text(text)
    return eg.load(file)


def test_a_model_file_says_the_same(module: Any, tmp_path: Path) -> None:
    m = loads(TEXT, tmp_path)
    read = m.compile(target="numpy")
    x = read.simulate(1.05).x[:, -1]
    assert read.x_names == module.x_names
    assert np.abs(x - module.simulate(1.05).x[:, -1]).max() < 1e-14
    again = loads(m.to_yaml(), tmp_path).compile(target="numpy")
    assert np.array_equal(again.simulate(1.05).x[:, -1], x)


@pytest.mark.parametrize(
    ("method", "target"), [("DOP853", "numpy"), pytest.param("many", "cython", marks=pytest.mark.thorough)]
)
def test_clocks_whose_times_differ_by_rounding_keep_their_order(method: str, target: str) -> None:
    """0.3 and 3 * 0.1 are neighbouring numbers: b, declared later, takes the new a at each of its times."""
    m = eg.Model("cascade")
    m.prismatic("slide", m.ground, m.body("b", mass=1.0), axis="x", coordinate="s")
    m.sampled("a", "1 - s - 2*s_dot", 0.1)
    m.sampled("b", "a", 0.3)
    m.actuator("motor", "s", value="b")
    module = m.compile(target=target, **(IN_C if target == "cython" else {}))
    s = v = force = 0.0
    for k in range(41):
        force = 1 - s - 2 * v if k % 3 == 0 else force
        h = 0.1 if k < 40 else 0.05
        s, v = s + h * v + 0.5 * h * h * force, v + h * force
    if method == "many":
        found = module.simulate_many(4.05, count=2).x[0, 1]
    else:
        found = module.simulate(4.05, method=method)["s"][-1]
    assert abs(found - s) < 1e-11


def test_a_state_from_the_end_of_a_run_begins_anew_where_the_run_begins_earlier(module: Any) -> None:
    first = module.simulate(1.0)
    for span, wanted in ((0.32, [0.0, 0.1, 0.2, 0.3]), ((0.45, 0.62), [0.5, 0.6]), ((1.0, 1.15), [1.1])):
        found = module.simulate(span, first.x[:, -1]).t_events["z_sampled"]
        assert found == pytest.approx(wanted, abs=1e-13)
    again = module.simulate((1.0, 1.5), first.x[:, -1], parameters={"T": 0.2})
    assert again.t_events["z_sampled"][-2:] == pytest.approx([1.2, 1.4])
    refuses("EG-RANGE z_samples 2.5", module.simulate, 1.0, {"z_samples": 2.5})


@pytest.mark.parametrize("call", ["equilibrium", "modes"])
def test_analyses_of_continuous_time_are_refused(module: Any, call: str) -> None:
    refuses("EG-UNAVAILABLE servo z u", lambda: getattr(module, call)())


def test_runs_backwards_and_periods_that_are_not_positive_are_refused(module: Any) -> None:
    for call in (module.simulate, module.simulate_many):
        refuses("EG-UNSUPPORTED 1 0", call, (1.0, 0.0), {"s": 0.0})
    for period in (0.0, -0.1):
        refuses("EG-RANGE states.z.period T", module.simulate, 1.0, parameters={"T": period})


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ({"sampled": "s"}, "EG-MISSING states.u.period"),
        ({"sampled": "s", "period": 0}, "EG-RANGE states.u.period 0"),
        ({"sampled": "s", "period": "s"}, "EG-REFERENCE states.u.period s"),
        ({"sampled": "s", "rate": 1, "period": 1}, "EG-CONFLICT states.u"),
        ({"rate": 1, "period": 1}, "EG-CONFLICT states.u.period"),
        ({"offset": 1}, "EG-MISSING states.u.rate"),
        ({"sampled": "s_ddot", "period": 1}, "EG-REFERENCE states.u.sampled s_ddot"),
    ],
)
def test_faults_name_their_place(entry: dict[str, Any], words: str, tmp_path: Path) -> None:
    text = TEXT.split("forces:")[0] + f"states:\n  u: {json.dumps(entry)}\n"
    refuses(words, lambda: loads(text, tmp_path).derive())


def outside() -> eg.Model:
    """A mass whose drive a function of the run controls."""
    m = eg.Model("servo")
    m.prismatic("slide", m.ground, m.body("sledge", mass=MASS), axis="x", coordinate="s")
    m.sampled("z", "z + 0.1*(0.1 - s)", 0.1)
    m.sampled("u", period=0.1)
    m.actuator("motor", "s", value="u")
    return m


@pytest.mark.parametrize(
    ("method", "target"),
    [("Radau", "numpy"), ("DOP853", "numpy"), pytest.param("DOP853", "cython", marks=pytest.mark.thorough)],
)
def test_a_function_of_the_run_gives_what_the_model_leaves_open(target: str, method: str) -> None:
    called: list[float] = []

    def drive(t: float, x: Any) -> Any:
        called.append(t)
        return 8.0 * (TARGET - x[0]) + 5.0 * x[2] - 4.0 * x[1]  # x[2] is z, renewed before u

    module = outside().compile(target=target, **(IN_C if target == "cython" else {}))
    run = module.simulate(1.05, method=method, controllers={"u": drive})
    assert np.abs(run.x[:4, -1] - by_hand(1.05, 0.1 * np.arange(11))).max() < 1e-12
    assert np.abs(called - 0.1 * np.arange(11)).max() < 1e-15
    assert np.abs(module.simulate(1.05)["s"]).max() == 0.0  # without one it keeps its value
    called.clear()
    hit = module.simulate_impacts(1.05, {"s": 0.5}, method=method, controllers={"u": drive})
    assert (hit.impacts, len(called)) == ([], 11)
    np.testing.assert_allclose(hit.x[:4, -1], run.x[:4, -1], rtol=0.0, atol=1e-12)


def test_controllers_that_cannot_be_are_refused(module: Any) -> None:
    refuses("EG-UNSUPPORTED servo", module.simulate, 1.0, controllers={"u": lambda t, x: 0.0})
    module = outside().compile(target="numpy")
    for given, words in (
        ({"w": lambda t, x: 0.0}, "EG-NAME-UNKNOWN sampled"),
        ({"z": lambda t, x: 0.0}, "EG-NAME-UNKNOWN sampled"),
        ({"z_samples": lambda t, x: 0.0}, "EG-NAME-UNKNOWN sampled"),
        ({"u": 3.0}, "EG-TYPE u"),
        ({"u": lambda t: 0.0}, "EG-TYPE u"),
        (["u"], "EG-TYPE controllers"),
    ):
        refuses(words, module.simulate, 1.0, controllers=given)
        refuses(words, module.simulate_impacts, 1.0, {"s": 0.5}, controllers=given)
    refuses("EG-NUMBER u nan 0", module.simulate, 1.0, controllers={"u": lambda t, x: float("nan")})
    with refused("EG-UNSUPPORTED none"):
        eg.load_example("pendulum").compile(target="numpy").simulate(1.0, controllers={"u": lambda t, x: 0.0})


@pytest.mark.parametrize("target", TARGETS)
def test_a_held_input_beside_a_controller_has_the_value_of_its_own_time(target: str) -> None:
    """Where the compiled loop asks Python for a new state, a law of its clock must not see the run's first part."""
    m = eg.Model("mixed")
    m.prismatic("slide", m.ground, m.body("sledge", mass=1.0), axis="x", coordinate="s")
    u = m.input("u")
    m.sampled("seen", u, 0.3, offset=0.05)
    m.sampled("given", period=0.3, offset=0.05)
    table = eg.Signal([0.0, 0.5, 1.0, 1.5], [1.0, -2.0, 3.0, 5.0], "zero-order")
    asked = [0.1, 0.7, 1.0, 1.3, 1.9]
    run = m.compile(target=target).simulate(2, inputs={"u": table}, controllers={"given": lambda t, x: t}, t_eval=asked)
    np.testing.assert_array_equal(run["seen"], [1.0, -2.0, -2.0, 3.0, 5.0])  # renewed at 0.05, 0.65, 0.95, 1.25, 1.85


# -- events and impacts while constraints are closed for a time --------------------------------------------------------
def sliders(reset: dict[str, Any], for_good: bool, masses: tuple[float, float] = (1.0, 3.0), ratio: float = 1.0) -> Any:
    """Two sliders with s = ratio * r, which an event kicks at 0.5 s."""
    m = eg.Model("sliders", gravity=(0, 0, 0))
    a, b = (m.body(name, mass=mass) for name, mass in zip("ab", masses, strict=True))
    m.prismatic("A", m.ground, a, axis="x", coordinate="s")
    m.prismatic("B", m.ground, b, axis="x", coordinate="r")
    m.coupling("c", {"s": 1, "r": -ratio}, **({} if for_good else {"opens": "100 - t"}))
    m.event("kick", "t - 0.5", direction=1, reset=reset)
    return m


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize(("masses", "ratio"), [((1.0, 1.0), 1.0), ((1.0, 3.0), -2.5)])
def test_new_velocities_are_brought_onto_a_closed_constraint_as_onto_one_for_good(
    target: str, masses: tuple[float, float], ratio: float
) -> None:
    reset = {"s_dot": "2 + s"}
    mine, judge = (sliders(reset, g, masses, ratio).compile(target=target).simulate(1.0) for g in (False, True))
    assert mine.x[:4, -1] == pytest.approx(judge.x[:, -1], abs=1e-9)
    assert mine["s_dot"][-1] == pytest.approx(2.0 * ratio**2 / (1.0 + ratio**2), abs=1e-9)


@cache
def kicked() -> Any:
    """Two sliders that an event brings to the speed k, in C."""
    m = sliders({"s_dot": "k"}, False)
    m.parameter("k", 2.0)
    return m.compile(**IN_C)


@pytest.mark.parametrize("method", ["DOP853", "Radau", "RK4", "LSODA"])
def test_every_integrator_does_so(method: str) -> None:
    more = {"step": 1e-2} if method == "RK4" else {}
    run = kicked().simulate(1.0, method=method, **more)
    assert run.x[:4, -1] == pytest.approx([0.5, 0.5, 1.0, 1.0], abs=1e-6)


def test_many_runs_and_their_slopes_do_so() -> None:
    module = kicked()
    ends = module.simulate_many(1.0, parameters={"k": [1.0, 2.0, 4.0]}).x
    assert ends[:4] == pytest.approx(np.outer([0.25, 0.25, 0.5, 0.5], [1.0, 2.0, 4.0]), abs=1e-9)
    slopes = module.sensitivities(["k"], 1.0).dx[:4, 0, -1]
    assert slopes == pytest.approx([0.25, 0.25, 0.5, 0.5], abs=1e-6)


@pytest.mark.parametrize("target", TARGETS)
def test_positions_that_a_closed_equation_does_not_have_are_refused(target: str) -> None:
    """Those onto which the mechanism would be moved are not told from those that the user wants."""
    refuses("EG-STALLED kick 0.5 c", lambda: sliders({"s": 0.3}, False).compile(target=target).simulate(1.0))
    run = sliders({"s": 0.3, "r": 0.3, "s_dot": 1}, False).compile(target=target).simulate(1.0)
    assert run.x[:4, -1] == pytest.approx([0.55, 0.55, 0.5, 0.5], abs=1e-9)


@pytest.mark.parametrize("against", ["driver", "coupling", "closed"])
def test_a_constraint_that_closes_against_another_is_refused(against: str) -> None:
    m = eg.Model("against", gravity=(0, 0, 0))
    for name in "ab":
        m.prismatic(name.upper(), m.ground, m.body(name, mass=1.0), axis="x", coordinate=name + "_s")
    if against == "driver":
        m.driver("d", "a_s", "t")
    else:
        m.coupling("d", equation="a_s_dot - 1", **({"closes": "0.2 - t"} if against == "closed" else {}))
    m.lock("brake", "A", closes="0.5 - t")
    module = m.compile(target="numpy")
    refuses("EG-STALLED 0.5", module.simulate, 1.0)
    assert module.simulate(0.4)["a_s_dot"][-1] == pytest.approx(1.0, abs=1e-9)


def test_states_of_constraints_are_0_or_1() -> None:
    m = eg.Model("half", gravity=(0, 0, 0))
    m.prismatic("A", m.ground, m.body("a", mass=1.0), axis="x", coordinate="s")
    m.lock("brake", "A", opens="0.2 - t")
    refuses("EG-CHOICE brake_closed 1 0 0.5", lambda: m.compile(target="numpy").simulate(0.1, {"brake_closed": 0.5}))
    module = m.compile(target="numpy")
    for start in (module.minimal.x0, module.equilibrium):
        refuses("EG-CHOICE brake_closed 1 0 0.3", start, {"brake_closed": 0.3})
        start({"brake_closed": 0})
    for initial in ({"s_dot": 1.0, "brake_closed": [0.5, 1.0, 0.0]}, [[0.0] * 3, [1.0] * 3, [0.5, 1.0, 0.0]]):
        runs = module.simulate_many(0.1, initial)
        assert (runs.status != 0).tolist() == [True, False, False]
        assert np.isnan(runs.x[:, 0]).all()
        assert "brake_closed is 1 while brake is closed" in runs.failures()[0].message
    m.event("kick", "t - 0.1", reset={"brake_closed": 0.5})
    refuses("EG-EVENT events.kick.reset.brake_closed 1 0", m.compile, target="numpy")


def test_slopes_by_what_a_closed_constraint_forbids_are_refused() -> None:
    """s = r is closed, and the event moves s by k: fine for k = 0, and for no k beside it."""

    def moved(reset: dict[str, Any]) -> Any:
        m = sliders(reset, False)
        m.parameter("k", 0.0)
        return m.compile(target="numpy")

    with refused("EG-NO-DERIVATIVE kick k"):
        moved({"s": "s + k"}).sensitivities(["k"], 1.0, {"s_dot": 1.0, "r_dot": 1.0})
    both = moved({"s": "s + k", "r": "r + k"}).sensitivities(["k"], 1.0, {"s_dot": 1.0, "r_dot": 1.0})
    assert both.dx[:2, 0, -1] == pytest.approx([1.0, 1.0], abs=1e-6)


@pytest.mark.parametrize(("target", "rate"), [("numpy", 10), pytest.param("cython", 100, marks=pytest.mark.thorough)])
def test_what_is_closed_holds_between_steps(target: str, rate: float) -> None:
    """A clutch with one degree of freedom left, w' = -c (w - w1): long steps once let rounding grow within them."""
    m = eg.Model("clutch")
    a, b = m.body("a", mass=1, inertia={"zz": 0.3}), m.body("b", mass=1, inertia={"zz": 0.5})
    m.revolute("ja", m.ground, a)
    m.revolute("jb", m.ground, b)
    m.coupling("cl", equation="ja_dot - 1.3*jb_dot", opens="100 - t", stabilisation=rate)
    m.joint_damper("d", "jb", damping=0.2)
    m.parameter("T", 0.5)
    m.torque("mot", "ja", "T")
    module, times = m.compile(target=target), np.linspace(0, 20, 301)
    start = {"ja_dot": 2.6, "jb_dot": 2.0}
    final, c = 1.3 * 0.5 / 0.2, 0.2 / (0.3 * 1.69 + 0.5)
    run = module.simulate(20.0, start, t_eval=times, rtol=1e-6, atol=1e-8)
    assert run["jb_dot"] == pytest.approx(final + (2 - final) * np.exp(-c * times), abs=1e-8)
    many = module.simulate_many(20.0, {name: [x, x] for name, x in start.items()}, t_eval=times, rtol=1e-6, atol=1e-8)
    assert many["jb_dot"][:, 0] == pytest.approx(run["jb_dot"], abs=1e-8)
    slopes = module.sensitivities(["T"], 20.0, start, t_eval=times)
    assert slopes["jb_dot", "T"] == pytest.approx(1.3 / 0.2 * (1 - np.exp(-c * times)), abs=1e-6)
    steps, free = (np.diff(module.simulate(20.0, start, rtol=1e-6, **one).t) for one in ({}, {"max_step": 5.0}))
    assert steps.max() <= 2.5 / rate * (1 + 1e-9) < free.max()
    implicit = module.simulate(20.0, start, method="LSODA", rtol=1e-6)
    assert np.diff(implicit.t).max() > 2.5 / rate
    own = (module.sensitivities(["T"], 20.0, start, **one).t for one in ({}, {"max_step": None}))
    assert np.array_equal(*own)
