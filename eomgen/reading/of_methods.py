"""Stage reading, methods: what one method of derivation has and others have not, as expressions.

Gibbs-Appell: the function S.  Hamilton: H(q, p) and p'.  Methods with reactions or multipliers as unknowns: the block
system that they solve.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ..errors import UnavailableError
from ..graph.core import Expr
from ..graph.differentiate import jacobian
from ..graph.evaluate import evaluate
from ..graph.substitute import substitute
from ..graph.symmetric import solve_symmetric
from .names_of_unknowns import momentum_names, multiplier_names, twist_rate_names, wrench_names
from .quantities import Quantities, Row, Rows, require_bodies

BLOCKS = ("augmented", "newton_euler", "amalgamated")  #: methods that solve one system for more than accelerations


def require_method(quantities: Quantities, what: str, methods: tuple[str, ...]) -> None:
    """Refuse a quantity of other methods.

    Raises
    ------
    UnavailableError
        It lists the methods that have the quantity.
    """
    method = quantities.tree.method
    if method not in methods:
        have = " or ".join(repr(name) for name in methods)
        raise UnavailableError(f"method {method!r} has no {what}; derive the model with method={have}")


def gibbs_function(quantities: Quantities) -> Expr:
    """S (W^2 kg) = v' . M v' / 2 - Q_v . v' on the tree, the energy of acceleration less what has no accelerations."""
    require_method(quantities, "function of Gibbs and Appell", ("gibbs_appell",))
    a, mass = quantities.kinematics.a, quantities.equations.mass_matrix
    total = quantities.graph.zero
    for i, x in enumerate(a):
        row = 0.5 * mass[i][i] * x - quantities.tree_quadratic_velocity[i]
        for j in range(i):
            row = row + mass[i][j] * a[j]
        total = total + row * x
    return total


def hamiltonian(quantities: Quantities) -> Expr:
    """H(q, p, t) = (p - b) . M^-1 (p - b) / 2 - T_0 + V with T = v . M v / 2 + b . v + T_0 (Goldstein, sec. 8.1)."""
    require_method(quantities, "Hamiltonian", ("hamilton",))
    kinematics, tree, graph = quantities.kinematics, quantities.tree, quantities.graph
    p = [graph.symbol(name) for name in momentum_names(kinematics)]
    still = dict.fromkeys(kinematics.v, graph.zero)
    *linear, at_rest = substitute([*quantities.momenta, tree.kinetic_energy], still)
    moved = [x - b for x, b in zip(p, linear, strict=True)]
    total = graph.zero
    for x, rate in zip(moved, solve_symmetric(quantities.equations.mass_matrix, moved), strict=True):
        total = total + x * rate
    found = 0.5 * total - at_rest + tree.potential_energy
    places = enumerate(quantities.mobility.q_reference)  # somewhere else: coordinates may be singular at the reference
    numbers = quantities.numbers | dict(zip(kinematics.names, (x + 0.3 + 0.1 * k for k, x in places), strict=True))
    if not math.isfinite(float(evaluate([found], numbers | dict.fromkeys(momentum_names(kinematics), 1.0))[0])):
        raise UnavailableError(
            "the mass matrix of the spanning tree has no inverse, so that H is no function of the momenta; give every "
            "body a mass and an inertia"
        )
    return found


def momentum_rates(quantities: Quantities) -> Row:
    """p' = -dH/dq + Q (n_v,) in terms of q and v, without the forces of constraints."""
    require_method(quantities, "rates of momenta", ("hamilton",))
    return quantities.tree.canonical[len(quantities.kinematics.v) :]


class LinearEquations(NamedTuple):
    """matrix times unknowns = right; ``unknowns`` are names."""

    matrix: Rows
    unknowns: tuple[str, ...]
    right: Row


def block_system(quantities: Quantities) -> LinearEquations:
    """The system that the method solves for accelerations and reactions.

    ``augmented``: [M C_q^T; C_q 0] [v'; lambda] = [Q + Q_v; -gamma], redundant constraints left out.
    """
    require_method(quantities, "block system", BLOCKS)
    kinematics, tree, zero = quantities.kinematics, quantities.tree, quantities.graph.zero
    if tree.method == "augmented" or tree.system is None:
        jacobian = quantities.constraint_jacobian
        upper = [(*row, *(line[i] for line in jacobian)) for i, row in enumerate(quantities.equations.mass_matrix)]
        lower = [(*line, *(zero for _ in jacobian)) for line in jacobian]
        unknowns = (*(str(a.node[1]) for a in kinematics.a), *multiplier_names(kinematics, len(quantities.rows)))
        right = (*(-h for h in quantities.equations.bias), *(-g for g in quantities.gamma))
        return LinearEquations((*upper, *lower), unknowns, right)
    system = tree.system
    n = len(system.unknowns)
    rows = [[zero] * n for _ in system.right]
    for (i, j), entry in zip(system.places, system.entries, strict=True):
        rows[i][j] = entry
    return LinearEquations(tuple(map(tuple, rows)), unknown_names(quantities), system.right)


def unknown_names(quantities: Quantities) -> tuple[str, ...]:
    """Names of the unknowns of newton_euler and amalgamated, in the order of the system.

    Of each body ``rod_alpha_x`` .. and ``rod_a_x`` .., the rates of its twist in the axes of its joint, gravity
    subtracted; of amalgamated also the accelerations of the joint; of its joint ``A_M_x`` .. and ``A_F_x`` .., the
    wrench on the body at the joint; then the multipliers.
    """
    kinematics, tree = quantities.kinematics, quantities.tree
    assert tree.system is not None
    names: list[str] = []
    for link, branch in zip(kinematics.links, kinematics.topology.branches, strict=True):
        joint = kinematics.mechanism.joints[branch.joint].name
        own = [str(kinematics.a[link.first + c].node[1]) for c in range(len(link.columns))]
        names += twist_rate_names(kinematics, link.name)
        names += own if tree.method == "amalgamated" else []
        names += wrench_names(kinematics, joint)
    left = len(tree.system.unknowns) - len(names)
    return (*names, *multiplier_names(kinematics, left))


def body_velocities(quantities: Quantities) -> Rows:
    """B_b (6 n_b, n_dof) of M = B_b^T M_b B_b (Shabana, sec. 5.7).

    The six velocities of a body are that of its centre of mass in ground axes, then its angular velocity in body axes.
    """
    require_bodies(quantities.kinematics)
    motion, v = quantities.kinematics.motion, list(quantities.kinematics.v)
    velocities: list[Expr] = []
    for body in quantities.kinematics.mechanism.bodies:
        velocities += quantities.velocity(body.name).center_of_mass
        velocities += motion.turning_of(quantities.markers[body.name], own_axes=True, rate=False)
    entries = jacobian(velocities, v)
    zero = quantities.graph.zero
    rows = [[entries.get((i, j), zero) for j in range(len(v))] for i in range(len(velocities))]
    return tuple(quantities.along_independent(row) for row in rows)


def body_mass_matrix(quantities: Quantities) -> Rows:
    """M_b (6 n_b, 6 n_b), mass and inertia body by body."""
    require_bodies(quantities.kinematics)
    bodies = quantities.kinematics.mechanism.bodies
    mass = [[quantities.graph.zero] * (6 * len(bodies)) for _ in range(6 * len(bodies))]
    for k, body in enumerate(bodies):
        for i in range(3):
            mass[6 * k + i][6 * k + i] = body.mass
            mass[6 * k + 3 + i][6 * k + 3 : 6 * k + 6] = body.inertia[i]
    return tuple(map(tuple, mass))
