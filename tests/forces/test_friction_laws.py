"""Laws of dry friction: published formulas, angles of slip, creep on a slope, stick-slip against hand-written SciPy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import eomgen as eg
from eomgen.errors import ModelError

G = 9.81
MU, STATIC = 0.3, 0.4
COULOMB = {"friction": MU, "static_friction": STATIC, "stribeck": 0.05, "smoothing": 1e-5}
BROWN = {"friction_law": "brown_mcphee", "friction": MU, "static_friction": STATIC, "transition": 1e-4}
LUGRE = {
    "friction_law": "lugre", "friction": MU, "static_friction": STATIC, "stribeck": 0.01,
    "bristle_stiffness": 1e5, "bristle_damping": 300.0,
}  # fmt: skip
GROUND = {"stiffness": 1e6, "exponent": 1, "dissipation": 2.0}


def brown_mcphee(v: Any, dynamic: float, static: float, transition: float) -> Any:
    """Brown and McPhee (2016), equation 5."""
    x = v / transition
    return dynamic * np.tanh(4 * x) + (static - dynamic) * x / (0.25 * x**2 + 0.75) ** 2


def block(angle: float, law: dict[str, Any], bulk: bool = False) -> eg.Model:
    """A point on a slope that falls along x."""
    m = eg.Model("slope", gravity=(G * np.sin(angle), 0, -G * np.cos(angle)))
    m.body("cart", mass=0)
    body = m.body("block", mass=2.0, inertia=(0.01, 0.01, 0.01))
    m.prismatic("x", m.ground, "cart", axis="x")
    m.prismatic("z", "cart", body, axis="z")
    if bulk:
        corner = {"shape": "sphere", "on": body.at(0, 0, 0.1), "radius": 0.1}
        m.contacts("touch", corner, {"shape": "half_space", "on": m.ground}, {**GROUND, **law})
    else:
        m.point_plane("touch", m.ground, body, **GROUND, **law)
    return m


SINK = 2.0 * G / 1e6


@pytest.mark.parametrize("target", ["numpy", "cython"])
@pytest.mark.parametrize("bulk", [False, True])
def test_friction_of_brown_and_mcphee_in_contacts(target: str, bulk: bool) -> None:
    mod = block(0.0, {**BROWN, "viscous_friction": 0.02}, bulk).compile(target=target)
    v = np.concatenate([[0.0], np.geomspace(1e-12, 10, 200), -np.geomspace(1e-12, 10, 50)])
    x = np.array([0 * v, 0 * v - SINK, v, 0 * v])
    wanted = -G * (brown_mcphee(v, MU, STATIC, 1e-4) + 0.02 * v)
    np.testing.assert_allclose(mod.rhs(0.0, np.ascontiguousarray(x))[2], wanted, rtol=1e-11)
    assert np.abs(wanted).max() > STATIC * G
    slopes = [mod.jacobian(0.0, column)[2, 2] for column in x[:, :40].T.copy()]
    per_v = 4 * MU / 1e-4 + (STATIC - MU) / 1e-4 / 0.5625 + 0.02
    assert slopes[0] == pytest.approx(-G * per_v, rel=1e-12)
    np.testing.assert_allclose(slopes[:5], slopes[0], rtol=1e-9)


def test_friction_of_brown_and_mcphee_in_a_joint() -> None:
    """Its largest value is the static friction, at the transition velocity, but for 1 - tanh 4."""
    m = eg.Model("joint")
    body = m.body("b", mass=3)
    m.prismatic("s", m.ground, body, axis="x")
    m.friction("rub", "s", coulomb=10, static="F", transition=0.02, viscous=5, friction_law="brown_mcphee")
    m.parameter("F", 14)
    mod = m.compile(target="numpy")
    v = np.linspace(-0.1, 0.1, 41)
    found = -3 * mod.rhs(0.0, np.array([0 * v, v]))[1]
    np.testing.assert_allclose(found, brown_mcphee(v, 10, 14, 0.02) + 5 * v, rtol=1e-12, atol=1e-12)
    late = -3 * mod.rhs(0.0, np.array([0 * v, v]), p={"F": 20})[1]
    np.testing.assert_allclose(late, brown_mcphee(v, 10, 20, 0.02) + 5 * v, rtol=1e-12, atol=1e-12)
    fine = brown_mcphee(np.linspace(0, 0.1, 10001), 10, 14, 0.02)
    assert fine.max() == pytest.approx(14, rel=10 * (1 - np.tanh(4)) / 14 * 1.1)


@pytest.mark.parametrize("law", [COULOMB, BROWN, LUGRE], ids=["coulomb", "brown_mcphee", "lugre"])
def test_angle_of_slip(law: dict[str, Any]) -> None:
    """A block rests at 1e-3 rad below arctan(mu_s) and runs away at 1e-3 rad above it.

    Bristles begin bent as they are below: a load that comes at once would swing beyond the limit.
    """
    for side in (-1, 1):
        mod = block(np.arctan(STATIC) + side * 1e-3, law).compile()
        start = {"z": -SINK * np.cos(np.arctan(STATIC))}
        if law is LUGRE:
            bent = np.tan(np.arctan(STATIC) - 1e-3) / 1e5
            start["touch_bristle_x"] = bent * np.sqrt(1e5 * 2.0 * G * np.cos(np.arctan(STATIC)))
        traj = mod.simulate(3.0, initial=start, method="Radau", rtol=1e-8, atol=1e-12)
        if side > 0:
            assert traj["x_dot"][-1] > 0.5
        else:
            assert abs(traj["x_dot"][-1]) < 2e-4


def test_creep_on_a_slope() -> None:
    """Smoothed laws creep at the velocity where friction carries the weight, in 100 s; bristles hold the block."""
    angle = np.arctan(0.25)
    times = np.array([0.0, 1.0, 101.0])
    moved = {}
    for name, law in (("coulomb", COULOMB), ("brown", BROWN), ("lugre", LUGRE)):
        mod = block(angle, law).compile()
        start = {"z": -SINK * np.cos(angle)}
        traj = mod.simulate(101.0, initial=start, method="Radau", rtol=1e-9, atol=1e-13, t_eval=times)
        moved[name] = traj["x"][2] - traj["x"][1]
        if name == "lugre":
            bent = 0.25 / 1e5 * np.sqrt(1e5 * 2.0 * G * np.cos(angle))
            assert traj["touch_bristle_x"][2] == pytest.approx(bent, rel=1e-6)
    level = STATIC  # of the law of Stribeck, far below its velocity
    assert moved["coulomb"] == pytest.approx(100 * 1e-5 * 0.25 / np.sqrt(level**2 - 0.25**2), rel=1e-4)
    near = np.linspace(1e-6, 5e-5, 200_001)
    creep = near[np.argmin(np.abs(brown_mcphee(near, MU, STATIC, 1e-4) - 0.25))]
    assert moved["brown"] == pytest.approx(100 * creep, rel=1e-4)
    assert abs(moved["lugre"]) < 1e-6


def test_stick_slip_on_a_joint() -> None:
    """A mass drawn by a spring (Canudas de Wit and others, 1995, section III), against SciPy's integrator."""
    k, pull, mass = 2.0, 0.1, 1.0
    s0, s1, s2, low, high, vs = 1e5, np.sqrt(1e5), 0.4, 1.0, 1.5, 0.001
    m = eg.Model("stick_slip")
    body = m.body("b", mass=mass)
    m.prismatic("s", m.ground, body, axis="x")
    m.friction(
        "rub", "s", coulomb=low, static=high, stribeck=vs, viscous=s2, friction_law="lugre",
        bristle_stiffness=s0, bristle_damping=s1,
    )  # fmt: skip
    m.actuator("rope", "s", value=f"{k}*({pull}*t - s)")
    mod = m.compile()
    assert mod.x_names == ("s", "s_dot", "rub_bristle")

    def by_hand(t: float, x: np.ndarray) -> list[float]:
        y, v, z = x
        g = low + (high - low) * np.exp(-((v / vs) ** 2))
        dz = v - s0 * abs(v) / g * z
        return [v, (k * (pull * t - y) - s0 * z - s1 * dz - s2 * v) / mass, dz]

    times = np.linspace(0, 60, 601)
    judge = solve_ivp(by_hand, (0, 60), np.zeros(3), method="LSODA", rtol=1e-9, atol=1e-12, t_eval=times).y
    traj = mod.simulate(60.0, method="Radau", rtol=1e-9, atol=1e-12, t_eval=times)
    assert np.ptp(np.diff(judge[0])) > 0.03  # it sticks and slips
    assert np.abs(traj["s"] - judge[0]).max() < 2e-5
    assert np.abs(traj["rub_bristle"] - judge[2]).max() < 1e-7
    rng = np.random.default_rng(2)
    for x in rng.standard_normal((20, 3)) * [1, 1e-2, 1e-5]:
        np.testing.assert_allclose(mod.rhs(0.3, x), by_hand(0.3, x), rtol=1e-12)


