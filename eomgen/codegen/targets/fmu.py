"""Target fmu: Program -> a functional mock-up unit, one file, of FMI 2.0.3 or 3.0: https://fmi-standard.org.

A unit holds model exchange and co-simulation, its sources in C, and the binary for this system.
"""

from __future__ import annotations

import io
import json
import math
import os
import platform
import re
import sys
import zipfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

from ... import __version__
from ...base.algebra import Array
from ...base.files import as_path, refuse_link, write_whole
from ...base.limits import runs
from ...base.limits.in_c import definitions
from ...base.texts import html_text, one_line
from ...compilation.build import compile_c_library
from ...compilation.compiler import Options
from ...describe.units import read_unit
from ...errors import ModelError, Problem, bad_file, no_choice
from ...layer import read_layer
from ...runtime.allowed_parameters import bounds_of
from ...runtime.bound_model import BoundModel
from ...runtime.signals import Forcing
from ...targets import FMI_VERSIONS
from ..c import emit_c
from ..files import number_texts, read_template, render
from ..program import Program


def check_version(version: str) -> str:
    """The version in full, from '2', '2.0', '3' or '3.0'.

    Raises
    ------
    UsageError
    """
    for known in FMI_VERSIONS:
        if str(version) in (known, known.partition(".")[0]):
            return known
    raise no_choice(f"there is no version {version!r} of FMI here; there are {', '.join(FMI_VERSIONS)}")


def refuse_impacts(program: Program) -> None:
    """Refuse events and contacts whose impacts the generated code leaves to Python.

    Raises
    ------
    ModelError
    """
    remedy = "describe the new velocities with reset, or leave the event out"
    problems = [
        Problem(f"events.{event['name']}.restitution", "an FMU cannot hold an impact", remedy, code="EG-UNSUPPORTED")
        for event in program.metadata.get("events", ())
        if event["restitution"] is not None
    ]
    problems += [
        Problem(
            f"contacts.{name}.normal_law",
            "rigid contacts exert impulses, which an FMU cannot hold",
            "choose another normal_law",
            code="EG-UNSUPPORTED",
        )
        for name in program.metadata.get("rigid_only", ())
    ]
    if problems:
        raise ModelError(problems)


class Variable(NamedTuple):
    """One variable.

    Attributes
    ----------
    name : str
        Unlike all others.
    reference : int
        Its value reference; the groups stand as in templates/fmu/fmu_model.h.j2.
    group : {'x', 'rate', 'u', 'p', 'y', 'time', 'event'}
    unit, doc : str
    start : float or None
    bounds : pair of float
        The least and the greatest value, infinite where there is none.
    exact : bool
        Of a state: whether its start value holds; others follow from these where loops are closed.
    state : int or None
        Of a rate: the reference of its state.
    """

    name: str
    reference: int
    group: str
    unit: str = ""
    doc: str = ""
    start: float | None = None
    bounds: tuple[float, float] = (-math.inf, math.inf)
    exact: bool = True
    state: int | None = None

    @property
    def unknown_at_start(self) -> bool:
        """Whether its initial value is calculated."""
        return self.group in ("y", "rate") or (self.group == "x" and not self.exact)


def list_variables(program: Program, start: Sequence[float]) -> list[Variable]:
    """All variables.

    Parameters
    ----------
    program : Program
    start : sequence of float
        x where the model starts.
    """
    metadata, units, docs = program.metadata, program.metadata["units"], program.metadata["docs"]
    x_names, taken = metadata["x_names"], set(metadata["x_names"])
    exact, bounds = find_exact(program), bounds_of(metadata)
    found: list[Variable] = []

    def add(name: str, group: str, unit: str, doc: str, **more: object) -> None:
        while name in taken and group != "x":
            name += "_out" if group == "y" else "_"
        taken.add(name)
        found.append(Variable(name, len(found), group, unit, doc, **more))  # type: ignore[arg-type]

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
    return found


