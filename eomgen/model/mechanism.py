"""Model (builder) -> Mechanism, the frozen value every later stage reads.

A Mechanism holds graph expressions in the symbols of its graph: ``t``; parameters, inputs and coordinates under their
own names; the velocity and acceleration of coordinate ``theta`` as ``theta_dot`` and ``theta_ddot``.  A coordinate of
*any* joint may appear in an expression, also of one that a later stage cuts.  Motion of a marker in ground axes appears
as a symbol named like ``vx(rod.tip)`` whose meaning is in :attr:`Mechanism.quantities`.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import field, fields, is_dataclass, replace
from enum import Enum
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..base.limits.runs import ATOL, RTOL
from ..base.operations import OPERATIONS
from ..elements.frames import TURNS, Columns, Frame, Marker
from ..errors import ModelError, Problem
from ..expr.core import LEAVES, Expr, Graph, reachable
from ..expr.records import Record
from ..expr.vectors import Mat3, Vec3
from .description import as_written, place_of
from .quantities import REACTIONS, Quantity
from .requirements import Requirement

if TYPE_CHECKING:
    from ..elements.constraints.constraint import Constraint
    from ..elements.forces.force import Force
    from ..elements.joints import Joint


class Parameter(Record):
    """A constant of the model that can change between runs without recompiling."""

    name: str
    value: float | None = None
    unit: str = ""
    doc: str = ""


class Input(Record):
    """A quantity given from outside over time."""

    name: str
    value: float = 0.0
    unit: str = ""
    doc: str = ""
    signal: Expr | None = None  #: of runs that give none


class Body(Record):
    """A rigid body: mass (kg), centre of mass (m) and inertia about it (kg m^2), both in body axes.

    ``moment`` (m c, kg m) and ``inertia_origin`` (about the body's origin) are there where the user gave them, so that
    these parameters stay as they are; the centre of mass and the inertia about it follow from them then.
    """

    name: str
    mass: Expr
    com: Vec3
    inertia: Mat3
    moment: Vec3 | None = None
    inertia_origin: Mat3 | None = None
    check: str = "error"  #: what becomes of a mass and inertia that no body can have: error, note or off
    plane: Vec3 | None = None  #: the axis of the only moment given, for a body that moves in a plane
    about: Vec3 | None = None  #: the point that the inertia was given about, if not the centre of mass


class JointSpec(Record):
    """A joint between two markers; ``joint`` answers what its type means, ``coordinates`` are the full names.

    ``predecessor`` and ``successor`` already include the turn that brings the joint's axis to their z; ``axes`` are the
    directions of x, y and z of the joint in the markers as they were given.
    ``named`` tells whether the user named the coordinates (such joints are kept in the spanning tree first).
    """

    name: str
    joint: Joint
    predecessor: Marker
    successor: Marker
    coordinates: tuple[str, ...]
    named: bool
    limits: tuple[tuple[tuple[str, float], ...], ...] = ()  #: (key, value) of each coordinate; data only
    dry_friction: float = 0.0  #: data only
    armature: Expr | None = None  #: inertia of the drive, added to the coordinate's own
    axes: Columns = TURNS["z"]

    @property
    def velocities(self) -> tuple[str, ...]:
        """Full names of the generalized velocities."""
        return velocity_names(self.joint, self.name, self.coordinates)


def velocity_names(joint: Joint, name: str, coordinates: Sequence[str]) -> tuple[str, ...]:
    """``<coordinate>_dot`` for the rate of a coordinate, ``<joint>_wx`` .. for an angular velocity."""
    return tuple(
        f"{name}{velocity.suffix}" if velocity.of is None else f"{coordinates[velocity.of]}_dot"
        for velocity in joint.velocities
    )


class BodyShape(NamedTuple):
    """A solid of a body that pictures show, in axes of its own."""

    body: int
    kind: str  #: box, cylinder, sphere, capsule, cone, ellipsoid, mesh
    sizes: tuple[Expr, ...]  #: edges, half axes, or radius and length (m); of a mesh its scale
    frame: Frame
    file: str = ""  #: of a mesh
    color: str = ""  #: #rrggbb; the body's own where there is none


class Output(Record):
    """A named result: an expression in t, coordinates, their rates, parameters, inputs and marker quantities."""

    name: str
    expression: Expr
    unit: str = ""
    doc: str = ""
    of_velocities: bool = False  #: whether it is written with a velocity, even one that is always 0


class FirstOrderState(Record):
    """A first-order state s with s' = rate, beside the coordinates and velocities of the mechanism.

    One that is sampled is held between the times of its clock, where it becomes the value of ``sampled``.
    """

    name: str
    rate: Expr
    unit: str = ""
    doc: str = ""
    sampled: Expr | None = None


class Clock(Record):
    """The sampling times offset + k period, k = 0, 1, .., of states that are sampled together.

    The state ``counter`` holds the k of the next time; ``event`` happens there.
    """

    counter: str
    event: str
    states: tuple[str, ...]
    period: Expr
    offset: Expr


class Lagrangian(Record):
    """A bare Lagrangian L(q, v, t): one generalized force a coordinate, Rayleigh dissipation D, constraints C = 0.

    A constraint that contains velocities is linear in them.
    """

    coordinates: tuple[str, ...]
    expression: Expr
    forces: tuple[Expr, ...]
    dissipation: Expr
    constraints: tuple[Expr, ...]


class GivenEquations(Record):
    """Equations of motion as they are given: M v' + C_q^T l = f with q' = N(q, t) v + b(q, t) and constraints C = 0.

    M is of q and t, f of q, v and t; a constraint that contains velocities is linear in them.  ``multipliers`` names
    the l, in the order of the constraints; there are none, or one for each.
    """

    coordinates: tuple[str, ...]
    velocities: tuple[str, ...]
    rates: tuple[Expr, ...]
    mass_matrix: tuple[tuple[Expr, ...], ...]
    forcing: tuple[Expr, ...]
    constraints: tuple[Expr, ...]
    multipliers: tuple[str, ...]
    kinetic_energy: Expr
    potential_energy: Expr


class Event(Record):
    """A zero of an expression, and what happens there."""

    name: str
    expression: Expr
    terminal: int = 0  #: the run ends when it has happened so often; 0: never
    direction: int = 0  #: 1 rising, -1 falling, 0 both
    reset: tuple[tuple[str, Expr], ...] = ()  #: new values of coordinates and velocities
    restitution: float | None = None  #: of an impact
    doc: str = ""
    friction: float | None = None  #: coefficient in the impact
    slip: tuple[str, ...] = ()  #: outputs that are its sliding velocities


class Switched(NamedTuple):
    """A constraint that closes and opens in a run: the state that is 1 while it holds, and whether it does at first.

    ``stabilisation`` is the rate at which its error dies away; ``releases`` are states that become 0 as it closes.
    """

    constraint: Constraint | None  #: None where its entry has faults
    state: str
    closed: bool
    stabilisation: Expr
    releases: tuple[str, ...]

    @property
    def holds(self) -> Expr:
        """Whether it is closed: what the state says."""
        graph = self.stabilisation.graph
        return graph.apply("lt", 0.5, graph.symbol(self.state))

    @property
    def discrete_state(self) -> FirstOrderState:
        """The state, which events alone change."""
        name = "" if self.constraint is None else self.constraint.name
        return FirstOrderState(self.state, self.stabilisation.graph.zero, doc=f"1 while {name} holds")


class Simulation(Record):
    """Defaults of ``simulate`` and ``eomgen run``."""

    end: float = 10.0
    method: str = "DOP853"
    rtol: float = RTOL
    atol: float = ATOL
    step: float | None = None


class RunDefaults(Record):
    """Where a run starts and how it is made where a call does not say so."""

    initial: Mapping[str, Expr] = field(default_factory=dict)  #: by coordinate, ``<coordinate>_dot`` or state
    initial_outputs: Mapping[str, Expr] = field(default_factory=dict)  #: by output, in its unit
    guess: Mapping[str, Expr] = field(default_factory=dict)  #: rough coordinates, where assembly starts
    simulation: Simulation = Simulation()
    limits_told: bool = True  #: whether runs that pass a limit of a joint say so


class Presentation(Record):
    """What documents and pictures show of a mechanism; nothing is computed from it."""

    doc: str = ""
    latex: Mapping[str, str] = field(default_factory=dict)  #: how names are printed, where it is given
    instances: Mapping[str, str] = field(default_factory=dict)  #: of components: name -> prefix
    notes: tuple[str, ...] = ()  #: what was taken though it is not possible, where it is only to be noted
    default_gravity: bool = False  #: whether the description leaves gravity out
    named_markers: tuple[Marker, ...] = ()
    body_shapes: tuple[BodyShape, ...] = ()
    added_bodies: tuple[int, ...] = ()  #: that no one described: points of contact of cams


class Mechanism(Record):
    """What the user said, checked and lowered to one graph: its physics, defaults of runs, and what is shown of it."""

    name: str
    graph: Graph
    parameters: tuple[Parameter, ...]
    inputs: tuple[Input, ...]
    gravity: Vec3
    bodies: tuple[Body, ...]
    joints: tuple[JointSpec, ...]
    forces: tuple[Force, ...]
    outputs: tuple[Output, ...]
    states: tuple[FirstOrderState, ...] = ()
    clocks: tuple[Clock, ...] = ()
    events: tuple[Event, ...] = ()
    quantities: Mapping[str, Quantity] = field(default_factory=dict)  #: of markers, elements, joints, by symbol
    independent: tuple[str, ...] = ()
    given: GivenEquations | None = None  #: instead of bodies
    lagrangian: Lagrangian | None = None  #: of which these are the derivatives, for reading
    constraints: tuple[Constraint, ...] = ()
    switched: tuple[Switched, ...] = ()  #: constraints that close and open, which are not among those
    lines: Mapping[str, tuple[str, int]] = field(default_factory=dict)  #: dotted path -> (file, line), for messages
    written_paths: Mapping[str, str] = field(default_factory=dict)  #: dotted path -> as the user wrote it, for messages
    check_inertia: str = "error"  #: what becomes of motions without inertia: error, note or off
    negative: tuple[str, ...] = ()  #: bodies with a negative mass or moment, taken because it was asked for
    requirements: tuple[Requirement, ...] = ()  #: rules that parameters keep, whatever their values are
    defaults: RunDefaults = RunDefaults()
    presentation: Presentation = Presentation()

    @property
    def declared(self) -> dict[str, float | None]:
        """Values of parameters and inputs by name; None of a parameter without one."""
        return {p.name: p.value for p in self.parameters} | {u.name: u.value for u in self.inputs}

    @property
    def sampled_names(self) -> set[str]:
        """States that clocks alone change, and the counters of the clocks."""
        return {name for clock in self.clocks for name in (*clock.states, clock.counter)}

    @property
    def reaction_quantities(self) -> dict[str, Quantity]:
        """Parts of reactions, and multipliers, that expressions speak of, by symbol."""
        return {name: q for name, q in self.quantities.items() if q.measure in REACTIONS}

    @property
    def bare(self) -> bool:
        """Whether there are no bodies: a Lagrangian, or equations, came instead."""
        return self.given is not None

    @property
    def written(self) -> GivenEquations | None:
        """Equations of the user's own, of which energies and parts are known as far as they are given."""
        return self.given if self.lagrangian is None else None

    @property
    def bare_section(self) -> str:
        """The section of the model file that stands instead of bodies."""
        return "equations" if self.lagrangian is None else "lagrangian"

    def problem(self, path: str, message: str, remedy: str = "", code: str = "") -> Problem:
        """A problem at a dotted path, with the file and line the path or its nearest parent came from."""
        path = as_written(path, self.written_paths)
        return Problem(path, message, remedy, *place_of(path, self.lines), code)

    def missing_values(self) -> list[Problem]:
        """A problem for each parameter without a value."""
        return [
            self.problem(
                f"parameters.{p.name}",
                "has no value",
                f"give it one where it is declared: parameters: {{{p.name}: VALUE}} in a file, "
                f'm.parameter("{p.name}", VALUE) in Python; or by m.add(FILE, {p.name}=VALUE) to a new model m, '
                f"or by --set {p.name}=VALUE, of verbs that have --set",
                "EG-MISSING",
            )
            for p in self.parameters
            if p.value is None
        ]

    def require_values(self) -> None:
        """Raise ModelError unless every parameter has a value."""
        problems = self.missing_values()
        if problems:
            raise ModelError(problems)


# -- a digest, which tells whether two results come from one model -----------------------------------------------------


#: Attributes that nothing is computed from.
ASIDE = {
    *("doc", "docs", "latex", "lines", "written_paths", "place", "graph", "functions", "file", "requirements"),
    *("presentation", "limits_told", "of_velocities"),
}


def model_digest(mechanism: Mechanism) -> str:
    """SHA-256 of a mechanism, as 64 hexadecimal digits.

    A node counts by its operation and its operands, not by its number, so that expressions that were looked at on the
    way, and orders in which they were made, change nothing.
    """
    known: dict[int, str] = {}
    if mechanism.lagrangian is not None:  # the equations follow from it
        mechanism = replace(mechanism, given=None)
    return _hash(repr(_spell(mechanism, mechanism.graph, known)))


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8", "backslashreplace")).hexdigest()


def _spell_node(x: Expr, known: dict[int, str]) -> str:
    graph: Graph = x.graph
    if x.id not in known:
        for i in reachable(graph, [x.id], stop=known):
            if i in known:
                continue
            operation, *rest = graph.nodes[i]
            if operation in LEAVES:
                known[i] = _hash(repr((operation, *rest)))
                continue
            parts = [known[k] for k in rest]
            meaning = _spell(graph.calls.get(operation, operation), graph, known)
            row = OPERATIONS.get(operation)
            known[i] = _hash(repr((meaning, sorted(parts) if row is not None and row.commutative else parts)))
    return known[x.id]


def _spell(value: Any, graph: Graph, known: dict[int, str]) -> Any:
    """A value as what has one exact ``repr``, the same in every process."""
    if value is None or isinstance(value, (str, int, float, bool, type)):
        return value if not isinstance(value, type) else value.__qualname__
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, Expr):
        return ("node", _spell_node(value, known) if value.graph is graph else _spell_node(value, {}))
    if isinstance(value, Mapping):
        return ["mapping", *sorted((repr(k), _spell(one, graph, known)) for k, one in value.items())]
    if isinstance(value, (tuple, list)):
        return ["list", *(_spell(one, graph, known) for one in value)]
    if isinstance(value, (set, frozenset)):
        return ["set", *sorted(repr(_spell(one, graph, known)) for one in value)]
    if isinstance(value, (np.ndarray, np.generic)):
        array = np.ascontiguousarray(value)
        return ["array", array.shape, array.dtype.str, hashlib.sha256(array.tobytes()).hexdigest()]
    kind = type(value)
    if kind.__module__.startswith("eomgen."):
        fields = [(name, one) for name, one in sorted(_fields(value).items()) if name not in ASIDE]
        return [kind.__qualname__, *((name, _spell(one, graph, known)) for name, one in fields)]
    return ["other", getattr(value, "__module__", ""), getattr(value, "__qualname__", kind.__qualname__)]


def _fields(value: Any) -> dict[str, Any]:
    """The attributes of an object; of a dataclass its fields alone, as others may have been looked up since."""
    if is_dataclass(value):
        return {one.name: getattr(value, one.name) for one in fields(value)}
    slots = [name for kind in type(value).__mro__ for name in getattr(kind, "__slots__", ())]
    result = {name: getattr(value, name) for name in slots if hasattr(value, name) and not name.startswith("__")}
    return {**result, **getattr(value, "__dict__", {})}
