"""C libraries that stand alone, in double and in single precision: results, what they need, what they say they cost.

Judges: the compiled module in double precision; gcc's own account of stack (-fcallgraph-info) and of symbols (nm); for
processors without an operating system, Debian's cross compilers and the emulators of qemu, where they are installed.
"""

from __future__ import annotations

import ctypes
import re
import subprocess
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
from sweeps import part_of

import eomgen as eg
from benchmarks.models import panda
from eomgen.emit.c_bounds import stack_of
from eomgen.emit.single_precision import single_limit
from eomgen.errors import UsageError
from eomgen.generation import generate

BARE = ["-std=c99", "-O2", "-ffp-contract=off", "-DEOMGEN_LANES=0", "-DEOMGEN_WITHOUT_SERIES"]
WARNINGS = ["-Wall", "-Wextra", "-Werror", "-Wconversion", "-Wdouble-promotion", "-Wshadow", "-Wpedantic"]
OPTIMIZED = "slider_crank"  # the others compile in a quarter of the time, to the same numbers
CASES = ["double_pendulum", "slider_crank", "skewed_four_bar", "powered_arm", "spatial_loop"]
#: Kernels that both have, with the number of states; the digits that single precision leaves of the largest entry.
KERNELS = ("rhs", "mass_matrix", "bias", "energy", "project", "jacobian")
LEFT = 2e-4


def c_files(folder: Path) -> list[str]:
    """The library's own sources."""
    return sorted(file.name for file in folder.glob(f"{folder.name}*.c") if "real_time" not in file.name)


class Small:
    """A library in single precision, through ctypes."""

    def __init__(self, folder: Path, module: Any) -> None:
        name = folder.name
        level = "-O2" if name == OPTIMIZED else "-O0"
        command = ["gcc", "-shared", "-fPIC", *BARE, level, *WARNINGS, *c_files(folder), "-o", "lib.so", "-lm"]
        subprocess.run(command, cwd=folder, check=True)
        self.library, self.name = ctypes.CDLL(str(folder / "lib.so")), name
        sizes = {k: int(v) for k, v in re.findall(r"_N_(\w+) = (\d+)", (folder / f"{name}.h").read_text())}
        self.c, self.w = (np.zeros(sizes[k] + 1, np.float32) for k in ("CONST", "STEP_WORK"))
        self.u = np.append(module.u, 0.0).astype(np.float32)
        assert self.function("precompute")(self.at(np.append(module.p, 0.0).astype(np.float32)), self.at(self.c)) == 0

    def function(self, kernel: str) -> Any:
        return getattr(self.library, f"{self.name}_{kernel}")

    @staticmethod
    def at(array: np.ndarray) -> Any:
        return array.ctypes.data_as(ctypes.c_void_p)

    def call(self, kernel: str, x: np.ndarray, size: int) -> np.ndarray:
        out = np.zeros(size, np.float32)
        places = [self.at(a) for a in (x.astype(np.float32), self.u, self.c, out, self.w)]
        assert self.function(kernel)(ctypes.c_float(0.0), *places) == 0
        return out

    def step(self, kernel: str, x: np.ndarray, h: float) -> np.ndarray:
        moved = x.astype(np.float32)
        places = [self.at(a) for a in (moved, self.u, self.c, self.w)]
        assert self.function(kernel)(ctypes.c_float(0.0), ctypes.c_float(h), *places) == 0
        return moved


@pytest.fixture(scope="module", params=CASES)
def small(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Small, Any]:
    """The library in single precision beside the module in double precision."""
    judge = models.build(request.param).compile(target="numpy")
    folder = generate(models.build(request.param), tmp_path_factory.mktemp("c"), target="c", precision="float")
    return Small(folder, judge), judge


def states(module: Any, count: int = 4) -> list[np.ndarray]:
    random = np.random.default_rng(3)
    start = module.x0()
    return [start, *(module.project(start + 0.1 * random.normal(size=start.size)) for _ in range(count - 1))]


def test_single_precision_agrees_with_double(small: tuple[Small, Any]) -> None:
    library, module = small
    for x in states(module):
        for kernel in KERNELS:
            of_q = kernel == "mass_matrix"
            given = x[: module.n_q] if of_q else x
            expected = np.ravel(getattr(module, kernel)(0.0, x) if kernel in ("rhs", "bias", "jacobian") else
                                getattr(module, kernel)(given))  # fmt: skip
            found = library.call(kernel, given, expected.size)
            assert np.abs(found - expected).max() <= LEFT * max(1.0, np.abs(expected).max()), kernel


