"""Functions declared from outside (tables, native code) -> calls and derivatives of calls as nodes.

A call is a node whose operation is the text ``name(orders)``: ``spring(0)`` is the value of the function ``spring`` of
one argument, ``map(1,0)`` the derivative of ``map`` along its first.  The chain rule raises the orders.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..errors import ModelError, Problem
from .records import dataclass
from .user_functions import Curve, Orders, Surface, Twin


@dataclass(frozen=True)
class NativeCode:
    """A function in C.

    Attributes
    ----------
    file : str
        Name of the source file, for messages.
    text : str
        The source.
    names : tuple of (orders, name)
        C functions of the value and of the derivatives that the source has.
    """

    file: str
    text: str
    names: tuple[tuple[Orders, str], ...]


@dataclass(frozen=True, eq=False)
class Function:
    """A function that expressions may call.

    Attributes
    ----------
    evaluator : Curve, Surface, Twin or None
        Its values in NumPy; None for native code without a Python twin.
    native : NativeCode, optional
        Its C source, if it is no table.
    place : (file, line)
        Where a model file declares it, for messages.
    """

    name: str
    arity: int
    evaluator: Curve | Surface | Twin | None
    native: NativeCode | None = None
    place: tuple[str, int] = ("", 0)

    @property
    def highest(self) -> int | None:
        """Highest order of derivative that does not vanish; None if there is no such limit."""
        return 3 if self.native is None else None

    def operation(self, orders: Orders) -> str:
        """The operation of a call."""
        return f"{self.name}({','.join(map(str, orders))})"

    def implementation(self, orders: Orders) -> Callable[..., Any]:
        """The value or a derivative as a function of floats or arrays, or of one tuple of them."""

        def call(*arguments: Any) -> Any:
            if len(arguments) < self.arity:  # packed
                (arguments,) = arguments
            return self.require_evaluator()(*arguments, *orders)

        return call

    def require_evaluator(self) -> Curve | Surface | Twin:
        """The evaluator in NumPy.

        Raises
        ------
        ModelError
            The function is native code without a Python twin.
        """
        if self.evaluator is None:
            message = "is a C function without a Python version, and must be evaluated in NumPy here"
            remedy = (
                "give the Python version under python; it is not needed for target cython or c if masses, constraints "
                "and initial values do not call the function"
            )
            raise ModelError([Problem(f"functions.{self.name}", message, remedy, *self.place, code="EG-MISSING")])
        return self.evaluator


def raised(orders: Orders, i: int) -> Orders:
    """The orders with one derivative more along argument i."""
    return (*orders[:i], orders[i] + 1, *orders[i + 1 :])
