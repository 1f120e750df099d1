"""Joints tied to a mimicking joint that is locked, and by equalities that a file's own pose does not satisfy."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

import eomgen as eg

LINK = '<link name="{0}"><inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1"/></inertial></link>'
JOINT = (
    '<joint name="{0}" type="revolute"><parent link="base"/><child link="{1}"/><axis xyz="0 0 1"/>'
    '<limit lower="-1" upper="1" effort="1" velocity="1"/>{2}</joint>'
)
MIMIC = f"""<robot name="r"><link name="base"/>{"".join(LINK.format(x) for x in ("l1", "l2", "l3"))}
{JOINT.format("a", "l1", "")}
{JOINT.format("b", "l2", '<mimic joint="a" multiplier="-2" offset="0.1"/>')}
{JOINT.format("c", "l3", "")}</robot>"""


@pytest.mark.parametrize(("lock", "held"), [({"b": 0.3}, ("a", -0.1)), ({"a": 0.3}, ("b", -0.5))])
def test_a_locked_joint_holds_the_one_it_is_tied_to(
    lock: dict[str, float], held: tuple[str, float], tmp_path: Path
) -> None:
    path = tmp_path / "m.urdf"
    path.write_text(MIMIC)
    module = eg.load(path, mimic="coupling", lock=lock, actuate=True).compile(target="numpy")
    name, value = held
    assert module.n_dof == 1
    x = module.x0(c=0.2)
    assert x[module.q_names.index(name)] == pytest.approx(value, abs=1e-14)
    u = np.ones(len(module.u_names))
    rates = dict(zip(module.x_names, module.rhs(0.0, x, u=u), strict=True))
    assert rates[f"{name}_dot"] == pytest.approx(0.0, abs=1e-12)
    assert rates["c_dot"] == pytest.approx(10.0)


def test_locks_of_all_tied_joints_leave_a_note(tmp_path: Path) -> None:
    path = tmp_path / "m.urdf"
    path.write_text(MIMIC)
    model = eg.load(path, mimic="coupling", lock={"a": -0.1, "b": 0.3}, limits="off")
    assert model.notes == ("left out: the coupling b_mimic, all of whose joints are locked",)
    assert eg.load(path, lock={"b": 0.3}, limits="off").notes == ()


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


@pytest.mark.parametrize("rotation", ["euler_angles", "euler_parameters"])
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
    'weld body1="arm" body2="beam" torquescale="0" relpose=".1 .2 .3 1 1 0 0" anchor=".3 .1 0"',
    'weld site1="s" site2="t" torquescale="0"',
    'weld site1="r" site2="t" torquescale="-3"',
    'weld body1="arm" body2="beam" relpose="0 0 0 0 0 0 0" anchor="1 1 1"',
    'weld body1="beam" relpose="0 1 0 1 0 0 0"',
    'weld body1="beam" relpose="0 1 0 1 0 0 0" torquescale="0"',
    'weld body1="arm" body2="beam" solref="0.02 1" solimp="0 0 0" anchor="0 0 0"',
    'connect body1="arm" body2="beam" anchor="1 -2 3" solref="-400 -40"',
    'connect site1="r" site2="t"',
    'joint joint1="h" polycoef="0 0 0 0 0"',
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
    mujoco.set_mju_user_warning(lambda text: None)  # no log file in the current folder
    mj = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(mj)
    data.qpos[:] = 0.1, 0.2, -1.1, 0.3, 1.0, 0.5, 0.1, 0.2
    for _ in range(int(2 / mj.opt.timestep)):
        mujoco.mj_step(mj, data)
    scale = mj.eq_data[0][10] if what.endswith("torquescale") else 1.0
    assert (np.abs(data.efc_pos).max() / abs(scale) > 0.05) == bool(what)
