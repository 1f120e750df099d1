"""Models that tests share: the shipped examples by name, variations on them, small ones of kinds that none is of."""

import json
from collections.abc import Callable, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import sympy

import eomgen as eg
from eomgen.toolchain.compiler import lane_width

TESTS = Path(__file__).parent
EXAMPLES = TESTS.parent / "examples"
EXAMPLE_NAMES = (
    "pendulum", "double_pendulum", "two_link_manipulator", "slider_crank", "four_bar", "peaucellier", "chain",
    "cart_pendulum", "spherical_pendulum", "andrews_squeezer", "planetary_gear", "cam_follower", "rolling_disc",
    "bicycle", "bricard", "n_four_bar",
)  # fmt: skip
#: Partly driven ones, which the Newton-Euler judge does not know.
DRIVEN_NAMES = ("car_axis", "kapitza_pendulum")
TABLE = ([0.0, 0.05, 0.11, 0.2, 1.0], [1.0, -2.0, 3.0, 5.0, 7.0])
#: How the input of a cart is given to a run: kind -> value.
INPUTS: dict[str, Any] = {
    "number": 1.5,
    "table": TABLE,
    "held": eg.Signal(*TABLE, "zero-order"),
    "cubic": eg.Signal(*TABLE, "cubic"),
    "text": "sin(3*t) - k*s",
    "function": lambda t, x: np.cos(4.0 * t) - x[0],
}

#: Options of C where it is not the subject: not optimized, and all that is ever called in one build, lanes among it.
IN_C: dict[str, Any] = {
    "optimize": 0,
    "lanes": lane_width(),
    "kernels": (
        "rhs", "jacobian", "mass_matrix", "embedded_mass_matrix", "bias", "energy", "constraints",
        "constraint_jacobian", "coordinate_slopes", "velocity_constraints", "project", "poses", "outputs", "events",
        "resets", "held_errors", "kinematics", "loop_coordinates", "loop_coordinate_jacobian", "alignment",
        "finite_forces", "meeting_time", "scales", "centroidal", "needed_wrenches", "wrench_geometry",
        "inverse_dynamics", "near_pairs", "bias_apart", "motion_axes", "event_derivatives",
        "strike_derivatives", "motion_outputs", "input_jacobian", "parameter_jacobian", "assembly_jacobian",
        "output_derivatives", "inertial_terms", "inverse_dynamics_derivatives", "dae_residual", "dae_jacobian",
    ),
}  # fmt: skip


@cache
def reference(name: str) -> Any:
    """Published numbers, with their source."""
    return json.loads((TESTS / "reference" / f"{name}.json").read_text(encoding="utf-8"))


def join_slider_crank(m: eg.Model, bars: Sequence[Any], r: Any, l: Any, names: str, guide: str = "D") -> None:
    """Joints of crank, rod and slider along x; names of the coordinates of A, B and the guide, - for none."""
    crank, rod, slider = bars
    first, second, last = ({} if name == "-" else {"coordinate": name} for name in names.split())
    m.revolute("A", m.ground, crank, **first)
    m.revolute("B", crank.at(r, 0, 0), rod, **second)
    m.revolute("C", rod.at(l, 0, 0), slider)
    m.prismatic(guide, m.ground, slider, axis="x", **last)


def join_four_bar(m: eg.Model, bars: Sequence[Any], lengths: Sequence[Any], names: str) -> None:
    """Hinges of crank, coupler and rocker of these lengths, then that of ground; names of A, B and D, - for none."""
    (crank, coupler, rocker), (a, b, c, d) = bars, lengths
    first, second, last = ({} if name == "-" else {"coordinate": name} for name in names.split())
    m.revolute("A", m.ground, crank, **first)
    m.revolute("B", crank.at(a, 0, 0), coupler, **second)
    m.revolute("C", coupler.at(b, 0, 0), rocker.at(c, 0, 0))
    m.revolute("D", m.ground.at(d, 0, 0), rocker, **last)


