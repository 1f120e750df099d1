"""Wheels: one file for other computers and Pythons, the same bytes each time, with the bits of the module here."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import zipfile
from importlib import metadata, util
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest

import eomgen as eg
from eomgen.compilation.wheel import BuiltWheel, build_wheel, require_wheel
from eomgen.errors import MissingDependencyError, UsageError
from eomgen.generation import generate

ALONE = """
import json, sys
sys.modules["eomgen"] = sys.modules["sympy"] = None
import numpy as np, pytest
import pendulum as p
x = np.array([0.4, -1.5])
many = np.stack([x, 2 * x, 3 * x], axis=-1)
run = p.simulate((0.0, 2.0))
found = [p.rhs(0.1, x), p.rhs(t=0.1, x=x, out=np.empty(2)), p.rhs(0.1, many), p.energy(x), p.energy(x=many)]
found = [one.tolist() for one in (*found, p.jacobian(0.1, x), p.outputs(0.1, x), run.t, run.x)]
said = []
for call in (lambda: p.rhs(), lambda: p.rhs(0.1, x, q=1), lambda: p.rhs(0.1, x, x=x), lambda: p.rhs(0.1, x[:1])):
    try:
        call()
    except (TypeError, p.EomgenError) as error:
        said.append(str(error))
before = sys.getrefcount(type(p.rhs))
for _ in range(1000):
    p.bind(p={"m": 2.0}).rhs
after = sys.getrefcount(type(p.rhs))
code = pytest.main(["-q", "-p", "no:cacheprovider", "--pyargs", "pendulum"])
facts = {"provenance": p.metadata["provenance"], "refs": after - before, "said": said, "code": int(code)}
print("\\n" + json.dumps({"found": found, **facts}))
"""


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> list[BuiltWheel]:
    """The same wheel, built in two folders of different names."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CFLAGS", "-O0")
        patch.delenv("SOURCE_DATE_EPOCH", raising=False)
        folders = [tmp_path_factory.mktemp(name) for name in ("one", "another place")]
        return [build_wheel(generate(models.build("pendulum"), folder)) for folder in folders]


def unpacked(wheel: BuiltWheel, folder: Path) -> Path:
    with zipfile.ZipFile(wheel.path) as file:
        file.extractall(folder)
    return folder


def run_alone(folder: Path, script: str) -> dict[str, Any]:
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=folder, env=os.environ | {"PYTHONPATH": str(folder)}, capture_output=True,
        text=True, timeout=120,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


@pytest.mark.slow
def test_its_tags_say_where_it_runs(built: list[BuiltWheel]) -> None:
    name = built[0].path.name
    assert name.startswith("pendulum-0.1.0-cp311-abi3-")
    if sys.platform.startswith("linux"):
        audited = util.find_spec("auditwheel") is not None
        assert ("manylinux" in name) == audited
        assert audited or "pip install 'eomgen[wheel]'" in built[0].note
    with zipfile.ZipFile(built[0].path) as wheel:
        names = wheel.namelist()
        core = wheel.read("pendulum/_core.abi3.so")
        about = wheel.read("pendulum-0.1.0.dist-info/METADATA").decode()
    for place in (sys.base_prefix, str(Path.home()), "/tmp/"):  # no folder of this computer
        assert place.encode() not in core
    assert not [name for name in names if name.endswith(("setup.py", ".c", ".pyx", ".pxi"))]
    here = {"__init__.pyi", "py.typed", "PROVENANCE.md", "model.json", "tests/test_recorded.py", "tests/recorded.json"}
    assert {f"pendulum/{name}" for name in here} <= set(names)
    assert "pendulum-0.1.0.dist-info/licenses/LICENSE.txt" in names
    assert "Requires-Dist: numpy" in about
    assert "eomgen" not in [line for line in about.splitlines() if line.startswith("Requires-Dist")]


@pytest.mark.slow
def test_two_builds_give_the_same_bytes(built: list[BuiltWheel]) -> None:
    one, other = built
    assert one.path.parent != other.path.parent
    assert one.path.name == other.path.name
    assert one.path.read_bytes() == other.path.read_bytes()


