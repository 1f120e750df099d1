"""Exported packages carry what they can import and no more; every call of theirs is there without eomgen."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from pathlib import Path

import models
import numpy as np
import pytest

import eomgen as eg
from eomgen.api.module import CALLS, FORMS
from eomgen.generation import generate
from eomgen.runtime.show_parts import PARTS

GENERATED = {"__init__.py", "__init__.pyi", "_core.py", "selftest.py", "setup.py"}


def imports_of(folder: Path, file: Path) -> set[Path]:
    """Files of the package that a file imports, in functions too; for types only where it is a stub."""
    tree = ast.parse(file.read_text())
    typing = [n for n in ast.walk(tree) if isinstance(n, ast.If) and ast.unparse(n.test) == "TYPE_CHECKING"]
    skipped = {id(one) for block in typing for part in block.body for one in ast.walk(part)}
    found: set[Path] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.level and id(node) not in skipped:
            home = file.parents[node.level - 1].joinpath(*(node.module or "").split("."))
            for one in node.names:
                inner = (home / one.name).with_suffix(".py")
                found.add(inner if inner.is_file() else home.with_suffix(".py"))
    if file == folder / "api/module.py":
        homes = (*CALLS.values(), *FORMS.values())
        found |= {folder.joinpath(*home.split(".")).with_suffix(".py") for home in homes}
    if file == folder / "runtime/show_parts.py":
        found |= {folder.joinpath(*home.split(".")).with_suffix(".py") for home in PARTS.values()}
    return {one for one in found if one.is_file()}


@pytest.mark.parametrize("target", ["cython", "numpy"])
def test_every_file_can_be_reached(target: str, tmp_path: Path) -> None:
    folder = generate(models.build("slider_crank"), tmp_path, target=target)
    every = {file for file in folder.rglob("*.py*") if file.suffix in (".py", ".pyi")}
    reached, todo = set(), [file for file in every if file.parent == folder and file.name in GENERATED]
    while todo:
        file = todo.pop()
        if file not in reached:
            reached.add(file)
            todo += imports_of(folder, file)
    folders = {file for file in every if file.name == "__init__.py" and file.parent != folder}
    assert len(reached) > 100
    assert {str(one.relative_to(folder)) for one in every - reached - folders} == {"tests/test_recorded.py"}
    numpy = {"runtime/numpy_core.py", "numeric/embedded.py"}
    assert (numpy <= {str(file.relative_to(folder)) for file in reached}) == (target == "numpy")
    project = (folder / "pyproject.toml").read_text()
    assert all(f'"slider_crank.{one.parent.name}"' in project for one in folders)


LOADS = """
import importlib, json, pkgutil, sys
sys.modules["eomgen"] = sys.modules["sympy"] = None
import slider_crank as package
files = [one.name for one in pkgutil.walk_packages(package.__path__, "slider_crank.")]
for name in files:
    importlib.import_module(name)
for name in package.__all__:
    getattr(package, name)
for name in json.loads(sys.argv[1]):
    assert callable(getattr(package.module, name)), name
for name in ("minimal", "dae"):
    getattr(package.module, name)
print(len(files))
"""


def test_every_file_and_call_is_there_without_eomgen(tmp_path: Path) -> None:
    generate(models.build("slider_crank"), tmp_path, target="numpy")
    command = [sys.executable, "-c", LOADS, json.dumps(sorted(CALLS))]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) > 100


DRAWS = """
import sys
sys.modules["eomgen"] = sys.modules["sympy"] = None
import matplotlib
matplotlib.use("agg")
import slider_crank as package
ax = package.draw({"theta": 1.0})
ax.figure.savefig("alone.png")
assert len(package.draw_branches()) == 2
run = package.simulate(0.1)
run.animate("alone.gif", fps=20, dpi=40, trace="rod.tip", plot="theta")
print(package.x0({"x(rod.tip)": 0.42})[2], len(str(run.animate())))
"""


def test_a_package_draws_and_animates_without_eomgen(tmp_path: Path) -> None:
    """The same picture as eomgen's, dot by dot."""
    import matplotlib.pyplot as plt

    generate(models.build("slider_crank"), tmp_path, target="numpy")
    done = subprocess.run([sys.executable, "-c", DRAWS], cwd=tmp_path, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    place, size = done.stdout.split()
    assert float(place) == pytest.approx(0.42)
    assert int(size) > 1e6
    ax = models.build("slider_crank").compile(target="numpy").draw({"theta": 1.0})
    ax.figure.savefig(tmp_path / "here.png")
    np.testing.assert_array_equal(plt.imread(tmp_path / "here.png"), plt.imread(tmp_path / "alone.png"))
    plt.close("all")
    assert (tmp_path / "alone.gif").read_bytes()[:6] == b"GIF89a"


@pytest.mark.parametrize(("example", "forms"), [("satellite", {"dae"}), ("pendulum", {"minimal", "dae"})])
def test_a_package_lists_the_forms_that_it_has(example: str, forms: set[str], tmp_path: Path) -> None:
    """A model turned by Euler parameters has no minimal form."""
    folder = generate(eg.load_example(example), tmp_path, target="numpy")
    listed = f"import {example} as one; print(*(name for name in one.__all__ if getattr(one, name) is not None))"
    done = subprocess.run([sys.executable, "-c", listed], cwd=tmp_path, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    every = {"minimal", "canonical", "dae"}
    assert every & set(done.stdout.split()) == forms
    stub = (folder / "__init__.pyi").read_text()
    assert {name for name in every if f"\n{name}: " in stub} == forms
    assert "\nproject: Projection\n" in stub
