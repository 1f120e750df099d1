"""An analysis of a user's own: one file and one row, then a method of every module."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eomgen as eg
from eomgen.api.module import CALLS

FILE = '''"""Analysis: a Module and a state -> the sharpness of its resonance."""

import numpy as np


def quality_factors(module, /, x=None, t=0.0):
    """1 / (2 zeta) of every oscillation about a state; x (n_x,), the initial one by default."""
    roots = np.linalg.eigvals(module.jacobian(t, module.x0() if x is None else x))
    swinging = roots[roots.imag > 0.0]
    return np.sort(np.abs(swinging) / (-2.0 * swinging.real))
'''


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_an_analysis_is_one_file(target: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Against Q = sqrt(m k) / d (m the inertia) of a disc on a torsional spring with a damper."""
    path = tmp_path / "quality.py"
    path.write_text(FILE, encoding="utf-8")
    spec = importlib.util.spec_from_file_location("quality", path)
    assert spec is not None
    assert spec.loader is not None
    own: Any = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(own)
    m = eg.Model("resonator")
    for name, value in (("m", 2.0), ("k", 18.0), ("d", 0.3)):
        m.parameter(name, value)
    m.revolute("pin", m.ground, m.body("disc", mass=0, inertia={"zz": "m"}), coordinate="s")
    m.torsional_spring("spring", "s", stiffness="k")
    m.torsional_damper("damper", "s", damping="d")
    mod: Any = m.compile(target=target)
    with pytest.raises(AttributeError, match="quality_factors"):
        mod.quality_factors()
    monkeypatch.setitem(CALLS, "quality_factors", own.quality_factors)
    np.testing.assert_allclose(mod.quality_factors(), [np.sqrt(2.0 * 18.0) / 0.3], rtol=1e-12)
    np.testing.assert_allclose(mod.bind({"d": 0.6}).quality_factors(), [np.sqrt(2.0 * 18.0) / 0.6], rtol=1e-12)
    assert "quality_factors" in dir(mod)
    assert mod.quality_factors.__doc__ == own.quality_factors.__doc__
