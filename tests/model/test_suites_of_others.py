"""The systems that SymPy's and PyDy's own tests form: eomgen's accelerations satisfy SymPy's equations."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

#: Package -> folder of its tests -> objects there were at least when this was written.
SUITES = {"sympy.physics.mechanics": ("tests", 60), "pydy": (".", 10)}


@pytest.mark.thorough
@pytest.mark.parametrize("package", ["sympy.physics.mechanics", pytest.param("pydy", marks=pytest.mark.needs("PyDy"))])
def test_what_their_tests_form_has_their_accelerations(package: str) -> None:
    spec = importlib.util.find_spec(package)
    assert spec is not None
    assert spec.origin is not None
    where, least = SUITES[package]
    script = Path(__file__).parents[1] / "sympy_suites.py"
    done = subprocess.run(
        [sys.executable, str(script), str(Path(spec.origin).parent / where)],
        capture_output=True, text=True, timeout=3000,
    )  # fmt: skip
    found: list[dict[str, Any]] = [json.loads(line) for line in done.stdout.splitlines() if line.startswith('{"test"')]
    assert len(found) >= least, done.stderr[-2000:]
    # a motion without inertia is refused, and there SymPy's own matrix is singular
    wrong = [x for x in found if x.get("residual", 1.0) > 1e-12 and x.get("singular", 1.0) > 1e-12]
    assert not wrong
