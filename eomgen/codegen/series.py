"""The right-hand side -> terms whose Taylor coefficients along the motion follow from each other.

Each operation has a recurrence for its coefficient of order k, from lower ones and its operands' up to k:
A. Griewank, A. Walther, Evaluating Derivatives, 2008, section 13.2; A. Jorba, M. Zou, Exp. Mathematics 14, 2005.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

from ..base.operations import CONDITION, OPERATIONS
from ..expr.core import Node, reachable
from .program import Block, Program

#: Highest order that a step may have; enough for tolerances near the rounding of doubles.
MOST_ORDER = 23
#: Right-hand sides of more terms have no series: DOP853 is faster then, as work grows with the square of the order.
MOST_TERMS = 600


class Term(NamedTuple):
    """One value along the motion."""

    kind: str  #: an operation of the graph, or "number", "given" (constant along the motion), "time", "state"
    operands: tuple[int, ...] = ()  #: earlier terms
    #: of functions, one an operand: sign, and the term that multiplies the operand's rate, -1 for 1; the sum of these
    #: products is the rate, or is divided by the term `divisor`.  They may be later ones
    numerators: tuple[tuple[int, int], ...] = ()
    divisor: int = -1
    node: int = -1  #: id in the graph of what is given
    value: float = 0.0  #: of a number; of a state its place
    varies: bool = False  #: whether it changes along the motion


@dataclass(frozen=True)
class Series:
    """The terms of a right-hand side."""

    terms: tuple[Term, ...]
    rates: tuple[int, ...]  #: the term of each component of x'
    checks: tuple[int, ...]  #: terms that must be positive


def behind(terms: Sequence[Term], roots: Iterable[int], *, changing: bool = False) -> set[int]:
    """The terms that roots are made of, with what their recurrences need; only those that change, if requested."""
    result: set[int] = set()
    open_ends = list(roots)
    while open_ends:
        i = open_ends.pop()
        term = terms[i]
        if i not in result and (term.varies or not changing):
            result.add(i)
            more = (term.divisor, *(k for _, k in term.numerators))
            open_ends += [*term.operands, *(k for k in more if k >= 0)]
    return result


def make_series(program: Program) -> Series:
    """The terms of a program's right-hand side.

    Raises NoSeriesError (it is not straight-line code of smooth operations).
    """
    block = next((b for b in program.blocks if b.name == "rhs"), None)
    if program.has_loops:
        raise NoSeriesError("its closed loops are solved at every state")
    if block is None:
        raise NoSeriesError(TOO_LONG)
    return _Terms(program, block).series(block)


class NoSeriesError(Exception):
    """Why there are no terms: an operation on a value that changes has no recurrence, or there are too many."""


TOO_LONG = f"its right-hand side has more than about {MOST_TERMS} operations"


class _Terms:
    """Makes terms, each once."""

    def __init__(self, program: Program, block: Block) -> None:
        graph = program.graph
        self._nodes = graph.nodes
        self._hoisted = program.parameter_only
        self._terms: list[Term] = []
        self._index: dict[tuple[object, ...], int] = {}
        self._of: dict[int, int] = {graph.symbol(program.time).id: self._add(Term("time", varies=True))}
        for k, name in enumerate(block.inputs):
            self._of[graph.symbol(name).id] = self._add(Term("state", value=float(k), varies=True))
        self._one = Term("number", value=1.0)
        self._smooth = True  #: whether all must have recurrences; checks need values alone
        for roots in (block.outputs, block.checks):
            for i in reachable(graph, [y.id for y in roots], stop=self._hoisted):
                if i not in self._of:
                    self._of[i] = self._translate(i, self._nodes[i])
            self._smooth = False

    def series(self, block: Block) -> Series:
        """All that is needed, once every node has its term; reciprocals may have gone into quotients."""
        rates, checks = ([self._of[y.id] for y in expressions] for expressions in (block.outputs, block.checks))
        states = {i for i, term in enumerate(self._terms) if term.kind == "state"}
        live = sorted(states | behind(self._terms, [*rates, *checks]))
        place = {i: k for k, i in enumerate(live)}
        terms = (self._terms[i] for i in live)
        moved = (
            term._replace(
                operands=tuple(place[k] for k in term.operands),
                numerators=tuple((sign, place.get(k, -1)) for sign, k in term.numerators),
                divisor=place.get(term.divisor, -1),
            )
            for term in terms
        )
        return Series(tuple(moved), tuple(place[i] for i in rates), tuple(place[i] for i in checks))

    def _add(self, term: Term) -> int:
        key = (term.kind, term.operands, term.node, term.value)
        if key not in self._index:
            if len(self._terms) >= MOST_TERMS:
                raise NoSeriesError(TOO_LONG)
            self._index[key] = len(self._terms)
            self._terms.append(term)
        return self._index[key]

    def _number(self, value: float) -> int:
        return self._add(Term("number", value=value))

    def _translate(self, i: int, node: Node) -> int:
        kind = node[0]
        if kind == "const":
            return self._number(node[1])
        if kind == "sym" or i in self._hoisted:
            return self._add(Term("given", node=i))
        operands = [self._of[k] for k in node[1:]]
        for p, q in (operands, operands[::-1]) if kind == "mul" else ():  # a quotient has one recurrence, not two
            factor = self._terms[q]
            if factor.kind == "div" and factor.varies and self._terms[factor.operands[0]] == self._one:
                return self._apply("div", p, factor.operands[1])
        return self._apply(kind, *operands)

    def _apply(self, kind: str, *operands: int) -> int:
        """The term of an operation, with what its recurrence needs."""
        varies = any(self._terms[k].varies for k in operands)
        row = OPERATIONS.get(kind)
        if row is None:
            what = "a contact between groups" if kind.startswith("pairs ") else "a table or a function of your own"
            raise NoSeriesError(f"{what} has no series")
        if self._smooth and varies and row.bends:
            word = "a condition" if row.chooses else "a comparison" if row.kind == CONDITION else kind
            raise NoSeriesError(f"{word} of a moving quantity has corners or jumps")
        if self._smooth and varies and kind == "pow" and self._terms[operands[1]].varies:
            raise NoSeriesError("a power with a changing exponent has no series")
        made = len(self._terms)
        place = self._add(Term(kind, operands, varies=varies))
        if place == made and self._smooth and varies and row.recurrence is not None:
            numerators, divisor = row.recurrence(_Algebra(self), place, *operands)
            self._terms[place] = self._terms[place]._replace(
                numerators=tuple(map(self._signed, numerators)), divisor=-1 if divisor is None else divisor
            )
        return place

    def _signed(self, numerator: int) -> tuple[int, int]:
        """A sign and a term, -1 for the number 1."""
        sign, term = 1, self._terms[numerator]
        if term.kind == "neg":
            sign, numerator = -1, term.operands[0]
        return sign, -1 if self._terms[numerator] == self._one else numerator


class _Algebra:
    """Terms by the operations that a graph has, for recurrences of the table of operations."""

    def __init__(self, terms: _Terms) -> None:
        self.make = make = terms._apply
        self.add, self.sub, self.mul, self.div, self.neg = (
            partial(make, k) for k in ("add", "sub", "mul", "div", "neg")
        )
        self._number = terms._number

    def constant(self, value: float) -> _Algebra:
        """A number, whose :attr:`id` is its term."""
        self.id = self._number(value)
        return self

    @property
    def one(self) -> _Algebra:
        """The number 1."""
        return self.constant(1.0)
