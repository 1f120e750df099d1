"""Stage program, laws of reactions: Kinematics whose forces speak of joints' reactions -> the same, solved for these.

Accelerations, multipliers and reactions are linear in the forces f of such laws: N = N0 + K f.  A law gives f = g(N).
The solution is written out on the graph (:mod:`.solve_laws`).  What stands for N afterwards is a function of the state,
as any other law is, so that every method of derivation, every target and every derivative sees ordinary forces.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from dataclasses import replace

from ..describe.mechanism import Mechanism
from ..equations import METHODS
from ..errors import ModelError
from ..forces import CoordinateLoad, MarkerLoad
from ..forces.joint_reactions import is_carried, multiplier_of, reaction_of
from ..graph.core import Expr
from ..graph.differentiate import jacobian
from ..graph.substitute import substitute, symbols_of
from ..kinematics import Kinematics
from ..kinematics.carried_reactions import carried_reactions
from ..kinematics.eliminate import Matrix, dot, eliminate, total
from ..kinematics.kinematics import ForceTerms
from ..kinematics.mobility import Mobility
from ..kinematics.resolved_loads import AnyLoad, entries_of, with_entries
from ..kinematics.switched import SwitchedRow, switched_rows
from ..kinematics.wrenches import JointWrenches
from .factor import factorize, solve
from .held_constraints import LinearValues, hold
from .law_pieces import pieces_of
from .reaction_users import (
    Users,
    refuse_joints,
    refuse_redundant,
    refuse_without_inertia,
    too_many_pieces,
    without_inertia,
)
from .reset_velocities import AfterEvents
from .solve_laws import laws_in, solve_laws
from .undetermined_reactions import refuse_undetermined


def with_reactions(kinematics: Kinematics, mobility: Mobility) -> Kinematics:
    """Replace the reactions that laws speak of by what they are at a state.

    Raises
    ------
    ModelError
        A reaction that rigid bodies do not determine, or of a joint that has none; a law of too many pieces.
    """
    refuse_joints(kinematics)
    graph, mechanism, motion = kinematics.graph, kinematics.mechanism, kinematics.motion
    laws, speaking = dict[Expr, None](), dict[str, list[Expr]]()
    for terms in kinematics.forces:
        own = [law for load in _loads(terms) for law in laws_in(entries_of(load), is_carried)]
        if any(pieces_of(law, is_carried) is None for law in own):
            raise ModelError([too_many_pieces(mechanism, terms.force.name)])
        laws |= dict.fromkeys(own)
        speaking |= {terms.force.name: own} if own else {}
    asked = [graph.symbol(name) for name in mechanism.reaction_quantities]
    seen = substitute(asked, motion.derived_symbols(mechanism, {*mechanism.reaction_quantities}))
    names = sorted(name for name in symbols_of([*laws, *seen]) if is_carried(name))
    forces = [graph.symbol(f"law[{k}]") for k in range(len(laws))]
    users = Users(mechanism, speaking)
    rows, held = switched_rows(kinematics)
    linear = _replaced(kinematics, dict(zip(laws, forces, strict=True)))
    linear = replace(linear, forces=(*linear.forces, *held))
    symbols = [graph.symbol(name) for name in names]
    values, known, after = list[Expr](), dict[Expr, Expr](), dict[str, tuple[tuple[str, Expr], ...]]()
    if not (names or laws or rows):  # what is asked for is 0 in every state: the moment about a hinge
        pass
    elif laws or rows or kinematics.constraints.labels or _before_accelerations(mechanism):
        reactions, multipliers = _reactions(
            linear, mobility, [*names, *(r.multiplier.node[1] for r in rows)], rows, users
        )
        measured = [*reactions, *(dot([*r.jacobian, r.rest], [*kinematics.a, graph.one]) for r in rows)]
        unknown = [*forces, *(row.multiplier for row in rows)]
        a, columns = _motion(linear, mobility, unknown, users)
        found = _linear_parts([*kinematics.a, *multipliers], measured, unknown, a, columns)
        if rows:
            by_multipliers = [column[: len(kinematics.v)] for column in columns[len(laws) :]]
            after = AfterEvents(kinematics, rows, by_multipliers).velocities()
        still, gain = hold(found, rows, len(laws))
        gain = _asked_at_states(kinematics, gain) if laws else gain
        symbols += [row.multiplier for row in rows]
        values, known = solve_laws(list(laws), symbols, still, gain)
    else:  # outputs of a tree: they may speak of accelerations
        values = _reactions(linear, mobility, names, (), users)[0]
    motion = copy(motion)
    motion.carried = dict(zip(names, values, strict=False))
    whole = replace(kinematics, forces=(*kinematics.forces, *held))
    solved = _replaced(whole, known | dict(zip(symbols, values, strict=True)))
    solved = replace(solved, motion=motion, reaction_laws=tuple(speaking), velocities_after=after)
    known_rows = tuple((row.label, row.state, row.kind) for row in rows)
    return replace(solved, held_rows=known_rows, held_errors=tuple(e for row in rows for e in row.errors))


def _asked_at_states(kinematics: Kinematics, gain: Matrix) -> Matrix:
    """A gain of parameters alone as one of the state, so that it fails with a state, as others do, not before."""
    if not kinematics.names or not symbols_of([k for row in gain for k in row]) <= {*kinematics.parameter_names}:
        return gain
    q = kinematics.graph.symbol(kinematics.names[0])
    true = kinematics.graph.apply("le", 0.0, q * q)
    return [[k * true for k in row] for row in gain]


def _before_accelerations(mechanism: Mechanism) -> bool:
    """Whether expressions speak of reactions that are evaluated before accelerations are known."""
    found = [x for event in mechanism.events for x in (event.expression, *(value for _, value in event.reset))]
    for state in mechanism.states:
        found += [state.rate, *([] if state.sampled is None else [state.sampled])]
    return not mechanism.reaction_quantities.keys().isdisjoint(symbols_of(found))


def _loads(terms: ForceTerms) -> list[MarkerLoad | CoordinateLoad]:
    return [*terms.marker_loads, *terms.coordinate_loads, *terms.marker_remainder, *terms.coordinate_remainder]


def _with(loads: tuple[AnyLoad, ...], values: Iterator[Expr]) -> tuple[AnyLoad, ...]:
    return tuple(with_entries(load, values) for load in loads)


def _replaced(kinematics: Kinematics, mapping: Mapping[Expr, Expr]) -> Kinematics:
    """Other parts of the entries of the loads."""
    flat = [e for terms in kinematics.forces for load in _loads(terms) for e in entries_of(load)]
    values = iter(substitute(flat, mapping) if mapping else flat)
    found = []
    for terms in kinematics.forces:
        markers, along = _with(terms.marker_loads, values), _with(terms.coordinate_loads, values)
        rest, rest_along = _with(terms.marker_remainder, values), _with(terms.coordinate_remainder, values)
        found.append(ForceTerms(terms.force, markers, along, terms.potential, rest, rest_along))
    return replace(kinematics, forces=tuple(found))


# -- linear parts ---------------------------------------------------------------------------------------------------
def _linear_parts(
    solved: Sequence[Expr], measured: Sequence[Expr], forces: Sequence[Expr], a: Sequence[Expr], columns: Matrix
) -> LinearValues:
    """Expressions of accelerations and multipliers, ``solved``, in terms of the forces alone."""
    graph = solved[0].graph
    slopes = jacobian(list(measured), [*solved, *forces])
    base = substitute(list(measured), dict.fromkeys([*solved, *forces], graph.zero))
    still, gain = [], []
    for i, N in enumerate(base):
        row = [slopes.get((i, j), graph.zero) for j in range(len(solved) + len(forces))]
        still.append(total([N, *(d * x for d, x in zip(row, a, strict=False))]))
        own = row[len(solved) :]
        gain.append(
            [total([f, *(d * x for d, x in zip(row, c, strict=False))]) for f, c in zip(own, columns, strict=True)]
        )
    return LinearValues(still, gain)


def _motion(
    kinematics: Kinematics, mobility: Mobility, forces: Sequence[Expr], users: Users
) -> tuple[list[Expr], Matrix]:
    """[a; l] without the laws' forces, and what a unit of each of them changes: M a + h + C^T l = 0, C a = -gamma."""
    graph, constraints = kinematics.graph, kinematics.constraints
    tree = METHODS["embedding"](kinematics)
    slopes, n = jacobian(list(tree.bias), list(forces)), len(kinematics.v)
    bias = substitute(list(tree.bias), dict.fromkeys(forces, graph.zero))
    C = [constraints.jacobian[i] for i in mobility.independent_rows]
    gamma = [constraints.gamma[i] for i in mobility.independent_rows]
    mass_matrix, parent = tree.mass_matrix, kinematics.parent
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
    refuse_without_inertia(still, users)
    right = [[-h for h in bias]]
    right += [[-slopes.get((i, j), graph.zero) for i in range(n)] for j in range(len(forces))]
    factor = factorize(mass_matrix, parent)
    free = [solve(factor, column) for column in right]
    moved = [solve(factor, row) for row in C]
    schur = [[dot(row, y) for y in moved] for row in C]
    found = []
    for k, a in enumerate(free):
        gap = [dot(row, a) + (g if k == 0 else 0.0) for row, g in zip(C, gamma, strict=True)]
        held = eliminate(schur, gap)
        for y, multiplier in zip(moved, held, strict=True):
            a = [x - multiplier * z for x, z in zip(a, y, strict=True)]
        found.append([*a, *held])
    return found[0], found[1:]


