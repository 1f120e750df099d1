"""At and beside change points: the same motion without the singularity, 50 digits, branches, runs through them."""

from functools import cache
from typing import Any

import models
import mpmath as mp
import numpy as np
import pytest
from refusals import refused
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from sweeps import TARGETS, part_of

import eomgen as eg

# -- A parallelogram beside one held by couplings ----------------------------------------------------------------------
ANGLES = (0.3, 0.03, 0.01, 1e-3, 1e-5, 1e-7, 0.0)  #: from flat (rad)
PROJECTED = ("embedding", "lagrange", "recursive", "gibbs_appell", "hamilton")
PROJECTING = (*PROJECTED, "augmented", "amalgamated", "newton_euler")


@cache
def parallelogram(base: str, coupled: bool, target: str = "numpy", method: str = "embedding") -> Any:
    """A parallelogram of rods of 1 m on a base that is ground, slides, is driven, or turns about a ball joint."""
    m = eg.Model(f"parallelogram_{base}_{'coupled' if coupled else 'hinged'}", gravity=(0, -9.81, 0))
    ground = m.ground
    if base != "ground":
        ground = m.body("base", mass=2, com=(0.2, -0.3, 0.1), inertia=(0.3, 0.4, 0.5))
    if base == "ball":
        m.spherical("S", m.ground, ground, rotation="euler_parameters")
    elif base != "ground":
        m.prismatic("S", m.ground, ground, axis="x", coordinate="s")
    if base == "driven":
        m.driver("push", coordinate="s", value="0.3*sin(4*t)")
    a, b, c = (m.body(n, mass=1, com=(0.5, 0, 0), inertia=(0.01, 1 / 12, 1 / 12)) for n in "abc")
    m.revolute("A", ground.at(0, 0, 0), a, coordinate="theta")
    m.revolute("B", a.at(1, 0, 0), b, coordinate="bend")
    m.revolute("D", ground.at(1, 0, 0), c, coordinate="psi")
    if coupled:
        m.coupling("first", coordinates={"bend": 1, "theta": 1})
        m.coupling("second", coordinates={"psi": 1, "theta": -1})
    else:
        m.revolute("C", b.at(1, 0, 0), c.at(1, 0, 0))
    m.guess(theta=1.0, bend=-1.0, psi=1.0)
    return m.compile(method, target=target)


def states(base: str, angle: float, names: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray]:
    """A state of the coupled mechanism, and the same in the order of some names, as an integrator leaves it."""
    mod, rng = parallelogram(base, True), np.random.default_rng(5)
    x = mod.x0({"theta": angle, "theta_dot": -5.0, **({"s": 0.2, "s_dot": 3.0} if base == "slider" else {})}, t=0.37)
    if base == "ball":
        turned = rng.normal(size=4)
        x[[k for k, name in enumerate(mod.x_names) if name.startswith("S_e")]] = turned / np.linalg.norm(turned)
        x[[k for k, name in enumerate(mod.x_names) if name.startswith("S_w")]] = rng.normal(size=3)
    return x, x[[mod.x_names.index(name) for name in names]] + 1e-12 * rng.normal(size=len(x))


def check_accelerations(mod: Any, base: str, angle: float, tolerance: float) -> None:
    x, given = states(base, angle, mod.x_names)
    free = parallelogram(base, True)
    expected = free.rhs(0.37, x)[[free.x_names.index(name) for name in mod.x_names]]
    assert np.abs(mod.rhs(0.37, given) - expected).max() <= tolerance * np.abs(expected).max()


@pytest.mark.parametrize("angle", ANGLES)
@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("base", ["ground", "slider", "driven", "ball"])
def test_accelerations_are_those_of_the_motion_that_goes_straight_on(base: str, target: str, angle: float) -> None:
    """With the noise of the constraints, eps / s^3, they were right to 1e-9 at 0.03 rad and to 1e-5 at 0.001 rad."""
    check_accelerations(parallelogram(base, False, target), base, angle, 2e-9)


FORMS = [(method, target) for method in PROJECTING for target in ("cython", "numpy")]
ALWAYS = [("recursive", "cython"), *((n, "numpy") for n in ("embedding", "hamilton", "augmented", "newton_euler"))]


