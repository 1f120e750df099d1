"""Targets c (through ctypes), cython and numpy equal the graph's own evaluator to a few ulp of the largest term.

Source: DESIGN, section 11.  Straight-line kernels are compared entry by entry: the largest term of an entry is found by
following magnitudes through the graph.  Kernels that iterate or solve (closed loops, Jacobians) have no expression of
their own: they are compared with the augmented form solved from evaluated terms, and between targets.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import judges
import models
import numpy as np
import pytest
from circular import circular_functions
from emit.library import Library, compile_library
from magnitudes import largest_terms

from eomgen import pipeline
from eomgen.emit import emit_c, emit_numpy
from eomgen.graph import evaluate

EPS = np.finfo(float).eps
FEW = 8
CASES = [
    ("double_pendulum", "lagrange"),
    ("spherical_pendulum", "embedding"),
    ("powered_arm", "embedding"),
    ("powered_arm", "lagrange"),
    ("slider_crank", "embedding"),
    ("slider_crank", "lagrange"),
    ("skewed_four_bar", "embedding"),
    ("spatial_loop", "lagrange"),
    ("andrews_squeezer", "embedding"),
]


def c_library(program: Any, folder: Path, p: np.ndarray, u: np.ndarray, change: Any = None) -> Library:
    sources = dict(emit_c(program))
    if change is not None:
        sources[f"{program.name}.c"] = change(sources[f"{program.name}.c"])
    return Library(compile_library(sources, folder), p, u)


class Targets:
    """One model in all targets, with the program they were made from."""

    def __init__(self, equations: Any, module: Callable[..., Any], name: str, method: str, folder: Path) -> None:
        self.equations = equations(name, method)
        self.program = pipeline.build(self.equations, "c")
        self.cython = module(name, method, "cython")
        self.numpy = module(name, method, "numpy")
        self.p = self.cython.p
        self.u = np.random.default_rng(0).uniform(-1, 1, self.cython.n_u)
        self.c = c_library(self.program, folder, self.p, self.u)
        self.modules = {"cython": self.cython.bind(u=self.u), "numpy": self.numpy.bind(u=self.u)}

    def values(self, ports: Sequence[str], x: np.ndarray, t: float) -> dict[str, float]:
        found = {"t": t} | dict(zip(self.program.parameters, self.p.tolist(), strict=True))
        found |= dict(zip(self.program.inputs, self.u.tolist(), strict=True))
        return found | dict(zip(ports, x.tolist(), strict=True))

    def call(self, target: str, kernel: str, x: np.ndarray, t: float) -> np.ndarray:
        """A kernel of the raw core, flat."""
        if target == "c":
            return self.c.fine(kernel, x, t)
        kernels = self.modules[target].kernels
        shape = self.cython.layout.shape(kernel)
        if kernel in ("rhs", "jacobian", "bias", "outputs"):
            return np.ravel(kernels.timed(kernel)(t, x))
        if kernel in ("inverse_dynamics", "loop_coordinates"):
            return np.ravel(kernels.motion(kernel)(*np.split(x, 3), t=t))
        return np.reshape(kernels.state(kernel)(x, t=t), int(np.prod(shape)))


@pytest.fixture(scope="module", params=CASES, ids="-".join)
def targets(
    request: pytest.FixtureRequest,
    equations: Callable[..., Any],
    module: Callable[..., Any],
    tmp_path_factory: pytest.TempPathFactory,
) -> Targets:
    return Targets(equations, module, *request.param, tmp_path_factory.mktemp("c"))


def states(targets: Targets, count: int = 3) -> list[np.ndarray]:
    return judges.random_states(targets.cython, 21, count)


def block_inputs(targets: Targets, block: Any, x: np.ndarray, random: np.random.Generator) -> np.ndarray:
    n = targets.cython.n_q
    parts = {"q": x[:n], "v": x[n:], "a": random.uniform(-4, 4, n)}
    # only a tree's `kinematics` takes other ports; there the independent coordinates are all of them
    parts |= {port.name: random.uniform(-1, 1, len(port.symbols)) for port in block.ports if port.name not in parts}
    return np.concatenate([parts[port.name] for port in block.ports]) if block.ports else np.zeros(0)


def straight(targets: Targets) -> list[Any]:
    return [b for b in targets.program.blocks if b.public and b.n_out]


def misses(targets: Targets, target: str, call: Callable[[str, np.ndarray, float], np.ndarray]) -> dict[str, float]:
    """Straight-line kernels that differ from the graph's evaluator, with the worst error in ulp of the largest term."""
    random = np.random.default_rng(5)
    wrong: dict[str, float] = {}
    for x in states(targets):
        for block in straight(targets):
            given, t = block_inputs(targets, block, x, random), 0.3
            if target != "c" and block.name in ("kinematics", "scales"):
                continue  # called with other arguments from Python; cython runs the code that c is compared by
            values = targets.values(block.inputs, given, t)
            with circular_functions(target):
                expected = np.array(evaluate(list(block.outputs), values), dtype=float)
            allowed = np.maximum(largest_terms(block.outputs, values), np.finfo(float).tiny)
            ulps = (np.abs(call(block.name, given, t) - expected) / (EPS * allowed)).max()
            if not ulps <= FEW:
                wrong[block.name] = max(ulps, wrong.get(block.name, 0.0))
    return wrong


