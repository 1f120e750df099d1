"""What an MJCF file says of joints, forces, inertias and ties, piece by piece: taken as MuJoCo has it, or noted."""

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from model_files import described
from mujoco_judge import Judge
from refusals import refuses
from robot_comparison import Compiled, largest_differences
from shipped_robots import mjcf_models

import eomgen as eg

ROTATIONS = ("euler_angles", "euler_parameters")

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
    {"one": 'armature="0.2" damping="0.3" stiffness="4" springlength="0.3"'},
    {"two": 'damping="0.3" stiffness="4"'},
    {"flag": 'spring="disable"', "joint": 'stiffness="5" damping="2"', "two": 'stiffness="3" damping="0.5"'},
    {"flag": 'damper="disable"', "joint": 'stiffness="5" damping="2"', "two": 'stiffness="3" damping="0.5"'},
    {"flag": 'damper="disable"', "motor": 'damping="0.7" armature="0.2"'},
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


@pytest.mark.parametrize(("flag", "kept"), [("", True), ('frictionloss="disable" limit="disable"', False)])
def test_disabled_friction_and_limits_are_no_data(flag: str, kept: bool, tmp_path: Path) -> None:
    model, _ = load(tmp_path, flag=flag, joint='frictionloss="0.4" limited="true" range="-1 2"', one='frictionloss="1"')
    joint = described(model)["joints"]["j"]
    assert (joint.get("dry_friction") == 0.4) == kept == ("limits" in joint)
    assert any("tendon_frictionloss" in note for note in model.notes) == kept


TURNING = """<mujoco><option gravity="0 0 -9.81"><flag contact="disable"/></option><worldbody>
<body name="a" pos="1 2 3" euler="20 30 40"><joint name="f" type="free" {f}/><geom type="box" size=".1 .2 .3"/>
 <body name="b" pos=".3 0 .1" euler="10 -20 30"><joint name="b" type="ball" pos=".1 0 0" {b}/>
  <geom type="box" size=".2 .1 .3" pos=".1 .1 0"/></body></body>
<body name="c" pos="0 0 1" euler="10 20 30"><joint name="c" type="ball" {c}/>
 <geom type="box" size=".1 .2 .3" pos=".1 0 .05"/></body></worldbody></mujoco>"""
RESISTED = [
    {"b": 'stiffness="3"', "c": 'stiffness="2"'},
    {"f": 'damping="0.7"'},
    {"f": 'stiffness="5" damping="1"', "b": 'stiffness="3" damping="2"', "c": 'stiffness="2" armature="1"'},
]


@pytest.mark.parametrize("rotation", ROTATIONS)
@pytest.mark.parametrize("given", RESISTED, ids=str)
def test_balls_and_free_joints_are_damped_and_sprung(given: dict[str, str], rotation: str, tmp_path: Path) -> None:
    """Accelerations as MuJoCo has them, at any turn and next to rest, where the Jacobian is the stiffness."""
    path = tmp_path / "turning.xml"
    path.write_text(TURNING.format(**dict.fromkeys("fbc", "") | given))
    model = eg.load(path, rotation=rotation)
    assert not any("left out" in note for note in model.notes)
    module, judge = model.compile(target="numpy"), Judge(path, model, rotation)
    for state in judge.states(module, 6, seed=3):
        found = module.rhs(0.0, np.concatenate([state.q, state.v]))[module.n_q :]
        assert np.abs(found - state.acceleration).max() < 1e-12 * np.abs(state.acceleration).max()
    x = module.x0()
    slope, step = module.jacobian(0.0, x), 1e-4 * np.ones(module.n_x)
    if rotation == "euler_angles":
        between = (module.rhs(0.0, x + step) - module.rhs(0.0, x - step)) / 2e-4
        assert slope @ np.ones(module.n_x) == pytest.approx(between, abs=1e-4)


