"""Impacts with friction: published closed forms, Routh's process integrated here, momentum and energy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eomgen as eg
from eomgen.analysis.impact_friction import strike_rough


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
    for k in range(400):
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
    assert len(modes) > 300
    assert all(modes.count(mode) >= 10 for mode in ("sliding", "C-sticking", "R-sticking", "C-reversed", "R-reversed"))


def by_steps(W: Any, y: Any, mu: float, e: float, count: int = 4000) -> Any:
    """Impulses by Routh's process in small steps of the normal impulse, friction kept within its bounds."""
    y, P_n, P_t, end, step = np.array(y), 0.0, 0.0, np.inf, 2.0 * abs(y[0]) / W[0, 0] / count
    while P_n < end:
        step = min(step, end - P_n)
        pull = np.clip(-(y[1] + W[1, 0] * step) / W[1, 1], -mu * step, mu * step)
        y = y + W @ [step, pull]
        P_n, P_t = P_n + step, P_t + pull
        if end == np.inf and y[0] >= 0.0:
            end = (1.0 + e) * P_n
    return np.array([P_n, P_t])


def test_the_process_in_small_steps() -> None:
    """Of any inverse mass, jamming in compression too, where the gap closes faster before it slows down."""
    rng, jams = np.random.default_rng(11), 0
    for _ in range(40):
        A = rng.normal(size=(2, 2))
        W, y = A @ A.T + 0.05 * np.eye(2), rng.normal(size=2)
        y[0], mu, e = -abs(y[0]), 2.0 * rng.random(), rng.random()
        jams += W[0, 0] - np.sign(y[1]) * mu * W[0, 1] < 0.0
        found = strike_rough(W, y, np.array([e]), np.full(2, 1e-15), np.array([mu]), np.array([0]), ("gap",))
        np.testing.assert_allclose(found, by_steps(W, y, mu, e), atol=1e-2 * np.abs(found).max())
    assert jams > 2


def test_a_double_pendulum_gains_no_energy() -> None:
    """Two rods that strike the ground (Kane and Levinson, Dynamics, 1985, sec. 5.8): by Newton's law they gain some."""
    l, m1 = 1.0, 1.0
    m = eg.Model("kane", gravity=(0, 0, 0))
    a, b = (m.body(name, mass=m1, com=(0.5, 0, 0), inertia={"zz": m1 * l * l / 12}) for name in "ab")
    m.revolute("A", m.ground, a, coordinate="p")
    m.revolute("B", a.at(1, 0, 0), b, coordinate="r")
    b.marker("tip", at=(1, 0, 0))
    m.output("slide", "vx(b.tip)")
    depth = float(np.cos(np.deg2rad(20)) + np.cos(np.deg2rad(30)))
    m.output("gap", f"y(b.tip) + {depth!r}")
    mod, gained = m.compile(target="numpy"), 0
    p, r = np.deg2rad(20) - np.pi / 2, np.deg2rad(10)
    M = mod.mass_matrix([p, r])
    q1, q2 = np.deg2rad(20), np.deg2rad(30)
    J = np.array([[np.sin(q1) + np.sin(q2), np.sin(q2)], [np.cos(q1) + np.cos(q2), np.cos(q2)]])  # gap, slide
    W = J @ np.linalg.solve(M, J.T)
    for u1, u2 in [(-0.1, -0.2), (-0.2, 0.1), (0.1, -0.4), (-0.3, 0.25)]:
        v = np.array([u1, u2 - u1])
        y = J @ v
        if y[0] >= 0.0:
            continue
        for mu in (0.3, 0.5, 0.8):
            for e in (0.5, 0.7, 1.0):
                # Newton's law as in their book: no sliding after it if friction suffices, else friction at its bound
                P = np.linalg.solve(W, [-(1 + e) * y[0], -y[1]])
                if abs(P[1]) > mu * P[0]:
                    pull = -mu * np.sign(y[1])
                    P = -(1 + e) * y[0] / (W[0] @ [1, pull]) * np.array([1, pull])
                gained += P @ (y + 0.5 * W @ P) > 1e-6
                hit = mod.impact(0.0, [p, r, *v], {"gap": e}, closed=True, friction={"gap": (mu, "slide")})
                assert hit.energy_lost > 0.0
                g = np.array([hit["gap"], hit.friction["gap"][0]])
                np.testing.assert_allclose(M @ (hit.x[2:] - v), J.T @ g, atol=1e-13)
                assert abs(g[1]) <= mu * g[0] * (1 + 1e-12)
                np.testing.assert_allclose(g, by_steps(W, y, mu, e), atol=1e-2 * np.abs(g).max())
    assert gained > 2


