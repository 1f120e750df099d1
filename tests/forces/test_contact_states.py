"""States of pairs in groups of contacts: names and numbers, one pair alone, derivatives, order, targets, text."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import contact_scenes as scenes
import numpy as np
import pytest
from contact_scenes import PLANAR, on

import eomgen as eg
from eomgen.errors import ModelError
from eomgen.forces.contact_groups import _SharedData
from eomgen.forces.contact_shape_fields import GROUNDS, SHAPE_FIELDS
from eomgen.forces.contact_shape_fields import PLANAR as PLANE
from eomgen.forces.contact_states import BED, PARTS, STATELESS, ShapeParts, class_of, given_groups, pair_states, part_of
from eomgen.forces.contact_touch import MEETINGS, meet
from eomgen.generation import generate

LUGRE = {
    "stiffness": 1e5, "exponent": 1.0, "friction": 0.3, "friction_law": "lugre",
    "bristle_stiffness": 1e3, "bristle_damping": 30.0,
}  # fmt: skip


def pair(first: dict[str, Any], second: dict[str, Any], swapped: bool = False, **law: Any) -> eg.Model:
    m, (a, b) = scenes.planar("pair", 2, (0, 0, 0))
    groups = [on(first, a), on(second, b)]
    m.contacts("touch", *(groups[::-1] if swapped else groups), {**LUGRE, **law})
    return m


def differences(mod: Any, x: np.ndarray, step: float = 1e-7) -> np.ndarray:
    units = np.eye(len(x))
    return np.array([(mod.rhs(0.0, x + step * e) - mod.rhs(0.0, x - step * e)) / (2 * step) for e in units]).T


@pytest.mark.parametrize(("kind", "count"), [("circle", 1), ("box", 2), ("polygon", 2), ("segment", None)])
def test_one_pair_has_one_set_of_states(kind: str, count: int | None) -> None:
    """Of circles one; of polygons both ends of the edges that face each other; of segments each end with the other."""
    m = pair(PLANAR[kind], PLANAR[kind])
    names = [name for name in m.derive().compile(target="numpy").x_names if "bristle" in name]
    corners = {"circle": 1, "box": 2, "polygon": 2, "segment": 4}[kind]
    assert count in (None, corners)
    wanted = [f"touch_bristle_{axis}_{k + 1}" for k in range(corners) for axis in "xz"]
    assert names == wanted
    assert len(m.derive().compile(target="numpy").x_names) == 12 + 2 * corners


@pytest.mark.parametrize("target", ["numpy", "cython"])
@pytest.mark.parametrize("law", [{}, {"friction_law": "coulomb", "smoothing": 1e-3}], ids=["lugre", "coulomb"])
def test_bristles_take_nothing_from_the_energy_of_the_contact(law: dict[str, Any], target: str) -> None:
    """k d^(n+1) / (n+1) of a circle in a half-plane, with states or without."""
    m, (body,) = scenes.planar("one", 1, (0, 0, 0))
    given = {**{k: v for k, v in LUGRE.items() if not law or "bristle" not in k}, **law, "exponent": 1.5}
    m.contacts("touch", {"shape": "circle", "on": body, "radius": 0.1}, {"shape": "half_plane", "on": m.ground}, given)
    mod = m.compile(target=target)
    assert mod.energy(mod.x0(j0_y=0.09))[1] == pytest.approx(1e5 * 0.01**2.5 / 2.5, rel=1e-12)
    assert mod.energy(mod.x0(j0_y=0.11))[1] == 0.0


@pytest.mark.parametrize("target", ["numpy", "cython"])
@pytest.mark.parametrize("kinds", [("box", "circle"), ("box", "box"), ("segment", "polygon")], ids="-".join)
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


@pytest.mark.parametrize("method", ["lagrange", "newton_euler", "recursive"])
def test_methods_and_verify(method: str) -> None:
    m = pair(PLANAR["box"], PLANAR["circle"])
    a, b = m.compile(target="numpy"), m.compile(method=method, target="numpy")
    x = a.x0(j1_x=0.03, j1_y=0.14, j1_x_dot=0.3, touch_bristle_x_1=1e-4)
    np.testing.assert_allclose(b.rhs(0.0, x), a.rhs(0.0, x), rtol=1e-11, atol=1e-11)


def test_a_profile_shares_the_states_of_its_pieces() -> None:
    """A circle on a profile with corners of 180 degrees slides as on a half-plane."""
    mods = []
    for ground in (
        {"shape": "half_plane"},
        {"shape": "profile", "points": [[-2, 0], [-0.5, 0], [0.01, 0], [2, 0]]},
        {"shape": "smooth_profile", "points": [[-2, 0], [-0.5, 0], [0.01, 0], [2, 0]]},
    ):
        m, (a,) = scenes.planar("road", 1)
        m.contacts("touch", {**ground, "on": m.ground}, {"shape": "circle", "on": a, "radius": 0.1}, LUGRE)
        mods.append(m.compile(target="numpy"))
    for mod in mods:
        assert mod.n_x == 8
    for x0 in (0.0, 0.01, -0.499999999, 1.0):
        x = mods[0].x0(j0_x=x0, j0_y=0.099, j0_x_dot=0.1, touch_bristle_x_1=5e-5, touch_bristle_z_1=1e-5)
        values = [mod.rhs(0.0, x) for mod in mods]
        for other in values[1:]:
            np.testing.assert_allclose(other, values[0], rtol=1e-7, atol=1e-10)


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


def test_bristles_between_two_sides_stay_small() -> None:
    """A wheel pressed into a valley with a deflection of 1e-6 m: it does not grow, by any method."""
    m = eg.Model("v", gravity=(0, -9.81, 0))
    body = m.body("b", mass=1.0, inertia={"zz": 0.02})
    m.prismatic("j", m.ground, body, axis="y")
    valley = {"shape": "profile", "points": [[-1, 1], [-0.05, 0], [0.05, 0], [1, 1]], "on": m.ground}
    law = {**LUGRE, "dissipation": 1.0, "lateral": False}
    m.contacts("c", {"shape": "circle", "radius": 0.2, "on": body}, valley, law)
    mod = m.compile(target="numpy")
    for method in ("Radau", "DOP853"):
        traj = mod.simulate((0, 0.2), {"j": 0.2355, "c_bristle_1": 1e-6}, method=method)
        assert np.abs(traj["c_bristle_1"]).max() <= 1e-6


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_derivatives_between_two_sides(target: str) -> None:
    mod = in_trough().compile(target=target)
    for z in (2e-5, -1e-4):
        x = mod.x0(j0_x=0.012, j0_y=0.21, j0_3=0.2, j0_x_dot=0.3, j0_y_dot=-0.1, j0_3_dot=2.0)
        assert min(depth for *_, depth in flanks(x[:2])) > 1e-3
        x[6] = z
        wanted = differences(mod, x)
        np.testing.assert_allclose(mod.jacobian(0.0, x), wanted, rtol=1e-6, atol=1e-7 * np.abs(wanted).max())


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_a_roller_on_both_flanks_of_a_seat(target: str) -> None:
    """Wider than the seat it lies on both flanks, 65 degrees from the radius: each slides at v cos 65 degrees."""
    m, (a,) = scenes.planar("seat", 1, (0, 0, 0))
    wheel = {"shape": "sprocket", "teeth": 8, "pitch": 0.1, "seat": 0.02, "tip_radius": 0.15, "on": m.ground}
    m.contacts("touch", wheel, {"shape": "circle", "on": a, "radius": 0.03}, {**LUGRE, "lateral": False})
    mod = m.compile(target=target)
    reach = 0.05 / np.sin(np.pi / 8)
    x = mod.x0(j0_x=reach + 0.01, j0_y_dot=0.3)
    push = (mod.mass_matrix(x[:3]) @ mod.rhs(0.0, np.concatenate([x[:3], np.zeros(4)]))[3:6])[0]
    push /= 2 * np.cos(np.radians(65))  # on each flank
    assert push > 100
    wanted = 2 * np.sqrt(1e3 * push) * 0.3 * np.cos(np.radians(65))
    assert abs(mod.rhs(0.0, x)[6]) == pytest.approx(wanted, rel=1e-9)
    x = mod.x0(j0_x=reach + 0.01, j0_y=0.001, j0_x_dot=0.1, j0_y_dot=0.3, j0_3_dot=-4.0, touch_bristle_1=3e-5)
    wanted = differences(mod, x)
    np.testing.assert_allclose(mod.jacobian(0.0, x), wanted, rtol=1e-6, atol=1e-7 * np.abs(wanted).max())


SIZES: dict[str, dict[str, Any]] = {
    "circle": {"radius": 0.1},
    "segment": {"length": 0.3, "radius": 0.03},
    "box": {"size": (0.2, 0.1)},
    "polygon": {"points": [[0, 0], [1, 0], [1, 1], [0.5, 1.2], [0, 1]]},
    "plate": {"length": 1, "width": 0.3, "points": 3},
    "half_plane": {},
    "profile": {"points": [[-1, 0], [-0.3, 0.25], [0, 0.3], [0.4, 0.2], [1, 0]]},
    "smooth_profile": {"points": [[-1, 0], [-0.3, 0.25], [0, 0.3], [0.4, 0.2], [1, 0]]},
    "outline": {"points": [[0, 0], [1, 0], [1, 1], [0.5, 1.2], [0, 1]]},
    "smooth_outline": {"points": [[0, 0], [1, 0], [1, 1], [0.5, 1.2], [0, 1]]},
    "sprocket": {"teeth": 7, "pitch": 0.05, "seat": 0.01, "tip_radius": 0.06},
    "sphere": {"radius": 0.1},
    "capsule": {"length": 0.4, "radius": 0.1},
    "half_space": {},
    "ellipsoid": {"semi_axes": (0.1, 0.2, 0.3)},
    "cuboid": {"size": (0.1, 0.2, 0.3)},
    "height_field": {"height": "0.1*x*y"},
}


@pytest.mark.parametrize("kind", [kind for kind in SHAPE_FIELDS if kind != BED])  # whose cells have states themselves
def test_states_count_the_parts_that_shapes_have(kind: str) -> None:
    """What is told of a kind of shape is what its features are: whom it meets, and how many parts of each class."""
    m, (body,) = scenes.planar("one", 1)
    other = {"shape": "half_plane" if kind in PLANE else "half_space", "on": m.ground}
    if kind in GROUNDS:
        other = {"shape": "circle" if kind in PLANE else "sphere", "radius": 0.1, "on": m.ground}
    m.contacts("touch", {"shape": kind, "on": body, **SIZES[kind]}, other, {"stiffness": 1e4})
    (force,) = m.mechanism().forces
    shape, features = force.first[0], force.first[0].features()
    given = given_groups({"first": {"shape": kind, "on": "b0", **SIZES[kind]}})[0][0]
    assert given == shape.parts()
    classes = [one.kind.rstrip("0123456789") for one in features]
    surfaces = {name for name in classes if any(name == a for a, _ in MEETINGS)}
    parts = {name: classes.count(name) for name in classes if any(name == b for _, b in MEETINGS)}
    assert parts == dict(given.parts)
    for name, count in parts.items():
        assert sorted(one.slot for one in features if part_of(one.kind) == name) == list(range(count))
    for second in PARTS:
        met = {first for first in surfaces if meet((first, second))}
        found = {k[2] for k in pair_states([[given], [ShapeParts("", {second: 1})]])[0] if k[0] == 0}
        assert found == {class_of(first, second) for first in met}, second
    assert {*PARTS, *STATELESS} == {b for _, b in MEETINGS}
    assert not {*PARTS} & {*STATELESS}


def test_bodies_on_a_slope_stay_and_batches_agree() -> None:
    """Ten boxes on a slope of 0.2 below friction 0.3: none creeps in 20 s; columns are as single states."""
    m = eg.Model("boxes", gravity=(9.81 * np.sin(0.2), -9.81 * np.cos(0.2), 0))
    bodies = [m.body(f"b{k}", mass=1.0 + k, inertia=(0.01, 0.01, 0.01)) for k in range(2)]
    for k, body in enumerate(bodies):
        m.planar(f"j{k}", m.ground, body)
    law = {**LUGRE, "dissipation": 1.0, "lateral": False}
    m.contacts(
        "floor", {"shape": "box", "on": bodies, "size": (0.4, 0.2)}, {"shape": "half_plane", "on": m.ground}, law
    )
    mod = m.compile()
    start = {"j0_y": 0.1, "j1_x": 1.0, "j1_y": 0.1}
    traj = mod.simulate(12.0, initial=start, method="Radau", t_eval=[0.0, 2.0, 12.0])
    for name in ("j0_x", "j1_x"):
        assert abs(traj[name][2] - traj[name][1]) < 1e-7
    assert traj["floor_bristle_1"].shape == (3,)
    many = np.ascontiguousarray(traj.x[:, [1]] + 1e-4 * np.random.default_rng(1).standard_normal((mod.n_x, 21)))
    apart = np.array([mod.rhs(0.0, column) for column in many.T.copy()]).T
    np.testing.assert_allclose(mod.rhs(0.0, many), apart, rtol=1e-11, atol=1e-10 * np.abs(apart).max())


def rows(count: int) -> eg.Model:
    m, (a,) = scenes.planar("rows", 1)
    circles = {"shape": "circle", "on": [a.at(0.1 * k, 0.01 * k * k, 0) for k in range(count)], "radius": 0.06}
    m.contacts("touch", circles, {"shape": "half_plane", "on": m.ground}, {**LUGRE, "lateral": False})
    return m


def test_text_of_the_sum_does_not_grow_with_states(tmp_path: Path) -> None:
    texts = []
    for count in (8, 24):
        folder = generate(rows(count), tmp_path / str(count), target="c")
        text = next(folder.rglob("*pairs_touch.c")).read_text()
        text = re.sub(r"(?s)(static )?const \w+ \w+\[\d+\](\[\d+\])? = \{.*?\};\n", "", text)
        texts.append(re.sub(r"\d+", "0", text))
    assert texts[0] == texts[1]
    assert "held" in texts[0]


def test_names_of_states_are_taken() -> None:
    m = pair(PLANAR["box"], PLANAR["circle"])
    m.parameter("touch_bristle_x_1", 1)
    with pytest.raises(ModelError, match="touch_bristle_x_1"):
        m.mechanism()


def test_lateral_belongs_to_states() -> None:
    m, (a,) = scenes.planar("road", 1)
    ground = {"shape": "half_plane", "on": m.ground}
    law = {"stiffness": 1e5, "lateral": False}
    m.contacts("touch", {"shape": "circle", "on": a, "radius": 0.1}, ground, law)
    with pytest.raises(ModelError, match=r"touch\.lateral: belongs to contacts that have soil, or friction_law: lugre"):
        m.mechanism()


def test_numbers_of_states_are_those_of_the_parts() -> None:
    """Every kind of pair in the plane: as many states as its name says, each of one pair or of none."""
    points = [[-0.1, -0.1], [-0.1, 0.1], [0.1, 0.1], [0.02, 0.0], [0.1, -0.1]]
    shapes = {
        **PLANAR,
        "outline": {"shape": "outline", "points": points},
        "sprocket": {"shape": "sprocket", "teeth": 7, "pitch": 0.05, "seat": 0.01, "tip_radius": 0.06},
        "profile": {"shape": "profile", "points": [[-1, 0], [-0.3, 0.2], [0, 0.1], [0.4, 0.2], [1, 0]]},
    }
    m, bodies = scenes.planar("all", len(shapes))
    ground = shapes.pop("profile")
    first = [on(shape, body) for shape, body in zip(shapes.values(), bodies, strict=False)]
    m.contacts("among", first, law=LUGRE)
    m.contacts("road", first, {**ground, "on": m.ground}, LUGRE)
    mechanism = m.mechanism()
    for force in mechanism.forces:
        function = force._function(force.name, range(-1, len(bodies)), _SharedData(0, mechanism.graph), False)
        pairs = len(force.states) // 2
        assert function.states == 5 * pairs  # beside two states: decay by normal forces, these, decay for damping
        taken = [k for k, bodies_of in enumerate(function.holders) if bodies_of]
        assert taken
        assert all(len(bodies_of) in (0, 2) for bodies_of in function.holders)
        for kind in function.kinds:
            for i, row in enumerate(function.tables[kind.first]):
                for j, other in enumerate(function.tables[kind.second]):
                    if row[0] != other[0] and (kind.first != kind.second or i < j):
                        at = kind.held[0][i] + kind.held[1][j]
                        assert 0 <= at < function.states
                        assert at % 5 == 0
                        assert {row[0], other[0]} == function.holders[at]


def test_too_many_pairs_with_states_are_refused() -> None:
    m, (a, b) = scenes.planar("crowd", 2)
    groups = [{"shape": "circle", "on": [body.at(k, 0, 0) for k in range(45)], "radius": 0.1} for body in (a, b)]
    m.contacts("touch", *groups, LUGRE)
    with pytest.raises(ModelError, match=r"touch: has 2025 pairs with states; at most 2000 may have them"):
        m.mechanism()


def test_plates_meet_ground_alone() -> None:
    m, (a, b) = scenes.planar("plates", 2)
    plate = {"shape": "plate", "on": a, "length": 0.2, "width": 0.1}
    m.contacts("touch", plate, on(PLANAR["circle"], b), {"stiffness": 1e4})
    with pytest.raises(ModelError, match="circle and plate do not meet; plates meet bed, half_plane, profile"):
        m.mechanism()
