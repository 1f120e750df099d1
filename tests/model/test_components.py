"""Components are what the same model written out by hand is; their faults; names with dots at every door."""

import json
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import command
import numpy as np
import pytest
from model_files import EXAMPLES, load, schema_faults
from refusals import refused, refuses
from scipy.spatial.transform import Rotation
from sweeps import part_of

import eomgen as eg

STEWART = EXAMPLES / "stewart_platform.yaml"
BY_HAND = Path(__file__).parents[1] / "reference" / "stewart_by_hand.yaml"

LINK = """
name: link
attachments: [base]
parameters: {l: 0.5, m: {value: 1, unit: kg}}
inputs: {tau: 0}
bodies: {rod: {mass: m, com: [l/2, 0, 0], inertia: {zz: m*l**2/12}, markers: {end: [l, 0, 0]}}}
joints: {hinge: {type: revolute, between: [base, rod]}}
forces:
  motor: {type: torque, joint: hinge, value: tau}
  rubber: {type: torsional_element, joint: hinge, law: -0.1*angle - 0.2*hinge_dot}
outputs: {end_x: x(rod.end), base_x: x(base)}
initial: {hinge: 0.2}
"""
ARM = """
name: arm
gravity: [0, -g, 0]
parameters: {g: 9.81, s: 0.8}
inputs: {u: 0}
bodies: {cart: {mass: 3, markers: {top: [0.1, 0.2, 0]}}}
joints: {rail: {type: prismatic, between: [ground, cart], axis: x}}
components:
  link: {file: parts/link.yaml}
  limb:
    attachments: [root]
    parameters: {L: 1, k: 2*L}
    add:
      upper: {component: link, at: root, parameters: {l: L}}
      lower: {component: link, at: upper.rod.end, parameters: {l: L/2, m: 0.7}, inputs: {tau: k*u}}
    outputs: {bend: upper.hinge - lower_hinge, foot: y(lower.rod.end)}
add:
  left: {component: limb, at: cart.top, parameters: {L: s}, initial: {upper.hinge: 0.4}}
  right: {component: limb, at: {body: cart, at: [-0.1, 0.2, 0]}, parameters: {L: 2}}
outputs: {gap: x(left.lower.rod.end) - x(right_lower_rod.end), angle_sum: left.upper.hinge + left_lower_hinge}
initial: {left.lower.hinge: -0.3, rail: 0.1}
"""
BY_HAND_ARM = """
name: arm
gravity: [0, -g, 0]
parameters: {g: 9.81, s: 0.8, left_upper_m: {value: 1, unit: kg}, left_lower_m: {value: 0.7, unit: kg},
  right_L: 2, right_upper_m: {value: 1, unit: kg}, right_lower_m: {value: 0.7, unit: kg}}
inputs: {u: 0, left_upper_tau: 0, right_upper_tau: 0}
bodies:
  cart: {mass: 3, markers: {top: [0.1, 0.2, 0], right_root: [-0.1, 0.2, 0]}}
  left_upper_rod: {mass: left_upper_m, com: [s/2, 0, 0], inertia: {zz: left_upper_m*s**2/12},
    markers: {end: [s, 0, 0]}}
  left_lower_rod: {mass: left_lower_m, com: [s/2/2, 0, 0], inertia: {zz: left_lower_m*(s/2)**2/12},
    markers: {end: [s/2, 0, 0]}}
  right_upper_rod: {mass: right_upper_m, com: [right_L/2, 0, 0], inertia: {zz: right_upper_m*right_L**2/12},
    markers: {end: [right_L, 0, 0]}}
  right_lower_rod: {mass: right_lower_m, com: [right_L/2/2, 0, 0], inertia: {zz: right_lower_m*(right_L/2)**2/12},
    markers: {end: [right_L/2, 0, 0]}}
joints:
  rail: {type: prismatic, between: [ground, cart], axis: x}
  left_upper_hinge: {type: revolute, between: [cart.top, left_upper_rod]}
  left_lower_hinge: {type: revolute, between: [left_upper_rod.end, left_lower_rod]}
  right_upper_hinge: {type: revolute, between: [{body: cart, at: [-0.1, 0.2, 0]}, right_upper_rod]}
  right_lower_hinge: {type: revolute, between: [right_upper_rod.end, right_lower_rod]}
forces:
  left_upper_motor: {type: torque, joint: left_upper_hinge, value: left_upper_tau}
  left_upper_rubber: {type: torsional_element, joint: left_upper_hinge, law: -0.1*angle - 0.2*left_upper_hinge_dot}
  left_lower_motor: {type: torque, joint: left_lower_hinge, value: 2*s*u}
  left_lower_rubber: {type: torsional_element, joint: left_lower_hinge, law: -0.1*angle - 0.2*left_lower_hinge_dot}
  right_upper_motor: {type: torque, joint: right_upper_hinge, value: right_upper_tau}
  right_upper_rubber: {type: torsional_element, joint: right_upper_hinge, law: -0.1*angle - 0.2*right_upper_hinge_dot}
  right_lower_motor: {type: torque, joint: right_lower_hinge, value: 2*right_L*u}
  right_lower_rubber: {type: torsional_element, joint: right_lower_hinge, law: -0.1*angle - 0.2*right_lower_hinge_dot}
outputs:
  gap: x(left_lower_rod.end) - x(right_lower_rod.end)
  angle_sum: left_upper_hinge + left_lower_hinge
  left_bend: left_upper_hinge - left_lower_hinge
  left_foot: y(left_lower_rod.end)
  left_upper_end_x: x(left_upper_rod.end)
  left_upper_base_x: x(cart.top)
  left_lower_end_x: x(left_lower_rod.end)
  left_lower_base_x: x(left_upper_rod.end)
  right_bend: right_upper_hinge - right_lower_hinge
  right_foot: y(right_lower_rod.end)
  right_upper_end_x: x(right_upper_rod.end)
  right_upper_base_x: x(cart.right_root)
  right_lower_end_x: x(right_lower_rod.end)
  right_lower_base_x: x(right_upper_rod.end)
initial: {left_upper_hinge: 0.4, left_lower_hinge: -0.3, right_upper_hinge: 0.2, right_lower_hinge: 0.2, rail: 0.1}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "link.yaml").write_text(LINK)
    return tmp_path


def same_numbers(a: eg.Model, b: eg.Model, names: dict[str, str] | None = None) -> None:
    """Same mass matrix, right-hand side and outputs to the last bit, at random states."""
    one, other = a.compile(target="numpy"), b.compile(target="numpy")
    assert [(names or {}).get(x, x) for x in one.x_names] == list(other.x_names)
    random = np.random.default_rng(3)
    start = other.x0()
    np.testing.assert_array_equal(one.x0(), start)
    for _ in range(5):
        x = one.project(start + 0.05 * random.normal(size=start.size))
        u = random.normal(size=len(one.u_names))
        np.testing.assert_array_equal(one.mass_matrix(x[: one.n_q]), other.mass_matrix(x[: one.n_q]))
        np.testing.assert_array_equal(one.rhs(0.3, x, u=u), other.rhs(0.3, x, u=u))
        np.testing.assert_array_equal(one.outputs(0.3, x, u=u), other.outputs(0.3, x, u=u))


def test_nested_components_are_the_model_by_hand(folder: Path) -> None:
    made, by_hand = load(folder, ARM), load(folder, BY_HAND_ARM, "hand.yaml")
    same_numbers(made, by_hand)
    written = load(folder, made.to_yaml(), "again.yaml")
    digests = [m.compile(target="numpy", kernels=["poses"]).metadata["model_digest"] for m in (made, written)]
    assert digests[0] == digests[1]


def test_stewart_is_a_third_as_long_and_the_same() -> None:
    text, by_hand = STEWART.read_text(), BY_HAND.read_text()
    assert 3 * len(text) <= len(by_hand)
    assert 3 * len(text.splitlines()) <= len(by_hand.splitlines())
    made, hand = eg.load(STEWART), eg.load(BY_HAND)
    hand.guess = {}
    parts = ("swing", "tilt", "length")
    names = {f"leg{k}_{n}{r}": f"{n}_{k}{r}" for k in range(1, 7) for n in parts for r in ("", "_dot")}
    same_numbers(made, hand, names)


def test_python_and_yaml_agree(folder: Path) -> None:
    """The same arm from Python, its components Models and a file."""
    link = eg.load(folder / "parts" / "link.yaml")
    limb = eg.Model("limb")
    root, length = limb.attachment("root"), limb.parameter("L", 1)
    k = limb.parameter("k")
    drive = limb.input("u")
    upper = limb.add(link, "upper_", at=root, l=length)
    limb.add(
        folder / "parts" / "link.yaml", prefix="lower_", at=upper.marker("rod.end"), l=length / 2, m=0.7, tau=k * drive
    )
    m = eg.Model("arm", gravity=(0, "-g", 0))
    m.parameter("g", 9.81)
    s, u = m.parameter("s", 0.8), m.input("u", 0)
    cart = m.body("cart", mass=3)
    m.prismatic("rail", m.ground, cart, axis="x")
    m.add(limb, prefix="left_", at=cart.marker("top", (0.1, 0.2, 0)), L=s, k=2 * s, u=u)
    right = m.add(limb, "right_", at=cart.at(-0.1, 0.2, 0), L=2, k="2*right_L", u=u)
    m.initial.update({"rail": 0.1, "left.upper.hinge": 0.4, "left.lower.hinge": -0.3})
    assert sorted(right.bodies) == ["lower_rod", "upper_rod"]
    assert right.joints["upper_hinge"].coordinate == right.symbol("upper_hinge")
    made = load(folder, ARM)
    one, other = m.compile(target="numpy"), made.compile(target="numpy")
    assert one.x_names == other.x_names
    x = other.x0() + 0.1
    a, b = (mod.bind(u={"u": 0.3}).rhs(0, x) for mod in (one, other))
    np.testing.assert_allclose(a, b, rtol=1e-12)


def test_legs_at_angles(tmp_path: Path) -> None:
    """A count, a range and a list; the angles are those of the loop, beside positions computed here."""
    text = """
