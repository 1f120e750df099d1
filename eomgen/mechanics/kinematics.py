"""Mechanism -> Kinematics, everything about the motion that every method of derivation shares."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import field, fields, is_dataclass
from functools import cached_property

from ..elements.forces.force import CoordinateLoad, Force, Load, MarkerLoad
from ..elements.forces.paths import JointCoordinate, Turn
from ..elements.frames import Marker
from ..errors import ModelError
from ..expr import vectors as vec
from ..expr.core import Expr, Graph, substitute, symbols_of
from ..expr.differentiate import jvp
from ..expr.records import Record
from ..expr.spatial import Twist
from ..expr.vectors import Vec3
from ..model.mechanism import Mechanism
from .link_frames import AxisTurns
from .loops import (
    Constraints,
    close_loop,
    couple,
    differentiate_constraints,
    equation_rows,
    find_undefined,
    refuse_rows_of_time,
    refuse_unusable,
)
from .motion import MarkerMotion, entries_of, with_entries
from .topology import MotionSymbols, Topology, find_topology, length_scale, motion_symbols
from .tree import JointRates, Link, Poses, build_links, link_twists


class LoopCoordinates(Record):
    """Coordinates y of cut joints, n_loop_coordinates, as functions of the tree: values, rates, accelerations, dy'/dv.

    Kinds are 'length', 'angle' (equal up to full turns), 'turn' (an angle that counts full turns) and 'parameter'.
    """

    names: tuple[str, ...] = ()
    kinds: tuple[str, ...] = ()
    values: tuple[Expr, ...] = ()
    rates: tuple[Expr, ...] = ()
    accelerations: tuple[Expr, ...] = ()
    jacobian: tuple[tuple[Expr, ...], ...] = ()


class ForceTerms(Record):
    """One force element resolved: its loads, and its potential if it has one.

    The last two hold those of its loads that the potential does not account for; all loads where there is none.
    """

    force: Force
    marker_loads: tuple[MarkerLoad, ...]
    coordinate_loads: tuple[CoordinateLoad, ...]
    potential: Expr | None
    marker_remainder: tuple[MarkerLoad, ...]
    coordinate_remainder: tuple[CoordinateLoad, ...]


class Kinematics(MotionSymbols):
    """The tree, its motion, loop constraints and resolved forces, in (t, q, v, a), inputs and parameters."""

    mechanism: Mechanism
    topology: Topology
    links: tuple[Link, ...]
    poses: Poses
    twists: tuple[Twist, ...]
    motion: MarkerMotion
    constraints: Constraints
    loop_coordinates: LoopCoordinates
    forces: tuple[ForceTerms, ...]
    length_scale: Expr
    coupled: tuple[str, ...] = ()  #: labels of the equations of constraint elements
    #: by event, while constraints are closed
    velocities_after: Mapping[str, tuple[tuple[str, Expr], ...]] = field(default_factory=dict)
    rows_to_hold: tuple[tuple[str, str, str], ...] = ()  #: label, state, kind of constraints that close and open
    held_errors: tuple[Expr, ...] = ()  #: of each, its error and the rate of it, while it is closed
    reaction_laws: tuple[str, ...] = ()  #: force elements whose laws speak of reactions, which are solved for
    hints: tuple[tuple[str, Expr], ...] = ()  #: where assembly looks for coordinates of contact points

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

    @property
    def state_names(self) -> tuple[str, ...]:
        """Names of the first-order states."""
        return tuple(s.name for s in self.mechanism.states)

    @cached_property
    def state_rates(self) -> tuple[Expr, ...]:
        """s' of the first-order states, of (t, q, v, s, u)."""
        return tuple(self.resolve([s.rate for s in self.mechanism.states]))

    @cached_property
    def sampled(self) -> tuple[tuple[str, Expr], ...]:
        """Of each clock ``t``, the time of its next sample, then its states with their new values."""
        raw = {s.name: s.sampled for s in self.mechanism.states if s.sampled is not None}
        result: list[tuple[str, Expr]] = []
        for clock in self.mechanism.clocks:
            result.append(("t", clock.offset + clock.period * self.graph.symbol(clock.counter)))
            result += ((name, raw[name]) for name in clock.states)
        return tuple(zip((name for name, _ in result), self.resolve([x for _, x in result]), strict=True))

    @property
    def euler_parameters(self) -> tuple[tuple[str, ...], ...]:
        """Names of the coordinates that are Euler parameters, four by four."""
        return tuple(self.names[i : i + 4] for i, _ in self.quaternion_slots)

    def resolve(self, expressions: Sequence[Expr]) -> list[Expr]:
        """Replace coordinates of cut joints and marker quantities by what they are in terms of the tree."""
        mapping = self.motion.derived_symbols(self.mechanism, symbols_of(list(expressions)))
        return substitute(list(expressions), mapping) if mapping else list(expressions)