def find_exact(program: Program) -> list[bool]:
    """Of each state, whether its start value holds: the others follow so that loops are closed."""
    sizes = program.sizes
    if not program.has_loops:
        return [True] * sizes.n_x
    independent = set(program.preferred)
    of_v = [k in independent for k in range(sizes.n_v)]
    of_q = [True] * sizes.n_q
    if sizes.n_h:
        of_q = [False] * sizes.n_q
        for k in independent:
            if (place := coordinate_of(program, k)) >= 0:  # no coordinate has the rate of a turning frame
                of_q[place] = True
    return [*of_q, *of_v]


def coordinate_of(program: Program, velocity: int) -> int:
    """The coordinate that a velocity is the rate of."""
    return program.coordinate_of[velocity] if program.coordinate_of else velocity


def _rate_unit(unit: str) -> str:
    """The unit of a rate."""
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
    metadata = program.metadata
    about = {"fmiVersion": version, "modelName": program.name, "guid" if two else "instantiationToken": token}
    doc = one_line(str(metadata.get("doc") or ""))
    about |= {"description": doc} if doc else {}
    about |= {"generationTool": TOOL, "variableNamingConvention": "flat"}
    if two:
        about["numberOfEventIndicators"] = str(program.sizes.n_events)
    root = ElementTree.Element("fmiModelDescription", about)
    _add_kinds(root, program.name, two, files)
    _add_units(root, variables)
    categories = ElementTree.SubElement(root, "LogCategories")
    ElementTree.SubElement(categories, "Category", name="logStatusError", description="what went wrong")
    ElementTree.SubElement(categories, "Category", name="logAll", description="everything")
    ElementTree.SubElement(root, "DefaultExperiment", {k: repr(float(v)) for k, v in experiment.items()})
    section = ElementTree.SubElement(root, "ModelVariables")
    for variable in variables:
        (_add_scalar if two else _add_float)(section, variable)
    (_add_structure_2 if two else _add_structure_3)(root, variables)
    return _text(root)


def describe_build(name: str, files: Sequence[str]) -> str:
    """The text of sources/buildDescription.xml of FMI 3.0."""
    root = ElementTree.Element("fmiBuildDescription", fmiVersion="3.0")
    build = ElementTree.SubElement(root, "BuildConfiguration", modelIdentifier=name)
    sources = ElementTree.SubElement(build, "SourceFileSet", language="C99")
    for file in files:
        ElementTree.SubElement(sources, "SourceFile", name=file)
    return _text(root)


def _text(root: ElementTree.Element) -> str:
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _add_kinds(root: ElementTree.Element, name: str, two: bool, files: Sequence[str]) -> None:
    """Model exchange and co-simulation, with what each can do."""
    word, plural = ("state", "") if two else ("State", "s")
    able = {"modelIdentifier": name, f"canGetAndSetFMU{word}": "true", f"canSerializeFMU{word}": "true"}
    able[f"providesDirectionalDerivative{plural}"] = "true"
    able |= {"canNotUseMemoryManagementFunctions": "true"} if two else {}
    exchange = {"completedIntegratorStepNotNeeded": "false"} if two else {"needsCompletedIntegratorStep": "true"}
    tags = [
        ElementTree.SubElement(root, "ModelExchange", able | exchange),
        ElementTree.SubElement(root, "CoSimulation", able | {"canHandleVariableCommunicationStepSize": "true"}),
    ]
    for tag in tags if two else ():
        listed = ElementTree.SubElement(tag, "SourceFiles")
        for file in files:
            ElementTree.SubElement(listed, "File", name=file)


def _add_units(root: ElementTree.Element, variables: Sequence[Variable]) -> None:
    """Every unit with its powers of base units and its size."""
    units = sorted({v.unit for v in variables if v.unit})
    if not units:
        return
    section = ElementTree.SubElement(root, "UnitDefinitions")
    for text in units:
        unit = read_unit(text)
        powers = {_BASE[k]: p for k, p in unit.dimension._asdict().items() if k in _BASE and p}
        angles = sum((-1 if slash else 1) * int(power or 1) for slash, power in _ANGLE.findall(text))
        powers |= {"rad": angles} if angles else {}
        base = {k: str(int(p)) for k, p in powers.items() if p == int(p)}
        base |= {"factor": repr(unit.size)} if unit.size != 1.0 else {}
        one = ElementTree.SubElement(section, "Unit", name=text)
        if all(p == int(p) for p in powers.values()):
            ElementTree.SubElement(one, "BaseUnit", base)


