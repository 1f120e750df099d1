"""The two-link manipulator's equations, raised to SymPy, are symbolically those of the book.

Source: tests/reference/two_link_manipulator.json (Shabana, Computational Dynamics, section 1.4, eqs 1.1 to 1.3, and
Lagrange's equations written out), in absolute angles th2, th3; the example's joints give th2 and bend = th3 - th2.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import models
import numpy as np
import pytest
import sympy

import eomgen as eg
from eomgen.graph.sympy_raise import raise_inline
from eomgen.program.collect import resolved_outputs

REFERENCE = models.reference("two_link_manipulator")
th2, th3, w2, w3, a2, a3 = sympy.symbols("th2 th3 w2 w3 a2 a3")
# relative coordinates of the example in terms of the book's absolute ones
ABSOLUTE = {
    "th2": th2,
    "bend": th3 - th2,
    "th2_dot": w2,
    "bend_dot": w3 - w2,
    "th2_ddot": a2,
    "bend_ddot": a3 - a2,
}
CHANGE = sympy.Matrix([[1, 0], [-1, 1]])  # [th2, bend]' = CHANGE [th2, th3]'
METHODS = ["embedding", "lagrange"]


def book(name: str) -> sympy.Matrix:
    return sympy.Matrix(sympy.S(REFERENCE[name]))


def absolute(expression: Any) -> Any:
    return expression.subs({sympy.Symbol(k): v for k, v in ABSOLUTE.items()}, simultaneous=True)


def equal(ours: sympy.Matrix, theirs: sympy.Matrix) -> bool:
    return sympy.simplify(ours - theirs) == sympy.zeros(*theirs.shape)


@pytest.mark.parametrize("method", METHODS)
def test_equations_after_the_change_of_coordinates(equations: Callable[..., Any], method: str) -> None:
    eqs = equations("two_link_manipulator", method)
    assert [str(q) for q in eqs.q] == ["th2", "bend"]
    assert equal(CHANGE.T * absolute(eqs.mass_matrix) * CHANGE, book("mass_matrix"))
    assert equal(CHANGE.T * absolute(eqs.force), book("force"))


def test_equations_from_the_lagrangian_in_absolute_angles() -> None:
    l2, c2, c3, m2, m3, I2, I3, g, tau2, tau3 = sympy.symbols("l2 c2 c3 m2 m3 I2 I3 g tau2 tau3")
    r2, r3 = sympy.symbols("th2_dot th3_dot")
    T = (I2 + m2 * c2**2 + m3 * l2**2) * r2**2 / 2 + (I3 + m3 * c3**2) * r3**2 / 2
    T += m3 * l2 * c3 * sympy.cos(th2 - th3) * r2 * r3
    V = (m2 * c2 + m3 * l2) * g * sympy.sin(th2) + m3 * g * c3 * sympy.sin(th3)
    model = eg.Model.from_lagrangian(
        "book", T - V, [th2, th3], forces={th2: tau2 - tau3, th3: tau3}, inputs={tau2: 0, tau3: 0}
    )
    eqs = model.derive()
    rates = {r2: w2, r3: w3}
    assert equal(eqs.mass_matrix.subs(rates), book("mass_matrix"))
    assert equal(eqs.force.subs(rates), book("force"))


@pytest.mark.parametrize("method", METHODS)
def test_the_end_effector_moves_as_in_the_book(equations: Callable[..., Any], method: str) -> None:
    eqs = equations("two_link_manipulator", method)
    names = [output.name for output in eqs.kinematics.mechanism.outputs]
    raised = dict(zip(names, raise_inline(resolved_outputs(eqs.kinematics, eqs.tree)), strict=True))
    for level, letter in (("position", "r"), ("velocity", "v"), ("acceleration", "a")):
        for axis in "xy":
            difference = absolute(raised[f"{letter}_{axis}"]) - sympy.S(REFERENCE[level][f"r{axis}"])
            assert sympy.simplify(difference) == 0, (level, axis)


@pytest.mark.parametrize("method", METHODS)
def test_compiled_outputs_equal_the_book(module: Callable[..., Any], method: str) -> None:
    mod = module("two_link_manipulator", method)
    values = dict(zip(mod.p_names, mod.p, strict=True))
    random = np.random.default_rng(1)
    for _ in range(5):
        x, u = random.uniform(-2, 2, 4), random.uniform(-3, 3, 2)
        a = mod.rhs(0.0, x, u=u)[2:]
        state = dict(zip(mod.q_names, x, strict=False)) | dict(zip(mod.v_names, x[2:], strict=True))
        turns = {th2: state["th2"], th3: state["th2"] + state["bend"]}
        turns |= {w2: state["th2_dot"], w3: state["th2_dot"] + state["bend_dot"]}
        turns |= {a2: a[mod.q_names.index("th2")], a3: a.sum()}
        numbers = turns | {sympy.Symbol(k): v for k, v in (values | dict(zip(mod.u_names, u, strict=True))).items()}
        y = dict(zip(mod.y_names, mod.outputs(0.0, x, u=u), strict=True))
        for level, letter in (("position", "r"), ("velocity", "v"), ("acceleration", "a")):
            for axis in "xy":
                expected = float(sympy.S(REFERENCE[level][f"r{axis}"]).subs(numbers))
                assert abs(y[f"{letter}_{axis}"] - expected) <= 1e-12 * max(1.0, abs(expected))
        # the accelerations themselves satisfy the book's equations
        mass = np.array(book("mass_matrix").subs(numbers), dtype=float)
        force = np.array(book("force").subs(numbers), dtype=float)[:, 0]
        found = mass @ [numbers[a2], numbers[a3]]
        assert np.abs(found - force).max() <= 1e-12 * max(1.0, np.abs(force).max())
