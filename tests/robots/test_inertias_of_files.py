"""Inertias of robot files: rounding passes, a slip of the pen does not, and robots without mass move.

Published robots are held against Pinocchio; faults of inertia are made by hand.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from robots.comparison import Evaluated, largest_differences
from robots.pinocchio_judge import Judge
from robots.shipped import EXAMPLES, urdf_robots

import eomgen as eg
from eomgen.numeric.rigid_inertia import COMPUTED, fault_of_inertia, inertia_scales, longest_within

LINK = """<link name="{name}"><inertial><origin xyz="{com}"/><mass value="{mass}"/>
<inertia ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
ARM = """<robot name="arm"><link name="base"/>{links}
<joint name="a" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
  <limit lower="-1" upper="1" velocity="2" effort="30"/></joint>
<joint name="b" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0.3 0 0"/><axis xyz="0 1 0"/>
  <dynamics damping="0.5"/></joint></robot>"""
SOUND = {"mass": 0.7, "com": "0.1 0 0", "xx": "1e-3", "yy": "2e-3", "zz": "2e-3"}


def write(folder: Path, upper: dict[str, Any], lower: dict[str, Any] | None = None) -> Path:
    links = [LINK.format(name="upper", **SOUND | upper), LINK.format(name="lower", **SOUND | (lower or {}))]
    path = folder / "arm.urdf"
    path.write_text(ARM.format(links="\n".join(links)))
    return path


def test_icub_moves_as_in_pinocchio() -> None:
    """Its links have moments such as -5e-20 about axes of 0.7 kg bodies."""
    path, _ = urdf_robots()["icub"]
    model = eg.load(path, floating=True, rotation="euler_parameters", actuate=True)
    equations = model.derive("recursive")
    states = Judge(path, True, model).states(equations.kinematics, 5, seed=1)
    assert max(largest_differences(model, Evaluated(equations), states).values()) <= 1e-9


ROUNDING = [
    {"xx": "-5e-20", "yy": "1e-20", "zz": "3e-20"},  # iCub's
    {"xx": "-5e-20", "yy": "2e-3", "zz": "2e-3"},
    {"mass": 0, "xx": "-5e-20", "yy": "1e-20", "zz": "3e-20"},
    {"xx": "1e-21", "yy": "3e-21", "zz": "9e-21"},
    {"com": "0 0 0", "xx": "-1e-18", "yy": "1e-18", "zz": "0"},
]
SLIPS = [
    ({"xx": "-1e-3"}, "negative principal moment"),
    ({"xx": "-1e-8"}, "negative principal moment"),  # 1e-6 of m l^2: far above its rounding
    ({"zz": "4e-3"}, "exceeds the sum"),
    ({"xx": "1e-9", "yy": "2e-9", "zz": "9e-9"}, "exceeds the sum"),
    ({"mass": 0, "xx": "-1e-9", "yy": "1e-9", "zz": "1e-9"}, "negative principal moment"),
]


@pytest.mark.parametrize("given", ROUNDING, ids=str)
def test_what_rounding_leaves_passes(given: dict[str, Any], tmp_path: Path) -> None:
    model = eg.load(write(tmp_path, given))
    module = model.compile(target="numpy", kernels=["mass_matrix", "rhs"])
    x = np.array([0.3, -0.5, 1.0, 2.0])
    clean = eg.load(write(tmp_path, given | dict.fromkeys(("xx", "yy", "zz"), "0")))
    other = clean.compile(target="numpy", kernels=["mass_matrix", "rhs"])
    np.testing.assert_allclose(module.rhs(0.0, x), other.rhs(0.0, x), rtol=1e-12) if given.get("yy") != "2e-3" else None
    assert np.linalg.eigvalsh(module.mass_matrix(x[:2]))[0] > 0


