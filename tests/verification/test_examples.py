"""verify of every example, of models that are no mechanisms, and of each target; what the command and packages do."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import sympy as sp
from sweeps import COVERING, part_of

import eomgen as eg
from eomgen.cli import main
from eomgen.generation import generate
from eomgen.verification import Finding, Verification

EXAMPLES = Path(__file__).parents[2] / "examples"
FILES = [*sorted(EXAMPLES.glob("*.yaml")), EXAMPLES / "arm.urdf"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "file", part_of(FILES, lambda file: file.stem in {*COVERING, "arm"}), ids=lambda file: file.stem
)
def test_every_example_keeps_all_limits(file: Path) -> None:
    found = eg.load(file).derive().compile().verify()  # variants: tests/invariance
    assert found.ok, str(found)
    assert sum(not f.left_out for f in found.findings) >= 30


@pytest.mark.parametrize("method", ["lagrange", "augmented", "newton_euler", "hamilton"])
def test_other_methods(method: str) -> None:
    found = eg.load(EXAMPLES / "four_bar.yaml").derive(method=method).compile(target="numpy").verify(states=3)
    assert found.ok, str(found)


def test_a_bare_lagrangian_with_a_constraint_that_moves() -> None:
    t = sp.Symbol("t")
    x, y, m, g, c, k = sp.symbols("x y m g c k")
    x_dot, y_dot = sp.symbols("x_dot y_dot")
    L = m * (x_dot**2 + y_dot**2) / 2 - m * g * y - k * x**2 / 2 + c * x * y_dot
    model = eg.Model.from_lagrangian(
        "bead",
        L,
        [x, y],
        forces=[sp.Symbol("f"), 0],
        dissipation=c * x_dot**2 / 2,
        constraints=[y - x**2 - sp.sin(t)],
        parameters={m: 1.5, g: 9.81, c: 0.3, k: 20.0},
        inputs={"f": 0.5},
    )
    found = model.derive().compile(target="numpy").verify(states=3)
    assert found.ok, str(found)
    judged = {f.check for f in found.findings if not f.left_out}
    assert "bias: Lagrange's equations by differences of L" in judged
    assert "gamma: second differences of C along the motion" in judged


def test_a_rotation_in_euler_parameters() -> None:
    model = eg.Model("top", gravity=(0, 0, "-g"))
    model.parameter("g", 9.81)
    body = model.body("body", mass=0.4, com=(0.0, 0.1, 0.3), inertia=(0.02, 0.03, 0.01))
    model.spherical("pivot", model.ground, body, rotation="euler_parameters")
    found = model.derive().compile(target="numpy").verify(states=3)
    assert found.ok, str(found)


def test_a_function_in_c_is_left_out_with_a_reason(tmp_path: Path) -> None:
    (tmp_path / "law.c").write_text(
        "double law(double x) { return 2.0 * x; }\ndouble law_1(double x) { return 2.0; }\n"
    )
    (tmp_path / "m.yaml").write_text(
        "name: m\nbodies: {b: {mass: 1.0}}\njoints: {s: {type: prismatic, between: [ground, b], axis: x}}\n"
        "functions: {law: {type: native, source: law.c, derivatives: [law_1]}}\n"
        "forces: {f: {type: actuator, joint: s, value: -law(s)}}\n"
    )
    found = eg.load(tmp_path / "m.yaml", allow_native=True).compile().verify(states=2)
    assert found.ok
    assert "without a Python version" in found.findings[-1].note


def test_the_table() -> None:
    found = Verification(
        "m", (Finding("a: b", 1e-15, 1e-14, "x, state 1", 3), Finding("c", 2.0, 1.0, "y"), Finding.skipped("d", "no e"))
    )
    assert not found.ok
    assert [f.check for f in found.breaches] == ["c"]
    lines = found.table.splitlines()
    assert lines[1].split() == ["ok", "a:", "b", "1.0e-15", "1.0e-14", "x,", "state", "1"]
    assert lines[2].startswith("BREACH  c")
    assert lines[4].strip() == "no e"
    assert str(found).endswith("BREACH: 2 checks, 1 breaches, 1 left out")
    assert json.dumps(found.as_dict(), allow_nan=False)


def run(*words: object) -> int:
    with pytest.raises(SystemExit) as left:
        main([str(word) for word in words])
    return int(left.value.code or 0)


def test_the_command(capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    words = ("verify", EXAMPLES / "pendulum.yaml", "--target", "numpy", "--states", 2)
    assert run(*words) == 0
    printed = capfd.readouterr()
    assert "bias: free bodies" in printed.out
    assert "verify" in printed.err
    assert run(*words, "--json") == 0
    result = json.loads(capfd.readouterr().out)
    assert list(result) == ["name", "method", "ok", "not_reached", "findings", "seconds"]
    keys = {"check", "ok", "left_out", "worst", "limit", "where", "cases", "note"}
    assert all(set(f) == keys for f in result["findings"])
    monkeypatch.setattr("eomgen.verification.bodies.Rigid.centre", lambda self, pose: pose.position)
    assert run(*words) == 5
    assert "BREACH" in capfd.readouterr().out
    assert run("verify", "nothing.yaml") == 2


ALONE = """
import sys
class Refuse:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in ("eomgen", "sympy", "jinja2", "scipy", "mpmath"):
            raise ImportError(name)
sys.meta_path.insert(0, Refuse())
import runpy
runpy.run_module("four_bar.selftest", run_name="__main__")
"""


def selftest(folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", ALONE],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(folder)},
        capture_output=True,
        text=True,
        check=False,
        timeout=100,
    )


def test_an_exported_package_tests_itself_with_numpy_alone(tmp_path: Path) -> None:
    package = generate(eg.load(EXAMPLES / "four_bar.yaml"), tmp_path, target="numpy")
    assert (package / "selftest.json").stat().st_size < 30_000
    fine = selftest(tmp_path)
    assert fine.returncode == 0, fine.stdout + fine.stderr
    assert "mass_matrix: recorded figures" in fine.stdout
    assert "rhs: forces in balance along free motions" in fine.stdout
    text = (package / "_core.py").read_text()
    place = text.index(" + ", text.index("def bias"))
    (package / "_core.py").write_text(text[:place] + " - " + text[place + 3 :])
    broken = selftest(tmp_path)
    assert broken.returncode == 5, broken.stdout + broken.stderr
    assert "BREACH  bias: recorded figures" in broken.stdout
