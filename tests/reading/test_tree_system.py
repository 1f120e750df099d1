"""The parts of large equations of loops: with the constraints they give the accelerations of the compiled module."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy
from shown_numbers import evaluate, random_state, state_values
from sympy.core.function import AppliedUndef

import eomgen as eg
from eomgen.reading.printed_equations import PrintedEquations
from eomgen.reading.printed_parts import PrintedGroup, PrintedParts
from eomgen.reading.tree_system import TreeSystem

EXAMPLES = Path(__file__).parents[2] / "examples"
LONG = ["bicycle", "delta_robot", "double_wishbone", "excavator", "andrews_squeezer", "watt_six_bar"]


def numbers(named: Any, system: TreeSystem, values: dict[str, float]) -> list[np.ndarray]:
    """M_t, f_t, C and gamma at a state."""
    flat = [x for matrix in system[:4] for x in matrix]
    found = iter(evaluate(named, flat, values))
    return [np.array([next(found) for _ in matrix]).reshape(matrix.shape) for matrix in system[:4]]


@pytest.mark.parametrize("name", LONG)
def test_parts_give_the_accelerations_of_the_module(name: str) -> None:
    equations = eg.load(EXAMPLES / f"{name}.yaml").derive()
    module: Any = equations.compile("numpy")
    state = random_state(module, 5)
    named, system = equations.written("tree_system")
    mass, force, jacobian, gamma = numbers(named, system, state_values(module, state, 0.0))
    n_v, n_c = len(mass), len(jacobian)
    whole = np.block([[mass, -jacobian.T], [jacobian, np.zeros((n_c, n_c))]])
    solved = np.linalg.lstsq(whole, np.concatenate([force[:, 0], -gamma[:, 0]]), rcond=1e-12)[0][:n_v]
    expected = module.rhs(0.0, state)[module.n_q :]
    if system.zeros:  # where 0 stands for the heading, the others are those of a turned ground
        free = module.metadata["independent"]
        solved, expected = solved[free], expected[free]
    np.testing.assert_allclose(solved, expected, rtol=1e-7, atol=1e-7 * np.abs(expected).max())


@pytest.mark.parametrize("name", LONG)
def test_groups_can_be_read_in_their_order(name: str) -> None:
    equations = eg.load(EXAMPLES / f"{name}.yaml").derive()
    printed = PrintedEquations(equations)
    assert printed.of_loops
    groups = [item for item in PrintedParts(printed).items() if isinstance(item, PrintedGroup)]
    told = [str(line.left.name) for group in groups for line in group.lines if hasattr(line.left, "name")]
    assert sorted(told) == sorted(str(symbol) for symbol, _ in printed.named)
    place = {name: k for k, name in enumerate(told)}
    for symbol, x in printed.named:
        assert all(place[str(s)] < place[str(symbol)] for s in x.free_symbols if str(s) in place)


def test_contacts_beside_a_loop_are_shown_as_functions() -> None:
    """Whether coordinates are idle is tried on arrays of states, where what pairs give together is no number."""
    m = eg.Model("beside", gravity=(0, 0, -9.81))
    bodies = [m.body(name, mass=1.0, com=(0.1, 0.02, 0), inertia=(0.1, 0.2, 0.3)) for name in ("a", "b", "c", "ball")]
    a, b, c, ball = bodies
    m.revolute("A", m.ground, a, axis="y", coordinate="th")
    m.revolute("B", a.at(0.4, 0, 0), b, axis="y")
    m.revolute("C", b.at(0.9, 0, 0), c, axis="y")
    m.prismatic("P", m.ground.at(0, 0, 0.05), c, axis="x", coordinate="s")
    m.free("fly", m.ground, ball, rotation="euler_parameters")
    floor = {"shape": "half_space", "on": m.ground}
    m.contacts("floor", {"shape": "sphere", "on": ball, "radius": 0.1}, floor, stiffness=1e4)
    m.guess(B=0.5, s=1.2)
    m.initial(th=-0.4, fly_z=2.0)
    equations = m.derive()
    assert "floor" in equations._repr_html_()
    named, system = equations.written("tree_system")
    assert "fly_z" not in system.zeros  # though nothing touches near the start
    pairs = [f for _, x in named for f in x.atoms(AppliedUndef)]
    assert any("fly_z" in str(f.args) for f in pairs)

    def in_air(x: Any) -> Any:
        return x.replace(lambda f: isinstance(f, AppliedUndef), lambda _: sympy.S.Zero)

    named = [(name, in_air(x)) for name, x in named]
    system = system._replace(**{key: getattr(system, key).applyfunc(in_air) for key in system._fields[:4]})
    module: Any = equations.compile("numpy")
    state = module.x0(th_dot=2.0, fly_wx=1.0, fly_wy=-2.0, fly_wz=0.5)
    mass, force, jacobian, gamma = numbers(named, system, state_values(module, state, 0.0))
    whole = np.block([[mass, -jacobian.T], [jacobian, np.zeros((len(jacobian), len(jacobian)))]])
    solved = np.linalg.solve(whole, np.concatenate([force[:, 0], -gamma[:, 0]]))[: len(mass)]
    np.testing.assert_allclose(solved, module.rhs(0.0, state)[module.n_q :], rtol=1e-9, atol=1e-9)


LOADS = ("-where(x_far > 5, 100*(x_far - 5), 0)", "-100*max(x_far - 5, 0)", "-100*abs(x_far - 5)*(x_far > 5)")


@pytest.mark.parametrize("load", LOADS)
def test_what_acts_far_away_is_shown(load: str) -> None:
    """A slide whose place matters beyond 5 m alone is not as one whose place does not matter."""
    m = eg.load(EXAMPLES / "watt_six_bar.yaml")
    block = m.body("block", mass=1.0)
    m.prismatic("far", m.ground, block, axis="x", coordinate="x_far")
    assert m.derive().tree_system.zeros == ("x_far",)
    m.force("pull", block, value=(load, 0, 0))
    system = m.derive().tree_system
    assert system.zeros == ()
    shown = [x for x in system.force if sympy.Symbol("x_far") in x.free_symbols]
    assert [float(x.subs("x_far", place)) for x in shown for place in (0.0, 5.5)] == [0.0, -50.0]
