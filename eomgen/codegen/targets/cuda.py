"""Target cuda: Program -> one text of device code: the C functions as they are, batches and ensembles around them.

Nothing is included from outside, so that NVRTC needs no headers.  Each kernel is compiled only where a macro
``EOMGEN_WANT_...`` asks for it.  The package around the text compiles it and runs it through cuda-core.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ...errors import cannot
from ...runtime.device import CUDA_REQUIREMENTS, TIMED_ON_DEVICE, DeviceModule
from ...runtime.runs.events import GO_ON, RESET, crowd_of
from ...toolchain.layer import read_layer, read_sources
from ...toolchain.targets import DEVICE_KERNELS
from ..c import count_constants, emit_c
from ..c_functions import used_calls
from ..c_text import print_block
from ..files import example_state, render
from ..package import folders_of, include
from ..pair_sums import refuse_sums
from ..program import Block, KernelDriver, Program
from ..statements import cut

if TYPE_CHECKING:
    from ...runtime.device import Device

#: Methods of ensembles: rows of n numbers that each needs in K and F.
METHODS = {"dop853": 15 + 7, "rk4": 4 + 3}
_FUNCTION = re.compile(r"^static (int|flag|void|double) ", re.MULTILINE)
_OF_STEPPERS = re.compile(r"^(int|void|double) (?=eomgen_\w+\([^;]*$)", re.MULTILINE)
_INCLUDE = re.compile(r'^#include\s+(?:"([^"]+)"|<[^>]+>)[^\n]*\n', re.MULTILINE)

#: What a package carries of eomgen, unchanged.
CONTENTS = ("errors.py", "base", "runtime")


def emit_device_text(program: Program) -> str:
    """The text of ``<name>.cu``, with the kernels :data:`~eomgen.toolchain.targets.DEVICE_KERNELS`.

    Raises UsageError (the model calls functions in C, which may use what a device does not have).
    """
    refuse_sums(program, "target 'cuda'")
    native = [f.name for f, _ in used_calls(program).values() if f.native is not None]
    if native:
        raise cannot(
            f"target 'cuda': function {', '.join(native)} is C code, which may need what a device does not have; "
            "give a table or an expression"
        )
    unrolled = replace(program, limits=replace(program.limits, rolled=sys.maxsize))  # threads have little memory
    sources = dict(emit_c(unrolled, lanes=False, separate=False))
    texts = {**sources, **read_layer(), "eomgen_methods.h": read_sources(["steppers/runge_kutta"])}
    texts["steppers"] = read_sources(["steppers/control", "steppers/loop", "ensembles/ensembles"])
    there: set[str] = set()
    model = _flattened([name for name in sources if name.endswith(".c")], texts, there)
    header = _flattened(["eomgen_real.h", "eomgen_steppers.h"], texts, there)
    methods, steppers = (_flattened([name], texts, there) for name in ("eomgen_methods.h", "steppers"))
    if program.metadata.get("events"):  # all in one takes NVRTC a minute
        steppers = _OF_STEPPERS.sub(r"EOMGEN_APART \1 ", steppers)
    if program.drivers:  # which call each other in many places; a tree's rhs is inlined, so that it runs in registers
        model = _FUNCTION.sub(r"static EOMGEN_APART \1 ", model)
    return render(
        "cuda/model.cu.j2", _context(program) | {"model": model, "header": header, "own": methods, "steppers": steppers}
    )


def describe_device(program: Program) -> dict[str, Any]:
    """What a program in Python has to know of the text: kernels with their arguments and shapes, lengths, methods."""
    return {
        "name": program.name,
        "n_const": count_constants(program, print_block(program, program.precompute)),
        "kernels": {k.name: ([list(port) for port in k.arguments.items()], list(k.shape)) for k in _kernels(program)},
        "methods": list(METHODS) if _no_runs(program) == "" else [],
        "no_runs": _no_runs(program),
        "x0": example_state(program),
    }


def _kernels(program: Program) -> list[Block | KernelDriver]:
    return [k for k in program.kernels if k.n_out and k.name in DEVICE_KERNELS]


def _no_runs(program: Program) -> str:
    """Why there are no ensembles; empty if there are."""
    metadata = program.metadata
    if "rhs" not in {k.name for k in program.kernels}:
        return "the model has no equations of motion"
    if metadata.get("signals"):
        return f"input {', '.join(metadata['signals'])} varies over time in the model; inputs are constant there"
    impacts = [event["name"] for event in metadata.get("events", ()) if event.get("restitution") is not None]
    if impacts:
        return f"event {', '.join(impacts)} is an impact, which needs Python"
    return ""


def _context(program: Program) -> dict[str, Any]:
    metadata, sizes = program.metadata, program.sizes
    events = [
        {
            "direction": int(event.get("direction") or 0),
            "action": RESET if event.get("resets") else GO_ON,
            "most": int(event.get("terminal") or 0),
        }
        for event in metadata.get("events", ())
    ]
    resets = metadata.get("resets", [])
    name, projects = program.name, bool(sizes.n_c or program.quaternion_slots)
    kernels = []
    for k in _kernels(program):
        ports = list(k.arguments.items())
        starts = [sum(length for _, length in ports[:i]) for i in range(len(ports))]
        one = {"name": k.name, "n_in": k.n_in, "n_out": k.n_out, "ports": ports, "starts": starts}
        kernels.append(one | {"work": _work(program, {k.name})})
    return {
        "name": name,
        "prefix": name.upper(),
        "metadata": metadata,
        "kernels": kernels,
        "runs": not _no_runs(program),
        "events": events,
        "resets": resets,
        "crowd": crowd_of([event["action"] for event in events]),
        "project": projects,
        "resets_call": f"{name}_resets" if resets else "known_rhs",
        "project_call": f"{name}_project" if projects else "known_rhs",
        "work": _work(program, {"rhs", *(("events", "resets", "project") if events else ())}),
        "methods": [{"name": method, "rows": rows} for method, rows in METHODS.items()],
    }


def _work(program: Program, names: set[str]) -> str:
    """Length of the work array of some kernels: every thread has one, so no longer than they need."""
    used = [k for k in program.kernels if k.name in names]
    if not all(isinstance(k, Block) for k in used):
        return f"{program.name.upper()}_N_WORK"
    lengths = (
        cut(program.graph, k.outputs, k.checks, program.parameter_only, program.limits.statements).work
        for k in used
        if isinstance(k, Block)
    )
    return str(max(lengths, default=0))


def _flattened(files: Iterable[str], texts: Mapping[str, str], there: set[str]) -> str:
    """Texts in a row with what they include in its place, once; headers of C are left out."""

    def inserted(match: re.Match[str]) -> str:
        return flat(match[1]) if match[1] else ""

    def flat(name: str) -> str:
        if name in there:
            return ""
        there.add(name)
        return _INCLUDE.sub(inserted, texts[name])

    return "\n".join(flat(name) for name in files)


def cuda_package(program: Program, context: dict[str, Any]) -> dict[str, str]:
    """``__init__.py``, ``<name>.cu``, and what of eomgen they need."""
    facts = describe_device(program)
    context = context | {"facts": facts, "timed": TIMED_ON_DEVICE}
    init = render("cuda/__init__.py.j2", context)
    included = include(CONTENTS, program.metadata)
    context |= {"folders": folders_of(included), "requirements": (*context["requirements"], *CUDA_REQUIREMENTS)}
    return {
        "py.typed": "",
        "__init__.py": init,
        f"{program.name}.cu": emit_device_text(program),
        "pyproject.toml": render("python/pyproject.toml.j2", context),
        "README.md": render("cuda/README.md.j2", context),
        **included,
    }


def functions(program: Program, device: Device | None = None) -> DeviceModule:
    """The functions of a model on a device, by default the first GPU: the same as the package.

    Raises
    ------
    UsageError
        The model calls functions in C; there is no such GPU.
    MissingDependencyError
        cuda-core or NVRTC is not installed.
    """
    return DeviceModule(emit_device_text(program), describe_device(program), program.metadata, device)
