"""Soil under plates: sinkage, unloading and shear against closed forms and published examples of Wong."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import eomgen as eg
from eomgen.errors import ModelError
from eomgen.forces.soils import SOILS

G = 9.81
#: The soil of Wong, Theory of Ground Vehicles (2008), example 2.3, in SI units.
EXAMPLE = {
    "soil": "own", "sinkage_exponent": 1.6, "cohesive_modulus": 4.37e3, "frictional_modulus": 196.72e3,
    "cohesion": 1.0e3, "friction_angle": math.radians(19.7), "shear_modulus": 0.05,
    "recovery": 0.05,
}  # fmt: skip


def plate(law: dict[str, Any], mass: Any = 100.0, sizes: Any = (0.5, 0.3), ground: Any = None, **more: Any) -> eg.Model:
    """A plate that moves along x and y, with an input force along each."""
    m = eg.Model("plate", gravity=(0, -G, 0))
    m.body("cart", mass=0)
    body = m.body("sole", mass=mass)
    m.prismatic("x", m.ground, "cart", axis="x")
    m.prismatic("y", "cart", body, axis="y")
    m.force("pull", body, ("P", "N", 0))
    m.input("P")
    m.input("N")
    shape = {"shape": "plate", "on": body, "length": sizes[0], "width": sizes[1], **more}
    m.contacts("soil", shape, ground or {"shape": "half_plane", "on": m.ground}, law)
    return m


def wong(z: Any, deepest: Any, k: float, n: float, rebound: float = 0.1) -> Any:
    """Pressure at a sinkage below the greatest one so far."""
    most = np.maximum(z, deepest)
    top = k * most**n
    return np.maximum(top - top / (rebound * most) * (most - z), 0.0)


def test_table_in_two_units() -> None:
    """Wong's table gives kc and kphi in lb and inches too; a slip of a digit in one of them would show."""
    imperial = {  # kc lb/in^(n+1), kphi lb/in^(n+2), c lb/in^2
        "dry_sand": (0.1, 3.9, 0.15), "sandy_loam_15": (2.3, 16.8, 0.25), "sandy_loam_22": (7, 3, 0.2),
        "sandy_loam_michigan_11": (11, 6, 0.7), "sandy_loam_michigan_23": (15, 27, 1.4),
        "sandy_loam_hanamoto_26": (5.3, 6.8, 2.0), "sandy_loam_hanamoto_32": (0.7, 1.2, 0.75),
        "clayey_soil_38": (12, 16, 0.6), "clayey_soil_55": (7, 14, 0.3), "heavy_clay_25": (45, 140, 10),
        "heavy_clay_40": (7, 10, 3), "lean_clay_22": (45, 120, 10), "lean_clay_32": (5, 10, 2),
    }  # fmt: skip
    pound, inch = 4.4482216, 0.0254
    for name, (kc, kphi, c) in imperial.items():
        soil = SOILS[name]
        assert soil.cohesive == pytest.approx(kc * pound / inch ** (soil.exponent + 1), rel=0.1), name
        assert soil.frictional == pytest.approx(kphi * pound / inch ** (soil.exponent + 2), rel=0.1), name
        assert soil.cohesion == pytest.approx(c * pound / inch**2, rel=0.02), name


@pytest.mark.parametrize(("width", "length", "sinkage"), [(1.0, 3.6, 0.227), (0.8, 4.5, 0.226)])
def test_sinkage_of_tracks_in_a_published_example(width: float, length: float, sinkage: float) -> None:
    """Wong, example 2.3: 135 kN on two tracks of one area, 7.2 m^2, and two shapes."""
    m = plate(EXAMPLE, 67.5e3 / G, (length, width))
    mod = m.compile(target="numpy")
    x = mod.x0(y=-sinkage)
    places = [k for k, name in enumerate(mod.x_names) if "sinkage" in name]
    low, high = 0.1, 0.4
    for _ in range(60):
        x[1] = -0.5 * (low + high)
        x[places] = -x[1]
        if mod.rhs(0.0, x)[3] > 0:
            high = -x[1]
        else:
            low = -x[1]
    assert -x[1] == pytest.approx(sinkage, abs=5e-4)


