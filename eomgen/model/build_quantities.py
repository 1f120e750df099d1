"""Parameters, inputs and outputs: their entries -> Parameter, Input and Output, values in SI units."""

from __future__ import annotations

import math
import sys
from dataclasses import replace

from ..base.operations import OPERATIONS
from ..elements.dimensions import NONE
from ..elements.kinds import MOTION, OUTPUT, Fields
from ..expr.core import LEAVES, Expr, reachable, symbols_of
from .checks import check_keys
from .description import DescribedEntry
from .fields import INPUT, OUTPUT_FIELDS, PARAMETER
from .mechanism import Input, Output, Parameter
from .printed_names import take_latex
from .quantities import VELOCITIES, Named
from .units import Unit, UnitError, read_unit
from .values import Reader
from .visit import motions_of, names_of


def read_described(reader: Reader, entry: DescribedEntry, fields: Fields) -> tuple[Unit, str]:
    """Unit and doc of an entry, its keys checked."""
    check_keys(entry.path, entry.values, fields, reader.faults)
    text, doc = (reader.text(f"{entry.path}.{key}", entry.values.get(key, "")) for key in ("unit", "doc"))
    take_latex(reader, f"{entry.path}.latex", entry.name, entry.values.get("latex", ""))
    try:
        unit = read_unit(text)
    except UnitError as error:
        reader.fault(f"{entry.path}.unit", str(error), error.remedy, "EG-UNIT")
        return Unit(NONE), doc
    if text:
        reader.units[entry.path] = unit
    return unit, doc


def in_si(reader: Reader, path: str, value: float | None, unit: Unit) -> float | None:
    """A value in SI units; one that no double holds there is a fault."""
    if value is None or unit.size == 1.0:
        return value
    found = value * unit.size
    if not math.isfinite(found) or (value != 0.0 and abs(found) < sys.float_info.min):
        remedy = "check the value and its unit"
        reader.fault(
            path, f"{value:g} {unit.text} in {unit.si} is outside the range of double precision", remedy, "EG-UNIT"
        )
        return None
    return found


def read_parameter(reader: Reader, entry: DescribedEntry) -> Parameter:
    """The parameter of an entry."""
    reader.names.declare("parameter", entry.name, entry.path)
    unit, doc = read_described(reader, entry, PARAMETER)
    given = entry.values.get("value")
    value = None if given is None else reader.number(f"{entry.path}.value", given)
    return Parameter(str(entry.name), in_si(reader, f"{entry.path}.value", value, unit), unit.si, doc)


def read_input(reader: Reader, entry: DescribedEntry) -> Input:
    """The input of an entry, without its expression over time."""
    reader.names.declare("input", entry.name, entry.path)
    unit, doc = read_described(reader, entry, INPUT)
    given = entry.values.get("value")
    value = 0.0 if given is None else reader.number(f"{entry.path}.value", given)
    return Input(str(entry.name), in_si(reader, f"{entry.path}.value", value, unit) or 0.0, unit.si, doc)


def with_signal(reader: Reader, given: Input, entry: DescribedEntry) -> Input:
    """The input with its expression over time, read when all coordinates are known."""
    if entry.values.get("signal") is None:
        return given
    path = f"{entry.path}.signal"
    expression = reader.expression(path, entry.values["signal"], MOTION)
    for name in sorted(symbols_of([expression])):
        if reader.names.kinds.get(name) == "input":
            remedy = "allowed are t, coordinates, velocities and parameters"
            reader.fault(path, f"the input {name!r} cannot be used here", remedy, "EG-REFERENCE")
    if any(reader.graph.nodes[i][0] not in (*OPERATIONS, *LEAVES) for i in reachable(reader.graph, [expression.id])):
        reader.fault(path, "a function of the model cannot be used here", "write out its expression", "EG-REFERENCE")
    return replace(given, signal=expression)


