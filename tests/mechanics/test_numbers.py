"""Numbers far apart and at the ends of the range: digits kept, indefinite inertia, lengths by a hair, named errors."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import models
import numpy as np
import pytest
import sympy as sp
from sweeps import METHODS, TARGETS

import eomgen as eg

# -- An inertia that no body can have, asked for -----------------------------------------------------------------------
G, L = 9.81, 0.8


def double_pendulum(I2: float, drag: bool = True, **check: Any) -> eg.Model:
    m = eg.Model("double_pendulum", gravity=(0, -G, 0), **check)
    m.input("tau")
    one = m.body("one", mass=1.0, com=(0.4, 0, 0), inertia={"zz": 0.05})
    two = m.body("two", mass=0.5, com=(0.3, 0, 0), inertia={"zz": I2})
    m.revolute("A", m.ground, one, coordinate="a")
    m.revolute("B", one.at(L, 0, 0), two, coordinate="b")
    m.torque("motor", "B", "tau")
    if drag:
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
    return double_pendulum(I2, drag=False, check_inertia="off")


PAIRS = [*((method, "numpy") for method in ("embedding", "recursive", "lagrange", "augmented", "newton_euler"))]


@pytest.mark.parametrize(("method", "target"), [*PAIRS])
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


def five_bar(I: float) -> eg.Model:
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


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize(
    "build", [lambda: double_pendulum(-0.2, check_inertia="off"), lambda: five_bar(-2.0)], ids=["tree", "loop"]
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
        double_pendulum(-0.2).check()
    assert double_pendulum(-0.2, check_inertia="note").check().notes[0].startswith("bodies.two.inertia: the moment")
    m = eg.Model("one_body", gravity=(0, -G, 0))
    m.revolute("A", m.ground, m.body("b", mass=1, com=(0.5, 0, 0), inertia={"zz": -0.4}, check_inertia=False))
    module = m.compile(target="numpy")  # the body's own word is enough
    assert module.rhs(0.0, [0.3, 0.0])[1] == pytest.approx(-0.5 * G * np.cos(0.3) / (0.25 - 0.4))


# -- Lengths by a hair -------------------------------------------------------------------------------------------------
HAIRS = (1e-12, 1e-9, 1e-8, 1e-7, 3e-7, 1e-5)


@pytest.mark.parametrize("method", [name for name in METHODS if name != "auto"])
@pytest.mark.parametrize("rotation", ["euler_parameters", "euler_angles"])
def test_a_free_body_falls_freely(method: str, rotation: str) -> None:
    for hair in HAIRS:
        m = eg.Model("body", gravity=(0, 0, -9.81))
        body = m.body("b", mass=4, com=(hair, hair, hair), inertia=(0.3, 0.25, 0.1))
        m.free("f", m.ground, body, rotation=rotation)
        mod = m.compile(method=method, target="numpy")
        rates = mod.rhs(0.0, mod.x0())[mod.n_q :]
        np.testing.assert_allclose(rates, [0, 0, -9.81, 0, 0, 0], atol=1e-9)


@pytest.mark.parametrize("method", ["embedding", "recursive", "amalgamated"])
def test_a_parameter_may_come_to_a_hair(method: str) -> None:
    """The offset of a hinge on a free body, bound to values from 1 m to nothing: against a solution with no offset."""
    m = eg.Model("pair", gravity=(0, 0, -9.81))
    d = m.parameter("d", 1.0)
    body = m.body("b", mass=4, com=(0, 0, 0), inertia=(0.3, 0.25, 0.1))
    wheel = m.body("w", mass=1, com=(0, 0, 0), inertia=(0.02, 0.02, 0.04))
    m.free("f", m.ground, body)
    m.revolute("r", body.at(d, 0, 0), wheel, coordinate="th")
    m.torque("drive", "r", 0.5)
    mod = m.compile(method=method, target="numpy")
    for hair in (0.0, *HAIRS):
        rates = mod.rhs(0.0, mod.x0(), p={"d": hair})[mod.n_q :]
        expected = [0, 0, -9.81, 0, 0, -0.5 / 0.1, 0.5 / 0.1 + 0.5 / 0.04]
        np.testing.assert_allclose(rates, expected, atol=20 * hair + 1e-9)


# -- Numbers at the ends of the range ----------------------------------------------------------------------------------
HUGE = (1e308, 1e200, 5e-324, 1e-200)
ENDS = (*HUGE, -1e308, np.inf, np.nan)


def named(call: Callable[[], Any]) -> str:
    """What a call comes to: the name of its error, or ``result``; all other exceptions pass."""
    try:
        call()
    except eg.EomgenError as error:
        return type(error).__name__
    return "result"


x, y, x_dot, y_dot = sp.symbols("x y x_dot y_dot")


def calls(mod: Any, x: np.ndarray) -> Iterator[tuple[str, Callable[[], Any]]]:
    n = mod.n_q
    yield "rhs", lambda: mod.rhs(0.0, x)
    yield "jacobian", lambda: mod.jacobian(0.0, x)
    yield "mass_matrix", lambda: mod.mass_matrix(x[:n])
    yield "bias", lambda: mod.bias(0.0, x)
    yield "energy", lambda: mod.energy(x)
    yield "project", lambda: mod.project(x)
    yield "constraints", lambda: mod.constraints(x[:n])
    yield "poses", lambda: mod.poses(x[:n])
    yield "reactions", lambda: mod.reactions(0.0, x)
    yield "batch", lambda: mod.rhs(0.0, np.stack([x, x], axis=1))


@pytest.fixture(scope="module")
def cranks() -> dict[str, Any]:
    """The slider-crank for both targets."""
    return {target: models.build("slider_crank").compile(target=target) for target in ("numpy", "cython")}


@pytest.mark.parametrize("value", ENDS)
@pytest.mark.parametrize("place", [0, 1, 3])
def test_a_state_of_any_size_means_the_same_in_each_target(cranks: dict[str, Any], place: int, value: float) -> None:
    x = cranks["numpy"].x0()
    x[place] = value
    outcomes = {target: {name: named(call) for name, call in calls(mod, x)} for target, mod in cranks.items()}
    assert outcomes["numpy"] == outcomes["cython"]


@pytest.mark.parametrize("value", [1e308, 1e200])
def test_a_guess_beyond_all_sizes_is_refused(cranks: dict[str, Any], value: float) -> None:
    for mod in cranks.values():
        with pytest.raises(eg.AssemblyError, match="do not close"):
            mod.simulate(1e-3, initial={"s": value})
        with pytest.raises(eg.AssemblyError, match="do not close"):
            mod.assemble(s=value)
