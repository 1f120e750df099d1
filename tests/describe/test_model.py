"""The builder: joints with their names, forces, namespaces, handles, and the one table behind methods and files."""

from __future__ import annotations

import inspect
import math
import subprocess
import sys
from collections.abc import Callable

import numpy as np
import pytest
import sympy

from eomgen import Model
from eomgen.describe import Mechanism, stubs
from eomgen.describe.fields import AXIS, BODY, INPUT, MODEL, OUTPUT_FIELDS, PARAMETER, joint_fields
from eomgen.errors import ModelError, UsageError
from eomgen.forces import FORCES, Actuator, BodyTorque, Damper, JointCoordinate, Line, PointForce, Spring, Turn
from eomgen.frames import GROUND
from eomgen.joints import JOINTS


def single(add: Callable[[Model], object], body: str = "b") -> Mechanism:
    m = Model("one")
    m.body(body, mass=1)
    add(m)
    return m.mechanism()


@pytest.mark.parametrize(
    ("type_name", "names"),
    [
        ("revolute", ("J",)),
        ("prismatic", ("J",)),
        ("cylindrical", ("J_z", "J_3")),
        ("spherical", ("J_1", "J_2", "J_3")),
        ("planar", ("J_x", "J_y", "J_3")),
        ("free", ("J_x", "J_y", "J_z", "J_1", "J_2", "J_3")),
        ("weld", ()),
    ],
)
def test_default_names_of_coordinates(type_name: str, names: tuple[str, ...]) -> None:
    m = single(lambda m: getattr(m, type_name)("J", m.ground, "b"))
    assert m.joints[0].coordinates == names
    assert not m.joints[0].named
    assert type(m.joints[0].joint) is JOINTS[type_name]
    given = tuple(f"q{k}" for k in range(len(names)))
    if given:
        m = single(lambda m: m.joint(type_name, "J", m.ground, "b", coordinates=given))
        assert m.joints[0].coordinates == given
        assert m.joints[0].named


def test_options_and_axes() -> None:
    m = single(lambda m: m.free("F", m.ground, "b", sequence="zxz"))
    assert m.joints[0].joint.sequence == "zxz"  # type: ignore[attr-defined]
    m = single(lambda m: m.spherical("F", m.ground, "b"))
    assert m.joints[0].joint.sequence == "xyz"  # type: ignore[attr-defined]
    m = single(lambda m: m.revolute("F", m.ground, "b", axis=np.array([0, 0, -2])))
    assert [m.joints[0].successor.frame.rotation[k][2].value for k in range(3)] == [0, 0, -1]
    m = single(lambda m: m.revolute("F", m.ground.at(0, 0, 0, rpy=("pi/2", 0, 0)), "b", axis="z"))
    assert [m.joints[0].predecessor.frame.rotation[k][2].value for k in range(3)] == [0, -1, 0]
    with pytest.raises(ModelError, match="a weld joint has no 'axis'"):
        single(lambda m: m.joint("weld", "F", m.ground, "b", axis="x"))


def test_several_joints_of_the_same_kind_of_names() -> None:
    """Coordinates may be called x, y and vx: motion of markers is written as a call and does not clash."""

    def add(m: Model) -> None:
        m.planar("P", m.ground, "b", coordinates=("x", "y", "vx"))
        m.output("far", "x + x(b) + vx*vx(b)")

    assert set(single(add).quantities) == {"x(b)", "vx(b)"}


def test_values_of_all_kinds() -> None:
    r = sympy.Symbol("r", positive=True)  # assumptions do not matter, the name does

    def add(m: Model) -> None:
        m.parameter("r", sympy.Rational(1, 4))
        m.parameter("k", "pi/2")
        m.parameter("n", np.array(2.5))
        b = m.body("c", mass=np.int64(3), com=sympy.Matrix([r, 0, r**2]), inertia=sympy.diag(1, r, 1))
        m.body("d", mass=1, inertia=np.diag([1.0, 2.0, 2.0]))
        m.weld("J", m.ground, "b")
        m.weld("K", b, "d")
        m.revolute("H", b.at("r", 0.5, sympy.sin(r)), m.ground)
        m.torque("t", "H", np.array(3))
        assert all(text in m.to_yaml() for text in ("n: 2.5", "value: 3}"))

    m = single(add)
    assert [p.value for p in m.parameters] == [0.25, math.pi / 2, 2.5]
    assert m.bodies[1].mass.value == 3.0
    assert m.bodies[1].com[2] == m.graph.symbol("r") * m.graph.symbol("r")
    assert m.bodies[2].inertia[1][1].value == 2.0
    assert m.joints[2].predecessor.label == "c.at(r, 0.5, sin(r))"


