"""What becomes of a URDF file: names, limits, inertias, loops, mimicking and locked joints, and notes of the rest."""

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from model_files import EXAMPLES, described, load, schema_faults
from refusals import refused, refuses
from shipped_robots import EXAMPLES as SHIPPED

import eomgen as eg

ARM = EXAMPLES / "arm.urdf"
INERTIAL = '<inertial><mass value="1"/><inertia ixx="0.1" iyy="0.2" izz="0.3" ixy="0" ixz="0" iyz="0"/></inertial>'


def urdf(folder: Path, text: str, **options: Any) -> eg.Model:
    path = folder / "robot.urdf"
    path.write_text(text, encoding="utf-8")
    return eg.load(path, **options)


# -- links and joints -------------------------------------------------------------------------------------------------
def test_limits_and_shapes_travel_to_the_module_and_back(tmp_path: Path) -> None:
    mesh = '<mesh filename="package://arm/meshes/forearm.stl"/>'
    model = urdf(tmp_path, ARM.read_text().replace('<box size="0.26 0.03 0.03"/>', mesh))
    module = model.compile(target="numpy", kernels=["mass_matrix"])
    assert module.limits["elbow"] == {"lower": -0.1, "upper": 2.6, "velocity": 3.0, "effort": 10.0}
    assert module.limits["yaw"] == {"velocity": 2.0, "effort": 20.0}
    assert module.metadata["dry_friction"] == {"elbow": 0.1}
    shapes = described(model)["bodies"]["forearm"]["display"]
    assert shapes == [{"shape": "mesh", "file": "package://arm/meshes/forearm.stl", "at": [0.12, 0.0, 0.0]}]
    assert schema_faults(model) == []
    model.save(tmp_path / "arm.yaml")
    assert (tmp_path / "arm.yaml").read_text().startswith("# ")
    again = eg.load(tmp_path / "arm.yaml")
    assert described(again) == described(model)
    assert again.compile(target="numpy", kernels=["poses"]).limits == module.limits


def test_welded_links_are_one_body_and_locked_joints_welds() -> None:
    forearm = described(eg.load(ARM))["bodies"]["forearm"]
    assert forearm["mass"] == 0.7
    assert forearm["com"][0] == pytest.approx((0.5 * 0.12 + 0.2 * 0.27) / 0.7)
    steiner = 0.5 * (0.12 - 0.114 / 0.7) ** 2 + 0.2 * (0.27 - 0.114 / 0.7) ** 2
    assert forearm["inertia"]["zz"] == pytest.approx(0.0025 + 0.0001 + steiner)
    locked = described(eg.load(ARM, lock={"elbow": 0.5, "left": 0.01}))["joints"]
    assert set(locked) == {"yaw", "shoulder", "right"}
    at = locked["right"]["between"][0]
    assert at["body"] == "upper_arm"
    assert at["at"] == pytest.approx([0.3 + 0.29 * np.cos(0.5), 0, -0.29 * np.sin(0.5)])


NAMES = """<robot name="sys"><link name="0 base/x"/>
{links}{joints}</robot>"""
LINK = '<link name="{0}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>'
JOINT = '<joint name="{1}" type="revolute"><parent link="0 base/x"/><child link="{0}"/></joint>'


def test_names_become_identifiers_and_are_kept(tmp_path: Path) -> None:
    links = ["a-b", "a_b", "a/b", "ground", "x" * 90, "ünï"]
    joints = ["j-1", "j_1", "sin", "lambda", "j_1_dot", "t"]
    text = NAMES.format(
        links="".join(map(LINK.format, links)),
        joints="".join(JOINT.format(*pair) for pair in zip(links, joints, strict=True)),
    )
    model = urdf(tmp_path, text, actuate=True)
    module = model.compile(target="numpy", kernels=["poses"])
    assert model.name == "sys_model"
    assert module.joint_names == ("j_1", "j_1_2", "sin_", "lambda_", "j_1_dot_2", "t_")
    assert module.body_names[:4] == ("a_b", "a_b_2", "a_b_3", "ground_2")
    assert len(module.body_names[4]) <= 64
    assert model.renamed["joints"] == dict(zip(joints, module.joint_names, strict=True))
    model.save(tmp_path / "names.yaml")
    assert eg.load(tmp_path / "names.yaml").compile(target="numpy", kernels=["poses"]).joint_names == module.joint_names


