"""An exported package has the analyses, with NumPy alone but for the integration."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest

from eomgen import pipeline

SCRIPT = """
import json, sys

class Refuse:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in ("eomgen", "sympy", *sys.argv[1:]):
            raise ImportError(f"a package must not need {name}")

sys.meta_path.insert(0, Refuse())
import spring_four_bar as package

rest = package.equilibrium({"phi": 2.0})
found = package.linearise(rest.x)
modes = package.modes(rest.x)
preload = package.equilibrium(hold={"phi": 2.4}, unknowns=["L0"])
result = {
    "phi": rest["phi"], "A": found.A.tolist(), "omega": modes.frequencies.tolist(), "L0": preload["L0"],
    "by_p": package.parameter_jacobian(0.0, rest.x).tolist(),
}
if "scipy" not in sys.argv:
    result["by_k"] = package.sensitivities(["k"], 0.1)["phi", "k"][-1]
print(json.dumps(result))
"""


@pytest.mark.parametrize("without", [[], ["scipy"]], ids=["with SciPy", "NumPy alone"])
def test_a_numpy_package(compiled: Callable[..., Any], without: list[str], tmp_path: Path) -> None:
    from .conftest import spring_four_bar

    pipeline.generate(spring_four_bar(), tmp_path, target="numpy")
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, *without], cwd=tmp_path, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    result, mod = json.loads(done.stdout), compiled("spring_four_bar")
    expected = float(models.reference("iftomm_fourbar_diagonal_spring")["reference"]["phi_eq"])
    assert result["phi"] == pytest.approx(expected, abs=1e-10)
    x = mod.x0(phi=expected)
    np.testing.assert_allclose(result["A"], mod.linearise(x).A, atol=1e-9)
    np.testing.assert_allclose(result["omega"], mod.modes(x).frequencies, rtol=1e-9)
    np.testing.assert_allclose(result["by_p"], mod.parameter_jacobian(0.0, x), atol=1e-8)
    if not without:
        assert result["by_k"] == pytest.approx(mod.sensitivities(["k"], 0.1)["phi", "k"][-1], rel=1e-9)
