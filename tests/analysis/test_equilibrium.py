"""Static equilibria: published, closed forms, minima of the potential found by SciPy; preload; supports; failures."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import models
import numpy as np
import pytest
import scipy.optimize

import eomgen as eg

Compiled = Callable[..., Any]


def test_the_iftomm_four_bar(compiled: Compiled) -> None:
    given = models.reference("iftomm_fourbar_diagonal_spring")["reference"]
    found = compiled("spring_four_bar").equilibrium({"phi": 2.0})
    assert found["phi"] == pytest.approx(float(given["phi_eq"]), abs=1e-12)
    assert found["corner"] == pytest.approx(found["phi"], abs=1e-10)  # a cut joint's coordinate can be read
    assert found.stability == "asymptotically stable"
    assert max(map(abs, found.forces.values())) < 1e-10
    expected = [complex(text.replace(" ", "")) for text in given["eig"]]
    np.testing.assert_allclose(np.sort_complex(found.eigenvalues), np.sort_complex(expected), rtol=1e-9)
    upright = compiled("spring_four_bar").equilibrium({"phi": 1.4})
    assert upright["phi"] == pytest.approx(np.pi / 2, abs=1e-9)
    assert upright.stability == "unstable"


def energy(phi: float, free: float) -> float:
    """Potential of the four-bar, from the reference's formula."""
    return float(2 * 9.81 * np.sin(phi) + 12.5 * (2 * np.cos(phi / 2) - free) ** 2)


def test_a_spring_preload(compiled: Compiled) -> None:
    """The free length that balances a prescribed position makes the potential stationary there."""
    mod = compiled("spring_four_bar")
    for hold in ({"phi": 2.4}, {"corner": 2.4}):
        found = mod.equilibrium(hold=hold, unknowns=["L0"])
        assert found["phi"] == pytest.approx(2.4, abs=1e-9)

        def slope(free: float) -> float:
            return (energy(2.4 + 1e-6, free) - energy(2.4 - 1e-6, free)) / 2e-6

        assert found["L0"] == pytest.approx(scipy.optimize.brentq(slope, 0.1, 3.0), rel=1e-8)
        assert found.module.p[mod.p_names.index("L0")] == found["L0"]
        assert found.module.linearize(found.x).is_equilibrium
        assert found.supports == {}


def test_a_length_that_moves_the_loop_too(compiled: Compiled) -> None:
    """A parameter that is in the constraints: the length of the rod at which the crank rests; and a plain torque."""
    mod = compiled("slider_crank")
    for hold in ({"theta": 0.4}, {"C": -0.15}):
        for unknown in ("l", "tau"):
            found = mod.equilibrium({"theta": 0.4}, hold=hold, unknowns=[unknown])
            name, value = next(iter(hold.items()))
            assert found[name] == pytest.approx(value, abs=1e-9)
            assert np.abs(found.module.rhs(0.0, found.x)).max() < 1e-7
            again = found.module.equilibrium(found.q)
            assert again["theta"] == pytest.approx(found["theta"], abs=1e-9)
            assert again.stability == found.stability


def test_what_is_held_is_supported(compiled: Compiled) -> None:
    mod = compiled("spring_four_bar")
    slope = (energy(2.0 + 1e-6, np.sqrt(2)) - energy(2.0 - 1e-6, np.sqrt(2))) / 2e-6
    found = mod.equilibrium(hold={"phi": 2.0})
    assert found.supports == {"phi": pytest.approx(slope, rel=1e-8)}
    corner = mod.equilibrium(hold={"corner": 2.0})
    assert corner.supports == {"corner": pytest.approx(slope, rel=1e-8)}  # a parallelogram: the same angle


def test_a_chain_between_two_walls_is_a_minimum_of_the_potential() -> None:
    """Six bars hung at both ends, the first one held aside: SciPy minimises the height under constraints."""
    m = eg.Model("catenary", gravity=(0, -9.81, 0))
    previous = m.ground
    for k in range(6):
        bar = m.body(f"bar{k}", mass=1.0, com=(0.1, 0, 0), inertia={"zz": 0.01 / 3})
        m.revolute(f"q{k}", previous, bar)
        previous = bar.at(0.2, 0, 0)
    m.revolute("end", previous, m.ground.at(0.9, 0.1, 0))
    m.guess(q0=-1.0, q1=0.4, q2=0.4, q3=0.4, q4=0.4, q5=0.4)
    mod = m.compile(target="numpy")
    found = mod.equilibrium()

    def ends(a: np.ndarray) -> np.ndarray:
        return np.array([0.2 * np.cos(a).sum() - 0.9, 0.2 * np.sin(a).sum() - 0.1])

    def height(a: np.ndarray) -> float:
        return float((np.concatenate([[0], np.cumsum(0.2 * np.sin(a))[:-1]]) + 0.1 * np.sin(a)).sum())

    start = np.linspace(-1.0, 1.0, 6)
    best = scipy.optimize.minimize(
        height, start, method="SLSQP", options={"ftol": 1e-15, "maxiter": 500},
        constraints=scipy.optimize.NonlinearConstraint(ends, 0, 0),
    )  # fmt: skip
    angles = np.cumsum([found[f"q{k}"] for k in range(6)])
    np.testing.assert_allclose(np.cos(angles), np.cos(best.x), atol=1e-5)
    np.testing.assert_allclose(np.sin(angles), np.sin(best.x), atol=1e-5)
    assert found.stability == "stable (undamped)"
    assert np.abs(found.eigenvalues.real).max() < 1e-8
    held = mod.equilibrium(found.q + 0.0, hold={"q0": float(found["q0"]) + 0.1})
    assert held["q0"] == pytest.approx(found["q0"] + 0.1, abs=1e-9)
    assert set(held.supports) == {"q0"}

    def bent(shift: float) -> float:  # the potential of the shape that hangs with the first bar held there
        at = scipy.optimize.NonlinearConstraint(lambda a: [*ends(a), a[0] - held["q0"] - shift], 0, 0)
        return 9.81 * float(
            scipy.optimize.minimize(height, np.cumsum([held[f"q{k}"] for k in range(6)]), method="SLSQP",
                                    constraints=at, options={"ftol": 1e-15, "maxiter": 500}).fun
        )  # fmt: skip

    slope = (bent(1e-3) - bent(-1e-3)) / 2e-3
    assert held.supports["q0"] == pytest.approx(slope, rel=1e-4)


