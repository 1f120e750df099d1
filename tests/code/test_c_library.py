"""C libraries that stand alone, in double and in single precision: results, what they need, what they say they cost.

Judges: the compiled module in double precision; gcc's own account of stack (-fcallgraph-info) and of symbols (nm); for
processors without an operating system, Debian's cross compilers and the emulators of qemu, where they are installed.
"""

import ctypes
import re
import subprocess
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
from command import run
from sweeps import part_of

import eomgen as eg

BARE = ["-std=c99", "-O2", "-ffp-contract=off", "-DEOMGEN_LANES=0", "-DEOMGEN_WITHOUT_SERIES"]
WARNINGS = ["-Wall", "-Wextra", "-Werror", "-Wconversion", "-Wdouble-promotion", "-Wshadow", "-Wpedantic", "-Wvla"]
OPTIMIZED = "slider_crank"  # the others compile in a quarter of the time, to the same numbers
CASES = ["slider_crank", "powered_arm", "double_pendulum", "skewed_four_bar", "spatial_loop"]
#: Kernels that both have, with the number of states; the digits that single precision leaves of the largest entry.
KERNELS = ("rhs", "mass_matrix", "bias", "energy", "project", "jacobian")
LEFT = 2e-4


def c_files(folder: Path) -> list[str]:
    """The library's own sources."""
    files = [*folder.glob(f"{folder.name}*.c"), *folder.glob("eomgen_*.c")]
    return sorted(file.name for file in files if "real_time" not in file.name)


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


@pytest.fixture(scope="module", params=part_of(CASES, lambda name: name in ("slider_crank", "double_pendulum")))
def small(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Small, Any]:
    """The library in single precision beside the module in double precision."""
    judge = models.build(request.param).compile(target="numpy")
    folder = library(models.build(request.param), tmp_path_factory.mktemp("c"), "--precision", "float")
    return Small(folder, judge), judge


def library(model: eg.Model, folder: Path, *words: str) -> Path:
    """The sources that the command writes."""
    model.save(folder / "model.yaml")
    assert run("generate", folder / "model.yaml", "--out", folder, "--target", "c", *words).code == 0
    return folder / model.name


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


