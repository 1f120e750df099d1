"""A type of element -> the method of Model that adds one, documented.

Arguments, defaults and their documentation are those of the type's keys, so that Python and model files cannot differ.
"""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from inspect import Parameter, Signature
from typing import Any, NamedTuple

from ..elements.constraints.constraint import IN_PLACE_OF_JOINTS, SWITCHING
from ..elements.element_type import ElementType, Law
from ..elements.joints import JOINTS
from ..elements.kinds import Field, Rates, Scalar, Text, items
from ..errors import UsageError, ill_typed, no_such
from .description import DescribedEntry
from .fields import MODEL
from .handles import BodyHandle, ConstraintHandle, Described, ForceHandle, JointHandle, MarkerHandle, References
from .names import nearest
from .sympy_face import function, symbol

#: Section of elements -> what its methods return.
_HANDLES: dict[str, Any] = {"joints": JointHandle, "forces": ForceHandle, "constraints": ConstraintHandle}
#: Section -> what its methods return, and how it follows from the model and the entry; of others nothing.
RESULTS: dict[str, tuple[str, Callable[[Described, DescribedEntry], Any]]] = {
    **{section: (handle.__name__, handle) for section, handle in _HANDLES.items()},
    **dict.fromkeys(("parameters", "inputs", "states"), ("sympy.Symbol", lambda model, entry: symbol(entry.name))),
    "functions": ("sympy.Function", lambda model, entry: function(entry.name)),
    "bodies": ("BodyHandle", lambda model, entry: BodyHandle(model, entry.name, entry)),
}
_BY_KEYWORD = "; give keys of a law by keyword, as exponent=1.5"
_WIDTH = 108  #: of the text of a method's documentation


class Argument(NamedTuple):
    """An argument of a method: the key that it gives, and how."""

    name: str
    key: str
    kind: str
    annotation: str
    default: Any
    doc: str


def arguments_of(element: ElementType) -> list[Argument]:
    """The arguments of the method that adds an element, after its name; ``*between`` is called so."""
    made: list[Argument] = []
    for key, field in element.keys.items():
        made += _arguments(element, key, field, any(one.default is not Parameter.empty for one in made))
    star = [one for one in made if one.name.startswith("*")]
    return star + [one for one in made if not one.name.startswith("*")]


def _arguments(element: ElementType, key: str, field: Field, later: bool) -> list[Argument]:
    kind, annotation = field.described, field.annotation
    doc = f"{field.doc[:1].upper()}{field.doc[1:]}."
    default: Any = field.default if type(field.default) in (int, float) else None
    if (
        isinstance(field.default, (str, bool)) and field.default != ""
    ):  # which is no default of the method: given, it may contradict the rest
        doc = f"{doc} Default: {str(field.default).lower()}."
    anywhere = {"joint", "between"} <= {*element.one_of}
    if (
        field.required and not isinstance(field, Law) and (anywhere or not later)
    ):  # what follows *between is given by its keyword
        default = Parameter.empty
    if {"joint", "body"} <= {*element.one_of} and key in ("joint", "body"):
        on = "A joint or coordinate if value is one number, a body or marker if it is three."
        return [Argument("on", key, kind, annotation, Parameter.empty, on)] if key == "joint" else []
    if anywhere and key in ("joint", "between"):
        if key == "joint":
            return [Argument("joint", key, kind, annotation, None, "The joint, instead of ``between``.")]
        return [Argument("*between", key, kind, "Any", None, "Where it acts: one joint or coordinate, or two markers.")]
    if field.required and field.joins:
        return [Argument(name, key, "handle or str", "Any", Parameter.empty, doc) for name in element.ends]
    name = "value" if key == element.name and isinstance(field, Scalar) else key
    return [Argument(name, key, kind, annotation, default, doc)]


def signature_of(element: ElementType) -> Signature:
    """The signature of the method; UsageError if two keys would have arguments of one name."""
    every = arguments_of(element)
    names = ["self", "name", *(one.name.lstrip("*") for one in every)]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise UsageError(
            f"type {element.name!r}: two of its keys would be the argument {twice!r}; rename one, or set ends",
            code="EG-NAME-TAKEN",
        )
    made = [Parameter("self", Parameter.POSITIONAL_ONLY), Parameter("name", Parameter.POSITIONAL_OR_KEYWORD)]
    way: Any = Parameter.POSITIONAL_OR_KEYWORD
    for one in every:
        if one.name.startswith("*"):
            made.append(Parameter(one.name[1:], Parameter.VAR_POSITIONAL, annotation=one.annotation))
            way = Parameter.KEYWORD_ONLY
        else:
            made.append(Parameter(one.name, way, default=one.default, annotation=one.annotation))
    if laws_of(element):
        made.append(Parameter("keys", Parameter.VAR_KEYWORD, annotation="Any"))
    return Signature(made)


