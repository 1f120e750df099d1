"""Machines with first-order states: muscles with activation, a boom on oil; and states in all targets."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import eomgen as eg

ROOT = Path(__file__).parents[2]


def activation_rate(e: float, a: float) -> float:
    """As the reference has it: De Groote and others (2016)."""
    h = np.tanh(10 * (e - a)) / 2
    return float(((0.5 + h) / (0.015 * (0.5 + 1.5 * a)) + (0.5 + 1.5 * a) * (0.5 - h) / 0.06) * (e - a))


def arm(states: bool) -> Any:
    """SymPy's tutorial: an arm on a lever, with biceps and triceps; their activations are states, or inputs."""
    given = models.reference("muscle_lever_sympy")
    p = given["parameters_SI"]
    lA, lC, lD, r = p["lA"], p["lC"], p["lD"], p["r"]
    m = eg.Model("arm", gravity=(0, 0, p["g"]), check_inertia="note")

    def rod(name: str, mass: float, length: float, along: int, at: float) -> Any:
        thin: list[Any] = [mass * length**2 / 12] * 3
        thin[along] = mass * length**2 / 2  # the tutorial's own
        centre = [0.0, 0.0, 0.0]
        centre[along] = at
        return m.body(name, mass=mass, com=centre, inertia=thin)

    A, C, D = rod("A", p["mA"], lA, 1, 0.0), rod("C", p["mC"], lC, 2, lC / 2), rod("D", p["mD"], lD, 2, lD / 2)
    B = m.body("B", mass=0)
    m.revolute("q1", m.ground.at(p["dx"], 0, 0), A, coordinate="q1")
    m.revolute("q2", m.ground.at(0, p["dy"], p["dz"]), B, axis="y", coordinate="q2")
    m.revolute("q3", B, C, coordinate="q3")
    m.revolute("q4", C.at(0, 0, lC), D, axis="y", coordinate="q4")
    m.spherical("hand", A.at(0, lA, 0), D.at(0, 0, lD))
    m.torsional_element("grip", "q1", law=f"-{p['k']}*angle - {p['c']}*rate")
    elbow = C.at(0, 0, lC, rpy=(-np.pi / 2, 0, 0))
    around = [{"around": elbow, "radius": r, "sense": "positive"}]
    for name, via in (("biceps", []), ("triceps", around)):
        own = p[name]
        sizes = {"force_max": own["F_max"], "fiber_length": own["l_opt"], "slack_length": own["l_slack"]}
        ends = C.at(0, 0, lC / 3), D.at(0, 0, lD / 3)
        if states:
            e, a = m.input(f"e_{name}"), f"a_{name}"
            h = f"tanh(10*({e} - {a}))/2"
            m.state(a, f"((0.5 + {h})/(0.015*(0.5 + 1.5*{a})) + (0.5 + 1.5*{a})*(0.5 - {h})/0.06)*({e} - {a})")
        else:
            m.input(f"a_{name}")
        m.muscle(name, *ends, activation=f"a_{name}", **sizes, via=via)
    q = given["own"]["q0"]
    m.initial(**{f"q{k + 1}": value for k, value in enumerate(q)})
    m.guess(q1=q[0], q2=q[1], q3=q[2], q4=q[3])
    return m.compile(target="numpy"), given


