"""Stage describe, names in expressions: the one namespace of a model -> what each name means and where it may stand."""

from __future__ import annotations

import keyword
import re
from collections.abc import Callable, Iterator, Mapping

from ..errors import ExpressionError
from ..frames import Marker
from ..graph.core import Expr, Graph
from .description import Faults
from .fields import CONSTANT, MOTION, NUMBER, OUTPUT
from .mechanism import TURNING, Quantity
from .names import COM, QUANTITIES, TOTALS, fault_of_name, nearest

#: Kind of name -> the least level of a field in which it may stand.
LEVELS = {"parameter": CONSTANT, "time": MOTION, "input": MOTION, "coordinate": MOTION, "velocity": MOTION}
LEVELS |= {"rate": MOTION, "rate of rate": OUTPUT}  # of Euler parameters, which no velocity is
LEVELS |= {"multiplier": OUTPUT}  # of the constraints of given equations
LEVELS |= {"acceleration": OUTPUT, "output": OUTPUT + 1}  # an output is for reading results only
LEVELS |= {"event": OUTPUT + 1}
LEVELS |= {"function": OUTPUT + 1}  # by itself; calls are not looked up here

_LEVEL_REMEDY = {
    NUMBER: "allowed are numbers and pi",
    CONSTANT: "allowed are numbers, parameters and pi",
    MOTION: "allowed are t, parameters, inputs, coordinates and their velocities",
    OUTPUT: "allowed are t, parameters, inputs, coordinates, their rates, motion of markers and energies",
}
_QUANTITY = re.compile(rf"({'|'.join(QUANTITIES)})\((.+)\)\Z", re.DOTALL)
RATES = ("", "_dot", "_ddot")
#: Kind declared -> kinds of the name, its ``_dot`` and its ``_ddot``.
_RATES_OF = {
    "coordinate": ("coordinate", "velocity", "acceleration"),
    "parameter of rotation": ("coordinate", "rate", "rate of rate"),
    "velocity": ("velocity", "acceleration"),
}
#: Energies of the whole mechanism, for outputs; a name of the model's own comes first.
ENERGIES = ("kinetic_energy", "potential_energy", "total_energy")


def quantity_of(name: str) -> tuple[str, str] | None:
    """``("vx", "rod.tip")`` of the symbol name ``vx(rod.tip)``; None for other names."""
    found = _QUANTITY.match(name)
    return (found.group(1), found.group(2)) if found else None


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
            self.faults.add(path, *(fault or ("", "")))
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
            own = "" if clash == name else f", and {clash!r} is the rate of {name!r}"
            self.faults.add(
                path,
                f"the name {clash!r} is already used by the {other}{own}",
                "parameters, inputs, functions, coordinates, outputs and events share one namespace, with the _dot "
                "and _ddot of coordinates; rename one",
            )
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
        self,
        graph: Graph,
        names: Namespace,
        path: str,
        level: int,
        marker: Callable[[str], Marker],
        quantities: dict[str, Quantity],
        local: Mapping[str, Expr] | None = None,
        exclusive: bool = False,
    ) -> None:
        self.graph, self.names, self.path, self.level = graph, names, path, level
        self.marker, self.quantities = marker, quantities
        self.local, self.exclusive = local or {}, exclusive

    def resolve(self, name: str) -> Expr:
        """The expression of a name."""
        if name in self.local:
            kind = self.names.kinds.get(name) if self.exclusive else None
            if kind is not None:
                message = (
                    f"{name!r} is a variable of the element and also the {kind} at {self.names.places.get(name, '?')}"
                )
                self.names.faults.add(self.path, message, f"rename the {kind}")
            return self.local[name]
        quantity = quantity_of(name)
        if quantity is not None:
            try:
                return self.locate(*quantity)
            except ExpressionError as error:
                self.names.faults.add(self.path, error.message, error.remedy)
                return self.graph.symbol(name)
        kind = self.names.kinds.get(name)
        if self.level == NUMBER:
            self._refuse(name, "name")
        elif kind is None and name in ENERGIES and self.level >= OUTPUT:
            return self.graph.symbol(f"{name}()")
        elif kind is None and name in TOTALS and self.level >= OUTPUT:
            self.quantities[f"{name}()"] = Quantity(None, *TOTALS[name])
            return self.graph.symbol(f"{name}()")
        elif kind is None:
            known = [*self.local, *(n for n, k in self.names.kinds.items() if LEVELS[k] <= self.level)]
            remedy = f"{nearest(name, known, 'known here')}; or declare a parameter of that name"
            self.names.faults.add(self.path, f"unknown name {name!r}", remedy)
        elif LEVELS[kind] > self.level:
            self._refuse(name, kind)
        return self.graph.symbol(name)

    def locate(self, quantity: str, marker: str) -> Expr:
        """The symbol of a marker's motion, e.g. ``vx(rod.tip)``; raises ExpressionError for an unknown marker."""
        name = f"{quantity}({marker})"
        if self.level < OUTPUT:
            self._refuse(name, "motion of a marker")
            return self.graph.symbol(name)
        level, axis = QUANTITIES[quantity]
        self.quantities[name] = Quantity(self._point(quantity, marker), level, axis)
        return self.graph.symbol(name)

    def _point(self, quantity: str, marker: str) -> Marker | None:
        """The marker of a label; None for the centre of mass of all bodies."""
        try:
            return self.marker(marker)
        except ExpressionError:
            if marker != COM:
                raise
        if quantity == "angle" or QUANTITIES[quantity][0] in TURNING:
            raise ExpressionError("the centre of mass of all bodies has no rotation", 0, "give a marker of a body")
        return None

    def _refuse(self, name: str, kind: str) -> None:
        remedy = f"only {_LEVEL_REMEDY[self.level]}"
        self.names.faults.add(self.path, f"the {kind} {name!r} cannot be used here", remedy)
