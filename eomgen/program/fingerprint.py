"""Stage program: Program -> a text that says all there is in it, to know again what was written and compiled before."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np

from ..graph.core import Expr, Graph
from ..graph.functions import Function, NativeCode
from ..graph.traverse import reachable
from ..numeric.user_functions import Curve, Surface
from .program import Program

#: Types that say what they are by their fields, besides the dataclasses of programs.
FIELDS = (Function, NativeCode, Curve, Surface)


def fingerprint(program: Program) -> str | None:
    """SHA-256 of everything a program holds; None where it holds what has no text (Python twins of native code).

    Programs of one fingerprint have the same sources, whatever writes them.  The numbers of nodes count too, as they
    decide on orders.
    """
    try:
        text = repr([_spell(getattr(program, part.name)) for part in fields(program) if part.name != "graph"])
        text += repr(_spell_graph(program))
    except TypeError:
        return None
    return hashlib.sha256(text.encode()).hexdigest()


def _spell_graph(program: Program) -> list[Any]:
    """The nodes that can be reached, and what calls among them mean."""
    graph: Graph = program.graph
    expressions = [y for block in program.blocks for y in (*block.outputs, *block.checks)] + list(program.hoisted)
    if program.system is not None:
        system = program.system
        expressions += [*system.entries, *system.right, *system.sizes, *system.accelerations]
    used = sorted(reachable(graph, [y.id for y in expressions]))
    nodes = [(i, graph.nodes[i]) for i in used]
    calls = {node[0] for _, node in nodes} & graph.calls.keys()
    return [nodes, graph.marks, [(call, _spell(graph.calls[call])) for call in sorted(calls)]]


def _spell(value: Any) -> Any:
    """A value as what has one exact ``repr``.

    Raises
    ------
    TypeError
        It has none.
    """
    kind = type(value)
    if kind in (str, int, float, bool, type(None)):
        return value
    if kind is Expr:
        return ("node", value.id)
    if kind in (tuple, list):
        return [kind.__name__, *map(_spell, value)]
    if isinstance(value, tuple) and hasattr(kind, "_fields"):
        return [kind.__qualname__, *((name, _spell(part)) for name, part in zip(kind._fields, value, strict=True))]
    if isinstance(value, Mapping):
        return ["mapping", *((_spell(k), _spell(v)) for k, v in value.items())]
    if kind in (set, frozenset):
        return ["set", *sorted(value, key=repr)]
    if kind is np.ndarray:
        return ["array", value.shape, value.dtype.str, value.tobytes()]
    if kind.__module__.startswith("eomgen.") and (kind in FIELDS or hasattr(kind, "__dataclass_fields__")):
        fields = getattr(kind, "__dataclass_fields__", vars(value))  # what is worked out once and kept is no part of it
        return [kind.__qualname__, *((name, _spell(getattr(value, name))) for name in fields if name != "place")]
    raise TypeError(f"{kind.__name__} has no text")
