"""Static equilibria: published, closed forms, minima by SciPy; stiff, weak, moving and nonholonomic ones; stability."""

from collections import Counter
from typing import Any

import models
import numpy as np
import pytest
import scipy.optimize
from analysed import compiled
from refusals import refused, refuses

import eomgen as eg


def test_the_iftomm_four_bar() -> None:
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


@pytest.mark.parametrize("guess", [{"psi": 9.0}, {"psi": -6.0}, {"bend": -9.0}, {"bend": 4.5}, {"corner": 7.5}])
def test_no_link_is_turned_right_round(guess: dict[str, float]) -> None:
    """In a parallelogram both cranks have the same angle and the coupler none."""
    mod = compiled("spring_four_bar")
    found = mod.equilibrium(guess)
    np.testing.assert_allclose([found["psi"], -found["bend"], found["corner"]], found["phi"], rtol=0, atol=1e-9)
    np.testing.assert_allclose(mod.x0(phi=found["phi"])[:3], found.q, rtol=0, atol=1e-9)


def test_turns_of_a_guess_in_another_assembly_mode_stay() -> None:
    mod = compiled("spring_four_bar")
    for turns in (-1.0, 0.0, 1.0):
        for guess in mod.branches(phi=0.3 + 2.0 * np.pi * turns):
            rest = mod.equilibrium(guess).q
            np.testing.assert_allclose(rest, guess, rtol=0, atol=3.0)
            np.testing.assert_allclose(mod.equilibrium(rest).q, rest, rtol=0, atol=1e-9)


def energy(phi: float, free: float) -> float:
    """Potential of the four-bar, from the reference's formula."""
    return float(2 * 9.81 * np.sin(phi) + 12.5 * (2 * np.cos(phi / 2) - free) ** 2)


def test_a_spring_preload() -> None:
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


def test_a_chain_between_two_walls_is_a_minimum_of_the_potential() -> None:
    """Six bars hung at both ends, the first one held aside: SciPy minimizes the height under constraints."""
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


def test_newton_that_stalls_goes_downhill() -> None:
    """From 0.3 rad the slider-crank's force has a minimum that is no zero on the way."""
    mod = compiled("slider_crank")
    found = mod.equilibrium()
    assert np.abs(mod.rhs(0.0, found.x)).max() < 1e-8
    assert found.stability == "stable (undamped)"
    x = [mod.x0(theta=found["theta"] + d) for d in (-1e-3, 0.0, 1e-3)]
    V = [mod.energy(state)[1] for state in x]
    assert V[1] < min(V[0], V[2])


@pytest.mark.quick
def test_nothing_balances() -> None:
    m = eg.Model("fall", gravity=(0, -9.81, 0))
    body = m.body("body", mass=2.0)
    m.prismatic("s", m.ground, body, axis="y")
    m.prismatic("r", body, m.body("other", mass=1.0), axis="x")
    mod = m.compile(target="numpy")
    with refused("EG-NO-EQUILIBRIUM -29.43 0") as failure:
        mod.equilibrium()
    assert failure.value.forces == {"s": pytest.approx(-29.43), "r": 0.0}
    assert mod.equilibrium(hold=["s"]).supports == {"s": pytest.approx(29.43)}


def test_what_equilibria_refuse() -> None:
    mod = compiled("spring_four_bar")
    for options, message in (
        ({"guess": {"phii": 1.0}}, "EG-NAME-UNKNOWN phi?"),
        ({"guess": {"phi_dot": 1.0}}, "EG-REFERENCE coordinates"),
        ({"hold": {"phi_dot": 1.0}}, "EG-REFERENCE rates"),
        ({"hold": ["phii"]}, "EG-NAME-UNKNOWN phi?"),
        ({"unknowns": ["L1"]}, "EG-NAME-UNKNOWN L0"),
        ({"guess": [1.0]}, "EG-SHAPE coordinates"),
        ({"hold": {"phi": 2.0, "psi": 2.0}, "unknowns": ["L0"]}, "EG-SHAPE unknowns 2"),
    ):
        refuses(message, mod.equilibrium, **options)
    refuses("EG-NAME-UNKNOWN 'pin_x' output", compiled("slider_crank").equilibrium, hold={"pin_x": 0.1})


