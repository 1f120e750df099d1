"""Stage runtime: an expression as text -> a :class:`~.formulas.Formula`, where there is a parser."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..errors import MissingDependencyError

if TYPE_CHECKING:
    from .formulas import Formula
    from .layout import Layout


def is_formula(value: Any) -> bool:
    """Whether what a user gives is an expression as text."""
    return isinstance(value, str)


def read_formula(layout: Layout, text: str, what: str, beside: Formula | None = None) -> Formula:
    """An expression as text; see :class:`~.formulas.Formula`.

    Raises
    ------
    MissingDependencyError
        In a generated package, which has no parser.
    UsageError
        It is no expression, or has a name that the model does not know.
    """
    try:
        from .formulas import Formula
    except ImportError:
        raise MissingDependencyError(
            f"{what}: an expression as text needs eomgen to read it: pip install eomgen, or give a function f(t, x)"
        ) from None
    return Formula(layout, text, what, beside)
