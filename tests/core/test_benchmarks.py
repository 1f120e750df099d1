"""The benchmarks run, and operations are no more than the documentation states."""

import re
from pathlib import Path

import pytest

from benchmarks.derivation import largest_difference
from benchmarks.harness import BENCHMARKS, Limit, Report, number, write
from benchmarks.run import main


@pytest.mark.slow
@pytest.mark.thorough
@pytest.mark.parametrize(
    "options", [["counts"], ["growth", "derive", "robot_loops", "--quick"]], ids=["counts", "quick"]
)
def test_benchmarks_keep_their_limits(options: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = tmp_path / "results.md"
    assert main([*options, "--out", str(page)]) == 0
    assert "MISSED" not in capsys.readouterr().out
    for name in options:
        if name != "--quick":
            _, _, part = page.read_text().partition(f"\n## {name}: ")
            met, every = re.search(r"^- (\d+) of (\d+) limits met\.$", part, re.MULTILINE).groups()
            assert met == every != "0"


def test_unknown_benchmark_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["deriv"])
    assert "call, traced, loops" in capsys.readouterr().err


def test_both_contestants_derive_the_same_motion() -> None:
    assert largest_difference(3) < 1e-12


def test_limits_are_judged_from_their_side() -> None:
    assert Limit("growth", 2.0, 2.1).met
    assert not Limit("growth", 2.2, 2.1).met
    assert Limit("ratio", 150, 100, at_least=True).met
    assert not Limit("ratio", 50, 100, at_least=True).met
    assert [number(x) for x in (0.012345, 12345.6, 2000, "a", None)] == ["0.0123", "12,346", "2,000", "a", ""]


def test_a_part_of_the_page_of_results_takes_the_place_of_the_last_one(tmp_path: Path) -> None:
    page, names = tmp_path / "results.md", list(BENCHMARKS)[:2]
    for name, value in ((names[0], 1.0), (names[1], 2.0), (names[0], 3.0)):
        report = Report()
        report.table("speed", ("who", "s"), [["ours", value]])
        report.most("seconds", value, 2.5)
        write(page, name, report, "a machine")
    text = page.read_text()
    assert [line.split(":")[0] for line in text.splitlines() if line.startswith("## ")] == [f"## {n}" for n in names]
    assert "| ours | 1 |" not in text
    assert "| ours | 3 |" in text
    assert "- 0 of 1 limits met.\n- **MISSED: seconds 3 (at most 2.5)**" in text
    assert text.count("a machine*") == 2
