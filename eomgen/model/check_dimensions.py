"""Expressions that were read -> faults where quantities of different dimensions meet.

The check runs where at least one parameter, input or output has a unit.  A parameter or input without one may be
anything.  A plain number as a term, or alone, may be anything too.  As a factor it may have any unit (``-40*x``,
``m*9.81``), save for the small ratios of formulas (``k*x^2/2``, ``2*pi*r``) beside a quantity whose unit was given.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partialmethod
from typing import Any, NamedTuple

from ..base.operations import OPERATIONS
from ..base.texts import place_of_marker
from ..elements.dimensions import ENERGY, FORCE, INERTIA, LENGTH, MASS, NONE, SPEED, SPIN, STIFFNESS, TIME, Dimension
from ..elements.element_type import Law
from ..elements.kinds import OUTPUT, Field
from ..expr.core import Expr, Graph, reachable
from .description import DescribedEntry, parent_of
from .fields import EQUATIONS, LAGRANGIAN, MODEL, acts_on_length, fields_of
from .mechanism import JointSpec, Output
from .names import ENERGIES, RATES
from .units import Unit, si_text, sound_unit
from .values import Reader

_NAMES = {
    NONE: "a number or an angle", LENGTH: "a length", MASS: "a mass", TIME: "a time", SPEED: "a speed",
    SPIN: "a rate", FORCE: "a force", ENERGY: "a torque or an energy", INERTIA: "a moment of inertia",
    STIFFNESS.along(True): "a stiffness", LENGTH.times(TIME, -2): "an acceleration",
}  # fmt: skip
_INFIX = {"add": "+", "sub": "-", "mul": "*", "div": "/", "pow": "**", "lt": "<", "le": "<=", "eq": "=="}
#: Factors that formulas have, and that hardly ever stand for a measured value: 2, 1/2, 1/3, 4/3 pi, ...
_RATIOS = frozenset(
    sign * a / b * turn for sign in (1, -1) for a in (1, 2, 3, 4, 6, 8, 12) for b in (1, 2, 3, 4, 6, 8, 12)
    for turn in (1.0, math.pi, 1 / math.pi)
)  # fmt: skip
#: Path -> the section and the entry.
_Places = dict[str, tuple[str, DescribedEntry | None]]
_STEP = re.compile(r"\[(\d+)\]|([^.\[\]]+)")


class Known(NamedTuple):
    """What is known of a part of an expression; ``declared`` tells whether a quantity with a given unit is in it."""

    dimension: Dimension | None
    declared: bool = False
    number: bool = False


def named(dimension: Dimension) -> str:
    """A dimension in a message: ``a length (m)``."""
    word = _NAMES.get(dimension)
    return f"{word} ({si_text(dimension)})" if word and dimension != NONE else word or si_text(dimension)


def check_dimensions(reader: Reader, joints: tuple[JointSpec, ...]) -> None:
    """Note a fault for every expression whose dimension is not what its field asks for, or whose terms differ."""
    units = reader.units
    if not units and not reader.description.bindings:
        return
    names = _names(reader, units, joints)
    check = _Check(reader.graph, names)
    kinds = {c: k.kind for j in joints for c, k in zip(j.coordinates, j.joint.coordinates, strict=True)}
    kinds |= {j.name: j.joint.coordinates[0].kind for j in joints if len(j.coordinates) == 1}
    moved = {*kinds, *(j.name for j in joints)}
    wrong = _check_bindings(reader, check)
    sections = [*reader.description.sections.items()][::-1]  # a joint before the lock that closes it
    places: _Places = {entry.path: (section, entry) for section, entries in sections for entry in entries}
    for path, expression, local in reader.expressions:
        if reader.faults.under(path) or (wrong and _takes_in(reader, wrong, path, expression)):
            continue
        section, entry, steps = _place(places, path)
        field, values = _field(section, entry, steps)

        def length(row: Field, section: str = section, entry: Any = entry) -> bool:
            if section == "joints":
                return kinds.get(entry.name) == "length"
            values = {} if entry is None else entry.values
            return acts_on_length(section, values, row, lambda name: kinds.get(name) == "length")

        def lost(row: Field, section: str = section, entry: Any = entry) -> bool:  # what it acts on is not known
            acts_on = entry.values if section in ("forces", "constraints") and entry is not None else {}
            return any(
                str(acts_on[key]) not in moved for key in (row.along, "coordinate") if acts_on.get(key) is not None
            )

        for word, row in field.local.items() if field is not None and local else ():
            if word in local:
                dimension = None if lost(row) else row.measured_in({}, (), length(row))
                check.known[local[word].id] = Known(dimension)
        numbers = tuple(step if isinstance(step, str) else int(step) for step in steps[1:])
        wanted = None if field is None or lost(field) else field.measured_in(values, numbers, length(field))
        if section in ("outputs", "inputs") and entry is not None and entry.path in units:
            wanted = units[entry.path].dimension
        if section == "states" and entry is not None and entry.path in units and steps[0] not in ("period", "offset"):
            wanted = units[entry.path].dimension.times(TIME, -1 if steps[0] == "rate" else 0)
        if steps and steps[0] in ("initial", "guess", "reset"):
            wanted = names.get(str(steps[-1]), Known(None)).dimension
            if place := place_of_marker(path.partition(".")[2]):
                wanted = SPEED if place[0].startswith("v") else LENGTH
        certain = section == "outputs" and check.is_certain(expression)
        mass = _plain_mass(entry) if wanted == INERTIA and section == "bodies" else 0.0
        for message, remedy in check.faults(expression, wanted, certain, mass):
            reader.fault(path, message, remedy, "EG-DIMENSION")


def _check_bindings(reader: Reader, check: _Check) -> dict[str, list[int]]:
    """Note what instances of components give for parameters and inputs of other dimensions; their nodes by instance.

    Of instances within others those are not judged that take in what is wrong with the outer one.
    """
    wrong: dict[str, list[int]] = {}
    quantities, count = dict(reader.quantities), len(reader.expressions)
    for one in sorted(reader.description.bindings, key=lambda one: one.instance.count(".")):
        if any(one.instance.startswith(f"{outer}.") for outer in wrong):
            continue
        expression = reader.expression(one.path, one.text, OUTPUT)
        unit = sound_unit(one.unit)
        for message, remedy in check.faults(expression, None if unit is None else unit.dimension):
            reader.fault(one.path, message, remedy, "EG-DIMENSION")
        if reader.faults.under(one.path):
            wrong.setdefault(one.instance, []).append(expression.id)
    reader.quantities = quantities  # its places in the instance ask for what it needs
    del reader.expressions[count:]
    return wrong


def _takes_in(reader: Reader, wrong: Mapping[str, list[int]], path: str, expression: Expr) -> bool:
    """Whether an expression is of an instance and has one of the nodes in it that the instance wrongly has."""
    origin = reader.faults.origin_of(path)[1]
    name = "" if origin is None else f"{origin.instance}."
    inside = {node for outer, nodes in wrong.items() if name.startswith(f"{outer}.") for node in nodes}
    return not inside.isdisjoint(reachable(reader.graph, [expression.id]))


def with_units(reader: Reader, joints: tuple[JointSpec, ...], outputs: tuple[Output, ...]) -> tuple[Output, ...]:
    """Outputs with the SI unit that follows from their expressions, where none is given and no number hides one.

    A rate and a plain number have no unit, unless the expression is a sum of angles or of their rates.
    """
    names = _names(reader, reader.units, joints)
    turned = {c for j in joints for c, k in zip(j.coordinates, j.joint.coordinates, strict=True) if k.kind == "angle"}
    angles = {name + suffix for name in turned for suffix in RATES}
    angles |= {name for name, quantity in reader.quantities.items() if quantity.turns}
    check = _Check(reader.graph, names)
    result = []
    for output in outputs:
        faulty = bool(list(check.faults(output.expression, None)))
        dimension = check.known[output.expression.id].dimension
        if not output.unit and dimension is not None and not faulty:
            nodes = [reader.graph.nodes[i] for i in reachable(reader.graph, [output.expression.id])]
            sums = {node[0] for node in nodes} <= {"sym", "neg", "add", "sub"}
            symbols = {str(node[1]) for node in nodes if node[0] == "sym"}
            angle = sums and symbols <= angles
            if sums and symbols <= {f"{name}()" for name in ENERGIES}:
                output = replace(output, unit="J")
            elif angle or (dimension != NONE and dimension.times(SPIN, -1) != NONE):
                output = replace(output, unit=si_text(dimension, "rad" if angle else ""))
        result.append(output)
    return tuple(result)


def _names(reader: Reader, units: Mapping[str, Unit], joints: tuple[JointSpec, ...]) -> dict[str, Known]:
    """What is known of every name that can stand in an expression."""
    result = {"t": Known(TIME)}
    for section in ("parameters", "inputs"):
        for entry in reader.description.sections[section]:
            if entry.path in units:
                for order, suffix in enumerate(RATES if section == "inputs" else ("",)):
                    dimension = units[entry.path].dimension.times(TIME, -order)
                    result.setdefault(f"{entry.name}{suffix}", Known(dimension, True))
    for entry in reader.description.sections["states"]:
        if entry.path in units:
            for order, suffix in enumerate(RATES[:2]):
                result[f"{entry.name}{suffix}"] = Known(units[entry.path].dimension.times(TIME, -order), True)
    declared = set(result)  # a coordinate of such a name is reported; what it measures is unknown
    for joint in joints:
        # the parameters of a curve or surface may be lengths, angles or anything else
        free = max((option.own for option in joint.joint.options.values()), default=0)
        for name, coordinate in list(zip(joint.coordinates, joint.joint.coordinates, strict=True))[free:]:
            dimension = LENGTH if coordinate.kind == "length" else NONE
            for order, suffix in enumerate(RATES):
                result[name + suffix] = Known(None if name in declared else dimension.times(TIME, -order))
        for name, velocity in zip(joint.velocities, joint.joint.velocities, strict=True):
            if velocity.of is None:
                dimension = SPEED if velocity.kind == "length" else SPIN
                result |= {name: Known(dimension), f"{name}_dot": Known(dimension.times(TIME, -1))}
    for name, quantity in reader.quantities.items():
        if quantity.dimension is not None:
            result[name] = Known(quantity.dimension)
    return result | {f"{name}()": Known(ENERGY) for name in ENERGIES}


def _place(places: _Places, path: str) -> tuple[str, DescribedEntry | None, list[Any]]:
    """Section, entry and the keys and indices that follow, of the path of an expression."""
    start = path
    while start and start not in places:
        start = parent_of(start)
    steps = [int(index) if index else word for index, word in _STEP.findall(path[len(start) :])]
    return (*places.get(start, (path.partition(".")[0], None)), steps)


def _field(section: str, entry: DescribedEntry | None, steps: list[Any]) -> tuple[Field | None, Mapping[str, Any]]:
    """The row of the field in which an expression stands, and the values of the entry, or of the law in it."""
    if entry is None:
        section_field = {"lagrangian": LAGRANGIAN, "equations": EQUATIONS}.get(section)
        key = steps[0] if section_field is None else steps[1] if len(steps) > 1 else ""
        return (MODEL if section_field is None else section_field).get(key.partition("[")[0]), {}
    row, values = fields_of(section, entry.values).get(steps[0]), entry.values
    if isinstance(row, Law) and len(steps) > 1:
        values = values[steps[0]]
        row, steps = row.keys_of(row.type_of(values)).get(steps[1]), steps[1:]
    return None if row is None else row.part([step for step in steps[1:] if isinstance(step, str)]), values


def _plain_mass(entry: DescribedEntry | None) -> float:
    """The mass of a body where it is a plain number, else 0."""
    try:
        mass = float(entry.values["mass"]) if entry is not None else 0.0
    except (KeyError, TypeError, ValueError):
        return 0.0
    return mass if math.isfinite(mass) else 0.0


class _Check:
    """The dimensions of the nodes of a graph, and what is wrong with them."""

    def __init__(self, graph: Graph, names: Mapping[str, Known]) -> None:
        self.graph, self.names = graph, names
        self.known: dict[int, Known] = {}
        self.wrong: dict[int, tuple[str, str]] = {}

    def is_certain(self, expression: Expr) -> bool:
        """Whether it is made of quantities alone, as ``x(tip) - s``, so that no number or law can hide a unit."""
        nodes = [self.graph.nodes[i] for i in reachable(self.graph, [expression.id])]
        known = all(self.names.get(str(node[1]), Known(None)).dimension for node in nodes if node[0] == "sym")
        return known and {node[0] for node in nodes} <= {"sym", "neg", "add", "sub", "mul", "div"}

    def faults(
        self, expression: Expr, wanted: Dimension | None, certain: bool = False, mass: float = 0.0
    ) -> Iterator[tuple[str, str]]:
        """Message and remedy of each fault of an expression.

        Where no given unit is in it, only sums are checked: in ``-rate**3`` or ``exp(-t)`` a factor of 1 has what unit
        it needs.  In an output that is ``certain`` there is no such factor.
        """
        nodes = reachable(self.graph, [expression.id])
        for i in nodes:
            if i not in self.known:
                self.known[i] = self._node(i)
        collected = [self.wrong[i] for i in nodes if i in self.wrong]
        yield from collected
        result = self.known[expression.id]
        if collected or wanted is None or result.dimension is None or not (result.declared or certain):
            return
        if mass and result.dimension.alike(wanted.times(MASS, -1)) and self.holds_mass(expression.id, mass):
            return
        if not result.dimension.alike(wanted):
            message = (
                f"{written(self.graph, expression.id)} is {named(result.dimension)}, and {named(wanted)} is needed here"
            )
            yield message, self._remedy(nodes, f"give {named(wanted)}")

    def holds_mass(self, i: int, mass: float, factor: float = 1.0) -> bool:
        """Whether the mass of a body, given as a plain number, is among the factors of its inertia.

        Of a body of ``mass: 4`` the moment ``4*l**2/12`` is in order: 4 is its mass and not a ratio of a formula.
        """
        kind, *operands = self.graph.nodes[i]
        if kind in ("add", "sub"):
            return any(self.holds_mass(k, mass, factor) for k in operands)
        sums = []
        pairs = [(i, 1)]
        while pairs:
            k, power = pairs.pop()
            kind, *operands = self.graph.nodes[k]
            if kind in ("mul", "div"):
                pairs += [(operands[0], power), (operands[1], -power if kind == "div" else power)]
            elif kind == "const" and operands[0]:
                factor *= float(operands[0]) ** power
            elif kind in ("add", "sub") and power == 1:
                sums.append(k)
        if sums:
            return any(self.holds_mass(k, mass, factor) for k in sums)
        return any(math.isclose(factor, ratio * mass) for ratio in _RATIOS)

    def _remedy(self, nodes: list[int], first: str) -> str:
        """What would be right, and the given units that led there."""
        used = [str(self.graph.nodes[i][1]) for i in nodes if self.graph.nodes[i][0] == "sym"]
        known = [(name, self.names[name]) for name in used if name in self.names]
        listed = ", ".join(
            f"{name} in {si_text(one.dimension)}" for name, one in known if one.dimension not in (None, NONE)
        )
        constant = any(self.graph.nodes[i][0] == "const" for i in nodes)
        advice = "; give a number that has a unit as a parameter" if constant else ""
        return f"{first}; here {listed} in SI units{advice}" if listed else first

    def _node(self, i: int) -> Known:
        kind, *operands = self.graph.nodes[i]
        if kind == "const":
            return Known(None, number=True)
        if kind == "sym":
            return self.names.get(operands[0], Known(None))
        row = OPERATIONS.get(kind)
        parts = [self.known[k] for k in operands]
        declared = any(part.declared for part in parts)
        if row is None:  # a function that the model declares
            return Known(None, declared)
        number = all(part.number for part in parts)
        return Known(getattr(self, f"_{row.dimension}")(i, parts, operands), declared, number)

    def _alike(self, i: int, parts: list[Known], operands: list[int]) -> Dimension | None:
        some = [(one.dimension, k) for one, k in zip(parts, operands, strict=True) if one.dimension is not None]
        if not some:
            return None
        for other, k in some[1:]:
            if not other.alike(some[0][0]):
                a, b = written(self.graph, some[0][1]), written(self.graph, k)
                message = f"{written(self.graph, i)} combines {named(some[0][0])}, {a}, with {named(other)}, {b}"
                nodes = reachable(self.graph, operands)
                self.wrong[i] = (
                    message,
                    self._remedy(nodes, f"both must be {named(some[0][0])}, or both {named(other)}"),
                )
                return None
        return some[0][0]

    def _choice(self, i: int, parts: list[Known], operands: list[int]) -> Dimension | None:
        return self._alike(i, parts[1:], operands[1:])

    def _ratio(self, i: int, parts: list[Known], operands: list[int]) -> Dimension | None:
        self._alike(i, parts, operands)
        return NONE

    _sign: Any = staticmethod(lambda i, parts, operands: NONE)

    def _pure(self, i: int, parts: list[Known], operands: list[int]) -> Dimension | None:
        for one, k in zip(parts, operands, strict=True):
            if one.declared and one.dimension is not None and not one.dimension.alike(NONE):
                message = f"{written(self.graph, i)} is taken of {named(one.dimension)}"
                remedy = "its argument must be an angle (rad) or a number without unit, such as a ratio of two lengths"
                self.wrong[i] = message, self._remedy(reachable(self.graph, [k]), remedy)
        return NONE

    def _product(self, i: int, parts: list[Known], operands: list[int], power: float = 1) -> Dimension | None:
        a, b = parts
        first, second = (
            NONE if one.number and other.declared and self._is_ratio(k) else one.dimension
            for one, other, k in ((a, b, operands[0]), (b, a, operands[1]))
        )
        return None if first is None or second is None else first.times(second, power)

    def _is_ratio(self, i: int) -> bool:
        kind, *value = self.graph.nodes[i]
        return kind == "const" and value[0] in _RATIOS

    _quotient = partialmethod(_product, power=-1)

    def _root(self, i: int, parts: list[Known], operands: list[int]) -> Dimension | None:
        return None if parts[0].dimension is None else NONE.times(parts[0].dimension, 0.5)

    def _power(self, i: int, parts: list[Known], operands: list[int]) -> Dimension | None:
        base, exponent = parts
        kind, *value = self.graph.nodes[operands[1]]
        if kind == "const":
            return None if base.dimension is None else NONE.times(base.dimension, value[0])
        self._pure(i, [exponent], operands[1:])
        return NONE if base.dimension is not None and base.dimension.alike(NONE) else None


def written(graph: Graph, i: int, depth: int = 5) -> str:
    """An expression in a message, without what is deep inside."""
    kind, *operands = graph.nodes[i]
    if kind == "sym":
        return str(operands[0]).partition("[")[0]
    if kind == "const":
        return f"{operands[0]:g}"
    if depth == 0:
        return "..."
    parts = [written(graph, k, depth - 1) for k in operands]
    if kind == "neg":
        return f"-{parts[0]}"
    if kind in _INFIX:
        inside: tuple[str, ...] = ("add", "sub") if kind in ("mul", "div", "pow") else ()
        inside += ("mul", "div", "neg") if kind == "pow" else ()
        a, b = (f"({t})" if graph.nodes[k][0] in inside else t for t, k in zip(parts, operands, strict=True))
        b = f"({b})" if kind == "div" and graph.nodes[operands[1]][0] in ("mul", "div") else b
        return f"{a}{_INFIX[kind]}{b}" if kind in ("mul", "div", "pow") else f"{a} {_INFIX[kind]} {b}"
    row = OPERATIONS.get(kind)
    return f"{(row.word or row.name) if row else kind}({', '.join(parts)})"
