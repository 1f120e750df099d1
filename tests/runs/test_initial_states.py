"""Positions and velocities that close loops: given values held, branches kept, projection, beside closed forms."""

from typing import Any

import models
import numpy as np
import pytest
from analysed import compiled
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


def test_assembly_with_other_parameters(crank: eg.Module) -> None:
    p = {"r": 0.2, "l": 0.6, "e": 0.02}
    x = crank.x0({"theta": 0.7}, p=p)
    assert x[[0, 2]] == pytest.approx([0.7, placed(0.7, **p)], abs=1e-12)
    refuses("EG-LOOP-OPEN C.r_y", crank.x0, {"theta": 0.7}, p={"e": 3.0})


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


def parallelogram() -> eg.Model:
    m = eg.Model("parallelogram")
    one, bar, two = (m.body(name, mass=1, inertia={"zz": 1}) for name in ("one", "bar", "two"))
    m.revolute("A", m.ground, one, coordinate="theta")
    m.revolute("B", one.at(0.2, 0, 0), bar, coordinate="bend")
    m.revolute("C", bar.at(0.6, 0, 0), two.at(0.2, 0, 0))
    m.revolute("D", m.ground.at(0.6, 0, 0), two, coordinate="psi")
    m.initial(theta=0.5)
    m.guess(bend=-0.5, psi=0.5)
    return m


@pytest.fixture(scope="module")
def flat() -> eg.Module:
    return parallelogram().compile(target="numpy")


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
    m.revolute("A", m.ground, crank, coordinate="theta")
    m.revolute("B", crank.at(r, 0, 0), rod, coordinate="phi")
    m.revolute("C", rod.at(l, 0, 0), slider)
    m.prismatic("D", m.ground, slider, axis="x")
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


@pytest.mark.parametrize(
    "name",
    part_of(
        ("andrews_squeezer", "delta_robot", "bricard", "stewart_platform"), lambda name: name == "andrews_squeezer"
    ),
)
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
