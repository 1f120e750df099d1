"""Quantities by name, values put in, equations near a state, views with names of instances, and what is refused."""

import copy
import math
import pickle
from functools import cache
from typing import Any
from xml.etree import ElementTree

import models
import numpy as np
import pytest
import sympy as sp
from refusals import refused, refuses
from shown_numbers import METHODS, number, random_state, state_values
from sweeps import part_of
from sympy.physics.mechanics import dynamicsymbols

import eomgen as eg


def pendulum() -> eg.Model:
    """A uniform rod with a motor."""
    m = eg.Model("pendulum", gravity=(0, "-g", 0))
    for name, value in {"g": 9.81, "l": 0.8, "m": 1.5}.items():
        m.parameter(name, value)
    m.input("tau")
    rod = m.body("rod", mass="m", com=(0, "-l/2", 0), inertia={"zz": "m*l**2/12"})
    rod.marker("tip", at=(0, "-l", 0))
    m.revolute("hinge", m.ground, rod, coordinate="theta")
    m.torque("motor", "hinge", "tau")
    return m


@cache
def two_arms() -> eg.Model:
    """A cart that carries two arms of one component, ``left`` and ``x``; the second one's prefix is not its name."""
    arm = eg.Model("arm")
    arm.parameter("l", 0.5, unit="m")
    arm.parameter("m", 1.0, unit="kg")
    arm.input("tau", 0.2)
    rod = arm.body("rod", mass="m", com=(0, "-l/2", 0), inertia={"zz": "m*l**2/12"})
    rod.marker("end", at=(0, "-l", 0))
    arm.revolute("hinge", arm.attachment("top"), rod)
    arm.torque("motor", "hinge", "tau")
    model = eg.Model("two_arms", gravity=(0, "-g", 0))
    model.parameter("g", 9.81)
    cart = model.body("cart", mass=3)
    model.prismatic("rail", model.ground, cart, axis="x", coordinate="s")
    model.add(arm, "left_", at=cart.at(-0.3, 0, 0), l=0.4)
    model.add(arm, "x_", at=cart.at(0.3, 0, 0), l=0.6)
    return model


# -- methods ----------------------------------------------------------------------------------------------------------


def test_free_bodies_of_a_pendulum_by_hand() -> None:
    """m x'' = H, m y'' = V - m g, m l^2/12 theta'' = moment of the hinge about the centre, and the hinge's is tau."""
    equations = pendulum().derive("newton_euler")
    body = equations.free_bodies["rod"]
    names = "m l g theta theta_dot theta_ddot hinge_F_x hinge_F_y hinge_M_z tau"
    m, l, g, theta, rate, a, across, up, moment, tau = sp.symbols(names)
    along = l / 2 * sp.sin(theta), -l / 2 * sp.cos(theta)

    def second(f: Any) -> Any:
        return f.diff(theta) * a + f.diff(theta, 2) * rate**2

    assert sp.simplify(body.force[0].lhs - m * second(along[0])) == 0
    assert sp.simplify(body.force[0].rhs - across) == 0
    assert sp.simplify(body.force[1].lhs - m * second(along[1])) == 0
    assert sp.simplify(body.force[1].rhs - (up - m * g)) == 0
    assert sp.simplify(body.moment[2].lhs - m * l**2 / 12 * a) == 0
    assert sp.simplify(body.moment[2].rhs - (moment - along[0] * up + along[1] * across)) == 0
    assert equations.joint_forces["hinge"] == [sp.Eq(moment, tau)]


OF_METHODS = {
    "gibbs_function": {"gibbs_appell"},
    "hamiltonian": {"hamilton"},
    "momentum_rates": {"hamilton"},
    "block_system": {"augmented", "newton_euler", "amalgamated"},
    "free_bodies": {"newton_euler", "amalgamated"},
    "joint_forces": {"newton_euler", "amalgamated"},
}


@pytest.mark.parametrize("method", METHODS)
def test_what_a_method_does_not_have_is_refused_by_name(method: str) -> None:
    equations = pendulum().derive(method)
    for attribute, methods in OF_METHODS.items():
        if method in methods:
            getattr(equations, attribute)
            continue
        refuses(" ".join(["EG-UNAVAILABLE", *map(repr, (method, *methods))]), getattr, equations, attribute)
        assert not hasattr(equations, attribute)


