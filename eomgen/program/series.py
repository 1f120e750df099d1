"""Stage program: the right-hand side -> terms whose Taylor coefficients along the motion follow from each other.

Each operation has a recurrence for its coefficient of order k, from lower ones and its operands' up to k:
A. Griewank, A. Walther, Evaluating Derivatives, 2008, section 13.2; A. Jorba, M. Zou, Exp. Mathematics 14, 2005.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from ..graph.nodes import Node
from ..graph.traverse import reachable
from .program import Block, Program

#: Highest order that a step may have; enough for tolerances near the rounding of doubles.
MOST_ORDER = 23
#: Right-hand sides of more terms have no series: DOP853 is faster then, as work grows with the square of the order.
MOST_TERMS = 600
#: Integer powers up to this are products.
MOST_FACTORS = 16
#: Functions whose rates are made of each other; each needs the other.
PARTNERS = {"sin": "cos", "cos": "sin", "sinh": "cosh", "cosh": "sinh"}
#: Operations with a recurrence.
SMOOTH = frozenset(
    {"add", "sub", "mul", "div", "neg", "sqrt", "exp", "log", "tan", "tanh", "asin", "acos", "atan", "atan2", "pow"}
).union(PARTNERS)

#: Operations that have values at least.
VALUES = SMOOTH | {"abs", "sign", "min", "max", "lt", "le", "eq", "not", "and", "or", "select"}


class Term(NamedTuple):
    """One value along the motion.

    Attributes
    ----------
    kind : str
        An operation of the graph, or "number", "given" (constant along the motion), "time", "state".
    operands : tuple of int
        Earlier terms.
    other : int
        A term that the recurrence needs besides: the partner of sin, cos, sinh and cosh, 1 + tan^2 and 1 - tanh^2, and
        for the inverse functions what their rate is divided by.  It may be a later one.
    node : int
        Id in the graph of what is given.
    value : float
        Of a number; of a state its place.
    varies : bool
        Whether it changes along the motion.
    """

    kind: str
    operands: tuple[int, ...] = ()
    other: int = -1
    node: int = -1
    value: float = 0.0
    varies: bool = False


@dataclass(frozen=True)
class Series:
    """The terms of a right-hand side.

    Attributes
    ----------
    terms : tuple of Term
    rates : tuple of int
        The term of each component of x'.
    checks : tuple of int
        Terms that must be positive.
    """

    terms: tuple[Term, ...]
    rates: tuple[int, ...]
    checks: tuple[int, ...]


def behind(terms: Sequence[Term], roots: Iterable[int], *, changing: bool = False) -> set[int]:
    """The terms that roots are made of, with what their recurrences need; only those that change, if asked for."""
    found: set[int] = set()
    open_ends = list(roots)
    while open_ends:
        i = open_ends.pop()
        term = terms[i]
        if i not in found and (term.varies or not changing):
            found.add(i)
            open_ends += [*term.operands, *([term.other] if term.other >= 0 else [])]
    return found


def make_series(program: Program) -> Series:
    """The terms of a program's right-hand side.

    Raises
    ------
    NoSeriesError
        It is not straight-line code of smooth operations.
    """
    block = next((b for b in program.blocks if b.name == "rhs"), None)
    if program.has_loops:
        raise NoSeriesError("closed loops are solved for at every state")
    if block is None:
        raise NoSeriesError(TOO_LONG)
    return _Terms(program, block).series(block)


class NoSeriesError(Exception):
    """Why there are no terms: an operation on a value that changes has no recurrence, or there are too many."""


TOO_LONG = f"its right-hand side has more than some {MOST_TERMS} operations"
#: Operations that have none, in users' words.
CORNERS = {"abs": "abs", "sign": "sign", "min": "min", "max": "max", "select": "a condition"}


class _Terms:
    """Makes terms, each once."""

    def __init__(self, program: Program, block: Block) -> None:
        graph = program.graph
        self._nodes = graph.nodes
        self._hoisted = program.parameter_only
        self._terms: list[Term] = []
        self._found: dict[tuple[object, ...], int] = {}
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
        rates, checks = ([self._of[y.id] for y in given] for given in (block.outputs, block.checks))
        states = {i for i, term in enumerate(self._terms) if term.kind == "state"}
        live = sorted(states | behind(self._terms, [*rates, *checks]))
        place = {i: k for k, i in enumerate(live)}
        terms = (self._terms[i] for i in live)
        moved = (
            term._replace(operands=tuple(place[k] for k in term.operands), other=place.get(term.other, -1))
            for term in terms
        )
        return Series(tuple(moved), tuple(place[i] for i in rates), tuple(place[i] for i in checks))

    def _add(self, term: Term) -> int:
        key = (term.kind, term.operands, term.node, term.value)
        if key not in self._found:
            if len(self._terms) >= MOST_TERMS:
                raise NoSeriesError(TOO_LONG)
            self._found[key] = len(self._terms)
            self._terms.append(term)
        return self._found[key]

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
        exponent = self._terms[operands[1]] if kind == "pow" else None
        if exponent is not None and exponent.kind == "number" and abs(exponent.value) in range(1, MOST_FACTORS + 1):
            return self._power(operands[0], int(exponent.value))
        return self._apply(kind, *operands)

    def _power(self, base: int, exponent: int) -> int:
        """Products, which have coefficients where the base is 0 as well."""
        if exponent < 0:
            return self._apply("div", self._number(1.0), self._power(base, -exponent))
        if exponent == 1:
            return base
        half = self._power(base, exponent // 2)
        square = self._apply("mul", half, half)
        return self._apply("mul", square, base) if exponent % 2 else square

    def _apply(self, kind: str, *operands: int) -> int:
        """The term of an operation, with what its recurrence needs."""
        varies = any(self._terms[k].varies for k in operands)
        if kind not in VALUES:
            raise NoSeriesError("a table or a function of your own has no series")
        if self._smooth and varies and kind not in SMOOTH:
            raise NoSeriesError(f"{CORNERS.get(kind, 'a comparison')} of what moves has corners or jumps")
        if self._smooth and varies and kind == "pow" and self._terms[operands[1]].varies:
            raise NoSeriesError("a power whose exponent moves has no series")
        if not self._smooth or not varies or kind not in (*PARTNERS, "tan", "tanh", "asin", "acos", "atan", "atan2"):
            return self._add(Term(kind, operands, varies=varies))
        if kind in ("asin", "acos"):  # a' = u' sqrt(1 - a^2)
            rest = self._apply("sub", self._number(1.0), self._apply("mul", operands[0], operands[0]))
            return self._add(Term(kind, operands, self._apply("sqrt", rest), varies=True))
        if kind in ("atan", "atan2"):  # a' = u' (1 + a^2); y' x - x' y = u' (x^2 + y^2)
            first, second = (self._apply("mul", k, k) for k in (operands[0], operands[-1]))
            size = self._apply("add", first, self._number(1.0) if kind == "atan" else second)
            return self._add(Term(kind, operands, size, varies=True))
        place = self._add(Term(kind, operands, varies=True))
        if kind in ("tan", "tanh"):  # u' = (1 +- u^2) a'
            square = self._apply("mul", place, place)
            other = self._apply("add" if kind == "tan" else "sub", self._number(1.0), square)
        else:
            other = self._add(Term(PARTNERS[kind], operands, varies=True))
            self._terms[other] = self._terms[other]._replace(other=place)
        self._terms[place] = self._terms[place]._replace(other=other)
        return place
