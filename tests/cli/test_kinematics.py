"""``eomgen kinematics``: ranges of time and coordinates, limits, what it reports, writes and draws."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import eomgen

from .conftest import EXAMPLES, Call

FAST = ("--target", "numpy")


def test_a_driven_model_runs_over_its_own_span(call: Call, tmp_path: Path) -> None:
    result = call("kinematics", EXAMPLES / "driven_slider_crank.yaml", *FAST, "--out", "run.csv", "--plot", "run.png")
    assert (result.code, "kinematics over t: 201 points" in result.out) == (0, True)
    assert "loop residual" in result.out
    table = np.genfromtxt(tmp_path / "run.csv", delimiter=",", names=True)
    theta = table["theta"]
    assert np.abs(table["s"] - 0.1 * np.cos(theta) - np.sqrt(0.09 - 0.01 * np.sin(theta) ** 2)).max() < 1e-14
    assert (tmp_path / "run.png").stat().st_size > 10_000


def test_json_of_a_led_range_with_limits(call: Call, tmp_path: Path) -> None:
    words = ("--range", "psi=1.2:2.5:27", "--partial", "--limits", "psi", "--limits", "theta", "--out", "m.npz")
    found = call("kinematics", EXAMPLES / "four_bar.yaml", *FAST, *words, "--json").json
    assert set(found) == {"name", "report", "seconds", "files", "motion", "limits"}
    motion = found["motion"]
    assert set(motion) == {"points", "complete", "led", "singular", "residual", "first", "last"}
    assert (motion["points"], motion["complete"], motion["led"]) == (21, False, ["psi"])
    (stop,) = motion["singular"]
    assert set(stop) == {"kind", "t", "values", "moving", "joints"}
    assert stop["values"]["psi"] == pytest.approx(2.2459278597319283, abs=1e-12)
    psi, theta = found["limits"]
    assert set(psi) == {"name", "lower", "upper", "stops", "gaps"}
    assert (psi["upper"], theta["upper"]) == (pytest.approx(2.2459278597319283, abs=1e-12), None)
    assert len(eomgen.load_trajectory(tmp_path / "m.npz")) == 21


def test_settings_and_text(call: Call) -> None:
    result = call("kinematics", EXAMPLES / "four_bar.yaml", *FAST, "--set", "a1=0.03", "--limits", "psi")
    assert result.code == 0
    upper = np.pi - np.arccos((0.08**2 + 0.1**2 - 0.09**2) / (2 * 0.08 * 0.1))
    assert f"upper  {upper:.9g}   stop at psi" in result.out
    assert "C.r_" in result.out


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        ((), 2, "give --range: 1 degree of freedom is left, for example of theta"),
        (("--range", "theta"), 2, "write NAME=START:END"),
        (("--range", "theta=0:x"), 2, "'x' is not a number"),
        (("--range", "theta=0:1:0"), 2, "the count is 1 to"),
        (("--range", "theta=0:1:3", "--range", "t=0:1:4"), 2, "must be equal"),
        (("--range", "theta=0:1", "--range", "theta=0:2"), 2, "each name once"),
        (("--range", "thet=0:1"), 2, "no coordinate or rate 'thet'"),
        (("--range", "psi=1.2:2.5"), 1, "stop at psi = 2.24592786: psi can go no further; theta, bend can still move"),
        (("--range", "theta=0:1", "--out", "x.txt"), 2, "written as .npz or .csv"),
    ],
)
def test_what_it_refuses(call: Call, words: tuple[str, ...], code: int, said: str) -> None:
    result = call("kinematics", EXAMPLES / "four_bar.yaml", *FAST, *words)
    assert result.code == code
    assert said in result.err


def test_coordinates_led_over_time(call: Call, model_file: Callable[[str], Path]) -> None:
    """One coordinate driven, one led: both move at once, with their rates."""
    path = model_file(
        "name: table\nbodies: {a: {mass: 0}, b: {mass: 1}}\n"
        "joints:\n  X: {type: prismatic, between: [ground, a], axis: x}\n"
        "  Y: {type: prismatic, between: [a, b], axis: y}\n"
        "constraints: {d: {type: driver, coordinate: X, value: t**2}}\n"
    )
    found = call("kinematics", path, *FAST, "--range", "t=0:2:5", "--range", "Y=0:1", "--json").json["motion"]
    assert (found["last"]["X"], found["last"]["X_dot"]) == pytest.approx((4, 4))
    assert (found["last"]["Y"], found["last"]["Y_dot"]) == pytest.approx((1, 0.5))


ARM = """
name: arm
bodies:
  upper: {mass: 1, inertia: {zz: 0.1}, markers: {elbow: [0.5, 0, 0]}}
  lower: {mass: 1, inertia: {zz: 0.1}, markers: {tip: [0.3, 0, 0]}}
joints:
  A: {type: revolute, between: [ground, upper], coordinate: q1}
  B: {type: revolute, between: [upper.elbow, lower], coordinate: q2, limits: {lower: 0.5, upper: 2.5}}
outputs: {x: x(lower.tip), y: y(lower.tip)}
initial: {q2: 1}
"""


def test_a_workspace(call: Call, model_file: Callable[[str], Path], tmp_path: Path) -> None:
    words = ("--over", "q1=0:2*pi:37", "--over", "q2=0:pi:25", "--of", "x", "--of", "y")
    path = model_file(ARM)
    files = ("--out", "ws.csv", "--plot", "ws.png")
    found = call("kinematics", path, *FAST, *words, *files, "--json").json["workspace"]
    assert set(found) == {"shape", "over", "of", "status", "range", "extent", "singular"}
    assert (found["shape"], found["status"]) == ([37, 25], {"reached": 925})
    assert found["extent"] == pytest.approx(np.pi * (0.8**2 - 0.2**2), rel=0.01)
    assert found["range"]["x"] == pytest.approx([-0.8, 0.8])
    assert len(found["singular"]) == 74
    table = np.genfromtxt(tmp_path / "ws.csv", delimiter=",", names=True, usecols=range(4))
    assert table["x"] == pytest.approx(0.5 * np.cos(table["q1"]) + 0.3 * np.cos(table["q1"] + table["q2"]))
    assert (tmp_path / "ws.png").stat().st_size > 10_000
    result = call("kinematics", path, *FAST, *words, "--within-limits")
    assert result.code == 0
    assert "workspace of arm: x, y over q1 (37), q2 (25)" in result.out
    assert "592 reached, 333 limits" in result.out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--over", "q1=0:1:3"), "--over needs --of"),
        (("--of", "x"), "need --over"),
        (("--over", "q1=0:1", "--of", "x"), "write NAME=LOW:HIGH:COUNT"),
        (("--over", "q1=0:1:x", "--of", "x"), "--over q1=0:1:x: "),
        (("--over", "q1=0:1:3", "--over", "q1=0:1:3", "--of", "x"), "each name once"),
        (("--over", "q1=0:1:3", "--of", "x", "--range", "q1=0:1"), "cannot be used together"),
        (("--over", "q1=0:1:3", "--of", "z"), "no output or coordinate 'z'"),
    ],
)
def test_what_a_workspace_refuses(
    call: Call, model_file: Callable[[str], Path], words: tuple[str, ...], said: str
) -> None:
    result = call("kinematics", model_file(ARM), *FAST, *words)
    assert result.code == 2
    assert said in result.err
