"""Stage equations: free bodies -> what the methods with reactions as unknowns share: symbols, constraints, M and h.

M and h, which other calls of a module want, come from the same balances, summed from the tips inwards.
"""

from __future__ import annotations

from collections.abc import Sequence

from ..frames import GROUND
from ..graph import vectors as vec
from ..graph.core import Expr
from ..graph.differentiate import jacobian
from ..graph.spatial import Twist, Wrench, add, dot, scaled
from ..graph.substitute import substitute
from ..kinematics import Kinematics
from ..kinematics.typical_sizes import Units
from .free_bodies import FreeBodies, FreeBodyCut
from .tree_equations import LinearSystem, TreeEquations, linear_system


def free_body_equations(kinematics: Kinematics, method: str, system: LinearSystem) -> TreeEquations:
    """What a method offers beside its linear system: M, h and energies from the balances of the bodies."""
    graph, n = kinematics.graph, len(kinematics.v)
    bodies = FreeBodies(kinematics)
    inverse = _inverse_dynamics(bodies)
    entries = jacobian(inverse, list(kinematics.a))
    kinetic, potential = graph.zero, graph.zero
    for k, (link, twist) in enumerate(zip(kinematics.links, kinematics.twists, strict=True)):
        kinetic = kinetic + 0.5 * dot(twist, link.spatial.times(*twist))
        pose = kinematics.poses.link(k)
        centre = vec.add(pose.position, vec.times(pose.rotation, link.com))
        potential = potential - link.mass * vec.dot(kinematics.mechanism.gravity, centre)
    for terms in kinematics.forces:
        potential = potential + (graph.zero if terms.potential is None else terms.potential)
    return TreeEquations(
        method=method,
        mass_matrix=tuple(tuple(entries.get((max(i, j), min(i, j)), graph.zero) for j in range(n)) for i in range(n)),
        bias=tuple(substitute(inverse, dict.fromkeys(kinematics.a, graph.zero))),
        inverse_dynamics=tuple(inverse),
        kinetic_energy=kinetic,
        potential_energy=potential,
        system=system,
    )


def _inverse_dynamics(bodies: FreeBodies) -> list[Expr]:
    """M a + h of the tree without drives: reactions from the balances, tips first, and their part along each joint."""
    kinematics, graph = bodies.kinematics, bodies.graph
    motions: list[Twist] = []
    for link, product in zip(kinematics.links, bodies.products, strict=True):
        above = motions[link.parent] if link.parent != GROUND else bodies.base
        motion = add(link.down_twist(above), product)
        for c, column in enumerate(link.columns):
            motion = add(motion, scaled(kinematics.a[link.first + c], column))
        motions.append(motion)
    none: Wrench = vec.zero(graph), vec.zero(graph)
    wrenches = bodies.balances(motions, [none] * len(motions))
    result = [-f for f in bodies.forces]
    for name, value in bodies.along_cut.items():
        row = kinematics.loop_coordinates.jacobian[kinematics.loop_coordinates.names.index(name)]
        result = [r - entry * value for r, entry in zip(result, row, strict=True)]
    for k in reversed(range(len(wrenches))):
        link = kinematics.links[k]
        for c, column in enumerate(link.columns):
            result[link.first + c] = result[link.first + c] + dot(column, wrenches[k])
        if link.parent != GROUND:
            wrenches[link.parent] = add(wrenches[link.parent], link.lift(wrenches[k]))
    return result


class Unknowns:
    """Symbols z[0], z[1], ..., handed out in order, and their sizes."""

    def __init__(self, kinematics: Kinematics) -> None:
        self.graph = kinematics.graph
        self.symbols: list[Expr] = []
        self.sizes: list[Expr] = []

    def take(self, sizes: Sequence[Expr]) -> list[Expr]:
        """The next symbols, one of each size."""
        first = len(self.symbols)
        self.symbols += [self.graph.symbol(f"z[{first + k}]") for k in range(len(sizes))]
        self.sizes += sizes
        return self.symbols[first:]

    def six(self, sizes: Sequence[Expr]) -> Twist:
        """The next six, as a twist or wrench."""
        x = self.take(sizes)
        return (x[0], x[1], x[2]), (x[3], x[4], x[5])


class Forces:
    """Multipliers of cut joints and couplings, their equations, and what they do to bodies and joints."""

    def __init__(self, bodies: FreeBodies, cuts: Sequence[FreeBodyCut], unknowns: Unknowns, units: Units) -> None:
        self.bodies, self.cuts, self.unknowns = bodies, cuts, unknowns
        self.first = len(unknowns.symbols)
        self.rows = bodies.couplings
        kinds = [[units.of(kind) for kind in cut.kinds] for cut in cuts]
        coupled = [units.of(bodies.kinematics.constraints.kinds[i]) for i in self.rows]
        self.sizes = [*(size for sizes in kinds for size in sizes), *coupled]  #: of the constraints
        self.multipliers = [unknowns.take([units.energy / size for size in sizes]) for sizes in kinds]
        self.along = unknowns.take([units.energy / size for size in coupled])
        constraints = bodies.kinematics.constraints
        self.pulls = [bodies.graph.zero] * len(bodies.kinematics.v)  # C_q^T l of the couplings
        for i, l in zip(self.rows, self.along, strict=True):
            self.pulls = [f + entry * l for f, entry in zip(self.pulls, constraints.jacobian[i], strict=True)]

    def close(self, balances: list[Wrench], motions: Sequence[Twist], a: Sequence[Expr]) -> list[Expr]:
        """Apply the wrenches of cut joints to the balances; return all constraint equations."""
        residuals: list[Expr] = []
        for cut, multipliers in zip(self.cuts, self.multipliers, strict=True):
            accelerations = cut.accelerations(motions, self.bodies.base)
            cut.push(balances, multipliers, accelerations)
            residuals += accelerations[: cut.closing]
        constraints = self.bodies.kinematics.constraints
        for i in self.rows:
            total = constraints.gamma[i]
            for entry, x in zip(constraints.jacobian[i], a, strict=True):
                total = total + entry * x
            residuals.append(total)
        return residuals

    def solve(
        self, residuals: Sequence[Expr], sizes: Sequence[Expr], closing: Sequence[Expr], a: Sequence[Expr]
    ) -> LinearSystem:
        """The system of all equations, the constraints last."""
        relaxed = [(len(residuals) + k, self.first + k) for k in range(len(closing))]
        sizes = [*sizes, *self.sizes, *self.unknowns.sizes]
        return linear_system([*residuals, *closing], self.unknowns.symbols, relaxed, sizes, a)
