"""Kinematic analysis against closed forms: times and coordinates that lead, branches, stops, change points, limits.

Sources: vector loops of slider-crank and four-bar (Shabana, Computational Dynamics, ch. 3), written out here, and
tests/reference/slider_crank_kinematics.json.
"""

import pickle

import models
import numpy as np
import pytest
from refusals import refused, refuses

import eomgen as eg


def parallelogram(value: str = "0.5 + 2*pi*t") -> eg.Model:
    m = eg.Model("parallelogram")
    one, bar, two = (m.body(name, mass=0) for name in ("one", "bar", "two"))
    models.join_four_bar(m, (one, bar, two), (0.2, 0.6, 0.2, 0.6), "theta bend psi")
    m.output("ax", "ax(bar)")
    m.driver("drive", "theta", value)
    m.guess(bend=-0.5, psi=0.5)
    return m


@pytest.fixture(scope="module")
def crank() -> eg.Module:
    return eg.load_example("driven_slider_crank").compile(target="numpy")


@pytest.fixture(scope="module")
def free_crank() -> eg.Module:
    """The same with masses and without its driver."""
    m = eg.Model("free_slider_crank")
    one, rod, slider = (m.body(name, mass=1, inertia={"zz": 1}) for name in ("crank", "rod", "slider"))
    models.join_slider_crank(m, (one, rod, slider), 0.1, 0.3, "theta bend s")
    m.guess(bend=0, s=0.4)
    return m.compile(target="numpy", independent=["theta"])


@pytest.fixture(scope="module")
def four_bar() -> eg.Module:
    return models.build("four_bar").compile(target="numpy")