def offset_slider_crank() -> eg.Model:
    """Slider-crank whose guide lies e above the crank's pivot; thin rods."""
    m = eg.Model("offset_slider_crank", gravity=(0, -9.81, 0))
    r, l, e = m.parameter("r", 0.15), m.parameter("l", 0.5), m.parameter("e", 0.05)
    crank = m.body("crank", mass=1.0, com=(r / 2, 0, 0), inertia={"zz": r**2 / 12})
    rod = m.body("rod", mass=0.8, com=(l / 2, 0, 0), inertia={"zz": 0.8 * l**2 / 12})
    slider = m.body("slider", mass=0.5)
    m.revolute("A", m.ground, crank, coordinate="theta")
    m.revolute("B", crank.at(r, 0, 0), rod)
    m.revolute("C", rod.at(l, 0, 0), slider)
    m.prismatic("D", m.ground.at(0, e, 0), slider, axis="x", coordinate="s")
    m.initial(theta=0.3)
    m.guess(s=0.6)
    m.independent("theta")
    return m


def free_slider_crank() -> eg.Model:
    """The rigid slider-crank of planar_slider_crank_dynamics.json (Flores, Leine and Glocker 2010)."""
    given = reference("planar_slider_crank_dynamics")["parameters_SI"]
    m = eg.Model("free_slider_crank", gravity=(0, "-g", 0))
    p = {name: m.parameter(name, value) for name, value in given.items()}
    crank = m.body("crank", mass=p["m1"], com=(p["l1"] / 2, 0, 0), inertia={"zz": p["J1"]})
    rod = m.body("rod", mass=p["m2"], com=(p["l2"] / 2, 0, 0), inertia={"zz": p["J2"]})
    slider = m.body("slider", mass=p["m3"])
    join_slider_crank(m, (crank, rod, slider), p["l1"], p["l2"], "theta bend x")
    m.output("beta", "theta + bend")
    m.initial(theta=0, theta_dot=10)
    m.guess(bend=0, x=0.4)
    return m


def point_chain() -> eg.Model:
    """Three point masses on massless rods: pm3_horizontal of nlink_chain.json."""
    m = eg.Model("point_chain", gravity=(0, -9.81, 0))
    previous = m.ground
    for k in (1, 2, 3):
        link = m.body(f"link{k}", mass=1, com=(0, -1, 0))
        m.revolute(f"q{k}", previous, link)
        previous = link.at(0, -1, 0)
    m.initial(q1=np.pi / 2)
    return m


def tilted_four_bar() -> eg.Model:
    """The example four_bar in a plane of general attitude and place: rows across the plane vanish to rounding."""
    m = eg.Model("tilted_four_bar")
    rpy = (0.4, -0.7, 1.1)
    a4 = np.array(rotation(rpy)) @ np.array([0.1, 0.0, 0.0])
    at = np.array([0.03, -0.02, 0.05])

    def link(name: str, length: float) -> Any:
        return m.body(name, mass=length, com=(length / 2, 0, 0), inertia={"zz": length**3 / 12})

    crank, coupler, rocker = link("crank", 0.04), link("coupler", 0.12), link("rocker", 0.08)
    m.revolute("A", m.ground.at(*at, rpy=rpy), crank, coordinate="theta")
    m.revolute("B", crank.at(0.04, 0, 0), coupler, coordinate="bend")
    m.revolute("C", coupler.at(0.12, 0, 0), rocker.at(0.08, 0, 0))
    m.revolute("D", m.ground.at(*(at + a4), rpy=rpy), rocker, coordinate="psi")
    m.initial(theta=np.pi / 3, theta_dot=10)
    m.guess(bend=-0.7, psi=1.1)
    m.independent("theta")
    return m


def skewed_four_bar() -> eg.Model:
    """A planar four-bar in which every joint's markers are turned by general angles in their bodies."""
    m = eg.Model("skewed_four_bar")
    lengths = {"crank": 0.04, "coupler": 0.12, "rocker": 0.08}
    turns = {
        "crank": (0.3, 0.2, 0.0),
        "coupler": (-0.5, 0.4, 0.1),
        "rocker": (0.2, -0.6, -0.3),
        "ground": (0.7, 0.1, 0.2),
    }
    R = {name: rotation(rpy) for name, rpy in turns.items()}
    bodies: dict[str, Any] = {"ground": m.ground}
    for name, length in lengths.items():
        # body axes turned by R^T against the link's own: everything of the link is seen through R
        tensor = R[name] @ np.diag([0.0, length**3 / 12, length**3 / 12]) @ R[name].T
        com = R[name] @ [length / 2, 0, 0]
        bodies[name] = m.body(name, mass=length, com=tuple(com), inertia=tensor.tolist())

    def at(name: str, x: float) -> Any:
        return bodies[name].at(*(R[name] @ [x, 0, 0]), rpy=turns[name])

    m.revolute("A", at("ground", 0), at("crank", 0), coordinate="theta")
    m.revolute("B", at("crank", 0.04), at("coupler", 0), coordinate="bend")
    m.revolute("C", at("coupler", 0.12), at("rocker", 0.08))
    m.revolute("D", at("ground", 0.1), at("rocker", 0), coordinate="psi")
    m.initial(theta=np.pi / 3, theta_dot=10)
    m.guess(bend=-0.7, psi=1.1)
    m.independent("theta")
    return m