def ball(space: bool) -> Any:
    """A solid ball of radius 0.1 on a floor; in space with two sliding velocities, turned by an angle."""
    m = eg.Model("ball", gravity=(0, 0, -9.81))
    b = m.body("ball", mass=0.5, inertia=(0.002, 0.002, 0.002))
    m.free("fly", m.ground, b) if space else m.planar("fly", m.ground.at(0, 0, 0, rpy=(np.pi / 2, 0, 0)), b)
    m.output("gap", "z(ball) - 0.1")
    m.output("sx", "vx(ball) - 0.1*wy(ball)")
    m.output("sy", "vy(ball) + 0.1*wx(ball)")
    a = m.parameter("a", 0.4)
    m.output("s1", "cos(a)*(vx(ball) - 0.1*wy(ball)) + sin(a)*(vy(ball) + 0.1*wx(ball))")
    m.output("s2", "-sin(a)*(vx(ball) - 0.1*wy(ball)) + cos(a)*(vy(ball) + 0.1*wx(ball))")
    assert a is not None
    return m.compile(target="numpy")


@pytest.mark.parametrize("mu", [0.05, 0.2, 0.9])
def test_a_ball_with_spin(mu: float) -> None:
    """It slides all along the bounce, or rolls: v_x = (5 v + 2 r w) / 7 (H. Brody, Phys. Teacher 22 (1984), 494)."""
    mod, v, w, e = ball(False), np.array([1.5, -2.0]), -9.0, 0.7
    names = dict(zip(mod.v_names, range(3), strict=True))
    slip = v[0] - 0.1 * w  # the ball turns about y; planar axes are x, z, -y
    x = mod.x0(fly_y=0.1, fly_x_dot=v[0], fly_y_dot=v[1], fly_3_dot=-w)
    hit = mod.impact(0.0, x, {"gap": e}, friction={"gap": (mu, "sx")})
    P_n = 0.5 * (1 + e) * 2.0
    P_t = -min(mu * P_n, slip * 0.5 * 2 / 7)
    np.testing.assert_allclose([hit["gap"], *hit.friction["gap"]], [P_n, P_t], rtol=1e-12)
    after = hit.x[mod.n_q :]
    np.testing.assert_allclose(after[names["fly_x_dot"]], v[0] + P_t / 0.5, rtol=1e-12)
    np.testing.assert_allclose(-after[names["fly_3_dot"]], w - 0.1 * P_t / 0.002, rtol=1e-12)
    if mu == 0.9:
        np.testing.assert_allclose(after[names["fly_x_dot"]], (5 * v[0] + 2 * 0.1 * w) / 7, rtol=1e-12)


