"""Stage describe, wrenches in texts: the trees of ``reaction(A, in=rod.tip).x`` and others -> the quantities."""

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
    if not isinstance(node, ast.Attribute) or not isinstance(node.value, ast.Call):
        raise ExpressionError("a reaction has several parts", 0, _WRITE_REACTION)
    call = node.value
    joint = _label(call.args[0]) if len(call.args) == 1 else ""
    axes = [_label(keyword.value) for keyword in call.keywords if keyword.arg == "_n"]
    if not joint or "." in joint or len(axes) != len(call.keywords) or len(axes) > 1 or not all(axes):
        raise ExpressionError("a reaction is that of one joint", 0, _WRITE_REACTION)
    if node.attr not in REACTION_PARTS:
        raise ExpressionError(f"a reaction has no part {node.attr!r}", 0, _WRITE_REACTION)
    if axes and node.attr in ("size", "normal"):
        raise ExpressionError(f"the part {node.attr} does not depend on axes", 0, "leave in= out")
    return ElementQuantity(REACTION, joint, node.attr, axes[0] if axes else "")


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
    if not isinstance(node, ast.Attribute) or not isinstance(node.value, ast.Call):
        raise ExpressionError("what an element exerts on a body has several parts", 0, _WRITE_WRENCH)
    call = node.value
    element = _label(call.args[0]) if len(call.args) == 1 else ""
    given = {keyword.arg: _label(keyword.value) for keyword in call.keywords}
    if element and "." not in element and given.keys() <= {"_n"} and node.attr in WRENCH_PARTS:
        message = f"{WRENCH}({element}).{node.attr} does not say on which body the element acts"
        raise ExpressionError(message, 0, f"add on=marker: {WRENCH}({element}, on=marker).{node.attr}")
    if not element or "." in element or not given.get("on") or not given.keys() <= {"on", "_n"} or "" in given.values():
        raise ExpressionError("what an element exerts on a body is that of one element", 0, _WRITE_WRENCH)
    if node.attr not in WRENCH_PARTS:
        raise ExpressionError(f"what an element exerts has no part {node.attr!r}", 0, _WRITE_WRENCH)
    if "_n" in given and node.attr == "size":
        raise ExpressionError("the part size does not depend on axes", 0, "leave in= out")
    return ElementQuantity(WRENCH, element, node.attr, given.get("_n", ""), given["on"])


def _label(node: ast.expr) -> str:
    """A name, or names between dots; empty for anything else."""
    if isinstance(node, ast.Name):
        return node.id
    if isinstance(node, ast.Attribute):
        before = _label(node.value)
        return f"{before}.{node.attr}" if before else ""
    return ""
