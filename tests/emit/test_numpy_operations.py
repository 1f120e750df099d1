"""Every operation of an expression in NumPy text, for one state and for several, against Python's math."""

from __future__ import annotations

import math

import numpy as np
import pytest

import eomgen as eg

EXPRESSIONS = {
    "atan2(a, b)": lambda a, b: math.atan2(a, b),
    "hypot(a, 2*b)": lambda a, b: math.hypot(a, 2 * b),
    "where(a < b, a, 2*b)": lambda a, b: a if a < b else 2 * b,
    "where(a <= b and b > 0, 1, -1)": lambda a, b: 1.0 if a <= b and b > 0 else -1.0,
    "min(a, b) - 3*max(a, b)": lambda a, b: min(a, b) - 3 * max(a, b),
    "abs(a) + sign(b)": lambda a, b: abs(a) + math.copysign(1.0, b),
    "a**3 - (2 + b)**1.5": lambda a, b: a**3 - (2 + b) ** 1.5,
    "sin(a)*cos(b) + tan(a/2)": lambda a, b: math.sin(a) * math.cos(b) + math.tan(a / 2),
    "exp(a) - log(3 + b)": lambda a, b: math.exp(a) - math.log(3 + b),
    "asin(a/3) + acos(b/3) + atan(a)": lambda a, b: math.asin(a / 3) + math.acos(b / 3) + math.atan(a),
    "sinh(a) - cosh(b) + tanh(a)": lambda a, b: math.sinh(a) - math.cosh(b) + math.tanh(a),
    "asinh(a) - acosh(3 + b) + atanh(a/3)": lambda a, b: math.asinh(a) - math.acosh(3 + b) + math.atanh(a / 3),
    "sqrt(4 + a*b)/(5 - b)": lambda a, b: math.sqrt(4 + a * b) / (5 - b),
}
STATES = np.array([[0.7, -1.2, 1.1, -0.4], [1.3, 0.4, -0.8, -0.9]])


@pytest.fixture(scope="module")
def module():
    m = eg.Model("operations")
    for name in "ab":
        m.prismatic(f"J{name}", m.ground, m.body(f"body_{name}", mass=1.0), axis="x", coordinate=name)
    for k, text in enumerate(EXPRESSIONS):
        m.output(f"y{k}", text)
    return m.compile(target="numpy")


@pytest.mark.parametrize("text", EXPRESSIONS)
def test_operations_mean_what_python_means(module, text: str) -> None:
    k = list(EXPRESSIONS).index(text)
    expected = [EXPRESSIONS[text](a, b) for a, b in STATES.T]
    x = np.vstack([STATES, np.zeros_like(STATES)])
    assert module.outputs(0.0, x)[k] == pytest.approx(expected, rel=1e-14)
    assert [module.outputs(0.0, column)[k] for column in x.T] == pytest.approx(expected, rel=1e-14)
