"""What a call cannot take, keep or end is a named error at once, at every door, in both targets: nothing hangs."""

import time
from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from typing import Any

import models
import numpy as np
import pytest
import sympy
from analysed import compiled
from refusals import refused, refuses

import eomgen as eg

TARGETS = ("cython", "numpy")
WIDE = np.broadcast_to(0.5, 10**9)
RUNS: dict[str, tuple[Callable[[Any], Any], str]] = {
    "tiny max_step": (lambda m: m.simulate(1.0, max_step=1e-300), "EG-ENDLESS max_step 1e-300"),
    "many steps kept": (lambda m: m.simulate(1.0, max_step=2e-8), "EG-TOO-LARGE 5e+07 GiB"),
    "dense and small": (lambda m: m.simulate(1.0, max_step=1e-7, dense_output=True), "EG-TOO-LARGE 1e+07"),
    "far end": (lambda m: m.simulate(1e300), "EG-ENDLESS 1e+300"),
    "far back": (lambda m: m.simulate((0, -1e300)), "EG-ENDLESS -1e+300"),
    "end nan": (lambda m: m.simulate(np.nan), "EG-NUMBER span nan"),
    "store of bytes": (lambda m: m.simulate_many(0.1, count=2, store=b"here"), "EG-TYPE store b'here'"),
    "store with NUL": (lambda m: m.simulate_many(0.1, count=2, store="a\0b"), "EG-TYPE store"),
    "reduction of an array": (lambda m: m.simulate_many(0.1, count=2, reduce=np.empty((2, 0))), "EG-TYPE reduce"),
    "saved to a number": (lambda m: m.simulate(0.1).save(3), "EG-TYPE path 3"),
    "a long range": (lambda m: m.simulate(1.0, t_eval=range(10**9)), "EG-TOO-LARGE t_eval 1000000000"),
    "complex times": (lambda m: m.simulate(1.0, t_eval=[1j]), "EG-TYPE t_eval [1j]"),
    "objects as times": (lambda m: m.simulate(1.0, t_eval=np.array([0, object()], dtype=object)), "EG-TYPE t_eval"),
    "initial text": (lambda m: m.simulate(1.0, "ab"), "EG-TYPE initial 'ab'"),
    "runs": (lambda m: m.simulate_many(1.0, count=10**9), "EG-TOO-LARGE simulate_many 1000000000 GiB"),
    "samples": (lambda m: m.simulate_many(1.0, count=10**6, t_eval=np.linspace(0, 1, 1000)), "EG-TOO-LARGE 1000000"),
    "time as text": (lambda m: m.rhs("a", [0.0, 0.0]), "EG-SHAPE t rhs (k,) 'a'"),
    "a state of modes": (lambda m: m.modes("ab"), "EG-TYPE x 'ab'"),
    "no names": (lambda m: m.sensitivities(3, 1.0), "EG-TYPE names 3"),
    "slopes": (lambda m: m.sensitivities(["g"], 1.0, max_step=1e-300), "EG-ENDLESS max_step 1e-300"),
}  # fmt: skip


class Odd:
    """Its whole number is an error."""

    def __index__(self) -> int:
        raise ZeroDivisionError


def swinging(terminal: Any) -> dict[str, Any]:
    return {"expression": "theta", "terminal": terminal}


#: Door of a whole number -> the call with it, the least it takes, and the names that the error tells.
COUNTS: dict[str, tuple[Any, int, str]] = {
    "states": (lambda m, n: m.verify(states=n), 1, "verify states"),
    "seed": (lambda m, n: m.verify(seed=n), 0, "verify seed"),
    "runs": (lambda m, n: m.simulate_many(0.01, count=n), 0, "count"),
    "threads": (lambda m, n: m.simulate_many(0.01, count=1, threads=n), 1, "threads"),
    "block": (lambda m, n: m.simulate_many(0.01, count=1, block=n), 1, "block"),
    "max_steps": (lambda m, n: m.simulate_many(0.01, count=1, max_steps=n), 1, "max_steps"),
    "keep_events": (lambda m, n: m.simulate_many(0.01, count=1, keep_events=n), 1, "keep_events"),
    "impacts": (lambda m, n: m.simulate_impacts(0.01, {"theta": 1.0}, most=n), 1, "most"),
    "terminal": (lambda m, n: m.simulate(0.01, events=[swinging(n)]), 0, "theta: terminal"),
    "jobs": (lambda m, n: models.build("pendulum").compile(jobs=n), 1, "jobs"),
    "optimize": (lambda m, n: models.build("pendulum").compile(optimize=n), 0, "optimize"),
}  # fmt: skip


