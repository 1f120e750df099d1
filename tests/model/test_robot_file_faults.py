"""Robot files that are wrong or hostile: an error with the line, nothing expanded, nothing outside read or run."""

import builtins
import ctypes
import os
import struct
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import command
import numpy as np
import pytest
from model_files import described, load
from refusals import refused, refuses

import eomgen as eg

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
SECRET = '<!DOCTYPE robot [<!ENTITY secret SYSTEM "file://{secret}">]>\n'
#: What is changed in the arm, and what the error must tell.
BROKEN = [
    ('<link name="base"/>', '<link name="base"/>\n<link name="lost"/>', "EG-TOPOLOGY arm.urdf:3: link.lost:"),
    ('<child link="tip"/>', '<child link="tp"/>', "EG-NAME-UNKNOWN arm.urdf:8: joint.slide.child: 'tp' 'tip'?"),
    ('<child link="tip"/>', "", "EG-MISSING arm.urdf:8: joint.slide.child:"),
    ("prismatic", "sliding", "EG-CHOICE arm.urdf:8: joint.slide.type: 'sliding' revolute"),
    ('mass value="0.5"', 'mass value="0"', "EG-NO-INERTIA arm.urdf:8: joint.slide: 'tip'"),
    ('value="2"', 'value="-2"', "EG-RANGE arm.urdf:3: link.upper.inertial.mass: -2"),
    ('value="2"', 'value="nan"', "EG-NUMBER arm.urdf:3: link.upper.inertial.mass.value: 'nan'"),
    ('ixx="0.1"', 'ixx="a lot"', "EG-NUMBER arm.urdf:4: link.upper.inertial.inertia.ixx: lot"),
    ('ixx="0.1"', 'ixx="-9"', "EG-INERTIA arm.urdf:3: bodies.upper.inertia: -9"),
    ('xyz="0 0 0.4"', 'xyz="0 0.4"', "EG-NUMBER arm.urdf:8: joint.slide.origin.xyz: 0.4"),
    ('<axis xyz="0 1 0"/>', '<axis xyz="0 0 0"/>', "EG-RANGE arm.urdf:6: joint.shoulder.axis:"),
    ('name="tip"', 'name="upper"', "EG-NAME-TAKEN arm.urdf:5: link.upper: 3"),
    ('<parent link="base"/>', '<parent link="tip"/>', "EG-TOPOLOGY arm.urdf:3: link.upper: 'base'"),
    ('<link name="base"/>', "", "EG-NAME-UNKNOWN arm.urdf:6: joint.shoulder.parent: 'base' upper tip"),
    ('upper"/><child link="tip"/>', 'base"/><child link="upper"/>', "EG-TOPOLOGY <loop_joint"),
    ("</robot>", "", "EG-FILE-DAMAGED arm.urdf:11: file:"),
    ('<link name="base"/>', '<xacro:include filename="a"/>', "EG-FILE arm.urdf:2: robot: xacro"),
    ('<robot name="arm">', BOMB + '<robot name="&c;">', "EG-REFUSED arm.urdf:2: file: <!DOCTYPE"),
    ("robot", "machine", "EG-FILE-DAMAGED arm.urdf:1: machine: <robot>"),
]


def arm(folder: Path, *changes: tuple[str, str], name: str = "arm.urdf") -> Path:
    text, path = ARM, folder / name
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path.write_text(text)
    return path


@pytest.mark.parametrize(("old", "new", "said"), BROKEN, ids=lambda text: text[:24])
def test_a_fault_is_reported_with_its_line(old: str, new: str, said: str, tmp_path: Path) -> None:
    path = arm(tmp_path, (old, new))
    with refused(said, eg.ModelError):
        eg.load(path).check()


def test_all_faults_are_reported_at_once(tmp_path: Path) -> None:
    shapes = '<visual><geometry><mesh filename="a.stl" scale="1 0 1"/></geometry></visual>'
    inertia = ('ixx="0.1" iyy="0.1" izz="0.01"', 'ixx="0.1" iyy="0.1" izz="0.9"')
    path = arm(tmp_path, ("prismatic", "sliding"), ('"0.5"/></inertial>', f'"-1"/></inertial>{shapes}'), inertia)
    with pytest.raises(eg.ModelError) as caught:
        eg.load(path, check_inertia="error")
    assert [(p.line, p.path) for p in caught.value.problems] == [
        (3, "link.upper.inertial.inertia"),
        (5, "link.tip.inertial.mass"),
        (5, "link.tip.visual.mesh.scale"),
        (8, "joint.slide.type"),
    ]
    found = command.run("check", path)
    assert (found.code, found.err.count(str(path)) >= 3) == (1, True)


