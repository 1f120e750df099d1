"""URDF: joints that close loops, limits that are infinite or absent, and what is left of other programs in a file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eomgen as eg

INERTIAL = '<inertial><mass value="1"/><inertia ixx="0.1" iyy="0.2" izz="0.3" ixy="0" ixz="0" iyz="0"/></inertial>'
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
    """(4, 4) of ``xyz`` and ``rpy``: turns about fixed x, then y, then z."""
    result = np.eye(4)
    for (i, j), angle in zip(((1, 2), (2, 0), (0, 1)), rpy, strict=True):
        turn = np.eye(4)
        turn[i, i] = turn[j, j] = np.cos(angle)
        turn[j, i], turn[i, j] = np.sin(angle), -np.sin(angle)
        result = turn @ result
    result[:3, 3] = xyz
    return result


@pytest.mark.parametrize("dialect", [DRAKE, OTHER, GRBDA], ids=["loop_joint", "loop_constraint", "loop"])
@pytest.mark.parametrize("kind", ROWS)
def test_loops_hold_what_their_type_says(kind: str, dialect: str, tmp_path: Path) -> None:
    """The second frame in the first, from the poses of the links, where two free links are joined at random."""
    axis = np.array([0.0, 0.6, 0.8]) if ROWS[kind] != 6 else np.array([1.0, 0, 0])
    path = tmp_path / "pair.urdf"
    path.write_text(PAIR.format(dialect.format(kind, '<axis xyz="0 0.6 0.8"/>' if ROWS[kind] != 6 else "")))
    model = eg.load(path, rotation="euler_parameters")
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


def test_a_loop_without_a_type_is_taken_by_its_axis_and_said(tmp_path: Path) -> None:
    path = tmp_path / "four_bar.urdf"
    ends = '<parent link="b"/><parent_origin xyz="0.4 0 0"/><child link="c"/><child_origin xyz="0.3 0 0"/>'
    links = '<link1 link="b" xyz="0.4 0 0"/><link2 link="c" xyz="0.3 0 0"/>'
    axis = '<axis xyz="0 0 1"/>'
    loops = [("loop_constraint", ends, "spherical"), ("loop_constraint", axis + ends, "revolute")]
    loops += [("loop_joint", links, "spherical"), ("loop_joint", axis + links, "revolute")]
    for tag, inside, word in loops:
        path.write_text(FOUR_BAR.format(f'<{tag} name="l">{inside}</{tag}>'))
        model = eg.load(path)
        model.guess(j1=1.0, j2=-0.7, j3=1.6)
        assert model.notes == (f"{tag}.l: names no type; taken as {word}",)
        module = model.compile(target="numpy")
        assert (module.n_dof, module.q_names) == (1, ("j1", "j2", "j3"))
        j1, j2, j3 = module.x0()[:3]
        tip = 0.2 * np.exp(1j * j1) + 0.4 * np.exp(1j * (j1 + j2))
        assert tip == pytest.approx(0.4 + 0.3 * np.exp(1j * j3), abs=1e-12)


REFUSED = [
    ('<loop_joint name="l" type="floating"><link1 link="b"/><link2 link="c"/></loop_joint>', "no loop is closed by"),
    ('<loop_joint name="l" type="fixed"><link1 link="b"/></loop_joint>', "loop_joint.l.link2: is missing"),
    ('<loop_joint name="l" type="fixed"><link1 link="b"/><link2 link="d"/></loop_joint>', "loop.l: no link 'd'"),
    ('<loop_joint name="l"><axis xyz="0 0 0"/><link1 link="b"/><link2 link="c"/></loop_joint>', "axis has no length"),
]


@pytest.mark.parametrize(("loop", "said"), REFUSED)
def test_faults_of_loops_are_told_with_their_line(loop: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "four_bar.urdf"
    path.write_text(FOUR_BAR.format(loop))
    with pytest.raises(eg.ModelError, match=f"four_bar.urdf:7: .*{said}"):
        eg.load(path)


NOTED = [
    ('<gazebo><joint name="g"><parent>b</parent><child>c</child></joint></gazebo>', "<joint> g in line 7, which ties"),
    ("<drake:ball_constraint/>", "<drake:ball_constraint> in line 7, which ties links or joints"),
    (
        '<coupling name="k"><predecessor link="b"/><successor link="c"/></coupling>',
        "<coupling> k in line 7, which ties",
    ),
    (
        '<loop_joint name="l" type="ball"><link1 link="c"/><link2 link="c"/></loop_joint>',
        "left out: l, because no joint moves its two links against each other",
    ),
    ('<ros2_control name="r"><param value="${port}"/></ros2_control>', "<ros2_control>"),
    ('<xacro:imu_sensor name="x"/>', "left out: elements of xacro that it did not expand (<xacro:imu_sensor>)"),
]


@pytest.mark.parametrize(("extra", "said"), NOTED)
def test_what_leaves_more_freedoms_is_named(extra: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "four_bar.urdf"
    text = FOUR_BAR.replace("<robot", '<robot xmlns:xacro="x" xmlns:drake="d"')
    path.write_text(text.format(extra))
    model = eg.load(path)
    assert said in model.notes[-1]
    assert model.check().degrees_of_freedom == 3


@pytest.mark.parametrize(
    "part", ['<xacro:include filename="a"/>', '<link name="m"><visual name="${v}"/></link>', "<xacro:macro/>"]
)
def test_files_that_xacro_must_expand_are_refused(part: str, tmp_path: Path) -> None:
    path = tmp_path / "four_bar.urdf"
    path.write_text(FOUR_BAR.replace("<robot", '<robot xmlns:xacro="x"').format(part))
    with pytest.raises(eg.ModelError, match="urdf:7: robot: is a xacro file; expand it first"):
        eg.load(path)


def test_equalities_between_bodies_that_stand_still_are_left_out(tmp_path: Path) -> None:
    path = tmp_path / "posts.xml"
    path.write_text(
        '<mujoco><worldbody><body name="a"><joint name="h"/><geom size=".1"/></body><body name="post"/>'
        '<body name="rail" pos="3 0 0"/></worldbody><equality><weld name="w" body1="post" body2="rail"/>'
        '<connect name="c" body1="a" body2="rail" anchor="0 0 0"/></equality></mujoco>'
    )
    for merge in (True, False):
        model = eg.load(path, merge=merge)
        assert "left out: w, because no joint moves its two links against each other" in model.notes
        locked = eg.load(str(path), merge=merge, lock={"h": 0.1}) if not merge else model
        assert locked.compile(target="numpy").n_v == (0 if locked is not model else 1)


def test_the_world_need_not_be_written(tmp_path: Path) -> None:
    path = tmp_path / "four_bar.urdf"
    path.write_text(FOUR_BAR.format("").replace('<link name="base"/>', "").replace('link="base"', 'link="world"'))
    model = eg.load(path)
    assert model.notes == ("the link 'world' is not in the file; it stands for the ground",)
    assert model.check().degrees_of_freedom == 3


LAST = [("continuous", "0 0 1", True), ("continuous", "1 0 0", False), ("prismatic", "0 0 1", False)]


@pytest.mark.parametrize(("kind", "axis", "refused"), LAST)
def test_a_last_link_that_no_torque_can_feel_is_refused_at_once(
    kind: str, axis: str, refused: bool, tmp_path: Path
) -> None:
    """A point mass on the axis of its joint; beside it, or on a slide, it is fine."""
    path = tmp_path / "arm.urdf"
    point = '<inertial><origin xyz="0 0 0.5"/><mass value="1"/></inertial>'
    path.write_text(
        f'<robot name="r"><link name="base"/><link name="a">{INERTIAL}</link><link name="b">{point}</link>'
        '<joint name="j" type="continuous"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/></joint>\n'
        f'<joint name="k" type="{kind}"><parent link="a"/><child link="b"/><axis xyz="{axis}"/></joint></robot>'
    )
    if refused:
        with pytest.raises(eg.ModelError, match="urdf:2: joint.k: the joint moves no inertia: link 'b'"):
            eg.load(path)
        assert "for kinematics only" in eg.load(path, check_inertia="note").notes[0]
    else:
        eg.load(path).compile(target="numpy")


def test_planar_joints_on_other_axes_are_noted(tmp_path: Path) -> None:
    path = tmp_path / "plane.urdf"
    text = '<robot name="r"><link name="a"/><link name="b">{}</link><joint name="j" type="planar"><parent link="a"/>'
    text = text.format(INERTIAL) + '<child link="b"/><axis xyz="{}"/></joint></robot>'
    path.write_text(text.format("0 0 2"))
    assert eg.load(path).notes == ()
    path.write_text(text.format("0 1 0"))
    model = eg.load(path)
    assert "across its axis" in model.notes[0]
    assert "Pinocchio" in model.notes[0]
    position = model.compile(target="numpy").poses([0.3, 0.4, 0.0])[-1, :3, 3]
    assert position[1] == 0.0


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
    path = tmp_path / "one.urdf"
    path.write_text(ONE.format(given))
    model = eg.load(path, limits=option)
    module = model.compile(target="numpy")
    assert module.limits.get("j", {}) == limits
    sides = {"lower", "upper"} & limits.keys()
    assert ("no value lies between" in " ".join(model.notes)) == (not sides and 'er="' in given and "-Inf" not in given)
    for side in sides if option == "stop" else ():
        beyond, sign = (limits[side] - 0.1, 1) if side == "lower" else (limits[side] + 0.1, -1)
        assert sign * module.rhs(0.0, [beyond, 0.0])[1] > 1.0


@pytest.mark.parametrize("given", ['lower="nan"', 'upper="nan" lower="-1"', 'effort="nan"', 'velocity="a lot"'])
def test_limits_that_are_no_numbers_are_refused(given: str, tmp_path: Path) -> None:
    path = tmp_path / "one.urdf"
    path.write_text(ONE.format(given))
    with pytest.raises(eg.ModelError, match="urdf:2: joint.j.limit"):
        eg.load(path)


def test_infinite_ranges_of_mjcf_and_of_models() -> None:
    for given, limits in (
        ({"upper": -0.5}, {"upper": -0.5}),
        ({"lower": -np.inf, "upper": -0.5}, {"upper": -0.5}),
        ({"lower": 0.5, "upper": np.inf, "velocity": np.inf, "effort": np.inf}, {"lower": 0.5}),
    ):
        m = eg.Model("one")
        m.revolute("j", m.ground, m.body("b", mass=1, inertia=(1, 1, 1)), limits=given)
        assert m.compile(target="numpy").limits["j"] == limits


@pytest.mark.parametrize("option", ["note", "stop"])
@pytest.mark.parametrize(
    ("given", "limits"),
    [
        ('range="-inf 1" limited="true"', {"upper": 1.0}),
        ('range="-1 inf"', {"lower": -1.0}),
        ('range="-1e300 1"', {"lower": -1e300, "upper": 1.0}),
        ('actuatorfrcrange="-inf 2"', {}),
    ],
)
def test_infinite_ranges_of_mjcf(given: str, limits: Any, option: str, tmp_path: Path) -> None:
    path = tmp_path / "one.xml"
    path.write_text(
        f'<mujoco><compiler angle="radian"/><worldbody><body><joint name="j" {given}/><inertial pos="0 0 0" mass="1" '
        'diaginertia="2 2 2"/></body></worldbody><actuator><motor name="m" joint="j"/></actuator></mujoco>'
    )
    module = eg.load(path, limits=option).compile(target="numpy")
    assert module.limits.get("j", {}) == limits
    assert module.rhs(0.0, [0.0, 0.0], u=[3.0])[1] == (1.0 if "frc" in given else 1.5)


def test_formats_that_other_programs_convert_say_how(tmp_path: Path) -> None:
    for name, said in (("a.sdf", "sdf2mjcf"), ("a.xacro", "xacro FILE.xacro > FILE.urdf")):
        with pytest.raises(eg.UsageError, match=said):
            eg.load(tmp_path / name)
    path = tmp_path / "a.xml"
    path.write_text('<sdf version="1.9"><model name="m"/></sdf>')
    with pytest.raises(eg.ModelError, match="sdf2mjcf"):
        eg.load(path)