name: star
parameters: {r: 2}
components:
  ray:
    attachments: [root]
    bodies: {tip: {mass: 1, inertia: {zz: 1}}}
    joints: {pin: {type: revolute, between: [root, tip]}}
    outputs: {here: x(tip)}
add:
  a: {component: ray, for: {k: 3}, at: {body: ground, at: [r*cos(2*pi*k/3), 0, 0]}}
  b:
    component: ray
    for: {k: {from: 0, to: 0.3, step: 0.1}, s: [1, r, -1, r/2]}
    at: {body: ground, at: [k*s, 0, 0]}
    prefix: other_
"""
    mod = load(tmp_path, text).compile(target="numpy")
    assert mod.q_names == tuple(f"{p}{k}_pin" for p, n in (("a", 3), ("other", 4)) for k in range(1, n + 1))
    wanted = [2 * np.cos(2 * np.pi * k / 3) for k in (1, 2, 3)] + [0.0, 0.2, -0.2, 0.3]
    np.testing.assert_allclose(mod.outputs(0, mod.x0()), wanted, rtol=0, atol=1e-15)


@pytest.mark.parametrize("rpy", [[0, 0, 0], [0.3, -0.2, 0.5]])
def test_ground_of_a_component_is_where_it_hangs(tmp_path: Path, rpy: list[float]) -> None:
    """A whole model hung on a body: its ground, markers of ground and places on ground follow the attachment."""
    (tmp_path / "swing.yaml").write_text("""