def test_rotations_and_rolling() -> None:
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


def test_an_elastic_pendulum_of_any_stiffness_from_any_angle() -> None:
    """Hanging: y = -(1 + m g/k), frequencies sqrt(k/m) and sqrt(g/l); standing: 1 - m g/k, unstable."""
    m = eg.Model("p", gravity=(0, -9.81, 0))
    slide, bob = m.body("c", mass=0), m.body("b", mass=1)
    m.parameter("k", 1e5)
    m.prismatic("X", m.ground, slide, axis="x", coordinate="x")
    m.prismatic("Y", slide, bob, axis="y", coordinate="y")
    m.spring("s", m.ground, bob, stiffness="k", length=1)
    mod = m.compile(target="numpy")
    for k in (1e2, 1e5, 1e10):
        for angle in (0.05, 1.5, 3.1):
            found = mod.equilibrium({"x": np.sin(angle), "y": -np.cos(angle)}, p={"k": k})
            below = found["y"] < 0.0
            assert found["x"] == pytest.approx(0.0, abs=1e-11)
            assert found["y"] == pytest.approx(-1 - 9.81 / k if below else 1 - 9.81 / k, abs=1e-12)
            assert found.stability == ("stable (undamped)" if below else "unstable")
            assert below or angle > 1.5
            assert found.linear.is_equilibrium
            assert np.abs(list(found.forces.values())).max() < 4e-16 * k + 1e-12


def test_a_hanging_body_with_a_free_rotor_is_never_called_unstable() -> None:
    """Two neutral motions are double zeros with one eigenvector each, which rounding splits by its root, 5e-8."""
    m = eg.Model("hang", gravity=(0, -9.80665, 0))
    b = m.body("b", mass=3.8, com=(0.125, 0, 0), inertia=(0.0012, 0.02, 0.02))
    m.spherical("S", m.ground, b, rotation="euler_parameters")
    rotor = m.body("r", mass=12.1, inertia=(0.015, 0.048, 0.048))
    m.revolute("R", b.at(0.25, 0, 0, rpy=(0, np.pi / 4, 0)), rotor, axis="x")
    mod, rng, seen = m.compile(target="numpy"), np.random.default_rng(0), Counter[tuple[bool, str]]()
    for _ in range(24):
        q = rng.normal(size=4)
        q /= np.linalg.norm(q)
        found = mod.equilibrium({f"S_e{i}": q[i] for i in range(4)})
        seen[bool(mod.poses(found.q)[0, 1, 0] > 0.0), found.stability] += 1  # its x axis, with the masses, upwards
        spun = np.array(found.x)
        spun[mod.x_names.index("R_dot")] = 1e-3  # slowly, so that it decides nothing
        assert mod.linearize(spun).stability == found.stability
    assert set(seen) == {(False, "marginal"), (True, "unstable")}
    assert min(seen.values()) > 4


@pytest.mark.parametrize("free", [False, True])
def test_damping_makes_a_rest_asymptotically_stable_unless_something_is_free(free: bool) -> None:
    m = eg.Model("damped", gravity=(0, -9.81, 0))
    bob = m.body("bob", mass=1, com=(0, -1, 0), inertia={"zz": 0.1})
    m.revolute("A", m.ground, bob, coordinate="a")
    m.revolute("B", bob, m.body("wheel", mass=1, inertia={"zz": 0.2}), coordinate="b")
    m.actuator("drag", "A", "-0.3*a_dot")
    if not free:
        m.actuator("hold", "B", "-2*b - 0.1*b_dot")
    mod = m.compile(target="numpy")
    assert mod.equilibrium({"a": 0.4}).stability == ("marginal" if free else "asymptotically stable")
    assert mod.linearize(mod.x0(a=np.pi)).stability == "unstable"


