"""Names: what is wrong with one, or what was probably meant; the one namespace of a model and where each may stand."""

from __future__ import annotations

import keyword
import re
import sys
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from typing import Any

from ..base.operations import OPERATIONS
from ..base.texts import LONGEST as LONGEST
from ..base.texts import hint, joined
from ..elements.frames import Marker
from ..elements.kinds import CONSTANT, LAW, MOTION, NUMBER, OUTPUT
from ..errors import ExpressionError
from ..expr.core import Expr, Graph, symbols_of
from ..expr.texts import quoted
from .description import Faults
from .quantities import ANGLES, COM, PAIRS, TOTALS, TURNING, Named, Quantity, call_of

#: Arguments that a function of any number of them takes at most.
MOST = 64
LISTED = 20  #: names that a message lists at most


def callable_names() -> dict[str, tuple[int, int]]:
    """Functions an expression may call, with the least and the greatest number of arguments."""
    rows = [row for row in OPERATIONS.values() if row.word]
    result = {row.word: (row.arity, MOST if row.many else row.arity) for row in rows}
    return {**result, "heaviside": (1, 1), "deg": (1, 1), "diff": (2, 17)}


_C_KEYWORDS = frozenset(
    word
    for line in (
        "auto break case char const continue default do double else enum extern float for goto if inline int long",
        "register restrict return short signed sizeof static struct switch typedef union unsigned void volatile while",
    )
    for word in line.split()
)
#: Packages that an exported package imports, or the like, and its own parts.
_NEEDED = frozenset(("numpy", "scipy", "pandas", "matplotlib", "sympy", "cython", "setuptools", "eomgen"))
_NEEDED |= {"errors", "limits", "numeric", "runtime"}
#: Headers in quotes in what Cython writes, in lower case: some systems do not tell it from upper case in file names.
_HEADERS = frozenset(("python", "pythread", "structmember", "frameobject"))
_STRANGE = re.compile(r"[^A-Za-z0-9_]")
_IDENTIFIER = re.compile(r"[A-Za-z][A-Za-z0-9_]*\Z", re.ASCII)

IDENTIFIER_RULE = "a name must start with a letter and contain only letters a to z, digits and underscores"


def fault_of_name(name: object, symbol: bool = False) -> tuple[str, str] | None:
    """Message and remedy of what is wrong with a name; None if it can be used.

    A ``symbol`` will stand in expressions by itself (parameter, input, coordinate, output), so that names with a
    meaning of their own are refused too.
    """
    if not isinstance(name, str):
        return f"{quoted(name)} is not a name", IDENTIFIER_RULE
    if not _IDENTIFIER.match(name):
        cut = name.count(")") > name.count("(")  # by a comma: {shake: hypot(x, y)}
        remedy = "put an expression with commas in quotes between { }; " if cut else ""
        return f"{quoted(name)} is not an identifier", remedy + IDENTIFIER_RULE
    if len(name) > LONGEST:
        return f"a name of {len(name)} characters is too long", f"at most {LONGEST} characters"
    if name in ("t", "pi") and symbol:
        return f"{name!r} is reserved for the {'time' if name == 't' else 'number pi'}", "choose another name"
    what = "a reserved word of Python" if keyword.iskeyword(name) else ""
    if symbol and not what:
        what = "a reserved word of C" if name in _C_KEYWORDS else "a built-in function" * (name in callable_names())
    return (f"{name!r} is {what}", f"choose another name, e.g. {name}_") if what else None


def clean_name(name: str, kind: str) -> str:
    """An identifier as near to a name as can be."""
    result = _STRANGE.sub("_", name)
    if not result[:1].isalpha():
        result = f"{kind}_{result.lstrip('_')}"
    return f"{result}_" if fault_of_name(result[:LONGEST], symbol=True) else result


def unique(name: str, kind: str, taken: set[str], suffixes: Collection[str] = ("",)) -> str:
    """A clean name, with a number where it is taken with one of the suffixes; it is taken with all of them then."""
    base = new = clean_name(name, kind)[: LONGEST - 12]  # leaves place for a number and _ddot
    count = 1
    while not taken.isdisjoint(new + suffix for suffix in suffixes):
        count, new = count + 1, f"{base}_{count + 1}"
    taken.update(new + suffix for suffix in suffixes)
    return new