def test_forces() -> None:
    m = Model("forces")
    k, u = m.parameter("k", 2), m.input("u", 1.5)
    b = m.body("b", mass=1)
    p = b.marker("p", at=(1, 0, 0))
    hinge = m.revolute("H", m.ground, b, coordinate="theta")
    ball = m.spherical("S", b, m.body("c", mass=1))
    theta, rate = hinge.coordinate, hinge.velocity
    m.force("f1", p, (u, 0, k * sympy.sin(m.t)), axes="body")
    m.torque("t1", "H", -k * theta)
    m.torque("t2", b, (0, 0, 1))
    m.torque("t3", "b.p", (0, 0, "u"))
    m.torque("t4", ball.coordinates[1], 1)
    m.spring("s1", m.ground, p, stiffness=k)
    m.damper("d1", m.ground, p, "k*(1 + theta_dot**2)")
    m.torsional_spring("s2", hinge, stiffness=k, angle=0.5)
    m.torsional_spring("s3", m.ground, p, stiffness=k)
    m.torsional_damper("d2", joint="S_3", damping=1)
    m.friction("d3", "H", viscous=0.1)
    m.actuator("a1", hinge, u)
    m.actuator("a2", m.ground, "c", value=u * rate)
    made = {f.name: f for f in m.mechanism().forces}
    graph = m.mechanism().graph
    assert isinstance(made["f1"], PointForce)
    assert made["f1"].axes == "body"
    assert made["f1"].marker.label == "b.p"
    assert isinstance(made["t1"], Actuator)
    assert made["t1"].path == JointCoordinate("theta")
    assert isinstance(made["t2"], BodyTorque)
    assert made["t2"].axes == "ground"
    assert isinstance(made["t3"], BodyTorque)
    assert made["t3"].marker.label == "b.p"
    assert made["t4"].path == JointCoordinate("S_2")  # type: ignore[attr-defined]
    assert isinstance(made["s1"], Spring)
    assert isinstance(made["s1"].path, Line)
    assert made["s1"].rest.value == 0.0
    assert made["s1"].path.start.body == GROUND
    assert isinstance(made["d1"], Damper)
    assert isinstance(made["s2"], Spring)
    assert made["s2"].path == JointCoordinate("theta")
    assert made["s2"].rest.value == 0.5
    assert isinstance(made["s3"], Spring)
    assert isinstance(made["s3"].path, Turn)
    assert made["d2"].path == JointCoordinate("S_3")  # type: ignore[attr-defined]
    assert isinstance(made["d3"], Damper)
    assert isinstance(made["a1"], Actuator)
    assert made["a1"].path == JointCoordinate("theta")
    assert isinstance(made["a2"], Actuator)
    assert isinstance(made["a2"].path, Line)
    assert graph is not m.mechanism().graph  # each check makes a graph of its own


def test_wrong_calls() -> None:
    m, other = Model("a"), Model("b")
    b = m.body("b", mass=1)
    with pytest.raises(UsageError, match="belongs to the model 'a'"):
        other.revolute("J", other.ground, b)
    with pytest.raises(UsageError, match="one joint or two markers"):
        m.torsional_damper("d", b, b, b, damping=1)
    with pytest.raises(UsageError, match="is a body or marker"):
        m.friction("f", b, 1)
    joint = m.spherical("J", m.ground, b)
    with pytest.raises(UsageError, match="is a joint; a body"):
        m.damper("f", joint, b, damping=1)
    with pytest.raises(UsageError, match=r"3 coordinates \(J_1, J_2, J_3\)"):
        _ = joint.coordinate
    with pytest.raises(AttributeError, match="did you mean 'revolute'"):
        m.revolut("K", m.ground, b)


