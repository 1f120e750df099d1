"""Robots, MJCF: what a file would make MuJoCo read -> checked before MuJoCo sees it, with the lines of its elements.

MuJoCo's compiler opens files named by a model (includes, meshes, textures, height fields, attached models).  Here every
one of them is looked up first: it must lie inside one folder, and those in XML pass the same strict parser.
"""

from __future__ import annotations

import os
from collections import Counter
from pathlib import Path

from ..errors import ModelError, Problem
from .constructs import Met, count_all, is_whole
from .mjcf_constructs import find_mjcf, path_of
from .xml_text import Element, read_xml

FILES = 200  #: XML files that a model may be made of
COPIES = 10_000  #: bodies that <replicate>, <composite> and <flexcomp> may make, themselves counted, over all files
PIXELS = 16_384  #: width or height of a texture, rows or columns of a height field

_COUNTED = ("replicate", "composite", "flexcomp")
_SIZES = ("width", "height", "nrow", "ncol")
Lines = dict[tuple[str, str], tuple[str, int]]


def scan_files(root: Element, folder: str | None) -> tuple[Lines, Met]:
    """Check every file that a model names.

    Parameters
    ----------
    root : Element
        The model's own file.
    folder : str, optional
        Where all files must lie; the folder of the model's file by default.

    Returns
    -------
    lines : dict
        (tag, name) -> file and line of the named elements of all its XML files.
    met : Counter
        Elements and attributes of all of them, by their paths in the table of constructs.

    Raises
    ------
    ModelError
        A file lies outside, cannot be read, or the model would become absurdly large.
    """
    scan = _Scan(root, folder)
    scan.elements(root)
    scan.attachments()
    scan.assets()
    if scan.problems:
        raise ModelError(scan.problems)
    return scan.lines, scan.met


class _Scan:
    """Walks a model and the files it includes."""

    def __init__(self, root: Element, folder: str | None) -> None:
        self.main = Path(root.file).resolve().parent
        self.allowed = self.main if folder is None else Path(folder).resolve()
        self.seen: set[Path] = {Path(root.file).resolve()}
        self.lines: Lines = {}
        self.met: Met = Counter()
        self.problems: list[Problem] = []
        self.named: list[Element] = []  # elements that name a file
        self.made = self.bodies = 0  # bodies by copying; all bodies
        self.attached: list[tuple[Element, int]] = []
        self.models: dict[str, int] = {}  # model to attach -> its bodies
        self.folders: dict[str, set[str]] = {"mesh": set(), "texture": set()}
        if not self._inside(self.main):
            message = f"{root.file} lies outside the folder {folder} of its assets"
            raise ModelError([root.problem("assets", message, "name a folder that holds the model")])

    def _inside(self, path: Path) -> bool:
        return path == self.allowed or self.allowed in path.parents

    def elements(self, root: Element, copies: int = 1, inside: str | None = None) -> None:
        """Take in the elements of one XML file, of which MuJoCo makes this many copies.

        ``inside`` is the tag of the element in which an included file stands.
        """
        waiting: list[tuple[Element, int, str | None]] = [(root, copies, "")]
        while waiting:
            element, above, parent = waiting.pop()
            here = element.tag
            if element is root and inside is not None:
                here = inside  # what is in it stands where the include stands
            elif parent is not None:
                path = path_of(parent, element.tag)
                self.met.update(count_all([(path, element.attributes)]))
                row = find_mjcf(path)
                if row is None or is_whole(row):
                    here = ""
            made = self._element(element, above, parent)
            below = here if parent is not None and here else None
            waiting += [(child, made, below) for child in reversed(element.children)]

    def _element(self, element: Element, copies: int, parent: str | None) -> int:
        """Take in one element; returns the number of copies of what it holds."""
        given = element.attributes
        if "name" in given:
            self.lines.setdefault((element.tag, given["name"]), (element.file, element.line))
        if element.tag == "compiler":
            for key, kinds in (("assetdir", ("mesh", "texture")), ("meshdir", ("mesh",)), ("texturedir", ("texture",))):
                for kind in kinds if key in given else ():
                    self.folders[kind].add(given[key])
        counted = element.tag in _COUNTED
        if counted:
            copies *= self._count(element)
        if element.tag == "attach":
            self.attached.append((element, copies))
        elif counted or element.tag == "body":
            self.bodies += copies
            if counted or copies > 1:
                self._make(element, copies)
        for key in _SIZES:
            if key in given and _whole(given[key]) > PIXELS:
                message = f"{given[key][:20]} is too large"
                self.problems.append(element.problem(f"{element.tag}.{key}", message, f"at most {PIXELS:,}"))
        if element.tag == "include" or (element.tag == "model" and "file" in given):
            before = self.bodies
            self._include(element, copies, parent)
            if element.tag == "model":
                self.models[given.get("name", Path(given["file"]).stem)] = self.bodies - before
        elif any(key.startswith("file") for key in given):
            self.named.append(element)
        return copies

    def attachments(self) -> None:
        """Count the bodies of models that copies attach."""
        for element, copies in self.attached:
            if copies > 1:
                self._make(element, copies * max(1, self.models.get(element.attributes.get("model", ""), 1)))

    def _make(self, element: Element, bodies: int) -> None:
        """Count bodies that copying makes, of siblings and of all files; one problem tells of too many."""
        if self.made <= COPIES < self.made + bodies:
            self.problems.append(element.problem(element.tag, "makes too many bodies", f"at most {COPIES:,} in all"))
        self.made += bodies

    def _count(self, element: Element) -> int:
        total = 1
        for part in element.attributes.get("count", "1").split():
            total *= max(1, _whole(part))
        return total

    def _include(self, element: Element, copies: int, parent: str | None) -> None:
        name = element.attributes.get("file", "")
        places = [(self.main / name), (Path(element.file).resolve().parent / name)]
        path = next((p.resolve() for p in places if p.is_file()), places[0].resolve())
        if not self._check(element, name, path):
            return
        if path in self.seen:
            return
        self.seen.add(path)
        if len(self.seen) > FILES:
            raise ModelError([element.problem("include", "too many files", f"at most {FILES}")])
        try:
            included = element.tag == "include"
            self.elements(read_xml(os.fspath(path)), copies if included else 1, parent if included else None)
        except OSError as error:
            message = f"{name!r} cannot be read: {error.strerror}"
            self.problems.append(element.problem(element.tag, message, "the path starts at the model's folder"))

    def assets(self) -> None:
        """Check where meshes, textures and the like are."""
        for element in self.named:
            kind = "texture" if element.tag == "texture" else "mesh"
            for key, name in element.attributes.items():
                if not key.startswith("file"):
                    continue
                for folder in self.folders[kind] or {""}:
                    if not self._check(element, name, (self.main / folder / name).resolve()):
                        break

    def _check(self, element: Element, name: str, path: Path) -> bool:
        """Whether a file lies inside; a fault is noted if not."""
        if self._inside(path):
            return True
        message = f"{name!r} is outside the folder {self.allowed}; it is not read"
        remedy = "name a folder that holds all files of the model: assets=..., or --assets"
        self.problems.append(element.problem(f"{element.tag}.file", message, remedy))
        return False


def _whole(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        return 1
