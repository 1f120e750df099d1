"""Robots, MJCF: a model's own file -> trees of elements in which every included file stands where it is included.

A model that others attach (``<model file>``) is a tree of its own.  The elements keep the file and line they come from.
Bounds: bytes, files, elements and nesting of all together; no file is part of itself.
"""

from __future__ import annotations

import os
from dataclasses import replace

from ..errors import ModelError, Problem
from ..limits.files import DEPTH, ELEMENTS, FILES, SIZE
from .contained import Folder
from .xml_text import XmlElement, parse_xml


class Trees:
    """The trees that make one model.

    Attributes
    ----------
    main : XmlElement
        The model's own.
    models : dict of str to Element
        Path of a file -> tree of a model that is attached.
    problems : list of Problem
        Files that are outside, not there, or part of themselves.
    """

    def __init__(self, root: XmlElement, folder: Folder) -> None:
        self.folder = folder
        self.models: dict[str, XmlElement] = {}
        self.problems: list[Problem] = []
        self.bytes = self.files = self.elements = 0
        self.open: list[str] = []  # files that are being put together, the outermost first
        self.main = self._tree(root, os.path.realpath(root.file), 0)

    def _tree(self, root: XmlElement, path: str, depth: int) -> XmlElement:
        """A file with what it includes."""
        self.open.append(path)
        seen = {path}
        tree = self._copy(root, os.path.dirname(path), seen, depth)
        self.open.pop()
        return tree

    def _copy(self, element: XmlElement, home: str, seen: set[str], depth: int) -> XmlElement:
        """An element of a tree whose files are in ``home``; ``seen`` are those that are part of it."""
        self.elements += 1
        if self.elements > ELEMENTS:
            raise ModelError([element.problem("mujoco", "has too many elements", f"at most {ELEMENTS:,} of all files")])
        if depth >= DEPTH:
            message = f"at most {DEPTH} levels, over all files"
            raise ModelError([element.problem(element.tag, "is nested too deeply", message)])
        made = replace(element, attributes=dict(element.attributes), children=[])
        for child in element.children:
            if child.tag.lower() == "include":
                made.children += self._include(child, home, seen, depth + 1)
            else:
                made.children.append(self._copy(child, home, seen, depth + 1))
        if element.tag == "model" and "file" in element.attributes:
            self._attach(made, home, depth + 1)
        return made

    def _include(self, element: XmlElement, home: str, seen: set[str], depth: int) -> list[XmlElement]:
        """The elements that stand where a file is included."""
        path = self._find(element, home)
        if path is None:
            return []
        if path in seen:
            message = f"{element.attributes['file']!r} is part of the model already"
            if path in self.open:
                message = f"{element.attributes['file']!r} includes itself"
            self.problems.append(element.problem("include.file", message, "include each file once"))
            return []
        seen.add(path)
        self.open.append(path)
        root = self._read(element, path)
        found = self._copy(root, home, seen, depth).children
        self.open.pop()
        return found

    def _attach(self, element: XmlElement, home: str, depth: int) -> None:
        """Take in a model that others attach; the element then names it by the path of its file."""
        path = self._find(element, home)
        if path is None:
            return
        if path in self.open:
            message = f"{element.attributes['file']!r} attaches itself"
            self.problems.append(element.problem("model.file", message, "a model cannot be part of itself"))
            return
        if path not in self.models:
            self.models[path] = self._tree(self._read(element, path), path, depth)
        element.attributes["file"] = path

    def _find(self, element: XmlElement, home: str) -> str | None:
        name = element.attributes.get("file", "")
        found = self.folder.find(element, name, [(home,), (os.path.dirname(os.path.realpath(element.file)),)])
        if isinstance(found, Problem):
            self.problems.append(found)
            return None
        return found

    def _read(self, element: XmlElement, path: str) -> XmlElement:
        self.files += 1
        if self.files >= FILES:
            raise ModelError([element.problem(element.tag, "too many files", f"at most {FILES} make a model")])
        data = self.folder.read(element, path, SIZE - self.bytes)
        self.bytes += len(data)
        return parse_xml(data, path)
