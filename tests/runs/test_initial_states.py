"""Positions and velocities that close loops: given values held, branches kept, projection, beside closed forms."""

from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
from analysed import compiled
from numpy import cos, pi, sin
from refusals import refuses
from scipy.integrate import solve_ivp
from sweeps import TARGETS, part_of

import eomgen as eg


@pytest.fixture(scope="module")
def crank() -> eg.Module:
    """A slider-crank of crank r, rod l, and a guide e above the pivot; `s` is the slider's place."""
    return models.build("offset_slider_crank").compile(target="numpy")


def placed(theta: Any, r: float = 0.15, l: float = 0.5, e: float = 0.05) -> Any:
    """The slider by the closed form."""
    return r * np.cos(theta) + np.sqrt(l**2 - (e - r * np.sin(theta)) ** 2)


@pytest.mark.quick
def test_given_values_are_held_exactly_and_loops_closed(crank: eg.Module) -> None:
    for values in ({"theta": 0.3, "theta_dot": 10.0}, {"s": 0.4}, {"C": 0.2, "C_dot": 1.0}, {"B": -0.4}, {}):
        x = crank.x0(**values)
        run = crank.simulate(1e-9, x)
        for name, value in values.items():
            assert run[name][0] == pytest.approx(value, abs=1e-11 if name.startswith("C") else 0), name
        assert np.abs(crank.constraints(x[: crank.n_q], rows="all")).max() < 1e-12
        assert np.abs(crank.velocity_constraints(x)).max() < 1e-11
        assert x[crank.q_names.index("s")] == pytest.approx(placed(x[0]), abs=1e-12)
    turning = models.build("slider_crank").compile(target="numpy")
    assert turning.x0(theta=0.5)[3] == 10.0  # declared, and there is room
    assert turning.x0(s_dot=0.0, theta=0.5)[3] == 0.0  # declared, but no room


def test_both_branches_and_the_one_of_the_reference(crank: eg.Module) -> None:
    for theta in np.linspace(-9, 9, 13):
        assert crank.x0(theta=theta)[crank.q_names.index("s")] == pytest.approx(placed(theta), abs=1e-10)
    assert crank.branch(crank.x0(theta=3.0)) == 1
    both = crank.branches(theta=0.5)
    assert [crank.branch(q) for q in both] == [1, -1]
    flipped = crank.assemble(theta=0.5, s=-0.4)
    assert flipped[0] == 0.5
    np.testing.assert_allclose(flipped, both[1], atol=1e-9)


@pytest.mark.parametrize(
    ("values", "demand"),
    [
        ({"theta": 0.3, "s": 0.2}, "EG-LOOP-OPEN theta 0.3 s 0.2 2 1"),
        ({"s": 2.0}, "EG-LOOP-OPEN s 2"),
        ({"theta": 0.3, "theta_dot": 1.0, "s_dot": 1.0}, "EG-CONTRADICTION theta_dot s_dot 1"),
        ({"thetta": 0.3}, "EG-NAME-UNKNOWN 'thetta' theta"),
        ({"l": 0.3}, "EG-NAME-UNKNOWN 'l' parameter"),
        ({"theta": np.nan}, "EG-NUMBER theta nan"),
    ],
)
def test_initial_values_that_do_not_fit(crank: eg.Module, values: Any, demand: str) -> None:
    refuses(demand, crank.x0, values)


def test_more_than_needed_is_taken_where_it_fits(crank: eg.Module) -> None:
    x = crank.x0(theta=0.3)
    np.testing.assert_array_equal(crank.x0(dict(zip(crank.q_names, x, strict=False)))[:3], x[:3])
    refuses("EG-REFERENCE positions", crank.assemble, theta_dot=1.0)


