"""Pendula, chains, a robot and a manipulator against closed forms, high-precision integrations and published values."""

from collections.abc import Callable
from functools import cache
from math import cos, pi, sin
from typing import Any

import models
import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp

import eomgen as eg

# -- Double pendulum and chains ----------------------------------------------------------------------------------------
METHODS = ["embedding", "lagrange"]
TIGHT = {"method": "DOP853", "rtol": 3e-14, "atol": 1e-15}


def absolute(columns: np.ndarray) -> np.ndarray:
    """Absolute angles and rates (2 n, k) of states in relative ones."""
    n = len(columns) // 2
    return np.concatenate([np.cumsum(columns[:n], axis=0), np.cumsum(columns[n:], axis=0)])


def relative(theta: np.ndarray) -> np.ndarray:
    return np.diff(theta, prepend=0.0)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("case", ["A", "B"])
def test_double_pendulum(module: Callable[..., Any], case: str, method: str) -> None:
    given = models.reference("double_pendulum")["reference"][case]
    mod = module("double_pendulum", method).bind(
        p=dict(zip(("m1", "m2", "l1", "l2"), map(float, given["par"]), strict=True))
    )
    assert mod.q_names == ("theta1", "bend")
    start = np.array([float(x) for x in given["ic"]])
    x0 = np.concatenate([relative(start[:2]), relative(start[2:])])
    times = [float(t) for t in given["values"]]
    solution = solve_ivp(mod.rhs, (0, times[-1]), x0, t_eval=times, **TIGHT)
    expected = np.array([[float(x) for x in row] for row in given["values"].values()]).T
    assert np.abs(absolute(solution.y) - expected).max() <= 1e-9


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("name", "case"), [("chain", "rod3_horizontal"), ("point_chain", "pm3_horizontal")])
def test_chain_of_three(module: Callable[..., Any], name: str, case: str, method: str) -> None:
    given = models.reference("nlink_chain")["reference"][case]
    mod = module(name, method)
    assert mod.q_names == ("q1", "q2", "q3")
    x0 = np.concatenate([relative(np.array([float(x) for x in given["theta0"]])), np.zeros(3)])
    accelerations = np.cumsum(mod.rhs(0.0, x0)[3:])
    assert np.abs(accelerations - np.array([float(x) for x in given["acc0"]])).max() <= 1e-13
    times = [float(t) for t in given["values"]]
    solution = solve_ivp(mod.rhs, (0, times[-1]), x0, t_eval=times, **TIGHT)
    expected = np.array([[float(x) for x in row["theta"] + row["omega"]] for row in given["values"].values()]).T
    assert np.abs(absolute(solution.y) - expected).max() <= 1e-9
    run = mod.simulate((0, times[-1]), x0, t_eval=times, rtol=3e-14, atol=1e-15)
    if name == "chain":  # the example's own outputs are the absolute angles
        ours = np.array([run[f"theta{k}"] for k in (1, 2, 3)])
        assert np.abs(ours - expected[:3]).max() <= 1e-9


# -- IFToMM A01 --------------------------------------------------------------------------------------------------------
REFERENCE = models.reference("iftomm_A01_simple_pendulum")


def make() -> Any:
    """A point mass of 1 kg on a bar of 1 m without mass; at angle 0 it hangs."""
    given = REFERENCE["parameters_SI"]
    m = eg.Model("simple_pendulum", gravity=(0, -given["g"], 0))
    bob = m.body("bob", mass=given["m"], com=(0, -given["L"], 0))
    m.revolute("A", m.ground, bob, coordinate="theta")
    m.output("px", bob.at(0, -given["L"], 0).position[0])
    m.output("py", bob.at(0, -given["L"], 0).position[1])
    m.initial(theta=-np.pi / 2)
    return m.compile(target="numpy")


def test_the_pendulum_follows_its_closed_form() -> None:
    mod = make()
    places = REFERENCE["reference_xy"]
    times = sorted(map(float, places))
    run = mod.simulate(10.0, t_eval=times, rtol=1e-12, atol=1e-13)
    expected = np.array([[float(z) for z in places[f"{t:g}"]] for t in times])
    np.testing.assert_allclose(np.column_stack([run["px"], run["py"]]), expected, rtol=0, atol=1e-9)
    assert run.energy_drift < 1e-11


