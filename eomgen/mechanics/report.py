"""Kinematics and Mobility -> MechanismReport, what a person wants to know before trusting a model."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.assembly import close, closed, starts
from ..base.files import as_path, save_figure
from ..base.limits.constraints import MEASURED
from ..base.limits.numbers import TRANSVERSE
from ..base.limits.positions import BESIDE, MOST_ANGLE, SLACK
from ..base.operations import CHOICE, OPERATIONS
from ..base.results import picture_html, side_by_side
from ..base.scales import largest
from ..base.texts import angle_in_degrees, fold, html_table, terminal_width
from ..elements.constraints.drivers import Driver
from ..elements.frames import Marker
from ..errors import bad_file
from ..expr import vectors as vec
from ..expr.core import Expr, reachable, symbols_of
from ..expr.identity import vanishes
from ..expr.records import Record
from .constraint_functions import Array, ConstraintFunctions
from .kinematics import Kinematics, parts_of
from .mobility import Mobility, initial_values

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# -- other assembly modes ----------------------------------------------------------------------------------------------


TRIES = 36  #: starts of the search, of which the farther half is taken
MANY = 3  #: branches to tell of


@np.errstate(all="ignore")
def other_branches(kinematics: Kinematics, mobility: Mobility) -> list[dict[str, float]]:
    """One coordinate of each such position, with its value there.

    The independent coordinates and those of the guess are held where they are.  Of a rotation by several angles, which
    describe it twice, nothing is listed: only joints of one degree of freedom count.
    """
    mechanism = kinematics.mechanism
    joints = sorted((j for j in mechanism.joints if len(j.coordinates) == 1), key=lambda j: not j.named)
    single = [j.coordinates[0] for j in joints]  # those that the user named first, as words for a branch
    if mobility.assumed or not kinematics.constraints.labels or not single:
        return []
    functions = ConstraintFunctions.at_declared(kinematics)
    system, here = functions.system, np.array(mobility.q_reference)
    known = {*kinematics.names, *kinematics.loop_coordinates.names}
    initial = {name: x for name, x in initial_values(kinematics, functions.values).items() if name in known}
    kinds = dict(zip(kinematics.names, kinematics.kinds, strict=True))
    guessed = [name for name in mechanism.defaults.guess if name in known and kinds.get(name) != "parameter"]
    fixed = dict(zip(guessed, system.measure(guessed, here)[0].tolist(), strict=True))
    at = dict(zip(kinematics.names, mobility.q_reference, strict=True))
    fixed |= {name: at[name] for name in mobility.independent if name in at}
    equations, names = system.closure(system.settle({**fixed, **initial})), [n for n in single if n in known]
    values, _ = system.measure(names, here)
    sizes, angles = _sizes(functions, names)
    result: list[Array] = []
    notes: list[dict[str, float]] = []
    for start in islice(starts(here, equations.free, system.scales, TRIES), TRIES // 2 + 1, None):  # those far away
        q, residual = close(equations, start)
        if not closed(residual) or not system.aligned(q):
            continue
        turned = system.measure(names, q)[0] - values
        gaps = np.where(angles, np.remainder(turned + np.pi, 2.0 * np.pi) - np.pi, turned)
        if largest(gaps / sizes) > BESIDE and all(largest((gaps - other) / sizes) > BESIDE for other in result):
            k = int((np.abs(gaps / sizes) > BESIDE).argmax())
            result.append(gaps)
            notes.append({names[k]: float(values[k] + gaps[k])})
        if len(result) == MANY:
            break
    return notes


def _sizes(functions: ConstraintFunctions, names: list[str]) -> tuple[Array, Array]:
    """Typical size of each coordinate, and whether it is an angle."""
    kinematics, loop = functions.kinematics, functions.kinematics.loop_coordinates
    kinds = dict(zip((*kinematics.names, *loop.names), (*kinematics.kinds, *loop.kinds), strict=True))
    lengths = np.array([kinds[name] == "length" for name in names])
    return np.where(lengths, functions.length_scale, 1.0), ~lengths


# -- notes -------------------------------------------------------------------------------------------------------------


POOR = 1e-2  #: conditioning below which another choice of independent coordinates is worth a word
LISTED_BODIES = 6


def find_notes(kinematics: Kinematics, mobility: Mobility) -> list[str]:
    """Locked and overconstrained mechanisms, change points, badly chosen independent coordinates."""
    m = kinematics.mechanism
    notes = list(m.presentation.notes)
    moved = mobility.driven or m.forces or m.inputs or m.switched
    if m.presentation.default_gravity and not moved and any(not body.mass.is_zero for body in m.bodies):
        notes.append(
            "gravity is 0 by default and no force acts, so only inertia changes the motion; set gravity, or "
            "confirm with gravity (0, 0, 0)"
        )
    if kinematics.constraints.labels and mobility.n_dof == 0 and not mobility.driven:
        constraints = _few([*dict.fromkeys(label.partition(".")[0] for label in kinematics.constraints.labels)])
        notes.append(
            f"locked: the mechanism has no degree of freedom, and no driver moves it (held by {constraints}); "
            "if it should move, remove a constraint, or replace a joint by one with more freedom"
        )
    follow = f"{_few(mobility.redundant)} follow{'s' if len(mobility.redundant) == 1 else ''} from"
    if mobility.redundant and kinematics.general_rates and not mobility.assumed:
        notes.append(
            f"{follow} the rates or from other constraints; the motion is not affected, and states are projected onto "
            "all of them"
        )
    elif mobility.redundant and not mobility.assumed:
        redundant = Counter(label.partition(".")[0] for label in mobility.redundant)
        rows = Counter(label.partition(".")[0] for label in kinematics.constraints.labels)
        remedies = []
        if needed := [name for name, count in redundant.items() if count < rows[name]]:
            remedies.append(f"release only these rows of {_few(needed)}, whose other rows are needed")
        if spare := [name for name in redundant if name not in needed]:
            remedies.append(f"leave {_few(spare)} out")
        notes.append(
            f"overconstrained: {follow} the other constraints; the motion is not affected, but the reactions there are "
            f"not unique; if you need them, {' and '.join(remedies)}"
        )
    if mobility.instantaneous > mobility.n_dof and not mobility.assumed:
        notes.append(
            f"change point: {mobility.instantaneous} degrees of freedom at the initial configuration, {mobility.n_dof} "
            "elsewhere, so the motion can continue on several branches; start a little away from this configuration"
        )
    elif mobility.n_dof and mobility.conditioning < POOR and mobility.candidates:
        better = [(name, x) for name, x in mobility.candidates if name not in mobility.independent]
        if better and better[0][1] > 10.0 * mobility.conditioning:
            name, value = better[0]
            notes.append(
                f"{', '.join(mobility.independent)} hardly moves the mechanism at the initial configuration "
                f"(conditioning {mobility.conditioning:.1g}); {name} would do better there ({value:.1g})"
            )
    notes += [
        f"{name}: {', '.join(corners)} in a driver's value can make a corner, where its rate jumps; a driver does not "
        "compute the impact there; use a smooth motion, or events with restitution for a real impact"
        for name, corners in _drivers_with_corners(kinematics)
    ]
    notes += [
        f"{name} turns about axes without a given moment of inertia, and these moments count as 0; give xx, yy and zz, "
        "or a joint that turns the body about the axis of its only moment"
        for name in _turned_out_of_plane(kinematics)
    ]
    return notes + _in_degrees(kinematics, mobility) + _beyond_limits(kinematics, mobility)


def _in_degrees(kinematics: Kinematics, mobility: Mobility) -> list[str]:
    """Angles that start after more than two turns, as degrees would."""
    if mobility.assumed:
        return []
    numbers = kinematics.mechanism.declared
    starts = initial_values(kinematics, numbers, "guess") | initial_values(kinematics, numbers)
    names = (*kinematics.names, *kinematics.loop_coordinates.names)
    kinds = dict(zip(names, (*kinematics.kinds, *kinematics.loop_coordinates.kinds), strict=True))
    return [
        angle_in_degrees(name, x)
        for name, x in starts.items()
        if kinds.get(name) in ("angle", "turn") and abs(x) > MOST_ANGLE
    ]


def _beyond_limits(kinematics: Kinematics, mobility: Mobility) -> list[str]:
    """Coordinates that start beyond a declared limit of their joint."""
    m, at = kinematics.mechanism, dict(zip(kinematics.names, mobility.q_reference, strict=True))
    declared = [pair for j in m.joints for pair in zip(j.coordinates, j.limits, strict=False)]
    result = []
    for name, limits in declared if m.defaults.limits_told and not mobility.assumed else ():
        for key, limit in limits:
            beyond = {"lower": limit - at.get(name, limit), "upper": at.get(name, limit) - limit}.get(key, 0.0)
            if beyond > SLACK * (1.0 + abs(limit)):
                result.append(
                    f"{name} starts at {at[name]:.6g}, beyond its {key} limit {limit:g}: joint limits are not "
                    "enforced; give another initial value, or add a force of type stop"
                )
    return result


def _turned_out_of_plane(kinematics: Kinematics) -> list[str]:
    """Bodies with one moment of inertia, as in a plane, whose joints turn them about other axes too."""
    motion = kinematics.motion
    bodies = [(k, body) for k, body in enumerate(kinematics.mechanism.bodies) if body.plane is not None]
    tilts: list[Expr] = []
    for k, body in bodies:
        spin = motion.turning_of(motion.body(k), own_axes=True, rate=False)
        tilts += vec.cross(spin, body.plane or spin)
    zero = vanishes(tilts, TRANSVERSE, pieces=True, unknown=True)
    return [body.name for k, (_, body) in enumerate(bodies) if not all(zero[3 * k : 3 * k + 3])]


def _drivers_with_corners(kinematics: Kinematics) -> list[tuple[str, list[str]]]:
    """Names of drivers whose value takes one of several branches, and by which functions."""
    result = []
    for constraint in kinematics.mechanism.constraints:
        if isinstance(constraint, Driver):
            graph = constraint.value.graph
            operations = {graph.nodes[i][0] for i in reachable(graph, [constraint.value.id])}
            corners = [row.word for row in OPERATIONS.values() if row.kind == CHOICE and row.name in operations]
            result += [(constraint.name, corners)] if corners else []
    return result


def _few(names: tuple[str, ...] | list[str]) -> str:
    listed = ", ".join(names[:LISTED_BODIES])
    return listed if len(names) <= LISTED_BODIES else f"{listed}, ... ({len(names) - LISTED_BODIES} more)"


# -- report -----------------------------------------------------------------------------------------------------------


TIMED = {"holds": "for a time"}  #: of a constraint that closes and opens
WIDTH = 110  #: of the lines of a report, at most
ASSUMED = "some parameters have no value; random values were used to find the rank"
LISTED = 12  #: names in one of them


class MechanismReport(Record):
    """Counts, topology and mobility of a mechanism.

    Attributes
    ----------
    gruebler_kutzbach : int or None
        6 (bodies) - sum over joints of 6 - f - equations of constraint elements; None for a bare Lagrangian.
    gruebler_kutzbach_planar : int or None
        The same with 3 - f, where the mechanism moves in a plane.
    constraints : int
        Rows that do not vanish identically, of ``constraints_declared``; ``nonholonomic`` of them at velocity level.
    degrees_of_freedom, configuration_freedoms : int
        Independent velocities; independent coordinates, which nonholonomic constraints do not restrict.
    instantaneous_freedoms : int
        Degrees of freedom at the reference configuration, more than usual at a change point.
    redundant : list of str
        Rows that follow from the others at the reference configuration.
    candidates : dict of str to float
        Coordinates that can be independent at the reference configuration, the best first, and their conditioning: 1 is
        perfect, 0 not at all.
    guessed : dict of str to list of two floats
        The guess of a coordinate and the value found, the largest difference first; ``guess_distance`` is that
        difference, angles in rad, lengths as a part of ``length_scale``.
    other_branches : list of dict
        Further closed positions with the same independent coordinates, which fit the initial values and the guess as
        well: one coordinate that tells each apart, and its value there.
    notes : list of str
        Facts that deserve attention, each with a remedy.
    """

    name: str
    bodies: list[str]
    joints: list[dict[str, Any]]
    tree: list[dict[str, str]]
    loop_joints: list[str]
    coordinates: list[str]
    loop_coordinates: list[str]
    independent: list[str]
    dependent: list[str]
    constraints: int
    nonholonomic: int
    constraints_declared: int
    rank: int
    ranks: list[int]
    degrees_of_freedom: int
    configuration_freedoms: int
    instantaneous_freedoms: int
    gruebler_kutzbach: int | None
    gruebler_kutzbach_planar: int | None
    redundant: list[str]
    conditioning: float
    candidates: dict[str, float]
    notes: list[str]
    length_scale: float
    reference: dict[str, float]
    assembly_restarts: int
    assumed: bool
    elements: list[dict[str, Any]]
    guessed: dict[str, list[float]]
    guess_distance: float
    other_branches: list[dict[str, float]]

    def draw(self, file: str | Path | None = None, ax: Axes | None = None) -> Axes:
        """Draw the mechanism as a graph: bodies above the bodies that carry them, joints between them.

        Joints of the spanning tree are solid lines, those that close loops dashed; constraint elements are diamonds.

        Parameters
        ----------
        file : str or Path, optional
            Where to write the picture; its ending says the format (svg, png, pdf).
        ax : matplotlib Axes, optional
            Where to draw; by default a new figure, which a notebook shows.

        Returns
        -------
        Axes

        Raises
        ------
        MissingDependencyError
            matplotlib is not installed: ``pip install matplotlib``.
        UsageError
            A file name whose ending is no kind of picture.
        """
        from ..show.graph import Graph

        axes: Axes = Graph(self, ax, window=file is None).ax
        if file is not None:
            known = axes.figure.canvas.get_supported_filetypes()
            if as_path("file", file).suffix[1:].lower() not in known:
                raise bad_file(f"{file}: the name of a picture must end in one of .{', .'.join(sorted(known))}")
            save_figure(axes.figure, file)
        return axes

    def to_dict(self) -> dict[str, Any]:
        """The report as plain values, for JSON."""
        return asdict(self)

    def __str__(self) -> str:
        width = min(WIDTH, terminal_width() or WIDTH)
        lines = [f"mechanism {self.name}"]
        for label, text in self._facts():
            folded = fold(text.replace(" (", "\xa0("), width, f"  {label:<22}", " " * 24)
            lines += [line.replace("\xa0", " ") for line in folded]
        if self.assumed:
            lines.append(f"  {ASSUMED}")
        return "\n".join(lines + [f"  note: {note}" for note in self.notes])

    def _facts(self) -> list[tuple[str, str]]:
        """Labels and values."""
        facts: list[tuple[str, str]] = []

        def say(label: str, text: str) -> None:
            facts.append((label, text))

        if self.bodies:
            say("bodies", f"{len(self.bodies)}: {_list(self.bodies)}")
            say("joints", f"{len(self.joints)}: {_list_joints(self.joints)}")
            say("loop joints", _list(self.loop_joints) or "none (open tree)")
        say("coordinates", f"{len(self.coordinates)}: {_list(self.coordinates)}")
        if self.loop_coordinates:
            say("at loop joints", _list(self.loop_coordinates))
        if self.constraints_declared:
            vanishing = self.constraints_declared - self.constraints
            note = f" ({vanishing} more hold identically)" if vanishing else ""
            kept = f", {self.nonholonomic} of them nonholonomic" if self.nonholonomic else ""
            say("constraints", f"{self.constraints}{kept}{note}")
            say("rank", f"{self.rank}" + (f"; redundant: {_list(self.redundant)}" if self.redundant else ""))
        if len(set(self.ranks)) > 1:
            say("", f"the rank differs between configurations: {sorted(set(self.ranks))}")
        if timed := [str(element["name"]) for element in self.elements if TIMED.items() <= element.items()]:
            say("closing and opening", f"{_list(timed)}; not counted below")
        counts = []
        if self.gruebler_kutzbach is not None:
            counts.append(f"Gruebler-Kutzbach {self.gruebler_kutzbach} in space")
        if self.gruebler_kutzbach_planar is not None:
            counts.append(f"{self.gruebler_kutzbach_planar} in the plane")
        say("degrees of freedom", f"{self.degrees_of_freedom}" + (f" ({', '.join(counts)})" if counts else ""))
        if self.instantaneous_freedoms != self.degrees_of_freedom:
            say("at this configuration", str(self.instantaneous_freedoms))
        if self.nonholonomic:
            say("of the configuration", str(self.configuration_freedoms))
        say("independent", _list(self.independent) or "none")
        if self.dependent:
            say("dependent", f"{_list(self.dependent)} (conditioning {self.conditioning:.2g})")
        if len(self.candidates) > len(self.independent):
            say("can be independent", _list([f"{name} {value:.2g}" for name, value in self.candidates.items()]))
        if self.loop_joints and not self.assumed:
            say("assembled", self._assembled())
            if self.other_branches:
                there = " or ".join(dict.fromkeys(_values(other) for other in self.other_branches))
                first = next(iter(self.other_branches[0]))
                say("", f"another branch is equally near ({there}); guess {first} to choose")
        return facts

    def _assembled(self) -> str:
        """On which branch the loops are closed."""
        if self.guessed:
            name, (guess, value) = next(iter(self.guessed.items()))
            result = f"{name} = {value:.6g}, guessed {guess:.6g}"
            if self.guess_distance > BESIDE:
                return f"on the branch nearest to the guess, which is rough, off by {self.guess_distance:.2g}: {result}"
            exact = self.guess_distance <= MEASURED
            return "at the guess" if exact else f"on the branch nearest to the guess ({result})"
        if self.assembly_restarts:
            tries = f"{self.assembly_restarts} restart{'s' * (self.assembly_restarts != 1)}"
            return f"after {tries}: one of several ways to close the loops; give a guess to choose one"
        return "from the initial values, and from 0 where there are none"

    def _repr_html_(self) -> str:
        notes = [("note", note) for note in ([ASSUMED] if self.assumed else []) + self.notes]
        table = html_table(f"Mechanism {self.name}", [*self._facts(), *notes])
        if not self.bodies:
            return table
        from ..show.graph import Graph

        return side_by_side(picture_html(lambda: Graph(self).ax.figure), table)


def _values(values: dict[str, float]) -> str:
    return ", ".join(f"{name} = {value:.6g}" for name, value in values.items())


def _list(names: list[str]) -> str:
    if len(names) <= LISTED:
        return ", ".join(names)
    return ", ".join(names[: LISTED - 2]) + f", ... ({len(names) - LISTED + 2} more)"


def _list_joints(joints: list[dict[str, Any]]) -> str:
    """Each with its type, or many of them by type."""
    if len(joints) <= LISTED:
        return ", ".join(f"{j['name']} ({j['type']})" for j in joints)
    types = Counter(j["type"] for j in joints)
    return ", ".join(f"{count} {kind}" for kind, count in types.most_common())


def report(kinematics: Kinematics, mobility: Mobility) -> MechanismReport:
    """Describe a mechanism and what its numbers say."""
    m, c = kinematics.mechanism, kinematics.constraints
    names = ["ground", *(b.name for b in m.bodies)]
    spatial = planar = None
    if not m.bare:
        freedoms = [j.joint.allows for j in m.joints]
        spatial = 6 * len(m.bodies) - sum(6 - f for f in freedoms) - len(kinematics.coupled)
        if plane_axis(kinematics) is not None and all(j.joint.role != "loop" for j in m.joints):
            planar = 3 * len(m.bodies) - sum(3 - f for f in freedoms)
            planar -= sum(label in c.labels for label in kinematics.coupled)
    return MechanismReport(
        name=m.name,
        bodies=names[1:],
        joints=[
            {
                "name": j.name,
                "type": j.joint.type_name,
                "between": [j.predecessor.label, j.successor.label],
                "coordinates": list(j.coordinates),
                "bodies": [names[j.predecessor.body + 1], names[j.successor.body + 1]],
            }
            for j in m.joints
        ],
        tree=[
            {"body": names[b.body + 1], "parent": names[b.parent + 1], "joint": m.joints[b.joint].name}
            for b in kinematics.topology.branches
        ],
        loop_joints=[m.joints[k].name for k in kinematics.topology.cut],
        coordinates=list(kinematics.names),
        loop_coordinates=list(kinematics.loop_coordinates.names),
        independent=list(mobility.independent),
        dependent=list(mobility.dependent),
        constraints=len(c.labels),
        nonholonomic=c.nonholonomic,
        constraints_declared=c.declared,
        rank=mobility.rank,
        ranks=list(mobility.ranks),
        degrees_of_freedom=mobility.n_dof,
        configuration_freedoms=mobility.n_positions,
        instantaneous_freedoms=mobility.instantaneous,
        gruebler_kutzbach=spatial,
        gruebler_kutzbach_planar=planar,
        redundant=list(mobility.redundant),
        conditioning=mobility.conditioning,
        candidates=dict(mobility.candidates),
        notes=find_notes(kinematics, mobility),
        length_scale=mobility.length_scale,
        reference=dict(zip(kinematics.names, mobility.q_reference, strict=True)),
        assembly_restarts=mobility.restarts,
        assumed=mobility.assumed,
        elements=[
            {"name": e.name, "type": e.type_name, "bodies": [names[k + 1] for k in _touched(kinematics, e)], **timed}
            for e, timed in [*((e, {}) for e in m.constraints), *((s.constraint, TIMED) for s in m.switched)]
            if e is not None
        ],
        guessed={name: [guess, value] for name, guess, value in mobility.guessed},
        guess_distance=mobility.guess_distance,
        other_branches=[],
    )


def _touched(kinematics: Kinematics, element: object) -> list[int]:
    """Bodies that a constraint element holds: those of its markers, and those that its coordinates move."""
    m = kinematics.mechanism
    result: set[int] = set()
    moves = {n: (j.predecessor.body, j.successor.body) for j in m.joints for n in (*j.coordinates, *j.velocities)}

    for part in parts_of(element):
        if isinstance(part, Marker):
            result.add(part.body)
            continue
        for name in symbols_of([part]):
            if name in moves:
                result.update(moves[name][1:])
            elif name in m.quantities:
                seen = m.quantities[name]
                result.update(end.body for end in (seen.marker, seen.origin, seen.axes) if end is not None)
    return sorted(result)


def plane_axis(kinematics: Kinematics) -> int | None:
    """The ground axis about which every body turns and across which it moves, identically; else None."""
    motion = kinematics.motion
    origins = [motion.body(k) for k in range(len(kinematics.mechanism.bodies))]
    turns, slides = map(motion.angular_velocity, origins), map(motion.velocity, origins)
    moves = [*zip(turns, slides, strict=True)]
    for axis in range(3 if moves else 0):
        if all(v[axis].is_zero and all(w[i].is_zero for i in range(3) if i != axis) for w, v in moves):
            return axis
    return None
