"""The constraints section: the same from Python and from a file, with its faults told by line."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import sympy
from jsonschema import Draft202012Validator
from models import build

import eomgen as eg
from eomgen import constraints
from eomgen.constraints import CONSTRAINTS, FlatContact
from eomgen.constraints.planetary import WHEELS
from eomgen.describe import model_schema
from eomgen.describe.yaml_nodes import Document

ROOT = Path(__file__).parents[2]

TEXT = """\
name: everything
parameters: {r: 0.1, n: 3, k: 0.2}
inputs: {u: 1}
bodies:
  one: {mass: 1, inertia: {zz: 1}}
  two: {mass: 1, inertia: {zz: 1}}
  bar: {mass: 1}
  arm: {mass: 1, inertia: {zz: 1}}
  sat: {mass: 1, inertia: {zz: 1}}
  ball: {mass: 1, inertia: [1, 1, 1]}
joints:
  A: {type: revolute, between: [ground, one], coordinate: alpha}
  B: {type: revolute, between: [ground, two], coordinate: beta}
  C: {type: prismatic, between: [ground, bar], axis: x, coordinate: s}
  D: {type: revolute, between: [ground, arm], coordinate: gamma}
  E: {type: revolute, between: [arm, sat], coordinate: delta}
  F: {type: free, between: [ground, ball]}
constraints:
  c1: {type: coupling, coordinates: {A: 1, beta: -n}, offset: k}
  c2: {type: coupling, equation: s - r*sin(alpha) - 0.01*t}
  c3: {type: gear, joints: [A, B], teeth: [20, 60], internal: true, phase: k}
  c4: {type: planetary, sun: A, ring: B, carrier: D, planet: E, radii: {sun: r, ring: n*r}}
  c5: {type: rack, pinion: A, rack: C, radius: -r, offset: k}
  c6: {type: belt, joints: [A, B], radii: [r, 2*r], crossed: true}
  c7: {type: cam, cam: A, follower: C, lift: k + r*cos(theta), phase: 0.1, periodic: false}
  c8: {type: cam_contact, cam: one, follower: bar, shape: roller, contour: k + r*cos(theta), radius: r/9, coordinate: c}
  c9: {type: cam_contact, cam: one, follower: bar, shape: flat_face, support: k + r*cos(theta)}
  d1: {type: rolling, wheel: ball, plane: ground, radius: r, shape: sphere, no_spin: true}
  d2: {type: rolling, wheel: {body: ball, at: [0, 0, r], rpy: [k, 0, 0]}, radius: r, tube: r/8}
  d3: {type: knife_edge, marker: ball, axis: x, on: one}
  d4: {type: gear, joints: [A, B], cones: [0.5, 0.6]}
  e1: {type: driver, coordinate: A, value: k*sin(n*t) + t**2}
  e2: {type: driver, between: [ball, {body: one, at: [r, 0, 0]}], value: 1 + k*t}
  e3: {type: driver, angle: [ground, sat], value: n*t}
  e4: {type: driver, marker: ball, axis: [0, 0.6, 0.8], on: arm, value: r*t}
