"""Robots, MJCF: what a model would make MuJoCo read and make -> checked before MuJoCo sees it, with the lines.

Every file that a model names must lie inside one folder; those in XML pass the strict parser; copies are counted.
"""

from __future__ import annotations

import os
import re
from collections import Counter
from pathlib import Path

from ..errors import ModelError, Problem
from ..limits.files import COPIES, ENTRIES, PIXELS
from .constructs import Met, count_all, is_whole
from .contained import Folder
from .mjcf_constructs import find_mjcf, path_of
from .mjcf_include import Trees
from .xml_text import XmlElement

_COUNTED = ("replicate", "composite", "flexcomp")
_SIZES = ("width", "height", "nrow", "ncol")
_DIGITS = re.compile(r"\s*[-+]?([0-9]{1,18})")
Lines = dict[tuple[str, str], tuple[str, int]]


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
            raise ModelError([root.problem("assets", message, "name a folder that holds the model")])
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
        self.problems.append(element.problem(f"{element.tag}.{key}", message, remedy))

    def _make(self, element: XmlElement, bodies: int) -> None:
        """Count bodies that copying makes, of siblings and of all files; one problem tells of too many."""
        if self.made <= COPIES < self.made + bodies:
            self.problems.append(element.problem(element.tag, "makes too many bodies", f"at most {COPIES:,} in all"))
        self.made += bodies


def whole(text: str) -> int:
    """At least the whole number that MuJoCo may take a text for; 0 where it takes none."""
    try:
        value = float(text)
    except ValueError:
        found = _DIGITS.match(text)
        return int(found[1]) if found else 0
    return int(min(max(value, 0.0), 1e18)) if value == value else 0
