"""What ``derive`` says of robots with many joints, and what ``auto`` chooses for them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from robots.shipped import urdf_robots

import eomgen as eg
from eomgen import pipeline
from eomgen.cli.command import eomgen
from eomgen.graph.count import count
from eomgen.program.factor import factorize, solve

ROBOTS = urdf_robots()
ARM = Path(__file__).parents[2] / "examples" / "arm.urdf"


def derive(*words: str) -> str:
    result = CliRunner().invoke(eomgen, ["derive", *words])
    assert result.exit_code == 0, result.output
    return result.stdout


@pytest.mark.parametrize(("name", "floating"), [("anymal", True), ("talos", True), ("panda", False)])
def test_auto_takes_what_needs_fewer_operations_and_says_so(name: str, floating: bool) -> None:
    model = eg.load(ROBOTS[name][0], floating=floating, rotation="euler_parameters", mimic="independent")
    equations = model.derive()
    choice = equations.choice
    assert choice is not None
    assert str(choice) in " ".join(str(equations).split())  # folded at 80 columns
    assert equations.method == choice.method == min(choice.operations, key=lambda m: choice.operations[m])
    recursive = model.derive("recursive")
    assert choice.operations["recursive"] == recursive.operations["accelerations"].total
    if name != "talos":
        tree = model.derive("embedding").tree
        turned = tree.turned
        assert (turned is not None) == floating  # a floating base is solved along its own axes, which takes fewer
        mass, bias = turned.system if turned else (tree.mass_matrix, tree.bias)
        solved = solve(factorize(mass, equations.kinematics.parent), [-h for h in bias])
        assert choice.operations["embedding"] == count(turned.accelerations(solved) if turned else solved).total
        plain = solve(factorize(tree.mass_matrix, equations.kinematics.parent), [-h for h in tree.bias])
        assert choice.operations["embedding"] <= count(plain).total * (0.93 if floating else 1.0)
        for method, told in choice.operations.items():  # and so says the generated code, rates of coordinates included
            run = pipeline.build(model.derive(method), "c", ["rhs"]).counts["rhs"].total
            assert told <= run <= 1.015 * told


def test_a_large_robot_is_told_in_lines_that_fit() -> None:
    out = derive(str(ROBOTS["talos"][0]), "--floating", "--rotation", "euler_parameters")
    assert max(map(len, out.splitlines())) <= 120
    assert "33: 32 revolute, 1 free" in out
    assert "degrees of freedom    38 (Gruebler-Kutzbach 38 in space)" in out
    assert "recursive chosen; operations of the right-hand side: embedding " in out
    assert len(out.splitlines()) < 30


def test_written_equations_name_the_accelerations_of_euler_parameters() -> None:
    words = ("--floating", "--rotation", "euler_parameters", "--equations", "--json")
    found: dict[str, Any] = json.loads(derive(str(ARM), *words, *(f"--lock={n}" for n in ("left", "right"))))
    assert found["accelerations"][:3] == ["base_x_ddot", "base_y_ddot", "base_z_ddot"]
    assert found["accelerations"][3:] == ["base_wx_dot", "base_wy_dot", "base_wz_dot", "yaw_ddot", "shoulder_ddot",
                                          "elbow_ddot"]  # fmt: skip
    assert len(found["mass_matrix"]) == len(found["force"]) == 9
