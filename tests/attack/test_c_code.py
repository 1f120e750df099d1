"""Exported C as compilers and sanitizers judge it: no warning, no state, no access beyond an array, no thread in the way."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import command
import models
import numpy as np
import pytest
from children import HANGS
from sweeps import METHODS, part_of

import eomgen as eg

ROOT = Path(__file__).parents[2]
DRIVER = Path(__file__).with_name("c_driver.c")
WARNINGS = (
    *("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Wdouble-promotion", "-Wvla", "-Werror"),
    "-ffp-contract=off",
)
COMPILERS = {
    "C99": ["gcc", "-std=c99", "-fsyntax-only"], "C++": ["g++", "-x", "c++", "-std=c++17", "-fsyntax-only"],
    "portable": ["gcc", "-std=c99", "-DEOMGEN_PORTABLE", "-O1", "-c"],
    "clang": ["clang", "-std=c99", "-fsyntax-only"],
    "clang++": ["clang++", "-x", "c++", "-std=c++17", "-fsyntax-only"],
}  # fmt: skip
SANITIZERS = ("-g", "-O0", "-ffp-contract=off", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
#: What objects may call besides one another: mathematics, and what compilers make of copied structures.
CALLED = set(
    "sin cos tan asin acos atan atan2 hypot sinh cosh tanh asinh acosh atanh sincos exp log sqrt pow fabs ldexp floor ceil "
    "fmod fmin fmax nextafter fma copysign trunc round memcpy memset memmove memcmp _GLOBAL_OFFSET_TABLE_ "
    "__cpu_model __cpu_indicator_init".split()  # by gcc, for functions that are compiled for several processors
)
#: Of models beside the examples: redundant rows, a long tree as loops, contacts.
ALL = [(path.stem, "embedding") for path in sorted(models.EXAMPLES.glob("*.yaml"))]
ALL += [(name, method) for name in ("slider_crank", "satellite") for method in METHODS[1:]]
ALL += [(name, "auto") for name in ("three_cranks", "many_links", "heap")]
EVERY = part_of(ALL, ("slider_crank", "embedding").__eq__)
FEW = ("slider_crank", "hydraulic_boom", "heap")


def many_links() -> eg.Model:
    """A chain so long that its functions are loops over alike bodies."""
    m, last = eg.Model("many_links", gravity=(0, -9.81, 0)), None
    for k in range(70):
        link = m.body(f"b{k}", mass=1.0, com=(0.05, 0.01, 0.02), inertia=(1e-3, 1.2e-3, 1.5e-3))
        m.revolute(f"j{k}", m.ground if last is None else last.at(0.1, 0, 0), link, axis="zy"[k % 2])
        last = link
    return m


def exported(name: str, method: str, folder: Path) -> list[str]:
    """Write the C library of a model into a folder; the names of its C files."""
    (many_links() if name == "many_links" else models.build(name)).save(folder / "model.yaml")
    done = command.run("generate", "model.yaml", "--method", method, "--target", "c", "--out", ".", cwd=folder)
    assert done.code == 0, done.err
    for file in (folder / name).iterdir():
        if file.suffix in (".c", ".h", ".json"):
            shutil.move(file, folder / file.name)
    return sorted(file.name for file in folder.glob("*.c") if not file.name.endswith("_real_time.c"))


def run(*words: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(words, cwd=cwd, capture_output=True, text=True, check=False, timeout=HANGS)


@pytest.mark.parametrize("compiler", [
    "C99", "C++", pytest.param("portable", marks=pytest.mark.thorough),
    *(pytest.param(name, marks=[pytest.mark.thorough, pytest.mark.needs("clang")]) for name in ("clang", "clang++")),
])  # fmt: skip
@pytest.mark.parametrize(
    ("name", "method"), part_of(ALL, lambda case: case[0] in FEW and case[1] in ("embedding", "auto"))
)
def test_compilers_say_nothing(name: str, method: str, compiler: str, tmp_path: Path) -> None:
    """Warnings are errors; what warns where values are followed shows with optimization, in the thorough run."""
    files = exported(name, method, tmp_path)
    done = run(*COMPILERS[compiler], *WARNINGS, *files, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(("name", "method"), EVERY)
def test_objects_keep_no_state_and_call_mathematics_alone(name: str, method: str, tmp_path: Path) -> None:
    files = exported(name, method, tmp_path)
    assert run("gcc", "-std=c99", "-fPIC", "-O0", "-c", *files, cwd=tmp_path).returncode == 0
    objects = [file.replace(".c", ".o") for file in files]
    for section, size in re.findall(r"^(\.\S+)\s+(\d+)\s", run("size", "-A", *objects, cwd=tmp_path).stdout, re.M):
        constant = section.startswith((".data.rel.ro", ".data..ro"))  # written by the loader alone
        assert constant or not section.startswith((".data", ".bss", ".tdata", ".tbss")) or not int(size), section
    symbols = [line.split() for line in run("nm", *objects, cwd=tmp_path).stdout.splitlines() if line.strip()]
    own = {word[-1] for word in symbols if len(word) == 3}
    assert not [word for word in symbols if len(word) == 3 and word[1] in "CGgSs"]
    assert {word[-1] for word in symbols if len(word) == 2 and word[0] in "UwvW"} - own <= CALLED


def driven(folder: Path, files: list[str]) -> subprocess.CompletedProcess[str]:
    """Compile the files with the driver under the sanitizers, and run it."""
    data = json.loads((folder / "model.json").read_text())
    q, p, u = (np.array(data[key], dtype=float).ravel() for key in ("q_reference", "p_values", "u_values"))
    (folder / "numbers").write_bytes(b"".join(part.tobytes() for part in (np.array([float(len(q))]), p, u, q)))
    shutil.copy(DRIVER, folder)
    made = run("gcc", "-std=c99", *SANITIZERS, *files, DRIVER.name, "-o", "driver", "-lm", "-lpthread", cwd=folder)
    assert made.returncode == 0, made.stderr[:3000]
    return run("./driver", "numbers", cwd=folder)


@pytest.mark.slow
@pytest.mark.thorough
@pytest.mark.parametrize(("name", "method"), ALL)
def test_every_function_under_the_sanitizers(name: str, method: str, tmp_path: Path) -> None:
    """Plain and in lanes, at states that are far, infinite or NaN, in 8 threads."""
    done = driven(tmp_path, exported(name, method, tmp_path))
    assert done.returncode == 0, done.stdout[:1500] + done.stderr[:3000]
    assert "faults 0" in done.stdout
    assert "calls 0" not in done.stdout


@pytest.mark.thorough
def test_what_is_wrong_is_seen(tmp_path: Path) -> None:
    """A result that depends on what was in the work array, and an access beyond it."""
    files = exported("pendulum", "recursive", tmp_path)
    text = (tmp_path / "pendulum.c").read_text()
    before, after = text.split("static flag energy_block(")
    body, rest = after.split("EOMGEN_RETURN", 1)
    for line, said in (
        ("out[0] += w[0] != w[0];", "energy: depends on alignment"),
        ("w[-1] = 1.0;", "heap-buffer-overflow"),
    ):
        changed = f"{before}static flag energy_block({body}{line}\n    EOMGEN_RETURN{rest}"
        (tmp_path / "pendulum.c").write_text(changed)
        done = driven(tmp_path, files)
        assert done.returncode != 0
        assert said in done.stdout + done.stderr


RUNS = """
import numpy as np
import eomgen as eg
for name in ("two_link_manipulator", "slider_crank", "cam_follower", "rimless_wheel"):
    module = eg.load_example(name).compile()
    x = module.x0()
    many = np.repeat(x[:, None], 17, axis=1)
    for method in ("DOP853", "RK45", "RK4", "Radau", "Taylor"):
        options = {"step": 0.01} if method == "RK4" else {}
        try:
            module.simulate(0.2, method=method, **options)
            module.simulate_many(0.2, many, method=method, threads=4, **options)
        except eg.EomgenError as error:
            print(name, method, error)
    module.rhs(0.0, many), module.jacobian(0.0, x), module.project(x), module.energy(many), module.outputs(0.0, x)
