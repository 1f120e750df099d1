"""What operations become in C, in vectors of C, in NumPy, CasADi and JAX, and as Taylor series.

Judges: Python's ``math``, mpmath with 50 digits, quadrature.
"""

import math
from collections.abc import Callable
from functools import cache
from math import ulp
from typing import Any

import jax
import numpy as np
import pytest
from models import IN_C
from mpmath import mp, mpf
from scipy.integrate import quad

import eomgen as eg

EXPRESSIONS: dict[str, Callable[[float, float], float]] = {
    "atan2(a, b)": math.atan2,
    "hypot(a, 2*b)": lambda a, b: math.hypot(a, 2 * b),
    "where(a < b, a, 2*b)": lambda a, b: a if a < b else 2 * b,
    "where(a <= b and b > 0, 1, -1)": lambda a, b: 1.0 if a <= b and b > 0 else -1.0,
    "where(a > b or not b > 0, a, 3*b)": lambda a, b: a if a > b or not b > 0 else 3 * b,
    "where(a > 0, log(a), 7)": lambda a, b: math.log(a) if a > 0 else 7.0,  # a branch not taken is no error
    "a + 1 if a >= b else 2*b": lambda a, b: a + 1 if a >= b else 2 * b,
    "min(a, b) - 3*max(a, b)": lambda a, b: min(a, b) - 3 * max(a, b),
    "abs(a) + sign(b)": lambda a, b: abs(a) + (b > 0) - (b < 0),
    "a**3 - (4 + b)**1.5": lambda a, b: a**3 - (4 + b) ** 1.5,
    "a**2*b**-2": lambda a, b: math.inf if b == 0 else a**2 / b**2,
    "sin(a)*cos(b) + tan(a/2)": lambda a, b: math.sin(a) * math.cos(b) + math.tan(a / 2),
    "exp(a) - log(4 + b)": lambda a, b: math.exp(a) - math.log(4 + b),
    "asin(a/3) + acos(b/3) + atan(a)": lambda a, b: math.asin(a / 3) + math.acos(b / 3) + math.atan(a),
    "sinh(a) - cosh(b) + tanh(a)": lambda a, b: math.sinh(a) - math.cosh(b) + math.tanh(a),
    "asinh(a) - acosh(4 + b) + atanh(a/4)": lambda a, b: math.asinh(a) - math.acosh(4 + b) + math.atanh(a / 4),
    "sqrt(10 + a*b)/(5 - b)": lambda a, b: math.sqrt(10 + a * b) / (5 - b),
    "-a - (b - a)": lambda a, b: -a - (b - a),
}
GRID = [0.4, -0.4, 0.9, 1.0, -1.0, 2.5, -3.0]
STATES = np.array([(a, b) for a in GRID for b in GRID]).T


@cache
def described() -> eg.Model:
    m = eg.Model("operations")
    for name in "ab":
        m.prismatic(f"J{name}", m.ground, m.body(f"body_{name}", mass=1.0), axis="x", coordinate=name)
    for k, text in enumerate(EXPRESSIONS):
        m.output(f"y{k}", text)
    return m


@cache
def evaluated(target: str) -> np.ndarray:
    """All outputs at all states."""
    x = np.vstack([STATES, np.zeros_like(STATES)])
    if target == "casadi":
        functions = described().derive().to_casadi()
        return np.array([np.asarray(functions.outputs(0.0, column, [], [])).ravel() for column in x.T]).T
    if target == "jax":
        functions = described().derive().to_jax()
        many = jax.jit(jax.vmap(functions.outputs, in_axes=(None, 1, None, None), out_axes=1))
        return np.asarray(many(0.0, x, np.zeros(0), np.zeros(0)))
    in_c = target.startswith("cython")
    options = {"optimize": 0, "kernels": ["rhs", "outputs"]} if in_c else {}
    module = described().compile(target="cython" if in_c else target, **options)
    single = np.array([module.outputs(0.0, column) for column in x.T]).T
    np.testing.assert_array_equal(module.outputs(0.0, x), single)
    return single