@pytest.mark.parametrize(("method", "target"), part_of(FORMS, ALWAYS.__contains__))
def test_in_every_method(method: str, target: str) -> None:
    for angle in (0.01, 1e-4):
        check_accelerations(parallelogram("ground", False, target, method), "ground", angle, 1e-10)


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("base", ["ground", "slider"])
def test_the_jacobian_follows_the_branch(base: str, target: str) -> None:
    """Along motions of the branch it is that of the mechanism with couplings."""
    mod, free = parallelogram(base, False, target), parallelogram(base, True)
    at = [free.x_names.index(name) for name in mod.x_names]
    for angle in (0.01, 1e-3, 1e-5):
        x, _ = states(base, angle, mod.x_names)
        J = mod.jacobian(0.37, x[at])
        for k in range(free.n_x):
            along = np.zeros(free.n_x)
            along[k] = 1.0
            along = (free.project(x + 1e-6 * along, t=0.37) - free.project(x - 1e-6 * along, t=0.37)) / 2e-6
            expected = (free.jacobian(0.37, x) @ along)[at]
            assert np.abs(J @ along[at] - expected).max() <= 1e-6 * max(1.0, np.abs(expected).max())


@pytest.mark.parametrize("target", TARGETS)
def test_at_rest_in_a_change_point_no_branch_is_chosen(target: str) -> None:
    mod = parallelogram("ground", False, target)
    with pytest.raises(eg.PartitionError):
        mod.rhs(0.0, np.zeros(mod.n_x))


# -- Nearly a parallelogram, in 50 digits ------------------------------------------------------------------------------
mp.mp.dps = 50
NAMES = ("theta", "bend", "psi")


@cache
def nearly_parallel(method: str, target: str) -> Any:
    m = eg.Model("nearly_a_parallelogram", gravity=(0, 0, 0))
    m.parameter("gap", 1e-3)
    a, b, c = (m.body(n, mass=1, com=(0.5, 0, 0), inertia={"zz": 1 / 12}) for n in "abc")
    m.revolute("A", m.ground, a, coordinate="theta")
    m.revolute("B", a.at(1, 0, 0), b, coordinate="bend")
    m.revolute("D", m.ground.at("1 - gap", 0, 0), c, coordinate="psi")
    m.revolute("C", b.at(1, 0, 0), c.at(1, 0, 0))
    m.guess(theta=1.0, bend=-1, psi=1)
    return m.compile(method, target=target, independent=["theta"])


def closure(q: Any, gap: Any) -> tuple[Any, Any]:
    """C and C_q."""
    a, b, c = q[0], q[0] + q[1], q[2]
    C = mp.matrix([mp.cos(a) + mp.cos(b) - mp.cos(c) - 1 + gap, mp.sin(a) + mp.sin(b) - mp.sin(c)])
    J = mp.matrix([[-mp.sin(a) - mp.sin(b), -mp.sin(b), mp.sin(c)], [mp.cos(a) + mp.cos(b), mp.cos(b), -mp.cos(c)]])
    return C, J


def least(J: Any, e: Any) -> Any:
    return J.T * mp.lu_solve(J * J.T, e)


def exact(x: Any, gap: float) -> tuple[Any, Any, Any]:
    """q, v and v' of the state nearest to x, in 50 digits; coordinates in the order of NAMES."""
    e = mp.mpf(gap)
    q, v = mp.matrix(list(x[:3])), mp.matrix(list(x[3:]))
    for _ in range(40):
        C, J = closure(q, e)
        step = least(J, C)
        q -= step
        if mp.norm(step) < mp.mpf(10) ** -45:
            break
    J = closure(q, e)[1]
    v -= least(J, J * v)
    a, b, c = q[0], q[0] + q[1], q[2]
    da, db, dc = v[0], v[0] + v[1], v[2]
    gamma = [f * (mp.cos(a) * da**2 + mp.cos(b) * db**2 - mp.cos(c) * dc**2) for f in (-1,)]
    gamma.append(-mp.sin(a) * da**2 - mp.sin(b) * db**2 + mp.sin(c) * dc**2)
    third, cos, sin = mp.mpf(1 / 12) + mp.mpf(1) / 4, mp.cos(q[1]), mp.sin(q[1])
    K = mp.zeros(5)
    K[:3, :3] = mp.matrix([[2 * third + 1 + cos, third + cos / 2, 0], [third + cos / 2, third, 0], [0, 0, third]])
    K[3:, :3], K[:3, 3:] = J, J.T
    force = [sin / 2 * (db**2 - da**2), -sin / 2 * da**2, 0]
    return q, v, mp.lu_solve(K, mp.matrix([*force, *(-g for g in gamma)]))[:3]


