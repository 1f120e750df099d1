"""Stage kinematics: Kinematics and Mobility -> MechanismReport, what a person wants to know before trusting a model."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict, fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..base.inline_pictures import picture_html, side_by_side
from ..base.limits.analyses import BESIDE
from ..base.limits.constraints import MEASURED
from ..base.texts import fold, html_text, terminal_width
from ..frames import Frame, Marker
from ..graph import vectors as vec
from ..graph.core import Expr
from ..graph.substitute import symbols_of
from ..records import dataclass
from .kinematics import Kinematics
from .mobility import Mobility
from .notes import find_notes
from .picture import draw, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TIMED = {"holds": "for a time"}  #: of a constraint that closes and opens
WIDTH = 110  #: of the lines of a report, at most


@dataclass(frozen=True)
class MechanismReport:
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
        drawn: Axes = draw(self, file, ax)
        return drawn

    def to_dict(self) -> dict[str, Any]:
        """The report as plain values, for JSON."""
        return asdict(self)

    def __str__(self) -> str:
        lines = [f"mechanism {self.name}"]
        width = min(WIDTH, terminal_width() or WIDTH)

        def say(label: str, text: str) -> None:
            lines.extend(fold(text, width, f"  {label:<22}", " " * 24))

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
            say("held for a time", f"{_list(timed)}; what follows is without them")
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
                say("", f"as near is a branch with {there}; a guess of {next(iter(self.other_branches[0]))} chooses")
        if self.assumed:
            lines.append("  some parameters have no value; random values were used to find the rank")
        lines += [f"  note: {note}" for note in self.notes]
        return "\n".join(lines)

    def _assembled(self) -> str:
        """On which branch the loops are closed."""
        if self.guessed:
            name, (guess, value) = next(iter(self.guessed.items()))
            found = f"{name} = {value:.6g}, guessed {guess:.6g}"
            if self.guess_distance > BESIDE:
                return f"on the branch nearest to the guess, which is rough, off by {self.guess_distance:.2g}: {found}"
            exact = self.guess_distance <= MEASURED
            return "at the guess" if exact else f"on the branch nearest to the guess ({found})"
        if self.assembly_restarts:
            tries = f"{self.assembly_restarts} restart{'s' * (self.assembly_restarts != 1)}"
            return f"after {tries}: one of several ways to close the loops; give a guess to choose one"
        return "from the initial values, and from 0 where there are none"

    def _repr_html_(self) -> str:
        text = f"<pre style='font-family:monospace'>{html_text(str(self))}</pre>"
        return side_by_side(picture_html(lambda: new_figure(self)), text) if self.bodies else text


def _values(values: dict[str, float]) -> str:
    return ", ".join(f"{name} = {value:.6g}" for name, value in values.items())


def _list(names: list[str], limit: int = 12) -> str:
    if len(names) <= limit:
        return ", ".join(names)
    return ", ".join(names[: limit - 2]) + f", ... ({len(names) - limit + 2} more)"


def _list_joints(joints: list[dict[str, Any]], limit: int = 12) -> str:
    """Each with its type, or many of them by type."""
    if len(joints) <= limit:
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
        if _moves_in_a_plane(kinematics) and all(j.joint.role != "loop" for j in m.joints):
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
            {"name": e.name, "type": e.type_name, "bodies": [names[k + 1] for k in _touched(kinematics, e)]}
            for e in m.constraints
        ]
        + [
            {"name": e.name, "type": e.type_name, "bodies": [names[k + 1] for k in _touched(kinematics, e)], **TIMED}
            for e in (s.constraint for s in m.switched)
            if e is not None
        ],
        guessed={name: [guess, value] for name, guess, value in mobility.guessed},
        guess_distance=mobility.guess_distance,
        other_branches=[],
    )


def _touched(kinematics: Kinematics, element: object) -> list[int]:
    """Bodies that a constraint element holds: those of its markers, and those that its coordinates move."""
    m = kinematics.mechanism
    found: set[int] = set()
    moves = {n: (j.predecessor.body, j.successor.body) for j in m.joints for n in (*j.coordinates, *j.velocities)}

    def visit(value: object) -> None:
        if isinstance(value, Marker):
            found.add(value.body)
        elif isinstance(value, Expr):
            for name in symbols_of([value]):
                if name in moves:
                    found.update(moves[name][1:])
                elif name in m.quantities:
                    seen = m.quantities[name]
                    found.update(end.body for end in (seen.marker, seen.origin, seen.axes) if end is not None)
        elif isinstance(value, tuple):
            for item in value:
                visit(item)
        elif is_dataclass(value):
            for item in fields(value):
                visit(getattr(value, item.name))

    visit(element)
    return sorted(found)


def _moves_in_a_plane(kinematics: Kinematics) -> bool:
    """Whether every body turns about one ground axis only and moves across it, identically."""
    graph = kinematics.graph
    turns, slides = [], []
    for k in range(len(kinematics.mechanism.bodies)):
        origin = Marker(k, Frame(vec.identity(graph), vec.zero(graph)), "")
        turns.append(kinematics.motion.angular_velocity(origin))
        slides.append(kinematics.motion.velocity(origin))
    for axis in range(3):
        others = [i for i in range(3) if i != axis]
        if all(w[i].is_zero for w in turns for i in others) and all(v[axis].is_zero for v in slides):
            return bool(kinematics.mechanism.bodies)
    return False