def test_newton_that_stalls_goes_downhill(compiled: Compiled) -> None:
    """From 0.3 rad the slider-crank's force has a minimum that is no zero on the way."""
    mod = compiled("slider_crank")
    found = mod.equilibrium()
    assert np.abs(mod.rhs(0.0, found.x)).max() < 1e-8
    assert found.stability == "stable (undamped)"
    x = [mod.x0(theta=found["theta"] + d) for d in (-1e-3, 0.0, 1e-3)]
    V = [mod.energy(state)[1] for state in x]
    assert V[1] < min(V[0], V[2])


def test_nothing_balances() -> None:
    m = eg.Model("fall", gravity=(0, -9.81, 0))
    body = m.body("body", mass=2.0)
    m.prismatic("s", m.ground, body, axis="y")
    m.prismatic("r", body, m.body("other", mass=1.0), axis="x")
    mod = m.compile(target="numpy")
    with pytest.raises(eg.EquilibriumError, match=r"along s is still -29\.43 at s = 0") as failure:
        mod.equilibrium()
    assert failure.value.forces == {"s": pytest.approx(-29.43), "r": 0.0}
    assert mod.equilibrium(hold=["s"]).supports == {"s": pytest.approx(29.43)}


def test_mistakes(compiled: Compiled) -> None:
    mod = compiled("spring_four_bar")
    for options, message in (
        ({"guess": {"phii": 1.0}}, "did you mean phi"),
        ({"guess": {"phi_dot": 1.0}}, "name coordinates in it, not rates"),
        ({"hold": {"phi_dot": 1.0}}, "not rates"),
        ({"hold": ["phii"]}, "did you mean phi"),
        ({"unknowns": ["L1"]}, "L0"),
        ({"guess": [1.0]}, "must name coordinates or have shape"),
        ({"hold": {"phi": 2.0, "psi": 2.0}, "unknowns": ["L0"]}, "2 held coordinates need 2 unknowns"),
    ):
        with pytest.raises(eg.UsageError, match=message):
            mod.equilibrium(**options)


def test_rotations_and_rolling(compiled: Compiled) -> None:
    """Euler parameters keep their length; nonholonomic constraints leave room for displacements, not for forces."""
    top = compiled("top_parameters")
    found = top.equilibrium({"S_e0": 0.2, "S_e1": np.sqrt(0.96)})
    np.testing.assert_allclose(np.abs(found.q), [0, 1, 0, 0], atol=1e-9)
    assert found.stability == "marginal"
    disc = compiled("rolling_disc")
    upright = disc.equilibrium({"x": 0.3, "yaw": 0.2, "lean": 0.05})
    assert upright["lean"] == pytest.approx(0.0, abs=1e-9)
    assert upright["z"] == pytest.approx(0.5, abs=1e-9)
    assert upright.stability == "unstable"


def test_constraints_that_move_in_time() -> None:
    """Bead on a hoop turned at a given rate: cos(th) = g/(w^2 R), small motions at w sin(th) about it."""
    m = eg.Model("hoop", gravity=(0, 0, -9.81))
    R = m.parameter("R", 0.5)
    hoop, bead = m.body("hoop", mass=1.0, inertia=(0.1, 0.1, 0.1)), m.body("bead", mass=0.3, com=(0, 0, -R))
    m.revolute("A", m.ground, hoop, coordinate="phi")
    m.revolute("B", hoop, bead, axis="y", coordinate="th")
    m.coupling("turned", equation="phi - 6*t")
    mod = m.compile(target="numpy")
    found = mod.equilibrium({"th": 0.6}, t=0.2)
    assert found["th"] == pytest.approx(np.arccos(9.81 / (36 * 0.5)), abs=1e-10)
    assert found["phi"] == pytest.approx(1.2)
    assert found.x[2] == pytest.approx(6.0)
    modes = mod.modes(found.x, 0.2)
    np.testing.assert_allclose(modes.frequencies, 6 * np.sin(found["th"]), rtol=1e-10)
    other = mod.equilibrium(hold={"th": 1.1}, unknowns=["R"], t=0.2)
    assert other["R"] == pytest.approx(9.81 / (36 * np.cos(1.1)), rel=1e-9)


def test_a_ball_let_go_above_a_plane_comes_to_rest_on_it() -> None:
    """Nothing balances it at the start; on the plane K d^(3/2) = m g, small motions with 3/2 K d^(1/2) (Hertz)."""
    m = eg.Model("ball", gravity=(0, 0, -9.81))
    ball = m.body("ball", mass=1.0)
    m.prismatic("z", m.ground, ball, axis="z")
    m.sphere_plane("floor", m.ground, ball, radius=0.1, stiffness=1e5)
    m.initial(z=0.5)
    mod = m.compile(target="numpy")
    found, depth = mod.equilibrium(), (9.81 / 1e5) ** (2 / 3)
    assert found["z"] == pytest.approx(0.1 - depth, rel=1e-10)
    np.testing.assert_allclose(mod.modes().frequencies, np.sqrt(1.5e5 * np.sqrt(depth)), rtol=1e-9)
