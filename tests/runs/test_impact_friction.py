"""Impacts with friction: published closed forms of every mode, Coulomb's law in space, momentum and energy; scales."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy
from refusals import refuses

import eomgen as eg


def wang_mason(W: Any, y: Any, mu: float, e: float) -> tuple[Any, str]:
    """Impulses (P_n, P_t) by their table for Poisson's hypothesis, and the mode (J. Appl. Mech. 59 (1992), 635-642).

    B1 = W_tt, B2 = W_nn, B3 = -W_nt, S0 and C0 the sliding and the closing velocity.
    """
    B1, B2, B3, C0, S0 = W[1, 1], W[0, 0], -W[0, 1], y[0], y[1]
    s = np.sign(S0)
    stops = S0 / (B3 + s * mu * B1)  # normal impulses at which sliding, and compression while sliding, end
    whole = -C0 / (B2 + s * mu * B3)
    stops = stops if stops > 0.0 else np.inf
    whole = whole if whole > 0.0 else np.inf
    if stops > (1.0 + e) * whole:
        P_n = (1.0 + e) * whole
        return (P_n, -s * mu * P_n), "sliding"
    sticks = mu > abs(B3) / B1
    if stops > whole:
        P_n = (1.0 + e) * whole
        if sticks:
            return (P_n, (B3 * P_n - S0) / B1), "R-sticking"
        return (P_n, s * mu * (P_n - 2.0 * S0 / (B3 + s * mu * B1))), "R-reversed"
    if sticks:
        P_n = -(1.0 + e) * (B1 * C0 + B3 * S0) / (B1 * B2 - B3 * B3)
        return (P_n, (B3 * P_n - S0) / B1), "C-sticking"
    P_n = -(1.0 + e) / (B2 - s * mu * B3) * (C0 + 2.0 * s * mu * B3 * S0 / (B3 + s * mu * B1))
    return (P_n, s * mu * (P_n - 2.0 * S0 / (B3 + s * mu * B1))), "C-reversed"


def rod(mass: float = 1.3, length: float = 0.8) -> Any:
    """A rod above the ground, whose tip at the angle a is 0.5 length behind its centre."""
    m = eg.Model("rod", gravity=(0, -9.81, 0))
    b = m.body("rod", mass=mass, inertia={"zz": mass * length**2 / 12})
    m.planar("fly", m.ground, b)
    b.marker("tip", at=(-0.5 * length, 0, 0))
    m.output("gap", "y(rod.tip)")
    m.output("slide", "vx(rod.tip)")
    m.output("place", "x(rod.tip)")
    m.output("momentum", f"{mass!r}*vx(rod)")
    return m.compile(target="numpy")


def test_the_falling_rod_in_all_modes() -> None:
    """Tips, velocities and coefficients at random; each of the five modes happens often."""
    mod, rng, modes, m, I = rod(), np.random.default_rng(7), [], 1.3, 1.3 * 0.64 / 12
    for k in range(150):
        a, e, mu = rng.uniform(0.05, np.pi - 0.05), rng.random(), rng.uniform(0.01, 1.2)
        x, y = -0.4 * np.cos(a), -0.4 * np.sin(a)  # of the tip, from the centre
        v = rng.normal(size=3) - [0, 1.5, 0]
        if k % 2:  # slow sliding, which stops within the impact
            v[0], mu = y * v[2] + 0.3 * rng.normal(), 0.5 * mu
        rates = np.array([v[1] + x * v[2], v[0] - y * v[2]])
        if rates[0] > -0.05:
            continue
        W = np.array([[1 / m + x * x / I, -x * y / I], [-x * y / I, 1 / m + y * y / I]])
        (P_n, P_t), mode = wang_mason(W, rates, mu, e)
        modes.append(mode)
        state = mod.x0(fly_y=-y, fly_3=a, fly_x_dot=v[0], fly_y_dot=v[1], fly_3_dot=v[2])
        hit = mod.impact(0.0, state, {"gap": e}, friction={"gap": (mu, ("slide", "place")[k % 2])})
        np.testing.assert_allclose([hit["gap"], hit.friction["gap"][0]], [P_n, P_t], rtol=1e-9, atol=1e-12)
        after = v + np.array([P_t / m, P_n / m, (x * P_n - y * P_t) / I])
        np.testing.assert_allclose(hit.x[3:], after, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(hit.sliding_before["gap"], rates[1:], atol=1e-12)
        np.testing.assert_allclose(hit.sliding_after["gap"], rates[1] + W[1] @ [P_n, P_t], atol=1e-12)
        assert hit.energy_lost >= -1e-14
    assert len(modes) > 100
    assert all(modes.count(mode) >= 3 for mode in ("sliding", "C-sticking", "R-sticking", "C-reversed", "R-reversed"))


def ball() -> Any:
    """A solid ball of radius 0.1 on a floor, with two sliding velocities, turned by an angle."""
    m = eg.Model("ball", gravity=(0, 0, -9.81))
    b = m.body("ball", mass=0.5, inertia=(0.002, 0.002, 0.002))
    m.free("fly", m.ground, b)
    m.output("gap", "z(ball) - 0.1")
    m.output("sx", "vx(ball) - 0.1*wy(ball)")
    m.output("sy", "vy(ball) + 0.1*wx(ball)")
    m.parameter("a", 0.4)
    m.output("s1", "cos(a)*(vx(ball) - 0.1*wy(ball)) + sin(a)*(vy(ball) + 0.1*wx(ball))")
    m.output("s2", "-sin(a)*(vx(ball) - 0.1*wy(ball)) + cos(a)*(vy(ball) + 0.1*wx(ball))")
    return m.compile(target="numpy")


@pytest.mark.parametrize("mu", [0.05, 0.9])
def test_a_ball_in_space(mu: float) -> None:
    """Friction is opposite to the sliding of the lowest point, in whatever axes sliding is measured."""
    mod, rng = ball(), np.random.default_rng(5)
    for _ in range(4):
        v, w = rng.normal(size=3) - [0, 0, 2], 10 * rng.normal(size=3)
        x = mod.x0({"fly_z": 0.1, **dict(zip(mod.v_names, [*v, *w], strict=True))})
        slip = np.array([v[0] - 0.1 * w[1], v[1] + 0.1 * w[0]])
        P_n = -0.5 * 1.6 * v[2]
        P_t = -slip / np.linalg.norm(slip) * min(mu * P_n, np.linalg.norm(slip) * 0.5 * 2 / 7)
        for names, a in ((("sx", "sy"), 0.4), (("s1", "s2"), 0.4), (("s1", "s2"), -1.1)):
            hit = mod.impact(0.0, x, {"gap": 0.6}, friction={"gap": (mu, names)}, p={"a": a})
            turn = a * (names[0] == "s1")
            turned = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]) @ P_t
            np.testing.assert_allclose([hit["gap"], *hit.friction["gap"]], [P_n, *turned], rtol=1e-9, atol=1e-10)
            np.testing.assert_allclose(hit.x[mod.n_q : mod.n_q + 3], v + np.array([*P_t, P_n]) / 0.5, atol=1e-9)


def test_runs_by_gaps_and_by_events(tmp_path: Path) -> None:
    """A ball that bounces and begins to roll: events of the model and simulate_impacts against flights written out."""
    text = """