def test_the_period() -> None:
    mod = make()

    def stops(t: float, x: np.ndarray) -> float:
        return float(x[1])

    run = mod.simulate(5.0, rtol=1e-12, atol=1e-13, events=[stops])
    moments = [t for t in run.t_events[0] if t > 1e-6]
    assert moments[1] - moments[0] == pytest.approx(float(REFERENCE["period_s"]) / 2, abs=1e-9)


# -- PUMA 560 ----------------------------------------------------------------------------------------------------------
CASE = models.reference("puma560")
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


# -- The two-link manipulator of the book ------------------------------------------------------------------------------
BOOK = models.reference("two_link_manipulator")
th2, th3, w2, w3, a2, a3 = sympy.symbols("th2 th3 w2 w3 a2 a3")
# relative coordinates of the example in terms of the book's in_absolute_angles ones
ABSOLUTE = {
    "th2": th2,
    "bend": th3 - th2,
    "th2_dot": w2,
    "bend_dot": w3 - w2,
    "th2_ddot": a2,
    "bend_ddot": a3 - a2,
}
CHANGE = sympy.Matrix([[1, 0], [-1, 1]])  # [th2, bend]' = CHANGE [th2, th3]'
BY = ["embedding", "lagrange"]


def book(name: str) -> sympy.Matrix:
    return sympy.Matrix(sympy.S(BOOK[name]))


def in_absolute_angles(expression: Any) -> Any:
    return expression.subs({sympy.Symbol(k): v for k, v in ABSOLUTE.items()}, simultaneous=True)


def same_in_symbols(ours: sympy.Matrix, theirs: sympy.Matrix) -> bool:
    return sympy.simplify(ours - theirs) == sympy.zeros(*theirs.shape)


@pytest.mark.parametrize("method", BY)
def test_equations_after_the_change_of_coordinates(equations: Callable[..., Any], method: str) -> None:
    eqs = equations("two_link_manipulator", method)
    assert [str(q) for q in eqs.q] == ["th2", "bend"]
    assert same_in_symbols(CHANGE.T * in_absolute_angles(eqs.mass_matrix) * CHANGE, book("mass_matrix"))
    assert same_in_symbols(CHANGE.T * in_absolute_angles(eqs.force), book("force"))


@pytest.mark.parametrize("method", BY)
def test_compiled_outputs_equal_the_book(module: Callable[..., Any], method: str) -> None:
    mod = module("two_link_manipulator", method)
    values = dict(zip(mod.p_names, mod.p, strict=True))
    random = np.random.default_rng(1)
    for _ in range(5):
        x, u = random.uniform(-2, 2, 4), random.uniform(-3, 3, 2)
        a = mod.rhs(0.0, x, u=u)[2:]
        state = dict(zip(mod.q_names, x, strict=False)) | dict(zip(mod.v_names, x[2:], strict=True))
        turns = {th2: state["th2"], th3: state["th2"] + state["bend"]}
        turns |= {w2: state["th2_dot"], w3: state["th2_dot"] + state["bend_dot"]}
        turns |= {a2: a[mod.q_names.index("th2")], a3: a.sum()}
        numbers = turns | {sympy.Symbol(k): v for k, v in (values | dict(zip(mod.u_names, u, strict=True))).items()}
        y = dict(zip(mod.y_names, mod.outputs(0.0, x, u=u), strict=True))
        for level, letter in (("position", "r"), ("velocity", "v"), ("acceleration", "a")):
            for axis in "xy":
                expected = float(sympy.S(BOOK[level][f"r{axis}"]).subs(numbers))
                assert abs(y[f"{letter}_{axis}"] - expected) <= 1e-12 * max(1.0, abs(expected))
        # the accelerations themselves satisfy the book's equations
        mass = np.array(book("mass_matrix").subs(numbers), dtype=float)
        force = np.array(book("force").subs(numbers), dtype=float)[:, 0]
        found = mass @ [numbers[a2], numbers[a3]]
        assert np.abs(found - force).max() <= 1e-12 * max(1.0, np.abs(force).max())
