"""The constraints section: the same from Python and from a file, faults by line, equations that can be held."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy
import yaml
from models import build
from refusals import refused, refuses

import eomgen as eg

TEXT = """\
name: everything
parameters: {r: 0.1, n: 3, k: 0.2}
inputs: {u: 1}
bodies:
  one: {mass: 1, inertia: {zz: 1}}
  two: {mass: 1, inertia: {zz: 1}}
  bar: {mass: 1}
  arm: {mass: 1, inertia: {zz: 1}}
  sat: {mass: 1, inertia: {zz: 1}}
  ball: {mass: 1, inertia: [1, 1, 1]}
joints:
  A: {type: revolute, between: [ground, one], coordinate: alpha}
  B: {type: revolute, between: [ground, two], coordinate: beta}
  C: {type: prismatic, between: [ground, bar], axis: x, coordinate: s}
  D: {type: revolute, between: [ground, arm], coordinate: gamma}
  E: {type: revolute, between: [arm, sat], coordinate: delta}
  F: {type: free, between: [ground, ball]}
constraints:
  c1: {type: coupling, coordinates: {A: 1, beta: -n}, offset: k}
  c2: {type: coupling, equation: s - r*sin(alpha) - 0.01*t}
  c3: {type: gear, joints: [A, B], teeth: [20, 60], internal: true, phase: k}
  c4: {type: planetary, sun: A, ring: B, carrier: D, planet: E, radii: {sun: r, ring: n*r}}
  c5: {type: rack, pinion: A, rack: C, radius: -r, offset: k}
  c6: {type: belt, joints: [A, B], radii: [r, 2*r], crossed: true}
  c7: {type: cam, cam: A, follower: C, lift: k + r*cos(theta), phase: 0.1, periodic: false}
  c8: {type: cam_contact, cam: one, follower: bar, shape: roller, contour: k + r*cos(theta), radius: r/9, coordinate: c}
  c9: {type: cam_contact, cam: one, follower: bar, shape: flat_face, support: k + r*cos(theta)}
  d1: {type: rolling, wheel: ball, plane: ground, radius: r, shape: sphere, no_spin: true}
  d2: {type: rolling, wheel: {body: ball, at: [0, 0, r], rpy: [k, 0, 0]}, radius: r, tube: r/8}
  d3: {type: knife_edge, marker: ball, axis: x, on: one}
  d4: {type: gear, joints: [A, B], cones: [0.5, 0.6]}
  e1: {type: driver, coordinate: A, value: k*sin(n*t) + t**2}
  e2: {type: driver, between: [ball, {body: one, at: [r, 0, 0]}], value: 1 + k*t}
  e3: {type: driver, angle: [ground, sat], value: n*t}
  e4: {type: driver, marker: ball, axis: [0, 0.6, 0.8], on: arm, value: r*t}
