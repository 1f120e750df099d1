"""States that are none: Euler parameters of no rotation, entries that are no numbers; every method and target."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from sweeps import part_of

import eomgen as eg
from eomgen.equations import METHODS

TARGETS = ("cython", "numpy")
KERNELS = ["rhs", "jacobian", "project", "constraints", "constraint_jacobian", "velocity_constraints"]


def stone() -> eg.Model:
    """Of no rotation its accelerations do not depend on its attitude at all."""
    m = eg.Model("stone")
    m.free("f", m.ground, m.body("b", mass=2.0, inertia=(1, 2, 3)), rotation="euler_parameters")
    return m


def beads() -> eg.Model:
    """Too large for a written-out factorisation; the last ball carries a body whose centre is its joint."""
    m = eg.Model("beads", gravity=(0, 0, -9.81))
    last: Any = m.ground
    for k in range(9):
        rod = m.body(f"rod{k}", mass=0.5, com=(0.2 if k < 8 else 0, 0, 0), inertia=(1e-2, 2e-2, 3e-2))
        m.spherical("f" if k == 8 else f"s{k}", last, rod, rotation="euler_parameters")
        last = rod.at(0.4, 0, 0)
    return m


def beside_a_loop() -> eg.Model:
    """A free body that has nothing to do with the loop of a four-bar."""
    m = stone()
    last: Any = m.ground
    for name, length in (("A", 0.1), ("B", 0.3), ("C", 0.25)):
        rod = m.body(f"rod_{name}", mass=1.0, com=(length / 2, 0, 0), inertia=(0, 0, 1e-3))
        m.revolute(name, last, rod)
        last = rod.at(length, 0, 0)
    m.revolute("D", last, m.ground.at(0.3, 0, 0))
    m.initial(A=1.0)
    m.guess(B=-0.8, C=-1.5)
    return m


CASES = [(stone, method) for method in sorted(METHODS)] + [(beads, "recursive"), (beads, "embedding")]
CASES += [(beside_a_loop, "embedding"), (beside_a_loop, "lagrange")]


@pytest.fixture(
    scope="module",
    params=part_of(
        [((t, *c),) for t in TARGETS for c in CASES],
        lambda p: p[0] == "numpy" or p[1] is beside_a_loop or p[2] in ("augmented", "newton_euler"),
    ),
    ids=lambda p: f"{p[0]}-{p[1].__name__}-{p[2]}",
)
def module(request: pytest.FixtureRequest) -> Any:
    target, make, method = request.param
    return make().compile(method=method, target=target, kernels=KERNELS)


def test_no_rotation_is_a_named_error(module: Any) -> None:
    x = module.x0(f_wx=1.0)
    first = module.q_names.index("f_e0")
    for size in (0.0, 1e-170):
        x[first : first + 4] = size
        for call in (module.rhs, module.jacobian, lambda t, x: module.project(x)):
            with pytest.raises(eg.NonFiniteError, match=r"f_e0 .. f_e3 are all zero; .*f_e0 = 1") as caught:
                call(0.0, x)
            assert "mass matrix" not in str(caught.value)
    x[first : first + 4] = [1e-30, 0, 0, 0]  # of any length but zero
    module.rhs(0.0, x)
    batch = np.stack([x, x], axis=1)
    batch[first, 1] = 0.0
    with pytest.raises(eg.NonFiniteError, match="f_e0 .. f_e3 are all zero"):
        module.rhs(0.0, batch)


def test_entries_that_are_no_numbers_are_named(module: Any) -> None:
    start = module.x0(f_wx=1.0)
    for name in ("f_e2", "f_wy"):
        for value in (np.nan, np.inf):
            x = np.array(start)
            x[module.x_names.index(name)] = value
            for call in (module.rhs, module.jacobian):
                with pytest.raises(eg.EvaluationError, match=rf"{name} already is not; check the state given"):
                    call(0.0, x)


def test_a_run_from_no_number_is_a_named_error() -> None:
    module = stone().compile(kernels=["rhs", "project"])
    x = module.x0()
    x[0] = np.nan  # no acceleration depends on it
    with pytest.raises(eg.EomgenError, match="f_x"):
        module.simulate(1.0, initial=x)
