"""SymPy's Lagrange's method with its multipliers, System with a closed loop, files, names, and what is refused."""

from pathlib import Path
from typing import Any

import judges
import numpy as np
import pytest
import sympy
from model_files import described, load
from refusals import refused, refuses
from sympy import symbols
from sympy.physics.mechanics import (
    KanesMethod,
    LagrangesMethod,
    Particle,
    Point,
    ReferenceFrame,
    RigidBody,
    System,
    dynamicsymbols,
    inertia,
)
from sympy_systems import (
    bicycle,
    bicycle_numbers,
    cartesian_pendulum,
    double_pendulum,
    four_bar,
    knife_edge,
    pulled_pendulum,
    rolling_disc,
)

import eomgen as eg


def test_the_multiplier_is_the_force_in_the_rod() -> None:
    m, g, l = symbols("m g l")
    values = {m: 2.0, g: 9.81, l: 1.5}
    model = eg.from_sympy(cartesian_pendulum(), "pendulum", parameters=values, outputs={"tension": "2*l*lam1"})
    module = model.compile(target="numpy")
    assert module.v_names == ("x_dot", "y_dot")
    assert module.n_dof == 1
    run = module.simulate((0.0, 5.0), initial={"x": 1.5, "y": 0.0, "y_dot": -1.0}, rtol=1e-11, atol=1e-13)
    angle = np.arctan2(run["x"], -run["y"])
    rate = (run["x_dot"] ** 2 + run["y_dot"] ** 2) / 1.5**2
    assert run["tension"] == pytest.approx(2.0 * (9.81 * np.cos(angle) + 1.5 * rate), rel=1e-9, abs=1e-8)
    assert np.abs(run["energy"] - run["energy"][0]).max() < 1e-8
    # SymPy's own matrices: [M, lam_coeffs^T; coefficients of the constraint] [q''; lam] = ...
    method = cartesian_pendulum()
    x = run.x[:, 7]
    t = dynamicsymbols._t
    names = {q.diff(t): v for q, v in zip(method.q, x[2:], strict=True)} | dict(zip(method.q, x[:2], strict=True))
    system = method.mass_matrix_full.subs(names).subs(values)
    right = method.forcing_full.subs(names).subs(values)
    solved = np.linalg.solve(np.array(system, dtype=float), np.array(right, dtype=float).ravel())
    assert module.rhs(0.0, x) == pytest.approx(solved[:4], rel=1e-10, abs=1e-10)
    assert run["lam1"][7] == pytest.approx(-solved[4], rel=1e-10)


def test_a_nonholonomic_constraint_and_its_multiplier() -> None:
    module = eg.from_sympy(knife_edge(), "skate", parameters={"m": 3.0, "J": 0.4}).compile(target="numpy")
    run = module.simulate((0.0, 3.0), initial={"heading": 0.2, "x_dot": 1.5, "heading_dot": 0.7})
    heading = 0.2 + 0.7 * run.t
    assert run["heading"] == pytest.approx(heading)
    speed = run["x_dot"] * np.cos(heading) + run["y_dot"] * np.sin(heading)
    assert speed == pytest.approx(speed[0])
    assert run["y_dot"] == pytest.approx(speed[0] * np.sin(heading))
    assert run["lam1"] == pytest.approx(3.0 * speed[0] * 0.7)  # m v omega, across the edge


LENGTHS = {"l1": 0.13, "l2": 0.24, "l3": 0.21, "l4": 0.34, "rho": 997.0}
PLACE = {"q1": 2.1, "q2": 0.6655470375077588, "q3": 2.527408138024188}
SPEEDS = {"u1": 0.2, "u2": -0.17963733938852067, "u3": 0.1309060540601612}
#: SymPy 1.14, test_jointsmethod.py: mass matrix and forcing with the derivatives of the constraints below
MASS = [
    [3.452709815256506e01, 7.003948798374735e00, -4.939690970641498e00],
    [-2.203792703880936e-14, 2.071702479957077e-01, 2.842917573033711e-01],
    [-1.300000000000123e-01, -8.836934896046506e-03, 1.864891330060847e-01],
]
FORCING = [-0.031211821321648, -0.00066022608181, 0.001813559741243]


