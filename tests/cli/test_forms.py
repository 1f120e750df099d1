"""Forms of the equations by name, their sizes, and stabilisation, on the command line."""

from __future__ import annotations

from pathlib import Path

from eomgen.cli.verb_derive import FORMATS
from eomgen.reading import formats

from .conftest import EXAMPLES, Call

FILE = EXAMPLES / "slider_crank.yaml"


def test_derive_tells_the_size_of_a_form(call: Call) -> None:
    said = call("derive", FILE, "--method", "amalgamated")
    assert said.code == 0
    assert "a linear system of 44 unknowns with 125 nonzero entries" in said.out
    told = call("derive", FILE, "--method", "newton_euler", "--json").json
    assert told["system"] == {"unknowns": 41, "entries": 118}
    assert told["operations"]["linear system"]["total"] > 0
    assert call("derive", FILE, "--method", "hamilton", "--json").json["system"] is None


def test_run_holds_constraints_by_stabilisation(call: Call) -> None:
    words = (
        "run",
        FILE,
        "--method",
        "augmented",
        "--baumgarte",
        "20,20",
        "--target",
        "numpy",
        "--end",
        "0.05",
        "--json",
    )
    assert call(*words).json["method"] == "augmented"


def test_what_does_not_fit_is_refused(call: Call) -> None:
    for words, fault in (
        (["--method", "kane"], "there are: auto, embedding"),
        (["--baumgarte", "3"], "not two numbers ALPHA,BETA"),
        (["--baumgarte", "3,4"], "works with method 'augmented' only"),
    ):
        refused = call("derive", FILE, *words)
        assert refused.code == 2
        assert fault in refused.err


def test_derive_writes_the_equations_for_other_programs(call: Call, tmp_path: Path) -> None:
    assert FORMATS == formats.FORMATS
    for form in FORMATS:
        said = call("derive", EXAMPLES / "double_pendulum.yaml", "--format", form)
        assert said.code == 0
        assert "bend" in said.out
    file = tmp_path / "equations.m"
    said = call("derive", FILE, "--format", "matlab", "--out", file)
    assert (said.code, said.out) == (0, f"{file}\n")
    assert file.read_text(encoding="utf-8").count("function [M, f]") == 1


def test_formats_that_do_not_fit_are_refused(call: Call, tmp_path: Path) -> None:
    for words, fault in (
        (["--format", "fortran"], "is not one of 'latex', 'text', 'sympy'"),
        (["--out", tmp_path / "x.m"], "--out needs --format"),
        (["--format", "c", "--json"], "--json and --format exclude each other"),
        (["--format", "c", "--out", tmp_path / "none" / "x.c"], "none"),
    ):
        refused = call("derive", FILE, *words)
        assert refused.code == 2
        assert fault in refused.err


def test_explain_writes_the_worked_solution(call: Call, tmp_path: Path) -> None:
    for ending, begins in ((".html", "<!doctype html>"), (".md", "# "), (".tex", r"\documentclass")):
        file = tmp_path / f"solution{ending}"
        said = call("explain", EXAMPLES / "pendulum.yaml", "--out", file, "--level", "short")
        assert said.code == 0
        assert file.read_text(encoding="utf-8").lower().startswith(begins)
    refused = call("explain", FILE, "--out", tmp_path / "solution.docx")
    assert refused.code == 2
    assert ".html" in refused.err
