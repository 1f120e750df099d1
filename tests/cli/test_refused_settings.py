"""Values of --set that elements do not allow: the lines and the exit code of a model that declares them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from .conftest import Call

MODEL = """
name: dropped
parameters: {r: 0.1, mu: 0.3}
bodies: {ball: {mass: 1, inertia: {zz: 0.1}}}
joints: {J: {type: planar, between: [ground, ball], coordinates: [x, y, phi]}}
forces:
  floor: {type: contacts, first: [{shape: circle, on: ball, radius: r}], second: [{shape: half_plane, on: ground}],
    stiffness: 1.0e+4, friction: mu, smoothing: 0.01}
simulation: {end: 0.01}
"""


@pytest.mark.parametrize("verb", ["run", "linearize", "equilibrium"])
def test_a_setting_ends_as_check_does(call: Call, model_file: Callable[[str], Path], verb: str) -> None:
    file = model_file(MODEL)
    found = call(verb, file, "--target", "numpy", "--set", "r=-0.1", "--set", "mu=-1")
    assert found.code == 1
    assert "forces.floor.first[0].radius: is -0.1 with r = -0.1; must be greater than 0" in found.err
    assert "forces.floor.friction: is -1 with mu = -1; must be 0 or greater" in found.err
    declared = call("check", model_file(MODEL.replace("r: 0.1, mu: 0.3", "r: -0.1, mu: -1")))
    assert declared.code == 1
    assert "forces.floor.first[0].radius: is -0.1; must be greater than 0" in declared.err
    assert "forces.floor.friction: is -1; must be 0 or greater" in declared.err
