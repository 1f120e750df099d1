"""Native functions: C sources of the user in the compiled module, their twins, and the packages."""

from __future__ import annotations

import math
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eomgen as eg
from eomgen import pipeline
from eomgen.compilation.native_faults import blame_source
from eomgen.emit import emit_c
from eomgen.errors import ModelError, ToolchainError, UsageError
from eomgen.generation import generate


def pendulum(law: str, native: Any = None) -> eg.Model:
    """A pendulum of length 1 and mass 1 that a law pulls back."""
    m = eg.Model("swinging")
    if native:
        native(m)
    m.table("soft", np.linspace(-4, 4, 33), np.tanh(np.linspace(-4, 4, 33)))
    m.revolute("q", m.ground, m.body("bob", mass=1, com=(0, -1, 0)))
    m.torque("law", "q", law)
    return m


def full(folder: Path, **keys: Any) -> Any:
    """Declares ``swing`` with as much as ``keys`` say."""
    return lambda m: m.native("swing", folder / "laws.c", **keys)


def test_a_native_sine_swings_as_the_built_in_one(sources: Path) -> None:
    runs = []
    for law, native in (("-9.81*sin(q)", None), ("-9.81*swing(q)", full(sources, derivatives=["swing_slope"]))):
        module = pendulum(law, native).compile()
        runs.append(module.simulate((0, 10), initial={"q": 2.5}, rtol=1e-10, atol=1e-12, t_eval=np.linspace(0, 10, 50)))
    built_in, own = (run["q"] for run in runs)
    assert np.ptp(built_in) > 4
    assert np.max(np.abs(own - built_in)) < 1e-9


SLOPES = {
    "exact": {"derivatives": ["swing_slope"], "second_derivatives": ["swing_curvature"]},
    "first": {"derivatives": ["swing_slope"]},
    "none": {},
    "null": {"derivatives": [None]},
}


@pytest.mark.parametrize("given", SLOPES)
def test_jacobian_and_targets(sources: Path, given: str) -> None:
    def declare(m: eg.Model) -> None:
        m.native("swing", sources / "laws.c", python=sources / "laws.py", **SLOPES[given])
        m.native("drag", sources / "laws.c", arguments=4, python=sources / "laws.py")

    m = pendulum("-9.81*swing(q) - drag(q_dot, 0.3, 0.2, q)*(1 + soft(q*q_dot)**2)", declare)
    m.output("curvature", m.coordinate("q") ** 0 * sympy_call("swing", m.coordinate("q"), 2))
    compiled, numpy = m.compile(), m.compile(target="numpy")
    x = np.array([0.8, -1.3])
    assert np.allclose(compiled.rhs(0, x), numpy.rhs(0, x), rtol=1e-15, atol=1e-15)
    assert np.allclose(compiled.jacobian(0, x), numpy.jacobian(0, x), rtol=1e-12)
    steps = 1e-6 * np.eye(2)
    central = np.array([(compiled.rhs(0, x + h) - compiled.rhs(0, x - h)) / 2e-6 for h in steps]).T
    assert np.max(np.abs(compiled.jacobian(0, x) - central)) < 1e-7
    states = np.random.default_rng(0).normal(size=(2, 40))[:, ::2]
    assert np.allclose(compiled.rhs(0, states), numpy.rhs(0, states), rtol=1e-14)
    digits = {"exact": 1e-15, "first": 1e-9, "none": 1e-7, "null": 1e-7}[given]
    assert abs(compiled.outputs(0, x)[0] + math.sin(0.8)) < digits
    assert abs(numpy.outputs(0, x)[0] - compiled.outputs(0, x)[0]) < 1e-7 * (given != "exact") + 1e-15


def sympy_call(name: str, argument: Any, order: int) -> Any:
    import sympy

    return sympy.Function(name)(argument).diff(argument, order)


