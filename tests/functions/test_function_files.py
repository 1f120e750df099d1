"""Functions in model files: reading, writing, hostile and broken entries, permission for native code."""

from __future__ import annotations

import builtins
import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eomgen as eg
from eomgen.cli import main
from eomgen.describe import model_schema
from eomgen.errors import ModelError

HEAD = """\
name: sample
functions:
{functions}
bodies: {{b: {{mass: 1.5}}}}
joints: {{s: {{type: prismatic, between: [ground, b], axis: x}}}}
forces: {{push: {{type: actuator, joint: s, value: "{law}"}}}}
outputs: {{slope: "{output}"}}
initial: {{s: 0.4}}
"""
TABLE = "  law: {type: table, x: [-1, 0, 1, 2], y: [-2, 0, 0.5, pi/2]}"
NATIVE = "  swing: {type: native, source: laws.c, derivatives: [swing_slope], python: laws.py}"


def written(folder: Path, functions: str, law: str = "-law(s)", output: str = "diff(law(s), 1)") -> Path:
    path = folder / "sample.yaml"
    path.write_text(HEAD.format(functions=functions, law=law, output=output), encoding="utf-8")
    return path


def test_a_table_in_a_file(tmp_path: Path) -> None:
    m = eg.load(written(tmp_path, TABLE))
    module = m.compile(target="numpy")
    from scipy.interpolate import CubicSpline

    spline = CubicSpline([-1, 0, 1, 2], [-2, 0, 0.5, np.pi / 2])
    assert module.rhs(0, [0.4, 0])[1] == pytest.approx(-float(spline(0.4)) / 1.5, rel=1e-13)
    assert module.outputs(0, [0.4, 0])[0] == pytest.approx(float(spline(0.4, 1)), rel=1e-13)
    again = tmp_path / "again.yaml"
    m.save(again)
    assert eg.load(again).to_yaml() == m.to_yaml()
    assert "<Model sample: 1 function, 1 body" in repr(m)
    assert "4 x" in m._repr_html_()


def test_models_of_python_are_written_with_their_functions(tmp_path: Path, sources: Path) -> None:
    m = eg.Model("written")
    f = m.table("f", np.linspace(0, 1, 5), np.arange(5.0), kind="monotone", extrapolation="constant")
    g = m.table("g", range(4), range(4), np.eye(4))
    n = m.native("swing", sources / "laws.c", derivatives=["swing_slope"], python=str(sources / "laws.py"))
    m.prismatic("s", m.ground, m.body("b", mass=1), axis="x")
    s = m.coordinate("s")
    m.actuator("push", "s", f(m.t) - g(s, s**2).diff(s) + n(2 * s))
    m.output("slope", (f(s * 3) * g(s, s)).diff(s, 2))
    text = m.to_yaml()
    assert "diff(g(s, s**2), 1, 0)" in text
    path = tmp_path / "written.yaml"
    m.save(path)
    again = eg.load(path, allow_native=True)
    assert again.to_yaml() == text
    x = np.array([0.23, 0.1])
    for target in ("cython", "numpy"):
        one, other = (model.compile(target=target) for model in (m, again))
        assert np.allclose(one.rhs(0.3, x), other.rhs(0.3, x), rtol=1e-14)
        assert np.allclose(one.outputs(0.3, x), other.outputs(0.3, x), rtol=1e-13)


