"""Broken models: each fault is told with its file, line, dotted place and remedy, and all of them at once."""

import inspect
import re
from math import sqrt
from pathlib import Path

import numpy as np
import pytest
from model_files import EXAMPLES, SLIDER_CRANK, faults, load
from refusals import refuses

import eomgen as eg

# piece of the slider-crank, what it becomes, then line, path, code and what the fault tells
BROKEN = [
    ("tip, slider]", "tip, slidr]", 18, "joints.C.between[1]", "EG-NAME-UNKNOWN slidr 'slider'?"),
    ("body: ground", "body: groun", 22, "forces.k1.between[0].body", "EG-NAME-UNKNOWN groun 'ground'?"),
    ("pin_x: x(rod.tip)", "pin_x: x(rod.tap)", 23, "outputs.pin_x.expression", "EG-NAME-UNKNOWN tap 'tip'?"),
    ("  g: 9.81", "  g: 9.81\n  2r: 1", 10, "parameters.2r", "EG-NAME-FORM '2r'"),
    ("  g: 9.81", "  g: 9.81\n  lambda: 1", 10, "parameters.lambda", "EG-NAME-FORM lambda_"),
    ("  g: 9.81", "  g: 9.81\n  t: 1", 10, "parameters.t", "EG-NAME-FORM 't' time"),
    ("  g: 9.81", "  g: 9.81\n  sqrt: 1", 10, "parameters.sqrt", "EG-NAME-FORM sqrt_"),
    ("9.81", "9.81\n  s: 1", 20, "joints.D.coordinate", "EG-NAME-TAKEN 's' parameters.s"),
    ("  g: 9.81", "  g: 9.81\n  theta_dot: 1", 17, "joints.A.coordinate", "EG-NAME-TAKEN parameters.theta_dot"),
    ("{tau:", "{g:", 10, "inputs.g", "EG-NAME-TAKEN 'g' parameters.g"),
    ("speed: vx", "tau: vx", 23, "outputs.tau", "EG-NAME-TAKEN 'tau' inputs.tau"),
    ("speed: vx", "theta: vx", 23, "outputs.theta", "EG-NAME-TAKEN 'theta' coordinate"),
    ("  D: {type", "  C: {type", 19, "joints.C", "EG-FILE-DAMAGED 18"),
    (" s}", " theta}", 19, "joints.D.coordinate", "EG-NAME-TAKEN theta"),
    ("value: tau}", "value: tua}", 21, "forces.motor.value", "EG-NAME-UNKNOWN tua 'tau'?"),
    ("com: [l/2, 0, 0]", "com: [ell/2, 0, 0]", 13, "bodies.rod.com[0]", "EG-NAME-UNKNOWN ell"),
    ("[l/2", "[theta", 13, "bodies.rod.com[0]", "EG-REFERENCE theta"),
    ("200", "1 + theta", 22, "forces.k1.stiffness", "EG-REFERENCE theta"),
    ("value: tau}", "value: ax(rod)}", 21, "forces.motor.value", "EG-REFERENCE ax(rod)"),
    ("200", "x(rod)", 22, "forces.k1.stiffness", "EG-EXPRESSION x(...)"),
    ("axis: x", "axis: w", 19, "joints.D.axis", "EG-TYPE w"),
    ("axis: x", "axis: [0, 0, 0]", 19, "joints.D.axis", "EG-RANGE length"),
    ("axis: x", "axs: x", 19, "joints.D.axs", "EG-NAME-UNKNOWN 'axis'?"),
    ("type: prismatic", "type: prismatik", 19, "joints.D.type", "EG-CHOICE prismatik 'prismatic'?"),
    ("{type: prismatic, ", "{", 19, "joints.D.type", "EG-MISSING revolute"),
    ("between: [ground, slider], axis", "axis", 19, "joints.D.between", "EG-MISSING"),
    ("between: [ground, slider], axis", "between: [ground], axis", 19, "joints.D.between", "EG-TYPE two"),
    ("ground, slider", "rod, rod.tip", 19, "joints.D.between", "EG-REFERENCE rod rod.tip"),
    ("crank], c", "crank], sequence: xyz, c", 16, "joints.A.sequence", "EG-NAME-UNKNOWN revolute 'sequence'"),
    ("coordinate: s}", "coordinates: [s, u]}", 19, "joints.D.coordinates", "EG-SHAPE 2 1"),
    ("mass: m_s", "mass: -0.5", 14, "bodies.slider.mass", "EG-INERTIA -0.5"),
    ("m_s: {value: 0.5", "m_s: {value: -0.5", 14, "bodies.slider.mass", "EG-INERTIA -0.5"),
    ("mass: m_s", "com: [0, 0, 0]", 14, "bodies.slider.mass", "EG-MISSING"),
    ("mass: m_s", "mass: heavy stuff", 14, "bodies.slider.mass", "EG-EXPRESSION between"),
    ("mass: m_s", "mass: true", 14, "bodies.slider.mass", "EG-TYPE True"),
    ("mass: m_s", "mass: .inf", 14, "bodies.slider.mass", "EG-NUMBER inf"),
    ("mass: m_s", "mass: m_s, colour: red", 14, "bodies.slider.colour", "EG-NAME-UNKNOWN mass, com"),
    ("slider: {mass: m_s}", "slider: 0.5", 14, "bodies.slider", "EG-TYPE mapping"),
    ("mass: m_s", "mass: 1, inertia: [1, 1, 5]", 14, "bodies.slider.inertia", "EG-INERTIA 5"),
    (": m_s", ": 1, inertia: {xx: 1, yy: 1, zz: 1, xy: 3}", 14, "bodies.slider.inertia", "EG-INERTIA -2"),
    (": m_s", ": 1, inertia: [[1, r, 0], [0, 1, 0], [0, 0, 1]]", 14, "bodies.slider.inertia", "EG-INERTIA symmetric"),
    ("mass: m_s", "mass: 1, inertia: {zx: 1}", 14, "bodies.slider.inertia.zx", "EG-NAME-UNKNOWN xz"),
    ("mass: m_s}", "mass: m_s}\n  spare: {mass: 1}", 15, "bodies.spare", "EG-TOPOLOGY"),
    ("mass: m_s}", "mass: m_s}\n  my-body: {mass: 1}", 15, "bodies.my-body", "EG-NAME-FORM"),
    ("{tip: {at", "{t-p: [0, 0, 0], tip: {at", 13, "bodies.rod.markers.t-p", "EG-NAME-FORM"),
    ("{tip: {at: [l, 0, 0]", "{tip: {at: [l, 0]", 13, "bodies.rod.markers.tip.at", "EG-TYPE three"),
    ("type: torque", "type: tork", 21, "forces.motor.type", "EG-CHOICE tork 'torque'?"),
    ("joint: A, value", "value", 21, "forces.motor", "EG-CONFLICT missing joint body"),
    ("joint: A, value", "joint: A, body: rod, value", 21, "forces.motor", "EG-CONFLICT both joint body"),
    ("joint: A, value", "joint: AA, value", 21, "forces.motor.joint", "EG-NAME-UNKNOWN AA 'A'?"),
    ("stiffness: 200, ", "", 22, "forces.k1.stiffness", "EG-MISSING"),
    ("stiffness: 200", "stiffnes: 200", 22, "forces.k1.stiffnes", "EG-NAME-UNKNOWN 'stiffness'?"),
    ("independent: [theta]", "independent: [tetha]", 24, "independent[0]", "EG-NAME-UNKNOWN tetha 'theta'?"),
    ("independent: [theta]", "independent: [theta, theta]", 24, "independent[1]", "EG-CONFLICT 'theta'"),
    ("theta_dot: 10", "thetadot: 10", 25, "initial.thetadot", "EG-NAME-UNKNOWN 'theta_dot'?"),
    ("theta_dot: 10", "theta_dot: q", 25, "initial.theta_dot", "EG-NAME-UNKNOWN q"),
    ("end: 5", "end: -5", 26, "simulation.end", "EG-RANGE -5"),
    ("method: DOP853", "method: DOP85", 26, "simulation.method", "EG-CHOICE DOP85 'DOP853'?"),
    ("value: 0.1, unit", "value: m_c/2, unit", 4, "parameters.r.value", "EG-REFERENCE m_c"),
    ("unit: m, doc", "unit: 3, doc", 4, "parameters.r.unit", "EG-TYPE 3"),
    ("name: slider_crank", "name: slider-crank", 1, "name", "EG-NAME-FORM 'slider-crank'"),
    ("name: slider_crank", "doc: none", 1, "name", "EG-MISSING"),
    ("independent: [theta]", "independant: [theta]", 24, "independant", "EG-NAME-UNKNOWN 'independent'?"),
    ("[0, -g, 0]", "[0, -g]", 2, "gravity", "EG-TYPE three"),
    ("[0, -g, 0]", "[0, -g*t, 0]", 2, "gravity[1]", "EG-REFERENCE t"),
]


