"""Stage simplify: fractions in a sum that a denominator divides exactly -> without that denominator.

Of (2 a + a b + 4 x + 2 b x) / (2 + b) remains a + 2 x.  Terms are divided together with those that differ from them in
symbols of the denominator alone.
"""

from __future__ import annotations

from fractions import Fraction

from .atoms import Atoms, Monomial, Poly, add, join, multiply
from .expansion import divided


def without_exact_quotients(poly: Poly, atoms: Atoms) -> Poly:
    """The same polynomial, with what its denominators divide divided by them.

    Parameters
    ----------
    poly : Poly
    atoms : Atoms
        What it is made of; denominators of several terms are atoms of kind ``sum``.
    """
    below = {a for m in poly for a, n in m if n <= -1 and atoms.table[a].kind == "sum"}
    for atom in sorted(below):
        poly = _divided_by(poly, atom, atoms)
    return poly


def _divided_by(poly: Poly, atom: int, atoms: Atoms) -> Poly:
    divisor: Poly = dict(atoms.table[atom].what)
    if len(divisor) < 2:
        return poly
    own = {a for m in divisor for a, _ in m}
    groups: dict[tuple[Monomial, Fraction | int], Poly] = {}
    for m, x in poly.items():
        power = next((n for a, n in m if a == atom), 0)
        if power <= -1:
            outer = tuple(f for f in m if f[0] not in own and f[0] != atom)
            group = groups.setdefault((outer, power), {})
            group[tuple(f for f in m if f[0] in own)] = x
    for (outer, power), above in groups.items():
        quotient = divided(above, divisor) if above else None
        if quotient is not None:
            rest = ((atom, power + 1),) if power != -1 else ()
            poly = add(poly, multiply(above, {join(outer, ((atom, power),)): 1}), -1)
            poly = add(poly, multiply(quotient, {join(outer, rest): 1}))
    return poly