def test_options_are_checked(tmp_path: Path) -> None:
    path = arm(tmp_path)
    for given, said in (
        ({"floting": True}, "EG-NAME-UNKNOWN 'floting' 'floating'?"),
        ({"mimic": "x"}, "EG-CHOICE mimic coupling independent 'x'"),
        ({"lock": 5}, "EG-TYPE lock 5"),
        ({"lock": {"shoulder": float("nan")}}, "EG-TYPE lock 'shoulder' nan"),
        ({"actuate": 5}, "EG-TYPE actuate True 5"),
        ({"snap": -1.0}, "EG-TYPE snap -1.0"),
        ({"assets": 5}, "EG-TYPE assets 5"),
        ({"floating": "yes"}, "EG-TYPE floating True False 'yes'"),
        ({"friction": -1}, "EG-TYPE friction True -1"),
        ({"check_inertia": "maybe"}, "EG-CHOICE check_inertia error note off 'maybe'"),
        ({"limits": "hard"}, "EG-CHOICE limits note stop off 'hard'"),
    ):
        with refused(said, eg.UsageError):
            eg.load(path, **given)
    for key in ("lock", "actuate"):
        refuses(f"EG-NAME-UNKNOWN {key}.shulder: 'shoulder'?", eg.load, path, **{key: ["shulder"]})
    eg.load(path).save(tmp_path / "model.yaml")
    refuses("EG-CONFLICT model.yaml floating", eg.load, tmp_path / "model.yaml", floating=True)