def test_a_tree_whose_mass_matrix_has_no_inverse_has_no_hamiltonian() -> None:
    m = eg.Model("loop", gravity=(0, -9.81, 0))
    crank, rod, slider = m.body("crank", mass=1, inertia={"zz": 1}), m.body("rod", mass=0), m.body("slider", mass=0)
    models.join_slider_crank(m, (crank, rod, slider), 0.2, 0.5, "theta phi s")
    m.guess(s=0.6)
    m.initial(theta=0.4)
    refuses("EG-UNAVAILABLE inverse", lambda: m.derive("hamilton", independent=["theta"]).hamiltonian)


def test_the_potential_of_a_spring_has_a_derivative_which_is_its_force() -> None:
    m = eg.Model("sprung")
    for name, value in {"k": 3.0, "l0": 0.2, "a": 0.1}.items():
        m.parameter(name, value)
    block = m.body("block", mass=1.0)
    m.prismatic("rail", m.ground, block, axis="x", coordinate="s")
    m.spring("k1", m.ground.at("a", 0, 0), block, stiffness="k", length="l0")
    equations = m.derive()
    slope = sp.diff(equations.V, sp.Symbol("s"))
    assert not slope.has(sp.Derivative)
    for s in (0.7, -1.3):
        values = {"k": 3.0, "l0": 0.2, "a": 0.1, "s": s}
        assert float(slope.subs(values)) == pytest.approx(3 * (abs(s - 0.1) - 0.2) * math.copysign(1, s - 0.1))
        assert float(equations.force[0].subs(values)) == pytest.approx(-float(slope.subs(values)))
    assert "sgn(s - a)" in str(equations)
    assert "no value at x = 0" in str(equations)


# -- values put in, functions of time, names --------------------------------------------------------------------------


@pytest.mark.quick
def test_values_put_in_one_after_the_other() -> None:
    equations = pendulum().derive()
    m, l, g, c = sp.symbols("m l g c")
    assert sp.nsimplify(equations.with_parameters(l=0.5).mass_matrix[0], rational=True, tolerance=1e-14) == m / 12
    assert equations.subs({"theta": 0, sp.Symbol("tau"): "2*c"}).force == sp.Matrix([2 * c])
    assert equations.subs({"tau": "2*c"}).subs({"c": 3, "theta": 0}).force == sp.Matrix([6])
    swapped = equations.subs({"l": m, "m": l})  # all at once
    assert sp.simplify(swapped.mass_matrix[0] - l * m**2 / 3) == 0
    functions = equations.with_dynamicsymbols().subs({dynamicsymbols("theta"): sp.pi / 2})
    assert sp.simplify(functions.force[0] - (dynamicsymbols("tau") - m * g * l / 2)) == 0
    tip = equations.with_parameters(l=2).subs({"theta": "pi/2"}).poses["rod.tip"]
    assert list(tip[:3, 3]) == [2, 0, 0]
    assert sp.simplify(equations.mass_matrix[0] - l**2 * m / 3) == 0  # as it was


@pytest.mark.parametrize("method", METHODS)
def test_names_of_instances_are_taken_with_dots_everywhere(method: str) -> None:
    equations = two_arms().derive(method)
    symbol = sp.Symbol("left_hinge")
    assert equations.subs({"left.hinge": 0}).mass_matrix == equations.subs({symbol: 0}).mass_matrix
    assert symbol not in equations.subs({"left.hinge": "x.hinge/2"}).mass_matrix.free_symbols
    assert equations.subs({sp.Symbol("left.tau"): sp.Symbol("x.tau")}).force[1].has(sp.Symbol("x_tau"))
    by_mapping = equations.with_parameters({"left.l": 2, "x.l": "left.l"})
    assert by_mapping.mass_matrix == equations.with_parameters(left_l=2, x_l="left_l").mass_matrix
    for name in ("poses", "velocities", "accelerations"):
        parts = getattr(equations, name)
        assert parts["left.rod.end"] == parts["left_rod.end"]
        assert equations.written(name, "x.rod") == equations.written(name, "x_rod")
    assert equations.generalized_forces["left.motor"] == sp.Matrix([0, sp.Symbol("left_tau"), 0])
    at = {"left.hinge": 0, "x.hinge": sp.pi, "s": 0}
    assert equations.linearize(at=at).A == equations.linearize(at={k.replace(".", "_"): v for k, v in at.items()}).A
    if method in ("newton_euler", "amalgamated"):
        assert equations.free_bodies["x.rod"] == equations.free_bodies["x_rod"]
        assert equations.joint_forces["x.hinge"] == equations.joint_forces["x_hinge"]


