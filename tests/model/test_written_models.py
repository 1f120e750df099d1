"""Python and YAML describe one and the same model; the JSON Schema knows it; what is written reads back as itself."""

import inspect
import json
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st
from jsonschema import Draft202012Validator
from model_files import EXAMPLES, SLIDER_CRANK, described, load, schema, schema_faults, slider_crank
from refusals import refuses

import eomgen as eg
from examples.tracked_excavator import Track, build


def digest(m: eg.Model) -> str:
    return str(m.compile(target="numpy", kernels=["poses"]).metadata["model_digest"])


@pytest.mark.quick
def test_python_and_yaml_agree(tmp_path: Path) -> None:
    own, file = slider_crank(), load(tmp_path, SLIDER_CRANK)
    a, b = (m.compile(target="numpy") for m in (own, file))
    for names in ("q_names", "v_names", "u_names", "y_names", "body_names"):
        assert getattr(a, names) == getattr(b, names)
    assert a.q_names == ("theta", "B", "s")
    assert dict(zip(a.p_names, a.p, strict=True)) == dict(zip(b.p_names, b.p, strict=True))
    x, p = b.x0(), {"g": 9.7, "r": 0.11, "l": 0.36, "m_c": 1.2, "m_r": 0.7, "m_s": 0.6}
    np.testing.assert_allclose(a.x0(), x, rtol=1e-14)
    assert [x[b.x_names.index(name)] for name in ("theta", "theta_dot")] == [0.3, 10.0]
    for one in (b.x0(), b.bind(p=p).x0(theta=0.8)):
        found = [mod.bind(p=p, u={"tau": 0.4}) for mod in (a, b)]
        np.testing.assert_allclose(found[0].rhs(0.1, one), found[1].rhs(0.1, one), rtol=1e-12)
        np.testing.assert_allclose(found[0].outputs(0.1, one), found[1].outputs(0.1, one), rtol=1e-12)
    run = file.compile(target="numpy").simulate(0.01)
    place = 0.1 * np.cos(run["theta"]) + 0.35 * np.cos(np.arcsin(0.1 * np.sin(run["theta"]) / 0.35))
    assert run["pin_x"] == pytest.approx(place)
    assert run["speed"] == pytest.approx(run["s_dot"], rel=1e-12)
    assert repr(own) == "<Model slider_crank: 6 parameters, 1 input, 3 bodies, 4 joints, 2 forces, 2 outputs>"
    assert "crank.at(r, 0, 0) to rod" in own._repr_html_()


def test_the_digest_is_that_of_what_is_computed(tmp_path: Path) -> None:
    file = load(tmp_path, SLIDER_CRANK)
    assert digest(load(tmp_path, file.to_yaml())) == digest(file)
    assert digest(load(tmp_path, SLIDER_CRANK.replace("doc: crank radius", "doc: of the crank"))) == digest(file)
    for old, new in (("l: {value: 0.35", "l: {value: 0.36"), ("axis: x", "axis: -x"), ("length: 0.1}", "length: 0.2}")):
        assert digest(load(tmp_path, SLIDER_CRANK.replace(old, new))) != digest(file)


def test_handles_give_symbols() -> None:
    m = slider_crank()
    assert m.joints["A"].coordinate == sympy.Symbol("theta")
    assert m.joints["A"].velocity == sympy.Symbol("theta_dot")
    assert m.coordinate("s") == sympy.Symbol("s")
    assert m.parameters["r"] == sympy.Symbol("r")
    m.output("height", 2 * m.bodies["rod"].at("l/2", 0, 0).position[1])
    m.output("turned", m.bodies["rod"].acceleration[1])
    mod = m.compile(target="numpy")
    x = mod.x0(theta=0.5, theta_dot=2.0)
    height = mod.outputs(0.0, x)[mod.y_names.index("height")]
    assert height == pytest.approx(0.1 * np.sin(0.5))


DEGREES = {
    "revolute": ("J",), "prismatic": ("J",), "cylindrical": ("J_z", "J_3"), "spherical": ("J_1", "J_2", "J_3"),
    "planar": ("J_x", "J_y", "J_3"), "free": ("J_x", "J_y", "J_z", "J_1", "J_2", "J_3"),
}  # fmt: skip


