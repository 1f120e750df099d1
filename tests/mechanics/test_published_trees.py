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
from sweeps import TARGETS

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
        com, inertia = GIVEN["r_com_link_frame"][i], GIVEN["I_com_link_frame_diag"][i]
        link = m.body(f"link{i + 1}", GIVEN["m"][i], com=com, inertia=inertia)
        near = link.at(-a, -d * sin(alpha), -d * cos(alpha), rpy=(-alpha, 0, 0))
        m.revolute(f"q{i + 1}", last, near)
        last = link
    m.initial.update({f"q{i + 1}": q for i, q in enumerate(QN)})
    return m


@cache
def compiled(method: str) -> Any:
    kernels = ("mass_matrix", "inverse_dynamics", "rhs", "poses")
    return build_puma().derive(method).compile(target="numpy", kernels=kernels)


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
ABSOLUTE = {"th2": th2, "th2_dot": w2, "th2_ddot": a2}
ABSOLUTE |= {"bend": th3 - th2, "bend_dot": w3 - w2, "bend_ddot": a3 - a2}
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


# -- Andrews' squeezer -------------------------------------------------------------------------------------------------
ANGLES = ("beta", "theta", "gamma", "phi", "delta", "omega", "epsilon")
SQUEEZER = models.reference("andrews_squeezer")
END = SQUEEZER["t_end"]


@pytest.fixture(scope="session", params=["embedding", pytest.param("lagrange", marks=pytest.mark.thorough)])
def squeezer(request: pytest.FixtureRequest, module: Callable[..., Any]) -> Any:
    return module("andrews_squeezer", request.param, "cython")


@pytest.fixture(scope="session")
def squeezed(squeezer: Any) -> Any:
    return squeezer.simulate((0, END), rtol=1e-12, atol=1e-14)


def residual(module: Any, x: np.ndarray) -> float:
    """max |C| over all rows (m, rad) of states as columns."""
    return float(np.abs(module.constraints(x[: module.n_q], rows="all")).max())


def test_initial_position_and_accelerations(squeezer: Any) -> None:
    given = SQUEEZER["initial_conditions"]
    x = squeezer.x0()
    names = squeezer.q_names
    for name in ANGLES:
        assert abs(x[names.index(name)] - float(given["q"][name])) <= 1e-13
    a = dict(zip(names, squeezer.rhs(0.0, x)[squeezer.n_q :], strict=True))
    expected = dict.fromkeys(ANGLES, 0.0)
    expected |= {"beta": float(given["qddot_beta"]), "theta": float(given["qddot_theta"])}
    for name in ANGLES:
        assert abs(a[name] - expected[name]) <= 1e-11 * expected["beta"], name


def test_seven_angles_of_the_reference(squeezed: Any) -> None:
    for name in ANGLES:
        published = SQUEEZER["reference_published"][name]
        assert abs(squeezed[name][-1] - published) <= 1e-8 * abs(published), name
        rate = SQUEEZER["reference_published"][name + "_dot"]
        assert abs(squeezed[name + "_dot"][-1] - rate) <= 1e-7 * abs(rate), name


def test_raw_states_of_plain_solve_ivp(squeezer: Any) -> None:
    solution = solve_ivp(squeezer.rhs, (0, END), squeezer.x0(), method="DOP853", rtol=1e-12, atol=1e-14)
    assert solution.success
    assert residual(squeezer, solution.y) < 1e-10
    final = dict(zip(squeezer.x_names, solution.y[:, -1], strict=True))
    for name in ANGLES:
        published = SQUEEZER["reference_published"][name]
        assert abs(final[name] - published) <= 1e-8 * abs(published), name


# -- A slider-crank in free motion -------------------------------------------------------------------------------------
NAMES = {"theta": "theta", "beta": "beta", "x": "x", "thetadot": "theta_dot", "xdot": "x_dot"}


