"""Stage graph, nodes: an operation on node ids -> the id of its node, simplified and made once.

The rules are those of arithmetic on constants, signs, zeros and ones; they are exact up to rounding order.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any, TypeVar

from ..base.limits.numbers import NORMAL, TINY
from ..base.operations import ODD, OPERATIONS

if TYPE_CHECKING:
    from ..base.operations import Operation
    from .functions import Function

Part = TypeVar("Part")
Node = tuple[Any, ...]  # (operation, *operand ids), ("const", value) or ("sym", name)


class Nodes:
    """A table of interned nodes by id; see :class:`~.core.Graph`, which adds handles and functions."""

    __slots__ = ("_ids", "calls", "marks", "n_passes", "nodes", "reached")

    def __init__(self) -> None:
        self.nodes: list[Node] = []
        self.marks: list[tuple[int, int]] = []
        self.n_passes = 0
        self.reached: dict[frozenset[int], list[int]] = {}
        self._ids: dict[Node, int] = {}
        self.calls: dict[str, tuple[Function, tuple[int, ...]]] = {}

    def _const(self, value: float) -> int:
        if not math.isfinite(value):
            raise OverflowError(f"constant {value!r} is not a finite number")
        return self._node(("const", value + 0.0))

    def _node(self, key: Node) -> int:
        found = self._ids.get(key)
        if found is None:
            found = self._ids[key] = len(self.nodes)
            self.nodes.append(key)
        return found

    def begin_pass(self) -> int:
        """The number of another pass over the bodies of a model."""
        self.n_passes += 1
        return self.n_passes

    def mark(self, number: int = 0) -> None:
        """Note that what is made from here on belongs to another body, in the pass of this number; 0 is none."""
        at = len(self.nodes)
        if self.marks and self.marks[-1][0] == at:
            self.marks.pop()
        self.marks.append((at, number))

    def marked(self, parts: Iterable[Part]) -> Iterator[Part]:
        """What a pass goes through, with a mark before what is made of each and behind the last."""
        number = self.begin_pass()
        for part in parts:
            self.mark(number)
            yield part
        self.mark()

    def make(self, operation: str, *ids: int) -> int:
        """The id of ``operation`` on operand ids, simplified.  The rules are exact up to rounding order."""
        row = OPERATIONS.get(operation)
        if row is None:
            if operation not in self.calls:
                raise ValueError(f"unknown operation {operation!r}")
            return self._node((operation, *ids))
        known = row.rule(self, *ids) if row.rule is not None else None
        if known is None and all(self.nodes[i][0] == "const" for i in ids):
            known = self._fold(row, ids)
        if known is not None:
            return known
        if row.parity:
            head = self.nodes[ids[0]]
            if head[0] == "neg":
                made = self._node((operation, head[1]))
                return self.neg(made) if row.parity == ODD else made
        elif row.commutative and ids[0] > ids[1]:
            ids = (ids[1], ids[0])
        return self._node((operation, *ids))

    def _fold(self, row: Operation, ids: Iterable[int]) -> int | None:
        try:
            value = row.value(*(self.nodes[i][1] for i in ids))
        except (ValueError, ArithmeticError):
            return None  # outside the domain: keep the node, the error belongs to evaluation
        return self._const(value) if math.isfinite(value) else None

    def _folded(self, operation: str, value: float, a: int, b: int) -> int:
        """The constant ``value``; if it overflowed, the node that overflows when it is evaluated."""
        if math.isfinite(value):
            return self._const(value)
        return self._node((operation, b, a) if OPERATIONS[operation].commutative and a > b else (operation, a, b))

    def neg(self, a: int) -> int:
        """-a"""
        node = self.nodes[a]
        kind = node[0]
        if kind == "const":
            return self._const(-node[1])
        if kind == "neg":
            return int(node[1])
        if kind == "sub":
            return self.sub(node[2], node[1])
        if kind == "mul" and self.nodes[node[1]][0] == "const":
            return self._node(("mul", *sorted((self._const(-self.nodes[node[1]][1]), node[2]))))
        if kind == "mul" and self.nodes[node[2]][0] == "const":
            return self._node(("mul", *sorted((self._const(-self.nodes[node[2]][1]), node[1]))))
        return self._node(("neg", a))

    def add(self, a: int, b: int) -> int:
        """a + b"""
        nodes = self.nodes
        x, y = nodes[a], nodes[b]
        if x[0] == "const":
            if x[1] == 0.0:
                return b
            if y[0] == "const":
                return self._folded("add", x[1] + y[1], a, b)
        elif y[0] == "const" and y[1] == 0.0:
            return a
        if y[0] == "neg":
            return self.sub(a, y[1])
        if x[0] == "neg":
            return self.sub(b, x[1])
        if a == b:
            return self.mul(self._const(2.0), a)
        if x[0] == "sub" and x[2] == b:  # (u - b) + b
            return int(x[1])
        if y[0] == "sub" and y[2] == a:
            return int(y[1])
        return self._node(("add", a, b) if a < b else ("add", b, a))

    def sub(self, a: int, b: int) -> int:
        """a - b"""
        if a == b:
            return self._const(0.0)
        nodes = self.nodes
        x, y = nodes[a], nodes[b]
        if y[0] == "const":
            if y[1] == 0.0:
                return a
            if x[0] == "const":
                return self._folded("sub", x[1] - y[1], a, b)
        elif x[0] == "const" and x[1] == 0.0:
            return self.neg(b)
        if y[0] == "neg":
            return self.add(a, y[1])
        if x[0] == "neg":
            return self.neg(self.add(x[1], b))
        if x[0] == "add":  # (b + u) - b
            if x[1] == b:
                return int(x[2])
            if x[2] == b:
                return int(x[1])
        elif x[0] == "sub" and x[1] == b:  # (b - u) - b
            return self.neg(x[2])
        if y[0] == "sub" and y[1] == a:  # a - (a - u)
            return int(y[2])
        if y[0] == "add" and a in (y[1], y[2]):  # a - (a + u)
            return self.neg(y[2] if y[1] == a else y[1])
        if ("sub", b, a) in self._ids:  # share one difference with both signs
            return self._node(("neg", self._ids[("sub", b, a)]))
        return self._node(("sub", a, b))

    def mul(self, a: int, b: int) -> int:
        """a * b"""
        nodes = self.nodes
        x, y = nodes[a], nodes[b]
        if y[0] == "const":
            a, b, x, y = b, a, y, x
        if x[0] == "const":
            value = x[1]
            if value == 0.0:
                return a
            if value == 1.0:
                return b
            if y[0] == "const":
                return self._folded("mul", value * y[1], a, b)
            if value == -1.0:
                return self.neg(b)
            if y[0] == "neg":
                return self.mul(self._const(-value), y[1])
            if y[0] == "mul":  # merge constant factors, unless that would overflow or lose digits
                u, rest = (y[1], y[2]) if nodes[y[1]][0] == "const" else (y[2], y[1])
                if nodes[u][0] == "const" and NORMAL < abs(value * nodes[u][1]) < math.inf:
                    return self.mul(self._const(value * nodes[u][1]), rest)
            return self._node(("mul", a, b) if a < b else ("mul", b, a))
        if x[0] == "neg":
            return self.mul(x[1], y[1]) if y[0] == "neg" else self.neg(self.mul(x[1], b))
        if y[0] == "neg":
            return self.neg(self.mul(a, y[1]))
        if a == b and x[0] == "sqrt":
            return int(x[1])
        return self._node(("mul", a, b) if a < b else ("mul", b, a))

    def div(self, a: int, b: int) -> int:
        """a / b; division by a constant becomes a product only when that is exact."""
        nodes = self.nodes
        x, y = nodes[a], nodes[b]
        if y[0] == "const" and y[1] != 0.0:
            if y[1] == 1.0:
                return a
            if x[0] == "const" and math.isfinite(x[1] / y[1]):
                return self._const(x[1] / y[1])
            if math.frexp(y[1])[0] in (0.5, -0.5) and abs(y[1]) > TINY:
                return self.mul(self._const(1.0 / y[1]), a)
        if x[0] == "const" and x[1] == 0.0 and not (y[0] == "const" and y[1] == 0.0):
            return a
        if a == b and y[0] != "const":
            return self._const(1.0)
        if x[0] == "neg":
            return self.neg(self.div(x[1], b))
        if y[0] == "neg":
            return self.neg(self.div(a, y[1]))
        return self._node(("div", a, b))

    def power(self, a: int, b: int) -> int:
        """a ** b: integer exponents up to 64 as products, halves through sqrt, the rest as pow."""
        exponent = self.nodes[b]
        if exponent[0] == "const" and self.nodes[a][0] == "const":
            folded = self._fold(OPERATIONS["pow"], (a, b))
            if folded is not None:
                return folded
        if exponent[0] != "const":
            return self._node(("pow", a, b))
        n = exponent[1]
        if n == 0.0:
            return self._const(1.0)
        if n < 0.0:
            return self.div(self._const(1.0), self.power(a, self._const(-n)))
        if n == 0.5:
            return self.make("sqrt", a)
        if n == int(n) and n <= 64:
            return self._product_power(a, int(n))
        if 2 * n == int(2 * n) and n <= 64:
            return self.mul(self._product_power(a, int(n)), self.make("sqrt", a))
        return self._node(("pow", a, b))

    def _product_power(self, a: int, n: int) -> int:
        result, square = None, a
        while n:
            if n & 1:
                result = square if result is None else self.mul(result, square)
            n >>= 1
            if n:
                square = self.mul(square, square)
        return self._const(1.0) if result is None else result