@pytest.mark.parametrize("case", ["inline", "offset"])
def test_kinematics_equal_the_closed_form_over_a_full_turn(crank: eg.Module, case: str) -> None:
    """Reference: slider_crank_kinematics.json (closed form, 17 digits); between its rows, the same formula."""
    data = models.reference("slider_crank_kinematics")["reference"][case]
    p = {name: float(data[name]) for name in "rle"}
    mod, rows = crank.bind(p), data["rows"]
    angles = np.deg2rad(np.array([float(key) for key in rows]))
    q, v, a = mod.kinematics(angles[None], np.full((1, len(angles)), 10.0), np.full((1, len(angles)), 3.0))
    for j, row in enumerate(rows.values()):
        assert q[2, j] == pytest.approx(float(row["x"]), abs=1e-14)
        assert q[0, j] + q[1, j] == pytest.approx(float(row["rod_angle"]), abs=1e-13)
        assert v[2, j] == pytest.approx(float(row["v"]), abs=1e-12)
        assert a[2, j] == pytest.approx(float(row["a"]), abs=1e-11)
        assert a[0, j] + a[1, j] == pytest.approx(float(row["rod_alpha"]), abs=1e-11)
    theta = np.linspace(0, 2 * np.pi, 100)
    np.testing.assert_allclose(mod.kinematics(theta[None])[0][2], placed(theta, **p), atol=1e-13)


def test_the_slider_cannot_be_given_a_velocity_at_a_dead_centre(crank: eg.Module) -> None:
    mod, r, l = crank.bind({"e": 0.0}), 0.15, 0.5
    refuses("EG-CONTRADICTION s_dot 1 theta_dot", mod.x0, s=r + l, s_dot=1.0)
    x = mod.x0(s=r + l, theta_dot=2.0)
    assert abs(x[mod.x_names.index("s_dot")]) < 1e-4
    theta = 0.01  # near, and the closed form still holds
    speed = -r * np.sin(theta) * (1 + r * np.cos(theta) / np.sqrt(l**2 - (r * np.sin(theta)) ** 2))
    assert mod.x0(theta=theta, s_dot=1.0)[3] == pytest.approx(1.0 / speed, rel=1e-9)


def test_kinematics_is_pure_and_says_when_the_way_is_blocked(crank: eg.Module) -> None:
    targets = np.array([[5.0, -3.0, 0.2, 5.0, 2.0]])
    batch = crank.kinematics(targets)[0]
    for j in (4, 1, 0):
        np.testing.assert_array_equal(crank.kinematics(targets[:, j])[0], batch[:, j])
    refuses("EG-SHAPE q_i", crank.kinematics, np.zeros(2))
    other = crank.kinematics([0.5], guess=crank.branches(theta=0.5)[1])[0]
    assert other[2] == pytest.approx(0.3 * np.cos(0.5) - placed(0.5), abs=1e-12)
    model = models.build("offset_slider_crank")
    model.independent = ["s"]
    model.initial = {"s": 0.6}
    refuses("EG-PROJECTION s 0.7", lambda: model.compile(target="numpy").kinematics([0.7]))


def test_a_leap_is_no_failure_of_an_earlier_path() -> None:
    m = eg.Model("leap")
    for axis in "xy":
        m.prismatic(f"J{axis}", m.ground, m.body(axis + "_body", mass=1.0), axis=axis, coordinate=axis)
    m.coupling("c", equation="y - (5 if x > 1 else 0) - sqrt(x + 2)")
    m.independent = ["x"]
    m.initial(x=0.0)
    mod = m.compile(target="numpy")
    refuses("EG-NOT-FINITE x = -2", mod.kinematics, [-3.0])
    refuses("EG-PROJECTION x = 1 another branch", mod.kinematics, [1.5])


