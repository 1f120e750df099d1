"""Target fmu: Program -> a functional mock-up unit, one file, of FMI 2.0.3 or 3.0: https://fmi-standard.org.

A unit holds model exchange and co-simulation, its sources in C, and the binary for this system.
"""

from __future__ import annotations

import io
import json
import math
import platform
import re
import sys
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

from ... import __version__
from ...base.algebra import Array
from ...base.files import as_path, refuse_link, write_whole
from ...base.limits import runs
from ...base.texts import html_text, one_line
from ...errors import ModelError, Problem, bad_file, no_choice
from ...model.units import read_unit
from ...native.limits import definitions
from ...runtime.bound_model import BoundModel
from ...runtime.inputs import Forcing
from ...runtime.layout import ModelInfo, bounds_of
from ...toolchain.build import compile_sources
from ...toolchain.compiler import Options
from ...toolchain.layer import read_layer
from ...toolchain.targets import FMI_VERSIONS
from ..c import emit_c
from ..files import number_texts, own_file, read_template, render
from ..program import Program


def check_version(version: str) -> str:
    """The version in full, from '2', '2.0', '3' or '3.0'. Raises UsageError."""
    for known in FMI_VERSIONS:
        if str(version) in (known, known.partition(".")[0]):
            return known
    raise no_choice(f"there is no version {version!r} of FMI here; there are {', '.join(FMI_VERSIONS)}")


def refuse_impacts(program: Program, holder: str = "an FMU") -> None:
    """Refuse events and contacts whose impacts the generated code leaves to Python. Raises ModelError."""
    remedy = "describe the new velocities with reset, or leave the event out"
    problems = [
        Problem(f"events.{event['name']}.restitution", f"{holder} cannot hold an impact", remedy, code="EG-UNSUPPORTED")
        for event in program.metadata.get("events", ())
        if event["restitution"] is not None
    ]
    problems += [
        Problem(
            f"contacts.{name}",
            f"rigid contacts exert impulses, which {holder} cannot hold",
            "choose another law",
            code="EG-UNSUPPORTED",
        )
        for name in program.metadata.get("rigid_only", ())
    ]
    if problems:
        raise ModelError(problems)


class Variable(NamedTuple):
    """One variable."""

    name: str  #: unlike all others
    reference: int  #: its value reference; the groups stand as in templates/fmu/fmu_model.h.j2
    group: str  #: x, rate, u, p, y, time or event
    unit: str = ""
    doc: str = ""
    start: float | None = None
    bounds: tuple[float, float] = (-math.inf, math.inf)
    exact: bool = True  #: of a state: whether its start value holds; others follow from these where loops are closed
    state: int | None = None  #: of a rate: the reference of its state

    @property
    def unknown_at_start(self) -> bool:
        """Whether its initial value is calculated."""
        return self.group in ("y", "rate") or (self.group == "x" and not self.exact)


def list_variables(program: Program, start: Sequence[float]) -> list[Variable]:
    """All variables; the model starts at x = ``start``."""
    metadata, units, docs = program.metadata, program.metadata["units"], program.metadata["docs"]
    x_names, taken = metadata["x_names"], set(metadata["x_names"])
    exact, bounds = find_exact(program), bounds_of(ModelInfo.of(metadata))
    result: list[Variable] = []

    def add(name: str, group: str, unit: str, doc: str, **more: object) -> None:
        while name in taken and group != "x":
            name += "_out" if group == "y" else "_"
        taken.add(name)
        result.append(Variable(name, len(result), group, unit, doc, **more))  # type: ignore[arg-type]

    for k, name in enumerate(x_names):
        add(name, "x", units.get(name, ""), docs.get(name, ""), start=float(start[k]), exact=exact[k])
    for k, name in enumerate(x_names):
        add(f"der({name})", "rate", _rate_unit(units.get(name, "")), f"rate of {name}", state=k)
    for name, value in zip(metadata["u_names"], metadata["u_values"], strict=True):
        doc = docs.get(name, "")
        if name in metadata.get("signals", {}):
            doc = f"{doc}; its signal over time comes from outside".removeprefix("; ")
        add(name, "u", units.get(name, ""), doc, start=float(value or 0.0))
    for name, value in zip(metadata["p_names"], metadata["p_values"], strict=True):
        pair = bounds.get(name, (-math.inf, math.inf))
        add(name, "p", units.get(name, ""), docs.get(name, ""), start=float(value), bounds=pair)
    for name in metadata["y_names"]:
        add(name, "y", units.get(name, ""), docs.get(name, ""))
    add("time", "time", "s", "")
    for event in metadata.get("events", ()):
        add(f"event({event['name']})", "event", "", event["doc"])
    return result


