"""What an MJCF file says of forces and inertias, small piece by small piece: taken over as MuJoCo has it, or noted."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from robots import mujoco_fields
from robots.mujoco_judge import Judge

import eomgen as eg
from eomgen.robots.mjcf_compiled import NOTED as NOTED_FIELDS

TEXT = """
<mujoco model="pieces">
  <option gravity="0 0 -9.81">{option}<flag contact="disable" {flag}/></option>
  <worldbody>
    <body name="a" pos="0 0 1"><joint name="j" axis="0 1 0" {joint}/>
      <geom type="box" size=".1 .2 .3" pos=".1 0 0" mass="1.5"/>
      <body name="b" pos="0.3 0 0"><joint name="k" axis="0 1 0"/>
        <geom type="box" size=".2 .2 .1" pos=".1 0 .1" mass="0.5"/></body></body>
  </worldbody>
  <tendon><fixed name="one" {one}><joint joint="j" coef="2"/></fixed>
    <fixed name="two" {two}><joint joint="j" coef="2"/><joint joint="k" coef="-3"/></fixed></tendon>
  <actuator><motor name="m" {target} gear="3" {motor}/>
    <position name="p" joint="k" kp="2" kv="0.3" group="3"/></actuator>
  <equality>{equality}</equality>
</mujoco>
"""
EMPTY = dict.fromkeys(("option", "flag", "joint", "one", "two", "motor", "equality"), "") | {"target": 'joint="j"'}


def load(folder: Path, **parts: str) -> tuple[Any, Any]:
    """Our model and MuJoCo's."""
    path = folder / "pieces.xml"
    path.write_text(TEXT.format(**{**EMPTY, **parts}))
    return eg.load(path), mujoco.MjModel.from_xml_path(str(path))


def compare(model: Any, mj: Any) -> None:
    """Accelerations at a few states and controls."""
    module, data = model.compile(target="numpy"), mujoco.MjData(mj)
    random = np.random.default_rng(2)
    for _ in range(4):
        data.qpos[:], data.qvel[:], data.ctrl[:] = random.uniform(-1, 1, (3, 2))
        mujoco.mj_forward(mj, data)
        u = [data.ctrl[("m", "p").index(name)] for name in module.u_names]
        found = module.rhs(0.0, np.concatenate([data.qpos, data.qvel]), u=np.array(u))[2:]
        assert found == pytest.approx(data.qacc_smooth, rel=1e-9)


SAME = [
    {},
    {"motor": 'armature="0.5"'},
    {"motor": 'damping="0.7"'},
    {"motor": 'armature="0.1" damping="0.7"', "target": 'tendon="one"'},
    {"motor": 'damping="0.7"', "target": 'tendon="two"'},
    {"one": 'armature="0.2" damping="0.3" stiffness="4" springlength="0.3"'},
    {"two": 'damping="0.3" stiffness="4"'},
    {"flag": 'spring="disable"', "joint": 'stiffness="5" damping="2"', "two": 'stiffness="3" damping="0.5"'},
    {"flag": 'damper="disable"', "joint": 'stiffness="5" damping="2"', "two": 'stiffness="3" damping="0.5"'},
    {"flag": 'damper="disable"', "motor": 'damping="0.7" armature="0.2"'},
    {"flag": 'spring="disable"', "joint": 'stiffness="5 2"', "one": 'stiffness="1 2"'},
    {"flag": 'damper="disable"', "joint": 'damping="5 2"', "one": 'damping="1 2"'},
]


@pytest.mark.parametrize("parts", SAME, ids=str)
def test_taken_over_without_a_note(parts: dict[str, str], tmp_path: Path) -> None:
    model, mj = load(tmp_path, **parts)
    assert model.notes == ()
    compare(model, mj)


@pytest.mark.parametrize("parts", [{}, {"motor": 'damping="0.7" armature="0.2"'}], ids=str)
def test_disabled_actuators_do_not_act(parts: dict[str, str], tmp_path: Path) -> None:
    model, mj = load(tmp_path, flag='actuation="disable"', **parts)
    assert model.notes == ("left out: actuators that the file disables (m, p)",)
    compare(model, mj)


def test_disabled_groups_of_actuators_do_not_act(tmp_path: Path) -> None:
    path = tmp_path / "pieces.xml"
    path.write_text(TEXT.format(**EMPTY).replace("<option ", '<option actuatorgroupdisable="3" '))
    model = eg.load(path)
    assert model.notes == ("left out: actuators that the file disables (p)",)
    compare(model, mujoco.MjModel.from_xml_path(str(path)))


@pytest.mark.parametrize("flag", ["equality", "constraint"])
def test_disabled_equalities_do_not_hold(flag: str, tmp_path: Path) -> None:
    model, mj = load(tmp_path, flag=f'{flag}="disable"', equality='<joint name="tie" joint1="j" joint2="k"/>')
    assert model.notes == ("left out: the equality tie, which is not active",)
    compare(model, mj)


