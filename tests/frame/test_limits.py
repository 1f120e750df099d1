"""Numbers below which something is nothing stand in eomgen/limits alone; files in C take theirs from there."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from eomgen.limits import in_c

ROOT = Path(__file__).parents[2]
BELOW = 5e-4  #: numbers in formulas, such as 1/720, are larger
#: What is no limit: a default of a user's option, switches between two formulas for one thing, a step in 60 digits.
OTHERS = {
    "numeric/closure.py": {1e-8},
    "program/loop_blocks.py": {1e-100},
    "robots/robot.py": {1e-11},
    "rotations/quaternions.py": {1e-4},
    "verification/digits.py": {1e-6},
}
PYTHON = [p for p in sorted((ROOT / "eomgen").rglob("*.py")) if p.relative_to(ROOT / "eomgen").parts[0] != "limits"]


def small_numbers(text: str) -> set[float]:
    values = [n.value for n in ast.walk(ast.parse(text)) if isinstance(n, ast.Constant) and type(n.value) is float]
    return {x for x in values if 0.0 < abs(x) < BELOW}


@pytest.mark.parametrize("path", PYTHON, ids=lambda p: str(p.relative_to(ROOT / "eomgen")))
def test_no_limit_stands_elsewhere(path: Path) -> None:
    name = str(path.relative_to(ROOT / "eomgen"))
    assert small_numbers(path.read_text(encoding="utf-8")) == OTHERS.get(name, set())


C = [p for folder in ("drivers", "ensembles", "steppers") for p in sorted((ROOT / f"templates/c/{folder}").glob("*.c"))]


@pytest.mark.parametrize("path", C, ids=lambda p: p.name)
def test_drivers_and_steppers_name_their_limits(path: Path) -> None:
    text = re.sub(r"/\*.*?\*/", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
    small = r"\d(?:\.\d+)?e-\d+" + (
        r"|\b0\.0\d+" if path.parent.name == "drivers" else ""
    )  # others have methods' tables
    assert re.findall(small, text) == []
    in_c.definitions(text)  # every name exists


def test_definitions_are_the_numbers_themselves() -> None:
    text = in_c.definitions("if (x < CONSTRAINTS_EXACT * y || n > RUNS_CROWD) { return ROUNDING_ROUNDED; }")
    lines = dict(line.split()[1:] for line in text.splitlines())
    assert lines == {"CONSTRAINTS_EXACT": "1e-15", "RUNS_CROWD": "12", "ROUNDING_ROUNDED": repr(64 * 2.0**-52)}
    with pytest.raises(AttributeError):
        in_c.definitions("CONSTRAINTS_NOBODY")
