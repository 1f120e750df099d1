"""Robots, XML: the bytes of a file -> a tree of elements with their lines; entities are refused, sizes bounded.

The parser is expat behind defusedxml, which stops at the first declaration of an entity or a document type, so that
nothing is expanded and no other file is read.
"""

from __future__ import annotations

import io
import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from ..base.files import open_plain
from ..base.limits.numbers import DEPTH, ELEMENTS, LONGEST, PIECE, SIZE
from ..errors import MissingDependencyError, ModelError, Problem


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

    def problem(self, path: str, message: str, remedy: str = "", code: str = "") -> Problem:
        """A fault at this element."""
        return Problem(path, message, remedy, self.file, self.line, code)


def read_xml(path: str | os.PathLike[str]) -> XmlElement:
    """The root element of an XML file.

    Raises
    ------
    FileNotFoundError
        There is no such file.
    UsageError
        It is not a plain file, or the path is none, such as one with NUL.
    ModelError
        Not XML, a document type or an entity, or too large; with the line.
    MissingDependencyError
        defusedxml is not installed.
    """
    name = os.fsdecode(path)
    with open_plain(name) as file:
        data = file.read(SIZE + 1)
    if len(data) > SIZE:
        raise ModelError([Problem("file", "is too large", f"at most {SIZE:,} bytes", name, 1, code="EG-TOO-LARGE")])
    return parse_xml(data, name)


def parse_xml(data: bytes, file: str) -> XmlElement:
    """The root element of the bytes of an XML file; ``file`` is the name that messages bear."""
    try:
        from defusedxml.common import DefusedXmlException
        from defusedxml.expatreader import DefusedExpatParser
    except ImportError:
        raise MissingDependencyError("robot files need defusedxml: pip install defusedxml") from None
    from xml.sax import SAXException, SAXParseException
    from xml.sax.xmlreader import InputSource

    longest = max(map(len, data.split(b">")))
    if longest > PIECE:  # expat would read it again and again
        message = f"has a tag, a comment or a text of {longest:,} bytes"
        raise ModelError(
            [Problem("file", message, f"at most {PIECE:,} from one '>' to the next", file, 1, code="EG-TOO-LARGE")]
        )
    parser = DefusedExpatParser(forbid_dtd=True, forbid_entities=True, forbid_external=True)
    handler = _handler(parser, file)
    parser.setContentHandler(handler)
    source = InputSource(file)
    source.setByteStream(io.BytesIO(data))
    try:
        parser.parse(source)
    except DefusedXmlException:
        message = "declares a document type or an entity"
        remedy = "remove <!DOCTYPE ...>; eomgen expands no entities and reads no other files"
        raise ModelError(
            [Problem("file", message, remedy, file, parser.getLineNumber() or 1, code="EG-REFUSED")]
        ) from None
    except SAXParseException as error:
        message, line = f"not XML: {error.getMessage()}", error.getLineNumber() or 1
        raise ModelError(
            [Problem("file", message, "check brackets, quotes and closing tags", file, line, code="EG-FILE-DAMAGED")]
        ) from None
    except (SAXException, ValueError, LookupError) as error:  # an unknown encoding, among others
        raise ModelError([Problem("file", f"not XML: {error}", "", file, 1, code="EG-FILE-DAMAGED")]) from None
    if handler.root is None:
        raise ModelError([Problem("file", "is empty", "", file, 1, code="EG-FILE-DAMAGED")])
    root: XmlElement = handler.root
    return root


def _handler(parser: Any, file: str) -> Any:
    from xml.sax.handler import ContentHandler

    class Builder(ContentHandler):
        """Builds the tree; raises ModelError at the first bound that is passed."""

        def __init__(self) -> None:
            super().__init__()
            self.root: XmlElement | None = None
            self.open: list[XmlElement] = []
            self.count = 0

        def stop(self, message: str, remedy: str) -> ModelError:
            return ModelError(
                [Problem("file", message, remedy, file, parser.getLineNumber() or 1, code="EG-TOO-LARGE")]
            )

        def startElement(self, tag: str, attributes: Any) -> None:
            self.count += 1
            if self.count > ELEMENTS:
                raise self.stop("has too many elements", f"at most {ELEMENTS:,}")
            if len(self.open) >= DEPTH:
                raise self.stop("is nested too deeply", f"at most {DEPTH} levels")
            given = dict(attributes.items())
            if any(len(value) > LONGEST for value in given.values()):
                raise self.stop("has an attribute that is too long", f"at most {LONGEST:,} characters")
            element = XmlElement(tag, given, file, parser.getLineNumber() or 1)
            if self.open:
                self.open[-1].children.append(element)
            else:
                self.root = element
            self.open.append(element)

        def endElement(self, tag: str) -> None:
            self.open.pop()

    return Builder()