def three_cranks() -> eg.Model:
    """Parallelogram with a third, parallel crank: two loops, of whose four rows one depends on the others.

    Gruebler counts no degree of freedom; off the manifold the four rows are independent.
    """
    m = eg.Model("three_cranks", gravity=(0, "-g", 0))
    m.parameter("g", 9.81)
    r, mass = m.parameter("r", 0.2), m.parameter("mass", 0.7)
    bar = m.body("bar", mass=1.3, com=(0.3, 0, 0), inertia={"zz": 0.04})
    for k, x in ((1, 0.0), (2, 0.35), (3, 0.6)):
        crank = m.body(f"crank{k}", mass=mass, com=(r / 2, 0, 0), inertia={"zz": mass * r**2 / 12})
        m.revolute(f"A{k}", m.ground.at(x, 0, 0), crank, coordinate=f"theta{k}")
        if k == 1:
            m.revolute("B1", crank.at(r, 0, 0), bar, coordinate="bend")
        else:
            m.revolute(f"B{k}", bar.at(x, 0, 0), crank.at(r, 0, 0))
    m.initial(theta1=-0.5)
    m.guess(bend=0.5, theta2=-0.5, theta3=-0.5)
    m.independent("theta1")
    return m


def spatial_loop() -> eg.Model:
    """Spatial linkage of revolute, spherical, cylindrical and revolute joint: one degree of freedom."""
    m = eg.Model("spatial_loop", gravity=(0.5, -1.0, -9.81))
    crank = m.body("crank", mass=1.2, com=(0.1, 0, 0.02), inertia=[[0.01, 0.001, 0], [0.001, 0.02, 0], [0, 0, 0.022]])
    rod = m.body("rod", mass=0.7, com=(0.3, 0.01, 0), inertia=(0.002, 0.03, 0.031))
    rocker = m.body("rocker", mass=0.9, com=(0.0, 0.2, 0), inertia=(0.02, 0.003, 0.021))
    m.revolute("A", m.ground, crank, coordinate="theta")
    m.spherical("B", crank.at(0.2, 0, 0), rod, coordinates=["b_1", "b_2", "b_3"])
    m.revolute("D", m.ground.at(0.7, 0.1, 0.2, rpy=(1.2, 0.3, 0.2)), rocker, coordinate="psi")
    m.cylindrical("C", rod.at(0.6, 0, 0), rocker.at(0, 0.4, 0, rpy=(0.3, 0.2, 0.1)))
    m.initial(theta=0.4, theta_dot=6.0)
    m.independent("theta")
    return m


def powered_slider_crank() -> eg.Model:
    """Slider-crank with spring, dampers, joint friction, a torque input and a force on the slider."""
    m = eg.Model("powered_slider_crank", gravity=(0, "-g", 0))
    m.parameter("g", 9.81)
    r, l = m.parameter("r", 0.1), m.parameter("l", 0.35)
    crank = m.body("crank", mass=1.0, com=(r / 2, 0, 0), inertia={"zz": r**2 / 12})
    rod = m.body("rod", mass=0.8, com=(l / 2, 0, 0), inertia={"zz": 0.8 * l**2 / 12})
    slider = m.body("slider", mass=0.5)
    join_slider_crank(m, (crank, rod, slider), r, l, "theta bend s")
    m.torque("motor", "A", m.input("tau", 1.5))
    m.spring("k1", m.ground.at(0.5, 0.2, 0), slider, stiffness=200, length=0.1)
    m.damper("c1", m.ground.at(0.5, 0.2, 0), slider, damping=2)
    m.friction("f1", "B", viscous=0.01)
    m.torsional_damper("d1", "C", damping=0.02)
    m.force("push", slider, ("3*sin(5*t)", 1, 0))
    m.initial(theta=0.3, theta_dot=10.0)
    m.independent("theta")
    return m


