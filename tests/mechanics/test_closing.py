"""Constraints and joints that close and open: momenta, a published walker, impacts solved with NumPy, derivatives."""

from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
from refusals import refuses
from sweeps import TARGETS

import eomgen as eg

# -- Constraints -------------------------------------------------------------------------------------------------------
G = 9.81


def carts(**keys: object) -> eg.Model:
    """A cart runs into another, which hangs on a spring, and is latched."""
    m = eg.Model("carts")
    k = m.parameter("k", 10.0)
    a, b = m.body("a", mass=2.0), m.body("b", mass=3.0)
    m.prismatic("x1", m.ground, a, axis="x")
    m.prismatic("x2", m.ground, b, axis="x")
    m.joint_spring("spring", "x2", stiffness=k)
    latch = m.coupling("latch", {"x1": 1, "x2": -1}, closes="x2 - x1", **keys)
    m.output("F", latch.multiplier())
    m.initial(x1=-1, x1_dot=1.5)
    return m


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("method", ["DOP853", "RK45", "Radau", "LSODA"])
def test_two_carts_latch(method: str, target: str) -> None:
    """m1 v = (m1 + m2) v+, then they swing with sqrt(k / (m1 + m2)); the latch pulls with m1 x''."""
    mod = carts().compile(target=target)
    run = mod.simulate(3.0, method=method)
    hit, speed, w = 1.0 / 1.5, 2.0 * 1.5 / 5.0, np.sqrt(10.0 / 5.0)
    assert run.t_events["latch_closes"] == pytest.approx([hit], rel=1e-9)
    assert run["latch_closed"][[0, -1]] == pytest.approx([0.0, 1.0])
    late = run.t > hit + 1e-9
    assert run["x1_dot"][late] == pytest.approx(speed * np.cos(w * (run.t[late] - hit)), abs=1e-6)
    assert np.abs(run["x1"] - run["x2"])[late].max() < 1e-8
    force = mod.outputs(run.t, run.x)[0][late]
    assert force == pytest.approx(2.0 * speed * w * np.sin(w * (run.t[late] - hit)), abs=1e-5)


def test_a_closed_constraint_beside_a_drive_on_a_cut_joint_is_that_which_never_opens() -> None:
    """The armature of the joint that the loop is cut at couples the branches that meet there."""

    def build(**switch: Any) -> Any:
        m = eg.Model("five_bar", gravity=(0, -G, 0))
        a, b, c, d = (m.body(n, mass=1.0 + i, com=(0.2, 0, 0), inertia={"zz": 0.02}) for i, n in enumerate("abcd"))
        m.revolute("A", m.ground, a, coordinate="qA")
        m.revolute("B", a.at(0.4, 0, 0), b, coordinate="qB")
        m.revolute("C", b.at(0.5, 0, 0), c.at(0.5, 0, 0), armature=0.3)
        m.revolute("D", d.at(0.4, 0, 0), c, coordinate="qD")
        m.revolute("E", m.ground.at(0.6, 0, 0), d, coordinate="qE")
        m.coupling("tie", equation="qA_dot + 0.5*qE_dot", **switch)
        m.initial(qA=2.0, qE=1.1)
        m.guess(qB=-1.2, qD=1.2)
        return m.compile(target="numpy")

    lasting, switched = build(), build(closes="1 - t", opens="2 - t", closed=True)
    assert switched.loop_names == ("C",)
    expected = lasting.rhs(0.0, lasting.x0())
    np.testing.assert_allclose(switched.rhs(0.0, switched.x0())[:-1], expected, atol=1e-10)


