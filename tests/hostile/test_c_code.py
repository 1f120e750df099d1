"""The fast part of run_c_code.py: generated C of a few examples, and the layer's, as every compiler here judges it.

C99 and C++17 by gcc and clang; sanitizers over every function, lanes of every width; no state.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from hostile import c_code

from eomgen.emit import emit_c

#: A tree with lanes and series, a loop, Euler parameters with rolling, drivers of a linear system.
FEW = (
    ("two_link_manipulator.yaml", "recursive"),
    ("slider_crank.yaml", "embedding"),
    ("rolling_disc.yaml", "lagrange"),
    ("slider_crank.yaml", "newton_euler"),
)
#: What a source keeps and calls; an optimizer could but leave some of it out, and takes twice the time.
PLAIN = ("-O0",)
STRICT = ("-ffp-contract=off", *c_code.SANITIZERS, "-O0")


CLANG = pytest.mark.needs("clang")


@pytest.mark.parametrize(
    "compiler", ["gcc", "g++", pytest.param("clang", marks=CLANG), pytest.param("clang++", marks=CLANG)]
)
def test_no_warning_of_any_compiler(compiler: str, tmp_path: Path) -> None:
    for name, method in FEW:
        files = c_code.write(tmp_path / method, emit_c(c_code.program_of(name, method)))
        assert not c_code.warnings_of(compiler, tmp_path / method, files), (name, method)
    assert not c_code.warnings_of(compiler, tmp_path / "layer", c_code.write(tmp_path / "layer", c_code.layer()))


def test_objects_keep_no_state_and_call_mathematics_alone(tmp_path: Path) -> None:
    for name, method in FEW:
        files = c_code.write(tmp_path, emit_c(c_code.program_of(name, method)))
        assert not c_code.state_of(c_code.objects_of("gcc", tmp_path, files, PLAIN), tmp_path), (name, method)
    files = c_code.write(tmp_path / "layer", c_code.layer())
    objects = c_code.objects_of("gcc", tmp_path / "layer", files, PLAIN)
    assert not c_code.state_of(objects, tmp_path, "strcmp")  # looks for a function of the model by its name


@pytest.mark.slow
def test_every_function_under_the_sanitizers(tmp_path: Path) -> None:
    """Plain and in lanes, at states that are far, infinite or NaN, in 8 threads, and inside ensembles."""
    layer = tmp_path / "layer"
    files = c_code.write(layer, c_code.layer())
    (layer / c_code.DRIVER.name).write_text(c_code.DRIVER.read_text())
    shared = c_code.objects_of("gcc", layer, [*files, c_code.DRIVER.name], STRICT)
    for name, method in FEW[:2]:
        program = c_code.program_of(name, method)
        folder = tmp_path / method
        objects = c_code.objects_of("gcc", folder, c_code.write(folder, emit_c(program)), STRICT)
        counts, fault = c_code.drive(folder, c_code.executable("gcc", folder, [*objects, *shared], STRICT), program)
        assert not fault
        assert counts["kernels"] == len(program.kernels)
        assert counts["calls"] > 36 * len(program.kernels)
        assert counts["lanes"] > 0


def test_what_is_forbidden_is_seen(tmp_path: Path) -> None:
    """State, allocation, warnings and an access beyond an array: each is reported by what looks for it."""
    texts = {
        "state.c": "int next(void);\nint next(void)\n{\n    static int count = 7;\n    return count++;\n}\n",
        "room.c": "#include <stdlib.h>\nvoid *some(int n);\nvoid *some(int n)\n{\n    return malloc((unsigned)n);\n}\n",
        "narrow.c": "int cut(double x);\nint cut(double x)\n{\n    return x;\n}\n",
        "table.c": 'extern int puts(const char *);\nconst char *const names[] = {"a"};\n',
    }
    files = c_code.write(tmp_path, texts)
    objects = c_code.objects_of("gcc", tmp_path, files, ("-O1",))
    assert c_code.state_of(objects, tmp_path) == ["4 bytes in .data", "calls malloc"]
    assert "-Werror=float-conversion" in c_code.warnings_of("gcc", tmp_path, ["narrow.c"])
    assert not c_code.warnings_of("gcc", tmp_path, ["table.c"])


def test_a_function_that_remembers_is_seen(tmp_path: Path) -> None:
    """The driver finds a result that depends on what was in the work array."""
    program = c_code.program_of("pendulum.yaml", "recursive")
    sources = dict(emit_c(program))
    marker = "int pendulum_energy(double t,"
    before, after = sources["pendulum.c"].split(marker)
    body, rest = after.split("return status", 1)
    sources["pendulum.c"] = (
        f"{before}{marker}{body}out[0] += w[{program.sizes.n_v}] * 0.0 != 0.0;\n    return status{rest}"
    )
    files = c_code.write(tmp_path, {**sources, **c_code.layer(), c_code.DRIVER.name: c_code.DRIVER.read_text()})
    objects = c_code.objects_of("gcc", tmp_path, files, ("-O0", "-DEOMGEN_LANES=0"))
    counts, fault = c_code.drive(tmp_path, c_code.executable("gcc", tmp_path, objects, ()), program)
    assert counts["faults"] > 0
    assert "energy: depends on alignment or on what was in the work array" in fault
