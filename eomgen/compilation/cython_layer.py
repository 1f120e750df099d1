"""Cython layer: _core.pyx -> an object file, compiled once per interpreter and linked with every model."""

from __future__ import annotations

import importlib
import importlib.machinery
import platform
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import MissingDependencyError, ToolchainError
from .cache import Cache, CacheEntry, compute_key
from .compiler import CompilerInfo, raise_failure, run
from .options import layer_flags

SOURCE = "_core.pyx"
HEADER = "eomgen.h"
_OBJECT = "_core.o"
_lock = threading.Lock()  # Cython keeps state of its own


def read_layer() -> str:
    """The text of _core.pyx that comes with eomgen."""
    templates = importlib.import_module("eomgen.templates")
    return (Path(templates.__path__[0]) / "cython" / SOURCE).read_text(encoding="utf-8")


def describe_interpreter() -> dict[str, str]:
    """What a compiled extension must agree with: interpreter, NumPy and platform."""
    return {
        "suffix": importlib.machinery.EXTENSION_SUFFIXES[0],
        "tag": str(sys.implementation.cache_tag),
        "numpy": np.__version__,
        "platform": f"{sys.platform}-{platform.machine()}",
    }


def describe_layer(text: str, header: str, compiler: CompilerInfo) -> dict[str, Any]:
    """What the layer depends on, apart from the version of Cython.

    Models' keys hold this: a module that is built already needs no Cython to be found.
    """
    return {
        "kind": "layer", "sources": {SOURCE: text, HEADER: header}, "flags": layer_flags(compiler),
        "compiler": [*compiler.command, compiler.version], "interpreter": describe_interpreter(),
    }  # fmt: skip


def build_layer(
    cache: Cache, text: str, header: str, compiler: CompilerInfo, progress: Callable[[str], None] | None = None
) -> CacheEntry:
    """Find the layer's object file in the cache, or make it.

    Parameters
    ----------
    cache : Cache
        Where it is kept.
    text, header : str
        Texts of _core.pyx and eomgen.h.
    compiler : CompilerInfo
        Who compiles.
    progress : callable, optional
        Told what is being done.

    Raises
    ------
    MissingDependencyError
        If Cython is not installed.
    ToolchainError
        If Python's headers are missing, or Cython or the compiler fails.
    """
    try:
        from Cython.Shadow import __version__ as version
    except ImportError as error:
        raise MissingDependencyError(
            'target="cython" needs Cython to build its layer once: pip install cython. target="numpy" needs neither '
            "Cython nor a compiler"
        ) from error
    key = compute_key({**describe_layer(text, header, compiler), "cython": version})
    if (entry := cache.find(key)) is not None:
        return entry
    includes = [f"-I{find_python_headers()}", f"-I{np.get_include()}"]
    if progress is not None:
        progress("building the Cython layer (once)")
    with cache.attempt(key) as directory:
        (directory / SOURCE).write_text(text, encoding="utf-8")
        (directory / HEADER).write_text(header, encoding="utf-8")
        _run_cython(directory / SOURCE)
        command = [*compiler.command, *layer_flags(compiler), "-I.", *includes, "-c", "_core.c", "-o", _OBJECT]
        result = run(command, directory)
        if result.returncode != 0:
            raise_failure(f"compiling the Cython layer {directory / '_core.c'}", result, directory)
        (directory / "_core.c").unlink()
        return cache.publish(directory, key, "layer", "_core", _OBJECT, {"command": command, "cython": version})


def _run_cython(source: Path) -> None:
    """Translate the layer to C in this process; cythonize would want setuptools."""
    import contextlib
    import io

    from Cython.Compiler import Main

    translate: Callable[..., Any] = Main.compile
    said = io.StringIO()
    with _lock, contextlib.redirect_stderr(said):
        result = translate(str(source), output_file=str(source.with_suffix(".c")), language_level=3)
    if result.num_errors:
        raise ToolchainError(f"Cython cannot translate {source}:\n{said.getvalue()}", "cython", said.getvalue())


def find_python_headers() -> Path:
    """Directory of Python.h.

    Raises
    ------
    ToolchainError
        If it is not installed.
    """
    import sysconfig

    directory = Path(sysconfig.get_path("include"))
    if not (directory / "Python.h").is_file():
        raise ToolchainError(
            f"Python's C headers are missing: there is no {directory / 'Python.h'}. Install them (Debian, Ubuntu: "
            f"apt install python{sys.version_info[0]}.{sys.version_info[1]}-dev or python3-dev; Fedora: dnf install "
            'python3-devel), or use target="c" or target="numpy", which need none'
        )
    return directory
