"""Expressions -> their derivatives (forward, reverse, sparse Jacobians), as expressions of the same graph."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence

from ..base.operations import OPERATIONS, operations_with
from .core import LEAVES, Expr, Graph, common_graph, marked_again, reachable
from .functions import raised

# -- partial derivatives of nodes --------------------------------------------------------------------------------------

# A root has no finite slope where it is 0, as |v| = sqrt(v . v) at rest. A product w r with it has one: where w is 0
# too and one of the factors is Lipschitz there, the derivative of w r is w' r + 0, as (w / h) r -> w' r. The operation
# ``absorb`` writes that 0 for w r'; it stands only where it hides no derivative that does not exist, as that of sqrt(x)
# sqrt(2 x), of sign(x) sqrt(|x|), or of |v| alone.


#: Of a node, as bits: it need not be Lipschitz; it may jump.  From ROOT on, a bit for each root that may vanish in it.
ROUGH, JUMPS, ROOT = 1, 2, 4
_SUMS = ("mul", "add", "sub")
_INFINITE = ("asin", "acos", "acosh")  #: with slopes that are infinite at the ends of their domain


class Roots:
    """What nodes are made of that has no finite slope: bits of the nodes that have any, one pass over all nodes.

    Where a node is infinite as a root vanishes (it was divided by), that root is none of its own.
    """

    def __init__(self) -> None:
        self.of: dict[int, int] = {}
        self._poles: dict[int, int] = {}
        self.bit_of: dict[int, int] = {}  #: the bit of a root
        self._kept: tuple[int, int, dict[int, int]] = (0, 0, {})
        self._seen = 0

    def look(self, g: Graph) -> None:
        """Take in the nodes that came since."""
        result, poles = self.of, self._poles
        bits_of, pole_of, nodes = result.get, poles.get, g.nodes
        for i in range(self._seen, len(nodes)):
            node = nodes[i]
            operation = node[0]
            if operation in _SUMS:  # most nodes
                if result:
                    first, second = node[1], node[2]
                    pole = (pole_of(first, 0) | pole_of(second, 0)) if poles else 0
                    if bits := (bits_of(first, 0) | bits_of(second, 0)) & ~pole:
                        result[i] = bits
                    if pole:
                        poles[i] = pole
                continue
            if operation in LEAVES:
                continue
            operands = node[1:]
            bits, pole = _of_operation(g, operation, operands), 0
            if bits & ROOT:
                self.bit_of[i] = ROOT << len(self.bit_of)
                bits += self.bit_of[i] - ROOT
            if result:
                for k in operands:
                    bits |= result.get(k, 0)
                    pole |= poles.get(k, 0)
                if operation == "div" and operands[1] in result:
                    pole |= self._factors(g, operands[1])
                if operation == "absorb":  # made to be finite there
                    bits, pole = bits | poles.get(operands[1], 0), poles.get(operands[0], 0)
                bits &= ~pole
            if bits:
                result[i] = bits
            if pole:
                poles[i] = pole
        self._seen = len(g.nodes)

    def _factors(self, g: Graph, i: int) -> int:
        """The roots with which a product vanishes."""
        if g.nodes[i][0] == "mul":
            return self._factors(g, g.nodes[i][1]) | self._factors(g, g.nodes[i][2])
        return self.bit_of.get(i, 0)

    def varying(self, active: Container[int]) -> int:
        """The bits of the roots among nodes that vary; the others, such as the scale of lengths, have no slope."""
        return sum(bit for i, bit in self.bit_of.items() if i in active)

    def of_varying(self, active: Container[int]) -> dict[int, int]:
        """The bits of all nodes without those of roots that do not vary."""
        live, seen, result = self.varying(active), self._seen, self.of
        if live and live != sum(self.bit_of.values()):
            if self._kept[:2] != (live, seen):
                self._kept = live, seen, {i: bits & (live | ROUGH | JUMPS) for i, bits in result.items()}
            result = self._kept[2]
        return result if live else {}

    def vanishes(self, g: Graph, i: int, w: int) -> bool:
        """Whether node i is a root that may vanish, without that making w infinite."""
        if i in self.bit_of:
            self.look(g)
        return bool(self.bit_of.get(i, 0) & ~self._poles.get(w, 0))


def roots_in(g: Graph) -> Roots:
    """The roots of a graph, kept with it, as nodes never change."""
    g.roots = roots = g.roots or Roots()
    roots.look(g)
    return roots


def _of_operation(g: Graph, operation: str, operands: Sequence[int]) -> int:
    """The bits that an operation adds to those of its operands; ROOT for a root."""
    if operation == "sqrt":
        squares, positive = _is_square(g, operands[0])
        return 0 if positive else ROOT if squares else ROOT | ROUGH
    if operation == "hypot":
        return ROOT if all(g.nodes[k][0] != "const" for k in operands) else 0
    if operation == "pow":
        kind, exponent = g.nodes[operands[1]][:2]
        squares, positive = _is_square(g, operands[0])
        smooth = positive or (kind == "const" and exponent > (0.5 if squares else 1.0))
        return 0 if smooth else ROOT | ROUGH
    if operation in _INFINITE:
        return ROOT | ROUGH
    row = OPERATIONS.get(operation)
    return JUMPS if row is not None and (row.jumps or row.chooses) else 0


def _is_square(g: Graph, i: int) -> tuple[bool, bool]:
    """Whether a node is visibly a sum of squares and numbers, so that its root is Lipschitz; and above 0 for good."""
    open_ends, squares, positive = [i], True, False
    while open_ends and squares:
        operation, *operands = g.nodes[open_ends.pop()]
        if operation == "add":
            open_ends += operands
        elif operation == "const":
            squares, positive = operands[0] >= 0.0, positive or operands[0] > 0.0
        elif operation in ("mul", "div") and operands[0] != operands[1]:
            squares = all(_is_square(g, k)[0] for k in operands)
        else:
            squares = operation == "mul"
    return squares, squares and positive


def square_under_root(g: Graph, i: int) -> bool:
    """Whether a node is a root or positive power of visible squares that may vanish."""
    operation, *operands = g.nodes[i]
    if operation == "pow":
        exponent, (squares, positive) = g.nodes[operands[1]], _is_square(g, operands[0])
        return bool(exponent[0] == "const" and exponent[1] > 0.0 and squares and not positive)
    return operation in ("sqrt", "hypot") and _of_operation(g, operation, operands) == ROOT


def multiply(
    g: Graph, result: dict[int, int], live: int, product: int, w: int, slope: int, r: int, factor: int | None = None
) -> int:
    """w r' in the derivative of a product, of the nodes w and r with the slope r', with the bits of roots that vary.

    ``factor`` is the node whose bits w has, by default itself.
    """
    bits = result.get(r, 0) & (live | ROUGH | JUMPS)
    may_vanish = bits & result.get(product, 0) & live
    return g.make("absorb", w, slope) if may_vanish and _tames(result, factor or w, bits) else g.mul(w, slope)


def _tames(result: dict[int, int], w: int, bits: int) -> bool:
    """Whether the derivative of a product exists where its factor w vanishes, the other has these bits."""
    marks = result.get(w, 0)
    return not marks & JUMPS and not (marks & ROUGH and bits & (ROUGH | JUMPS))


def hides(g: Graph, result: dict[int, int], i: int) -> bool:
    """Whether the adjoint of a root may vanish through this node although there is no derivative."""
    operation, *operands = g.nodes[i]
    bits = [result.get(k, 0) for k in operands]
    if max(bits) < ROOT or operation in ("add", "sub", "neg"):
        return False
    if operation in ("mul", "div"):
        return not all(_tames(result, k, b) for k, b in zip(operands[::-1], bits, strict=True) if b >= ROOT)
    return any(b & (ROUGH | JUMPS) for b in bits if b >= ROOT)


def half_power_slope(g: Graph, a: int, b: int) -> tuple[int, int] | None:
    """Where a b is c^n sqrt(c), n = 1, 2, ...: c and the slope by it, (n + 1/2) c^(n-1) sqrt(c); else None.

    By the product rule the slope at c = 0 would be 0 times infinity.
    """
    for root, rest in ((a, b), (b, a)):
        if g.nodes[root][0] == "sqrt":
            c = g.nodes[root][1]
            n = _exponent(g, rest, c)
            if n:
                power = g.make("pow", c, g.constant(n - 1.0).id)
                return c, g.mul(g.constant(n + 0.5).id, g.mul(power, root))
    return None


def _exponent(g: Graph, i: int, base: int) -> int:
    """n where node i is the product base^n, else 0."""
    if i == base:
        return 1
    node = g.nodes[i]
    if node[0] != "mul":
        return 0
    first = _exponent(g, node[1], base)
    second = first and (first if node[1] == node[2] else _exponent(g, node[2], base))
    return first + second if second else 0


def partials(g: Graph, i: int, active: Sequence[bool]) -> list[int]:
    """Partial derivatives of a smooth node with respect to its operands (zero where not active)."""
    node = g.nodes[i]
    if node[0] in g.calls:
        function, orders = g.calls[node[0]]
        return [g.call(function, raised(orders, k), node[1:]) if on else g.zero.id for k, on in enumerate(active)]
    if node[0] == "pow" and active == [True, False] and _is_square(g, node[1])[0]:
        # b a^(b - 1/2) / sqrt(a), for b > 1/2 finite where a, and with it a', is 0
        rest = g.make("pow", node[1], g.sub(node[2], g.constant(0.5).id))
        return [g.mul(node[2], g.make("absorb", rest, g.div(g.one.id, g.make("sqrt", node[1])))), g.zero.id]
    slopes = zip(OPERATIONS[node[0]].slopes, active, strict=True)
    return [slope(g, i, *node[1:]) if wanted else g.zero.id for slope, wanted in slopes]


# -- derivatives of expressions ----------------------------------------------------------------------------------------

# Forward and reverse accumulation as in Griewank and Walther, *Evaluating Derivatives*, 2nd ed. (2008), chapters 3 and
# 7. Derivatives are those of the formula: ``abs`` has slope ``sign`` (0 at 0), ``sign`` and comparisons have slope 0,
# ``min``, ``max`` and ``select`` have the slope of the branch taken (of the first operand where both are equal). Where
# a root vanishes, products with it have the derivatives that exist (:mod:`.differentiate`).


def _push(g: Graph, order: Iterable[int], tangents: dict[int, int], slopes: dict[int, int]) -> None:
    """Forward sweep: fill in the tangents (never zero ones) of the nodes in ``order`` from those of their operands.

    ``slopes`` keeps the slopes of functions of one operand from one sweep to the next.
    """
    nodes, roots = g.nodes, roots_in(g)
    rooted, bit_of, live = roots.of, roots.bit_of, roots.varying(tangents)
    add, sub, mul = g.add, g.sub, g.mul
    zero, one = g.zero.id, g.one.id
    tangent = tangents.get
    for i in order:
        node = nodes[i]
        operation = node[0]
        if operation == "mul":
            a, b = node[1], node[2]
            da, db = tangent(a), tangent(b)
            if (nodes[a][0] == "sqrt" or nodes[b][0] == "sqrt") and (result := half_power_slope(g, a, b)):
                dc = tangent(result[0])
                if dc is None:
                    continue
                d = multiply(g, rooted, live, i, result[1], dc, result[0], result[0])
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
        elif row is None and (call := g.calls[operation][0]).lists:
            d = call.push(g, i, tangents)
            if d is None:
                continue
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
            if i in bit_of:
                live |= bit_of[i]


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
            if (nodes[a][0] == "sqrt" or nodes[b][0] == "sqrt") and (result := half_power_slope(g, a, b)):
                c = result[0]
                if c in active:
                    d = mul(w, result[1])
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
            or _is_item(g, operation)
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


def _is_item(g: Graph, operation: str) -> bool:
    """Whether a node is an entry of a list."""
    return operation in g.calls and bool(g.calls[operation][0].item)


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
    """Directional derivative: for each output y, the sum over symbols x of dy/dx times the seed, the rate of x."""
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
    """
    g = common_graph(outputs, weights, wrt)
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
    """Entries (row, column) of ``d outputs[row] / d wrt[column]`` that are not identically zero, ascending.

    Each column (forward) or row (reverse) visits only the nodes it depends on; the direction with fewer operations is
    taken, forward always where expressions branch.
    """
    g = common_graph(outputs, wrt)
    if g is None:
        return {}
    roots = [y.id for y in outputs]
    sweep = _reverse_jacobian if _reverse_is_cheaper(g, roots, wrt) else _forward_jacobian
    entries = sweep(g, roots, wrt)
    return {key: Expr(g, entries[key]) for key in sorted(entries)}


def hessian(slopes: Sequence[Expr], wrt: Sequence[Expr]) -> tuple[tuple[Expr, ...], ...]:
    """``d slopes / d wrt`` of the slopes of one function by the same symbols, from its lower triangle."""
    entries, n = jacobian(slopes, wrt), range(len(wrt))
    return tuple(tuple(entries.get((max(i, j), min(i, j)), wrt[0].graph.zero) for j in n) for i in n)


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
        if node[0] in branching or _is_item(g, node[0]):
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
        for part in marked_again(g, order, backwards=True):
            _pull(g, part, active, adjoints, [])  # nothing branches
        entries |= {(row, k): d for k, x in enumerate(wrt) if (d := adjoints.get(x.id, g.zero.id)) != g.zero.id}
    return entries
