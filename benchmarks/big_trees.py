"""Open chains and trees of up to 1,600 bodies: derived, compiled, called, beside straight-line text and Pinocchio."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from sys import maxsize
from time import perf_counter
from typing import Any

import numpy as np

import eomgen as eg
from eomgen import pipeline
from eomgen.codegen.c import emit_c
from eomgen.codegen.program import Limits
from eomgen.module import Module
from eomgen.toolchain.build import compile_sources
from eomgen.toolchain.compiler import Options
from eomgen.toolchain.load import load_core

from .large_loops import closed_chain, timed
from .latency import cold_cache
from .report import Limit, Report, Table
from .robot_calls import in_turns

TITLE = "open chains and trees of many bodies"
#: Bodies up to which straight-line text is compiled: at 400 it takes gcc 14 s and at 800 46 s.
STRAIGHT = 400
#: Bodies up to which there is a model in Pinocchio, whose data of 800 bodies do not fit into 16 GB.
PEER = 400


def tree(n: int) -> eg.Model:
    """A tree of n alike links in which each but the last carries three."""
    m = eg.Model("tree", gravity=(0, -9.81, 0))
    links: list[Any] = []
    for i in range(n):
        link = m.body(f"b{i}", mass=1.0, com=(0.05, 0, 0), inertia=(1e-3, 1.2e-3, 1.5e-3))
        holder = links[(i - 1) // 3].at(0.1, 0, 0) if links else m.ground
        m.revolute(f"j{i}", holder, link, axis="y" if i % 3 == 1 else "z")
        m.initial(**{f"j{i}": 0.1})
        links.append(link)
    return m


def peer(n: int, branches: int) -> tuple[Any, Any]:
    """The same in Pinocchio: its model and its data; bodies must come depth first."""
    import pinocchio as pin

    model = pin.Model()
    model.gravity.linear = np.array([0.0, -9.81, 0.0])
    body = pin.Inertia(1.0, np.array([0.05, 0.0, 0.0]), np.diag([1e-3, 1.2e-3, 1.5e-3]))
    left = [(0, 0)]
    while left:
        i, parent = left.pop()
        at = pin.SE3(np.eye(3), np.array([0.1 if i else 0.0, 0.0, 0.0]))
        joint = model.addJoint(parent, pin.JointModelRY() if i % 3 == 1 else pin.JointModelRZ(), at, f"j{i}")
        model.appendBodyToJoint(joint, body, pin.SE3.Identity())
        left += [(k, joint) for k in range(branches * i + 1, min(branches * i + branches + 1, n))]
    return model, model.createData()


def peer_call(
    names: Sequence[str], branches: int, q: np.ndarray, v: np.ndarray
) -> tuple[Callable[[], Any], np.ndarray]:
    """A call of Pinocchio's ABA at a state of ours, and its accelerations in our order."""
    import pinocchio as pin

    model, data = peer(len(names), branches)
    places = [model.joints[model.getJointId(name)].idx_v for name in names]
    a, b, nothing = np.zeros((3, len(names)))
    a[places], b[places] = q, v
    return lambda: pin.aba(model, data, a, b, nothing), pin.aba(model, data, a, b, nothing)[places]


def caller(module: Module, x: np.ndarray) -> Callable[[], Any]:
    """A call of a right-hand side into the same array."""
    rhs, out = module.rhs, np.empty_like(x)
    return lambda: rhs(0.0, x, out=out)


def measure(make: Callable[[int], eg.Model], n: int, branches: int) -> dict[str, Any]:
    """Everything of one mechanism; microseconds of calls are medians of turns."""
    model = make(n)
    start = perf_counter()
    equations = model.derive("recursive")
    found: dict[str, Any] = {"bodies": n, "derive": perf_counter() - start}
    start = perf_counter()
    modules = {"loops": equations.compile(kernels=["rhs"])}
    found["compile"] = perf_counter() - start
    program = pipeline.build(equations, "cython", ["rhs"])
    straight = replace(program, limits=replace(program.limits, rolled=maxsize))
    found["text"], sources = sum(map(len, emit_c(program).values())), emit_c(straight)
    found["straight text"] = sum(map(len, sources.values()))
    if n <= STRAIGHT:
        modules["straight"] = Module(load_core(compile_sources("model", sources, equations.name, Options())))
    x = np.random.default_rng(1).uniform(-1.0, 1.0, 2 * n)
    calls = {name: caller(module, x) for name, module in modules.items()}
    ours = modules["loops"].rhs(0.0, x)[n:]
    if n <= PEER:
        calls["peer"], theirs = peer_call(equations.kinematics.names, branches, *np.split(x, 2))
        found["difference"] = float(np.abs(ours - theirs).max() / np.abs(theirs).max())
    actions = {name: lambda count, call=call: timed(count, call) for name, call in calls.items()}
    samples = in_turns(actions, 21, 0.01)
    return found | {f"{name} us": sample.median / 1000 for name, sample in samples.items()}


def run(quick: bool) -> Report:
    """Time all in turns, with a cache that holds what all models share."""
    sizes = (16, 50) if quick else (16, 50, 100, 200, 400, 800, 1600)
    rows, limits, details = [], [], {}
    before = os.environ.get("EOMGEN_CACHE_DIR")
    with cold_cache() as environment:
        os.environ |= environment
        try:
            tree(2).derive().compile(kernels=["rhs"])
            cases = [("spatial chain", lambda n: closed_chain(n, False, True), n, 1) for n in sizes]
            cases.append(("ternary tree", tree, 40 if quick else 400, 3))
            for what, make, n, branches in cases:
                one = measure(make, n, branches)
                details[f"{what} of {n}"] = one
                rows.append([what, n, one["derive"], one["compile"], one["text"] / 1000, one["straight text"] / 1000,
                             one["loops us"], one.get("straight us"), one.get("peer us"), 1000 * one["loops us"] / n,
                             f"{one['difference']:.0e}" if "difference" in one else None])  # fmt: skip
                if "peer us" in one:
                    ratio = one["peer us"] / one["loops us"]
                    least = 2.0 if n <= 200 or branches > 1 else 1.0
                    limits.append(Limit(f"{what} of {n}, Pinocchio's ABA over ours,", ratio, least, at_least=True))
                if n >= 800:
                    limits.append(Limit(f"{what} of {n}", one["loops us"] / n, 0.2, "us a body"))
                if n == 1600:
                    limits.append(Limit(f"{what} of {n}, rhs compiled in", one["compile"], 10.0, "s"))
        finally:
            os.environ.pop("EOMGEN_CACHE_DIR")
            if before is not None:
                os.environ["EOMGEN_CACHE_DIR"] = before
    columns = ("tree", "bodies", "derive s", "compile s", "text kB", "straight kB",
               "rhs us", "straight us", "Pinocchio us", "ns a body", "difference")  # fmt: skip
    notes = (
        f"rhs alone, by `recursive`; parameters are numbers. Functions of more than {Limits().rolled:,} operations are",
        "loops over alike bodies; 'straight' is the same without loops. 'compile' is from derived equations to a",
        "loaded module, gcc included. 'difference' is that of the accelerations from",
        "Pinocchio's, relative to the largest. Pinocchio holds cubic tables, so that there is none of 800 bodies.",
    )
    return Report((Table("right-hand side", columns, rows),), tuple(limits), notes, details)
