"""Exported packages of the forms stand alone: same numbers as in process, without eomgen."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import models
import numpy as np
import pytest

from eomgen.generation import generate

ALONE = """
import json, sys
sys.modules["eomgen"] = sys.modules["sympy"] = None
import numpy as np
import {name} as package
x = package.x0()
result = dict(rhs=package.rhs(0.1, x).tolist(), jacobian=package.jacobian(0.1, x).tolist())
y, yp = package.dae.initial(x)
result["residual"] = package.dae.residual(0.0, y, yp).tolist()
if package.metadata["method"] == "hamilton":
    result["H"] = package.canonical.hamiltonian(package.canonical.of(x))
print(json.dumps(result))
"""


@pytest.mark.parametrize(
    ("name", "method", "baumgarte"),
    [
        ("slider_crank", "newton_euler", None),
        ("four_bar", "augmented", (5.0, 5.0)),
        ("double_pendulum", "hamilton", None),
    ],
)
def test_a_package_of_each_kind_stands_alone(
    tmp_path: Path, name: str, method: str, baumgarte: tuple[float, float] | None
) -> None:
    generate(models.build(name), tmp_path, method, "numpy", baumgarte=baumgarte)
    done = subprocess.run(
        [sys.executable, "-c", ALONE.format(name=name)], cwd=tmp_path, capture_output=True, text=True, timeout=600
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    mod = models.build(name).compile(method, target="numpy", baumgarte=baumgarte)
    x = mod.x0()
    np.testing.assert_allclose(found["rhs"], mod.rhs(0.1, x), rtol=1e-12)
    np.testing.assert_allclose(found["jacobian"], mod.jacobian(0.1, x), rtol=1e-10, atol=1e-10)
    assert np.abs(found["residual"]).max() < 1e-10 * max(1.0, np.abs(found["rhs"]).max())
    if "H" in found:
        assert found["H"] == pytest.approx(float(np.sum(mod.energy(x))), rel=1e-12)
