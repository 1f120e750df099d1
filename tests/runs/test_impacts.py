"""Impacts: closed forms, momentum and energy with constraints, complementarity by enumeration, runs by flights."""

import copy
import pickle
from itertools import combinations
from pathlib import Path
from typing import Any

import judges
import numpy as np
import pytest
from analysed import compiled
from models import IN_C
from refusals import refused, refuses
from sweeps import TARGETS

import eomgen as eg

G = 9.81


def ball() -> Any:
    m = eg.Model("ball", gravity=(0, 0, -G))
    m.prismatic("P", m.ground, m.body("b", mass=2.0), axis="z", coordinate="z")
    m.output("gap", "z - 0.1")
    return m.compile(target="numpy")


def test_a_bouncing_ball() -> None:
    """Impact times t0 + 2 t0 (e + e^2 + ...), to rest after t0 (1 + e) / (1 - e)."""
    e, start = 0.7, np.sqrt(2.0 / G)
    run = ball().simulate_impacts(4.0, {"gap": e}, {"z": 1.1}, rtol=1e-10)
    times = np.array([t for t, _ in run.impacts])
    k = np.arange(len(times))
    np.testing.assert_allclose(times, start + 2 * start * e * (1 - e**k) / (1 - e), rtol=0, atol=1e-9)
    assert run.ended == "rest"
    assert len(times) > 30
    assert abs(times[-1] - start * (1 + e) / (1 - e)) < 1e-4
    first = run.impacts[0][1]
    np.testing.assert_allclose(first["gap"], 2.0 * (1 + e) * G * start, rtol=1e-9)
    np.testing.assert_allclose(first.energy_lost, (1 - e**2) * G * 2.0, rtol=1e-9)
    assert run["z"].min() > 0.1 - 1e-9
    assert len(run["z"]) == len(run.t)
    assert ball().simulate_impacts(4.0, {"gap": e}, {"z": 1.1}, most=3).ended == "impacts"


@pytest.mark.parametrize("name", ["slider_crank", "three_cranks", "rolling_disc"])
def test_momentum_and_energy_with_constraints(name: str) -> None:
    """M dv + C_q^T i = n g with the gap's rate turned round; a plastic impact loses T(dv) (Carnot)."""
    mod = compiled(name)
    gap = {"slider_crank": "s", "three_cranks": "theta1", "rolling_disc": "yaw"}[name]
    for x in judges.random_states(mod, 8, 2):
        q, v = x[: mod.n_q], x[mod.n_q :]
        n = np.eye(mod.n_v)[mod.v_names.index(f"{gap}_dot")]
        M, C_q = mod.mass_matrix(q), mod.constraint_jacobian(q, rows="all")
        for e in (0.0, 0.6, 1.0):
            hit = mod.impact(0.0, x, {gap: e}, closed=True)  # a stop where it is
            dv = hit.x[mod.n_q :] - v
            size = np.abs(M @ v).max()
            np.testing.assert_allclose(M @ dv + C_q.T @ hit.constraint_impulses, n * hit[gap], atol=1e-9 * size)
            np.testing.assert_allclose(C_q @ dv, 0.0, atol=1e-9 * np.abs(v).max())
            assert hit[gap] >= 0.0
            closing = n @ v < 0
            np.testing.assert_allclose(n @ (v + dv), -e * (n @ v) if closing else n @ v, atol=1e-9 * np.abs(v).max())
            lost = 0.5 * (v @ M @ v - (v + dv) @ M @ (v + dv))
            np.testing.assert_allclose(hit.energy_lost, lost, atol=1e-10 * (v @ M @ v))
            if e == 0.0:
                np.testing.assert_allclose(lost, 0.5 * dv @ M @ dv, atol=1e-10 * (v @ M @ v))
        locked = mod.impact(0.0, x, lock=[gap])
        dv = locked.x[mod.n_q :] - v
        np.testing.assert_allclose(n @ (v + dv), 0.0, atol=1e-10 * np.abs(v).max())
        np.testing.assert_allclose(M @ dv + C_q.T @ locked.constraint_impulses, n * locked[gap], atol=1e-9 * size)


