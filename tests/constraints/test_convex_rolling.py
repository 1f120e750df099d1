"""Ellipsoids and convex bodies that roll: Kane and Levinson's rattleback, balls and discs in other words."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from models import EXAMPLES, reference

import eomgen as eg
from eomgen.errors import ModelError

MASS, INERTIA = 1.3, (0.004, 0.005, 0.007)


def rattleback(flip: bool = True) -> eg.Model:
    """As in the reference: z points down, the plane's normal up."""
    p = reference("rattleback_kane_levinson")["parameters_SI"]
    m = eg.Model("stone", gravity=(0, 0, 9.81))
    stone = m.body(
        "stone", mass=p["M"], com=(0, 0, p["h"]), inertia={"xx": p["A"], "yy": p["B"], "zz": p["C"], "xy": p["D"]}
    )
    m.free("fly", m.ground, stone, sequence="zxy", coordinates=("X", "Y", "Z", "psi", "alpha", "beta"))
    plane = m.ground.at(0, 0, 0, rpy=(math.pi, 0, 0))
    m.rolling("roll", stone, plane, shape="ellipsoid", semi_axes=(p["a"], p["b"], p["c"]))
    for axis in "xyz":
        m.output(f"w{axis}", f"w{axis}_body(stone)")
        m.output(f"a{axis}", f"w{axis}_body_dot(stone)")
    m.independent("psi", "alpha", "beta")
    return m


@pytest.mark.parametrize("method", ["embedding", "augmented", "recursive", "lagrange"])
def test_accelerations_of_kane_and_levinson(method: str) -> None:
    case = reference("rattleback_kane_levinson")["acceleration_test"]
    m = rattleback()
    x, y, z = case["omega"]
    m.initial(alpha=case["alpha"], beta=case["beta"], X=0, Y=0, psi=0.7, wx=x, wy=y, wz=z)
    mod = m.compile(method=method, target="numpy")
    found = mod.outputs(0.0, mod.x0())
    np.testing.assert_allclose(found[::2], case["omega"], atol=1e-12)
    np.testing.assert_allclose(found[1::2], case["omega_dot"], rtol=1e-10)


def test_the_way_of_kane_and_levinson() -> None:
    case = reference("rattleback_kane_levinson")
    m = rattleback()
    start = math.radians(0.5)
    m.initial(alpha=start, beta=start, psi=0, X=0, Y=0, wx=0, wy=0, wz=-5)
    rows = case["trajectory"][:3]
    traj = m.compile().simulate(1.0, rtol=1e-11, atol=1e-13, t_eval=[row["t"] for row in rows])
    for k, row in enumerate(rows):
        for name in ("alpha", "beta", "psi"):
            assert traj[name][k] == pytest.approx(row[name], abs=1e-7)
        assert traj["X"][k] == pytest.approx(row["X"], abs=1e-8)
        assert traj["wx"][k] == pytest.approx(row["omega"][0], abs=1e-6)


def test_the_example_reverses_its_spin() -> None:
    """The same stone in axes that point up: its spin passes 0 where the reference's does, at 2.6 to 2.8 s."""

    traj = eg.load(EXAMPLES / "large" / "rattleback.yaml").compile().simulate(4.0)
    spin = np.asarray(traj["spin"])
    crossings = traj.t[np.flatnonzero(np.diff(np.sign(spin)))]  # several, as the spin swings
    low, *_, high = reference("rattleback_kane_levinson")["spin_zero_crossings_near_s"]
    assert low - 0.05 < np.median(crossings) < high + 0.05
    assert spin[traj.t < 2].min() > 0.5
    assert spin[traj.t > 3.5].max() < -0.5
    assert np.ptp(traj["E"]) < 1e-5 * abs(traj["E"][0])


def ball(**rolling: Any) -> eg.Model:
    m = eg.Model("ball", gravity=(0.4, -0.3, -9.81))
    body = m.body("body", mass=MASS, com=(0.01, 0.02, -0.03), inertia=INERTIA)
    base = m.ground.at(0.1, 0.2, 0.3, rpy=(0.1, -0.2, 0.3))
    m.free("fly", m.ground, body, sequence="zxy")
    m.rolling("roll", body.at(0.01, 0, 0, rpy=(0.2, 0.3, -0.1)), base, **rolling)
    m.guess(fly_z=0.4)
    return m