name: ball
gravity: [0, -9.81, 0]
bodies: {ball: {mass: 1, inertia: {zz: 0.004}}}
joints: {fly: {type: planar, between: [ground, ball]}}
outputs: {gap: y(ball) - 0.1, slide: vx(ball) + 0.1*fly_3_dot}
events:
  floor: {expression: y(ball) - 0.1, restitution: 0.8, friction: 0.1, slip: slide}
initial: {fly_y: 1.1, fly_x_dot: 1.0}
"""
    file = tmp_path / "ball.yaml"
    file.write_text(text, encoding="utf-8")
    mod = eg.load(file).compile(target="numpy")
    t, v, w, fall = np.sqrt(2 / 9.81), 1.0, 0.0, np.sqrt(2 * 9.81)
    times = []
    while t < 2.0:
        times.append(t)
        P = min(0.1 * 1.8 * fall, (v + 0.1 * w) / (1 + 0.01 / 0.004))
        v, w, fall = v - P, w - 0.1 * P / 0.004, 0.8 * fall
        t += 2 * fall / 9.81
    run = mod.simulate(2.0)
    np.testing.assert_allclose(run.t_events["floor"], times, rtol=1e-8)
    np.testing.assert_allclose([run["fly_x_dot"][-1], run["fly_3_dot"][-1]], [v, w], rtol=1e-9)
    assert abs(v + 0.1 * w) < 1e-9  # it rolls in the end
    again = mod.simulate_impacts(2.0, {"gap": 0.8}, friction={"gap": (0.1, "slide")})
    np.testing.assert_allclose(again.x[:, -1], run.x[:, -1], atol=1e-8)
    refuses("EG-NO-DERIVATIVE floor", mod.sensitivities, ["fly_x_dot"], 1.0)


@pytest.mark.parametrize("mu", [0.1, 1.0])
def test_a_point_of_a_closed_loop(mu: float) -> None:
    """A coupler point of a four-bar: of one freedom, so that sliding and closing stop together; the loop stays closed.

    What is lost is the work of the impulses on the mean velocities; where the point sticks it does not come back.
    """
    m = eg.Model("four_bar", gravity=(0, -9.81, 0))
    bars = {}
    for name, mass, length in (("a", 1.0, 0.5), ("b", 2.0, 1.2), ("c", 3.0, 0.9)):
        bars[name] = m.body(name, mass=mass, com=(0.5 * length, 0, 0), inertia={"zz": mass * length**2 / 12})
    m.revolute("A", m.ground, bars["a"], coordinate="q")
    m.revolute("B", bars["a"].at(0.5, 0, 0), bars["b"])
    m.revolute("D", m.ground.at(1, 0, 0), bars["c"])
    m.revolute("C", bars["b"].at(1.2, 0, 0), bars["c"].at(0.9, 0, 0))
    bars["b"].marker("tip", at=(0.7, 0.3, 0))
    m.output("gap", "y(b.tip)")
    m.output("slide", "vx(b.tip)")
    m.guess(B=-0.5, D=1.5)
    mod = m.compile(target="numpy")
    x = mod.x0(q=1.0, q_dot=-3.0)
    hit = mod.impact(0.0, x, {"gap": 0.5}, closed=True, friction={"gap": (mu, "slide")})
    C = mod.constraint_jacobian(x[: mod.n_q], rows="all")
    assert np.abs(C @ hit.x[mod.n_q :]).max() < 1e-12
    work = hit["gap"] * (hit.rates_before[0] + hit.rates_after[0])
    work += hit.friction["gap"][0] * (hit.sliding_before["gap"][0] + hit.sliding_after["gap"][0])
    assert hit.energy_lost == pytest.approx(-0.5 * work, rel=1e-10)
    assert hit.energy_lost > 0.0
    slope = hit.sliding_before["gap"][0] / hit.rates_before[0]
    assert hit.sliding_after["gap"][0] == pytest.approx(slope * hit.rates_after[0], abs=1e-10)
    if mu < abs(1 / slope):
        assert hit.rates_after[0] > 0.1
    else:
        np.testing.assert_allclose(hit.x[mod.n_q :], 0.0, atol=1e-12)


@cache
def point() -> Any:
    """A point of any inverse mass W (3, 3) of its gap x and the sliding y, z."""
    speeds, names = sympy.Matrix(sympy.symbols("x_dot y_dot z_dot")), sympy.symbols("m11 m12 m13 m22 m23 m33")
    a, b, c, d, e, f = names
    M = sympy.Matrix([[a, b, c], [b, d, e], [c, e, f]])
    start = dict(zip(names, (1.0, 0.0, 0.0, 1.0, 0.0, 1.0), strict=True))
    m = eg.Model.from_lagrangian("point", (speeds.T * M * speeds)[0] / 2, sympy.symbols("x y z"), parameters=start)
    return m.compile(target="numpy")


def strike_point(W: Any, y: Any, mu: float, e: float = 0.0) -> Any:
    """Impulses (P_n, P_y, P_z)."""
    p = dict(zip(point().p_names, np.linalg.inv(W)[np.triu_indices(3)], strict=True))
    hit = point().impact(0.0, np.concatenate([np.zeros(3), y]), {"x": e}, friction={"x": (mu, ("y", "z"))}, p=p)
    np.testing.assert_allclose(hit.x[3:], y + W @ [hit["x"], *hit.friction["x"]], atol=1e-9 * np.abs(y).max())
    return np.array([hit["x"], *hit.friction["x"]])


def holds(W: Any, y: Any, P: Any, mu: float) -> None:
    """Newton's law, here without restitution, and Coulomb's law for the velocities after."""
    after, size = y + W @ P, np.abs(P).max()
    assert abs(after[0]) <= 1e-8 * np.abs(y).max()
    assert P[0] > 0.0
    slip, pull = after[1:], P[1:]
    assert np.linalg.norm(pull) <= mu * P[0] * (1 + 1e-8) + 1e-9 * size
    if np.linalg.norm(slip) > 1e-6 * np.abs(y).max():
        np.testing.assert_allclose(pull, -mu * P[0] * slip / np.linalg.norm(slip), atol=1e-5 * size)


def test_a_point_in_space_always_has_impulses() -> None:
    """A positive definite inverse mass leaves no impact without a solution (Acary, Cadoux, Lemarechal, Malick 2011)."""
    rng, count = np.random.default_rng(8), 0
    for k in range(100):
        A = rng.normal(size=(3, 3)) * np.exp(rng.normal(size=(3, 1)))
        W, y, mu = A @ A.T, A @ rng.normal(size=3), float(rng.exponential())
        if k % 5 == 0:
            W[1:, 1:] = np.eye(2) * (W[1, 1] + W[2, 2])  # as round across as a ball
        if not y[0] < -1e-3:
            continue
        count += 1
        P = strike_point(W, y, mu)
        holds(W, y, P, mu)
        assert P @ (y + 0.5 * W @ P) <= 1e-9 * np.abs(P * y).max()
    assert count > 40


def thrown_on_a_table(slip: str) -> Any:
    """A body that falls on a table that moves by an input, seen as a place or as a velocity."""
    m = eg.Model("ball", gravity=(0, -9.81, 0))
    b = m.body("b", mass=1.0, inertia={"zz": 0.004})
    m.planar("j", m.ground, b)
    m.input("X"), m.input("V")
    m.output("place", "j_x - X")
    m.output("speed", "vx(b) - V")
    m.output("gap", "j_y - 0.1")
    m.event("floor", "j_y - 0.1", restitution=0.5, friction=0.1, slip=slip)
    m.initial(j_y=0.3)
    return m.compile(target="numpy")


@pytest.mark.parametrize(
    ("slip", "X"),
    [("place", "2*t"), ("place", ([0.0, 1.0], [0.0, 2.0])), ("place", lambda t, x: 2.0 * t), ("speed", "0")],
)
def test_events_and_runs_see_the_rate_of_a_table(slip: str, X: Any) -> None:
    """It slides all through the impact, so that it takes mu (1 + e) v_n of the table's speed."""
    mod, inputs = thrown_on_a_table(slip), {"X": X, "V": "2.0"}
    expected = 0.1 * 1.5 * np.sqrt(2 * 9.81 * 0.2)
    run = mod.simulate(0.3, inputs=inputs)
    again = mod.simulate_impacts(0.3, {"gap": 0.5}, friction={"gap": (0.1, slip)}, inputs=inputs)
    np.testing.assert_allclose([run["j_x_dot"][-1], again["j_x_dot"][-1]], expected, rtol=1e-8)


