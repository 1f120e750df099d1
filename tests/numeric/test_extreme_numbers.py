"""Numbers at the ends of the range: a result, or an error of eomgen's; no traceback and no warning of NumPy's."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
import sympy as sp

import eomgen as eg
from eomgen.errors import EomgenError, NonFiniteError, UnsolvedError
from eomgen.numeric import algebra
from eomgen.numeric.rigid_inertia import fault_of_inertia, longest_within

pytestmark = pytest.mark.filterwarnings("error")

HUGE = (1e308, 1e200, 5e-324, 1e-200)
ENDS = (*HUGE, -1e308, np.inf, np.nan)
SOURCES = Path(eg.__file__).parent
RAISING = {"svd", "eigh", "eigvalsh", "eig", "eigvals", "solve", "inv", "pinv", "lstsq", "cholesky", "cond"}


def named(call: Callable[[], Any]) -> str:
    """What a call comes to: the name of its error, or ``result``; all other exceptions pass."""
    try:
        call()
    except EomgenError as error:
        return type(error).__name__
    return "result"


@pytest.mark.parametrize("value", HUGE)
@pytest.mark.parametrize(("name", "parameters"), [("bicycle", ["w", "x_H"]), ("slider_crank", ["r", "l", "m_r"])])
def test_a_parameter_of_any_size_is_taken_or_refused(name: str, parameters: list[str], value: float) -> None:
    for parameter in parameters:
        model = models.build(name)
        for entry in model._description.sections["parameters"]:
            if entry.name == parameter:
                entry.values["value"] = value
        outcome = named(model.check)
        assert outcome in {
            "result",
            "ModelError",
            "AssemblyError",
            "NonFiniteError",
            "UnsolvedError",
            "EvaluationError",
        }


x, y, x_dot, y_dot = sp.symbols("x y x_dot y_dot")


@pytest.mark.parametrize("value", [*HUGE, 1e-310, 1.7e308])
@pytest.mark.parametrize("form", ["{}", "x - {}", "{}*x", "{}*x - 1", "{}*(x*y - 1)", "x**2 + y**2 - {}**2"])
def test_a_constraint_of_any_size_is_taken_or_refused(form: str, value: float) -> None:
    row = sp.sympify(form.format("c"), locals={"x": x, "y": y}).subs("c", sp.Float(value))
    kinetic = (x_dot**2 + y_dot**2) / 2
    model = eg.Model.from_lagrangian("particle", kinetic - 9.81 * y, [x, y], constraints=[row])
    assert named(lambda: model.compile(target="numpy").simulate(0.1))


def calls(mod: Any, x: np.ndarray) -> Iterator[tuple[str, Callable[[], Any]]]:
    n = mod.n_q
    yield "rhs", lambda: mod.rhs(0.0, x)
    yield "jacobian", lambda: mod.jacobian(0.0, x)
    yield "mass_matrix", lambda: mod.mass_matrix(x[:n])
    yield "bias", lambda: mod.bias(0.0, x)
    yield "energy", lambda: mod.energy(x)
    yield "project", lambda: mod.project(x)
    yield "constraints", lambda: mod.constraints(x[:n])
    yield "poses", lambda: mod.poses(x[:n])
    yield "reactions", lambda: mod.reactions(0.0, x)
    yield "batch", lambda: mod.rhs(0.0, np.stack([x, x], axis=1))


@pytest.fixture(scope="module")
def cranks() -> dict[str, Any]:
    """The slider-crank for both targets."""
    return {target: models.build("slider_crank").compile(target=target) for target in ("numpy", "cython")}


@pytest.mark.parametrize("value", ENDS)
@pytest.mark.parametrize("place", [0, 1, 3])
def test_a_state_of_any_size_means_the_same_in_each_target(cranks: dict[str, Any], place: int, value: float) -> None:
    x = cranks["numpy"].x0()
    x[place] = value
    outcomes = {target: {name: named(call) for name, call in calls(mod, x)} for target, mod in cranks.items()}
    assert outcomes["numpy"] == outcomes["cython"]


@pytest.mark.parametrize("value", [1e308, 1e200])
def test_a_guess_beyond_all_sizes_is_refused(cranks: dict[str, Any], value: float) -> None:
    for mod in cranks.values():
        with pytest.raises(eg.AssemblyError, match="do not close"):
            mod.simulate(1e-3, initial={"s": value})
        with pytest.raises(eg.AssemblyError, match="do not close"):
            mod.assemble(s=value)


def test_constants_that_overflow_are_a_named_error_in_late_kernels_too() -> None:
    mod = models.build("slider_crank").compile(target="numpy").bind(p={"m_c": 1e308})
    assert named(lambda: mod.reactions(0.0, mod.x0())) in {"UsageError", "NonFiniteError", "result"}


def test_an_inertia_that_overflows_is_a_fault() -> None:
    what = fault_of_inertia(np.full((3, 3), np.inf))
    assert what is not None
    assert what[0] == "has an entry that is not finite"
    assert fault_of_inertia(np.diag([1e308, 1e308, 1e308])) is None
    assert longest_within([[[0, 0, 0], [1e308, 0, 0]]]) == 1e308


@pytest.mark.parametrize("call", sorted(set(algebra.__dict__) & {*RAISING, "singular_values"}))
def test_linear_algebra_without_numbers_is_an_error_of_eomgen(call: str) -> None:
    bad = np.full((2, 2), np.nan)
    given = (bad, np.ones(2)) if call in ("solve", "lstsq") else (bad,)
    outcome = named(lambda: getattr(algebra, call)(*given))
    assert outcome in {"NonFiniteError", "result"}


def test_singular_equations_are_unsolved() -> None:
    with pytest.raises(UnsolvedError, match="singular"):
        algebra.solve(np.zeros((2, 2)), np.ones(2))
    with pytest.raises(UnsolvedError, match="no inverse"):
        algebra.inv(np.zeros((2, 2)))
    with pytest.raises(NonFiniteError, match="not finite"):
        algebra.svd(np.full((2, 2), np.inf))


def test_what_may_raise_linalgerror_goes_through_one_home() -> None:
    """Or stands in a ``try`` that takes it."""
    found = []
    for path in sorted(SOURCES.rglob("*.py")):
        if path == SOURCES / "numeric" / "algebra.py":
            continue
        if "np.linalg." not in (text := path.read_text(encoding="utf-8")):
            continue
        tree = ast.parse(text)
        guarded = {
            call
            for node in ast.walk(tree)
            if isinstance(node, ast.Try)
            and any(h.type is not None and "LinAlgError" in ast.unparse(h.type) for h in node.handlers)
            for statement in node.body
            for call in ast.walk(statement)
        }
        found += [
            f"{path.relative_to(SOURCES)}:{node.lineno}: {ast.unparse(node.func)}"
            for node in ast.walk(tree)
            if isinstance(node, ast.Call)
            and node not in guarded
            and ast.unparse(node.func).removeprefix("np.linalg.") in RAISING
            and ast.unparse(node.func).startswith("np.linalg.")
        ]
    assert not found
