"""Motion of markers and joint coordinates in ground axes, momentum, what force elements and outputs look at."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from typing import Protocol, TypeVar, cast

from ..elements.forces.force import CoordinateLoad, Force, MarkerLoad, View, beyond_zero, reaction_symbol
from ..elements.frames import GROUND, Frame, Marker
from ..errors import ModelError
from ..expr import vectors as vec
from ..expr.core import Expr, Graph, atan2, sqrt, substitute, symbols_of
from ..expr.differentiate import jvp
from ..expr.spatial import Twist
from ..expr.tensors import add_matrices, eliminate, rotate_symmetric, shift_tensor
from ..expr.vectors import Mat3, Vec3
from ..model.mechanism import JointSpec, Mechanism
from ..model.quantities import ANGLES, REACTIONS, SUMS, TURNING, Measure, Quantity
from .topology import MotionSymbols
from .tree import Link, Poses

# -- reaction parts ----------------------------------------------------------------------------------------------------

# The wrench that passes through a joint holds what acts along its coordinates too (a drive, friction).  The reaction is
# the rest, which does no work in the motions that the joint allows, as in :mod:`~eomgen.analysis.reactions`: what acts
# along a coordinate is a torque where that turns, a force where it slides.


class Placed(Protocol):
    """What the parts need to know of the motion."""

    graph: Graph

    def rotation(self, marker: Marker) -> Mat3: ...
    def coordinate(self, name: str) -> tuple[Expr, Expr]: ...


def part_of_reaction(motion: Placed, spec: JointSpec, quantity: Quantity) -> Expr:
    """The part, in symbols of the joint's wrench along the axes of S."""
    wrench = [reaction_symbol(motion.graph, spec.name, k) for k in range(6)]
    force, moment = force_and_moment(motion, spec, wrench)
    if quantity.part == "size":
        return beyond_zero(vec.dot(force, force), sqrt)
    if quantity.part == "normal":  # across the z axis of the joint
        return beyond_zero(force[0] * force[0] + force[1] * force[1], sqrt)
    result = vec.times(motion.rotation(spec.successor), moment if quantity.part.startswith("m") else force)
    if quantity.axes is not None:
        result = vec.transpose_times(motion.rotation(quantity.axes), result)
    return result["xyz".index(quantity.part[-1])]


def force_and_moment(motion: Placed, spec: JointSpec, wrench: Sequence[Expr]) -> tuple[Vec3, Vec3]:
    """Force and moment that do no work in the motions that the joint allows, of the wrench that passes through it."""
    graph, x = motion.graph, wrench
    force, moment = (x[0], x[1], x[2]), (x[3], x[4], x[5])
    if spec.joint.role == "loop":
        return force, moment
    columns = spec.joint.subspace(graph, [motion.coordinate(name)[0] for name in spec.coordinates])
    turns = [(angular, linear) for angular, linear in columns if not all(part.is_zero for part in angular)]
    slides = [linear for angular, linear in columns if all(part.is_zero for part in angular)]
    pushed = _spanned(graph, slides, [vec.dot(s, force) for s in slides])
    wanted = [vec.dot(w, moment) + vec.dot(s, force) - vec.dot(s, pushed) for w, s in turns]
    turned = _spanned(graph, [w for w, _ in turns], wanted)
    return vec.sub(force, pushed), vec.sub(moment, turned)


def _spanned(graph: Graph, directions: Sequence[Vec3], work: Sequence[Expr]) -> Vec3:
    """The shortest vector that does the given work along directions."""
    result = vec.zero(graph)
    if directions:
        gram = [[vec.dot(a, b) for b in directions] for a in directions]
        for factor, direction in zip(eliminate(gram, work), directions, strict=True):
            result = vec.add(result, vec.scale(factor, direction))
    return result


# -- loads of force elements on bodies ---------------------------------------------------------------------------------