def test_settings_are_set_and_read() -> None:
    m = Model("s")
    m.initial(theta=0.3)
    m.initial["theta_dot"] = 1
    m.independent("theta")
    m.simulation(end=3)
    assert (m.initial, m.independent, m.simulation) == ({"theta": 0.3, "theta_dot": 1}, ["theta"], {"end": 3})
    m.independent = ["s"]
    m.initial = {sympy.Symbol("s"): 2}
    m.guess = {"s": 1}
    m.simulation = {"rtol": 1e-6}
    m.revolute("J", m.ground, m.body("b", mass=1), coordinate=sympy.Symbol("s"))
    mechanism = m.mechanism()
    assert mechanism.independent == ("s",)
    assert mechanism.initial["s"].value == 2.0
    assert mechanism.guess["s"].value == 1.0
    assert (mechanism.simulation.rtol, mechanism.simulation.end) == (1e-6, 10.0)


def test_initial_values_are_given_as_a_mapping_too() -> None:
    """As names of instances have points, which keywords have not."""
    leg = Model("leg")
    leg.revolute("hinge", leg.ground, leg.body("shank", mass=1, inertia={"zz": 0.1}))
    m = Model("walker")
    m.add(leg, "left_")
    m.initial({"left.hinge": 0.3}, left_hinge_dot=2)
    assert m.compile(target="numpy").x0().tolist() == [0.3, 2.0]
    with pytest.raises(UsageError, match=r"as in initial\(theta=0.3\) or a mapping, not as 3 alone"):
        m.initial(3)
    with pytest.raises(UsageError, match="^theta: given twice in one call; give each name once"):
        m.initial({"theta": 0.4}, theta=0.3)
    with pytest.raises(UsageError, match="theta: given twice"):
        m.initial({"theta": 0.4}, {"theta": 0.3})


def test_an_output_may_repeat_its_coordinate() -> None:
    def add(m: Model) -> None:
        theta = m.revolute("theta", m.ground, "b").coordinate
        m.output("theta", theta)
        m.output("theta_dot", "theta_dot", unit="rad/s")
        m.output("power", "theta_ddot*theta_dot")

    m = single(add)
    assert [o.name for o in m.outputs] == ["theta", "theta_dot", "power"]


@pytest.mark.parametrize("inertia", [(0, 0, 1), (0, 1, 1), {"zz": 2}, (1.0, 1.0, 2.1), (0.066, 0.086, 0.0125)])
def test_inertias_that_pass(inertia: object) -> None:
    """Planar shortcuts, thin rods, and measured data that miss the triangle inequality by a tenth (PUMA 560)."""
    m = Model("i")
    m.weld("J", m.ground, m.body("b", mass=1, inertia=inertia))
    m.mechanism()


def test_an_inertia_written_in_two_ways_is_symmetric() -> None:
    a, b, c = sympy.symbols("a b c")
    m = Model("i")
    for s in "abc":
        m.parameter(s)
    tensor = [[c, (a + b) * c, 0], [a * c + b * c, c, 0], [0, 0, c]]
    m.weld("J", m.ground, m.body("b", mass=1, inertia=tensor))
    m.mechanism()
    tensor[0][1] = a * c
    m.weld("K", m.ground, m.body("d", mass=1, inertia=tensor))
    with pytest.raises(ModelError, match="not symmetric"):
        m.mechanism()


# -- one table -----------------------------------------------------------------------------------------------------
def arguments(method: Callable[..., object]) -> dict[str, object]:
    return {k: p.default for k, p in inspect.signature(method).parameters.items() if k not in ("self", "name")}


def test_every_joint_has_a_method_with_keys_of_the_table() -> None:
    for name in JOINTS:
        fields = joint_fields(name)
        given = arguments(getattr(Model, name))
        assert set(given) == {*fields, "predecessor", "successor"} - {"type", "between"}
        required = [key for key, default in given.items() if default is inspect.Parameter.empty]
        assert set(required) == {"predecessor", "successor"} | {key for key in given if fields.get(key, AXIS).required}


def test_editors_read_the_same_methods() -> None:
    """``python -m eomgen.describe.stubs`` writes the file anew."""
    assert stubs.HOME.read_text(encoding="utf-8") == stubs.stub()
    compile(stubs.stub(), "element_methods.pyi", "exec")


def test_every_force_has_a_method_with_the_keys_of_the_table() -> None:
    places = {"between", "joint", "body", "marker", "on", "a", "b", "track", "road", "wheel"}
    for name, found in FORCES.items():
        fields = found.keys
        given = arguments(getattr(Model, name))
        assert set(given) - places == set(fields) - places, name
        for key, field in fields.items():
            if isinstance(field.default, int | float) and field.kind != "flag" and key in given:
                assert given[key] == field.default


