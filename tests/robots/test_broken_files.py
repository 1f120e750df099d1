"""Robot files that are wrong or hostile: one clear error with the line, exit code 1, nothing expanded, nothing read."""

from __future__ import annotations

import builtins
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eomgen as eg
from eomgen.cli import main
from eomgen.limits.files import COPIES
from eomgen.robots import xml_text
from eomgen.robots.mjcf_files import Scan
from eomgen.robots.xml_text import read_xml

ARM = """<robot name="arm">
  <link name="base"/>
  <link name="upper"><inertial><origin xyz="0 0 0.2"/><mass value="2"/>
    <inertia ixx="0.1" iyy="0.1" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="tip"><inertial><mass value="0.5"/></inertial></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" velocity="2" effort="30"/></joint>
  <joint name="slide" type="prismatic"><parent link="upper"/><child link="tip"/><origin xyz="0 0 0.4"/>
    <axis xyz="0 0 1"/></joint>
</robot>
"""
BOMB = """<?xml version="1.0"?>
<!DOCTYPE robot [
  <!ENTITY a "aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa">
  <!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">
  <!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;&b;&b;">
]>
"""
OUTSIDE = '<!DOCTYPE robot [<!ENTITY secret SYSTEM "file://{secret}">]>\n'

#: What was changed in the arm, and what the error must say.
BROKEN = {
    "two roots": (
        '<link name="base"/>',
        '<link name="base"/>\n<link name="lost"/>',
        r"arm.urdf:3: link.lost: has no parent",
    ),
    "missing link": (
        '<child link="tip"/>',
        '<child link="tp"/>',
        r"urdf:8: joint.slide.child: no link 'tp'; did you mean 'tip'",
    ),
    "no child": ('<child link="tip"/>', "", r"urdf:8: joint.slide.child: is missing"),
    "unknown joint": (
        'type="prismatic"',
        'type="sliding"',
        r"urdf:8: joint.slide.type: no joint of type 'sliding'; types: rev",
    ),
    "massless leaf": (
        '<mass value="0.5"/>',
        '<mass value="0"/>',
        r"urdf:8: joint.slide: the joint moves no mass: link 'tip'",
    ),
    "negative mass": ('value="2"', 'value="-2"', r"urdf:3: link.upper.inertial.mass: is -2"),
    "not finite": ('value="2"', 'value="nan"', r"urdf:3: link.upper.inertial.mass.value: 'nan' is not finite"),
    "infinite": ('xyz="0 0 0.4"', 'xyz="0 0 1e999"', r"urdf:8: joint.slide.origin.xyz: '1e999' is not"),
    "no number": ('ixx="0.1"', 'ixx="a lot"', r"urdf:4: link.upper.inertial.inertia.ixx: 'a lot' is not a number"),
    "impossible": ('ixx="0.1"', 'ixx="-9"', r"urdf:3: bodies.upper.inertia: has a negative principal moment"),
    "two numbers": ('xyz="0 0 0.4"', 'xyz="0 0.4"', r"urdf:8: joint.slide.origin.xyz: '0 0.4' is not three numbers"),
    "no axis": ('<axis xyz="0 1 0"/>', '<axis xyz="0 0 0"/>', r"urdf:6: joint.shoulder.axis: the axis has no length"),
    "twice": ('name="tip"', 'name="upper"', r"urdf:5: link.upper: the name is given twice, first in line 3"),
    "ring": ('<parent link="base"/>', '<parent link="tip"/>', r"'base'|ring"),
    "no root": ('<link name="base"/>', "", r"^[^\n]*urdf:6: joint.shoulder.parent: no link 'base'; links: upper, tip$"),
    "two parents": (
        '<parent link="upper"/><child link="tip"/>',
        '<parent link="base"/><child link="upper"/>',
        r"also the child of .*<loop_joint",
    ),
    "no end": ("</robot>", "", r"urdf:11: file: not XML: no element found"),
    "xacro": ('<link name="base"/>', '<xacro:include filename="a"/>', r"is a xacro file; expand it first"),
    "bomb": ('<robot name="arm">', BOMB + '<robot name="&c;">', r"urdf:2: file: declares a document type or an entity"),
    "other": ("robot", "machine", r"urdf:1: machine: is not a robot"),
}


