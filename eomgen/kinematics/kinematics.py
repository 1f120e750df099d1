"""Stage kinematics: Mechanism -> Kinematics, everything about the motion that every method of derivation shares."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, fields, is_dataclass

from ..describe.mechanism import Mechanism
from ..errors import ModelError
from ..forces import CoordinateLoad, Force, JointCoordinate, Load, MarkerLoad, Turn
from ..frames import GROUND
from ..graph import vectors as vec
from ..graph.core import Expr, Graph
from ..graph.differentiate import jacobian, jvp
from ..graph.substitute import substitute, symbols_of
from .loops import Constraints, close_loop, differentiate_constraints, lagrangian_rows
from .motion import Motion
from .topology import Topology, find_topology
from .tree import Link, Poses, Twist, build_links, link_twists


@dataclass(frozen=True)
class LoopCoordinates:
    """Coordinates y of cut joints as functions of the tree: values, rates, accelerations and dy/dq (n_k rows)."""

    names: tuple[str, ...] = ()
    kinds: tuple[str, ...] = ()
    values: tuple[Expr, ...] = ()
    rates: tuple[Expr, ...] = ()
    accelerations: tuple[Expr, ...] = ()
    jacobian: tuple[tuple[Expr, ...], ...] = ()


@dataclass(frozen=True)
class ForceTerms:
    """One force element resolved: its loads, and its potential if it has one.

    The last two hold those of its loads that the potential does not account for; all loads where there is none.
    """

    force: Force
    marker_loads: tuple[MarkerLoad, ...]
    coordinate_loads: tuple[CoordinateLoad, ...]
    potential: Expr | None
    marker_remainder: tuple[MarkerLoad, ...]
    coordinate_remainder: tuple[CoordinateLoad, ...]


@dataclass(frozen=True)
class Kinematics:
    """The tree, its motion, loop constraints and resolved forces, in (t, q, v, a), inputs and parameters.

    ``q``, ``v``, ``a`` are the coordinates of the spanning tree, their rates and accelerations, in the order of
    ``names``; q' = v.  ``parent[j]`` is the coordinate next to coordinate j towards ground, -1 for none.
    """

    mechanism: Mechanism
    topology: Topology
    names: tuple[str, ...]
    kinds: tuple[str, ...]
    q: tuple[Expr, ...]
    v: tuple[Expr, ...]
    a: tuple[Expr, ...]
    t: Expr
    parent: tuple[int, ...]
    links: tuple[Link, ...]
    poses: Poses
    twists: tuple[Twist, ...]
    motion: Motion
    constraints: Constraints
    loop_coordinates: LoopCoordinates
    forces: tuple[ForceTerms, ...]
    length_scale: Expr

    @property
    def graph(self) -> Graph:
        """The graph of all expressions."""
        return self.mechanism.graph

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the parameters, in the order of p."""
        return tuple(p.name for p in self.mechanism.parameters)

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the inputs, in the order of u."""
        return tuple(u.name for u in self.mechanism.inputs)

    def total_derivative(self, expressions: Sequence[Expr]) -> list[Expr]:
        """d/dt along q' = v, v' = a, t' = 1."""
        along = dict(zip(self.q, self.v, strict=True)) | dict(zip(self.v, self.a, strict=True))
        return jvp(list(expressions), along | {self.t: self.graph.one})

    def resolve(self, expressions: Sequence[Expr]) -> list[Expr]:
        """Replace coordinates of cut joints and marker quantities by what they are in terms of the tree."""
        mapping = self.motion.derived_symbols(self.mechanism, symbols_of(list(expressions)))
        return substitute(list(expressions), mapping) if mapping else list(expressions)


