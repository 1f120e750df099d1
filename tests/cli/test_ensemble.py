"""``eomgen ensemble``: cases from a table or drawn, what is told, what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from .conftest import EXAMPLES, Call

PENDULUM, CRANK = EXAMPLES / "double_pendulum.yaml", EXAMPLES / "slider_crank.yaml"


def test_a_table_of_cases(call: Call, tmp_path: Path) -> None:
    cases, ends = tmp_path / "cases.csv", tmp_path / "ends.csv"
    cases.write_text("r [m], theta\n0.1,0.3\n0.5,1.2\n0.12,0.3\n")
    result = call("ensemble", CRANK, "--cases", cases, "--end", "0.5", "--rtol", "1e-12", "--out", ends, "--json")
    assert result.code == 0, result.err
    found = result.json
    assert set(found) == {"name", "method", "origin", "t", "count", "varied", "steps", "failures", "files", "summary"}
    assert (found["count"], found["varied"], found["t"]) == (3, ["r", "theta"], 0.5)
    assert [failure["run"] for failure in found["failures"]] == [1]
    assert "cannot close" in found["failures"][0]["message"]
    import pandas

    table = pandas.read_csv(ends)
    alone = call(
        "run", CRANK, "--set", "r=0.12", "--set", "theta=0.3", "--end", "0.5", "--rtol", "1e-12", "--json"
    ).json
    assert table["theta"][2] == pytest.approx(alone["final"]["theta"], abs=1e-12)
    assert found["summary"]["theta"]["greatest"] == pytest.approx(table["theta"].max())


def test_values_drawn_at_random(call: Call, tmp_path: Path) -> None:
    words = ("ensemble", PENDULUM, "--vary", "theta1=-1:1", "--vary", "m2=0.5:2", "--count", "40", "--end", "1")
    picture, runs = tmp_path / "x.png", tmp_path / "runs.npz"
    text = call(*words, "--samples", "5", "--plot", "x", picture, "--out", runs)
    assert text.code == 0, text.err
    assert "40 runs to t = 1 s; varied: m2, theta1" in text.out
    assert picture.stat().st_size > 1000
    with np.load(runs) as data:
        starts = data["samples"][0, 0]
        assert data["samples"].shape == (4, 5, 40)
    assert -1 <= starts.min() < -0.5
    assert 0.5 < starts.max() <= 1
    again = call(*words, "--statistics", "--json").json["summary"]
    other = call(*words, "--statistics", "--json", "--seed", "1").json["summary"]
    assert again["x"]["mean"] == pytest.approx(float(text.out.split("\n x ")[1].split()[0]), rel=1e-5)
    assert other["x"]["mean"] != again["x"]["mean"]


def test_a_table_keeps_samples_and_varied_starts(call: Call, tmp_path: Path) -> None:
    out = tmp_path / "runs.csv"
    words = ("--grid", "theta1=-pi/2:pi/2:3", "--end", "0.2", "--samples", "4", "--out", out)
    assert call("ensemble", PENDULUM, *words).code == 0
    import pandas

    table = pandas.read_csv(out)
    assert len(table) == 3 * 4
    first = table[table["t"] == 0.0]
    np.testing.assert_allclose(first["theta1"], [-np.pi / 2, 0.0, np.pi / 2], atol=1e-15)
    np.testing.assert_array_equal(first["initial_theta1"], first["theta1"])


def test_values_are_drawn_between_expressions(call: Call) -> None:
    found = call("ensemble", PENDULUM, "--vary", "theta1=-pi/8:deg(5)", "--count", "30", "--end", "1e-9", "--json").json
    at_start = found["summary"]["theta1"]
    assert -np.pi / 8 <= at_start["least"] < -0.2
    assert -0.05 < at_start["greatest"] <= np.pi / 36


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((), "nothing differs between the runs"),
        (("--vary", "r=1"), "--vary r=1: write NAME=LOW:HIGH"),
        (("--vary", "radius=1:2"), "no coordinate or rate 'radius'"),
        (("--vary", "r=0.1:0.2", "--out", "a.txt"), "written as .npz, .csv or .nc"),
    ],
)
def test_wrong_words(call: Call, words: tuple[str, ...], message: str) -> None:
    result = call("ensemble", CRANK, *words)
    assert result.code == 2
    assert message in result.err


def test_wrong_tables(call: Call, tmp_path: Path) -> None:
    for text, message in (
        ("r\n", "a line of names and a line for each run"),
        ("r,theta\n0.1\n", "cases.csv:2: 1 values for 2 names"),
        ("r\n0.1\nx\n", "cases.csv:3: r must be a number, not 'x'"),
        ("theta [deg]\n10\n", "theta is given in deg; give values in rad"),
    ):
        (tmp_path / "cases.csv").write_text(text)
        result = call("ensemble", CRANK, "--cases", tmp_path / "cases.csv")
        assert result.code == 2
        assert message in result.err


def test_a_grid(call: Call) -> None:
    words = ("ensemble", PENDULUM, "--end", "0.1", "--grid", "theta1=-1:1:3", "--grid", "m2=0.5:2:5")
    result = call(*words, "--json")
    assert result.code == 0, result.err
    assert (result.json["count"], result.json["varied"]) == (15, ["m2", "theta1"])
    refused = call(*words, "--vary", "m1=1:2")
    assert refused.code == 2
    assert "leave out --cases, --vary and --count" in refused.err
    assert "write NAME=LOW:HIGH:COUNT" in call("ensemble", PENDULUM, "--grid", "theta1=1").err
