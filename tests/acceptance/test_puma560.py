"""PUMA 560 (Armstrong, Khatib and Burdick 1986, as in Corke's Robotics Toolbox): published and full-precision values.

Source: ``tests/reference/puma560.json``; standard DH, A_i = Rz(q) Tz(d) Tx(a) Rx(alpha), a link's frame at its far end.
"""

from __future__ import annotations

import json
from functools import cache
from math import cos, pi, sin
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eomgen as eg

CASE = json.loads((Path(__file__).parents[1] / "reference" / "puma560.json").read_text())
GIVEN = CASE["parameters_SI"]
PUBLISHED, OWN = CASE["published"], CASE["own_full_precision"]
QN = np.array([0, pi / 4, pi, 0, pi / 4, 0])
ONES, ZEROS = np.ones(6), np.zeros(6)
GEAR = np.array(GIVEN["G"])
ROTOR = GEAR**2 * np.array(GIVEN["Jm"])  #: rotor inertia as the joint feels it


def build_puma() -> eg.Model:
    """Six links; ``q1`` .. ``q6`` are the DH angles."""
    m = eg.Model("puma560", gravity=(0, 0, -GIVEN["g"]))
    angles = {"pi/2": pi / 2, "-pi/2": -pi / 2, 0: 0.0}
    dh = GIVEN["DH_standard"]
    last: Any = m.ground
    for i in range(6):
        d, a, alpha = dh["d"][i], dh["a"][i], angles[dh["alpha"][i]]
        link = m.body(
            f"link{i + 1}", GIVEN["m"][i], com=GIVEN["r_com_link_frame"][i], inertia=GIVEN["I_com_link_frame_diag"][i]
        )
        near = link.at(-a, -d * sin(alpha), -d * cos(alpha), rpy=(-alpha, 0, 0))
        m.revolute(f"q{i + 1}", last, near)
        last = link
    m.initial.update({f"q{i + 1}": q for i, q in enumerate(QN)})
    return m


@cache
def compiled(method: str) -> Any:
    return (
        build_puma().derive(method).compile(target="numpy", kernels=("mass_matrix", "inverse_dynamics", "rhs", "poses"))
    )


def friction(rate: np.ndarray) -> np.ndarray:
    """Viscous and Coulomb torque at the joint, as the Toolbox adds it: |G| (B |G| q' + Tc)."""
    coulomb = np.array([high if x > 0 else low if x < 0 else 0.0 for (high, low), x in
                        zip(GIVEN["Tc_plus_minus"], rate, strict=True)])  # fmt: skip
    return np.abs(GEAR) * (np.array(GIVEN["B"]) * np.abs(GEAR) * rate + coulomb)


@pytest.mark.parametrize("method", ["embedding", "lagrange"])
def test_inverse_dynamics_and_mass_matrix_have_full_precision(method: str) -> None:
    module = compiled(method)
    expected = np.array(OWN["M_link"])
    assert np.abs(module.mass_matrix(QN) - expected).max() < 1e-13
    for rate, acceleration, key in ((ZEROS, ZEROS, "grav"), (ONES, ZEROS, "tau_qn_1_0_nofric")):
        torque = module.inverse_dynamics(QN, rate, acceleration)
        assert np.abs(torque - OWN[key]).max() < 1e-12 * 37
    with_rotors = module.inverse_dynamics(QN, ZEROS, ONES) + ROTOR
    assert np.abs(with_rotors - OWN["tau_qn_0_1"]).max() < 1e-12 * 37


@pytest.mark.parametrize("method", ["embedding", "lagrange"])
def test_published_torques(method: str) -> None:
    """The Toolbox's own test values, four to six digits; rotors and friction are added here."""
    module = compiled(method)
    cases = (("rne_qn_0_0", ZEROS, ZEROS), ("rne_qn_0_1", ZEROS, ONES), ("rne_qn_1_1", ONES, ONES),
             ("rne_qn_1_0", ONES, ZEROS))  # fmt: skip
    for key, rate, acceleration in cases:
        torque = module.inverse_dynamics(QN, rate, acceleration) + ROTOR * acceleration + friction(rate)
        np.testing.assert_allclose(torque, PUBLISHED[key], rtol=2e-5, atol=1e-4)


def test_published_accelerations_and_pose() -> None:
    module = compiled("embedding")
    rate, torque = (np.array(PUBLISHED["accel"][key]) for key in ("qd", "tau"))
    resisting = module.inverse_dynamics(QN, rate, ZEROS) + friction(rate)
    acceleration = np.linalg.solve(module.mass_matrix(QN) + np.diag(ROTOR), torque - resisting)
    np.testing.assert_allclose(acceleration, PUBLISHED["accel"]["qdd"], rtol=0, atol=5.1e-5)  # four decimals printed
    np.testing.assert_allclose(module.poses(QN)[-1], OWN["fk_qn"], atol=1e-14)