@pytest.mark.parametrize(("flag", "kept"), [("", True), ('frictionloss="disable" limit="disable"', False)])
def test_disabled_friction_and_limits_are_no_data(flag: str, kept: bool, tmp_path: Path) -> None:
    model, _ = load(tmp_path, flag=flag, joint='frictionloss="0.4" limited="true" range="-1 2"', one='frictionloss="1"')
    joint = model.mechanism().joints[0]
    assert (joint.dry_friction == 0.4) == kept == any(joint.limits)
    assert any("tendon_frictionloss" in note for note in model.notes) == kept


TURNING = """<mujoco><option gravity="0 0 -9.81"><flag contact="disable"/></option><worldbody>
<body name="a" pos="1 2 3" euler="20 30 40"><joint name="f" type="free" {f}/><geom type="box" size=".1 .2 .3"/>
 <body name="b" pos=".3 0 .1" euler="10 -20 30"><joint name="b" type="ball" pos=".1 0 0" {b}/>
  <geom type="box" size=".2 .1 .3" pos=".1 .1 0"/></body></body>
<body name="c" pos="0 0 1" euler="10 20 30"><joint name="c" type="ball" {c}/>
 <geom type="box" size=".1 .2 .3" pos=".1 0 .05"/></body></worldbody></mujoco>"""
RESISTED = [
    {"b": 'damping="2"', "c": 'damping="0.3" armature="0.4"'},
    {"b": 'stiffness="3"', "c": 'stiffness="2"'},
    {"f": 'damping="0.7"'},
    {"f": 'stiffness="5"'},
    {"f": 'stiffness="5" damping="1"', "b": 'stiffness="3" damping="2"', "c": 'stiffness="2" armature="1"'},
]


@pytest.mark.parametrize("rotation", ["euler_angles", "euler_parameters"])
@pytest.mark.parametrize("given", RESISTED, ids=str)
def test_balls_and_free_joints_are_damped_and_sprung(given: dict[str, str], rotation: str, tmp_path: Path) -> None:
    """Accelerations as MuJoCo has them, at any turn and next to rest, where the Jacobian is the stiffness."""
    path = tmp_path / "turning.xml"
    path.write_text(TURNING.format(**dict.fromkeys("fbc", "") | given))
    model = eg.load(path, rotation=rotation)
    assert not any("left out" in note for note in model.notes)
    equations = model.derive()
    module, judge = equations.compile(target="numpy"), Judge(path, model, rotation)
    for state in judge.states(equations.kinematics, 6, seed=3):
        found = module.rhs(0.0, np.concatenate([state.q, state.v]))[module.n_q :]
        assert np.abs(found - state.acceleration).max() < 1e-12 * np.abs(state.acceleration).max()
    x = module.x0()
    slope, step = module.jacobian(0.0, x), 1e-4 * np.ones(module.n_x)
    if rotation == "euler_angles":
        between = (module.rhs(0.0, x + step) - module.rhs(0.0, x - step)) / 2e-4
        assert slope @ np.ones(module.n_x) == pytest.approx(between, abs=1e-4)


@pytest.mark.parametrize("rotation", ["euler_angles", "euler_parameters"])
def test_the_armature_of_a_ball_on_a_moving_parent(rotation: str, tmp_path: Path) -> None:
    """Accelerations as MuJoCo has them; the rotor's coordinates are those of the ball."""
    path = tmp_path / "turning.xml"
    path.write_text(TURNING.format(**dict.fromkeys("fbc", "")))
    plain = eg.load(path, rotation=rotation)
    path.write_text(TURNING.format(f="", b='armature="0.7" damping="1"', c='armature="0.4"'))
    module, judge = eg.load(path, rotation=rotation).compile(target="numpy"), Judge(path, plain, rotation)
    equations = plain.derive()
    names = [*equations.kinematics.names, *equations.kinematics.velocity_names]
    at = [names.index(name.replace("b_rotor_", "b_")) for name in module.x_names]
    for state in judge.states(equations.kinematics, 6, seed=3):
        found = module.rhs(0.0, np.concatenate([state.q, state.v])[at])[module.n_q :]
        told = state.acceleration[np.array(at[module.n_q :]) - len(state.q)]
        assert np.abs(found - told).max() < 1e-12 * np.abs(told).max()


def test_armature_that_belongs_to_no_body_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "turning.xml"
    path.write_text(TURNING.format(f='armature="1"', b="", c=""))
    with pytest.raises(eg.ModelError, match="joint.f.armature: armature on a free joint is not supported"):
        eg.load(path)