def test_independent_coordinates_are_named_with_dots() -> None:
    named = two_arms().derive(independent=["s", "left.hinge", "x.hinge"])
    assert named.independent == ("s", "left_hinge", "x_hinge")
    refuses("EG-NAME-UNKNOWN independent left_hnge", lambda: two_arms().derive(independent=["left.hnge"]))


@pytest.mark.parametrize(
    ("ask", "word"),
    [
        (lambda e: e.subs({"left.hnge": 0}), "EG-NAME-UNKNOWN left_hnge left_hinge"),
        (lambda e: e.subs({"left.hinge": 0, "left_hinge": 1}), "EG-CONFLICT left_hinge"),
        (lambda e: e.subs({"s": "1 +"}), "EG-EXPRESSION s"),
        (lambda e: e.subs({"s": [1]}), "EG-TYPE s"),
        (lambda e: e.subs([("s", 1)]), "EG-TYPE name"),
        (lambda e: e.with_parameters({"left.l": 1}, left_l=2), "EG-CONFLICT left_l"),
        (lambda e: e.with_parameters({"left.hinge": 1}), "EG-NAME-UNKNOWN left_hinge"),
        (lambda e: e.with_parameters(3), "EG-TYPE 3"),
        (lambda e: e.poses["left.rodd"], "EG-NAME-UNKNOWN left_rodd left_rod"),
        (lambda e: e.generalized_forces["left.moter"], "EG-NAME-UNKNOWN left_moter left_motor?"),
        (lambda e: e.linearize(at={"left.phi": 0}), "EG-NAME-UNKNOWN left_phi"),
        (lambda e: e.written("masmatrix"), "EG-NAME-UNKNOWN masmatrix mass_matrix?"),
        (lambda e: e.written("M"), "EG-NAME-UNKNOWN mass_matrix"),
        (lambda e: e.written("poses"), "EG-MISSING poses cart"),
        (lambda e: e.written("T", "rod"), "EG-CONFLICT T rod"),
    ],
)
def test_faults_are_named(ask: Any, word: str) -> None:
    refuses(word, lambda: ask(two_arms().derive()))


def test_functions_of_time_are_those_of_sympy() -> None:
    a = pendulum().derive().with_dynamicsymbols().accelerations["rod.tip"]
    theta, l, t = dynamicsymbols("theta"), sp.Symbol("l"), dynamicsymbols._t
    place = sp.Matrix([l * sp.sin(theta), -l * sp.cos(theta), 0])
    assert sp.simplify(a.linear - place.diff(t, 2)) == sp.zeros(3, 1)
    assert a.angular == sp.Matrix([0, 0, theta.diff(t, 2)])
    assert sp.simplify(a.center_of_mass - place.diff(t, 2) / 2) == sp.zeros(3, 1)


def test_the_coordinate_of_a_cut_joint_is_a_sum_of_angles() -> None:
    equations = eg.load_example("slider_crank").derive()
    assert list(equations.loop_coordinates) == ["C"]
    assert sp.expand(equations.loop_coordinates["C"] + sp.Symbol("theta") + sp.Symbol("B")) == 0


# -- what a view shows and lacks --------------------------------------------------------------------------------------


def test_a_view_shows_its_values_and_its_equations() -> None:
    m = eg.Model("pendulum", gravity=(0, "-g", 0))
    for name in ("m", "l", "g"):
        m.parameter(name)
    m.revolute("pin", m.ground, m.body("bob", mass="m", com=(0, "-l", 0)), coordinate="theta")
    equations = m.derive()
    view = equations.with_parameters(l=0.5, g=9.81)
    lines = str(view).splitlines()
    assert lines[1:3] == ["  method embedding, 1 degree of freedom", "  with l = 0.5, g = 9.81"]
    assert "  m θ''/4 = -4.905 m sin(θ)" in lines
    assert "operations" not in str(view)
    page = view._repr_html_()
    ElementTree.fromstring(f"<div>{page}</div>")
    assert "<mn>9.81</mn>" in page
    assert "<mn>4.905</mn>" in page
    assert r"\frac{1}{4} m \ddot{\theta} = -4.905 m \sin \theta" in view._repr_latex_()
    m.actuator("motor", "pin", "where(theta > 0.1, 1, 0)")
    assert "<mtext>if&#160;</mtext>" in m.derive()._repr_html_()  # MathML drops plain blanks at ends of a text
    chain = equations.subs({"l": "2*r_0"}).subs({"r_0": sp.Rational(1, 8)})
    assert "  with l = 2 r₀, r₀ = 1/8" in str(chain).splitlines()
    still = equations.subs({"theta_ddot": 3, "theta": "pi/2"})
    assert "M v' = f with v' = (3)" in str(still).splitlines()


