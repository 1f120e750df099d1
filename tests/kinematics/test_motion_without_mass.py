"""Kinematics needs no masses: a mechanism without any is led like one with masses; dynamics refuses by name."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import eomgen as eg

LED = {"theta": np.linspace(1.0, 1.0 + 2 * np.pi, 25), "theta_dot": 10.0, "theta_ddot": 3.0}


def four_bar(mass: float, second: str = "ax") -> eg.Model:
    m = eg.Model("four_bar")
    inertia = {"inertia": {"zz": mass}} if mass else {}
    a, b, c = (m.body(name, mass=mass, **inertia) for name in ("crank", "coupler", "rocker"))
    m.revolute("A", m.ground, a, coordinate="theta")
    m.revolute("B", a.at(0.04, 0, 0), b, coordinate="bend")
    m.revolute("C", b.at(0.12, 0, 0), c.at(0.08, 0, 0))
    m.revolute("D", m.ground.at(0.1, 0, 0), c, coordinate="psi")
    m.output("px", b.at(0.05, 0, 0).position[0])
    point = b.at(0.05, 0, 0)
    m.output(second, point.acceleration[0] if second == "ax" else point.velocity[0])
    m.guess(theta=1.0, bend=-0.7, psi=1.1)
    m.initial(theta=1.0)
    return m


def freudenstein(theta: np.ndarray) -> np.ndarray:
    """The rocker's angle of a four-bar (Freudenstein, Trans. ASME 76, 1954) with the tangent of half the angle."""
    a, b, c, d = 0.04, 0.12, 0.08, 0.1
    A, B = a * np.sin(theta), a * np.cos(theta) - d
    C = (c**2 - b**2 + A**2 + B**2) / (2 * c)  # B cos(psi) + A sin(psi) = C, by the coupler's length
    return 2 * np.arctan2(A - np.sqrt(A**2 + B**2 - C**2), B + C)


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_a_mechanism_without_mass_is_led(target: str) -> None:
    mod = four_bar(0).compile(target=target)
    motion = mod.kinematic_analysis(**LED)
    psi = freudenstein(LED["theta"])
    np.testing.assert_allclose(np.cos(motion["psi"]), np.cos(psi), atol=1e-9)
    np.testing.assert_allclose(np.sin(motion["psi"]), np.sin(psi), atol=1e-9)
    heavy = four_bar(1).compile(target="numpy").kinematic_analysis(**LED)
    for name in ("psi", "psi_dot", "psi_ddot", "px", "ax"):
        np.testing.assert_allclose(motion[name], heavy[name], rtol=1e-9, atol=1e-9)
    assert mod.motion_range("theta").unlimited
    assert mod.assemble(theta=1.2)[0] == 1.2
    assert mod.kinematics([1.2], [1.0])[1][0] == 1.0
    x = mod.x0()
    for call in (lambda: mod.rhs(0.0, x), lambda: mod.jacobian(0.0, x), lambda: mod.simulate(0.1), mod.linearize):
        with pytest.raises(eg.SingularMassMatrixError, match="kinematics only: .*crank, coupler, rocker; give those"):
            call()


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_outputs_of_positions_and_velocities_need_no_mass(target: str) -> None:
    mod = four_bar(0, "vx").compile(target=target)
    motion = mod.kinematic_analysis(**LED)
    psi = freudenstein(LED["theta"])
    along = (0.1 + 0.08 * np.cos(psi) - 0.04 * np.cos(LED["theta"])) / 0.12  # the coupler's direction, x
    np.testing.assert_allclose(motion["px"], 0.04 * np.cos(LED["theta"]) + 0.05 * along, atol=1e-9)
    at = np.linspace(1.0, 1.01, 11)
    near = mod.kinematic_analysis(theta=at, theta_dot=10.0)
    np.testing.assert_allclose(near["vx"][5], np.gradient(near["px"], at / 10.0, edge_order=2)[5], rtol=1e-5)
    assert mod.outputs(0.0, mod.x0(theta=1.2)).shape == (2,)


@pytest.mark.parametrize("method", ["lagrange", "recursive", "augmented", "newton_euler", "gibbs_appell", "hamilton"])
def test_by_every_method(method: str) -> None:
    motion = four_bar(0).compile(method=method, target="numpy").kinematic_analysis(**LED)
    np.testing.assert_allclose(np.cos(motion["psi"]), np.cos(freudenstein(LED["theta"])), atol=1e-9)


def test_the_report_says_what_it_is_for() -> None:
    (note,) = (note for note in four_bar(0).check().notes if note.startswith("kinematics only"))
    assert note.endswith("bodies without mass and inertia: crank, coupler, rocker")
    assert not any("kinematics only" in note for note in four_bar(1).check().notes)


def test_a_forgotten_mass_is_still_told() -> None:
    """Where something else has mass, or a force acts, a motion without inertia is a slip of the pen."""
    m = four_bar(0)
    m.torque("motor", "A", 1.0)
    with pytest.raises(eg.ModelError, match="no inertia behind it.*; for kinematics alone, check_inertia: note"):
        m.check()
    m.check_inertia = "note"
    m.check()
    m.compile(target="numpy").kinematic_analysis(**LED)
    two = eg.Model("two")
    two.revolute("A", two.ground, two.body("a", mass=1, inertia={"zz": 1}))
    two.revolute("B", two.ground, two.body("b", mass=0))
    with pytest.raises(eg.ModelError, match="'B' has no inertia behind it"):
        two.compile(target="numpy")


def test_an_exported_package_and_the_command_line(tmp_path: Path) -> None:
    path = tmp_path / "four_bar.yaml"
    m = four_bar(0)
    m.save(path)

    def run(*words: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, *words]
        return subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)

    eom = ("-m", "eomgen")
    assert run(*eom, "check", str(path)).returncode == 0
    led = run(*eom, "kinematics", str(path), "--range", "theta=1:2:5", "--json")
    assert led.returncode == 0, led.stderr
    failed = run(*eom, "run", str(path), "--target", "numpy")
    assert failed.returncode == 1
    assert "kinematics only" in failed.stderr
    assert run(*eom, "generate", str(path), "--out", "out", "--target", "numpy").returncode == 0
    code = "import sys; sys.path.insert(0, 'out'); import four_bar as f; print(f.poses(f.assemble(theta=1.2))[0, 0, 0])"
    told = run("-c", code)
    assert float(told.stdout) == pytest.approx(np.cos(1.2)), told.stderr
    refused = run("-c", "import sys; sys.path.insert(0, 'out'); import four_bar as f; f.rhs(0.0, f.x0())")
    assert "SingularMassMatrixError" in refused.stderr
    assert "kinematics only" in refused.stderr
