"""The shorter right-hand side of loops away from change points, beside the usual one and beside pivoting."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest

import eomgen as eg
from benchmarks.large_loops import closed_chain
from benchmarks.large_loops import four_bars as four_bars_in_a_row
from benchmarks.linkages import n_four_bar
from benchmarks.loop_robots import ROBOTS
from eomgen import pipeline
from eomgen.graph.count import count
from eomgen.graph.evaluate import compile_evaluator, evaluate
from eomgen.limits.constraints import NEARBY
from eomgen.limits.crossings import NEAR
from eomgen.program import regular_loops, straight_loops
from eomgen.program.block_groups import REGULAR, USUAL

KERNELS = ("rhs", "project", "constraints", "constraint_jacobian", "velocity_constraints")


def robot(name: str) -> eg.Model:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "robot.xml"
        path.write_text(ROBOTS[name]().text())
        return eg.load(path)


def redundant() -> eg.Model:
    """Three arms in a row on one beam: a parallelogram with one arm too many, turned in space."""
    m = eg.Model("redundant", gravity=(0.3, -9.81, 0.2))
    beam = m.body("beam", mass=1.0, com=(0.5, 0.1, 0.0), inertia=(0.02, 0.3, 0.31))
    for k in range(5):
        arm = m.body(f"arm{k}", mass=0.3, com=(0.0, 0.2, 0.0), inertia=(0.01, 0.002, 0.011))
        m.revolute(f"foot{k}", m.ground.at(0.25 * k, 0.0, 0.0), arm)
        m.revolute(f"head{k}", arm.at(0.0, 0.4, 0.0), beam.at(0.25 * k, 0.0, 0.0))
    tip = beam
    for k in range(3):
        link = m.body(f"link{k}", mass=0.2, com=(0.1, 0.0, 0.0), inertia=(0.001, 0.003, 0.004))
        m.revolute(f"tail{k}", tip.at(1.0 if k == 0 else 0.2, 0.0, 0.0), link)
        tip = link
    m.guess(foot0=0.3, tail0=0.2)
    return m


MODELS: dict[str, Callable[[], eg.Model]] = {
    **{name: (lambda name=name: robot(name)) for name in ROBOTS},
    **{name: (lambda name=name: eg.load_example(name)) for name in ("excavator", "stewart_platform")},
    "redundant rows": redundant,
}


class Beside:
    """Both forms of a model, evaluated on the graph, and states of it."""

    def __init__(self, model: eg.Model) -> None:
        equations = model.derive()
        program = pipeline.build(equations, "c", ["rhs"])
        self.blocks = {b.name: b for b in program.blocks}
        self.module = equations.compile(target="numpy", kernels=KERNELS)
        given = {u.name: u.value for u in equations.kinematics.mechanism.inputs}
        self.values = dict(zip(self.module.p_names, self.module.p, strict=True)) | given
        self.names = [*program.coordinates, *program.velocities]
        self.n, self.n_q = self.module.n_v, self.module.n_q
        self._made: dict[str, Any] = {}

    def evaluate(self, name: str, x: np.ndarray) -> np.ndarray:
        if name not in self._made:
            known = (*self.names, *self.values, "t")
            self._made[name] = compile_evaluator(list(self.blocks[name].outputs), known)
        return np.array(self._made[name]([*x, *self.values.values(), 0.0]), dtype=float)

    def state(self, rng: np.random.Generator, far: float) -> np.ndarray:
        """Closed at position level only."""
        x = self.module.x0() + 0.0
        x[: self.n_q] += far * rng.uniform(-1, 1, self.n_q)
        x = self.module.project(x)
        x[self.n_q :] += rng.uniform(-1, 1, self.n)
        return x

    def weakest(self, q: np.ndarray) -> float:
        """Least singular value of the rows that are to hold, beside the longest row."""
        J = self.module.constraint_jacobian(q)
        rank = self.n - self.module.n_dof
        return float(np.linalg.svd(J / np.linalg.norm(J, axis=1).max(), compute_uv=False)[rank - 1])


@pytest.mark.parametrize("name", MODELS)
def test_both_forms_agree(name: str) -> None:
    beside, rng, sound = Beside(MODELS[name]()), np.random.default_rng(4), 0
    assert set(REGULAR) <= set(beside.blocks)
    n = beside.n
    for k in range(20):
        x = beside.state(rng, (0.02, 0.2)[k % 2])
        regular, usual = (beside.evaluate(part, x) for part in ("regular_dynamics", "dynamics"))
        if regular[2 * n] != 1.0:
            continue
        assert regular[2 * n + 1] == 1.0
        assert beside.weakest(x[: beside.n_q]) > NEAR * NEAR
        sound += 1
        if usual[2 * n] == 1.0:  # not with redundant rows, whose joints are left for pivots
            for part in (slice(0, n), slice(n, 2 * n)):
                size = np.abs(usual[part]).max()
                np.testing.assert_allclose(regular[part], usual[part], rtol=0, atol=1e-11 * size)
        expected = beside.module.rhs(0.0, x)[beside.n_q :]
        np.testing.assert_allclose(regular[n : 2 * n], expected, rtol=0, atol=1e-11 * np.abs(expected).max())
    assert sound >= 8


@pytest.mark.parametrize("name", MODELS)
def test_steps_come_to_the_same_place(name: str) -> None:
    """What the term in J J^T keeps of a step is mended by the next one."""
    beside, rng, found = Beside(MODELS[name]()), np.random.default_rng(5), 0
    for far in (1e-9, 1e-7, 1e-6, 0.03 * NEARBY):
        x = beside.state(rng, 0.05)
        x[: beside.n_q] += far * rng.uniform(-1, 1, beside.n_q)
        places = []
        for part in ("regular_closing", "closing"):
            y = x.copy()
            for _ in range(3):
                step = beside.evaluate(part, y)
                y[: beside.n_q] += step[3:]
            places.append(y)
        first = beside.evaluate("regular_closing", x)
        if first[2] <= NEARBY:
            found += 1
            np.testing.assert_allclose(places[0], places[1], rtol=0, atol=1e-12)
            assert np.abs(beside.module.constraints(places[0][: beside.n_q])).max() < 1e-13
    assert found >= 3


@pytest.mark.parametrize("name", ["delta robot", "Stewart platform", "redundant rows"])
def test_a_closed_position_makes_no_step(name: str) -> None:
    """A guard ends the step where only rounding is left of the constraints, which takes a part of its operations."""
    beside, rng = Beside(MODELS[name]()), np.random.default_rng(7)
    for part in ("regular_closing", "closing"):
        block = beside.blocks[part]
        (guard,) = block.guards
        guarded = compile_evaluator([guard], (*beside.names, *beside.values, "t"))
        assert count([guard]).total < 0.3 * count(list(block.outputs)).total
        for far in (0.0, 1e-12, 1e-9, 1e-3):
            x = beside.state(rng, 0.02)
            x[: beside.n_q] += far * rng.uniform(-1, 1, beside.n_q)
            is_open = guarded([*x, *beside.values.values(), 0.0])[0]
            assert is_open == (far > 0.0)
            if not is_open:
                assert not beside.evaluate(part, x)[[0, 1, *range(3, 3 + beside.n)]].any()
        x[0] = np.nan
        assert guarded([*x, *beside.values.values(), 0.0])[0] == 1.0, "what is not a number is not closed"


@pytest.mark.parametrize("name", ["delta robot", "Stewart platform"])
def test_compiled_calls_at_closed_positions_are_those_beside_them(name: str) -> None:
    """Alone and side by side, to the bit, signs of zeros included; beside NumPy's, which pivots."""
    equations = MODELS[name]().derive()
    module, numbers = equations.compile(lanes=4, kernels=KERNELS), equations.compile(target="numpy", kernels=KERNELS)
    rng, states = np.random.default_rng(8), []
    for far in (0.0, 0.0, 1e-13, 0.0, 1e-9, 0.0, 1e-6, 0.0):
        x = module.x0()
        x[: module.n_q] += 0.02 * rng.uniform(-1, 1, module.n_q)
        x[module.n_q :] = rng.uniform(-1, 1, module.n_v)
        x = module.project(x)
        x[: module.n_q] += far * rng.uniform(-1, 1, module.n_q)
        states.append(x)
        expected = numbers.rhs(0.0, x)
        np.testing.assert_allclose(module.rhs(0.0, x), expected, rtol=0, atol=1e-11 * np.abs(expected).max())
    together, alone = module.rhs(0.0, np.array(states).T), np.array([module.rhs(0.0, x) for x in states]).T
    assert (together == alone).all()
    assert (np.signbit(together) == np.signbit(alone)).all()


