"""Elements: a type (its word in model files, its keys, its reader), and what a reader may ask of an entry.

The tables of types (:data:`~.forces.FORCES` ...) drive the check of model files, their JSON Schema, the methods
of Model and their documentation, so that a new type is one row, in the file of its class.  The keys of most are fields
of their class, which :func:`key` marks.
"""

from __future__ import annotations

import re
from abc import ABC
from collections import UserDict
from collections.abc import Callable, Mapping, MutableMapping, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from ..base.value_rules import Allowed
from ..expr.core import Expr, Graph
from ..expr.records import Record
from .frames import Marker
from .kinds import Choice, Field, Fields, Schema, table_schema


class Element(Record, ABC):
    """What has a type; ``type_name`` is that of the class unless it says another."""

    if TYPE_CHECKING:
        type_name: ClassVar[str]

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if "type_name" not in vars(cls):
            cls.type_name = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", cls.__name__).lower()


class Found(NamedTuple):
    """A coordinate: its name, 'angle', 'length' or 'parameter', and its joint (None: a bare Lagrangian's own)."""

    name: str
    kind: str
    joint: str | None


class Meaning(NamedTuple):
    """What a name in an expression stands for.

    ``kind`` is a word such as coordinate, velocity, parameter, time, marker (its motion), energy, reaction or
    multiplier; ``level`` counts derivatives of motions, None of other things; ``measure`` is 'length' or 'angle' of
    motions.
    """

    kind: str
    level: int | None = None
    measure: str = ""


