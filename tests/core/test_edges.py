"""Edges: what outside examiners found wrong, one small case of each kind with what is right."""

import json
import tempfile
import xml.etree.ElementTree as ET
import zipfile
from pathlib import Path

import models
import numpy as np
import pytest
from refusals import refused, refuses

import eomgen as eg

pytestmark = pytest.mark.filterwarnings("ignore")


def model(text: str, suffix: str = ".yaml") -> eg.Model:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"model{suffix}"
        path.write_text(text, encoding="utf-8")
        return eg.load(path)


def test_fewer_speeds_than_coordinates() -> None:
    """x' = v cos h, y' = v sin h, h' = w, v' = a w^2, w' = -m a v w / J, without constraints."""
    m = eg.Model.from_equations(
        "sleigh",
        ["x", "y", "h"],
        velocities=["v", "w"],
        rates={"x": "v*cos(h)", "y": "v*sin(h)", "h": "w"},
        mass_matrix=[["m", "0"], ["0", "J"]],
        forcing=["m*a*w**2", "-m*a*v*w"],
        parameters={"m": 2.0, "J": 0.425, "a": 0.25},
    )
    mod = m.compile(target="numpy")
    x = mod.x0(x=0.1, y=0.2, h=0.4, v=0.9, w=-0.8)
    truth = {"x": 0.9 * np.cos(0.4), "y": 0.9 * np.sin(0.4), "h": -0.8, "v": 0.16, "w": 0.36 / 0.425}
    got = dict(zip(mod.x_names, mod.rhs(0.0, x), strict=False))
    assert all(abs(got[k] - v) < 1e-12 for k, v in truth.items()), got
    for n, k in ((4, 3), (7, 6), (1, 2), (2, 3)):
        q, v = [f"q{i}" for i in range(n)], [f"s{i}" for i in range(k)]
        m = eg.Model.from_equations(
            "m",
            q,
            velocities=v,
            rates={a: v[min(i, k - 1)] for i, a in enumerate(q)},
            mass_matrix=[["1" if i == j else "0" for j in range(k)] for i in range(k)],
            forcing=["0"] * k,
        )
        mod = m.compile(target="numpy")
        assert np.allclose(mod.rhs(0.0, np.ones(n + k))[:n], 1.0), (n, k)


def test_quaternion_norm_as_constraint() -> None:
    """Four Euler parameters and three speeds with e.e = 1 as a constraint."""
    mod = model("""name: quat
equations:
  coordinates: [e0, e1, e2, e3]
  velocities: [wx, wy, wz]
  rates:
    {e0: -(e1*wx + e2*wy + e3*wz)/2, e1: (e0*wx + e2*wz - e3*wy)/2, e2: (e0*wy + e3*wx - e1*wz)/2,
     e3: (e0*wz + e1*wy - e2*wx)/2}
  mass_matrix: [[1, 0, 0], [0, 2, 0], [0, 0, 3]]
  forcing: [-wy*wz, 2*wx*wz, -wx*wy]
  constraints: [e0**2 + e1**2 + e2**2 + e3**2 - 1]
initial: {e0: 1, wx: 0.01, wy: 2, wz: 0.01}
""").compile(target="numpy")
    x = mod.x0()
    x[:4] *= 1 + 1e-9
    mod.rhs(0.0, x)
    steps = len(mod.simulate(0.05).t)
    assert steps < 60, f"{steps} steps for 0.05 s"


def test_names_of_sympy() -> None:
    """Names as SymPy users write them are taken."""
    import sympy as sm
    from sympy.physics.mechanics import LagrangesMethod, dynamicsymbols

    bad = []
    for name in (r"\theta_1", r"\theta_{1}", "θ", "lambda", "q.1", "pi", "int", "q_dot"):
        q, m, g, length = dynamicsymbols(name), sm.Symbol("m"), sm.Symbol("g"), sm.Symbol("l")
        lm = LagrangesMethod(m * length**2 * q.diff() ** 2 / 2 + m * g * length * sm.cos(q), [q])
        lm.form_lagranges_equations()
        try:
            mod = eg.from_sympy(lm, "p", parameters={m: 2, length: 0.7, g: 9.81}).compile(target="numpy")
            assert abs(mod.rhs(0, [0.5, 0.3])[1] + 9.81 / 0.7 * np.sin(0.5)) < 1e-12
        except Exception as e:
            bad.append(f"{name}: {type(e).__name__}")
    assert not bad, bad