def test_python_and_model_files_know_the_data(tmp_path: Path) -> None:
    m = eg.Model("drive", gravity=(0, 0, 0))
    J = m.parameter("J", 0.2)
    rotor = m.body("rotor", mass=1, inertia=(1, 1, 0.5), display=[{"shape": "sphere", "radius": 0.1}])
    m.revolute("a", m.ground, rotor, limits={"lower": -1, "effort": 3}, dry_friction=0.1, armature=J)
    ball = m.body("ball", mass=2, inertia=(1, 1, 1))
    m.joint("planar", "b", rotor, ball, limits={"lower": [-1, -2, None], "upper": [1, 2, 3]})
    for model in (m, load(tmp_path, m.to_yaml())):
        module = model.compile(target="numpy", kernels=["mass_matrix", "energy"])
        assert module.limits["a"] == {"lower": -1.0, "effort": 3.0}
        assert module.limits["b_3"] == {"upper": 3.0}
        assert module.mass_matrix(np.zeros(4))[0, 0] == pytest.approx(1.7)
        assert module.energy([0, 0, 0, 0, 2, 0, 0, 0])[0] == pytest.approx(0.5 * 1.7 * 4)


@pytest.mark.parametrize(
    ("data", "said"),
    [
        ("limits: {lower: 2, upper: 1}", "EG-RANGE joints.a.limits 2 1"),
        ("limits: {lower: [1, 2]}", "EG-SHAPE joints.a.limits.lower 2 1"),
        ("limits: {effort: -1}", "EG-RANGE joints.a.limits.effort -1"),
        ("limits: {torque: 1}", "EG-NAME-UNKNOWN joints.a.limits.torque"),
        ("limits: 3", "EG-TYPE joints.a.limits 3"),
        ("dry_friction: -1", "EG-RANGE joints.a.dry_friction -1"),
        ("armature: -1", "EG-RANGE joints.a.armature -1"),
    ],
)
def test_wrong_data_is_reported(data: str, said: str, tmp_path: Path) -> None:
    text = (
        f"name: m\nbodies: {{r: {{mass: 1, inertia: [1, 1, 1]}}}}\n"
        f"joints: {{a: {{type: revolute, between: [ground, r], {data}}}}}"
    )
    refuses(said, lambda: load(tmp_path, text).check())


def test_dry_friction_acts_where_it_is_requested() -> None:
    q, v = np.array([0.1, 0.2, -0.3, 0.01, 0.02]), np.array([1.0, -2.0, 0.015, 0.1, 0.0])
    given = ({}, {"friction": True}, {"friction": 0.05})
    modules = [eg.load(ARM, **friction).compile(target="numpy", kernels=["bias"]) for friction in given]
    elbow = modules[0].q_names.index("elbow")
    without, hard, soft = (module.bias(0.0, np.concatenate([q, v])) for module in modules)
    for found, smoothing in ((hard, 0.01), (soft, 0.05)):
        added = found - without
        assert added[elbow] == pytest.approx(0.1 * np.tanh(v[elbow] / smoothing), rel=1e-12)
        assert not np.delete(added, elbow).any()


def test_damping_and_dry_friction_are_two_numbers(tmp_path: Path) -> None:
    text = two_links({}).replace('damping="0.5"', 'damping="0.5" friction="0.2"')
    module = urdf(tmp_path, text).compile(target="numpy", kernels=["bias"])
    ahead, back = (module.bias(0.0, [0.0, 0.3, 0.0, rate]) for rate in (2.0, -2.0))
    np.testing.assert_allclose((ahead - back) / 2, [0.0, 0.5 * 2.0], atol=1e-12)  # what is even is centrifugal


