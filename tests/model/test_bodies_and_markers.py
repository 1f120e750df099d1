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
    "mapping": {
        "inertia": {a + b: TENSOR["xyz".index(a), "xyz".index(b)] for a, b in ("xx", "yy", "zz", "xy", "xz", "yz")}
    },
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
    alone = spatial(
        model_of(points=[{"mass": 1, "at": (1, 0, 0)}, {"mass": 3, "at": (-1, 0, 2)}, {"mass": 2, "at": (0, 1, 0)}])
    )
    places = ((1, (1, 0, 0)), (3, (-1, 0, 2)), (2, (0, 1, 0)))
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
    wanted = by_hand(3, (0.25, 0, 0.0625), np.diag([1, 1.25, 1])) + by_hand(
        1, (0.25, 0.5, np.sin(0.25)), np.diag([1.0, 2, 2])
    )
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
    for matrix in (
        sympy.rot_axis3(-a),
        [["cos(a)", "-sin(a)", 0], ["sin(a)", "cos(a)", 0], [0, 0, 1]],
    ):
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
    expected = {
        "tip": 0.5 * np.sin(theta) + theta,
        "side": 0.2 * np.cos(theta) + theta + np.pi / 2,
        "turned": theta + np.pi / 2,
        "end": np.sin(theta) + theta,
    }
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
