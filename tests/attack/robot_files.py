"""Hostile robot files: URDF, MJCF with the files it names, and meshes; trees of elements changed, and texts broken.

A file called ``secret`` lies beside the folder of the case.  What is in it must not come out, whatever a model says.
"""

import base64
import copy
import random
import re
import struct
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

from attack.robot_words import BASES, DECLARATIONS, FILES, MESHES, NUMBERS, PIECES, VALUES
from attack.runner import Kind, Wrong
from attack.words import TEXTS
from attack.yaml_files import answered

import eomgen as eg

#: Elements and attributes that the words themselves use, and some more.
_WORDS = {name: " ".join([*BASES[name], *PIECES[name]]) for name in BASES}
MORE_TAGS = {"a:b", "robot", "mujoco", "Include"}
TAGS = {name: sorted({*re.findall(r"<([\w:]+)", text), *MORE_TAGS}) for name, text in _WORDS.items()}
MORE = "fileup fileback nrow ncol width height content_type user nuser_body nkey class name plugin key value radius length".split()
NAMES = {name: sorted({*re.findall(r" (\w+)=", text), *MORE}) for name, text in _WORDS.items()}

OPTIONS: dict[str, tuple[Any, ...]] = {
    "floating": (True,), "mimic": ("coupling",), "actuate": (True,), "symbolic": (True,), "friction": (0.01,),
    "rotation": ("euler_parameters",), "check_inertia": ("note", "off"), "merge": (False,),
    "lock": ({"j1": 0.2}, {"j2": 1e308}), "gravity": ((0, 0, 1e308),),
}  # fmt: skip
SECRET = "SECRET"
MASS = 12345.678  #: of the body that the secret file describes
ENCODINGS = ("utf-16", "utf-32", "utf-8-sig", "utf-7", "cp1252", "latin-1")


class Robots(Kind):
    """Robot files of one dialect.

    A case is ``{"files": {name: text or base64 of bytes}, "main": name, "options": {...}, "stage": "load" | "check"}``.
    """

    def __init__(self, name: str, suffix: str, programs: frozenset[str]) -> None:
        self.name, self.suffix, self.programs = name, suffix, programs

    def prepare(self, folder: Path) -> None:
        (folder / "secret.xml").write_text(
            f'<mujoco><worldbody><body name="{SECRET}"><joint/><geom size="1"/></body></worldbody></mujoco>'
        )
        (folder / "secret.stl").write_bytes(stl(1.0))
        for text in BASES[self.name][:1]:  # imports whatever the cases need
            (folder / f"first{self.suffix}").write_text(text)
            eg.load(folder / f"first{self.suffix}").mechanism()

    def make(self, r: random.Random) -> dict[str, Any]:
        files: dict[str, Any] = {}
        main = "model" + self.suffix
        if self.name == "urdf":
            files[main] = broken_xml(r, "urdf")
        else:
            for name, text in r.sample(sorted(FILES.items()), r.randint(0, 3)):
                files[name] = text if r.random() < 0.7 else broken_xml(r, "mjcf", text)
            for name in r.sample(sorted(MESHES), r.randint(0, 2)):
                files[name] = encoded(mesh(r, name))
            files[main] = broken_xml(r, "mjcf")
        options = {key: r.choice(values) for key, values in OPTIONS.items() if r.random() < 0.08}
        if self.name == "mjcf":
            options.pop("floating", None)
        return {"files": files, "main": main, "options": options, "stage": r.choice(("load", "load", "load", "check"))}

    def build(self, case: Any) -> Any:
        for name, data in case["files"].items():
            path = Path(name)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(decoded(data))
        return case

    def run(self, case: Any, folder: Path) -> str:
        try:
            if case["stage"] == "check":
                return answered(["check", case["main"]], (0, 1))
            model = eg.load(case["main"], **case["options"])
            text = model.to_yaml()
            model.mechanism()
        except eg.ModelError as error:
            text = str(error)
            if SECRET in text and SECRET not in str(case):
                raise Wrong("an error quotes a file outside") from None
            raise
        if (SECRET in text and SECRET not in str(case)) or str(MASS) in text:
            raise Wrong("a file outside was read")
        return "loaded"