@cache
def near(gap: float, share: float) -> tuple[np.ndarray, float]:
    """A state about sqrt(gap) from flat, moving, and its smallest singular value relative to the largest."""
    theta = 0.9 * share * np.sqrt(gap)

    def open_by(psi: float) -> float:
        return float((np.cos(theta) - 1 + gap - np.cos(psi)) ** 2 + (np.sin(theta) - np.sin(psi)) ** 2 - 1)

    grid = np.linspace(-10 * theta, 10 * theta, 401)
    at = next(k for k in range(400) if open_by(grid[k]) * open_by(grid[k + 1]) < 0)
    psi = brentq(open_by, grid[at], grid[at + 1], xtol=1e-16)
    bend = np.arctan2(np.sin(psi) - np.sin(theta), 1 - gap + np.cos(psi) - np.cos(theta)) - theta
    q = np.array([theta, bend, psi])
    J = np.array(closure(mp.matrix(list(q)), mp.mpf(gap))[1].tolist(), dtype=float)
    _, sizes, Vt = np.linalg.svd(J)
    q, v, _ = exact(np.concatenate([q, Vt[2] / np.abs(Vt[2]).max()]), gap)
    return np.array([float(z) for z in (*q, *v)]), float(sizes[1] / sizes[0])


@cache
def acceleration(gap: float, share: float) -> np.ndarray:
    """Of that state, in 50 digits."""
    return np.array([float(z) for z in exact(near(gap, share)[0], gap)[2]])


STATES = [(gap, share) for gap in (1e-2, 1e-5, 1e-6, 1e-7, 3e-8, 1e-9) for share in (1.0, 3.0)]


def order(mod: Any) -> list[int]:
    return [mod.q_names.index(name) for name in NAMES]


NEAR_FORMS = [(method, target) for method in PROJECTED for target in ("numpy", "cython")]
NEAR_ALWAYS = [("embedding", "numpy"), ("recursive", "numpy")]


@pytest.mark.parametrize(("method", "target"), part_of(NEAR_FORMS, NEAR_ALWAYS.__contains__))
def test_accelerations_equal_those_in_fifty_digits(method: str, target: str) -> None:
    mod = nearly_parallel(method, target)
    for gap, share in STATES:
        x, weak = near(gap, share)
        expected = acceleration(gap, share)
        given = np.empty(6)
        given[order(mod)], given[[3 + k for k in order(mod)]] = x[:3], x[3:]
        found = mod.bind({"gap": gap}).rhs(0.0, given)[3:][order(mod)]
        assert np.abs(found - expected).max() <= 1e-15 / weak**2 * np.abs(expected).max(), (gap, share)


@pytest.mark.parametrize("target", TARGETS)
def test_projected_states_are_on_the_constraints_to_rounding(target: str) -> None:
    mod, rng = nearly_parallel("embedding", target), np.random.default_rng(1)
    for gap, share in STATES[:-2]:
        x, weak = near(gap, share)
        moved = x + 1e-4 * weak * rng.normal(size=6)
        given = np.empty(6)
        given[order(mod)], given[[3 + k for k in order(mod)]] = moved[:3], moved[3:]
        found = mod.bind({"gap": gap}).project(given)
        q = mp.matrix(list(found[order(mod)]))
        C, J = closure(q, mp.mpf(gap))
        rate = J * mp.matrix(list(found[[3 + k for k in order(mod)]]))
        assert max(map(abs, C)) <= 4e-15, (gap, share)
        assert max(map(abs, rate)) <= 1e-14 + 1e-15 / weak, (gap, share)


# -- Two in a row ------------------------------------------------------------------------------------------------------
START = {"theta": 1.0, "theta_dot": -5.0}


