"""Stage program, laws of reactions: Kinematics whose forces speak of joints' reactions -> the same, solved for these.

Accelerations, multipliers and reactions are linear in the forces f of such laws: N = N0 + K f.  A law gives f = g(N).
Newton's method on f = g(N0 + K f) is written out on the graph, a fixed number of steps, with the exact slopes of g.
What stands for N afterwards is a function of the state, as any other law is, so that every method of derivation, every
target and every derivative sees ordinary forces.

A law is taken to have slopes of any sign up to their size, as that of |N| has.  It has one solution for every N0 if
I - B is an M-matrix, B[i, j] = |dg_i/dN| |K[., j]|: then g is a contraction in a weighted maximum norm (A. Berman,
R. J. Plemmons, Nonnegative Matrices in the Mathematical Sciences (1994), ch. 6).  For one law this is |mu K| < 1, the
limit beyond which Painleve's examples have two solutions or none (P. Painleve, Sur les lois du frottement de
glissement, C. R. Acad. Sci. Paris 121 (1895), 112-115).  Where it fails, the forces are no numbers, and what is asked
ends with an error that names the elements.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from dataclasses import replace

import numpy as np

from ..equations import METHODS
from ..errors import ModelError, Problem
from ..forces import JointCoordinate, ReactionFriction
from ..forces.joint_reactions import reaction_of
from ..graph.core import Expr, sqrt
from ..graph.differentiate import jacobian
from ..graph.evaluate import compile_evaluator
from ..graph.substitute import substitute, symbols_of
from ..kinematics import Kinematics
from ..kinematics.carried_reactions import carried_reactions
from ..kinematics.kinematics import ForceTerms
from ..kinematics.mobility import Mobility
from ..kinematics.resolved_loads import AnyLoad, entries_of, with_entries
from ..kinematics.wrenches import JointWrenches
from ..limits.inertia import SINGULAR
from ..limits.systems import FIXED, UNTOUCHED
from ..numeric import algebra
from ..numeric.definite import correlated
from .factor import factorize, solve

#: Of Newton's method from f = 0.  Random laws of 1 to 8 forces (|N| in space, spectral radius of B up to 0.99) were met
#: to 3e-12 by then, to 1e-15 where that is 0.9.
STEPS = 7
PROBES = 3  #: states at which components are looked at

Matrix = list[list[Expr]]


def with_reactions(kinematics: Kinematics, mobility: Mobility) -> Kinematics:
    """Replace the reactions that laws speak of by what they are at a state.

    Raises
    ------
    ModelError
        A reaction that rigid bodies do not determine, or of a joint that has none.
    """
    _refuse_joints(kinematics)
    graph = kinematics.graph
    flat = list(dict.fromkeys(e for terms in kinematics.forces for e in _entries(terms)))
    spoken = {e: found for e in flat if (found := {n for n in symbols_of([e]) if reaction_of(n)})}
    laws, names = list(spoken), sorted(set().union(*spoken.values()))
    forces = [graph.symbol(f"law[{k}]") for k in range(len(laws))]
    linear = _replaced(kinematics, dict(zip(laws, forces, strict=True)))
    labels = [kinematics.constraints.labels[i] for i in mobility.independent_rows]
    still, gain = _linear_parts(linear, mobility, names, forces, labels)
    symbols = [graph.symbol(name) for name in names]
    values = _solve_laws(laws, symbols, still, gain)
    carried = dict(zip(symbols, values, strict=True))
    motion = copy(kinematics.motion)
    motion.carried = dict(zip(names, values, strict=True))
    return replace(_replaced(kinematics, carried, inside=True), motion=motion)


def _entries(terms: ForceTerms) -> list[Expr]:
    every = (terms.marker_loads, terms.coordinate_loads, terms.marker_remainder, terms.coordinate_remainder)
    return [e for loads in every for load in loads for e in entries_of(load)]


def _with(loads: tuple[AnyLoad, ...], values: Iterator[Expr]) -> tuple[AnyLoad, ...]:
    return tuple(with_entries(load, values) for load in loads)


def _replaced(kinematics: Kinematics, mapping: Mapping[Expr, Expr], inside: bool = False) -> Kinematics:
    """Other entries of the loads: whole ones, or with ``inside`` the symbols in them."""
    flat = [e for terms in kinematics.forces for e in _entries(terms)]
    values = iter(substitute(flat, mapping) if inside else [mapping.get(e, e) for e in flat])
    found = []
    for terms in kinematics.forces:
        markers, along = _with(terms.marker_loads, values), _with(terms.coordinate_loads, values)
        rest, rest_along = _with(terms.marker_remainder, values), _with(terms.coordinate_remainder, values)
        found.append(ForceTerms(terms.force, markers, along, terms.potential, rest, rest_along))
    return replace(kinematics, forces=tuple(found))


# -- linear parts ---------------------------------------------------------------------------------------------------
def _linear_parts(
    kinematics: Kinematics, mobility: Mobility, names: Sequence[str], forces: Sequence[Expr], labels: Sequence[str]
) -> tuple[list[Expr], Matrix]:
    """N0 and K of the components ``names``, with symbols in place of the laws."""
    graph = kinematics.graph
    reactions, multipliers = _reactions(kinematics, mobility, names, labels)
    unknown = [*kinematics.a, *multipliers]
    a, columns = _motion(kinematics, mobility, forces)
    slopes = jacobian(reactions, [*unknown, *forces])
    base = substitute(reactions, dict.fromkeys([*unknown, *forces], graph.zero))
    still, gain = [], []
    for i, N in enumerate(base):
        row = [slopes.get((i, j), graph.zero) for j in range(len(unknown) + len(forces))]
        still.append(_sum([N, *(d * x for d, x in zip(row, a, strict=False))]))
        gain.append(
            [
                _sum([row[len(unknown) + j], *(d * x for d, x in zip(row, column, strict=False))])
                for j, column in enumerate(columns)
            ]
        )
    return still, gain


def _motion(kinematics: Kinematics, mobility: Mobility, forces: Sequence[Expr]) -> tuple[list[Expr], Matrix]:
    """[a; l] without the laws' forces, and what a unit of each of them changes: M a + h + C^T l = 0, C a = -gamma."""
    graph, constraints = kinematics.graph, kinematics.constraints
    tree = METHODS["embedding"](kinematics)
    _require_inertia(kinematics, mobility, tree.mass_matrix)
    slopes, n = jacobian(list(tree.bias), list(forces)), len(kinematics.v)
    bias = substitute(list(tree.bias), dict.fromkeys(forces, graph.zero))
    right = [[-h for h in bias]]
    right += [[-slopes.get((i, j), graph.zero) for i in range(n)] for j in range(len(forces))]
    factor = factorize(tree.mass_matrix, kinematics.parent)
    free = [solve(factor, column) for column in right]
    rows = mobility.independent_rows
    C = [constraints.jacobian[i] for i in rows]
    moved = [solve(factor, row) for row in C]
    schur = [[_dot(row, y) for y in moved] for row in C]
    gamma = [constraints.gamma[i] for i in rows]
    found = []
    for k, a in enumerate(free):
        gap = [_dot(row, a) + (g if k == 0 else 0.0) for row, g in zip(C, gamma, strict=True)]
        held = eliminate(schur, gap)
        for y, multiplier in zip(moved, held, strict=True):
            a = [x - multiplier * z for x, z in zip(a, y, strict=True)]
        found.append([*a, *held])
    return found[0], found[1:]


