"""What single methods have, equations near a state, values put in, and what is refused."""

from __future__ import annotations

import copy
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp
from shown_numbers import evaluate, number, random_state, state_values
from sympy.physics.mechanics import dynamicsymbols

import eomgen as eg
from eomgen.equations import METHODS
from eomgen.errors import UnavailableError, UsageError

EXAMPLES = Path(__file__).parents[2] / "examples"


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


def example(name: str, method: str = "auto", seed: int = 3) -> tuple[Any, Any, Any, dict[str, float]]:
    """Equations, module, a random consistent state and its numbers."""
    equations = eg.load(EXAMPLES / f"{name}.yaml").derive(method)
    module: Any = equations.compile(target="numpy")
    x = random_state(module, seed)
    return equations, module, x, state_values(module, x, 0.0)


# -- methods ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["slider_crank", "rolling_disc", "satellite", "car_axis", "gear_train"])
def test_the_block_system_has_the_compiled_accelerations_and_multipliers(name: str) -> None:
    equations, module, x, values = example(name, "augmented")
    block = equations.block_system
    n = len(block.unknowns)
    flat = evaluate(equations.written("block_system")[0], [*block.matrix, *block.right], values)
    found = np.linalg.solve(flat[: n * n].reshape(n, n), flat[n * n :])
    a = module.rhs(0.0, x)[module.n_q :]
    np.testing.assert_allclose(found[: module.n_v], a, rtol=1e-9, atol=1e-9 * np.abs(a).max())
    if module.n_c == len(equations.kinematics.constraints.labels):  # else they are not unique
        wanted = module.multipliers(0.0, x)
        np.testing.assert_allclose(found[module.n_v :], wanted, rtol=1e-7, atol=1e-8 * np.abs(wanted).max(initial=1.0))


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


@pytest.mark.parametrize("name", ["slider_crank", "rolling_disc", "half_car", "spatial_four_bar"])
def test_free_bodies_hold_at_the_compiled_accelerations(name: str) -> None:
    """Reactions that balance all bodies exist there, and at no other accelerations."""
    equations, _, _, values = example(name, "newton_euler")
    residuals: list[Any] = []
    for part in (equations.free_bodies, equations.joint_forces):
        for key in part:
            rows = part[key] if isinstance(part[key], list) else [*part[key].force, *part[key].moment]
            named = equations.written("free_bodies" if part is equations.free_bodies else "joint_forces", key)[0]
            residuals += [(named, row.lhs - row.rhs) for row in rows]
    own = {sp.Symbol(n) for n in values}
    used = {s for named, row in residuals for s in row.free_symbols.union(*(e.free_symbols for _, e in named))}
    parts = {symbol for named, _ in residuals for symbol, _ in named}
    unknown = sorted(map(str, used - own - parts))

    def left(at: dict[str, float]) -> np.ndarray:
        return np.array([evaluate(named, [row], at)[0] for named, row in residuals])

    def misfit(at: dict[str, float]) -> float:
        at = at | dict.fromkeys(unknown, 0.0)
        rest = left(at)
        J = np.array([left(at | {name: 1.0}) - rest for name in unknown]).T
        best = np.linalg.lstsq(J, -rest, rcond=None)[0]
        return float(np.abs(J @ best + rest).max() / np.abs(rest).max())

    assert misfit(values) < 1e-10
    wrong = next(iter(equations.acceleration_names))
    assert misfit(values | {wrong: values[wrong] + 1.0}) > 1e-4


@pytest.mark.parametrize(
    ("attribute", "methods"),
    [
        ("gibbs_function", {"gibbs_appell"}),
        ("hamiltonian", {"hamilton"}),
        ("momentum_rates", {"hamilton"}),
        ("block_system", {"augmented", "newton_euler", "amalgamated"}),
        ("free_bodies", {"newton_euler", "amalgamated"}),
        ("joint_forces", {"newton_euler", "amalgamated"}),
    ],
)
@pytest.mark.parametrize("method", METHODS)
def test_what_a_method_does_not_have_is_refused_by_name(attribute: str, methods: set[str], method: str) -> None:
    equations = pendulum().derive(method)
    if method in methods:
        getattr(equations, attribute)
        return
    with pytest.raises(UnavailableError) as raised:
        getattr(equations, attribute)
    assert repr(method) in str(raised.value)
    assert all(repr(name) in str(raised.value) for name in methods)
    assert not hasattr(equations, attribute)


def test_a_tree_whose_mass_matrix_has_no_inverse_has_no_hamiltonian() -> None:
    m = eg.Model("loop", gravity=(0, -9.81, 0))
    crank, rod, slider = m.body("crank", mass=1, inertia={"zz": 1}), m.body("rod", mass=0), m.body("slider", mass=0)
    m.revolute("A", m.ground, crank, coordinate="theta")
    m.revolute("B", crank.at(0.2, 0, 0), rod, coordinate="phi")
    m.revolute("C", rod.at(0.5, 0, 0), slider)
    m.prismatic("D", m.ground, slider, axis="x", coordinate="s")
    m.guess(s=0.6)
    m.initial(theta=0.4)
    with pytest.raises(UnavailableError, match="no inverse"):
        _ = m.derive("hamilton", independent=["theta"]).hamiltonian