def find_exact(program: Program) -> list[bool]:
    """Of each state, whether its start value holds: the others follow so that loops are closed."""
    sizes, independent = program.sizes, set(program.preferred)
    if not program.has_loops:
        return [True] * sizes.n_x
    places = {program.coordinate_of[k] for k in independent} if sizes.n_h else {*range(sizes.n_q)}
    return [*(k in places for k in range(sizes.n_q)), *(k in independent for k in range(sizes.n_v))]


def _rate_unit(unit: str) -> str:
    if not unit:
        return ""
    if unit == "1":
        return "1/s"
    return f"{unit}^2" if unit.endswith("/s") else f"{unit}/s"


TOOL = f"eomgen {__version__}"
_CAUSALITY = {"u": "input", "p": "parameter", "y": "output", "time": "independent"}
_BASE = {"length": "m", "mass": "kg", "time": "s", "current": "A", "temperature": "K"}
_ANGLE = re.compile(r"(/?)\s*\b(?:rad|deg)\b(?:\^(-?\d+))?")


def describe_model(program: Program, version: str, token: str, variables: Sequence[Variable], files: Sequence[str],
                   experiment: Mapping[str, float]) -> str:  # fmt: skip
    """The text of modelDescription.xml."""
    two = version == "2.0"
    about = {"fmiVersion": version, "modelName": program.name, "guid" if two else "instantiationToken": token}
    doc = one_line(str(program.metadata.get("doc") or ""))
    about |= {"description": doc} if doc else {}
    about |= {"generationTool": TOOL, "variableNamingConvention": "flat"}
    about |= {"numberOfEventIndicators": str(program.sizes.n_events)} if two else {}
    units = sorted({v.unit for v in variables if v.unit})
    logged = {"logStatusError": "what went wrong", "logAll": "everything"}
    return _text(
        _tag(
            "fmiModelDescription",
            about,
            *_kinds(program.name, two, files),
            *([_tag("UnitDefinitions", {}, *map(_unit, units))] if units else []),
            _tag("LogCategories", {}, *(_tag("Category", {"name": k, "description": v}) for k, v in logged.items())),
            _tag("DefaultExperiment", {k: repr(float(v)) for k, v in experiment.items()}),
            _tag("ModelVariables", {}, *(_variable(v, two) for v in variables)),
            _tag("ModelStructure", {}, *_structure(variables, two)),
        )
    )


def describe_build(name: str, files: Sequence[str]) -> str:
    """The text of sources/buildDescription.xml of FMI 3.0."""
    sources = _tag("SourceFileSet", {"language": "C99"}, *(_tag("SourceFile", {"name": file}) for file in files))
    build = _tag("BuildConfiguration", {"modelIdentifier": name}, sources)
    return _text(_tag("fmiBuildDescription", {"fmiVersion": "3.0"}, build))


def _tag(name: str, attributes: Mapping[str, str], *children: ElementTree.Element) -> ElementTree.Element:
    made = ElementTree.Element(name, dict(attributes))
    made.extend(children)
    return made


def _text(root: ElementTree.Element) -> str:
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _kinds(name: str, two: bool, files: Sequence[str]) -> list[ElementTree.Element]:
    """Model exchange and co-simulation, with what each can do."""
    word, plural = ("state", "") if two else ("State", "s")
    able = {"modelIdentifier": name, f"canGetAndSetFMU{word}": "true", f"canSerializeFMU{word}": "true"}
    able[f"providesDirectionalDerivative{plural}"] = "true"
    able |= {"canNotUseMemoryManagementFunctions": "true"} if two else {}
    exchange = {"completedIntegratorStepNotNeeded": "false"} if two else {"needsCompletedIntegratorStep": "true"}
    further = {"ModelExchange": exchange, "CoSimulation": {"canHandleVariableCommunicationStepSize": "true"}}

    def sources() -> list[ElementTree.Element]:
        return [_tag("SourceFiles", {}, *(_tag("File", {"name": file}) for file in files))] if two else []

    return [_tag(kind, able | more, *sources()) for kind, more in further.items()]


