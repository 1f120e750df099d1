"""Rigid wheels on soil: sinkage, compaction resistance and drawbar against Bekker, Wong and Reece, and SciPy."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.special import beta

import eomgen as eg
from eomgen.errors import ModelError

G = 9.81
R, B = 0.5, 0.3
SOIL = {
    "soil": "own", "sinkage_exponent": 0.8, "cohesive_modulus": 2e4, "frictional_modulus": 1.5e6,
    "cohesion": 1e3, "friction_angle": 0.5, "shear_modulus": 0.025,
}  # fmt: skip
SMOOTH = {**SOIL, "cohesion": 0.0, "friction_angle": 0.0, "rebound": 1e-9}
PEAK = (0.18, 0.32)
WORST = 5e-4  #: Gauss's rule of 8 nodes on z^n at the edge of the arc; it is 2e-5 where n is 0.8


def stiffness(law: dict[str, Any]) -> float:
    return law["cohesive_modulus"] / B + law["frictional_modulus"]


def wheel(law: dict[str, Any], mass: Any = 300.0, ground: Any = None) -> eg.Model:
    m = eg.Model("wheel", gravity=(0, -G, 0))
    body = m.body("wheel", mass=mass, inertia={"zz": 20.0})
    m.planar("j", m.ground, body)
    shape = {"shape": "circle", "on": body, "radius": R, "width": B}
    m.contacts("soil", shape, ground or {"shape": "half_plane", "on": m.ground}, law)
    return m


def forces(mod: Any, depth: float, forward: float, spin: float, sink: float = 0.0) -> np.ndarray:
    """Force along and up and the moment about z, of a wheel that rolls along x with a spin about -z."""
    return many_forces(mod, np.array([[depth], [forward], [spin], [sink]]))[:, 0]


def many_forces(mod: Any, motions: np.ndarray) -> np.ndarray:
    """The same of many wheels at once: columns of depth, forward, spin, sink."""
    x = np.zeros((6, motions.shape[1]))
    names = list(mod.x_names)
    x[[names.index(name) for name in ("j_y", "j_x_dot", "j_3_dot", "j_y_dot")]] = motions * [[-1], [1], [-1], [-1]]
    x[names.index("j_y")] += R
    return np.array(-mod.bias(0.0, x) + np.array([[0.0], [300.0 * G], [0.0]]))


def by_quadrature(law: dict[str, Any], depth: float, forward: float, spin: float) -> np.ndarray:
    """The same by adaptive quadrature of the formulas of Bekker, Wong and Reece."""
    n, K, c = law["sinkage_exponent"], law["shear_modulus"], law["cohesion"]
    k, phi = stiffness(law), math.tan(law["friction_angle"])
    a1 = math.acos(1 - depth / R)
    top, drop = k * depth**n, 0.1 * depth
    peak = None
    if "peak_angle" in law:
        c1, c2 = law["peak_angle"]
        slip = abs(R * spin - forward) / max(abs(R * spin), abs(forward))
        peak = min(a1, (c1 + c2 * slip) * a1)

    def pressure(a: float) -> float:
        if peak is not None and a < peak:
            a = a1 - (a1 - peak) * a / peak
        if a < 0:
            return top - top / drop * R * (1 - math.cos(a))
        return k * max(0.0, R * (math.cos(a) - math.cos(a1))) ** n

    def shear(a: float) -> float:
        j = R * ((a1 - a) - forward / (R * spin) * (math.sin(a1) - math.sin(a)))
        return (c + pressure(a) * phi) * (1 - math.exp(-abs(j) / K)) * math.copysign(1, j)

    ends = [-math.acos(1 - drop / R), 0.0, a1] if peak is None else [0.0, peak, a1]

    def over(f: Any) -> float:
        parts = itertools.pairwise(ends)
        return B * R * sum(quad(f, low, high, epsabs=1e-9, epsrel=1e-11, limit=300)[0] for low, high in parts)

    return np.array(
        [
            over(lambda a: shear(a) * math.cos(a) - pressure(a) * math.sin(a)),
            over(lambda a: pressure(a) * math.cos(a) + shear(a) * math.sin(a)),
            R * over(shear),
        ]
    )


@pytest.mark.parametrize("n", [0.2, 0.5, 0.8, 1.0, 1.6])
def test_compaction_resistance_of_bekker(n: float) -> None:
    """R_c = b k z^(n+1) / (n+1), the work that presses a rut of the depth z; at any depth of the wheel."""
    law = {**SMOOTH, "sinkage_exponent": n}
    mod = wheel(law).compile(target="numpy")
    for depth in (0.002, 0.03, 0.2):
        along, _, moment = forces(mod, depth, 1.0, 2.0)
        assert -along == pytest.approx(B * stiffness(law) * depth ** (n + 1) / (n + 1), rel=1e-4)
        assert abs(moment) < 1e-6


@pytest.mark.parametrize("n", [0.2, 0.5, 1.0, 1.6])
def test_sinkage_of_bekker(n: float) -> None:
    """W = b k z^n sqrt(z D) I, I = (3 - n) / 3 of Bekker, exact for n = 1; else B(1/2, n+1) / 2."""
    law = {**SMOOTH, "sinkage_exponent": n}
    mod = wheel(law).compile(target="numpy")
    depth = 2e-4 * R
    _, up, _ = forces(mod, depth, 1.0, 2.0)
    whole = B * stiffness(law) * depth**n * math.sqrt(2 * R * depth)
    assert up == pytest.approx(0.5 * beta(0.5, n + 1) * whole, rel=3e-4)
    if n == 1:
        load = up
        sunk = (3 * load / (B * (3 - n) * stiffness(law) * math.sqrt(2 * R))) ** (2 / (2 * n + 1))
        assert sunk == pytest.approx(depth, rel=3e-4)


@pytest.mark.parametrize("law", [SOIL, {**SOIL, "peak_angle": PEAK}, {**SOIL, "sinkage_exponent": 0.2},
                                 {**SOIL, "sinkage_exponent": 1.6, "shear_modulus": 0.01}])  # fmt: skip
def test_forces_by_another_quadrature(law: dict[str, Any]) -> None:
    mod = wheel(law).compile(target="numpy")
    for depth in (0.01, 0.06, 0.2):
        for slip in (-0.5, -0.1, 0.05, 0.2, 0.6):
            forward, spin = (1.0, 1.0 / (1 - slip) / R)
            found, wanted = forces(mod, depth, forward, spin), by_quadrature(law, depth, forward, spin)
            np.testing.assert_allclose(found, wanted, rtol=0, atol=WORST * np.abs(wanted).max())


@pytest.mark.parametrize("law", [SOIL, {**SOIL, "peak_angle": PEAK}])
def test_a_wheel_that_rolls_back_is_its_mirror_image(law: dict[str, Any]) -> None:
    mod = wheel(law).compile(target="numpy")
    there, back = forces(mod, 0.05, 0.7, 1.9), forces(mod, 0.05, -0.7, -1.9)
    np.testing.assert_allclose(back * [-1, 1, -1], there, rtol=1e-12)


@pytest.mark.parametrize(
    "law", [SOIL, {**SOIL, "peak_angle": PEAK}, {**SOIL, "sinkage_exponent": 0.2, "cohesion": 5e3}]
)
def test_no_motion_gains_energy(law: dict[str, Any]) -> None:
    """Of random motions along the ground and spins, from creeping to rolling, slipping, locked and opposed."""
    mod = wheel(law).compile(target="numpy")
    rng, motions = np.random.default_rng(5), []
    for _ in range(1500):
        depth = rng.uniform(1e-3, 0.3)
        forward, spin = rng.standard_normal(2) * 10 ** rng.uniform(-4, 1, 2)
        if rng.random() < 0.5:
            spin = forward / R * (1 + 0.1 * rng.standard_normal())
        motions.append((depth, forward, spin, 0.0))
    _, forward, spin, _ = rows = np.array(motions).T
    along, _, moment = many_forces(mod, rows)
    assert (along * forward - moment * spin < 0).all()


@pytest.mark.parametrize("law", [SOIL, {**SOIL, "sinkage_exponent": 1.6, "rebound": 1.0}])
def test_no_bounce_gains_energy(law: dict[str, Any]) -> None:
    """Of random motions with a rate of sinkage: beside what the load of a wheel at rest would take, all power is lost.

    That load is a function of the sinkage, so that its work of a closed cycle is 0.
    """
    mod = wheel(law).compile(target="numpy")
    rng = np.random.default_rng(6)
    for _ in range(120):
        depth, sink = rng.uniform(1e-3, 0.3), rng.standard_normal() * 10 ** rng.uniform(-3, 1)
        forward, spin = rng.standard_normal(2) * 10 ** rng.uniform(-3, 1, 2)
        if rng.random() < 0.5:
            spin = forward / R * (1 + 0.3 * rng.standard_normal())
        along, up, moment = forces(mod, depth, forward, spin, sink)
        rest = forces(mod, depth, 0.0, 0.0)[1]
        size = rest * (abs(forward) + abs(sink) + R * abs(spin))
        assert along * forward - moment * spin - (up - rest) * sink <= 1e-12 * size


def test_no_cycle_of_sinkage_and_slip_gains_energy() -> None:
    """A wheel sinks while it brakes and rises while it drives, or the other way round, faster than it rolls."""
    mod = wheel({"soil": "dry_sand"}).compile(target="numpy")
    depths = np.linspace(0.03, 0.09, 7)
    for forward, sink, slip in ((0.1, 0.6, 0.2), (0.1, 1.0, 0.2), (0.2, 1.5, 0.2)):
        for way in (1, -1):
            work = 0.0
            for depth in 0.5 * (depths[1:] + depths[:-1]):
                for side in (1, -1):
                    spin = forward * (1 - slip if side * way > 0 else 1 / (1 - slip)) / R
                    along, up, moment = forces(mod, depth, forward, spin, side * sink)
                    power = along * forward - moment * spin - up * side * sink
                    work += power * (depths[1] - depths[0]) / sink
            assert work < -1.0


def test_greatest_pressure_stays_inside_the_arc() -> None:
    """At 0.9 of the angle of entry or less: the wheel carries at any c1 + c2 |i|, as it does at c1 = 0.9."""
    wide, bound = (wheel({**SOIL, "peak_angle": pair}).compile(target="numpy") for pair in ([0.8, 0.32], [0.9, 0.0]))
    for spin in (0.0, 0.6):
        found = forces(wide, 0.1, 1.0, spin)
        assert found[1] > 100.0
        np.testing.assert_allclose(found, forces(bound, 0.1, 1.0, spin), rtol=1e-9)
    assert np.abs(forces(wide, 0.1, 1.0, 2.0) - forces(bound, 0.1, 1.0, 2.0)).max() > 1.0  # of a slip of 0: at 0.8


def test_pressing_and_lifting_a_wheel_that_stands() -> None:
    """Without dissipation the force is that of the sinkage; with it pressing takes more than lifting gives."""
    bare, damped = (wheel({**SOIL, "dissipation": x}).compile(target="numpy") for x in (0.0, 0.8))
    for rate in (-0.3, 0.3):
        plain = forces(bare, 0.05, 0.0, 0.0, rate)[1]
        assert plain == pytest.approx(forces(bare, 0.05, 0.0, 0.0)[1], rel=1e-12)
        assert forces(damped, 0.05, 0.0, 0.0, rate)[1] == pytest.approx((1 + 0.8 * rate) * plain, rel=1e-12)


@pytest.mark.parametrize("target", ["numpy", "cython"])
@pytest.mark.parametrize("peak", [{}, {"peak_angle": PEAK}])
def test_exact_derivatives(target: str, peak: dict[str, Any]) -> None:
    m = eg.Model("wheel", gravity=(0, -G, 0))
    phi = m.parameter("phi", 0.5)
    body = m.body("wheel", mass=300.0, inertia={"zz": 20.0})
    m.planar("j", m.ground, body)
    law = {**SOIL, "friction_angle": phi, "dissipation": 0.5, **peak}
    shape = {"shape": "circle", "on": body, "radius": m.parameter("r", R), "width": B}
    m.contacts("soil", shape, {"shape": "half_plane", "on": m.ground}, law)
    mod = m.compile(target=target)
    for depth, forward, spin, sink, h in (
        (0.06, 1.0, 2.4, 0.05, 1e-6), (0.02, -0.003, 0.01, 0.05, 1e-6), (-0.1, 1.0, 2.0, 0.05, 1e-6),
        (0.06, 0.0, 0.0, 0.0, 1e-9),  # where the slope of j (1 - |j| / (2 K)) turns; pressed in, the shear's bound does
    ):  # fmt: skip
        x = mod.x0(j_y=R - depth, j_x_dot=forward, j_y_dot=-sink, j_3_dot=-spin)
        step = h * np.eye(len(x))
        wanted = np.array([(mod.rhs(0.0, x + e) - mod.rhs(0.0, x - e)) / (2 * h) for e in step]).T
        tolerance = 1e-6 if h == 1e-6 else 1e-5
        np.testing.assert_allclose(mod.jacobian(0.0, x), wanted, rtol=tolerance, atol=tolerance * np.abs(wanted).max())
        for k, (name, at) in enumerate((("phi", 0.5), ("r", R))):
            by = (mod.rhs(0.0, x, p={name: at + 1e-7}) - mod.rhs(0.0, x, p={name: at - 1e-7})) / 2e-7
            found = mod.parameter_jacobian(0.0, x)[:, k]
            np.testing.assert_allclose(found, by, rtol=1e-6, atol=1e-6 * max(1.0, np.abs(by).max()))


def test_on_other_grounds_and_in_turned_frames() -> None:
    flat = {"shape": "profile", "points": [[-3, 0], [0.4, 0], [3, 0]], "depth": 1.0}
    values = []
    for turn, ground in ((0.0, {"shape": "half_plane"}), (0.0, flat), (0.7, {"shape": "half_plane"})):
        c, s = math.cos(turn), math.sin(turn)
        m = eg.Model("turned", gravity=(G * s, -G * c, 0))
        body = m.body("wheel", mass=10.0, inertia={"zz": 2.0})
        m.planar("j", m.ground, body)
        at = m.ground.at(0, 0, 0, rpy=(0, 0, turn))
        m.contacts("soil", {"shape": "circle", "on": body, "radius": R, "width": B}, {**ground, "on": at}, SOIL)
        mod = m.compile(target="numpy")
        x = mod.x0(j_x=c * 0.2 - s * 0.45, j_y=s * 0.2 + c * 0.45, j_3=0.3)
        v = (0.4, -0.1)
        x[3:6] = [c * v[0] - s * v[1], s * v[0] + c * v[1], -0.9]
        rates = mod.rhs(0.0, x)
        values.append([c * rates[3] + s * rates[4], -s * rates[3] + c * rates[4], rates[5]])
    np.testing.assert_allclose(values[1], values[0], rtol=1e-9)
    np.testing.assert_allclose(values[2], values[0], rtol=1e-11)


def test_momentum_is_kept() -> None:
    """A wheel on a free body that turns: forces and moments of both add up to none."""
    m = eg.Model("pair", gravity=(0, 0, 0))
    bodies = [m.body(f"b{k}", mass=2.0 + k, inertia=(0.4, 0.5, 0.3 + 0.3 * k)) for k in range(2)]
    for k, body in enumerate(bodies):
        m.free(f"j{k}", m.ground, body, rotation="euler_parameters")
    ground = {"shape": "half_plane", "on": bodies[0]}
    m.contacts("soil", {"shape": "circle", "on": bodies[1], "radius": R, "width": B}, ground, SOIL)
    mod = m.compile(target="numpy")
    rng, pressed = np.random.default_rng(8), 0
    for _ in range(100):
        x = np.array(mod.x0(j1_y=R - 0.1))
        x[[0, 1, 2, 7, 8, 9]] += rng.uniform(-0.05, 0.05, 6)
        for k in (3, 10):
            turn = [1.0, *rng.uniform(-0.1, 0.1, 3)]
            x[k : k + 4] = turn / np.linalg.norm(turn)
        x[14:] = rng.standard_normal(12)
        force = mod.rhs(0.0, x)[14:]
        linear = 2.0 * force[0:3] + 3.0 * force[6:9]
        size = np.abs(2.0 * force[0:3]).max()
        pressed += size > 1.0
        assert np.abs(linear).max() <= 1e-10 * max(size, 1.0)
    assert pressed > 50


def test_a_driven_wheel_comes_to_the_slip_of_its_torque() -> None:
    """A run to the steady state: load, torque and drawbar are those of the quadrature at its sinkage and slip."""
    m = wheel({**SOIL, "dissipation": 2.0})
    m.torque("drive", "wheel", (0, 0, -700.0))
    m.force("pull", "wheel", (-600.0, 0, 0))
    mod = m.compile()
    run = mod.simulate(6.0, initial={"j_y": R - 0.02, "j_x_dot": 0.5, "j_3_dot": -1.0}, rtol=1e-8, atol=1e-9)
    depth, forward, spin = R - run["j_y"][-1], run["j_x_dot"][-1], -run["j_3_dot"][-1]
    along, up, moment = by_quadrature(SOIL, depth, forward, spin)
    ax, _, alpha = mod.rhs(0.0, run.x[:, -1])[3:]
    assert up == pytest.approx(300 * G, rel=2e-3)
    assert along - 600.0 == pytest.approx(300.0 * ax, abs=1.0)
    assert moment - 700.0 == pytest.approx(20.0 * alpha, abs=1.0)


def test_verify_and_file(tmp_path: Any) -> None:
    m = wheel(SOIL)
    file = tmp_path / "wheel.yaml"
    file.write_text(m.to_yaml())
    a, b = m.compile(target="numpy"), eg.load(file).compile(target="numpy")
    x = a.x0(j_y=R - 0.03, j_x_dot=0.4, j_3_dot=-1.0)
    np.testing.assert_array_equal(a.rhs(0.0, x), b.rhs(0.0, x))
    assert a.verify().ok


def test_sinkage_at_rest_by_equilibrium() -> None:
    """The depth at which a wheel that stands carries its load is the root of SciPy's sum of pressures."""
    law = {**SMOOTH, "dissipation": 1.0}
    mod = wheel(law).compile(target="numpy")
    n, k = law["sinkage_exponent"], stiffness(law)

    def load(depth: float) -> float:
        a1 = math.acos(1 - depth / R)
        return B * R * quad(lambda a: k * (R * (math.cos(a) - math.cos(a1))) ** n * math.cos(a), 0, a1)[0]

    depth = brentq(lambda z: load(z) - 300 * G, 1e-4, 0.2)
    assert forces(mod, depth, 0.0, 0.0)[1] == pytest.approx(300 * G, rel=1e-4)