def _reactions(
    kinematics: Kinematics, mobility: Mobility, names: Sequence[str], labels: Sequence[str]
) -> tuple[list[Expr], list[Expr]]:
    """The components in terms of accelerations, multipliers and forces, and the multipliers of ``labels``.

    Raises
    ------
    ModelError
    """
    graph = kinematics.graph
    wrenches = JointWrenches(kinematics)
    _refuse_redundant(kinematics, mobility)
    own = {label: graph.symbol(f"multiplier[{label}]") for label in labels}
    idle = {label: graph.symbol(f"multiplier[{label}]") for label in wrenches.on_bodies if label not in own}
    every = carried_reactions(wrenches, own | idle)
    where = [reaction_of(name) or ("", 0) for name in names]
    reactions = [every[joint][k] for joint, k in where]
    slopes = jacobian(reactions, list(idle.values())) if idle else {}
    reactions = substitute(reactions, dict.fromkeys(idle.values(), graph.zero)) if idle else reactions
    for i, (joint, _) in enumerate(where):
        if not _is_zero([x for (row, _), x in slopes.items() if row == i]):
            if not _is_zero([reactions[i]]):
                message = "rigid bodies do not determine how this joint shares a force with others of its loop"
                remedy = (
                    "let the forces act in the plane of the loop, or give a joint of the loop more freedom "
                    "(cylindrical, spherical)"
                )
                raise ModelError([_problem(kinematics, joint, message, remedy)])
            reactions[i] = graph.zero
    return reactions, [own[label] for label in labels]