@pytest.fixture(
    scope="module",
    params=part_of(["slider_crank double", "puma560 double", "puma560 float"], lambda case: case[0] == "s"),
)
def built_library(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of a loop and of an arm."""
    name, precision = request.param.split()
    return library(models.build(name), tmp_path_factory.mktemp(precision), "--precision", precision)


def bytes_of_stack(folder: Path) -> dict[str, int]:
    """What the header says of every function."""
    header = (folder / f"{folder.name}.h").read_text()
    found = re.findall(r"^     (\w+): .*\n.*\n +at most (\d+) bytes of stack", header, re.MULTILINE)
    return {name: int(size) for name, size in found}


def test_nothing_is_written_but_what_is_given(built_library: Path) -> None:
    """No data that is written, no heap, no input or output: of other objects, only mathematics and copies of memory."""
    flags = [*BARE, *WARNINGS, "-fno-pie", "-DEOMGEN_OWN_ANGLES"]
    files = c_files(built_library)
    subprocess.run(["gcc", *flags, "-r", *files, "-o", "bare.o"], cwd=built_library, check=True)
    symbols = subprocess.run(["nm", "bare.o"], cwd=built_library, check=True, capture_output=True, text=True).stdout
    kinds = {line.split()[-2] for line in symbols.splitlines()}
    needed = {line.split()[-1] for line in symbols.splitlines() if line.split()[-2] == "U"}
    assert kinds <= {"T", "t", "R", "r", "U"}
    mathematics = {"sqrt", "fmax", "fmin", "sin", "cos", "sincos"}
    assert needed <= {"memcpy", "memmove", "memset", *mathematics, *(f"{function}f" for function in mathematics)}


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
ARM = ["arm-none-eabi-gcc", "-mcpu=cortex-m7", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv5-d16", "-nostartfiles"]
PROCESSORS = {
    "this one": (["gcc"], [], ()),
    "cortex-m7": (ARM, ["qemu-arm", "-cpu", "max"], ("gcc for ARM", "qemu")),
    "risc-v": (["riscv64-linux-gnu-gcc", "-static"], ["qemu-riscv64"], ("gcc for RISC-V", "qemu")),
}


@pytest.mark.parametrize(
    "processor",
    [
        pytest.param(name, marks=[pytest.mark.needs(*needs), *([pytest.mark.thorough] if needs else [])])
        for name, (*_, needs) in PROCESSORS.items()
    ],
)
def test_processors_agree(processor: str, built_library: Path) -> None:
    """To 1e-13 in double precision, 1e-5 in single precision, relative to the largest entry."""
    compiler, emulator, _ = PROCESSORS[processor]
    arm = models.build(built_library.name).compile(target="numpy")
    name, precision = built_library.name, built_library.parent.name.rstrip("0123456789")
    given = states(arm)
    numbers = {
        "p": [*arm.p, 0.0], "u": [*arm.u, 0.0], "x": np.concatenate(given), "count": len(given), "type": precision,
    }  # fmt: skip
    texts = {k: ", ".join(map(repr, map(float, v))) if k in "pux" else v for k, v in numbers.items()}
    (built_library / "main.c").write_text(MAIN.format(name=name, prefix=name.upper(), **texts))
    command = [*compiler, *BARE, "-O1", "-DEOMGEN_WITHOUT_TABLES", "-ffunction-sections", "-Wl,--gc-sections"]
    subprocess.run([*command, "main.c", *c_files(built_library), "-o", "main", "-lm"], cwd=built_library, check=True)
    done = subprocess.run([*emulator, "./main"], cwd=built_library, check=True, capture_output=True)
    found = np.frombuffer(done.stdout, {"double": np.float64, "float": np.float32}[precision])
    for x in given:
        for expected in (arm.rhs(0.0, x), arm.mass_matrix(x[: arm.n_q]), arm.jacobian(0.0, x)):
            rows, found = np.split(found, [expected.size])
            error = np.abs(rows - np.ravel(expected)).max()
            assert error <= {"double": 1e-13, "float": 2e-5}[precision] * np.abs(expected).max()
    assert not found.size


@pytest.mark.parametrize("target", ["cython", "cuda"])
def test_single_precision_is_for_c_alone(target: str, tmp_path: Path) -> None:
    words = ("--out", tmp_path, "--target", target, "--precision", "float")
    refused = run("generate", models.EXAMPLES / "pendulum.yaml", *words)
    assert refused.code in (1, 2)
    assert "is for target c" in refused.err
    assert not list(tmp_path.iterdir())


def test_a_text_cannot_break_the_sources(tmp_path: Path) -> None:
    """Whatever documents say, and whatever a model is called; what stands in a text is not taken for code."""
    doc = 'It says """hello""" \\n */ and {{ more }} ??/\nstatic int f(int n) { real a[9000]; } N = 2'
    for name in ("block", "rhs", "driver", "N", "main", "x"):
        stacks = []
        for k, said in enumerate(("", doc)):
            m = eg.Model(name, doc=said)
            m.prismatic("J", m.ground, m.body("b", mass=1.0), axis="x", coordinate="s")
            m.parameter("l", 1.0, unit="m", doc=said and 'a length, "quoted"??/ and */ awkward')
            (tmp_path / f"{name}{k}").mkdir()
            folder = library(m, tmp_path / f"{name}{k}")
            subprocess.run(["gcc", "-std=c99", *WARNINGS, "-fsyntax-only", *c_files(folder)], cwd=folder, check=True)
            stacks.append(bytes_of_stack(folder))
        assert len(stacks[0]) > 15
        assert stacks[0] == stacks[1]


def test_the_package_builds_its_libraries_and_its_example(tmp_path: Path) -> None:
    """Judged by the closed form of a slider-crank's velocities, r = 0.1 and l = 0.35."""
    folder = library(models.build("slider_crank"), tmp_path)
    text = re.search(r"```c\n(.*?)```", (folder / "README.md").read_text(), re.DOTALL)
    assert text is not None
    (folder / "slider_crank_example.c").write_text(text.group(1))
    flags = "CFLAGS=-O0 -std=c99 -fPIC -Wall -Wextra -Werror"
    subprocess.run(["make", "-s", "all", "slider_crank_example", flags], cwd=folder, check=True)
    assert (folder / "libslider_crank.so").exists()
    done = subprocess.run(["./slider_crank_example"], cwd=folder, capture_output=True, text=True, check=True)
    x_dot = [float(word) for word in done.stdout.split()]
    module = models.build("slider_crank").compile(target="numpy")
    given = re.search(r"const double x\[SLIDER_CRANK_N_X\] = \{ (.*?) \}", text.group(1))
    assert given is not None
    x = [float(word) for word in given.group(1).split(", ")]
    np.testing.assert_allclose(x_dot, module.rhs(0.0, x), rtol=1e-9, atol=1e-9)
    theta, omega = x[module.x_names.index("theta")], x[module.x_names.index("theta_dot")]
    phi = -np.arcsin(0.1 / 0.35 * np.sin(theta))
    turning = -0.1 / 0.35 * np.cos(theta) / np.cos(phi) * omega
    speed = -0.1 * np.sin(theta) * omega - 0.35 * np.sin(phi) * turning
    assert abs(omega) >= 1.0
    assert x_dot[module.q_names.index("s")] == pytest.approx(speed, abs=1e-12)