def enumerated(M: Any, N: Any, v: Any, e: Any) -> Any:
    """Velocities after: of all sets of pushing gaps the one that fits, again until no gap closes."""
    v = np.array(v, dtype=float)
    for _ in range(5000):
        rates = N @ v
        involved = np.flatnonzero(rates <= 1e-13)
        if not (rates < -1e-11).any():
            return v
        need = np.where(rates < -1e-13, -(1 + e) * rates, 0.0)
        A = N @ np.linalg.solve(M, N.T)
        v = v + np.linalg.solve(M, N.T @ one_of_the_sets(A, need, involved))
    raise AssertionError("no end")


def one_of_the_sets(A: Any, need: Any, involved: Any) -> Any:
    for count in range(len(involved) + 1):
        for chosen in map(list, combinations(involved, count)):
            g = np.zeros(len(need))
            g[chosen] = np.linalg.lstsq(A[np.ix_(chosen, chosen)], need[chosen], rcond=1e-12)[0] if chosen else 0.0
            slack = (A @ g - need)[involved]
            met = np.abs((A @ g - need)[chosen]).max(initial=0) < 1e-10
            if (g >= -1e-12).all() and (slack >= -1e-10).all() and met:
                return g
    raise AssertionError("no set fits")


def linear(masses: Any, normals: Any) -> Any:
    """Masses on lines of their own, gaps that are linear in their places."""
    m = eg.Model("linear")
    for i, mass in enumerate(masses):
        m.prismatic(f"x{i}", m.ground, m.body(f"b{i}", mass=float(mass)), axis="x")
    for k, row in enumerate(normals):
        m.output(f"g{k}", " + ".join(f"({float(a)!r})*x{i}" for i, a in enumerate(row)))
    return m.compile(target="numpy")


def strike(mod: Any, v: Any, e: Any) -> Any:
    gaps = {f"g{k}": float(e_k) for k, e_k in enumerate(e)}
    return mod.impact(0.0, np.concatenate([np.zeros(mod.n_q), v]), gaps)


CHAIN = np.array([[-1.0, 1, 0, 0], [0, -1, 1, 0], [0, 0, -1, 1]])


@pytest.mark.quick
def test_balls_on_a_line() -> None:
    """Any four velocities and restitutions; no energy is gained, whatever the restitutions."""
    rng = np.random.default_rng(3)
    masses = [1.0, 2.5, 0.7, 1.3]
    mod, M = linear(masses, CHAIN), np.diag(masses)
    for k in range(30):
        v = rng.normal(size=4)
        e = rng.random(3) if k % 2 else np.full(3, rng.random())
        hit = strike(mod, v, e)
        np.testing.assert_allclose(hit.x[4:], enumerated(M, CHAIN, v, e), atol=1e-8)
        assert (hit.rates_after > -1e-10).all()
        assert (hit.impulses >= 0.0).all()
        np.testing.assert_allclose(M @ (hit.x[4:] - v), CHAIN.T @ hit.impulses, atol=1e-12)
        np.testing.assert_allclose(hit.energy_lost, 0.5 * (v @ M @ v - hit.x[4:] @ M @ hit.x[4:]), atol=1e-12)
        assert hit.energy_lost > -1e-12


def test_jammed_between_two_walls() -> None:
    mod = linear([2.0], [[1.0], [-1.0]])
    refuses("EG-CONTRADICTION restitution 0", strike, mod, [3.0], [1.0, 1.0])
    hit = strike(mod, [3.0], [0.0, 0.0])
    np.testing.assert_allclose([hit.x[1], hit["g0"], hit["g1"], hit.energy_lost], [0.0, 0.0, 6.0, 9.0], atol=1e-12)
    np.testing.assert_allclose(strike(mod, [3.0], [0.5, 0.5]).x[1], 0.0, atol=1e-10)  # to and fro until it stands
    wedge = linear([1.0, 1.0], [[1.0, 0.0], [-1.0, 1e-7]])
    refuses("EG-CONTRADICTION g0 g1", strike, wedge, [-1.0, -1e8], [1.0, 1.0])