@pytest.mark.parametrize("method", [KanesMethod, LagrangesMethod])
def test_four_bar_through_system(method: Any) -> None:
    model = eg.from_sympy(four_bar(method), "linkage", parameters=LENGTHS, initial=PLACE)
    assert len(described(model)["equations"]["constraints"]) == 2  # their derivatives are not further ones
    module = model.compile(target="numpy")
    assert module.n_dof == 1
    lagrange = method is LagrangesMethod
    rates = {f"q{k[1]}_dot": x for k, x in SPEEDS.items()} if lagrange else SPEEDS
    assert module.v_names == tuple(rates)
    x = module.x0(q1=2.1, **{next(iter(rates)): 0.2})
    assert x[:3] == pytest.approx(list(PLACE.values()), abs=1e-12)
    assert x[3:] == pytest.approx(list(SPEEDS.values()), abs=1e-12)
    accelerations = module.rhs(0.0, x)[3:]
    assert accelerations == pytest.approx(np.linalg.solve(MASS, FORCING), abs=1e-10)
    q1 = module.kinematics([2.2], [0.5], [0.0])[0]
    assert np.abs(module.constraints(q1)).max() < 1e-12
    run = module.simulate((0.0, 2.0), initial={"q1": 2.1, next(iter(rates)): 3.0}, rtol=1e-10, atol=1e-12)
    assert np.abs(run["T"] - run["T"][0]).max() < 1e-8 * run["T"][0]
    # the multipliers are the forces that hold the end: they do the power that the constraints' rates say, none here,
    # and close the equations of all three joints
    q, v = x[:3], x[3:]
    y = module.outputs(0.0, x)
    left = module.inverse_dynamics(q, v, accelerations) + module.constraint_jacobian(q).T @ y
    assert np.abs(left).max() < 1e-10


def test_a_file_says_the_same(tmp_path: Path) -> None:
    initial = {"q2": 0.1, "q3": 1.97}
    model = eg.from_sympy(rolling_disc(), "disc", parameters=DISC_NUMBERS, initial=initial)
    path = tmp_path / "disc.yaml"
    model.save(path)
    again = eg.load(path)
    assert again.to_yaml() == model.to_yaml()
    one, other = (each.compile(target="numpy") for each in (model, again))
    x = one.x0(q1=0.3, q2=0.2, u1=0.4, u2=-2.0, u3=0.3)
    assert other.rhs(0.0, x) == pytest.approx(one.rhs(0.0, x), rel=1e-12)


def test_functions_of_time_may_be_specified() -> None:
    x, lift = dynamicsymbols("x lift")
    m, k, a, w = symbols("m k a w")
    t = dynamicsymbols._t
    method = LagrangesMethod(m * (x.diff(t) + lift.diff(t)) ** 2 / 2 - k * x**2 / 2, [x])
    method.form_lagranges_equations()
    values = {m: 2.0, k: 30.0}
    free = eg.from_sympy(method, "shaken", parameters=values).compile(target="numpy")
    assert free.u_names == ("lift_ddot", "lift_dot")
    assert free.rhs(0.0, [0.1, 0.0], u=[4.0, 0.3])[1] == pytest.approx(-15.0 * 0.1 - 4.0)
    law = {lift: a * sympy.sin(w * t)}
    model = eg.from_sympy(method, "shaken", parameters={**values, a: 0.1, w: 3.0}, specified=law)
    driven = model.compile(target="numpy")
    assert driven.u_names == ()
    given = {"lift": "0.1*sin(3*t)"}  # not an input itself: its rates follow
    run, other = free.simulate(1.0, {"x": 0.1}, inputs=given), driven.simulate(1.0, {"x": 0.1})
    assert np.abs(run.x[:, -1] - other.x[:, -1]).max() < 1e-12
    assert run["T"][-1] == pytest.approx(other["T"][-1], rel=1e-12)
    many = free.simulate_many(1.0, {"x": [0.1, 0.2]}, inputs=given)
    assert many["x"][0] == pytest.approx(run["x"][-1], abs=1e-8)
    refuses("EG-UNSUPPORTED lift_dot", free.simulate, 1.0, inputs={"lift": lambda t, x: 0.0})
    assert driven.rhs(0.7, [0.1, 0.0])[1] == pytest.approx(-15.0 * 0.1 + 0.9 * np.sin(2.1))


