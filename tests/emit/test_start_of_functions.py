"""Functions of CasADi, JAX and CUDA: x0 is the state in which the model starts, as the module has it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest

import eomgen as eg
from eomgen.emit.cuda.device_text import describe_device
from eomgen.generation import generate
from eomgen.pipeline import build, with_start


def crane() -> eg.Model:
    """A tree whose rates are declared in part, with a first-order state."""
    m = eg.Model("crane", gravity=(0, -9.81, 0))
    trolley = m.body("trolley", mass=10.0)
    m.prismatic("rail", m.ground, trolley, axis="x", coordinate="s")
    m.revolute("hook", trolley, m.body("load", mass=2.0, com=(0, -1, 0), inertia={"zz": 0.1}), coordinate="swing")
    m.state("pressure", "-pressure", initial=7e4)
    m.initial(s=0.2, s_dot=0.1)
    return m


def turning() -> eg.Model:
    """A loop whose dependent rate is declared."""
    m = models.build("slider_crank")
    m.initial = {"theta": 0.7, "s_dot": -0.3}
    return m


def reaching() -> eg.Model:
    """An output among the declared initial values."""
    m = eg.Model("reaching")
    rod = m.body("rod", mass=1.0, inertia={"zz": 0.1}, markers={"tip": (0.5, 0, 0)})
    m.revolute("A", m.ground, rod, coordinate="turn")
    m.initial["x(rod.tip)"] = 0.4
    m.guess(turn=0.5)
    return m


@pytest.mark.parametrize("make", [crane, turning, reaching])
@pytest.mark.parametrize("library", ["casadi", "jax"])
def test_x0_is_the_start_of_the_model(make: Any, library: str, tmp_path: Path) -> None:
    equations = make().derive()
    start = equations.compile(target="numpy").x0()
    functions = getattr(equations, f"to_{library}")()
    np.testing.assert_allclose(np.asarray(functions.x0, dtype=float).ravel(), start, rtol=1e-12, atol=1e-12)
    package = generate(make(), tmp_path, target=library)
    line = next(text for text in (package / "__init__.py").read_text().splitlines() if text.startswith("x0 ="))
    assert repr(float(start[0])) in line


def test_x0_on_a_device_is_the_start_of_the_model() -> None:
    equations = crane().derive()
    program = with_start(equations, build(equations, "cuda"))
    assert describe_device(program)["x0"] == pytest.approx([0.2, 0.0, 0.1, 0.0, 7e4])