@pytest.mark.parametrize(
    ("slip", "unit", "upright", "speed"),
    [
        ("vx(b) - 2", "", False, -2.0),
        ("0*fly_y_dot - 2", "", True, -2.0),
        ("-V", "", True, -3.0),  # V is in m/s
        ("-W", "m/s", True, -4.0),
        ("-W", "", True, 0.0),  # a place, that of something at rest
        ("x(b) - 2*t", "", True, -2.0),
        ("sin(fly_x)*vx(b) - 2", "", False, -2.0),  # no velocity moves it where x is 0
    ],
)
def test_velocities_and_places_by_how_they_are_written(slip: str, unit: str, upright: bool, speed: float) -> None:
    m = eg.Model("belt")
    b = m.body("b", mass=1.0, inertia={"zz": 0.1})
    m.input("V", 3.0, unit="m/s"), m.input("W", 4.0)
    if upright:
        m.prismatic("fly", m.ground, b, axis="y", coordinate="fly_y")
    else:
        m.planar("fly", m.ground, b)
    m.output("slide", slip, unit=unit)
    m.output("belt", "vx(b)")
    m.output("gap", "y(b)")
    mod = m.compile(target="numpy")
    hit = mod.impact(0.5, mod.x0(fly_y_dot=-1.0), {"gap": 0.5}, friction={"gap": (0.4, "slide")})
    np.testing.assert_allclose(hit.sliding_before["gap"], [speed], atol=1e-9)
    np.testing.assert_allclose(hit.friction["gap"], [-np.sign(speed) * 0.4 * 1.5], atol=1e-9)


