"""Stage reading, generalized forces: Kinematics -> the generalized forces of gravity and of each force element alone.

Q of a force element is found by virtual power, Q = sum F . dv/dv_j; where the element has a potential V, also as
-dV/dq and the virtual power of the rest.  Of the two, the one with fewer operations is taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..equations.analytical import form_energies
from ..forces import CoordinateLoad, MarkerLoad
from ..graph import vectors as vec
from ..graph.core import Expr
from ..graph.count import count
from ..graph.differentiate import gradient, vjp
from ..kinematics import Kinematics
from ..kinematics.energies import potential_energy

GRAVITY = "gravity"  #: name of the entry of gravity
POTENTIAL, FORCES, DISSIPATION = "potential", "forces", "dissipation"  #: entries of a bare Lagrangian


def forces_by_element(kinematics: Kinematics) -> dict[str, list[Expr]]:
    """Generalized forces (n_v,) on the tree, by the name of the force element; of gravity where there is any.

    An element that is itself called ``gravity`` keeps its name; gravity is ``gravity_field`` then.  A bare Lagrangian
    has the entries ``potential`` (-dV/dq), ``forces`` and ``dissipation``, those of them that do not vanish.
    """
    if kinematics.mechanism.lagrangian is not None:
        return _of_lagrangian(kinematics)
    found: dict[str, list[Expr]] = {}
    names = {terms.force.name for terms in kinematics.forces}
    if not all(x.is_zero for x in kinematics.mechanism.gravity):
        height = potential_energy(replace(kinematics, forces=()))
        found[GRAVITY if GRAVITY not in names else f"{GRAVITY}_field"] = _downhill(kinematics, height)
    for terms in kinematics.forces:
        force = _virtual_power(kinematics, terms.marker_loads, terms.coordinate_loads)
        if terms.potential is not None:
            rest = _virtual_power(kinematics, terms.marker_remainder, terms.coordinate_remainder)
            slope = _downhill(kinematics, terms.potential)
            other = [a + b for a, b in zip(slope, rest, strict=True)]
            force = min(other, force, key=lambda forces: count(forces).total)
        found[terms.force.name] = force
    return found


def _of_lagrangian(kinematics: Kinematics) -> dict[str, list[Expr]]:
    bare = kinematics.mechanism.lagrangian
    assert bare is not None
    _, potential = form_energies(kinematics)
    drag = gradient(bare.dissipation, list(kinematics.v))
    found = {
        POTENTIAL: _downhill(kinematics, potential),
        FORCES: list(bare.forces),
        DISSIPATION: [-d for d in drag],
    }
    return {name: force for name, force in found.items() if not all(x.is_zero for x in force)}


def _downhill(kinematics: Kinematics, potential: Expr) -> list[Expr]:
    """-dV/dq along the velocities: -N^T dV/dq where q' = N v."""
    slope = [-x for x in gradient(potential, list(kinematics.q))]
    if kinematics.rates == kinematics.v:
        return slope
    return vjp(list(kinematics.rates), slope, list(kinematics.v))


def _virtual_power(
    kinematics: Kinematics, at_markers: Sequence[MarkerLoad], along: Sequence[CoordinateLoad]
) -> list[Expr]:
    """The generalized forces of some loads."""
    motion, loop = kinematics.motion, kinematics.loop_coordinates
    total = [kinematics.graph.zero] * len(kinematics.v)
    moved: list[Expr] = []
    weights: list[Expr] = []
    for load in at_markers:
        moved += [*motion.velocity(load.marker), *motion.angular_velocity(load.marker)]
        weights += [*load.force, *load.torque]
    for one in along:
        if one.coordinate in kinematics.velocity_labels:
            j = kinematics.velocity_labels.index(one.coordinate)
            total[j] = total[j] + one.value
        else:
            moved.append(loop.rates[loop.names.index(one.coordinate)])
            weights.append(one.value)
    pairs = [(x, w) for x, w in zip(moved, weights, strict=True) if not (x.is_zero or w.is_zero)]
    if not pairs:
        return total
    powers = vjp([x for x, _ in pairs], [w for _, w in pairs], list(kinematics.v))
    return [a + b for a, b in zip(total, powers, strict=True)]


def without_forces(kinematics: Kinematics) -> Kinematics:
    """The same motion with no gravity and no force element; of a bare Lagrangian, L without V."""
    mechanism, graph = kinematics.mechanism, kinematics.graph
    bare = mechanism.lagrangian
    if bare is not None:
        still = tuple(graph.zero for _ in bare.forces)
        moving = bare.expression + form_energies(kinematics)[1]
        bare = replace(bare, expression=moving, forces=still, dissipation=graph.zero)
    alone = replace(mechanism, gravity=vec.zero(graph), forces=(), lagrangian=bare)
    return replace(kinematics, mechanism=alone, forces=())