"""


def from_python() -> eg.Model:
    m = eg.Model("everything")
    r, n, k = m.parameter("r", 0.1), m.parameter("n", 3), m.parameter("k", 0.2)
    m.input("u", 1)
    one, two = m.body("one", mass=1, inertia={"zz": 1}), m.body("two", mass=1, inertia={"zz": 1})
    bar = m.body("bar", mass=1)
    arm, sat = m.body("arm", mass=1, inertia={"zz": 1}), m.body("sat", mass=1, inertia={"zz": 1})
    ball = m.body("ball", mass=1, inertia=(1, 1, 1))
    A = m.revolute("A", m.ground, one, coordinate="alpha")
    B = m.revolute("B", m.ground, two, coordinate="beta")
    C = m.prismatic("C", m.ground, bar, axis="x", coordinate="s")
    m.revolute("D", m.ground, arm, coordinate="gamma")
    m.revolute("E", arm, sat, coordinate="delta")
    m.free("F", m.ground, ball)
    theta = sympy.Symbol("theta")
    profile = k + r * sympy.cos(theta)
    m.coupling("c1", {A: 1, B.coordinate: -n}, offset=k)
    m.coupling("c2", equation=C.coordinate - r * sympy.sin(A.coordinate) - m.t / 100)
    m.gear("c3", A, B, teeth=(20, 60), internal=True, phase=k)
    m.planetary("c4", sun=A, ring=B, carrier="D", planet="E", radii={"sun": r, "ring": n * r})
    m.rack("c5", A, C, radius=-r, offset=k)
    m.belt("c6", A, B, radii=(r, 2 * r), crossed=True)
    m.cam("c7", A, C, lift=profile, phase=0.1, periodic=False)
    m.cam_contact("c8", one, bar, "roller", contour=profile, radius=r / 9, coordinate="c")
    m.cam_contact("c9", one, bar, "flat_face", support=profile)
    m.rolling("d1", ball, m.ground, r, shape="sphere", no_spin=True)
    m.rolling("d2", ball.at(0, 0, r, rpy=(k, 0, 0)), radius=r, tube=r / 8)
    m.knife_edge("d3", ball, axis="x", on=one)
    m.gear("d4", A, B, cones=(0.5, 0.6))
    m.driver("e1", A, k * sympy.sin(n * m.t) + m.t**2)
    m.driver("e2", between=(ball, one.at(r, 0, 0)), value=1 + k * m.t)
    m.driver("e3", angle=(m.ground, sat), value="n*t")
    m.driver("e4", marker=ball, axis=(0, 0.6, 0.8), on=arm, value=r * m.t)
    return m


def load(tmp_path: Path, text: str) -> eg.Model:
    path = tmp_path / "model.yaml"
    path.write_text(text, encoding="utf-8")
    return eg.load(path)


def plain(value: Any) -> Any:
    """The same data whatever the order of keys and of terms."""
    if isinstance(value, dict):
        return {key: plain(part) for key, part in value.items()}
    if isinstance(value, list):
        return [plain(part) for part in value]
    if not isinstance(value, str):
        return value
    names = {name: sympy.Symbol(name) for name in re.findall(r"[a-z]\w*", value) if name not in ("sin", "cos")}
    return str(sympy.nsimplify(sympy.sympify(value, locals=names), rational=True))


def test_python_and_file_say_the_same_and_both_round_trip(tmp_path: Path) -> None:
    models = [load(tmp_path, TEXT), from_python()]
    models += [load(tmp_path, m.to_yaml()) for m in models]
    first, *others = (plain(yaml.safe_load(m.to_yaml())) for m in models)
    assert len(first["constraints"]) == 17
    for other in others:
        assert other == first


BROKEN = [
    ("joints: [A, B], teeth", "joints: [A, G], teeth", 21, "EG-NAME-UNKNOWN c3.joints[1]: G"),
    ("joints: [A, B], teeth", "joints: [A, F], teeth", 21, "EG-REFERENCE c3.joints[1]: 6 F_x"),
    ("joints: [A, B], teeth", "joints: [A, C], teeth", 21, "EG-REFERENCE c3.joints[1]: 's'"),
    ("joints: [A, B], teeth", "joints: [A, E], teeth", 21, "EG-REFERENCE c3.joints: planetary"),
    ("teeth: [20, 60]", "teeth: [20, -60]", 21, "EG-RANGE c3.teeth[1]: -60"),
    ("internal: true", "internal: 1", 21, "EG-TYPE c3.internal: 1"),
    ("type: rack", "type: rak", 23, "EG-CHOICE c5.type: rak 'rack'?"),
    ("radius: -r, offset", "radius: -r, ofset: 1, offset", 23, "EG-NAME-UNKNOWN c5.ofset: 'offset'?"),
    ("coordinates: {A: 1, beta: -n}", "coordinates: {A: 1, bet: 2}", 19, "EG-NAME-UNKNOWN c1.coordinates.bet: 'beta'?"),
    ("- 0.01*t", "- ax(one)", 20, "EG-REFERENCE c2.equation: ax(one)"),
    ("- 0.01*t", "- wx(one)*wz(two)", 20, "EG-EXPRESSION c2.equation: wx(one), wz(two)"),
    ("- 0.01*t", "- kinetic_energy", 20, "EG-REFERENCE c2.equation: energies"),
    ("radii: {sun: r, ring: n*r}", "radii: {sun: 1, ring: 3, planet: 2}", 22, "EG-RANGE c4.radii: ring 3"),
    ("lift: k + r*cos(theta)", "lift: k + r*cos(alpha)", 25, "EG-REFERENCE c7.lift: alpha"),
    (", coordinate: c}", ", coordinate: beta}", 26, "EG-NAME-TAKEN c8.coordinate: 'beta'"),
    ("shape: flat_face, supp", "shape: knife_edge, supp", 27, "EG-CONFLICT c9.support:"),
    ("shape: sphere, no_spin", "shape: disc, no_spin", 28, "EG-CONFLICT d1.no_spin:"),
    ("k*sin(n*t) + t**2", "k*s", 32, "EG-REFERENCE e1.value: s"),
    ("coordinate: A, value", "coordinate: A, marker: one, value", 32, "EG-CONFLICT e1: both coordinate marker"),
    ("angle: [ground, sat]", "angle: [sat, sat]", 34, "EG-REFERENCE e3.angle:"),
    ("  d4: {", "  c3: {", 31, "EG-FILE-DAMAGED c3:"),
]


@pytest.mark.parametrize(("old", "new", "line", "demand"), BROKEN)
def test_faults(old: str, new: str, line: int, demand: str, tmp_path: Path) -> None:
    assert TEXT.count(old) == 1
    with refused(f"{demand} model.yaml:{line}:") as caught:
        load(tmp_path, TEXT.replace(old, new)).check()
    assert len({p.path for p in caught.value.problems}) == 1


def test_a_lagrangian_may_be_coupled() -> None:
    """Two masses on springs, held equal by a coupling: x'' = -(k1 + k2)/(m1 + m2) x."""
    x, y, x_dot, y_dot = sympy.symbols("x y x_dot y_dot")
    L = (2 * x_dot**2 + 3 * y_dot**2) / 2 - (5 * x**2 + 7 * y**2) / 2
    m = eg.Model.from_lagrangian("two", L, [x, y])
    m.coupling("equal", {x: 1, y: -1})
    mod = m.compile(target="numpy")
    state = mod.x0(x=0.3)
    np.testing.assert_allclose(mod.rhs(0.0, state)[2:], [-12 / 5 * 0.3] * 2, rtol=1e-13)


def test_angles_that_close_loops_in_space_are_refused() -> None:
    """Such an angle is known up to full turns only: a coupling would jump with it."""
    m = build("spatial_loop")
    wheel = m.body("wheel", mass=1, inertia=(1, 1, 1))
    m.revolute("W", m.ground, wheel, coordinate="turn")
    m.coupling("follow", {"C_3": 1, "turn": -1})
    refuses("EG-UNDEFINED constraints.follow C_3", m.derive)


def laws() -> eg.Model:
    """Two sliders, a spring, a damper, and laws of an input and of states."""
    m = eg.Model("laws")
    a, b = m.body("a", mass=2, inertia={"zz": 1}), m.body("b", mass=1)
    m.prismatic("x", m.ground, a, axis="x")
    m.prismatic("y", m.ground, b, axis="x")
    m.input("u", 1)
    m.state("s", rate="-s", initial=1)
    m.sampled("held", "0.5 + t", period=0.2)
    m.joint_spring("K", "x", stiffness=3)
    m.joint_damper("D", "x", damping=2)
    m.output("slow", "2*s*x")
    m.initial(x=1)
    return m


REFUSED = [
    ("x - s", "EG-REFERENCE 's'"),
    ("x_dot - s", "EG-REFERENCE 's'"),
    ("slow - 1", "EG-REFERENCE 's'"),
    ("x - held", "EG-REFERENCE 'held'"),
    ("x - s_dot", "EG-REFERENCE 's_dot'"),
    ("power(D) - 1", "EG-EXPRESSION power(D)"),
    ("wx(a) - 1", "EG-CONTRADICTION c.equation -1"),
    ("vy(a) - u", "EG-CONTRADICTION c.equation u"),
    ("x == 2*y", "EG-EXPRESSION comparison"),
]


@pytest.mark.parametrize(("equation", "demand"), REFUSED)
@pytest.mark.parametrize("closes", [None, "1 - t"])
def test_an_equation_that_cannot_be_held_is_refused(equation: str, demand: str, closes: str | None) -> None:
    m = laws()
    m.coupling("c", equation=equation, **({} if closes is None else {"closes": closes}))
    if equation == "x - held" and closes:
        assert m.derive()
        return
    with refused(f"{demand} constraints.c") as caught:
        m.derive()
    assert len(caught.value.problems) == 1


def test_the_law_of_an_element_in_an_equation() -> None:
    """y' = -2 x', by the damper's force: 6 x'' + 2 x' + 3 x = 0; a held rate and length are those of the slider."""
    m = laws()
    m.coupling("c", equation="y_dot - force(D)")
    run = m.compile(target="numpy").simulate(1.0, initial={"x": 1.0})
    decay, w = 1 / 6, np.sqrt(17) / 6
    x = np.exp(-decay * run.t) * (np.cos(w * run.t) + decay / w * np.sin(w * run.t))
    assert run["x"] == pytest.approx(x, abs=1e-7)
    assert run["y"] == pytest.approx(2 - 2 * x, abs=1e-7)
    for equation, end in (("rate(D) - 1", 2.0), ("length(K) - 1", 1.0), ("force(D) + 2", 2.0)):
        m = laws()
        m.coupling("c", equation=equation)
        speed = {} if "length" in equation else {"x_dot": 1.0}
        assert m.compile(target="numpy").simulate(1.0, initial=speed)["x"][-1] == pytest.approx(end, abs=1e-9)
