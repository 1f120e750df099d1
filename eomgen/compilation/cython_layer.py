"""Cython layer: _core.pyx and the steppers -> object files, compiled once per interpreter, linked with every model.

There are three builds of it. The first has what a single run needs. The two others have ensembles and rigid contacts;
each is made when a model first asks for it (:mod:`.late_classes`).
"""

from __future__ import annotations

import importlib.machinery
import os
import platform
import re
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import ToolchainError
from ..layer import LAYER
from .cache import Cache, compute_key
from .commands import COMPILE, Running, raise_failure
from .compiler import CompilerInfo
from .installed import find_installed
from .options import layer_flags, stepper_flags
from .processor import lane_width
from .products import require_object, stamp, write_stamp
from .translation import MADE, Translation, choose_translation, translate

_OBJECT = "_core.o"
#: Of a model, that the layer reads too.
HEADERS = ("eomgen.h", "eomgen_real.h", "eomgen_processor.h", "eomgen_contraction.h")


class Share(NamedTuple):
    """One of the three builds of the layer.

    Attributes
    ----------
    without : frozenset of str
        Files of the Cython text that are not included.
    c_files : tuple of str
        C files that are compiled.
    """

    without: frozenset[str]
    c_files: tuple[str, ...]

    def choose(self, texts: Mapping[str, str]) -> dict[str, str]:
        """The texts that it is made from."""
        lines = {f'include "{name}"' for name in self.without}
        return {
            name: "".join(line for line in text.splitlines(keepends=True) if line.rstrip() not in lines)
            for name, text in texts.items()
            if name not in self.without and (not name.endswith(".c") or name in self.c_files)
        }


FIRST = Share(frozenset({"_ensembles.pxi", "_contacts.pxi"}), ("eomgen_steppers.c", "eomgen_wide_steps.c"))
_CALLS = {"_kernel.pxi", "_calls.pxi", "_integrators.pxi"}
#: Linked with the C files of the first.
ENSEMBLES = Share(
    frozenset({*_CALLS, "_contacts.pxi"}),
    tuple(name for name in LAYER if re.fullmatch(r"eomgen_(ensembles|runs\d)\.c", name)),
)
CONTACTS = Share(
    frozenset({*_CALLS, "_journeys.pxi", "_frozen.pxi", "_ensembles.pxi"}),
    tuple(name for name in LAYER if re.fullmatch(r"eomgen_(wide_)?contacts\.c", name)),
)
_OF = {ENSEMBLES: " of ensembles", CONTACTS: " of rigid contacts"}


def describe_interpreter() -> dict[str, str]:
    """What a compiled extension must agree with: interpreter, NumPy and platform."""
    return {
        "suffix": importlib.machinery.EXTENSION_SUFFIXES[0],
        "tag": str(sys.implementation.cache_tag),
        "numpy": np.__version__,
        "platform": f"{sys.platform}-{platform.machine()}",
    }


def describe_layer(texts: Mapping[str, str], headers: Mapping[str, str], compiler: CompilerInfo) -> dict[str, Any]:
    """What the layer depends on, apart from the version of Cython.

    Models' keys hold this: a module that is built already needs no Cython to be found.
    """
    flags = [layer_flags(compiler), *(_c_flags(compiler, file) for file in texts if file.endswith(".c"))]
    return {
        "kind": "layer", "sources": {**texts, **headers}, "flags": flags,
        "compiler": [*compiler.command, compiler.version], "interpreter": describe_interpreter(),
    }  # fmt: skip


def build_layer(
    cache: Cache,
    texts: Mapping[str, str],
    headers: Mapping[str, str],
    compiler: CompilerInfo,
    progress: Callable[[str], None] | None = None,
    share: Share = FIRST,
    translation: Translation | None = None,
) -> list[Path]:
    """Find object files of the layer in the cache or the package, or make them; the Cython text's is the first.

    Parameters
    ----------
    cache : Cache
        Where it is kept.
    texts : mapping of str to str
        The layer's files.
    headers : mapping of str to str
        Texts of ``HEADERS``.
    compiler : CompilerInfo
        Who compiles.
    progress : callable, optional
        Told what is being done.
    share : Share
        Which of them.
    translation : Translation, optional
        Of the share's text; chosen here by default.

    Raises
    ------
    MissingDependencyError
        If Cython is not installed.
    ToolchainError
        If Python's headers are missing, or Cython or the compiler fails.
    """
    texts = share.choose(texts)
    translation = translation or choose_translation(texts)
    key = compute_key({**describe_layer(texts, headers, compiler), "cython": translation.version})
    found = cache.find(key) or find_installed(key)
    if found is not None:
        return _objects(found.directory, share)
    from concurrent.futures import ThreadPoolExecutor  # slow to import

    includes = [f"-I{find_python_headers()}", f"-I{np.get_include()}"]
    if progress is not None:
        progress(f"building the Cython layer{_OF.get(share, '')} (once)")
    with cache.attempt(key) as directory:
        for name, text in {**texts, **headers}.items():
            (directory / name).write_text(text, encoding="utf-8")
        commands = [
            *(
                [*compiler.command, *_c_flags(compiler, name), "-I.", "-c", name, "-o", f"{name}.o"]
                for name in share.c_files
            ),
            [*compiler.command, *layer_flags(compiler), "-I.", *includes, "-c", MADE, "-o", _OBJECT],
        ]

        def compile_one(command: list[str]) -> None:
            made = command[-1]
            command = [*command[:-4], *write_stamp(directory, key, made), *command[-4:]]
            result = running.run(command, directory, 10.0 * COMPILE)
            if result.returncode != 0:
                raise_failure(f"compiling the Cython layer {directory / command[-3]}", result, directory)
            require_object(directory / made, stamp(key, made), command)
            (directory / f"{made}.stamp.h").unlink()

        running = Running()
        with ThreadPoolExecutor(max(1, (os.cpu_count() or 2) - 1)) as pool:  # while this thread sees to Cython's text
            try:
                others = pool.map(compile_one, commands[:-1])
                translate(translation, directory)
                compile_one(commands[-1])
                list(others)
            except BaseException:
                running.stop()
                pool.shutdown(wait=True, cancel_futures=True)
                raise
        (directory / MADE).unlink()
        recipe = {"commands": commands, "cython": translation.version}
        return _objects(cache.publish(directory, key, "layer", "_core", _OBJECT, recipe).directory, share)


def _c_flags(compiler: CompilerInfo, file: str) -> list[str]:
    """Flags of a C file, with all lanes that this processor takes: models choose."""
    widest = lane_width()
    plain = file in ("eomgen_steppers.c", "eomgen_contacts.c")  # where there are wide ones, these are not run
    flags = stepper_flags(compiler, wide=widest < 4 or not plain)
    return [*flags, f"-DEOMGEN_LANES={sum(w for w in (2, 4, 8) if w <= widest)}"]


def _objects(directory: Path, share: Share) -> list[Path]:
    return [directory / name for name in (_OBJECT, *(f"{name}.o" for name in share.c_files))]


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
            'python3-devel), or use target="c" or target="numpy", which need none',
            code="EG-COMPILER-MISSING",
        )
    return directory
