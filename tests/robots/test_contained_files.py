"""Robot files that reach for other files, or break MuJoCo: nothing outside is read, and every breakage has a name."""

from __future__ import annotations

import os
import struct
import time
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

import eomgen as eg
from eomgen.limits import files
from eomgen.robots import mjcf_compile
from eomgen.robots.mjcf_files import Scan
from eomgen.robots.mjcf_text import Text
from eomgen.robots.xml_text import read_xml
from eomgen.solids.mesh import measure_mesh

QUATERNION = '<worldbody><body name="ball"><joint name="j"/><geom size="1"/></body></worldbody>'
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
    (out / "x.xml").write_text(f"<mujoco>{QUATERNION.replace('ball', 'hidden')}</mujoco>")
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
    *(
        mesh(name)
        for name in (
            *("../out/x.stl", "..\\out\\x.stl", "sub\\..\\..\\out\\x.stl", "sub/../../out/x.stl", "./..//out/x.stl"),
            *("{out}/x.stl", "\\etc\\passwd", "/etc/passwd", "link/x.stl", "link\\x.stl", "C:\\x.stl", "c:/x.stl"),
            *("file:///etc/passwd", "file:/{out}/x.stl", "http://127.0.0.1:9/x.stl", "\\\\server\\share\\x.stl"),
        )
    ),
    *(
        mesh("x.stl", f'<compiler {key}="{folder}"/>')
        for key in ("meshdir", "assetdir")
        for folder in ("../out", "..\\out", "{out}", "link", "sub\\..\\..\\out")
    ),
    mesh("x.stl", '<compiler meshdir="sub"/><compiler meshdir="..\\out"/>'),
    mesh("y\\..\\x.stl", '<compiler meshdir="../out" strippath="true"/>'),
    *(
        f"{start}{QUATERNION}"
        for start in (
            *('<include file="..\\out\\x.xml"/>', '<Include file="../out/x.xml"/>', '<include file="link\\x.xml"/>'),
            '<asset><model name="p" file="..\\out\\x.xml"/></asset>',
            '<worldbody><body name="f"><flexcomp name="f" type="mesh" file="..\\out\\x.stl"/></body></worldbody>',
        )
    ),
]


UNREAD = [
    '<asset><texture name="t" type="cube" fileup="..\\out\\x.png"/></asset>',
    '<compiler texturedir="..\\out"/><asset><texture type="2d" file="x.png"/></asset>',
    '<asset><texture type="2d" file="/nowhere/x.png"/></asset>',
    '<asset><hfield name="h" file="..\\out\\x.png" size="1 1 1 1"/></asset>',
    '<asset><skin name="s" file="..\\out\\x.skn"/></asset>',
]


@pytest.mark.parametrize("text", UNREAD)
def test_what_is_never_read_may_be_anywhere(text: str, model: Any) -> None:
    """Neither the name of the file nor a byte of it comes to MuJoCo."""
    path = model(f"{text}{QUATERNION}")
    assert eg.load(path).check().degrees_of_freedom > 0
    given = _text(path)
    assert "x." not in given.main + "".join(given.files)


