"""Building: the source texts of a model -> its compiled library in the cache."""

from __future__ import annotations

import os
import platform
import re
import shlex
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from importlib import import_module
from pathlib import Path
from threading import Timer
from typing import Any

from ..errors import ToolchainError, UsageError, bad_cache, no_choice
from .cache import Cache, CacheEntry, cache_directory, compute_key, digest_writers
from .compiler import (
    NEEDS,
    WITH_AVX,
    Commands,
    CompilerInfo,
    Options,
    allowed,
    compile_flags,
    compiler_files,
    describe_native,
    find_compiler,
    is_x86,
    lane_width,
    link_flags,
    machine_flags,
    run,
    run_all,
)
from .layer import HEADERS, LAYER, SOLVER
from .trusted_files import read_entry

Task = Callable[[Commands], Path]  #: makes an object file
SUFFIX = ".dylib" if sys.platform == "darwin" else ".so"
QUIET = 1.0  #: seconds that lanes may be compiled without a line on stderr


def compile_sources(
    kind: str, sources: Mapping[str, str], name: str, options: Options, key: str | None = None
) -> CacheEntry:
    """Compile the C files and headers of a model, or find it in the cache.

    Kind ``model`` is for this session, a library that shows its table and takes the solvers of ``eomgen._native``;
    without the option ``lanes``, lanes and series are left to :func:`compile_lanes`.  ``library`` is for C programs or
    ctypes: every function that is not static can be called, and C files that all models share are compiled once.  The
    key of the entry may come from :func:`key_of_program`; by default it is that of the sources and flags.
    Raises ToolchainError (there is no compiler, the compiler fails, or the cache cannot be used).
    """
    for file in (name, *sources):
        if not re.fullmatch(r"\w[\w.-]*", file):
            raise UsageError(f"{file!r} is not a plain name of a file or model", code="EG-NAME-FORM")
    if options.lanes in (4, 8) and not is_x86():
        raise no_choice(f"lanes must be None, 0 or 2 on {platform.machine()}, not {options.lanes}")
    width = lane_width() if options.lanes is None else options.lanes
    widths = _lane_files(sources)
    unused = {file for file, lanes in widths.items() if lanes != width} | ({SOLVER} if kind == "model" else set())
    sources = {file: text for file, text in sources.items() if file not in unused}
    deferred = _deferred(sources, name) if kind == "model" and options.lanes is None and not options.native else []
    files = [file for file in sources if file.endswith(".c") and file not in deferred]
    compiler, size = find_compiler(options.compiler), sum(len(sources[file]) for file in files)
    flags = compile_flags(options, compiler, size, portable=kind == "library")
    flags.append(f"-DEOMGEN_LANES={width if not deferred and width in widths.values() else 0}")
    # the functions of two models in one process never meet
    flags += ["-fvisibility=hidden", "-DEOMGEN_OPENED"] if kind == "model" else []
    flags += ["-DEOMGEN_WITHOUT_SERIES"] if deferred else []
    of_solvers, link = solver_flags(flags, options, compiler), link_flags(options, compiler)
    parts = {
        "kind": kind, "name": name, "sources": sources, "files": files, "flags": [flags, of_solvers, link],
        "native": describe_native(compiler, tuple(machine_flags(options, compiler))) if options.native else "",
        **_setting(compiler),
    }  # fmt: skip
    cache = Cache(cache_directory())
    of_layer = {file: of_solvers if file == SOLVER else flags for file in files if file in LAYER}
    objects = [partial(_shared_object, cache, sources, file, of, compiler) for file, of in of_layer.items()]
    recipe = {
        "compiler": [*compiler.command, compiler.version], "flags": flags, "link": link, "options": asdict(options),
        # features of the processor, by NumPy's names, without which this code cannot run
        "needs": NEEDS[WITH_AVX] if "-mavx" in flags else (),
    }  # fmt: skip

    def compiled(directory: Path) -> tuple[str, Mapping[str, Any]]:
        _write(directory / "sources", sources)
        of_model = {Path("sources", file): flags for file in files if file not in of_layer}
        return compile_and_link(directory, f"lib{name}", of_model, link, compiler, options.jobs, objects), recipe

    return cache.make(key or compute_key(parts), kind, name, compiled)