SAME = {
    "sphere": (
        {"shape": "sphere", "radius": 0.1},
        {"shape": "ellipsoid", "semi_axes": (0.1, 0.1, 0.1)},
        {"shape": "convex", "support": "0.1"},
        {"shape": "convex", "support": "0.1*sqrt(nx**2 + ny**2 + nz**2)"},
    ),
    "disc": (
        {"radius": 0.1, "tube": 0.02},
        {"shape": "convex", "support": "0.02 + 0.08*sqrt(nx**2 + ny**2)"},
        {"shape": "convex", "support": "0.02 + 0.08*sqrt(1 - nz**2)"},
    ),
    "spheroid": (
        {"shape": "ellipsoid", "semi_axes": (0.1, 0.1, 0.06)},
        {"shape": "convex", "support": "sqrt(0.01 - 0.0064*nz**2)"},
    ),
}


@pytest.mark.parametrize("kind", SAME)
def test_the_same_body_in_other_words(kind: str) -> None:
    """Height, slip, reactions and accelerations; a formula may go on beyond unit vectors in any way."""
    mods = [ball(**rolling).compile(target="numpy") for rolling in SAME[kind]]
    rng = np.random.default_rng(8)
    for _ in range(5):
        values = {name: rng.uniform(-0.6, 0.6) for name in mods[0].q_names if name not in ("fly_z",)}
        values |= {name: rng.uniform(-2, 2) for name in ("fly_yaw_dot", "fly_roll_dot") if name in mods[0].v_names}
        x = mods[0].x0(**values)
        x[mods[0].n_q :] = rng.standard_normal(mods[0].n_v)
        x = mods[0].project(x)
        rates = [mod.rhs(0.0, x) for mod in mods]
        assert np.abs(rates[0]).max() > 1
        for one in rates[1:]:
            np.testing.assert_allclose(one, rates[0], rtol=1e-9, atol=1e-9)
        for one in mods[1:]:
            np.testing.assert_allclose(one.jacobian(0.0, x), mods[0].jacobian(0.0, x), rtol=1e-7, atol=1e-6)


def test_an_egg_swings_as_its_curvature_says() -> None:
    """At its lowest point a body of revolution of support h has the radius h + h''; omega by the pendulum's law."""
    m = eg.Model("egg", gravity=(0, 0, -9.81))
    a, c, low = 0.05, 0.004, 0.01  # h = a + c nz^3, centre of mass ``low`` below the marker
    egg = m.body("egg", mass=0.5, com=(0, 0, -low), inertia=(3e-4, 3e-4, 2e-4))
    m.free("fly", m.ground, egg, sequence="xyz", coordinates=("x", "y", "z", "tilt", "lean", "turn"))
    m.rolling("roll", egg, shape="convex", support=f"{a} + {c}*nz**3")
    m.independent("tilt", "lean", "turn")
    m.initial(tilt=0.02)
    m.event("back", "tilt", direction=-1)
    traj = m.compile().simulate(3.0, rtol=1e-10, atol=1e-12)
    h = a - c  # at nz = -1; with nz = -cos(angle), h'' = 3 c
    centre = h - low  # height of the centre of mass
    stiffness = 0.5 * 9.81 * (h + 3 * c - centre)  # of m g (rho - height of the centre of mass)
    omega = math.sqrt(stiffness / (3e-4 + 0.5 * centre**2))
    times = traj.t_events["back"] if isinstance(traj.t_events, dict) else traj.t_events[0]
    assert np.diff(times).mean() == pytest.approx(2 * math.pi / omega, rel=1e-3)


def test_the_ellipsoid_rolls_on_a_plane_that_moves() -> None:
    """Carried by a cart that does not turn, it sees the cart's acceleration as gravity."""
    found = []
    for moving in (False, True):
        m = eg.Model("carried", gravity=(0, 0, -9.81) if moving else (-1.5, 0, -9.81))
        cart = m.body("cart", mass=1)
        m.prismatic("drive", m.ground, cart, axis="x")
        m.driver("motion", "drive", "0.75*t**2" if moving else "0")
        body = m.body("stone", mass=MASS, inertia=INERTIA)
        m.free("fly", cart, body, sequence="zxy", coordinates=("x", "y", "z", "yaw", "roll", "pitch"))
        m.rolling("rock", body, cart, shape="ellipsoid", semi_axes=(0.1, 0.07, 0.05))
        m.initial(roll=0.3, pitch=-0.2, yaw=0.1)
        traj = m.compile().simulate(0.5, rtol=1e-10, atol=1e-12, t_eval=[0.5])
        found.append([traj[name][-1] for name in ("x", "y", "z", "yaw", "roll", "pitch")])
    np.testing.assert_allclose(found[1], found[0], rtol=1e-7, atol=1e-8)


