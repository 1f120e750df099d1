"""Broken models: each fault is told with its file, line, dotted place and remedy, and all of them at once."""

from __future__ import annotations

import pytest

from eomgen import Model, load
from eomgen.errors import ModelError

# piece of the slider-crank, what it becomes, then line, path, message and remedy (parts of them)
BROKEN = [
    (
        "between: [rod.tip, slider]",
        "between: [rod.tip, slidr]",
        18,
        "joints.C.between[1]",
        "no body 'slidr'",
        "'slider'",
    ),
    (
        "between: [rod.tip, slider]",
        "between: [rod.tipp, slider]",
        18,
        "joints.C.between[0]",
        "no marker 'tipp'",
        "'tip'",
    ),
    (
        "[{body: ground, at: [0.5",
        "[{body: groun, at: [0.5",
        22,
        "forces.k1.between[0].body",
        "no body 'groun'",
        "'ground'",
    ),
    ("pin_x: x(rod.tip)", "pin_x: x(rod.tap)", 23, "outputs.pin_x.expression", "no marker 'tap'", "'tip'"),
    ("pin_x: x(rod.tip)", "pin_x: x(road)", 23, "outputs.pin_x.expression", "no body 'road'", "'rod'"),
    ("  g: 9.81", "  g: 9.81\n  2r: 1", 10, "parameters.2r", "'2r' is not an identifier", "start with a letter"),
    ("  g: 9.81", "  g: 9.81\n  lambda: 1", 10, "parameters.lambda", "a reserved word of Python", "lambda_"),
    ("  g: 9.81", "  g: 9.81\n  double: 1", 10, "parameters.double", "a reserved word of C", "double_"),
    ("  g: 9.81", "  g: 9.81\n  t: 1", 10, "parameters.t", "'t' is reserved for the time", "another name"),
    ("  g: 9.81", "  g: 9.81\n  sqrt: 1", 10, "parameters.sqrt", "'sqrt' is a built-in function", "another name"),
    (
        "  g: 9.81",
        "  g: 9.81\n  s: 1",
        20,
        "joints.D.coordinate",
        "'s' is already used by the parameter",
        "one namespace",
    ),
    ("  g: 9.81", "  g: 9.81\n  theta_dot: 1", 17, "joints.A.coordinate", "'theta_dot' is already used", "rename one"),
    (
        "inputs: {tau",
        "inputs: {g",
        10,
        "inputs.g",
        "'g' is already used by the parameter at parameters.g",
        "rename one",
    ),
    ("speed: vx", "tau: vx", 23, "outputs.tau", "'tau' is already used by the input", "rename one"),
    ("speed: vx", "theta: vx", 23, "outputs.theta", "'theta' is a coordinate", "must be theta itself"),
    ("  D: {type", "  C: {type", 19, "joints.C", "given twice, first in line 18", "rename one"),
    (
        "coordinate: s}",
        "coordinate: theta}",
        19,
        "joints.D.coordinate",
        "'theta' is already used by the coordinate",
        "rename",
    ),
    ("value: tau}", "value: tua}", 21, "forces.motor.value", "unknown name 'tua'", "did you mean 'tau'?"),
    ("com: [l/2, 0, 0]", "com: [ell/2, 0, 0]", 13, "bodies.rod.com[0]", "unknown name 'ell'", "declare a parameter"),
    (
        "com: [l/2, 0, 0]",
        "com: [theta, 0, 0]",
        13,
        "bodies.rod.com[0]",
        "the coordinate 'theta' cannot be used",
        "parameters",
    ),
    (
        "stiffness: 200",
        "stiffness: 1 + theta",
        22,
        "forces.k1.stiffness",
        "the coordinate 'theta' cannot be used",
        "numbers",
    ),
    (
        "value: tau}",
        "value: ax(rod)}",
        21,
        "forces.motor.value",
        "the acceleration of a marker 'ax(rod)' cannot",
        "and outputs of these",
    ),
    (
        "stiffness: 200",
        "stiffness: x(rod)",
        22,
        "forces.k1.stiffness",
        "x(...) of a marker cannot be used",
        "the laws of",
    ),
    ("value: tau}", "value: sped}", 21, "forces.motor.value", "unknown name 'sped'", "known here"),
    ("axis: x", "axis: w", 19, "joints.D.axis", "'w' is not an axis", "x, y, z, -x, -y, -z or three numbers"),
    ("axis: x", "axis: [0, 0, 0]", 19, "joints.D.axis", "no length", "three numbers"),
    ("axis: x", "axs: x", 19, "joints.D.axs", "unknown key", "did you mean 'axis'?"),
    ("type: prismatic", "type: prismatik", 19, "joints.D.type", "no joint of type 'prismatik'", "'prismatic'"),
    ("{type: prismatic, ", "{", 19, "joints.D.type", "is missing", "revolute, continuous"),
    ("between: [ground, slider], axis", "axis", 19, "joints.D.between", "is missing", "two markers"),
    ("between: [ground, slider], axis", "between: [ground], axis", 19, "joints.D.between", "is not a list of two", ""),
    (
        "between: [ground, slider], axis",
        "between: [rod, rod.tip], axis",
        19,
        "joints.D.between",
        "same body",
        "two bodies",
    ),
    (
        "[ground, crank], coordinate",
        "[ground, crank], sequence: xyz, coordinate",
        16,
        "joints.A.sequence",
        "has no",
        "",
    ),
    ("coordinate: s}", "coordinates: [s, u]}", 19, "joints.D.coordinates", "2 names for a joint of 1", "name all 1"),
    ("mass: m_s", "mass: -0.5", 14, "bodies.slider.mass", "is -0.5", "0 or more"),
    ("m_s: {value: 0.5", "m_s: {value: -0.5", 14, "bodies.slider.mass", "-0.5 at the declared values", "0 or more"),
    ("mass: m_s", "com: [0, 0, 0]", 14, "bodies.slider.mass", "is missing", "a number or an expression"),
    ("mass: m_s", "mass: heavy stuff", 14, "bodies.slider.mass", "not a valid expression", "allowed are"),
    ("mass: m_s", "mass: [1, 2]", 14, "bodies.slider.mass", "[1, 2] is not a number", ""),
    ("mass: m_s", "mass: yes", 14, "bodies.slider.mass", "unknown name 'yes'", "parameter"),
    ("mass: m_s", "mass: true", 14, "bodies.slider.mass", "True is not a number", ""),
    ("mass: m_s", "mass: .inf", 14, "bodies.slider.mass", "not a finite number", ""),
    ("mass: m_s", "mass: m_s, colour: red", 14, "bodies.slider.colour", "unknown key", "allowed: mass, com"),
    ("slider: {mass: m_s}", "slider: 0.5", 14, "bodies.slider", "is not a mapping", "{key: value"),
    ("mass: m_s", "mass: 1, inertia: [1, 1, 5]", 14, "bodies.slider.inertia", "exceeds the sum", "centre of mass"),
    (
        "mass: m_s",
        "mass: 1, inertia: {xx: 1, yy: 1, zz: 1, xy: 3}",
        14,
        "bodies.slider.inertia",
        "negative principal",
        "sign",
    ),
    (
        "mass: m_s",
        "mass: 1, inertia: [[1, r, 0], [0, 1, 0], [0, 0, 1]]",
        14,
        "bodies.slider.inertia",
        "symmetric",
        "[j][i]",
    ),
    ("mass: m_s", "mass: 1, inertia: {zx: 1}", 14, "bodies.slider.inertia.zx", "unknown key", "xz"),
    ("mass: m_s}", "mass: m_s}\n  spare: {mass: 1}", 15, "bodies.spare", "no chain of joints", "type free"),
    ("mass: m_s}", "mass: m_s}\n  my-body: {mass: 1}", 15, "bodies.my-body", "not an identifier", "letters"),
    ("{tip: {at", "{t-p: [0, 0, 0], tip: {at", 13, "bodies.rod.markers.t-p", "not an identifier", "letters"),
    ("{tip: {at: [l, 0, 0]", "{tip: {at: [l, 0]", 13, "bodies.rod.markers.tip.at", "is not three numbers", ""),
    ("type: torque", "type: tork", 21, "forces.motor.type", "no force of type 'tork'", "did you mean 'torque'?"),
    ("joint: A, value", "value", 21, "forces.motor", "joint or body is missing", "joint, body"),
    ("joint: A, value", "joint: A, body: rod, value", 21, "forces.motor", "both joint and body are", "joint, body"),
    ("joint: A, value", "joint: AA, value", 21, "forces.motor.joint", "no joint 'AA'", "did you mean 'A'?"),
    ("stiffness: 200, ", "", 22, "forces.k1.stiffness", "is missing", "a number or an expression"),
    ("stiffness: 200", "stiffnes: 200", 22, "forces.k1.stiffnes", "unknown key", "did you mean 'stiffness'?"),
    ("independent: [theta]", "independent: [tetha]", 24, "independent[0]", "no coordinate 'tetha'", "'theta'"),
    ("independent: [theta]", "independent: [theta, theta]", 24, "independent[1]", "named twice", "once"),
    ("theta_dot: 10", "thetadot: 10", 25, "initial.thetadot", "no coordinate, velocity or output", "'theta_dot'"),
    ("theta_dot: 10", "theta_dot: q", 25, "initial.theta_dot", "unknown name 'q'", ""),
    ("end: 5", "end: -5", 26, "simulation.end", "-5 is not a number greater than 0", ""),
    ("method: DOP853", "method: DOP85", 26, "simulation.method", "'DOP85' is not known", "did you mean 'DOP853'?"),
    ("value: 0.1, unit", "value: m_c/2, unit", 4, "parameters.r.value", "'m_c' cannot be used here", "numbers and pi"),
    ("unit: m, doc", "unit: 3, doc", 4, "parameters.r.unit", "3 is not a text", ""),
    ("name: slider_crank", "name: slider-crank", 1, "name", "not an identifier", "letters"),
    ("name: slider_crank", "doc: none", 1, "name", "is missing", "name"),
    ("independent: [theta]", "independant: [theta]", 24, "independant", "unknown key", "did you mean 'independent'?"),
    ("[0, -g, 0]", "[0, -g]", 2, "gravity", "is not three numbers", ""),
    ("[0, -g, 0]", "[0, -g*t, 0]", 2, "gravity[1]", "the time 't' cannot be used here", "parameters"),
]