class Meshes(Robots):
    """Mesh files, of which a model file takes the inertia of a body."""

    def prepare(self, folder: Path) -> None:
        (folder / "secret.stl").write_bytes(stl(1.0))
        case = {"files": {"a.stl": encoded(stl(1.0)), "model.yaml": solid("a.stl")}, "main": "model.yaml"}
        for name, data in case["files"].items():  # type: ignore[attr-defined]
            (folder / name).write_bytes(decoded(data))
        eg.load(folder / "model.yaml").mechanism()

    def make(self, r: random.Random) -> dict[str, Any]:
        name = r.choice(sorted(MESHES)) if r.random() < 0.3 else "a.stl"
        odd = ("a\\0.stl", "\\uD800.stl", ".", "a.stl/", "A.STL", "x" * 300 + ".stl", "nul.stl")
        told = r.choice((*(name,) * 4, *odd))
        files = {name: encoded(mesh(r, name)), "model.yaml": solid(told)}
        return {"files": files, "main": "model.yaml", "options": {}, "stage": r.choice(("load", "load", "check"))}


def solid(name: str) -> str:
    """A model whose body is a mesh."""
    return (
        f'name: m\nbodies: {{b: {{solids: [{{type: mesh, file: "{name}", density: 1000}}]}}}}\n'
        "joints: {j: {type: revolute, between: [ground, b], coordinate: q}}\n"
    )


def encoded(data: bytes) -> dict[str, str]:
    """Bytes as JSON has them."""
    return {"base64": base64.b64encode(data).decode()}


def decoded(data: Any) -> bytes:
    """The bytes of a file of a case."""
    if isinstance(data, dict):
        return base64.b64decode(data["base64"])
    text: str = data
    return text.encode("utf-8", "surrogatepass")


def stl(size: float, count: int | None = None) -> bytes:
    """A tetrahedron as a binary STL file, its header telling of ``count`` triangles."""
    corners = [(0.0, 0.0, 0.0), (size, 0.0, 0.0), (0.0, size, 0.0), (0.0, 0.0, size)]
    faces = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    body = b"".join(struct.pack("<12fH", 0, 0, 0, *corners[a], *corners[b], *corners[c], 0) for a, b, c in faces)
    return b"\0" * 80 + struct.pack("<I", len(faces) if count is None else count) + body


def mesh(r: random.Random, name: str) -> bytes:
    """The bytes of a mesh: sound, cut, changed, or telling of far more than there is."""
    counts = (None, None, None, 0, 1, 5, 2**31, 2**32 - 1, 100_000_000)
    data = stl(r.choice((1.0, 1e-30, 1e30, 3e38, 1e-6)), r.choice(counts))
    if not name.endswith(".stl") or r.random() < 0.4:
        data = MESHES.get(name, MESHES["text.stl"]).encode()
        for _ in range(r.choice((0, 1, 1, 3))):
            words = data.split(b" ")
            words[r.randrange(len(words))] = r.choice((*NUMBERS, "-1", "99999999999", "1/1/1", "x", "\n", "")).encode()
            data = b" ".join(words)
    k, at = r.randrange(8), r.randrange(len(data) + 1)
    if k == 0:
        return data[:at]
    if k == 1:
        return data[:at] + r.randbytes(r.choice((1, 4, 50))) + data[at + 4 :]
    if k == 2:
        return data * r.choice((2, 100))
    return data


def broken_xml(r: random.Random, dialect: str, text: str | None = None) -> str | dict[str, str]:
    """A file with some of its elements, attributes and letters changed."""
    root = ET.fromstring(text or r.choice(BASES[dialect]))
    for _ in range(r.choice((1, 1, 1, 2, 2, 3, 5, 8))):
        change(root, r, dialect)
    made = ET.tostring(root, encoding="unicode")
    if r.random() < 0.2:
        return letters(made, r)
    return made