def test_the_minimal_form(crank: eg.Module) -> None:
    """It agrees with the tree's, follows far targets, and by the slider never crosses a dead centre silently."""
    x = crank.minimal.x0(theta=0.3, theta_dot=10.0)
    assert crank.minimal.x_names == ("theta", "theta_dot")
    options = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-12, "t_eval": np.linspace(0, 0.5, 6)}
    small = solve_ivp(crank.minimal.rhs, (0, 0.5), x, **options)
    whole = solve_ivp(crank.rhs, (0, 0.5), crank.x0(theta=0.3, theta_dot=10.0), **options)
    expanded = crank.minimal.expand(small.y, small.t)
    np.testing.assert_allclose(expanded, whole.y, atol=1e-9 * np.abs(whole.y).max())
    np.testing.assert_array_equal(crank.minimal.reduce(expanded), small.y)
    crank.minimal.reset()
    far = crank.minimal.expand(np.array([30.0, 1.0]))
    np.testing.assert_allclose(far[:3], crank.kinematics([30.0])[0], atol=1e-12)
    refuses("EG-CONFLICT module.bind", crank.minimal.rhs, 0.0, [0.3, 1.0], p=[1.0])
    refuses("EG-SHAPE (2,)", crank.minimal.rhs, 0.0, np.zeros(6))
    model = models.build("offset_slider_crank")
    model.independent = ["s"]
    model.initial = {"s": 0.6, "s_dot": 1.0}
    by_slider = model.compile(target="numpy")
    for tolerance in (1e-3, 1e-9):
        start = by_slider.minimal.x0()
        with pytest.raises(eg.EvaluationError):
            solve_ivp(by_slider.minimal.rhs, (0, 2.0), start, method="DOP853", rtol=tolerance, atol=tolerance)


def test_coordinates_called_like_arguments_go_in_a_dict() -> None:
    m = eg.Model("named")
    m.prismatic("J", m.ground, m.body("b", mass=1.0), axis="x", coordinate="u")
    mod = m.compile(target="numpy")
    refuses("EG-REFERENCE u", mod.x0, u=0.4)
    assert mod.x0({"u": 0.4})[0] == 0.4


@pytest.fixture(scope="module")
def flat() -> eg.Module:
    m = eg.Model("parallelogram")
    one, bar, two = (m.body(name, mass=1, inertia={"zz": 1}) for name in ("one", "bar", "two"))
    models.join_four_bar(m, (one, bar, two), (0.2, 0.6, 0.2, 0.6), "theta bend psi")
    m.initial(theta=0.5)
    m.guess(bend=-0.5, psi=0.5)
    return m.compile(target="numpy")


@pytest.mark.parametrize("angle", [-2.5, 0.0, np.pi, 9.0])
def test_a_parallelogram_stays_one_past_its_flat_positions(flat: eg.Module, angle: float) -> None:
    """Its cranks turn alike: theta = psi = -bend, whichever is given; the other branch has the bar turn as well."""
    expected = [angle, -angle, angle]
    for given in ({"theta": angle}, {"psi": angle}, {"bend": -angle}):
        np.testing.assert_allclose(flat.x0(given)[:3], expected, atol=1e-7, err_msg=str(given))
    q = flat.kinematics([angle])[0] if angle % np.pi else expected
    np.testing.assert_allclose(q, expected, atol=1e-9)


def test_leaving_the_branch_is_reported() -> None:
    """A rocker beyond its dead centre: there is a position on another branch, which x0 does not take silently."""
    mod = models.build("four_bar").compile(target="numpy")
    psi = float(mod.x0()[mod.q_names.index("psi")]) - 3.0
    with pytest.warns(UserWarning, match="psi = .* branch"):
        x = mod.x0(psi=psi)
    assert np.abs(mod.constraints(x[: mod.n_q], rows="all")).max() < 1e-12
    assert mod.branch(x) == -1
    assert len(mod.branches(psi=psi)) >= 1  # a search, which warns of nothing


def five_bar(**initial: float) -> eg.Module:
    """Two cranks of 0.3 on pivots 0.4 apart, rods of 0.5: two degrees of freedom, two branches."""
    m = eg.Model("five_bar")
    left, right, first, second = (
        m.body(name, mass=1, com=(0.1, 0, 0), inertia={"zz": 1}) for name in ("left", "right", "first", "second")
    )
    m.revolute("A", m.ground, left, coordinate="a")
    m.revolute("E", m.ground.at(0.4, 0, 0), right, coordinate="e")
    m.revolute("B", left.at(0.3, 0, 0), first)
    m.revolute("D", right.at(0.3, 0, 0), second)
    m.revolute("C", first.at(0.5, 0, 0), second.at(0.5, 0, 0))
    m.output("y", first.at(0.5, 0, 0).position[1])
    m.initial(**initial)
    return m.compile(target="numpy")