def changed(old: str, new: str, text: str = SLIDER_CRANK) -> str:
    assert len(re.findall(re.escape(old), text)) == 1
    return text.replace(old, new)


@pytest.mark.parametrize(("old", "new", "line", "path", "demand"), BROKEN, ids=lambda x: str(x)[:30])
def test_each_fault(old: str, new: str, line: int, path: str, demand: str, tmp_path: Path) -> None:
    refuses(f"{demand} {tmp_path / 'model.yaml'}:{line}: {path}:", lambda: load(tmp_path, changed(old, new)).check())


def test_one_fault_is_reported_once(tmp_path: Path) -> None:
    """A misspelt type, name or value does not put everything at fault that refers to it."""
    for old, new in [
        ("type: prismatic", "type: prismatik"),
        ("between: [rod.tip, slider]", "between: [rod.tip, slidr]"),
        ("between: [ground, slider], axis", "betwen: [ground, slider], axis"),
        ("mass: m_s}", "mass: m_s}\n  my-body: {mass: 1}"),
        ("coordinate: theta}", "coordinate: theta, axis: q}"),
        ("slider: {mass: m_s}", "slider: 0.5"),
    ]:
        problems = faults(tmp_path, changed(old, new))
        assert len(problems) == 1, [str(p) for p in problems]


