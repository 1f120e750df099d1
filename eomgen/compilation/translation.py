"""Translation: the layer's Cython text -> C, as it came with the package, or by the Cython that is installed here."""

from __future__ import annotations

import contextlib
import io
import re
import shutil
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import MissingDependencyError, ToolchainError
from .cache import compute_key
from .installed import find_installed

SOURCE, MADE = "_core.pyx", "_core.c"
_lock = threading.Lock()  # Cython keeps state of its own


class Translation(NamedTuple):
    """How a text becomes C.

    Attributes
    ----------
    version : str
        Of the Cython that translates, or has translated.
    ready : Path or None
        The C file that came with the package.
    """

    version: str
    ready: Path | None


def translation_key(texts: Mapping[str, str]) -> str:
    """What a translation depends on: the text, and the major version of NumPy, whose declarations it reads."""
    sources = {name: text for name, text in texts.items() if name.endswith((".pyx", ".pxi"))}
    return compute_key({"kind": "translation", "sources": sources, "numpy": np.__version__.partition(".")[0]})


def choose_translation(texts: Mapping[str, str]) -> Translation:
    """The translation that came with the package, unless the text was changed or a newer Cython is installed.

    Raises
    ------
    MissingDependencyError
        It must be made, and Cython is not installed.
    """
    try:
        from Cython.Shadow import __version__ as here
    except ImportError:
        here = ""
    found = find_installed(translation_key(texts))
    if found is not None and _order(found.facts["cython"]) >= _order(here):
        return Translation(found.facts["cython"], found.directory / MADE)
    if not here:
        raise MissingDependencyError(
            'target="cython" needs Cython to build its layer once: pip install cython. target="numpy" needs neither '
            "Cython nor a compiler"
        )
    return Translation(here, None)


def translate(translation: Translation, directory: Path) -> None:
    """Make the C file beside the texts in a folder."""
    if translation.ready is not None:
        shutil.copyfile(translation.ready, directory / MADE)
    elif str(directory).isascii():
        run_cython(directory / SOURCE)
    else:  # Cython cannot write this name into C
        _translate_elsewhere(directory)


def _translate_elsewhere(directory: Path) -> None:
    import tempfile  # rarely needed

    with tempfile.TemporaryDirectory(prefix="eomgen-") as plain:
        for path in directory.glob("*.p[yx]*"):
            shutil.copy(path, plain)
        try:
            run_cython(Path(plain, SOURCE))
        except UnicodeError as error:
            raise ToolchainError(
                f"Cython cannot write the name of {plain}: {error}. Set TMPDIR or EOMGEN_CACHE_DIR to a name in ASCII"
            ) from error
        shutil.copy(Path(plain, MADE), directory)


def run_cython(source: Path) -> None:
    """Translate the layer to C in this process; cythonize would want setuptools."""
    from Cython.Compiler import Main

    compile_file: Callable[..., Any] = Main.compile
    said = io.StringIO()
    with _lock, contextlib.redirect_stderr(said):
        result = compile_file(str(source), output_file=str(source.with_suffix(".c")), language_level=3)
    if result.num_errors:
        raise ToolchainError(f"Cython cannot translate {source}:\n{said.getvalue()}", "cython", said.getvalue())


def _order(version: str) -> tuple[int, ...]:
    return tuple(int(number) for number in re.findall(r"\d+", version)[:3])