@pytest.mark.parametrize(("old", "new", "line", "path", "message", "remedy"), BROKEN, ids=lambda x: str(x)[:30])
def test_each_fault(old, new, line, path, message, remedy, change, problems_of) -> None:
    problems = problems_of(change(old, new))
    found = [p for p in problems if p.path == path]
    assert found, [str(p) for p in problems]
    problem = next((p for p in found if message in p.message), found[0])
    assert message in problem.message
    assert remedy in problem.remedy
    assert problem.file.endswith("model.yaml")
    assert problem.line == line, str(problem)
    assert str(problem).startswith(f"{problem.file}:{line}: {path}: ")


def test_one_fault_is_told_once(change, problems_of) -> None:
    """A misspelt type, name or value does not put everything at fault that refers to it."""
    for old, new in [
        ("type: prismatic", "type: prismatik"),
        ("between: [rod.tip, slider]", "between: [rod.tip, slidr]"),
        ("mass: m_s}", "mass: m_s}\n  my-body: {mass: 1}"),
        ("coordinate: theta}", "coordinate: theta, axis: q}"),
        ("slider: {mass: m_s}", "slider: 0.5"),
    ]:
        problems = problems_of(change(old, new))
        assert len(problems) == 1, [str(p) for p in problems]


def test_all_faults_come_at_once_in_the_order_of_the_file(change, problems_of, slider_crank_text) -> None:
    text = slider_crank_text
    wanted = []
    for old, new, line, path, *_ in BROKEN:
        if (
            path in ("joints.C.between[1]", "forces.motor.value", "forces.k1.stiffnes", "simulation.end")
            and old in text
        ):
            text = text.replace(old, new)
            wanted.append((line, path))
    problems = problems_of(text)
    assert {path for _, path in wanted} <= {p.path for p in problems}
    assert [p.line for p in problems] == sorted(p.line for p in problems)
    assert len(wanted) == 4