name: swing
gravity: [0, 0, -1]
bodies:
  ground: {markers: {hook: {at: [0, 0.5, 0], rpy: [0, 0.4, 0]}}}
  bob: {mass: 1, com: [0.2, 0, 0], inertia: [1, 2, 2.5]}
  other: {mass: 1, inertia: [1, 1, 1]}
joints:
  pin: {type: revolute, between: [ground.hook, bob]}
  rail: {type: prismatic, between: [{body: ground, at: [0.1, 0.2, 0.3], rpy: [0.1, 0, 0]}, other]}
outputs: {hook_x: x(ground.hook)}
initial: {pin: 0.3, rail: 0.2}
""")
    made = load(
        tmp_path,
        f"""
name: hung
bodies: {{car: {{mass: 1, inertia: [1, 1, 1], markers: {{m: {{at: [1, 2, 3], rpy: {rpy}}}}}}}}}
joints: {{free: {{type: free, between: [ground, car]}}}}
components: {{swing: {{file: swing.yaml}}}}
add: {{s: {{component: swing, at: car.m}}}}
initial: {{free_1: 0.2, free_y: 1}}
""",
    ).compile(target="numpy")
    poses = dict(zip(made.body_names, made.poses(made.x0()[: made.n_q]), strict=True))
    alone = eg.load(tmp_path / "swing.yaml").compile(target="numpy")
    own = dict(zip(alone.body_names, alone.poses(alone.x0()[: alone.n_q]), strict=True))
    at = np.eye(4)
    at[:3, :3], at[:3, 3] = Rotation.from_euler("xyz", rpy).as_matrix(), [1, 2, 3]
    for name in ("bob", "other"):
        np.testing.assert_allclose(poses[f"s_{name}"], poses["car"] @ at @ own[name], rtol=0, atol=1e-14)
    hook = poses["car"] @ at @ [0, 0.5, 0, 1]
    assert made.outputs(0, made.x0())[0] == pytest.approx(hook[0], abs=1e-14)


def test_an_attachment_turned_by_a_parameter_is_the_joint_by_hand(tmp_path: Path) -> None:
    """Beside a body without mass welded to the marker, on which the joint is placed; written out and read again."""
    head = """
