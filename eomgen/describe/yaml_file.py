"""YAML 1.2 -> Description, without SymPy; every fault says its file and line."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any, NamedTuple

from ..base.files import as_name, beside, open_plain
from ..elements import kinds
from ..errors import ModelError, Problem, UsageError
from .components import Components
from .description import SECTIONS, Description, Faults
from .fields import MODEL, PARTS, SHORT
from .names import nearest
from .visit import undotted
from .yaml_nodes import SIZE, Document


def describe_yaml_file(path: str | os.PathLike[str], *, allow_native: bool = False) -> Description:
    """The raw data of a model file.

    Names are looked up when the model is checked, as in Python; faults of the file itself that leave nothing to check
    (it is not YAML, too large, not a mapping) are raised at once, others are kept and told with all the rest.

    Parameters
    ----------
    path : str or path
    allow_native : bool, optional
        As for :func:`eomgen.load`.

    Returns
    -------
    Description
        With the entries of all components that it adds.

    Raises
    ------
    FileNotFoundError
        There is no such file.
    UsageError
        It is not a plain file.
    ModelError
        The file is not YAML or not a mapping.
    """
    name = as_name("path", path)
    return _describe(_text_of(name), name, _Origin(allow_native, os.path.dirname(name)))


def describe_yaml(text: str, file: str = "model.yaml") -> Description:
    """The raw data of a model file's text; ``file`` is the name that messages bear."""
    return _describe(text, file, _Origin())


class _Origin(NamedTuple):
    """Whether functions may bring code, the folder where their files lie, and the files that named this one."""

    trusted: bool = False
    folder: str = ""
    within: tuple[str, ...] = ()


def _text_of(name: str) -> str:
    with open_plain(name) as file:
        data = file.read(SIZE + 1)
    if len(data) > SIZE:
        raise ModelError([Problem("file", "is too large", f"at most {SIZE} bytes", name, 1, code="EG-TOO-LARGE")])
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise ModelError(
            [Problem("file", "is not UTF-8 text", "save it as UTF-8", name, line, code="EG-FILE-DAMAGED")]
        ) from None


def _describe(text: str, file: str, origin: _Origin) -> Description:
    document = Document(text, file)
    tree = document.value
    if not isinstance(tree, Mapping):
        raise ModelError(
            [Problem("file", "is not a mapping", f"allowed keys: {', '.join(MODEL)}", file, 1, code="EG-FILE-DAMAGED")]
        )
    description = Description(lines=dict(document.lines), problems=document.problems)
    faults = Faults(description)

    def fill(given: Mapping[str, Any], start: str, target: Description) -> None:
        for key in given:
            if key in SECTIONS:
                _add_section(target, faults, start, key, given[key], origin)
            elif key == "contacts" and not start:
                _add_contacts(target, faults, given[key], origin)
            elif key in ("initial", "guess") and start:
                if isinstance(given[key], Mapping):
                    target.values[key] = given[key]
                elif given[key] is not None:
                    faults.add(f"{start}{key}", f"is not {kinds.Table.says}", "write names as keys", "EG-TYPE")

    def open_file(name: str) -> Description | None:
        return _open_part(name, file, origin, faults)

    for key, value in tree.items():
        if key not in MODEL:
            faults.add(key, "unknown key", nearest(key, MODEL, "allowed"), "EG-NAME-UNKNOWN")
        elif (
            key not in SECTIONS
            and key not in PARTS
            and key != "contacts"
            and (value is not None or not isinstance(MODEL[key], kinds.Table))
        ):
            description.values[key] = value
    fill(tree, "", description)
    if tree.get("components") is not None or tree.get("add") is not None:
        before = len(faults)
        components = Components(tree.get("components"), document.lines, fill, open_file, faults)
        components.add(tree.get("add"), "", description)
        components.read_all()
        description = undotted(description)
        description.incomplete = len(faults) > before
    description.problems = faults.problems
    return description


