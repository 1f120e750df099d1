"""Velocities of markers as wanted initial values: closed forms, in every place where initial values are given."""

from __future__ import annotations

from collections.abc import Callable
from math import cos, pi, sin, sqrt
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import eomgen as eg

ARM = """
name: arm
parameters: {l: {value: 800, unit: mm}}
bodies:
  rod: {mass: 1, com: [l/2, 0, 0], inertia: {zz: 0.1}, markers: {tip: [l, 0, 0]}}
joints:
  A: {type: revolute, between: [ground, rod], coordinate: q}
initial: {q: 0.6, INITIAL}
"""


def double_pendulum(turn: float = 0.0) -> eg.Model:
    m = eg.Model("two_links", gravity=(0, -9.81, 0))
    one, two = (m.body(name, mass=1, inertia={"zz": 0.1}) for name in ("one", "two"))
    m.revolute("A", m.ground.at(0, 0, 0, rpy=(0, 0, turn)), one, coordinate="a")
    m.revolute("B", one.at(0.7, 0, 0), two, coordinate="b")
    one.marker("end", at=(0.7, 0, 0))
    two.marker("end", at=(0.4, 0.1, 0))
    return m


def test_two_velocities_of_a_tip_are_met_exactly() -> None:
    """r = 0.7 e(a) + 0.4 e(a + b) + 0.1 n(a + b); its velocity is linear in the rates."""
    random = np.random.default_rng(0)
    for turn in (0.0, 1.1, -2.6):
        mod = double_pendulum(turn).compile(target="numpy")
        for _ in range(10):
            a, b, vx, vy = random.uniform(0.3, 1.2, 4)
            x = mod.x0({"a": a, "b": b, "vx(two.end)": vx, "vy(two.end)": vy})
            assert x[:2].tolist() == [a, b]
            first, both = a + turn, a + b + turn
            n = np.array([-sin(first), cos(first)]) * 0.7
            m = np.array([-0.4 * sin(both) - 0.1 * cos(both), 0.4 * cos(both) - 0.1 * sin(both)])
            assert (n + m) * x[2] + m * x[3] == pytest.approx([vx, vy], abs=1e-12)


def test_a_velocity_beside_a_rate_and_a_place() -> None:
    mod = double_pendulum().compile(target="numpy")
    x = mod.x0({"a": 0.5, "y(two.end)": 0.6, "a_dot": 2.0, "vx(two.end)": 0.0})
    a, b = x[:2]
    assert 0.7 * sin(a) + 0.4 * sin(a + b) + 0.1 * cos(a + b) == pytest.approx(0.6, abs=1e-12)
    assert x[2] == 2.0
    assert -0.7 * sin(a) * x[2] - (0.4 * sin(a + b) + 0.1 * cos(a + b)) * (x[2] + x[3]) == pytest.approx(0, abs=1e-12)


def test_the_speed_of_a_piston_gives_the_speed_of_the_crank() -> None:
    """v = -r w (sin phi + r sin phi cos phi / sqrt(l^2 - r^2 sin^2 phi))."""
    r, rod, phi = 0.05, 0.16, 0.8
    m = eg.Model("slider_crank")
    crank, bar, piston = (m.body(name, mass=1, inertia={"zz": 0.01}) for name in ("crank", "rod", "piston"))
    m.revolute("A", m.ground, crank, coordinate="phi")
    m.revolute("B", crank.at(r, 0, 0), bar)
    m.revolute("C", bar.at(rod, 0, 0), piston)
    m.prismatic("D", m.ground, piston, axis="x", coordinate="s")
    piston.marker("crown", at=(0.03, 0.01, 0))
    m.initial(phi=phi)
    mod = m.compile(target="numpy")
    x = dict(zip(mod.x_names, mod.x0({"phi": phi, "vx(piston.crown)": 1.5}), strict=True))
    wanted = -1.5 / (r * sin(phi) * (1.0 + r * cos(phi) / sqrt(rod**2 - (r * sin(phi)) ** 2)))
    assert x["phi_dot"] == pytest.approx(wanted, rel=1e-11)


