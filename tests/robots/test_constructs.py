"""No construct of a robot file passes in silence: it is taken, noted at load, or on the list of what moves nothing.

The corpus is what PyPI packages ship: example-robot-data, pybullet_data, dm_control, gymnasium, gymnasium_robotics,
mujoco.  For MJCF the schema that MuJoCo prints tells which elements and attributes there are at all.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path

import mujoco
import pytest
from robots.shipped import EXAMPLES, package_folder

import eomgen as eg
from eomgen.errors import ModelError
from eomgen.robots.constructs import ANY, DATA, HARMLESS, INSIDE, LEFT, SEEN, TAKEN, Table, is_whole
from eomgen.robots.mjcf_constructs import MJCF, find_mjcf, path_of
from eomgen.robots.mjcf_files import Scan
from eomgen.robots.urdf_constructs import URDF, find_urdf, note_urdf
from eomgen.robots.xml_text import read_xml

FATES = {TAKEN, DATA, SEEN, LEFT, HARMLESS}
PAGE = Path(__file__).parents[2] / "docs" / "robots.md"


def parsed(path: Path) -> ET.Element | None:
    try:
        return ET.parse(path).getroot()
    except ET.ParseError:
        return None


def files(suffix: str, *packages: str) -> list[Path]:
    folders = [folder for name in packages if (folder := package_folder(name)) is not None]
    return sorted({path for folder in (*folders, EXAMPLES) for path in folder.rglob(f"*{suffix}")})


# -- URDF ------------------------------------------------------------------------------------------------------------
def walk(element: ET.Element, path: str) -> Iterator[tuple[str, str]]:
    """Every element and attribute, with the path it has in the file."""
    yield path, ""
    for attribute in element.attrib:
        yield path, attribute
    for child in element:
        if isinstance(child.tag, str):
            yield from walk(child, child.tag if path == "robot" else f"{path}/{child.tag}")


def fate_of(path: str, attribute: str) -> str | None:
    """The fate of a place in a URDF file, or of the nearest element around it that shares its own."""
    parts = path.split("/")
    for k in range(1, len(parts)):
        row = find_urdf("/".join(parts[:k]))
        if row is not None and INSIDE in row.attributes:
            return row.fate
    row = find_urdf(path, attribute)
    return None if row is None else row.fate


def test_every_construct_of_shipped_urdf_files_has_its_place() -> None:
    count = 0
    for path in files(".urdf", "pybullet_data"):
        root = parsed(path)
        if root is None or root.tag != "robot":
            continue
        count += 1
        unknown = {f"{p} {a}" for p, a in walk(root, "robot") if fate_of(p, a) not in FATES}
        assert unknown == set(), path
    assert count > 60


@pytest.mark.parametrize("folder", ["example-robot-data", "pybullet_data"])
def test_what_is_left_out_of_them_is_noted(folder: str) -> None:
    found = [p for p in files(".urdf", "pybullet_data") if folder in str(p) and "random_urdfs" not in str(p)]
    for path in found:
        root = parsed(path)
        if root is None or root.tag != "robot":
            continue
        told = " ".join(note_urdf(read_xml(path)))
        for place, attribute in walk(root, "robot"):
            row = find_urdf(place, attribute)
            if row is not None and row.fate == LEFT:
                assert row.why in told, (path, place, attribute)


STRANGE = """<robot name="strange" mood="sad"><link name="base"/><wheel size="3"/>
<link name="b"><inertial><mass value="1" unit="lb"/><inertia ixx="1" iyy="1" izz="1"/></inertial>
  <inertial><mass value="7"/></inertial><collision><geometry><box size="1 1 1"/></geometry></collision></link>
<joint name="j" type="revolute"><parent link="base"/><child link="b"/><dynamics damping="1" spring_stiffness="4"/>
  <safety_controller k_velocity="1"/><magic/></joint>
<transmission name="t"/><gazebo><gravity>0</gravity></gazebo></robot>"""


def test_what_is_not_known_or_given_twice_is_noted(tmp_path: Path) -> None:
    path = tmp_path / "strange.urdf"
    path.write_text(STRANGE)
    assert eg.load(path).notes == (
        "left out: what this reader does not know (<robot mood>, <wheel>, <mass unit>, <magic>)",
        "left out: shapes that touch, and contact (<collision>)",
        "left out: words of other formats and simulators (<dynamics spring_stiffness>, <gazebo>)",
        "left out: limits and reference positions of controllers (<safety_controller>)",
        (
            "left out: drives and their reductions (`actuate` gives inputs, `armature` the inertia of a rotor) "
            "(<transmission>)"
        ),
        "link.b: 2 <inertial>; only the first is used",
    )


# -- MJCF ------------------------------------------------------------------------------------------------------------
def schema() -> Iterator[tuple[list[str], str]]:
    """Of all that MuJoCo's schema has: the tags from the root to an element, and an attribute."""
    above: list[tuple[int, str]] = []
    for line in mujoco.mj_printSchema(False, True).splitlines():
        start, words = len(line) - len(line.lstrip()), line.split()
        if start < 27 and words:
            while above and above[-1][0] >= start:
                above.pop()
            above.append((start, words[0].replace("(world)body", "body")))
            words = ["", *words[2:]]
        for attribute in words:
            yield [tag for _, tag in above], attribute