def _write(directory: Path, texts: Mapping[str, str]) -> None:
    """Write texts by name into a folder of this user, which is made."""
    directory.mkdir(mode=0o700, exist_ok=True)
    for name, text in texts.items():
        (directory / name).write_text(text, encoding="utf-8", newline="\n")


def _setting(compiler: CompilerInfo) -> dict[str, object]:
    """What every key holds besides sources and flags."""
    return {"compiler": [*compiler.command, compiler.version], "platform": f"{sys.platform}-{platform.machine()}"}


def _lane_files(files: Iterable[str]) -> dict[str, int]:
    """The lane files among these, with their widths."""
    return {file: int(match[1]) for file in files if (match := re.search(r"_lanes(\d+)\.c$", file))}


def _deferred(files: Iterable[str], name: str) -> list[str]:
    """A model's files that are compiled when first needed: its lanes and its series; none without lanes."""
    lanes = [*_lane_files(files)]
    return [*lanes, *(file for file in files if file == f"{name}_series.c")] if lanes else []


def solver_flags(flags: Sequence[str], options: Options, compiler: CompilerInfo) -> list[str]:
    """Flags of the solvers, none of a model's own: their loops gain by -O2 what straight-line code loses.

    Rows are short: with vectors of gcc 12 a Stewart platform takes 1.2 of the time to project, a slider-crank 1.05 for
    its Jacobian.
    """
    flags = [flag for flag in flags if not flag.startswith("-DEOMGEN_")]
    if options.optimize is not None:
        return flags
    flags = ["-O2" if re.fullmatch(r"-O\d", flag) else flag for flag in flags]
    return [*flags, "-fno-tree-vectorize"] if compiler.kind == "gcc" else flags


def _shared_object(
    cache: Cache, sources: Mapping[str, str], file: str, flags: Sequence[str], compiler: CompilerInfo,
    commands: Commands,
) -> Path:  # fmt: skip
    """Find the object of a C file that reads the layer's texts alone, never a model's, or compile it."""
    texts = {name: text for name, text in sources.items() if name.endswith(".h") and name in (*LAYER, *HEADERS)}
    texts[file] = sources[file]
    parts = {"kind": "object", "sources": texts, "flags": flags, **_setting(compiler)}

    def compiled(directory: Path) -> tuple[str, Mapping[str, Any]]:
        _write(directory, texts)
        return _compile_file(directory, Path(file), flags, compiler, commands).name, {"flags": flags}

    return cache.make(compute_key(parts), "object", Path(file).stem, compiled).product


def compile_and_link(
    directory: Path, name: str, files: Mapping[Path, Sequence[str]], link: Sequence[str], compiler: CompilerInfo,
    jobs: int | None = None, objects: Sequence[Task] = (), suffix: str = SUFFIX,
) -> str:  # fmt: skip
    """Compile C files, given by their places in a directory with their flags, into a library there; its file's name.

    ``jobs`` files are compiled at a time, ``link`` are flags of the linker.  Of what is made nothing but the library
    stays in the directory; ``objects`` make further object files, which stay where they are.
    Raises ToolchainError (the compiler fails, does not come to an end, or made nothing).
    """
    tasks: list[Task] = [partial(_compile_file, directory, file, flags, compiler) for file, flags in files.items()]
    made = run_all([*tasks, *objects], jobs)
    product = f"{name}{suffix}"
    command = [*compiler.command, *map(str, made), "-o", product, *link]
    size = sum(path.stat().st_size for path in made)
    run(command, directory, allowed(size), f"linking {directory / product}")
    _require_product(directory / product, command, library=True)
    for path in made[: len(tasks)]:
        path.unlink()
    return product