def powered_arm() -> eg.Model:
    """Spatial tree with a force and a torque in body axes, dampers, springs and actuators of every kind."""
    m = eg.Model("powered_arm", gravity=(0, 0, -9.81))
    base = m.body("base", mass=2.0, com=(0.05, 0, 0.1), inertia=(0.03, 0.03, 0.02))
    arm = m.body(
        "arm", mass=1.0, com=(0.25, 0.02, 0), inertia=[[0.01, 0.002, 0], [0.002, 0.05, 0.001], [0, 0.001, 0.05]]
    )
    ram = m.body("ram", mass=0.6, com=(0.1, 0, 0.03), inertia=(0.004, 0.01, 0.01))
    hand = m.body("hand", mass=0.4, com=(0.02, 0.03, 0.05), inertia=(0.002, 0.003, 0.004))
    m.revolute("turn", m.ground, base)
    m.revolute("lift", base.at(0, 0, 0.3, rpy=(0.2, 0.1, 0)), arm, axis="-y")
    m.prismatic("slide", arm.at(0.4, 0, 0), ram, axis="x")
    m.spherical("wrist", ram.at(0.2, 0, 0), hand, coordinates=["w1", "w2", "w3"])
    m.torque("swing", "turn", m.input("tau", 0.8))
    m.actuator("reach", "slide", value=m.input("F", -2.0))
    m.force("thrust", hand.at(0.1, 0, 0, rpy=(0.3, 0, 0.4)), (1.0, -0.5, "2*cos(t)"), axes="body")
    m.torque("gyro", ram, (0.1, 0.2, -0.3), axes="body")
    m.damper("c1", m.ground.at(1, 1, 0), hand.at(0, 0, 0.1), damping=1.5)
    m.spring("k1", m.ground.at(1, 0, 1), ram, stiffness=30, length=0.5)
    m.actuator("tendon", base.at(0, 0.2, 0.5), hand, value=m.input("P", 0.7))
    m.friction("f1", "lift", viscous=0.3)
    m.torsional_spring("k2", "lift", stiffness=4.0, angle=0.3)
    m.spring("k3", ram.at(0, 0.1, 0), base, stiffness=10, length=0.2)
    m.torsional_damper("d1", "turn", damping=0.2)
    m.initial(lift=0.4, slide=0.05, w1=0.2, w2=0.3, turn_dot=1.0, w3_dot=2.0, slide_dot=0.2)
    return m


def cart(**declared: Any) -> eg.Model:
    """A sliding mass with a spring, pushed by the input u, which is declared as these keywords say."""
    m = eg.Model("cart", gravity=(0, 0, 0))
    body = m.body("cart", mass=2.0)
    m.prismatic("J", m.ground, body, axis="x", coordinate="s")
    m.parameter("k", 3.0)
    u = m.input("u", **declared)
    m.actuator("push", "J", value="u - k*s - 0.1*s_dot")
    m.output("y", "k*u + s")
    m.output("a", body.acceleration[0] + u)
    m.initial(s=0.4)
    return m


def every_joint() -> eg.Model:
    """A chain of one joint of each kind, with elements that need other functions of the graph."""
    m = eg.Model("every_joint", gravity=(0, 0, -9.81))
    last, place = m.ground, (0.0, 0.0, 0.0)
    kinds = {
        "revolute": {}, "prismatic": {"axis": "x"}, "screw": {"pitch": 0.2}, "cylindrical": {}, "universal": {},
        "constant_velocity": {}, "spherical": {}, "planar": {}, "free": {"rotation": "euler_parameters"},
    }  # fmt: skip
    for k, (kind, options) in enumerate(kinds.items()):
        body = m.body(f"b{k}", mass=1.0 + 0.1 * k, com=(0.1, 0.02, 0.05 * k), inertia=(0.02, 0.03, 0.025 + 0.001 * k))
        getattr(m, kind)(kind, last.at(*place, rpy=(0.1 * k, 0.2, -0.1)), body, **options)
        last, place = body, (0.2, 0.1, 0.3)
    m.bushing(
        "mount",
        m.ground.at(0.1, 0, 0.2),
        m.bodies["b3"],
        stiffness=(10, 20, 30, 1, 2, 3),
        damping=(1, 1, 1, 0.1, 0.1, 0.1),
    )
    m.initial(revolute=0.3, prismatic=0.1, screw=0.4, cylindrical_3=0.2, universal_1=0.3, spherical_2=0.2, planar_3=0.5)
    m.initial(revolute_dot=1.0, spherical_1_dot=0.7, free_wx=0.5, free_z_dot=0.3)
    return m


