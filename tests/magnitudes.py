"""How large the terms behind a result are: what an error of a few units in the last place is measured by."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from eomgen.graph.core import Expr
from eomgen.graph.traverse import LEAVES, reachable
from eomgen.operations import OPERATIONS


def largest_terms(outputs: Sequence[Expr], values: Mapping[str, float]) -> np.ndarray:
    """For each output the magnitude of the largest term that went into it.

    A sum has that of its largest term, a product the product, a quotient the quotient grown by the divisor's own
    cancellation, a function that of its argument or of its value.
    """
    if not outputs:
        return np.zeros(0)
    graph = outputs[0].graph
    value: dict[int, float] = {}
    size: dict[int, float] = {}
    with np.errstate(all="ignore"):
        for i in reachable(graph, [y.id for y in outputs]):
            operation, *operands = graph.nodes[i]
            if operation in LEAVES:
                value[i] = operands[0] if operation == "const" else values[operands[0]]
                size[i] = abs(value[i])
                continue
            a = [value[k] for k in operands]
            m = [size[k] for k in operands]
            value[i] = OPERATIONS[operation].value(*a)
            if operation in ("add", "sub"):
                size[i] = max(m)
            elif operation == "mul":
                size[i] = m[0] * m[1]
            elif operation == "div":
                size[i] = max(m[0], abs(value[i]) * m[1]) / abs(a[1])
            elif operation == "sqrt":
                size[i] = m[0] / value[i] if value[i] else 0.0
            elif operation == "select":
                size[i] = m[1] if a[0] else m[2]
            else:
                size[i] = max(abs(value[i]), *m)
    return np.array([size[y.id] for y in outputs])