@pytest.mark.parametrize(("given", "said"), SLIPS, ids=str)
def test_a_slip_of_the_pen_is_told(given: dict[str, Any], said: str, tmp_path: Path) -> None:
    path = write(tmp_path, given)
    if said == "exceeds the sum":  # taken by default, as other loaders do, and told
        taken = eg.load(path)
        assert any("bodies.upper.inertia" in note and said in note for note in taken.notes)
        taken.mechanism()
    else:
        with pytest.raises(eg.ModelError, match=said):
            eg.load(path).mechanism()
    with pytest.raises(eg.ModelError, match=said) as caught:
        eg.load(path, check_inertia="error").mechanism()
    (problem,) = caught.value.problems
    assert "check_inertia" in problem.remedy
    noted = eg.load(path, check_inertia="note")
    assert any("bodies.upper.inertia" in note and said in note for note in noted.notes)
    assert noted.mechanism().check_inertia == "note"
    silent = eg.load(path, check_inertia="off", limits="off")
    assert silent.notes == ()
    silent.mechanism()
    noted.save(tmp_path / "arm.yaml")
    again = eg.load(tmp_path / "arm.yaml")  # a model file keeps the word and says it again
    assert any(said in note for note in again.notes)
    assert eg.load(tmp_path / "arm.yaml", check_inertia="off").notes == ()
    with pytest.raises(eg.ModelError, match=said):
        eg.load(tmp_path / "arm.yaml", check_inertia="error").mechanism()


def test_the_measure_is_m_l_squared() -> None:
    thin = np.diag([-5e-20, 1e-20, 3e-20])
    assert fault_of_inertia(thin) is not None  # by its own size alone
    (scale,) = inertia_scales([0.7], [thin], 0.05)
    assert scale == pytest.approx(0.7 * 0.05**2)
    assert fault_of_inertia(thin, scale=scale) is None
    edge = COMPUTED * scale
    assert fault_of_inertia(np.diag([-0.9 * edge, edge, edge]), scale=scale) is None
    assert fault_of_inertia(np.diag([-1.1 * edge, edge, edge]), scale=scale) is not None
    # without mass, the heaviest body's; without any mass, the largest moment; without lengths, radii of gyration
    assert inertia_scales([0.0, 3.0], [thin, thin], 2.0) == [12.0, 12.0]
    assert inertia_scales([0.0, 0.0], [thin, np.eye(3)], 2.0) == [1.0, 1.0]
    assert inertia_scales([2.0, 1.0], [np.eye(3), thin], 0.0) == [pytest.approx(3.0), pytest.approx(1.5)]


def test_where_a_body_frame_lies_does_not_matter() -> None:
    """A moment of -1e-3 kg m^2 is no rounding of 1 kg over 0.5 m, and -1e-15 is; about a far point it may be."""
    for far in (0.0, 1e4, 1e6):
        for moment, wrong in ((-1e-3, True), (-1e-15, False)):
            m = eg.Model("far")
            b = m.body("b", mass=1.0, com=(far + 0.5, 0, 0), inertia=(moment, 1e-8, 1e-8))
            m.revolute("a", m.ground, b.at(far, 0, 0), coordinate="th")
            if wrong:
                with pytest.raises(eg.ModelError, match="negative principal moment"):
                    m.mechanism()
            else:
                m.mechanism()


@pytest.mark.parametrize("free", [False, True])
def test_a_point_mass_with_its_inertia_about_the_origin_passes(free: bool) -> None:
    """What is left about the centre of mass is rounding of m d^2, positive or negative."""
    rng = np.random.default_rng(0)
    for d in rng.normal(size=(20, 3)):
        m, mass = eg.Model("point"), float(rng.uniform(0.1, 5.0))
        b = m.body("b", mass=mass, com=tuple(d), inertia=(mass * ((d @ d) * np.eye(3) - np.outer(d, d))).tolist(),
                   about="origin")  # fmt: skip
        m.free("F", m.ground, b) if free else m.revolute("F", m.ground, b.at(*d))
        m.mechanism()