@pytest.mark.parametrize("method", ["embedding", pytest.param("lagrange", marks=pytest.mark.thorough)])
@pytest.mark.parametrize("speed", [10, 150])
def test_trajectory_equals_the_reference(module: Callable[..., Any], speed: int, method: str) -> None:
    given = models.reference("planar_slider_crank_dynamics")["reference"][f"omega{speed}"]
    mod = module("free_slider_crank", method, "cython")
    times = [float(t) for t in given["values"]]
    initial = {"theta": 0.0, "theta_dot": float(speed)}
    run = mod.simulate((0, times[-1]), initial, t_eval=[0.0, *times], rtol=1e-13, atol=1e-14)
    for k, row in enumerate(given["values"].values(), start=1):
        for theirs, ours in NAMES.items():
            expected = float(row[theirs])
            assert abs(run[ours][k] - expected) <= 1e-9 * max(1.0, abs(expected)), (times[k - 1], ours)
        rod = run["theta_dot"][k] + run["bend_dot"][k]
        assert abs(rod - float(row["betadot"])) <= 1e-9 * max(1.0, abs(float(row["betadot"])))


@pytest.mark.parametrize("speed", [10, 150])
def test_initial_accelerations_equal_the_reference(module: Callable[..., Any], speed: int) -> None:
    given = models.reference("planar_slider_crank_dynamics")["reference"][f"omega{speed}"]
    mod = module("free_slider_crank")
    x = mod.x0(theta=0.0, theta_dot=float(speed))
    a = dict(zip(mod.q_names, mod.rhs(0.0, x)[mod.n_q :], strict=True))
    expected = np.array([float(value) for value in given["initial_acc"]])
    ours = np.array([a["theta"], a["theta"] + a["bend"], a["x"]])
    assert np.abs(ours - expected).max() <= 1e-12 * np.abs(expected).max()


# -- Peaucellier's inversor --------------------------------------------------------------------------------------------
SQUEEZER_GIVEN = models.reference("linkages_straight_line")["peaucellier"]
R = float(SQUEEZER_GIVEN["r"])
POWER = float(SQUEEZER_GIVEN["L"]) ** 2 - float(SQUEEZER_GIVEN["s"]) ** 2


@pytest.mark.parametrize("method", ["embedding", pytest.param("lagrange", marks=pytest.mark.thorough)])
def test_Q_stays_on_its_line_over_the_motion(module: Callable[..., Any], method: str) -> None:
    mod = module("peaucellier", method, "cython")
    p = dict(zip(mod.p_names, mod.p, strict=True))
    assert p["r"] == R
    assert abs(p["L"] ** 2 - p["s"] ** 2 - POWER) <= 1e-15
    run = mod.simulate()
    assert np.ptp(run["theta"]) > 1.0
    assert np.abs(run["Q_x"] - float(SQUEEZER_GIVEN["straight_line_x"])).max() <= 1e-10
    expected = POWER / (2 * R) * np.tan(run["theta"] / 2)
    assert np.abs(run["Q_y"] - expected).max() <= 1e-10
    assert np.abs(np.hypot(run["P_x"] - R, run["P_y"]) - R).max() <= 1e-10
    # P and Q lie on one ray from O, inverse to each other
    assert np.abs(run["P_x"] * run["Q_y"] - run["P_y"] * run["Q_x"]).max() <= 1e-10
    assert np.abs(run["P_x"] * run["Q_x"] + run["P_y"] * run["Q_y"] - POWER).max() <= 1e-10
    assert run.residuals.position < 1e-11


def test_points_equal_the_reference(module: Callable[..., Any]) -> None:
    mod = module("peaucellier")
    angles = np.radians([float(key) for key in SQUEEZER_GIVEN["rows"]])
    q, _, _ = mod.kinematics(angles[None, :])
    poses = mod.poses(q)
    s = dict(zip(mod.p_names, mod.p, strict=True))["s"]
    for body, length, point in (("crank", R, "P"), ("side_qa", s, "Q"), ("side_qb", s, "Q"), ("side_pa", s, "P")):
        pose = poses[mod.body_names.index(body)]
        places = np.einsum("ijk,j->ik", pose[:2], np.array([length, 0, 0, 1]))
        expected = np.array([[float(x) for x in row[point]] for row in SQUEEZER_GIVEN["rows"].values()]).T
        assert np.abs(places - expected).max() <= 1e-10, body


# -- The minimal form --------------------------------------------------------------------------------------------------
TIGHT_RUNS = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}


