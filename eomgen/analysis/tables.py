"""Analysis: labels and values of a result -> text, and HTML for notebooks."""

from __future__ import annotations

from collections.abc import Sequence

from ..limits.descriptions import SHOWN_COMPLEX
from ..texts import html_table


def number(value: complex, digits: int = 6) -> str:
    """A real or complex number as people read it."""
    value = complex(value)
    if abs(value.real) <= SHOWN_COMPLEX * abs(value.imag):  # rounding
        value = complex(0.0, value.imag)
    if abs(value.imag) <= SHOWN_COMPLEX * max(1.0, abs(value)):
        return f"{value.real:.{digits}g}"
    return f"{value.real:.{digits}g} {'+' if value.imag > 0 else '-'} {abs(value.imag):.{digits}g}j"


def as_text(title: str, facts: Sequence[tuple[str, str]]) -> str:
    """Several aligned lines."""
    width = max((len(label) for label, _ in facts), default=0)
    return "\n".join([title, *(f"  {label:<{width}}  {value}" for label, value in facts)])


def as_html(title: str, facts: Sequence[tuple[str, str]]) -> str:
    """A small table."""
    return html_table(title, facts)