def test_every_element_and_attribute_of_mujocos_schema_has_its_place() -> None:
    listed = list(schema())
    assert len(listed) > 1000
    unknown = set()
    for tags, attribute in listed:
        tags = ["body" if tag == "mujoco" and "body" in tags else tag for tag in tags]
        steps = [path_of(parent, tag) for parent, tag in zip(["", *tags], tags, strict=False)]
        if any((row := find_mjcf(step)) and INSIDE in row.attributes for step in steps):
            continue  # what is in an element that is left out whole has no lines of its own
        if find_mjcf(steps[-1], attribute) is None and steps[-1] != "body":
            unknown.add(f"{steps[-1]} {attribute}")
    assert unknown == set()


def test_every_construct_of_shipped_mjcf_files_has_its_place() -> None:
    count = 0
    for path in files(".xml", "dm_control", "gymnasium", "gymnasium_robotics", "mujoco", "pybullet_data"):
        try:
            root = read_xml(path)
        except ModelError:
            continue
        if root.tag != "mujoco" or root.find("worldbody") is None:
            continue
        scan = Scan(root, "/")
        unknown = {
            f"{p} {a}" for p, a in scan.met if find_mjcf(p, a) is None and (not a or find_mjcf(p) is not None)
        } - {
            f"mujoco/{tag} " for tag in ("texture", "material", "mesh", "body")
        }  # parts of files, which MuJoCo refuses
        assert unknown == set(), path
        count += 1
    assert count > 70


PIECES = """<mujoco>{head}<worldbody>
<body name="a" {a}><joint name="j" axis="0 1 0" {joint}/><geom name="g" size=".1" pos=".1 0 0" {geom}/>
  {site}</body>
<body name="b" pos="3 0 0" {b}>{free}<geom name="h" size=".1" pos=".1 0 0"/></body></worldbody>{tail}</mujoco>"""
NOTHING = dict.fromkeys(("head", "a", "joint", "geom", "site", "b", "tail"), "") | {
    "free": "<joint name='k'/>",
    "geom": 'contype="0" conaffinity="0"',
}
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
    ({"joint": 'range="-1 1" limited="true"'}, "the limits of joints stop nothing"),
    ({"tail": '<keyframe><key name="home" qpos="0 0"/></keyframe>'}, "left out: stored states (<keyframe>)"),
    (
        {"site": '<site name="s"/>', "tail": '<actuator><motor name="jet" site="s"/></actuator>'},
        "actuators that do not push along joints by a linear law (jet)",
    ),
    ({"tail": '<actuator><muscle name="biceps" joint="j" lengthrange="0 1"/></actuator>'}, "(biceps)"),
    (
        {"tail": '<tendon><fixed name="t" range="-1 1" limited="true"><joint joint="j" coef="1"/></fixed></tendon>'},
        "tendon_limited",
    ),
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


def test_bodies_that_hang_together_do_not_touch(tmp_path: Path) -> None:
    """MuJoCo lets no body touch the one it moves on, but for the world."""
    path = tmp_path / "chain.xml"
    inner = '<body name="inner" pos="0 0 .1"><joint/><geom size=".1"/>{}</body>'
    text = '<mujoco><worldbody><body><joint/><geom size=".1"/>{}</body></worldbody></mujoco>'
    path.write_text(text.format(inner.format("")))
    assert eg.load(path).notes == ()
    path.write_text(text.format(inner.format(inner.format("").replace("inner", "last"))))
    assert eg.load(path).notes == ("left out: contact of geoms",)  # the first and the last


# -- the page ---------------------------------------------------------------------------------------------------------
def markdown_of(table: Table) -> str:
    """The table as the documentation shows it, a line for each fate and reason."""
    groups: dict[tuple[str, str], list[str]] = {}
    for rows in table.values():
        for row in rows:
            attributes = [a for a in row.attributes if a not in (ANY, INSIDE)]
            what = f"`{row.element}`" + (f" {' '.join(attributes)}" if attributes else "")
            groups.setdefault((row.fate, row.why), []).append(what + (" and all inside" * is_whole(row)))
    order = (TAKEN, DATA, SEEN, LEFT, HARMLESS)
    lines = ["| | | elements and attributes |", "|---|---|---|"]
    for (fate, why), found in sorted(groups.items(), key=lambda item: order.index(item[0][0])):
        lines.append(f"| {fate} | {why} | {'; '.join(found)} |")
    return "\n".join(lines)


@pytest.mark.parametrize(("name", "table"), [("URDF", URDF), ("MJCF", MJCF)])
def test_the_page_shows_the_table_of_the_reader(name: str, table: Table) -> None:
    begin, end = f"<!-- every construct of {name} -->\n", f"\n<!-- end of {name} -->"
    shown = PAGE.read_text().partition(begin)[2].partition(end)[0]
    assert shown == markdown_of(table), f"put markdown_of({name}) between {begin!r} and {end!r} in {PAGE.name}"