name: hung
gravity: [0, 0, -9.81]
parameters: {a: 0.3, b: -0.2}
initial: {free_1: 0.2, free_y: 1}
outputs: {place: y(s_bob)}
"""
    car = "car: {mass: 1, inertia: [1, 1, 1], markers: {m: {at: [1, 2, 3], rpy: [a, b, 2*a]}}}"
    bob = "bob: {mass: 1, com: [0.2, 0, 0], inertia: [1, 2, 2.5]}"
    place = "{body: root, at: [0.1, 0.2, 0.3], rpy: [0.1, 0, angle]}"
    text = f"""
bodies: {{{car}}}
joints: {{free: {{type: free, between: [ground, car]}}}}
components:
  inner:
    attachments: [root]
    parameters: {{angle: 1}}
    bodies: {{{bob}}}
    joints: {{pin: {{type: revolute, between: [{place}, bob]}}}}
  outer: {{attachments: [top], add: {{i: {{component: inner, prefix: "", at: top, parameters: {{angle: 3*a}}}}}}}}
add: {{s: {{component: outer, at: car.m}}}}
"""
    by_hand = f"""
bodies: {{{car}, root: {{mass: 0}}, s_{bob}}}
joints:
  free: {{type: free, between: [ground, car]}}
  w: {{type: weld, between: [car.m, root]}}
  s_pin: {{type: revolute, between: [{place.replace("angle", "3*a")}, s_bob]}}
"""
    made = load(tmp_path, head + text)
    assert schema_faults(made.to_yaml()) == []
    models = [made, load(tmp_path, made.to_yaml(), "again.yaml"), load(tmp_path, head + by_hand, "hand.yaml")]
    one, again, hand = (m.compile(target="numpy") for m in models)
    assert one.q_names == hand.q_names
    assert one.metadata["model_digest"] == again.metadata["model_digest"]
    x, p = one.x0() + 0.1, [0.7, -0.4]
    np.testing.assert_allclose(one.rhs(0, x, p=p), hand.rhs(0, x, p=p), rtol=0, atol=1e-13)
    np.testing.assert_allclose(one.outputs(0, x, p=p), hand.outputs(0, x, p=p), rtol=0, atol=1e-14)


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_a_function_with_a_python_fallback_in_a_component(tmp_path: Path, target: str) -> None:
    source = tmp_path / "law.c"
    source.write_text("double law(double x) { return x * x; }\ndouble slope(double x) { return 2 * x; }\n")
    part = eg.Model("part")
    law = part.native(
        "law", source, derivatives=["slope"], python=lambda x: x * x, python_derivatives=[lambda x: 2 * x]
    )
    joint = part.revolute("pin", part.attachment("root"), part.body("rod", mass=1, inertia=(1, 1, 0.5)))
    part.torque("drive", joint, -law(joint.coordinate))
    whole = eg.Model("whole")
    for prefix in ("a_", "b_"):
        whole.add(part, prefix, at=whole.ground)
    module = whole.compile(target=target)
    np.testing.assert_allclose(module.rhs(0, module.x0(a_pin=0.5, b_pin=3.0))[2:], [-0.5, -18.0], rtol=1e-15)


def test_a_joint_that_closes_in_a_component_has_its_state(tmp_path: Path) -> None:
    text = """
name: pair
components:
  arm:
    attachments: [top]
    bodies: {rod: {mass: 1, inertia: {zz: 1}}}
    joints: {hinge: {type: revolute, between: [top, rod], closes: 0.25 - t}}
    outputs: {shut: hinge_closed}