@pytest.mark.parametrize("name", ["double_pendulum", "car_axis", "satellite"])
def test_momenta_and_their_rates_are_those_of_the_canonical_form(name: str) -> None:
    equations, module, x, values = example(name, "hamilton")
    wanted = module.kernels.state("canonical")(x, t=0.0)
    for quantity, expected in zip(("momenta", "momentum_rates"), wanted, strict=True):
        found = number(equations, quantity, values)[:, 0]
        np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-10 * np.abs(expected).max())


# -- near a state -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["slider_crank", "rolling_disc", "satellite", "cart_pendulum", "half_car"])
def test_equations_near_a_state_are_those_of_the_module(name: str) -> None:
    equations, module, x, values = example(name)
    near = equations.linearize(at={name: name for name in module.v_names})  # velocities stay symbols
    wanted = module.linearize(x)
    assert near.states == wanted.states
    assert near.inputs == module.u_names
    n = len(near.states)
    flat = evaluate(near.intermediates, [*near.A, *near.B], values)
    scale = np.abs(wanted.A).max()
    np.testing.assert_allclose(flat[: n * n].reshape(n, n), wanted.A, atol=1e-10 * scale)
    np.testing.assert_allclose(flat[n * n :].reshape(n, -1), wanted.B, rtol=1e-10, atol=1e-10)


def test_a_pendulum_near_a_symbolic_equilibrium() -> None:
    g, l, m, theta = sp.symbols("g l m theta")
    near = pendulum().derive().linearize(at={"tau": m * g * l / 2 * sp.sin(theta)}, equilibrium=True)
    assert sp.simplify(near.A - sp.Matrix([[0, 1], [-3 * g * sp.cos(theta) / (2 * l), 0]])) == sp.zeros(2, 2)
    assert sp.simplify(near.B - sp.Matrix([0, 3 / (m * l**2)])) == sp.zeros(2, 1)
    assert near.states == ("theta", "theta_dot")
    upright = pendulum().derive().linearize(at={"theta": sp.pi, "l": "1/2"}).A
    assert sp.simplify(upright[1, 0] - 3 * g) == 0


# -- values put in, functions of time ---------------------------------------------------------------------------------


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


@pytest.mark.parametrize(
    ("ask", "word"),
    [
        (lambda e: e.with_parameters(L=1), "no parameter 'L'"),
        (lambda e: e.with_parameters(theta=1), "no parameter 'theta'"),
        (lambda e: e.subs({"phi": 1}), "no symbol 'phi'"),
        (lambda e: e.subs({"theta": "1 +"}), "theta: not a valid expression"),
        (lambda e: e.subs({"theta": [1]}), "theta must be a number"),
        (lambda e: e.subs([("theta", 1)]), "given by name"),
        (lambda e: e.linearize(at={"phi": 1}), "no symbol 'phi'"),
        (lambda e: e.poses["rodd"], "did you mean rod"),
        (lambda e: e.generalized_forces["moter"], "did you mean motor"),
        (lambda e: e.written("q"), "'q' is no quantity"),
        (lambda e: e.velocities["x"], "no body or marker 'x'"),
    ],
)
def test_faults_are_named(ask: Any, word: str) -> None:
    with pytest.raises(UsageError) as raised:
        ask(pendulum().derive())
    assert word in str(raised.value)


def test_functions_of_time_are_those_of_sympy() -> None:
    equations = eg.load(EXAMPLES / "satellite.yaml").derive().with_dynamicsymbols()
    t = dynamicsymbols._t
    assert equations.v[3:7] == (*dynamicsymbols("flight_wx flight_wy flight_wz"), dynamicsymbols("left", 1))
    used = equations.force.free_symbols | equations.T.free_symbols
    assert {s for named in equations.intermediates for s in named[1].free_symbols} | used >= {t}
    a = pendulum().derive().with_dynamicsymbols().accelerations["rod.tip"]
    theta, l = dynamicsymbols("theta"), sp.Symbol("l")
    place = sp.Matrix([l * sp.sin(theta), -l * sp.cos(theta), 0])
    assert sp.simplify(a.linear - place.diff(t, 2)) == sp.zeros(3, 1)
    assert a.angular == sp.Matrix([0, 0, theta.diff(t, 2)])
    assert sp.simplify(a.center_of_mass - place.diff(t, 2) / 2) == sp.zeros(3, 1)


def test_the_coordinate_of_a_cut_joint_is_a_sum_of_angles() -> None:
    equations = eg.load(EXAMPLES / "slider_crank.yaml").derive()
    assert list(equations.loop_coordinates) == ["C"]
    assert sp.expand(equations.loop_coordinates["C"] + sp.Symbol("theta") + sp.Symbol("B")) == 0


