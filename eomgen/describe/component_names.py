"""Names of a component: those that it declares, and the same as one of its instances has them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ..base.notation import with_instance
from ..errors import UsageError
from ..joints import JOINTS
from .build_cams import needs_point
from .build_joints import coordinate_names, sketch
from .build_states import COUNTER, EVENT
from .build_switches import CLOSED, is_switched
from .description import GROUND_NAME, Description
from .element_entry import states_of
from .marker_quantities import ElementQuantity, MarkerQuantity
from .names import COM, QUANTITIES, TOTALS, function_words
from .placed_on import placed_on
from .rewritten_texts import in_brackets, rewritten
from .scope import ENERGIES, RATES
from .visit import Slot, Visitor

#: Words of expressions that no model declares.
WORDS = frozenset(("t", "pi", "and", "or", "not", "if", "else", *ENERGIES, *TOTALS, *QUANTITIES, *function_words()))


class OwnNames:
    """Names that a description declares: symbols of expressions, bodies, joints."""

    def __init__(self, description: Description) -> None:
        sections = description.sections

        def named(*places: str) -> set[str]:
            return {entry.name for place in places for entry in sections[place] if isinstance(entry.name, str)}

        self.bodies = named("bodies") - {GROUND_NAME}
        self.joints = named("joints")
        self.symbols = named("parameters", "inputs", "functions", "states", "outputs", "events")
        for entry in sections["joints"]:
            kind = entry.values.get("type")
            if not isinstance(entry.name, str):
                continue
            if not isinstance(kind, str) or kind not in JOINTS:  # told when the model is checked
                self.symbols |= {entry.name, str(entry.values.get("coordinate", entry.name))}
                continue
            joint = sketch(kind, entry.values)
            self.symbols |= {str(name) for name in coordinate_names(kind, entry.name, entry.values, joint)[0]}
            self.symbols |= {entry.name + velocity.suffix for velocity in joint.velocities if velocity.of is None}
        self.symbols |= {name for entry in sections["forces"] for name in states_of(entry)}
        self.symbols |= {f"{entry.name}{CLOSED}" for entry in sections["constraints"] if is_switched(entry)}
        for entry in sections["states"]:
            if "period" in entry.values and isinstance(entry.name, str):
                self.symbols |= {entry.name + COUNTER, entry.name + EVENT}
        for entry in sections["constraints"]:
            if needs_point(entry.values):
                self.symbols.add(str(entry.values.get("coordinate", f"{entry.name}_contact")))

    def has_symbol(self, name: str) -> bool:
        """Whether a name, or the quantity whose rate it is, is declared."""
        return any(name.endswith(rate) and name[: len(name) - len(rate)] in self.symbols for rate in RATES)


class Attached:
    """What stands in the place of an attachment: a marker of the model, and where it is in its body."""

    def __init__(self, reference: Any, body: str, placed: Mapping[str, Any] | None) -> None:
        self.reference, self.body, self.placed = reference, body, placed


class Renaming(Visitor):
    """A component's names as an instance has them, its attachments the markers given, its parameters put in.

    Parameters
    ----------
    own : OwnNames
    prefix : str
        Put before every name of the component.
    values : mapping of str to str
        Parameters and inputs in whose place an expression of the model stands.
    attached : mapping of str to Attached
        By attachment, ground among them.
    closed : bool
        Whether names that the component does not declare are faults.
    fault : callable
        Told path, message and remedy of what cannot be said.
    """

    def __init__(
        self,
        own: OwnNames,
        prefix: str,
        values: Mapping[str, str],
        attached: Mapping[str, Attached],
        closed: bool,
        fault: Callable[[str, str, str, str], None],
    ) -> None:
        self.own, self.prefix, self.values, self.attached = own, prefix, values, attached
        self.closed, self.fault = closed, fault
        self.markers: dict[str, tuple[str, Mapping[str, Any]]] = {}  #: name -> body and place of markers to add

    def word(self, name: str, slot: Slot) -> str:
        """A name in an expression."""
        if name in self.values:
            return in_brackets(self.values[name])
        if self.own.has_symbol(name):
            return self.prefix + name
        if name not in WORDS:
            self._foreign(
                name,
                slot,
                "declare a parameter or an input of that name in it, and give it where you add the component",
            )
        return name

    def scalar(self, value: Any, slot: Slot) -> Any:
        hidden = slot.field.local if slot.field else ()

        def locate(quantity: MarkerQuantity) -> str:
            return str(quantity.renamed(place))

        def element(quantity: ElementQuantity) -> str:
            return str(quantity.renamed(lambda name: self.prefix + name, place))

        def place(marker: str) -> str:
            if marker == COM and COM not in self.own.bodies:
                return marker
            found = self.marker(marker, slot)
            return found if isinstance(found, str) else self._named(marker, found)

        return rewritten(value, lambda name: name if name in hidden else self.word(name, slot), locate, element)

    def coordinate(self, name: str) -> str:
        known = name in self.own.joints or self.own.has_symbol(name)
        return self.prefix + name if known or self.closed else name

    def latex(self, text: Any) -> Any:
        return with_instance(text, self.prefix.strip("_")) if isinstance(text, str) and text else text

    def body(self, name: str) -> str:
        if name in self.attached:
            return self.attached[name].body
        return self.prefix + name if name in self.own.bodies or self.closed else name

    def marker(self, reference: Any, slot: Slot) -> Any:
        body = reference.get("body") if isinstance(reference, Mapping) else reference
        if not isinstance(body, str):
            return reference
        body, _, name = body.partition(".")
        if body in self.attached:
            return self._on_attachment(body, name, reference, slot)
        if body not in self.own.bodies:
            self._foreign(
                body, slot, f"it has the bodies and attachments {', '.join([*self.own.bodies, *self.attached])}"
            )
            return reference if isinstance(reference, str) else super().marker(reference, slot)
        return super().marker(reference, slot)

    def _on_attachment(self, body: str, name: str, reference: Any, slot: Slot) -> Any:
        found = self.attached[body]
        if isinstance(reference, str):
            if name:  # a marker that the component gives to ground
                return f"{found.body}.{self.prefix}{name}"
            return found.reference
        if found.body == found.reference:
            return {**super().marker(reference, slot), "body": found.body}
        placed = {key: self.vector(value, slot.named(key)) for key, value in reference.items() if key != "body"}
        return {"body": found.body, **self.placed(body, placed, slot)}

    def placed(self, attachment: str, placed: Mapping[str, Any], slot: Slot) -> Mapping[str, Any]:
        """A place in the axes of an attachment, in the axes of the body that it is on."""
        found = self.attached[attachment]
        try:
            return placed_on(found.placed or {}, placed)
        except UsageError as error:
            path = f"{slot.entry.path}.{slot.key}" if slot.entry else slot.key
            remedy = "declare an attachment at that place in the component"
            self.fault(path, f"at {attachment!r} it {error}", remedy, "EG-UNSUPPORTED")
            return placed

    def _named(self, attachment: str, reference: Mapping[str, Any]) -> str:
        """The label of a marker that expressions can speak of, in the place of an attachment without a name."""
        name = self.prefix + attachment
        self.markers[name] = (reference["body"], {k: v for k, v in reference.items() if k != "body"})
        return f"{reference['body']}.{name}"

    def _foreign(self, name: str, slot: Slot, remedy: str) -> None:
        if self.closed and slot.entry is not None:
            message = f"{name!r} is not declared in the component, and a component knows only its own names"
            self.fault(f"{slot.entry.path}.{slot.key}", message, remedy, "EG-NAME-UNKNOWN")
