"""Equations -> a functional mock-up unit, one file with the suffix .fmu."""

from __future__ import annotations

import io
import platform
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from . import pipeline
from .compilation.build import compile_c_library
from .compilation.options import Options
from .emit.fmu import emit_fmu
from .emit.fmu.versions import KERNELS, check_version, require_values
from .errors import UsageError
from .files.path_names import as_path
from .files.writing import write_whole

if TYPE_CHECKING:
    from .api.equations import Equations

#: Folders of binaries, of FMI 2.0 and 3.0, by system and processor; elsewhere a unit holds its sources alone.
_FOLDERS = {
    ("linux", "x86_64"): ("linux64", "x86_64-linux"), ("linux", "aarch64"): (None, "aarch64-linux"),
    ("darwin", "x86_64"): ("darwin64", "x86_64-darwin"), ("darwin", "arm64"): ("darwin64", "aarch64-darwin"),
}  # fmt: skip
_WHEN = (1980, 1, 1, 0, 0, 0)  #: the same model gives the same bytes


def write_fmu(
    equations: Equations,
    path: str | Path | None = None,
    version: str = "2.0",
    progress: Callable[[str], None] | None = None,
) -> Path:
    """Write a functional mock-up unit: model exchange and co-simulation in one file, with its sources in C.

    Parameters
    ----------
    equations : Equations
    path : str or Path, optional
        Of the file, by default ``<name>.fmu`` here; a file of this name is replaced.
    version : {'2.0', '3.0'}, optional
        Of FMI.
    progress : callable, optional
        Told what is being done, a line at a time.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    ModelError
        A parameter has no value, or the model has impacts (events with ``restitution``).
    UsageError
        An unknown version, or a file name that does not end in ``.fmu``.
    ToolchainError
        No compiler, or it failed.

    Notes
    -----
    Variables of the unit: coordinates and velocities, their derivatives ``der(name)``, inputs, parameters (which can be
    set between steps), outputs and the values of events, with units and texts.  Start values are those of the model's
    initial state.  Coordinates that loops make dependent follow from the independent ones during initialization.
    """
    version = check_version(version)
    where = as_path("path", path if path is not None else f"{equations.name}.fmu")
    if where.suffix != ".fmu":
        raise UsageError(f"the name of an FMU ends in .fmu, not as in {str(where)!r}")
    write_whole(where, fmu_bytes(equations, version, progress))
    return where


def fmu_bytes(equations: Equations, version: str, progress: Callable[[str], None] | None = None) -> bytes:
    """The content of the file that :func:`write_fmu` writes; the same model gives the same bytes."""
    program = pipeline.build(equations, "c", KERNELS)
    require_values(program)
    start = equations.compile(target="numpy").x0()
    unit = emit_fmu(program, [float(x) for x in start], version)
    files: dict[str, bytes] = {name: text.encode() for name, text in unit.files.items()}
    folder = _FOLDERS.get((sys.platform, platform.machine()), (None, None))[version == "3.0"]
    if folder is not None:
        sources = {name.removeprefix("sources/"): text for name, text in unit.files.items() if name.startswith("sources/")}
        code = {name: text for name, text in sources.items() if name.endswith((".c", ".h"))}
        options = Options(extra=("-fvisibility=hidden",))
        library = compile_c_library(code, program.name, options, progress, steppers=True).path
        files[f"binaries/{folder}/{program.name}{'.dylib' if sys.platform == 'darwin' else '.so'}"] = library.read_bytes()
    memory = io.BytesIO()
    with zipfile.ZipFile(memory, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in sorted(files, key=lambda name: (name != "modelDescription.xml", name)):
            entry = zipfile.ZipInfo(name, _WHEN)
            entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
            archive.writestr(entry, files[name])
    return memory.getvalue()