def test_rows_that_vanish_at_a_parameter_count_as_closed() -> None:
    """Their terms are 0 too, so that nothing is rounded."""
    model = four_bars_in_a_row(5)
    m = eg.Model("bars", gravity=(0, -9.81, 0))
    m.parameter("h", 0.0)
    rod: dict[str, Any] = {"mass": 1.0, "inertia": (0.01, 0.08, 0.08)}
    cranks = [m.body(f"crank{k}", com=(0, 0.5, 0), **rod) for k in range(6)]
    for k, crank in enumerate(cranks):
        m.revolute(f"A{k}", m.ground.at(k, 0, 0), crank)
        m.guess(**{f"A{k}": 0.3})
    for k in range(5):
        coupler = m.body(f"coupler{k}", com=(0.5, 0, 0), **rod)
        m.revolute(f"B{k}", cranks[k].at(0, 1, 0), coupler)
        m.guess(**{f"B{k}": -0.3})
        m.revolute(f"C{k}", coupler.at(1, 0, "h"), cranks[k + 1].at(0, 1, 0))
    for one in (model, m):
        block = {b.name: b for b in pipeline.build(one.derive(), "c", ["rhs"]).blocks}["closing"]
        at = {f"{name}{k}": angle for name, angle in (("A", 0.3), ("B", -0.3)) for k in range(6)}
        assert evaluate(list(block.guards), at | {"h": 0.0, "t": 0.0}) == [0.0]
        assert evaluate(list(block.guards), at | {"h": 1e-9, "t": 0.0, "A2": 0.4}) == [1.0]