@pytest.mark.parametrize("target", ["c", "cython", "numpy"])
def test_straight_line_kernels_equal_the_evaluator(targets: Targets, target: str) -> None:
    names = {b.name for b in straight(targets)}
    assert names >= {"mass_matrix", "bias", "inverse_dynamics", "energy", "poses"}
    assert misses(targets, target, lambda name, x, t: targets.call(target, name, x, t)) == {}


def evaluated(targets: Targets, name: str, x: np.ndarray, t: float) -> np.ndarray:
    block = next(b for b in targets.program.blocks if b.name == name)
    n = targets.cython.n_q
    given = np.concatenate([{"q": x[:n], "v": x[n:]}[port.name] for port in block.ports])
    return np.array(evaluate(list(block.outputs), targets.values(block.inputs, given, t)), dtype=float)


def test_solving_kernels_equal_a_solve_of_evaluated_terms(targets: Targets) -> None:
    """rhs and embedded_mass_matrix of loops: augmented form from evaluated M, h, C_q and gamma."""
    mod, t = targets.cython, 0.3
    n, m = mod.n_q, mod.n_rows
    for x in states(targets):
        mass = evaluated(targets, "mass_matrix", x, t).reshape(n, n)
        h = evaluated(targets, "bias", x, t)
        cond = np.linalg.cond(mass)
        if m:
            C_q = evaluated(targets, "constraint_jacobian", x, t).reshape(m, n)
            gamma = evaluated(targets, "terms", x, t)[-m:]
            a = judges.augmented(mass, h, C_q, gamma)
            here = mod.layout.independent
            B = null_basis(C_q, here)
            embedded, cond = B.T @ mass @ B, max(cond, np.linalg.cond(B.T @ mass @ B), np.linalg.cond(B))
        else:
            a, embedded = np.linalg.solve(mass, -h), mass
        for target in ("c", "cython", "numpy"):
            found = targets.call(target, "rhs", x, t)
            assert np.abs(found[:n] - x[n:]).max() <= 64 * EPS * np.abs(x[n:]).max() * max(1.0, cond)
            assert np.abs(found[n:] - a).max() <= 64 * EPS * np.abs(a).max() * max(1.0, cond)
            found = targets.call(target, "embedded_mass_matrix", x[:n], t)
            assert np.abs(found - embedded.ravel()).max() <= 64 * EPS * np.abs(embedded).max() * max(1.0, cond)
            projected = targets.call(target, "project", x, t)
            assert np.abs(projected - x).max() <= 1e-13 * max(1.0, np.abs(x).max())


def null_basis(C_q: np.ndarray, independent: np.ndarray) -> np.ndarray:
    """B (n, n_dof): columns span the null space of C_q, with the identity in the independent rows."""
    _, sizes, Vt = np.linalg.svd(C_q)
    N = Vt[int((sizes > 1e-9 * sizes[0]).sum()) :].T
    return N @ np.linalg.inv(N[independent])