def test_what_drivers_impose() -> None:
    m = eg.Model("driven")
    m.revolute("A", m.ground, m.body("b", mass=1.0), coordinate="a")
    m.driver("d", "A", value="-2*t")
    mod = m.compile(target="numpy")
    refuses("EG-CONTRADICTION a -2", lambda: mod.impact(0.0, mod.x0(), {"a": 0.5}))
    refuses("EG-UNSUPPORTED freedom", mod.simulate_impacts, 1.0, {"a": 0.5})


@pytest.mark.parametrize("e", [0.0, 0.6])
def test_a_racket_that_moves(e: float) -> None:
    """A gap to something that moves in time: v+ = w - e (v - w), and the racket does work."""
    m = eg.Model("racket")
    m.prismatic("y", m.ground, m.body("ball", mass=2.0), axis="y")
    m.output("gap", "y - 0.1*sin(5*t)")
    mod = m.compile(target="numpy")
    t = 0.3
    x = np.array([0.1 * np.sin(5 * t), -1.0])
    w = 0.5 * np.cos(5 * t)
    hit = mod.impact(t, x, {"gap": e})
    np.testing.assert_allclose(hit.x[1], w - e * (-1.0 - w), rtol=1e-9)
    np.testing.assert_allclose(hit.energy_lost, 1.0 - hit.x[1] ** 2, rtol=1e-9)


def box(gravity: float = 0.0, target: str = "numpy") -> Any:
    """A mass between two walls 1 m apart."""
    m = eg.Model("box", gravity=(0, -gravity, 0))
    b = m.body("b", mass=2.0)
    m.prismatic("y", m.ground, b, axis="y")
    m.force("push", b, (0, m.input("F", 0.0), 0))
    m.output("lo", "y")
    m.output("hi", "1 - y")
    return m.compile(target=target, **(IN_C if target == "cython" else {}))


@pytest.mark.parametrize("target", TARGETS)
def test_to_and_fro_between_walls(target: str) -> None:
    """The mirror images of the walls: y is a triangle wave of y0 + v t."""
    mod, rng = box(target=target), np.random.default_rng(1)
    for _ in range(5):
        y, v = rng.random(), rng.uniform(-5, 5)
        run = mod.simulate_impacts(2.0, {"lo": 1.0, "hi": 1.0}, {"y": y, "y_dot": v})
        straight = y + v * run.t
        np.testing.assert_allclose(run["y"], 1.0 - np.abs((straight % 2.0) - 1.0), atol=1e-9)
        assert len(run.impacts) == abs(int(np.floor(y + 2 * v)))
        assert run.ended == "end"
        assert run.t[-1] == 2.0


def test_how_runs_end() -> None:
    mod = box(G)
    still = mod.simulate_impacts(1.0, {"lo": 0.5}, {"y": 0.0})
    assert (still.ended, len(still.t), still.impacts) == ("rest", 1, [])
    run = mod.simulate_impacts(4.0, {"lo": 0.5}, {"y": 1.0})
    assert run.ended == "rest"
    np.testing.assert_allclose(run.x[1, -2:], [run.impacts[-1][1].rates_before[0], run.impacts[-1][1].rates_after[0]])
    np.testing.assert_allclose(run.x[:, -1], run.impacts[-1][1].x, atol=0)
    plastic = mod.simulate_impacts(4.0, {"lo": 0.0}, {"y": 1.0})
    assert (plastic.ended, len(plastic.impacts), plastic["y_dot"][-1]) == ("rest", 1, 0.0)
    assert mod.simulate_impacts(9.0, {"lo": 0.9}, {"y": 1.0}, most=4).ended == "impacts"
    pulled = mod.simulate_impacts(0.1, {"lo": 0.5}, {"y": 0.0}, inputs={"F": 2 * (G + 1.0)})
    assert pulled.ended == "end"  # it is drawn away
    np.testing.assert_allclose(pulled["y"][-1], 0.005, rtol=1e-8)
    stuck = box().simulate_impacts(1.0, {"hi": 0.0}, {"y": 0.5, "y_dot": 1.0})
    assert (stuck.ended, stuck.t[-1]) == ("end", 1.0)  # nothing presses it to the wall
    np.testing.assert_allclose(stuck["y"][-1], 1.0, atol=1e-9)
    struck = mod.simulate_impacts(0.1, {"lo": 0.5}, {"y": 0.0, "y_dot": -2.0})
    np.testing.assert_allclose(struck.t[:2], 0.0)
    np.testing.assert_allclose(struck["y_dot"][:2], [-2.0, 1.0])


