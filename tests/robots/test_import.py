"""What an import makes of a robot: names, limits, shapes, merged inertias, locked and mimicking joints, and back."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from jsonschema import Draft202012Validator

import eomgen as eg
from eomgen.describe import model_schema
from eomgen.describe.yaml_nodes import Document
from eomgen.numeric.rotation_matrices import about, roll_pitch_yaw
from eomgen.robots.robot_frames import placed

ARM = Path(__file__).parents[2] / "examples" / "arm.urdf"


def values(model: Any, section: str) -> dict[str, Any]:
    return {entry.name: entry.values for entry in model.description.sections[section]}


def test_limits_and_shapes_travel_to_the_module_and_back(tmp_path: Path) -> None:
    mesh = '<mesh filename="package://arm/meshes/forearm.stl"/>'
    file = tmp_path / "arm.urdf"
    file.write_text(ARM.read_text().replace('<box size="0.26 0.03 0.03"/>', mesh))
    model = eg.load(file)
    module = model.compile(target="numpy", kernels=["mass_matrix"])
    assert module.limits["elbow"] == {"lower": -0.1, "upper": 2.6, "velocity": 3.0, "effort": 10.0}
    assert module.limits["yaw"] == {"velocity": 2.0, "effort": 20.0}
    assert module.metadata["dry_friction"] == {"elbow": 0.1}
    shapes = values(model, "bodies")["forearm"]["display"]
    assert shapes == [{"shape": "mesh", "file": "package://arm/meshes/forearm.stl", "at": [0.12, 0.0, 0.0]}]
    model.save(tmp_path / "arm.yaml")
    text = (tmp_path / "arm.yaml").read_text()
    assert text.startswith("# ")
    assert list(Draft202012Validator(model_schema()).iter_errors(Document(text, "arm.yaml").value)) == []
    again = eg.load(tmp_path / "arm.yaml")
    for section in ("bodies", "joints", "forces"):
        kept = {n: {k: v for k, v in d.items() if (k, v) != ("axis", "z")} for n, d in values(model, section).items()}
        assert values(again, section) == kept


def test_the_generated_package_knows_the_limits(tmp_path: Path) -> None:
    assert run("generate", ARM, "--out", tmp_path, "--target", "numpy").returncode == 0
    data = json.loads((tmp_path / "arm" / "model.json").read_text())
    assert data["limits"]["left"] == {"lower": 0.0, "upper": 0.04, "velocity": 0.2, "effort": 15.0}


def test_welded_links_are_one_body() -> None:
    forearm = values(eg.load(ARM), "bodies")["forearm"]
    assert forearm["mass"] == 0.7
    assert forearm["com"][0] == pytest.approx((0.5 * 0.12 + 0.2 * 0.27) / 0.7)
    steiner = 0.5 * (0.12 - 0.114 / 0.7) ** 2 + 0.2 * (0.27 - 0.114 / 0.7) ** 2
    assert forearm["inertia"]["zz"] == pytest.approx(0.0025 + 0.0001 + steiner)
    assert forearm["markers"]["tip"]["at"] == [0.35, 0, 0]


def test_locked_joints_are_welds_at_their_value() -> None:
    locked = values(eg.load(ARM, lock={"elbow": 0.5, "left": 0.01}), "joints")
    assert set(locked) == {"yaw", "shoulder", "right"}
    at = locked["right"]["between"][0]
    assert at["body"] == "upper_arm"
    assert at["at"] == pytest.approx([0.3 + 0.29 * np.cos(0.5), 0, -0.29 * np.sin(0.5)])


def test_mimics_are_told() -> None:
    (note,) = [n for n in eg.load(ARM, mimic="independent").notes if "mimic" in n]
    assert "right = 1 left + 0" in note
    module = eg.load(ARM).compile(target="numpy")  # they are tied unless asked otherwise
    assert module.n_dof == 4
    x = module.x0(left=0.02, left_dot=0.1)
    state = dict(zip(module.x_names, x, strict=True))
    assert state["right"] == pytest.approx(0.02)
    assert state["right_dot"] == pytest.approx(0.1)


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
    (tmp_path / "names.urdf").write_text(text, encoding="utf-8")
    model = eg.load(tmp_path / "names.urdf", actuate=True)
    made = model.mechanism()
    assert made.name == "sys_model"
    assert [j.name for j in made.joints] == ["j_1", "j_1_2", "sin_", "lambda_", "j_1_dot_2", "t_"]
    assert [b.name for b in made.bodies][:4] == ["a_b", "a_b_2", "a_b_3", "ground_2"]
    assert len(made.bodies[4].name) <= 64
    assert model.renamed["joints"] == dict(zip(["j-1", *joints[1:]], [j.name for j in made.joints], strict=True))
    model.save(tmp_path / "names.yaml")
    assert [j.name for j in eg.load(tmp_path / "names.yaml").mechanism().joints] == [j.name for j in made.joints]


@pytest.mark.parametrize(
    "rpy", [(0.3, np.pi / 2, 1.1), (1, 1.5707, 2), (-3, -1.5708, 0.1), (0.2, 0.5, -2.9), (0, 0, 0)]
)
def test_roll_pitch_yaw_is_good_to_rounding_at_any_pitch(rpy: tuple[float, float, float]) -> None:
    R = placed((0, 0, 0), rpy, 0.0).rotation
    assert np.abs(placed((0, 0, 0), roll_pitch_yaw(R), 0.0).rotation - R).max() < 1e-15


def test_turns_about_axes_are_rotations() -> None:
    axis = np.array([1.0, 2.0, -0.5]) / np.linalg.norm([1, 2, -0.5])
    R = about(axis, 0.7)
    assert np.abs(R @ R.T - np.eye(3)).max() < 1e-15
    assert np.abs(R @ axis - axis).max() < 1e-15
    assert np.trace(R) == pytest.approx(1 + 2 * np.cos(0.7))


def run(*words: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-m", "eomgen", *map(str, words)], capture_output=True, text=True)


def test_convert_writes_a_model_file_that_runs(tmp_path: Path) -> None:
    out = tmp_path / "arm.yaml"
    result = run("convert", ARM, "--floating", "--lock", "left", "--lock", "right=0.01", "--out", out)
    assert result.returncode == 0, result.stderr
    assert run("check", out).returncode == 0
    assert eg.load(out).check().coordinates == [*(f"base_{k}" for k in "xyz123"), "yaw", "shoulder", "elbow"]
    printed = run("convert", ARM)
    assert "note: " in printed.stderr
    assert printed.stdout.startswith("# ")


def test_python_and_model_files_know_the_data(tmp_path: Path) -> None:
    m = eg.Model("drive", gravity=(0, 0, 0))
    J = m.parameter("J", 0.2)
    rotor = m.body("rotor", mass=1, inertia=(1, 1, 0.5), display=[{"shape": "sphere", "radius": 0.1}])
    m.revolute("a", m.ground, rotor, limits={"lower": -1, "effort": 3}, dry_friction=0.1, armature=J)
    ball = m.body("ball", mass=2, inertia=(1, 1, 1))
    m.joint("planar", "b", rotor, ball, limits={"lower": [-1, -2, None], "upper": [1, 2, 3]})
    for model in (m, eg.load(save(m, tmp_path))):
        module = model.compile(target="numpy", kernels=["mass_matrix", "energy"])
        assert module.limits["a"] == {"lower": -1.0, "effort": 3.0}
        assert module.limits["b_3"] == {"upper": 3.0}
        assert module.mass_matrix(np.zeros(4))[0, 0] == pytest.approx(1.7)
        assert module.energy([0, 0, 0, 0, 2, 0, 0, 0])[0] == pytest.approx(0.5 * 1.7 * 4)


def save(model: Any, folder: Path) -> Path:
    model.save(folder / "model.yaml")
    return folder / "model.yaml"


@pytest.mark.parametrize(
    ("data", "said"),
    [
        ("limits: {lower: 2, upper: 1}", "joints.a.limits: lower 2 is above upper 1"),
        ("limits: {lower: [1, 2]}", "joints.a.limits.lower: 2 values for 1 coordinates"),
        ("limits: {effort: -1}", "joints.a.limits.effort: is -1"),
        ("limits: {torque: 1}", "joints.a.limits.torque: unknown key"),
        ("limits: 3", "joints.a.limits: 3 is not a mapping of lower, upper"),
        ("dry_friction: -1", "joints.a.dry_friction: is -1"),
        ("armature: -1", "joints.a.armature: is -1"),
    ],
)
def test_wrong_data_is_told(data: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_text(
        f"name: m\nbodies: {{r: {{mass: 1, inertia: [1, 1, 1]}}}}\n"
        f"joints: {{a: {{type: revolute, between: [ground, r], {data}}}}}"
    )
    with pytest.raises(eg.ModelError, match=said.replace("[", r"\[")):
        eg.load(path).mechanism()


def test_wrong_shapes_are_told(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_text(
        "name: m\nbodies: {r: {mass: 1, display: [{shape: cone}, 3, {size: [1, 2]}]}}\n"
        "joints: {a: {type: free, between: [ground, r]}}"
    )
    with pytest.raises(eg.ModelError) as caught:
        eg.load(path).mechanism()
    assert [p.path for p in caught.value.problems] == [
        "bodies.r.display[0].shape",
        "bodies.r.display[1]",
        "bodies.r.display[2].shape",
        "bodies.r.display[2].size",
    ]


def test_the_drive_of_a_cut_joint_counts(tmp_path: Path) -> None:
    """A four-bar with a rotor on the joint that is cut, against the same rotor where the joint stays in the tree."""
    text = (Path(__file__).parents[2] / "examples" / "four_bar.yaml").read_text()
    model = eg.load(ARM.parent / "four_bar.yaml")
    joints = values(model, "joints")
    cut = model.check().loop_joints[0]
    kept = next(name for name in joints if name != cut)
    assert cut in text
    found = []
    for independent in (None, [values_coordinate(joints, cut)]):
        joints[cut]["armature"] = 0.3
        module = model.compile(target="numpy", independent=independent)
        x = module.x0()
        rates = module.rhs(0.0, x)
        names = [name for name in module.v_names if name in (f"{values_coordinate(joints, kept)}_dot",)]
        found.append(rates[module.n_q + module.v_names.index(names[0])])
    assert found[0] == pytest.approx(found[1], rel=1e-9)


def values_coordinate(joints: dict[str, Any], name: str) -> str:
    return str(joints[name].get("coordinate", name))


def test_dry_friction_acts_where_it_is_asked_for() -> None:
    q, v = np.array([0.1, 0.2, -0.3, 0.01, 0.02]), np.array([1.0, -2.0, 0.015, 0.1, 0.0])
    modules = [
        eg.load(ARM, **friction).compile(target="numpy", kernels=["bias"])
        for friction in ({}, {"friction": True}, {"friction": 0.05})
    ]
    elbow = modules[0].q_names.index("elbow")
    without, hard, soft = (module.bias(0.0, np.concatenate([q, v])) for module in modules)
    for found, smoothing in ((hard, 0.01), (soft, 0.05)):
        added = found - without
        assert added[elbow] == pytest.approx(0.1 * np.tanh(v[elbow] / smoothing), rel=1e-12)
        assert not np.delete(added, elbow).any()
    forces = values(eg.load(ARM, friction=0.05), "forces")
    assert [n for n, d in forces.items() if "coulomb" in d] == ["elbow_friction"]


@pytest.mark.parametrize("friction", [-1, "much", float("nan")])
def test_friction_is_a_velocity(friction: Any) -> None:
    with pytest.raises(eg.UsageError, match="friction must be True, or the velocity"):
        eg.load(ARM, friction=friction)


TIED = """
<mujoco model="tied">
  <worldbody>
    {bodies}
  </worldbody>
  <tendon><fixed name="sum"><joint joint="a" coef="2"/><joint joint="b" coef="-1"/></fixed></tendon>
  <equality>
    <joint name="bent" joint1="a" joint2="b" polycoef="0.1 0.5 0.25 0 0"/>
    <tendon name="held" tendon1="sum" polycoef="0.3"/>
    <joint name="straight" joint1="c" joint2="b" polycoef="0 -2 0 0 0"/>
  </equality>