"""


def from_python() -> eg.Model:
    m = eg.Model("everything")
    r, n, k = m.parameter("r", 0.1), m.parameter("n", 3), m.parameter("k", 0.2)
    m.input("u", 1)
    one, two = m.body("one", mass=1, inertia={"zz": 1}), m.body("two", mass=1, inertia={"zz": 1})
    bar = m.body("bar", mass=1)
    arm, sat = m.body("arm", mass=1, inertia={"zz": 1}), m.body("sat", mass=1, inertia={"zz": 1})
    ball = m.body("ball", mass=1, inertia=(1, 1, 1))
    A = m.revolute("A", m.ground, one, coordinate="alpha")
    B = m.revolute("B", m.ground, two, coordinate="beta")
    C = m.prismatic("C", m.ground, bar, axis="x", coordinate="s")
    m.revolute("D", m.ground, arm, coordinate="gamma")
    m.revolute("E", arm, sat, coordinate="delta")
    m.free("F", m.ground, ball)
    theta = sympy.Symbol("theta")
    profile = k + r * sympy.cos(theta)
    m.coupling("c1", {A: 1, B.coordinate: -n}, offset=k)
    m.coupling("c2", equation=C.coordinate - r * sympy.sin(A.coordinate) - m.t / 100)
    m.gear("c3", A, B, teeth=(20, 60), internal=True, phase=k)
    m.planetary("c4", sun=A, ring=B, carrier="D", planet="E", radii={"sun": r, "ring": n * r})
    m.rack("c5", A, C, radius=-r, offset=k)
    m.belt("c6", A, B, radii=(r, 2 * r), crossed=True)
    m.cam("c7", A, C, lift=profile, phase=0.1, periodic=False)
    m.cam_contact("c8", one, bar, "roller", contour=profile, radius=r / 9, coordinate="c")
    m.cam_contact("c9", one, bar, "flat_face", support=profile)
    m.rolling("d1", ball, m.ground, r, shape="sphere", no_spin=True)
    m.rolling("d2", ball.at(0, 0, r, rpy=(k, 0, 0)), radius=r, tube=r / 8)
    m.knife_edge("d3", ball, axis="x", on=one)
    m.gear("d4", A, B, cones=(0.5, 0.6))
    m.driver("e1", A, k * sympy.sin(n * m.t) + m.t**2)
    m.driver("e2", between=(ball, one.at(r, 0, 0)), value=1 + k * m.t)
    m.driver("e3", angle=(m.ground, sat), value="n*t")
    m.driver("e4", marker=ball, axis=(0, 0.6, 0.8), on=arm, value=r * m.t)
    return m


def load(tmp_path: Path, text: str) -> eg.Model:
    path = tmp_path / "model.yaml"
    path.write_text(text, encoding="utf-8")
    return eg.load(path)


def equations(model: eg.Model) -> dict[str, float]:
    """Every equation of every constraint at one state, by label."""
    from dataclasses import replace

    from eomgen.graph import evaluate
    from eomgen.graph.substitute import symbols_of
    from eomgen.kinematics import analyse

    mechanism = model.mechanism()
    motion = analyse(replace(mechanism, constraints=())).motion
    found = [(f"{c.name}.{row.label}", row) for c in mechanism.constraints for row in c.conditions(motion)]
    outputs = [row.expression for _, row in found]
    values = {name: 0.1 + 0.07 * k for k, name in enumerate(sorted(symbols_of(outputs)))}
    return dict(zip([label for label, _ in found], map(float, evaluate(outputs, values)), strict=True))


def test_python_and_file_say_the_same_and_both_round_trip(tmp_path: Path) -> None:
    models = [load(tmp_path, TEXT), from_python()]
    models += [load(tmp_path, m.to_yaml()) for m in models]
    first, *others = map(equations, models)
    assert len(first) == 17 + 1 + 1 + 3 + 2  # one each, and more of planetary, roller, sphere and disc
    assert all(np.isfinite(x) and x != 0 for x in first.values())
    for other in others:
        assert list(other) == list(first)
        np.testing.assert_allclose(list(other.values()), list(first.values()), rtol=1e-13)


def test_the_schema_knows_every_type() -> None:
    validator = Draft202012Validator(model_schema())
    assert list(validator.iter_errors(Document(TEXT, "m.yaml").value)) == []
    assert {found.name for found in CONSTRAINTS.values()} == set(CONSTRAINTS)
    concrete = {found for found in vars(constraints).values() if hasattr(found, "type_name")}
    made = {type(c) for c in from_python().mechanism().constraints}
    made |= {type(c) for c in load_knife_edge().mechanism().constraints}
    held = load_held().mechanism()
    made |= {type(c) for c in held.constraints} | {type(one.constraint) for one in held.switched}
    assert made >= concrete - {FlatContact}
    for old, new in (
        ("type: rack", "type: rak"),
        ("radius: -r, ", ""),
        ("crossed: true", "crossed: yes"),
        ("joints: [A, B], teeth", "joints: [A], teeth"),
        ("radii: {sun: r", "radii: {son: r"),
        ("contour: k + r*cos(theta), radius", "contour: k, support: k, radius"),
    ):
        assert old in TEXT
        assert list(validator.iter_errors(Document(TEXT.replace(old, new), "m.yaml").value)), new


def load_knife_edge() -> eg.Model:
    m = eg.Model("knife")
    cam, follower = m.body("wheel", mass=1), m.body("follower", mass=1)
    m.revolute("A", m.ground, cam)
    m.prismatic("B", m.ground, follower, axis="y")
    m.cam_contact("touch", cam, follower, "knife_edge", contour="0.1 + 0.01*cos(theta)")
    return m


def load_held() -> eg.Model:
    m = eg.Model("held")
    egg = m.body("egg", mass=1, inertia=(1, 1, 1))
    m.free("fly", m.ground, egg)
    m.rolling("roll", egg, shape="ellipsoid", semi_axes=(0.3, 0.2, 0.1))
    m.hold("grasp", m.ground, egg, closes="1 - t")
    m.revolute("pin", egg, m.body("arm", mass=1, inertia=(1, 1, 1)), axis="z")
    m.lock("brake", joint="pin", closes="2 - t")
    return m


def test_the_documents_know_every_type_and_key() -> None:
    text = (ROOT / "docs" / "constraints.md").read_text(encoding="utf-8")
    words = set(re.findall(r"\w+", text))
    keys = {*CONSTRAINTS, *WHEELS, *(key for found in CONSTRAINTS.values() for key in found.keys)}
    keys |= {word for found in CONSTRAINTS.values() for field in found.keys.values() for word in field.choices}
    assert keys - words == set()


BROKEN = [
    ("joints: [A, B], teeth", "joints: [A, G], teeth", 21, "c3.joints[1]", "no joint 'G'", "joints and coordinates"),
    ("joints: [A, B], teeth", "joints: [A, F], teeth", 21, "c3.joints[1]", "has 6 coordinates", "F_x"),
    ("joints: [A, B], teeth", "joints: [A, C], teeth", 21, "c3.joints[1]", "'s' is a length", "angle"),
    ("joints: [A, B], teeth", "joints: [A, alpha], teeth", 21, "c3.joints", "'alpha' is named twice", "two"),
    ("joints: [A, B], teeth", "joints: [A, E], teeth", 21, "c3.joints", "not measured from the same", "planetary"),
    ("joints: [A, B], teeth", "joints: A, teeth", 21, "c3.joints", "is not a list of two joints", ""),
    ("teeth: [20, 60]", "teeth: [20, -60]", 21, "c3.teeth[1]", "is -60", "greater than 0"),
    ("teeth: [20, 60]", "teeth: [20, 60], radii: [1, 2]", 21, "c3", "both radii and teeth", "give one of"),
    ("teeth: [20, 60], ", "", 21, "c3", "radii or teeth or cones is missing", "give one of"),
    ("internal: true", "internal: 1", 21, "c3.internal", "1 is not true or false", ""),
    ("type: rack", "type: rak", 23, "c5.type", "no constraint of type 'rak'", "did you mean 'rack'"),
    ("radius: -r, offset", "radius: -r, ofset: 1, offset", 23, "c5.ofset", "unknown key", "offset"),
    ("rack: C, radius", "rack: B, radius", 23, "c5.rack", "'beta' is an angle", "a length"),
    ("coordinates: {A: 1, beta: -n}", "coordinates: {A: 1, bet: 2}", 19, "c1.coordinates.bet", "no joint", "'beta'"),
    ("coordinates: {A: 1, beta: -n}", "coordinates: {}", 19, "c1.coordinates", "is not a mapping", ""),
    ("coordinates: {A: 1, beta: -n}", "coordinates: {A: 1, alpha: 2}", 19, "c1", "'alpha' is named twice", "sum"),
    ("- 0.01*t", "- beta_ddot", 20, "c2.equation", "the acceleration 'beta_ddot' cannot", "velocities"),
    ("- 0.01*t", "- ax(one)", 20, "c2.equation", "the acceleration 'ax(one)' cannot", "velocities"),
    ("- 0.01*t", "- wz_dot(one)", 20, "c2.equation", "the acceleration 'wz_dot(one)' cannot", "velocities"),
    ("- 0.01*t", "- wx(one)*wz(two)", 20, "c2.equation", "the equation is not linear in wx(one), wz(two)", "linear"),
    ("- 0.01*t", "- abs(wx(one))", 20, "c2.equation", "the equation is not linear in wx(one)", "linear"),
    ("s - r*sin(alpha) - 0.01*t", "total_mass - 1", 20, "c2.equation", "contains no coordinate", "alpha"),
    ("- 0.01*t", "- beta_dot**2", 20, "c2.equation", "the equation is not linear in beta_dot", "linear"),
    ("equation: s - r*sin(alpha) - 0.01*t", "equation: r - k", 20, "c2.equation", "contains no coordinate", "alpha"),
    ("- 0.01*t", "- kinetic_energy", 20, "c2.equation", "energy", "not energies"),
    ("- 0.01*t", "- 0.01*multiplier(c1)", 20, "c2.equation", "the multiplier 'multiplier(c1)'", "not multipliers"),
    ("radii: {sun: r, ring: n*r}", "radii: {sun: 2}", 22, "c4.radii", "the ring has a joint but no size", "ring"),
    ("radii: {sun: r, ring: n*r}", "radii: {sun: 1, ring: 3, planet: 2}", 22, "c4.radii", "ring 3 is not", "fit"),
    ("radii: {sun: r, ring: n*r}", "radii: {sun: 1, rim: 3}", 22, "c4.radii.rim", "unknown key", "ring"),
    ("lift: k + r*cos(theta)", "lift: k + r*cos(alpha)", 25, "c7.lift", "the coordinate 'alpha' cannot", "parameters"),
    ("lift: k + r*cos(theta)", "lift: k + q*cos(theta)", 25, "c7.lift", "unknown name 'q'", "declare a parameter"),
    ("radius: r/9, coord", "coord", 26, "c8.radius", "is missing", "radius of the roller"),
    (", coordinate: c}", ", coordinate: beta}", 13, "", "'beta' is already used", "rename"),
    ("shape: roller", "shape: rollr", 26, "c8.shape", "'rollr' is not known", "roller"),
    ("shape: flat_face, supp", "shape: knife_edge, supp", 27, "c9.support", "only a flat face", "contour"),
    ("follower: bar, shape: flat", "follower: one, shape: flat", 27, "c9.follower", "on the same body", "another"),
    ("shape: sphere, no_spin", "shape: disc, no_spin", 28, "d1.no_spin", "only spheres", "leave it out"),
    ("wheel: ball, plane: ground", "wheel: ball, plane: ball", 28, "d1.plane", "on the same body", "another body"),
    ("axis: x, on", "axis: w, on", 30, "d3.axis", "not an axis", "allowed"),
    ("k*sin(n*t) + t**2", "k*s", 32, "e1.value", "the coordinate 's' cannot be used", "a coupling relates"),
    ("k*sin(n*t) + t**2", "k*s_dot", 32, "e1.value", "the velocity 's_dot' cannot be used", "a coupling relates"),
    ("k*sin(n*t) + t**2", "x(one)", 32, "e1.value", "x(...) of a marker cannot be used here", "in outputs"),
    ("coordinate: A, value", "coordinate: F, value", 32, "e1.coordinate", "has 6 coordinates", "F_x"),
    ("coordinate: A, value", "value", 32, "e1", "coordinate or between or angle or marker is missing", "give one of"),
    ("coordinate: A, value", "coordinate: A, marker: one, value", 32, "e1", "both coordinate and marker", "give one"),
    ("coordinate: A, value", "coordinate: A, axis: y, value", 32, "e1.axis", "a driver of a marker", "leave it out"),
    (", value: n*t}", "}", 34, "e3.value", "is missing", "give a number or an expression"),
    ("angle: [ground, sat]", "angle: [sat, sat]", 34, "e3.angle", "on the same body", "another body"),
    ("axis: [0, 0.6, 0.8], on: arm", "axis: [0, 0, 0], on: arm", 35, "e4.axis", "has no length", ""),
    ("axis: [0, 0.6, 0.8], on: arm", "on: ball", 35, "e4.on", "on the same body", "another body"),
    ("  d4: {", "  c3: {", 31, "c3", "given twice", "rename"),
    ("  d4: {", "  d-4: {", 31, "d-4", "not an identifier", ""),
]


@pytest.mark.parametrize(("old", "new", "line", "path", "message", "remedy"), BROKEN)
def test_faults(old: str, new: str, line: int, path: str, message: str, remedy: str, tmp_path: Path) -> None:
    assert TEXT.count(old) == 1
    with pytest.raises(eg.ModelError) as caught:
        load(tmp_path, TEXT.replace(old, new)).mechanism()
    problems = caught.value.problems
    found = [p for p in problems if message in p.message and remedy in p.remedy]
    assert found, [str(p) for p in problems]
    if path:
        assert found[0].path.startswith(f"constraints.{path}")
        assert found[0].line == line
    assert len({p.path for p in problems}) == 1, [str(p) for p in problems]


def test_all_faults_at_once(tmp_path: Path) -> None:
    text = (
        TEXT.replace("[A, B], teeth", "[A, G], teeth")
        .replace("crossed: true", "crossed: 2")
        .replace("- 0.01*t", "- beta_ddot")
    )
    with pytest.raises(eg.ModelError) as caught:
        load(tmp_path, text).mechanism()
    assert [p.line for p in caught.value.problems] == [20, 21, 24]


def test_a_misspelt_keyword_is_answered() -> None:
    m = eg.Model("m")
    with pytest.raises(eg.UsageError, match="radii"):
        m.gear("mesh", "A", "B", radius=(1, 2))  # type: ignore[call-arg]


def test_a_lagrangian_may_be_coupled() -> None:
    """Two masses on springs, held equal by a coupling: x'' = -(k1 + k2)/(m1 + m2) x."""
    x, y, x_dot, y_dot = sympy.symbols("x y x_dot y_dot")
    L = (2 * x_dot**2 + 3 * y_dot**2) / 2 - (5 * x**2 + 7 * y**2) / 2
    m = eg.Model.from_lagrangian("two", L, [x, y])
    m.coupling("equal", {x: 1, y: -1})
    mod = m.compile(target="numpy")
    state = mod.x0(x=0.3)
    np.testing.assert_allclose(mod.rhs(0.0, state)[2:], [-12 / 5 * 0.3] * 2, rtol=1e-13)


def test_angles_that_close_loops_in_space_are_refused() -> None:
    """Such an angle is known up to full turns only: a coupling would jump with it."""
    m = build("spatial_loop")
    wheel = m.body("wheel", mass=1, inertia=(1, 1, 1))
    m.revolute("W", m.ground, wheel, coordinate="turn")
    m.coupling("follow", {"C_3": 1, "turn": -1})
    with pytest.raises(eg.ModelError, match=r"constraints.follow: the angle 'C_3' closes a loop in space"):
        m.derive()


def test_coordinates_of_cut_joints_can_be_coupled() -> None:
    """The slider's coordinate of a slider-crank, cut, drives a second slider."""
    m = eg.load(ROOT / "examples" / "slider_crank.yaml")
    second = m.body("second", mass=1)
    m.prismatic("E", m.ground, second, axis="y", coordinate="z")
    m.coupling("twice", {"s": 2, "z": -1}, offset=0.1)
    mod = m.compile(target="numpy", independent=["theta"])
    run = mod.simulate((0, 0.5), initial={"theta": 0.3, "theta_dot": 10})
    np.testing.assert_allclose(run["z"], 2 * run["s"] - 0.1, atol=1e-11)
    assert np.ptp(run["s"]) > 0.05


