"""What counts as a real number is the same at every door of a module and in both targets."""

from __future__ import annotations

from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy

import eomgen as eg

EXAMPLES = Path(__file__).parents[2] / "examples"
TARGETS = ("cython", "numpy")


@pytest.fixture(scope="module")
def modules() -> dict[str, Any]:
    return {
        f"{name} {target}": eg.load(EXAMPLES / f"{name}.yaml").compile(target=target)
        for name in ("pendulum", "four_bar")
        for target in TARGETS
    }


#: Each is 0.5.
NUMBERS: dict[str, Any] = {
    "float": 0.5,
    "single": np.float32(0.5),
    "long": np.longdouble(0.5),
    "array": np.array(0.5),
    "other bytes": np.array(0.5, dtype=">f8"),
    "fraction": Fraction(1, 2),
    "decimal": Decimal("0.5"),
    "sympy": sympy.Rational(1, 2),
    "object": np.array(sympy.Float(0.5), dtype=object),
    "nothing masked": np.ma.masked_array(0.5, mask=False),
}
UNREAL: dict[str, Any] = {
    "text": "0.5",
    "bytes": b"0.5",
    "text in an array": np.array("0.5"),
    "text as an object": np.array("0.5", dtype=object),
    "complex": 0.5 + 0j,
    "complex in an array": np.array(0.5 + 0j),
    "complex as an object": np.array(np.complex128(0.5), dtype=object),
    "complex of SymPy": sympy.I,
    "symbol": sympy.Symbol("q"),
    "date": np.datetime64("2001-01-01"),
    "nanoseconds": np.timedelta64(1, "ns"),
    "masked": np.ma.masked_array(0.5, mask=True),
    "huge": 10**400,
    "set": {0.5},
    "generator": (x for x in (0.5,)),
    "dictionary": {"theta": 0.5},
    "type": float,
}


def column(value: Any, n: int) -> Any:
    """n entries, of which the first is the value; of its kind where arrays have kinds."""
    if isinstance(value, np.ma.MaskedArray):
        rest = np.ma.masked_array(np.full(n - 1, 0.25), mask=False)
        return np.ma.concatenate([np.ma.atleast_1d(value), rest])
    return [value[()] if isinstance(value, np.ndarray) else value, *[0.25] * (n - 1)]


#: Door -> the call with a value in it.
DOORS: dict[str, Callable[[Any, Any], Any]] = {
    "state": lambda m, z: m.rhs(0.0, column(z, m.n_x)),
    "time": lambda m, z: m.rhs(z, np.full(m.n_x, 0.25)),
    "times": lambda m, z: m.rhs(column(z, 2), np.full((m.n_x, 2), 0.25)),
    "parameters": lambda m, z: m.rhs(0.0, np.full(m.n_x, 0.25), p=column(z, m.n_p)),
    "position": lambda m, z: m.mass_matrix(column(z, m.n_q)),
    "constraints": lambda m, z: m.constraints(column(z, m.n_q)),
    "motion": lambda m, z: m.inverse_dynamics(np.zeros(m.n_q), column(z, m.n_v), np.zeros(m.n_v)),
    "step": lambda m, z: m.step(0.0, column(z, m.n_x), 0.01),
    "size of a step": lambda m, z: m.step(0.0, np.full(m.n_x, 0.25), z),
    "time of a step": lambda m, z: m.step(z, np.full(m.n_x, 0.25), 0.01),
    "late kernel": lambda m, z: m.momentum(column(z, m.n_x)),
    "integrator": lambda m, z: m.integrator()(0.0, column(z, m.n_x), 0.0),
    "named": lambda m, z: m.x0({m.q_names[0]: z}),
    "named parameter": lambda m, z: m.bind(p={m.p_names[0]: z}).p,
    "bound": lambda m, z: m.bind(p=column(z, m.n_p)).p,
    "independent": lambda m, z: m.kinematics(column(z, m.n_dof))[0],
    "minimal": lambda m, z: m.minimal.reduce(column(z, m.n_x)),
    "initial": lambda m, z: m.simulate(0.01, initial={m.q_names[0]: z}).x[:, 0],
    "end": lambda m, z: m.simulate(z, t_eval=[0.0]).x,
    "times kept": lambda m, z: m.simulate(1.0, t_eval=column(z, 1)).x,
    "tolerance": lambda m, z: m.simulate(0.01, rtol=z).x,
    "table": lambda m, z: eg.Signal([0.0, 1.0], column(z, 2))(0.0),
    "runs": lambda m, z: m.simulate_many(0.01, {m.q_names[0]: column(z, 2)}, t_eval=[0.0]).x,
    "range": lambda m, z: m.kinematic_analysis(**{m.q_names[0]: column(z, 2)}).q,
    "guess": lambda m, z: m.equilibrium({m.q_names[0]: z}).q,
    "reactions": lambda m, z: m.reactions(z, m.x0()),
}  # fmt: skip