@pytest.mark.parametrize("kind", DEGREES)
def test_names_of_coordinates(kind: str) -> None:
    given = tuple(f"q{k}" for k in range(len(DEGREES[kind])))
    for keys, names in (({}, DEGREES[kind]), ({"coordinates": given}, given)):
        m = eg.Model("one")
        handle = m.joint(kind, "J", m.ground, m.body("b", mass=1, inertia=(1, 1, 1)), **keys)
        assert handle.coordinate_names == names
        assert m.compile(target="numpy", kernels=["poses"]).q_names == names


def test_coordinates_may_be_called_as_motions_are() -> None:
    """Motion of markers is written as a call and does not clash."""
    m = eg.Model("one")
    m.planar("P", m.ground, m.body("b", mass=1, inertia=(1, 1, 1)), coordinates=("x", "y", "vx"))
    m.output("far", "x + x(b) + vx*vx(b)")
    m.output("x", m.coordinate("x"))  # an output may repeat its coordinate
    mod = m.compile(target="numpy")
    assert mod.outputs(0.0, [0.3, 0.0, 0.5, 2.0, 0.0, 0.0]).tolist() == [0.6 + 0.5 * 2.0, 0.3]


# -- the JSON Schema --------------------------------------------------------------------------------------------------
def test_the_schema_is_a_schema_and_knows_every_type() -> None:
    found = schema()
    Draft202012Validator.check_schema(found)
    assert json.loads(json.dumps(found)) == found
    for section in ("joints", "forces", "constraints"):
        for kind in found["properties"][section]["additionalProperties"]["oneOf"]:
            name = kind["properties"]["type"]["const"]
            given = set(inspect.signature(getattr(eg.Model, name)).parameters)
            keys = set(kind["properties"]) - {"type", "between", "joints", "joint", "body", "marker", "wheel"}
            if section == "joints":  # the arguments of the method are the keys of the file
                assert given - {"self", "name", "predecessor", "successor"} == keys, name
            assert "Parameters" in (inspect.getdoc(getattr(eg.Model, name)) or "")


def test_the_schema_accepts_what_is_shipped() -> None:
    assert schema_faults(SLIDER_CRANK) == []
    examples = sorted(EXAMPLES.glob("*.yaml"))
    assert len(examples) > 20
    for path in examples:
        assert schema_faults(path.read_text(encoding="utf-8")) == [], path


def test_the_schema_refuses() -> None:
    validator = Draft202012Validator(schema())
    for old, new, where in (
        ("type: prismatic", "type: prismatik", "joints.D"),
        ("axis: x", "axes: x", "joints.D"),
        ("stiffness: 200, ", "", "forces.k1"),
        ("joint: A, value", "joint: A, body: rod, value", "forces.motor"),
        ("mass: m_s", "com: [0, 0, 0]", "bodies.slider"),
        ("name: slider_crank", "nam: slider_crank", ""),
        ("end: 5", "end: -5", "simulation.end"),
        ("method: DOP853", "method: DOP", "simulation.method"),
        ("[0, -g, 0]", "[0, -g]", "gravity"),
    ):
        assert old in SLIDER_CRANK
        found = validator.iter_errors(described(SLIDER_CRANK.replace(old, new)))
        assert where in [".".join(map(str, error.absolute_path)) for error in found]


# -- written and read back --------------------------------------------------------------------------------------------
def test_a_written_model_reads_back(tmp_path: Path) -> None:
    m = slider_crank()
    theta, s = sympy.symbols("theta s")
    m.output("even", sympy.Piecewise((1, theta > 0), (sympy.Abs(s), True)))
    m.parameter("odd", 0.1 + 0.2, unit="N*m", doc="a text: with # signs, and 'quotes'")
    m.parameter("third", 1)
    text = m.to_yaml()
    assert schema_faults(text) == []
    assert "B: {type: revolute, between: [{body: crank, at: [r, 0, 0]}, rod]}" in text
    m.save(tmp_path / "saved.yaml")
    again = eg.load(tmp_path / "saved.yaml")
    assert again.to_yaml() == text
    a, b = (each.compile(target="numpy") for each in (m, again))
    assert digest(load(tmp_path, text)) == b.metadata["model_digest"]
    assert a.metadata["docs"] == b.metadata["docs"]
    assert dict(zip(b.p_names, b.p, strict=True))["odd"] == 0.1 + 0.2
    x = a.x0(theta=-0.5)
    np.testing.assert_allclose(b.rhs(0.0, x), a.rhs(0.0, x), rtol=1e-13)
    assert b.outputs(0.0, x) == pytest.approx(a.outputs(0.0, x), rel=1e-14)
    assert a.outputs(0.0, x)[2] == pytest.approx(x[a.x_names.index("s")])