def fault_of_model_name(name: object) -> tuple[str, str] | None:
    """What is wrong with the name of a model, which is that of the package generated; see :func:`fault_of_name`."""
    if isinstance(name, str) and (name in _NEEDED or name in sys.stdlib_module_names):
        whose = "a module that eomgen needs" if name in _NEEDED else "a module of Python's library"
        return f"a package {name!r} would hide {whose}", f"choose another name, e.g. {name}_model"
    if isinstance(name, str) and (name.lower() in _HEADERS or re.match("eom(gen|_|$)", name.lower())):
        return (
            f"{name[:LONGEST]!r} is a name of files and functions that every package has",
            "choose another name, e.g. my_model",
        )
    return fault_of_name(name, symbol=True)


def listing(known: Iterable[str], most: int = LISTED) -> str:
    """The first names joined by commas, and how many there are; ``"none"`` if there are none."""
    names = list(known)
    listed = ", ".join(names[:most])
    return (listed + f", ... ({len(names)} in all)" if len(names) > most else listed) or "none"


def nearest(name: str, known: Iterable[str], what: str = "known", more: Iterable[str] = ()) -> str:
    """A remedy for an unknown name: the near miss if there is one, of ``more`` too, and what is allowed."""
    options = list(known)
    return joined(hint(name, [*options, *more]), f"{what}: {listing(options)}", by=" ")


# -- the one namespace of a model --------------------------------------------------------------------------------------


#: Kind of name -> the least level of a field in which it may stand.
LEVELS = {"parameter": CONSTANT, "time": MOTION, "input": MOTION, "coordinate": MOTION, "velocity": MOTION}
LEVELS |= {"rate": MOTION, "rate of rate": OUTPUT}  # of Euler parameters, which no velocity is
LEVELS |= {"multiplier": OUTPUT}  # of the constraints of given equations
LEVELS |= {"acceleration": OUTPUT, "output": LAW}
LEVELS |= {"state": LAW, "rate of a state": OUTPUT}
LEVELS |= {"event": OUTPUT + 1}
LEVELS |= {"function": OUTPUT + 1}  # by itself; calls are not looked up here

_LEVEL_REMEDY = {
    NUMBER: "allowed are numbers and pi",
    CONSTANT: "allowed are numbers, parameters and pi",
    MOTION: "allowed are t, parameters, inputs, coordinates and their velocities",
    LAW: "allowed are t, parameters, inputs, coordinates and their velocities, states, positions and velocities of "
    "markers, and outputs of these",
    OUTPUT: "allowed are t, parameters, inputs, coordinates, states, their rates, motion of markers and energies",
}
RATES = ("", "_dot", "_ddot")
#: Kind declared -> kinds of the name, its ``_dot`` and its ``_ddot``.
_RATES_OF = {
    "coordinate": ("coordinate", "velocity", "acceleration"),
    "parameter of rotation": ("coordinate", "rate", "rate of rate"),
    "velocity": ("velocity", "acceleration"),
    "state": ("state", "rate of a state"),
}
#: Energies of the whole mechanism, for outputs; a name of the model's own comes first.
ENERGIES = ("kinetic_energy", "potential_energy", "total_energy")


def names_of_acceleration(reader: Any, used: Iterable[str]) -> Iterator[tuple[str, str]]:
    """Those of the symbols ``used`` that are known only when accelerations are, and what they are."""
    prefixes = {"acceleration": "acceleration", "rate of rate": "second rate", "multiplier": "multiplier"}
    prefixes["rate of a state"] = "rate of a state"
    for name in sorted(used):
        what, quantity = prefixes.get(reader.names.kinds.get(name, "")), reader.quantities.get(name)
        if quantity is not None and quantity.measure.order == 2:
            what = "acceleration"
        if what is not None:
            yield name, what