def test_targets_agree_with_each_other_on_every_kernel(targets: Targets) -> None:
    """c and cython run one code: equal bits.  numpy solves with LAPACK: equal to its condition."""
    mod, t, random = targets.cython, 0.3, np.random.default_rng(6)
    n = mod.n_q
    for x in states(targets):
        cond = np.linalg.cond(mod.mass_matrix(x[:n])) if n else 1.0
        for name in ("rhs", "jacobian", "outputs", "project", "embedded_mass_matrix"):
            given = x[:n] if name == "embedded_mass_matrix" else x
            if not targets.cython.layout.shape(name)[0]:
                continue
            ours = targets.call("c", name, given, t)
            assert (targets.call("cython", name, given, t) == ours).all(), name
            other = targets.call("numpy", name, given, t)
            assert np.abs(other - ours).max() <= 1e3 * EPS * max(1.0, cond) * np.abs(ours).max(), name
        q_i, v_i = x[mod.layout.independent], x[n + mod.layout.independent]
        a_i = random.uniform(-3, 3, mod.n_dof)
        one, other = (np.array(m.kinematics(q_i, v_i, a_i, x[:n])) for m in (mod, targets.numpy))
        direct = targets.c.fine("kinematics", np.concatenate([q_i, v_i, a_i, x[:n]]), 0.0).reshape(3, n)
        for level in range(3):
            size = np.abs(one[level]).max()
            assert np.abs(one[level] - other[level]).max() <= 1e-12 * size
            assert np.abs(one[level] - direct[level]).max() <= 1e-12 * size


# a comparison that cannot fail proves nothing

NUMBER = re.compile(r"(?<![\w.\]\[])\d+\.\d+(?:e[-+]?\d+)?(?![\w.])")
PERTURBED = ("mass_matrix", "bias", "inverse_dynamics", "energy", "poses")


def perturb(text: str, start: str, end: str) -> str:
    """Change the first coefficient (not 0 or 1) of one generated function by one part in 10^6."""
    here = text.index(start)
    there = text.index(end, here)
    body = text[here:there]
    found = next(m for m in NUMBER.finditer(body) if float(m[0]) not in (0.0, 1.0))
    changed = body[: found.start()] + repr(float(found[0]) * (1 + 1e-6)) + body[found.end() :]
    return text[:here] + changed + text[there:]


@pytest.fixture(scope="module")
def compared(
    equations: Callable[..., Any], module: Callable[..., Any], tmp_path_factory: pytest.TempPathFactory
) -> Callable[[str], tuple[Targets, dict[str, float]]]:
    """A spatial loop in one target, and which kernels differ as they are."""

    @cache
    def made(target: str) -> tuple[Targets, dict[str, float]]:
        targets = object.__new__(Targets)
        targets.cython = module("spatial_loop", "embedding")
        targets.p, targets.u = targets.cython.p, targets.cython.u
        # only the kernels compared, so that the compiler has little to do
        targets.program = pipeline.build(equations("spatial_loop", "embedding"), target, kernels=PERTURBED)
        return targets, perturbed_misses(targets, target, tmp_path_factory.mktemp("plain"), lambda text: text)

    return made


def perturbed_misses(targets: Targets, target: str, folder: Path, change: Callable[[str], str]) -> dict[str, float]:
    """Kernels that differ once the text of the target has been changed."""
    if target == "c":
        return misses(targets, "c", c_library(targets.program, folder, targets.p, targets.u, change).fine)
    blocks: dict[str, Any] = {"__name__": "eomgen.perturbed", "__package__": "eomgen"}
    exec(change(emit_numpy(targets.program)["_core.py"]), blocks)  # noqa: S102 - the text of the target under test
    constants = blocks["precompute"](targets.p)
    return misses(targets, "c", lambda name, x, t: np.asarray(blocks[name](t, x, targets.u, constants)))


@pytest.mark.parametrize("kernel", PERTURBED)
@pytest.mark.parametrize("target", ["c", "numpy"])
def test_one_perturbed_coefficient_is_seen(
    compared: Callable[[str], tuple[Targets, dict[str, float]]], tmp_path: Path, target: str, kernel: str
) -> None:
    targets, unchanged = compared(target)
    assert unchanged == {}
    start, end = (f"static flag {kernel}_block(", "\n}\n") if target == "c" else (f"def {kernel}(", "    return ")
    assert set(perturbed_misses(targets, target, tmp_path, lambda text: perturb(text, start, end))) == {kernel}


def test_the_largest_term_is_found() -> None:
    """(x + 1) - x: the largest term is x, however small the result."""
    graph = models.build("pendulum").mechanism().graph
    x = graph.symbol("x")
    sizes = largest_terms([(x + 1.0) * 2.0 - x * 3.0], {"x": 1e8})
    assert sizes[0] == pytest.approx(3e8)
