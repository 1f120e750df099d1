"""Native functions: C sources of the user in the compiled module, their Python fallbacks, and the packages."""

import builtins
import math
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import command
import judges
import numpy as np
import pytest
import sympy
from model_files import load
from packages import built
from refusals import refused, refuses

import eomgen as eg

C_SOURCE = """\
#include <math.h>

static double twice(double x) { return 2.0*x; }

double swing(double q) { return sin(q); }
double swing_slope(double q) { return cos(q); }
double swing_curvature(double q) { return -sin(q); }

double drag(double v, double k, double a, double q) { return 0.5*twice(k)*v*sqrt(v*v + 0.01) + a*q*q*v; }
"""

PYTHON_SOURCE = """\
import math

swing = math.sin
swing_slope = math.cos


def swing_curvature(q):
    return -math.sin(q)


def drag(v, k, a, q):
    return k * v * math.sqrt(v * v + 0.01) + a * q * q * v
"""


@pytest.fixture
def sources(tmp_path: Path) -> Path:
    """A folder with ``laws.c`` and ``laws.py``."""
    (tmp_path / "laws.c").write_text(C_SOURCE, encoding="utf-8")
    (tmp_path / "laws.py").write_text(PYTHON_SOURCE, encoding="utf-8")
    return tmp_path


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


SLOPES = {
    "exact": {"derivatives": ["swing_slope"], "second_derivatives": ["swing_curvature"]},
    "first": {"derivatives": ["swing_slope"]},
    "none": {},
}


@pytest.mark.parametrize("given", ["exact", *(pytest.param(g, marks=pytest.mark.thorough) for g in ("first", "none"))])
def test_jacobian_and_targets(sources: Path, given: str) -> None:
    def declare(m: eg.Model) -> None:
        m.native("swing", sources / "laws.c", python=sources / "laws.py", **SLOPES[given])
        m.native("drag", sources / "laws.c", arguments=4, python=sources / "laws.py")

    m = pendulum("-9.81*swing(q) - drag(q_dot, 0.3, 0.2, q)*(1 + soft(q*q_dot)**2)", declare)
    m.output("curvature", m.coordinate("q") ** 0 * sympy_call("swing", m.coordinate("q"), 2))
    compiled, numpy = m.compile(optimize=0), m.compile(target="numpy")
    x = np.array([0.8, -1.3])
    assert np.allclose(compiled.rhs(0, x), numpy.rhs(0, x), rtol=1e-15, atol=1e-15)
    assert np.allclose(compiled.jacobian(0, x), numpy.jacobian(0, x), rtol=1e-12)
    assert np.max(np.abs(compiled.jacobian(0, x) - judges.differences(compiled, x, 1e-6))) < 1e-7
    states = np.random.default_rng(0).normal(size=(2, 40))[:, ::2]
    assert np.allclose(compiled.rhs(0, states), numpy.rhs(0, states), rtol=1e-14)
    digits = {"exact": 1e-15, "first": 1e-9, "none": 1e-7}[given]
    assert abs(compiled.outputs(0, x)[0] + math.sin(0.8)) < digits
    assert abs(numpy.outputs(0, x)[0] - compiled.outputs(0, x)[0]) < 1e-7 * (given != "exact") + 1e-15


def test_an_error_of_a_python_function_between_steps_reaches_its_caller(sources: Path) -> None:
    class Stopped(BaseException):
        pass

    armed: list[int] = []
    law = sources / "laws.py"
    law.write_text("import builtins\n\n\ndef swing(q):\n    return builtins.swing_in_test(q)\n")

    def swing(q: float) -> float:
        if armed:
            raise Stopped
        return math.sin(q)

    builtins.swing_in_test = swing  # type: ignore[attr-defined]
    try:
        m = pendulum("-9.81*swing(q)", full(sources, python=law))
        module = m.compile(target="numpy")
        solver = module.DOP853(module.rhs, 0.0, [0.4, 0.0], 1.0)
        solver.step()
        armed.append(1)
        with pytest.raises(Stopped):
            solver.dense_output()  # evaluates three stages more
        armed.clear()
        assert module.rhs(0.0, [0.4, 0.0])[1] == pytest.approx(-9.81 * math.sin(0.4))
    finally:
        del builtins.swing_in_test  # type: ignore[attr-defined]


def sympy_call(name: str, argument: Any, order: int) -> Any:
    return sympy.Function(name)(argument).diff(argument, order)


