"""Small models, each of a kind that no example file holds: inputs over time, samples, contacts, other descriptions."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import sympy

import eomgen as eg

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


MODELS: dict[str, Callable[[], eg.Model]] = {
    **{
        f.__name__: f
        for f in (
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
    },
    **{f"cart_{kind}": cart for kind in INPUTS},
    "cart_signal": partial(cart, signal="sin(3*t) - k*s"),
}
