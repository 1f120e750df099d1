"""Broken models: each fault is told with its file, line, dotted place and remedy, and all of them at once."""

from __future__ import annotations

import inspect
import re
from math import sqrt
from pathlib import Path

import numpy as np
import pytest
from model_files import EXAMPLES, SLIDER_CRANK, faults, load

import eomgen as eg

# piece of the slider-crank, what it becomes, then line, path, message and remedy (parts of them)
BROKEN = [
    ("tip, slider]", "tip, slidr]", 18, "joints.C.between[1]", "no body 'slidr'", "'slider'"),
    ("body: ground", "body: groun", 22, "forces.k1.between[0].body", "no body 'groun'", "'ground'"),
    ("pin_x: x(rod.tip)", "pin_x: x(rod.tap)", 23, "outputs.pin_x.expression", "no marker 'tap'", "'tip'"),
    ("  g: 9.81", "  g: 9.81\n  2r: 1", 10, "parameters.2r", "'2r' is not an identifier", "start with a letter"),
    ("  g: 9.81", "  g: 9.81\n  lambda: 1", 10, "parameters.lambda", "a reserved word of Python", "lambda_"),
    ("  g: 9.81", "  g: 9.81\n  t: 1", 10, "parameters.t", "'t' is reserved for the time", "another name"),
    ("  g: 9.81", "  g: 9.81\n  sqrt: 1", 10, "parameters.sqrt", "'sqrt' is a built-in function", "another name"),
    ("9.81", "9.81\n  s: 1", 20, "joints.D.coordinate", "'s' is already used by the parameter", "one namespace"),
    ("  g: 9.81", "  g: 9.81\n  theta_dot: 1", 17, "joints.A.coordinate", "'theta_dot' is already used", "rename one"),
    ("{tau:", "{g:", 10, "inputs.g", "'g' is already used by the parameter at parameters.g", "rename one"),
    ("speed: vx", "tau: vx", 23, "outputs.tau", "'tau' is already used by the input", "rename one"),
    ("speed: vx", "theta: vx", 23, "outputs.theta", "'theta' is a coordinate", "must be theta itself"),
    ("  D: {type", "  C: {type", 19, "joints.C", "given twice, first in line 18", "rename one"),
    (" s}", " theta}", 19, "joints.D.coordinate", "'theta' is already used by the coordinate", "rename"),
    ("value: tau}", "value: tua}", 21, "forces.motor.value", "unknown name 'tua'", "did you mean 'tau'?"),
    ("com: [l/2, 0, 0]", "com: [ell/2, 0, 0]", 13, "bodies.rod.com[0]", "unknown name 'ell'", "declare a parameter"),
    ("[l/2", "[theta", 13, "bodies.rod.com[0]", "the coordinate 'theta' cannot be used", "parameters"),
    ("200", "1 + theta", 22, "forces.k1.stiffness", "the coordinate 'theta' cannot be used", "numbers"),
    ("value: tau}", "value: ax(rod)}", 21, "forces.motor.value", "the acceleration of a marker 'ax(rod)' cannot", ""),
    ("200", "x(rod)", 22, "forces.k1.stiffness", "x(...) of a marker cannot be used", "the laws of"),
    ("axis: x", "axis: w", 19, "joints.D.axis", "'w' is not an axis", "x, y, z, -x, -y, -z or three numbers"),
    ("axis: x", "axis: [0, 0, 0]", 19, "joints.D.axis", "no length", "three numbers"),
    ("axis: x", "axs: x", 19, "joints.D.axs", "unknown key", "did you mean 'axis'?"),
    ("type: prismatic", "type: prismatik", 19, "joints.D.type", "no joint of type 'prismatik'", "'prismatic'"),
    ("{type: prismatic, ", "{", 19, "joints.D.type", "is missing", "revolute, continuous"),
    ("between: [ground, slider], axis", "axis", 19, "joints.D.between", "is missing", "two markers"),
    ("between: [ground, slider], axis", "between: [ground], axis", 19, "joints.D.between", "is not a list of two", ""),
    ("ground, slider", "rod, rod.tip", 19, "joints.D.between", "same body", "two bodies"),
    ("crank], c", "crank], sequence: xyz, c", 16, "joints.A.sequence", "has no", ""),
    ("coordinate: s}", "coordinates: [s, u]}", 19, "joints.D.coordinates", "2 names for a joint of 1", "name all 1"),
    ("mass: m_s", "mass: -0.5", 14, "bodies.slider.mass", "is -0.5", "0 or more"),
    ("m_s: {value: 0.5", "m_s: {value: -0.5", 14, "bodies.slider.mass", "-0.5 at the declared values", "0 or more"),
    ("mass: m_s", "com: [0, 0, 0]", 14, "bodies.slider.mass", "is missing", "a number or an expression"),
    ("mass: m_s", "mass: heavy stuff", 14, "bodies.slider.mass", "not a valid expression", "allowed are"),
    ("mass: m_s", "mass: true", 14, "bodies.slider.mass", "True is not a number", ""),
    ("mass: m_s", "mass: .inf", 14, "bodies.slider.mass", "not a finite number", ""),
    ("mass: m_s", "mass: m_s, colour: red", 14, "bodies.slider.colour", "unknown key", "allowed: mass, com"),
    ("slider: {mass: m_s}", "slider: 0.5", 14, "bodies.slider", "is not a mapping", "{key: value"),
    ("mass: m_s", "mass: 1, inertia: [1, 1, 5]", 14, "bodies.slider.inertia", "exceeds the sum", "centre of mass"),
    (": m_s", ": 1, inertia: {xx: 1, yy: 1, zz: 1, xy: 3}", 14, "bodies.slider.inertia", "negative principal", "sign"),
    (": m_s", ": 1, inertia: [[1, r, 0], [0, 1, 0], [0, 0, 1]]", 14, "bodies.slider.inertia", "symmetric", "[j][i]"),
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


def changed(old: str, new: str, text: str = SLIDER_CRANK) -> str:
    assert len(re.findall(re.escape(old), text)) == 1
    return text.replace(old, new)


@pytest.mark.parametrize(("old", "new", "line", "path", "message", "remedy"), BROKEN, ids=lambda x: str(x)[:30])
def test_each_fault(old: str, new: str, line: int, path: str, message: str, remedy: str, tmp_path: Path) -> None:
    problems = faults(tmp_path, changed(old, new))
    found = [p for p in problems if p.path == path]
    assert found, [str(p) for p in problems]
    problem = next((p for p in found if message in p.message), found[0])
    assert message in problem.message
    assert remedy in problem.remedy
    assert problem.file == str(tmp_path / "model.yaml")
    assert problem.line == line, str(problem)
    assert str(problem).startswith(f"{problem.file}:{line}: {path}: ")


def test_one_fault_is_reported_once(tmp_path: Path) -> None:
    """A misspelt type, name or value does not put everything at fault that refers to it."""
    for old, new in [
        ("type: prismatic", "type: prismatik"),
        ("between: [rod.tip, slider]", "between: [rod.tip, slidr]"),
        ("mass: m_s}", "mass: m_s}\n  my-body: {mass: 1}"),
        ("coordinate: theta}", "coordinate: theta, axis: q}"),
        ("slider: {mass: m_s}", "slider: 0.5"),
    ]:
        problems = faults(tmp_path, changed(old, new))
        assert len(problems) == 1, [str(p) for p in problems]


@pytest.mark.quick
def test_all_faults_come_at_once_in_the_order_of_the_file(tmp_path: Path) -> None:
    text, wanted = SLIDER_CRANK, set()
    for old, new, line, path, *_ in BROKEN:
        if (
            path in ("joints.C.between[1]", "forces.motor.value", "forces.k1.stiffnes", "simulation.end")
            and old in text
        ):
            text = changed(old, new, text)
            wanted.add((line, path))
    problems = faults(tmp_path, text)
    assert len(wanted) == 4
    assert wanted <= {(p.line, p.path) for p in problems}
    assert [p.line for p in problems] == sorted(p.line for p in problems)


def test_a_parameter_may_lack_a_value_until_it_is_needed(tmp_path: Path) -> None:
    text = changed("  l: {value: 0.35, unit: m}", "  l: {unit: m}").replace("{value: 1.0, unit: kg}", "")
    m = load(tmp_path, text)
    assert "l" in map(str, m.derive().parameters)
    with pytest.raises(eg.ModelError) as caught:
        m.compile(target="numpy")
    first, second = caught.value.problems
    assert str(first).startswith(f"{tmp_path / 'model.yaml'}:5: parameters.l: has no value; ")
    assert second.path == "parameters.m_c"


# -- in Python --------------------------------------------------------------------------------------------------------
def told(m: eg.Model) -> dict[str, str]:
    with pytest.raises(eg.ModelError) as caught:
        m.check()
    assert {p.file for p in caught.value.problems} <= {"", __file__}  # of the calls
    return {p.path: f"{p.message}; {p.remedy}" for p in caught.value.problems}


def test_the_same_paths_in_python() -> None:
    m = eg.Model("arm")
    m.parameter("tau", 1)
    m.parameter("I", "abc")
    rod, crank = m.body("rod", mass=1), m.body("crank", mass=1)
    m.revolute("A", m.ground, rod, coordinate="q")
    m.prismatic("D", rod, crank, coordinate="s")
    m.body("rod", mass=1)
    m.revolute("A", m.ground, "rood", axis="q")
    ball = m.spherical("S", m.ground, m.body("ball", mass=1), coordinates=("e1", "e2"))
    turn = m.spherical("T", m.ground, m.body("top", mass=1))
    m.joint("hinge", "H", m.ground, "crank")
    m.torque("motor", ball, 1)
    m.torque("mot", turn, 1)
    m.friction("rub", "T_4", 1)
    m.torsional_spring("twist", "s", stiffness=1)
    m.torque("kick", "crank", (1, 2, "tau +"))
    m.force("push", "rod.end", (0, 0, 0))
    crank.marker("m", at=(1, 2))
    m.output("odd", m.coordinate("phi") * 2)
    m.independent("p", "s")
    m.initial(thet=1)
    problems = told(m)
    assert problems["bodies.rod"] == "the name is given to two bodies; rename one"
    assert problems["joints.A"] == "the name is given to two joints; rename one"
    assert problems["forces.mot.joint"] == "joint 'T' has 3 coordinates; name one of them: T_1, T_2, T_3"
    assert "did you mean 'T_" in problems["forces.rub.joint"]
    assert problems["forces.twist.joint"].startswith("the coordinate 's' is a length")
    assert set(problems) == {
        *("bodies.rod", "bodies.crank.markers.m.at", "joints.A", "joints.S.coordinates", "joints.H.type"),
        *("forces.mot.joint", "forces.rub.joint", "forces.twist.joint", "forces.kick.value[2]"),
        *("forces.push.marker", "outputs.odd.expression", "independent[0]", "initial.thet", "parameters.I.value"),
    }


def test_empty_and_double_models() -> None:
    assert "bodies" in told(eg.Model("empty"))
    both = eg.Model.from_lagrangian("both", "q_dot**2/2", ["q"])
    both.body("b", mass=1)
    assert "lagrangian" in told(both)
    assert told(eg.Model("double"))["name"].startswith("'double' is a reserved word of C")
    for name in ("numpy", "eomgen"):  # a package of this name would hide the library
        assert f"{name}_model" in told(eg.Model(name))["name"]


def test_faults_name_the_line_of_the_call() -> None:
    here = inspect.currentframe()
    assert here is not None
    m = eg.Model("m")
    m.revolute("ja", m.ground, m.body("a", mass=1), coordinate="qa")
    m.prismatic("jb", m.ground, m.body("b", mass=1), coordinate="qb")
    m.revolute("ja", "a.tip", "b", coordinate="other")
    m.body("c", mass=-1)
    m.bodies["c"].marker("tip", ("length", 0, 0))
    m.output("height", "nothing")
    last = here.f_lineno
    with pytest.raises(eg.ModelError) as found:
        m.check()
    lines = {p.path: p.line for p in found.value.problems if p.file == __file__}
    assert lines["joints.ja"] == last - 4
    assert lines["bodies.c.mass"] == last - 3
    assert lines["bodies.c.markers.tip.at[0]"] == last - 2
    assert lines["outputs.height.expression"] == last - 1
    assert f"{__file__}:{last - 3}: bodies.c.mass: is -1" in str(found.value)


# -- files that are no model ------------------------------------------------------------------------------------------
REFUSED = {
    "alias": ("name: a\ngravity: &g [0, 0, 0]\nindependent: *g\n", 2, "the anchor &g"),
    "undefined alias": ("name: *nothing\n", 1, "the alias *nothing"),
    "tag": ("name: a\ndoc: !!python/object/apply:os.system [ls]\n", 2, "the tag"),
    "duplicate key": ("name: a\nname: b\n", 2, "given twice, first in line 1"),
    "deep brackets": ("gravity: " + "[" * 5000, 1, "nested too deeply"),
    "deep blocks": ("".join(" " * k + "a:\n" for k in range(200)), None, "nested too deeply"),
    "key that is a list": ("? [a, b]\n: 1\n", 1, "a key is not a name"),
    "merge key": ("name: a\n<<: {doc: b}\n", 2, "unknown key"),
    "two documents": ("name: a\n---\nname: b\n", 3, "a second YAML document"),
    "empty": ("# nothing\n", 1, "the file is empty"),
    "list": ("- a\n", 1, "is not a mapping"),
    "tab": ("name: a\n\tdoc: b\n", 2, "not YAML"),
    "open quote": ('name: a\ndoc: "b\n', 3, "not YAML"),
    "control character": ("name: a\ndoc: \x01\n", 2, "not YAML"),
    "section of the wrong kind": ("name: a\nbodies: [b, c]\n", 2, "is not a mapping"),
    "text that a comma cut": ("name: a\nparameters: {r: {doc: length (m, in x)}}\n", 2, "needs quotes"),
    "too many values": ("name: a\nindependent: [" + "a," * 120_000 + "a]\n", None, "too many values"),
    "too large": ("# " + "x" * 2_000_000, None, "too large"),
}


SLOW = pytest.param("too many values", marks=pytest.mark.thorough)


@pytest.mark.parametrize("case", [SLOW if case == "too many values" else case for case in REFUSED])
def test_refused(case: str, tmp_path: Path) -> None:
    text, line, message = REFUSED[case]
    problems = faults(tmp_path, text)
    found = [p for p in problems if message in str(p)]
    assert found, [str(p)[:500] for p in problems]
    assert line is None or found[0].line == line
    assert found[0].file.endswith("model.yaml")


def test_faults_of_the_file_and_of_the_model_come_together(tmp_path: Path) -> None:
    problems = faults(tmp_path, "name: 1a\nbodies: &b {c: {mass: -1}}\nforses: {}\n")
    assert [p.path for p in problems] == ["name", "bodies", "bodies.c.mass", "bodies.c", "forses"]


def test_not_text(tmp_path: Path) -> None:
    path = tmp_path / "binary.yaml"
    path.write_bytes(b"name: a\ndoc: \xff\xfe\n")
    with pytest.raises(eg.ModelError, match=r"binary.yaml:2: file: is not UTF-8 text"):
        eg.load(path)


# -- models that no motion can mend -----------------------------------------------------------------------------------
def disc(joint: str, **keys: str) -> eg.Model:
    m = eg.Model("disc", gravity=(0, 0, -9.81))
    d = m.body("d", mass=1, inertia=(0.25, 0.25, 0.5))
    getattr(m, joint)("f", m.ground, d, **keys)
    m.rolling("r", d, radius=1)
    return m


def test_a_disc_that_lies_flat_at_the_start_is_reported_with_the_remedy() -> None:
    with pytest.raises(
        eg.AssemblyError, match=r"constraints\.r: .*not finite.*the disc lies flat.*tilt the disc in initial"
    ):
        disc("free").check()


def test_a_disc_that_can_only_lie_flat_is_refused() -> None:
    with pytest.raises(eg.ModelError, match=r"constraints\.r: d always lies flat"):
        disc("revolute").check()


def test_a_disc_that_has_fallen_flat_is_named() -> None:
    m = disc("free", rotation="euler_parameters")
    m.initial(f_e0=0.8, f_e1=0.6)
    module = m.compile(target="numpy")
    x = np.zeros(module.n_x)
    x[module.x_names.index("f_e0")] = 1.0
    with pytest.raises(eg.EvaluationError, match=r"constraint 'r': the disc lies flat"):
        module.rhs(0.0, x)


@pytest.mark.parametrize("kind", ["spring", "damper"])
def test_a_line_between_points_that_always_coincide_is_refused(kind: str) -> None:
    m = eg.Model("coincident")
    a = m.body("a", mass=1, com=(0, -1, 0))
    m.revolute("A", m.ground, a)
    law = {"stiffness": 1, "length": 0.2} if kind == "spring" else {"damping": 1}
    getattr(m, kind)("Z", m.ground, a, **law)
    getattr(m, kind)("Y", a, a, **law)
    with pytest.raises(eg.ModelError) as caught:
        m.check()
    assert [p.path for p in caught.value.problems] == ["forces.Z", "forces.Y"]
    assert all(p.message == "both ends are always at the same point" for p in caught.value.problems)


# -- the start: check refuses what a run refuses, by the same assembly ------------------------------------------------
ARM = """
name: arm
gravity: [0, -9.81, 0]
parameters: {l: {value: 1.0, unit: m}, k: {unit: rad VALUE}}
bodies:
  rod: {mass: 1, com: [l/2, 0, 0], inertia: {xx: 0.1, yy: 0.1, zz: 0.1}, markers: {tip: [l, 0, 0]}}
joints:
  A: {type: JOINT, between: [ground, rod]}
outputs: {tip_x: x(rod.tip), tip_vx: vx(rod.tip), tip_ax: ax(rod.tip), square: vx(rod.tip)**2}
initial: {INITIAL}
"""
HINGE, BALL = "revolute, coordinate: q, limits: {lower: -1, upper: 1}", "spherical, rotation: euler_parameters"


def arm(initial: str, joint: str = HINGE, value: str = ", value: 0.3") -> str:
    return ARM.replace("INITIAL", initial).replace("JOINT", joint).replace(" VALUE", value)


def four_bar(initial: str) -> str:
    text = (EXAMPLES / "four_bar.yaml").read_text(encoding="utf-8")
    kept = [line for line in text.splitlines() if not line.startswith("initial:")]
    return "\n".join([*kept, f"initial: {{{initial}}}"])


FINE = [
    arm("q: 0.3, q_dot: 1"),
    arm("tip_x: 0.3"),
    arm("x(rod.tip): 0.3"),
    arm("q: 0.3, tip_vx: 1"),
    arm("q: k"),
    arm(f"A_e0: {sqrt(0.5)!r}, A_e1: {sqrt(0.5)!r}", BALL),
    four_bar("theta: 1.0, theta_dot: 3"),
    four_bar("psi: 1.0, psi_dot: 3"),
]
WRONG = [  # the text, and the place and the words of the fault
    (arm("tip_x: 3"), "initial.tip_x", "cannot close with tip_x = 3"),  # the rod is 1 m long
    (arm("x(rod.tip): 3"), "initial.x(rod.tip)", "cannot close"),
    (arm("q: 0.3, tip_x: 0.1"), "initial.tip_x", "inconsistent"),
    (arm("q: 0, tip_vx: 1"), "initial.tip_vx", "inconsistent"),  # it moves across x there
    (arm("tip_ax: 1"), "initial.tip_ax", "depends on accelerations"),
    (arm("square: 1"), "initial.square", "not linearly"),
    (arm("q: k", value=""), "parameters.k", "has no value"),
    (arm("A_e0: 0.5, A_e1: 0.5", BALL), "", "length 0.707107, not 1"),
    (
        four_bar("theta: 1.0, theta_dot: 1, psi_dot: 100"),
        "initial.theta_dot",
        "velocities theta_dot = 1, psi_dot = 100",
    ),
    (four_bar("theta: 1.0, psi: 0.1"), "joints.C", "inconsistent"),
]


@pytest.mark.parametrize("text", FINE)
@pytest.mark.filterwarnings("ignore")
def test_check_and_run_accept(text: str, tmp_path: Path) -> None:
    m = load(tmp_path, text)
    m.compile(target="numpy").simulate((0, 1e-3))
    assert not any("not checked" in note for note in m.check().notes)


@pytest.mark.parametrize(("text", "place", "said"), WRONG)
@pytest.mark.filterwarnings("ignore")
def test_check_and_run_refuse(text: str, place: str, said: str, tmp_path: Path) -> None:
    m = load(tmp_path, text)
    with pytest.raises(eg.EomgenError):
        m.compile(target="numpy").simulate((0, 1e-3))
    with pytest.raises((eg.AssemblyError, eg.ModelError)) as told:
        m.check()
    assert place in str(told.value)
    assert said in str(told.value)


def test_a_start_beyond_a_limit_is_noted_as_a_run_warns(tmp_path: Path) -> None:
    mod = load(tmp_path, arm("q: 2")).compile(target="numpy")
    with pytest.warns(UserWarning, match="passes limits of joints: q upper 1"):
        mod.simulate((0, 1e-3))
    (note,) = (note for note in load(tmp_path, arm("q: 2")).check().notes if "limit" in note)
    assert note.startswith("q starts at 2, beyond its upper limit 1")
    assert not [note for note in load(tmp_path, arm("q: 1")).check().notes if "limit" in note]
