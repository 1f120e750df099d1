"""The extension module ``eomgen._native``: kernels, runs, ensembles and rigid contacts of all models, compiled once.

It comes with the package (``setup.py``). In a clone, whose sources change, it is compared with them when it is first
needed, and built anew in its place where they differ.
"""

from __future__ import annotations

import importlib.machinery
import os
import sys
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from threading import Lock
from types import ModuleType
from typing import Any

from ..errors import MissingDependencyError, ToolchainError
from .layer import SOLVER, read_native
from .trusted_files import digest, locked

NAME = "_native"
PACKAGE = Path(__file__).parents[1]
#: C files of which x86-64 has another text for wide vectors, taken from six states on. Compiled as models are, runs of
#: fewer states take 0.85 of the time that vectorized loops take (gcc 12, pendulum).
PLAIN = ("eomgen_steppers.c", "eomgen_contacts.c")
PATIENCE = 300.0  #: seconds to wait for another process that builds it
_lock = Lock()


def find_native() -> ModuleType:
    """The module, built now if need be.

    Raises MissingDependencyError (it must be built, and Cython is not installed), ToolchainError (it must be built, and
    there is no compiler, there are no headers of Python, or the build fails).
    """
    name, clone = f"{__package__.partition('.')[0]}.{NAME}", PACKAGE.parent / "pyproject.toml"
    with _lock:
        if name not in sys.modules and clone.is_file() and not _is_current():
            with locked(clone, PATIENCE):
                if not _is_current():  # nor has another process built it
                    print("eomgen: building eomgen._native from its changed sources", file=sys.stderr)
                    build_native(PACKAGE)
        return import_module(name)


def _is_current() -> bool:
    try:
        return digest_sources().encode() in product_in(PACKAGE).read_bytes()
    except FileNotFoundError:
        return False


@cache
def digest_sources() -> str:
    """SHA-256 of the texts that the module is compiled from."""
    return digest("\n".join(f"{name}\n{text}" for name, text in read_native().items()).encode())


def product_in(folder: Path) -> Path:
    """The module's file in a folder."""
    return folder / f"{NAME}{importlib.machinery.EXTENSION_SUFFIXES[0]}"


def build_native(folder: Path) -> None:
    """Build the module into a folder, in the place of an earlier one; errors are those of :func:`find_native`."""
    import tempfile

    from .build import compile_and_link, solver_flags
    from .compiler import Options, allowed, compile_flags, find_compiler, is_x86, link_flags, machine_flags, run

    if find_spec("Cython") is None:
        raise MissingDependencyError("eomgen._native is built with Cython: pip install cython")
    headers, compiler, product = find_python_headers(), find_compiler(), product_in(folder)
    numpy: Any = import_module("numpy")
    # for all processors of this kind: wider vectors are chosen when it runs
    plain = [*compile_flags(Options(), compiler, 0, portable=True), "-fvisibility=hidden"]
    wide = [*compile_flags(Options(optimize=2), compiler, 0, portable=True), "-fvisibility=hidden"]
    wide += ["-ftree-vectorize"] if compiler.kind == "gcc" else []
    bound = ["-O2", "-fPIC", "-fwrapv", "-fvisibility=hidden", "-DNDEBUG", *machine_flags(Options(), compiler)]
    bound += [f'-DEOMGEN_SOURCES="{digest_sources()}"', "-DNPY_NO_DEPRECATED_API=NPY_1_7_API_VERSION"]
    bound += [f"-I{headers}", f"-I{numpy.get_include()}"]
    with tempfile.TemporaryDirectory(prefix="eomgen-") as private:
        for name, text in read_native().items():
            Path(private, name).write_text(text, encoding="utf-8")
        # in the folder, so that its name is not in the C text
        cython = [sys.executable, "-P", "-m", "cython", "-3", f"{NAME}.pyx"]
        run(cython, Path(private), allowed(0), f"translating {NAME}.pyx")
        files = {Path(path.name): wide for path in sorted(Path(private).glob("*.c"))}
        files |= {Path(name): plain for name in PLAIN if is_x86()}
        files |= {Path(SOLVER): solver_flags(plain, Options(), compiler), Path(f"{NAME}.c"): bound}
        link = link_flags(Options(), compiler, extension=True)
        made = compile_and_link(Path(private), NAME, files, link, compiler, suffix=product.name.removeprefix(NAME))
        folder.mkdir(parents=True, exist_ok=True)
        aside = folder / f".{os.getpid()}-{product.name}"
        aside.write_bytes(Path(private, made).read_bytes())
        aside.chmod(0o755)
        os.replace(aside, product)


def find_python_headers() -> Path:
    """Directory of Python.h. Raises ToolchainError (it is not installed)."""
    import sysconfig

    directory = Path(sysconfig.get_path("include"))
    if not (directory / "Python.h").is_file():
        raise ToolchainError(
            f"Python's C headers are missing: there is no {directory / 'Python.h'}. Install them (Debian, Ubuntu: "
            f"apt install python{sys.version_info[0]}.{sys.version_info[1]}-dev or python3-dev; Fedora: dnf install "
            "python3-devel)",
            code="EG-COMPILER-MISSING",
        )
    return directory