@pytest.mark.slow
def test_it_has_the_bits_of_the_module_here(built: list[BuiltWheel], tmp_path: Path) -> None:
    there = run_alone(unpacked(built[0], tmp_path), ALONE)
    assert there["code"] == 0  # its own tests
    assert abs(there["refs"]) < 10  # kernels that are gone leave their type alone
    assert len(there["said"]) == 4
    assert "x of rhs must have shape (2,)" in there["said"][3]
    mod = models.build("pendulum").compile()
    x = np.array([0.4, -1.5])
    many, run = np.stack([x, 2 * x, 3 * x], axis=-1), mod.simulate((0.0, 2.0))
    rhs = mod.rhs(0.1, x)
    here = [rhs, rhs, mod.rhs(0.1, many), mod.energy(x), mod.energy(many), mod.jacobian(0.1, x), mod.outputs(0.1, x)]
    for mine, other in zip([*here, run.t, run.x], there["found"], strict=True):
        np.testing.assert_array_equal(mine, other)
    assert rhs[1] == pytest.approx(-9.81 * np.sin(0.4), rel=1e-15)
    digest = there["provenance"]["model_digest"]
    assert digest == mod.metadata["model_digest"]
    assert there["provenance"]["versions"]["eomgen"] == eg.__version__


FAULTS = {
    "a figure": ("tests/recorded.json", '"call":"rhs","arguments":[0.0,[-1.57', '"call":"rhs","arguments":[0.0,[-1.56'),
    "nothing": ("model.json", "", ""),
    "a formula": ("_core.py", "sin(", "cos("),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_its_tests_see_what_is_wrong(fault: str, tmp_path: Path) -> None:
    """In the folder, where they need no installation; nothing of them asks for what model.json says."""
    folder = generate(models.build("pendulum"), tmp_path, target="numpy")
    file, old, new = FAULTS[fault]
    text = (folder / file).read_text()
    assert old in text
    (folder / file).write_text(text.replace(old, new))
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=60)
    assert (done.returncode == 0) == (old == new), done.stdout
    assert ("passed" if old == new else "failed") in done.stdout


def test_one_of_numpy_is_for_every_computer(tmp_path: Path) -> None:
    m = eg.Model("class_", gravity=(0, -9.81, 0))  # which no project may be called, though a module may
    m.revolute("A", m.ground, m.body("rod", mass=1.0, com=(0, -1, 0)), coordinate="theta")
    m.initial(theta=0.5)
    made = build_wheel(generate(m, tmp_path, target="numpy"), tmp_path / "wheels")
    assert made == BuiltWheel(tmp_path / "wheels" / "class-0.1.0-py3-none-any.whl", "")
    unpacked(made, tmp_path / "there")
    script = (
        "import json, sys; sys.modules['eomgen'] = None; import class_ as c; print(json.dumps({'x': list(c.x0())}))"
    )
    assert run_alone(tmp_path / "there", script)["x"] == [0.5, 0.0]


@pytest.mark.parametrize("target", ["c", "fmu", "casadi", "jax", "cuda"])
def test_other_targets_are_refused(target: str) -> None:
    with pytest.raises(UsageError, match=rf"for target cython or numpy; target {target} makes a .*: generate it"):
        require_wheel(target)


def test_flags_for_this_processor_alone_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CFLAGS", "-O2 -march=native")
    with pytest.raises(UsageError, match=r"variable CFLAGS has -march=native.* leave it out"):
        require_wheel("cython")
    require_wheel("numpy")


@pytest.mark.parametrize("version", ["", "65.5.0"])
def test_setuptools_is_asked_for(version: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def found(name: str) -> str:
        if not version:
            raise metadata.PackageNotFoundError(name)
        return version

    monkeypatch.setattr(metadata, "version", found)
    with pytest.raises(MissingDependencyError, match=r"needs setuptools 77 .*pip install 'eomgen\[wheel\]'"):
        require_wheel("numpy")


def test_a_folder_of_others_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="is not a generated package"):
        build_wheel(tmp_path)
    folder = generate(models.build("pendulum"), tmp_path, target="numpy")
    (tmp_path / "elsewhere").write_text("kept")
    (tmp_path / "pendulum-0.1.0-py3-none-any.whl").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(UsageError, match="symbolic link"):
        build_wheel(str(folder))
    assert (tmp_path / "elsewhere").read_text() == "kept"
    (folder / "errors.py").unlink()
    with pytest.raises(UsageError, match=r"lacks files that were generated: errors\.py"):
        build_wheel(folder)
