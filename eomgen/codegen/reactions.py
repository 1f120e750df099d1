"""Kinematics with laws that depend on reactions -> kinematics in which forces and reactions are solved together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import replace
from typing import Any

import numpy as np

from ..base import algebra
from ..base.algebra import correlated
from ..base.limits.constraints import STRUCTURE
from ..base.limits.numbers import SINGULAR
from ..base.operations import CONDITION, OPERATIONS
from ..elements.forces.force import CoordinateLoad, MarkerLoad, is_reaction, multiplier_of, reaction_of
from ..elements.forces.paths import JointCoordinate
from ..errors import ModelError, Problem
from ..expr.core import Expr, common_graph, operands, reachable, substitute, symbols_of
from ..expr.differentiate import jacobian
from ..expr.evaluate import Evaluator
from ..expr.identity import vanishes
from ..expr.tensors import Matrix, combined, dot, eliminate, total
from ..mechanics import Kinematics
from ..mechanics.constraint_functions import ConstraintFunctions
from ..mechanics.kinematics import ForceTerms
from ..mechanics.methods import METHODS
from ..mechanics.methods.tree_equations import TreeEquations
from ..mechanics.mobility import Mobility
from ..mechanics.motion import entries_of, force_and_moment, with_entries
from ..mechanics.sparse_rows import SparseRows
from ..mechanics.switched import SwitchedRow, switched_rows
from ..mechanics.wrenches import JointWrenches, Row6, joint_reactions, mass_parents
from ..model.mechanism import Mechanism
from ..native.limits import SYSTEMS_UNTOUCHED
from .laws import MANY, laws_in, pieces_of, solve_laws
from .linear_algebra import factorize_tree
from .switched_constraints import AfterEvents, LinearValues, solve_rows


def solve_multipliers(rows: Sequence[Sequence[Expr]], forces: Sequence[Expr]) -> list[Expr]:
    """l = -(C C^T)^-1 C (M a + h), the multipliers of independent rows C."""
    gram = [[dot(one, other) for other in rows] for one in rows]
    return factorize_tree(gram, range(-1, len(rows) - 1)).solve([-dot(row, forces) for row in rows])


def multiplier_values(multipliers: Sequence[str], kinematics: Kinematics, equations: TreeEquations) -> dict[Expr, Expr]:
    """What the named multipliers of a model stand for."""
    graph = kinematics.graph
    values = solve_multipliers(kinematics.constraints.jacobian, equations.inverse_dynamics)
    names = {f"constraint_{k + 1}": name for k, name in enumerate(multipliers)}
    return {
        graph.symbol(names[label]): value for label, value in zip(kinematics.constraints.labels, values, strict=True)
    }


Laws = Mapping[str, Sequence[Expr]]  #: the laws that depend on reactions, by force element
PARTS = ("marker_loads", "coordinate_loads", "marker_remainder", "coordinate_remainder")  #: of the loads of a force
PROBES = 3  #: states at which components are looked at
_REMEDY = (
    "let the forces act in the plane of the loop, or give a joint of the loop more freedom (cylindrical, spherical); "
    "reactions(t, x) gives the smallest of all solutions"
)


def refuse_undetermined(
    kinematics: Kinematics,
    every: Mapping[str, Row6],
    unloaded: Sequence[Expr],
    values: Mapping[Expr, Expr],
    laws: Laws,
) -> None:
    """Refuse what depends on multipliers that no equation determines, unless they are 0 in the smallest reactions.

    ``every`` are the wrenches of joints along the axes of S in terms of ``unloaded``, the multipliers of equations that
    vanish; ``values`` what the symbols of reactions and multipliers stand for, in terms of these too.
    Raises ModelError.
    """
    if not _depends(list(values.values()), {}, unloaded):
        return
    open_ = _open(kinematics, every, unloaded)
    if not open_:
        return
    graph, mechanism, motion = kinematics.graph, kinematics.mechanism, kinematics.motion
    problems = list[Problem]()
    for name, quantity in mechanism.reaction_quantities.items():
        symbols = motion.derived_symbols(mechanism, {name})
        if _depends(substitute([graph.symbol(name)], symbols), values, open_):
            part = f"reaction({quantity.element}).{quantity.part}" if quantity.part else name
            message = f"{part} is undetermined: rigid bodies do not determine how the joints of a loop share this load"
            problems.append(mechanism.problem(quantity.place, message, _REMEDY, "EG-UNDETERMINED"))
    for force in mechanism.forces:
        if force.by_reaction and _depends(laws.get(force.name, ()), values, open_):
            message = f"the load of joint {getattr(force, 'joint', '')!r} is undetermined: rigid bodies do not "
            message += "determine how the joints of a loop share it"
            problems.append(mechanism.problem(f"forces.{force.name}", message, _REMEDY, "EG-UNDETERMINED"))
    if problems:
        raise ModelError(problems)


def _depends(result: Sequence[Expr], values: Mapping[Expr, Expr], on: Sequence[Expr]) -> bool:
    """Whether what is requested depends on such multipliers."""
    slopes = list(jacobian(substitute(list(result), dict(values)), list(on)).values())
    return not all(vanishes(_with_every_choice(slopes), SYSTEMS_UNTOUCHED, pieces=True))


def _open(kinematics: Kinematics, every: Mapping[str, Row6], unloaded: Sequence[Expr]) -> list[Expr]:
    """The multipliers that are not 0 in the smallest reactions, nor independent of such ones."""
    parts = list[list[Expr]]()
    for spec in kinematics.mechanism.joints:
        if spec.name in every:
            parts += [list(part) for part in force_and_moment(kinematics.motion, spec, every[spec.name])]
    flat = [x for part in parts for x in part]
    slopes = jacobian(flat, list(unloaded))
    base = substitute(flat, dict.fromkeys(unloaded, kinematics.graph.zero))
    places = list(slopes)
    numbers = _probed([*base, *slopes.values()])
    related = np.zeros((len(unloaded), len(unloaded)), dtype=bool)
    moved = np.zeros(len(unloaded), dtype=bool)
    for values in numbers:
        S = np.zeros((len(flat), len(unloaded)))
        for (i, j), d in zip(places, values[len(flat) :], strict=True):
            S[i, j] = d
        for k in range(0, len(flat), 3):  # forces and moments apart: their scales differ
            some, wrench = S[k : k + 3], values[k : k + 3]
            related |= np.abs(some.T @ some) > SYSTEMS_UNTOUCHED
            moved |= np.abs(some.T @ wrench) > SYSTEMS_UNTOUCHED
    for _ in unloaded:  # what is related to something open is open too
        moved = moved | related @ moved
    return [multiplier for multiplier, is_open in zip(unloaded, moved, strict=True) if is_open]


def _probed(expressions: Sequence[Expr]) -> np.ndarray:
    expressions = _with_every_choice(expressions)
    names = sorted(symbols_of(expressions))
    values = np.random.default_rng(2).uniform(0.5, 1.5, (PROBES, len(names)))
    with np.errstate(all="ignore"):
        evaluate = Evaluator(expressions, names)
        return np.array([evaluate(row.tolist()) for row in values])


def _with_every_choice(expressions: Sequence[Expr]) -> list[Expr]:
    """Expressions in which a choice is a combination of its values, so that what acts far from a state is seen too."""
    graph = common_graph(expressions)
    if graph is None:
        return []
    new: dict[int, Expr] = {}
    for i in reachable(graph, (x.id for x in expressions)):
        operation = graph.nodes[i][0]
        parts = [new[k] for k in operands(graph.nodes[i])]
        row = OPERATIONS.get(operation)
        if not parts or row is None or not row.bends:
            new[i] = Expr(graph, graph.make(operation, *(x.id for x in parts)) if parts else i)
            continue
        key = graph.nodes[i][1] if row.chooses else i  # choices by one condition are made together
        if row.kind == CONDITION or operation == "sign":
            new[i] = graph.symbol(f"choice {i}")
            continue
        values = parts[1:] if row.chooses else parts
        new[i] = graph.zero
        for k, x in enumerate(values):
            new[i] = new[i] + graph.symbol(f"choice {key}.{k}") * x
    return [new[x.id] for x in expressions]


def too_many_pieces(mechanism: Mechanism, force: str) -> Problem:
    """A law whose choices make so many pieces that it is not judged whether it has one solution."""
    message = f"its law of a reaction has more than {MANY} pieces, made by abs, max, min, conditions and their products"
    remedy = "write it as a sum of terms with fewer pieces each, or as a smooth function"
    return mechanism.problem(f"forces.{force}", message, remedy, "EG-TOO-LARGE")


def refuse_joints(kinematics: Kinematics) -> None:
    """Refuse friction in joints whose reaction has no force across, or along, the z axis of S."""
    from ..elements.forces.friction import ReactionFriction

    graph, mechanism = kinematics.graph, kinematics.mechanism
    specs, problems = {spec.name: spec for spec in mechanism.joints}, []
    for force in mechanism.forces:
        if not isinstance(force, ReactionFriction) or not isinstance(force.path, JointCoordinate):
            continue
        spec = specs[force.joint]
        columns = spec.joint.subspace(graph, [kinematics.motion.coordinates[n][0] for n in spec.coordinates])
        of = [velocity.of for velocity in spec.joint.velocities]
        place = spec.coordinates.index(force.path.name)
        parts = columns[of.index(place)] if place in of else ()
        turns = spec.joint.coordinates[place].kind == "angle"
        straight = [[not part[2].is_zero and part[0].is_zero and part[1].is_zero for part in parts]]
        free = [any(not linear[k].is_zero for _, linear in columns) for k in range(3)]
        if straight != [[turns, not turns]] or free[0] or free[1]:
            message = f"joint {spec.name!r} is {spec.joint.type_name}, which has no force across one fixed axis"
            remedy = "coefficient is known of revolute, prismatic and cylindrical joints; give coulomb instead"
            problems.append(mechanism.problem(f"forces.{force.name}", message, remedy, "EG-UNSUPPORTED"))
        elif force.thrust_radius is not None and free[2]:
            message = f"thrust_radius is given, and joint {spec.name!r} slides along its axis, so it has no thrust"
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
    evaluator = Evaluator(flat, names)
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


def refuse_without_inertia(kinematics: Kinematics, moved: Sequence[str], laws: Laws) -> None:
    """Refuse a motion that loops leave, behind which there is no inertia, at all laws or what else needs reactions."""
    if not moved:
        return
    mechanism = kinematics.mechanism
    places = [q.place for q in mechanism.reaction_quantities.values() if not q.place.startswith("forces.")]
    places += [f"constraints.{s.constraint.name}" for s in mechanism.switched if s.constraint is not None]
    place, verb = (f"forces.{' and '.join(laws)}", "depend") if laws else (places[0], "depends")
    message = f"{verb} on reactions, and motion of {', '.join(moved)} has no inertia"
    remedy = "give every body mass, or inertia about its joint"
    raise ModelError([mechanism.problem(place, message, remedy, "EG-UNSUPPORTED")])


def refuse_redundant(
    kinematics: Kinematics,
    mobility: Mobility,
    multipliers: Sequence[Expr],
    values: Mapping[Expr, Expr],
    laws: Laws,
) -> None:
    """Refuse what depends on reactions that constraints which follow from others leave open.

    ``multipliers`` are the symbols of the rows' multipliers, ``values`` what the symbols of reactions and multipliers
    stand for, in terms of these.
    Raises ModelError.
    """
    mechanism, motion = kinematics.mechanism, kinematics.motion
    if not mobility.redundant or not (shared := _shared(kinematics, mobility, multipliers, values)):
        return
    quantities = mechanism.reaction_quantities
    paths = [f"forces.{name}" for name, laws in laws.items() if shared & symbols_of(laws)]
    for name, quantity in quantities.items():
        seen = substitute([kinematics.graph.symbol(name)], motion.derived_symbols(mechanism, {name}))
        paths += [quantity.place] if shared & symbols_of(seen) else []
    message = "depends on the reaction of a joint, and reactions are not unique: "
    message += f"{', '.join(mobility.redundant)} follow from the other constraints"
    remedy = "release only these rows by joints with more freedom, or take a law without reactions"
    raise ModelError([mechanism.problem(path, message, remedy, "EG-UNDETERMINED") for path in dict.fromkeys(paths)])


def _shared(
    kinematics: Kinematics, mobility: Mobility, multipliers: Sequence[Expr], values: Mapping[Expr, Expr]
) -> set[str]:
    """Names of values that multipliers change which leave the motion as it is: C_q^T l = 0."""
    mechanism = kinematics.mechanism
    numbers = mechanism.declared
    every = {symbol.node[1] for symbol in values}
    if mobility.assumed or any(value is None for value in numbers.values()):
        return every
    functions = ConstraintFunctions(kinematics, {name: float(value or 0.0) for name, value in numbers.items()})
    slopes = jacobian(list(values.values()), list(multipliers))
    names = sorted(symbols_of(list(slopes.values())))
    evaluate = Evaluator(list(slopes.values()), names)
    result, judged = set[str](), False
    for place in mobility.samples:
        J = functions.scaled_jacobian(np.array(place))
        known = dict(zip(kinematics.names, place, strict=True)) | functions.values
        S = np.zeros((len(values), len(multipliers)))
        with np.errstate(all="ignore"):
            for (i, j), slope in zip(slopes, evaluate([known.get(name, 0.0) for name in names]), strict=True):
                S[i, j] = slope / functions.scales.c[j]
        if not np.isfinite(J).all() or not np.isfinite(S).all() or SparseRows(J).rank < mobility.rank:
            continue  # at a change point more is open, but there alone
        judged = True
        open_ = S @ SparseRows(np.ascontiguousarray(J.T)).motions(mobility.rank).T
        moved = np.abs(open_).max(axis=1) > STRUCTURE * np.abs(S).max(axis=1)
        result |= {symbol.node[1] for symbol, is_moved in zip(values, moved, strict=True) if is_moved}
    return result if judged else every


def with_reactions(kinematics: Kinematics, mobility: Mobility) -> Kinematics:
    """Replace the reactions that laws speak of by what they are at a state.

    Raises ModelError (a reaction that rigid bodies do not determine, or of a joint that has none; a law of too many
    pieces).
    """
    refuse_joints(kinematics)
    graph, mechanism, motion = kinematics.graph, kinematics.mechanism, kinematics.motion
    laws, speaking = dict[Expr, None](), dict[str, list[Expr]]()
    for terms in kinematics.forces:
        laws_here = [law for load in _loads(terms) for law in laws_in(entries_of(load), is_reaction)]
        if any(pieces_of(law, is_reaction) is None for law in laws_here):
            raise ModelError([too_many_pieces(mechanism, terms.force.name)])
        laws |= dict.fromkeys(laws_here)
        speaking |= {terms.force.name: laws_here} if laws_here else {}
    requested = [graph.symbol(name) for name in mechanism.reaction_quantities]
    seen = substitute(requested, motion.derived_symbols(mechanism, {*mechanism.reaction_quantities}))
    names = sorted(name for name in symbols_of([*laws, *seen]) if is_reaction(name))
    forces = [graph.symbol(f"law[{k}]") for k in range(len(laws))]
    rows, switched = switched_rows(kinematics)
    linear = _replaced(kinematics, dict(zip(laws, forces, strict=True)))
    linear = replace(linear, forces=(*linear.forces, *switched))
    symbols = [graph.symbol(name) for name in names]
    values, known, after = list[Expr](), dict[Expr, Expr](), dict[str, tuple[tuple[str, Expr], ...]]()
    if not (names or laws or rows):  # what is requested is 0 in every state: the moment about a hinge
        pass
    elif laws or rows or kinematics.constraints.labels or _before_accelerations(mechanism):
        reactions, multipliers = _reactions(
            linear, mobility, [*names, *(r.multiplier.node[1] for r in rows)], rows, speaking
        )
        measured = [*reactions, *(dot([*r.jacobian, r.rest], [*kinematics.a, graph.one]) for r in rows)]
        unknown = [*forces, *(row.multiplier for row in rows)]
        a, columns = _motion(linear, mobility, unknown, speaking)
        result = _linear_parts([*kinematics.a, *multipliers], measured, unknown, a, columns)
        if rows:
            by_multipliers = [column[: len(kinematics.v)] for column in columns[len(laws) :]]
            after = AfterEvents(kinematics, rows, by_multipliers).velocities()
        still, gain = solve_rows(result, rows, len(laws))
        gain = _quantities_at_states(kinematics, gain) if laws else gain
        symbols += [row.multiplier for row in rows]
        values, known = solve_laws(list(laws), symbols, still, gain)
    else:  # outputs of a tree: they may speak of accelerations
        values = _reactions(linear, mobility, names, (), speaking)[0]
    motion = copy(motion)
    motion.known_reactions = dict(zip(names, values, strict=False))
    whole = replace(kinematics, forces=(*kinematics.forces, *switched))
    solved = _replaced(whole, known | dict(zip(symbols, values, strict=True)))
    solved = replace(solved, motion=motion, reaction_laws=tuple(speaking), velocities_after=after)
    known_rows = tuple((row.label, row.state, row.kind) for row in rows)
    return replace(solved, rows_to_hold=known_rows, held_errors=tuple(e for row in rows for e in row.errors))


def _quantities_at_states(kinematics: Kinematics, gain: Matrix) -> Matrix:
    """A gain of parameters alone as one of the state, so that it fails with a state, as others do, not before."""
    if not kinematics.names or not symbols_of([k for row in gain for k in row]) <= {*kinematics.parameter_names}:
        return gain
    q = kinematics.graph.symbol(kinematics.names[0])
    true = kinematics.graph.apply("le", 0.0, q * q)
    return [[k * true for k in row] for row in gain]


def _before_accelerations(mechanism: Mechanism) -> bool:
    """Whether expressions speak of reactions that are evaluated before accelerations are known."""
    result = [x for event in mechanism.events for x in (event.expression, *(value for _, value in event.reset))]
    for state in mechanism.states:
        result += [state.rate, *([] if state.sampled is None else [state.sampled])]
    return not mechanism.reaction_quantities.keys().isdisjoint(symbols_of(result))


def _loads(terms: ForceTerms) -> list[MarkerLoad | CoordinateLoad]:
    return [load for part in PARTS for load in getattr(terms, part)]


def _replaced(kinematics: Kinematics, mapping: Mapping[Expr, Expr]) -> Kinematics:
    flat = [e for terms in kinematics.forces for load in _loads(terms) for e in entries_of(load)]
    values = iter(substitute(flat, mapping) if mapping else flat)
    result = []
    for terms in kinematics.forces:
        new: dict[str, Any] = {
            part: tuple(with_entries(load, values) for load in getattr(terms, part)) for part in PARTS
        }
        result.append(replace(terms, **new))
    return replace(kinematics, forces=tuple(result))


# -- linear parts ---------------------------------------------------------------------------------------------------
def _linear_parts(
    solved: Sequence[Expr], measured: Sequence[Expr], forces: Sequence[Expr], a: Sequence[Expr], columns: Matrix
) -> LinearValues:
    """Expressions of accelerations and multipliers, ``solved``, in terms of the forces alone."""
    graph = solved[0].graph
    slopes = jacobian(list(measured), [*solved, *forces])
    base = substitute(list(measured), dict.fromkeys([*solved, *forces], graph.zero))
    still, gain, n = [], [], len(solved)
    for i, N in enumerate(base):
        row = [slopes.get((i, j), graph.zero) for j in range(n + len(forces))]
        still.append(combined(N, row[:n], a))
        gain.append([combined(f, row[:n], c) for f, c in zip(row[n:], columns, strict=True)])
    return LinearValues(still, gain)


def _motion(
    kinematics: Kinematics, mobility: Mobility, forces: Sequence[Expr], laws: Laws
) -> tuple[list[Expr], Matrix]:
    """[a; l] without the laws' forces, and what a unit of each of them changes: M a + h + C^T l = 0, C a = -gamma."""
    graph, constraints = kinematics.graph, kinematics.constraints
    tree = METHODS["embedding"](kinematics)
    slopes, n = jacobian(list(tree.bias), list(forces)), len(kinematics.v)
    bias = substitute(list(tree.bias), dict.fromkeys(forces, graph.zero))
    C = [constraints.jacobian[i] for i in mobility.independent_rows]
    gamma = [constraints.gamma[i] for i in mobility.independent_rows]
    mass_matrix, parent = tree.mass_matrix, mass_parents(kinematics)
    still = without_inertia(kinematics, mobility, mass_matrix)
    if still and C:
        # massless bodies that loops move: (M + s C^T C) a + C^T l = -h - s C^T gamma has the same solution
        s = total([mass_matrix[i][i] for i in range(n)]) / total([x * x for row in C for x in row])
        columns = [list(column) for column in zip(*C, strict=True)]
        pushed = [[s * dot(one, other) for other in columns] for one in columns]
        mass_matrix = tuple(
            tuple(x + y for x, y in zip(*rows, strict=True)) for rows in zip(mass_matrix, pushed, strict=True)
        )
        bias = [h + s * dot(column, gamma) for h, column in zip(bias, columns, strict=True)]
        parent = tuple(range(-1, n - 1))
        still = without_inertia(kinematics, mobility, mass_matrix)
    refuse_without_inertia(kinematics, still, laws)
    right = [[-h for h in bias]]
    right += [[-slopes.get((i, j), graph.zero) for i in range(n)] for j in range(len(forces))]
    factor = factorize_tree(mass_matrix, parent)
    free = [factor.solve(column) for column in right]
    moved = [factor.solve(row) for row in C]
    schur = [[dot(row, y) for y in moved] for row in C]
    result = []
    for k, a in enumerate(free):
        gap = [dot(row, a) + (g if k == 0 else 0.0) for row, g in zip(C, gamma, strict=True)]
        multipliers = eliminate(schur, gap)
        for y, multiplier in zip(moved, multipliers, strict=True):
            a = [x - multiplier * z for x, z in zip(a, y, strict=True)]
        result.append([*a, *multipliers])
    return result[0], result[1:]


