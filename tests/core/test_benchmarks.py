"""The benchmarks run, and operations are no more than the documentation states."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from benchmarks.derive import largest_difference
from benchmarks.report import Limit, number
from benchmarks.run import main


@pytest.mark.slow
@pytest.mark.thorough
@pytest.mark.parametrize(
    "options", [["counts"], ["growth", "derive", "robot_loops", "--quick"]], ids=["counts", "quick"]
)
def test_benchmarks_keep_their_limits(options: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*options, "--out", str(tmp_path)]) == 0
    assert "MISSED" not in capsys.readouterr().out
    for name in options:
        if name != "--quick":
            found = json.loads((tmp_path / f"{name}.json").read_text())
            assert found["limits"]
            assert all(limit["met"] for limit in found["limits"])
            assert (tmp_path / f"{name}.md").read_text().startswith(f"# {name}\n")


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
    assert [number(x) for x in (0.012345, 12345.6, 2000, "a", None)] == ["0.0123", "12,346", "2,000", "a", ""]
