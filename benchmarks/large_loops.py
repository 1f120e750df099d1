"""Closed loops beside the same mechanisms open, and rows of loops: derivation, compilation, text and one call."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from itertools import pairwise
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any
from unittest.mock import patch

import numpy as np

import eomgen as eg
from eomgen import pipeline
from eomgen.codegen.c import emit_c

from .linkages import v_engine
from .measure import work
from .models import humanoid
from .report import Limit, Report, Table
from .robot_calls import in_turns

OFF = 1e-9  #: (rad) off a closed position
TITLE = "closed loops of any size beside open trees"


def closed_chain(n: int, closed: bool, spatial: bool) -> eg.Model:
    """n alike links on hinges, their ends on ground if it is closed; hinges across each other in turn if spatial."""
    m = eg.Model("chain", gravity=(0, -9.81, 0))
    last: Any = m.ground
    for i in range(n):
        link = m.body(f"b{i}", mass=1.0, com=(0.05, 0, 0), inertia=(1e-3, 1.2e-3, 1.5e-3))
        m.revolute(f"j{i}", last, link, axis="y" if spatial and i % 3 == 1 else "z")
        last = link.at(0.1, 0, 0)
        turning = sum(1 for k in range(n) if not (spatial and k % 3 == 1))
        angle = 0.0 if spatial and i % 3 == 1 else 2 * np.pi / (turning + 1)
        (m.guess if closed else m.initial)(**{f"j{i}": angle if closed else 0.1})
    if closed:
        (m.spherical if spatial else m.revolute)("end", last, m.ground.at(0.02, 0.02, 0))
    return m


def four_bars(n: int) -> eg.Model:
    """n parallelograms in a row."""
    m = eg.Model("bars", gravity=(0, -9.81, 0))
    rod: dict[str, Any] = {"mass": 1.0, "inertia": (0.01, 0.08, 0.08)}
    cranks = [m.body(f"crank{k}", com=(0, 0.5, 0), **rod) for k in range(n + 1)]
    for k, crank in enumerate(cranks):
        m.revolute(f"A{k}", m.ground.at(k, 0, 0), crank)
        m.guess(**{f"A{k}": 0.3})
    for k in range(n):
        coupler = m.body(f"coupler{k}", com=(0.5, 0, 0), **rod)
        m.revolute(f"B{k}", cranks[k].at(0, 1, 0), coupler)
        m.guess(**{f"B{k}": -0.3})
        m.revolute(f"C{k}", coupler.at(1, 0, 0), cranks[k + 1].at(0, 1, 0))
    return m


def sliders(n: int, geared: bool) -> eg.Model:
    """n masses on springs, two of them geared."""
    m = eg.Model("sliders")
    for k in range(n):
        m.prismatic(f"s{k}", m.ground, m.body(f"b{k}", mass=1.0), axis="x")
        m.element(f"spring{k}", joint=f"s{k}", potential="length**2/2")
        m.initial(**{f"s{k}": 0.1})
    if geared:
        m.coupling("gear", {"s0": 1, "s1": -1})
    return m


def coupled_humanoid(coupled: bool) -> eg.Model:
    """The humanoid of the benchmarks, one elbow coupled with the other if so."""
    m = humanoid()
    if coupled:
        left, right = sorted(j for j in m.derive("recursive").kinematics.names if "elbow" in j)[:2]
        m.coupling("elbows", {left: 1, right: -1})
    return m


class Built:
    """A mechanism, derived and compiled, with what that took."""

    def __init__(self, make: Callable[[], eg.Model], off: float = 0.0) -> None:
        self.make = make
        self.derive = float("inf")
        self.off = off  #: how far coordinates are off the closed position where a call is to make a step

    def derived(self) -> Built:
        """Derive once more; the least time counts."""
        model = self.make()
        start = work()
        self.equations = model.derive()
        self.derive = min(self.derive, work() - start)
        return self

    def compiled(self) -> Built:
        """Compile what is derived."""
        self.method = self.equations.method
        self.text = sum(map(len, emit_c(pipeline.build(self.equations, "c")).values()))
        start = work()
        module = self.equations.compile()
        self.compile = work() - start
        x, out, rhs = module.x0(), np.empty(module.n_x), module.rhs
        off = x.copy()
        off[: module.n_q] += self.off * np.random.default_rng(0).normal(size=module.n_q)
        self.call = lambda calls: timed(calls, lambda: rhs(0.0, x, out=out))
        self.step = lambda calls: timed(calls, lambda: rhs(0.0, off, out=out))
        return self


def built(make: Callable[[], eg.Model]) -> Built:
    """Derived once and compiled."""
    return Built(make).derived().compiled()


def timed(calls: int, call: Callable[[], Any]) -> float:
    """Nanoseconds of one of so many calls."""
    start = perf_counter()
    for _ in range(calls):
        call()
    return 1e9 * (perf_counter() - start) / calls


def microseconds(**built: Built) -> dict[str, float]:
    """Of one right-hand side each, medians of turns."""
    found = in_turns({name: one.call for name, one in built.items()}, 9, 0.01)
    return {name: sample.median / 1000 for name, sample in found.items()}


def row_of_four_bars(numbers: Sequence[int]) -> list[list[Any]]:
    """A line of the table for each of so many: derived in turns, and called in turns."""
    rows = {n: Built(lambda n=n: four_bars(n), OFF) for n in numbers}
    for _ in range(3):
        for row in rows.values():
            row.derived()
    calls = {}
    for n, row in rows.items():
        row.compiled()
        calls |= {f"{n}": row.call, f"{n} with a step": row.step}
    found = in_turns(calls, 25, 0.01)
    return [
        [n, row.method, row.derive, row.compile, row.text / n / 1000,
         *(x / n / 1000 for key in (f"{n}", f"{n} with a step") for x in (found[key].median, found[key].best))]
        for n, row in rows.items()
    ]  # fmt: skip


def run(quick: bool) -> Report:
    """Measure with an empty cache."""
    with TemporaryDirectory() as folder, patch.dict(os.environ, {"EOMGEN_CACHE_DIR": folder}):
        return measured(quick)


def measured(quick: bool) -> Report:
    """Time all in turns, open beside closed."""
    limits: list[Limit] = []
    rows: list[list[Any]] = []
    for spatial in (False, True):
        for n in (10, 20) if quick else (10, 20, 50, 100, 200, 400):
            closed = built(lambda n=n, spatial=spatial: closed_chain(n, True, spatial))
            free = built(lambda n=n, spatial=spatial: closed_chain(n, False, spatial))
            us = microseconds(closed=closed, free=free)
            what = "spatial" if spatial else "planar"
            rows.append([what, n, closed.method, us["free"], us["closed"], us["closed"] / us["free"],
                         closed.text / n / 1000, closed.derive, closed.compile])  # fmt: skip
            limits.append(Limit(f"{what} chain of {n}, closed over open,", us["closed"] / us["free"], 4.0))
            if n == 100 and not spatial:
                limits.append(Limit("closed planar chain of 100,", us["closed"], 60.0, "us"))
    chains = Table("chains", ("chain", "links", "method", "open us", "closed us", "ratio", "text a link kB",
                              "derive s", "compile s"), rows)  # fmt: skip
    bars = row_of_four_bars((5, 10) if quick else (20, 40, 80, 160, 320))
    for column, what, sizes in ((2, "derive", True), (3, "compile", True), (5, "call", False), (7, "a step", False)):
        growth = max(b[column] / a[column] / (b[0] / a[0] if sizes else 1) for a, b in pairwise(bars))
        limits.append(Limit(f"four-bars: {what}, growth over that of their number,", growth, 1.3))
    limits.append(Limit(f"{bars[-1][0]} four-bars derive in", bars[-1][2], 5.0, "s"))
    rowed = Table("N four-bars in a row", ("N", "method", "derive s", "compile s", "text a loop kB",
                  "us a loop", "least", "with a step", "least"), bars)  # fmt: skip
    pairs: list[list[Any]] = []
    for what, plain, other, bound in (
        (
            "humanoid with a coupling, over without",
            lambda: coupled_humanoid(False),
            lambda: coupled_humanoid(True),
            1.6,
        ),
        ("V6 engine, turned over straight", lambda: v_engine(0), lambda: v_engine(3), 1.2),
        ("40 sliders with a gear, over without", lambda: sliders(40, False), lambda: sliders(40, True), None),
    )[2 if quick else 0 :]:
        us = microseconds(plain=built(plain), other=built(other))
        pairs.append([what, us["plain"], us["other"], us["other"] / us["plain"]])
        if bound is None:
            limits.append(Limit("40 sliders with a gear", us["other"], 1.0, "us"))
        else:
            limits.append(Limit(f"{what},", us["other"] / us["plain"], bound))
    side = Table("side by side", ("what", "first us", "second us", "ratio"), pairs)
    notes = (
        "Every parameter is a number. Calls where loops are closed make no step onto them; with a step: 1e-9 off.",
        "Derivation and compilation take CPU seconds of this process and the compilers, from an empty cache;",
        "derivation of four-bars the least of three, their calls medians of 25 turns of all, the least beside.",
        "Before articulated bodies carried the multipliers, the planar chain of 100 took 2,359 us, the humanoid with a",
        "coupling 68, the turned V6 63 to 83, 40 sliders with a gear 284; 160 four-bars took 23 s to derive.",
    )
    return Report((chains, rowed, side), tuple(limits), notes, {"chains": rows, "four-bars": bars, "pairs": pairs})