@pytest.mark.parametrize("text", OUTSIDE)
def test_no_spelling_of_a_path_leads_out_of_the_folder(text: str, model: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def never(*_: Any, **__: Any) -> None:
        raise AssertionError("MuJoCo was asked")

    monkeypatch.setattr("subprocess.Popen", never)
    with pytest.raises(eg.ModelError, match=r"model.xml:2: .*is outside the folder") as caught:
        eg.load(model(text))
    assert "hidden" not in str(caught.value)


@pytest.mark.parametrize("name", ["pipe.stl", "none.stl", ".", "", "%2e%2e/out/x.stl", "~/x.stl", "A.STL", "a" * 2000])
def test_what_is_no_file_of_the_folder_is_told(name: str, model: Any) -> None:
    with pytest.raises(eg.ModelError, match=r"model.xml:2: mesh.file: .*(no plain file|names no file|too long)"):
        eg.load(model(mesh(name)))


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
    mass = eg.load(model(mesh(name, compiler))).mechanism().bodies[0].mass
    assert mass.value == pytest.approx(1000 * size**3 / 6)


CYCLES = {
    "itself": ({}, '<include file="model.xml"/>', "'model.xml' includes itself"),
    "each other": (
        {"a.xml": '<include file="b.xml"/>', "b.xml": '<include file="a.xml"/>'},
        '<include file="a.xml"/>',
        "'a.xml' includes itself",
    ),
    "twice": ({"a.xml": "<option/>"}, '<include file="a.xml"/><include file="./a.xml"/>', "part of the model already"),
    "attached": ({}, '<asset><model name="p" file="model.xml"/></asset>', "'model.xml' attaches itself"),
    "attached in turn": (
        {"a.xml": '<asset><model name="p" file="b.xml"/></asset>', "b.xml": '<include file="model.xml"/>'},
        '<asset><model name="p" file="a.xml"/></asset>',
        "'a.xml' attaches itself",
    ),
}  # fmt: skip


@pytest.mark.parametrize("cycle", CYCLES)
def test_no_file_is_part_of_itself(cycle: str, model: Any) -> None:
    others, start, said = CYCLES[cycle]
    for name, text in others.items():
        model(text, name)
    with pytest.raises(eg.ModelError, match=said):
        eg.load(model(start + QUATERNION))


SIZES = {
    '<size nkey="100000000"/>': "size.nkey: 100000000 is too large; at most 1,000,000",
    '<size nuser_body="1000000000"/>': "size.nuser_body: 1000000000 is too large",
    '<asset><hfield name="h" nrow="16385" ncol="2" size="1 1 1 1"/></asset>': "hfield.nrow: 16385 is too large",
    '<worldbody><replicate count="99999999999999999999999"><body/></replicate></worldbody>': "makes too many bodies",
    '<worldbody><body name="a"><flexcomp name="f" count="1e3 1e3 1e3"/></body></worldbody>': "makes too many bodies",
    '<worldbody><body pos="1e308 0 0"><joint/><geom size="1"/></body></worldbody>': "places of bodies .* most 1e\\+100",
    '<worldbody><body><joint stiffness="nan"/><geom size="1"/></body></worldbody>': "stiffnesses of joints|nan",
    '<worldbody><replicate count="900" offset="3 0 0"><body><joint/><geom size="1"/></body></replicate></worldbody>': (
        "has 901 coordinates of joints; at most 800"
    ),
}


@pytest.mark.parametrize("text", SIZES)
def test_sizes_of_mjcf_are_bounded(text: str, model: Any) -> None:
    with pytest.raises(eg.ModelError, match=SIZES[text]):
        eg.load(model(text + QUATERNION))


@pytest.mark.parametrize(
    "text",
    [
        '<asset><hfield name="h" nrow="16384" ncol="16384" size="1 1 1 1"/></asset>',
        '<asset><texture name="t" type="cube" builtin="flat" width="16384" height="16384"/></asset>',
        '<custom><numeric name="n" size="2000000000"/></custom>',
        '<size memory="900T" nkey="999999" nuser_body="999999"/><keyframe><key qpos="1 2 3 4 5 6 7"/></keyframe>',
    ],
)
def test_what_is_no_part_of_the_motion_costs_nothing(text: str, model: Any) -> None:
    mass = eg.load(model(text + QUATERNION)).mechanism().bodies[0].mass
    assert mass.value == pytest.approx(4000 * np.pi / 3)


SLOW = (
    '<compiler><lengthrange mode="all" inttotal="1e9" interval="1e8" timestep="1e-6"/></compiler>'
    f'{QUATERNION}<actuator><muscle joint="j"/></actuator>'
)


@pytest.mark.parametrize(("bound", "value"), [("SECONDS", 1), ("WAIT", 1)])
def test_a_model_that_never_compiles_is_given_up(
    bound: str, value: int, model: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mjcf_compile, bound, value)
    start = time.monotonic()
    with pytest.raises(eg.ModelError, match=r"model.xml:1: mujoco: MuJoCo needs more time for it than the .* s"):
        eg.load(model(SLOW))
    assert time.monotonic() - start < 15


def test_memory_is_bounded(model: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    text = '<asset><mesh name="s" builtin="supersphere" params="1000 1 1"/></asset>' + QUATERNION
    monkeypatch.setattr(mjcf_compile, "MEMORY", 250_000_000)
    with pytest.raises(eg.ModelError, match=r"MuJoCo (needs more memory|refuses it|crashes|ends)"):
        eg.load(model(text))


def test_a_crash_of_mujoco_is_an_error(model: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    program = tmp_path / "program.py"
    program.write_text("import os, signal\nos.kill(os.getpid(), signal.SIGSEGV)")
    monkeypatch.setattr(mjcf_compile, "_PROGRAM", program)
    with pytest.raises(eg.ModelError, match=r"MuJoCo crashes on it \(SIGSEGV\)"):
        eg.load(model(QUATERNION))
    program.write_text("raise SystemExit(3)")
    with pytest.raises(eg.ModelError, match=r"MuJoCo ends without a model \(exit 3\)"):
        eg.load(model(QUATERNION))


def test_the_process_of_mujoco_opens_no_file(model: Any) -> None:
    """Were a name to slip through, by whatever spelling, there is nothing to open it with."""
    path = model(mesh("a.stl"))
    root = read_xml(path)
    scan = Scan(root, None)
    text = Text(scan.trees, scan.folder, scan.problems)
    assert list(text.files) == ["mesh0.stl"]
    assert str(path.parent) not in text.main
    mjcf_compile.compile_mjcf(text, root)
    text.main = text.main.replace("mesh0.stl", str(path.parent / "a.stl"))
    assert mujoco.MjModel.from_xml_string(text.main).nmesh == 1, "it is there to be opened"
    with pytest.raises(
        eg.ModelError, match=r"MuJoCo refuses it: Error: (Error opening file|stl_decoder: STL file .*a.stl' is empty)"
    ):
        mjcf_compile.compile_mjcf(text, root)


RICH = """<compiler meshdir="sub" texturedir="none" angle="radian"/>
<size nuser_body="3"/><visual><global fovy="30"/></visual><statistic extent="2"/>
<include file="part.xml"/>
<asset><model name="other" file="other.xml"/><mesh file="x.stl"/>
  <hfield name="h" nrow="3" ncol="3" size="1 1 1 1"/></asset>
<worldbody><geom type="hfield" hfield="h" pos="0 0 -9"/>
  <body name="a" pos="0 0 3" user="1 2 3"><joint name="j" damping="0.2"/>
    <geom type="mesh" mesh="x" material="paint"/></body>
  <attach model="other" body="ball" prefix="p_"/></worldbody>
<sensor><jointpos joint="j"/></sensor><keyframe><key qpos="1 1"/></keyframe>"""


def test_the_process_makes_what_mujoco_makes(model: Any) -> None:
    """All arrays that come back, to the bit, of a model with most that is left out or replaced on the way."""
    part = '<asset><texture name="grid" type="2d" builtin="checker" width="99" height="99"/></asset>'
    model(part + '<asset><material name="paint" texture="grid"/></asset>', "part.xml")
    model(QUATERNION, "other.xml")
    path = model(RICH)
    ours = mjcf_compile.compile_mjcf(_text(path), read_xml(path))
    theirs = mujoco.MjModel.from_xml_path(str(path))
    checked = 0
    for key, array in vars(ours).items():
        if isinstance(array, np.ndarray) and not key.startswith("name_") and not key.endswith("_user"):
            np.testing.assert_array_equal(array, getattr(theirs, key), err_msg=key)
            checked += 1
    assert checked > 100
    assert ours.names["body"] == [theirs.body(k).name for k in range(theirs.nbody)] == ["world", "a", "p_ball"]


def _text(path: Path) -> Text:
    scan = Scan(read_xml(path), None)
    return Text(scan.trees, scan.folder, scan.problems)


def test_refusals_of_mujoco_name_the_file_and_line_of_the_user(model: Any) -> None:
    part = model('\n\n<worldbody>\n<body name="b">\n<joint type="screw"/></body></worldbody>', "sub/part.xml")
    path = model('\n<include file="sub/part.xml"/>' + QUATERNION)
    with pytest.raises(
        eg.ModelError, match=r"sub/part.xml:6: mujoco: MuJoCo refuses it: .*line 6 of part.xml"
    ) as caught:
        eg.load(path)
    assert caught.value.problems[0].file == os.path.realpath(part)
    other = model('<worldbody>\n<body name="b"><geom size="1" shape="round"/></body></worldbody>', "sub/other.xml")
    path = model('<asset><model name="o" file="sub/other.xml"/></asset>' + QUATERNION)
    with pytest.raises(eg.ModelError, match=rf"{other}:3: mujoco: .*unrecognized attribute: 'shape'"):
        eg.load(path)


def test_all_files_together_are_bounded(model: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    start = "".join(f'<include file="p{k}.xml"/>' for k in range(4))
    for k in range(4):
        model("<option/>" * 20, f"p{k}.xml")
    path = model(start + QUATERNION)
    for name, value, said in (
        ("SIZE", 500, "is too large"),
        ("ELEMENTS", 70, "too many elements"),
        ("FILES", 3, "too many files"),
        ("DEPTH", 2, "nested too deeply"),
    ):
        with monkeypatch.context() as patch:
            patch.setattr(f"eomgen.robots.mjcf_files.{name}", value)
            with pytest.raises(eg.ModelError, match=said):
                eg.load(path)


def test_models_that_attach_each_other_are_counted(model: Any) -> None:
    """Each attaches the one before it ten times: a hundred thousand bodies from six files."""
    model(QUATERNION, "m0.xml")
    for k in range(1, 6):
        attach = "".join(f'<attach model="m" body="ball" prefix="p{n}"/>' for n in range(10))
        asset = f'<asset><model name="m" file="m{k - 1}.xml"/></asset>'
        model(f'{asset}<worldbody><body name="ball">{attach}</body></worldbody>', f"m{k}.xml")
    with pytest.raises(eg.ModelError, match="makes too many bodies"):
        eg.load(Path(model("").parent / "m5.xml"))


URDF = """<robot name="r"><link name="base"/><link name="l"><inertial>{origin}<mass value="{mass}"/>
<inertia ixx="{xx}" iyy="1" izz="1" ixy="{xy}"/></inertial></link>
<joint name="j" type="continuous"><parent link="base"/><child link="l"/></joint>{more}</robot>"""


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"xx": "1e308"}, r"urdf:2: link.l.inertial.inertia.ixx: 1e\+308 is too large; at most 1e\+100"),
        ({"xx": "1e308", "more": '<link name="lost"/>'}, "1e\\+308 is too large"),
        ({"xy": "1e100"}, "negative principal moment"),
        ({"origin": '<origin xyz="1e308 1e308 0"/>'}, "too large"),
        ({"mass": "1e308"}, "too large"),
        ({"xx": "nan"}, "not finite"),
        ({"more": "<a " + "x" * (files.PIECE + 1) + "/>"}, "has a tag, a comment or a text of 2,000,"),
    ],
)
def test_numbers_of_urdf_are_bounded(given: dict[str, str], said: str, tmp_path: Path) -> None:
    path = tmp_path / "r.urdf"
    path.write_text(URDF.format(**({"xx": "1", "xy": "0", "mass": "1", "origin": "", "more": ""} | given)))
    with pytest.raises(eg.ModelError, match=said):
        eg.load(path).check()