@pytest.mark.parametrize(
    ("law", "place", "told"),
    [
        ({**SOIL, "peak_angle": [0.4]}, "peak_angle", "two"),
        ({**SOIL, "peak_angle": [0, 0.3]}, "peak_angle[0]", "is 0; is above 0 and at most 1"),
        ({**SOIL, "peak_angle": [0.4, 0.3], "rebound": 0.1}, "rebound", "is of the rear of wheels without peak_angle"),
        ({**SOIL, "reversal": 0}, "reversal", "is 0; must be greater than 0"),
        ({**SOIL, "recovery": 0.1}, "recovery", "has no meaning for wheels"),
    ],
)
def test_what_is_wrong_is_told(law: dict[str, Any], place: str, told: str) -> None:
    with pytest.raises(ModelError) as error:
        wheel(law).mechanism()
    found = {p.path: f"{p.message}; {p.remedy}" for p in error.value.problems}
    assert told in found.get(f"forces.soil.{place}", f"nothing there: {found}"), found


def test_wheels_and_circles() -> None:
    m = wheel({"stiffness": 1e4})
    ground = {"shape": "half_plane", "on": m.ground}
    plate = {"shape": "plate", "on": "wheel", "length": 0.2, "width": 0.3}
    m.contacts("both", [{"shape": "circle", "on": "wheel", "radius": R, "width": B}, plate], ground, SOIL)
    m.contacts("bare", {"shape": "circle", "on": "wheel", "radius": R}, ground, {**SOIL, "recovery": 0.05})
    m.contacts("thin", {"shape": "circle", "on": "wheel", "radius": R, "width": 0}, ground, SOIL)
    with pytest.raises(ModelError) as error:
        m.mechanism()
    told = str(error.value)
    assert "has a circle with a width, which belongs to wheels on soil" in told
    assert "has wheels and plates" in told
    assert "a circle does not lie on soil" in told
    assert "circles that have a width" in told
    assert "width: is 0; must be greater than 0" in told