@pytest.mark.parametrize(
    "name", part_of(("double_pendulum", "slider_crank", "rolling_disc", "car_axis"), lambda n: n != "rolling_disc")
)
def test_the_formulas_of_a_view_are_the_compiled_ones(name: str) -> None:
    """Parameters and the place of a consistent state put in: the same numbers as those of the module there."""
    equations = eg.load_example(name).derive()
    module: Any = equations.compile("numpy")
    x = random_state(module, 4)
    values = state_values(module, x)
    parameters = dict(zip(module.p_names, map(float, module.p), strict=True))
    view = equations.with_parameters(parameters).subs({n: values[n] for n in module.x_names[: module.n_q]})
    left = {str(s) for s in view.mass_matrix.free_symbols.union(*(x.free_symbols for _, x in view.intermediates))}
    assert left.isdisjoint({*parameters, *module.x_names[: module.n_q]})
    wanted = module.embedded_mass_matrix(x[: module.n_q])
    np.testing.assert_allclose(number(view, "mass_matrix", values), wanted, atol=1e-10 * np.abs(wanted).max())
    terms = wanted * module.rhs(0.0, x)[module.n_q :][list(module.metadata["independent"])]
    force = number(view, "force", values)[:, 0]
    np.testing.assert_allclose(force, terms.sum(axis=1), atol=1e-9 * np.abs(terms).max())
    assert max(map(len, str(view).splitlines())) <= 80
    ElementTree.fromstring(f"<div>{view._repr_html_()}</div>")


def test_equations_and_views_go_through_pickle_and_copy() -> None:
    view = two_arms().derive("newton_euler").with_dynamicsymbols().subs({"left.hinge": 0, "s_ddot": 0})
    for one in (pendulum().derive("newton_euler"), view):
        for twin in (pickle.loads(pickle.dumps(one)), copy.deepcopy(one)):
            assert str(twin) == str(one)
            assert twin.T == one.T
            for name in ("poses", "velocities", "free_bodies", "joint_forces"):
                assert dict(getattr(twin, name)) == dict(getattr(one, name))
            assert twin.generalized_forces == one.generalized_forces


def test_what_is_read_depends_on_the_model_alone_and_changes_nothing() -> None:
    first, other = (eg.load_example("four_bar").derive() for _ in range(2))
    for name in ("T", "generalized_forces", "gamma", "quadratic_velocity", "momenta"):
        getattr(other, name)
    other.linearize()
    assert first.intermediates == other.intermediates
    assert first.force == other.force
    one, two = (e.compile(target="numpy") for e in (first, other))
    np.testing.assert_array_equal(one.rhs(0.0, one.x0()), two.rhs(0.0, two.x0()))
    assert one.metadata["operations"] == two.metadata["operations"]


@pytest.mark.parametrize("method", ["embedding", "newton_euler"])
def test_a_solution_with_values_is_that_of_a_model_with_numbers(method: str) -> None:
    """M of the view's solution is the compiled one at other values than the declared ones, which are not in it."""
    equations = eg.load_example("two_link_manipulator").derive(method)
    values = {"l2": 0.7, "m3": "3*m2", "tau3": 0.25}
    view = equations.subs(values)
    solution = view.explain("short")
    assert solution.difference < 1e-10
    assert "with `l2` = 0.7, `m3` = " in solution.title
    whole = equations.compile("numpy")
    m2 = dict(zip(whole.p_names, whole.p, strict=True))["m2"]
    module = whole.bind(p={"l2": 0.7, "m3": 3 * m2}, u={"tau3": 0.25})
    numbers = dict(zip(module.x_names, module.x0(), strict=True)) | dict(zip(module.p_names, module.p, strict=True))
    at = {sp.Symbol(name): value for name, value in (numbers | {"tau2": 0.0}).items()}
    n = module.n_q
    wanted = module.embedded_mass_matrix(module.x0()[:n]) @ module.rhs(0.0, module.x0())[n:]
    assert [float(x.subs(at)) for x in view.force] == pytest.approx(list(wanted), rel=1e-11)
    with refused("EG-UNAVAILABLE left_l 0.5 s 0"):
        two_arms().derive().with_parameters({"left.l": 0.5}).subs({"s": 0}).explain()


