"""Numbers, texts and SymPy as the user gave them -> graph expressions, frames and markers.

Every method notes what is wrong with a value as a fault at its path and returns a stand-in, so that one pass over a
description finds all of its problems.
"""

from __future__ import annotations

import math
import numbers
import os
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from ..base.files import usable_name
from ..base.limits.numbers import PERPENDICULAR
from ..base.texts import hint
from ..base.value_rules import ROTATION, word_of_check
from ..elements import kinds
from ..elements.element_type import Entry, Found, Meaning
from ..elements.frames import (
    GROUND,
    TURNS,
    Columns,
    Frame,
    Marker,
    axes_columns,
    axis_columns,
    complete_axes,
    rpy_rotation,
    turn_matrix,
)
from ..elements.joints import JOINTS
from ..elements.kinds import CONSTANT, LAW, MARKER, NUMBER, PLACED
from ..errors import ExpressionError
from ..expr import vectors as vec
from ..expr.core import Expr, Graph
from ..expr.latex import NotationError, read_latex, spaced
from ..expr.texts import printed, quoted
from ..expr.vectors import Mat3, Vec3
from .checks import check_keys
from .description import GROUND_NAME, Description, Faults, items, label_of
from .expressions import parse
from .mechanism import Body, BodyShape, JointSpec
from .names import ENERGIES, RATES, WHOLE, Namespace, Scope, join_surrogates, lone_surrogate, nearest
from .quantities import REACTIONS, Named, Quantity
from .requirements import Requirements
from .sympy_face import is_sympy, lower_sympy, name_of, named
from .units import Unit

_A = {"length": "a length", "angle": "an angle"}
#: Kinds of names of motions, of Euler parameters too -> how many derivatives they are.
_LEVELS = {"coordinate": 0, "velocity": 1, "acceleration": 2, "rate": 1, "rate of rate": 2}


def is_number(value: object) -> bool:
    """Whether a value is a plain real number (truth values are not), or one in an array of no axes."""
    if getattr(value, "shape", None) == () and hasattr(value, "dtype"):
        return bool(value.dtype.kind in "iuf")
    return isinstance(value, numbers.Real) and not isinstance(value, bool)