@pytest.mark.parametrize("target", ["numpy", "cython", "casadi", "jax"])
@pytest.mark.parametrize("text", EXPRESSIONS)
def test_operations_mean_what_python_means(text: str, target: str) -> None:
    expected = [EXPRESSIONS[text](a, b) for a, b in STATES.T]
    found = evaluated(target)[list(EXPRESSIONS).index(text)]
    np.testing.assert_allclose(found, expected, rtol=4e-14, atol=4e-15)


# Taylor's method integrates each force to the last digits in long steps: a wrong coefficient shows in either.

FORCES: dict[str, tuple[str, Callable[[Any, Any], Any]]] = {
    "square": ("(1 + t)*(1 + t)", lambda m, t: (1 + t) ** 2),
    "products": ("t*sin(t)*exp(-t)", lambda m, t: t * m.sin(t) * m.exp(-t)),
    "reciprocal": ("1/(2 + t*t)", lambda m, t: 1 / (2 + t * t)),
    "quotient": ("sin(t)/(2 + t)", lambda m, t: m.sin(t) / (2 + t)),
    "root": ("sqrt(1 + t*t)", lambda m, t: m.sqrt(1 + t * t)),
    "real power": ("(2 + t)**1.7", lambda m, t: (2 + t) ** 1.7),
    "exp of sin": ("exp(sin(2*t))", lambda m, t: m.exp(m.sin(2 * t))),
    "log": ("log(2 + t*t)", lambda m, t: m.log(2 + t * t)),
    "cos": ("cos(t*t)", lambda m, t: m.cos(t * t)),
    "tan": ("tan(t/2)", lambda m, t: m.tan(t / 2)),
    "tanh": ("tanh(2*t)", lambda m, t: m.tanh(2 * t)),
    "sinh, cosh": ("sinh(t)/cosh(t/2)", lambda m, t: m.sinh(t) / m.cosh(t / 2)),
    "asin": ("asin(0.5*t)", lambda m, t: m.asin(0.5 * t)),
    "acos": ("acos(0.5*t)", lambda m, t: m.acos(0.5 * t)),
    "atan": ("atan(t*(1 + t))", lambda m, t: m.atan(t * (1 + t))),
    "atan2": ("atan2(sin(t), 2 + t)", lambda m, t: m.atan2(m.sin(t), 2 + t)),
    "hypot": ("hypot(sin(t), 2 - t)", lambda m, t: m.hypot(m.sin(t), 2 - t)),
    "hypot, one fixed": ("hypot(3, t)", lambda m, t: m.hypot(3, t)),
    "asinh, atanh": ("asinh(2*t) - atanh(t/2)", lambda m, t: m.asinh(2 * t) - m.atanh(t / 2)),
    "acosh": ("acosh(2 + t*t)", lambda m, t: m.acosh(2 + t * t)),
    "atan2, one fixed": ("atan2(1, 2 + t)", lambda m, t: m.atan2(1, 2 + t)),
}
END, FEW = 0.8, 12


@cache
def by_series() -> Any:
    m = eg.Model("pushed")
    for k, (text, _) in enumerate(FORCES.values()):
        m.prismatic(f"J{k}", m.ground, m.body(f"body{k}", mass=1.0), axis="x", coordinate=f"q{k}")
        m.torque(f"F{k}", f"J{k}", text)
    module = m.compile(**IN_C | {"kernels": ["rhs", "project"]})
    solver = module.Taylor(module.rhs, 0.0, np.zeros(module.n_x), END, rtol=1e-12, atol=1e-13)
    for _ in range(FEW):  # with a wrong coefficient they become ever shorter
        if solver.status == "running":
            solver.step()
    return solver.t, dict(zip(module.x_names, solver.y, strict=True))