@pytest.mark.parametrize("rotation", ROTATIONS)
def test_the_armature_of_a_ball_on_a_moving_parent(rotation: str, tmp_path: Path) -> None:
    """Accelerations as MuJoCo has them; the rotor's coordinates are those of the ball."""
    path = tmp_path / "turning.xml"
    path.write_text(TURNING.format(**dict.fromkeys("fbc", "")))
    plain = eg.load(path, rotation=rotation)
    path.write_text(TURNING.format(f="", b='armature="0.7" damping="1"', c='armature="0.4"'))
    module, judge = eg.load(path, rotation=rotation).compile(target="numpy"), Judge(path, plain, rotation)
    bare = plain.compile(target="numpy", kernels=["poses"])
    names = [*bare.q_names, *bare.v_names]
    at = [names.index(name.replace("b_rotor_", "b_")) for name in module.x_names]
    for state in judge.states(bare, 6, seed=3):
        found = module.rhs(0.0, np.concatenate([state.q, state.v])[at])[module.n_q :]
        told = state.acceleration[np.array(at[module.n_q :]) - len(state.q)]
        assert np.abs(found - told).max() < 1e-12 * np.abs(told).max()


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
    {"p": 'forcerange="-2 3"'},
    {"p": 'ctrlrange="-0.3 0.4" forcerange="-2 3"', "m": 'forcerange="-0.5 0.25"'},
    {"joint": 'actuatorfrcrange="-6 5"', "p": 'forcerange="-2 3"', "a": 'forcerange="-4 1"'},
    {"tendon": 'actuatorfrcrange="-3 2"'},
    {"tendon": 'actuatorfrcrange="-3 2"', "a": 'forcerange="-1 1.5"', "joint": 'actuatorfrcrange="-6 5"'},
    {"p": 'forcerange="-2 3" damping="0.7"', "joint": 'actuatorfrcrange="-6 5" damping="0.4" stiffness="3"'},
]


@pytest.mark.parametrize(
    ("given", "target"),
    [*((g, "numpy") for g in RANGES), pytest.param(RANGES[-2], "cython", marks=pytest.mark.thorough)],
    ids=str,
)
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


def test_limits_that_do_not_act_are_noted(tmp_path: Path) -> None:
    model, _ = load(tmp_path, joint='limited="true" range="-1 2" actuatorfrcrange="-1 1"')
    (note,) = model.notes
    assert note.startswith("joint limits are not enforced (j); a run that passes a limit warns; limits='stop'")
    assert load(tmp_path, joint='actuatorfrcrange="-1 1"')[0].notes == ()
    assert eg.load(tmp_path / "pieces.xml", limits="off").notes == ()


# -- whole files ------------------------------------------------------------------------------------------------------
EVERYTHING = """
<mujoco model="every thing">
  <option gravity="0.5 0 -9"/>
  <worldbody>
    <body name="cart" pos="0 0 1">
      <joint name="rail" type="slide" axis="1 0.2 0" ref="0.3" stiffness="7" springref="0.1" damping="0.4"
             range="-1 2" limited="true"/>
      <geom type="box" size="0.2 0.1 0.1" mass="2"/>
      <body name="arm" pos="0 0.1 0" euler="20 0 30">
        <joint name="a/1" axis="0 1 0" pos="0.01 0.02 0" ref="15" stiffness="3" springref="40" armature="0.05"/>
        <joint name="a/2" axis="1 0 1" pos="0 0 0.1" frictionloss="0.3" actuatorfrcrange="-4 4"/>
        <geom type="capsule" fromto="0 0 0 0.5 0 0" size="0.03" mass="1"/>
        <body name="end" pos="0.5 0 0">
          <joint name="ball" type="ball"/>
          <geom type="box" size="0.05 0.1 0.02" pos="0.1 0 0" mass="0.4"/>
        </body>
      </body>
    </body>
    <body name="loose" pos="1 2 3" euler="10 20 30"><freejoint name="0 free"/>
      <geom type="box" size="0.1 0.2 0.3" mass="1.5"/></body>
  </worldbody>
  <tendon><fixed name="cord" stiffness="5" damping="0.2" springlength="0.25">
    <joint joint="rail" coef="2"/><joint joint="a/2" coef="-0.5"/></fixed></tendon>
  <actuator>
    <motor name="push" joint="rail" gear="3"/>
    <position name="servo" joint="a/1" kp="11" kv="0.7"/>
    <velocity name="speed" joint="a/2" kv="2" gear="1.5"/>
    <motor name="pull" tendon="cord" gear="4"/>
  </actuator>
</mujoco>
"""


