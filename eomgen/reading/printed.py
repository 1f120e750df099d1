"""Equations of motion M(q) v' = f -> the formulas that a display shows, in order."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import sympy

from ..base.texts import acceleration_name
from ..elements.frames import GROUND
from ..expr.core import Expr, symbols_of
from ..expr.notation import Notation, dotted, raised
from ..expr.printing.formula import (
    COORDINATE,
    DIGITS,
    GRAVITY,
    INERTIA,
    INPUT,
    MASS,
    PARAMETER,
    RATE,
    Formula,
    Formulas,
    Letter,
    Matrix,
    Name,
    Number,
    Order,
    Product,
    Relation,
    Sum,
    Words,
    number,
)
from ..expr.printing.writers import PAGE, TIGHT, text, width
from .document import Folded, FormulaLine, Piece, Row, Sentence
from .named_parts import PartMeaning, find_blocks, grouped
from .readable import BODIES, LOOPS, PARTS, Readable
from .tree_system import MANY

# -- equations ---------------------------------------------------------------------------------------------------------


UNITS = {"angle": "rad", "turn": "rad", "length": "m", "parameter": ""}


class Letters(NamedTuple):
    """LaTeX of the letters of M v' = f."""

    mass: str
    accelerations: str
    force: str


#: The usual letters, and those that take their places.
STANDARD = Letters("M", r"\dot{v}", "f")
OTHERS = Letters("AK", "aw", "br")


class PrintedEntry(NamedTuple):
    """An entry of M or f: its letter in LaTeX, its place, counted from 1, and its formula."""

    letter: str
    place: tuple[int, ...]
    formula: Formula


def order_of(equations: Readable) -> Order:
    """In what order the names of a model stand in formulas."""
    k, m = equations.kinematics, equations.kinematics.mechanism
    masses = {name for body in m.bodies for name in _single_names(body.mass)}
    inertias = {name for body in m.bodies for row in body.inertia for x in row for name in _single_names(x)}
    inertias |= {name for body in m.bodies if body.inertia_origin for row in body.inertia_origin for x in row
                 for name in _single_names(x)}  # fmt: skip
    gravity = {name for x in m.gravity for name in _names(x)}
    kinds: dict[str, int] = {}
    for p in m.parameters:
        unit = p.unit.replace(" ", "").replace("·", "*").replace("**", "^")
        if unit == "kg" or p.name in masses:
            kinds[p.name] = MASS
        elif unit in ("kg*m^2", "kgm^2", "kg*m2") or p.name in inertias:
            kinds[p.name] = INERTIA
        else:
            kinds[p.name] = GRAVITY if p.name in gravity else PARAMETER
    kinds |= dict.fromkeys(equations.names_substituted, PARAMETER)
    kinds |= dict.fromkeys(equations.kinematics.input_names, INPUT)
    kinds |= dict.fromkeys([*k.names, *k.loop_coordinates.names, "t"], COORDINATE)
    return Order(kinds | dict.fromkeys([*k.velocity_names, *equations.acceleration_names], RATE))


def _single_names(x: Expr) -> tuple[str, ...]:
    """The name that an expression is, if it is one."""
    names = _names(x)
    return tuple(names) if len(names) == 1 and x.graph.symbol(*names).id == x.id else ()


def _names(x: Expr) -> set[str]:
    return set(symbols_of([x]))


STILL = "nothing is free to move: the position follows from constraints and time"
SAMPLED = "sampled states, constant until the next time t, where they take these values one after the other"