@pytest.mark.quick
def test_all_faults_come_at_once_in_the_order_of_the_file(tmp_path: Path) -> None:
    text, wanted = SLIDER_CRANK, set()
    chosen = ("joints.C.between[1]", "forces.motor.value", "forces.k1.stiffnes", "simulation.end")
    for old, new, line, path, *_ in BROKEN:
        if path in chosen and old in text:
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
    whole = eg.Model("whole")
    whole.add(tmp_path / "model.yaml", l=0.4, m_c=1.0)
    assert 0.4 in whole.compile(target="numpy").p


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
    "alias": ("name: a\ngravity: &g [0, 0, 0]\nindependent: *g\n", "EG-FILE-DAMAGED :2: gravity &g"),
    "undefined alias": ("name: *nothing\n", "EG-FILE-DAMAGED :1: name *nothing"),
    "tag": ("name: a\ndoc: !!python/object/apply:os.system [ls]\n", "EG-FILE-DAMAGED :2: doc tag"),
    "duplicate key": ("name: a\nname: b\n", "EG-FILE-DAMAGED :2: name line 1"),
    "deep brackets": ("gravity: " + "[" * 5000, "EG-TOO-LARGE :1: nested 12"),
    "deep blocks": ("".join(" " * k + "a:\n" for k in range(200)), "EG-TOO-LARGE nested 12"),
    "key that is a list": ("? [a, b]\n: 1\n", "EG-FILE-DAMAGED :1: file key"),
    "merge key": ("name: a\n<<: {doc: b}\n", "EG-NAME-UNKNOWN :2: <<"),
    "two documents": ("name: a\n---\nname: b\n", "EG-FILE-DAMAGED :3: second"),
    "empty": ("# nothing\n", "EG-FILE-DAMAGED :1: empty"),
    "list": ("- a\n", "EG-FILE-DAMAGED :1: mapping"),
    "tab": ("name: a\n\tdoc: b\n", "EG-FILE-DAMAGED :2: \\t tab spaces"),
    "open quote": ('name: a\ndoc: "b\n', "EG-FILE-DAMAGED :3: YAML"),
    "control character": ("name: a\ndoc: \x01\n", "EG-FILE-DAMAGED :2: YAML"),
    "section of the wrong kind": ("name: a\nbodies: [b, c]\n", "EG-TYPE :2: bodies names"),
    "cut by a comma": ("name: a\nparameters: {r: {doc: length (m, in x)}}\n", "EG-NAME-UNKNOWN :2: in x) quotes"),
    "too many values": ("name: a\nindependent: [" + "a," * 120_000 + "a]\n", "EG-TOO-LARGE values"),
    "too large": ("# " + "x" * 2_000_000, "EG-TOO-LARGE 1000000"),
}
SLOW = pytest.param("too many values", marks=pytest.mark.thorough)