class Entry:
    """An entry on its way to an element.

    Every method reads one key, notes what is wrong with it as a fault of that key, and returns None or a stand-in then,
    so that one pass finds all faults.  ``reader`` is what is read of the model so far
    (:class:`~eomgen.model.values.Reader`), ``values`` what the user gave by key, ``fields`` all keys of its type.
    """

    def __init__(self, reader: Any, name: str, path: str, values: dict[str, Any]) -> None:
        self.reader, self.name, self.path, self.values = reader, name, path, values
        self.graph: Graph = reader.graph
        self.stand_in: Expr = reader.stand_in
        self.element_type, self.fields = ElementType("", "", {}), Fields()
        self.owner: Entry = self  # of a law the entry to which it belongs
        self.names: Mapping[str, str] = {}  # of keys that stand in the entry by other names

    # -- faults ---------------------------------------------------------------------------------------------------
    def _at(self, key: str) -> str:
        return f"{self.path}.{self.names.get(key, key)}" if key else self.path

    def fault(self, key: str, message: str, remedy: str = "", code: str = "EG-CONFLICT") -> None:
        """Note a fault of one key, or of the entry as a whole (``""``)."""
        self.reader.fault(self._at(key), message, remedy, code)

    def missing(self, key: str, remedy: str) -> None:
        """Note that a key is missing."""
        self.reader.faults.missing(self._at(key), remedy)

    def at_fault(self, key: str = "") -> bool:
        """Whether a fault of the key, or any, has been noted."""
        return bool(self.reader.faults.under(self._at(key)))

    def refuse(self, key: str, why: str) -> None:
        """Note a key that has no meaning beside the others, if it is given."""
        if key in self.values:
            self.fault(key, why, "leave it out")

    def require(self, key: str, value: Expr, allowed: Allowed, rule: str, message: str = "") -> None:
        """Require an expression in a range, at the declared values of parameters and at those given later.

        ``rule`` says what is allowed; ``{:g}`` in a ``message`` of its own stands for the number.
        """
        self.reader.requirements.inside(self._at(key), value, allowed, rule, message)

    def judge(
        self, key: str, rule: str, values: Sequence[Expr], data: Sequence[Any] = (), local: Sequence[str] = ()
    ) -> None:
        """Require that expressions keep a rule of :mod:`~eomgen.base.value_rules`, in the same way.

        ``data`` is what the rule takes beside them, ``local`` the names that stand for the points at which it looks.
        """
        self.reader.requirements.judge(self._at(key), rule, values, data, local)

    # -- values ---------------------------------------------------------------------------------------------------
    def __getitem__(self, key: str) -> Any:
        """What a key holds, or its default, read by its kind."""
        return self.read(key)

    def read(self, key: str, *own: Any, kind: type[Field] | None = None) -> Any:
        """The same, a law by its type; read as if of another kind, or with coordinates of the entry's own."""
        field = self.fields[key]
        if isinstance(field, Law):
            law = self.part(key)
            return None if law is None else law.element_type.read(law)
        if key not in self.values and field.default is None:
            return field.absent(self.reader)
        value = self.values.get(key, field.default)
        return (kind or type(field)).read(field, self.reader, self._at(key), value, *own)

    def law(self, key: str, local: Mapping[str, Expr], exclusive: bool = True) -> Expr:
        """An expression with names that it alone knows; with ``exclusive`` none may be a name of the model too."""
        field = self.fields[key]
        result: Expr = self.reader.expression(
            self._at(key), self.values.get(key, field.default), field.level, local, exclusive
        )
        return result

    def part(self, key: str) -> Entry | None:
        """The law under a key as an entry; None where there is none, or no type of that key, which is noted."""
        field, values, path = self.fields[key], self.values.get(key), self._at(key)
        if key not in self.values:
            return None
        assert isinstance(field, Law)
        if not isinstance(values, Mapping):
            word = values if isinstance(values, str) and values in field.types else field.preset
            self.reader.wrong(path, values, field, remedy=f"write {key}: {{type: {word}, ...}}")
            return None
        preset = "" if "type" in values else field.preset
        kind = preset or self.reader.type_of(path, values, field.types, key) or field.preset
        return self.as_law(field, kind, values, path) if kind else None

    def as_law(
        self, field: Law, kind: str, values: Mapping[str, Any], path: str, names: Mapping[str, str] | None = None
    ) -> Entry:
        """Keys of a law of a type as an entry, in which wrong and missing ones are noted.

        ``names`` are those that its keys have in this entry, where they stand in it themselves.
        """
        law = Entry(self.reader, self.name, path, dict(values))
        law.owner, law.names, law.element_type, law.fields = self, names or {}, field.types[kind], field.keys_of(kind)
        others = {name: one for name, one in self.fields.items() if isinstance(one, Law) and one is not field}
        optional = set[str]()  # in the types to which wrong keys belong
        for key in [key for key in values if key not in law.fields]:
            types = {name: one.keys for name, one in field.types.items() if key in one.keys}
            homes = [name for name, one in others.items() if key in one.flat]
            if types:
                optional |= {x for x in law.fields if all(x in one and not one[x].required for one in types.values())}
                if not law.at_fault("type"):
                    remedy = law.element_type.remedies.get(key, "leave it out")
                    law.fault(key, f"belongs to {' and '.join(types)}, and this is {kind}", remedy)
            elif key in others:
                law.fault(key, "stands beside the law, not in it", f"write {key}: {{...}} beside it")
            elif homes:
                law.fault(key, f"belongs to {' and '.join(homes)}", "leave it out")
            else:
                self.reader.check_names(path, [key], tuple(law.fields))
        for key, one in law.fields.items():
            if one.required and key not in values and key not in optional:
                law.missing(key, f"give the {(self.fields[names.get(key, key)] if names else one).doc}")
        return law

    def pair(self, key: str = "between") -> tuple[Marker, Marker] | None:
        """Two markers."""
        result: tuple[Marker, Marker] | None = self[key]
        return result

    # -- coordinates and names ------------------------------------------------------------------------------------
    def symbol(self, quantity: Found) -> Expr:
        """The symbol of a coordinate."""
        return self.graph.symbol(quantity.name)

    def states(self) -> tuple[Expr, ...]:
        """The symbols of its own first-order states, in the order in which its type names them."""
        if self.owner is not self:
            return self.owner.states()
        return tuple(self.graph.symbol(f"{self.name}_{suffix}") for suffix in self.element_type.states(self.values))

    def velocities(self, key: str) -> tuple[tuple[str, Expr, str], ...] | None:
        """The velocities of a joint, or of one coordinate: the name, the symbol, and 'angle' or 'length'."""
        if key not in self.values:
            return None
        value = self.values[key]
        joint = next((one for one in self.reader.joints if isinstance(value, str) and one.entry.name == value), None)
        if joint is None:
            result = self.reader.coordinate(self._at(key), value)
            return None if result is None else ((result.name, self.graph.symbol(f"{result.name}_dot"), result.kind),)
        if not joint.joint.velocities:
            self.fault(key, f"{value!r} has no coordinates to lock", "name a joint that has", "EG-REFERENCE")
        names = [value + v.suffix if v.of is None else joint.coordinates[v.of] for v in joint.joint.velocities]
        return tuple(
            (name, self.graph.symbol(name if v.of is None else f"{name}_dot"), v.kind)
            for name, v in zip(names, joint.joint.velocities, strict=True)
        )

    def require_one_carrier(self, key: str, a: Found, b: Found) -> None:
        """Note two coordinates that are measured from different bodies."""
        first, second = self.carrier(a), self.carrier(b)
        if first is None or second is None or first == second:
            return
        message = f"{a.name!r} and {b.name!r} are not measured from the same body"
        remedy = "give both joints the body that carries the two axes as predecessor; for a carrier that turns "
        self.fault(key, message, remedy + "use planetary, or a coupling", "EG-REFERENCE")

    def carrier(self, coordinate: Found, end: str = "predecessor") -> int | None:
        """The body from which a coordinate is measured, or that it moves; welded ones count as one, the least."""
        spec = next((joint for joint in self.reader.specs if joint.name == coordinate.joint), None)
        if spec is None:
            return None
        before, group = 0, {int(getattr(spec, end).body)}
        while len(group) > before:
            before = len(group)
            for joint in self.reader.specs:
                ends = {joint.predecessor.body, joint.successor.body}
                if not joint.coordinates and ends & group:
                    group |= ends
        return min(group)


