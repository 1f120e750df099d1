"""The constraints section: the same from Python and from a file, faults by line, equations that can be held."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy
import yaml
from models import build

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
    ("joints: [A, B], teeth", "joints: [A, G], teeth", 21, "c3.joints[1]", "no joint 'G'", "joints and coordinates"),
    ("joints: [A, B], teeth", "joints: [A, F], teeth", 21, "c3.joints[1]", "has 6 coordinates", "F_x"),
    ("joints: [A, B], teeth", "joints: [A, C], teeth", 21, "c3.joints[1]", "'s' is a length", "angle"),
    ("joints: [A, B], teeth", "joints: [A, E], teeth", 21, "c3.joints", "not measured from the same", "planetary"),
    ("teeth: [20, 60]", "teeth: [20, -60]", 21, "c3.teeth[1]", "is -60", "greater than 0"),
    ("internal: true", "internal: 1", 21, "c3.internal", "1 is not true or false", ""),
    ("type: rack", "type: rak", 23, "c5.type", "no constraint of type 'rak'", "did you mean 'rack'"),
    ("radius: -r, offset", "radius: -r, ofset: 1, offset", 23, "c5.ofset", "unknown key", "offset"),
    ("coordinates: {A: 1, beta: -n}", "coordinates: {A: 1, bet: 2}", 19, "c1.coordinates.bet", "no joint", "'beta'"),
    ("- 0.01*t", "- ax(one)", 20, "c2.equation", "the acceleration 'ax(one)' cannot", "velocities"),
    ("- 0.01*t", "- wx(one)*wz(two)", 20, "c2.equation", "the equation is not linear in wx(one), wz(two)", "linear"),
    ("- 0.01*t", "- kinetic_energy", 20, "c2.equation", "energy", "not energies"),
    ("radii: {sun: r, ring: n*r}", "radii: {sun: 1, ring: 3, planet: 2}", 22, "c4.radii", "ring 3 is not", "fit"),
    ("lift: k + r*cos(theta)", "lift: k + r*cos(alpha)", 25, "c7.lift", "the coordinate 'alpha' cannot", "parameters"),
    (", coordinate: c}", ", coordinate: beta}", 13, "", "'beta' is already used", "rename"),
    ("shape: flat_face, supp", "shape: knife_edge, supp", 27, "c9.support", "only a flat face", "contour"),
    ("shape: sphere, no_spin", "shape: disc, no_spin", 28, "d1.no_spin", "only spheres", "leave it out"),
    ("k*sin(n*t) + t**2", "k*s", 32, "e1.value", "the coordinate 's' cannot be used", "a coupling relates"),
    ("coordinate: A, value", "coordinate: A, marker: one, value", 32, "e1", "both coordinate and marker", "give one"),
    ("angle: [ground, sat]", "angle: [sat, sat]", 34, "e3.angle", "on the same body", "another body"),
    ("  d4: {", "  c3: {", 31, "c3", "given twice", "rename"),
]


@pytest.mark.parametrize(("old", "new", "line", "path", "message", "remedy"), BROKEN)
def test_faults(old: str, new: str, line: int, path: str, message: str, remedy: str, tmp_path: Path) -> None:
    assert TEXT.count(old) == 1
    with pytest.raises(eg.ModelError) as caught:
        load(tmp_path, TEXT.replace(old, new)).check()
    problems = caught.value.problems
    found = [p for p in problems if message in p.message and remedy in p.remedy]
    assert found, [str(p) for p in problems]
    if path:
        assert found[0].path.startswith(f"constraints.{path}")
        assert found[0].line == line
    assert len({p.path for p in problems}) == 1, [str(p) for p in problems]


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
    with pytest.raises(eg.ModelError, match=r"constraints.follow: the angle 'C_3' closes a loop in space"):
        m.derive()


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
    ("x - s", "the state 's' cannot be used here", "not states that change continuously"),
    ("x_dot - s", "the state 's' cannot", "closes or opens"),
    ("slow - 1", "the state 's' cannot", ""),
    ("x - held", "the state 'held' cannot", "that only events and samples change"),
    ("x - s_dot", "the rate of a state 's_dot' cannot", "not rates of states"),
    ("power(D) - 1", "not linear in the velocities in the law of power(D)", "linear"),
    ("wx(a) - 1", "c.equation is always -1, as no coordinate moves it", "write a coordinate into it"),
    ("vy(a) - u", "c.equation depends on u but on no coordinate", "write a coordinate into it"),
]


@pytest.mark.parametrize(("equation", "message", "remedy"), REFUSED)
@pytest.mark.parametrize("closes", [None, "1 - t"])
def test_an_equation_that_cannot_be_held_is_refused(
    equation: str, message: str, remedy: str, closes: str | None
) -> None:
    m = laws()
    m.coupling("c", equation=equation, **({} if closes is None else {"closes": closes}))
    if equation == "x - held" and closes:
        assert m.derive()
        return
    with pytest.raises(eg.ModelError) as caught:
        m.derive()
    assert [(message in p.message, remedy in p.remedy) for p in caught.value.problems] == [(True, True)]
    assert caught.value.problems[0].path.startswith("constraints.c")


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