def test_limits_of_joints_may_be_as_large_as_others_write_them(tmp_path: Path) -> None:
    path = tmp_path / "r.urdf"
    limit = '</child><limit lower="-1.79769e+308" upper="1.79769e+308" effort="1e308" velocity="1"/>'
    text = URDF.format(xx="1", xy="0", mass="1", origin="", more="")
    path.write_text(text.replace("continuous", "revolute").replace('<child link="l"/>', '<child link="l">' + limit))
    assert eg.load(path).check().coordinates == ["j"]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"lock": 5}, "lock must be names of joints, or a mapping of names to values, not 5"),
        ({"lock": {"j": 1e308}}, "finite number"),
        ({"lock": [None]}, "names of joints"),
        ({"actuate": 5}, "actuate must be names of joints, or True, not 5"),
        ({"actuate": {"j": 1}}, "names of joints"),
        ({"snap": "x"}, "0 or positive, not 'x'"),
        ({"snap": -1.0}, "an angle"),
        ({"assets": 5}, "assets must be the name of a file or folder, as text or Path, not 5"),
        ({"floating": "yes"}, "floating must be True or False, not 'yes'"),
        ({"mimic": ["coupling"]}, "mimic must be one of coupling, independent, not"),
    ],
)
def test_odd_options_are_named_errors(given: dict[str, Any], said: str, tmp_path: Path) -> None:
    (tmp_path / "r.urdf").write_text(URDF.format(xx="1", xy="0", mass="1", origin="", more=""))
    with pytest.raises(eg.UsageError, match=said):
        eg.load(tmp_path / "r.urdf", **given)


