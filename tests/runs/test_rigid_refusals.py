"""Rigid contact: wrong calls, laws and files are refused by name, and so is all that knows no impulses."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from refusals import refused, refuses
from rigid_scenes import SHAPES, G, on_floor, rigid
from sweeps import TARGETS

import eomgen as eg


@pytest.fixture(scope="module")
def ball() -> Any:
    return on_floor(SHAPES["circle"], {"friction": 0.3}, target="numpy")


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({}, "EG-MISSING step="),
        ({"step": 0.0}, "EG-RANGE step 0"),
        ({"step": -1e-3}, "EG-RANGE step 0"),
        ({"step": "fast"}, "EG-NUMBER step"),
        ({"step": 1e-3, "rtol": 1e-6}, "EG-NAME-UNKNOWN rtol"),
        ({"step": 1e-3, "contact_tolerence": 1e-6}, "EG-NAME-UNKNOWN contact_tolerance"),
        ({"step": 1e-3, "contact_tolerance": 0.0}, "EG-RANGE contact_tolerance 0"),
        ({"step": 1e-3, "contact_iterations": 0}, "EG-RANGE contact_iterations 1"),
        ({"step": 1e-3, "events": "j_y"}, "EG-UNSUPPORTED events"),
        ({"step": 1e-3, "dense_output": True}, "EG-NAME-UNKNOWN dense_output"),
        ({"step": 1e-3, "t_eval": [0.5, 0.1]}, "EG-RANGE t_eval"),
        ({"step": 1e-3, "span": (1.0, 0.0)}, "EG-UNSUPPORTED forwards"),
    ],
)
def test_options(ball: Any, options: dict[str, Any], told: str) -> None:
    refuses(told, lambda: ball.simulate(options.pop("span", 0.2), {"j_y": 0.2}, method="moreau", **options))


def test_deep_start(ball: Any) -> None:
    refuses("EG-CONTRADICTION c 0.05", ball.simulate, 0.2, {"j_y": 0.05}, method="moreau", step=1e-3)


@pytest.mark.parametrize("method", [None, "Radau"])
def test_other_methods_have_no_force_for_it(ball: Any, method: str | None) -> None:
    refuses("EG-UNSUPPORTED rigid moreau", ball.simulate, 0.2, {"j_y": 0.2}, method=method)


def test_residual_that_is_not_reached() -> None:
    """Few iterations: the run goes on, and a warning says in how many steps and by how much."""
    block = on_floor({"shape": "box", "size": (0.6, 0.2)}, {"friction": 0.4}, 0.1, 0.03, target="numpy")
    with pytest.warns(UserWarning, match="of 20 steps"):
        run = block.simulate(
            0.02,
            {"j_y": 0.1, "j_x_dot": 1.0},
            method="moreau",
            step=1e-3,
            contact_iterations=1,
            contact_tolerance=1e-15,
        )
    assert run.metadata["missed_steps"] > 0
    assert run.metadata["contact_residual"] > 0.0


def test_inputs() -> None:
    """A box that is pushed by a ramp holds until the push exceeds friction, and first-order states go along."""
    m = eg.Model("pushed", gravity=(0, -G, 0))
    m.input("push"), m.parameter("mu", 0.5)
    body = m.body("b", mass=1.0, inertia={"zz": 0.05})
    m.planar("j", m.ground, body)
    m.force("p", body, ("push", 0, 0))
    m.state("a", "push - a", initial=0.0)
    m.contacts(
        "c",
        {"shape": "box", "size": (0.6, 0.2), "on": body},
        {"shape": "half_plane", "on": m.ground},
        rigid(friction="mu"),
    )
    run = m.compile(target="numpy").simulate(
        1.0, {"j_y": 0.1}, {"mu": 0.4}, inputs={"push": ([0.0, 1.0], [0.0, 8.0])}, method="moreau", step=1e-3
    )
    begins = 0.4 * G / 8.0
    k = int(np.searchsorted(run.t, begins))
    assert np.abs(run["j_x"][: k - 1]).max() < 1e-12
    t = run.t[-1]
    np.testing.assert_allclose(run["j_x_dot"][-1], 4.0 * (t * t - begins**2) - 0.4 * G * (t - begins), atol=1e-4)
    np.testing.assert_allclose(run["a"], 8.0 * (run.t - 1 + np.exp(-run.t)), atol=1e-3)


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


@pytest.mark.parametrize("target", TARGETS)
def test_what_has_no_impulses_says_so(target: str) -> None:
    floor = on_floor(SHAPES["circle"], {"friction": 0.3}, target=target)
    for entry, call in ENTRIES.items():
        what = "linearize" if entry == "modes" else entry
        refuses(f"EG-UNAVAILABLE {what} 'c' 'on_floor' moreau", call, floor)


@pytest.mark.parametrize("asked", ["power(c)", "force(c, on=b).y"])
def test_forces_of_rigid_contacts_as_outputs(asked: str) -> None:
    """They are refused, and the message names what runs have, which is there."""
    m = eg.Model("asked", gravity=(0, -9.81, 0))
    body = m.body("b", mass=1.0, inertia={"zz": 0.01})
    m.planar("j", m.ground, body)
    m.contacts("c", {**SHAPES["circle"], "on": body}, {"shape": "half_plane", "on": m.ground}, rigid(friction=0.3))
    run = m.compile(target="numpy").simulate(0.01, {"j_y": 0.5}, method="moreau", step=1e-3, contact_forces=True)
    with refused("EG-UNSUPPORTED impulses FMU", eg.ModelError) as caught:
        m.derive().write_fmu("asked.fmu")
    assert [problem.path for problem in caught.value.problems] == ["contacts.c"]  # whatever its law is called there
    m.output("f", asked)
    with refused(
        "EG-UNSUPPORTED outputs.f.expression run.contact_forces.on(BODY)" + " normal(c)" * ("on=" not in asked)
    ):
        m.compile(target="numpy")
    assert {"normal(c)", "friction(c)"} <= set(run.columns.names)
    assert run.contact_forces.on("b").shape == (6, len(run))


FILE = """
name: slid
gravity: [0, -9.81, 0]
bodies: {crate: {mass: 20.0, inertia: {zz: 0.8}}}
joints: {j: {type: planar, between: [ground, crate]}}
contacts:
  floor:
    first: [{shape: box, on: crate, size: [0.6, 0.4]}]
    second: [{shape: half_plane, on: ground}]
    LAW
    friction: 0.25