@pytest.mark.parametrize("case", ["inline", "offset"])
def test_the_driven_slider_crank_equals_the_reference_rows(crank: eg.Module, case: str) -> None:
    given = models.reference("slider_crank_kinematics")["reference"][case]
    sizes = {key: float(given[key]) for key in ("r", "l", "e", "omega", "alpha")}
    for degrees, row in given["rows"].items():
        mod = crank.bind(p=sizes | {"phi": np.radians(float(degrees))})
        found = mod.kinematic_analysis(t=[0.0, 1e-3])
        pairs = {"x": "s", "v": "s_dot", "a": "s_ddot", "rod_angle": "rod_angle"}
        for theirs, ours in pairs.items():
            assert found[ours][0] == pytest.approx(float(row[theirs]), rel=1e-12, abs=1e-13), (degrees, theirs)
        assert found["slider_acceleration"][0] == pytest.approx(float(row["a"]), rel=1e-12, abs=1e-13)
        rod = found["theta_dot"][0] + found["bend_dot"][0], found["theta_ddot"][0] + found["bend_ddot"][0]
        assert rod == pytest.approx((float(row["rod_omega"]), float(row["rod_alpha"])), rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("offset", [0.0, 0.05])
def test_twenty_turns_through_the_dead_centres(crank: eg.Module, offset: float) -> None:
    omega, r, l = 10.0, 0.1, 0.3
    mod = crank.bind(p={"e": offset})
    t = np.linspace(0, 20 * 2 * np.pi / omega, 4 * 360 + 1)
    found = mod.kinematic_analysis(t=t)
    angle, sine = omega * t, (offset - r * np.sin(omega * t)) / l
    rod, rod1 = np.arcsin(sine), -r * omega * np.cos(angle) / l / np.sqrt(1 - sine**2)
    rod2 = (r * omega**2 * np.sin(angle) / l + sine * rod1**2) / np.sqrt(1 - sine**2)
    s = r * np.cos(angle) + l * np.cos(rod)
    s1 = -r * omega * np.sin(angle) - l * np.sin(rod) * rod1
    s2 = -r * omega**2 * np.cos(angle) - l * (np.cos(rod) * rod1**2 + np.sin(rod) * rod2)
    for ours, theirs in zip(("s", "s_dot", "s_ddot"), (s, s1, s2), strict=True):
        assert np.abs(found[ours] - theirs).max() <= 1e-11 * np.abs(theirs).max(), ours
    assert np.abs(found["theta"] - angle).max() < 1e-12
    assert found["bend"][-1] + found["theta"][-1] == pytest.approx(rod[-1], abs=1e-11)  # twenty turns were counted
    assert found.residuals.position < 1e-12
    assert found.complete
    assert found.singular == []
    ends = found.turning_points("s")  # the dead centres: crank and rod in line
    far, near = np.sqrt((l + r) ** 2 - offset**2), np.sqrt((l - r) ** 2 - offset**2)
    values = np.array([value for _, value in ends])
    assert 39 <= len(values) <= 41
    assert np.minimum(np.abs(values - far), np.abs(values - near)).max() < 1e-6  # of cubics five degrees wide


@pytest.mark.parametrize("rates", [[2.0, 1.0, 0.0, 0.0, -1.0, -2.0], [1.0, 1.0, 1.0, -1.0, -1.0, -1.0]])
def test_a_coordinate_turns_where_a_time_stands_twice(rates: list[float]) -> None:
    m = eg.Model("turning")
    m.prismatic("J", m.ground, m.body("b", mass=1.0), axis="x", coordinate="s")
    at = {"t": [0.0, 0.5, 1.0, 1.0, 1.5, 2.0], "s": [0.0, 0.5, 1.0, 1.0, 0.5, 0.0], "s_dot": rates}
    found = m.compile(target="numpy").kinematic_analysis(**at)
    assert found.turning_points("s") == [pytest.approx((1.0, 1.0), rel=1e-12)]


def test_a_parallelogram_keeps_its_branch_through_its_change_points() -> None:
    """psi = theta, bend = -theta, the bar only translates: exact at the change points theta = k pi themselves too."""
    mod = parallelogram().compile(target="numpy")
    at = (np.pi * np.arange(1, 40) - 0.5) / (2 * np.pi)
    t = np.sort(np.concatenate([np.linspace(0, 20, 67), at, at + 1e-9, at - 1e-5]))
    found = mod.kinematic_analysis(t=t)
    assert np.abs(found["psi"] - found["theta"]).max() < 2e-12
    assert np.abs(found["bend"] + found["theta"]).max() < 2e-12
    omega = 2 * np.pi
    assert np.abs(found["psi_dot"] - omega).max() < 1e-9
    assert np.abs(found["psi_ddot"]).max() < 1e-8 * omega**2
    assert np.abs(found["ax"] + 0.2 * omega**2 * np.cos(found["theta"])).max() < 1e-8 * omega**2
    assert [s.kind for s in found.singular] == ["change point"] * 40
    np.testing.assert_allclose([s.t for s in found.singular[:39]], at, atol=1e-10)
    first = found.singular[0]
    assert first.moving == ("bend", "psi")
    assert first.joints == ("C",)
    assert "the motion may branch" in str(first)


@pytest.mark.parametrize("t", [0.5, 7.0, -3.3])
def test_a_state_at_a_later_time_is_on_the_branch_of_the_start(t: float) -> None:
    """x0 follows the drivers from t = 0, through the change points of the parallelogram on the way."""
    mod = parallelogram().compile(target="numpy")
    angle = 0.5 + 2 * np.pi * t
    rate = 2 * np.pi
    np.testing.assert_allclose(mod.x0(t=t), [angle, -angle, angle, rate, -rate, rate], atol=1e-11)


def test_starting_at_a_change_point_is_refused() -> None:
    m = parallelogram("2*pi*t")
    m.guess(bend=0, psi=0)
    mod = m.compile(target="numpy")
    refuses("EG-PARTITION branches", mod.kinematic_analysis, t=[0.0, 0.1])
    refuses("EG-PARTITION singular", mod.simulate, 0.1)


def test_a_driver_that_goes_too_far_stops_at_the_dead_centre(crank: eg.Module) -> None:
    """With the crank longer than the rod, it stops where the rod stands across the guide: sin(theta) = l / r."""
    mod = crank.bind(p={"r": 0.3, "l": 0.2})
    with refused("EG-PARTITION C 0.0729727656") as e:
        mod.kinematic_analysis(t=np.linspace(0, 1, 101))
    part = e.value.reached
    assert (len(part), part.complete) == (8, False)
    assert part.stop.t == pytest.approx(np.arcsin(2 / 3) / 10, abs=1e-12)
    assert np.isfinite(part.a).all()
    refuses("EG-STALLED 0.0729728 C.r_y", mod.simulate, 1.0)


def test_a_pickle_keeps_what_an_analysis_found(crank: eg.Module) -> None:
    part = crank.bind(p={"r": 0.3, "l": 0.2}).kinematic_analysis(t=np.linspace(0, 1, 101), partial=True)
    again = pickle.loads(pickle.dumps(part))
    assert (again.led, str(again.stop), again.complete, len(again)) == (part.led, str(part.stop), False, 8)
    np.testing.assert_array_equal(again.a, part.a)


def test_any_coordinate_leads_and_gives_the_same_motion(four_bar: eg.Module) -> None:
    """theta's own motion, led again by psi (tree) and by C (the cut joint's) with their rates: back comes theta."""
    theta = np.linspace(0.8, 2.5, 35)
    first = four_bar.kinematic_analysis(theta=theta, theta_dot=10, theta_ddot=3)
    for name in ("psi", "C"):
        rates = {name + suffix: first[name + suffix] for suffix in ("", "_dot", "_ddot")}
        again = four_bar.kinematic_analysis(**rates)
        assert again.led == (name,)
        for suffix, value in (("", theta), ("_dot", 10.0), ("_ddot", 3.0)):
            np.testing.assert_allclose(again["theta" + suffix], value, rtol=1e-9, atol=1e-10)
        np.testing.assert_allclose(again["P_x"], first["P_x"], atol=1e-12)


def test_outputs_with_accelerations_follow_the_led_motion(four_bar: eg.Module) -> None:
    m = models.build("four_bar")
    m.output("P_ax", "ax(coupler.point)")
    given = models.reference("four_bar_kinematics")["reference"]["crank_rocker_open"]
    degrees = np.array([float(key) for key in given["rows"]])
    mod = m.compile(target="numpy")
    found = mod.kinematic_analysis(theta=np.radians(degrees), theta_dot=10, theta_ddot=3)
    expected = [float(row["P_x"][2]) for row in given["rows"].values()]
    np.testing.assert_allclose(found["P_ax"], expected, rtol=1e-11)
    for k, row in enumerate(given["rows"].values()):
        ours = found["coupler_angle"][k] - float(row["coupler"][0]), found["psi"][k] - float(row["rocker"][0])
        assert np.abs(np.remainder(np.array(ours) + np.pi, 2 * np.pi) - np.pi).max() < 1e-12
        rates = found["psi_dot"][k], found["psi_ddot"][k], found["P_x"][k], found["P_y"][k]
        theirs = *row["rocker"][1:], row["P_x"][0], row["P_y"][0]
        np.testing.assert_allclose(rates, [float(x) for x in theirs], rtol=1e-11)


def test_both_branches_of_a_four_bar(four_bar: eg.Module) -> None:
    """The other branch is the mirror image in the diagonal from crank pin to rocker pivot."""
    a1, a2, a3, a4 = 0.04, 0.12, 0.08, 0.10
    theta = np.linspace(np.pi / 3, np.pi / 3 + 2 * np.pi, 61)
    for q in four_bar.branches():
        found = four_bar.kinematic_analysis(theta=theta, initial=q)
        dx, dy = a4 - a1 * np.cos(theta), -a1 * np.sin(theta)
        d = np.hypot(dx, dy)
        turn = np.arccos((a2**2 + d**2 - a3**2) / (2 * a2 * d))
        side = np.sign(np.sin(found["coupler_angle"][0] - np.arctan2(dy, dx)[0]))
        off = found["coupler_angle"] - np.arctan2(dy, dx) - side * turn
        assert np.abs(np.remainder(off + np.pi, 2 * np.pi) - np.pi).max() < 1e-12
        np.testing.assert_allclose(found["P_x"][-1], found["P_x"][0], atol=1e-12)  # the coupler curve closes
        np.testing.assert_allclose(found["P_y"][-1], found["P_y"][0], atol=1e-12)


def test_a_led_slider_stops_at_its_dead_centres(free_crank: eg.Module) -> None:
    part = free_crank.kinematic_analysis(s=np.linspace(0.3, 0.5, 41), s_dot=1.0, partial=True)
    stop = part.stop
    assert stop is not None
    assert stop.values["s"] == pytest.approx(0.4, abs=1e-14)
    assert np.abs(stop.q[:2]).max() < 1e-7
    assert stop.moving == ("theta", "bend")
    assert (len(part), part["s"][-1]) == (21, pytest.approx(0.4))  # the stop itself is one of the points
    assert np.isfinite(part.a[:, :-1]).all()
    refuses("EG-PARTITION s", free_crank.kinematic_analysis, s=[0.4, 0.3], initial={"theta": 0.0})


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({}, "EG-MISSING range"),
        ({"theta": [0, 1], "s": [0.3, 0.4]}, "EG-PARTITION theta 1"),
        ({"thet": [0, 1]}, "EG-NAME-UNKNOWN thet"),
        ({"theta": [0, 1], "s_dot": 1}, "EG-MISSING s_dot"),
        ({"theta": [0, 1, 2], "theta_dot": [1, 2]}, "EG-SHAPE 3 theta_dot 2"),
        ({"t": [0, 1], "theta": [0, 1]}, "EG-MISSING theta theta_dot"),
        ({"theta": [0, 1], "initial": {"theta_dot": 1}}, "EG-REFERENCE theta_dot"),
        ({"theta": [0, 1], "initial": [0, 1]}, "EG-SHAPE (3,)"),
    ],
)
def test_what_cannot_be_requested(free_crank: eg.Module, asked: dict[str, object], said: str) -> None:
    refuses(said, free_crank.kinematic_analysis, **asked)