# -- bare Lagrangians and given equations -----------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["lagrange", "hamilton", "augmented"])
def test_a_bare_lagrangian(method: str) -> None:
    """A bead on a hoop that turns at W: T_0 counts to V as L at rest has it."""
    phi, rate, m, r, W, g, b = sp.symbols("phi phi_dot m r W g b")
    L = m * r**2 * (rate**2 + W**2 * sp.sin(phi) ** 2) / 2 + m * g * r * sp.cos(phi)
    model = eg.Model.from_lagrangian(
        "hoop", L, [phi], dissipation=b * rate**2 / 2, parameters={m: 1, r: 1, W: 2, g: 9, b: 1}
    )
    equations = model.derive(method)
    assert sp.simplify(equations.lagrangian - L) == 0
    assert sp.simplify(equations.T - m * r**2 * rate**2 / 2) == 0
    assert sp.simplify(equations.T - equations.V - L) == 0
    assert sp.simplify(equations.force[0] - (L.diff(phi) - b * rate)) == 0
    parts = equations.generalized_forces.parts
    assert set(parts) == {"potential", "dissipation"}
    assert sp.simplify(parts["dissipation"][0] + b * rate) == 0
    assert sp.simplify(parts["potential"][0] - L.diff(phi)) == 0
    assert equations.quadratic_velocity == sp.zeros(1, 1)
    with pytest.raises(UnavailableError, match="no bodies"):
        _ = equations.body_mass_matrix


def test_given_equations_have_what_they_tell() -> None:
    m, l = sp.symbols("m l")
    equations = eg.Model.from_equations(
        "given", ["theta"], [["m*l**2"]], ["-3*m*l*sin(theta)"], parameters={"m": 1.0, "l": 2.0}
    ).derive()
    assert equations.mass_matrix == sp.Matrix([[m * l**2]])
    assert equations.force == sp.Matrix([-3 * m * l * sp.sin(sp.Symbol("theta"))])
    assert sp.simplify(equations.linearize(at={"theta": 0}).A[1, 0] + 3 / l) == 0
    for name in ("T", "V", "lagrangian", "momenta", "generalized_forces", "quadratic_velocity"):
        with pytest.raises(UnavailableError, match="given"):
            getattr(equations, name)


# -- reading changes nothing ------------------------------------------------------------------------------------------


def test_what_is_read_depends_on_the_model_alone_and_changes_nothing() -> None:
    from eomgen.emit import emit_numpy
    from eomgen.pipeline import build

    first = eg.load(EXAMPLES / "four_bar.yaml").derive()
    other = eg.load(EXAMPLES / "four_bar.yaml").derive()
    for name in ("T", "generalized_forces", "gamma", "quadratic_velocity", "momenta"):
        getattr(other, name)
    other.linearize()
    assert first.intermediates == other.intermediates
    assert first.force == other.force
    assert emit_numpy(build(first, "numpy")) == emit_numpy(build(other, "numpy"))


def test_what_is_read_goes_through_pickle_and_copy() -> None:
    for equations in (pendulum().derive("newton_euler"), pendulum().derive("newton_euler").with_dynamicsymbols()):
        for name in ("poses", "velocities", "accelerations", "free_bodies", "joint_forces", "loop_coordinates"):
            dict(getattr(equations, name))
        total = equations.generalized_forces
        for twin in (pickle.loads(pickle.dumps(equations)), copy.deepcopy(equations)):
            assert twin.T == equations.T
            assert twin.poses["rod"] == equations.poses["rod"]
            assert twin.generalized_forces == total
            assert twin.generalized_forces["motor"] == total["motor"]
            assert twin.velocities["rod"] == equations.velocities["rod"]


def test_what_given_equations_do_not_tell_is_named_by_its_key() -> None:
    """V follows from potential_energy alone; motion of bodies is refused, and not an empty mapping."""
    whole = ("given", ["theta"], [["m*l**2"]], ["-3*m*l*sin(theta)"])
    values = {"m": 1.0, "l": 2.0}
    equations = eg.Model.from_equations(*whole, potential_energy="-3*m*l*cos(theta)", parameters=values).derive()
    m, l = sp.symbols("m l")
    assert sp.simplify(equations.V + 3 * m * l * sp.cos(sp.Symbol("theta"))) == 0
    for name, key in (("T", "kinetic"), ("lagrangian", "kinetic"), ("momenta", "kinetic")):
        with pytest.raises(UnavailableError, match=f"given without {key}_energy; give equations.{key}_energy"):
            getattr(equations, name)
    with pytest.raises(UnavailableError, match="V is not known: .* without potential_energy; give equations.potential"):
        _ = eg.Model.from_equations(*whole).derive().V
    oscillator = eg.Model.from_lagrangian("oscillator", "q_dot**2/2 - k*q**2/2", ["q"], parameters={"k": 4.0})
    for bare, kind in ((equations, "given equations"), (oscillator.derive(), "a Lagrangian")):
        for one in (bare, bare.subs({}), bare.with_dynamicsymbols()):
            for name in ("poses", "velocities", "accelerations", "body_mass_matrix"):
                with pytest.raises(UnavailableError, match=f"there are no bodies: the model is {kind}"):
                    getattr(one, name)
                assert not hasattr(one, name)
                assert f"eqs.{name}" not in str(one)
        assert bare.explain().difference < 1e-10
