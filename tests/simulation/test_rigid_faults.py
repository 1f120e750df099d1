"""Rigid contact: each wrong call its own error, compliant laws beside it, and parameters given late."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from rigid_scenes import SHAPES, G, on_floor, pile, rigid

import eomgen as eg
from eomgen.errors import ModelError, UsageError
from eomgen.simulation.moreau import ContactWarning


@pytest.fixture(scope="module")
def ball() -> Any:
    return on_floor(SHAPES["circle"], {"friction": 0.3}, target="numpy")


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({}, "needs step="),
        ({"step": 0.0}, "step must be greater than 0 s"),
        ({"step": -1e-3}, "step must be greater than 0 s"),
        ({"step": "fast"}, "step"),
        ({"step": 1e-3, "rtol": 1e-6}, "rtol"),
        ({"step": 1e-3, "contact_tolerence": 1e-6}, "contact_tolerance"),
        ({"step": 1e-3, "contact_tolerance": 0.0}, "contact_tolerance must be greater than 0"),
        ({"step": 1e-3, "contact_iterations": 0}, "contact_iterations must be a whole number from 1"),
        ({"step": 1e-3, "events": "j_y"}, "watches no events"),
        ({"step": 1e-3, "dense_output": True}, "dense_output"),
        ({"step": 1e-3, "t_eval": [0.5, 0.1]}, "t_eval"),
    ],
)
def test_options(ball: Any, options: dict[str, Any], told: str) -> None:
    with pytest.raises(UsageError, match=told):
        ball.simulate(0.2, {"j_y": 0.2}, method="moreau", **options)


def test_backwards(ball: Any) -> None:
    with pytest.raises(UsageError, match="forwards only"):
        ball.simulate((1.0, 0.0), {"j_y": 0.2}, method="moreau", step=1e-3)


def test_no_contacts() -> None:
    m = eg.Model("bare")
    m.prismatic("j", m.ground, m.body("b", mass=1.0), axis="x")
    with pytest.raises(UsageError, match="bare has no contacts"):
        m.compile(target="numpy").simulate(1.0, method="moreau", step=1e-3)


def test_an_event_that_ends_a_run() -> None:
    m = pile(["circle", "box"])
    m.event("late", "t-0.05", terminal=True)
    with pytest.raises(UsageError, match="method moreau watches no events, and late ends the run"):
        m.compile(target="numpy").simulate(0.1, method="moreau", step=1e-3)


def test_deep_start(ball: Any) -> None:
    with pytest.raises(UsageError, match=r"starts with shapes inside each other; contacts 'c': .* 0.05 m deep"):
        ball.simulate(0.2, {"j_y": 0.05}, method="moreau", step=1e-3)


def test_a_rigid_contact_has_no_force_to_be_told() -> None:
    m = pile(["circle", "box"])
    m.output("push", "force(walls, on=b0).y")
    with pytest.raises(ModelError, match=r"outputs.push.*normal_law: rigid, which exerts impulses, not forces"):
        m.compile(target="numpy")


@pytest.mark.parametrize("method", [None, "Radau", "RK45"])
def test_other_methods_have_no_force_for_it(ball: Any, method: str | None) -> None:
    with pytest.raises(UsageError, match="have normal_law: rigid, which exerts impulses"):
        ball.simulate(0.2, {"j_y": 0.2}, method=method)


@pytest.mark.parametrize(
    ("law", "told"),
    [
        ({"friction": -0.1}, "friction.*must be 0 or greater"),
        ({"restitution": 1.5}, "restitution.*at most 1"),
        ({"restitution": -0.5}, "restitution.*0 or greater"),
        ({"stiffness": 1e4}, "stiffness.*has no meaning in normal_law: rigid"),
        ({"smoothing": 1e-3, "friction": 0.3}, "smoothing.*has no meaning in normal_law: rigid"),
    ],
)
def test_law(law: dict[str, Any], told: str) -> None:
    with pytest.raises(ModelError, match=told):
        on_floor(SHAPES["circle"], law, target="numpy")


@pytest.mark.parametrize("values", [{"mu": -0.2}, {"e": 1.5}, {"e": -0.1}])
def test_parameters_of_the_law_given_late(values: dict[str, float]) -> None:
    mod = pile(["circle", "box"]).compile(target="numpy")
    with pytest.raises(UsageError, match=r"forces.walls.(friction|restitution): is .*; must be"):
        mod.simulate(0.1, {"j0_y": 0.1, "j1_y": 0.6}, values, method="moreau", step=1e-3)


def test_residual_that_is_not_reached() -> None:
    """Few iterations: the run goes on, and a warning says in how many steps and by how much."""
    block = on_floor({"shape": "box", "size": (0.6, 0.2)}, {"friction": 0.4}, 0.1, 0.03, target="numpy")
    with pytest.warns(ContactWarning, match=r"of 20 steps leave a residual of the contact laws of up to .* m/s"):
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


def test_compliant_contact_has_a_rigid_run() -> None:
    """The law of force is left out, its friction and restitution count: the block slides as Coulomb's law says."""
    m = eg.Model("both", gravity=(0, -G, 0))
    body = m.body("b", mass=2.0, inertia={"zz": 0.05})
    m.planar("j", m.ground, body)
    law = {"stiffness": 1e6, "dissipation": 0.5, "friction": 0.25, "smoothing": 1e-3}
    m.contacts("c", {"shape": "box", "size": (0.6, 0.2), "on": body}, {"shape": "half_plane", "on": m.ground}, law)
    mod = m.compile()
    start = {"j_y": 0.1, "j_x_dot": 1.0}
    rigidly = mod.simulate(0.3, start, method="moreau", step=1e-3)
    np.testing.assert_allclose(rigidly["j_x_dot"], 1.0 - 0.25 * G * rigidly.t, atol=1e-9)
    soft = mod.simulate(0.3, start, method="Radau", rtol=1e-7, t_eval=rigidly.t)
    np.testing.assert_allclose(rigidly["j_x"], soft["j_x"], atol=2e-3)