def test_without_a_twin_only_compiled_code_runs(sources: Path) -> None:
    m = pendulum("-9.81*swing(q)", full(sources))
    assert m.check()
    assert m.derive().force[0].has(sympy_call("swing", m.coordinate("q"), 0).func)
    x = np.array([0.4, 0.0])
    assert m.compile().rhs(0, x)[1] == pytest.approx(-9.81 * math.sin(0.4), rel=1e-15)
    with pytest.raises(ModelError, match=r"functions\.swing: is a C function without a Python version"):
        m.compile(target="numpy")
    m.body("heavy", mass="2 + swing(0)")
    with pytest.raises(ModelError, match=r"functions\.swing: is a C function without a Python version"):
        m.mechanism()


def test_twins_of_two_models_are_kept_apart(sources: Path) -> None:
    a, b = (pendulum("-swing(q)", full(sources, python=twin)).compile(target="numpy") for twin in (math.sin, math.tan))
    x = np.array([0.4, 0.0])
    assert a.rhs(0, x)[1] == pytest.approx(-math.sin(0.4))
    assert b.rhs(0, x)[1] == pytest.approx(-math.tan(0.4))


def test_a_callable_with_derivatives(sources: Path) -> None:
    def wave(q: float) -> float:
        return math.sqrt(q)

    def slope(q: float) -> float:
        return 0.5 / math.sqrt(q)

    native = full(sources, python=wave, python_derivatives=[slope])
    module = pendulum("-swing(q)", native).compile(target="numpy")
    assert module.jacobian(0, [0.25, 0.0])[1, 0] == pytest.approx(-1.0, rel=1e-14)
    with pytest.raises(eg.NonFiniteError):
        module.rhs(0, [-0.25, 0.0])


def test_a_native_function_in_a_constraint_needs_its_twin(sources: Path) -> None:
    import sympy

    x, y, x_dot, y_dot = sympy.symbols("x y x_dot y_dot")
    swing = sympy.Function("swing")
    for twin in (None, sources / "laws.py"):
        m = eg.Model.from_lagrangian("bead", (x_dot**2 + y_dot**2) / 2 - 9.81 * y, [x, y], constraints=[y - swing(x)])
        m.native("swing", sources / "laws.c", derivatives=["swing_slope"], python=twin)
        m.initial(x=0.7)
        if twin is None:
            with pytest.raises(ModelError, match="without a Python version"):
                m.compile()
            continue
        run = m.compile().simulate((0, 2), rtol=1e-9, atol=1e-11)
        assert np.ptp(run["x"]) > 1
        assert np.max(np.abs(run["y"] - np.sin(run["x"]))) < 1e-10
        assert run["energy"] == pytest.approx(run["energy"][0], abs=1e-6)


def test_the_source_is_part_of_what_is_compiled(sources: Path) -> None:
    m = pendulum("-9.81*swing(q)", full(sources))
    x = np.array([0.4, 0.0])
    before = m.compile().rhs(0, x)[1]
    text = (sources / "laws.c").read_text()
    (sources / "laws.c").write_text(text.replace("return sin(q)", "return 2.0*sin(q)"))
    assert m.compile().rhs(0, x)[1] == pytest.approx(2 * before)


def test_errors_of_the_compiler_name_the_users_file(sources: Path) -> None:
    (sources / "laws.c").write_text("double swing(double q) {\n    return z + sin(q);\n}\n")
    with pytest.raises(ModelError, match=r"laws\.c:2: functions\.swing: the compiler says: .*undeclared.*; correct"):
        pendulum("-swing(q)", full(sources)).compile()


def test_other_words_of_a_compiler_are_no_fault_of_a_source(sources: Path) -> None:
    functions = pendulum("-swing(q)", full(sources)).derive().kinematics.graph.functions.values()
    for output in ("cc1: fatal error: no space left", "my_laws.c:3:1: error: x", "laws.c:3:1: warning: x"):
        assert blame_source(ToolchainError("failed", "cc", output), functions) is None
    found = blame_source(ToolchainError("failed", "cc", "/a/laws.c:3:1: error: b\n/a/laws.c:3:9: error: c"), functions)
    assert [(p.file, p.line, p.message) for p in found.problems] == [("laws.c", 3, "the compiler says: b")]