def test_one_name_of_a_joint_actuates_that_joint_alone(tmp_path: Path) -> None:
    more = (
        '<link name="m"><inertial><mass value="1"/></inertial></link>'
        '<joint name="jj" type="prismatic"><parent link="l"/><child link="m"/></joint>'
    )
    (tmp_path / "r.urdf").write_text(URDF.format(xx="1", xy="0", mass="1", origin="", more=more))
    inputs = eg.load(tmp_path / "r.urdf", actuate="jj").description.sections["inputs"]
    assert [entry.name for entry in inputs] == ["tau_jj"]


@pytest.mark.parametrize("suffix", [".urdf", ".xml"])
def test_pipes_folders_and_names_that_are_none_end_at_once(suffix: str, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / f"pipe{suffix}")
    with pytest.raises(eg.UsageError, match="is not a plain file but a pipe"):
        eg.load(tmp_path / f"pipe{suffix}")
    for name in ("a\0", "\udc80\ud800"):
        with pytest.raises(eg.UsageError, match="path must be the name of a file"):
            eg.load(name + suffix)
    (tmp_path / f"folder{suffix}").mkdir()
    with pytest.raises(eg.UsageError, match="is not a plain file but a folder"):
        eg.load(tmp_path / f"folder{suffix}")


def test_meshes_of_model_files_with_names_that_are_none_are_faults(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    os.mkfifo(tmp_path / "pipe.stl")
    for name, said in {
        "a\\0.stl": "contains a character that file names cannot have",
        "\\ud800.stl": "character|surrogate",
        "pipe.stl": "is not a plain file",
    }.items():
        path.write_text(f'name: m\nbodies: {{b: {{solids: [{{type: mesh, file: "{name}", density: 1}}]}}}}\n')
        with pytest.raises(eg.ModelError, match=said):
            eg.load(path).check()
    with pytest.raises(eg.UsageError, match="path must be the name of a file"):
        measure_mesh("a\0.stl")
