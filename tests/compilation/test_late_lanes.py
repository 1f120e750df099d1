"""Lanes that are compiled when batches first need them: when that is, what they change, and what goes without them."""

from __future__ import annotations

import os
import pickle
import shutil
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
from eomgen.runtime.late import eager

OTHER = """
import sys
import numpy as np
import eomgen as eg
from eomgen.runtime.late import eager
module = eg.load(sys.argv[1]).compile()
x = np.load(sys.argv[2])
np.save(sys.argv[3], module.rhs(0.0, x))
print(eager(module.core).lane_width)
"""


def states(k: int) -> np.ndarray:
    return np.random.default_rng(k).uniform(-3.0, 3.0, (4, k))


def kinds(cache: Cache, name: str) -> list[str]:
    return sorted(entry.kind for entry in cache.entries() if entry.name == f"late_lanes_{name}")


def test_a_batch_brings_the_lanes_and_the_bits_stay(write: Any, cache: Cache) -> None:
    module = eg.load(write("batch")).compile()
    core, x = eager(module.core), states(5000)
    few = module.rhs(0.0, x[:, :100])
    module.simulate(0.1)
    assert (core.lane_width, kinds(cache, "batch")) == (1, ["extension"])
    mass = module.mass_matrix(x[:2])
    assert core.lane_width in (2, 4, 8)
    assert kinds(cache, "batch") == ["extension", "lanes"]
    np.testing.assert_array_equal(module.rhs(0.0, x)[:, :100], few)
    np.testing.assert_array_equal(module.bind({"m2": 3.0}).mass_matrix(x[:2])[..., 7],
                                  module.bind({"m2": 3.0}).mass_matrix(x[:2, 7]))  # fmt: skip
    at_once = eg.load(write("batch")).compile(lanes=core.lane_width)
    assert eager(at_once.core).lane_width == core.lane_width
    assert eager(at_once.core) is not core
    np.testing.assert_array_equal(at_once.mass_matrix(x[:2]), mass)
    without = eg.load(write("batch")).compile(lanes=0)
    np.testing.assert_array_equal(without.mass_matrix(x[:2]), mass)
    assert eager(without.core).lane_width == 1


def test_an_ensemble_brings_the_lanes(write: Any) -> None:
    module = eg.load(write("ensemble")).compile()
    runs = module.simulate_many(0.5, states(20), rtol=1e-8)
    assert eager(module.core).lane_width > 1
    at_once = eg.load(write("ensemble")).compile(lanes=eager(module.core).lane_width)
    np.testing.assert_array_equal(at_once.simulate_many(0.5, states(20), rtol=1e-8).x, runs.x)


def test_many_small_batches_bring_them_and_loops_that_pivot_have_none(write: Any, cache: Cache) -> None:
    module = eg.load(write("small")).compile()
    core, x = eager(module.core), states(50)
    for _ in range(81):  # 4,050 columns
        module.energy(x)
    module.poses(states(5000)[:2])  # has no lanes, so does not count
    assert core.lane_width == 1
    module.energy(x)
    assert core.lane_width > 1
    file = write("crank", "slider_crank")
    for method, lanes in (("augmented", False), ("embedding", True)):
        crank = eg.load(file).compile(method=method)
        crank.rhs(0.0, np.repeat(crank.x0()[:, None], 5000, axis=1))
        assert (eager(crank.core).lane_width > 1) == lanes