def exit_code(*words: object) -> object:
    with pytest.raises(SystemExit) as left:
        main([str(word) for word in words])
    return left.value.code


@pytest.fixture
def arm(tmp_path: Path) -> Any:
    def write(old: str = "", new: str = "", name: str = "arm.urdf") -> Path:
        assert old in ARM
        path = tmp_path / name
        path.write_text(ARM.replace(old, new) if old else ARM)
        return path

    return write


def test_the_arm_is_fine(arm: Any) -> None:
    assert eg.load(arm()).check().coordinates == ["shoulder", "slide"]


@pytest.mark.parametrize("fault", BROKEN)
def test_fault_is_told_with_its_line(fault: str, arm: Any, capsys: pytest.CaptureFixture[str]) -> None:
    old, new, said = BROKEN[fault]
    path = arm(old, new)
    with pytest.raises(eg.ModelError, match=said):
        eg.load(path).check()
    assert exit_code("check", path) == 1
    assert str(path) in capsys.readouterr().err


def test_all_faults_are_told_at_once(arm: Any) -> None:
    path = arm('value="2"', 'value="nan"')
    path.write_text(path.read_text().replace("prismatic", "sliding").replace('"0.5"', '"-1"'))
    with pytest.raises(eg.ModelError) as caught:
        eg.load(path)
    assert [p.line for p in caught.value.problems] == [3, 5, 8]


def test_inertias_and_scales_are_told_with_the_rest(arm: Any) -> None:
    shapes = '<visual><geometry><mesh filename="a.stl" scale="1 0 1"/></geometry></visual>'
    path = arm('ixx="0.1" iyy="0.1" izz="0.01"', 'ixx="0.1" iyy="0.1" izz="0.9"')
    path.write_text(
        path.read_text()
        .replace("prismatic", "sliding")
        .replace('mass value="0.5"/></inertial>', f'mass value="-1"/></inertial>{shapes}')
    )
    with pytest.raises(eg.ModelError) as caught:
        eg.load(path, check_inertia="error")
    assert [(p.line, p.path) for p in caught.value.problems] == [
        (3, "link.upper.inertial.inertia"),
        (5, "link.tip.inertial.mass"),
        (5, "link.tip.visual.mesh.scale"),
        (8, "joint.slide.type"),
    ]
    said = [p.message for p in caught.value.problems]
    assert "one exceeds the sum of the others" in said[0]
    assert said[2] == "a scale of 0 leaves nothing of the mesh"


def test_a_mirrored_mesh_leaves_a_note_and_is_written_as_it_is(arm: Any, tmp_path: Path) -> None:
    shape = '<visual><geometry><mesh filename="a.stl" scale="1 -1 1"/></geometry></visual>'
    m = eg.load(arm('<mass value="0.5"/></inertial>', f'<mass value="0.5"/></inertial>{shape}'))
    assert "link.tip.visual.mesh.scale: negative factors mirror the mesh" in m.notes
    m.check()
    m.save(tmp_path / "arm.yaml")
    eg.load(tmp_path / "arm.yaml").check()
    (tmp_path / "arm.yaml").write_text((tmp_path / "arm.yaml").read_text().replace("-1.0, 1.0]", "0.0, 1.0]"))
    with pytest.raises(eg.ModelError, match=r"bodies\.tip\.display\[0\]\.scale: a scale of 0 leaves nothing"):
        eg.load(tmp_path / "arm.yaml").check()