def test_what_is_not_formed_is_refused() -> None:
    x = dynamicsymbols("x")
    refuses("EG-MISSING form_lagranges_equations", eg.from_sympy, LagrangesMethod(x.diff() ** 2, [x]))
    refuses("EG-MISSING form_eoms", eg.from_sympy, System())
    formed = double_pendulum()
    with refused("EG-MISSING kanes_equations"):
        rates = [q.diff() - u for q, u in zip(formed.q, formed.u, strict=True)]
        eg.from_sympy(KanesMethod(formed._inertial, formed.q, formed.u, rates))
    refuses("EG-TYPE LagrangesMethod", lambda: eg.from_sympy(sympy.Symbol("x")))


def lagrange(expression: Any, q: list[Any], **options: Any) -> Any:
    method = LagrangesMethod(expression, q, **options)
    method.form_lagranges_equations()
    return method


def test_names_are_checked() -> None:
    x = dynamicsymbols("x")
    m, positive = symbols("m"), sympy.Symbol("m", positive=True)
    refuses("EG-NAME-TAKEN equations.m 2", lambda: eg.from_sympy(lagrange(m * x.diff() ** 2 / 2 - positive * x, [x])))
    with refused("EG-NAME-TAKEN equations.x"):
        eg.from_sympy(lagrange(m * x.diff() ** 2 / 2 - sympy.Symbol("x") * x, [x]))
    with refused("EG-NAME-UNKNOWN parameters.mass"):
        eg.from_sympy(lagrange(m * x.diff() ** 2 / 2, [x]), parameters={"mass": 1.0})
    refuses("EG-NAME-UNKNOWN inputs.F", lambda: eg.from_sympy(lagrange(m * x.diff() ** 2 / 2, [x]), inputs={"F": 1.0}))
    with refused("EG-NAME-UNKNOWN initial.z"):
        eg.from_sympy(lagrange(m * x.diff() ** 2 / 2, [x]), initial={"z": 1.0}).check()
    refuses("EG-TYPE specified", lambda: eg.from_sympy(lagrange(m * x.diff() ** 2 / 2, [x]), specified={m: 1.0}))
    pulled = lagrange(x.diff() ** 2 / 2 - m * x, [x])
    for several in ([m], {m}, {m: 0}.keys(), (name for name in "m"), np.array([m]), m):
        assert eg.from_sympy(pulled, inputs=several).compile(target="numpy").u_names == ("m",)
    refuses("EG-TYPE inputs[0] 5", eg.from_sympy, pulled, inputs=5)


@pytest.mark.parametrize(
    ("changes", "demand"),
    [
        ({"mass_matrix": [[1, "a"], ["b", 2]]}, "EG-INERTIA mass_matrix: (1, 0)"),
        ({"mass_matrix": [[1, 0]]}, "EG-SHAPE mass_matrix: 1 x 2"),
        ({"mass_matrix": [["a_dot", 0], [0, 1]]}, "EG-EXPRESSION mass_matrix: a_dot"),
        ({"forcing": ["a"]}, "EG-SHAPE forcing: 1 2"),
        ({"forcing": ["a_ddot", 0]}, "EG-REFERENCE forcing[0]: 'a_ddot'"),
        ({"forcing": ["-θ*a", 0]}, "EG-EXPRESSION forcing[0]: column 2"),
        ({"velocities": ["u", "v", "w"]}, "EG-SHAPE rates: 3 2"),
        ({"velocities": ["u", "v"], "rates": {"a": "u", "b": "u*v"}}, "EG-EXPRESSION rates.b: linear"),
        ({"velocities": ["u", "v"], "rates": {"a": "u"}}, "EG-MISSING rates: 'b'"),
        ({"constraints": ["a_dot*b_dot"]}, "EG-EXPRESSION constraints[0]: linear"),
        ({"constraints": ["a - b"], "multipliers": ["l", "n"]}, "EG-SHAPE multipliers: 2 1"),
    ],
)
def test_given_equations_are_checked(changes: dict[str, Any], demand: str) -> None:
    given = {"coordinates": ["a", "b"], "mass_matrix": [[1, 0], [0, 2]], "forcing": ["-a", "-b_dot"]} | changes
    refuses(demand.replace(" ", " equations.", 1), lambda: eg.Model.from_equations("given", **given).check())


