"""NVRTC takes the device code of every example, for GPUs that are not here; what its machine code needs."""

from __future__ import annotations

import re
from graphlib import CycleError, TopologicalSorter

import models
import pytest
from device.test_runs_on_device import bouncing

import eomgen as eg
from benchmarks.device import resources
from eomgen import pipeline
from eomgen.device.nvrtc import best_architecture, compile_device_text, compile_with_log, load_nvrtc
from eomgen.emit.cuda.device_text import emit_device_text
from eomgen.errors import MissingDependencyError, ToolchainError

EXAMPLES = sorted(path.stem for path in models.EXAMPLES.glob("*.yaml"))
BY_POINTER = re.compile(r"^\s*call[.\w]*\s+(\([^)]*\),\s*)?%", re.MULTILINE)
CALL = re.compile(r"^\s*call[.\w]*\s+(?:\([^)]*\),\s*)?(\w+)", re.MULTILINE)
QUICK = "--Ofast-compile=max"


def text_of(name: str) -> str:
    return emit_device_text(pipeline.build(eg.load(models.EXAMPLES / f"{name}.yaml").derive(), "cuda"))


@pytest.mark.slow
@pytest.mark.needs("NVRTC")
@pytest.mark.parametrize("name", EXAMPLES)
def test_every_example_compiles_to_ptx(name: str) -> None:
    text = text_of(name)
    kernels = set(re.findall(r"EOMGEN_KERNEL void (\w+)\(", text))
    assert f"{name}_rhs_batch" in kernels
    for architecture, other in (("compute_80", "rk4"), ("compute_90", "dop853")):  # runs by one of them at a time
        wanted = set(re.findall(r"EOMGEN_WANT_\w+", text)) - {f"EOMGEN_WANT_{other.upper()}"}
        code = compile_device_text(text, architecture, sorted(wanted), [QUICK])
        ptx = code.decode(errors="replace")
        assert f".target sm_{architecture[-2:]}" in ptx
        assert set(re.findall(r"\.entry (\w+)\(", ptx)) == {kernel for kernel in kernels if f"_{other}_" not in kernel}


@pytest.mark.slow
@pytest.mark.needs("NVRTC")
@pytest.mark.parametrize("method", ["DOP853", "RK4"])
def test_the_stack_of_runs_is_known_beforehand(method: str) -> None:
    """Nothing is called by a pointer, and nothing calls itself: else GPUs give 1 kB, and a run writes beyond it."""
    text = emit_device_text(pipeline.build(bouncing(True).derive(), "cuda"))
    assert BY_POINTER.search("call (retval0), %rd1, (param0), proto;")
    code = compile_device_text(text, "compute_90", ["EOMGEN_WANT_RUNS", f"EOMGEN_WANT_{method}"])
    ptx = code.decode(errors="replace")
    calls = called_by_each(ptx)
    assert f"ball_{method.lower()}_runs" in calls
    assert any("eomgen_step" in name for name in calls)
    assert not BY_POINTER.search(ptx)
    tuple(TopologicalSorter(calls).static_order())  # CycleError


def called_by_each(ptx: str) -> dict[str, set[str]]:
    """Function -> the functions that it calls, by their names in PTX."""
    parts = re.split(r"^(?:\.\w+ )*\.(?:entry|func)\s+(?:\([^)]*\)\s*)?(\w+)\s*\(", ptx, flags=re.MULTILINE)
    return {name: set(CALL.findall(body)) for name, body in zip(parts[1::2], parts[2::2], strict=True) if "{" in body}


@pytest.mark.needs("NVRTC")
def test_a_function_that_calls_itself_is_seen() -> None:
    text = (
        "__noinline__ double g(double x, int n); __noinline__ double f(double x, int n) { return n ? g(x, n) + x : x; }"
        "__noinline__ double g(double x, int n) { return n & 1 ? f(x * x, n - 1) - x : f(x, n - 2) * f(-x, n - 3); }"
        'extern "C" __global__ void h(double *x) { *x = f(*x, (int)*x); }'
    )
    calls = called_by_each(compile_device_text(text, "compute_90").decode(errors="replace"))
    with pytest.raises(CycleError):
        tuple(TopologicalSorter(calls).static_order())


@pytest.mark.slow
@pytest.mark.needs("NVRTC")
def test_a_small_tree_runs_in_registers() -> None:
    text = text_of("double_pendulum")
    code, log = compile_with_log(text, "sm_90", ["EOMGEN_WANT_RHS"], ["--ptxas-options=-v"])
    assert code.startswith(b"\x7fELF")
    registers, stack, spilled = resources(log, "double_pendulum_rhs_batch")
    assert (spilled, registers < 64, stack < 256) == (0, True, True)


@pytest.mark.needs("NVRTC")
def test_only_what_is_wanted_is_compiled() -> None:
    text = text_of("double_pendulum")
    ptx = compile_device_text(text, "compute_80", ["EOMGEN_WANT_MASS_MATRIX"], [QUICK]).decode(errors="replace")
    assert set(re.findall(r"\.entry (\w+)\(", ptx)) == {
        "double_pendulum_constants",
        "double_pendulum_mass_matrix_batch",
    }


@pytest.mark.needs("NVRTC")
def test_a_gpu_newer_than_nvrtc_gets_ptx() -> None:
    assert best_architecture((9, 0)) == "sm_90"
    newer = best_architecture((99, 0))
    assert newer.startswith("compute_")
    assert compile_device_text('extern "C" __global__ void f(double *x) { *x = 1.0; }', newer)


@pytest.mark.needs("NVRTC")
def test_an_empty_log_spoils_no_byte_of_python() -> None:
    """Python has each byte once: NVRTC wrote the end of an empty text into everybody's b" "."""
    assert compile_with_log('extern "C" __global__ void f(double *x) { *x = 1.0; }', "compute_90")[1] == ""
    assert bytes([32]) * 1 == "\N{SPACE}".encode("ascii")
    assert ord(b"a b"[1:2]) == 32


@pytest.mark.needs("NVRTC")
def test_what_nvrtc_says_is_told() -> None:
    with pytest.raises(ToolchainError, match="NVRTC could not compile for sm_90") as raised:
        compile_device_text("no C at all", "sm_90")
    assert "error" in raised.value.output


def test_a_missing_library_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "cuda", None)
    monkeypatch.setitem(sys.modules, "cuda.bindings", None)
    with pytest.raises(MissingDependencyError, match="pip install 'cuda-core>=1.0'"):
        load_nvrtc()