def test_what_is_compiled_is_computed_by_the_equations() -> None:
    view = two_arms().derive().with_parameters({"left.l": 0.5})
    for name in ("compile", "operations", "report"):
        refuses(f"EG-UNAVAILABLE '{name}'", getattr, view, name)
    assert view.source.method == view.method
    refuses("EG-UNAVAILABLE 'mass_matrx' mass_matrix", getattr, view, "mass_matrx")


# -- near a state: what holds and what is refused ---------------------------------------------------------------------


def test_entries_near_a_state_are_those_of_textbooks() -> None:
    """Of a cart with a rod as pendulum and of a double pendulum, factored over one denominator."""
    cart = eg.load_example("cart_pendulum").derive().linearize(at={"phi": 0}, equilibrium=True)
    assert str(cart.A[3, 1]) == "3*g*(m_cart + m_pole)/(h*(4*m_cart + m_pole))"
    double = eg.load_example("double_pendulum").derive().linearize(at={"theta1": 0, "bend": 0}, equilibrium=True)
    assert str(double.A[3, 1]) == "-g*(l1*m1 + l1*m2 + l2*m2)/(l1*l2*m1)"


def test_a_pendulum_near_a_symbolic_equilibrium() -> None:
    g, l, m, theta = sp.symbols("g l m theta")
    near = pendulum().derive().linearize(at={"tau": m * g * l / 2 * sp.sin(theta)}, equilibrium=True)
    assert sp.simplify(near.A - sp.Matrix([[0, 1], [-3 * g * sp.cos(theta) / (2 * l), 0]])) == sp.zeros(2, 2)
    assert sp.simplify(near.B - sp.Matrix([0, 3 / (m * l**2)])) == sp.zeros(2, 1)
    assert near.states == ("theta", "theta_dot")
    upright = pendulum().derive().linearize(at={"theta": sp.pi, "l": "1/2"}).A
    assert sp.simplify(upright[1, 0] - 3 * g) == 0


def spherical_pendulum(inertia: float | str = 0) -> eg.Model:
    """Azimuth, then the angle from the downward vertical; ``inertia`` of what turns with the azimuth."""
    m = eg.Model("spherical", gravity=(0, 0, "-g"))
    for name, value in {"g": 9.81, "l": 0.5, "m": 2.0, "J": 0.0}.items():
        m.parameter(name, value)
    fork, bob = m.body("fork", mass=0, inertia={"zz": inertia}), m.body("bob", mass="m", com=(0, 0, "-l"))
    m.revolute("azimuth", m.ground, fork, axis="z", coordinate="phi")
    m.revolute("tilt", fork, bob, axis="y", coordinate="theta")
    return m


@pytest.mark.parametrize("method", part_of(METHODS, ("embedding", "augmented", "hamilton").__contains__))
def test_a_singular_mass_matrix_and_a_dead_centre_are_named(method: str) -> None:
    equations = spherical_pendulum().derive(method)
    for at in ({"theta": 0}, {"theta": "0*g"}, {"theta": sp.pi}):
        refuses(f"EG-SINGULAR mass_matrix theta {at['theta']} phi", equations.linearize, at=at)
    near = equations.linearize(at={"theta": sp.pi / 6}, equilibrium=True)
    assert not any(x.has(sp.zoo, sp.nan) for x in near.A)
    crank = eg.load_example("slider_crank").derive(method)  # the rod stands across the rail
    for at in ({"B": "pi/2 - theta"}, {"theta": 0, "B": "pi/2"}):
        refuses("EG-PARTITION theta dead", crank.linearize, at=at)
    view = crank.subs({"theta": 0}).subs({"B": "pi/2"})
    refuses("EG-NOT-FINITE mass_matrix 0 B pi/2 theta", getattr, view, "mass_matrix")
    assert list(view.constraints) != []  # it needs no division