def test_distances_within_bodies() -> None:
    far = np.array([1e6, 0.0, 0.0])
    bodies = [[(0.0, 0.0, 0.0), (0.3, 0.4, 0.0)], [(1.0, 0.0, 0.0)], []]
    assert longest_within(bodies) == pytest.approx(0.5)
    assert longest_within([np.array(own).reshape(-1, 3) + far for own in bodies]) == pytest.approx(0.5, rel=1e-9)
    assert longest_within([[far, far + 1e-9]]) == 0.0  # rounding of the places


def test_a_link_far_from_its_joints_frame_is_judged_by_its_own_lengths(tmp_path: Path) -> None:
    """Beside another fault the links are judged one by one: a long tower before the arm changes nothing."""
    path = write(tmp_path, {"xx": "-1e-3"})
    text = path.read_text().replace('<child link="upper"/>', '<child link="upper"/><origin xyz="1e6 0 0"/>')
    for joint in ("", '<joint name="c" type="hinge"><parent link="lower"/><child link="none"/></joint>'):
        path.write_text(text.replace("</robot>", f"{joint}</robot>"))
        with pytest.raises(eg.ModelError, match="negative principal moment"):
            eg.load(path).mechanism()


def test_units_do_not_matter(tmp_path: Path) -> None:
    """The same slip and the same rounding in millimetres and tonnes."""
    for factor in (1.0, 1e-3):  # kg m^2 -> t m^2
        for moment, wrong in ((-1e-8, True), (-5e-20, False)):
            m = eg.Model("units")
            b = m.body("b", mass=0.7 * factor, com=(0.1, 0, 0), inertia=(moment * factor, 1e-8 * factor, 1e-8 * factor))
            m.revolute("a", m.ground, b, axis="z")
            if wrong:
                with pytest.raises(eg.ModelError, match="negative principal moment"):
                    m.mechanism()
            else:
                m.mechanism()