def test_limits_and_dry_friction_of_balls_are_noted(tmp_path: Path) -> None:
    path = tmp_path / "turning.xml"
    path.write_text(TURNING.format(f="", b='range="0 40"', c='frictionloss="1"'))
    assert eg.load(path).notes == (
        "left out: the limit of the spherical joint b",
        "left out: the dry friction of the spherical joint c",
    )


NOTED = [
    ({"joint": 'stiffness="1 2"'}, "jnt_stiffnesspoly"),
    ({"joint": 'damping="1 2"'}, "dof_dampingpoly"),
    ({"one": 'stiffness="1 5"'}, "tendon_stiffnesspoly"),
    ({"one": 'damping="1 5"'}, "tendon_dampingpoly"),
    ({"one": 'frictionloss="1"'}, "tendon_frictionloss"),
    ({"one": 'limited="true" range="-1 1"'}, "tendon_limited"),
    ({"two": 'armature="1"'}, "the armature of the tendon two"),
    ({"motor": 'damping="1 2"'}, "actuator_dampingpoly"),
    ({"motor": 'armature="1"', "target": 'tendon="two"'}, "the armature of the actuator m"),
    ({"motor": 'delay="0.01" nsample="5"'}, "actuator_delay"),
]


@pytest.mark.parametrize(("parts", "what"), NOTED, ids=str)
def test_left_out_with_a_note(parts: dict[str, str], what: str, tmp_path: Path) -> None:
    (note,) = load(tmp_path, **parts)[0].notes
    assert note.startswith("left out: ")
    assert what in note


# -- ranges of controls and forces ------------------------------------------------------------------------------------
PULLERS = """
<mujoco model="pullers"><option gravity="0 0 -9.81"/><worldbody>
    <body pos="0 0 1"><joint name="j" axis="0 1 0" {joint}/><geom type="box" size=".1 .2 .3" pos=".1 0 0" mass="1.5"/>
      <body pos="0.3 0 0"><joint name="k" axis="0 1 0"/><geom type="box" size=".2 .2 .1" mass="0.5"/></body></body>
  </worldbody>
  <tendon><fixed name="cord" {tendon}><joint joint="j" coef="2"/><joint joint="k" coef="-3"/></fixed></tendon>
  <actuator>
    <position name="p" joint="j" gear="2" kp="20" kv="3" {p}/>
    <motor name="m" joint="j" gear="-4" {m}/>
    <general name="a" tendon="cord" gear="3" gainprm="5" biastype="affine" biasprm="0.3 -4 -0.2" {a}/>
    <motor name="b" tendon="cord" gear="0.5" {b}/>
  </actuator></mujoco>
"""
RANGES = [
    {"p": 'ctrlrange="-0.3 0.4"'},
    {"p": 'forcerange="-2 3"'},
    {"p": 'ctrlrange="-0.3 0.4" forcerange="-2 3"', "m": 'forcerange="-0.5 0.25"'},
    {"joint": 'actuatorfrcrange="-6 5"'},
    {"joint": 'actuatorfrcrange="-6 5"', "p": 'forcerange="-2 3"', "a": 'forcerange="-4 1"'},
    {"tendon": 'actuatorfrcrange="-3 2"'},
    {"tendon": 'actuatorfrcrange="-3 2"', "a": 'forcerange="-1 1.5"', "joint": 'actuatorfrcrange="-6 5"'},
    {"p": 'forcerange="-2 3" damping="0.7"', "joint": 'actuatorfrcrange="-6 5" damping="0.4" stiffness="3"'},
]


@pytest.mark.parametrize(("given", "target"), [*((g, "numpy") for g in RANGES), (RANGES[6], "cython")], ids=str)
def test_forces_and_controls_are_cut_as_in_mujoco(given: dict[str, str], target: str, tmp_path: Path) -> None:
    path = tmp_path / "pullers.xml"
    ranges = dict.fromkeys(("joint", "tendon", "p", "m", "a", "b"), "") | given
    path.write_text(PULLERS.format(**ranges))
    free = tmp_path / "free.xml"
    free.write_text(PULLERS.format(**dict.fromkeys(ranges, "")))
    model, mj = eg.load(path, limits="off"), mujoco.MjModel.from_xml_path(str(path))
    assert model.notes == ()
    module, data = model.compile(target=target, kernels=["rhs"]), mujoco.MjData(mj)
    loose = eg.load(free).compile(target="numpy", kernels=["rhs"])
    random = np.random.default_rng(3)
    differs = 0
    for _ in range(30):
        data.qpos[:], data.qvel[:] = random.uniform(-1, 1, (2, 2))
        data.ctrl[:] = random.uniform(-1.5, 1.5, 4)
        mujoco.mj_forward(mj, data)
        u = np.array([data.ctrl["pmab".index(name)] for name in module.u_names])
        x = np.concatenate([data.qpos, data.qvel])
        found = module.rhs(0.0, x, u=u)[2:]
        assert found == pytest.approx(data.qacc_smooth, rel=1e-9)
        if "damping" not in str(given):
            differs += bool(np.abs(found - loose.rhs(0.0, x, u=u)[2:]).max() > 1e-6)
    assert "damping" in str(given) or differs > 3  # the ranges were met