initial: {j_y: 0.2, j_x_dot: 1.0}
simulation: {end: 0.2, method: moreau, step: 2e-3}
"""

RIGID, SOFT = "normal_law: rigid", "stiffness: 1e7\n    smoothing: 1e-3"
SPEED = 1.0 - 0.25 * 9.81 * 0.2  #: of a block that slides, after 0.2 s


def written(folder: Path, law: str, old: str = "", new: str = "") -> Path:
    path = folder / "slid.yaml"
    text = FILE.replace("LAW", law)
    assert old in text
    path.write_text(text.replace(old, new) if old else text)
    return path


@pytest.mark.parametrize("law", [RIGID, SOFT])
def test_a_run_takes_method_and_step_of_the_file(law: str, tmp_path: Path) -> None:
    model = eg.load(written(tmp_path, law))
    assert model.simulation == {"end": 0.2, "method": "moreau", "step": 2e-3}
    mod = model.compile(target="numpy")
    run = mod.simulate()
    assert (run.metadata["method"], len(run.t)) == ("moreau", 101)
    assert run["j_x_dot"][-1] == pytest.approx(SPEED, abs=1e-9)
    assert len(mod.simulate(step=1e-2).t) == len(mod.simulate(method="moreau", step=1e-2).t) == 21
    assert len(mod.simulate(method="moreau").t) == 101
    model.save(tmp_path / "again.yaml")
    assert eg.load(tmp_path / "again.yaml").simulation == model.simulation
