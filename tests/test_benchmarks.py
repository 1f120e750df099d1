"""The benchmarks run, in their quick mode, and write what they found."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from benchmarks.call import compile_call_loop
from benchmarks.derive import largest_difference
from benchmarks.report import Limit, number
from benchmarks.rhs import contest
from benchmarks.robot_calls import ROBOTS
from benchmarks.robot_loops import contest as loops_contest
from benchmarks.run import main


@pytest.mark.slow
def test_quick_benchmarks_write_their_results(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["growth", "derive", "--quick", "--out", str(tmp_path)]) == 0
    assert "MISSED" not in capsys.readouterr().out
    for name in ("growth", "derive"):
        found = json.loads((tmp_path / f"{name}.json").read_text())
        assert found["limits"]
        assert all(limit["met"] for limit in found["limits"])
        assert found["calibration"]["python_loop_ns"] > 0
        assert (tmp_path / f"{name}.md").read_text().startswith(f"# {name}\n")
    derived = json.loads((tmp_path / "derive.json").read_text())["measured"]["3"]
    assert derived["eomgen embedding"]["median"] < derived["SymPy, relative angles"]["median"]


@pytest.mark.slow
def test_robots_in_c_move_as_pinocchio_and_mujoco_say(tmp_path: Path) -> None:
    found = contest(ROBOTS[1], tmp_path, quick=True)
    assert {"eomgen, default", "eomgen, symbols, default", "MuJoCo"} <= set(found["differences"])
    assert max(found["differences"].values()) < 1e-9
    assert set(found["ns"]) >= set(found["differences"])


@pytest.mark.slow
def test_robots_with_loops_move_as_pinocchio_says(tmp_path: Path) -> None:
    found = loops_contest("hand of three parallel fingers", tmp_path, 2, 1e-4, compile_call_loop(tmp_path))
    assert found["difference"] < 1e-10
    assert found["residual"]["eomgen"] < 1e-12
    assert (found["velocities"], found["rows"], found["freedoms"]) == (9, 6, 3)


def test_unknown_benchmark_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["deriv"])
    assert "there are: derive, growth" in capsys.readouterr().err


def test_both_contestants_derive_the_same_motion() -> None:
    assert largest_difference(3) < 1e-12


def test_limits_are_judged_from_their_side() -> None:
    assert Limit("growth", 2.0, 2.1).met
    assert not Limit("growth", 2.2, 2.1).met
    assert Limit("ratio", 150, 100, at_least=True).met
    assert not Limit("ratio", 50, 100, at_least=True).met


def test_numbers_are_readable() -> None:
    assert [number(x) for x in (0.012345, 12345.6, 2000, "a", None)] == ["0.0123", "12,346", "2,000", "a", ""]