def switched_by_lever(speed: float) -> eg.Model:
    """A sledge that is pushed by 0.25 m/s where the input ``lever`` less 0.5 and its place together pass zero."""
    m = eg.Model("switched")
    m.prismatic("J", m.ground, m.body("b", mass=1.0), axis="x", coordinate="s")
    m.torque("nothing", "J", 0 * m.input("lever"))
    m.initial(s=0.0, s_dot=speed)
    m.event("on", "lever - 0.5 + s", direction=1, reset={"s_dot": "s_dot + 0.25"})
    return m


def rods(twice: bool = False) -> eg.Model:
    """Two bodies on balls, held together by a rod, or two in one place: five freedoms."""
    m = eg.Model("rods", gravity=(0.0, 0.0, -9.81))
    l, torque = m.parameter("l", 1.1), m.input("torque", 0.4)
    a = m.body("a", mass=1.2, com=(0.1, 0.2, -0.5), inertia=(0.2, 0.3, 0.15))
    b = m.body("b", mass=0.8, com=(-0.1, 0.1, -0.4), inertia=(0.1, 0.2, 0.15))
    m.spherical("A", m.ground, a, rotation="euler_parameters")
    m.spherical("B", m.ground.at(1.0, 0.0, 0.0), b, rotation="euler_parameters")
    m.distance("rod", a.at(0.0, 0.3, -1.0), b.at(0.2, 0.0, -0.9), length=l)
    if twice:
        m.distance("second", a.at(0.0, 0.3, -1.0), b.at(0.2, 0.0, -0.9), length=l + m.parameter("gap", 0.0))
    m.torque("drive", a, (torque, 0, 0))
    return m


def rounded_wheel() -> eg.Model:
    """A wheel with a round tread that rolls on ground."""
    m = eg.Model("ring", gravity=(0, 0, -9.81))
    wheel = m.body("wheel", mass=1, inertia=(0.05, 0.05, 0.09))
    m.free("f", m.ground, wheel, sequence="zxz", coordinates=["x", "y", "z", "yaw", "lean", "spin"])
    m.rolling("roll", wheel, m.ground, radius=0.3, tube=0.05)
    m.initial(lean=1.2, yaw_dot=0.3, spin_dot=6.0, x=0, y=0, yaw=0, spin=0, lean_dot=0)
    return m


def sampled_servo() -> eg.Model:
    """A sledge on a digital controller with integral part."""
    m = eg.Model("sampled_servo", gravity=(0, 0, 0))
    m.prismatic("slide", m.ground, m.body("sledge", mass=2), axis="x", coordinate="s")
    z = m.sampled("z", "z + 0.01*(0.1 - s)", period=0.01)
    m.actuator(
        "motor",
        "s",
        value=m.sampled(
            "u", 80 * (sympy.Rational(1, 10) - sympy.Symbol("s")) + 50 * z - 20 * sympy.Symbol("s_dot"), period=0.01
        ),
    )
    return m


def clutch() -> eg.Model:
    """Two rotors of which a clutch makes one for two seconds."""
    m = eg.Model("clutch", gravity=(0, 0, 0))
    for name, inertia in (("a", 2.0), ("b", 1.0)):
        m.revolute(name, m.ground, m.body(f"rotor_{name}", mass=1, inertia={"zz": inertia}))
    m.torsional_damper("drag", "a", damping=0.3)
    m.coupling("clutch", equation="a_dot - b_dot", closes="0.1 - t", opens="0.3 - t")
    m.output("torque", "multiplier(clutch)")
    m.initial(a_dot=4)
    return m