def thrown(gap: str, slide: str, way: str = "planar") -> eg.Model:
    """A body thrown along a floor at 0.5 m, on joints of several kinds."""
    m = eg.Model("thrown", gravity=(0, -10, 0))
    body = m.body("body", mass=1.0, inertia={"xx": 0.1, "yy": 0.1, "zz": 0.1})
    if way == "planar":
        m.planar("P", m.ground, body)
        names = {"y": "P_y", "v": "P_x_dot"}
    elif way == "free":
        m.free("P", m.ground, body)
        names = {"y": "P_y", "v": "P_x_dot"}
    elif way == "turned":
        m.planar("P", m.ground.at(0, 0, 0, rpy=(0, 0, 0.7)), body)
        names = {"y": "y(body)", "v": "vx(body)"}
    else:
        cart = m.body("cart", mass=1.0)
        m.prismatic("X", m.ground, cart, axis="x", coordinate="s")
        m.prismatic("Y", cart, body, axis="y", coordinate="h")
        names = {"y": "h", "v": "s_dot"}
    m.output("slide", slide.format(**names))
    m.event("hit", gap.format(**names), restitution=0.5, friction=0.1, slip="slide")
    start = {"turned": {"P_x": np.sin(0.7), "P_y": np.cos(0.7), "P_x_dot": np.cos(0.7), "P_y_dot": -np.sin(0.7)}}
    m.initial(start.get(way, {names["y"]: 1.0, names["v"]: 1.0}))
    return m


