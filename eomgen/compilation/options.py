"""Options: how to compile -> the flags of every compiler and linker command."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass

from ..errors import UsageError
from .compiler import CompilerInfo

#: Source files longer than this (bytes) are compiled with -O1. Measured with gcc 12 on generated chains of 7 and 20
#: bodies, 0.56 and 1.7 MB: 1.2 and 3.1 s at -O1, 1.5 and 6.0 s at -O2; the code ran up to 22 % slower and no slower.
LARGE_SOURCE = 800_000


@dataclass(frozen=True, slots=True)
class Options:
    """How to compile.

    Attributes
    ----------
    optimize : int or None
        Level 0 to 3; None chooses 2, and 1 for large files. Changes the build.
    native : bool
        Use every instruction of this processor; results may differ in the last digits. Changes the build.
    warnings : bool
        Treat the compiler's warnings as errors. Changes the build.
    extra : sequence of str
        More flags for compiling and linking. Changes the build.
    compiler : str or None
        Command line of the compiler; None finds one. Changes the build.
    lanes : {0, 2, 4, 8} or None
        States that batches take at a time in vector registers; None takes what suits this processor, 0 leaves them
        out. Results are the same, to the last bit. Changes the build.
    jobs : int or None
        Files compiled at a time; None takes the number of processors. Does not change the build.
    """

    optimize: int | None = None
    native: bool = False
    warnings: bool = False
    extra: Sequence[str] = ()
    compiler: str | None = None
    lanes: int | None = None
    jobs: int | None = None

    def __post_init__(self) -> None:
        if self.optimize not in (None, 0, 1, 2, 3):
            raise UsageError(f"optimize must be None, 0, 1, 2 or 3, not {self.optimize!r}")
        if self.lanes not in (None, 0, 2, 4, 8):
            raise UsageError(f"lanes must be None, 0, 2, 4 or 8, not {self.lanes!r}")
        if isinstance(self.extra, str):
            raise UsageError(f"extra must be a sequence of flags, not the text {self.extra!r}")
        object.__setattr__(self, "extra", tuple(self.extra))


def compile_flags(options: Options, compiler: CompilerInfo, size: int, *, hidden: bool) -> list[str]:
    """Flags that compile one C file of a model.

    Parameters
    ----------
    options : Options
        How to compile.
    compiler : CompilerInfo
        Who compiles.
    size : int
        Length of all C files in bytes.
    hidden : bool
        Keep the symbols inside the library, so that two models in one process never meet.
    """
    level = options.optimize if options.optimize is not None else (1 if size > LARGE_SOURCE else 2)
    flags = ["-std=c99", f"-O{level}", "-fPIC", *machine_flags(options, compiler)]
    if compiler.kind != "other":
        # errno is never read; contraction would make results depend on the processor.
        flags += ["-ffp-contract=off", "-fno-math-errno"]
    if hidden:
        flags.append("-fvisibility=hidden")
    if options.warnings:
        flags += ["-Wall", "-Wextra", "-Werror"]
    return [*flags, *options.extra]


def machine_flags(options: Options, compiler: CompilerInfo) -> list[str]:
    """Flags that say which processor to compile for."""
    if compiler.kind == "zig":
        # zig compiles for this very processor, and checks for undefined behaviour, unless told otherwise.
        return ["-mcpu=native" if options.native else "-mcpu=baseline", "-fno-sanitize=undefined"]
    return ["-march=native"] if options.native else []


def layer_flags(compiler: CompilerInfo) -> list[str]:
    """Flags that compile the Cython layer, whatever the options: it is compiled once for all models."""
    # -O2 takes a third longer and saves no time in a call.
    flags = ["-O1", "-fPIC", "-fwrapv", "-fvisibility=hidden", "-DNDEBUG"]
    return [*flags, "-DNPY_NO_DEPRECATED_API=NPY_1_7_API_VERSION", *machine_flags(Options(), compiler)]


def stepper_flags(compiler: CompilerInfo) -> list[str]:
    """Flags that compile the steppers: like a model's own code."""
    return compile_flags(Options(), compiler, 0, hidden=True)


def link_flags(options: Options, compiler: CompilerInfo, *, extension: bool) -> list[str]:
    """Flags that link object files into an extension module, or into a library for C programs."""
    if sys.platform == "darwin":
        kind = ["-bundle", "-undefined", "dynamic_lookup"] if extension else ["-dynamiclib"]
    else:
        # -Bsymbolic: a library finds its own functions first, whatever else the process has loaded.
        kind = ["-shared"] if compiler.kind == "other" else ["-shared", "-Wl,-Bsymbolic"]
    return [*kind, *machine_flags(options, compiler), *options.extra, "-lm"]
