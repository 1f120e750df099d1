"""Stage emit: generated files of a package -> the files of eomgen that they can import, so that it stands alone.

Imports are read from the text, those in functions too; tables that name files as text (``CALLS``, ``FORMS``,
``PARTS``) count as imports.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import cache
from importlib.resources import files

#: What runs without models, equations and SymPy: files of the root, and folders.  Imports of anything else are for
#: modules that know their equations, which those of a package do not.
ALONE = ("errors", "module", "targets", "analysis", "base", "base/limits", "device", "ensembles", "identification",
         "numeric", "runtime", "show", "simulation", "verification")  # fmt: skip

_TYPES = re.compile(r"^if TYPE_CHECKING:.*\n(?:(?: {4}.*)?\n)+", re.M)
_IMPORT = re.compile(r"^( *)from (\.+)([\w.]*) import (?:\(([^)]*)\)|(.*))$", re.M)
_TABLE = re.compile(r"^(?:CALLS|FORMS|PARTS)\b.* = \{\n((?:    .*\n)+)\}", re.M)
_ROW = re.compile(r'^    "\w+": "([\w.]+)",$', re.M)


def carry(package: Mapping[str, str]) -> dict[str, str]:
    """Files of eomgen that the Python files of a package can import, by name, as they are.

    Parameters
    ----------
    package : mapping of str to str
        Generated files; those in Python and its stubs count.

    Returns
    -------
    dict of str to str
        The ``__init__.py`` of a folder keeps its description only: the names that it offers are for eomgen's users.
    """
    found: set[str] = set()
    todo = [home for name, text in package.items() if name.endswith((".py", ".pyi")) for home, _ in _imports("", text)]
    while todo:
        name = todo.pop()
        if name in found or not _stands_alone(name):
            continue
        found.add(name)
        todo += [home for home, _ in _reached(name)]
    texts = {f"{name}.py": _text(name) for name in sorted(found)}
    folders = sorted({name.rpartition("/")[0] for name in found if "/" in name})
    return texts | {f"{name}/__init__.py": describe_folder(name) for name in folders}


def describe_folder(name: str) -> str:
    """The ``__init__.py`` of a folder of eomgen as packages have it: its first line."""
    first = _text(f"{name}/__init__").removeprefix('"""').partition("\n")[0]
    return f'"""{first.removesuffix(chr(34) * 3)}"""\n'


@cache
def _text(name: str) -> str:
    return files("eomgen").joinpath(f"{name}.py").read_text(encoding="utf-8")


@cache
def _names() -> frozenset[str]:
    """All files that may be carried, without their ending."""
    root, found = files("eomgen"), set()
    for name in ALONE:
        if root.joinpath(f"{name}.py").is_file():
            found.add(name)
        else:
            found |= {f"{name}/{item.name[:-3]}" for item in root.joinpath(name).iterdir() if item.name.endswith(".py")}
    return frozenset(name for name in found if not name.endswith("/__init__"))


@cache
def _reached(name: str) -> tuple[tuple[str, bool], ...]:
    """What a file of eomgen imports, and whether it does so as it is loaded."""
    text = _text(name)
    named = [home for table in _TABLE.findall(text) for home in _ROW.findall(table)]
    return (*_imports(name, _TYPES.sub("\n", text)), *((home.replace(".", "/"), False) for home in named))


def _imports(name: str, text: str) -> Iterator[tuple[str, bool]]:
    """Files that a text imports from its own package, and whether at its top."""
    for indent, dots, module, several, one in _IMPORT.findall(text):
        up = name.split("/")[:-1]
        base = [*up[: len(up) - len(dots) + 1], *module.split(".")] if module else up[: len(up) - len(dots) + 1]
        for imported in re.findall(r"(\w+)(?: as \w+)?", several or one):
            inner = "/".join([*base, imported])
            yield inner if inner in _names() else "/".join(base), not indent


@cache
def _stands_alone(name: str) -> bool:
    """Whether a file can be loaded where only files of ALONE are."""
    return name in _names() and all(_stands_alone(home) for home, at_top in _reached(name) if at_top)