def test_pressed_unloaded_and_reloaded() -> None:
    """A load that rises and falls twice: the force follows the closed form of the greatest sinkage so far."""
    soil = SOILS["clayey_soil_38"]
    m = plate({"soil": "clayey_soil_38", "lateral": False})
    mod = m.compile()
    load = "-500*t - (1500 + 600*t)*(1 - cos(2*pi*t))"
    times = np.linspace(0, 2, 401)
    traj = mod.simulate((0, 2), initial={"y": 1e-4}, inputs={"N": load}, t_eval=times, rtol=1e-9, atol=1e-11)
    z = -traj["y"]
    fine = mod.simulate((0, 2), initial={"y": 1e-4}, inputs={"N": load}, rtol=1e-9, atol=1e-11)
    held = traj["soil_sinkage_1"]
    assert np.all(np.diff(held[5:]) >= -1e-10)
    k = soil.cohesive / 0.3 + soil.frictional
    area = 0.5 * 0.3
    applied = np.array([-500 * t - (1500 + 600 * t) * (1 - np.cos(2 * np.pi * t)) for t in times])
    states = np.array([mod.rhs(t, x, u=[0.0, a]) for t, x, a in zip(times, traj.x.T.copy(), applied, strict=True)])
    found = 100.0 * (states[:, 3] + G) - applied
    deepest = np.array([max(-fine["y"][fine.t <= t].min(initial=0.0), z[: i + 1].max()) for i, t in enumerate(times)])
    inside = z > 0
    wanted = area * wong(z[inside], deepest[inside], k, soil.exponent)
    assert np.abs(found[inside] - wanted).max() < 2e-3 * wanted.max()
    assert np.count_nonzero(z < 0.99 * deepest) > 40
    assert np.abs(found[~inside]).max(initial=0.0) < 1e-9


def test_slope_of_unloading_by_two_numbers() -> None:
    """p_m - (k_0 + A_u z_m) (z_m - z), where it is steeper than the line to z = 0."""
    numbers = {**EXAMPLE, "unloading_stiffness": 2e6, "unloading_rise": 4e7}
    mod = plate(numbers).compile(target="numpy")
    k = 4.37e3 / 0.3 + 196.72e3
    names = list(mod.x_names)
    for deepest, z in ((0.05, 0.0495), (0.05, 0.049), (0.05, 0.04), (0.2, 0.199)):
        x = mod.x0(y=-z)
        x[[names.index(f"soil_sinkage_{j}") for j in (1, 2)]] = deepest
        top = k * deepest**1.6
        p = max(0.0, top - max(2e6 + 4e7 * deepest, top / deepest) * (deepest - z))
        assert mod.rhs(0.0, x)[3] == pytest.approx(0.15 * p / 100.0 - G, rel=1e-12)


def test_thrust_of_a_track_against_slip() -> None:
    """Wong's F = (A c + W tan phi) (1 - K / (i L) (1 - exp(-i L / K))), of plates that pass under a track one by one.

    A link begins at the front with no shear and slides i v t; the mean over its way is that over the links of a track.
    """
    L, K, c, phi = 3.6, 0.05, 1.0e3, math.radians(19.7)
    mod = plate({**EXAMPLE, "lateral": False}, 500.0, (0.2, 1.0)).compile(target="numpy")
    names = list(mod.x_names)
    z = 0.1
    places = [names.index(f"soil_sinkage_{j}") for j in (1, 2)]
    shears = [names.index(f"soil_shear_{j}") for j in (1, 2)]
    pressure = (4.37e3 / 1.0 + 196.72e3) * z**1.6
    for slip in (0.05, 0.1, 0.2, 0.4, 0.8):
        v = slip * 1.0  # of a track that runs with 1 m/s

        def rates(t: float, s: np.ndarray, v: float = v) -> np.ndarray:
            x = mod.x0(y=-z, x_dot=v)
            x[places] = z
            x[shears] = s[:2]
            out = mod.rhs(0.0, x)
            return np.array([*out[shears], -500.0 * out[2]])  # and the impulse of shear

        found = solve_ivp(rates, (0, L), np.zeros(3), rtol=1e-9, atol=1e-10).y[2, -1] / L
        area = 0.2
        whole = area * c + area * pressure * math.tan(phi)
        assert found == pytest.approx(whole * (1 - K / (slip * L) * (1 - math.exp(-slip * L / K))), rel=1e-6)


