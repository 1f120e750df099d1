"""MJCF models of PyPI packages against MuJoCo, by every method, in C and in the evaluator; loops and springs.

Compiled are ``embedding`` in Euler angles and ``recursive`` in Euler parameters, both ways where there are not too many
velocities, and ``lagrange`` where there are few.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from robots.comparison import Compiled, Evaluated, largest_differences
from robots.mujoco_judge import Judge, load_tree
from robots.shipped import mjcf_models
from sweeps import part_of

import eomgen as eg

MODELS = mjcf_models()
#: What robots are simulated by; tests/forms and tests/acceptance hold the other forms against these.
FORMS = ("embedding", "lagrange", "recursive")
LIMIT = 1e-9
FEW, MANY = 8, 24
ROTATIONS = ("euler_angles", "euler_parameters")
#: Models with free or ball joints, which turn either way.
TURNING = ("humanoid", "humanoid of Gymnasium", "fish", "ant", "quadruped", "humanoid of motion capture")
#: By all methods and in both rotations; the others always by the method that is chosen for them in one.
ALWAYS = ("acrobot", "ball in cup", "fish", "ant")
CASES = [(name, r, m) for name in MODELS for r in ROTATIONS[: 2 if name in TURNING else 1] for m in FORMS]


def is_kept(case: tuple[str, str, str]) -> bool:
    name, rotation, method = case
    return name in ALWAYS or (method == "recursive" and rotation == ROTATIONS[name in TURNING])


@pytest.fixture(scope="module")
def judged() -> Any:
    """Each model is read and judged once, for all methods."""
    known: dict[tuple[str, str], Any] = {}

    def judge(name: str, rotation: str) -> Any:
        if (name, rotation) not in known:
            known.clear()
            path, assets = MODELS[name]
            model = load_tree(path, assets, rotation)
            kinematics = model.derive("recursive").kinematics
            known[name, rotation] = model, Judge(path, model, rotation).states(kinematics, 20, seed=len(name))
        return known[name, rotation]

    return judge


@pytest.mark.slow
@pytest.mark.parametrize(("name", "rotation", "method"), part_of(CASES, is_kept))
def test_model_equals_mujoco(name: str, rotation: str, method: str, judged: Any) -> None:
    model, states = judged(name, rotation)
    equations = model.derive(method)
    assert (len(equations.kinematics.quaternion_slots) > 0) == (rotation == "euler_parameters")
    runs: list[Any] = [Evaluated(equations)]
    n, plain, last = len(states[0].v), rotation == ROTATIONS[0], rotation == ROTATIONS[name in TURNING]
    if n <= FEW or (method == "embedding" and plain) or (method == "recursive" and (last or n <= MANY)):
        runs.append(Compiled(equations, optimize=0, lanes=0))  # called state by state
    for run in runs:
        worst = largest_differences(model, run, states)
        assert max(worst.values()) <= LIMIT, (type(run).__name__, worst)


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
    for method in FORMS:
        equations = model.derive(method)
        states = judge.states(equations.kinematics, 20, seed=3)
        assert max(largest_differences(model, Evaluated(equations), states).values()) <= LIMIT
    assert max(largest_differences(model, Compiled(equations, optimize=0), states).values()) <= LIMIT
    poses = equations.compile(target="numpy", kernels=["poses"])
    start = poses.poses(poses.x0()[: poses.n_q])
    assert np.abs(start[poses.body_names.index("loose")] - judge.reference_pose("loose")).max() < 1e-12
    assert model.renamed["joints"] == {"a/1": "a_1", "a/2": "a_2", "0 free": "joint_0_free"}
    joints = {entry.name: entry.values for entry in model.description.sections["joints"]}
    assert joints["rail"]["limits"] == {"lower": -1.0, "upper": 2.0}
    assert joints["a_2"]["limits"] == {"effort": 4.0}
    assert joints["a_2"]["dry_friction"] == 0.3
    again = tmp_path / "again.yaml"
    model.save(again)
    loaded = eg.load(again).derive(method)
    (ours,), (theirs,) = (Evaluated(e)(states[:1]) for e in (loaded, equations))
    assert all((ours[key] == theirs[key]).all() for key in ours)


@pytest.mark.parametrize("rotation", ROTATIONS)
def test_loops_of_bodies_that_turn_freely_close(rotation: str, tmp_path: Path) -> None:
    path = tmp_path / "closed.xml"
    equality = '<equality><connect name="pin" body1="end" body2="loose" anchor="0.1 0.2 0"/></equality>'
    path.write_text(EVERYTHING.replace("<actuator>", equality + "<actuator>"))
    report = eg.load(path, rotation=rotation).check()
    assert report.loop_joints == ["pin"]
    assert (len(report.coordinates), report.degrees_of_freedom) == (14 if rotation == ROTATIONS[1] else 12, 9)
    assert report.assembly_restarts == 0


LOOPS = {
    "connect": '<connect name="pin" body1="coupler" body2="rocker" anchor="0.4 0 0.1"/>',
    "joint": '<joint joint1="a" joint2="b" polycoef="0.1 0.5 0.3 -0.2 0.1"/>',
    "tendon": '<tendon tendon1="one" tendon2="two" polycoef="0.1 0.5"/>',
    "weld": '<weld name="glue" body1="coupler" body2="rocker" relpose="0.4 0 0 0.9 0.1 0.3 0.2"/>',
}
LOOP = """
<mujoco model="loop">
  <worldbody>
    <body name="crank"><joint name="a" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 0.3" size="0.02"/>
      <body name="coupler" pos="0 0 0.3"><joint name="b" axis="0 1 0" ref="{ref}"/>{extra}
        <geom type="capsule" fromto="0 0 0 0.4 0 0.1" size="0.02"/></body></body>
    <body name="rocker" pos="0.4 0 0"><joint name="c" axis="0 1 0"/>{extra}
      <geom type="capsule" fromto="0 0 0 0 0 0.4" size="0.02"/></body>
  </worldbody>
  <tendon>
    <fixed name="one"><joint joint="a" coef="2"/><joint joint="b" coef="-0.5"/></fixed>
    <fixed name="two"><joint joint="b" coef="0.3"/><joint joint="c" coef="1.5"/></fixed>
  </tendon>
  <equality>{equality}</equality>