def test_tension_with_massless_pulley() -> None:
    """A multiplier as an output where a body has no mass: the rope's force 32.7 N is what mod.multipliers says."""
    m1, m2, m3, g = 4.0, 1.0, 2.5, 9.81
    a = np.linalg.solve([[m1, 0, 0, 2], [0, m2, 0, 1], [0, 0, m3, 1], [1, 0.5, 0.5, 0]], [m1 * g, m2 * g, m3 * g, 0])
    m = eg.Model("atwood", gravity=(0, -g, 0))
    for i, (n, mass) in enumerate((("w1", m1), ("w2", m2), ("w3", m3), ("pulley", 0))):
        m.prismatic(f"{n}_y", m.ground.at(0.5 * i, 0, 0), m.body(n, mass=mass), axis="-y")
    m.coupling("rope1", {"w1_y": 1, "pulley_y": 1}, 2.0)
    m.coupling("rope2", {"w2_y": 1, "w3_y": 1, "pulley_y": -2}, 1.0)
    m.output("tension", "multiplier(rope2)")
    m.initial(w1_y=1.0, w2_y=1.2)
    mod = m.compile(target="numpy")
    assert abs(abs(mod.outputs(0, mod.x0())[0]) - a[3]) < 1e-9


def test_coincident_points() -> None:
    """|r|^2 = 0 of two points is told as what it is."""
    from sympy.physics.mechanics import LagrangesMethod, dynamicsymbols

    x1, x2, y1, y2 = dynamicsymbols("x1 x2 y1 y2")
    speeds = sum(v.diff() ** 2 for v in (x1, x2, y1, y2)) / 2
    lm = LagrangesMethod(speeds - 9.81 * (y1 + y2), [x1, x2, y1, y2], hol_coneqs=[(x1 - x2) ** 2 + (y1 - y2) ** 2])
    lm.form_lagranges_equations()
    refuses("EG-REDUNDANT equations.constraints: x2 y2", eg.from_sympy(lm, "a").check)


def test_independent_kept() -> None:
    """A named independent coordinate is kept and completed, or refused; never dropped in silence."""
    m = eg.Model("two", gravity=(0, -9.81, 0))
    a, b, c = (m.body(n, mass=1, com=(x, 0, 0), inertia={"zz": 0.1}) for n, x in (("a", 0.2), ("b", 0.55), ("c", 0.4)))
    w = m.body("w", mass=1, inertia={"zz": 0.3})
    models.join_four_bar(m, (a, b, c), (0.4, 1.1, 0.8, 1.2), "q s r")
    m.revolute("E", m.ground, w, coordinate="e")
    m.guess(q=0.6, s=-0.2, r=1.5)
    m.initial(q=0.6)
    m.independent("q")
    assert "q" in m.compile(target="numpy").minimal.x_names


def test_rates_as_a_list() -> None:
    """A list where a mapping is wanted is a named error."""
    with refused("EG-TYPE rates ['v']"):
        eg.Model.from_equations("m", ["q"], velocities=["v"], rates=["v"], mass_matrix=[["1"]], forcing=["0"]).check()


def test_driven_mechanism_with_an_event() -> None:
    """A mechanism that drivers move wholly, with an event that never happens."""
    for end in ("", ", terminal: true"):
        m = model(
            "name: d\nbodies: {b: {mass: 1}}\njoints: {j: {type: prismatic, between: [ground, b], coordinate: q}}\n"
            "constraints: {c: {type: driver, coordinate: q, value: t}}\n"
            f"events: {{e: {{expression: q + 1{end}}}}}\n"
        )
        assert abs(m.compile(target="numpy").simulate((0, 1))["q"][-1] - 1.0) < 1e-12


def test_states_without_freedoms() -> None:
    """First-order and sampled states beside bodies that cannot move: s' = -s from 2; s -> s/2 + 1 every 0.1 s."""
    text = "name: w\nbodies: {b: {mass: 1}}\njoints: {j: {type: weld, between: [ground, b]}}\n"
    text += 'states: {s: {rate: "-s", initial: 2}, z: {sampled: "0.5*z+1", period: 0.1, initial: 4}}\n'
    for target in ("numpy", "cython"):
        run = model(text).compile(target=target).simulate((0, 0.25))
        assert run["s"][-1] == pytest.approx(2 * np.exp(-0.25), abs=1e-7)
        assert run["z"][-1] == 2 + 2 / 2**3  # samples at 0, 0.1 and 0.2 s


