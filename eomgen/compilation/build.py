"""Building: the source texts of a model -> Artifact, its compiled extension module or C library in the cache."""

from __future__ import annotations

import os
import re
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ..errors import UsageError, incomplete
from ..layer import LAYER, read_header, read_layer
from .cache import Cache, CacheEntry, cache_directory, compute_key
from .commands import Running, allowed, raise_failure
from .compiler import CompilerInfo, describe_native, find_compiler
from .cython_layer import HEADERS, build_layer, describe_interpreter, describe_layer
from .options import Options, compile_flags, link_flags, machine_flags, needed_features
from .processor import choose_lanes, late_files
from .products import require_library, require_object, stamp, write_stamp
from .shared_objects import is_shared, shared_objects

Progress = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Artifact:
    """A compiled model.

    Attributes
    ----------
    path : Path
        The extension module or shared library.
    key : str
        SHA-256 of everything it depends on.
    directory : Path
        Its directory in the cache; ``sources/`` in it holds the texts it was made from.
    seconds : float
        Time the call took.
    from_cache : bool
        Whether it was there already.
    name : str
        Name of the model.
    """

    path: Path
    key: str
    directory: Path
    seconds: float
    from_cache: bool
    name: str


def compile_sources(
    sources: Mapping[str, str], name: str, options: Options | None = None, progress: Progress | None = None
) -> Artifact:
    """Compile a model into an extension module, or find it in the cache.

    Parameters
    ----------
    sources : mapping of str to str
        Texts by file name: the C files and headers, ``eomgen.h`` among them, and perhaps files of
        the layer; those left out are the ones that come with eomgen.
    name : str
        Name of the model.
    options : Options, optional
        How to compile.
    progress : callable, optional
        Told what is being done, a line at a time; not called when the module is in the cache.

    Raises
    ------
    ToolchainError
        If there is no compiler, no Python.h, the compiler fails, or the cache cannot be used.
    MissingDependencyError
        If the layer must be built and Cython is not installed.
    """
    start = time.perf_counter()
    options = options or Options()
    sources = dict(sources)
    own = read_layer()
    layer = {name: sources.pop(name, own[name]) for name in LAYER}
    _check(sources, name)
    if HEADERS[0] not in sources:
        raise incomplete(f"the sources of {name!r} lack {HEADERS[0]}; there are {', '.join(sources)}")
    headers = {header: sources[header] if header in sources else read_header(header) for header in HEADERS}
    sources, width = choose_lanes(sources, options.lanes)
    compiler = find_compiler(options.compiler)
    late = late_files(sources, name) if options.lanes is None and not options.native else ()
    now = {file: text for file, text in sources.items() if file not in late}
    flags = _plan(now, options, compiler, 0 if late else width, extension=True)
    if late:
        flags = {file: [*words, *(["-DEOMGEN_WITHOUT_SERIES"] if file else [])] for file, words in flags.items()}
    parts = {
        "kind": "extension", "name": name, "sources": sources, "flags": flags, "native": _native(options, compiler),
        "layer": describe_layer(layer, headers, compiler),
    }  # fmt: skip
    cache, key = Cache(cache_directory()), compute_key(parts)
    entry = cache.find(key)
    if entry is not None:
        return _artifact(entry, start, from_cache=True)
    product = f"_core{describe_interpreter()['suffix']}"

    def objects() -> list[str]:
        return list(map(str, build_layer(cache, layer, headers, compiler, progress)))

    entry = _build(cache, key, "extension", name, sources, flags, product, objects, options, compiler, progress)
    return _artifact(entry, start, from_cache=False)


def compile_c_library(
    sources: Mapping[str, str], name: str, options: Options | None = None, progress: Progress | None = None,
    *, steppers: bool = False,
) -> Artifact:  # fmt: skip
    """Compile a model into a plain shared library for C programs or ctypes; needs neither Python.h nor Cython.

    Parameters and errors are those of :func:`compile_sources`. Every function that is not static can be called.
    With ``steppers`` the files of the layer that are among the sources are compiled too, once for all models.
    """
    start = time.perf_counter()
    options = options or Options()
    sources = {file: text for file, text in sources.items() if steppers or file not in LAYER}
    _check(sources, name)
    sources, width = choose_lanes(sources, options.lanes)
    compiler = find_compiler(options.compiler)
    flags = _plan(sources, options, compiler, width, extension=False)
    parts = {
        "kind": "library", "name": name, "sources": sources, "flags": flags, "native": _native(options, compiler),
        "compiler": [*compiler.command, compiler.version], "platform": describe_interpreter()["platform"],
    }  # fmt: skip
    cache, key = Cache(cache_directory()), compute_key(parts)
    entry = cache.find(key)
    if entry is not None:
        return _artifact(entry, start, from_cache=True)
    product = f"lib{name}.dylib" if sys.platform == "darwin" else f"lib{name}.so"
    own = {file: words for file, words in flags.items() if not is_shared(file)}

    def objects() -> list[str]:
        return list(map(str, shared_objects(cache, sources, flags, compiler, progress)))

    entry = _build(cache, key, "library", name, sources, own, product, objects, options, compiler, progress)
    return _artifact(entry, start, from_cache=False)


