"""Every way to give an inertia comes to the same body; what no body can have is refused, unless the check is off."""

from __future__ import annotations

import jsonschema
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from eomgen import Model, ModelError, load
from eomgen.describe.schema import model_schema
from eomgen.graph.evaluate import evaluate

MASS, COM = 2.5, np.array([0.3, -0.1, 0.2])
RPY = np.array([0.5, -0.3, 0.8])
TURN = Rotation.from_euler("xyz", RPY).as_matrix()
PRINCIPAL = np.array([0.3, 0.4, 0.5])
TENSOR = TURN @ np.diag(PRINCIPAL) @ TURN.T


def steiner(d: np.ndarray) -> np.ndarray:
    return MASS * (d @ d * np.eye(3) - np.outer(d, d))


def body_of(**given: object):
    m = Model("one")
    body = m.body("b", **given)  # type: ignore[arg-type]
    body.marker("tip", at=(1, 2, 3), rpy=RPY)
    m.weld("J", m.ground, body)
    return m.mechanism().bodies[0]


def numbers(*expressions) -> np.ndarray:
    return np.array(evaluate(list(expressions), {}), dtype=float)


def tensor(rows) -> np.ndarray:
    return numbers(*(x for row in rows for x in row)).reshape(3, 3)


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
def test_every_way_gives_the_same_body(way: str, centre: dict) -> None:
    body = body_of(mass=MASS, **centre, **WAYS[way])
    np.testing.assert_allclose(numbers(body.mass, *body.com), [MASS, *COM], rtol=1e-14)
    np.testing.assert_allclose(tensor(body.inertia), TENSOR, atol=1e-13)
    np.testing.assert_array_equal(tensor(body.inertia), tensor(body.inertia).T)


def test_barycentric_parameters_stay_as_they_are() -> None:
    m = Model("p")
    for name in ("m", "mx", "my", "J"):
        m.parameter(name)
    body = m.body("b", mass="m", first_moment=("mx", "my", 0), inertia={"zz": "J"}, about="origin")
    m.revolute("q", m.ground, body)
    (found,) = m.mechanism().bodies
    graph = m.mechanism().graph
    assert graph is not None
    assert [str(x) for x in found.moment] == [str(found.mass.graph.symbol(n)) for n in ("mx", "my")] + ["Expr(0.0)"]
    assert found.inertia_origin[2][2] == found.mass.graph.symbol("J")
    values = {"m": 2.0, "mx": 0.6, "my": -0.2, "J": 0.5}
    (at_com,) = evaluate([found.inertia[2][2]], values)
    assert at_com == pytest.approx(0.5 - (0.6**2 + 0.2**2) / 2.0)


def test_points_add_to_barycentric_parameters() -> None:
    at = np.array([0.4, 0.5, -0.6])
    given = {"mass": MASS, "first_moment": MASS * COM, "inertia": TENSOR + steiner(COM), "about": "origin"}
    body = body_of(**given, points=[{"mass": MASS, "at": at}])
    np.testing.assert_allclose(numbers(*body.moment), MASS * (COM + at))
    np.testing.assert_allclose(tensor(body.inertia_origin), TENSOR + steiner(COM) + steiner(at))
    c = (COM + at) / 2
    np.testing.assert_allclose(numbers(*body.com), c)
    np.testing.assert_allclose(tensor(body.inertia), TENSOR + steiner(COM - c) + steiner(at - c), atol=1e-13)


def test_a_body_of_points_alone() -> None:
    body = body_of(points=[{"mass": 1, "at": (1, 0, 0)}, {"mass": 3, "at": (-1, 0, 0)}])
    np.testing.assert_allclose(numbers(body.mass, *body.com), [4, -0.5, 0, 0])
    np.testing.assert_allclose(tensor(body.inertia), np.diag([0, 3, 3]))


def refused(**given: object) -> dict[str, tuple[str, str]]:
    with pytest.raises(ModelError) as error:
        body_of(**given)
    return {p.path: (p.message, p.remedy) for p in error.value.problems}


def test_ways_that_exclude_each_other_are_told_at_once() -> None:
    found = refused(mass=1, com=(0, 0, 0), first_moment=(0, 0, 0), inertia=(1, 1, 1), principal=(1, 1, 1))
    assert set(found) == {"bodies.b.first_moment", "bodies.b.principal"}
    found = refused(solids=[{"type": "sphere", "radius": 1, "mass": 1}], mass=1, com=(0, 0, 0), about="origin")
    assert set(found) == {"bodies.b.mass", "bodies.b.com", "bodies.b.about"}


