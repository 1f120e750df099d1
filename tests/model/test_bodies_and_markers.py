"""Inertias given in every way, judged by mass matrices; markers and axes stand where SciPy puts them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st
from model_files import load, schema_faults
from refusals import refused, refuses
from scipy.spatial.transform import Rotation

import eomgen as eg

MASS, COM = 2.5, np.array([0.3, -0.1, 0.2])
RPY = np.array([0.5, -0.3, 0.8])
TURN = Rotation.from_euler("xyz", RPY).as_matrix()
PRINCIPAL = np.array([0.3, 0.4, 0.5])
TENSOR = TURN @ np.diag(PRINCIPAL) @ TURN.T


def steiner(d: np.ndarray, mass: float = MASS) -> np.ndarray:
    return np.array(mass * (d @ d * np.eye(3) - np.outer(d, d)))


def model_of(**given: Any) -> eg.Model:
    m = eg.Model("one")
    body = m.body("b", **given)
    body.marker("tip", at=(1, 2, 3), rpy=RPY)
    m.free("J", m.ground, body)
    return m


def spatial(model: eg.Model, **values: float) -> np.ndarray:
    """The mass matrix of a free body about its frame: mass, first moment and inertia."""
    mod = model.compile(target="numpy", kernels=["mass_matrix"])
    return np.asarray(mod.bind(p=values).mass_matrix(np.zeros(6)) if values else mod.mass_matrix(np.zeros(6)))


def by_hand(mass: float, com: Any, about_com: Any) -> np.ndarray:
    c = np.asarray(com, dtype=float)
    arm = mass * np.array([[0, -c[2], c[1]], [c[2], 0, -c[0]], [-c[1], c[0], 0]])
    return np.block([[mass * np.eye(3), arm.T], [arm, about_com + steiner(c, mass)]])


POINT = np.array([1.0, 2.0, 3.0])
WAYS = {
    "about com": {"inertia": TENSOR},
    "principal": {"principal": PRINCIPAL, "axes": RPY},
    "axes": {"inertia": np.diag(PRINCIPAL), "axes": RPY},
    "about origin": {"inertia": TENSOR + steiner(COM), "about": "origin"},
    "about a point": {"inertia": TENSOR + steiner(COM - POINT), "about": POINT},
    "about a marker": {"inertia": TURN.T @ (TENSOR + steiner(COM - POINT)) @ TURN, "about": "tip"},
    "about b.tip": {"inertia": TURN.T @ (TENSOR + steiner(COM - POINT)) @ TURN, "about": "b.tip"},
    "mapping": {"inertia": {"xyz"[i] + "xyz"[j]: TENSOR[i, j] for i in range(3) for j in range(i, 3)}},
}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("centre", [{"com": COM}, {"first_moment": MASS * COM}], ids=["com", "first_moment"])
def test_every_way_gives_the_same_body(way: str, centre: dict[str, Any]) -> None:
    found = spatial(model_of(mass=MASS, **centre, **WAYS[way]))
    np.testing.assert_allclose(found, by_hand(MASS, COM, TENSOR), rtol=0, atol=1e-12)


def test_barycentric_parameters_stay_as_they_are() -> None:
    """Linear in the parameters: what the base parameters of an identification are."""
    m = eg.Model("p")
    m.parameter("m", 2.0)
    for name in ("mx", "my", "J"):
        m.parameter(name, 0.5)
    body = m.body("b", mass="m", first_moment=("mx", "my", 0), inertia={"zz": "J"}, about="origin")
    m.planar("q", m.ground, body)
    mod = m.compile(target="numpy", kernels=["mass_matrix"])
    found = mod.bind(p={"m": 2.0, "mx": 0.6, "my": -0.2, "J": 0.5}).mass_matrix(np.zeros(3))
    np.testing.assert_allclose(found, [[2.0, 0.0, 0.2], [0.0, 2.0, 0.6], [0.2, 0.6, 0.5]], rtol=0, atol=1e-15)


def test_points_add_to_a_body() -> None:
    at = np.array([0.4, 0.5, -0.6])
    given = {"mass": MASS, "first_moment": MASS * COM, "inertia": TENSOR + steiner(COM), "about": "origin"}
    found = spatial(model_of(**given, points=[{"mass": MASS, "at": at}]))
    wanted = by_hand(MASS, COM, TENSOR) + by_hand(MASS, at, np.zeros((3, 3)))
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12)
    places = ((1, (1, 0, 0)), (3, (-1, 0, 2)), (2, (0, 1, 0)))
    alone = spatial(model_of(points=[{"mass": mass, "at": at} for mass, at in places]))
    wanted = sum(by_hand(mass, at, np.zeros((3, 3))) for mass, at in places)
    np.testing.assert_allclose(alone, wanted, rtol=0, atol=1e-13)


def faults_of(**given: Any) -> dict[str, tuple[str, str]]:
    with pytest.raises(eg.ModelError) as error:
        model_of(**given).check()
    return {p.path: (p.message, p.remedy) for p in error.value.problems}


def test_ways_that_exclude_each_other_are_reported_at_once() -> None:
    found = faults_of(mass=1, com=(0, 0, 0), first_moment=(0, 0, 0), inertia=(1, 1, 1), principal=(1, 1, 1))
    assert set(found) == {"bodies.b.first_moment", "bodies.b.principal"}
    found = faults_of(solids=[{"type": "sphere", "radius": 1, "mass": 1}], mass=1, com=(0, 0, 0), about="origin")
    assert set(found) == {"bodies.b.mass", "bodies.b.com", "bodies.b.about"}


@pytest.mark.parametrize(
    ("given", "demand"),
    [
        ({"com": (0, 0, 0)}, "EG-MISSING mass:"),
        ({"inertia": (1, 1, 1), "points": [{"mass": 1}]}, "EG-MISSING mass:"),
        ({"mass": 1, "axes": (0, 0, 0)}, "EG-MISSING axes: inertia"),
        ({"mass": 1, "inertia": (1, 1, 1), "about": "tp"}, "EG-NAME-UNKNOWN about: 'tip'?"),
        ({"mass": 1, "inertia": (1, 1, 1), "about": 3}, "EG-TYPE about: 3"),
        ({"mass": 1, "inertia": (1, 1, 1), "about": "tip", "axes": (0, 0, 1)}, "EG-CONFLICT axes:"),
        ({"mass": 1, "principal": np.eye(3)}, "EG-TYPE principal: three"),
        ({"mass": 0, "first_moment": (1, 0, 0)}, "EG-NO-INERTIA first_moment:"),
        ({"mass": 1, "points": [{"at": (1, 0, 0)}]}, "EG-MISSING points[0].mass:"),
        ({"mass": 1, "points": {"mass": 1}}, "EG-TYPE points: list"),
        ({"mass": 1, "inertia": [[1, 2, 0], [0, 1, 0], [0, 0, 1]], "axes": (1, 0, 0)}, "EG-INERTIA inertia: symmetric"),
        ({"mass": 1, "check_inertia": "no"}, "EG-TYPE check_inertia: 'no'"),
    ],
    ids=str,
)
def test_faults(given: dict, demand: str) -> None:
    refuses(demand, lambda: model_of(**given).check())


@pytest.mark.parametrize(
    "given",
    [
        {"inertia": [[0.1, 1e-20, 0], [0, 0.1, 0], [0, 0, 0.1]], "about": "cm", "markers": {"cm": {"rpy": RPY}}},
        {"inertia": TURN @ np.diag([0.1, 0.1, 0.1]) @ TURN.T, "axes": (0.1, 0.2, 0.3)},
        *(
            {"inertia": [[size, upper, 0], [lower, size, 0], [0, 0, size]]}
            for size, upper, lower in [
                (1, "sin(a)**2 + cos(a)**2 - 1", 0),
                (1, "k*(-1e-17)", 0),
                (1, "(a + k)**2 - a**2 - 2*a*k - k**2", 0),
                (1e-9, "(a + k)**2 - a**2 - 2*a*k - k**2", 0),
                ("sqrt(a - 10)", "(a + k)**2", "a**2 + 2*a*k + k**2"),
            ]
        ),
    ],
    ids=str,
)
def test_entries_that_are_alike_but_for_rounding(given: dict) -> None:
    """Beside 0 too, with parameters without values, and beside entries that have no value where they are drawn."""
    model = model_of(mass=1, **given)
    for name in "ak":
        model.parameter(name)
    assert model.derive().report.degrees_of_freedom == 6


@pytest.mark.parametrize(
    ("upper", "lower"), [("sqrt(a - 10)", "2*sqrt(a - 10)"), ("a", "1.001*a"), ("a", 0), ("1e-8*a", 0)]
)
def test_entries_that_differ(upper: Any, lower: Any) -> None:
    """Nor are entries alike that have no value wherever one looks."""
    model = model_of(mass=1, inertia=[[0.1, upper, 0], [lower, 0.1, 0], [0, 0, 0.1]])
    model.parameter("a")
    refuses("EG-INERTIA inertia: symmetric", model.check)


IMPOSSIBLE = [
    ({"mass": -1}, "EG-INERTIA mass: -1"),
    ({"mass": 1, "inertia": (1, 1, 2.5)}, "EG-INERTIA inertia: 2.5"),
    ({"mass": 1, "principal": (1, 5, 1), "axes": (1, 2, 3)}, "EG-INERTIA inertia: 5"),
    ({"mass": 1, "inertia": (1, 1, -0.1)}, "EG-INERTIA inertia: -0.1"),
    ({"mass": 1, "inertia": {"xx": 1, "yy": 1, "zz": 1, "xy": 1.5}}, "EG-INERTIA inertia: -0.5"),
    ({"mass": 1, "com": (1, 0, 0), "inertia": (0.5, 0.5, 0.5), "about": "origin"}, "EG-INERTIA inertia: -0.5"),
    ({"mass": 1, "com": (1, 0, 0), "inertia": {"zz": 0.5}, "about": "origin"}, "EG-INERTIA inertia: -0.5"),
    ({"mass": 1, "inertia": {"zz": -0.5}}, "EG-INERTIA inertia: -0.5"),
]


@pytest.mark.parametrize(("given", "demand"), IMPOSSIBLE, ids=str)
def test_an_impossible_body_is_refused_unless_the_check_is_off(given: dict[str, Any], demand: str) -> None:
    refuses(f"{demand} check_inertia:", lambda: model_of(**given).check())
    for of_model in (False, True):
        m = eg.Model("off", check_inertia=not of_model)
        m.weld("J", m.ground, m.body("b", **given, **({} if of_model else {"check_inertia": False})))
        if of_model:
            m.check_inertia = False
        m.check()
        m.check_inertia = True
        if of_model:
            with pytest.raises(eg.ModelError):
                m.check()


@pytest.mark.parametrize(
    "given",
    [
        {"inertia": {"zz": 1}},
        {"inertia": {"yy": 1}, "axes": (0.3, 0.4, 0.5)},
        {"inertia": {"zz": 1 + MASS * 0.13}, "about": "origin", "com": (0.3, 0.2, 0)},
        {"inertia": (0, 0.7, 0.7)},
        {"inertia": (0.066, 0.086, 0.0125)},  # measured data that miss the triangle inequality by a tenth (PUMA 560)
    ],
)
def test_possible_bodies_pass(given: dict[str, Any]) -> None:
    """One moment alone is an inertia of plane motion; rods and plates lie on the boundary."""
    m = eg.Model("one")
    m.weld("J", m.ground, m.body("b", mass=MASS, **given))
    m.check()


def test_parameters_decide_at_their_declared_values_and_later() -> None:
    for value, fine in ((3.0, False), (1.5, True)):
        m = eg.Model("p")
        m.parameter("J", value)
        m.free("W", m.ground, m.body("b", mass=1, inertia=(1, 1, "J")))
        if not fine:
            refuses("EG-INERTIA bodies.b.inertia", m.check)
            continue
        with refused("EG-RANGE bodies.b.inertia", eg.ParameterError):
            m.compile(target="numpy", kernels=["mass_matrix"]).bind(p={"J": 3.0})


def test_the_model_file_has_the_same_keys(tmp_path: Path) -> None:
    m = eg.Model("ways", check_inertia=False)
    m.parameter("r", 0.1)
    m.body("a", mass=1, inertia=("20*r", 2, 3), about="tip").marker("tip", at=(0, 0, 0))
    m.body("b", mass=1, first_moment=("r", 0, 0), inertia={"zz": 1}, about="origin", points=[{"mass": "r"}])
    hole = {"type": "cylinder", "radius": "r", "length": 1, "density": 1, "axis": "x", "subtract": True}
    m.body("c", solids=[{"type": "box", "size": (1, 1, 1), "density": 1, "rpy": (0, 0, 0.1)}, hole])
    m.body("d", mass=1, principal=("20*r", 2, 3), axes=(0, 0, "r"), check_inertia=True)
    for k, name in enumerate("abcd"):
        m.free(f"J{k}", m.ground, name)
    assert schema_faults(m) == []
    again = load(tmp_path, m.to_yaml())
    assert again.to_yaml() == m.to_yaml()
    q = np.random.default_rng(0).uniform(-1, 1, 24)
    one, two = (each.compile(target="numpy", kernels=["mass_matrix"]).mass_matrix(q) for each in (m, again))
    assert one.tolist() == two.tolist()


def test_values_of_all_kinds() -> None:
    """Of SymPy, NumPy and texts; assumptions of a symbol do not matter, its name does."""
    r = sympy.Symbol("r", positive=True)
    m = eg.Model("kinds")
    m.parameter("r", sympy.Rational(1, 4))
    m.parameter("k", "pi/2")
    m.parameter("n", np.array(2.5))
    b = m.body("c", mass=np.int64(3), com=sympy.Matrix([r, 0, r**2]), inertia=sympy.diag(1, r + 1, 1))
    m.free("F", m.ground, b)
    m.revolute("H", b.at("r", 0.5, sympy.sin(r)), m.body("d", mass=1, inertia=np.diag([1.0, 2.0, 2.0])))
    m.torque("t", "H", np.array(3))
    assert all(text in m.to_yaml() for text in ("n: 2.5", "value: 3}"))
    mod = m.compile(target="numpy")
    assert mod.p.tolist() == [0.25, np.pi / 2, 2.5]
    M = mod.mass_matrix(np.zeros(7))
    wanted = by_hand(3, (0.25, 0, 0.0625), np.diag([1, 1.25, 1]))
    wanted += by_hand(1, (0.25, 0.5, np.sin(0.25)), np.diag([1.0, 2, 2]))
    np.testing.assert_allclose(M[:6, :6], wanted, rtol=0, atol=1e-13)


# -- markers and axes -------------------------------------------------------------------------------------------------
def pose(model: eg.Model, marker: str = "ground.m") -> np.ndarray:
    """Rotation of a body that is welded to a marker."""
    model.weld("glue", marker, model.body("probe", mass=1, inertia=(1, 1, 1)))
    mod = model.compile(target="numpy", kernels=["poses"])
    return np.asarray(dict(zip(mod.body_names, mod.poses([0.0]), strict=True))["probe"][:3, :3])


def with_angle() -> eg.Model:
    m = eg.Model("m")
    m.parameter("a", 0.3)
    m.revolute("j", m.ground, m.body("b", mass=1, inertia=(1, 1, 1)))
    return m


@pytest.mark.parametrize(
    ("axes", "columns"),
    [
        ({"x": (1, 1, 0), "z": "z"}, [[1, 1, 0], [-1, 1, 0], [0, 0, np.sqrt(2)]]),
        ({"z": "x", "y": "-z"}, [[0, -1, 0], [0, 0, -1], [1, 0, 0]]),
        ({"y": (0, 3, 4), "x": (1, 0, 0)}, [[1, 0, 0], [0, 0.6, 0.8], [0, -0.8, 0.6]]),
        ({"y": (2, 1, 2), "z": (1, 2, -2)}, [[-6 / 9, 6 / 9, 3 / 9], [2 / 3, 1 / 3, 2 / 3], [1 / 3, 2 / 3, -2 / 3]]),
    ],
)
def test_two_axes(axes: dict[str, object], columns: list[list[float]]) -> None:
    m = with_angle()
    m.ground.marker("m", at=(1, 2, 3), axes=axes)
    wanted = np.array(columns, dtype=float).T
    wanted /= np.linalg.norm(wanted, axis=0)
    assert np.linalg.det(wanted) == pytest.approx(1)
    np.testing.assert_allclose(pose(m), wanted, rtol=0, atol=1e-15)


def test_a_matrix_of_numbers_and_one_of_expressions() -> None:
    turn = Rotation.from_euler("xyz", [0.4, -0.2, 1.1]).as_matrix()
    m = with_angle()
    m.ground.marker("m", matrix=turn)
    np.testing.assert_allclose(pose(m), turn, rtol=0, atol=1e-15)
    a = sympy.Symbol("a")
    for matrix in (sympy.rot_axis3(-a), [["cos(a)", "-sin(a)", 0], ["sin(a)", "cos(a)", 0], [0, 0, 1]]):
        m = with_angle()
        m.ground.marker("m", matrix=matrix)
        np.testing.assert_allclose(pose(m), Rotation.from_euler("z", 0.3).as_matrix(), rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ({"axes": {"x": "x"}}, "EG-TYPE bodies.ground.markers.m.axes"),
        ({"axes": {"x": "x", "w": "y"}}, "EG-TYPE bodies.ground.markers.m.axes"),
        ({"axes": {"x": "x", "y": (1, 1, 0)}}, "EG-RANGE bodies.ground.markers.m.axes"),
        ({"matrix": np.eye(2)}, "EG-TYPE bodies.ground.markers.m.matrix"),
        ({"matrix": 2 * np.eye(3)}, "EG-RANGE bodies.ground.markers.m.matrix"),
        ({"matrix": np.diag([1, 1, -1])}, "EG-RANGE bodies.ground.markers.m.matrix"),
        ({"matrix": np.eye(3), "rpy": (0, 0, 1)}, "EG-CONFLICT bodies.ground.markers.m.matrix"),
        ({"matrix": np.eye(3), "axes": {"x": "x", "y": "y"}}, "EG-CONFLICT bodies.ground.markers.m.matrix"),
    ],
)
def test_faults_of_turns(keys: dict[str, object], told: str) -> None:
    m = with_angle()
    m.ground.marker("m", **keys)
    refuses(told, m.check)


@settings(max_examples=8, deadline=None)
@given(st.tuples(*[st.floats(-7, 7)] * 3))
def test_rpy_is_fixed_axis(rpy: tuple[float, float, float]) -> None:
    m = with_angle()
    m.ground.marker("m", rpy=rpy)
    np.testing.assert_allclose(pose(m), Rotation.from_euler("xyz", rpy).as_matrix(), rtol=0, atol=2e-15)


AXES: dict[Any, tuple[float, float, float]] = {
    "x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1), "-x": (-1, 0, 0), "-y": (0, -1, 0), "-z": (0, 0, -1),
    (0, 3, 4): (0, 3, 4), (0, 0, -2): (0, 0, -2), (1, -2, 3): (1, -2, 3), (1e-3, 0, -1): (1e-3, 0, -1),
}  # fmt: skip


def test_names_and_numbers_for_axes() -> None:
    m = eg.Model("axes")
    for k, axis in enumerate(AXES):
        m.revolute(f"r{k}", m.ground, m.body(f"a{k}", mass=1, inertia=(1, 1, 1)), axis=axis)
        m.prismatic(f"p{k}", m.ground, m.body(f"b{k}", mass=1), axis=axis)
    mod = m.compile(target="numpy", kernels=["poses"])
    poses = dict(zip(mod.body_names, mod.poses(np.full(mod.n_q, 0.7)), strict=True))
    for k, axis in enumerate(AXES.values()):
        along = np.array(axis) / np.linalg.norm(axis)
        np.testing.assert_allclose(poses[f"a{k}"][:3, :3], Rotation.from_rotvec(0.7 * along).as_matrix(), atol=1e-15)
        np.testing.assert_allclose(poses[f"b{k}"][:3, 3], 0.7 * along, atol=1e-15)


def test_markers_may_be_given_with_the_body() -> None:
    """As in a model file, and as by marker(): at a position, turned, by a matrix."""
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    places = {"tip": ("l", 0, 0), "side": {"at": (0, 0.2, 0), "rpy": (0, 0, "pi/2")}, "turned": {"matrix": quarter}}
    m = eg.Model("arm")
    l = m.parameter("l", 0.5)
    arm = m.body("arm", mass=1, com=(l / 2, 0, 0), inertia={"zz": 0.1}, markers=places)
    arm.marker("end", at=(2 * l, 0, 0))  # further ones may follow
    m.revolute("A", m.ground, arm, coordinate="theta")
    for name in (*places, "end"):
        m.output(name, f"y(arm.{name}) + angle(arm.{name})")
    assert isinstance(places, dict)
    assert list(places) == ["tip", "side", "turned"]  # the user's own stays as it is
    mod = m.compile(target="numpy")
    theta = 0.3
    expected = {"tip": 0.5 * np.sin(theta) + theta, "end": np.sin(theta) + theta}
    expected |= {"side": 0.2 * np.cos(theta) + theta + np.pi / 2, "turned": theta + np.pi / 2}
    found = dict(zip(mod.y_names, mod.outputs(0.0, [theta, 0.0]), strict=True))
    assert found == pytest.approx(expected, abs=1e-14)
    assert "rpy: [0, 0, pi/2]" in m.to_yaml()


@pytest.mark.parametrize(
    ("markers", "place"),
    [
        (["tip"], "EG-TYPE bodies.arm.markers"),
        ({"tip": 3}, "EG-TYPE bodies.arm.markers.tip"),
        ({"tip": {"att": (0, 0, 0)}}, "EG-NAME-UNKNOWN bodies.arm.markers.tip.att"),
    ],
)
def test_markers_that_cannot_be_are_reported_with_their_place(markers: object, place: str) -> None:
    m = eg.Model("arm")
    m.revolute("A", m.ground, m.body("arm", mass=1, inertia={"zz": 1}, markers=markers))
    refuses(place, m.check)


# -- what force elements exert on bodies, ``force(track, on=wheel).x``, by Newton and Euler ----------------------------
G = 9.81
CRAFT_MASS, INERTIA = 1.4, (0.02, 0.03, 0.04)
CRAFT_COM = (0.02, -0.01, 0.03)
ELEMENTS = ("pull", "drag", "mount", "jet", "wheel", "touch")
PARTS = ("x", "y", "z", "mx", "my", "mz")


def craft(seen: str = "") -> eg.Model:
    """A body under many elements, whose motion Newton and Euler give from all of them."""
    m = eg.Model("craft", gravity=(0, 0, -G))
    a = m.body("a", mass=CRAFT_MASS, com=CRAFT_COM, inertia=INERTIA)
    b = m.body("b", mass=0.7, inertia=(0.01, 0.01, 0.02))
    a.marker("c", at=CRAFT_COM)
    m.free("fly", m.ground, a, rotation="euler_parameters")
    m.free("glide", m.ground, b, rotation="euler_parameters")
    m.spring("pull", m.ground.at(0, 0, 1), a.at(0.1, 0.05, 0), stiffness=40, length=0.3)
    m.damper("drag", a.at(-0.1, 0, 0.02), b, damping=3)
    m.bushing("mount", a.at(0, 0.1, 0, rpy=(0.1, 0.2, 0.3)), b.at(0, 0, 0.1), stiffness=[30, 20, 10, 1, 2, 3])
    m.force("jet", a.at(0.05, 0, 0), (1, 2, 3), axes="body")
    m.torque("wheel", a, (0.1, -0.2, 0.3), axes="body")
    ball = {"shape": "sphere", "on": a, "radius": 0.2}
    law = {"stiffness": 2e3, "dissipation": 0.3, "friction": 0.4, "smoothing": 0.01}
    m.contacts("touch", ball, {"shape": "half_space", "on": m.ground}, law)
    for name in ELEMENTS:
        for part in PARTS:
            m.output(f"{name}_{part}", f"force({name}, on=a.c{seen}).{part}")
    for axis in "xyz":
        m.output(f"a_{axis}", f"a{axis}(a.c)")
        m.output(f"w_{axis}", f"w{axis}_body(a)")
        m.output(f"t_{axis}", f"w{axis}_body_dot(a)")
        for element, other in (("touch", "ground"), ("mount", "b")):
            m.output(f"on_other_{element}_{axis}", f"force({element}, on={other}).{axis}")
    return m


def states(mod: eg.Module, count: int) -> list[np.ndarray]:
    """Random ones, in which the ball is pressed into the floor."""
    rng, found = np.random.default_rng(1), []
    for _ in range(count):
        x = mod.x0(fly_z=0.15, glide_x=0.3)
        x[: mod.n_q] += 0.05 * rng.uniform(-1, 1, mod.n_q)
        x[mod.n_q :] = 0.3 * rng.standard_normal(mod.n_v)
        found.append(mod.project(x))
    return found


@pytest.mark.parametrize("method", ["recursive", "embedding"])
def test_newton_and_euler(method: str) -> None:
    ground = craft().compile(method=method, target="numpy")
    body = craft(", in=a").compile(method=method, target="numpy")
    pressed = 0
    for x in states(ground, 8):
        out = dict(zip(ground.y_names, ground.outputs(0.0, x), strict=True))
        own = dict(zip(ground.y_names, body.outputs(0.0, x), strict=True))

        def of(found: dict[str, float], ending: str) -> np.ndarray:
            return np.array([found[f"{ending}_{k}"] for k in "xyz"])

        total = sum(np.array([out[f"{name}_{part}"] for part in PARTS]) for name in ELEMENTS)
        seen = sum(np.array([own[f"{name}_{part}"] for part in PARTS]) for name in ELEMENTS)
        np.testing.assert_allclose(total[:3] - (0, 0, CRAFT_MASS * G), CRAFT_MASS * of(out, "a"), rtol=1e-9, atol=1e-9)
        spin, turn = of(out, "w"), of(out, "t")
        euler = np.array(INERTIA) * turn + np.cross(spin, np.array(INERTIA) * spin)
        np.testing.assert_allclose(seen[3:], euler, rtol=1e-9, atol=1e-9)
        assert np.linalg.norm(seen[:3]) == pytest.approx(np.linalg.norm(total[:3]), rel=1e-12)
        for element in ("touch", "mount"):  # action and reaction
            np.testing.assert_allclose(of(out, f"on_other_{element}"), -of(out, element), rtol=1e-12, atol=1e-12)
        pressed += out["touch_z"] > 1
    assert pressed > 4


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("force(touch, on=a)", "EG-EXPRESSION parts"),
        ("force(touch, on=nobody).x", "EG-NAME-UNKNOWN nobody"),
        ("force(tuch, on=a).x", "EG-NAME-UNKNOWN tuch"),
        ("force(touch, on=a).q", "EG-EXPRESSION q part"),
        ("force(touch, on=a, in=b).size", "EG-EXPRESSION axes"),
        ("force(touch, by=a).x", "EG-EXPRESSION on=marker).part"),
        ("force(touch).x", "EG-EXPRESSION on=marker"),
        ("force(touch).mz", "EG-EXPRESSION body"),
        ("force(touch, in=a).x", "EG-EXPRESSION on=marker"),
        ("force(touch, on=b).x", "EG-UNSUPPORTED touch b"),
        ("force(turn, on=b).x", "EG-UNSUPPORTED turn"),
    ],
)
def test_what_is_wrong_is_reported(text: str, told: str) -> None:
    m = craft()
    hub = m.body("hub", mass=1, inertia=INERTIA)
    m.revolute("hinge", m.ground, hub)
    m.joint_spring("turn", "hinge", stiffness=1.0)
    m.output("bad", text)
    refuses(f"{told} outputs.bad.expression:", m.compile, target="numpy")


def test_forces_that_read_each_other_are_refused() -> None:
    m = eg.Model("circle")
    body = m.body("body", mass=1, inertia=INERTIA)
    m.free("fly", m.ground, body)
    m.force("one", body, ("force(two, on=body).x", 0, 0))
    m.force("two", body, ("force(one, on=body).x", 0, 0))
    refuses("EG-CIRCLE forces.two", m.compile, target="numpy")


# -- contacts in files ------------------------------------------------------------------------------------------------
FILE = """\
name: heap
gravity: [0, -9.81, 0]
parameters: {mu: 0.3, r: {value: 100, unit: mm}}
bodies:
  a: {mass: 1, inertia: {zz: 0.01}}
  b: {mass: 1, inertia: {zz: 0.01}}
