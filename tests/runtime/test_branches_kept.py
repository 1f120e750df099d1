"""Initial values stay on the branch of the declared position: parallelograms past the flat position, and what warns."""

from __future__ import annotations

import models
import numpy as np
import pytest

import eomgen as eg


def parallelogram() -> eg.Model:
    m = eg.Model("parallelogram")
    one, bar, two = (m.body(name, mass=1, inertia={"zz": 1}) for name in ("one", "bar", "two"))
    m.revolute("A", m.ground, one, coordinate="theta")
    m.revolute("B", one.at(0.2, 0, 0), bar, coordinate="bend")
    m.revolute("C", bar.at(0.6, 0, 0), two.at(0.2, 0, 0))
    m.revolute("D", m.ground.at(0.6, 0, 0), two, coordinate="psi")
    m.initial(theta=0.5)
    m.guess(bend=-0.5, psi=0.5)
    return m


@pytest.fixture(scope="module")
def flat() -> eg.Module:
    return parallelogram().compile(target="numpy")


@pytest.mark.parametrize("angle", [-2.5, -0.4, 0.0, 1.0, np.pi, 4.0, 6.0, 9.0])
def test_a_parallelogram_stays_one_past_its_flat_positions(flat: eg.Module, angle: float) -> None:
    """Its cranks turn alike: theta = psi = -bend, whichever is given; the other branch has the bar turn as well."""
    expected = [angle, -angle, angle]
    for given in ({"theta": angle}, {"psi": angle}, {"bend": -angle}):
        np.testing.assert_allclose(flat.x0(given)[:3], expected, atol=1e-7, err_msg=str(given))
    q = flat.kinematics([angle])[0] if angle % np.pi else expected
    np.testing.assert_allclose(q, expected, atol=1e-9)


def test_a_batch_past_flat_positions_is_that_of_single_ones(flat: eg.Module) -> None:
    angles = np.random.default_rng(2).uniform(-8.0, 8.0, 40)
    q = flat.kinematics(angles[None, :])[0]
    np.testing.assert_allclose(q, [angles, -angles, angles], atol=1e-9)
    for k in (0, 7, 39):
        np.testing.assert_array_equal(flat.kinematics(angles[None, k : k + 1])[0][:, 0], q[:, k])


def test_leaving_the_branch_is_told() -> None:
    """A rocker beyond its dead centre: there is a position on another branch, which x0 does not take silently."""
    mod = models.build("four_bar").compile(target="numpy")
    psi = float(mod.x0()[mod.q_names.index("psi")]) - 3.0
    with pytest.warns(UserWarning, match=r"psi = .* cannot be reached .* on the same branch: .* blocked after"):
        x = mod.x0(psi=psi)
    assert np.abs(mod.constraints(x[: mod.n_q], rows="all")).max() < 1e-12
    assert mod.branch(x) == -1
    assert len(mod.branches(psi=psi)) >= 1  # a search, which warns of nothing


def test_a_held_rotation_keeps_its_values_to_rounding() -> None:
    m = eg.Model("rods", gravity=(0, 0, -9.81))
    crank, rod, rocker = (m.body(name, mass=1.0, inertia=(1e-3, 2e-3, 2e-3)) for name in ("crank", "rod", "rocker"))
    m.revolute("A", m.ground, crank, coordinate="th")
    m.spherical("S", crank.at(0.1, 0, 0), rod, rotation="euler_parameters")
    m.revolute("D", m.ground.at(0.4, 0.1, 0.05), rocker, axis="y", coordinate="ph")
    m.spherical("T", rod.at(0.4, 0, 0), rocker.at(0.25, 0, 0), rotation="euler_parameters")
    m.initial(th=0.3)
    mod = m.compile(target="numpy")
    x = mod.x0(th=0.6)
    given = {name: float(x[k]) for k, name in enumerate(mod.q_names) if name.startswith("S_e")}
    again = mod.x0(given)
    for name, value in given.items():
        assert again[mod.q_names.index(name)] == pytest.approx(value, abs=4e-16)  # they are brought to length 1
    np.testing.assert_allclose(again[: mod.n_q], x[: mod.n_q], atol=1e-9)


