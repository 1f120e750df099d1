"""Nanoseconds of one rhs: eomgen's C, the same equations in CasADi and in C by CasADi, and as compiled by JAX."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import casadi as ca
import jax
import numpy as np

import eomgen as eg
from eomgen.toolchain.compiler import find_compiler

from .call import compile_call_loop, over_kernel
from .measure import interleaved
from .models import EXAMPLES
from .report import Report, Table

TITLE = "one rhs by the targets casadi and jax"
MODELS = ("double_pendulum", "slider_crank", "quadrotor_load", "puma560")
CALLS, RUNS = 2_000, 10_000
ALIKE = 1e-10


class Case:
    """One model by every target; results are compared before they are timed."""

    def __init__(self, name: str, folder: Path) -> None:
        equations = eg.load(EXAMPLES / f"{name}.yaml").derive()
        module = equations.compile()
        self.x, self.loop = module.x0(), compile_call_loop(folder)
        address, *pointers, self.arrays = over_kernel(module, "rhs", self.x, np.empty_like(self.x))
        self.given = [address, 10 * CALLS, *pointers]
        functions, u, p = equations.to_casadi(), module.u, module.p
        x = ca.SX.sym("x", module.n_x)
        one = ca.Function("one", [x], [functions.rhs(0.0, x, u, p)], {"cse": True})
        self.virtual = one.buffer()
        generator = ca.CodeGenerator(f"{name}.c")
        generator.add(one)
        file = generator.generate(f"{folder}/")
        options = {"compiler": " ".join(find_compiler().command), "flags": ["-O2"]}
        importer = ca.Importer(file, "shell", options)
        self.compiled = ca.external("one", importer).buffer()
        traced = equations.to_jax()
        self.jit = jax.jit(lambda x: traced.rhs(0.0, x, u, p))
        self.many = jax.jit(jax.vmap(lambda x: traced.rhs(0.0, x, u, p)))
        self.states = np.tile(self.x, (RUNS, 1))
        self.out = [np.empty_like(self.x) for _ in range(2)]
        expected = module.rhs(0.0, self.x)
        for buffer, out in zip((self.virtual, self.compiled), self.out, strict=True):
            buffer[0].set_arg(0, memoryview(self.x))
            buffer[0].set_res(0, memoryview(out))
            buffer[1]()
        found = [*self.out, np.asarray(self.jit(self.x)), np.asarray(self.many(self.states))[-1]]
        self.error = max(float(np.abs(y - expected).max() / np.abs(expected).max()) for y in found)
        if not self.error < ALIKE:
            raise RuntimeError(f"{name}: the targets differ by {self.error:.1e}")

    def native(self) -> float:
        """Seconds of one evaluation in eomgen's C."""
        return float(self.loop(*self.given)) * 1e-9

    def casadi(self, buffer: Any) -> float:
        """The same of a function of CasADi, without conversions."""
        evaluate = buffer[1]
        start = perf_counter()
        for _ in range(CALLS):
            evaluate()
        return (perf_counter() - start) / CALLS

    def jax(self) -> float:
        """The same of one call of JAX's compiled function."""
        start = perf_counter()
        for _ in range(CALLS):
            result = self.jit(self.x)
        result.block_until_ready()
        return (perf_counter() - start) / CALLS

    def vmap(self) -> float:
        """The same of one of many states at once."""
        start = perf_counter()
        self.many(self.states).block_until_ready()
        return (perf_counter() - start) / RUNS


def run(quick: bool) -> Report:
    """Time every way in turns."""
    rows = []
    with TemporaryDirectory() as folder:
        for name in MODELS[:2] if quick else MODELS:
            case = Case(name, Path(folder))
            samples = interleaved(
                3 if quick else 9, native=case.native, virtual=lambda c=case: c.casadi(c.virtual),
                compiled=lambda c=case: c.casadi(c.compiled), jit=case.jax, vmap=case.vmap,
            )  # fmt: skip
            rows.append([name, *(round(s.median * 1e9) for s in samples.values()), f"{case.error:.0e}"])
    ways = ("eomgen, C", "CasADi, its own evaluation", "CasADi, its C", "JAX, one call", "JAX, vmap")
    columns = ("model", *ways, "differ by")
    notes = (
        "medians, ns of one rhs; CasADi's functions by buffers, without conversions, about 0.1 us of which is the call",
        f"JAX on the processor: jit, and vmap of {RUNS} states, per state",
    )
    return Report((Table("ns of one evaluation of rhs", columns, rows),), (), notes)
