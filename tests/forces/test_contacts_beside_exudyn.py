"""Contacts of groups beside Exudyn on the same scenes; `reference/exudyn_contacts.py` made its answers."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eomgen as eg

SCENES = json.loads((Path(__file__).parents[1] / "reference" / "exudyn_contacts.json").read_text(encoding="utf-8"))
LAW = {"stiffness": SCENES["stiffness"], "exponent": SCENES["exponent"], "dissipation": 0}


def world(name: str) -> eg.Model:
    return eg.Model(name, gravity=(0, 0, -SCENES["gravity"]))


def ball(m: eg.Model, name: str, mass: float, radius: float) -> tuple[Any, dict[str, Any]]:
    body = m.body(name, mass=mass, inertia=[0.4 * mass * radius**2] * 3)
    return body, {"shape": "sphere", "on": body, "radius": radius}


def fixed(m: eg.Model, radius: float) -> dict[str, Any]:
    return {"shape": "sphere", "on": m.ground, "radius": radius}


def test_balls_strike_roll_and_slide() -> None:
    """Friction between sticking and sliding is smoothed in another way there; the scene slides nearly all the time."""
    scene, names = SCENES["balls"], ("cue", "red", "big")
    m, shapes = world("balls"), []
    for k, name in enumerate(names):
        body, shape = ball(m, name, scene["masses"][k], scene["radii"][k])
        shapes.append(shape)
        m.free(f"{name}_fly", m.ground, body, rotation="euler_parameters")
        for i, axis in enumerate("xyz"):
            m.initial({f"{name}_fly_{axis}": scene["places"][k][i], f"{name}_fly_w{axis}": scene["spins"][k][i]})
            m.initial({f"{name}_fly_{axis}_dot": scene["velocities"][k][i]})
    law = {**LAW, "friction": scene["friction"], "smoothing": scene["friction_zone"]}
    m.contacts("over_the_dome", shapes, fixed(m, scene["dome"]), law)
    m.contacts("among", shapes, law=law)
    run = m.compile().simulate(scene["end"], rtol=1e-10, atol=1e-12)
    for name, place, speed in zip(names, scene["answer"]["places"], scene["answer"]["velocities"], strict=True):
        assert [run[f"{name}_fly_{axis}"][-1] for axis in "xyz"] == pytest.approx(place, abs=2e-5)
        assert [run[f"{name}_fly_{axis}_dot"][-1] for axis in "xyz"] == pytest.approx(speed, abs=2e-4)


def test_a_string_of_beads_falls_over_a_drum() -> None:
    scene = SCENES["beads"]
    m = world("beads")
    made = [ball(m, f"bead{k}", scene["mass"], scene["radius"]) for k in range(scene["count"])]
    m.free("first", m.ground, made[0][0], rotation="euler_parameters")
    for k, ((before, _), (after, _)) in enumerate(pairwise(made)):
        m.spherical(f"link{k}", before.at(scene["pitch"] / 2, 0, 0), after.at(-scene["pitch"] / 2, 0, 0))
    m.contacts("over_the_drum", [shape for _, shape in made], fixed(m, scene["drum"]), LAW)
    m.initial(first_x=scene["first"][0], first_y=scene["first"][1], first_z=scene["first"][2])
    mod = m.compile()
    run = mod.simulate(scene["end"], rtol=1e-11, atol=1e-13)
    places = np.array([pose[:3, 3] for pose in mod.poses(run.x[: mod.n_q, -1], t=scene["end"])])
    np.testing.assert_allclose(places, scene["answer"]["places"], rtol=0.0, atol=1e-5)
