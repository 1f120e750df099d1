"""A run from a model file needs no SymPy; an exported package needs NumPy alone.

Source: CONTRACT, "Targets and the exported package"; DESIGN, section 2.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import sysconfig
import venv
from collections.abc import Callable
from importlib.metadata import distribution
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest

from eomgen.generation import generate

WITHOUT_SYMPY = """
import sys

class Refuse:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] == "sympy":
            raise ImportError("sympy was imported")

sys.meta_path.insert(0, Refuse())
from eomgen.cli import main
main(sys.argv[1:])
"""

EXPORTED = """
import importlib.util, json, sys
import numpy as np

name, states = json.load(sys.stdin)
for absent in ("eomgen", "sympy", "scipy"):
    assert importlib.util.find_spec(absent) is None, f"{absent} is there"
model = __import__(name)
states = np.array(states)
result = {
    "file": model.__file__,
    "rhs": [model.rhs(0.3, x).tolist() for x in states],
    "batch": model.rhs(0.3, states.T).T.tolist(),
    "jacobian": model.jacobian(0.3, states[0]).tolist(),
    "energy": np.asarray(model.energy(states.T)).tolist(),
    "x0": model.x0().tolist(),
    "assembled": model.assemble(theta=0.9).tolist(),
    "projected": model.project(states[0] + 1e-3).tolist(),
    "minimal": model.minimal.rhs(0.0, model.minimal.x0()).tolist(),
}
try:
    result["reached"] = model.simulate((0, 0.1), initial=states[0], rtol=1e-9, atol=1e-11).x[:, -1].tolist()
except ImportError as error:
    result["simulate"] = str(error)
try:
    model.simulate((0, 1), method="BDF")
except ImportError as error:
    result["bdf"] = str(error)
print(json.dumps(result))
"""


def clean_environment() -> dict[str, str]:
    return {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "PIP_", "VIRTUAL_ENV"))}


def succeed(*command: Any, **options: Any) -> str:
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False, **options)
    assert done.returncode == 0, f"{done.stdout[-3000:]}\n{done.stderr[-3000:]}"
    return done.stdout


def test_run_of_a_model_file_without_sympy(tmp_path: Path) -> None:
    file = models.EXAMPLES / "slider_crank.yaml"
    said = succeed(sys.executable, "-c", WITHOUT_SYMPY, "run", file, "--end", "0.5", "--json", cwd=tmp_path)
    run = json.loads(said)
    assert run["name"] == "slider_crank"
    assert run["final"]["t"] == 0.5
    # the hook does refuse
    refused = subprocess.run(
        [sys.executable, "-c", WITHOUT_SYMPY.replace("from eomgen.cli", "import sympy\nfrom eomgen.cli"), "doctor"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert "sympy was imported" in refused.stderr


@pytest.fixture(scope="module")
def fresh(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An environment outside the clone with pip, and what builds an extension, linked so that no download is needed."""
    folder = tmp_path_factory.mktemp("fresh") / "env"
    venv.EnvBuilder(with_pip=True, symlinks=True).create(folder)
    site = Path(sysconfig.get_path("purelib", vars={"base": str(folder), "platbase": str(folder)}))
    for name in ("numpy", "cython", "setuptools"):
        found = distribution(name)
        tops = {file.parts[0] for file in found.files or () if file.parts[0] not in ("..", "__pycache__")}
        for top in tops:
            target = site / top
            if target.is_dir() and not target.is_symlink():
                shutil.rmtree(target)
            elif target.exists():
                target.unlink()
            target.symlink_to(Path(str(found.locate_file(top))).resolve())
    return folder / "bin" / "python"


@pytest.mark.slow
@pytest.mark.parametrize(("name", "target"), [("slider_crank", "cython"), ("four_bar", "numpy")])
def test_exported_package_in_a_fresh_environment(
    module: Callable[..., Any], fresh: Path, tmp_path: Path, name: str, target: str
) -> None:
    from eomgen.cli import main

    out = tmp_path / "exported"
    with pytest.raises(SystemExit) as left:
        main(["generate", str(models.EXAMPLES / f"{name}.yaml"), "--out", str(out), "--target", target])
    assert not left.value.code
    folder = out / name
    for file in ("pyproject.toml", "README.md", "model.json", "__init__.py", "__init__.pyi"):
        assert (folder / file).is_file()
    command = [fresh, "-m", "pip", "install", "--no-build-isolation", "--no-deps", "--no-index", folder]
    succeed(*command, cwd=tmp_path, env=clean_environment())

    mod = module(name, target=target)
    random = np.random.default_rng(3)
    states = [mod.project(mod.x0() + 0.02 * random.uniform(-1, 1, mod.n_x)) for _ in range(5)]
    given = json.dumps([name, [x.tolist() for x in states]])
    there = json.loads(succeed(fresh, "-I", "-c", EXPORTED, input=given, cwd=tmp_path, env=clean_environment()))
    assert str(fresh.parents[1]) in there["file"]

    def same(ours: Any, theirs: Any) -> None:
        ours = np.asarray(ours)
        assert np.abs(ours - np.asarray(theirs)).max() <= 1e-14 * np.abs(ours).max()

    for x, x_dot, column in zip(states, there["rhs"], there["batch"], strict=True):
        same(mod.rhs(0.3, x), x_dot)
        same(mod.rhs(0.3, x), column)
    same(mod.jacobian(0.3, states[0]), there["jacobian"])
    same(mod.energy(np.array(states).T), there["energy"])
    same(mod.x0(), there["x0"])
    same(mod.assemble(theta=0.9), there["assembled"])
    same(mod.project(states[0] + 1e-3), there["projected"])
    same(mod.minimal.rhs(0.0, mod.minimal.x0()), there["minimal"])
    assert "scipy" in there["bdf"].lower()  # absent there, and said so
    if target == "cython":  # it has steppers of its own
        run = mod.simulate((0, 0.1), initial=states[0], rtol=1e-9, atol=1e-11)
        np.testing.assert_allclose(there["reached"], run.x[:, -1], rtol=1e-10)
    else:
        assert "scipy" in there["simulate"].lower()


def test_exported_sources_name_neither_eomgen_nor_sympy(tmp_path: Path) -> None:
    folder = generate(models.build("slider_crank"), tmp_path)
    for file in folder.rglob("*.py*"):
        for line in file.read_text(encoding="utf-8").splitlines():
            words = line.split("#")[0].split()
            if words[:1] in (["import"], ["from"], ["cimport"]):
                assert words[1].split(".")[0] not in ("eomgen", "sympy"), f"{file.name}: {line}"