@pytest.mark.parametrize("mu", [0.05, 0.9])
def test_a_ball_in_space(mu: float) -> None:
    """Friction is opposite to the sliding of the lowest point, in whatever axes sliding is measured."""
    mod, rng = ball(True), np.random.default_rng(5)
    for _ in range(10):
        v, w = rng.normal(size=3) - [0, 0, 2], 10 * rng.normal(size=3)
        x = mod.x0(
            fly_z=0.1, fly_x_dot=v[0], fly_y_dot=v[1], fly_z_dot=v[2], **dict(zip(mod.v_names[3:], w, strict=True))
        )
        slip = np.array([v[0] - 0.1 * w[1], v[1] + 0.1 * w[0]])
        P_n = -0.5 * 1.6 * v[2]
        P_t = -slip / np.linalg.norm(slip) * min(mu * P_n, np.linalg.norm(slip) * 0.5 * 2 / 7)
        for names, a in ((("sx", "sy"), 0.4), (("s1", "s2"), 0.4), (("s1", "s2"), -1.1)):
            hit = mod.impact(0.0, x, {"gap": 0.6}, friction={"gap": (mu, names)}, p={"a": a})
            turn = a * (names[0] == "s1")
            turned = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]) @ P_t
            np.testing.assert_allclose([hit["gap"], *hit.friction["gap"]], [P_n, *turned], rtol=1e-9, atol=1e-10)
            np.testing.assert_allclose(hit.x[mod.n_q : mod.n_q + 3], v + np.array([*P_t, P_n]) / 0.5, atol=1e-9)


def box(width: float = 0.4, height: float = 0.2) -> Any:
    """A box of 2 kg with its two lower corners."""
    m = eg.Model("box", gravity=(0, -9.81, 0))
    b = m.body("box", mass=2.0, inertia={"zz": 2.0 * (width**2 + height**2) / 12})
    m.planar("fly", m.ground, b)
    for name, x in (("l", -width / 2), ("r", width / 2)):
        b.marker(name, at=(x, -height / 2, 0))
        m.output(f"gap_{name}", f"y(box.{name})")
        m.output(f"slide_{name}", f"vx(box.{name})")
    return m.compile(target="numpy")


def test_a_box_that_falls_flat() -> None:
    """It does not tip while mu height < width: both corners push, and friction takes mu v_n of the speed, or all."""
    mod, gaps = box(), {"gap_l": 0.0, "gap_r": 0.0}
    for mu, vx in ((0.3, 2.0), (0.3, -2.0), (0.3, 0.4), (0.9, 0.6)):
        friction = {"gap_l": (mu, "slide_l"), "gap_r": (mu, "slide_r")}
        hit = mod.impact(0.0, mod.x0(fly_y=0.1, fly_x_dot=vx, fly_y_dot=-1.5), gaps, friction=friction)
        left = np.sign(vx) * max(abs(vx) - mu * 1.5, 0.0)
        np.testing.assert_allclose(hit.x[3:], [left, 0.0, 0.0], atol=1e-10)
        np.testing.assert_allclose(hit["gap_l"] + hit["gap_r"], 3.0, rtol=1e-10)
        if left:
            lean = np.array([hit["gap_r"] - hit["gap_l"], sum(hit.friction[g][0] for g in gaps)])
            np.testing.assert_allclose(lean[0] * 0.2, -lean[1] * 0.1, atol=1e-10)  # moments about the centre


def test_gaps_far_from_each_other_do_not_change_each_other() -> None:
    """Two rods of one model that strike at once do what each does alone."""
    m = eg.Model("two")
    for k in (1, 2):
        b = m.body(f"rod{k}", mass=1.0, inertia={"zz": 0.1})
        m.planar(f"fly{k}", m.ground, b)
        b.marker("tip", at=(-0.5, 0, 0))
        m.output(f"gap{k}", f"y(rod{k}.tip)")
        m.output(f"slide{k}", f"vx(rod{k}.tip)")
    mod = m.compile(target="numpy")
    place = {f"fly{k}_{c}": x for k in (1, 2) for c, x in (("3", 0.6), ("y", 0.5 * np.sin(0.6)))}
    x = mod.x0(**place, fly1_y_dot=-1, fly1_x_dot=0.3, fly2_y_dot=-2, fly2_3_dot=0.4)
    friction = {f"gap{k}": (0.4, f"slide{k}") for k in (1, 2)}
    both = mod.impact(0.0, x, {"gap1": 0.5, "gap2": 0.2}, friction=friction)
    for k, e in ((1, 0.5), (2, 0.2)):
        alone = mod.impact(0.0, x, {f"gap{k}": e}, friction={f"gap{k}": (0.4, f"slide{k}")})
        np.testing.assert_allclose(alone[f"gap{k}"], both[f"gap{k}"], rtol=1e-12)
        np.testing.assert_allclose(alone.friction[f"gap{k}"], both.friction[f"gap{k}"], rtol=1e-12)


