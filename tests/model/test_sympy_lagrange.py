"""SymPy's Lagrange's method with its multipliers, System with a closed loop, files, names, and what is refused."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy
from model_files import described, load
from refusals import refused, refuses
from sympy import symbols
from sympy.physics.mechanics import KanesMethod, LagrangesMethod, System, dynamicsymbols
from sympy_systems import cartesian_pendulum, double_pendulum, four_bar, knife_edge, rolling_disc

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


def own_four_bar() -> eg.Model:
    """The same linkage in our own bodies and joints; link 1 is ground, from its end at (l1/2, 0)."""
    m = eg.Model("own")
    for k in range(1, 5):
        m.parameter(f"l{k}", LENGTHS[f"l{k}"])
    m.parameter("rho", 997.0)
    bodies = [
        m.body(f"link{k}", mass=f"rho*l{k}", com=(f"l{k}/2", 0, 0), inertia={"zz": f"rho*l{k}**3/12"})
        for k in (2, 3, 4)
    ]
    m.revolute("A", m.ground.at("l1/2", 0, 0), bodies[0], coordinate="q1")
    m.revolute("B", bodies[0].at("l2", 0, 0), bodies[1], coordinate="q2")
    m.revolute("C", bodies[1].at("l3", 0, 0), bodies[2], coordinate="q3")
    m.revolute("D", bodies[2].at("l4", 0, 0), m.ground.at("-l1/2", 0, 0))
    return m


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
    own = own_four_bar().compile(target="numpy", independent=["q1"])
    own_x = own.x0(**PLACE, q1_dot=0.2)
    order = [own.q_names.index(name) for name in PLACE if name in own.q_names]
    assert own.rhs(0.0, own_x)[own.n_q :][order] == pytest.approx(accelerations[: len(order)], abs=1e-10)
    assert module.energy(x)[0] == pytest.approx(own.energy(own_x)[0], rel=1e-12)
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
    model = eg.from_sympy(rolling_disc(), "disc", parameters={"g": 9.81, "r": 0.26, "m": 3.43}, initial=initial)
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
    driven = eg.from_sympy(
        method, "shaken", parameters={**values, a: 0.1, w: 3.0}, specified={lift: a * sympy.sin(w * t)}
    ).compile(target="numpy")
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
    for method, call in (
        (LagrangesMethod(x.diff() ** 2, [x]), "form_lagranges_equations"),
        (System(), "form_eoms"),
    ):
        refuses(f"EG-MISSING {call}", eg.from_sympy, method)
    formed = double_pendulum()
    with refused("EG-MISSING kanes_equations"):
        eg.from_sympy(
            KanesMethod(
                formed._inertial, formed.q, formed.u, [q.diff() - u for q, u in zip(formed.q, formed.u, strict=True)]
            )
        )
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