@pytest.mark.parametrize("rotation", ROTATIONS)
def test_springs_drives_tendons_and_joint_chains_equal_mujoco(rotation: str, tmp_path: Path) -> None:
    path = tmp_path / "everything.xml"
    path.write_text(EVERYTHING)
    model = eg.load(path, rotation=rotation)
    judge = Judge(path, model, rotation)
    for method in ("embedding", "lagrange", "recursive"):
        run = Compiled(model.derive(method), "numpy")
        states = judge.states(run.module, 6, seed=3)
        assert max(largest_differences(model, run, states).values()) <= 1e-9
    poses = model.compile(target="numpy", kernels=["poses"])
    start = poses.poses(poses.x0()[: poses.n_q])
    assert np.abs(start[poses.body_names.index("loose")] - judge.reference_pose("loose")).max() < 1e-12
    assert model.renamed["joints"] == {"a/1": "a_1", "a/2": "a_2", "0 free": "joint_0_free"}
    joints = described(model)["joints"]
    assert joints["rail"]["limits"] == {"lower": -1.0, "upper": 2.0}
    assert joints["a_2"]["limits"] == {"effort": 4.0}
    assert joints["a_2"]["dry_friction"] == 0.3
    again = tmp_path / "again.yaml"
    model.save(again)
    (ours,), (theirs,) = (each(states[:1]) for each in (Compiled(eg.load(again).derive(method), "numpy"), run))
    assert all((ours[key] == theirs[key]).all() for key in ours)
    bodies = described(model)["bodies"]  # joints in chain become bodies without mass
    assert (bodies["arm_a_1"]["mass"], bodies["arm"]["mass"]) == (0.0, pytest.approx(1.0))


def test_it_floats_by_its_own_key(tmp_path: Path) -> None:
    path = tmp_path / "m.xml"
    path.write_text(EVERYTHING)
    refuses("EG-CONFLICT defines", eg.load, path, floating=True)


def test_a_warning_of_mujoco_is_a_note_and_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # where MuJoCo would write MUJOCO_LOG.TXT
    path, assets = mjcf_models()["cheetah"]
    before = mujoco.get_mju_user_warning()
    model = eg.load(path, assets=str(assets))
    assert any("settotalmass" in note for note in model.notes)
    assert mujoco.get_mju_user_warning() is before
    assert list(tmp_path.iterdir()) == []


# -- equalities -------------------------------------------------------------------------------------------------------


AWAY = """<mujoco model="away"><option gravity="0 0 0"><flag contact="disable"/></option><worldbody>
<site name="w" pos="0.4 0 1" euler="10 20 30"/>
<body name="a" pos="0.1 0 1" euler="0 0 10"><freejoint name="f"/>
 <geom type="box" size=".1 .2 .3" pos="0.1 0 0" mass="1.5"/><site name="s" pos="0.2 0.1 0" euler="5 6 7"/></body>
<body name="b" pos="0.1 0 1" euler="0 0 10"><joint name="k" type="hinge" ref="20" axis="1 0 0"/>
 <geom type="box" size=".1 .2 .3" pos="0.1 0 0" mass="1.5"/></body>
<body name="c" pos="0.1 0 1" euler="0 0 10"><joint name="l" type="hinge" ref="-10" axis="1 0 0"/>
 <geom type="box" size=".1 .2 .3" pos="0.1 0 0" mass="1.5"/></body>
<body name="d" pos="0.1 0 3"><joint name="n" type="hinge" ref="30" axis="1 0 0"/>
 <geom type="box" size=".1 .2 .3" pos="0.1 0 0" mass="1.5"/></body>
</worldbody><equality>{}<joint joint1="k" joint2="l" polycoef="0.1 2 0.3 0 0"/></equality></mujoco>"""


