"""Stage graph: expressions -> their derivatives (forward, reverse, sparse Jacobians), as expressions of the same graph.

Forward and reverse accumulation as in Griewank and Walther, *Evaluating Derivatives*, 2nd ed. (2008), chapters 3 and 7.
Derivatives are those of the formula: ``abs`` has slope ``sign`` (0 at 0), ``sign`` and comparisons have slope 0,
``min``, ``max`` and ``select`` have the slope of the branch taken (of the first operand where both are equal).  Where a
root vanishes, products with it have the derivatives that exist (:mod:`.slopes`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from ..base.operations import OPERATIONS, operations_with
from .core import Expr, Graph
from .pair_calls import is_pair_item, pair_call, push_pairs
from .slopes import half_power_slope, hides, multiply, partials, roots_in
from .traverse import LEAVES, common_graph, marked_again, reachable


def _push(g: Graph, order: Iterable[int], tangents: dict[int, int], slopes: dict[int, int]) -> None:
    """Forward sweep: fill in the tangents (never zero ones) of the nodes in ``order`` from those of their operands.

    ``slopes`` keeps the slopes of functions of one operand from one sweep to the next.
    """
    nodes, roots = g.nodes, roots_in(g)
    rooted, own, live = roots.of, roots.own, roots.varying(tangents)
    add, sub, mul = g.add, g.sub, g.mul
    zero, one = g.zero.id, g.one.id
    tangent = tangents.get
    for i in order:
        node = nodes[i]
        operation = node[0]
        if operation == "mul":
            a, b = node[1], node[2]
            da, db = tangent(a), tangent(b)
            if (nodes[a][0] == "sqrt" or nodes[b][0] == "sqrt") and (found := half_power_slope(g, a, b)):
                dc = tangent(found[0])
                if dc is None:
                    continue
                d = multiply(g, rooted, live, i, found[1], dc, found[0], found[0])
            elif da is None:
                if db is None:
                    continue
                d = multiply(g, rooted, live, i, a, db, b) if b in rooted else mul(a, db)
            elif db is None:
                d = multiply(g, rooted, live, i, b, da, a) if a in rooted else mul(da, b)
            elif a in rooted or b in rooted:
                d = add(multiply(g, rooted, live, i, b, da, a), multiply(g, rooted, live, i, a, db, b))
            else:
                d = add(mul(da, b), mul(a, db))
        elif operation == "add":
            da, db = tangent(node[1]), tangent(node[2])
            if da is None:
                if db is None:
                    continue
                d = db
            elif db is None:
                d = da
            else:
                d = add(da, db)
        elif operation == "sub":
            da, db = tangent(node[1]), tangent(node[2])
            if db is None:
                if da is None:
                    continue
                d = da
            else:
                d = g.neg(db) if da is None else sub(da, db)
        elif operation in LEAVES:
            continue
        elif operation == "neg":
            da = tangent(node[1])
            if da is None:
                continue
            d = g.neg(da)
        elif operation == "div":
            a, b = node[1], node[2]
            da, db = tangent(a), tangent(b)
            if db is None:
                if da is None:
                    continue
                d = g.div(da, b) if nodes[b][0] == "const" else mul(g.div(one, b), da)
            elif da is None:
                d = g.neg(multiply(g, rooted, live, i, mul(i, g.div(one, b)), db, b, a))
            else:
                d = mul(g.div(one, b), sub(da, multiply(g, rooted, live, i, i, db, b, a)))
        elif operation == "absorb":
            a, b = node[1], node[2]
            d = add(g.make("absorb", tangents.get(a, zero), b), g.make("absorb", a, tangents.get(b, zero)))
        elif (row := OPERATIONS.get(operation)) is not None and row.choice is not None:
            if all(k not in tangents for k in node[-2:]):
                continue
            c, a, b = row.choice(g, *node[1:])
            d = g.make("select", c, tangents.get(a, zero), tangents.get(b, zero))
        elif row is not None and not row.slopes:
            continue
        elif row is None and pair_call(g, operation) is not None:
            found_slope = push_pairs(g, i, tangents)
            if found_slope is None:
                continue
            d = found_slope
        elif row is not None and len(node) == 2:
            da = tangent(node[1])
            if da is None:
                continue
            if i not in slopes:
                slopes[i] = row.slopes[0](g, i, node[1])
            d = multiply(g, rooted, live, i, slopes[i], da, node[1], node[1])
        else:
            parts = [tangent(k) for k in node[1:]]
            if all(p is None for p in parts):
                continue
            d = zero
            flags = [p is not None for p in parts]
            for slope, p, k in zip(partials(g, i, flags), parts, node[1:], strict=True):
                if p is not None:
                    d = add(d, multiply(g, rooted, live, i, slope, p, k, k))
        if d != zero:
            tangents[i] = d
            if i in own:
                live |= own[i]


def _pull(g: Graph, order: Sequence[int], active: set[int], adjoints: dict[int, int], branches: list[int]) -> None:
    """Reverse sweep over ``order`` (ascending); active branching nodes are not entered but listed in ``branches``."""
    nodes, roots = g.nodes, roots_in(g)
    rooted = roots.of_varying(active)
    exposed = set[int]()  #: nodes whose adjoints may vanish where there is no derivative
    add, sub, mul = g.add, g.sub, g.mul
    zero = g.zero.id
    for i in reversed(order):
        w = adjoints.get(i)
        if w is None or w == zero:
            continue
        node = nodes[i]
        operation = node[0]
        if operation in LEAVES:
            continue
        if rooted and (i in exposed or hides(g, rooted, i)):
            exposed.update(k for k in node[1:] if k in rooted)
        if operation == "add":
            for k in node[1:]:
                if k in active:
                    adjoints[k] = add(adjoints[k], w) if k in adjoints else w
        elif operation == "mul":
            a, b = node[1], node[2]
            if (nodes[a][0] == "sqrt" or nodes[b][0] == "sqrt") and (found := half_power_slope(g, a, b)):
                c = found[0]
                if c in active:
                    d = mul(w, found[1])
                    adjoints[c] = add(adjoints[c], d) if c in adjoints else d
                continue
            if a in active:
                d = mul(w, b)
                adjoints[a] = add(adjoints[a], d) if a in adjoints else d
            if b in active:
                d = mul(w, a)
                adjoints[b] = add(adjoints[b], d) if b in adjoints else d
        elif operation == "sub":
            a, b = node[1], node[2]
            if a in active:
                adjoints[a] = add(adjoints[a], w) if a in adjoints else w
            if b in active:
                adjoints[b] = sub(adjoints[b], w) if b in adjoints else g.neg(w)
        elif operation == "neg":
            a = node[1]
            adjoints[a] = sub(adjoints[a], w) if a in adjoints else g.neg(w)
        elif operation == "absorb" and node[1] not in active:
            adjoints[node[2]] = add(adjoints[node[2]], mul(w, node[1])) if node[2] in adjoints else mul(w, node[1])
        elif (
            operation == "absorb"
            or is_pair_item(g, operation)
            or ((row := OPERATIONS.get(operation)) is not None and row.choice is not None)
        ):
            branches.append(i)
        elif operation == "div" and node[2] not in active and nodes[node[2]][0] == "const":
            a, d = node[1], g.div(w, node[2])
            adjoints[a] = add(adjoints[a], d) if a in adjoints else d
        else:
            flags = [k in active for k in node[1:]]
            # where its adjoint is 0 it has no part in the derivative
            tame = i not in exposed and roots.vanishes(g, i, w)
            for k, slope, flag in zip(node[1:], partials(g, i, flags), flags, strict=True):
                if flag:
                    d = g.make("absorb", w, slope) if tame else mul(w, slope)
                    adjoints[k] = add(adjoints[k], d) if k in adjoints else d


def _active(g: Graph, order: Iterable[int], sources: Mapping[int, int]) -> dict[int, int]:
    """Nodes of ``order`` that depend differentiably on the sources, each with the union of their bit masks."""
    nodes = g.nodes
    masks = dict(sources)
    flat = operations_with(lambda row: not (row.slopes or row.choice)) | LEAVES
    for i in order:
        node = nodes[i]
        operation = node[0]
        if operation in flat:
            continue
        mask = 0
        for k in node[2:] if operation == "select" else node[1:]:
            mask |= masks.get(k, 0)
        if mask:
            masks[i] = mask
    return masks


def _column_bits(wrt: Sequence[Expr]) -> dict[int, int]:
    bits: dict[int, int] = {}
    for column, x in enumerate(wrt):
        if x.node[0] != "sym":
            raise ValueError(f"derivatives are taken with respect to symbols, not {x!r}")
        bits[x.id] = bits.get(x.id, 0) | 1 << column
    return bits


def jvp(outputs: Sequence[Expr], seeds: Mapping[Expr, Expr]) -> list[Expr]:
    """Directional derivative: for each output y, the sum over seeds of dy/dx * seed.

    Parameters
    ----------
    outputs : sequence of Expr
        Expressions y of one graph.
    seeds : mapping of Expr to Expr
        Symbol x -> its rate of change; symbols not named are constant.

    Returns
    -------
    list of Expr
        One derivative per output.

    Raises
    ------
    ValueError
        A seed is not a symbol, or expressions of different graphs.
    """
    g = common_graph(outputs, list(seeds), list(seeds.values()))
    if g is None:
        return []
    _column_bits(list(seeds))
    order = reachable(g, (y.id for y in outputs))
    tangents = {x.id: dx.id for x, dx in seeds.items() if not dx.is_zero}
    slopes: dict[int, int] = {}
    for part in marked_again(g, order):
        _push(g, part, tangents, slopes)
    return [Expr(g, tangents.get(y.id, g.zero.id)) for y in outputs]


def vjp(outputs: Sequence[Expr], weights: Sequence[Expr], wrt: Sequence[Expr]) -> list[Expr]:
    """Weighted sum of gradients, ``sum_k weights[k] * d outputs[k] / d x`` for each symbol x of ``wrt``.

    One reverse sweep, whatever the number of symbols.  Branching operations are differentiated forward and multiplied
    in, so that an infinite slope in a branch not taken never meets a zero weight.

    Parameters
    ----------
    outputs, weights : sequence of Expr
        As many weights as outputs.
    wrt : sequence of Expr
        Symbols.

    Returns
    -------
    list of Expr
        One derivative per symbol.
    """
    g = common_graph(outputs, weights, wrt)
    if len(weights) != len(outputs):
        raise ValueError(f"{len(outputs)} outputs need as many weights, not {len(weights)}")
    if g is None:
        return []
    nodes, order = g.nodes, reachable(g, (y.id for y in outputs))
    there = set(order)
    # of many symbols an output has few: only those, and what is no symbol, which is refused, are looked at
    active = _active(g, order, _column_bits([x for x in wrt if x.id in there or nodes[x.id][0] != "sym"]))
    adjoints: dict[int, int] = {}
    for y, w in zip(outputs, weights, strict=True):
        if y.id in active:
            adjoints[y.id] = g.add(adjoints[y.id], w.id) if y.id in adjoints else w.id
    branches: list[int] = []
    _pull(g, [i for i in order if i in active], set(active), adjoints, branches)
    result = [adjoints.get(x.id, g.zero.id) for x in wrt]
    for (row, column), slope in (_forward_jacobian(g, branches, wrt) if branches else {}).items():
        result[column] = g.add(result[column], g.mul(adjoints[branches[row]], slope))
    return [Expr(g, d) for d in result]


def gradient(output: Expr, wrt: Sequence[Expr]) -> list[Expr]:
    """Gradient of one expression with respect to symbols, by one reverse sweep."""
    return vjp([output], [output.graph.one], wrt)


def jacobian(outputs: Sequence[Expr], wrt: Sequence[Expr]) -> dict[tuple[int, int], Expr]:
    """Sparse Jacobian ``d outputs[row] / d wrt[column]``.

    Each column (forward) or row (reverse) visits only the nodes it depends on; the direction with fewer operations is
    taken, forward always where expressions branch.

    Parameters
    ----------
    outputs : sequence of Expr
        One per row.
    wrt : sequence of Expr
        Symbols, one per column.

    Returns
    -------
    dict of (row, column) to Expr
        Entries that are not identically zero, by rows and columns ascending.
    """
    g = common_graph(outputs, wrt)
    if g is None:
        return {}
    roots = [y.id for y in outputs]
    sweep = _reverse_jacobian if _reverse_is_cheaper(g, roots, wrt) else _forward_jacobian
    entries = sweep(g, roots, wrt)
    return {key: Expr(g, entries[key]) for key in sorted(entries)}


def _reverse_is_cheaper(g: Graph, roots: Sequence[int], wrt: Sequence[Expr]) -> bool:
    """Estimate the products and sums that each direction makes, by edges times the columns or rows that cross them."""
    if len(wrt) <= 1:
        return False
    nodes = g.nodes
    order = reachable(g, roots)
    columns = _active(g, order, _column_bits(wrt))
    rows: dict[int, int] = {}
    for row, i in enumerate(roots):
        if i in columns:
            rows[i] = rows.get(i, 0) | 1 << row
    branching = operations_with(lambda row: row.choice is not None) | {"absorb"}
    forward = reverse = 0
    for i in reversed(order):
        if i not in rows:  # constant, or only behind something flat
            continue
        mask, node = rows[i], nodes[i]
        if node[0] in LEAVES:
            continue
        if node[0] in branching or is_pair_item(g, node[0]):
            return False
        cost = 1 if node[0] in ("add", "sub", "neg") else 2
        for k in node[1:]:
            if k in columns:
                rows[k] = rows.get(k, 0) | mask
                forward += cost * columns[k].bit_count()
                reverse += cost * mask.bit_count()
    return reverse < forward


def _forward_jacobian(g: Graph, roots: Sequence[int], wrt: Sequence[Expr]) -> dict[tuple[int, int], int]:
    order = reachable(g, roots)
    masks = _active(g, order, _column_bits(wrt))
    dependents: list[list[int]] = [[] for _ in wrt]
    for i in order:
        mask = masks.get(i, 0)
        while mask:
            low = mask & -mask
            dependents[low.bit_length() - 1].append(i)
            mask ^= low
    entries: dict[tuple[int, int], int] = {}
    slopes: dict[int, int] = {}
    for column, x in enumerate(wrt):
        tangents = {x.id: g.one.id}
        _push(g, dependents[column], tangents, slopes)
        for row, i in enumerate(roots):
            if i in tangents:
                entries[row, column] = tangents[i]
    return entries


def _reverse_jacobian(g: Graph, roots: Sequence[int], wrt: Sequence[Expr]) -> dict[tuple[int, int], int]:
    active = set(_active(g, reachable(g, roots), _column_bits(wrt)))
    entries: dict[tuple[int, int], int] = {}
    for row, root in enumerate(roots):
        if root not in active:
            continue
        adjoints = {root: g.one.id}
        order = [i for i in reachable(g, [root]) if i in active]
        branches: list[int] = []
        for part in marked_again(g, order, backwards=True):
            _pull(g, part, active, adjoints, branches)
        slopes = _forward_jacobian(g, branches, wrt) if branches else {}
        for column, x in enumerate(wrt):
            d = adjoints.get(x.id, g.zero.id)
            for k, branch in enumerate(branches):
                d = g.add(d, g.mul(adjoints[branch], slopes.get((k, column), g.zero.id)))
            if d != g.zero.id:
                entries[row, column] = d
    return entries