BROKEN: list[tuple[str, str, str]] = [
    ("  law: {type: tabel, x: [0, 1], y: [0, 1]}", "functions.law.type", "no function of type 'tabel'; did you mean"),
    ("  law: {x: [0, 1], y: [0, 1]}", "functions.law.type", "is missing"),
    ("  law: 3", "functions.law", "is not a mapping"),
    ("  law: {type: table, x: [0, 1]}", "functions.law.y", "is missing; give a list of numbers"),
    ("  law: {type: table, x: [0, 1], y: [0, 1], w: 1}", "functions.law.w", "unknown key"),
    ("  law: {type: table, x: [0], y: [1]}", "functions.law.x", "has fewer than two points"),
    ("  law: {type: table, x: 0, y: [1]}", "functions.law.x", "0 is not a list of numbers"),
    ("  law: {type: table, x: [0, 1, 1], y: [1, 2, 3]}", "functions.law.x[2]", "1 follows 1; the points"),
    ("  law: {type: table, x: [0, 2, 1], y: [1, 2, 3]}", "functions.law.x[2]", "1 follows 2"),
    ("  law: {type: table, x: [0, .nan, 1], y: [1, 2, 3]}", "functions.law.x[1]", "nan is not a number"),
    ("  law: {type: table, x: [0, 1, 2], y: [1, .inf, 3]}", "functions.law.y[1]", "inf is not a number"),
    ("  law: {type: table, x: [0, 1, 2], y: [1, true, 3]}", "functions.law.y[1]", "True is not a number"),
    ("  law: {type: table, x: [0, 1, 2], y: [1, s, 3]}", "functions.law.y[1]", "the name 's' cannot be used here"),
    ("  law: {type: table, x: [0, 1, 2], y: [1, null, 3]}", "functions.law.y[1]", "has no value"),
    ("  law: {type: table, x: [0, 1, 2], y: [1, [2], 3]}", "functions.law.y[1]", "[2] is not a number"),
    ("  law: {type: table, x: [0, 1e-300, 1], y: [1, 2, 3]}", "functions.law.x", "too close"),
    ("  law: {type: table, x: [0, 1, 2], y: [1, 2]}", "functions.law.y", "has 2 values for 3 points"),
    ("  law: {type: table, kind: cubik, x: [0, 1], y: [1, 2]}", "functions.law.kind", "'cubik' is not known; did you"),
    ("  law: {type: table, extrapolation: no, x: [0, 1], y: [1, 2]}", "functions.law.extrapolation", "'no' is not"),
    ("  law: {type: table, kind: periodic, x: [0, 1, 2], y: [1, 2, 3]}", "functions.law.y", "ends with 3 and begins"),
    ("  law: {type: table, kind: periodic, x: [0, 1], y: [1, 1]}", "functions.law.x", "fewer than three points"),
    ("  law: {type: table, x: [0, 1], y: [0, 1], z: [[1, 2]]}", "functions.law.z", "has 1 rows for 2 points"),
    ("  law: {type: table, x: [0, 1], y: [0, 1], z: [[1, 2], [3]]}", "functions.law.z[1]", "has 1 values for 2"),
    ("  law: {type: table, x: [0, 1], y: [0, 1], z: [[1, 2], 3]}", "functions.law.z[1]", "3 is not a list"),
    (
        "  law: {type: table, kind: monotone, x: [0, 1], y: [0, 1], z: [[1, 2], [3, 4]]}",
        "functions.law.kind",
        "two",
    ),
    (
        "  law: {type: table, x: [0, 1e-9, 1], y: [1e299, -1e299, 0]}",
        "functions.law",
        "is too steep for double precision",
    ),
    ("  law: {type: table, x: [0, 1e-9], y: [0, 1], z: [[9e299, -9e299], [0, 0]]}", "functions.law", "is too steep"),
    ("  2law: {type: table, x: [0, 1], y: [0, 1]}", "functions.2law", "is not an identifier"),
    ("  cos: {type: table, x: [0, 1], y: [0, 1]}", "functions.cos", "'cos' is a built-in function"),
    ("  t: {type: table, x: [0, 1], y: [0, 1]}", "functions.t", "'t' is reserved for the time"),
]


@pytest.mark.parametrize(("functions", "path", "message"), BROKEN)
def test_broken_entries_are_told_once_with_their_line(tmp_path: Path, functions: str, path: str, message: str) -> None:
    two = "z: [[" in functions
    name = functions.strip().partition(":")[0]
    usable = name == "law"
    law = ("law(s, s)" if two else "law(s)") if usable else "s"
    output = ("diff(law(s, s), 1, 0)" if two else "diff(law(s), 1)") if usable else "s"
    file = written(tmp_path, functions, law, output)
    with pytest.raises(ModelError) as caught:
        eg.load(file).mechanism()
    (problem,) = caught.value.problems
    assert f"{file}:3: {path}: " in str(problem)
    assert message in str(problem)


def test_huge_tables_are_refused(tmp_path: Path) -> None:
    many = ", ".join(map(str, range(20_001)))
    file = written(tmp_path, f"  law: {{type: table, x: [{many}], y: [{many}]}}")
    with pytest.raises(ModelError, match="a table has at most 20000 points"):
        eg.load(file).mechanism()
    grid = f"[{', '.join(str(k) for k in range(150))}]"
    rows = ", ".join([grid] * 150)
    file = written(tmp_path, f"  law: {{type: table, x: {grid}, y: {grid}, z: [{rows}]}}", "law(s, s)", "law(s, s)")
    with pytest.raises(ModelError, match=r"has 22500 points; a table has at most 20000"):
        eg.load(file).mechanism()