def test_latch_on_a_closed_loop_against_the_impact_of_numpy() -> None:
    """v+ = v - M^-1 J^T (J M^-1 J^T)^-1 J v with J of the loop and of the latch."""
    m = eg.Model("bars", gravity=(0, -G, 0))
    crank = m.body("crank", mass=1.0, inertia={"zz": 0.01}, com=(0.05, 0, 0))
    rod = m.body("rod", mass=0.8, inertia={"zz": 0.02}, com=(0.15, 0, 0), markers={"end": (0.2, 0.05, 0)})
    piston, block = m.body("piston", mass=0.5, inertia={"zz": 0.001}), m.body("block", mass=0.7)
    models.join_slider_crank(m, (crank, rod, piston), 0.1, 0.3, "theta - s", guide="S")
    m.prismatic("L", m.ground, block, axis="y", coordinate="h")
    m.coupling("grip", equation="y(rod.end) - h", closes="y(rod.end) - h")
    m.guess(s=0.35)
    m.initial(theta=0.8, theta_dot=-9.0, h=0.06, h_dot=0.3)
    mod = m.compile(target="numpy")
    run = mod.simulate(0.08)
    time = run.t_events["grip_closes"][0]
    i, j = np.flatnonzero(np.abs(run.t - time) < 1e-12)[[0, -1]]
    before, after, n, nv = run.x[:, i], run.x[:, j], mod.n_q, 4
    q = before[:n]
    M, C = mod.mass_matrix(q)[:nv, :nv], mod.constraint_jacobian(q)[:, :nv]
    step = np.zeros((1, nv))
    for k in range(nv):  # of y(rod.end) - h by the coordinates of the tree
        h = np.zeros(n)
        h[k] = 1e-6
        up, down = mod.poses(q + h), mod.poses(q - h)
        level = [(p[1] @ np.array([0.2, 0.05, 0, 1]))[1] - p[3][1, 3] for p in (up, down)]
        step[0, k] = (level[0] - level[1]) / 2e-6
    J, v = np.vstack([C, step]), before[n : n + nv]
    Y = np.linalg.solve(M, J.T)
    expected = v - Y @ np.linalg.solve(J @ Y, J @ v)
    assert after[n : n + nv] == pytest.approx(expected, rel=1e-6)
    assert abs(step[0] @ v) > 0.1


@pytest.mark.parametrize("target", TARGETS)
def test_grasp_in_space_keeps_momenta(target: str) -> None:
    """A free body takes another that flies by; both turn together after it, and what they carry is unchanged."""
    m = eg.Model("grasp")
    hand = m.body("hand", mass=3.0, com=(0.1, 0, 0.05), inertia=(0.2, 0.3, 0.25))
    ball = m.body("ball", mass=1.0, inertia=(0.02, 0.03, 0.04))
    m.free("f", m.ground, hand, rotation="euler_parameters")
    m.free("g", m.ground, ball, rotation="euler_parameters")
    m.hold("grip", hand.marker("palm", at=(0.3, 0.1, 0), rpy=(0.2, 0.4, 0.1)), ball, turning="xyz", closes="0.5 - t")
    for axis in "xyz":
        m.output(f"p{axis}", f"momentum_{axis}")
        m.output(f"L{axis}", f"angular_momentum_{axis}(ground)")
    m.initial(f_wx=0.3, f_wy=-0.5, f_wz=0.8, g_x=1.0, g_y=0.3, g_x_dot=-0.6, g_wy=1.0)
    mod = m.compile(target=target)
    run = mod.simulate(2.0, rtol=1e-10, atol=1e-12)
    y = mod.outputs(run.t, run.x)
    assert np.abs(y - y[:, :1]).max() < 1e-7
    last = np.asarray([mod.poses(run.x[: mod.n_q, k]) for k in np.flatnonzero(run.t > 0.5)[[1, -1]]])
    seen = [np.linalg.solve(pair[0], pair[1]) for pair in last]
    assert seen[0] == pytest.approx(seen[1], abs=1e-7)


def test_closing_by_ida() -> None:
    """The same latch as by the steppers: a plastic impact, then both swing together."""
    mod = carts().compile(target="numpy")
    run = mod.dae.solve(3.0, rtol=1e-9, atol=1e-11)
    hit, speed, w = 1.0 / 1.5, 2.0 * 1.5 / 5.0, np.sqrt(10.0 / 5.0)
    assert run.t_events["latch_closes"] == pytest.approx([hit], rel=1e-8)
    assert run["x1"][-1] == pytest.approx(speed / w * np.sin(w * (3.0 - hit)), abs=1e-6)


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ({"closes": "x2 - x3"}, "EG-NAME-UNKNOWN constraints.latch.closes x3"),
        ({"closes": "x1_ddot"}, "EG-REFERENCE constraints.latch.closes x1_ddot"),
        ({"closes": "x1", "releases": ["lach"]}, "EG-NAME-UNKNOWN constraints.latch.releases[0] lach"),
        ({"closes": "t > 1"}, "EG-EXPRESSION constraints.latch.closes 1"),
        ({"closes": "2*size - 1"}, "EG-EXPRESSION constraints.latch.closes"),
        ({"closes": "x1", "stabilisation": "size - 2"}, "EG-RANGE constraints.latch.stabilisation 0"),
    ],
)
def test_what_is_wrong_is_reported(keys: dict[str, object], told: str) -> None:
    m = eg.Model("carts")
    m.parameter("size", 2.0)
    for name in ("x1", "x2"):
        m.prismatic(name, m.ground, m.body(f"b_{name}", mass=2.0), axis="x")
    m.coupling("latch", {"x1": 1, "x2": -1}, **keys)
    refuses(told, m.check)


