"""Ensembles and rigid contacts that are compiled when first asked for: when that is, and what goes without them."""

from __future__ import annotations

import pickle
import subprocess
import sys
import threading
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eomgen as eg
from eomgen.compilation import Cache, find_compiler
from eomgen.compilation.cython_layer import CONTACTS, ENSEMBLES, FIRST
from eomgen.compilation.late_classes import NAMES, _tell
from eomgen.layer import LAYER, read_layer
from eomgen.runtime.late import eager

OTHER = """
import pickle, sys
import numpy as np
from eomgen.runtime.late import eager
module = pickle.load(open(sys.argv[1], 'rb'))
np.save(sys.argv[3], module.simulate_many(0.3, np.load(sys.argv[2]), rtol=1e-8).x)
print('ensemble' in vars(eager(module.core)))
"""


def kinds(cache: Cache, name: str) -> list[str]:
    return sorted(entry.kind for entry in cache.entries() if entry.name == f"late_classes_{name}")


def starts(k: int) -> np.ndarray:
    return np.random.default_rng(k).uniform(-1.0, 1.0, (4, k))


def test_a_single_run_brings_none(warm_cache: Path, monkeypatch: pytest.MonkeyPatch, write: Any) -> None:
    monkeypatch.setenv("EOMGEN_CACHE_DIR", str(warm_cache))
    module = eg.load(write("single")).compile()
    module.simulate(0.1)
    module.rhs(0.0, starts(10))
    core = eager(module.core)
    assert not {*NAMES} & {*vars(core)}
    assert kinds(Cache(warm_cache), "single") == ["extension"]
    with pytest.raises(AttributeError, match="nonsense"):
        _ = core.nonsense
    assert kinds(Cache(warm_cache), "single") == ["extension"]


def test_an_ensemble_brings_them_once_and_its_runs_are_single_ones(write: Any, cache: Cache) -> None:
    module, x = eg.load(write("ensemble")).compile(lanes=0), starts(5)
    runs = module.simulate_many(0.3, x, rtol=1e-8)
    assert kinds(cache, "ensemble") == ["classes", "extension"]
    for k in range(5):
        alone = module.simulate(0.3, x[:, k], rtol=1e-8)
        np.testing.assert_array_equal(runs.x[:, k], alone.x[:, -1])
    assert eager(module.core).ensemble is eager(module.core).ensemble
    again = eg.load(write("ensemble")).compile(lanes=0)
    np.testing.assert_array_equal(again.simulate_many(0.3, x, rtol=1e-8).x, runs.x)
    assert kinds(cache, "ensemble") == ["classes", "extension"]


def test_each_model_has_its_own_and_parameters_reach_them(write: Any) -> None:
    one, x = eg.load(write("one")).compile(), starts(3)
    other = eg.load_example("double_pendulum").compile()
    first = one.simulate_many(0.3, x).x
    second = other.simulate_many(0.3, x).x
    assert np.abs(first - second).max() > 1e-3
    np.testing.assert_array_equal(one.simulate_many(0.3, x).x, first)
    heavier = one.simulate_many(0.3, x, parameters={"m2": 3.0}).x
    np.testing.assert_allclose(heavier[:, 1], one.bind({"m2": 3.0}).simulate(0.3, x[:, 1]).x[:, -1], atol=1e-7)


