"""SymPy's own numbers through from_sympy: Kane's method."""

from typing import Any

import numpy as np
import pytest
import sympy
from refusals import refuses
from sympy.physics.mechanics import KanesMethod, Particle, Point, ReferenceFrame, dynamicsymbols
from sympy_systems import bicycle, bicycle_numbers, double_pendulum, pulled_pendulum, rolling_disc

import eomgen as eg


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


def slopes(call: Any, x: np.ndarray, h: float = 1e-6) -> np.ndarray:
    """Derivative of a function of the state by central differences."""
    columns = [(call(x + h * e) - call(x - h * e)) / (2 * h) for e in np.eye(len(x))]
    return np.array(columns).T


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
    return eg.from_sympy(
        rolling_disc(), "disc", parameters={"g": 9.81, "r": 0.26, "m": 3.43}, initial={"q2": 0.1, "q3": 1.97}
    )


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
        assert np.abs(module.jacobian(0.0, x) - slopes(lambda z: module.rhs(0.0, z), x)).max() < 1e-7
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
        tangent = slopes(module.project, x, 1e-5)
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
        assert module.rhs(0.0, [q1, q2, w1, w2]) == pytest.approx(
            [w1, w2, ours[2], ours[2] + ours[3]], rel=1e-11, abs=1e-11
        )
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
