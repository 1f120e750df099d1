"""The systems that SymPy's and PyDy's own tests form: eomgen's accelerations satisfy SymPy's equations.

Run as a script with a folder, this file runs the tests there with the methods that form equations watched.  Each object
becomes a model; at a consistent state its accelerations are put into SymPy's own mass matrix and forcing.  One line of
JSON an object.
"""

import importlib.util
import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import KanesMethod, LagrangesMethod, dynamicsymbols, find_dynamicsymbols, msubs

import eomgen as eg

#: Package -> folder of its tests -> objects there were at least when this was written.
SUITES = {"sympy.physics.mechanics": ("tests", 60), "pydy": (".", 10)}
t = dynamicsymbols._t
TRIES = 12


@pytest.mark.thorough
@pytest.mark.parametrize("package", ["sympy.physics.mechanics", pytest.param("pydy", marks=pytest.mark.needs("PyDy"))])
def test_what_their_tests_form_has_their_accelerations(package: str) -> None:
    spec = importlib.util.find_spec(package)
    assert spec is not None
    assert spec.origin is not None
    where, least = SUITES[package]
    done = subprocess.run(
        [sys.executable, __file__, str(Path(spec.origin).parent / where)],
        capture_output=True, text=True, timeout=3000,
    )  # fmt: skip
    found: list[dict[str, Any]] = [json.loads(line) for line in done.stdout.splitlines() if line.startswith('{"test"')]
    assert len(found) >= least, done.stderr[-2000:]
    # a motion without inertia is refused, and there SymPy's own matrix is singular
    wrong = [x for x in found if x.get("residual", 1.0) > 1e-12 and x.get("singular", 1.0) > 1e-12]
    assert not wrong


def collected() -> list[tuple[str, Any]]:
    """The method objects that form their equations, with the name of the test that runs."""
    objects: dict[int, tuple[str, Any]] = {}
    running = [""]

    class Names:
        def pytest_runtest_setup(self, item: Any) -> None:
            running[0] = item.nodeid.rpartition("/")[2]

    def watch(cls: Any, name: str) -> Any:
        form = getattr(cls, name)

        def formed(self: Any, *args: Any, **options: Any) -> Any:
            result = form(self, *args, **options)
            objects[id(self)] = (running[0], self)
            return result

        setattr(cls, name, formed)
        return form

    watched = (KanesMethod, "kanes_equations"), (LagrangesMethod, "form_lagranges_equations")
    before = [watch(*place) for place in watched]
    try:
        options = ["-q", "-c", os.devnull, "-W", "ignore", "-p", "no:cacheprovider", "-m", "not slow and not tooslow"]
        pytest.main([*options, *sys.argv[1:]], plugins=[Names()])
    finally:
        for (cls, name), form in zip(watched, before, strict=True):
            setattr(cls, name, form)
    return list(objects.values())


def equations(method: Any) -> tuple[list[Any], Any, Any]:
    """Speeds, and the matrix and right side of their rates in SymPy; of LagrangesMethod with its multipliers behind."""
    if isinstance(method, KanesMethod):
        return list(method.u), method.mass_matrix, method.forcing
    n = len(method.q)
    return list(method.q.diff(t)), method.mass_matrix_full[n:, n:], method.forcing_full[n:, :]


def compare(method: Any) -> dict[str, Any]:
    """Largest residual of SymPy's equations at eomgen's accelerations, as a share of their largest terms.

    Where eomgen refuses a motion without inertia: the least singular value of SymPy's own matrix instead.
    """
    parameters = eg.from_sympy(method).parameters
    for seed in range(TRIES):  # not every number is the inertia of a body, nor every place regular
        random = np.random.default_rng(seed)
        values = {name: float(10.0 ** random.uniform(-1.0, 0.5)) for name in parameters}
        values |= {name: 0.02 for name in parameters if re.search(r"xy|xz|yz|zx$", name)}  # products of inertia
        try:
            model = eg.from_sympy(method, parameters=values)
            model.guess(**dict(zip((name(x) for x in method.q), random.uniform(0.2, 0.9, len(method.q)), strict=True)))
            mod = model.compile(target="numpy")
            u = random.uniform(0.5, 1.5, len(mod.u_names))
            x = mod.project(random.uniform(0.2, 0.9, mod.n_x), u=u)
            x_dot = mod.rhs(0.0, x, u=u)
            break
        except eg.EomgenError as error:
            failed = error
    else:
        if "inertia" in str(failed):
            M = equations(method)[1]
            numbers = {key: float(random.uniform(0.2, 0.9)) for key in names(M)}
            return {"singular": float(np.linalg.svd(evaluated(M, numbers))[1].min())}
        raise failed
    numbers = values | dict(zip(mod.u_names, u, strict=True)) | dict(zip(mod.x_names, x, strict=True)) | {"t": 0.0}
    numbers |= {f"{name}_dot": rate for name, rate in zip(mod.q_names, x_dot, strict=False)}
    numbers |= dict(zip(mod.y_names, mod.outputs(0.0, x, u=u), strict=True))
    if isinstance(method, KanesMethod):
        numbers |= dict.fromkeys((f"{name(w)}{rate}" for w in method._uaux for rate in ("", "_dot")), 0.0)
    v, matrix, right = equations(method)
    M, f = evaluated(matrix, numbers), evaluated(right, numbers)[:, 0]
    rates = dict(zip(mod.v_names, x_dot[mod.n_q :], strict=True))
    y = np.array([rates[name(speed)] for speed in v])
    rest = f - M[:, : len(y)] @ y
    if M.shape[1] > len(y):
        rest -= M[:, len(y) :] @ np.linalg.lstsq(M[:, len(y) :], rest, rcond=None)[0]
    size = max(1.0, float((np.abs(M[:, : len(y)]) @ np.abs(y) + np.abs(f)).max()))
    return {"residual": float(np.abs(rest).max()) / size}


def names(expression: Any) -> dict[str, Any]:
    """Symbols and functions of time in a matrix, by their names."""
    return {name(x): x for x in (*find_dynamicsymbols(expression), *expression.free_symbols)}


def evaluated(expression: Any, numbers: dict[str, float]) -> np.ndarray:
    """A matrix of SymPy at numbers by name; what cancels in eomgen's model may have any."""
    known = {part: numbers.get(key, 0.6) for key, part in names(expression).items()}
    return np.array(msubs(expression, known).evalf().tolist(), dtype=float)


def name(function: Any) -> str:
    """``q``, ``q_dot``, ``q_ddot``."""
    if isinstance(function, sp.Derivative):
        return f"{function.expr.func.__name__}_{'d' * function.derivative_count}ot"
    return str(getattr(function, "name", function.func))


if __name__ == "__main__":
    objects = collected()
    for test, method in objects:
        try:
            said: dict[str, Any] = compare(method)
        except Exception as error:  # which objects fail, and how, is the result
            said = {"error": f"{type(error).__name__}: {error}"[:300]}
        print(json.dumps({"test": test, "kind": type(method).__name__} | said), flush=True)
