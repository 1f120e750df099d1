"""Compiler: environment -> CompilerInfo, the C compiler that builds a model."""

from __future__ import annotations

import functools
import os
import shutil
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from ..errors import ToolchainError
from .commands import raise_failure, run

REMEDIES = """\
Install one of these:
  Debian, Ubuntu: apt install gcc python3-dev
  Fedora: dnf install gcc python3-devel
  macOS: xcode-select --install
  anywhere, with pip: pip install ziglang
or set CC to the command of your compiler, or use target="numpy", which needs no compiler and runs slower."""


@dataclass(frozen=True, slots=True)
class CompilerInfo:
    """A C compiler that has answered.

    Attributes
    ----------
    path : str
        The executable.
    command : tuple of str
        Words that start every command line; the first is ``path``.
    kind : str
        ``gcc``, ``clang``, ``zig`` or ``other``; it decides which flags are understood.
    version : str
        What it says of itself.
    """

    path: str
    command: tuple[str, ...]
    kind: str
    version: str


def find_compiler(command: str | None = None) -> CompilerInfo:
    """Find the C compiler.

    Tried in this order: `command`, the environment variable CC, the compiler Python was built with, gcc, clang, cc, zig
    on the path and zig from the package ziglang. The first two are wishes: when one does not work, no other is tried.

    Parameters
    ----------
    command : str, optional
        Command line of a compiler, e.g. ``"clang-18"`` or ``"ccache gcc"``.

    Raises
    ------
    ToolchainError
        If none works; the message lists what was tried and what to install.
    """
    return _find(command, os.environ.get("CC", ""), os.environ.get("PATH", ""))


@functools.lru_cache(maxsize=16)
def _find(command: str | None, variable: str, search_path: str) -> CompilerInfo:
    import shlex

    wish = (command or variable).strip()
    origin = "the option compiler" if command else "the environment variable CC"
    try:
        wished = [tuple(shlex.split(wish))]
    except ValueError as error:  # a quotation without its end
        raise ToolchainError(f"{origin} is not a command: {error}: {wish}", code="EG-COMPILER-MISSING") from None
    tried = []
    for words in wished if wish else _candidates():
        found = _identify(words, search_path)
        if isinstance(found, CompilerInfo):
            return found
        tried.append(f"{shlex.join(words)}: {found}")
    heading = f"The C compiler named by {origin} does not work." if wish else "No C compiler was found."
    raise ToolchainError(f"{heading} Tried:\n  " + "\n  ".join(tried) + f"\n{REMEDIES}", code="EG-COMPILER-MISSING")


def _candidates() -> Iterator[tuple[str, ...]]:
    import sysconfig

    # Only the program: the flags that follow it there were for building Python.
    yield from ((word,) for word in str(sysconfig.get_config_var("CC") or "").split()[:1])
    yield from (("gcc",), ("clang",), ("cc",), ("zig", "cc"))
    import importlib.util

    spec = importlib.util.find_spec("ziglang")
    if spec is not None and spec.origin is not None:
        yield str(Path(spec.origin).with_name("zig.exe" if sys.platform == "win32" else "zig")), "cc"


def _identify(words: tuple[str, ...], search_path: str) -> CompilerInfo | str:
    """The compiler behind a command, or why there is none."""
    path = None if "\0" in words[0] else shutil.which(words[0], path=search_path)
    if path is None:
        return _why_missing(words[0])
    command = (os.path.abspath(path), *words[1:])  # it is run in other folders
    try:
        result = run([*command, "--version"])
    except ToolchainError as error:
        return str(error)
    if result.returncode != 0:
        return (result.stderr or result.stdout).strip() or f"exit status {result.returncode}"
    version = result.stdout.strip()
    if not version:
        return "not a compiler: it prints nothing for --version"
    if any(Path(word).stem in ("zig", "ziglang") for word in command):
        kind = "zig"
        version += f"\nzig {run([*command[:-1], 'version']).stdout.strip()}"  # the above is clang's
    elif "clang" in version:
        kind = "clang"
    elif "Free Software Foundation" in version:
        kind = "gcc"
    else:
        kind = "other"
    return CompilerInfo(command[0], command, kind, version)


def _why_missing(word: str) -> str:
    if os.path.isdir(word):
        return "a directory"
    return "not executable" if os.path.isfile(word) else "not found"


@functools.lru_cache(maxsize=16)
def describe_native(compiler: CompilerInfo, flags: tuple[str, ...]) -> str:
    """What the compiler knows of this processor: its predefined macros under the flags that say "native"."""
    result = run([*compiler.command, *flags, "-dM", "-E", "-x", "c", os.devnull])
    if result.returncode != 0:
        raise_failure("asking the compiler about this processor (option native)", result, Path.cwd())
    return result.stdout
