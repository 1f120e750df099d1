"""Joints that close and open: momentum of clutches, ballistic pendulums, latched doors, in closed form."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eomgen as eg
from eomgen.errors import ModelError

TARGETS = ("numpy", "cython")
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


def test_a_lock_carries_what_the_shaft_needs_and_lets_go_where_it_is_told() -> None:
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
    assert run["A_dot"][-1] == pytest.approx(
        (J1 * W1 + J2 * W2 + 2.0 * end**2) / (J1 + J2) + 2.0 * (9.0 - end**2) / J1, rel=1e-8
    )


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
def test_a_door_at_rest_in_its_latch_is_let_go(target: str) -> None:
    """Wherever it shuts, so however its angle is rounded there: that it is let go at zero is no fall to zero."""
    m = eg.Model("door_at")
    door = m.body("door", mass=20.0, inertia={"zz": 2.0}, com=(0.4, 0, 0))
    m.parameter("place", 0.1)
    m.revolute("hinge", m.ground, door, coordinate="phi", closes="phi - place", opens="2 - t")
    m.joint_spring("closer", "phi", stiffness=4.0, rest=-0.5)
    m.initial(phi=0.6)
    mod = m.compile(target=target)
    for place in np.linspace(0.0, 0.45, 10):
        run = mod.simulate(4.0, parameters={"place": place})
        assert len(run.t_events["hinge_closes"]) == 1
        assert run["phi"].min() < -0.5


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


def test_every_coordinate_of_a_joint_is_locked() -> None:
    """A ball joint in Euler parameters and in Euler angles; one coordinate of a cylinder alone."""
    ends = []
    for rotation in ("euler_parameters", "euler_angles"):
        m = eg.Model("ball", gravity=(0, 0, -9.81))
        top = m.body("top", mass=1.0, com=(0.1, 0, 0.2), inertia=(0.03, 0.02, 0.025))
        m.spherical("S", m.ground, top, rotation=rotation, closes="0.3 - t")
        m.output("z", "z(top.tip)")
        top.marker("tip", at=(0, 0, 0.3))
        mod = m.compile(target="numpy")
        run = mod.simulate(1.0)
        moved = run.x[: mod.n_q, run.t > 0.3 + 1e-9]
        assert np.abs(np.diff(moved, axis=1)).max() < 1e-12
        ends.append(mod.outputs(1.0, run.x[:, -1])[0])
    assert ends[0] == pytest.approx(ends[1], abs=1e-8)
    m = eg.Model("rod", gravity=(0, 0, -9.81))
    m.cylindrical("C", m.ground, m.body("rod", mass=1.0, inertia={"zz": 0.1}))
    m.lock("brake", "C_3", closes="0.5 - t")
    m.initial(C_3_dot=2.0)
    run = m.compile(target="numpy").simulate(1.0)
    assert run["C_3_dot"][-1] == pytest.approx(0.0, abs=1e-14)
    assert run["C_z"][-1] == pytest.approx(-0.5 * 9.81, rel=1e-9)


def test_a_joint_that_closes_a_loop_is_locked_as_one_of_the_tree() -> None:
    """A four-bar stands still as any of its joints is locked, with the same impact."""
    states = []
    for name in ("A", "B", "C", "D"):
        m = eg.load_example("four_bar")
        m.lock("brake", name, closes="0.2 - t")
        mod = m.compile(target="numpy")
        run = mod.simulate(0.5)
        after = run.t > 0.2 + 1e-9
        assert np.abs(run.x[mod.n_q : mod.n_q + mod.n_v, after]).max() < 1e-7
        states.append(run.x[: mod.n_q, -1])
    for other in states[1:]:
        assert other == pytest.approx(states[0], abs=1e-6)


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
    with pytest.raises(ModelError, match=r"joints.S.closes: '1 < t' is a comparison"):
        eg.load(file).check()
    file.write_text(text.replace("closes: 1 - t, opens: 3 - t", "stabilisation: 3"))
    with pytest.raises(ModelError, match=r"joints.S: is neither closed nor opened"):
        eg.load(file).check()
    m = eg.Model("w")
    m.weld("W", m.ground, m.body("c", mass=1))
    m.lock("brake", "W", closes="1 - t")
    with pytest.raises(ModelError, match=r"constraints.brake.joint: 'W' has no coordinates to lock"):
        m.mechanism()


def test_instances_of_components_have_locks_of_their_own() -> None:
    wheel = eg.Model("wheel")
    wheel.parameter("off", 1.0)
    wheel.revolute("axle", wheel.ground, wheel.body("rim", mass=1, inertia={"zz": 0.1}), closes="off - t")
    wheel.initial(axle_dot=3.0)
    m = eg.Model("two")
    m.add(wheel, prefix="l_")
    m.add(wheel, prefix="r_", off=2.0)
    run = m.compile(target="numpy").simulate(3.0)
    assert [*run.t_events["l_axle_closes"], *run.t_events["r_axle_closes"]] == pytest.approx([1.0, 2.0])
    assert [run["l_axle"][-1], run["r_axle"][-1]] == pytest.approx([3.0, 6.0], rel=1e-9)
