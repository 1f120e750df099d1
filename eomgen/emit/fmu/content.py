"""All files of a unit but its binary: description, sources in C, documentation, the model's own facts."""

from __future__ import annotations

import html
import json
from collections.abc import Sequence
from dataclasses import replace
from hashlib import sha256
from typing import Any, NamedTuple

from ...layer import read_layer
from ...limits import runs
from ...limits.in_c import definitions
from ...program import Program
from ..c import emit_c
from ..sources import number_texts, read_template, render
from .description import describe_build, describe_model
from .variables import Variable, coordinate_of, find_exact, list_variables
from .versions import check_version, require_values

#: Sources that are the same for all models.
_COMMON = ("eomgen_fmu.c", "fmu_start.c", "fmu_events.c", "fmu_travel.c", "fmu_derivatives.c")
_STEPPERS = ("eomgen_steppers.h", "eomgen_loop.h", "eomgen_methods.h", "eomgen_steppers.c")
_METHODS = ("DOP853", "RK45", "RK23", "Radau")


class FmuFiles(NamedTuple):
    """The files of a unit.

    Attributes
    ----------
    files : dict of str to str
        Text by path in the unit; the C files and headers lie under ``sources/``.
    compiled : tuple of str
        The C files to compile, without their folder.
    """

    files: dict[str, str]
    compiled: tuple[str, ...]


def emit_fmu(program: Program, start: Sequence[float], version: str) -> FmuFiles:
    """The files of a unit.

    Parameters
    ----------
    program : Program
    start : (n_x,) sequence of float
        x where the model starts, on its constraints.
    version : {'2.0', '3.0'}
        Of FMI.

    Raises
    ------
    ModelError
        See :func:`~eomgen.emit.fmu.versions.require_values`.
    UsageError
        An unknown version.
    """
    version = check_version(version)
    require_values(program)
    program = replace(program, metadata={**program.metadata, "target": "fmu"})
    variables = list_variables(program, start)
    sources = dict(emit_c(program, lanes=False))
    facts = sources.pop("model.json")
    layer = read_layer()
    sources |= {name: layer[name] for name in _STEPPERS}
    sources |= {name: definitions(text) + text for name in _COMMON if (text := read_template(f"fmu/{name}"))}
    sources["eomgen_fmu.h"] = read_template("fmu/eomgen_fmu.h")
    face = f"fmi{version[0]}.c"
    sources[face] = read_template(f"fmu/{face}")
    token = _token(version, facts, start, sources)
    sources["fmu_model.h"] = render("fmu/fmu_model.h.j2", _model_context(program, variables, start, token))
    compiled = tuple(sorted(name for name in sources if name.endswith(".c")))
    files = {f"sources/{name}": text for name, text in sources.items()}
    experiment = {"startTime": 0.0, "stopTime": _settings(program)["end"], "tolerance": _settings(program)["rtol"]}
    files["modelDescription.xml"] = describe_model(program, version, token, variables, compiled, experiment)
    if version == "3.0":
        files["sources/buildDescription.xml"] = describe_build(program.name, compiled)
    files["resources/model.json"] = facts
    files["documentation/index.html"] = _page(program, variables)
    return FmuFiles(files, compiled)


def _token(version: str, *parts: Any) -> str:
    """What says that description and binary belong together: a digest of all that they are made of."""
    digest = sha256(json.dumps([version, *parts], default=list).encode()).hexdigest()
    return "{" + "-".join((digest[:8], digest[8:12], digest[12:16], digest[16:20], digest[20:32])) + "}"


def _settings(program: Program) -> dict[str, Any]:
    """How the model is run where nothing is said."""
    declared = {k: v for k, v in program.metadata.get("simulation", {}).items() if v is not None}
    return {"method": "DOP853", "rtol": runs.RTOL, "atol": runs.ATOL, "end": 10.0, **declared}


