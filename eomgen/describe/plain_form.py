"""Stage describe, the plain form: a description with SymPy, arrays and handles -> the same in numbers and texts."""

from __future__ import annotations

from .description import Description
from .write_yaml import yaml_text
from .yaml_file import describe_yaml


def plain_description(given: Description) -> Description:
    """A description as the text of its model file reads: numbers, texts, lists and mappings only.

    Raises
    ------
    UsageError
        It has values that no model file can hold, such as functions of Python.
    """
    result = describe_yaml(yaml_text(given))
    functions = {entry.name: entry for entry in given.sections["functions"]}
    for entry in result.sections["functions"]:
        entry.trusted, entry.folder = functions[entry.name].trusted, functions[entry.name].folder
    result.lines.clear()
    result.instances, result.origins = dict(given.instances), dict(given.origins)
    return result