def test_equations_stand_alone(tmp_path: Path) -> None:
    text = "name: mixed\nequations: {coordinates: [a], mass_matrix: [[1]], forcing: [0], masses: 1}\n"
    text += "bodies: {b: {mass: 1}}\n"
    for demand in ("EG-NAME-UNKNOWN equations.masses:", "EG-CONFLICT equations: bodies"):
        with refused(demand):
            load(tmp_path, text).check()


@pytest.mark.parametrize(
    ("given", "name", "latex"),
    [
        (r"\theta_1", "theta_1", r"\ddot{\theta}_1"), (r"\varphi_{max}", "varphi_max", r"\ddot{\varphi}_{max}"),
        ("θ", "theta", r"\ddot{\theta}"), ("lambda", "lambda_", r"\ddot{\lambda}"), ("q.1", "q_1", r"\ddot{q}_1"),
        ("pi", "pi_", r"\ddot{\pi}"), ("int", "int_", r"\ddot{\mathrm{int}}"), ("q_dot", "q_dot", ""),
    ],
)  # fmt: skip
def test_names_that_sympy_allows_are_taken(given: str, name: str, latex: str) -> None:
    """A name that a model cannot use is changed, which is noted; symbols as keys and LaTeX go on as before."""
    q, (m, g, l) = dynamicsymbols(given), symbols(r"m \gamma l")
    method = lagrange(m * l**2 * q.diff() ** 2 / 2 + m * g * l * sympy.cos(q), [q])
    told = {"parameters": {m: 2, l: 0.7, r"\gamma": 9.81}, "initial": {q: 0.5, q.diff(): 0.3}}
    model = eg.from_sympy(method, "p", **told, outputs={"twice": 2 * q})
    assert ("twice", model.renamed.get("coordinates")) == ("twice", {given: name} if given != name else None)
    assert model.renamed["parameters"] == {r"\gamma": "gamma"}
    assert sum(repr(given) in note for note in model.notes) == (given != name)
    equations = model.derive()
    assert latex in equations.explain(level="short").latex
    mod = equations.compile(target="numpy")
    assert (mod.q_names, mod.v_names) == ((name,), (f"{name}_dot",))
    x = mod.x0()
    assert mod.rhs(0.0, x) == pytest.approx([0.3, -9.81 / 0.7 * np.sin(0.5)], rel=1e-14)
    assert mod.outputs(0.0, x) == pytest.approx([1.0])


def test_symbols_of_a_lagrangian_and_of_equations_are_taken_too() -> None:
    angle, rate, k, mu = symbols(r"\theta \theta_dot lambda µ")
    values = {k: 2.0, mu: 4.0}
    one = eg.Model.from_lagrangian("one", mu * rate**2 / 2 - k * angle**2 / 2, [angle], parameters=values)
    two = eg.Model.from_equations("two", [angle], [[mu]], [-k * angle - 0 * rate], parameters=values)
    M, f = np.array([[mu]]), np.array([-k * angle])
    three = eg.Model.from_equations("three", {angle: 0}.keys(), M, f, parameters=values)
    for model in (one, two, three):
        assert model.renamed == {"coordinates": {r"\theta": "theta"}, "parameters": {"lambda": "lambda_", "µ": "mu"}}
        assert model.compile(target="numpy").rhs(0.0, [3.0, 0.5]) == pytest.approx([0.5, -1.5])