def _compile_file(
    directory: Path, file: Path, flags: Sequence[str], compiler: CompilerInfo, commands: Commands
) -> Path:
    """Compile a file of a directory into an object there."""
    source, product = directory / file, directory / f"{file.name}.o"
    command = [*compiler.command, *flags, "-c", str(file), "-o", product.name]
    commands.run(command, directory, allowed(source.stat().st_size), f"compiling {source}")
    _require_product(product, command)
    return product


def _require_product(path: Path, command: Sequence[str], library: bool = False) -> None:
    """Refuse what a compiler that reports success did not make, or made for another machine."""
    data = path.read_bytes() if path.is_file() else b""
    fault = "" if data else "was not made"
    if data and library:  # compared with an extension module that this process has loaded
        with open(import_module("numpy._core._multiarray_umath").__file__ or os.devnull, "rb") as stream:
            fault = "" if _format(data) == _format(stream.read(64)) else "is not a library for this machine"
    if fault:
        line = shlex.join(command)
        raise ToolchainError(
            f"the compiler {command[0]} reports success, but {path} {fault}. Look at the compiler, or what wraps it, "
            f"or take another by CC. The command, run in {path.parent}:\n{line}",
            line,
        )


def _format(head: bytes) -> bytes:
    """Class, byte order, type and machine of an ELF file; of others what says their format and processor."""
    return head[:6] + head[16:20] if head.startswith(b"\x7fELF") else head[:8]


# -- lanes -------------------------------------------------------------------------------------------------------------


def compile_lanes(file: Path) -> CacheEntry | None:
    """The library with the lanes and series of a model, compiled now if need be, by the flags of the model.

    The model's sources lie beside its library, ``file``, in the cache.  None if no lanes are for this processor.
    Raises ToolchainError (they cannot be compiled).
    """
    cache, of = Cache(file.parents[2]), file.parent.name
    try:
        cache.require_owner()
        manifest, texts = read_entry(file.parent)
    except (OSError, ValueError):
        raise bad_cache("its cache entry is gone or was changed; compile the model again") from None
    files = {Path(path).name: file.parent / path for path in texts if path.startswith("sources/")}
    width = next(iter(_lane_files(files).values()), 0)
    if not width:
        return None
    if (entry := cache.find(key := compute_key({"kind": "lanes", "of": of}))) is not None:
        return entry  # needs no compiler
    name, recipe = manifest["name"], manifest["recipe"]
    flags = [flag for flag in recipe["flags"] if not flag.startswith("-DEOMGEN_LANES=")]
    flags = ["-DEOMGEN_LAZY", *flags, f"-DEOMGEN_LANES={width}"]
    called = tuple(f"{name}_{part}" for part in ("tables.", "native_", "pairs_"))
    chosen = [*_deferred(files, name), *(f for f in files if f.startswith(called) and f.endswith(".c"))]
    compiler = find_compiler(recipe["options"]["compiler"])
    message = f"eomgen: compiling the vector code of {name} (once)"
    timer = Timer(QUIET, print, [message], {"file": sys.stderr})
    timer.daemon = True
    timer.start()

    def compiled(directory: Path) -> tuple[str, Mapping[str, Any]]:
        paths = {files[f]: flags for f in chosen}
        return compile_and_link(directory, f"{name}_lanes", paths, recipe["link"], compiler), {"flags": flags}

    try:
        return cache.make(key, "lanes", name, compiled)
    finally:
        timer.cancel()


# -- a program that was compiled before --------------------------------------------------------------------------------


def key_of_program(fingerprint: str | None, options: Options) -> str | None:
    """Key of the build of a program, so that its sources need not be written to find it.

    None: it follows from the sources; the program has no fingerprint, the options ask for what the compiler knows of
    this processor, or the files of eomgen are not the code that runs.
    """
    writers = None if fingerprint is None or options.native else digest_writers()
    if writers is None:
        return None
    parts = {
        "kind": "program", "program": fingerprint, "writers": writers, "lanes": lane_width(),
        "options": asdict(options) | {"jobs": None},
        "compiler": compiler_files(options.compiler), "platform": f"{sys.platform}-{platform.machine()}",
    }  # fmt: skip
    return compute_key(parts)