def _attributes(variable: Variable) -> dict[str, str]:
    """What both versions say of a variable, but for its type."""
    given = {"name": variable.name, "valueReference": str(variable.reference)}
    given |= {"description": one_line(variable.doc)} if variable.doc else {}
    given["causality"] = _CAUSALITY.get(variable.group, "local")
    given["variability"] = "tunable" if variable.group == "p" else "continuous"
    if variable.group == "p":
        given["initial"] = "exact"
    elif variable.group == "x":
        given["initial"] = "exact" if variable.exact else "approx"
    elif variable.group in ("rate", "y", "event"):
        given["initial"] = "calculated"
    return given


def _number_attributes(variable: Variable) -> dict[str, str]:
    """Unit, bounds and start value."""
    unit = {"unit": variable.unit} if variable.unit else {}
    bounds = zip(("min", "max"), variable.bounds, strict=True)
    unit |= {word: repr(float(bound)) for word, bound in bounds if math.isfinite(bound)}
    return unit | ({"start": repr(variable.start)} if variable.start is not None else {})


def _add_scalar(section: ElementTree.Element, variable: Variable) -> None:
    of = {} if variable.state is None else {"derivative": str(variable.state + 1)}
    tag = ElementTree.SubElement(section, "ScalarVariable", _attributes(variable))
    ElementTree.SubElement(tag, "Real", _number_attributes(variable) | of)


def _add_float(section: ElementTree.Element, variable: Variable) -> None:
    of = {} if variable.state is None else {"derivative": str(variable.state)}
    ElementTree.SubElement(section, "Float64", _attributes(variable) | _number_attributes(variable) | of)


def _add_structure_2(root: ElementTree.Element, variables: Sequence[Variable]) -> None:
    structure = ElementTree.SubElement(root, "ModelStructure")
    groups = {
        "Outputs": [v for v in variables if v.group == "y"],
        "Derivatives": [v for v in variables if v.group == "rate"],
        "InitialUnknowns": [v for v in variables if v.unknown_at_start],
    }
    for title, found in groups.items():
        if found:
            section = ElementTree.SubElement(structure, title)
            for v in found:
                ElementTree.SubElement(section, "Unknown", index=str(v.reference + 1))


def _add_structure_3(root: ElementTree.Element, variables: Sequence[Variable]) -> None:
    structure = ElementTree.SubElement(root, "ModelStructure")
    for tag, found in (
        ("Output", [v for v in variables if v.group == "y"]),
        ("ContinuousStateDerivative", [v for v in variables if v.group == "rate"]),
        ("InitialUnknown", [v for v in variables if v.unknown_at_start]),
        ("EventIndicator", [v for v in variables if v.group == "event"]),
    ):
        for v in found:
            ElementTree.SubElement(structure, tag, valueReference=str(v.reference))


_METHODS = ("DOP853", "RK45", "Radau")  #: those that co-simulation can run; DOP853 stands for others
_NO_LIMIT = 1e300  #: (s) of a step


def run_settings(program: Program) -> dict[str, Any]:
    """How the model is run where nothing is said: method, rtol, atol, end, perhaps max_step."""
    declared = {k: v for k, v in program.metadata.get("simulation", {}).items() if v is not None}
    return {"method": "DOP853", "rtol": runs.RTOL, "atol": runs.ATOL, "end": 10.0, **declared}


def model_context(program: Program, start: Sequence[float], token: str) -> dict[str, Any]:
    """What the header is rendered with."""
    metadata, settings = program.metadata, run_settings(program)
    atol = settings["atol"]
    free = _free(program)
    return {
        "name": program.name,
        "token": token,
        "method": settings["method"] if settings["method"] in _METHODS else "DOP853",
        "rtol": repr(float(settings["rtol"])),
        "atol": repr(float(min(atol) if isinstance(atol, list) else atol)),
        "max_step": repr(float(settings.get("max_step") or _NO_LIMIT)),
        "switches": _switches(program, free),
        "numbers": _header_sizes(program, len(free)),
        "tables": [
            ("START_X", number_texts(start)),
            ("START_U", number_texts(metadata["u_values"])),
            ("START_P", number_texts(metadata["p_values"])),
            ("NOMINAL", number_texts(_nominal(program))),
        ],
        "lists": _lists(program, free),
    }


