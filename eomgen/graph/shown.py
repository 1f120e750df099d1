"""Stage graph, shown: a value of any kind -> the text that messages and labels show; it always comes to an end."""

from __future__ import annotations

import sys
from typing import Any

LONGEST = 120  #: characters of a value in a message
#: Begins the text of a value that has none: SymPy prints recursively, Python refuses whole numbers of 4300 digits.
NO_TEXT = "<unprintable "


def shown(value: Any) -> str:
    """The text of a value, whole."""
    if not _prints(value):
        return f"{NO_TEXT}{type(value).__name__}>"
    try:
        return str(value)
    except Exception:  # of many classes: the value may be of any
        return f"{NO_TEXT}{type(value).__name__}>"


def shortened(value: Any, longest: int = LONGEST) -> str:
    """The text of a value, cut where it is long."""
    text = shown(value)
    return text if len(text) <= longest else f"{text[: longest - 3]}..."


def quoted(value: Any, longest: int = LONGEST) -> str:
    """The value as Python writes it, cut where it is long."""
    if isinstance(value, str | int | float | list | tuple | dict):
        try:
            text = repr(value)
        except Exception:
            text = f"{NO_TEXT}{type(value).__name__}>"
    else:
        text = shown(value)
    return text if len(text) <= longest else f"{text[: longest - 3]}..."


def _prints(value: Any) -> bool:
    """Whether a value can be printed at all: of SymPy only plain expressions.

    SymPy's printer asks for signs, and works out powers of powers of numbers, sums and roots to tell them: for any
    time, and by running texts as code.
    """
    sympy = sys.modules.get("sympy")
    if sympy is None or not isinstance(value, sympy.Basic):
        return not isinstance(value, type)
    plain = (sympy.AtomicExpr, sympy.Add, sympy.Mul, sympy.Pow, sympy.Derivative, sympy.Subs)
    plain += (sympy.Function, sympy.core.relational.Relational, sympy.logic.boolalg.Boolean, sympy.Tuple)
    plain += (sympy.functions.elementary.piecewise.ExprCondPair, sympy.core.symbol.Str)
    stack: list[Any] = [value]
    seen: set[int] = set()
    while stack:
        part = stack.pop()
        if id(part) in seen:
            continue
        seen.add(id(part))
        if not isinstance(part, plain):
            return False
        if isinstance(part, sympy.Pow) and part.exp.is_number and not part.exp.is_Number:
            return False
        stack += part.args
    return True