def _refuse_joints(kinematics: Kinematics) -> None:
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
            problems.append(mechanism.problem(f"forces.{force.name}", message, remedy))
        elif force.thrust_radius is not None and free[2]:
            message = f"thrust_radius is given, and joint {spec.name!r} slides along its axis, so it carries no thrust"
            problems.append(mechanism.problem(f"forces.{force.name}", message, "leave thrust_radius out"))
    if problems:
        raise ModelError(problems)


def _require_inertia(kinematics: Kinematics, mobility: Mobility, mass_matrix: Sequence[Sequence[Expr]]) -> None:
    """Refuse a tree that does not have inertia behind every coordinate, with which its reactions are found."""
    values = {p.name: p.value for p in kinematics.mechanism.parameters}
    if mobility.assumed or any(value is None for value in values.values()):
        return
    known = dict(zip(kinematics.names, mobility.q_reference, strict=True)) | values
    flat, n = [x for row in mass_matrix for x in row], len(kinematics.v)
    names = sorted(symbols_of(flat))
    with np.errstate(all="ignore"):
        M = np.reshape(compile_evaluator(flat, names)([float(known.get(name) or 0.0) for name in names]), (n, n))
    M = np.where(np.triu(np.ones((n, n), dtype=bool)), M, M.T)  # M may be given by one of its triangles
    sizes, directions = algebra.eigh(correlated(M))
    if n and not sizes[0] > SINGULAR:
        weights = np.abs(directions[:, 0])
        moved = [x for x, w in zip(kinematics.velocity_labels, weights, strict=True) if w > 0.1 * weights.max()]
        laws = " and ".join(force.name for force in kinematics.mechanism.forces if force.by_reaction)
        message = f"depend on reactions, and moving {', '.join(moved)} without its loops meets no inertia"
        remedy = "give every body mass, or inertia about its joint"
        raise ModelError([kinematics.mechanism.problem(f"forces.{laws}", message, remedy)])


def _refuse_redundant(kinematics: Kinematics, mobility: Mobility) -> None:
    if mobility.redundant:
        owners = dict.fromkeys(label.partition(".")[0] for label in mobility.redundant)
        problems = []
        for force in kinematics.mechanism.forces:
            if force.by_reaction:
                message = (
                    f"depends on the reaction of a joint, and reactions are not unique: constraints of "
                    f"{', '.join(owners)} follow from the others"
                )
                remedy = "give the joints there more freedom (cylindrical, spherical), or take a law without reactions"
                problems.append(kinematics.mechanism.problem(f"forces.{force.name}", message, remedy))
        raise ModelError(problems)


def _problem(kinematics: Kinematics, joint: str, message: str, remedy: str) -> Problem:
    """A problem of the element whose law speaks of the joint's reaction."""
    users = [f.name for f in kinematics.mechanism.forces if getattr(f, "joint", None) == joint]
    return kinematics.mechanism.problem(f"forces.{users[0]}" if users else f"joints.{joint}", message, remedy)


def _is_zero(expressions: Sequence[Expr]) -> bool:
    """Whether expressions vanish whatever their symbols are."""
    left = [x for x in expressions if not x.is_zero]
    if not left:
        return True
    names = sorted(symbols_of(left))
    values = np.random.default_rng(2).uniform(0.5, 1.5, (PROBES, len(names)))
    with np.errstate(all="ignore"):
        evaluate = compile_evaluator(left, names)
        sizes = np.array([evaluate(row.tolist()) for row in values])
    return bool((np.abs(sizes) < UNTOUCHED).all())


