"""The cache of compiled models: what is found again, damaged, killed, built twice at once, owned by others.

Tests with caches or compilers of their own build units of target fmu.
"""

from __future__ import annotations

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
from typing import Any

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


def product() -> Path:
    """The one library in the cache."""
    (entry,) = entries()
    (file,) = Path(entry["directory"]).glob("*.so")
    return file


def write_unit(folder: Path, model: eg.Model | None = None) -> bytes:
    """Build the unit; its bytes."""
    path = folder / "unit.fmu"
    return (model or models.build("pendulum")).derive().write_fmu(path).read_bytes()


def renamed(name: str, folder: Path, gravity: str = "9.81") -> eg.Model:
    """A pendulum whose code no other test has."""
    file = folder / f"{name}.yaml"
    file.write_text(PENDULUM.read_text().replace("name: pendulum", f"name: {name}").replace("9.81", gravity))
    return eg.load(file)


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


def test_a_second_build_compiles_nothing(cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, noted = compiler(tmp_path)
    monkeypatch.setenv("CC", str(path))
    first = write_unit(tmp_path)
    commands = noted.read_text()
    assert commands.count("\n") >= 2
    assert write_unit(tmp_path) == first
    assert noted.read_text() == commands
    (entry,) = entries()
    sources = Path(entry["directory"]) / "sources"
    assert any("pendulum" in file.name for file in sources.iterdir())
    # another model takes the object of the integrators that the first one made
    noted.write_text("")
    write_unit(tmp_path, models.build("double_pendulum"))
    assert 0 < noted.read_text().count("\n") < commands.count("\n")


def test_what_changes_the_code_changes_the_key(monkeypatch: pytest.MonkeyPatch) -> None:
    """Options, sources, and nothing else: one entry of the cache for each build that differs."""
    monkeypatch.delenv("CC", raising=False)

    def keys() -> set[str]:
        return {entry["key"] for entry in entries("model") if entry["name"] == "keyed"}

    def model(length: float = 1.0) -> eg.Model:
        m = eg.Model("keyed", gravity=(0, -9.81, 0))
        m.revolute("A", m.ground, m.body("b", mass=1.0, com=(0, -length, 0)), coordinate="theta")
        return m

    options: list[dict[str, Any]] = [
        {}, {"optimize": 0}, {"extra": ["-DEXTRA"]}, {"lanes": 0}, {"kernels": ["rhs"]},
    ]  # fmt: skip
    modules = []
    for k, given in enumerate(options):
        modules.append(model().compile(**({"kernels": ["rhs", "jacobian"]} | given)))
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


def test_damaged_entries_are_built_again(cache: Path, tmp_path: Path) -> None:
    """A library cut short, another source, half a manifest, an empty folder."""
    unit = write_unit(tmp_path)
    file = product()
    folder, content = file.parent, file.read_bytes()
    damages: list[Callable[[], Any]] = [
        lambda: file.write_bytes(content[: len(content) // 2]),
        lambda: next((folder / "sources").glob("*.c")).write_text("something else"),
        lambda: (folder / "manifest.json").write_text('{"key": '),
        lambda: (shutil.rmtree(folder), folder.mkdir()),
    ]
    for damage in damages:
        damage()
        assert write_unit(tmp_path) == unit
        assert product() == file
        assert file.read_bytes() == content
    assert attempts(cache) == []


def test_a_second_process_writes_no_sources_again(tmp_path: Path) -> None:
    """It takes the module of the first, by a note of what that was made of; another model has another."""
    code = (
        "import sys, eomgen as eg\nm = eg.load(sys.argv[1]).compile(optimize=0)\n"
        "print(m.rhs(0.0, [0.5, 0.0])[1], 'jinja2' in sys.modules, 'Cython' in sys.modules)"
    )

    def started(gravity: str) -> list[str]:
        renamed("noted", tmp_path, gravity)
        command = [sys.executable, "-c", code, str(tmp_path / "noted.yaml")]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()

    first = started("9.81")
    assert first[1] == "True"
    assert started("9.81") == [first[0], "False", "False"]
    other = started("9.82")
    assert (other[0] != first[0], other[1]) == (True, "True")
    for one in entries("model"):
        if one["name"] == "noted":
            next(Path(one["directory"]).glob("*.so")).write_bytes(b"damaged")
    assert started("9.81") == [first[0], "True", first[2]]


def test_list_prune_clear(cache: Path, tmp_path: Path) -> None:
    assert entries() == []
    assert run("cache", "clear").code == 0
    for age, name in zip((300, 200), ("pendulum", "double_pendulum"), strict=True):
        write_unit(tmp_path, models.build(name))
        listed = {entry["name"]: entry for entry in entries()}
        file = Path(listed[name]["directory"]) / "manifest.json"
        os.utime(file, (time.time() - age * 86400.0,) * 2)
    assert [entry["name"] for entry in entries()] == ["double_pendulum", "pendulum"]
    total = run("cache", "list", "--json").json
    assert total["size"] == sum(entry["size"] for kind in ("library", "object") for entry in entries(kind))
    write_unit(tmp_path)  # used again
    assert [entry["name"] for entry in entries()] == ["pendulum", "double_pendulum"]
    assert run("cache", "prune", "--older-than", "150").code == 0
    assert [entry["name"] for entry in entries()] == ["pendulum"]
    assert run("cache", "clear").code == 0
    assert run("cache", "list", "--json").json["entries"] == []
    assert write_unit(tmp_path)


def test_the_cache_is_private(cache: Path, tmp_path: Path) -> None:
    before = os.umask(0)
    try:
        write_unit(tmp_path)
    finally:
        os.umask(before)
    paths = [cache, *cache.rglob("*")]
    assert len(paths) > 10
    assert [path for path in paths if path.stat().st_mode & 0o022] == []
    for folder in (cache, product().parent.parent, product().parent):
        assert folder.stat().st_mode & 0o777 == 0o700
    cache.chmod(0o777)
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


def test_two_processes_build_the_same_at_once(cache: Path, tmp_path: Path) -> None:
    """Each compilation waits until the other process has begun, so that both come to publish."""
    met = tmp_path / "met"
    met.mkdir()
    lines = f'touch {met}/$PPID; for i in $(seq 3000); do [ "$(ls {met} | wc -l)" -ge 2 ] && break; sleep 0.02; done'
    cc, _ = compiler(tmp_path, lines)
    with build(cc, tmp_path / "one") as one, build(cc, tmp_path / "other") as other:
        for builder in (one, other):
            builder.communicate(timeout=HANGS)
    assert [one.returncode, other.returncode] == [0, 0]
    assert len(list(met.iterdir())) == 2
    assert (tmp_path / "one" / "pendulum.fmu").read_bytes() == (tmp_path / "other" / "pendulum.fmu").read_bytes()
    assert len(entries()) == 1
    assert attempts(cache) == []


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


def test_a_foreign_entry_is_not_taken(cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_unit(tmp_path)
    file = product()
    with monkeypatch.context() as patch:
        give_away(file, patch)
        refuses(FOREIGN, write_unit, tmp_path)
    assert file.is_file()  # nothing of another user is removed


def test_a_pickle_names_code_that_is_looked_at(tmp_path: Path) -> None:
    """A module that is loaded in another process is the file that was built, or nothing."""
    code = "import pickle, sys, numpy as np\nprint(pickle.load(open(sys.argv[1], 'rb')).rhs(0.0, np.ones(2)).shape)"
    module = renamed("pickled", tmp_path).compile(optimize=0)
    (tmp_path / "module").write_bytes(pickle.dumps(module))
    command = [sys.executable, "-c", code, str(tmp_path / "module")]
    assert subprocess.run(command, capture_output=True, text=True, check=True).stdout == "(2,)\n"
    (entry,) = (entry for entry in entries("model") if entry["name"] == "pickled")
    file = next(Path(entry["directory"]).glob("*.so"))
    aside = file.with_name("aside")
    file.rename(aside)  # it is mapped into this process
    file.write_bytes(aside.read_bytes()[:-1] + b"?")
    file.chmod(0o700)
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    aside.rename(file)
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
    assert FOREIGN in refused.err
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
