"""Inertia of drives on the joints where loops are cut, against closed forms in the one coordinate that is left."""

from __future__ import annotations

import numpy as np
import pytest

import eomgen as eg
from eomgen.equations import METHODS

DRIVE, GRAVITY = 0.7, 9.81
CRANK, COUPLER, ROCKER, BASE = 0.2, 0.6, 0.4, 0.5
MASSES, INERTIAS = (1.0, 2.0, 1.5), (0.01, 0.1, 0.05)


def door(drive: float) -> eg.Model:
    """A door on two hinges with one axis: no row of the loop is left."""
    m = eg.Model("door", gravity=(0, 0, -GRAVITY))
    leaf = m.body("leaf", mass=2, com=(0.5, 0, 0), inertia=(0.1, 0.2, 0.3))
    m.revolute("A", m.ground, leaf, coordinate="theta")
    m.revolute("B", m.ground.at(0, 0, 1), leaf.at(0, 0, 1), coordinate="phi", armature=drive)
    m.torque("motor", "A", 1.0)
    return m


@pytest.mark.parametrize("method", [*METHODS, "auto"])
@pytest.mark.parametrize("drive", [0.0, 5.0])
def test_drive_on_the_second_hinge_of_a_door(method: str, drive: float) -> None:
    module = door(drive).compile(method=method, target="numpy")
    theta_rate = module.rhs(0.0, np.array([0.3, 0.1]))[1]
    assert theta_rate == pytest.approx(1.0 / (0.3 + 2 * 0.5**2 + drive), rel=1e-14)


def test_drive_on_a_second_hinge_of_a_chain_that_derives_itself() -> None:
    m = eg.Model("chain", gravity=(0, 0, -GRAVITY))
    bodies = [m.ground]
    for k in range(12):
        body = m.body(f"b{k}", mass=2, com=(0.5, 0.1, 0.03), inertia=(0.1, 0.2, 0.3))
        m.revolute(f"A{k}", bodies[-1].at(min(k, 1), 0, 0), body, axis="zxy"[k % 3], coordinate=f"q{k}")
        bodies.append(body)
    m.revolute("B", m.ground.at(0, 0, 1), bodies[1].at(0, 0, 1), axis="z", armature=5)
    module = m.compile(target="numpy")
    x = np.linspace(0.1, 0.9, 24)
    a = module.rhs(0.0, x)[12:]
    assert np.abs(module.inverse_dynamics(x[:12], x[12:], a)).max() < 1e-10


@pytest.mark.parametrize("target", ["numpy", "cython"])
@pytest.mark.parametrize("method", [*METHODS, "auto"])
def test_drive_between_two_branches(method: str, target: str) -> None:
    m = eg.Model("rotors", gravity=(0, 0, 0))
    first, second = m.body("first", mass=1, inertia=(1, 1, 2)), m.body("second", mass=1, inertia=(2, 2, 3))
    m.revolute("A", m.ground, first, coordinate="q1")
    m.revolute("B", m.ground, second, coordinate="q2")
    m.revolute("C", first, second, armature=5)
    m.torque("motor", "A", 1.0)
    options = {"optimize": 0} if target == "cython" else {}
    module = m.compile(method=method, target=target, **options)
    expected = np.linalg.solve([[2 + 5, -5], [-5, 3 + 5]], [1, 0])  # J (q2' - q1')^2 / 2
    assert module.rhs(0.0, np.zeros(4))[2:] == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize("method", [*METHODS, "auto"])
def test_drives_in_an_open_chain_add_to_the_diagonal_of_the_mass_matrix(method: str) -> None:
    drives = np.array([0.7, 0.0, 1.3])

    def arm(scale: float) -> eg.Model:
        m = eg.Model("arm", gravity=(0, -GRAVITY, 0))
        last = m.ground
        for k, drive in enumerate(drives):
            body = m.body(f"b{k}", mass=2 - 0.3 * k, com=(0.5, 0.1, 0.03), inertia=(0.1, 0.2, 0.3))
            m.revolute(f"A{k}", last, body, axis="zxy"[k], coordinate=f"q{k}", armature=scale * drive)
            last = body.at(0.9, 0, 0)
        return m

    bare = arm(0.0).compile(method="embedding", target="numpy")
    x = np.array([0.4, -0.8, 1.1, 0.9, -1.3, 0.6])
    expected = np.linalg.solve(bare.mass_matrix(x[:3]) + np.diag(drives), -bare.bias(0.0, x))
    assert arm(1.0).compile(method=method, target="numpy").rhs(0.0, x)[3:] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("method", METHODS)
