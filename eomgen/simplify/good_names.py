"""Stage simplify: names of intermediates that say what they are: c_12 = cos(q1 + q2), m_12 = m1 + m2, k0 a constant."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from fractions import Fraction

from .atoms import SUMS, TURNS, Atoms, Poly
from .costs import Costs
from .inline import NAME, Named

NUMBERED = re.compile(r"([A-Za-z]+?)_?(\d+)")
LETTERED = re.compile(r"([A-Za-z]+)_([A-Za-z])")
ROOT, BELOW = "r", "D"  #: begin names of roots and of denominators
LONG = 30.0  #: length of a root or denominator from which it is worth a name
CONSTANT = "k"  #: begins names of what parameters and numbers alone give


class GoodNames:
    """Chooses names.

    Attributes
    ----------
    turns : dict of int to str
        Sines and cosines, by atom, that are worth a name.
    intermediates : dict of str to str
        Better names of intermediates.
    roots : dict of int to (str, int)
        Long sums that stand in several roots and denominators, by atom: the name of their root, and 2; of the sum
        itself, and 1, where no root is taken.
    """

    def __init__(self, atoms: Atoms, costs: Costs, parameters: Collection[str], taken: Collection[str]) -> None:
        self.atoms, self.costs, self.parameters = atoms, costs, parameters
        self._taken = set(taken)
        self.turns: dict[int, str] = {}
        self.intermediates: dict[str, str] = {}
        self.roots: dict[int, tuple[str, int]] = {}

    def choose_roots(self, named: Named, polys: Sequence[Poly]) -> None:
        """Of a form, the long sums that are written several times in roots and denominators."""
        uses: Counter[int] = Counter()
        in_root: set[int] = set()
        for poly in (*(poly for _, poly in named), *polys):
            for atom, n in self.powers(poly):
                if n < 0 or n != int(n):
                    uses[atom] += 1
                    in_root.update([atom] if n != int(n) else [])
        for atom, count in sorted(uses.items()):
            length = self.costs.of_atom(atom)
            if length >= LONG and (count - 1) * length > 2 * count + NAME:
                name = self._free(ROOT if atom in in_root else BELOW)
                self.roots[atom] = name, 2 if atom in in_root else 1
                self._taken.add(name)

    def powers(self, poly: Poly) -> Iterator[tuple[int, Fraction | int]]:
        """Sums that stand in products in a sum, with their exponents, those in its factors included."""
        for monomial in poly:
            for atom, n in monomial:
                kind, what = self.atoms.table[atom]
                if kind in SUMS:
                    yield atom, n
                    yield from self.powers(dict(what))

    def choose(self, named: Named, polys: Sequence[Poly], prefix: str) -> None:
        """Of a form with intermediates, those that begin with ``prefix`` and a number get better names."""
        every = [*(poly for _, poly in named), *polys]
        for atom, uses in sorted(Counter(a for poly in every for a in self._turns(poly)).items()):
            name = self._of_turn(atom)
            saved = uses * (self.costs.of_atom(atom) - len(name)) - self.costs.of_atom(atom) - NAME
            if saved > 0 and name not in self._taken:
                self.turns[atom] = name
                self._taken.add(name)
        numbered = re.compile(re.escape(prefix) + r"\d+")
        self._taken -= {text for atom, _ in named if numbered.fullmatch(text := self.atoms.table[atom].what)}
        constant: set[int] = set()
        for atom, poly in named:
            text = self.atoms.table[atom].what
            if self._is_constant(poly, constant):
                constant.add(atom)
            if numbered.fullmatch(text):
                better = self._of_sum(poly)
                if better is None or better in self._taken:
                    better = self._free(CONSTANT if atom in constant else prefix)
                self.intermediates[text] = better
                self._taken.add(better)

    def _turns(self, poly: Poly) -> Iterator[int]:
        """Sines and cosines in a sum, those in its factors included."""
        for monomial in poly:
            for atom, _ in monomial:
                kind, what = self.atoms.table[atom]
                if kind in TURNS:
                    yield atom
                elif kind in SUMS:
                    yield from self._turns(dict(what))

    def _of_turn(self, atom: int) -> str:
        kind, angle = self.atoms.table[atom]
        symbols = [self.atoms.table[a] for monomial, _ in angle for a, _ in monomial]
        plain = all(x in (1, -1) and len(monomial) == 1 and monomial[0][1] == 1 for monomial, x in angle)
        if not plain or any(s.kind != "sym" for s in symbols):
            return self._free(kind[0])
        parts = [NUMBERED.fullmatch(s.what) for s in symbols]
        signs = "".join("" if x > 0 else "m" for _, x in angle)
        if all(parts) and len({p[1] for p in parts if p}) == 1 and not signs:
            digits = [p[2] for p in parts if p]
            return f"{kind[0]}_{('' if max(map(len, digits)) == 1 else '_').join(digits)}"
        return f"{kind[0]}_" + "_".join(
            ("" if x > 0 else "m") + s.what for s, (_, x) in zip(symbols, angle, strict=True)
        )

    def _of_sum(self, poly: Poly) -> str | None:
        """m_12 of m1 + m2, m_FR of m_F + m_R."""
        if any(
            x != 1 or len(m) != 1 or m[0][1] != 1 or self.atoms.table[m[0][0]].kind != "sym" for m, x in poly.items()
        ):
            return None
        names = [self.atoms.table[m[0][0]].what for m in poly]
        for pattern in (NUMBERED, LETTERED):
            parts = [part for name in names if (part := pattern.fullmatch(name))]
            if len(parts) == len(names) > 1 and len({part[1] for part in parts}) == 1:
                below = [part[2] for part in parts]
                return f"{parts[0][1]}_{('' if max(map(len, below)) == 1 else '_').join(below)}"
        return None

    def _is_constant(self, poly: Poly, constant: set[int]) -> bool:
        """Whether parameters and numbers alone are in it."""
        table = ((a, *self.atoms.table[a]) for a in self.atoms.all_in(poly))
        return not any(
            (kind == "sym" and what not in self.parameters) or (kind == "name" and a not in constant)
            for a, kind, what in table
        )

    def _free(self, stem: str) -> str:
        return next(name for k in range(10**9) if (name := f"{stem}{k}") not in self._taken)
