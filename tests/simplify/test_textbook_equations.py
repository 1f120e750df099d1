"""Mass matrix and force beside those that textbooks print: equal, and no longer."""

from __future__ import annotations

import statistics
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import sympy
from ruamel.yaml import YAML

import eomgen as eg

FORMS: dict[str, Any] = YAML(typ="safe").load(
    (Path(__file__).parents[1] / "reference" / "textbook_equations.yaml").read_text(encoding="utf-8")
)
OF_BODIES = ("embedding", "lagrange", "gibbs_appell", "newton_euler")
OF_LAGRANGIANS = ("lagrange",)
NAMES = {name: sympy.Symbol(name) for name in ("I1", "I2", "I3", "I", "E", "S", "N", "Q", "O", "beta", "gamma", "zeta")}
PAIRS = [(name, m) for name, form in FORMS.items() for m in (OF_BODIES if "model" in form else OF_LAGRANGIANS)]
LONGEST, USUAL = 1.15, 1.0


def read(text: object) -> Any:
    return sympy.sympify(str(text), locals=NAMES)


def equations(name: str, method: str, folder: Path) -> Any:
    form = FORMS[name]
    if "model" in form:
        file = folder / f"{name}.yaml"
        with file.open("w", encoding="utf-8") as out:
            YAML().dump({"name": name, **form["model"]}, out)
        return eg.load(file).derive(method)
    given = form["lagrangian"]
    coordinates = [sympy.Symbol(q) for q in given["coordinates"]]
    parameters = {sympy.Symbol(k): v for k, v in given["parameters"].items()}
    return eg.Model.from_lagrangian(name, read(given["L"]), coordinates, parameters=parameters).derive(method)


@cache  # most methods end in the same expressions
def is_zero(difference: Any) -> bool:
    return bool(sympy.simplify(sympy.expand(sympy.expand_trig(difference))) == 0)


def ours_and_theirs(name: str, method: str, folder: Path) -> tuple[list[Any], list[Any]]:
    eqs, form = equations(name, method, folder), FORMS[name]
    book = [read(x) for row in form["mass_matrix"] for x in row] + [read(x) for x in form["force"]]
    assert eqs.intermediates == []
    return [*eqs.mass_matrix, *eqs.force], book


def lengths(expressions: list[Any]) -> tuple[int, int]:
    """Operations and characters."""
    return sum(int(sympy.count_ops(x)) for x in expressions), sum(len(str(x)) for x in expressions)


@pytest.mark.parametrize(("name", "method"), PAIRS)
def test_equal_and_no_longer(name: str, method: str, tmp_path: Path) -> None:
    ours, book = ours_and_theirs(name, method, tmp_path)
    driven = {sympy.Symbol("phi_dot"): sympy.Symbol("Omega")} if "hoop" in name else {}
    for mine, printed in zip(ours, book, strict=True):
        assert is_zero(mine.subs(driven) - printed)
    for mine, printed in zip(lengths(ours), lengths(book), strict=True):
        assert mine <= LONGEST * printed


def test_usually_shorter(tmp_path: Path) -> None:
    both = [tuple(map(lengths, ours_and_theirs(name, OF_LAGRANGIANS[0], tmp_path))) for name in FORMS]
    for k in range(2):
        assert statistics.median(ours[k] / book[k] for ours, book in both) <= USUAL


def test_the_method_hardly_matters(tmp_path: Path) -> None:
    for name in ("heavy_top", "two_link_arm", "gyroscope"):
        found = [lengths(ours_and_theirs(name, method, tmp_path)[0]) for method in OF_BODIES]
        for counts in zip(*found, strict=True):
            assert max(counts) <= 1.1 * min(counts)