# -- symPy's own numbers through from_sympy ----------------------------------------------------------------------------
def state_matrix(v: float) -> np.ndarray:
    """A (4, 4) of the Whipple bicycle at a forward speed v (m/s), as SymPy's test_kane3.py prints it, to 15 digits."""
    return np.array([
        [0, 0, 1, 0],
        [0, 0, 0, 1],
        [9.48977444677355, -0.891197738059089 * v**2 - 0.571523173729245, -0.105522449805691 * v,
         -0.330515398992311 * v],
        [11.7194768719633, -1.97171508499972 * v**2 + 30.9087533932407, 3.67680523332152 * v,
         -3.08486552743311 * v],
    ])  # fmt: skip


#: SymPy 1.14, test_kane5.py: q, independent u -> q' and u' at g = 9.81, r = 0.26, m = 3.43
DISC = [
    (
        (0.3, 0.1, 1.97, -0.35, 2.27, -0.2, 1.3, 0.15),
        (0.126603940595934, 0.215942571601660, 1.28736069604936, 0.319764288376543, 0.0989146857254898,
         -0.925848952664489, -0.0181350656532944, 2.91695398184589, -0.00992793421754526, 0.0412861634829171),
    ),
    (
        (3.97, -0.28, 8.2, -0.35, 2.27, -0.25, -2.2, 0.62),
        (0.0259159090798597, 0.668041660387416, -2.19283799213811, 0.385441810852219, 0.420109283790573,
         1.45030568179066, -0.0110924422400793, -8.35617840186040, -0.154098542632173, -0.146102664410010),
    ),
]  # fmt: skip


@pytest.fixture(scope="module")
def disc() -> eg.Model:
    return eg.from_sympy(rolling_disc(), "disc", parameters=DISC_NUMBERS, initial={"q2": 0.1, "q3": 1.97})


@pytest.fixture(scope="module")
def whipple() -> eg.Model:
    """The Whipple bicycle of SymPy's own test, which takes SymPy seconds."""
    return eg.from_sympy(bicycle(), "bicycle", parameters=bicycle_numbers())


@pytest.mark.parametrize("target", ["numpy", pytest.param("cython", marks=pytest.mark.thorough)])
def test_rolling_disc(disc: eg.Model, target: str) -> None:
    module = disc.compile(target=target)
    assert module.q_names == ("q1", "q2", "q3", "q4", "q5")
    assert module.v_names == ("u1", "u2", "u3", "u4", "u5")
    assert module.n_dof == 3
    for given, expected in DISC:
        names = ("q1", "q2", "q3", "q4", "q5", "u1", "u2", "u3")
        x = module.x0(**dict(zip(names, given, strict=True)))
        assert module.rhs(0.0, x) == pytest.approx(expected, abs=1e-10)
        assert np.abs(module.jacobian(0.0, x) - judges.differences(module, x, 1e-6)).max() < 1e-7
        assert module.mass_matrix(x[:5]).shape == (5, 5)
        assert module.bias(0.0, x).shape == (5,)
        assert np.abs(module.velocity_constraints(x)).max() < 1e-13
        off = module.project(x + 0.01)
        assert np.abs(module.velocity_constraints(off)).max() < 1e-13
        assert off[:5] == pytest.approx(x[:5] + 0.01)
    run = module.simulate((0.0, 1.0), initial={"q2": 0.1, "u2": -6.0, "u1": 0.2, "q3": 0.5}, rtol=1e-10, atol=1e-12)
    height = 0.26 * np.cos(run["q2"])
    energy = run["T"] + 3.43 * 9.81 * height  # SymPy's bodies know no potential energy of their loads
    assert np.abs(energy - energy[0]).max() < 1e-8 * energy[0]
    spin = np.cos(run["q3"]) * run["u3"] - np.sin(run["q3"]) * run["u1"]  # of the turned axes about the plane's normal
    assert run["q1_dot"] == pytest.approx(spin / np.cos(run["q2"]))


