"""A Module <-> what a worker on any machine needs to have it: the file of its code, or the sources to build it from."""

from __future__ import annotations

import hashlib
import json
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from ..base.algebra import Array
from ..base.files import MANIFEST, read_entry
from ..errors import MissingDependencyError, ToolchainError, cannot
from ..runtime.late import eager
from ..runtime.pickling import processor_features, restore

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel


class Handle(NamedTuple):
    """A module as it travels.

    Attributes
    ----------
    kind : type
        Of the module.
    name, file : str
        Import name and file of its code where it was made.
    digest : str
        SHA-256 of that file.
    recipe : str
        JSON with the model's name, the source texts and the options to build it with; empty where there are none (an
        installed package).
    needs : tuple of str
        What the processor must have, for code compiled for the one where it was made (``native=True``): its features.
    p, u : arrays
        Values bound.
    """

    kind: type[BoundModel]
    name: str
    file: str
    digest: str
    recipe: str
    p: Array
    u: Array
    needs: tuple[str, ...] = ()

    def open(self) -> BoundModel:
        """The module: from its own file if that is here, the same and for this processor, else built from the sources,
        or imported.

        Raises
        ------
        ToolchainError
            It cannot be built here.
        """
        core = _open(self.name, self.file, self.digest, self.recipe, self.needs)
        return self.kind(core, self.p, self.u)


def describe(module: BoundModel) -> Handle:
    """How workers get a module.

    Raises
    ------
    UsageError
        Its code has no file of its own.
    """
    core: Any = eager(module.core)
    file = str(getattr(core, "__file__", "") or "")
    if not file or not Path(file).is_file():
        raise cannot(f"the module of {module.name!r} is not in a file that workers could load; use target cython")
    if hasattr(core, "take_lanes"):
        core.take_lanes()  # here, once, so that workers find them beside the module
    recipe = _recipe(Path(file))
    facts = json.loads(recipe) if recipe else {"options": {}, "needs": ()}
    needs = tuple(sorted(processor_features())) if facts["options"].get("native", False) else tuple(facts["needs"])
    return Handle(type(module), core.__name__, file, digest(file), recipe, module.p, module.u, needs)


def digest(file: str) -> str:
    """SHA-256 of a file."""
    return hashlib.sha256(Path(file).read_bytes()).hexdigest()


def _recipe(file: Path) -> str:
    if not (file.parent / MANIFEST).is_file():
        return ""
    try:
        facts, files = read_entry(file.parent)
    except (OSError, ValueError) as error:
        raise ToolchainError(
            f"the compiled code of the module is damaged: {error}; compile the model again", code="EG-FILE-DAMAGED"
        ) from None
    folder = "sources/"
    sources = {n.removeprefix(folder): text.decode() for n, text in sorted(files.items()) if n.startswith(folder)}
    if not sources:
        return ""
    how = {key: facts["recipe"].get(key, none) for key, none in (("options", {}), ("needs", []))}
    return json.dumps({"name": facts["name"], "sources": sources, **how})


@lru_cache(maxsize=8)
def _open(name: str, file: str, wanted: str, recipe: str, needs: tuple[str, ...] = ()) -> Any:
    if processor_features().issuperset(needs) and Path(file).is_file() and digest(file) == wanted:
        return restore(_core, name, file, None, None)  # type: ignore[arg-type]
    if not recipe:
        try:
            return import_module(name)
        except ImportError as error:
            raise ToolchainError(
                f"this worker has no module {name}: install its package there", code="EG-PACKAGE-MISSING"
            ) from error
    try:
        compilation = import_module("eomgen.compilation")
    except ImportError as error:
        raise MissingDependencyError(
            "a worker on another machine builds the module itself, so it needs eomgen: pip install eomgen there"
        ) from error
    facts = json.loads(recipe)
    options = compilation.Options(**facts["options"])
    return compilation.load_core(compilation.compile_model(facts["sources"], facts["name"], options))


def _core(core: Any, p: None, u: None) -> Any:
    return core
