"""Five arms with every parameter a symbol, as papers on the dynamics of robots count their operations.

Geometry in modified Denavit-Hartenberg parameters (W. Khalil, J.-F. Kleinfinger 1986; J. J. Craig), every link frame at
its joint; ten inertial parameters a link: mass, first moments and inertia tensor about the link frame.  No friction and
no motors.  Distances and gravity are symbols, angles between axes are quarter turns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import pi

import eomgen as eg
from eomgen.describe.mechanism import Body, Mechanism
from eomgen.graph import vectors as vec
from eomgen.graph.core import Graph
from eomgen.kinematics.inertia import SpatialInertia

#: One joint: quarter turns alpha and distance a along x of the joint before, then the joint's kind and the distance d
#: along its own z; distances are names of parameters.
Joint = tuple[int, str, str, str]

#: PUMA 560: J. J. Craig, Introduction to Robotics, fig. 3.21.  RX-90 and Stanford arm: W. Khalil, E. Dombre, Modeling,
#: Identification and Control of Robots, tables 3.1 and 3.2.  Panda: Franka Robotics' own table.  iiwa: KUKA LBR iiwa 7.
ARMS: dict[str, tuple[Joint, ...]] = {
    "puma560": (
        (0, "", "revolute", ""),
        (-1, "", "revolute", ""),
        (0, "a2", "revolute", "d3"),
        (-1, "a3", "revolute", "d4"),
        (1, "", "revolute", ""),
        (-1, "", "revolute", ""),
    ),
    "stanford": (
        (0, "", "revolute", ""),
        (-1, "", "revolute", "r2"),
        (1, "", "prismatic", ""),
        (0, "", "revolute", ""),
        (-1, "", "revolute", ""),
        (1, "", "revolute", ""),
    ),
    "rx90": (
        (0, "", "revolute", ""),
        (1, "", "revolute", ""),
        (0, "d3", "revolute", ""),
        (-1, "", "revolute", "r4"),
        (1, "", "revolute", ""),
        (-1, "", "revolute", ""),
    ),
    "panda": (
        (0, "", "revolute", "d1"),
        (-1, "", "revolute", ""),
        (1, "", "revolute", "d3"),
        (1, "a4", "revolute", ""),
        (-1, "-a4", "revolute", "d5"),
        (1, "", "revolute", ""),
        (1, "a7", "revolute", ""),
    ),
    "iiwa": (
        (0, "", "revolute", "d1"),
        (-1, "", "revolute", ""),
        (1, "", "revolute", "d3"),
        (1, "", "revolute", ""),
        (-1, "", "revolute", "d5"),
        (-1, "", "revolute", ""),
        (1, "", "revolute", "d7"),
    ),
}

TENSOR = ("xx", "xy", "xz", "yy", "yz", "zz")


def arm(name: str) -> Mechanism:
    """One of :data:`ARMS`; gravity acts along -z of ground."""
    m = eg.Model(name, gravity=(0, 0, "-g"))
    m.parameter("g")
    distances = {d.lstrip("-") for joint in ARMS[name] for d in (joint[1], joint[3])} - {""}
    for distance in sorted(distances):
        m.parameter(distance)
    previous = m.ground
    for k, (quarters, a, kind, d) in enumerate(ARMS[name], 1):
        for symbol in (f"m{k}", *(f"h{k}{axis}" for axis in "xyz"), *(f"J{k}{entry}" for entry in TENSOR)):
            m.parameter(symbol)
        # Rx(alpha) Tx(a) Rz(theta) Tz(d): d is along the turned z
        z = d or "0"
        place = (a or "0", {0: "0", 1: f"-({z})", -1: z}[quarters], {0: z, 1: "0", -1: "0"}[quarters])
        link = m.body(f"link{k}", mass=f"m{k}")
        {"revolute": m.revolute, "prismatic": m.prismatic}[kind](
            f"q{k}", previous.at(*place, rpy=(quarters * pi / 2, 0, 0)), link
        )
        previous = link
    made = m.mechanism()
    return replace(made, bodies=tuple(_barycentric(made.graph, k, b) for k, b in enumerate(made.bodies, 1)))


def _barycentric(graph: Graph, k: int, body: Body) -> Body:
    """The body with first moments and inertia about its origin for parameters."""
    moment = vec.vector(graph, [graph.symbol(f"h{k}{axis}") for axis in "xyz"])
    xx, xy, xz, yy, yz, zz = (graph.symbol(f"J{k}{entry}") for entry in TENSOR)
    origin = ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))
    com = vec.scale(1.0 / body.mass, moment)
    about_com = SpatialInertia(body.mass, moment, origin).shifted(vec.neg(com))
    return replace(body, com=com, inertia=about_com.inertia, moment=moment, inertia_origin=origin)


def values(name: str, random: Sequence[float]) -> dict[str, float]:
    """Numbers for all parameters of an arm, in the order of its parameters."""
    return dict(zip((p.name for p in arm(name).parameters), random, strict=True))
