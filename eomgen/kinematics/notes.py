"""Stage kinematics: Mobility -> what a person should know before trusting the model, each with a remedy."""

from __future__ import annotations

from collections import Counter

import numpy as np

from ..base.limits.analyses import MOST_ANGLE, SLACK
from ..base.limits.numbers import ACROSS
from ..base.operations import CHOICE, OPERATIONS
from ..base.texts import angle_in_degrees
from ..constraints import Driver
from ..frames import Frame, Marker
from ..graph import vectors as vec
from ..graph.core import Expr
from ..graph.evaluate import compile_evaluator
from ..graph.substitute import symbols_of
from ..graph.traverse import reachable
from .kinematics import Kinematics
from .mobility import Mobility, initial_values

POOR = 1e-2  #: conditioning below which another choice of independent coordinates is worth a word
SHOWN = 6
TRIED = 3  #: states at which a body's angular velocity is looked at


def find_notes(kinematics: Kinematics, mobility: Mobility) -> list[str]:
    """Locked and overconstrained mechanisms, change points, badly chosen independent coordinates."""
    m = kinematics.mechanism
    notes = list(m.notes)
    moved = mobility.driven or m.forces or m.inputs or m.switched
    if m.default_gravity and not moved and any(not body.mass.is_zero for body in m.bodies):
        notes.append(
            "no gravity is given and no force acts, so that nothing speeds up or slows down but by inertia; if it "
            "should fall, give gravity; gravity (0, 0, 0) says that it should not"
        )
    if kinematics.constraints.labels and mobility.n_dof == 0 and not mobility.driven:
        held = _few([*dict.fromkeys(label.partition(".")[0] for label in kinematics.constraints.labels)])
        notes.append(
            f"locked: the mechanism has no degree of freedom, and no driver moves it (held by {held}); "
            "if it should move, remove a constraint, or replace a joint by one with more freedom"
        )
    follow = f"{_few(mobility.redundant)} follow{'s' if len(mobility.redundant) == 1 else ''} from"
    if mobility.redundant and kinematics.given_rates and not mobility.assumed:
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
    m = kinematics.mechanism
    numbers = {p.name: p.value for p in m.parameters} | {u.name: u.value for u in m.inputs}
    if mobility.assumed:
        return []
    given = initial_values(kinematics, numbers, "guess") | initial_values(kinematics, numbers)
    names = (*kinematics.names, *kinematics.loop_coordinates.names)
    kinds = dict(zip(names, (*kinematics.kinds, *kinematics.loop_coordinates.kinds), strict=True))
    return [
        angle_in_degrees(name, x)
        for name, x in given.items()
        if kinds.get(name) in ("angle", "turn") and abs(x) > MOST_ANGLE
    ]


def _beyond_limits(kinematics: Kinematics, mobility: Mobility) -> list[str]:
    """Coordinates that start beyond a declared limit of their joint."""
    m, at = kinematics.mechanism, dict(zip(kinematics.names, mobility.q_reference, strict=True))
    declared = [pair for j in m.joints for pair in zip(j.coordinates, j.limits, strict=False)]
    found = []
    for name, limits in declared if m.limits_told and not mobility.assumed else ():
        for key, limit in limits:
            beyond = {"lower": limit - at.get(name, limit), "upper": at.get(name, limit) - limit}.get(key, 0.0)
            if beyond > SLACK * (1.0 + abs(limit)):
                found.append(
                    f"{name} starts at {at[name]:.6g}, beyond its {key} limit {limit:g}; limits alone stop nothing: "
                    "give another initial value, or add a force of type stop"
                )
    return found


def _turned_out_of_plane(kinematics: Kinematics) -> list[str]:
    """Bodies with one moment of inertia, as in a plane, whose joints turn them about other axes too."""
    mechanism, graph = kinematics.mechanism, kinematics.graph
    bodies = [(k, body) for k, body in enumerate(mechanism.bodies) if body.plane is not None]
    across: list[Expr] = []
    for k, body in bodies:
        marker = Marker(k, Frame(vec.identity(graph), vec.zero(graph)), body.name)
        spin = kinematics.motion.turning_of(marker, own_axes=True, rate=False)
        across += vec.cross(spin, body.plane or spin)
    symbols = sorted(symbols_of(across))
    if not symbols:
        return []
    values = np.random.default_rng(1).uniform(0.5, 1.5, (TRIED, len(symbols)))
    with np.errstate(all="ignore"):
        evaluate = compile_evaluator(across, symbols)
        sizes = np.abs([evaluate(row.tolist()) for row in values]).max(axis=0).reshape(-1, 3).max(axis=1)
    return [body.name for (_, body), size in zip(bodies, sizes, strict=True) if size > ACROSS]


def _drivers_with_corners(kinematics: Kinematics) -> list[tuple[str, list[str]]]:
    """Names of drivers whose value takes one of several branches, and by which functions."""
    found = []
    for constraint in kinematics.mechanism.constraints:
        if isinstance(constraint, Driver):
            graph = constraint.value.graph
            operations = {graph.nodes[i][0] for i in reachable(graph, [constraint.value.id])}
            corners = [row.word for row in OPERATIONS.values() if row.kind == CHOICE and row.name in operations]
            found += [(constraint.name, corners)] if corners else []
    return found


def _few(names: tuple[str, ...] | list[str]) -> str:
    shown = ", ".join(names[:SHOWN])
    return shown if len(names) <= SHOWN else f"{shown}, ... ({len(names) - SHOWN} more)"
