"""Importers, XML: the bytes of a file -> elements with their lines, and what becomes of each by the table of a format.

Document types are refused, so that no entity is expanded and no other file is read; sizes are bounded.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple
from xml.parsers import expat

from ..base.files import open_plain
from ..errors import ModelError, Problem
from ..model.names import listing
from .limits import DEPTH, ELEMENTS, LONGEST, SIZE


@dataclass
class XmlElement:
    """One element: its tag, attributes and children, and where it starts."""

    tag: str
    attributes: dict[str, str]
    file: str
    line: int
    children: list[XmlElement] = field(default_factory=list)

    def find(self, tag: str) -> XmlElement | None:
        """The first child of a tag."""
        return next((child for child in self.children if child.tag == tag), None)

    def all(self, tag: str) -> list[XmlElement]:
        """All children of a tag."""
        return [child for child in self.children if child.tag == tag]

    def walk(self) -> Iterator[XmlElement]:
        """This element and everything in it, in the order of the file."""
        waiting = [self]
        while waiting:
            element = waiting.pop()
            yield element
            waiting.extend(reversed(element.children))

    def problem(self, path: str, message: str, remedy: str, code: str) -> Problem:
        """A fault at this element."""
        return Problem(path, message, remedy, self.file, self.line, code)


def read_xml(path: str | os.PathLike[str]) -> XmlElement:
    """The root element of an XML file.

    Raises FileNotFoundError; UsageError for what is no plain file, or no path; ModelError with the line for what is not
    XML, a document type or an entity, or too large.
    """
    name = os.fsdecode(path)
    with open_plain(name) as file:
        data = file.read(SIZE + 1)
    parser = expat.ParserCreate()
    root: XmlElement | None = None
    waiting: list[XmlElement] = []  # elements that have not ended
    count = 0

    def refusal(message: str, remedy: str, code: str = "EG-TOO-LARGE") -> ModelError:
        line = max(1, parser.ErrorLineNumber, parser.CurrentLineNumber)
        return ModelError([Problem("file", message, remedy, name, line, code)])

    def refuse_declaration(*_: object) -> None:
        remedy = "remove <!DOCTYPE ...>; eomgen expands no entities and reads no other files"
        raise refusal("declares a document type or an entity", remedy, "EG-REFUSED")

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal root, count
        count += 1
        if count > ELEMENTS:
            raise refusal("has too many elements", f"at most {ELEMENTS:,}")
        if len(waiting) >= DEPTH:
            raise refusal("is nested too deeply", f"at most {DEPTH} levels")
        if any(len(value) > LONGEST for value in attributes.values()):
            raise refusal("has an attribute that is too long", f"at most {LONGEST:,} characters")
        element = XmlElement(tag, attributes, name, parser.CurrentLineNumber)
        if waiting:
            waiting[-1].children.append(element)
        else:
            root = element
        waiting.append(element)

    parser.StartDoctypeDeclHandler = refuse_declaration
    parser.StartElementHandler = start
    parser.EndElementHandler = lambda tag: waiting.pop()
    if len(data) > SIZE:
        raise refusal("is too large", f"at most {SIZE:,} bytes")
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        message = f"not XML: {expat.ErrorString(error.code)}"
        raise refusal(message, "check brackets, quotes and closing tags", "EG-FILE-DAMAGED") from None
    except (ValueError, LookupError) as error:  # an unknown encoding, among others
        raise refusal(f"not XML: {error}", "", "EG-FILE-DAMAGED") from None
    assert root is not None
    return root


# -- what becomes of elements and attributes ---------------------------------------------------------------------------
TAKEN = "taken"  #: becomes part of the model
DATA = "data"  #: kept and readable; a note says where it does not act
SEEN = "noted where it acts"  #: left out by a note of the reader, which looks whether it does anything
LEFT = "left out, noted"  #: left out with a note wherever it stands
HARMLESS = "no part of the motion"  #: looks, solvers, sensors: left out in silence

ANY = "*"  #: any attribute
INSIDE = "**"  #: any attribute and all that is inside
LISTED = 6  #: constructs that one note names


class ConstructRow(NamedTuple):
    """What becomes of some attributes of an element; without attributes of the element itself."""

    fate: str
    why: str
    attributes: tuple[str, ...]


class Constructs:
    """The elements and attributes of a format: the notes of a load and the tables of the documentation.

    The text has lines ``element[, element]: word attributes``, an element being a path of tags, e.g. ``link/inertial``;
    ``reasons`` has the fate and the reason of each word, ``everywhere`` the words of attributes that any element may
    have.  ``path_of`` gives the path of an element from that of its parent, empty of the root, and its tag.
    """

    def __init__(
        self,
        text: str,
        reasons: Mapping[str, tuple[str, str]],
        path_of: Callable[[str, str], str],
        everywhere: Mapping[str, str],
    ) -> None:
        self.path_of = path_of
        self.everywhere = {name: ConstructRow(*reasons[word], (name,)) for name, word in everywhere.items()}
        self.rows: dict[str, list[ConstructRow]] = {}
        for line in filter(None, map(str.strip, text.splitlines())):
            elements, _, rest = line.partition(": ")
            word, *attributes = rest.split()
            for element in map(str.strip, elements.split(",")):
                self.rows.setdefault(element, []).append(ConstructRow(*reasons[word], tuple(attributes)))

    def find(self, path: str, attribute: str = "") -> ConstructRow | None:
        """What becomes of an attribute of an element, or of the element itself; None if it is not known."""
        for row in self.rows.get(path, ()):
            if not attribute or not {attribute, ANY, INSIDE}.isdisjoint(row.attributes):
                return row
        if attribute.startswith("xmlns"):
            return ConstructRow(HARMLESS, "names of other dialects", (attribute,))
        return self.everywhere.get(attribute) if path in self.rows else None

    def walk(self, root: XmlElement) -> Iterator[tuple[str, XmlElement]]:
        """Elements with their paths; not into those whose inside shares their fate, or is not known."""
        waiting = [(self.path_of("", root.tag), root)]
        while waiting:
            path, element = waiting.pop()
            yield path, element
            row = self.find(path)
            if row is not None and INSIDE not in row.attributes:
                waiting += [(self.path_of(path, child.tag), child) for child in reversed(element.children)]

    def notes(self, root: XmlElement) -> list[str]:
        """A sentence for each reason why something is left out, and one for what is not known."""
        met = Counter(
            (path, element.tag, name) for path, element in self.walk(root) for name in ("", *element.attributes)
        )
        left: dict[str, list[str]] = {}
        for (path, tag, attribute), count in met.items():
            row, whole = self.find(path, attribute), self.find(path)
            if (row is not None and row.fate != LEFT) or (attribute and (whole is None or whole == row)):
                continue  # all is well, or the note of the element says it
            construct = f"<{tag}{' ' * bool(attribute)}{attribute}>" + (f" {count} times" * (count > 1))
            left.setdefault("what this reader does not know" if row is None else row.why, []).append(construct)
        return [f"left out: {why} ({listing(names, LISTED)})" for why, names in left.items()]
