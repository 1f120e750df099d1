"""At and beside change points: the same motion without the singularity, 50 digits, branches, runs through them."""

from functools import cache
from typing import Any

import mpmath as mp
import numpy as np
import pytest
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
