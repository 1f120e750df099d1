"""Equations -> a functional mock-up unit, one file with the suffix .fmu."""

from __future__ import annotations

import io
import os
import platform
import sys
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from . import pipeline
from .base.algebra import Array
from .base.files import as_path, refuse_link, write_whole
from .compilation.build import compile_c_library
from .compilation.options import Options
from .emit.fmu import emit_fmu
from .emit.fmu.versions import KERNELS, check_version, refuse_impacts
from .errors import bad_file
from .program import Program
from .runtime.bound_model import BoundModel
from .runtime.signals import Forcing

if TYPE_CHECKING:
    from .derivation import Derivation

#: Folders of binaries, of FMI 2.0 and 3.0, by system and processor; elsewhere a unit holds its sources alone.
_FOLDERS = {
    ("linux", "x86_64"): ("linux64", "x86_64-linux"), ("linux", "aarch64"): (None, "aarch64-linux"),
    ("darwin", "x86_64"): ("darwin64", "x86_64-darwin"), ("darwin", "arm64"): ("darwin64", "aarch64-darwin"),
}  # fmt: skip
_WHEN = (1980, 1, 1, 0, 0, 0)  #: the same model gives the same bytes


def write_fmu(
    equations: Derivation,
    path: str | Path | None = None,
    version: str = "2.0",
    progress: Callable[[str], None] | None = None,
) -> Path:
    """Write a functional mock-up unit: model exchange and co-simulation in one file, with its sources in C.

    Parameters
    ----------
    equations : Derivation
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
        A parameter has no value, or the model has impacts: events with ``restitution``, or contacts with
        ``normal_law: rigid``.
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
        raise bad_file(f"the name of an FMU ends in .fmu, not as in {str(where)!r}")
    write_whole(where, fmu_bytes(equations, version, progress))
    return where


def generate_fmu(equations: Derivation, directory: Path, version: str = "2.0") -> Path:
    """Write ``<name>.fmu`` into a folder, in the place of one that eomgen wrote before.

    Raises
    ------
    UsageError
        There is another file of this name.
    """
    where = directory / f"{equations.name}.fmu"
    if os.path.lexists(where) and not _is_ours(where):
        raise bad_file(f"{where} exists and was not written by eomgen; move it, or choose another --out")
    directory.mkdir(parents=True, exist_ok=True)
    return write_fmu(equations, where, version)


def _is_ours(path: Path) -> bool:
    """Whether a file is a unit that eomgen wrote."""
    refuse_link(path)
    try:
        with zipfile.ZipFile(path) as archive, archive.open("modelDescription.xml") as description:
            return b'generationTool="eomgen ' in description.read(2000)
    except (OSError, KeyError, zipfile.BadZipFile):
        return False


def _begin_signals(program: Program, module: BoundModel) -> tuple[Program, Array]:
    """The program whose inputs start as their declared signals do, and the initial state with them."""
    if not program.metadata.get("signals"):
        return program, module.x0()
    forcing = Forcing(module.layout, None)
    forcing.attach(module)
    values = [float(u) for u in forcing(0.0, module.x0())]
    bound = module.bind(u=dict(zip(module.u_names, values, strict=True)))
    return replace(program, metadata={**program.metadata, "u_values": values}), bound.x0()


def fmu_bytes(equations: Derivation, version: str, progress: Callable[[str], None] | None = None) -> bytes:
    """The content of the file that :func:`write_fmu` writes; the same model gives the same bytes."""
    program = pipeline.build(equations, "c", KERNELS)
    refuse_impacts(program)
    module = BoundModel(pipeline.compile_core(equations, "numpy"))
    program, start = _begin_signals(program, module)
    unit = emit_fmu(program, [float(x) for x in start], version)
    files: dict[str, bytes] = {name: text.encode() for name, text in unit.files.items()}
    folder = _FOLDERS.get((sys.platform, platform.machine()), (None, None))[version == "3.0"]
    if folder is not None:
        code = {Path(name).name: text for name, text in unit.files.items() if name.endswith((".c", ".h"))}
        options = Options(extra=("-fvisibility=hidden",))
        library = compile_c_library(code, program.name, options, progress, steppers=True).path
        files[f"binaries/{folder}/{program.name}{library.suffix}"] = library.read_bytes()
    memory = io.BytesIO()
    with zipfile.ZipFile(memory, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in sorted(files, key=lambda name: (name != "modelDescription.xml", name)):
            entry = zipfile.ZipInfo(name, _WHEN)
            entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
            archive.writestr(entry, files[name])
    return memory.getvalue()
