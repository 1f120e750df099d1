"""States of pairs in groups of contacts: names and numbers, laws, derivatives, order, several sides, rest on slopes."""

from typing import Any

import contact_scenes as scenes
import numpy as np
import pytest
from contact_scenes import PLANAR, on
from force_judges import differences
from refusals import refuses

import eomgen as eg

LUGRE = {
    "stiffness": 1e5, "exponent": 1.0, "friction": 0.3, "friction_law": "lugre",
    "bristle_stiffness": 1e3, "bristle_damping": 30.0,
}  # fmt: skip


def pair(first: dict[str, Any], second: dict[str, Any], swapped: bool = False, **law: Any) -> eg.Model:
    m, (a, b) = scenes.planar("pair", 2, (0, 0, 0))
    groups = [on(first, a), on(second, b)]
    m.contacts("touch", *(groups[::-1] if swapped else groups), {**LUGRE, **law})
    return m


@pytest.mark.parametrize(("kind", "corners"), [("circle", 1), ("box", 2), ("polygon", 2), ("segment", 4)])
def test_one_pair_has_one_set_of_states(kind: str, corners: int) -> None:
    """Of circles one; of polygons both ends of the edges that face each other; of segments each end with the other."""
    names = pair(PLANAR[kind], PLANAR[kind]).compile(target="numpy").x_names[12:]
    wanted = [f"touch_bristle_{axis}_{k + 1}" for k in range(corners) for axis in "xz"]
    assert list(names) == wanted


def test_bristles_take_nothing_from_the_energy_of_the_contact() -> None:
    """k d^(n+1) / (n+1) of a circle in a half-plane."""
    m, (body,) = scenes.planar("one", 1, (0, 0, 0))
    law = {**LUGRE, "exponent": 1.5}
    m.contacts("touch", {"shape": "circle", "on": body, "radius": 0.1}, {"shape": "half_plane", "on": m.ground}, law)
    mod = m.compile(target="numpy")
    assert mod.energy(mod.x0(j0_y=0.09))[1] == pytest.approx(1e5 * 0.01**2.5 / 2.5, rel=1e-12)
    assert mod.energy(mod.x0(j0_y=0.11))[1] == 0.0


@pytest.mark.parametrize(
    ("kinds", "target"),
    [(("box", "box"), "numpy"), pytest.param(("segment", "polygon"), "cython", marks=pytest.mark.thorough)],
    ids=["boxes", "compiled"],
)
def test_derivatives_by_states_and_of_their_rates(kinds: tuple[str, str], target: str) -> None:
    mod = pair(PLANAR[kinds[0]], PLANAR[kinds[1]]).compile(target=target)
    rng, met = np.random.default_rng(4), 0
    for _ in range(60):
        x = np.concatenate(
            [rng.uniform(-0.15, 0.15, 6), rng.standard_normal(6), 1e-4 * rng.standard_normal(mod.n_x - 12)]
        )
        rates = mod.rhs(0.0, x)
        if not np.abs(rates[6:12]).max():
            continue
        found, wanted = mod.jacobian(0.0, x), differences(mod, x)
        if np.abs(wanted - differences(mod, x, 2e-7)).max() > 1e-5 * np.abs(wanted).max():
            continue  # at a kink
        met += 1
        np.testing.assert_allclose(found, wanted, rtol=1e-5, atol=1e-6 * np.abs(wanted).max())
        assert np.abs(found[6:12, 12:]).max() > 0
        if met == 5:
            return
    raise AssertionError("too few met")


def test_bristles_act_as_one_law_says() -> None:
    """A circle that slides on a box: z' and the force in closed form; an untouched bristle springs back."""
    mod = pair(PLANAR["box"], PLANAR["circle"]).compile(target="numpy")
    names = list(mod.x_names)
    R, size = PLANAR["circle"]["radius"], PLANAR["box"]["size"]
    depth, v, z = 1e-3, 0.02, 1e-4
    x = mod.x0(j1_y=size[1] / 2 + R - depth, j1_x_dot=v)
    place = names.index("touch_bristle_x_1")
    root = np.sqrt(1e3 * 1e5 * depth)  # of the stiffness of the bristles
    x[place] = root * z
    rates = mod.rhs(0.0, x)
    change = v - 1e3 * v / 0.3 * z
    assert rates[place] == pytest.approx(root * change, rel=1e-12)
    mass_force = -mod.bias(0.0, x)[:12]
    assert abs(mass_force[3]) == pytest.approx(1e5 * depth * (1e3 * z + 30.0 * change), rel=1e-12)
    x = mod.x0(j1_y=1.0, j1_x_dot=v)
    x[place] = z
    assert mod.rhs(0.0, x)[place] == pytest.approx(-1e3 / 30.0 * z, rel=1e-12)


