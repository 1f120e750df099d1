"""Stage describe, writing given equations: large SymPy expressions -> shorter ones with named intermediates."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import count
from typing import Any

from .description import items
from .sympy_face import function_name, is_sympy

LARGE = 200  #: operations of an expression from which the section is written with intermediates


def with_intermediates(equations: Mapping[str, Any]) -> Mapping[str, Any]:
    """The section with the common parts of its expressions named, if one of them is large."""
    found = [x for x in _parts(equations) if is_sympy(x)]
    if not found or max(int(x.count_ops()) for x in found) < LARGE:
        return equations
    import sympy
    from sympy.core.function import AppliedUndef

    inside: dict[Any, Any] = {}
    for name, part in equations.get("intermediates", {}).items():
        if not is_sympy(part):
            return equations
        inside[sympy.Symbol(name)] = part.xreplace(inside)
    equations = {key: value for key, value in equations.items() if key != "intermediates"}
    found = [x.xreplace(inside) for x in _parts(equations) if is_sympy(x)]

    plain: dict[Any, Any] = {}
    names: set[str] = set()
    for expression in found:
        names |= {symbol.name for symbol in expression.atoms(sympy.Symbol)}
        for part in expression.atoms(AppliedUndef, sympy.Derivative):
            if (name := function_name(part)) is not None:
                plain[part] = sympy.Symbol(name)
    # a velocity may hold the function of its coordinate inside
    rates = {part: symbol for part, symbol in plain.items() if isinstance(part, sympy.Derivative)}
    names |= {symbol.name for symbol in plain.values()}
    free = (sympy.Symbol(f"z{k}") for k in count(1) if f"z{k}" not in names)
    common, short = sympy.cse([x.xreplace(rates).xreplace(plain) for x in found], symbols=free, order="none")
    replaced = iter(short)
    result: dict[str, Any] = {}
    for key, value in equations.items():
        if key == "mass_matrix":
            result["intermediates"] = {str(symbol): expression for symbol, expression in common}
        result[key] = _rebuilt(value, replaced)
    return result


def _parts(value: Any) -> Iterator[Any]:
    """All scalars of a section, in order."""
    listed = None if is_sympy(value) else items(value)
    if isinstance(value, Mapping):
        for inner in value.values():
            yield from _parts(inner)
    elif listed is not None:
        for inner in listed:
            yield from _parts(inner)
    else:
        yield value


def _rebuilt(value: Any, replaced: Iterator[Any]) -> Any:
    listed = None if is_sympy(value) else items(value)
    if isinstance(value, Mapping):
        return {key: _rebuilt(inner, replaced) for key, inner in value.items()}
    if listed is not None:
        return [_rebuilt(inner, replaced) for inner in listed]
    return next(replaced) if is_sympy(value) else value
