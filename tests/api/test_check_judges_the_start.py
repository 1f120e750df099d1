"""check refuses the initial values that a run refuses, by the same assembly, at their place in the file."""

from __future__ import annotations

import warnings
from math import sqrt
from pathlib import Path

import pytest

import eomgen as eg
from eomgen.kinematics.report import MechanismReport

ARM = """
name: arm
gravity: [0, -9.81, 0]
parameters: {l: {value: 1.0, unit: m}, k: {unit: rad VALUE}}
bodies:
  rod: {mass: 1, com: [l/2, 0, 0], inertia: {xx: 0.1, yy: 0.1, zz: 0.1}, markers: {tip: [l, 0, 0]}}
joints:
  A: {type: JOINT, between: [ground, rod]}
outputs: {tip_x: x(rod.tip), tip_vx: vx(rod.tip), tip_ax: ax(rod.tip), square: vx(rod.tip)**2}
initial: {INITIAL}
"""
HINGE, BALL = "revolute, coordinate: q, limits: {lower: -1, upper: 1}", "spherical, rotation: euler_parameters"
EXAMPLES = Path(__file__).parents[2] / "examples"


def arm(initial: str, joint: str = HINGE, value: str = ", value: 0.3") -> str:
    return ARM.replace("INITIAL", initial).replace("JOINT", joint).replace(" VALUE", value)


def four_bar(initial: str) -> str:
    text = (EXAMPLES / "four_bar.yaml").read_text(encoding="utf-8")
    kept = [line for line in text.splitlines() if not line.startswith("initial:")]
    return "\n".join([*kept, f"initial: {{{initial}}}"])


FINE = [
    arm("q: 0.3, q_dot: 1"),
    arm("tip_x: 0.3"),
    arm("x(rod.tip): 0.3"),
    arm("q: 0.3, tip_vx: 1"),
    arm("q: k"),
    arm(f"A_e0: {sqrt(0.5)!r}, A_e1: {sqrt(0.5)!r}", BALL),
    four_bar("theta: 1.0, theta_dot: 3"),
    four_bar("psi: 1.0, psi_dot: 3"),
]
WRONG = [  # the text, and the place and the words of the fault
    (arm("tip_x: 3"), "initial.tip_x", "cannot close with tip_x = 3"),  # the rod is 1 m long
    (arm("x(rod.tip): 3"), "initial.x(rod.tip)", "cannot close"),
    (arm("q: 0.3, tip_x: 0.1"), "initial.tip_x", "inconsistent"),
    (arm("q: 0, tip_vx: 1"), "initial.tip_vx", "inconsistent"),  # it moves across x there
    (arm("tip_ax: 1"), "initial.tip_ax", "depends on accelerations"),
    (arm("square: 1"), "initial.square", "not linearly"),
    (arm("q: k", value=""), "parameters.k", "has no value"),
    (arm("A_e0: 0.5, A_e1: 0.5", BALL), "", "length 0.707107, not 1"),
    (
        four_bar("theta: 1.0, theta_dot: 1, psi_dot: 100"),
        "initial.theta_dot",
        "velocities theta_dot = 1, psi_dot = 100",
    ),
    (four_bar("theta: 1.0, psi: 0.1"), "joints.C", "inconsistent"),
]


def run(text: str, folder: Path) -> None:
    path = folder / "model.yaml"
    path.write_text(text, encoding="utf-8")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        eg.load(path).compile(target="numpy").simulate((0, 1e-3))


def check(text: str, folder: Path) -> MechanismReport:
    path = folder / "model.yaml"
    path.write_text(text, encoding="utf-8")
    return eg.load(path).check()


@pytest.mark.parametrize("text", FINE)
def test_both_accept(text: str, tmp_path: Path) -> None:
    run(text, tmp_path)
    assert not any("not checked" in note for note in check(text, tmp_path).notes)


@pytest.mark.parametrize(("text", "place", "said"), WRONG)
def test_both_refuse(text: str, place: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(eg.EomgenError, match=r"."):
        run(text, tmp_path)
    with pytest.raises((eg.AssemblyError, eg.ModelError)) as told:
        check(text, tmp_path)
    assert place in str(told.value)
    assert said in str(told.value)


def test_a_start_beyond_a_limit_is_noted_as_a_run_warns(tmp_path: Path) -> None:
    path = tmp_path / "model.yaml"
    path.write_text(arm("q: 2"), encoding="utf-8")
    mod = eg.load(path).compile(target="numpy")
    with pytest.warns(UserWarning, match="passes limits of joints: q upper 1"):
        mod.simulate((0, 1e-3))
    (note,) = (note for note in check(arm("q: 2"), tmp_path).notes if "limit" in note)
    assert note.startswith("q starts at 2, beyond its upper limit 1")
    assert not [note for note in check(arm("q: 1"), tmp_path).notes if "limit" in note]