@pytest.mark.parametrize("name", FORCES)
def test_series_integrate_every_operation(name: str) -> None:
    (end, x), force = by_series(), FORCES[name][1]
    expected = quad(lambda t: float(force(math, t)), 0.0, END, epsabs=1e-13, epsrel=1e-13)[0]
    assert end == END
    assert x[f"q{list(FORCES).index(name)}_dot"] == pytest.approx(expected, rel=1e-11, abs=1e-12)


# Sine and cosine of generated code.

NEAR = 1.0e6


def angles() -> np.ndarray:
    """Dense, near multiples of pi/2 and pi/4, tiny, large within the bound of the reduction."""
    rng = np.random.default_rng(5)
    with mp.workdps(40):
        multiples = np.array([float(int(k) * mp.pi / 2) for k in rng.integers(1, 636_000, 300)])
        small = np.array([float(k * mp.pi / 4) for k in range(1, 50)])
    near = [np.nextafter(m, to) for m in (multiples, small) for to in (-np.inf, np.inf)]
    powers = 10.0 ** rng.uniform(-320.0, 6.0, 400)
    edges = [0.0, 5e-324, 2.2e-308, 1e-8, np.pi / 4, np.pi, NEAR, np.nextafter(NEAR, 0.0)]
    ranges = [rng.uniform(-b, b, 700) for b in (1.0, 8.0, 100.0, NEAR)]
    return np.concatenate([*ranges, multiples, small, *near, powers, edges])


def errors(values: np.ndarray, given: np.ndarray, function: Callable[[Any], Any]) -> np.ndarray:
    """Distances from the true values in units in the last place of these."""
    found = []
    with mp.workdps(50):
        for value, angle in zip(values.tolist(), given.tolist(), strict=True):
            true = function(mpf(angle))
            found.append(float(abs(mpf(value) - true) / mpf(ulp(float(true)))))
    return np.array(found)


@pytest.fixture(scope="module", params=[False, pytest.param(True, marks=pytest.mark.thorough)], ids=["plain", "native"])
def trigonometry(request: pytest.FixtureRequest) -> Callable[[np.ndarray], np.ndarray]:
    m = eg.Model("trigonometry")
    m.prismatic("J", m.ground, m.body("b", mass=1.0), axis="x", coordinate="a")
    for name in ("sin", "cos"):
        m.state(name[0], f"{name}(a)")
    module = m.compile(kernels=["rhs"], native=request.param)

    def both(given: np.ndarray) -> np.ndarray:
        x = np.vstack([given, np.zeros((3, given.size))])
        single = np.array([module.rhs(0.0, np.ascontiguousarray(column)) for column in x.T]).T[2:]
        places = [module.x_names.index(name) - 2 for name in "sc"]
        many = module.rhs(0.0, np.repeat(x, 2, axis=1))[2:, ::2]  # in vectors, beside other neighbours
        np.testing.assert_array_equal(many[places], single[places])
        return single[places]

    return both


def test_sine_and_cosine_are_within_two_units_in_the_last_place(trigonometry: Callable[..., np.ndarray]) -> None:
    given = angles()
    found = trigonometry(given)
    for values, function in zip(found, (mp.sin, mp.cos), strict=True):
        off = errors(values, given, function)
        assert off.max() < 1.8, (off.max(), given[off.argmax()])
        assert off.mean() < 0.3
    assert np.abs(found).max() <= 1.0
    mirrored = trigonometry(-given)
    np.testing.assert_array_equal(mirrored, [-found[0], found[1]])


def test_far_angles_are_those_of_the_c_library(trigonometry: Callable[..., np.ndarray]) -> None:
    far = np.array([NEAR * 1.01, -2e6, 1e22, -1.7e308, 2.0**53, 3e15, 1e9, 4e6])
    for values, function in zip(trigonometry(far), (mp.sin, mp.cos), strict=True):
        assert errors(values, far, function).max() < 1.0