def test_without_friction_the_law_is_newtons() -> None:
    """A coefficient of 0 gives what no friction gives; where nothing stops sliding, Poisson's law is Newton's too."""
    mod = rod()
    x = mod.x0(fly_y=0.4 * np.sin(0.7), fly_3=0.7, fly_y_dot=-1.0, fly_x_dot=3.0)
    plain, smooth = mod.impact(0.0, x, {"gap": 0.6}), mod.impact(0.0, x, {"gap": 0.6}, friction={"gap": (0, "slide")})
    np.testing.assert_allclose(plain.x, smooth.x, rtol=1e-13)
    hit = mod.impact(0.0, x, {"gap": 0.6}, friction={"gap": (0.2, "slide")})
    np.testing.assert_allclose(hit.rates_after, -0.6 * hit.rates_before, rtol=1e-12)
    flat = box()
    x = flat.x0(fly_y=0.1, fly_y_dot=-1.0, fly_x_dot=0.5, fly_3_dot=0.3)
    gaps = {"gap_l": 0.0, "gap_r": 0.0}
    friction = {"gap_l": (0, "slide_l"), "gap_r": (0, "slide_r")}
    np.testing.assert_allclose(flat.impact(0.0, x, gaps, friction=friction).x, flat.impact(0.0, x, gaps).x, atol=1e-11)


def test_energy_never_grows_and_the_laws_hold() -> None:
    """A thousand impacts at random in the plane, two hundred of several contacts in space, any restitution."""
    rng = np.random.default_rng(3)
    for k in range(1000):
        A = rng.normal(size=(2, 1 + k % 3))
        W, y, mu = A @ A.T, A @ rng.normal(size=1 + k % 3), rng.exponential()
        if not y[0] < -1e-3:
            continue
        e = np.array([1.0 if k % 2 else rng.random()])
        P = strike_rough(W, y, e, np.full(2, 1e-14), np.array([mu]), np.array([0]), ("g",))
        assert P @ (y + 0.5 * W @ P) <= 1e-12 * np.abs(P * y).max()
        assert P[0] > 0.0
        assert abs(P[1]) <= mu * P[0] * (1 + 1e-12)
        assert (y + W @ P)[0] >= -1e-12 * np.abs(y).max()
    for _ in range(200):
        m = int(rng.integers(1, 4))
        A, owner = rng.normal(size=(3 * m, 6)), np.repeat(np.arange(m), 2)
        W, y, mu, e = A @ A.T, A @ rng.normal(size=6), rng.exponential(size=m), rng.random(m)
        P = strike_rough(W, y, e, np.full(3 * m, 1e-14), mu, owner, tuple("abc"[:m]))
        after, size = y + W @ P, np.abs(P).max() + 1e-300
        assert P @ (y + after) <= 1e-8 * size
        assert (P[:m] >= -1e-14 * size).all()
        assert (after[:m] >= -1e-8 * np.abs(y).max()).all() or not (y[:m] < 0.0).any()
        for i in range(m):
            t, slip = P[m:][owner == i], after[m:][owner == i]
            assert np.linalg.norm(t) <= mu[i] * P[i] + 1e-9 * size
            if P[i] > 1e-6 * size and np.linalg.norm(slip) > 1e-6:  # on the edge, opposite to sliding
                np.testing.assert_allclose(t, -mu[i] * P[i] * slip / np.linalg.norm(slip), atol=1e-5 * size)