@pytest.mark.parametrize("door", COUNTS)
def test_a_whole_number_is_the_same_everywhere(door: str) -> None:
    (call, least, names), swing = COUNTS[door], compiled("pendulum", "numpy")
    for given in (1.0, 1.5, "1", [1], least - 1, np.nan, 1j, np.array([1, 2]), Odd()):
        if door == "terminal" and isinstance(given, float) and given == 1.0:
            continue  # SciPy's users write it so
        with refused(f"{'EG-CHOICE' if door == 'optimize' else 'EG-RANGE'} {names}", eg.UsageError) as caught:
            call(swing, given)
        assert " ".join(repr(given).split())[:9] in str(caught.value)
    if door not in ("terminal", "optimize"):
        refuses(f"EG-RANGE {names} True", call, swing, True)
    if door in ("runs", "threads", "block", "max_steps", "keep_events", "terminal"):
        for given in (1, np.int8(1), np.array(1), sympy.Integer(1)):
            call(swing, given)


@pytest.mark.parametrize("case", RUNS)
def test_runs_and_calls(case: str) -> None:
    call, demand = RUNS[case]
    begun = time.process_time()
    for target in TARGETS:
        refuses(demand, call, compiled("pendulum", target))
    assert time.process_time() - begun < 20.0


POSITIONS: dict[str, tuple[Callable[[Any], Any], str]] = {
    "a far angle": (lambda m: m.kinematics([1e9]), "EG-TOO-LARGE theta 1e+09 2000"),
    "beyond floats": (lambda m: m.kinematics([1e300]), "EG-TOO-LARGE theta 1e+300 2000"),
    "minimal": (lambda m: m.minimal.expand([1e9, 0.0]), "EG-TOO-LARGE theta 1e+09"),
    "many columns": (lambda m: m.kinematics(np.broadcast_to(0.5, (1, 10**9))), "EG-TOO-LARGE 1000000000"),
    "many minimal": (lambda m: m.minimal.expand(np.broadcast_to(0.5, (2, 10**9))), "EG-TOO-LARGE 1000000000"),
    "many points": (lambda m: m.kinematic_analysis(WIDE), "EG-TOO-LARGE 1000000000"),
    "text as parameters": (lambda m: m.bind(p="?"), "EG-TYPE parameters '?'"),
    "an object as inputs": (lambda m: m.bind(u=...), "EG-TYPE inputs Ellipsis"),
    "a huge number": (lambda m: m.x0({m.q_names[0]: 10**400}), "EG-NUMBER theta"),
    "rows of an array": (lambda m: m.constraints(m.assemble(), rows=np.ones(2)), "EG-CHOICE rows 'independent' 'all'"),
    "a branch of nan": (lambda m: m.branch(np.full(m.n_q, np.nan)), "EG-NUMBER x nan"),
}  # fmt: skip


@pytest.mark.parametrize("case", POSITIONS)
def test_positions_of_a_loop(case: str) -> None:
    call, demand = POSITIONS[case]
    refuses(demand, call, compiled("slider_crank", "numpy"))


def test_a_coordinate_that_moves_the_others_too_far_is_refused() -> None:
    """x = 0.1 is y = -1e6, reached in steps of a few tenths."""
    m = eg.Model("flat")
    for name in ("x", "y"):
        m.prismatic(name.upper(), m.ground, m.body(name, mass=1), axis=name, coordinate=name)
    m.coupling("c", equation="x + 1e-7*y")
    m.independent("x")
    module, begun = m.compile(target="numpy"), time.process_time()
    refuses("EG-TOO-LARGE x 1e+06", module.minimal.rhs, 0.0, [0.1, 0.0])
    refuses("EG-TOO-LARGE x", module.kinematics, [[0.1, 0.2]])
    assert time.process_time() - begun < 20.0