def test_activation_dynamics_of_the_published_arm() -> None:
    mod, given = arm(states=True)
    x = mod.x0()
    a = dict(zip(mod.x_names, mod.rhs(0.0, x), strict=True))
    np.testing.assert_allclose([a[f"q{k}_dot"] for k in range(1, 5)], given["own"]["qdd0"], rtol=1e-7)
    assert (a["a_biceps"], a["a_triceps"]) == (0.0, 0.0)
    plain, _ = arm(states=False)
    x = mod.x0(a_biceps=0.3, a_triceps=0.1)
    found = mod.rhs(0.0, x, u=[0.8, 0.05])
    np.testing.assert_allclose(found[:-2], plain.rhs(0.0, x[:-2], u=[0.3, 0.1]), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(found[-2:], [activation_rate(0.8, 0.3), activation_rate(0.05, 0.1)], rtol=1e-13)
    run = mod.simulate(0.1, inputs={"e_biceps": 1.0}, rtol=1e-10, atol=1e-12)
    alone = solve_ivp(lambda t, a: [activation_rate(1.0, a[0])], (0, 0.1), [0.0], rtol=1e-11, atol=1e-13)
    assert run["a_biceps"][-1] == pytest.approx(alone.y[0, -1], abs=1e-9)


def boom(t: float, x: np.ndarray) -> list[float]:
    """The example hydraulic_boom by hand."""
    phi, rate, p = x
    reach = np.array([1.2 * np.cos(phi) - 0.6, 1.2 * np.sin(phi) + 1.0])
    length = float(np.hypot(*reach))
    slope = float(reach @ [-1.2 * np.sin(phi), 1.2 * np.cos(phi)]) / length
    inertia = 200 * 9 / 12 + 200 * 1.5**2 + 500 * 9
    turn = (5e-3 * p * slope - 9.81 * np.cos(phi) * (200 * 1.5 + 500 * 3)) / inertia
    volume = 5e-4 + 5e-3 * (length - 1.2)
    return [rate, turn, 1e9 * (1e-3 * np.sin(t) - 5e-3 * slope * rate - 4e-12 * p) / volume]


def test_a_boom_on_oil_moves_as_equations_by_hand_say() -> None:
    mod = eg.load_example("hydraulic_boom").compile()
    rng = np.random.default_rng(1)
    for _ in range(5):
        x = np.array([rng.uniform(0, 0.8), rng.normal(), rng.uniform(1e6, 5e6)])
        np.testing.assert_allclose(mod.rhs(0.3, x), boom(0.3, x), rtol=1e-11)
    run = mod.simulate(6.0, rtol=1e-10, atol=1e-10)
    alone = solve_ivp(boom, (0, 6), mod.x0(), method="Radau", rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(run.x[:, -1], alone.y[:, -1], rtol=1e-6)
    reach = np.array([1.2 * np.cos(0.3) - 0.6, 1.2 * np.sin(0.3) + 1.0])
    slope = reach @ [-1.2 * np.sin(0.3), 1.2 * np.cos(0.3)] / np.hypot(*reach)
    assert mod.x0()[2] == pytest.approx(9.81 * np.cos(0.3) * 1800 / (5e-3 * slope), rel=1e-4)  # carries the load
    oil = 5e-3**2 * slope**2 * 1e9 / (5e-4 + 5e-3 * (np.hypot(*reach) - 1.2))
    fast = mod.linearize().eigenvalues[-1]
    assert abs(fast) == pytest.approx(np.sqrt(oil / 5100), rel=2e-3)


def servo() -> eg.Model:
    m = eg.Model("arm_on_a_servo", gravity=(0, -9.81, 0))
    tau = m.parameter("tau", 0.1)
    link = m.body("link", mass=1.5, com=(0.3, 0, 0), inertia={"zz": 0.02})
    m.revolute("A", m.ground, link, coordinate="q")
    m.input("target", 0.4)
    z = m.state("z", "target - q", initial=0.1)
    m.state("w", (m.coordinate("q_dot") - m.coordinate("w")) / tau)
    m.torque("motor", "A", 20 * (m.coordinate("target") - m.coordinate("q")) + 5 * z - 2 * m.coordinate("w"))
    m.output("power", "power(motor)")
    m.initial(q=0.2)
    return m


def by_hand(x: np.ndarray) -> np.ndarray:
    q, v, z, w = x
    torque = 20 * (0.4 - q) + 5 * z - 2 * w
    return np.array([v, (torque - 1.5 * 0.3 * 9.81 * np.cos(q)) / (0.02 + 1.5 * 0.09), 0.4 - q, (v - w) / 0.1])


X = np.array([0.3, -0.7, 0.2, 0.5])


def test_libraries_that_trace_have_states() -> None:
    eqs = servo().derive()
    for name in ("casadi", "jax"):
        pytest.importorskip(name)
        made = eqs.to_casadi() if name == "casadi" else eqs.to_jax()
        assert tuple(made.x_names) == ("q", "q_dot", "z", "w")
        found = np.array(made.rhs(0.0, X, made.u_values, made.p_values)).ravel()
        np.testing.assert_allclose(found, by_hand(X), rtol=1e-13)


def test_an_exported_package_has_states(tmp_path: Path) -> None:
    file = tmp_path / "servo.yaml"
    servo().save(file)
    words = ["generate", str(file), "--out", str(tmp_path / "out"), "--target", "numpy"]
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    subprocess.run([sys.executable, "-m", "eomgen", *words], check=True, capture_output=True, env=env)
    code = (
        "import json, numpy as np, arm_on_a_servo as mod\n"
        f"x = np.array({X.tolist()})\n"
        "print(json.dumps([list(mod.x_names), mod.rhs(0.0, x).tolist(), mod.simulate(0.3, rtol=1e-10)['z'][-1]]))"
    )
    env = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"} | {"PYTHONPATH": str(tmp_path / "out")}
    done = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True, cwd=tmp_path, env=env
    )
    import json

    names, rates, z = json.loads(done.stdout)
    assert names == ["q", "q_dot", "z", "w"]
    np.testing.assert_allclose(rates, by_hand(X), rtol=1e-13)
    alone = solve_ivp(lambda t, x: by_hand(x), (0, 0.3), [0.2, 0, 0.1, 0], rtol=1e-11, atol=1e-12)
    assert z == pytest.approx(alone.y[2, -1], abs=1e-7)


def test_a_functional_mock_up_unit_has_states(tmp_path: Path) -> None:
    fmpy = pytest.importorskip("fmpy")
    file = servo().derive().write_fmu(tmp_path / "servo.fmu")
    run = fmpy.simulate_fmu(
        str(file), stop_time=0.3, output=["z", "w"], relative_tolerance=1e-9, start_values={"z": 0.3}
    )
    alone = solve_ivp(lambda t, x: by_hand(x), (0, 0.3), [0.2, 0, 0.3, 0], rtol=1e-11, atol=1e-12)
    assert [run["z"][-1], run["w"][-1]] == pytest.approx(alone.y[2:, -1].tolist(), abs=1e-5)


def test_equations_show_states() -> None:
    from eomgen.reading.formats import write_format

    eqs = servo().derive()
    assert [str(s) for s in eqs.states] == ["z", "w"]
    values = {"target": 0.4, "tau": 0.1, "q": 0.3, "q_dot": -0.7, "z": 0.2, "w": 0.5}
    np.testing.assert_allclose(np.array(eqs.state_rates.subs(values), dtype=float).ravel(), by_hand(X)[2:])
    assert "z' = target - q" in str(eqs)
    assert r"\dot{w}" in write_format(eqs, "latex")
    assert "first-order states" in eqs._repr_html_()
    scope: dict[str, Any] = {}
    exec(write_format(eqs, "sympy"), scope)  # noqa: S102
    assert scope["state_rates"].shape == (2, 1)
    solution = eqs.explain()
    assert "First-order states" in solution.markdown
    assert solution.difference is not None
    assert solution.difference < 1e-10
    assert str(eqs.with_dynamicsymbols().state_rates[0]) == "-q(t) + target(t)"
