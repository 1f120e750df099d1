"""What the worked solution says of joints: about which axis each one turns or slides."""

from __future__ import annotations

import re
from typing import Any

import pytest

import eomgen as eg
from eomgen.explain.document import Sentence, Table
from eomgen.joints import JOINTS

SHAPES = {"curve": ["{s}", "0.2*{s}**2", 0], "surface": ["{a}", "{b}", "0.1*{a}*{b}"]}


def model(kind: str, axis: Any) -> Any:
    m = eg.Model("joints", gravity=(0, 0, -9.81))
    first, second = (m.body(name, mass=1.0, inertia=(1, 1, 1)) for name in ("first", "second"))
    m.free("base", m.ground, first)
    joint = JOINTS[kind]
    options: dict[str, Any] = {}
    if joint.has_axes:
        options["axes"] = axis
    elif joint.has_axis:
        options["axis"] = axis
    if joint.role == "loop":
        m.free("other", m.ground, second)
    for name, field in joint.options.items():
        if field.kind == "shape":
            own = [f"j{c.suffix}" for c in joint.coordinates[: field.own]]
            options[name] = [str(x).format(s=own[0], a=own[0], b=own[-1]) for x in SHAPES[name]]
        elif field.required:
            options[name] = 0.3
    getattr(m, kind)("j", first, second, **options)
    return m


def told(kind: str, axis: Any) -> tuple[str, str]:
    """The sentence of the joint, and its axis in the table."""
    section = model(kind, axis).derive().explain("short").sections[0]
    sentence = next(p.text for p in section.pieces if isinstance(p, Sentence) and p.text.startswith(f"A {kind} joint"))
    (table,) = (p for p in section.pieces if isinstance(p, Table))
    assert table.head[4] == "axis"
    return sentence, next(row[4] for row in table.rows if row[0] == "`j`")


@pytest.mark.parametrize("kind", [kind for kind in JOINTS if kind != "weld"])
def test_every_kind_tells_its_axis(kind: str) -> None:
    joint = JOINTS[kind]
    if not (joint.has_axis or joint.has_axes):
        sentence, axis = told(kind, None)
        assert axis == ""
        assert not re.search(r"\{[xyz]\}", sentence.split("$")[0])
        return
    for given in (["y", "z"], ["-x", "z"]) if joint.has_axes else ("x", "-y"):
        sentence, axis = told(kind, given)
        assert axis == (", ".join(given) if joint.has_axes else given)
        words = re.findall(r"ax[ie]s (-?[xyz])\b", sentence)
        last = given[-1] if joint.has_axes else given
        assert words[-1:] == [last]
        formula = sentence.split("$")[-2]
        assert f"{{{last}}}" in formula or kind in ("inline", "parallel", "revolute_spherical")


def test_a_skew_axis_is_given_by_its_numbers() -> None:
    sentence, axis = told("revolute", (0.6, 0, 0.8))
    assert axis == "(0.6, 0, 0.8)"
    assert r"the axis $\mathbf{n}_z$ = (0.6, 0, 0.8)" in sentence
    assert r"\mathbf{R}_{\mathbf{n}_z}(q)" in sentence
    assert r"q \mathbf{n}_z$" in told("prismatic", (0.6, 0, 0.8))[0]


def test_joints_of_one_kind_and_several_axes_have_a_sentence_each() -> None:
    m = eg.Model("arm", gravity=(0, 0, -9.81))
    first, second = (m.body(name, mass=1.0, inertia=(1, 1, 1)) for name in ("first", "second"))
    m.revolute("yaw", m.ground, first, axis="z")
    m.revolute("pitch", first, second, axis="y")
    text = m.derive().explain("short").markdown
    assert text.count("A revolute joint: S turns about the axis z ") == 1
    assert text.count("A revolute joint: S turns about the axis y ") == 1
