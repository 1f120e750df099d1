"""Forms of the equations by name, their sizes, and stabilisation, on the command line."""

from __future__ import annotations

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