@cache
def two_rows(coupled: bool, target: str = "numpy") -> Any:
    m = eg.Model(f"two_rows_{'coupled' if coupled else 'hinged'}", gravity=(0, -9.81, 0))
    m.parameter("off", 1e-3)
    a, b, c, d, e = (m.body(name, mass=1, com=(0.5, 0, 0), inertia={"zz": 1 / 12}) for name in "abcde")
    m.revolute("A", m.ground, a, coordinate="theta")
    m.revolute("B", a.at(1, 0, 0), b, coordinate="bend")
    m.revolute("D", m.ground.at(1, 0, 0), c, coordinate="psi")
    if coupled:
        m.coupling("first", coordinates={"bend": 1, "theta": 1})
        m.coupling("second", coordinates={"psi": 1, "theta": -1})
    else:
        m.revolute("C", b.at(1, 0, 0), c.at(1, 0, 0))
    m.revolute("E", c.at("1 + off", 0, 0), d, coordinate="fold")
    m.revolute("F", m.ground.at(2, 0, 0), e, coordinate="phi")
    m.revolute("G", d.at(1, 0, 0), e.at(1, 0, 0))
    m.guess(theta=1.0, bend=-1, psi=1, fold=-1, phi=1)
    return m.compile(target=target, independent=["theta"], **({"optimize": 0} if target == "cython" else {}))


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("off", [1e-3, 1e-4])
def test_accelerations_while_the_second_loop_swings_round(off: float, target: str) -> None:
    """Off by 5 % while noise was judged by the swing, a thousand times as fast as the loop at its change point."""
    judge, mod = (two_rows(coupled, target).bind({"off": off}) for coupled in (True, False))
    run = two_rows(True).bind({"off": off}).simulate(0.277, START, method="DOP853", rtol=1e-11, atol=1e-12)
    for angle in (1e-3, 3e-4, 1e-4):
        x = judge.project(run.x[:, int(np.argmin(np.abs(run["theta"] - angle)))])
        expected = judge.rhs(0.0, x)
        assert judge.x_names == mod.x_names
        assert np.abs(mod.rhs(0.0, x) - expected)[5:].max() <= 1e-9 * np.abs(expected[5:]).max()


@pytest.mark.parametrize("off", [1e-2, 3e-4, 0.0])
def test_freedoms_at_the_change_point_are_those_of_the_loop_that_lies_flat(off: float) -> None:
    """The smallest singular value of the second loop is about 0.6 times the offset there."""
    run = two_rows(False).bind({"off": off}).simulate(0.29, START, method="DOP853", rtol=1e-6, atol=1e-8)
    assert run["theta"][-1] < 0.0
    (point,) = run.change_points
    assert abs(point.coordinates["theta"]) <= 1e-5
    assert point.degrees_of_freedom == (2 if off else 3)


# -- where branches meet -----------------------------------------------------------------------------------------------
# -- Starts where parallelograms lie flat ------------------------------------------------------------------------------
ARM, SPEED = 0.3, 5.0


@cache
def row_of_parallelograms(loops: int, target: str, turn: float = 0.0) -> Any:
    """Parallelograms of arms of 0.3 m and couplers of 1 m in a row; all frames turned by an angle, gravity too."""
    m = eg.Model(f"row_{loops}_{round(10 * turn)}", gravity=(9.81 * np.sin(turn), -9.81 * np.cos(turn), 0))
    base = m.ground.at(0, 0, 0, rpy=(0, 0, turn)) if turn else m.ground
    c, s = np.cos(turn), np.sin(turn)

    def bar(name: str, length: float) -> Any:
        return m.body(name, mass=1.0, com=(length / 2, 0, 0), inertia={"zz": length**2 / 12})

    arms = [bar(f"a{i}", ARM) for i in range(loops + 1)]
    couplers = [bar(f"c{i}", 1.0) for i in range(loops)]
    m.revolute("A0", base, arms[0], coordinate="th")
    for i in range(1, loops + 1):
        m.revolute(f"A{i}", m.ground.at(i * c, i * s, 0), arms[i])
    for i in range(loops):
        m.revolute(f"B{i}", arms[i].at(ARM, 0, 0), couplers[i])
        m.revolute(f"C{i}", couplers[i].at(1, 0, 0), arms[i + 1].at(ARM, 0, 0))
    return m.derive("embedding", independent=["th"]).compile(target=target)


