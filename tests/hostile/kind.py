"""What every kind of hostile case shares: how one is made from a seed, run, shown and made smaller."""

from __future__ import annotations

import json
import random
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any, Protocol

#: Name of a kind -> the module of this folder that holds it, as ``KIND`` (one) or in ``KINDS`` (several, by name).
ANOTHER = 1 << 40  #: from the seed of a case that cannot be written down to the next one tried
MODULES = {
    "expressions": "expressions",
    "yaml": "yaml_files",
    "sympy": "sympy_objects",
    "calls": "calls",
    "command_lines": "command_lines",
    "urdf": "robot_files",
    "mjcf": "robot_files",
    "meshes": "robot_files",
}


class Kind(Protocol):
    """One kind of attack.

    A case is a text, or a tree of dicts, lists, texts and numbers that JSON can write: it can be kept as a file.
    """

    name: str
    #: Programs that the package may start for such a case, by the last part of their path; none for most kinds.
    programs: frozenset[str]
    #: Warnings that speak of what was built, not of what the package did with it.
    unjudged: tuple[type[Warning], ...]

    def prepare(self, folder: Path) -> None:
        """Import and compile what the cases need, once in each process, before the guard is armed."""

    def make(self, r: random.Random) -> Any:
        """A case; the same one for the same state of ``r``."""

    def build(self, case: Any) -> Any:
        """What is given to the package: most often the case itself.  What fails here is not the package's."""

    def run(self, given: Any, folder: Path) -> str:
        """Give what was built to the package, in ``folder``, the working directory, where all its files have to stay.

        Returns a word or two on what came out (``fine``, ``exit 1``), which is counted.  An EomgenError is a named
        error; raise :class:`Wrong` for an answer that is no exception and yet wrong.  Anything else is a finding.
        """

    def smaller(self, case: Any) -> Iterator[Any]:
        """Cases that are a little smaller, the boldest cuts first; :func:`fewer` and :func:`trimmed` help."""


class Wrong(Exception):
    """An answer that is no exception and yet wrong; the message says what, in few words that name its kind."""


def find(name: str) -> Kind:
    """The kind of a name."""
    module = import_module(f"hostile.{MODULES[name]}")
    kinds: dict[str, Kind] = getattr(module, "KINDS", None) or {name: module.KIND}
    return kinds[name]


def make(kind: Kind, name: str, seed: int) -> Any:
    """The case of a seed; where it is nested too deeply to be written down, another one."""
    while True:
        try:
            return kind.make(generator(name, seed))
        except RecursionError:
            seed += ANOTHER


def generator(kind: str, seed: int) -> random.Random:
    """The source of all choices of one case."""
    return random.Random(f"{kind} {seed}")


def keep(case: Any, stem: Path) -> Path:
    """Write a case beside ``stem``: a text as ``.txt``, a tree as ``.json``."""
    path = stem.with_suffix(".txt" if isinstance(case, str) else ".json")
    text = case if isinstance(case, str) else json.dumps(case, indent=1)
    path.write_text(text, encoding="utf-8", errors="surrogatepass", newline="")
    return path


def kept(path: Path) -> Any:
    """The case of a file that :func:`keep` wrote."""
    with path.open(encoding="utf-8", errors="surrogatepass", newline="") as file:
        text = file.read()
    return json.loads(text) if path.suffix == ".json" else text


def fewer(parts: list[Any]) -> Iterator[list[Any]]:
    """The list with runs of its items left out: halves first, single items last (delta debugging, Zeller 1999)."""
    size = (len(parts) + 1) // 2
    while size >= 1:
        for start in range(0, len(parts), size):
            yield parts[:start] + parts[start + size :]
        size = size // 2 if size > 1 else 0


def trimmed(text: str) -> Iterator[str]:
    """The text with lines left out, then with characters left out."""
    lines = text.split("\n")
    if len(lines) > 1:
        yield from ("\n".join(rest) for rest in fewer(lines))
    if len(text) < 3000:
        yield from ("".join(rest) for rest in fewer(list(text)))


def pruned(tree: Any) -> Iterator[Any]:
    """The tree with entries left out or one branch made smaller."""
    if isinstance(tree, dict):
        for keys in fewer(list(tree)):
            yield {k: tree[k] for k in keys}
        for key, value in tree.items():
            yield from ({**tree, key: other} for other in pruned(value))
    elif isinstance(tree, list):
        yield from fewer(tree)
        for k, value in enumerate(tree):
            yield from ([*tree[:k], other, *tree[k + 1 :]] for other in pruned(value))
    elif isinstance(tree, str) and len(tree) > 1:
        yield from ("".join(rest) for rest in fewer(list(tree)))