def test_controls_are_not_cut_where_the_file_says_so(tmp_path: Path) -> None:
    path = tmp_path / "pullers.xml"
    text = PULLERS.format(**dict.fromkeys(("joint", "tendon", "m", "a", "b"), "") | {"p": 'ctrlrange="-0.3 0.4"'})
    path.write_text(text.replace("<option gravity", '<option><flag clampctrl="disable"/></option><option gravity'))
    module, mj = eg.load(path).compile(target="numpy"), mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(mj)
    data.ctrl[:] = 1.0
    mujoco.mj_forward(mj, data)
    assert module.rhs(0.0, np.zeros(4), u=np.ones(4))[2:] == pytest.approx(data.qacc_smooth, rel=1e-9)


def test_a_gripper_does_not_close_faster_than_its_motor_can(tmp_path: Path) -> None:
    """450 rad/s^2 without the range of the force, 18 with it."""
    path = tmp_path / "gripper.xml"
    path.write_text(
        '<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="finger" axis="0 0 1"/>'
        '<inertial pos="0 0 0" mass="1" diaginertia="0.1 0.1 0.1"/></body></worldbody>'
        '<actuator><position name="grip" joint="finger" kp="45" forcerange="-1.8 1.8"/></actuator></mujoco>'
    )
    module = eg.load(path).compile(target="numpy")
    assert module.rhs(0.0, np.zeros(2), u=[1.0])[1] == pytest.approx(18.0)
    slope = module.jacobian(0.0, np.zeros(2), u=[1.0])
    assert slope[1].tolist() == [0.0, 0.0]  # a force that is cut does not change with the angle
    assert module.jacobian(0.0, np.zeros(2), u=[0.01])[1, 0] == pytest.approx(-450.0)


def test_limits_that_do_not_act_are_noted(tmp_path: Path) -> None:
    model, _ = load(tmp_path, joint='limited="true" range="-1 2" actuatorfrcrange="-1 1"')
    (note,) = model.notes
    assert note.startswith("the limits of joints stop nothing (j); a run that passes a limit warns; limits='stop'")
    assert load(tmp_path, joint='actuatorfrcrange="-1 1"')[0].notes == ()
    assert eg.load(tmp_path / "pieces.xml", limits="off").notes == ()


# -- every field of MuJoCo's model -----------------------------------------------------------------------------------
KINDS = {"read", "noted", "data", "unused", "derived", "solver", "screen", "user"}


@pytest.mark.parametrize(
    ("prefixes", "table"),
    [
        (("jnt_", "dof_"), mujoco_fields.JOINT_FIELDS),
        (("tendon_", "wrap_"), mujoco_fields.TENDON_FIELDS),
        (("actuator_",), mujoco_fields.ACTUATOR_FIELDS),
        (("eq_",), mujoco_fields.EQUALITY_FIELDS),
    ],
)
def test_every_field_of_a_compiled_model_has_its_place(prefixes: tuple[str, ...], table: dict[str, str]) -> None:
    """A later MuJoCo with a field that is not in the table may have physics that an import drops in silence."""
    assert {name for name in vars(mujoco.MjModel) if name.startswith(prefixes)} == set(table)
    assert set(table.values()) <= KINDS


def test_every_option_and_flag_has_its_place() -> None:
    assert {name for name in vars(mujoco.MjOption) if not name.startswith("_")} == set(mujoco_fields.OPTION_FIELDS)
    flags = {name.removeprefix("mjDSBL_") for name in mujoco.mjtDisableBit.__members__ if name != "mjNDISABLE"}
    assert flags == set(mujoco_fields.FLAGS)
    flags = {name.removeprefix("mjENBL_") for name in mujoco.mjtEnableBit.__members__ if name != "mjNENABLE"}
    assert flags == set(mujoco_fields.ENABLED)
    assert set(mujoco_fields.OPTION_FIELDS.values()) | set(mujoco_fields.FLAGS.values()) <= KINDS


def test_what_is_noted_is_a_field_that_is_said_to_be() -> None:
    tables = mujoco_fields.JOINT_FIELDS | mujoco_fields.TENDON_FIELDS | mujoco_fields.ACTUATOR_FIELDS
    for name, (flag, _) in NOTED_FIELDS.items():
        assert tables[name] == "noted"
        assert flag in mujoco_fields.FLAGS