def analyse(mechanism: Mechanism, independent: Collection[str] = ()) -> Kinematics:
    """Form the kinematics of a mechanism; ``independent`` names coordinates whose joints stay in the tree."""
    graph = mechanism.graph
    topology = find_topology(mechanism, set(independent) or set(mechanism.independent))
    state = motion_symbols(mechanism, topology)
    names, q, rates = state.names, state.q, state.rates
    symbols = dict(zip(names, q, strict=True))
    links = build_links(mechanism, topology, symbols, AxisTurns(mechanism, topology, symbols).turned)
    poses = Poses(mechanism, links)
    twists = tuple(link_twists(graph, links, state.v))
    rows = equation_rows(mechanism)
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
        loop_kinds += ["turn" if spec.joint.counts_turns else c.kind for c in spec.joint.coordinates]
        loop_values += loop_part.measured
    loop = _loop_coordinates(graph, (loop_names, loop_kinds, loop_values), state)
    second = state.a if rates == state.v else state.total_derivative(rates)
    coordinates = {n: (q[j], rates[j], second[j]) for j, n in enumerate(names)}
    coordinates |= dict(zip(loop.names, zip(loop.values, loop.rates, loop.accelerations, strict=True), strict=True))
    motion = MarkerMotion(poses, twists, state, coordinates, _turning(mechanism, topology))
    coupled = couple(mechanism, motion)
    refuse_unusable(mechanism, motion, coupled.rows)
    length = length_scale(mechanism)
    constraints = differentiate_constraints(graph, rows + coupled.rows, aligned + coupled.aligned, state, length)
    refuse_rows_of_time(mechanism, constraints)
    _refuse_undefined_angles(mechanism, motion, wrapping)
    return Kinematics(
        **{part.name: getattr(state, part.name) for part in fields(state)},
        mechanism=mechanism,
        topology=topology,
        links=links,
        poses=poses,
        twists=twists,
        motion=motion,
        constraints=constraints,
        coupled=tuple(row.label for row in coupled.rows),
        hints=tuple(hint for hint in coupled.hints if hint[0] in names),
        loop_coordinates=loop,
        forces=tuple(_resolve_force(f, motion, mechanism) for f in mechanism.forces),
        length_scale=length,
    )


def _turning(mechanism: Mechanism, topology: Topology) -> dict[str, tuple[Marker, Marker, int]]:
    """Angular velocities that cut joints in Euler parameters would have as velocities."""
    result = {}
    for spec in (mechanism.joints[k] for k in topology.cut):
        for slot in spec.joint.quaternion_slots:
            for axis, name in enumerate(spec.velocities[slot.velocity : slot.velocity + 3]):
                result[name] = (spec.predecessor, spec.successor, axis)
    return result


def _loop_coordinates(
    graph: Graph,
    measured: tuple[list[str], list[str], list[Expr]],
    state: MotionSymbols,
) -> LoopCoordinates:
    names, kinds, values = measured
    along = {symbol: rate for symbol, rate in state.along.items() if symbol not in state.time_direction}
    rates = jvp(values, along)
    entries = state.slopes(values, rates)
    zero = graph.zero
    return LoopCoordinates(
        names=tuple(names),
        kinds=tuple(kinds),
        values=tuple(values),
        rates=tuple(rates),
        accelerations=tuple(jvp(rates, along)),
        jacobian=tuple(tuple(entries.get((i, j), zero) for j in range(len(state.v))) for i in range(len(values))),
    )


def _resolve_force(force: Force, motion: MarkerMotion, mechanism: Mechanism) -> ForceTerms:
    """Evaluate a force element and write its loads in terms of the tree's own symbols."""
    loads = force.loads(motion)
    potential = force.potential(motion)
    rest = force.remainder(motion) if potential is not None else []
    flat = [e for load in [*loads, *rest] for e in entries_of(load)]
    mapping = motion.derived_symbols(mechanism, symbols_of([*flat, *([potential] if potential is not None else [])]))
    values = iter(substitute(flat, mapping) if mapping else flat)
    loads, rest = ([with_entries(load, values) for load in part] for part in (loads, rest))
    if potential is not None:
        potential = substitute([potential], mapping)[0] if mapping else potential
        allowed = {p.name for p in mechanism.parameters} | motion.coordinates.keys()
        if not symbols_of([potential]) <= allowed:
            potential = None
    return ForceTerms(force, *_sorted(loads), potential, *_sorted(loads if potential is None else rest))


