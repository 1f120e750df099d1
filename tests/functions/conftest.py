"""C and Python sources of native functions, as a user has them."""

from __future__ import annotations

from pathlib import Path

import pytest

C_SOURCE = """\
#include <math.h>

static double twice(double x) { return 2.0*x; }

double swing(double q) { return sin(q); }
double swing_slope(double q) { return cos(q); }
double swing_curvature(double q) { return -sin(q); }

double drag(double v, double k, double a, double q) { return 0.5*twice(k)*v*sqrt(v*v + 0.01) + a*q*q*v; }
"""

PYTHON_SOURCE = """\
import math

swing = math.sin
swing_slope = math.cos


def swing_curvature(q):
    return -math.sin(q)


def drag(v, k, a, q):
    return k * v * math.sqrt(v * v + 0.01) + a * q * q * v
"""


@pytest.fixture
def sources(tmp_path: Path) -> Path:
    """A folder with ``laws.c`` and ``laws.py``."""
    (tmp_path / "laws.c").write_text(C_SOURCE, encoding="utf-8")
    (tmp_path / "laws.py").write_text(PYTHON_SOURCE, encoding="utf-8")
    return tmp_path
