"""Taylor coefficients in C against those of mpmath: a mass for each operation, pushed by a function of time."""

from __future__ import annotations

import ctypes
from typing import Any

import mpmath
import numpy as np
import pytest

import eomgen as eg
from eomgen.emit import emit_c
from eomgen.pipeline import build

START, ORDER = 0.35, 16
FORCES = {
    "square": ("(1 + t)*(1 + t)", lambda m, t: (1 + t) ** 2),
    "products": ("t*sin(t)*exp(-t)", lambda m, t: t * m.sin(t) * m.exp(-t)),
    "reciprocal": ("1/(2 + t*t)", lambda m, t: 1 / (2 + t * t)),
    "quotient": ("sin(t)/(2 + t)", lambda m, t: m.sin(t) / (2 + t)),
    "root": ("sqrt(1 + t*t)", lambda m, t: m.sqrt(1 + t * t)),
    "real power": ("(2 + t)**1.7", lambda m, t: (2 + t) ** m.mpf(1.7)),
    "exp of sin": ("exp(sin(2*t))", lambda m, t: m.exp(m.sin(2 * t))),
    "log": ("log(2 + t*t)", lambda m, t: m.log(2 + t * t)),
    "cos": ("cos(t*t)", lambda m, t: m.cos(t * t)),
    "tan": ("tan(t/2)", lambda m, t: m.tan(t / 2)),
    "tanh": ("tanh(2*t)", lambda m, t: m.tanh(2 * t)),
    "sinh, cosh": ("sinh(t)/cosh(t/2)", lambda m, t: m.sinh(t) / m.cosh(t / 2)),
    "asin": ("asin(0.5*t)", lambda m, t: m.asin(m.mpf(0.5) * t)),
    "acos": ("acos(0.5*t)", lambda m, t: m.acos(m.mpf(0.5) * t)),
    "atan": ("atan(t*(1 + t))", lambda m, t: m.atan(t * (1 + t))),
    "atan2": ("atan2(sin(t), 2 + t)", lambda m, t: m.atan(m.sin(t) / (2 + t))),
    "hypot": ("hypot(sin(t), 2 - t)", lambda m, t: m.hypot(m.sin(t), 2 - t)),
    "hypot, one fixed": ("hypot(3, t)", lambda m, t: m.hypot(3, t)),
    "asinh, atanh": ("asinh(2*t) - atanh(t/2)", lambda m, t: m.asinh(2 * t) - m.atanh(t / 2)),
    "acosh": ("acosh(2 + t*t)", lambda m, t: m.acosh(2 + t * t)),
    "atan2, one fixed": ("atan2(1, 2 + t)", lambda m, t: m.atan(1 / (2 + t))),
}  # fmt: skip
NAMES = list(FORCES)


@pytest.fixture(scope="module")
def coefficients(libraries: Any, tmp_path_factory: pytest.TempPathFactory) -> np.ndarray:
    """Of the velocities, (ORDER + 1, n), at t = START."""

    class Series(ctypes.Structure):
        _fields_ = (("most", ctypes.c_int), ("n_work", ctypes.c_int), ("expand", ctypes.c_void_p))

    class Model(ctypes.Structure):
        _fields_ = (
            *libraries.Table._fields_, ("closed_at", ctypes.c_int), ("series", ctypes.POINTER(Series)),
        )  # fmt: skip

    m = eg.Model("pushed")
    for k, (text, _) in enumerate(FORCES.values()):
        m.prismatic(f"J{k}", m.ground, m.body(f"body{k}", mass=1.0), axis="x")
        m.torque(f"F{k}", f"J{k}", text)
    sources = emit_c(build(m.derive(), "c", ["rhs"]))
    library = ctypes.CDLL(str(libraries.compile_library(sources, tmp_path_factory.mktemp("series"))))
    library.eomgen_model_table.restype = ctypes.POINTER(Model)
    series = library.eomgen_model_table().contents.series.contents
    real = ctypes.POINTER(ctypes.c_double)
    expand = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_double, *[real] * 3, ctypes.c_int, *[real] * 2)(series.expand)
    n = 2 * len(FORCES)
    out, work, x, none = np.zeros((ORDER + 1, n)), np.zeros(series.n_work + 1), np.zeros(n), np.zeros(1)
    x_, u_, c_, out_, work_ = (a.ctypes.data_as(real) for a in (x, none, none, out, work))
    assert expand(START, x_, u_, c_, ORDER, out_, work_) == 0
    return out[:, len(FORCES) :]


@pytest.mark.parametrize("name", NAMES)
def test_coefficients_are_those_of_mpmath(coefficients: np.ndarray, name: str) -> None:
    with mpmath.workdps(60):
        force = FORCES[name][1]
        exact = mpmath.taylor(lambda t: force(mpmath, t), mpmath.mpf(START), ORDER - 1)
        expected = [0.0, *(float(c / (k + 1)) for k, c in enumerate(exact))]
    found = coefficients[:, NAMES.index(name)]
    np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-13 * np.abs(expected).max())