print("done")
"""


@pytest.mark.slow
@pytest.mark.thorough
def test_runs_of_modules_under_the_sanitizers(tmp_path: Path) -> None:
    """Steppers, events and ensembles too: in a clone whose extension module is built with gcc's sanitizers."""
    clone, compiler = tmp_path / "clone", tmp_path / "cc"
    for folder in ("eomgen", "templates", "examples"):
        shutil.copytree(ROOT / folder, clone / folder, ignore=shutil.ignore_patterns("__pycache__", "_native*.so"))
    shutil.copy(ROOT / "pyproject.toml", clone)
    compiler.write_text('#!/bin/sh\nexec gcc "$@" -Og -fsanitize=address,undefined -fno-sanitize-recover=all\n')
    compiler.chmod(0o755)
    library = run("gcc", "-print-file-name=libasan.so", cwd=tmp_path).stdout.strip()
    told = {"CC": str(compiler), "EOMGEN_CACHE_DIR": str(tmp_path / "cache"), "EOMGEN_COMPILER_SECONDS": "900"}
    told |= {"LD_PRELOAD": library, "ASAN_OPTIONS": "detect_leaks=0"}
    done = subprocess.run(
        [sys.executable, "-c", RUNS],
        cwd=clone, env=os.environ | told, capture_output=True, text=True, check=False, timeout=3000,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-1000:] + done.stderr[-3000:]
    (native,) = (clone / "eomgen").glob("_native*.so")
    assert b"__asan_" in native.read_bytes()
    assert done.stdout.endswith("done\n")