def _reactions(
    kinematics: Kinematics,
    mobility: Mobility,
    names: Sequence[str],
    switched: Sequence[SwitchedRow],
    laws: Laws,
) -> tuple[list[Expr], list[Expr]]:
    """The components in terms of accelerations, multipliers and forces, and the multipliers of ``labels``.

    Raises ModelError.
    """
    graph = kinematics.graph
    wrenches = JointWrenches(kinematics)
    rows = {label: graph.symbol(f"multiplier[{label}]") for label in kinematics.constraints.labels}
    unloaded = {label: graph.symbol(f"multiplier[{label}]") for label in wrenches.on_bodies if label not in rows}
    every = joint_reactions(wrenches, rows | unloaded)
    known = rows | unloaded | {row.label: row.multiplier for row in switched}
    where = [reaction_of(name) for name in names]
    reactions = []
    for name, place in zip(names, where, strict=True):
        row = multiplier_of(name)
        if place is not None:
            reactions.append(every[place[0]][place[1]])
        else:
            reactions.append(graph.symbol(name) if row is None else known[_row(kinematics, row, list(known), laws)])
    stands = {graph.symbol(name): value for name, value in zip(names, reactions, strict=True)}
    refuse_redundant(kinematics, mobility, list(rows.values()), stands, laws)
    if unloaded:
        refuse_undetermined(kinematics, every, list(unloaded.values()), stands, laws)
    free = [*unloaded.values(), *(rows[label] for label in mobility.redundant)]
    reactions = substitute(reactions, dict.fromkeys(free, graph.zero)) if free else reactions
    return reactions, [rows[kinematics.constraints.labels[i]] for i in mobility.independent_rows]


def _row(kinematics: Kinematics, name: str, labels: Sequence[str], laws: Laws) -> str:
    """The label of an equation, which may be named by its element where that has no other. Raises ModelError."""
    of_joint = [label for label in labels if label.partition(".")[0] == name.partition(".")[0]]
    if name in of_joint:
        return name
    if name == name.partition(".")[0] and len(of_joint) == 1:
        return of_joint[0]
    message = f"there is no equation {name!r}" if of_joint else f"{name.partition('.')[0]!r} has no equation"
    quantities = kinematics.mechanism.reaction_quantities
    path = next(q.place for q in quantities.values() if not q.part and q.element == name)
    remedy = f"there are: {', '.join(of_joint or labels) or 'none'}; joints have equations where they close a loop"
    raise ModelError([kinematics.mechanism.problem(path, message, remedy, "EG-NAME-UNKNOWN")])