def test_next_to_change_points_the_usual_form_decides() -> None:
    """A row of parallelograms that turns is flat twice in each turn."""
    beside, found = Beside(n_four_bar(6)), []
    for x in beside.module.simulate((0.0, 1.0), t_eval=np.linspace(0.0, 1.0, 401), rtol=1e-8, atol=1e-10).x.T:
        x = beside.module.project(x)
        found.append((beside.weakest(x[: beside.n_q]), beside.evaluate("regular_dynamics", x)[2 * beside.n]))
        assert not found[-1][1] or beside.evaluate("dynamics", x)[2 * beside.n + 1] == 1.0
    assert min(found)[0] < 0.1 * NEAR
    assert not any(sound for weakest, sound in found if weakest < 0.1 * NEAR)
    assert all(sound for weakest, sound in found if weakest > NEAR)


def test_small_mechanisms_and_those_that_it_does_not_shorten_have_the_usual_form_alone() -> None:
    for model in (eg.load_example("four_bar"), eg.load_example("delta_robot"), closed_chain(20, True, True)):
        names = {b.name for b in pipeline.build(model.derive(), "c", ["rhs"]).blocks}
        assert names >= set(USUAL)
        assert names.isdisjoint(REGULAR)


@pytest.mark.parametrize("name", ["hand of three parallel fingers", "excavator"])
def test_the_compiled_function_is_that_of_numpy_at_any_distance(name: str) -> None:
    """Also where one form hands over to the other; lanes have the bits of single states."""
    equations = MODELS[name]().derive()
    module = equations.compile(lanes=4, kernels=KERNELS)
    numbers = equations.compile(target="numpy", kernels=KERNELS)
    rng, states = np.random.default_rng(6), []
    for far in (0.0, 1e-9, 1e-6, NEARBY, 2 * NEARBY, 1e-4, 1e-3, 1e-2):
        for _ in range(4):
            x = module.x0()
            x[: module.n_q] += 0.1 * rng.uniform(-1, 1, module.n_q)
            x = module.project(x)
            x[: module.n_q] += far * rng.uniform(-1, 1, module.n_q)
            x[module.n_q :] = rng.uniform(-1, 1, module.n_v)
            states.append(x)
            expected = numbers.rhs(0.0, x)
            np.testing.assert_allclose(module.rhs(0.0, x), expected, rtol=0, atol=1e-11 * np.abs(expected).max())
    together = module.rhs(0.0, np.array(states).T)
    assert (together == np.array([module.rhs(0.0, x) for x in states]).T).all()


def four_bars(n: int, moving: bool) -> eg.Model:
    """Planar four-bars on one another, modelled in space: some rows of each say what the joints say already."""
    m = eg.Model("four_bars", gravity=(0, -9.81, 0))
    dz, tilt = (m.parameter(name, 0.0) for name in ("dz", "tilt"))
    base = m.ground
    for k in range(n):
        left, right, coupler = (
            m.body(f"{name}{k}", mass=1.0, com=(0.15, 0, 0), inertia=(0.01, 0.01, 0.02)) for name in "abc"
        )
        m.revolute(f"ja{k}", base, left, coordinate=f"al{k}")
        m.revolute(f"jb{k}", base.at(0.5, 0, 0), right, coordinate=f"be{k}")
        m.revolute(f"jc{k}", left.at(0.3, 0, 0), coupler, coordinate=f"ga{k}")
        off = coupler.at(0.35, 0, dz, rpy=(tilt, 0, 0)) if k == 0 else coupler.at(0.35, 0, 0)
        m.revolute(f"jd{k}", off, right.at(0.28, 0, 0))
        m.guess(**{f"al{k}": 1.3, f"be{k}": 1.8, f"ga{k}": -1.2})
        if k or not moving:
            m.initial(**{f"al{k}": 1.3})
        base = coupler
    if moving:
        m.parameter("speed", 0.0)
        m.driver("first", "al0", "1.3 + 0.2*t + 0.1*t**2")
        m.driver("second", "al0", "1.3 + (0.2 + speed)*t + 0.1*t**2")
    return m