def laws_of(element: ElementType) -> list[Law]:
    """The keys of laws of a type."""
    return [field for field in element.keys.values() if isinstance(field, Law)]


def documentation_of(section: str, element: ElementType) -> str:
    """The documentation of the method, in the manner of NumPy."""
    summary, _, more = element.doc.partition(".  ")
    lines = textwrap.wrap(f"Add {summary.removesuffix('.')}.", _WIDTH)
    if element.one_of and not any(one.name in ("on", "*between") for one in arguments_of(element)):
        more = f"{more}  Give exactly one of {', '.join(element.one_of)}.".strip()
    lines += ["", *textwrap.wrap(more, _WIDTH)] if more else []
    lines += ["", "Parameters", "----------", "name : str", "    Identifier."]
    every, skip = arguments_of(element), False
    for k, one in enumerate(every):
        if skip:
            skip = False
            continue
        names = one.name
        if k + 1 < len(every) and every[k + 1].key == one.key:
            names, skip = f"{one.name}, {every[k + 1].name}", True
        needed = element.keys[one.key].required or one.name in ("on", "*between")
        lines.append(f"{names} : {one.kind}{'' if needed else ', optional'}")
        lines += textwrap.wrap(one.doc, _WIDTH, initial_indent="    ", subsequent_indent="    ")
        field = element.keys[one.key]
        lines += _law_lines(field) if isinstance(field, Law) else []
    if laws_of(element):
        lines += ["**keys", "    Keys of laws one by one, as in earlier versions: ``friction=0.3, smoothing=1e-3``."]
    return "\n".join(lines + (["", "Returns", "-------", RESULTS[section][0]] if section in RESULTS else []))


def _law_lines(law: Law) -> list[str]:
    """The types of a law and their keys, each explained once."""
    lines, known = list[str](), set[str]()
    for names, one in law.rows():
        keys = [f"``{key}``" + f", {field.doc}" * (key not in known) for key, field in one.keys.items()]
        known |= one.keys.keys()
        text = f"- {', '.join(f'``{name}``' for name in names)}: {one.doc}  Keys: {'; '.join(keys)}."
        lines += ["", *textwrap.wrap(text, _WIDTH, initial_indent="    ", subsequent_indent="      ")]
    return [*lines, ""]


def method_of(section: str, element: ElementType) -> Callable[..., Any]:
    """The method that adds an entry to a section of a description, an element of a type."""
    signature, every = signature_of(element), arguments_of(element)
    several = (Parameter.VAR_POSITIONAL, Parameter.VAR_KEYWORD)
    allowed = [p.name for p in signature.parameters.values() if p.kind not in several][1:]
    required = [one.name for one in every if one.default is Parameter.empty]
    anywhere = any(one.name == "*between" for one in every)
    laws = laws_of(element)
    allowed += [key for law in laws for key in law.flat]

    def add(self: Described, /, *args: Any, **keys: Any) -> Any:
        check_keywords(element.name, keys, allowed)
        if anywhere:
            args = _take_value(required, args, keys)
        try:
            bound = signature.bind(self, *args, **keys)
        except TypeError as error:
            counterpart = f"joint_{element.name}" if section == "forces" else ""
            more = (
                f"; on the coordinate of a joint use {counterpart}" if hasattr(type(self), counterpart or "-") else ""
            )
            if laws and "too many" in str(error):
                more = _BY_KEYWORD
            raise TypeError(f"{element.name}() {error}{more}") from None
        if section not in _HANDLES:
            bound.apply_defaults()
        raw = {key: value for key, value in bound.arguments.items() if value is not None or key in element.ends}
        name, raw = bound.arguments["name"], {key: x for key, x in raw.items() if key not in ("self", "name")}
        if isinstance(element.keys.get(element.name), Scalar):
            raw = {element.name if key == "value" else key: x for key, x in raw.items()}
        single = raw.pop("keys", {}) if laws else {}
        law, types = raw.get("law", {}), laws[0].types if laws and laws[0].required else None
        if types and not isinstance(law, Mapping) and not (isinstance(law, str) and law in types):
            raw["law"] = {"stiffness": law}
            behind = dict(zip([one.name for one in every], args[1:], strict=False)).get("friction")
            if behind is not None and not isinstance(behind, Mapping):
                raise TypeError(f"{element.name}() takes friction behind the stiffness, a mapping{_BY_KEYWORD}")
        values = _entry(self, element, name, raw) if section in _HANDLES else _said(self, element, raw)
        if section in (*_HANDLES, "functions"):
            values = {"type": element.name, **values, **{key: x for key, x in single.items() if x is not None}}
        entry = self._add(section, name, values, element.keys, element.name if element.name in MODEL else "")
        return RESULTS[section][1](self, entry) if section in RESULTS else None

    add.__name__, add.__qualname__, add.__module__ = element.name, f"Model.{element.name}", "eomgen.api.model"
    add.__doc__ = documentation_of(section, element)
    add.__signature__ = signature  # type: ignore[attr-defined]
    add.__annotations__ = {}
    return add


