"""Tracked excavator of the 22 t class in the plane of its tracks (sizes of a Cat 320).

Run python tracked_excavator.py [seconds] [FILE.yaml]: it drives so many seconds, 3 unless given, and says how fast;
the model is written to a file if one is named.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from itertools import pairwise
from time import perf_counter
from typing import Any

import numpy as np
from scipy.optimize import brentq

import eomgen as eg


@dataclass(frozen=True)
class Track:
    """Sizes (m) of a track seen from the side, and masses (kg) of both tracks together.

    Links, rollers, carrier rollers and the distance from sprocket to idler are those of a Cat 320 (Caterpillar, 320
    Hydraulic Excavator, Technical Specifications: 49 shoes, 8 and 2 rollers, 3.65 m).  A chain of 190 mm pitch on a
    sprocket of 21 teeth, of which every second one pulls, fits them.  The rest is chosen to be plausible.
    """

    links: int = 49
    pitch: float = 0.19
    rail: float = 0.055  # from the line of the pins to the rails, on which rollers run
    shoe: float = 0.075  # from the line of the pins to the ground
    bushing: float = 0.0295
    teeth: int = 21
    tip: float = 0.015  # of the teeth above the circle of the pins
    rollers: int = 8
    roller: float = 0.085
    carriers: int = 2
    carrier: float = 0.07
    raised: float = 0.03  # of the chain under sprocket and idler above that under the rollers
    masses: tuple[float, ...] = (58.0, 60.0, 40.0, 200.0, 200.0)  # of link, roller, carrier roller, idler, sprocket

    @property
    def sprocket(self) -> float:
        """Radius on which pins go round the sprocket."""
        return self.pitch / (2.0 * math.sin(2.0 * math.pi / self.teeth))

    @property
    def per_turn(self) -> float:
        """Length of chain that a turn of the sprocket moves."""
        return 0.5 * self.teeth * self.pitch

    @property
    def idler(self) -> float:
        """Radius of the idler, on which the rails lie while pins go round as on the sprocket."""
        return math.sqrt(self.sprocket**2 - (0.5 * self.pitch) ** 2) - self.rail

    @property
    def half(self) -> float:
        """Half the distance from sprocket to idler."""
        return 0.5 * (0.5 * self.links * self.pitch - math.pi * self.sprocket)

    @property
    def low(self) -> float:
        """Height of the pins under the rollers, from the axis of the sprocket."""
        return -self.sprocket - self.raised

    @property
    def height(self) -> float:
        """Height of the axis of the sprocket above the ground."""
        return self.shoe - self.low

    def wheels(self) -> dict[str, tuple[float, float, float]]:
        """Place and radius of rollers and carrier rollers in the frame."""
        found = {}
        for kind, count, reach, pins, way in (
            ("roller", self.rollers, 0.82, self.low, 1.0),
            ("carrier", self.carriers, 0.3, self.sprocket, -1.0),
        ):
            radius = getattr(self, kind)
            for k, x in enumerate(self.half * np.linspace(-reach, reach, count)):
                found[f"{kind}{k}"] = (float(x), pins + way * (self.rail + radius), radius)
        return found

    def laid(self) -> tuple[float, np.ndarray]:
        """Where the idler is when the chain lies taut around the wheels, and the places of the pins, closed."""
        under = [(x, y, r + self.rail) for name, (x, y, r) in self.wheels().items() if name.startswith("roller")]

        def walk(idler: float) -> np.ndarray:
            circles = [(-self.half, 0.0, self.sprocket), (idler, 0.0, self.sprocket), *under]
            return _walk(_belt(circles), self.pitch, self.links)

        def gap(idler: float) -> float:
            pins = walk(idler)
            return float((pins[-1] - pins[0])[1])

        idler = round(float(brentq(gap, self.half - 0.4 * self.pitch, self.half + 0.4 * self.pitch)), 9)
        return idler, walk(idler)


def _belt(circles: list[tuple[float, float, float]], parts: int = 8000) -> np.ndarray:
    """A taut belt around circles (x, y, radius) as points, counterclockwise from the leftmost one."""
    angles = math.pi + 2.0 * math.pi * np.arange(parts + 1) / parts
    along = np.array([np.cos(angles), np.sin(angles)])
    x, y, r = np.array(circles)[np.argmax([np.array([x, y]) @ along + r for x, y, r in circles], axis=0)].T
    return np.array([x + r * along[0], y + r * along[1]]).T


def _walk(belt: np.ndarray, pitch: float, count: int) -> np.ndarray:
    """So many steps of equal straight lengths along a belt, more than once round if need be."""
    line = np.concatenate([belt, belt[1:]])
    places, k = [line[0]], 0
    for _ in range(count):
        here = places[-1]
        while np.hypot(*(line[k + 1] - here)) < pitch:
            k += 1
        along, back = line[k + 1] - line[k], line[k] - here
        a, b, c = along @ along, along @ back, back @ back - pitch**2
        places.append(line[k] + along * (math.sqrt(b * b - a * c) - b) / a)
    return np.array(places)


GROUND = {
    "law": {"stiffness": "k_ground", "dissipation": 0.5},
    "friction": {"dynamic": "mu_ground", "smoothing": "slip"},
}
STEEL = {
    "law": {"stiffness": "k_wheels", "dissipation": 0.5},
    "friction": {"dynamic": "mu_wheels", "smoothing": "slip"},
}


def undercarriage(m: eg.Model, track: Track, mass: float, inertia: Any, ground: Any = None, soil: str = "") -> Any:
    """Add frame, wheels and chain to a model, and the contacts between them; the frame is returned.

    The ground, a flat one unless a shape is given, is hard but for the named soil.
    """
    m.parameter("k_ground", 1e8, doc="of a corner of a shoe on the ground (N/m^1.5)")
    m.parameter("mu_ground", 0.7)
    m.parameter("k_wheels", 8e8, doc="of rails on rollers, bushings on the sprocket (N/m^1.5)")
    m.parameter("mu_wheels", 0.15)
    m.parameter("slip", 0.02, unit="m/s", doc="sliding from which friction is full")
    m.parameter("pretension", 40e3, unit="N", doc="of the springs behind the idlers")
    m.parameter("recoil", 1e6, unit="N/m", doc="their stiffness")
    m.parameter("gain", 1e5, doc="torque of the motors for a lack of speed (N m s)")
    m.parameter("relief", 66e3, unit="N*m", doc="most that the motors give: 205 kN of pull")
    m.parameter("rotors", 100.0, doc="inertia of the motors behind their gears (kg m^2)")
    m.input("speed", 0.0)
    one = dict(zip(("link", "roller", "carrier", "idler", "sprocket"), track.masses, strict=True))
    idler, pins = track.laid()
    frame = m.body("frame", mass=mass, inertia=inertia)
    m.planar("frame", m.ground, frame, coordinates=["x", "y", "pitch"])

    def wheel(name: str, at: Any, radius: float, **keys: Any) -> Any:
        of = one[name.rstrip("0123456789")]
        body = m.body(name, mass=of, inertia={"zz": 0.5 * of * radius**2})
        m.revolute(name, at, body, **keys)
        return body

    forward = {"axis": (0, 0, -1), "armature": "rotors"}
    sprocket = wheel("sprocket", frame.at(-track.half, 0, 0), track.sprocket, **forward)
    slide = m.body("slide", mass=0.2 * one["idler"])
    m.prismatic("tensioner", frame.at(idler, 0, 0), slide, axis="x")
    m.element("recoil_spring", joint="tensioner", law="pretension - recoil*length - 2e4*rate")
    wheels = [{"shape": "circle", "on": wheel("idler", slide, track.idler), "radius": track.idler}]
    for name, (x, y, radius) in track.wheels().items():
        wheels.append({"shape": "circle", "on": wheel(name, frame.at(x, y, 0), radius), "radius": radius})
    turning = one["link"] * (track.pitch**2 + (track.rail + track.shoe) ** 2) / 12
    com = (track.pitch / 2, -0.01, 0)
    links = [m.body(f"link{k}", mass=one["link"], com=com, inertia={"zz": turning}) for k in range(track.links)]
    m.planar("chain", m.ground, links[0], coordinates=["chain_x", "chain_y", "turn0"])
    for k in range(1, track.links):
        m.revolute(f"turn{k}", links[k - 1].at(track.pitch, 0, 0), links[k])
    m.revolute("closure", links[-1].at(track.pitch, 0, 0), links[0])
    along = np.unwrap([math.atan2(b[1] - a[1], b[0] - a[0]) for a, b in pairwise(pins)])
    turns = [round(float(turn), 9) for turn in np.diff(along, prepend=0.0)]
    m.initial(x=0.0, y=track.height, pitch=0.0)
    m.initial(chain_x=float(pins[0][0]), chain_y=float(pins[0][1]) + track.height)
    for k, turn in enumerate(turns):  # two of them follow from the closure
        (m.initial if k < track.links - 2 else m.guess)(**{f"turn{k}": turn})

    def line(radius: float, y: float, length: float) -> dict[str, Any]:
        on = [link.at(track.pitch / 2, y, 0) for link in links]
        return {"shape": "segment", "on": on, "length": length, "radius": radius}

    rails = line(0.01, track.rail - 0.01, track.pitch - 0.01)
    shoes = line(0.015, 0.015 - track.shoe, track.pitch - 0.04)
    teeth = {
        "shape": "sprocket",
        "on": sprocket.at(0, 0, 0, rpy=(0, 0, math.pi)),
        "teeth": track.teeth,
        "pitch": 2.0 * track.sprocket * math.sin(math.pi / track.teeth),
        "seat": track.bushing + 0.0005,
        "tip_radius": track.sprocket + track.tip,
    }
    laws: dict[str, Any] = GROUND
    if soil:  # shoes of 0.6 m, of both tracks
        under = [link.at(track.pitch / 2, -track.shoe, 0) for link in links]
        shoes = {"shape": "plate", "on": under, "length": track.pitch, "width": 1.2}
        laws = {"soil": {"type": soil, "contact_width": 0.6, "dissipation": 1.0, "lateral": False}}
    m.contacts("ground", shoes, {"shape": "half_plane", "on": m.ground, **(ground or {})}, **laws)
    m.contacts("wheels", rails, wheels, **STEEL)
    m.contacts("mesh", {"shape": "circle", "on": links, "radius": track.bushing}, teeth, **STEEL)
    m.torque("motor", "sprocket", "max(-relief, min(relief, gain*(speed - sprocket_dot)))")
    m.output("chain_speed", f"sprocket_dot*{track.per_turn / (2.0 * math.pi)!r}", unit="m/s")
    m.output("drive", "power(motor)", unit="W")
    return frame


#: Bore, stroke and length when closed (m), rods and how many there are: strokes and bores from the data sheet.
CYLINDERS = {
    "boom": (0.12, 1.26, 1.48, 0.085, 2),
    "stick": (0.14, 1.504, 2.1, 0.1, 1),
    "bucket": (0.12, 1.104, 1.6, 0.085, 1),
}
#: Pressures (Pa) that hold the equipment where it starts.
HELD = {"boom_p": 11.7e6, "boom_q": 4.2e6, "stick_p": 1.5e6, "stick_q": 5.7e6, "bucket_p": 0.8e6, "bucket_q": 1.2e6}


def cylinder(m: eg.Model, name: str, a: Any, b: Any) -> None:
    """A double-acting hydraulic cylinder between two markers: the pressures of both chambers are states.

    The valve lets oil in and out in the ratio of the areas, as much as its input says of the most; relief valves open
    above 35 MPa, check valves below 0.
    """
    bore, stroke, closed, rod, count = CYLINDERS[name]
    head = count * math.pi / 4 * bore**2
    ring = count * math.pi / 4 * (bore**2 - rod**2)
    area, back = m.parameter(f"{name}_area", head, unit="m^2"), m.parameter(f"{name}_ring", ring, unit="m^2")
    m.input(f"{name}_valve", 0.0)
    m.actuator(f"{name}_cylinder", a, b, f"{name}_area*{name}_p - {name}_ring*{name}_q")
    long, speed = f"(length({name}_cylinder) - {closed})", f"rate({name}_cylinder)"
    for p, size, left, way in (("p", area, long, 1), ("q", back, f"({stroke} - {long})", -1)):
        state = f"{name}_{p}"
        oil = f"{size}*({way}*({name}_valve*flow/{name}_area - {speed}))"
        valves = f"open_relief*(max(0, -{state}) - max(0, {state} - p_relief))"
        rate = f"bulk*({oil} + {valves})/(dead + {size}*max(0.05, {left}))"
        m.state(state, rate, initial=HELD[state], unit="Pa")


def superstructure(m: eg.Model, frame: Any, height: float) -> Any:
    """Add the slewing upper structure with boom, stick, bucket and its four-bar; the bucket is returned.

    Reach of boom and stick, tip radius of the bucket, counterweight and speed of slewing are those of the data sheet.
    """
    m.parameter("bulk", 1.2e9, unit="Pa", doc="bulk modulus of the oil in hoses")
    m.parameter("dead", 4e-3, unit="m^3", doc="volume of hoses")
    m.parameter("flow", 429e-3 / 60 / 2, unit="m^3/s", doc="of one of both pumps")
    m.parameter("p_relief", 35e6, unit="Pa")
    m.parameter("open_relief", 2e-9, doc="flow through an open valve for the pressure above its own (m^3/s/Pa)")
    m.input("slewing", 0.0)
    upper = m.body("upper", mass=10258, com=(-1.0, 0.9, 0), inertia=(9000, 26000, 24000))  # 4.2 t of it counterweight
    m.revolute("slew", frame.at(0, 1.0 - height, 0), upper, axis="y")
    m.torque("slew_motor", "slew", "2e5*(slewing - slew_dot)")
    boom = m.body("boom", mass=1900, com=(2.7, 0.55, 0), inertia=(250, 6300, 6300))
    stick = m.body("stick", mass=1000, com=(0.75, 0.1, 0), inertia=(70, 1050, 1050))
    bucket = m.body("bucket", mass=1000, com=(0.7, 0.15, 0), inertia=(260, 330, 330))
    rocker = m.body("rocker", mass=50, com=(0.3, 0, 0), inertia=(1, 2.5, 2.5))
    link = m.body("link", mass=50, com=(0.3, 0, 0), inertia=(1, 2.5, 2.5))
    m.revolute("boom_angle", upper.at(0.15, 0.8, 0), boom)
    m.revolute("stick_angle", boom.at(5.7, 0, 0), stick)
    m.revolute("bucket_angle", stick.at(2.9, 0, 0), bucket)
    m.revolute("rocker_angle", stick.at(2.47, 0, 0), rocker)
    m.revolute("link_angle", rocker.at(0.6, 0, 0), link)
    m.revolute("bucket_pin", link.at(0.6, 0, 0), bucket.at(0.05, 0.45, 0))
    cylinder(m, "boom", upper.at(0.8, 0.45, 0), boom.at(2.2, 0.5, 0))
    cylinder(m, "stick", boom.at(2.85, 1.1, 0), stick.at(-0.65, 0.38, 0))
    cylinder(m, "bucket", stick.at(0.32, 0.53, 0), rocker.at(0.6, 0, 0))
    m.initial(slew=0.0, boom_angle=0.45, stick_angle=-1.6, bucket_angle=-0.6)
    m.guess(rocker_angle=2.0, link_angle=-1.6)
    m.output("tip_x", bucket.at(1.47, 0, 0).position[0])
    m.output("tip_y", bucket.at(1.47, 0, 0).position[1])
    return bucket


def build(track: Track | None = None, ground: Any = None, soil: str = "") -> eg.Model:
    """The whole machine; gravity is turned by ``slope``, so that the ground climbs along x.

    It moves in the plane of its tracks: what the slewing upper structure exerts across is carried by the frame.
    """
    track = track or Track()
    doc = "Excavator of the 22 t class on chains of 49 links (sizes of a Cat 320, the rest plausible)."
    m = eg.Model("tracked_excavator", gravity=("-g*sin(slope)", "-g*cos(slope)", 0), doc=doc)
    m.parameter("g", 9.81)
    m.parameter("slope", 0.0, doc="angle of the ground (rad)")
    frame = undercarriage(m, track, 3900, (2500, 7000, 5500), ground, soil)
    superstructure(m, frame, track.height)
    m.simulation(end=2, method="RK45", rtol=1e-4, atol=1e-5)
    return m


def main() -> None:
    """Build the machine, drive, and compare its speed with that of the chain."""
    m = build()
    if len(sys.argv) > 2:
        m.save(sys.argv[2])
    start = perf_counter()
    mod = m.compile()
    print(f"{len(m.bodies)} bodies, {mod.n_x} states, built in {perf_counter() - start:.1f} s")
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 3.0
    start = perf_counter()
    run = mod.simulate(seconds, inputs={"speed": ([0, 1], [0, 3])}, method="RK45", rtol=1e-4, atol=1e-5)
    print(f"drove {run['x'][-1]:.3f} m in {seconds:g} s, {perf_counter() - start:.1f} s of computing;", end=" ")
    print(f"{run['x_dot'][-1]:.3f} m/s, the chain {run['chain_speed'][-1]:.3f} m/s")


if __name__ == "__main__":
    main()