class Outputs:
    """The outputs of a model; force laws, events and other outputs may use them by name.

    Their names are taken in at once and their expressions read when they are asked for, since the outputs that one
    depends on may stand after it.
    """

    def __init__(self, reader: Reader, entries: list[DescribedEntry]) -> None:
        self._reader, self._entries = reader, entries
        self._places: dict[str, int] = {}
        self._read: dict[int, tuple[Output, Expr]] = {}
        self._open: list[int] = []  # those being read, each asked for by the one before
        for k, entry in enumerate(entries):
            kind = reader.names.kinds.get(entry.name) if isinstance(entry.name, str) else None
            if entry.name in self._places:
                reader.fault(entry.path, "the name is given to two outputs", "rename one", "EG-NAME-TAKEN")
            elif kind not in _REPEATED:
                reader.names.declare("output", entry.name, entry.path)
            if isinstance(entry.name, str):
                self._places.setdefault(entry.name, k)
        reader.output = self.expression

    def all(self) -> tuple[Output, ...]:
        """All outputs, in the order of their declaration."""
        return tuple(self._at(k)[0] for k in range(len(self._entries)))

    def expression(self, name: str) -> Expr:
        """The expression of the output with this name, in SI units."""
        return self._at(self._places[name])[1] if name in self._places else self._reader.stand_in

    def _at(self, k: int) -> tuple[Output, Expr]:
        if k in self._open:
            round_trip = [*self._open[self._open.index(k) :], k]
            message = f"depends on itself: {' -> '.join(str(self._entries[i].name) for i in round_trip)}"
            self._reader.fault(self._entries[k].path, message, "write one of them without the others", "EG-CIRCLE")
            return Output(str(self._entries[k].name), self._reader.stand_in), self._reader.stand_in
        if k not in self._read:
            self._open.append(k)
            self._read[k] = self._output(self._entries[k])
            self._open.pop()
        return self._read[k]

    def _output(self, entry: DescribedEntry) -> tuple[Output, Expr]:
        reader, faults, path = self._reader, self._reader.faults, entry.path
        unit, doc = read_described(reader, entry, OUTPUT_FIELDS)
        expression: Expr = reader.stand_in
        if "expression" in entry.values:
            expression = reader.expression(f"{path}.expression", entry.values["expression"], OUTPUT)
        if unit.size != 1.0 and expression.value is not None:
            remedy = "use a parameter with a unit"
            faults.add(f"{path}.unit", "the expression is a number whose unit is not known", remedy, "EG-UNIT")
        kind = reader.names.kinds.get(entry.name) if isinstance(entry.name, str) else None
        if kind in _REPEATED:
            if expression != reader.graph.symbol(entry.name):
                message = f"{entry.name!r} is a {kind}"
                faults.add(path, message, f"an output of that name must be {entry.name} itself", "EG-NAME-TAKEN")
            elif unit.size != 1.0:
                remedy = f"leave the unit out, or give the output in {unit.text} another name"
                faults.add(f"{path}.unit", f"{entry.name!r} is a {kind}, which is in SI units", remedy, "EG-UNIT")
        given = expression / unit.size if unit.size != 1.0 else expression
        return Output(str(entry.name), given, unit.text, doc, self._of_velocities(entry, expression)), expression

    def _of_velocities(self, entry: DescribedEntry, expression: Expr) -> bool:
        """Whether an output is written with velocities, also where they cancel, as in ``0*vx(b) - 2``."""
        text, kinds = entry.values.get("expression"), self._reader.names.kinds
        names = {*symbols_of([expression]), *names_of(text)}
        motions = [*filter(None, map(Named.parse, names)), *motions_of(text)]
        return (
            any(motion.level in VELOCITIES for motion in motions)
            or any(kinds.get(name) in ("velocity", "rate") for name in names)
            or any(
                self._at(k)[0].of_velocities
                for k in (self._places[name] for name in names if name in self._places)
                if k not in self._open
            )
        )


#: Kinds of names that an output may repeat.
_REPEATED = ("coordinate", "velocity", "acceleration", "multiplier")
