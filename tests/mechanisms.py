"""Random mechanisms for tests, made straight from numbers: trees with mixed joints, planar and spatial, with loops."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from eomgen.describe.mechanism import Body, JointSpec, Mechanism
from eomgen.forces import Actuator, Damper, Force, JointCoordinate, Line, PointForce, Spring
from eomgen.frames import GROUND, Frame, Marker
from eomgen.graph import Graph, vectors
from eomgen.graph.core import Expr, cos, sin
from eomgen.joints import JOINTS, Joint, Shape

#: Types that can be in the tree.
SPATIAL = tuple(name for name, joint in JOINTS.items() if joint.role != "loop")
PLANAR = ("revolute", "prismatic_x", "planar", "weld")


@dataclass(frozen=True)
class Placement:
    """A marker as numbers."""

    rotation: np.ndarray
    position: np.ndarray


@dataclass(frozen=True)
class Random:
    """A random mechanism with the numbers it was made from."""

    mechanism: Mechanism
    parents: list[int]
    kinds: list[str]
    outer: list[Placement]
    inner: list[Placement]
    masses: np.ndarray
    centers: np.ndarray
    inertias: np.ndarray
    gravity: np.ndarray


def matrix(graph: Graph, values: np.ndarray) -> vectors.Mat3:
    """A constant 3 x 3 matrix."""
    return tuple(tuple(graph.constant(x) for x in row) for row in values.tolist())  # type: ignore[return-value]


def frame(graph: Graph, placement: Placement) -> Frame:
    """A constant frame."""
    return Frame(matrix(graph, placement.rotation), vectors.vector(graph, placement.position.tolist()))


def make_joint(graph: Graph, kind: str, names: Sequence[str], rotation: str = "euler_angles") -> Joint:
    """A joint of a type, with options that exercise all of its terms."""
    own = [graph.symbol(name) for name in names]
    options: dict[str, Callable[[], object]] = {
        "rotation": lambda: rotation,
        "pitch": lambda: graph.constant(PITCH),
        "length": lambda: graph.constant(LENGTH),
        "curve": lambda: Shape(curve_point(own[0]), (own[0],)),
        "surface": lambda: Shape(surface_point(own[0], own[1]), (own[0], own[1])),
    }
    return JOINTS[kind](**{key: options[key]() for key in JOINTS[kind].options if key in options})


PITCH, LENGTH = 0.7, 1.3


def curve_point(s: Expr) -> vectors.Vec3:
    """A space curve: a wound and stretched helix."""
    return (cos(2.0 * s) + 0.3 * s, 0.8 * sin(2.0 * s), s + 0.2 * s * s)


def surface_point(u: Expr, v: Expr) -> vectors.Vec3:
    """A bumpy saddle whose parameters are not at right angles."""
    return (u + 0.2 * v, v + 0.1 * sin(u), u * v + 0.3 * u * u)


def _inertia(random: np.random.Generator) -> np.ndarray:
    """A physical tensor: second moments of a cloud of points."""
    points = random.normal(size=(6, 3)) * random.uniform(0.1, 0.4, 3)
    return sum(np.eye(3) * (p @ p) - np.outer(p, p) for p in points)


def random_mechanism(
    seed: int,
    bodies: int,
    planar: bool = False,
    reverse: bool = False,
    forces: bool = True,
    loop: bool = False,
    types: Sequence[str] = SPATIAL,
    rotation: str = "euler_angles",
) -> Random:
    """A tree of mixed joints; ``loop`` adds a joint that closes a loop wherever the tree's zero position puts it.

    ``rotation`` is that of spherical and free joints.
    """
    random = np.random.default_rng(seed)
    graph = Graph()
    parents: list[int] = []
    kinds: list[str] = []
    outer: list[Placement] = []
    inner: list[Placement] = []
    for k in range(bodies):
        parents.append(int(random.integers(-1, k)) if random.random() < 0.5 else k - 1)
        kinds.append(str(random.choice(("revolute", "prismatic", "revolute", "planar") if planar else types)))
        for side in (outer, inner):
            side.append(_placement(random, planar, kinds[-1], len(side) == 0))
    if all(kind == "weld" for kind in kinds):
        kinds[0] = "revolute"
    masses = random.uniform(0.5, 2.0, bodies)
    centers = random.uniform(-0.4, 0.4, (bodies, 3)) * (np.array([1, 1, 0]) if planar else 1)
    inertias = np.array([_inertia(random) for _ in range(bodies)])
    if planar:
        inertias = np.array([np.diag(np.diag(i)) for i in inertias])
    gravity = np.array([0.3, -9.81, 0.0 if planar else 0.7])
    specs = []
    for k in range(bodies):
        names = tuple(f"q{k}{c.suffix}" for c in JOINTS[kinds[k]].coordinates)
        joint = make_joint(graph, kinds[k], names, rotation)
        names = tuple(f"q{k}{c.suffix}" for c in joint.coordinates)
        a = Marker(parents[k], frame(graph, outer[k]), f"o{k}")
        b = Marker(k, frame(graph, inner[k]), f"i{k}")
        turned = reverse and random.random() < 0.5
        specs.append(JointSpec(f"q{k}", joint, *((b, a) if turned else (a, b)), names, False))
    elements: list[Force] = []
    if forces:
        named = [pair for s in specs for pair in zip(s.coordinates, s.joint.coordinates, strict=True)]
        coordinates = [name for name, coordinate in named if coordinate.kind != "parameter"]
        here = Marker(bodies - 1, frame(graph, _placement(random, planar, "", False)), "here")
        there = Marker(GROUND, Frame(vectors.identity(graph), vectors.vector(graph, (3.0, 2.0, 0.0))), "there")
        line = Line(there, here)
        for along in map(JointCoordinate, coordinates[:1]):
            elements += [
                Spring("t", along, graph.constant(3.0), graph.constant(0.2)),
                Damper("f", along, graph.constant(0.4)),
                Actuator("a", along, graph.symbol("t") * 2.0 + 0.3),
            ]
        elements += [
            Spring("s", line, graph.constant(20.0), graph.constant(1.0)),
            Damper("d", line, graph.constant(1.5)),
            PointForce("p", here, vectors.vector(graph, (1.0, -2.0, 0.0)), "body"),
        ]
    mechanism = Mechanism(
        name=f"random_{seed}",
        graph=graph,
        parameters=(),
        inputs=(),
        gravity=vectors.vector(graph, gravity.tolist()),
        bodies=tuple(
            Body(
                f"b{k}",
                graph.constant(masses[k]),
                vectors.vector(graph, centers[k].tolist()),
                matrix(graph, inertias[k]),
            )
            for k in range(bodies)
        ),
        joints=tuple(specs),
        forces=tuple(elements),
        outputs=(),
    )
    made = Random(mechanism, parents, kinds, outer, inner, masses, centers, inertias, gravity)
    return with_loop(made, random, planar) if loop else made


def _placement(random: np.random.Generator, planar: bool, kind: str, first: bool) -> Placement:
    position = random.uniform(-0.8, 0.8, 3)
    if planar:
        position[2] = 0.0
        turn = Rotation.from_euler("z", random.uniform(-1, 1))
        if kind == "prismatic":  # its z axis lies in the plane, on both sides alike
            turn = Rotation.from_matrix(np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]))
            return Placement(np.round(turn.as_matrix()), position)
        return Placement(turn.as_matrix(), position)
    return Placement(Rotation.random(random_state=int(random.integers(2**31))).as_matrix(), position)


def with_loop(made: Random, random: np.random.Generator, planar: bool) -> Random:
    """Close a loop from the last body to ground by a joint that fits the position q = start."""
    from dataclasses import replace

    from eomgen.graph import evaluate
    from eomgen.kinematics import analyse

    m = made.mechanism
    kinematics = analyse(m)
    start = random.uniform(0.2, 0.7, len(kinematics.q))
    last = len(m.bodies) - 1
    graph = m.graph
    pose = kinematics.poses.marker(Marker(last, Frame(vectors.identity(graph), vectors.zero(graph)), ""))
    flat = evaluate(
        [*(x for row in pose.rotation for x in row), *pose.position],
        dict(zip(kinematics.names, start.tolist(), strict=True)) | {"t": 0.0},
    )
    rotation, position = np.array(flat[:9], dtype=float).reshape(3, 3), np.array(flat[9:], dtype=float)
    kind = "revolute" if planar else "spherical"
    hold = Placement(np.eye(3) if planar else rotation, position)
    joint = JOINTS[kind]()
    spec = JointSpec(
        "close",
        joint,
        Marker(GROUND, frame(graph, hold), "hold"),
        Marker(last, Frame(vectors.identity(graph), vectors.zero(graph)), "tip"),
        tuple(f"close{c.suffix}" for c in joint.coordinates),
        False,
    )
    guess = {n: graph.constant(x) for n, x in zip(kinematics.names, start.tolist(), strict=True)}
    return replace(made, mechanism=replace(m, joints=(*m.joints, spec), guess=guess))
