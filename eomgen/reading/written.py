"""Stage reading, written: graph expressions -> SymPy expressions short to read, large ones with named parts.

Everything that a user reads as SymPy comes through :func:`write`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import Any, NamedTuple

from ..graph.core import Expr
from ..simplify import WHOLE, joined_nodes, simplify

READABLE = 400  #: operations an expression, on average, up to which expressions are written out
LONGEST = 5_000  #: operations of all of them together


class Written(NamedTuple):
    """SymPy expressions, with the named parts that they use.

    Attributes
    ----------
    intermediates : list of (sympy.Symbol, sympy.Expr)
        In an order in which each uses only those before it; empty where everything is written out.
    expressions : list of sympy.Expr
    """

    intermediates: list[tuple[Any, Any]]
    expressions: list[Any]


def is_short(expressions: Sequence[Expr]) -> bool:
    """Whether expressions are written out whole."""
    from ..graph.sympy_raise import inlined_size

    several = {x.id: x for x in expressions if x.value is None}
    return inlined_size(expressions) <= min(READABLE * len(several), LONGEST)


def needed(named: Sequence[tuple[Any, Any]], value: Any) -> list[tuple[Any, Any]]:
    """The named parts that a value uses, and those that these use."""
    wanted = set(value.free_symbols)
    found = []
    for symbol, expression in reversed(list(named)):
        if symbol in wanted:
            found.append((symbol, expression))
            wanted |= expression.free_symbols
    return found[::-1]


def write(
    expressions: Sequence[Expr],
    symbols: Callable[[str], Any] | None = None,
    prefix: str = "z",
    given: Sequence[tuple[str, Expr]] = (),
    rates: Collection[str] = (),
    parameters: Collection[str] = (),
    unit: Sequence[Sequence[str]] = (),
    roots: bool = False,
) -> Written:
    """Expressions of one graph in SymPy.

    Parameters
    ----------
    expressions : sequence of Expr
    symbols : callable, optional
        Name -> the SymPy symbol, or function of time, that stands for it; plain symbols by default.
    prefix : str, optional
        Named parts are called ``z0``, ``z1``, ...
    given : sequence of (str, Expr), optional
        Names that stand in the expressions already, and what they stand for, in order.
    rates : collection of str, optional
        Names of velocities and accelerations.
    parameters : collection of str, optional
        Names of parameters.
    unit : sequence of sequence of str, optional
        Names of Euler parameters, four by four: the sum of their squares is 1.
    roots : bool, optional
        Whether long roots and denominators that are written several times get names in any case.

    Returns
    -------
    Written
    """
    if not expressions:
        return Written([], [])
    expressions, given = joined_nodes(expressions, given, unit)
    form = simplify(expressions, given, rates, prefix, *([WHOLE] if not given and is_short(expressions) else []))
    if form is None:
        return Written([], [])
    named, found = form.sympy(symbols, parameters, prefix, roots)
    return Written([(name, _with_derivatives(x)) for name, x in named], [_with_derivatives(x) for x in found])


def _with_derivatives(expression: Any) -> Any:
    """With sqrt(x^2) for |x|: SymPy takes names for complex numbers, of which |x| has no derivative."""
    import sympy

    if not expression.has(sympy.Abs):
        return expression
    return expression.replace(sympy.Abs, lambda x: sympy.sqrt(x**2))
