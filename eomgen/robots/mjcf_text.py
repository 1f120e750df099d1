"""Robots, MJCF: trees of elements -> one text for MuJoCo without a name of the user's files, and the bytes it needs.

MuJoCo gets what acts on the motion and nothing else: sensors, stored states, sizes and looks stay here, pictures and
height fields are replaced by the smallest ones.  Each element stands on a line of its own, so that a line that MuJoCo
names leads back to the file and line it came from.
"""

from __future__ import annotations

import os
import re
from xml.sax.saxutils import quoteattr

from ..base.limits.numbers import MESHES
from ..errors import ModelError, Problem
from .contained import Folder, plain, stem
from .mjcf_files import Trees
from .xml_text import XmlElement

#: Elements that say nothing of the motion, below the root or where they stand.
_UNUSED = {"size", "statistic", "visual", "sensor", "keyframe", "custom"}
_FOLDERS = ("assetdir", "meshdir", "texturedir", "strippath")
#: The smallest picture and height field, and the keys that are kept of the user's.
_SMALLEST = {
    "texture": (("type",), {"builtin": "flat", "width": "1", "height": "1"}),
    "hfield": (("size",), {"nrow": "2", "ncol": "2"}),
}
_SUFFIX = re.compile(r"\.[A-Za-z0-9]{1,8}\Z")
_LINE = re.compile(r"line (\d+)")


class Text:
    """What MuJoCo is given.

    Attributes
    ----------
    main : str
        The model.
    files : dict of str to bytes
        What it may read, by names made here.

    Raises
    ------
    ModelError
        A mesh is not there, cannot be read, or all are too large; with other ``problems``.
    """

    def __init__(self, trees: Trees, folder: Folder, problems: list[Problem]) -> None:
        self.folder, self.problems = folder, problems
        self.files: dict[str, bytes] = {}
        self.names = {path: f"model{k}.xml" for k, path in enumerate(trees.models)}
        self.places: list[tuple[str, int]] = []  # of each line: where it comes from
        self.left = MESHES
        self.main = self._tree(trees.main)
        for path, tree in trees.models.items():
            self.files[self.names[path]] = ("\n" * len(self.places) + self._tree(tree)).encode()
        if problems:
            raise ModelError(problems)

    def refusal(self, said: str, root: XmlElement) -> ModelError:
        """The error of what MuJoCo says, its lines led back to the user's files."""
        place = None
        for number in _LINE.findall(said):
            if 0 < int(number) <= len(self.places):
                place = place or self.places[int(number) - 1]
        text = _LINE.sub(lambda found: self._back(int(found[1]), root.file), said)
        for path, made in self.names.items():
            text = text.replace(f"'{made}'", f"'{os.path.basename(path)}'")
        problem = root.problem("mujoco", f"MuJoCo refuses it: {text}", code="EG-FILE-DAMAGED")
        return ModelError([problem._replace(file=place[0], line=place[1]) if place else problem])

    def _back(self, number: int, main: str) -> str:
        if not 0 < number <= len(self.places):
            return f"line {number}"
        file, line = self.places[number - 1]
        return f"line {line}" if file == main else f"line {line} of {os.path.basename(file)}"

    def _tree(self, root: XmlElement) -> str:
        base = os.path.dirname(os.path.realpath(root.file))
        folder, bare = "", False  # of meshes; whether their names lose their folders
        for element in root.all("compiler"):
            given = element.attributes
            folder = given.get("meshdir", given.get("assetdir", folder))
            bare = given.get("strippath", "true" if bare else "") == "true"
        lines: list[str] = []
        waiting: list[tuple[XmlElement, str] | str] = [(root, "")]
        while waiting:
            step = waiting.pop()
            if isinstance(step, str):
                lines[-1] += step  # the end of an element
                continue
            element, parent = step
            tag = element.tag
            if tag == "skin" or (tag in _UNUSED and parent == root.tag):
                continue
            given = self._attributes(element, base, folder, bare)
            shown = "".join(f" {key}={quoteattr(value)}" for key, value in given.items())
            lines.append(f"<{tag}{shown}>")
            self.places.append((element.file, element.line))
            waiting.append(f"</{tag}>")
            waiting += [(child, tag) for child in reversed(element.children)]
        return "\n".join(lines)

    def _attributes(self, element: XmlElement, base: str, folder: str, bare: bool) -> dict[str, str]:
        """Those of an element that MuJoCo gets."""
        tag, given = element.tag, element.attributes
        kept = {key: value for key, value in given.items() if key != "user" and not key.startswith("file")}
        if tag == "compiler":
            return {key: value for key, value in kept.items() if key not in _FOLDERS}
        if tag == "model" and given.get("file") in self.names:
            kept.pop("content_type", None)
            return {**kept, "file": self.names[given["file"]]}
        if tag in _SMALLEST:
            keys, smallest = _SMALLEST[tag]
            kept = {key: kept[key] for key in ("name", *keys) if key in kept} | smallest
            return kept if "name" in kept or "file" not in given else {"name": stem(given["file"]), **kept}
        if tag in ("mesh", "flexcomp") and "file" in given:
            kept["file"] = self._mesh(element, base, folder, bare)
            return kept if "name" in kept or tag == "flexcomp" else {"name": stem(given["file"]), **kept}
        unread = {key: "" for key in given if key.startswith("file")}  # which MuJoCo does not know
        return {**kept, **unread}

    def _mesh(self, element: XmlElement, base: str, folder: str, bare: bool) -> str:
        """The name under which MuJoCo gets a mesh, which is read."""
        name = element.attributes["file"]
        name = plain(name).rpartition("/")[2] if bare else name
        included = os.path.dirname(os.path.realpath(element.file))  # the model's folder comes first
        path = self.folder.find(element, name, [(base, folder), (included, folder)])
        if isinstance(path, Problem):
            self.problems.append(path)
            return ""
        if path not in self.names:
            suffix = _SUFFIX.search(path)
            made = self.names[path] = f"mesh{len(self.names)}{suffix[0].lower() if suffix else ''}"
            try:
                self.files[made] = self.folder.read(element, path, self.left)
            except ModelError as error:
                self.problems += error.problems
                return ""
            self.left -= len(self.files[made])
        return self.names[path]