def test_documents_are_well_formed() -> None:
    """Control characters in doc: modelDescription.xml stays XML."""
    characters = ("\x07", "\x1b", "\uffff", "\u202e", "\u2066", "\u200b", "\ufeff")
    doc = json.dumps("a" + "a".join(f"{char}b" for char in characters))
    m = model(
        f"name: fz\ndoc: {doc}\nbodies: {{b: {{mass: 1}}}}\n"
        "joints: {j: {type: prismatic, between: [ground, b], coordinate: q}}\n"
        f"inputs: {{u: {{value: 0, doc: {doc}}}}}\n"
    )
    with tempfile.TemporaryDirectory() as d:
        with zipfile.ZipFile(m.derive().write_fmu(f"{d}/fz.fmu")) as unit:
            ET.fromstring(unit.read("modelDescription.xml"))
        for form in ("md", "tex"):
            m.derive().explain().save(f"{d}/x.{form}")
            text = Path(f"{d}/x.{form}").read_text(encoding="utf-8")
            assert [char for char in characters if f"a{char}b" in text] == []


def test_advice_keeps_the_mechanism() -> None:
    """Redundant rows of planets: what a note advises to leave out leaves one degree of freedom."""
    import re

    def epicyclic(keep):
        m = eg.Model("epi")
        sun, arm = m.body("sun", mass=1, inertia={"zz": 1e-3}), m.body("arm", mass=1, inertia={"zz": 5e-3})
        s, c = m.revolute("S", m.ground, sun, coordinate="th_s"), m.revolute("C", m.ground, arm, coordinate="th_c")
        for i in range(3):
            a = 2 * np.pi * i / 3
            p = m.body(f"p{i}", mass=0.6, inertia={"zz": 4e-4})
            joint = m.revolute(f"P{i}", arm.at(0.1 * np.cos(a), 0.1 * np.sin(a), 0), p, coordinate=f"th_{i}")
            if f"g{i}" in keep:
                m.planetary(f"g{i}", sun=s, carrier=c, planet=joint, teeth={"sun": 24, "planet": 18, "ring": 60})
        return m.check()

    whole = {"g0", "g1", "g2"}
    notes = " ".join(map(str, epicyclic(whole).notes))
    advice = re.search(r"leave ([\w, ]+?) out", notes)
    left_out = set(re.findall(r"g\d", advice.group(1))) if advice else set()
    assert epicyclic(whole - left_out).degrees_of_freedom == 1


def test_auxiliary_forces_that_act() -> None:
    """Kane with an auxiliary speed: the normal force also stands in a friction law of the main equations."""
    import sympy as sm
    from sympy.physics.mechanics import KanesMethod, Particle, Point, ReferenceFrame, dynamicsymbols

    g, m, mu = sm.symbols("g m mu")
    q, u, w, normal, push = dynamicsymbols("q u w normal push")
    frame, origin, point = ReferenceFrame("A"), Point("O"), Point("P")
    origin.set_vel(frame, 0)
    point.set_pos(origin, q * frame.x)
    point.set_vel(frame, u * frame.x + w * frame.y)
    kane = KanesMethod(frame, [q], [u], kd_eqs=[q.diff() - u], u_auxiliary=[w])
    kane.kanes_equations(
        [Particle("b", point, m)], [(point, (normal - m * g) * frame.y + (push - mu * normal) * frame.x)]
    )
    mod = eg.from_sympy(kane, "box", parameters={m: 2.0, mu: 0.3, g: 9.81}).compile(target="numpy")
    assert "normal" not in mod.u_names
    assert "g" in mod.p_names
    got = mod.rhs(0.0, mod.x0({"u": 1.0}), u={"push": 20.0})[-1]
    assert abs(got - (20 - 0.3 * 2 * 9.81) / 2) < 1e-12, got
    assert "normal" in mod.y_names