</mujoco>
"""
ROWS = {"connect": 3, "weld": 6, "joint": 1, "tendon": 1}
EXTRA = '<joint name="{0}1" axis="1 0 0"/><joint name="{0}2" axis="0 0 1"/><joint name="{0}3" type="slide"/>'


@pytest.mark.parametrize("kind", LOOPS)
def test_equalities_close_loops_as_mujocos_rows_do(kind: str, tmp_path: Path) -> None:
    """Accelerations of the loop against multipliers on the rows that MuJoCo makes, at states that satisfy both."""
    text = LOOP.replace("{equality}", LOOPS[kind]).replace("{ref}", "0" if ROWS[kind] > 1 else "20")
    for name in ("m", "n"):
        text = text.replace("{extra}", EXTRA.format(name) if kind == "weld" else "", 1)
    path = tmp_path / "loop.xml"
    path.write_text(text)
    module = eg.load(path).derive().compile(target="numpy")
    mj = mujoco.MjModel.from_xml_path(str(path))
    mj.geom_contype[:] = 0
    data = mujoco.MjData(mj)
    rows = ROWS[kind]
    order = [mj.joint(name).dofadr[0] for name in module.q_names]
    random = np.random.default_rng(4)
    for _ in range(5):
        x = module.x0() + random.uniform(-0.05, 0.05, module.n_x)
        x[module.n_q :] *= 40
        x = module.project(x)
        q, v = x[: module.n_q], x[module.n_q :]

        def at(q: np.ndarray, v: np.ndarray) -> np.ndarray:
            data.qpos[order], data.qvel[order] = q, v
            mujoco.mj_forward(mj, data)
            return np.array(data.efc_J).reshape(-1, mj.nv)[:rows][:, order]

        ahead = (at(q + 1e-5 * v, v) - at(q - 1e-5 * v, v)) / 2e-5
        C_q = at(q, v)
        assert np.abs(data.efc_pos[:rows]).max() < 1e-9
        assert np.abs(C_q @ v).max() < 1e-9
        M = np.zeros((mj.nv, mj.nv))
        for column, unit in zip(M, np.eye(mj.nv), strict=True):
            mujoco.mj_mulM(mj, data, column, unit)
        M = M[np.ix_(order, order)]
        h = data.qfrc_bias[order]
        U, sizes, Vt = np.linalg.svd(C_q)
        rank = int((sizes > 1e-8).sum())
        G, g = Vt[:rank], (U.T @ (ahead @ v))[:rank] / sizes[:rank]
        K = np.block([[M, G.T], [G, np.zeros((rank, rank))]])
        expected = np.linalg.solve(K, np.concatenate([-h, -g]))[: mj.nv]
        found = module.rhs(0.0, x)[module.n_q :]
        assert np.abs(found - expected).max() <= 1e-6 * np.abs(expected).max()  # the rows' rate is by differences


def test_a_warning_of_mujoco_is_a_note_and_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # where MuJoCo would write MUJOCO_LOG.TXT
    path, assets = MODELS["cheetah"]
    before = mujoco.get_mju_user_warning()
    model = eg.load(path, assets=str(assets))
    assert any("settotalmass" in note for note in model.notes)
    assert mujoco.get_mju_user_warning() is before
    assert list(tmp_path.iterdir()) == []


def test_what_is_left_out_is_said(tmp_path: Path) -> None:
    path = tmp_path / "left_out.xml"
    text = EVERYTHING.replace('<option gravity="0.5 0 -9"/>', '<option density="1.2"/>')
    text = text.replace("<actuator>", '<actuator><motor name="site" site="s"/>')
    path.write_text(text.replace('<geom type="box" size="0.2', '<site name="s"/><geom type="box" size="0.2'))
    notes = " ".join(eg.load(path).notes)
    assert "density" in notes
    assert "(site)" in notes


def test_it_floats_by_its_own_word(tmp_path: Path) -> None:
    path = tmp_path / "m.xml"
    path.write_text(EVERYTHING)
    with pytest.raises(eg.UsageError, match="itself defines which bodies float"):
        eg.load(path, floating=True)


def numbers_of(model: Any) -> dict[str, Any]:
    return {entry.name: entry.values for entry in model.description.sections["bodies"]}


def test_joints_in_chain_become_bodies_without_mass(tmp_path: Path) -> None:
    path = tmp_path / "m.xml"
    path.write_text(EVERYTHING)
    bodies = numbers_of(eg.load(path))
    assert bodies["arm_a_1"]["mass"] == 0.0
    assert bodies["arm"]["mass"] == pytest.approx(1.0)