@pytest.mark.parametrize("moving", [False, True])
def test_redundant_rows_that_contradict_each_other_are_told(moving: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(straight_loops, "SAVED", 10.0)
    module = four_bars(5, moving).compile(kernels=(*KERNELS, "alignment"))
    assert module.metadata["operations"].get("regular_closing"), "the shorter form is not tried here"
    time = 0.3 if moving else 0.0
    x = module.x0()
    if moving:
        x[: module.n_q] = module.project(x, time)[: module.n_q]
    assert np.isfinite(module.rhs(time, x)).all()
    cases = {"speed": (1e-8, 1e-3, 0.1)} if moving else {"dz": (1e-9, 1e-3, 0.1), "tilt": (1e-8, 1e-2)}
    for name, value in ((name, value) for name, values in cases.items() for value in values):
        with pytest.raises(eg.ProjectionError):
            module.rhs(time, x, p={name: value})


def parallelograms(n: int) -> eg.Model:
    """On one another; where all are flat, at angles of 0, independent angles are chosen that determine nothing else."""
    m = eg.Model("parallelograms", gravity=(0, -9.81, 0))
    length, width, dz = (m.parameter(*one) for one in (("length", 0.3), ("width", 0.4), ("dz", 0.0)))
    base = m.ground
    for k in range(n):
        inertia = (0.01, 0.01, 0.02)
        left = m.body(f"left{k}", mass=1.0 + 0.1 * k, com=(0.15, 0, 0), inertia=inertia)
        right = m.body(f"right{k}", mass=1.2, com=(0.15, 0, 0), inertia=inertia)
        coupler = m.body(f"coupler{k}", mass=0.7, com=(0.2, 0.02, 0), inertia=inertia)
        m.revolute(f"ja{k}", base, left, coordinate=f"al{k}")
        m.revolute(f"jb{k}", base.at(width, 0, 0), right, coordinate=f"be{k}")
        m.revolute(f"jc{k}", left.at(length, 0, 0), coupler, coordinate=f"ga{k}")
        m.revolute(f"jd{k}", coupler.at(width, 0, dz if k == 0 else 0), right.at(length, 0, 0))
        base = coupler
    return m


def test_pivots_of_rounding_alone_do_not_count_as_sound() -> None:
    equations = parallelograms(4).derive()
    module, pivoting = equations.compile(kernels=["rhs"]), equations.compile(target="numpy")
    n = module.n_q
    x = np.zeros(2 * n)
    for i, name in enumerate(module.q_names):
        angle = 0.5 + 0.3 * int(name[-1])
        x[i] = -angle if name.startswith("ga") else angle
    assert np.abs(pivoting.constraints(x[:n])).max() < 1e-14
    dependent = [i for i in range(n) if i not in module.metadata["independent"]]
    columns = np.asarray(pivoting.constraint_jacobian(x[:n]))[:, dependent]
    assert np.linalg.svd(columns, compute_uv=False)[-1] < 1e-12, "this choice is meant to fail"
    expected = pivoting.rhs(0.0, x)
    np.testing.assert_allclose(module.rhs(0.0, x), expected, rtol=0, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize(("number", "row"), [(40, regular_loops.ROW), (10, 0)], ids=["columns", "rows"])
def test_many_loops_in_a_row_are_sound_away_from_change_points(
    number: int, row: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Told by the columns of every loop, or by rows where columns would be compared with more others than ROW."""
    monkeypatch.setattr(regular_loops, "ROW", row)
    beside = Beside(four_bars_in_a_row(number))
    n = beside.n

    def state(angle: float) -> np.ndarray:
        signs = np.array([1.0 if name[0] == "A" else -1.0 for name in beside.module.q_names])
        return np.concatenate([angle * signs, 0.7 * signs])

    found, usual = (beside.evaluate(name, state(0.3)) for name in ("regular_dynamics", "dynamics"))
    assert found[2 * n] == 1.0
    np.testing.assert_allclose(found[: 2 * n], usual[: 2 * n], rtol=0, atol=1e-12 * np.abs(usual).max())
    assert beside.evaluate("regular_closing", state(0.3))[2] <= NEARBY
    for flat in (0.5 * np.pi, 0.5 * np.pi - 0.01, 0.01 - 0.5 * np.pi):  # cranks along the ground: rows depend there
        assert beside.evaluate("regular_dynamics", state(flat))[2 * n] != 1.0