def test_a_body_that_turns_freely_by_euler_parameters() -> None:
    """v = R (w x r) of a ball joint, w in body axes; the part along r cannot be wanted."""
    m = eg.Model("top")
    body = m.body("body", mass=1, inertia=(0.1, 0.2, 0.3))
    m.spherical("S", m.ground, body, rotation="euler_parameters")
    at = np.array([0.3, -0.2, 0.5])
    body.marker("tip", at=tuple(at))
    mod = m.compile(target="numpy")
    turn = Rotation.from_rotvec([0.3, -0.8, 0.5])
    x, y, z, w = turn.as_quat()
    start = dict(zip(mod.q_names, (w, x, y, z), strict=True))
    state = mod.x0({**start, "vx(body.tip)": 0.4, "vy(body.tip)": -0.7})
    found = turn.apply(np.cross(state[4:], at))
    assert found[:2] == pytest.approx([0.4, -0.7], abs=1e-12)


def given_to_x0(text: str, value: str, folder: Path) -> float:
    return float(eg.load(written(folder, text)).compile(target="numpy").x0({"q": 0.6, "vx(rod.tip)": value})[1])


def given_to_simulate(text: str, value: str, folder: Path) -> float:
    mod = eg.load(written(folder, text)).compile(target="numpy")
    return float(mod.simulate(0.01, initial={"q": 0.6, "vx(rod.tip)": value})["q_dot"][0])


def given_to_many(text: str, value: str, folder: Path) -> float:
    mod = eg.load(written(folder, text)).compile(target="numpy")
    run = mod.simulate_many(0.01, initial={"q": 0.6, "vx(rod.tip)": [-0.3, 2 * -0.3]}, t_eval=[0.0])
    assert run["q_dot"][0, 1] == pytest.approx(2 * run["q_dot"][0, 0], rel=1e-12)
    return float(run["q_dot"][0, 0])


def given_in_the_file(text: str, value: str, folder: Path) -> float:
    path = written(folder, text.replace("INITIAL", f"vx(rod.tip): {value}"))
    eg.load(path).check()
    return float(eg.load(path).compile(target="numpy").simulate(0.01)["q_dot"][0])


def given_in_python(text: str, value: str, folder: Path) -> float:
    m = eg.load(written(folder, text))
    m.initial = {"q": 0.6, "vx(rod.tip)": value}
    return float(m.compile(target="numpy").x0()[1])


def written(folder: Path, text: str) -> Path:
    path = folder / "arm.yaml"
    path.write_text(text.replace("INITIAL", ""), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    "give",
    [given_to_x0, given_to_simulate, given_to_many, given_in_the_file, given_in_python],
    ids=lambda f: f.__name__,
)
def test_every_place_of_initial_values_takes_them(give: Callable[[str, str, Path], float], tmp_path: Path) -> None:
    assert give(ARM, "-0.3", tmp_path) == pytest.approx(0.3 / (0.8 * sin(0.6)), rel=1e-12)


@pytest.mark.parametrize(
    ("initial", "error", "said"),
    [
        ("vx(rod.top): 1", eg.ModelError, "initial.vx(rod.top): no marker 'rod.top'"),
        ("vx(ground.o): 1", eg.ModelError, "initial.vx(ground.o)"),
        ("vx(rod.tip): 1, q_dot: 2", eg.AssemblyError, "initial.vx(rod.tip): the given velocities"),
        ("vz(rod.tip): 1", eg.AssemblyError, "initial.vz(rod.tip)"),
    ],
)
def test_velocities_that_cannot_be(initial: str, error: type[Exception], said: str, tmp_path: Path) -> None:
    path = tmp_path / "arm.yaml"
    path.write_text(ARM.replace("INITIAL", initial), encoding="utf-8")
    with pytest.raises(error) as told:
        eg.load(path).check()
    assert said in str(told.value)


def test_the_unit_of_a_velocity_is_checked() -> None:
    m = double_pendulum()
    m.parameter("length", 0.3, unit="m")
    m.parameter("speed", 0.3, unit="m/s")
    m.initial = {"a": pi / 4, "vx(two.end)": "length"}
    with pytest.raises(eg.ModelError, match=r"initial\.vx\(two\.end\)"):
        m.check()
    m.initial = {"a": pi / 4, "vx(two.end)": "speed"}
    m.check()
    m.initial = {"a": pi / 4, "x(two.end)": "speed"}
    with pytest.raises(eg.ModelError, match=r"initial\.x\(two\.end\)"):
        m.check()
