"""modelDescription.xml of FMI 2.0 and 3.0, and buildDescription.xml of 3.0."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from xml.etree import ElementTree

from ... import __version__
from ...base.texts import one_line
from ...describe.units import read_unit
from ...program import Program
from .variables import Variable

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


def _numbers(variable: Variable) -> dict[str, str]:
    """Unit, bounds and start value."""
    unit = {"unit": variable.unit} if variable.unit else {}
    bounds = zip(("min", "max"), variable.bounds, strict=True)
    unit |= {word: repr(float(bound)) for word, bound in bounds if math.isfinite(bound)}
    return unit | ({"start": repr(variable.start)} if variable.start is not None else {})


def _add_scalar(section: ElementTree.Element, variable: Variable) -> None:
    of = {} if variable.state is None else {"derivative": str(variable.state + 1)}
    tag = ElementTree.SubElement(section, "ScalarVariable", _attributes(variable))
    ElementTree.SubElement(tag, "Real", _numbers(variable) | of)


def _add_float(section: ElementTree.Element, variable: Variable) -> None:
    of = {} if variable.state is None else {"derivative": str(variable.state)}
    ElementTree.SubElement(section, "Float64", _attributes(variable) | _numbers(variable) | of)


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