def test_the_other_methods_have_the_keys_of_the_table() -> None:
    assert set(arguments(Model.parameter)) == set(PARAMETER)
    assert set(arguments(Model.input)) == set(INPUT)
    assert set(arguments(Model.output)) == set(OUTPUT_FIELDS)
    assert set(arguments(Model.body)) == set(BODY)
    assert {key for key in MODEL if hasattr(Model, key)} >= {"parameters", "bodies", "joints", "initial", "guess"}


def test_a_joint_without_a_method_of_its_own_has_one_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(JOINTS, "hinge", JOINTS["revolute"])
    m = single(lambda m: m.hinge("J", m.ground, "b", axis="x", coordinate="q"))
    assert m.joints[0].coordinates == ("q",)


def test_importing_the_builder_loads_no_sympy() -> None:
    code = "import eomgen.describe, sys; print('sympy' in sys.modules, 'ruamel.yaml' in sys.modules)"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=600)
    assert result.stdout.split() == ["False", "False"]


def test_misspelt_keywords_name_the_nearest() -> None:
    m = Model("m")
    b = m.body("b", mass=1)
    with pytest.raises(UsageError, match=r"revolute has no argument 'axiss'; did you mean 'axis'\?"):
        m.revolute("A", m.ground, b, axiss="x")  # type: ignore[call-arg]
    with pytest.raises(UsageError, match=r"spring has no argument 'stifness'; did you mean 'stiffness'\?"):
        m.spring("k", m.ground, b, stifness=1)  # type: ignore[call-arg]


@pytest.mark.parametrize("name", ["numpy", "scipy", "json", "errors", "eomgen"])
def test_names_of_models_that_would_hide_modules(name: str) -> None:
    m = Model(name)
    m.revolute("A", m.ground, m.body("b", mass=1, com=(1, 0, 0)))
    with pytest.raises(ModelError) as error:
        m.mechanism()
    (problem,) = error.value.problems
    assert problem.path == "name"
    assert f"{name}_model" in problem.remedy


@pytest.mark.parametrize("name", ["sin", "pi", "t", "int", "lambda"])
def test_a_reserved_name_is_told_once(name: str) -> None:
    m = Model("m")
    m.parameter(name, 1)
    m.revolute("A", m.ground, m.body("b", mass=name, com=(1, 0, 0)))
    with pytest.raises(ModelError) as error:
        m.mechanism()
    assert [p.path for p in error.value.problems] == [f"parameters.{name}"]


def test_markers_may_be_given_with_the_body() -> None:
    """As in a model file, and as by marker(): at a position, turned, by a matrix."""
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    places = {"tip": ("l", 0, 0), "side": {"at": (0, 0.2, 0), "rpy": (0, 0, "pi/2")}, "turned": {"matrix": quarter}}
    m = Model("arm")
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
        (["tip"], r"bodies.arm.markers: .*a mapping of marker names"),
        ({"tip": 3}, r"bodies.arm.markers.tip"),
        ({"tip": {"att": (0, 0, 0)}}, r"bodies.arm.markers.tip.*did you mean .at."),
    ],
)
def test_markers_that_cannot_be_are_told_with_their_place(markers: object, place: str) -> None:
    m = Model("arm")
    m.revolute("A", m.ground, m.body("arm", mass=1, inertia={"zz": 1}, markers=markers))
    with pytest.raises(ModelError, match=place):
        m.check()


def test_gravity_can_be_set_later_and_other_names_are_refused() -> None:
    """An attribute that a Model does not have would be set without any effect."""
    m = Model("falling")
    m.prismatic("J", m.ground, m.body("stone", mass=2.0), axis="z", coordinate="h")
    m.gravity = (0, 0, -1.625)
    assert m.gravity == (0, 0, -1.625)
    assert m.compile(target="numpy").rhs(0.0, [0.0, 0.0]) == pytest.approx([0.0, -1.625], rel=1e-15)
    with pytest.raises(AttributeError, match="no attribute 'gravty' to set; did you mean 'gravity'"):
        m.gravty = (0, 0, 0)
    with pytest.raises(AttributeError):
        m.bodies = {}