def test_drives_are_in_the_units_of_their_joints(tmp_path: Path) -> None:
    """Without gravity: a torque on the hinge alone and a force on the slide alone, Newton and Euler by hand."""
    text = f"""<robot name="arm"><link name="base"/><link name="upper">{INERTIAL}</link>
    <link name="tip">{INERTIAL}</link>
    <joint name="shoulder" type="continuous"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/></joint>
    <joint name="slide" type="prismatic"><parent link="upper"/><child link="tip"/><origin xyz="0 0 0.4"/>
    <axis xyz="0 0 1"/></joint></robot>"""
    module = urdf(tmp_path, text, actuate=True, gravity=(0, 0, 0)).compile(target="numpy")
    assert [module.metadata["units"][name] for name in ("tau_shoulder", "tau_slide")] == ["N*m", "N"]
    assert module.rhs(0.0, np.zeros(4), u=[3.0, 2.0])[2:] == pytest.approx([3 / (0.2 + 0.2 + 0.4**2), 2.0])
    alone = urdf(tmp_path, text, actuate="shoulder").compile(target="numpy", kernels=["poses"])
    assert alone.u_names == ("tau_shoulder",)


# -- mimicking joints -------------------------------------------------------------------------------------------------
TIED_LINK = '<link name="{0}"><inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1"/></inertial></link>'
TIED_JOINT = (
    '<joint name="{0}" type="revolute"><parent link="base"/><child link="{1}"/><axis xyz="0 0 1"/>'
    '<limit lower="-1" upper="1" effort="1" velocity="1"/>{2}</joint>'
)
MIMIC = f"""<robot name="r"><link name="base"/>{"".join(TIED_LINK.format(x) for x in ("l1", "l2", "l3"))}
{TIED_JOINT.format("a", "l1", "")}
{TIED_JOINT.format("b", "l2", '<mimic joint="a" multiplier="-2" offset="0.1"/>')}
{TIED_JOINT.format("c", "l3", "")}</robot>"""


@pytest.mark.parametrize(("lock", "held"), [({"b": 0.3}, ("a", -0.1)), ({"a": 0.3}, ("b", -0.5))])
def test_a_locked_joint_holds_the_one_it_is_tied_to(
    lock: dict[str, float], held: tuple[str, float], tmp_path: Path
) -> None:
    module = urdf(tmp_path, MIMIC, lock=lock, actuate=True).compile(target="numpy")
    name, value = held
    assert module.n_dof == 1
    x = module.x0(c=0.2)
    assert x[module.q_names.index(name)] == pytest.approx(value, abs=1e-14)
    u = np.ones(len(module.u_names))
    rates = dict(zip(module.x_names, module.rhs(0.0, x, u=u), strict=True))
    assert rates[f"{name}_dot"] == pytest.approx(0.0, abs=1e-12)
    assert rates["c_dot"] == pytest.approx(10.0)


def test_locks_of_all_tied_joints_leave_a_note(tmp_path: Path) -> None:
    model = urdf(tmp_path, MIMIC, lock={"a": -0.1, "b": 0.3}, limits="off")
    assert model.notes == ("left out: the coupling b_mimic, all of whose joints are locked",)
    assert urdf(tmp_path, MIMIC, lock={"b": 0.3}, limits="off").notes == ()


def test_mimics_are_tied_unless_stated_otherwise(tmp_path: Path) -> None:
    module = urdf(tmp_path, MIMIC).compile(target="numpy")
    assert (module.n_dof, urdf(tmp_path, MIMIC, mimic="independent").check().degrees_of_freedom) == (2, 3)
    x = dict(zip(module.x_names, module.x0(a=0.1, a_dot=1.0), strict=True))
    assert (x["b"], x["b_dot"]) == (pytest.approx(-0.1), pytest.approx(-2.0))
    (note,) = (n for n in urdf(tmp_path, MIMIC, mimic="independent").notes if "mimic" in n)
    assert "b = -2 a + 0.1" in note