def _open_part(name: str, file: str, origin: _Origin, faults: Faults) -> Description | None:
    """The description of a file that a model file names; None where it is none, which is told."""
    within = (*origin.within, os.path.realpath(file))
    path = os.path.join(os.path.dirname(file), name)
    real = beside(file, name)
    if real in within:
        chain = ", ".join(os.path.basename(one) for one in (*within[within.index(real) :], real))
        raise UsageError(f"the file {name} adds itself: {chain}", code="EG-CIRCLE")
    try:
        found = _describe(_text_of(path), path, _Origin(origin.trusted, os.path.dirname(path), within))
    except ModelError as error:
        for problem in error.problems:
            faults.take(problem)
        return None
    for problem in found.problems:
        faults.take(problem)
    for entry in found.sections["bodies"]:  # meshes are looked up from the folder of the whole model
        for solid in entry.values.get("solids") or ():
            if isinstance(solid, dict) and isinstance(solid.get("file"), str):
                solid["file"] = os.path.join(os.path.dirname(name), solid["file"])
    return found


def _add_contacts(description: Description, faults: Faults, value: Any, origin: _Origin) -> None:
    """Take in the section ``contacts``: forces of that type, whose law may be a mapping of its own."""
    if value is None:
        return
    if not isinstance(value, Mapping):
        faults.add("contacts", f"is not {kinds.Table.says}", "write the names of the contacts as keys", "EG-TYPE")
        return
    for path, place in list(description.lines.items()):
        if path.startswith("contacts."):
            description.lines["forces" + path.removeprefix("contacts")] = place
    forces: dict[str, Any] = {}
    for name, given in value.items():
        if isinstance(given, Mapping) and "type" in given:
            faults.add(f"forces.{name}.type", "is given in the section contacts", "leave it out", "EG-CONFLICT")
        forces[name] = {"type": "contacts", **given} if isinstance(given, Mapping) else given
    _add_section(description, faults, "", "forces", forces, origin)


def _spread_law(description: Description, faults: Faults, path: str, values: dict[str, Any]) -> dict[str, Any]:
    """The keys of contacts with those of their law beside them."""
    law = values.get("law")
    if values.get("type") != "contacts" or "law" not in values:
        return values
    if not isinstance(law, Mapping):
        faults.add(f"{path}.law", f"is not {kinds.Law.says}", "give stiffness and what else the law has", "EG-TYPE")
        return values
    for key in law:
        if key in values:
            faults.add(f"{path}.{key}", "is given in law and beside it", "give it once", "EG-CONFLICT")
        if f"{path}.law.{key}" in description.lines:
            description.lines[f"{path}.{key}"] = description.lines[f"{path}.law.{key}"]
    return {key: x for key, x in values.items() if key != "law"} | dict(law)


def _add_section(
    description: Description, faults: Faults, start: str, section: str, value: Any, origin: _Origin
) -> None:
    """Take in the entries of a section; an empty section is one that was left out."""
    if value is None:
        return
    if not isinstance(value, Mapping):
        faults.add(
            f"{start}{section}", f"is not {kinds.Table.says}", f"write the names of the {section} as keys", "EG-TYPE"
        )
        return
    for name, given in value.items():
        values, place = given, f"{section}.{name}"
        if not isinstance(given, dict):
            key = SHORT.get(section)
            if given is None and key == "value":
                values = {}
            elif key is not None:
                if place in description.lines:
                    description.lines[f"{place}.{key}"] = description.lines[place]
                values = {key: given}
            else:
                faults.add(
                    f"{start}{place}", f"is not {kinds.Table.says}", "write its keys as {key: value, ...}", "EG-TYPE"
                )
                values = {}
        if section == "forces":
            values = _spread_law(description, faults, place, values)
        entry = description.add(section, name, values)
        entry.trusted, entry.folder = section == "functions" and origin.trusted, origin.folder
