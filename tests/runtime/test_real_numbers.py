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
from eomgen.runtime.room import as_real
from eomgen.texts import shown

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


#: Doors of one number that a user writes, which may be an expression of numbers as text.
WRITTEN = ("named", "named parameter", "initial", "end", "guess", "tolerance", "reactions")
#: Doors of lists of numbers, in which there may be such texts.
LISTED = ("late kernel", "bound", "independent", "minimal", "times kept", "table", "runs", "range")
TEXTS = {"text", "text in an array", "text as an object"}
LOOPS = ("state", "constraints", "independent", "minimal", "reactions", "late kernel")
PLACES = [("pendulum", door) for door in DOORS] + [("four_bar", door) for door in LOOPS]


@pytest.mark.parametrize(("name", "door"), PLACES)
def test_real_numbers_of_any_kind_are_taken(modules: dict[str, Any], name: str, door: str) -> None:
    for target in TARGETS:
        mod = modules[f"{name} {target}"]
        expected = DOORS[door](mod, 0.5)
        texts = {"text": "0.5", "expression": "deg(90)/pi"} if door in WRITTEN + LISTED else {}
        for kind, value in (NUMBERS | texts).items():
            np.testing.assert_array_equal(DOORS[door](mod, value), expected, err_msg=f"{kind}, {target}")


@pytest.mark.parametrize(("name", "door"), PLACES)
def test_what_is_no_real_number_is_named(modules: dict[str, Any], name: str, door: str) -> None:
    unreal = {kind: value for kind, value in UNREAL.items() if door not in LISTED or kind not in TEXTS}
    for kind, value in (unreal | ({"text": "one half"} if door in WRITTEN + LISTED else {})).items():
        told = []
        for target in TARGETS:
            with pytest.raises(eg.UsageError) as caught:
                DOORS[door](modules[f"{name} {target}"], value)
            told.append(str(caught.value))
        assert told[0] == told[1], kind  # the same words, whatever the target
        assert "\n" not in told[0]


def failing(method: str, error: BaseException) -> Any:
    """An object whose method raises."""

    def fail(*_: Any, **__: Any) -> Any:
        raise error

    return type("Failing", (), {method: fail})()


#: States of two numbers, or what is none.
STATES: dict[str, tuple[Any, list[float] | None]] = {
    "list": ([0.5, 1.0], [0.5, 1.0]),
    "integers": ((1, True), [1.0, 1.0]),
    "NumPy's": ([np.float64(0.5), np.int32(1)], [0.5, 1.0]),
    "half": (np.array([0.5, 1.0], dtype=np.float16), [0.5, 1.0]),
    "single": (np.array([0.5, 1.0], dtype=np.float32), [0.5, 1.0]),
    "other order": (np.array([1, 2], dtype=">i4"), [1.0, 2.0]),
    "long": (np.array([0.5, 1.0], dtype=np.longdouble), [0.5, 1.0]),
    "strided": (np.arange(4, dtype=np.int64)[::2], [0.0, 2.0]),
    "fractions": ([Fraction(1, 2), Decimal(1)], [0.5, 1.0]),
    "nothing masked, in a list": ([np.ma.masked_array(0.5, mask=False), 1.0], [0.5, 1.0]),
    "too large an integer": ([10**400, 1.0], None),
    "too many digits": ([10**5000, "a"], None),
    "None": ([None, 1.0], None),
    "masked": ([np.ma.masked, 1.0], None),
    "masked in a list of arrays": ([np.ma.masked_array([0.5], mask=[True]), [1.0]], None),
    "masked as an object": (np.array([np.ma.masked, 1.0], dtype=object), None),
    "array that fails": (failing("__array__", RuntimeError("no")), None),
    "float that fails": ([failing("__float__", ZeroDivisionError("no")), 1.0], None),
    "length that fails": (failing("__len__", KeyError("no")), None),
    "repr that fails": ([failing("__repr__", RecursionError("no")), 1.0], None),
    "lists without end": ((endless := [], endless.append(endless))[0], None),
}


@pytest.mark.parametrize("kind", STATES)
def test_both_rules_of_a_real_number_are_one(modules: dict[str, Any], kind: str) -> None:
    given, expected = STATES[kind]
    found, told = as_real(given), []
    for target in TARGETS:
        mod = modules[f"pendulum {target}"]
        if expected is None:
            with pytest.raises(eg.UsageError) as caught:
                mod.rhs(0.0, given)
            told.append(str(caught.value))
        else:
            np.testing.assert_array_equal(mod.rhs(0.0, given), mod.rhs(0.0, np.array(expected)))
    if expected is None:
        assert found is None
        assert told == [f"x of rhs must hold real numbers, (2,) or (2, k), not {shown(given)}"] * 2
    else:
        assert found is not None
        assert found.dtype == np.float64
        np.testing.assert_array_equal(found, expected)


def test_what_pandas_calls_missing_is_no_number_and_its_series_are_arrays(modules: dict[str, Any]) -> None:
    pd = pytest.importorskip("pandas")
    times = pd.Series([0.5, 1.0])
    for target in TARGETS:
        mod = modules[f"pendulum {target}"]
        for missing in (pd.NA, pd.NaT):
            for given in ([missing, 1.0], np.array([missing, 1.0], dtype=object), missing):
                with pytest.raises(eg.UsageError, match="x of rhs must hold real numbers"):
                    mod.rhs(0.0, given)
                with pytest.raises(eg.UsageError, match="t of rhs must be a real number"):
                    mod.rhs(given, np.zeros((2, 2)))
        np.testing.assert_array_equal(mod.rhs(times, np.ones((2, 2))), mod.rhs(times.to_numpy(), np.ones((2, 2))))
        np.testing.assert_array_equal(mod.rhs(0.0, times), mod.rhs(0.0, times.to_numpy()))
        with pytest.raises(eg.UsageError, match=r"t of rhs must be a number or have shape \(k,\), not \(2,\)"):
            mod.rhs(times, [0.5, 1.0])


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("method", ["__array__", "__float__", "__repr__"])
def test_an_interrupt_within_a_conversion_is_one(modules: dict[str, Any], target: str, method: str) -> None:
    given = failing(method, KeyboardInterrupt())
    for state in (given, [given, 1.0]):
        with pytest.raises(KeyboardInterrupt):
            modules[f"pendulum {target}"].rhs(0.0, state)


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("size", [np.nan, np.inf, -np.inf])
def test_a_step_of_no_finite_size_is_refused_by_its_name(modules: dict[str, Any], target: str, size: float) -> None:
    mod = modules[f"pendulum {target}"]
    for call in (mod.step, mod.integrator()):
        with pytest.raises(eg.UsageError, match=rf"h must be finite, not {size}$"):
            call(0.0, mod.x0(), size)
        with pytest.raises(eg.UsageError, match=rf"t must be finite, not {size}$"):
            call(size, mod.x0(), 0.1)
        with pytest.raises(eg.UsageError, match="h must be a number, not None$"):
            call(0.0, mod.x0(), None)


@pytest.mark.parametrize("target", TARGETS)
def test_a_step_too_long_says_where_it_failed(modules: dict[str, Any], target: str) -> None:
    mod = modules[f"pendulum {target}"]
    with pytest.raises(eg.NonFiniteError, match=r"^rhs at t = 5e\+299, theta = inf"):
        mod.step(0.0, mod.x0(), 1e300)


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