def test_the_run_is_a_trajectory(tmp_path: Path) -> None:
    run = box(G).simulate_impacts(1.5, {"lo": 0.6, "hi": 0.5}, {"y": 0.2, "y_dot": 6.0})
    hits = {name: [t for t, hit in run.impacts if name in hit.names] for name in ("lo", "hi")}
    for name, times in hits.items():
        np.testing.assert_array_equal(run.t_events[name], times)
        np.testing.assert_allclose(run.x_events[name][0], float(name == "hi"), atol=1e-9)
    t = 0.5 * (run.impacts[0][0] + run.impacts[1][0])
    s = t - run.impacts[0][0]
    np.testing.assert_allclose(run.at(t)["y"], 1.0 + run.impacts[0][1].x[1] * s - G * s * s / 2, rtol=1e-9)
    np.testing.assert_allclose(run.at(run.t[[0, -1]]).x, run.x[:, [0, -1]], atol=1e-12)
    assert len(run.pieces) == len(run.impacts) + 1
    assert run.pieces[1].t[0] == run.impacts[0][0] == run.pieces[0].t[-1]
    np.testing.assert_array_equal(np.concatenate([piece["energy"] for piece in run.pieces]), run["energy"])
    read = eg.load_trajectory(run.save(tmp_path / "run.npz"))
    np.testing.assert_array_equal(read["y"], run["y"])
    np.testing.assert_array_equal(read.t_events["hi"], run.t_events["hi"])
    for other in (pickle.loads(pickle.dumps(run)), copy.copy(run)):
        assert (other.ended, len(other.impacts), len(other.pieces)) == (run.ended, len(run.impacts), len(run.pieces))
        np.testing.assert_array_equal(other["lo"], run["lo"])


def test_an_event_of_the_model_ends_a_run_with_impacts() -> None:
    m = eg.Model("ended", gravity=(0, -10, 0))
    m.prismatic("J", m.ground, m.body("b", mass=1.0), axis="y", coordinate="h")
    m.event("late", "t - 0.6", terminal=True)
    m.initial(h=1.0)
    run = m.compile(target="numpy").simulate_impacts(2.0, {"h": 0.5})
    assert (run.ended, run.t[-1], len(run.impacts)) == ("event", pytest.approx(0.6, abs=1e-9), 1)
    m.event("often", "h - 0.5", terminal=2)
    refuses("EG-UNSUPPORTED often 2", lambda: m.compile(target="numpy").simulate_impacts(2.0, {"h": 0.5}))


@pytest.mark.parametrize("most", [3, 2**31, 10**12])
def test_resets_that_follow_each_other_at_once_are_no_impacts(most: int) -> None:
    m = eg.Model("counter", gravity=(0, -10, 0))
    m.prismatic("J", m.ground, m.body("b", mass=1.0), axis="y", coordinate="h")
    m.state("n", "0")
    m.event("tick", "t - 0.3 - (4e-8*n if n < 70 else 100)", direction=1, reset={"n": "n + 1"})
    m.initial(h=1.0)
    run = m.compile(target="numpy").simulate_impacts(60.0, {"h": 0.5}, most=most)
    assert (run["n"][-1], run.ended) == (70.0, "impacts" if most == 3 else "rest")