def test_a_lagrangian_can_be_written(tmp_path: Path) -> None:
    q = sympy.Function("q")(sympy.Symbol("t"))
    m = eg.Model.from_lagrangian("p", q.diff() ** 2 / 2 - sympy.cos(q), [q], forces={q: sympy.exp(-q)})
    again = load(tmp_path, m.to_yaml())
    found = [each.compile(target="numpy").rhs(0.0, [0.3, 2.0]) for each in (m, again)]
    assert found[0].tolist() == found[1].tolist() == [2.0, pytest.approx(math.sin(0.3) + math.exp(-0.3))]


names = st.text(st.characters(codec="utf-8", exclude_categories=["Cc", "Cs"]), min_size=1, max_size=20)


@settings(max_examples=5, deadline=None)
@given(
    st.lists(names, min_size=20, max_size=20),
    st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=20, max_size=20),
)
def test_texts_and_numbers_survive(texts: list[str], numbers: list[float]) -> None:
    m = eg.Model("m")
    for k, (text, number) in enumerate(zip(texts, numbers, strict=True)):
        m.parameter(f"p{k}", number, doc=text)
    found = described(m)["parameters"]
    for k, (text, number) in enumerate(zip(texts, numbers, strict=True)):
        assert found[f"p{k}"]["doc"] == text
        assert float(found[f"p{k}"]["value"]) == number
        assert math.copysign(1, float(found[f"p{k}"]["value"])) == math.copysign(1, number)


def test_scalars_of_yaml_1_2(tmp_path: Path) -> None:
    numbers = {"a": 1, "b": -3, "c": 31, "d": 15, "e": 1000.0, "f": 1e-9, "h": 0.5, "i": 2.0, "j": 150.0}
    given = dict(zip(numbers, ("1", "-3", "0x1f", "0o17", "1e3", "1e-9", ".5", "2.", "+1.5E+2"), strict=True))
    text = f"name: m\nparameters: {{{', '.join(f'{k}: {v}' for k, v in given.items())}}}\n"
    text += "bodies: {body: {mass: 1}}\njoints: {on: {type: prismatic, between: [ground, body], coordinate: yes}}\n"
    mod = load(tmp_path, text).compile(target="numpy", kernels=["poses"])
    assert dict(zip(mod.p_names, mod.p.tolist(), strict=True)) == numbers
    assert mod.q_names == ("yes",)  # a word, as in YAML 1.2


def test_load_goes_by_the_suffix(tmp_path: Path) -> None:
    path = tmp_path / "model.yml"
    path.write_text(SLIDER_CRANK)
    assert eg.load(path).name == eg.load(str(path)).name == "slider_crank"
    with pytest.raises(FileNotFoundError):
        eg.load(tmp_path / "absent.yaml")
    for name, remedy in (("panda.sdf", "EG-FILE MJCF"), ("model", "EG-FILE .yaml")):
        refuses(remedy, eg.load, tmp_path / name)


# -- unnamed markers --------------------------------------------------------------------------------------------------
def arm() -> eg.Model:
    m = eg.Model("arm", gravity=(0, "-g", 0))
    g, l = m.parameter("g", 9.81), m.parameter("l", 0.7)
    assert g is not None
    upper = m.body("upper", mass=1, com=(0.5, 0, 0), inertia={"zz": 0.1})
    lower = m.body("lower", mass=1, com=(0.5, 0, 0), inertia={"zz": 0.1})
    upper.marker("marker_1", at=(9, 9, 9))  # the user's own
    m.revolute("A", m.ground, upper, coordinate="theta")
    m.revolute("B", upper.at(l, 0, 0), lower, coordinate="phi")
    m.output("elbow", upper.at(l, 0, 0).position[0] + 2 * upper.at(l, 0.1, 0).velocity[1])
    m.output("tip", sympy.sin(lower.at(0.5, "l/2", 0, rpy=(0, 0, 1)).position[1]))
    m.output("turned", lower.at(0.5, "l/2", 0, rpy=(0, 0, 1)).angle)
    m.output("post", m.ground.at(0.25, l, 0).position[1])
    return m


