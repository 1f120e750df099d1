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

from eomgen.generation import generate

SCRIPT = """
import json, sys

class Refuse:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in ("eomgen", "sympy", *sys.argv[1:]):
            raise ImportError(f"a package must not need {name}")

sys.meta_path.insert(0, Refuse())
import spring_four_bar as package

rest = package.equilibrium({"phi": 2.0})
found = package.linearize(rest.x)
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

    generate(spring_four_bar(), tmp_path, target="numpy")
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, *without], cwd=tmp_path, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    result, mod = json.loads(done.stdout), compiled("spring_four_bar")
    expected = float(models.reference("iftomm_fourbar_diagonal_spring")["reference"]["phi_eq"])
    assert result["phi"] == pytest.approx(expected, abs=1e-10)
    x = mod.x0(phi=expected)
    np.testing.assert_allclose(result["A"], mod.linearize(x).A, atol=1e-9)
    np.testing.assert_allclose(result["omega"], mod.modes(x).frequencies, rtol=1e-9)
    np.testing.assert_allclose(result["by_p"], mod.parameter_jacobian(0.0, x), atol=1e-8)
    if not without:
        assert result["by_k"] == pytest.approx(mod.sensitivities(["k"], 0.1)["phi", "k"][-1], rel=1e-9)


THROUGH = """
import json, sys

class Refuse:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in ("eomgen", "sympy"):
            raise ImportError(f"a package must not need {name}")

sys.meta_path.insert(0, Refuse())
import struck as package

s = package.sensitivities(["k", "F"], 2.0, {"s": 1.0, "s_dot": 0.5})
print(json.dumps([s["s", "k"][-1], s["s", "F"][-1], s.event_times["wall"].tolist()]))
"""


def test_sensitivities_through_an_impact_with_a_signal_of_the_model(tmp_path: Path) -> None:
    """A package has no expressions: derivatives of its inputs over time come with it."""
    import eomgen as eg

    m = eg.Model("struck")
    m.parameter("k", 4.0)
    m.parameter("F", 0.7)
    m.prismatic("J", m.ground, m.body("b", mass=1.0), axis="x", coordinate="s")
    m.torque("motor", "J", m.input("u", signal="-F*s**2*sin(k*t) - k*s"))
    m.event("wall", "s + 0.5 + 0.1*k", restitution=0.5)
    generate(m, tmp_path, target="numpy")
    done = subprocess.run([sys.executable, "-c", THROUGH], cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    by_k, by_F, times = json.loads(done.stdout)
    mod, h, ends = m.compile(target="numpy"), 1e-5, []
    assert len(times) == 1
    for name, found in (("k", by_k), ("F", by_F)):
        for sign in (1, -1):
            p = {name: mod.p[mod.p_names.index(name)] + sign * h}
            ends.append(mod.simulate(2.0, {"s": 1.0, "s_dot": 0.5}, p, rtol=1e-12, atol=1e-14))
        right, left = ends[-2:]
        assert found == pytest.approx((right["s"][-1] - left["s"][-1]) / (2 * h), rel=1e-6)
        by = (right.t_events["wall"][0] - left.t_events["wall"][0]) / (2 * h)
        assert times[0][0 if name == "k" else 1] == pytest.approx(by, rel=1e-6)