# -- Joints ------------------------------------------------------------------------------------------------------------
J1, J2, W1, W2 = 0.3, 0.5, 4.0, -1.0


def discs(how: str, **keys: Any) -> eg.Model:
    """Two discs on one axis, which a clutch joins at t = 1."""
    m = eg.Model("discs")
    a, b = m.body("a", mass=1, inertia={"zz": J1}), m.body("b", mass=1, inertia={"zz": J2})
    m.revolute("A", m.ground, a)
    if how == "on the joint":
        m.revolute("S", a, b, closes="1 - t", **keys)
    elif how == "of the joint":
        m.revolute("S", a, b)
        m.lock("clutch", "S", closes="1 - t", **keys)
    else:
        m.revolute("B", m.ground, b)
        m.coupling("clutch", equation="A_dot - B_dot", closes="1 - t", **keys)
    m.initial(A_dot=W1, **({"B_dot": W2} if how == "of a coupling" else {"S_dot": W2 - W1}))
    return m


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("how", ["on the joint", "of the joint", "of a coupling"])
def test_a_clutch_keeps_angular_momentum(how: str, target: str) -> None:
    """omega = (J1 w1 + J2 w2) / (J1 + J2); lost is J1 J2 (w1 - w2)^2 / 2 (J1 + J2)."""
    mod = discs(how).compile(target=target)
    run = mod.simulate(2.0)
    speed = (J1 * W1 + J2 * W2) / (J1 + J2)
    other = run["A_dot"][-1] if how == "of a coupling" else run["A_dot"][-1] + run["S_dot"][-1]
    assert run["A_dot"][-1] == pytest.approx(speed, rel=1e-12)
    assert other == pytest.approx(speed, rel=1e-12)
    lost = np.sum(mod.energy(run.x[:, 0])) - np.sum(mod.energy(run.x[:, -1]))
    assert lost == pytest.approx(0.5 * J1 * J2 / (J1 + J2) * (W1 - W2) ** 2, rel=1e-12)


def test_a_lock_carries_what_the_shaft_needs_and_lets_go_where_it_is_commanded() -> None:
    """A motor drives both discs; the clutch carries J2 / (J1 + J2) of its torque 4 t, and lets go at 5 N m."""
    m = discs("of the joint", opens="5 - abs(carried)")
    m.torque("motor", "A", "4*t")
    m.output("carried", "multiplier(clutch)")
    mod = m.compile(target="numpy")
    run = mod.simulate(3.0)
    end = 5.0 * (J1 + J2) / J2 / 4.0
    assert run.t_events["clutch_opens"] == pytest.approx([end], rel=1e-9)
    carried = np.array([mod.outputs(t, x)[0] for t, x in zip(run.t, run.x.T, strict=True)])
    held = (run.t > 1.0 + 1e-9) & (run.t < run.t_events["clutch_opens"][0])
    assert np.abs(carried[held]) == pytest.approx(J2 / (J1 + J2) * 4.0 * run.t[held], rel=1e-9)
    assert np.abs(carried[run.t > run.t_events["clutch_opens"][0]]).max() == 0.0
    at, speed = run.t[held], run["A_dot"][held]
    assert speed == pytest.approx((J1 * W1 + J2 * W2 + 2.0 * at**2) / (J1 + J2), rel=1e-8)
    last = (J1 * W1 + J2 * W2 + 2.0 * end**2) / (J1 + J2) + 2.0 * (9.0 - end**2) / J1
    assert run["A_dot"][-1] == pytest.approx(last, rel=1e-8)