#: eigenvalues of the benchmark (Meijaard and others 2007, table 2): speed -> capsize, castering, weave (re, im)
EIGENVALUES = {
    0.0: [-5.530943717653935, -3.131643247906567, 3.131643247906567, 5.530943717653935],
    1.0: [-7.110080146374418, -3.134231250665537, 3.526961709900699 + 0.807740275199301j],
    3.0: [-2.633661372536675, -10.351014672459186, 1.706756056639746 + 2.315824473843249j],
    5.0: [-0.322866429004087, -14.078389692798217, -0.775341882195846 + 4.464867713788228j],
}


@pytest.mark.parametrize("target", ["numpy", pytest.param("cython", marks=pytest.mark.thorough)])
def test_bicycle(whipple: eg.Model, target: str) -> None:
    equations = whipple.derive()
    module = equations.compile(target=target)
    assert module.n_dof == 3
    chosen = [module.x_names.index(name) for name in ("q2", "q5", "u2", "u5")]
    for speed, expected in EIGENVALUES.items():
        x = module.x0(q1=0.0, q2=0.0, q5=0.0, u2=0.0, u5=0.0, u3=speed / 0.3)
        jacobian = module.jacobian(0.0, x)
        found = np.linalg.eigvals(jacobian)
        for value in expected:
            assert np.abs(found - value).min() < 1e-7
        # SymPy, test_kane3.py: the same in independent coordinates, the others following the constraints
        tangent = judges.slopes(module.project, x, 1e-5)
        free = [module.x_names.index(name) for name in ("q1", "q2", "q5", "u2", "u3", "u5")]
        basis = np.linalg.svd(tangent)[0][:, :6]
        basis = basis @ np.linalg.inv(basis[free])
        found = (jacobian @ basis)[np.ix_(chosen, [free.index(k) for k in chosen])]
        assert np.abs(found - state_matrix(speed)).max() < 1e-7
        near = module.linearize(x, independent=["q1", "q2", "q5", "u2", "u3", "u5"])
        places = [near.states.index(name) for name in ("q2", "q5", "u2", "u5")]
        np.testing.assert_allclose(near.A[np.ix_(places, places)], state_matrix(speed), atol=1e-9)


DISC_NUMBERS = {"g": 9.81, "r": 0.26, "m": 3.43}


def sympy_matrix(kane: object, steady: dict[str, float]) -> np.ndarray:
    """A of SymPy's Linearizer in q1 .. q5, u1 .. u3 at a steady motion."""
    t = dynamicsymbols._t
    names = [*(f"q{k}" for k in range(1, 6)), *(f"u{k}" for k in range(1, 6))]
    symbols = {name: dynamicsymbols(name) for name in names}
    point = {symbols[name]: steady.get(name, 0.0) for name in names}
    point |= {symbols[name].diff(t): 0 for name in names if name.startswith("u")}
    point |= {symbols[name].diff(t): steady.get(name + "_dot", 0.0) for name in names if name.startswith("q")}
    numbers = {sympy.Symbol(name): value for name, value in DISC_NUMBERS.items()}
    A, _, _ = kane.linearize(A_and_B=True, op_point=[point, numbers])  # type: ignore[attr-defined]
    return np.array(A.subs(numbers), dtype=float)


def test_the_rolling_disc_as_sympy_linearizes_it() -> None:
    kane = rolling_disc("CRAMER")
    mod = eg.from_sympy(kane, "disc", parameters=DISC_NUMBERS).compile(target="numpy")
    x = mod.x0(u2=-6.0)
    state = dict(zip(mod.x_names, x.tolist(), strict=True))
    rates = dict(zip((f"{n}_dot" for n in mod.q_names), mod.rhs(0.0, x)[: mod.n_q].tolist(), strict=True))
    near = mod.linearize(x, independent=["q1", "q2", "q3", "q4", "q5", "u1", "u2", "u3"])
    assert near.states == ("q1", "q2", "q3", "q4", "q5", "u1", "u2", "u3")
    assert near.is_steady
    assert not near.is_equilibrium
    expected = sympy_matrix(kane, state | rates)
    assert np.abs(expected).max() > 1.0
    np.testing.assert_allclose(near.A, expected, atol=1e-10)
    refuses("EG-UNSUPPORTED second-order", near.second_order)