</mujoco>
"""
TIED_BODY = '<body><joint name="{0}" ref="{1}"/><geom type="box" size="0.1 0.2 0.3" pos="0.2 0 0"/></body>'


def test_equalities_of_joints_and_tendons_become_couplings(tmp_path: Path) -> None:
    path = tmp_path / "tied.xml"
    bodies = [TIED_BODY.format(name, ref) for name, ref in (("a", 90), ("b", 0), ("c", 0))]
    path.write_text(TIED.format(bodies="".join(bodies)))
    quarter = np.pi / 2
    found = values(eg.load(path), "constraints")
    assert found["held"] == {"type": "coupling", "coordinates": {"a": 2.0, "b": -1.0}, "offset": 0.3 + np.pi}
    assert found["straight"] == {"type": "coupling", "coordinates": {"c": 1.0, "b": 2.0}}
    assert "b" in found["bent"]["equation"]
    locked = values(eg.load(path, lock={"b": 0.2}), "constraints")
    assert locked["bent"]["coordinates"] == {"a": 1.0}
    assert locked["bent"]["offset"] == pytest.approx(quarter + 0.1 + 0.5 * 0.2 + 0.25 * 0.2**2)
    model = eg.load(path, lock=["a", "b", "c"][1:])
    assert [n for n in model.notes if "straight" in n] == [
        "left out: the coupling straight, all of whose joints are locked"
    ]


PLANAR = """<robot name="plate"><link name="w"/>
<link name="b"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>
<joint name="j" type="{0}"><parent link="w"/><child link="b"/><axis xyz="0 0 1"/>
<dynamics damping="0.1" friction="0.2"/><mimic joint="j"/></joint></robot>"""


@pytest.mark.parametrize("given", ["planar", "floating"])
def test_dynamics_of_joints_of_several_degrees_are_left_out_with_a_note(given: str, tmp_path: Path) -> None:
    path = tmp_path / "plate.urdf"
    path.write_text(PLANAR.format(given))
    model = eg.load(path, friction=True, mimic="coupling")
    assert [f"left out: <{tag}> of the {given} joint j" for tag in ("dynamics", "mimic")] == list(model.notes)
    assert model.check().degrees_of_freedom == (3 if given == "planar" else 6)
