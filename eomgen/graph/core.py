"""Stage graph: scalar operations -> one hash-consed expression graph.

A :class:`Graph` is a growing table of nodes ``(operation, operand ids...)``.  A node that already exists is never made
again, and constants, signs, zeros and ones are folded as nodes are made, so common subexpressions merge at birth and
derivation code cannot swell.  :class:`Expr` is a handle on one node with Python's operators.

Operations: ``const sym | add sub mul div neg | pow sqrt exp log | sin cos tan asin acos atan sinh cosh tanh | atan2 |
abs sign min max | lt le eq not and or | select``, and calls of declared functions (:mod:`.functions`).  ``select(c, x,
y)`` is x where c is true (non-zero) and y elsewhere.  Comparisons give 1.0 or 0.0.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, Union

from .operations import COMMUTATIVE, EVEN, FOLD, ODD

if TYPE_CHECKING:
    from .functions import Function

Node = tuple[Any, ...]  # (operation, *operand ids), ("const", value) or ("sym", name)
Scalar = Union["Expr", float, int]


class Graph:
    """A table of interned nodes.

    Attributes
    ----------
    nodes : list of tuple
        ``nodes[i]`` is the node with id ``i``; operands always have smaller ids than the node that uses them, so id
        order is a topological order.
    functions, calls : dict
        Functions that expressions may call, by name; what each operation that is a call means: (Function, orders).
    """

    __slots__ = ("_ids", "calls", "functions", "nodes", "one", "zero")

    def __init__(self) -> None:
        self.nodes: list[Node] = []
        self._ids: dict[Node, int] = {}
        self.functions: dict[str, Function] = {}
        self.calls: dict[str, tuple[Function, tuple[int, ...]]] = {}
        self.zero = self.constant(0.0)
        self.one = self.constant(1.0)

    # -- leaves ---------------------------------------------------------------------------------------------------
    def constant(self, value: float) -> Expr:
        """The node of a finite number (numbers are doubles; -0.0 is stored as 0.0)."""
        return Expr(self, self._const(float(value)))

    def symbol(self, name: str) -> Expr:
        """The node of a named quantity; the same name is always the same node."""
        return Expr(self, self._node(("sym", name)))

    def lift(self, value: Scalar) -> Expr:
        """An :class:`Expr` of this graph from an Expr or a number."""
        if isinstance(value, Expr):
            if value.graph is not self:
                raise ValueError("an expression of another graph cannot be used here")
            return value
        return Expr(self, self._const(float(value)))

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

    # -- making nodes ---------------------------------------------------------------------------------------------
    def apply(self, operation: str, *operands: Scalar) -> Expr:
        """The node of ``operation`` on Exprs or numbers, simplified."""
        ids = [self.lift(x).id for x in operands]
        return Expr(self, self.make(operation, *ids))

    def make(self, operation: str, *ids: int) -> int:
        """The id of ``operation`` on operand ids, simplified.  The rules are exact up to rounding order."""
        if operation == "add":
            return self.add(*ids)
        if operation == "sub":
            return self.sub(*ids)
        if operation == "mul":
            return self.mul(*ids)
        if operation == "div":
            return self.div(*ids)
        if operation == "neg":
            return self.neg(*ids)
        if operation in self.calls:
            return self._node((operation, *ids))
        if operation not in FOLD:
            raise ValueError(f"unknown operation {operation!r}")
        nodes = self.nodes
        if all(nodes[i][0] == "const" for i in ids):
            folded = self._fold(operation, ids)
            if folded is not None:
                return folded
        if operation == "pow":
            return self._power(*ids)
        head = nodes[ids[0]]
        if operation == "select":
            if head[0] == "const":
                return ids[1] if head[1] else ids[2]
            if ids[1] == ids[2]:
                return ids[1]
        elif operation in ("min", "max", "and", "or") and ids[0] == ids[1]:
            return ids[0] if operation in ("min", "max") else self._node((operation, *ids))
        elif head[0] == "neg" and operation in ODD:
            return self.neg(self._node((operation, head[1])))
        elif head[0] == "neg" and operation in EVEN:
            return self._node((operation, head[1]))
        elif operation == "sqrt" and head[0] == "mul" and head[1] == head[2]:
            return self._node(("abs", head[1]))
        if operation in COMMUTATIVE and ids[0] > ids[1]:
            ids = (ids[1], ids[0])
        return self._node((operation, *ids))

    def declare(self, function: Function) -> None:
        """Let expressions call a function."""
        self.functions[function.name] = function

    def call(self, function: Function, orders: tuple[int, ...], ids: Iterable[int]) -> int:
        """The id of a call of a function, or of its derivative of these orders, on operand ids."""
        if function.highest is not None and max(orders) > function.highest:
            return self.zero.id
        operation = function.operation(orders)
        self.calls[operation] = (function, orders)
        return self._node((operation, *ids))

    def _fold(self, operation: str, ids: Iterable[int]) -> int | None:
        try:
            value = FOLD[operation](*(self.nodes[i][1] for i in ids))
        except (ValueError, ZeroDivisionError, OverflowError):
            return None  # outside the domain: keep the node, the error belongs to evaluation
        if isinstance(value, complex) or not math.isfinite(value):
            return None
        return self._const(value)

    def _folded(self, operation: str, value: float, a: int, b: int) -> int:
        """The constant ``value``; if it overflowed, the node that overflows when it is evaluated."""
        if math.isfinite(value):
            return self._const(value)
        return self._node((operation, b, a) if operation in COMMUTATIVE and a > b else (operation, a, b))

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
            return self.zero.id
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
                if nodes[u][0] == "const" and 1e-290 < abs(value * nodes[u][1]) < math.inf:
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
            if math.frexp(y[1])[0] in (0.5, -0.5) and abs(y[1]) > 1e-300:
                return self.mul(self._const(1.0 / y[1]), a)
        if x[0] == "const" and x[1] == 0.0 and not (y[0] == "const" and y[1] == 0.0):
            return a
        if a == b and y[0] != "const":
            return self.one.id
        if x[0] == "neg":
            return self.neg(self.div(x[1], b))
        if y[0] == "neg":
            return self.neg(self.div(a, y[1]))
        return self._node(("div", a, b))

    def _power(self, a: int, b: int) -> int:
        """a ** b: integer exponents up to 64 as products, halves through sqrt, the rest as pow."""
        exponent = self.nodes[b]
        if exponent[0] != "const":
            return self._node(("pow", a, b))
        n = exponent[1]
        if n == 0.0:
            return self.one.id
        if n < 0.0:
            return self.div(self.one.id, self._power(a, self._const(-n)))
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
        return self.one.id if result is None else result


class Expr:
    """A handle on one node of a graph; arithmetic on handles makes nodes.

    ``==`` is identity of the node (as hashing needs); use :meth:`Graph.apply` with ``"eq"`` for the relation.
    """

    __slots__ = ("graph", "id")

    def __init__(self, graph: Graph, node_id: int) -> None:
        self.graph = graph
        self.id = node_id

    @property
    def node(self) -> Node:
        """The node itself, ``(operation, *operand ids)``."""
        return self.graph.nodes[self.id]

    @property
    def value(self) -> float | None:
        """The number if this is a constant, else None."""
        node = self.graph.nodes[self.id]
        return node[1] if node[0] == "const" else None

    @property
    def is_zero(self) -> bool:
        """True if this is the constant 0, i.e. vanishes identically."""
        return self.id == self.graph.zero.id

    def _other(self, other: Scalar) -> int:
        return other.id if type(other) is Expr and other.graph is self.graph else self.graph.lift(other).id

    def __add__(self, other: Scalar) -> Expr:
        return Expr(self.graph, self.graph.add(self.id, self._other(other)))

    __radd__ = __add__

    def __sub__(self, other: Scalar) -> Expr:
        return Expr(self.graph, self.graph.sub(self.id, self._other(other)))

    def __rsub__(self, other: Scalar) -> Expr:
        return Expr(self.graph, self.graph.sub(self._other(other), self.id))

    def __mul__(self, other: Scalar) -> Expr:
        return Expr(self.graph, self.graph.mul(self.id, self._other(other)))

    __rmul__ = __mul__

    def __truediv__(self, other: Scalar) -> Expr:
        return Expr(self.graph, self.graph.div(self.id, self._other(other)))

    def __rtruediv__(self, other: Scalar) -> Expr:
        return Expr(self.graph, self.graph.div(self._other(other), self.id))

    def __pow__(self, other: Scalar) -> Expr:
        return Expr(self.graph, self.graph.make("pow", self.id, self._other(other)))

    def __rpow__(self, other: Scalar) -> Expr:
        return Expr(self.graph, self.graph.make("pow", self._other(other), self.id))

    def __neg__(self) -> Expr:
        return Expr(self.graph, self.graph.neg(self.id))

    def __eq__(self, other: object) -> bool:
        return type(other) is Expr and other.graph is self.graph and other.id == self.id

    def __hash__(self) -> int:
        return hash(self.id)

    def __bool__(self) -> bool:
        raise TypeError("an expression has no truth value; use .is_zero or .value")

    def __repr__(self) -> str:
        node = self.node
        if node[0] in ("const", "sym"):
            return f"Expr({node[1]})"
        return f"Expr(#{self.id} {node[0]}{node[1:]})"


def sin(x: Expr) -> Expr:
    """sin x (radians)."""
    return Expr(x.graph, x.graph.make("sin", x.id))


def cos(x: Expr) -> Expr:
    """cos x (radians)."""
    return Expr(x.graph, x.graph.make("cos", x.id))


def sqrt(x: Expr) -> Expr:
    """Square root of x."""
    return Expr(x.graph, x.graph.make("sqrt", x.id))


def atan2(y: Expr, x: Expr) -> Expr:
    """Angle of the vector (x, y), in (-pi, pi]."""
    return Expr(x.graph, x.graph.make("atan2", y.id, x.id))