def test_threads_wait_for_one_build(write: Any, cache: Cache) -> None:
    module, x = eg.load(write("threads")).compile(), states(5000)
    expected = eg.load(write("threads")).compile(lanes=0).rhs(0.0, x)
    found: list[bool] = []

    def run() -> None:
        found.append(bool((module.rhs(0.0, x) == expected).all()) and eager(module.core).lane_width > 1)

    threads = [threading.Thread(target=run) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == [True] * 4
    assert kinds(cache, "threads") == ["extension", "extension", "lanes"]


def test_processes_that_need_them_at_once(write: Any, cache: Cache, tmp_path: Path) -> None:
    file, x = write("processes"), states(5000)
    module = eg.load(file).compile()
    np.save(tmp_path / "x.npy", x)
    command = [sys.executable, "-c", OTHER, str(file), str(tmp_path / "x.npy")]
    others = [
        subprocess.Popen([*command, str(tmp_path / f"{k}.npy")], stdout=subprocess.PIPE, text=True) for k in range(3)
    ]
    widths = [int(other.communicate(timeout=60)[0]) for other in others]
    assert kinds(cache, "processes") == ["extension", "lanes"]
    expected = module.rhs(0.0, x)
    assert widths == [eager(module.core).lane_width] * 3
    for k in range(3):
        np.testing.assert_array_equal(np.load(tmp_path / f"{k}.npy"), expected)


def test_a_pickled_module_has_them_too(write: Any, tmp_path: Path) -> None:
    module, x = eg.load(write("pickled")).compile(), states(5000)
    (tmp_path / "module").write_bytes(pickle.dumps(module))
    np.save(tmp_path / "x.npy", x)
    code = OTHER.replace("eg.load(sys.argv[1]).compile()", "__import__('pickle').load(open(sys.argv[1], 'rb'))")
    command = [sys.executable, "-c", code, *(str(tmp_path / name) for name in ("module", "x.npy", "y.npy"))]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    np.testing.assert_array_equal(np.load(tmp_path / "y.npy"), module.rhs(0.0, x))
    assert int(done.stdout) == eager(module.core).lane_width > 1


def goes_plainly(module: Any, reason: str) -> None:
    """A warning, once, and the right numbers."""
    x = states(5000)
    expected = np.stack([module.rhs(0.0, np.ascontiguousarray(x[:, j])) for j in range(100)], axis=1)
    with pytest.warns(
        RuntimeWarning,
        match=rf"(?s)are computed one state at a time, because their vector "
        rf"code.*{reason}",
    ):
        found = module.rhs(0.0, x)
    np.testing.assert_array_equal(found[:, :100], expected)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        np.testing.assert_array_equal(module.rhs(0.0, x), found)
        ends = module.simulate_many(0.2, x[:, :3]).x
    assert eager(module.core).lane_width == 1
    assert np.isfinite(ends).all()


def test_without_a_compiler_they_go_plainly_or_are_found(write: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    file = write("compiler")
    module = eg.load(file).compile()
    with monkeypatch.context() as patch:
        patch.setenv("CC", "/nowhere/cc")
        goes_plainly(module, "CC does not work")
    built = subprocess.run([sys.executable, "-c", OTHER.replace("np.load(sys.argv[2])", "np.zeros((4, 5000))")
                            .replace("np.save(sys.argv[3], module.rhs(0.0, x))", "module.rhs(0.0, x)"), str(file)],
                           capture_output=True, text=True, check=True)  # fmt: skip
    assert int(built.stdout) > 1
    code = (
        "import os, pickle, sys, numpy as np; module = pickle.loads(bytes.fromhex(sys.argv[1]))\n"
        "os.environ['CC'] = '/nowhere/cc'; module.rhs(0.0, np.zeros((4, 5000))); print(module.core.lane_width)"
    )
    command = [sys.executable, "-W", "error", "-c", code, pickle.dumps(module).hex()]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout == built.stdout  # what another process has built needs no compiler here


def test_in_a_cache_that_cannot_be_written_they_go_plainly(write: Any, cache: Cache) -> None:
    module = eg.load(write("read_only")).compile()
    attempts, aside = cache.root / "attempts", cache.root / "aside"
    attempts.rename(aside)
    attempts.write_text("in the way, as for any user a read-only folder is")
    try:
        goes_plainly(module, "cannot be written")
    finally:
        attempts.unlink()
        aside.rename(attempts)


def test_of_an_entry_that_is_gone_they_go_plainly(write: Any) -> None:
    module = eg.load(write("gone")).compile()
    shutil.rmtree(Path(eager(module.core).__file__).parent)
    goes_plainly(module, "gone or was changed")


def test_a_compiler_that_fails_is_quoted(write: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    compiler = tmp_path / "cc"
    gcc = find_compiler().path
    compiler.write_text(
        f'#!/bin/sh\ncase "$*" in *-DEOMGEN_LATE*) echo not today >&2; exit 1;; esac\nexec {gcc} "$@"\n'
    )
    compiler.chmod(0o755)
    monkeypatch.setenv("CC", str(compiler))
    goes_plainly(eg.load(write("fails")).compile(), "not today")


def test_functions_and_tables_are_there_in_lanes(write: Any) -> None:
    model = eg.Model("late_tables")
    points = np.linspace(-0.1, 0.1, 21)
    force = model.table("force", points, 4000 * points + 3e5 * points**3)
    model.prismatic("s", model.ground, model.body("buffer", mass=2.0), axis="x")
    model.actuator("spring", "s", -force(model.coordinate("s")))
    module = model.compile()
    x = np.random.default_rng(5).uniform(-0.15, 0.15, (2, 5000))
    found = module.rhs(0.0, x)
    assert eager(module.core).lane_width > 1
    np.testing.assert_array_equal(found[:, 17], module.rhs(0.0, x[:, 17].copy()))
    assert os.environ["EOMGEN_CACHE_DIR"] in eager(module.core).__file__


def test_native_modules_have_them_from_the_beginning(write: Any) -> None:
    module = eg.load(write("native")).compile(native=True)
    assert eager(module.core).lane_width > 1  # results of one state and of lanes may differ, so must not change midway