def heap() -> eg.Model:
    """Discs, a box and a triangle that fall on a plane and on each other, with friction."""
    m = eg.Model("heap", gravity=(0, -9.81, 0))
    bodies = [m.body(f"b{k}", mass=1 + 0.2 * k, inertia={"zz": 0.01}) for k in range(4)]
    for k, body in enumerate(bodies):
        m.planar(f"j{k}", m.ground.at(0.02 * k, 0.095 + 0.2 * k, 0), body)
    stones = [
        {"shape": "circle", "on": bodies[:2], "radius": 0.1},
        {"shape": "box", "on": bodies[2], "size": (0.2, 0.15)},
        {"shape": "polygon", "on": bodies[3], "points": [(0.12, 0), (-0.1, 0.1), (-0.1, -0.1)]},
    ]
    law = {"stiffness": 1e5, "dissipation": 0.5, "friction": 0.4, "smoothing": 1e-3}
    m.contacts("floor", stones, {"shape": "half_plane", "on": m.ground}, law)
    m.contacts("heap", stones, law=law)
    m.initial(j0_x_dot=0.5, j2_3=0.3)
    return m


def solids() -> eg.Model:
    """An ellipsoid, a cuboid and a capsule that touch the ground."""
    m = eg.Model("solids", gravity=(0, 0, -9.81))
    shapes = [
        {"shape": "ellipsoid", "semi_axes": (0.1, 0.15, 0.2)},
        {"shape": "cuboid", "size": (0.2, 0.25, 0.3)},
        {"shape": "capsule", "radius": 0.08, "length": 0.2},
    ]
    for k, (shape, height) in enumerate(zip(shapes, (0.199, 0.149, 0.18), strict=True)):
        body = m.body(f"b{k}", mass=2 + k, inertia=(0.02, 0.03, 0.025))
        m.free(f"j{k}", m.ground.at(0.5 * k, 0, height), body, rotation="euler_parameters")
        shape["on"] = body
    law = {"stiffness": 5e4, "dissipation": 0.3, "friction": 0.3, "smoothing": 1e-3}
    m.contacts("ground", shapes, {"shape": "half_space", "on": m.ground}, law)
    m.initial(j1_wx=0.4, j2_x_dot=0.2)
    return m


def pebbles() -> eg.Model:
    """Two rigid discs on a plane, for time stepping by impulses."""
    m = eg.Model("pebbles", gravity=(0, -9.81, 0))
    bodies = [m.body(f"b{k}", mass=1 + k, inertia={"zz": 0.005}) for k in range(2)]
    for k, body in enumerate(bodies):
        m.planar(f"j{k}", m.ground.at(0.05 * k, 0.12 + 0.25 * k, 0), body)
    stones = [{"shape": "circle", "on": bodies, "radius": 0.1}]
    law = {"normal_law": "rigid", "friction": 0.3, "restitution": 0.2}
    m.contacts("floor", stones, {"shape": "half_plane", "on": m.ground}, law)
    m.contacts("each", stones, law=law)
    m.initial(j0_x_dot=0.4)
    m.simulation(method="moreau", step=1e-3)
    return m


def bouncing_ball() -> eg.Model:
    """A ball that jumps from the floor, with friction, and whose apex is an event."""
    m = eg.Model("bouncing_ball", gravity=(0, -9.81, 0))
    m.planar("J", m.ground, m.body("ball", mass=1, inertia={"zz": 0.004}))
    m.output("slide", "J_x_dot + 0.1*J_3_dot")
    m.event("floor", "J_y - 0.1", restitution=0.8, friction=0.2, slip="slide")
    m.event("apex", "J_y_dot", direction=-1)
    m.initial(J_y=0.15, J_x_dot=1.0, J_y_dot=-1.0)
    return m


def swinging_mass() -> eg.Model:
    """A bare Lagrangian: a pendulum on a point that moves as 0.1 sin 5t, with a term linear in the velocity."""
    m, l, g, t, q, w = sympy.symbols("m l g t theta theta_dot")
    x_dot = sympy.cos(5 * t) / 2
    kinetic = m * ((l * w * sympy.cos(q) + x_dot) ** 2 + (l * w * sympy.sin(q)) ** 2) / 2
    made = eg.Model.from_lagrangian(
        "swinging_mass", kinetic + m * g * l * sympy.cos(q) + w * sympy.sin(q) / 7, [q],
        dissipation=w**2 / 20, parameters={m: 1.5, l: 0.4, g: 9.81},
    )  # fmt: skip
    made.initial(theta=0.4)
    return made


