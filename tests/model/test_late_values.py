"""Numbers that elements do not allow: as a number, as a declared parameter and given late, one refusal at one place."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from model_files import faults, load

import eomgen as eg

BASE = """
name: scene
PARAMETERS
bodies:
  a: {mass: 1, inertia: {zz: 0.1}}
  b: {mass: 1, inertia: {zz: 0.1}}
  c: {mass: 1, inertia: [0.1, 0.1, 0.1]}
  d: {mass: 1, inertia: {zz: 0.1}}
  BODIES
joints:
  ja: {type: revolute, between: [ground, a], coordinate: alpha}
  jb: {type: revolute, between: [ground, b], coordinate: beta}
  jc: {type: free, between: [ground, c]}
  JOINTS
"""
CIRCLE, FLOOR = "{shape: circle, on: a, radius: 0.1}", "{shape: half_plane, on: ground}"
SHAPE = "{type: contacts, stiffness: 1e4, second: [{shape: half_plane, on: ground}], first: [{on: a, "
SPACE = SHAPE.replace("half_plane", "half_space")
SPHERES = "{type: sphere_sphere, between: [a, b], normal_law: hertz, radii: [0.1, 0.1], "
RUB = "stiffness: 1e4, friction: 0.3, smoothing: 0.01, "
LUGRE = "stiffness: 1e4, friction_law: lugre, friction: 0.3, bristle_damping: 10, "
TYRE = "{type: tyre, between: [ground, a], radius: 0.3, stiffness: 2e5, "
NOT_POSITIVE, NEGATIVE = (0.0, -1.5), (-1.5,)
#: Keys of a contact between a circle and a plane.
CONTACTS: list[tuple[str, str, float, tuple[float, ...]]] = [
    ("stiffness: @", "stiffness", 1e4, NOT_POSITIVE),
    ("stiffness: 1e4, exponent: @", "exponent", 1.0, (0.5, -1.0)),
    ("stiffness: 1e4, dissipation: @", "dissipation", 0.0, NEGATIVE),
    ("stiffness: 1e4, restitution: @, velocity: 1", "restitution", 1.0, (0.0, -0.1, 1.2)),
    ("stiffness: 1e4, restitution: 0.5, velocity: @", "velocity", 0.1, NOT_POSITIVE),
    ("normal_law: rigid, friction: @", "friction", 0.0, NEGATIVE),
    ("stiffness: 1e4, friction: 0.3, smoothing: @", "smoothing", 0.1, NOT_POSITIVE),
    (f"{RUB}static_friction: @, stribeck: 0.1", "static_friction", 0.3, (0.2, -0.1)),
    (f"{LUGRE}bristle_stiffness: @", "bristle_stiffness", 1.0, NOT_POSITIVE),
]
#: Section, an entry with a number in it, where its fault is told, one that is allowed, and some that are not.
CASES: list[tuple[str, str, str, float, tuple[float, ...]]] = [
    *(
        ("forces", f"{{type: contacts, first: [{CIRCLE}], second: [{FLOOR}], {keys}}}", *rest)
        for keys, *rest in CONTACTS
    ),
    ("forces", SHAPE + "shape: circle, radius: @}]}", "first[0].radius", 0.1, NOT_POSITIVE),
    ("forces", SPACE + "shape: ellipsoid, semi_axes: [0.1, 0.2, @]}]}", "first[0].semi_axes[2]", 0.1, NOT_POSITIVE),
    (
        "forces",
        SPACE + "shape: cuboid, size: [0.3, 0.2, 0.1], edge_radius: @}]}",
        "first[0].edge_radius",
        0.02,
        (0.06,),
    ),
    (
        "forces",
        SHAPE + "shape: polygon, points: [[0, 0], [1, 0], [2, @], [0, 1]]}]}",
        "first[0].points[1]",
        0.5,
        (0.0,),
    ),
    ("forces", "{type: stop, joint: ja, lower: 0.2, upper: @, stiffness: 10}", "upper", 1.0, (0.2, 0.1)),
    ("forces", "{type: sphere_plane, between: [ground, a], radius: @, stiffness: 1}", "radius", 0.1, NOT_POSITIVE),
    ("forces", SPHERES + "moduli: [1e9, @], poisson: [0.3, 0.3]}", "moduli[1]", 1e9, NOT_POSITIVE),
    ("forces", SPHERES + "moduli: [1e9, 1e9], poisson: [@, 0.3]}", "poisson[0]", 0.5, (-1.0, 0.6)),
    ("forces", "{type: friction, joint: ja, viscous: @}", "viscous", 0.0, NEGATIVE),
    (
        "forces",
        "{type: friction, joint: ja, coulomb: 1, smoothing: 1, static: @, stribeck: 1}",
        "static",
        1.0,
        (0.9, -0.1),
    ),
    ("forces", "{type: point_gravity, center: ground, body: c, mu: @}", "mu", 1.0, NOT_POSITIVE),
    ("forces", TYRE + "relaxation: [0.1, @], law: magic_formula}", "relaxation[1]", 0.1, NOT_POSITIVE),
    (
        "forces",
        TYRE + "relaxation: [0.3, 0.2], law: brush, friction: 1, slip_stiffness: @}",
        "slip_stiffness",
        1.0,
        (0.0,),
    ),
    (
        "forces",
        "{type: creep, between: [ground, a], radius: @, longitudinal: 1, lateral: 1}",
        "radius",
        0.2,
        NOT_POSITIVE,
    ),
    ("constraints", "{type: gear, joints: [ja, jb], radii: [@, 0.1]}", "radii[0]", 0.2, NOT_POSITIVE),
    ("constraints", "{type: planetary, sun: ja, carrier: jb, radii: {sun: 0.1, ring: @}}", "radii", 0.3, (0.05,)),
    ("constraints", "{type: rolling, wheel: c, plane: ground, shape: sphere, radius: @}", "radius", 0.2, NOT_POSITIVE),
    ("joints", "{type: distance, between: [a, c], length: @}", "length", 0.2, NOT_POSITIVE),
    ("joints", "{type: screw, between: [ground, d], pitch: @}", "pitch", -0.2, (0.0,)),
    ("joints", "{type: revolute, between: [ground, d], armature: @}", "armature", 0.0, NEGATIVE),
    ("bodies", "{mass: @, inertia: [1, 1, 1]}", "mass", 0.5, NEGATIVE),
    ("bodies", "{mass: 1, inertia: [@, 1, 1]}", "inertia", 1.5, (-1.0, 2.5)),
    ("states", "{sampled: alpha, period: @}", "period", 0.1, NOT_POSITIVE),
]


def scene(section: str, entry: str, value: Any, declared: Any = None) -> str:
    """Two links on the ground and two bodies, with the element of a case."""
    inner = value if isinstance(value, str) else repr(value)
    entry = entry.replace("@", inner)
    texts = {"parameters": "" if declared is None else f"parameters: {{p: {declared}}}"}
    texts["joints"] = f"x: {entry}" if section == "joints" else ""
    if "d]" not in texts["joints"]:
        texts["joints"] += "\n  jd: {type: weld, between: [ground, d]}"
    texts["bodies"] = f"x: {entry}" if section == "bodies" else ""
    texts["joints"] += "\n  jx: {type: free, between: [ground, x]}" if section == "bodies" else ""
    text = BASE
    for key, given in texts.items():
        text = text.replace(key.upper(), given)
    return text if section in ("joints", "bodies") else f"{text}\n{section}: {{x: {entry}}}\n"


@pytest.mark.parametrize(
    ("section", "entry", "place", "good", "bad"), CASES, ids=[f"{c[0]}-{c[2]}-{k}" for k, c in enumerate(CASES)]
)
def test_one_refusal_however_a_number_is_given(
    section: str, entry: str, place: str, good: float, bad: tuple[float, ...], tmp_path: Path
) -> None:
    place = f"{section}.x.{place}"
    assert faults(tmp_path, scene(section, entry, good)) == []
    model = load(tmp_path, scene(section, entry, "p", good))
    module = model.compile(target="numpy", kernels=["poses"])
    for value in bad:
        number = {p.path for p in faults(tmp_path, scene(section, entry, value))}
        assert any(path.startswith(place) for path in number), number
        assert {p.path for p in faults(tmp_path, scene(section, entry, "p", value))} == number
        with pytest.raises(eg.ParameterError) as late:
            module.bind(p={"p": value})
        told = [p for p in late.value.problems if p.path.startswith(place)]
        assert told
        assert f"{value:.6g}" in str(told[0])
