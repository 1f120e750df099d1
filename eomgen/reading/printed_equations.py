"""Stage reading, printed: equations of motion M(q) v' = f -> the formulas that a display shows."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import Any, NamedTuple

from ..base.notation import Notation
from ..graph.core import Expr
from ..graph.substitute import symbols_of
from ..kinematics.state import acceleration_name
from ..printing import PAGE, Formulas, Order, number, text, width
from ..printing.factor_order import COORDINATE, GRAVITY, INERTIA, INPUT, MASS, PARAMETER, RATE
from ..printing.formula_of import DIGITS
from ..printing.formula_text import TIGHT
from ..printing.formula_tree import Formula, MatrixOf, Name, NumberPart, Relation
from .readable import Readable
from .tree_system import MANY

UNITS = {"angle": "rad", "turn": "rad", "length": "m", "parameter": ""}
#: What a reader may want next: attributes of the equations, in the order of a derivation.
ATTRIBUTES = (
    "q", "v", "parameters", "T", "V", "lagrangian", "mass_matrix", "force", "quadratic_velocity", "generalized_forces",
    "poses", "velocities", "accelerations", "momenta", "linearize", "operations", "report",
)  # fmt: skip
OF_BODIES = ("poses", "velocities", "accelerations")
OF_PARTS = ("T", "V", "lagrangian", "momenta", "quadratic_velocity", "generalized_forces")
OF_LOOPS = ("constraints", "constraint_jacobian", "gamma", "velocity_transformation")


class PrintedCoordinate(NamedTuple):
    """A row of the table of coordinates."""

    name: str
    joint: str
    unit: str
    role: str


class Letters(NamedTuple):
    """LaTeX of the letters of M v' = f."""

    mass: str
    accelerations: str
    force: str


#: The usual letters, and those that take their places.
USUAL = Letters("M", r"\dot{v}", "f")
OTHERS = Letters("AK", "aw", "br")


class PrintedEntry(NamedTuple):
    """An entry of M or f: its letter in LaTeX, its place, counted from 1, and its formula."""

    letter: str
    place: tuple[int, ...]
    formula: Formula


def order_of(equations: Readable) -> Order:
    """In what order the names of a model stand in formulas."""
    k, m = equations.kinematics, equations.kinematics.mechanism
    masses = {name for body in m.bodies for name in _alone(body.mass)}
    inertias = {name for body in m.bodies for row in body.inertia for x in row for name in _alone(x)}
    inertias |= {name for body in m.bodies if body.inertia_origin for row in body.inertia_origin for x in row
                 for name in _alone(x)}  # fmt: skip
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
    kinds |= dict.fromkeys(equations.names_put_in, PARAMETER)
    kinds |= dict.fromkeys(equations.kinematics.input_names, INPUT)
    kinds |= dict.fromkeys([*k.names, *k.loop_coordinates.names, "t"], COORDINATE)
    return Order(kinds | dict.fromkeys([*k.velocity_names, *equations.acceleration_names], RATE))


def _alone(x: Expr) -> tuple[str, ...]:
    """The name that an expression is, if it is one."""
    names = _names(x)
    return tuple(names) if len(names) == 1 and x.graph.symbol(*names).id == x.id else ()


def _names(x: Expr) -> set[str]:
    return set(symbols_of([x]))


STILL = "nothing is free to move: the position follows from constraints and time"
SAMPLED = "sampled states, held until the next time t, where they become one after the other"