def test_drives_are_in_the_units_of_their_joints(arm: Any) -> None:
    """Without gravity: 3 N m on the shoulder alone, 2 N on the slide alone against Newton and Euler by hand."""
    module = eg.load(arm(), actuate=True, gravity=(0, 0, 0)).compile(target="numpy")
    units = dict(zip(module.u_names, (module.metadata["units"].get(n) for n in module.u_names), strict=True))
    assert units == {"tau_shoulder": "N*m", "tau_slide": "N"}
    x = np.zeros(4)
    moved = module.rhs(0.0, x, u=[3.0, 2.0])[2:]
    about_shoulder = 0.1 + 2 * 0.2**2 + 0.5 * 0.4**2
    np.testing.assert_allclose(moved, [3 / about_shoulder, 2 / 0.5], rtol=1e-12)


@pytest.mark.parametrize("suffix", [".urdf", ".xml"])
def test_no_entity_reads_a_file(suffix: str, arm: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    secret = tmp_path / "secret"
    secret.write_text("hidden")
    path = arm('<robot name="arm">', OUTSIDE.format(secret=secret) + '<robot name="arm">&secret;', f"arm{suffix}")
    opened: list[str] = []

    def noting(real: Callable[..., Any]) -> Callable[..., Any]:
        def open_noted(file: Any, *args: Any, **keys: Any) -> Any:
            opened.append(os.fspath(file) if not isinstance(file, int) else "")
            return real(file, *args, **keys)

        return open_noted

    for module in (builtins, os):
        monkeypatch.setattr(module, "open", noting(module.open))
    with pytest.raises(eg.ModelError, match="expands no entities") as caught:
        eg.load(path)
    assert "hidden" not in str(caught.value)
    assert str(secret) not in opened
    assert str(path) in opened


@pytest.mark.parametrize(
    "line",
    [
        '<asset><mesh name="m" file="{secret}"/></asset>',
        '<asset><mesh name="m" file="link/secret"/></asset>',
        '<include file="../secret"/>',
        '<compiler meshdir=".."/><asset><mesh name="m" file="secret"/></asset>',
        '<asset><model name="m" file="../secret"/></asset>',
    ],
)
def test_mujoco_reads_nothing_outside(line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def never(*_: Any, **__: Any) -> None:
        raise AssertionError("MuJoCo was asked to read the model")

    monkeypatch.setattr("subprocess.Popen", never)
    (tmp_path / "model").mkdir()
    (tmp_path / "secret").write_text("hidden")
    os.symlink(tmp_path, tmp_path / "model" / "link")
    path = tmp_path / "model" / "model.xml"
    path.write_text(f"<mujoco>\n{line.format(secret=tmp_path / 'secret')}\n</mujoco>")
    with pytest.raises(
        eg.ModelError, match=r"model.xml:2: .*is outside the folder .*, so it is not read; .*assets="
    ) as caught:
        eg.load(path)
    assert "hidden" not in str(caught.value)


def test_included_files_pass_the_same_parser(tmp_path: Path) -> None:
    (tmp_path / "part.xml").write_text(BOMB + "<mujocoinclude/>")
    path = tmp_path / "model.xml"
    path.write_text('<mujoco><include file="part.xml"/></mujoco>')
    with pytest.raises(eg.ModelError, match=r"part.xml:2: file: declares a document type"):
        eg.load(path)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (
            '<worldbody><replicate count="2000"><replicate count="2000"/></replicate></worldbody>',
            "makes too many bodies",
        ),
        (
            '<asset><texture name="a" builtin="flat" width="999999" height="9"/></asset>',
            "texture.width: 999999 is too large",
        ),
        ('<worldbody><body><joint type="screw"/></body></worldbody>', r"xml:2: mujoco: MuJoCo refuses it: .*'screw'"),
        ("<worldbody><body><joint/></body></worldbody>", r"xml:2: mujoco: MuJoCo refuses it: .*mass and inertia"),
        ('<worldbody><body name="a"/>', r"xml:3: file: not XML: mismatched tag"),
        ('<worldbody><geom size="1"/></worldbody>', "no link can move"),
    ],
)
def test_mjcf_faults(line: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "model.xml"
    path.write_text(f"<mujoco>\n{line}\n</mujoco>")
    with pytest.raises(eg.ModelError, match=said):
        eg.load(path)
    assert exit_code("check", path) == 1


PART = '<mujocoinclude><replicate count="150"><body><freejoint/><geom size="0.1"/></body></replicate></mujocoinclude>'
COPIED = {
    '<worldbody><replicate count="150"><include file="part.xml"/></replicate></worldbody>': 150 + 2 * 150 * 150,
    "<worldbody>" + 3 * '<replicate count="30"><body/></replicate>' + "</worldbody>": 3 * (30 + 30),
    '<worldbody><replicate count="150"><include file="part.xml"/></replicate></worldbody>'.replace("150", "1"): 301,
    '<worldbody><replicate count="40"><body/><replicate count="50"><body/></replicate></replicate></worldbody>': 4080,
    '<asset><model name="p" file="part.xml"/></asset><worldbody><replicate count="50"><frame>'
    '<attach model="p" body="b"/></frame></replicate></worldbody>': 50 + 300 + 50 * 300,
    "<worldbody>" + 400 * "<body/>" + "</worldbody>": 0,
}


@pytest.mark.parametrize(("line", "made"), COPIED.items())
def test_copies_add_up_over_siblings_and_multiply_by_nesting_also_through_includes(
    line: str, made: int, tmp_path: Path
) -> None:
    """Replications themselves and the bodies in them, counted by hand."""
    (tmp_path / "part.xml").write_text(PART)
    path = tmp_path / "model.xml"
    path.write_text(f"<mujoco>\n{line}\n</mujoco>")
    scan = Scan(read_xml(path), None)
    assert scan.made == made
    assert [p.message for p in scan.problems] == ["makes too many bodies"] * (made > COPIES)


def test_sibling_replications_of_moderate_size_load(tmp_path: Path) -> None:
    path = tmp_path / "model.xml"
    row = '<replicate count="30" offset="0 0 1"><geom size="0.1"/></replicate>'
    path.write_text(f'<mujoco><worldbody><body name="b"><joint/>{3 * row}</body></worldbody></mujoco>')
    mass = eg.load(path).mechanism().bodies[0].mass
    assert mass.value == pytest.approx(90 * 1000 * 4 / 3 * np.pi * 0.1**3)


def test_sizes_are_bounded(arm: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    path = arm()
    for name, value, said in (
        ("SIZE", 100, "is too large"),
        ("ELEMENTS", 10, "too many elements"),
        ("DEPTH", 3, "nested too deeply"),
        ("LONGEST", 3, "an attribute that is too long"),
    ):
        with monkeypatch.context() as patch:
            patch.setattr(xml_text, name, value)
            with pytest.raises(eg.ModelError, match=said):
                eg.load(path)


def test_deep_nesting_is_no_recursion(tmp_path: Path) -> None:
    path = tmp_path / "deep.urdf"
    path.write_text("<robot>" + "<a>" * 100_000)
    with pytest.raises(eg.ModelError, match="nested too deeply"):
        eg.load(path)


def test_options_are_checked(arm: Any, tmp_path: Path) -> None:
    with pytest.raises(eg.UsageError, match="no option 'floting' for a robot file; did you mean 'floating'"):
        eg.load(arm(), floting=True)
    with pytest.raises(eg.UsageError, match="mimic must be one of coupling, independent, not 'x'"):
        eg.load(arm(), mimic="x")
    with pytest.raises(eg.ModelError, match="lock.shulder: no such joint; did you mean 'shoulder'"):
        eg.load(arm(), lock=["shulder"])
    model = tmp_path / "model.yaml"
    eg.load(arm()).save(model)
    with pytest.raises(eg.UsageError, match="only robot files take the options floating"):
        eg.load(model, floating=True)