@pytest.mark.parametrize(
    ("keys", "place", "told"),
    [
        ({"shape": "ellipsoid"}, "semi_axes", "is missing; needed where shape is ellipsoid"),
        ({}, "radius", "is missing; needed where shape is disc"),
        ({"shape": "ellipsoid", "semi_axes": (1, 0, 1)}, "semi_axes[1]", "is 0; must be greater than 0"),
        ({"shape": "ellipsoid", "semi_axes": (1, 1)}, "semi_axes", "is not"),
        ({"shape": "ellipsoid", "semi_axes": (1, 1, 1), "radius": 2}, "radius", "only discs and spheres have it"),
        ({"shape": "sphere", "radius": 1, "support": "nx"}, "support", "only convex shapes have it"),
        ({"shape": "convex", "support": "0.1 + n_x"}, "support", "n_x"),
        ({"shape": "cube", "radius": 1}, "shape", "cube"),
        (
            {"shape": "convex", "support": "-0.1"},
            "support",
            "is not of a convex body: its radius of curvature is -0.1 ",
        ),
        ({"shape": "convex", "support": "0.1*nx"}, "support", "a corner: both radii of curvature are 0 where"),
        ({"shape": "convex", "support": "0.1*(abs(nx) + abs(ny) + abs(nz))"}, "support", "a corner"),
        ({"shape": "convex", "support": "0.1 + 0.11*nz**2"}, "support", "is not of a convex body"),
        ({"shape": "convex", "support": "log(-1 - nx**2)"}, "support", "is not a number"),
    ],
)
def test_what_is_wrong_is_told(keys: dict[str, Any], place: str, told: str) -> None:
    m = eg.Model("wrong")
    body = m.body("body", mass=1, inertia=INERTIA)
    m.free("fly", m.ground, body)
    with pytest.raises((ModelError, eg.errors.UsageError)) as error:
        m.rolling("roll", body, **keys)
        m.mechanism()
    assert told in str(error.value)
    assert place in str(error.value)


@pytest.mark.parametrize("c", [-0.06, -0.04, 0.09, 0.11])
def test_convex_where_a_meridian_is(c: float) -> None:
    """h = 0.1 + c nz^2 has along a meridian, nz = sin(s), the radius h + h'': which at the equator is 0.1 + 2 c."""
    s = np.linspace(-math.pi / 2, math.pi / 2, 2001)
    along = 0.1 + c * np.sin(s) ** 2 + 2 * c * np.cos(2 * s)
    across = 0.1 + c * np.sin(s) ** 2 - 2 * c * np.sin(s) ** 2  # h - h' tan(s)
    m = ball(shape="convex", support=f"0.1 + {c}*nz**2")
    if min(along.min(), across.min()) > 0:
        m.derive()
    else:
        with pytest.raises(ModelError, match="roll.support: is not of a convex body"):
            m.derive()
    late = ball(shape="convex", support="0.1 + c*nz**2")
    late.parameter("c")
    late.derive()  # it is not known yet


def test_a_marker_may_lie_outside_the_body() -> None:
    """A ball about a point 0.3 from the marker: that of a marker at its centre."""
    m = eg.Model("aside", gravity=(0, 0.5, -9.81))
    body = m.body("body", mass=MASS, inertia=INERTIA)
    m.free("fly", m.ground, body, sequence="zxy")
    other = eg.Model("centre", gravity=(0, 0.5, -9.81))
    twin = other.body("body", mass=MASS, inertia=INERTIA)
    other.free("fly", other.ground, twin, sequence="zxy")
    m.rolling("roll", body, shape="convex", support="0.1 + 0.3*nx")
    other.rolling("roll", twin.at(0.3, 0, 0), shape="sphere", radius=0.1)
    mod, same = m.compile(target="numpy"), other.compile(target="numpy")
    x = same.project(np.array([0.1, 0.2, 0.15, 0.3, 0.2, -0.4, *np.random.default_rng(4).standard_normal(6)]))
    np.testing.assert_allclose(mod.rhs(0.0, x), same.rhs(0.0, x), rtol=1e-10, atol=1e-10)
    assert np.abs(mod.rhs(0.0, x)).max() > 1


def test_a_sharp_edge_rolls_as_a_disc() -> None:
    mod, same = (ball(**keys).compile(target="numpy") for keys in (
        {"shape": "convex", "support": "0.1*sqrt(nx**2 + ny**2)"}, {"radius": 0.1}
    ))  # fmt: skip
    x = same.project(np.array([0.1, 0.2, 0.4, 0.3, 0.2, -0.4, *np.random.default_rng(4).standard_normal(6)]))
    np.testing.assert_allclose(mod.rhs(0.0, x), same.rhs(0.0, x), rtol=1e-9, atol=1e-9)