def test_threads_wait_for_one_build(write: Any, cache: Cache) -> None:
    module, x = eg.load(write("threads")).compile(), starts(4)
    found: list[np.ndarray] = []
    threads = [threading.Thread(target=lambda: found.append(module.simulate_many(0.2, x).x)) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 4
    assert all((x == found[0]).all() for x in found)
    assert kinds(cache, "threads") == ["classes", "extension", "lanes"]


def test_processes_that_need_them_at_once_from_pickles(write: Any, cache: Cache, tmp_path: Path) -> None:
    module, x = eg.load(write("processes")).compile(), starts(6)
    (tmp_path / "module").write_bytes(pickle.dumps(module))
    np.save(tmp_path / "x.npy", x)
    command = [sys.executable, "-c", OTHER, str(tmp_path / "module"), str(tmp_path / "x.npy")]
    others = [
        subprocess.Popen([*command, str(tmp_path / f"{k}.npy")], stdout=subprocess.PIPE, text=True) for k in range(3)
    ]
    assert [other.communicate(timeout=120)[0] for other in others] == ["True\n"] * 3
    assert kinds(cache, "processes") == ["classes", "extension", "lanes"]
    expected = module.simulate_many(0.3, x, rtol=1e-8).x
    for k in range(3):
        np.testing.assert_array_equal(np.load(tmp_path / f"{k}.npy"), expected)


def goes_in_python(module: Any, reason: str) -> None:
    """One warning, and the right numbers."""
    x = starts(3)
    with pytest.warns(RuntimeWarning, match=rf"(?s)are computed .*cannot be compiled.*{reason}"):
        found = module.simulate_many(0.2, x, rtol=1e-10).x
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        np.testing.assert_array_equal(module.simulate_many(0.2, x, rtol=1e-10).x, found)
    for k in range(3):
        np.testing.assert_allclose(found[:, k], module.simulate(0.2, x[:, k], rtol=1e-10).x[:, -1], atol=1e-8)
    assert "ensemble" not in vars(eager(module.core))


def test_without_a_compiler_they_go_in_python(write: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    module = eg.load(write("compiler")).compile()
    monkeypatch.setenv("CC", "/nowhere/cc")
    goes_in_python(module, "CC does not work")


def test_in_a_cache_that_cannot_be_written_they_go_in_python(write: Any, cache: Cache) -> None:
    module = eg.load(write("read_only")).compile()
    attempts, aside = cache.root / "attempts", cache.root / "aside"
    attempts.rename(aside)
    attempts.write_text("in the way, as for any user a read-only folder is")
    try:
        goes_in_python(module, "cannot be written")
    finally:
        attempts.unlink()
        aside.rename(attempts)


def test_what_was_built_needs_no_compiler(write: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    file, x = write("later"), starts(4)
    expected = eg.load(file).compile().simulate_many(0.3, x, rtol=1e-8).x
    (tmp_path / "module").write_bytes(pickle.dumps(eg.load(file).compile()))
    np.save(tmp_path / "x.npy", x)
    monkeypatch.setenv("CC", "/nowhere/cc")
    command = [sys.executable, "-W", "error", "-c", OTHER, *(str(tmp_path / n) for n in ("module", "x.npy", "y.npy"))]
    assert subprocess.run(command, capture_output=True, text=True, check=True).stdout == "True\n"
    np.testing.assert_array_equal(np.load(tmp_path / "y.npy"), expected)


def test_a_library_that_cannot_be_loaded_is_not_kept(
    write: Any, cache: Cache, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A compiler that forgets the function by which the table is handed over."""
    compiler = tmp_path / "cc"
    compiler.write_text(
        f'#!/bin/sh\ncase "$*" in *"-c eomgen_handed_table.c"*) '
        f'sed -i "s/eomgen_hand_table/eomgen_lost_table/" eomgen_handed_table.c;; esac\n'
        f'exec {find_compiler().path} "$@"\n'
    )
    compiler.chmod(0o755)
    monkeypatch.setenv("CC", str(compiler))
    goes_in_python(eg.load(write("lost")).compile(), "cannot be loaded")
    assert "classes" not in kinds(cache, "lost")


def test_who_waits_at_a_terminal_is_told(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    _tell("building")
    assert capsys.readouterr().err == ""
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    _tell("building")
    assert capsys.readouterr() == ("", "eomgen: building\n")


def test_no_share_holds_what_another_is_for() -> None:
    texts = {share: share.choose(read_layer()) for share in (FIRST, ENSEMBLES, CONTACTS)}
    files = [{name for name in found if name.endswith(".c")} for found in texts.values()]
    assert set.union(*files) == {name for name in LAYER if name.endswith(".c")}
    assert sum(map(len, files)) == len(set.union(*files))
    assert "cdef class Ensemble" not in "".join(texts[CONTACTS].values())
    assert "cdef class RigidStepper" not in "".join(texts[ENSEMBLES].values())
