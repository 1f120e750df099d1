"""Options: how to compile -> the flags of every compiler and linker command."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ..base.texts import shown
from ..base.value_rules import as_count, read_count
from ..errors import ill_typed, no_choice
from .compiler import CompilerInfo
from .processor import NEEDS, lane_width

#: gcc: -O1. Measured with gcc 12 on one call of a right-hand side, beside -O2, which vectorises straight-line code
#: to its harm: Panda, UR5, Talos, ANYmal take 0.97, 0.96, 0.96, 0.91 of the time, linkages with loops 0.97 to 1, and
#: the compiler 0.6 of its time; -O3 is no faster than -O2 (``python -m benchmarks.run rhs``).
GCC_LEVEL = 1
#: Other compilers: -O2, and -O1 for models whose files are longer than this (bytes) together.
LARGE_SOURCE = 800_000
#: Lanes of processors whose instructions write a third register: -mavx, to the same bits. gcc 12 copies registers less,
#: so Talos and ANYmal take about 0.8 of the time (0.72 to 0.88 in four measurements on a Xeon), small arms 0.98.
WITH_AVX = 4


@dataclass(frozen=True, slots=True)
class Options:
    """Options of the compilation.

    Attributes
    ----------
    optimize : int or None
        Level 0 to 3; None chooses what was measured to be best: 1 for gcc, else 2, and 1 for large files. Changes the
        build.
    native : bool
        Use every instruction of this processor, and contract a*b + c into one of them; results may differ in the last
        digits. Changes the build. Without it modules have -mavx where this processor has AVX2: no result changes, and
        other processors get a build of their own.
    warnings : bool
        Treat the compiler's warnings as errors. Changes the build.
    extra : sequence of str
        More flags for compiling and linking. Changes the build.
    compiler : str or None
        Command line of the compiler; None finds one. Changes the build.
    lanes : {0, 2, 4, 8} or None
        States that batches take at a time in vector registers; None takes what suits this processor, compiled when
        batches or ensembles first need it, 0 leaves them out. Results of batches are the same, to the last bit; those
        of ensembles within the tolerance. Changes the build.
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
        for name, allowed in (("optimize", (0, 1, 2, 3)), ("lanes", (0, 2, 4, 8))):
            if (given := getattr(self, name)) is None:
                continue
            if as_count(given) not in allowed:
                *but, last = allowed
                raise no_choice(f"{name} must be None, {', '.join(map(str, but))} or {last}, not {shown(given)}")
            object.__setattr__(self, name, as_count(given))
        if self.jobs is not None:
            object.__setattr__(self, "jobs", read_count("jobs, files compiled at a time,", self.jobs, 1))
        if not isinstance(self.compiler, str | None):
            raise ill_typed(f"compiler must be a text, the command line of a compiler, not {shown(self.compiler)}")
        if isinstance(self.extra, str):
            raise ill_typed(f"extra must be a sequence of flags, not the text {self.extra!r}")
        object.__setattr__(self, "extra", tuple(self.extra))


def compile_flags(
    options: Options, compiler: CompilerInfo, size: int, *, hidden: bool, portable: bool = False
) -> list[str]:
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
    portable : bool, optional
        The code may go to other computers.
    """
    best = GCC_LEVEL if compiler.kind == "gcc" else 1 if size > LARGE_SOURCE else 2
    level = best if options.optimize is None else options.optimize
    flags = ["-std=c99", f"-O{level}", "-fPIC", *machine_flags(options, compiler)]
    if not portable and not options.native and compiler.kind in ("gcc", "clang") and lane_width() >= WITH_AVX:
        flags.append("-mavx")
    if compiler.kind != "other":
        # errno is never read; contraction makes results depend on the processor.
        flags += [f"-ffp-contract={'fast' if options.native else 'off'}", "-fno-math-errno"]
    if compiler.kind == "gcc" and options.native and level == 1:
        flags.append("-fexpensive-optimizations")  # without which gcc contracts nothing
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


def needed_features(flags: Mapping[str, Sequence[str]]) -> tuple[str, ...]:
    """Features of the processor, by NumPy's names, without which code compiled with such flags cannot run."""
    return NEEDS[WITH_AVX] if any("-mavx" in words for words in flags.values()) else ()


def link_flags(options: Options, compiler: CompilerInfo, *, extension: bool) -> list[str]:
    """Flags that link object files into an extension module, or into a library for C programs."""
    if sys.platform == "darwin":
        kind = ["-bundle", "-undefined", "dynamic_lookup"] if extension else ["-dynamiclib"]
    else:
        # -Bsymbolic: a library finds its own functions first, whatever else the process has loaded.
        kind = ["-shared"] if compiler.kind == "other" else ["-shared", "-Wl,-Bsymbolic"]
    return [*kind, *machine_flags(options, compiler), *options.extra, "-lm"]