# -- loops ------------------------------------------------------------------------------------------------------------
PAIR = f"""<robot name="pair"><link name="base"/><link name="b">{INERTIAL}</link><link name="c">{INERTIAL}</link>
<joint name="f" type="floating"><parent link="base"/><child link="b"/></joint>
<joint name="g" type="floating"><parent link="base"/><child link="c"/></joint>{{}}</robot>"""
DRAKE = """<loop_joint name="l" type="{}">{}<link1 link="b" xyz="0.4 0.1 0" rpy="0.1 0.2 0.3"/>
<link2 link="c" xyz="0.3 0 -0.2" rpy="0.4 0 1"/></loop_joint>"""
OTHER = """<loop_constraint name="l" type="{}">{}<parent link="b"/><parent_origin xyz="0.4 0.1 0" rpy="0.1 0.2 0.3"/>
<child link="c"/><child_origin xyz="0.3 0 -0.2" rpy="0.4 0 1"/></loop_constraint>"""
GRBDA = OTHER.replace("parent", "predecessor").replace("child", "successor").replace("loop_constraint", "loop")
#: Type -> the rows that close it.
ROWS = {"revolute": 5, "continuous": 5, "prismatic": 5, "fixed": 6, "planar": 3, "spherical": 3, "ball": 3}


def frame(xyz: list[float], rpy: list[float]) -> np.ndarray:
    return np.asarray(pin.SE3(pin.rpy.rpyToMatrix(*rpy), np.array(xyz)).homogeneous)


DIALECTS = [("loop_joint", kind) for kind in ROWS] + [("loop_constraint", "revolute"), ("loop", "planar")]


@pytest.mark.parametrize(("tag", "kind"), DIALECTS)
def test_loops_hold_what_their_type_says(tag: str, kind: str, tmp_path: Path) -> None:
    """The second frame in the first, from the poses of the links, where two free links are joined at random."""
    dialect = {"loop_joint": DRAKE, "loop_constraint": OTHER, "loop": GRBDA}[tag]
    axis = np.array([0.0, 0.6, 0.8]) if ROWS[kind] != 6 else np.array([1.0, 0, 0])
    text = PAIR.format(dialect.format(kind, '<axis xyz="0 0.6 0.8"/>' if ROWS[kind] != 6 else ""))
    model = urdf(tmp_path, text, rotation="euler_parameters")
    assert model.notes == ()
    module = model.compile(target="numpy")
    assert module.n_v - module.n_dof == ROWS[kind]
    first, second = frame([0.4, 0.1, 0], [0.1, 0.2, 0.3]), frame([0.3, 0, -0.2], [0.4, 0, 1])
    random = np.random.default_rng(6)
    for _ in range(4):
        x = module.project(module.x0() + random.uniform(-0.3, 0.3, module.n_x))
        poses = dict(zip(module.body_names, module.poses(x[: module.n_q]), strict=True))
        relative = np.linalg.solve(poses["b"] @ first, poses["c"] @ second)
        turned, moved = relative[:3, :3], relative[:3, 3]
        if kind in ("revolute", "continuous", "planar"):
            assert turned @ axis == pytest.approx(axis, abs=1e-9)
        if kind in ("prismatic", "fixed"):
            assert turned == pytest.approx(np.eye(3), abs=1e-9)
        if kind == "prismatic":
            assert np.cross(moved, axis) == pytest.approx(np.zeros(3), abs=1e-9)
        elif kind == "planar":
            assert axis @ moved == pytest.approx(0.0, abs=1e-9)
        else:
            assert moved == pytest.approx(np.zeros(3), abs=1e-9)


FOUR_BAR = f"""<robot name="four_bar"><link name="base"/><link name="a">{INERTIAL}</link>
<link name="b">{INERTIAL}</link>
<link name="c">{INERTIAL}</link>
<joint name="j1" type="continuous"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/></joint>
<joint name="j2" type="continuous"><parent link="a"/><child link="b"/><origin xyz="0.2 0 0"/><axis xyz="0 0 1"/></joint>
<joint name="j3" type="continuous"><parent link="base"/><child link="c"/><origin xyz="0.4 0 0"/><axis xyz="0 0 1"/>
</joint>{{}}</robot>"""
REFUSED = [
    ('<loop_joint name="l" type="floating"><link1 link="b"/><link2 link="c"/></loop_joint>', "EG-CHOICE"),
    ('<loop_joint name="l" type="fixed"><link1 link="b"/></loop_joint>', "EG-MISSING loop_joint.l.link2:"),
    ('<loop_joint name="l" type="fixed"><link1 link="b"/><link2 link="d"/></loop_joint>', "EG-NAME-UNKNOWN 'd'"),
    ('<loop_joint name="l"><axis xyz="0 0 0"/><link1 link="b"/><link2 link="c"/></loop_joint>', "EG-RANGE axis"),
]


