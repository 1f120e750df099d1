"""What an MJCF file says of forces and inertias, small piece by small piece: taken over as MuJoCo has it, or noted."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

import eomgen as eg
from eomgen.robots import mjcf_fields

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


# -- every field of MuJoCo's model -----------------------------------------------------------------------------------
KINDS = {"read", "noted", "data", "unused", "derived", "solver", "screen", "user"}


@pytest.mark.parametrize(
    ("prefixes", "table"),
    [
        (("jnt_", "dof_"), mjcf_fields.JOINT_FIELDS),
        (("tendon_", "wrap_"), mjcf_fields.TENDON_FIELDS),
        (("actuator_",), mjcf_fields.ACTUATOR_FIELDS),
    ],
)
def test_every_field_of_a_compiled_model_has_its_place(prefixes: tuple[str, ...], table: dict[str, str]) -> None:
    """A later MuJoCo with a field that is not in the table may have physics that an import drops in silence."""
    assert {name for name in vars(mujoco.MjModel) if name.startswith(prefixes)} == set(table)
    assert set(table.values()) <= KINDS


def test_every_option_and_flag_has_its_place() -> None:
    assert {name for name in vars(mujoco.MjOption) if not name.startswith("_")} == set(mjcf_fields.OPTION_FIELDS)
    flags = {name.removeprefix("mjDSBL_") for name in mujoco.mjtDisableBit.__members__ if name != "mjNDISABLE"}
    assert flags == set(mjcf_fields.FLAGS)
    assert set(mjcf_fields.OPTION_FIELDS.values()) | set(mjcf_fields.FLAGS.values()) <= KINDS


def test_what_is_noted_is_a_field_that_is_said_to_be() -> None:
    tables = mjcf_fields.JOINT_FIELDS | mjcf_fields.TENDON_FIELDS | mjcf_fields.ACTUATOR_FIELDS
    for name, (flag, _) in mjcf_fields.NOTED.items():
        assert tables[name] == "noted"
        assert flag in mjcf_fields.FLAGS
