"""What force elements exert on bodies, ``force(track, on=wheel).x``, by Newton and Euler; contacts in model files."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from model_files import load, schema_faults
from refusals import refuses

import eomgen as eg

G = 9.81
MASS, INERTIA = 1.4, (0.02, 0.03, 0.04)
COM = (0.02, -0.01, 0.03)
ELEMENTS = ("pull", "drag", "mount", "jet", "wheel", "touch")
PARTS = ("x", "y", "z", "mx", "my", "mz")


def craft(seen: str = "") -> eg.Model:
    """A body under many elements, whose motion Newton and Euler give from all of them."""
    m = eg.Model("craft", gravity=(0, 0, -G))
    a = m.body("a", mass=MASS, com=COM, inertia=INERTIA)
    b = m.body("b", mass=0.7, inertia=(0.01, 0.01, 0.02))
    a.marker("c", at=COM)
    m.free("fly", m.ground, a, rotation="euler_parameters")
    m.free("glide", m.ground, b, rotation="euler_parameters")
    m.spring("pull", m.ground.at(0, 0, 1), a.at(0.1, 0.05, 0), stiffness=40, length=0.3)
    m.damper("drag", a.at(-0.1, 0, 0.02), b, damping=3)
    m.bushing("mount", a.at(0, 0.1, 0, rpy=(0.1, 0.2, 0.3)), b.at(0, 0, 0.1), stiffness=[30, 20, 10, 1, 2, 3])
    m.force("jet", a.at(0.05, 0, 0), (1, 2, 3), axes="body")
    m.torque("wheel", a, (0.1, -0.2, 0.3), axes="body")
    ball = {"shape": "sphere", "on": a, "radius": 0.2}
    law = {"stiffness": 2e3, "dissipation": 0.3, "friction": 0.4, "smoothing": 0.01}
    m.contacts("touch", ball, {"shape": "half_space", "on": m.ground}, law)
    for name in ELEMENTS:
        for part in PARTS:
            m.output(f"{name}_{part}", f"force({name}, on=a.c{seen}).{part}")
    for axis in "xyz":
        m.output(f"a_{axis}", f"a{axis}(a.c)")
        m.output(f"w_{axis}", f"w{axis}_body(a)")
        m.output(f"t_{axis}", f"w{axis}_body_dot(a)")
        for element in ("touch", "mount"):
            m.output(
                f"on_other_{element}_{axis}", f"force({element}, on={'ground' if element == 'touch' else 'b'}).{axis}"
            )
    return m


def states(mod: eg.Module, count: int) -> list[np.ndarray]:
    """Random ones, in which the ball is pressed into the floor."""
    rng, found = np.random.default_rng(1), []
    for _ in range(count):
        x = mod.x0(fly_z=0.15, glide_x=0.3)
        x[: mod.n_q] += 0.05 * rng.uniform(-1, 1, mod.n_q)
        x[mod.n_q :] = 0.3 * rng.standard_normal(mod.n_v)
        found.append(mod.project(x))
    return found


@pytest.mark.parametrize("method", ["recursive", "embedding"])
def test_newton_and_euler(method: str) -> None:
    ground = craft().compile(method=method, target="numpy")
    body = craft(", in=a").compile(method=method, target="numpy")
    pressed = 0
    for x in states(ground, 8):
        out = dict(zip(ground.y_names, ground.outputs(0.0, x), strict=True))
        own = dict(zip(ground.y_names, body.outputs(0.0, x), strict=True))

        def of(found: dict[str, float], ending: str) -> np.ndarray:
            return np.array([found[f"{ending}_{k}"] for k in "xyz"])

        total = sum(np.array([out[f"{name}_{part}"] for part in PARTS]) for name in ELEMENTS)
        seen = sum(np.array([own[f"{name}_{part}"] for part in PARTS]) for name in ELEMENTS)
        np.testing.assert_allclose(total[:3] - (0, 0, MASS * G), MASS * of(out, "a"), rtol=1e-9, atol=1e-9)
        spin, turn = of(out, "w"), of(out, "t")
        euler = np.array(INERTIA) * turn + np.cross(spin, np.array(INERTIA) * spin)
        np.testing.assert_allclose(seen[3:], euler, rtol=1e-9, atol=1e-9)
        assert np.linalg.norm(seen[:3]) == pytest.approx(np.linalg.norm(total[:3]), rel=1e-12)
        for element in ("touch", "mount"):  # action and reaction
            np.testing.assert_allclose(of(out, f"on_other_{element}"), -of(out, element), rtol=1e-12, atol=1e-12)
        pressed += out["touch_z"] > 1
    assert pressed > 4


@pytest.mark.thorough
def test_it_is_written_again_and_verified(tmp_path: Path) -> None:
    file = tmp_path / "craft.yaml"
    m = craft(", in=a.c")
    m.initial(fly_z=0.15, glide_x=0.3)
    file.write_text(m.to_yaml())
    mod, again = m.compile(target="numpy"), eg.load(file).compile(target="numpy")
    x = mod.x0()
    assert np.array_equal(mod.outputs(0.0, x), again.outputs(0.0, x))
    report = mod.verify()
    assert report.ok, report


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("force(touch, on=a)", "EG-EXPRESSION parts"),
        ("force(touch, on=nobody).x", "EG-NAME-UNKNOWN nobody"),
        ("force(tuch, on=a).x", "EG-NAME-UNKNOWN tuch"),
        ("force(touch, on=a).q", "EG-EXPRESSION q part"),
        ("force(touch, on=a, in=b).size", "EG-EXPRESSION axes"),
        ("force(touch, by=a).x", "EG-EXPRESSION on=marker).part"),
        ("force(touch).x", "EG-EXPRESSION on=marker"),
        ("force(touch).mz", "EG-EXPRESSION body"),
        ("force(touch, in=a).x", "EG-EXPRESSION on=marker"),
        ("force(touch, on=b).x", "EG-UNSUPPORTED touch b"),
        ("force(turn, on=b).x", "EG-UNSUPPORTED turn"),
    ],
)
def test_what_is_wrong_is_reported(text: str, told: str) -> None:
    m = craft()
    hub = m.body("hub", mass=1, inertia=INERTIA)
    m.revolute("hinge", m.ground, hub)
    m.joint_spring("turn", "hinge", stiffness=1.0)
    m.output("bad", text)
    refuses(f"{told} outputs.bad.expression:", m.compile, target="numpy")


def test_forces_that_read_each_other_are_refused() -> None:
    m = eg.Model("circle")
    body = m.body("body", mass=1, inertia=INERTIA)
    m.free("fly", m.ground, body)
    m.force("one", body, ("force(two, on=body).x", 0, 0))
    m.force("two", body, ("force(one, on=body).x", 0, 0))
    refuses("EG-CIRCLE forces.two", m.compile, target="numpy")


# -- contacts in files ------------------------------------------------------------------------------------------------
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


CIRCLES, BOXES, FLOOR, LAST = (
    "first: [{shape: circle, on: [a, b], radius: r}]",
    "first: [{shape: box, on: [a, b], size: [r, 2*r]}]",
    "{shape: half_plane, on: ground}",
    "law: {stiffness: 1e5}",
)
POINTS = "first: [{{shape: polygon, on: [a, b], points: {}}}]"
FAULTS = [
    ("friction: mu", "friction: -0.1", "EG-RANGE contacts.floor.law.friction heap.yaml 14 -0.1 0"),
    (CIRCLES, CIRCLES.replace("circle", "circel"), "EG-CHOICE contacts.floor.first[0].shape circel 'circle'?"),
    (CIRCLES, "first: []", "EG-MISSING contacts.floor.first"),
    (CIRCLES, CIRCLES.replace("b]", "c]"), "EG-NAME-UNKNOWN contacts.floor.first[0].on[1] c b"),
    (LAST, "law: 3", "EG-TYPE contacts.among.law"),
    (LAST, "", "EG-MISSING contacts.among"),
    (LAST, "law: {stiffness: 1, stifness: 1}", "EG-NAME-UNKNOWN contacts.among.law.stifness"),
    (FLOOR, "{shape: half_space, on: ground}", "EG-CONFLICT contacts.floor.second half_space"),
    (FLOOR, "{shape: circle, on: a, radius: r}", "EG-CONFLICT contacts.floor.second a"),
    (LAST, "law: {law: {stiffness: 1}}", "EG-NAME-UNKNOWN contacts.among.law.law stiffness heap.yaml 17"),
    (LAST, "law: {type: lineer, stiffness: 1}", "EG-CHOICE contacts.among.law.type lineer 'linear'?"),
    (LAST, "law: {stiffness: 1, damping: 1}", "EG-CONFLICT contacts.among.law.damping linear hunt_crossley"),
    (LAST, "law: {stiffness: 1}\n    stiffness: 2", "EG-CONFLICT contacts.among.stiffness"),
    (LAST, LAST + "\n    friction: {dynamic: -1, smoothing: 1}", "EG-RANGE contacts.among.friction.dynamic 18 -1"),
    (LAST, LAST + "\n    friction: {dynamic: 1}", "EG-MISSING contacts.among.friction.smoothing 18"),
    (LAST, LAST + "\n    friction: 0.2", "EG-MISSING contacts.among.smoothing"),
    (LAST, LAST + "\n    soil: {type: dry_sand}", "EG-CONFLICT contacts.among.law.stiffness soil"),
    (LAST, "soil: {type: dry_sent}", "EG-CHOICE contacts.among.soil.type 'dry_sand'?"),
    (LAST, "law: hertz", "EG-TYPE contacts.among.law hertz, ...}"),
    (LAST, LAST + "\n    stifness: 1", "EG-NAME-UNKNOWN contacts.among.stifness 'stiffness'?"),
    (LAST, "law: {stiffness: 1, friction: {dynamic: 1}}", "EG-CONFLICT contacts.among.law.friction beside"),
    (LAST, "law: {stiffness: 1, cohesion: 1}", "EG-CONFLICT contacts.among.law.cohesion soil"),
    (LAST, "stiffness: 1\n    damping: 1", "EG-CONFLICT contacts.among.damping 18 dissipation"),
    (LAST, "stiffness: 1\n    lateral: false\n    rebound: 1", "EG-CONFLICT contacts.among.rebound 19 soil"),
    (LAST, "law: {stiffness: r}", "EG-DIMENSION contacts.among.law.stiffness"),
    (BOXES, BOXES.replace("[a, b]", "a"), "EG-CONFLICT contacts.among"),
    (BOXES, POINTS.format("[[0, 0], [1, 0], [0.2, 0.2], [0, 1]]"), "EG-RANGE contacts.among.first[0].points"),
    (BOXES, POINTS.format("[[0, 0], [1, 0], [2, 0], [0, 1]]"), "EG-RANGE contacts.among.first[0].points[1]"),
]


@pytest.mark.parametrize(("old", "new", "message"), FAULTS)
def test_faults_of_files(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in FILE
    refuses(message, lambda: load(tmp_path, FILE.replace(old, new), "heap.yaml").check())


ALL_AT_ONCE = [
    ("stiffness: 1\n    cohesion: 1", "cohesion"),
    ("moduli: [1, 1]\n    poisson: [0.3, 0.3]", "moduli poisson"),
    ("normal_law: foo\n    moduli: 3\n    poisson: -1", "normal_law"),
    ("normal_law: foo\n    stiffness: -1\n    velocity: -1", "restitution normal_law stiffness velocity"),
    ("stiffness: 1\n    friction_law: foo\n    friction: -1", "smoothing friction_law friction"),
    ("friction: -1\n    smoothing: -1", " friction smoothing"),
    ("law: 3\n    friction: {dynamic: -1, smoothing: 1}", "law friction.dynamic"),
    ("law: {type: rigid}\n    friction: {viscous: 1, static: 1, type: coulomb, stribeck: 1}",
     "friction.viscous friction.static friction.type friction.stribeck"),
]  # fmt: skip


@pytest.mark.parametrize(("writing", "keys"), ALL_AT_ONCE)
def test_all_faults_of_laws_are_reported_in_order_at_their_keys(tmp_path: Path, writing: str, keys: str) -> None:
    with pytest.raises(eg.ModelError) as caught:
        load(tmp_path, FILE.replace(LAST, writing)).check()
    places = [f"contacts.among.{key}".removesuffix(".") for key in keys.split(" ")]
    assert [problem.path for problem in caught.value.problems] == places


TOGETHER = "law: {stiffness: 1e5, dissipation: 0.3, friction: mu, smoothing: 0.001}"
WRITINGS = (
    "law: {type: hunt_crossley, stiffness: 1e5, dissipation: 0.3}\n    friction: {dynamic: mu, smoothing: 0.001}",
    "stiffness: 1e5\n    dissipation: 0.3\n    friction: mu\n    smoothing: 0.001",
    "law: {stiffness: 1e5, dissipation: 0.3}\n    friction: mu\n    friction_law: coulomb\n    smoothing: 0.001",
)


@pytest.mark.parametrize("writing", WRITINGS)
def test_all_writings_of_a_law_are_one_model(tmp_path: Path, writing: str) -> None:
    models = [load(tmp_path, FILE), load(tmp_path, FILE.replace(TOGETHER, writing))]
    models += [load(tmp_path, model.to_yaml()) for model in models]
    digests = [m.compile(target="numpy", kernels=["poses"]).metadata["model_digest"] for m in models]
    assert len({*digests}) == 1


ONE_BY_ONE = [
    (
        {"normal_law": "linear", "stiffness": 1e5, "damping": 3},
        {"law": {"type": "linear", "stiffness": 1e5, "damping": 3}},
    ),
    (
        {"stiffness": 1e5, "friction": 0.3, "friction_law": "brown_mcphee", "static_friction": 0.4, "transition": 0.1},
        {"law": {"stiffness": 1e5},
         "friction": {"type": "brown_mcphee", "dynamic": 0.3, "static": 0.4, "transition": 0.1}},
    ),
    (
        {"stiffness": 1e5, "friction": 0.3, "friction_law": "lugre", "bristle_stiffness": 9, "bristle_damping": 8,
         "viscous_friction": 0.1, "lateral": False},
        {"law": {"stiffness": 1e5},
         "friction": {"type": "lugre", "dynamic": 0.3, "stiffness": 9, "damping": 8, "viscous": 0.1, "lateral": False}},
    ),
    (
        {"normal_law": "rigid", "friction": 0.3, "restitution": 0.1},
        {"law": {"type": "rigid", "restitution": 0.1}, "friction": {"dynamic": 0.3}},
    ),
    (
        {"soil": "dry_sand", "dissipation": 1.0, "lateral": False},
        {"soil": {"type": "dry_sand", "dissipation": 1.0, "lateral": False}},
    ),
]  # fmt: skip


@pytest.mark.parametrize(("single", "parts"), ONE_BY_ONE)
def test_keys_one_by_one_are_those_of_laws(single: dict[str, Any], parts: dict[str, Any]) -> None:
    digests = set()
    for keys in (single, {"law": single}, parts):
        m = eg.Model("shoe", gravity=(0, -9.81, 0))
        body = m.body("shoe", mass=1, inertia={"zz": 0.01})
        m.planar("j", m.ground, body)
        shape: dict[str, Any] = {"shape": "circle", "radius": 0.1}
        if "soil" in keys or "soil" in keys.get("law", ()):
            shape = {"shape": "plate", "length": 0.3, "width": 0.2}
        m.contacts("floor", {**shape, "on": body}, {"shape": "half_plane", "on": m.ground}, **keys)
        digests.add(m.compile(target="numpy", kernels=["poses"]).metadata["model_digest"])
        assert schema_faults(m) == []
    assert len(digests) == 1


def test_a_stiffness_may_stand_in_the_place_of_its_law() -> None:
    digests = list[list[str]]()
    for k in (3e5, {"stiffness": 3e5}):
        digests.append([])
        for kind, *rest in (("point_plane", k), ("sphere_plane", 0.1, k), ("sphere_sphere", (0.1, 0.2), k)):
            m = eg.Model("w")
            ball = m.body("ball", mass=1, inertia=(1, 1, 1))
            m.free("j", m.ground, ball)
            getattr(m, kind)("t", m.ground, ball, *rest, friction=0.3, smoothing=1e-3)
            m.revolute("r", ball, m.body("arm", mass=1, inertia=(1, 1, 1)))
            m.stop("s", "r", k, 0, 2.6)
            m.point_plane("u", m.ground, ball, law={}, stiffness=3)
            digests[-1].append(m.compile(target="numpy", kernels=["poses"]).metadata["model_digest"])
    assert digests[0] == digests[1]
    with pytest.raises(TypeError, match=r"friction behind the stiffness, a mapping; give keys of a law by keyword"):
        m.point_plane("v", m.ground, ball, 1e6, 1.5)
    with pytest.raises(TypeError, match=r"too many .*; give keys of a law by keyword"):
        m.point_plane("v", m.ground, ball, 1e6, 1.5, 0.2)


def test_the_schema_knows_the_friction_of_rigid_bodies() -> None:
    for law, friction, places in (
        ("rigid", "{dynamic: 0.3}", []),
        ("rigid", "{dynamic: 0.3, smoothing: 1}", ["contacts.among.friction"]),
        ("linear, stiffness: 1", "{dynamic: 0.3, smoothing: 1}", []),
        ("linear, stiffness: 1", "{dynamic: 0.3}", ["contacts.among.friction"]),
    ):
        text = FILE.replace(TOGETHER, LAST).replace(
            LAST + "\ninitial", f"law: {{type: {law}}}\n    friction: {friction}\ninitial"
        )
        assert schema_faults(text) == places


def test_faults_of_contacts_in_python_are_reported_at_the_line_of_the_call() -> None:
    m = eg.Model("w")
    ball = m.body("ball", mass=1, inertia=(1, 1, 1))
    m.free("j", m.ground, ball)
    m.point_plane("first", m.ground, ball, "zz")
    m.contacts(
        "floor",
        {"shape": "sphere", "radius": 1, "on": ball},
        {"shape": "half_space", "on": m.ground},
        {"stiffness": "zz"},
    )
    with pytest.raises(eg.ModelError) as caught:
        m.check()
    one, two = caught.value.problems
    assert (one.path, two.path) == ("forces.first.law.stiffness", "contacts.floor.law.stiffness")
    assert (two.file, two.line) == (one.file, one.line + 1)
    assert one.file == __file__


@pytest.mark.parametrize(
    ("writing", "place"),
    [("law: {stiffness: -1}", "law.stiffness 8"), ("friction: -1\n        law: {stiffness: 1}", "friction 8 -1")],
)
def test_a_law_of_a_component_is_reported_where_it_is_written(tmp_path: Path, writing: str, place: str) -> None:
    text = f"""\
name: two
components:
  leg:
    bodies: {{foot: {{mass: 1}}}}
    joints: {{j: {{type: prismatic, between: [ground, foot]}}}}
    forces:
      sole:
        {writing}
        type: point_plane
        between: [ground, foot]
add: {{left: {{component: leg}}, right: {{component: leg}}}}
"""
    refuses(f"EG-RANGE components.leg.forces.sole.{place} left right", load(tmp_path, text).check)