def part_exerted(view: View, force: Force, quantity: Quantity) -> Expr | str:
    """The part: forces add up, moments are taken about the origin of the marker; or why there is none."""
    total, moment, acts = vec.zero(view.graph), vec.zero(view.graph), False
    assert quantity.marker is not None
    here = view.position(quantity.marker)
    for load in force.loads(view):
        if not isinstance(load, MarkerLoad):
            return f"acts along the coordinate {load.coordinate!r}"
        if load.marker.body == quantity.marker.body:
            acts = True
            arm = vec.sub(view.position(load.marker), here)
            total = vec.add(total, load.force)
            moment = vec.add(moment, vec.add(load.torque, vec.cross(arm, load.force)))
    if not acts:
        return f"exerts nothing on {quantity.marker.label.partition('.')[0]}"
    if quantity.part == "size":
        return beyond_zero(vec.dot(total, total), sqrt)
    result = moment if quantity.part.startswith("m") else total
    if quantity.axes is not None:
        result = vec.transpose_times(view.rotation(quantity.axes), result)
    return result["xyz".index(quantity.part[-1])]


# -- entries of loads --------------------------------------------------------------------------------------------------


AnyLoad = TypeVar("AnyLoad", bound=MarkerLoad | CoordinateLoad)


def with_entries(load: AnyLoad, values: Iterator[Expr]) -> AnyLoad:
    """A load with its entries replaced by the next values."""
    made: MarkerLoad | CoordinateLoad
    if isinstance(load, CoordinateLoad):
        made = CoordinateLoad(load.coordinate, next(values))
    else:
        x = [next(values) for _ in range(6)]
        made = MarkerLoad(load.marker, (x[0], x[1], x[2]), (x[3], x[4], x[5]))
    return cast("AnyLoad", made)


def entries_of(load: MarkerLoad | CoordinateLoad) -> list[Expr]:
    """Force and torque of a load on a marker, or the one value of a load along a coordinate."""
    return [*load.force, *load.torque] if isinstance(load, MarkerLoad) else [load.value]


# -- momentum ----------------------------------------------------------------------------------------------------------

# All vectors are in ground axes.  Sums over the bodies of m r x v + I w and its like (Goldstein, *Classical Mechanics*,
# sec. 1.2; Orin, Goswami, Lee, *Autonomous Robots* 35, 2013, for the centroidal quantities).