def _free(program: Program) -> list[int]:
    """The velocities whose coordinates the others follow, where loops are closed by holding these."""
    sizes = program.sizes
    follows = sizes.n_h > 0 and sizes.n_h == sizes.n_c and "kinematics" in {k.name for k in program.kernels}
    return list(program.preferred) if follows else []


def _switches(program: Program, free: Sequence[int]) -> list[tuple[str, int]]:
    """Numbers that the preprocessor decides by."""
    sizes, kernels = program.sizes, {k.name for k in program.kernels}
    follows = sizes.n_h > 0 and sizes.n_h == sizes.n_c and "kinematics" in kernels
    return [
        ("CO_SIMULATION", 1),
        ("HAS_OUTPUTS", int(sizes.n_y > 0)),
        ("HAS_JACOBIAN", int("jacobian" in kernels)),
        ("HAS_MEETING_TIME", int("meeting_time" in kernels)),
        ("HAS_PROJECT", int("project" in kernels)),
        ("HAS_KINEMATICS", int(follows)),
        ("N_EVENTS", sizes.n_events),
        ("N_RESETS", sizes.n_resets),
        ("N_CLOCKS", len(program.metadata.get("clocks", []))),
        ("N_U", sizes.n_u),
        ("N_P", sizes.n_p),
    ]


def _header_sizes(program: Program, n_free: int) -> list[tuple[str, int | str]]:
    """Sizes of the model and of the instance's work."""
    sizes, prefix = program.sizes, program.name.upper()
    width = sizes.n_x + sizes.n_v + sizes.n_u + sizes.n_p
    values = max(sizes.n_y + max(sizes.n_p + sizes.n_u, sizes.n_events), 3 * sizes.n_events)
    trial = max(3 * n_free + 2 * sizes.n_q + 2 * sizes.n_v, sizes.n_resets, sizes.n_x + sizes.n_v + width)
    matrix = max(sizes.n_x * max(sizes.n_x, sizes.n_u, sizes.n_p), sizes.n_y * width)
    return [
        ("N_X", sizes.n_x),
        ("N_Q", sizes.n_q),
        ("N_V", sizes.n_v),
        ("N_Y", sizes.n_y),
        ("N_DOF", n_free),
        ("N_CONST", f"{prefix}_N_CONST"),
        ("N_WORK", f"{prefix}_N_WORK"),
        ("N_VALUES", values),
        ("N_TRIAL", trial),
        ("N_MATRIX", f"{matrix} + {prefix}_N_CONST"),
    ]


def _lists(program: Program, free: Sequence[int]) -> list[tuple[str, str]]:
    """Tables of whole numbers."""
    metadata = program.metadata
    events, resets, clocks = (metadata.get(key, []) for key in ("events", "resets", "clocks"))
    return [
        ("INDEPENDENT", _whole(map(int, find_exact(program)))),
        ("FREE_Q", _whole(coordinate_of(program, k) for k in free)),
        ("FREE_V", _whole(free)),
        ("DIRECTION", _whole(event["direction"] for event in events)),
        ("MOST", _whole(int(event["terminal"]) for event in events)),
        ("RESETS", _whole(int(event["resets"]) for event in events)),
        ("RESET_OF", _whole(row[0] for row in resets)),
        ("RESET_X", _whole(row[1] for row in resets)),
        ("CLOCK_EVENT", _whole(clock["event"] for clock in clocks)),
        ("CLOCK_COUNTER", _whole(clock["counter"] for clock in clocks)),
    ]


def _nominal(program: Program) -> list[float]:
    """Typical sizes of the states: 1 rad, the size of the mechanism, and their rates a second."""
    metadata = program.metadata
    length = float(metadata["length_scale"] or 1.0)
    kinds = [*metadata["coordinate_kinds"], *metadata["velocity_kinds"]]
    return [length if kind == "length" else 1.0 for kind in kinds]


