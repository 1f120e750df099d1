"""Golden recordings: every model of the registry computes what the version before the rebuilding computed."""

import json
import re
from datetime import date
from pathlib import Path
from typing import Any

import golden
import models
import numpy as np
import pytest

import eomgen as eg
from benchmarks.derivation import largest_difference
from benchmarks.harness import BENCHMARKS, Limit, Report, number, write
from benchmarks.run import main

#: Models whose compiled code is compared too, of each kind that the code generator tells apart; half are built anyway.
COMPILED = (
    "slider_crank", "peaucellier", "rolling_disc", "wheelset", "rimless_wheel", "hydraulic_boom", "heap", "skate",
    "every_joint",
)  # fmt: skip
CASES = [(name, "numpy") for name in models.MODELS] + [(name, "cython") for name in COMPILED]


def beyond(old: dict[str, object], new: dict[str, object]) -> dict[str, float]:
    return {key: gap for key, gap in golden.differences(old, new).items() if not gap <= 1.0}


@pytest.mark.parametrize(("name", "target"), CASES, ids=[f"{name}-{target}" for name, target in CASES])
def test_as_recorded(name: str, target: str) -> None:
    old = golden.read(name)
    new = golden.recording(name, target, old["states"])
    assert not beyond(old, new)
    assert new["freedoms"] == models.MODELS[name].freedoms  # counted by hand


def test_faulty_files_name_the_same_places() -> None:
    assert golden.faults() == golden.read("faults")


def test_the_schema_of_model_files() -> None:
    """As recorded, but for the place ``on`` whose axes another place may be given in."""
    assert without_on(golden.schema()) == golden.read("schema")


def without_on(value: Any) -> Any:
    if isinstance(value, dict):
        kept = {key: x for key, x in value.items() if key != "on" or x.get("$ref") != "#/$defs/placement"}
        return {key: without_on(x) for key, x in kept.items()}
    return [without_on(x) for x in value] if isinstance(value, list) else value


def test_a_difference_is_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    old = golden.read("slider_crank")
    for folder in ("old", "new"):
        (tmp_path / folder).mkdir()
        for name in ("slider_crank", "faults", "schema"):
            (tmp_path / folder / f"{name}.json").write_text(json.dumps(golden.read(name)))
    assert golden.compare(tmp_path / "old", tmp_path / "new") == 0
    old["bias"][1][2] *= 1 + 1e-8
    (tmp_path / "new" / "slider_crank.json").write_text(json.dumps(old))
    assert golden.compare(tmp_path / "old", tmp_path / "new") == 1
    assert "slider_crank.bias" in capsys.readouterr().out
    del old["rhs"]
    assert beyond(golden.read("slider_crank"), old)["rhs"] == np.inf


def test_every_example_is_recorded() -> None:
    shipped = {path.stem for path in Path(models.EXAMPLES).glob("*.yaml")}
    assert shipped <= models.MODELS.keys()
    assert {path.stem for path in golden.RECORDINGS.glob("*.json")} == models.MODELS.keys() | {"faults", "schema"}
    assert isinstance(models.build("cart_table"), eg.Model)


# -- the benchmarks run, and operations are no more than the documentation states --------------------------------------
@pytest.mark.slow
@pytest.mark.thorough
@pytest.mark.parametrize(
    "options", [["counts"], ["growth", "derive", "robot_loops", "--quick"]], ids=["counts", "quick"]
)
def test_benchmarks_keep_their_limits(options: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = tmp_path / "results.md"
    assert main([*options, "--out", str(page)]) == 0
    out = capsys.readouterr().out
    assert "MISSED" not in out
    parts = re.split(r"─ (\w+): ", out)
    assert all("  met: " in part for part in parts[2::2])
    assert {*parts[1::2]} == {*options} - {"--quick"}
    assert all(f"| {name} | " in page.read_text() for name in parts[1::2])


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
        report.result("run, s", value, {"SymPy": 4 * value, "absent": None})
        report.most("seconds", value, 2.5)
        write(page, name, report, "a machine, Python 3")
    _, rows, machines = page.read_text().split("\n\n")
    measured = f"{date.today()} A |"
    assert rows.splitlines()[2:] == [
        f"| {names[0]} | run, s | 3 | SymPy 12 (4) | {measured}",
        f"| {names[0]} | 0 of 1 limits met | | missed: seconds 3 (at most 2.5) | {measured}",
        f"| {names[1]} | run, s | 2 | SymPy 8 (4) | {measured}",
    ]
    assert machines == "- A: a machine, Python 3\n"
    write(page, names[0], report, "another machine, Python 3")
    assert page.read_text().count(f"| run, s | 3 | SymPy 12 (4) | {date.today()} ") == 2
