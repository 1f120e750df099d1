"""Equations and a level -> formulas in their notation, with a record of what was shown."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import sympy

from ..errors import UnavailableError
from ..expr.core import Expr
from ..expr.notation import Notation, literal
from ..expr.printing.formula import ROUNDED, Formula, Formulas, Letter, number
from ..mechanics.report import plane_axis
from ..model.components import with_instance
from ..reading import ReadingView
from ..reading.document import Folded, FormulaLine, Piece, Sentence
from ..reading.printed import order_of
from ..reading.quantities import Quantities, Written, needed

WHOLE = 160  #: nodes of a matrix up to which it is shown as a matrix, not entry by entry
FOLD = 900  #: nodes of a quantity from which a page shows it only on request
MOST = 9_000  #: nodes of a quantity that is left out
LINES = 14  #: formulas of one quantity from which a page shows them only on request
COLUMNS = 6  #: of a matrix that is shown as one
#: Letters of scalars, and those that take their places.
LETTERS = {
    "T": r"E_{\mathrm{kin}}",
    "V": r"E_{\mathrm{pot}}",
    "L": r"\mathrm{Lagrangian}",
    "S": r"\mathrm{Gibbs}",
    "H": r"\mathrm{Hamiltonian}",
    "M": r"\mathbf{M}",
    "f": r"\mathbf{f}",
}


class PrintedQuantity(NamedTuple):
    """A quantity that stands in the document: its name and part for readers, and its entries with their left sides."""

    name: str
    part: str | None
    named: Sequence[tuple[Any, Any]]
    entries: Sequence[tuple[str, Any]]


class Author:
    """Writes the quantities of equations as pieces of a document, on request only the equations of motion.

    ``source`` is what was derived, of which the equations may be a view, ``substituted`` the values of parameters and
    inputs that stand for them; None where other parameters leave them open.
    """

    def __init__(self, equations: Any, full: bool) -> None:
        self.equations, self.full = equations, full
        self.source: Any = equations.source if isinstance(equations, ReadingView) else equations
        self.substituted: Mapping[str, float | None] = equations.numbers_substituted()
        self.mechanism = equations.kinematics.mechanism
        self.names: Notation = equations.notation
        self._formula = Formulas(order_of(equations), digits=ROUNDED)
        self.printed: list[PrintedQuantity] = []
        self.formed: list[tuple[str, Sequence[Expr], Written]] = []
        self._explained: list[tuple[Any, Any]] = []

    @cached_property
    def plane(self) -> int | None:
        """The ground axis across which a plane mechanism moves, which is one of the same name of all bodies."""
        axis = plane_axis(self.equations.kinematics)
        bodies = [body.name for body in self.mechanism.bodies]
        if axis is None or any(self.equations.poses[name][axis, axis] != 1 for name in bodies):
            return None
        return axis

    @property
    def within(self) -> list[int]:
        """The ground axes along which bodies move."""
        return [k for k in range(3) if k != self.plane]

    # -- names --------------------------------------------------------------------------------------------------------
    def of(self, letter: str, name: str) -> str:
        r"""LaTeX of a letter that belongs to something of the model: ``m_{\mathrm{rod}}``.

        Where a name of the model is printed so, the word stands above: ``m^{\mathrm{rod}}``.
        """
        return str(self.equations.notation.letter(with_instance(letter, name), f"{letter}^{{{literal(name)}}}"))

    def letter(self, standard: str) -> str:
        r"""LaTeX of a letter of ``LETTERS``, or what takes its place where a name of the model is printed so."""
        return str(self.equations.notation.letter(standard, LETTERS[standard]))

    def symbol(self, name: str) -> str:
        """LaTeX of a name of the model."""
        return self.names.latex(name)

    def variation(self, name: str) -> Any:
        """The variation of a coordinate in SymPy, printed with a delta."""
        return sympy.Function("delta")(sympy.Symbol(name))

    @property
    def independent_velocities(self) -> list[str]:
        """Names of the velocities of the independent coordinates."""
        k = self.equations.kinematics
        return [k.velocity_names[k.velocity_labels.index(name)] for name in self.equations.independent]

    # -- quantities ---------------------------------------------------------------------------------------------------
    def quantity(
        self,
        left: str,
        name: str,
        part: str | None = None,
        pick: Callable[[Any], Any] | None = None,
    ) -> list[Piece]:
        """A quantity by name, and its formula; a sentence where the method does not have it.

        ``left`` is the LaTeX of the left side, ``pick`` chooses what of the value is shown.
        """
        try:
            named, value = self.equations.written(name, part)
        except UnavailableError as error:
            return [Sentence(f"Not shown: {str(error).partition(chr(10))[0]}.")]
        return self.formulas(left, value if pick is None else pick(value), named, (name, part))

    def formulas(
        self,
        left: str,
        value: Any,
        named: Sequence[tuple[Any, Any]] = (),
        key: tuple[str, str | None] = ("", None),
        symmetric: bool = False,
        explained: Collection[Any] = (),
    ) -> list[Piece]:
        """Named parts, save those in ``explained``, and the formula of an expression or matrix.

        Large ones are folded or left out; of a symmetric matrix entry by entry, those above the diagonal are.
        """
        if isinstance(value, sympy.MatrixBase) and len(value) == 1:
            value = value[0]
        named = needed(named, value)
        size = sum(map(nodes, (x for _, x in named))) + nodes(value)
        if size > MOST:
            where = f"`eqs.{key[0]}`" if key[0] else "the attributes of the equations"
            return [Sentence(f"${left}$ is left out: it has {size} terms and factors; {where} gives it as SymPy.")]
        self.names = self.names.with_names(str(symbol) for symbol, _ in named)
        entries = list(self._entries(left, value, symmetric))
        self.printed.append(PrintedQuantity(*key, named, entries))
        result: list[Piece] = [self.line(s, x) for s, x in named if s not in explained]
        if not isinstance(value, sympy.MatrixBase) or (
            size <= WHOLE and value.cols <= COLUMNS and value.rows <= 2 * COLUMNS
        ):
            result.append(self.line(left, value))
        else:
            result += [self.line(*entry) for entry in entries]
            rest = len(value) - len(entries)
            if rest:
                same = ", or are above the diagonal of a symmetric matrix" if symmetric else ""
                result.append(Sentence(f"The other {rest} entries of ${left}$ are 0{same}."))
        if size > FOLD or len(result) > LINES:
            return [Folded(f"${left}$: {size} terms and factors", tuple(result))]
        return result

    def balance(self, left: Any, right: Any, named: Sequence[tuple[Any, Any]]) -> list[Piece]:
        """An equation between two expressions, with the named parts that it uses and that were not shown before."""
        parts = [pair for pair in needed(named, sympy.Matrix([left, right])) if pair not in self._explained]
        self.names = self.names.with_names(str(symbol) for symbol, _ in parts)
        self._explained += parts
        return [*(self.line(*pair) for pair in parts), self.line(left, right)]

    def line(self, *sides: Any) -> FormulaLine:
        """A line of formulas, each LaTeX, a SymPy expression or matrix, or a number."""
        return FormulaLine(tuple(map(self._side, sides)))

    def in_numbers(self, left: str, expression: Any, numbers: Mapping[str, float], value: float) -> FormulaLine:
        """The line of a calculation by hand: left side = expression with its numbers = value."""
        if not expression.free_symbols or not expression.args:
            return self.line(left, value)
        return FormulaLine((Letter(left), Formulas(self._formula.order, numbers, ROUNDED)(expression), number(value)))

    def _side(self, side: Any) -> Formula:
        if isinstance(side, str):
            return Letter(side)
        return number(side) if isinstance(side, float | int) else self._formula(side)

    def form(self, what: str, choose: Callable[[Quantities], Sequence[Expr]], prefix: str) -> Written:
        """Expressions that no attribute has, formed in a copy of the graph; ``what`` calls them in the comparison."""
        return self.write(what, list(choose(Quantities(*self.equations.fresh()))), prefix)

    def write(self, what: str, expressions: Sequence[Expr], prefix: str = "z") -> Written:
        """Expressions in SymPy, kept to be compared with what they were."""
        expressions = self.equations.with_values(expressions)
        written: Written = self.equations.in_sympy(expressions, prefix)
        self.formed.append((what, expressions, written))
        return written

    def _entries(self, left: str, value: Any, symmetric: bool) -> Iterator[tuple[str, Any]]:
        """Left sides and values of the entries that do not vanish."""
        if not isinstance(value, sympy.MatrixBase):
            yield left, value
            return
        column = value.cols == 1
        for i in range(value.rows):
            for j in range(i + 1 if symmetric else value.cols):
                if value[i, j] != 0:
                    place = str(i + 1) if column else f"{i + 1},{j + 1}"
                    whole = rf"({left})" if "_" in left else left
                    yield rf"{whole}_{{{place}}}" if value.rows * value.cols > 1 else left, value[i, j]


def nodes(value: Any) -> int:
    """Terms, factors and symbols of an expression or matrix."""
    flat = list(value) if isinstance(value, sympy.MatrixBase) else [value]
    return sum(1 for x in flat for _ in sympy.preorder_traversal(x))