def test_order_of_groups_and_one_state_along_the_surface() -> None:
    values = []
    for swapped in (False, True):
        for lateral in (True, False):
            m = pair(PLANAR["box"], PLANAR["circle"], swapped, lateral=lateral)
            mod = m.compile(target="numpy")
            x = mod.x0(j1_x=0.03, j1_y=0.14, j1_x_dot=0.3, j1_3_dot=1.0)
            along = 12
            assert mod.x_names[along] == ("touch_bristle_x_1" if lateral else "touch_bristle_1")
            x[along] = 2e-4
            values.append(mod.rhs(0.0, x)[:12])
    assert np.abs(values[0]).max() > 1.0
    for other in values[1:]:
        np.testing.assert_allclose(other, values[0], rtol=1e-12, atol=1e-12)


TROUGH = np.array([[-1.0, 1.0], [-0.05, 0.0], [0.05, 0.0], [1.0, 0.7]])
WHEEL = 0.2


def in_trough() -> eg.Model:
    m, (a,) = scenes.planar("trough", 1, (0, 0, 0))
    valley = {"shape": "profile", "points": TROUGH.tolist(), "on": m.ground}
    m.contacts("touch", valley, {"shape": "circle", "on": a, "radius": WHEEL}, {**LUGRE, "lateral": False})
    return m


def flanks(place: np.ndarray) -> list[tuple[np.ndarray, np.ndarray, float]]:
    """Direction, normal and penetration of a circle at both sides of the trough."""
    found = []
    for a, b in ((TROUGH[0], TROUGH[1]), (TROUGH[2], TROUGH[3])):
        t = (b - a) / np.linalg.norm(b - a)
        n = np.array([-t[1], t[0]])
        found.append((t, n, WHEEL - n @ (place - a)))
    return found


def test_a_wheel_between_two_sides_bends_one_state_by_both() -> None:
    """A wheel that bridges the floor: e' has the power of both sides, and their mean decay by normal forces.

    It decays faster where the damping of one side gives more than that.
    """
    mod = in_trough().compile(target="numpy")
    rng, both, faster = np.random.default_rng(2), 0, 0
    mass = np.linalg.inv(mod.mass_matrix(np.array([0.0, 2.0, 0.0])))
    for _ in range(200):
        place = np.array([rng.uniform(-0.01, 0.03), rng.uniform(0.2, 0.22)])
        sides = flanks(place)
        if min(depth for *_, depth in sides) <= 0 or place[1] < WHEEL:
            continue
        both += 1
        v, turn, e = rng.standard_normal(2), rng.standard_normal(), 0.1 * rng.standard_normal()
        x = mod.x0(j0_x=place[0], j0_y=place[1], j0_x_dot=v[0], j0_y_dot=v[1], j0_3_dot=turn)
        x[6] = e
        force, drive, decay, load, needed = np.zeros(3), 0.0, 0.0, 0.0, 0.0
        for t, n, depth in sides:
            arm = -(WHEEL - 0.5 * depth)
            slip = t @ v - arm * turn
            push = 1e5 * depth
            m = min(np.sqrt(1e3 * push), 0.3 * push / abs(e))
            own = 1e3 * abs(slip) / 0.3
            damped = 30.0 / 1e3 * (m * slip - own * e)
            gain = -m * damped * slip / e**2
            drag = -m * (e + damped * min(1.0, own / gain if gain > 0 else 1.0))
            drive, decay, load = drive + m * slip, decay + push * own, load + push
            needed += max(0.0, min(gain, own))
            force += [*(1e5 * depth * n + drag * t), -arm * drag]
        found = mod.rhs(0.0, x)
        faster += needed > decay / load
        assert found[6] == pytest.approx(drive - max(decay / load, needed) * e, rel=1e-9, abs=1e-12)
        np.testing.assert_allclose(found[3:6], mass @ force, rtol=1e-9, atol=1e-8 * np.abs(force).max())
    assert both > 20
    assert 0 < faster < both


def test_lateral_belongs_to_states() -> None:
    m, (a,) = scenes.planar("road", 1)
    ground = {"shape": "half_plane", "on": m.ground}
    law = {"stiffness": 1e5, "lateral": False}
    m.contacts("touch", {"shape": "circle", "on": a, "radius": 0.1}, ground, law)
    refuses("EG-CONFLICT contacts.touch.law.lateral: lugre", m.derive)


def test_too_many_pairs_with_states_are_refused() -> None:
    m, (a, b) = scenes.planar("crowd", 2)
    groups = [{"shape": "circle", "on": [body.at(k, 0, 0) for k in range(45)], "radius": 0.1} for body in (a, b)]
    m.contacts("touch", *groups, LUGRE)
    refuses("EG-TOO-LARGE contacts.touch 2025 2000", m.derive)
