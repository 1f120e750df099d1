"""Stage graph: scalar operations -> one hash-consed expression graph.

A :class:`Graph` is a growing table of nodes ``(operation, operand ids...)``.  A node that already exists is never made
again, and constants, signs, zeros and ones are folded as nodes are made, so common subexpressions merge at birth and
derivation code cannot swell.  :class:`Expr` is a handle on one node with Python's operators.

Operations: ``const``, ``sym``, those of the table :mod:`eomgen.base.operations`, and calls of declared functions
(:mod:`.functions`).  ``select(c, x, y)`` is x where c is true (non-zero) and y elsewhere.  Comparisons give 1.0 or 0.0.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, Union, cast

from .nodes import Node, Nodes

if TYPE_CHECKING:
    from .functions import Function

Scalar = Union["Expr", float, int]


class Graph(Nodes):
    """A table of interned nodes, handed out as :class:`Expr`.

    Attributes
    ----------
    nodes : list of tuple
        ``nodes[i]`` is the node with id ``i``; operands always have smaller ids than the node that uses them, so id
        order is a topological order.
    marks : list of (int, int)
        Ids, ascending, with which the part of another body begins, and the pass over the bodies that it is of: code of
        big models is made of alike parts.
    n_passes : int
    reached : dict
        What many roots were found to be made of: nodes never change, so neither does that.
    roots : Roots, optional
        What :mod:`.slopes` knows of its nodes.
    functions, calls : dict
        Functions that expressions may call, by name; what each operation that is a call means: (Function, orders).
    """

    __slots__ = ("functions", "one", "roots", "zero")

    def __init__(self) -> None:
        super().__init__()
        self.roots: Any = None
        self.functions: dict[str, Function] = {}
        self.zero = self.constant(0.0)
        self.one = self.constant(1.0)

    def __deepcopy__(self, memo: dict[int, object]) -> Graph:
        """A graph of the same nodes by the same ids, which grows by itself; functions never change and are shared."""
        twin = memo[id(self)] = Graph.__new__(Graph)
        twin.nodes, twin._ids = list(self.nodes), dict(self._ids)
        twin.marks, twin.n_passes, twin.reached = list(self.marks), self.n_passes, {}
        twin.roots = None
        twin.calls, twin.functions = dict(self.calls), dict(self.functions)
        twin.zero, twin.one = Expr(twin, self.zero.id), Expr(twin, self.one.id)
        return twin

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
