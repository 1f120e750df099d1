"""Contacts of closed tracks of 40 and 320 links, and of polygons of 8 and 32 corners: text, its compilation, a call."""

from __future__ import annotations

import math
import resource
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

import eomgen as eg
from eomgen import pipeline
from eomgen.base.kernel_table import KERNELS
from eomgen.codegen.c import emit_c
from eomgen.codegen.c_pairs import pair_files
from eomgen.toolchain.compiler import Options, compile_flags, find_compiler
from eomgen.toolchain.layer import read_header

from .report import Limit, Report, Table
from .tracks import track

TITLE = "text and compilation of contacts"


def polygons(corners: int) -> eg.Model:
    """Two polygons with so many corners each."""
    m = eg.Model(f"polygons_{corners}", gravity=(0, -9.81, 0))
    shapes = []
    for k in range(2):
        body = m.body(f"b{k}", mass=1.0, inertia={"zz": 0.02})
        m.planar(f"j{k}", m.ground.at(0, 0.3 * k, 0), body)
        turns = [2.0 * math.pi * i / corners for i in range(corners)]
        points = [(0.2 * math.cos(turn), 0.16 * math.sin(turn)) for turn in turns]
        shapes.append({"shape": "polygon", "on": body, "points": points})
    m.contacts("among", shapes, law={"stiffness": 1e4, "dissipation": 0.3, "friction": 0.4, "smoothing": 1e-2})
    return m


def seconds_to_compile(sources: dict[str, str]) -> float:
    """Seconds of a processor for the files of contacts, with the flags of a module; the least of three."""
    compiler = find_compiler(None)
    flags = compile_flags(Options(), compiler, 0)
    with tempfile.TemporaryDirectory() as folder:
        headers = {name: read_header(name) for name in ("eomgen.h", "eomgen_real.h")}
        for name, text in {**headers, **sources}.items():
            (Path(folder) / name).write_text(text, encoding="utf-8")
        found = []
        for _ in range(3):
            start = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
            for name in sources:
                if "_pairs_" in name:
                    command = [*compiler.command, *flags, "-c", name, "-o", "made.o"]
                    subprocess.run(command, cwd=folder, check=True, capture_output=True)
            found.append(resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - start)
    return min(found)


def seconds_of_calls(calls: int, call: Callable[[], Any]) -> float:
    """Seconds of a processor of one of so many calls, which others lengthen less than those of a clock."""
    start = process_time()
    for _ in range(calls):
        call()
    return (process_time() - start) / calls


def row(name: str, model: eg.Model) -> list[Any]:
    """What the contacts of a model take."""
    equations = model.derive()
    contacts = pair_files(pipeline.build(equations, "c", ["rhs", "jacobian", "meeting_time", "near_pairs"]))
    sources = {**emit_c(pipeline.build(equations, "c", ["energy"])), **contacts}
    text = sum(map(len, contacts.values()))
    mod = equations.compile(kernels=[k.name for k in KERNELS if not k.late and k.name != "jacobian"])
    x = mod.x0()
    x[mod.n_q :] = 0.01 * np.sin(np.arange(mod.n_x - mod.n_q))
    x, out = mod.project(x), np.empty(mod.n_x)
    call = 1e6 * min(seconds_of_calls(20, lambda: mod.rhs(0.0, x, out=out)) for _ in range(40))
    return [name, mod.n_x, text, seconds_to_compile(sources), call]


def run(quick: bool) -> Report:
    """Measure both sizes."""
    links = (40, 80) if quick else (40, 320)
    few, many = (row(f"track of {count} links", track(count)) for count in links)
    small, large = (row(f"two polygons of {count} corners", polygons(count)) for count in (8, 32))
    head = ("model", "n_x", "text of contacts, characters", "its compilation, CPU s", "rhs, CPU us")
    limits = (
        Limit(f"text of contacts of {links[1]} links over 40", many[2] / few[2], 1.05),
        Limit(f"compilation of contacts of {links[1]} links over 40", many[3] / few[3], 1.2),
        Limit(f"a call of {links[1]} links over one of 40", many[4] / few[4], 10.0),
        Limit("text of two polygons, 32 corners over 8", large[2] / small[2], 1.05),
    )
    notes = (
        "Contacts of a track: links on the ground, on wheels and on the teeth of a sprocket; values and derivatives.",
    )
    rows = [few, many, small, large]
    return Report((Table("contacts", head, rows),), limits, notes, {"rows": rows})
