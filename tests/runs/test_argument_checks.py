"""What a call cannot take, keep or end is a named error at once, at every door, in both targets: nothing hangs."""

from __future__ import annotations

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

import eomgen as eg

TARGETS = ("cython", "numpy")


WIDE = np.broadcast_to(0.5, 10**9)
RUNS: dict[str, tuple[Callable[[Any], Any], str]] = {
    "tiny max_step": (lambda m: m.simulate(1.0, max_step=1e-300), "max_step = 1e-300 s is too small .* would not end"),
    "many steps kept": (lambda m: m.simulate(1.0, max_step=2e-8), r"a run of 5e\+07 steps would keep .* GiB"),
    "dense and small": (lambda m: m.simulate(1.0, max_step=1e-7, dense_output=True), "would keep"),
    "far end": (lambda m: m.simulate(1e300), r"needs \S+ more to reach t = 1e\+300 s, which would take too long"),
    "far back": (lambda m: m.simulate((0, -1e300)), "would take too long"),
    "end nan": (lambda m: m.simulate(np.nan), "span must be"),
    "store of bytes": (lambda m: m.simulate_many(0.1, count=2, store=b"here"), "store must be the name of a file"),
    "store with NUL": (lambda m: m.simulate_many(0.1, count=2, store="a\0b"), "store must be the name of a file"),
    "checkpoint of a number": (lambda m: m.simulate(0.1, checkpoint=3), "checkpoint must be the name of a file"),
    "reduction of an array": (lambda m: m.simulate_many(0.1, count=2, reduce=np.empty((2, 0))), "reduce must be"),
    "saved to a number": (lambda m: m.simulate(0.1).save(3), "path must be the name of a file"),
    "a long range": (lambda m: m.simulate(1.0, t_eval=range(10**9)), "t_eval with 1000000000 times would keep"),
    "complex times": (lambda m: m.simulate(1.0, t_eval=[1j]), "t_eval must be a list of times"),
    "objects as times": (lambda m: m.simulate(1.0, t_eval=np.array([0, object()], dtype=object)), "t_eval must be"),
    "initial text": (lambda m: m.simulate(1.0, "ab"), "initial must hold real numbers, not 'ab'"),
    "runs": (lambda m: m.simulate_many(1.0, count=10**9), "simulate_many with 1000000000 runs would keep .* GiB"),
    "samples": (lambda m: m.simulate_many(1.0, count=10**6, t_eval=np.linspace(0, 1, 1000)), "would keep"),
    "time as text": (lambda m: m.rhs("a", [0.0, 0.0]), "t of rhs must be a real number, or .k,., not 'a'"),
    "state as text": (lambda m: m.rhs(0.0, "ab"), r"x of rhs must hold real numbers, \(2,\) or \(2, k\), not 'ab'"),
    "a state of modes": (lambda m: m.modes("ab"), "x must hold real numbers"),
    "no names": (lambda m: m.sensitivities(3, 1.0), "names must be a name or a list of names, not 3"),
    "slopes": (lambda m: m.sensitivities(["g"], 1.0, max_step=1e-300), "would not end"),
}  # fmt: skip


class Odd:
    """Its whole number is an error."""

    def __index__(self) -> int:
        raise ZeroDivisionError


def swinging(terminal: Any) -> dict[str, Any]:
    return {"expression": "theta", "terminal": terminal}


#: Door of a whole number -> the call with it, the least it takes, and the words before the rule's.
COUNTS: dict[str, tuple[Any, int, str]] = {
    "states": (lambda m, n: m.verify(states=n), 1, "verify: states, the number of random states,"),
    "seed": (lambda m, n: m.verify(seed=n), 0, "verify: seed, of the random states,"),
    "runs": (lambda m, n: m.simulate_many(0.01, count=n), 0, "count, of runs,"),
    "threads": (lambda m, n: m.simulate_many(0.01, count=1, threads=n), 1, "threads"),
    "block": (lambda m, n: m.simulate_many(0.01, count=1, block=n), 1, "block"),
    "max_steps": (lambda m, n: m.simulate_many(0.01, count=1, max_steps=n), 1, "max_steps"),
    "keep_events": (lambda m, n: m.simulate_many(0.01, count=1, keep_events=n), 1, "keep_events"),
    "points": (lambda m, n: m.workspace({"theta": (0.0, 1.0, 3)}, "theta", points=n), 0, "points"),
    "impacts": (lambda m, n: m.simulate_impacts(0.01, {"theta": 1.0}, most=n), 1, "most, the number of impacts,"),
    "terminal": (lambda m, n: m.simulate(0.01, events=[swinging(n)]), 0, "event theta: terminal"),
    "jobs": (lambda m, n: models.build("pendulum").compile(jobs=n), 1, "jobs, files compiled at a time,"),
    "optimize": (lambda m, n: models.build("pendulum").compile(optimize=n), 0, "optimize"),
}  # fmt: skip