def test_unnamed_markers_of_outputs_get_names(tmp_path: Path) -> None:
    m = arm()
    before = m.to_yaml()
    m.save(tmp_path / "arm.yaml")
    again = eg.load(tmp_path / "arm.yaml")
    x = [0.3, -0.4, 1.1, 0.7]
    found = [each.compile(target="numpy", kernels=["outputs"]).outputs(0.0, x) for each in (m, again)]
    np.testing.assert_array_equal(found[0], found[1])
    theta, phi, w = 0.3, -0.4, 1.1
    speed = w * (0.7 * np.cos(theta) - 0.1 * np.sin(theta))
    beyond = 0.7 * np.sin(theta) + 0.5 * np.sin(theta + phi) + 0.35 * np.cos(theta + phi)
    expected = [0.7 * np.cos(theta) + 2 * speed, np.sin(beyond), theta + phi + 1.0, 0.7]
    np.testing.assert_allclose(found[1], expected, rtol=1e-14)
    markers = {name: body.get("markers") for name, body in described(again)["bodies"].items()}
    assert list(markers["upper"]) == ["marker_1", "marker_2", "marker_3"]
    assert list(markers["lower"]) == list(markers["ground"]) == ["marker_1"]
    assert before == m.to_yaml() == again.to_yaml()  # writing changes nothing, and nothing is named twice


class Place(NamedTuple):
    x: float
    y: float
    z: float


def test_markers_that_nothing_speaks_of_are_left_out() -> None:
    m = arm()
    m.body("lower_2", mass=1, com=Place(0.0, 0.0, 2.0))
    assert "lower_2.at" not in m.to_yaml()
    m.ground.at(5, 5, 5).position  # noqa: B018 - asked for, not used
    assert "[5, 5, 5]" not in m.to_yaml()


# -- examples ---------------------------------------------------------------------------------------------------------
def test_an_example_is_the_model_of_its_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("slider_crank", "slider_crank.yaml"):
        assert eg.load_example(name).to_yaml() == eg.load(EXAMPLES / "slider_crank.yaml").to_yaml()
    for name in ("arm", "arm.urdf"):
        arm = eg.load_example(name, floating=True)
        assert arm.to_yaml() == eg.load(EXAMPLES / "arm.urdf", floating=True).to_yaml()


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("slider_krank", "EG-NAME-UNKNOWN slider_krank slider_crank?"),
        ("nothing_near", "EG-NAME-UNKNOWN andrews_squeezer arm.urdf"),
        (3, "EG-NAME-UNKNOWN 3"),
        ("bicycle.py", "EG-FILE bicycle.py"),
        ("../slider_crank", "EG-NAME-UNKNOWN example"),
    ],
)
def test_what_is_no_example_is_reported(name: str, words: str) -> None:
    refuses(words, eg.load_example, name)


def test_the_name_of_an_example_given_as_a_file_is_reported() -> None:
    refuses("EG-FILE four_bar load_example", eg.load, "four_bar")


def test_the_tracked_excavator_is_what_its_script_writes() -> None:
    """Its chain lies closed around the wheels, as long as its links."""
    _, pins = Track().laid()
    np.testing.assert_allclose(pins[-1], pins[0], atol=1e-8)
    np.testing.assert_allclose(np.hypot(*np.diff(pins, axis=0).T), Track().pitch, atol=1e-12)
    assert eg.load_example("tracked_excavator").to_yaml() == build().to_yaml()


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_an_axis_is_left_out_where_it_is_the_default_of_its_type(axis: str, tmp_path: Path) -> None:
    m = eg.Model("skate")
    blade = m.body("blade", mass=1.0, inertia=(1, 1, 1))
    lift = m.body("lift", mass=1.0)
    m.free("f", m.ground, blade)
    m.translational("t", m.ground, lift)
    m.knife_edge("edge", blade, axis=axis)
    m.driver("up", marker=lift, axis=axis, value="0.1*t")
    m.save(tmp_path / "skate.yaml")
    again = eg.load(tmp_path / "skate.yaml")
    assert digest(again) == digest(m)
    entries = {entry.name: entry.values for entry in again.description.sections["constraints"]}
    assert ("axis" in entries["edge"]) == (axis != "y")
    assert ("axis" in entries["up"]) == (axis != "x")


def test_a_shape_in_a_picture_is_turned_by_axes_or_a_matrix(tmp_path: Path) -> None:
    turns = ({"axes": {"x": "y", "z": "z"}}, {"matrix": [[0, -1, 0], [1, 0, 0], [0, 0, 1]]})
    for turn in turns:
        m = eg.Model("shown")
        m.body("block", mass=1.0, display=[{"shape": "box", "size": [1, 2, 3], **turn}])
        m.prismatic("s", m.ground, "block")
        assert m.check()
        m.save(tmp_path / "shown.yaml")
        assert eg.load(tmp_path / "shown.yaml").check()