# -- robots without mass ---------------------------------------------------------------------------------------------
def same_motion(module: Any, path: Path, model: Any) -> None:
    """Poses and their velocities against Pinocchio's frames and frame Jacobians."""
    judge = pin.buildModelFromUrdf(str(path))
    data = judge.createData()
    random = np.random.default_rng(5)
    renamed = model.renamed.get("joints", {})
    order = [renamed.get(n, n) for n in list(judge.names)[1:]]
    links = {model.renamed.get("bodies", {}).get(f.name, f.name): k for k, f in enumerate(judge.frames)}
    for _ in range(3):
        q, v = random.uniform(-1, 1, (2, module.n_q))
        theirs = np.array([q[module.q_names.index(name)] for name in order])
        pin.framesForwardKinematics(judge, data, theirs)
        pin.computeJointJacobians(judge, data, theirs)
        poses = module.poses(q)
        rates = (module.poses(q + 1e-6 * v) - module.poses(q - 1e-6 * v)) / 2e-6
        found = 0
        for name, pose, rate in zip(module.body_names, poses, rates, strict=True):
            if name not in links:
                continue
            found += 1
            np.testing.assert_allclose(pose, data.oMf[links[name]].homogeneous, atol=1e-12)
            J = pin.getFrameJacobian(judge, data, links[name], pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
            speed = J @ np.array([v[module.q_names.index(n)] for n in order])
            np.testing.assert_allclose(rate[:3, 3], speed[:3], atol=1e-8)
        assert found > 10


def test_romeo_whose_fingers_have_no_mass_moves() -> None:
    path = EXAMPLES / "romeo_description/urdf/romeo.urdf"
    with pytest.raises(eg.ModelError, match="check_inertia='note'"):
        eg.load(path)
    model = eg.load(path, check_inertia="note")
    assert any("kinematics only" in note and "LFinger12" in note for note in model.notes)
    module = model.compile(target="numpy", kernels=["rhs", "poses", "embedded_mass_matrix", "jacobian"])
    same_motion(module, path, model)
    x = np.zeros(module.n_x)
    for call in (module.rhs, module.jacobian):
        with pytest.raises(eg.SingularMassMatrixError, match=r"kinematics only: .*bodies without mass .*LFinger11Link"):
            call(0.0, x)


def test_a_robot_without_any_mass_loads_by_itself(tmp_path: Path) -> None:
    text = (EXAMPLES / "ur_description/urdf/ur5_robot.urdf").read_text()
    import re

    bare = re.sub(r"<inertial>.*?</inertial>", "", text, flags=re.DOTALL)
    path = tmp_path / "ur5.urdf"
    path.write_text(bare)
    model = eg.load(path, actuate=True)
    assert any("kinematics only: no moving link has mass" in note for note in model.notes)
    module = model.compile(target="numpy")
    whole = eg.load(EXAMPLES / "ur_description/urdf/ur5_robot.urdf").compile(target="numpy", kernels=["poses"])
    q = np.random.default_rng(0).uniform(-1, 1, module.n_q)
    np.testing.assert_array_equal(module.poses(q), whole.poses(q))
    run = module.kinematic_analysis(**{module.q_names[1]: np.linspace(0, 1, 5)})
    assert np.isfinite(run.poses()).all()
    assert module.kinematics(q)[0].shape == (module.n_q,)
    with pytest.raises(eg.SingularMassMatrixError, match="kinematics only"):
        module.simulate(0.1)
    with pytest.raises(eg.SingularMassMatrixError, match="kinematics only"):
        module.linearize()


def test_options_are_checked(tmp_path: Path) -> None:
    path = write(tmp_path, {})
    with pytest.raises(eg.UsageError, match="check_inertia must be one of error, note, off"):
        eg.load(path, check_inertia="maybe")
    with pytest.raises(eg.UsageError, match="limits must be one of note, stop, off, not 'hard'"):
        eg.load(path, limits="hard")
    eg.load(path).save(tmp_path / "arm.yaml")
    with pytest.raises(eg.UsageError, match="check_inertia must be one of error"):
        eg.load(tmp_path / "arm.yaml", check_inertia="maybe")
    (tmp_path / "bad.yaml").write_text("check_inertia: maybe\n" + (tmp_path / "arm.yaml").read_text())
    with pytest.raises(eg.ModelError, match=r"bad.yaml:1: check_inertia: 'maybe' is not true or false, error, note"):
        eg.load(tmp_path / "bad.yaml").mechanism()


def test_from_the_command_line(tmp_path: Path) -> None:
    path = write(tmp_path, {"xx": "-1e-3"})

    def check(*words: str) -> Any:
        command = [sys.executable, "-m", "eomgen", "check", str(path), *words]
        return subprocess.run(command, capture_output=True, text=True)

    assert check().returncode == 1
    noted = check("--check-inertia", "note", "--limits", "off")
    assert noted.returncode == 0
    assert "negative principal moment" in noted.stderr
    assert "limits" not in noted.stderr
    assert check("--check-inertia", "off", "--limits", "off").stderr == ""


def test_negative_masses_and_locks_that_are_no_numbers(tmp_path: Path) -> None:
    path = write(tmp_path, {})
    for value in (float("nan"), "x"):
        with pytest.raises(eg.UsageError, match="lock.*number"):
            eg.load(path, lock={"j": value})
    text = path.read_text()
    path.write_text(re.sub(r'<mass value="[^"]*"', '<mass value="-0.7"', text))
    with pytest.raises(eg.ModelError, match="is -0.7; give a mass of 0 or more, or accept it with check_inertia: note"):
        eg.load(path)
    assert any("mass: is -0.7; it is used as given" in note for note in eg.load(path, check_inertia="note").notes)
    assert not any("mass" in note for note in eg.load(path, check_inertia="off").notes)