def test_drivers_that_turn_fast_are_followed_to_a_far_time() -> None:
    """125 turns to 1.25 s: the position repeats itself, on the same branch."""
    m = eg.Model("crank_rocker")
    one, bar, two = (m.body(name, mass=1, inertia={"zz": 1}) for name in ("one", "bar", "two"))
    m.revolute("A", m.ground, one, coordinate="theta")
    m.revolute("B", one.at(0.2, 0, 0), bar, coordinate="bend")
    m.revolute("C", bar.at(0.6, 0, 0), two.at(0.3, 0, 0))
    m.revolute("D", m.ground.at(0.6, 0, 0), two, coordinate="psi")
    m.driver("drive", "theta", "0.5 + 200*pi*t")
    m.guess(bend=-0.5, psi=0.9)
    mod = m.compile(target="numpy")
    turns = 250.0 * np.pi
    np.testing.assert_allclose(mod.x0(t=1.25)[:3] - mod.x0()[:3], [turns, -turns, 0.0], atol=1e-9)


def five_bar(**initial: float) -> eg.Module:
    """Two cranks of 0.3 on pivots 0.4 apart, rods of 0.5: two degrees of freedom, two branches."""
    m = eg.Model("five_bar")
    left, right, first, second = (
        m.body(name, mass=1, com=(0.1, 0, 0), inertia={"zz": 1}) for name in ("left", "right", "first", "second")
    )
    m.revolute("A", m.ground, left, coordinate="a")
    m.revolute("E", m.ground.at(0.4, 0, 0), right, coordinate="e")
    m.revolute("B", left.at(0.3, 0, 0), first)
    m.revolute("D", right.at(0.3, 0, 0), second)
    m.revolute("C", first.at(0.5, 0, 0), second.at(0.5, 0, 0))
    m.output("y", first.at(0.5, 0, 0).position[1])
    m.initial(**initial)
    return m.compile(target="numpy")


@pytest.mark.parametrize("initial", [{}, {"a": 1.8}, {"a": 1.8, "e": 1.0}])
@pytest.mark.parametrize("given", [{}, {"e": 1.1}])
def test_branches_hold_what_determines_a_position(initial: dict[str, float], given: dict[str, float]) -> None:
    """Values that leave freedom would be met by a continuum of positions."""
    mod = five_bar(**initial)
    found = mod.branches(given)
    assert len(found) == 2
    cranks = np.array([[q[mod.q_names.index(name)] for name in ("a", "e")] for q in found])
    np.testing.assert_allclose(cranks[1], cranks[0], atol=1e-12)
    a, e = cranks[0]
    B, D = (np.array([x + 0.3 * np.cos(turn), 0.3 * np.sin(turn)]) for x, turn in ((0.0, a), (0.4, e)))
    across = np.sqrt(0.25 - np.sum((D - B) ** 2) / 4) * np.array([-(D - B)[1], (D - B)[0]]) / np.linalg.norm(D - B)
    expected = sorted([((B + D) / 2 + across)[1], ((B + D) / 2 - across)[1]])
    heights = sorted(mod.outputs(0.0, np.r_[q, np.zeros(mod.n_x - mod.n_q)])[0] for q in found)
    np.testing.assert_allclose(heights, expected, atol=1e-9)
    assert all({"a": a, "e": e}[name] == pytest.approx(value) for name, value in given.items())


def test_values_that_say_more_than_a_position_needs_do_not_hide_a_branch() -> None:
    closed = five_bar(a=1.8, e=1.0)
    whole = dict(zip(closed.q_names, closed.x0(), strict=False))
    assert len(five_bar(**whole).branches()) == 2


def test_euler_angles_of_one_rotation_are_one_branch() -> None:
    """An arm and a plate held by balls and a rod: the rod's length is met at two angles of the plate."""
    m = eg.Model("held", gravity=(0, 0, -9.81))
    arm, plate = m.body("arm", mass=1, inertia=(1, 1, 1)), m.body("plate", mass=1, inertia=(1, 1, 1))
    m.revolute("hinge", m.ground, arm, axis="x", coordinate="theta")
    m.spherical("ball", arm.at(0, 0.4, 0), plate)
    m.spherical("top", m.ground.at(0, 0.4, 0.3), plate.at(0, 0, 0.3))
    m.distance("rod", m.ground.at(-0.12, 0, 0.1), plate.at(-0.12, 0, 0.1), length=0.4)
    mod = m.compile(target="numpy")
    found = mod.branches()
    poses = [mod.poses(q) for q in found]
    assert len(found) >= 2
    assert all(np.abs(one - other).max() > 1e-3 for k, one in enumerate(poses) for other in poses[:k])
