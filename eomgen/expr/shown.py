"""A value of any kind -> the text that messages and labels show; it always comes to an end."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from typing import Any

from ..base import texts

LONGEST = 120  #: characters of a value in a message
EXPONENT = 10_000  #: of a number that SymPy may work out
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
    return texts.shortened(shown(value), longest)


def quoted(value: Any, longest: int = LONGEST) -> str:
    """The value as Python writes it, cut where it is long."""
    if isinstance(value, str | int | float | list | tuple | dict):
        try:
            text = repr(value)
        except Exception:
            text = f"{NO_TEXT}{type(value).__name__}>"
    else:
        text = shown(value)
    return texts.shortened(text, longest)


def _prints(value: Any) -> bool:
    """Whether a value can be printed at all: of SymPy only plain expressions.

    SymPy's printer asks for signs, and works out powers of powers of numbers, sums and roots to tell them: for any
    time, and by running texts as code.
    """
    sympy = sys.modules.get("sympy")
    if sympy is None or not isinstance(value, sympy.Basic):
        return not isinstance(value, type)
    plain: tuple[Any, ...] = (sympy.AtomicExpr, sympy.Add, sympy.Mul, sympy.Pow, sympy.Derivative, sympy.Subs)
    plain += (sympy.Function, sympy.core.relational.Relational, sympy.logic.boolalg.Boolean, sympy.Tuple)
    plain += (sympy.functions.elementary.piecewise.ExprCondPair, sympy.core.symbol.Str)
    return all(isinstance(part, plain) and not is_tower(part) and not _grows(part) for part in parts_of(value))


def _grows(part: Any) -> bool:
    """Whether a part of a SymPy expression is a number that takes any time to write or to work out.

    Such are a Float of millions of digits, and what grows as exp does of a large number or of what grows too.
    """
    sympy = sys.modules["sympy"]
    if isinstance(part, sympy.Float):
        return bool(abs(part._mpf_[2]) > EXPONENT)
    growing = (sympy.exp, sympy.gamma, sympy.loggamma, sympy.factorial, sympy.sinh, sympy.cosh, sympy.Pow)
    if not isinstance(part, growing[:-1]):
        return False
    below = [x for argument in part.args for x in parts_of(argument)]  # is_number would recurse
    if any(isinstance(x, sympy.Symbol) for x in below):
        return False
    return any(isinstance(x, growing) or (x.is_Number and x is not sympy.nan and abs(x) > EXPONENT) for x in below)


def parts_of(value: Any) -> Iterator[Any]:
    """Every part of a SymPy expression, each object once, without recursion: expressions may be deep."""
    stack: list[Any] = [value]
    seen: set[int] = set()
    while stack:
        part = stack.pop()
        if id(part) in seen:  # the expression keeps its parts alive
            continue
        seen.add(id(part))
        yield part
        arguments = getattr(part, "args", ())
        stack += arguments if isinstance(arguments, tuple) else ()  # those of a class are no tuple


def is_tower(part: Any) -> bool:
    """Whether a part of a SymPy expression is a power of numbers too large to work out, such as 9**(9**9)."""
    sympy = sys.modules["sympy"]
    if not isinstance(part, sympy.Pow):
        return False
    if part.exp.is_Number:
        return bool(part.base.is_Number and abs(part.exp) > EXPONENT)
    return bool(part.exp.args) and not any(isinstance(x, sympy.Symbol | sympy.Function) for x in parts_of(part.exp))
