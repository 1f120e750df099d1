"""Threads, several models in one process, several processes on one cache, killed builds, C callers."""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from children import child

from eomgen.compilation import Cache, compile_c_library, compile_sources, load_core

EXAMPLES = Path(__file__).parents[2] / "examples"
BUILD = """
import pathlib, signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored where the tests run in the background
from eomgen.compilation import compile_c_library
folder = pathlib.Path(sys.argv[1])
artifact = compile_c_library({f.name: f.read_text() for f in folder.iterdir()}, "pendulum")
print(artifact.path)
"""


def refuse(*args: object) -> None:
    raise ArithmeticError(args)


@pytest.fixture
def folder(tmp_path: Path, sources: dict[str, str]) -> Path:
    path = tmp_path / "sources"
    path.mkdir()
    for name, text in sources.items():
        (path / name).write_text(text)
    return path


@pytest.fixture
def wrapper(tmp_path: Path) -> Callable[[str], str]:
    """Makes a compiler that runs some shell lines before every compilation."""

    def make(lines: str) -> str:
        path = tmp_path / "wrapped-gcc"
        path.write_text(f'#!/bin/sh\ncase "$*" in *" -c "*)\n{lines}\n;; esac\nexec gcc "$@"\n')
        path.chmod(0o755)
        return str(path)

    return make


def start(folder: Path, compiler: str) -> AbstractContextManager[subprocess.Popen[str]]:
    command = [sys.executable, "-c", BUILD, str(folder)]
    environment = {**os.environ, "CC": compiler}
    return child(command, env=environment, stdout=subprocess.PIPE, text=True)


def wait_for(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 20
    while not condition():
        assert time.monotonic() < deadline, "waited 20 s in vain"
        time.sleep(0.01)


@pytest.mark.parametrize("n_work", [2000, 200], ids=["heap", "stack"])
def test_threads_share_one_callable(sources: dict[str, str], n_work: int) -> None:
    sources["pendulum.h"] = sources["pendulum.h"].replace("N_WORK 2000", f"N_WORK {n_work}")
    core = load_core(compile_sources(sources, "pendulum"))
    f = core.timed("rhs_long", core.context(), (2,), refuse)
    plain = core.timed("rhs", core.context(), (2,), refuse)
    states = np.random.default_rng(1).normal(size=(2, 8))
    expected = plain(0.0, states)

    def run(j: int) -> bool:
        x, batch, out = states[:, j].copy(), np.repeat(states[:, j : j + 1], 7, axis=1), np.empty(2)
        good = True
        for _ in range(300):
            good &= np.array_equal(f(0.0, x), expected[:, j]) and np.array_equal(f(0.0, x, out=out), expected[:, j])
            good &= np.array_equal(f(0.0, batch), np.repeat(expected[:, j : j + 1], 7, axis=1))
        return good

    with ThreadPoolExecutor(8) as pool:
        assert all(pool.map(run, range(8)))


def test_batches_let_other_threads_run(core: ModuleType) -> None:
    f = core.timed("rhs_long", core.context(), (2,), refuse)
    x, ticks, stop = np.ones((2, 50_000)), [0], threading.Event()

    def tick() -> None:
        while not stop.is_set():
            ticks[0] += 1

    thread = threading.Thread(target=tick)
    thread.start()
    before = ticks[0]
    f(0.0, x)
    after = ticks[0]
    stop.set()
    thread.join()
    assert after - before > 1000


def test_models_do_not_meet(sources: dict[str, str], core: ModuleType) -> None:
    heavier = {**sources, "pendulum.c": sources["pendulum.c"].replace('"p_values\\": [2.0', '"p_values\\": [4.0')}
    rotor = {name.replace("pendulum", "rotor"): text.replace("pendulum", "rotor") for name, text in sources.items()}
    rotor["rotor.c"] = rotor["rotor.c"].replace("sin(x[0])) / c[3]", "0.0) / c[3]")
    cores = [core, load_core(compile_sources(heavier, "pendulum")), load_core(compile_sources(rotor, "rotor"))]
    assert len({id(c) for c in cores}) == 3
    accelerations = [c.timed("rhs", c.context(), (2,), refuse)(0.0, [0.5, 0.0], u=[1.0])[1] for c in cores]
    expected = [(1 - m * 9.81 * 0.5 * s) / (m * 0.25) for m, s in ((2, np.sin(0.5)), (4, np.sin(0.5)), (2, 0.0))]
    np.testing.assert_allclose(accelerations, expected, rtol=1e-13)
    assert '"rotor"' in cores[2].metadata
    assert '"pendulum"' in cores[1].metadata


def test_one_build_is_loaded_once(sources: dict[str, str], core: ModuleType) -> None:
    assert load_core(compile_sources(sources, "pendulum")) is core


def test_functions_can_be_called_from_c(core: ModuleType) -> None:
    array = ctypes.POINTER(ctypes.c_double)
    function = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_double, array, array, array, array, array)(core.address("rhs"))
    context, x, out = core.context(), np.array([0.3, 1.5]), np.empty(2)

    def pointer(a: Any) -> Any:
        return a.ctypes.data_as(array)

    work = np.empty(core.sizes["n_work"])
    assert function(0.0, *map(pointer, (x, context.u, context.c, out, work))) == 0
    np.testing.assert_array_equal(out, core.timed("rhs", context, (2,), refuse)(0.0, x))
    with pytest.raises(KeyError, match="has no kernel"):
        core.address("lhs")
    ctypes.pythonapi.PyCapsule_GetPointer.restype = ctypes.c_void_p
    ctypes.pythonapi.PyCapsule_GetPointer.argtypes = [ctypes.py_object, ctypes.c_char_p]
    held = ctypes.pythonapi.PyCapsule_GetPointer(core.capsule("rhs"), b"eomgen_function")
    assert held == core.address("rhs")