# -- nothing outside is read ------------------------------------------------------------------------------------------
@pytest.mark.parametrize("suffix", [".urdf", ".xml"])
def test_no_entity_reads_a_file(suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    secret = tmp_path / "secret"
    secret.write_text("hidden")
    begin = '<robot name="arm">'
    path = arm(tmp_path, (begin, f"{SECRET.format(secret=secret)}{begin}&secret;"), name=f"arm{suffix}")
    opened: list[str] = []

    def noting(real: Callable[..., Any]) -> Callable[..., Any]:
        def open_noted(file: Any, *args: Any, **keys: Any) -> Any:
            opened.append(os.fspath(file) if not isinstance(file, int) else "")
            return real(file, *args, **keys)

        return open_noted

    for module in (builtins, os):
        monkeypatch.setattr(module, "open", noting(module.open))
    with refused(f"EG-REFUSED {path.name}:1: <!DOCTYPE") as caught:
        eg.load(path)
    assert "hidden" not in str(caught.value)
    assert str(secret) not in opened
    assert str(path) in opened


BALL = '<worldbody><body name="ball"><joint name="j"/><geom size="1"/></body></worldbody>'
SHAPE = '<worldbody><body name="shape"><joint name="j"/><geom type="mesh" mesh="m"/></body></worldbody>'
ABSOLUTE = "{out}"  # the folder outside, from the root


def tetrahedron(size: float) -> bytes:
    """A binary STL file."""
    corners = np.vstack([np.zeros(3), size * np.eye(3)])
    faces = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    body = b"".join(struct.pack("<12fH", 0, 0, 0, *corners[list(face)].ravel(), 0) for face in faces)
    return b"\0" * 80 + struct.pack("<I", len(faces)) + body


@pytest.fixture
def model(tmp_path: Path) -> Any:
    """Writes a model into a folder with meshes, beside a folder ``out`` that it must not reach."""
    folder, out = tmp_path / "model", tmp_path / "out"
    for place in (folder / "sub", out):
        place.mkdir(parents=True)
        (place / "x.stl").write_bytes(tetrahedron(1.0))
    (folder / "a.stl").write_bytes(tetrahedron(2.0))
    (out / "x.xml").write_text(f"<mujoco>{BALL.replace('ball', 'hidden')}</mujoco>")
    os.symlink(out, folder / "link")
    os.mkfifo(folder / "pipe.stl")

    def write(text: str, name: str = "model.xml") -> Path:
        path: Path = folder / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(f"<mujoco>\n{text.replace(ABSOLUTE, str(out))}\n</mujoco>")
        return path

    return write


def mesh(name: str, compiler: str = "") -> str:
    return f'{compiler}<asset><mesh name="m" file="{name}"/></asset>{SHAPE}'


OUTSIDE = [
    *(mesh(name) for name in ("../out/x.stl", "..\\out\\x.stl", "{out}/x.stl", "link/x.stl")),
    *(mesh("x.stl", f"<compiler {key}/>") for key in ('meshdir="..\\out"', 'assetdir="{out}"')),
    *(
        f"{start}{BALL}"
        for start in (
            *('<include file="..\\out\\x.xml"/>', '<Include file="../out/x.xml"/>', '<include file="link/x.xml"/>'),
            '<asset><model name="p" file="../out/x.xml"/></asset>',
            '<worldbody><body name="f"><flexcomp name="f" type="mesh" file="../out/x.stl"/></body></worldbody>',
        )
    ),
]
#: Where the kernel can keep MuJoCo to a folder (Landlock).
CONFINED = sys.platform == "linux" and ctypes.CDLL(None).syscall(444, None, 0, 1) > 0


@pytest.mark.skipif(not CONFINED, reason="the kernel has no Landlock")
@pytest.mark.parametrize("text", OUTSIDE)
def test_no_spelling_of_a_path_leads_out_of_the_folder(text: str, model: Any) -> None:
    with refused("EG-FILE model.xml:2: model assets=") as caught:
        eg.load(model(text))
    assert "hidden" not in str(caught.value)


def test_a_folder_of_assets_holds_the_model_and_what_it_names(model: Any) -> None:
    path = model(mesh("../out/x.stl"))
    assert mass_of(path, assets=str(path.parents[1])) == pytest.approx(1000 / 6)
    refuses("EG-FILE model.xml:1: assets:", eg.load, path, assets=str(path.parents[1] / "out"))


@pytest.mark.parametrize("name", ["none.stl", "%2e%2e/out/x.stl", "A.STL"])
def test_what_is_no_file_of_the_folder_is_reported(name: str, model: Any) -> None:
    refuses("EG-FILE model.xml:2: mujoco:", eg.load, model(mesh(name)))


def mass_of(path: Path, **options: Any) -> float:
    (mass,) = (body["mass"] for body in described(eg.load(path, **options))["bodies"].values() if "mass" in body)
    return float(mass)


@pytest.mark.parametrize(
    ("name", "compiler", "size"),
    [
        ("sub\\x.stl", "", 1.0),
        ("x.stl", '<compiler meshdir="sub\\"/>', 1.0),
        ("..\\out\\a.stl", '<compiler strippath="true"/>', 2.0),
        ("sub/../a.stl", '<compiler meshdir="none"/><compiler assetdir="."/>', 2.0),
    ],
)
def test_names_with_backslashes_are_read_inside(name: str, compiler: str, size: float, model: Any) -> None:
    assert mass_of(model(mesh(name, compiler))) == pytest.approx(1000 * size**3 / 6)


# -- sizes and cycles -------------------------------------------------------------------------------------------------
CYCLES = {
    "itself": ({}, '<include file="model.xml"/>', "EG-CIRCLE model.xml:2: mujoco: 'model.xml'"),
    "each other": (
        {"a.xml": '<include file="b.xml"/>', "b.xml": '<include file="a.xml"/>'},
        '<include file="a.xml"/>',
        "EG-CIRCLE mujoco: 'a.xml'",
    ),
    "twice": ({"a.xml": "<option/>"}, 2 * '<include file="a.xml"/>', "EG-CIRCLE model.xml:2: a.xml"),
    "attached": ({}, '<asset><model name="p" file="model.xml"/></asset>', "EG-FILE-DAMAGED model.xml:1: mujoco:"),
}  # fmt: skip


@pytest.mark.parametrize("cycle", CYCLES)
def test_no_file_is_part_of_itself(cycle: str, model: Any) -> None:
    others, start, said = CYCLES[cycle]
    for name, text in others.items():
        model(text, name)
    refuses(said, eg.load, model(start + BALL))


SIZES = {
    '<worldbody><replicate count="99999999999999999999999"><body/></replicate></worldbody>': (
        "EG-FILE-DAMAGED model.xml:2: mujoco: 'count'"
    ),
    '<worldbody><replicate count="2000"><replicate count="2000"><body/></replicate></replicate></worldbody>': (
        "EG-TOO-LARGE mujoco:"
    ),
    '<worldbody><body pos="1e308 0 0"><joint/><geom size="1"/></body></worldbody>': "EG-RANGE mujoco: body_pos 1e+100",
    '<worldbody><body><joint stiffness="nan"/><geom size="1"/></body></worldbody>': "EG-RANGE mujoco: jnt_stiffness",
    '<worldbody><replicate count="900" offset="3 0 0"><body><joint/><geom size="1"/></body></replicate></worldbody>': (
        "EG-TOO-LARGE robot: 901 800"
    ),
}


@pytest.mark.parametrize("text", SIZES)
def test_sizes_of_mjcf_are_bounded(text: str, model: Any) -> None:
    refuses(SIZES[text], eg.load, model(text + BALL))


def test_what_is_no_part_of_the_motion_costs_nothing(model: Any) -> None:
    path = model(
        '<size memory="900T" nkey="100000000" nuser_body="1000000000"/>'
        '<asset><texture name="t" type="cube" builtin="flat" width="16384" height="16384"/>'
        '<hfield name="h" nrow="16385" ncol="2" size="1 1 1 1"/>'
        '<texture type="2d" file="/nowhere/x.png"/><material name="m" texture="t"/></asset>'
        f'<keyframe><key qpos="1 2 3 4 5 6 7"/></keyframe><sensor><jointpos joint="none"/></sensor>{BALL}'
    )
    assert mass_of(path) == pytest.approx(4000 * np.pi / 3)


LENGTHS = '<compiler><lengthrange mode="all" inttotal="1e9" interval="1e8" timestep="1e-6"/></compiler>'


@pytest.mark.thorough
@pytest.mark.parametrize("text", [f"{LENGTHS}{BALL}<actuator><muscle joint='j'/></actuator>", mesh("pipe.stl")])
def test_a_model_that_never_compiles_is_given_up(text: str, model: Any) -> None:
    refuses("EG-TOO-LARGE model.xml:1: mujoco: time", eg.load, model(text))


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ('<worldbody><body><joint type="screw"/></body></worldbody>', "EG-FILE-DAMAGED model.xml:2: mujoco: 'screw'"),
        ("<worldbody><body><joint/></body></worldbody>", "EG-FILE-DAMAGED model.xml:2: mujoco: mass inertia"),
        ('<worldbody><body name="a"/>', "EG-FILE-DAMAGED model.xml:3: file:"),
        ('<worldbody><geom size="1"/></worldbody>', "EG-TOPOLOGY model.xml:1: robot: floating=True"),
    ],
)
def test_mjcf_faults(line: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "model.xml"
    path.write_text(f"<mujoco>\n{line}\n</mujoco>")
    refuses(said, eg.load, path)


URDF = """<robot name="r"><link name="base"/><link name="l"><inertial>{origin}<mass value="{mass}"/>
<inertia ixx="{xx}" iyy="1" izz="1" ixy="{xy}"/></inertial></link>
<joint name="j" type="continuous"><parent link="base"/><child link="l"/></joint>{more}</robot>"""


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"xx": "1e308"}, "EG-RANGE r.urdf:2: link.l.inertial.inertia.ixx: 1e+308 1e+100"),
        ({"xx": "1e308", "more": '<link name="lost"/>'}, "EG-RANGE link.l.inertial.inertia.ixx: 1e+308"),
        ({"xy": "1e100"}, "EG-INERTIA inertia"),
        ({"origin": '<origin xyz="1e308 1e308 0"/>'}, "EG-RANGE xyz: 1e+308"),
        ({"mass": "1e308"}, "EG-RANGE link.l.inertial.mass.value: 1e+308"),
        ({"xx": "nan"}, "EG-NUMBER link.l.inertial.inertia.ixx: 'nan'"),
        ({"more": "<a x='" + "x" * 300_000 + "'/>"}, "EG-TOO-LARGE r.urdf:3: file: 200,000"),
        ({"more": "<a>" * 100_000}, "EG-TOO-LARGE r.urdf:3: file: 200"),
    ],
)
def test_numbers_of_urdf_are_bounded(given: dict[str, str], said: str, tmp_path: Path) -> None:
    path = tmp_path / "r.urdf"
    path.write_text(URDF.format(**({"xx": "1", "xy": "0", "mass": "1", "origin": "", "more": ""} | given)))
    with refused(said, eg.ModelError):
        eg.load(path).check()


def test_meshes_of_model_files_with_names_that_are_none_are_faults(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.stl")
    for name, said in {
        "a\\0.stl": "EG-FILE solids[0].file: character",
        "\\ud800.stl": "EG-FILE-DAMAGED solids[0].file: U+D800",
        "none.stl": "EG-FILE solids[0].file: none.stl",
        "pipe.stl": "EG-FILE solids[0].file: pipe.stl",
        "../a.stl": "EG-FILE solids[0].file: ../a.stl",
    }.items():
        text = f'name: m\nbodies: {{b: {{solids: [{{type: mesh, file: "{name}", density: 1}}]}}}}\n'
        with refused(said, eg.ModelError):
            load(tmp_path, text).check()
