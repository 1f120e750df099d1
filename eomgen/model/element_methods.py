"""A method for every type in the tables; element_methods.pyi lists them."""

from __future__ import annotations

from types import MethodType
from typing import Any

from ..elements.constraints import CONSTRAINTS
from ..elements.element_type import ElementType
from ..elements.forces import FORCES
from ..elements.joints import JOINTS
from .fields import joint_type
from .handles import Described, JointHandle, References
from .methods import method_of


def tables() -> dict[str, dict[str, ElementType]]:
    """Section -> its types, those that were added to the tables after eomgen's own among them."""
    return {"joints": {name: joint_type(name) for name in JOINTS}, "forces": FORCES, "constraints": CONSTRAINTS}


class ElementMethods(Described):
    """Methods of Model that add elements; bodies, markers and joints are handles or names.

    Where a joint is asked for, a coordinate (its SymPy symbol or its name) says which one of several is meant.
    """

    def joint(self, type: str, name: str, predecessor: Any, successor: Any, **keys: Any) -> JointHandle:
        """Add a joint of any type.

        Parameters
        ----------
        type : str
            A type of joint, e.g. ``"revolute"``.
        name : str
            Identifier.
        predecessor, successor : handle or str
            Bodies or markers.
        **keys
            Whatever the method of the type takes.

        Returns
        -------
        JointHandle
        """
        between = [References(self).marker(end) for end in (predecessor, successor)]
        given = {key: value for key, value in keys.items() if value is not None}
        return JointHandle(self, self._add("joints", name, {"type": type, "between": between, **given}))

    def _method(self, name: str) -> Any:
        """The method of a type that was added to the tables later; None if there is none."""
        for section, types in tables().items():
            if name in types:
                return MethodType(method_of(section, types[name]), self)
        return None


class _Unmade:
    """In the place of a type's method until it is first used: to make all of them takes 15 ms."""

    def __init__(self, section: str, type: ElementType) -> None:
        self.section, self.type = section, type

    def __get__(self, model: Described | None, kind: Any) -> Any:
        method = method_of(self.section, self.type)
        setattr(ElementMethods, self.type.name, method)
        return method if model is None else MethodType(method, model)


for _section, _types in tables().items():
    for _found in _types.values():
        setattr(ElementMethods, _found.name, _Unmade(_section, _found))
