"""What a call cannot take, keep or end is a named error at once: nothing hangs or fills the memory."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy

import eomgen as eg

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(scope="module")
def swings() -> dict[str, Any]:
    return {target: eg.load(EXAMPLES / "pendulum.yaml").compile(target=target) for target in ("cython", "numpy")}


@pytest.fixture(scope="module")
def loop() -> Any:
    return eg.load(EXAMPLES / "four_bar.yaml").compile()


WIDE = np.broadcast_to(0.5, 10**9)
RUNS: dict[str, tuple[Callable[[Any], Any], str]] = {
    "tiny max_step": (lambda m: m.simulate(1.0, max_step=1e-300), "max_step = 1e-300 s is too small .* would not end"),
    "small max_step": (lambda m: m.simulate(1.0, max_step=1e-9), "would not end"),
    "many steps kept": (lambda m: m.simulate(1.0, max_step=2e-8), r"a run of 5e\+07 steps would keep .* GiB"),
    "dense and small": (lambda m: m.simulate(1.0, max_step=1e-7, dense_output=True), "would keep"),
    "far end": (lambda m: m.simulate(1e300), r"needs \S+ more to reach t = 1e\+300 s, which would take too long"),
    "far back": (lambda m: m.simulate((0, -1e300)), "would take too long"),
    "end nan": (lambda m: m.simulate(np.nan), "span must be"),
    "end inf": (lambda m: m.simulate(np.inf), "span must be"),
    "complex end": (lambda m: m.simulate(1j), "span must be"),
    "store of bytes": (lambda m: m.simulate_many(0.1, count=2, store=b"here"), "store must be the name of a file"),
    "store with NUL": (lambda m: m.simulate_many(0.1, count=2, store="a\0b"), "store must be the name of a file"),
    "checkpoint of a number": (lambda m: m.simulate(0.1, checkpoint=3), "checkpoint must be the name of a file"),
    "reduction of an array": (lambda m: m.simulate_many(0.1, count=2, reduce=np.empty((2, 0))), "reduce must be"),
    "saved to a number": (lambda m: m.simulate(0.1).save(3), "path must be the name of a file"),
    "many times": (lambda m: m.simulate(1.0, t_eval=WIDE), "t_eval with 1000000000 times would keep"),
    "a long range": (lambda m: m.simulate(1.0, t_eval=range(10**9)), "t_eval with 1000000000 times would keep"),
    "complex times": (lambda m: m.simulate(1.0, t_eval=[1j]), "t_eval must be a list of times"),
    "objects as times": (lambda m: m.simulate(1.0, t_eval=np.array([0, object()], dtype=object)), "t_eval must be"),
    "rtol nan": (lambda m: m.simulate(1.0, rtol=np.nan), "rtol must not be negative and must be finite"),
    "rtol negative": (lambda m: m.simulate(1.0, rtol=-1.0), "rtol must not be negative"),
    "initial text": (lambda m: m.simulate(1.0, "ab"), "initial must hold real numbers, not 'ab'"),
    "initial complex": (lambda m: m.simulate(1.0, [1j, 0]), "initial must hold real numbers"),
    "runs": (lambda m: m.simulate_many(1.0, count=10**9), "simulate_many with 1000000000 runs would keep .* GiB"),
    "runs as float": (lambda m: m.simulate_many(1.0, count=1e9), "count, of runs, must be a whole number"),
    "runs negative": (lambda m: m.simulate_many(1.0, count=-1), "count, of runs, must be a whole number"),
    "runs as text": (lambda m: m.simulate_many(1.0, count="a"), "count, of runs, must be a whole number"),
    "samples": (lambda m: m.simulate_many(1.0, count=10**6, t_eval=np.linspace(0, 1, 1000)), "would keep"),
    "time as text": (lambda m: m.rhs("a", [0.0, 0.0]), "t of rhs must be a real number, or .k,., not 'a'"),
    "time complex": (lambda m: m.rhs(1j, [0.0, 0.0]), "t of rhs must be a real number, or .k,., not 1j"),
    "time None": (lambda m: m.rhs(None, [0.0, 0.0]), "t of rhs must be a real number"),
    "state as text": (lambda m: m.rhs(0.0, "ab"), r"x of rhs must hold real numbers, \(2,\) or \(2, k\), not 'ab'"),
    "a guess as text": (lambda m: m.equilibrium({"theta": "a"}), "theta must be a number, not 'a'"),
    "a guess complex": (lambda m: m.equilibrium({"theta": 1j}), "theta must be a number"),
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
    "jobs": (lambda m, n: eg.load(EXAMPLES / "pendulum.yaml").compile(jobs=n), 1, "jobs, files compiled at a time,"),
    "optimize": (lambda m, n: eg.load(EXAMPLES / "pendulum.yaml").compile(optimize=n), 0, "optimize"),
}  # fmt: skip


@pytest.mark.parametrize("door", COUNTS)
def test_a_whole_number_is_the_same_everywhere(swings: dict[str, Any], door: str) -> None:
    call, least, words = COUNTS[door]
    for given in (1.0, 1.5, "1", [1], least - 1, np.nan, 1j, np.array([1, 2]), Odd()):
        if door == "terminal" and isinstance(given, float) and given == 1.0:
            continue  # SciPy's users write it so
        with pytest.raises(eg.UsageError, match=f"^{words} must be .*, not "):
            call(swings["numpy"], given)
    if door not in ("terminal", "optimize"):
        with pytest.raises(eg.UsageError, match=f"{words} must be a whole number .*, not True"):
            call(swings["numpy"], True)
    if door in ("runs", "threads", "block", "max_steps", "keep_events", "terminal"):
        for given in (1, np.int8(1), np.array(1), sympy.Integer(1)):
            call(swings["numpy"], given)


@pytest.mark.parametrize("target", ["cython", "numpy"])
@pytest.mark.parametrize("case", RUNS)
def test_runs_and_calls(swings: dict[str, Any], case: str, target: str) -> None:
    call, words = RUNS[case]
    begun = time.perf_counter()
    with pytest.raises(eg.EomgenError, match=words):
        call(swings[target])
    assert time.perf_counter() - begun < 20.0


POSITIONS: dict[str, tuple[Callable[[Any], Any], str]] = {
    "a far angle": (lambda m: m.kinematics([1e9]), r"the path to theta = 1e\+09 is 1e\+09 rad .* at most 2000 are"),
    "beyond floats": (lambda m: m.kinematics([1e300]), "are allowed, in small steps"),
    "minimal": (lambda m: m.minimal.expand([1e9, 0.0]), "are allowed, in small steps"),
    "many columns": (lambda m: m.kinematics(np.broadcast_to(0.5, (1, 10**9))), "would keep"),
    "many minimal": (lambda m: m.minimal.expand(np.broadcast_to(0.5, (2, 10**9))), "would keep"),
    "many points": (lambda m: m.kinematic_analysis(WIDE), "a range of 1000000000 points would keep"),
    "text": (lambda m: m.kinematics("a"), "q_i must hold real numbers"),
    "complex": (lambda m: m.kinematics([1j]), "q_i must hold real numbers"),
    "minimal text": (lambda m: m.minimal.expand("a"), "x must hold real numbers"),
    "reactions text": (lambda m: m.reactions(0.0, "a"), "x must hold real numbers"),
}  # fmt: skip


@pytest.mark.parametrize("case", POSITIONS)
def test_positions_of_a_loop(loop: Any, case: str) -> None:
    call, words = POSITIONS[case]
    with pytest.raises(eg.EomgenError, match=words):
        call(loop)


def test_turns_that_are_walked_and_a_position_to_start_from(loop: Any) -> None:
    """The bound is on the walk alone: 300 turns are walked, and a far angle is reached from a guess."""
    q = loop.kinematics([0.5])[0]
    far = loop.kinematics([0.5 + 600 * np.pi])[0]
    np.testing.assert_allclose(far - q, [600 * np.pi, -600 * np.pi, 0], atol=1e-8)
    there = loop.assemble(theta=1e5)
    np.testing.assert_allclose(loop.kinematics([1e5], guess=there)[0], there, atol=1e-9)


@pytest.mark.parametrize("target", ["cython", "numpy"])
def test_results_written_beside_and_over_the_state(swings: dict[str, Any], target: str) -> None:
    mod, x = swings[target], np.array([0.3, 0.7])
    expected = mod.rhs(0.0, x)
    np.testing.assert_array_equal(mod.rhs(0.0, x, out=x), expected)
    batch = np.asfortranarray(np.ones((2, 50)))[:, ::2]
    np.testing.assert_array_equal(mod.rhs(0.0, batch, out=batch)[:, 3], mod.rhs(0.0, [1.0, 1.0]))
    frozen = np.zeros(2)
    frozen.flags.writeable = False
    with pytest.raises(eg.UsageError, match="out of rhs .* read-only|out of rhs is read-only"):
        mod.rhs(0.0, [0.0, 0.0], out=frozen)
    assert mod.rhs(0.0, np.zeros((2, 0))).shape == (2, 0)


def test_steps_of_length_zero_are_named(swings: dict[str, Any]) -> None:
    with pytest.raises(eg.SimulationError, match="no progress|stopped|would take too long"):
        swings["numpy"].simulate(1.0, atol=1e-300, rtol=1e-300, method="LSODA")


LOOPS: dict[str, tuple[Callable[[Any], Any], str]] = {
    "text as parameters": (lambda m: m.bind(p="?"), "the parameters must hold real numbers, not '\\?'"),
    "an object as inputs": (lambda m: m.bind(u=...), "the inputs must hold real numbers"),
    "a huge number": (lambda m: m.x0({m.q_names[0]: 10**400}), "must be a number, not 1000"),
    "rows of an array": (lambda m: m.constraints(m.assemble(), rows=np.ones(2)), "rows must be 'independent' or 'all'"),
    "a branch of nan": (lambda m: m.branch(np.full(m.n_q, np.nan)), "x must be finite"),
}


@pytest.mark.parametrize("case", LOOPS)
def test_what_no_loop_can_take_is_named(loop: Any, case: str) -> None:
    call, words = LOOPS[case]
    with pytest.raises(eg.UsageError, match=words):
        call(loop)


@pytest.mark.parametrize("target", ["cython", "numpy"])
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
    for span, words in (
        ((0, 1e300), r"1e\+301 samples of a, one every 0\.1 s, so it would not end"),
        ((1e16, 1e16 + 2), r"the period of a, 0\.1 s, is lost in rounding at times near 1e\+16 s"),
        ((1e15, 1e15 + 1), "is lost in rounding"),
    ):
        with pytest.raises(eg.UsageError, match=words):
            mod.simulate(span)
    assert mod.simulate((1e8, 1e8 + 0.35))["a"][-1] == 4.0