def change(root: ET.Element, r: random.Random, dialect: str) -> None:
    """One element or attribute changed."""
    elements = list(root.iter())
    element, k = r.choice(elements), r.randrange(13)
    holders = {child: holder for holder in elements for child in holder}
    keys, names = list(element.attrib), NAMES[dialect]
    if k == 0 and element in holders:
        holders[element].remove(element)
    elif k == 1 and keys:
        del element.attrib[r.choice(keys)]
    elif k in (2, 3) and keys:
        element.set(r.choice(keys), value(r))
    elif k == 4:
        element.set(r.choice(names), value(r))
    elif k == 5 and len(elements) < 400:
        element.append(copy.deepcopy(r.choice(elements)))
    elif k == 6:
        element.tag = r.choice(TAGS[dialect])
    elif k == 7:
        made = ET.SubElement(element, r.choice(TAGS[dialect]))
        for _ in range(r.randint(0, 3)):
            made.set(r.choice(names), value(r))
    elif k == 8 and keys:
        other = r.choice(elements)
        if other.attrib:
            element.set(r.choice(keys), r.choice(list(other.attrib.values())))
    elif k == 9:
        for _ in range(r.choice((1, 5, 50, 199, 300))):
            element = ET.SubElement(element, element.tag, dict(element.attrib))
    elif k in (10, 11) and keys:
        key = r.choice(keys)
        words = element.attrib[key].split() or ["0"]
        words[r.randrange(len(words))] = r.choice((*NUMBERS, repr(r.uniform(-1, 1) * 10.0 ** r.randint(-308, 308))))
        element.set(key, " ".join(words))
    elif k == 12 and PIECES[dialect]:
        element = root if r.random() < 0.8 else element
        element.insert(r.randint(0, len(element)), ET.fromstring(r.choice(PIECES[dialect])))


def value(r: random.Random) -> str:
    """A value of an attribute; XML has no control characters."""
    text = r.choice((r.choice(VALUES), r.choice(VALUES), r.choice(NUMBERS), r.choice(TEXTS)))
    return "".join(letter for letter in text if letter >= " " and not "\ud800" <= letter <= "\udfff")


def letters(text: str, r: random.Random) -> str | dict[str, str]:
    """A text with some of its letters changed."""
    k, at = r.randrange(9), r.randrange(len(text))
    if k == 0:
        marks = ("<", ">", "&", "&x;", "&#0;", "&#10;", '"', "\x00", "</a>", "<a>", "<?p ?>", "]]>", "\x0b", "\ud800")
        return text[:at] + r.choice(marks) + text[at:]
    if k == 1:
        return r.choice(DECLARATIONS) + text
    if k == 2:
        root = text.index("<")
        return text[:root] + r.choice(DECLARATIONS) + text[root:]
    if k == 3:
        return text[:at]
    if k == 4:
        return text[:at] + text[at + r.choice((1, 3, 30)) :]
    if k == 5:
        return encoded(text.encode(r.choice(ENCODINGS), errors="replace"))
    if k == 6:
        return text.replace('name="', 'name="&#10;*\\&#10;/ #error x ', r.randint(1, 3))
    if k == 7:
        return text + text
    return text.replace(">", ">\n", r.randint(1, 5)) + "<!-- -->"


#: The program that compiles MJCF runs in a process of its own, of the same Python.
_PYTHON = frozenset({"python", "python3", *(f"python3.{minor}" for minor in range(11, 20))})
KINDS = {
    "urdf": Robots("urdf", ".urdf", _PYTHON),  # which may turn out to be MJCF
    "mjcf": Robots("mjcf", ".xml", _PYTHON),
    "meshes": Meshes("meshes", ".yaml", frozenset()),
}
