"""The generated C under compilers' warnings, sanitizers and valgrind, and what its objects hold.

``c_code_driver.c`` calls every function; this module makes the sources, the numbers and the commands.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path

import numpy as np

import eomgen as eg
from eomgen.compilation.cython_layer import HEADERS
from eomgen.layer import read_header, read_layer
from eomgen.pipeline import build
from eomgen.program import KERNELS, Program

DRIVER = Path(__file__).with_name("c_code_driver.c")
EXAMPLES = Path(__file__).parents[2] / "examples"
NAMES = (*sorted(path.name for path in EXAMPLES.glob("*.yaml")), "arm.urdf")

WARNINGS = (
    *("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Wdouble-promotion", "-Wvla", "-Werror"),
    "-ffp-contract=off",
)
C, CXX = ("-std=c99",), ("-x", "c++", "-std=c++17")
#: What compiles for each language, as far as it is installed.
COMPILERS = {"gcc": C, "clang": C, "g++": CXX, "clang++": CXX}

SANITIZERS = ("-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
#: What objects may call besides one another: mathematics, and what compilers make of copied structures.
MATHEMATICS = frozenset(
    {
        "sin",
        "cos",
        "tan",
        "asin",
        "acos",
        "atan",
        "atan2",
        "hypot",
        "sinh",
        "cosh",
        "tanh",
        "asinh",
        "acosh",
        "atanh",
        "sincos",
        "exp",
        "log",
        "sqrt",
        "pow",
    }
    | {"fabs", "ldexp", "floor", "ceil", "fmod", "fmin", "fmax", "nextafter", "fma", "copysign", "trunc", "round"}
)
COPIES = frozenset({"memcpy", "memset", "memmove", "memcmp", "_GLOBAL_OFFSET_TABLE_"})


@cache
def find(compiler: str) -> str | None:
    """A compiler's command, of whatever version; None if it is not installed."""
    versions = [f"{compiler}-{k}" for k in range(22, 10, -1)]
    return next((found for name in (compiler, *versions) if (found := shutil.which(name))), None)


def installed(*names: str) -> list[str]:
    """Those of the compilers that this machine has; the first need not be asked: nothing works without it."""
    return [name for name in names if name == names[0] or find(name)]


def program_of(name: str, method: str, kernels: str = "all") -> Program:
    """An example by a method: ``all`` functions, as target c has them, or target cython's: ``now`` or ``late``."""
    equations = eg.load(EXAMPLES / name).derive(method)
    if kernels == "all":
        return build(equations, "c")
    now = build(equations, "cython", [k.name for k in KERNELS if not k.late])
    late = [k.name for k in KERNELS if k.late and 0 not in k.shape(now.sizes)]
    return now if kernels == "now" else build(equations, "cython", late)


def write(folder: Path, sources: Mapping[str, str]) -> list[str]:
    """Write sources; the names of the C files."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in sources.items():
        (folder / name).write_text(text, encoding="utf-8")
    return sorted(name for name in sources if name.endswith(".c"))


def layer() -> dict[str, str]:
    """The layer's files in C."""
    texts = {name: text for name, text in read_layer().items() if name.endswith((".c", ".h"))}
    return {**texts, **{name: read_header(name) for name in HEADERS}}


def run(command: Sequence[str], folder: Path, limit: float = 600.0) -> subprocess.CompletedProcess[str]:
    return subprocess.run(list(command), cwd=folder, capture_output=True, text=True, check=False, timeout=limit)


def warnings_of(compiler: str, folder: Path, files: Sequence[str], *further: str) -> str:
    """What a compiler has against C files; empty if nothing."""
    command = find(compiler)
    assert command, f"{compiler} is not installed"
    done = run([command, *COMPILERS[compiler], *WARNINGS, *(further or ("-fsyntax-only",)), *files], folder)
    return done.stderr[:4000] if done.returncode else ""