class PrintedEquations:
    """Formulas of M(q) v' = f and what else a display says, on request with fewer digits of long numbers."""

    def __init__(self, equations: Readable, digits: int = DIGITS) -> None:
        self.equations = equations.in_plain_symbols()
        self.digits = digits
        self.of_time = self.equations is not equations
        self.of_loops = equations.has_long_loops  #: whether the parts of B^T M_t B are shown
        self.names: Notation = equations.notation.with_names(str(name) for name, _ in self.named)
        self.formula = Formulas(order_of(equations), digits=digits)

    @cached_property
    def named(self) -> list[tuple[Any, Any]]:
        """The named parts that are shown, in SymPy."""
        return self.equations.written("tree_system")[0] if self.of_loops else self.equations.intermediates

    @property
    def is_long(self) -> bool:
        """Whether matrices are shown with letters for their entries, and named parts in groups."""
        return self.of_loops or len(self.named) > MANY

    @cached_property
    def letters(self) -> Letters:
        """The letters of M v' = f; others where names of the model are printed so."""
        M, f = (self.names.letter(STANDARD[k], *OTHERS[k], with_numbers=True) for k in (0, 2))
        rates = (STANDARD.accelerations,) if self.names.is_free("v") else ()
        return Letters(M, self.names.letter(*rates, *OTHERS.accelerations), f)

    @property
    def renamed_letters(self) -> list[tuple[str, str]]:
        """Letters that are not the usual ones, in LaTeX, and what they stand for."""
        by_letter = [
            (self.letters.mass, STANDARD.mass, "the mass matrix"),
            (self.letters.force, STANDARD.force, "the right side"),
        ]
        return [(letter, what) for letter, standard, what in by_letter if letter != standard]

    def list_renamed_letters(self) -> Iterator[Sentence]:
        """A sentence of them."""
        if by_letter := ", ".join(f"${letter}$ is {what}" for letter, what in self.renamed_letters):
            yield Sentence(f"{by_letter}; the usual letters are names of the model.")

    @cached_property
    def mass_matrix(self) -> list[list[Formula]]:
        """M by rows."""
        return [[self.formula(x) for x in row] for row in self.equations.mass_matrix.tolist()]

    @cached_property
    def force(self) -> list[Formula]:
        """f."""
        return [self.formula(x) for x in self.equations.force]

    @cached_property
    def intermediates(self) -> list[tuple[str, Formula]]:
        """Names that stand in M and f, with what they stand for."""
        return [(str(name), self.formula(x)) for name, x in self.named]

    @cached_property
    def accelerations(self) -> list[Formula]:
        """v' of M v' = f."""
        return [self.formula(x) for x in self.equations.symbols_substituted(self.equations.acceleration_names)]

    def _pairs(self, quantity: str, names: Sequence[str | None]) -> list[tuple[Formula, Formula]]:
        """Named parts of a column, then its entries that have names, each with what it is."""
        if not (kept := [name for name in names if name is not None]):
            return []
        named, column = self.equations.written(quantity)
        entries = [x for name, x in zip(names, column, strict=True) if name is not None]
        pairs = (*named, *zip(self.equations.symbols_substituted(kept), entries, strict=True))
        return [(self.formula(left), self.formula(right)) for left, right in pairs]

    @cached_property
    def titled_states(self) -> list[tuple[str, list[tuple[Formula, Formula]]]]:
        """Rates of first-order states, then what sampled ones become, each after its named parts, under titles."""
        k = self.equations.kinematics
        rates = [None if n in k.mechanism.sampled_names else acceleration_name(n) for n in k.state_names]
        titled = {"first-order states": self._pairs("state_rates", rates)}
        titled[SAMPLED] = self._pairs("sampled_values", [name for name, _ in k.sampled])
        return [(title, pairs) for title, pairs in titled.items() if pairs]

    @property
    def values(self) -> list[Formula]:
        """Equations of what was substituted, ``l = 0.5``; a second time for a name with what came later."""
        return [
            Relation("=", (Name(name), number(float(x), 15) if isinstance(x, float | int) else self.formula(x)))
            for values in self.equations.values_substituted()
            for name, x in values
        ]

    @property
    def is_one_equation(self) -> bool:
        """Whether there is one acceleration, for which nothing was substituted."""
        return len(self.accelerations) == 1 and isinstance(self.accelerations[0], Name)

    @property
    def column(self) -> Formula:
        """v' as it is multiplied by M."""
        return self.accelerations[0] if self.is_one_equation else Matrix(tuple((x,) for x in self.accelerations))

    # -- what a page shows --------------------------------------------------------------------------------------------
    @cached_property
    def parts(self) -> PrintedParts | None:
        """The parts of large equations."""
        return PrintedParts(self) if self.is_long and self.equations.mobility.n_dof else None

    @property
    def page_names(self) -> Notation:
        """How names are printed on a page."""
        return self.parts.names if self.parts is not None else self.names

    def items(self) -> Iterator[Piece]:
        """The equations of motion, what stands in them, states, and what is left to say."""
        if self.equations.mobility.n_dof == 0:
            yield Sentence(f"{STILL.capitalize()}.")
        else:
            yield from self._motion() if self.parts is None else self.parts.items()
        for title, pairs in self.titled_states:
            yield Sentence(title)
            yield from map(FormulaLine, pairs)
        if self.remark:
            yield Sentence(self.remark)

    def _motion(self) -> Iterator[Piece]:
        """M v' = f written out where it fits on a page, else in letters, and their entries."""
        M, f = Matrix(tuple(map(tuple, self.mass_matrix))), Matrix(tuple((x,) for x in self.force))
        if self.is_one_equation and self.fits:
            factor = M.rows[0][0]
            left = self.column if factor == Number("1") else Product((factor, self.column))
            yield FormulaLine((left, self.force[0]))
        elif len(self.accelerations) > 1 and self.fits:
            yield FormulaLine((Product((M, self.column)), f))
        else:
            mass, _, force = map(Letter, self.letters)
            yield FormulaLine((Product((mass, self.column)), force))
            yield from self.list_renamed_letters()
            several = len(self.accelerations) > 1
            whole = several and self.mass_matrix_fits
            if whole:
                yield FormulaLine((mass, M))
            elif several:
                zeros = "; entries that are not shown are 0" if self.vanishing else ""
                yield Sentence(f"The mass matrix is symmetric{zeros}.")
            lines = tuple(
                FormulaLine((Letter(self.label(entry)), entry.formula))
                for entry in self.entries()
                if not (whole and entry.letter == self.letters.mass)
            )
            yield from lines if len(lines) <= FOLDED else [Folded(f"the {len(lines)} entries of M and f", lines)]
        if self.named:
            yield Sentence("where")
            yield from (FormulaLine((Name(name), x)) for name, x in self.intermediates)

    def label(self, entry: PrintedEntry) -> str:
        """LaTeX of the place of an entry."""
        n = len(self.accelerations)
        return f"{entry.letter}_{{{(',' if n > 9 else '').join(map(str, entry.place))}}}" if n > 1 else entry.letter

    def entries(self) -> Iterator[PrintedEntry]:
        """Entries of M on and below its diagonal that do not vanish, then those of f."""
        for i, row in enumerate(self.mass_matrix):
            for j, x in enumerate(row[: i + 1]):
                if x != Number("0"):
                    yield PrintedEntry(self.letters.mass, (j + 1, i + 1), x)
        for i, x in enumerate(self.force):
            yield PrintedEntry(self.letters.force, (i + 1,), x)

    @property
    def vanishing(self) -> bool:
        """Whether entries of M vanish."""
        return any(x == Number("0") for row in self.mass_matrix for x in row)

    @property
    def remark(self) -> str:
        """What is said when all formulas have been made, of digits that are not printed and of signs; often empty."""
        result = []
        if self.formula.signs:
            result.append("sgn(x) is short for x/|x|, which has no value at x = 0.")
        if self.formula.rounded:
            kept = "eqs.tree_system has" if self.of_loops else "eqs.mass_matrix and eqs.force have"
            result.append(f"Long numbers are rounded to {self.digits} digits; {kept} all of them.")
        return " ".join(result)

    def text(self, formula: Formula) -> str:
        """A formula in text."""
        return text(formula, self.names)

    @property
    def fits(self) -> bool:
        """Whether M v' = f fits on a line of a page, M and f written out."""
        columns = ([[x] for x in column] for column in (self.accelerations, self.force))
        return self._width(self.mass_matrix) + sum(map(self._width, columns)) <= PAGE

    @property
    def mass_matrix_fits(self) -> bool:
        """Whether M fits on a line of a page."""
        return self._width(self.mass_matrix) <= PAGE

    def _width(self, rows: list[list[Formula]]) -> float:
        return width(Matrix(tuple(map(tuple, rows))), self.names)

    @property
    def coordinates(self) -> list[tuple[str, str, str, str]]:
        """Coordinates of the spanning tree: name, joint, unit, and whether it is dependent."""
        k = self.equations.kinematics
        joints = {name: joint.name for joint in k.mechanism.joints for name in joint.coordinates}
        units = {} if k.mechanism.bare else dict(zip(k.names, (UNITS[kind] for kind in k.kinds), strict=True))
        independent = {*self.equations.independent}
        return [(n, joints.get(n, ""), units.get(n, ""), "" if n in independent else "dependent") for n in k.names]

    @property
    def title(self) -> str:
        """What these equations are, in one line."""
        n = self.equations.mobility.n_dof
        method = self.equations.method.replace("_", "-")
        return f"method {method}, {n} degree{'s' * (n != 1)} of freedom{', functions of time' * self.of_time}"

    @property
    def attributes(self) -> tuple[str, ...]:
        """Attributes to read next."""
        mechanism, there = self.equations.kinematics.mechanism, type(self.equations)
        lacking = {*([BODIES] if mechanism.bare else ()), *([PARTS] if mechanism.written is not None else ())}
        rows = {row.name: row.offered for row in there.rows() if row.offered and row.offered not in lacking}
        loops = [name for name, offered in rows.items() if offered == LOOPS and self.equations.constraint_names]
        result = ["q", "v", "parameters", *(name for name, offered in rows.items() if offered != LOOPS)]
        result += ["operations", "report"] if mechanism.states else ["linearize", "operations", "report"]
        result += [*loops, *(["states", "state_rates"] if mechanism.states else [])]
        result += ["sampled", "sampled_values"] if mechanism.clocks else []
        return tuple(name for name in result if hasattr(there, name))