def skate() -> eg.Model:
    """A bare Lagrangian with a nonholonomic constraint: a blade on an inclined plane."""
    x, y, phi, x_dot, y_dot, phi_dot = sympy.symbols("x y phi x_dot y_dot phi_dot")
    made = eg.Model.from_lagrangian(
        "skate", x_dot**2 + y_dot**2 + phi_dot**2 / 10 + 4 * x, [x, y, phi],
        constraints=[x_dot * sympy.sin(phi) - y_dot * sympy.cos(phi)],
    )  # fmt: skip
    made.initial(phi=0.4, phi_dot=1.0, x_dot=0.5)
    return made


def sleigh() -> eg.Model:
    """Equations of one's own with more coordinates than speeds: Chaplygin's sleigh (Neimark and Fufaev 1972)."""
    made = eg.Model.from_equations(
        "sleigh", ["x", "y", "phi"], velocities=["v", "w"], rates={"x": "v*cos(phi)", "y": "v*sin(phi)", "phi": "w"},
        mass_matrix=[["m", 0], [0, "I + m*a**2"]], forcing=["m*a*w**2", "-m*a*v*w"],
        kinetic_energy="m*(v**2 + a**2*w**2)/2 + I*w**2/2", potential_energy="0",
        parameters={"m": 1.0, "a": 0.3, "I": 0.2},
    )  # fmt: skip
    made.initial(v=1.0, w=0.5, phi=0.2)
    return made


def engine_torque() -> eg.Model:
    """A shaft driven by a table of two arguments and a spring with a measured curve."""
    m = eg.Model("engine_torque", gravity=(0, 0, 0))
    rotor = m.body("rotor", mass=1.0, inertia={"zz": 0.1})
    m.revolute("turn", m.ground, rotor)
    torque = m.table("torque", [0, 10, 20, 40], [0, 5, 7, 3])
    grip = m.table("grip", [-0.2, 0, 0.2, 0.5], [-3, 0, 2, 2.5], kind="monotone")
    m.torque("motor", "turn", torque(sympy.Symbol("turn_dot")) - 5 * grip(sympy.Symbol("turn")))
    m.initial(turn_dot=5.0)
    return m


def rotation(rpy: tuple[float, float, float]) -> np.ndarray:
    """Fixed-axis roll, pitch, yaw, as in URDF: Rz(yaw) Ry(pitch) Rx(roll)."""
    (a, b, c), (A, B, C) = np.cos(rpy), np.sin(rpy)
    x = np.array([[1, 0, 0], [0, a, -A], [0, A, a]])
    y = np.array([[b, 0, B], [0, 1, 0], [-B, 0, b]])
    z = np.array([[c, -C, 0], [C, c, 0], [0, 0, 1]])
    return z @ y @ x


BUILT: dict[str, Callable[[], eg.Model]] = {
    f.__name__: f
    for f in (
        offset_slider_crank,
        free_slider_crank,
        point_chain,
        tilted_four_bar,
        skewed_four_bar,
        three_cranks,
        spatial_loop,
        powered_slider_crank,
        powered_arm,
        every_joint,
        sampled_servo,
        clutch,
        heap,
        solids,
        pebbles,
        bouncing_ball,
        swinging_mass,
        skate,
        sleigh,
        engine_torque,
    )
} | {**{f"cart_{kind}": cart for kind in INPUTS}, "cart_signal": partial(cart, signal="sin(3*t) - k*s")}


def build(name: str) -> eg.Model:
    """A model by name: one of this file, or an example from its YAML file."""
    made = BUILT.get(name)
    return made() if made else eg.load(EXAMPLES / f"{name}.yaml")


class Known(NamedTuple):
    """A model of the registry."""

    build: Callable[[], eg.Model]
    freedoms: int  #: counted by hand: Kutzbach, less the rows that are redundant
    features: frozenset[str] = frozenset()
    inputs: dict[str, Any] | None = None  #: of its run
    span: float = 0.2  #: of its run (s)


