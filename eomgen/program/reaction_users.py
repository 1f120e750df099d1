"""Stage program, who speaks of reactions: laws, outputs and events -> what is wrong with what they ask for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ..base import algebra
from ..base.algebra import correlated
from ..base.limits.numbers import SINGULAR
from ..describe.mechanism import Mechanism
from ..errors import ModelError, Problem
from ..forces import JointCoordinate, ReactionFriction
from ..graph.core import Expr
from ..graph.evaluate import compile_evaluator
from ..graph.substitute import symbols_of
from ..kinematics import Kinematics
from ..kinematics.mobility import Mobility
from .law_pieces import MANY


class Users(NamedTuple):
    """The laws that speak of reactions, by force element; and, through the mechanism, all other expressions that do."""

    mechanism: Mechanism
    laws: Mapping[str, Sequence[Expr]]

    @property
    def forces(self) -> tuple[str, ...]:
        """Their names."""
        return tuple(self.laws)

    @property
    def paths(self) -> list[str]:
        """Places in the description, forces first; constraints that close where nothing else speaks of reactions."""
        asked = [q.path for q in self.mechanism.reaction_quantities.values() if not q.path.startswith("forces.")]
        held = [f"constraints.{s.constraint.name}" for s in self.mechanism.switched if s.constraint is not None]
        return [*(f"forces.{name}" for name in self.forces), *dict.fromkeys(asked)] or held

    def verb(self, plural: str) -> str:
        """The verb as it stands behind :meth:`together`."""
        return plural if self.forces else f"{plural}s"

    def together(self, message: str, remedy: str) -> Problem:
        """A problem of all laws, or of the first expression that speaks of reactions."""
        place = f"forces.{' and '.join(self.forces)}" if self.forces else self.paths[0]
        return self.mechanism.problem(place, message, remedy, "EG-UNSUPPORTED")


def too_many_pieces(mechanism: Mechanism, force: str) -> Problem:
    """A law whose choices make so many pieces that it is not judged whether it has one solution."""
    message = f"its law of a reaction has more than {MANY} pieces, made by abs, max, min, conditions and their products"
    remedy = "write it as a sum of terms with fewer of them, which are judged one by one, or as a smooth function"
    return mechanism.problem(f"forces.{force}", message, remedy, "EG-TOO-LARGE")


def refuse_joints(kinematics: Kinematics) -> None:
    """Refuse friction in joints whose reaction has no force across, or along, the z axis of S."""
    graph, mechanism = kinematics.graph, kinematics.mechanism
    specs, problems = {spec.name: spec for spec in mechanism.joints}, []
    for force in mechanism.forces:
        if not isinstance(force, ReactionFriction) or not isinstance(force.path, JointCoordinate):
            continue
        spec = specs[force.joint]
        columns = spec.joint.subspace(graph, [kinematics.motion.coordinates[n][0] for n in spec.coordinates])
        of = [velocity.of for velocity in spec.joint.velocities]
        place = spec.coordinates.index(force.path.name)
        own = columns[of.index(place)] if place in of else ()
        turns = spec.joint.coordinates[place].kind == "angle"
        straight = [[not part[2].is_zero and part[0].is_zero and part[1].is_zero for part in own]]
        free = [any(not linear[k].is_zero for _, linear in columns) for k in range(3)]
        if straight != [[turns, not turns]] or free[0] or free[1]:
            message = f"joint {spec.name!r} is {spec.joint.type_name}, which has no force across one fixed axis"
            remedy = "coefficient is known of revolute, prismatic and cylindrical joints; give coulomb instead"
            problems.append(mechanism.problem(f"forces.{force.name}", message, remedy, "EG-UNSUPPORTED"))
        elif force.thrust_radius is not None and free[2]:
            message = f"thrust_radius is given, and joint {spec.name!r} slides along its axis, so it carries no thrust"
            problems.append(
                mechanism.problem(f"forces.{force.name}", message, "leave thrust_radius out", "EG-UNSUPPORTED")
            )
    if problems:
        raise ModelError(problems)


def without_inertia(kinematics: Kinematics, mobility: Mobility, mass_matrix: Sequence[Sequence[Expr]]) -> list[str]:
    """What moves, by name, in a motion behind which a matrix has inertia at no configuration; nothing if there is none.

    Where there is none at single configurations only, as Euler angles make it, a run that gets there says so.
    """
    values = {p.name: p.value for p in kinematics.mechanism.parameters}
    if mobility.assumed or any(value is None for value in values.values()):
        return []
    flat, n = [x for row in mass_matrix for x in row], len(kinematics.v)
    names = sorted(symbols_of(flat))
    evaluator = compile_evaluator(flat, names)
    weights = None
    for place in mobility.samples or (mobility.q_reference,):
        known = dict(zip(kinematics.names, place, strict=True)) | values
        with np.errstate(all="ignore"):
            M = np.reshape(evaluator([float(known.get(name) or 0.0) for name in names]), (n, n))
        M = np.where(np.triu(np.ones((n, n), dtype=bool)), M, M.T)  # M may be given by one of its triangles
        if not np.isfinite(M).all():
            continue
        sizes, directions = algebra.eigh(correlated(M))
        if not n or sizes[0] > SINGULAR:
            return []
        if weights is None:
            weights = np.abs(directions[:, 0])
    if weights is None:
        return []
    return [x for x, w in zip(kinematics.velocity_labels, weights, strict=True) if w > 0.1 * weights.max()]


def refuse_without_inertia(moved: Sequence[str], users: Users) -> None:
    """Refuse a motion that loops leave, behind which there is no inertia."""
    if moved:
        message = f"{users.verb('depend')} on reactions, and moving {', '.join(moved)} meets no inertia"
        raise ModelError([users.together(message, "give every body mass, or inertia about its joint")])


def refuse_redundant(mobility: Mobility, users: Users) -> None:
    """Refuse mechanisms whose reactions are not unique."""
    if not mobility.redundant:
        return
    message = "depends on the reaction of a joint, and reactions are not unique: "
    message += f"{', '.join(mobility.redundant)} follow from the other constraints"
    remedy = "release only these rows by joints with more freedom, or take a law without reactions"
    raise ModelError([users.mechanism.problem(path, message, remedy, "EG-UNDETERMINED") for path in users.paths])