def plain(line: str) -> str:
    """Text with ordinary spaces."""
    return line.replace(TIGHT, " ")


# -- parts of large equations ------------------------------------------------------------------------------------------

# Matrices stand with their zeros, and letters for their long entries; letters and named parts are listed in groups of
# one meaning. Of a mechanism with loops these are the parts of M = B^T M_t B, which are shorter than M.


SHORT = 14  #: characters of an entry that stands in its matrix
FOLDED = 12  #: formulas more than which are folded up
LARGE = 12  #: rows or columns of a matrix that is shown on request
TITLES = {
    PartMeaning.CONSTANT: "constants",
    PartMeaning.TURN: "sines and cosines",
    PartMeaning.ROTATION: "rotations: from the axes of the joint that holds a body to those of ground",
    PartMeaning.POSITION: "positions",
    PartMeaning.INERTIA: "mass matrix",
    PartMeaning.CONSTRAINT: "Jacobian of the constraints",
    PartMeaning.ANGULAR_VELOCITY: "angular velocities, along the axes of the joint that holds a body",
    PartMeaning.VELOCITY: "velocities",
    PartMeaning.FORCE: "right side",
    PartMeaning.CONSTRAINT_RATE: "velocity terms of the constraints",
}
ZERO = Number("0")
NUMBERED = re.compile(r"z\d+")  #: names that say nothing