class ElementType(NamedTuple):
    """A type of element."""

    name: str  #: the word in model files, and the method of Model
    doc: str  #: what it is, in one sentence that goes on from "Add"
    keys: Fields  #: besides ``type``, in the order of the method's arguments
    #: Entry -> the element; None where the entry has a fault, which is noted.
    read: Callable[[Entry], Any] = lambda e: None
    one_of: tuple[str, ...] = ()  #: keys of which exactly one is given
    #: What to do instead, for keys that people give something of another kind, or of a law for keys of other types.
    remedies: Mapping[str, str] = {}
    ends: tuple[str, str] = ("a", "b")  #: arguments of the method for a key of two markers or joints
    #: The entry's values -> its first-order states, as suffixes of its name, and their units.
    states: Callable[[Mapping[str, Any]], Mapping[str, str]] = lambda values: {}
    kind: Any = object  #: of a joint its class, which says what its coordinates are before expressions are read

    def fields(self, what: str, types: Mapping[str, Any]) -> Fields:
        """All keys, ``type`` among them."""
        return {"type": Choice(f"type of the {what}", required=True, choices=tuple(types)), **self.keys}


Types = MutableMapping[str, ElementType]


class TypeTable(UserDict[str, ElementType]):
    """Types by their names, of files of one package: each file has them as TYPES, and is loaded when one is used."""

    def __init__(self, package: str, **files: str) -> None:
        """``files`` has the names of the types of each file, in order."""
        super().__init__()
        self.data: dict[str, Any] = {name: f"{package}.{file}" for file, x in files.items() for name in x.split()}

    def __getitem__(self, name: str) -> ElementType:
        if isinstance(self.data[name], str):
            self.data[name] = import_module(self.data[name]).TYPES[name]
        return self.data[name]  # type: ignore[no-any-return]

    def __or__(self, other: Mapping[str, ElementType]) -> dict[str, ElementType]:  # type: ignore[override]
        return {**self, **other}

    def __ror__(self, other: Mapping[str, ElementType]) -> dict[str, ElementType]:  # type: ignore[override]
        return {**other, **self}


def table(*types: ElementType) -> dict[str, ElementType]:
    """Types by their names."""
    return {one.name: one for one in types}


class Where(NamedTuple):
    """What an element acts on: keys before and behind those of its law, and how they are read together."""

    keys: Fields
    read: Callable[[Entry], Any]  #: what the element holds of it, several values as a tuple; None where it is at fault
    behind: Mapping[str, Field] = {}
    one_of: tuple[str, ...] = ()


NOWHERE = Where({}, lambda e: ())


def key(field: Field) -> Any:
    """A field of an element's class that is a key of its entries."""
    return field


def keys_of(element: type) -> Fields:
    """The keys that are fields of a class, those of its bases first."""
    fields = [(name, x) for base in reversed(element.__mro__) for name, x in vars(base).items()]
    return {name: x for name, x in fields if isinstance(x, Field)}


def element(
    kind: type,
    name: str,
    doc: str,
    where: Where = NOWHERE,
    keys: Fields | None = None,
    more: Mapping[str, Field] = {},
    check: Callable[[Entry, dict[str, Any]], object] = lambda e, values: None,
    **rest: Any,
) -> ElementType:
    """The type of elements or laws whose fields are read from their keys one by one, in this order.

    The class says its keys, unless ``keys`` has others for the same fields; ``where`` is what it acts on, ``more`` are
    keys beside these.  ``check`` notes what is wrong with several values together, and puts in place of fields what
    follows from others; ``rest`` is what else an ElementType has.
    """
    fields = keys_of(kind)
    own = fields if keys is None else keys

    def read(e: Entry) -> Any:
        place = where.read(e)
        values = {field: e[one] for field, one in zip(fields, own, strict=True)}
        check(e, values)
        needed = [field for field, x in zip(fields, own.values(), strict=True) if x.required or x.default is not None]
        if place is None or e.at_fault() or any(values[field] is None for field in needed):
            return None
        beside = place if isinstance(place, tuple) else (place,)
        values = {field: e.symbol(x) if isinstance(x, Found) else x for field, x in values.items()}
        return kind(*[e.name] * (e.owner is e), *beside, **values)

    every = {**where.keys, **own, **where.behind, **more}
    return ElementType(name, doc, every, read, **{"one_of": where.one_of, **rest})