@pytest.mark.parametrize("method", ["embedding", pytest.param("lagrange", marks=pytest.mark.thorough)])
@pytest.mark.parametrize(
    ("name", "end", "given"),
    [
        ("slider_crank", 1.0, {"theta": 0.3, "theta_dot": 10.0}),
        ("four_bar", 1.0, {"theta": 1.0, "theta_dot": 10.0}),
        ("spatial_loop", 1.0, {"theta": 0.4, "theta_dot": 6.0}),
    ],
)
def test_minimal_form_equals_the_tree_form(
    module: Callable[..., Any], name: str, end: float, given: dict[str, float], method: str
) -> None:
    mod = module(name, method, "cython")
    minimal = mod.minimal
    assert minimal.x_names == ("theta", "theta_dot")
    start = minimal.x0(**given)
    assert start.shape == (2,)
    assert start == pytest.approx(list(given.values()), abs=1e-15)
    times = np.linspace(0, end, 21)
    small = solve_ivp(minimal.rhs, (0, end), start, t_eval=times, **TIGHT_RUNS)
    full = solve_ivp(mod.rhs, (0, end), mod.x0(**given), t_eval=times, **TIGHT_RUNS)
    assert small.success
    assert full.success
    assert np.ptp(small.y[0]) > 1.0
    projected = mod.project(full.y)
    chosen = [mod.x_names.index("theta"), mod.x_names.index("theta_dot")]
    sizes = np.abs(projected).max(axis=1, keepdims=True)
    assert np.abs(small.y - projected[chosen]).max() <= 1e-9 * sizes[chosen].max()
    minimal.reset(projected[: mod.n_q, 0])
    expanded = minimal.expand(small.y, times)
    assert (np.abs(expanded - projected) <= 1e-9 * np.maximum(1.0, sizes)).all()


# -- Short models ------------------------------------------------------------------------------------------------------
def gait(p: dict[str, float]) -> eg.Model:
    m = eg.Model("gait", gravity=(0, -9.81, 0))
    for name, value in p.items():
        m.parameter(name, value)
    trunk = m.body("trunk", mass="TrunkMass", com=(0, "TrunkCMy", 0), inertia={"zz": "TrunkInertia"})
    m.planar("hip", m.ground, trunk, coordinates=("q1", "q2", "q3"))
    feet, k = [trunk.marker("com", at=(0, "TrunkCMy", 0)), trunk], 4
    for side in ("right", "left"):
        above, at = trunk, 0
        for name in ("Thigh", "Shank", "Foot"):
            com = ("FootCMx" if name == "Foot" else 0, f"{name}CMy", 0)
            body = m.body(f"{side}{name}", mass=f"{name}Mass", com=com, inertia={"zz": f"{name}Inertia"})
            m.torque(f"M{k}", m.revolute(f"q{k}", above.at(0, at, 0), body), m.input(f"T{k}"))
            above, at, k = body, f"-{name}Len", k + 1
            feet += [body] * (name != "Thigh")
        feet += [body.marker(part.lower(), at=(f"Contact{part}X", "ContactY", 0)) for part in ("Heel", "Toe")]
    m.force("push", feet[0], value=(m.input("Fx"), m.input("Fy"), 0))
    m.torque("turn", trunk, value=(0, 0, m.input("T3")))
    for k, foot in enumerate(feet):
        y = f"y({foot.label})"
        m.output(f"N{k}", f"(ContactStiff*max(0, -{y})**3 - {y})*(1 - ContactDamp*vy({foot.label}))")
        m.force(f"floor{k}", foot, value=(f"-ContactFric*N{k}*tanh(vx({foot.label})/(2*ContactV0))", f"N{k}", 0))
    return m