def laws() -> eg.Model:
    """Two sliders, a spring, a damper, and laws of an input and of states."""
    m = eg.Model("laws")
    a, b = m.body("a", mass=2, inertia={"zz": 1}), m.body("b", mass=1)
    m.prismatic("x", m.ground, a, axis="x")
    m.prismatic("y", m.ground, b, axis="x")
    m.input("u", 1)
    m.state("s", rate="-s", initial=1)
    m.sampled("held", "0.5 + t", period=0.2)
    m.joint_spring("K", "x", stiffness=3)
    m.joint_damper("D", "x", damping=2)
    m.output("slow", "2*s*x")
    m.initial(x=1)
    return m


REFUSED = [
    ("x - s", "the state 's' cannot be used here", "not states that change continuously"),
    ("x_dot - s", "the state 's' cannot", "closes or opens"),
    ("slow - 1", "the state 's' cannot", ""),
    ("x - held", "the state 'held' cannot", "that only events and samples change"),
    ("x - s_dot", "the rate of a state 's_dot' cannot", "not rates of states"),
    ("power(D) - 1", "not linear in the velocities in the law of power(D)", "linear"),
    ("wx(a) - 1", "c.equation is always -1, as no coordinate moves it", "write a coordinate into it"),
    ("vy(a) - u", "c.equation depends on u but on no coordinate", "write a coordinate into it"),
]