@pytest.mark.parametrize("rotation", ROTATIONS)
@pytest.mark.parametrize("weld", ["", '<weld site1="w" site2="s"/>'])
def test_equalities_need_not_hold_where_the_file_places_the_bodies(weld: str, rotation: str, tmp_path: Path) -> None:
    """MuJoCo finds no gap of any equality where ours assembles; what nothing ties starts where the file says."""
    path = tmp_path / "away.xml"
    path.write_text(AWAY.format(weld))
    module = eg.load(path, rotation="euler_parameters").compile(target="numpy")
    mj = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(mj)
    mujoco.mj_forward(mj, data)
    assert np.abs(data.efc_pos).max() > 0.09
    data.qpos[:] = module.x0()[: module.n_q]
    mujoco.mj_forward(mj, data)
    assert data.nefc == (7 if weld else 1)
    assert np.abs(data.efc_pos).max() < 1e-12
    assert data.qpos[-1] == pytest.approx(np.deg2rad(30), abs=1e-15)
    other = eg.load(path, rotation=rotation).compile(target="numpy")
    x, y = (dict(zip(m.q_names, m.x0(), strict=False)) for m in (module, other))
    assert [x[name] for name in "kln"] == pytest.approx([y[name] for name in "kln"], abs=1e-6 if weld else 1e-12)
    if not weld:  # a free joint that nothing ties stays exactly where it is
        assert (x["f_x"], x["f_z"], y["f_x"], y["f_z"]) == (0.1, 1.0, 0.1, 1.0)


HELD = """<mujoco><option gravity="0 0 0"><flag contact="disable"/></option><worldbody>
<body name="wall" pos=".3 .1 0" euler="20 30 10"><site name="s" pos=".1 .2 .3" euler="5 10 40"/></body>
<body name="arm" pos="0 0 1"><joint name="h" axis="0 1 0"/><geom size=".1" pos=".2 0 0"/>
 <site name="r" pos=".3 0 .1"/></body>
<body name="beam" pos="0 -1 0"><freejoint name="f"/><site name="t" pos="-.1 .2 .3" euler="50 10 40"/>
 <geom type="box" size=".1 .2 .3"/></body></worldbody><equality><{}/></equality></mujoco>"""
ATTRIBUTES = [
    'weld body1="wall" body2="beam" torquescale="0" anchor="0 1 0"',
    'weld site1="r" site2="t" torquescale="-3"',
    'weld body1="arm" body2="beam" relpose="0 0 0 0 0 0 0" anchor="1 1 1"',
    'weld body1="beam" relpose="0 1 0 1 0 0 0"',
    'weld body1="arm" body2="beam" solref="0.02 1" solimp="0 0 0" anchor="0 0 0"',
    'connect body1="arm" body2="beam" anchor="1 -2 3" solref="-400 -40"',
    'connect site1="r" site2="t"',
    'joint joint1="h" polycoef="0.3 7 7 7 7"',
    'connect body1="arm" body2="beam" anchor="0 0 0" active="false"',
]


@pytest.mark.parametrize("equality", ATTRIBUTES)
def test_attributes_of_equalities_leave_the_motions_that_mujocos_rows_leave(equality: str, tmp_path: Path) -> None:
    """Rows of MuJoCo and ours span the same space at states that satisfy both; MuJoCo sees no gap there."""
    path = tmp_path / "held.xml"
    path.write_text(HELD.format(equality))
    module = eg.load(path, rotation="euler_parameters").compile(target="numpy")
    mj = mujoco.MjModel.from_xml_path(str(path))
    data, random = mujoco.MjData(mj), np.random.default_rng(5)
    assert module.q_names[0] == "h"
    for _ in range(3):
        x = module.x0() + random.uniform(-0.05, 0.05, module.n_x)
        x = module.project(x)
        data.qpos[:], data.qvel[:] = x[: module.n_q], x[module.n_q :]
        mujoco.mj_forward(mj, data)
        rows = np.array(data.efc_J).reshape(-1, mj.nv)
        ours = np.asarray(module.constraint_jacobian(x[: module.n_q])).reshape(-1, mj.nv)
        rank = np.linalg.matrix_rank(rows, tol=1e-9) if len(rows) else 0
        assert module.n_v - module.n_dof == rank == len(ours)
        assert np.linalg.matrix_rank(np.vstack([rows, ours]), tol=1e-6) == rank
        assert np.abs(data.efc_pos).max(initial=0.0) < 1e-9
        assert np.abs(rows @ data.qvel).max(initial=0.0) < 1e-9


YIELDING = [
    ('weld name="e" body1="arm" body2="beam" torquescale="0.01"', "torquescale"),
    ('connect name="e" body1="arm" body2="beam" anchor="0 0 0" solref="0 0"', "solref"),
    ('weld name="e" body1="arm" body2="beam" solref="50 1" torquescale="1e-9"', "solref and torquescale"),
    ('joint name="e" joint1="h" solref="0 -100"', "solref"),
    ('joint name="e" joint1="h" solref="0 1" solimp="0 0 0"', ""),
    ('connect name="e" body1="arm" body2="beam" anchor="0 0 0" solref="-2500 -100"', ""),
]