def test_limits_of_every_coordinate(four_bar: eg.Module, free_crank: eg.Module) -> None:
    swing = four_bar.motion_range("psi")
    limits = [np.pi - np.arccos((0.08**2 + 0.1**2 - d**2) / (2 * 0.08 * 0.1)) for d in (0.08, 0.16)]
    assert sorted((swing.lower, swing.upper)) == pytest.approx(sorted(limits), abs=1e-12)
    assert all("C.r_" in gap and "stays open" in gap for gap in swing.gaps)
    assert four_bar.motion_range("theta").unlimited
    stroke = free_crank.motion_range("s", initial={"theta": 0.5})
    assert (stroke.lower, stroke.upper) == pytest.approx((0.2, 0.4), abs=1e-14)
    near = free_crank.motion_range("s", within=(0.3, 0.5), initial={"s": 0.35})
    assert (near.lower, near.upper, near.stops[0]) == (0.3, pytest.approx(0.4), None)
    refuses("EG-RANGE within", free_crank.motion_range, "s", within=(0.5, 0.6), initial={"s": 0.35})


def test_how_long_drivers_can_go_on(crank: eg.Module) -> None:
    found = crank.motion_range("t", parameters={"r": 0.3, "l": 0.2})
    assert (found.lower, found.upper) == pytest.approx((-np.arcsin(2 / 3) / 10, np.arcsin(2 / 3) / 10), abs=1e-12)


