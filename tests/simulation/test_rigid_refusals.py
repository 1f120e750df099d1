"""Rigid contact: what has no impulses refuses it by name, so that nothing falls through a floor without a word."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rigid_scenes import SHAPES, on_floor, rigid

import eomgen as eg
from eomgen.errors import ModelError, UnavailableError, UsageError

TIMES = np.linspace(0.0, 0.1, 5)
ENTRIES: dict[str, Callable[[Any], Any]] = {
    "simulate_many": lambda m: m.simulate_many((0, 0.1), m.x0(j_y=0.1)[:, None]),
    "integrator": lambda m: m.integrator()(0.0, m.x0(j_y=0.1), 0.1),
    "step": lambda m: m.step(0.0, m.x0(j_y=0.1), 0.01),
    "sensitivities": lambda m: m.sensitivities(["j_y"], (0, 0.1)),
    "fit": lambda m: m.fit({"t": TIMES, "j_y": 0.1 + 0.0 * TIMES}, ["j_y_dot"]),
    "linearize": lambda m: m.linearize({"j_y": 0.1}),
    "equilibrium": lambda m: m.equilibrium({"j_y": 0.1}),
    "modes": lambda m: m.modes({"j_y": 0.1}),
    "simulate_impacts": lambda m: m.simulate_impacts(0.1, {"j_y": 1.0}),
    "dae.solve": lambda m: m.dae.solve((0, 0.1), {"j_y": 0.1}),
    "method DOP853": lambda m: m.DOP853,
    "method RK45": lambda m: m.RK45,
    "method RK23": lambda m: m.RK23,
    "method Radau": lambda m: m.Radau,
    "method Taylor": lambda m: m.Taylor,
}


@pytest.fixture(scope="module", params=["cython", "numpy"])
def ball(request: pytest.FixtureRequest) -> Any:
    return on_floor(SHAPES["circle"], {"friction": 0.3}, target=request.param)


@pytest.mark.parametrize("entry", ENTRIES)
def test_entry(ball: Any, entry: str) -> None:
    what = "linearize" if entry == "modes" else entry
    with pytest.raises(UnavailableError, match=rf"^{what} is not available for .* contacts 'c' of 'on_floor'.*moreau"):
        ENTRIES[entry](ball)


@pytest.mark.parametrize(
    "entry", sorted({*ENTRIES} - {"fit", "modes", "simulate_impacts", "method Taylor", "dae.solve"})
)
def test_a_law_with_a_force_is_not_refused(soft: Any, entry: str) -> None:
    ENTRIES[entry](soft)


@pytest.fixture(scope="module")
def soft() -> Any:
    m = eg.Model("soft", gravity=(0, -9.81, 0))
    body = m.body("b", mass=1.0, inertia={"zz": 0.01})
    m.prismatic("j", m.ground, body, axis="y", coordinate="j_y")
    law = {"stiffness": 1e5, "exponent": 1.0}
    m.contacts("c", {**SHAPES["circle"], "on": body}, {"shape": "half_plane", "on": m.ground}, law)
    return m.compile()


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_units(version: str, tmp_path: Path) -> None:
    m = eg.Model("unit", gravity=(0, -9.81, 0))
    body = m.body("b", mass=1.0, inertia={"zz": 0.01})
    m.planar("j", m.ground, body)
    m.contacts("c", {**SHAPES["circle"], "on": body}, {"shape": "half_plane", "on": m.ground}, rigid(friction=0.3))
    with pytest.raises(ModelError, match=r"contacts\.c\.normal_law.*rigid contacts exert impulses, which an FMU"):
        m.derive().write_fmu(tmp_path / "unit.fmu", version=version)
    with pytest.raises(UsageError, match="cuda"):
        m.compile(target="cuda")


def test_verification_leaves_runs_out(ball: Any) -> None:
    found = {one.check: one for one in ball.verify(states=1, seconds=0.0).findings}
    assert "only method moreau solves for" in found["runs: methods agree"].note
    assert all(one.ok for one in found.values() if "runs" not in one.check)


@pytest.mark.parametrize("asked", ["power(c)", "force(c)", "force(c, on=b).y"])
def test_forces_of_rigid_contacts_as_outputs(asked: str) -> None:
    """They are refused, and the message names what runs have, which is there."""
    m = eg.Model("asked", gravity=(0, -9.81, 0))
    body = m.body("b", mass=1.0, inertia={"zz": 0.01})
    m.planar("j", m.ground, body)
    m.contacts("c", {**SHAPES["circle"], "on": body}, {"shape": "half_plane", "on": m.ground}, rigid(friction=0.3))
    run = m.compile().simulate(0.01, {"j_y": 0.5}, method="moreau", step=1e-3, contact_forces=True)
    m.output("f", asked)
    with pytest.raises(ModelError, match=r"'c'.*normal_law: rigid.*exerts impulses, not forces") as told:
        m.compile(target="numpy")
    if "on=" not in asked:
        assert "normal(c)" in str(told.value)
        assert {"normal(c)", "friction(c)"} <= set(run.columns.names)
    assert "run.contact_forces.on(BODY)" in str(told.value)
    assert run.contact_forces.on("b").shape == (6, len(run))


@pytest.mark.parametrize(("mu", "of"), [("0.3 + 0.1*z", "z"), ("0.3 + 0.1*j_x_dot", "j_x_dot"), ("0.3 + vx(b)", "j_x")])
@pytest.mark.parametrize("rigid_only", [True, False])
def test_friction_that_depends_on_the_motion(mu: str, of: str, rigid_only: bool) -> None:
    m = eg.Model("slowing", gravity=(4, -9, 0))
    m.state("z", "1 - z")
    body = m.body("b", mass=1.0, inertia={"zz": 0.01})
    m.planar("j", m.ground, body)
    law = rigid(friction=mu) if rigid_only else {"stiffness": 1e5, "friction": mu, "smoothing": 1e-3}
    m.contacts("c", {**SHAPES["circle"], "on": body}, {"shape": "half_plane", "on": m.ground}, law)
    with pytest.raises(UsageError, match=rf"contact 'c' depends on {of}.*time, coordinates, parameters and inputs"):
        m.compile(target="numpy").simulate(0.01, {"j_y": 0.5}, method="moreau", step=1e-3)