def parallel(mod: Any, turn: float = 0.0) -> dict[str, float]:
    """All velocities of arms that stay parallel."""
    return {n: -SPEED if n.startswith(("B", "C")) else SPEED for n in mod.x_names if n.endswith("_dot")}


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("loops", [1, 2])
@pytest.mark.parametrize("angle", [0.0, 1e-9, np.pi])
def test_velocities_of_several_branches_are_refused_by_name(loops: int, angle: float, target: str) -> None:
    mod = row_of_parallelograms(loops, target)
    with refused("EG-UNDETERMINED change") as error:
        mod.simulate((0, 0.2), initial={"th": angle, "th_dot": SPEED})
    named = str(error.value).rsplit("give ", 1)[1].split(" too")[0].split(" and ")
    assert len(named) == loops
    wanted = {name: parallel(mod)[name] for name in named}
    x = mod.x0({"th": angle, "th_dot": SPEED, **wanted})  # what the message asks for is enough
    assert np.abs(x[mod.n_q :] - np.array([parallel(mod)[n] for n in mod.x_names[mod.n_q :]])).max() <= 1e-7 * SPEED


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize(("loops", "turn"), [(1, 0.0), (2, 0.7)])
@pytest.mark.parametrize("angle", [0.0, 1e-9, np.pi])
def test_all_velocities_of_a_branch_start_it(loops: int, turn: float, angle: float, target: str) -> None:
    mod = row_of_parallelograms(loops, target, turn)
    run = mod.simulate((0, 0.1), initial={"th": angle, **parallel(mod)}, rtol=1e-9, atol=1e-11)
    inertia = (loops + 1) * ARM**2 / 3 + loops * ARM**2
    weight = 9.81 * ((loops + 1) * ARM / 2 + loops * ARM)
    exact = solve_ivp(lambda t, y: [y[1], -weight / inertia * np.cos(y[0])], (0, 0.1), [angle, SPEED],
                      rtol=1e-11, atol=1e-13, dense_output=True)  # fmt: skip
    assert np.abs(run["th"] - exact.sol(run.t)[0]).max() <= 1e-7
    assert np.ptp(run["energy"]) <= 1e-7
    assert abs(run["energy"][0] - 0.5 * inertia * SPEED**2 - weight * np.sin(angle)) <= 1e-7


@cache
def slider_crank(target: str) -> Any:
    """Crank and rod of 1 m each: at 90 degrees the rod lies on the crank, and may turn with it or mirror it."""
    m = eg.Model("equal_arms", gravity=(0, -9.81, 0))
    crank = m.body("crank", mass=1.0, com=(0.5, 0, 0), inertia={"zz": 0.1})
    rod = m.body("rod", mass=2.0, com=(0.5, 0, 0), inertia={"zz": 0.2})
    slider = m.body("slider", mass=0.5)
    models.join_slider_crank(m, (crank, rod, slider), 1, 1, "th b s")
    m.guess(th=0.5, b=-1.0, s=1.8)
    m.output("acceleration", "th_ddot")
    return m.compile(target=target)


def mirrored(th: float, w: float) -> float:
    """The crank's acceleration where the rod's angle is -th: T = M(th) w^2 / 2, V = 1.5 g sin th."""
    inertia = 0.1 + 0.25 + 0.2 + 2 * (2.25 * np.sin(th) ** 2 + 0.25 * np.cos(th) ** 2) + 2.0 * np.sin(th) ** 2
    slope = (8.0 + 4.0) * np.sin(th) * np.cos(th)
    return float((-9.81 * 1.5 * np.cos(th) - 0.5 * slope * w * w) / inertia)