class Namespace:
    """The names of one model: parameters, inputs, coordinates with their rates, and the time."""

    def __init__(self, faults: Faults) -> None:
        self.faults = faults
        self.kinds: dict[str, str] = {"t": "time"}
        self.places: dict[str, str] = {}
        self.refused: set[str] = set()

    def declare(self, kind: str, name: object, path: str) -> bool:
        """Take a name in; faults of the name, and clashes with others, are noted.  Returns whether it is usable.

        A coordinate brings its rates along, a velocity (one that is no coordinate's rate) its own.
        """
        levels = _RATES_OF.get(kind, (kind,))
        fault = fault_of_name(name, symbol=True)
        if fault or not isinstance(name, str):
            self.faults.add(path, *(fault or ("", "")), code="EG-NAME-FORM")
            self._refuse(levels[0], name, path)
            return False
        names = [name + suffix for suffix in RATES[: len(levels)]]
        kind = levels[0]
        clash = next((n for n in names if n in self.kinds), None)
        for n, level in zip(names, levels, strict=True):
            if n not in self.kinds:  # also after a clash, so that users of the name are not at fault too
                self.kinds[n] = level
                self.places[n] = path
        if clash is not None:
            other = f"{self.kinds[clash]} at {self.places[clash]}"
            reason = "" if clash == name else f", and {clash!r} is the rate of {name!r}"
            message = f"the name {clash!r} is already used by the {other}{reason}"
            remedy = "parameters, inputs, functions, coordinates, states, outputs and events share one namespace, with "
            self.faults.add(path, message, f"{remedy}the _dot and _ddot of coordinates; rename one", "EG-NAME-TAKEN")
            return False
        return True

    def _refuse(self, kind: str, name: object, path: str) -> None:
        """Take in a name that cannot be used, so that expressions that use it are not at fault too."""
        if isinstance(name, str):
            self.refused.add(name)
            if self.kinds.get(name) in (None, "time"):
                self.kinds[name], self.places[name] = kind, path

    def explains(self, error: ExpressionError) -> bool:
        """Whether an expression is wrong only because of a name that was refused where it was declared."""
        return any(
            f"'{name}'" in error.message or (keyword.iskeyword(name) and name in error.text) for name in self.refused
        )

    def of(self, *kinds: str) -> Iterator[str]:
        """Names of the given kinds, in order of declaration."""
        return (name for name, kind in self.kinds.items() if kind in kinds)