def _whole(values: Iterable[int]) -> str:
    """The inside of a C initialiser of integers, which must not be empty."""
    return ", ".join(map(str, values)) or "0"


#: Sources that are the same for all models.
_COMMON = ("eomgen_fmu.c", "fmu_start.c", "fmu_events.c", "fmu_travel.c", "fmu_derivatives.c")
_STEPPERS = ("eomgen_steppers.h", "eomgen_loop.h", "eomgen_methods.h", "eomgen_steppers.c")


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
        See :func:`refuse_impacts`.
    UsageError
        An unknown version.
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
    return FmuFiles(files, compiled)


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


def write_fmu(
    program: Program,
    module: BoundModel,
    path: str | Path | None = None,
    version: str = "2.0",
    progress: Callable[[str], None] | None = None,
) -> Path:
    """Write a functional mock-up unit: model exchange and co-simulation in one file, with its sources in C.

    Parameters
    ----------
    program : Program
        With the kernels :data:`~eomgen.targets.FMU_KERNELS`.
    module : BoundModel
        The model, for its initial state.
    path : str or Path, optional
        Of the file, by default ``<name>.fmu`` here; a file of this name is replaced.
    version : {'2.0', '3.0'}, optional
        Of FMI.
    progress : callable, optional
        Told what is being done, a line at a time.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    ModelError
        A parameter has no value, or the model has impacts: events with ``restitution``, or contacts with
        ``normal_law: rigid``.
    UsageError
        An unknown version, or a file name that does not end in ``.fmu``.
    ToolchainError
        No compiler, or it failed.

    Notes
    -----
    Variables of the unit: coordinates and velocities, their derivatives ``der(name)``, inputs, parameters (which can be
    set between steps), outputs and the values of events, with units and texts.  Start values are those of the model's
    initial state.  Coordinates that loops make dependent follow from the independent ones during initialization.
    """
    version = check_version(version)
    where = as_path("path", path if path is not None else f"{program.name}.fmu")
    if where.suffix != ".fmu":
        raise bad_file(f"the name of an FMU ends in .fmu, not as in {str(where)!r}")
    write_whole(where, fmu_bytes(program, module, version, progress))
    return where


def generate_fmu(program: Program, module: BoundModel, directory: Path, version: str) -> Path:
    """Write ``<name>.fmu`` into a folder, in the place of one that eomgen wrote before.

    Raises
    ------
    UsageError
        There is another file of this name.
    """
    where = directory / f"{program.name}.fmu"
    if os.path.lexists(where) and not _is_ours(where):
        raise bad_file(f"{where} exists and was not written by eomgen; move it, or choose another --out")
    directory.mkdir(parents=True, exist_ok=True)
    return write_fmu(program, module, where, version)


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


def fmu_bytes(
    program: Program, module: BoundModel, version: str, progress: Callable[[str], None] | None = None
) -> bytes:
    """The content of the file that :func:`write_fmu` writes; the same model gives the same bytes."""
    refuse_impacts(program)
    program, start = _begin_signals(program, module)
    unit = emit_fmu(program, [float(x) for x in start], version)
    files: dict[str, bytes] = {name: text.encode() for name, text in unit.files.items()}
    folder = _FOLDERS.get((sys.platform, platform.machine()), (None, None))[version == "3.0"]
    if folder is not None:
        code = {Path(name).name: text for name, text in unit.files.items() if name.endswith((".c", ".h"))}
        options = Options(extra=("-fvisibility=hidden",))
        library = compile_c_library(code, program.name, options, progress).product
        files[f"binaries/{folder}/{program.name}{library.suffix}"] = library.read_bytes()
    memory = io.BytesIO()
    with zipfile.ZipFile(memory, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in sorted(files, key=lambda name: (name != "modelDescription.xml", name)):
            entry = zipfile.ZipInfo(name, _WHEN)
            entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
            archive.writestr(entry, files[name])
    return memory.getvalue()