def together(th: float, w: float) -> float:
    """The same where the rod turns with the crank and the slider rests: a pendulum."""
    return float(-9.81 * 1.5 * np.cos(th) / (0.1 + 0.25 + 0.2 + 0.5))


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize(("s_dot", "law"), [(-4.0, mirrored), (0.0, together)])
def test_a_slider_crank_of_equal_arms_runs_on_both_branches(s_dot: float, law: Any, target: str) -> None:
    start = {"th": np.pi / 2, "th_dot": 2.0, "s_dot": s_dot}
    run = slider_crank(target).simulate((0, 0.9), initial=start, rtol=1e-10, atol=1e-12)
    found = solve_ivp(
        lambda t, y: [y[1], law(*y)], (0, 0.9), [np.pi / 2, 2.0], "DOP853", rtol=1e-12, atol=1e-13
    )  # fmt: skip
    assert abs(run["th"][-1] - found.y[0, -1]) < 1e-8
    assert abs(run["th_dot"][-1] - found.y[1, -1]) < 1e-7


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize(("s_dot", "law"), [(-4.0, mirrored), (0.0, together)])
@pytest.mark.parametrize("off", [0.0, 1e-9, 1e-5, 0.1])
def test_outputs_follow_the_branch_too(off: float, s_dot: float, law: Any, target: str) -> None:
    mod, turn = slider_crank(target), s_dot / 4.0
    x = mod.project([np.pi / 2 + off, -np.pi + 2 * off * turn, 2 * np.sin(off) * turn, 2.0, s_dot, s_dot * np.cos(off)])
    expected = law(np.pi / 2 + off, 2.0)
    assert mod.rhs(0.0, x)[3] == pytest.approx(expected, rel=1e-5, abs=1e-11)
    assert mod.outputs(0.0, x) == pytest.approx([expected], rel=1e-5, abs=1e-11)


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("off", [1e-15, 1e-12, 1e-9])
def test_what_rounding_leaves_of_rows_tells_no_accelerations(off: float, target: str) -> None:
    """Off both branches by so much no row is open by more than its square: nothing but rounding tells it."""
    x = [np.pi / 2, -np.pi + off, off, 2.0, -4.0, -4.0]
    assert np.abs(slider_crank(target).rhs(0.0, x)[3:]).max() < 1e-6


# -- A massless toggle -------------------------------------------------------------------------------------------------
R, L, MASS, TAU = 0.1, 0.35, 0.5, 1.0


@pytest.fixture(scope="module", params=TARGETS)
def toggle(request: pytest.FixtureRequest) -> Any:
    m = eg.Model("toggle")
    inertia = m.parameter("inertia", 0.0)
    crank, rod = m.body("crank", mass=m.parameter("crank_mass", 0.0), inertia={"zz": inertia}), m.body("rod", mass=0)
    slider = m.body("slider", mass=MASS)
    models.join_slider_crank(m, (crank, rod, slider), R, L, "theta - s")
    m.torque("motor", "A", TAU)
    m.initial(theta=1.0)
    return m.compile(independent=["theta"], target=request.param)


def closed_form(theta: float, rate: float) -> float:
    root = np.sqrt(L**2 - (R * np.sin(theta)) ** 2)
    slope = -R * np.sin(theta) - R**2 * np.sin(theta) * np.cos(theta) / root
    bend = -R * np.cos(theta) - R**2 * np.cos(2 * theta) / root - (R**2 * np.sin(theta) * np.cos(theta)) ** 2 / root**3
    return float((TAU - MASS * slope * bend * rate**2) / (MASS * slope**2))


@pytest.mark.parametrize("theta", [0.0, np.pi, -np.pi, 2 * np.pi])
def test_no_acceleration_is_made_up_at_the_dead_centre(toggle: Any, theta: float) -> None:
    x = toggle.x0(theta=theta, theta_dot=1.0)
    with pytest.raises(eg.SingularMassMatrixError):
        toggle.rhs(0.0, x)
    with pytest.raises(eg.SingularMassMatrixError):
        toggle.jacobian(0.0, x)
    assert np.isfinite(toggle.bind({"inertia": 1e-9}).rhs(0.0, x)).all()  # a crank of a milligram is enough


@pytest.mark.parametrize("theta", [0.3, 1e-3, 1e-6, 1e-10, np.pi - 1e-6])
def test_beside_it_the_closed_form_is_followed(toggle: Any, theta: float) -> None:
    x = toggle.x0(theta=theta, theta_dot=2.0)
    found = toggle.rhs(0.0, x)[toggle.x_names.index("theta_dot")]
    assert found == pytest.approx(closed_form(theta, 2.0), rel=1e-9 + 1e-15 / abs(np.sin(theta)))