class Reader:
    """Reads values of one description into one graph."""

    def __init__(self, graph: Graph, names: Namespace, faults: Faults, description: Description) -> None:
        self.graph, self.names, self.faults, self.description = graph, names, faults, description
        self.fault = faults.add  # path, message, remedy, code
        self.identity = vec.identity(graph)
        self.bodies: dict[str, int] = {GROUND_NAME: GROUND}  # by name, the index
        self.markers: dict[str, Marker] = {}  # named ones (``rod.tip``) and the bodies' own frames (``rod``)
        self.quantities: dict[str, Quantity] = {}  # of markers and elements, by the symbols that expressions use
        self.of_velocities: set[str] = set()  # paths of expressions that speak of velocities, also where these cancel
        self.output: Callable[[str], Expr] = graph.symbol  # the expression of an output
        self.stand_in = graph.symbol("?")
        self.requirements = Requirements(faults)  # with the declared values of parameters
        self.units: dict[str, Unit] = {}  # by path of the parameter, input or output
        self.latex: dict[str, str] = {}  # by name, where it is given
        self.expressions: list[tuple[str, Expr, Mapping[str, Expr]]] = []  # path, expression, names of its own
        self.table: Callable[..., Any] = lambda *of: None  # reads a table
        self.joints: Sequence[Any] = ()  # declared, with the names of their coordinates
        self.specs: Sequence[JointSpec] = ()  # the same, whose markers are read
        #: Shapes of bodies in pictures, by ``display`` or ``solids`` and the name of the body.
        self.drawn: defaultdict[tuple[str, str], list[BodyShape]] = defaultdict(list)
        self.mass_data: Sequence[Body] = ()  # bodies whose masses are read
        self.contacts: dict[str, str] = {}  # path of a cam -> the angle that finds its contact
        self.added: tuple[list[Body], list[JointSpec]] = [], []  # what contacts add

    def ask(self, quantity: Named, path: str) -> None:
        """Note that an expression uses what an element does; ExpressionError if there is none of that name."""
        what, listed, places = "force element", "elements", ["forces"]
        if quantity.is_reaction:
            what, listed, places = "constraint or joint", "known", ["constraints", "joints"]
        if quantity.is_reaction and quantity.part:
            what, places = "joint", ["joints"]
        names = [str(entry.name) for place in places for entry in self.description.sections[place]]
        if (name := quantity.owner) not in names:
            raise ExpressionError(f"no {what} {name!r}", 0, nearest(name, names, listed), code="EG-NAME-UNKNOWN")
        marker, axes = (self.moving(label) if label else None for label in (quantity.on, quantity.axes))
        made = Quantity(*quantity.measured, marker, None, axes, quantity.of, path)
        self.quantities.setdefault(str(quantity), made)

    def known(self, expression: Expr) -> float | None:
        """The value of an expression at the declared values of parameters, None if they do not tell."""
        result = self.requirements.known([expression])
        return None if result is None else float(result[0])

    def wrong(
        self, path: str, value: object, kind: kinds.Field | type[kinds.Field], code: str = "EG-TYPE", remedy: str = ""
    ) -> None:
        """Note that a value is not of a kind."""
        if value is None:
            self.fault(path, "has no value", f"give {kind.says}", "EG-MISSING")
        else:
            self.fault(path, f"{quoted(value, 80)} is not {kind.says}", remedy, code)

    def unknown(self, path: str, what: str, name: object, known: Iterable[str], listed: str) -> None:
        """Note a name that is none of the known ones, which are listed as such."""
        remedy = nearest(printed(name), self.faults.names_at(path, known), listed)
        self.fault(path, f"no {what} {quoted(name)}", remedy, "EG-NAME-UNKNOWN")

    def type_of(self, path: str, values: Mapping[str, Any], types: Iterable[str], what: str, key: str = "type") -> str:
        """The type that an entry names, one of a table; empty where it is none, which is noted."""
        raw = values.get(key)
        if isinstance(raw, str) and raw in types:
            return raw
        if raw is None:  # a code never changes: this one is EG-MISSING of joints and solids alone
            code = "EG-MISSING" if what in ("joint", "solid") else "EG-CHOICE"
            self.fault(f"{path}.{key}", "is missing", f"give one of {', '.join(types)}", code)
        else:
            remedy = nearest(printed(raw), types, "types")
            self.fault(f"{path}.{key}", f"no {what} of type {quoted(raw)}", remedy, "EG-CHOICE")
        return ""

    def check_keys(self, path: str, values: Mapping[str, Any], fields: kinds.Fields) -> None:
        """Note keys that a table does not know, and required ones that are missing."""
        check_keys(path, values, fields, self.faults)

    def check_names(self, path: str, raw: Iterable[Any], names: Sequence[str]) -> None:
        """Note names that are none of these."""
        for name in raw:
            if name not in names:
                remedy = nearest(str(name), names, "allowed")
                self.fault(f"{path}.{name}", "unknown key", remedy, "EG-NAME-UNKNOWN")

    # -- scalars --------------------------------------------------------------------------------------------------
    def expression(
        self,
        path: str,
        value: Any,
        level: int = CONSTANT,
        local: Mapping[str, Expr] | None = None,
        exclusive: bool = False,
    ) -> Expr:
        """A scalar: a number, a text or a SymPy expression.

        Names in ``local`` come before those of the model; with ``exclusive`` a name must not be both.
        """
        result = self._expression(path, value, level, local, exclusive)
        if result.value is None:
            self.expressions.append((path, result, local or {}))
        return result

    def _expression(self, path: str, value: Any, level: int, local: Mapping[str, Expr] | None, exclusive: bool) -> Expr:
        scope = Scope(self, path, level, local, exclusive)
        try:
            if isinstance(value, str):
                return parse(value, self.graph, scope.resolve, scope.locate if level >= LAW else None)
            if is_sympy(value):
                return lower_sympy(self.graph, value, scope.resolve)
            if is_number(value):
                return self.graph.constant(float(value))
        except ExpressionError as error:
            if not self.names.explains(error):
                self.fault(path, error.place(), error.remedy, error.code)
            return self.stand_in
        except OverflowError:
            self.fault(path, f"{quoted(value)} is not a finite number", code="EG-NUMBER")
            return self.stand_in
        self.wrong(path, value, kinds.Scalar)
        return self.stand_in

    def number(self, path: str, value: Any, positive: bool = False) -> float | None:
        """A number; a text or SymPy expression without names counts as one."""
        kind = kinds.PositiveNumber if positive else kinds.Number
        result = value
        if isinstance(value, str) or is_sympy(value):
            result = self.expression(path, value, NUMBER).value
        try:
            finite = is_number(result) and math.isfinite(result)
        except OverflowError:  # a whole number of hundreds of digits
            finite = False
        if not finite or (positive and result <= 0):
            if not self.faults.under(path):
                self.wrong(path, value, kind, "EG-RANGE" if finite else "EG-TYPE")
            return None
        return float(result)

    def text(self, path: str, value: Any) -> str:
        """A text, pairs of surrogates as the characters that they mean."""
        if not isinstance(value, str):
            self.wrong(path, value, kinds.Text)
            return ""
        half = lone_surrogate(value)
        if half:
            self.fault(path, f"contains {half}, which is half of a character pair", WHOLE, "EG-TYPE")
            return ""
        return join_surrogates(value)

    def file(self, path: str, value: Any) -> str | None:
        """The name of a file; None where no file can have it."""
        if not isinstance(value, str | os.PathLike):
            self.wrong(path, value, kinds.File)
            return None
        name = usable_name(value)
        if name is None:
            message = f"{value!r:.200} is empty, or contains a character that file names cannot have"
            self.fault(path, message, "give another name", "EG-FILE")
        return name

    def flag(self, path: str, value: Any) -> bool:
        """True or false; True when it is neither."""
        if isinstance(value, bool):
            return value
        self.wrong(path, value, kinds.Flag)
        return True

    def check_word(self, path: str, value: Any) -> str:
        """What becomes of an impossible inertia: error, note or off; true and false mean error and off."""
        word = word_of_check(value)
        if word is None:
            self.wrong(path, value, kinds.Check)
        return word or "error"

    def choice(self, path: str, value: Any, field: kinds.Field) -> str:
        """One of the words of a field; the default when it is another."""
        if isinstance(value, str) and value in field.choices:
            return value
        allowed = list(field.choices)
        remedy = nearest(value, allowed, "allowed") if isinstance(value, str) else f"allowed: {', '.join(allowed)}"
        self.fault(path, f"{quoted(value)} is not known", remedy, "EG-CHOICE")
        return str(field.default)

    def meaning(self, name: str) -> Meaning:
        """What a name in an expression stands for."""
        kind, quantity = self.names.kinds.get(name, ""), self.quantities.get(name)
        if name in (f"{energy}()" for energy in ENERGIES):
            return Meaning("energy")
        if quantity is not None and quantity.measure in REACTIONS:
            return Meaning(quantity.measure.name.lower())
        if quantity is not None:  # whether a force moves with velocities is known once its law is
            what = "element" if quantity.element else "marker"
            return Meaning(what, quantity.measure.order, "angle" if quantity.turns else "length")
        if kind not in _LEVELS:
            return Meaning(kind)
        level = _LEVELS[kind]
        of = name.removesuffix(RATES[level])
        kinds = {c: k.kind for j in self.joints for c, k in zip(j.coordinates, j.joint.coordinates, strict=True)}
        return Meaning(kind, level, "length" if kinds.get(of) == "length" else "angle")

    def table_kind(self, function: str) -> str | None:
        """The kind of a function that is a table."""
        entries = self.description.sections["functions"]
        return next((e.values.get("kind", "cubic") for e in entries if e.name == function and "x" in e.values), None)

    # -- vectors and matrices -------------------------------------------------------------------------------------
    def vector(self, path: str, value: Any, level: int = CONSTANT) -> Vec3:
        """Three scalars."""
        x, y, z = self.several(path, value, 3, kinds.Vector, level) or (self.stand_in,) * 3
        return (x, y, z)

    def several(
        self, path: str, value: Any, count: int, kind: kinds.Field | type[kinds.Field], level: int = CONSTANT
    ) -> list[Expr] | None:
        """So many scalars; None if it is no such list."""
        parts = self.parts(path, value, count, kind)
        return None if parts is None else [self.expression(f"{path}[{k}]", x, level) for k, x in enumerate(parts)]

    def parts(self, path: str, value: Any, count: int, kind: kinds.Field | type[kinds.Field]) -> list[Any] | None:
        """The items of a list of so many; None, and a fault, if it is none."""
        parts = items(value)
        if parts is None or len(parts) != count:
            self.wrong(path, value, kind)
            return None
        return parts

    # -- frames and markers ---------------------------------------------------------------------------------------
    def frame(self, path: str, values: Mapping[str, Any]) -> Frame:
        """A placement in a body from ``at`` and ``rpy``, in the axes of the place ``on``."""
        at = self.vector(f"{path}.at", values["at"]) if "at" in values else vec.zero(self.graph)
        raw = [key for key in ("rpy", "axes", "matrix") if key in values]
        if len(raw) > 1:
            self.fault(f"{path}.{raw[1]}", f"{raw[0]} is given too", "give one of rpy, axes and matrix", "EG-CONFLICT")
        turn, key = self.identity, raw[0] if raw else ""
        if key == "rpy":
            turn = rpy_rotation(self.graph, self.vector(f"{path}.rpy", values["rpy"]))
        elif key:
            turn = (self.turn_of_axes if key == "axes" else self.turn_of_matrix)(f"{path}.{key}", values[key])
        frame = Frame(turn, at)
        return self.named_frame(f"{path}.on", values["on"]) @ frame if "on" in values else frame

    def turn_of_axes(self, path: str, value: Any) -> Mat3:
        """The rotation whose columns are a frame's axes, two of which are given."""
        if not isinstance(value, Mapping) or len(value) != 2 or not {*value} <= {*"xyz"}:
            self.wrong(path, value, kinds.FrameAxes)
            return self.identity
        (first, a), (second, b) = ((key, self.axis(f"{path}.{key}", one)[2]) for key, one in value.items())
        if self.faults.under(path):
            return self.identity
        if abs(sum(x * y for x, y in zip(a, b, strict=True))) > PERPENDICULAR:
            remedy = "correct one of them"
            self.fault(path, f"the directions of {first} and {second} are not at right angles", remedy, "EG-RANGE")
            return self.identity
        columns = complete_axes("xyz".index(first), a, "xyz".index(second), b)
        return turn_matrix(self.graph, columns)

    def turn_of_matrix(self, path: str, value: Any) -> Mat3:
        """A rotation matrix of numbers and expressions, as far as declared values tell orthogonal and right-handed."""
        rows = [items(row) for row in items(value) or ()]
        if len(rows) != 3 or any(row is None or len(row) != 3 for row in rows):
            self.wrong(path, value, kinds.Matrix)
            return self.identity
        x, y, z = (self.vector(f"{path}[{k}]", row) for k, row in enumerate(rows))
        self.requirements.judge(path, ROTATION, [*x, *y, *z])
        return (x, y, z)

    def moving(self, label: str) -> Marker:
        """The marker of a label in an expression; raises ExpressionError if there is none."""
        result = self.markers.get(label)
        if result is None and label in self.description.motions:
            result = self.marker(label, self.description.motions[label])
        if result is None:
            raise ExpressionError(*self.unknown_marker(label), code="EG-NAME-UNKNOWN")
        return result

    def unknown_marker(self, label: str, path: str = "") -> tuple[str, int, str]:
        """Message, column (none) and remedy for a marker that does not exist."""
        body, dot, name = label.partition(".")
        if body in self.bodies and dot:
            markers = [key.split(".", 1)[1] for key in self.markers if key.startswith(body + ".")]
            near = hint(name, markers)
            have = ", ".join(markers) or "none"
            return f"{body!r} has no marker {name!r}", 0, " ".join(x for x in (near, f"its markers: {have}") if x)
        return f"no body {body!r}", 0, nearest(body, self.faults.names_at(path, self.bodies), "bodies")

    def marker(self, path: str, value: Any) -> Marker | None:
        """A marker from a reference: ``rod``, ``rod.tip``, ``ground`` or a mapping of body, at, rpy."""
        if isinstance(value, str):
            result = self.markers.get(value)
            body = value.partition(".")[0]
            if result is None and (body in self.bodies or not self.faults.under(f"bodies.{body}")):
                message, _, remedy = self.unknown_marker(value, path)
                self.fault(path, message, remedy, "EG-NAME-UNKNOWN")
            return result
        if not isinstance(value, Mapping):
            self.wrong(path, value, kinds.MarkerReference)
            return None
        self.check_keys(path, value, PLACED)
        if "body" not in value:
            return None
        body = value["body"]
        if not isinstance(body, str) or body not in self.bodies:
            self.unknown(f"{path}.body", "body", body, self.bodies, "bodies")
            return None
        return Marker(self.bodies[body], self.frame(path, value), label_of(value))

    def named_frame(self, path: str, value: Any) -> Frame:
        """The placement of a named marker: a position, or a mapping of at and rpy."""
        if isinstance(value, Mapping):
            self.check_keys(path, value, MARKER)
            return self.frame(path, value)
        return Frame(self.identity, self.vector(path, value))

    def pair(self, path: str, value: Any) -> tuple[Marker, Marker] | None:
        """Two markers; None if either is unknown."""
        parts = self.parts(path, value, 2, kinds.Pair)
        if parts is None:
            return None
        first, second = (self.marker(f"{path}[{k}]", part) for k, part in enumerate(parts))
        return None if first is None or second is None else (first, second)

    def axes(self, path: str, value: Any) -> Columns:
        """Columns of the turn that brings x and y to two directions at right angles."""
        parts = self.parts(path, value, 2, kinds.TwoAxes)
        if parts is None:
            return TURNS["z"]
        x, y = (self.axis(f"{path}[{k}]", part)[2] for k, part in enumerate(parts))
        if self.faults.under(path):
            return TURNS["z"]
        if abs(sum(a * b for a, b in zip(x, y, strict=True))) > PERPENDICULAR:
            self.fault(path, f"{quoted(value)} are not at right angles", f"give {kinds.TwoAxes.says}", "EG-RANGE")
            return TURNS["z"]
        return axes_columns(x, y)

    def axis(self, path: str, value: Any) -> Columns:
        """Columns of the turn that brings an axis to z."""
        if isinstance(value, str) and value in TURNS:
            return TURNS[value]
        parts = items(value)
        if parts is None or len(parts) != 3:
            self.fault(path, f"{quoted(value)} is not an axis", f"allowed: {kinds.Axis.says}", "EG-TYPE")
            return TURNS["z"]
        x, y, z = (self.number(f"{path}[{k}]", part) for k, part in enumerate(parts))
        if x is None or y is None or z is None:
            return TURNS["z"]
        columns = axis_columns((x, y, z))
        if columns is None:
            self.fault(path, "the axis has no length", f"allowed: {kinds.Axis.says}", "EG-RANGE")
            return TURNS["z"]
        return columns

    # -- bodies, coordinates and shapes -------------------------------------------------------------------------------
    def body(self, path: str, value: Any) -> tuple[int, Body] | None:
        """The index of a body, and its mass."""
        index = {body.name: k for k, body in enumerate(self.mass_data)}
        if isinstance(value, str) and value in index:
            return index[value], self.mass_data[index[value]]
        if value is not None and not self.faults.under(f"bodies.{value}"):
            self.unknown(path, "body", value, index, "bodies")
        return None

    def coordinate(self, path: str, value: Any, measure: str = "") -> Found | None:
        """The coordinate meant by the name of a joint of one degree, or by its own; of a measure, if one is asked for.

        None, and a fault, if there is none.
        """
        faults, raw = self.faults, name_of(value)
        named = next((j for j in self.joints if j.entry.name == raw), None)
        home = next((j for j in self.joints if raw in j.coordinates), None)
        if named is not None and home is not None and named is not home:
            remedy = "rename one of them"
            faults.add(path, f"{raw!r} is a joint, and a coordinate of {home.entry.name!r}", remedy, "EG-NAME-TAKEN")
            return None
        if named is not None and home is None and len(named.coordinates) != 1:
            names = ", ".join(named.coordinates) or "none"
            message = f"joint {quoted(raw)} has {len(named.coordinates)} coordinates"
            faults.add(path, message, f"name one of them: {names}", "EG-REFERENCE")
            return None
        joint = home or named
        if joint is not None:
            name = str(raw) if home is not None else joint.coordinates[0]
            kind = joint.joint.coordinates[joint.coordinates.index(name)].kind
            if measure and kind != measure:
                message = f"the coordinate {name!r} is {_A[kind]}"
                faults.add(path, message, f"name a coordinate that is {_A[measure]}", "EG-REFERENCE")
                return None
            return Found(name, kind, joint.entry.name)
        if isinstance(raw, str) and self.names.kinds.get(raw) == "coordinate":
            return Found(raw, "angle", None)
        if not faults.under(f"joints.{raw}"):  # else the joint itself is at fault, which is noted already
            known = [j.entry.name for j in self.joints]
            known += [c for c in self.names.of("coordinate") if c not in known]
            self.unknown(path, "joint", raw, known, "joints and coordinates")
        return None

    def contact_point(self, entry: Entry, cam: Marker) -> tuple[Marker, Expr] | None:
        """A massless body about a marker's axis, whose x axis points to a contact, and the angle that turns it."""
        name, (bodies, joints), o = f"{entry.name}_contact", self.added, vec.zero(self.graph)
        if name in self.bodies:
            message = f"the contact point needs a body named {name!r}, and there is one already"
            self.fault(entry.path, message, "rename one of them", "EG-NAME-TAKEN")
            return None
        point = Marker(len(self.mass_data) + len(bodies), Frame(self.identity, o), name)
        coordinate = self.contacts[entry.path]
        bodies.append(Body(name, self.graph.zero, o, (o, o, o)))
        joints.append(JointSpec(name, JOINTS["revolute"].kind(), cam, point, (coordinate,), False))
        return point, self.graph.symbol(coordinate)