def reference() -> eg.Model:
    """The double pendulum in our own bodies and joints, in relative angles."""
    m = eg.Model("pendulums", gravity=(0, -9.81, 0))
    one = m.body("one", mass=0.7, com=(0, -0.4, 0))
    two = m.body("two", mass=1.1, com=(0, -0.9, 0))
    m.revolute("A", m.ground, one, coordinate="a")
    m.revolute("B", one.at(0, -0.4, 0), two, coordinate="b")
    return m


@pytest.mark.parametrize("swap", [False, True])
def test_double_pendulum(swap: bool) -> None:
    values = {"l1": 0.4, "l2": 0.9, "m1": 0.7, "m2": 1.1, "g": 9.81}
    module = eg.from_sympy(double_pendulum(swap), "kane", parameters=values).compile(target="numpy")
    own = reference().compile(target="numpy")
    assert module.v_names == (("w2", "w1") if swap else ("w1", "w2"))  # in the order of q1 and q2
    for q1, q2, w1, w2 in np.random.default_rng(3).uniform(-2.0, 2.0, (5, 4)):
        ours = own.rhs(0.0, [q1, q2 - q1, w1, w2 - w1])
        expected = [w1, w2, ours[2], ours[2] + ours[3]]
        assert module.rhs(0.0, [q1, q2, w1, w2]) == pytest.approx(expected, rel=1e-11, abs=1e-11)
        kinetic, _ = module.energy([q1, q2, w1, w2])
        assert kinetic == pytest.approx(own.energy([q1, q2 - q1, w1, w2 - w1])[0])
    assert module.minimal.rhs(0.0, [0.1, 0.2, 0.3, 0.4]) == pytest.approx(module.rhs(0.0, [0.1, 0.2, 0.3, 0.4]))


def test_auxiliary_speeds_and_inputs() -> None:
    values = {"m": 2.0, "l": 0.8, "g": 9.81}
    model = eg.from_sympy(pulled_pendulum(), "pulled", parameters=values, initial={"theta": 0.4})
    module = model.compile(target="numpy")
    assert module.u_names == ("torque",)
    assert module.y_names == ("pull",)
    run = module.simulate((0.0, 2.0), initial={"theta": 0.4, "omega": 1.0}, inputs={"torque": lambda t, x: np.sin(t)})
    theta, omega = run["theta"], run["omega"]
    assert run["pull"] == pytest.approx(2.0 * (9.81 * np.cos(theta) + 0.8 * omega**2), rel=1e-9)
    expected = -9.81 / 0.8 * np.sin(theta) + np.sin(run.t) / (2.0 * 0.8**2)
    assert run["omega_dot"] == pytest.approx(expected, rel=1e-9, abs=1e-9)


def sliding_bead(vertical: bool, push_up: bool = False) -> KanesMethod:
    """A bead with friction mu N on the parabola y = c x^2/2; an auxiliary speed along its normal, or vertical."""
    m, g, mu, c = sympy.symbols("m g mu c")
    x, u, w, N, F = dynamicsymbols("x u w N F", positive=True)
    frame, origin, bead = ReferenceFrame("A"), Point("O"), Point("P")
    origin.set_vel(frame, 0)
    bead.set_pos(origin, x * frame.x + c * x**2 / 2 * frame.y)
    length = sympy.sqrt(1 + c**2 * x**2)
    along, across = (frame.x + c * x * frame.y) / length, (frame.y - c * x * frame.x) / length
    bead.set_vel(frame, u * length * along + w * (frame.y if vertical else across))
    kane = KanesMethod(frame, [x], [u], [x.diff() - u], u_auxiliary=[w])
    push = F * frame.x + (F * frame.y if push_up else 0 * frame.y)
    loads = [(bead, -m * g * frame.y), (bead, N * across - mu * N * along), (bead, push)]
    kane.kanes_equations([Particle("bead", bead, m)], loads)
    return kane


