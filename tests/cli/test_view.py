"""``eomgen view``: a range of coordinates or a run, as a file or a page that a browser opens."""

from __future__ import annotations

import json
import webbrowser
from pathlib import Path

import pytest
from PIL import Image

from eomgen.cli.command import run_command

EXAMPLES = Path(__file__).parents[2] / "examples"
FOUR_BAR = str(EXAMPLES / "four_bar.yaml")


def code_of(words: list[str]) -> int:
    """The exit code of a command line."""
    try:
        return run_command(words)
    except SystemExit as end:
        return int(end.code or 0)


def test_a_range_is_shown_without_forces(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "turn.gif"
    words = ["view", FOUR_BAR, "--target", "numpy", "--range", "theta=0:2*pi:13", "--out", str(file), "--plot", "psi"]
    assert code_of([*words, "--trace", "coupler", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {
        "name": "four_bar",
        "points": 13,
        "files": [str(file)],
        "opened": False,
    }
    with Image.open(file) as image:
        assert image.n_frames == 13


def test_a_run_opens_in_a_browser(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("k3d")
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", lambda url: opened.append(url) or True)
    words = ["view", FOUR_BAR, "--target", "numpy", "--end", "0.5", "--fps", "8", "--set", "theta=0.5"]
    assert code_of(words) == 0
    page = Path(opened[0].removeprefix("file://"))
    assert "<title>four_bar</title>" in page.read_text()
    assert f"wrote {page}" in capsys.readouterr().out
    page.unlink()


def test_frames_go_into_a_new_folder(tmp_path: Path) -> None:
    folder = tmp_path / "frames"
    words = ["view", FOUR_BAR, "--target", "numpy", "--range", "theta=0:1:4", "--out", str(folder)]
    assert code_of(words) == 0
    assert [file.name for file in sorted(folder.iterdir())] == [f"frame_{k}.png" for k in range(4)]
    assert code_of(words) == 2  # it is not empty any more


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--range", "theta=0:1", "--end", "2"], "leave out --end and options of the integrator"),
        (["--range", "theta"], "write NAME=START:END"),
        (["--out", "x.avi"], "must end in .gif, .mp4 or .html"),
        (["--range", "thet=0:1:3", "--out", "x.gif"], "did you mean theta"),
        (["--trace", "coupler.Q", "--out", "x.gif", "--end", "0.1"], "no marker or body 'coupler.Q'"),
    ],
)
def test_slips_are_told(
    words: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert code_of(["view", FOUR_BAR, "--target", "numpy", *words]) in (2, 4)
    assert said in " ".join(capsys.readouterr().err.split())
    assert list(tmp_path.iterdir()) == []


def test_plots_take_columns(tmp_path: Path) -> None:
    words = ["run", str(EXAMPLES / "pendulum.yaml"), "--target", "numpy", "--end", "0.5"]
    wishes = ["--columns theta,theta_dot", "--plot-as phase", "--columns theta_dot --against theta", ""]
    for more in wishes:
        file = tmp_path / "p.png"
        assert code_of([*words, "--plot", str(file), *more.split()]) == 0
        file.unlink()
    assert code_of([*words, "--columns", "theta"]) == 2
    assert code_of([*words, "--plot", str(tmp_path / "p.png"), "--columns", "thet"]) == 2


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["view", FOUR_BAR, "--range", "theta=0:zz"], "--range theta=0:zz: 'zz' is not a number"),
        (["view", FOUR_BAR, "--range", "theta=0:30deg"], "a number with a unit is not an expression; write deg(30)"),
        (["view", FOUR_BAR, "--range", "theta=0:1:1"], "an animation needs two positions"),
        (["run", FOUR_BAR, "--set", "theta=5cm"], "--set theta=5cm: a number with a unit is not an expression; write"),
        (["ensemble", FOUR_BAR, "--grid", "theta=0:x:2"], "--grid theta=0:x:2: 'x' is not a number"),
        (["ensemble", FOUR_BAR, "--vary", "theta=0:x"], "--vary theta=0:x: write NAME=LOW:HIGH with two numbers"),
        (["animate", FOUR_BAR], "no verb 'animate'; did you mean view?"),
    ],
)
def test_what_is_wrong_is_said_in_the_words_of_the_option(
    words: list[str], told: str, capfd: pytest.CaptureFixture[str]
) -> None:
    assert code_of([*words, "--target", "numpy"]) == 2
    assert told in " ".join(capfd.readouterr().err.split())


@pytest.mark.filterwarnings("default")
def test_a_warning_is_told_without_a_place_in_python(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "hinge.yaml"
    file.write_text(
        "name: hinge\ngravity: [0, -9.81, 0]\nbodies: {rod: {mass: 1, com: [0.5, 0, 0], inertia: {zz: 0.1}}}\n"
        "joints: {a: {type: revolute, between: [ground, rod], limits: {lower: -1, upper: 1}}}\n"
    )
    assert code_of(["run", str(file), "--target", "numpy", "--end", "1"]) == 0
    lines = [line for line in capfd.readouterr().err.splitlines() if "limits" in line]
    assert len(lines) == 1
    assert lines[0].startswith("warning: the run passes limits of joints: a lower -1")


def test_columns_of_an_instance_are_drawn_by_its_dotted_names(tmp_path: Path) -> None:
    file = tmp_path / "legs.yaml"
    file.write_text(
        "name: legs\ngravity: [0, -9.81, 0]\ncomponents:\n  leg:\n"
        "    bodies: {rod: {mass: 1, com: [0.5, 0, 0], inertia: {zz: 0.1}}}\n"
        "    joints: {hip: {type: revolute, between: [ground, rod]}}\nadd: {leg: {component: leg, for: {k: 2}}}\n"
    )
    run = ["run", str(file), "--target", "numpy", "--end", "0.2"]
    assert code_of([*run, "--plot", str(tmp_path / "a.png"), "--columns", "leg1.hip,leg2.hip_dot"]) == 0
    view = ["view", str(file), "--target", "numpy", "--end", "0.2", "--fps", "5"]
    assert code_of([*view, "--plot", "leg2.hip", "--out", str(tmp_path / "a.gif")]) == 0