@pytest.mark.parametrize(("initial", "given"), [({}, {}), ({"a": 1.8}, {"e": 1.1}), ({"a": 1.8, "e": 1.0}, {})])
def test_branches_hold_what_determines_a_position(initial: dict[str, float], given: dict[str, float]) -> None:
    """Values that leave freedom would be met by a continuum of positions."""
    mod = five_bar(**initial)
    found = mod.branches(given)
    assert len(found) == 2
    cranks = np.array([[q[mod.q_names.index(name)] for name in ("a", "e")] for q in found])
    np.testing.assert_allclose(cranks[1], cranks[0], atol=1e-12)
    a, e = cranks[0]
    B, D = (np.array([x + 0.3 * np.cos(turn), 0.3 * np.sin(turn)]) for x, turn in ((0.0, a), (0.4, e)))
    across = np.sqrt(0.25 - np.sum((D - B) ** 2) / 4) * np.array([-(D - B)[1], (D - B)[0]]) / np.linalg.norm(D - B)
    expected = sorted([((B + D) / 2 + across)[1], ((B + D) / 2 - across)[1]])
    heights = sorted(mod.outputs(0.0, np.r_[q, np.zeros(mod.n_x - mod.n_q)])[0] for q in found)
    np.testing.assert_allclose(heights, expected, atol=1e-9)
    assert all({"a": a, "e": e}[name] == pytest.approx(value) for name, value in given.items())


@pytest.mark.parametrize("target", TARGETS)
def test_the_second_argument_is_the_time(target: str) -> None:
    """A slider-crank led at 3 rad/s from 0.2: at t its angles are known in closed form."""
    m = eg.Model("led")
    r, l = m.parameter("r", 0.1), m.parameter("l", 0.35)
    crank, rod, slider = (m.body(name, mass=1, inertia={"zz": 0.1}) for name in ("crank", "rod", "slider"))
    models.join_slider_crank(m, (crank, rod, slider), r, l, "theta phi -")
    m.driver("motor", "theta", 0.2 + 3 * m.t)
    m.initial(theta=0.2)
    m.guess(D=0.45, phi=-0.3)
    mod = m.compile(target=target)

    def closed(t: float, r: float = 0.1) -> list[float]:
        theta = 0.2 + 3 * t
        beta = -np.arcsin(r * np.sin(theta) / 0.35)
        beta_dot = -r * np.cos(theta) * 3 / (0.35 * np.cos(beta))
        s = r * np.cos(theta) + 0.35 * np.cos(beta)
        s_dot = -3 * r * np.sin(theta) - 0.35 * beta_dot * np.sin(beta)
        return [theta, beta - theta, s, 3.0, beta_dot - 3.0, s_dot]

    assert mod.q_names == ("theta", "phi", "D")
    for t in (0.0, 0.1, 0.15):
        near = np.array(closed(t)) + 1e-5
        np.testing.assert_allclose(mod.project(near, t), closed(t), atol=1e-9)
        np.testing.assert_array_equal(mod.project(near, t=t), mod.project(near, t))
        bound = mod.bind(p={"r": 0.12})
        np.testing.assert_allclose(bound.project(near, t), closed(t, 0.12), atol=1e-9)
        np.testing.assert_array_equal(mod.project(near, t, bound.p), bound.project(near, t))
    times = np.array([0.0, 0.1, 0.15])
    many = np.array([closed(t) for t in times]).T
    np.testing.assert_allclose(mod.project(many + 1e-5, times), many, atol=1e-9)


FAR = ("andrews_squeezer", "delta_robot", "bricard", "stewart_platform")


@pytest.mark.parametrize("name", part_of(FAR, "andrews_squeezer".__eq__))
def test_far_states_come_to_the_same_place(name: str) -> None:
    model = models.build(name)
    module, dense = compiled(name, "cython"), model.compile(target="numpy")
    x, random = module.x0(), np.random.default_rng(1)
    for size in (0.01, 0.1, 0.2):
        far = np.tile(x[:, None], 5)
        far[: module.n_q] += size * random.uniform(-1, 1, (module.n_q, 5))
        far[module.n_q :] += random.uniform(-1, 1, (module.n_x - module.n_q, 5))
        expected = dense.rhs(0.0, far)
        np.testing.assert_allclose(module.rhs(0.0, far), expected, rtol=0, atol=1e-12 * np.abs(expected).max())


