"""An inertia that no body can have, asked for: M is indefinite, and all that is solved with it is solved.

A rotor left out on purpose leaves a body whose moment is negative.  The judge is M v' = -h solved by LAPACK's LU, M
and h of a double pendulum written by hand; derivatives are held against differences of fourth order.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import eomgen as eg

G, L = 9.81, 0.8


def pendulum(I2: float, **check: Any) -> eg.Model:
    m = eg.Model("double_pendulum", gravity=(0, -G, 0), **check)
    m.input("tau")
    one = m.body("one", mass=1.0, com=(0.4, 0, 0), inertia={"zz": 0.05})
    two = m.body("two", mass=0.5, com=(0.3, 0, 0), inertia={"zz": I2})
    m.revolute("A", m.ground, one, coordinate="a")
    m.revolute("B", one.at(L, 0, 0), two, coordinate="b")
    m.torque("motor", "B", "tau")
    m.damper("drag", m.ground.at(0, 1, 0), two.at(0.3, 0, 0), damping=0.4)
    return m


def by_hand(I2: float, x: np.ndarray) -> np.ndarray:
    """Accelerations of the double pendulum in relative angles, without the damper (Spong, Robot Modeling, sec. 6.4)."""
    a, b, da, db = x
    m1, m2, c1, c2 = 1.0, 0.5, 0.4, 0.3
    d = m2 * (c2**2 + L * c2 * np.cos(b)) + I2
    M = np.array([[m1 * c1**2 + 0.05 + m2 * (L**2 + c2**2 + 2 * L * c2 * np.cos(b)) + I2, d], [d, m2 * c2**2 + I2]])
    s = -m2 * L * c2 * np.sin(b)
    h = np.array([s * db * (2 * da + db), -s * da**2])
    g = G * np.array([(m1 * c1 + m2 * L) * np.cos(a) + m2 * c2 * np.cos(a + b), m2 * c2 * np.cos(a + b)])
    return np.linalg.solve(M, -h - g)


def undamped(I2: float) -> eg.Model:
    m = pendulum(I2, check_inertia="off")
    m.description.sections["forces"] = [e for e in m.description.sections["forces"] if e.name != "drag"]
    return m


PAIRS = [*((method, "numpy") for method in ("embedding", "recursive", "lagrange", "augmented", "newton_euler"))]


@pytest.mark.parametrize(("method", "target"), [*PAIRS, ("recursive", "cython"), ("augmented", "cython")])
def test_accelerations_are_those_of_the_indefinite_matrix(method: str, target: str) -> None:
    module = undamped(-0.2).compile(method=method, target=target, kernels=["rhs", "mass_matrix"])
    random = np.random.default_rng(0)
    signs = set()
    for _ in range(20):
        x = random.uniform(-2, 2, 4)
        np.testing.assert_allclose(module.rhs(0.0, x)[2:], by_hand(-0.2, x), rtol=1e-9)
        signs.add(tuple(np.sign(np.linalg.eigvalsh(module.mass_matrix(x[:2]))).tolist()))
    assert signs == {(-1.0, 1.0)}


def differences(f: Any, x: np.ndarray, h: float = 1e-4) -> np.ndarray:
    columns = []
    for e in np.eye(len(x)):
        one, two = (f(x + k * h * e) - f(x - k * h * e) for k in (1, 2))
        columns.append((8 * one - two) / (12 * h))
    return np.array(columns).T


def closed(I: float) -> eg.Model:
    """A four-bar whose coupler has a negative moment, and a fifth bar on it: two freedoms."""
    m = eg.Model("five", gravity=(0, -G, 0), check_inertia="note")
    m.input("tau")
    a, b, c, d = (m.body(n, mass=1, com=(0.1, 0, 0), inertia={"zz": I if n == "b" else 0.02}) for n in "abcd")
    m.revolute("A", m.ground, a, coordinate="theta")
    m.revolute("B", a.at(0.2, 0, 0), b, coordinate="bend")
    m.revolute("C", b.at(0.5, 0, 0), c.at(0.4, 0, 0))
    m.revolute("D", m.ground.at(0.5, 0, 0), c, coordinate="psi")
    m.revolute("E", b.at(0.25, 0.1, 0), d, coordinate="swing")
    m.torque("motor", "A", "tau")
    m.guess(theta=1.0, bend=-0.7, psi=1.1)
    m.initial(theta=1.0, swing=0.4)
    return m


@pytest.mark.parametrize("target", ["numpy", "cython"])
@pytest.mark.parametrize(
    "build", [lambda: pendulum(-0.2, check_inertia="off"), lambda: closed(-2.0)], ids=["tree", "loop"]
)
def test_jacobian_and_linearize_are_exact(build: Any, target: str) -> None:
    module = build().compile(target=target, **({"optimize": 0} if target == "cython" else {}))
    x = module.project(module.x0() + np.linspace(0.1, 0.4, module.n_x) * (0.1 if module.n_c else 1.0))
    q, v = x[: module.n_q], x[module.n_q :]
    sizes = np.linalg.eigvalsh(module.embedded_mass_matrix(q))
    assert sizes[0] < -1e-3
    assert sizes[-1] > 1e-3
    # the equations of motion by multipliers, with NumPy
    M, C_q = module.mass_matrix(q), module.constraint_jacobian(q)
    m = len(C_q)
    ahead = [module.constraint_jacobian(q + k * 1e-5 * v) for k in (1, -1)]
    rate = (ahead[0] - ahead[1]) / 2e-5
    K = np.block([[M, C_q.T], [C_q, np.zeros((m, m))]])
    expected = np.linalg.solve(K, np.concatenate([-module.bias(0.0, x), -rate @ v]))[: module.n_v]
    np.testing.assert_allclose(module.rhs(0.0, x)[module.n_q :], expected, rtol=1e-6 if m else 1e-10)
    J = module.jacobian(0.0, x)
    np.testing.assert_allclose(J, differences(lambda y: module.rhs(0.0, y), x), atol=1e-8 * np.abs(J).max())
    by_input = module.input_jacobian(0.0, x)[:, 0]
    given = [module.rhs(0.0, x, u=[tau]) for tau in (1.0, -1.0)]
    np.testing.assert_allclose(by_input, (given[0] - given[1]) / 2, rtol=1e-9, atol=1e-9)
    linear = module.linearize(x)
    assert np.isfinite(linear.eigenvalues).all()
    if not m:
        np.testing.assert_allclose(linear.A, J, atol=1e-12)
    else:
        assert linear.A.shape == (4, 4)
        free = module.minimal
        z = np.concatenate([linear_part(module, x, linear.states)])
        slope = differences(lambda y: free.rhs(0.0, y), z, 1e-4)
        np.testing.assert_allclose(linear.A, slope, atol=1e-5 * np.abs(slope).max())


def linear_part(module: Any, x: np.ndarray, names: tuple[str, ...]) -> np.ndarray:
    return x[[module.x_names.index(name) for name in names]]


def test_it_must_be_asked_for() -> None:
    with pytest.raises(eg.ModelError, match="moment about the centre of mass is -0.2.*check_inertia"):
        pendulum(-0.2).check()
    assert pendulum(-0.2, check_inertia="note").check().notes[0].startswith("bodies.two.inertia: the moment")
    m = eg.Model("one_body", gravity=(0, -G, 0))
    m.revolute("A", m.ground, m.body("b", mass=1, com=(0.5, 0, 0), inertia={"zz": -0.4}, check_inertia=False))
    module = m.compile(target="numpy")  # the body's own word is enough
    assert module.rhs(0.0, [0.3, 0.0])[1] == pytest.approx(-0.5 * G * np.cos(0.3) / (0.25 - 0.4))


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_where_its_inertia_is_nought_it_stops(target: str) -> None:
    """det M of the pendulum passes 0 at an angle b: beside it all is well, there it is an error and no number."""
    I2 = -0.03
    module = undamped(I2).compile(target=target, kernels=["rhs", "mass_matrix", "embedded_mass_matrix"])
    low, high = 0.0, np.pi / 2
    determinant = [np.linalg.det(module.mass_matrix([0.0, b])) for b in (low, high)]
    assert determinant[0] * determinant[1] < 0
    for _ in range(60):
        middle = (low + high) / 2
        inside = np.linalg.det(module.mass_matrix([0.0, middle]))
        low, high = (middle, high) if inside * determinant[0] > 0 else (low, middle)
    for b in (low - 1e-3, low + 1e-3):
        x = np.array([0.2, b, 0.1, -0.3])
        np.testing.assert_allclose(module.rhs(0.0, x)[2:], by_hand(I2, x), rtol=1e-8)
    with pytest.raises(eg.SingularMassMatrixError, match="eigenvalue nearest to 0"):
        module.rhs(0.0, [0.2, low, 0.1, -0.3])


def test_possible_bodies_keep_their_straight_line_code() -> None:
    """A tensor that misses the triangle only is no reason for other code: M stays positive definite."""
    m = eg.Model("plate", check_inertia="note")
    m.revolute("A", m.ground, m.body("b", mass=1, com=(0.5, 0, 0), inertia=(1, 1, 2.5)))
    assert m.mechanism().negative == ()
    assert "indefinite" not in m.compile(target="numpy").metadata


def test_other_calls_work_or_say_what_they_need() -> None:
    """A run, the canonical form and its momenta; modes, which need a positive definite matrix, refuse."""
    model = undamped(-0.2)
    module = model.compile(target="numpy")
    run = module.simulate(0.3, initial={"a": 0.4, "b": -0.7}, rtol=1e-10)
    from scipy.integrate import solve_ivp

    def rhs(t: float, x: np.ndarray) -> np.ndarray:
        return np.concatenate([x[2:], by_hand(-0.2, x)])

    truth = solve_ivp(rhs, (0, 0.3), [0.4, -0.7, 0, 0], method="DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
    np.testing.assert_allclose(run.x[:, -1], truth, rtol=1e-7, atol=1e-9)
    with pytest.raises(eg.SingularMassMatrixError, match="modes: a motion has negative inertia behind it"):
        module.modes([-np.pi / 2, 0, 0, 0])
    canonical = model.compile(method="hamilton", target="numpy").canonical
    x = np.array([0.4, -0.7, 1.0, 0.5])
    z = canonical.of(x)
    np.testing.assert_allclose(canonical.expand(z), x, atol=1e-12)
    np.testing.assert_allclose(canonical.rhs(0.0, z)[:2], x[2:], atol=1e-12)