def test_constants_of_auxiliary_equations() -> None:
    """A constant that stands in the auxiliary equation only is a parameter, and the force an output: N = m g."""
    import sympy as sm
    from sympy.physics.mechanics import KanesMethod, Particle, Point, ReferenceFrame, dynamicsymbols

    g, m, k = sm.symbols("g m k")
    q, u, w, normal = dynamicsymbols("q u w normal")
    frame, origin, point = ReferenceFrame("A"), Point("O"), Point("P")
    origin.set_vel(frame, 0)
    point.set_pos(origin, q * frame.x)
    point.set_vel(frame, u * frame.x + w * frame.y)
    kane = KanesMethod(frame, [q], [u], kd_eqs=[q.diff() - u], u_auxiliary=[w])
    kane.kanes_equations([Particle("b", point, m)], [(point, -k * q * frame.x + (normal - m * g) * frame.y)])
    mod = eg.from_sympy(kane, "block", parameters={m: 2.0, k: 3.0, g: 9.81}).compile(target="numpy")
    out = dict(zip(mod.y_names, mod.outputs(0.0, mod.x0({"q": 0.1})), strict=False))
    assert abs(abs(out["normal"]) - 2 * 9.81) < 1e-12, out


def test_energy_with_linear_terms() -> None:
    """L = m v^2/2 + B (x y' - y x')/2: T is the quadratic part, T + V is constant; from_lagrangian and from_sympy."""
    import sympy as sm

    x, y, xd, yd, m, b = sm.symbols("x y x_dot y_dot m b")
    mod = eg.Model.from_lagrangian(
        "charge", m * (xd**2 + yd**2) / 2 + b * (x * yd - y * xd) / 2, [x, y], parameters={m: 1.0, b: 2.0}
    ).compile(target="numpy")
    run = mod.simulate((0, 3), initial={"x": 0.3, "y": 0.2, "x_dot": 0.5, "y_dot": 0.4}, rtol=1e-10, atol=1e-12)
    assert abs(run["T"][0] - 0.205) < 1e-12, run["T"][0]
    assert np.ptp(run["energy"]) < 1e-8, np.ptp(run["energy"])


def test_quaternion_rates_written_implicitly() -> None:
    """Kinematics of a quaternion as angular velocity = given and e.e' = 0, norm as configuration constraint."""
    import sympy as sm
    from sympy.physics.mechanics import KanesMethod, Point, ReferenceFrame, RigidBody, dynamicsymbols, inertia

    e = e0, e1, e2, e3 = dynamicsymbols("e0:4")
    w = dynamicsymbols("w1:4")
    i1, i2, i3, m = sm.symbols("i1:4 m")
    t = dynamicsymbols._t
    ground, body, point = ReferenceFrame("A"), ReferenceFrame("B"), Point("O")
    body.orient_quaternion(ground, e)
    point.set_vel(ground, 0)
    own = body.ang_vel_in(ground)
    given = w[0] * body.x + w[1] * body.y + w[2] * body.z
    body.set_ang_vel(ground, given)
    kd = [(own - given).dot(a) for a in (body.x, body.y, body.z)] + [sum(a * a.diff(t) for a in e)]
    kane = KanesMethod(
        ground,
        q_ind=[e1, e2, e3],
        q_dependent=[e0],
        u_ind=w,
        kd_eqs=kd,
        configuration_constraints=[sum(a**2 for a in e) - 1],
        explicit_kinematics=False,
    )
    kane.kanes_equations([RigidBody("b", point, body, m, (inertia(body, i1, i2, i3), point))], [])
    mod = eg.from_sympy(kane, "spin", parameters={i1: 1.0, i2: 2.0, i3: 3.0}, guess={"e0": 1.0}).compile(target="numpy")
    x = {"e0": 0.8, "e1": 0.36, "e2": 0.48, "e3": 0.0, "w1": 0.3, "w2": 0.2, "w3": 0.5}
    got = dict(zip(mod.x_names, mod.rhs(0.0, [x[n] for n in mod.x_names]), strict=False))
    np.testing.assert_allclose([got["w1"], got["w2"], got["w3"]], [-0.1, 0.15, -0.02], atol=1e-10)


def test_a_weld_between_bodies_that_stand() -> None:
    """Of MJCF: it holds nothing, and the model compiles."""
    text = (
        '<mujoco><worldbody><body name="a"><freejoint/><geom size=".1"/></body><body name="post">'
        '<geom size=".1" pos="2 0 0"/></body>'
        '<body name="rail"><geom size=".1" pos="3 0 0"/></body></worldbody><equality>'
        '<weld name="w" body1="post" body2="rail"/></equality></mujoco>'
    )
    model(text, ".xml").compile(target="numpy")