def test_a_ball_joint_led_by_three_distances() -> None:
    """Wires to three points of a body on a ball joint set its attitude; rates against differences of the positions."""
    m = eg.Model("gimbal")
    body = m.body("plate", mass=1, inertia=(1, 1.2, 1.5))
    m.spherical("S", m.ground, body, rotation="euler_parameters")
    for k, (at, far) in enumerate([((1, 0, 0), (1.2, 0.1, 1.5)), ((0, 1, 0), (0, 1.3, 1.4)), ((0, 0, 1), (1.5, 0, 1))]):
        rest = float(np.linalg.norm(np.subtract(far, at)))
        m.driver(f"wire{k}", between=(m.ground.at(*far), body.at(*at)), value=f"{rest!r} + 0.2*sin({k + 1}*t)")
    mod = m.compile(target="numpy")
    t = np.linspace(0, 2, 41)
    found = mod.kinematic_analysis(t=t)
    assert found.residuals.position < 1e-12
    np.testing.assert_allclose((found.q**2).sum(axis=0), 1.0, rtol=1e-12)
    h = 1e-5
    sides = [mod.kinematic_analysis(t=np.concatenate([[0.0], t[1:-1] + x])) for x in (-h, h)]
    rates = (sides[1].q[:, 1:] - sides[0].q[:, 1:]) / (2 * h)
    ours = np.array([found[f"S_e{k}_dot"][1:-1] for k in range(4)])
    np.testing.assert_allclose(ours, rates, atol=1e-8)
    np.testing.assert_allclose(found.a[:, 1:-1], (sides[1].v[:, 1:] - sides[0].v[:, 1:]) / (2 * h), atol=1e-8)