class Momentum:
    """The sums over all bodies of a tree, each formed once, when first used."""

    def __init__(self, poses: Poses, twists: Sequence[Twist]) -> None:
        self.graph, self.poses, self.links, self.twists = poses.graph, poses, poses.links, twists

    @cached_property
    def mass(self) -> Expr:
        """Total mass (kg)."""
        total = self.graph.zero
        for link in self.links:
            total = total + link.mass
        return total

    @cached_property
    def _share(self) -> Expr:
        """One over the total mass, which depends on parameters only."""
        return 1.0 / self.mass

    def _centre(self, k: int) -> Vec3:
        """Centre of mass of a link."""
        pose = self.poses.link(k)
        return vec.add(pose.position, vec.times(pose.rotation, self.links[k].com))

    @cached_property
    def centre(self) -> Vec3:
        """Centre of mass (m)."""
        total = vec.zero(self.graph)
        for k, link in enumerate(self.links):
            total = vec.add(total, vec.scale(link.mass, self._centre(k)))
        return vec.scale(self._share, total)

    def _momentum_of(self, k: int) -> Vec3:
        """Linear momentum of a link."""
        link, (angular, linear) = self.links[k], self.twists[k]
        velocity = vec.add(linear, vec.cross(angular, link.com))
        return vec.times(self.poses.link(k).rotation, vec.scale(link.mass, velocity))

    @cached_property
    def linear(self) -> Vec3:
        """Linear momentum (kg m/s)."""
        total = vec.zero(self.graph)
        for k in range(len(self.links)):
            total = vec.add(total, self._momentum_of(k))
        return total

    @cached_property
    def velocity(self) -> Vec3:
        """Velocity of the centre of mass (m/s)."""
        return vec.scale(self._share, self.linear)

    @cached_property
    def angular(self) -> Vec3:
        """Angular momentum about the centre of mass (kg m^2/s)."""
        total = vec.zero(self.graph)
        for k, link in enumerate(self.links):
            spin = vec.times(self.poses.link(k).rotation, vec.times(link.inertia, self.twists[k][0]))
            arm = vec.sub(self._centre(k), self.centre)
            total = vec.add(total, vec.add(spin, vec.cross(arm, self._momentum_of(k))))
        return total

    def angular_about(self, point: Vec3) -> Vec3:
        """Angular momentum about a point of ground (kg m^2/s)."""
        return vec.add(self.angular, vec.cross(vec.sub(self.centre, point), self.linear))

    @cached_property
    def inertia(self) -> Mat3:
        """Inertia about the centre of mass (kg m^2)."""
        o = vec.zero(self.graph)
        total: Mat3 = (o, o, o)
        for k, link in enumerate(self.links):
            central = rotate_symmetric(self.poses.link(k).rotation, link.inertia)
            arm = vec.sub(self._centre(k), self.centre)
            total = add_matrices(total, add_matrices(central, shift_tensor(link.mass, arm)))
        return total

    def inertia_about(self, point: Vec3) -> Mat3:
        """Inertia about a point (kg m^2)."""
        return add_matrices(self.inertia, shift_tensor(self.mass, vec.sub(self.centre, point)))

    def jacobian(self, n: int) -> tuple[tuple[Expr, ...], ...]:
        """Velocity of the centre of mass for each generalized velocity, (3, n).

        What moves with a joint is the part of the tree beyond it: its mass and first moment are summed inwards.
        """
        masses = [link.mass for link in self.links]
        moments = [vec.scale(link.mass, link.com) for link in self.links]  # about the link's origin, link axes
        columns = [vec.zero(self.graph)] * n
        for k in reversed(range(len(self.links))):
            link: Link = self.links[k]
            rotation = self.poses.link(k).rotation
            for c, (angular, linear) in enumerate(link.columns):
                push = vec.add(vec.scale(masses[k], linear), vec.cross(angular, moments[k]))
                columns[link.first + c] = vec.scale(self._share, vec.times(rotation, push))
            if link.parent != GROUND:
                masses[link.parent] = masses[link.parent] + masses[k]
                moved = vec.add(link.up(moments[k]), vec.scale(masses[k], link.position))
                moments[link.parent] = vec.add(moments[link.parent], moved)
        return tuple(tuple(column[i] for column in columns) for i in range(3))


COORDINATE_SUFFIXES = ("", "_dot", "_ddot")


