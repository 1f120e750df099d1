"""Numbers far apart and at the ends of the range: digits kept, indefinite inertia, lengths by a hair, named errors."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
import sympy as sp
from analysed import compiled
from refusals import refuses
from sweeps import METHODS

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


@pytest.mark.parametrize("method", ["embedding", "recursive", "lagrange", "augmented", "newton_euler"])
def test_accelerations_are_those_of_the_indefinite_matrix(method: str) -> None:
    model = double_pendulum(-0.2, drag=False, check_inertia="off")
    module = model.compile(method=method, target="numpy", kernels=["rhs", "mass_matrix"])
    random = np.random.default_rng(0)
    signs = set()
    for _ in range(20):
        x = random.uniform(-2, 2, 4)
        np.testing.assert_allclose(module.rhs(0.0, x)[2:], by_hand(-0.2, x), rtol=1e-9)
        signs.add(tuple(np.sign(np.linalg.eigvalsh(module.mass_matrix(x[:2]))).tolist()))
    assert signs == {(-1.0, 1.0)}


def test_it_must_be_requested() -> None:
    refuses("EG-INERTIA bodies.two.inertia -0.2 check_inertia", lambda: double_pendulum(-0.2).check())
    assert double_pendulum(-0.2, check_inertia="note").check().notes[0].startswith("bodies.two.inertia: the moment")
    m = eg.Model("one_body", gravity=(0, -G, 0))
    m.revolute("A", m.ground, m.body("b", mass=1, com=(0.5, 0, 0), inertia={"zz": -0.4}, check_inertia=False))
    module = m.compile(target="numpy")  # the body's own word is enough
    assert module.rhs(0.0, [0.3, 0.0])[1] == pytest.approx(-0.5 * G * np.cos(0.3) / (0.25 - 0.4))


# -- Lengths far apart -------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("ratio", "kept"), [(1e4, 7), (1e6, 3)])
def test_check_says_how_many_digits_are_lost(ratio: float, kept: int) -> None:
    """A first rod that is so short leaves that many; free bodies keep them all."""
    m = eg.Model("chain", gravity=(0, -9.81, 0))
    above: Any = m.ground
    for k, length in enumerate((1 / ratio, 1.0)):
        rod = m.body(f"b{k}", mass=1, com=(length / 2, 0, 0), inertia={"zz": length**2 / 12})
        m.revolute(f"q{k}", above, rod)
        above = rod.at(length, 0, 0)
    (note,) = (note for note in m.check().notes if "digits" in note)
    assert f"rounding leaves about {kept} of 16 digits of the accelerations" in note
    assert "newton_euler and amalgamated keep all digits" in note
    x = np.array([0.3, 0.7, 1.0, -2.0])
    found = [m.compile(method, target="numpy", kernels=["rhs"]).rhs(0.0, x)[2:]
             for method in ("embedding", "newton_euler", "amalgamated")]  # fmt: skip
    size = np.abs(found[1]).max()
    assert np.abs(found[2] - found[1]).max() < 1e-13 * size
    assert 10.0 ** -(kept + 3) < np.abs(found[0] - found[1]).max() / size < 10.0 ** (1 - kept)


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
    return {target: compiled("slider_crank", target) for target in ("numpy", "cython")}


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
        refuses("EG-LOOP-OPEN close", mod.simulate, 1e-3, initial={"s": value})
        refuses("EG-LOOP-OPEN close", mod.assemble, s=value)
