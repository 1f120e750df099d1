"""Ropes and belts that rub on cylinders: Euler's and Eytelwein's ratio of tensions, brakes, losses, exact slopes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eomgen as eg
from eomgen.errors import ModelError

G, MU, R = 9.81, 0.25, 0.1


def band(sense: str = "positive", target: str = "numpy", **keys: Any) -> Any:
    """A drum with a band of half a turn about it, whose ends are held by sledges that move along y."""
    m = eg.Model("band", gravity=(0, 0, 0))
    drum = m.body("drum", mass=1, inertia={"zz": 0.01})
    m.revolute("turn", m.ground, drum)
    x = R if sense == "positive" else -R
    for name, at in (("a", x), ("b", -x)):
        m.body(name, mass=2.0)
        m.prismatic(name, m.ground.at(at, -1, 0), name, axis="y")
    rope = {"around": drum, "radius": R, "sense": sense, "friction": MU, "smoothing": 0.001, **keys}
    m.actuator("rope", "a", "b", value=-50.0, via=[rope])
    return m.compile(target=target)


@pytest.mark.parametrize("target", ["numpy", "cython"])
@pytest.mark.parametrize("sense", ["positive", "negative"])
def test_a_band_brake(target: str, sense: str) -> None:
    """T_a / T_b = exp(mu pi) where the drum turns one way, exp(-mu pi) the other; the drum feels the difference."""
    mod = band(sense, target)
    for spin in (3.0, -3.0):
        x = np.array([0.0, 0.0, 0.0, spin, 0.0, 0.0])
        drum, a, b = mod.rhs(0.0, x)[3:]
        assert 2 * a == pytest.approx(50.0, rel=1e-12)  # the pull at the first end is the given one
        along = spin if sense == "positive" else -spin  # the surface runs from a to b, and so drags the rope to b
        assert 2 * b == pytest.approx(50.0 * np.exp(-MU * np.pi * np.sign(along)), rel=1e-9)
        brake = R * abs(2 * a - 2 * b)
        assert 0.01 * drum == pytest.approx(-np.sign(spin) * brake, rel=1e-9)
    rest = mod.rhs(0.0, np.zeros(6))
    np.testing.assert_allclose(rest[3:], [0, 25, 25], atol=1e-12)


def test_the_smoothed_ratio() -> None:
    """exp(mu pi tanh(v / smoothing)) of the slip v, and 1 where the rope runs with the drum."""
    mod = band()
    for c in (-2e-3, -3e-4, 4e-4, 1.5e-3):  # a goes down, b up
        for spin in (0.0, 0.004):
            x = np.array([0.0, 0.0, 0.0, spin, -c, c])
            _, a, b = mod.rhs(0.0, x)[3:]
            slip = c + spin * R  # toward a
            assert np.log(a / b) == pytest.approx(MU * np.pi * np.tanh(slip / 0.001), rel=1e-9)


def test_two_weights_over_a_fixed_drum() -> None:
    """They move where their ratio is above exp(mu pi), with (m1 - m2 e) g / (m1 + m2 e)."""
    ratio = np.exp(MU * np.pi)
    for m1 in (1.05 * ratio, 0.95 * ratio):
        m = eg.Model("atwood", gravity=(0, -G, 0))
        for name, at, mass in (("a", R, m1), ("b", -R, 1.0)):
            m.body(name, mass=mass)
            m.prismatic(name, m.ground.at(at, -1, 0), name, axis="y")
        drum = {"around": m.ground, "radius": R, "friction": MU, "smoothing": 1e-4}
        length = 2.0 + np.pi * R
        m.spring("rope", "a", "b", stiffness=1e5, length=length, via=[drum])
        m.damper("inner", "a", "b", damping=50.0, via=[{"around": m.ground, "radius": R}])
        mod = m.compile()
        start = {"a": -m1 * G / 2e5, "b": -m1 * G / 2e5}
        times = [0.0, 0.2, 0.6]
        traj = mod.simulate(0.6, initial=start, method="Radau", rtol=1e-8, atol=1e-11, t_eval=times)
        gained = (traj["a_dot"][2] - traj["a_dot"][1]) / 0.4
        if m1 > ratio:
            assert -gained == pytest.approx((m1 - ratio) * G / (m1 + ratio), rel=2e-2)
        else:
            creep = 1e-4 * np.arctanh(np.log(m1) / (MU * np.pi))
            assert -traj["a_dot"][2] == pytest.approx(creep, rel=1e-3)


def test_friction_takes_energy_from_a_rope_that_keeps_its_length() -> None:
    mod = band()
    rng = np.random.default_rng(3)
    for _ in range(200):
        c, spin = rng.standard_normal(2) * 0.01
        x = np.array([0.1, -0.05, 0.05, spin, -c, c])
        drum, a, b = mod.rhs(0.0, x)[3:]
        assert 0.01 * drum * spin - 2 * a * c + 2 * b * c <= 1e-15


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_slopes_and_a_helix(target: str) -> None:
    """A rope that climbs turns less: mu w cos(pitch); the Jacobian is that of rhs."""
    m = eg.Model("helix", gravity=(0, 0, 0))
    m.parameter("mu", 0.2)
    b = m.body("b", mass=1.0, inertia=(0.1, 0.1, 0.1))
    m.translational("j", m.ground.at(-R, -1, 0.7), b)
    drum = {"around": m.ground, "radius": R, "friction": "mu", "smoothing": 0.01}
    m.actuator("rope", m.ground.at(R, -1, 0), b, value=-10.0, via=[drum])
    mod = m.compile(target=target)
    pitch = np.arctan2(0.7, 2.0 + np.pi * R)
    x = np.array([0, 0, 0, 0, -1.0, 0.0])
    pull = np.linalg.norm(mod.rhs(0.0, x)[3:])
    slip = 0.5 * np.cos(pitch)  # half of the rate of the end, as the other end stands still
    wanted = 10 * np.exp(0.2 * np.pi * np.cos(pitch) * np.tanh(slip / 0.01))
    assert pull == pytest.approx(wanted, rel=1e-9)
    x = np.array([0.01, 0.02, -0.03, 4e-3, -6e-3, 3e-3])
    h = 1e-7
    sides = [(mod.rhs(0.0, x + d) - mod.rhs(0.0, x - d)) / (2 * h) for d in h * np.eye(6)]
    found = mod.jacobian(0.0, x)
    np.testing.assert_allclose(found, np.transpose(sides), rtol=1e-5, atol=1e-6 * np.abs(found).max())


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ({"friction": -0.1}, r"via\[0\].friction: is -0.1; must be 0 or greater"),
        ({"smoothing": 0}, r"via\[0\].smoothing: is 0; must be greater than 0"),
        ({"frction": 1}, "frction"),
    ],
)
def test_what_is_wrong_with_a_rubbing_cylinder_is_told(keys: dict[str, Any], told: str) -> None:
    with pytest.raises(ModelError, match=told):
        band(**keys)


def test_friction_and_smoothing_belong_together(tmp_path: Path) -> None:
    m = eg.Model("half", gravity=(0, 0, 0))
    b = m.body("b", mass=1.0)
    m.prismatic("s", m.ground.at(-R, -1, 0), b, axis="y")
    m.spring("rope", m.ground.at(R, -1, 0), b, stiffness=5, via=[{"around": m.ground, "radius": R, "friction": 0.1}])
    with pytest.raises(ModelError, match=r"via\[0\].smoothing: is missing; give friction and smoothing together"):
        m.mechanism()


def test_a_rubbing_rope_is_verified_and_written_again(tmp_path: Path) -> None:
    m = eg.Model("verified", gravity=(0, -G, 0))
    drum = m.body("drum", mass=1, inertia={"zz": 0.01})
    m.revolute("turn", m.ground, drum)
    b = m.body("b", mass=1.0)
    m.prismatic("s", m.ground.at(-R, -1, 0), b, axis="y")
    rope = {"around": drum, "radius": R, "friction": 0.3, "smoothing": 0.5}
    m.spring("rope", m.ground.at(R, -1, 0), b, stiffness=40, length=2.0, via=[rope])
    m.initial(turn_dot=1.0, s_dot=0.5)
    mod = m.compile(target="numpy")
    file = tmp_path / "verified.yaml"
    file.write_text(m.to_yaml())
    assert np.array_equal(eg.load(file).compile(target="numpy").rhs(0.0, mod.x0()), mod.rhs(0.0, mod.x0()))
    report = mod.verify()
    assert report.ok, report