def test_values_in_any_order_are_those_of_the_sweep(four_bar: eg.Module, crank: eg.Module) -> None:
    values = np.random.default_rng(0).normal(size=40)
    order = np.argsort(values)
    for found, swept in (
        (four_bar.kinematic_analysis(theta=values), four_bar.kinematic_analysis(theta=values[order])),
        (crank.kinematic_analysis(t=abs(values)), crank.kinematic_analysis(t=abs(values[order]))),
    ):
        np.testing.assert_allclose(found.x[:, order], swept.x, atol=1e-11)
        np.testing.assert_allclose(found.a[:, order], swept.a, atol=1e-9)
    refuses("EG-TOO-LARGE 159155", four_bar.kinematic_analysis, theta=[0.0, 1e6])


def test_solving_and_integrating_agree(crank: eg.Module) -> None:
    t = np.linspace(0, 0.7, 29)  # a turn and more
    solved = crank.simulate(0.7, t_eval=t)
    integrated = crank.simulate(0.7, t_eval=t, method="DOP853", rtol=1e-11, atol=1e-12)
    assert (solved.metadata["method"], integrated.metadata["method"]) == ("kinematic", "DOP853")
    assert solved.nfev == 0
    for name in ("theta", "bend", "s", "s_dot", "s_ddot", "C", "M_x", "slider_acceleration"):
        np.testing.assert_allclose(solved[name], integrated[name], rtol=1e-8, atol=1e-8)
    assert solved.residuals.position < 1e-14


def test_events_of_driven_runs_are_located(crank: eg.Module) -> None:
    """The slider passes 0.3: from cos(theta) = (r^2 + s^2 - l^2) / (2 r s)."""
    s = 0.3
    angle = np.arccos((0.01 + s**2 - 0.09) / (2 * 0.1 * s))
    passing = [(angle + 0.0) / 10, (2 * np.pi - angle) / 10, (2 * np.pi + angle) / 10]

    def event(t: float, x: np.ndarray) -> float:
        return float(x[2] - s)

    run = crank.simulate((0, 0.8), events=event)
    np.testing.assert_allclose(run.t_events[0], passing, atol=1e-13)
    assert run.x_events[0].shape == (6, 3)
    event.direction, event.terminal = 1, True
    run = crank.simulate((0, 0.8), events=[event])
    assert (run.status, len(run.t_events[0])) == (1, 1)
    assert run.t[-1] == pytest.approx(passing[1], abs=1e-13)
    assert run["s"][-1] == pytest.approx(s, abs=1e-13)


def test_what_driven_runs_refuse(crank: eg.Module) -> None:
    refuses("EG-LOOP-OPEN 0.5 theta", crank.simulate, 1.0, initial={"theta": 0.5})
    refuses("EG-NAME-UNKNOWN lband", crank.simulate, 1.0, lband=1)
    pendulum = eg.load_example("pendulum").compile(target="numpy")
    refuses("EG-UNSUPPORTED kinematic", pendulum.simulate, 1.0, method="kinematic")


# -- a mechanism that cannot move --------------------------------------------------------------------------------------