def test_native_code_of_a_file_needs_permission(sources: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = written(sources, NATIVE, "-swing(s)", "diff(swing(s), 1)")
    (sources / "laws.py").write_text("raise SystemExit('read before permission')\n")
    opened: list[str] = []

    def watched(true_open: Any) -> Any:
        def open_noted(name: Any, *rest: Any, **keys: Any) -> Any:
            opened.append(str(name))
            return true_open(name, *rest, **keys)

        return open_noted

    for module in (builtins, os):
        monkeypatch.setattr(module, "open", watched(module.open))
    with pytest.raises(ModelError) as caught:
        eg.load(file).mechanism()
    (problem,) = caught.value.problems
    assert (problem.path, problem.line) == ("functions.swing", 3)
    assert "native code of model files is not allowed" in problem.message
    assert "--allow-native" in problem.remedy
    assert "allow_native=True" in problem.remedy
    assert any(name.endswith("sample.yaml") for name in opened)
    assert not any("laws" in name for name in opened)


def test_permission_runs_it(sources: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = written(sources, NATIVE, "-swing(s)", "diff(swing(s), 1)")
    monkeypatch.chdir(sources.parent)  # names of files start at the model file
    for target in ("cython", "numpy"):
        module = eg.load(file, allow_native=True).compile(target=target)
        assert module.rhs(0, [0.4, 0])[1] == pytest.approx(-np.sin(0.4) / 1.5, rel=1e-14)
        assert module.outputs(0, [0.4, 0])[0] == pytest.approx(np.cos(0.4), rel=1e-14)


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("{type: native}", "functions.swing.source: is missing"),
        ("{type: native, source: 3}", "functions.swing.source: 3 is not the path of a file"),
        ("{type: native, source: none.c}", "none.c cannot be read (No such file or directory); paths are relative"),
        ("{type: native, source: laws.c, derivatives: swing}", "functions.swing.derivatives: 'swing' is not a list"),
        ("{type: native, source: laws.c, function: [a]}", "functions.swing.function: ['a'] is not a name"),
        ("{type: native, source: ., function: a}", "is not a plain file but a folder"),
        ("{type: native, source: laws.c, python: [a]}", "functions.swing.python: ['a'] is not the path of a file"),
    ],
)
def test_broken_native_entries(sources: Path, entry: str, message: str) -> None:
    file = written(sources, f"  swing: {entry}", "-swing(s)", "s")
    with pytest.raises(ModelError) as caught:
        eg.load(file, allow_native=True).mechanism()
    (problem,) = caught.value.problems
    assert message in str(problem)


def command(*words: object) -> int:
    with pytest.raises(SystemExit) as left:
        main([str(word) for word in words])
    return int(left.value.code or 0)


def test_the_command_line_asks_for_permission(sources: Path, capfd: pytest.CaptureFixture[str]) -> None:
    file = written(sources, NATIVE, "-swing(s)", "diff(swing(s), 1)")
    verbs: list[tuple[object, ...]] = [
        ("check",),
        ("derive",),
        ("run", "--end", "0.2"),
        ("generate", "--out", sources / "out", "--target", "numpy"),
    ]
    for verb, *options in verbs:
        assert command(verb, file, *options) == 1
        assert f"{file}:3: functions.swing: is native code" in capfd.readouterr().err
        assert command(verb, file, *options, "--allow-native") == 0
    assert (sources / "out" / "sample" / "native_swing.py").exists()
    capfd.readouterr()
    assert command("derive", file, "--allow-native", "--equations") == 0
    assert "swing(s)" in capfd.readouterr().out
    bare = written(sources, "  swing: {type: native, source: laws.c}", "-swing(s)", "s")
    assert command("run", bare, "--allow-native", "--target", "numpy", "--end", "0.1") == 1
    assert f"{bare}:3: functions.swing: is a C function without a Python version" in capfd.readouterr().err


def test_the_schema_knows_functions() -> None:
    functions = model_schema()["properties"]["functions"]
    kinds = {entry["properties"]["type"]["const"]: entry for entry in functions["additionalProperties"]["oneOf"]}
    assert set(kinds) == {"table", "native"}
    assert kinds["table"]["required"] == ["type", "x", "y"]
    assert kinds["table"]["properties"]["kind"]["enum"] == ["cubic", "natural", "periodic", "monotone"]
    json.dumps(functions)