def test_both_steps_converge_to_the_same_motion(small: tuple[Small, Any]) -> None:
    """RK4 is exact for a short way; semi-implicit Euler's error falls with its step."""
    library, module = small
    x, span = module.x0(), 0.02
    by_rk4 = x
    for _ in range(10):
        by_rk4 = library.step("step", by_rk4, span / 10)
    errors = []
    for n in (20, 80):
        y = x
        for _ in range(n):
            y = library.step("step_semi_implicit", y, span / n)
        errors.append(float(np.abs(y - by_rk4).max()))
    scale = float(np.abs(by_rk4 - x).max())
    assert errors[1] <= max(0.4 * errors[0], 2e-5 * max(1.0, float(np.abs(by_rk4).max())))
    assert errors[1] < 0.1 * scale


@pytest.fixture(scope="module")
def arm() -> Any:
    """Franka's arm as a module of NumPy functions."""
    return panda().compile(target="numpy")


@pytest.fixture(scope="module", params=part_of(["double", "float"], lambda name: name == "double"))
def arm_library(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return generate(panda(), tmp_path_factory.mktemp(request.param), target="c", precision=request.param)


def test_stack_stays_below_what_the_header_says(arm_library: Path) -> None:
    """gcc tells the bytes of every function and who calls whom."""
    name = arm_library.name
    files = c_files(arm_library)
    subprocess.run(["gcc", *BARE, "-fcallgraph-info=su", "-c", *files], cwd=arm_library, check=True)
    text = "".join((arm_library / f"{file.removesuffix('.c')}.ci").read_text() for file in files)
    own = {
        title.split(":")[-1]: int(size)
        for title, size in re.findall(r'node: \{ title: "(\S+)" label: ".*?\\n(\d+) bytes', text)
    }
    calls = [
        (a.split(":")[-1], b.split(":")[-1]) for a, b in re.findall(r'sourcename: "(\S+)" targetname: "(\S+)"', text)
    ]

    def measured(function: str) -> int:
        return own.get(function, 0) + max((measured(b) for a, b in calls if a == function and b != a), default=0)

    header = (arm_library / f"{name}.h").read_text()
    told = {
        k: int(n) for k, n in re.findall(r"^     (\w+): .*\n.*\n +at most (\d+) bytes of stack", header, re.MULTILINE)
    }
    assert len(told) > 15
    for kernel, bound in told.items():
        assert 0 < measured(f"{name}_{kernel}") <= bound, kernel
    assert max(told.values()) < 60_000


def test_every_variable_has_its_place_on_the_stack() -> None:
    text = """
enum { N = 3, WIDTH = 2 * N + 1 };
static int inner(const double *a)
{
    double b[N + 1], c[2][WIDTH];
    int i, j = 2;
    return 0;
}

int outer(double t)
{
    const double s = sin(t);
    return inner(&s);
}
"""
    inner = 256 + 8 * (1 + 2 + 4 + 14 + 2)
    assert stack_of([text]) == {"inner": inner, "outer": inner + 256 + 8 * 2}


def test_what_a_model_says_of_itself_is_not_taken_for_code(tmp_path: Path) -> None:
    """Its text stands in the C as well, where lengths of arrays are read."""
    text = (models.EXAMPLES / "slider_crank.yaml").read_text(encoding="utf-8")
    doc = 'doc: "Here M = m_c r^2, N = 2, WIDTH = rpm; static int f(int n) { real a[9000]; }"'
    bounds = []
    for name, given in (("plain", text), ("told", re.sub("^doc: .*", doc, text, flags=re.M))):
        (tmp_path / f"{name}.yaml").write_text(given, encoding="utf-8")
        model = eg.load(tmp_path / f"{name}.yaml")
        folder = generate(model, tmp_path / name, target="c")
        bounds.append(stack_of((folder / file).read_text() for file in c_files(folder)))
    assert len(bounds[0]) > 50
    assert bounds[0] == bounds[1]


def test_nothing_is_written_but_what_is_given(arm_library: Path) -> None:
    """No data that is written, no heap, no input or output: of other objects, only mathematics and copies of memory."""
    flags = [*BARE, *WARNINGS, "-fno-pie", "-DEOMGEN_OWN_ANGLES"]
    files = c_files(arm_library)
    subprocess.run(["gcc", *flags, "-r", *files, "-o", "bare.o"], cwd=arm_library, check=True)
    symbols = subprocess.run(["nm", "bare.o"], cwd=arm_library, check=True, capture_output=True, text=True).stdout
    kinds = {line.split()[-2] for line in symbols.splitlines()}
    needed = {line.split()[-1] for line in symbols.splitlines() if line.split()[-2] == "U"}
    assert kinds <= {"T", "t", "R", "r", "U"}
    assert needed <= {"memcpy", "memset", "sqrt", "sqrtf", "fmax", "fmin", "fmaxf", "fminf"}


MAIN = """
#include <math.h>
#include "{name}.h"
#if defined(__arm__) && !defined(__linux__) /* no operating system below the program but the emulator's */
void _start(void);
int main(void);
static int call(int number, int a, const void *b, int n)
{{
    register int r7 __asm__("r7") = number;
    register int r0 __asm__("r0") = a;
    register const void *r1 __asm__("r1") = b;
    register int r2 __asm__("r2") = n;
    __asm__ volatile("svc 0" : "+r"(r0) : "r"(r7), "r"(r1), "r"(r2) : "memory");
    return r0;
}}
static void put(const void *bytes, int n) {{ (void)call(4, 1, bytes, n); }}
void _start(void) {{ (void)call(1, main(), 0, 0); }}
#else
#include <stdio.h>
static void put(const void *bytes, int n) {{ fwrite(bytes, 1, (size_t)n, stdout); }}
#endif

static {type} c[{prefix}_N_CONST + 1], w[{prefix}_N_WORK + 1], out[{prefix}_N_X * {prefix}_N_X];

static void show(int status, int n)
{{
    if (status != 0) {{ out[0] = ({type})NAN; }}
    put(out, n * (int)sizeof(out[0]));
}}

int main(void)
{{
    static const {type} p[] = {{ {p} }}, u[] = {{ {u} }}, x[{count}][{prefix}_N_X] = {{ {x} }};
    {name}_precompute(p, c);
    for (int k = 0; k < {count}; k++) {{
        show({name}_rhs(0, x[k], u, c, out, w), {prefix}_N_X);
        show({name}_mass_matrix(0, x[k], u, c, out, w), {prefix}_N_V * {prefix}_N_V);
        show({name}_jacobian(0, x[k], u, c, out, w), {prefix}_N_X * {prefix}_N_X);
    }}
    return 0;
}}
"""
#: Compiler and emulator of each processor.  Code for Cortex-M7 runs on a larger one, whose instructions include
#: its own: qemu 7.2 starts no program on a Cortex-M7 without a machine around it.
PROCESSORS = {
    "this one": (["gcc"], [], ()),
    "cortex-m7": (
        ["arm-none-eabi-gcc", "-mcpu=cortex-m7", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv5-d16", "-nostartfiles"],
        ["qemu-arm", "-cpu", "max"],
        ("gcc for ARM", "qemu"),
    ),
    "risc-v": (["riscv64-linux-gnu-gcc", "-static"], ["qemu-riscv64"], ("gcc for RISC-V", "qemu")),
}


@pytest.mark.parametrize(
    "processor", [pytest.param(name, marks=pytest.mark.needs(*needs)) for name, (*_, needs) in PROCESSORS.items()]
)
def test_processors_agree(processor: str, arm: Any, arm_library: Path) -> None:
    """Franka's arm: 1e-13 in double precision, 1e-5 in single precision, relative to the largest entry."""
    compiler, emulator, _ = PROCESSORS[processor]
    name, precision = arm_library.name, arm_library.parent.name.rstrip("0123456789")
    given = states(arm)
    numbers = {
        "p": [*arm.p, 0.0], "u": [*arm.u, 0.0], "x": np.concatenate(given), "count": len(given), "type": precision,
    }  # fmt: skip
    texts = {k: ", ".join(map(repr, map(float, v))) if k in "pux" else v for k, v in numbers.items()}
    (arm_library / "main.c").write_text(MAIN.format(name=name, prefix=name.upper(), **texts))
    command = [*compiler, *BARE, "-O1", "-DEOMGEN_WITHOUT_TABLES", "-ffunction-sections", "-Wl,--gc-sections"]
    subprocess.run([*command, "main.c", *c_files(arm_library), "-o", "main", "-lm"], cwd=arm_library, check=True)
    done = subprocess.run([*emulator, "./main"], cwd=arm_library, check=True, capture_output=True)
    found = np.frombuffer(done.stdout, {"double": np.float64, "float": np.float32}[precision])
    for x in given:
        for expected in (arm.rhs(0.0, x), arm.mass_matrix(x[: arm.n_q]), arm.jacobian(0.0, x)):
            rows, found = np.split(found, [expected.size])
            error = np.abs(rows - np.ravel(expected)).max()
            assert error <= {"double": 1e-13, "float": 1e-5}[precision] * np.abs(expected).max()
    assert not found.size


def test_limits_keep_their_meaning() -> None:
    assert single_limit(2.0**-52) == pytest.approx(2.0**-23)
    assert single_limit(2.0**-26) == pytest.approx(2.0**-11.5)
    assert single_limit(0.01) == 0.01
    assert 1e-38 < single_limit(1e-300) < 1e-36
    assert 1e36 < single_limit(1e300) < 1e38


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"target": "c", "precision": "half"}, "no precision 'half'; there are double, float"),
        ({"target": "cython", "precision": "float"}, "precision='float' is for target c"),
    ],
)
def test_wrong_precisions_are_refused(options: dict[str, str], words: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=words):
        generate(models.build("pendulum"), tmp_path, **options)
    assert not list(tmp_path.iterdir())