def test_a_parameter_that_is_zero_but_stays_a_symbol_is_no_fault() -> None:
    """J = 0 is declared: in symbols J stays, and the linearization holds wherever it is not 0."""
    A = spherical_pendulum("J").derive().linearize(at={"theta": 0}).A
    g, l = sp.symbols("g l")
    assert sp.simplify(A - sp.Matrix([[0, 0, 1, 0], [0, 0, 0, 1], [0, 0, 0, 0], [0, -g / l, 0, 0]])) == sp.zeros(4, 4)
    refuses("EG-SINGULAR 0 J theta", lambda: spherical_pendulum("J").derive().linearize(at={"theta": 0, "J": 0}))


def test_an_entry_without_a_value_is_named() -> None:
    m = eg.Model("taut")
    block = m.body("block", mass=2)
    m.prismatic("rail", m.ground, block, axis="x", coordinate="s")
    m.spring("k", m.ground, block, stiffness=3, length=0.5)
    equations = m.derive()
    refuses("EG-NOT-FINITE s 0", equations.linearize, at={"s": 0})
    assert list(equations.linearize(at={"s": 1}, equilibrium=True).A) == [0, 1, -sp.Rational(3, 2), 0]


# -- bare Lagrangians and given equations -----------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["lagrange", "hamilton", "augmented"])
def test_a_bare_lagrangian(method: str) -> None:
    """A bead on a hoop that turns at W: T_0 counts to V as L at rest has it."""
    phi, rate, m, r, W, g, b = sp.symbols("phi phi_dot m r W g b")
    L = m * r**2 * (rate**2 + W**2 * sp.sin(phi) ** 2) / 2 + m * g * r * sp.cos(phi)
    values = {m: 1, r: 1, W: 2, g: 9, b: 1}
    model = eg.Model.from_lagrangian("hoop", L, [phi], dissipation=b * rate**2 / 2, parameters=values)
    equations = model.derive(method)
    assert sp.simplify(equations.lagrangian - L) == 0
    assert sp.simplify(equations.T - m * r**2 * rate**2 / 2) == 0
    assert sp.simplify(equations.force[0] - (L.diff(phi) - b * rate)) == 0
    parts = equations.generalized_forces.parts
    assert set(parts) == {"potential", "dissipation"}
    assert sp.simplify(parts["dissipation"][0] + b * rate) == 0
    assert sp.simplify(parts["potential"][0] - L.diff(phi)) == 0
    refuses("EG-UNAVAILABLE bodies", getattr, equations, "body_mass_matrix")


def test_given_equations_have_what_they_tell_and_name_the_key_of_what_they_do_not() -> None:
    m, l = sp.symbols("m l")
    whole = ("given", ["theta"], [["m*l**2"]], ["-3*m*l*sin(theta)"])
    values = {"m": 1.0, "l": 2.0}
    equations = eg.Model.from_equations(*whole, potential_energy="-3*m*l*cos(theta)", parameters=values).derive()
    assert equations.mass_matrix == sp.Matrix([[m * l**2]])
    assert equations.force == sp.Matrix([-3 * m * l * sp.sin(sp.Symbol("theta"))])
    assert sp.simplify(equations.linearize(at={"theta": 0}).A[1, 0] + 3 / l) == 0
    assert sp.simplify(equations.V + 3 * m * l * sp.cos(sp.Symbol("theta"))) == 0
    for name in ("T", "lagrangian", "momenta"):
        refuses("EG-UNAVAILABLE kinetic_energy equations.kinetic_energy", getattr, equations, name)
    oscillator = eg.Model.from_lagrangian("oscillator", "q_dot**2/2 - k*q**2/2", ["q"], parameters={"k": 4.0})
    for bare, kind in ((equations, "given equations"), (oscillator.derive(), "a Lagrangian")):
        for one in (bare, bare.subs({}), bare.with_dynamicsymbols()):
            for name in ("poses", "velocities", "accelerations", "body_mass_matrix"):
                refuses(f"EG-UNAVAILABLE {kind}", getattr, one, name)
                assert not hasattr(one, name)
        assert bare.explain().difference < 1e-10
