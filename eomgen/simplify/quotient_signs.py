"""Stage simplify: quotients x / |x| -> sign(x), which is the same wherever the quotient has a value.

At x = 0 the quotient has none; who prints signs says so.
"""

from __future__ import annotations

from fractions import Fraction

from .atoms import ONE, Atoms, Monomial, Number, Poly, add, inverse, join, multiply, ratio
from .expansion import divided

MADE = "sgn"  #: kind of the atoms for what was x / |x|


def with_signs(poly: Poly, atoms: Atoms) -> Poly:
    """A polynomial that is multiplied out, with the signs of what it divides by magnitudes of."""
    below = {a for m in poly for a, n in m if _is_below(a, n, atoms)}
    for atom in sorted(below):
        poly = _divided_by(poly, atom, atoms)
    return poly


def factors_with_signs(poly: Poly, atoms: Atoms) -> Poly:
    """The same of products of factored sums, each by itself."""
    result: Poly = {}
    for monomial, x in poly.items():
        below = [a for a, n in monomial if _is_below(a, n, atoms)]
        term: Poly = {monomial: x}
        for atom in below:
            ((m, y),) = term.items()
            term = _of_factor(m, y, atom, atoms) or term
        result = add(result, term)
    return result


def _is_below(atom: int, n: Fraction | int, atoms: Atoms) -> bool:
    return atoms.table[atom].kind == "abs" and n < 0 and n % 2 == 1


def _divided_by(poly: Poly, atom: int, atoms: Atoms) -> Poly:
    divisor = dict(atoms.table[atom].what[0])
    own = {a for m in divisor for a, _ in m}
    groups: dict[tuple[Monomial, Fraction | int], Poly] = {}
    for m, x in poly.items():
        power = dict(m).get(atom, 0)
        if _is_below(atom, power, atoms):
            outer = tuple(f for f in m if f[0] not in own and f[0] != atom)
            groups.setdefault((outer, power), {})[tuple(f for f in m if f[0] in own)] = x
    for (outer, power), above in groups.items():
        left, once = above, _quotient(above, divisor)
        rest = power
        while rest < 0 and once is not None and (twice := _quotient(once, divisor)) is not None:  # x^2 is |x|^2
            left, once, rest = twice, _quotient(twice, divisor), rest + 2
        if rest < 0 and once is not None:
            left, made = once, _sign(outer, rest, atom, atoms, "sum")
        else:
            made = {join(outer, ((atom, rest),)): 1}
        if left is not above:
            poly = add(poly, multiply(above, {join(outer, ((atom, power),)): 1}), -1)
            poly = add(poly, multiply(left, made))
    return poly


def _quotient(above: Poly, divisor: Poly) -> Poly | None:
    """The quotient; None where the divisor does not divide what is above."""
    if len(divisor) > 1:
        return divided(above, divisor)
    ((monomial, x),) = divisor.items()
    if any(dict(m).get(a, 0) < n for m in above for a, n in monomial):
        return None
    return multiply(above, {inverse(monomial): ratio(1, x)})


def _sign(outer: Monomial, power: Fraction | int, atom: int, atoms: Atoms, kind: str) -> Poly:
    """outer sign(x) |x|^(power + 1) of the magnitude |x| that is an atom; a sum in it is an atom of the kind."""
    rest = join(outer, ((atom, power + 1),)) if power != -1 else outer
    sign = atoms.id(MADE, atoms.table[atom].what)
    return {atoms.without_squared_signs(join(rest, ((sign, 1),)), kind): 1}


def _of_factor(monomial: Monomial, x: Number, atom: int, atoms: Atoms) -> Poly | None:
    """A product with the sign of what stands in it as a factor and in a magnitude below; None where none does."""
    power = dict(monomial)[atom]
    divisor = dict(atoms.table[atom].what[0])
    outer = tuple(f for f in monomial if f[0] != atom)
    if len(divisor) == 1:
        quotient = _quotient({outer: x}, divisor)
        return None if quotient is None else multiply(quotient, _sign((), power, atom, atoms, "factor"))
    for factor, n in outer:
        kind, what = atoms.table[factor]
        if kind == "factor" and n >= 1 and (times := _times(dict(what), divisor)) is not None:
            rest = join(outer, ((factor, -1),))
            return multiply({ONE: x * times}, _sign(rest, power, atom, atoms, "factor"))
    return None


def _times(a: Poly, b: Poly) -> Number | None:
    """The number a / b; None where it is none."""
    if a.keys() != b.keys():
        return None
    times = {ratio(a[m], b[m]) for m in a}
    return times.pop() if len(times) == 1 else None
