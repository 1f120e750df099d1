"""``eomgen examples --all``: every example runs, and one that does not is told."""

from __future__ import annotations

from pathlib import Path

import pytest
from sweeps import part_of

from eomgen.cli import verb_examples
from eomgen.shipped import example_files

from .conftest import EXAMPLES, Call

#: A tree, a loop, a robot and a script.
SOME = ("double_pendulum", "slider_crank", "arm.urdf", "two_link_manipulator.py")

FALLS = """
name: falls
bodies: {stone: {mass: 1}}
joints: {z: {type: prismatic, between: [ground, stone]}}
forces: {pull: {type: actuator, joint: z, value: 1/(0.05 - t)**2}}
simulation: {end: 1}
"""


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> dict[str, Path]:
    """What the verb takes for the examples."""
    found = {"pendulum": EXAMPLES / "pendulum.yaml", "arm.urdf": EXAMPLES / "arm.urdf"}
    monkeypatch.setattr(verb_examples, "example_files", lambda: found)
    return found


def add(found: dict[str, Path], folder: Path, name: str, text: str) -> None:
    (folder / name).write_text(text, encoding="utf-8")
    found[name] = folder / name


@pytest.mark.slow
@pytest.mark.parametrize("some", part_of((True, False), lambda some: some), ids=["some", "all"])
def test_every_example_runs(call: Call, some: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of all of them the motion and its energy are judged in test_run."""
    chosen = {name: file for name, file in example_files().items() if not some or name in SOME}
    assert len(chosen) >= len(SOME)
    monkeypatch.setattr(verb_examples, "example_files", lambda: chosen)
    result = call("examples", "--all", "--json")
    assert result.code == 0
    told = result.json
    assert set(told) == {"ok", "target", "seconds", "examples"}
    assert told["ok"] is True
    assert [entry["name"] for entry in told["examples"]] == list(chosen)
    for entry in told["examples"]:
        assert set(entry) == {
            "name", "file", "ok", "exit_code", "error", "degrees_of_freedom", "steps", "end", "seconds",
            "warnings",
        }  # fmt: skip
        assert entry["ok"], entry
        script = entry["file"].endswith(".py")
        assert set(entry["seconds"]) == ({"script"} if script else {"derive", "compile", "simulate"})
        assert script or entry["steps"] > 0


def test_a_table_of_what_ran(call: Call, few: dict[str, Path]) -> None:
    result = call("examples", "--all")
    assert result.code == 0
    assert "freedoms" in result.out
    rows = {line.split()[0]: line.split() for line in result.out.splitlines() if line.strip()}
    assert rows["pendulum"][1] == "1"
    assert rows["pendulum"][-1] == "ok"
    assert "all ran" in result.out
    assert "ok; " in result.out  # the arm falls until a joint passes its limit
    assert "passes" in result.out


@pytest.mark.parametrize(
    ("name", "text", "code", "said"),
    [
        ("faulty.yaml", "name: faulty\nbodies: {a: {mass: -1}}\n", 1, "bodies.a.mass"),
        ("falls.yaml", FALLS, 4, "t = 0.05"),
        ("broken.py", "raise ValueError('no such mechanism')", 1, "ValueError: no such mechanism"),
    ],
)
def test_what_fails_is_told_and_the_others_run(
    call: Call, few: dict[str, Path], tmp_path: Path, name: str, text: str, code: int, said: str
) -> None:
    add(few, tmp_path, name, text)
    few["again"] = EXAMPLES / "pendulum.yaml"
    result = call("examples", "--all", "--json")
    assert result.code == code
    entries = {entry["name"]: entry for entry in result.json["examples"]}
    assert result.json["ok"] is False
    assert not entries[name]["ok"]
    assert entries[name]["exit_code"] == code
    assert said in entries[name]["error"]
    assert entries["again"]["ok"]
    table = call("examples", "--all")
    assert table.code == code
    assert f"1 of 4 failed: {name}" in table.out


def test_a_name_and_all_is_a_slip(call: Call) -> None:
    result = call("examples", "pendulum", "--all")
    assert result.code == 2
    assert "leave out pendulum" in result.err