add: {a: {component: arm, at: ground}, b: {component: arm, at: ground, initial: {hinge_dot: 2}}}
"""
    run = load(tmp_path, text).compile(target="numpy").simulate(0.5)
    assert [run[name][k] for name in ("a_shut", "b_shut") for k in (0, -1)] == [0, 1, 0, 1]
    assert run["b.hinge"][-1] == pytest.approx(0.5)


ADDING = [
    ("component: link, at: root", "component: lnik, at: root", "EG-NAME-UNKNOWN limb.add.upper.component: 'link'?"),
    ("{l: L}", "{q: L}", "EG-NAME-UNKNOWN :14: components.limb.add.upper.parameters.q: 'q' link"),
    ("at: cart.top,", "", "EG-MISSING :18: add.left.at.root: limb"),
    ("at: cart.top,", "at: {top: cart},", "EG-NAME-UNKNOWN :18: add.left.at.top: limb"),
    ("at: cart.top,", "at: cart.tip,", "EG-TYPE :18: add.left.at.root: 'cart.tip'"),
    ("at: cart.top,", "at: card,", "EG-NAME-UNKNOWN :18: add.left.at.root: 'card' 'cart'?"),
    ("at: [-0.1, 0.2, 0]", "at: [-0.1, 0.2]", "EG-TYPE :19: add.right.at.root.at: [-0.1, 0.2]"),
    ("component: link, at: root", "component: link, at: rot", "EG-NAME-UNKNOWN :14: limb.add.upper.at.base: 'rot'"),
    ("parts/link.yaml", "../link.yaml", "EG-FILE :9: components.link.file: ../link.yaml"),
    ("parts/link.yaml", "parts/lnik.yaml", "EG-FILE :9: components.link.file: parts/lnik.yaml"),
    ("  right:", "  left:", "EG-FILE-DAMAGED :19: add.left:"),
    ("limb, at: cart.top", "limb, for: {k: [1, 2], j: [1]}, at: cart.top", "EG-SHAPE :18: add.left.for:"),
    ("limb, at: cart.top", "limb, for: {k: 2000}, at: cart.top", "EG-TOO-LARGE :18: add.left.for.k: 1000"),
    ("  limb:\n", "  limb:\n    gravity: [0, 0, 0]\n", "EG-NAME-UNKNOWN :11: components.limb.gravity:"),
    ("  left:", "  cart:", "EG-NAME-TAKEN :18: add.cart: 'cart'"),
]


@pytest.mark.parametrize(("old", "new", "told"), ADDING)
def test_faults_of_adding(folder: Path, old: str, new: str, told: str) -> None:
    assert old in ARM
    with refused(f"{told} arm.yaml") as caught:
        load(folder, ARM.replace(old, new, 1), "arm.yaml").check()
    assert len(caught.value.problems) <= 2  # and not what follows from the missing names


@pytest.mark.parametrize("attachments", ["", "attachments: [root], "])
def test_a_wrong_attachment_is_one_fault(folder: Path, attachments: str) -> None:
    leg = "bodies: {foot: {mass: 1}}, joints: {j: {type: prismatic, between: [base, foot], axis: x}}"
    text = f"name: w\ncomponents:\n  leg: {{{attachments}{leg}}}\nadd:\n  a: {{component: leg, at: {{base: ground}}}}\n"
    with refused("EG-NAME-UNKNOWN :5: add.a.at.base: leg no attachment 'base' ground") as caught:
        load(folder, text, "legs.yaml").check()
    assert [one.path for one in caught.value.problems] == ["add.a.at.base"] + ["add.a.at.root"] * bool(attachments)


BESIDE = [  # faults elsewhere are reported together with those of an instance, and an expression where it stands
    ("at: cart.top,", "at: cart.tip,", ["EG-TYPE :18: add.left.at.root: cart.tip", "EG-NAME-UNKNOWN cart.mass: 'M'"]),
    ("at: cart.top,", "", ["EG-MISSING :18: add.left.at.root:", "EG-NAME-UNKNOWN cart.mass: 'M'"]),
    ("{L: s}", "{q: s}", ["EG-NAME-UNKNOWN :18: add.left.parameters.q:", "EG-NAME-UNKNOWN cart.mass: 'M'"]),
    ("{L: s}", "{L: 2*q}", ["EG-NAME-UNKNOWN :18: add.left.parameters.L: 'q'", "EG-NAME-UNKNOWN cart.mass: 'M'"]),
    ("{L: s}", "{L: s*g}", ["EG-DIMENSION :18: add.left.parameters.L: s*g", "EG-NAME-UNKNOWN cart.mass: 'M'"]),
]


@pytest.mark.parametrize(("old", "new", "expected"), BESIDE)
def test_faults_of_an_instance_hide_no_others(folder: Path, old: str, new: str, expected: list[str]) -> None:
    text = ARM.replace("{g: 9.81, s: 0.8}", "{g: {value: 9.81, unit: m/s^2}, s: {value: 0.8, unit: m}}")
    text = text.replace("{L: 1, k", "{L: {value: 1, unit: m}, k").replace("mass: 3", "mass: M")
    with refused(expected[0]) as caught:
        load(folder, text.replace(old, new, 1), "arm.yaml").check()
    codes = {words.split()[0] for words in expected}
    assert len(caught.value.problems) == 2
    assert {problem.code for problem in caught.value.problems} == codes
    assert any(problem.path == "bodies.cart.mass" for problem in caught.value.problems)


INSIDE = [
    ("type: revolute", "type: revolut", "EG-CHOICE joints.hinge.type: left.upper left.lower 'revolute'?"),
    ("x(rod.end)", "x(rod.ned)", "EG-NAME-UNKNOWN outputs.end_x.expression: 'left_upper_rod' 'ned'"),
    ("m*l**2/12", "m*l**2/12*s", "EG-NAME-UNKNOWN bodies.rod.inertia: 's'"),
    ("[base, rod]", "[base, cart]", "EG-NAME-UNKNOWN joints.hinge.between: 'cart'"),
    ("bodies:", "lagrangian: {coordinates: [q], expression: q_dot**2}\nbodies:", "EG-UNSUPPORTED file: lagrangian"),
    ("name: link", "name: [link", "EG-FILE-DAMAGED file: YAML"),
    ("inputs:", "colour: red\ninputs:", "EG-NAME-UNKNOWN colour:"),
]


@pytest.mark.parametrize(("old", "new", "told"), INSIDE)
def test_faults_in_the_file_of_a_component(folder: Path, old: str, new: str, told: str) -> None:
    assert old in LINK
    (folder / "parts" / "link.yaml").write_text(LINK.replace(old, new, 1))
    with refused(f"{told} {'arm' if 'lagrangian' in told else 'parts/link'}.yaml"):
        load(folder, ARM, "arm.yaml").check()


def test_a_fault_of_a_component_comes_once_and_in_its_names(tmp_path: Path) -> None:
    """Also where an instance has no joint, whose force then has no dimension to be wrong."""
    text = """name: m