@pytest.mark.parametrize("name", ["dry_sand", "clayey_soil_38", "lete_sand", "upland_sandy_loam_51"])
def test_drawbar_of_a_track_on_tabulated_soils(name: str) -> None:
    """F = (A c + W tan phi) (1 - K / (i L) (1 - exp(-i L / K))) against slip, with Wong's numbers of the soils.

    K is in his table of none of them; 0.01 m of firm sand stands for the last two.
    """
    soil, L, width, z = SOILS[name], 2.0, 0.4, 0.03
    K, phi = soil.shear or 0.01, math.radians(soil.angle)
    law = {"soil": name, "lateral": False, **({} if soil.shear else {"shear_modulus": K})}
    mod = plate(law, 500.0, (0.2, width)).compile(target="numpy")
    names = list(mod.x_names)
    places, shears = ([names.index(f"soil_{what}_{j}") for j in (1, 2)] for what in ("sinkage", "shear"))
    load = 0.2 * width * (soil.cohesive / width + soil.frictional) * z**soil.exponent
    for slip in (0.05, 0.2, 0.6):

        def rates(t: float, s: np.ndarray, slip: float = slip) -> np.ndarray:
            x = mod.x0(y=-z, x_dot=slip)
            x[places], x[shears] = z, s[:2]
            out = mod.rhs(0.0, x)
            return np.array([*out[shears], -500.0 * out[2]])

        found = solve_ivp(rates, (0, L), np.zeros(3), rtol=1e-9, atol=1e-10).y[2, -1] / L
        whole = 0.2 * width * soil.cohesion + load * math.tan(phi)
        assert found == pytest.approx(whole * (1 - K / (slip * L) * (1 - math.exp(-slip * L / K))), rel=1e-6)


def test_shear_turns_back_within_its_strength() -> None:
    """Stress falls and rises the other way with the same modulus, and never exceeds c + p tan phi."""
    mod = plate({**EXAMPLE, "lateral": False}).compile(target="numpy")
    names = list(mod.x_names)
    z, K = 0.1, 0.05

    def rates(t: float, s: np.ndarray) -> np.ndarray:
        x = mod.x0(y=-z, x_dot=0.3 * (1 if t < 1 else -1))
        x[[names.index(f"soil_sinkage_{j}") for j in (1, 2)]] = z
        x[[names.index(f"soil_shear_{j}") for j in (1, 2)]] = s
        return mod.rhs(0.0, x)[[names.index(f"soil_shear_{j}") for j in (1, 2)]]

    there = solve_ivp(rates, (0, 1), np.zeros(2), rtol=1e-10, atol=1e-12).y[0, -1]
    assert there == pytest.approx(K * (1 - math.exp(-0.3 / K)), rel=1e-8)
    back = solve_ivp(rates, (1.0 + 1e-12, 1.2), [there, there], rtol=1e-10, atol=1e-12).y[0, -1]
    s = there / K
    assert back / K == pytest.approx(-1 + (1 + s) * math.exp(-0.06 / K), rel=1e-8)