def analyse(mechanism: Mechanism, independent: Collection[str] = ()) -> Kinematics:
    """Form the kinematics of a mechanism; ``independent`` names coordinates whose joints stay in the tree."""
    graph = mechanism.graph
    topology = find_topology(mechanism, set(independent) or set(mechanism.independent))
    names, kinds, parent = _tree_coordinates(mechanism, topology)
    q, v, a = (tuple(graph.symbol(n + s) for n in names) for s in ("", "_dot", "_ddot"))
    t = graph.symbol("t")
    links = build_links(mechanism, topology, dict(zip(names, q, strict=True)))
    poses = Poses(mechanism, links)
    twists = tuple(link_twists(graph, links, v))
    rows = lagrangian_rows(mechanism)
    aligned: list[tuple[str, Expr]] = []
    loop_names: list[str] = []
    loop_kinds: list[str] = []
    loop_values: list[Expr] = []
    wrapping: list[str] = []
    for k in topology.cut:
        spec = mechanism.joints[k]
        loop_part = close_loop(spec, poses, q)
        rows += loop_part.rows
        wrapping += loop_part.wrapping
        aligned += [(spec.name, condition) for condition in loop_part.aligned]
        loop_names += spec.coordinates
        loop_kinds += [c.kind for c in spec.joint.coordinates]
        loop_values += loop_part.measured
    constraints = differentiate_constraints(graph, rows, aligned, (q, v, t))
    loop = _loop_coordinates(graph, (loop_names, loop_kinds, loop_values), (q, v, a))
    coordinates = {n: (q[j], v[j], a[j]) for j, n in enumerate(names)}
    coordinates |= dict(zip(loop.names, zip(loop.values, loop.rates, loop.accelerations, strict=True), strict=True))
    motion = Motion(poses, twists, (q, v, a, t), coordinates)
    _refuse_undefined_angles(mechanism, motion, wrapping)
    return Kinematics(
        mechanism=mechanism,
        topology=topology,
        names=names,
        kinds=kinds,
        q=q,
        v=v,
        a=a,
        t=t,
        parent=parent,
        links=links,
        poses=poses,
        twists=twists,
        motion=motion,
        constraints=constraints,
        loop_coordinates=loop,
        forces=tuple(_resolve_force(f, motion, mechanism) for f in mechanism.forces),
        length_scale=_length_scale(mechanism),
    )


def _tree_coordinates(
    mechanism: Mechanism, topology: Topology
) -> tuple[tuple[str, ...], tuple[str, ...], tuple[int, ...]]:
    """Names, kinds and branch-induced parents (Featherstone, RBDA, sec. 6.4) of the tree's coordinates."""
    if mechanism.lagrangian is not None:
        names = mechanism.lagrangian.coordinates
        return names, ("angle",) * len(names), tuple(range(-1, len(names) - 1))
    names_list: list[str] = []
    kinds: list[str] = []
    parent: list[int] = []
    last = {GROUND: -1}  # the coordinate next to a body towards ground
    for branch in topology.branches:
        spec = mechanism.joints[branch.joint]
        above = last[branch.parent]
        for name, coordinate in zip(spec.coordinates, spec.joint.coordinates, strict=True):
            parent.append(above)
            above = len(names_list)
            names_list.append(name)
            kinds.append(coordinate.kind)
        last[branch.body] = above
    return tuple(names_list), tuple(kinds), tuple(parent)


def _loop_coordinates(
    graph: Graph,
    measured: tuple[list[str], list[str], list[Expr]],
    state: tuple[tuple[Expr, ...], tuple[Expr, ...], tuple[Expr, ...]],
) -> LoopCoordinates:
    names, kinds, values = measured
    q, v, a = state
    along = dict(zip(q, v, strict=True)) | dict(zip(v, a, strict=True))
    rates = jvp(values, along)
    entries = jacobian(values, list(q))
    zero = graph.zero
    return LoopCoordinates(
        names=tuple(names),
        kinds=tuple(kinds),
        values=tuple(values),
        rates=tuple(rates),
        accelerations=tuple(jvp(rates, along)),
        jacobian=tuple(tuple(entries.get((i, j), zero) for j in range(len(q))) for i in range(len(values))),
    )