def arm(p: dict[str, Any]) -> eg.Model:
    m = eg.Model("arm", gravity=(0, 0, p["g"]), check_inertia="note")
    thin = {name: p[f"m{name}"] * p[f"l{name}"] ** 2 for name in "ACD"}  # the tutorial's rods have l^2 / 2 along
    for n, I in thin.items():
        inertia = [I / (2 if k == (n != "A") + 1 else 12) for k in range(3)]
        m.body(n, mass=p[f"m{n}"], com=(0, 0, 0 if n == "A" else p[f"l{n}"] / 2), inertia=inertia)
    A, C, D = m.bodies["A"], m.bodies["C"], m.bodies["D"]
    B = m.body("B", mass=0)
    m.revolute("q1", m.ground.at(p["dx"], 0, 0), A, coordinate="q1")
    m.revolute("q2", m.ground.at(0, p["dy"], p["dz"]), B, axis="y", coordinate="q2")
    m.revolute("q3", B, C, coordinate="q3")
    m.revolute("q4", C.at(0, 0, p["lC"]), D, axis="y", coordinate="q4")
    m.spherical("hand", A.at(0, p["lA"], 0), D.at(0, 0, p["lD"]))
    m.torsional_element("grip", "q1", law=f"-{p['k']}*angle - {p['c']}*rate")
    drum = {"around": C.at(0, 0, p["lC"], rpy=(-np.pi / 2, 0, 0)), "radius": p["r"], "sense": "positive"}
    for name, via in (("biceps", []), ("triceps", [drum])):
        own = dict(zip(("force_max", "fiber_length", "slack_length"), p[name].values(), strict=True))
        ends, excitation = (C.at(0, 0, p["lC"] / 3), D.at(0, 0, p["lD"] / 3)), m.input(f"e_{name}")
        m.muscle(name, *ends, excitation=excitation, via=via, **own)
    return m


@pytest.mark.parametrize("target", TARGETS)
def test_gait(target: str) -> None:
    """Accelerations and the ground's forces of Autolev's code, with all contacts and inputs."""
    given = models.reference("gait2d_autolev")
    mod = gait(given["parameters_SI"]).compile(target=target)
    for case in given["cases"]:
        names = ["Fx", "Fy", "T3", *(f"T{k}" for k in range(4, 10))]
        start = {f"q{k + 1}": q for k, q in enumerate(case["q"])}
        x = mod.x0(start | {f"q{k + 1}_dot": v for k, v in enumerate(case["u"])})
        inputs = dict(zip(names, case["inputs"], strict=True))
        rates = dict(zip(mod.v_names, mod.rhs(0.0, x, u=[inputs[n] for n in mod.u_names])[9:], strict=True))
        found = [rates[f"q{k}_dot"] for k in range(1, 10)]
        assert found == pytest.approx(case["qdd_autolev"], rel=1e-12, abs=1e-11)
        y = dict(zip(mod.y_names, mod.outputs(0.0, x), strict=True))
        right, left = y["N4"] + y["N5"], y["N8"] + y["N9"]
        assert [right, left] == pytest.approx([case["grf_autolev"][k] for k in (1, 4)], rel=1e-12)


def test_arm() -> None:
    """The consistent accelerations; activation follows its excitation by the published rate."""
    given = models.reference("muscle_lever_sympy")
    m = arm(given["parameters_SI"])
    q = {f"q{k + 1}": value for k, value in enumerate(given["own"]["q0"])}
    m.guess(**q)
    for method in ("lagrange", "embedding"):
        mod = m.compile(method=method, target="numpy")
        rates = dict(zip(mod.x_names, mod.rhs(0.0, mod.x0(**q)), strict=True))
        assert [rates[f"q{k}_dot"] for k in range(1, 5)] == pytest.approx(given["own"]["qdd0"], rel=1e-7)
    x = mod.x0(**q, biceps_activation=0.3, triceps_activation=0.1)
    e = {"e_biceps": 0.8, "e_triceps": 0.05}
    rates = dict(zip(mod.x_names, mod.rhs(0.0, x, u=[e[n] for n in mod.u_names]), strict=True))

    def published(e: float, a: float) -> float:
        h = np.tanh(10 * (e - a)) / 2
        return float(((0.5 + h) / (0.015 * (0.5 + 1.5 * a)) + (0.5 + 1.5 * a) * (0.5 - h) / 0.06) * (e - a))

    found = [rates["biceps_activation"], rates["triceps_activation"]]
    assert found == pytest.approx([published(0.8, 0.3), published(0.05, 0.1)], rel=1e-13)
