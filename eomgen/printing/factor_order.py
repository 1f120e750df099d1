"""Printing, order: in what order textbooks print factors and terms.

Factors: number, masses and inertias, gravity, other parameters, coordinates and rates, sums, functions,
variations:
``m_1 l_1^2``, ``(m_1 + m_2) g l_1 sin(theta_1)``.  Terms: inputs, squares of rates, what has no rates, rates.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import sympy

NUMBER, MASS, INERTIA, INERTIAL_SUM, INPUT, GRAVITY, PARAMETER, SUM_OF_PARAMETERS = range(8)
NAMED, COORDINATE, RATE, SUM, FUNCTION, VARIATION = range(8, 14)
Key = tuple[Any, ...]


class Order:
    """The order of names, and what follows from it for factors and terms.

    Parameters
    ----------
    kinds : mapping of str to int
        Name -> one of the kinds of this file, in the order of declaration; names that are not in it are intermediates.
    """

    def __init__(self, kinds: Mapping[str, int]) -> None:
        self.kinds = {name: (kind, place) for place, (name, kind) in enumerate(kinds.items())}
        self._known: dict[Any, Key] = {}

    def of_name(self, name: str) -> Key:
        """Kind and place of a name."""
        return self.kinds.get(name) or (NAMED, len(self.kinds), _natural(name))

    def of_factor(self, factor: Any) -> Key:
        """What factors are sorted by."""
        if factor not in self._known:
            self._known[factor] = self._of_factor(factor)
        return self._known[factor]

    def _of_factor(self, factor: Any) -> Key:
        if factor.is_Number or factor.is_NumberSymbol:
            return (NUMBER,)
        if factor.is_Symbol:
            return self.of_name(factor.name)
        if factor.is_Pow and factor.base.is_Symbol and factor.exp.is_Number:
            return self.of_factor(factor.base)
        names = sorted(self.of_name(str(symbol)) for symbol in factor.free_symbols)
        if type(factor).__name__ == "delta":
            return (VARIATION, *names)
        if factor.atoms(sympy.Function) or not names:
            return (FUNCTION, len(names), *names)
        if names[-1][0] <= PARAMETER:
            inertial = names[0][0] in (MASS, INERTIA)
            return (INERTIAL_SUM if inertial else SUM_OF_PARAMETERS, len(names), *names)
        return (SUM, len(names), *names)

    def of_term(self, term: Any) -> Key:
        """What terms are sorted by."""
        degree = rates = 0
        keys: list[Key] = []
        for factor in sympy.Mul.make_args(term):
            base, exponent = factor.as_base_exp() if factor.is_Pow else (factor, sympy.S.One)
            key = self.of_factor(base)
            times = int(exponent) if exponent.is_Integer and 0 < exponent < 10 else 1
            if key[0] == NUMBER:
                continue
            degree += times
            keys += [key] * times
            if any(self.of_name(str(s))[0] == RATE for s in base.free_symbols):
                rates += times if base.is_Symbol else max(times, _degree(base, self._is_rate))
        keys.sort()
        given = any(key[0] == INPUT for key in keys)
        family = 0 if given else (2, 3, 1)[min(rates, 2)]
        heavy = not keys or keys[0][0] > INERTIAL_SUM
        function = bool(keys) and keys[-1][0] >= FUNCTION
        return (family, heavy, function, degree, _flat(keys))

    def _is_rate(self, symbol: Any) -> bool:
        return bool(self.of_name(str(symbol))[0] == RATE)

    def factors(self, factors: Iterable[Any]) -> list[Any]:
        """Factors in order."""
        return sorted(factors, key=lambda f: (_flat([self.of_factor(f)]), sympy.default_sort_key(f)))

    def terms(self, terms: Iterable[Any]) -> list[Any]:
        """Terms in order; the first is not subtracted if one is added."""
        found = sorted(terms, key=lambda x: (self.of_term(x), sympy.default_sort_key(x)))
        added = next((k for k, term in enumerate(found) if not is_subtracted(term)), 0)
        return [found[added], *found[:added], *found[added + 1 :]]


def is_subtracted(term: Any) -> bool:
    """Whether the number in front of a term is negative."""
    return bool(term.as_coeff_Mul()[0].is_negative)


def _degree(expression: Any, counts: Any) -> int:
    """Degree of a sum of products in the symbols that count, as far as it is seen without expansion."""
    degrees = [0]
    for term in sympy.Add.make_args(expression):
        degree = 0
        for factor in sympy.Mul.make_args(term):
            base, exponent = factor.as_base_exp() if factor.is_Pow else (factor, sympy.S.One)
            if base.is_Symbol and counts(base) and exponent.is_Integer:
                degree += int(exponent)
            elif base.is_Add:
                degree += _degree(base, counts)
        degrees.append(degree)
    return max(degrees)


def _natural(name: str) -> Key:
    """``z9`` before ``z10``."""
    letters = name.rstrip("0123456789")
    return (letters, int(name[len(letters) :] or 0))


def _flat(keys: Iterable[Any]) -> tuple[str, ...]:
    """Keys of different shapes as texts that can be compared."""
    found: list[str] = []
    for key in keys:
        if isinstance(key, tuple):
            found += _flat(key)
        else:
            found.append(f"{key:06d}" if isinstance(key, int) else str(key))
    return tuple(found)