def held_rod() -> Any:
    """A rod that swings about a pin at its end, held there for a time, above a stop."""
    m = eg.Model("rod", gravity=(0, -9.81, 0))
    b = m.body("b", mass=1.0, inertia={"zz": 0.1}, markers={"p": (0.5, 0, 0)})
    m.planar("j", m.ground, b)
    m.hold("l", m.ground, "b.p", axes="xy", opens="100-t")
    m.output("h", "y(b)+0.3")
    return m.compile(target="numpy")


def test_an_impact_at_a_held_pin() -> None:
    """About the pin: (0.1 + 0.25) w+ = (0.1 + 0.25) w- + 0.5 impulse, and the centre leaves at half its speed."""
    held = held_rod()
    x = held.x0(j_y_dot=-1.0, j_3_dot=2.0)
    found = held.impact(0.0, x, {"h": 0.5}, closed=True)
    speeds = found.x[held.n_q : held.n_q + held.n_v]
    np.testing.assert_allclose(speeds, [0.0, 0.5, -1.0], atol=1e-12)
    assert found["h"] == pytest.approx(0.35 * 3.0 / 0.5, rel=1e-12)


def test_a_locked_joint_is_a_weld_in_impacts_with_friction() -> None:
    def arm(kind: str) -> Any:
        m = eg.Model("arm", gravity=(0, -9.81, 0))
        a = m.body("a", mass=1.0, com=(0.5, 0, 0), inertia={"zz": 0.1})
        b = m.body("b", mass=2.0, com=(0.3, 0, 0), inertia={"zz": 0.2}, markers={"tip": (0.6, 0, 0)})
        m.revolute("th", m.ground, a)
        if kind == "weld":
            m.weld("q", a.at(1, 0, 0), b)
        else:
            m.revolute("q", a.at(1, 0, 0), b)
            m.lock("l", "q", opens="100-t")
        m.output("slip", "vx(b.tip)")
        m.event("floor", "y(b.tip)+1", restitution=0.4, friction=0.3, slip="slip")
        m.initial(th=0.1)
        return m.compile(target="numpy")

    weld, lock = (arm(kind).simulate(0.75) for kind in ("weld", "lock"))
    assert (np.diff(weld.t) == 0.0).any()
    assert lock["th"][-1] == pytest.approx(weld["th"][-1], abs=1e-6)
    assert lock["th_dot"][-1] == pytest.approx(weld["th_dot"][-1], abs=1e-5)
    assert np.abs(lock["q_dot"]).max() < 1e-6


TEN, SPEED = 10.0, 0.5
WAYS: dict[str, Any] = {
    "text": "0.5*t",
    "line": ([0.0, 2.0], [0.0, 1.0]),
    "bent": ([-1.0, 0.0, 2.0], [0.0, 0.0, 1.0]),
    "spline": eg.Signal([0.0, 0.2, 0.6], [0.0, 0.1, 0.3], "cubic"),
}
#: The ball meets the floor where 1 - g t^2/2 = w t.
HIT = (-SPEED + np.sqrt(SPEED**2 + 2.0 * TEN)) / TEN
AFTER = 2.0 * SPEED + TEN * HIT


def ball_on_input(target: str, bounces: bool = True) -> Any:
    m = eg.Model("racket", gravity=(0, -TEN, 0))
    m.input("u")
    body = m.body("ball", mass=1)
    m.prismatic("s", m.ground, body, axis="y")
    m.initial(s=1.0)
    m.output("over", "s - u")
    if bounces:
        m.event("floor", "s - u", restitution=1.0)
    return m.compile(target=target, **(IN_C if target == "cython" else {}))


@pytest.fixture(scope="module", params=TARGETS)
def racket(request: Any) -> Any:
    return ball_on_input(request.param)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("method", ["DOP853", "Radau", "LSODA"])