# -- Positions that rounding does not tell -----------------------------------------------------------------------------
LENGTHS = (0.2, 0.5)  #: crank and coupler (m)


@cache
def parallelograms(scales: tuple[float, ...], method: str, target: str, turned: bool = False) -> Any:
    """Parallelograms beside each other; turned: from the other crank on, so that another joint is cut."""
    m = eg.Model("parallelograms", gravity=(0, -9.81, 0))
    for k, scale in enumerate(scales):
        crank, coupler = (scale * length for length in LENGTHS)
        a, b, c = (
            m.body(f"{name}{k}", mass=1, com=(0.5 * length, 0, 0), inertia={"zz": 0.01 * scale**2})
            for name, length in (("a", crank), ("b", coupler), ("c", crank))
        )
        ends = [m.ground, m.ground.at(coupler, 0, 0)]
        if turned:
            m.revolute(f"r{k}", ends[1], c)
            m.revolute(f"s{k}", b.at(coupler, 0, 0), c.at(crank, 0, 0))
            m.revolute(f"q{k}", a.at(crank, 0, 0), b)
            m.revolute(f"p{k}", ends[0], a)
        else:
            m.revolute(f"p{k}", ends[0], a)
            m.revolute(f"q{k}", a.at(crank, 0, 0), b)
            m.revolute(f"r{k}", ends[1], c)
            m.revolute(f"s{k}", b.at(coupler, 0, 0), c.at(crank, 0, 0))
    return m.compile(method=method, target=target)


def at(k: int, angle: float, share: float = 1.0) -> dict[str, float]:
    """Angles of the cranks of parallelogram k, the second a share of the first, closed to first order."""
    other = share * angle
    closing = LENGTHS[0] / LENGTHS[1] * (other - angle) - angle
    return {f"p{k}": angle, f"q{k}": closing, f"r{k}": other}


@pytest.mark.parametrize("share", [1.0, 0.5])
@pytest.mark.parametrize("angle", [1e-8, 1e-10, 0.0])
@pytest.mark.parametrize("scales", [(1.0, 0.01), (1.0, 1.0), (1000.0, 1.0)])
@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("method", ["embedding", "augmented"])
def test_it_is_refused(method: str, target: str, scales: tuple[float, ...], angle: float, share: float) -> None:
    mod = parallelograms(scales, method, target)
    x = mod.x0(at(0, 0.5) | at(1, angle, share))
    with pytest.raises((eg.PartitionError, eg.UnsolvedError)):
        mod.rhs(0.0, x)
    with pytest.raises((eg.PartitionError, eg.UnsolvedError)):
        mod.jacobian(0.0, x)


@pytest.mark.parametrize("angle", [1e-8, 1e-7, 1e-6])
@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("method", ["augmented", "newton_euler"])
def test_a_position_closed_by_rounding_alone_is_refused(method: str, target: str, angle: float) -> None:
    """One crank at half the angle of the other: the loop is open by less than rounding, no motion keeps it closed."""
    mod = parallelograms((1.0,), method, target)
    with pytest.raises((eg.PartitionError, eg.UnsolvedError)):
        mod.rhs(0.0, mod.x0(at(0, angle, 0.5)))


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("target", TARGETS)
def test_beyond_it_is_right_to_what_closures_tell(target: str, turned: bool, scale: float) -> None:
    """Both cranks of a parallelogram turn alike: 1e-16 / s^2 of their acceleration, whatever joint is cut."""
    mod = parallelograms((scale,), "embedding", target, turned)
    names = list(mod.q_names)
    expected = 9.81 * (2 * 0.1 + 0.2) / (2 * (0.01 + 0.1**2) + 0.2**2) / scale  # two cranks and the coupler of 1 kg
    for angle in (1e-5, 1e-4, 1e-3):
        given = {name: value for name, value in at(0, angle).items() if name in names}
        x = mod.x0(given | ({"s0": angle} if "s0" in names else {}))
        found = mod.rhs(0.0, x)[mod.n_q :]
        crank = found[names.index("p0" if "p0" in names else "r0")]
        assert abs(crank) == pytest.approx(expected, rel=10 * 1e-16 / (0.1 * angle) ** 2 + angle**2)