def _resolve_force(force: Force, motion: Motion, mechanism: Mechanism) -> ForceTerms:
    """Evaluate a force element and write its loads in terms of the tree's own symbols."""
    loads = force.loads(motion)
    potential = force.potential(motion)
    rest = force.remainder(motion) if potential is not None else []
    flat = [e for load in [*loads, *rest] for e in _entries(load)]
    mapping = motion.derived_symbols(mechanism, symbols_of([*flat, *([potential] if potential is not None else [])]))
    values = iter(substitute(flat, mapping) if mapping else flat)
    loads, rest = ([_with_entries(load, values) for load in part] for part in (loads, rest))
    if potential is not None:
        potential = substitute([potential], mapping)[0] if mapping else potential
        allowed = {p.name for p in mechanism.parameters} | {n for n, _ in _coordinate_symbols(motion)}
        if not symbols_of([potential]) <= allowed:
            potential = None
    return ForceTerms(force, *_sorted(loads), potential, *_sorted(loads if potential is None else rest))


def _sorted(loads: Sequence[Load]) -> tuple[tuple[MarkerLoad, ...], tuple[CoordinateLoad, ...]]:
    return (
        tuple(load for load in loads if isinstance(load, MarkerLoad)),
        tuple(load for load in loads if isinstance(load, CoordinateLoad)),
    )


def _refuse_undefined_angles(mechanism: Mechanism, motion: Motion, wrapping: Sequence[str]) -> None:
    """Refuse force laws of an angle that is not defined, or jumps by a full turn: the force would jump with it.

    Raises
    ------
    ModelError
    """
    problems = []
    for force in mechanism.forces:
        used = symbols_of(_expressions(force))
        path = getattr(force, "path", None)
        if isinstance(path, Turn) and not path.is_exact(motion):
            message = "the z axes of its two markers do not stay in line, so the angle between them is not defined"
            remedy = "turn the markers (rpy) so that z is the axis of the joint between them, or give joint="
            problems.append(mechanism.problem(f"forces.{force.name}", message, remedy))
        if force.uses_value and isinstance(path, JointCoordinate):
            used.add(path.name)
        for name in wrapping:
            if name in used:
                message = f"the angle {name!r} closes a loop in space and is only known up to full turns"
                remedy = "name the coordinate of that joint, or choose it as independent, so that another one is cut"
                problems.append(mechanism.problem(f"forces.{force.name}", message, remedy))
    if problems:
        raise ModelError(problems)


def _expressions(value: object) -> list[Expr]:
    """All expressions in a force element."""
    if isinstance(value, Expr):
        return [value]
    if isinstance(value, tuple):
        return [e for item in value for e in _expressions(item)]
    if is_dataclass(value):
        return [e for item in fields(value) for e in _expressions(getattr(value, item.name))]
    return []


def _coordinate_symbols(motion: Motion) -> list[tuple[str, Expr]]:
    return [(name, triple[0]) for name, triple in motion.coordinates.items()]


def _with_entries(load: Load, values: Iterator[Expr]) -> Load:
    """A load with its entries replaced by the next values."""
    if isinstance(load, CoordinateLoad):
        return CoordinateLoad(load.coordinate, next(values))
    x = [next(values) for _ in range(6)]
    return MarkerLoad(load.marker, (x[0], x[1], x[2]), (x[3], x[4], x[5]))


def _entries(load: MarkerLoad | CoordinateLoad) -> list[Expr]:
    return [*load.force, *load.torque] if isinstance(load, MarkerLoad) else [load.value]


def _length_scale(mechanism: Mechanism) -> Expr:
    """Root mean square distance of joint markers from their bodies' origins: the mechanism's size, 1 if it has none.

    Minimum-norm corrections compare lengths with angles; measured in this length, units do not matter.
    """
    graph = mechanism.graph
    squares = []
    for spec in mechanism.joints:
        for marker in (spec.predecessor, spec.successor):
            square = vec.dot(marker.frame.position, marker.frame.position)
            if not square.is_zero:
                squares.append(square)
    if not squares:
        return graph.one
    total = graph.zero
    for square in squares:
        total = total + square
    return graph.apply("max", graph.apply("sqrt", total / float(len(squares))), 1e-9)