def test_a_hit_takes_the_speed_of_the_floor(racket: Any, way: str, method: str) -> None:
    run = racket.simulate(0.6, inputs={"u": WAYS[way]}, method=method, rtol=1e-10, atol=1e-12)
    assert racket.u_names == ("u", "u_dot")
    assert abs(run.t_events["floor"][0] - HIT) < 1e-9
    k = np.searchsorted(run.t, HIT + 1e-6)
    assert abs(run["s_dot"][k] + TEN * (run.t[k] - HIT) - AFTER) < 1e-8


def test_a_floor_whose_rate_is_not_known_is_refused(racket: Any) -> None:
    refuses("EG-UNSUPPORTED u_dot", racket.simulate, 0.6, inputs={"u": lambda t, x: SPEED * t})
    refuses("EG-UNSUPPORTED u", racket.simulate, 0.6, inputs={"u": "0.1*s"})
    given = {"u": lambda t, x: SPEED * t, "u_dot": SPEED}
    run = racket.simulate(0.6, inputs=given, rtol=1e-10, atol=1e-12)
    assert abs(run["s_dot"][-1] + TEN * (0.6 - HIT) - AFTER) < 1e-8


def test_gaps_given_for_a_run_or_an_impact_move_with_their_inputs() -> None:
    mod = ball_on_input("numpy", bounces=False)
    assert mod.u_names == ("u",)
    for given in (*WAYS.values(), lambda t, x: SPEED * t):
        run = mod.simulate_impacts(0.6, {"over": 1.0}, inputs={"u": given}, rtol=1e-10, atol=1e-12)
        assert abs(run.impacts[0][0] - HIT) < 1e-9
        assert abs(run["s_dot"][-1] + TEN * (0.6 - HIT) - AFTER) < 1e-8
    for given in ("0.1*s", lambda t, x: 0.1 * x[0]):
        refuses("EG-UNSUPPORTED u", mod.simulate_impacts, 0.6, {"over": 1.0}, inputs={"u": given})
    mod = ball_on_input("numpy")
    hit = mod.impact(0.0, [0.3, -2.0], {"over": 0.5}, u={"u": 0.3, "u_dot": 1.0})
    assert abs(hit.x[1] - (1.0 + 0.5 * 3.0)) < 1e-12  # leaves at e times the speed of approach
    held = mod.impact(0.0, [0.3, -2.0], {"over": 0.5}, u={"u": 0.3})
    assert abs(held.x[1] - 1.0) < 1e-12


def test_what_impacts_refuse() -> None:
    mod = compiled("slider_crank")
    x = mod.x0()
    for words, message in (
        ({}, "EG-MISSING gaps"),
        ({"gaps": {"ss": 0.5}}, "EG-NAME-UNKNOWN ss"),
        ({"gaps": {"s": 1.5}}, "EG-RANGE restitution 0 1"),
        ({"gaps": {"s": [0.5]}}, "EG-NUMBER restitution"),
        ({"gaps": ["s"]}, "EG-TYPE gaps"),
        ({"lock": [0]}, "EG-TYPE lock"),
        ({"lock": ["tau"]}, "EG-NAME-UNKNOWN tau"),
        ({"gaps": {"speed": 0.5}}, "EG-UNSUPPORTED velocities"),
        ({"gaps": {"s": 0.5}}, "EG-EVENT s 0"),
    ):
        refuses(message, mod.impact, 0.0, x, **words)
    refuses("EG-NUMBER t", mod.impact, "a", x, lock=["s"])
    refuses("EG-EVENT z -0.1", lambda: ball().impact(0.0, [-0.1, -1.0], {"z": 0.5}))
    for words, message in (
        ({"initial": {"z": 0.0}}, "EG-RANGE -0.1 0"),
        ({"span": -1.0}, "EG-UNSUPPORTED time"),
        ({"gaps": {}}, "EG-MISSING gaps"),
        ({"most": 0}, "EG-RANGE most 1 0"),
        ({"t_eval": [0.0]}, "EG-NAME-UNKNOWN t_eval= t_events"),
    ):
        with refused(message):
            ball().simulate_impacts(**{"span": 1.0, "gaps": {"gap": 0.5}, "initial": {"z": 1.0}, **words})
