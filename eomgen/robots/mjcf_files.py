"""Robots, MJCF: what a model would make MuJoCo read and make -> checked before MuJoCo sees it, with the lines.

Every file that a model names must lie inside one folder; those in XML pass the strict parser; copies are counted.
"""

from __future__ import annotations

import os
import re
from collections import Counter
from dataclasses import replace
from pathlib import Path

from ..base.limits.numbers import COPIES, DEPTH, ELEMENTS, ENTRIES, FILES, PIXELS, SIZE
from ..errors import ModelError, Problem
from .constructs import Met, count_all, is_whole
from .contained import Folder
from .mjcf_constructs import find_mjcf, path_of
from .xml_text import XmlElement, parse_xml

_COUNTED = ("replicate", "composite", "flexcomp")
_SIZES = ("width", "height", "nrow", "ncol")
_DIGITS = re.compile(r"\s*[-+]?([0-9]{1,18})")
Lines = dict[tuple[str, str], tuple[str, int]]


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
            raise ModelError(
                [
                    element.problem(
                        "mujoco", "has too many elements", f"at most {ELEMENTS:,} of all files", "EG-TOO-LARGE"
                    )
                ]
            )
        if depth >= DEPTH:
            message = f"at most {DEPTH} levels, over all files"
            raise ModelError([element.problem(element.tag, "is nested too deeply", message, "EG-TOO-LARGE")])
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
            self.problems.append(element.problem("include.file", message, "include each file once", "EG-CIRCLE"))
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
            self.problems.append(
                element.problem("model.file", message, "a model cannot be part of itself", "EG-CIRCLE")
            )
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
            raise ModelError(
                [element.problem(element.tag, "too many files", f"at most {FILES} make a model", "EG-TOO-LARGE")]
            )
        data = self.folder.read(element, path, SIZE - self.bytes)
        self.bytes += len(data)
        return parse_xml(data, path)


class Scan:
    """A model with the files it includes and attaches, every element looked at once.

    Parameters
    ----------
    root : XmlElement
        The model's own file.
    folder : str, optional
        Where all files must lie; the folder of the model's file by default.

    Attributes
    ----------
    trees : Trees
    lines : dict
        (tag, name) -> file and line of the named elements of all its XML files.
    met : Counter
        Elements and attributes of all of them, by their paths in the table of constructs.
    made : int
        Bodies that copying makes.

    Raises
    ------
    ModelError
        The model does not lie in the folder, has too many files or elements, or one of its files is no XML.
    """

    def __init__(self, root: XmlElement, folder: str | None) -> None:
        main = os.path.dirname(os.path.realpath(root.file))
        self.folder = Folder(main if folder is None else folder)
        if not self.folder.holds(main):
            message = f"{root.file} lies outside the folder {folder} of its assets"
            raise ModelError([root.problem("assets", message, "name a folder that holds the model", "EG-FILE")])
        self.trees = Trees(root, self.folder)
        self.problems: list[Problem] = list(self.trees.problems)
        self.lines: Lines = {}
        self.met: Met = Counter()
        self.made = self.bodies = 0  # bodies by copying; all bodies
        self.held: dict[str, int] = {}  # file of a model that is attached -> its bodies
        for path, tree in self.trees.models.items():  # those that others are made of come first
            before = self.bodies
            self._elements(tree)
            self.held[path] = self.bodies - before
        self._elements(self.trees.main)

    def _elements(self, root: XmlElement) -> None:
        """Take in the elements of one tree."""
        models: dict[str, int] = {}  # name -> bodies
        for element in root.walk():
            path = element.attributes.get("file", "")
            if element.tag == "model" and path in self.held:
                held, tree = self.held[path], self.trees.models[path]
                for name in (element.attributes.get("name"), tree.attributes.get("model"), Path(path).stem):
                    models[name or ""] = max(held, models.get(name or "", 0))
        waiting: list[tuple[XmlElement, int, str | None]] = [(root, 1, "")]
        while waiting:
            element, copies, parent = waiting.pop()
            below = None
            if parent is not None:
                path = path_of(parent, element.tag)
                self.met.update(count_all([(path, element.attributes)]))
                row = find_mjcf(path)
                below = element.tag if row is not None and not is_whole(row) else None
            copies = self._element(element, copies, models)
            waiting += [(child, copies, below) for child in reversed(element.children)]

    def _element(self, element: XmlElement, copies: int, models: dict[str, int]) -> int:
        """Take in one element, copied so often; returns how often what it holds is copied."""
        given = element.attributes
        if "name" in given:
            self.lines.setdefault((element.tag, given["name"]), (element.file, element.line))
        counted = element.tag in _COUNTED
        if counted:
            for part in given.get("count", "1").split():
                copies *= max(1, whole(part))
        if element.tag == "attach":
            held = copies * max(1, models.get(given.get("model", ""), 1))
            self.bodies += held
            self._make(element, held)
        elif counted or element.tag == "body":
            self.bodies += copies
            if counted or copies > 1:
                self._make(element, copies)
        for key, text in given.items():
            if key in _SIZES and whole(text) > PIXELS:
                self._too_large(element, key, f"at most {PIXELS:,}")
            elif element.tag == "size" and key != "memory" and any(whole(part) > ENTRIES for part in text.split()):
                self._too_large(element, key, f"at most {ENTRIES:,}; it is no part of the motion and may be left out")
        return copies

    def _too_large(self, element: XmlElement, key: str, remedy: str) -> None:
        message = f"{element.attributes[key][:20]} is too large"
        self.problems.append(element.problem(f"{element.tag}.{key}", message, remedy, "EG-TOO-LARGE"))

    def _make(self, element: XmlElement, bodies: int) -> None:
        """Count bodies that copying makes, of siblings and of all files; one problem tells of too many."""
        if self.made <= COPIES < self.made + bodies:
            self.problems.append(
                element.problem(element.tag, "makes too many bodies", f"at most {COPIES:,} in all", "EG-TOO-LARGE")
            )
        self.made += bodies


def whole(text: str) -> int:
    """At least the whole number that MuJoCo may take a text for; 0 where it takes none."""
    try:
        value = float(text)
    except ValueError:
        found = _DIGITS.match(text)
        return int(found[1]) if found else 0
    return int(min(max(value, 0.0), 1e18)) if value == value else 0