@pytest.mark.parametrize(("equality", "what"), YIELDING)
def test_equalities_that_hardly_hold_in_mujoco_are_noted(equality: str, what: str, tmp_path: Path) -> None:
    path = tmp_path / "soft.xml"
    path.write_text(HELD.format(equality))
    note = f"the equality e holds exactly here; MuJoCo lets it yield far ({what})"
    assert eg.load(path).notes == ((note,) if what else ())


# -- nothing passes in silence ----------------------------------------------------------------------------------------
PIECES = """<mujoco>{head}<worldbody>
<body name="a" {a}><joint name="j" axis="0 1 0" {joint}/><geom name="g" size=".1" pos=".1 0 0" {geom}/>
  {site}</body>
<body name="b" pos="3 0 0" {b}>{free}<geom name="h" size=".1" pos=".1 0 0"/></body></worldbody>{tail}</mujoco>"""
NOTHING = dict.fromkeys(("head", "a", "joint", "site", "b", "tail"), "")
NOTHING |= {"free": "<joint name='k'/>", "geom": 'contype="0" conaffinity="0"'}
CORD = '<joint joint="j" coef="1"/>'
CASES = [
    ({}, None),
    ({"geom": ""}, "left out: contact of geoms"),
    ({"geom": "", "head": '<option><flag contact="disable"/></option>'}, None),
    ({"tail": '<contact><pair geom1="g" geom2="h"/></contact>'}, "left out: contact of geoms"),
    ({"head": '<option density="1.2"/>'}, "density"),
    ({"head": '<option density="0"/>'}, None),
    ({"a": 'gravcomp="1"'}, "gravity compensation"),
    ({"b": 'mocap="true"', "free": ""}, "mocap"),
    ({"joint": 'actuatorgravcomp="true"', "a": 'gravcomp="1"'}, "gravity compensation"),
    ({"joint": 'frictionloss="0.1"'}, "the dry friction of joints does not act (j)"),
    ({"joint": 'range="-1 1" limited="true"'}, "joint limits are not enforced"),
    ({"tail": '<keyframe><key name="home" qpos="0 0"/></keyframe>'}, "left out: stored states (<keyframe>)"),
    (
        {"site": '<site name="s"/>', "tail": '<actuator><motor name="jet" site="s"/></actuator>'},
        "by a linear law (jet)",
    ),
    ({"tail": '<actuator><muscle name="biceps" joint="j" lengthrange="0 1"/></actuator>'}, "(biceps)"),
    ({"tail": f'<tendon><fixed name="t" range="-1 1" limited="true">{CORD}</fixed></tendon>'}, "tendon_limited"),
    ({"head": '<option><flag sleep="enable"/></option>', "b": 'sleep="init"'}, "bodies at rest that MuJoCo lets sleep"),
    ({"b": 'sleep="init"'}, None),
    ({"tail": '<sensor><jointpos joint="j"/></sensor><custom><numeric name="n" data="1"/></custom>'}, None),
    ({"head": '<visual><global fovy="30"/></visual><size memory="1M"/><statistic extent="2"/>'}, None),
]


@pytest.mark.parametrize(("parts", "said"), CASES, ids=str)
def test_what_mjcf_has_and_the_model_has_not_is_noted(parts: dict[str, str], said: str | None, tmp_path: Path) -> None:
    path = tmp_path / "pieces.xml"
    path.write_text(PIECES.format(**NOTHING | parts))
    notes = eg.load(path).notes
    if said is None:
        assert notes == ()
    else:
        (note,) = notes
        assert said in note