# -- laws --------------------------------------------------------------------------------------------------------------
class Law(Field):
    """A law {type: ..., key: value, ...}."""

    argument, annotation = "mapping", "Mapping[str, Any]"

    def __init__(
        self,
        doc: str,
        types: Types,
        preset: str = "",
        flat: dict[str, str] | None = None,
        required: bool = False,
        sole: str = "",
    ) -> None:
        """``preset`` is the type where none is named; ``flat`` are keys of an entry that stand for others of a law.

        ``sole`` is a key of that type that may stand alone beside some laws.
        """
        super().__init__(doc, required)
        self.types, self.preset, self.sole, renamed = types, preset, sole, flat or {}
        self.flat = {key: key for one in types.values() for key in one.keys if key not in renamed.values()} | renamed

    def keys_of(self, kind: str) -> Fields:
        """The keys of laws of a type."""
        word = Choice("type of the law", required=not self.preset, choices=tuple(self.types))
        return {"type": word, **self.types[kind].keys}

    def type_of(self, value: Any) -> str:
        """The type of a law as it is written; the first where that is none."""
        kind = value.get("type") if isinstance(value, Mapping) else None
        return kind if isinstance(kind, str) and kind in self.types else self.preset or next(iter(self.types))

    def rows(self) -> list[tuple[list[str], ElementType]]:
        """The types, those of the same keys and physics as one, with their names."""
        every = [([name for name, other in self.types.items() if other is one], one) for one in self.types.values()]
        return [row for k, row in enumerate(every) if row not in every[:k]]

    def json(self) -> Schema:
        schemas = []
        for names, one in self.rows():
            word = Choice("type of the law", required=self.preset not in names, choices=tuple(names))
            schemas.append(table_schema({"type": word, **one.keys}))
        if self.sole:
            schemas.append(table_schema({self.sole: self.types[self.preset].keys[self.sole]}))
        return {"oneOf": schemas, "description": self.doc}

    def map(self, value: Any, visitor: Any) -> Any:
        if not isinstance(value, Mapping):
            return value
        keys = self.keys_of(self.type_of(value))
        return {key: keys[key].map(x, visitor) if key in keys else x for key, x in value.items()}


def sort_laws(
    keys: Fields, values: Mapping[str, Any], twice: Callable[[str], None]
) -> tuple[dict[str, Any], dict[str, str]]:
    """Values of an entry with each key of a law in the mapping of that law, and where these were written otherwise.

    Keys of all laws may stand in the entry one by one, or in the mapping ``law``; ``twice`` notes those given twice.
    """
    laws = {key: field for key, field in keys.items() if isinstance(field, Law)}
    rest, parts, places = dict[str, Any](), {key: dict[str, Any]() for key in laws}, dict[str, str]()
    single: list[tuple[str, str, Any]] = []
    for key, value in values.items():
        if key == "law" and key in laws and isinstance(value, Mapping):
            single += [("law.", one, x) for one, x in value.items()]
        elif key in laws and isinstance(value, Mapping):
            parts[key] = dict(value)
        elif any(key in field.flat for field in laws.values()):
            single.append(("", key, value))
        else:
            rest[key] = value
    mappings = {key for key in laws if isinstance(values.get(key), Mapping)}
    present = {key for _, key, _ in single} | mappings
    for before, key, value in single:
        homes = [home for home, field in laws.items() if key in field.flat and (field.preset or home in present)]
        if not homes and not before:  # of a law that is not there
            rest[key] = value
            continue
        if not homes or (before and key in laws and isinstance(value, Mapping)):
            homes = ["law"]
        home = next((one for one in homes[1:] if one in present), homes[0])
        name = key if key in laws and isinstance(value, Mapping) else laws[home].flat.get(key, key)
        if home in rest or name in parts[home]:
            twice(f"{before}{key}")
            continue
        parts[home][name] = value
        for one, nested in laws[home].flat.items() if home != "law" or not before else ():
            places.setdefault(f"{home}.{nested}", before + one)
        places[f"{home}.{name}"] = f"{before}{key}"
    result = rest | {key: part for key, part in parts.items() if part or key in mappings}
    return result, {nested: one for nested, one in places.items() if nested != one}
