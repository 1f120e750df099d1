"""Stage graph, shown: a value of any kind -> the text that messages and labels show; it always comes to an end."""

from __future__ import annotations

import sys
from typing import Any

LONGEST = 120  #: characters of a value in a message
#: Begins the text of a value that has none: SymPy prints recursively, Python refuses whole numbers of 4300 digits.
NO_TEXT = "<unprintable "


def shown(value: Any) -> str:
    """The text of a value, whole."""
    if _is_tower(value):
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


def _is_tower(value: Any) -> bool:
    """Whether a SymPy expression holds powers of powers of numbers, such as 9**(9**9), that its printer works out."""
    sympy = sys.modules.get("sympy")
    if sympy is None or not isinstance(value, sympy.Basic):
        return False
    stack, seen, powers = [value], set(), 0
    while stack:
        part = stack.pop()
        if id(part) not in seen:
            seen.add(id(part))
            stack += part.args
            powers += isinstance(part, sympy.Pow) and all(x.is_number and not x.is_Number for x in part.args[1:])
    return powers > 0