@pytest.mark.parametrize("target", TARGETS)
def test_what_is_missing_and_what_takes_no_result(target: str) -> None:
    m = eg.Model("cart")
    m.prismatic("J", m.ground, m.body("b", mass=1.0), axis="x", coordinate="s")
    m.sampled("a", "a + 1", 0.1)
    mod = m.compile(target=target)
    with pytest.raises(TypeError, match=r"^rhs\(t, x\) "):
        mod.rhs([0, 1])
    with pytest.raises(TypeError, match=r"^energy\(x\) "):
        mod.energy()
    with pytest.raises(TypeError, match=r"^mass_matrix\(q\) (missing .*'q'|takes at least 1)"):
        mod.mass_matrix()
    with pytest.raises(TypeError, match=r"^f\(q, v, a\) |^inverse_dynamics\(q, v, a\) "):
        mod.inverse_dynamics([0.0])
    one = np.lib.stride_tricks.as_strided(np.zeros(1), (mod.n_x,), (0,))
    square = np.lib.stride_tricks.as_strided(np.zeros(mod.n_x), (mod.n_x, mod.n_x), (0, 8))
    for call in (
        lambda: mod.rhs(0.0, mod.x0(), out=one),
        lambda: mod.jacobian(0.0, mod.x0(), out=square),
        lambda: mod.project(mod.x0(), out=one),
        lambda: mod.bias(0.0, mod.x0(), out=one[:1]) or mod.rhs(0.0, mod.x0(), out=one),
    ):
        refuses("EG-SHAPE out strides (0", call)
    assert mod.rhs(0.0, np.zeros((mod.n_x, 0)), out=np.empty((mod.n_x, 0))).shape == (mod.n_x, 0)
    for span, demand in (
        ((0, 1e300), "EG-ENDLESS 1e+301 a 0.1"),
        ((1e16, 1e16 + 2), "EG-RANGE a 0.1 1e+16"),
        ((1e15, 1e15 + 1), "EG-RANGE a 0.1 1e+15"),
    ):
        refuses(demand, mod.simulate, span)
    assert mod.simulate((1e8, 1e8 + 0.35))["a"][-1] == 4.0


#: Each is 0.5.
NUMBERS: dict[str, Any] = {
    "float": 0.5,
    "long": np.longdouble(0.5),
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
    "text as an object": np.array("0.5", dtype=object),
    "complex": 0.5 + 0j,
    "complex of SymPy": sympy.I,
    "symbol": sympy.Symbol("q"),
    "nanoseconds": np.timedelta64(1, "ns"),
    "masked": np.ma.masked_array(0.5, mask=True),
    "huge": 10**400,
    "set": {0.5},
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
TEXTS = {"text", "text as an object"}
LOOPS = ("state", "constraints", "independent", "minimal", "reactions", "late kernel")
PLACES = [("pendulum", door) for door in DOORS] + [("slider_crank", door) for door in LOOPS]


@pytest.mark.parametrize(("name", "door"), PLACES)
def test_real_numbers_of_any_kind_are_taken(name: str, door: str) -> None:
    for target in TARGETS:
        mod = compiled(name, target)
        expected = DOORS[door](mod, 0.5)
        texts = {"text": "0.5", "expression": "deg(90)/pi"} if door in WRITTEN + LISTED else {}
        for kind, value in (NUMBERS | texts).items():
            np.testing.assert_array_equal(DOORS[door](mod, value), expected, err_msg=f"{kind}, {target}")


@pytest.mark.parametrize(("name", "door"), PLACES)
def test_what_is_no_real_number_is_named(name: str, door: str) -> None:
    unreal = {kind: value for kind, value in UNREAL.items() if door not in LISTED or kind not in TEXTS}
    for kind, value in (unreal | ({"text": "one half"} if door in WRITTEN + LISTED else {})).items():
        told = []
        for target in TARGETS:
            with pytest.raises(eg.UsageError) as caught:
                DOORS[door](compiled(name, target), value)
            told.append(str(caught.value))
        assert told[0] == told[1], kind  # the same words, whatever the target
        assert "\n" not in told[0]


def failing(method: str, error: BaseException) -> Any:
    """An object whose method raises."""

    def fail(*_: Any, **__: Any) -> Any:
        raise error

    return type("Failing", (), {method: fail})()


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("method", ["__array__", "__float__", "__repr__"])
def test_an_interrupt_within_a_conversion_is_one(target: str, method: str) -> None:
    given = failing(method, KeyboardInterrupt())
    for state in (given, [given, 1.0]):
        with pytest.raises(KeyboardInterrupt):
            compiled("pendulum", target).rhs(0.0, state)


@pytest.mark.parametrize("target", TARGETS)
def test_a_refused_state_says_its_name_and_shape(target: str) -> None:
    mod = compiled("slider_crank", target)
    n = mod.n_x
    refuses(f"EG-SHAPE x rhs ({n},) k 'ab'", mod.rhs, 0.0, "ab")
    refuses(f"EG-SHAPE x rhs ({n},) k [3]]", mod.rhs, 0.0, [[1, 2], [3]])
    refuses("EG-SHAPE q mass_matrix (3,) k None", mod.mass_matrix, None)
    refuses(f"EG-SHAPE x rhs ({n},) k ({n - 1},)", mod.rhs, 0.0, np.zeros(n - 1))
