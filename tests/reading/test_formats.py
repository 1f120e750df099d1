"""Equations written for other programs give the numbers of the compiled module."""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy
from shown_numbers import random_state, state_values

import eomgen as eg
from eomgen.reading.formats import write_format
from eomgen.targets import FORMATS

EXAMPLES = Path(__file__).parents[2] / "examples"
Numbers = dict[str, float]


@pytest.fixture(scope="module")
def pendulum() -> tuple[Any, Numbers, np.ndarray, np.ndarray]:
    """Equations, numbers of all names, and M and f of the compiled module there."""
    equations = eg.load(EXAMPLES / "double_pendulum.yaml").derive()
    module = equations.compile("numpy")
    x = np.array([0.3, -0.7, 1.1, 0.4])
    numbers = dict(zip((*module.x_names, *module.p_names), (*x, *module.p), strict=True))
    return equations, numbers, module.mass_matrix(x[:2]), -module.bias(0.0, x)


def evaluated(assignments: dict[str, str], numbers: Numbers) -> dict[str, float]:
    """Right sides in the syntax that SymPy reads, one after the other."""
    known: dict[str, Any] = dict(numbers)
    for name, right in assignments.items():
        known[name] = float(sympy.parse_expr(right, local_dict=known))
    return known


def test_sympy_text_is_the_compiled_equations(pendulum: Any) -> None:
    equations, numbers, M, f = pendulum
    space: dict[str, Any] = {}
    exec(write_format(equations, "sympy"), space)  # noqa: S102 - what a user does with the file
    assert np.array(space["M"].subs(numbers), dtype=float) == pytest.approx(M, rel=1e-12)
    assert np.array(space["f"].subs(numbers), dtype=float)[:, 0] == pytest.approx(f, rel=1e-12)


def test_c_text_is_the_compiled_equations(pendulum: Any, tmp_path: Path) -> None:
    equations, numbers, M, f = pendulum
    text = write_format(equations, "c")
    (tmp_path / "e.c").write_text(text)
    subprocess.run(
        ["gcc", "-Wall", "-Werror", "-shared", "-fPIC", "-o", "e.so", "e.c", "-lm"], cwd=tmp_path, check=True
    )
    arguments = re.findall(r"double (\w+),", text)
    call = ctypes.CDLL(str(tmp_path / "e.so")).double_pendulum_equations
    found, right = (ctypes.c_double * 4)(), (ctypes.c_double * 2)()
    call(*(ctypes.c_double(numbers[name]) for name in arguments), found, right)
    assert list(found) == pytest.approx(M.ravel(), rel=1e-12)
    assert list(right) == pytest.approx(f, rel=1e-12)


@pytest.mark.parametrize("form", ["matlab", "octave", "julia"])
def test_array_languages_give_the_compiled_equations(form: str, pendulum: Any) -> None:
    """Their arithmetic is read here: no such program need be installed."""
    equations, numbers, M, f = pendulum
    text = write_format(equations, form)
    assert text.count("function") == 1
    assert text.rstrip().endswith("end")
    rows = re.findall(r"^ +([Mf])[\[(]([\d, ]+)[\])] = (.*?);?$", text, re.M)
    right = {f"{a}_{place.replace(', ', '_')}": x.replace(".*", "*").replace(".^", "**") for a, place, x in rows}
    right = {name: x.replace("./", "/").replace("^", "**").replace("//", "/") for name, x in right.items()}
    known = evaluated(right, numbers)
    assert [known[f"M_{i}_{j}"] for i in (1, 2) for j in (1, 2)] == pytest.approx(M.ravel(), rel=1e-12)
    assert [known["f_1"], known["f_2"]] == pytest.approx(f, rel=1e-12)


@pytest.mark.needs("octave")
@pytest.mark.parametrize("name", ["four_bar", "flyball_governor"])
def test_octave_gives_the_compiled_equations(name: str, tmp_path: Path) -> None:
    """A function with named parts, and one with long numbers, run by Octave itself."""
    equations = eg.load(EXAMPLES / f"{name}.yaml").derive()
    module: Any = equations.compile("numpy")
    x = random_state(module, 4)
    values, free = state_values(module, x, 0.0), list(module.layout.metadata["independent"])
    text = write_format(equations, "octave")
    (tmp_path / f"{name}_equations.m").write_text(text)
    arguments = re.findall(r"\w+", re.findall(rf"{name}_equations\((.*)\)", text)[0])
    given = ", ".join(f"{values[argument]:.17g}" for argument in arguments)
    program = f'[M, f] = {name}_equations({given}); printf("%.17g\\n", M\', f);'
    words = [shutil.which("octave-cli") or "octave", "--no-gui", "--norc", "--quiet", "--eval", program]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=True)
    M = module.embedded_mass_matrix(x[: module.n_q])
    wanted = [*M.ravel(), *(M @ module.rhs(0.0, x)[module.n_q :][free])]
    assert [float(line) for line in done.stdout.split()] == pytest.approx(wanted, rel=1e-10, abs=1e-10 * abs(M).max())


@pytest.mark.parametrize("form", FORMATS)
def test_large_equations_are_written_whole(form: str) -> None:
    text = write_format(eg.load(EXAMPLES / "four_bar.yaml").derive(), form)
    assert "bend" in text
    assert len(text) > 500


def test_words_of_a_language_are_changed_with_a_note() -> None:
    m = eg.Model("wheel")
    end, M = m.parameter("end"), m.parameter("M")
    m.revolute("A", m.ground, m.body("rim", mass=1, inertia={"zz": end * M}), coordinate="theta")
    equations = m.derive()
    assert "% end_ is end of the model" in write_format(equations, "matlab")
    assert "// M_ is M of the model" in write_format(equations, "c")
    assert "end_" not in write_format(equations, "c")


def test_tables_are_named_where_a_format_cannot_hold_them() -> None:
    m = eg.Model("tabular")
    m.prismatic("rail", m.ground, m.body("block", mass=1.0), axis="x", coordinate="s")
    m.table("push", [0, 1, 2, 3], [1, 2, 4, 3])
    m.actuator("motor", "rail", "push(s)")
    eqs = m.derive()
    with pytest.raises(eg.EomgenError, match="format 'c' cannot hold the tables or functions of this model: push"):
        write_format(eqs, "c")
    assert "push" in write_format(eqs, "text")
    solution = eqs.explain("short")
    assert solution.difference is None
    assert "push" in solution.markdown


def test_conditions_in_mathematica() -> None:
    m = eg.Model("stop")
    m.prismatic("rail", m.ground, m.body("block", mass=1.0), axis="x", coordinate="s")
    m.actuator("wall", "rail", sympy.Piecewise((-100 * sympy.Symbol("s"), sympy.Symbol("s") > 0), (0, True)))
    assert "f = {Piecewise[{{-100*s, s > 0}, {0, True}}]};" in write_format(m.derive(), "mathematica")


def test_a_format_that_there_is_not_is_named() -> None:
    with pytest.raises(eg.UsageError, match="no format 'matlb'; did you mean matlab"):
        write_format(eg.load(EXAMPLES / "pendulum.yaml").derive(), "matlb")