def test_a_lifted_plate_forgets() -> None:
    mod = plate({**EXAMPLE, "recovery": 0.02}).compile(target="numpy")
    names = list(mod.x_names)
    x = mod.x0(y=0.1)
    x[names.index("soil_sinkage_1")], x[names.index("soil_shear_x_2")] = 0.3, -0.01
    rates = mod.rhs(0.0, x)
    assert rates[names.index("soil_sinkage_1")] == pytest.approx(-0.3 / 0.02, rel=1e-13)
    assert rates[names.index("soil_shear_x_2")] == pytest.approx(0.01 / 0.02, rel=1e-13)
    assert rates[3] == pytest.approx(-G)


@pytest.mark.parametrize("count", [2, 3, 5])
def test_force_and_moment_of_a_tilted_plate(count: int) -> None:
    """A linear soil: p = k z; force and moment are those of a trapezoid of pressure, whatever the number of points."""
    m = eg.Model("tilted", gravity=(0, 0, 0))
    body = m.body("sole", mass=10.0, inertia={"zz": 2.0})
    m.planar("j", m.ground, body)
    law = {**EXAMPLE, "sinkage_exponent": 1.0, "rebound": 1.0, "cohesion": 0.0, "friction_angle": 0.0}
    shape = {"shape": "plate", "on": body, "length": 0.6, "width": 0.3, "points": count}
    m.contacts("soil", shape, {"shape": "half_plane", "on": m.ground}, law)
    mod = m.compile(target="numpy")
    turn, z = 0.1, 0.06
    rates = mod.rhs(0.0, mod.x0(j_y=-z, j_3=turn))
    k, area = 4.37e3 / 0.3 + 196.72e3, 0.6 * 0.3
    assert rates[4] == pytest.approx(k * z * area / 10.0, rel=1e-12)
    moment = -k * math.sin(turn) * math.cos(turn) * 0.3 * 0.6**3 / 12
    assert rates[5] == pytest.approx(moment / 2.0, rel=1e-12)


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_exact_derivatives(target: str) -> None:
    m = eg.Model("tilted", gravity=(0, -G, 0))
    phi = m.parameter("phi", 0.5)
    body = m.body("sole", mass=10.0, inertia={"zz": 2.0})
    m.planar("j", m.ground, body)
    shape = {"shape": "plate", "on": body, "length": 0.6, "width": 0.3}
    law = {"soil": "dry_sand", "friction_angle": phi, "dissipation": 0.5}
    m.contacts("soil", shape, {"shape": "half_plane", "on": m.ground}, law)
    mod = m.compile(target=target)
    x = mod.x0(j_y=-0.06, j_3=0.05, j_x_dot=0.3, j_y_dot=-0.1, j_3_dot=0.2)
    x[6:] = [0.004, 0.001, 0.02, -0.003, 0.0, 0.08]  # one point loads, the other unloads
    units, step = np.eye(len(x)), 1e-7
    wanted = np.array([(mod.rhs(0.0, x + step * e) - mod.rhs(0.0, x - step * e)) / (2 * step) for e in units]).T
    found = mod.jacobian(0.0, x)
    np.testing.assert_allclose(found, wanted, rtol=1e-6, atol=1e-8 * np.abs(wanted).max())
    by = (mod.rhs(0.0, x, p={"phi": 0.5 + 1e-6}) - mod.rhs(0.0, x, p={"phi": 0.5 - 1e-6})) / 2e-6
    np.testing.assert_allclose(mod.parameter_jacobian(0.0, x)[:, 0], by, rtol=1e-7, atol=1e-8)