def test_without_a_python_function_only_compiled_code_runs(sources: Path) -> None:
    m = pendulum("-9.81*swing(q)", full(sources))
    assert m.check()
    assert m.derive().force[0].has(sympy_call("swing", m.coordinate("q"), 0).func)
    x = np.array([0.4, 0.0])
    compiled = m.compile(optimize=0)
    assert compiled.rhs(0, x)[1] == pytest.approx(-9.81 * math.sin(0.4), rel=1e-15)
    assert compiled.jacobian(0, x)[1] == pytest.approx([-9.81 * math.cos(0.4), 0.0], abs=1e-7)  # by differences
    refuses("EG-MISSING functions.swing C", m.compile, target="numpy")
    m.body("heavy", mass="2 + swing(0)")
    refuses("EG-MISSING functions.swing C", m.check)


def test_the_source_is_part_of_what_is_compiled(sources: Path) -> None:
    m = pendulum("-9.81*swing(q)", full(sources))
    x = np.array([0.4, 0.0])
    before = m.compile(optimize=0).rhs(0, x)[1]
    text = (sources / "laws.c").read_text()
    (sources / "laws.c").write_text(text.replace("return sin(q)", "return 2.0*sin(q)"))
    assert m.compile(optimize=0).rhs(0, x)[1] == pytest.approx(2 * before)


def test_errors_of_the_compiler_name_the_users_file(sources: Path) -> None:
    (sources / "laws.c").write_text("double swing(double q) {\n    return z + sin(q);\n}\n")
    refuses("EG-COMPILER-FAILED functions.swing laws.c 2", lambda: pendulum("-swing(q)", full(sources)).compile())


@pytest.mark.parametrize(
    ("text", "keys", "message"),
    [
        ("double swing(double q);\n", {"arguments": 2}, "EG-SHAPE functions.swing.arguments laws.c 1 2"),
        ("/* double swing(double) */\nstatic const double\nswing(double a,\n double b)\n{}", {},
         "EG-SHAPE functions.swing.arguments laws.c 3 2 1"),
        ("double other(double q) { return swing(q); }\ndouble swing(void) { return 1; }", {},
         "EG-SHAPE functions.swing.arguments laws.c 2 0"),
        ("int swing(int q) { return q; }", {}, "EG-TYPE functions.swing.source int laws.c 1"),
        ("double swing(double *q) { return *q; }", {}, "EG-TYPE functions.swing.source"),
    ],
)  # fmt: skip
def test_arguments_are_held_against_the_source(sources: Path, text: str, keys: dict[str, Any], message: str) -> None:
    (sources / "laws.c").write_text(text)
    refuses(message, lambda: pendulum("-swing(q)", full(sources, **keys)).check())


@pytest.mark.thorough
@pytest.mark.parametrize(
    "text", ["#define LAW(n) double n(double q)\nLAW(swing) { return q; }\n", "real swing(const real q) { return q; }"]
)
def test_what_only_the_compiler_can_tell_is_left_to_it(sources: Path, text: str) -> None:
    (sources / "laws.c").write_text("typedef double real;\n" + text)
    assert pendulum("-swing(q)", full(sources)).compile(optimize=0).rhs(0, [0.5, 0.0])[1] == pytest.approx(-0.5)


def packaged(m: eg.Model, folder: Path, target: str) -> Path:
    """The package of a model with native functions, from its file, which lies beside the sources."""
    m.save(folder / "swinging.yaml")
    words = ("generate", folder / "swinging.yaml", "--allow-native", "--out", folder / target, "--target", target)
    done = command.run(*words)
    assert done.code == 0, done.err
    return folder / target / "swinging"


@pytest.mark.thorough
def test_packages_carry_the_function(sources: Path) -> None:
    native = full(sources, derivatives=["swing_slope"], python=sources / "laws.py")
    m = pendulum("-9.81*swing(q) - soft(q_dot)", native)
    expected = m.compile(optimize=0).rhs(0, np.array([0.4, 0.3]))
    c = packaged(m, sources, "c")
    (c / "main.c").write_text(re.search(r"```c\n(.*?)```", (c / "README.md").read_text(), re.S).group(1))  # type: ignore[union-attr]
    flags = "CFLAGS=-O1 -std=c99 -fPIC -Wall -Wextra -Werror -Wconversion"
    subprocess.run(["make", "-s", "all", flags], cwd=c, check=True)
    assert {"swinging_tables.c", "swinging_native_swing.c"} <= {p.name for p in c.iterdir()}
    package = built(packaged(m, sources, "cython"))
    script = "import swinging; print(*swinging.rhs(0.0, [0.4, 0.3]), sep=',')"
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=package.parent, capture_output=True, text=True, check=True
    )
    assert np.allclose([float(v) for v in done.stdout.split(",")], expected, rtol=1e-15)