def test_c_library_needs_no_python(sources: dict[str, str]) -> None:
    artifact = compile_c_library(sources, "pendulum")
    library = ctypes.CDLL(str(artifact.path))
    library.eomgen_model_table.restype = ctypes.POINTER(ctypes.c_int)
    assert library.eomgen_model_table()[0] == 4  # the first member of the table, its layout
    constants = (ctypes.c_double * 5)()
    assert library.pendulum_precompute((ctypes.c_double * 3)(2.0, 0.5, 10.0), constants) == 0
    assert list(constants) == [2.0, 0.5, 10.0, 0.5, 10.0]
    again = compile_c_library(sources, "pendulum")
    assert again.from_cache
    assert again.path == artifact.path


def test_warm_start_needs_neither_cython_nor_much_else(sources: dict[str, str], core: ModuleType, folder: Path) -> None:
    code = BUILD.replace("compile_c_library", "compile_sources") + (
        "from eomgen.compilation import load_core\nload_core(artifact)\nassert artifact.from_cache\n"
        "print([m for m in ('Cython', 'concurrent.futures', 'tempfile', 'sympy', 'scipy') if m in sys.modules])"
    )
    result = subprocess.run([sys.executable, "-c", code, str(folder)], capture_output=True, text=True, check=True)
    assert result.stdout.splitlines()[-1] == "[]"


def test_two_processes_build_the_same(
    folder: Path, tmp_path: Path, wrapper: Callable[[str], str], fresh_cache: Cache
) -> None:
    # Each compilation waits until the other has begun, so that both must publish.
    met = tmp_path / "met"
    met.mkdir()
    wait = f'touch {met}/$$; for i in $(seq 500); do [ "$(ls {met} | wc -l)" -ge 2 ] && break; sleep 0.02; done'
    with start(folder, wrapper(wait)) as one, start(folder, wrapper(wait)) as other:
        builders = one, other
        paths = {builder.communicate(timeout=30)[0].strip() for builder in builders}
    assert [builder.returncode for builder in builders] == [0, 0]
    assert len(list(met.iterdir())) == 2
    (entry,) = fresh_cache.entries()
    assert paths == {str(entry.product)}
    assert list((fresh_cache.root / "attempts").iterdir()) == []


@pytest.mark.parametrize(
    "lines", ["touch {mark}; exec sleep 30", 'gcc "$@"; touch {mark}; exec sleep 30'], ids=["early", "late"]
)
def test_killed_build_leaves_only_something_to_sweep(
    folder: Path, tmp_path: Path, wrapper: Callable[[str], str], fresh_cache: Cache, sources: dict[str, str], lines: str
) -> None:
    mark = tmp_path / "mark"
    with start(folder, wrapper(lines.format(mark=mark))) as builder:
        wait_for(mark.exists)
        os.killpg(builder.pid, signal.SIGKILL)
        builder.communicate()
    assert fresh_cache.entries() == []
    assert list((fresh_cache.root / "entries").iterdir()) == []
    assert len(list((fresh_cache.root / "attempts").iterdir())) == 1
    assert not compile_c_library(sources, "pendulum").from_cache
    assert len(fresh_cache.entries()) == 1
    assert fresh_cache.sweep() == 0  # too young
    assert fresh_cache.sweep(grace=0) == 1
    assert compile_c_library(sources, "pendulum").from_cache


@pytest.mark.parametrize("by", ["library", "command"])
def test_an_ended_build_leaves_no_compiler(
    folder: Path, tmp_path: Path, wrapper: Callable[[str], str], fresh_cache: Cache, by: str
) -> None:
    """SIGTERM reaches one process alone; its compilers run in groups of their own."""
    mark = tmp_path / "mark"
    compiler = wrapper(f"echo $$ > {mark}.new; mv {mark}.new {mark}; exec sleep 60")
    if by == "library":
        running = start(folder, compiler)
    else:
        command = [sys.executable, "-m", "eomgen", "run", str(EXAMPLES / "pendulum.yaml")]
        running = child(command, env={**os.environ, "CC": compiler}, stdout=subprocess.PIPE, text=True)
    with running as builder:
        wait_for(mark.exists)
        os.kill(builder.pid, signal.SIGTERM)
        builder.communicate(timeout=20)
    assert builder.returncode == 143
    wait_for(lambda: not Path("/proc", mark.read_text().strip()).exists())
    assert list((fresh_cache.root / "attempts").iterdir()) == []


def test_interrupted_build_cleans_up(
    folder: Path, tmp_path: Path, wrapper: Callable[[str], str], fresh_cache: Cache
) -> None:
    mark = tmp_path / "mark"
    with start(folder, wrapper(f"touch {mark}; exec sleep 30")) as builder:
        wait_for(mark.exists)
        os.killpg(builder.pid, signal.SIGINT)
        builder.communicate(timeout=20)
    assert builder.returncode != 0
    assert fresh_cache.entries() == []
    assert list((fresh_cache.root / "attempts").iterdir()) == []