class Scope:
    """What the names of one expression mean.

    Unknown and misplaced names are noted as faults at ``path`` and stood in for by a placeholder, so that one reading
    tells all of them.
    """

    def __init__(
        self, reader: Any, path: str, level: int, local: Mapping[str, Expr] | None = None, exclusive: bool = False
    ) -> None:
        self.reader = reader
        self.graph: Graph = reader.graph
        self.names: Namespace = reader.names
        self.marker: Callable[[str], Marker] = reader.moving
        self.output: Callable[[str], Expr] = reader.output
        self.path, self.level, self.local, self.exclusive = path, level, local or {}, exclusive

    def resolve(self, name: str) -> Expr:
        """The expression of a name."""
        if name in self.local:
            kind = self.names.kinds.get(name) if self.exclusive else None
            if kind not in (None, "output"):
                message = (
                    f"{name!r} is a variable of the element and also the {kind} at {self.names.places.get(name, '?')}"
                )
                self.names.faults.add(self.path, message, f"rename the {kind}", "EG-NAME-TAKEN")
            return self.local[name]
        if (call := call_of(name)) is not None:
            try:
                return self.locate(Named.read(call))
            except ExpressionError as error:
                self.names.faults.add(self.path, error.message, error.remedy, error.code)
                return self.graph.symbol(name)
        kind = self.names.kinds.get(name)
        if kind == "output" and name in (*ENERGIES, *TOTALS) and self.path == f"{self.names.places[name]}.expression":
            kind = None  # an output of that very sum
        if self.level == NUMBER:
            self._refuse(name, "name")
        elif kind is None and name in ENERGIES and self.level >= OUTPUT:
            return self.graph.symbol(f"{name}()")
        elif kind is None and name in TOTALS and self.level >= LAW:
            self.reader.quantities[f"{name}()"] = Quantity(*TOTALS[name])
            return self.graph.symbol(f"{name}()")
        elif kind is None:
            known = [n for n, k in self.names.kinds.items() if LEVELS[k] <= self.level]
            known = [*self.local, *self.names.faults.names_at(self.path, known), "pi"]
            remedy = f"{nearest(name, known, 'known here')}; or declare a parameter of that name"
            self.names.faults.add(self.path, f"unknown name {name!r}", remedy, "EG-NAME-UNKNOWN")
        elif LEVELS[kind] > self.level:
            self._refuse(name, kind)
        elif kind == "output":
            return self._read(name)
        elif kind in ("velocity", "rate"):
            self.reader.of_velocities.add(self.path)
        return self.graph.symbol(name)

    def _read(self, output: str) -> Expr:
        """The expression of an output."""
        result = self.output(output)
        if f"{self.names.places[output]}.expression" in self.reader.of_velocities:
            self.reader.of_velocities.add(self.path)
        used = symbols_of([result]) if self.level < OUTPUT else set()
        accelerations = [f"the {what} {name!r}" for name, what in names_of_acceleration(self.reader, used)]
        for what in (*accelerations, *(repr(energy) for energy in sorted(ENERGIES) if f"{energy}()" in used)):
            message = f"the output {output!r} depends on {what}, which cannot be used here"
            self.names.faults.add(self.path, message, f"only {_LEVEL_REMEDY[self.level]}", "EG-REFERENCE")
        return result

    def locate(self, named: Named) -> Expr:
        """The symbol of ``vx(rod.tip)`` or ``force(k1)``; raises ExpressionError for an unknown marker or element."""
        if not named.is_motion:
            if self.level < LAW:
                kind = "reaction" if named.is_reaction else "quantity of a force element"
                self._refuse(str(named), kind)
            else:
                self.reader.ask(named, self.path)
            return self.graph.symbol(str(named))
        measure, part = named.measured
        if self.level < LAW or (self.level < OUTPUT and measure.order == 2):
            self._refuse(str(named), "motion of a marker" if self.level < LAW else "acceleration of a marker")
            return self.graph.symbol(str(named))
        if measure.order == 1:
            self.reader.of_velocities.add(self.path)
        seen = named
        if named.name in PAIRS[2:] and named.origin == COM:  # a distance is the same from either end
            seen = named._replace(of=named.origin, origin=named.of)
        of_all = COM if COM not in self.reader.bodies else None
        if seen.of == of_all and measure in (*ANGLES, *TURNING):
            raise ExpressionError("the centre of mass of all bodies has no rotation", 0, "give a marker of a body")
        point = None if seen.of == of_all else self.marker(seen.of)
        if of_all in (seen.origin, seen.axes):
            remedy = "give a marker of a body here; com can be a marker of distance() and the first of x()"
            raise ExpressionError("the centre of mass of all bodies is no marker", 0, remedy)
        origin, axes = (self.marker(label) if label else None for label in (seen.origin, seen.axes))
        self.reader.quantities[str(named)] = Quantity(measure, part, point, origin, axes)
        return self.graph.symbol(str(named))

    def _refuse(self, name: str, kind: str) -> None:
        remedy = f"only {_LEVEL_REMEDY[self.level]}"
        self.names.faults.add(self.path, f"the {kind} {name!r} cannot be used here", remedy, "EG-REFERENCE")


_SURROGATES = re.compile("[\ud800-\udbff][\udc00-\udfff]")
_LONE = re.compile("[\ud800-\udfff]")


def join_surrogates(text: str) -> str:
    """The text with each pair of surrogates, as JSON writes a character beyond U+FFFF, as that character."""
    return _SURROGATES.sub(lambda pair: pair[0].encode("utf-16", "surrogatepass").decode("utf-16"), text)


def lone_surrogate(text: str) -> str:
    """``U+D83D`` of the first half of a pair that stands alone, which no file can hold; empty if there is none."""
    match = _LONE.search(join_surrogates(text))
    return f"U+{ord(match[0]):04X}" if match else ""


#: What to do about one.
WHOLE = "write the character itself, or both halves of its pair"