def test_drive_on_a_slider_that_closes_a_loop(method: str) -> None:
    """Of a slider-crank, massless but for a crank and the drive: T = (I + J s'^2) theta'^2 / 2, s' = ds/dtheta."""
    r, l, inertia = 0.2, 0.5, 0.03
    m = eg.Model("press", gravity=(0, 0, 0))
    crank = m.body("crank", mass=0, inertia={"zz": inertia})
    rod, slider = m.body("rod", mass=0), m.body("slider", mass=0)
    m.revolute("A", m.ground, crank, coordinate="theta")
    m.revolute("B", crank.at(r, 0, 0), rod, coordinate="phi")
    m.revolute("C", rod.at(l, 0, 0), slider, coordinate="psi")
    m.prismatic("D", m.ground, slider, axis="x", armature=DRIVE)
    m.guess = {"theta": 0.8, "phi": -1.1, "psi": 0.3}
    module = m.compile(target="numpy", independent=["theta"], method=method)
    assert "D" not in module.q_names
    angle, rate, d = 0.8, 3.0, 1e-5
    angles = np.array([angle - d, angle, angle + d])
    slope = -r * np.sin(angles) - r**2 * np.sin(2 * angles) / (2 * np.sqrt(l**2 - (r * np.sin(angles)) ** 2))
    whole = inertia + DRIVE * slope[1] ** 2
    expected = -DRIVE * slope[1] * (slope[2] - slope[0]) / (2 * d) * rate**2 / whole
    x = module.x0({"theta": angle, "theta_dot": rate})
    assert module.rhs(0.0, x)[module.n_q + module.v_names.index("theta_dot")] == pytest.approx(expected, rel=1e-8)


def effective(crank: float, driven: str) -> tuple[float, float]:
    """Inertia and potential energy of the four-bar linkage felt by its crank, by vectors in the complex plane."""
    pin = CRANK * np.exp(1j * crank)
    base = BASE - pin
    bend = np.arccos((abs(base) ** 2 + COUPLER**2 - ROCKER**2) / (2 * abs(base) * COUPLER))
    coupler = np.angle(base) + bend
    rocker = np.angle(COUPLER * np.exp(1j * coupler) - base)
    bars = [1j * length * np.exp(1j * angle) for length, angle in ((COUPLER, coupler), (ROCKER, rocker))]
    A = np.array([[bars[0].real, -bars[1].real], [bars[0].imag, -bars[1].imag]])
    w3, w4 = np.linalg.solve(A, [-(1j * pin).real, -(1j * pin).imag])
    centres = (pin / 2, pin + COUPLER / 2 * np.exp(1j * coupler), BASE + ROCKER / 2 * np.exp(1j * rocker))
    speeds = (1j * pin / 2, 1j * pin + bars[0] / 2 * w3, bars[1] / 2 * w4)
    inertia = sum(m * abs(u) ** 2 for m, u in zip(MASSES, speeds, strict=True))
    inertia += sum(i * w**2 for i, w in zip(INERTIAS, (1.0, w3, w4), strict=True))
    inertia += DRIVE * {"A": 1.0, "B": w3 - 1.0, "C": w4 - w3, "D": w4}[driven] ** 2
    return inertia, GRAVITY * sum(m * c.imag for m, c in zip(MASSES, centres, strict=True))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("driven", "cut"), [("A", "B"), ("B", "B"), ("B", "D"), ("C", "C"), ("D", "D"), ("D", "B")])
def test_drive_on_any_joint_of_a_four_bar_linkage(method: str, driven: str, cut: str) -> None:
    m = eg.Model("linkage", gravity=(0, -GRAVITY, 0))
    lengths = (CRANK, COUPLER, ROCKER)
    crank, coupler, rocker = (
        m.body(name, mass=mass, com=(length / 2, 0, 0), inertia=(1, 1, i))
        for name, mass, length, i in zip(("crank", "coupler", "rocker"), MASSES, lengths, INERTIAS, strict=True)
    )
    ends = {
        "A": (m.ground, crank),
        "B": (crank.at(CRANK, 0, 0), coupler),
        "C": (coupler.at(COUPLER, 0, 0), rocker.at(ROCKER, 0, 0)),
        "D": (m.ground.at(BASE, 0, 0), rocker),
    }
    for name, pair in ends.items():
        kept = {"coordinate": name} if name != cut else {}  # named coordinates stay in the tree
        m.revolute(name, *pair, **kept, armature=DRIVE if name == driven else 0)
    m.guess = {"A": 1.0}
    module = m.compile(target="numpy", independent=["A"], method=method)
    assert cut not in module.q_names
    x = module.x0({"A": 1.0, "A_dot": 2.0})
    step = 1e-5
    (inertia, _), (after, high), (before, low) = (effective(1.0 + d, driven) for d in (0.0, step, -step))
    slope, pull = (after - before) / (2 * step), (high - low) / (2 * step)
    expected = -(slope * 2.0**2 / 2 + pull) / inertia
    assert module.rhs(0.0, x)[module.n_q + module.v_names.index("A_dot")] == pytest.approx(expected, rel=1e-8)
    assert module.energy(x)[0] == pytest.approx(inertia * 2.0**2 / 2, rel=1e-9)
