"""Kinematics -> TreeEquations by the articulated-body method, linear in the number of bodies.

Featherstone, Rigid Body Dynamics Algorithms (2008), ch. 5 and 7, in link axes.  Linear accelerations are those of the
links' origins, gravity subtracted, so that linear velocities never appear.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from ...elements.frames import GROUND
from ...expr import vectors as vec
from ...expr.core import Expr
from ...expr.schedule import count
from ...expr.spatial import Twist, Wrench, add, scaled
from .. import Kinematics
from ..kinematics import joint_rates
from ..link_frames import SlidingTriple, falling, regroup, turn_back, turn_forces, turn_links
from ..tree import JointRates, SpatialInertia
from ..wrenches import applied_wrenches, coordinate_forces, cut_drives, drive_inertias, kinetic_energy, potential_energy
from .recursions import ArticulatedBodies, ConstraintRow, TreeMotion, along_joints, composite_mass_matrix
from .tree_equations import TreeEquations


def derive(kinematics: Kinematics) -> TreeEquations:
    """Equations of the spanning tree; of a tree without loops also its accelerations in closed form."""
    products = _velocity_products(kinematics, joint_rates(kinematics))
    a = kinematics.a
    inertias = [link.spatial for link in kinematics.links]
    loads = _loads(kinematics, inertias)
    inverse = _newton_euler(kinematics, inertias, products, loads, a)
    grouped = regroup(kinematics.graph, kinematics.links)
    lighter = _loads(kinematics, grouped)
    shorter = _newton_euler(kinematics, grouped, products, lighter, a)
    if count(shorter).total <= count(inverse).total:  # grouping symbols is work too
        inertias, loads, inverse = grouped, lighter, shorter
    rest = tuple(kinematics.graph.zero for _ in a)
    solve = None if cut_drives(kinematics) else partial(solve_tree, kinematics, inertias, products, loads)
    tree = solve() if solve is not None and not kinematics.constraints.labels else None
    return TreeEquations(
        method="recursive",
        mass=partial(composite_mass_matrix, kinematics.links, inertias),
        bias=_newton_euler(kinematics, inertias, products, loads, rest),
        inverse_dynamics=inverse,
        kinetic_energy=kinetic_energy(kinematics),
        potential_energy=potential_energy(kinematics),
        accelerations=tree.accelerations if tree else None,
        pivots=tree.pivots if tree else (),
        constrained=solve,
    )


def _velocity_products(kinematics: Kinematics, rates: list[JointRates]) -> list[Twist]:
    """Acceleration of each link relative to its parent at v' = 0: Coriolis and centripetal terms."""
    graph = kinematics.graph
    products: list[Twist] = []
    for link, rate in graph.marked(zip(kinematics.links, rates, strict=True)):
        above = kinematics.twists[link.parent][0] if link.parent != GROUND else vec.zero(graph)
        products.append(rate.product(link, above))
    return products


def _loads(kinematics: Kinematics, inertias: list[SpatialInertia]) -> list[Wrench]:
    """Wrench on each link at zero acceleration: omega x momentum, less what is applied."""
    result: list[Wrench] = []
    applied = applied_wrenches(kinematics)
    for inertia, (omega, _), (turn, push) in kinematics.graph.marked(
        zip(inertias, kinematics.twists, applied, strict=True)
    ):
        spin = vec.cross(omega, vec.times(inertia.inertia, omega))
        swing = vec.cross(omega, vec.cross(omega, inertia.moment))
        result.append((vec.sub(spin, turn), vec.sub(swing, push)))
    return result


def _base(kinematics: Kinematics) -> Twist:
    """Acceleration of ground that acts as gravity does."""
    return vec.zero(kinematics.graph), vec.neg(kinematics.mechanism.gravity)


def _newton_euler(
    kinematics: Kinematics,
    inertias: list[SpatialInertia],
    products: list[Twist],
    loads: list[Wrench],
    a: Sequence[Expr],
) -> tuple[Expr, ...]:
    """M a + h: accelerations outwards, wrenches inwards (Featherstone, RBDA, table 5.1)."""
    links, graph = kinematics.links, kinematics.graph
    motions: list[Twist] = []
    wrenches: list[Wrench] = []
    for k, link in graph.marked(enumerate(links)):
        motion = add(link.down_twist(motions[link.parent] if link.parent != GROUND else _base(kinematics)), products[k])
        for c, column in enumerate(link.columns):
            motion = add(motion, scaled(a[link.first + c], column))
        motions.append(motion)
        wrenches.append(add(inertias[k].times(*motion), loads[k]))
    inwards = graph.marked(reversed(range(len(links))))
    return tuple(along_joints(links, wrenches, coordinate_forces(kinematics), inwards))


def solve_tree(
    kinematics: Kinematics,
    inertias: list[SpatialInertia],
    products: list[Twist],
    loads: list[Wrench],
    rows: Sequence[ConstraintRow] = (),
    term: float = 0.0,
    loaded: bool = True,
    forces: Sequence[Expr] | None = None,
) -> TreeMotion:
    """v' of the tree, on which constraints may act; found in velocities of which some are turned.

    Without ``loaded`` there are no forces, gravity and velocities but the forces given: what these and the constraints
    make of their rests.
    """
    links, blocks = turn_links(kinematics.links, kinematics.mechanism.gravity)
    still = vec.zero(kinematics.graph)
    if loaded:
        forces = coordinate_forces(kinematics)
    else:
        blocks = tuple(replace(b, gravity=None) for b in blocks)
        products = loads = [(still, still)] * len(loads)
        forces = forces or [kinematics.graph.zero] * len(kinematics.v)
    afloat = falling(blocks)
    bodies = ArticulatedBodies(
        kinematics.graph,
        links,
        inertias,
        products,
        loads,
        turn_forces(blocks, forces),
        drive_inertias(kinematics),
        [(still, still) if k in afloat or not loaded else _base(kinematics) for k in range(len(links))],
        [_turn_row(blocks, row) for row in rows],
        term,
    )
    result = bodies.solve()
    return result._replace(accelerations=tuple(turn_back(blocks, result.accelerations)))


def _turn_row(blocks: Sequence[SlidingTriple], row: ConstraintRow) -> ConstraintRow:
    """A constraint on v' -> the same on w', which leaves out the gravity of what falls."""
    entries, rest = dict(row.entries), row.rest
    for b in blocks:
        zero = rest.graph.zero
        along = [entries.pop(b.first + i, zero) for i in range(3)]
        x, y, z = vec.transpose_times(b.rotation, (along[0], along[1], along[2]))
        entries |= {b.first + i: entry for i, entry in enumerate((x, y, z)) if not entry.is_zero}
        if b.gravity is not None:
            rest = rest + vec.dot((along[0], along[1], along[2]), b.gravity)
    return ConstraintRow(entries, rest)
