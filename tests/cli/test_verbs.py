"""The command line: results on stdout, pinned keys of --json, files written."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from importlib import metadata
from pathlib import Path

import pytest

from eomgen.cli.command import VERBS
from eomgen.cli.sections import SHARED
from eomgen.cli.verb_examples import describe_example
from eomgen.shipped import example_files

from .conftest import EXAMPLES, Call

REPORT_KEYS = {
    "name", "bodies", "joints", "tree", "loop_joints", "coordinates", "loop_coordinates", "independent", "dependent",
    "constraints", "constraints_declared", "rank", "ranks", "degrees_of_freedom", "configuration_freedoms",
    "nonholonomic", "gruebler_kutzbach",
    "gruebler_kutzbach_planar", "redundant", "conditioning", "length_scale", "reference", "assumed",
    "assembly_restarts", "instantaneous_freedoms", "candidates", "notes", "elements", "guessed", "guess_distance",
    "other_branches",
}  # fmt: skip
MODELS = sorted(EXAMPLES.glob("*.yaml"))


def test_help_names_every_verb(call: Call) -> None:
    result = call("--help")
    assert result.code == 0
    assert all(verb in result.out for verb in VERBS)


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_explains_itself(call: Call, verb: str) -> None:
    result = call(verb, "--help")
    assert result.code == 0
    assert "Usage: eomgen" in result.out


@pytest.mark.parametrize("verb", [verb for verb in VERBS if verb != "cache"])
def test_help_lists_the_options_of_the_verb_first(call: Call, verb: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    text = call(verb, "--help").out
    assert max(map(len, text.splitlines())) <= 80
    headings = [line[:-1] for line in text.splitlines() if line.endswith(":") and not line.startswith(" ")]
    assert headings[0] == "Options"
    assert headings[1:] == [section for section in SHARED if section in headings]
    own = text.partition("\nOptions:\n")[2].partition("\n\n")[0]
    assert "--target" not in own
    assert "--method" not in own
    assert "--floating" not in own
    assert own.rstrip().endswith("Show this message and exit.")


@pytest.mark.parametrize("path", MODELS, ids=lambda p: p.stem)
def test_every_example_passes_check(call: Call, path: Path) -> None:
    result = call("check", path)
    assert (result.code, result.err) == (0, "")
    assert f"mechanism {path.stem}" in result.out
    assert "degrees of freedom" in result.out


@pytest.mark.parametrize("path", MODELS, ids=lambda p: p.stem)
def test_every_example_names_its_source_in_one_short_line(path: Path) -> None:
    doc = describe_example(path)
    assert "(" in doc
    assert len(doc) <= 100
    assert example_files()[path.stem].name == path.name


def test_check_json(call: Call) -> None:
    report = call("check", EXAMPLES / "slider_crank.yaml", "--json").json
    assert set(report) == REPORT_KEYS
    assert (report["degrees_of_freedom"], report["rank"], report["loop_joints"]) == (1, 2, ["C"])
    assert (report["gruebler_kutzbach"], report["gruebler_kutzbach_planar"]) == (-2, 1)
    assert report["independent"] == ["theta"]


def test_derive_prints_the_size_of_the_equations(call: Call) -> None:
    result = call("derive", EXAMPLES / "slider_crank.yaml")
    assert result.code == 0
    assert "mass_matrix" in result.out
    assert "derive" in result.err


def test_derive_json(call: Call) -> None:
    derived = call("derive", EXAMPLES / "slider_crank.yaml", "--method", "lagrange", "--json").json
    assert set(derived) == {"name", "method", "choice", "system", "report", "operations", "seconds"}
    assert derived["method"] == "lagrange"
    counts = {"multiplications", "additions", "divisions", "negations", "functions", "choices", "total"}
    assert {frozenset(operations) for operations in derived["operations"].values()} == {frozenset(counts)}
    assert set(derived["report"]) == REPORT_KEYS


def test_derive_writes_the_equations(call: Call) -> None:
    result = call("derive", EXAMPLES / "pendulum.yaml", "--equations")
    assert "mass_matrix[0, 0] = l**2*m" in result.out
    assert "force[0] = -g*l*m*sin(theta)" in result.out


def test_derive_needs_no_parameter_values(call: Call, model_file: Callable[[str], Path]) -> None:
    text = (EXAMPLES / "pendulum.yaml").read_text().replace("value: 9.81, ", "")
    assert call("derive", model_file(text)).code == 0
    result = call("check", model_file(text))
    assert result.code == 1
    assert "model.yaml:7: parameters.g: has no value" in result.err


def test_generate_json(call: Call, tmp_path: Path) -> None:
    written = call("generate", EXAMPLES / "pendulum.yaml", "--out", tmp_path / "out", "--json").json
    assert set(written) == {"name", "target", "folder", "files"}
    assert written["target"] == "cython"
    assert Path(written["folder"]) == tmp_path / "out" / "pendulum"
    assert {"model.json", "pyproject.toml", "README.md"} <= set(written["files"])
    assert all((tmp_path / "out" / "pendulum" / name).is_file() for name in written["files"])


def test_generate_a_wheel(call: Call, tmp_path: Path) -> None:
    words = ("generate", EXAMPLES / "pendulum.yaml", "--out", "out", "--wheel")
    written = call(*words, "--target", "numpy", "--json").json
    assert set(written) == {"name", "target", "folder", "files", "wheel", "note"}
    assert Path(written["wheel"]) == Path("out", "pendulum-0.1.0-py3-none-any.whl")
    assert Path(written["wheel"]).is_file()
    assert written["note"] == ""
    assert call(*words, "--target", "numpy").out.splitlines()[-1] == written["wheel"]


def test_generate_a_wheel_of_another_target_writes_nothing(call: Call, tmp_path: Path) -> None:
    result = call("generate", EXAMPLES / "pendulum.yaml", "--out", "out", "--target", "fmu", "--wheel")
    assert result.code == 2
    assert "--wheel is for target cython or numpy; target fmu makes a functional mock-up unit" in result.err
    assert not (tmp_path / "out").exists()


def test_generate_again_for_another_target_leaves_nothing_stale(call: Call, tmp_path: Path) -> None:
    for target in ("cython", "numpy", "c"):
        words = ("generate", EXAMPLES / "pendulum.yaml", "--target", target, "--json", "--out")
        assert call(*words, "again").json["files"] == call(*words, target).json["files"]


def test_examples_list(call: Call) -> None:
    result = call("examples")
    assert result.code == 0
    assert all(name in result.out for name in ("slider_crank", "andrews_squeezer", "chain.py"))
    listed = call("examples", "--json").json["examples"]
    lines = result.out.splitlines()
    for entry in listed:  # one line each
        assert sum(line.split()[:1] == [entry["name"]] and entry["doc"] in line for line in lines) == 1, entry


def test_examples_json(call: Call) -> None:
    listed = call("examples", "--json").json
    assert set(listed) == {"examples"}
    assert {frozenset(entry) for entry in listed["examples"]} == {frozenset({"name", "file", "doc"})}
    assert {entry["name"] for entry in listed["examples"]} >= {path.stem for path in MODELS}
    assert all(entry["doc"] for entry in listed["examples"])


@pytest.mark.parametrize("name", ["pendulum", "pendulum.yaml", "chain.py"])
def test_examples_copies_one_and_never_overwrites(call: Call, tmp_path: Path, name: str) -> None:
    file = name if "." in name else f"{name}.yaml"
    assert call("examples", name).out.strip() == file
    copy = tmp_path / file
    assert copy.read_bytes() == (EXAMPLES / file).read_bytes()
    copy.write_text("mine")
    assert call("examples", name).code == 2
    assert copy.read_text() == "mine"
    assert call("examples", name, "--force", "--json").json == {"file": file}
    assert copy.read_bytes() == (EXAMPLES / file).read_bytes()


def test_cache(call: Call, tmp_path: Path, warm_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("EOMGEN_CACHE_DIR", str(tmp_path / "nothing"))
    empty = call("cache", "list", "--json").json
    assert empty == {"directory": str(tmp_path / "nothing"), "size": 0, "entries": []}
    monkeypatch.setenv("EOMGEN_CACHE_DIR", str(warm_cache))
    assert call("run", EXAMPLES / "pendulum.yaml", "--end", "0.1").code == 0
    full = call("cache", "list", "--json").json
    assert {"pendulum"} <= {entry["name"] for entry in full["entries"]}
    keys = {"key", "kind", "name", "directory", "size", "created", "used"}
    assert {frozenset(entry) for entry in full["entries"]} == {frozenset(keys)}
    assert "pendulum" in call("cache").out
    assert call("cache", "prune", "--json").json == {"directory": full["directory"], "removed": [], "freed": 0}
    pruned = call("cache", "prune", "--max-size", "0", "--json").json
    assert set(pruned["removed"]) == {entry["key"] for entry in full["entries"]}
    assert pruned["freed"] == full["size"]
    assert call("cache", "clear", "--json").json == {"directory": full["directory"], "removed": 0}


@pytest.mark.slow
def test_doctor(call: Call) -> None:
    result = call("doctor", "--json")
    assert result.code == 0
    assert set(result.json) == {"ok", "checks"}
    assert result.json["ok"] is True
    checks = {check["name"]: check for check in result.json["checks"]}
    assert {frozenset(check) for check in checks.values()} == {frozenset({"name", "ok", "detail", "remedy", "needed"})}
    assert {"python", "numpy", "[robots]", "[mesh]", "[plot]", "[results]", "compiler", "small model", "cache"} <= set(
        checks
    )


def test_doctor_tells_which_extras_are_there(call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    def version(name: str) -> str:
        if name == "mujoco":
            raise metadata.PackageNotFoundError(name)
        return "1.2"

    monkeypatch.setattr(metadata, "version", version)
    monkeypatch.setenv("CC", "no-such-compiler")  # quick
    checks = {check["name"]: check for check in call("doctor", "--json").json["checks"]}
    assert not checks["[robots]"]["ok"]
    assert not checks["[robots]"]["needed"]
    assert checks["[robots]"]["remedy"] == 'pip install --upgrade "eomgen[robots]"'
    assert checks["[mesh]"]["ok"]


def test_doctor_tells_what_is_installed_and_cannot_be_imported(tmp_path: Path) -> None:
    """As pint 0.24 beside a later flexparser: every run with a unit such as inch failed, and doctor was content."""
    for name in ("pint", "trimesh"):
        (tmp_path / f"{name}.py").write_text("raise TypeError('a frozen class from one that is not')")
    environment = {**os.environ, "PYTHONPATH": str(tmp_path), "CC": "no-such-compiler"}
    command = [sys.executable, "-m", "eomgen", "doctor", "--json"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 3
    checks = {check["name"]: check for check in json.loads(done.stdout)["checks"]}
    for name in ("pint", "[mesh]"):
        assert not checks[name]["ok"]
        assert "cannot be imported (TypeError: a frozen class from one that is not)" in checks[name]["detail"]
    assert checks["pint"]["needed"]
    assert checks["numpy"]["ok"]


def test_every_extra_for_users_is_known_to_doctor() -> None:
    import tomllib

    from eomgen.cli.verb_doctor import CORE, EXTRAS

    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    bare = {name: {text.partition(">")[0] for text in texts} for name, texts in extras.items()}
    assert {name: set(packages) for name, (_, packages) in EXTRAS.items()} == {
        name: packages for name, packages in bare.items() if name not in ("test", "dev", "all")
    }
    assert set(CORE) == {text.partition(">")[0] for text in project["dependencies"]}


def test_doctor_without_a_compiler_says_what_to_do(call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", "no-such-compiler")
    result = call("doctor")
    assert result.code == 3
    assert "no-such-compiler" in result.out
    assert "pip install ziglang" in result.out


def test_check_draws_the_mechanism(call: Call, tmp_path: Path) -> None:
    result = call("check", EXAMPLES / "slider_crank.yaml", "--graph", "graph.svg")
    assert result.code == 0
    assert "wrote graph.svg" in result.out
    assert "can be independent" in result.out
    assert "<svg" in (tmp_path / "graph.svg").read_text(encoding="utf-8")
    wrong = call("check", EXAMPLES / "slider_crank.yaml", "--graph", "graph.doc")
    assert wrong.code == 2
    assert ".svg" in wrong.err


def test_rounding_of_zeros_is_shown_as_zero() -> None:
    from eomgen.analysis.tables import without_noise

    assert without_noise([1.0, -3e-20, 2e-3, float("nan")], ["m", "m", "rad", "m"])[:3] == [1.0, 0.0, 2e-3]
    assert without_noise([-3e-20, 1e-21]) == [-3e-20, 1e-21]  # all of a small machine
    assert without_noise([-3e-20, 1.0], ["m", "N"], [0.5, 1.0]) == [0.0, 1.0]


def test_messages_speak_of_options() -> None:
    from eomgen.cli.failures import lines_of
    from eomgen.errors import AssemblyError, UsageError

    assert lines_of(UsageError("method RK4 needs step=, the size")) == ["method RK4 needs --step, the size"]
    blocked = lines_of(AssemblyError("the way is blocked; give initial={...} nearer to the first point"))
    assert blocked == ["the way is blocked; give --set NAME=VALUE nearer to the first point"]


TWO_FREEDOMS = """
name: two
bodies:
  a: {mass: 1, com: [0.2, 0, 0], inertia: {zz: 0.1}, markers: {end: [0.1, 0, 0]}}
  b: {mass: 1, inertia: {zz: 0.1}, markers: {end: [0.3, 0, 0]}}
  c: {mass: 1}
  w: {mass: m, inertia: {zz: 1}}
parameters: {m: %s}
joints:
  A: {type: revolute, between: [ground, a], coordinate: q}
  B: {type: revolute, between: [a.end, b]}
  C: {type: revolute, between: [b.end, c]}
  D: {type: prismatic, between: [ground, c], axis: x, coordinate: s}
  E: {type: revolute, between: [ground, w], coordinate: e}
initial: {q: 0.7}
"""


def test_a_named_coordinate_is_joined_by_others(call, model_file):
    file = model_file(TWO_FREEDOMS % 1)
    for name in ("q", "s"):
        report = call("run", file, "--end", "0.01", "--independent", name, "--json").json["report"]
        assert set(report["independent"]) == {name, "e"}


def test_where_a_value_can_be_given_is_said(call, model_file):
    """Each remedy that is named works."""
    file = model_file(TWO_FREEDOMS % "{}")
    for verb in ("check", "run", "generate", "verify"):
        result = call(verb, file, *(("--out", "x") if verb == "generate" else ()))
        assert result.code == 1
        assert "parameters: {m: VALUE}" in result.err
        assert "bind" not in result.err
    assert call("run", file, "--end", "0.01", "--set", "m=1").code == 0