REFUSED = [("planar", 2.0), ("turned", 10.0), ("chain", 2.0), ("free", 0.5)]


@pytest.mark.parametrize(("way", "factor"), REFUSED)
def test_a_gap_at_another_scale_is_refused(way: str, factor: float) -> None:
    module = thrown(f"{factor}*({{y}} - 0.5)", "{v}", way).compile(target="numpy")
    refuses(f"EG-UNSUPPORTED hit {factor:g}", module.simulate, 0.4)


def test_what_friction_refuses() -> None:
    m = eg.Model("r")
    b = m.body("b", mass=1.0, inertia={"zz": 0.1})
    m.planar("fly", m.ground, b)
    m.output("gap", "y(b)")
    m.output("slide", "vx(b)")
    m.output("sized", "abs(vx(b))")
    m.output("fast", "vx(b)", unit="km/h")
    mod = m.compile(target="numpy")
    x = mod.x0(fly_y_dot=-1.0, fly_x_dot=0.5)

    def strike(friction: Any, **others: Any) -> Any:
        return mod.impact(0.0, x, {"gap": 0.5}, friction=friction, **others)

    for friction, message in (
        ({"wall": (0.3, "slide")}, "EG-NAME-UNKNOWN wall"),
        ({"gap": 0.3}, "EG-TYPE slide 0.3"),
        ({"gap": (-0.3, "slide")}, "EG-RANGE 0 -0.3"),
        ({"gap": (0.3, "slid")}, "EG-NAME-UNKNOWN slid"),
        ({"gap": (0.3, ("slide", "slide", "slide"))}, "EG-TYPE sliding"),
        ({"gap": (0.3, "sized")}, "EG-REFERENCE sized sliding"),
        ({"gap": (0.3, "fast")}, "EG-UNIT fast"),
    ):
        refuses(message, strike, friction)
    refuses("EG-CONFLICT friction= lock=", strike, {"gap": (0.3, "slide")}, lock=["fly_x"])
