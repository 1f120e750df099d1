"""Stage simplify: nodes of a graph -> products of sums as the derivation formed them, nothing multiplied out."""

from __future__ import annotations

from fractions import Fraction

from ..graph.traverse import reachable
from .atoms import ONE, Poly, add, constant, freeze, inverse, multiply, number, scaled
from .expansion import Expansion
from .quotient_signs import factors_with_signs


class Literal:
    """Forms of nodes as they stand; sums in products are atoms of kind ``factor``."""

    def __init__(self, expansion: Expansion) -> None:
        self.expansion = expansion
        self.atoms = expansion.atoms
        self._of: dict[int, Poly] = {}

    def put(self, i: int, poly: Poly) -> None:
        """Let a polynomial, such as a name, stand for a node from here on."""
        self._of[i] = poly

    def form(self, i: int) -> Poly:
        """The form of a node."""
        graph = self.expansion.graph
        for k in reachable(graph, [i], stop=self._of):
            if k not in self._of:
                self._of[k] = self._formed(*graph.nodes[k])
        return self._of[i]

    def _formed(self, kind: str, *args: object) -> Poly:
        if kind == "const":
            value, of_pi = number(args[0])  # type: ignore[arg-type]
            return {((self.atoms.id("pi", ""), 1),): value} if of_pi else constant(value)
        if kind == "sym":
            return self.atoms.poly("sym", args[0])
        parts = [self._of[k] for k in args]  # type: ignore[index]
        if kind in ("add", "sub"):
            return add(parts[0], parts[1], 1 if kind == "add" else -1)
        if kind == "neg":
            return scaled(parts[0], -1)
        if kind in ("mul", "absorb"):
            product = multiply(self._one_term(parts[0]), self._one_term(parts[1]))
            product = dict(
                self.atoms.over_roots(self.atoms.without_squared_signs(m, "factor"), x) for m, x in product.items()
            )
            return factors_with_signs(product, self.atoms)
        if kind == "div" and parts[1]:
            ((below, x),) = self._one_term(parts[1]).items()
            quotient = multiply(self._one_term(parts[0]), {inverse(below): Fraction(1) / x})
            return factors_with_signs(quotient, self.atoms)
        if kind == "sqrt" and parts[0] and next(iter(parts[0])) != ONE:
            return {((self.atoms.id("factor", freeze(parts[0])), Fraction(1, 2)),): 1}
        if kind in ("sin", "cos"):
            return self.expansion.angles.of_angle(kind, self.expansion.angles.simplified(parts[0]))
        return self.atoms.poly(kind, tuple(freeze(p) for p in parts))

    def _one_term(self, poly: Poly) -> Poly:
        return poly if len(poly) < 2 else self.atoms.poly("factor", freeze(poly))
