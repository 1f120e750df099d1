"""Program -> a text that says all there is in it, to know again what was written and compiled before."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np

from ..graph.core import Expr, Graph, reachable
from ..graph.functions import Function, NativeCode
from ..numeric.user_functions import Curve, Surface
from .program import Program

#: Types that say what they are by their fields, besides the dataclasses of programs.
FIELDS = (Function, NativeCode, Curve, Surface)

#: Objects by their identity, which they keep while they are held here, and the hash of their fields.
Known = dict[int, tuple[Any, str]]


def fingerprint(program: Program) -> str | None:
    """SHA-256 of everything a program holds; None where it holds what has no text (Python twins of native code).

    Programs of one fingerprint have the same sources, whatever writes them.  The numbers of nodes count too, as they
    decide on orders.
    """
    known: Known = {}
    try:
        text = repr([_spell(getattr(program, part.name), known) for part in fields(program) if part.name != "graph"])
        text += repr(_spell_graph(program, known))
    except TypeError:
        return None
    return hashlib.sha256(text.encode()).hexdigest()


def _spell_graph(program: Program, known: Known) -> list[Any]:
    """The nodes that can be reached, and what calls among them mean."""
    graph: Graph = program.graph
    expressions = [y for block in program.blocks for y in block.roots] + list(program.hoisted)
    if program.system is not None:
        system = program.system
        expressions += [*system.entries, *system.right, *system.sizes, *system.accelerations]
    used = sorted(reachable(graph, [y.id for y in expressions]))
    nodes = [(i, graph.nodes[i]) for i in used]
    calls = {node[0] for _, node in nodes} & graph.calls.keys()
    return [nodes, graph.marks, [(call, _spell(graph.calls[call], known)) for call in sorted(calls)]]


def _spell(value: Any, known: Known) -> Any:
    """A value as what has one exact ``repr``; objects that many hold by what their fields hash to, once for all.

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
        return [kind.__name__, *(_spell(part, known) for part in value)]
    if isinstance(value, tuple) and hasattr(kind, "_fields"):
        parts = zip(kind._fields, value, strict=True)
        return [kind.__qualname__, *((name, _spell(part, known)) for name, part in parts)]
    if isinstance(value, Mapping):
        return ["mapping", *((_spell(k, known), _spell(v, known)) for k, v in value.items())]
    if kind in (set, frozenset):
        return ["set", *sorted(value, key=repr)]
    if kind is np.ndarray:
        return ["array", value.shape, value.dtype.str, value.tobytes()]
    if kind.__module__.startswith("eomgen.") and (kind in FIELDS or hasattr(kind, "__dataclass_fields__")):
        if id(value) not in known:
            # what is worked out once and kept is no part of it
            fields = getattr(kind, "__dataclass_fields__", vars(value))
            told = [_spell(getattr(value, name), known) for name in fields if name != "place"]
            known[id(value)] = value, hashlib.sha256(repr((list(fields), told)).encode()).hexdigest()
        return [kind.__qualname__, known[id(value)][1]]
    raise TypeError(f"{kind.__name__} has no text")