def test_bristles_between_surfaces() -> None:
    """Rates and forces of single contacts against vectors in NumPy, for any turn of the first marker.

    The states are sqrt(s0 N) times the deflections z of the published law.
    """
    rng = np.random.default_rng(8)
    law = {**LUGRE, "viscous_friction": 0.05, "stiffness": 1e4, "exponent": 1}
    for turn in ((0, 0, 0), (0.3, -0.5, 1.1)):
        m = eg.Model("two", gravity=(0, 0, 0))
        body = m.body("b", mass=1.0, inertia=(0.1, 0.1, 0.1))
        m.translational("j", m.ground, body)
        base = m.ground.at(0, 0, 0, rpy=turn)
        m.sphere_plane("floor", base, body, radius=0.1, **law)
        m.sphere_sphere("ball", base, body, radii=(0.05, 0.1), **law)
        mod = m.compile(target="numpy")
        c, s = np.cos(turn), np.sin(turn)
        Rx = np.array([[1, 0, 0], [0, c[0], -s[0]], [0, s[0], c[0]]])
        Ry = np.array([[c[1], 0, s[1]], [0, 1, 0], [-s[1], 0, c[1]]])
        Rz = np.array([[c[2], -s[2], 0], [s[2], c[2], 0], [0, 0, 1]])
        R = Rz @ Ry @ Rx
        touched = 0
        for _ in range(40):
            p = rng.uniform(-0.12, 0.12, 3)
            v = 0.02 * rng.standard_normal(3)
            z = 1e-6 * rng.standard_normal(5)
            force, rates, states = np.zeros(3), [], []
            for n, depth, own in (
                (R[:, 2], 0.1 - R[:, 2] @ p, [*z[:2], 0.0]),
                (p / np.linalg.norm(p), 0.15 - np.linalg.norm(p), z[2:]),
            ):
                slide = v - n * (n @ v)
                speed = np.linalg.norm(slide)
                g = MU + (STATIC - MU) * np.exp(-((speed / 0.01) ** 2))
                local = R.T @ slide
                dz = local - 1e5 * speed / g * np.array(own) if depth > 0 else -1e5 / 300 * np.array(own)
                bristle = R @ (1e5 * np.array(own) + 300 * dz)
                push = 1e4 * max(depth, 0.0)
                root = np.sqrt(1e5 * push) if depth > 0 else 1.0
                states += list(root * np.array(own)[: 2 if len(rates) == 0 else 3])
                dz = root * dz
                force += push * n - push * (bristle - n * (n @ bristle) + 0.05 * slide)
                rates += list(dz[: 2 if len(rates) == 0 else 3])
                touched += depth > 0
            found = mod.rhs(0.0, np.concatenate([p, v, states]))
            np.testing.assert_allclose(found[3:6], force, rtol=1e-9, atol=1e-9)
            np.testing.assert_allclose(found[6:], rates, rtol=1e-9, atol=1e-12)
        assert touched > 20


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_derivatives_of_laws(target: str) -> None:
    for law in (BROWN, LUGRE):
        mod = block(0.2, law).compile(target=target)
        n = mod.n_x
        x = np.array([0.1, -2 * SINK, 3e-5, -1e-4, 2e-6, 1e-6][:n])
        step = 1e-6 * np.array([1, SINK, 1e-4, 1e-3, 1e-6, 1e-6][:n])
        found = mod.jacobian(0.0, x)
        sides = [(mod.rhs(0.0, x + d) - mod.rhs(0.0, x - d)) / (2 * d.sum()) for d in np.diag(step)]
        np.testing.assert_allclose(found, np.transpose(sides), rtol=1e-5, atol=1e-7 * np.abs(found).max())
        assert np.isfinite(mod.jacobian(0.0, np.zeros(n))).all()
        assert np.isfinite(mod.rhs(0.0, np.zeros(n))).all()


