"""Stage describe, the builder's components: Model.add, and what it gives back."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from ..errors import UsageError, at_odds, ill_typed
from .components import claim, component_of, named_attachments
from .described import Described
from .description import Description, Faults, items
from .handles import BodyHandle, JointHandle, MarkerHandle
from .instance import Component, Instance, add_instance
from .names import fault_of_name
from .references import marker_reference
from .sympy_face import is_sympy, require_name, symbol


class InstanceHandle:
    """A component that was added to a model; names are those of the component.

    Attributes
    ----------
    name : str
        Of the instance, as in ``leg1.hip``.
    prefix : str
        What stands before its names in the model: ``leg1_``.
    """

    def __init__(self, model: ComponentMethods, name: str, prefix: str) -> None:
        self.model, self.name, self.prefix = model, name, prefix

    def __repr__(self) -> str:
        return f"<InstanceHandle {self.name}>"

    @property
    def bodies(self) -> dict[str, BodyHandle]:
        """Handles of its bodies, by their names in the component."""
        return {name: BodyHandle(self.model, entry.name, entry) for name, entry in self._entries("bodies").items()}

    @property
    def joints(self) -> dict[str, JointHandle]:
        """Handles of its joints, by their names in the component."""
        return {name: JointHandle(self.model, entry) for name, entry in self._entries("joints").items()}

    def symbol(self, name: str) -> Any:
        """The SymPy symbol of a parameter, input or coordinate of the component, or of a rate."""
        return symbol(self.prefix + require_name("symbol", name))

    def marker(self, label: str) -> MarkerHandle:
        """A named marker of one of its bodies: ``foot.tip``."""
        return MarkerHandle(self.model, self.prefix + require_name("marker", label))

    def _entries(self, section: str) -> dict[str, Any]:
        made = self.model.description.origins
        return {
            entry.name.removeprefix(self.prefix): entry
            for entry in self.model.description.sections[section]
            if (origin := made.get(f"{section}.{entry.name}")) is not None
            and origin.instance.partition(".")[0] == self.name
        }


class ComponentMethods(Described):
    """The part of Model that takes other models in."""

    def attachment(self, name: str) -> MarkerHandle:
        """Declare a name for a marker of the model to which this one is added as a component; see :meth:`add`.

        Parameters
        ----------
        name : str
            Identifier.

        Returns
        -------
        MarkerHandle
            For joints, forces and outputs, like a marker of a body.
        """
        require_name("attachment", name)
        self._description.values["attachments"] = [*self._description.values.get("attachments", ()), name]
        return MarkerHandle(self, name)

    def add(
        self,
        component: Any,
        /,
        prefix: str = "",
        at: Any = None,
        parameters: Mapping[str, Any] | None = None,
        inputs: Mapping[str, Any] | None = None,
        **values: Any,
    ) -> InstanceHandle:
        """Add all parts of another model (bodies, joints, forces, ...) with a prefix before their names.

        The component is copied: later changes of it do not change this model.  Its gravity, independent
        coordinates and settings of simulations are not used.

        Parameters
        ----------
        component : Model or path
            A model, or the name of a model file.
        prefix : str, optional
            Put before every name of the component; ``leg1_`` makes ``leg1_hip`` of ``hip``; ``leg1.hip`` means it too.
        at : marker, or mapping of names to markers, optional
            For each :meth:`attachment` the marker of this model in its place.  One marker alone stands for the only
            attachment; where there is none, for the component's ground.
        parameters, inputs, **values
            Values of its parameters and inputs.  A number makes it a parameter of this model with that value, so does
            none; an expression of this model's parameters takes its place.  A number is in the component's unit, or in
            that of a mapping: ``l={"value": 500, "unit": "mm"}``.

        Returns
        -------
        InstanceHandle

        Raises
        ------
        UsageError
            The component has no such parameter, input or attachment, or one is missing.
        ModelError
            The file of the component has faults.
        """
        part = _component(component)
        if prefix and fault_of_name(prefix):
            raise UsageError(
                f"prefix={prefix!r} cannot begin a name; use letters, digits and underscores", code="EG-NAME-FORM"
            )
        groups = {"parameters": parameters or {}, "inputs": inputs or {}, "": values}
        for what, group in groups.items():
            if not isinstance(group, Mapping):
                raise ill_typed(f"add {part.name}: {what} must be a mapping of names to values, not {group!r}")
        given = [name for group in groups.values() for name in group]
        if twice := sorted({name for name in given if given.count(name) > 1}):
            raise at_odds(f"add {part.name}: {', '.join(twice)} given twice; give each value once")
        numbers = {n: _plain(value) for group in groups.values() for n, value in group.items() if value is not None}
        description = self._description
        made = replace(description, lines=dict(description.lines), origins=dict(description.origins), problems=[])
        made.values, made.instances = dict(description.values), dict(description.instances)
        made.sections = {section: list(entries) for section, entries in description.sections.items()}
        made.sections["bodies"] = [replace(entry, values=dict(entry.values)) for entry in made.sections["bodies"]]
        faults = Faults(Description())
        named = named_attachments(part, self._references(at), "at", faults.add)
        name = prefix.rstrip("_") or part.name
        instance = Instance(name, prefix, named or {}, numbers)
        if named is not None and claim(made, instance, "prefix", faults.add):
            add_instance(made, part, instance, "add", faults)
        if faults:
            told = "; ".join(f"{p.message}{f' ({p.remedy})' if p.remedy else ''}" for p in faults.problems)
            raise UsageError(f"add {part.name}: {told}", code=faults.problems[0].code)
        description.lines, description.origins, description.instances = made.lines, made.origins, made.instances
        for section, entries in made.sections.items():
            known = description.sections[section]
            for old, new in zip(known, entries, strict=False):  # handles hold the entries
                old.values = new.values
            known += entries[len(known) :]
        for key in ("initial", "guess"):
            if key in made.values and made.values[key] is not description.values.get(key):
                description.values[key] = made.values[key]
        return InstanceHandle(self, name, prefix)

    def _references(self, at: Any) -> Any:
        if isinstance(at, Mapping) and "body" not in at:
            return {name: _plain(marker_reference(self, marker)) for name, marker in at.items()}
        return None if at is None else _plain(marker_reference(self, at))


def _component(given: Any) -> Component:
    """A component of a Model, or of the file of one."""
    faults = Faults(Description())
    if isinstance(given, str | os.PathLike):
        from .yaml_file import describe_yaml_file

        description = describe_yaml_file(given)
    elif isinstance(given, Described):
        from .plain_form import plain_description

        description = plain_description(given.description)
    else:
        raise ill_typed(f"{given!r} is not a component; give a Model, or the name of a model file")
    name = str(description.values.get("name", "component"))
    part = component_of(description, name, f"components.{name}.", faults.add)
    for problem in (*description.problems, *faults.problems):
        raise UsageError(f"add {name}: {problem}", code=problem.code)
    return part


def _plain(value: Any) -> Any:
    """A value as numbers and texts."""
    if is_sympy(value):
        from .sympy_text import sympy_text

        return sympy_text(value)
    if isinstance(value, Mapping):
        return {key: _plain(part) for key, part in value.items()}
    listed = None if isinstance(value, str) else items(value)
    return value if listed is None else [_plain(part) for part in listed]