def _sorted(loads: Sequence[Load]) -> tuple[tuple[MarkerLoad, ...], tuple[CoordinateLoad, ...]]:
    return (
        tuple(load for load in loads if isinstance(load, MarkerLoad)),
        tuple(load for load in loads if isinstance(load, CoordinateLoad)),
    )


def _refuse_undefined_angles(mechanism: Mechanism, motion: MarkerMotion, wrapping: Sequence[str]) -> None:
    """Refuse force laws of an angle that is not defined, or jumps by a full turn: the force would jump with it."""
    result: list[tuple[str, str, str]] = []  # place, message, remedy
    between = "the z axes of its two markers do not stay in line, so the angle between them is not defined"
    until = "turn the markers (rpy) until z is the axis of the joint between them, or"

    def find_wrapping(place: str, names: Collection[str]) -> None:
        remedy = "name the coordinate of that joint, or choose it as independent, so that another one is cut"
        for name in names:
            message = f"the angle {name!r} closes a loop in space and is only known up to full turns"
            result.append((place, message, remedy))

    for force in mechanism.forces:
        place, used = f"forces.{force.name}", _names_in(force)
        path = getattr(force, "path", None)
        if isinstance(path, Turn) and not path.is_exact(motion):
            result.append((place, between, f"{until} give joint="))
        for name in sorted(used & mechanism.quantities.keys()):
            if motion.may_wrap(mechanism.quantities[name]):
                message = f"the z axes of the two markers of {name} do not stay in line, so the angle is not defined"
                result.append((place, message, f"{until} use a coordinate"))
        if force.uses_value and isinstance(path, JointCoordinate):
            used.add(path.name)
        find_wrapping(place, [name for name in wrapping if name in used])
    for constraint in mechanism.constraints:
        place = f"constraints.{constraint.name}"
        if not constraint.is_defined(motion):
            remedy = "turn the markers (rpy) so that z is the axis between them, or drive a coordinate"
            result.append((place, between, remedy))
        find_wrapping(place, sorted(set(wrapping) & _names_in(constraint)))
    problems = [*find_undefined(mechanism, motion), *(mechanism.problem(*one, "EG-UNDEFINED") for one in result)]
    if problems:
        raise ModelError(problems)


def parts_of(element: object) -> Iterator[Expr | Marker]:
    """All expressions and markers in an element."""
    if isinstance(element, Expr | Marker):
        yield element
    elif isinstance(element, tuple) or is_dataclass(element):
        inner = element if isinstance(element, tuple) else [getattr(element, item.name) for item in fields(element)]
        for part in inner:
            yield from parts_of(part)


def _names_in(element: object) -> set[str]:
    return symbols_of([part for part in parts_of(element) if isinstance(part, Expr)])


# -- joint rates -------------------------------------------------------------------------------------------------------


def joint_rates(kinematics: Kinematics) -> list[JointRates]:
    """The rates of every link, in tree order."""
    graph, links, v = kinematics.graph, kinematics.links, kinematics.v
    along: Mapping[Expr, Expr] = kinematics.q_dot_direction | kinematics.time_direction
    columns = [x for link in links for angular, _ in link.columns for x in angular]
    flows = jvp([*columns, *(x for link in links for x in link.position)], along)
    slides = flows[len(columns) :]
    slide_rates = jvp(slides, along)
    result = []
    at = 0
    for k, link in graph.marked(enumerate(links)):
        spin = spin_rate = vec.zero(graph)
        for c, (angular, _) in enumerate(link.columns):
            rate = v[link.first + c]
            spin = vec.add(spin, vec.scale(rate, angular))
            spin_rate = vec.add(spin_rate, vec.scale(rate, vec.three(flows, at)))
            at += 3
        result.append(JointRates(spin, spin_rate, vec.three(slides, 3 * k), vec.three(slide_rates, 3 * k)))
    return result


def slide_accelerations(kinematics: Kinematics, rates: Sequence[JointRates], a: Sequence[Expr]) -> list[Vec3]:
    """What accelerations ``a`` add to ``slide_rate``: the slide is linear in the velocities."""
    slides = [x for r in rates for x in r.slide]
    pushes = jvp(slides, dict(zip(kinematics.v, a, strict=True)))
    return [vec.three(pushes, 3 * k) for k in range(len(rates))]