def test_verification_and_components_know_bristles(tmp_path: Path) -> None:
    part = eg.Model("part")
    part.body("b", mass=1)
    part.prismatic("s", part.ground, "b", axis="x")
    part.friction(
        "rub", "s", coulomb=1, friction_law="lugre", bristle_stiffness=100, bristle_damping=5,
    )  # fmt: skip
    part.output("bent", "rub_bristle")
    m = eg.Model("whole")
    m.add(part, prefix="one_")
    m.add(part, prefix="two_")
    mod = m.compile(target="numpy")
    assert mod.s_names == ("one_rub_bristle", "two_rub_bristle")
    x = mod.x0(one_rub_bristle=0.01, two_s_dot=1.0)
    np.testing.assert_allclose(mod.outputs(0.0, x), [0.01, 0.0])
    np.testing.assert_allclose(mod.rhs(0.0, x), [0, 1, -1, -5, 0, 1])
    assert m.compile(target="numpy").verify().ok
    text = m.derive().explain().markdown
    assert r"\dot{z} = v - \sigma_0" in text
    file = tmp_path / "whole.yaml"
    file.write_text(m.to_yaml())
    assert np.array_equal(eg.load(file).compile(target="numpy").rhs(0.0, x), mod.rhs(0.0, x))


@pytest.mark.parametrize(
    ("law", "place", "told"),
    [
        ({**COULOMB, "friction_law": "dahl"}, "friction_law", "dahl"),
        ({**COULOMB, "friction": -0.1}, "friction", "is -0.1"),
        ({"friction_law": "lugre"}, "friction_law", "is given without friction"),
        ({**COULOMB, "transition": 1}, "transition", "has no meaning in friction_law: coulomb"),
        ({**BROWN, "smoothing": 1}, "smoothing", "has no meaning in friction_law: brown_mcphee"),
        ({**BROWN, "transition": 0}, "transition", "is 0"),
        ({**BROWN, "static_friction": 0.1}, "static_friction", "is 0.1, below sliding friction 0.3"),
        ({**COULOMB, "static_friction": 0.1, "stribeck": 0.1}, "static_friction", "static is the greater"),
        ({**LUGRE, "static_friction": 0.1, "stribeck": 0.1}, "static_friction", "static is the greater"),
        ({"friction_law": "brown_mcphee", "friction": 1}, "transition", "is missing"),
        ({**LUGRE, "smoothing": 1}, "smoothing", "has no meaning in friction_law: lugre"),
        ({**LUGRE, "bristle_damping": 0}, "bristle_damping", "is 0"),
        ({**LUGRE, "bristle_stiffness": -1}, "bristle_stiffness", "is -1"),
        ({**LUGRE, "friction": 0}, "friction", "must be greater than 0"),
        ({**LUGRE, "friction": -0.1}, "friction", "must be greater than 0"),
        ({"friction_law": "lugre", "friction": 0.1}, "bristle_stiffness", "is missing"),
    ],
)
def test_what_is_wrong_with_a_law_of_friction_is_told(law: dict[str, Any], place: str, told: str) -> None:
    with pytest.raises(ModelError) as error:
        block(0.1, law).mechanism()
    found = {p.path: f"{p.message}; {p.remedy}" for p in error.value.problems}
    assert len(found) == len(error.value.problems)  # each fault is told once
    assert told in found.get(f"forces.touch.{place}", f"nothing there: {found}"), found


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_bristles_of_groups_as_those_of_one_pair(target: str) -> None:
    """A sphere in a group, on a half-space, has the bristles of sphere_plane, whose plane is the same."""
    single = eg.Model("slope", gravity=(G * np.sin(0.2), 0, -G * np.cos(0.2)))
    single.body("cart", mass=0)
    body = single.body("block", mass=2.0, inertia=(0.01, 0.01, 0.01))
    single.prismatic("x", single.ground, "cart", axis="x")
    single.prismatic("z", "cart", body, axis="z")
    single.sphere_plane("touch", single.ground, body.at(0, 0, 0.1), radius=0.1, **GROUND, **LUGRE)
    mods = [m.compile(target=target) for m in (single, block(0.2, LUGRE, bulk=True))]
    assert mods[0].x_names[4:] == ("touch_bristle_x", "touch_bristle_y")
    assert mods[1].x_names[4:] == ("touch_bristle_x_1", "touch_bristle_y_1")
    for z, v in ((-SINK, 0.0), (-SINK, 0.03), (0.01, 0.2)):
        x = np.array([0.1, z, v, -0.02, 2e-6, -1e-6])
        values = [mod.rhs(0.0, x) for mod in mods]
        np.testing.assert_allclose(values[1], values[0], rtol=1e-11, atol=1e-12)  # of a depth of 2e-5 m beside 0.1 m
        slopes = [mod.jacobian(0.0, x) for mod in mods]
        np.testing.assert_allclose(slopes[1], slopes[0], rtol=1e-11, atol=1e-12 * np.abs(slopes[0]).max())


def test_names_of_bristles_are_taken() -> None:
    m = block(0.1, LUGRE)
    m.parameter("touch_bristle_x", 1)
    with pytest.raises(ModelError, match="touch_bristle_x"):
        m.mechanism()
