"""Exported packages carry what they can import and no more; every call of theirs is there without eomgen."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from pathlib import Path

import models
import pytest

from eomgen.api.module import CALLS
from eomgen.generation import generate

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
        found |= {folder.joinpath(*home.split(".")).with_suffix(".py") for home in CALLS.values()}
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
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) > 100
