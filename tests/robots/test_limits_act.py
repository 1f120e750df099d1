"""Limits of joints: a run that passes one says so, stops hold as MuJoCo's do, and silence where it is asked for."""

from __future__ import annotations

import warnings
from pathlib import Path

import mujoco
import numpy as np
import pytest

import eomgen as eg
from eomgen.simulation.passed_limits import LimitWarning

PENDULUM = """<robot name="swing"><link name="base"/>
<link name="rod"><inertial><origin xyz="0 0 -0.5"/><mass value="2"/>
  <inertia ixx="0.2" iyy="0.2" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="pin" type="revolute"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/>
  <limit lower="-0.5" upper="1.2" {more}/></joint></robot>"""


@pytest.fixture
def swing(tmp_path: Path) -> Path:
    path = tmp_path / "swing.urdf"
    path.write_text(PENDULUM.format(more=""))
    return path


def test_a_run_that_passes_a_limit_says_so(swing: Path) -> None:
    """When it passes: from energy, the pendulum let go at 1.2 rad is at -0.5 rad after the integral of d phi / phi'."""
    mod = eg.load(swing).compile(target="numpy")
    with pytest.warns(LimitWarning, match=r"pin lower -0.5 at t = .* \(to -1\.\d+\)") as told:
        run = mod.simulate(1.5, initial={"pin": 1.2}, t_eval=np.linspace(0, 1.5, 3001))
    assert told[0].filename == __file__
    inertia, weight = 0.2 + 2 * 0.25, 2 * 9.81 * 0.5
    phi = 1.2 - 1.7 * np.linspace(0, 1, 200_001)[1:] ** 2  # denser where it starts
    speed = np.sqrt(2 * weight / inertia * (np.cos(phi) - np.cos(1.2)))
    time = float(np.trapezoid(-np.gradient(phi) / speed))
    first = float(run.t[np.flatnonzero(run["pin"] < -0.5)[0]])
    assert f"at t = {first:.4g} s" in str(told[0].message)
    assert first == pytest.approx(time, abs=2e-3)


def test_within_the_limits_and_at_them_all_is_quiet(swing: Path) -> None:
    mod = eg.load(swing).compile(target="numpy")
    mod.simulate(1.5, initial={"pin": 0.49})  # warnings are errors in these tests
    model = eg.load(swing, limits="off")
    model.compile(target="numpy").simulate(1.5, initial={"pin": 1.2})
    again = eg.Model.from_description(model.description)
    assert again.to_yaml().count("limits: off") == 1


def test_speed_limits_too(tmp_path: Path) -> None:
    path = tmp_path / "swing.urdf"
    path.write_text(PENDULUM.format(more='velocity="1.5"'))
    with pytest.warns(LimitWarning, match=r"pin_dot velocity 1\.5 at t = .* \(to -[12]\.\d+\)"):
        eg.load(path).compile(target="numpy").simulate(1.0, initial={"pin": 0.49})


@pytest.mark.parametrize("more", ["", 'effort="40" velocity="3"'])
def test_stops_hold(more: str, tmp_path: Path) -> None:
    """Dropped onto its stop the rod stays there: within a hundredth of the range, as MuJoCo's with limits comes to."""
    path = tmp_path / "swing.urdf"
    path.write_text(PENDULUM.format(more=more).replace('lower="-0.5"', 'lower="0.3"'))
    model = eg.load(path, limits="stop")
    assert not any("limits" in note for note in model.notes)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run = model.compile().simulate(6.0, initial={"pin": 1.2}, t_eval=np.linspace(0, 6, 1201))
    assert run["pin"].min() > 0.3 - 0.05
    assert run["energy"][-1] < run["energy"][0]
    assert (np.diff(run["energy"]) < 1e-6).all()  # stops only take
    known = mujoco.MjModel.from_xml_string(path.read_text())
    data = mujoco.MjData(known)
    data.qpos[0] = 1.2
    while data.time < 6.0:
        mujoco.mj_step(known, data)
    assert run["pin"][-1] == pytest.approx(data.qpos[0], abs=0.01 * 0.9)


def test_a_joint_without_range_has_no_stops(tmp_path: Path) -> None:
    path = tmp_path / "swing.urdf"
    path.write_text(PENDULUM.format(more="").replace('lower="-0.5" upper="1.2"', 'lower="0" upper="0"'))
    model = eg.load(path, limits="stop")
    assert "pin gets no stops, because its limits leave it no range" in model.notes
    model.check()


def test_mimics_are_tied(tmp_path: Path) -> None:
    """A gripper: one degree of freedom, and the second finger follows by the file's law."""
    finger = """<link name="f{0}"><inertial><mass value="0.1"/>
      <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
    <joint name="j{0}" type="prismatic"><parent link="base"/><child link="f{0}"/><axis xyz="1 0 0"/>{1}</joint>"""
    law = '<mimic joint="ja" multiplier="-2" offset="0.05"/>'
    path = tmp_path / "gripper.urdf"
    path.write_text(f'<robot name="g"><link name="base"/>{finger.format("a", "")}{finger.format("b", law)}</robot>')
    tied, loose = eg.load(path), eg.load(path, mimic="independent")
    assert (tied.check().degrees_of_freedom, loose.check().degrees_of_freedom) == (1, 2)
    mod = tied.compile(target="numpy")
    x = dict(zip(mod.x_names, mod.x0(ja=0.1, ja_dot=1.0), strict=True))
    assert (x["jb"], x["jb_dot"]) == (pytest.approx(-0.15), pytest.approx(-2.0))


@pytest.mark.parametrize(
    ("word", "told"),
    [
        ("limits: stop", "limits: 'stop' is an option of robot files"),
        ("limits: stops", "limits: 'stops' is not known"),
        ("check_inertia: maybe", "check_inertia: 'maybe' is not true or false, error, note or off"),
    ],
)
def test_a_word_that_does_nothing_in_a_model_file_is_refused(word: str, told: str, tmp_path: Path) -> None:
    file = tmp_path / "rod.yaml"
    file.write_text(
        f"name: rod\n{word}\nbodies: {{rod: {{mass: 1, inertia: {{zz: 1}}}}}}\n"
        "joints: {A: {type: revolute, between: [ground, rod], limits: {lower: -1, upper: 1}}}\n"
    )
    with pytest.raises(eg.ModelError, match=told):
        eg.load(file).check()
