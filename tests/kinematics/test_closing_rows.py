"""Rows of cut joints by the twists of their chains, and gamma by the motion of their ends, against differentiation.

The other side is the derivative of the equations themselves in the expression graph, which knows no twists, and central
differences of C along a motion in numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import eomgen as eg
from eomgen.graph.count import count
from eomgen.graph.evaluate import compile_evaluator
from eomgen.kinematics import Kinematics
from eomgen.kinematics.closing_gradients import shortest_rows, twist_rows
from eomgen.kinematics.closing_rates import end_gammas, shortest_gamma
from eomgen.program.collect import collect_terms


def chain(n: int, last: str, **options: Any) -> eg.Model:
    """Links on hinges across each other, the last held on ground by a joint of any type; none to be cut but that."""
    m = eg.Model("chain", gravity=(0, 0, -9.81))
    above: Any = m.ground
    for k in range(n):
        link = m.body(f"b{k}", mass=1.0, com=(0.1, 0.02, 0), inertia=(0.01, 0.02, 0.03))
        m.revolute(f"j{k}", above, link, axis=((0, 0, 1), (0.6, 0.8, 0), (0, 1, 0))[k % 3], coordinate=f"angle{k}")
        m.guess(**{f"angle{k}": 0.4 - 0.1 * k})
        above = link.at(0.3, 0.05 * (k % 2), 0.02, rpy=(0.2, 0.1 * k, -0.3))
    getattr(m, last)("closing", above, m.ground.at(0.4, 0.2, 0.1, rpy=(0.1, 0.2, 0.3)), **options)
    return m


def on_a_floating_body() -> eg.Model:
    """A loop that hangs on a body in Euler parameters, so that its base moves."""
    m = eg.Model("floating", gravity=(0, 0, -9.81))
    base = m.body("base", mass=5.0, inertia=(0.4, 0.5, 0.6))
    m.free("root", m.ground, base, rotation="euler_parameters")
    ends = []
    for side in range(2):
        above: Any = base.at(0.2 * side, 0.1, 0)
        for k in range(2):
            link = m.body(f"b{side}{k}", mass=1.0, com=(0.1, 0, 0), inertia=(0.01, 0.02, 0.03))
            name = f"j{side}{k}"
            if k:
                m.revolute(name, above, link, axis="y", coordinate=f"turn{side}")
            else:
                m.spherical(name, above, link, rotation="euler_parameters")
            above = link.at(0.3, 0.1, 0.05)
        ends.append(above)
    m.spherical("closing", *ends)
    return m


CASES: dict[str, Callable[[], eg.Model]] = {
    "spherical": lambda: chain(6, "spherical"),
    "revolute": lambda: chain(7, "revolute"),
    "universal": lambda: chain(6, "universal"),
    "cylindrical": lambda: chain(6, "cylindrical"),
    "prismatic": lambda: chain(7, "prismatic", axis="x"),
    "planar joint": lambda: chain(5, "planar"),
    "floating": on_a_floating_body,
    "delta robot": lambda: eg.load_example("delta_robot"),
    "double wishbone": lambda: eg.load_example("double_wishbone"),
    "bricard": lambda: eg.load_example("bricard"),
    "spatial slider-crank": lambda: eg.load_example("spatial_slider_crank"),
    "Stewart platform": lambda: eg.load_example("stewart_platform"),
}


def kinematics_of(name: str) -> Kinematics:
    from eomgen.kinematics import analyse

    return analyse(CASES[name]().mechanism())


def numbers(kinematics: Kinematics, seed: int) -> tuple[Callable[..., np.ndarray], np.ndarray, np.ndarray]:
    """Evaluates expressions at (q, v); positions off the constraints, and velocities."""
    random = np.random.default_rng(seed)
    given = {p.name: p.value or 0.7 for p in kinematics.mechanism.parameters}
    inputs = [0.3] * len(kinematics.input_names)
    names = (*kinematics.names, *kinematics.velocity_names, *given, *kinematics.input_names, "t")
    q, v = random.uniform(-1, 1, len(kinematics.names)), random.uniform(-2, 2, len(kinematics.v))
    for slot in kinematics.quaternion_slots:
        q[slot.coordinate : slot.coordinate + 4] /= np.linalg.norm(q[slot.coordinate : slot.coordinate + 4])

    def evaluate(outputs: Any, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        call = compile_evaluator(list(outputs), names)
        return np.array(call([*map(float, q), *map(float, v), *given.values(), *inputs, 0.2]), dtype=float)

    return evaluate, q, v


@pytest.mark.parametrize("name", CASES)
def test_rows_by_twists_are_the_derivatives_of_the_equations(name: str) -> None:
    kinematics = kinematics_of(name)
    c = kinematics.constraints
    found = {label: row for k in kinematics.topology.cut for label, row in twist_rows(kinematics, k).items()}
    assert found
    for seed in range(3):
        evaluate, q, v = numbers(kinematics, seed)
        for label, row in zip(c.labels, c.jacobian, strict=True):
            if label in found:
                expected = evaluate(row, q, v)
                size = max(1.0, np.abs(expected).max())
                np.testing.assert_allclose(evaluate(found[label], q, v), expected, rtol=0, atol=1e-14 * size)


@pytest.mark.parametrize("name", CASES)
def test_gamma_by_the_motion_of_the_ends_is_the_second_derivative(name: str) -> None:
    kinematics = kinematics_of(name)
    c = kinematics.constraints
    found = end_gammas(kinematics)
    assert found
    for seed in range(3):
        evaluate, q, v = numbers(kinematics, seed)
        expected = dict(zip(c.labels, evaluate(c.gamma, q, v), strict=True))
        size = max(1.0, max(map(abs, expected.values())))
        got = dict(zip(found, evaluate(found.values(), q, v), strict=True))
        for label in expected.keys() & got.keys():
            assert abs(got[label] - expected[label]) <= 1e-14 * size


@pytest.mark.parametrize("name", ["revolute", "universal", "cylindrical", "prismatic"])
def test_both_against_central_differences_of_the_equations(name: str) -> None:
    """Along straight lines in the coordinates, whose rates are the velocities: C' = C_q v, C'' = gamma."""
    kinematics = kinematics_of(name)
    c = kinematics.constraints
    rows = {label: row for k in kinematics.topology.cut for label, row in twist_rows(kinematics, k).items()}
    gammas = end_gammas(kinematics)
    evaluate, q, v = numbers(kinematics, 5)
    h = 1e-3
    C = {k: evaluate(c.values, q + k * h * v, v) for k in range(-3, 4)}
    first = (C[3] - 9 * C[2] + 45 * C[1] - 45 * C[-1] + 9 * C[-2] - C[-3]) / (60 * h)
    second = (2 * C[3] - 27 * C[2] + 270 * C[1] - 490 * C[0] + 270 * C[-1] - 27 * C[-2] + 2 * C[-3]) / (180 * h * h)
    for label, slope, bent in zip(c.labels, first, second, strict=True):
        assert abs(evaluate(rows[label], q, v) @ v - slope) < 1e-10 * max(1.0, abs(slope))
        assert abs(evaluate([gammas[label]], q, v)[0] - bent) < 1e-7 * max(1.0, abs(bent))


def test_the_shorter_of_both_is_taken() -> None:
    long = kinematics_of("revolute")
    c = long.constraints
    rows, gamma = shortest_rows(long), shortest_gamma(long)
    assert rows != c.jacobian
    assert gamma != c.gamma
    assert 2 * count([x for row in rows for x in row]).total < count([x for row in c.jacobian for x in row]).total
    platform = kinematics_of("Stewart platform")
    assert shortest_rows(platform) == platform.constraints.jacobian
    flat = eg.load_example("four_bar").derive()
    terms = collect_terms(flat.kinematics, flat.mobility, flat.tree)
    assert terms.constraint_jacobian == flat.kinematics.constraints.jacobian
    assert terms.gamma == flat.kinematics.constraints.gamma