@pytest.mark.parametrize("vertical", [False, True])
def test_a_force_of_an_auxiliary_speed_acts_in_the_equations_of_motion(vertical: bool) -> None:
    m, g, mu, c = 2.0, 9.81, 0.3, 0.7
    model = eg.from_sympy(sliding_bead(vertical), "bead", {"m": m, "g": g, "mu": mu, "c": c}, inputs=["F"])
    mod = model.compile(target="numpy")
    assert (mod.u_names, mod.y_names, set(mod.p_names)) == (("F",), ("N",), {"m", "g", "mu", "c"})
    for x, u, F in ((0.0, 1.0, 20.0), (0.4, 1.7, 3.0), (-0.8, 0.5, -1.0)):
        t = np.array([1.0, c * x]) / np.hypot(1.0, c * x)
        n = np.array([-t[1], t[0]])
        # Newton: m (x'' (1, c x) + u^2 (0, c)) = N (n - mu t) + (F, -m g)
        left = np.column_stack([m * np.array([1.0, c * x]), -(n - mu * t)])
        expected = np.linalg.solve(left, [F, -m * g - m * c * u**2])
        assert mod.rhs(0.0, [x, u], u=[F])[1] == pytest.approx(expected[0], rel=1e-12)
        assert mod.outputs(0.0, [x, u], u=[F])[0] == pytest.approx(expected[1], rel=1e-12)


def test_forces_of_auxiliary_speeds_that_do_not_follow_are_named() -> None:
    kane = sliding_bead(vertical=False, push_up=True)
    refuses("EG-UNDETERMINED equations F N 2 1 inputs=", eg.from_sympy, kane, "bead")
    values = {"m": 1.0, "g": 9.81, "mu": 0.1, "c": 0.5}
    assert eg.from_sympy(kane, "bead", values, inputs=["F"]).compile(target="numpy").u_names == ("F",)


def test_quaternion_rates_written_implicitly() -> None:
    """Kinematics of a quaternion as angular velocity = given and e.e' = 0, norm as configuration constraint."""
    e = e0, e1, e2, e3 = dynamicsymbols("e0:4")
    w = dynamicsymbols("w1:4")
    i1, i2, i3, m = sympy.symbols("i1:4 m")
    t = dynamicsymbols._t
    ground, body, point = ReferenceFrame("A"), ReferenceFrame("B"), Point("O")
    body.orient_quaternion(ground, e)
    point.set_vel(ground, 0)
    own = body.ang_vel_in(ground)
    given = w[0] * body.x + w[1] * body.y + w[2] * body.z
    body.set_ang_vel(ground, given)
    kd = [(own - given).dot(a) for a in (body.x, body.y, body.z)] + [sum(a * a.diff(t) for a in e)]
    norm = {"configuration_constraints": [sum(a**2 for a in e) - 1], "explicit_kinematics": False}
    kane = KanesMethod(ground, q_ind=[e1, e2, e3], q_dependent=[e0], u_ind=w, kd_eqs=kd, **norm)
    kane.kanes_equations([RigidBody("b", point, body, m, (inertia(body, i1, i2, i3), point))], [])
    mod = eg.from_sympy(kane, "spin", parameters={i1: 1.0, i2: 2.0, i3: 3.0}, guess={"e0": 1.0}).compile(target="numpy")
    x = {"e0": 0.8, "e1": 0.36, "e2": 0.48, "e3": 0.0, "w1": 0.3, "w2": 0.2, "w3": 0.5}
    got = dict(zip(mod.x_names, mod.rhs(0.0, [x[n] for n in mod.x_names]), strict=False))
    np.testing.assert_allclose([got["w1"], got["w2"], got["w3"]], [-0.1, 0.15, -0.02], atol=1e-10)