def test_a_file_cannot_carry_a_callable(sources: Path) -> None:
    m = pendulum("-swing(q)", full(sources, python=math.sin))
    refuses("EG-UNSUPPORTED written", m.to_yaml)


WRONG = [
    ({"function": "missing"}, "EG-NAME-UNKNOWN functions.swing.source missing laws.c"),
    ({"derivatives": ["swing_slope", "x"], "arguments": 1}, "EG-SHAPE functions.swing.derivatives 2"),
    ({"second_derivatives": ["a", "b"]}, "EG-SHAPE functions.swing.second_derivatives 2"),
    ({"arguments": 0}, "EG-SHAPE functions.swing.arguments 0 1 16"),
    ({"arguments": 99}, "EG-SHAPE functions.swing.arguments 1 16"),
    ({"function": "a;b"}, "EG-NAME-FORM functions.swing.function a;b"),
    ({"function": "sin"}, "EG-NAME-FORM functions.swing.function sin"),
    ({"derivatives": ["swing"]}, "EG-CONFLICT functions.swing"),
    ({"python": "no.py"}, "EG-FILE functions.swing.python no.py"),
    ({"python": 3}, "EG-TYPE functions.swing.python"),
]


@pytest.mark.parametrize(("keys", "message"), WRONG)
def test_what_does_not_fit_is_reported(sources: Path, keys: dict[str, Any], message: str) -> None:
    with refused(message) as caught:
        pendulum("-swing(q)", full(sources, **keys)).check()
    assert len(caught.value.problems) == 1


def test_python_files_that_do_not_fit_are_reported(sources: Path) -> None:
    (sources / "other.py").write_text("swung = 1\n")
    (sources / "broken.py").write_text("1/0\n")
    for file, message in (
        ("other.py", "EG-NAME-UNKNOWN functions.swing.python other.py"),
        ("broken.py", "EG-FILE functions.swing.python"),
    ):
        with refused(message):
            pendulum("-swing(q)", full(sources, python=sources / file)).check()
    with refused("EG-MISSING functions.swing.python_derivatives"):
        pendulum("-swing(q)", full(sources, python=sources / "other.py", python_derivatives=[math.cos])).check()
    with refused("EG-NAME-UNKNOWN sorce"):
        eg.Model("m").native("f", sorce="f.c")  # type: ignore[call-arg]


# -- in files ---------------------------------------------------------------------------------------------------------
FILE = """\
name: sample
functions:
  swing: {type: native, source: laws.c, derivatives: [swing_slope], python: laws.py}
bodies: {b: {mass: 1.5}}
joints: {s: {type: prismatic, between: [ground, b], axis: x}}
forces: {push: {type: actuator, joint: s, value: "-swing(s)"}}
outputs: {slope: "diff(swing(s), 1)"}
"""


def test_native_code_of_a_file_needs_permission(sources: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = sources / "model.yaml"
    file.write_text(FILE)
    (sources / "laws.py").write_text("raise SystemExit('read before permission')\n")
    opened: list[str] = []

    def watched(true_open: Any) -> Any:
        def open_noted(name: Any, *rest: Any, **keys: Any) -> Any:
            opened.append(str(name))
            return true_open(name, *rest, **keys)

        return open_noted

    for module in (builtins, os):
        monkeypatch.setattr(module, "open", watched(module.open))
    with pytest.raises(eg.ModelError) as caught:
        eg.load(file).check()
    (problem,) = caught.value.problems
    assert (problem.path, problem.line) == ("functions.swing", 3)
    assert "native code of model files is not allowed" in problem.message
    assert "--allow-native" in problem.remedy
    assert "allow_native=True" in problem.remedy
    assert any(name.endswith("model.yaml") for name in opened)
    assert not any("laws" in name for name in opened)


def test_permission_runs_it(sources: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(sources.parent)  # names of files start at the model file
    module = load(sources, FILE, allow_native=True).compile(target="numpy")
    assert module.rhs(0, [0.4, 0])[1] == pytest.approx(-np.sin(0.4) / 1.5, rel=1e-14)
    assert module.outputs(0, [0.4, 0])[0] == pytest.approx(np.cos(0.4), rel=1e-14)


def test_the_command_line_asks_for_permission(sources: Path) -> None:
    file = sources / "model.yaml"
    file.write_text(FILE)
    for verb, *options in (("check",), ("derive", "--equations"), ("run", "--end", "0.2", "--target", "numpy")):
        refused = command.run(verb, file, *options)
        assert (refused.code, f"{file}:3: functions.swing: is native code" in refused.err) == (1, True)
        assert command.run(verb, file, *options, "--allow-native").code == 0
