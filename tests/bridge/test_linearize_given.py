"""Models with given rates near a state: against SymPy's own Linearizer, and the published bicycle."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from bicycle_matrix import state_matrix
from sympy.physics.mechanics import dynamicsymbols
from sympy_systems import rolling_disc

import eomgen as eg
from eomgen.describe import Description

NUMBERS = {"g": 9.81, "r": 0.26, "m": 3.43}


def sympy_matrix(kane: object, steady: dict[str, float]) -> np.ndarray:
    """A of SymPy's Linearizer in q1 .. q5, u1 .. u3 at a steady motion."""
    t = dynamicsymbols._t
    names = [*(f"q{k}" for k in range(1, 6)), *(f"u{k}" for k in range(1, 6))]
    symbols = {name: dynamicsymbols(name) for name in names}
    point = {symbols[name]: steady.get(name, 0.0) for name in names}
    point |= {symbols[name].diff(t): 0 for name in names if name.startswith("u")}
    point |= {symbols[name].diff(t): steady.get(name + "_dot", 0.0) for name in names if name.startswith("q")}
    numbers = {sp.Symbol(name): value for name, value in NUMBERS.items()}
    A, _, _ = kane.linearize(A_and_B=True, op_point=[point, numbers])  # type: ignore[attr-defined]
    return np.array(A.subs(numbers), dtype=float)


def test_the_rolling_disc_as_sympy_linearizes_it() -> None:
    kane = rolling_disc("CRAMER")
    mod = eg.from_sympy(kane, "disc", parameters=NUMBERS).compile(target="numpy")
    x = mod.x0(u2=-6.0)
    state = dict(zip(mod.x_names, x.tolist(), strict=True))
    rates = dict(zip((f"{n}_dot" for n in mod.q_names), mod.rhs(0.0, x)[: mod.n_q].tolist(), strict=True))
    near = mod.linearize(x, independent=["q1", "q2", "q3", "q4", "q5", "u1", "u2", "u3"])
    assert near.states == ("q1", "q2", "q3", "q4", "q5", "u1", "u2", "u3")
    assert near.is_steady
    assert not near.is_equilibrium
    expected = sympy_matrix(kane, state | rates)
    assert np.abs(expected).max() > 1.0
    np.testing.assert_allclose(near.A, expected, atol=1e-10)
    with pytest.raises(eg.UsageError, match="no second-order form"):
        near.second_order()


@pytest.mark.slow
def test_the_bicycle_as_published(whipple: eg.Model) -> None:
    """SymPy, test_kane3.py: A in the independent coordinates, the others following the constraints."""
    mod = whipple.compile(target="numpy")
    for v in (0.0, 3.0, 5.0):
        x = mod.x0(q1=0.0, q2=0.0, q5=0.0, u2=0.0, u5=0.0, u3=v / 0.3)
        near = mod.linearize(x, independent=["q1", "q2", "q5", "u2", "u3", "u5"])
        chosen = [near.states.index(name) for name in ("q2", "q5", "u2", "u5")]
        np.testing.assert_allclose(near.A[np.ix_(chosen, chosen)], state_matrix(v), atol=1e-9)


def tied(**more: object) -> eg.Model:
    """Three coordinates and four velocities under a moving surface and a moving blade."""
    equations = {
        "coordinates": ["a", "b", "c"],
        "velocities": ["r", "v", "s", "z"],
        "rates": {"a": "w*cos(c)*r + 0.1*sin(t)", "b": "v + r*sin(a)", "c": "s + 0.2*b"},
        "mass_matrix": [[2, 0.1, 0, 0], [0.1, "1 + b**2", 0, 0], [0, 0, "w", 0.3], [0, 0, 0.3, 1]],
        "forcing": ["-4*a - r*v", "-b + s*z", "sin(t) - c", "-0.1*z + r*s"],
        "constraints": ["a**2 + b - 0.3*c - 0.1*t - 0.5", "z - 0.2*s*cos(a) - 0.1*t"],
        "kinetic_energy": "r**2",
    }
    model = eg.Model.from_description(Description(values={"name": "tied", "equations": equations | more}))
    model.parameter("w", 1.3)
    return model


def test_directions_stay_on_moving_constraints_and_carry_the_rates() -> None:
    mod, t, h = tied().compile(target="numpy"), 0.3, 1e-5
    x = mod.project(np.array([0.4, 0.5, 0.1, 0.3, -0.2, 0.6, 0.1]), t=t)
    near = mod.linearize(x, t)
    assert near.tangent is not None
    assert len(near.states) == 2 + mod.n_dof
    T, chosen = near.tangent.T, [mod.x_names.index(name) for name in near.states]
    np.testing.assert_allclose(T[chosen], np.eye(len(chosen)), atol=1e-12)
    for k, column in enumerate(T.T):
        ahead, behind = near.x + h * column, near.x - h * column
        assert np.abs(mod.constraints(ahead[:3], t=t) - mod.constraints(behind[:3], t=t)).max() <= 1e-12
        rows = [mod.kernels.state("velocity_constraints")(side, t=t) for side in (ahead, behind)]
        assert np.abs(rows[0] - rows[1]).max() <= 1e-12
        slope = (mod.rhs(t, ahead) - mod.rhs(t, behind))[chosen] / (2 * h)
        np.testing.assert_allclose(near.A[:, k], slope, atol=1e-7)
    with pytest.raises(eg.UsageError, match="jacobian"):
        mod.linearize(x, t, form="full")
    with pytest.raises(eg.UsageError, match="must name 2 different ones of a, b, c"):
        mod.linearize(x, t, independent=["a"])


def test_inputs_beside_given_rates_are_refused_by_name() -> None:
    model = tied(forcing=["push - 4*a - r*v", "-b + s*z", "sin(t) - c", "-0.1*z + r*s"])
    model.input("push")
    mod = model.compile(target="numpy")
    with pytest.raises(eg.UsageError, match=r"derivatives by the inputs \(push\)"):
        mod.linearize(np.array([0.4, 0.5, 0.1, 0.3, -0.2, 0.6, 0.1]))