def test_times_wanted(ball: Any) -> None:
    """t_eval: between steps states are linear; inputs and parameters count as in other runs."""
    full = ball.simulate(0.3, {"j_y": 0.2}, method="moreau", step=1e-3)
    some = ball.simulate(0.3, {"j_y": 0.2}, method="moreau", step=1e-3, t_eval=[0.0, 0.1, 0.1505, 0.3])
    np.testing.assert_allclose(some["j_y"][[0, 1, 3]], full["j_y"][[0, 100, 300]], atol=1e-12)
    np.testing.assert_allclose(some["j_y"][2], full["j_y"][150:152].mean(), atol=1e-12)
    assert full.metadata["method"] == "moreau"


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
    run = m.compile().simulate(
        1.0, {"j_y": 0.1}, {"mu": 0.4}, inputs={"push": ([0.0, 1.0], [0.0, 8.0])}, method="moreau", step=1e-3
    )
    begins = 0.4 * G / 8.0
    k = int(np.searchsorted(run.t, begins))
    assert np.abs(run["j_x"][: k - 1]).max() < 1e-12
    t = run.t[-1]
    np.testing.assert_allclose(run["j_x_dot"][-1], 4.0 * (t * t - begins**2) - 0.4 * G * (t - begins), atol=1e-4)
    np.testing.assert_allclose(run["a"], 8.0 * (run.t - 1 + np.exp(-run.t)), atol=1e-3)


def test_soil_is_not_rigid() -> None:
    """A model may have contacts of which the method knows none."""
    m = eg.Model("sunk", gravity=(0, -9.81, 0))
    body = m.body("sole", mass=100.0)
    m.prismatic("y", m.ground, body, axis="y")
    shape = {"shape": "plate", "on": body, "length": 0.5, "width": 0.3}
    m.contacts("bed", shape, {"shape": "half_plane", "on": m.ground}, {"soil": "dry_sand", "lateral": False})
    with pytest.raises(UsageError, match=r"sunk has no contacts that can be rigid \(soil yields\)"):
        m.compile(target="numpy").simulate(1.0, method="moreau", step=1e-3)