def truss() -> eg.Model:
    """Two bars of weight m g from pins a distance of 2 apart, which meet at (1, 1), where a load F pulls upwards."""
    m = eg.Model("truss", gravity=(0, "-g", 0))
    m.parameter("g", 9.81)
    m.parameter("L", 2**0.5)
    m.input("F")
    bars = [m.body(name, mass=1.5, com=("L/2", 0, 0), inertia={"zz": 0.1}) for name in "ab"]
    m.revolute("A", m.ground, bars[0], coordinate="alpha")
    m.revolute("B", m.ground.at(2, 0, 0), bars[1], coordinate="beta")
    m.revolute("C", bars[0].at("L", 0, 0), bars[1].at("L", 0, 0))
    m.force("load", bars[0].at("L", 0, 0), (0, "F", 0))
    m.output("height", bars[0].at("L", 0, 0).position[1])
    m.guess = {"alpha": 0.7, "beta": 2.3}
    return m


def held_twice() -> eg.Model:
    """Bodies welded to ground at places that agree where l1 + l2 = l3: no coordinate, and one row of parameters."""
    m = eg.Model("held_twice", gravity=(0, "-g", 0))
    for name, value in (("g", 9.81), ("l1", 0.1), ("l2", 0.2), ("l3", 0.3)):
        m.parameter(name, value)
    m.input("F")
    a, b = m.body("a", mass=1.0, com=(0.5, 0, 0)), m.body("b", mass=2.0)
    m.weld("A", m.ground, a)
    m.weld("B", a.at(1, 0, 0), b)
    m.weld("C", m.ground.at("1 + l3", 0, 0), b.at("l1 + l2", 0, 0))
    m.force("load", b, (0, "F", 0))
    m.output("height", "y(b)")
    return m


@pytest.mark.parametrize(
    ("make", "target"),
    [(truss, "numpy"), (held_twice, "numpy"), pytest.param(truss, "cython", marks=pytest.mark.thorough)],
)
def test_every_call_of_a_locked_structure_answers(make: object, target: str) -> None:
    mod = make().compile(target=target)  # type: ignore[operator]
    x = mod.x0()
    n, n_q = len(mod.x_names), len(mod.q_names)
    batch = np.repeat(x[:, None], 3, axis=1)
    np.testing.assert_allclose(mod.rhs(0, x), np.zeros(n), atol=1e-12)
    assert mod.rhs(0, batch).shape == (n, 3)
    np.testing.assert_allclose(mod.jacobian(0, x), np.zeros((n, n)), atol=1e-12)
    assert mod.jacobian(0, batch).shape == (n, n, 3)
    assert mod.mass_matrix(x[:n_q]).shape == (n // 2, n // 2)
    assert mod.embedded_mass_matrix(x[:n_q]).shape == (0, 0)
    assert mod.poses(x[:n_q]).shape == (2, 4, 4)
    assert mod.outputs(0, x).shape == (1,)
    np.testing.assert_allclose(mod.project(x), x, atol=1e-15)
    assert mod.energy(x).shape == (2,)
    assert [part.shape for part in mod.kinematics([], [], [])] == [(n_q,), (n // 2,), (n // 2,)]
    assert mod.minimal.rhs(0, np.zeros(0)).shape == (0,)
    np.testing.assert_allclose(mod.minimal.expand(np.zeros(0)), x, atol=1e-15)
    assert mod.simulate((0, 1), t_eval=[0, 0.5, 1]).x.shape == (n, 3)
    for solver in ("DOP853", "RK23", "Radau", "BDF", "LSODA"):
        traj = mod.simulate(0.1, method=solver, events=lambda t, x: t - 0.05, dense_output=True)
        assert (traj.x_events[0].shape, traj.at([0.03, 0.04]).x.shape) == ((n, 1), (n, 2))
    many = mod.simulate_many((0, 1), parameters={"g": [9.0, 8.0]})
    assert many.ok.all()
    assert mod.equilibrium().stability == "no freedom"
    assert mod.linearize().A.shape == (0, 0)
    assert mod.modes().frequencies.shape == (0,)
    assert mod.kinematic_analysis(t=[0, 1]).x.shape == (n, 2)
    assert target == "cython" or mod.verify().ok