@pytest.mark.parametrize("door", COUNTS)
def test_a_whole_number_is_the_same_everywhere(door: str) -> None:
    (call, least, words), swing = COUNTS[door], compiled("pendulum", "numpy")
    for given in (1.0, 1.5, "1", [1], least - 1, np.nan, 1j, np.array([1, 2]), Odd()):
        if door == "terminal" and isinstance(given, float) and given == 1.0:
            continue  # SciPy's users write it so
        with pytest.raises(eg.UsageError, match=f"^{words} must be .*, not "):
            call(swing, given)
    if door not in ("terminal", "optimize"):
        with pytest.raises(eg.UsageError, match=f"{words} must be a whole number .*, not True"):
            call(swing, True)
    if door in ("runs", "threads", "block", "max_steps", "keep_events", "terminal"):
        for given in (1, np.int8(1), np.array(1), sympy.Integer(1)):
            call(swing, given)


@pytest.mark.parametrize("case", RUNS)
def test_runs_and_calls(case: str) -> None:
    call, words = RUNS[case]
    begun = time.process_time()
    for target in TARGETS:
        with pytest.raises(eg.EomgenError, match=words):
            call(compiled("pendulum", target))
    assert time.process_time() - begun < 20.0


POSITIONS: dict[str, tuple[Callable[[Any], Any], str]] = {
    "a far angle": (lambda m: m.kinematics([1e9]), r"the path to theta = 1e\+09 is 1e\+09 rad .* at most 2000 are"),
    "beyond floats": (lambda m: m.kinematics([1e300]), "are allowed, in small steps"),
    "minimal": (lambda m: m.minimal.expand([1e9, 0.0]), "are allowed, in small steps"),
    "many columns": (lambda m: m.kinematics(np.broadcast_to(0.5, (1, 10**9))), "would keep"),
    "many minimal": (lambda m: m.minimal.expand(np.broadcast_to(0.5, (2, 10**9))), "would keep"),
    "many points": (lambda m: m.kinematic_analysis(WIDE), "a range of 1000000000 points would keep"),
    "text as parameters": (lambda m: m.bind(p="?"), "the parameters must hold real numbers, not '\\?'"),
    "an object as inputs": (lambda m: m.bind(u=...), "the inputs must hold real numbers"),
    "a huge number": (lambda m: m.x0({m.q_names[0]: 10**400}), "must be a number, not 1000"),
    "rows of an array": (lambda m: m.constraints(m.assemble(), rows=np.ones(2)), "rows must be 'independent' or 'all'"),
    "a branch of nan": (lambda m: m.branch(np.full(m.n_q, np.nan)), "x must be finite"),
}  # fmt: skip


@pytest.mark.parametrize("case", POSITIONS)
def test_positions_of_a_loop(case: str) -> None:
    call, words = POSITIONS[case]
    with pytest.raises(eg.EomgenError, match=words):
        call(compiled("slider_crank", "numpy"))


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
        with pytest.raises(eg.UsageError, match=r"strides \(0.*one number in memory"):
            call()
    assert mod.rhs(0.0, np.zeros((mod.n_x, 0)), out=np.empty((mod.n_x, 0))).shape == (mod.n_x, 0)
    for span, words in (
        ((0, 1e300), r"1e\+301 samples of a, one every 0\.1 s, so it would not end"),
        ((1e16, 1e16 + 2), r"the period of a, 0\.1 s, is lost in rounding at times near 1e\+16 s"),
        ((1e15, 1e15 + 1), "is lost in rounding"),
    ):
        with pytest.raises(eg.UsageError, match=words):
            mod.simulate(span)
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
    with pytest.raises(eg.UsageError, match=rf"^x of rhs must hold real numbers, \({n},\) or \({n}, k\), not 'ab'$"):
        mod.rhs(0.0, "ab")
    with pytest.raises(eg.UsageError, match=rf"^x of rhs must hold real numbers, \({n},\) or \({n}, k\), not \[\[1, 2"):
        mod.rhs(0.0, [[1, 2], [3]])
    with pytest.raises(eg.UsageError, match=r"^q of mass_matrix must hold real numbers, \(3,\) or \(3, k\), not None$"):
        mod.mass_matrix(None)
    with pytest.raises(eg.UsageError, match=rf"^x of rhs must have shape \({n},\) or \({n}, k\), not \({n - 1},\)$"):
        mod.rhs(0.0, np.zeros(n - 1))