def test_a_belt_that_drives_the_ground() -> None:
    """Sliding against a belt of speed 2: friction pulls a ball that falls straight down along with it."""
    m = eg.Model("belt")
    b = m.body("b", mass=1.0, inertia={"zz": 0.1})
    m.planar("fly", m.ground, b)
    m.output("gap", "y(b)")
    m.output("slide", "vx(b) - 2*(1 + t)")
    mod = m.compile(target="numpy")
    hit = mod.impact(0.5, mod.x0(fly_y_dot=-1.0), {"gap": 0.5}, friction={"gap": (0.4, "slide")})
    np.testing.assert_allclose(hit.x[3:5], [0.4 * 1.5, 0.5], atol=1e-14)
    np.testing.assert_allclose(hit.sliding_before["gap"], [-3.0])


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
    with pytest.raises(eg.NoDerivativeError, match="floor is an impact with friction, whose derivative"):
        mod.sensitivities(["fly_x_dot"], 1.0)


def test_what_is_refused() -> None:
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
        ({"wall": (0.3, "slide")}, "'wall' is no gap of this call"),
        ({"gap": 0.3}, r"give the coefficient and the output that is its sliding velocity, \(0.3, 'slide'\)"),
        ({"gap": (-0.3, "slide")}, "must be 0 or greater, not -0.3"),
        ({"gap": (0.3, "slid")}, "no coordinate or output 'slid' for the sliding of gap"),
        ({"gap": (0.3, ("slide", "slide", "slide"))}, "one sliding velocity, or two at right angles"),
        ({"gap": (0.3, "sized")}, "output sized cannot be the sliding velocity of gap: it must be linear"),
        ({"gap": (0.3, "fast")}, "the output fast is in km/h"),
        ([0.3], "friction must be a mapping"),
    ):
        with pytest.raises(eg.UsageError, match=message):
            strike(friction)
    with pytest.raises(eg.UsageError, match="friction= or lock=, not both"):
        strike({"gap": (0.3, "slide")}, lock=["fly_x"])


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
    works = [
        hit["gap"] * (hit.rates_before[0] + hit.rates_after[0]),
        hit.friction["gap"][0] * (hit.sliding_before["gap"][0] + hit.sliding_after["gap"][0]),
    ]
    assert hit.energy_lost == pytest.approx(-0.5 * sum(works), rel=1e-10)
    assert hit.energy_lost > 0.0
    slope = hit.sliding_before["gap"][0] / hit.rates_before[0]
    assert hit.sliding_after["gap"][0] == pytest.approx(slope * hit.rates_after[0], abs=1e-10)
    if mu < abs(1 / slope):
        assert hit.rates_after[0] > 0.1
    else:
        np.testing.assert_allclose(hit.x[mod.n_q :], 0.0, atol=1e-12)


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ({"friction": 0.3, "restitution": 0.5}, "friction: is given without slip; give slip: the output"),
        ({"slip": "slide", "restitution": 0.5}, "slip: is given without friction; give friction: the coefficient"),
        ({"slip": "slide", "friction": -1, "restitution": 0.5}, "friction: -1 is negative; give 0 or more"),
        ({"slip": "slde", "friction": 0.3, "restitution": 0.5}, "slip: no output 'slde' .* did you mean 'slide'"),
        ({"slip": "slide", "friction": 0.3}, "friction: is given without a restitution"),
        ({"slip": "fast", "friction": 0.3, "restitution": 0.5}, "slip: the output 'fast' is in km/h"),
        ({"slip": [], "friction": 0.3, "restitution": 0.5}, "slip: .* is not a list of names, or one name"),
    ],
)
def test_what_events_refuse(keys: dict[str, Any], told: str) -> None:
    m = eg.Model("r")
    b = m.body("b", mass=1.0, inertia={"zz": 0.1})
    m.planar("fly", m.ground, b)
    m.output("slide", "vx(b)")
    m.output("fast", "vx(b)", unit="km/h")
    m.event("floor", "y(b)", **keys)
    with pytest.raises(eg.ModelError, match=f"events.floor.{told}"):
        m.check()
