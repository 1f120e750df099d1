"""The list of deliberate faults: each still fits the sources, has a test that exists, and three are really tried."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest
from mutations.copies import Copy
from mutations.fault import ROOT
from mutations.faults import FAULTS
from mutations.run import FAILED, RESULTS

TRIED = ("quotient-rule", "partition-sign", "gear-inverted")


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.id)
def test_every_fault_fits_the_sources_once(fault) -> None:
    assert (ROOT / fault.file).read_text(encoding="utf-8").count(fault.old) == 1
    assert fault.new != fault.old
    assert fault.breaks


def test_names_are_unique_and_areas_are_covered() -> None:
    ids = [fault.id for fault in FAULTS]
    assert len(ids) == len(set(ids)) >= 60
    areas = {fault.file.split("/")[1] for fault in FAULTS if fault.file.startswith("eomgen/")}
    assert areas >= {
        "equations", "kinematics", "joints", "constraints", "forces", "graph", "rotations", "numeric", "emit",
        "program", "runtime", "analysis", "simulation", "limits",
    }  # fmt: skip
    folders = {Path(fault.file).parent.name for fault in FAULTS if fault.file.startswith("templates/")}
    assert folders >= {"drivers", "steppers", "ensembles"}


@pytest.mark.parametrize("test", sorted({test for fault in FAULTS for test in fault.caught_by}))
def test_tests_that_are_to_notice_exist(test: str) -> None:
    file, _, name = test.partition("::")
    tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
    functions = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
    assert not name or name.partition("[")[0] in functions


def test_three_faults_are_noticed(tmp_path: Path) -> None:
    copy = Copy(tmp_path, tmp_path / "layers")
    for fault in FAULTS:
        if fault.id in TRIED:
            before = (copy.root / fault.file).read_text(encoding="utf-8")
            outcome = copy.run_with(fault, fault.caught_by)
            assert outcome.code == FAILED, outcome.text
            assert (copy.root / fault.file).read_text(encoding="utf-8") == before
    with pytest.raises(ValueError, match="occurs 0 times"):
        FAULTS[0]._replace(old="no such text").apply(copy.root)


def test_the_results_are_those_of_the_list() -> None:
    rows = [line.split(" | ") for line in RESULTS.read_text(encoding="utf-8").splitlines() if line.startswith("| ")][1:]
    assert [row[0].removeprefix("| ") for row in rows] == [fault.id for fault in FAULTS]
    assert not any("nobody" in row[3] for row in rows)