@pytest.mark.parametrize(("loop", "said"), REFUSED)
def test_faults_of_loops_are_reported_with_their_line(loop: str, said: str, tmp_path: Path) -> None:
    refuses(f"{said} robot.urdf:7: l", lambda: urdf(tmp_path, FOUR_BAR.format(loop)))


STRANGE = """<robot name="strange" mood="sad"><link name="base"/><wheel size="3"/>
<link name="b"><inertial><mass value="1" unit="lb"/><inertia ixx="1" iyy="1" izz="1"/></inertial>
  <inertial><mass value="7"/></inertial><collision><geometry><box size="1 1 1"/></geometry></collision></link>
<joint name="j" type="revolute"><parent link="base"/><child link="b"/><dynamics damping="1" spring_stiffness="4"/>
  <safety_controller k_velocity="1"/><magic/></joint>
<transmission name="t"/><gazebo><gravity>0</gravity></gazebo></robot>"""
DRIVES = (
    "left out: drives and their reductions (`actuate` gives inputs, `armature` the inertia of a rotor) (<transmission>)"
)


def test_what_is_not_known_or_given_twice_is_noted(tmp_path: Path) -> None:
    assert urdf(tmp_path, STRANGE).notes == (
        "left out: what this reader does not know (<robot mood>, <wheel>, <mass unit>, <magic>)",
        "left out: shapes that touch, and contact (<collision>)",
        "left out: words of other formats and simulators (<dynamics spring_stiffness>, <gazebo>)",
        "left out: limits and reference positions of controllers (<safety_controller>)",
        DRIVES,
        "link.b: 2 <inertial>; only the first is used",
    )


# -- limits -----------------------------------------------------------------------------------------------------------
ONE = f"""<robot name="r"><link name="a"/><link name="b">{INERTIAL}</link><joint name="j" type="revolute">
<parent link="a"/><child link="b"/><axis xyz="0 0 1"/><limit {{}}/></joint></robot>"""
LIMITS: list[tuple[str, dict[str, float]]] = [
    ('lower="-inf" upper="-0.5" effort="1" velocity="1"', {"upper": -0.5, "velocity": 1.0, "effort": 1.0}),
    ('lower="0.5" upper="inf" effort="inf" velocity="+INF"', {"lower": 0.5}),
    ('lower="-Infinity" upper="infinity"', {}),
    ('effort="3"', {"effort": 3.0}),
    ('upper="2"', {"lower": 0.0, "upper": 2.0}),  # the format's default
    ('lower="-2"', {"lower": -2.0, "upper": 0.0}),
    ('lower="inf" upper="1" velocity="2"', {"velocity": 2.0}),
    ('lower="0" upper="-inf"', {}),
    ('lower="2" upper="1"', {}),
]


@pytest.mark.parametrize("option", ["note", "stop"])
@pytest.mark.parametrize(("given", "limits"), LIMITS)
def test_infinite_and_absent_limits(given: str, limits: dict[str, float], option: str, tmp_path: Path) -> None:
    model = urdf(tmp_path, ONE.format(given), limits=option)
    module = model.compile(target="numpy")
    assert module.limits.get("j", {}) == limits
    sides = {"lower", "upper"} & limits.keys()
    assert ("no value lies between" in " ".join(model.notes)) == (not sides and 'er="' in given and "-Inf" not in given)
    for side in sides if option == "stop" else ():
        beyond, sign = (limits[side] - 0.1, 1) if side == "lower" else (limits[side] + 0.1, -1)
        assert sign * module.rhs(0.0, [beyond, 0.0])[1] > 1.0


PENDULUM = """<robot name="swing"><link name="base"/>
<link name="rod"><inertial><origin xyz="0 0 -0.5"/><mass value="2"/>
  <inertia ixx="0.2" iyy="0.2" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="pin" type="revolute"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/>
  <limit lower="-0.5" upper="1.2" {more}/></joint></robot>"""


