"""Stage describe, SymPy -> text: a SymPy expression -> the same expression as a model file writes it."""

from __future__ import annotations

from collections.abc import Collection
from functools import partialmethod
from typing import Any

from ..base.operations import OPERATIONS
from ..errors import ExpressionError, cannot
from ..graph.core import Expr, Graph
from ..graph.functions import Function
from .expressions import parse
from .marker_quantities import ElementQuantity, MarkerQuantity
from .scope import RATES
from .sympy_face import free_names, function_name, function_names


def sympy_text(expression: Any, functions: Collection[str] = ()) -> str:
    """A SymPy expression as a text that the expressions of a model file know.

    Parameters
    ----------
    expression : sympy.Expr
    functions : collection of str, optional
        Names of the functions that the model declares.

    Raises
    ------
    UsageError
        The expression has parts that such a text cannot say.
    """
    import sympy
    from sympy.core.function import AppliedUndef
    from sympy.printing.str import StrPrinter

    from ..graph.shown import shortened

    def named(printer: Any, e: Any, word: str) -> str:
        return f"{word}({', '.join(printer._print(x) for x in e.args)})"

    class Printer(StrPrinter):  # type: ignore[misc]  # SymPy has no types
        """SymPy's text with the names of functions that a model file uses."""

        def _print_Float(self, e: Any) -> str:
            return repr(float(e))

        def _print_Heaviside(self, e: Any) -> str:
            if 2 * e.args[1] != 1:
                raise cannot(f"{shortened(e)} cannot be written as a text: only heaviside with the value 1/2 at 0 can")
            return f"heaviside({self._print(e.args[0])})"

        def _print_Exp1(self, e: Any) -> str:
            return "exp(1)"

        def _print_And(self, e: Any) -> str:
            return "(" + " and ".join(self._print(x) for x in e.args) + ")"

        def _print_Or(self, e: Any) -> str:
            return "(" + " or ".join(self._print(x) for x in e.args) + ")"

        def _print_Not(self, e: Any) -> str:
            return f"(not {self._print(e.args[0])})"

        def _print_Relational(self, e: Any) -> str:
            return f"({self._print(e.lhs)} {e.rel_op} {self._print(e.rhs)})"

        def _print_Piecewise(self, e: Any) -> str:
            *pieces, last = e.args
            if last.cond != True:  # noqa: E712 - SymPy's own true
                raise cannot(f"{shortened(e)} leaves cases without a value; end the Piecewise with (expression, True)")
            text = self._print(last.expr)
            for piece in reversed(pieces):
                text = f"where({self._print(piece.cond)}, {self._print(piece.expr)}, {text})"
            return str(text)

        def _print_AppliedUndef(self, e: Any) -> str:
            if e.func.__name__ not in functions:
                return function_name(e) or str(e)
            return f"{e.func.__name__}({', '.join(self._print(x) for x in e.args)})"

        def _print_Derivative(self, e: Any) -> str:
            if e.expr.func.__name__ not in functions:
                return function_name(e) or str(e)
            return self._slope(e, e.expr.args)

        def _print_Subs(self, e: Any) -> str:
            slope = e.expr
            if not isinstance(slope, sympy.Derivative) or slope.expr.func.__name__ not in functions:
                return str(e)
            places = dict(zip(e.variables, e.point, strict=True))
            return self._slope(slope, [x.xreplace(places) for x in slope.expr.args])

        def _slope(self, e: Any, operands: Any) -> str:
            wanted = dict(e.variable_count)
            orders = [wanted.get(x, 0) for x in e.expr.args]
            if sum(orders) != sum(wanted.values()) or any(set(wanted) & x.free_symbols - {x} for x in e.expr.args):
                raise cannot(f"{shortened(e)} cannot be written as a text: write out the chain rule of its derivative")
            call = f"{e.expr.func.__name__}({', '.join(self._print(x) for x in operands)})"
            return f"diff({', '.join([call, *map(str, orders)])})"

    for row in OPERATIONS.values():
        if row.word and row.sympy_class:
            setattr(Printer, f"_print_{row.sympy_class}", partialmethod(named, word=row.word))
    try:
        text = str(Printer().doprint(expression))
    except RecursionError:
        raise cannot(f"{shortened(expression)} is nested too deeply to be written as a text") from None
    except ValueError:  # Python writes whole numbers of some thousand digits and no longer ones
        raise cannot(
            f"{shortened(expression)} contains a number with too many digits to be written as a text"
        ) from None
    graph = Graph()
    for call in expression.atoms(AppliedUndef) if isinstance(expression, sympy.Basic) else ():
        if call.func.__name__ in functions:
            graph.declare(Function(call.func.__name__, len(call.args), None))
    known = {*free_names([expression]), "t"} | {f + rate for f in function_names([expression]) for rate in RATES}

    def resolve(name: str) -> Expr:
        if name not in known:  # a constant of SymPy such as I or oo
            raise ExpressionError(f"{name} is not a real number")
        return graph.symbol(name)

    def locate(quantity: MarkerQuantity | ElementQuantity) -> Expr:
        return resolve(str(quantity))

    try:
        parse(text, graph, resolve, locate)
    except ExpressionError as error:
        raise cannot(f"{shortened(expression)} cannot be written as a text: {shortened(error)}") from None
    return text