@pytest.mark.parametrize(
    ("given", "path", "message"),
    [
        ({"com": (0, 0, 0)}, "mass", "is missing"),
        ({"inertia": (1, 1, 1), "points": [{"mass": 1}]}, "mass", "is missing"),
        ({"mass": 1, "axes": (0, 0, 0)}, "axes", "without an inertia"),
        ({"mass": 1, "inertia": (1, 1, 1), "about": "tp"}, "about", "no marker 'tp'"),
        ({"mass": 1, "inertia": (1, 1, 1), "about": 3}, "about", "is not com, origin"),
        ({"mass": 1, "inertia": (1, 1, 1), "about": "tip", "axes": (0, 0, 1)}, "axes", "beside a marker"),
        ({"mass": 1, "principal": np.eye(3)}, "principal", "is not three numbers"),
        ({"mass": 0, "first_moment": (1, 0, 0)}, "first_moment", "without mass"),
        ({"mass": 1, "points": [{"at": (1, 0, 0)}]}, "points[0].mass", "is missing"),
        ({"mass": 1, "points": {"mass": 1}}, "points", "is not a list of points"),
        ({"mass": 1, "inertia": [[1, 2, 0], [0, 1, 0], [0, 0, 1]], "axes": (1, 0, 0)}, "inertia", "not symmetric"),
        ({"mass": 1, "check_inertia": "no"}, "check_inertia", "true or false"),
    ],
    ids=str,
)
def test_faults(given: dict, path: str, message: str) -> None:
    assert message in refused(**given)[f"bodies.b.{path}"][0]


IMPOSSIBLE = [
    ({"mass": -1}, "mass", "is -1"),
    ({"mass": 1, "inertia": (1, 1, 2.5)}, "inertia", "exceeds the sum of the others"),
    ({"mass": 1, "principal": (1, 5, 1), "axes": (1, 2, 3)}, "inertia", "exceeds the sum of the others"),
    ({"mass": 1, "inertia": (1, 1, -0.1)}, "inertia", "negative principal moment"),
    ({"mass": 1, "inertia": {"xx": 1, "yy": 1, "zz": 1, "xy": 1.5}}, "inertia", "negative principal moment"),
    ({"mass": 1, "com": (1, 0, 0), "inertia": (0.5, 0.5, 0.5), "about": "origin"}, "inertia", "negative principal"),
    ({"mass": 1, "com": (1, 0, 0), "inertia": {"zz": 0.5}, "about": "origin"}, "inertia", "moment about the centre"),
    ({"mass": 1, "inertia": {"zz": -0.5}}, "inertia", "moment about the centre"),
]


@pytest.mark.parametrize(("given", "path", "message"), IMPOSSIBLE, ids=str)
def test_an_impossible_body_is_refused_unless_the_check_is_off(given: dict, path: str, message: str) -> None:
    said, remedy = refused(**given)[f"bodies.b.{path}"]
    assert message in said
    assert "check_inertia: note" in remedy
    body_of(**given, check_inertia=False)
    m = Model("off", check_inertia=False)
    m.weld("J", m.ground, m.body("b", **given))
    m.mechanism()
    m.check_inertia = True
    with pytest.raises(ModelError):
        m.mechanism()


@pytest.mark.parametrize(
    "given",
    [
        {"inertia": {"zz": 1}},
        {"inertia": {"yy": 1}, "axes": (0.3, 0.4, 0.5)},
        {"inertia": {"zz": 1 + MASS * 0.13}, "about": "origin", "com": (0.3, 0.2, 0)},
        {"inertia": (0, 0.7, 0.7)},
        {"inertia": (1, 2, 3)},
    ],
)
def test_possible_bodies_pass(given: dict) -> None:
    """One moment alone is an inertia of plane motion; rods and plates lie on the boundary."""
    body_of(mass=MASS, **given)


def test_parameters_decide_at_their_declared_values() -> None:
    m = Model("p")
    m.parameter("J", 3.0)
    m.weld("W", m.ground, m.body("b", mass=1, inertia=(1, 1, "J")))
    with pytest.raises(ModelError, match="exceeds the sum"):
        m.mechanism()
    m.description.sections["parameters"][0].values["value"] = 1.5
    m.mechanism()


def test_the_model_file_has_the_same_keys(tmp_path) -> None:
    m = Model("ways", check_inertia=False)
    m.parameter("r", 0.1)
    a = m.body("a", mass=1, principal=("20*r", 2, 3), axes=(0, 0, "r"), about="tip", check_inertia=True)
    a.marker("tip", at=(0, 0, 0))
    m.body("b", mass=1, first_moment=("r", 0, 0), inertia={"zz": 1}, about="origin", points=[{"mass": "r"}])
    hole = {"type": "cylinder", "radius": "r", "length": 1, "density": 1, "axis": "x", "subtract": True}
    m.body("c", solids=[{"type": "box", "size": (1, 1, 1), "density": 1, "rpy": (0, 0, 0.1)}, hole])
    a_entry = m.description.sections["bodies"][0].values
    del a_entry["axes"]
    for k, name in enumerate("abc"):
        m.free(f"J{k}", m.ground, name)
    path = tmp_path / "ways.yaml"
    path.write_text(m.to_yaml())
    from ruamel.yaml import YAML

    jsonschema.validate(YAML(typ="safe").load(path.read_text()), model_schema())
    again = load(path)
    assert not again.check_inertia
    for one, two in zip(m.mechanism().bodies, again.mechanism().bodies, strict=True):
        assert one.checked == two.checked
        x, y = (evaluate([b.mass, *b.com, *(e for row in b.inertia for e in row)], {"r": 0.1}) for b in (one, two))
        assert x == y
    assert again.to_yaml() == m.to_yaml()