#: Of the example files: name -> freedoms and features.
_EXAMPLES: dict[str, tuple[int, str]] = {
    "andrews_squeezer": (1, "loops plane stiff"),
    "bicycle": (3, "nonholonomic loops space"),
    "bricard": (1, "loops redundant space"),
    "cam_follower": (1, "loops plane"),
    "car_axis": (2, "loops driven plane"),
    "cart_pendulum": (2, "tree plane"),
    "chain": (3, "tree plane"),
    "chebyshev": (0, "loops driven plane fixed"),
    "compass_gait": (5, "tree plane states switched"),
    "delta_robot": (3, "loops space"),
    "double_pendulum": (2, "tree plane"),
    "double_wishbone": (1, "loops space"),
    "driven_slider_crank": (0, "loops driven plane fixed"),
    "engine": (1, "loops plane"),
    "excavator": (3, "loops plane"),
    "flyball_governor": (4, "tree space"),
    "four_bar": (1, "loops plane"),
    "furuta_pendulum": (2, "tree space"),
    "gait_leg": (3, "tree plane muscle"),
    "gear_train": (1, "gears plane"),
    "half_car": (4, "tree plane"),
    "hoecken": (0, "loops driven plane fixed"),
    "hydraulic_boom": (1, "tree states plane"),
    "jansen_leg": (0, "loops driven plane fixed"),
    "kapitza_pendulum": (1, "driven plane"),
    "n_four_bar": (1, "loops plane"),
    "peaucellier": (1, "loops redundant plane"),
    "pendulum": (1, "tree plane"),
    "planetary_gear": (1, "gears plane"),
    "puma560": (6, "tree space"),
    "quadrotor_load": (8, "tree space"),
    "rimless_wheel": (3, "tree plane states switched"),
    "rolling_disc": (3, "nonholonomic space"),
    "satellite": (11, "tree space parameters"),
    "shaper": (1, "loops plane"),
    "slider_crank": (1, "loops plane"),
    "spatial_four_bar": (1, "loops space"),
    "spatial_slider_crank": (1, "loops space"),
    "spherical_pendulum": (2, "tree space"),
    "stewart_platform": (6, "loops space components large"),
    "two_link_manipulator": (2, "tree plane"),
    "v_engine": (1, "loops plane components"),
    "v_twin": (0, "loops driven plane fixed"),
    "watt_six_bar": (1, "loops plane"),
    "wheelset": (3, "driven massless space"),
}
_BUILT = {
    "offset_slider_crank": (1, "loops plane"),
    "free_slider_crank": (1, "loops plane"),
    "point_chain": (3, "tree plane massless"),
    "tilted_four_bar": (1, "loops redundant space"),
    "skewed_four_bar": (1, "loops redundant space"),
    "three_cranks": (1, "loops redundant plane"),
    "spatial_loop": (1, "loops space"),
    "powered_slider_crank": (1, "loops plane"),
    "powered_arm": (6, "tree space"),
}
_SMALL = {
    "every_joint": (21, "tree space parameters"),
    "sampled_servo": (1, "tree states sampled"),
    "clutch": (2, "tree states switched nonholonomic"),
    "heap": (12, "tree plane contacts"),
    "solids": (18, "tree space contacts parameters"),
    "pebbles": (6, "tree plane contacts rigid"),
    "bouncing_ball": (3, "tree plane events"),
    "swinging_mass": (1, "lagrangian driven"),
    "skate": (2, "lagrangian nonholonomic"),
    "sleigh": (2, "equations nonholonomic"),
    "engine_torque": (1, "tree tables"),
    **{name: (1, "tree inputs") for name in BUILT if name.startswith("cart_")},
}
_SPANS = {"heap": 0.01, "solids": 0.005, "stewart_platform": 0.02, "andrews_squeezer": 0.005}


def _registry() -> dict[str, Known]:
    found = {}
    for table in (_EXAMPLES, _BUILT, _SMALL):
        for name, (freedoms, features) in table.items():
            kind = name.removeprefix("cart_")
            inputs = {"u": INPUTS[kind]} if kind in INPUTS else None
            found[name] = Known(
                partial(build, name), freedoms, frozenset(features.split()), inputs, _SPANS.get(name, 0.2)
            )
    return found


#: The registry: models by name, which tests share.
MODELS: dict[str, Known] = _registry()
