"""Robots, constructs: elements and attributes that a file has -> what becomes of each, and notes on what is left out.

The tables of :mod:`.urdf_constructs` and :mod:`.mjcf_constructs` are all that is said of it: the notes of a load and
the tables of the documentation are made from them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple

TAKEN = "taken"  #: becomes part of the model
DATA = "data"  #: kept and readable; a note says where it does not act
SEEN = "noted where it acts"  #: left out by a note of the reader, which looks whether it does anything
LEFT = "left out, noted"  #: left out with a note wherever it stands
HARMLESS = "no part of the motion"  #: looks, solvers, sensors: left out in silence

ANY = "*"  #: any attribute
INSIDE = "**"  #: any attribute and all that is inside
SHOWN = 6  #: constructs that one note names


class ConstructRow(NamedTuple):
    """What becomes of some attributes of an element; without attributes of the element itself."""

    element: str  #: path of tags, e.g. ``link/inertial``
    fate: str
    attributes: tuple[str, ...]
    why: str


Table = Mapping[str, tuple[ConstructRow, ...]]
Find = Callable[[str, str], ConstructRow | None]
Met = Counter[tuple[str, str]]  #: (path, attribute or nothing) -> how often


def table_of(text: str, reasons: Mapping[str, tuple[str, str]]) -> Table:
    """A table from lines ``element[, element]: word attributes``.

    Parameters
    ----------
    text : str
    reasons : mapping
        Word -> fate and reason.
    """
    rows: dict[str, list[ConstructRow]] = {}
    for line in filter(None, map(str.strip, text.splitlines())):
        elements, _, rest = line.partition(": ")
        word, *attributes = rest.split()
        for element in map(str.strip, elements.split(",")):
            rows.setdefault(element, []).append(
                ConstructRow(element, reasons[word][0], tuple(attributes), reasons[word][1])
            )
    return {element: tuple(found) for element, found in rows.items()}


def find_row(table: Table, path: str, attribute: str = "") -> ConstructRow | None:
    """What a table says of an attribute of an element, or of the element itself; None if nothing."""
    for row in table.get(path, ()):
        if not attribute or attribute in row.attributes or ANY in row.attributes or INSIDE in row.attributes:
            return row
    if attribute.startswith("xmlns"):
        return ConstructRow(path, HARMLESS, (attribute,), "names of other dialects")
    return None


def is_whole(row: ConstructRow | None) -> bool:
    """Whether all that is inside an element shares its fate."""
    return row is not None and INSIDE in row.attributes


def notes_of(find: Find, met: Met) -> list[str]:
    """A sentence for each reason why something was left out, and one for what is not known.

    Parameters
    ----------
    find : callable
        (path, attribute) -> ConstructRow or None.
    met : Counter
    """
    left: dict[str, list[str]] = {}
    for (path, attribute), count in met.items():
        row, whole = find(path, attribute), find(path, "")
        if (row is not None and row.fate != LEFT) or (attribute and (whole is None or whole == row)):
            continue  # all is well, or it was told of the element
        shown = f"<{path.rpartition('/')[2]}{' ' * bool(attribute)}{attribute}>" + (f" {count} times" * (count > 1))
        left.setdefault("what this reader does not know" if row is None else row.why, []).append(shown)
    return [f"left out: {why} ({_few(shown)})" for why, shown in left.items()]


def _few(names: list[str]) -> str:
    return ", ".join(names[:SHOWN]) + (f", ... ({len(names)} in all)" if len(names) > SHOWN else "")


def count_all(paths: Iterable[tuple[str, Iterable[str]]]) -> Met:
    """How often elements and attributes are met, of (path, attributes) of each element."""
    met: Met = Counter()
    for path, attributes in paths:
        met[path, ""] += 1
        for attribute in attributes:
            met[path, attribute] += 1
    return met
