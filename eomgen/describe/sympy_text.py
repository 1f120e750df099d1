"""Stage describe, SymPy -> text: a SymPy expression -> the same expression as a model file writes it."""

from __future__ import annotations

from typing import Any

from ..errors import ExpressionError, UsageError
from ..graph.core import Expr, Graph
from .expressions import parse
from .scope import RATES
from .sympy_face import free_names, function_name, function_names


def sympy_text(expression: Any) -> str:
    """A SymPy expression as a text that the expressions of a model file know.

    Raises
    ------
    UsageError
        The expression has parts that such a text cannot say.
    """
    from sympy.printing.str import StrPrinter

    class Printer(StrPrinter):  # type: ignore[misc]  # SymPy has no types
        """SymPy's text with the names of functions that a model file uses."""

        def _print_Abs(self, e: Any) -> str:
            return f"abs({self._print(e.args[0])})"

        def _print_Min(self, e: Any) -> str:
            return f"min({', '.join(self._print(x) for x in e.args)})"

        def _print_Max(self, e: Any) -> str:
            return f"max({', '.join(self._print(x) for x in e.args)})"

        def _print_Float(self, e: Any) -> str:
            return repr(float(e))

        def _print_Heaviside(self, e: Any) -> str:
            if 2 * e.args[1] != 1:
                raise UsageError(f"{e} cannot be written as a text: heaviside is 1/2 at 0")
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
                raise UsageError(f"{e} leaves cases without a value; end the Piecewise with (expression, True)")
            text = self._print(last.expr)
            for piece in reversed(pieces):
                text = f"where({self._print(piece.cond)}, {self._print(piece.expr)}, {text})"
            return str(text)

        def _print_AppliedUndef(self, e: Any) -> str:
            return function_name(e) or str(e)

        def _print_Derivative(self, e: Any) -> str:
            return function_name(e) or str(e)

    text = str(Printer().doprint(expression))
    graph = Graph()
    known = {*free_names([expression]), "t"} | {f + rate for f in function_names([expression]) for rate in RATES}

    def resolve(name: str) -> Expr:
        if name not in known:  # a constant of SymPy such as I or oo
            raise ExpressionError(f"{name} is not a real number")
        return graph.symbol(name)

    def locate(quantity: str, marker: str) -> Expr:
        return resolve(f"{quantity}({marker})")

    try:
        parse(text, graph, resolve, locate)
    except ExpressionError as error:
        raise UsageError(f"{expression} cannot be written as a text: {error}") from None
    return text
