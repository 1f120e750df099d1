"""Driven systems against published answers: car axis, Kapitza's pendulum, straight-line linkages.

Sources (tests/reference): IVP Test Set, Bari release 2.4, problem caraxis (caraxis.json); the pendulum's one-line
equation in 34 digits (kapitza_pendulum.json); closed forms of the linkages (linkages_straight_line.json).
"""

from __future__ import annotations

import models
import numpy as np
import pytest

import eomgen as eg

LINES = models.reference("linkages_straight_line")


@pytest.mark.parametrize("method", ["embedding", "lagrange"])
def test_car_axis(method: str) -> None:
    """Rheonomic and stiff; published to 21 digits, which the INDEX rates as good to 2e-13 and 5e-12."""
    given = models.reference("caraxis")
    mod = eg.load(models.EXAMPLES / "car_axis.yaml").compile(method=method)
    assert mod.n_dof == 2
    start = mod.outputs(0.0, mod.x0())
    np.testing.assert_allclose(start, [*given["initial_conditions"]["q"], *given["initial_conditions"]["qdot"]])
    run = mod.simulate(float(given["t_end"]))
    published = {name: float(x) for name, x in given["reference_published"].items()}
    for name in ("xl", "yl", "xr", "yr"):
        assert abs(run[name][-1] - published[name]) < 2e-12
        assert abs(run["v" + name][-1] - published[name + "_dot"]) < 5e-11
    # the constraints as published
    r, omega, L = (float(given["parameters"][key]) for key in ("r", "omega", "L"))
    yb = r * np.sin(omega * run.t)
    xb = np.sqrt(L**2 - yb**2)
    assert np.abs(xb * run["xl"] + yb * run["yl"]).max() < 1e-13
    assert np.abs((run["xl"] - run["xr"]) ** 2 + (run["yl"] - run["yr"]) ** 2 - L**2).max() < 1e-13


def test_kapitza_pendulum() -> None:
    given = models.reference("kapitza_pendulum")
    mod = eg.load(models.EXAMPLES / "kapitza_pendulum.yaml").compile()
    times = sorted(given["trajectory"], key=float)
    run = mod.simulate((0, 1), t_eval=[float(t) for t in times])
    for k, t in enumerate(times):
        angle, rate = map(float, given["trajectory"][t])
        assert abs(run["theta"][k] - angle) < 1e-11
        assert abs(run["theta_dot"][k] - rate) < 1e-10
    # slower than the threshold of the averaged equation it falls over
    end = [mod.simulate(20.0, parameters={"Omega": f * float(given["threshold_Omega"])}) for f in (0.9, 1.25)]
    fell = [np.abs(run["theta"] - np.pi).max() > 2.0 for run in end]
    assert fell == [True, False]


def linkage(
    name: str, start: float, pivots: tuple[float, float], crank: float, coupler: float, rocker: float, point: float
) -> eg.Model:
    """A massless four-bar with the left crank at (0, 0) driven, and a point on the line of its coupler."""
    m = eg.Model(name)
    one, bar, two = (m.body(part, mass=0) for part in ("crank", "coupler", "rocker"))
    m.revolute("A", m.ground, one, coordinate="theta")
    m.revolute("B", one.at(crank, 0, 0), bar, coordinate="bend")
    m.revolute("C", bar.at(coupler, 0, 0), two.at(rocker, 0, 0))
    m.revolute("D", m.ground.at(*pivots, 0), two, coordinate="psi")
    p = bar.marker("P", at=(point, 0, 0))
    m.output("P_x", p.position[0])
    m.output("P_y", p.position[1])
    m.parameter("start", start)
    m.driver("drive", "theta", "start + t")
    return m


@pytest.mark.parametrize("name", ["chebyshev", "hoecken", "watt"])
def test_straight_line_linkages(name: str) -> None:
    rows = LINES[name]["rows"]
    angles = np.array(sorted(float(key) for key in rows))
    if name != "chebyshev":
        angles = np.radians(angles)
    if name == "chebyshev":
        m = linkage(name, angles[0], (4, 0), 5, 2, 5, 1)
        m.guess(theta=angles[0], bend=np.pi - 0.6, psi=2.3)
    elif name == "hoecken":
        m = linkage(name, angles[0], (2, 0), 1, 2.5, 2.5, 5)
        m.guess(theta=angles[0], bend=-0.5, psi=1.6)
    else:
        m = linkage(name, angles[0], (2, 0.5), 1, 0.5, 1, 0.25)
        m.guess(theta=angles[0], bend=np.pi / 2, psi=np.pi)
    mod = m.compile(target="numpy")
    keys = sorted(rows, key=float)
    found = mod.kinematic_analysis(t=angles - angles[0])
    expected = np.array([[float(x) for x in rows[key]] for key in keys])
    np.testing.assert_allclose(np.array([found["P_x"], found["P_y"]]).T, expected, atol=1e-12)
    fine = mod.kinematic_analysis(t=np.linspace(0, angles[-1] - angles[0], 201))
    off = {"chebyshev": fine["P_y"] - 4, "hoecken": fine["P_y"] - 4, "watt": fine["P_x"] - 1}[name]
    assert np.abs(off).max() < 0.02 * np.hypot(np.ptp(fine["P_x"]), np.ptp(fine["P_y"]))  # nearly a straight line


def test_the_shipped_hoecken_linkage() -> None:
    mod = eg.load(models.EXAMPLES / "hoecken.yaml").compile(target="numpy")
    run = mod.kinematic_analysis(t=np.linspace(0, 1, 361))
    for degrees, row in LINES["hoecken"]["rows"].items():
        place = run["P_x"][int(degrees)], run["P_y"][int(degrees)]
        np.testing.assert_allclose(place, [float(x) for x in row], atol=1e-12)