def _reactions(
    kinematics: Kinematics,
    mobility: Mobility,
    names: Sequence[str],
    held: Sequence[SwitchedRow],
    users: Users,
) -> tuple[list[Expr], list[Expr]]:
    """The components in terms of accelerations, multipliers and forces, and the multipliers of ``labels``.

    Raises
    ------
    ModelError
    """
    graph = kinematics.graph
    wrenches = JointWrenches(kinematics)
    labels = [kinematics.constraints.labels[i] for i in mobility.independent_rows]
    refuse_redundant(mobility, users)
    own = {label: graph.symbol(f"multiplier[{label}]") for label in labels}
    idle = {label: graph.symbol(f"multiplier[{label}]") for label in wrenches.on_bodies if label not in own}
    every = carried_reactions(wrenches, own | idle)
    known = own | idle | {row.label: row.multiplier for row in held}
    where = [reaction_of(name) for name in names]
    reactions = []
    for name, place in zip(names, where, strict=True):
        row = multiplier_of(name)
        if place is not None:
            reactions.append(every[place[0]][place[1]])
        else:
            reactions.append(graph.symbol(name) if row is None else known[_row(kinematics, row, list(known), users)])
    if idle:
        stands = {graph.symbol(name): value for name, value in zip(names, reactions, strict=True)}
        refuse_undetermined(kinematics, every, list(idle.values()), stands, users)
        reactions = substitute(reactions, dict.fromkeys(idle.values(), graph.zero))
    return reactions, [own[label] for label in labels]


def _row(kinematics: Kinematics, name: str, labels: Sequence[str], users: Users) -> str:
    """The label of an equation, which may be named by its element where that has no other.

    Raises
    ------
    ModelError
    """
    own = [label for label in labels if label.partition(".")[0] == name.partition(".")[0]]
    if name in own:
        return name
    if name == name.partition(".")[0] and len(own) == 1:
        return own[0]
    message = f"there is no equation {name!r}" if own else f"{name.partition('.')[0]!r} has no equation"
    quantities = kinematics.mechanism.reaction_quantities
    path = next(q.path for q in quantities.values() if not q.part and q.of == name)
    remedy = f"there are: {', '.join(own or labels) or 'none'}; joints have equations where they close a loop"
    raise ModelError([users.mechanism.problem(path, message, remedy, "EG-NAME-UNKNOWN")])