def test_a_parameter_may_lack_a_value_until_it_is_needed(change, write) -> None:
    path = write(change("  l: {value: 0.35, unit: m}", "  l: {unit: m}").replace("{value: 1.0, unit: kg}", ""))
    m = load(path).mechanism()
    with pytest.raises(ModelError) as caught:
        m.require_values()
    first, second = caught.value.problems
    assert str(first).startswith(f"{path}:5: parameters.l: has no value; ")
    assert second.path == "parameters.m_c"


def python_problems(m: Model) -> dict[str, str]:
    with pytest.raises(ModelError) as caught:
        m.mechanism()
    assert {p.file for p in caught.value.problems} <= {"", __file__}  # of the calls
    return {p.path: f"{p.message}; {p.remedy}" for p in caught.value.problems}


def test_the_same_paths_in_python(slider_crank: Model) -> None:
    m = slider_crank
    m.body("rod", mass=1)
    m.revolute("A", m.ground, "rood", axis="q")
    m.spherical("S", m.ground, "crank", coordinates=("e1", "e2"))
    m.joint("hinge", "H", m.ground, "crank")
    m.torque("motor", "S", 1)
    m.torque("kick", "crank", (1, 2, "tau +"))
    m.force("push", "rod.end", (0, 0, 0))
    m.bodies["crank"].marker("m", at=(1, 2))
    m.output("odd", m.coordinate("phi") * 2)
    m.independent("q", "s")
    m.initial(thet=1)
    m.parameter("I", "abc")
    problems = python_problems(m)
    assert {
        "bodies.rod": "the name is given to two bodies; rename one",
        "joints.A": "the name is given to two joints; rename one",
    }.items() <= problems.items()
    assert set(problems) == {
        "bodies.rod",
        "bodies.crank.markers.m.at",
        "joints.A",
        "joints.S.coordinates",
        "joints.H.type",
        "forces.motor",
        "forces.kick.value[2]",
        "forces.push.marker",
        "outputs.odd.expression",
        "independent[0]",
        "initial.thet",
        "parameters.I.value",
    }


def test_joints_of_several_degrees_need_a_coordinate(slider_crank: Model) -> None:
    m = slider_crank
    ball = m.body("ball", mass=1)
    joint = m.spherical("S", m.ground, ball)
    m.torque("a", joint, 1)
    m.friction("b", "S_4", 1)
    m.torsional_spring("c", "s", stiffness=1)
    problems = python_problems(m)
    assert problems["forces.a.joint"] == "joint 'S' has 3 coordinates; name one of them: S_1, S_2, S_3"
    assert "did you mean 'S_" in problems["forces.b.joint"]
    assert problems["forces.c.joint"].startswith("the coordinate 's' is a length")


def test_empty_and_double_models() -> None:
    assert "bodies" in python_problems(Model("empty"))
    both = Model.from_lagrangian("both", "q_dot**2/2", ["q"])
    both.body("b", mass=1)
    assert "lagrangian" in python_problems(both)
    assert python_problems(Model("double"))["name"].startswith("'double' is a reserved word of C")