class MarkerMotion:
    """Implements the views of forces and constraints, and resolves every derived symbol of a mechanism.

    ``coordinates`` has value, rate and acceleration of every joint coordinate, tree and cut, ``turning`` predecessor,
    successor and axis of the angular velocities that are velocities of cut joints, both by name.
    """

    def __init__(
        self,
        poses: Poses,
        twists: Sequence[Twist],
        state: MotionSymbols,
        coordinates: Mapping[str, tuple[Expr, Expr, Expr]],
        turning: Mapping[str, tuple[Marker, Marker, int]] | None = None,
    ) -> None:
        self.graph = poses.graph
        self.poses = poses
        self.twists = twists
        self.coordinates = coordinates
        self.state = state
        self.turning = turning or {}
        self.known_reactions: Mapping[str, Expr] = {}  # what symbols of reactions stand for, once that is solved for
        self._state_rates: dict[str, tuple[Expr, ...]] = {}
        self._open: list[str] = []  # quantities of elements being resolved, each used by the one before

    def relative(self, start: Marker, end: Marker) -> Frame:
        """Placement of marker ``end`` in the axes of marker ``start``."""
        return self.poses.relative(start, end)

    def position(self, marker: Marker) -> Vec3:
        """Origin of the marker, ground axes (m)."""
        return self.poses.marker(marker).position

    def rotation(self, marker: Marker) -> Mat3:
        """Rotation that takes marker axes to ground axes."""
        return self.poses.marker(marker).rotation

    def angular_velocity(self, marker: Marker) -> Vec3:
        """Angular velocity of the marker's body, ground axes (rad/s)."""
        return self.turning_of(marker, own_axes=False, rate=False)

    def velocity(self, marker: Marker) -> Vec3:
        """Velocity of the marker's origin, ground axes (m/s)."""
        if marker.body == GROUND:
            return vec.zero(self.graph)
        link = self.poses.link_of[marker.body]
        angular, linear = self.twists[link]
        arm = self.poses.marker_in_link(marker).position
        return vec.times(self.poses.link(link).rotation, vec.add(linear, vec.cross(angular, arm)))

    def acceleration(self, marker: Marker) -> Vec3:
        """Acceleration of the marker's origin, ground axes (m/s^2)."""
        x, y, z = jvp(list(self.velocity(marker)), self.state.along)
        return (x, y, z)

    def accelerations(self, markers: Sequence[Marker]) -> list[Expr]:
        """Acceleration and angular acceleration of each marker, ground axes: six for each, differentiated together."""
        moving = [marker for marker in markers if marker.body != GROUND]
        links = [self.poses.link_of[marker.body] for marker in moving]
        rates = jvp(
            [x for m, link in zip(moving, links, strict=True) for x in (*self.velocity(m), *self.twists[link][0])],
            self.state.along,
        )
        result: dict[int, list[Expr]] = {}
        for k, (marker, link) in enumerate(zip(moving, links, strict=True)):
            x, y, z = rates[6 * k + 3 : 6 * k + 6]
            result[id(marker)] = [*rates[6 * k : 6 * k + 3], *vec.times(self.poses.link(link).rotation, (x, y, z))]
        return [x for marker in markers for x in result.get(id(marker), [self.graph.zero] * 6)]

    def turning_of(self, marker: Marker, own_axes: bool, rate: bool) -> Vec3:
        """Angular velocity (rad/s) of the marker's body or, with ``rate``, its angular acceleration (rad/s^2).

        The rate of the components is the same vector in either axes, since the axes turn with it or not at all.
        """
        if marker.body == GROUND:
            return vec.zero(self.graph)
        link = self.poses.link_of[marker.body]
        x, y, z = self.twists[link][0]
        if rate:
            x, y, z = jvp([x, y, z], self.state.along)
        if own_axes:
            return vec.transpose_times(self.poses.marker_in_link(marker).rotation, (x, y, z))
        return vec.times(self.poses.link(link).rotation, (x, y, z))

    def turn(self, start: Marker, end: Marker) -> tuple[Expr, Expr, bool]:
        """Angle of ``end`` about the z axis of ``start``, its rate, and whether it is exact and does not wrap.

        It is where the relative rotation is about that axis at every configuration.
        """
        rotation = self.poses.relative(start, end).rotation
        result = self.poses.turns(rotation, self.state.q)
        if result is not None:
            angle, terms = result
            rate = self.graph.zero
            for j, factor in terms:
                rate = rate + factor * self.state.rates[j]
            return angle, rate, True
        axis = vec.transpose(self.rotation(start))[2]
        relative = vec.sub(self.angular_velocity(end), self.angular_velocity(start))
        return atan2(rotation[1][0], rotation[0][0]), vec.dot(axis, relative), False

    def coordinate(self, name: str) -> tuple[Expr, Expr]:
        """Value and rate of a joint coordinate."""
        value, rate, _ = self.coordinates[name]
        return value, rate

    def body(self, k: int) -> Marker:
        """The origin and axes of a body of the mechanism, or of ground."""
        return Marker(k, Frame.identity(self.graph), "ground" if k == GROUND else self.poses.names[k])

    @cached_property
    def _ground(self) -> Marker:
        return self.body(GROUND)

    @cached_property
    def momentum(self) -> Momentum:
        """Mass, centre of mass and momentum of all bodies."""
        return Momentum(self.poses, self.twists)

    def _sum(self, quantity: Quantity) -> Expr:
        """A sum over all bodies, or the motion of their centre of mass."""
        total, measure, marker = self.momentum, quantity.measure, quantity.marker
        places = ["xyz".index(axis) for axis in quantity.part]
        if measure is Measure.MASS:
            return total.mass
        if measure is Measure.INERTIA:
            tensor = total.inertia if marker is None else total.inertia_about(self.position(marker))
            return tensor[places[0]][places[1]]
        if measure is Measure.MOMENTUM:
            vector = total.linear
        elif measure is Measure.ANGULAR_MOMENTUM:
            vector = total.angular if marker is None else total.angular_about(self.position(marker))
        elif measure is Measure.ACCELERATION:
            return jvp(list(total.velocity), self.state.along)[places[0]]
        else:
            vector = total.velocity if measure is Measure.VELOCITY else total.centre
        return vector[places[0]]

    def derived_symbols(self, mechanism: Mechanism, used: set[str]) -> dict[Expr, Expr]:
        """What cut joints' coordinates and marker quantities stand for, as a substitution, for the symbols ``used``."""
        mapping: dict[Expr, Expr] = {}
        for name, triple in self.coordinates.items():
            for suffix, value in zip(COORDINATE_SUFFIXES, triple, strict=True):
                symbol = self.graph.symbol(name + suffix)
                if name + suffix in used and symbol != value:
                    mapping[symbol] = value
        for name, (start, end, axis) in self.turning.items():
            if name in used or f"{name}_dot" in used:
                relative = vec.sub(self.angular_velocity(end), self.angular_velocity(start))
                value = vec.transpose_times(self.rotation(end), relative)[axis]
                mapping[self.graph.symbol(name)] = value
                mapping[self.graph.symbol(f"{name}_dot")] = jvp([value], self.state.along)[0]
        for name, quantity in mechanism.quantities.items():
            if name in used:
                result = self._quantity(mechanism, name, quantity)
                if result != self.graph.symbol(name):
                    mapping[self.graph.symbol(name)] = result
        for name in self.known_reactions.keys() & used:
            mapping[self.graph.symbol(name)] = self.known_reactions[name]
        return mapping

    def _quantity(self, mechanism: Mechanism, name: str, quantity: Quantity) -> Expr:
        if not quantity.element:
            return self._motion(quantity)
        return (self._joint_wrench if quantity.measure in REACTIONS else self._of_element)(mechanism, name, quantity)

    def _joint_wrench(self, mechanism: Mechanism, name: str, quantity: Quantity) -> Expr:
        """A part of a reaction in symbols of the joint's wrench, or a multiplier; their values once they are known."""
        result, mapping = self.graph.symbol(name), dict[Expr, Expr]()
        if quantity.measure is Measure.REACTION:
            spec = next(spec for spec in mechanism.joints if spec.name == quantity.element)
            result = part_of_reaction(self, spec, quantity)
            mapping = self.derived_symbols(mechanism, symbols_of([result]))
        known = mapping | {self.graph.symbol(name): value for name, value in self.known_reactions.items()}
        return substitute([result], known)[0]

    def _of_element(self, mechanism: Mechanism, name: str, quantity: Quantity) -> Expr:
        """What a force element does, in terms of the tree; refused if it depends on itself."""
        measure, element = quantity.measure, quantity.element
        if name in self._open:
            way = " -> ".join([*self._open[self._open.index(name) :], name])
            remedy = "let one of the laws depend on positions and velocities instead"
            raise ModelError(
                [mechanism.problem(f"forces.{element}", f"algebraic loop between laws: {way}", remedy, "EG-CIRCLE")]
            )
        force = next(force for force in mechanism.forces if force.name == element)
        if measure is Measure.EXERTED:
            result = self._exerted(mechanism, force, quantity)
        elif measure is Measure.STATE_RATE:
            if element not in self._state_rates:  # of all at once: one sum over pairs gives many
                self._state_rates[element] = force.state_rates(self)
            result = self._state_rates[element][int(quantity.part)]
        elif measure is Measure.POWER or (measured := force.measured(self)) is None:
            result = force.power(self)
        else:
            result = {"length": measured.value, "rate": measured.rate, "force": measured.force}[measure.word]
        self._open.append(name)
        mapping = self.derived_symbols(mechanism, symbols_of([result]))
        self._open.pop()
        return substitute([result], mapping)[0] if mapping else result

    def _exerted(self, mechanism: Mechanism, force: Force, quantity: Quantity) -> Expr:
        result = part_exerted(self, force, quantity)
        if force.is_rigid:
            message = f"the contacts {force.name!r} have the law rigid, which exerts impulses, not forces"
            remedy = (
                "read run.contact_forces.on(BODY) of a run by method moreau with contact_forces=True, means of steps; "
                "or give a normal law with a stiffness"
            )
            raise ModelError([mechanism.problem(quantity.place, message, remedy, "EG-UNSUPPORTED")])
        if isinstance(result, str):
            remedy = f"give a body on which it acts; power({force.name}) is known of every element"
            raise ModelError(
                [mechanism.problem(quantity.place, f"the element {force.name!r} {result}", remedy, "EG-UNSUPPORTED")]
            )
        return result

    def _motion(self, quantity: Quantity) -> Expr:
        """Motion of a marker, or a sum over all bodies."""
        measure = quantity.measure
        if measure in SUMS:
            return self._sum(quantity)
        if measure in (Measure.DISTANCE, Measure.DISTANCE_RATE):
            return self._distance(quantity)
        if measure in ANGLES and quantity.marker is not None:
            # it wraps only where the motion is not plane
            angle, rate, _ = self.turn(quantity.origin or self._ground, quantity.marker)
            return rate if measure.order else angle
        result = self._vector(measure, quantity.marker)
        if quantity.origin is not None:
            result = vec.sub(result, self._vector(measure, quantity.origin))
        if quantity.axes is not None:
            result = vec.transpose_times(self.rotation(quantity.axes), result)
        return result["xyz".index(quantity.part)]

    def may_wrap(self, quantity: Quantity) -> bool:
        """Whether it is an angle between axes that do not stay in line, which is not defined everywhere."""
        if quantity.measure is not Measure.ANGLE or quantity.marker is None:
            return False
        return not self.turn(quantity.origin or self._ground, quantity.marker)[2]

    def _vector(self, measure: Measure, marker: Marker | None) -> Vec3:
        """The motion of a marker's origin, its angular motion, or the motion of the centre of mass of all bodies."""
        if marker is None:
            x, y, z = (self._sum(Quantity(measure, axis)) for axis in "xyz")
            return (x, y, z)
        if measure in TURNING:
            return self.turning_of(marker, measure in TURNING[1::2], measure in TURNING[2:])
        return (self.position, self.velocity, self.acceleration)[measure.order or 0](marker)

    def _distance(self, quantity: Quantity) -> Expr:
        """The distance of two markers, or its rate."""
        start = quantity.origin or self._ground
        place, velocity = (self._vector(m, quantity.marker) for m in (Measure.POSITION, Measure.VELOCITY))
        reach = vec.sub(place, self.position(start))
        length = sqrt(vec.dot(reach, reach))
        return vec.dot(reach, vec.sub(velocity, self.velocity(start))) / length if quantity.measure.order else length