def objects_of(
    compiler: str, folder: Path, files: Sequence[str], flags: Sequence[str], suffix: str = ".o"
) -> list[str]:
    """Compile each file to an object."""
    command = find(compiler)
    assert command, f"{compiler} is not installed"
    made = []
    for file in files:
        done = run([command, *C, "-fPIC", *flags, "-c", file, "-o", f"{file}{suffix}"], folder)
        assert done.returncode == 0, f"{file}: {done.stderr[:2000]}"
        made.append(str(folder / f"{file}{suffix}"))
    return made


def numbers_of(program: Program, states: int = 6, seed: int = 5) -> bytes:
    """What the driver reads: states near the reference, far from it, infinite, NaN and beyond all bounds."""
    random = np.random.default_rng(seed)
    metadata = program.metadata
    q = np.array(metadata["q_reference"], dtype=float)
    p, u = (np.array(metadata[key], dtype=float) for key in ("p_values", "u_values"))
    far = [1e9, np.inf, np.nan, 1e308, 1e-310, -np.inf]

    def entry(port: str, size: int, j: int) -> np.ndarray:
        if j >= states:  # one number of the state is odd
            values = random.normal(size=size)
            if size:
                values[j % size] = far[j - states]
            return values
        if port in ("q", "q_guess"):
            return q + (0.05 * j * random.normal(size=size))
        return random.normal(size=size)

    count = states + len(far)
    parts = [np.array([float(count)]), p, u, random.uniform(0.0, 1.0, count)]
    for kernel in program.kernels:
        parts += [entry(port.name, len(port.symbols), j) for j in range(count) for port in kernel.ports]
    return b"".join(part.astype(float).tobytes() for part in parts)


def executable(compiler: str, folder: Path, objects: Sequence[str], flags: Sequence[str]) -> str:
    """Link objects with the driver, which is among them."""
    command = find(compiler)
    assert command
    done = run([command, *flags, *objects, "-o", "driver", "-lm", "-lpthread"], folder)
    assert done.returncode == 0, done.stderr[:2000]
    return str(folder / "driver")


REPORT = re.compile(r"calls (\d+) lanes (\d+) widths (\d+) kernels (\d+) faults (\d+)")


def drive(folder: Path, binary: str, program: Program, *before: str) -> tuple[dict[str, int], str]:
    """Run the driver, perhaps under another program; what it counted, and what was wrong."""
    (folder / "numbers").write_bytes(numbers_of(program))
    done = run([*before, binary, "numbers"], folder)
    found = REPORT.search(done.stdout)
    words = ("calls", "lanes", "widths", "kernels", "faults")
    counts = dict(zip(words, map(int, found.groups()), strict=True)) if found else {}
    said = f"exit {done.returncode}: {done.stdout[:1500]}{done.stderr[:3000]}"
    return counts, "" if done.returncode == 0 and found else said


def state_of(objects: Sequence[str], folder: Path, *allowed: str) -> list[str]:
    """Writable numbers that objects keep, and functions they call that are not theirs, mathematics or `allowed`."""
    found = []
    for section, size in re.findall(r"^(\.\S+)\s+(\d+)\s", run(["size", "-A", *objects], folder).stdout, re.M):
        constant = section.startswith((".data.rel.ro", ".data..ro"))  # written by the loader alone
        if section.startswith((".data", ".bss", ".tdata", ".tbss")) and not constant and int(size):
            found.append(f"{size} bytes in {section}")
    lines = run(["nm", *objects], folder).stdout.splitlines()
    words = [line.split() for line in lines if line and not line.endswith(":")]
    own = {word[-1] for word in words if len(word) == 3}
    common = {word[-1] for word in words if len(word) == 3 and word[1] in "CGgSs"}
    called = {word[-1] for word in words if len(word) == 2 and word[0] in "UwvW"} - own
    found += [f"writable: {name}" for name in sorted(common)]
    return found + [f"calls {name}" for name in sorted(called - MATHEMATICS - COPIES - {*allowed})]