def test_a_run_that_passes_a_limit_says_so(tmp_path: Path) -> None:
    """When it passes: from energy, the pendulum let go at 1.2 rad is at -0.5 rad after the integral of d phi / phi'."""
    mod = urdf(tmp_path, PENDULUM.format(more="")).compile(target="numpy")
    with pytest.warns(UserWarning, match=r"pin lower -0.5 at t = .* \(to -1\.\d+\)") as told:
        run = mod.simulate(1.5, initial={"pin": 1.2}, t_eval=np.linspace(0, 1.5, 3001))
    assert told[0].filename == __file__
    inertia, weight = 0.2 + 2 * 0.25, 2 * 9.81 * 0.5
    phi = 1.2 - 1.7 * np.linspace(0, 1, 200_001)[1:] ** 2  # denser where it starts
    speed = np.sqrt(2 * weight / inertia * (np.cos(phi) - np.cos(1.2)))
    time = float(np.trapezoid(-np.gradient(phi) / speed))
    first = float(run.t[np.flatnonzero(run["pin"] < -0.5)[0]])
    assert f"at t = {first:.4g} s" in str(told[0].message)
    assert first == pytest.approx(time, abs=2e-3)


def test_within_the_limits_and_where_they_are_off_all_is_quiet(tmp_path: Path) -> None:
    urdf(tmp_path, PENDULUM.format(more="")).compile(target="numpy").simulate(1.5, initial={"pin": 0.49})
    silent = urdf(tmp_path, PENDULUM.format(more=""), limits="off")
    silent.compile(target="numpy").simulate(1.5, initial={"pin": 1.2})  # warnings are errors in these tests
    assert silent.to_yaml().count("limits: off") == 1
    fast = urdf(tmp_path, PENDULUM.format(more='velocity="1.5"')).compile(target="numpy")
    with pytest.warns(UserWarning, match=r"pin_dot velocity 1\.5 at t = .* \(to -[12]\.\d+\)"):
        fast.simulate(1.0, initial={"pin": 0.49})


def test_stops_hold(tmp_path: Path) -> None:
    """Dropped onto its stop the rod stays there: within a hundredth of the range, as MuJoCo's with limits comes to."""
    text = PENDULUM.format(more="").replace('lower="-0.5"', 'lower="0.3"')
    model = urdf(tmp_path, text, limits="stop")
    assert not any("limits" in note for note in model.notes)
    run = model.compile(target="numpy").simulate(3.0, initial={"pin": 1.2}, t_eval=np.linspace(0, 3, 601))
    assert run["pin"].min() > 0.3 - 0.05
    assert (np.diff(run["energy"]) < 1e-6).all()  # stops only take
    known = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(known)
    data.qpos[0] = 1.2
    while data.time < 3.0:
        mujoco.mj_step(known, data)
    assert run["pin"][-1] == pytest.approx(data.qpos[0], abs=0.01)


@pytest.mark.parametrize(
    ("word", "told"),
    [("limits: stop", "EG-CHOICE limits stop"), ("limits: stops", "EG-CHOICE limits stops"),
     ("check_inertia: maybe", "EG-TYPE check_inertia maybe")],
)  # fmt: skip
def test_a_word_that_does_nothing_in_a_model_file_is_refused(word: str, told: str, tmp_path: Path) -> None:
    text = (
        f"name: rod\n{word}\nbodies: {{rod: {{mass: 1, inertia: {{zz: 1}}}}}}\n"
        "joints: {A: {type: revolute, between: [ground, rod], limits: {lower: -1, upper: 1}}}\n"
    )
    refuses(told, lambda: load(tmp_path, text).check())


# -- inertias ---------------------------------------------------------------------------------------------------------
ARM_LINK = """<link name="{name}"><inertial><origin xyz="{com}"/><mass value="{mass}"/>
<inertia ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
TWO_LINKS = """<robot name="arm"><link name="base"/>{links}
<joint name="a" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
  <limit lower="-1" upper="1" velocity="2" effort="30"/></joint>