class PrintedEquations:
    """Formulas of M(q) v' = f and what else a display says.

    Parameters
    ----------
    equations : Readable
    digits : int, optional
        Of long numbers; all of them by default.
    """

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
        M, f = (self.names.letter(USUAL[k], *OTHERS[k], with_numbers=True) for k in (0, 2))
        rates = (USUAL.accelerations,) if self.names.is_free("v") else ()
        return Letters(M, self.names.letter(*rates, *OTHERS.accelerations), f)

    @property
    def letters_told(self) -> list[tuple[str, str]]:
        """Letters that are not the usual ones, in LaTeX, and what they stand for."""
        told = [(self.letters.mass, USUAL.mass, "the mass matrix"), (self.letters.force, USUAL.force, "the right side")]
        return [(letter, what) for letter, usual, what in told if letter != usual]

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
        return [self.formula(x) for x in self.equations.symbols_put_in(self.equations.acceleration_names)]

    @cached_property
    def states(self) -> list[tuple[Formula, Formula]]:
        """First-order states: their rates, and what these are, after named parts of the latter; no sampled ones."""
        names, mechanism = self.equations.kinematics.state_names, self.equations.kinematics.mechanism
        held = {name for clock in mechanism.clocks for name in (*clock.states, clock.counter)}
        if held.issuperset(names):
            return []
        rates = self.equations.symbols_put_in([acceleration_name(name) for name in names])
        named, column = self.equations.written("state_rates")
        pairs = [(rate, x) for name, rate, x in zip(names, rates, column, strict=True) if name not in held]
        return [(self.formula(left), self.formula(right)) for left, right in (*named, *pairs)]

    @cached_property
    def sampled(self) -> list[tuple[Formula, Formula]]:
        """Sampled states and what they become, behind the time of the next sample, after named parts of these."""
        names = [name for name, _ in self.equations.kinematics.sampled]
        if not names:
            return []
        named, column = self.equations.written("sampled_values")
        pairs = (*named, *zip(self.equations.symbols_put_in(names), column, strict=True))
        return [(self.formula(left), self.formula(right)) for left, right in pairs]

    @property
    def values(self) -> list[Formula]:
        """Equations of what was put in, ``l = 0.5``; a second time for a name with what came later."""
        return [
            Relation("=", (Name(name), number(float(x), 15) if isinstance(x, float | int) else self.formula(x)))
            for given in self.equations.values_put_in()
            for name, x in given
        ]

    @property
    def is_one_equation(self) -> bool:
        """Whether there is one acceleration, for which nothing was put in."""
        return len(self.accelerations) == 1 and isinstance(self.accelerations[0], Name)

    def entries(self) -> Iterator[PrintedEntry]:
        """Entries of M on and below its diagonal that do not vanish, then those of f."""
        for i, row in enumerate(self.mass_matrix):
            for j, x in enumerate(row[: i + 1]):
                if x != NumberPart("0"):
                    yield PrintedEntry(self.letters.mass, (j + 1, i + 1), x)
        for i, x in enumerate(self.force):
            yield PrintedEntry(self.letters.force, (i + 1,), x)

    @property
    def vanishing(self) -> bool:
        """Whether entries of M vanish."""
        return any(x == NumberPart("0") for row in self.mass_matrix for x in row)

    @property
    def told(self) -> str:
        """What is said when all formulas have been made, of digits that are not printed and of signs; often empty."""
        found = []
        if self.formula.signs:
            found.append("sgn(x) is short for x/|x|, which has no value at x = 0.")
        if self.formula.rounded:
            kept = "eqs.tree_system has" if self.of_loops else "eqs.mass_matrix and eqs.force have"
            found.append(f"Long numbers are rounded to {self.digits} digits; {kept} all of them.")
        return " ".join(found)

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
        return width(MatrixOf(tuple(map(tuple, rows))), self.names)

    @property
    def coordinates(self) -> list[PrintedCoordinate]:
        """Coordinates of the spanning tree."""
        k = self.equations.kinematics
        joints = {name: joint.name for joint in k.mechanism.joints for name in joint.coordinates}
        units = {} if k.mechanism.bare else dict(zip(k.names, (UNITS[kind] for kind in k.kinds), strict=True))
        independent = {*self.equations.independent}
        return [
            PrintedCoordinate(
                name, joints.get(name, ""), units.get(name, ""), "" if name in independent else "dependent"
            )
            for name in k.names
        ]

    @property
    def title(self) -> str:
        """What these equations are, in one line."""
        n = self.equations.mobility.n_dof
        method = self.equations.method.replace("_", "-")
        return f"method {method}, {n} degree{'s' * (n != 1)} of freedom{', functions of time' * self.of_time}"

    @property
    def attributes(self) -> tuple[str, ...]:
        """Attributes to read next."""
        loops: tuple[str, ...] = OF_LOOPS if self.equations.constraint_names else ()
        mechanism, there = self.equations.kinematics.mechanism, type(self.equations)
        loops = (*loops, "states", "state_rates") if mechanism.states else loops
        loops = (*loops, "sampled", "sampled_values") if mechanism.clocks else loops
        lacking = {*(OF_BODIES if mechanism.bare else ()), *(OF_PARTS if mechanism.given is not None else ())}
        lacking |= {"linearize"} if mechanism.states else set()  # refused
        return tuple(name for name in (*ATTRIBUTES, *loops) if hasattr(there, name) and name not in lacking)


def plain(line: str) -> str:
    """Text with ordinary spaces."""
    return line.replace(TIGHT, " ")
