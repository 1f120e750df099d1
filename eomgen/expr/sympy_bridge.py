"""SymPy expressions -> the same expressions in a graph, and back."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import partial, reduce
from typing import Any

import sympy
from sympy.core.function import AppliedUndef
from sympy.functions.elementary.piecewise import ExprCondPair
from sympy.logic.boolalg import BooleanFalse, BooleanTrue
from sympy.matrices.matrixbase import MatrixBase

from ..base.operations import CONDITION, OPERATIONS
from ..errors import EomgenError
from .core import LEAVES, Expr, Graph, common_graph, reachable
from .texts import is_tower, parts_of, shortened

# -- from SymPy --------------------------------------------------------------------------------------------------------

# All quantities are real.  What has a meaning: real numbers; ``+ * **``; the classes that rows of
# :mod:`~..base.operations` name; sec csc cot sech csch coth Heaviside re im conjugate; Piecewise ending with ``True``;
# ``> >= Ne Xor ITE Implies Equivalent``; and whatever the caller resolves: symbols, functions of time ``q(t)``, their
# derivatives; and the functions that the graph declares, with their derivatives.


Resolve = Callable[[sympy.Basic], Expr | None]
Build = Callable[[Graph, Sequence[int]], int]

#: What else SymPy may differentiate: quantities, derivatives, and what holds them.
DIFFERENTIABLE = (
    *(sympy.Symbol, AppliedUndef, sympy.Number, sympy.NumberSymbol, sympy.Derivative, sympy.Subs, sympy.Tuple),
    *(sympy.Piecewise, ExprCondPair, BooleanTrue, BooleanFalse),
)
ORDER = 8  #: of a derivative that SymPy carries out; each may double its length
ARGUMENT = 1e6  #: of a function that SymPy evaluates


class LoweringError(EomgenError, code="EG-EXPRESSION"):
    """A SymPy expression has no meaning as a real function of known quantities."""


class _Fault(Exception):
    """Why one sub-expression cannot be lowered."""


def lower(graph: Graph, expression: Any, resolve: Resolve) -> Expr:
    """Build a SymPy scalar or a number in a graph.

    ``resolve`` gives the meaning of a symbol, an applied function such as ``q(t)``, a ``Derivative`` or anything else
    that is not known here; None if it has none.

    Raises
    ------
    LoweringError
        The expression has parts without a meaning; all of them are named.
    """
    if isinstance(expression, (int, float)):
        expression = sympy.Float(expression, 17) if isinstance(expression, float) else sympy.Integer(expression)
    if isinstance(expression, MatrixBase) or not isinstance(expression, sympy.Basic):
        kind = type(expression).__name__
        raise LoweringError(f"a SymPy scalar is expected, not {kind}")
    walk = _Walk(graph, resolve)
    result = walk.run(expression)
    if walk.unresolved or walk.faults:
        raise _error(walk)
    return Expr(graph, result)


def _error(walk: _Walk) -> LoweringError:
    lines = [f"{shortened(part)}: {why}" for part, why in walk.faults]
    unresolved = sorted(walk.unresolved, key=shortened)
    if unresolved:
        names = ", ".join(shortened(x) for x in unresolved)
        calls = (getattr(x, "expr", x) for x in unresolved)
        functions = any(
            isinstance(x, AppliedUndef) and [getattr(a, "name", "") for a in x.args] != ["t"] for x in calls
        )
        declare = "declare functions first, by model.table or model.native" if functions else "declare them"
        lines.append(f"unknown names {names}; {declare}")
    return LoweringError("\n".join(lines))


class _Walk:
    """One walk over an expression, each object of it once, without recursion."""

    def __init__(self, graph: Graph, resolve: Resolve) -> None:
        self.graph = graph
        self.resolve = resolve
        self.builders = _builders()
        self.unresolved: dict[Any, None] = {}
        self.faults: list[tuple[Any, str]] = []
        # by identity: hashing and comparing deep expressions is recursive in SymPy; the entries keep the parts alive
        self.done: dict[int, tuple[Any, int]] = {}

    def run(self, root: Any) -> int:
        done = self.done
        pending: dict[int, tuple[Sequence[Any], Build]] = {}
        stack = [root]
        while stack:
            part = stack[-1]
            if id(part) in done:
                stack.pop()
                continue
            if id(part) not in pending:
                try:
                    pending[id(part)] = self._open(part)
                except _Fault as fault:
                    self.faults.append((part, str(fault)))
                    done[id(part)] = (part, self.graph.one.id)
                    continue
                missing = [x for x in pending[id(part)][0] if id(x) not in done]
                if missing:
                    stack.extend(reversed(missing))
                    continue
            stack.pop()
            operands, build = pending[id(part)]
            done[id(part)] = (part, build(self.graph, [done[id(x)][1] for x in operands]))
        return done[id(root)][1]

    def _open(self, part: Any) -> tuple[Sequence[Any], Build]:
        """The operands of a part and how to combine them once they are lowered."""
        if not isinstance(part, sympy.Basic):
            raise _Fault(f"a SymPy scalar is expected, not {type(part).__name__}")
        build = self.builders.get(part.func)
        if build is not None:
            return part.args, build
        if isinstance(part, (sympy.Number, sympy.NumberSymbol)):
            value = self.graph.constant(_number(part)).id
            return (), lambda g, ids: value
        if isinstance(part, (BooleanTrue, BooleanFalse)):
            truth = self.graph.one.id if part else self.graph.zero.id
            return (), lambda g, ids: truth
        if isinstance(part, sympy.Piecewise):
            return _pieces(part), _piecewise
        if isinstance(part, (sympy.Xor, sympy.ITE, sympy.Implies, sympy.Equivalent)):
            return (part.to_nnf(simplify=False),), lambda g, ids: ids[0]
        if part is sympy.I or part is sympy.zoo:
            raise _Fault("complex numbers are not allowed here")
        called = self._called(part)
        if called is not None:
            return called
        result = self.resolve(part)
        if result is not None:
            meaning = self.graph.lift(result).id
            return (), lambda g, ids: meaning
        return self._rewritten(part)

    def _called(self, part: Any) -> tuple[Sequence[Any], Build] | None:
        """A call of a declared function, or a derivative of one as SymPy writes it; None for anything else."""
        places: dict[Any, Any] = {}
        whole = part
        if isinstance(part, sympy.Subs) and isinstance(part.expr, sympy.Derivative):
            places = dict(zip(part.variables, part.point, strict=True))
            part = part.expr
        wanted: tuple[Any, ...] = ()
        if isinstance(part, sympy.Derivative):
            part, wanted = part.expr, part.variable_count
        if not isinstance(part, AppliedUndef) or part.func.__name__ not in self.graph.functions:
            return None
        function = self.graph.functions[part.func.__name__]
        if len(part.args) != function.arity:
            plural = "" if function.arity == 1 else "s"
            raise _Fault(f"{function.name}() takes {function.arity} argument{plural}, not {len(part.args)}")
        orders = [0] * function.arity
        for variable, order in wanted:
            along = [i for i, argument in enumerate(part.args) if argument == variable]
            others = [a for a in part.args if a != variable and a.has(variable)]
            if len(along) != 1 or others or not order.is_Integer:
                other = self._worked_out(whole)  # SymPy's own chain rule brings it into the form above
                return None if other == whole else ((other,), lambda g, ids: ids[0])
            orders[along[0]] += int(order)
        operands = [argument.xreplace(places) for argument in part.args]
        return operands, lambda g, ids: g.call(function, tuple(orders), ids)

    def _rewritten(self, part: Any) -> tuple[Sequence[Any], Build]:
        if isinstance(part, (sympy.Symbol, AppliedUndef)):
            self.unresolved[part] = None
            return (), lambda g, ids: g.one.id
        other = part
        if isinstance(part, (sympy.Derivative, sympy.Subs)):
            other = self._worked_out(part)
            if other == part and isinstance(part.expr, AppliedUndef):
                self.unresolved[part] = None
                return (), lambda g, ids: g.one.id
        elif isinstance(part, sympy.Function) and all(isinstance(x, sympy.Rational | sympy.Float) for x in part.args):
            other = _evaluated(part)
        if other == part or not isinstance(other, sympy.Basic):
            name = part.func.__name__
            raise _Fault(f"{name} cannot be translated; known are {_known()}")
        return (other,), lambda g, ids: ids[0]

    def _worked_out(self, part: Any) -> Any:
        """A derivative or substitution carried out by SymPy; of parts that are known here only.

        Of others (sums, integrals, limits) SymPy searches for a closed form, for any time, and runs texts as code.
        """
        for inner in parts_of(part):
            if not isinstance(inner, sympy.Basic):
                raise _Fault(f"a SymPy scalar is expected, not {type(inner).__name__}")
            if not (inner.func in self.builders or isinstance(inner, DIFFERENTIABLE)):
                raise _Fault(f"the derivative of {inner.func.__name__} cannot be translated; known are {_known()}")
            if is_tower(inner):
                raise _Fault("the power of numbers is too large")
            orders = [n for _, n in inner.variable_count] if isinstance(inner, sympy.Derivative) else []
            if not all(n.is_Integer for n in orders) or sum(orders) > ORDER:
                raise _Fault(f"the order of a derivative must be a number up to {ORDER}")
        try:
            return part.doit()
        except Exception as error:  # of many classes: the part may be odd in any way
            raise _Fault(f"SymPy cannot work it out ({type(error).__name__})") from None


def _evaluated(part: Any) -> Any:
    """A function of numbers that is not known here, such as gamma(1/3), as a number."""
    if any(abs(x) > ARGUMENT or (isinstance(x, sympy.Rational) and x.q > ARGUMENT) for x in part.args if x.is_finite):
        raise _Fault(f"a function that is not known here is evaluated at numbers up to {ARGUMENT:g} only")
    try:
        other = part.evalf(30)
    except Exception as error:  # of many classes: the part may be odd in any way
        raise _Fault(f"SymPy cannot work it out ({type(error).__name__})") from None
    return other if isinstance(other, sympy.Number) else part


def _number(part: Any) -> float:
    """The double nearest to a real number of SymPy."""
    if part is sympy.nan or not part.is_finite:
        raise _Fault("infinities and NaN are not allowed here")
    if isinstance(part, sympy.NumberSymbol):
        part = part.evalf(40)
    try:
        if isinstance(part, sympy.Rational):
            return float(Fraction(int(part.p), int(part.q)))
        # a Float is exactly (-1)^sign mantissa 2^exponent; its own float() would cut digits off instead of rounding
        sign, mantissa, exponent, bits = part._mpf_
        if exponent + bits < -1100:
            return 0.0
        if exponent + bits > 1100:
            raise OverflowError
        return float(Fraction(int(-mantissa if sign else mantissa)) * Fraction(2) ** int(exponent))
    except OverflowError:
        raise _Fault("the number is too large for a double") from None


def _pieces(part: Any) -> Sequence[Any]:
    """Expressions and conditions in turn: e1, c1, e2, c2, ..., last expression."""
    flat: list[Any] = []
    for pair in part.args:
        if not isinstance(pair, ExprCondPair):
            raise _Fault("a Piecewise must consist of (expression, condition) pairs")
        if pair.cond is sympy.true:
            return [*flat, pair.expr]
        flat += [pair.expr, pair.cond]
    last = part.args[-1]
    raise _Fault(
        f"the last piece ({shortened(last.expr)} if {shortened(last.cond)}) leaves the other cases without a value; "
        "end the Piecewise with (expression, True)"
    )


def _piecewise(g: Graph, ids: Sequence[int]) -> int:
    result = ids[-1]
    for k in range(len(ids) - 3, -1, -2):
        result = g.make("select", ids[k + 1], ids[k], result)
    return result


def _product(g: Graph, ids: Sequence[int]) -> int:
    """Factors 1/y go into one denominator, numbers to the front."""
    numbers, above, below = [], [], []
    for i in ids:
        node = g.nodes[i]
        if node[0] == "const":
            numbers.append(i)
        elif node[0] == "div" and node[1] == g.one.id:
            below.append(node[2])
        else:
            above.append(i)
    top = g.mul(reduce(g.mul, numbers, g.one.id), reduce(g.mul, above, g.one.id))
    return g.div(top, reduce(g.mul, below)) if below else top


def _known() -> str:
    classes = " ".join(row.sympy_class for row in OPERATIONS.values() if row.sympy_class)
    return f"numbers, + - * / **, {classes}, sec csc cot sech csch coth Heaviside, Piecewise, relations"


def _operation(name: str, g: Graph, ids: Sequence[int]) -> int:
    return g.make(name, *ids)


def _chain(name: str, g: Graph, ids: Sequence[int]) -> int:
    return reduce(partial(g.make, name), ids)


def _over(operation: str) -> Build:
    return lambda g, ids: g.div(g.one.id, g.make(operation, *ids))


def _heaviside(g: Graph, ids: Sequence[int]) -> int:
    x, middle, zero = ids[0], ids[1], g.zero.id
    below = g.make("select", g.make("lt", x, zero), zero, middle)
    return g.make("select", g.make("lt", zero, x), g.one.id, below)


#: How classes of SymPy that are no operations of their own are built from their lowered arguments.
BUILD: dict[Any, Build] = {
    sympy.Add: lambda g, ids: reduce(g.add, ids),
    sympy.Mul: _product,
    sympy.Pow: lambda g, ids: g.make("pow", *ids),
    sympy.sec: _over("cos"),
    sympy.csc: _over("sin"),
    sympy.cot: lambda g, ids: g.div(g.make("cos", ids[0]), g.make("sin", ids[0])),
    sympy.sech: _over("cosh"),
    sympy.csch: _over("sinh"),
    sympy.coth: _over("tanh"),
    sympy.Heaviside: _heaviside,
    sympy.StrictGreaterThan: lambda g, ids: g.make("lt", ids[1], ids[0]),
    sympy.GreaterThan: lambda g, ids: g.make("le", ids[1], ids[0]),
    sympy.Unequality: lambda g, ids: g.make("not", g.make("eq", *ids)),
    sympy.re: lambda g, ids: ids[0],
    sympy.im: lambda g, ids: g.zero.id,
    sympy.conjugate: lambda g, ids: ids[0],
}


def _builders() -> dict[Any, Build]:
    """How each class of SymPy that has a meaning is built."""
    result = dict(BUILD)
    codegen = sys.modules.get("sympy.codegen.cfunctions")
    for row in OPERATIONS.values():
        cls = getattr(sympy, row.sympy_class, None) or getattr(codegen, row.sympy_class, None)
        if cls is not None:
            result[cls] = partial(_chain if row.many else _operation, row.name)
    return result


# -- to SymPy ----------------------------------------------------------------------------------------------------------


def inlined_size(exprs: Sequence[Expr]) -> int:
    """Operations in the expressions written out without sharing (at most 10^9 is counted)."""
    graph = common_graph(exprs)
    if graph is None:
        return 0
    nodes = graph.nodes
    roots = [x.id for x in exprs]
    size: dict[int, int] = {}
    for i in reachable(graph, roots):
        node = nodes[i]
        size[i] = 0 if node[0] in LEAVES else min(10**9, 1 + sum(size[k] for k in node[1:]))
    return min(10**9, sum(size[i] for i in roots))


def raise_operation(graph: Graph, kind: str, operands: Sequence[Any]) -> Any:
    """An operation, or a call of a function of the graph, on SymPy expressions."""
    if kind in graph.calls:
        function, orders = graph.calls[kind]
        operands = [as_number(x) for x in operands]
        return function.in_sympy(operands) if function.lists else _call(function.name, orders, operands)
    row = OPERATIONS[kind]
    truths = len(operands) if row.kind == CONDITION and not row.jumps else int(row.chooses)
    return row.raised(sympy, *(_as_truth(x) if n < truths else as_number(x) for n, x in enumerate(operands)))


def _call(name: str, orders: Sequence[int], operands: Sequence[Any]) -> Any:
    """A call of a declared function, or its derivative where the arguments are the operands."""
    function = sympy.Function(name)
    if not any(orders):
        return function(*operands)
    places, moved = list(operands), dict[Any, Any]()
    for k, x in enumerate(operands):
        others = [*operands[:k], *operands[k + 1 :]]
        if orders[k] and not (x.is_Symbol and not any(other.has(x) for other in others)):
            places[k] = sympy.Dummy(f"xi_{k + 1}")
            while x in moved.values():  # Subs takes variables at the same point for the same variable
                x = sympy.Mul(sympy.Integer(1), x, evaluate=False)
            moved[places[k]] = x
    slope = sympy.Derivative(function(*places), *((places[k], n) for k, n in enumerate(orders) if n))
    return sympy.Subs(slope, list(moved), list(moved.values())) if moved else slope


def _is_truth(value: Any) -> bool:
    return isinstance(value, sympy.logic.boolalg.Boolean) and not isinstance(value, sympy.Symbol)


def as_number(value: Any) -> Any:
    """A SymPy expression; 1 or 0 of a condition."""
    return sympy.Piecewise((sympy.Integer(1), value), (sympy.Integer(0), True)) if _is_truth(value) else value


def _as_truth(value: Any) -> Any:
    return value if _is_truth(value) else sympy.Ne(value, 0)
