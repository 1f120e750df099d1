"""Stage describe, model files: YAML 1.2 -> Description, without SymPy; every fault says its file and line."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

from ..errors import ModelError, Problem
from ..files.path_names import as_name
from ..files.reading import open_plain
from .description import SECTIONS, Description, Faults
from .fields import KINDS, MODEL, SHORT
from .names import nearest
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

    Raises
    ------
    FileNotFoundError
        There is no such file.
    UsageError
        It is no plain file.
    ModelError
        The file is not YAML or not a mapping.
    """
    name = as_name("path", path)
    with open_plain(name) as file:
        data = file.read(SIZE + 1)
    if len(data) > SIZE:
        raise ModelError([Problem("file", "is too large", f"at most {SIZE} bytes", name, 1)])
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise ModelError([Problem("file", "is not UTF-8 text", "save it as UTF-8", name, line)]) from None
    description = describe_yaml(text, name)
    for entry in description.sections["functions"]:
        entry.trusted, entry.folder = allow_native, os.path.dirname(name)
    return description


def describe_yaml(text: str, file: str = "model.yaml") -> Description:
    """The raw data of a model file's text; ``file`` is the name that messages bear."""
    document = Document(text, file)
    tree = document.value
    if not isinstance(tree, Mapping):
        raise ModelError([Problem("file", "is not a mapping", f"allowed keys: {', '.join(MODEL)}", file, 1)])
    description = Description(lines=document.lines, problems=document.problems)
    faults = Faults(description)
    for key, value in tree.items():
        if key not in MODEL:
            faults.add(key, "unknown key", nearest(key, MODEL, "allowed"))
        elif key in SECTIONS:
            _add_section(description, faults, key, value)
        elif value is not None or MODEL[key].kind != "table":
            description.values[key] = value
    description.problems = faults.problems
    return description


def _add_section(description: Description, faults: Faults, section: str, value: Any) -> None:
    """Take in the entries of a section; an empty section is one that was left out."""
    if value is None:
        return
    if not isinstance(value, Mapping):
        faults.add(section, f"is not {KINDS['table']}", f"write the names of the {section} as keys")
        return
    for name, given in value.items():
        values = given
        if not isinstance(given, dict):
            key = SHORT.get(section)
            if given is None and key == "value":
                values = {}
            elif key is not None:
                description.lines[f"{section}.{name}.{key}"] = description.lines[f"{section}.{name}"]
                values = {key: given}
            else:
                faults.add(f"{section}.{name}", f"is not {KINDS['table']}", "write its keys as {key: value, ...}")
                values = {}
        description.add(section, name, values).trusted = False