def maxwell(method: str = "auto", flow: str = "s_dot - 15*(x1 - s)") -> Any:
    """A mass on a spring beside a spring and a damper in series, whose inner length s follows s' = 15 (x1 - s)."""
    m = eg.Model("maxwell")
    m.parameter("F", 0.0)
    m.prismatic("X", m.ground, m.body("b", mass=1), axis="x", coordinate="x1")
    m.prismatic("S", m.ground, m.body("dummy", mass=1), axis="x", coordinate="s")
    m.actuator("springs", "X", "F - 10*x1 - 30*(x1 - s)")
    m.coupling("flow", equation=flow)
    m.initial(x1=0.3, s=0.1)
    return m.compile(method=method, target="numpy")


@pytest.mark.parametrize("method", ["embedding", "lagrange", "augmented"])
def test_the_inner_length_of_a_maxwell_element_comes_to_rest_too(method: str) -> None:
    """10 x1 = F and s = x1; d'Alembert: the multiplier of the row acts on s alone."""
    mod = maxwell(method)
    for F in (0.0, 7.0):
        found = mod.equilibrium(p={"F": F})
        np.testing.assert_allclose(found.x, [F / 10, F / 10, 0, 0], atol=1e-13)
        linear = found.linear
        assert linear.is_equilibrium
        np.testing.assert_allclose(linear.drift, 0, atol=1e-13)
        # s' = 15 (x1 - s), x1'' = -40 x1 + 30 s: l^3 + 15 l^2 + 40 l + 150 = 0
        expected = np.sort_complex(np.roots([1, 15, 40, 150]))
        np.testing.assert_allclose(np.sort_complex(found.eigenvalues), expected, rtol=1e-12)
        assert found.stability == "asymptotically stable"
        run = found.module.simulate(5, initial=found.x)
        np.testing.assert_allclose(run["x1"], F / 10, atol=1e-9)
        np.testing.assert_allclose(run["s"], F / 10, atol=1e-9)


def test_a_row_that_never_rests_is_refused() -> None:
    mod = maxwell(flow="s_dot - 3 - x1**2")
    refuses("EG-NO-EQUILIBRIUM 3", mod.equilibrium)


@pytest.mark.parametrize(("stiffness", "mass"), [(1e8, 1e-6), (1e10, 1e-8)])
def test_slow_motions_beside_stiff_ones_are_seen(stiffness: float, mass: float) -> None:
    """A pendulum of length 1 and a tiny mass on a stiff spring, which have nothing to do with each other."""
    m = eg.Model("beside", gravity=(0, -9.81, 0))
    bob, tiny = m.body("bob", mass=1.0, com=(0, -1, 0)), m.body("tiny", mass=mass)
    m.prismatic("s", m.ground, tiny, axis="x")
    m.spring("k", m.ground.at(-1, 0, 0), tiny, stiffness=stiffness, length=1.0)
    m.revolute("R", m.ground, bob, coordinate="th")
    mod = m.compile(target="numpy")
    slow, fast = np.sqrt(9.81), np.sqrt(stiffness / mass)
    hanging, upright = mod.x0(th=0.0, s=0.0), mod.x0(th=np.pi, s=0.0)
    modes = mod.modes(hanging)
    np.testing.assert_allclose(modes.frequencies, [slow, fast], rtol=1e-9, atol=0)
    assert (modes.rigid, modes.diverging) == (0, 0)
    assert mod.linearize(hanging).stability == "stable (undamped)"
    lost = mod.modes(upright)
    assert (lost.rigid, lost.diverging) == (0, 1)
    assert mod.linearize(upright).stability == "unstable"


