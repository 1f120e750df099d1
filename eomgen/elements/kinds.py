"""Elements, kinds of keys: one class a kind, and a key of an entry is an object of its kind.

From a kind follow all uses of a key: how YAML and Python give it (:meth:`Field.read`, :meth:`Field.reference`), its
JSON Schema, the documentation and annotation of an argument, where a dimension is looked up (:meth:`Field.part`), how
the value in an instance of a component is made of that in the component (:meth:`Field.map`), and what a model file
leaves out (:meth:`Field.is_default`).  A new kind is one class.  ``reader`` is the
:class:`~eomgen.model.values.Reader` of a model, ``visitor`` a :class:`~eomgen.model.visit.Visitor`, ``refer`` the
:class:`~eomgen.model.handles.References` of a model in Python.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from numbers import Real
from typing import Any, ClassVar

from ..base.texts import LONGEST
from ..base.value_rules import CHECKS, NOT_NEGATIVE, POSITIVE, Allowed
from .dimensions import LENGTH, NONE, TIME, Dimension
from .frames import Marker, WrapCylinder

# What the expressions of a key may depend on; each level includes those before it.
NUMBER = -1  #: numbers, pi
CONSTANT = 0  #: parameters
MOTION = 1  #: t, inputs, coordinates and their velocities
LAW = 2  #: positions and velocities of markers, and outputs that need no accelerations
OUTPUT = 3  #: accelerations and energies

EXPONENT = 1.5  #: of the penetration in the law of a contact (Hertz), unless given

Schema = dict[str, Any]
_RULES = {POSITIVE: "must be greater than 0", NOT_NEGATIVE: "must be 0 or greater"}


# -- JSON Schema ------------------------------------------------------------------------------------------------------
def ref(name: str) -> Schema:
    """A reference to a definition."""
    return {"$ref": f"#/$defs/{name}"}


def array(items: Schema, least: int | None = None, most: int | None = None) -> Schema:
    """A list of items, so many at least and at most."""
    limits = {"minItems": least, "maxItems": most}
    return {"type": "array", "items": items, **{key: x for key, x in limits.items() if x is not None}}


def table_schema(fields: Fields) -> Schema:
    """An object with the keys of a table."""
    return object_schema({k: f.json() for k, f in fields.items()}, [k for k, f in fields.items() if f.required])


def object_schema(properties: Schema, required: Sequence[str] = ()) -> Schema:
    """An object of these keys and no others."""
    schema: Schema = {"type": "object", "properties": properties, "additionalProperties": False}
    return {**schema, "required": [*required]} if required else schema


def typed_schema(fields: Fields, type_name: str, key: str = "type") -> Schema:
    """An object with the keys of a table, for one type."""
    schema = table_schema(fields)
    schema["properties"][key] = {"const": type_name}
    return schema


def _mapping(values: Schema, **rest: Any) -> Schema:
    return {"type": "object", **rest, "additionalProperties": values}


def any_of(*schemas: Schema) -> Schema:
    """What one of several schemas describes."""
    return {"anyOf": [*schemas]}


def enum(*words: Any) -> Schema:
    """One of these."""
    return {"enum": [*words]}


def define(name: str, schema: Schema | Callable[[], Schema]) -> tuple[Schema, dict[str, Any]]:
    """A reference to a definition, and the definition."""
    return ref(name), {name: schema}


_TEXT: Schema = {"type": "string"}
_NUMBER: Schema = {"type": ["number", "string"]}


# -- keys -------------------------------------------------------------------------------------------------------------
class Field:
    """A key of an entry; the class is the kind of what it holds.

    ``level`` says what its expressions may depend on; ``choices`` lists the words of a choice; ``own`` is how many of
    the first coordinates of its own joint an expression depends on; ``not_zero`` says what to take instead where 0 has
    no meaning; ``allowed`` is a range of its numbers, and ``remedy`` says so.  ``measure`` is 'angle' or 'length' where
    a coordinate must be one.

    ``dimension`` is that of its expressions, None where it depends on what the user means; of a matrix of six rows it
    is that of the entries for two angles.  ``along`` is the key of the coordinate that ``reach`` in it means.
    ``exponent`` is a key: the dimension is divided by reach to the power of its number.  ``local`` are names that only
    its expressions know, and what they are.
    """

    says: ClassVar[str] = ""  #: how a message describes what it holds: the first line of the class's documentation
    argument: ClassVar[str] = "scalar"  #: what the argument of a method is called in its documentation
    annotation: ClassVar[str] = "Value"
    schema: ClassVar[Schema] = {}
    defines: ClassVar[Mapping[str, Schema | Callable[[], Schema]]] = {}  #: what the schema refers to
    holds: str = ""  #: what a visitor changes of it: vector, marker, latex, or the names coordinate, body
    by_coordinate: ClassVar[bool] = False  #: whether it may be a mapping of coordinates to what it holds, or scalars
    refers: ClassVar[str] = ""  #: to what a handle in its place refers: marker or joint
    joins: ClassVar[bool] = False  #: whether the method has an argument for each of its two ends
    parts: ClassVar[Fields] = {}  #: keys within it

    def __init__(
        self,
        doc: str,
        required: bool = False,
        default: Any = None,
        level: int = CONSTANT,
        choices: tuple[str, ...] = (),
        own: int = 0,
        not_zero: str = "",
        dimension: Dimension | None = None,
        along: str = "joint",
        exponent: str = "",
        local: Mapping[str, Field] | None = None,
        allowed: Allowed | None = None,
        remedy: str = "",
        measure: str = "",
        holds: str = "",
    ) -> None:
        self.doc, self.required, self.default, self.level, self.choices = doc, required, default, level, choices
        self.own, self.not_zero, self.dimension, self.along, self.exponent = own, not_zero, dimension, along, exponent
        self.local, self.allowed, self.remedy, self.measure = local or {}, allowed, remedy, measure
        self.holds = holds or self.holds

    def __init_subclass__(cls) -> None:
        first, _, rest = (cls.__doc__ or "").partition("\n")[0].removesuffix(".").partition(" ")
        cls.says = vars(cls).get("says") or f"{first.lower()} {rest}"

    def replace(self, **changed: Any) -> Field:
        """The same key but for what is given."""
        made = copy(self)
        vars(made).update(changed)
        return made

    # -- the schema and the documentation -------------------------------------------------------------------------
    def json(self) -> Schema:
        """The schema of the key."""
        schema = dict(self.schema)
        if self.default not in (None, ()):
            schema["default"] = list(self.default) if isinstance(self.default, tuple) else self.default
        return {**schema, "description": self.doc}

    @property
    def described(self) -> str:
        """What its argument is called in documentation."""
        return self.argument

    # -- values ---------------------------------------------------------------------------------------------------
    def read_square(self, reader: Any, path: str, value: Any, size: int) -> Any:
        """The rows of a square matrix, or of one with the diagonal that is given; None, and a fault, if it is none."""
        listed = items(value) or ()
        rows = [items(part) for part in listed] if len(listed) == size else [None, []]
        if all(row is None for row in rows):
            diagonal = [reader.expression(f"{path}[{k}]", x, self.level) for k, x in enumerate(listed)]
            return tuple(tuple(x if i == j else reader.graph.zero for j in range(size)) for i, x in enumerate(diagonal))
        if all(row is not None and len(row) == size for row in rows):
            every = [enumerate(row or ()) for row in rows]
            return tuple(
                tuple(reader.expression(f"{path}[{i}][{j}]", x, self.level) for j, x in row)
                for i, row in enumerate(every)
            )
        reader.wrong(path, value, self)
        return None

    def read(self, reader: Any, path: str, value: Any) -> Any:
        """What a value means; a fault is noted at ``path``, and None or a stand-in returned, where it means nothing."""
        raise NotImplementedError(f"{type(self).__name__} is read with the rest of its entry")

    def absent(self, reader: Any) -> Any:
        """What stands for a value that is not given."""
        return None

    def reference(self, value: Any, refer: Any) -> Any:
        """A value of a call in Python as a model file would write it: names of markers and joints for handles."""
        one = getattr(refer, self.refers) if self.refers else lambda value: value
        return [one(part) for part in items(value) or [value]] if self.joins else one(value)

    def map(self, value: Any, visitor: Any) -> Any:
        """A value as a visitor changes what it holds; what has not the form of the kind stays as it is."""
        if self.by_coordinate and isinstance(value, Mapping):
            one = getattr(visitor, self.holds or "scalar")
            return {visitor.coordinate(str(name)): one(part) for name, part in value.items()}
        if isinstance(value, list | tuple) and self.holds:
            return [self.map(part, visitor) for part in value]
        no_name = self.holds in ("coordinate", "body") and not isinstance(value, str)
        return value if no_name or not self.holds else getattr(visitor, self.holds)(value)

    def is_default(self, value: Any) -> bool:
        """Whether leaving a value out means the same."""
        nothing = value is None or (isinstance(value, str | list | tuple | dict) and len(value) == 0)
        return nothing or (self.default == (0, 0, 0) and is_zero(value))

    def part(self, path: Sequence[str]) -> Field | None:
        """The key of a scalar within it, behind these words; itself where it has no parts."""
        if not self.parts:
            return self
        return next((self.parts[word] for word in reversed(path) if word in self.parts), None)

    def measured_in(self, values: Mapping[str, Any], place: tuple[Any, ...], length: bool) -> Dimension | None:
        """The dimension of a scalar in an entry of these values, None if it is not known.

        ``place`` are the indices of the scalar in the field; ``length`` says that the entry acts on a length.
        """
        result = None if self.dimension is None else self.dimension.along(length)
        if result is not None and self.exponent and length:
            power = values.get(self.exponent, EXPONENT)
            return None if isinstance(power, str) or not hasattr(power, "__float__") else result.times(LENGTH, -power)
        return result


Fields = dict[str, Field]


def definitions(kind: type[Field] = Field) -> dict[str, Schema]:
    """What the schemas of all kinds refer to, by name."""
    result = {name: schema() if callable(schema) else schema for name, schema in kind.defines.items()}
    for inner in kind.__subclasses__():
        result |= definitions(inner)
    return result


def by(method: str) -> Any:
    """Reading by a method of the reader."""
    return lambda self, reader, path, value: getattr(reader, method)(path, value)


# -- words, names and plain numbers -----------------------------------------------------------------------------------
class Text(Field):
    """A text."""

    argument, annotation = "str", "str"
    schema = _TEXT
    read = by("text")


class Unit(Text):
    """A unit, such as mm or N*m/rad."""


class Latex(Text):
    """The LaTeX of a symbol, such as \\theta_1."""

    holds = "latex"
    by_coordinate = True


class Latexes(Latex):
    """The LaTeX of a symbol, a list of them, or a mapping of coordinates to them."""

    argument, annotation = "str, sequence or mapping of str", "str | Sequence[str] | Mapping[str, str]"
    schema = any_of(_TEXT, array({"type": ["string", "null"]}), _mapping(_TEXT, propertyNames=ref("name")))


_NAME = {"type": "string", "pattern": "^[A-Za-z][A-Za-z0-9_]*$", "maxLength": LONGEST}


class Name(Field):
    """A name."""

    argument, annotation = "str or symbol", "Any"
    schema, defines = define("name", _NAME)


class Names(Field):
    """A list of names."""

    argument, annotation = "sequence of str", "Sequence[Any]"
    schema = array(ref("name"))


class SomeNames(Field):
    """A list of names, or one name."""

    argument, annotation = "str or sequence of str", "Any"
    holds = "coordinate"
    schema = any_of(ref("name"), array(ref("name")))

    def read(self, reader: Any, path: str, value: Any) -> list[Any] | None:
        listed = [value] if isinstance(value, str) else items(value)
        if listed is None:
            reader.wrong(path, value, self)
        return listed


_DOTTED = {"type": "string", "pattern": r"^[A-Za-z][A-Za-z0-9_]*(\.[A-Za-z][A-Za-z0-9_]*)*$"}


class BodyName(Field):
    """The name of a body."""

    argument, annotation = "handle or str", "Any"
    schema, defines = define("reference", _DOTTED)
    read = by("body")
    holds = "body"
    refers = "marker"


class Choice(Field):
    """One of the listed words."""

    annotation = "str"

    @property
    def described(self) -> str:
        return "{" + ", ".join(f'"{word}"' for word in self.choices) + "}"

    def json(self) -> Schema:
        return {"enum": list(self.choices), **super().json()}

    def read(self, reader: Any, path: str, value: Any) -> Any:
        return reader.choice(path, value, self)


class Flag(Field):
    """True or false."""

    argument, annotation = "bool", "bool"
    schema: ClassVar[Schema] = {"type": "boolean"}
    read = by("flag")


class Check(Field):
    """True or false, error, note or off."""

    argument, annotation = "bool or {'error', 'note', 'off'}", "bool | str"
    schema = enum(True, False, *CHECKS)
    read = by("check_word")


class Times(Field):
    """True, false or a whole number greater than 0."""

    argument, annotation = "bool or int", "bool | int"
    schema = any_of({"type": "boolean"}, {"type": "integer", "minimum": 1})

    def read(self, reader: Any, path: str, value: Any) -> int:
        if isinstance(value, bool) or value is None or (isinstance(value, int) and value > 0):
            return int(value or 0)
        reader.wrong(path, value, self)
        return 0


class Sign(Field):
    """1, -1 or 0."""

    argument, annotation = "{0, 1, -1}", "int"
    schema = enum(1, -1, 0)

    def read(self, reader: Any, path: str, value: Any) -> int:
        number: Any = value.item() if getattr(value, "shape", None) == () else value
        if number is not True and number is not False and isinstance(number, Real) and number in (-1, 0, 1):
            return int(float(number))
        remedy = "give 1 for a rising, -1 for a falling value, 0 for both"
        reader.fault(path, f"{value!r} is not 1, -1 or 0", remedy, "EG-CHOICE")
        return 0


class Number(Field):
    """A number."""

    argument, annotation = "float", "Value"
    schema = _NUMBER

    def read(self, reader: Any, path: str, value: Any, *_: Any) -> float | None:
        result: float | None = reader.number(path, value)
        if result is not None and self.allowed is not None and not self.allowed.has(result):
            reader.fault(path, f"is {result:g}", self.remedy, "EG-RANGE")
        return result


class PositiveNumber(Number):
    """A number greater than 0."""

    schema = any_of({"type": "number", "exclusiveMinimum": 0}, _TEXT)

    def read(self, reader: Any, path: str, value: Any, *_: Any) -> float | None:
        result: float | None = reader.number(path, value, positive=True)
        return result


class Count(Field):
    """A whole number greater than 0."""

    schema: ClassVar[Schema] = {"type": "integer", "minimum": 1}


class Numbers(Field):
    """A list of numbers."""

    argument, annotation = "sequence of floats", "Any"
    schema = array(_NUMBER, 2)

    def reference(self, value: Any, refer: Any) -> Any:
        return [*value] if isinstance(value, range) else value


class Grid(Field):
    """A list of lists of numbers, a row for each x."""

    argument, annotation = "2-D array", "Any"
    schema = array(array(_NUMBER), 2)


class File(Field):
    """The path of a file."""

    schema = _TEXT
    read = by("file")


class Table(Field):
    """A mapping."""


class Functions(Field):
    """A list of names of C functions, null for one that is not there."""

    argument, annotation = "sequence", "Sequence[Any]"
    schema = array(any_of(ref("name"), {"type": "null"}))


# -- expressions ------------------------------------------------------------------------------------------------------
class Scalar(Field):
    """A number or an expression."""

    schema, defines = define("expression", _NUMBER)

    def read(self, reader: Any, path: str, value: Any, *_: Any) -> Any:
        result = reader.expression(path, value, self.level)
        if self.allowed is not None:
            reader.requirements.inside(path, result, self.allowed, self.remedy or _RULES[self.allowed])
        if self.not_zero:
            reader.requirements.not_zero(path, result, f"{self.doc}; {self.not_zero}")
        return result

    def absent(self, reader: Any) -> Any:
        return reader.stand_in if self.required else None

    holds = "vector"


class Vector(Scalar):
    """Three numbers or expressions [x, y, z]."""

    argument, annotation = "sequence of three", "Sequence[Value]"
    schema, defines = define("vector", array(ref("expression"), 3, 3))

    def read(self, reader: Any, path: str, value: Any, *_: Any) -> Any:
        return reader.vector(path, value, self.level)

    def absent(self, reader: Any) -> Any:
        return (reader.stand_in,) * 3


class Value(Scalar):
    """A number or an expression for a joint, three of them [x, y, z] for a body."""

    argument, annotation = "scalar or sequence of three", "Value | Sequence[Value]"
    schema = any_of(ref("expression"), ref("vector"))


class Scalars(Field):
    """A list of expressions."""

    schema = array(ref("expression"))
    count = 0  #: how many, where that is fixed

    def read(self, reader: Any, path: str, value: Any) -> Any:
        result = reader.several(path, value, self.count, self, self.level)
        if self.allowed is not None:
            for k, part in enumerate(result or ()):
                reader.requirements.inside(f"{path}[{k}]", part, self.allowed, self.remedy or _RULES[self.allowed])
        return None if result is None else tuple(result)

    holds = "vector"


class Places(Scalars):
    """A list of points [x, y]."""

    schema = array(array(ref("expression"), 2, 2), 2)


class Two(Scalars):
    """A list of two numbers or expressions."""

    argument, annotation = "sequence of two", "Sequence[Value]"
    schema = array(ref("expression"), 2, 2)
    count = 2


class Radii(Two):
    """Two numbers or expressions."""


class Matrix(Scalars):
    """A list of rows, each a list of numbers or expressions."""

    schema = array(array(ref("expression")))


class Rotation(Matrix):
    """The axes of a frame as columns."""

    says = Matrix.says
    read = by("turn_of_matrix")


class Matrix6(Scalars):
    """Six numbers or expressions for the diagonal, or 6 x 6 of them."""

    argument, annotation = "sequence", "Sequence[Any]"
    schema = any_of(array(ref("expression"), 6, 6), array(array(ref("expression"), 6, 6), 6, 6))

    def read(self, reader: Any, path: str, value: Any) -> Any:
        return self.read_square(reader, path, value, 6)

    def measured_in(self, values: Mapping[str, Any], place: tuple[Any, ...], length: bool) -> Dimension | None:
        """Three forces, then three torques; three lengths, then three angles."""
        result = super().measured_in(values, place, length)
        return None if result is None else result.times(LENGTH, -sum(index < 3 for index in (place[0], place[-1])))


class Rates(Field):
    """A mapping of names to expressions."""

    argument, annotation = "mapping", "Mapping[Any, Value]"
    schema = _mapping(ref("expression"))
    by_coordinate = True


class CoordinateForces(Rates):
    """A mapping of coordinates to expressions, or a list of one expression for each coordinate."""

    schema = any_of(array(ref("expression")), _mapping(ref("expression")))
    holds = "vector"


class Factors(Field):
    """A mapping of coordinates to numbers or expressions."""

    argument, annotation, by_coordinate = "mapping", "Mapping[Any, Value]", True
    schema = _mapping(ref("expression"), minProperties=1)

    def read(self, reader: Any, path: str, value: Any) -> Any:
        """Coordinates and their factors, in one order however they are given."""
        if not isinstance(value, Mapping) or not value:
            reader.wrong(path, value, self)
            return None
        terms: list[Any] = []
        for name, factor in sorted(value.items(), key=lambda pair: str(pair[0])):
            result = reader.coordinate(f"{path}.{name}", name)
            product = reader.expression(f"{path}.{name}", factor)
            if result is not None:
                if any(result.name == other.name for other, _ in terms):
                    remedy = "name it once, with the sum of its factors"
                    reader.fault(f"{path}.{name}", f"{result.name!r} is named twice", remedy, "EG-CONFLICT")
                terms.append((result, product))
        return terms

    def reference(self, value: Any, refer: Any) -> Any:
        return {refer.joint(name): x for name, x in value.items()} if isinstance(value, Mapping) else value


class Wheels(Field):
    """A mapping of sun, planet, ring to numbers or expressions."""

    argument, annotation = "mapping", "Mapping[str, Value]"
    names: tuple[str, ...] = ("sun", "planet", "ring")
    schema = object_schema(dict.fromkeys(names, ref("expression")))

    def read(self, reader: Any, path: str, value: Any) -> Any:
        """Those that are given, by their names."""
        if not isinstance(value, Mapping):
            reader.wrong(path, value, self)
            return None
        reader.check_names(path, value, self.names)
        result = {name: reader.expression(f"{path}.{name}", value[name]) for name in self.names if name in value}
        for name, size in result.items():
            reader.requirements.inside(f"{path}.{name}", size, POSITIVE, "give a size greater than 0")
        return result

    holds = "vector"


class Inertia(Wheels):
    """[xx, yy, zz], a 3 x 3 tensor, or a mapping of xx yy zz xy xz yz."""

    argument, annotation = "sequence of three, 3 x 3 tensor or mapping", "Any"
    names = ("xx", "yy", "zz", "xy", "xz", "yz")
    schema, defines = define(
        "inertia",
        any_of(ref("vector"), array(ref("vector"), 3, 3), object_schema(dict.fromkeys(names, ref("expression")))),
    )

    def read(self, reader: Any, path: str, value: Any) -> Any:
        zero = reader.graph.zero
        if isinstance(value, Mapping):
            reader.check_names(path, value, self.names)
            raw = {key: reader.expression(f"{path}.{key}", value[key]) for key in self.names if key in value}
            xx, yy, zz, xy, xz, yz = (raw.get(key, zero) for key in self.names)
            return ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))
        return self.read_square(reader, path, value, 3) or ((reader.stand_in,) * 3,) * 3


# -- axes, frames and markers -----------------------------------------------------------------------------------------
class Axis(Field):
    """X, y, z, -x, -y, -z or three numbers."""

    argument, annotation = "str or three floats", "str | Sequence[float]"
    schema, defines = define("axis", any_of(enum("x", "y", "z", "-x", "-y", "-z"), array(ref("expression"), 3, 3)))

    def read(self, reader: Any, path: str, value: Any) -> Any:
        """A vector of length 1."""
        return tuple(reader.graph.constant(x) for x in reader.axis(path, value)[2])

    def is_default(self, value: Any) -> bool:
        return super().is_default(value) or (isinstance(value, str) and value == self.default)


class TwoAxes(Field):
    """Two directions at right angles, each x, y, z, -x, -y, -z or three numbers."""

    argument, annotation = "two of str or three floats", "Sequence[Any]"
    schema = array(ref("axis"), 2, 2)


class FrameAxes(Field):
    """A mapping of two of x, y, z to x, y, z, -x, -y, -z or three numbers."""

    schema = object_schema(dict.fromkeys("xyz", ref("axis"))) | {"minProperties": 2, "maxProperties": 2}
    read = by("turn_of_axes")


class Placement(Field):
    """A position [x, y, z] or {at, rpy}."""

    schema, defines = define("placement", lambda: any_of(ref("vector"), table_schema(MARKER)))
    read = by("named_frame")


MARKER: Fields = {
    "at": Vector("position in body axes (m)", default=(0, 0, 0), dimension=LENGTH),
    "rpy": Vector("fixed-axis roll, pitch, yaw (rad)", default=(0, 0, 0), dimension=NONE),
    "axes": FrameAxes("two of its axes in body axes, such as {x: [1, 1, 0], z: z}, instead of rpy", dimension=NONE),
    "matrix": Rotation("3 x 3, its axes as columns in body axes, instead of rpy", dimension=NONE),
    "on": Placement("place in the body of axes in which these are, instead of those of the body", dimension=LENGTH),
}
PLACED: Fields = {"body": Name("a body or ground", required=True), **MARKER}


class Markers(Field):
    """A mapping of marker names to [x, y, z] or {at, rpy}."""

    argument, annotation = "mapping", "Mapping[str, Any]"
    schema, defines = define("markers", _mapping(ref("placement"), propertyNames=ref("name")))
    parts = MARKER

    def part(self, path: Sequence[str]) -> Field | None:
        """A marker may be written as its position alone."""
        return super().part(path) or MARKER["at"]

    def reference(self, value: Any, refer: Any) -> Any:
        return refer.markers(value)

    def map(self, value: Any, visitor: Any) -> Any:
        pairs = value.items() if isinstance(value, Mapping) else value if isinstance(value, list) else ()
        try:
            every = [(name, placed if isinstance(placed, Mapping) else {"at": placed}) for name, placed in pairs]
            return {name: visitor.placement(visitor.entry.name, placed) for name, placed in every}
        except (TypeError, ValueError):  # no pairs, or names that are no names
            return value


class MarkerReference(Field):
    """A body, body.marker, ground or {body, at, rpy}."""

    argument, annotation = "handle or str", "Any"
    holds = "marker"
    schema, defines = define("marker", lambda: any_of(ref("reference"), table_schema(PLACED)))
    parts, refers = MARKER, "marker"
    read = by("marker")


class Pair(Field):
    """A list of two markers, each a body, body.marker, ground or {body, at, rpy}."""

    argument, annotation = "handles or str", "Sequence[Any]"
    schema, defines = define("pair", array(ref("marker"), 2, 2))
    read = by("pair")
    holds = "marker"
    refers = "marker"
    parts = MARKER
    joins = True


CYLINDER: Fields = {
    "around": MarkerReference("marker whose z axis is the axis of the cylinder", required=True),
    "radius": Scalar("radius (m)", required=True, dimension=LENGTH, allowed=POSITIVE),
    "sense": Choice("sense of the path about the axis", default="positive", choices=("positive", "negative")),
    "friction": Scalar(
        "coefficient of friction of a rope or belt on it; give smoothing too", dimension=NONE, allowed=NOT_NEGATIVE
    ),
    "smoothing": Scalar(
        "slip velocity (m/s) below which this friction is smoothed", dimension=LENGTH.times(TIME, -1), allowed=POSITIVE
    ),
}


class Via(Field):
    """A list of markers and cylinders {around, radius, sense, friction, smoothing}."""

    argument, annotation = "sequence", "Sequence[Any]"
    holds = "marker"
    schema = array(ref("stop"))
    defines = define("stop", lambda: any_of(ref("marker"), table_schema(CYLINDER)))[1]
    parts = CYLINDER | MARKER

    def read(self, reader: Any, path: str, value: Any) -> Any:
        """Markers and cylinders; None if anything is wrong with them."""
        listed, result = items(value), list[Marker | WrapCylinder]()
        if listed is None:
            reader.wrong(path, value, self)
            return None
        for k, item in enumerate(listed):
            stop = self._stop(reader, f"{path}[{k}]", item)
            if isinstance(stop, WrapCylinder) and result and isinstance(result[-1], WrapCylinder):
                remedy = "put a marker between the two cylinders"
                reader.fault(f"{path}[{k}]", "follows another cylinder directly", remedy, "EG-CONFLICT")
            if stop is not None:
                result.append(stop)
        return None if reader.faults.under(path) else result

    def _stop(self, reader: Any, path: str, value: Any) -> Marker | WrapCylinder | None:
        if not (isinstance(value, Mapping) and "body" not in value):
            return reader.marker(path, value)  # type: ignore[no-any-return]
        reader.check_keys(path, value, CYLINDER)
        if "around" not in value or "radius" not in value:
            return None
        rubbing = ("friction", "smoothing")  # neither where it is smooth
        missing = [key for key in rubbing if key not in value]
        if len(missing) == 1:
            reader.faults.missing(f"{path}.{missing[0]}", "give friction and smoothing together, or neither")
        keys = ("around", "radius", "sense", *(() if missing else rubbing))
        made = [CYLINDER[key].read(reader, f"{path}.{key}", value.get(key, CYLINDER[key].default)) for key in keys]
        marker, radius, sense, *rest = made
        return None if marker is None else WrapCylinder(marker, radius, 1 if sense == "positive" else -1, *rest)

    def reference(self, value: Any, refer: Any) -> Any:
        return [self._refer(stop, refer) for stop in value] or None

    @staticmethod
    def _refer(stop: Any, refer: Any) -> Any:
        if not (isinstance(stop, Mapping) and "around" in stop):
            return refer.marker(stop)
        return {key: refer.marker(x) if key == "around" else x for key, x in stop.items()}

    def map(self, value: Any, visitor: Any) -> Any:
        if not (isinstance(value, Mapping) and "around" in value):
            return super().map(value, visitor)
        return {key: CYLINDER[key].map(x, visitor) if key in CYLINDER else x for key, x in value.items()}


# -- joints, coordinates and bodies -----------------------------------------------------------------------------------
class JointReference(Field):
    """The name of a joint, or of one coordinate of a joint."""

    argument, annotation = "handle or str", "Any"
    holds, refers = "coordinate", "joint"
    schema = ref("reference")

    def read(self, reader: Any, path: str, value: Any) -> Any:
        return reader.coordinate(path, value, self.measure)


class JointPair(Field):
    """A list of two joints, or coordinates of joints."""

    argument, annotation = "handles or str", "Sequence[Any]"
    holds, refers, joins = "coordinate", "joint", True
    schema = array(ref("reference"), 2, 2)

    def read(self, reader: Any, path: str, value: Any) -> Any:
        parts = items(value)
        if parts is None or len(parts) != 2:
            reader.wrong(path, value, self)
            return None
        a, b = (reader.coordinate(f"{path}[{k}]", part, self.measure) for k, part in enumerate(parts))
        if a is not None and b is not None and a.name == b.name:
            reader.fault(path, f"{a.name!r} is named twice", "name two different coordinates", "EG-CONFLICT")
            return None
        return None if a is None or b is None else (a, b)


_SIZE: dict[str, Any] = {"allowed": NOT_NEGATIVE, "remedy": "give the largest size, 0 or positive"}
LIMITS: Fields = {
    "lower": Number("least value (rad or m)"),
    "upper": Number("greatest value (rad or m)"),
    "velocity": Number("greatest speed (rad/s or m/s)", **_SIZE),
    "effort": Number("greatest torque or force of the drive (N m or N)", **_SIZE),
}


def limits_nothing(key: str, value: Any) -> bool:
    """Whether a limit is the infinity that no value passes, as URDF and MJCF files write it."""
    return isinstance(value, int | float) and value == (-math.inf if key == "lower" else math.inf)


class Limits(Field):
    """A mapping of lower, upper, velocity and effort to numbers."""

    argument, annotation = "mapping", "Mapping[str, float]"
    schema, defines = define("limits", lambda: object_schema({key: _each_limit(x.doc) for key, x in LIMITS.items()}))

    def read(self, reader: Any, path: str, value: Any, *own: Any) -> Any:
        """(key, value) of what is limited, for each coordinate; a mapping has a number, or one for each coordinate."""
        (names,) = own
        result: list[dict[str, float]] = [{} for _ in names]
        if not isinstance(value, Mapping):
            reader.wrong(path, value, self)
            value = {}
        reader.check_keys(path, value, LIMITS)
        for key in (key for key in LIMITS if value.get(key) is not None):
            listed, place = items(value[key]), f"{path}.{key}"
            values = [value[key]] if listed is None else listed
            if len(values) != len(names):
                message = f"{len(values)} values for {len(names)} coordinates"
                reader.fault(place, message, f"give one for each: {', '.join(names)}", "EG-SHAPE")
                continue
            for k, x in enumerate(values):
                if x is None or limits_nothing(key, x):
                    continue
                number = LIMITS[key].read(reader, place if listed is None else f"{place}[{k}]", x)
                if number is not None:
                    result[k][key] = number
        for name, limits in zip(names, result, strict=True):
            if limits.get("lower", -math.inf) > limits.get("upper", math.inf):
                message = f"lower {limits['lower']:g} is above upper {limits['upper']:g} for {name!r}"
                reader.fault(path, message, "exchange them", "EG-RANGE")
        return tuple(tuple(limits.items()) for limits in result)


def _each_limit(doc: str) -> Schema:
    """A number for the coordinate, or a list of one for each of several coordinates."""
    number = {"type": ["number", "string", "null"]}
    return {**any_of(number, array(number)), "description": doc}


# -- parts of bodies --------------------------------------------------------------------------------------------------
class About(Field):
    """Com, origin, a marker of the body or [x, y, z]."""

    argument, annotation = "str or sequence of three", "Any"
    schema = any_of(ref("reference"), ref("vector"))

    def map(self, value: Any, visitor: Any) -> Any:
        return value if isinstance(value, str) else visitor.vector(value)


class BodyParts(Field):
    """A list of mappings with places in the body."""

    argument, annotation = "sequence of mappings", "Sequence[Mapping[str, Any]]"
    words = ("type", "axis", "subtract", "file", "shape", "color")  #: keys that are words, not scalars

    def map(self, value: Any, visitor: Any) -> Any:
        return [self._mapped(part, visitor) for part in value] if isinstance(value, list | tuple) else value

    def _mapped(self, part: Any, visitor: Any) -> Any:
        if not isinstance(part, Mapping):
            return part
        placed = {key: x for key, x in part.items() if key in MARKER}
        texts = {key: x for key, x in part.items() if key in self.words}
        vectors = {k: visitor.vector(x) for k, x in part.items() if k not in texts and k not in placed}
        return {**texts, **vectors, **visitor.placement(visitor.entry.name, placed)}


POINT: Fields = {
    "mass": Scalar("mass (kg)", required=True, dimension=Dimension(0, 1)),
    "at": Vector("position in body axes (m)", default=(0, 0, 0), dimension=LENGTH),
}


class Points(BodyParts):
    """A list of points {mass, at}."""

    schema, defines = define("points", array(table_schema(POINT)))
    parts = POINT


DISPLAY: Fields = {
    "shape": Choice("kind of shape", required=True, choices=("mesh", "box", "cylinder", "sphere", "capsule")),
    "file": Text("file of a mesh (STL, OBJ or DAE), read when the model is drawn"),
    "scale": Vector("scale of a mesh"),
    "size": Vector("edges of a box (m)", dimension=LENGTH),
    "radius": Scalar("radius (m)", dimension=LENGTH),
    "length": Scalar("length along z (m)", dimension=LENGTH),
    "color": Text('color "#rrggbb" in pictures; that of the body unless given'),
    **MARKER,
}


class Display(BodyParts):
    """A list of shapes {shape, ...}."""

    schema, defines = define("display", array(table_schema(DISPLAY)))
    parts = DISPLAY


# -- instances of components ------------------------------------------------------------------------------------------
ROUNDS = 1000  #: most instances that one entry makes


class Prefix(Field):
    """The beginning of names."""

    schema: ClassVar[Schema] = {"type": "string", "pattern": "^([A-Za-z][A-Za-z0-9_]*)?$"}


class Loops(Field):
    """A mapping of variables to lists, counts or {from, to, step}."""

    schema = _mapping(
        any_of(
            array(_NUMBER, 1, ROUNDS),
            {"type": "integer", "minimum": 1, "maximum": ROUNDS},
            object_schema({key: {"type": "number"} for key in ("from", "to", "step")}, ["to"]),
        ),
        propertyNames=ref("name"),
        minProperties=1,
    )


class AttachedTo(Field):
    """A marker, or a mapping of attachments to markers."""

    schema = any_of(ref("marker"), _mapping(ref("marker"), propertyNames=ref("name")))


class Values(Field):
    """A mapping of names to numbers or expressions."""

    schema = _mapping(ref("expression"))


class Measured(Field):
    """A mapping of names to numbers, expressions or {value, unit}."""

    schema = _mapping(any_of(ref("expression"), object_schema({"value": ref("expression"), "unit": _TEXT}, ["value"])))


# -- lists in any form ------------------------------------------------------------------------------------------------
def items(value: Any) -> list[Any] | None:
    """The items of a list, tuple, array or SymPy matrix (a column counts as a plain list); None for anything else."""
    if isinstance(value, list | tuple):
        return list(value)
    if isinstance(value, str | bytes | Mapping) or not hasattr(value, "tolist"):
        return None
    listed = value.tolist()
    if not isinstance(listed, list):
        return None
    if listed and all(isinstance(x, list) and len(x) == 1 for x in listed):
        return [x[0] for x in listed]
    return listed


def is_zero(value: Any) -> bool:
    """Whether a value is three plain zeros."""
    listed = items(value)
    return listed is not None and len(listed) == 3 and all(isinstance(x, int | float) and x == 0 for x in listed)
