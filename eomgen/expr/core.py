"""Scalar operations -> one hash-consed expression graph; its parts in order, with replacements, copied."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from copy import deepcopy
from operator import itemgetter
from typing import TYPE_CHECKING, Any, TypeVar, Union, cast

from ..base.limits.numbers import NORMAL, TINY
from ..base.operations import CONDITION, ODD, OPERATIONS

if TYPE_CHECKING:
    from ..base.operations import Operation
    from .functions import Function

# -- the graph ---------------------------------------------------------------------------------------------------------

# A :class:`Graph` is a growing table of nodes ``(operation, operand ids...)``. A node that already exists is never made
# again, and constants, signs, zeros and ones are folded as nodes are made, so common subexpressions merge at birth and
# derivation code cannot swell. :class:`Expr` is a handle on one node with Python's operators.
#
# Operations: ``const``, ``sym``, those of the table :mod:`eomgen.base.operations`, and calls of declared functions
# (:mod:`.functions`). ``select(c, x, y)`` is x where c is true (non-zero) and y elsewhere. Comparisons give 1.0 or 0.0.


Scalar = Union["Expr", float, int]
Part = TypeVar("Part")
Node = tuple[Any, ...]  # (operation, *operand ids), ("const", value) or ("sym", name)


class Graph:
    """A table of interned nodes, handed out as :class:`Expr`.

    Attributes
    ----------
    nodes : list of tuple
        By id; operands have smaller ids than the node that uses them, so id order is a topological order.
    marks : list of (int, int)
        Ids, ascending, with which the part of another body begins, and the pass over the bodies that it is of: code of
        big models is made of alike parts.
    reached : dict
        What many roots were found to be made of: nodes never change, so neither does that.
    roots : Roots, optional
        What :mod:`.differentiate` knows of its nodes.
    functions, calls : dict
        Functions that expressions may call, by name; what each operation that is a call means: (Function, orders),
        or of a sum over pairs of shapes (:class:`~eomgen.contact.pairs.PairCall`, ()).
    """

    __slots__ = ("_ids", "calls", "functions", "marks", "n_passes", "nodes", "one", "reached", "roots", "zero")

    def __init__(self) -> None:
        self.nodes: list[Node] = []
        self.marks: list[tuple[int, int]] = []
        self.n_passes = 0
        self.reached: dict[frozenset[int], list[int]] = {}
        self.roots: Any = None
        self._ids: dict[Node, int] = {}
        self.functions: dict[str, Function] = {}
        self.calls: dict[str, tuple[Any, tuple[int, ...]]] = {}
        self.zero = self.constant(0.0)
        self.one = self.constant(1.0)

    def __deepcopy__(self, memo: dict[int, object]) -> Graph:
        """A graph of the same nodes by the same ids, which grows by itself; functions never change and are shared."""
        copied = memo[id(self)] = Graph.__new__(Graph)
        copied.nodes, copied._ids = list(self.nodes), dict(self._ids)
        copied.marks, copied.n_passes, copied.reached = list(self.marks), self.n_passes, {}
        copied.roots = None
        copied.calls, copied.functions = dict(self.calls), dict(self.functions)
        copied.zero, copied.one = Expr(copied, self.zero.id), Expr(copied, self.one.id)
        return copied

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

    # -- making nodes ---------------------------------------------------------------------------------------------
    def apply(self, operation: str, *operands: Scalar) -> Expr:
        """The node of ``operation`` on Exprs or numbers, simplified."""
        ids = [self.lift(x).id for x in operands]
        return Expr(self, self.make(operation, *ids))

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

    # -- rules: arithmetic on constants, signs, zeros and ones, exact up to rounding order ---------------------------
    def _const(self, value: float) -> int:
        if not math.isfinite(value):
            raise OverflowError(f"constant {value!r} is not a finite number")
        return self._node(("const", value + 0.0))

    def _node(self, key: Node) -> int:
        result = self._ids.get(key)
        if result is None:
            result = self._ids[key] = len(self.nodes)
            self.nodes.append(key)
        return result

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


class Expr:
    """A handle on one node of a graph; arithmetic on handles makes nodes.

    ``==`` is identity of the node (as hashing needs); use :meth:`Graph.apply` with ``"eq"`` for the relation.
    """

    __slots__ = ("graph", "id")

    def __init__(self, graph: Graph, node_id: int) -> None:
        self.graph = graph
        self.id = node_id

    def __deepcopy__(self, memo: dict[int, object]) -> Expr:
        graph = memo.get(id(self.graph)) or self.graph.__deepcopy__(memo)
        return Expr(cast("Graph", graph), self.id)

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


# -- order of parts ----------------------------------------------------------------------------------------------------


LEAVES = frozenset({"const", "sym"})
MANY = 100  #: so many roots are those of a big model: what they are made of is looked up again and again
KEPT = 12  #: answers kept


def is_comparison(x: Expr) -> bool:
    """Whether an expression is true or false: a comparison, or what joins them."""
    row = OPERATIONS.get(x.node[0])
    return row is not None and row.kind == CONDITION


def operands(node: Node) -> tuple[int, ...]:
    """The operand ids of a node; none for constants and symbols."""
    return () if node[0] in LEAVES else node[1:]


def reachable(graph: Graph, roots: Iterable[int], stop: Container[int] = ()) -> list[int]:
    """Ids of all nodes that the roots are made of, the roots included, ascending.

    Operands have smaller ids than the nodes that use them, so every node comes after its operands.  The operands of
    nodes in ``stop`` are not entered.
    """
    nodes = graph.nodes
    seen = set(roots)
    key = None if stop or len(seen) < MANY else frozenset(seen)
    if key is not None and key in graph.reached:
        return list(graph.reached[key])
    stack = list(seen)
    while stack:
        i = stack.pop()
        if stop and i in stop:
            continue
        node = nodes[i]
        if len(node) == 3:  # most nodes: two operands, without a loop
            _, a, b = node
            if a not in seen:
                seen.add(a)
                stack.append(a)
            if b not in seen:
                seen.add(b)
                stack.append(b)
        elif node[0] not in LEAVES:
            for k in node[1:]:
                if k not in seen:
                    seen.add(k)
                    stack.append(k)
    result = sorted(seen)
    if key is not None:
        if len(graph.reached) >= KEPT:
            graph.reached.pop(next(iter(graph.reached)))
        graph.reached[key] = list(result)
    return result


def parts(graph: Graph, ids: Sequence[int]) -> list[tuple[int, Sequence[int]]]:
    """Ids in ascending order, cut where the graph has marks, each with the number of its pass; none is empty."""
    result: list[tuple[int, Sequence[int]]] = []
    marks, start = graph.marks, 0
    while start < len(ids):
        following = bisect_right(marks, ids[start], key=itemgetter(0))
        number = marks[following - 1][1] if following else 0
        end = bisect_left(ids, marks[following][0], start) if following < len(marks) else len(ids)
        result.append((number, ids[start:end]))
        start = end
    return result


def marked_again(graph: Graph, ids: Sequence[int], backwards: bool = False) -> Iterator[Sequence[int]]:
    """Ids in ascending order by parts, the last first if asked; what is made of each is a part of its own."""
    passes: dict[int, int] = {0: 0}
    result = parts(graph, ids)
    for number, part in reversed(result) if backwards else result:
        if number not in passes:
            passes[number] = graph.begin_pass()
        graph.mark(passes[number])
        yield part
    graph.mark()


def common_graph(*groups: Sequence[Expr]) -> Graph | None:
    """The one graph of all these expressions, None if there are none."""
    graph: Graph | None = None
    for group in groups:
        for x in group:
            if graph is None:
                graph = x.graph
            elif x.graph is not graph:
                raise ValueError("expressions of different graphs cannot be used together")
    return graph


# -- replacements ------------------------------------------------------------------------------------------------------


FEW = 256  #: nodes that are not worth parts of their own


def substitute(outputs: Sequence[Expr], mapping: Mapping[Expr, Expr]) -> list[Expr]:
    """Replace nodes (symbols or whole subexpressions) everywhere in the outputs, all at once.

    Replacements are not searched again, so ``{x: y, y: x}`` exchanges x and y.
    """
    graph = common_graph(outputs, list(mapping), list(mapping.values()))
    if graph is None:
        return []
    nodes, make = graph.nodes, graph.make
    new = {old.id: replacement.id for old, replacement in mapping.items()}
    replaced = frozenset(new)
    order = reachable(graph, (y.id for y in outputs), stop=replaced)
    for part in [order] if len(order) < FEW else marked_again(graph, order):
        for i in part:
            node = nodes[i]
            if i in replaced or node[0] in ("const", "sym"):
                continue
            old: tuple[int, ...] = node[1:]
            for k in old:
                if k in new:
                    new[i] = make(node[0], *[new.get(j, j) for j in old])
                    break
    return [Expr(graph, new.get(y.id, y.id)) for y in outputs]


def symbols_of(outputs: Sequence[Expr]) -> set[str]:
    """Names of all symbols the outputs depend on."""
    graph = common_graph(outputs)
    if graph is None:
        return set()
    nodes = graph.nodes
    return {nodes[i][1] for i in reachable(graph, (y.id for y in outputs)) if nodes[i][0] == "sym"}


# -- copies ------------------------------------------------------------------------------------------------------------


Copied = TypeVar("Copied")
SHARED = frozenset({str, int, float, bool, type(None)})  #: types whose values are not copied


def copied(value: Copied) -> Copied:
    """What ``copy.deepcopy`` gives of a tuple, list, dict, record or Expr, in a fraction of its time."""
    return _Copies().of(value)  # type: ignore[no-any-return]


class _Copies:
    """Copies by the ids of what they are copies of, as ``deepcopy`` notes them."""

    def __init__(self) -> None:
        self.memo: dict[int, Any] = {}

    def of(self, x: Any) -> Any:
        kind: Any = type(x)
        if kind in SHARED:
            return x
        result = self.memo.get(id(x))
        if result is not None:
            return result
        if kind is Expr:
            return Expr(self.of(x.graph), x.id)
        if kind is tuple:
            made: Any = tuple(self._each(x))
        elif kind is list:
            made = self._each(x)
        elif kind is dict:
            made = dict(zip(self._each(x), self._each(x.values()), strict=True))
        elif isinstance(x, tuple) and kind.__reduce_ex__ is object.__reduce_ex__:
            made = tuple.__new__(kind, self._each(x))
        elif _is_record(kind):
            made = self.memo[id(x)] = kind.__new__(kind)
            members = vars(x)
            vars(made).update(zip(members, self._each(members.values()), strict=True))
        else:
            return deepcopy(x, self.memo)
        return self.memo.setdefault(id(x), made)  # what it holds may hold it

    def _each(self, parts: Any) -> list[Any]:
        """Expressions here, most of which are zero in large sparse matrices."""
        graph = copied = zero = None
        result = []
        for x in parts:
            if type(x) is Expr:
                if x.graph is not graph:
                    graph = x.graph
                    copied = self.of(graph)
                    zero = copied.zero
                result.append(zero if x.id == zero.id else Expr(copied, x.id))  # type: ignore[union-attr, arg-type]
            else:
                result.append(self.of(x))
        return result


def _is_record(kind: Any) -> bool:
    """Whether an object of a type is what its attributes are."""
    methods = ("__reduce_ex__", "__reduce__", "__getstate__")
    if kind.__dictoffset__ == 0 or any(getattr(kind, name) is not getattr(object, name) for name in methods):
        return False
    others = any(hasattr(kind, name) for name in ("__deepcopy__", "__setstate__"))
    return not others and not any(vars(base).get("__slots__") for base in kind.__mro__)