def _take_value(required: Sequence[str], args: tuple[Any, ...], keys: dict[str, Any]) -> tuple[Any, ...]:
    """The required value may follow what the element acts on without its keyword, which is given here."""
    missing = [name for name in required if name not in keys]
    places = args if "name" in keys else args[1:]
    if (
        len(missing) == 1
        and len(places) > ("joint" not in keys)
        and not isinstance(places[-1], (JointHandle, MarkerHandle))
    ):
        keys[missing[0]] = places[-1]
        return args[:-1]
    return args


def _said(model: Described, element: ElementType, raw: dict[str, Any]) -> dict[str, Any]:
    """What a model file would write of an entry that is no element; whole numbers by default say nothing."""
    values, refer = dict[str, Any](), References(model)
    for key, value in raw.items():
        field = element.keys[key]
        kind = Text if isinstance(value, str) else Rates
        empty = isinstance(value, str | dict) and not value and isinstance(field, kind)
        whole = isinstance(value, int) and not isinstance(field.default, float) and value == field.default
        if not empty and not whole:
            values[key] = field.reference(value, refer)
    return values


def _entry(model: Described, element: ElementType, name: Any, raw: dict[str, Any]) -> dict[str, Any]:
    """What a model file would write."""
    entry, refer = dict[str, Any](), References(model)
    if "on" in raw and "on" not in element.keys:
        on = raw.pop("on")
        several = items(raw.get("value")) is not None
        raw["body" if isinstance(on, MarkerHandle) or (several and not isinstance(on, JointHandle)) else "joint"] = on
    first, second = element.ends
    if first in raw and first not in element.keys:
        key = next(key for key, field in element.keys.items() if field.joins)
        entry[key] = element.keys[key].reference([raw.pop(first), raw.pop(second)], refer)
    elif {"joint", "between"} <= {*element.one_of}:
        entry |= _where(refer, raw.pop("between", ()), raw.pop("joint", None))
    for key, field in element.keys.items():
        if key in raw and not _is_default(raw[key], field):
            if isinstance(raw[key], JointHandle) and key in element.remedies:
                message = f"{raw[key]!r} is not a marker; {element.remedies[key]}"
                raise ill_typed(f"{element.name} {name!r} acts at a marker, and {message}")
            entry[key] = field.reference(raw[key], refer)
    return {key: value for key, value in entry.items() if value is not None}


def _is_default(value: Any, field: Field) -> bool:
    """Whether a number that is given says no more than what holds anyway."""
    numbers = type(value) in (int, float) and type(field.default) in (int, float)
    return numbers and bool(value == field.default)


def _where(refer: References, between: Sequence[Any], joint: Any) -> dict[str, Any]:
    if joint is not None and not between:
        return {"joint": refer.joint(joint)}
    between = items(between) or ()
    if joint is None and len(between) == 1:
        return {"joint": refer.joint(between[0])}
    if joint is None and len(between) == 2:
        return {"between": [refer.marker(marker) for marker in between]}
    raise ill_typed("give one joint or two markers first, and then the values by keyword")


# -- keywords ----------------------------------------------------------------------------------------------------------
def check_keywords(name: str, raw: Iterable[str], allowed: Sequence[str]) -> None:
    """Raise UsageError for the first keyword that a method does not have."""
    for key in raw:
        if key not in allowed:
            if name in JOINTS and key in SWITCHING:
                raise no_such(f"{name} has no argument {key!r}: {IN_PLACE_OF_JOINTS}")
            raise no_such(f"{name} has no argument {key!r}; {nearest(key, allowed, 'it takes')}")
