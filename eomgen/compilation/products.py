"""Products: what a compiler left behind -> nothing, or a ToolchainError if that is not what it was asked for.

A compiler, or a wrapper around one, can exit with 0 and have made nothing, garbage, code for another machine, or what
it made for somebody else before.  Every file is therefore compiled with a stamp in it: the key of the build and its own
name, which must be found in the product before that is published.
"""

from __future__ import annotations

import os
import shlex
from collections.abc import Iterable, Sequence
from importlib import import_module
from pathlib import Path

from ..errors import ToolchainError

#: What link-time optimisation writes in the place of code: its strings are found only after linking.
DEFERRED = (b".gnu.lto_", b"BC\xc0\xde", b"\xde\xc0\x17\x0b")
ELF = b"\x7fELF"
#: Kept by compilers, and by linkers that collect what nobody calls.
STAMP = """\
#if defined __has_attribute
#if __has_attribute(retain)
__attribute__((retain))
#endif
#endif
__attribute__((used)) static const char eomgen_stamp[] = "{}";
"""


def stamp(key: str, name: str) -> bytes:
    """The mark that an object file of a build bears."""
    return f"eomgen:{key}:{name}".encode()


def write_stamp(directory: Path, key: str, name: str) -> list[str]:
    """Write the header that puts a stamp into an object file; returns the flags that include it."""
    header = f"{name}.stamp.h"
    text = STAMP.format(stamp(key, name).decode())
    (directory / header).write_text(text, encoding="ascii")
    return ["-include", header]


def require_object(path: Path, mark: bytes, command: Sequence[str]) -> None:
    """Refuse an object file that is not what was to be compiled.

    Raises
    ------
    ToolchainError
    """
    data = _read(path, command)
    if mark not in data and not any(word in data for word in DEFERRED):
        raise _lies(path, command, f"is not what was compiled: it lacks the mark {mark.decode()}")


def require_library(path: Path, marks: Iterable[bytes], command: Sequence[str]) -> None:
    """Refuse a library that was linked from something else, or that this process could not load.

    Raises
    ------
    ToolchainError
    """
    data = _read(path, command)
    if _kind(data) != _kind(_reference()):
        raise _lies(path, command, "is not a library for this machine")
    for mark in marks:
        if mark not in data:
            raise _lies(path, command, f"is not what was linked: it lacks the mark {mark.decode()}")


def _read(path: Path, command: Sequence[str]) -> bytes:
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        data = b""
    if not data:
        raise _lies(path, command, "was not made")
    return data


def _lies(path: Path, command: Sequence[str], what: str) -> ToolchainError:
    words = shlex.join(command)
    return ToolchainError(
        f"the compiler {command[0]} reports success, but {path} {what}. Look at the compiler, or what wraps it, or "
        f"take another by CC. The command, run in {path.parent}:\n{words}",
        words,
    )


def _kind(head: bytes) -> bytes:
    """Class, byte order, type and machine of an ELF file; of others what says their format and processor."""
    return head[:6] + head[16:20] if head.startswith(ELF) else head[:8]


def _reference() -> bytes:
    """The beginning of an extension module that this process has loaded."""
    file = import_module("numpy._core._multiarray_umath").__file__ or os.devnull
    with open(file, "rb") as stream:
        return stream.read(64)
