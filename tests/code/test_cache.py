"""The cache of compiled models: what is found again, damaged, killed, built twice at once, owned by others.

Tests with caches or compilers of their own build units of target fmu, or take a copy of a cache that was filled once.
"""

import os
import pickle
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, NamedTuple

import models
import numpy as np
import pytest
from children import HANGS, child
from command import run
from refusals import refuses

import eomgen as eg

PENDULUM = models.EXAMPLES / "pendulum.yaml"
FOREIGN = "EG-CACHE belongs"
STRANGER = 12345  #: a user id that nobody has


def give_away(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make a file, folder or link belong to another user, or where only root may do so, seem to."""
    if os.geteuid() == 0:
        os.lchown(path, STRANGER, -1)
        return
    target = os.lstat(path)
    for name, look in (("lstat", os.lstat), ("fstat", os.fstat)):

        def changed(*place: Any, look: Any = look) -> os.stat_result:
            status = look(*place)
            return os.stat_result((*status[:4], STRANGER, *status[5:])) if os.path.samestat(status, target) else status

        monkeypatch.setattr(os, name, changed)


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache of the test's own, and the compiler that is found without CC."""
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("EOMGEN_CACHE_DIR", str(tmp_path / "cache"))
    return tmp_path / "cache"


def entries(kind: str = "library") -> list[dict[str, Any]]:
    """What the command lists."""
    found = run("cache", "list", "--json")
    assert found.code == 0, found.err
    return [entry for entry in found.json["entries"] if entry["kind"] == kind]


def product(name: str) -> Path:
    """The library of a unit in the cache."""
    (entry,) = (entry for entry in entries() if entry["name"] == name)
    (file,) = Path(entry["directory"]).glob("*.so")
    return file


def write_unit(folder: Path, model: eg.Model | None = None) -> bytes:
    """Build the unit; its bytes."""
    path = folder / "unit.fmu"
    return (model or models.build("pendulum")).derive().write_fmu(path).read_bytes()


def heavier(folder: Path) -> Path:
    """The file of the pendulum where g is 9.82."""
    file = folder / "pendulum.yaml"
    file.write_text(PENDULUM.read_text().replace("9.81", "9.82"))
    return file


def compiler(folder: Path, lines: str = "") -> tuple[Path, Path]:
    """A compiler that runs shell lines before every compilation, and the file in which it notes them."""
    path, noted = folder / "wrapped-gcc", folder / "noted"
    noted.touch()
    path.write_text(
        f'#!/bin/sh\ncase "$*" in *" -c "*)\necho "$*" >> {noted}\n{lines}\n;; esac\nexec gcc "$@"\n', encoding="utf-8"
    )
    path.chmod(0o755)
    return path, noted


def attempts(cache: Path) -> list[Path]:
    return list((cache / "attempts").iterdir())


class Filled(NamedTuple):
    """A cache with units of two pendulums and a module of one; what its compiler noted of each, and the first unit."""

    folder: Path
    compiler: Path
    noted: Path
    notes: list[str]
    unit: bytes


@pytest.fixture(scope="module")
def filled(tmp_path_factory: pytest.TempPathFactory) -> Filled:
    """It is filled by a process whose files everybody may write."""
    folder = tmp_path_factory.mktemp("filled")
    path, noted = compiler(folder)
    notes, units, before = [], [], os.umask(0)
    try:
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("CC", str(path))
            patch.setenv("EOMGEN_CACHE_DIR", str(folder / "cache"))
            for name in ("pendulum", "double_pendulum"):
                units.append(write_unit(folder, models.build(name)))
                notes.append(noted.read_text())
                noted.write_text("")
            eg.load(PENDULUM).compile(optimize=0)
    finally:
        os.umask(before)
    return Filled(folder / "cache", path, noted, notes, units[0])


@pytest.fixture
def copied(filled: Filled, cache: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache of the test's own, filled, and the compiler that filled it."""
    shutil.copytree(filled.folder, cache)
    monkeypatch.setenv("CC", str(filled.compiler))
    return cache


def test_a_second_build_compiles_nothing(filled: Filled, copied: Path, tmp_path: Path) -> None:
    first, second = filled.notes
    assert first.count("\n") >= 2
    assert 0 < second.count("\n") < first.count("\n")  # another model takes the object of the integrators
    before = filled.noted.read_text()
    assert write_unit(tmp_path) == filled.unit
    assert filled.noted.read_text() == before
    sources = product("pendulum").parent / "sources"
    assert any("pendulum" in file.name for file in sources.iterdir())


def test_what_changes_the_code_changes_the_key(monkeypatch: pytest.MonkeyPatch) -> None:
    """Options, sources, and nothing else: one entry of the cache for each build that differs."""
    monkeypatch.delenv("CC", raising=False)

    def keys() -> set[str]:
        return {entry["key"] for entry in entries("model") if entry["name"] == "keyed"}

    def model(length: float = 1.0) -> eg.Model:
        m = eg.Model("keyed", gravity=(0, -9.81, 0))
        m.revolute("A", m.ground, m.body("b", mass=1.0, com=(0, -length, 0)), coordinate="theta")
        return m

    options: list[dict[str, Any]] = [{}, {"extra": ["-DEXTRA"]}, {"lanes": 0}]
    modules = []
    for k, given in enumerate(options):
        modules.append(model().compile(kernels=["rhs", "jacobian"], **given))
        assert len(keys()) == k + 1
    for module in modules:
        np.testing.assert_allclose(module.rhs(0.0, [0.3, 0.0])[1], -9.81 * np.sin(0.3), rtol=1e-14)
    before = keys()
    model().compile(kernels=["rhs", "jacobian"], jobs=1)
    assert keys() == before
    changed = model(2.0).compile(kernels=["rhs", "jacobian"])
    assert len(keys()) == len(before) + 1
    assert changed.rhs(0.0, [0.3, 0.0])[1] == pytest.approx(-9.81 * np.sin(0.3) / 2)
    assert modules[0].rhs(0.0, [0.3, 0.0])[1] == pytest.approx(-9.81 * np.sin(0.3))


def test_a_second_process_writes_no_sources_again(copied: Path, tmp_path: Path) -> None:
    """It takes the module of the first, by a note of what that was made of; what is damaged is built again."""
    code = (
        "import sys, eomgen as eg\nm = eg.load(sys.argv[1]).compile(optimize=0)\n"
        "print(m.rhs(0.0, [0.5, 0.0])[1], 'jinja2' in sys.modules, 'Cython' in sys.modules)"
    )

    def started(file: Path) -> list[str]:
        command = [sys.executable, "-c", code, str(file)]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()

    first = started(PENDULUM)
    assert first[1:] == ["False", "False"]
    other = started(heavier(tmp_path))
    assert (other[0] != first[0], other[1]) == (True, "True")
    assert started(PENDULUM) == first
    kept = [Path(entry["directory"]) for entry in entries("model")]
    assert len(kept) == 2
    for folder in kept:
        next(folder.glob("*.so")).write_bytes(b"damaged")
    assert started(PENDULUM) == [first[0], "True", "False"]


def test_list_prune_clear(copied: Path, tmp_path: Path) -> None:
    for age, name in zip((300, 200), ("pendulum", "double_pendulum"), strict=True):
        os.utime(product(name).parent / "manifest.json", (time.time() - age * 86400.0,) * 2)
    assert [entry["name"] for entry in entries()] == ["double_pendulum", "pendulum"]
    total = run("cache", "list", "--json").json
    assert {"library", "object", "model"} <= {entry["kind"] for entry in total["entries"]}
    assert total["size"] == sum(entry["size"] for entry in total["entries"])
    keys = {"key", "kind", "name", "directory", "size", "created", "used"}
    assert {frozenset(entry) for entry in total["entries"]} == {frozenset(keys)}
    assert "pendulum" in run("cache").out
    write_unit(tmp_path)  # used again
    assert [entry["name"] for entry in entries()] == ["pendulum", "double_pendulum"]
    assert run("cache", "prune", "--older-than", "150").code == 0
    assert [entry["name"] for entry in entries()] == ["pendulum"]
    left = run("cache", "list", "--json").json
    pruned = run("cache", "prune", "--max-size", "0", "--json").json
    assert (set(pruned["removed"]), pruned["freed"]) == ({entry["key"] for entry in left["entries"]}, left["size"])
    for _ in range(2):  # of nothing, too
        assert run("cache", "clear").code == 0
        assert run("cache", "list", "--json").json["entries"] == []


def test_the_cache_is_private(copied: Path, tmp_path: Path) -> None:
    paths = [copied, *copied.rglob("*")]
    assert len(paths) > 10
    assert [path for path in paths if path.stat().st_mode & 0o022] == []
    file = product("pendulum")
    for folder in (copied, file.parent.parent, file.parent):
        assert folder.stat().st_mode & 0o777 == 0o700
    copied.chmod(0o777)
    refuses("EG-CACHE written", write_unit, tmp_path)


def test_a_cache_that_cannot_be_written_is_named_and_numpy_goes_without(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("EOMGEN_CACHE_DIR", str(tmp_path / "file" / "cache"))
    refuses("EG-CACHE EOMGEN_CACHE_DIR", write_unit, tmp_path)
    assert models.build("pendulum").compile(target="numpy").rhs(0.0, [0.0, 0.0]).shape == (2,)


@pytest.mark.parametrize("variable", ["XDG_CACHE_HOME", "EOMGEN_CACHE_DIR"])
def test_where_the_cache_is(variable: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("EOMGEN_CACHE_DIR")
    monkeypatch.setenv(variable, str(tmp_path / "here"))
    expected = tmp_path / "here" if variable == "EOMGEN_CACHE_DIR" else tmp_path / "here" / "eomgen"
    if variable == "EOMGEN_CACHE_DIR" or sys.platform == "linux":
        assert Path(run("cache", "list", "--json").json["directory"]) == expected


# Several processes, and what is left of one that ends early.


def build(cc: Path, out: Path) -> AbstractContextManager[subprocess.Popen[str]]:
    """A process that builds the unit of the pendulum."""
    out.mkdir(exist_ok=True)
    code = (
        "import runpy, signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "runpy.run_module('eomgen', run_name='__main__')"
    )
    words = ["generate", str(PENDULUM), "--out", str(out), "--target", "fmu"]
    command = [sys.executable, "-c", code, *words]
    environment = {**os.environ, "CC": str(cc)}
    return child(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)


def wait_for(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + HANGS
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.01)


@pytest.mark.parametrize("when", [pytest.param("before", marks=pytest.mark.thorough), "behind"])
def test_a_build_that_is_killed_leaves_nothing_that_counts(cache: Path, tmp_path: Path, when: str) -> None:
    """By kill -9, before the first object is made and behind it: what is left is swept, and the next build is whole."""
    mark = tmp_path / "mark"
    hang = f"touch {mark}; exec sleep 300"
    cc, _ = compiler(tmp_path, hang if when == "before" else f'gcc "$@"; {hang}')
    with build(cc, tmp_path / "out") as builder:
        wait_for(mark.exists)
        os.killpg(builder.pid, signal.SIGKILL)
        builder.communicate()
    assert builder.returncode == -signal.SIGKILL
    assert entries() == []
    assert len(attempts(cache)) >= 1
    assert not (tmp_path / "out" / "pendulum.fmu").exists()
    compiler(tmp_path)  # the same command, which works now
    with build(cc, tmp_path / "out") as builder:
        builder.communicate(timeout=HANGS)
    assert builder.returncode == 0
    assert len(entries()) == 1
    for folder in attempts(cache):
        os.utime(folder, (0.0, 0.0))
    assert run("cache", "prune").code == 0
    assert len(entries()) == 1


@pytest.mark.parametrize("by", [signal.SIGTERM, signal.SIGINT])
def test_a_build_that_is_ended_leaves_no_compiler_and_no_attempt(
    cache: Path, tmp_path: Path, by: signal.Signals
) -> None:
    mark = tmp_path / "mark"
    cc, _ = compiler(tmp_path, f"echo $$ > {mark}.new; mv {mark}.new {mark}; exec sleep 300")
    with build(cc, tmp_path / "out") as builder:
        wait_for(mark.exists)
        os.kill(builder.pid, by)
        builder.communicate(timeout=HANGS)
    assert builder.returncode != 0
    wait_for(lambda: not Path("/proc", mark.read_text().strip()).exists())
    assert entries() == []
    assert attempts(cache) == []


# Whatever loads code, lists or clears a cache takes nothing that another user could have put there.


def test_a_foreign_entry_is_not_taken(copied: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = product("pendulum")
    with monkeypatch.context() as patch:
        give_away(file, patch)
        refuses(FOREIGN, write_unit, tmp_path)
    assert file.is_file()  # nothing of another user is removed


def test_a_pickle_names_code_that_is_looked_at(copied: Path, tmp_path: Path) -> None:
    """A module that is loaded in another process is the file that was built, or nothing."""
    code = "import pickle, sys, numpy as np\nprint(pickle.load(open(sys.argv[1], 'rb')).rhs(0.0, np.ones(2)).shape)"
    (tmp_path / "module").write_bytes(pickle.dumps(eg.load(PENDULUM).compile(optimize=0)))
    command = [sys.executable, "-c", code, str(tmp_path / "module")]
    assert subprocess.run(command, capture_output=True, text=True, check=True).stdout == "(2,)\n"
    (entry,) = entries("model")
    file = next(Path(entry["directory"]).glob("*.so"))
    aside = file.with_name("aside")
    file.rename(aside)  # it is mapped into this process
    file.write_bytes(aside.read_bytes()[:-1] + b"?")
    file.chmod(0o700)
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert "damaged" in done.stderr
    assert "compile the model again" in done.stderr


@pytest.mark.parametrize("verb", ["clear", "prune"])
def test_nothing_is_removed_through_a_foreign_cache(
    cache: Path, tmp_path: Path, verb: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    victim = tmp_path / "victim"
    (victim / "precious").mkdir(parents=True)
    cache.mkdir(mode=0o700)
    for name in ("entries", "attempts", "templates"):
        (cache / name).symlink_to(victim)
        give_away(cache / name, monkeypatch)
    refused = run("cache", verb)
    assert refused.code == 3
    assert "belongs" in refused.err
    assert (victim / "precious").is_dir()
    assert run("cache", "list").code == 0


# Loaded models.

MEMORY = """
import gc, sys
import numpy as np
import eomgen as eg
def once(k):
    model = eg.Model("thrown_away")
    body = model.body("b", mass=1.0 + 0.01 * k, com=(0, -1, 0))
    model.revolute("j", model.ground, body, coordinate="theta")
    module = model.compile(target="numpy")
    module.mass_matrix(np.zeros(1))
    return module.rhs(0.0, [0.1, 0.2])[1]
for k in range(115):
    once(k)
    if k in (14, 114):
        gc.collect()
        print(int(open("/proc/self/statm").read().split()[1]) * 4096 / 1e6)
print(sum("thrown" in name for name in sys.modules))
"""


def test_models_of_numpy_that_are_thrown_away_leave_nothing() -> None:
    """Megabytes a model, after those that load parts of eomgen; 0.06 if they were kept."""
    done = subprocess.run([sys.executable, "-c", MEMORY], capture_output=True, text=True, check=True)
    early, late, left = done.stdout.split()
    assert int(left) == 0
    assert (float(late) - float(early)) / 100 < 0.02