<joint name="b" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0.3 0 0"/><axis xyz="0 1 0"/>
  <dynamics damping="0.5"/></joint></robot>"""
SOUND = {"mass": 0.7, "com": "0.1 0 0", "xx": "1e-3", "yy": "2e-3", "zz": "2e-3"}


def two_links(upper: dict[str, Any]) -> str:
    links = [ARM_LINK.format(name="upper", **SOUND | upper), ARM_LINK.format(name="lower", **SOUND)]
    return TWO_LINKS.format(links="\n".join(links))


ROUNDING = [
    {"xx": "-5e-20", "yy": "1e-20", "zz": "3e-20"},  # iCub's
    {"xx": "-5e-20", "yy": "2e-3", "zz": "2e-3"},
    {"mass": 0, "xx": "-5e-20", "yy": "1e-20", "zz": "3e-20"},
    {"xx": "1e-21", "yy": "3e-21", "zz": "9e-21"},
    {"com": "0 0 0", "xx": "-1e-18", "yy": "1e-18", "zz": "0"},
]
SLIPS = [
    ({"xx": "-1e-3"}, "negative"),
    ({"xx": "-1e-8"}, "negative"),  # 1e-6 of m l^2: far above its rounding
    ({"zz": "4e-3"}, "exceeds"),
    ({"xx": "1e-9", "yy": "2e-9", "zz": "9e-9"}, "exceeds"),
    ({"mass": 0, "xx": "-1e-9", "yy": "1e-9", "zz": "1e-9"}, "negative"),
]


@pytest.mark.parametrize("given", ROUNDING, ids=str)
def test_what_rounding_leaves_passes(given: dict[str, Any], tmp_path: Path) -> None:
    model = urdf(tmp_path, two_links(given))
    module = model.compile(target="numpy", kernels=["mass_matrix", "rhs"])
    x = np.array([0.3, -0.5, 1.0, 2.0])
    clean = urdf(tmp_path, two_links(given | dict.fromkeys(("xx", "yy", "zz"), "0")))
    other = clean.compile(target="numpy", kernels=["mass_matrix", "rhs"])
    np.testing.assert_allclose(module.rhs(0.0, x), other.rhs(0.0, x), rtol=1e-12) if given.get("yy") != "2e-3" else None
    assert np.linalg.eigvalsh(module.mass_matrix(x[:2]))[0] > 0


@pytest.mark.parametrize(("given", "said"), SLIPS, ids=str)
def test_a_slip_of_the_pen_is_reported(given: dict[str, Any], said: str, tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    path.write_text(two_links(given))
    demand = f"EG-INERTIA bodies.upper.inertia {said}"
    if said == "exceeds":  # taken by default, as other loaders do, and told
        taken = eg.load(path)
        assert any("bodies.upper.inertia" in note and said in note for note in taken.notes)
        taken.check()
    else:
        refuses(demand, lambda: eg.load(path).check())
    with refused(f"{demand} check_inertia") as caught:
        eg.load(path, check_inertia="error").check()
    assert len(caught.value.problems) == 1
    noted = eg.load(path, check_inertia="note")
    assert any("bodies.upper.inertia" in note and said in note for note in noted.notes)
    noted.check()
    silent = eg.load(path, check_inertia="off", limits="off")
    assert silent.notes == ()
    silent.check()
    noted.save(tmp_path / "arm.yaml")
    again = eg.load(tmp_path / "arm.yaml")  # a model file keeps the word and says it again
    assert any(said in note for note in again.notes)
    assert eg.load(tmp_path / "arm.yaml", check_inertia="off").notes == ()
    refuses(demand, lambda: eg.load(tmp_path / "arm.yaml", check_inertia="error").check())


def test_romeo_whose_fingers_have_no_mass_moves() -> None:
    path = SHIPPED / "romeo_description/urdf/romeo.urdf"
    refuses("EG-NO-INERTIA joint.LHand note check_inertia=", eg.load, path)
    model = eg.load(path, check_inertia="note")
    assert any("kinematics only" in note and "LFinger12" in note for note in model.notes)
    module = model.compile(target="numpy", kernels=["rhs", "poses", "embedded_mass_matrix", "jacobian"])
    x = np.zeros(module.n_x)
    for call in (module.rhs, module.jacobian):
        refuses("EG-SINGULAR LFinger11Link", call, 0.0, x)