LOOPS = ("state", "constraints", "independent", "minimal", "reactions", "late kernel")
PLACES = [("pendulum", door) for door in DOORS] + [("four_bar", door) for door in LOOPS]


@pytest.mark.parametrize(("name", "door"), PLACES)
def test_real_numbers_of_any_kind_are_taken(modules: dict[str, Any], name: str, door: str) -> None:
    for target in TARGETS:
        mod = modules[f"{name} {target}"]
        expected = DOORS[door](mod, 0.5)
        for kind, value in NUMBERS.items():
            np.testing.assert_array_equal(DOORS[door](mod, value), expected, err_msg=f"{kind}, {target}")


@pytest.mark.parametrize(("name", "door"), PLACES)
def test_what_is_no_real_number_is_named(modules: dict[str, Any], name: str, door: str) -> None:
    for kind, value in UNREAL.items():
        told = []
        for target in TARGETS:
            with pytest.raises(eg.UsageError) as caught:
                DOORS[door](modules[f"{name} {target}"], value)
            told.append(str(caught.value))
        assert told[0] == told[1], kind  # the same words, whatever the target
        assert "\n" not in told[0]


@pytest.mark.parametrize("target", TARGETS)
def test_a_refused_state_says_its_name_and_shape(modules: dict[str, Any], target: str) -> None:
    mod = modules[f"four_bar {target}"]
    n = mod.n_x
    with pytest.raises(eg.UsageError, match=rf"^x of rhs must hold real numbers, \({n},\) or \({n}, k\), not 'ab'$"):
        mod.rhs(0.0, "ab")
    with pytest.raises(eg.UsageError, match=rf"^x of rhs must hold real numbers, \({n},\) or \({n}, k\), not \[\[1, 2"):
        mod.rhs(0.0, [[1, 2], [3]])
    with pytest.raises(eg.UsageError, match=r"^q of mass_matrix must hold real numbers, \(3,\) or \(3, k\), not None$"):
        mod.mass_matrix(None)
    with pytest.raises(eg.UsageError, match=rf"^x of rhs must have shape \({n},\) or \({n}, k\), not \({n - 1},\)$"):
        mod.rhs(0.0, np.zeros(n - 1))


@pytest.mark.parametrize("target", TARGETS)
def test_booleans_and_integers_are_numbers(modules: dict[str, Any], target: str) -> None:
    mod = modules[f"pendulum {target}"]
    expected = mod.rhs(1.0, [1.0, 0.0])
    for one in (True, np.True_, 1, np.int8(1), np.uint64(1)):
        np.testing.assert_array_equal(mod.rhs(one, [one, 0]), expected)


@pytest.mark.parametrize("target", TARGETS)
def test_arguments_that_do_not_fit_the_signature_are_pythons_own_error(modules: dict[str, Any], target: str) -> None:
    mod = modules[f"pendulum {target}"]
    for call in (mod.rhs, mod.mass_matrix, mod.momentum, mod.kernels.timed("input_jacobian")):
        with pytest.raises(TypeError, match="argument"):
            call()
        with pytest.raises(TypeError, match="unexpected keyword"):
            call(0.0, [0.0, 0.0], colour="red")