#: Fields of MuJoCo's compiled models, options and flags that somebody has looked at.
KNOWN_FIELDS = (
    "actuator_acc0 actuator_actadr actuator_actearly actuator_actlimited actuator_actnum actuator_actrange "
    "actuator_armature actuator_biasprm actuator_biastype actuator_cranklength actuator_ctrladr "
    "actuator_ctrllimited actuator_ctrlnum actuator_ctrlrange actuator_ctrlspec actuator_damping "
    "actuator_dampingpoly actuator_delay actuator_dynprm actuator_dyntype actuator_forcelimited actuator_forcerange "
    "actuator_gainprm actuator_gaintype actuator_gear actuator_group actuator_history actuator_historyadr "
    "actuator_length0 actuator_lengthrange actuator_outadr actuator_outnum actuator_plugin actuator_trnid "
    "actuator_trntype actuator_user dof_M0 dof_Madr dof_armature dof_bodyid dof_damping dof_dampingpoly "
    "dof_frictionloss dof_invweight0 dof_jntid dof_length dof_parentid dof_simplenum dof_solimp dof_solref "
    "dof_treeid eq_active0 eq_data eq_obj1id eq_obj2id eq_objtype eq_solimp eq_solref eq_type jnt_actfrclimited "
    "jnt_actfrcrange jnt_actgravcomp jnt_actuatorid jnt_axis jnt_bodyid jnt_dofadr jnt_group jnt_limited jnt_margin "
    "jnt_plasticadr jnt_pos jnt_qposadr jnt_range jnt_solimp jnt_solref jnt_springyield jnt_stiffness "
    "jnt_stiffnesspoly jnt_type jnt_user tendon_actfrclimited tendon_actfrcrange tendon_actuatorid tendon_adr "
    "tendon_armature tendon_damping tendon_dampingpoly tendon_frictionloss tendon_group tendon_invweight0 "
    "tendon_length0 tendon_lengthspring tendon_limited tendon_margin tendon_matid tendon_num tendon_plasticadr "
    "tendon_range tendon_rgba tendon_solimp_fri tendon_solimp_lim tendon_solref_fri tendon_solref_lim "
    "tendon_springyield tendon_stiffness tendon_stiffnesspoly tendon_treeid tendon_treenum tendon_type tendon_user "
    "tendon_width wrap_objid wrap_prm wrap_type"
)
KNOWN_OPTIONS = (
    "ccd_iterations ccd_tolerance cone density disableactuator disableflags enableflags gravity impratio integrator "
    "iterations jacobian ls_iterations ls_tolerance magnetic noslip_iterations noslip_tolerance o_friction o_margin "
    "o_solimp o_solref sdf_initpoints sdf_iterations sleep_tolerance solver timestep tolerance viscosity wind"
)
KNOWN_FLAGS = (
    "ACTUATION AUTORESET CLAMPCTRL CONSTRAINT CONTACT DAMPER DIAGEXACT ENERGY EQUALITY EULERDAMP FILTERPARENT "
    "FRICTIONLOSS FWDINV GRAVITY INVDISCRETE IPC ISLAND LIMIT MIDPHASE MULTICCD NATIVECCD OVERRIDE REFSAFE SENSOR "
    "SLEEP SPECULATIVE SPRING WARMSTART"
)


def test_every_field_option_and_flag_has_been_looked_at() -> None:
    """A later MuJoCo with a field that is not listed may have physics that an import drops in silence."""
    prefixes = ("jnt_", "dof_", "tendon_", "wrap_", "actuator_", "eq_")
    assert {name for name in vars(mujoco.MjModel) if name.startswith(prefixes)} == set(KNOWN_FIELDS.split())
    assert {name for name in vars(mujoco.MjOption) if not name.startswith("_")} == set(KNOWN_OPTIONS.split())
    members = [*mujoco.mjtDisableBit.__members__, *mujoco.mjtEnableBit.__members__]
    flags = {name.partition("_")[2] for name in members if name not in ("mjNDISABLE", "mjNENABLE")}
    assert flags == set(KNOWN_FLAGS.split())


def test_a_weld_between_bodies_that_stand(tmp_path: Path) -> None:
    """It holds nothing, and the model compiles."""
    text = (
        '<mujoco><worldbody><body name="a"><freejoint/><geom size=".1"/></body><body name="post">'
        '<geom size=".1" pos="2 0 0"/></body>'
        '<body name="rail"><geom size=".1" pos="3 0 0"/></body></worldbody><equality>'
        '<weld name="w" body1="post" body2="rail"/></equality></mujoco>'
    )
    (tmp_path / "standing.xml").write_text(text)
    eg.load(tmp_path / "standing.xml").compile(target="numpy")