@pytest.mark.parametrize(("equation", "message", "remedy"), REFUSED)
@pytest.mark.parametrize("closes", [None, "1 - t"])
def test_an_equation_that_cannot_be_held_is_refused(
    equation: str, message: str, remedy: str, closes: str | None
) -> None:
    m = laws()
    m.coupling("c", equation=equation, **({} if closes is None else {"closes": closes}))
    if equation == "x - held" and closes:
        assert m.derive()
        return
    with pytest.raises(eg.ModelError) as caught:
        m.derive()
    assert [(message in p.message, remedy in p.remedy) for p in caught.value.problems] == [(True, True)]
    assert caught.value.problems[0].path.startswith("constraints.c")


def test_the_law_of_an_element_in_an_equation() -> None:
    """y' = -2 x', by the damper's force: 6 x'' + 2 x' + 3 x = 0; a held rate and length are those of the slider."""
    m = laws()
    m.coupling("c", equation="y_dot - force(D)")
    run = m.compile(target="numpy").simulate(1.0, initial={"x": 1.0})
    decay, w = 1 / 6, np.sqrt(17) / 6
    x = np.exp(-decay * run.t) * (np.cos(w * run.t) + decay / w * np.sin(w * run.t))
    assert run["x"] == pytest.approx(x, abs=1e-7)
    assert run["y"] == pytest.approx(2 - 2 * x, abs=1e-7)
    for equation, end in (("rate(D) - 1", 2.0), ("length(K) - 1", 1.0), ("force(D) + 2", 2.0)):
        m = laws()
        m.coupling("c", equation=equation)
        speed = {} if "length" in equation else {"x_dot": 1.0}
        assert m.compile(target="numpy").simulate(1.0, initial=speed)["x"][-1] == pytest.approx(end, abs=1e-9)


def test_a_law_of_an_input_is_written_out_in_an_equation() -> None:
    m = laws()
    m.force("F", "a", ("u*x", 0, 0))
    m.coupling("c", equation="y_dot - force(F, on=a).x")
    with pytest.raises(eg.ModelError, match=r"the rate of the input 'u' in the law of .* is needed here and not known"):
        m.derive()
