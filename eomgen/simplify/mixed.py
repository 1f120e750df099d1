"""Stage simplify: nodes -> sums of products that are kept as they were formed and of what is multiplied out.

A damper's force c r' (r - s) / r^2 reads best as the product that it is, the inertia beside it with its terms
collected.  Products of sums in which lengths stand, as those of springs and dampers, are kept where multiplying them
out makes them longer; what is inertia may cancel with other inertia.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import NamedTuple

from ..graph.traverse import reachable
from .atoms import ONE, SUMS, TURNS, Atoms, Poly, add, multiply, scaled
from .expansion import Expansion
from .factoring import Factoring
from .quotient_signs import factors_with_signs

PLAIN = ("sym", "pi", "name", *TURNS, *SUMS)  #: kinds of atoms of which inertia is made


class Parts(NamedTuple):
    """What a node is the sum of."""

    kept: Poly  #: products of factored sums
    out: Poly  #: multiplied out


class Mixed:
    """Sums of products that are kept and of what is multiplied out."""

    def __init__(self, expansion: Expansion, factoring: Factoring, simplified: Callable[[Poly], Poly]) -> None:
        self.expansion, self.factoring, self.simplified = expansion, factoring, simplified
        self.atoms: Atoms = expansion.atoms
        self._of: dict[int, Parts] = {}

    def put(self, i: int, poly: Poly) -> None:
        """Let a polynomial, such as a name, stand for a node from here on."""
        self._of[i] = Parts({}, poly)

    def form(self, i: int) -> Poly | None:
        """The form of a node; None where nothing is kept."""
        for k in reachable(self.expansion.graph, [i], stop=self._of):
            if k not in self._of:
                self._of[k] = self._parts(k)
        parts = self._of[i]
        return self._whole(parts) if parts.kept else None

    def _whole(self, parts: Parts) -> Poly:
        """Both together, with common factors taken out."""
        return self.factoring.factored(add(factors_with_signs(parts.kept, self.atoms), self.simplified(parts.out)))

    def _parts(self, i: int) -> Parts:
        kind, *args = self.expansion.graph.nodes[i]
        if kind not in ("add", "sub", "neg", "mul", "absorb", "div"):
            return Parts({}, self.expansion.expand(i))
        first, *rest = (self._of[k] for k in args)
        if kind == "neg":
            return Parts(scaled(first.kept, -1), scaled(first.out, -1))
        second = rest[0]
        if kind in ("add", "sub"):
            sign = 1 if kind == "add" else -1
            return Parts(add(first.kept, second.kept, sign), add(first.out, second.out, sign))
        if kind == "div":
            return self._quotient(i, first, args[1])
        return self._product(i, first, second)

    def _product(self, i: int, a: Parts, b: Parts) -> Parts:
        if not (a.kept and b.kept):
            few, many = (a, b) if not a.kept else (b, a)
            if many.kept:  # a sum of which some products are kept: each has one more factor
                return Parts(multiply(many.kept, self._factor(few)), self.expansion.times(many.out, few.out))
            if max(len(a.out), len(b.out)) < 2:
                return Parts({}, self.expansion.expand(i))
        if a.kept and b.kept:
            return Parts(multiply(self._factor(a), self._factor(b)), {})
        out = self.expansion.expand(i)
        if self._has_lengths(out):
            kept = multiply(self._factor(a), self._factor(b))
            costs = self.factoring.costs.of_terms
            if costs(kept) < costs(self.factoring.factored(self.simplified(out))):
                return Parts(kept, {})
        return Parts({}, out)

    def _has_lengths(self, poly: Poly) -> bool:
        """Whether there are roots, their squares, or functions other than sines and cosines."""
        return any(self._is_length(a, n) for m in poly for a, n in m)

    def _is_length(self, atom: int, n: Fraction | int) -> bool:
        return n != int(n) or atom in self.expansion.under_roots or self.atoms.table[atom].kind not in PLAIN

    def _quotient(self, i: int, above: Parts, below: int) -> Parts:
        if not above.kept:
            return Parts({}, self.expansion.expand(i))
        over = self.expansion.quotient({ONE: 1}, self.expansion.expand(below))
        if len(over) != 1:
            return Parts({}, self.expansion.expand(i))
        return Parts(multiply(above.kept, over), self.expansion.quotient(above.out, self.expansion.expand(below)))

    def _factor(self, parts: Parts) -> Poly:
        """One term, a sum in it being one factor."""
        whole = self._whole(parts)
        return whole if len(whole) < 2 else self.factoring.product(whole, one_term=True)
