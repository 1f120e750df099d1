"""Stage describe, names of instances: ``leg1.hip``, as people write it, -> ``leg1_hip``, as the model has it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..base.names import undotted as undotted_name
from .description import Description
from .marker_quantities import ElementQuantity, MarkerQuantity
from .rewritten_texts import rewritten
from .visit import Slot, Visitor, visit


class Undotted(Visitor):
    """Names with a dot after an instance as the model has them.

    Parameters
    ----------
    instances : mapping of str to str
        Name of an instance -> its prefix.
    """

    def __init__(self, instances: Mapping[str, str]) -> None:
        self.instances = instances

    def coordinate(self, name: str) -> str:
        """A name whose first part is an instance: its prefix and the rest, instances within instances too."""
        return undotted_name(name, self.instances)

    body = coordinate

    def scalar(self, value: Any, slot: Slot) -> Any:
        if not isinstance(value, str) or "." not in value:
            return value
        return rewritten(value, self.coordinate, self._renamed, self._renamed)

    def _renamed(self, quantity: MarkerQuantity | ElementQuantity) -> str:
        return str(quantity.renamed(self.coordinate))

    def marker(self, reference: Any, slot: Slot) -> Any:
        return self.coordinate(reference) if isinstance(reference, str) else super().marker(reference, slot)


def undotted(description: Description) -> Description:
    """The description with every ``leg1.hip`` written ``leg1_hip``; the same one where it has no instances."""
    return visit(description, Undotted(description.instances)) if description.instances else description
