"""Building: the source texts of a model -> Artifact, its compiled library in the cache."""

from __future__ import annotations

import os
import platform
import re
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

from ..errors import UsageError, incomplete
from ..layer import HEADERS, LAYER, SOLVER
from .cache import Cache, CacheEntry, cache_directory, compute_key
from .commands import Running, allowed, raise_failure
from .compiler import CompilerInfo, describe_native, find_compiler
from .options import Options, compile_flags, link_flags, machine_flags, needed_features
from .processor import choose_lanes, late_files
from .products import require_library, require_object, stamp, write_stamp

Progress = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Artifact:
    """A compiled model.

    Attributes
    ----------
    path : Path
        The library.
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


def compile_model(sources: Mapping[str, str], name: str, options: Options | None = None) -> Artifact:
    """Compile a model for this session into a library that shows its table alone, or find it in the cache.

    Parameters
    ----------
    sources : mapping of str to str
        Texts by file name: C files and headers, ``eomgen.h`` among them.
    name : str
        Name of the model.
    options : Options, optional
        How to compile. Without ``lanes``, lanes and series are left to :mod:`.lanes`.

    Raises
    ------
    ToolchainError
        If there is no compiler, the compiler fails, or the cache cannot be used.
    """
    options = options or Options()
    if "eomgen.h" not in sources:
        raise incomplete(f"the sources of {name!r} lack eomgen.h; there are {', '.join(sources)}")
    late = late_files(sources, name) if options.lanes is None and not options.native else ()
    more = ["-DEOMGEN_OPENED", *(["-DEOMGEN_WITHOUT_SERIES"] if late else [])]
    return _find_or_build("model", sources, name, options, None, late, more)


def compile_c_library(
    sources: Mapping[str, str], name: str, options: Options | None = None, progress: Progress | None = None
) -> Artifact:
    """Compile a model into a shared library for C programs or ctypes: every function that is not static can be called.

    Parameters and errors are those of :func:`compile_model`; `progress` is told what is being done, a line at a time. C
    files that all models share are compiled once.
    """
    return _find_or_build("library", sources, name, options or Options(), progress)


def _find_or_build(
    kind: str, sources: Mapping[str, str], name: str, options: Options, progress: Progress | None,
    late: Sequence[str] = (), more: Sequence[str] = (),
) -> Artifact:  # fmt: skip
    start = time.perf_counter()
    _check(sources, name)
    sources, width = choose_lanes(sources, options.lanes)
    compiler, shown = find_compiler(options.compiler), kind == "library"
    files = [file for file in sources if file.endswith(".c") and file not in late]
    size = sum(len(sources[file]) for file in files)
    words = compile_flags(options, compiler, size, hidden=not shown, portable=shown)
    words += [f"-DEOMGEN_LANES={0 if late else width}", *more]
    flags = {**dict.fromkeys(files, words), "": link_flags(options, compiler, extension=False)}
    parts = {
        "kind": kind, "name": name, "sources": sources, "flags": flags, "native": _native(options, compiler),
        "compiler": [*compiler.command, compiler.version], "platform": describe_platform(),
    }  # fmt: skip
    cache, key = Cache(cache_directory()), compute_key(parts)
    entry = cache.find(key)
    found = entry is not None
    if entry is None:
        flags |= {SOLVER: _solver_flags(words, options, compiler)} if SOLVER in flags else {}
        shared = partial(_shared_objects, cache, sources, flags, compiler, progress)
        entry = _build(cache, key, kind, name, sources, flags, shared, options, compiler, progress)
    seconds = time.perf_counter() - start
    return Artifact(entry.product, entry.key, entry.directory, seconds, found, entry.name)


def _check(sources: Mapping[str, str], name: str) -> None:
    """Names become file and module names, so they must be plain."""
    for file in sources:
        if not re.fullmatch(r"\w[\w.-]*", file):
            raise UsageError(f"the source name {file!r} is not a plain file name", code="EG-NAME-FORM")
    if not re.fullmatch(r"[A-Za-z_]\w*", name, re.ASCII):
        raise UsageError(f"the model name {name!r} is not a C identifier", code="EG-NAME-FORM")
    if not any(file.endswith(".c") for file in sources):
        raise incomplete(f"there is no C file among the sources of {name!r}: {', '.join(sources)}")


def _native(options: Options, compiler: CompilerInfo) -> str:
    return describe_native(compiler, tuple(machine_flags(options, compiler))) if options.native else ""


def describe_platform() -> str:
    """System and processor that a library is for."""
    return f"{sys.platform}-{platform.machine()}"


def _build(
    cache: Cache, key: str, kind: str, name: str, sources: Mapping[str, str], flags: Mapping[str, Sequence[str]],
    shared: Callable[[], list[Path]], options: Options, compiler: CompilerInfo, progress: Progress | None,
) -> CacheEntry:  # fmt: skip
    """Compile every file, meanwhile make the shared objects, link, publish."""
    product = f"lib{name}.dylib" if sys.platform == "darwin" else f"lib{name}.so"
    with cache.attempt(key) as directory:
        folder = directory / "sources"
        folder.mkdir(mode=0o700)
        for file, text in sources.items():
            (folder / file).write_text(text, encoding="utf-8", newline="\n")
        files = {file: Path("sources", file) for file in flags if file and file not in LAYER}
        compile_and_link(directory, key, name, files, flags, product, compiler, options.jobs, shared, progress)
        recipe = {
            "compiler": [*compiler.command, compiler.version], "flags": dict(flags), "options": asdict(options),
            "needs": needed_features(flags),
        }  # fmt: skip
        return cache.publish(directory, key, kind, name, product, recipe)


def _solver_flags(words: Sequence[str], options: Options, compiler: CompilerInfo) -> list[str]:
    """Flags of the solvers, none of a model's own: their loops gain by -O2 what straight-line code loses.

    Rows are short: with vectors of gcc 12 a Stewart platform takes 1.2 of the time to project, a slider-crank 1.05 for
    its Jacobian.
    """
    words = [word for word in words if not word.startswith("-DEOMGEN_")]
    if options.optimize is not None:
        return words
    words = ["-O2" if re.fullmatch(r"-O\d", word) else word for word in words]
    return [*words, "-fno-tree-vectorize"] if compiler.kind == "gcc" else words


def _shared_objects(
    cache: Cache, sources: Mapping[str, str], flags: Mapping[str, Sequence[str]], compiler: CompilerInfo,
    tell: Progress | None,
) -> list[Path]:  # fmt: skip
    """Find the object files of C files that read the layer's texts alone, never a model's, or compile them."""
    headers = {name: text for name, text in sources.items() if name.endswith(".h") and name in (*LAYER, *HEADERS)}
    made = []
    for file in (file for file in sources if file in LAYER and file.endswith(".c")):
        product, texts, words = f"{file}.o", {file: sources[file], **headers}, flags[file]
        parts = {
            "kind": "object", "sources": texts, "flags": list(words), "platform": describe_platform(),
            "compiler": [*compiler.command, compiler.version],
        }  # fmt: skip
        entry = cache.find(key := compute_key(parts))
        if entry is None:
            with cache.attempt(key) as directory:
                for name, text in texts.items():
                    (directory / name).write_text(text, encoding="utf-8", newline="\n")
                _compile(Running(), directory, key, Path(file), product, words, compiler, tell, len(texts[file]))
                entry = cache.publish(directory, key, "object", Path(file).stem, product, {"flags": list(words)})
        made.append(entry.product)
    return made


def compile_and_link(
    directory: Path, key: str, name: str, files: Mapping[str, Path], flags: Mapping[str, Sequence[str]], product: str,
    compiler: CompilerInfo, jobs: int | None = None, objects: Callable[[], list[Path]] = list,
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

    def compile_one(file: str) -> None:
        _compile(running, directory, key, files[file], compiled[file], flags[file], compiler, tell, size)

    further = _run_all(compile_one, list(files), jobs or os.cpu_count() or 1, objects, running)
    if tell is not None:
        tell(f"linking {name}")
    words = [*compiler.command, *compiled.values(), *map(str, further), "-o", product, *flags[""]]
    _command(running, words, directory, directory / product, size)
    marks = [stamp(key, file) for file in compiled.values()]
    require_library(directory / product, [*marks, *(stamp(p.parent.name, p.name) for p in further)], words)
    for file in compiled.values():
        (directory / file).unlink()


def _compile(
    running: Running, directory: Path, key: str, file: Path, product: str, words: Sequence[str],
    compiler: CompilerInfo, tell: Progress | None, size: int,
) -> None:  # fmt: skip
    """Compile a file into an object that bears the mark of its build."""
    if tell is not None:
        tell(f"compiling {file.name}")
    stamped = write_stamp(directory, key, product)
    command = [*compiler.command, *words, *stamped, "-c", str(file), "-o", product]
    _command(running, command, directory, directory / file, size)
    require_object(directory / product, stamp(key, product), command)
    (directory / stamped[-1]).unlink()


def _run_all(
    task: Callable[[str], None], files: Sequence[str], jobs: int, meanwhile: Callable[[], list[Path]], running: Running
) -> list[Path]:
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