components:
  hanger:
    attachments: [top]
    parameters: {k: {value: 100, unit: N/m}}
    bodies: {bob: {mass: 1, markers: {tip: [0, 0, 1]}}}
    joints: {slide: {type: prismatic, between: [top, bob], axis: x}, turn: {type: revolute, between: [tap, bob]}}
    forces:
      a: {type: joint_spring, joint: slide, stiffness: k}
      b: {type: joint_spring, joint: slid, stiffness: k}
      c: {type: torque, joint: turn, value: kk}
      d: {type: torque, joint: slide, value: force(e)}
add:
  h1: {component: hanger, at: ground}
  h2: {component: hanger, at: grund}
"""
    with refused("EG-NAME-UNKNOWN components.hanger.forces.b.joint: (in h1, h2); 'slide'? slide, turn") as caught:
        load(tmp_path, text).check()
    told = [f"{one.path}: {one.message}; {one.remedy}" for one in caught.value.problems]
    assert len(told) == 5, told
    assert told[0].endswith("between[0]: no body 'tap' (in h1, h2); bodies: ground, bob")
    assert "'kk' (in h1, h2); did you mean 'k'? known here: t, k, slide, " in told[2]
    assert "no force element 'h1_e' in column 7 of 'force(h1_e)' (in h1, h2); " in told[3]
    assert told[4].startswith("add.h2.at.top: no body 'grund'")


@pytest.mark.parametrize(("at", "told"), [("groundd", "NAME-UNKNOWN :"), ("{body: ground, at: [1]}", "TYPE .at:")])
def test_faults_of_what_shapes_are_on(tmp_path: Path, at: str, told: str) -> None:
    text = """name: m
components:
  ball:
    attachments: [floor]
    bodies: {b: {mass: 1, inertia: {zz: 1}}}
    joints: {p: {type: planar, between: [ground, b]}}
    forces:
      c: {type: contacts, first: {shape: half_plane, on: floor}, second: {shape: circle, on: b, radius: 1},
        stiffness: 9}
add:
  one: {component: ball, at: {floor: AT}}
"""
    code, place = told.split()
    with refused(f"EG-{code} :11: add.one.at.floor{place}"):
        load(tmp_path, text.replace("AT", at)).check()


def test_recursion_is_refused_with_its_cycle(folder: Path) -> None:
    text = ARM.replace("add:\n      upper:", "add:\n      more: {component: limb, at: root}\n      upper:")
    refuses("EG-CIRCLE limb,", lambda: load(folder, text).check())
    (folder / "parts" / "link.yaml").write_text(
        LINK + "components: {a: {file: link.yaml}}\nadd: {b: {component: a, at: base}}\n"
    )
    refuses("EG-CIRCLE link.yaml,", lambda: load(folder, ARM).check())


def test_sizes_are_bounded(tmp_path: Path) -> None:
    """Components within components cannot make a model of a million entries."""
    layers = "\n".join(f"  c{k}: {{add: {{x: {{component: c{k - 1}, for: {{i: 100}}}}}}}}" for k in range(1, 9))
    text = "name: m\ncomponents:\n  c0: {bodies: {b: {mass: 1}}}\n" + layers + "\nadd: {y: {component: c8}}\n"
    refuses("EG-TOO-LARGE 20000", lambda: load(tmp_path, text).check())


def test_python_refuses_at_once(folder: Path) -> None:
    link = eg.load(folder / "parts" / "link.yaml")
    m = eg.Model("m")
    refuses("EG-NAME-UNKNOWN mass", m.add, link, "a_", at=m.ground, mass=3)
    refuses("EG-MISSING base", m.add, link, "a_")
    refuses("EG-REFERENCE link", m.add, link, "a_", at=link.ground)
    refuses("EG-TYPE 3", m.add, 3)
    assert m.bodies == {}  # what was refused left nothing behind
    m.add(link, "a_", at=m.ground)
    refuses("EG-NAME-TAKEN a", m.add, link, "a_", at=m.ground)
    refuses("EG-CONFLICT attachments", link.check)


def test_the_schema_accepts_them() -> None:
    for text in (ARM, LINK, STEWART.read_text()):
        assert schema_faults(text) == []
    for old, new in (("at: root,", "at: 3,"), ("file: parts", "fil: parts"), ("component: limb, at: cart", "at: cart")):
        assert schema_faults(ARM.replace(old, new, 1)), new


# -- names with dots: ``a.q`` is taken by every door where ``a_q`` is -------------------------------------------------
TEXT = """
name: pair
gravity: [0, -9.81, 0]
components:
  arm:
    attachments: [top]
    parameters: {l: {value: 0.5, unit: m}}
    inputs: {tau: 0}
    bodies: {rod: {mass: 1, com: [0, -l/2, 0], inertia: {zz: l**2/12}, markers: {end: [0, -l, 0]}}}
    joints: {hinge: {type: revolute, between: [top, rod], coordinate: q}}
    forces: {motor: {type: torque, joint: hinge, value: tau}}
    outputs: {height: y(rod.end)}
    events: {low: {expression: q - 0.2, direction: -1}}