def _unit(text: str) -> ElementTree.Element:
    """A unit with its powers of base units and its size."""
    unit = read_unit(text)
    powers = {_BASE[k]: p for k, p in unit.dimension._asdict().items() if k in _BASE and p}
    angles = sum((-1 if slash else 1) * int(power or 1) for slash, power in _ANGLE.findall(text))
    powers |= {"rad": angles} if angles else {}
    if any(p != int(p) for p in powers.values()):
        return _tag("Unit", {"name": text})
    base = {k: str(int(p)) for k, p in powers.items()} | ({"factor": repr(unit.size)} if unit.size != 1.0 else {})
    return _tag("Unit", {"name": text}, _tag("BaseUnit", base))


def _variable(variable: Variable, two: bool) -> ElementTree.Element:
    about = {"name": variable.name, "valueReference": str(variable.reference)}
    about |= {"description": one_line(variable.doc)} if variable.doc else {}
    about["causality"] = _CAUSALITY.get(variable.group, "local")
    about["variability"] = "tunable" if variable.group == "p" else "continuous"
    initial = {"p": "exact", "x": "exact" if variable.exact else "approx"}
    initial |= dict.fromkeys(("rate", "y", "event"), "calculated")
    about |= {"initial": initial[variable.group]} if variable.group in initial else {}
    number = {"unit": variable.unit} if variable.unit else {}
    bounds = zip(("min", "max"), variable.bounds, strict=True)
    number |= {word: repr(float(bound)) for word, bound in bounds if math.isfinite(bound)}
    number |= {"start": repr(variable.start)} if variable.start is not None else {}
    number |= {} if variable.state is None else {"derivative": str(variable.state + two)}
    return _tag("ScalarVariable", about, _tag("Real", number)) if two else _tag("Float64", about | number)


def _structure(variables: Sequence[Variable], two: bool) -> list[ElementTree.Element]:
    """Which variables are outputs, rates, unknown at the start and, of FMI 3.0, event indicators."""
    groups = {
        "Output": [v for v in variables if v.group == "y"],
        "ContinuousStateDerivative": [v for v in variables if v.group == "rate"],
        "InitialUnknown": [v for v in variables if v.unknown_at_start],
        "EventIndicator": [v for v in variables if v.group == "event"],
    }
    if not two:
        return [_tag(tag, {"valueReference": str(v.reference)}) for tag, result in groups.items() for v in result]
    titles = zip(("Outputs", "Derivatives", "InitialUnknowns"), groups.values(), strict=False)
    return [
        _tag(title, {}, *(_tag("Unknown", {"index": str(v.reference + 1)}) for v in result))
        for title, result in titles
        if result
    ]


_METHODS = ("DOP853", "RK45", "Radau")  #: those that co-simulation can run; DOP853 stands for others
_NO_LIMIT = 1e300  #: (s) of a step


def run_settings(program: Program) -> dict[str, Any]:
    """How the model is run where nothing is said: method, rtol, atol, end, perhaps max_step."""
    declared = {k: v for k, v in program.metadata.get("simulation", {}).items() if v is not None}
    return {"method": "DOP853", "rtol": runs.RTOL, "atol": runs.ATOL, "end": 10.0, **declared}


