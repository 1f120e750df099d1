"""An expression -> the same with other names, other axes or other units.

Values are numbers and texts.  Texts are changed by their tokens, never evaluated as code.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ..errors import ExpressionError
from ..graph.core import Graph
from ..graph.evaluate import evaluate
from .expressions import parse
from .marker_quantities import ElementQuantity, MarkerQuantity
from .names import MULTIPLIER, OF_ELEMENTS, QUANTITIES, REACTION, REACTION_PARTS, WRENCH, WRENCH_PARTS

_MARKER = r"[A-Za-z]\w*(?:\.\w+)*"
_TOKEN = re.compile(
    r"(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)"
    rf"|\b(?P<quantity>{'|'.join(sorted(QUANTITIES, key=len, reverse=True))})"
    rf"\(\s*(?P<arguments>{_MARKER}(?:\s*,\s*(?:(?:in|from)\s*=\s*)?{_MARKER})*)\s*\)"
    rf"|\b(?P<what>{'|'.join((*OF_ELEMENTS, MULTIPLIER))})\(\s*(?P<element>{_MARKER})\s*\)"
    rf"|\b{REACTION}\(\s*(?P<joint>{_MARKER})\s*(?:,\s*in\s*=\s*(?P<axes>{_MARKER})\s*)?\)"
    rf"\.(?P<part>{'|'.join(REACTION_PARTS)})\b"
    rf"|\b{WRENCH}\(\s*(?P<pushing>{_MARKER})\s*,\s*on\s*=\s*(?P<on>{_MARKER})\s*"
    rf"(?:,\s*in\s*=\s*(?P<along>{_MARKER})\s*)?\)\.(?P<component>{'|'.join(WRENCH_PARTS)})\b"
    r"|(?P<name>[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*)"
)

_ATOM = re.compile(r"[A-Za-z0-9_.]+\Z")

Rename = Callable[[str], str]
Locate = Callable[[MarkerQuantity], str]


def rewritten(value: Any, name: Rename, locate: Locate, element: Callable[[ElementQuantity], str] | None = None) -> Any:
    """A value with every name, motion of a marker (``vx(rod.tip)``) and element (``force(k1)``) replaced.

    Numbers stay, and without ``element`` so do the elements.
    """
    if not isinstance(value, str):
        return value

    def one(found: re.Match[str]) -> str:
        if found["number"] is not None:
            return found[0]
        if found["quantity"] is not None:
            try:
                return locate(MarkerQuantity.of(found["quantity"], found["arguments"]))
            except ExpressionError:  # told where the text is read
                return found[0]
        if found["what"] is not None:
            return found[0] if element is None else element(ElementQuantity(found["what"], found["element"]))
        if found["joint"] is not None:
            quantity = ElementQuantity(REACTION, found["joint"], found["part"], found["axes"] or "")
            return found[0] if element is None else element(quantity)
        if found["pushing"] is not None:
            quantity = ElementQuantity(WRENCH, found["pushing"], found["component"], found["along"] or "", found["on"])
            return found[0] if element is None else element(quantity)
        return name(found[0])

    return _TOKEN.sub(one, value)


def in_brackets(text: str) -> str:
    """A text so that it can stand in the place of a name."""
    return text if _ATOM.match(text) else f"({text})"


def names_of(value: Any) -> set[str]:
    """Names in a text, markers aside."""
    found: set[str] = set()

    def note(name: str) -> str:
        found.add(name)
        return name

    rewritten(value, note, str)
    return found


def motions_of(value: Any) -> set[MarkerQuantity]:
    """Every motion of a marker in a text."""
    found: set[MarkerQuantity] = set()

    def note(quantity: MarkerQuantity) -> str:
        found.add(quantity)
        return str(quantity)

    rewritten(value, lambda name: name, note)
    return found


def scaled(value: Any, factor: float) -> Any:
    """A value times a number."""
    if not isinstance(value, str):
        return float(value) * factor
    return value if factor == 1.0 else f"{factor!r}*({value})"


def total(factors: Sequence[float], values: Sequence[Any]) -> Any:
    """The sum of factor times value; a number if all values are numbers."""
    known = sum(f * float(v) for f, v in zip(factors, values, strict=True) if not isinstance(v, str))
    texts = [scaled(v, f) for f, v in zip(factors, values, strict=True) if isinstance(v, str) and f != 0.0]
    if not texts:
        return float(known)
    return " + ".join([*(["" + repr(float(known))] if known else []), *(f"({text})" for text in texts)])


def number_of(value: Any, parameters: Mapping[str, float]) -> float:
    """The number of a value at given parameters; KeyError if it depends on anything else."""
    if not isinstance(value, str):
        return float(value)
    graph = Graph()
    expression = parse(value, graph, graph.symbol)
    return float(evaluate([expression], parameters)[0])