joints:
  ja: {type: planar, between: [ground, a]}
  jb: {type: planar, between: [ground, b]}
contacts:
  floor:
    first: [{shape: circle, on: [a, b], radius: r}]
    second: {shape: half_plane, on: ground}
    law: {stiffness: 1e5, dissipation: 0.3, friction: mu, smoothing: 0.001}
  among:
    first: [{shape: box, on: [a, b], size: [r, 2*r]}]
    law: {stiffness: 1e5}
initial: {ja_y: 0.095, jb_x: 0.05, jb_y: 0.2, ja_x_dot: 1}
"""


def test_a_file_as_python_and_written_again(tmp_path: Path) -> None:
    m = load(tmp_path, FILE)
    mod = m.compile(target="numpy")
    x = mod.x0()
    m2 = eg.Model("heap", gravity=(0, -9.81, 0))
    mu, r = m2.parameter("mu", 0.3), m2.parameter("r", 0.1)
    a, b = (m2.body(name, mass=1, inertia={"zz": 0.01}) for name in "ab")
    m2.planar("ja", m2.ground, a)
    m2.planar("jb", m2.ground, b)
    law = {"stiffness": 1e5, "dissipation": 0.3, "friction": mu, "smoothing": 0.001}
    m2.contacts("floor", {"shape": "circle", "on": [a, b], "radius": r}, {"shape": "half_plane", "on": m2.ground}, law)
    m2.contacts("among", [{"shape": "box", "on": one, "size": (r, 2 * r)} for one in (a, b)], stiffness=1e5)
    wanted = mod.rhs(0.0, x)
    assert np.abs(wanted[6:]).max() > 10.0
    assert np.allclose(m2.compile(target="numpy").rhs(0.0, x), wanted, rtol=1e-13)
    again = load(tmp_path, m.to_yaml())
    assert np.array_equal(again.compile(target="numpy").rhs(0.0, x), wanted)


CIRCLES, FLOOR = "first: [{shape: circle, on: [a, b], radius: r}]", "{shape: half_plane, on: ground}"
BOXES, LAST = "first: [{shape: box, on: [a, b], size: [r, 2*r]}]", "law: {stiffness: 1e5}"
POINTS = "first: [{{shape: polygon, on: [a, b], points: {}}}]"
FAULTS = [
    ("friction: mu", "friction: -0.1", "EG-RANGE contacts.floor.law.friction heap.yaml 14 -0.1 0"),
    (CIRCLES, CIRCLES.replace("circle", "circel"), "EG-CHOICE contacts.floor.first[0].shape circel 'circle'?"),
    (CIRCLES, "first: []", "EG-MISSING contacts.floor.first"),
    (CIRCLES, CIRCLES.replace("b]", "c]"), "EG-NAME-UNKNOWN contacts.floor.first[0].on[1] c b"),
    (LAST, "law: 3", "EG-TYPE contacts.among.law"),
    (LAST, "", "EG-MISSING contacts.among"),
    (LAST, "law: {stiffness: 1, stifness: 1}", "EG-NAME-UNKNOWN contacts.among.law.stifness"),
    (FLOOR, "{shape: half_space, on: ground}", "EG-CONFLICT contacts.floor.second half_space"),
    (FLOOR, "{shape: circle, on: a, radius: r}", "EG-CONFLICT contacts.floor.second a"),
    (LAST, "law: {law: {stiffness: 1}}", "EG-NAME-UNKNOWN contacts.among.law.law stiffness heap.yaml 17"),
    (LAST, "law: {type: lineer, stiffness: 1}", "EG-CHOICE contacts.among.law.type lineer 'linear'?"),
    (LAST, "law: {stiffness: 1, damping: 1}", "EG-CONFLICT contacts.among.law.damping linear hunt_crossley"),
    (LAST, "law: {stiffness: 1}\n    stiffness: 2", "EG-CONFLICT contacts.among.stiffness"),
    (LAST, LAST + "\n    friction: {dynamic: -1, smoothing: 1}", "EG-RANGE contacts.among.friction.dynamic 18 -1"),
    (LAST, LAST + "\n    friction: {dynamic: 1}", "EG-MISSING contacts.among.friction.smoothing 18"),
    (LAST, LAST + "\n    friction: 0.2", "EG-MISSING contacts.among.smoothing"),
    (LAST, LAST + "\n    soil: {type: dry_sand}", "EG-CONFLICT contacts.among.law.stiffness soil"),
    (LAST, "soil: {type: dry_sent}", "EG-CHOICE contacts.among.soil.type 'dry_sand'?"),
    (LAST, "law: hertz", "EG-TYPE contacts.among.law hertz, ...}"),
    (LAST, LAST + "\n    stifness: 1", "EG-NAME-UNKNOWN contacts.among.stifness 'stiffness'?"),
    (LAST, "law: {stiffness: 1, friction: {dynamic: 1}}", "EG-CONFLICT contacts.among.law.friction beside"),
    (LAST, "law: {stiffness: 1, cohesion: 1}", "EG-CONFLICT contacts.among.law.cohesion soil"),
    (LAST, "stiffness: 1\n    damping: 1", "EG-CONFLICT contacts.among.damping 18 dissipation"),
    (LAST, "stiffness: 1\n    lateral: false\n    rebound: 1", "EG-CONFLICT contacts.among.rebound 19 soil"),
    (LAST, "law: {stiffness: r}", "EG-DIMENSION contacts.among.law.stiffness"),
    (BOXES, BOXES.replace("[a, b]", "a"), "EG-CONFLICT contacts.among"),
    (BOXES, POINTS.format("[[0, 0], [1, 0], [0.2, 0.2], [0, 1]]"), "EG-RANGE contacts.among.first[0].points"),
    (BOXES, POINTS.format("[[0, 0], [1, 0], [2, 0], [0, 1]]"), "EG-RANGE contacts.among.first[0].points[1]"),
]


@pytest.mark.parametrize(("old", "new", "message"), FAULTS)
def test_faults_of_files(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in FILE
    refuses(message, lambda: load(tmp_path, FILE.replace(old, new), "heap.yaml").check())


ALL_AT_ONCE = [
    ("stiffness: 1\n    cohesion: 1", "cohesion"),
    ("moduli: [1, 1]\n    poisson: [0.3, 0.3]", "moduli poisson"),
    ("normal_law: foo\n    moduli: 3\n    poisson: -1", "normal_law"),
    ("normal_law: foo\n    stiffness: -1\n    velocity: -1", "restitution normal_law stiffness velocity"),
    ("stiffness: 1\n    friction_law: foo\n    friction: -1", "smoothing friction_law friction"),
    ("friction: -1\n    smoothing: -1", " friction smoothing"),
    ("law: 3\n    friction: {dynamic: -1, smoothing: 1}", "law friction.dynamic"),
    ("law: {type: rigid}\n    friction: {viscous: 1, static: 1, type: coulomb, stribeck: 1}",
     "friction.viscous friction.static friction.type friction.stribeck"),
]  # fmt: skip


@pytest.mark.parametrize(("writing", "keys"), ALL_AT_ONCE)
def test_all_faults_of_laws_are_reported_in_order_at_their_keys(tmp_path: Path, writing: str, keys: str) -> None:
    with pytest.raises(eg.ModelError) as caught:
        load(tmp_path, FILE.replace(LAST, writing)).check()
    places = [f"contacts.among.{key}".removesuffix(".") for key in keys.split(" ")]
    assert [problem.path for problem in caught.value.problems] == places


TOGETHER = "law: {stiffness: 1e5, dissipation: 0.3, friction: mu, smoothing: 0.001}"
WRITINGS = (
    "law: {type: hunt_crossley, stiffness: 1e5, dissipation: 0.3}\n    friction: {dynamic: mu, smoothing: 0.001}",
    "stiffness: 1e5\n    dissipation: 0.3\n    friction: mu\n    smoothing: 0.001",
    "law: {stiffness: 1e5, dissipation: 0.3}\n    friction: mu\n    friction_law: coulomb\n    smoothing: 0.001",
)


@pytest.mark.parametrize("writing", WRITINGS)
def test_all_writings_of_a_law_are_one_model(tmp_path: Path, writing: str) -> None:
    models = [load(tmp_path, FILE), load(tmp_path, FILE.replace(TOGETHER, writing))]
    models += [load(tmp_path, model.to_yaml()) for model in models]
    digests = [m.compile(target="numpy", kernels=["poses"]).metadata["model_digest"] for m in models]
    assert len({*digests}) == 1


ONE_BY_ONE = [
    ({"normal_law": "linear", "stiffness": 1, "damping": 3}, {"law": {"type": "linear", "stiffness": 1, "damping": 3}}),
    (
        {"stiffness": 1e5, "friction": 0.3, "friction_law": "brown_mcphee", "static_friction": 0.4, "transition": 0.1},
        {"law": {"stiffness": 1e5},
         "friction": {"type": "brown_mcphee", "dynamic": 0.3, "static": 0.4, "transition": 0.1}},
    ),
    (
        {"stiffness": 1e5, "friction": 0.3, "friction_law": "lugre", "bristle_stiffness": 9, "bristle_damping": 8,
         "viscous_friction": 0.1, "lateral": False},
        {"law": {"stiffness": 1e5},
         "friction": {"type": "lugre", "dynamic": 0.3, "stiffness": 9, "damping": 8, "viscous": 0.1, "lateral": False}},
    ),
    ({"normal_law": "rigid", "friction": 0.3, "restitution": 0.1},
     {"law": {"type": "rigid", "restitution": 0.1}, "friction": {"dynamic": 0.3}}),
    ({"soil": "dry_sand", "lateral": False}, {"soil": {"type": "dry_sand", "lateral": False}}),
]  # fmt: skip


@pytest.mark.parametrize(("single", "parts"), ONE_BY_ONE)
def test_keys_one_by_one_are_those_of_laws(single: dict[str, Any], parts: dict[str, Any]) -> None:
    digests = set()
    for keys in (single, {"law": single}, parts):
        m = eg.Model("shoe", gravity=(0, -9.81, 0))
        body = m.body("shoe", mass=1, inertia={"zz": 0.01})
        m.planar("j", m.ground, body)
        shape: dict[str, Any] = {"shape": "circle", "radius": 0.1}
        if "soil" in keys or "soil" in keys.get("law", ()):
            shape = {"shape": "plate", "length": 0.3, "width": 0.2}
        m.contacts("floor", {**shape, "on": body}, {"shape": "half_plane", "on": m.ground}, **keys)
        digests.add(m.compile(target="numpy", kernels=["poses"]).metadata["model_digest"])
        assert schema_faults(m) == []
    assert len(digests) == 1


def test_a_stiffness_may_stand_in_the_place_of_its_law() -> None:
    digests = list[list[str]]()
    for k in (3e5, {"stiffness": 3e5}):
        digests.append([])
        for kind, *rest in (("point_plane", k), ("sphere_plane", 0.1, k), ("sphere_sphere", (0.1, 0.2), k)):
            m = eg.Model("w")
            ball = m.body("ball", mass=1, inertia=(1, 1, 1))
            m.free("j", m.ground, ball)
            getattr(m, kind)("t", m.ground, ball, *rest, friction=0.3, smoothing=1e-3)
            m.revolute("r", ball, m.body("arm", mass=1, inertia=(1, 1, 1)))
            m.stop("s", "r", k, 0, 2.6)
            m.point_plane("u", m.ground, ball, law={}, stiffness=3)
            digests[-1].append(m.compile(target="numpy", kernels=["poses"]).metadata["model_digest"])
    assert digests[0] == digests[1]
    with pytest.raises(TypeError, match=r"friction behind the stiffness, a mapping; give keys of a law by keyword"):
        m.point_plane("v", m.ground, ball, 1e6, 1.5)
    with pytest.raises(TypeError, match=r"too many .*; give keys of a law by keyword"):
        m.point_plane("v", m.ground, ball, 1e6, 1.5, 0.2)


def test_the_schema_knows_the_friction_of_rigid_bodies() -> None:
    for law, friction, places in (
        ("rigid", "{dynamic: 0.3}", []),
        ("rigid", "{dynamic: 0.3, smoothing: 1}", ["contacts.among.friction"]),
        ("linear, stiffness: 1", "{dynamic: 0.3, smoothing: 1}", []),
        ("linear, stiffness: 1", "{dynamic: 0.3}", ["contacts.among.friction"]),
    ):
        last = f"law: {{type: {law}}}\n    friction: {friction}\ninitial"
        text = FILE.replace(TOGETHER, LAST).replace(LAST + "\ninitial", last)
        assert schema_faults(text) == places


def test_faults_of_contacts_in_python_are_reported_at_the_line_of_the_call() -> None:
    m = eg.Model("w")
    ball = m.body("ball", mass=1, inertia=(1, 1, 1))
    m.free("j", m.ground, ball)
    sphere, plane = {"shape": "sphere", "radius": 1, "on": ball}, {"shape": "half_space", "on": m.ground}
    m.point_plane("first", m.ground, ball, "zz")
    m.contacts("floor", sphere, plane, {"stiffness": "zz"})
    with pytest.raises(eg.ModelError) as caught:
        m.check()
    one, two = caught.value.problems
    assert (one.path, two.path) == ("forces.first.law.stiffness", "contacts.floor.law.stiffness")
    assert (two.file, two.line) == (one.file, one.line + 1)
    assert one.file == __file__


@pytest.mark.parametrize(
    ("writing", "place"),
    [("law: {stiffness: -1}", "law.stiffness 8"), ("friction: -1\n        law: {stiffness: 1}", "friction 8 -1")],
)
def test_a_law_of_a_component_is_reported_where_it_is_written(tmp_path: Path, writing: str, place: str) -> None:
    text = f"""\
name: two
components:
  leg:
    bodies: {{foot: {{mass: 1}}}}
    joints: {{j: {{type: prismatic, between: [ground, foot]}}}}
    forces:
      sole:
        {writing}
        type: point_plane
        between: [ground, foot]
add: {{left: {{component: leg}}, right: {{component: leg}}}}
"""
    refuses(f"EG-RANGE components.leg.forces.sole.{place} left right", load(tmp_path, text).check)
