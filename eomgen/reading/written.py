"""Stage reading, written: graph expressions -> SymPy expressions, small ones whole, large ones with named parts.

Everything that a user reads as SymPy comes through :func:`write`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from ..graph.core import Expr

READABLE = 400  #: operations an expression, on average, up to which expressions are written out
LONGEST = 20_000  #: operations of all of them together


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

    return inlined_size(expressions) <= min(READABLE * len(expressions), LONGEST)


def write(expressions: Sequence[Expr], symbols: Callable[[str], Any] | None = None, prefix: str = "z") -> Written:
    """Expressions of one graph in SymPy.

    Parameters
    ----------
    expressions : sequence of Expr
    symbols : callable, optional
        Name -> the SymPy symbol, or function of time, that stands for it; plain symbols by default.
    prefix : str, optional
        Named parts are called ``z0``, ``z1``, ...

    Returns
    -------
    Written
    """
    import sympy

    from ..graph.sympy_raise import raise_inline, raise_named

    symbols = sympy.Symbol if symbols is None else symbols
    if is_short(expressions):
        return Written([], raise_inline(expressions, symbols))
    return Written(*raise_named(expressions, symbols, prefix))
