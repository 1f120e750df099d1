"""Whatever loads code, lists or clears a cache: none of it takes what another user could have put there."""

from __future__ import annotations

import gc
import os
import pickle
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foreign import give_away

import eomgen as eg
from eomgen.cli.command import run_command
from eomgen.cli.verb_doctor import _cache
from eomgen.compilation import Cache, compile_c_library, compile_sources, load_core
from eomgen.compilation.late_lanes import find_lanes
from eomgen.ensembles.handle import describe
from eomgen.errors import ToolchainError
from eomgen.runtime.late import eager

EXAMPLE = Path(__file__).parents[2] / "examples" / "two_link_manipulator.yaml"
FOREIGN = "belongs to another user"


@pytest.fixture
def pendulum(tmp_path: Path) -> Callable[..., Any]:
    """Compiles a model whose code no other test has."""

    def compiled(name: str, **options: Any) -> Any:
        file = tmp_path / f"{name}.yaml"
        file.write_text(EXAMPLE.read_text().replace("two_link_manipulator", f"foreign_{name}"))
        return eg.load(file).compile(**options)

    return compiled


def code(module: Any) -> Path:
    return Path(eager(module.core).__file__)


def test_a_module_is_looked_at_when_it_is_loaded(sources: dict[str, str], monkeypatch: pytest.MonkeyPatch) -> None:
    artifact = compile_sources({**sources, "unused.h": "/* looked at */\n"}, "pendulum")
    give_away(artifact.path, monkeypatch)  # after it was found
    with pytest.raises(ToolchainError, match=f"the file {artifact.path} .*{FOREIGN}"):
        load_core(artifact)
    assert artifact.path.is_file()  # nothing of another user is removed


@pytest.mark.parametrize("target", ["cython", "numpy"])
def test_a_pickle_names_code_that_is_looked_at(
    pendulum: Callable[..., Any], target: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = pendulum(f"pickled_{target}", target=target)
    data, file, name = pickle.dumps(module), code(module), eager(module.core).__name__
    del module
    gc.collect()
    loaded, aside = sys.modules.pop(name, None), file.with_name("aside")
    file.rename(aside)  # it is mapped into this process
    file.write_bytes(aside.read_bytes()[:-1] + b"?")
    file.chmod(0o700)
    with pytest.raises(ToolchainError, match=r"damaged.*compile the model again"):
        pickle.loads(data)
    aside.rename(file)
    with monkeypatch.context() as patch:
        give_away(file.parent, patch)
        with pytest.raises(ToolchainError, match=f"{file.parent} .*{FOREIGN}"):
            pickle.loads(data)
        os.chown(file.parent, os.geteuid(), -1)
    if loaded is not None:
        sys.modules[name] = loaded
    assert pickle.loads(data).rhs(0.0, np.zeros(4)).shape == (4,)


def test_workers_are_told_of_sound_sources_only(pendulum: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> None:
    module = pendulum("handle")
    assert "foreign_handle.c" in describe(module).recipe
    source = code(module).parent / "sources" / "foreign_handle.c"
    text = source.read_text()
    source.write_text(text.replace("double", "float ", 1))
    with pytest.raises(ToolchainError, match="damaged"):
        describe(module)
    source.write_text(text)
    give_away(source, monkeypatch)
    with pytest.raises(ToolchainError, match=FOREIGN):
        describe(module)


def test_lanes_are_not_taken_from_others(pendulum: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> None:
    file = code(pendulum("lanes"))
    give_away(file.parent / "manifest.json", monkeypatch)
    with pytest.warns(RuntimeWarning, match=f"one state at a time.*{FOREIGN}"):
        assert find_lanes(file) == 0


def test_the_numpy_target_goes_on_without_a_foreign_cache(
    pendulum: Callable[..., Any], fresh_cache: Cache, monkeypatch: pytest.MonkeyPatch
) -> None:
    fresh_cache.root.mkdir(mode=0o700)
    give_away(fresh_cache.root, monkeypatch)
    module = pendulum("alone", target="numpy")
    assert module.rhs(0.0, np.zeros(4)).shape == (4,)
    assert str(fresh_cache.root) not in str(code(module))
    with pytest.raises(ToolchainError, match=FOREIGN):
        pendulum("alone_too")


@pytest.mark.parametrize("verb", ["clear", "prune"])
def test_nothing_is_removed_through_a_foreign_cache(
    sources: dict[str, str], fresh_cache: Cache, tmp_path: Path, verb: str, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    victim = tmp_path / "victim"
    (victim / "precious").mkdir(parents=True)
    fresh_cache.root.mkdir(mode=0o700)
    for name in ("entries", "attempts", "templates"):
        (fresh_cache.root / name).symlink_to(victim)
        give_away(fresh_cache.root / name, monkeypatch)
    with pytest.raises(SystemExit) as left:
        run_command(["cache", verb])
    assert left.value.code == 3
    assert FOREIGN in capsys.readouterr().err
    assert (victim / "precious").is_dir()
    assert run_command(["cache", "list"]) == 0
    finding = _cache()  # of doctor
    assert not finding.ok
    assert FOREIGN in finding.remedy


def test_a_damaged_manifest_changes_no_lanes(pendulum: Callable[..., Any]) -> None:
    """Flags and compiler of lanes that are built late come from there."""
    file = code(pendulum("flags"))
    manifest = file.parent / "manifest.json"
    manifest.write_text(manifest.read_text().replace("-ffp-contract=off", "-ffp-contract=fast"))
    with pytest.warns(RuntimeWarning, match="gone or was changed"):
        assert find_lanes(file) == 0


def test_files_that_a_loose_umask_makes_are_closed(sources: dict[str, str], fresh_cache: Cache) -> None:
    before = os.umask(0)
    try:
        artifact = compile_c_library(sources, "pendulum")
    finally:
        os.umask(before)
    paths = [fresh_cache.root, *fresh_cache.root.rglob("*")]
    assert artifact.path in paths
    assert [path for path in paths if path.stat().st_mode & 0o022] == []
    assert compile_c_library(sources, "pendulum").from_cache


def test_a_read_only_cache_of_root_serves(
    sources: dict[str, str], fresh_cache: Cache, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What root owns, and nobody else writes, any user takes; a new build needs a cache of the user's own."""
    compile_c_library(sources, "pendulum")
    for path in (fresh_cache.root, *fresh_cache.root.rglob("*")):
        give_away(path, monkeypatch, 0)
        path.chmod(path.stat().st_mode & 0o555)
    monkeypatch.setattr(os, "geteuid", lambda: 54321)
    monkeypatch.setattr("eomgen.compilation.cache.os.utime", lambda *args: (_ for _ in ()).throw(PermissionError()))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert compile_c_library(sources, "pendulum").from_cache