@pytest.mark.parametrize("g", [1e-5, 1e-11])
def test_weak_gravity_is_gravity(g: float) -> None:
    fall = eg.Model("fall", gravity=(0, -g, 0))
    fall.prismatic("y", fall.ground, fall.body("b", mass=2.0), axis="y")
    refuses("EG-NO-EQUILIBRIUM equilibrium", lambda: fall.compile(target="numpy").equilibrium())
    m = eg.Model("pendulum", gravity=(0, -g, 0))
    m.revolute("R", m.ground, m.body("b", mass=2.0, com=(0, -1, 0)), coordinate="th")
    mod = m.compile(target="numpy")
    rest = mod.equilibrium({"th": 0.7})
    assert rest["th"] == pytest.approx(0.0, abs=1e-9)
    assert rest.linear.is_equilibrium
    np.testing.assert_allclose(np.abs(rest.eigenvalues), np.sqrt(g), rtol=1e-9)
    assert (rest.stability, mod.linearize(mod.x0(th=np.pi)).stability) == ("stable (undamped)", "unstable")
    assert not mod.linearize(mod.x0(th=0.3)).is_equilibrium
    refuses("EG-UNSUPPORTED equilibrium", lambda: mod.modes(mod.x0(th=0.3)))


def pair(**keys: str) -> eg.Model:
    """Two sliders on springs of 10 N/m, coupled, and 1 N on the first."""
    m = eg.Model("pair", gravity=(0, 0, 0))
    for name, mass in (("a", 1.0), ("b", 2.0)):
        m.prismatic(name.upper(), m.ground, m.body(name, mass=mass), axis="x", coordinate=name + "_s")
        m.joint_spring(f"k_{name}", joint=name.upper(), stiffness=10)
    m.torque("push", "A", "1")
    m.coupling("c", {"a_s": 1, "b_s": -1}, **keys)
    return m


@pytest.mark.parametrize("call", ["equilibrium", "modes", "linearize"])
def test_what_is_closed_is_refused(call: str) -> None:
    module = pair(opens="100 - t").compile(target="numpy")
    refuses("EG-UNAVAILABLE pair c", lambda: getattr(module, call)())


def test_the_remedies_of_the_message() -> None:
    open_, for_good = pair(opens="100 - t").compile(target="numpy"), pair().compile(target="numpy")
    assert open_.equilibrium({"c_closed": 0}).x[:2] == pytest.approx([0.1, 0.0], abs=1e-10)
    assert pair(closes="1 - t").compile(target="numpy").equilibrium().x[:2] == pytest.approx([0.1, 0.0], abs=1e-10)
    assert for_good.equilibrium().x[:2] == pytest.approx([0.05, 0.05], abs=1e-10)
    assert for_good.modes().frequencies == pytest.approx([np.sqrt(20 / 3)], rel=1e-9)


def test_an_unknown_parameter_far_from_the_guess_is_found() -> None:
    """Two of some 230 such searches end only by Gauss-Newton steps on the rows of balance."""
    m = eg.Model("chain", gravity=(0, -9.81, 0))
    k, length, place = m.parameter("k", 173.243), m.parameter("l0", 0.634), m.ground
    for i in range(3):
        body = m.body(f"b{i}", mass=1.0, com=(0.25, 0, 0), inertia={"zz": 0.02})
        m.revolute(f"q{i}", place if i == 0 else place.at(0.5, 0, 0), body)
        place = body
    m.spring("s", m.ground.at(1, 0.7, 0), place.at(0.3, 0, 0), stiffness=k, length=length)
    m.spring("s2", m.ground.at(-0.4, 0.9, 0), place.at(0.1, 0, 0), stiffness=5, length=0.5)
    m.stop("st", "q2", law={"stiffness": 200}, lower=-1, upper=1)
    guess = {"q0": -2.439, "q2": -2.214}
    found = m.compile(target="numpy").equilibrium(guess, hold={"q1": -2.474}, unknowns=["l0"])
    assert found["l0"] == pytest.approx(1.33746, abs=1e-5)
    assert found["q0"] == pytest.approx(-1.2475, abs=1e-4)
