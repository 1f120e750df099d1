"""Tracked excavator of the 22 t class in the plane of its tracks: python tracked_excavator.py [seconds]."""

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
    tooth: float = 0.017  # half the thickness
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

    def places(self, rollers: int, reach: float) -> list[float]:
        """Places of rollers along the frame."""
        return [float(x) for x in self.half * np.linspace(-reach, reach, rollers)]

    def laid(self) -> tuple[float, np.ndarray]:
        """Where the idler is when the chain lies taut around the wheels, and the places of the pins, closed."""
        rollers = [(x, self.low + self.rail + self.roller, self.roller + self.rail) for x in self.places(self.rollers, 0.82)]

        def walk(idler: float) -> tuple[float, np.ndarray]:
            circles = [(-self.half, 0.0, self.sprocket), (idler, 0.0, self.sprocket), *rollers]
            pins = _walk(_belt(circles), self.pitch, self.links)
            return float((pins[-1] - pins[0])[1]), pins

        idler = float(brentq(lambda x: walk(x)[0], self.half - 0.4 * self.pitch, self.half + 0.4 * self.pitch))
        return idler, walk(idler)[1]


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


GROUND = {"stiffness": "k_ground", "dissipation": 0.5, "friction": "mu_ground", "smoothing": "slip"}
WHEELS = {"stiffness": "k_wheels", "dissipation": 0.5, "friction": "mu_wheels", "smoothing": "slip"}


def undercarriage(m: eg.Model, track: Track, mass: float, inertia: float, ground: Any = None) -> Any:
    """Add frame, wheels and chain to a model, and the contacts between them; the frame is returned."""
    m.parameter("k_ground", 1e8, doc="of a corner of a shoe on the ground (N/m^1.5)")
    m.parameter("mu_ground", 0.7)
    m.parameter("k_wheels", 8e8, doc="of rails on rollers, bushings on the sprocket (N/m^1.5)")
    m.parameter("mu_wheels", 0.15)
    m.parameter("slip", 0.02, unit="m/s", doc="sliding from which friction is full")
    m.parameter("pretension", 40e3, unit="N", doc="of the spring behind the idlers")
    m.parameter("recoil", 1e6, unit="N/m", doc="its stiffness")
    m.parameter("gain", 1e5, doc="torque of the motors for a lack of speed (N m s)")
    m.parameter("rotors", 100.0, doc="inertia of the motors behind their gears (kg m^2)")
    m.parameter("relief", 66e3, unit="N*m", doc="most that the motors give")
    m.input("speed", 0.0)
    one = dict(zip(("link", "roller", "carrier", "idler", "sprocket"), track.masses, strict=True))
    idler, pins = track.laid()
    height = track.shoe - track.low
    frame = m.body("frame", mass=mass, inertia={"zz": inertia})
    m.planar("frame", m.ground, frame, coordinates=["x", "y", "pitch"])

    def wheel(name: str, at: Any, kind: str, radius: float, **keys: Any) -> Any:
        body = m.body(name, mass=one[kind], inertia={"zz": 0.5 * one[kind] * radius**2})
        m.revolute(name, at, body, **keys)
        return body

    sprocket = wheel("sprocket", frame.at(-track.half, 0, 0), "sprocket", track.sprocket, axis=(0, 0, -1), armature="rotors")
    slide = m.body("slide", mass=0.2 * one["idler"])
    m.prismatic("tensioner", frame.at(idler, 0, 0), slide, axis="x")
    m.element("recoil_spring", joint="tensioner", law="pretension - recoil*length - 2e4*rate")
    wheels = [{"shape": "circle", "on": wheel("idler", slide, "idler", track.idler), "radius": track.idler}]
    for kind, count, reach, y in (
        ("roller", track.rollers, 0.82, track.low + track.rail + track.roller),
        ("carrier", track.carriers, 0.3, track.sprocket - track.rail - track.carrier),
    ):
        radius = getattr(track, kind)
        on = [wheel(f"{kind}{k}", frame.at(x, y, 0), kind, radius) for k, x in enumerate(track.places(count, reach))]
        wheels.append({"shape": "circle", "on": on, "radius": radius})
    size = track.pitch**2 + (track.rail + track.shoe) ** 2
    links = [m.body(f"link{k}", mass=one["link"], com=(track.pitch / 2, -0.01, 0), inertia={"zz": one["link"] * size / 12})
             for k in range(track.links)]  # fmt: skip
    directions = np.unwrap([math.atan2(b[1] - a[1], b[0] - a[0]) for a, b in pairwise(pins)])
    m.planar("chain", m.ground, links[0], coordinates=["chain_x", "chain_y", "turn0"])
    for k in range(1, track.links):
        m.revolute(f"turn{k}", links[k - 1].at(track.pitch, 0, 0), links[k])
    m.revolute("closure", links[-1].at(track.pitch, 0, 0), links[0])
    m.initial(x=0.0, y=height, pitch=0.0, chain_x=float(pins[0][0]), chain_y=float(pins[0][1]) + height)
    m.initial(turn0=float(directions[0]))
    for k in range(1, track.links):
        (m.initial if k < track.links - 2 else m.guess)(**{f"turn{k}": float(directions[k] - directions[k - 1])})

    def line(radius: float, y: float, length: float) -> dict[str, Any]:
        on = [link.at(track.pitch / 2, y, 0) for link in links]
        return {"shape": "segment", "on": on, "length": length, "radius": radius}

    rails = line(0.01, track.rail - 0.01, track.pitch - 0.01)
    shoes = line(0.015, 0.015 - track.shoe, track.pitch - 0.04)
    step = 2.0 * math.pi / track.teeth
    root = track.sprocket - track.bushing
    on = []
    for k in range(track.teeth):
        angle = math.pi - (k + 0.5) * step
        half = 0.5 * (root + track.sprocket)
        place = (half * math.cos(angle), -half * math.sin(angle), 0)
        on.append(sprocket.at(*place, rpy=(0, 0, -angle)))
    teeth = [{"shape": "circle", "on": sprocket, "radius": root},
             {"shape": "segment", "on": on, "length": track.sprocket - root, "radius": track.tooth}]  # fmt: skip
    m.contacts("ground", shoes, ground or {"shape": "half_plane", "on": m.ground}, GROUND)
    m.contacts("wheels", rails, wheels, WHEELS)
    m.contacts("mesh", {"shape": "circle", "on": links, "radius": track.bushing}, teeth, WHEELS)
    m.torque("motor", "sprocket", "max(-relief, min(relief, gain*(speed - sprocket_dot)))")
    return frame