# -- the laws ---------------------------------------------------------------------------------------------------------
def _solve_laws(laws: Sequence[Expr], symbols: Sequence[Expr], still: Sequence[Expr], gain: Matrix) -> list[Expr]:
    """N with f = g(N), N = N0 + K f; no numbers where that is not certain to have one solution."""
    graph, n = symbols[0].graph, len(laws)
    slopes = jacobian(list(laws), list(symbols))
    places = list(slopes)
    force = [graph.zero] * n
    for _ in range(STEPS):
        here = _at(still, gain, force)
        at = dict(zip(symbols, here, strict=True))
        values = substitute([*laws, *(slopes[p] for p in places)], at)
        D = dict(zip(places, values[n:], strict=True))
        matrix = [[_slope(D, gain, i, j) for j in range(n)] for i in range(n)]
        left = [g - f for g, f in zip(values[:n], force, strict=True)]
        force = [f + x for f, x in zip(force, eliminate(matrix, left), strict=True)]
    here = _at(still, gain, force)
    values = substitute([*laws, *(slopes[p] for p in places)], dict(zip(symbols, here, strict=True)))
    D = dict(zip(places, values[n:], strict=True))
    certain = _certain(D, gain, n, graph.one)
    apart = _sum([graph.apply("abs", g - f) for g, f in zip(values[:n], force, strict=True)])
    size = _sum([graph.apply("abs", g) for g in values[:n]])
    certain = certain * graph.apply("le", apart, size * FIXED)
    return _at(still, gain, [f / certain for f in force])


def _at(still: Sequence[Expr], gain: Matrix, force: Sequence[Expr]) -> list[Expr]:
    return [_sum([N, *(k * f for k, f in zip(row, force, strict=True))]) for N, row in zip(still, gain, strict=True)]


def _slope(D: Mapping[tuple[int, int], Expr], gain: Matrix, i: int, j: int) -> Expr:
    """An entry of I - D K."""
    graph = gain[0][0].graph
    return _sum([graph.one if i == j else graph.zero, *(-(d * gain[m][j]) for (k, m), d in D.items() if k == i)])


def _certain(D: Mapping[tuple[int, int], Expr], gain: Matrix, n: int, one: Expr) -> Expr:
    """1 where I - B is an M-matrix, all pivots of its elimination being positive, else 0."""
    graph = one.graph
    matrix: Matrix = []
    for i in range(n):
        used = [(m, d) for (k, m), d in D.items() if k == i]
        size = _length([d for _, d in used], graph.zero)
        row = [-(size * _length([gain[m][j] for m, _ in used], graph.zero)) for j in range(n)]
        row[i] = one + row[i]
        matrix.append(row)
    certain = one
    for k in range(n):
        certain = certain * graph.apply("lt", 0.0, matrix[k][k])
        for i in range(k + 1, n):
            ratio = matrix[i][k] / matrix[k][k]
            for j in range(k + 1, n):
                matrix[i][j] = matrix[i][j] - ratio * matrix[k][j]
    return certain


def _length(parts: Sequence[Expr], zero: Expr) -> Expr:
    some = [x for x in parts if not x.is_zero]
    if len(some) < 2:
        return zero.graph.apply("abs", some[0]) if some else zero
    return sqrt(_sum([x * x for x in some]))


def eliminate(matrix: Matrix, right: Sequence[Expr]) -> list[Expr]:
    """x with A x = right, without exchange of rows: A is positive definite, or I less a contraction."""
    A, x, n = [list(row) for row in matrix], list(right), len(right)
    for k in range(n):
        for i in range(k + 1, n):
            if A[i][k].is_zero:
                continue
            ratio = A[i][k] / A[k][k]
            for j in range(k + 1, n):
                A[i][j] = A[i][j] - ratio * A[k][j]
            x[i] = x[i] - ratio * x[k]
    for k in reversed(range(n)):
        x[k] = _sum([x[k], *(-(A[k][j] * x[j]) for j in range(k + 1, n))]) / A[k][k]
    return x


def _dot(a: Sequence[Expr], b: Sequence[Expr]) -> Expr:
    return _sum([x * y for x, y in zip(a, b, strict=True)])


def _sum(terms: Sequence[Expr]) -> Expr:
    total = terms[0]
    for term in terms[1:]:
        if not term.is_zero:
            total = total + term
    return total