# -- initial values given as outputs, as places and as velocities of markers, beside closed forms of the mecha ---------
EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(scope="module", params=TARGETS)
def wanted_crank(request: pytest.FixtureRequest) -> Any:
    return eg.load(EXAMPLES / "slider_crank.yaml").compile(target=request.param)


def crank_angle(r: float, length: float, s: float) -> float:
    """The crank's angle at a place of the slider, by the law of cosines."""
    return float(np.arccos((r * r + s * s - length * length) / (2.0 * r * s)))


@pytest.mark.parametrize(("r", "s"), [(0.1, 0.31), (0.15, 0.48)])
@pytest.mark.parametrize("name", ["pin_x", "x( rod.tip )"])
def test_the_place_of_the_slider_sets_the_angle_of_the_crank(wanted_crank: Any, name: str, r: float, s: float) -> None:
    x = wanted_crank.bind(p={"r": r}).x0({name: s})
    assert x[0] == pytest.approx(crank_angle(r, 0.35, s), abs=1e-9)
    assert x[2] == pytest.approx(s, abs=1e-11)
    assert x[3] == 10.0  # the declared rate of the crank is kept


def test_runs_and_ensembles_start_there(wanted_crank: Any) -> None:
    run = wanted_crank.simulate(0.05, initial={"pin_x": 0.40})
    assert run["pin_x"][0] == pytest.approx(0.40, abs=1e-12)
    many = wanted_crank.simulate_many(0.05, initial={"pin_x": np.array([0.40, 0.42])})
    near = 1e-9  # lanes have the tolerance and not the bits of one run
    np.testing.assert_allclose(many.x[:, 0], run.x[:, -1], rtol=near)
    np.testing.assert_allclose(many.x[:, 1], wanted_crank.simulate(0.05, initial={"pin_x": 0.42}).x[:, -1], rtol=near)


def test_what_cannot_be_held_is_refused(wanted_crank: Any) -> None:
    refuses("EG-LOOP-OPEN pin_x 0.9 0.45", wanted_crank.x0, pin_x=0.9)
    refuses("EG-LOOP-OPEN 2 1", wanted_crank.x0, pin_x=0.42, theta=0.1)
    refuses("EG-NAME-UNKNOWN rod.tp rod.tip", wanted_crank.x0, {"x(rod.tp)": 0.4})
    refuses("EG-NAME-UNKNOWN pin_x?", wanted_crank.x0, pinx=0.4)
    refuses("EG-MISSING pin_x", wanted_crank.sensitivities, ["l"], (0, 0.01), initial={"pin_x": 0.42})


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
        m = eg.Model("two_links", gravity=(0, -9.81, 0))
        one, two = (m.body(name, mass=1, inertia={"zz": 0.1}) for name in ("one", "two"))
        m.revolute("A", m.ground.at(0, 0, 0, rpy=(0, 0, turn)), one, coordinate="a")
        m.revolute("B", one.at(0.7, 0, 0), two, coordinate="b")
        two.marker("end", at=(0.4, 0.1, 0))
        mod = m.compile(target="numpy")
        for _ in range(10):
            a, b, vx, vy = random.uniform(0.3, 1.2, 4)
            x = mod.x0({"a": a, "b": b, "vx(two.end)": vx, "vy(two.end)": vy})
            assert x[:2].tolist() == [a, b]
            first, both = a + turn, a + b + turn
            n = np.array([-sin(first), cos(first)]) * 0.7
            k = np.array([-0.4 * sin(both) - 0.1 * cos(both), 0.4 * cos(both) - 0.1 * sin(both)])
            assert (n + k) * x[2] + k * x[3] == pytest.approx([vx, vy], abs=1e-12)


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
