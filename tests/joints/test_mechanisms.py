"""Shafts through universal and constant-velocity joints, threads, guides, and what may be cut."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import eomgen as eg
from eomgen.api.module import Module
from eomgen.errors import ModelError

BEND = np.pi / 6


def shafts(kind: str) -> eg.Model:
    """Two shafts in bearings, bent by 30 degrees; the second bearing's axis passes the joint's centre."""
    m = eg.Model("shafts")
    drive = m.body("drive", mass=1, inertia=(0.1, 0.1, 0.2))
    driven = m.body("driven", mass=1, inertia=(0.1, 0.1, 0.2))
    m.revolute("A", m.ground, drive, coordinate="t1")
    m.joint(kind, "J", drive, driven)
    m.joint("parallel", "B", m.ground.at(0, 0, 0, rpy=(0, BEND, 0)), driven)
    m.output("spin_x", driven.at(1, 0, 0).velocity[1])
    return m


def ratio(module: Module, t1: float) -> float:
    """Angular speed of the driven shaft per unit of the driving one, from poses."""
    x = module.x0(t1=t1, t1_dot=1.0)
    h = 1e-5
    q, v = x[: module.n_q], x[module.n_q :]
    slope = (module.poses(q + h * v)[1] - module.poses(q - h * v)[1])[:3, :3] / (2 * h)
    spin = slope @ module.poses(q)[1][:3, :3].T
    omega = np.array([spin[2, 1], spin[0, 2], spin[1, 0]])
    axis = np.array([np.sin(BEND), 0, np.cos(BEND)])
    assert np.abs(np.cross(omega, axis)).max() < 1e-8  # it turns in its bearing
    return float(omega @ axis)


def test_speed_ratio_of_a_cardan_joint() -> None:
    """w2/w1 = cos b / (1 - sin^2 b cos^2 t1) (cam_gear_cardan.json: closed form)."""
    module = shafts("universal").compile(target="numpy")
    for degrees in (0, 30, 45, 60, 90):
        t1 = np.radians(degrees)
        expected = np.cos(BEND) / (1 - np.sin(BEND) ** 2 * np.cos(t1) ** 2)
        assert ratio(module, float(t1)) == pytest.approx(expected, abs=1e-8)


def test_constant_velocity_joint_transmits_evenly() -> None:
    module = shafts("constant_velocity").compile(target="numpy")
    for t1 in np.linspace(0, 2.5, 6):
        assert ratio(module, float(t1)) == pytest.approx(1.0, abs=1e-8)


def test_bead_on_a_cycloid_swings_in_the_same_time_from_everywhere() -> None:
    """Huygens: along x = r (s + sin s), y = r (1 - cos s) the period is 4 pi sqrt(r / g), whatever the amplitude."""
    m = eg.Model("cycloid", gravity=(0, -9.81, 0))
    m.parameter("r", 0.3)
    bead = m.body("bead", mass=0.7)
    m.curve_slider("s", m.ground, bead, curve=["r*(s + sin(s))", "r*(1 - cos(s))", 0])
    module = m.compile(target="numpy")
    period = 4 * np.pi * np.sqrt(0.3 / 9.81)
    for start in (0.1, 1.0, 2.5):
        end = module.simulate((0, period), initial={"s": start}, rtol=1e-10, atol=1e-12)
        assert end["s"][-1] == pytest.approx(start, abs=1e-7)


def test_bolt_falls_down_its_thread() -> None:
    """A screw of lead h with its axis upright: (m h^2 + I) a = - m g h."""
    m = eg.Model("bolt", gravity=(0, 0, -9.81))
    bolt = m.body("bolt", mass=2, inertia=(0.1, 0.1, 0.003))
    m.screw("turn", m.ground, bolt, pitch="p")
    m.parameter("p", 0.1)
    h = 0.1 / (2 * np.pi)
    found = m.compile(target="numpy").rhs(0.0, [20.0, 0.0])[1]
    assert found == pytest.approx(-2 * 9.81 * h / (2 * h * h + 0.003), rel=1e-13)


def thread_turns(q: np.ndarray, pose: np.ndarray, pitch: float) -> float:
    """Angle of the fine screw below by its advance, from a pose."""
    base, end = (np.eye(4) for _ in range(2))
    for place, turn, at in ((base, BASE[1], BASE[0]), (end, END[1], END[0])):
        place[:3, :3], place[:3, 3] = Rotation.from_euler("xyz", turn).as_matrix(), at
    relative = np.linalg.inv(base) @ pose @ end
    angle = relative[2, 3] / (pitch / (2 * np.pi))
    assert relative[:2, 3] == pytest.approx([0, 0], abs=1e-10)
    assert np.arctan2(relative[1, 0], relative[0, 0]) == pytest.approx(np.remainder(angle + np.pi, 2 * np.pi) - np.pi)
    return float(angle)


BASE = (0.2, -0.1, 0.4), (0.3, -0.4, 0.5)
END = (-0.1, 0.05, 0.2), (-0.2, 0.3, 0.6)


def test_a_fine_thread_that_is_cut_is_turned_in_few_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """A hundredth of a metre a turn: the angle is 628 times as steep as the other rows."""
    pitch = 0.01
    m = eg.Model("pair", gravity=(0.5, -9.81, 0.7))
    body = m.body("body", mass=1.3, com=(0.1, 0.2, -0.1), inertia=(0.2, 0.3, 0.25))
    m.free("f", m.ground, body, coordinates=["x", "y", "z", "a", "b", "c"])
    m.screw("j", m.ground.at(*BASE[0], rpy=BASE[1]), body.at(*END[0], rpy=END[1]), pitch=pitch)
    assert m.check().loop_joints == ["j"]
    module = m.compile(target="numpy")
    q = module.x0()[: module.n_q]
    start = thread_turns(q, module.poses(q)[0], pitch)
    monkeypatch.setattr("eomgen.numeric.held_path.TRIALS", 200)
    q = module.x0(j=start + 3.0)[: module.n_q]
    assert np.abs(module.constraints(q, rows="all")).max() < 1e-12
    assert thread_turns(q, module.poses(q)[0], pitch) == pytest.approx(start + 3.0, abs=1e-9)


def test_bodies_held_by_rods_alone_are_told() -> None:
    m = eg.Model("rods")
    m.distance("rod", m.ground, m.body("ball", mass=1, inertia=(1, 1, 1)).at(0, 1, 0), length=1)
    with pytest.raises(ModelError, match=r"bodies\.ball: only constraints without coordinates.*type free"):
        m.check()


def test_loop_of_guides_alone_cannot_be_cut() -> None:
    m = eg.Model("grooves")
    plate = m.body("plate", mass=1, inertia=(1, 1, 1))
    m.point_on_curve("a", m.ground, plate, curve=["a_s", 0, 0])
    m.point_on_curve("b", m.ground, plate.at(1, 0, 0), curve=[0, "b_s", 0])
    with pytest.raises(ModelError, match=r"joints\.b: a point_on_curve joint cannot close a loop"):
        m.check()


@pytest.mark.parametrize(
    ("kind", "keys", "message"),
    [
        ("screw", {}, r"joints\.j\.pitch: is missing"),
        ("screw", {"pitch": 0}, r"joints\.j\.pitch: is 0.*revolute"),
        ("distance", {"length": 0}, r"joints\.j\.length: is 0.*spherical"),
        ("curve_slider", {"curve": [0, 1]}, r"joints\.j\.curve: \[0, 1\] is not three numbers"),
        ("curve_slider", {"curve": [0, 1, 2]}, r"joints\.j\.curve: does not depend on j"),
        ("curve_slider", {"curve": ["j", "t", 0]}, r"joints\.j\.curve: the time 't' cannot be used here"),
        ("revolute", {"pitch": 1}, r"a revolute joint has no 'pitch'"),
    ],
)
def test_bad_options(kind: str, keys: dict[str, object], message: str) -> None:
    m = eg.Model("bad")
    m.joint(kind, "j", m.ground, m.body("b", mass=1), **keys)
    with pytest.raises(ModelError, match=message):
        m.mechanism()


def test_options_round_trip_through_a_file(tmp_path: Path) -> None:
    m = eg.Model("all")
    p = m.parameter("p", 0.5)
    a, b = (m.body(name, mass=1, inertia=(1, 1, 1)) for name in "ab")
    m.point_on_surface("s", m.ground, a, surface=["p*cos(s_u)", "s_v", "s_u*s_v"], sequence="zxz")
    m.screw("w", a, b, pitch=p / 3, axis="x")
    m.distance("d", m.ground.at(1, 1, 1), b, length=2 * p)
    text = m.to_yaml()
    assert "pitch: p/3" in text
    assert "length: 2*p" in text
    assert "surface: [" in text
    (tmp_path / "all.yaml").write_text(text, encoding="utf-8")
    assert eg.load(tmp_path / "all.yaml").to_yaml() == text
    assert m.check().degrees_of_freedom == 5
