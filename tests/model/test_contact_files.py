"""Contact between groups in model files: as in Python, written again, in components, and faults told with remedies."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import contact_scenes as scenes
import numpy as np
import pytest
from model_files import load

import eomgen as eg

FILE = """\
name: heap
gravity: [0, -9.81, 0]
parameters: {mu: 0.3, r: {value: 100, unit: mm}}
bodies:
  a: {mass: 1, inertia: {zz: 0.01}}
  b: {mass: 1, inertia: {zz: 0.01}}
joints:
  ja: {type: planar, between: [ground, a]}
  jb: {type: planar, between: [ground, b]}
contacts:
  floor:
    first: [{shape: circle, on: [a, b], radius: r}]
    second: {shape: half_plane, on: ground}
    law: {stiffness: 1e5, dissipation: 0.3, friction: mu, smoothing: 0.001}
  among:
    first: [{shape: box, on: [a, b], size: [r, 2*r]}]
    law: {stiffness: 1e5}
initial: {ja_y: 0.095, jb_x: 0.05, jb_y: 0.2, ja_x_dot: 1}
"""


def test_a_file_as_python_and_written_again(tmp_path: Path) -> None:
    m = load(tmp_path, FILE)
    mod = m.compile(target="numpy")
    x = mod.x0()
    m2 = eg.Model("heap", gravity=(0, -9.81, 0))
    mu, r = m2.parameter("mu", 0.3), m2.parameter("r", 0.1)
    a, b = (m2.body(name, mass=1, inertia={"zz": 0.01}) for name in "ab")
    m2.planar("ja", m2.ground, a)
    m2.planar("jb", m2.ground, b)
    law = {"stiffness": 1e5, "dissipation": 0.3, "friction": mu, "smoothing": 0.001}
    m2.contacts("floor", {"shape": "circle", "on": [a, b], "radius": r}, {"shape": "half_plane", "on": m2.ground}, law)
    m2.contacts("among", [{"shape": "box", "on": one, "size": (r, 2 * r)} for one in (a, b)], stiffness=1e5)
    wanted = mod.rhs(0.0, x)
    assert np.abs(wanted[6:]).max() > 10.0
    assert np.allclose(m2.compile(target="numpy").rhs(0.0, x), wanted, rtol=1e-13)
    again = load(tmp_path, m.to_yaml())
    assert np.array_equal(again.compile(target="numpy").rhs(0.0, x), wanted)


def test_in_a_component() -> None:
    """Markers, parameters and names of a component take its prefix."""
    part, bodies = scenes.planar("part", 2)
    part.parameter("size", 0.1)
    part.contacts(
        "touch",
        {"shape": "circle", "on": bodies[0], "radius": "size"},
        scenes.on(scenes.PLANAR["box"], bodies[1]),
        scenes.LAW,
    )
    m = eg.Model("whole", gravity=(0, -9.81, 0))
    m.add(part, prefix="p_")
    mod, own = m.compile(target="numpy"), part.compile(target="numpy")
    start = {"j1_y": 0.12, "j1_x_dot": 1.0}
    wanted = own.rhs(0.0, own.x0(**start))
    assert np.abs(wanted[6:]).max() > 50.0
    assert np.allclose(mod.rhs(0.0, mod.x0(**{f"p_{k}": x for k, x in start.items()})), wanted, rtol=1e-12)


CIRCLES, BOXES, FLOOR, LAST = (
    "first: [{shape: circle, on: [a, b], radius: r}]",
    "first: [{shape: box, on: [a, b], size: [r, 2*r]}]",
    "{shape: half_plane, on: ground}",
    "law: {stiffness: 1e5}",
)
POINTS = "first: [{{shape: polygon, on: [a, b], points: {}}}]"
FAULTS = [
    ("friction: mu", "friction: -0.1", "heap.yaml:14: forces.floor.friction: is -0.1; must be 0 or greater"),
    (CIRCLES, CIRCLES.replace("r}", "-1}"), "12: forces.floor.first[0].radius: is -1; must be greater than 0"),
    (BOXES, BOXES.replace("2*r", "0"), "forces.among.first[0].size[1]: is 0; must be greater than 0"),
    (CIRCLES, CIRCLES.replace("circle", "circel"), "no shape 'circel'; did you mean 'circle'?"),
    (CIRCLES, "first: []", "forces.floor.first: has no shapes; give at least one shape"),
    (CIRCLES, CIRCLES.replace("[a, b]", "[]"), "first[0].on: names no marker; give a body or a marker"),
    (CIRCLES, CIRCLES.replace("b]", "c]"), "first[0].on[1]: no body 'c'; bodies: ground, a, b"),
    (CIRCLES, CIRCLES.replace("on: [a, b], ", ""), "forces.floor.first[0].on: is missing"),
    (LAST, "law: 3", "forces.among.law: is not a mapping of keys of the law"),
    (LAST, "", "forces.among: has no law; give law: {stiffness: ...}"),
    (LAST, "law: {friction: 0.2, smoothing: 0.1}", "forces.among.stiffness: is missing"),
    (LAST, "law: {stiffness: 1, stifness: 1}", "forces.among.stifness: unknown key"),
    (
        FLOOR,
        "{shape: half_space, on: ground}",
        "circle and half_space do not meet; circle, segment, box",
    ),
    (FLOOR, "{shape: circle, on: a, radius: r}", "the shape on a is in both groups; give second only what is not in"),
    (BOXES, BOXES.replace("[a, b]", "a"), "forces.among: has shapes on one body only"),
    (
        BOXES,
        POINTS.format("[[0, 0], [1, 1], [1, 0], [0, 1]]"),
        "the edges that begin at corners 0 and 2 cross each other",
    ),
    (BOXES, POINTS.format("[[0, 0], [1, 0], [0.2, 0.2], [0, 1]]"), "points: is not convex; give it as shape outline"),
    (BOXES, POINTS.format("[[0, 0], [1, 0], [2, 0], [0, 1]]"), "points[1]: lies on a line with the corners beside it"),
    (BOXES, POINTS.format("[[0, 0], [1, 0]]"), "points: is no outline; give 3 to 64 corners [x, y]"),
]


@pytest.mark.parametrize(("old", "new", "message"), FAULTS)
def test_faults_of_files(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in FILE
    with pytest.raises(eg.ModelError) as raised:
        load(tmp_path, FILE.replace(old, new), "heap.yaml").check()
    assert message in str(raised.value)


def test_a_clockwise_outline_is_turned_round() -> None:
    values: list[Any] = []
    for points in (scenes.TRIANGLE, scenes.TRIANGLE[::-1]):
        m, (a, b) = scenes.planar("turned", 2)
        circle = scenes.on(scenes.PLANAR["circle"], b)
        m.contacts("touch", {"shape": "polygon", "on": a, "points": points}, circle, scenes.LAW)
        mod = m.compile(target="numpy")
        values.append(mod.rhs(0.0, mod.x0(j1_x=0.18, j1_y=0.02)))
    assert np.abs(values[0][6:]).max() > 10.0
    assert np.allclose(*values, rtol=1e-12)


def test_a_law_in_python_is_a_mapping_of_known_keys() -> None:
    m, (a, b) = scenes.planar("law", 2)
    one, other = (scenes.on(scenes.PLANAR["circle"], body) for body in (a, b))
    with pytest.raises(eg.UsageError, match="law is int, not a mapping"):
        m.contacts("c", one, other, 3)
    with pytest.raises(eg.UsageError, match="stiffness is given in law and beside it"):
        m.contacts("c", one, other, {"stiffness": 1}, stiffness=2)
    with pytest.raises((eg.UsageError, TypeError), match="stifness"):
        m.contacts("c", one, other, {"stifness": 1})