class _Matrix(NamedTuple):
    letter: str  #: in LaTeX
    entries: list[list[Formula]]
    meaning: PartMeaning
    values: Any

    @property
    def symmetric(self) -> bool:
        return self.meaning == PartMeaning.INERTIA

    @property
    def is_column(self) -> bool:
        return len(self.entries[0]) == 1

    @property
    def is_large(self) -> bool:
        return max(len(self.entries), len(self.entries[0])) > LARGE


class PrintedParts:
    """What a display of large equations says; entries of up to ``short`` characters stand in their matrix itself."""

    def __init__(self, printed: PrintedEquations, short: int = SHORT) -> None:
        self.short = short
        self.printed, self.equations = printed, printed.equations
        self._kinematics = self.equations.kinematics
        self._free = {*self.equations.independent}

    def items(self) -> Iterator[Piece]:
        """All of it."""
        M, v, f = self.printed.letters
        yield _row((Product((Letter(M), self.printed.column)), Letter(f)))
        yield from self.printed.list_renamed_letters()
        if self.printed.of_loops:
            yield from self._embedding(*map(Letter, (M, v, f)))
        large: list[_Matrix] = []
        for matrix in self._matrices:
            if not matrix.is_column and not matrix.is_large:
                yield _row((Letter(matrix.letter), self._pattern(matrix)))
            large += [matrix] if matrix.is_large and not matrix.is_column else []
        yield from self._rows_of_constraints()
        yield from self._blocks()
        if zeros := self._zeros:
            names = listed([Name(name) for name in zeros])
            yield Sentence((f"${M}$ and ${f}$ do not depend on ", *names, "; below, 0 stands for them."))
        if large:
            title = f"matrices {', '.join(f'${m.letter}$' for m in large)}"
            yield Folded(title, tuple(FormulaLine((Letter(m.letter), self._pattern(m))) for m in large))
        yield from self._groups()

    @cached_property
    def names(self) -> Notation:
        """How names are printed: a part that is an entry of a matrix is printed as the letter of the entry."""
        return self.printed.names.with_latex({name: x.latex for name, x in self._entry_letters.items()})

    # -- mechanisms with loops ----------------------------------------------------------------------------------------
    def _embedding(self, M: Letter, v: Letter, f: Letter) -> Iterator[Piece]:
        """How M and f follow from the equations of the tree and the constraints."""
        k = self._kinematics
        mass, force, C, gamma = (Letter(matrix.letter) for matrix in self._matrices)
        B, a, w = self._letter("B", "P"), self._letter("a", "b"), self._letter("v_t", "w_t")
        transposed, rates = Letter(raised(B, "T")), Letter(dotted(w, 1))
        rest = Sum(((False, force), (True, Product((mass, Letter(a))))))
        yield _row((M, Product((transposed, mass, Letter(B)))), (f, Product((transposed, rest))))
        every = [Name(acceleration_name(name)) for name in k.velocity_names]
        free = [x for x, label in zip(every, k.velocity_labels, strict=True) if label in self._free]
        constrained = Sum(((False, Product((C, rates))), (False, gamma)))
        of_all = f"${mass.latex}$ and ${force.latex}$ are of all accelerations of the tree, ${rates.latex}$ = ("
        yield Sentence((of_all, *listed(every), "). With the constraints ", constrained, " = 0,"))
        C_d, C_i, B_d, a_d = (f"{x}_{part}" for x, part in ((C.latex, "d"), (C.latex, "i"), (B, "d"), (a, "d")))
        moved = Sum(((False, Product((Letter(B), v))), (False, Letter(a))))
        inverse = Letter(raised(C_d, "{-1}"))
        solved = ((Letter(x), Sum(((True, Product((inverse, y))),))) for x, y in ((B_d, Letter(C_i)), (a_d, gamma)))
        yield _row((rates, moved), *solved)
        of_others = f"${B_d}$ and ${a_d}$ are the rows of the other accelerations; in the rows of ${v.latex}$, ${B}$ is"
        of_free = f"where ${C_i}$ holds the columns of ${C.latex}$ that belong to "
        yield Sentence((of_free, *listed(free), f", and ${C_d}$ the others. {of_others} the identity and ${a}$ is 0."))

    def _rows_of_constraints(self) -> Iterator[Sentence]:
        """Of which equations the rows of C are."""
        labels = self.equations.constraint_names
        if self.printed.of_loops and len(labels) <= LARGE:
            C = next(m for m in self._matrices if m.meaning == PartMeaning.CONSTRAINT)
            yield Sentence(f"The rows of ${C.letter}$ are those of {', '.join(labels)}.")

    @property
    def _branches(self) -> list[int]:
        """Of each velocity the first link of its branch of the tree."""
        result: dict[int, int] = {}
        root: list[int] = []
        for k, link in enumerate(self._kinematics.links):
            root.append(k if link.parent == GROUND else root[link.parent])
            result |= {link.first + c: root[k] for c in range(len(link.columns))}
        return [result[j] for j in range(len(self._kinematics.velocity_labels))]

    def _blocks(self) -> Iterator[Piece]:
        """Large matrices in blocks, where many of these vanish."""
        of = {matrix.meaning: matrix for matrix in self._matrices}
        C, M = of.get(PartMeaning.CONSTRAINT), of[PartMeaning.INERTIA]
        if C is None or not M.is_large:
            return
        inertia, nonzero = ([[x != ZERO for x in row] for row in matrix.entries] for matrix in (M, C))
        if (blocks := find_blocks(inertia, nonzero, self.equations.constraint_names, self._branches)) is None:
            return
        names = [Name(name) for name in self._kinematics.velocity_labels]
        places, filled = blocks
        columns = [[names[j] for j in group] for group in places]
        groups = [x for k, part in enumerate(columns) for x in ("; " if k else "", *listed(part))]
        joints = dict.fromkeys(label.partition(".")[0] for label in self.equations.constraint_names)
        yield Sentence(("In blocks, of the coordinates ", *groups, f", and of the joints {', '.join(joints)}:"))
        stem = M.letter.removesuffix("_t")
        diagonal = (Letter(rf"\mathbf{{{stem}}}_{{{k + 1}}}") for k in range(len(columns)))
        rows = [[x if i == k else ZERO for i in range(len(columns))] for k, x in enumerate(diagonal)]
        yield _row((Letter(M.letter), Matrix(tuple(map(tuple, rows)))))
        rows = [
            [Letter(rf"\mathbf{{{C.letter}}}_{{{a + 1}{b + 1}}}") if there else ZERO for b, there in enumerate(row)]
            for a, row in enumerate(filled)
        ]
        yield _row((Letter(C.letter), Matrix(tuple(map(tuple, rows)))))

    @property
    def _zeros(self) -> tuple[str, ...]:
        return self.equations.tree_system.zeros if self.printed.of_loops else ()

    # -- matrices -----------------------------------------------------------------------------------------------------
    def _letter(self, *choice: str) -> str:
        return self.printed.names.letter(*choice, with_numbers=True)

    @cached_property
    def _matrices(self) -> list[_Matrix]:
        eqs, letters = self.equations, self.printed.letters
        if not self.printed.of_loops:
            lettered: list[tuple[str, Any]] = [(letters.mass, eqs.mass_matrix), (letters.force, eqs.force)]
        else:
            system = eqs.tree_system
            choices = ("M_t", "A_t"), ("f_t", "b_t"), ("C", "J"), (r"\gamma", "c")
            lettered = [(self._letter(*choice), x) for choice, x in zip(choices, system[:4], strict=True)]
        meanings = PartMeaning.INERTIA, PartMeaning.FORCE, PartMeaning.CONSTRAINT, PartMeaning.CONSTRAINT_RATE
        return [
            _Matrix(letter, [list(map(self.printed.formula, row)) for row in x.tolist()], meaning, x)
            for (letter, x), meaning in zip(lettered, meanings, strict=False)
        ]

    def _place(self, matrix: _Matrix, i: int, j: int) -> Letter:
        """The letter of an entry."""
        comma = "," if max(len(matrix.entries), len(matrix.entries[0])) > 9 else ""
        places = [i] if matrix.is_column else [min(i, j), max(i, j)] if matrix.symmetric else [i, j]
        place = comma.join(str(k + 1) for k in places)
        stem = matrix.letter.removesuffix("_t")
        return Letter(f"{stem}_{{{place}}}" if stem == matrix.letter else f"{stem}_{{t,{place}}}")

    def _stands(self, matrix: _Matrix, entry: Formula) -> bool:
        """Whether an entry stands in its matrix itself."""
        if entry == ZERO:
            return True
        if (part := self._part(entry)) is not None:
            return not matrix.is_column and (part in self._entry_letters or self._meaning[part] == PartMeaning.CONSTANT)
        is_sum = isinstance(entry, Sum) and len(entry.terms) > 1
        return not matrix.is_column and not is_sum and len(text(entry, self.names)) <= self.short

    def _pattern(self, matrix: _Matrix) -> Matrix:
        """A matrix with letters for its long entries, of a symmetric one the upper half."""
        first = self._first_places(matrix)
        rows: list[list[Formula]] = [
            [x if self._stands(matrix, x) else self._place(matrix, *first[i, j]) for j, x in enumerate(row)]
            for i, row in enumerate(matrix.entries)
        ]
        if matrix.symmetric and len(rows) > 1:
            for i, row in enumerate(rows):
                row[:i] = [Words("", "")] * i
            rows[-1][0] = Words("sym.", r"\text{sym.}")
        return Matrix(tuple(map(tuple, rows)))

    def _entries(self, matrix: _Matrix) -> Iterator[tuple[Any, FormulaLine]]:
        """What the letters of a matrix stand for, in SymPy and as it is printed, those of named parts left out."""
        for (i, j), place in self._first_places(matrix).items():
            x = matrix.entries[i][j]
            letter = self._place(matrix, i, j)
            is_part = isinstance(x, Name) and self._entry_letters.get(x.name) == letter
            if not is_part and not self._stands(matrix, x) and place == (i, j):
                yield matrix.values[i, j], FormulaLine((letter, x))

    @staticmethod
    def _first_places(matrix: _Matrix) -> dict[tuple[int, int], tuple[int, int]]:
        """Of each entry the place of the first one that is equal, by rows; entries of a column have their own."""
        first: dict[Any, tuple[int, int]] = {}
        result = {}
        for i, row in enumerate(matrix.entries):
            for j, x in enumerate(row):
                result[i, j] = (i, j) if matrix.is_column else first.setdefault(x, (i, j))
        return result

    def _part(self, entry: Formula) -> str | None:
        """The named part that an entry is, perhaps subtracted."""
        part = entry.terms[0][1] if isinstance(entry, Sum) and len(entry.terms) == 1 else entry
        return part.name if isinstance(part, Name) and part.name in self._meaning else None

    @cached_property
    def _entry_letters(self) -> dict[str, Letter]:
        """Named parts that are entries of the matrix for which alone they are, and the letters of these entries."""
        result: dict[str, Letter] = {}
        for matrix in self._matrices:
            for (i, j), place in self._first_places(matrix).items():
                x = matrix.entries[i][j]
                if not isinstance(x, Name) or place != (i, j) or x.name in result or not NUMBERED.fullmatch(x.name):
                    continue
                if self._meaning.get(x.name) == matrix.meaning:
                    result[x.name] = self._place(matrix, i, j)
        return result

    # -- named parts --------------------------------------------------------------------------------------------------
    @cached_property
    def _by_meaning(self) -> dict[PartMeaning, list[tuple[Any, Any]]]:
        """Named parts by meaning."""
        k = self._kinematics
        outputs = {matrix.meaning: list(matrix.values) for matrix in self._matrices}
        constants = {*k.parameter_names, *self.equations.names_substituted}
        return grouped(self.printed.named, outputs, constants, {*k.velocity_names, *k.input_names})

    @cached_property
    def _meaning(self) -> dict[str, PartMeaning]:
        """What each named part is."""
        return {str(name): meaning for meaning, parts in self._by_meaning.items() for name, _ in parts}

    def _groups(self) -> Iterator[Folded]:
        matrices = {matrix.meaning: matrix for matrix in self._matrices}
        for meaning, title in TITLES.items():
            parts = self._by_meaning.get(meaning, ())
            lines = [FormulaLine((Name(str(name)), self.printed.formula(x))) for name, x in parts]
            operations = sum(operations_of(x) for _, x in parts)
            if matrix := matrices.get(meaning):
                entries = [*self._entries(matrix)]
                operations += sum(operations_of(x) for x, _ in entries)
                lines += [line for _, line in entries]
                title = f"{title} ${matrix.letter}$"
            if lines:
                many = f"{len(lines)} formula{'s' * (len(lines) > 1)}"
                counted = f", {operations} operation{'s' * (operations > 1)}" if operations else ""
                yield Folded(f"{title} ({many}{counted})", tuple(lines))


def operations_of(x: Any) -> int:
    """Operations of a SymPy expression as it is written."""
    return int(sympy.count_ops(x))


def listed(formulas: Sequence[Formula]) -> Iterator[str | Formula]:
    """Formulas with commas between them."""
    for k, x in enumerate(formulas):
        if k:
            yield ", "
        yield x


def _row(*sides: tuple[Formula, Formula]) -> Row:
    """Equations side by side."""
    return Row(tuple(map(FormulaLine, sides)))