@pytest.mark.parametrize("target", TARGETS)
def test_a_ballistic_pendulum(target: str) -> None:
    """A weld that closes: (M l^2 + m l^2 + J) omega = m v l, from which the height follows by energy."""
    M, small, l, v, J = 2.0, 0.02, 0.8, 100.0, 1e-5
    m = eg.Model("ballistic", gravity=(0, -9.81, 0))
    block = m.body("block", mass=M, com=(0, -l, 0))
    bullet = m.body("bullet", mass=small, inertia={"zz": J})
    m.revolute("pin", m.ground, block)
    m.planar("fly", m.ground, bullet)
    m.weld("stick", block, bullet, closes="-x(bullet)")
    way = 0.5
    drop = 9.81 * (way / v) ** 2 / 2
    m.initial(fly_x=-way, fly_y=-l + drop, fly_x_dot=v)
    mod = m.compile(target=target)
    run = mod.simulate(1.0)
    hit = run.t_events["stick_closes"][0]
    assert hit == pytest.approx(way / v, rel=1e-9)
    after = run["pin_dot"][np.abs(run.t - hit) < 1e-12][-1]
    omega = small * v * l / ((M + small) * l * l + J)
    assert abs(after) == pytest.approx(omega, rel=1e-6)
    top = np.arccos(1.0 - omega**2 * ((M + small) * l * l + J) / (2.0 * 9.81 * (M + small) * l))
    swing = mod.simulate(1.0, t_eval=np.linspace(0.0, 1.0, 2001))
    assert np.abs(swing["pin"]).max() == pytest.approx(top, rel=1e-5)
    assert run["fly_3"][-1] == pytest.approx(run["pin"][-1], abs=1e-9)


def latched() -> eg.Model:
    """A door that a spring shuts; it falls into its latch at phi = 0, and is let go at t = 2."""
    m = eg.Model("door")
    door = m.body("door", mass=20.0, inertia={"zz": 2.0}, com=(0.4, 0, 0))
    m.revolute("hinge", m.ground, door, coordinate="phi", closes="phi", opens="2 - t")
    m.joint_spring("closer", "phi", stiffness=4.0, rest=-0.5)
    m.output("held", "multiplier(hinge)")
    m.initial(phi=0.6)
    return m


@pytest.mark.parametrize("target", TARGETS)
def test_a_door_falls_into_its_latch(target: str) -> None:
    """It swings as cos(w t) until phi = 0, stands still under the torque of the closer, and swings on when let go."""
    mod = latched().compile(target=target)
    run = mod.simulate(4.0)
    w = np.sqrt(4.0 / (2.0 + 20.0 * 0.16))
    shut = np.arccos(0.5 / 1.1) / w
    assert run.t_events["hinge_closes"] == pytest.approx([shut], rel=1e-8)
    still = (run.t > shut + 1e-9) & (run.t < 2.0 - 1e-9)
    assert np.abs(run["phi"][still]).max() < 1e-9
    torque = np.array([mod.outputs(t, x)[0] for t, x in zip(run.t[still], run.x.T[still], strict=True)])
    assert np.abs(torque) == pytest.approx(2.0, rel=1e-9)
    late = run.t > 2.0 + 1e-9
    assert run["phi"][late] == pytest.approx(-0.5 + 0.5 * np.cos(w * (run.t[late] - 2.0)), abs=1e-7)


def test_a_file_says_it_at_the_joint(tmp_path: Path) -> None:
    text = """
name: clutch
bodies: {a: {mass: 1, inertia: {zz: 0.3}}, b: {mass: 1, inertia: {zz: 0.5}}}
joints:
  A: {type: revolute, between: [ground, a]}
  S: {type: revolute, between: [a, b], closes: 1 - t, opens: 3 - t}
initial: {A_dot: 4, S_dot: -5}
simulation: {end: 2}
"""
    file = tmp_path / "c.yaml"
    file.write_text(text)
    run = eg.load(file).compile(target="numpy").simulate()
    assert run["A_dot"][-1] == pytest.approx((J1 * W1 + J2 * W2) / (J1 + J2), rel=1e-12)
    file.write_text(text.replace("closes: 1 - t", "closes: 1 < t"))
    refuses("EG-EXPRESSION joints.S.closes 1", lambda: eg.load(file).check())
    file.write_text(text.replace("closes: 1 - t, opens: 3 - t", "stabilisation: 3"))
    refuses("EG-MISSING joints.S", lambda: eg.load(file).check())
    m = eg.Model("w")
    m.weld("W", m.ground, m.body("c", mass=1))
    m.lock("brake", "W", closes="1 - t")
    refuses("EG-REFERENCE constraints.brake.joint W", m.check)
