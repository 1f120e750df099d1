"""Shared objects: C files of the layer that libraries for C hold too -> object files, compiled once for all models."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from ..layer import LAYER
from .cache import Cache, compute_key
from .commands import Running, allowed, raise_failure
from .compiler import CompilerInfo
from .cython_layer import HEADERS, describe_interpreter
from .products import require_object, stamp, write_stamp


def is_shared(file: str) -> bool:
    """Whether a C file reads the layer's files and headers only, never a model's."""
    return file in LAYER and file.endswith(".c")


def shared_objects(
    cache: Cache,
    sources: Mapping[str, str],
    flags: Mapping[str, Sequence[str]],
    compiler: CompilerInfo,
    progress: Callable[[str], None] | None = None,
) -> list[Path]:
    """Find the object files of those C files that are shared, or compile them.

    Parameters
    ----------
    cache : Cache
    sources : mapping of str to str
        All texts of a library.
    flags : mapping of str to sequence of str
        Of every C file.
    compiler : CompilerInfo
    progress : callable, optional
        Told what is being done.

    Raises
    ------
    ToolchainError
        The compiler fails.
    """
    headers = {name: text for name, text in sources.items() if name.endswith(".h") and name in (*LAYER, *HEADERS)}
    return [
        _made(cache, file, {file: sources[file], **headers}, flags[file], compiler, progress)
        for file in sources
        if is_shared(file)
    ]


def _made(
    cache: Cache, file: str, texts: Mapping[str, str], flags: Sequence[str], compiler: CompilerInfo,
    progress: Callable[[str], None] | None,
) -> Path:  # fmt: skip
    product = f"{file}.o"
    key = compute_key({
        "kind": "object", "sources": dict(texts), "flags": list(flags),
        "compiler": [*compiler.command, compiler.version], "platform": describe_interpreter()["platform"],
    })  # fmt: skip
    if (entry := cache.find(key)) is not None:
        return entry.product
    if progress is not None:
        progress(f"compiling {file} (once)")
    with cache.attempt(key) as directory:
        for name, text in texts.items():
            (directory / name).write_text(text, encoding="utf-8", newline="\n")
        stamped = write_stamp(directory, key, product)
        command = [*compiler.command, *flags, *stamped, "-c", file, "-o", product]
        result = Running().run(command, directory, allowed(len(texts[file])))
        if result.returncode != 0:
            raise_failure(f"compiling {directory / file}", result, directory)
        require_object(directory / product, stamp(key, product), command)
        (directory / stamped[-1]).unlink()
        return cache.publish(directory, key, "object", Path(file).stem, product, {"command": command}).product
