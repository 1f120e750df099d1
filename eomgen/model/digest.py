"""Mechanism -> a digest that tells whether two results come from one model.

It follows from what is computed: names, numbers and expressions, whichever way they were written down.  Documentation
and lines of files do not count.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.operations import OPERATIONS
from ..elements.kinds import Field
from ..expr.core import LEAVES, Expr, Graph, reachable

if TYPE_CHECKING:
    from .mechanism import Mechanism

#: Attributes that nothing is computed from.
ASIDE = frozenset(
    {
        "doc",
        "docs",
        "latex",
        "instances",
        "lines",
        "notes",
        "place",
        "graph",
        "functions",
        "file",
        "named_markers",
        "body_shapes",
        "added_bodies",
        "limits_told",
        "default_gravity",
        "of_velocities",
        "requirements",
    }
)


#: What counts of a key of a joint's own, and how its kind is spelled: digests are compared over versions.
_OF_A_KEY = (
    *("doc", "required", "default", "level", "choices", "own", "not_zero", "dimension", "along", "exponent", "local"),
)
_KINDS = {"Choice": "choice", "Scalar": "expression", "GuidePoint": "shape"}


def model_digest(mechanism: Mechanism) -> str:
    """SHA-256 of a mechanism, as 64 hexadecimal digits.

    A node counts by its operation and its operands, not by its number, so that expressions that were looked at on the
    way, and orders in which they were made, change nothing.
    """
    known: dict[int, str] = {}
    if mechanism.lagrangian is not None:  # the equations follow from it
        mechanism = replace(mechanism, given=None)
    return _hash(repr(_spell(mechanism, mechanism.graph, known)))


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8", "backslashreplace")).hexdigest()


def _spell_node(x: Expr, known: dict[int, str]) -> str:
    graph: Graph = x.graph
    if x.id not in known:
        for i in reachable(graph, [x.id], stop=known):
            if i in known:
                continue
            operation, *rest = graph.nodes[i]
            if operation in LEAVES:
                known[i] = _hash(repr((operation, *rest)))
                continue
            parts = [known[k] for k in rest]
            meaning = _spell(graph.calls.get(operation, operation), graph, known)
            row = OPERATIONS.get(operation)
            known[i] = _hash(repr((meaning, sorted(parts) if row is not None and row.commutative else parts)))
    return known[x.id]


def _spell(value: Any, graph: Graph, known: dict[int, str]) -> Any:
    """A value as what has one exact ``repr``, the same in every process."""
    if value is None or isinstance(value, (str, int, float, bool, type)):
        return value if not isinstance(value, type) else value.__qualname__
    if isinstance(value, Expr):
        return ("node", _spell_node(value, known) if value.graph is graph else _spell_node(value, {}))
    if isinstance(value, Mapping):
        return ["mapping", *sorted((repr(k), _spell(one, graph, known)) for k, one in value.items())]
    if isinstance(value, (tuple, list)):
        return ["list", *(_spell(one, graph, known) for one in value)]
    if isinstance(value, (set, frozenset)):
        return ["set", *sorted(repr(_spell(one, graph, known)) for one in value)]
    if isinstance(value, (np.ndarray, np.generic)):
        array = np.ascontiguousarray(value)
        return ["array", array.shape, array.dtype.str, hashlib.sha256(array.tobytes()).hexdigest()]
    kind = type(value)
    if isinstance(value, Field):
        parts = [getattr(value, name) for name in _OF_A_KEY]
        return ["list", _KINDS[kind.__name__], *(_spell(one, graph, known) for one in parts)]
    if kind.__module__.startswith("eomgen."):
        fields = [(name, one) for name, one in sorted(_fields(value).items()) if name not in ASIDE]
        return [kind.__qualname__, *((name, _spell(one, graph, known)) for name, one in fields)]
    return ["other", getattr(value, "__module__", ""), getattr(value, "__qualname__", kind.__qualname__)]


def _fields(value: Any) -> dict[str, Any]:
    """The attributes of an object; of a dataclass its fields alone, as others may have been looked up since."""
    if (declared := getattr(value, "__dataclass_fields__", None)) is not None:
        return {name: getattr(value, name) for name in declared}
    slots = [name for kind in type(value).__mro__ for name in getattr(kind, "__slots__", ())]
    found = {name: getattr(value, name) for name in slots if hasattr(value, name) and not name.startswith("__")}
    return {**found, **getattr(value, "__dict__", {})}