def model_context(program: Program, start: Sequence[float], token: str) -> dict[str, Any]:
    """What the header is rendered with."""
    metadata, sizes, settings, prefix = program.metadata, program.sizes, run_settings(program), program.name.upper()
    kernels, atol = {k.name for k in program.kernels}, settings["atol"]
    events, resets, clocks = (metadata.get(key, []) for key in ("events", "resets", "clocks"))
    n_x, n_v, n_u, n_p, n_y = sizes.n_x, sizes.n_v, sizes.n_u, sizes.n_p, sizes.n_y
    # where loops are closed by holding the independent velocities, whose coordinates the others follow
    follows = sizes.n_h > 0 and sizes.n_h == sizes.n_c and "kinematics" in kernels
    free = list(program.preferred) if follows else []
    width = n_x + n_v + n_u + n_p
    length = float(metadata["length_scale"] or 1.0)
    kinds = [*metadata["coordinate_kinds"], *metadata["velocity_kinds"]]
    lists: dict[str, Iterable[int]] = {
        "INDEPENDENT": map(int, find_exact(program)),
        "FREE_Q": (program.coordinate_of[k] for k in free),
        "FREE_V": free,
        "DIRECTION": (event["direction"] for event in events),
        "MOST": (int(event["terminal"]) for event in events),
        "RESETS": (int(event["resets"]) for event in events),
        "RESET_OF": (row[0] for row in resets),
        "RESET_X": (row[1] for row in resets),
        "CLOCK_EVENT": (clock["event"] for clock in clocks),
        "CLOCK_COUNTER": (clock["counter"] for clock in clocks),
    }
    return {
        "name": program.name,
        "token": token,
        "method": settings["method"] if settings["method"] in _METHODS else "DOP853",
        "rtol": repr(float(settings["rtol"])),
        "atol": repr(float(min(atol) if isinstance(atol, list) else atol)),
        "max_step": repr(float(settings.get("max_step") or _NO_LIMIT)),
        "switches": {  # numbers that the preprocessor decides by
            "CO_SIMULATION": 1,
            "HAS_OUTPUTS": int(n_y > 0),
            "HAS_JACOBIAN": int("jacobian" in kernels),
            "HAS_MEETING_TIME": int("meeting_time" in kernels),
            "HAS_PROJECT": int("project" in kernels),
            "HAS_KINEMATICS": int(follows),
            "N_EVENTS": sizes.n_events,
            "N_RESETS": sizes.n_resets,
            "N_CLOCKS": len(clocks),
            "N_U": n_u,
            "N_P": n_p,
        },
        "numbers": {  # sizes of the model and of the instance's work
            "N_X": n_x,
            "N_Q": sizes.n_q,
            "N_V": n_v,
            "N_Y": n_y,
            "N_DOF": len(free),
            "N_CONST": f"{prefix}_N_CONST",
            "N_WORK": f"{prefix}_N_WORK",
            "N_VALUES": max(n_p + n_u, n_y + sizes.n_events, 3 * sizes.n_events),
            "N_TRIAL": max(3 * len(free) + 2 * sizes.n_q + 2 * n_v, sizes.n_resets, n_x + n_v + width),
            "N_MATRIX": max(n_x * max(n_x, n_u, n_p), n_y * width),
        },
        "tables": {
            "START_X": number_texts(start),
            "START_U": number_texts(metadata["u_values"]),
            "START_P": number_texts(metadata["p_values"]),
            # typical sizes of the states: 1 rad, the size of the mechanism, and their rates a second
            "NOMINAL": number_texts(length if kind == "length" else 1.0 for kind in kinds),
        },
        "lists": {name: ", ".join(map(str, values)) or "0" for name, values in lists.items()},
    }


#: Sources that are the same for all models.
_COMMON = ("eomgen_fmu.c", "fmu_runs.c")
_STEPPERS = ("eomgen_steppers.h", "eomgen_methods.h", "eomgen_steppers.c")


def emit_fmu(program: Program, start: Sequence[float], version: str) -> dict[str, str]:
    """The files of a unit that starts at x = ``start``, by path; C files and headers lie under ``sources/``.

    Raises
    ------
    ModelError
        See :func:`refuse_impacts`.
    UsageError
        An unknown version of FMI.
    """
    version = check_version(version)
    refuse_impacts(program)
    variables = list_variables(program, start)
    sources = dict(emit_c(program, lanes=False))
    facts = sources.pop("model.json")
    layer = read_layer()
    sources |= {name: layer[name] for name in _STEPPERS}
    sources |= {name: definitions(text) + text for name in _COMMON if (text := read_template(f"fmu/{name}"))}
    sources |= {name: read_template(f"fmu/{name}") for name in ("eomgen_fmu.h", "fmi_calls.h")}
    face = f"fmi{version[0]}.c"
    sources[face] = read_template(f"fmu/{face}")
    token = _token(version, facts, start, sources)
    sources["fmu_model.h"] = render("fmu/fmu_model.h.j2", model_context(program, start, token))
    compiled = tuple(sorted(name for name in sources if name.endswith(".c")))
    files = {f"sources/{name}": text for name, text in sources.items()}
    settings = run_settings(program)
    experiment = {"startTime": 0.0, "stopTime": settings["end"], "tolerance": settings["rtol"]}
    files["modelDescription.xml"] = describe_model(program, version, token, variables, compiled, experiment)
    if version == "3.0":
        files["sources/buildDescription.xml"] = describe_build(program.name, compiled)
    files["resources/model.json"] = facts
    files["documentation/index.html"] = _page(program, variables)
    return files


