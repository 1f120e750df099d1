"""The trees of ``reaction(A, in=rod.tip).x`` and others -> the quantities."""

from __future__ import annotations

import ast

from ..errors import ExpressionError
from .marker_quantities import ElementQuantity
from .names import MULTIPLIER, REACTION, REACTION_PARTS, WRENCH, WRENCH_PARTS

_WRITE_REACTION = (
    f"write {REACTION}(joint).part or {REACTION}(joint, in=marker).part; parts: {', '.join(REACTION_PARTS)}"
)
_WRITE_WRENCH = (
    f"write {WRENCH}(element, on=marker).part or {WRENCH}(element, on=marker, in=marker).part; parts: "
    f"{', '.join(WRENCH_PARTS)}"
)
_WRITE_MULTIPLIER = f"write {MULTIPLIER}(mesh) or, where an element has several equations, {MULTIPLIER}(roll.height)"


def reaction_in(node: ast.expr) -> ElementQuantity:
    """The part of a joint's reaction; ``in`` stands in the tree as ``_n``.

    Raises
    ------
    ExpressionError
    """
    joint, given, part = _parts_of(node, "a reaction", _WRITE_REACTION)
    if not joint or not given.keys() <= {"_n"}:
        raise ExpressionError("a reaction is that of one joint", 0, _WRITE_REACTION)
    return _quantity(REACTION, joint, given, part, "a reaction", (REACTION_PARTS, _WRITE_REACTION))


def multiplier_in(node: ast.expr) -> ElementQuantity:
    """The multiplier of an equation of a constraint or of a joint.

    Raises
    ------
    ExpressionError
    """
    row = _label(node.args[0]) if isinstance(node, ast.Call) and len(node.args) == 1 and not node.keywords else ""
    if not row or row.count(".") > 1:
        raise ExpressionError("a multiplier is that of one equation", 0, _WRITE_MULTIPLIER)
    return ElementQuantity(MULTIPLIER, row)


def wrench_in(node: ast.expr) -> ElementQuantity:
    """The part of what an element exerts on the body of a marker.

    Raises
    ------
    ExpressionError
    """
    element, given, part = _parts_of(node, "what an element exerts on a body", _WRITE_WRENCH)
    if element and given.keys() <= {"_n"} and part in WRENCH_PARTS:
        message = f"{WRENCH}({element}).{part} does not say on which body the element acts"
        raise ExpressionError(message, 0, f"add on=marker: {WRENCH}({element}, on=marker).{part}")
    if not element or "on" not in given or not given.keys() <= {"on", "_n"}:
        raise ExpressionError("what an element exerts on a body is that of one element", 0, _WRITE_WRENCH)
    return _quantity(WRENCH, element, given, part, "what an element exerts", (WRENCH_PARTS, _WRITE_WRENCH))


def _parts_of(node: ast.expr, what: str, write: str) -> tuple[str, dict[str | None, str], str]:
    """The element, the markers by keyword and the part of ``function(element, keyword=marker).part``.

    The element is empty if the text names none, or if a keyword has no marker.
    """
    if not isinstance(node, ast.Attribute) or not isinstance(node.value, ast.Call):
        raise ExpressionError(f"{what} has several parts", 0, write)
    call = node.value
    element = _label(call.args[0]) if len(call.args) == 1 else ""
    given = {keyword.arg: _label(keyword.value) for keyword in call.keywords}
    whole = "." not in element and "" not in given.values() and len(given) == len(call.keywords)
    return element if whole else "", given, node.attr


def _quantity(
    function: str, element: str, given: dict[str | None, str], part: str, what: str, known: tuple[tuple[str, ...], str]
) -> ElementQuantity:
    parts, write = known
    if part not in parts:
        raise ExpressionError(f"{what} has no part {part!r}", 0, write)
    if "_n" in given and part in ("size", "normal"):
        raise ExpressionError(f"the part {part} does not depend on axes", 0, "leave in= out")
    return ElementQuantity(function, element, part, given.get("_n", ""), given.get("on", ""))


def _label(node: ast.expr) -> str:
    """A name, or names between dots; empty for anything else."""
    if isinstance(node, ast.Name):
        return node.id
    if isinstance(node, ast.Attribute):
        before = _label(node.value)
        return f"{before}.{node.attr}" if before else ""
    return ""
