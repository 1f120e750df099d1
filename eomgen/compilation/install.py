"""Install: for the build of the package, the layer translated, and compiled where that can be done."""

from __future__ import annotations

import contextlib
import shutil
import sys
import tempfile
from pathlib import Path

from ..layer import read_header, read_layer
from .cache import Cache
from .compiler import find_compiler
from .cython_layer import CONTACTS, ENSEMBLES, FIRST, HEADERS, build_layer
from .installed import write_installed
from .translation import MADE, SOURCE, Translation, choose_translation, run_cython, translation_key


def install_layer(folder: Path, *, compiled: bool) -> None:
    """Fill a folder, in the place of what an earlier build left there.

    Parameters
    ----------
    folder : Path
        ``built`` of the package that is being built.
    compiled : bool
        Whether to compile what single runs need too, for this computer.

    Raises
    ------
    ToolchainError
        No compiler, no headers of Python, or the compiler fails; the translations are there.
    MissingDependencyError
        Cython is not installed.
    """
    layer, headers = read_layer(), {header: read_header(header) for header in HEADERS}
    with tempfile.TemporaryDirectory(prefix="eomgen-") as private:
        made, translations = Path(private, "built"), []
        for share in (FIRST, ENSEMBLES, CONTACTS):
            texts = share.choose(layer)
            version, ready = choose_translation(texts)
            text = _translate(texts, Path(private)) if ready is None else ready.read_bytes()
            write_installed(made, key := translation_key(texts), {MADE: text}, {"cython": version})
            translations.append(Translation(version, made / key / MADE))
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(made, folder)
        if compiled:
            cache = Cache(Path(private, "cache"))
            objects = build_layer(cache, layer, headers, find_compiler(), tell, FIRST, translations[0])
            files = {path.name: path.read_bytes() for path in objects}
            write_installed(folder, objects[0].parent.name, files, {"for": "single runs"})


def tell(line: str) -> None:
    """Tell what is being done, which pip shows when it is asked to (``pip install -v``)."""
    print(f"eomgen: {line}", file=sys.stderr)


def _translate(texts: dict[str, str], private: Path) -> bytes:
    with tempfile.TemporaryDirectory(dir=private) as place, contextlib.chdir(place):  # no folder's name in the C text
        for name, text in texts.items():
            Path(name).write_text(text, encoding="utf-8")
        run_cython(Path(SOURCE))
        return Path(MADE).read_bytes()