@pytest.mark.parametrize(
    ("text", "keys", "message"),
    [
        ("double swing(double q);\n", {"arguments": 2}, r"laws\.c:1 takes 1 arguments, not the 2 declared"),
        ("/* double swing(double) */\nstatic const double\nswing(double a,\n double b)\n{}", {},
         r"swing\.arguments: swing in laws\.c:3 takes 2 arguments, not the 1 declared; give arguments: 2"),
        ("double other(double q) { return swing(q); }\ndouble swing(void) { return 1; }", {}, "laws.c:2 takes 0 arg"),
        ("int swing(int q) { return q; }", {}, "laws.c:1 has 'int', which is not double; write double swing.double."),
        ("double swing(double *q) { return *q; }", {}, "has 'double .q', which is not double"),
    ],
)  # fmt: skip
def test_arguments_are_held_against_the_source(sources: Path, text: str, keys: dict[str, Any], message: str) -> None:
    (sources / "laws.c").write_text(text)
    with pytest.raises(ModelError, match=message):
        pendulum("-swing(q)", full(sources, **keys)).check()


@pytest.mark.parametrize(
    "text", ["#define LAW(n) double n(double q)\nLAW(swing) { return q; }\n", "real swing(const real q) { return q; }"]
)
def test_what_only_the_compiler_can_tell_is_left_to_it(sources: Path, text: str) -> None:
    (sources / "laws.c").write_text("typedef double real;\n" + text)
    assert pendulum("-swing(q)", full(sources)).compile().rhs(0, [0.5, 0.0])[1] == pytest.approx(-0.5)