def _model_context(program: Program, variables: Sequence[Variable], start: Sequence[float], token: str) -> dict[str, Any]:
    metadata, sizes, settings = program.metadata, program.sizes, _settings(program)
    kernels = {k.name for k in program.kernels}
    events = metadata.get("events", [])
    atol = settings["atol"]
    follows = bool(sizes.n_h) and sizes.n_h == sizes.n_c and "kinematics" in kernels
    n_dof = sizes.n_dof if follows else 0
    width = sizes.n_x + sizes.n_v + sizes.n_u + sizes.n_p
    prefix = program.name.upper()
    nominal = [*map(_nominal(metadata), metadata["coordinate_kinds"]), *map(_nominal(metadata), metadata["velocity_kinds"])]
    free = [k for k in program.preferred][:n_dof]
    return {
        "name": program.name, "token": token,
        "method": settings["method"] if settings["method"] in _METHODS else "DOP853",
        "rtol": repr(float(settings["rtol"])), "atol": repr(float(min(atol) if isinstance(atol, list) else atol)),
        "max_step": repr(float(settings.get("max_step") or 1e300)),
        "switches": [
            ("CO_SIMULATION", 1), ("HAS_OUTPUTS", int(sizes.n_y > 0)), ("HAS_JACOBIAN", int("jacobian" in kernels)), ("HAS_PROJECT", int("project" in kernels)),
            ("HAS_KINEMATICS", int(follows)), ("N_EVENTS", sizes.n_events), ("N_RESETS", sizes.n_resets),
            ("N_U", sizes.n_u), ("N_P", sizes.n_p),
        ],
        "numbers": [
            ("N_X", sizes.n_x), ("N_Q", sizes.n_q), ("N_V", sizes.n_v), ("N_Y", sizes.n_y), ("N_DOF", n_dof),
            ("N_CONST", f"{prefix}_N_CONST"), ("N_WORK", f"{prefix}_N_WORK"),
            ("N_VALUES", max(sizes.n_y + sizes.n_p + sizes.n_u, sizes.n_y + sizes.n_events, 3 * sizes.n_events)),
            ("N_TRIAL", max(3 * n_dof + 2 * sizes.n_q + 2 * sizes.n_v, sizes.n_resets, sizes.n_x + sizes.n_v + width)),
            ("N_MATRIX", f"{max(sizes.n_x * max(sizes.n_x, sizes.n_u, sizes.n_p), sizes.n_y * width)} + {prefix}_N_CONST"),
        ],
        "tables": [
            ("START_X", number_texts(start)), ("START_U", number_texts(metadata["u_values"])),
            ("START_P", number_texts(metadata["p_values"])), ("NOMINAL", number_texts(nominal)),
        ],
        "lists": [
            ("INDEPENDENT", _whole(map(int, find_exact(program)))),
            ("FREE_Q", _whole(coordinate_of(program, k) for k in free)), ("FREE_V", _whole(free)),
            ("DIRECTION", _whole(e["direction"] for e in events)), ("MOST", _whole(int(e["terminal"]) for e in events)),
            ("RESETS", _whole(int(e["resets"]) for e in events)),
            ("RESET_OF", _whole(row[0] for row in metadata.get("resets", ()))),
            ("RESET_X", _whole(row[1] for row in metadata.get("resets", ()))),
        ],
    }  # fmt: skip


def _nominal(metadata: dict[str, Any]) -> Any:
    """Kind of a coordinate -> its typical size."""
    return lambda kind: float(metadata["length_scale"] or 1.0) if kind == "length" else 1.0


def _whole(values: Any) -> str:
    """The inside of a C initialiser of integers, which must not be empty."""
    return ", ".join(map(str, values)) or "0"


def _page(program: Program, variables: Sequence[Variable]) -> str:
    """documentation/index.html: what the model is, and its variables."""
    rows = "".join(
        f"<tr><td>{html.escape(v.name)}</td><td>{html.escape(v.unit)}</td><td>{html.escape(v.doc)}</td></tr>\n"
        for v in variables
        if v.group != "rate"
    )
    doc = html.escape(str(program.metadata.get("doc") or ""))
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{program.name}</title></head>\n'
        f"<body><h1>{program.name}</h1>\n<p>{doc}</p>\n<p>Equations of motion by method {program.metadata['method']}, "
        "generated by eomgen.  States whose initial value is a guess follow from the others so that loops are closed."
        f"</p>\n<table>\n<tr><th>variable</th><th>unit</th><th>meaning</th></tr>\n{rows}</table></body></html>\n"
    )
