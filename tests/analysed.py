"""Models of the analyses beside those of ``models``, and modules of both that the tests of a process share."""

from collections.abc import Callable
from functools import cache
from typing import Any

import models
import numpy as np

import eomgen as eg


def spring_four_bar() -> eg.Model:
    """IFToMM linearization benchmark: four bars of 1 m with a diagonal spring and damper."""
    given = models.reference("iftomm_fourbar_diagonal_spring")["parameters_SI"]
    m = eg.Model("spring_four_bar", gravity=(0, "-g", 0))
    m.parameter("g", given["g"])
    k, c, free = m.parameter("k", given["k"]), m.parameter("c", given["c"]), m.parameter("L0", np.sqrt(2.0))
    bars = {name: m.body(name, mass=1, com=(0.5, 0, 0), inertia={"zz": 1 / 12}) for name in ("left", "top", "right")}
    m.revolute("A", m.ground, bars["left"], coordinate="phi")
    m.revolute("D", m.ground.at(1, 0, 0), bars["right"], coordinate="psi")
    m.revolute("B", bars["left"].at(1, 0, 0), bars["top"], coordinate="bend")
    m.revolute("C", bars["top"].at(1, 0, 0), bars["right"].at(1, 0, 0), coordinate="corner")
    m.spring("diagonal", m.ground, bars["right"].at(1, 0, 0), stiffness=k, length=free)
    m.damper("drag", m.ground, bars["right"].at(1, 0, 0), damping=c)
    m.independent("phi")
    m.initial(phi=2.0)
    m.guess(bend=-2.0, psi=2.0)
    return m


def quarter_car() -> eg.Model:
    """Body on suspension on wheel on tyre, heights from the unloaded lengths."""
    p = models.reference("vehicle_linear_models")["quarter_car"]["par"]
    m = eg.Model("quarter_car", gravity=(0, 0, "-g"))
    m.parameter("g", 9.81)
    m.parameter("ks", p["ks"])
    m.input("road")
    wheel, body = m.body("wheel", mass=p["mu"]), m.body("body", mass=p["ms"])
    m.prismatic("hub", m.ground, wheel, axis="z", coordinate="zu")
    m.prismatic("strut", wheel, body, axis="z", coordinate="travel")
    m.actuator("tyre", "hub", value=f"-{p['kt']}*(zu - road) - {p['ct']}*zu_dot")
    m.actuator("spring", "strut", value="-ks*travel")
    m.actuator("shock", "strut", value=f"-{p['cs']}*travel_dot")
    m.output("zs", "zu + travel")
    m.output("acceleration", "zu_ddot + travel_ddot")
    return m


def single_track() -> eg.Model:
    """Single-track car with linear side-slip tyres, driving straight on."""
    p = models.reference("vehicle_linear_models")["single_track"]["par"]
    m = eg.Model("single_track")
    car = m.body("car", mass=p["m"], inertia={"zz": p["Iz"]})
    m.planar("ride", m.ground, car, coordinates=["x", "y", "psi"])
    along = "(x_dot*cos(psi) + y_dot*sin(psi))"
    across = "(y_dot*cos(psi) - x_dot*sin(psi))"
    m.force("front", car.at(p["a"], 0, 0), (0, f"-{p['Cf']}*({across} + {p['a']}*psi_dot)/{along}", 0), axes="body")
    m.force("rear", car.at(-p["b"], 0, 0), (0, f"-{p['Cr']}*({across} - {p['b']}*psi_dot)/{along}", 0), axes="body")
    m.initial(x_dot=p["u"])
    return m


def top(rotation: str) -> eg.Model:
    """Symmetric top about a fixed point, upright in the zero position."""
    m = eg.Model(f"top_{rotation}", gravity=(0, 0, -9.81))
    body = m.body("body", mass=1.0, com=(0, 0, 0.2), inertia=(0.02, 0.02, 0.01))
    m.spherical("S", m.ground, body, rotation=rotation)
    return m


def rssr(rotation: str = "euler_parameters") -> eg.Model:
    """Spatial four-bar with a rod on two ball joints, which keeps its spin free."""
    m = eg.Model("rssr", gravity=(0, 0, "-g"))
    m.parameter("g", 9.81)
    r, l = m.parameter("r", 0.1), m.parameter("l", 0.4)
    crank = m.body("crank", mass=1.0, com=(r / 2, 0, 0), inertia=(1e-3, 2e-3, 2e-3))
    rod = m.body("rod", mass=0.7, com=(l / 2, 0.01, 0), inertia=(1e-4, 3e-3, 3.1e-3))
    rocker = m.body("rocker", mass=0.9, com=(0.1, 0, 0), inertia=(1e-3, 4e-3, 4e-3))
    m.revolute("A", m.ground, crank, coordinate="th")
    m.spherical("S", crank.at(r, 0, 0), rod, rotation=rotation)
    m.revolute("D", m.ground.at(0.4, 0.1, 0.05), rocker, axis="y", coordinate="ph")
    m.spherical("T", rod.at(l, 0, 0), rocker.at(0.25, 0, 0), rotation=rotation)
    m.torque("motor", "A", m.input("tau", 0.2))
    m.damper("d", m.ground.at(0.1, 0.1, 0.1), rod.at(0.3, 0, 0), damping=0.4)
    m.output("height", rod.at(0.2, 0, 0).position[2])
    m.output("push", rod.at(0.2, 0, 0).acceleration[2])
    m.initial(th=0.3, th_dot=5.0)
    return m


def oscillator() -> eg.Model:
    """A mass on a line: m s'' = F - k s - c s' - a s^3, of which m = 1 kg alone is not zero."""
    m = eg.Model("oscillator")
    for name, value in {"m": 1.0, "k": 0.0, "c": 0.0, "a": 0.0}.items():
        m.parameter(name, value)
    m.prismatic("J", m.ground, m.body("mass", mass="m"), axis="x", coordinate="s")
    force = m.input("F")
    m.torque("law", "J", f"{force} - k*s - c*s_dot - a*s**3")
    m.output("force", "F")
    return m


def hopper(apex: bool = False) -> eg.Model:
    """A ball of 1 kg that falls from 1 m and bounces: h' becomes -e h' at the floor; it may be pushed."""
    m = eg.Model("ball" if apex else "hopper", gravity=(0, "-g", 0))
    m.parameter("g", 9.81), m.parameter("e", 0.9)
    m.prismatic("J", m.ground, m.body("ball", mass=1.0), axis="y", coordinate="h")
    m.torque("push", "J", m.input("u"))
    m.initial(h=1.0)
    m.event("floor", "h", direction=-1, reset={"h_dot": "-e*h_dot"})
    if apex:
        m.event("apex", "h_dot", direction=-1)
    return m


BUILT: dict[str, Callable[[], eg.Model]] = {
    "oscillator": oscillator,
    "hopper": hopper,
    "hopper_with_apex": lambda: hopper(apex=True),
    "spring_four_bar": spring_four_bar,
    "quarter_car": quarter_car,
    "single_track": single_track,
    "top_angles": lambda: top("euler_angles"),
    "top_parameters": lambda: top("euler_parameters"),
    "rssr": rssr,
}


@cache
def compiled(name: str, target: str = "numpy") -> Any:
    """A module of a model of this file, of tests/models.py or of the examples; C without optimization."""
    model = BUILT[name]() if name in BUILT else models.build(name)
    return model.compile(target=target, **(models.IN_C if target == "cython" else {}))
