"""Stage graph: a node -> its partial derivatives with respect to its operands, also where a root vanishes.

A root has no finite slope where it is 0, as |v| = sqrt(v . v) at rest.  A product w r with it has one: where w is 0 too
and one of the factors is Lipschitz there, the derivative of w r is w' r + 0, as (w / h) r -> w' r.  The operation
``absorb`` writes that 0 for w r'; it stands only where it hides no derivative that does not exist, as that of
sqrt(x) sqrt(2 x), of sign(x) sqrt(|x|), or of |v| alone.
"""

from __future__ import annotations

from collections.abc import Container, Sequence
from typing import Any

from ..base.operations import OPERATIONS
from .core import Graph
from .functions import raised
from .traverse import LEAVES

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
        self.own: dict[int, int] = {}  #: the bit of a root
        self._kept: tuple[int, int, dict[int, int]] = (0, 0, {})
        self._seen = 0

    def look(self, g: Graph) -> None:
        """Take in the nodes that came since."""
        found, poles = self.of, self._poles
        bits_of, pole_of, nodes = found.get, poles.get, g.nodes
        for i in range(self._seen, len(nodes)):
            node = nodes[i]
            operation = node[0]
            if operation in _SUMS:  # most nodes
                if found:
                    first, second = node[1], node[2]
                    pole = (pole_of(first, 0) | pole_of(second, 0)) if poles else 0
                    if bits := (bits_of(first, 0) | bits_of(second, 0)) & ~pole:
                        found[i] = bits
                    if pole:
                        poles[i] = pole
                continue
            if operation in LEAVES:
                continue
            operands = node[1:]
            bits, pole = _of_operation(g, operation, operands), 0
            if bits & ROOT:
                self.own[i] = ROOT << len(self.own)
                bits += self.own[i] - ROOT
            if found:
                for k in operands:
                    bits |= found.get(k, 0)
                    pole |= poles.get(k, 0)
                if operation == "div" and operands[1] in found:
                    pole |= self._factors(g, operands[1])
                if operation == "absorb":  # made to be finite there
                    bits, pole = bits | poles.get(operands[1], 0), poles.get(operands[0], 0)
                bits &= ~pole
            if bits:
                found[i] = bits
            if pole:
                poles[i] = pole
        self._seen = len(g.nodes)

    def _factors(self, g: Graph, i: int) -> int:
        """The roots with which a product vanishes."""
        if g.nodes[i][0] == "mul":
            return self._factors(g, g.nodes[i][1]) | self._factors(g, g.nodes[i][2])
        return self.own.get(i, 0)

    def varying(self, active: Container[int]) -> int:
        """The bits of the roots among nodes that vary; the others, such as the scale of lengths, have no slope."""
        return sum(bit for i, bit in self.own.items() if i in active)

    def of_varying(self, active: Container[int]) -> dict[int, int]:
        """The bits of all nodes without those of roots that do not vary."""
        live, seen, found = self.varying(active), self._seen, self.of
        if live and live != sum(self.own.values()):
            if self._kept[:2] != (live, seen):
                self._kept = live, seen, {i: bits & (live | ROUGH | JUMPS) for i, bits in found.items()}
            found = self._kept[2]
        return found if live else {}

    def vanishes(self, g: Graph, i: int, w: int) -> bool:
        """Whether node i is a root that may vanish, without that making w infinite."""
        if i in self.own:
            self.look(g)
        return bool(self.own.get(i, 0) & ~self._poles.get(w, 0))


def roots_in(g: Graph) -> Roots:
    """The roots of a graph, kept with it, as nodes never change."""
    roots: Roots = g.roots or Roots()
    g.roots = roots
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
    g: Graph, found: dict[int, int], live: int, product: int, w: int, slope: int, r: int, factor: int | None = None
) -> int:
    """w r' in the derivative of a product, of the nodes w and r with the slope r', with the bits of roots that vary.

    ``factor`` is the node whose bits w has, by default itself.
    """
    bits = found.get(r, 0) & (live | ROUGH | JUMPS)
    may_vanish = bits & found.get(product, 0) & live
    return g.make("absorb", w, slope) if may_vanish and _tames(found, factor or w, bits) else g.mul(w, slope)


def _tames(found: dict[int, int], w: int, bits: int) -> bool:
    """Whether the derivative of a product exists where its factor w vanishes, the other has these bits."""
    own = found.get(w, 0)
    return not own & JUMPS and not (own & ROUGH and bits & (ROUGH | JUMPS))


def hides(g: Graph, found: dict[int, int], i: int) -> bool:
    """Whether the adjoint of a root may vanish through this node although there is no derivative."""
    operation, *operands = g.nodes[i]
    bits = [found.get(k, 0) for k in operands]
    if max(bits) < ROOT or operation in ("add", "sub", "neg"):
        return False
    if operation in ("mul", "div"):
        return not all(_tames(found, k, b) for k, b in zip(operands[::-1], bits, strict=True) if b >= ROOT)
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
        return _call_partials(g, node, active)
    if node[0] == "pow" and active == [True, False] and _is_square(g, node[1])[0]:
        # b a^(b - 1/2) / sqrt(a), for b > 1/2 finite where a, and with it a', is 0
        rest = g.make("pow", node[1], g.sub(node[2], g.constant(0.5).id))
        return [g.mul(node[2], g.make("absorb", rest, g.div(g.one.id, g.make("sqrt", node[1])))), g.zero.id]
    slopes = zip(OPERATIONS[node[0]].slopes, active, strict=True)
    return [slope(g, i, *node[1:]) if wanted else g.zero.id for slope, wanted in slopes]


def _call_partials(g: Graph, node: tuple[Any, ...], active: Sequence[bool]) -> list[int]:
    """Partial derivatives of a call with respect to its arguments (zero where not active)."""
    function, orders = g.calls[node[0]]
    return [g.call(function, raised(orders, i), node[1:]) if wanted else g.zero.id for i, wanted in enumerate(active)]