def _check(sources: Mapping[str, str], name: str) -> None:
    """Names become file and module names, so they must be plain."""
    for file in sources:
        if not re.fullmatch(r"\w[\w.-]*", file):
            raise UsageError(f"the source name {file!r} is not a plain file name", code="EG-NAME-FORM")
    if not re.fullmatch(r"[A-Za-z_]\w*", name, re.ASCII):
        raise UsageError(f"the model name {name!r} is not a C identifier", code="EG-NAME-FORM")
    if not any(file.endswith(".c") for file in sources):
        raise incomplete(f"there is no C file among the sources of {name!r}: {', '.join(sources)}")


def _plan(
    sources: Mapping[str, str], options: Options, compiler: CompilerInfo, lanes: int, *, extension: bool
) -> dict[str, list[str]]:
    """Flags of every C file, and under "" those of the linker."""
    files = [file for file in sources if file.endswith(".c")]
    size = sum(len(sources[file]) for file in files)
    flags = {file: compile_flags(options, compiler, size, hidden=extension, portable=not extension) for file in files}
    flags = {file: [*words, f"-DEOMGEN_LANES={lanes}"] for file, words in flags.items()}
    return {**flags, "": link_flags(options, compiler, extension=extension)}


def _native(options: Options, compiler: CompilerInfo) -> str:
    return describe_native(compiler, tuple(machine_flags(options, compiler))) if options.native else ""


def _artifact(entry: CacheEntry, start: float, *, from_cache: bool) -> Artifact:
    seconds = time.perf_counter() - start
    return Artifact(entry.product, entry.key, entry.directory, seconds, from_cache, entry.name)


def _build(
    cache: Cache, key: str, kind: str, name: str, sources: Mapping[str, str], flags: Mapping[str, Sequence[str]],
    product: str, objects: Callable[[], list[str]], options: Options, compiler: CompilerInfo, progress: Progress | None,
) -> CacheEntry:  # fmt: skip
    """Compile every file, meanwhile make the further objects, link, publish."""
    with cache.attempt(key) as directory:
        folder = directory / "sources"
        folder.mkdir(mode=0o700)
        for file, text in sources.items():
            (folder / file).write_text(text, encoding="utf-8", newline="\n")
        files = {file: Path("sources", file) for file in flags if file}
        compile_and_link(directory, key, name, files, flags, product, compiler, options.jobs, objects, progress)
        recipe = {
            "compiler": [*compiler.command, compiler.version], "flags": dict(flags), "options": asdict(options),
            "needs": needed_features(flags),
        }  # fmt: skip
        return cache.publish(directory, key, kind, name, product, recipe)


def compile_and_link(
    directory: Path, key: str, name: str, files: Mapping[str, Path], flags: Mapping[str, Sequence[str]], product: str,
    compiler: CompilerInfo, jobs: int | None = None, objects: Callable[[], list[str]] = list,
    tell: Progress | None = None,
) -> None:  # fmt: skip
    """Compile C files into a library.

    Parameters
    ----------
    directory : Path
        Where to work; of what is made nothing but the product stays there.
    key : str
        Of the build; the product bears it.
    name : str
        Of the model.
    files : mapping of str to Path
        Name and place of every C file.
    flags : mapping of str to sequence of str
        Of each of them by name, and under "" those of the linker.
    product : str
        Name of the library.
    compiler : CompilerInfo
    jobs : int, optional
        Files compiled at a time.
    objects : callable, optional
        Makes further object files meanwhile, in the folder of their own key.
    tell : callable, optional
        Told what is being done.

    Raises
    ------
    ToolchainError
        The compiler fails, does not come to an end, or made something else than it was told to.
    """
    compiled = {file: f"{file}.o" for file in files}
    running, size = Running(), sum(os.path.getsize(directory / path) for path in files.values())
    say: Callable[[str], Any] = tell or (lambda line: None)

    def compile_one(file: str) -> None:
        say(f"compiling {file}")
        stamped = write_stamp(directory, key, compiled[file])
        command = [*compiler.command, *flags[file], *stamped, "-c", str(files[file]), "-o", compiled[file]]
        _command(running, command, directory, directory / files[file], size)
        require_object(directory / compiled[file], stamp(key, compiled[file]), command)
        (directory / stamped[-1]).unlink()

    further = _run_all(compile_one, list(files), jobs or os.cpu_count() or 1, objects, running)
    say(f"linking {name}")
    words = [*compiler.command, *compiled.values(), *further, "-o", product, *flags[""]]
    _command(running, words, directory, directory / product, size)
    marks = [stamp(key, file) for file in compiled.values()]
    require_library(directory / product, [*marks, *(stamp(p.parent.name, p.name) for p in map(Path, further))], words)
    for file in compiled.values():
        (directory / file).unlink()


def _run_all(
    task: Callable[[str], None], files: Sequence[str], jobs: int, meanwhile: Callable[[], list[str]], running: Running
) -> list[str]:
    """Do a task for every file, some at a time, and something else in this thread, whose result is returned.

    The first failure, or Ctrl-C, ends the commands of the other tasks.
    """
    if jobs == 1:
        for file in files:
            task(file)
        return meanwhile()
    from concurrent.futures import ThreadPoolExecutor  # slow to import

    with ThreadPoolExecutor(jobs) as pool:
        try:
            results = pool.map(task, files)
            made = meanwhile()
            list(results)
        except BaseException:
            running.stop()
            pool.shutdown(wait=True, cancel_futures=True)
            raise
    return made


def _command(running: Running, command: Sequence[str], directory: Path, source: Path, size: int) -> None:
    result = running.run(command, directory, allowed(size))
    if result.returncode != 0:
        raise_failure(f"compiling {source}", result, directory)
