"""Forms of the equations by name, their sizes, and stabilisation, on the command line."""

from __future__ import annotations

from pathlib import Path

from eomgen.reading import formats
from eomgen.targets import FORMATS

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
        (["--method", "kane"], "there are auto, embedding"),
        (["--baumgarte", "3"], "not two numbers ALPHA,BETA"),
        (["--baumgarte", "3,4"], "works with method 'augmented' only"),
    ):
        refused = call("derive", FILE, *words)
        assert refused.code == 2
        assert fault in refused.err


def test_derive_writes_the_equations_for_other_programs(call: Call, tmp_path: Path) -> None:
    assert tuple(FORMATS) == ("latex", "text", *formats.LANGUAGES)
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


def test_both_name_the_file_that_they_wrote_first(call: Call, tmp_path: Path) -> None:
    for words, name in ((["derive", FILE, "--format", "c"], "x.c"), (["explain", FILE, "--level", "short"], "x.md")):
        said = call(*words, "--out", tmp_path / name)
        assert said.code == 0
        assert said.out.splitlines()[0] == str(tmp_path / name)


def test_neither_makes_folders(call: Call, tmp_path: Path) -> None:
    """The refusal comes before the work, so that nothing is derived for it."""
    link = tmp_path / "link.md"
    link.symlink_to(tmp_path / "other.md")
    for verb in (["derive", FILE, "--format", "text"], ["explain", FILE, "--level", "short"]):
        for out, fault in (
            (tmp_path / "none" / "x.md", f"there is no folder {tmp_path / 'none'}"),
            (Path("/no_such_folder/x.md"), "there is no folder /no_such_folder"),
            (tmp_path, "this is a folder; name a file in it"),
            (link, "is a symbolic link"),
        ):
            refused = call(*verb, "--out", out)
            assert refused.code == 2
            assert fault in refused.err
            assert "derive  " not in refused.err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["link.md"]


def test_explain_takes_the_stabilisation_of_derive(call: Call, tmp_path: Path) -> None:
    file = tmp_path / "solution.md"
    told = call("explain", FILE, "--method", "augmented", "--baumgarte", "20,10", "--out", file, "--json").json
    assert told["difference"] < 1e-10
    text = file.read_text(encoding="utf-8")
    assert r"$\ddot{\mathbf{C}} + 2 \cdot 20 \dot{\mathbf{C}} + 10^2 \mathbf{C} = \mathbf{C}_q" in text
    refused = call("explain", FILE, "--method", "embedding", "--baumgarte", "20,10", "--out", file)
    assert (refused.code, "works with method 'augmented' only" in refused.err) == (2, True)
