"""SymPy expressions -> graph, names -> SymPy symbols; SymPy loads on first use."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ..base.texts import shown
from ..errors import ExpressionError, ModelError, Problem, ill_typed
from ..expr.shown import parts_of, quoted, shortened
from .description import items

if TYPE_CHECKING:
    from ..expr.core import Expr, Graph

Resolve = Callable[[str], "Expr"]


def require_name(what: str, name: Any) -> str:
    """The name that was given for something; UsageError if it is no text."""
    if not isinstance(name, str):
        raise ill_typed(f"{what}: a name is a text, such as 'A', not {shown(name)}")
    return name


def named(what: str, given: Any) -> dict[Any, Any]:
    """Values by name, of a mapping by symbol or name; none of None.

    Raises
    ------
    UsageError
        It is no mapping.
    """
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        raise ill_typed(f"{what} must be a mapping of names to values, such as {{'m': 2.0}}, not {shown(given)}")
    return {require_name(what, name_of(key)): value for key, value in given.items()}


def one_or_several(given: Any) -> list[Any]:
    """The items of a list, array, set, view of a mapping or generator; anything else is one item, None none."""
    if given is None:
        return []
    if (listed := items(given)) is not None:
        return listed
    one = isinstance(given, str | bytes | Mapping) or hasattr(given, "tolist")  # an array without axes
    return [given] if one or not isinstance(given, Iterable) else list(given)


def names_of(path: str, given: Any, what: str) -> list[str]:
    """Names of what is given as symbols, functions of time or texts, one or several; none of None.

    Raises
    ------
    ModelError
        Something else is among them.
    """
    listed = one_or_several(given)
    remedy = "give symbols q or functions q(t) of the time t"
    wrong = [
        Problem(f"{path}[{k}]", f"{shortened(q)} is not {what}", remedy, code="EG-TYPE")
        for k, q in enumerate(listed)
        if not isinstance(q, str) and sympy_name(q) is None
    ]
    if wrong:
        raise ModelError(wrong)
    return [name_of(q) for q in listed]


def symbol(name: str) -> Any:
    """The plain SymPy symbol that stands for a name."""
    import sympy

    return sympy.Symbol(require_name("symbol", name))


def function(name: str) -> Any:
    """The SymPy function that stands for a declared function."""
    import sympy

    return sympy.Function(name)


def is_sympy(value: object) -> bool:
    """Whether a value is a SymPy object; never imports SymPy."""
    sympy = sys.modules.get("sympy")
    return sympy is not None and isinstance(value, sympy.Basic)


def values_in(given: Any, keys: bool = False) -> Iterator[Any]:
    """Texts and SymPy expressions in lists, matrices and mappings, of these the keys too if asked for."""
    if isinstance(given, str) or is_sympy(given):
        yield given
        return
    parts = (*(given if keys else ()), *given.values()) if isinstance(given, Mapping) else items(given) or ()
    for part in parts:
        yield from values_in(part, keys)


def with_sympy(value: Any, change: Callable[[Any], Any]) -> Any:
    """A value whose SymPy expressions are changed, whatever lists and mappings they stand in."""
    if is_sympy(value):
        return change(value)
    if isinstance(value, Mapping):
        return {key: with_sympy(part, change) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return getattr(value, "_make", type(value))(with_sympy(part, change) for part in value)
    if hasattr(value, "todok"):  # a mutable matrix of SymPy
        return type(value)(*value.shape, [with_sympy(part, change) for part in value])
    listed = items(value)
    return value if listed is None else [with_sympy(part, change) for part in listed]


def name_of(value: object) -> Any:
    """The name behind a coordinate given as a symbol or as a function of time; else a text that is no name.

    Texts, numbers and plain lists are left as they are.
    """
    if value is None or isinstance(value, str | int | float | list | tuple | dict):
        return value
    return sympy_name(value) or quoted(value)


def sympy_name(value: object) -> str | None:
    """The name of a SymPy symbol or function of time; None for anything else."""
    if not is_sympy(value):
        return None
    if isinstance(value, sys.modules["sympy"].Symbol):
        return str(value.name)
    return function_name(value)


def in_order(given: Mapping[Any, Any], known: Sequence[str]) -> list[tuple[Any, Any]]:
    """Names and values of a mapping in the order of the known names, others last, however it was written."""
    places = {name: k for k, name in enumerate(known)}
    named = [(name_of(key), value) for key, value in given.items()]
    return sorted(named, key=lambda pair: places.get(pair[0], len(places)))


def function_name(value: Any) -> str | None:
    """``"q"`` for ``q(t)`` and ``"q_dot"``, ``"q_ddot"`` for its derivatives; None for anything else."""
    from sympy import Derivative
    from sympy.core.function import AppliedUndef

    if isinstance(value, AppliedUndef):
        return str(value.func.__name__) if _is_time(value.args) else None
    if isinstance(value, Derivative) and isinstance(value.expr, AppliedUndef) and _is_time(value.expr.args):
        (variable, order), *rest = value.variable_count
        if not rest and _is_time((variable,)) and order in (1, 2):
            return f"{value.expr.func.__name__}_{'d' * int(order)}ot"
    return None


def _is_time(arguments: Any) -> bool:
    return len(arguments) == 1 and getattr(arguments[0], "name", None) == "t"


def lower_sympy(graph: Graph, expression: Any, resolve: Resolve) -> Expr:
    """The graph expression of a SymPy expression.

    Parameters
    ----------
    graph : Graph
    expression : sympy.Expr
        In plain symbols, in functions of time ``q(t)`` with their derivatives, or both.
    resolve : callable
        Gives the expression of a name.

    Returns
    -------
    Expr

    Raises
    ------
    ExpressionError
        The expression has a part without a meaning.
    """
    from ..expr.sympy_bridge import LoweringError, lower

    def meaning(part: Any) -> Expr | None:  # declared functions, also f(t), are calls and do not come here
        name = sympy_name(part)
        return None if name is None else resolve(name)

    try:
        return lower(graph, expression, meaning)
    except LoweringError as error:
        raise ExpressionError(error.reason.replace("\n", "; ")) from None


def _parts(expressions: list[Any]) -> Iterator[Any]:
    """Every part of the SymPy expressions among the values."""
    for expression in expressions:
        if is_sympy(expression):
            yield from parts_of(expression)


def free_names(expressions: list[Any]) -> list[str]:
    """Names of all symbols in SymPy expressions, the time excepted, sorted."""
    import sympy

    return sorted({part.name for part in _parts(expressions) if isinstance(part, sympy.Symbol)} - {"t"})


def function_names(expressions: list[Any]) -> list[str]:
    """Names of all functions of time in SymPy expressions, sorted."""
    from sympy.core.function import AppliedUndef

    calls = (part for part in _parts(expressions) if isinstance(part, AppliedUndef))
    return sorted({name for call in calls if (name := function_name(call))})


def derivative_names(expressions: list[Any]) -> list[str]:
    """Names of all derivatives of functions of time in SymPy expressions, sorted."""
    import sympy

    slopes = (part for part in _parts(expressions) if isinstance(part, sympy.Derivative))
    return sorted({name for slope in slopes if (name := function_name(slope))})