def _token(version: str, *parts: Any) -> str:
    """What says that description and binary belong together: a digest of all that they are made of."""
    digest = sha256(json.dumps([version, *parts], default=list).encode()).hexdigest()
    return "{" + "-".join((digest[:8], digest[8:12], digest[12:16], digest[16:20], digest[20:32])) + "}"


def _page(program: Program, variables: Sequence[Variable]) -> str:
    """documentation/index.html: what the model is, and its variables."""
    rows = "".join(
        f"<tr><td>{html_text(v.name)}</td><td>{html_text(v.unit)}</td><td>{html_text(v.doc)}</td></tr>\n"
        for v in variables
        if v.group != "rate"
    )
    doc = html_text(str(program.metadata.get("doc") or ""))
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{program.name}</title></head>\n'
        f"<body><h1>{program.name}</h1>\n<p>{doc}</p>\n<p>Equations of motion by method {program.metadata['method']}, "
        "generated by eomgen.  States whose initial value is a guess follow from the others so that loops are closed."
        f"</p>\n<table>\n<tr><th>variable</th><th>unit</th><th>meaning</th></tr>\n{rows}</table></body></html>\n"
    )


#: Folders of binaries, of FMI 2.0 and 3.0, by system and processor; elsewhere a unit holds its sources alone.
_FOLDERS = {
    ("linux", "x86_64"): ("linux64", "x86_64-linux"), ("linux", "aarch64"): (None, "aarch64-linux"),
    ("darwin", "x86_64"): ("darwin64", "x86_64-darwin"), ("darwin", "arm64"): ("darwin64", "aarch64-darwin"),
}  # fmt: skip
_WHEN = (1980, 1, 1, 0, 0, 0)  #: the same model gives the same bytes


def write_fmu(program: Program, module: BoundModel, path: str | Path | None = None, version: str = "2.0") -> Path:
    """The file of :meth:`eomgen.api.equations.Equations.write_fmu`; ``module`` has the initial state."""
    version = check_version(version)
    where = as_path("path", path if path is not None else f"{program.name}.fmu")
    if where.suffix != ".fmu":
        raise bad_file(f"the name of an FMU ends in .fmu, not as in {str(where)!r}")
    write_whole(where, fmu_bytes(program, module, version))
    return where


def generate_fmu(program: Program, module: BoundModel, directory: Path, version: str) -> Path:
    """Write ``<name>.fmu`` into a folder; see :func:`~..files.own_file`."""
    return write_fmu(program, module, own_file(directory, f"{program.name}.fmu", _is_ours), version)


def _is_ours(path: Path) -> bool:
    """Whether a file is a unit that eomgen wrote."""
    refuse_link(path)
    try:
        with zipfile.ZipFile(path) as archive, archive.open("modelDescription.xml") as description:
            return b'generationTool="eomgen ' in description.read(2000)
    except (OSError, KeyError, zipfile.BadZipFile):
        return False


def _begin_signals(program: Program, module: BoundModel) -> tuple[Program, Array]:
    """The program whose inputs start as their declared signals do, and the initial state with them."""
    if not program.metadata.get("signals"):
        return program, module.x0()
    forcing = Forcing(module.layout, None)
    forcing.attach(module)
    values = [float(u) for u in forcing(0.0, module.x0())]
    bound = module.bind(u=dict(zip(module.u_names, values, strict=True)))
    return replace(program, metadata={**program.metadata, "u_values": values}), bound.x0()


def fmu_bytes(program: Program, module: BoundModel, version: str) -> bytes:
    """The content of the file that :func:`write_fmu` writes; the same model gives the same bytes."""
    refuse_impacts(program)
    program, start = _begin_signals(program, module)
    texts = emit_fmu(program, [float(x) for x in start], version)
    files = {name: text.encode() for name, text in texts.items()}
    folder = _FOLDERS.get((sys.platform, platform.machine()), (None, None))[version == "3.0"]
    if folder is not None:
        code = {Path(name).name: text for name, text in texts.items() if name.endswith((".c", ".h"))}
        options = Options(extra=("-fvisibility=hidden",))
        library = compile_sources("library", code, program.name, options).product
        files[f"binaries/{folder}/{program.name}{library.suffix}"] = library.read_bytes()
    memory = io.BytesIO()
    with zipfile.ZipFile(memory, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in sorted(files, key=lambda name: (name != "modelDescription.xml", name)):
            entry = zipfile.ZipInfo(name, _WHEN)
            entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
            archive.writestr(entry, files[name])
    return memory.getvalue()