def test_on_uneven_ground_and_in_turned_frames() -> None:
    """A straight profile is a half-plane; a half-plane that is turned with gravity and plate is the same ground."""
    flat = {"shape": "profile", "points": [[-3, 0], [0.1, 0], [3, 0]]}
    values = []
    for turn, ground in ((0.0, {"shape": "half_plane"}), (0.0, flat), (0.7, {"shape": "half_plane"})):
        c, s = math.cos(turn), math.sin(turn)
        m = eg.Model("turned", gravity=(G * s, -G * c, 0))
        body = m.body("sole", mass=10.0, inertia={"zz": 2.0})
        m.planar("j", m.ground, body)
        at = m.ground.at(0, 0, 0, rpy=(0, 0, turn))
        shape = {"shape": "plate", "on": body, "length": 0.6, "width": 0.3}
        m.contacts("soil", shape, {**ground, "on": at}, {"soil": "dry_sand"})
        mod = m.compile(target="numpy")
        x = mod.x0(j_x=c * 0.2 + s * 0.05, j_y=s * 0.2 - c * 0.05, j_3=turn + 0.02)
        v = (0.4, -0.1)
        x[3:6] = [c * v[0] - s * v[1], s * v[0] + c * v[1], 0.1]
        x[6:] = [0.004, 0.001, 0.02, -0.003, 0.0, 0.08]
        rates = mod.rhs(0.0, x)
        values.append([c * rates[3] + s * rates[4], -s * rates[3] + c * rates[4], *rates[5:]])
    np.testing.assert_allclose(values[1], values[0], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(values[2], values[0], rtol=1e-11, atol=1e-12)


def test_file_and_verify(tmp_path: Any) -> None:
    m = plate({"soil": "dry_sand", "lateral": False})
    file = tmp_path / "plate.yaml"
    file.write_text(m.to_yaml())
    a, b = m.compile(target="numpy"), eg.load(file).compile(target="numpy")
    x = a.x0(y=-0.03, x_dot=0.2)
    x[4:] = [0.002, 0.03, 0.001, 0.05]
    np.testing.assert_array_equal(a.rhs(0.0, x), b.rhs(0.0, x))
    assert a.verify().ok  # the numbers of a published soil have no other units
    assert plate({**EXAMPLE, "lateral": False}).compile(target="numpy").verify().ok


@pytest.mark.parametrize(
    ("law", "place", "told"),
    [
        ({"soil": "dry_sent"}, "soil", "dry_sand"),
        ({"soil": "lete_sand"}, "shear_modulus", "is missing of soil: lete_sand; K is 0.01 m in firm sand"),
        ({**EXAMPLE, "cohesion": -1.0}, "cohesion", "is -1; must be 0 or greater"),
        ({**EXAMPLE, "shear_modulus": 0}, "shear_modulus", "is 0; must be greater than 0"),
        ({**EXAMPLE, "friction_angle": 29}, "friction_angle", "is 29; is 0 or greater and below pi/2; it is in rad"),
        ({**EXAMPLE, "rebound": 1.5}, "rebound", "is 1.5; is above 0 and at most 1"),
        ({**EXAMPLE, "rebound": 0.2, "unloading_rise": 1e6}, "rebound", "follows from unloading_stiffness and"),
        ({**EXAMPLE, "stiffness": 1e4}, "stiffness", "is of another law than soil"),
        ({**EXAMPLE, "friction": 0.3}, "friction", "is of another law than soil"),
        ({"soil": "own"}, "cohesion", "is missing of soil: own"),
        ({"stiffness": 1e4, "cohesion": 1e3}, "cohesion", "belongs to contacts that have soil"),
    ],
)
def test_what_is_wrong_is_told(law: dict[str, Any], place: str, told: str) -> None:
    with pytest.raises(ModelError) as error:
        plate(law).mechanism()
    found = {p.path: f"{p.message}; {p.remedy}" for p in error.value.problems}
    assert told in found.get(f"forces.soil.{place}", f"nothing there: {found}"), found


def test_shapes_that_do_not_lie_on_soil() -> None:
    m = plate(EXAMPLE)
    ground, thin = {"shape": "half_plane", "on": m.ground}, {"shape": "plate", "on": "sole", "length": 1}
    m.contacts("wheel", {"shape": "circle", "on": "sole", "radius": 0.2}, ground, EXAMPLE)
    m.contacts("thin", {**thin, "width": 0}, ground, EXAMPLE)
    m.contacts("many", {**thin, "width": 1, "points": 99}, ground, EXAMPLE)
    with pytest.raises(ModelError) as error:
        m.mechanism()
    told = str(error.value)
    assert "a circle does not lie on soil" in told
    assert "width: is 0; must be greater than 0" in told
    assert "is 99; give a whole number from 1 to 8" in told
    bare = plate(EXAMPLE)
    bare.contacts("s", thin, {**ground, "on": bare.ground}, EXAMPLE)
    with pytest.raises(ModelError, match=r"s\.first\[0\]\.width: is missing"):
        bare.mechanism()


def sled(initial: bool = False) -> eg.Model:
    m = eg.Model("sled", gravity=(0, -G, 0))
    body = m.body("sole", mass=400.0, inertia={"zz": 30.0})
    m.planar("j", m.ground, body)
    shape = {"shape": "plate", "on": body, "length": 1.0, "width": 0.3}
    law = {"soil": "dry_sand", "friction_angle": m.parameter("phi", 0.5), "dissipation": 1.0, "lateral": False}
    m.contacts("sand", shape, {"shape": "half_plane", "on": m.ground}, law)
    if initial:
        m.initial(j_x_dot=1.0, j_y=-0.001)
    return m


def test_runs_ensembles_and_sensitivities() -> None:
    """The way of a sled that slides to rest: runs of an ensemble are single runs, derivatives are differences."""
    mod = sled().compile()
    start = {"j_x_dot": 1.0, "j_y": -0.001}
    ends = {phi: mod.simulate(0.2, initial=start, parameters={"phi": phi}) for phi in (0.499, 0.5, 0.501)}
    assert ends[0.5]["j_x_dot"][-1] < 0.7
    assert ends[0.5]["sand_shear_1"][-1] > 0.005
    many = mod.simulate_many(0.2, initial=start, parameters={"phi": [0.499, 0.501]})
    for k, phi in enumerate((0.499, 0.501)):
        assert np.ravel(many["j_x"])[k] == pytest.approx(ends[phi]["j_x"][-1], rel=1e-7)
    slope = mod.sensitivities(["phi"], 0.2, initial=start)
    wanted = (ends[0.501]["j_x"][-1] - ends[0.499]["j_x"][-1]) / 0.002
    assert slope["j_x", "phi"][-1] == pytest.approx(wanted, rel=1e-3)


def test_momentum_is_kept_and_no_plate_pulls() -> None:
    """Two free bodies, plates on a profile: the soil's force is that on the other body, and its normal part pushes."""
    m = eg.Model("pair", gravity=(0, 0, 0))
    bodies = [m.body(f"b{k}", mass=2.0 + k, inertia={"zz": 0.3 + k}) for k in range(2)]
    for k, body in enumerate(bodies):
        m.planar(f"j{k}", m.ground, body)
    ground = {"shape": "profile", "on": bodies[0], "points": [[-2, 0], [0, 0.1], [2, -0.1]], "depth": 0.5}
    shape = {"shape": "plate", "on": bodies[1], "length": 0.8, "width": 0.3}
    m.contacts("soil", ground, shape, {"soil": "dry_sand", "lateral": False})
    mod = m.compile(target="numpy")
    rng, pressed = np.random.default_rng(8), 0
    for _ in range(200):
        x = np.concatenate([rng.uniform(-0.1, 0.1, 6), rng.standard_normal(6), rng.uniform(-0.02, 0.05, mod.n_x - 12)])
        force = -mod.bias(0.0, x)[:6]
        if not np.abs(force).max():
            continue
        pressed += 1
        size = np.abs(force).max()
        assert np.abs(force[:2] + force[3:5]).max() <= 1e-11 * size
        moment = x[0] * force[1] - x[1] * force[0] + force[2] + x[3] * force[4] - x[4] * force[3] + force[5]
        assert abs(moment) <= 1e-11 * size
        up = x[2] + math.pi / 2  # y of the ground
        assert force[3] * math.cos(up) + force[4] * math.sin(up) > -0.6 * np.hypot(force[3], force[4])
    assert pressed > 30


def test_a_plate_that_starts_sunk_has_its_memory() -> None:
    """From 1.5 times the depth at which it stands it rises as on the line of unloading: by 2 (F - W) / (k_u A)."""
    m = eg.Model("sunk", gravity=(0, -G, 0))
    body = m.body("sole", mass=400.0, inertia={"zz": 30.0})
    m.planar("j", m.ground, body)
    shape = {"shape": "plate", "on": body, "length": 1.0, "width": 0.3}
    m.contacts("sand", shape, {"shape": "half_plane", "on": m.ground}, {"soil": "dry_sand", "lateral": False})
    mod = m.compile(target="numpy")
    k, n = 0.99e3 / 0.3 + 1528.43e3, 1.1
    deep = 1.5 * (400.0 * G / (0.3 * k)) ** (1 / n)
    rise = 2 * (1 - 1.5**-n) * 0.1 * deep
    traj = mod.simulate((0, 0.5), initial={"j_y": -deep}, rtol=1e-9, atol=1e-11)
    assert traj["j_y"].max() + deep == pytest.approx(rise, rel=0.005)  # the sinkage it remembers is 1e-4 less
    assert traj["sand_sinkage_1"][-1] == pytest.approx(deep, rel=2e-4)
    assert traj["sand_sinkage_1"].max() <= deep * (1 + 1e-9)


RIDGE = [[-1, -1], [-0.02, 0], [0.02, 0], [1, -1]]


def test_a_point_below_both_sides_of_a_ridge_remembers_once() -> None:
    """Both flanks sink by z' = v cos(turn); the point remembers that, and not twice as much."""
    m = eg.Model("ridge", gravity=(0, 0, 0))
    body = m.body("sole", mass=10.0, inertia={"zz": 2.0})
    m.planar("j", m.ground, body)
    shape = {"shape": "plate", "on": body, "length": 0.02, "width": 0.3, "points": 1}
    ridge = {"shape": "profile", "points": RIDGE, "on": m.ground, "depth": 0.3}
    m.contacts("soil", shape, ridge, {**EXAMPLE, "lateral": False})
    mod = m.compile(target="numpy")
    x = mod.x0(j_y=-0.1, j_y_dot=-0.2)
    slope = 1 / 0.98
    assert mod.rhs(0.0, x)[7] == pytest.approx(0.2 / math.hypot(1, slope), rel=1e-12)


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_exact_derivatives_below_a_ridge(target: str) -> None:
    m = eg.Model("ridge", gravity=(0, -G, 0))
    body = m.body("sole", mass=10.0, inertia={"zz": 2.0})
    m.planar("j", m.ground, body)
    shape = {"shape": "plate", "on": body, "length": 0.04, "width": 0.3}
    ridge = {"shape": "profile", "points": RIDGE, "on": m.ground, "depth": 0.3}
    m.contacts("soil", shape, ridge, {"soil": "dry_sand", "dissipation": 0.5, "lateral": False})
    mod = m.compile(target=target)
    units = np.eye(mod.n_x)
    for rate in (-0.1, 0.1):  # sinking, and rising from where it began
        x = mod.x0(j_x=0.003, j_y=-0.1, j_3=0.05, j_x_dot=0.01, j_y_dot=rate, j_3_dot=0.02)
        x[6:] = [0.004, 0.0449, -0.003, 0.0449]
        step = 1e-7 * np.array([1, 1, 1, 1, 1, 1, 1, 1e-1, 1, 1e-1])
        wanted = np.array(
            [(mod.rhs(0.0, x + h * e) - mod.rhs(0.0, x - h * e)) / (2 * h) for e, h in zip(units, step, strict=True)]
        ).T
        np.testing.assert_allclose(mod.jacobian(0.0, x), wanted, rtol=1e-6, atol=1e-8 * np.abs(wanted).max())