add:
  a: {component: arm, prefix: PREFIXa, at: ground, initial: {q: 0.3}}
  b: {component: arm, prefix: PREFIXb, at: a.rod.end}
"""
# with an underscore, as is usual, and without
PREFIXES = {f"a{mark}": TEXT.replace("PREFIXa", f"a{mark}").replace("PREFIXb", f"b{mark}") for mark in ("_", "")}
RANGE = np.linspace(0.0, 0.5, 4)


@pytest.fixture(scope="module", params=PREFIXES)
def module(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Any:
    file = tmp_path_factory.mktemp("pair") / "pair.yaml"
    file.write_text(PREFIXES[request.param], encoding="utf-8")
    return eg.load(file).compile(target="numpy")


def dotless(module: Any, text: str) -> str:
    """What the model calls ``a.q``: the prefix of the instance, and the rest."""
    underscore = "_" if "a_q" in module.q_names else ""
    return text.replace("a.", f"a{underscore}").replace("b.", f"b{underscore}")


Door = Callable[[Any, Callable[[str], str]], Any]
DOORS: dict[str, Door] = {
    "x0": lambda m, n: m.x0({n("a.q"): 0.2, n("b.q_dot"): 1.0}),
    "x0 of a place": lambda m, n: m.x0({n("a.q"): 0.2, f"x({n('b.rod.end')})": 0.3}),
    "x0 of a velocity": lambda m, n: m.x0({n("a.q"): 0.2, f"vx({n('a.rod.end')})": 0.3}),
    "x0 of an output": lambda m, n: m.x0({n("a.height"): -0.3}),
    "assemble": lambda m, n: m.assemble({n("a.q"): 0.2}),
    "branches": lambda m, n: m.branches({n("a.q"): 0.2}),
    "bind": lambda m, n: m.bind(p={n("a.l"): 0.4}, u={n("b.tau"): 1.0}).rhs(0.0, m.x0()),
    "simulate": lambda m, n: m.simulate(0.1, initial={n("a.q"): 0.2}, parameters={n("a.l"): 0.4},
                                        inputs={n("b.tau"): 0.1}).x,
    "an event": lambda m, n: m.simulate(0.5).t_events[n("a.low")],
    "an event of many": lambda m, n: m.simulate_many(0.5, {n("a.q"): [0.3]}, reduce="events").events(n("a.low"))[0],
    "text of an event": lambda m, n: m.simulate(0.5, events={"zero": f"{n('a.q')} - 0.1"}).t_events["zero"],
    "text of an input": lambda m, n: m.simulate(0.1, inputs={n("a.tau"): f"sin({n('b.q')})"}).x,
    "column": lambda m, n: m.simulate(0.1)[n("b.height")],
    "position of a run": lambda m, n: m.simulate(0.1).position(n("b.rod.end")),
    "simulate_many": lambda m, n: m.simulate_many(0.1, {n("a.q"): [0.1, 0.2]}, {n("b.l"): [0.4, 0.5]},
                                                  inputs={n("a.tau"): [0.0, 0.1]})[n("b.q")],
    "simulate_many of a place": lambda m, n: m.simulate_many(0.1, initial={f"x({n('a.rod.end')})": [0.1, 0.2]}).x,
    "grid": lambda m, n: m.simulate_many(0.1, grid={n("a.q"): [0.1, 0.2], n("b.l"): (0.4, 0.5, 2)}).x,
    "kinematic_analysis": lambda m, n: m.kinematic_analysis(**{n("a.q"): RANGE, n("b.q"): 0.1}).x,
    "a value at an equilibrium": lambda m, n: m.equilibrium({n("a.q"): 0.3})[n("a.q")],
    "equilibrium": lambda m, n: m.equilibrium({n("a.q"): 0.3}, hold={n("a.q"): 0.2}, unknowns=[n("a.tau")]).x,
    "linearize": lambda m, n: m.linearize({n("a.q"): 0.1}).A,
    "modes": lambda m, n: m.modes({n("a.q"): 0.0, n("b.q"): 0.0}).frequencies,
    "sensitivities": lambda m, n: m.sensitivities([n("a.l"), n("a.q")], 0.1).dx,
    "one sensitivity": lambda m, n: m.sensitivities([n("a.l")], 0.1)[n("a.height"), n("a.l")],
    "motion_range": lambda m, n: m.motion_range(n("a.q"), within=(-0.5, 0.5)).upper,
    "consistent": lambda m, n: m.consistent(m.x0() + 1e-3, weights={n("a.q"): 3.0}, hold=[n("b.q")]),
    "actuator_forces": lambda m, n: m.actuator_forces(0.0, m.x0(), {n("a.q"): 1.0}, actuated=[n("a.q"), n("b.q")])
    .forces,
    "fit": lambda m, n: m.fit(m.simulate(0.1, t_eval=[0.0, 0.05, 0.1]), parameters=[n("a.l")]).values,
}  # fmt: skip


@pytest.mark.parametrize("door", DOORS)
def test_calls_of_a_module(module: Any, door: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        dotted = DOORS[door](module, str)
        plain = DOORS[door](module, lambda name: dotless(module, name))
    np.testing.assert_array_equal(np.asarray(dotted), np.asarray(plain))


def test_an_instance_may_have_the_name_of_a_keyword(folder: Path) -> None:
    m = eg.Model("m")
    m.add(eg.load(folder / "parts" / "link.yaml"), "in_", at=m.ground)
    m.output("twice", "2*in.hinge")
    traj = m.compile(target="numpy").simulate(0.5, events={"zero": "in.hinge - t"})
    np.testing.assert_array_equal(traj["twice"], 2 * traj["in.hinge"])
    np.testing.assert_allclose(traj.x_events["zero"][0][0], traj.t_events["zero"][0], rtol=1e-9)


VERBS = [  # words of the command line
    "run --set a.q=0.2 --set b.l=0.4 --set b.tau=0.1 --end 0.1",
    "run --set vx(a.rod.end)=0.2 --set x(b.rod.end)=0.3 --end 0.1",
    "kinematics --range a.q=0:0.5:4 --range b.q=0:0.2:4",
    "kinematics --limits a.q",
    "ensemble --vary a.q=0:0.5 --count 3 --end 0.1",
    "ensemble --grid a.q=0:0.5:2 --grid b.l=0.4:0.5:2 --end 0.1",
    "equilibrium --hold a.q=0.2 --unknown a.tau",
    "sensitivity --by a.l --by b.q --end 0.1",
    "inverse --actuated a.q --actuated b.q --accelerate a.q=1",
    "linearize --set a.q=0.1",
    "consistent --set a.q=0.1 --hold a.q --weight b.q=3",
    "impact --stop a.q --set a.q_dot=1",
    "derive --independent a.q",
    "view --range a.q=0:0.5:4 --trace b.rod.end --plot a.q --fps 2 --out motion.gif",
]


@pytest.mark.parametrize("line", part_of(VERBS, lambda line: not line.startswith("view")))
def test_verbs_of_the_command_line(line: str, tmp_path: Path) -> None:
    words = line.split() + ["--target", "numpy"] * (line.split()[0] not in ("derive", "view"))
    prefix = list(PREFIXES)[len(words) % 2]
    (tmp_path / "pair.yaml").write_text(PREFIXES[prefix], encoding="utf-8")

    def plain(text: str) -> str:
        return text.replace("a.", prefix).replace("b.", prefix.replace("a", "b"))

    told = []
    for change in (str, plain):
        found = command.run(words[0], "pair.yaml", *map(change, words[1:]), "--json", cwd=tmp_path)
        assert found.code == 0, found.out + found.err
        told.append(plain(json.dumps(timeless(found.json))))
    assert told[0] == told[1]


def timeless(value: Any) -> Any:
    """A result without the times that it took."""
    if isinstance(value, dict):
        return {key: timeless(x) for key, x in value.items() if key not in ("seconds", "wall_seconds", "module")}
    return value