@pytest.mark.parametrize("case", [SLOW if case == "too many values" else case for case in REFUSED])
def test_refused(case: str, tmp_path: Path) -> None:
    text, demand = REFUSED[case]
    refuses(f"{demand} model.yaml", lambda: load(tmp_path, text).check())


def test_faults_of_the_file_and_of_the_model_come_together(tmp_path: Path) -> None:
    problems = faults(tmp_path, "name: 1a\nbodies: &b {c: {mass: -1}}\nforses: {}\n")
    assert [p.path for p in problems] == ["name", "bodies", "bodies.c.mass", "bodies.c", "forses"]


def test_not_text(tmp_path: Path) -> None:
    path = tmp_path / "binary.yaml"
    path.write_bytes(b"name: a\ndoc: \xff\xfe\n")
    refuses("EG-FILE-DAMAGED binary.yaml:2: file: UTF-8", eg.load, path)


# -- models that no motion can mend -----------------------------------------------------------------------------------
def disc(joint: str, **keys: str) -> eg.Model:
    m = eg.Model("disc", gravity=(0, 0, -9.81))
    d = m.body("d", mass=1, inertia=(0.25, 0.25, 0.5))
    getattr(m, joint)("f", m.ground, d, **keys)
    m.rolling("r", d, radius=1)
    return m


def test_a_disc_that_lies_flat_is_named() -> None:
    """At the start, always, or once it has fallen."""
    refuses("EG-NOT-FINITE constraints.r: flat initial", lambda: disc("free").check())
    refuses("EG-UNDEFINED constraints.r: d flat", lambda: disc("revolute").check())
    m = disc("free", rotation="euler_parameters")
    m.initial(f_e0=0.8, f_e1=0.6)
    module = m.compile(target="numpy")
    x = np.zeros(module.n_x)
    x[module.x_names.index("f_e0")] = 1.0
    refuses("EG-NOT-FINITE 'r' flat", module.rhs, 0.0, x)


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
WRONG = [  # the text, and the code, the place and the values that the fault tells
    (arm("tip_x: 3"), "EG-LOOP-OPEN initial.tip_x: 3 2 1"),  # the rod is 1 m long
    (arm("x(rod.tip): 3"), "EG-LOOP-OPEN initial.x(rod.tip): 3 2 1"),
    (arm("q: 0.3, tip_x: 0.1"), "EG-LOOP-OPEN initial.tip_x: 0.1 0.955336489126"),
    (arm("q: 0, tip_vx: 1"), "EG-CONTRADICTION initial.tip_vx: 1"),  # it moves across x there
    (arm("tip_ax: 1"), "EG-UNSUPPORTED initial.tip_ax: accelerations"),
    (arm("square: 1"), "EG-UNSUPPORTED initial.square: velocities"),
    (arm("q: k", value=""), "EG-MISSING parameters.k:"),
    (arm("A_e0: 0.5, A_e1: 0.5", BALL), "EG-CONTRADICTION A_e0 0.707107"),
    (four_bar("theta: 1.0, theta_dot: 1, psi_dot: 100"), "EG-CONTRADICTION initial.theta_dot: psi_dot 100"),
    (four_bar("theta: 1.0, psi: 0.1"), "EG-LOOP-OPEN initial: theta psi 0.1"),
]


@pytest.mark.parametrize("text", FINE)
@pytest.mark.filterwarnings("ignore")
def test_check_and_run_accept(text: str, tmp_path: Path) -> None:
    m = load(tmp_path, text)
    m.compile(target="numpy").simulate((0, 1e-3))
    assert not any("not checked" in note for note in m.check().notes)


@pytest.mark.parametrize(("text", "demand"), WRONG)
@pytest.mark.filterwarnings("ignore")
def test_check_and_run_refuse(text: str, demand: str, tmp_path: Path) -> None:
    m = load(tmp_path, text)
    with pytest.raises(eg.EomgenError):
        m.compile(target="numpy").simulate((0, 1e-3))
    refuses(demand, m.check)


def test_a_start_beyond_a_limit_is_noted_as_a_run_warns(tmp_path: Path) -> None:
    mod = load(tmp_path, arm("q: 2")).compile(target="numpy")
    with pytest.warns(UserWarning, match="q upper 1"):
        mod.simulate((0, 1e-3))
    (note,) = (note for note in load(tmp_path, arm("q: 2")).check().notes if "limit" in note)
    assert note.startswith("q starts at 2, beyond its upper limit 1")
    assert not [note for note in load(tmp_path, arm("q: 1")).check().notes if "limit" in note]