def test_packages_carry_the_function(sources: Path, tmp_path: Path) -> None:
    native = full(sources, derivatives=["swing_slope"], python=sources / "laws.py")
    m = pendulum("-9.81*swing(q) - soft(q_dot)", native)
    x = np.array([0.4, 0.3])
    expected = m.compile().rhs(0, x)
    c = generate(m, tmp_path / "c", target="c")
    (c / "main.c").write_text(re.search(r"```c\n(.*?)```", (c / "README.md").read_text(), re.S).group(1))  # type: ignore[union-attr]
    flags = "CFLAGS=-O1 -std=c99 -fPIC -Wall -Wextra -Werror -Wconversion"
    subprocess.run(["make", "-s", "all", flags], cwd=c, check=True)
    assert {"swinging_tables.c", "swinging_native_swing.c"} <= {p.name for p in c.iterdir()}
    numpy = generate(m, tmp_path / "numpy", target="numpy")
    assert (numpy / "native_swing.py").read_text() == (sources / "laws.py").read_text()
    cython = generate(m, tmp_path / "cython", target="cython")
    build = [sys.executable, "setup.py", "-q", "build_ext", "--inplace", "--build-lib", str(tmp_path / "lib")]
    environment = {**os.environ, "CFLAGS": "-O0"}
    done = subprocess.run(build, cwd=cython, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    for extension in cython.rglob("_core*.so"):
        if extension.parent != cython:
            extension.rename(cython / extension.name)
    script = "import swinging; print(*swinging.rhs(0.0, [0.4, 0.3]), sep=',')"
    for folder in (numpy, cython):
        done = subprocess.run(
            [sys.executable, "-c", script], cwd=folder.parent, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr[-2000:]
        assert np.allclose([float(v) for v in done.stdout.split(",")], expected, rtol=1e-15)


def test_a_package_cannot_carry_a_callable(sources: Path, tmp_path: Path) -> None:
    m = pendulum("-swing(q)", full(sources, python=math.sin))
    with pytest.raises(UsageError, match="needs this function in Python too, in a file"):
        generate(m, tmp_path / "numpy", target="numpy")
    with pytest.raises(UsageError, match="cannot be written to a model file"):
        m.to_yaml()


def test_functions_of_one_source_are_linked_together(sources: Path) -> None:
    (sources / "laws.c").write_text("".join(f"double f{k}(double x) {{ return {k}.0*x; }}\n" for k in range(3)))
    m = eg.Model("three")
    for k in range(3):
        m.native(f"f{k}", sources / "laws.c")
    m.revolute("q", m.ground, m.body("bob", mass=1, com=(0, -1, 0)))
    m.torque("law", "q", "f0(q) + f1(q) + f2(q)")
    assert m.compile().rhs(0, [1.0, 0.0])[1] == pytest.approx(3.0)


def test_the_text_does_not_depend_on_the_order_of_use(sources: Path) -> None:
    texts = []
    for law in ("-swing(q) - soft(q)", "-soft(q) - swing(q)"):
        m = pendulum(law, full(sources))
        emitted = emit_c(pipeline.build(m.derive()))
        texts.append({n: t for n, t in emitted.items() if "tables" in n or "native" in n})
    assert texts[0] == texts[1]
    assert len(texts[0]) == 2


WRONG = [
    ({"function": "missing"}, "functions.swing.source: laws.c has no function 'missing'"),
    ({"derivatives": ["swing_slope", "x"], "arguments": 1}, "functions.swing.derivatives: has 2 entries"),
    ({"second_derivatives": ["a", "b"]}, "functions.swing.second_derivatives: has 2 entries"),
    ({"arguments": 0}, "functions.swing.arguments: 0 arguments; allowed: 1 to 16"),
    ({"arguments": 99}, "allowed: 1 to 16"),
    ({"function": "a;b"}, "functions.swing.function: 'a;b' is not an identifier"),
    ({"function": "sin"}, "'sin' is a built-in function"),
    ({"derivatives": ["swing"]}, "functions.swing: names one C function twice"),
    ({"python": "no.py"}, "functions.swing.python: no.py cannot be read (No such file or directory)"),
    ({"python": 3}, "functions.swing.python: is not a function"),
]


@pytest.mark.parametrize(("keys", "message"), WRONG)
def test_what_does_not_fit_is_told(sources: Path, keys: dict[str, Any], message: str) -> None:
    with pytest.raises(ModelError) as caught:
        pendulum("-swing(q)", full(sources, **keys)).mechanism()
    assert message in str(caught.value)
    assert len(caught.value.problems) == 1


def test_twin_files_that_do_not_fit_are_told(sources: Path) -> None:
    (sources / "other.py").write_text("swung = 1\n")
    (sources / "broken.py").write_text("1/0\n")
    for file, message in (("other.py", "other.py has no function swing"), ("broken.py", "ZeroDivisionError")):
        with pytest.raises(ModelError, match=message):
            pendulum("-swing(q)", full(sources, python=sources / file)).mechanism()
    with pytest.raises(UsageError, match="python_derivatives need a callable"):
        eg.Model("m").native("f", "f.c", python="f.py", python_derivatives=[math.cos])
    with pytest.raises(UsageError, match="native has no argument 'sorce'"):
        eg.Model("m").native("f", sorce="f.c")  # type: ignore[call-arg]


def test_long_models_in_several_files_call_functions_too(sources: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from dataclasses import replace

    from eomgen.api.module import Module
    from eomgen.compilation import Options, compile_sources, load_core
    from eomgen.emit import c_parts

    m = pendulum("-9.81*swing(q) - soft(q_dot)", full(sources))
    x = np.array([0.4, 0.3])
    expected = m.compile().rhs(0, x)
    program = pipeline.build(m.derive())
    monkeypatch.setattr(c_parts, "LENGTH", 100)
    emitted = emit_c(replace(program, limits=replace(program.limits, statements=2)))
    assert "swinging_part1.c" in emitted
    module = Module(load_core(compile_sources(emitted, "swinging", Options(optimize=0))))
    assert module.rhs(0, x).tolist() == expected.tolist()