# -- LaTeX given for names ---------------------------------------------------------------------------------------------


#: What multipliers of constraint equations are called, with a number; the second word where names look like the first.
MULTIPLIERS = ("lambda", "multiplier")


def numbered(word: str, count: int) -> list[str]:
    """``lambda_1``, ``lambda_2``, ..."""
    return [f"{word}_{k + 1}" for k in range(count)]


def take_latex(reader: Reader, path: str, name: Any, raw: Any) -> None:
    """Take in the LaTeX of a name; what is no LaTeX of a symbol is a fault."""
    text = reader.text(path, raw)
    if not text:
        return
    try:
        read_latex(text)
    except NotationError as error:
        reader.fault(path, str(error), error.remedy, "EG-NOTATION")
        return
    text = spaced(text)
    if reader.latex.setdefault(str(name), text) != text:  # an output that repeats a coordinate
        remedy = "leave one of them out"
        reader.fault(path, f"{name!r} is printed as {quoted(reader.latex[name])} already", remedy, "EG-NAME-TAKEN")


def take_coordinates_latex(
    reader: Reader, path: str, coordinates: Sequence[str], raw: Any, others: Sequence[str] = ()
) -> None:
    """Take in the LaTeX of coordinates: a text for one, a list in their order, or a mapping of names.

    A mapping may hold other names too, such as those of velocities and multipliers.
    """
    if isinstance(raw, Mapping):
        for key, text in raw.items():
            name = name_of(key)
            if name in coordinates or name in others:
                take_latex(reader, f"{path}.{name}", name, text)
            else:
                kind = f"coordinates{' and velocities' * bool(others)}"
                reader.unknown(f"{path}.{printed(name)}", "coordinate", name, [*coordinates, *others], kind)
        return
    listed = [raw] if isinstance(raw, str) else items(raw)
    if listed is None:
        reader.wrong(path, raw, kinds.Latexes)
    elif listed and len(listed) != len(coordinates):
        message = f"{len(listed)} texts for {len(coordinates)} coordinates"
        reader.fault(path, message, f"give one for each: {', '.join(coordinates) or 'none'}", "EG-SHAPE")
    else:
        for k, (name, text) in enumerate(zip(coordinates, listed, strict=False)):
            if text is not None:
                take_latex(reader, path if isinstance(raw, str) else f"{path}[{k}]", name, text)


def give_latex(description: Description, section: str, latex: Mapping[Any, str] | None) -> None:
    """Put the LaTeX of names where each is described: parameters, inputs, outputs, else coordinates of the section."""
    entries = {e.name: e for place in ("outputs", "parameters", "inputs") for e in description.sections[place]}
    for name, text in named("latex", latex).items():
        home = entries[name].values if name in entries else description.values[section].setdefault("latex", {})
        home["latex" if name in entries else name] = text
