"""Analysis: labels and values of a result -> text, and HTML for notebooks."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

from ..base.limits.numbers import SHOWN, SHOWN_COMPLEX
from ..base.texts import aligned_rows, html_table


def number(value: complex, digits: int = 6) -> str:
    """A real or complex number as people read it."""
    value = complex(value)
    if abs(value.real) <= SHOWN_COMPLEX * abs(value.imag):  # rounding
        value = complex(0.0, value.imag)
    if abs(value.imag) <= SHOWN_COMPLEX * max(1.0, abs(value)):
        return f"{value.real:.{digits}g}"
    return f"{value.real:.{digits}g} {'+' if value.imag > 0 else '-'} {abs(value.imag):.{digits}g}j"


def without_noise(
    values: Sequence[float], units: Sequence[str] | None = None, sizes: Sequence[float] | None = None
) -> list[float]:
    """Values for a table, 0 where one is nothing beside the largest of its unit.

    Parameters
    ----------
    values : sequence of float
    units : sequence of str, optional
        Of each; one for all by default.
    sizes : sequence of float, optional
        What each value is like elsewhere, over a run for instance; by default the values themselves.
    """
    units = units or [""] * len(values)
    largest = dict.fromkeys(units, 0.0)
    for unit, size in zip(units, sizes if sizes is not None else values, strict=True):
        largest[unit] = max(largest[unit], abs(size)) if isfinite(size) else largest[unit]
    return [0.0 if abs(x) <= SHOWN * largest[unit] else float(x) for x, unit in zip(values, units, strict=True)]


def as_text(title: str, facts: Sequence[tuple[str, str]]) -> str:
    """Several aligned lines."""
    return "\n".join([title, *aligned_rows(facts)])


def as_html(title: str, facts: Sequence[tuple[str, str]]) -> str:
    """A small table."""
    return html_table(title, facts)
